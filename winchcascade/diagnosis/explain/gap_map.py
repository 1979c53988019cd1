"""The map of a gap: from end to end and stage by stage, and where on it the gap lies and arises.

From end to end the motion of the line alone drives the model, and an error upstream shows
downstream too. Stage by stage each stage has its own measured inputs, so that an error upstream
neither hides nor imitates one: `rig.stages` predicts its output. The laws of the stages are
quasi-static, so their residual on the simulation along the same motion is subtracted.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import rms, white_noise
from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.diagnosis_result import Place, Where
from winchcascade.diagnosis.fit.block_means import PHASES, scatter_about_course
from winchcascade.diagnosis.fit.block_noise import NOISELESS
from winchcascade.diagnosis.fit.fitted_log import Log
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.rig.stages import Along, StageOutput, along, outputs_along
from winchcascade.rig.state import constants

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Mask, Run, Signal
    from winchcascade.diagnosis.fit.block_means import Blocks
    from winchcascade.diagnosis.fit.nuisances import Nuisance
    from winchcascade.rig.parts import Model

STAGE_OF = {
    "pressure": "restoring",
    "force": "transmission",
    "torque": "gearbox",
    "vdc": "generator",
    "idc": "generator",
}
"""Stage whose output a channel is."""

STANDS_OUT = 4.0
"""A bias is significant beyond this many standard uncertainties of noise, repeatability and
tolerance.
"""

EDGE = 0.02
"""Share of the significant blocks that a region leaves out at either end."""

LARGEST = 0.975
"""Quantile of the differences of the significant blocks that counts as the largest: single
blocks may be disturbed.
"""

WHOLE = 0.99
"""Minimum share of the samples of a block that its stage predicts: otherwise a clutch that lets
go would enter at the edges.
"""

MODELLED, READ = ("rig", "law", "load"), ("zero", "gain", "timing")
"""Kinds of nuisances that change the model, and that change what a sensor reads."""


def weigh(
    residual: Signal, cycle: NDArray[np.intp], noise: Signal, u_zero: float, tolerances: Signal
) -> Place:
    """Weigh the bias of some blocks of one phase, in the unit of their channel.

    Parameters
    ----------
    residual : (m,) measured minus predicted
    cycle : (m,) number of the cycle of each
    noise : (m,) one standard deviation of each block
    u_zero : standard uncertainty of the zeros, which all blocks share
    tolerances : (m, k) what one standard uncertainty of each number that is not exactly known moves
    """
    bias, own = float(np.mean(residual)), rms(noise)
    u_noise = math.hypot(own / math.sqrt(residual.size) * 1.5**0.5, u_zero)
    u_tolerance = float(np.sqrt(np.sum(np.mean(tolerances, axis=0) ** 2)))
    means = [float(np.mean(residual[cycle == c])) for c in np.unique(cycle)]
    u_repeat = float(np.std(means, ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else math.nan
    u = math.hypot(u_noise, u_tolerance, 0.0 if math.isnan(u_repeat) else u_repeat)
    return Place(
        blocks=residual.size,
        bias=bias,
        rms=rms(residual),
        noise=own,
        u_noise=u_noise,
        u_repeat=u_repeat,
        u_tolerance=u_tolerance,
        z=bias / u if u > 0.0 else 0.0,
    )


def compare(data: Fitted, predicted: Signal) -> tuple[Place, ...]:
    """Map a gap, with the tolerances of the model of the rig file.

    Parameters
    ----------
    predicted : (M, 5) blocks of a model, without zeros
    """
    residual, cycle = data.gap(predicted), data.blocks.cycle
    one = np.ones(len(data.nuisances))
    u_zero = data.zeros(one)
    tolerances = np.concatenate((data.tolerances(0.0 * one, []), data.discrepancies()), axis=2)
    return tuple(
        msgspec.structs.replace(
            weigh(
                residual[here, k],
                cycle[here],
                data.noise[here, k],
                u_zero[log, k],
                tolerances[here, k],
            ),
            channel=CHANNELS[k],
            phase=PHASES[phase],
            log=log,
            load=data.logs[log].run.load,
        )
        for log, k, phase, here in data.cells()
        if here.size >= 2
    )


# --------------------------------------------------------------------------------- stage by stage
def stagewise(data: Fitted) -> tuple[Place, ...]:
    """Compare every stage with what it makes of its own measured inputs, by the model of the rig
    file.
    """
    moved, spread = moved_models(data), data.discrepancies()
    jobs = [
        partial(_of_a_log, data, k, {j: models[k] for j, models in moved.items()}, spread[rows])
        for k, rows in enumerate(data.rows)
    ]
    return tuple(place for places in all_at_once(jobs, data.sizes) for place in places)


class Deviations(msgspec.Struct, frozen=True):
    """What the stages of a log make of their own measured inputs along its motion, with samples and
    blocks that are means where a log is fast.

    `simulated` are the channels of the model driven by that motion. `gaps` are measured minus
    predicted outputs by stage, (n,), `of_laws` those of the simulation, whose stages are not
    quasi-static, and `moved` the gaps with a nuisance moved by one standard uncertainty, of the
    stages that depend on it.
    """

    run: Run
    simulated: dict[str, Signal]
    blocks: Blocks
    path: Along
    gaps: dict[str, Signal]
    of_laws: dict[str, Signal]
    moved: dict[Nuisance, dict[str, Signal]]


def deviations(data: Fitted, number: int, moved: Mapping[int, Model]) -> Deviations:
    """Compare the stages of one log with their model.

    Parameters
    ----------
    moved : models of the log, each with one nuisance moved by one standard uncertainty, by the
        number of the nuisance
    """
    log, model = data.logs[number], data.nominal
    course, (run, blocks) = log.course, _thinned(log)
    numbers = constants(model, course.load, course.coarse.rest)
    path = along(run, course.coarse, course.scale.ramp, course.shaft(numbers)[0])
    grid = zip(CHANNELS, course.on_grid(model).T, strict=True)
    simulated = {name: np.interp(run.t, course.coarse.t, x) for name, x in grid}
    made = msgspec.structs.replace(run, channels={**run.channels, **simulated})
    changes: dict[Nuisance, dict[str, Signal]] = {}
    for j, n in enumerate(data.nuisances):
        if n.kind in READ and n.name in run.channels and n.log in (-1, number):
            changes[n] = gaps_of(misread(run, n.name, n.kind, n.sd), model, path, n.name)
        elif n.kind in MODELLED and (n.kind != "load" or n.load == log.load):
            changes[n] = gaps_of(run, moved[j], path, n.path)
    both = gaps_of(run, model, path), gaps_of(made, model, path)
    return Deviations(run, simulated, blocks, path, *both, changes)


def moved_models(data: Fitted) -> dict[int, list[Model]]:
    """Models of all logs with one nuisance moved by one standard uncertainty, by its number."""
    one = np.eye(len(data.nuisances))
    return {j: data.models(one[j], []) for j, n in enumerate(data.nuisances) if n.kind in MODELLED}


def _of_a_log(data: Fitted, number: int, moved: Mapping[int, Model], spread: Signal) -> list[Place]:
    """Compare every stage of one log.

    Parameters
    ----------
    moved : as `deviations` takes them
    spread : (m, 5, courses) standard deviation of the discrepancy of the model in its blocks, SI
        units
    """
    made, found = deviations(data, number, moved), list[Place]()
    for output in outputs_along(made.run, data.nominal, made.path):
        if (stage := output.stage) in made.gaps:
            gap = made.gaps[stage] - made.of_laws[stage]
            changed = {n: by[stage] for n, by in made.moved.items() if stage in by}
            own = {n: gaps - made.gaps[stage] for n, gaps in changed.items()}
            of_model = spread[:, CHANNELS.index(output.channel)]
            placed = _places(made.run, made.blocks, output, gap, own, of_model)
            found += [msgspec.structs.replace(one, log=number) for one in placed]
    return found


SAMPLES = 11.0
"""Samples of a ramp with which stages are compared: more of them in a block tell no more of its
mean. [1]
"""


def _thinned(log: Log) -> tuple[Run, Blocks]:
    """A log and its blocks with means over so many samples that `SAMPLES` of a ramp remain; a
    coarse log as it is.
    """
    run, blocks = log.run, log.course.blocks
    every = int(run.fs * log.course.scale.ramp / SAMPLES)
    if every < 2:
        return run, blocks
    whole = run.t.size // every * every

    def mean(x: Signal) -> Signal:
        return np.asarray(x[:whole].reshape(-1, every).mean(axis=1))

    channels = {name: mean(x) for name, x in run.channels.items()}
    thinned = msgspec.structs.replace(
        run, t=mean(run.t), channels=channels, fs=run.fs / every, gaps={}
    )
    start = np.minimum(-(-blocks.start // every), whole // every - 1)
    stop = np.clip(blocks.stop // every, start + 1, None)
    return thinned, msgspec.structs.replace(blocks, start=start, stop=stop)


def gaps_of(run: Run, model: Model, path: Along, by: str = "") -> dict[str, Signal]:
    """Measured minus predicted output of each stage, (n,), or of those that depend on a channel or
    number of the model; NaN where the stage predicts nothing.
    """
    return {
        o.stage: run.channels[o.channel] - o.predicted
        for o in outputs_along(run, model, path, by)
        if o.channel in run.channels
    }


def misread(run: Run, name: str, part: str, error: float) -> Run:
    """A log as one of its sensors reads it with an error of its gain, timing or zero."""
    x = run.channels[name]
    if part == "timing":
        other = np.interp(run.t - error, run.t, x)
    else:
        other = x * (1.0 + error) if part == "gain" else x + error
    return msgspec.structs.replace(run, channels={**run.channels, name: other})


def _places(
    run: Run,
    blocks: Blocks,
    output: StageOutput,
    gap: Signal,
    changes: Mapping[Nuisance, Signal],
    of_model: Signal,
) -> Iterator[Place]:
    """Weigh a stage in every phase of a log in which it predicts anything.

    Parameters
    ----------
    gap : (n,) measured minus predicted
    changes : what one standard uncertainty of each nuisance moves, (n,)
    of_model : (m, courses) standard deviation of the discrepancy of the model
    """
    share = blocks.mean(np.isfinite(gap).astype(np.float64))

    def mean(x: Signal) -> Signal:
        return blocks.mean(np.where(np.isfinite(gap) & np.isfinite(x), x, 0.0)) / np.maximum(
            share, 1e-9
        )

    residual, moved = (
        mean(gap),
        {n: mean(x) for n, x in changes.items() if np.any(np.nan_to_num(x))},
    )
    for phase, name in enumerate(PHASES):
        here = (share >= WHOLE) & (blocks.phase == phase)
        if np.count_nonzero(here) < 2:
            continue
        zeros = [float(np.mean(x[here])) for n, x in moved.items() if n.kind == "zero"]
        others = np.column_stack(
            [of_model[here], *(x[here] for n, x in moved.items() if n.kind != "zero")]
        )
        noise = _noise(run, blocks, output, here, residual)
        yield msgspec.structs.replace(
            weigh(residual[here], blocks.cycle[here], noise, math.hypot(*zeros), others),
            stage=output.stage,
            channel=output.channel,
            inputs=output.inputs,
            phase=name,
            load=run.load,
        )


def _noise(run: Run, blocks: Blocks, output: StageOutput, here: Mask, residual: Signal) -> Signal:
    """Standard deviation of the mean of each block in one phase, (k,) for the k blocks that are
    `here`.

    The scatter from block to block, of output and inputs alike; at least the white noise of the
    sensor of the output, and in a log without noise `NOISELESS`.
    """
    white = white_noise(run.channels[output.channel]) / np.sqrt(blocks.count[here])
    minimum = NOISELESS * float(np.nanmax(np.abs(output.predicted))) if run.simulated else 0.0
    return np.maximum(np.fmax(white, scatter_about_course(blocks, residual, here)), minimum)


# ----------------------------------------------------------------------- where it lies and arises
def arises(places: Sequence[Place]) -> tuple[Place, ...]:
    """The worst place of each stage that deviates by itself in the map of `stagewise`, the worst
    of all first.
    """
    worst: dict[str, Place] = {}
    for place in sorted(places, key=lambda p: -abs(p.z)):
        if abs(place.z) > STANDS_OUT:
            worst.setdefault(place.stage, place)
    return tuple(worst.values())


def deviating_stage(own: Sequence[Place]) -> str | None:
    """Stage of the catalogue that deviates most by itself, None where none does; load and bridge
    make one module there.
    """
    return {"load": "generator"}.get(own[0].stage, own[0].stage) if own else None


def locate(
    data: Fitted,
    residual: Signal,
    places: Sequence[Place],
    stage: str | None = None,
    own: tuple[Place, ...] | None = None,
) -> Where:
    """Find where a gap lies.

    Parameters
    ----------
    residual : (M, 5) measured minus simulated blocks, zeros taken off
    places : the map of the gap
    stage : of its main cause, or the one that deviates by itself, where either is known; else the
        one of the maximum deviation
    own : where it arises stage by stage
    """
    channels = {p.channel for p in places if abs(p.z) > STANDS_OUT and STAGE_OF[p.channel] == stage}
    worst = max(
        (p for p in places if not channels or p.channel in channels), key=lambda p: abs(p.z)
    )
    k, phase = CHANNELS.index(worst.channel), PHASES.index(worst.phase)
    here = data.seen[:, k] & (data.blocks.phase == phase)
    far = here & (np.abs(residual[:, k]) > STANDS_OUT * data.noise[:, k])
    far = far if far.any() else here
    velocity = np.concatenate(
        [log.course.blocks.mean(log.run.channels["velocity"]) for log in data.logs]
    )
    speed, current = (
        velocity * (data.rig.rpm_per_velocity or math.nan),
        data.measured[:, CHANNELS.index("idc")],
    )
    gaps = residual[far, k]
    side = math.copysign(1.0, worst.bias)
    size = float(side * np.quantile(side * gaps, LARGEST))
    return Where(
        stage or STAGE_OF[worst.channel], worst, _span(speed[far]), _span(current[far]), size, own
    )


def _span(values: Signal) -> tuple[float, float]:
    """From the smallest to the largest value, without `EDGE` at either end."""
    low, high = np.quantile(values, (EDGE, 1.0 - EDGE)).tolist()
    return low, high
