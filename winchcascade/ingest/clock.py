"""The clock of a log: what its intervals say, after stamps that repeat or run backward were put right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.run import Finding
from winchcascade.ingest.repair import (
    GLITCH,
    JITTER,
    LOST,
    counted,
    evened,
    forward,
    resolution,
    spread,
    with_all_stamps,
    without_repeats,
)

if TYPE_CHECKING:
    from winchcascade.core.run import Index, Mask, Signal


UNEVEN = 0.2
"""With more than this share of intervals off, the log is stamped unevenly, and only long intervals are gaps."""

_BLOCK = 1 << 18


NO_TIME = 1e-150
"""The square of a shorter interval is no number: stamps of wrong bytes, which no clock makes. [s]"""

SHORTEST = 1e-9
"""No log is sampled more often. [s]"""

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


def require_rising(t: Signal, where: str) -> None:
    """Reject stamps that floating-point numbers cannot distinguish, after a wrong stamp or a start aeons ago; LogError."""
    if t.size > 1 and not np.diff(t).min() > NO_TIME:
        raise LogError(
            f"{where}: stamps from {t.min():.6g} to {t.max():.6g} s lie too far from zero to be told apart; expected stamps "
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
        return Clock(stamps, None, np.empty((0, 2)), _rate((stamps[-1] - stamps[0]) / (stamps.size - 1)), ())
    findings: list[Finding] = []
    t, rows = with_all_stamps(stamps, findings, where)
    usual = _usual(np.diff(t), where)
    if np.any(np.diff(t) < 0):
        t, rows = forward(t, rows, usual, findings, where)
        usual = _usual(np.diff(t), where)
    if np.count_nonzero(np.diff(t) == 0) > 0.3 * t.size:
        t = spread(t, findings)
        usual = _usual(np.diff(t), where)
    even = evened(t, np.diff(t), usual)
    if even is not None:
        t = counted(t, even, resolution(t, usual), findings)
        require_rising(t, where)
        return Clock(t, _kept(rows, stamps.size), np.empty((0, 2)), _rate(even[1] - even[0]), tuple(findings))
    if np.any(np.diff(t) == 0):
        t, rows = without_repeats(t, rows, usual, findings)
    if t.size < 3:
        raise LogError(f"{where}: {t.size} stamps are left that rise from row to row; expected at least three.")
    require_rising(t, where)
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
    return max(JITTER * usual, 1.05 * resolution(t, usual)) if rounded else JITTER * usual


def _rate(interval: float) -> float:
    """Sampling rate from the mean interval, to the digits that stamps carry. [Hz]"""
    return float(f"{1.0 / float(interval):.6g}")


def _jitter(t: Signal, interval: Signal, jitters: Mask, usual: float) -> Finding:
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
