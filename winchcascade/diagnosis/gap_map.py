"""The map of a gap: measured minus simulated by channel, phase and load, against three yardsticks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.predict import CHANNELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.misfit import Fitted, Log

ZERO_REACH = 3.0
"""A zero is taken to be within so many of its standard uncertainties; more is a gap."""


class Place(msgspec.Struct, frozen=True):
    """One channel in one phase of one log: measured minus simulated, SI units of the channel.

    `bias` and `rms` of the blocks' means once the log's zero is taken off; `noise` of a block, one standard deviation. Standard
    uncertainties of the bias: `u_noise` of noise and zero, `u_repeat` of how cycles repeat (NaN with one), `u_tolerance` of the
    rig's numbers and gains. `z` is the bias over all three, `blocks` their number. Without a model a place holds all logs
    (`log` is -1), and `share` is its share of the squared gap.
    """

    channel: str
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
    share: float = math.nan


def zero_of(log: Log, residual: Signal, u_zero: Signal) -> Signal:
    """Zeros of a log's sensors as its blocks tell them, (5,): weighted means within `ZERO_REACH` of their tolerance.

    Parameters
    ----------
    residual : (m, 5) measured minus predicted blocks, no zero taken off
    u_zero : (5,) standard uncertainty of each zero, 0 where a sensor has none
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = np.where(log.noise.seen, 1.0 / log.noise.total**2, 0.0)
        prior = np.where(u_zero > 0.0, 1.0 / u_zero**2, np.inf)
        mean = np.sum(weight * residual, axis=0) / (np.sum(weight, axis=0) + prior)
    zero: Signal = np.clip(np.nan_to_num(mean), -ZERO_REACH * u_zero, ZERO_REACH * u_zero)
    return zero


def zeros_of(data: Fitted) -> Signal:
    """Standard uncertainty of every log's zeros, (logs, 5), SI units; 0 where a sensor has none."""
    found = np.zeros((len(data.logs), len(CHANNELS)))
    for n in data.nuisances:
        if n.kind == "zero":
            found[n.log, CHANNELS.index(n.name)] = n.sd
    return found


def without_zeros(data: Fitted, residual: Signal) -> Signal:
    """Residual blocks of every log, (M, 5), each log's zeros taken off."""
    out = residual.copy()
    for rows, log, u in zip(data.rows, data.logs, zeros_of(data), strict=True):
        out[rows] -= zero_of(log, residual[rows], u)
    return out


def compare(data: Fitted, predicted: Signal, tolerances: Signal) -> tuple[Place, ...]:
    """Map a gap.

    Parameters
    ----------
    predicted : (M, 5) blocks of the model, without zeros
    tolerances : (M, 5, k) what one standard uncertainty of each nuisance but the zeros moves
    """
    residual = without_zeros(data, data.measured - predicted)
    u_zero = zeros_of(data)
    places = []
    for number, (rows, log) in enumerate(zip(data.rows, data.logs, strict=True)):
        for k, channel in enumerate(CHANNELS):
            for phase, name in enumerate(PHASES):
                here = log.noise.seen[:, k] & (log.course.blocks.phase == phase)
                if np.count_nonzero(here) < 2:
                    continue
                by = weigh(
                    residual[rows, k][here],
                    log.course.blocks.cycle[here],
                    log.noise.total[here, k],
                    u_zero[number, k],
                    tolerances[rows, k][here],
                )
                blocks = int(np.count_nonzero(here))
                places.append(Place(channel, name, number, log.run.load, blocks, **msgspec.structs.asdict(by)))
    return tuple(places)


class Weighed(msgspec.Struct, frozen=True):
    """Bias of some blocks against the yardsticks, with the fields of a `Place`."""

    bias: float
    rms: float
    noise: float
    u_noise: float
    u_repeat: float
    u_tolerance: float
    z: float


def weigh(residual: Signal, cycle: NDArray[np.intp], noise: Signal, u_zero: float, tolerances: Signal) -> Weighed:
    """Weigh the bias of some blocks of one phase, in the unit of their channel.

    Parameters
    ----------
    residual : (m,) measured minus predicted
    cycle : (m,) number of the cycle of each
    noise : (m,) one standard deviation of each block
    u_zero : standard uncertainty of the zeros, which all blocks share
    tolerances : (m, k) what one standard uncertainty of each number that is not quite known moves
    """
    count, bias = residual.size, float(np.mean(residual))
    own = float(np.sqrt(np.mean(noise**2)))
    u_noise = math.hypot(own / math.sqrt(count) * 1.5**0.5, u_zero)
    u_tolerance = float(np.sqrt(np.sum(np.mean(tolerances, axis=0) ** 2)))
    means = [float(np.mean(residual[cycle == c])) for c in np.unique(cycle)]
    u_repeat = float(np.std(means, ddof=1)) / math.sqrt(len(means)) if len(means) > 1 else math.nan
    u = math.sqrt(u_noise**2 + u_tolerance**2 + (0.0 if math.isnan(u_repeat) else u_repeat**2))
    return Weighed(
        bias=bias,
        rms=float(np.sqrt(np.mean(residual**2))),
        noise=own,
        u_noise=u_noise,
        u_repeat=u_repeat,
        u_tolerance=u_tolerance,
        z=bias / u if u > 0.0 else 0.0,
    )
