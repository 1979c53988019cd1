"""Rows that were lost while the clock was renumbered, and counters that were set: the displacement jumps by what the line did not
travel.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, GAUSS, median, quantile
from winchcascade.core.run import Finding, Index, Repair, Signal
from winchcascade.ingest.checks.samples import Samples

LARGE = (3.0, 8.0, 1.5)
"""Smallest jump, as a multiple of what the motion does elsewhere: of the 95 % quantile of the travel beyond the velocity, of its
standard deviation, and of the step of the displacement. [1]"""

ROW = 0.5
"""Smallest jump, as a share of the travel in a row: at least one whole row is lost. [1]"""

MAX_JUMPS = 20
"""With more of them the displacement jumps by itself, as one that is sampled slowly does. [1]"""

SIDE = 5
"""Rows on either side of a jump that show whether it comes back, and the speed where no velocity is logged. [1]"""


class Jump(NamedTuple):
    """Rows between which the displacement changes by `metres` more than the velocity allows, at a mean speed. [m], [m/s]"""

    before: int
    after: int
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
    for before, after, metres, speed in _jumps(log):
        start = end = float(log.t[before])
        repair, travel = None, abs(speed) * float(log.t[after] - start)
        if _makes_up(log, before, metres):
            continue
        if abs(speed) < thresholds.v_onset:
            if abs(metres) < thresholds.stroke_min:
                continue
            cause = "while the line rests: rows were lost and the clock was renumbered, or the counter was set"
        elif metres * speed < 0.0 or (abs(x[after]) < LARGE[2] * step + travel and abs(x[before]) > step):
            x = np.concatenate((x[:after], x[after:] - metres))
            cause = "and goes on from there: the counter was set back, or rows were written twice"
            repair = Repair("step removed from the displacement", x.size - after, ((start, float(log.t[-1])),))
        else:
            lost = metres / speed
            t = np.concatenate((log.t[:after], log.t[after:] + lost))
            end = float(t[after])
            log.findings[:] = [finding.at_times(log.t, t) for finding in log.findings]
            log.t = t
            gaps.append((start, end))
            cause = f"as in {lost:.2f} s: rows were lost and the clock was renumbered, or the displacement slipped"
            repair = Repair("treated as a gap of that length", 0, ((start, end),))
        what = f"at {start:.2f} s the displacement jumps by {metres:+.3f} m beyond what the velocity gives, {cause}"
        action = "reported and kept" if repair is None else repair.what
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


class _Course(NamedTuple):
    """Rows with displacement and velocity, (n,), and their numbers in the log."""

    rows: Index | None
    t: Signal
    x: Signal
    v: Signal

    def steps(self, first: int, last: int) -> tuple[Signal, Signal, Signal]:
        """Interval [s], mean speed [m/s] and travel beyond any speed from a row before to a row after [m], of some steps.

        The interval is NaN where rows without a value lie between.
        """
        wide = self.v[max(first - 1, 0) : last + 2]
        wide = np.concatenate(([wide[0]] * (first == 0), wide, [wide[-1]] * (last + 1 >= self.v.size)))
        n = last - first
        near = [wide[k : k + n] for k in range(4)]
        interval, moved = np.diff(self.t[first : last + 1]), np.diff(self.x[first : last + 1])
        low, high = (limit.reduce(near) * interval for limit in (np.minimum, np.maximum))
        beyond = moved - np.clip(moved, low, high)
        if self.rows is not None:
            interval[np.diff(self.rows[first : last + 1]) > 1] = np.nan
        return interval, 0.5 * (near[1] + near[2]), beyond

    def blocks(self, every: int = 1) -> Iterator[tuple[int, tuple[Signal, Signal, Signal]]]:
        """Steps block by block, so that none of their numbers is held for all rows of a long log."""
        for first in range(0, self.t.size - 1, BLOCK * every):
            yield first, self.steps(first, min(first + BLOCK, self.t.size - 1))


def _course(log: Samples) -> _Course:
    """Rows that have values; no copies where all have. Without a velocity, it is the middle one of the slopes beside a row."""
    t, x, v = log.t, log.channels["displacement"], log.channels.get("velocity")
    finite = np.isfinite(x) if v is None else np.isfinite(x) & np.isfinite(v)
    rows = None if finite.all() else np.flatnonzero(finite)
    if rows is not None:
        t, x, v = t[rows], x[rows], None if v is None else v[rows]
    if v is None:
        slopes = np.pad(np.diff(x) / np.diff(t), SIDE, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(slopes, 2 * SIDE)
        v = np.partition(windows, SIDE, axis=1)[:, SIDE]
    return _Course(rows, t, x, v)


def _jumps(log: Samples) -> list[Jump]:
    """Places at which the displacement jumps by what the line did not travel, in order; none if they are many."""
    if np.count_nonzero(np.isfinite(log.channels["displacement"])) < 4 * SIDE:
        return []
    course, v_onset = _course(log), log.rig.thresholds.v_onset
    if course.t.size < 4 * SIDE:
        return []
    longest = 1.5 * median(np.diff(course.t[: BLOCK + 1]))
    sizes = []
    for _, (interval, speed, beyond) in course.blocks(max(1, course.t.size // (8 * BLOCK))):
        sizes.append(np.abs(beyond[(interval < longest) & (np.abs(speed) > v_onset)]))
    size = np.concatenate(sizes)
    if size.size < 4 * SIDE:
        return []
    least = max(LARGE[0] * quantile(size, 0.95), LARGE[1] * GAUSS * median(size), LARGE[2] * log.level("displacement").step)
    found: list[int] = []
    for first, (interval, speed, beyond) in course.blocks():
        large = np.abs(beyond) > np.maximum(least, ROW * np.abs(speed) * interval)
        found += (first + np.flatnonzero(large & (interval < longest))).tolist()
    jumps = []
    for k in found if len(found) <= MAX_JUMPS else []:
        first = max(k - SIDE, 0)
        _, speed, _ = course.steps(first, min(k + SIDE + 1, course.t.size - 1))
        part = slice(first, min(k + SIDE + 2, course.t.size))
        along = np.diff(course.x[part]) - speed * np.diff(course.t[part])
        metres = float(along[k - first])
        if abs(float(along.sum()) - metres) < ROW * abs(metres):  # a spike would come back
            before, after = (k, k + 1) if course.rows is None else course.rows[k : k + 2].tolist()
            jumps.append(Jump(before, after, metres, float(speed[k - first])))
    return jumps
