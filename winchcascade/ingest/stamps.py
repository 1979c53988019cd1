"""Stamps: which texts are dates or times, and the seconds that they stand for."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from datetime import date

import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.run import Signal

_MONTHS = {
    name: month
    for month, names in enumerate(
        (
            "jan ene gen", "feb fév fev", "mar mär mrt", "apr avr abr", "may mai mei maj mag", "jun juin giu", "jul juil lug",
            "aug aoû aou ago", "sep set", "oct okt ott out", "nov", "dec dez déc dic",
        ),
        start=1,
    )
    for name in names.split()
}  # fmt: skip
_STAMP = r"""[\s"'\[]*(?:[^\W\d_]{2,9}\.?,?\s+(?=\S+\s+\S+\s))?                            # a weekday adds nothing
    (?:(?:(?P<a>\d{4})(?P<b>\d\d)(?P<c>\d\d)(?=[T\s])
      |(?P<d>\d{1,4})[-/.年\s](?P<e>\d{1,2}|[^\W\d_]{3,9}\.?)[-/.月\s]+(?P<f>\d{1,4})日?
      |(?P<month>[^\W\d_]{3,9})\.?\s+(?P<day>\d{1,2}),?\s+(?P<year>\d{4}))[\sT_,-]*)?
    (?P<noon1>[AaPp]\.?[Mm]\.?|上午|下午)?\s*
    (?:(?P<h>\d{1,3})[:時时](?P<m>\d\d)(?:[:分](?P<s>\d\d))?|(?<=T)(?P<hms>\d{6}))(?:[.,:](?P<frac>\d+))?秒?
    \s*(?P<noon2>[AaPp][.,]?[Mm][.,]?)?\s*(?P<zone>Z|(?:UTC|GMT)?(?:[+-]\d\d?(?::?\d\d)?)?)[\]"'\s]*$"""
"""A stamp, compiled when it is used: most logs have none."""

DAY = 86400.0
STAMP_LENGTH_MAX = 64
"""A stamp is shorter than this."""

_SERIAL = ((0.0, 1.0), (20000.0, 80000.0), (700_000.0, 780_000.0))
"""A part of a day, days since 1900 or 1904 (1954 to 2119), MATLAB's days since the year 0 (1916
to 2135).
"""

_SHORTEST_DAY_STEP = 1e-5
"""Stamps this close together would be 100 kHz if they were seconds; as days they are less than a
second apart.
"""

_Day = tuple[str, ...]


def looks_like_a_stamp(cell: str) -> bool:
    """Whether a cell is a date with a time, or a time of day.

    >>> looks_like_a_stamp("2026-04-18T10:00:00.040"), looks_like_a_stamp("12.5")
    (True, False)
    """
    # At no cost for the cells of a table of numbers.
    timed = ":" in cell or cell[8:9] == "T" or "時" in cell or "时" in cell
    return timed and len(cell) < STAMP_LENGTH_MAX and re.match(_STAMP, cell, re.VERBOSE) is not None


def seconds(texts: Sequence[str]) -> Signal:
    """Turn stamps into seconds since the first one; NaN for a text that is no stamp, midnight
    carried over. [s]

    >>> seconds(["18.04.2026 23:59:59,96", "19.04.2026 00:00:00,00"]).round(3).tolist()
    [0.0, 0.04]
    """
    days: dict[_Day | None, list[int]] = {}
    zones: dict[str | None, list[int]] = {}
    since = np.empty(len(texts))
    period = DAY
    for k, text in enumerate(texts):
        since[k], day, minutes, zone = _in_day(text)
        days.setdefault(day, []).append(k)
        zones.setdefault(zone, []).append(k)
        period = 3600.0 if minutes else period
    if any(days):
        for day, number in _numbers_of(days).items():
            since[days[day]] += DAY * number
        zones.pop(None, None)
        if (
            len(zones) > 1 and "" not in zones
        ):  # summer time begins or ends, and every stamp has its offset from UTC
            for zone, rows in zones.items():
                since[rows] -= _east_of_utc(zone or "")
    good = np.flatnonzero(np.isfinite(since))
    if not any(days):
        since[good] += period * np.cumsum(
            np.diff(since[good], prepend=since[good[:1]]) < -period / 2
        )
    return since - since[good[0]] if good.size else since


def moment(text: str) -> float | None:
    """Seconds since 1970 of a stamp, of one without an offset from UTC as if it were UTC; None
    without a certain date. [s]

    Dates of which day and month may be exchanged are certain only with points, as these follow the
    day.

    >>> moment("1970-01-02 00:00:01.5"), moment("01.02.1970 00:00"), moment("1/2/1970 00:00"), moment("12:00:00")
    (86401.5, 2678400.0, None, None)
    """
    in_day, day, _, zone = _in_day(text)
    if day is None:
        return None
    days = [n for month_first in (False, True) if math.isfinite(n := _number_of(day, month_first))]
    if not days or (days[0] != days[-1] and re.match(r"\D*\d+\.", text) is None):
        return None
    return DAY * (days[0] - _EPOCH) + in_day - _east_of_utc(zone or "")


_EPOCH = date(1970, 1, 1).toordinal()
"""Number of the day from which moments are counted."""


def _east_of_utc(zone: str) -> float:
    """What the clock of a zone such as `Z`, `+0530` or `UTC-8` is ahead of UTC. [s]

    >>> [_east_of_utc(zone) for zone in ("Z", "+02:00", "UTC-8", "+530")]
    [0.0, 7200.0, -28800.0, 19800.0]
    """
    digits = "".join(c for c in zone if c.isdecimal())
    hours, minutes = (digits[:-2], digits[-2:]) if len(digits) > 2 else (digits, "0")
    return (-1.0 if "-" in zone else 1.0) * (int(hours or 0) * 3600.0 + int(minutes) * 60.0)


def _in_day(text: str) -> tuple[float, _Day | None, bool, str | None]:
    """Seconds since midnight, the parts of the date, whether a text shows minutes and seconds
    alone, and its zone.

    The zone is empty for a stamp without one, and None for a text that is no stamp.
    """
    found = re.match(_STAMP, text, re.VERBOSE) if len(text) < STAMP_LENGTH_MAX else None
    if found is None:
        return float("nan"), None, False, None
    h, m, s, frac = found.group("h", "m", "s", "frac")
    if found["hms"]:
        h, m, s = found["hms"][:2], found["hms"][2:4], found["hms"][4:]
    minutes = s is None and frac is not None
    if minutes:  # 00:01.2, as a spreadsheet shows minutes and seconds
        h, m, s = "0", h, m
    hour = int(h)
    noon = (found["noon1"] or found["noon2"] or "").lower()
    if noon:
        hour = hour % 12 + (12 if noon.startswith("p") or noon == "下午" else 0)
    in_day = hour * 3600.0 + int(m) * 60.0 + int(s or 0) + (float("0." + frac) if frac else 0.0)
    day = tuple(
        part
        for part in found.group("a", "b", "c", "d", "e", "f", "day", "month", "year")
        if part is not None
    )
    return in_day, day or None, minutes and not day, found["zone"]


def _numbers_of(days: Mapping[_Day | None, object]) -> dict[_Day | None, float]:
    """Number each day from the first; of day before month and month before day the order that
    exists and spans fewer days.
    """
    orders = [
        {day: float("nan") if day is None else _number_of(day, month_first) for day in days}
        for month_first in (False, True)
    ]
    real = [[n for n in order.values() if np.isfinite(n)] for order in orders]
    best = min(
        (0, 1), key=lambda k: (-len(real[k]), max(real[k], default=0.0) - min(real[k], default=0.0))
    )
    return {day: n - min(real[best], default=0.0) for day, n in orders[best].items()}


def _number_of(day: _Day, month_first: bool) -> float:
    """Number of a day; NaN for one that does not exist."""
    first, second, third = day
    if len(first) > 2:
        first, third = third, first
    elif month_first and second.isdecimal():
        first, second = second, first
    name = second.casefold().rstrip(".")
    month = int(name) if name.isdecimal() else _MONTHS.get(name[:4], _MONTHS.get(name[:3], 0))
    try:
        return float(
            date(int(third) + (2000 if int(third) < 100 else 0), month, int(first)).toordinal()
        )
    except ValueError:
        return float("nan")


def serial_days(values: Signal) -> Signal | None:
    """Seconds since the first stamp, if the stamps are days as a spreadsheet or MATLAB counts them;
    else None. [s]

    >>> serial_days(np.array([46130.25, 46130.2500005, 46130.250001])).round(3).tolist()
    [0.0, 0.043, 0.086]
    """
    good = values[np.isfinite(values)]
    step = np.diff(good[:1000])
    fine = step.any() and 0 < median(step[step != 0]) < _SHORTEST_DAY_STEP
    if not fine or not any(low <= good.min() and good.max() <= high for low, high in _SERIAL):
        return None
    since: Signal = (values - good[0]) * DAY
    return since
