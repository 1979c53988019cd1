"""Detect the layout of a delimited text file: encoding, delimiter, decimal sign, preamble, names, units, first row of data."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence
from functools import cache
from itertools import chain, pairwise

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import find_unit
from winchcascade.ingest.cells import count_numbers, is_value, looks_like_a_number, split_row
from winchcascade.ingest.dialects import Header, recognise

_ENCODINGS = ("cp950", "cp1252", "cp932", "gb18030", "cp949", "cp1251", "cp1250", "euc_jp", "koi8-r", "cp850")
_BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_WIDE_BLANKS = re.compile(r"\t| {2,}")
_AFTER_BRACKET = re.compile(r"(?<=[)\]])\s+")
_DATE = re.compile(r"\d{1,4}([-/.])\d{1,2}\1\d{1,4}$")
_PROPERTY = re.compile(r"\s*[#%]?\s*\"?([^:=;,\t|\"]{1,60}?)\"?\s*[:=;,\t|]\s*([^;\t|]*)")
_MANY_LINES = 400
"""A preamble is shorter than this."""

_LONG = 200
"""A name is shorter than this."""

_SAMPLE = 50
"""Number of rows from which the layout of a file is found."""


class Layout(msgspec.Struct, frozen=True):
    """Where and how a text file keeps its table.

    Parameters
    ----------
    delimiter : one character; a blank stands for any run of blanks
    headers : the columns in order; one that is empty or only counts rows has no name
    more : there are names beyond the last column that rows usually have, of remarks as a rule
    first : index of the first line of data
    rows : cells of the first rows of data
    quoted : cells may stand in quotation marks
    labview : the file is a LabVIEW measurement, in which the heading may stand above every segment
    properties : `key: value` lines of the preamble, keys as written
    """

    delimiter: str
    decimal: str
    headers: tuple[Header, ...]
    more: bool
    first: int
    rows: tuple[tuple[str, ...], ...]
    quoted: bool
    properties: dict[str, str]
    labview: bool = False

    @property
    def width(self) -> int:
        """Cells in a row of data."""
        return len(self.headers)

    def column(self, k: int) -> list[str]:
        """Cells of one column in the first rows."""
        return [row[k] for row in self.rows if len(row) > k]


def find_encoding(head: bytes) -> str:
    """Guess the encoding of a file from its beginning: a mark, UTF-8, zeros of UTF-16, else the one that reads best."""
    for mark, name in _BOMS:
        if head.startswith(mark):
            return name
    if head[:400].count(b"\0") > len(head[:400]) // 4:
        return "utf-16-le" if head[1:2] == b"\0" else "utf-16-be"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
        return "utf-8"
    except UnicodeDecodeError:
        # Letters beyond ASCII stand alone or in twos in European words, in long runs in Chinese, Japanese and Korean.
        long_runs = re.search(rb"[\x80-\xff]{3}", head[:4096]) is not None
        order = _ENCODINGS if long_runs else _ENCODINGS[1:] + _ENCODINGS[:1]
        return max(order, key=lambda name: _readable(head, name))  # the first of equals


def _readable(head: bytes, encoding: str) -> int:
    """Number of headers and units that are recognised under an encoding; -1 for one that cannot decode the text at all."""
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return -1
    cells = {cell[:_LONG] for line in text.splitlines()[:50] for cell in re.split(r"[,;\t|]", line[: 100 * _LONG])}
    units = sum(find_unit(inside) is not None for c in cells for inside in re.findall(r"[(\[]([^)\]]+)[)\]]", c))
    return sum(recognise(Header(cell)) is not None for cell in cells if cell.strip()) + units


def find_layout(lines: Sequence[str], where: str, *, numbered: bool = False) -> Layout:
    """Find the table in the first lines of a file; where the columns are `numbered`, it needs no names.

    Raises
    ------
    LogError : no rows of numbers, or rows without names above them
    """
    # Blanks also stand inside of stamps and names.
    tables = _tables(lines[:_MANY_LINES], ",;\t|") or _tables(lines[:_MANY_LINES], " ")
    if not tables:
        raise LogError(_no_table(lines, where))
    delimiter, first, rows = max(tables, key=_score) if len(tables) > 1 else tables[0]
    width = usual_width(rows)
    headers = _headers(lines[:first], delimiter, rows, where, numbered=numbered)
    return Layout(
        delimiter,
        decimal_sign(rows),
        headers[:width],
        len(headers) > width,
        first,
        tuple(map(tuple, rows)),
        '"' in "".join(lines[first:]),
        preamble_properties(lines[:first]),
    )


_Table = tuple[str, int, list[list[str]]]
"""A delimiter, the first line of data under it, and the rows from there."""


def _tables(lines: Sequence[str], delimiters: str) -> list[_Table]:
    """Tables that lines hold under some delimiters: two rows of data in a row at least."""
    return [(delimiter, *data) for delimiter in delimiters if (data := _first_data(lines, delimiter)) is not None]


def _score(table: _Table) -> float:
    """Values in a row, less for a table that begins late."""
    _, first, rows = table
    return sum(bool(cell) and is_value(cell) for row in rows for cell in row) / len(rows) - first / (10 * _MANY_LINES)


def _first_data(lines: Sequence[str], delimiter: str) -> tuple[int, list[list[str]]] | None:
    """First line of data under a delimiter and the rows from there; None without two such rows in a row."""
    if delimiter != " " and delimiter not in "".join(lines):
        return None

    @cache  # most logs show their table in the first lines
    def row(k: int) -> list[str]:
        return split_row(lines[k], delimiter)

    @cache
    def data(k: int) -> bool:
        """Whether a row holds a number or a stamp in most cells that are not empty, and in more than one."""
        full = [cell for cell in row(k) if cell]
        count = count_numbers(full)
        return (
            count > 0 and len(full) >= 2 and (count >= 0.6 * len(full) or sum(map(is_value, full)) >= 0.6 * len(full))
        )

    for k in range(len(lines)):
        if not data(k) or _channels(row(k)) > 1:
            continue
        after = [j for j in range(k + 1, min(k + 6, len(lines))) if row(j) != [""]]
        width = usual_width([row(j) for j in after if data(j)])
        alike = sum(data(j) and abs(len(row(j)) - width) <= 1 for j in after) if len(row(k)) >= width - 1 else 0
        if alike >= max(1, len(after) - 2) and not any(_channels(row(j)) > 1 for j in after if not data(j)):
            return k, [row(j) for j in range(k, min(k + _SAMPLE, len(lines))) if data(j)]
    return None


def usual_width(rows: Sequence[Sequence[str]]) -> int:
    """How many cells most rows have."""
    lengths = [len(row) for row in rows]
    return max(lengths, key=lengths.count, default=0)


def _channels(cells: Sequence[str]) -> int:
    """How many different channels a row names."""
    return len({recognise(Header(c)) for c in cells if c and not looks_like_a_number(c)} - {None})


def _headers(
    above: Sequence[str], delimiter: str, rows: list[list[str]], where: str, *, numbered: bool
) -> tuple[Header, ...]:
    """Names and units from the lines above the data: the line that names most channels, the line that is all units."""
    width = usual_width(rows)
    columns = [[row[k] for row in rows if len(row) > k] for k in range(width)]
    filled = max(k + 1 for k, column in enumerate(columns) if any(column))
    found = [_names(line, delimiter, width) for line in above[-12:]][::-1]
    near = [row for row in found if sum(map(bool, row)) >= 2 and len(row) >= filled - 1]
    units = _units(near)
    names = max((row for row in near if row is not units), key=_channels, default=None)
    if names is None and numbered:
        units = _wide(units, width)
        return tuple(Header(f"column {k + 1}", units[k] or None) for k in range(width))
    if names is None:
        raise LogError(_no_names(found, filled, where))
    first = "Date" if any(map(_DATE.match, columns[0])) else "" if _counts(columns[0]) else None
    if len(names) < filled and first is not None:  # rows begin with a number or a date that has no name
        names, units = [first, *names], ["", *units] if len(units) < filled else units
    if any(recognise(Header(name)) for name in names[width:] if name):
        raise LogError(_no_names([names], filled, where))
    names, units = _wide(names, width), _wide(units, width)
    return (
        *(_header(k, names[k], units[k] or None, columns[k]) for k in range(width)),
        *map(Header, names[width:]),
    )


def _units(near: Sequence[list[str]]) -> list[str]:
    """The line of units among those above the data, nearest first; empty if there is none.

    Single letters are names as well as units: `t,F,V` are tonnes, farads and volts where another line has the names, and the
    names themselves where none has.
    """
    alike = [r for k, r in enumerate(near) if _is_units(r) and (k < 4 or "unit" in r[0].casefold())]
    units = min(alike, key=lambda row: _channels(row) - _known_units(row), default=[])
    others = [row for row in near if row is not units]
    named = {recognise(Header(c)) for c in units if c} - {None}
    alone = not others or ("time" in named and not any(map(_channels, others)))
    return [] if len(named) > _known_units(units) - alone else units


def _header(k: int, name: str, unit: str | None, column: Sequence[str]) -> Header:
    """Name of a column; none for an empty time column, nor for one without a name that only counts rows or is text."""
    header = Header(name, unit)
    if name:
        return header if any(column) or recognise(header) != "time" else Header("")
    return Header("" if _counts(column) or not any(map(looks_like_a_number, column)) else f"column {k + 1}", unit)


def _names(line: str, delimiter: str, width: int) -> list[str]:
    """Cells of a line that may hold names, taken apart in the way that fits the number of columns."""
    line = line.lstrip("#%") if delimiter == "\t" else line.strip().lstrip("#%").strip()
    cells = split_row(line, delimiter)
    if delimiter == " " and len(cells) != width:
        for other in (_WIDE_BLANKS.split(line), _AFTER_BRACKET.split(line)):
            if len(other) == width:
                return [cell.strip() for cell in other]
    if len(cells) == 2 * width and all(map(find_unit, cells[1::2])):  # Time, s, Force, N
        return [f"{name} [{unit}]" for name, unit in zip(cells[::2], cells[1::2], strict=True)]
    return cells


def _wide(row: list[str], width: int) -> list[str]:
    return row + [""] * (width - len(row))


def _counts(column: Sequence[str]) -> bool:
    """Whether the cells of a column number the rows."""
    return all(c.isdecimal() and len(c) < 16 for c in column) and all(int(b) == int(a) + 1 for a, b in pairwise(column))


def _is_units(row: Sequence[str]) -> bool:
    """Whether a line is a row of units: most of its cells are units or blank, and none of those is a channel's name."""
    full = [c.strip("()[] ") for c in row if c.strip("()[]-– ")]
    named = sum(recognise(Header(c)) is not None and len(c) > 2 for c in full)
    return _known_units(row) >= max(2, 0.5 * len(full)) and named <= 0.3 * len(full)


def _known_units(row: Sequence[str]) -> int:
    """How many cells of a line are units."""
    return sum(find_unit(c.strip("()[] ")) is not None for c in row if c.strip("()[]-– "))


def decimal_sign(rows: Sequence[Sequence[str]]) -> str:
    """Decimal sign: a comma if more numbers hold a comma than a point."""

    def numbers_with(sign: str) -> int:
        return sum(sign in cell and looks_like_a_number(cell) for row in rows for cell in row)

    commas = numbers_with(",") if "," in "".join(chain.from_iterable(rows)) else 0
    return "," if commas and commas > numbers_with(".") else "."


def preamble_properties(above: Sequence[str]) -> dict[str, str]:
    """Lines of the preamble of the form `key: value`, `key = value` or `key<delimiter>value`."""
    found: dict[str, str] = {}
    for parts in filter(None, map(_PROPERTY.match, above)):
        value = parts[2].strip(' \r\n,"')
        if value:
            found.setdefault(parts[1], re.sub(r"^([-+]?\d+),(\d+)(?!\d*,)", r"\1.\2", value))
    return found


def _no_names(found: Sequence[Sequence[str]], filled: int, where: str) -> str:
    names = next((row for row in found if _channels(row) > 1), None)
    if names is None:
        return (
            f"{where}: rows of {filled} numbers but no column names above them; expected a first row such as "
            f"'Time (s),Displacement (m),Velocity (m/s),Force (N)'. Add one, or number the columns in a rig file: [columns] "
            f'velocity = {{ number = 3, unit = "m/s" }}.'
        )
    if len(names) == filled:
        return (
            f"{where}: the line above the numbers holds units ({', '.join(names[:8])}) and none holds names; expected a row "
            f"of names such as 'Time,Displacement,Velocity,Force' above it. Add one."
        )
    return (
        f"{where}: {len(names)} column names above rows of {filled} cells; expected one name for each column. Check for a "
        f"delimiter inside of names, or for decimal commas in a file that commas delimit."
    )


def _no_table(lines: Sequence[str], where: str) -> str:
    named = [line.strip() for line in lines if line.strip()]
    if any(_channels(split_row(line, delimiter)) > 1 for delimiter in ",;\t" for line in named[:_MANY_LINES]):
        return (
            f"{where}: column names but no rows of numbers below them; expected at least a few seconds of samples. "
            f"Check that the logger wrote its data."
        )
    first = named[0][:40] if named else ""
    return (
        f"{where}: no table of numbers found (it begins with {first!r}); expected column names and rows of numbers. Check "
        f"that this is a log."
    )
