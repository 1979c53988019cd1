"""Prediction of the block means of a log by the model, as fast as a fit needs it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.kernel import LINE, SHAFT, Constants, LineMotion, constants, run_line, solve_shaft
from winchcascade.rig.simulate import motion_of
from winchcascade.rig.tangent import MOST_WAYS, Tangent, direction, tangent_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.sparse import csr_array

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.block_means import Blocks
    from winchcascade.rig.parts import Model

CHANNELS = ("pressure", "force", "torque", "vdc", "idc")
"""Channels that are compared, in the order of the columns of every block array."""

COARSE = 2.5e-3
"""Step of the solutions that a fit compares with one another. [s]"""

GRID = 0.01
"""Solutions are kept at this spacing. [s]"""


class Kept(msgspec.Struct, frozen=True):
    """What the sensors see of a solution of the shaft, on the grid, (n,) each: torque of the clutch [N m] and Vdc [V]."""

    clutch: Signal
    vdc: Signal


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
        self.most_kept, self.keeps_derivatives = MOST_KEPT, True
        self._kept: dict[tuple[float | tuple[float, ...], ...], Kept] = {}
        self._tangent: Tangent | None = None
        self._latest: tuple[Constants, Signal] | None = None

    def shaft(self, numbers: Constants, gain: float = 1.0) -> Kept:
        """Solve the shaft, or take the solution of the same numbers; `gain` scales the line's velocity."""
        key = (gain, *_of_the_shaft(numbers))
        if key not in self._kept:
            whole = self._solve(numbers, gain)
            self._latest = (numbers, whole) if gain == 1.0 and self.keeps_derivatives else None
            solved = Kept(*(self._thin(whole, name) for name in Kept.__struct_fields__))
            while len(self._kept) >= self.most_kept:
                del self._kept[next(iter(self._kept))]
        else:
            solved = self._kept.pop(key)  # and put it last: what begins several fits is used again and again
        self._kept[key] = solved
        return solved

    def electrical(self, numbers: Constants, name: str) -> Signal:
        """Solve the shaft for one of the columns of `kernel.SHAFT`, on the grid, (n,)."""
        return self._thin(self._solve(numbers), name)

    def _thin(self, whole: Signal, name: str) -> Signal:
        return whole[:: self.every, SHAFT.index(name)].copy()

    def _solve(self, numbers: Constants, gain: float = 1.0) -> Signal:
        return solve_shaft(self.motion.v * gain, self.motion.step, numbers)

    def tangent(self, numbers: Constants, others: Sequence[Constants]) -> Tangent:
        """Differentiate the shaft's solution of some numbers, so that all others follow to first order."""
        known, motion = self._tangent, self.motion
        ways = [way for way in dict.fromkeys(direction(numbers, other) for other in others) if any(way)]
        if known is not None and _of_the_shaft(known.numbers) == _of_the_shaft(numbers):
            if all(way in known.directions for way in ways):
                return known
            ways = list(dict.fromkeys((*ways, *known.directions)))[:MOST_WAYS]
        inert = numbers._replace(quasi_static=0.0)  # of a quasi-static shaft the same derivatives serve
        latest = self._latest  # as a rule the residuals were just computed here
        here = latest is not None and _of_the_shaft(latest[0]) == _of_the_shaft(inert)
        moving = latest[1] if latest is not None and here else self._solve(inert)
        found = tangent_of(motion.v, motion.step, numbers, moving, self.every, ways)
        self._tangent = found if self.keeps_derivatives else None
        return found

    def on_grid(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read along the course, (n, 5) on the grid: columns of `CHANNELS`, SI units.

        Parameters
        ----------
        gain : scales the velocity that drives the shaft [1]
        skew : (5,) how late each channel is read [s]
        """
        numbers = constants(model, self.load)
        kept = self.shaft(numbers, gain)
        return self._read(model, numbers, (kept.clutch, kept.vdc), np.zeros(len(CHANNELS)) if skew is None else skew)

    def _read(self, model: Model, numbers: Constants, solution: tuple[Signal, Signal], skew: Signal) -> Signal:
        """What the sensors read, (n, 5), as `on_grid`, with torque of the clutch and Vdc of a solution of the shaft."""
        at, sensors, (clutch, vdc) = self.coarse, model.sensors, solution
        line = np.empty((at.t.size, len(LINE)))
        run_line(at, numbers, clutch, line)
        late = delayed(vdc, sensors.electrical_lag / at.step)
        true = zip(CHANNELS, [*line.T[:ELECTRICAL], late, late / numbers.load], skew.tolist(), strict=True)
        return np.column_stack([sensors.read(name, delayed(x, lag / at.step)) for name, x, lag in true])

    def differences(self, model: Model, others: Sequence[Model], skew: Signal, skews: Sequence[Signal]) -> Signal:
        """What other models, near to one, read beyond it, (m, 5, k) as means of blocks.

        The shaft follows to first order, except for changes of numbers that are far from linear: with these it is solved anew.

        Parameters
        ----------
        skew, skews : (5,) delay of the reading of each channel, and the same for each of the others [s]
        """
        here, found = constants(model, self.load), np.zeros((self.blocks.size, len(CHANNELS), len(others)))
        kept = self.shaft(here)
        as_here = self._read(model, here, (kept.clutch, kept.vdc), skew)
        numbers = [constants(other, self.load) for other in others]
        near = [there for there in numbers if _of_the_shaft(there) != _of_the_shaft(here) and not _far(here, there)]
        tangent = self.tangent(here, near) if near else None
        for k, late in enumerate(skews):
            if others[k] == model and np.array_equal(late, skew):
                continue
            there = numbers[k]
            solved = self.shaft(there) if _far(here, there) else kept
            clutch, vdc = solved.clutch, solved.vdc
            if tangent is not None and there in near:
                by_clutch, by_vdc = tangent.change(there)
                clutch, vdc = clutch + by_clutch, vdc + by_vdc
            found[:, :, k] = self.block_mean(self._read(others[k], there, (clutch, vdc), late) - as_here)
        return found

    def predict(self, model: Model, gain: float = 1.0, skew: Signal | None = None) -> Signal:
        """What the sensors read, as means of the blocks, (m, 5), with the parameters of `on_grid`."""
        return self.block_mean(self.on_grid(model, gain, skew))

    def block_mean(self, on_grid: Signal) -> Signal:
        """Mean over the blocks of something on the grid, (m, ...)."""
        return np.asarray(self.matrix @ on_grid)


_SHAFT_FROM = 17
"""Numbers of `Constants` from here on concern the shaft; `test_predict` holds it."""

ELECTRICAL = CHANNELS.index("vdc")
"""Channels from here on are electrical: their lag is common."""


def _of_the_shaft(numbers: Constants) -> tuple[float | tuple[float, ...], ...]:
    return numbers[_SHAFT_FROM:]


def _far(here: Constants, there: Constants) -> bool:
    """Whether a number differs that no first order serves: dry friction stops a shaft for good, and a capacitor that differs
    by its tolerance empties by another exponential. Simplifications have no derivative.
    """
    return any(getattr(here, name) != getattr(there, name) for name in SOLVED_ANEW)


SOLVED_ANEW = ("friction", "c_dc", "averaged", "uncommutated", "quasi_static", "weightless")
"""Numbers of `Constants` whose changes are solved anew, not followed to first order."""


def delayed(x: Signal, steps: float) -> Signal:
    """A signal at even steps as it was so many steps before, by straight lines; its ends hold on."""
    if steps == 0.0:
        return x
    whole = math.floor(steps)
    with np.errstate(invalid="ignore"):  # a search may try numbers with which nothing can be simulated
        late = x[:-1] + (1.0 - (steps - whole)) * (x[1:] - x[:-1])  # late[k] lies between x[k] and x[k + 1]
    out = np.empty_like(x)
    first = max(min(whole + 1, x.size), 0)
    last = max(min(whole + x.size, x.size), 0)
    out[:first], out[last:] = x[0], x[-1]
    out[first:last] = late[first - whole - 1 : last - whole - 1]
    return out


MOST_KEPT = 16
"""So many solutions of a log are kept; the one that was used longest ago goes first."""

ALL_KEPT = 1200
"""So many solutions of all logs of a fit are kept at most, but two of each: about 0.2 MB each."""

MOST_DERIVATIVES = 25
"""Up to so many logs keep their latest derivatives and the solution at every step: about 8 MB for each log."""


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
