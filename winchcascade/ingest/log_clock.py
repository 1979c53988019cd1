"""Which clock a log has: a time column with its unit, digits of a clock, an index without name,
or a stated rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from datetime import date

import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median, positive_median
from winchcascade.core.plain_text import one_line
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.assign import Assignment, listed
from winchcascade.ingest.clock import Clock, even_clock, read_clock, require_rising
from winchcascade.ingest.source import LogSource, LogTable
from winchcascade.ingest.stamps import looks_like_a_stamp, moment, seconds

STEP_MEANS_MAX = 200
"""Largest number of rows of a table without clock that may be step means."""

STAMPS_MIN = 3
"""Fewer stamps show no clock."""

EPOCH_SECONDS = 1e9, 5e9
"""Seconds since 1970 or, by LabVIEW, 1904, with which a clock of this century begins. [s]"""

MILLISECONDS_FROM = 2.0
"""Usual step of stamps without a unit from which they count milliseconds: no log takes a sample
every two seconds.
"""

MINUTE_STEP_MAX = 10.0
"""With longer intervals the jump of digits from one minute to the next is not significant. [s]"""

MINUTE_STEP_SHARE = 0.5
"""The interval over the end of a minute deviates from the usual one by less than this share. [1]"""

_DAY = 86400.0
_DIGITS = len("YYYYMMDDHHMMSS")
_TIME_UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0}


def log_clock(
    source: LogSource, table: LogTable, found: Assignment, rig: Rig, samples: int, where: str
) -> Clock:
    """Stamps from the time column, else from the increment that the file or the rig file states;
    rows of step means have none.

    Raises
    ------
    LogError : no column of the log is a clock and neither states a rate; the stamps cannot be used
    """
    if rig.phases.source == "rows":
        return even_clock(samples, 1.0, 0.0)
    if table.stamps is None:
        step = source.time_step or (rig.sample_rate and 1.0 / rig.sample_rate)
        if step is None:
            means = (
                ' For rows that are step means, set from = "rows" under [phases].'
                if samples <= STEP_MEANS_MAX
                else ""
            )
            raise LogError(
                f"{where}: no time column and no sampling interval; the log has "
                f"{listed([h.name.strip() for h in source.headers])}. Name the column in a rig "
                f"file under [columns], or "
                f"its rate as sample_rate_hz under [log].{means}"
            )
        clock = even_clock(samples, step, source.time_start if source.time_step else 0.0)
        require_rising(clock.t, where)
        return clock
    stamps = table.stamps if isinstance(table.stamps, np.ndarray) else seconds(table.stamps)
    if table.stamped or stamps is not table.stamps or found.time is None:
        return read_clock(stamps, where)
    if found.time.unit is not None:
        return read_clock(_times(stamps, found.time.factor), where)
    digits = clock_of_digits(stamps)
    if digits is not None:
        return read_clock(digits, where)
    factor, finding = _assumed_unit(stamps, table, found)
    clock = read_clock(_times(stamps, factor), where)
    return Clock(clock.t, clock.fs, clock.rows, clock.gaps, (finding, *clock.findings))


def _times(stamps: Signal, factor: float) -> Signal:
    """Stamps times a factor; what becomes too large for a number is infinite, as no time that a
    log can have.
    """
    with np.errstate(over="ignore"):
        return stamps if factor == 1.0 else stamps * factor


def _assumed_unit(stamps: Signal, table: LogTable, found: Assignment) -> tuple[float, Finding]:
    """Unit of a time column that names none: the one with which the velocity gives the
    displacement, else by its steps.
    """
    step = np.diff(stamps[np.isfinite(stamps)])
    usual = median(step) if step.size else 0.0
    unit, why = (
        ("ms", "its steps are long") if usual >= MILLISECONDS_FROM else ("s", "the usual unit")
    )
    moved, speed = found.channels.get("displacement"), found.channels.get("velocity")
    if moved is not None and speed is not None and usual > 0:
        with np.errstate(over="ignore", invalid="ignore"):
            travelled = float(np.nansum(np.abs(np.diff(table.values[moved.index])))) * moved.factor
            expected = float(np.nansum(np.abs(table.values[speed.index]))) * speed.factor * usual
        if 0 < travelled < math.inf and 0 < expected < math.inf:
            ratio = math.log(travelled) - math.log(
                expected
            )  # the quotient itself may be too small for a number
            unit = min(_TIME_UNITS, key=lambda name: abs(math.log(_TIME_UNITS[name]) - ratio))
            why = "with which velocity and displacement agree"
    column = (
        "the time column names no unit"
        if found.time_named
        else "the clock is a column without name or unit"
    )
    return _TIME_UNITS[unit], Finding(
        "unit_assumed", f"{column}; taken as {unit}, {why}", "assumed"
    )


def is_clock(table: LogTable) -> bool:
    """Whether a column holds stamps, or numbers that rise throughout; whole numbers are no
    clock, as they count rows.
    """
    stamps = table.stamps
    if stamps is None:
        return False
    if not isinstance(stamps, np.ndarray):
        return 2 * sum(map(looks_like_a_stamp, stamps)) > len(stamps)
    good = stamps[np.isfinite(stamps)]
    if good.size < STAMPS_MIN or table.stamped:
        return good.size >= STAMPS_MIN and bool(good[-1] > good[0])
    return bool(np.all(good[1:] > good[:-1]) and np.any(good != np.rint(good)))


def first_stamp(stamps: Signal | Sequence[str] | None) -> str:
    """The first stamp as the log writes it; nothing where stamps are numbers."""
    if stamps is None or isinstance(stamps, np.ndarray):
        return ""
    return one_line(
        next((str(stamp) for stamp in stamps[:STEP_MEANS_MAX] if str(stamp).strip()), "")
    )


def start_of(table: LogTable, first: float) -> float | None:
    """When the run began, on a clock that other logs share; None where its stamps carry no date.
    [s]

    Parameters
    ----------
    first : time of the first sample on the clock of the log [s]
    """
    stamps = table.stamps
    if table.began is not None or EPOCH_SECONDS[0] <= first < EPOCH_SECONDS[1]:
        return first if table.began is None else table.began
    if stamps is None:
        return None
    if not isinstance(stamps, np.ndarray):
        return next((moment(text) for text in stamps if looks_like_a_stamp(text)), None)
    good = stamps[np.isfinite(stamps)]
    digits = (
        f"{good[0]:.0f}" if first == 0.0 and good.size else ""
    )  # of a clock of digits, which begins at 0
    return moment(f"{digits[:8]}T{digits[8:]}") if len(digits) == _DIGITS else None


@np.errstate(invalid="ignore")  # the remainder of an infinite stamp
def clock_of_digits(stamps: Signal) -> Signal | None:
    """Seconds since the first stamp, if the stamps are certain to be HHMMSS or YYYYMMDDHHMMSS; else
    None. [s]

    They are where no minute and no second reaches 60, no hour 24, every date exists, and the next
    minute begins one interval after the last stamp of each: read as plain seconds, that interval
    would be 40 s longer. NaN stays.

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
    interval = np.diff(since)
    over = interval[np.diff(whole // 100) != 0]
    usual = positive_median(interval)
    # Minutes end within the log, each a usual interval before the next one begins.
    if not (
        0 < usual < MINUTE_STEP_MAX
        and over.size
        and np.all(np.abs(over - usual) < MINUTE_STEP_SHARE * usual)
    ):
        return None
    seconds = np.full(stamps.size, np.nan)
    seconds[at] = since - since[0]
    return seconds


def _numbers(days: Signal) -> Signal | None:
    """Number each day, written YYYYMMDD; 0 for stamps without a date, None if one does not
    exist.
    """
    different, which = np.unique(days, return_inverse=True)
    if different.size == 1 and different[0] == 0:
        return days
    try:
        numbers = [
            date(int(d) // 10000, int(d) // 100 % 100, int(d) % 100).toordinal()
            for d in different.tolist()
        ]
    except (ValueError, OverflowError):
        return None
    return np.array(numbers, dtype=np.float64)[which]
