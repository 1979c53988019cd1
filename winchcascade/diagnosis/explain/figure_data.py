"""What figures and tables of a diagnosis show: block means before and after the causes, one
cycle, the roll-off, costs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Contribution, DiagnosisResult, NamedCause
from winchcascade.diagnosis.explain.contributions import leading_metric, loaded_part
from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT, PHASES
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.judge.causes import posterior_of
from winchcascade.rig.effects.laws import share_of_k_e
from winchcascade.rig.parts import ROLLOFF_KNOTS
from winchcascade.rig.state import constants

if TYPE_CHECKING:
    import pandas as pd

SIDES = ["logged", "before", "after"]
"""Columns of a table of blocks: as logged, and as simulated before and after the causes."""

LEAD, TAIL = 0.1, 0.05
"""Time before the onset of a cycle and after its haul-in that belongs to it here, over the time
of a stroke. [1]
"""

ROLLOFF = "ke_rolloff"

DRAWS, POINTS = 400, 120
"""Draws of the fields of a law for its band, and points of the law."""


def by_load(found: ModelDiagnosis) -> list[int]:
    """Numbers of the logs from the open circuit to the smallest resistance."""
    return sorted(range(len(found.data.logs)), key=lambda k: -found.data.logs[k].load)


def block_table(found: ModelDiagnosis) -> pd.DataFrame:
    """Block means of a diagnosed campaign: one row for each block and channel that depends on the
    model there.

    Columns are `log` (its number), `cycle`, `phase` (a number), `channel`, `t` (middle of the
    block) [s], `rpm` that the line gives while the clutch is engaged, `noise` (one standard
    deviation of the mean) and `SIDES`, SI units. The zeros of each log are estimated alike on
    either side. `after` comes from fits without the log, where there are such; NaN without causes.
    """
    import pandas as pd

    data, logged = found.data, found.data.measured
    before = logged - data.gap(found.predicted)
    after = np.full_like(logged, math.nan)
    if found.causes:
        after = logged - data.gap(found.fitted_blocks)
    if found.causes and found.closure is not None:
        after = np.where(
            np.isfinite(found.closure.residual[:, :1]), logged - found.closure.residual, after
        )
    logs = [(log.run, log.course.blocks) for log in data.logs]
    where = {
        "log": np.repeat(np.arange(len(logs)), data.sizes),
        "cycle": np.concatenate([blocks.cycle for _, blocks in logs]),
        "phase": data.blocks.phase,
        "t": np.concatenate(
            [0.5 * (run.t[blocks.start] + run.t[blocks.stop - 1]) for run, blocks in logs]
        ),
        "rpm": np.concatenate([blocks.mean(run.channels["velocity"]) for run, blocks in logs])
        * (found.rig.rpm_per_velocity or math.nan),
    }
    return pd.concat(
        [
            pd.DataFrame(
                {**where, "channel": name, "noise": data.noise[:, k]}
                | dict(zip(SIDES, (logged[:, k], before[:, k], after[:, k]), strict=True))
            )[data.seen[:, k]]
            for k, name in enumerate(CHANNELS)
        ],
        ignore_index=True,
    )


# ------------------------------------------------------------------------------ one cycle in full
class SimulatedCycle(NamedTuple):
    """One cycle of one run: numbers of both, its onset on the clock of the log [s], and the end of
    its payout since then [s].

    `t` (n,) are instants since the onset [s]; `sides`, (n, 5) each, are columns of `CHANNELS`, SI
    units, NaN where the run has no such channel: logged, without the zeros of the sensors that the
    joint fit estimates, by the baseline and, where effects were fitted, with these.
    """

    log: int
    cycle: int
    onset: float
    payout_end: float
    t: Signal
    sides: list[Signal]


def largest_gap(found: ModelDiagnosis, table: pd.DataFrame) -> SimulatedCycle | None:
    """The cycle with the largest mean square of the gap of the baseline over its noise at the place
    of the map with the largest one, where blocks show it; None where no run has a payout.
    """
    gap = table[table.cycle > 0].assign(
        square=((table.logged - table.before) / table.noise.where(table.noise > 0.0, 1.0)) ** 2
    )
    known = [place for place in found.places if math.isfinite(place.z)]
    if known:
        worst = max(known, key=lambda place: abs(place.z))
        here = (gap.log == worst.log) & (gap.channel == worst.channel)
        own = gap[here & (gap.phase == PHASES.index(worst.phase))]
        gap = gap if own.empty else own
    gaps = gap.groupby(["log", "cycle"]).square.mean()
    if gaps.empty:
        return None
    log, cycle = map(int, gaps.idxmax())
    one, nu = found.data.logs[log], found.found.best.nu
    run, blocks = one.run, one.course.blocks
    out, moving = (
        np.flatnonzero((blocks.cycle == cycle) & np.isin(blocks.phase, phases))
        for phases in ((PAYOUT,), (PAYOUT, HAUL_IN))
    )
    onset, end = float(run.t[blocks.start[out[0]]]), float(run.t[blocks.stop[moving[-1]] - 1])
    time = found.data.scales.motion.time
    rows = slice(*np.searchsorted(run.t, (onset - LEAD * time, end + TAIL * time)).tolist())
    sides = [_columns(run.channels, run.t) - found.data.zeros(nu)[log]]
    if found.own_simulation is not None:
        sides.append(_columns(found.own_simulation.runs[log].channels, run.t))
    else:
        sides.append(_at_samples(found, log, np.zeros_like(nu), fitted=False))
    if found.causes:
        sides.append(_at_samples(found, log, nu, fitted=True))
    payout_end = float(run.t[blocks.stop[out[-1]] - 1]) - onset
    return SimulatedCycle(
        log, cycle, onset, payout_end, run.t[rows] - onset, [side[rows] for side in sides]
    )


def _columns(channels: Mapping[str, Signal], t: Signal) -> Signal:
    """Channels of a run as columns of `CHANNELS`, NaN for those that it lacks, (n, 5)."""
    return np.column_stack([channels.get(name, np.full(t.size, np.nan)) for name in CHANNELS])


def _at_samples(found: ModelDiagnosis, log: int, nu: Signal, *, fitted: bool) -> Signal:
    """Channels of a run by the model at its samples, (n, 5) SI units, with the effects of the
    fit or without any.
    """
    data, course = found.data, found.data.logs[log].course
    effects = found.found.best.effects(found.suspects) if fitted else []
    return course.at_stamps(course.on_grid(data.models(nu, effects)[log], skew=data.skew(nu)))


# ----------------------------------------------------------------------------------- the roll-off
def profile_of(found: ModelDiagnosis) -> Signal | None:
    """The roll-off as far as the stator current reaches, None where it is no cause (Fig. 18e).

    Returns
    -------
    (4, n) stator current [A rms], the share of the back-EMF constant that remains, and its 95 %
    band.
    """
    data, best = found.data, found.found.best
    if ROLLOFF not in best.names or all(cause.effect != ROLLOFF for cause in found.causes):
        return None
    place = best.place[ROLLOFF]
    fitted = best.x[place]
    covariance = posterior_of(found.found, best).covariance[place, place]
    drawn = np.random.default_rng(0).multivariate_normal(
        fitted, covariance, DRAWS, check_valid="ignore", method="eigh"
    )
    rated = data.nominal.generator.i_rated
    reached = ROLLOFF_KNOTS[1] * rated
    for log, model in zip(
        data.logs, data.models(best.nu, best.effects(found.suspects)), strict=True
    ):
        if math.isfinite(log.load):
            currents = log.course.block_mean(
                log.course.electrical(constants(model, log.load, log.course.coarse.rest), "i_s")
            )
            reached = max(reached, float(np.max(currents)))
    current = np.linspace(0.0, reached, POINTS)
    fields = [fitted, *np.clip(drawn, best.free.minimum[place], best.free.maximum[place])]
    line, *lines = (share_of_k_e(tuple(x.tolist()), current / rated) for x in fields)
    low, high = np.quantile(list(lines), (0.025, 0.975), axis=0)
    return np.array([current, line, low, high])


# -------------------------------------------------------------------------- what each cause costs
def load_costs(found: ModelDiagnosis, metric: str | None) -> list[Contribution]:
    """The split of an efficiency at every load, from the largest resistance to the smallest: means
    of its runs [%, points].

    The errors of runs of one load are mostly the same, so the bounds of a part are means too.
    """
    runs = loaded_part(found.contributions, metric)
    loads = sorted({run.load for run in runs if run.load is not None}, reverse=True)
    return [_mean_costs([run for run in runs if run.load == load]) for load in loads]


def _mean_costs(runs: Sequence[Contribution]) -> Contribution:
    """The first of some splits with the means of all, in percent."""

    def mean(alike: Sequence[object], name: str) -> float:
        return 100.0 * float(np.mean([getattr(one, name) for one in alike]))

    parts = tuple(
        msgspec.structs.replace(
            part[0], value=mean(part, "value"), low=mean(part, "low"), high=mean(part, "high")
        )
        for part in zip(*(run.parts for run in runs), strict=True)
    )
    return msgspec.structs.replace(
        runs[0], as_given=mean(runs, "as_given"), measured=mean(runs, "measured"), parts=parts
    )


def mean_costs(found: DiagnosisResult) -> Contribution | None:
    """The split of the leading efficiency, by which causes are ordered, as a mean over all runs
    with a load [%, points].
    """
    given = found.contributions if isinstance(found, ModelDiagnosis) else ()
    runs = loaded_part(given, leading_metric(given))
    return _mean_costs(runs) if runs else None


def worst_costs(found: DiagnosisResult) -> Contribution | None:
    """The split of the leading efficiency at the load at which model and run differ most [%,
    points]; None without one.
    """
    if not isinstance(found, ModelDiagnosis):
        return None
    table = load_costs(found, leading_metric(found.contributions))
    return max(table, key=lambda one: abs(one.measured - one.as_given), default=None)


def cost_of(costs: Contribution | None, cause: NamedCause) -> float | None:
    """What a cause changes of an efficiency [points]; None where nothing can be said."""
    parts = () if costs is None else costs.parts
    return next((part.value for part in parts if part.effect == cause.effect), None)
