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
from winchcascade.diagnosis.diagnosis_result import Place
from winchcascade.diagnosis.gap_map import weigh
from winchcascade.diagnosis.misfit import NOISELESS, Fitted, Log
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.kernel import constants
from winchcascade.rig.stages import Along, StageOutput, along, outputs_along

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from winchcascade.core.run import Mask, Run, Signal
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.rig.parts import Model

WHOLE = 0.99
"""Minimum share of the samples of a block that its stage predicts: otherwise a clutch that lets go would enter at the edges."""

MODELLED, READ = ("rig", "law", "load"), ("zero", "gain", "timing")
"""Kinds of nuisances that change the model, and that change what a sensor reads."""


def stagewise(data: Fitted) -> tuple[Place, ...]:
    """Compare every stage with what it makes of its own measured inputs, by the model of the rig file."""
    one = np.eye(len(data.nuisances))
    moved = {j: data.models(one[j], []) for j, n in enumerate(data.nuisances) if n.kind in MODELLED}
    spread = data.discrepancies()
    jobs = [
        partial(_of_a_log, data, k, {j: models[k] for j, models in moved.items()}, spread[rows])
        for k, rows in enumerate(data.rows)
    ]
    return tuple(place for places in all_at_once(jobs, data.sizes) for place in places)


def _of_a_log(data: Fitted, number: int, moved: Mapping[int, Model], spread: Signal) -> list[Place]:
    """Compare every stage of one log.

    Parameters
    ----------
    moved : models of the log, each with one nuisance moved by one standard uncertainty, by the number of the nuisance
    spread : (m, 5, courses) standard deviation of the discrepancy of the model in its blocks, SI units
    """
    log, model = data.logs[number], data.nominal
    run, course = log.run, log.course
    path = along(run, course.coarse, course.shaft(constants(model, course.load))[0])
    simulated = zip(CHANNELS, course.at_stamps(course.on_grid(model)).T, strict=True)
    made = msgspec.structs.replace(run, channels={**run.channels, **dict(simulated)})
    of_the_laws, gaps = _gaps(made, model, path), _gaps(run, model, path)
    changes: dict[Nuisance, dict[str, Signal]] = {}
    for j, n in enumerate(data.nuisances):
        if n.kind in READ and n.name in run.channels and n.log in (-1, number):
            changes[n] = _gaps(_misread(run, n), model, path)
        elif n.kind in MODELLED and (n.kind != "load" or n.load == log.load):
            changes[n] = _gaps(run, moved[j], path)
    found: list[Place] = []
    for output in outputs_along(run, model, path):
        if output.channel in run.channels:
            gap = gaps[output.stage] - of_the_laws[output.stage]
            own = {n: by[output.stage] - gaps[output.stage] for n, by in changes.items()}
            of_model = spread[:, CHANNELS.index(output.channel)]
            found += _places(data, number, output, gap, own, of_model)
    return found


def _gaps(run: Run, model: Model, path: Along) -> dict[str, Signal]:
    """Measured minus predicted output of each stage, (n,); NaN where the stage predicts nothing."""
    return {
        o.stage: run.channels[o.channel] - o.predicted
        for o in outputs_along(run, model, path)
        if o.channel in run.channels
    }


def _misread(run: Run, n: Nuisance) -> Run:
    """A log as one of its sensors reads it when off by one standard uncertainty."""
    x = run.channels[n.name]
    if n.kind == "timing":
        other = np.interp(run.t - n.sd, run.t, x)
    else:
        other = x * (1.0 + n.sd) if n.kind == "gain" else x + n.sd
    return msgspec.structs.replace(run, channels={**run.channels, n.name: other})


def _places(
    data: Fitted, number: int, output: StageOutput, gap: Signal, changes: Mapping[Nuisance, Signal], of_model: Signal
) -> Iterator[Place]:
    """Weigh a stage in every phase of a log in which it predicts anything.

    Parameters
    ----------
    gap : (n,) measured minus predicted
    changes : what one standard uncertainty of each nuisance moves, (n,)
    of_model : (m, courses) standard deviation of the discrepancy of the model
    """
    log, blocks = data.logs[number], data.logs[number].course.blocks
    share = blocks.mean(np.isfinite(gap).astype(np.float64))

    def mean(x: Signal) -> Signal:
        return blocks.mean(np.where(np.isfinite(gap) & np.isfinite(x), x, 0.0)) / np.maximum(share, 1e-9)

    residual, moved = mean(gap), {n: mean(x) for n, x in changes.items() if np.any(np.nan_to_num(x))}
    for phase, name in enumerate(PHASES):
        here = (share >= WHOLE) & (blocks.phase == phase)
        if np.count_nonzero(here) < 2:
            continue
        zeros = [float(np.mean(x[here])) for n, x in moved.items() if n.kind == "zero"]
        others = np.column_stack([of_model[here], *(x[here] for n, x in moved.items() if n.kind != "zero")])
        noise = _noise(log, output, here, residual)
        yield msgspec.structs.replace(
            weigh(residual[here], blocks.cycle[here], noise, math.hypot(*zeros), others),
            stage=output.stage,
            channel=output.channel,
            inputs=output.inputs,
            phase=name,
            log=number,
            load=log.run.load,
        )


def _noise(log: Log, output: StageOutput, here: Mask, residual: Signal) -> Signal:
    """Standard deviation of the mean of each block in one phase, (k,) for the k blocks that are `here`.

    The scatter from block to block, of output and inputs alike; at least the white noise of the sensor of the output, and in a
    log without noise `NOISELESS`.
    """
    run, blocks = log.run, log.course.blocks
    white = white_noise(run.channels[output.channel]) / np.sqrt(blocks.count[here])
    minimum = NOISELESS * float(np.nanmax(np.abs(output.predicted))) if run.simulated else 0.0
    return np.maximum(np.fmax(white, scatter_about_course(blocks, residual, here)), minimum)
