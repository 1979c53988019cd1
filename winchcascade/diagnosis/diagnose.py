"""Diagnose a campaign: where the gap lies, which effects cause it, how far they close it, and what to test next."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError, OptionError
from winchcascade.diagnosis.causes import causes_of, probabilities
from winchcascade.diagnosis.closure import ModelClosure, close
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, Experiment, NamedCause, Remainder, Verdict, Where
from winchcascade.diagnosis.evidence import Fit, fit_set
from winchcascade.diagnosis.gap_location import arises, locate
from winchcascade.diagnosis.gap_map import Place, compare, without_zeros
from winchcascade.diagnosis.misfit import Fitted
from winchcascade.diagnosis.next_run import plan
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.remainder import alarms_of
from winchcascade.diagnosis.rules import HALF, NAMED, check_withheld
from winchcascade.diagnosis.selection import Found, search
from winchcascade.diagnosis.stagewise import StagePlace, stagewise

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.diagnosis_result import Alarm, Spot
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.diagnosis.suspects import Suspects


class ModelDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis by a model. `predicted` (M, 5) are the blocks of the rig as given, `fitted` of the fit with its causes.

    `places` map the gap end to end, `stages` stage by stage.
    """

    data: Fitted
    found: Found
    closure: ModelClosure | None
    stages: tuple[StagePlace, ...]
    predicted: Signal
    fitted: Signal


def diagnose(
    runs: Sequence[Run],
    rig: Rig,
    suspects: Suspects,
    *,
    title: str = "",
    cycles: Sequence[tuple[int, int] | None] | None = None,
    withheld: Sequence[int] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """Diagnose some runs on one rig, which is taken as given and never calibrated first.

    Parameters
    ----------
    suspects : effects by name that may be named
    cycles : of each run, the first and last cycle that count, None for all
    withheld : numbers of runs that take part in neither choice nor fit; without any, causes are chosen on all runs and each
        run but open circuits is left out of the fit once
    seed : of the resampling that the closure's interval comes from
    tell : is told what is being done

    Raises
    ------
    CampaignError : fewer runs take part than a choice needs
    LogError : no run has a channel that the model gives
    RigError : the rig file lacks numbers that the model needs
    """
    check_withheld(runs, cycles, withheld, title)
    tell("simulating the rig as given")
    data = Fitted(runs, rig, cycles, withheld)
    _check_compared(data)
    found = search(data, suspects, tell)
    judged = _judge(data, suspects, found, withheld, seed, tell)
    predicted = data.predict(np.zeros(len(data.nuisances)), [])
    places, stages = _map(data, predicted), stagewise(data)
    return ModelDiagnosis(
        title=title,
        rig=rig,
        seed=seed,
        data=data,
        found=found,
        runs=tuple(log.run for log in data.logs),
        suspects=suspects,
        chosen=found.best.names,
        verdict=judged.verdict,
        where=_where(data, predicted, places, stages, judged),
        causes=judged.causes,
        closure=judged.closure,
        remainder=judged.remainder,
        experiment=judged.experiment,
        places=places,
        stages=stages,
        predicted=predicted,
        fitted=data.predict(found.best.nu, found.best.effects(suspects)),
        sets=probabilities(found.fits, found.scale),
    )


def _check_compared(data: Fitted) -> None:
    """Refuse runs without a channel that the model gives: nothing would stand out, and that would be no finding."""
    if not any(log.noise.seen.any() for k, log in enumerate(data.logs) if k not in data.withheld):
        raise LogError(
            f"{data.logs[0].run.name}: no log that takes part has {', '.join(CHANNELS[:-1])} or {CHANNELS[-1]} that the model "
            "could be compared with; expected one of them at least beside the velocity. Name the columns in a rig file under "
            "[columns]."
        )


class _Judged(msgspec.Struct, frozen=True):
    """What follows from a search: the verdict and what belongs to it."""

    verdict: Verdict
    causes: tuple[NamedCause, ...] = ()
    closure: ModelClosure | None = None
    remainder: Remainder | None = None
    experiment: Experiment | None = None


def _judge(
    data: Fitted, suspects: Suspects, found: Found, withheld: Sequence[int], seed: int, tell: Callable[[str], None]
) -> _Judged:
    """Close the gap on withheld logs with the causes that were found, and weigh what is left."""
    alarms = alarms_of(data, suspects, found.best)
    if not found.best.names:
        if not alarms:
            return _Judged("no_gap")
        return _Judged("unexplained", remainder=Remainder(1.0, alarms, _worst(alarms)))
    tell("predicting withheld runs")
    left_out = list(withheld) or [k for k, log in enumerate(data.logs) if not math.isinf(log.load)]
    closure = close(data, suspects, found.best, left_out or list(range(len(data.logs))), seed)
    verdict = _verdict(alarms, closure)
    tell("looking for rivals")
    causes = causes_of(data, suspects, found)
    if verdict != "explained":
        causes = causes[:NAMED]
    remainder = Remainder(max(1.0 - closure.share, 0.0), alarms, _worst(alarms))
    return _Judged(verdict, causes, closure, remainder, _experiment(data, suspects, found, causes))


def _where(
    data: Fitted, predicted: Signal, places: Sequence[Place], stages: Sequence[StagePlace], judged: _Judged
) -> Where | None:
    """Where the gap lies: in the leading cause's stage if that explains it, else in the one that is most off by itself."""
    if judged.verdict == "no_gap":
        return None
    own, lead = arises(stages), judged.causes[0].stage if judged.causes else None
    stage = lead if judged.verdict == "explained" else own.stage or lead
    return locate(data, without_zeros(data, data.measured - predicted), places, stage, own)


def _map(data: Fitted, predicted: Signal) -> tuple[Place, ...]:
    tolerances = data.tolerances(np.zeros(len(data.nuisances)), [], predicted)
    known = [k for k, n in enumerate(data.nuisances) if n.kind != "zero"]
    return compare(data, predicted, tolerances[:, :, known])


def _verdict(alarms: Sequence[Alarm], closure: ModelClosure) -> Verdict:
    """Contract: explained when nothing structured remains, unexplained when less than half is closed, partly in between."""
    if not alarms:
        return "explained"
    return "unexplained" if closure.share < HALF else "partly_explained"


def _worst(alarms: Sequence[Alarm]) -> Spot | Nuisance | None:
    """Where the remainder shows most; a nuisance that was pulled too far only where no channel shows it."""
    shown = [alarm for alarm in alarms if alarm.kind != "nuisance"] or alarms
    return shown[0].about if shown else None


def _experiment(data: Fitted, suspects: Suspects, found: Found, causes: Sequence[NamedCause]) -> Experiment | None:
    """The run that would tell the leading cause from its rival or, where it has none, from the suspect that comes closest."""
    if not causes:
        return None
    lead = next((cause for cause in causes if cause.rivals), causes[0])
    kept = tuple(n for n in found.best.names if n != lead.effect)
    others = [r for r in suspects if r not in found.best.names]
    if not others:
        return None
    rival = (
        lead.rivals[0].effect
        if lead.rivals
        else max(others, key=lambda r: found.linear.evidence((*kept, r), found.scale))
    )
    names = tuple(sorted((*kept, rival)))
    fit: Fit = found.fits.get(names) or fit_set(data, suspects, names, start=found.best, quick=True)
    return plan(data, suspects, found.best, fit, (lead.effect, rival))


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
        own = [k for k, run in enumerate(runs) if run.load is not None and _same(run.load, load)]
        if not own:
            there = ", ".join(f"{run.load:g}" for run in runs if run.load is not None)
            raise OptionError(f"--withhold {load:g}: no run of the campaign has this load; it has {there} ohm.")
        found += own
    return sorted(set(found))


def _same(one: float, other: float) -> bool:
    return one == other or (math.isfinite(one) and math.isclose(one, other, rel_tol=1e-6))
