"""Diagnose a campaign: where the gap lies, which effects cause it and matter, how far they close
it, and what to test next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.diagnosis.campaign_entries import Entries
from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    DiagnosisResult,
    Minor,
    NamedCause,
    Names,
    OwnSimulation,
    Place,
    Remainder,
    SingleEffect,
    StageEnergy,
)
from winchcascade.diagnosis.explain.contributions import (
    by_cost,
    contributions_of,
    efficiency_changes,
    quantities_by,
    reordered,
    without,
)
from winchcascade.diagnosis.explain.gap_map import (
    arises,
    compare,
    deviating_stage,
    locate,
    stagewise,
)
from winchcascade.diagnosis.explain.planning import plan_run
from winchcascade.diagnosis.explain.thresholds import Threshold, not_visible, thresholds
from winchcascade.diagnosis.explain.validation import Validated, validation_of
from winchcascade.diagnosis.explain.windowed import WindowedLog, windowed_logs
from winchcascade.diagnosis.fit.entries import bound_to
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.nuisances import before_calibration
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.fit.search import Found, opened, search, weighing
from winchcascade.diagnosis.fit.undetermined import Direction, alike, undetermined
from winchcascade.diagnosis.judge.alarms import SIGNS, Judged, ringing
from winchcascade.diagnosis.judge.causes import (
    causes_of,
    chances_of,
    parameters_of,
    posterior_of,
)
from winchcascade.diagnosis.judge.closure import (
    HeldOut,
    ModelClosure,
    by_cycles,
    close,
    judging,
)
from winchcascade.diagnosis.judge.conclusion import concluded
from winchcascade.diagnosis.judge.phase_energies import energies_of
from winchcascade.diagnosis.judge.relevance import largest_change, minor_of, moved_by
from winchcascade.diagnosis.judge.stability import stabilities
from winchcascade.diagnosis.judge.verdict import parted, verdict_of
from winchcascade.diagnosis.verdict_limits import HINTS
from winchcascade.rig.simulate import read_by

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
    from winchcascade.rig.effects.effect import ActiveEffect


class ModelDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis by a model. `predicted` (M, 5) are the blocks of the model of the rig file, or of
    a simulation of the owner where there is one and `fitted_blocks` those of the fit with its
    causes. `rig` is as its file states it; `data.rig` has the numbers before their calibration,
    which the causes are found against.

    `places` map the gap end to end, `stages` stage by stage; `contributions` split the metrics of
    every run, `energies` are those of its phases, `validation` compares each metric of each run
    with the model. `thresholds` are how large each effect would have to be to be named, where none
    is, and `not_visible` those that these logs would not show at any plausible size. `singles` are
    the effects that alone have the most evidence, `undetermined` directions of the numbers of the
    rig that no log shows. `by_laws` are the laws of its stages beside it, where they are wanted.
    """

    data: Fitted
    found: Found
    closure: ModelClosure | None = None
    stages: tuple[Place, ...]
    predicted: Signal
    fitted_blocks: Signal
    own_simulation: OwnSimulation | None = None
    contributions: tuple[Contribution, ...] = ()
    energies: tuple[StageEnergy, ...] = ()
    validation: tuple[Validated, ...] = ()
    thresholds: tuple[Threshold, ...] = ()
    not_visible: Names = ()
    singles: tuple[SingleEffect, ...] = ()
    undetermined: tuple[Direction, ...] = ()
    by_laws: StageDiagnosis | None = None

    @property
    def judged(self) -> Judged:
        """What signs are sought in."""
        return Judged(
            self.data,
            self.suspects,
            self.found.best,
            fitted=self.fitted,
            causes=self.causes,
            closure=self.closure,
            energies=self.energies,
            contributions=self.contributions,
        )

    @property
    def missing_channels(self) -> list[str]:
        """Channels of the model that no log has."""
        return [
            name
            for name in read_by(self.data.nominal)
            if not any(name in run.channels for run in self.runs)
        ]


OnProgress = Callable[[str], None]
"""What is called with a sentence on each step."""


MODEL, SEARCH, CONCLUSION, CAUSES, PLAN = pairwise((0.0, 0.1, 0.5, 0.75, 0.9, 1.0))
"""Shares of the time of a diagnosis at which its parts usually begin and end, with seven logs and
with seventy. [1]"""


def during(part: tuple[float, float], on_progress: OnProgress) -> OnProgress:
    """Reports the steps of a part with the share of a diagnosis that is usually done meanwhile."""
    done = " to ".join(f"{100.0 * share:.0f}" for share in part)
    return lambda text: on_progress(f"{text} (usually {done} % done)")


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
    on_progress: OnProgress = lambda _: None,
) -> ModelDiagnosis:
    """Diagnose some runs on one rig, each number of which enters as it was before any calibration.

    A calibration explains an open circuit by the numbers of the rig alone, and so absorbs a part of
    what acts on it.

    Parameters
    ----------
    suspects : effects by name that may be named
    cycles : of each run, the first and last cycle that count, None for all
    windows : of each run, the length of its integration windows [s], None for the rule of the rig
    withheld : numbers of runs that take part in neither choice nor fit; without any, causes are
        chosen on all runs and each run but open circuits is held out of the fit once
    seed : of the resampling that the interval of the closure follows from
    on_progress : called with a sentence on each step

    Raises
    ------
    CampaignError : fewer runs take part than a choice needs
    LogError : no run has a channel that the model gives
    RigError : the rig file lacks numbers that the model needs
    """
    Entries(runs, cycles, withheld, title).check_withheld()
    during(MODEL, on_progress)("simulating the model of the rig file")
    before = before_calibration(rig)
    data = Fitted(runs, before, cycles, withheld)
    _check_channels(data)
    suspects = bound_to(suspects, before, runs, data.scales)
    directions = undetermined(data)
    problem = RigProblem(data, suspects, alike(directions, suspects))
    data, found = _searched(problem, during(SEARCH, on_progress))
    held_out = HeldOut(data, seed)
    found = concluded(data, found, held_out, during(CONCLUSION, on_progress))
    predicted = data.stated
    as_found = ModelDiagnosis(
        title=title,
        rig=rig,
        seed=seed,
        data=data,
        found=found,
        runs=tuple(log.run for log in data.logs),
        suspects=suspects,
        chosen=found.best.names,
        places=compare(data, predicted),
        stages=stagewise(data),
        predicted=predicted,
        fitted_blocks=data.predict(found.best.nu, found.best.effects(suspects)),
        sets=chances_of(found),
        energies=energies_of(data, suspects, found.best),
        not_visible=not_visible(found),
        singles=_singles(found, held_out),
        undetermined=directions,
    )
    with_causes = _with_causes(as_found, held_out, windows, during(CAUSES, on_progress))
    return judged(with_causes, during(PLAN, on_progress))


def _check_channels(data: Fitted) -> None:
    """Reject logs of which none that takes part has a channel of the model: LogError."""
    channels = read_by(data.nominal)
    if not any(data.logs[k].noise.seen.any() for k in data.taking):
        raise LogError(
            f"{data.logs[0].run.name}: no log that takes part has {', '.join(channels[:-1])} or "
            f"{channels[-1]} that the model could be compared with; expected one of them at least "
            "beside the velocity. Name the columns in a rig file under [columns]."
        )


NOISE_TAKEN = 2
"""Number of times at most that the noise in ramps is taken: of the first set that is found, and of
the best one where this is another. [1]"""


def _searched(problem: RigProblem, on_progress: OnProgress) -> tuple[Fitted, Found]:
    """What a search finds, with the scatter of its residual within slow ramps as noise."""
    data, found = problem.data, opened(problem, on_progress)
    for _ in range(NOISE_TAKEN):
        lead = found.top
        residual = data.measured - data.predict(lead.nu, lead.effects(problem.suspects))
        with_noise = msgspec.structs.replace(problem, data=data.with_ramps(residual))
        found = search(with_noise, on_progress, found)
        if found.best.names == lead.names:
            break
    return with_noise.data, found


def _singles(found: Found, held_out: HeldOut) -> tuple[SingleEffect, ...]:
    """The effects that alone have the most evidence, best first."""
    evidence, gap = weighing(found).of, bool(found.best.names)
    return tuple(
        SingleEffect(
            fit.names[0],
            evidence(fit) - evidence(found.best),
            held_out.of(found, fit).share if gap else math.nan,
        )
        for fit in found.singles()
    )


def _with_causes(
    result: ModelDiagnosis,
    held_out: HeldOut,
    windows: Sequence[float | None] | None,
    on_progress: OnProgress,
) -> ModelDiagnosis:
    """The result with the causes of the best fit, what each contributes, how far they close the
    gap, and what is too small.
    """
    data, suspects, found = result.data, result.suspects, result.found
    logs = windowed_logs(data, windows)
    if not found.best.names:
        on_progress("finding the smallest effects that these logs show")
        contributions, _, inputs = contributions_of(data, found, (), logs)
        return msgspec.structs.replace(
            result,
            minor=_hints(result),
            contributions=contributions,
            thresholds=_thresholds(result, logs),
            validation=validation_of(data, found, {}, inputs, logs),
        )
    on_progress("predicting withheld runs")
    withheld = sorted(data.withheld)
    left_out = withheld or judging(data)
    closure = (
        close(data, found, found.best, withheld, result.seed)
        if withheld
        else held_out.of(found, found.best)
    )
    on_progress("looking for alternative explanations")
    causes, stability = causes_of(data, found, result.undetermined), stabilities(data, found)
    fitted = tuple(
        msgspec.structs.replace(cause, stability=stability[cause.effect]) for cause in causes
    )
    on_progress("splitting the difference among the causes")
    predictions = {} if by_cycles(data, left_out) else closure.predictions
    contributions, changes, inputs = contributions_of(data, found, fitted, logs, predictions)
    moved = moved_by(data, suspects, found.best)
    minor = minor_of(data, fitted, changes, moved)
    small = {one.effect for one in minor}
    causes = by_cost([cause for cause in fitted if cause.effect not in small], contributions)
    return msgspec.structs.replace(
        result,
        closure=closure,
        fitted=fitted,
        causes=causes,
        minor=(*minor, *_hints(result)),
        contributions=reordered(without(contributions, small), causes),
        validation=validation_of(data, found, predictions, inputs, logs),
    )


def judged(result: ModelDiagnosis, on_progress: OnProgress) -> ModelDiagnosis:
    """The result with its verdict, what remains, where the gap lies, and what to test next."""
    data, found, closure = result.data, result.found, result.closure
    signs = ringing(result.judged, *SIGNS)
    causes, minor = result.causes, {one.effect for one in result.minor}
    if not (causes or signs):
        return msgspec.structs.replace(result, closure=None)
    share = 0.0 if closure is None else closure.share
    verdict = verdict_of(signs, share)
    candidates: tuple[NamedCause, ...] = ()
    if verdict != "explained":
        causes, candidates = parted(causes, signs, share)
    on_progress("planning the next run")
    deviating, lead = arises(result.stages), causes[0].stage if causes else None
    stage = lead if verdict == "explained" else deviating_stage(deviating) or lead
    shown = [alarm for alarm in signs if alarm.kind != "nuisance"] or signs
    gone = {one.effect for one in result.causes} - {one.effect for one in causes}
    return msgspec.structs.replace(
        result,
        verdict=verdict,
        causes=causes,
        candidates=candidates,
        contributions=without(
            result.contributions, gone | minor, among="residual" if gone else "tolerances"
        ),
        where=locate(data, data.gap(result.predicted), result.places, stage, deviating),
        remainder=Remainder(
            share=1.0 if closure is None else max(1.0 - share, 0.0),
            alarms=signs,
            worst=shown[0].about if shown else None,
        ),
        experiment=plan_run(data, found, causes or candidates),
    )


def _thresholds(result: ModelDiagnosis, logs: Sequence[WindowedLog]) -> tuple[Threshold, ...]:
    """How large each effect would have to be to be named in logs that need none."""
    data, nu = result.data, result.found.best.nu
    before = quantities_by(data, nu, [], logs)

    def relevance(effect: ActiveEffect) -> float:
        moved = (
            data.predictions_near((nu, []), [(nu, [effect])])[:, :, 0] - data.nearby((nu, [])).at
        )
        size = largest_change(data, (), moved)[0]
        if size >= 1.0:
            return size
        changes = efficiency_changes(logs, before, quantities_by(data, nu, [effect], logs))
        return largest_change(data, changes, np.zeros_like(data.noise))[0]

    return thresholds(result.found, relevance)


def _hints(result: ModelDiagnosis) -> tuple[Minor, ...]:
    """Effects that beside the causes have evidence, though less than a cause needs, strongest
    first.
    """
    data, suspects, found = result.data, result.suspects, result.found
    best, evidence = found.best, found.evidence
    gains = {
        names: evidence.of(fit) - evidence.of(best)
        for names, fit in found.sets().items()
        if len(names) == len(best.names) + 1 and set(names) > set(best.names)
    }
    hints = []
    for names in sorted(gains, key=lambda names: -gains[names])[:HINTS]:
        fit, (name,) = found.fits[names], set(names) - set(best.names)
        if gains[names] <= 0.0:
            break
        _, largest = largest_change(data, (), moved_by(data, suspects, fit)[name])
        if largest is not None:
            numbers = parameters_of(posterior_of(found, fit), suspects[name], name)
            hints.append(Minor(name, suspects[name].stage, numbers, largest, hint=gains[names]))
    return tuple(hints)
