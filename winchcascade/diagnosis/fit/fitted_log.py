"""A log of a fit: its blocks, how far they are known, and what a discrepancy of the model moves
in them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.block_means import HAUL_IN, HOLD, PHASES, Blocks
from winchcascade.diagnosis.fit.block_noise import Noise, noise_of, with_extra, without_slack
from winchcascade.diagnosis.fit.nuisances import COURSES
from winchcascade.diagnosis.fit.predict import CHANNELS, Course
from winchcascade.rig.parts import Model
from winchcascade.rig.simulate import read_by
from winchcascade.rig.steps import COARSE, STEP, resolving

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.core.scales import MotionScale

WITHIN = 25.0
"""Discrepancy of a block as a share of the scatter of the model within it, which is largest where
the motion begins and ends, over that as a share of its level. [1]"""

TOP = 0.9
"""Quantile of the magnitude of a channel, over the blocks of a phase, that is its level there.
[1]
"""


class Log(msgspec.Struct, frozen=True):
    """One log of a fit.

    `measured` (m, 5) are its blocks, `offset` (m, 5) what a fine step gives beyond the coarse one
    of the fit, at the stamps `offset_at_stamps` (n, 5), `step` the fine one [s]. `courses` (m, 5,
    3) are what a discrepancy of the model of 1 moves along each of `nuisances.COURSES`. SI units,
    columns of `predict.CHANNELS`.
    """

    run: Run
    course: Course
    measured: Signal
    offset: Signal
    offset_at_stamps: Signal
    step: float
    noise: Noise
    courses: Signal

    @property
    def load(self) -> float:
        """Load, inf for an open circuit. [ohm]"""
        return self.course.load

    def at_stamps(self, model: Model, skew: Signal, zeros: Signal) -> Signal:
        """What the sensors read by a model at the stamps of the log, (n, 5), SI units, columns of
        `predict.CHANNELS`.

        Parameters
        ----------
        skew, zeros : (5,) delay of the reading of each channel [s], and its zero
        """
        return (
            self.course.at_stamps(self.course.on_grid(model, skew=skew))
            + self.offset_at_stamps
            + zeros
        )


def _levels(blocks: Blocks, predicted: Signal) -> Signal:
    """Level of each channel in each phase, (3, 5): 0 in phases that a log lacks.

    In hold the generator runs down within a few blocks: the level of its voltage and current is
    that of the whole log.

    Parameters
    ----------
    predicted : (m, 5) blocks of the model of the rig file; the level of the pressure is its swing
        over the log
    """
    level = np.zeros((len(PHASES), len(CHANNELS)))
    for phase in range(len(PHASES)):
        here = predicted[blocks.phase == phase]
        if here.size:
            level[phase] = np.quantile(np.abs(here), TOP, axis=0)
    level[:, CHANNELS.index("pressure")] = np.ptp(predicted[:, CHANNELS.index("pressure")])
    electrical = [CHANNELS.index("vdc"), CHANNELS.index("idc")]
    if np.any(blocks.phase == HOLD):
        level[HOLD, electrical] = np.max(level[:, electrical], axis=0)
    return level


VANISHING = 1e-9
"""Share of its largest value in the log below which a signal is none in a phase: a capacitor
decays to any value. [1]
"""


def _courses(course: Course, predicted: Signal, level: Signal) -> Signal:
    """What a discrepancy of the model of 1 moves, (m, 5, 3): the plateau of each channel in the
    log, along `COURSES`.

    The plateau is the largest level of a phase: sensors and models deviate by a share of what a run
    reaches, also in haul-in.

    Parameters
    ----------
    predicted : (m, 5) blocks of the rig as given
    level : (3, 5) as `_levels` gives it
    """
    blocks, plateau = course.blocks, np.max(level, axis=0)
    speed = np.abs(blocks.mean(course.run.channels["velocity"]))
    signals = np.column_stack(
        [np.ones(blocks.size), speed, np.abs(predicted[:, CHANNELS.index("idc")])]
    )
    vanishing = np.maximum(
        VANISHING * np.max(signals, axis=0, initial=0.0), np.finfo(np.float64).tiny
    )
    found = np.zeros((blocks.size, len(CHANNELS), len(COURSES)))
    for phase in range(len(PHASES)):
        here = np.flatnonzero(blocks.phase == phase)
        if here.size:
            shape = signals[here] / np.maximum(np.quantile(signals[here], TOP, axis=0), vanishing)
            found[here] = plateau[:, None] * np.minimum(shape, 1.0)[:, None, :]
    # the clutch is open while the line is hauled in: a torque of zero is no share of a plateau
    found[blocks.phase == HAUL_IN, CHANNELS.index("torque")] = 0.0
    return found


def with_channels_of(model: Model, run: Run) -> Run:
    """A log without the channels of the fit that the rig does not have, such as the pressure
    without gas.
    """
    foreign = set(CHANNELS) - set(read_by(model))
    kept = {name: x for name, x in run.channels.items() if name not in foreign}
    return msgspec.structs.replace(run, channels=kept) if len(kept) < len(run.channels) else run


USUAL = 3.0
"""Number of payouts at a load for which the discrepancy of a single block is stated; more of
them are repeats.
"""


def repeats_of(
    runs: Sequence[Run], blocks: Sequence[Blocks], withheld: Collection[int]
) -> list[float]:
    """How often each log is repeated: payouts at its load over all logs that take part, over the
    usual number, at least 1.
    """
    payouts: dict[float | None, int] = {}
    for k, (run, own) in enumerate(zip(runs, blocks, strict=True)):
        if k not in withheld:
            payouts[run.load] = payouts.get(run.load, 0) + np.unique(own.cycle[own.phase == 0]).size
    return [max(payouts.get(run.load, 0) / USUAL, 1.0) for run in runs]


def means_over(blocks: Blocks, run: Run) -> Signal:
    """Means of the channels of a run over blocks, (m, 5), SI units, columns of
    `predict.CHANNELS`; 0 for one that it lacks.
    """
    nothing = np.zeros(run.t.size)
    return np.column_stack([blocks.mean(run.channels.get(name, nothing)) for name in CHANNELS])


def log_for_fit(
    rig: Rig, nominal: Model, scale: MotionScale, run: Run, blocks: Blocks, repeats: float
) -> Log:
    """Prepare a log.

    Parameters
    ----------
    scale : scales of the motion of the campaign
    repeats : how often it is repeated; the discrepancy of a block is the same in repeats, so that
        all of them together must tell no more of the model than one
    """
    course, finely = (
        Course(run, blocks, resolving(nominal, scale, share), scale) for share in (COARSE, STEP)
    )
    grid, fine_grid = course.on_grid(nominal), finely.on_grid(nominal)
    coarse, fine = course.block_mean(grid), finely.block_mean(fine_grid)
    at_stamps = course.at_stamps(grid)
    measured = means_over(blocks, run)
    noise = with_extra(noise_of(course, nominal, coarse), blocks, measured - fine)
    noise = without_slack(noise, nominal, fine)
    level = _levels(blocks, fine)
    deviation = rig.model.discrepancy * _in_a_block(blocks, at_stamps, level[blocks.phase])
    noise = msgspec.structs.replace(noise, model=deviation, repeats=repeats)
    return Log(
        run=run,
        course=course,
        measured=measured,
        offset=fine - coarse,
        offset_at_stamps=finely.at_stamps(fine_grid) - at_stamps,
        step=finely.step,
        noise=noise,
        courses=_courses(course, fine, level),
    )


OF_A_BLOCK = 0.25
"""Discrepancy of the model of a single block, as a share of that of its phase. [1]"""


def _in_a_block(blocks: Blocks, at_stamps: Signal, level: Signal) -> Signal:
    """What a discrepancy of the model of 1 moves in single blocks, (m, 5), SI units.

    Parameters
    ----------
    at_stamps : (n, 5) channels of the model of the rig file, SI units
    level : (m, 5) of each channel in its phase, SI units
    """
    scatter = np.column_stack([blocks.scatter(x) for x in at_stamps.T])
    return np.hypot(WITHIN * scatter, OF_A_BLOCK * level)


def whitener_of_blocks(noise: Noise) -> Signal:
    """Inverse Cholesky factor of each block's covariance: own variances and the velocity's,
    which all channels share.
    """
    own = np.where(noise.seen, noise.own_total, 1.0)
    drive = np.where(noise.seen, noise.drive, 0.0)
    covariance = drive[:, :, None] * drive[:, None, :]
    k = np.arange(len(CHANNELS))
    covariance[:, k, k] += own**2
    inverse: Signal = np.linalg.inv(np.linalg.cholesky(covariance))
    inverse[~noise.seen] = 0.0
    return inverse * noise.seen[:, None, :]


RHO = 0.2
"""Correlation of a block's error with the one before: smoothing of the velocity, gusts, ringing."""


def whitener_of(
    noises: Sequence[Noise], taking: Sequence[bool], joined: NDArray[np.bool_]
) -> csr_array:
    """Matrix that turns residual blocks of several logs in a row into independent numbers of unit
    variance, (M * 5, M * 5).

    A channel without information in a block gives zeros, and so does a log that does not take part.
    Within a phase, a share `RHO` of the block before is subtracted.

    Parameters
    ----------
    taking : whether each log takes part
    joined : (M,) whether a block follows the one before, as in `Blocks`
    """
    from scipy.sparse import bsr_array, csr_array, diags_array, eye_array, kron

    of_blocks = np.concatenate(
        [whitener_of_blocks(noise) * part for noise, part in zip(noises, taking, strict=True)]
    )
    size, share = joined.size, 1.0 / math.sqrt(1.0 - RHO * RHO)
    own = bsr_array((of_blocks, np.arange(size), np.arange(size + 1)))
    diagonals = [
        np.where(joined, share, 1.0).tolist(),
        np.where(joined[1:], -RHO * share, 0.0).tolist(),
    ]
    before = diags_array(diagonals, offsets=[0, -1])
    return csr_array(kron(before, eye_array(len(CHANNELS)), format="csr") @ own.tocsr())
