"""Velocity and displacement compared before phases are known: the clock, the direction of a speed,
and the zero and the gain of the velocity.

Both are averaged over blocks: the integral of the one and the change of the other, by their
duration. Blocks in which the displacement rests show the zero of the velocity, blocks in which both
move its gain. Few that deviate from the others do not change a median: the displacement is set
back, counts both ways or is stuck.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import (
    BLOCK,
    ends_of,
    median,
    median_and_error,
    smallest_step,
)
from winchcascade.core.rig_file import Thresholds
from winchcascade.core.run import Finding, Mask, Repair, Signal
from winchcascade.ingest.checks.samples import Samples

BLOCK_TIME = 5 / 3
"""Minimum duration of a block as a share of the width that smooths the velocity: noise of the
sensors averages out, and a lag between the channels matters little. [1]"""

MOVING = 2.0
"""A block moves above this many times the onset speed, and rests below once that speed. [1]"""

MIN_BLOCKS = 5
"""Smallest number of blocks, or samples, that shows a deviation. [1]"""

UNITS = (60.0, 1e3, 3600.0, 6e4, 86400.0, 1e6, 3.6e6, 1e9)
"""Ratios of two units of time. [1]"""

UNIT = 0.03
"""A factor is such a ratio within this share: gains of velocity and displacement differ by less.
[1]
"""

GAIN_MAX = 20.0
"""Largest factor that an error of a gain may cause. [1]"""

ONE_SIDED = 0.1
"""A velocity is without a sign if it goes no farther than this share of its top to the other
side of zero. [1]
"""

FOLLOWS = 0.2
"""A speed without a sign agrees with that of the displacement within this share, in four of five
blocks: a lag of a sixth of the width changes the mean speed of a block that begins at rest by so
much. [1]
"""


class Travel(NamedTuple):
    """Stamps [s], velocity [m/s], NaN where it is lost, and displacement [m] of n samples each, and
    the usual interval between them [s]."""

    t: Signal
    v: Signal
    x: Signal
    interval: float


class SpeedBlocks(NamedTuple):
    """Durations [s] of blocks, mean velocity and mean speed by the displacement in each [m/s],
    (k,) each; NaN over holes.
    """

    seconds: Signal
    v: Signal
    by_displacement: Signal

    def known(self, where: Mask | None = None) -> SpeedBlocks:
        """Blocks without holes, of some."""
        good = np.isfinite(self.v) & np.isfinite(self.by_displacement)
        good = good if where is None else good & where
        return SpeedBlocks(self.seconds[good], self.v[good], self.by_displacement[good])


class MotionGain(NamedTuple):
    """Zero of a velocity against a displacement that rests, 0 where none is shown [m/s]; speed of
    that displacement, which may drift [m/s]; gain of the velocity over a displacement that moves
    [1]; and the standard uncertainties of zero and gain."""

    zero: float
    u_zero: float
    drift: float
    gain: float
    u_gain: float


def travel_of(log: Samples) -> Travel:
    """Velocity and displacement of a log."""
    return Travel(log.t, log.channels["velocity"], log.channels["displacement"], log.interval)


def speed_blocks(travel: Travel, rows: int) -> SpeedBlocks:
    """Average velocity and displacement over blocks of so many rows; a sample between two blocks
    is of both.
    """
    t, v, x, _ = travel
    rows = max(1, rows)
    ends = np.arange(0, t.size, rows)
    seconds, moved, travelled = np.diff(t[ends]), np.diff(x[ends]), [np.empty(0)]
    last, at_once = int(ends[-1]), max(1, BLOCK // rows) * rows
    for start in range(0, last, at_once):
        part = slice(start, min(start + at_once, last) + 1)
        areas = (v[part][1:] + v[part][:-1]) * np.diff(t[part])
        travelled.append(0.5 * np.add.reduceat(areas, np.arange(0, areas.size, rows)))
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        return SpeedBlocks(seconds, np.concatenate(travelled) / seconds, moved / seconds)


def mean_speeds(travel: Travel, limits: Thresholds) -> SpeedBlocks:
    """Blocks of `BLOCK_TIME` or more without holes and gaps; coarse steps of an encoder make
    them longer.
    """
    usual = travel.interval
    seconds = max(BLOCK_TIME * limits.smoothing, MOVING * smallest_step(travel.x) / limits.v_onset)
    rows = max(1, round(min(seconds / usual, float(travel.t.size))))
    blocks = speed_blocks(travel, rows)
    return blocks.known(blocks.seconds < 1.5 * rows * usual)


def gain_of(travel: Travel, limits: Thresholds) -> MotionGain | None:
    """Zero and gain of a velocity; None where the displacement hardly moves."""
    _, v, x = mean_speeds(travel, limits)
    speed, zero, u_zero, drift = np.abs(x), 0.0, 0.0, 0.0
    at_rest = speed < limits.v_onset
    if np.count_nonzero(at_rest) >= MIN_BLOCKS:
        zero, u_zero = median_and_error((v - x)[at_rest])
        drift = median(x[at_rest])
    moving = (speed > MOVING * limits.v_onset) & ((v - zero) * x > 0.0)
    if np.count_nonzero(moving) < MIN_BLOCKS:
        return None
    gain, u_gain = median_and_error((v[moving] - zero) / x[moving])
    return MotionGain(zero, u_zero, drift, gain, u_gain)


def clock_mismatch(log: Samples) -> str | None:
    """Describe a clock that velocity and displacement contradict by a ratio of two units, or by
    more than any gain.

    Without a displacement, stamps that are too far apart to smooth the velocity are described.
    """
    usual, smoothing = log.interval, log.smoothing
    if "velocity" not in log.channels or "displacement" not in log.channels:
        return (
            f"stamps are {usual:.4g} s apart, and the velocity is smoothed over {smoothing:g} s; "
            f"no other channel confirms the "
            "clock. For stamps in a smaller unit, state it with override = true under [columns] "
            "of a rig file"
            if log.by_line and usual > smoothing
            else None
        )
    # Whatever the clock, a log has more than a hundred blocks.
    rows = min(BLOCK_TIME * smoothing / usual, max(1.0, log.t.size / 200.0))
    blocks = speed_blocks(travel_of(log), round(rows))
    blocks = blocks.known(
        (np.abs(blocks.v) > MOVING * log.rig.thresholds.v_onset) & (blocks.by_displacement != 0.0)
    )
    if blocks.v.size < MIN_BLOCKS:
        return None
    factor = median(np.abs(blocks.v / blocks.by_displacement))
    large = max(factor, 1.0 / factor)
    counts = bool(np.all(np.diff(log.t[:1000]) == 1.0)) and large > 1.0 + UNIT
    if not (counts or large > GAIN_MAX or any(abs(large / ratio - 1.0) < UNIT for ratio in UNITS)):
        return None
    clock = (
        "stamps may count rows" if counts else f"the true interval may be {usual / factor:.4g} s"
    )
    return (
        f"velocity integrates to {factor:#.4g} times the travel of the displacement, with stamps "
        f"{usual:.4g} s apart: {clock}, "
        "or one of velocity and displacement is in another unit; state the right one with "
        "override = true under [columns] of a "
        "rig file"
    )


def give_direction(log: Samples) -> bool:
    """Give a speed that has no sign the direction of the displacement; whether it had none."""
    turned = is_without_sign(travel_of(log), log.rig.thresholds)
    if turned:
        log.channels["velocity"] = directed(log)
        what = "velocity has one sign whichever way the displacement goes: it is a speed without direction"
        action = "given the direction of the displacement"
        repair = Repair(action, log.t.size)
        log.findings.append(Finding("sign_flipped", what, action, "velocity", repair=repair))
    return turned


def directed(log: Samples) -> Signal:
    """The speed with the direction of the displacement. [m/s]"""
    v = log.channels["velocity"]
    return np.where(log.slope() < 0, -np.abs(v), np.abs(v))


def is_without_sign(travel: Travel, limits: Thresholds) -> bool:
    """Whether the velocity is a speed: of one sign, however the displacement goes, and as fast
    both ways.
    """
    low, high = ends_of(travel.v)
    if low < 0.0 < high and min(-low, high) > ONE_SIDED * max(-low, high):
        return False
    seconds, v, by_displacement = mean_speeds(travel, limits)
    v_onset = limits.v_onset
    fast, slow = (
        np.abs(by_displacement) > MOVING * v_onset,
        np.abs(v[np.abs(by_displacement) < v_onset]),
    )
    if np.count_nonzero(fast) < 2 * MIN_BLOCKS or (slow.size and median(slow) > MOVING * v_onset):
        return False
    ratio = np.abs(v / np.where(fast, by_displacement, np.inf))
    alike = fast & (np.abs(ratio - median(ratio[fast])) < FOLLOWS * ratio)
    ways = (seconds * by_displacement * np.sign(v))[alike]
    with_it, against = float(ways[ways > 0].sum()), -float(ways[ways < 0].sum())
    both_ways = min(with_it, against) > max(limits.stroke_min, ONE_SIDED * max(with_it, against))
    return both_ways and bool(np.count_nonzero(alike) >= (1.0 - FOLLOWS) * np.count_nonzero(fast))
