"""What noise hides in the blocks of a log: of the sensors, of the velocity that drives the model, of the tether's ringing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.white_noise import GAUSS, white_noise
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.rig.simulate import SAMPLES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Run, Signal
    from winchcascade.diagnosis.block_means import Blocks
    from winchcascade.diagnosis.predict import Course
    from winchcascade.rig.parts import Model

GAIN_STEP = 0.005
"""Relative change of the velocity by which the model's answer to its noise is found."""

MOVING = 0.03
"""Slower than this, friction only bounds the force. [m/s]"""

CREEPING = 0.002
"""Below this speed the velocity's noise moves nothing. [m/s]"""

CONDUCTING = 0.5
"""In open circuit the voltage follows the machine while the bridge carries at least this share of the bleed's current."""

NOISELESS = 3e-4
"""A simulated log may have no noise: its blocks count as known to this share of the channel's largest, about what a coarser
step and a grid of the solutions leave. [1]"""

LEAST = 12
"""Fewer blocks tell no noise of their own."""


class Noise(msgspec.Struct, frozen=True):
    """Noise of the blocks of one log.

    `seen` (m, 5) tells where a channel says anything of the model; `own` (m, 5) is the standard deviation of a block's mean
    that each channel has for itself, `bare` (m, 5) the part of it that is the sensor's white noise, `drive` (m, 5) the one
    that all share through the velocity's noise. SI units, columns of `predict.CHANNELS`.
    """

    seen: NDArray[np.bool_]
    own: Signal
    bare: Signal
    drive: Signal

    @property
    def total(self) -> Signal:
        """Standard deviation of each block's mean, (m, 5)."""
        sd: Signal = np.hypot(self.own, self.drive)
        return sd


def velocity_noise(run: Run, blocks: Blocks) -> float:
    """Standard deviation of a block's mean of the smoothed velocity. [m/s]"""
    half = (SAMPLES - 1) // 2
    k = np.arange(-half, half + 1.0)
    kernel = 3.0 * (3.0 * half * half + 3.0 * half - 1.0 - 5.0 * k * k)
    kernel /= kernel.sum()
    samples = max(round(float(np.median(blocks.count))), 1)
    passed = np.convolve(np.full(samples, 1.0 / samples), kernel)
    return white_noise(run.channels["velocity"]) * float(np.sqrt(np.sum(passed**2)))


def noise_of(course: Course, model: Model, predicted: Signal) -> Noise:
    """Noise of a log's blocks as its own samples tell it, before it is compared with any model's values.

    Parameters
    ----------
    predicted : (m, 5) blocks that the model gives, for the answer to the velocity's noise
    """
    run, blocks = course.run, course.blocks
    speed = blocks.mean(run.channels["velocity"])
    moved = course.predict(model, 1.0 + GAIN_STEP)
    slope = np.zeros_like(predicted)
    fast = np.abs(speed) > CREEPING
    slope[fast] = (moved - predicted)[fast] / (GAIN_STEP * speed[fast, None])
    white = np.array([white_noise(run.channels[name]) if name in run.channels else 0.0 for name in CHANNELS])
    least = NOISELESS * np.max(np.abs(predicted), axis=0) if run.simulated else 0.0
    bare = np.maximum(white / np.sqrt(blocks.count)[:, None], least)
    return Noise(
        seen=_seen(course, model, speed),
        own=bare,
        bare=bare,
        drive=slope * velocity_noise(run, blocks),
    )


def _seen(course: Course, model: Model, speed: Signal) -> NDArray[np.bool_]:
    """Where a channel tells anything: force and torque while the line moves, as friction only bounds them at rest, and the
    voltage of an open circuit while the bridge conducts.
    """
    from winchcascade.rig.kernel import constants

    run, blocks = course.run, course.blocks
    seen = np.ones((blocks.size, len(CHANNELS)), dtype=bool)
    for k, name in enumerate(CHANNELS):
        seen[:, k] = name in run.channels
    force, torque, vdc, idc = (CHANNELS.index(name) for name in ("force", "torque", "vdc", "idc"))
    moving = (np.abs(speed) > MOVING) & (blocks.phase != PHASES.index("hold"))
    seen[:, force] &= moving
    seen[:, torque] &= moving
    if np.isinf(course.load):
        kept = course.shaft(constants(model, course.load))
        bridge, bleed = course.block_mean(kept.i_bridge), course.block_mean(kept.idc)
        still = (blocks.phase == PHASES.index("hold")) & (blocks.cycle == 0)
        seen[:, vdc] &= (bridge > CONDUCTING * bleed) | still
        seen[:, idc] = False
    return seen


def with_extra(noise: Noise, blocks: Blocks, residual: Signal) -> Noise:
    """Add what else scatters from block to block: ringing, gusts, what no sensor's own noise tells.

    Parameters
    ----------
    residual : (m, 5) measured minus predicted blocks
    """
    own = noise.own.copy()
    for phase, here in enumerate(restless(noise, blocks, residual)):
        for k, (found, expected) in enumerate(here):
            if found > expected:
                rows = blocks.phase == phase
                own[rows, k] = np.sqrt(own[rows, k] ** 2 + found**2 - expected**2)
    return msgspec.structs.replace(noise, own=own)


def restless(noise: Noise, blocks: Blocks, residual: Signal) -> Signal:
    """Standard deviations of a residual's blocks about a smooth course, as found and as the noise of sensors and velocity
    makes them, by phase and channel, (3, 5, 2) in the channels' units; NaN where there are too few blocks.

    From second differences, by the median: a smooth gap leaves none, and a step leaves few.
    """
    expected = np.hypot(noise.bare, noise.drive)
    second = np.zeros(blocks.size, dtype=bool)
    second[2:] = blocks.joined[2:] & blocks.joined[1:-1]
    table = np.full((len(PHASES), len(CHANNELS), 2), np.nan)
    for phase in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            middle = np.flatnonzero(second & (blocks.phase == phase) & noise.seen[:, k]) - 1
            middle = middle[noise.seen[middle - 1, k] & noise.seen[middle, k]]
            if middle.size >= LEAST:
                r = residual[:, k]
                ratio = np.abs(r[middle - 1] - 2.0 * r[middle] + r[middle + 1]) / np.sqrt(6.0)
                table[phase, k] = GAUSS * median(ratio), np.median(expected[middle, k])
    return table
