"""A log in blocks: means over about 0.4 s within one phase, in which ringing and most of the correlation cancel."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.reduction.phases import check_cycles, detect, smoothed_velocity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.phases import Cycle

BLOCK = 0.44
"""Length of a block: one period of the tether's ringing at 2.2 to 2.3 Hz. [s]"""

PHASES = ("payout", "hold", "haul_in")
"""Phases by the number that a block carries; rest before the first payout and after the last haul-in counts as hold."""


class Blocks(msgspec.Struct, frozen=True):
    """Blocks of a log, (m,) each, in order of time.

    `start` and `stop` bound the samples [start, stop); `phase` is an index of `PHASES`, `cycle` counts payouts from 1 (0
    before the first); `joined` tells a block that follows the one before without a pause, in the same phase.
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
        samples: Signal = (self.stop - self.start).astype(np.float64)
        return samples

    def mean(self, x: Signal) -> Signal:
        """Mean of a signal over each block, (m,) from (n,) in its unit."""
        total = np.concatenate(([0.0], np.cumsum(x)))
        means: Signal = (total[self.stop] - total[self.start]) / self.count
        return means

    def scatter(self, x: Signal) -> Signal:
        """Standard deviation of a signal within each block, about its straight line, (m,) in its unit."""
        number = np.repeat(np.arange(self.size), self.stop - self.start)
        samples = np.concatenate([np.arange(a, b) for a, b in zip(self.start, self.stop, strict=True)])
        place = samples - np.repeat(0.5 * (self.start + self.stop - 1), self.stop - self.start)
        value = x[samples]
        sums = [np.bincount(number, w, self.size) for w in (value, value**2, place * value, place**2)]
        squares = sums[1] - sums[0] ** 2 / self.count - sums[2] ** 2 / np.maximum(sums[3], 1e-12)
        spread: Signal = np.sqrt(np.maximum(squares, 0.0) / np.maximum(self.count - 2.0, 1.0))
        return spread


def blocks_of(run: Run, rig: Rig, cycles: tuple[int, int] | None = None) -> Blocks:
    """Cut a log into blocks, phase by phase.

    Parameters
    ----------
    cycles : first and last cycle that count, both included, numbered by payout; all by default

    Raises
    ------
    OptionError : the log has none of the cycles that count
    """
    found = detect(run, smoothed_velocity(run, rig.thresholds), rig.thresholds)
    if cycles is not None:
        check_cycles(cycles, found, run.name)
    rows: list[tuple[int, int, int, int, bool]] = []
    for begin, end, phase, cycle in _stretches(run, found):
        if cycles is not None and not cycles[0] <= max(cycle, 1) <= cycles[1]:
            continue
        rows += _cut(run, begin, end, phase, cycle)
    table = np.array(rows, dtype=np.intp).reshape(-1, 5)
    return Blocks(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4].astype(bool))


def _stretches(run: Run, cycles: list[Cycle]) -> Iterator[tuple[float, float, int, int]]:
    """Stretches of one phase: beginning, end [s], phase, cycle."""
    at, number = float(run.t[0]), 0
    for number, cycle in enumerate(cycles, 1):
        yield at, cycle.onset, 1, number - 1
        yield cycle.onset, cycle.payout_end, 0, number
        at = cycle.payout_end
        if cycle.haul_in is not None:
            yield at, cycle.haul_in[0], 1, number
            yield *cycle.haul_in, 2, number
            at = cycle.haul_in[1]
    yield at, float(run.t[-1]), 1, number


def _cut(run: Run, begin: float, end: float, phase: int, cycle: int) -> Iterator[tuple[int, int, int, int, bool]]:
    """Cut a stretch into equal blocks; one that gaps have left with less than half its samples is dropped."""
    pieces = max(round((end - begin) / BLOCK), 1)
    length = (end - begin) / pieces
    edges = np.searchsorted(run.t, np.linspace(begin, end, pieces + 1), side="left")
    least = max(0.5 * BLOCK * run.fs, 3.0)
    before = False
    if length < 0.5 * BLOCK:
        return
    for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        whole = b - a >= least
        if whole:
            yield a, b, phase, cycle, before
        before = whole
