"""The characteristic scales of a campaign: what its speeds, times, forces and currents are compared
with.

By similarity (Buckingham 1914) a rig of another size obeys the same laws in other units. What
decides a result is therefore a share of one of these scales or a number of the rig file. Nature
fixes a few sizes alone: the atmosphere, the density of air, the drop of a diode.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import median, quantile
from winchcascade.core.quantity import Quantity

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal

MOVES = 0.2
"""The line moves above this share of its largest speed; a stroke is more than this share of the
longest one, and a payout faster than this share of a haul-in. [1]"""

TOP = 0.9
"""Quantile of the speed of a moving line that is its top speed: braking and noise leave it
alone. [1]
"""

RAMP = (0.1, 0.9)
"""Shares of the top speed between which a ramp lasts, as rise times are given. [1]"""

SHORT = 0.25
"""Quantile of the ramps of a log that is resolved: as many are shorter, single stops among them.
[1]
"""

SHORTEST = 1 / 80
"""Shortest ramp as a share of the time of a stroke: a step of the velocity is no time to
resolve. [1]
"""

CREEPS = 0.05
"""A payout is faster than this share of the haul-in: less is noise about rest. [1]"""

NO_RAMP = 0.1
"""Ramp of a line that never stops, as a share of the time of a stroke. [1]"""

SHORTED = 0.1
"""Rated current, where it is not stated, over that of the shorted machine at high speed: as that
of the paper. [1]
"""

SILICON = 0.7
"""Drop of a silicon diode, of a rig file that states none. [V]"""


class MotionScale(msgspec.Struct, frozen=True):
    """Scales of the motion of the line.

    Parameters
    ----------
    speed : largest top speed of a payout, without any that of a haul-in [m/s]
    ramp : time in which the line passes from a tenth to nine tenths of its top speed, or back,
        where it is quick [s]
    stroke : median distance that it moves in one direction [m]
    """

    speed: float
    ramp: float
    stroke: float

    @property
    def time(self) -> float:
        """Time of a stroke at the top speed. [s]"""
        return self.stroke / self.speed


def motion_of_log(t: Signal, v: Signal) -> MotionScale | None:
    """Scales of the motion of one log; None where it does not move.

    Parameters
    ----------
    t, v : (n,) stamps that rise [s] and the velocity of the line [m/s], NaN where it is unknown

    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> motion_of_log(t, np.interp(t, [0.0, 5.0, 6.0, 14.0, 15.0], [0.0, 0.0, 2.0, 2.0, 0.0])).speed
    2.0
    """
    known = np.isfinite(v)
    t, v = t[known], v[known]
    if v.size < 3:
        return None
    top, payout = _top(np.abs(v)), _top(np.maximum(v, 0.0))
    if top == 0.0:
        return None
    stroke = max(_stroke(t, v, top), 1e-9 * top * float(t[-1] - t[0]))
    times = _ramps(t, np.abs(v) / top)
    ramp = (
        float(np.sort(times)[int(SHORT * (times.size - 1))])
        if times.size
        else NO_RAMP * stroke / top
    )
    speed = payout if payout > CREEPS * top else top
    return MotionScale(speed, max(ramp, SHORTEST * stroke / top), stroke)


def _top(speed: Signal) -> float:
    """Top speed of a line; 0 where it rests. [m/s]"""
    moving = speed[speed > MOVES * float(np.max(speed))]
    return quantile(moving, TOP) if moving.size else 0.0


def _stroke(t: Signal, v: Signal, top: float) -> float:
    """Median travel of the stretches in which a line moves in one direction, without short ones:
    neither many strokes of one direction nor the drift of a zero add up. [m]
    """
    side = np.where(np.abs(v) > RAMP[0] * top, np.sign(v), 0.0)
    first = np.flatnonzero(np.diff(side, prepend=0.0))
    travelled = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))))
    travel = np.abs(np.diff(travelled[np.append(first, v.size - 1)]))[side[first] != 0.0]
    return median(travel[travel > MOVES * np.max(travel)]) if travel.any() else 0.0


def _ramps(t: Signal, speed: Signal) -> Signal:
    """Times in which the speed, as a share of its top, passes from one of `RAMP` to the other,
    (k,). [s]
    """
    side = np.where(speed < RAMP[0], -1, np.where(speed > RAMP[1], 1, 0))
    ends = np.flatnonzero(side)
    begin, end = (ends[:-1], ends[1:]) if ends.size else (ends, ends)
    turns = side[begin] != side[end]
    begin, end = begin[turns], end[turns]
    leaves = np.where(side[begin] < 0, *RAMP)
    reaches = np.where(side[begin] < 0, *RAMP[::-1])
    return _passed(t, speed, end - 1, reaches) - _passed(t, speed, begin, leaves)


def _passed(t: Signal, x: Signal, k: np.ndarray, level: Signal) -> Signal:
    """When x passes a level between samples k and k + 1, by a straight line, (j,). [s]"""
    share = (level - x[k]) / (x[k + 1] - x[k])
    return np.asarray(t[k] + np.clip(share, 0.0, 1.0) * (t[k + 1] - t[k]))


def motion_of_runs(runs: Iterable[Run]) -> MotionScale:
    """Scales of the motion of several logs: the largest top speed, the median ramp and stroke;
    of 1 where none moves.
    """
    each = [
        motion_of_log(run.t, run.channels["velocity"]) for run in runs if "velocity" in run.channels
    ]
    known = [motion for motion in each if motion is not None]
    if not known:
        return MotionScale(1.0, 1.0, 1.0)
    speeds, ramps, strokes = (
        np.array([getattr(one, name) for one in known]) for name in MotionScale.__struct_fields__
    )
    return MotionScale(float(speeds.max()), median(ramps), median(strokes))


class Scales(msgspec.Struct, frozen=True):
    """Scales of a campaign on a rig, SI units; NaN where the rig file lacks a number that one
    follows from.

    Parameters
    ----------
    motion : of the line
    current : rated stator current, rms [A]
    torque_rotor : torque of the machine at that current [N m]
    torque : the same on the PTO shaft, `torque_drum` with that of the restoring module, at the drum
        [N m]
    omega_rotor, omega_drum : speeds at the top speed of the line [rad/s]
    voltage : back-EMF there, line to line, rms [V]
    thrust : of the gas on the piston at zero payout, of a spring or a counterweight its force [N]
    onset : speed of the line at which a payout begins, as the rig file states it [m/s]
    volume, inertia : of the gas [m3], and at the drum [kg m2], as the rig file states them
    diode : drop of a diode [V]
    """

    motion: MotionScale
    current: float
    torque_rotor: float
    torque: float
    torque_drum: float
    omega_rotor: float
    omega_drum: float
    voltage: float
    thrust: float
    onset: float
    volume: float
    inertia: float
    diode: float

    @property
    def speed(self) -> float:
        """Top speed of the line. [m/s]"""
        return self.motion.speed

    @property
    def ramp(self) -> float:
        """Time in which the line speeds up. [s]"""
        return self.motion.ramp

    @property
    def stroke(self) -> float:
        """Distance between the ends of the motion. [m]"""
        return self.motion.stroke

    @property
    def tension(self) -> float:
        """Line tension that balances machine and restoring module. [N]"""
        return self.torque_drum * self.omega_drum / self.speed

    def of(self, name: str) -> float:
        """A product of scales and of inverse ones: `torque_rotor / omega_rotor`; 1 for no name.
        [SI]

        >>> Scales(MotionScale(2.0, 1.0, 1.0), *[4.0] * 12).of("torque * ramp / omega_drum")
        1.0
        """
        first, *below = name.split("/")
        value = math.prod(getattr(self, word.strip()) for word in first.split("*") if word.strip())
        for word in below:
            value /= getattr(self, word.strip())
        return float(value)


def scales_of(rig: Rig, motion: MotionScale) -> Scales:
    """Scales of a campaign on a rig."""
    radius, gear = _value(rig.r_drum), _number(rig.drivetrain.gear_ratio)
    omega_drum = motion.speed / radius
    omega_rotor = omega_drum * gear
    per_speed, current = _number(rig.generator.k_e) * 30.0 / math.pi, rated_current(rig)
    torque_rotor = math.sqrt(3.0) * per_speed * current
    thrust, held = _restoring(rig, motion, radius)
    return Scales(
        motion=motion,
        current=current,
        torque_rotor=torque_rotor,
        torque=torque_rotor * gear,
        torque_drum=torque_rotor * gear + held,
        omega_rotor=omega_rotor,
        omega_drum=omega_drum,
        voltage=per_speed * omega_rotor,
        thrust=thrust,
        onset=rig.thresholds.v_onset,
        volume=_number(rig.restoring.volume_gas),
        inertia=_number(rig.winch.inertia),
        diode=0.0 if rig.generator.v_diode is None else rig.generator.v_diode.value or SILICON,
    )


def rated_current(rig: Rig) -> float:
    """Rated stator current of a rig, rms: as stated, or from k_e and reactance; NaN where these
    are not stated. [A]
    """
    machine = rig.generator
    if machine.i_rated is not None:
        return machine.i_rated.value
    flux = _number(machine.k_e) * 30.0 / math.pi / math.sqrt(3.0)
    inductance = _number(machine.pole_pairs) * _number(machine.l_s)
    return SHORTED * flux / inductance if inductance != 0.0 else math.inf


def _restoring(rig: Rig, motion: MotionScale, radius: float) -> tuple[float, float]:
    """Thrust of the restoring module [N], and its torque at the drum [N m]."""
    part = rig.restoring
    if part.kind == "gas_screw":
        thrust = _number(part.p_precharge) * _number(part.area_piston)
        return thrust, thrust * _number(part.lead) / (2.0 * math.pi)
    force = _number(part.mass) if part.kind == "counterweight" else 0.0
    if part.kind == "spring":
        force = _number(part.force) + 0.5 * _number(part.stiffness) * motion.stroke
    return force, force * radius


def _number(number: Quantity | None) -> float:
    return math.nan if number is None else number.value


def _value(number: float | None) -> float:
    return math.nan if number is None else number
