"""The noise of the blocks of a log: of the sensors, of the velocity that drives the model, and
the ringing of the tether.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import white_noise
from winchcascade.diagnosis.fit.block_means import (
    HOLD,
    PHASES,
    Blocks,
    changing,
    middles,
    scatter_about_course,
)
from winchcascade.diagnosis.fit.predict import CHANNELS, Course
from winchcascade.rig.line_velocity import line_velocity
from winchcascade.rig.state import constants

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.rig.parts import Model

GAIN_STEP = 0.005
"""Relative change of the velocity by which the model's answer to its noise is found."""

MOVING = 3.0
"""Slower than this multiple of the speed in which friction turns, it only bounds the force. [1]"""

MAX_NOISE = 3.0
"""Number of standard deviations of its noise that a signal reaches occasionally."""

CREEPING = 0.2
"""Below this multiple of that speed the noise of the velocity moves nothing. [1]"""

CONDUCTING = 0.5
"""In open circuit the voltage follows the machine while the bridge carries at least this share
of the bleed's current.
"""

NOISELESS = 3e-4
"""A simulated log may have no noise: its blocks count as known to this share of the channel's
largest, about what a coarser step and a grid of the solutions leave. [1]"""

MIN_BLOCKS = 12
"""Minimum number of blocks from which a noise of their own is estimated."""


class Noise(msgspec.Struct, frozen=True):
    """Noise of the blocks of one log.

    `seen` (m, 5): the channel depends on the model there. `own` (m, 5) is the standard deviation of
    the mean of a block that belongs to the channel alone, `bare` (m, 5) its part from white noise
    of the sensor, `drive` (m, 5) the standard deviation that all channels share through the noise
    of the velocity, `model` (m, 5) that by which the model may deviate in a single block; it is the
    same in all `repeats` of the log. SI units, columns of `predict.CHANNELS`.
    """

    seen: NDArray[np.bool_]
    own: Signal
    bare: Signal
    drive: Signal
    model: Signal
    repeats: float = 1.0

    @property
    def logged(self) -> Signal:
        """Standard deviation of each block's mean in the log, without the deviation of the
        model, (m, 5).
        """
        return np.asarray(np.hypot(self.own, self.drive))

    @property
    def own_total(self) -> Signal:
        """Part of `total` that belongs to the channel alone, (m, 5).

        The deviation of the model counts as often as the log is repeated: all repeats together tell
        no more of it than one log.
        """
        return np.asarray(np.sqrt(self.own**2 + self.repeats * self.model**2))

    @property
    def total(self) -> Signal:
        """Standard deviation of each block's residual, log minus model, (m, 5)."""
        return np.asarray(np.hypot(self.own_total, self.drive))


def noise_of(course: Course, model: Model, predicted: Signal) -> Noise:
    """Noise of a log's blocks as estimated from its own samples, before it is compared with any
    model's values.

    Parameters
    ----------
    predicted : (m, 5) blocks that the model gives, for the answer to the velocity's noise
    """
    run, blocks = course.run, course.blocks
    speed = blocks.mean(run.channels["velocity"])
    moved, fast = (
        course.predict(model, 1.0 + GAIN_STEP) - predicted,
        np.abs(speed[:, None]) > CREEPING * course.coarse.rest,
    )
    slope = np.divide(moved, GAIN_STEP * speed[:, None], out=np.zeros_like(predicted), where=fast)
    white = np.array(
        [white_noise(run.channels[name]) if name in run.channels else 0.0 for name in CHANNELS]
    )
    minimum = NOISELESS * np.max(np.abs(predicted), axis=0) if run.simulated else 0.0
    bare = np.maximum(white / np.sqrt(blocks.count)[:, None], minimum)
    samples = max(round(float(np.median(blocks.count))), 1)
    velocity = line_velocity(run, course.scale.ramp)
    drive = slope * velocity.noise(samples)
    return Noise(
        _seen(course, model, speed, velocity.max_noise), bare, bare, drive, np.zeros_like(bare)
    )


def _seen(course: Course, model: Model, speed: Signal, u_velocity: float) -> NDArray[np.bool_]:
    """Where a channel depends on the model: force and torque while the line moves, as friction only
    bounds them at rest, the voltage of an open circuit while the bridge conducts, and that of a
    machine at rest unless the noise of the velocity alone would make the bridge conduct.

    Parameters
    ----------
    speed : (m,) of the line in each block [m/s]
    u_velocity : largest noise of the smoothed velocity [m/s]
    """
    blocks, hold = course.blocks, course.blocks.phase == HOLD
    moves = (np.abs(speed) > MOVING * course.coarse.rest)[:, None]
    seen = np.tile([name in course.run.channels for name in CHANNELS], (blocks.size, 1))
    force, torque, vdc, idc = (CHANNELS.index(name) for name in ("force", "torque", "vdc", "idc"))
    seen[:, [force, torque]] &= moves & ~hold[:, None]
    generator, numbers = model.generator, constants(model, course.load, course.coarse.rest)
    rpm = MAX_NOISE * u_velocity * model.drivetrain.gear / model.winch.r_drum * 30.0 / math.pi
    if generator.k_e * rpm > 2.0 * generator.v_diode:
        seen[:, [vdc, idc]] &= moves
    if np.isinf(course.load):
        bridge, bleed = course.block_mean(course.electrical(numbers, "i_bridge", "idc")).T
        seen[:, vdc] &= (bridge > CONDUCTING * bleed) | (hold & (blocks.cycle == 0))
        seen[:, idc] = False
    return seen


def without_slack(noise: Noise, model: Model, predicted: Signal) -> Noise:
    """Leave out the force where the line is slack within its noise: it swings, and a tension is
    never below zero.

    Parameters
    ----------
    predicted : (m, 5) blocks that the model gives
    """
    if not model.winch.goes_slack:
        return noise
    force, seen = CHANNELS.index("force"), noise.seen.copy()
    seen[:, force] &= predicted[:, force] > MAX_NOISE * noise.own[:, force]
    return msgspec.structs.replace(noise, seen=seen)


def with_extra(noise: Noise, blocks: Blocks, residual: Signal) -> Noise:
    """Add other scatter from block to block that the noise of the sensors does not contain:
    ringing, gusts.

    Parameters
    ----------
    residual : (m, 5) measured minus predicted blocks
    """
    found, expected = np.moveaxis(unsteadiness_of(noise, blocks, residual), -1, 0)
    extra = np.where(found > expected, found**2 - expected**2, 0.0)
    return msgspec.structs.replace(noise, own=np.sqrt(noise.own**2 + extra[blocks.phase]))


IN_RAMPS = 1.5
"""Scatter of the blocks within slow ramps over their noise from which it is noise too. [1]"""


def with_ramps(noise: Noise, blocks: Blocks, residual: Signal, speed: Signal) -> Noise:
    """Add the scatter that the best fit leaves within slow ramps: resonances that they cross, which
    no effect explains.

    Parameters
    ----------
    residual : (m, 5) measured minus predicted blocks
    speed : (m,) mean speed of the line in each [m/s]
    """
    inside = changing(blocks, speed)
    ramps = inside | np.append(inside[1:], False) | np.append(False, inside[:-1])
    extra = np.zeros((len(PHASES), len(CHANNELS)))
    for phase, k in np.ndindex(extra.shape):
        of = middles(blocks, noise.seen[:, k] & (blocks.phase == phase) & inside)
        if of.size >= MIN_BLOCKS:
            found = (
                np.mean((residual[of - 1, k] - 2.0 * residual[of, k] + residual[of + 1, k]) ** 2)
                / 6.0
            )
            expected = np.mean(noise.total[of, k] ** 2)
            extra[phase, k] = found - expected if found > IN_RAMPS**2 * expected else 0.0
    return msgspec.structs.replace(
        noise, own=np.sqrt(noise.own**2 + extra[blocks.phase] * ramps[:, None])
    )


def unsteadiness_of(noise: Noise, blocks: Blocks, residual: Signal) -> Signal:
    """Standard deviations of the blocks of a residual about a smooth course, as found and as the
    noise of sensors and velocity and the model make them, by phase and channel, (3, 5, 2) in the
    units of the channels; NaN where there are too few blocks.
    """
    expected = np.sqrt(noise.bare**2 + noise.drive**2 + noise.model**2)
    table = np.full((len(PHASES), len(CHANNELS), 2), np.nan)
    for phase in range(len(PHASES)):
        for k in range(len(CHANNELS)):
            here = noise.seen[:, k] & (blocks.phase == phase)
            found = scatter_about_course(blocks, residual[:, k], here, MIN_BLOCKS)
            if np.isfinite(found):
                table[phase, k] = found, np.median(expected[middles(blocks, here), k])
    return table
