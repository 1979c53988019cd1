"""The clock of a log: stamps that cannot be read, repeat or run backward are repaired where that is
safe; then the intervals.

Stamps as text are read in `cells`.
"""

from __future__ import annotations

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import BLOCK, median, usual_interval
from winchcascade.core.run import Finding, FindingKind, Index, Signal

JITTER_SHARE = 0.1
"""Share of the usual interval from which a deviation counts as jitter. [1]"""

STAMP_MAX = 1e17
"""A stamp beyond this is no time: three thousand million years. [s]"""

LOST_RATIO = 1.5
"""An interval longer than this many usual ones has lost samples; one with so many times those
that fit has too many. [1]
"""

WRONG_STAMPS_MAX = 5
"""A backward step that at most this many samples explain is their fault; otherwise the clock was
set back. [1]
"""

BACKWARD_STEPS_MAX = 1000
"""More backward steps than this and the stamps are no clock. [1]"""

UNEVEN_SHARE = 0.2
"""With more than this share of intervals that deviate, the log is stamped unevenly, and only long
ones are gaps; with more stamps that repeat, the clock counts in steps longer than the intervals.
[1]"""

COARSE_RATE_SHARE = 0.01
"""Deviation of the mean interval from the usual one from which stamps are a coarse rounding of
an even clock. [1]
"""

RISE_MIN = 1e-150
"""The square of a shorter interval is no number: stamps of wrong bytes, which no clock makes.
[s]
"""

INTERVAL_MIN = 1e-9
"""No log is sampled more often. [s]"""

LOST_SAMPLES_MAX = 1e12
"""Samples that one gap may have lost; a gap that would hold more comes from a wrong stamp. [1]"""


class Clock(msgspec.Struct, frozen=True):
    """Stamps that rise [s], the rows they belong to (None: all, in order), gaps (k, 2) [s] and
    the sampling rate [Hz].
    """

    t: Signal
    fs: float
    rows: Index | None = None
    gaps: Signal = msgspec.field(default_factory=lambda: np.empty((0, 2)))
    findings: tuple[Finding, ...] = ()


class _Stamps(msgspec.Struct):
    """Stamps while they are repaired [s], the rows they belong to, what was found, and the place
    of the log in words.
    """

    t: Signal
    rows: Index
    where: str
    findings: list[Finding] = []

    @property
    def usual(self) -> float:
        """Usual interval of a clock that advances. [s]"""
        ahead = np.diff(self.t)
        ahead = ahead[ahead > 0]
        usual = _usual(ahead) if ahead.size else 0.0
        if usual < INTERVAL_MIN:
            raise LogError(
                f"{self.where}: the time column does not advance; expected stamps that rise from "
                f"row to row. Name the right "
                "column in a rig file under [columns]."
            )
        return usual

    def keep(self, chosen: Index) -> None:
        """Keep some samples, in the order given."""
        self.t, self.rows = self.t[chosen], self.rows[chosen]

    def report(
        self, kind: FindingKind, message: str, action: str, at: Signal, count: int, removed: int = 0
    ) -> None:
        """Report a finding, from the first to the last of some stamps [s]."""
        start, end = float(at[0]), float(at[-1])
        self.findings.append(
            Finding(kind, message, action, start=start, end=end, count=count, removed=removed)
        )


def even_clock(n: int, step: float, start: float = 0.0) -> Clock:
    """Stamp n samples of a waveform that states its own increment. [s]"""
    return Clock(start + step * np.arange(n, dtype=np.float64), 1.0 / step)


def require_rising(t: Signal, where: str) -> None:
    """Reject stamps that floating-point numbers cannot distinguish, after a wrong stamp or a
    start aeons ago; LogError.
    """
    if t.size > 1 and not np.diff(t).min() > RISE_MIN:
        raise LogError(
            f"{where}: stamps from {t.min():.6g} to {t.max():.6g} s lie too far from zero to be "
            f"distinguished; expected stamps "
            "that rise from row to row. Correct the wrong ones."
        )


def read_clock(stamps: Signal, where: str) -> Clock:
    """Check the stamps of a log and repair what can be repaired.

    Parameters
    ----------
    stamps : (n,) as logged, NaN where a stamp could not be read [s]

    Raises
    ------
    LogError : fewer than three stamps, stamps that do not move, or a clock that runs backward again
        and again
    """
    if _steady(stamps):
        return Clock(stamps, _rate((stamps[-1] - stamps[0]) / (stamps.size - 1)))
    log = _Stamps(stamps, np.arange(stamps.size), where)
    _fill(log)
    _put_forward(log)
    even = _spread(log)
    if log.t.size < 3:
        raise LogError(
            f"{where}: {log.t.size} stamps are left that rise from row to row; expected at least "
            f"three."
        )
    require_rising(log.t, where)
    gaps, fs = _intervals(log) if even is None else (np.empty((0, 2)), _rate(even))
    in_order = log.rows.size == stamps.size and bool(np.all(log.rows[1:] > log.rows[:-1]))
    return Clock(log.t, fs, None if in_order else log.rows, gaps, tuple(log.findings))


def _usual(interval: Signal) -> float:
    """Usual interval; of a long log from a sample spread over it, which gives the same at no
    cost.
    """
    return median(interval[:: max(1, interval.size // BLOCK)])


def _steady(stamps: Signal) -> bool:
    """Whether every interval is the usual one, as in most logs; block by block, so that a long
    log needs no more memory.
    """
    usual = usual_interval(stamps) if stamps.size >= 3 else 0.0
    low, high = (1 - JITTER_SHARE) * usual, (1 + JITTER_SHARE) * usual
    parts = (
        np.diff(stamps[start : start + BLOCK + 1]) for start in range(0, stamps.size - 1, BLOCK)
    )
    return 0 < usual < np.inf and all(part.min() > low and part.max() < high for part in parts)


def _rate(interval: float) -> float:
    """Sampling rate from the mean interval, to the digits that stamps carry. [Hz]"""
    return float(f"{1.0 / interval:.6g}")


def _fill(log: _Stamps) -> None:
    """Fill stamps that could not be read between their neighbours.

    Rows at the ends that have none are left out, and those between two stamps that leave no time
    for so many samples, as the empty ones that a spreadsheet holds between two tables.
    """
    good, n = np.flatnonzero(np.abs(log.t) < STAMP_MAX), log.t.size
    if good.size < 3:
        raise LogError(
            f"{log.where}: the time column holds {good.size} readable "
            f"stamp{'' if good.size == 1 else 's'}; expected seconds, "
            f"milliseconds or dates with times, at least three."
        )
    if good.size == n:
        return
    between, apart = np.diff(good), np.diff(log.t[good])
    usual = median(apart[between == 1]) if np.any(between == 1) else 0.0
    crowded = np.append(
        np.repeat((between * usual > LOST_RATIO * apart) & (apart >= 0), between), False
    )
    crowded[good - good[0]] = False
    rows = np.arange(good[0], good[-1] + 1)[~crowded]
    log.t = np.interp(np.arange(n), good, log.t[good])
    lost, filled = (
        log.t[np.isin(rows, good, invert=True).nonzero()[0] + good[0]],
        rows.size - good.size,
    )
    log.keep(rows)
    done = [f"{filled} filled between their neighbours"] if filled else []
    done += (
        [f"{n - rows.size} rows left out for which the stamps beside them leave no time"]
        if rows.size < n
        else []
    )
    message = f"{n - good.size} stamps could not be read"
    log.report(
        "not_a_number",
        message,
        "; ".join(done),
        lost if lost.size else log.t,
        n - good.size,
        n - rows.size,
    )


def _put_forward(log: _Stamps) -> None:
    """Put right each backward step: rows in the wrong order, single wrong stamps, or a clock
    that was set back.
    """
    steps, before, done, ends = 0, log.t.size, set(), []
    usual = log.usual
    while (back := np.flatnonzero(np.diff(log.t) < 0)).size:
        steps += 1
        if steps > BACKWARD_STEPS_MAX:
            raise LogError(
                f"{log.where}: the time column runs backward at more than {BACKWARD_STEPS_MAX} "
                f"places; expected stamps that "
                "rise from row to row. Name the right column in a rig file under [columns]."
            )
        ends.append(float(log.t[back[0]]))
        done.add(_put_right(log, int(back[0]) + 1, usual))
    if steps:
        message = f"the clock steps back at {steps} place{'s' if steps > 1 else ''}"
        log.report(
            "backward_stamp",
            message,
            " and ".join(sorted(done)),
            np.array(ends),
            steps,
            before - log.t.size,
        )


def _put_right(log: _Stamps, k: int, usual: float) -> str:
    """Repair the backward step from sample k - 1 to k; what was done."""
    t = log.t
    ahead = int(np.searchsorted(t[:k], t[k], side="left"))
    later = np.flatnonzero(t[k:] > t[k - 1])
    behind = k + int(later[0]) if later.size else t.size
    early, late = k - ahead, behind - k
    if min(early, late) > WRONG_STAMPS_MAX:
        log.t = np.append(t[:k], t[k:] + (t[k - 1] + usual - t[k]))
        return "later stamps moved forward to follow on"
    order = np.arange(t.size)
    order[ahead:behind] = ahead + np.argsort(t[ahead:behind], kind="stable")
    steps = np.diff(t[order[max(ahead - 1, 0) : behind + 1]])
    even = np.all((steps > 0.5 * usual) & (steps < LOST_RATIO * usual))
    if max(early, late) <= WRONG_STAMPS_MAX and even:
        log.keep(order)
        return "rows put in the order of their stamps"
    log.keep(np.delete(np.arange(t.size), slice(ahead, k) if early <= late else slice(k, behind)))
    return "samples with a wrong stamp left out"


def _spread(log: _Stamps) -> float | None:
    """Spread samples whose stamps repeat or are a coarse rounding of an even clock, as 75 Hz in
    steps of 0.01 s.

    Returns
    -------
    Interval of the even stamps that the log gets; None where it keeps its own. [s]
    """
    t, usual = log.t, log.usual
    first = np.flatnonzero(np.diff(t, prepend=-np.inf) != 0)
    repeated = t.size - first.size
    shared = repeated > UNEVEN_SHARE * t.size
    step = usual if shared else _resolution(t, usual)
    interval = np.diff(t)
    place = np.arange(t.size) - 0.5 * (t.size - 1)
    dt = float(place @ (t - t[0])) / float(place @ place)
    even: Signal = np.multiply(place, dt, dtype=np.float64) + float(np.mean(t))
    coarse = (
        0 < step < 1.01 * usual
        and abs(float(np.mean(interval)) - usual) >= COARSE_RATE_SHARE * usual
    )
    many = np.count_nonzero(np.abs(interval - usual) > JITTER_SHARE * usual) >= WRONG_STAMPS_MAX
    if coarse and many and float(np.ptp(t - even)) < 1.1 * step:
        log.t = even
    elif shared:
        count = np.diff(first, append=t.size)
        each = count.copy()
        each[[0, -1]] = np.maximum(count[[0, -1]], int(median(count.astype(np.float64))))
        group = np.repeat(np.arange(first.size), count)
        begun = np.where(
            group == 0, each[0] - count[0], 0
        )  # the first stamp may stand for a part of its samples
        width = np.append(np.diff(t[first]), usual)
        log.t = (
            t[first][group]
            + (np.arange(t.size) - first[group] + begun) * width[group] / each[group]
        )
    elif repeated:
        _without_repeats(log, usual)
    if repeated and (log.t is even or shared):
        what = f"{repeated} stamp{'s repeat' if repeated > 1 else ' repeats'} the one before"
        message = f"{what}: the clock counts in steps of {step:g} s"
        log.report("repeated_stamp", message, "samples spread evenly", t, repeated)
    return dt if log.t is even else None


def _without_repeats(log: _Stamps, usual: float) -> None:
    """Leave out samples that repeat a stamp; one followed by a double interval gets the stamp
    that is missing there.
    """
    t = log.t.copy()
    again = np.flatnonzero(np.diff(t) == 0) + 1
    inner = again[again < t.size - 1]
    missing = inner[np.abs(t[inner + 1] - t[inner] - 2 * usual) < 0.5 * usual]
    left_out = np.setdiff1d(again, missing)
    done = [f"{left_out.size} left out"] if left_out.size else []
    done += [f"{missing.size} given the stamp that was missing"] if missing.size else []
    message = f"{again.size} sample{'s repeat' if again.size > 1 else ' repeats'} the stamp before"
    log.report(
        "repeated_stamp", message, ", ".join(done), t[again], int(again.size), int(left_out.size)
    )
    t[missing] = 0.5 * (t[missing] + t[missing + 1])
    log.t = t
    log.keep(np.delete(np.arange(t.size), left_out))


def _intervals(log: _Stamps) -> tuple[Signal, float]:
    """Find what was never logged and what jitters; (k, 2) gaps [s] and the rate [Hz]."""
    t, usual = log.t, log.usual
    interval = np.diff(t)
    near = interval[interval < LOST_RATIO * usual]
    tolerance = JITTER_SHARE * usual
    if (
        near.size and abs(float(np.mean(near)) - usual) > COARSE_RATE_SHARE * usual
    ):  # rounded: they differ by its step
        tolerance = max(tolerance, 1.05 * _resolution(t, usual))
    off = np.abs(interval - usual) > tolerance
    if not off.any():
        return np.empty((0, 2)), _rate(float(np.mean(interval)))
    long = interval > LOST_RATIO * usual
    whole = np.abs(interval / usual - np.rint(interval / usual)) < 2 * JITTER_SHARE
    jitters = off & ~(long & whole)
    if np.count_nonzero(jitters) > UNEVEN_SHARE * interval.size:
        long = interval > WRONG_STAMPS_MAX * usual
    at = np.flatnonzero(jitters & ~long)
    if at.size:
        message = (
            f"{at.size} of {interval.size} intervals differ from the usual {usual:.4g} s by more "
            f"than {JITTER_SHARE:.0%}, "
            f"between {interval[at].min():.4g} and {interval[at].max():.4g} s"
        )
        log.report(
            "clock_jitter",
            message,
            "used on their own stamps",
            t[np.append(at, at[-1] + 1)],
            int(at.size),
        )
    at = np.flatnonzero(long)
    steps = np.rint(np.minimum(interval[at] / usual, LOST_SAMPLES_MAX)).astype(np.int64)
    unlogged = steps - 1 - np.maximum(log.rows[at + 1] - log.rows[at] - 1, 0)
    lost = at[unlogged > 0]
    if lost.size:
        count, longest = int(unlogged[unlogged > 0].sum()), int(lost[np.argmax(interval[lost])])
        message = (
            f"{count} sample{' was' if count == 1 else 's were'} never logged, in {lost.size} "
            f"gap{'s' * (lost.size > 1)}; the "
            f"longest lasts {interval[longest]:.2f} s at {t[longest]:.2f} s"
        )
        log.report(
            "dropped_samples",
            message,
            "bridged by straight lines",
            t[[lost[0], lost[-1] + 1]],
            count,
            count,
        )
    return np.column_stack((t[at], t[at + 1])), _rate(
        usual if long.all() else float(np.mean(interval[~long]))
    )


def _resolution(t: Signal, usual: float) -> float:
    """Step in which the stamps count, found on a sample of them; 0 if they are finer than a
    millionth of a second. [s]
    """
    some = t[:2000] - t[0]
    for digits in range(7):
        scaled = some * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-3 * max(1.0, usual * 10.0**digits)):
            return float(10.0**-digits)
    return 0.0
