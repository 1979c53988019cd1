"""Prediction of the block means of a log by the model, as fast as a fit needs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.rig.kernel import SHAFT, STATE, Constants, LineMotion, constants, solve_shaft
from winchcascade.rig.readings import (
    TRUE,
    Averages,
    Shafts,
    path_of,
    records_of,
    run_differences,
    run_readings,
    sensor_numbers,
)
from winchcascade.rig.simulate import READ, motion_of
from winchcascade.rig.tangent import MAX_WAYS, Tangent, direction, tangent_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_array

    from winchcascade.core.run import Index, Run, Signal
    from winchcascade.diagnosis.block_means import Blocks
    from winchcascade.rig.parts import Model

CHANNELS = READ
"""Channels that are compared, in the order of the columns of every block array."""

COARSE = 2.5e-3
"""Step of the solutions that a fit compares with one another. [s]"""

GRID = 0.01
"""Solutions are kept at this spacing. [s]"""

SEEN = ("clutch", "vdc")
"""Columns of `kernel.SHAFT` that the sensors depend on: torque of the clutch [N m] and DC voltage [V]."""


class Course:
    """The line motion of one log, ready to be simulated many times, and its blocks.

    `v` is the velocity at every step [m/s], `coarse` the motion on the grid, `displacement` that of the line at the stamps [m].

    Solutions of the shaft are kept by the numbers that they depend on: an effect of the gas costs none anew.
    """

    def __init__(self, run: Run, blocks: Blocks, step: float = COARSE) -> None:
        self.run, self.blocks = run, blocks
        self.load = math.inf if run.load is None else run.load
        motion, self.every, self.step = motion_of(run, step), max(round(GRID / step), 1), step
        self.v, self.displacement = motion.v, np.interp(run.t, motion.t, motion.x)
        self.coarse = _thinned(motion, self.every)
        self._path = path_of(self.coarse)
        self._places = _places(run.t, self.coarse.t)
        self.matrix = _averaging(run, blocks, self.coarse.t)
        self._averages = Averages(
            self.matrix.indptr.astype(np.intp), self.matrix.indices.astype(np.intp), self.matrix.data
        )
        self.max_kept, self.keeps_derivatives = MAX_KEPT, True
        self._kept: dict[tuple[float | tuple[float, ...], ...], Signal] = {}
        self._tangent: Tangent | None = None
        self._state = np.empty((self.v.size, len(STATE)))
        self._latest: Constants | None = None  # the numbers whose solution has this state

    def shaft(self, numbers: Constants, gain: float = 1.0) -> Signal:
        """Solve the shaft, or take the solution of the same numbers: `SEEN` on the grid, (2, n).

        `gain` scales the velocity of the line.
        """
        key = (gain, *_of_the_shaft(numbers))
        if key not in self._kept:
            solution = self._solve(numbers, gain)
            solved = np.stack([solution[:, SHAFT.index(name)] for name in SEEN])
            while len(self._kept) >= self.max_kept:
                del self._kept[next(iter(self._kept))]
        else:
            solved = self._kept.pop(key)  # and put it last: what begins several fits is used again and again
        self._kept[key] = solved
        return solved

    def electrical(self, numbers: Constants, name: str) -> Signal:
        """Solve the shaft for one of the columns of `kernel.SHAFT`, on the grid, (n,)."""
        return self._solve(numbers)[:, SHAFT.index(name)].copy()

    def _solve(self, numbers: Constants, gain: float = 1.0) -> Signal:
        """Solve the shaft, (n, 8) on the grid, and keep the state at every step until the next call."""
        self._latest = numbers if gain == 1.0 else None
        v = self.v if gain == 1.0 else self.v * gain
        return solve_shaft(v, self.step, numbers, self.every, self._state)

    def tangent(self, numbers: Constants, others: Sequence[Constants]) -> Tangent:
        """Differentiate the shaft's solution of some numbers, so that all others follow to first order."""
        known = self._tangent
        ways = [way for way in dict.fromkeys(direction(numbers, other) for other in others) if any(way)]
        if known is not None and _of_the_shaft(known.numbers) == _of_the_shaft(numbers):
            if all(way in known.directions for way in ways):
                return known
            ways = list(dict.fromkeys((*ways, *known.directions)))[:MAX_WAYS]
        if self._latest is None or _of_the_shaft(self._latest) != _of_the_shaft(numbers):
            self._solve(numbers)  # seldom, as the residuals were just computed here
        found = tangent_of(self.v, self.step, numbers, self._state, self.every, ways)
        self._tangent = found if self.keeps_derivatives else None
        return found

    def on_grid(
        self, model: Model, gain: float = 1.0, skew: Signal | None = None, solution: Signal | None = None
    ) -> Signal:
        """What the sensors read along the course, (n, 5) on the grid: columns of `CHANNELS`, SI units.

        Parameters
        ----------
        gain : scales the velocity that drives the shaft [1]
        skew : (5,) how late each channel is read [s]
        solution : (2, n) of the shaft if it is known, as `near_solutions` gives it
        """
        numbers, found = constants(model, self.load), np.empty((len(CHANNELS), self.coarse.t.size))
        if solution is None:
            solution = self.shaft(numbers, gain)
        sensors = sensor_numbers(model, np.zeros(len(CHANNELS)) if skew is None else skew, self.coarse.step)
        run_readings(self._path, numbers, solution, sensors, np.empty((TRUE, self.coarse.t.size)), found)
        return found.T

    def differences(self, model: Model, others: Sequence[Model], skew: Signal, skews: Sequence[Signal]) -> Signal:
        """What other models, near to one, read beyond it, (m, 5, k) as means of blocks.

        The shaft follows to first order, except for changes of numbers that are far from linear: with these it is solved anew.

        Parameters
        ----------
        skew, skews : (5,) delay of the reading of each channel, and the same for each of the others [s]
        """
        models, late = (model, *others), (skew, *skews)
        numbers = [constants(one, self.load) for one in models]
        sensors = np.array([sensor_numbers(*one, self.coarse.step) for one in zip(models, late, strict=True)])
        found = np.empty((self.blocks.size, len(CHANNELS), len(others)))
        same = [one == model and np.array_equal(at, skew) for one, at in zip(others, skews, strict=True)]
        shafts = self._shafts(numbers, [False, *same])
        run_differences(self._path, records_of(numbers), shafts, sensors, self._averages, found)
        return found

    def near_solutions(self, model: Model, others: Sequence[Model]) -> Signal:
        """Solutions of the shaft for models near to one, (k, 2, n), to first order where that serves."""
        numbers = [constants(one, self.load) for one in (model, *others)]
        found = self._shafts(numbers, [False] * len(numbers))
        return np.asarray(found.solved[found.of[1:]] + np.tensordot(found.moves[1:], found.slopes, axes=(1, 1)))

    def _shafts(self, numbers: Sequence[Constants], same: Sequence[bool]) -> Shafts:
        """Solutions of the shaft for the first of some numbers and for others, to first order where that serves.

        Parameters
        ----------
        same : whether a model reads nothing beyond the first
        """
        here = numbers[0]
        solved, of = [self.shaft(here)], np.zeros(len(numbers), dtype=np.intp)
        near = [
            there for there in numbers if _of_the_shaft(there) != _of_the_shaft(here) and not self._far(here, there)
        ]
        tangent = self.tangent(here, near) if near else None
        slopes = np.zeros((2, 0, solved[0].shape[1])) if tangent is None else tangent.slopes
        moves = np.zeros((len(numbers), slopes.shape[1]))
        for k, there in enumerate(numbers):
            if same[k]:
                of[k] = -1
            elif self._far(here, there):
                of[k] = len(solved)
                solved.append(self.shaft(there))
            elif tangent is not None:
                moves[k] = tangent.moves(there)
        return Shafts(np.array(solved), slopes, of, moves)

    def _far(self, here: Constants, there: Constants) -> bool:
        """Whether a number differs that no first order serves: dry friction stops a shaft for good. In an open circuit, a
        capacitor that differs by its tolerance empties by another exponential. Simplifications have no derivative.
        """
        anew = SOLVED_ANEW if math.isfinite(self.load) else (*SOLVED_ANEW, "c_dc")
        return any(getattr(here, name) != getattr(there, name) for name in anew)

    def predict(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read, as means of the blocks, (m, 5), with the parameters of `on_grid`."""
        return self.block_mean(self.on_grid(model, gain, skew))

    def at_stamps(self, on_grid: Signal) -> Signal:
        """Signals on the grid, (n, k), at the stamps of the log."""
        before, share = self._places
        x = on_grid.T.take(before, axis=1)
        return np.asarray((x + share * (on_grid.T.take(before + 1, axis=1) - x)).T)

    def block_mean(self, on_grid: Signal) -> Signal:
        """Mean over the blocks of something on the grid, (m, ...)."""
        return np.asarray(self.matrix @ on_grid)


_SHAFT_FROM = 18
"""Numbers of `Constants` from here on concern the shaft; `test_predict` holds it."""


def _of_the_shaft(numbers: Constants) -> tuple[float | tuple[float, ...], ...]:
    return numbers[_SHAFT_FROM:]


SOLVED_ANEW = ("friction", "coast_drag", "averaged", "uncommutated", "quasi_static", "weightless")
"""Numbers of `Constants` whose changes are solved anew, not followed to first order."""


MAX_KEPT = 16
"""Maximum number of solutions kept for a log; the one that was used longest ago is dropped first."""

ALL_KEPT = 1200
"""Maximum number of solutions kept for all logs of a fit, about 0.2 MB each; at least two are kept for each log."""

MAX_DERIVATIVES = 25
"""Maximum number of logs for which the latest derivatives are kept, about 5 MB for each log."""


def _thinned(motion: LineMotion, every: int) -> LineMotion:
    t, x, v, a = (column[::every].copy() for column in motion[:-1])
    return LineMotion(t, x, v, a, motion.step * every)


def _places(t: Signal, grid: Signal) -> tuple[Index, Signal]:
    """Places of stamps on an even grid: the grid point before each, (n,), and the share of the way to the next, (n,)."""
    place = np.clip((t - grid[0]) / (grid[1] - grid[0]), 0.0, grid.size - 1.0)
    before = np.minimum(place.astype(np.intp), grid.size - 2)
    return before, place - before


def _averaging(run: Run, blocks: Blocks, grid: Signal) -> csr_array:
    """Matrix that takes a signal from the grid to the stamps, by straight lines, and averages it over blocks, (m, n)."""
    from scipy.sparse import csr_array

    samples = np.concatenate([np.arange(a, b) for a, b in zip(blocks.start, blocks.stop, strict=True)])
    row = np.repeat(np.arange(blocks.size), blocks.stop - blocks.start)
    before, share = _places(run.t[samples], grid)
    weight = 1.0 / blocks.count[row]
    data = np.concatenate((weight * (1.0 - share), weight * share))
    return csr_array(
        (data, (np.concatenate((row, row)), np.concatenate((before, before + 1)))), shape=(blocks.size, grid.size)
    )
