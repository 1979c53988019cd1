"""The gap stage by stage: each stage is given its own measured inputs, so that an error upstream neither hides nor fakes one.

The map of `compare` is end to end: the line's motion alone drives the model, and what is wrong upstream shows downstream too.
Here `rig.stages` says what a stage makes of the channels measured at its own input. Its laws are quasi-static, so what they
leave of the model's own simulation along the same motion is taken off.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.white_noise import GAUSS, white_noise
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_map import weigh
from winchcascade.diagnosis.noise import NOISELESS
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.kernel import constants
from winchcascade.rig.stages import along, outputs_along

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.misfit import Fitted, Log
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.rig.parts import Model
    from winchcascade.rig.stages import Along, StageOutput

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
"""A block counts where its stage can say at least this share of its samples: a clutch that lets go would enter at its edges."""


class StagePlace(msgspec.Struct, frozen=True):
    """One stage in one phase of one log: measured minus what the stage makes of its own measured `inputs`, SI units.

    `channel` is the stage's output. `bias` to `z` are those of `gap_map.Place`, but for the zeros: none is taken off, and those
    of output and inputs are in `u_noise`. `by_gain` is what the gain of a channel's sensor moves the bias, for an error of 1,
    where that gain is not taken for exact.
    """

    stage: str
    channel: str
    inputs: tuple[str, ...]
    phase: str
    log: int
    load: float | None
    blocks: int
    bias: float
    rms: float
    noise: float
    u_noise: float
    u_repeat: float
    u_tolerance: float
    z: float
    by_gain: Mapping[str, float]


class _Stages(msgspec.Struct, frozen=True):
    """The stages of one log under the rig as given: its motion, and their outputs by name where these are logged too."""

    log: Log
    model: Model
    course: Along
    outputs: Mapping[str, StageOutput]


def stagewise(data: Fitted) -> tuple[StagePlace, ...]:
    """Compare every stage with what it makes of its own measured inputs, under the rig as given, by log, stage and phase."""
    one = np.eye(len(data.nuisances))
    moved = {j: data.models(one[j], []) for j, n in enumerate(data.nuisances) if n.kind in ("rig", "law", "load")}
    found: list[StagePlace] = []
    for number, log in enumerate(data.logs):
        stages = _stages(log, data.nominal)
        left = _left_by_the_laws(stages)
        changes = list(_changes(data, number, {j: models[number] for j, models in moved.items()}, stages))
        for name, output in stages.outputs.items():
            own = [(n, by[name]) for n, by in changes if name in by]
            found += _places(log, number, output, left[name], own)
    return tuple(found)


def _stages(log: Log, model: Model) -> _Stages:
    course, run = log.course, log.run
    path = along(run, course.coarse, course.shaft(constants(model, course.load)).clutch)
    outputs: dict[str, StageOutput] = {o.stage: o for o in outputs_along(run, model, path) if o.channel in run.channels}
    return _Stages(log, model, path, outputs)


def _left_by_the_laws(stages: _Stages) -> dict[str, Signal]:
    """What the stages' laws leave of the model's own simulation along the motion, simulated minus predicted, (n,) each."""
    run, course = stages.log.run, stages.log.course
    simulated = course.on_grid(stages.model)
    channels = {
        **run.channels,
        **{name: np.interp(run.t, course.coarse.t, simulated[:, k]) for k, name in enumerate(CHANNELS)},
    }
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
        elif n.kind != "load" or n.load == stages.log.load:
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
    run = stages.log.run
    moved = {stage: misread - run.channels[name] for stage, o in stages.outputs.items() if o.channel == name}
    begins = [stage for stage, o in stages.outputs.items() if name in o.inputs]
    other = msgspec.structs.replace(run, channels={**run.channels, name: misread})
    for o in outputs_along(other, stages.model, stages.course, begins):
        moved[o.stage] = moved.get(o.stage, 0.0) - (o.predicted - stages.outputs[o.stage].predicted)
    return moved


# ------------------------------------------------------------------------------------------------------ phase by phase
def _places(
    log: Log, number: int, output: StageOutput, left: Signal, changes: Sequence[tuple[Nuisance, Signal]]
) -> Iterator[StagePlace]:
    """Weigh a stage in every phase of a log of which it says anything.

    Parameters
    ----------
    left : (n,) what the stage's law leaves of the model's own simulation
    changes : what one standard uncertainty of each nuisance moves, (n,) each
    """
    run, blocks = log.run, log.course.blocks
    apart = run.channels[output.channel] - output.predicted - left
    says = np.isfinite(apart)
    share = blocks.mean(says.astype(np.float64))

    def mean(x: Signal) -> Signal:
        means: Signal = blocks.mean(np.where(says & np.isfinite(x), x, 0.0)) / np.maximum(share, 1e-9)
        return means

    residual = mean(apart)
    columns = [mean(change) for _, change in changes]
    for phase, name in enumerate(PHASES):
        here = (share >= WHOLE) & (blocks.phase == phase)
        if np.count_nonzero(here) < 2:
            continue
        own = {n: column[here] for (n, _), column in zip(changes, columns, strict=True)}
        zeros = [float(np.mean(x)) for n, x in own.items() if n.kind == "zero"]
        known = np.column_stack([x for n, x in own.items() if n.kind != "zero"] or [np.zeros(int(here.sum()))])
        noise = _noise(log, output, here, residual)
        by = weigh(residual[here], blocks.cycle[here], noise, math.hypot(*zeros), known)
        yield StagePlace(
            stage=output.stage,
            channel=output.channel,
            inputs=output.inputs,
            phase=name,
            log=number,
            load=run.load,
            blocks=int(np.count_nonzero(here)),
            **msgspec.structs.asdict(by),
            by_gain={n.name: float(np.mean(x)) / n.sd for n, x in own.items() if n.kind == "gain"},
        )


def _noise(log: Log, output: StageOutput, here: NDArray[np.bool_], residual: Signal) -> Signal:
    """Standard deviation of each block's mean in one phase, (k,) for the k blocks that are `here`.

    What scatters from block to block, of output and inputs alike, by the median of second differences, of which a smooth gap
    leaves none; at least the white noise of the output's own sensor, and in a log without noise `NOISELESS`.
    """
    run, blocks = log.run, log.course.blocks
    white = white_noise(run.channels[output.channel]) / np.sqrt(blocks.count[here])
    least = NOISELESS * float(np.nanmax(np.abs(output.predicted))) if run.simulated else 0.0
    threes = here[:-2] & here[1:-1] & here[2:] & blocks.joined[1:-1] & blocks.joined[2:]
    bends = np.abs(residual[:-2] - 2.0 * residual[1:-1] + residual[2:])[threes] / math.sqrt(6.0)
    scatter = GAUSS * median(bends) if bends.size else 0.0
    noise: Signal = np.maximum(np.maximum(white, scatter), least)
    return noise
