"""The gap between logs and the owner's own simulation: what the simulation has in another form than
the rig's model.

Causes are fitted with the rig's model against the logs. The own simulation is fitted as if it were
a set of logs, with the same search; beside the effects of the catalogue it may lack what
simulations usually simplify. Then

    log - own simulation = causes + tolerances + (model of the rig file - own simulation) +
    residual.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import UNITS, unit_names
from winchcascade.core.scales import motion_of_runs
from winchcascade.core.smooth import local_quadratic
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
from winchcascade.diagnosis.fit.block_means import PHASES, Blocks, blocks_of
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
from winchcascade.rig.line_velocity import SMOOTHING

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.fit.suspects import Suspects

SAME = 0.01
"""Maximum rms difference of the velocities of log and simulation, as a share of the rms
velocity. [1]
"""

AT_ONCE = 0.1
"""Smaller shifts between log and simulation, in intervals of the log, are noise of the velocity
and count as none. [1]
"""

BEYOND = 1.5
"""Number of intervals before the beginning and after the end of a simulation beyond which its
line is at rest. [1]
"""

NEAR, SHIFTED = 0.64, 1e-5
"""The shift is refined within the first of these, as the correlation of logs that begin or end
within a motion deviates, and to the second, both over the ramp of the motion. [1]"""

FINER = 1.5
"""Minimum number of samples of a simulation for each of the log from which it is averaged over
the intervals of the log. [1]
"""

APART = 5.0
"""Ratio of the levels of a simulated channel and its log, or its inverse, that shows another unit
than the assumed one: bar and kg/cm2 are too close, newton and kilogram-force are not. [1]"""

SHOWS = 3.0
"""Smallest significance of a place at which a simulation has another form: two that cancel each
other there show nothing.
"""


# ---------------------------------------------------------------------- at the stamps of the logs
def on_the_logs(
    simulations: Sequence[Run],
    logs: Sequence[Run],
    rig: Rig,
    cycles: Sequence[tuple[int, int] | None],
) -> list[Run]:
    """Bring the simulation of each run to the stamps of its log.

    Parameters
    ----------
    cycles : of each run, the first and last cycle that count, None for all

    Raises
    ------
    LogError : as `onto_log`, or a unit that was assumed is another one
    """
    found = []
    for simulation, log, span in zip(simulations, logs, cycles, strict=True):
        blocks = blocks_of(log, rig, motion_of_runs([log]).ramp, span)
        counted = slice(int(blocks.start[0]), int(blocks.stop[-1])) if blocks.size else slice(None)
        there = onto_log(simulation, log, counted)
        _check_levels(there, log, rig, blocks)
        found.append(there)
    return found


def onto_log(simulation: Run, log: Run, counted: slice) -> Run:
    """Bring a simulation to the stamps of its log.

    Parameters
    ----------
    counted : samples of the log whose cycles count

    Raises
    ------
    LogError : the simulation lacks a channel that the log has, or has another line motion
    """
    missing = [
        name for name in CHANNELS if name in log.channels and name not in simulation.channels
    ]
    if missing:
        raise LogError(
            f"{simulation.path}: the simulation has no column for {', '.join(missing)}, which the "
            f"log {log.name} has; found "
            f"{', '.join(simulation.channels)}. Export {'them' if len(missing) > 1 else 'it'} "
            f"too, or name the column in the "
            "rig file under [columns]."
        )
    shift, difference = _aligned(simulation, log, counted)
    if difference > SAME:
        raise LogError(
            f"{simulation.path}: the simulation has another line motion than the log {log.name}: "
            f"the velocities differ by "
            f"{100.0 * difference:.2g} % rms after a shift of {shift:.3g} s; expected "
            f"{100.0 * SAME:g} % at most. Drive the "
            "simulation with the velocity of the log, over all cycles that count."
        )
    channels = {
        name: _sampled(simulation, x, log, shift) for name, x in simulation.channels.items()
    }
    at_log = {"t": log.t, "fs": log.fs, "samples": log.t.size, "load": log.load}
    return msgspec.structs.replace(simulation, channels=channels, gaps={}, simulated=True, **at_log)


def _aligned(simulation: Run, log: Run, counted: slice) -> tuple[float, float]:
    """By how much the clock of a simulation is ahead of that of its log [s], and the difference of
    the velocities then [1].

    The clocks may be the same, begin with the first sample, or be related by the correlation of the
    velocities, which are taken without the noise of an encoder.
    """
    from scipy.optimize import minimize_scalar
    from scipy.signal import correlate

    ramp = motion_of_runs([log]).ramp
    width, within = SMOOTHING * ramp, NEAR * ramp
    velocity, other = (
        local_quadratic(run.t, run.channels["velocity"], width) for run in (log, simulation)
    )
    step, scale = 1.0 / log.fs, max(float(np.sqrt(np.mean(velocity[counted] ** 2))), 1e-6)

    def difference(shift: float) -> float:
        at = log.t[counted] + shift
        beyond = np.maximum(simulation.t[0] - at, at - simulation.t[-1]) > BEYOND / simulation.fs
        moved = np.where(beyond, 0.0, np.interp(at, simulation.t, other))
        return float(np.sqrt(np.mean((moved - velocity[counted]) ** 2))) / scale

    at_log, at_other = (np.arange(run.t[0], run.t[-1], step) for run in (log, simulation))
    together = correlate(
        np.interp(at_other, simulation.t, other), np.interp(at_log, log.t, velocity), method="fft"
    )
    begins = float(simulation.t[0] - log.t[0])
    near = min(
        (0.0, begins, begins + (int(np.argmax(together)) - at_log.size + 1) * step), key=difference
    )
    found = minimize_scalar(
        difference,
        bounds=(near - within, near + within),
        method="bounded",
        options={"xatol": SHIFTED * ramp},
    )
    shift = 0.0 if abs(found.x) < AT_ONCE * step else float(found.x)
    return shift, difference(shift)


def _sampled(simulation: Run, x: Signal, log: Run, shift: float) -> Signal:
    """A channel of a simulation at the stamps of its log, (n,): between two samples by a
    straight line, of many the mean.
    """
    at, half = log.t + shift, 0.5 / log.fs
    if simulation.fs < FINER * log.fs:
        return np.interp(at, simulation.t, x)
    total = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(simulation.t) * (x[1:] + x[:-1]))))
    ends = np.clip(at + np.array([[-half], [half]]), simulation.t[0], simulation.t[-1])
    (gained,), (width,) = (np.diff(y, axis=0) for y in (np.interp(ends, simulation.t, total), ends))
    return np.where(width > half, gained / np.maximum(width, half), np.interp(at, simulation.t, x))


def _check_levels(simulation: Run, log: Run, rig: Rig, blocks: Blocks) -> None:
    """Reject a simulation with a channel of an assumed unit whose level is far from that of the
    log: LogError.
    """
    assumed = {finding.channel for finding in simulation.findings if finding.kind == "unit_assumed"}
    for name in (
        name for name in CHANNELS if name in assumed and name in log.channels and blocks.size
    ):
        if name == "idc" and log.open_circuit:
            continue
        here, logged = (
            float(np.sqrt(np.mean(blocks.mean(run.channels[name]) ** 2)))
            for run in (simulation, log)
        )
        ratio, channel = (here / logged if logged else 1.0), rig.known_channels[name]
        if 1.0 / APART < ratio < APART:
            continue
        units = {
            unit: factor / UNITS[channel.unit].factor
            for factor, unit in unit_names(channel.dimension).items()
        }
        likely = min(units, key=lambda unit: abs(math.log10(max(ratio * units[unit], 1e-12))))
        raise LogError(
            f"{simulation.path}: its {name} has no known unit, was taken as {channel.unit}, and "
            f"is {ratio:.3g} times that of "
            f"the log {log.name}; the unit may be {likely}. State it in the header of the column, "
            f"such as {name} ({likely})."
        )


# -------------------------------------------------------------------------------- as the baseline
def beside_own_simulation(
    result: ModelDiagnosis,
    simulations: Sequence[Run],
    *,
    windows: Sequence[float | None] | None = None,
    on_progress: Callable[[str], None] = lambda _: None,
) -> ModelDiagnosis:
    """A diagnosis by the rig's model with the own simulation as its baseline.

    Verdict and causes stay, as they follow from log and model; but if the simulation contains all
    causes with the same numbers and differs from the logs by no more than noise, it leaves no gap.
    Map, place, closure and contributions are those of log minus own simulation.

    Parameters
    ----------
    simulations : of each run, as `on_the_logs` gives them
    windows : of each run, the length of its integration windows [s], None for the rule of the rig
    """
    data = result.data
    given = np.concatenate(
        [
            means_over(log.course.blocks, run)
            for log, run in zip(data.logs, simulations, strict=True)
        ]
    )
    nothing = np.zeros(len(data.nuisances))
    places = compare(data, given, data.tolerances(nothing, []))
    where, closure, gap = result.where, result.closure, data.without_zeros(data.measured - given)
    own = fit_simulation(simulations, result, on_progress)
    result = msgspec.structs.replace(
        result,
        predicted=given,
        places=places,
        where=where and locate(data, gap, places, where.stage, where.arises),
        closure=closure
        and closure_between(data, gap, closure.residual, closure.predictions, result.seed),
        own_simulation=own,
        contributions=from_own_simulation(result.contributions, data, simulations, windows),
    )
    if not _agrees(result, own, gap):
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
        own_simulation=msgspec.structs.replace(own, shared=shared),
        contributions=without(result.contributions, shared, among="model_form"),
    )


def _agrees(result: ModelDiagnosis, own: OwnSimulation, gap: Signal) -> bool:
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
        (number, own.numbers.get(cause.effect, {}).get(name))
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
    """Fit an own simulation as if it were a set of logs, with the suspects of a diagnosis and
    the usual simplifications.
    """
    data = Fitted(simulations, result.data.rig, result.data.cycles)
    suspects: Suspects = {**result.suspects, **SIMPLIFICATIONS}
    found = search(RigProblem(data, suspects), lambda step: on_progress(f"your simulation: {step}"))
    nothing = np.zeros(len(data.nuisances))
    nominal = data.predict(nothing, [])
    places = compare(data, nominal, data.tolerances(nothing, []))
    forms = model_forms(data, suspects, found, places)
    likely = [form.likely for form in forms if form.likely is not None]
    posterior = posterior_of(found, found.best)
    numbers = {name: parameters_of(posterior, suspects[name], name) for name in likely}
    return OwnSimulation(tuple(simulations), forms, numbers)


def model_forms(
    data: Fitted, suspects: Suspects, found: Found, places: Sequence[Place]
) -> tuple[ModelForm, ...]:
    """What a simulation has in another form than the rig's model, each at the place where it shows
    most, largest first.

    These are the effects of the fit, and stages in which the residual of the fit has a structure.

    Parameters
    ----------
    places : map of simulation minus rig's model
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
        if place is not None and size >= data.rig.model.relevant_share and abs(place.z) >= SHOWS:
            forms.append(_form(suspects[name].stage, place, name))
    for alarm in ringing(Judged(data, suspects, found.best), OF_THE_RESIDUAL):
        if alarm.kind == "structure" and isinstance(alarm.about, Spot):
            own = [
                p
                for p in places
                if (p.channel, p.phase) == (alarm.about.channel, alarm.about.phase)
            ]
            stage = STAGE_OF[alarm.about.channel]
            if own and stage not in {form.stage for form in forms}:
                forms.append(_form(stage, max(own, key=lambda p: abs(p.z)), None))
    return tuple(sorted(forms, key=lambda form: -abs(form.z)))


def _form(stage: str, place: Place, likely: str | None) -> ModelForm:
    return ModelForm(stage, place.channel, place.phase, place.load, place.bias, place.z, likely)


def from_own_simulation(
    contributions: Sequence[Contribution],
    data: Fitted,
    simulations: Sequence[Run],
    windows: Sequence[float | None] | None = None,
) -> tuple[Contribution, ...]:
    """Contributions that lead from an own simulation to the runs: what the model of the rig has
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
