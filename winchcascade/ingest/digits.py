"""Clocks whose stamps are numbers, digits of the time of day: 095959.96 and 20260301095959.96, as controllers write them."""

from __future__ import annotations

from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.order import median

if TYPE_CHECKING:
    from winchcascade.run import Signal

_DAY = 86400.0
_LONGEST = 10.0
"""With longer intervals the jump from one minute to the next does not stand out. [s]"""

_NEAR = 0.5
"""The interval over the end of a minute is off the usual one by less than this share; one that is not leaves a doubt."""


@np.errstate(invalid="ignore")  # what is left of an infinite stamp
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
    ahead = interval[interval > 0]
    usual = median(ahead) if ahead.size else 0.0
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
