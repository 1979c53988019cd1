"""The map of a gap (measured minus simulated by channel, phase and load), and where on it the gap lies and arises."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.diagnosis_result import Place, Where
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted

ZERO_REACH = 3.0
"""Bound of a zero, in its standard uncertainties; more is a gap."""

STAGE_OF = {
    "pressure": "restoring",
    "force": "transmission",
    "torque": "gearbox",
    "vdc": "generator",
    "idc": "generator",
}
"""Stage whose output a channel is."""

STANDS_OUT = 4.0
"""A bias is significant beyond this many standard uncertainties of noise, repeatability and tolerance."""

EDGE = 0.02
"""Share of the significant blocks that a region leaves out at either end."""

LARGEST = 0.975
"""Quantile of the differences of the significant blocks that counts as the largest: single blocks may be disturbed."""


def weigh(residual: Signal, cycle: NDArray[np.intp], noise: Signal, u_zero: float, tolerances: Signal) -> Place:
    """Weigh the bias of some blocks of one phase, in the unit of their channel.

    Parameters
    ----------
    residual : (m,) measured minus predicted
    cycle : (m,) number of the cycle of each
    noise : (m,) one standard deviation of each block
    u_zero : standard uncertainty of the zeros, which all blocks share
    tolerances : (m, k) what one standard uncertainty of each number that is not exactly known moves
    """
    bias, own = float(np.mean(residual)), float(np.sqrt(np.mean(noise**2)))
    u_noise = math.hypot(own / math.sqrt(residual.size) * 1.5**0.5, u_zero)
    u_tolerance = float(np.sqrt(np.sum(np.mean(tolerances, axis=0) ** 2)))
    means = [float(np.mean(residual[cycle == c])) for c in np.unique(cycle)]
    u_repeat = float(np.std(means, ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else math.nan
    u = math.hypot(u_noise, u_tolerance, 0.0 if math.isnan(u_repeat) else u_repeat)
    return Place(
        blocks=residual.size,
        bias=bias,
        rms=float(np.sqrt(np.mean(residual**2))),
        noise=own,
        u_noise=u_noise,
        u_repeat=u_repeat,
        u_tolerance=u_tolerance,
        z=bias / u if u > 0.0 else 0.0,
    )


def without_zeros(data: Fitted, residual: Signal) -> Signal:
    """Residual blocks of every log, (M, 5), without the zeros of each log: weighted means, at most `ZERO_REACH` tolerances.

    Parameters
    ----------
    residual : (M, 5) measured minus predicted blocks, no zero taken off
    """
    left = residual.copy()
    for rows, log, u_zero in zip(data.rows, data.logs, data.zeros(np.ones(len(data.nuisances))), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = np.where(log.noise.seen, 1.0 / log.noise.total**2, 0.0)
            prior = np.where(u_zero > 0.0, 1.0 / u_zero**2, np.inf)
            mean = np.sum(weight * residual[rows], axis=0) / (np.sum(weight, axis=0) + prior)
        left[rows] -= np.nan_to_num(mean).clip(-ZERO_REACH * u_zero, ZERO_REACH * u_zero)
    return left


def compare(data: Fitted, predicted: Signal, tolerances: Signal) -> tuple[Place, ...]:
    """Map a gap.

    Parameters
    ----------
    predicted : (M, 5) blocks of the model, without zeros
    tolerances : (M, 5, k) what one standard uncertainty of each nuisance that is simulated moves
    """
    residual, cycle = without_zeros(data, data.measured - predicted), data.blocks.cycle
    u_zero = data.zeros(np.ones(len(data.nuisances)))
    tolerances = np.concatenate((tolerances, data.discrepancies()), axis=2)
    return tuple(
        msgspec.structs.replace(
            weigh(residual[here, k], cycle[here], data.noise[here, k], u_zero[log, k], tolerances[here, k]),
            channel=CHANNELS[k],
            phase=PHASES[phase],
            log=log,
            load=data.logs[log].run.load,
        )
        for log, k, phase, here in data.cells()
        if here.size >= 2
    )


def arises(places: Sequence[Place]) -> tuple[Place, ...]:
    """The worst place of each stage that deviates by itself in the map of `stagewise`, the worst of all first."""
    worst: dict[str, Place] = {}
    for place in sorted(places, key=lambda p: -abs(p.z)):
        if abs(place.z) > STANDS_OUT:
            worst.setdefault(place.stage, place)
    return tuple(worst.values())


def deviating_stage(own: Sequence[Place]) -> str | None:
    """Stage of the catalogue that deviates most by itself, None where none does; load and bridge make one module there."""
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
    stage : of its main cause, or the one that deviates by itself, where either is known; else the one of the largest deviation
    own : where it arises stage by stage
    """
    channels = {p.channel for p in places if abs(p.z) > STANDS_OUT and STAGE_OF[p.channel] == stage}
    worst = max((p for p in places if not channels or p.channel in channels), key=lambda p: abs(p.z))
    k, phase = CHANNELS.index(worst.channel), PHASES.index(worst.phase)
    here = data.seen[:, k] & (data.blocks.phase == phase)
    far = here & (np.abs(residual[:, k]) > STANDS_OUT * data.noise[:, k])
    far = far if far.any() else here
    velocity = np.concatenate([log.course.blocks.mean(log.run.channels["velocity"]) for log in data.logs])
    speed, current = velocity * (data.rig.rpm_per_velocity or math.nan), data.measured[:, CHANNELS.index("idc")]
    gaps = residual[far, k]
    side = np.sign(np.median(gaps)) or 1.0
    size = float(side * np.quantile(side * gaps, LARGEST))
    return Where(stage or STAGE_OF[worst.channel], worst, _span(speed[far]), _span(current[far]), size, own)


def _span(values: Signal) -> tuple[float, float]:
    """From the smallest to the largest value, without `EDGE` at either end."""
    low, high = np.quantile(values, (EDGE, 1.0 - EDGE)).tolist()
    return low, high
