"""CSV and similar texts: comma, semicolon, tab, bar or blanks, decimal point or comma, any
encoding, preamble and units row.

The text is read in blocks that end where lines end, so that a log of many hours needs no more
memory than its numbers. Arrow parses each block with all cores; only a block with an unusual cell
or row is parsed row by row.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Sequence
from functools import cache, partial
from pathlib import Path

import msgspec
import numpy as np
import pyarrow as pa
from pyarrow import csv

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import find_unit
from winchcascade.core.run import Finding
from winchcascade.ingest.cells import (
    NOT_NUMBERS,
    decimal_sign,
    is_cut,
    is_value,
    looks_like_a_number,
    numbers,
    split_row,
)
from winchcascade.ingest.headers import Header, read_header, recognise
from winchcascade.ingest.labview import labview_table
from winchcascade.ingest.layout import (
    PREAMBLE_ROWS_MAX,
    SAMPLE_ROWS,
    channels_named,
    find_data,
    headers_above,
    properties_of,
    waveform,
)
from winchcascade.ingest.source import LogSource, LogTable, log_table
from winchcascade.ingest.stamps import serial_days

HEAD_BYTES = 1 << 18
"""Beginning of a file in which its layout is found. [bytes]"""

TEXT_BYTES, THREAD_BYTES = 1 << 22, 1 << 20
"""Text that is parsed at a time, and the part of it that a thread parses. [bytes]"""

LINE_BYTES_MAX = 1 << 24
"""A longer line is no row of a few numbers. [bytes]"""

MARKS_MAX = 200
"""Texts for "no number" that Arrow is given; a file with more of them is read row by row."""

RAGGED_ROWS_MAX, RAGGED_SHARE_MAX = 10, 0.5
"""Rows with cells too many or too few that a table may have: the larger of a number and a share
of the other rows.
"""

_MARKS = {
    "utf-8-sig": (codecs.BOM_UTF8,),
    "utf-32": (codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE),
    "utf-16": (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE),
}
"""How files in some encodings begin; that of UTF-32 begins as that of UTF-16 does."""

_ENCODINGS = (
    "cp950",
    "cp1252",
    "cp932",
    "gb18030",
    "cp949",
    "cp1251",
    "cp1250",
    "euc_jp",
    "koi8-r",
    "cp850",
)
_LABVIEW_HEADING = re.compile(
    rb"^(?!nan\b|inf)(?:[*]{3}End_|[a-z])[^\n]*\n?", re.IGNORECASE | re.MULTILINE
)
"""A line of the heading that LabVIEW repeats above each segment; a row of data begins with a
number or an empty cell.
"""


class Layout(msgspec.Struct, frozen=True):
    """Where and how a text keeps its table.

    Parameters
    ----------
    delimiter : one character; a blank stands for any run of blanks
    headers : the columns in order; one that is empty or only counts rows has no name
    more : there are names beyond the last column that rows usually have, of remarks as a rule
    first : index of the first line of data
    columns : cells of each column in the first rows of data
    properties : what the lines above the table state, keys as written
    labview : the file is a LabVIEW measurement, in which the heading may stand above every segment
    """

    delimiter: str
    decimal: str
    headers: tuple[Header, ...]
    more: bool
    first: int
    columns: list[list[str]]
    properties: dict[str, str]
    labview: bool


def open_text(path: Path, *, numbered: bool = False) -> LogSource:
    """Open a text log; where the columns are `numbered`, it needs no names.

    Raises
    ------
    LogError : no table of numbers with column names in it
    """
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    encoding = find_encoding(head)
    text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(head).rstrip("\0")
    if not text or text.count("\0") > len(text) // 20:
        raise LogError(
            f"{path.name}: is a binary file of no known format; expected CSV, TDMS, MATLAB, "
            f"Parquet or Excel. Check that "
            f"this is a log."
        )
    lines = text.split(
        "\n" if "\n" in text else "\r", 2 * PREAMBLE_ROWS_MAX
    )  # as _blocks counts them
    if len(head) == HEAD_BYTES and len(lines) < 4:
        raise LogError(
            f"{path.name}: lines of more than {HEAD_BYTES // 4 >> 10} kB; expected a log with a "
            f"few dozen columns. Check "
            f"that this is a log."
        )
    layout = find_layout(lines, path.name, numbered=numbered)
    step, start = waveform(layout.properties)
    load = partial(_load, path, encoding, layout, step)
    return LogSource(layout.headers, load, step, start, dict(layout.properties))


def find_encoding(head: bytes) -> str:
    """Guess the encoding of a file from its beginning: a mark, UTF-8, zeros of UTF-16, else the
    one that reads best.
    """
    for encoding, marks in _MARKS.items():
        if head.startswith(marks):
            return encoding
    if head[:400].count(b"\0") > len(head[:400]) // 4:
        return "utf-16-le" if head[1:2] == b"\0" else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
        return "utf-8"
    except UnicodeDecodeError:
        # Letters beyond ASCII stand alone or in twos in European words, in long runs in Chinese,
        # Japanese and Korean.
        long_runs = re.search(rb"[\x80-\xff]{3}", head[:4096]) is not None
        order = _ENCODINGS if long_runs else _ENCODINGS[1:] + _ENCODINGS[:1]
        return max(order, key=partial(_recognised, head))  # the first of equals


def _recognised(head: bytes, encoding: str) -> int:
    """Count headers and units that are recognised under an encoding; -1 for one that cannot
    decode the text at all.
    """
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return -1
    cells = {
        cell[:200]
        for line in text.splitlines()[:50]
        for cell in re.split(r"[,;\t|]", line[:20_000])
    }
    units = sum(
        find_unit(inside) is not None
        for c in cells
        for inside in re.findall(r"[(\[]([^)\]]+)[)\]]", c)
    )
    return sum(recognise(Header(cell)) is not None for cell in cells if cell.strip()) + units


def find_layout(lines: Sequence[str], where: str, *, numbered: bool = False) -> Layout:
    """Find the table in the first lines of a file, under the delimiter that gives most values in a
    row.

    Raises
    ------
    LogError : no rows of numbers, or rows without names above them
    """
    measurement = (
        labview_table(lines, where) if lines[0].startswith("LabVIEW Measurement") else None
    )
    if measurement is not None:
        delimiter, first, headers, columns = measurement
        properties = properties_of([line.replace(delimiter, "\t") for line in lines[:first]])
    else:
        delimiter, first, columns = _find_table(lines, where)
        above = [_name_cells(line, delimiter, len(columns)) for line in lines[:first]]
        headers = headers_above(above, columns, where, numbered=numbered)
        properties = properties_of(lines[:first])
    width = len(columns)
    return Layout(
        delimiter,
        decimal_sign(columns),
        tuple(headers[:width]),
        len(headers) > width,
        first,
        columns,
        properties,
        measurement is not None,
    )


def _find_table(lines: Sequence[str], where: str) -> tuple[str, int, list[list[str]]]:
    """Delimiter, index of the first line of data, and the cells of each column in the first rows
    of data; LogError for none.
    """
    head = lines[:PREAMBLE_ROWS_MAX]
    text = "\n".join(head)
    found: list[tuple[str, int, list[list[str]]]] = []
    for delimiter in ",;\t| ":
        # Blanks also stand inside of stamps and names.
        if delimiter in text and not (found and delimiter == " "):
            cut = cache(lambda k, delimiter=delimiter: split_row(lines[k], delimiter))
            data = find_data(cut, min(len(lines), PREAMBLE_ROWS_MAX + SAMPLE_ROWS))
            found += [] if data is None else [(delimiter, *data)]
    if len(found) > 1:  # the one with most values in a row, less for one that begins late
        values = [
            sum(bool(cell) and is_value(cell) for column in c for cell in column) / len(c[0])
            for _, _, c in found
        ]
        return found[
            max(range(len(found)), key=lambda k: values[k] - found[k][1] / (10 * PREAMBLE_ROWS_MAX))
        ]
    if found:
        return found[0]
    begins = next((line.strip()[:40] for line in head if line.strip()), "")
    named = any(
        channels_named(split_row(line, delimiter)) > 1 for delimiter in ",;\t" for line in head
    )
    what = (
        "column names but no rows of numbers"
        if named
        else f"no table of numbers (it begins with {begins!r})"
    )
    raise LogError(
        f"{where}: {what}; expected column names and rows of numbers. Check that this is a log, "
        f"and that the logger wrote "
        "its data."
    )


def _name_cells(line: str, delimiter: str, width: int) -> list[str]:
    """Cut a line that may hold names in the way that fits the number of columns."""
    line = line.lstrip("#%") if delimiter == "\t" else line.strip().lstrip("#%").strip()
    cells = split_row(line, delimiter)
    if delimiter == " " and len(cells) != width:
        for apart in (r"\t| {2,}", r"(?<=[)\]])\s+", ",", ";"):
            other = [cell.strip() for cell in re.split(apart, line)]
            if len(other) == width:
                return other
    return cells


def _load(
    path: Path,
    encoding: str,
    layout: Layout,
    step: float | None,
    wanted: Sequence[int],
    time: int | None,
) -> LogTable:
    """Read the wanted columns as numbers, or as texts where none looks like a number.

    There are no stamps where the time column is empty, or counts rows beside a stated interval.
    """
    used = list(dict.fromkeys([*wanted, *([] if time is None else [time])]))
    parser = _Parser(layout, used)
    table = log_table(map(parser.parse, _blocks(path, encoding, layout.first)), wanted, time)
    rows = len(next(iter(table.values.values()), ())) if table.stamps is None else len(table.stamps)
    read = {k: numbers(texts, layout.decimal)[0] for k, texts in table.texts.items() if k != time}
    late = {k: x for k, x in read.items() if np.isfinite(x).any()}
    texts = {
        k: x for k, x in table.texts.items() if k not in late
    }  # not those whose numbers begin late
    stamps, stamped = table.stamps, False
    if time is not None and isinstance(stamps, np.ndarray):
        counts = (
            bool(np.all(np.diff(stamps[:1000]) == 1.0))
            and read_header(layout.headers[time]).unit is None
        )
        empty = not np.isfinite(stamps).any() and (
            step is not None or not any(layout.columns[time])
        )
        if empty or (step is not None and counts):
            stamps = None
        elif (
            stamps.size > 1
            and 0 < stamps[1] - stamps[0] < 1e-4
            and (days := serial_days(stamps)) is not None
        ):
            stamps, stamped = days, True
    findings = parser.findings(path.name, rows)
    values = {k: late.get(k, x) for k, x in table.values.items()}
    return msgspec.structs.replace(
        table, values=values, texts=texts, stamps=stamps, stamped=stamped, findings=findings
    )


def _blocks(path: Path, encoding: str, skip: int) -> Iterator[bytes]:
    """Text of a file from line `skip` on in UTF-8, cut where lines end; an unfinished line comes
    last.
    """
    decoder = (
        None if encoding == "utf-8" else codecs.getincrementaldecoder(encoding)(errors="replace")
    )
    rest, old_mac = b"", False
    with path.open("rb", buffering=0) as file:
        while data := file.read(TEXT_BYTES):
            if data[0] == 0 and not data.strip(b"\0"):
                data = data[
                    :1
                ]  # one byte suffices for the megabytes that a logger reserved and never wrote
            if decoder is not None:
                data = decoder.decode(data).encode()
            if old_mac or (b"\n" not in data and b"\r" in data):
                old_mac, data = True, data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            data = rest + data
            begin = 0
            while skip and (at := data.find(b"\n", begin)) >= 0:
                begin, skip = at + 1, skip - 1
            end = data.rfind(b"\n") + 1
            if begin < end:
                yield data[begin:end]
            rest = data[max(begin, end) :]
            if len(rest) > LINE_BYTES_MAX:
                raise LogError(
                    f"{path.name}: a line of more than {LINE_BYTES_MAX >> 20} MB; expected rows "
                    f"of a few numbers."
                )
    if rest and not skip:
        yield rest


class _Parser:
    """Turn blocks of text into pieces of columns, and keep what could not be read on the way."""

    def __init__(self, layout: Layout, used: Sequence[int]) -> None:
        self.layout, self.width, self.last = layout, len(layout.headers), max(used, default=0)
        self.ragged, self.cut, self.marks = 0, list[str](), list(NOT_NUMBERS)
        texts = {
            k
            for k in used
            if any(layout.columns[k]) and not any(map(looks_like_a_number, layout.columns[k]))
        }
        self.types = {k: pa.string() if k in texts else pa.float64() for k in used}

    def parse(self, block: bytes) -> dict[int, pa.Array]:
        """Read whole lines, those of a block with odd rows or cells row by row; an unfinished
        line comes last.
        """
        if not block.endswith(b"\n"):
            block = self._last_line(block)
        if self.layout.labview:
            block = _LABVIEW_HEADING.sub(b"", block)
        if self.layout.delimiter == " ":
            block = b"\n".join(
                re.sub(rb"[ \t]+", b" ", line.strip()) for line in block.splitlines()
            )
        if not block:
            return {k: pa.nulls(0, kind) for k, kind in self.types.items()}
        try:
            return self._by_arrow(block)
        except pa.ArrowInvalid:
            return self._by_row(block)

    def _by_arrow(self, block: bytes) -> dict[int, pa.Array]:
        """Columns of a block; ArrowInvalid where a cell is no number or a row has cells too many
        or too few.
        """
        long = len(block) > THREAD_BYTES
        # The default pool starts slowly, and keeps memory that is not used.
        pool = pa.system_memory_pool()
        table = csv.read_csv(
            pa.BufferReader(block),
            read_options=csv.ReadOptions(
                column_names=[str(k) for k in range(self.width)],
                block_size=THREAD_BYTES if long else len(block),
                use_threads=long,
            ),
            parse_options=csv.ParseOptions(
                delimiter=self.layout.delimiter, quote_char='"' if b'"' in block else False
            ),
            convert_options=csv.ConvertOptions(
                include_columns=list(map(str, self.types)),
                column_types={str(k): kind for k, kind in self.types.items()},
                null_values=self.marks,
                decimal_point=self.layout.decimal,
            ),
            memory_pool=pool,
        )
        return {k: table.column(str(k)).combine_chunks(pool) for k in self.types}

    def _by_row(self, block: bytes) -> dict[int, pa.Array]:
        """Columns of rows with as many cells as the others, or whose cells too many or too few
        are not wanted.
        """
        rows = []
        for line in block.splitlines():
            cells = split_row(line.decode("utf-8", "replace"), self.layout.delimiter)
            unread = self.last < min(self.width - 1, len(cells))
            remark = len(cells) > self.width and (self.layout.more or not any(cells[self.width :]))
            if b"\0" in line:
                self.cut.append("lines hold NUL bytes, as a loss of power leaves them")
            elif len(cells) == self.width or unread or remark:
                rows += (
                    [cells] if any(is_value(cells[k]) for k in self.types) else []
                )  # a note, or names repeated
            else:
                self.ragged += is_value(cells[0]) and len(cells) > 1
        columns: dict[int, pa.Array] = {}
        for k, kind in self.types.items():
            cells = [row[k] for row in rows]
            values, strange = (
                numbers(cells, self.layout.decimal) if kind == pa.float64() else (cells, [])
            )
            columns[k] = pa.array(values, kind)
            # Known from now on, so that Arrow reads the blocks to come.
            self.marks += [mark for mark in strange if mark not in self.marks][
                : max(0, MARKS_MAX - len(self.marks))
            ]
        return columns

    def _last_line(self, block: bytes) -> bytes:
        """The last line of a file, which no line end closes, if it is whole."""
        text = block.rstrip(b"\0")
        if len(text) < len(block):
            self.cut.append("the file ends in NUL bytes, as a loss of power leaves it")
        text = text.rstrip(b"\x1a")
        cells = split_row(text.decode("utf-8", "replace"), self.layout.delimiter)
        if cells == [""] or (len(cells) == 1 and cells[0][:1].isalpha()):  # a remark
            return b""
        last = max(k for k, column in enumerate(self.layout.columns) if any(column))
        ends = len(cells) == last + 1 and is_cut(cells[last], self.layout.columns[last])
        if len(cells) <= last or ends or text.count(b'"') % 2:
            self.cut.append("the file is cut off inside a row")
            return b""
        return text

    def findings(self, where: str, rows: int) -> tuple[Finding, ...]:
        """What could not be read beside so many rows; LogError if that is too much."""
        findings = []
        if self.ragged > max(RAGGED_ROWS_MAX, RAGGED_SHARE_MAX * rows):
            raise LogError(
                f"{where}: {self.ragged} rows do not have {self.width} cells like the first one; "
                f"expected one table with rows "
                f"of equal length. Check the delimiter."
            )
        if self.ragged:
            message = f"{self.ragged} line{'s do' if self.ragged > 1 else ' does'} not have {self.width} cells like the others"
            findings.append(
                Finding(
                    "dropped_samples", message, "left out", count=self.ragged, removed=self.ragged
                )
            )
        if self.cut:
            lost = sum("ends" not in why for why in self.cut)
            action = f"{lost} row{'s' * (lost > 1)} left out" if lost else "nothing was lost"
            findings.append(
                Finding("truncated", " and ".join(dict.fromkeys(self.cut)), action, removed=lost)
            )
        return tuple(findings)
