"""Whether channels that depend on one quantity agree: velocity and displacement, power, torque and
speed.

Velocity and displacement are averaged over blocks: the integral of the one and the change of the
other, by their duration. Blocks in which the displacement rests show the zero of the velocity,
blocks in which both move its gain and its smoothing. Few that deviate from the others are left out:
the displacement is set back, counts both ways or is stuck. No channel is changed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import (
    ENOUGH,
    GAUSS,
    median,
    median_and_error,
    quantile,
    running,
    smallest_step,
)
from winchcascade.core.run import Finding, Mask, Signal
from winchcascade.ingest.checks.samples import Samples

BLOCK_TIME = 5 / 3
"""Minimum duration of a block as a share of the width that smooths the velocity: noise of the
sensors averages out, and a lag between the channels matters little. [1]"""

SHORT_BLOCK = 1 / 3
"""The same where smoothing is sought: a quarter of a ramp. [1]"""

MOVING = 2.0
"""A block moves above this many times the onset speed, and rests below once that speed. [1]"""

MIN_BLOCKS = 5
"""Smallest number of blocks, or samples, that shows a deviation. [1]"""

CERTAIN_U = 4.0
"""A deviation is reported from this many standard uncertainties on. [1]"""

GAIN = 0.01
"""Smallest deviation of a gain that matters: drums and wheels are known no better. Two channels
that a radius or a gear connects may deviate by twice as much, as radii under load do. [1]"""

ALIKE = 0.3
"""A block that deviates by less than this share counts: a slow sensor in a fast log makes blocks
that differ. [1]
"""

ZERO = 1 / 6
"""A zero below this share of the onset speed does not matter: 0.6 % of the speed of a payout.
[1]
"""

SMOOTHING_MIN = 1 / 6
"""Smallest standard deviation of a smoothing that is reported, as a share of the width that
detection applies: that of an average over half of it. [1]"""

DRIVEN = 0.3
"""The shaft is driven above this share of its largest power or speed, three samples in a
thousand left out. [1]
"""

UNITS = (60.0, 1e3, 3600.0, 6e4, 86400.0, 1e6, 3.6e6, 1e9)
"""Ratios of two units of time. [1]"""

UNIT = 0.03
"""A factor is such a ratio within this share: gains of velocity and displacement differ by less.
[1]
"""

GAIN_MAX = 20.0
"""Largest factor that an error of a gain may cause. [1]"""


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


def speed_blocks(log: Samples, rows: int) -> SpeedBlocks:
    """Average velocity and displacement over blocks of so many rows; a sample between two blocks
    is of both.
    """
    t, v, x = log.t, log.channels["velocity"], log.channels["displacement"]
    ends = np.arange(0, t.size, max(1, rows))
    seconds, moved = np.diff(t[ends]), np.diff(x[ends])
    travelled = np.diff(running(t, lambda part: np.nan_to_num(v[part]), ends))
    holes = np.add.reduceat(v[: ends[-1]], ends[:-1]) + v[ends[1:]] if ends.size > 1 else moved
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        return SpeedBlocks(
            seconds, np.where(np.isfinite(holes), travelled / seconds, np.nan), moved / seconds
        )


def mean_speeds(log: Samples, v_onset: float) -> SpeedBlocks:
    """Blocks of `BLOCK_TIME` or more without holes and gaps; coarse steps of an encoder make
    them longer.
    """
    usual = log.interval
    seconds = max(
        BLOCK_TIME * log.smoothing, MOVING * smallest_step(log.channels["displacement"]) / v_onset
    )
    rows = max(1, round(min(seconds / usual, float(log.t.size))))
    blocks = speed_blocks(log, rows)
    return blocks.known(blocks.seconds < 1.5 * rows * usual)


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
    blocks = speed_blocks(log, round(rows))
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


def compare_motions(log: Samples) -> None:
    """Report a zero, a gain or a smoothing of the velocity that the displacement contradicts."""
    v_onset, step = log.rig.thresholds.v_onset, log.level("velocity").step
    blocks = mean_speeds(log, v_onset)
    speed, off = np.abs(blocks.by_displacement), blocks.v - blocks.by_displacement
    moving, at_rest, zero = speed > MOVING * v_onset, speed < v_onset, 0.0
    if np.count_nonzero(moving) < MIN_BLOCKS:
        return
    if np.count_nonzero(at_rest) >= MIN_BLOCKS:
        found, u = median_and_error(off[at_rest])
        if abs(found) > max(ZERO * v_onset, CERTAIN_U * u, step):
            zero = found
            _report(
                log, "velocity", _zero_text(zero, median(blocks.by_displacement[at_rest]), v_onset)
            )
    gain = _gain(
        blocks.known(moving & ((blocks.v - zero) * blocks.by_displacement > 0)), zero, step
    )
    if gain is not None:
        what = (
            f"velocity integrates to {gain:#.4g} times the travel of the displacement; energies "
            f"are proportional to the "
            "velocity: check unit and gain of both, and the radius at which each is taken"
        )
        _report(log, "velocity", what)
    width = _smoothing(log)
    if width is not None:
        what = (
            f"velocity is smoother than the displacement, as if averaged over "
            f"{math.sqrt(12.0) * width:.2g} s: "
            "onsets, windows and energies deviate; record it with a faster filter, or leave it "
            "out and derive it"
        )
        log.findings.append(Finding("channel_lag", what, "reported and kept", "velocity"))


def _report(log: Samples, channel: str, message: str) -> None:
    log.findings.append(Finding("out_of_range", message, "reported and kept", channel))


def _gain(moving: SpeedBlocks, zero: float, step: float) -> float | None:
    """Travel by the velocity over travel by the displacement; None if that is 1 within its
    uncertainty. [1]
    """
    if moving.v.size < MIN_BLOCKS:
        return None
    v, speed = np.abs(moving.v - zero), np.abs(moving.by_displacement)
    rough = median(v / speed)
    beyond = np.abs(v - rough * speed)
    near = beyond <= np.maximum(CERTAIN_U * GAUSS * median(beyond), ALIKE * rough * speed)
    seconds, speed, v = moving.seconds[near], speed[near], v[near]
    travel = float(np.dot(speed, seconds))
    gain = float(np.dot(v, seconds)) / travel
    u = float(np.linalg.norm((v - gain * speed) * seconds)) / travel
    return (
        gain
        if abs(gain - 1.0) > max(GAIN, CERTAIN_U * u, 0.5 * step * float(seconds.sum()) / travel)
        else None
    )


def _zero_text(zero: float, drift: float, v_onset: float) -> str:
    """What the velocity reads beyond a displacement that rests, or beyond one that drifts. [m/s]"""
    if 2.0 * abs(drift) > abs(zero):
        return (
            f"velocity reads {zero + drift:+.3f} m/s where the displacement moves by {drift:+.3f} "
            f"m/s: one of the two drifts; "
            "check the zero of both"
        )
    onset = (
        f", and motion counts from {v_onset:g} m/s: rest may pass for motion"
        if abs(zero) > 0.8 * v_onset
        else ""
    )
    return f"velocity reads {zero:+.3f} m/s while the displacement rests{onset}; energies deviate with it: check its zero"


def _smoothing(log: Samples) -> float | None:
    """Standard deviation of a smoothing of the velocity that the displacement does not have; None
    if it could be chance. [s]

    A kernel of standard deviation s and mean lag adds, to second order, -lag v' + s**2 / 2 v'' to a
    velocity: least squares of the difference of the block means give both. The noise of the
    velocity itself makes the coefficient of v'' negative.
    """
    short = SHORT_BLOCK * log.smoothing
    rows = max(1, log.rows(short))
    h = rows * log.interval
    blocks = SpeedBlocks(*(x[:ENOUGH] for x in speed_blocks(log, rows)))
    v, off = blocks.v, (blocks.v - blocks.by_displacement)[1:-1]
    rise, bend = 0.5 * (v[2:] - v[:-2]) / h, (v[2:] - 2.0 * v[1:-1] + v[:-2]) / h**2
    terms = np.column_stack((np.ones(off.size), v[1:-1], rise, bend))
    known = np.isfinite(bend) & np.isfinite(off) & (np.abs(blocks.seconds[1:-1] - h) < 0.5 * h)
    if h > 2.0 * short or np.count_nonzero(known) < 10 * MIN_BLOCKS:
        return None
    terms, off = terms[known], off[known]
    normal = terms.T @ terms
    if np.linalg.cond(normal) > 1e12:
        return None
    inverse = np.linalg.inv(normal)
    found = inverse @ (terms.T @ off)
    u = math.sqrt(
        float(np.sum((off - terms @ found) ** 2)) / (off.size - found.size) * float(inverse[-1, -1])
    )
    half_variance = (
        float(found[-1]) - log.interval**2 / 12.0
    )  # trapezoids between samples smooth by as much
    least = 0.5 * (SMOOTHING_MIN * log.smoothing) ** 2
    return (
        math.sqrt(2.0 * half_variance) if half_variance > max(least, 2.0 * CERTAIN_U * u) else None
    )


def compare_powers(log: Samples) -> None:
    """Report a logged mechanical power that differs from torque times speed, and a speed that
    differs from line and radius.
    """
    channels, r_drum = log.channels, log.rig.r_drum
    some = {name: x[:: max(1, x.size // ENOUGH)] for name, x in channels.items()}
    by_line = r_drum is not None and "velocity" in some
    omega = some["velocity"] / r_drum if by_line and r_drum is not None else some.get("speed")
    if omega is None:
        return
    if "power_mech" in some and "torque" in some:
        by_torque = some["torque"] * omega
        ratio = _ratio(some["power_mech"], by_torque, by_torque if by_line else np.abs(by_torque))
        if ratio is not None:
            radius = f" velocity / r_drum, with {r_drum:g} m of the rig" if by_line else " speed"
            what = (
                f"power_mech is {ratio:#.4g} times torque x{radius}; E_mech is the integral of "
                f"power_mech: check sign, "
                f"unit and shaft of all of them{', and r_drum' if by_line else ''}"
            )
            _report(log, "power_mech", what)
    if by_line and "speed" in some:
        engaged = (
            some["torque"] > log.rig.thresholds.tau_engaged if "torque" in some else omega > 0.0
        )
        ratio = _ratio(some["speed"], omega, np.where(engaged, omega, 0.0))
        if ratio is not None:
            geared = " and the gear ratio" if log.rig.drivetrain.gear_ratio is not None else ""
            what = (
                f"speed is {ratio:#.4g} times velocity / r_drum while the clutch is engaged, with "
                f"{r_drum:g} m of the rig: the "
                f"line or the clutch slips, or an entry is wrong; check r_drum{geared}, and unit "
                f"and side of the speed"
            )
            log.findings.append(Finding("speed_mismatch", what, "reported and kept", "speed"))


def _ratio(x: Signal, y: Signal, size: Signal) -> float | None:
    """Median ratio of two signals where a size, (n,), is large; None where they agree or too few
    samples show it. [1]
    """
    known = np.isfinite(x) & np.isfinite(size)
    if not known.any():
        return None
    driven = known & (size > max(DRIVEN * quantile(size[known], 0.997), 0.0))
    if np.count_nonzero(driven) < MIN_BLOCKS:
        return None
    ratio, u = median_and_error(x[driven] / y[driven])
    return ratio if abs(ratio - 1.0) > max(2.0 * GAIN, CERTAIN_U * u) else None
