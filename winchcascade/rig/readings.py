"""What the sensors of a rig read along a line motion, compiled: by one model, or by many that differ little from one."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from winchcascade.core.run import Signal
from winchcascade.rig.bridge import FASTMATH
from winchcascade.rig.kernel import LINE, Constants, LineMotion, directions, run_line
from winchcascade.rig.parts import ELECTRICAL, ROLLOFF_KNOTS, Model
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


class Averages(NamedTuple):
    """Weighted sums of a signal: sum k takes `weights` from `first[k]` to `first[k + 1]` of the samples `places`."""

    first: NDArray[np.intp]
    places: NDArray[np.intp]
    weights: Signal


class Shafts(NamedTuple):
    """Solutions of the shaft for some models, and derivatives by which others follow to first order.

    `solved` (s, 2, n) are torque of the clutch [N m] and Vdc [V], `slopes` (2, w, n) their derivatives over w numbers. Model k
    has the solution `of[k]`, and its numbers differ by `moves[k]`, (w,); where `of[k]` is negative, nothing differs.
    """

    solved: Signal
    slopes: Signal
    of: NDArray[np.intp]
    moves: Signal


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


_RECORD = np.dtype(
    [
        (name, np.float64, (len(ROLLOFF_KNOTS),) if name in ("rolloff", "rolloff_slope") else ())
        for name in Constants._fields
    ]
)
"""Fields of `Constants` in a row."""


def records_of(numbers: Sequence[Constants]) -> NDArray[np.void]:
    """Numbers of several models as the records of an array, which compiled loops take, (k,)."""
    return np.array(numbers, dtype=_RECORD)


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


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_differences(
    path: Path, numbers: NDArray[np.void], shafts: Shafts, sensors: Signal, averages: Averages, out: Signal
) -> None:
    """Compute what models read beyond the first of them, as averages.

    Parameters
    ----------
    numbers : (k,) of the models
    sensors : (k, 4, 5) as `sensor_numbers` gives them
    out : (m, 5, k - 1) is filled with the averages of what all but the first model read beyond it
    """
    size = path.direction.size
    here, there, true = np.empty((len(READ), size)), np.empty((len(READ), size)), np.empty((TRUE, size))
    shaft = np.empty((2, size))
    run_readings(path, numbers[0], shafts.solved[shafts.of[0]], sensors[0], true, here)
    for k in range(1, numbers.size):
        if shafts.of[k] < 0:
            out[:, :, k - 1] = 0.0
            continue
        shaft[:] = shafts.solved[shafts.of[k]]
        for j in range(shafts.moves.shape[1]):
            move = shafts.moves[k, j]
            if move != 0.0:
                for row in range(2):
                    for n in range(size):
                        shaft[row, n] += move * shafts.slopes[row, j, n]
        run_readings(path, numbers[k], shaft, sensors[k], true, there)
        for channel in range(len(READ)):
            for n in range(size):
                there[channel, n] -= here[channel, n]
            for m in range(averages.first.size - 1):
                total = 0.0
                for i in range(averages.first[m], averages.first[m + 1]):
                    total += averages.weights[i] * there[channel, averages.places[i]]
                out[m, channel, k - 1] = total
