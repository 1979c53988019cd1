"""What the model says of a log's blocks, as fast as a fit needs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.bridge import bridge_table
from winchcascade.rig.kernel import LINE, SHAFT, constants, run_line, run_shaft
from winchcascade.rig.motion import Motion, motion_of

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from winchcascade.fit.blocks import Blocks
    from winchcascade.rig.kernel import Constants
    from winchcascade.rig.model import Model
    from winchcascade.run import Run, Signal

CHANNELS = ("pressure", "force", "torque", "vdc", "idc")
"""Channels that are compared, in the order of the columns of every block array."""

COARSE = 1e-3
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
    omega: Signal


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

    def shaft(self, numbers: Constants, gain: float = 1.0) -> Kept:
        """Solve the shaft, or take the solution of the same numbers; `gain` scales the line's velocity."""
        key = (gain, numbers.r_drum, *numbers[_SHAFT_FROM:])
        found = self._kept.get(key)
        if found is None:
            out = np.empty((self.motion.t.size, len(SHAFT)))
            run_shaft(self.motion.v * gain, self.motion.step, numbers, bridge_table(), out)
            thin = np.ascontiguousarray(out[:: self.every].T)
            found = Kept(*(thin[SHAFT.index(name)] for name in _KEPT))
            if len(self._kept) >= MOST_KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = found
        return found

    def on_grid(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read along the course, (n, 5) on the grid: columns of `CHANNELS`, SI units.

        Parameters
        ----------
        gain : scales the velocity that drives the shaft [1]
        skew : (5,) how late each channel is read [s]
        """
        numbers = constants(model, self.load)
        kept, at = self.shaft(numbers, gain), self.coarse
        line = np.empty((at.t.size, len(LINE)))
        run_line(at.x, at.v, at.a, at.step, numbers, kept.clutch, line)
        vdc, idc = kept.vdc, kept.idc
        sensors = model.sensors
        if sensors.electrical_lag:
            late = sensors.late(at.t)
            vdc, idc = np.interp(late, at.t, vdc), np.interp(late, at.t, idc)
        seen = [line[:, 0], line[:, 1], line[:, 2], vdc, idc]
        if skew is not None:
            seen = [np.interp(at.t - late, at.t, x) if late else x for x, late in zip(seen, skew.tolist(), strict=True)]
        return np.column_stack([sensors.read(name, x) for name, x in zip(CHANNELS, seen, strict=True)])

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

_KEPT = ("clutch", "vdc", "idc", "i_s", "i_bridge", "omega_gen")

MOST_KEPT = 48
"""So many solutions of a log are kept, the oldest goes first."""


def _thinned(motion: Motion, every: int) -> Motion:
    t, x, v, a = (column[::every].copy() for column in (motion.t, motion.x, motion.v, motion.a))
    return Motion(t, x, v, a, motion.step * every)


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
