"""Texts of dates and times to seconds."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from winchcascade.run import Signal

_MONTHS = {name: k % 12 + 1 for k, name in enumerate(
    "jan feb mar apr may jun jul aug sep oct nov dec jan feb mär apr mai jun jul aug sep okt nov dez".split()
)}  # fmt: skip
_STAMP = re.compile(
    r"""\s*"?(?:(?P<a>\d{1,4})[-/.年\s](?P<b>\d{1,2}|[A-Za-zä]{3})[a-z]*[-/.月\s](?P<c>\d{1,4})日?[\sT_,]*)?
    (?P<noon1>[AaPp]\.?[Mm]\.?|上午|下午)?\s*
    (?P<h>\d{1,3}):(?P<m>\d{2})(?::(?P<s>\d{2}))?(?:[.,:](?P<f>\d+))?
    \s*(?P<noon2>[AaPp]\.?[Mm]\.?)?\s*(?P<zone>Z|UTC|GMT|[+-]\d{2}:?\d{2})?"?\s*$""",
    re.VERBOSE,
)
DAY = 86400.0


def looks_like_a_stamp(text: str) -> bool:
    """Whether a cell is a date with a time, or a time of day.

    >>> looks_like_a_stamp("2026-04-18T10:00:00.040"), looks_like_a_stamp("12.5")
    (True, False)
    """
    return _STAMP.match(text) is not None


def seconds(texts: Sequence[str]) -> Signal:
    """Turn stamps into seconds since the first one; NaN for a text that is no stamp, midnight carried over. [s]

    >>> seconds(["18.04.2026 23:59:59,96", "19.04.2026 00:00:00,00"]).round(3).tolist()
    [0.0, 0.04]
    """
    days: dict[tuple[str, str, str], float] = {}
    since = np.array([_seconds_of_day(text, days) for text in texts])
    good = np.flatnonzero(np.isfinite(since))
    if good.size and not days:
        wraps = np.cumsum(np.diff(since[good], prepend=since[good[0]]) < -DAY / 2)
        since[good] += DAY * wraps
    return since - since[good[0]] if good.size else since


def _seconds_of_day(text: str, days: dict[tuple[str, str, str], float]) -> float:
    found = _STAMP.match(text)
    if found is None:
        return float("nan")
    h, m, s = found["h"], found["m"], found["s"]
    if s is None and found["f"] is not None:  # 00:01.2, as a spreadsheet shows minutes and seconds
        h, m, s = "0", h, m
    hour = int(h)
    noon = (found["noon1"] or found["noon2"] or "").lower()
    if noon:
        hour = hour % 12 + (12 if noon.startswith("p") or noon == "下午" else 0)
    in_day = hour * 3600.0 + int(m) * 60.0 + int(s or 0) + (float("0." + found["f"]) if found["f"] else 0.0)
    if found["a"] is None:
        return in_day
    key = (found["a"], found["b"], found["c"])
    if key not in days:
        days[key] = _day(*key)
    return days[key] * DAY + in_day


def _day(a: str, b: str, c: str) -> float:
    """Number of the day of a date in any order; NaN for one that does not exist."""
    month = _MONTHS.get(b.lower()[:3])
    if month is not None:
        year, day = (int(a), int(c)) if len(a) == 4 else (int(c), int(a))
    elif len(a) == 4:
        year, month, day = int(a), int(b), int(c)
    else:
        year, first, second = int(c), int(a), int(b)
        month, day = (first, second) if second > 12 else (second, first)
    try:
        return float(date(year + 2000 if year < 100 else year, month, day).toordinal())
    except ValueError:
        return float("nan")
