"""CSV and its kin: comma, semicolon, tab, bar or blanks, decimal point or comma, any encoding, preamble and units row.

The text is read in blocks that end with a line, so that a log of many hours takes no more memory than its numbers; each
block is parsed by Arrow with all cores.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
import pyarrow as pa
from pyarrow import csv

from winchcascade.errors import LogError
from winchcascade.ingest.layout import NOT_NUMBERS, Layout, find_encoding, find_layout, split_row
from winchcascade.ingest.source import Source, Table
from winchcascade.run import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Signal

BLOCK = 1 << 22
"""Bytes that are parsed at a time."""

Bytes = bytes | memoryview
"""Text as bytes, or a view of a part of it."""

_HEAD = 1 << 18
_PARALLEL = 1 << 20
_WORKERS = max(2, min(8, os.cpu_count() or 2))
_LONGEST_LINE = 1 << 24
_ASCII_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")


def open_delimited(path: Path) -> Source:
    """Open a delimited text log.

    Raises
    ------
    LogError : no table of numbers with column names in it
    """
    with path.open("rb") as file:
        head = file.read(_HEAD)
    encoding = find_encoding(head)
    text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(head)
    if text.count("\0") > len(text) // 20:
        raise LogError(
            f"{path.name}: is a binary file of no known format; expected CSV, TDMS, MATLAB, Parquet or Excel."
        )
    lines = text.split("\n") if "\n" in text else text.split("\r")  # as _blocks counts them
    if len(head) == _HEAD and len(lines) < 4:
        raise LogError(
            f"{path.name}: lines of more than {_HEAD // 4 >> 10} kB; expected a log with a few dozen columns."
        )
    layout = find_layout(lines, path.name)
    step, start = _waveform(layout)
    return Source(
        headers=layout.headers,
        load=lambda wanted, time: _load(path, encoding, layout, wanted, time),
        form="delimited text",
        time_step=step,
        time_start=start,
        properties=dict(layout.properties),
    )


_STEP_KEYS = frozenset(
    "deltax dt dts sampleinterval samplingintervals sampleintervals samplinginterval wfincrement timestep".split()
)
_RATE_KEYS = frozenset(
    "samplerate samplingrate sampleratehz samplingratehz samplingfrequency samplingfrequencyhz fs fshz rate".split()
)


def _waveform(layout: Layout) -> tuple[float | None, float]:
    """Sampling interval and first stamp that the preamble states. [s]"""
    step, start = None, 0.0
    for key, value in layout.properties.items():
        letters = "".join(c for c in key.casefold() if c.isalnum())
        number = re.match(r"[-+]?\d+(?:[.,]\d+)?(?:[eE][-+]?\d+)?", value)
        if number is None:
            continue
        amount = float(number.group().replace(",", "."))
        if letters in _STEP_KEYS and amount > 0:
            step = amount * (1e-3 if "ms" in value[number.end() :] else 1.0)
        elif letters in _RATE_KEYS and amount > 0:
            step = 1.0 / amount
        elif letters == "x0":
            start = amount
    return step, start


def _load(path: Path, encoding: str, layout: Layout, wanted: Sequence[int], time: int | None) -> Table:
    """Read the wanted columns, block by block."""
    parser = _Parser(layout, wanted, time)
    blocks = _blocks(path, encoding, layout.first)
    first = next(blocks, b"")
    parser.store(parser.parse(first))
    size = path.stat().st_size
    if size > len(first) and parser.rows:
        parser.expect(int(1.05 * size / len(first) * parser.rows) + 1000)
    for table in _in_parallel(parser.parse, blocks) if size > BLOCK else map(parser.parse, blocks):
        parser.store(table)
    return parser.table(path.name)


def _in_parallel(parse: Callable[[Bytes], pa.Table | None], blocks: Iterator[Bytes]) -> Iterator[pa.Table | None]:
    """Parse blocks in threads, a few ahead, and hand them on in their order."""
    from collections import deque
    from concurrent.futures import Future, ThreadPoolExecutor

    ahead: deque[Future[pa.Table | None]] = deque()
    with ThreadPoolExecutor(_WORKERS) as pool:
        for block in blocks:
            ahead.append(pool.submit(parse, block))
            if len(ahead) > _WORKERS:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


def _blocks(path: Path, encoding: str, skip: int) -> Iterator[Bytes]:
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
    decoder = codecs.getincrementaldecoder(encoding)(errors="replace") if encoding.startswith("utf-16") else None
    old_mac = False
    with path.open("rb") as file:
        while True:
            buffer = bytearray(BLOCK)
            size = file.readinto(buffer)
            if not size:
                return
            data = memoryview(buffer)[:size]
            if decoder is not None:
                data = memoryview(decoder.decode(data).encode())
            old_mac = old_mac or (_last_line_end(data) == 0 and b"\r" in data[:_PARALLEL].tobytes())
            yield memoryview(data.tobytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n")) if old_mac else data


def _last_line_end(data: memoryview) -> int:
    """Position after the last line feed of a block, 0 if there is none."""
    for size in (1 << 12, len(data)):
        found = data[-size:].tobytes().rfind(b"\n") if size else -1
        if found >= 0:
            return max(len(data) - size, 0) + found + 1
    return 0


class _Parser(msgspec.Struct):
    """Columns that grow block by block, and what could not be read on the way."""

    layout: Layout
    wanted: Sequence[int]
    time: int | None
    rows: int = 0
    columns: dict[int, Signal] = msgspec.field(default_factory=dict)
    texts: list[str] = msgspec.field(default_factory=list)
    no_numbers: list[str] = msgspec.field(default_factory=lambda: list(NOT_NUMBERS))
    ragged: list[int] = msgspec.field(default_factory=list)
    cut: bool = False
    stamped: bool = False

    def __post_init__(self) -> None:
        self.stamped = self.time is not None and not _is_number(self.layout.example[self.time])
        self.columns = {k: np.empty(0) for k in self._numeric()}

    def _numeric(self) -> list[int]:
        return list(self.wanted) + ([self.time] if self.time is not None and not self.stamped else [])

    def expect(self, rows: int) -> None:
        """Make room for as many rows; what is not used costs no memory until it is written."""
        for k, column in self.columns.items():
            if rows > column.size:
                grown = np.empty(rows)
                grown[: self.rows] = column[: self.rows]
                self.columns[k] = grown

    def parse(self, block: Bytes) -> pa.Table | None:
        """Read whole lines; an unfinished one is the end of a file that was cut off. None if nothing is left."""
        if block[-1:] != b"\n":
            block = bytes(block).rstrip(b"\0\x1a \t")
            if not self._finished(block):
                self.cut = True
                return None
        if self.layout.delimiter == " ":
            block = b"\n".join(re.sub(rb"[ \t]+", b" ", line.strip()) for line in bytes(block).splitlines())
        return self._read(block) if len(block) else None

    def _finished(self, line: bytes) -> bool:
        """Whether the last line, which no line end closes, has all its cells and a number in the last of them."""
        cells = split_row(line.decode("latin-1"), self.layout.delimiter)
        if not line or len(cells) < self.layout.width:
            return not line
        used = max([*self.wanted, self.time if self.time is not None else 0])
        return used < self.layout.width - 1 or _is_number(cells[used]) or cells[used] in NOT_NUMBERS

    def _read(self, block: Bytes) -> pa.Table | None:
        """Parse a block as numbers; a cell that is none sends the block through the slow path, which finds its text."""
        try:
            return self._arrow(block, pa.float64())
        except pa.ArrowInvalid:
            text = bytes(block)
            if b"\0" in text:  # what a logger leaves that lost power while it wrote
                self.cut = True
                text = text.replace(b"\0", b"")
            return self._by_cell(self._arrow(text, pa.string())) if text.strip() else None

    def _arrow(self, block: Bytes, kind: Any) -> pa.Table:
        ragged: list[int] = []

        def skip(row: Any) -> str:
            ragged.append(row.actual_columns)
            return "skip"

        names = [f"c{k}" for k in range(self.layout.width)]
        types = {f"c{k}": kind for k in self._numeric()}
        if self.stamped:
            types[f"c{self.time}"] = pa.string()
        table = csv.read_csv(
            pa.BufferReader(pa.py_buffer(block)),
            read_options=csv.ReadOptions(column_names=names, block_size=_PARALLEL, use_threads=False),
            parse_options=csv.ParseOptions(
                delimiter=self.layout.delimiter, invalid_row_handler=skip, newlines_in_values=False
            ),
            convert_options=csv.ConvertOptions(
                include_columns=list(types),
                column_types=types,
                null_values=self.no_numbers,
                decimal_point=self.layout.decimal,
                check_utf8=False,
            ),
            memory_pool=pa.system_memory_pool() if len(block) < _PARALLEL else None,  # the default pool starts slowly
        )
        self.ragged += ragged
        return table

    def _by_cell(self, texts: pa.Table) -> pa.Table:
        """Numbers of a block in which some cells are none; their texts are known from then on."""
        columns = {}
        for k in self._numeric():
            cells = texts.column(f"c{k}").to_pylist()
            numbers, strange = _numbers(cells, self.layout.decimal)
            columns[f"c{k}"] = pa.Array.from_buffers(pa.float64(), numbers.size, [None, pa.py_buffer(numbers)])
            self.no_numbers += [s for s in strange if s not in self.no_numbers][: max(0, 200 - len(self.no_numbers))]
        if self.stamped:
            columns[f"c{self.time}"] = texts.column(f"c{self.time}")
        return pa.table(columns)

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
        if self.stamped:
            self.texts += [text or "" for text in table.column(f"c{self.time}").to_pylist()]
        self.rows = need

    def table(self, where: str) -> Table:
        """What was read, rows that hold nothing at all left out, with the findings of the reading."""
        values = {k: column[: self.rows] for k, column in self.columns.items()}
        blank = self._blank(values)
        if blank.any():
            values = {k: column[~blank] for k, column in values.items()}
            self.texts = [text for text, no in zip(self.texts, blank.tolist(), strict=False) if not no]
        findings = self._findings(where)
        stamps: Signal | list[str] | None = self.texts if self.stamped else None
        if self.time is not None and not self.stamped:
            stamps = values[self.time]
        return Table({k: values[k] for k in self.wanted}, stamps, findings=findings)

    def _blank(self, values: dict[int, Signal]) -> NDArray[np.bool_]:
        """Rows without a single number: lines of delimiters, or names repeated where logs were joined."""
        blank = np.ones(self.rows, dtype=bool)
        for column in values.values():
            if blank.any():
                blank &= np.isnan(column)
        return blank

    def _findings(self, where: str) -> tuple[Finding, ...]:
        found = []
        if len(self.ragged) > max(10, 0.5 * self.rows):
            raise LogError(
                f"{where}: {len(self.ragged)} rows do not have {self.layout.width} cells like the first one; expected one "
                f"table with rows of equal length."
            )
        if self.ragged:
            found.append(
                Finding(
                    "dropped_samples",
                    f"{len(self.ragged)} lines do not have {self.layout.width} cells like the others",
                    "lines left out",
                    count=len(self.ragged),
                    removed=len(self.ragged),
                )
            )
        if self.cut:
            found.append(Finding("truncated", "the file is cut off inside a row", "the row left out", removed=1))
        return tuple(found)


def _floats(chunk: pa.Array) -> Signal:
    """Numbers of an Arrow array, NaN for null; read from its buffers because `to_numpy` imports pandas."""
    valid, data = chunk.buffers()
    part = slice(chunk.offset, chunk.offset + len(chunk))
    numbers: Signal = np.frombuffer(data, dtype=np.float64)[part]
    if chunk.null_count:
        known = np.unpackbits(np.frombuffer(valid, dtype=np.uint8), bitorder="little")[part]
        numbers = np.where(known == 1, numbers, np.nan)
    return numbers


def _is_number(cell: str) -> bool:
    return _ASCII_NUMBER.fullmatch(cell.strip().strip("\"'").replace(",", ".")) is not None


def _numbers(cells: Sequence[str | None], decimal: str) -> tuple[Signal, list[str]]:
    """Numbers of a column of texts, NaN where there is none, and the texts that are none."""
    values = np.full(len(cells), np.nan)
    strange: dict[str, None] = {}
    for k, cell in enumerate(cells):
        if cell is None:
            continue
        text = cell.strip().strip("\"'")
        plain = text.replace("\u2212", "-")
        plain = plain.replace(".", "").replace(",", ".") if decimal == "," and "," in plain else plain
        plain = plain.replace(",", "") if decimal == "." else plain
        if _ASCII_NUMBER.fullmatch(plain):
            values[k] = float(plain.replace("d", "e").replace("D", "E"))
        elif text:
            strange[cell] = None
    return values, list(strange)
