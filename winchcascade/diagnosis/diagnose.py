"""Diagnose a campaign: where the gap lies, which effects cause it and matter, how far they close it, and what to test next."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.causes import causes_of, plan_run, probabilities
from winchcascade.diagnosis.closure import ModelClosure, alarms_of, close
from winchcascade.diagnosis.contributions import EFFICIENCIES, by_cost, contributions_of, reordered, without
from winchcascade.diagnosis.diagnosis_result import (
    HALF,
    NAMED,
    Contribution,
    DiagnosisResult,
    Entries,
    LargestChange,
    Minor,
    NamedCause,
    OwnSimulation,
    Remainder,
    StagePlace,
    Verdict,
)
from winchcascade.diagnosis.entries import bound_to
from winchcascade.diagnosis.evidence import Fit, Found, search
from winchcascade.diagnosis.gap_map import arises, compare, locate, without_zeros
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.nuisances import before_calibration
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.stability import with_stability
from winchcascade.diagnosis.stagewise import stagewise

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.suspects import Suspects


class ModelDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis by a model. `predicted` (M, 5) are the blocks of the model of the rig file, or of the owner's own simulation
    where there is one, `fitted` those of the fit with its causes. `rig` is as its file states it; `data.rig` has the numbers
    before their calibration, which the causes are found against.

    `places` map the gap end to end, `stages` stage by stage; `contributions` split the metrics of every run.
    """

    data: Fitted
    found: Found
    closure: ModelClosure | None = None
    stages: tuple[StagePlace, ...]
    predicted: Signal
    fitted: Signal
    own_simulation: OwnSimulation | None = None
    contributions: tuple[Contribution, ...] = ()


@linear_algebra_on_one_thread()
def diagnose(
    runs: Sequence[Run],
    rig: Rig,
    suspects: Suspects,
    *,
    title: str = "",
    cycles: Sequence[tuple[int, int] | None] | None = None,
    windows: Sequence[float | None] | None = None,
    withheld: Sequence[int] = (),
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """Diagnose some runs on one rig, each number of which enters as it was before any calibration.

    A calibration explains an open circuit by the numbers of the rig alone, and so absorbs a part of what acts on it.

    Parameters
    ----------
    suspects : effects by name that may be named
    cycles : of each run, the first and last cycle that count, None for all
    windows : of each run, the length of its integration windows [s], None for the rule of the rig
    withheld : numbers of runs that take part in neither choice nor fit; without any, causes are chosen on all runs and each
        run but open circuits is left out of the fit once
    seed : of the resampling that the closure's interval comes from
    on_progress : called with a sentence on each step

    Raises
    ------
    CampaignError : fewer runs take part than a choice needs
    LogError : no run has a channel that the model gives
    RigError : the rig file lacks numbers that the model needs
    """
    Entries(runs, cycles, withheld, title).check_withheld()
    on_progress("simulating the model of the rig file")
    before = before_calibration(rig)
    data, suspects = Fitted(runs, before, cycles, withheld), bound_to(suspects, before, runs)
    if not any(log.noise.seen.any() for k, log in enumerate(data.logs) if k not in data.withheld):
        raise LogError(
            f"{data.logs[0].run.name}: no log that takes part has {', '.join(CHANNELS[:-1])} or {CHANNELS[-1]} that the model "
            "could be compared with; expected one of them at least beside the velocity. Name the columns in a rig file under "
            "[columns]."
        )
    found, nothing = search(data, suspects, on_progress), np.zeros(len(data.nuisances))
    predicted = data.predict(nothing, [])
    as_found = ModelDiagnosis(
        title=title,
        rig=rig,
        seed=seed,
        data=data,
        found=found,
        runs=tuple(log.run for log in data.logs),
        suspects=suspects,
        chosen=found.best.names,
        places=compare(data, predicted, data.tolerances(nothing, [], predicted)),
        stages=stagewise(data),
        predicted=predicted,
        fitted=data.predict(found.best.nu, found.best.effects(suspects)),
        sets=probabilities(found.fits, found.scale),
    )
    judged = _judged(as_found, on_progress)
    on_progress("splitting the difference among the causes")
    return _accounted(judged, contributions_of(data, suspects, found, judged.causes, windows))


def _accounted(result: ModelDiagnosis, contributions: Sequence[Contribution]) -> ModelDiagnosis:
    """The result with what each cause contributes: causes that matter in the order of what they cost, the others as minor."""
    data, suspects, found = result.data, result.suspects, result.found
    minor = _minor(data, suspects, found.best, result.causes, contributions)
    small = {one.effect for one in minor}
    causes = by_cost([cause for cause in result.causes if cause.effect not in small], contributions)
    result = msgspec.structs.replace(
        result, causes=causes, minor=minor, contributions=reordered(without(contributions, small), causes)
    )
    if not causes and result.verdict == "explained":
        return msgspec.structs.replace(
            result, verdict="no_gap", where=None, closure=None, remainder=None, experiment=None
        )
    if not causes:
        return msgspec.structs.replace(result, closure=None, experiment=None)
    if result.experiment is not None and small & set(result.experiment.separates):
        return msgspec.structs.replace(result, experiment=plan_run(data, suspects, found, causes))
    return result


def _judged(result: ModelDiagnosis, on_progress: Callable[[str], None]) -> ModelDiagnosis:
    """The result with its verdict: what the causes close on withheld logs, what remains, where the gap lies, what to test next.

    Contract: explained when no structure remains, unexplained when less than half is closed, partly explained in between.
    """
    data, suspects, found = result.data, result.suspects, result.found
    alarms = alarms_of(data, suspects, found.best)
    if not (found.best.names or alarms):
        return result
    if found.best.names:
        on_progress("predicting withheld runs")
        loaded = [k for k, log in enumerate(data.logs) if not math.isinf(log.load)]
        left_out = sorted(data.withheld) or loaded or range(len(data.logs))
        closure = close(data, suspects, found.best, left_out, result.seed)
        verdict: Verdict = "explained" if not alarms else "unexplained" if closure.share < HALF else "partly_explained"
        on_progress("looking for alternative explanations")
        causes = with_stability(data, suspects, found.best, found.scale, causes_of(data, suspects, found))
        result = msgspec.structs.replace(
            result, verdict=verdict, closure=closure, causes=causes if verdict == "explained" else causes[:NAMED]
        )
    else:
        result = msgspec.structs.replace(result, verdict="unexplained")
    shown = [alarm for alarm in alarms if alarm.kind != "nuisance"] or alarms
    own, lead = arises(result.stages), result.causes[0].stage if result.causes else None
    stage = lead if result.verdict == "explained" else own.stage or lead
    return msgspec.structs.replace(
        result,
        where=locate(data, without_zeros(data, data.measured - result.predicted), result.places, stage, own),
        remainder=Remainder(
            share=1.0 if result.closure is None else max(1.0 - result.closure.share, 0.0),
            alarms=alarms,
            worst=shown[0].about if shown else None,
        ),
        experiment=plan_run(data, suspects, found, result.causes),
    )


def _minor(
    data: Fitted,
    suspects: Suspects,
    best: Fit,
    causes: Iterable[NamedCause],
    contributions: Sequence[Contribution],
) -> tuple[Minor, ...]:
    """Causes that change nothing by as much as the rig file calls relevant, each with its largest change."""
    accuracy, found = data.rig.model, []
    for cause in causes:
        changes = [
            (abs(change.change) / max(limit, 1e-12), change)
            for limit, several in (
                (accuracy.relevant_efficiency, _changes_of_efficiencies(cause.effect, contributions)),
                (accuracy.relevant_share, _changes_of_channels(data, suspects, best, cause.effect)),
            )
            for change in several
        ]
        ratio, largest = max(changes, key=lambda pair: pair[0], default=(math.inf, None))
        if largest is not None and ratio < 1.0:
            found.append(Minor(cause.effect, cause.stage, cause.parameters, largest))
    return tuple(found)


def _changes_of_efficiencies(effect: str, contributions: Sequence[Contribution]) -> list[LargestChange]:
    """What one cause changes of each efficiency of each run. [1]"""
    return [
        LargestChange(one.metric, part.value, load=one.load)
        for one in contributions
        if one.metric in EFFICIENCIES
        for part in one.parts
        if part.effect == effect
    ]


def _changes_of_channels(data: Fitted, suspects: Suspects, best: Fit, effect: str) -> list[LargestChange]:
    """What one cause changes of the mean of each channel in each phase of each log, as a share of its plateau. [1]"""
    acting = dict(zip(best.names, best.effects(suspects), strict=True))
    others = [one for name, one in acting.items() if name != effect]
    moved = data.predict(best.nu, [*acting.values()]) - data.predict(best.nu, others)
    level = np.concatenate([log.courses[:, :, 0] for log in data.logs])
    return [
        LargestChange(
            CHANNELS[k],
            float(np.mean(moved[here, k])) / max(float(np.max(level[here, k])), 1e-12),
            phase=PHASES[phase],
            load=data.logs[log].run.load,
        )
        for log, k, phase, here in data.cells()
        if here.size
    ]


def withheld_numbers(loads: Sequence[float], runs: Sequence[Run], marked: Sequence[bool]) -> list[int]:
    """Numbers of the runs to withhold: those of the loads that are named, else those that the campaign marks.

    Raises
    ------
    OptionError : no run has such a load
    """
    if not loads:
        return [k for k, mark in enumerate(marked) if mark]
    found: list[int] = []
    for load in loads:
        own = [k for k, run in enumerate(runs) if run.load is not None and math.isclose(run.load, load, rel_tol=1e-6)]
        if not own:
            there = ", ".join(f"{run.load:g}" for run in runs if run.load is not None)
            raise OptionError(f"--withhold {load:g}: no run of the campaign has this load; it has {there} ohm.")
        found += own
    return sorted(set(found))
