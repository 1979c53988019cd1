"""What velocity and displacement say of the clock: a unit of time that is wrong, rows that were lost while the clock was
renumbered, a counter that was reset.

The displacement changes from row to row by what the velocity gives. Where it does not, at one place alone, rows are missing
or a counter was set; where it does not throughout, by a factor, the clock or a unit is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import median, quantile, smallest_step
from winchcascade.core.run import Finding
from winchcascade.ingest.checks.agreement import MOVING

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Thresholds
    from winchcascade.core.run import Signal


BLOCKS = 200
"""Blocks of equal numbers of rows over which a factor is found, whatever the clock says."""

FEWEST = 5
"""Fewer blocks that move show no factor."""

UNITS = (60.0, 1e3, 3600.0, 6e4, 86400.0, 1e6, 3.6e6, 1e9)
"""Ratios of two units of time."""

NEAR = 0.03
"""A factor is such a ratio within this share: gains of velocity and displacement differ by less."""

BEYOND = 20.0
"""No gain is farther from 1."""

STANDS_OUT = 3.0
"""A jump is so many times what 95 of 100 differences of displacement and velocity stay below while the line moves,"""

DEVIATIONS = 8.0
"""so many standard deviations of them,"""

ROW = 0.5
"""and this share of a row's travel: a lost row is a whole one."""

STEPS = 1.5
"""And so many steps of the displacement."""

MOST = 20
"""With more jumps the displacement jumps by itself, as one that is sampled slowly does."""

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


def factor_finding(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> Finding | None:
    """Report a clock that velocity and displacement contradict by a ratio of two units, or by more than any gain."""
    usual = median(np.diff(t))
    factor = _factor(t, v, displacement, v_onset)
    if factor is None:
        return None
    large = max(factor, 1.0 / factor)
    unit = any(abs(large / ratio - 1.0) < NEAR for ratio in UNITS)
    counts = bool(np.all(np.diff(t[: BLOCKS * SIDE]) == 1.0)) and large > 1.0 + NEAR
    if not (unit or counts or large > BEYOND):
        return None
    clock = "stamps may count rows" if counts else f"the true interval may be {usual / factor:.4g} s"
    return Finding(
        "clock_mismatch",
        f"velocity integrates to {factor:#.4g} times the travel of the displacement, with stamps {usual:.4g} s apart: {clock}, "
        f"or one of velocity and displacement is in another unit; give the right one with override = true under [columns] of a "
        f"rig file",
        "reported and kept",
    )


def _factor(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> float | None:
    """Travel by the velocity over travel by the displacement, where the velocity moves; None where too little does. [1]"""
    good = np.isfinite(v) & np.isfinite(displacement)
    t, v, x = t[good], v[good], displacement[good]
    if t.size < 2 * FEWEST:
        return None
    ends = np.linspace(0, t.size - 1, min(BLOCKS, t.size - 1) + 1).astype(np.intp)
    area = np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)))
    travelled, moved, length = np.diff(area[ends]), np.diff(x[ends]), np.diff(t[ends])
    moving = (np.abs(travelled) > MOVING * v_onset * length) & (travelled * moved != 0.0)
    if np.count_nonzero(moving) < FEWEST:
        return None
    with np.errstate(over="ignore"):
        ratio = np.abs(travelled[moving]) / np.abs(moved[moving])
    factor = median(ratio)
    return factor if 0.0 < factor < math.inf else None


def coarse_finding(t: Signal, thresholds: Thresholds) -> Finding | None:
    """Report stamps too far apart to smooth the velocity, where no displacement confirms them."""
    usual = median(np.diff(t))
    if usual <= thresholds.smoothing:
        return None
    return Finding(
        "clock_mismatch",
        f"stamps are {usual:.4g} s apart, and the velocity is smoothed over {thresholds.smoothing:g} s; no other channel "
        f"confirms the clock. Stamps of a smaller unit get it with override = true under [columns] of a rig file",
        "reported and kept",
    )


def put_back(t: Signal, channels: dict[str, Signal], thresholds: Thresholds) -> Timed | None:
    """Find rows lost while the clock was renumbered, and put their time back; take out the steps of a counter that was reset.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    channels : (n,) each; the displacement is changed in place where a counter was reset, and NaN where it has holes
    """
    jumps = find_jumps(t, channels, thresholds.v_onset)
    if not jumps:
        return None
    t = t.copy()
    x = channels["displacement"]
    findings, gaps = [], []
    step = max(smallest_step(x), 1e-9)
    for jump in jumps:
        if _makes_up(t, channels, jump):
            continue
        at = float(t[jump.before])
        now = f"at {at:.2f} s the displacement jumps by {jump.metres:+.3f} m beyond what the velocity gives"
        zeroed = (
            abs(x[jump.after]) < STEPS * step + abs(jump.speed) * (t[jump.after] - at) and abs(x[jump.before]) > step
        )
        if abs(jump.speed) < thresholds.v_onset:
            if abs(jump.metres) >= thresholds.stroke_min:
                what = f"{now} while the line rests: rows were lost and the clock renumbered, or the counter was set"
                findings.append(Finding("clock_mismatch", what, "reported and kept", start=at, end=at))
        elif zeroed or jump.metres * jump.speed < 0.0:
            repeats = _repeats(channels, jump)
            x[jump.after :] -= jump.metres
            what = f"{now}: the counter was set back" + (f", or {repeats} rows were written twice" if repeats else "")
            findings.append(Finding("clock_mismatch", what, "step taken out of the displacement", start=at, end=at))
        else:
            lost = jump.metres / jump.speed
            t[jump.after :] += lost
            gaps.append((at, float(t[jump.after])))
            what = f"{now}: {lost:.2f} s of rows were lost and the clock was renumbered, or the displacement slipped"
            findings.append(
                Finding("clock_mismatch", what, "treated as a gap of that length", start=at, end=gaps[-1][1])
            )
    return Timed(t, np.array(gaps).reshape(-1, 2), tuple(findings)) if findings else None


def _makes_up(t: Signal, channels: Mapping[str, Signal], jump: Jump) -> bool:
    """Whether a jump makes up what a displacement that held one value before did not count while the line moved."""
    x, v = channels["displacement"], channels.get("velocity")
    if v is None:
        return False
    other = np.flatnonzero(x[: jump.before] != x[jump.before])
    held = slice(int(other[-1]) + 1 if other.size else 0, jump.before + 1)
    return bool(abs(float(np.trapezoid(np.nan_to_num(v[held]), t[held]))) > ROW * abs(jump.metres))


def _repeats(channels: Mapping[str, Signal], jump: Jump) -> int:
    """Number of rows that follow a jump and repeat the ones before it; 0 if none do."""
    x = channels["displacement"]
    for again in np.flatnonzero(x[: jump.after] == x[jump.after])[::-1].tolist():
        count = jump.after - again
        rows = slice(again, again + min(count, SIDE))
        later = slice(jump.after, jump.after + min(count, SIDE))
        if all(np.array_equal(y[rows], y[later]) for y in channels.values()):
            return int(count)
    return 0


def find_jumps(t: Signal, channels: Mapping[str, Signal], v_onset: float) -> list[Jump]:
    """Find the places at which the displacement jumps by what the line did not travel, in order; none if they are many."""
    x, v = channels["displacement"], channels.get("velocity")
    good = np.isfinite(x) if v is None else np.isfinite(x) & np.isfinite(v)
    rows = np.flatnonzero(good)
    if rows.size < 4 * SIDE:
        return []
    stamps, x = t[rows], x[rows]
    interval, moved = np.diff(stamps), np.diff(x)
    before, after = _slopes(moved / interval) if v is None else (v[rows[:-1]], v[rows[1:]])
    speed = 0.5 * (before + after)
    beyond = moved - speed * interval
    usual = (np.diff(rows) == 1) & (interval < 1.5 * median(interval))
    moving = usual & (np.abs(speed) > v_onset)
    if np.count_nonzero(moving) < 4 * SIDE:
        return []
    size = np.abs(beyond)
    least = max(
        STANDS_OUT * quantile(size[moving], 0.95),
        DEVIATIONS * 1.4826 * median(size[moving]),
        STEPS * smallest_step(x),
    )
    found = np.flatnonzero(usual & (size > np.maximum(least, ROW * np.abs(speed) * interval)))
    if not 0 < found.size <= MOST:
        return []
    return [
        Jump(int(rows[k]), int(rows[k + 1]), float(beyond[k]), float(speed[k]))
        for k in found.tolist()
        if _stays(beyond, k)
    ]


def _stays(beyond: Signal, k: int) -> bool:
    """Whether the displacement does not come back after a jump, as from a spike."""
    around = np.delete(beyond[max(k - SIDE, 0) : k + SIDE + 1], min(k, SIDE))
    return bool(abs(float(around.sum())) < ROW * abs(float(beyond[k])))


def _slopes(slope: Signal) -> tuple[Signal, Signal]:
    """Speeds before and after each step: medians of the slopes of the rows on either side. [m/s]"""
    padded = np.concatenate((np.repeat(slope[:1], SIDE), slope, np.repeat(slope[-1:], SIDE)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, SIDE)
    middle: Signal = np.partition(windows, SIDE // 2, axis=1)[:, SIDE // 2]
    return middle[: slope.size], middle[SIDE + 1 : SIDE + 1 + slope.size]
