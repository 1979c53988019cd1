"""What the model says of a log's blocks, as fast as a fit needs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.bridge import bridge_table
from winchcascade.rig.kernel import LINE, SHAFT, constants, run_line, run_shaft
from winchcascade.rig.simulate import LineMotion, motion_of
from winchcascade.rig.tangent import MOST_WAYS, Tangent, direction, tangent_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_array

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.block_means import Blocks
    from winchcascade.rig.kernel import Constants
    from winchcascade.rig.parts import Model

CHANNELS = ("pressure", "force", "torque", "vdc", "idc")
"""Channels that are compared, in the order of the columns of every block array."""

COARSE = 2.5e-3
"""Step of the solutions that a fit compares with one another. [s]"""

GRID = 0.01
"""Solutions are kept at this spacing. [s]"""


class Kept(msgspec.Struct, frozen=True):
    """A solution of the shaft on the grid, (n,) each: torque of the clutch, Vdc, Idc, stator and bridge current. SI units."""

    clutch: Signal
    vdc: Signal
    idc: Signal
    i_s: Signal
    i_bridge: Signal


class Course:
    """The line motion of one log, ready to be simulated many times, and its blocks.

    Solutions of the shaft are kept by the numbers that they depend on: an effect of the gas costs none anew.
    """

    def __init__(self, run: Run, blocks: Blocks, step: float = COARSE) -> None:
        self.run, self.blocks = run, blocks
        self.load = math.inf if run.load is None else run.load
        self.motion = motion_of(run, step)
        self.every = max(round(GRID / step), 1)
        self.coarse = _thinned(self.motion, self.every)
        self.matrix = _averaging(run, blocks, self.coarse.t)
        self._kept: dict[tuple[float | tuple[float, ...], ...], Kept] = {}
        self._tangent: Tangent | None = None

    def shaft(self, numbers: Constants, gain: float = 1.0) -> Kept:
        """Solve the shaft, or take the solution of the same numbers; `gain` scales the line's velocity."""
        key = (gain, *_of_the_shaft(numbers))
        found = self._kept.get(key)
        if found is None:
            out = self._solve(numbers, gain)
            thin = np.ascontiguousarray(out[:: self.every].T)
            found = Kept(*(thin[SHAFT.index(name)] for name in _KEPT))
            if len(self._kept) >= MOST_KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = found
        return found

    def _solve(self, numbers: Constants, gain: float = 1.0) -> Signal:
        out = np.empty((self.motion.t.size, len(SHAFT)))
        run_shaft(self.motion.v * gain, self.motion.step, numbers, bridge_table(), out)
        return out

    def tangent(self, numbers: Constants, others: Sequence[Constants]) -> Tangent:
        """Differentiate the shaft's solution of some numbers, so that all others follow to first order."""
        known = self._tangent
        if known is not None and _of_the_shaft(known.numbers) != _of_the_shaft(numbers):
            known = None
        ways = [way for way in dict.fromkeys(direction(numbers, other) for other in others) if any(way)]
        if known is not None and all(way in known.directions for way in ways):
            return known
        if known is not None:
            ways = list(dict.fromkeys((*ways, *known.directions)))[:MOST_WAYS]
        motion = self.motion
        self._tangent = tangent_of(
            motion.v, motion.step, numbers, bridge_table(), self._solve(numbers), self.every, ways
        )
        return self._tangent

    def on_grid(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read along the course, (n, 5) on the grid: columns of `CHANNELS`, SI units.

        Parameters
        ----------
        gain : scales the velocity that drives the shaft [1]
        skew : (5,) how late each channel is read [s]
        """
        numbers = constants(model, self.load)
        kept = self.shaft(numbers, gain)
        return self._read(model, numbers, kept.clutch, kept.vdc, skew)

    def _read(self, model: Model, numbers: Constants, clutch: Signal, vdc: Signal, skew: Signal | None) -> Signal:
        """What the sensors read, (n, 5), as `on_grid`, of a solution of the shaft."""
        at, sensors = self.coarse, model.sensors
        line = np.empty((at.t.size, len(LINE)))
        run_line(at.x, at.v, at.a, at.step, numbers, clutch, line)
        seen = np.empty((at.t.size, len(CHANNELS)))
        late = np.zeros(len(CHANNELS)) if skew is None else skew
        for k, name in enumerate(CHANNELS):
            x = line[:, k] if k < ELECTRICAL else vdc if name == "vdc" else vdc / numbers.load
            if k >= ELECTRICAL:
                x = delayed(x, sensors.electrical_lag / at.step)
            seen[:, k] = sensors.read(name, delayed(x, float(late[k]) / at.step))
        return seen

    def differences(
        self, model: Model, others: Sequence[Model], skew: Signal | None = None, skews: Sequence[Signal] | None = None
    ) -> Signal:
        """What other models, near to one, read beyond it, (m, 5, k) as means of blocks.

        The shaft follows to first order but for the numbers that bend it too much, with which it is solved anew.

        Parameters
        ----------
        skew : (5,) how late each channel is read [s]
        skews : the same for each of the others; as `skew` by default
        """
        numbers, here = [constants(other, self.load) for other in others], constants(model, self.load)
        kept = self.shaft(here)
        base = self._read(model, here, kept.clutch, kept.vdc, skew)
        moved = np.empty((*base.shape, len(others)))
        still = _of_the_shaft(here)
        near = [there for there in numbers if _of_the_shaft(there) != still and not _far(here, there)]
        tangent = self.tangent(here, near) if near else None
        for k, (other, there) in enumerate(zip(others, numbers, strict=True)):
            late = skew if skews is None else skews[k]
            clutch, vdc = kept.clutch, kept.vdc
            if _far(here, there):
                solved = self.shaft(there)
                clutch, vdc = solved.clutch, solved.vdc
            elif tangent is not None and _of_the_shaft(there) != still:
                by_clutch, by_vdc = tangent.change(there)
                clutch, vdc = clutch + by_clutch, vdc + by_vdc
            moved[:, :, k] = self._read(other, there, clutch, vdc, late) - base
        means: Signal = self.matrix @ moved.reshape(base.shape[0], -1)
        return means.reshape(-1, len(CHANNELS), len(others))

    def predict(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read, as means of the blocks, (m, 5), with the parameters of `on_grid`."""
        means: Signal = self.matrix @ self.on_grid(model, gain, skew)
        return means

    def block_mean(self, on_grid: Signal) -> Signal:
        """Mean over the blocks of something on the grid, (m,)."""
        means: Signal = self.matrix @ on_grid
        return means


_SHAFT_FROM = 14
"""Numbers of `Constants` from here on concern the shaft; `test_predict` holds it."""

_KEPT = ("clutch", "vdc", "idc", "i_s", "i_bridge")

ELECTRICAL = CHANNELS.index("vdc")
"""Channels from here on are electrical: their lag is common."""


def _of_the_shaft(numbers: Constants) -> tuple[float | tuple[float, ...], ...]:
    return (numbers.r_drum, *numbers[_SHAFT_FROM:])


def _far(here: Constants, there: Constants) -> bool:
    """Whether a number differs that no first order serves: dry friction stops a shaft for good, and a capacitor that differs
    by its tolerance empties by another exponential.
    """
    return here.friction != there.friction or here.c_dc != there.c_dc


def delayed(x: Signal, steps: float) -> Signal:
    """A signal at even steps as it was so many steps before, by straight lines; its ends hold on."""
    if steps == 0.0:
        return x
    whole = math.floor(steps)
    late = x[:-1] + (1.0 - (steps - whole)) * (x[1:] - x[:-1])  # late[k] lies between x[k] and x[k + 1]
    out = np.empty_like(x)
    first = max(min(whole + 1, x.size), 0)
    last = max(min(whole + x.size, x.size), 0)
    out[:first], out[last:] = x[0], x[-1]
    out[first:last] = late[first - whole - 1 : last - whole - 1]
    return out


MOST_KEPT = 16
"""So many solutions of a log are kept, the oldest goes first."""


def _thinned(motion: LineMotion, every: int) -> LineMotion:
    t, x, v, a = (column[::every].copy() for column in (motion.t, motion.x, motion.v, motion.a))
    return LineMotion(t, x, v, a, motion.step * every)


def _averaging(run: Run, blocks: Blocks, grid: Signal) -> csr_array:
    """Matrix that takes a signal from the grid to the stamps, by straight lines, and averages it over blocks, (m, n)."""
    from scipy.sparse import csr_array

    samples = np.concatenate([np.arange(a, b) for a, b in zip(blocks.start, blocks.stop, strict=True)])
    row = np.repeat(np.arange(blocks.size), blocks.stop - blocks.start)
    place = np.clip((run.t[samples] - grid[0]) / (grid[1] - grid[0]), 0.0, grid.size - 1.0)
    before = np.minimum(place.astype(np.intp), grid.size - 2)
    share = place - before
    weight = 1.0 / blocks.count[row]
    data = np.concatenate((weight * (1.0 - share), weight * share))
    return csr_array(
        (data, (np.concatenate((row, row)), np.concatenate((before, before + 1)))), shape=(blocks.size, grid.size)
    )
