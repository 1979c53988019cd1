"""Rows that were lost while the clock was renumbered, and counters that were set: the displacement jumps without travel."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, GAUSS, median, quantile
from winchcascade.core.run import Finding, Repair, Signal
from winchcascade.ingest.checks.samples import Samples, whole

LARGE = (3.0, 8.0, 1.5)
"""Smallest jump, as a multiple of what the motion does elsewhere: of the 95 % quantile of the travel beyond the velocity, of
its standard deviation, and of the step of the displacement. [1]"""

ROW = 0.5
"""Smallest jump, as a share of the travel in a row: at least one whole row is lost. [1]"""

MAX_JUMPS = 20
"""With more of them the displacement jumps by itself, as one that is sampled slowly does. [1]"""

SIDE = 5
"""Rows on either side of a jump that show whether it comes back, and the speed where no velocity is logged. [1]"""


class Jump(NamedTuple):
    """A jump of the displacement after a row, by what it changes beyond the mean velocity [m], and that velocity [m/s]."""

    before: int
    metres: float
    speed: float


def put_back(log: Samples) -> Signal:
    """Put back the time of lost rows, and take the steps of a counter that was set out of the displacement.

    Returns
    -------
    (k, 2) stamps around the rows that were lost [s]
    """
    gaps = []
    t, x, thresholds = log.t, log.channels["displacement"], log.rig.thresholds
    step = max(log.level("displacement").step, 1e-9)
    for before, metres, speed in _jumps(log):
        start, repair, after = float(log.t[before]), None, before + 1
        travel = abs(speed) * float(log.t[after] - start)
        slow = abs(speed) < thresholds.v_onset
        if _makes_up(log, before, metres) or (slow and abs(metres) < thresholds.stroke_min):
            continue
        if slow:
            cause = "while the line rests: rows were lost and the clock was renumbered, or the counter was set"
        elif metres * speed < 0.0 or (abs(x[after]) < LARGE[2] * step + travel and abs(x[before]) > step):
            x = np.concatenate((x[:after], x[after:] - metres))
            cause = "and goes on from there: the counter was set back, or rows were written twice"
            repair = Repair("step removed from the displacement", x.size - after, ((start, float(t[-1])),))
        else:
            lost = metres / speed
            t = np.concatenate((log.t[:after], log.t[after:] + lost))
            log.findings[:] = [finding.at_times(log.t, t) for finding in log.findings]
            log.t = t
            gaps.append((start, float(t[after])))
            cause = f"as in {lost:.2f} s: rows were lost and the clock was renumbered, or the displacement slipped"
            repair = Repair("treated as a gap of that length", 0, (gaps[-1],))
        what = f"at {start:.2f} s the displacement jumps by {metres:+.3f} m beyond what the velocity gives, {cause}"
        action = "reported and kept" if repair is None else repair.what
        end = gaps[-1][1] if gaps and gaps[-1][0] == start else start
        log.findings.append(Finding("clock_mismatch", what, action, start=start, end=end, repair=repair))
    log.channels["displacement"] = x
    return np.array(gaps).reshape(-1, 2)


def _makes_up(log: Samples, before: int, metres: float) -> bool:
    """Whether a jump makes up for travel that a displacement which held one value before it did not count."""
    x, v = log.channels["displacement"], log.channels.get("velocity")
    if v is None:
        return False
    other = np.flatnonzero(x[:before] != x[before])
    held = slice(int(other[-1]) + 1 if other.size else 0, before + 1)
    return abs(float(np.trapezoid(np.nan_to_num(v[held]), log.t[held]))) > ROW * abs(metres)


def _steps(t: Signal, x: Signal, v: Signal, first: int, last: int) -> tuple[Signal, Signal, Signal]:
    """Interval [s], mean speed [m/s], and travel beyond any speed from a row before to a row after [m], of some steps."""
    rows = np.clip(np.arange(first - 1, last + 2), 0, t.size - 1)
    near = np.lib.stride_tricks.sliding_window_view(v[rows], 4)
    interval, moved = np.diff(t[first : last + 1]), np.diff(x[first : last + 1])
    beyond = moved - np.clip(moved, near.min(axis=1) * interval, near.max(axis=1) * interval)
    return interval, 0.5 * (near[:, 1] + near[:, 2]), beyond


def _blocks(t: Signal, x: Signal, v: Signal, every: int) -> Iterator[tuple[int, tuple[Signal, Signal, Signal]]]:
    """Steps block by block, so that none of their numbers is held for all rows of a long log."""
    for first in range(0, t.size - 1, BLOCK * every):
        yield first, _steps(t, x, v, first, min(first + BLOCK, t.size - 1))


def _jumps(log: Samples) -> list[Jump]:
    """Jumps of the displacement by what the line did not travel, in order; none if they are many.

    Without a velocity, it is the middle one of the slopes beside a row.
    """
    t, x, v, v_onset = log.t, log.channels["displacement"], log.channels.get("velocity"), log.rig.thresholds.v_onset
    known = np.isfinite(x) if v is None else np.isfinite(x) & np.isfinite(v)
    if np.count_nonzero(known) < 4 * SIDE:
        return []
    whole_log, x = known.all(), whole(t, x)
    if v is None:
        slopes = np.pad(np.diff(x) / np.diff(t), SIDE, mode="edge")
        v = np.partition(np.lib.stride_tricks.sliding_window_view(slopes, 2 * SIDE), SIDE, axis=1)[:, SIDE]
    v, longest = whole(t, v), 1.5 * median(np.diff(t[: BLOCK + 1]))
    sizes, found = [], []
    for _, (interval, speed, beyond) in _blocks(t, x, v, max(1, t.size // (8 * BLOCK))):
        sizes.append(np.abs(beyond[(interval < longest) & (np.abs(speed) > v_onset)]))
    size = np.concatenate(sizes)
    if size.size < 4 * SIDE:
        return []
    least = max(LARGE[0] * quantile(size, 0.95), LARGE[1] * GAUSS * median(size))
    least = max(least, LARGE[2] * log.level("displacement").step)
    for first, (interval, speed, beyond) in _blocks(t, x, v, 1):
        large = (np.abs(beyond) > np.maximum(least, ROW * np.abs(speed) * interval)) & (interval < longest)
        found += (first + np.flatnonzero(large)).tolist()
    jumps = []
    for k in found if len(found) <= MAX_JUMPS else []:
        part = slice(max(k - SIDE, 0), min(k + SIDE + 2, t.size))
        interval, speed, _ = _steps(t, x, v, part.start, part.stop - 1)
        along = np.diff(x[part]) - speed * interval
        metres = float(along[k - part.start])
        comes_back = abs(float(along.sum()) - metres) >= ROW * abs(metres)  # as a spike does
        if not comes_back and (whole_log or known[k : k + 2].all()):
            jumps.append(Jump(k, metres, float(speed[k - part.start])))
    return jumps
