"""Whether the residual of a fit is more than noise: its size, its scatter within blocks and from
block to block.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import rms, white_noise
from winchcascade.diagnosis.fit.block_means import HOLD, PAYOUT, PHASES, scatter_about_course
from winchcascade.diagnosis.fit.block_noise import MIN_BLOCKS, unsteadiness_of
from winchcascade.diagnosis.fit.evidence import Fit
from winchcascade.diagnosis.fit.fitted_log import WITHIN, Log
from winchcascade.diagnosis.fit.misfit import Fitted
from winchcascade.diagnosis.fit.predict import CHANNELS, Course

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.suspects import Suspects


BLOCKS_MIN, BLOCK_Z_MAX = 30, 8.0
"""Minimum number of blocks for an rms, and magnitude that a single block counts for at most."""


def block_rms(data: Fitted, z: Signal) -> dict[tuple[str, str], float]:
    """Root mean square of whitened blocks by channel and phase, over all logs that take part."""
    table, found = z.reshape(-1, len(CHANNELS)), {}
    for k, channel in enumerate(CHANNELS):
        for p, name in enumerate(PHASES):
            here = table[(data.blocks.phase == p) & (table[:, k] != 0.0), k]
            if here.size >= BLOCKS_MIN:
                found[channel, name] = rms(np.minimum(np.abs(here), BLOCK_Z_MAX))
    return found


FAST_MOTION_WIDTH = 0.5
"""Part of the usual width over which the velocity is smoothed where its fast motion is sought.
[1]
"""


def scatter(data: Fitted, suspects: Suspects, fit: Fit) -> dict[str, float]:
    """Scatter within blocks of payout over that of noise of sensors and velocity and of the model,
    the worst log, by channel.

    What noise and fast motion of the line move, which the smoothed velocity lacks, is the change of
    the simulation where the velocity is smoothed over `FAST_MOTION_WIDTH` of the width. The force
    is not judged: its tether rings. This shows a ripple that the means of blocks do not contain.
    Fast motion moves a channel by as much at any load: the part of the model is that of the log
    with the highest level.
    """
    models, skew = data.models(fit.nu, fit.effects(suspects)), data.skew(fit.nu)
    share = data.rig.model.discrepancy
    deviation = np.max(np.sqrt(np.sum(data.discrepancies() ** 2, axis=2)), axis=0)
    found: dict[str, float] = {}
    for number, (log, model) in enumerate(zip(data.logs, models, strict=True)):
        blocks, coarse = log.course.blocks, log.course.coarse.t
        payout = blocks.phase == PAYOUT
        if number in data.withheld or np.count_nonzero(payout) < BLOCKS_MIN // 2:
            continue
        grid = log.course.on_grid(model, skew=skew)
        scale = msgspec.structs.replace(
            log.course.scale, ramp=FAST_MOTION_WIDTH * log.course.scale.ramp
        )
        finer = Course(log.run, blocks, log.course.step, scale)
        lively = finer.on_grid(model, skew=skew)
        for k, channel in enumerate(CHANNELS):
            here = payout & log.noise.seen[:, k]
            if channel == "force" or not here.any():
                continue
            logged = log.run.channels[channel]
            predicted = np.interp(log.run.t, coarse, grid[:, k])
            residual = blocks.scatter(logged - predicted)[here]
            moved = np.interp(log.run.t, finer.coarse.t, lively[:, k]) - predicted
            floor = np.hypot(white_noise(logged), blocks.scatter(moved)[here])
            of_model = np.hypot(WITHIN * share * blocks.scatter(predicted)[here], deviation[k])
            ratio = float(np.sqrt(np.mean(residual**2) / np.mean(floor**2 + of_model**2)))
            found[channel] = max(found.get(channel, 0.0), ratio)
    return found


def unsteadiness(data: Fitted, suspects: Suspects, fit: Fit) -> dict[tuple[str, str], float]:
    """Scatter of blocks about a smooth course over that of noise, the median of the logs, by
    channel and phase.

    The noise in the fit contains all scatter from block to block, so that no z shows it. The tether
    moves the force also at rest: its scatter there counts as noise.
    """
    residual = data.measured - data.predict(fit.nu, fit.effects(suspects))
    tables = []
    for k in data.taking:
        log = data.logs[k]
        table = unsteadiness_of(log.noise, log.course.blocks, residual[data.rows[k]])
        table[:, FORCE, 1] = np.fmax(table[:, FORCE, 1], _at_rest(log))
        tables.append(table)
    found, expected = np.moveaxis(np.array(tables), -1, 0)
    ratio = np.divide(found, expected, out=np.full_like(found, np.nan), where=expected > 0.0)
    return {
        (channel, name): float(np.nanmedian(ratio[:, p, k]))
        for p, name in enumerate(PHASES)
        for k, channel in enumerate(CHANNELS)
        if np.isfinite(ratio[:, p, k]).any()
    }


FORCE = CHANNELS.index("force")


def _at_rest(log: Log) -> float:
    """Scatter of the force from block to block while the line rests, NaN where there are too few
    blocks. [N]
    """
    blocks = log.course.blocks
    return scatter_about_course(blocks, log.measured[:, FORCE], blocks.phase == HOLD, MIN_BLOCKS)
