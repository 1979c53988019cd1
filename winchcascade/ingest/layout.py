"""How a delimited text file is laid out: encoding, delimiter, decimal sign, preamble, names, units, first row of data."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence

import msgspec

from winchcascade.errors import LogError
from winchcascade.ingest.dialects import recognise
from winchcascade.ingest.source import Header
from winchcascade.quantity import find_unit

NOT_NUMBERS = (
    "", "-", "--", "---", "nan", "NaN", "NAN", "-nan", "+nan", "#N/A", "N/A", "NA", "n/a", "null", "NULL", "None", "inf",
    "-inf", "Inf", "-Inf", "+inf", "Infinity", "-Infinity", "1.#QNAN", "-1.#IND", "#NUM!", "#VALUE!", "#DIV/0!", "OVL",
    "OVER", "ERR", "Error", "*****", "?",
)  # fmt: skip
"""Cells that loggers write where they have no number."""

_ENCODINGS = ("cp950", "cp1252", "cp932", "gb18030", "cp949", "cp1251")
_BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
_NUMBER = re.compile(r"\s*[\"']?[-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eEdD][-+]?\d+)?[\"']?\s*$")
_SPACES = re.compile(r"[ \t]+")
_MANY_LINES = 400
"""A preamble is shorter than this."""


class Layout(msgspec.Struct, frozen=True):
    """Where and how a text file keeps its table.

    Parameters
    ----------
    delimiter : one character; a blank stands for any run of blanks
    headers : the columns in order
    first : index of the first line of data
    width : cells in a row of data
    example : cells of the first row of data
    properties : `key: value` lines of the preamble, keys as written
    """

    delimiter: str
    decimal: str
    headers: tuple[Header, ...]
    first: int
    width: int
    example: tuple[str, ...]
    properties: dict[str, str]


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
        return max(_ENCODINGS, key=lambda name: _readable(head, name))


def _readable(head: bytes, encoding: str) -> tuple[int, int]:
    """How many headers an encoding lets us recognise; less for one that cannot decode the text at all."""
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(head)
    except UnicodeDecodeError:
        return -1, 0
    cells = {cell for line in text.splitlines()[:50] for cell in re.split(r"[,;\t|]", line) if not _NUMBER.match(cell)}
    units = sum(find_unit(inside) is not None for c in cells for inside in re.findall(r"[(\[]([^)\]]+)[)\]]", c))
    return sum(recognise(Header(cell)) is not None for cell in cells if cell.strip()) + units, -_ENCODINGS.index(
        encoding
    )


def find_layout(lines: Sequence[str], where: str) -> Layout:
    """Find the table in the first lines of a file.

    Raises
    ------
    LogError : no rows of numbers, or rows without names above them
    """
    best: tuple[float, str, int, int] | None = None
    for delimiter in (",", ";", "\t", "|", " "):
        found = _first_data(lines, delimiter)
        if found is not None:
            first, width = found
            score = (width if delimiter != " " else width - 0.5) - first / (10 * _MANY_LINES)
            if best is None or score > best[0]:
                best = (score, delimiter, first, width)
    if best is None:
        raise LogError(_no_table(lines, where))
    _, delimiter, first, width = best
    rows = [_cells(line, delimiter) for line in lines[first : first + 50] if line.strip()]
    headers = _headers(lines[:first], delimiter, width)
    if headers is None:
        raise LogError(
            f"{where}: rows of {width} numbers but no column names above them; expected a first row such as "
            f"'Time (s),Displacement (m),Velocity (m/s),Force (N)'. Add one."
        )
    return Layout(
        delimiter, _decimal(rows, delimiter), headers, first, width, tuple(rows[0]), _properties(lines[:first])
    )


def split_row(line: str, delimiter: str) -> list[str]:
    """Cells of one row, quotes taken off."""
    return _cells(line, delimiter)


def _cells(line: str, delimiter: str) -> list[str]:
    line = line.rstrip("\r\n")
    if delimiter == " ":
        return _SPACES.split(line.strip())
    if '"' in line:
        import csv

        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]
    return [cell.strip() for cell in line.split(delimiter)]


def _is_data(cells: Sequence[str]) -> bool:
    """Whether a row holds data: a number or a stamp in most cells that are not empty, and in more than one."""
    full = [c for c in cells if c]
    good = sum(bool(_NUMBER.match(c)) or c in NOT_NUMBERS or _is_stamp(c) for c in full)
    numbers = sum(bool(_NUMBER.match(c)) for c in full)
    return numbers >= 1 and len(full) >= 2 and good >= 0.6 * len(full)


def _is_stamp(cell: str) -> bool:
    if ":" not in cell:
        return False
    from winchcascade.ingest.stamps import looks_like_a_stamp

    return looks_like_a_stamp(cell)


def _first_data(lines: Sequence[str], delimiter: str) -> tuple[int, int] | None:
    """First line of data under a delimiter and the width of its rows; None without two such rows in a row."""
    if delimiter != " " and not any(delimiter in line for line in lines[:_MANY_LINES]):
        return None
    rows = [_cells(line, delimiter) for line in lines[:_MANY_LINES]]
    for k, row in enumerate(rows):
        if len(row) < 2 or not _is_data(row):
            continue
        after = [r for r in rows[k + 1 : k + 6] if r != [""]]
        alike = sum(len(r) == len(row) and _is_data(r) for r in after)
        if after and alike >= max(1, len(after) - 2):
            return k, len(row)
    return None


def _headers(above: Sequence[str], delimiter: str, width: int) -> tuple[Header, ...] | None:
    """Names and units from the lines above the data: the line that names most channels, the line that is all units."""
    candidates: list[tuple[int, list[str]]] = []
    for k in range(len(above) - 1, max(-1, len(above) - 12), -1):
        cells = _cells(above[k].lstrip("#%").strip(" ") if delimiter != "\t" else above[k].lstrip("#%"), delimiter)
        if sum(bool(c) for c in cells) >= 2 and len(cells) >= width - 1:
            candidates.append((k, cells))
    if not candidates:
        return None
    units = next((row for _, row in candidates[:4] if _is_units(row)), None)
    named = [
        (sum(recognise(Header(c)) is not None for c in row if c), k, row) for k, row in candidates if row is not units
    ]
    if not named:
        return None
    names = max(named)[2]
    names, units = _wide(names, width), None if units is None else _wide(units, width)
    return tuple(Header(name, units[k] or None if units else None) for k, name in enumerate(names[:width]))


def _wide(row: list[str], width: int) -> list[str]:
    return row + [""] * (width - len(row))


def _is_units(row: Sequence[str]) -> bool:
    """Whether a line is a row of units: most of its cells are units or blank, and none of those is a channel's name."""
    full = [c.strip("()[] ") for c in row if c.strip("()[]-– ")]
    known = sum(find_unit(c) is not None for c in full)
    named = sum(recognise(Header(c)) is not None and len(c) > 2 for c in full)
    return known >= 2 and known >= 0.5 * len(full) and named <= 0.3 * len(full)


def _decimal(rows: Sequence[Sequence[str]], delimiter: str) -> str:
    """Decimal sign: a comma if numbers hold commas and no points, unless the comma parts the cells."""
    if delimiter == "," and not any("," in c for row in rows for c in row):
        return "."
    numbers = [c for row in rows for c in row if _NUMBER.match(c)]
    return "," if sum("," in c for c in numbers) > sum("." in c for c in numbers) else "."


def _properties(above: Sequence[str]) -> dict[str, str]:
    """Lines of the preamble that say `key: value`, `key = value` or `key<delimiter>value`."""
    found: dict[str, str] = {}
    for line in above:
        parts = re.match(r"\s*[#%]?\s*([^:=;,\t]{1,60}?)\s*[:=;,\t]\s*([^;\t]*?)[;,\t\s]*$", line)
        if parts and parts.group(2) and parts.group(1) not in found:
            found[parts.group(1)] = parts.group(2).split("\t")[0].strip()
    return found


def _no_table(lines: Sequence[str], where: str) -> str:
    named = [line.strip() for line in lines if line.strip()]
    for delimiter in (",", ";", "\t"):
        for line in named[:_MANY_LINES]:
            cells = _cells(line, delimiter)
            if sum(recognise(Header(c)) is not None for c in cells) >= 2:
                return (
                    f"{where}: column names but no rows of numbers below them; expected at least a few seconds of samples. "
                    f"Check that the logger wrote its data."
                )
    first = named[0][:40] if named else ""
    return (
        f"{where}: no table of numbers found (it begins with {first!r}); expected column names and rows of numbers. Check "
        f"that this is a log."
    )
