"""The cycle with the largest gap, sample by sample: as logged, and as simulated without and with the fitted effects."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.diagnosis.block_means import HAUL_IN, PAYOUT
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.predict import CHANNELS

LEAD, TAIL = 1.0, 0.5
"""Time before the onset of a cycle and after its haul-in that belongs to it here. [s]"""


class SimulatedCycle(NamedTuple):
    """One cycle of one run: numbers of both, its onset on the clock of the log [s], and the end of its payout since then [s].

    `t` (n,) are instants since the onset [s]; `logged`, without the zeros of the sensors that the joint fit estimates, `given`
    by the baseline and, where effects were fitted, `caused` (n, 5) are columns of `CHANNELS` in SI units, NaN where the run has
    no such channel.
    """

    log: int
    cycle: int
    onset: float
    payout_end: float
    t: Signal
    logged: Signal
    given: Signal
    caused: Signal | None

    @property
    def sides(self) -> list[Signal]:
        """Logged, by the baseline and, where there are any, with the fitted effects."""
        return [self.logged, self.given, *([] if self.caused is None else [self.caused])]


def cycle_gaps(found: ModelDiagnosis) -> dict[tuple[int, int], float]:
    """Mean square of the gap of the baseline over its noise, by run and cycle with a payout."""
    data, gaps = found.data, {}
    z = np.where(data.seen, (data.measured - found.predicted) / np.where(data.noise > 0.0, data.noise, 1.0), 0.0) ** 2
    for k, (log, rows) in enumerate(zip(data.logs, data.rows, strict=True)):
        blocks = log.course.blocks
        for cycle in np.unique(blocks.cycle[blocks.phase == PAYOUT]).tolist():
            own = rows.start + np.flatnonzero(blocks.cycle == cycle)
            gaps[k, cycle] = float(z[own].sum() / max(np.count_nonzero(data.seen[own]), 1))
    return gaps


def largest_gap(found: ModelDiagnosis) -> SimulatedCycle | None:
    """The cycle with the largest gap; None where no run has a payout."""
    gaps = cycle_gaps(found)
    if not gaps:
        return None
    log, cycle = max(gaps, key=lambda pair: gaps[pair])
    one, nu = found.data.logs[log], found.found.best.nu
    run, blocks = one.run, one.course.blocks
    out, moving = (
        np.flatnonzero((blocks.cycle == cycle) & np.isin(blocks.phase, phases))
        for phases in ((PAYOUT,), (PAYOUT, HAUL_IN))
    )
    onset, end = float(run.t[blocks.start[out[0]]]), float(run.t[blocks.stop[moving[-1]] - 1])
    rows = slice(*np.searchsorted(run.t, (onset - LEAD, end + TAIL)).tolist())
    logged = _columns(run.channels, run.t) - found.data.zeros(nu)[log]
    caused = _at_samples(found, log, nu, fitted=True)[rows] if found.causes else None
    payout_end = float(run.t[blocks.stop[out[-1]] - 1]) - onset
    return SimulatedCycle(
        log, cycle, onset, payout_end, run.t[rows] - onset, logged[rows], _baseline(found, log)[rows], caused
    )


def _columns(channels: Mapping[str, Signal], t: Signal) -> Signal:
    """Channels of a run as columns of `CHANNELS`, NaN for those that it lacks, (n, 5)."""
    return np.column_stack([channels.get(name, np.full(t.size, np.nan)) for name in CHANNELS])


def _baseline(found: ModelDiagnosis, log: int) -> Signal:
    """What the baseline predicts at the samples of a run, (n, 5): the own simulation, or the model of the rig file."""
    if found.own_simulation is not None:
        run = found.own_simulation.runs[log]
        return _columns(run.channels, run.t)
    return _at_samples(found, log, np.zeros(len(found.data.nuisances)), fitted=False)


def _at_samples(found: ModelDiagnosis, log: int, nu: Signal, *, fitted: bool) -> Signal:
    data, course = found.data, found.data.logs[log].course
    effects = found.found.best.effects(found.suspects) if fitted else []
    return course.at_stamps(course.on_grid(data.models(nu, effects)[log], skew=data.skew(nu)))
