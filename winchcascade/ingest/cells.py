"""Cells of text tables: where a row is cut into cells, which texts are numbers or neither, and
what they stand for.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.ingest.stamps import looks_like_a_stamp

NOT_NUMBERS = (
    "", "-", "--", "---", "nan", "NaN", "NAN", "-nan", "+nan", "#N/A", "N/A", "NA", "n/a", "null", "NULL", "None", "inf",
    "-inf", "Inf", "-Inf", "+inf", "Infinity", "-Infinity", "1.#QNAN", "-1.#IND", "#NUM!", "#VALUE!", "#DIV/0!", "OVL",
    "OVER", "ERR", "Error", "*****", "?",
)  # fmt: skip
"""Cells that loggers write where they have no number."""

CELL_LENGTH_MAX = 400
"""No number has more characters: the largest float has 309 digits. A search in longer ones would
take long.
"""

_NUMBER = re.compile(
    r"""\s*["']?[-+\u2212\u2013]?(?:\d{1,3}(?:[.,'’ \xa0\u202f]\d{3})+(?:[.,]\d*)?|\d+[.,]?\d*|[.,]\d+)
    (?:[eEdD][-+]?\d+)?["']?\s*$""",
    re.VERBOSE,
)
_PLAIN = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
_GROUPED = {
    ".": re.compile(r"([-+]?[1-9]\d{0,2}(?:[,'’ \xa0\u202f]\d{3})+)(\.\d*)?$"),
    ",": re.compile(r"([-+]?[1-9]\d{0,2}(?:[.'’ \xa0\u202f]\d{3})+)(,\d*)?$"),
}
"""Digits in groups of three, by the decimal sign of the file."""

_MINUS = str.maketrans("\u2212\u2013\u2010\u2011\uff0d\ufe63", "------")


def split_row(line: str, delimiter: str) -> list[str]:
    """Cut one row into cells, quotes taken off; a blank as delimiter stands for any run of
    blanks.
    """
    line = line.rstrip("\r\n")
    if '"' in line and line.count('"') % 2 == 0:
        with suppress(csv.Error, StopIteration):
            row = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True))
            return [cell.strip() for cell in row]
    line = line.replace('"', "")
    return (
        re.split(r"[ \t]+", line.strip())
        if delimiter == " "
        else [cell.strip() for cell in line.split(delimiter)]
    )


def looks_like_a_number(cell: str) -> bool:
    """Whether a cell is a number in any way of writing one."""
    return len(cell) <= CELL_LENGTH_MAX and _NUMBER.match(cell) is not None


def is_value(cell: str) -> bool:
    """Whether a cell holds what a column of data holds: a number, a mark for none, or a stamp."""
    return looks_like_a_number(cell) or cell in NOT_NUMBERS or looks_like_a_stamp(cell)


def decimal_sign(rows: Sequence[Sequence[str]]) -> str:
    """Find the decimal sign: a comma if more numbers hold a comma than a point."""
    commas = sum("," in cell and looks_like_a_number(cell) for row in rows for cell in row)
    return (
        ","
        if commas
        > sum("." in cell and looks_like_a_number(cell) for row in rows for cell in row if commas)
        else "."
    )


def number(cell: str, decimal: str) -> float:
    """Read a text as a number in any way of writing one; NaN for one that is none.

    >>> number("1.234,5", ","), number("−0,018", ","), number("OVL", ",")
    (1234.5, -0.018, nan)
    """
    text = cell.strip().strip("\"'").translate(_MINUS)
    if "," in text and "." in text:
        decimal = max(",.", key=text.rfind)  # the sign that comes first parts thousands
    group = _GROUPED[decimal].match(text)
    if group is not None:
        text = re.sub(r"[^-+\d]", "", group[1]) + (group[2] or "")
    text = re.sub("[dD]", "e", text.replace(",", ".", 1)).replace("E", "e")
    return float(text) if _PLAIN.fullmatch(text) else math.nan


def numbers(cells: Sequence[str], decimal: str) -> tuple[Signal, list[str]]:
    """Read a column of texts: its numbers, NaN where there is none, and the texts that are none."""
    read = {cell: number(cell, decimal) for cell in set(cells)}
    values = np.array([read[cell] for cell in cells], dtype=np.float64)
    return values, [cell for cell, value in read.items() if math.isnan(value) and cell]


def is_cut(cell: str, usual: Sequence[str]) -> bool:
    """Whether the last cell of a file lacks digits, or all of them, that its column always has.

    >>> is_cut("-0.", ["0.01", "-0.5"]), is_cut("", ["0.01"]), is_cut("0.3", ["0.01", "-0.5"])
    (True, True, False)
    """
    like = [c for c in usual if looks_like_a_number(c)]
    if not like:
        return len(cell) < min(map(len, usual), default=0)
    if cell in NOT_NUMBERS and cell in usual:
        return False
    fewest = map(min, zip(*map(_digits, like), strict=True))
    return not looks_like_a_number(cell) or any(
        a < b for a, b in zip(_digits(cell), fewest, strict=True)
    )


def _digits(cell: str) -> tuple[int, int]:
    """Count the digits after the decimal sign and of the exponent."""
    found = re.search(r"(?:[.,](\d*))?(?:[eEdD][-+]?(\d*))?\W*$", cell)
    return (len(found[1] or ""), len(found[2] or "")) if found else (0, 0)
