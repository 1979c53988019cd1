"""CSV and similar texts: comma, semicolon, tab, bar or blanks, decimal point or comma, any encoding, preamble and units row.

The text is read in blocks that end where lines end, so that a log of many hours needs no more memory than its numbers. Arrow
parses each block with all cores; only a block with an unusual cell is parsed cell by cell.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
import pyarrow as pa
from pyarrow import csv

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.cells import (
    NOT_NUMBERS,
    is_cut,
    is_stamp,
    is_value,
    numbers,
    serial_days,
    split_row,
    waveform,
)
from winchcascade.ingest.dialects import read_header
from winchcascade.ingest.layout import Layout, find_encoding, find_layout
from winchcascade.ingest.source import LogSource, LogTable, without_notes

BLOCK = 1 << 20
"""Bytes that are parsed at a time."""

LONG = 1 << 22
"""Bytes from which a file is parsed by threads."""

Bytes = bytes | memoryview
"""Text as bytes, or a view of a part of it."""

_NEAR = 1 << 20
_WORKERS = max(2, min(8, os.cpu_count() or 2))
_LONGEST_LINE = 1 << 24

Parsed = TypeVar("Parsed")


def in_parallel(parse: Callable[[Bytes], Parsed], blocks: Iterator[Bytes]) -> Iterator[Parsed]:
    """Parse blocks in threads, a few ahead, and yield them in their order."""
    from concurrent.futures import Future, ThreadPoolExecutor

    ahead: list[Future[Parsed]] = []
    with ThreadPoolExecutor(_WORKERS) as pool:
        for block in blocks:
            ahead.append(pool.submit(parse, block))
            if len(ahead) > _WORKERS:
                yield ahead.pop(0).result()
        while ahead:
            yield ahead.pop(0).result()


def text_blocks(path: Path, encoding: str, skip: int) -> Iterator[Bytes]:
    """Text of a file from line `skip` on in ASCII-compatible bytes, cut where lines end; an unfinished line comes last."""
    decoder = codecs.getincrementaldecoder(encoding)(errors="replace") if encoding[:6] in ("utf-16", "utf-32") else None
    rest, old_mac = b"", False
    with path.open("rb", buffering=0) as file:
        size = min(BLOCK, max(_HEAD, os.fstat(file.fileno()).st_size))  # a large buffer costs more than a short log
        while data := file.read(size):
            if data[0] == 0 and not data.strip(b"\0"):
                data = data[:1]  # one byte suffices for the megabytes that a logger reserved and never wrote
            if decoder is not None:
                data = decoder.decode(data).encode()
            if old_mac or (b"\n" not in data and b"\r" in data[:_NEAR]):
                old_mac, data = True, data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
            data = rest + data
            begin = 0
            while skip and (at := data.find(b"\n", begin)) >= 0:
                begin, skip = at + 1, skip - 1
            end = data.rfind(b"\n") + 1
            if begin < end:
                yield memoryview(data)[begin:end]
            rest = data[end:]
            if len(rest) > _LONGEST_LINE:
                raise LogError(
                    f"{path.name}: a line of more than {_LONGEST_LINE >> 20} MB; expected rows of a few numbers."
                )
    if rest and not skip:
        yield rest


_HEAD = 1 << 18
_FIRST_LINES = 1000
"""Lines of a file that are cut apart to find its layout; the rest is one text."""

_MINUS_SIGN = "\u2212".encode()
_D_EXPONENT = re.compile(rb"(?<=[\d.])[dD](?=[-+]?\d)")
"""As Fortran writes it."""

_HEADING = re.compile(rb"^(?!nan\b|inf)(?:[*]{3}End_|[a-z])[^\n]*\n?", re.IGNORECASE | re.MULTILINE)
"""A line of the heading that LabVIEW repeats above each segment; a row of data begins with a number or an empty cell."""

_LONGEST_HEADING = 400
"""Lines of a file among which the first heading of LabVIEW ends."""

_MAX_MARKS = 200
"""Number of texts for "no number" that Arrow is given; a file with more of them is read cell by cell."""


def open_delimited(path: Path, *, numbered: bool = False) -> LogSource:
    """Open a delimited text log; where the columns are `numbered`, it needs no names.

    Raises
    ------
    LogError : no table of numbers with column names in it
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    encoding = find_encoding(head)
    text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(head).rstrip("\0")
    if not text or ("\0" in text and text.count("\0") > len(text) // 20):
        raise LogError(
            f"{path.name}: is a binary file of no known format; expected CSV, TDMS, MATLAB, Parquet or Excel. Check that "
            f"this is a log."
        )
    lines = text.split("\n" if "\n" in text else "\r", _FIRST_LINES)  # as text_blocks counts them
    if len(head) == _HEAD and len(lines) < 4:
        raise LogError(
            f"{path.name}: lines of more than {_HEAD // 4 >> 10} kB; expected a log with a few dozen columns. Check that "
            f"this is a log."
        )
    layout = _layout(lines, path.name, numbered=numbered)
    step, start = waveform(layout.properties)
    return LogSource(
        headers=layout.headers,
        load=lambda wanted, time: _load(path, encoding, layout, step, wanted, time),
        time_step=step,
        time_start=start,
        properties=dict(layout.properties),
        texts=lambda column, beside: _load_texts(path, encoding, layout, column, beside),
    )


def _layout(lines: Sequence[str], where: str, *, numbered: bool) -> Layout:
    """Find the table in the first lines of a file, by the headings of LabVIEW where it has them."""
    if "\n***End_of_Header***" in "\n".join(["", *lines[:_LONGEST_HEADING]]):
        from winchcascade.ingest.labview import labview_layout

        found = labview_layout(lines, where)
        if found is not None:
            return found
    return find_layout(lines, where, numbered=numbered)


def _load(
    path: Path, encoding: str, layout: Layout, step: float | None, wanted: Sequence[int], time: int | None
) -> LogTable:
    """Read the wanted columns, block by block."""
    texts = time if time is not None and any(map(is_stamp, layout.column(time))) else None
    used = [*wanted, *([] if time is None else [time])]
    parser = _parsed(path, encoding, layout, used, texts)
    whole = _whole_rows(parser)
    findings = parser.findings(path.name)
    values = {k: whole.values[k] for k in wanted}
    if time is None or texts is not None:
        return LogTable(values, whole.stamps, findings=findings)
    stamps, stamped = _stamps(layout, step, time, whole.values[time])
    return LogTable(values, stamps, stamped, findings)


def _load_texts(path: Path, encoding: str, layout: Layout, column: int, beside: Sequence[int]) -> Sequence[str]:
    """Read a column as texts, in the rows in which one beside it holds a number."""
    stamps = _whole_rows(_parsed(path, encoding, layout, [*beside, column], column)).stamps
    return [] if stamps is None or isinstance(stamps, np.ndarray) else stamps


def _whole_rows(parser: _Parser) -> LogTable:
    """The columns of a parser and its texts, without rows that hold neither a number nor a stamp."""
    columns = {k: column[: parser.rows] for k, column in parser.columns.items()}
    return without_notes(LogTable(columns, stamps=None if parser.stamped is None else parser.texts))


def _parsed(path: Path, encoding: str, layout: Layout, used: Sequence[int], texts: int | None) -> _Parser:
    """Parse the used columns, one of them as texts, block by block."""
    parser = _Parser(layout, encoding if encoding[:3] != "utf" else "utf-8", used, texts)
    blocks = text_blocks(path, encoding, layout.first)
    first = next(blocks, b"")
    parser.store(parser.parse(first))
    size = path.stat().st_size
    if size > len(first) and parser.rows:
        parser.expect(int(1.05 * size / len(first) * parser.rows) + 1000)
    for table in in_parallel(parser.parse, blocks) if size > LONG else map(parser.parse, blocks):
        parser.store(table)
    return parser


def _stamps(layout: Layout, step: float | None, time: int, stamps: Signal) -> tuple[Signal | None, bool]:
    """The time column, and whether it is in seconds; None if it is empty, or counts rows beside a stated interval."""
    first = stamps[:1000]
    empty = stamps.size == 0 or (np.isnan(first).all() and np.isnan(stamps).all())
    counts = bool(np.all(np.diff(first) == 1.0)) and read_header(layout.headers[time]).unit is None
    if (empty and not any(layout.column(time))) or (step is not None and (empty or counts)):
        return None, False
    days = serial_days(stamps) if first.size > 1 and 0 < first[1] - first[0] < 1e-4 else None
    return (stamps, False) if days is None else (days, True)


class _Parser(msgspec.Struct):
    """The used columns, which grow block by block, and what could not be read on the way; `stamped` is a column of texts."""

    layout: Layout
    encoding: str
    used: Sequence[int]
    stamped: int | None
    rows: int = 0
    columns: dict[int, Signal] = msgspec.field(default_factory=dict)
    texts: list[str] = msgspec.field(default_factory=list)
    no_numbers: list[str] = msgspec.field(default_factory=lambda: list(NOT_NUMBERS))
    ragged: int = 0
    cut: list[str] = msgspec.field(default_factory=list)

    def __post_init__(self) -> None:
        self.columns = {k: np.empty(0) for k in self.used if k != self.stamped}

    def expect(self, rows: int) -> None:
        """Reserve memory for as many rows; unused memory costs nothing until it is written."""
        for k, column in self.columns.items():
            if rows > column.size:
                grown = np.empty(rows)
                grown[: self.rows] = column[: self.rows]
                self.columns[k] = grown

    def parse(self, block: Bytes) -> pa.Table | None:
        """Read whole lines as numbers; None if none remain.

        An unfinished line is the end of a file that was cut off. A block with odd rows or cells is mended line by line, then
        if need be cell by cell.
        """
        if block[-1:] != b"\n":
            block = self._end(bytes(block))
        if self.layout.labview:
            block = _HEADING.sub(b"", block)
        if self.layout.delimiter == " ":
            block = b"\n".join(re.sub(rb"[ \t]+", b" ", line.strip()) for line in bytes(block).splitlines())
        if not len(block):
            return None
        try:
            return self._arrow(block, pa.float64(), quoted=self.layout.quoted)
        except pa.ArrowInvalid:
            block = self._mended(bytes(block))
        if not block:
            return None
        try:
            return self._arrow(block, pa.float64(), quoted=True)
        except pa.ArrowInvalid:
            return self._by_cell(self._arrow(block, pa.binary(), quoted=True))

    def _end(self, line: bytes) -> bytes:
        """The last line of a file, which no line end closes, if it is whole."""
        text = line.rstrip(b"\0")
        if len(text) < len(line):
            self.cut.append("the file ends in NUL bytes, as a loss of power leaves it")
        text = text.rstrip(b"\x1a")
        cells = split_row(text.decode(self.encoding, "replace"), self.layout.delimiter)
        last = max(k for k in range(self.layout.width) if any(self.layout.column(k)))
        if cells == [""] or (len(cells) == 1 and cells[0][:1].isalpha()):  # a remark
            return b""
        whole = len(cells) > last + 1 or (len(cells) > last and not is_cut(cells[last], self.layout.column(last)))
        if whole and text.count(b'"') % 2 == 0:
            return text
        self.cut.append("the file is cut off inside a row")
        return b""

    def _arrow(self, block: Bytes, kind: Any, *, quoted: bool) -> pa.Table:
        types = {str(k): pa.binary() if k == self.stamped else kind for k in self.used}
        return csv.read_csv(
            pa.BufferReader(pa.py_buffer(block)),
            read_options=csv.ReadOptions(
                column_names=[str(k) for k in range(self.layout.width)],
                block_size=max(BLOCK, len(block)),
                use_threads=False,
            ),
            parse_options=csv.ParseOptions(delimiter=self.layout.delimiter, quote_char='"' if quoted else False),
            convert_options=csv.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                null_values=self.no_numbers,
                decimal_point=self.layout.decimal,
                check_utf8=False,
            ),
            memory_pool=pa.system_memory_pool(),  # the default pool starts slowly, and keeps memory that is not used
        )

    def _mended(self, text: bytes) -> bytes:
        """The lines of a block that are rows, each with the same number of cells."""
        delimiter, separators = self.layout.delimiter.encode(), self.layout.width - 1
        rows = []
        lines = text.splitlines()
        if max(self.used, default=0) > 0 and b"\0" not in text:  # the others are remarks, and there may be millions
            lines = [line for line in lines if delimiter in line]
        for line in lines:
            if b"\0" in line:
                self.cut.append("lines hold NUL bytes, as a loss of power leaves them")
            elif line.count(delimiter) == separators and b'"' not in line:
                rows.append(line)
            elif line.strip():
                rows += self._fitted(line)
        return _D_EXPONENT.sub(b"E", b"\n".join(rows).replace(_MINUS_SIGN, b"-"))

    def _fitted(self, line: bytes) -> list[bytes]:
        """A line with cells too many or too few, fitted if no wanted cell is lost; else left out and counted."""
        cells = split_row(line.decode("latin-1"), self.layout.delimiter)
        width = self.layout.width
        # Too much or too little, in columns that are not read.
        spare = max(self.used, default=0) < min(width - 1, len(cells))
        remark = len(cells) > width and (self.layout.more or not any(cells[width:]))
        if len(cells) != width and not spare and not remark:
            # Anything else is a remark, or a preamble where logs were joined.
            self.ragged += is_value(cells[0]) and len(cells) > 1
            return []
        cells = [cell.replace('"', "") for cell in (cells + [""] * width)[:width]]
        quote = '"{}"' if any(self.layout.delimiter in cell for cell in cells) else "{}"
        return [self.layout.delimiter.join(quote.format(cell) for cell in cells).encode("latin-1")]

    def _by_cell(self, texts: pa.Table) -> pa.Table:
        """Numbers of a block in which some cells are none; their texts are known from then on."""
        columns = {}
        for k in self.used:
            column = texts.column(str(k))
            if k != self.stamped:
                values, strange = numbers(self._decoded(column), self.layout.decimal)
                column = pa.Array.from_buffers(pa.float64(), values.size, [None, pa.py_buffer(values)])
                known = self.no_numbers
                known += [s for s in strange if s not in known][: max(0, _MAX_MARKS - len(known))]
            columns[str(k)] = column
        return pa.table(columns)

    def _decoded(self, column: pa.ChunkedArray) -> list[str]:
        return [(cell or b"").decode(self.encoding, "replace") for cell in column.to_pylist()]

    def store(self, table: pa.Table | None) -> None:
        """Append the rows of a block."""
        if table is None:
            return
        need = self.rows + table.num_rows
        if self.columns and need > next(iter(self.columns.values())).size:
            self.expect(max(need, int(1.5 * self.rows)))
        for k, column in self.columns.items():
            at = self.rows
            for chunk in table.column(str(k)).chunks:
                column[at : at + len(chunk)] = _floats(chunk)
                at += len(chunk)
        if self.stamped is not None:
            self.texts += self._decoded(table.column(str(self.stamped)))
        self.rows = need

    def findings(self, where: str) -> tuple[Finding, ...]:
        """Report lines that could not be read; LogError if there are too many of them."""
        found = []
        odd, width = self.ragged, self.layout.width
        if odd > max(10, 0.5 * self.rows):
            raise LogError(
                f"{where}: {odd} rows do not have {width} cells like the first one; expected one table with rows of equal "
                f"length. Check the delimiter."
            )
        if odd:
            message = f"{odd} line{'s do' if odd > 1 else ' does'} not have {width} cells like the others"
            found.append(Finding("dropped_samples", message, "left out", count=odd, removed=odd))
        if self.cut:
            lost = sum("ends" not in why for why in self.cut)
            action = f"{lost} row{'s' * (lost > 1)} left out" if lost else "nothing was lost"
            found.append(Finding("truncated", " and ".join(dict.fromkeys(self.cut)), action, removed=lost))
        return tuple(found)


def _floats(chunk: pa.Array) -> Signal:
    """Numbers of an Arrow array, NaN for null; read from its buffers because `to_numpy` imports pandas."""
    valid, data = chunk.buffers()
    part = slice(chunk.offset, chunk.offset + len(chunk))
    values: Signal = np.frombuffer(data, dtype=np.float64)[part]
    if chunk.null_count:
        known = np.unpackbits(np.frombuffer(valid, dtype=np.uint8), bitorder="little")[part]
        values = np.where(known == 1, values, np.nan)
    return values
