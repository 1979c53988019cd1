"""The gap between logs and a simulation of the owner: what the simulation has in another form than
the model of the rig.

Causes are fitted with the model of the rig against the logs. The simulation is fitted as if it were
a set of logs, with the same search; beside the effects of the catalogue it may lack what
simulations usually simplify. Then

    log - simulation = causes + tolerances + (model of the rig file - simulation) + residual.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    ContributionPart,
    ModelForm,
    OwnSimulation,
    Place,
    Spot,
)
from winchcascade.diagnosis.explain.contributions import without
from winchcascade.diagnosis.explain.gap_map import STAGE_OF, compare, locate
from winchcascade.diagnosis.explain.windowed import (
    QUANTITIES,
    complete_cycles,
    quantities_of,
    windows_of,
)
from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.fitted_log import means_over
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.fit.rig_problem import RigProblem
from winchcascade.diagnosis.fit.search import Found, search
from winchcascade.diagnosis.judge.alarms import OF_THE_RESIDUAL, Judged, ringing
from winchcascade.diagnosis.judge.causes import parameters_of, posterior_of
from winchcascade.diagnosis.judge.closure import closure_between
from winchcascade.diagnosis.judge.relevance import changes_of_means, moved_by
from winchcascade.diagnosis.verdict_limits import MIN_EXCESS
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.fit.suspects import Suspects


FORM_Z_MIN = 3.0
"""Smallest significance of a place at which a simulation has another form: two that cancel each
other there show nothing.
"""


def beside_own_simulation(
    result: ModelDiagnosis,
    simulations: Sequence[Run],
    *,
    windows: Sequence[float | None] | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """A diagnosis by the model of the rig with a simulation of the owner as its baseline.

    Verdict and causes stay, as they follow from log and model; but if the simulation contains all
    causes with the same numbers and differs from the logs by no more than noise, it leaves no gap.
    Map, place, closure and contributions are those of log minus simulation.

    Parameters
    ----------
    simulations : of each run, at the stamps of its log
    windows : of each run, the length of its integration windows [s], None for the rule of the rig
    """
    data = result.data
    given = np.concatenate(
        [
            means_over(log.course.blocks, run)
            for log, run in zip(data.logs, simulations, strict=True)
        ]
    )
    places, gap = compare(data, given), data.gap(given)
    where, closure = result.where, result.closure
    fitted = fit_simulation(simulations, result, on_progress)
    result = msgspec.structs.replace(
        result,
        predicted=given,
        places=places,
        where=where and locate(data, gap, places, where.stage, where.arises),
        closure=closure
        and closure_between(data, gap, closure.residual, closure.predictions, result.seed),
        own_simulation=fitted,
        contributions=from_own_simulation(result.contributions, data, simulations, windows),
    )
    if not _agrees(result, fitted, gap):
        return result
    shared = tuple(cause.effect for cause in result.causes)
    return msgspec.structs.replace(
        result,
        verdict="no_gap",
        causes=(),
        where=None,
        closure=None,
        remainder=None,
        experiment=None,
        own_simulation=msgspec.structs.replace(fitted, shared=shared),
        contributions=without(result.contributions, shared, among="model_form"),
    )


def _agrees(result: ModelDiagnosis, fitted: OwnSimulation, gap: Signal) -> bool:
    """Whether a simulation contains all causes with the same numbers, and differs from the logs by
    no more than noise and the discrepancy of a model.

    Parameters
    ----------
    gap : (M, 5) blocks of the log minus those of the simulation, zeros taken off
    """
    if result.verdict != "explained" or result.closure is None:
        return False
    data = result.data
    judged = data.seen & np.isfinite(result.closure.residual)
    allowed = (1.0 + MIN_EXCESS) * (data.noise**2 + np.sum(data.discrepancies() ** 2, axis=2))
    small = np.sum(gap**2, axis=0, where=judged) <= np.sum(allowed, axis=0, where=judged)
    pairs = [
        (number, fitted.numbers.get(cause.effect, {}).get(name))
        for cause in result.causes
        for name, number in cause.parameters.items()
    ]
    alike = (
        other is not None and one.low <= other.high and other.low <= one.high
        for one, other in pairs
    )
    return bool(small.all()) and all(alike)


def fit_simulation(
    simulations: Sequence[Run], result: ModelDiagnosis, on_progress: Callable[[str], None]
) -> OwnSimulation:
    """Fit a simulation as if it were a set of logs, with the suspects of a diagnosis and
    the usual simplifications.
    """
    data = Fitted(simulations, result.data.rig, result.data.cycles)
    suspects: Suspects = {**result.suspects, **SIMPLIFICATIONS}
    found = search(RigProblem(data, suspects), lambda step: on_progress(f"your simulation: {step}"))
    forms = model_forms(data, suspects, found, compare(data, data.stated))
    likely = [form.likely for form in forms if form.likely is not None]
    posterior = posterior_of(found, found.best)
    numbers = {name: parameters_of(posterior, suspects[name], name) for name in likely}
    return OwnSimulation(tuple(simulations), forms, numbers)


def model_forms(
    data: Fitted, suspects: Suspects, found: Found, places: Sequence[Place]
) -> tuple[ModelForm, ...]:
    """What a simulation has in another form than the model of the rig, each at its most significant
    place, the most significant first.

    These are the effects of the fit, and stages in which the residual of the fit has a structure.

    Parameters
    ----------
    places : map of simulation minus model of the rig
    """
    forms: list[ModelForm] = []
    by_place = {(p.log, p.channel, p.phase): p for p in places}
    for name, moved in moved_by(data, suspects, found.best).items():
        changes = [
            (abs(change), by_place[at])
            for log, k, phase, change in changes_of_means(data, moved)
            if (at := (log, CHANNELS[k], PHASES[phase])) in by_place
        ]
        size, place = max(changes, key=lambda one: one[0], default=(0.0, None))
        if (
            place is not None
            and size >= data.rig.model.relevant_share
            and abs(place.z) >= FORM_Z_MIN
        ):
            forms.append(_form(suspects[name].stage, place, name))
    for alarm in ringing(Judged(data, suspects, found.best), OF_THE_RESIDUAL):
        if alarm.kind == "structure" and isinstance(alarm.about, Spot):
            here = [
                p
                for p in places
                if (p.channel, p.phase) == (alarm.about.channel, alarm.about.phase)
            ]
            stage = STAGE_OF[alarm.about.channel]
            if here and stage not in {form.stage for form in forms}:
                forms.append(_form(stage, max(here, key=lambda p: abs(p.z)), None))
    return tuple(sorted(forms, key=lambda form: -abs(form.z)))


def _form(stage: str, place: Place, likely: str | None) -> ModelForm:
    return ModelForm(stage, place.channel, place.phase, place.load, place.bias, place.z, likely)


def from_own_simulation(
    contributions: Sequence[Contribution],
    data: Fitted,
    simulations: Sequence[Run],
    windows: Sequence[float | None] | None = None,
) -> tuple[Contribution, ...]:
    """Contributions that lead from a simulation to the runs: what the model of the rig has
    beyond it is a part, too.

    Parameters
    ----------
    contributions : from the model of the rig file, as `contributions_of` gives them
    simulations : of each run, at the stamps of its log
    windows : as for `contributions_of`
    """
    settings = zip(
        data.logs, simulations, windows or [None] * len(data.logs), data.cycles, strict=True
    )
    given = {
        (number, quantity): float(value)
        for number, (log, simulation, window, span) in enumerate(settings)
        for quantity, value in zip(
            QUANTITIES,
            quantities_of(
                _along(log.run, simulation),
                data.rig,
                windows_of(complete_cycles(log.run, data.rig, window, span)),
            ),
            strict=True,
        )
    }
    return tuple(_from(one, given[one.log, one.metric]) for one in contributions)


def _along(run: Run, simulation: Run) -> Run:
    """A log with the channels of its simulation, so that both have the same windows; without
    those that either lacks.
    """
    both = {name: x for name, x in simulation.channels.items() if name in run.channels}
    return msgspec.structs.replace(run, channels=both | {"velocity": run.channels["velocity"]})


def _from(one: Contribution, given: float) -> Contribution:
    """A contribution from another value than that of the rig file; the difference becomes a part
    before the residual.
    """
    if not one.parts or not math.isfinite(given):
        return msgspec.structs.replace(one, as_given=math.nan, measured=math.nan, parts=())
    *parts, residual = one.parts
    form = one.as_given - given
    parts.append(ContributionPart(None, "model_form", form, form, form))
    return msgspec.structs.replace(one, as_given=given, parts=(*parts, residual))
