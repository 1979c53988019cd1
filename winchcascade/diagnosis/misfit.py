"""Some logs on one rig as one fit: blocks, what the model predicts of them, and residuals whitened by their noise."""

from __future__ import annotations

import math
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.block_means import blocks_of
from winchcascade.diagnosis.noise import Noise, noise_of, with_extra
from winchcascade.diagnosis.nuisances import LOAD, Nuisance, nuisances, shifted
from winchcascade.diagnosis.predict import CHANNELS, COARSE, Course
from winchcascade.rig.parts import baseline, changed, possible
from winchcascade.rig.simulate import STEP

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.rig.effects.effect import ActiveEffect
    from winchcascade.rig.parts import Model


RHO = 0.2
"""Correlation of a block's error with the one before: smoothing of the velocity, gusts, ringing."""


class Log(msgspec.Struct, frozen=True):
    """One log of a fit.

    `measured` (m, 5) are its blocks, `offset` (m, 5) what a fine step gives beyond the coarse one of the fit, `whitener`
    (m, 5, 5) turns a block's residuals into independent ones of unit variance. SI units, columns of `predict.CHANNELS`.
    """

    run: Run
    course: Course
    measured: Signal
    offset: Signal
    noise: Noise
    whitener: Signal

    @property
    def load(self) -> float:
        """Load, inf for an open circuit. [ohm]"""
        return self.course.load


class Fitted:
    """Logs of one rig, ready to be compared with a model again and again.

    Parameters
    ----------
    runs : logs with their loads
    rig : as given, never calibrated first
    cycles : of each log, the first and last that count, None for all
    withheld : numbers of the logs that are predicted but take part in no fit
    """

    def __init__(
        self,
        runs: Sequence[Run],
        rig: Rig,
        cycles: Sequence[tuple[int, int] | None] | None = None,
        withheld: Collection[int] = (),
    ) -> None:
        self.rig = rig
        self.nominal = baseline(rig)
        spans = cycles or [None] * len(runs)
        self.nuisances: tuple[Nuisance, ...] = nuisances(rig, runs)
        self.logs = [_log(run, rig, self.nominal, span) for run, span in zip(runs, spans, strict=True)]
        self.sizes = [log.measured.shape[0] for log in self.logs]
        ends = np.cumsum([0, *self.sizes])
        self.rows = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self.withheld = frozenset(withheld)
        self.whitener = np.concatenate([log.whitener * (k not in withheld) for k, log in enumerate(self.logs)])
        self.joined = np.concatenate([log.course.blocks.joined for log in self.logs])

    def model(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Model:
        """The rig's model: its numbers and laws moved by nuisances in units of their tolerance, then changed by effects.

        Loads and gains are as they are stated.
        """
        moves = {
            (n.section, n.name): x * n.sd for n, x in zip(self.nuisances, nu, strict=True) if n.kind == "rig" and x
        }
        model = baseline(shifted(self.rig, moves)) if moves else self.nominal
        for n, x in zip(self.nuisances, nu, strict=True):
            if n.kind == "law" and x:
                model = changed(model, n.path, "add", x * n.sd)
        for effect in effects:
            model = effect.apply(model)
        return possible(model)

    def models(self, nu: Signal, effects: Sequence[ActiveEffect]) -> list[Model]:
        """The model of each log: that of the rig, gains and the log's load moved by nuisances too."""
        model = self.model(nu, effects)
        for n, x in zip(self.nuisances, nu, strict=True):
            if n.kind == "gain":
                model = changed(model, n.path, "compound", x * n.sd)
        loads = {n.load: x * n.sd for n, x in zip(self.nuisances, nu, strict=True) if n.kind == "load"}
        return [changed(model, LOAD, "compound", loads.get(log.load, 0.0)) for log in self.logs]

    def skew(self, nu: Signal) -> Signal:
        """How late each channel is read, (5,) [s]."""
        late = np.zeros(len(CHANNELS))
        for n, x in zip(self.nuisances, nu, strict=True):
            if n.kind == "timing":
                late[CHANNELS.index(n.name)] = x * n.sd
        return late

    def predict(self, nu: Signal, effects: Sequence[ActiveEffect], logs: Iterable[int] | None = None) -> Signal:
        """Blocks that the model gives, (M, 5), zeros of the sensors included; only some logs, where they are named."""
        models = self.models(nu, effects)
        which = range(len(self.logs)) if logs is None else sorted(logs)
        skew = self.skew(nu)
        parts = all_at_once([partial(self.logs[k].course.predict, models[k], skew=skew) for k in which])
        zeros = np.zeros((len(self.logs), len(CHANNELS)))
        for n, x in zip(self.nuisances, nu, strict=True):
            if n.kind == "zero":
                zeros[n.log, CHANNELS.index(n.name)] = x * n.sd
        return np.concatenate([part + self.logs[k].offset + zeros[k] for k, part in zip(which, parts, strict=True)])

    @property
    def measured(self) -> Signal:
        """Blocks of every log, (M, 5)."""
        return np.concatenate([log.measured for log in self.logs])

    def whiten(self, residual: Signal) -> Signal:
        """Residual blocks as independent numbers of unit variance, (M * 5, ...) from (M, 5, ...).

        A channel that says nothing in a block gives zeros, and so does a log that is withheld. Within a phase, a share `RHO` of
        the block before is taken off.
        """
        flat = residual.reshape(residual.shape[0], len(CHANNELS), -1)
        z = self.whitener @ flat
        joined = np.flatnonzero(self.joined)
        out = z.copy()
        out[joined] = (z[joined] - RHO * z[joined - 1]) / math.sqrt(1.0 - RHO * RHO)
        white: Signal = out.reshape(-1, *residual.shape[2:])
        return white

    def residual(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Signal:
        """Measured minus predicted blocks, whitened, (M * 5,)."""
        return self.whiten(self.measured - self.predict(nu, effects))

    def nuisance_columns(
        self, nu: Signal, effects: Sequence[ActiveEffect], at: Signal, seen: Signal | None = None
    ) -> Signal:
        """Whitened derivative of the prediction over every nuisance in units of its tolerance, (M * 5, nuisances).

        Parameters
        ----------
        at : (M, 5) the prediction there
        seen : (M, 5) weights of the blocks, 1 for all by default
        """
        columns = self.tolerances(nu, effects, at)
        return self.whiten(columns if seen is None else columns * seen[:, :, None])

    def tolerances(self, nu: Signal, effects: Sequence[ActiveEffect], at: Signal) -> Signal:
        """What one tolerance of each nuisance moves, (M, 5, nuisances), SI units; parameters as above."""
        columns = np.zeros((*at.shape, len(self.nuisances)))
        simulated = []
        for j, n in enumerate(self.nuisances):
            if n.kind == "zero":
                columns[self.rows[n.log], CHANNELS.index(n.name), j] = n.sd
            elif n.kind == "gain":
                k = CHANNELS.index(n.name)
                columns[:, k, j] = at[:, k] * n.sd
            else:
                simulated.append(j)
        variants: list[tuple[Signal, Sequence[ActiveEffect]]] = [(nu + np.eye(nu.size)[j], effects) for j in simulated]
        columns[:, :, simulated] = self.differences(nu, effects, variants)
        return columns

    def differences(
        self, nu: Signal, effects: Sequence[ActiveEffect], variants: Sequence[tuple[Signal, Sequence[ActiveEffect]]]
    ) -> Signal:
        """What nuisances and effects near to some give beyond these, (M, 5, variants), SI units; the shaft to first order."""
        models, skew = self.models(nu, effects), self.skew(nu)
        others, skews = [self.models(*variant) for variant in variants], [self.skew(there) for there, _ in variants]
        jobs = [
            partial(log.course.differences, models[k], [other[k] for other in others], skew, skews)
            for k, log in enumerate(self.logs)
        ]
        return np.concatenate(all_at_once(jobs))


def _log(run: Run, rig: Rig, nominal: Model, cycles: tuple[int, int] | None) -> Log:
    blocks = blocks_of(run, rig, cycles)
    course = Course(run, blocks, COARSE)
    coarse, fine = course.predict(nominal), Course(run, blocks, STEP).predict(nominal)
    nothing = np.zeros(run.t.size)
    measured = np.column_stack([blocks.mean(run.channels.get(name, nothing)) for name in CHANNELS])
    noise = with_extra(noise_of(course, nominal, coarse), blocks, measured - fine)
    return Log(run, course, measured, fine - coarse, noise, _whitener(noise))


def _whitener(noise: Noise) -> Signal:
    """Inverse Cholesky factor of each block's covariance: own variances and the velocity's, which all channels share."""
    own = np.where(noise.seen, noise.own, 1.0)
    drive = np.where(noise.seen, noise.drive, 0.0)
    covariance = drive[:, :, None] * drive[:, None, :]
    k = np.arange(len(CHANNELS))
    covariance[:, k, k] += own**2
    inverse: Signal = np.linalg.inv(np.linalg.cholesky(covariance))
    inverse[~noise.seen] = 0.0
    return inverse * noise.seen[:, None, :]
