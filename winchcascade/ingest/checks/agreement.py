"""Whether channels that depend on one quantity agree: velocity and displacement, mechanical power and torque.

Velocity and displacement are averaged over blocks of a second or more: the integral of the one and the change of the
other, by their duration. Where the displacement rests the velocity's zero shows, where both move its gain. A displacement
that is set back, counts both ways or is stuck for a while makes blocks that agree with no others, and these are left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import ENOUGH, median, quantile, running, smallest_step
from winchcascade.core.run import Finding

if TYPE_CHECKING:
    from collections.abc import Mapping

    from winchcascade.core.run import Mask, Signal


BLOCK = 1.0
"""Least duration of a block: sensors' noise averages out, and a lag between the channels matters little. [s]"""

STEPS = 2.0
"""A block at the onset speed holds at least so many of the displacement's own steps."""

MOVING = 2.0
"""A block moves above this many times the onset speed, and rests below once that speed."""

FEWEST = 5
"""Smallest number of blocks that shows a deviation."""

GAIN = 0.01
"""A gain that is off by less does not matter: energies are off by as much, and drums and wheels are known no better. [1]"""

ZERO = 1 / 6
"""A zero below this share of the onset speed does not matter: 0.005 m/s, 0.6 % of a payout at 0.86 m/s. [1]"""

CERTAIN = 4.0
"""A deviation is reported from this many standard uncertainties on."""

STRAY = 5.0
"""A block that lies so many standard deviations off the others is left out,"""

ALIKE = 0.3
"""unless it is within this share of what they say: a slow sensor in a fast log makes blocks that differ by less in turn."""

FOLLOWS = 0.2
"""A speed without a sign follows the displacement within this share,"""

MOSTLY = 0.8
"""in this share of the blocks that move, and is slow where the displacement rests."""

ONE_SIDED = 0.1
"""A velocity is without a sign if it goes no farther than this share of its top to the other side of zero."""

POWER = 0.02
"""A logged power that differs from the one by torque and radius by less does not matter: radii are known no better. [1]"""

DRIVEN = 0.3
"""The shaft is driven above this share of its largest power, three samples in a thousand left out."""

AS_MOTION = 0.8
"""A zero above this share of the onset speed lets rest count as motion: noise and waves do what it lacks."""


class SpeedBlocks(msgspec.Struct, frozen=True):
    """Durations [s] of blocks, mean velocity and mean speed by the displacement in each [m/s], (k,) each."""

    seconds: Signal
    v: Signal
    by_displacement: Signal


def mean_speeds(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> SpeedBlocks:
    """Average both channels over blocks without holes and gaps; an encoder's coarse steps make the blocks longer."""
    usual = median(np.diff(t[:ENOUGH]))
    seconds = max(BLOCK, STEPS * smallest_step(displacement) / v_onset)
    step = max(1, round(min(seconds / usual, float(t.size))))
    ends = np.arange(0, t.size, step)
    length, moved = np.diff(t[ends]), np.diff(displacement[ends])
    whole = np.isfinite(moved) & (length < 1.5 * step * usual)
    if not np.isfinite(v.sum()):
        holes = np.flatnonzero(~np.isfinite(v))
        for touched in (holes // step, (holes - 1) // step):  # a sample between two blocks is of both
            whole[touched[(touched >= 0) & (touched < whole.size)]] = False
        v = v.copy()
        v[holes] = 0.0
    travelled = np.diff(running(t, v.__getitem__, ends))
    length = length[whole]
    return SpeedBlocks(length, travelled[whole] / length, moved[whole] / length)


def disagreements(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> list[Finding]:
    """Report a zero or a gain of the velocity that the displacement contradicts; neither channel is changed.

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    v, displacement : (n,) logged independently of each other, of one sign, NaN where they have holes [m/s], [m]
    v_onset : slower is rest [m/s]
    """
    blocks = mean_speeds(t, v, displacement, v_onset)
    moving = np.abs(blocks.by_displacement) > MOVING * v_onset
    if np.count_nonzero(moving) < FEWEST:
        return []
    step = smallest_step(v)
    zero, findings = 0.0, []
    at_rest = np.abs(blocks.by_displacement) < v_onset
    if np.count_nonzero(at_rest) >= FEWEST:
        found, doubt = _middle(blocks.v[at_rest] - blocks.by_displacement[at_rest])
        if abs(found) > max(ZERO * v_onset, CERTAIN * doubt, step):
            zero = found
            findings.append(_zero_finding(zero, median(blocks.by_displacement[at_rest]), v_onset))
    gain = _gain(blocks, moving, zero, step)
    return findings if gain is None else [*findings, _gain_finding(gain)]


def _middle(x: Signal) -> tuple[float, float]:
    """Median and its standard uncertainty, by the median deviation of what scatters normally."""
    middle = median(x)
    return middle, 1.4826 * median(np.abs(x - middle)) * float(np.sqrt(0.5 * np.pi / x.size))


def _gain(blocks: SpeedBlocks, moving: Mask, zero: float, step: float) -> float | None:
    """Travel by the velocity over travel by the displacement; None if that is 1 as far as it can be known. [1]"""
    along = moving & ((blocks.v - zero) * blocks.by_displacement > 0)
    seconds = blocks.seconds[along]
    speed = np.abs(blocks.by_displacement[along])
    v = np.abs(blocks.v[along] - zero)
    if speed.size < FEWEST:
        return None
    rough = median(v / speed)
    off = np.abs(v - rough * speed)
    near = off <= np.maximum(STRAY * 1.4826 * median(off), ALIKE * rough * speed)
    seconds, speed, v = seconds[near], speed[near], v[near]
    if 2 * speed.size < np.count_nonzero(moving):
        return None
    travel = float(np.dot(speed, seconds))
    gain = float(np.dot(v, seconds)) / travel
    doubt = float(np.linalg.norm((v - gain * speed) * seconds)) / travel
    coarse = 0.5 * step * float(seconds.sum()) / travel
    return gain if abs(gain - 1.0) > max(GAIN, CERTAIN * doubt, coarse) else None


def _zero_finding(zero: float, drift: float, v_onset: float) -> Finding:
    """What the velocity reads beyond a displacement that rests, or beyond one that drifts. [m/s]"""
    what = f"velocity reads {zero:+.3f} m/s while the displacement rests"
    then = "; onsets, windows and energies go with it: check its zero"
    if 2.0 * abs(drift) > abs(zero):
        what = f"velocity reads {zero + drift:+.3f} m/s where the displacement moves by {drift:+.3f} m/s"
        then = ": one of the two drifts; check the zero of both"
    elif abs(zero) > AS_MOTION * v_onset:
        then = f", and motion counts from {v_onset:g} m/s: rest may pass for motion, and a log for one that begins inside it"
        then += "; check its zero"
    return Finding("out_of_range", what + then, "reported and kept", "velocity")


def _gain_finding(gain: float) -> Finding:
    return Finding(
        "out_of_range",
        f"velocity integrates to {gain:#.4g} times the travel of the displacement; energies go with the velocity: check unit "
        f"and gain of both, and the radius at which each is taken",
        "reported and kept",
        "velocity",
    )


def power_disagrees(channels: Mapping[str, Signal], r_drum: float | None) -> list[Finding]:
    """Report a logged mechanical power that differs from what torque, velocity and the drum's radius [m] give."""
    if r_drum is None or any(name not in channels for name in ("power_mech", "torque", "velocity")):
        return []
    every = max(1, channels["velocity"].size // ENOUGH)
    logged, torque, v = (channels[name][::every] for name in ("power_mech", "torque", "velocity"))
    by_torque = torque * v / r_drum
    known = np.isfinite(logged) & np.isfinite(by_torque)
    logged, by_torque = logged[known], by_torque[known]
    if by_torque.size == 0:
        return []
    driven = by_torque > max(DRIVEN * quantile(by_torque, 0.997), 0.0)
    if np.count_nonzero(driven) < FEWEST:
        return []
    ratio, doubt = _middle(logged[driven] / by_torque[driven])
    if abs(ratio - 1.0) <= max(POWER, CERTAIN * doubt):
        return []
    return [
        Finding(
            "out_of_range",
            f"power_mech is {ratio:#.4g} times torque x velocity / r_drum, with {r_drum:g} m of the rig; E_mech goes with "
            f"power_mech: check its unit and shaft, unit and gain of the torque, and r_drum",
            "reported and kept",
            "power_mech",
        )
    ]


def without_sign(t: Signal, v: Signal, displacement: Signal, v_onset: float, stroke_min: float) -> bool:
    """Whether the velocity is a speed: of one sign, however the displacement goes, and as fast both ways."""
    low, high = float(np.nanmin(v)), float(np.nanmax(v))
    if min(abs(low), abs(high)) > ONE_SIDED * max(abs(low), abs(high)) and low < 0.0 < high:
        return False
    blocks = mean_speeds(t, v, displacement, v_onset)
    speed = np.abs(blocks.by_displacement)
    fast = speed > MOVING * v_onset
    slow = np.abs(blocks.v[speed < v_onset])
    if np.count_nonzero(fast) < 2 * FEWEST or (slow.size and median(slow) > MOVING * v_onset):
        return False
    ratio = np.abs(blocks.v[fast]) / speed[fast]
    alike = np.abs(ratio - median(ratio)) < FOLLOWS * ratio
    if np.count_nonzero(alike) < MOSTLY * alike.size:
        return False
    travel = blocks.seconds[fast][alike] * blocks.by_displacement[fast][alike] * np.sign(blocks.v[fast][alike])
    with_it, against = float(travel[travel > 0].sum()), -float(travel[travel < 0].sum())
    return min(with_it, against) > max(stroke_min, ONE_SIDED * max(with_it, against))
