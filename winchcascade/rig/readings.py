"""What the sensors of a rig read along a line motion at even steps."""

import math
from typing import NamedTuple

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.kernel import LINE, LineMotion, run_line
from winchcascade.rig.parts import Sensors
from winchcascade.rig.simulate import READ
from winchcascade.rig.state import Constants


class Path(NamedTuple):
    """A motion of the line, and the direction of friction along it, (n,): once for all models
    [1].
    """

    motion: LineMotion
    direction: Signal


def path_of(motion: LineMotion) -> Path:
    """A motion with the direction of friction."""
    return Path(motion, physics.direction(motion.v, motion.rest))


def recorded(
    path: Path, numbers: Constants, shaft: Signal, sensors: Sensors
) -> tuple[Signal, Signal, Signal, Signal]:
    """Pressure, force, torque and Vdc along a solution of the shaft, (n,) each, SI units, without
    gains and zeros of sensors.

    Parameters
    ----------
    shaft : (2, n) torque of the clutch [N m] and Vdc [V]
    """
    line = np.empty((path.direction.size, len(LINE)))
    run_line(path.motion, path.direction, numbers, shaft[0], line)
    pressure, force, torque = (line[:, LINE.index(name)] for name in READ[:3])
    vdc = late(shaft[1], sensors.electrical_lag / path.motion.step)
    return pressure, physics.tension(force, numbers.winch), torque, vdc


def readings(
    path: Path, numbers: Constants, shaft: Signal, sensors: Sensors, skew: Signal | None = None
) -> Signal:
    """Read the sensors along a solution of the shaft, (5, n): the channels `READ`, SI units.

    Parameters
    ----------
    shaft : (2, n) torque of the clutch [N m] and Vdc [V]
    skew : (5,) how late each channel is read [s]
    """
    *true, vdc = recorded(path, numbers, shaft, sensors)
    true += [vdc, vdc / numbers.shaft.load]
    delays = np.zeros(len(READ)) if skew is None else skew / path.motion.step
    return np.array(
        [sensors.read(name, late(x, by)) for name, x, by in zip(READ, true, delays, strict=True)]
    )


def late(x: Signal, steps: float) -> Signal:
    """A signal at even steps, (n,), read late by a number of steps, by straight lines; its ends are
    extended.

    >>> late(np.array([0.0, 2.0, 4.0]), 0.5)
    array([0., 1., 3.])
    """
    if steps == 0.0:
        return x
    before = np.arange(x.size) - math.floor(steps) - 1
    low, high = (x[np.clip(at, 0, x.size - 1)] for at in (before, before + 1))
    return low + (1.0 - (steps - math.floor(steps))) * (high - low)
