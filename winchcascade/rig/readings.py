"""What the sensors of a rig read along a line motion, compiled."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from winchcascade.core.run import Signal
from winchcascade.rig.bridge import FASTMATH
from winchcascade.rig.kernel import LINE, Constants, LineMotion, directions, run_line
from winchcascade.rig.parts import ELECTRICAL, Model
from winchcascade.rig.simulate import READ

_LAG, _LATE, _FACTOR, _ZERO = range(4)
_VDC, _IDC = (READ.index(name) for name in ELECTRICAL)
_ELECTRICAL = len(LINE)

TRUE = len(LINE) + len(ELECTRICAL)
"""Rows of what sensors read before their errors: the columns of `kernel.LINE`, then Vdc and Idc."""


class Path(NamedTuple):
    """A motion of the line, and the direction of friction along it, (n,): once for all models [1]."""

    motion: LineMotion
    direction: Signal


def path_of(motion: LineMotion) -> Path:
    """A motion with the direction of friction."""
    return Path(motion, directions(motion.v))


def sensor_numbers(model: Model, skew: Signal, step: float) -> Signal:
    """Lag and delay in steps, factor and zero of each sensor, (4, 5), SI units.

    Parameters
    ----------
    skew : (5,) how late each channel is read [s]
    step : of the solution that is read [s]
    """
    own = model.sensors
    lag = [own.electrical_lag / step if name in ELECTRICAL else 0.0 for name in READ]
    factor = [1.0 + own.gain.get(name, 0.0) for name in READ]
    return np.array([lag, skew / step, factor, [own.zero.get(name, 0.0) for name in READ]])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def _recorded(x: Signal, steps: float, factor: float, zero: float, out: Signal) -> None:
    """A signal at even steps, read late by `steps`, which need not be whole, by straight lines; its ends are extended."""
    if steps == 0.0:
        for n in range(x.size):
            out[n] = x[n] * factor + zero
        return
    whole, last = math.floor(steps), x.size - 1
    share = 1.0 - (steps - whole)
    for n in range(x.size):
        k = n - whole - 1
        then = x[0] if k < 0 else x[last] if k >= last else x[k] + share * (x[k + 1] - x[k])
        out[n] = then * factor + zero


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_readings(path: Path, c: Constants, shaft: Signal, sensors: Signal, true: Signal, out: Signal) -> None:
    """Read the sensors along a solution of the shaft.

    Parameters
    ----------
    shaft : (2, n) torque of the clutch [N m] and Vdc [V]
    sensors : (4, 5) as `sensor_numbers` gives them
    true : (6, n) is used for what the sensors read
    out : (5, n) is filled with the channels `READ`, SI units
    """
    run_line(path.motion, path.direction, c, shaft[0], true[: len(LINE)].T)
    for k in range(_VDC, len(READ)):
        _recorded(shaft[1], sensors[_LAG, k], 1.0, 0.0, true[_ELECTRICAL + k - _VDC])
    true[_ELECTRICAL + _IDC - _VDC] /= c.load
    for k in range(len(READ)):
        place = k if k < _VDC else _ELECTRICAL + k - _VDC
        _recorded(true[place], sensors[_LATE, k], sensors[_FACTOR, k], sensors[_ZERO, k], out[k])
