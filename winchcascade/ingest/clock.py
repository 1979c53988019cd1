"""The clock of a log: stamps that repeat, run backward, jitter or skip are found, and put right where that is safe."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.errors import LogError
from winchcascade.order import median
from winchcascade.run import Finding

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Signal

    Index = NDArray[np.intp]

LOST = 1.5
"""An interval longer than this many usual ones has lost samples."""

JITTER = 0.1
"""An interval that is off by more than this share of the usual one jitters."""

UNEVEN = 0.2
"""With more than this share of intervals off, the log is stamped unevenly, and only long intervals are gaps."""

GLITCH = 5
"""A backward step that at most this many samples explain is their fault; otherwise the clock was set back."""

_BLOCK = 1 << 18

MANY = 1000
"""More backward steps than this and the stamps are no clock."""


SHORTEST = 1e-9
"""No log is sampled more often. [s]"""

LATEST = 1e17
"""A stamp beyond this is no time: three thousand million years. [s]"""

MOST = 1e12
"""Samples that one gap may have lost; a gap that would hold more comes from a wrong stamp."""


class Clock(msgspec.Struct, frozen=True):
    """Stamps that rise [s], the rows they belong to (None: all, in order), gaps (k, 2) [s] and the sampling rate [Hz]."""

    t: Signal
    rows: Index | None
    gaps: Signal
    fs: float
    findings: tuple[Finding, ...]


def even_clock(n: int, step: float, start: float = 0.0) -> Clock:
    """Stamp n samples of a waveform that states its own increment. [s]"""
    return Clock(start + step * np.arange(n, dtype=np.float64), None, np.empty((0, 2)), 1.0 / step, ())


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
        return Clock(stamps, None, np.empty((0, 2)), _rate((stamps[-1] - stamps[0]) / (stamps.size - 1)), ())
    findings: list[Finding] = []
    t, rows = _with_all_stamps(stamps, findings, where)
    usual = _usual(np.diff(t), where)
    if np.count_nonzero(np.diff(t) == 0) > 0.3 * t.size:
        t = _spread(t, findings)
        usual = _usual(np.diff(t), where)
    even = _even(t, np.diff(t), usual)
    if even is not None:
        t = _counted(t, even, _resolution(t, usual), findings)
        return Clock(t, _kept(rows, stamps.size), np.empty((0, 2)), _rate(even[1] - even[0]), tuple(findings))
    if np.any(np.diff(t) < 0):
        t, rows = _forward(t, rows, usual, findings, where)
    if np.any(np.diff(t) == 0):
        t, rows = _without_repeats(t, rows, usual, findings)
    if t.size < 3:
        raise LogError(f"{where}: {t.size} stamps are left that rise from row to row; expected at least three.")
    gaps, fs = _intervals(t, rows, usual, findings)
    return Clock(t, _kept(rows, stamps.size), gaps, fs, tuple(findings))


def _usual(interval: Signal, where: str) -> float:
    """Usual interval of a clock that advances. [s]"""
    ahead = interval[interval > 0]
    usual = _median(ahead) if ahead.size else 0.0
    if usual < SHORTEST:
        raise LogError(
            f"{where}: the time column does not advance; expected stamps that rise from row to row. Name the right column "
            f"in a rig file under [columns]."
        )
    return usual


def _kept(rows: Index, n: int) -> Index | None:
    """Rows that the stamps belong to; None for all of them in their order."""
    return None if rows.size == n and bool(np.all(rows[1:] > rows[:-1])) else rows


def _median(interval: Signal) -> float:
    """Usual interval; of a long log from a sample spread over it, which says the same at no cost."""
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
        if not (interval.min() > (1 - JITTER) * usual and interval.max() < (1 + JITTER) * usual):
            return False
    return True


def _with_all_stamps(stamps: Signal, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Fill stamps that could not be read between their neighbours; leave out rows at the ends that have none."""
    good = np.flatnonzero(np.abs(stamps) < LATEST)
    if good.size < 3:
        raise LogError(
            f"{where}: the time column holds {good.size} readable stamp{'' if good.size == 1 else 's'}; expected seconds, "
            f"milliseconds or dates with times, at least three."
        )
    if good.size == stamps.size:
        return stamps, np.arange(stamps.size)
    rows = np.arange(good[0], good[-1] + 1)
    t = np.interp(rows, good, stamps[good])
    lost = stamps.size - good.size
    outside = stamps.size - rows.size
    at = t[np.isin(rows, good, invert=True)]
    findings.append(
        Finding(
            "not_a_number",
            f"{lost} stamps could not be read",
            "filled between their neighbours" + (f"; {outside} rows at the ends left out" if outside else ""),
            start=float(at[0]) if at.size else float(t[0]),
            end=float(at[-1]) if at.size else float(t[-1]),
            count=lost,
            removed=outside,
        )
    )
    return t, rows


def _even(t: Signal, interval: Signal, usual: float) -> Signal | None:
    """Even stamps that the log's own are a rounding of, as 75 Hz in steps of 0.01 s; None where rows are missing. [s]"""
    off = np.count_nonzero(np.abs(interval - usual) > JITTER * usual)
    if off < GLITCH or abs(float(np.mean(interval)) - usual) < 0.01 * usual:
        return None
    step = _resolution(t, usual)
    if not 0 < step < 1.01 * usual:
        return None
    place = np.arange(t.size) - 0.5 * (t.size - 1)
    dt = float(place @ (t - t[0])) / float(place @ place)
    even: Signal = np.multiply(place, dt, dtype=np.float64) + float(np.mean(t))
    return even if float(np.ptp(t - even)) < 1.1 * step else None


def _counted(t: Signal, even: Signal, step: float, findings: list[Finding]) -> Signal:
    """The stamps as they are if all differ, else the even ones that they are a rounding of."""
    repeated = int(np.count_nonzero(np.diff(t) == 0))
    if repeated == 0:
        return t
    findings.append(
        Finding(
            "repeated_stamp",
            f"{repeated} stamp{'s repeat' if repeated > 1 else ' repeats'} the one before: the clock counts in steps of "
            f"{step:g} s",
            "samples spread evenly",
            start=float(t[0]),
            end=float(t[-1]),
            count=repeated,
        )
    )
    return even


def _spread(t: Signal, findings: list[Finding]) -> Signal:
    """Spread samples that share a stamp of a coarse clock evenly up to the next stamp."""
    first = np.flatnonzero(np.diff(t, prepend=-np.inf) != 0)
    count = np.diff(first, append=t.size)
    step = np.diff(t[first])
    usual_step, usual_count = median(step), median((count[1:-1] if count.size > 2 else count).astype(np.float64))
    if step.size > 2 and np.all(np.abs(step - usual_step) < 1e-6 * max(usual_step, 1e-9)):
        whole = slice(1, None)  # the first stamp may stand for a part of its samples
        dt = (t[first[whole]][-1] - t[first[1]]) / (first[-1] - first[1])
        spread: Signal = t[first[1]] + dt * (np.arange(t.size) - first[1])
    else:
        width = np.append(step, usual_step)
        each = np.where(np.arange(count.size) == count.size - 1, np.maximum(count, usual_count), count)
        group = np.repeat(np.arange(first.size), count)
        spread = t[first][group] + (np.arange(t.size) - first[group]) * width[group] / each[group]
    repeated = t.size - first.size
    findings.append(
        Finding(
            "repeated_stamp",
            f"{repeated} stamps repeat the one before: the clock counts in steps of {usual_step:g} s with {usual_count:g} "
            f"samples each",
            "samples spread evenly over each step",
            start=float(t[0]),
            end=float(t[-1]),
            count=repeated,
        )
    )
    return spread


def _forward(t: Signal, rows: Index, usual: float, findings: list[Finding], where: str) -> tuple[Signal, Index]:
    """Put right each backward step: rows in the wrong order, single wrong stamps, or a clock that was set back."""
    t = t.copy()
    steps, removed, done = 0, 0, set()
    start = end = float(t[int(np.argmax(np.diff(t) < 0))])
    while True:
        back = np.flatnonzero(np.diff(t) < 0)
        if back.size == 0:
            break
        steps += 1
        if steps > MANY:
            raise LogError(
                f"{where}: the time column runs backward at more than {MANY} places; expected stamps that rise from row "
                f"to row. Name the right column in a rig file under [columns]."
            )
        k = int(back[0]) + 1
        end = float(t[k - 1])
        t, rows, action, lost = _put_right(t, rows, k, usual)
        removed += lost
        done.add(action)
    findings.append(
        Finding(
            "backward_stamp",
            f"the clock steps back at {steps} place{'s' if steps > 1 else ''}",
            " and ".join(sorted(done)),
            start=start,
            end=end,
            count=steps,
            removed=removed,
        )
    )
    return t, rows


def _put_right(t: Signal, rows: Index, k: int, usual: float) -> tuple[Signal, Index, str, int]:
    """Repair the backward step from sample k - 1 to k; tell what was done and how many samples that cost."""
    ahead = int(np.searchsorted(t[:k], t[k], side="left"))
    later = np.flatnonzero(t[k:] > t[k - 1])
    behind = k + int(later[0]) if later.size else t.size
    early, late = k - ahead, behind - k
    if min(early, late) > GLITCH:
        shift = t[k - 1] + usual - t[k]
        t[k:] += shift
        return t, rows, "later stamps moved forward to follow on", 0
    order = ahead + np.argsort(t[ahead:behind], kind="stable")
    around = np.concatenate((t[ahead - 1 : ahead], t[order], t[behind : behind + 1]))
    steps = np.diff(around)
    if early <= GLITCH and late <= GLITCH and np.all((steps > 0.5 * usual) & (steps < LOST * usual)):
        t[ahead:behind] = t[order]
        rows = rows.copy()
        rows[ahead:behind] = rows[order]
        return t, rows, "rows put in the order of their stamps", 0
    wrong = np.arange(ahead, k) if early <= late else np.arange(k, behind)
    return np.delete(t, wrong), np.delete(rows, wrong), "samples with a wrong stamp left out", wrong.size


def _without_repeats(t: Signal, rows: Index, usual: float, findings: list[Finding]) -> tuple[Signal, Index]:
    """Leave out samples that repeat a stamp; one followed by a double interval gets the stamp that is missing there."""
    again = np.flatnonzero(np.diff(t) == 0) + 1
    start, end = float(t[again[0]]), float(t[again[-1]])
    inner = again[again < t.size - 1]
    missing = inner[np.abs(t[inner + 1] - t[inner] - 2 * usual) < 0.5 * usual]
    t = t.copy()
    t[missing] = 0.5 * (t[missing] + t[missing + 1])
    left_out = np.setdiff1d(again, missing)
    done = [f"{left_out.size} left out"] if left_out.size else []
    done += [f"{missing.size} given the stamp that was missing"] if missing.size else []
    findings.append(
        Finding(
            "repeated_stamp",
            f"{again.size} sample{'s repeat' if again.size > 1 else ' repeats'} the stamp before",
            ", ".join(done),
            start=start,
            end=end,
            count=int(again.size),
            removed=int(left_out.size),
        )
    )
    return np.delete(t, left_out), np.delete(rows, left_out)


def _intervals(t: Signal, rows: Index, usual: float, findings: list[Finding]) -> tuple[Signal, float]:
    """Find what was never logged and what jitters; (k, 2) gaps [s] and the rate [Hz]."""
    interval = np.diff(t)
    off = np.abs(interval - usual) > _tolerance(t, interval, usual)
    if not off.any():
        return np.empty((0, 2)), _rate(float(np.mean(interval)))
    long = interval > LOST * usual
    whole = np.abs(interval / usual - np.rint(interval / usual)) < 2 * JITTER
    jitters = off & ~(long & whole)
    uneven = np.count_nonzero(jitters) > UNEVEN * interval.size
    if uneven:
        long = interval > GLITCH * usual
    jitters &= ~long
    count = np.count_nonzero(jitters)
    if count:
        findings.append(_jitter(t, interval, jitters, usual))
    at = np.flatnonzero(long)
    gaps = np.column_stack((t[at], t[at + 1]))
    steps = np.rint(np.minimum(interval[at] / usual, MOST)).astype(np.int64)
    unlogged = steps - 1 - np.maximum(rows[at + 1] - rows[at] - 1, 0)
    lost = unlogged > 0
    if lost.any():
        findings.append(_dropped(gaps[lost], int(unlogged[lost].sum())))
    return gaps, _rate(usual if long.all() else float(np.mean(interval[~long])))


def _tolerance(t: Signal, interval: Signal, usual: float) -> float:
    """What an interval may be off; stamps rounded so coarsely that the rate does not fit them differ by their step. [s]"""
    near = interval[interval < LOST * usual]
    mean = float(np.mean(near)) if near.size else usual
    rounded = abs(mean - usual) > 0.01 * usual
    return max(JITTER * usual, 1.05 * _resolution(t, usual)) if rounded else JITTER * usual


def _rate(interval: float) -> float:
    """Sampling rate from the mean interval, to the digits that stamps carry. [Hz]"""
    return float(f"{1.0 / float(interval):.6g}")


def _resolution(t: Signal, usual: float) -> float:
    """Step in which the stamps count, found on a sample of them; 0 if they are finer than a millionth of a second. [s]"""
    some = t[:2000] - t[0]
    for digits in range(7):
        scaled = some * 10.0**digits
        if np.all(np.abs(scaled - np.rint(scaled)) < 1e-3 * max(1.0, usual * 10.0**digits)):
            return float(10.0**-digits)
    return 0.0


def _jitter(t: Signal, interval: Signal, jitters: NDArray[np.bool_], usual: float) -> Finding:
    at = np.flatnonzero(jitters)
    return Finding(
        "clock_jitter",
        f"{at.size} of {interval.size} intervals differ from the usual {usual:.4g} s by more than {JITTER:.0%}, between "
        f"{interval[at].min():.4g} and {interval[at].max():.4g} s",
        "used on their own stamps",
        start=float(t[at[0]]),
        end=float(t[at[-1] + 1]),
        count=int(at.size),
    )


def _dropped(gaps: Signal, lost: int) -> Finding:
    longest = gaps[int(np.argmax(gaps[:, 1] - gaps[:, 0]))]
    return Finding(
        "dropped_samples",
        f"{lost} samples were never logged, in {len(gaps)} gap{'s' if len(gaps) > 1 else ''}; the longest lasts "
        f"{longest[1] - longest[0]:.2f} s at {longest[0]:.2f} s",
        "bridged by straight lines",
        start=float(gaps[0, 0]),
        end=float(gaps[-1, 1]),
        count=lost,
        removed=lost,
    )
