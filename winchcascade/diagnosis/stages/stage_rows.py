"""Logs of a cascade as one table: a row for each block and path, with its powers and what one unit
of each law adds.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.integrate import median
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.diagnosis.fit.block_means import PHASES, Blocks, in_a_row
from winchcascade.diagnosis.stages.stage_laws import TOP, Suspecteds, effects_of
from winchcascade.diagnosis.stages.stage_signals import StagePath, StageSignals

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from winchcascade.diagnosis.fit.suspects import Suspects

PARTS_OF_RUN = (*PHASES, "window")
"""Phases by the number that a block carries; of a bench whose cycles are found in no motion all is
one window."""


EVERY_SAMPLE = 1.0 - 1e-9
"""Share of the samples of a block that is all of them. [1]"""

NOTHING = np.zeros(0)
"""Numbers of no suspect."""


class StagePart(msgspec.Struct, frozen=True):
    """What one entry of a campaign takes of a log: its first and last cycle, and the number of
    samples in its blocks.
    """

    run: Run
    withheld: bool
    cycles: tuple[int, int]
    samples: int


class StageRows(msgspec.Struct, frozen=True):
    """Means over blocks of all parts and paths in a row, (m,) each.

    `part` and `path` are their numbers, `blocks` has phase and cycle (numbered so that no two parts
    share one), `own_cycle` the number of the cycle within its log, `t` the middle of the block on
    the clock of the log and `width` the time that it stands for [s]. `given` is the power that goes
    in less the stated laws, and `gap` the power that comes out minus that [W]. `columns` (m,
    suspects) are the powers that one unit of each coefficient adds [W], `known` (m, q) those that
    one standard uncertainty of what is known of sensors and stated laws adds [W]. `halves` (m, 2, k
    + q + 1) are columns, known and gap once more: the gap of every other sample with the rest of
    those between. `axes` (m, 2) are the signals that a path is mapped over.
    """

    part: Index
    path: Index
    blocks: Blocks
    own_cycle: Index
    t: Signal
    width: Signal
    given: Signal
    gap: Signal
    columns: Signal
    known: Signal
    halves: Signal
    axes: Signal

    @property
    def kind(self) -> Index:
        """Number of path and phase together, (m,)."""
        found: Index = self.path * len(PARTS_OF_RUN) + self.blocks.phase
        return found

    def some(self, here: Mask | Index) -> StageRows:
        """The rows that are `here`, (m,)."""
        cut = {
            name: getattr(self, name)[here] for name in self.__struct_fields__ if name != "blocks"
        }
        return StageRows(blocks=self.blocks.some(here), **cut)


class StageData(msgspec.Struct, frozen=True):
    """All rows of a campaign, and the suspects with their numbers."""

    paths: tuple[StagePath, ...]
    laws: Suspecteds
    suspects: Suspects
    axes: tuple[tuple[str, str], ...]
    parts: tuple[StagePart, ...]
    rows: StageRows

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the suspects, in the order of the columns."""
        return tuple(self.suspects)

    def numbers(self, names: Sequence[str] = (), x: Signal = NOTHING) -> Signal:
        """Numbers of all suspects, (suspects,): what the rig file states, and what a fit of some of
        them adds.
        """
        added = dict(zip(names, x.tolist(), strict=True))
        stated = {
            name: one.stated.value for name, one in self.laws.items() if one.stated is not None
        }
        return np.array([stated.get(name, 0.0) + added.get(name, 0.0) for name in self.names])

    def named(self, kind: int) -> tuple[StagePath, str]:
        """Path and phase of a number of both."""
        path, phase = divmod(kind, len(PARTS_OF_RUN))
        return self.paths[path], PARTS_OF_RUN[phase]

    @property
    def beside_model(self) -> bool:
        """Whether the powers that go in are those that a model makes of them."""
        return bool(self.paths[0].at)

    @property
    def plain(self) -> Mask:
        """Suspects that are no error of a sensor of a power that comes out, (suspects,)."""
        outgoing = {
            name for path in self.paths for power in path.out.powers for name in power.channels
        }
        return np.array([one.channel not in outgoing for one in self.laws.values()])

    @property
    def withheld(self) -> Mask:
        """Rows that take part in neither choice nor fit, (m,)."""
        return np.array([part.withheld for part in self.parts])[self.rows.part]

    @property
    def fitted(self) -> StageRows:
        """Rows that take part in choice and fit."""
        return self.rows.some(~self.withheld)

    @property
    def judged(self) -> StageRows:
        """Rows that the causes are tested on: the withheld ones, or all where none is withheld."""
        return self.rows.some(self.withheld) if self.withheld.any() else self.rows

    @property
    def cycle_names(self) -> list[str]:
        """Name of every cycle of all parts in a row."""
        first = np.unique(self.rows.blocks.cycle, return_index=True)[1]
        parts = [self.parts[number].run.name for number in self.rows.part[first]]
        return [
            f"cycle {cycle} of {name}"
            for cycle, name in zip(self.rows.own_cycle[first], parts, strict=True)
        ]


class PathSamples(msgspec.Struct, frozen=True):
    """One path at the samples of a log: its signals, the samples that are `good`, (n,), the share
    of those of a block that makes it count, and what one standard uncertainty of what is known of
    rig and sensors adds to power out minus power in, (n,) each [W].
    """

    signals: StageSignals
    good: Mask
    share: float
    known: Sequence[Signal]


def data_of(
    runs: Sequence[Run],
    withheld: Collection[int],
    paths: tuple[StagePath, ...],
    laws: Suspecteds,
    axes: tuple[tuple[str, str], ...],
    tables: Sequence[StageRows],
) -> StageData:
    """The rows of all logs, and the suspects that move any of those that take part in the fit.

    Raises
    ------
    LogError : a power or a signal of a stage is 0 throughout
    """
    rows = _joined(tables, in_a_row([table.blocks for table in tables]))
    parts = []
    for k, (run, table) in enumerate(zip(runs, tables, strict=True)):
        ends = int(table.own_cycle.min()), int(table.own_cycle.max())
        samples = table.some(table.path == table.path[0]).blocks.count.sum()
        parts.append(StagePart(run, k in withheld, ends, int(samples)))
    fitted = rows.some(~np.array([part.withheld for part in parts])[rows.part])
    squares = np.bincount(fitted.path, (fitted.gap + fitted.given) ** 2, len(paths))
    power, sizes = np.sqrt(squares), np.linalg.norm(fitted.columns, axis=0)
    of_line = [one.law.kind in ("loss", "zero", "gain") for one in laws.values()]
    line = paths[0].into.name == "line" and not paths[0].at
    if not np.all(power) or (line and np.any(sizes[of_line] == 0.0)):
        what = "line speed, line tension or mechanical power" if line else "a power or its signal"
        raise LogError(
            f"{parts[0].run.name}: {what} is 0 throughout the cycles of the fit; a diagnosis needs "
            "a rig at work, so choose other cycles or check the columns."
        )
    moving = sizes > 0.0
    laws = {name: one for (name, one), moves in zip(laws.items(), moving, strict=True) if moves}
    of_path = [float(power[one.paths[0]]) for one in laws.values()]
    most = (np.array(of_path) / sizes[moving]).tolist()
    channels = {law.channel for law in laws.values()} - {""}
    tops = {name: _top([run.channels[name] for run in runs]) for name in channels}
    kept = np.concatenate([moving, np.ones(rows.known.shape[1] + 1, dtype=bool)])
    rows = msgspec.structs.replace(
        rows, columns=rows.columns[:, moving], halves=rows.halves[:, :, kept]
    )
    return StageData(paths, laws, effects_of(laws, paths, most, tops), axes, tuple(parts), rows)


def _top(several: Sequence[Signal]) -> float:
    """Top magnitude of a channel in several logs; that of single peaks where it mostly rests."""
    x = np.abs(np.concatenate(several))
    return float(np.quantile(x, TOP)) or float(np.max(x))


def rows_of(
    t: Signal,
    blocks: Blocks,
    paths: Iterable[tuple[int, PathSamples]],
    laws: Suspecteds,
    axes: Sequence[tuple[str, str]],
    log: int,
) -> StageRows:
    """Block means of one log, by its number, in order of cycle, time and path.

    Parameters
    ----------
    t : (n,) stamps [s]
    paths : those of the log, with their numbers
    """
    interval = np.minimum(np.gradient(t), 2.0 * median(np.diff(t)))  # not that of a gap
    width = blocks.count * blocks.mean(interval)
    tables: list[StageRows] = []
    for k, path in paths:
        one, here = path.signals, blocks.mean(path.good.astype(np.float64)) >= path.share
        columns = [
            one.column(law.law, law.channel) if k in law.paths else np.zeros(t.size)
            for law in laws.values()
        ]
        places = [one.signals.get(name, np.zeros(t.size)) for name in axes[k]]
        powers = t, one.power_in, one.power_out - one.power_in
        means, halves = _means([*powers, *places, *columns, *path.known], blocks, path.good, here)
        kept = blocks.some(here)
        counted = np.maximum(kept.cycle, 1)  # rest before the first payout belongs to its cycle
        split, beside = 5 + len(columns), np.hstack([halves[::-1, 5:], halves[:, 2:3]])
        tables.append(
            StageRows(
                part=np.full(kept.size, log),
                path=np.full(kept.size, k),
                blocks=msgspec.structs.replace(kept, cycle=counted),
                own_cycle=counted,
                t=means[0],
                width=width[here],
                given=means[1],
                gap=means[2],
                axes=means[3:5].T,
                columns=means[5:split].T,
                known=means[split:].T,
                halves=np.moveaxis(beside, 2, 0),
            )
        )
    every = zip(*(msgspec.structs.astuple(table.blocks) for table in tables), strict=True)
    rows = _joined(tables, Blocks(*map(np.concatenate, every)))
    return rows.some(np.lexsort((rows.path, rows.t, rows.own_cycle)))


def _means(
    signals: Sequence[Signal], blocks: Blocks, good: Mask, here: Mask
) -> tuple[Signal, Signal]:
    """Means of k signals over the good samples of some blocks, (k, m), and over every other of
    these samples and those between, (2, k, m).
    """
    even = np.arange(good.size) % 2 == 0
    whole, *halves = (
        np.array([blocks.mean(np.where(part, x, 0.0))[here] for x in signals])
        / np.maximum(blocks.mean(part.astype(np.float64))[here], 1e-12)
        for part in (good, good & even, good & ~even)
    )
    return whole, np.stack(halves)


def _joined(tables: Sequence[StageRows], blocks: Blocks) -> StageRows:
    """Several tables in a row, with their blocks."""
    rest = [name for name in StageRows.__struct_fields__ if name != "blocks"]
    return StageRows(
        blocks=blocks, **{name: np.concatenate([getattr(t, name) for t in tables]) for name in rest}
    )
