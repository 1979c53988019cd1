"""The gap stage by stage: each stage has its own measured inputs, so that an error upstream neither hides nor imitates one.

The map of `compare` is end to end: the motion of the line alone drives the model, and an error upstream shows downstream too.
Here `rig.stages` predicts the output of a stage from the channels measured at its input. Its laws are quasi-static, so their
residual on the simulation of the model along the same motion is subtracted.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import white_noise
from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.block_means import PHASES, scatter_about_course
from winchcascade.diagnosis.diagnosis_result import StagePlace
from winchcascade.diagnosis.gap_map import weigh
from winchcascade.diagnosis.misfit import NOISELESS, Fitted, Log
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.kernel import constants
from winchcascade.rig.stages import Along, StageOutput, along, outputs_along

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.rig.parts import Model

    Change = tuple[Nuisance, dict[str, Signal]]

TOUCHED = {
    "winch": ("restoring", "transmission", "gearbox", "generator"),
    "restoring": ("restoring", "transmission"),
    "drivetrain": ("gearbox", "generator"),
    "generator": ("gearbox", "generator"),
    "dc_link": ("gearbox", "generator", "load"),
}
"""Stages whose output the numbers of a section of the rig file may move."""

WHOLE = 0.99
"""Minimum share of the samples of a block that its stage predicts: otherwise a clutch that lets go would enter at the edges."""


class _Stages(msgspec.Struct, frozen=True):
    """The stages of one log under the model of the rig file: its motion, and their outputs by name where these are logged too.

    `discrepancy` (m, 5, 3) is one standard deviation of the discrepancy of the model along each of its courses, SI units.
    """

    log: Log
    discrepancy: Signal
    model: Model
    course: Along
    outputs: Mapping[str, StageOutput]


def stagewise(data: Fitted) -> tuple[StagePlace, ...]:
    """Compare every stage with what it makes of its own measured inputs, by the model of the rig file."""
    one = np.eye(len(data.nuisances))
    moved = {j: data.models(one[j], []) for j, n in enumerate(data.nuisances) if n.kind in ("rig", "law", "load")}
    of_logs = [{j: models[number] for j, models in moved.items()} for number in range(len(data.logs))]
    spread = data.discrepancies()
    jobs = [partial(_of_a_log, data, number, own, spread[data.rows[number]]) for number, own in enumerate(of_logs)]
    return tuple(place for places in all_at_once(jobs, data.sizes) for place in places)


def _of_a_log(data: Fitted, number: int, moved: Mapping[int, Model], spread: Signal) -> list[StagePlace]:
    """Compare every stage of one log.

    Parameters
    ----------
    moved : models of the log, each with one nuisance moved by one standard uncertainty, by the number of the nuisance
    spread : (m, 5, courses) standard deviation of the discrepancy of the model in its blocks, SI units
    """
    log, found = data.logs[number], list[StagePlace]()
    run, course = log.run, log.course
    path = along(run, course.coarse, course.shaft(constants(data.nominal, course.load))[0])
    outputs: dict[str, StageOutput] = {
        o.stage: o for o in outputs_along(run, data.nominal, path) if o.channel in run.channels
    }
    stages = _Stages(log, spread, data.nominal, path, outputs)
    residual = _residual_of_the_laws(stages)
    changes = list(_changes(data, number, moved, stages))
    for name, output in outputs.items():
        own = [(n, by[name]) for n, by in changes if name in by]
        found += _places(stages, number, output, residual[name], own)
    return found


def _residual_of_the_laws(stages: _Stages) -> dict[str, Signal]:
    """Simulation of the model along the motion minus what the laws of the stages predict from it, (n,) each."""
    run, course = stages.log.run, stages.log.course
    simulated = zip(CHANNELS, course.on_grid(stages.model).T, strict=True)
    channels = {**run.channels, **{name: np.interp(run.t, course.coarse.t, x) for name, x in simulated}}
    made = msgspec.structs.replace(run, channels=channels)
    return {o.stage: channels[o.channel] - o.predicted for o in outputs_along(made, stages.model, stages.course)}


# ------------------------------------------------------------------------------------------ what is not quite known
def _changes(data: Fitted, number: int, moved: Mapping[int, Model], stages: _Stages) -> Iterator[Change]:
    """What one standard uncertainty of each nuisance that concerns a log moves of measured minus predicted, (n,) by stage."""
    run = stages.log.run
    for j, n in enumerate(data.nuisances):
        if n.kind in ("zero", "gain", "timing"):
            if n.name in run.channels and n.log in (-1, number):
                yield n, _of_a_sensor(stages, n.name, _misread(run, n))
        elif n.kind in ("rig", "law") or (n.kind == "load" and n.load == stages.log.load):
            touched = ("load",) if n.kind == "load" else TOUCHED[n.section]
            after = {o.stage: o.predicted for o in outputs_along(run, moved[j], stages.course, touched)}
            yield n, {name: o.predicted - after[name] for name, o in stages.outputs.items() if name in after}


def _misread(run: Run, n: Nuisance) -> Signal:
    """A channel as its sensor reads it when off by one standard uncertainty, (n,)."""
    x = run.channels[n.name]
    if n.kind == "timing":
        return np.interp(run.t - n.sd, run.t, x)
    return x * (1.0 + n.sd) if n.kind == "gain" else x + n.sd


def _of_a_sensor(stages: _Stages, name: str, misread: Signal) -> dict[str, Signal]:
    """What an error of one sensor moves: the stage that ends with it directly, those that begin with it through their law."""
    run, outputs = stages.log.run, stages.outputs
    moved = {stage: misread - run.channels[name] for stage, o in outputs.items() if o.channel == name}
    begins = [stage for stage, o in outputs.items() if name in o.inputs]
    other = msgspec.structs.replace(run, channels={**run.channels, name: misread})
    for o in outputs_along(other, stages.model, stages.course, begins):
        moved[o.stage] = moved.get(o.stage, 0.0) - (o.predicted - outputs[o.stage].predicted)
    return moved


# ------------------------------------------------------------------------------------------------------ phase by phase
def _places(
    stages: _Stages, number: int, output: StageOutput, of_the_law: Signal, changes: Sequence[tuple[Nuisance, Signal]]
) -> Iterator[StagePlace]:
    """Weigh a stage in every phase of a log in which it predicts anything.

    Parameters
    ----------
    of_the_law : (n,) simulation of the model minus what the law of the stage predicts from it
    changes : what one standard uncertainty of each nuisance moves, (n,) each
    """
    log, run, blocks = stages.log, stages.log.run, stages.log.course.blocks
    gap = run.channels[output.channel] - output.predicted - of_the_law
    known = np.isfinite(gap)
    share = blocks.mean(known.astype(np.float64))
    moved = np.column_stack([gap, *(change for _, change in changes)])
    moved = np.where(known[:, None] & np.isfinite(moved), moved, 0.0)
    residual, *columns = (blocks.mean(x) / np.maximum(share, 1e-9) for x in moved.T)
    for phase, name in enumerate(PHASES):
        here = (share >= WHOLE) & (blocks.phase == phase)
        if np.count_nonzero(here) < 2:
            continue
        own = {n: column[here] for (n, _), column in zip(changes, columns, strict=True)}
        zeros = [float(np.mean(x)) for n, x in own.items() if n.kind == "zero"]
        of_model = stages.discrepancy[here, CHANNELS.index(output.channel)]
        others = np.column_stack([of_model, *(x for n, x in own.items() if n.kind != "zero")])
        noise = _noise(log, output, here, residual)
        yield StagePlace(
            **msgspec.structs.asdict(weigh(residual[here], blocks.cycle[here], noise, math.hypot(*zeros), others)),
            stage=output.stage,
            channel=output.channel,
            inputs=output.inputs,
            phase=name,
            log=number,
            load=run.load,
            blocks=int(np.count_nonzero(here)),
            by_gain={n.name: float(np.mean(x)) / n.sd for n, x in own.items() if n.kind == "gain"},
        )


def _noise(log: Log, output: StageOutput, here: NDArray[np.bool_], residual: Signal) -> Signal:
    """Standard deviation of the mean of each block in one phase, (k,) for the k blocks that are `here`.

    The scatter from block to block, of output and inputs alike; at least the white noise of the sensor of the output, and in a
    log without noise `NOISELESS`.
    """
    run, blocks = log.run, log.course.blocks
    white = white_noise(run.channels[output.channel]) / np.sqrt(blocks.count[here])
    minimum = NOISELESS * float(np.nanmax(np.abs(output.predicted))) if run.simulated else 0.0
    return np.maximum(np.fmax(white, scatter_about_course(blocks, residual, here)), minimum)
