"""Channels that measure one thing and differ: velocity and displacement, power, torque and speed.

Their gain is the median of their ratio where the line or the shaft is driven. No channel is
changed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from winchcascade.core.integrate import ENOUGH, median_and_error, quantile
from winchcascade.core.run import Signal
from winchcascade.ingest.checks.motion import MIN_BLOCKS, speed_blocks
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.checks.sampling import recorded_step

CERTAIN_U = 4.0
"""A deviation is reported from this many standard uncertainties on, one in 16,000 by chance. [1]"""

GAIN = 0.01
"""Smallest deviation of a gain that matters: drums and wheels are known no better. Two channels
that a radius or a gear connects may deviate by twice as much, as radii under load do. [1]"""

ZERO = 1 / 6
"""A zero of the velocity below this share of the onset speed does not matter: 0.6 % of the speed of
a payout. [1]"""

SHORT_BLOCK = 1 / 3
"""Duration of a block that shows smoothing, as a share of the width that smooths the velocity: a
quarter of a ramp. [1]"""

SMOOTHING_MIN = 1 / 6
"""Smallest standard deviation of a smoothing that is reported, as a share of the width that
detection applies: that of an average over half of it. [1]"""

DRIVEN = 0.3
"""The shaft is driven above this share of its largest power or speed, three samples in a
thousand left out. [1]"""


def of_velocity(log: PhasedLog) -> Iterator[Fault]:
    """A zero, a gain or a smoothing of the velocity that the displacement contradicts."""
    motion, onset = log.motion_gain, log.rig.thresholds.v_onset
    if motion is None:
        return
    step = recorded_step(log.run.channels["velocity"], 0.0)
    if abs(motion.zero) > max(ZERO * onset, CERTAIN_U * motion.u_zero, step):
        values = {"zero": motion.zero, "reads": motion.zero + motion.drift, "drift": motion.drift}
        drifts = 2.0 * abs(motion.drift) > abs(motion.zero)
        yield Fault("velocity_or_drift" if drifts else "zero_of_velocity", "velocity", (), values)
    rounding = 0.5 * step / log.top_speed if log.top_speed else math.inf
    if abs(motion.gain - 1.0) > max(GAIN, CERTAIN_U * motion.u_gain, rounding):
        yield Fault("gain_of_velocity", "velocity", (), {"gain": motion.gain})
    width = smoothing(log)
    if width is not None:
        yield Fault("smoothed", "velocity", (), {"seconds": math.sqrt(12.0) * width})


def smoothing(log: PhasedLog) -> float | None:
    """Standard deviation of a smoothing of the velocity that the displacement does not have; None
    if it could be chance. [s]

    A kernel of standard deviation s and mean lag adds, to second order, -lag v' + s**2 / 2 v'' to a
    velocity: least squares of the difference of the block means give both. The noise of the
    velocity itself makes the coefficient of v'' negative. A block of one interval would show the
    error of its trapezoid alone.
    """
    travel, limits = log.travel, log.rig.thresholds
    if travel is None:
        return None
    short = SHORT_BLOCK * limits.smoothing
    rows = max(1, round(short / travel.interval))
    h = rows * travel.interval
    some = slice(rows * ENOUGH + 1)
    first = travel._replace(t=travel.t[some], v=travel.v[some], x=travel.x[some])
    seconds, v, by_displacement = speed_blocks(first, rows)
    off = (v - by_displacement)[1:-1]
    rise, bend = 0.5 * (v[2:] - v[:-2]) / h, (v[2:] - 2.0 * v[1:-1] + v[:-2]) / h**2
    terms = np.column_stack((np.ones(off.size), v[1:-1], rise, bend))
    known = np.isfinite(bend) & np.isfinite(off) & (np.abs(seconds[1:-1] - h) < 0.5 * h)
    if rows < 2 or np.count_nonzero(known) < 10 * MIN_BLOCKS:
        return None
    terms, off = terms[known], off[known]
    normal = terms.T @ terms
    if np.linalg.cond(normal) > 1e12:
        return None
    inverse = np.linalg.inv(normal)
    found = inverse @ (terms.T @ off)
    left = float(np.sum((off - terms @ found) ** 2)) / (off.size - found.size)
    half_variance = (
        float(found[-1]) - travel.interval**2 / 12.0
    )  # trapezoids between samples smooth by as much
    least = 0.5 * (SMOOTHING_MIN * limits.smoothing) ** 2
    certain = 2.0 * CERTAIN_U * math.sqrt(left * float(inverse[-1, -1]))
    return math.sqrt(2.0 * half_variance) if half_variance > max(least, certain) else None


def of_shaft(log: PhasedLog) -> Iterator[Fault]:
    """A logged mechanical power that differs from torque times speed, and a speed that differs from
    that of line and radius."""
    if log.run.simulated:
        return
    radius, every = log.rig.r_drum, slice(None, None, max(1, log.run.t.size // ENOUGH))
    some = {name: x[every] for name, x in log.run.channels.items()}
    by_line = radius is not None and "velocity" in some
    omega = some["velocity"] / radius if by_line and radius is not None else some.get("speed")
    if omega is None:
        return
    torque, power, speed = (some.get(name) for name in ("torque", "power_mech", "speed"))
    if power is not None and torque is not None:
        size = torque * omega if by_line else np.abs(torque * omega)
        gain = gain_of_channel(power, torque * omega, size)
        values = {"gain": gain, "of": "velocity / r_drum" if by_line else "speed"}
        if gain is not None:
            yield Fault("gain_of_power", "power_mech", (), values)
    if by_line and speed is not None:
        engaged = omega > 0.0 if torque is None else torque > log.rig.thresholds.tau_engaged
        gain = gain_of_channel(speed, omega, np.where(engaged, omega, 0.0))
        if gain is not None:
            yield Fault("gain_of_speed", "speed", (), {"gain": gain, "radius": radius})


def gain_of_channel(x: Signal, y: Signal, size: Signal) -> float | None:
    """Median ratio of two signals where a size, (n,), is large; None where they agree or too few
    samples show it. [1]
    """
    driven = size > max(DRIVEN * quantile(size, 0.997), 0.0)
    if np.count_nonzero(driven) < MIN_BLOCKS:
        return None
    gain, u = median_and_error(x[driven] / y[driven])
    return gain if abs(gain - 1.0) > max(2.0 * GAIN, CERTAIN_U * u) else None
