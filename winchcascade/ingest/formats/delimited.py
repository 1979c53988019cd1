"""The text of a file in blocks that end where lines end, so that a log of many hours needs no more memory than its numbers."""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import msgspec
import numpy as np
import pyarrow as pa
from pyarrow import csv

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding
from winchcascade.ingest.cells import NOT_NUMBERS, is_cut, is_stamp, is_value, numbers, split_row
from winchcascade.ingest.dialects import read_header
from winchcascade.ingest.layout import Layout, find_encoding, find_layout
from winchcascade.ingest.source import LogSource, LogTable, without_notes

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


BLOCK = 1 << 22
"""Bytes that are parsed at a time."""

Bytes = bytes | memoryview
"""Text as bytes, or a view of a part of it."""

_NEAR = 1 << 20
_WORKERS = max(2, min(8, os.cpu_count() or 2))
_LONGEST_LINE = 1 << 24

Parsed = TypeVar("Parsed")


def in_parallel(parse: Callable[[Bytes], Parsed], blocks: Iterator[Bytes]) -> Iterator[Parsed]:
    """Parse blocks in threads, a few ahead, and hand them on in their order."""
    from collections import deque
    from concurrent.futures import Future, ThreadPoolExecutor

    ahead: deque[Future[Parsed]] = deque()
    with ThreadPoolExecutor(_WORKERS) as pool:
        for block in blocks:
            ahead.append(pool.submit(parse, block))
            if len(ahead) > _WORKERS:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


def text_blocks(path: Path, encoding: str, skip: int) -> Iterator[Bytes]:
    """Text of a file from line `skip` on in ASCII-compatible bytes, cut where lines end; an unfinished line comes last."""
    rest = b""
    for data in _chunks(path, encoding):
        whole = rest + bytes(data) if skip or (rest and b"\n" not in data[: 1 << 16].tobytes()) else None
        if whole is not None:
            while skip and (end := whole.find(b"\n")) >= 0:
                whole, skip = whole[end + 1 :], skip - 1
            data, rest = memoryview(whole), b""
            if skip:
                rest = whole
                continue
        end = _last_line_end(data)
        if end == 0 and len(rest) + len(data) > _LONGEST_LINE:
            raise LogError(
                f"{path.name}: a line of more than {_LONGEST_LINE >> 20} MB; expected rows of a few numbers."
            )
        if end and rest:
            begin = data[: 1 << 16].tobytes().find(b"\n") + 1
            yield rest + bytes(data[:begin])
            data, end, rest = data[begin:], end - begin, b""
        if end:
            yield data[:end]
        rest += bytes(data[end:])
    if rest and not skip:
        yield rest


def _chunks(path: Path, encoding: str) -> Iterator[memoryview]:
    """The bytes of a file as ASCII-compatible text with line feeds, a block at a time."""
    decoder = codecs.getincrementaldecoder(encoding)(errors="replace") if encoding[:6] in ("utf-16", "utf-32") else None
    old_mac = False
    with path.open("rb") as file:
        left = os.fstat(file.fileno()).st_size
        while True:
            buffer = bytearray(min(BLOCK, max(left, 0) + 1))
            size = file.readinto(buffer)
            if not size:
                return
            left -= size
            data = memoryview(buffer)[:size]
            if data[0] == 0 and not any(buffer[:size].strip(b"\0")):
                data = data[:1]  # one byte suffices for the megabytes that a logger reserved and never wrote
            if decoder is not None:
                data = memoryview(decoder.decode(data).encode())
            old_mac = old_mac or (_last_line_end(data) == 0 and b"\r" in data[:_NEAR].tobytes())
            yield memoryview(data.tobytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")) if old_mac else data


def _last_line_end(data: memoryview) -> int:
    """Position after the last line feed of a block, 0 if there is none."""
    for size in (1 << 12, len(data)):
        found = data[-size:].tobytes().rfind(b"\n") if size else -1
        if found >= 0:
            return max(len(data) - size, 0) + found + 1
    return 0


_HEAD = 1 << 18
_PIECE = 1 << 20
_MINUS_SIGN = "\u2212".encode()
_D_EXPONENT = re.compile(rb"(?<=[\d.])[dD](?=[-+]?\d)")
"""As Fortran writes it."""

_HEADING = re.compile(rb"^(?!nan\b|inf)(?:[*]{3}End_|[a-z])[^\n]*\n?", re.IGNORECASE | re.MULTILINE)
"""A line of the heading that LabVIEW repeats above each segment; a row of data begins with a number or an empty cell."""

_MOST_MARKS = 200
"""Texts for "no number" that are handed to Arrow; a file with more of them is read cell by cell."""


def open_delimited(path: Path) -> LogSource:
    """Open a delimited text log.

    Raises
    ------
    LogError : no table of numbers with column names in it
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    encoding = find_encoding(head)
    text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(head).rstrip("\0")
    if not text or text.count("\0") > len(text) // 20:
        raise LogError(
            f"{path.name}: is a binary file of no known format; expected CSV, TDMS, MATLAB, Parquet or Excel. Check that "
            f"this is a log."
        )
    lines = text.split("\n") if "\n" in text else text.split("\r")  # as text_blocks counts them
    if len(head) == _HEAD and len(lines) < 4:
        raise LogError(
            f"{path.name}: lines of more than {_HEAD // 4 >> 10} kB; expected a log with a few dozen columns. Check that "
            f"this is a log."
        )
    layout = find_layout(lines, path.name)
    step, start = None, 0.0
    if any(value[0] in "+-.0123456789" for value in layout.properties.values()):
        from winchcascade.ingest.stamps import waveform

        step, start = waveform(layout.properties)
    return LogSource(
        headers=layout.headers,
        load=lambda wanted, time: _load(path, encoding, layout, step, wanted, time),
        time_step=step,
        time_start=start,
        properties=dict(layout.properties),
    )


def _load(
    path: Path, encoding: str, layout: Layout, step: float | None, wanted: Sequence[int], time: int | None
) -> LogTable:
    """Read the wanted columns, block by block."""
    parser = _Parser(layout, encoding if encoding[:3] != "utf" else "utf-8", step, wanted, time)
    blocks = text_blocks(path, encoding, layout.first)
    first = next(blocks, b"")
    parser.store(parser.parse(first))
    size = path.stat().st_size
    if size > len(first) and parser.rows:
        parser.expect(int(1.05 * size / len(first) * parser.rows) + 1000)
    for table in in_parallel(parser.parse, blocks) if size > BLOCK else map(parser.parse, blocks):
        parser.store(table)
    return parser.table(path.name)


class _Parser(msgspec.Struct):
    """Columns that grow block by block, and what could not be read on the way."""

    layout: Layout
    encoding: str
    step: float | None
    wanted: Sequence[int]
    time: int | None
    rows: int = 0
    columns: dict[int, Signal] = msgspec.field(default_factory=dict)
    texts: list[str] = msgspec.field(default_factory=list)
    no_numbers: list[str] = msgspec.field(default_factory=lambda: list(NOT_NUMBERS))
    ragged: int = 0
    cut: list[str] = msgspec.field(default_factory=list)
    stamped: bool = False

    def __post_init__(self) -> None:
        if self.time is not None:
            self.stamped = any(is_stamp(cell) for cell in self.layout.column(self.time))
        self.columns = {k: np.empty(0) for k in self._numeric()}

    def _numeric(self) -> list[int]:
        return list(self.wanted) + ([self.time] if self.time is not None and not self.stamped else [])

    def _used(self) -> list[int]:
        return [*self.wanted, *([] if self.time is None else [self.time])]

    def expect(self, rows: int) -> None:
        """Reserve memory for as many rows; unused memory costs nothing until it is written."""
        for k, column in self.columns.items():
            if rows > column.size:
                grown = np.empty(rows)
                grown[: self.rows] = column[: self.rows]
                self.columns[k] = grown

    def parse(self, block: Bytes) -> pa.Table | None:
        """Read whole lines; an unfinished one is the end of a file that was cut off. None if nothing is left."""
        if block[-1:] != b"\n":
            block = self._end(bytes(block))
        if self.layout.labview:
            block = _HEADING.sub(b"", block)
        if self.layout.delimiter == " ":
            block = b"\n".join(re.sub(rb"[ \t]+", b" ", line.strip()) for line in bytes(block).splitlines())
        return self._read(block) if len(block) else None

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

    def _read(self, block: Bytes) -> pa.Table | None:
        """Parse a block as numbers; one with odd rows or cells is mended line by line, then if need be cell by cell."""
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

    def _arrow(self, block: Bytes, kind: Any, *, quoted: bool) -> pa.Table:
        names = [f"c{k}" for k in range(self.layout.width)]
        types = {f"c{k}": kind for k in self._numeric()}
        if self.stamped:
            types[f"c{self.time}"] = pa.binary()
        return csv.read_csv(
            pa.BufferReader(pa.py_buffer(block)),
            read_options=csv.ReadOptions(column_names=names, block_size=max(_PIECE, len(block)), use_threads=False),
            parse_options=csv.ParseOptions(delimiter=self.layout.delimiter, quote_char='"' if quoted else False),
            convert_options=csv.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                null_values=self.no_numbers,
                decimal_point=self.layout.decimal,
                check_utf8=False,
            ),
            memory_pool=pa.system_memory_pool() if len(block) < _PIECE else None,  # the default pool starts slowly
        )

    def _mended(self, text: bytes) -> bytes:
        """The lines of a block that are rows, each with the same number of cells."""
        delimiter, most = self.layout.delimiter.encode(), self.layout.width - 1
        rows = []
        lines = text.splitlines()
        if max(self._used(), default=0) > 0 and b"\0" not in text:  # the others are remarks, and there may be millions
            lines = [line for line in lines if delimiter in line]
        for line in lines:
            if b"\0" in line:
                self.cut.append("lines hold NUL bytes, as a loss of power leaves them")
            elif line.count(delimiter) == most and b'"' not in line:
                rows.append(line)
            elif line.strip():
                rows += self._fitted(line)
        return _D_EXPONENT.sub(b"E", b"\n".join(rows).replace(_MINUS_SIGN, b"-"))

    def _fitted(self, line: bytes) -> list[bytes]:
        """A line with cells too many or too few, fitted where none is lost that is wanted; else left out and counted."""
        cells = split_row(line.decode("latin-1"), self.layout.delimiter)
        width, used = self.layout.width, self._used()
        spare = max(used, default=0) < min(
            width - 1, len(cells)
        )  # too much or too little, in columns that are not read
        remark = len(cells) > width and (self.layout.more or not any(cells[width:]))
        if len(cells) != width and not spare and not remark:
            if is_value(cells[0]) and len(cells) > 1:  # anything else is a remark, or a preamble where logs were joined
                self.ragged += 1
            return []
        cells = [cell.replace('"', "") for cell in (cells + [""] * width)[:width]]
        quote = '"{}"' if any(self.layout.delimiter in cell for cell in cells) else "{}"
        return [self.layout.delimiter.join(quote.format(cell) for cell in cells).encode("latin-1")]

    def _by_cell(self, texts: pa.Table) -> pa.Table:
        """Numbers of a block in which some cells are none; their texts are known from then on."""
        columns = {}
        for k in self._numeric():
            values, strange = numbers(self._decoded(texts, k), self.layout.decimal)
            columns[f"c{k}"] = pa.Array.from_buffers(pa.float64(), values.size, [None, pa.py_buffer(values)])
            free = max(0, _MOST_MARKS - len(self.no_numbers))
            self.no_numbers += [s for s in strange if s not in self.no_numbers][:free]
        if self.stamped:
            columns[f"c{self.time}"] = texts.column(f"c{self.time}")
        return pa.table(columns)

    def _decoded(self, table: pa.Table, k: int) -> list[str]:
        return [(cell or b"").decode(self.encoding, "replace") for cell in table.column(f"c{k}").to_pylist()]

    def store(self, table: pa.Table | None) -> None:
        """Append the rows of a block."""
        if table is None:
            return
        count = table.num_rows
        need = self.rows + count
        if self.columns and need > next(iter(self.columns.values())).size:
            self.expect(max(need, int(1.5 * self.rows)))
        for k, column in self.columns.items():
            at = self.rows
            for chunk in table.column(f"c{k}").chunks:
                column[at : at + len(chunk)] = _floats(chunk)
                at += len(chunk)
        if self.stamped and self.time is not None:
            self.texts += self._decoded(table, self.time)
        self.rows = need

    def table(self, where: str) -> LogTable:
        """What was read, rows that hold nothing at all left out, with the findings of the reading."""
        values = {k: column[: self.rows] for k, column in self.columns.items()}
        whole = without_notes(LogTable(values, stamps=self.texts if self.stamped else None))
        findings = self._findings(where)
        stamps, stamped = (whole.stamps, False) if self.stamped else self._stamps(whole.values)
        return LogTable({k: whole.values[k] for k in self.wanted}, stamps, stamped, findings)

    def _stamps(self, values: Mapping[int, Signal]) -> tuple[Signal | None, bool]:
        """The time column as numbers, and whether it is in seconds; none if it is empty, or counts rows beside an interval."""
        if self.time is None:
            return None, False
        stamps = values[self.time]
        first = stamps[:1000]
        empty = stamps.size == 0 or (np.isnan(first).all() and np.isnan(stamps).all())
        counts = bool(np.all(np.diff(first) == 1.0)) and read_header(self.layout.headers[self.time]).unit is None
        if (empty and not any(self.layout.column(self.time))) or (self.step is not None and (empty or counts)):
            return None, False
        if first.size > 1 and 0 < first[1] - first[0] < 1e-4:
            from winchcascade.ingest.stamps import serial_days

            days = serial_days(stamps)
            return (stamps, False) if days is None else (days, True)
        return stamps, False

    def _findings(self, where: str) -> tuple[Finding, ...]:
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
