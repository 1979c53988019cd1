"""Some logs on one rig as one fit: their blocks, the prediction of the model, and whitened residuals."""

from __future__ import annotations

import math
from copy import copy
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.core.scales import motion_of_runs, scales_of
from winchcascade.diagnosis.block_means import (
    HAUL_IN,
    HOLD,
    PHASES,
    Blocks,
    blocks_of,
    in_a_row,
)
from winchcascade.diagnosis.block_noise import Noise, noise_of, with_extra, with_ramps, without_slack
from winchcascade.diagnosis.entries import price_of
from winchcascade.diagnosis.marginal import WILD, Columns, Together
from winchcascade.diagnosis.nuisances import COURSES, LOAD, Nuisance, nuisances
from winchcascade.diagnosis.predict import ALL_KEPT, CHANNELS, MAX_KEPT, Course
from winchcascade.rig.baseline import baseline, stated_effects
from winchcascade.rig.effects.catalogue import SIMPLIFICATIONS
from winchcascade.rig.effects.run_order import RunOrder, RunPlace, order_of
from winchcascade.rig.parts import Model, changed, possible
from winchcascade.rig.simulate import read_by
from winchcascade.rig.steps import COARSE, STEP, resolving

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.core.scales import MotionScale, Scales
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect


RHO = 0.2
"""Correlation of a block's error with the one before: smoothing of the velocity, gusts, ringing."""

WITHIN = 25.0
"""Discrepancy of a block as a share of the scatter of the model within it, which is largest where the motion begins and ends,
over that as a share of its level. [1]"""

TOP = 0.9
"""Quantile of the magnitude of a channel, over the blocks of a phase, that is its level there. [1]"""


class Log(msgspec.Struct, frozen=True):
    """One log of a fit.

    `measured` (m, 5) are its blocks, `offset` (m, 5) what a fine step gives beyond the coarse one of the fit, at the stamps
    `offset_at_stamps` (n, 5), `step` the fine one [s]. `courses` (m, 5, 3) are what a discrepancy of the model of
    1 moves along each of `nuisances.COURSES`. SI units, columns of `predict.CHANNELS`.
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
        """What the sensors read by a model at the stamps of the log, (n, 5), SI units, columns of `predict.CHANNELS`.

        Parameters
        ----------
        skew, zeros : (5,) delay of the reading of each channel [s], and its zero
        """
        return self.course.at_stamps(self.course.on_grid(model, skew=skew)) + self.offset_at_stamps + zeros


Variant = tuple["Signal", "Sequence[ActiveEffect]"]
"""Nuisances in units of their tolerance, and the effects that act."""


class Fitted:
    """Logs of one rig, ready to be compared with a model again and again.

    Parameters
    ----------
    runs : logs with their loads
    rig : with the numbers of its file, none calibrated first
    cycles : of each log, the first and last that count, None for all
    withheld : numbers of the logs that are predicted but take part in no fit
    scales : by which they are cut into blocks, those of their own motion by default
    """

    def __init__(
        self,
        runs: Sequence[Run],
        rig: Rig,
        cycles: Sequence[tuple[int, int] | None] | None = None,
        withheld: Collection[int] = (),
        scales: Scales | None = None,
    ) -> None:
        rig = with_thresholds(rig, runs)
        self._same, self.stated_by_run = _without_changes_by_run(rig)
        self.rig, self.nominal, self.withheld = rig, baseline(self._same), frozenset(withheld)
        runs = [with_channels_of(self.nominal, run) for run in runs]
        self.order = _order(runs)
        self.scales = scales or scales_of(rig, motion_of_runs(runs))
        self.nuisances: tuple[Nuisance, ...] = nuisances(rig, runs, self.scales)
        self.cycles = cycles or [None] * len(runs)
        ramp, logs = self.scales.ramp, zip(runs, self.cycles, strict=True)
        blocks = [blocks_of(run, rig, ramp, span) for run, span in logs]
        repeats = _repeats(runs, blocks, self.withheld)
        each = zip(runs, blocks, repeats, strict=True)
        jobs = [partial(_log, rig, self.nominal, self.scales.motion, *one) for one in each]
        self.logs = all_at_once(jobs, [run.t[-1] - run.t[0] for run in runs])
        for log in self.logs:
            log.course.max_kept = max(min(MAX_KEPT, ALL_KEPT // len(self.logs)), 2)
        self.sizes = [log.measured.shape[0] for log in self.logs]
        self.rows = [slice(a, b) for a, b in pairwise(np.cumsum([0, *self.sizes]).tolist())]
        self.blocks = in_a_row([log.course.blocks for log in self.logs])
        self.measured = np.concatenate([log.measured for log in self.logs])
        self.simulated = sum(n.kind not in LOCAL for n in self.nuisances)
        self._of_kind: dict[str, list[tuple[int, Nuisance]]] = {}
        for j, n in enumerate(self.nuisances):
            self._of_kind.setdefault(n.kind, []).append((j, n))
        self._deviations = self._places_of_deviations()
        self._take_noise()

    def _take_noise(self) -> None:
        """Take the noise of the logs."""
        self.seen = np.concatenate([log.noise.seen for log in self.logs])
        self.noise = np.concatenate([log.noise.total for log in self.logs])
        self.logged_noise = np.concatenate([log.noise.logged for log in self.logs])
        self.whitener = self._whitener_of(np.concatenate([_whitener(log.noise) for log in self.logs]))
        self.local = self.whitener @ self._local_columns()

    def with_ramps(self, residual: Signal) -> Fitted | None:
        """The logs with the scatter of a residual within slow ramps, (M, 5), as noise; None where it is no more than noise."""
        logs = []
        for log, rows in zip(self.logs, self.rows, strict=True):
            blocks = log.course.blocks
            speed = blocks.mean(log.run.channels["velocity"])
            logs.append(msgspec.structs.replace(log, noise=with_ramps(log.noise, blocks, residual[rows], speed)))
        if all(np.array_equal(new.noise.own, old.noise.own) for new, old in zip(logs, self.logs, strict=True)):
            return None
        found = copy(self)
        found.logs = logs
        found._take_noise()
        return found

    def moves(self, nu: Signal, *kinds: str) -> list[tuple[Nuisance, float]]:
        """Nuisances of some kinds that move, and by how much, in their own unit."""
        return [(n, float(nu[j]) * n.sd) for kind in kinds for j, n in self._of_kind.get(kind, ()) if nu[j]]

    def model(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Model:
        """The model of the rig: its numbers and laws moved by nuisances in units of their tolerance, then changed by effects.

        Loads and gains are as they are stated, and so are entries that concern one log.
        """
        model = self.nominal
        for n, move in self.moves(nu, "rig", "law"):
            model = n.apply(model, move)
        for effect in effects:
            model = effect.apply(model) if not differs_by_run(effect) else model
        return possible(model)

    def models(self, nu: Signal, effects: Sequence[ActiveEffect]) -> list[Model]:
        """The model of each log: that of the rig, with gains, load and entries of the log too."""
        model = self.model(nu, effects)
        for n, move in self.moves(nu, "gain"):
            model = n.apply(model, move)
        loads = {n.load: move for n, move in self.moves(nu, "load")}
        found = [changed(model, LOAD, "compound", loads.get(log.load, 0.0)) for log in self.logs]
        for effect in (*self.stated_by_run, *effects):
            if effect.effect.over_runs is not None:
                found = [effect.in_run(RunPlace(self.order, k)).apply(one) for k, one in enumerate(found)]
            elif log_of(effect) >= 0:
                found[log_of(effect)] = effect.apply(found[log_of(effect)])
        return found

    def skew(self, nu: Signal) -> Signal:
        """Delay of the reading of each channel, (5,) [s]."""
        late = np.zeros(len(CHANNELS))
        for n, move in self.moves(nu, "timing"):
            late[CHANNELS.index(n.name)] = move
        return late

    def zeros(self, nu: Signal) -> Signal:
        """Zeros of the sensors of each log, (logs, 5), SI units."""
        zeros = np.zeros((len(self.logs), len(CHANNELS)))
        for n, move in self.moves(nu, "zero"):
            zeros[n.log, CHANNELS.index(n.name)] = move
        return zeros

    def discrepancy(self, nu: Signal) -> list[Signal]:
        """What the discrepancy of the model adds to the blocks of each log, (m, 5) each, SI units."""
        numbers, sd, loads, places = self._deviations
        if not nu[numbers].any():
            return [np.zeros_like(log.measured) for log in self.logs]
        share = np.zeros((len(loads), len(PHASES), len(CHANNELS), len(COURSES)))
        np.add.at(share, places, nu[numbers] * sd)
        return [np.sum(log.courses * share[loads[log.load]][log.course.blocks.phase], axis=2) for log in self.logs]

    def _places_of_deviations(self) -> tuple[NDArray[np.intp], Signal, dict[float, int], tuple[NDArray[np.intp], ...]]:
        """Numbers of the nuisances of the discrepancy, one row for each load that they concern, with standard deviations.

        Also the row of each load, and where a nuisance stands among loads, phases, channels and courses.
        """
        loads = {load: row for row, load in enumerate(dict.fromkeys(log.load for log in self.logs))}
        found = [
            (j, n.sd, row, PHASES.index(n.phase), CHANNELS.index(n.name), COURSES.index(n.course))
            for j, n in self._of_kind.get("discrepancy", ())
            for row in (loads.values() if math.isnan(n.load) else (loads[n.load],))
        ]
        numbers, sd, *places = np.array(found).reshape(-1, 6).T
        return numbers.astype(np.intp), sd, loads, tuple(place.astype(np.intp) for place in places)

    def discrepancies(self) -> Signal:
        """Standard deviation of the discrepancy of the model along each of its courses, (M, 5, courses), SI units."""
        sd = self.rig.model.discrepancy / math.sqrt(len(COURSES))
        return np.concatenate([log.courses * sd for log in self.logs])

    def predict(self, nu: Signal, effects: Sequence[ActiveEffect], logs: Iterable[int] | None = None) -> Signal:
        """Blocks that the model gives, (M, 5), with zeros of sensors and discrepancy of the model; of some logs where named."""
        return self.predictions([(nu, effects)], logs)[:, :, 0]

    def predictions(self, variants: Sequence[Variant], logs: Iterable[int] | None = None) -> Signal:
        """Blocks that several models give, (M, 5, variants), each as `predict` gives them."""
        which = range(len(self.logs)) if logs is None else sorted(logs)
        models, skews = [self.models(*variant) for variant in variants], [self.skew(nu) for nu, _ in variants]
        zeros, deviations = [self.zeros(nu) for nu, _ in variants], [self.discrepancy(nu) for nu, _ in variants]

        def of_log(k: int) -> Signal:
            log = self.logs[k]
            each = zip(models, skews, zeros, deviations, strict=True)
            several = [log.course.predict(own[k], skew=skew) + zero[k] + off[k] for own, skew, zero, off in each]
            return np.stack(several, axis=2) + log.offset[:, :, None]

        return np.concatenate(all_at_once([partial(of_log, k) for k in which], [self.sizes[k] for k in which]))

    def cells(self) -> Iterator[tuple[int, int, int, NDArray[np.intp]]]:
        """Every channel in every phase of every log: numbers of log, channel and phase, and of the blocks that count there."""
        for log, rows in enumerate(self.rows):
            for k in range(len(CHANNELS)):
                for phase in range(len(PHASES)):
                    here = self.seen[rows, k] & (self.blocks.phase[rows] == phase)
                    yield log, k, phase, rows.start + np.flatnonzero(here)

    def _whitener_of(self, of_blocks: Signal) -> csr_array:
        """Matrix that turns residual blocks in a row into independent numbers of unit variance, (M * 5, M * 5).

        A channel without information in a block gives zeros, and so does a withheld log. Within a phase, a share `RHO` of the
        block before is subtracted.

        Parameters
        ----------
        of_blocks : (M, 5, 5) as `Log` has it
        """
        from scipy.sparse import bsr_array, csr_array, diags_array, eye_array, kron

        taking = np.concatenate([np.full(size, k not in self.withheld) for k, size in enumerate(self.sizes)])
        size, joined = of_blocks.shape[0], self.blocks.joined
        own = bsr_array((of_blocks * taking[:, None, None], np.arange(size), np.arange(size + 1)))
        share = 1.0 / math.sqrt(1.0 - RHO * RHO)
        diagonals = [np.where(joined, share, 1.0).tolist(), np.where(joined[1:], -RHO * share, 0.0).tolist()]
        before = diags_array(diagonals, offsets=[0, -1])
        return csr_array(kron(before, eye_array(len(CHANNELS)), format="csr") @ own.tocsr())

    def whiten(self, residual: Signal) -> Signal:
        """Residual blocks as independent numbers of unit variance, (M * 5, ...) from (M, 5, ...)."""
        rows = residual.shape[0] * len(CHANNELS)
        return np.asarray(self.whitener @ residual.reshape(rows, *residual.shape[2:]))

    def residual(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Signal:
        """Measured minus predicted blocks, whitened, (M * 5,)."""
        return self.whiten(self.measured - self.predict(nu, effects))

    def columns(self, nu: Signal, effects: Sequence[ActiveEffect], used: Signal | None = None) -> Columns:
        """Whitened derivative of the prediction over the nuisances.

        Parameters
        ----------
        used : (5,) weights of the channels in what is simulated, all 1 by default
        """
        moved = self.tolerances(nu, effects, self.predict(nu, effects))
        return Columns(self.whiten(moved if used is None else moved * used[:, None]), self.local)

    def tolerances(self, nu: Signal, effects: Sequence[ActiveEffect], at: Signal) -> Signal:
        """What one tolerance of each nuisance that is simulated moves, (M, 5, `simulated`), SI units.

        Parameters
        ----------
        at : (M, 5) the prediction there
        """
        columns, one = np.zeros((*at.shape, self.simulated)), np.eye(nu.size)
        moved = [j for j, n in enumerate(self.nuisances[: self.simulated]) if n.kind != "gain"]
        there = self.predictions([(nu + PART * one[j], effects) for j in moved])
        columns[:, :, moved] = (there - at[:, :, None]) / PART
        for j, n in self._of_kind.get("gain", ()):
            columns[:, CHANNELS.index(n.name), j] = at[:, CHANNELS.index(n.name)] * n.sd
        return columns

    def _local_columns(self) -> csr_array:
        """What one tolerance of each nuisance that is not simulated moves, (M * 5, q), SI units."""
        from scipy.sparse import csr_array, hstack

        columns = [csr_array((n.sd * self._moved_by(n)).reshape(-1, 1)) for n in self.nuisances[self.simulated :]]
        return csr_array(hstack(columns, format="csr")) if columns else csr_array((self.measured.size, 0))

    def _moved_by(self, n: Nuisance) -> Signal:
        """What a nuisance of 1 that is not simulated moves, (M, 5), SI units."""
        moved, k = np.zeros_like(self.measured), CHANNELS.index(n.name)
        for number, (log, rows) in enumerate(zip(self.logs, self.rows, strict=True)):
            if n.kind == "zero" and number == n.log:
                moved[rows, k] = 1.0
            elif n.kind == "discrepancy" and (log.load == n.load or math.isnan(n.load)):
                here = log.course.blocks.phase == PHASES.index(n.phase)
                moved[rows, k] = log.courses[:, k, COURSES.index(n.course)] * here
        return moved


PART = 0.2
"""Share of a tolerance by which derivatives are taken: wide tolerances are not linear as a whole."""

LOCAL = ("zero", "discrepancy")
"""Kinds of nuisances that are not simulated; they come last."""


class RigProblem(msgspec.Struct, frozen=True):
    """The logs of a rig as a `Problem`: which effects explain what the model of the rig file leaves.

    `rows` (M * 5,) are weights of the residuals, 0 for what takes no part; None for all. `exclusive` are suspects that
    change numbers which the logs know together alone.
    """

    data: Fitted
    suspects: Suspects
    rows: Signal | None = None
    exclusive: tuple[Together, ...] = ()

    @property
    def groups(self) -> NDArray[np.intp]:
        """Number of the stretch of one phase of a cycle that each residual belongs to, (M * 5,)."""
        return np.repeat(np.cumsum(~self.data.blocks.joined) - 1, len(CHANNELS))

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        """Usual multiples of wrong entries, and simplifications as a whole."""
        usual = {name: effect.fields[0].usual for name, effect in self.suspects.items()}
        return usual | {name: (1.0,) for name in self.suspects if name in SIMPLIFICATIONS}

    def price(self, name: str) -> float:
        """Logarithm of the prior odds against a suspect [1]."""
        return price_of(name)

    @property
    def nuisances(self) -> int:
        """Number of the nuisances."""
        return len(self.data.nuisances)

    def residuals(self, several: Sequence[Sequence[ActiveEffect]], nu: Signal) -> Signal:
        """Measured minus predicted blocks with each of several lists of effects, whitened, (M * 5, k)."""
        data = self.data
        z = data.whiten(data.measured[:, :, None] - data.predictions([(nu, effects) for effects in several]))
        z = np.clip(np.nan_to_num(z, nan=WILD), -WILD, WILD)
        return z if self.rows is None else z * self.rows[:, None]

    def nuisance_columns(self, effects: Sequence[ActiveEffect], nu: Signal) -> Columns:
        """Whitened derivative of the prediction over the nuisances."""
        columns = self.data.columns(nu, effects)
        return columns if self.rows is None else columns.masked(self.rows)


def _levels(blocks: Blocks, predicted: Signal) -> Signal:
    """Level of each channel in each phase, (3, 5): 0 in phases that a log lacks.

    In hold the generator runs down within a few blocks: the level of its voltage and current is that of the whole log.

    Parameters
    ----------
    predicted : (m, 5) blocks of the model of the rig file; the level of the pressure is its swing over the log
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
"""Share of its largest value in the log below which a signal is none in a phase: a capacitor decays to any value. [1]"""


def _courses(course: Course, predicted: Signal, level: Signal) -> Signal:
    """What a discrepancy of the model of 1 moves, (m, 5, 3): the plateau of each channel in the log, along `COURSES`.

    The plateau is the largest level of a phase: sensors and models deviate by a share of what a run reaches, also in haul-in.

    Parameters
    ----------
    predicted : (m, 5) blocks of the rig as given
    level : (3, 5) as `_levels` gives it
    """
    blocks, plateau = course.blocks, np.max(level, axis=0)
    speed = np.abs(blocks.mean(course.run.channels["velocity"]))
    signals = np.column_stack([np.ones(blocks.size), speed, np.abs(predicted[:, CHANNELS.index("idc")])])
    vanishing = np.maximum(VANISHING * np.max(signals, axis=0, initial=0.0), np.finfo(np.float64).tiny)
    found = np.zeros((blocks.size, len(CHANNELS), len(COURSES)))
    for phase in range(len(PHASES)):
        here = np.flatnonzero(blocks.phase == phase)
        if here.size:
            shape = signals[here] / np.maximum(np.quantile(signals[here], TOP, axis=0), vanishing)
            found[here] = plateau[:, None] * np.minimum(shape, 1.0)[:, None, :]
    # the clutch is open while the line is hauled in: a torque of zero is no share of a plateau
    found[blocks.phase == HAUL_IN, CHANNELS.index("torque")] = 0.0
    return found


def log_of(effect: ActiveEffect) -> int:
    """Number of the only log that an effect concerns, -1 for all."""
    entry = effect.effect.entry
    return -1 if entry is None else entry.log


def differs_by_run(effect: ActiveEffect) -> bool:
    """Whether an effect acts in one log alone, or differently in each."""
    return log_of(effect) >= 0 or effect.effect.over_runs is not None


def _without_changes_by_run(rig: Rig) -> tuple[Rig, list[ActiveEffect]]:
    """A rig without the effects it states that change from run to run, and these."""
    by_run = [effect for effect in stated_effects(rig) if effect.effect.over_runs is not None]
    kept = {name: stated for name, stated in rig.effects.items() if name not in {one.effect.name for one in by_run}}
    return msgspec.structs.replace(rig, effects=kept), by_run


def _order(runs: Sequence[Run]) -> RunOrder:
    """When the runs were made, the heat of their currents and their temperatures."""
    squares = tuple(float(np.mean(run.channels["idc"] ** 2)) if "idc" in run.channels else 0.0 for run in runs)
    return order_of(tuple(run.started for run in runs), squares, tuple(run.temperature for run in runs))


def with_channels_of(model: Model, run: Run) -> Run:
    """A log without the channels of the fit that the rig does not have, such as the pressure without gas."""
    foreign = set(CHANNELS) - set(read_by(model))
    kept = {name: x for name, x in run.channels.items() if name not in foreign}
    return msgspec.structs.replace(run, channels=kept) if len(kept) < len(run.channels) else run


USUAL = 3.0
"""Number of payouts at a load for which the discrepancy of a single block is stated; more of them are repeats."""


def _repeats(runs: Sequence[Run], blocks: Sequence[Blocks], withheld: Collection[int]) -> list[float]:
    """How often each log is repeated: payouts at its load over all logs that take part, over the usual number, at least 1."""
    payouts: dict[float | None, int] = {}
    for k, (run, own) in enumerate(zip(runs, blocks, strict=True)):
        if k not in withheld:
            payouts[run.load] = payouts.get(run.load, 0) + np.unique(own.cycle[own.phase == 0]).size
    return [max(payouts.get(run.load, 0) / USUAL, 1.0) for run in runs]


def means_over(blocks: Blocks, run: Run) -> Signal:
    """Means of the channels of a run over blocks, (m, 5), SI units, columns of `predict.CHANNELS`; 0 for one that it lacks."""
    nothing = np.zeros(run.t.size)
    return np.column_stack([blocks.mean(run.channels.get(name, nothing)) for name in CHANNELS])


def _log(rig: Rig, nominal: Model, scale: MotionScale, run: Run, blocks: Blocks, repeats: float) -> Log:
    """Prepare a log.

    Parameters
    ----------
    scale : scales of the motion of the campaign
    repeats : how often it is repeated; the discrepancy of a block is the same in repeats, so that all of them together must
        tell no more of the model than one
    """
    course, finely = (Course(run, blocks, resolving(nominal, scale, share), scale) for share in (COARSE, STEP))
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


def _whitener(noise: Noise) -> Signal:
    """Inverse Cholesky factor of each block's covariance: own variances and the velocity's, which all channels share."""
    own = np.where(noise.seen, noise.own_total, 1.0)
    drive = np.where(noise.seen, noise.drive, 0.0)
    covariance = drive[:, :, None] * drive[:, None, :]
    k = np.arange(len(CHANNELS))
    covariance[:, k, k] += own**2
    inverse: Signal = np.linalg.inv(np.linalg.cholesky(covariance))
    inverse[~noise.seen] = 0.0
    return inverse * noise.seen[:, None, :]
