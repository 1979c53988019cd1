"""Laws of stages beside a model: the power that each stage gives beyond what its model makes of its
own measured inputs, and whether the laws agree with the causes that the model was fitted with.

Gas, transmission, gearbox and generator are the stages of `rig.stages`. The power across the air
gap follows from DC voltage and current, so that the gearbox is a balance of energy and the
generator one of voltage: resistance shows in both, friction in the first and flux in the second
alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.cascade import Stage as Place
from winchcascade.core.errors import LogError
from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.diagnosis.explain.gap_map import (
    MODELLED,
    READ,
    Deviations,
    deviations,
    gaps_of,
    misread,
    moved_models,
)
from winchcascade.diagnosis.fit.block_means import PAYOUT, PHASES
from winchcascade.diagnosis.fit.nuisances import COURSES
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.stages.diagnose_stages import StageAgreement, diagnosed
from winchcascade.diagnosis.stages.stage_fit import LAW_BESIDE_MODEL
from winchcascade.diagnosis.stages.stage_laws import laws_beside_model
from winchcascade.diagnosis.stages.stage_rows import (
    EVERY_SAMPLE,
    PathSamples,
    StageData,
    data_of,
    rows_of,
)
from winchcascade.diagnosis.stages.stage_signals import StagePath, StageSignals, axes_of
from winchcascade.rig import physics
from winchcascade.rig.effects.catalogue import EFFECTS
from winchcascade.rig.parts import ELECTRICAL, changed
from winchcascade.rig.stages import Stage, drive_along, power_per_output

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import NamedCause
    from winchcascade.diagnosis.fit.misfit import Fitted
    from winchcascade.diagnosis.stages.stage_fit import StageFit
    from winchcascade.rig.effects.effect import ActiveEffect
    from winchcascade.rig.parts import Model

CHANNEL_OF: dict[Stage, str] = {
    "restoring": "pressure",
    "transmission": "torque",
    "gearbox": "torque",
    "generator": "vdc",
}
"""Channel that the output of each stage is."""

STAGE_ENDS: dict[Stage, tuple[str, str]] = {
    "restoring": ("line", "gas"),
    "transmission": ("line", "mech"),
    "gearbox": ("mech", "air gap"),
    "generator": ("air gap", "gen"),
}
"""Places between which the power of each stage flows."""

CHANGE_OF_READING = 0.01
"""Error of a sensor by which derivatives are taken, as a share of its largest reading. [1]"""

CHANGE_OF_NUMBER = 0.01
"""Share of the resistance of the stator, and exponent of the gas, by which derivatives are taken.
[1]
"""

PHASES_IN_SERIES = 2.0
"""Phases that a direct current flows through. [1]"""

STATOR = math.sqrt(2.0 / 3.0)
"""Stator current, rms, over the direct current of its bridge: two phases of three carry it (Mohan,
Undeland and Robbins 2003, chapter 5). [1]
"""

LAG = "late"
"""Name of the lag of voltage and current, which a logger reads together, among slopes of a gap."""


@linear_algebra_on_one_thread()
def beside_model(
    found: ModelDiagnosis, on_progress: Callable[[str], None] = lambda _: None
) -> ModelDiagnosis:
    """A diagnosis by a model with laws of its stages beside it.

    Raises
    ------
    LogError : a log has no stage of which inputs and output are logged
    """
    on_progress("comparing each stage with its model")
    causes = (*found.causes, *found.candidates)
    acting = found.found.best.acting(found.suspects)
    effects = [acting[cause.effect] for cause in causes]
    data, caused = data_beside_model(found.data, effects)
    laws = diagnosed(data, found.title, found.rig, found.seed, on_progress)
    agreement = agreement_of(laws.fit, caused, causes)
    laws = msgspec.structs.replace(laws, agreement=agreement)
    return msgspec.structs.replace(found, by_laws=laws)


def data_beside_model(
    data: Fitted, effects: Sequence[ActiveEffect] = ()
) -> tuple[StageData, Signal]:
    """Take the powers of all stages beyond their model at the blocks of a fit, and what some
    effects together, and each of them alone, give there, (m, 1 + effects) [W].

    What one standard uncertainty of each number of the rig and of each sensor moves, and the
    discrepancy of the model, are known.

    Raises
    ------
    LogError : a log has no stage of which inputs and output are logged
    """
    moved, nothing = moved_models(data), np.zeros(len(data.nuisances))
    acting = [data.models(nothing, some) for some in (effects, *([one] for one in effects))]
    several: list[tuple[Deviations, dict[Stage, PathSamples]]] = []
    for k, log in enumerate(data.logs):
        made = deviations(data, k, {j: models[k] for j, models in moved.items()})
        several.append((made, _samples(data, k, made)))
        if not several[k][1]:
            raise LogError(
                f"{log.run.name}: no stage has its inputs and its output logged; laws of stages "
                f"need pressure, or torque beside tension or voltage. Log them, or leave the log "
                f"out."
            )
    stages = [
        stage for stage in STAGE_ENDS if any(stage in samples_of for _, samples_of in several)
    ]
    ends = [(stage, *STAGE_ENDS[stage]) for stage in stages]
    paths = tuple(StagePath(Place(into, ()), Place(out, ()), at=at) for at, into, out in ends)
    first = [
        next(samples_of[stage] for _, samples_of in several if stage in samples_of).signals
        for stage in stages
    ]
    axes = tuple(axes_of(one.signals) for one in first)
    laws = laws_beside_model(first, paths, data.rig, EFFECTS)
    tables, caused = [], []
    for k, (made, samples_of) in enumerate(several):
        numbered = {stages.index(stage): samples for stage, samples in samples_of.items()}
        tables.append(rows_of(made.run.t, made.blocks, numbered.items(), laws, axes, k))
        others = [models[k] for models in acting]
        added = {
            n: msgspec.structs.replace(x, known=_caused(made, data.nominal, others, stages[n]))
            for n, x in numbered.items()
        }
        caused.append(rows_of(made.run.t, made.blocks, added.items(), {}, axes, k).known)
    runs = [log.run for log in data.logs]
    return data_of(runs, data.withheld, paths, laws, axes, tables), np.concatenate(caused)


def _slopes(made: Deviations, model: Model) -> dict[str, dict[str, Signal]]:
    """Change of the gap of each stage over the zero of each sensor, by channel, and over the lag of
    voltage and current, by `LAG`, (n,) each.
    """
    found: dict[str, tuple[float, Run]] = {}
    run = late = made.run
    for channel in (name for name in CHANNELS if name in run.channels):
        error = CHANGE_OF_READING * (float(np.max(np.abs(run.channels[channel]))) or 1.0)
        found[channel] = error, misread(run, channel, "zero", error)
        if channel in ELECTRICAL:
            late = misread(late, channel, "timing", 1.0 / run.fs)
    found[LAG] = 1.0 / run.fs, late
    return {
        name: {stage: (x - made.gaps[stage]) / error for stage, x in gaps.items()}
        for name, (error, other) in found.items()
        for gaps in [gaps_of(other, model, made.path)]
    }


def _samples(data: Fitted, number: int, made: Deviations) -> dict[Stage, PathSamples]:
    """The stages of a log: powers, signals of their laws, and what is known."""
    slopes, signals = _slopes(made, data.nominal), _signals(made, data.nominal)
    found = {}
    for stage in (stage for stage in STAGE_ENDS if stage in made.gaps):
        per, gap = _per_output(made, data.nominal, stage), made.gaps[stage]
        power = np.nan_to_num(np.abs(per) * made.run.channels[CHANNEL_OF[stage]])
        beyond = per * (gap - made.of_laws[stage])
        added = np.nan_to_num(beyond)
        ends = (power, power + added) if stage == "gearbox" else (power - added, power)
        by = {name: np.nan_to_num(per * slope[stage]) for name, slope in slopes.items()}
        signals[stage]["late"] = -by.pop(LAG)
        # with its noise in the column of a gain, a fit would shrink a reading to shrink its noise
        gains = {channel: x * made.simulated[channel] for channel, x in by.items()}
        known = [
            np.nan_to_num(per * (made.moved[n][stage] - gap))
            if stage in made.moved.get(n, {})
            else 0.0 * power
            for n in data.nuisances
            if n.kind in (*MODELLED, *READ)
        ]
        found[stage] = PathSamples(
            StageSignals(made.run.t, *ends, signals[stage], {"gain": gains, "zero": by}),
            np.isfinite(beyond) & made.path.moves,
            EVERY_SAMPLE,
            [*known, *_discrepancies(data, number, made, stage, per)],
        )
    return found


def _per_output(made: Deviations, model: Model, stage: Stage) -> Signal:
    """Power over the output of a stage of a log, (n,)."""
    return power_per_output(model, made.path, drive_along(made.run, model, made.path))[stage]


def _signals(made: Deviations, model: Model) -> dict[Stage, dict[str, Signal]]:
    """Signals that the laws of each stage are made of, (n,) each in SI units."""
    path, channels = made.path, made.run.channels
    omega = path.v / model.r_motion
    found: dict[Stage, dict[str, Signal]] = {}
    if "restoring" in made.gaps:
        warmer = changed(model, "restoring.exponent", "add", CHANGE_OF_NUMBER)
        (less,) = _caused(made, model, [warmer], "restoring")
        absolute = channels["pressure"] - made.gaps["restoring"] + ATMOSPHERE
        found["restoring"] = {
            "gas": absolute * physics.piston_torque(omega, model.restoring),
            "warmth": -less / CHANGE_OF_NUMBER,
        }
    if "transmission" in made.gaps:
        found["transmission"] = {
            "velocity": path.v,
            "displacement": path.x,
            "power": np.abs(channels["force"] * path.v),
            **{name: channels[name] for name in ("force", "pressure") if name in channels},
        }
    if "gearbox" in made.gaps:
        # behind its clutch the high-speed shaft turns with the line only while that pays out
        forth, torque = np.maximum(omega, 0.0), channels["torque"]
        found["gearbox"] = {
            "speed": forth,
            "back": forth - omega,
            "torque": torque,
            "power": np.abs(torque * forth),
        }
    if "generator" in made.gaps:
        drive = drive_along(made.run, model, path)
        field = physics.RECTIFIED * model.generator.k_e * drive.rpm * drive.i_bridge
        found["generator"] = {"field": np.nan_to_num(field)}
    more = changed(model, "generator.r_s", "add", CHANGE_OF_NUMBER * model.generator.r_s)
    for stage in found.keys() & {"gearbox", "generator"}:
        # the bridge loses as much of its mean voltage to a resistance as of power only about
        (less,) = _caused(made, model, [more], stage)
        square = np.maximum(-less, 0.0) / (
            PHASES_IN_SERIES * CHANGE_OF_NUMBER * model.generator.r_s
        )
        found[stage]["current"] = np.sqrt(square)
    if (machine := found.get("generator")) is not None:
        machine["overload"] = np.maximum(STATOR * machine["current"] - model.generator.i_rated, 0.0)
    return found


def _discrepancies(
    data: Fitted, number: int, made: Deviations, stage: Stage, per: Signal
) -> Iterator[Signal]:
    """Power by one standard deviation of the discrepancy of the model of each stage, by stage,
    phase and course, (n,) each; 0 of other stages. [W]
    """
    share = data.rig.model.discrepancy / math.sqrt(len(COURSES))
    blocks, courses = made.blocks, data.logs[number].courses[:, CHANNELS.index(CHANNEL_OF[stage])]
    count = blocks.stop - blocks.start
    samples = np.repeat(blocks.start - np.cumsum(count) + count, count) + np.arange(count.sum())
    for other in STAGE_ENDS:
        for phase in range(len(PHASES)):
            for course in courses.T * (blocks.phase == phase):
                watts = np.zeros(per.size)
                if other == stage:
                    watts[samples] = np.repeat(course, count)
                yield np.nan_to_num(share * per * watts)


def _caused(made: Deviations, model: Model, others: Sequence[Model], stage: Stage) -> list[Signal]:
    """Power that each of some models gives beyond the nominal one at a stage, (n,) each. [W]"""
    per = _per_output(made, model, stage)
    return [
        np.nan_to_num(per * (made.gaps[stage] - gaps_of(made.run, other, made.path)[stage]))
        for other in others
    ]


def agreement_of(
    fit: StageFit, caused: Signal, causes: Sequence[NamedCause]
) -> tuple[StageAgreement, ...]:
    """Compare the mean power that each stage gives beyond its model while the line pays out, by the
    laws and by the causes that the model was fitted with.

    Parameters
    ----------
    caused : (m, 1 + causes) power of all causes together, and of each alone [W]
    """
    rows, best, found = fit.data.rows, fit.found.best, list[StageAgreement]()
    known = np.array([_width(cause) for cause in causes])
    for k, path in enumerate(fit.data.paths):
        here = (rows.path == k) & (rows.blocks.phase == PAYOUT)
        if here.any():
            column = np.mean(rows.columns[here][:, fit.columns_of(best)], axis=0)
            power = float(column @ best.x)
            u_numbers = math.sqrt(float(column @ fit.covariance(best) @ column))
            u = math.hypot(
                u_numbers, LAW_BESIDE_MODEL * power
            )  # what a law misses lasts in every cycle
            of_model = np.mean(caused[here], axis=0)
            u_model = float(np.linalg.norm(known * of_model[1:]))
            flows = float(np.mean(np.abs(rows.given[here])))
            found.append(StageAgreement(path.place, flows, power, u, float(of_model[0]), u_model))
    return tuple(found)


def _width(cause: NamedCause) -> float:
    """Standard uncertainty of what a cause does, as a share of it. [1]"""
    number = next(iter(cause.parameters.values()))
    half = max(number.high - number.value, number.value - number.low)
    return half / COVERED / abs(number.value) if number.value and math.isfinite(half) else 0.0
