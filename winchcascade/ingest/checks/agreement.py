"""Whether channels that depend on one quantity agree in sign, zero and gain: velocity and displacement, power and torque.

Velocity and displacement are averaged over blocks of a second or more: the integral of the one and the change of the
other, by their duration. Blocks in which the displacement rests show the zero of the velocity, blocks in which both move
show its gain. A displacement that is set back, counts both ways or is stuck makes a few blocks that deviate from the
others; these are left out. Channels that are logged with the opposite sign are found by physics, not by their first sample.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import numpy as np

from winchcascade.core.integrate import (
    ENOUGH,
    GAUSS,
    ends_of,
    median,
    median_and_error,
    quantile,
    running,
    smallest_step,
)
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Mask, Repair, Signal

BLOCK = 1.0
"""Minimum duration of a block: noise of the sensors averages out, and a lag between the channels matters little. [s]"""

STEPS = 2.0
"""Minimum number of steps of the displacement in a block at the onset speed."""

MOVING = 2.0
"""A block moves above this many times the onset speed, and rests below once that speed."""

MIN_BLOCKS = 5
"""Smallest number of blocks that shows a deviation."""

GAIN = 0.01
"""Smallest deviation of a gain that matters: drums and wheels are known no better. Energies deviate by as much. [1]"""

ZERO = 1 / 6
"""A zero below this share of the onset speed does not matter: 0.005 m/s, 0.6 % of a payout at 0.86 m/s. [1]"""

CERTAIN = 4.0
"""A deviation is reported from this many standard uncertainties on."""

STRAY = 5.0
"""Standard deviations beyond which a block that deviates from the others is left out."""

ALIKE = 0.3
"""A block that deviates by less than this share stays: a slow sensor in a fast log makes blocks that differ by less in turn."""

FOLLOWS = 0.2
"""A speed without a sign follows the displacement within this share. [1]"""

MOSTLY = 0.8
"""Share of the blocks that move in which it does so; it is slow where the displacement rests. [1]"""

ONE_SIDED = 0.1
"""A velocity is without a sign if it goes no farther than this share of its top to the other side of zero."""

POWER = 0.02
"""A logged power that differs from the one by torque and radius by less does not matter: radii are known no better. [1]"""

SPEED = 0.02
"""A speed of rotation that differs from the one by line velocity and radius by less does not matter, as for the power. [1]"""

DRIVEN = 0.3
"""The shaft is driven above this share of its largest power, three samples in a thousand left out."""

AS_MOTION = 0.8
"""A zero above this share of the onset speed lets rest count as motion: noise and waves do what it lacks."""

FAST = 0.3
"""Samples faster than this share of the top speed distinguish payout from haul-in."""

CLEAR = 1.2
"""A channel votes if it is this many times as large in one direction as in the other."""

IDLE = {"force": 20.0, "torque": 2.0, "power_mech": 20.0, "vdc": 5.0, "idc": 0.03, "speed": 0.5}
"""What a channel of the other sign must exceed to be called flipped: well above zeros and noise. [N, N m, W, V, A, rad/s]"""

SIGN_CORRECTED = "sign corrected"
"""Action on a channel that is logged with the opposite sign."""

VACUUM = -1.05e5
"""No gauge pressure lies below it. [Pa]"""


class SpeedBlocks(msgspec.Struct, frozen=True):
    """Durations [s] of blocks, mean velocity and mean speed by the displacement in each [m/s], (k,) each."""

    seconds: Signal
    v: Signal
    by_displacement: Signal


def mean_speeds(t: Signal, v: Signal, displacement: Signal, v_onset: float) -> SpeedBlocks:
    """Average both channels over blocks without holes and gaps; coarse steps of an encoder make the blocks longer."""
    usual = median(np.diff(t[:ENOUGH]))
    step = max(1, round(min(max(BLOCK, STEPS * smallest_step(displacement) / v_onset) / usual, float(t.size))))
    ends = np.arange(0, t.size, step)
    length, moved = np.diff(t[ends]), np.diff(displacement[ends])
    whole = np.isfinite(moved) & (length < 1.5 * step * usual)
    if not np.isfinite(v.sum()):
        holes = np.flatnonzero(~np.isfinite(v))
        for touched in (holes // step, (holes - 1) // step):  # a sample between two blocks is of both
            whole[touched[(touched >= 0) & (touched < whole.size)]] = False
        v = np.where(np.isfinite(v), v, 0.0)
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
    if np.count_nonzero(moving) < MIN_BLOCKS:
        return []
    step = smallest_step(v)
    zero, findings = 0.0, []
    at_rest = np.abs(blocks.by_displacement) < v_onset
    if np.count_nonzero(at_rest) >= MIN_BLOCKS:
        found, u = median_and_error(blocks.v[at_rest] - blocks.by_displacement[at_rest])
        if abs(found) > max(ZERO * v_onset, CERTAIN * u, step):
            zero = found
            findings.append(_reported("velocity", _zero_text(zero, median(blocks.by_displacement[at_rest]), v_onset)))
    gain = _gain(blocks, moving, zero, step)
    if gain is not None:
        what = (
            f"velocity integrates to {gain:#.4g} times the travel of the displacement; energies are proportional to the "
            f"velocity: check unit and gain of both, and the radius at which each is taken"
        )
        findings.append(_reported("velocity", what))
    return findings


def _reported(channel: str, message: str) -> Finding:
    return Finding("out_of_range", message, "reported and kept", channel)


def _gain(blocks: SpeedBlocks, moving: Mask, zero: float, step: float) -> float | None:
    """Travel by the velocity over travel by the displacement; None if that is 1 within its uncertainty. [1]"""
    along = moving & ((blocks.v - zero) * blocks.by_displacement > 0)
    if np.count_nonzero(along) < MIN_BLOCKS:
        return None
    speed = np.abs(blocks.by_displacement[along])
    v = np.abs(blocks.v[along] - zero)
    rough = median(v / speed)
    beyond = np.abs(v - rough * speed)
    near = beyond <= np.maximum(STRAY * GAUSS * median(beyond), ALIKE * rough * speed)
    if 2 * np.count_nonzero(near) < np.count_nonzero(moving):
        return None
    seconds, speed, v = blocks.seconds[along][near], speed[near], v[near]
    travel = float(np.dot(speed, seconds))
    gain = float(np.dot(v, seconds)) / travel
    u = float(np.linalg.norm((v - gain * speed) * seconds)) / travel
    return gain if abs(gain - 1.0) > max(GAIN, CERTAIN * u, 0.5 * step * float(seconds.sum()) / travel) else None


def _zero_text(zero: float, drift: float, v_onset: float) -> str:
    """What the velocity reads beyond a displacement that rests, or beyond one that drifts. [m/s]"""
    if 2.0 * abs(drift) > abs(zero):
        return (
            f"velocity reads {zero + drift:+.3f} m/s where the displacement moves by {drift:+.3f} m/s: one of the two drifts; "
            f"check the zero of both"
        )
    at_rest = f"velocity reads {zero:+.3f} m/s while the displacement rests"
    if abs(zero) > AS_MOTION * v_onset:
        return (
            f"{at_rest}, and motion counts from {v_onset:g} m/s: rest may pass for motion, and a log for one that begins "
            f"inside it; check its zero"
        )
    return f"{at_rest}; onsets, windows and energies deviate with it: check its zero"


def power_disagrees(channels: Mapping[str, Signal], r_drum: float | None) -> list[Finding]:
    """Report a logged mechanical power that differs from what torque, velocity and drum radius [m] give.

    Without velocity or radius, torque and speed of rotation give it.
    """
    by_line = r_drum is not None and "velocity" in channels
    names = ("power_mech", "torque", "velocity" if by_line else "speed")
    if any(name not in channels for name in names):
        return []
    every = max(1, channels["torque"].size // ENOUGH)
    logged, torque, motion = (channels[name][::every] for name in names)
    by_torque = torque * motion / (r_drum if by_line and r_drum is not None else 1.0)
    known = np.isfinite(logged) & np.isfinite(by_torque)
    if not known.any():
        return []
    if by_line:
        driven = known & (by_torque > max(DRIVEN * quantile(by_torque[known], 0.997), 0.0))
    else:  # a machine may be driven or drive
        size = np.abs(by_torque)
        driven = known & (size > max(DRIVEN * quantile(size[known], 0.997), 0.0))
    if np.count_nonzero(driven) < MIN_BLOCKS:
        return []
    ratio, u = median_and_error(logged[driven] / by_torque[driven])
    what = (
        f"power_mech is {ratio:#.4g} times torque x velocity / r_drum, with {r_drum:g} m of the rig; E_mech is the integral of "
        f"power_mech: check its unit and shaft, unit and gain of the torque, and r_drum"
        if by_line
        else f"power_mech is {ratio:#.4g} times torque x speed; E_mech is the integral of power_mech: check its sign, unit and "
        f"shaft, and sign, unit and gain of torque and speed"
    )
    return [_reported("power_mech", what)] if abs(ratio - 1.0) > max(POWER, CERTAIN * u) else []


def speed_disagrees(channels: Mapping[str, Signal], rig: Rig) -> list[Finding]:
    """Report a speed of rotation that differs from the one by line velocity and drum radius while the clutch is engaged.

    A speed that is derived, or that differs by chance, is not reported; neither channel is changed.
    """
    if rig.r_drum is None or any(name not in channels for name in ("speed", "velocity")):
        return []
    every = max(1, channels["velocity"].size // ENOUGH)
    omega, by_line = channels["speed"][::every], channels["velocity"][::every] / rig.r_drum
    known = np.isfinite(omega) & np.isfinite(by_line)
    torque = channels.get("torque")
    engaged = known if torque is None else known & (torque[::every] > rig.thresholds.tau_engaged)
    if not engaged.any():
        return []
    driven = engaged & (by_line > max(FAST * quantile(by_line[known], 0.997), 0.0))
    if np.count_nonzero(driven) < MIN_BLOCKS:
        return []
    ratio, u = median_and_error(omega[driven] / by_line[driven])
    if abs(ratio - 1.0) <= max(SPEED, CERTAIN * u):
        return []
    geared = " and the gear ratio" if rig.drivetrain.gear_ratio is not None else ""
    what = (
        f"speed is {ratio:#.4g} times velocity / r_drum while the clutch is engaged, with {rig.r_drum:g} m of the rig: the "
        f"line or the clutch slips, or an entry is wrong; check r_drum{geared}, and unit and side of the speed"
    )
    return [Finding("speed_mismatch", what, "reported and kept", "speed")]


def without_sign(t: Signal, v: Signal, displacement: Signal, v_onset: float, stroke_min: float) -> bool:
    """Whether the velocity is a speed: of one sign, however the displacement goes, and as fast both ways."""
    low, high = ends_of(v)
    if low < 0.0 < high and min(-low, high) > ONE_SIDED * max(-low, high):
        return False
    blocks = mean_speeds(t, v, displacement, v_onset)
    speed = np.abs(blocks.by_displacement)
    fast = speed > MOVING * v_onset
    slow = np.abs(blocks.v[speed < v_onset])
    if np.count_nonzero(fast) < 2 * MIN_BLOCKS or (slow.size and median(slow) > MOVING * v_onset):
        return False
    ratio = np.abs(blocks.v[fast]) / speed[fast]
    alike = np.abs(ratio - median(ratio)) < FOLLOWS * ratio
    if np.count_nonzero(alike) < MOSTLY * alike.size:
        return False
    travel = (blocks.seconds * blocks.by_displacement * np.sign(blocks.v))[fast][alike]
    with_it, against = float(travel[travel > 0].sum()), -float(travel[travel < 0].sum())
    return min(with_it, against) > max(stroke_min, ONE_SIDED * max(with_it, against))


def correct_signs(channels: dict[str, Signal]) -> list[Finding]:
    """Correct the sign of channels that are logged with the opposite one, in place; the findings name them.

    Line tension, torque and voltage are larger in payout, and the pressure rises with it: the majority of them decides the
    sign of the velocity. The displacement follows the velocity; forces, torques and powers are positive in payout.
    """
    flipped: dict[str, str] = {}
    some = {name: x[:: max(1, x.size // ENOUGH)] for name, x in channels.items()}
    v = _or_nothing(some["velocity"])
    if "pressure" in some and _median(some["pressure"]) < VACUUM:
        some["pressure"] = -some["pressure"]
        flipped["pressure"] = "it lies below the vacuum"
    if _paid_out_negative(some, v):
        v = -v
        flipped["velocity"] = "payout is logged as negative"
    if "displacement" in some and _follows(some["displacement"], v) < 0:
        flipped["displacement"] = "it falls while the line pays out"
    out = _fast(v)
    for name, minimum in IDLE.items():
        if name in some and _median(some[name][out]) < -minimum:
            flipped[name] = "it is negative while the line pays out"
    channels |= {name: -channels[name] for name in flipped}
    return [
        Finding(
            "sign_flipped",
            f"{name} has the opposite sign: {why}",
            SIGN_CORRECTED,
            name,
            repair=Repair(SIGN_CORRECTED, channels[name].size),
        )
        for name, why in flipped.items()
    ]


def _fast(v: Signal) -> Mask:
    """Samples that move outward at more than a share of the top speed in that direction."""
    return v > max(FAST * float(np.max(v, initial=0.0)), 1e-6)


def _paid_out_negative(some: Mapping[str, Signal], v: Signal) -> bool:
    """Whether most channels show that the line pays out where its velocity is negative.

    The line tension votes only if both directions were logged; torque and voltage also by their absence.
    """
    up, down = _fast(v), _fast(-v)
    votes = 0
    for name in ("force", "torque", "vdc"):
        if name not in some or (name == "force" and not (up.any() and down.any())):
            continue
        large, small = (_median(np.abs(some[name][part])) for part in (up, down))
        if max(large, small) > IDLE[name]:
            votes += int(large > CLEAR * small) - int(small > CLEAR * large)
    if "pressure" in some:
        votes += _follows(some["pressure"], v)
    return votes < 0


def _follows(x: Signal, v: Signal) -> int:
    """Sign of how a channel changes with the velocity, 0 if that could be noise."""
    change = _or_nothing(np.diff(x))
    together = float(np.dot(change, v[1:]))
    by_chance = float(np.linalg.norm(change) * np.linalg.norm(v)) / np.sqrt(v.size)
    return int(np.sign(together)) if abs(together) > CERTAIN * by_chance else 0


def _median(x: Signal) -> float:
    """Median of what is finite; 0 where nothing is, as when the line never moves that way."""
    if not np.isfinite(x.sum()):
        x = x[np.isfinite(x)]
    return median(x) if x.size else 0.0


def _or_nothing(x: Signal) -> Signal:
    """Values, 0 where there is none."""
    return x if np.isfinite(x.sum()) else np.nan_to_num(x)
