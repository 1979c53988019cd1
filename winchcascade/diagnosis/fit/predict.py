"""Prediction of the block means of a log by the model, as fast as a fit needs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.kernel import SHAFT, LineMotion, solve_shaft
from winchcascade.rig.parts import Sensors
from winchcascade.rig.readings import path_of, readings, recorded
from winchcascade.rig.simulate import READ, motion_of
from winchcascade.rig.state import Constants, ShaftNumbers, constants

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from winchcascade.core.run import Index, Run, Signal
    from winchcascade.core.scales import MotionScale
    from winchcascade.diagnosis.fit.block_means import Blocks
    from winchcascade.rig.parts import Model

CHANNELS = READ
"""Channels that are compared, in the order of the columns of every block array."""

GRID = 1 / 43
"""Solutions are kept at this spacing over the ramp of the motion. [1]"""

SEEN = ("clutch", "vdc")
"""Columns of `kernel.SHAFT` that the sensors depend on: torque of the clutch [N m] and DC
voltage [V].
"""


class Course:
    """The line motion of one log, ready to be simulated many times, and its blocks.

    `scale` are the scales of the motion of its campaign. `v` is the velocity at every step [m/s],
    `coarse` the motion on the grid, `displacement` that of the line at the stamps [m].

    Solutions of the shaft are kept by the numbers that they depend on: an effect of the gas costs
    none anew.
    """

    def __init__(self, run: Run, blocks: Blocks, step: float, scale: MotionScale) -> None:
        self.run, self.blocks, self.scale = run, blocks, scale
        self.load = math.inf if run.load is None else run.load
        motion, self.step = motion_of(run, step, scale), step
        self.every = max(round(GRID * scale.ramp / step), 1)
        self.v, self.displacement = motion.v, np.interp(run.t, motion.t, motion.x)
        self.coarse = _thinned(motion, self.every)
        self._path = path_of(self.coarse)
        self._places = _places(run.t, self.coarse.t)
        self.matrix = _averaging(run, blocks, self.coarse.t)
        self._late: dict[int, csr_array] = {0: self.matrix}
        self.max_kept = MAX_KEPT
        self._kept: dict[tuple[float, ShaftNumbers], Signal] = {}

    def shaft(self, numbers: Constants, gain: float = 1.0) -> Signal:
        """Solve the shaft, or take the solution of the same numbers: `SEEN` on the grid, (2, n).

        `gain` scales the velocity of the line.
        """
        key = (gain, numbers.shaft)
        if key not in self._kept:
            solution = self._solve(numbers, gain)
            solved = np.stack([solution[:, SHAFT.index(name)] for name in SEEN])
            while len(self._kept) >= self.max_kept:
                del self._kept[next(iter(self._kept))]
        else:
            solved = self._kept.pop(
                key
            )  # and put it last: what begins several fits is used again and again
        self._kept[key] = solved
        return solved

    def electrical(self, numbers: Constants, *names: str) -> Signal:
        """Solve the shaft for some of the columns of `kernel.SHAFT`, on the grid, (n, k)."""
        return self._solve(numbers)[:, [SHAFT.index(name) for name in names]]

    def _solve(self, numbers: Constants, gain: float = 1.0) -> Signal:
        """Solve the shaft, (n, 8) on the grid."""
        return solve_shaft(self.v if gain == 1.0 else self.v * gain, self.step, numbers, self.every)

    def on_grid(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read along the course, (n, 5) on the grid: columns of `CHANNELS`, SI
        units.

        Parameters
        ----------
        gain : scales the velocity that drives the shaft [1]
        skew : (5,) how late each channel is read [s]
        """
        numbers = constants(model, self.load, self.coarse.rest)
        return readings(self._path, numbers, self.shaft(numbers, gain), model.sensors, skew).T

    def predict(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read, as means of the blocks, (m, 5), with the parameters of `on_grid`.

        Gain, zero and delay of a sensor are linear, so they act on the means.
        """
        numbers = constants(model, self.load, self.coarse.rest)
        *others, vdc = recorded(self._path, numbers, self.shaft(numbers, gain), model.sensors)
        delays = np.zeros(len(CHANNELS)) if skew is None else skew / self.coarse.step
        channels = [*others, vdc, vdc / numbers.shaft.load]
        means = [self._mean_of_late(x, by) for x, by in zip(channels, delays.tolist(), strict=True)]
        return np.column_stack(
            [model.sensors.read(name, x) for name, x in zip(CHANNELS, means, strict=True)]
        )

    def _mean_of_late(self, x: Signal, steps: float) -> Signal:
        """Mean over the blocks, (m,), of a signal on the grid, (n,), read late by a number of
        its steps, as `readings.late`.
        """
        whole = math.floor(steps)
        part = steps - whole
        mean = self._late_by(whole) @ x
        return np.asarray(
            mean if part == 0.0 else (1.0 - part) * mean + part * (self._late_by(whole + 1) @ x)
        )

    def _late_by(self, steps: int) -> csr_array:
        """`matrix` for a signal that is read late by whole steps of the grid."""
        if steps not in self._late:
            from scipy.sparse import csr_array

            rows, columns = self.matrix.shape
            before = np.clip(self.matrix.indices - steps, 0, columns - 1)
            self._late[steps] = csr_array(
                (self.matrix.data, before, self.matrix.indptr), shape=(rows, columns)
            )
        return self._late[steps]

    def at_stamps(self, on_grid: Signal) -> Signal:
        """Signals on the grid, (n, k), at the stamps of the log."""
        before, share = self._places
        x = on_grid.T.take(before, axis=1)
        return np.asarray((x + share * (on_grid.T.take(before + 1, axis=1) - x)).T)

    def block_mean(self, on_grid: Signal) -> Signal:
        """Mean over the blocks of something on the grid, (m, ...)."""
        return np.asarray(self.matrix @ on_grid)


def without_sensors(model: Model) -> Model:
    """A model whose sensors have no errors; its motion is as logged."""
    return msgspec.structs.replace(model, sensors=Sensors(motion_scale=model.sensors.motion_scale))


MAX_KEPT = 128
"""Maximum number of solutions kept for a log; the one that was used longest ago is dropped
first.
"""

ALL_KEPT = 1000
"""Maximum number of solutions kept for all logs of a fit, about 0.2 MB each; at least two are
kept for each log.
"""


def _thinned(motion: LineMotion, every: int) -> LineMotion:
    t, x, v, a = (column[::every].copy() for column in motion[:4])
    return LineMotion(t, x, v, a, motion.step * every, motion.rest)


def _places(t: Signal, grid: Signal) -> tuple[Index, Signal]:
    """Places of stamps on an even grid: the grid point before each, (n,), and the share of the
    way to the next, (n,).
    """
    place = np.clip((t - grid[0]) / (grid[1] - grid[0]), 0.0, grid.size - 1.0)
    before = np.minimum(place.astype(np.intp), grid.size - 2)
    return before, place - before


def _averaging(run: Run, blocks: Blocks, grid: Signal) -> csr_array:
    """Matrix that takes a signal from the grid to the stamps, by straight lines, and averages it
    over blocks, (m, n).
    """
    from scipy.sparse import csr_array

    row, samples = blocks.members
    before, share = _places(run.t[samples], grid)
    weight = 1.0 / blocks.count[row]
    data = np.concatenate((weight * (1.0 - share), weight * share))
    return csr_array(
        (data, (np.concatenate((row, row)), np.concatenate((before, before + 1)))),
        shape=(blocks.size, grid.size),
    )
