"""The clock of a log: stamps that cannot be read, repeat or run backward are repaired where that is safe; then the intervals.

Stamps as text are read in `cells`.
"""

from __future__ import annotations

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.run import Finding, FindingKind, Index, Mask, Signal

JITTER_SHARE = 0.1
"""Share of the usual interval from which a deviation counts as jitter."""

STAMP_MAX = 1e17
"""A stamp beyond this is no time: three thousand million years. [s]"""

CROWDED_RATIO = 1.5
"""Number of samples between two stamps, over the number that fits there, from which there are too many. [1]"""

LOST_RATIO = 1.5
"""An interval longer than this many usual ones has lost samples."""

WRONG_STAMPS_MAX = 5
"""A backward step that at most this many samples explain is their fault; otherwise the clock was set back."""

BACKWARD_STEPS_MAX = 1000
"""More backward steps than this and the stamps are no clock."""

UNEVEN_SHARE = 0.2
"""With more than this share of intervals off, the log is stamped unevenly, and only long intervals are gaps."""

SHARED_SHARE = 0.3
"""With more than this share of stamps that repeat, the clock counts in steps longer than the intervals. [1]"""

COARSE_RATE_SHARE = 0.01
"""Deviation of the mean interval from the usual one from which stamps are a coarse rounding of an even clock. [1]"""

_BLOCK = 1 << 18


RISE_MIN = 1e-150
"""The square of a shorter interval is no number: stamps of wrong bytes, which no clock makes. [s]"""

INTERVAL_MIN = 1e-9
"""No log is sampled more often. [s]"""

LOST_SAMPLES_MAX = 1e12
"""Samples that one gap may have lost; a gap that would hold more comes from a wrong stamp."""


class Clock(msgspec.Struct, frozen=True):
    """Stamps that rise [s], the rows they belong to (None: all, in order), gaps (k, 2) [s] and the sampling rate [Hz]."""

    t: Signal
    fs: float
    rows: Index | None = None
    gaps: Signal = msgspec.field(default_factory=lambda: np.empty((0, 2)))
    findings: tuple[Finding, ...] = ()


def _found(kind: FindingKind, message: str, action: str, at: Signal, count: int, removed: int = 0) -> Finding:
    """A finding on the clock, from the first to the last of some stamps [s]."""
    start, end = float(at[0]), float(at[-1])
    return Finding(kind, message, action, start=start, end=end, count=count, removed=removed)


def even_clock(n: int, step: float, start: float = 0.0) -> Clock:
    """Stamp n samples of a waveform that states its own increment. [s]"""
    return Clock(start + step * np.arange(n, dtype=np.float64), 1.0 / step)


def require_rising(t: Signal, where: str) -> None:
    """Reject stamps that floating-point numbers cannot distinguish, after a wrong stamp or a start aeons ago; LogError."""
    if t.size > 1 and not np.diff(t).min() > RISE_MIN:
        raise LogError(
            f"{where}: stamps from {t.min():.6g} to {t.max():.6g} s lie too far from zero to be distinguished; expected stamps "
            "that rise from row to row. Correct the wrong ones."
        )


def read_clock(stamps: Signal, where: str) -> Clock:
    """Check the stamps of a log and repair what can be repaired.

    Parameters
    ----------
    stamps : (n,) as logged, NaN where a stamp could not be read [s]

    Raises
    ------
    LogError : fewer than three stamps, stamps that do not move, or a clock that runs backward again and again
    """
    if _steady(stamps):
        return Clock(stamps, _rate((stamps[-1] - stamps[0]) / (stamps.size - 1)))
    findings: list[Finding] = []
    t, rows = with_all_stamps(stamps, findings, where)
    usual = _usual(np.diff(t), where)
    if np.any(np.diff(t) < 0):
        t, rows = forward(t, rows, usual, findings, where)
        usual = _usual(np.diff(t), where)
    if np.count_nonzero(np.diff(t) == 0) > SHARED_SHARE * t.size:
        t = spread(t, findings)
        usual = _usual(np.diff(t), where)
    even = evened(t, np.diff(t), usual)
    repeated = int(np.count_nonzero(np.diff(t) == 0))
    if even is not None and repeated:
        findings.append(_coarse(t, repeated, f"steps of {resolution(t, usual):g} s"))
        t = even
    elif repeated:
        t, rows = without_repeats(t, rows, usual, findings)
    if t.size < 3:
        raise LogError(f"{where}: {t.size} stamps are left that rise from row to row; expected at least three.")
    require_rising(t, where)
    gaps, fs = _intervals(t, rows, usual, findings) if even is None else (np.empty((0, 2)), _rate(even[1] - even[0]))
    in_order = rows.size == stamps.size and bool(np.all(rows[1:] > rows[:-1]))
    return Clock(t, fs, None if in_order else rows, gaps, tuple(findings))


def _usual(interval: Signal, where: str) -> float:
    """Usual interval of a clock that advances. [s]"""
    ahead = interval[interval > 0]
    usual = _median(ahead) if ahead.size else 0.0
    if usual < INTERVAL_MIN:
        raise LogError(
            f"{where}: the time column does not advance; expected stamps that rise from row to row. Name the right column "
            f"in a rig file under [columns]."
        )
    return usual


def _median(interval: Signal) -> float:
    """Usual interval; of a long log from a sample spread over it, which gives the same at no cost."""
    return median(interval[:: max(1, interval.size // 100_000)])


def _steady(stamps: Signal) -> bool:
    """Whether every interval is the usual one, as in most logs; block by block, so that a long log needs no more memory."""
    if stamps.size < 3:
        return False
    usual = _median(np.diff(stamps[:_BLOCK]))
    if not 0 < usual < np.inf:
        return False
    for start in range(0, stamps.size - 1, _BLOCK):
        interval = np.diff(stamps[start : start + _BLOCK + 1])
        if not (interval.min() > (1 - JITTER_SHARE) * usual and interval.max() < (1 + JITTER_SHARE) * usual):
            return False
    return True


def _intervals(t: Signal, rows: Index, usual: float, findings: list[Finding]) -> tuple[Signal, float]:
    """Find what was never logged and what jitters; (k, 2) gaps [s] and the rate [Hz]."""
    interval = np.diff(t)
    off = np.abs(interval - usual) > _tolerance(t, interval, usual)
    if not off.any():
        return np.empty((0, 2)), _rate(float(np.mean(interval)))
    long = interval > LOST_RATIO * usual
    whole = np.abs(interval / usual - np.rint(interval / usual)) < 2 * JITTER_SHARE
    jitters = off & ~(long & whole)
    if np.count_nonzero(jitters) > UNEVEN_SHARE * interval.size:
        long = interval > WRONG_STAMPS_MAX * usual
    at = np.flatnonzero(jitters & ~long)
    if at.size:
        least, most = interval[at].min(), interval[at].max()
        message = (
            f"{at.size} of {interval.size} intervals differ from the usual {usual:.4g} s by more than {JITTER_SHARE:.0%}, "
            f"between {least:.4g} and {most:.4g} s"
        )
        around = np.append(t[at], t[at[-1] + 1])
        findings.append(_found("clock_jitter", message, "used on their own stamps", around, int(at.size)))
    at = np.flatnonzero(long)
    gaps = np.column_stack((t[at], t[at + 1]))
    steps = np.rint(np.minimum(interval[at] / usual, LOST_SAMPLES_MAX)).astype(np.int64)
    unlogged = steps - 1 - np.maximum(rows[at + 1] - rows[at] - 1, 0)
    lost = unlogged > 0
    if lost.any():
        count, (begin, end) = int(unlogged[lost].sum()), gaps[lost].T
        k = int(np.argmax(end - begin))
        what = "1 sample was" if count == 1 else f"{count} samples were"
        message = (
            f"{what} never logged, in {begin.size} gap{'s' if begin.size > 1 else ''}; the longest lasts "
            f"{end[k] - begin[k]:.2f} s at {begin[k]:.2f} s"
        )
        around = np.append(begin, end[-1])
        findings.append(_found("dropped_samples", message, "bridged by straight lines", around, count, count))
    return gaps, _rate(usual if long.all() else float(np.mean(interval[~long])))


def _tolerance(t: Signal, interval: Signal, usual: float) -> float:
    """What an interval may be off; stamps rounded so coarsely that the rate does not fit them differ by their step. [s]"""
    near = interval[interval < LOST_RATIO * usual]
    if near.size == 0 or abs(float(np.mean(near)) - usual) <= COARSE_RATE_SHARE * usual:
        return JITTER_SHARE * usual
    return max(JITTER_SHARE * usual, 1.05 * resolution(t, usual))


def _rate(interval: float) -> float:
    """Sampling rate from the mean interval, to the digits that stamps carry. [Hz]"""
    return float(f"{1.0 / interval:.6g}")


def with_all_stamps(stamps: Signal, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Fill stamps that could not be read between their neighbours.

    Rows at the ends that have none are left out, and those between two stamps that are too close for so many samples: such
    rows are not of the log's rate, as the empty ones that a spreadsheet holds between two tables.
    """
    good = np.flatnonzero(np.abs(stamps) < STAMP_MAX)
    if good.size < 3:
        raise LogError(
            f"{where}: the time column holds {good.size} readable stamp{'' if good.size == 1 else 's'}; expected seconds, "
            f"milliseconds or dates with times, at least three."
        )
    if good.size == stamps.size:
        return stamps, np.arange(stamps.size)
    rows = np.arange(good[0], good[-1] + 1)
    t = np.interp(rows, good, stamps[good])
    kept = ~_crowded(stamps, good)
    lost, outside, crowded = stamps.size - good.size, stamps.size - rows.size, int(np.count_nonzero(~kept))
    at = t[np.isin(rows, good, invert=True)]
    at = at if at.size else t
    done = ["filled between their neighbours"] if lost > outside + crowded else []
    done += [f"{outside} rows at the ends left out"] if outside else []
    done += [f"{crowded} rows between stamps that leave no room for them left out"] if crowded else []
    message = f"{lost} stamps could not be read"
    findings.append(_found("not_a_number", message, "; ".join(done), at, lost, outside + crowded))
    return t[kept], rows[kept]


def _crowded(stamps: Signal, good: Index) -> Mask:
    """Rows from the first stamp to the last whose neighbours' stamps leave no room for them at the usual interval."""
    between, apart = np.diff(good), np.diff(stamps[good])
    usual = median(apart[between == 1]) if np.any(between == 1) else 0.0
    crowded = np.append(np.repeat((between * usual > CROWDED_RATIO * apart) & (apart >= 0), between), False)
    crowded[good - good[0]] = False
    return crowded


def evened(t: Signal, interval: Signal, usual: float) -> Signal | None:
    """Even stamps that the log's own are a rounding of, as 75 Hz in steps of 0.01 s; None where rows are missing. [s]"""
    step = resolution(t, usual)
    coarse = 0 < step < 1.01 * usual and abs(float(np.mean(interval)) - usual) >= COARSE_RATE_SHARE * usual
    if not coarse or np.count_nonzero(np.abs(interval - usual) > JITTER_SHARE * usual) < WRONG_STAMPS_MAX:
        return None
    place = np.arange(t.size) - 0.5 * (t.size - 1)
    dt = float(place @ (t - t[0])) / float(place @ place)
    even: Signal = np.multiply(place, dt, dtype=np.float64) + float(np.mean(t))
    return even if float(np.ptp(t - even)) < 1.1 * step else None


def spread(t: Signal, findings: list[Finding]) -> Signal:
    """Spread samples that share a stamp of a coarse clock evenly up to the next stamp."""
    first = np.flatnonzero(np.diff(t, prepend=-np.inf) != 0)
    count = np.diff(first, append=t.size)
    step = np.diff(t[first])
    usual_step, usual_count = median(step), median((count[1:-1] if count.size > 2 else count).astype(np.float64))
    if step.size > 2 and np.all(np.abs(step - usual_step) < 1e-6 * max(usual_step, 1e-9)):
        # The first stamp may stand for a part of its samples.
        begin, end = first[1], first[-1]
        spread: Signal = t[begin] + (t[end] - t[begin]) / (end - begin) * (np.arange(t.size) - begin)
    else:
        width = np.append(step, usual_step)
        each = np.where(np.arange(count.size) == count.size - 1, np.maximum(count, usual_count), count)
        group = np.repeat(np.arange(first.size), count)
        spread = t[first][group] + (np.arange(t.size) - first[group]) * width[group] / each[group]
    findings.append(_coarse(t, t.size - first.size, f"steps of {usual_step:g} s with {usual_count:g} samples each"))
    return spread


def _coarse(t: Signal, repeated: int, counts: str) -> Finding:
    """Finding for a clock that counts in steps longer than the intervals between samples."""
    message = (
        f"{repeated} stamp{'s repeat' if repeated > 1 else ' repeats'} the one before: the clock counts in {counts}"
    )
    return _found("repeated_stamp", message, "samples spread evenly", t, repeated)


def forward(t: Signal, rows: Index, usual: float, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Put right each backward step: rows in the wrong order, single wrong stamps, or a clock that was set back."""
    t = t.copy()
    steps, removed, done = 0, 0, set()
    start = end = float(t[int(np.argmax(np.diff(t) < 0))])
    while (back := np.flatnonzero(np.diff(t) < 0)).size:
        steps += 1
        if steps > BACKWARD_STEPS_MAX:
            raise LogError(
                f"{where}: the time column runs backward at more than {BACKWARD_STEPS_MAX} places; expected stamps that rise "
                "from row to row. Name the right column in a rig file under [columns]."
            )
        end = float(t[back[0]])
        t, rows, action, lost = _put_right(t, rows, int(back[0]) + 1, usual)
        removed += lost
        done.add(action)
    message = f"the clock steps back at {steps} place{'s' if steps > 1 else ''}"
    findings.append(
        _found("backward_stamp", message, " and ".join(sorted(done)), np.array([start, end]), steps, removed)
    )
    return t, rows


def _put_right(t: Signal, rows: Index, k: int, usual: float) -> tuple[Signal, Index, str, int]:
    """Repair the backward step from sample k - 1 to k; also what was done and how many samples that cost."""
    ahead = int(np.searchsorted(t[:k], t[k], side="left"))
    later = np.flatnonzero(t[k:] > t[k - 1])
    behind = k + int(later[0]) if later.size else t.size
    early, late = k - ahead, behind - k
    if min(early, late) > WRONG_STAMPS_MAX:
        t[k:] += t[k - 1] + usual - t[k]
        return t, rows, "later stamps moved forward to follow on", 0
    order = ahead + np.argsort(t[ahead:behind], kind="stable")
    steps = np.diff(np.concatenate((t[ahead - 1 : ahead], t[order], t[behind : behind + 1])))
    if (
        early <= WRONG_STAMPS_MAX
        and late <= WRONG_STAMPS_MAX
        and np.all((steps > 0.5 * usual) & (steps < LOST_RATIO * usual))
    ):
        t[ahead:behind] = t[order]
        rows = rows.copy()
        rows[ahead:behind] = rows[order]
        return t, rows, "rows put in the order of their stamps", 0
    wrong = np.arange(ahead, k) if early <= late else np.arange(k, behind)
    return np.delete(t, wrong), np.delete(rows, wrong), "samples with a wrong stamp left out", wrong.size


def without_repeats(t: Signal, rows: Index, usual: float, findings: list[Finding]) -> tuple[Signal, Index]:
    """Leave out samples that repeat a stamp; one followed by a double interval gets the stamp that is missing there."""
    again = np.flatnonzero(np.diff(t) == 0) + 1
    inner = again[again < t.size - 1]
    missing = inner[np.abs(t[inner + 1] - t[inner] - 2 * usual) < 0.5 * usual]
    mended = t.copy()
    mended[missing] = 0.5 * (t[missing] + t[missing + 1])
    left_out = np.setdiff1d(again, missing)
    done = [f"{left_out.size} left out"] if left_out.size else []
    done += [f"{missing.size} given the stamp that was missing"] if missing.size else []
    message = f"{again.size} sample{'s repeat' if again.size > 1 else ' repeats'} the stamp before"
    findings.append(_found("repeated_stamp", message, ", ".join(done), t[again], int(again.size), int(left_out.size)))
    return np.delete(mended, left_out), np.delete(rows, left_out)


def resolution(t: Signal, usual: float) -> float:
    """Step in which the stamps count, found on a sample of them; 0 if they are finer than a millionth of a second. [s]"""
    some = t[:2000] - t[0]
    for digits in range(7):
        scaled = some * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-3 * max(1.0, usual * 10.0**digits)):
            return float(10.0**-digits)
    return 0.0
