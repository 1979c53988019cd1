"""Clocks whose stamps are numbers, digits of the time of day: 095959.96 and 20260301095959.96, as controllers write them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import positive_median

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


_DAY = 86400.0
_LONGEST = 10.0
"""With longer intervals the jump from one minute to the next does not stand out. [s]"""

_NEAR = 0.5
"""The interval over the end of a minute is off the usual one by less than this share; one that is not leaves a doubt."""


@np.errstate(invalid="ignore")  # the remainder of an infinite stamp
def clock_of_digits(stamps: Signal) -> Signal | None:
    """Seconds since the first stamp, if the stamps are certain to be HHMMSS or YYYYMMDDHHMMSS; else None. [s]

    They are where no minute and no second reaches 60, no hour 24, every date exists, and the next minute begins one interval
    after the last stamp of each: read as plain seconds, that interval would be 40 s longer. NaN stays.

    >>> clock_of_digits(np.array([95959.0, 95959.5, 100000.0, 100000.5])).tolist()
    [0.0, 0.5, 1.0, 1.5]
    """
    if np.any(stamps % 100 >= 60):  # at once for nearly every log of plain seconds
        return None
    at = np.flatnonzero(np.isfinite(stamps))
    whole = np.floor(stamps[at])
    day, in_day = np.divmod(whole, 1e6)
    hour, minute, second = in_day // 1e4, in_day // 100 % 100, in_day % 100
    number = _numbers(day)
    if at.size == 0 or number is None or hour.max() >= 24 or minute.max() >= 60:
        return None
    since = number * _DAY + hour * 3600 + minute * 60 + second + (stamps[at] - whole)
    if not day.any():
        since += _DAY * np.cumsum(np.diff(since, prepend=since[0]) < -_DAY / 2)
    if not _runs_on(np.diff(since), np.diff(whole // 100) != 0):
        return None
    seconds = np.full(stamps.size, np.nan)
    seconds[at] = since - since[0]
    return seconds


def _runs_on(interval: Signal, turns: Signal) -> bool:
    """Whether minutes end within the log, each a usual interval before the next one begins."""
    usual = positive_median(interval)
    over = interval[turns]
    return bool(0 < usual < _LONGEST and over.size and np.all(np.abs(over - usual) < _NEAR * usual))


def _numbers(days: Signal) -> Signal | None:
    """Number each day, written YYYYMMDD; 0 for stamps without a date, None if one does not exist."""
    different, which = np.unique(days, return_inverse=True)
    if different.size == 1 and different[0] == 0:
        return days
    try:
        numbers = [date(int(d) // 10000, int(d) // 100 % 100, int(d) % 100).toordinal() for d in different.tolist()]
    except (ValueError, OverflowError):
        return None
    return np.array(numbers, dtype=np.float64)[which]


NOT_NUMBERS = (
    "", "-", "--", "---", "nan", "NaN", "NAN", "-nan", "+nan", "#N/A", "N/A", "NA", "n/a", "null", "NULL", "None", "inf",
    "-inf", "Inf", "-Inf", "+inf", "Infinity", "-Infinity", "1.#QNAN", "-1.#IND", "#NUM!", "#VALUE!", "#DIV/0!", "OVL",
    "OVER", "ERR", "Error", "*****", "?",
)  # fmt: skip
"""Cells that loggers write where they have no number."""

_NUMBER = re.compile(
    r"""\s*["']?[-+\u2212\u2013]?(?:\d{1,3}(?:[.,'’ \xa0\u202f]\d{3})+(?:[.,]\d*)?|\d+[.,]?\d*|[.,]\d+)
    (?:[eEdD][-+]?\d+)?["']?\s*$""",
    re.VERBOSE,
)
_PLAIN = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?")
_GROUPED = {
    ".": re.compile(r"([-+]?[1-9]\d{0,2}(?:[,'’ \xa0\u202f]\d{3})+)(\.\d*)?$"),
    ",": re.compile(r"([-+]?[1-9]\d{0,2}(?:[.'’ \xa0\u202f]\d{3})+)(,\d*)?$"),
}
"""Digits in groups of three, by the decimal sign of the file."""

LONGEST = 400
"""No number has more characters: the largest float has 309 digits. To look closely at longer ones would take long."""

_MINUS = str.maketrans("\u2212\u2013\u2010\u2011\uff0d\ufe63", "------")
_BLANKS = re.compile(r"[ \t]+")


def split_row(line: str, delimiter: str) -> list[str]:
    """Cells of one row, quotes taken off; a blank as delimiter stands for any run of blanks."""
    line = line.rstrip("\r\n")
    if '"' in line and line.count('"') % 2 == 0:
        import csv

        try:
            cells = next(csv.reader([line.strip(" ")], delimiter=delimiter, skipinitialspace=True))
            return [cell.strip() for cell in cells]
        except (csv.Error, StopIteration):
            pass
    line = line.replace('"', "")
    if delimiter == " ":
        return _BLANKS.split(line.strip())
    return [cell.strip() for cell in line.split(delimiter)]


def looks_like_a_number(cell: str) -> bool:
    """Whether a cell is a number in any way of writing one."""
    return len(cell) <= LONGEST and _NUMBER.match(cell) is not None


def is_value(cell: str) -> bool:
    """Whether a cell holds what a column of data holds: a number, a mark for none, or a stamp."""
    return looks_like_a_number(cell) or cell in NOT_NUMBERS or is_stamp(cell)


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date with a time, or a time of day."""
    if ":" not in cell and cell[8:9] != "T" and "時" not in cell and "时" not in cell:
        return False  # at no cost for the cells of a table of numbers
    from winchcascade.ingest.stamps import looks_like_a_stamp

    return looks_like_a_stamp(cell)


def _quick(cell: str, decimal: str) -> float:
    """A number without frills; ValueError for one that must be looked at closely."""
    if "_" in cell or (decimal == "," and "," not in cell and "." in cell):
        raise ValueError
    if decimal == ",":
        cell = cell.replace(",", ".")
    return float(cell)


def numbers(cells: Sequence[str], decimal: str) -> tuple[Signal, list[str]]:
    """Numbers of a column of texts, NaN where there is none, and the texts that are none.

    >>> numbers(["1.234,5", "0,018", "OVL"], ",")[0].tolist()
    [1234.5, 0.018, nan]
    """
    values = np.full(len(cells), np.nan)
    strange: dict[str, None] = {}
    for k, cell in enumerate(cells):
        try:
            values[k] = _quick(cell, decimal)
            continue
        except ValueError:
            pass
        text = cell.strip().strip("\"'").translate(_MINUS)
        group = _GROUPED[decimal].match(text)
        if group is not None:
            text = re.sub(r"[^-+\d]", "", group[1]) + (group[2] or "")
        plain = text.replace(",", ".", 1)
        if _PLAIN.fullmatch(plain):
            values[k] = float(plain.replace("d", "e").replace("D", "E"))
        elif text:
            strange[cell] = None
    return values, list(strange)


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
    least = [min(digits) for digits in zip(*map(_digits, like), strict=True)]
    return not looks_like_a_number(cell) or any(a < b for a, b in zip(_digits(cell), least, strict=True))


def _digits(cell: str) -> tuple[int, int]:
    """Digits after the decimal sign and of the exponent."""
    part = re.search(r"[.,](\d+)(?!.*[.,])", cell)
    power = re.search(r"[eEdD][-+]?(\d+)", cell)
    return len(part[1]) if part else 0, len(power[1]) if power else 0
