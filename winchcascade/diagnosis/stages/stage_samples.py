"""Samples and blocks that count of the logs of a cascade without a model, and the rows of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.accuracy import error_sources
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.integrate import median
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.run import CLOCK
from winchcascade.core.scales import motion_of_runs
from winchcascade.diagnosis.fit.block_means import MIN_SAMPLES, Blocks, blocks_of
from winchcascade.diagnosis.stages.stage_laws import Suspecteds, suspected_laws
from winchcascade.diagnosis.stages.stage_rows import (
    EVERY_SAMPLE,
    PARTS_OF_RUN,
    PathSamples,
    StageData,
    StageRows,
    data_of,
    rows_of,
)
from winchcascade.diagnosis.stages.stage_signals import (
    StagePath,
    StageSignals,
    axes_of,
    paths_of,
    stage_signals,
)
from winchcascade.reduction.bins import engaged
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.effects.catalogue import EFFECTS

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Mask, Run, Signal
    from winchcascade.diagnosis.campaign_entries import Entries
    from winchcascade.diagnosis.fit.suspects import Suspects


BLOCK_SHARE = 0.1
"""Length of the blocks of a winch, whose ramps take long, over those of a rig with a model. [1]"""


BLOCK_LENGTH = 5 / 6
"""Length of the blocks of a shaft as a share of the width that smooths its motion: longer than the
ringing of the shaft, shorter than an acceleration. [1]"""


MIN_BLOCKS = 30
"""Minimum number of blocks of a log of a winch: five for each of its laws."""


MAJORITY = 0.5 + 1e-9
"""Share of the samples of a block that is more than half of it. [1]"""


def stage_data(
    entries: Entries,
    rig: Rig,
    suspects: Suspects,
    *,
    paths: Sequence[StagePath] = (),
    mapped: bool = False,
) -> StageData:
    """Take the blocks that count out of logs.

    Parameters
    ----------
    paths : that are looked at; all by default
    mapped : laws are made of the axes of the path alone, and no sensor is a suspect

    Raises
    ------
    LogError, CampaignError : a log lacks a channel, or an entry the cycles that it names
    OptionError : no suspect acts between two stages
    RigError : the rig file states a law that the stage has not
    """
    rig = with_thresholds(rig, entries.runs)
    chosen = tuple(paths) or paths_of(entries.runs, rig)
    first = [stage_signals(entries.runs[0], rig, path) for path in chosen]
    axes = tuple(axes_of(one.signals) for one in first)
    over = [name for pair in axes for name in pair] if mapped else ()
    laws = suspected_laws(first, chosen, rig, suspects, over)
    if not laws:
        raise OptionError(
            f"none of the suspects ({', '.join(suspects)}) acts between "
            f"{' and '.join(chosen[0].name.split('-'))}; suspect "
            f"{', '.join(suspected_laws(first, chosen, rig, EFFECTS))}."
        )
    cycles = entries.cycles or [None] * len(entries.runs)
    tables: list[StageRows] = []
    for k, (run, asked) in enumerate(zip(entries.runs, cycles, strict=True)):
        several = _samples_of(run, rig, chosen, laws, (k, len(entries.runs)))
        table = rows_of(run.t, _blocks(run, rig, asked), enumerate(several), laws, axes, k)
        needed = MIN_BLOCKS if _by_motion(run, rig) else 1
        if table.t.size < needed:
            raise CampaignError(
                f"{run.name}: {table.t.size} blocks of samples hold the powers of both stages in "
                f"the cycles that count, and {needed} are needed; name more cycles or use a longer "
                "log."
            )
        tables.append(table)
    return data_of(entries.runs, entries.withheld, chosen, laws, axes, tables)


def _by_motion(run: Run, rig: Rig) -> bool:
    """Whether the cycles of a log are found in the motion of a line, with payouts and haul-ins."""
    return rig.phases.by_motion and "velocity" in run.channels


def _samples_of(
    run: Run, rig: Rig, paths: Sequence[StagePath], laws: Suspecteds, number: tuple[int, int]
) -> Iterator[PathSamples]:
    """The paths of a log; a block counts where more than half of its samples were logged.

    Behind a one-way clutch only blocks count throughout which the clutch drives the shaft.

    Parameters
    ----------
    number : of the log, and how many logs there are
    """
    clutched = rig.drivetrain.one_way_clutch and "velocity" in run.channels
    for k, path in enumerate(paths):
        one, share = stage_signals(run, rig, path), MAJORITY
        good = _logged(run, rig, path) & np.isfinite(one.power_in + one.power_out)
        if clutched and path.into.name != "line":
            cycles = reduce(run, rig=rig).complete
            plateaus = [cycle.summary.payout.plateau for cycle in cycles]
            good, share = (
                good & engaged(run, [c.phases for c in cycles], plateaus, rig),
                EVERY_SAMPLE,
            )
        known = _known(run, rig, one, laws, k, number)
        stated = [
            law.stated.value * one.column(law.law)
            for law in laws.values()
            if k in law.paths and law.stated is not None
        ]
        given = np.sum([one.power_in, *stated], axis=0)
        yield PathSamples(msgspec.structs.replace(one, power_in=given), good, share, known)


def _logged(run: Run, rig: Rig, path: StagePath) -> Mask:
    """Samples at which nothing is bridged that the powers of a path are made of, (n,)."""
    powers = [stage.power(run.channels, rig.r_drum) for stage in (path.into, path.out)]
    used = {name for power in powers if power is not None for name in power.channels}
    logged, step = np.ones(run.t.size, dtype=bool), median(np.diff(run.t))
    for channel in (CLOCK, "velocity", *used):
        for a, b in run.gaps.get(channel, np.zeros((0, 2))).tolist():
            logged &= ~((run.t > a - step) & (run.t < b + step))
    return logged


def _known(
    run: Run, rig: Rig, one: StageSignals, laws: Suspecteds, path: int, number: tuple[int, int]
) -> list[Signal]:
    """What one standard uncertainty adds to power out minus power in, (n,) each: of the stated laws
    and of the gains of the sensors, which all logs share, and of the zeros of the sensors, which
    each log has of its own. [W]
    """
    none = np.zeros(run.t.size)
    stated = [
        (law, law.stated.u) for law in laws.values() if law.stated is not None and law.stated.u
    ]
    made = [u * one.column(law.law) if path in law.paths else none for law, u in stated]
    for channel, sensor in rig.sensors.items():
        for source in error_sources(channel, sensor):
            column = source.u * one.errors[source.part].get(channel, none)
            each = [column if k == number[0] else none for k in range(number[1])]
            made += [column] if source.part == "gain" else each
    return made


def _blocks(run: Run, rig: Rig, asked: tuple[int, int] | None) -> Blocks:
    """Blocks of a log: by the phases of its motion, or of a bench pieces of the windows of its
    cycles.
    """
    if _by_motion(run, rig):
        return blocks_of(run, rig, BLOCK_SHARE * motion_of_runs([run]).ramp, asked)
    cycles = [
        cycle
        for cycle in reduce(run, rig=rig).complete
        if asked is None or asked[0] <= cycle.cycle <= asked[1]
    ]
    step = median(np.diff(run.t))
    length = max(BLOCK_LENGTH * rig.thresholds.smoothing, MIN_SAMPLES * step)
    pieces: list[Signal] = []
    for cycle in cycles:
        begin, end = cycle.window.onset, cycle.window.cutoff
        count = max(int((end - begin) / length + 1e-6), 1)
        edges = np.searchsorted(run.t, np.linspace(begin, end, count + 1))
        edges[-1] = np.searchsorted(run.t, end, side="right")
        whole = np.diff(edges) >= min(0.5 * length / step, 2.0)
        joined = np.concatenate(([False], whole[:-1]))
        same = np.full(count, PARTS_OF_RUN.index("window")), np.full(count, cycle.cycle)
        pieces.append(np.column_stack([edges[:-1], edges[1:], *same, joined])[whole])
    if not pieces:
        raise LogError(
            f"{run.name}: no cycle is complete; a diagnosis needs one, so check [phases] of the "
            f"rig file."
        )
    start, stop, phases, numbers, joined_to = np.vstack(pieces).T
    return Blocks(start, stop, phases, numbers, joined_to.astype(bool))
