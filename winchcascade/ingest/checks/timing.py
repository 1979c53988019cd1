"""Errors of the clock that velocity and displacement show: a wrong unit of time, rows that were lost while the clock was
renumbered, a counter that was reset.

The displacement changes from row to row by what the velocity gives. If it does not at a single place, rows are missing or a
counter was set. If it differs by the same factor everywhere, the clock or a unit is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.integrate import BLOCK, ENOUGH, GAUSS, median, quantiles_in_place, running, smallest_step
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import Finding, Index, Mask, Repair, Signal
from winchcascade.ingest.checks.agreement import MOVING

BLOCKS = 200
"""Number of blocks of equal numbers of rows over which a factor is found; they do not depend on the clock."""

MIN_BLOCKS = 5
"""Smallest number of moving blocks that shows a factor."""

UNITS = (60.0, 1e3, 3600.0, 6e4, 86400.0, 1e6, 3.6e6, 1e9)
"""Ratios of two units of time."""

NEAR = 0.03
"""A factor is such a ratio within this share: gains of velocity and displacement differ by less."""

BEYOND = 20.0
"""Largest factor that an error of a gain may cause."""

STANDS_OUT, DEVIATIONS, ROW, STEPS = 3.0, 8.0, 0.5, 1.5
"""Smallest jump, as a multiple of four sizes, all of which it exceeds: the 95 % quantile of the differences of displacement and
velocity while the line moves, their standard deviation, the travel in a row, as at least one whole row is lost, and the step of
the displacement. [1]"""

MAX_JUMPS = 20
"""Maximum number of jumps: with more of them the displacement jumps by itself, as one that is sampled slowly does."""

SIDE = 5
"""Rows on either side that give the speed where no velocity is logged."""


class Jump(msgspec.Struct, frozen=True):
    """Rows `before` and `after` between which the displacement changes by `metres` more than the velocity gives, at the mean
    speed of the two rows. [m], [m/s]"""

    before: int
    after: int
    metres: float
    speed: float


class Timed(msgspec.Struct, frozen=True):
    """Stamps with the time of lost rows put back, (n,) [s], gaps where they were lost, (k, 2) [s], and what was found."""

    t: Signal
    gaps: Signal
    findings: tuple[Finding, ...]


def check_clock(t: Signal, channels: dict[str, Signal], thresholds: Thresholds) -> Timed:
    """Compare the clock with velocity and displacement; put back the time of rows that were lost while it was renumbered, and
    take out the steps of a counter that was reset.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each, NaN where they have holes; the displacement is changed in place where a counter was reset
    """
    v, displacement = channels.get("velocity"), channels.get("displacement")
    if v is None and displacement is None:  # nothing is smoothed
        return Timed(t, np.empty((0, 2)), ())
    if v is None or displacement is None:
        mismatch = _unconfirmed(t, thresholds)
    else:
        mismatch = _other_unit(t, _factor(t, v, displacement, thresholds.v_onset))
    if mismatch is not None:
        return Timed(t, np.empty((0, 2)), (Finding("clock_mismatch", mismatch, "reported and kept"),))
    return Timed(t, np.empty((0, 2)), ()) if displacement is None else _put_back(t, channels, thresholds)


def _unconfirmed(t: Signal, thresholds: Thresholds) -> str | None:
    """Describe stamps that are too far apart to smooth the velocity, where no displacement confirms them."""
    usual = median(np.diff(t))
    if usual <= thresholds.smoothing:
        return None
    return (
        f"stamps are {usual:.4g} s apart, and the velocity is smoothed over {thresholds.smoothing:g} s; no other channel "
        f"confirms the clock. For stamps in a smaller unit, state it with override = true under [columns] of a rig file"
    )


def _other_unit(t: Signal, factor: float | None) -> str | None:
    """Describe a clock that velocity and displacement contradict by a ratio of two units, or by more than any gain."""
    if factor is None:
        return None
    usual, large = median(np.diff(t)), max(factor, 1.0 / factor)
    counts = bool(np.all(np.diff(t[: BLOCKS * SIDE]) == 1.0)) and large > 1.0 + NEAR
    if not (counts or large > BEYOND or any(abs(large / ratio - 1.0) < NEAR for ratio in UNITS)):
        return None
    clock = "stamps may count rows" if counts else f"the true interval may be {usual / factor:.4g} s"
    return (
        f"velocity integrates to {factor:#.4g} times the travel of the displacement, with stamps {usual:.4g} s apart: {clock}, "
        f"or one of velocity and displacement is in another unit; state the right one with override = true under [columns] of "
        f"a rig file"
    )


def _factor(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> float | None:
    """Travel by the velocity over travel by the displacement, where the velocity moves; None where too little does. [1]"""
    good, x = np.isfinite(v) & np.isfinite(displacement), displacement
    if not good.all():  # else no copies of a long log
        t, v, x = t[good], v[good], x[good]
    if t.size < 2 * MIN_BLOCKS:
        return None
    ends = np.linspace(0, t.size - 1, min(BLOCKS, t.size - 1) + 1).astype(np.intp)

    travelled, moved, length = np.diff(running(t, v.__getitem__, ends)), np.diff(x[ends]), np.diff(t[ends])
    moving = (np.abs(travelled) > MOVING * v_onset * length) & (travelled * moved != 0.0)
    if np.count_nonzero(moving) < MIN_BLOCKS:
        return None
    with np.errstate(over="ignore"):
        ratio = np.abs(travelled[moving]) / np.abs(moved[moving])
    factor = median(ratio)
    return factor if 0.0 < factor < math.inf else None


def _put_back(t: Signal, channels: dict[str, Signal], thresholds: Thresholds) -> Timed:
    """Put back the time of lost rows, and take the steps of a counter that was reset out of the displacement."""
    x = channels["displacement"]
    findings, gaps = [], []
    step = max(smallest_step(x), 1e-9)
    for jump in find_jumps(t, channels, thresholds.v_onset):
        if _makes_up(t, channels, jump):
            continue
        start = end = float(t[jump.before])
        travel = abs(jump.speed) * (t[jump.after] - start)
        action, repair = "reported and kept", None
        if abs(jump.speed) < thresholds.v_onset:
            if abs(jump.metres) < thresholds.stroke_min:
                continue
            cause = " while the line rests: rows were lost and the clock was renumbered, or the counter was set"
        elif jump.metres * jump.speed < 0.0 or (
            abs(x[jump.after]) < STEPS * step + travel and abs(x[jump.before]) > step
        ):
            repeats = _repeats(channels, jump)
            x[jump.after :] -= jump.metres
            cause = ": the counter was set back" + (f", or {repeats} rows were written twice" if repeats else "")
            action = "step removed from the displacement"
            repair = Repair(action, x.size - jump.after, ((start, float(t[-1])),))
        else:
            lost = jump.metres / jump.speed
            t = np.concatenate((t[: jump.after], t[jump.after :] + lost))
            end = float(t[jump.after])
            gaps.append((start, end))
            cause = f": {lost:.2f} s of rows were lost and the clock was renumbered, or the displacement slipped"
            action = "treated as a gap of that length"
            repair = Repair(action, 0, ((start, end),))
        what = f"at {start:.2f} s the displacement jumps by {jump.metres:+.3f} m beyond what the velocity gives{cause}"
        findings.append(Finding("clock_mismatch", what, action, start=start, end=end, repair=repair))
    return Timed(t, np.array(gaps).reshape(-1, 2), tuple(findings))


def _makes_up(t: Signal, channels: Mapping[str, Signal], jump: Jump) -> bool:
    """Whether a jump makes up for travel that a displacement which held one value before did not count."""
    x, v = channels["displacement"], channels.get("velocity")
    if v is None:
        return False
    other = np.flatnonzero(x[: jump.before] != x[jump.before])
    held = slice(int(other[-1]) + 1 if other.size else 0, jump.before + 1)
    return abs(float(np.trapezoid(np.nan_to_num(v[held]), t[held]))) > ROW * abs(jump.metres)


def _repeats(channels: Mapping[str, Signal], jump: Jump) -> int:
    """Number of rows that follow a jump and repeat the ones before it; 0 if none do."""
    x = channels["displacement"]
    for again in np.flatnonzero(x[: jump.after] == x[jump.after])[::-1].tolist():
        count = jump.after - again
        size = min(count, SIDE)
        if all(np.array_equal(y[again : again + size], y[jump.after : jump.after + size]) for y in channels.values()):
            return int(count)
    return 0


class _Steps(NamedTuple):
    """Steps from row to row: the interval [s], the mean speed [m/s], the travel beyond what that gives [m], and whether no row
    without a value lies between, (k,) each.
    """

    interval: Signal
    speed: Signal
    beyond: Signal
    joined: Mask


class _Course(msgspec.Struct, frozen=True):
    """Rows of a log with a value of the displacement and, if it has one, of the velocity, else with the `slopes` of its steps.

    `rows` are their numbers, None where all have values.
    """

    rows: Index | None
    t: Signal
    x: Signal
    v: Signal | None
    slopes: Signal

    def steps(self, first: int, last: int) -> _Steps:
        """Some steps, so that none of their numbers is held for all rows of a long log."""
        at = slice(first, last + 1)
        interval = np.diff(self.t[at])
        speed = self.slopes[first:last] if self.v is None else 0.5 * (self.v[at][:-1] + self.v[at][1:])
        joined = np.ones(interval.size, dtype=bool) if self.rows is None else np.diff(self.rows[at]) == 1
        return _Steps(interval, speed, np.diff(self.x[at]) - speed * interval, joined)

    def blocks(self) -> Iterator[tuple[int, _Steps]]:
        """All steps block by block, each with the number of its first."""
        for first in range(0, self.t.size - 1, BLOCK):
            yield first, self.steps(first, min(first + BLOCK, self.t.size - 1))


def _course(t: Signal, x: Signal, v: Signal | None) -> _Course:
    """The rows that have values; no copies where all have."""
    finite = np.isfinite(x) if v is None else np.isfinite(x) & np.isfinite(v)
    rows = None if finite.all() else np.flatnonzero(finite)
    if rows is not None:
        t, x, v = t[rows], x[rows], None if v is None else v[rows]
    slopes = _mean_slopes(np.diff(x) / np.diff(t)) if v is None and x.size > 1 else np.empty(0)
    return _Course(rows, t, x, v, slopes)


def find_jumps(t: Signal, channels: Mapping[str, Signal], v_onset: float) -> list[Jump]:
    """Find the places at which the displacement jumps by what the line did not travel, in order; none if they are many."""
    course = _course(t, channels["displacement"], channels.get("velocity"))
    if course.t.size < 4 * SIDE:
        return []
    every = max(1, course.t.size // ENOUGH)
    longest = 1.5 * median(course.t[1::every] - course.t[:-1:every])
    size, count = np.empty(course.t.size), 0  # memory that is not used costs nothing
    for _, some in course.blocks():
        moving = np.abs(some.beyond[(some.interval < longest) & some.joined & (np.abs(some.speed) > v_onset)])
        size[count : count + moving.size] = moving
        count += moving.size
    if count < 4 * SIDE:
        return []
    usual, large_size = quantiles_in_place(size[:count], [0.5, 0.95])
    minimum = max(STANDS_OUT * large_size, DEVIATIONS * GAUSS * usual, STEPS * smallest_step(course.x))
    found: list[int] = []
    for first, some in course.blocks():
        large = np.abs(some.beyond) > np.maximum(minimum, ROW * np.abs(some.speed) * some.interval)
        found += (first + np.flatnonzero(large & (some.interval < longest) & some.joined)).tolist()
    if not 0 < len(found) <= MAX_JUMPS:
        return []
    jumps = []
    for k in found:
        first = max(k - SIDE, 0)
        near = course.steps(first, min(k + SIDE + 1, course.t.size - 1))
        metres = float(near.beyond[k - first])
        if abs(near.beyond.sum() - metres) < ROW * abs(metres):  # a spike would come back
            before, after = (k, k + 1) if course.rows is None else course.rows[k : k + 2].tolist()
            jumps.append(Jump(before, after, metres, float(near.speed[k - first])))
    return jumps


def _mean_slopes(slope: Signal) -> Signal:
    """Mean of the speeds before and after each step, the medians of the slopes of the rows on either side. [m/s]"""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(slope, SIDE, mode="edge"), SIDE)
    middle = np.partition(windows, SIDE // 2, axis=1)[:, SIDE // 2]
    return 0.5 * (middle[: slope.size] + middle[SIDE + 1 : SIDE + 1 + slope.size])
