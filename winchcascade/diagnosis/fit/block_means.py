"""Block means of a log: means over about 0.4 s within one phase, in which ringing and most of
the correlation cancel.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.integrate import GAUSS, median
from winchcascade.reduction.phases import check_cycles, detect, smoothed_velocity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal

BLOCK = 1.03
"""Length of a block over the ramp of the motion, unless samples are few: about a period of the
ringing tether. [1]
"""

MIN_SAMPLES = 4.0
"""A block of a coarse log is longer, so that it holds this number of samples: the scatter of
fewer is uncertain. [1]
"""

PHASES = ("payout", "hold", "haul_in")
"""Phases by the number that a block carries; rest before the first payout and after the last
haul-in counts as hold.
"""

PAYOUT, HOLD, HAUL_IN = range(len(PHASES))
"""Numbers of the phases in `PHASES`."""


class Blocks(msgspec.Struct, frozen=True):
    """Blocks of a log, (m,) each, in order of time.

    `start` and `stop` bound the samples [start, stop); `phase` is an index of `PHASES`, `cycle`
    counts payouts from 1 (0 before the first); `joined` marks a block that follows the one before
    without a pause, in the same phase.
    """

    start: NDArray[np.intp]
    stop: NDArray[np.intp]
    phase: NDArray[np.intp]
    cycle: NDArray[np.intp]
    joined: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """How many there are."""
        return int(self.start.size)

    @property
    def count(self) -> Signal:
        """Samples of each block."""
        return (self.stop - self.start).astype(np.float64)

    @property
    def members(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Block of each sample that one has, and number of the sample, block after block, (k,)."""
        length = self.stop - self.start
        owner = np.repeat(np.arange(self.size), length)
        return owner, np.arange(owner.size) + (self.stop - np.cumsum(length))[owner]

    def some(self, here: NDArray[np.bool_] | NDArray[np.intp]) -> Blocks:
        """The blocks that are `here`."""
        return Blocks(*(field[here] for field in msgspec.structs.astuple(self)))

    def mean(self, x: Signal) -> Signal:
        """Mean of a signal over each block, (m,) from (n,) in its unit."""
        total = np.concatenate(([0.0], np.cumsum(x)))
        return (total[self.stop] - total[self.start]) / self.count

    def spread(self, x: Signal, size: int) -> Signal:
        """Values of the blocks, (m, ...), at each of their samples, (size, ...); 0 outside."""
        found = np.zeros((size, *x.shape[1:]))
        owner, samples = self.members
        found[samples] = x[owner]
        return found

    def scatter(self, x: Signal) -> Signal:
        """Standard deviation of a signal within each block, about its straight line, (m,) in its
        unit.
        """
        owner, samples = self.members
        place, value = samples - 0.5 * (self.start + self.stop - 1)[owner], x[samples]
        sums = [
            np.bincount(owner, w, self.size) for w in (value, value**2, place * value, place**2)
        ]
        squares = sums[1] - sums[0] ** 2 / self.count - sums[2] ** 2 / np.maximum(sums[3], 1e-12)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0) / np.maximum(self.count - 2.0, 1.0)))


def blocks_of(run: Run, rig: Rig, ramp: float, cycles: tuple[int, int] | None = None) -> Blocks:
    """Cut a log into blocks, phase by phase.

    Parameters
    ----------
    ramp : time in which the line speeds up [s]
    cycles : first and last cycle that count, both included, numbered by payout; all by default

    Raises
    ------
    OptionError : the log has none of the cycles that count
    """
    found = detect(run, smoothed_velocity(run, rig.thresholds), rig.thresholds)
    if cycles is not None:
        check_cycles(cycles, found, run.name)
    first, last = cycles or (-math.inf, math.inf)
    begins = [(float(run.t[0]), HOLD, 0)]
    for number, cycle in enumerate(found, 1):
        begins += [(cycle.onset, PAYOUT, number), (cycle.payout_end, HOLD, number)]
        if cycle.haul_in is not None:
            begins += [(cycle.haul_in[0], HAUL_IN, number), (cycle.haul_in[1], HOLD, number)]
    ends = [*(begin for begin, _, _ in begins[1:]), float(run.t[-1])]
    counted = [
        _cut(run, begin, end, phase, number, max(BLOCK * ramp, MIN_SAMPLES / run.fs))
        for (begin, phase, number), end in zip(begins, ends, strict=True)
        if first <= max(number, 1) <= last
    ]
    start, stop, phases, numbers, joined = np.vstack([np.zeros((0, 5), dtype=np.intp), *counted]).T
    return Blocks(start, stop, phases, numbers, joined.astype(bool))


def in_a_row(several: Sequence[Blocks]) -> Blocks:
    """Blocks of several logs one after the other, with cycles numbered so that no two logs share
    one.
    """
    first = np.cumsum([0, *(int(blocks.cycle.max(initial=0)) + 1 for blocks in several)])
    renumbered = [
        replace(blocks, cycle=blocks.cycle + k) for blocks, k in zip(several, first, strict=False)
    ]
    fields = Blocks.__struct_fields__
    return Blocks(
        *(np.concatenate([getattr(blocks, name) for blocks in renumbered]) for name in fields)
    )


def middles(blocks: Blocks, here: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Numbers of the blocks between two neighbours of the same phase where all three are `here`,
    (j,).
    """
    return 1 + np.flatnonzero(
        here[:-2] & here[1:-1] & here[2:] & blocks.joined[1:-1] & blocks.joined[2:]
    )


CHANGING = 0.03
"""The motion changes where the mean speed differs by more than this share of the largest in its
phase from that of the block before, and of the block after. [1]"""


def changing(blocks: Blocks, speed: Signal) -> NDArray[np.bool_]:
    """Blocks within a ramp of several, (m,), by the mean speed of the line in each, (m,) [m/s]."""
    steps = np.abs(np.diff(speed, prepend=speed[:1], append=speed[-1:]))
    top = np.zeros(len(PHASES))
    np.maximum.at(top, blocks.phase, np.abs(speed))
    return np.asarray(np.minimum(steps[1:], steps[:-1]) > CHANGING * top[blocks.phase])


def scatter_about_course(
    blocks: Blocks, x: Signal, here: NDArray[np.bool_], minimum: int = 1
) -> float:
    """Standard deviation of block means about their smooth course, in the unit of x; NaN with fewer
    than `minimum` triples.

    From second differences, by the median: a smooth difference contributes nothing, and a step to
    few of them.
    """
    k = middles(blocks, here)
    second = np.abs(x[k - 1] - 2.0 * x[k] + x[k + 1]) / math.sqrt(6.0)
    return GAUSS * median(second) if k.size >= minimum else math.nan


def _cut(
    run: Run, begin: float, end: float, phase: int, cycle: int, length: float
) -> NDArray[np.intp]:
    """Cut a stretch into equal blocks, (m, 5) as the fields of `Blocks`; drop those in which
    gaps leave less than half.
    """
    pieces = max(round((end - begin) / length), 1)
    if end - begin < 0.5 * length * pieces:
        return np.zeros((0, 5), dtype=np.intp)
    edges = np.searchsorted(run.t, np.linspace(begin, end, pieces + 1), side="left")
    whole = np.diff(edges) >= max(0.5 * length * run.fs, 3.0)
    joined = np.concatenate(([False], whole[:-1]))
    same = np.full(pieces, phase), np.full(pieces, cycle)
    return np.column_stack([edges[:-1], edges[1:], *same, joined])[whole]
