"""Some logs on one rig as one fit: their blocks, the prediction of the model, and whitened
residuals.
"""

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
from winchcascade.diagnosis.fit.block_means import (
    PHASES,
    blocks_of,
    in_a_row,
)
from winchcascade.diagnosis.fit.block_noise import with_ramps
from winchcascade.diagnosis.fit.fitted_log import (
    log_for_fit,
    repeats_of,
    whitener_of,
    with_channels_of,
)
from winchcascade.diagnosis.fit.marginal import Columns
from winchcascade.diagnosis.fit.nearby import SERVES, Nearby, Places
from winchcascade.diagnosis.fit.nuisances import COURSES, LOAD, Nuisance, nuisances
from winchcascade.diagnosis.fit.predict import ALL_KEPT, CHANNELS, MAX_KEPT
from winchcascade.rig.baseline import baseline, stated_effects
from winchcascade.rig.effects.run_order import RunOrder, RunPlace, order_of
from winchcascade.rig.parts import Model, changed, possible

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Sequence

    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.core.scales import Scales
    from winchcascade.rig.effects.effect import ActiveEffect


Variant = tuple["Signal", "Sequence[ActiveEffect]"]
"""Nuisances in units of their tolerance, and the effects that act."""


ZERO_REACH = 3.0
"""Bound of a zero, in its standard uncertainties; more is a gap. [1]"""


class Fitted:
    """Logs of one rig, ready to be compared with a model again and again.

    Parameters
    ----------
    runs : logs with their loads
    rig : with the numbers of its file, none calibrated first
    cycles : of each log, the first and last that count, None for all
    withheld : numbers of the logs that are predicted but take part in no fit
    scales : by which they are cut into blocks, those of their own motion by default
    places : of each log among all runs of its campaign, by default these logs alone
    """

    def __init__(
        self,
        runs: Sequence[Run],
        rig: Rig,
        cycles: Sequence[tuple[int, int] | None] | None = None,
        withheld: Collection[int] = (),
        scales: Scales | None = None,
        places: Sequence[RunPlace] | None = None,
    ) -> None:
        rig = with_thresholds(rig, runs)
        self._same, self.stated_by_run = _without_changes_by_run(rig)
        self.rig, self.nominal, self.withheld = rig, baseline(self._same), frozenset(withheld)
        runs = [with_channels_of(self.nominal, run) for run in runs]
        self.order = _order(runs)
        self.places = places or [RunPlace(self.order, k) for k in range(len(runs))]
        self.scales = scales or scales_of(rig, motion_of_runs(runs))
        self.nuisances: tuple[Nuisance, ...] = nuisances(rig, runs, self.scales)
        self.cycles = cycles or [None] * len(runs)
        ramp, logs = self.scales.ramp, zip(runs, self.cycles, strict=True)
        blocks = [blocks_of(run, rig, ramp, span) for run, span in logs]
        repeats = repeats_of(runs, blocks, self.withheld)
        each = zip(runs, blocks, repeats, strict=True)
        jobs = [partial(log_for_fit, rig, self.nominal, self.scales.motion, *one) for one in each]
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
        self._places = Places()
        self.moved_locally = self._local_columns()
        self._take_noise()

    def _take_noise(self) -> None:
        """Take the noise of the logs."""
        self.seen = np.concatenate([log.noise.seen for log in self.logs])
        self.noise = np.concatenate([log.noise.total for log in self.logs])
        self.logged_noise = np.concatenate([log.noise.logged for log in self.logs])
        taking = [k not in self.withheld for k in range(len(self.logs))]
        noises = [log.noise for log in self.logs]
        self.whitener = whitener_of(noises, taking, self.blocks.joined)
        self.local = self.whitener @ self.moved_locally

    @property
    def taking(self) -> list[int]:
        """Numbers of the logs that take part in a fit."""
        return [k for k in range(len(self.logs)) if k not in self.withheld]

    @property
    def extreme_loads(self) -> list[int]:
        """Numbers of a log of the smallest and one of the largest resistance, of those that take
        part in a fit; what neither of them shows, none between them does.
        """
        by_load = sorted(self.taking, key=lambda k: self.logs[k].load)
        return sorted({by_load[0], by_load[-1]})

    def with_ramps(self, residual: Signal) -> Fitted | None:
        """The logs with the scatter of a residual within slow ramps, (M, 5), as noise; None
        where it is no more than noise.
        """
        logs = []
        for log, rows in zip(self.logs, self.rows, strict=True):
            blocks = log.course.blocks
            speed = blocks.mean(log.run.channels["velocity"])
            logs.append(
                msgspec.structs.replace(
                    log, noise=with_ramps(log.noise, blocks, residual[rows], speed)
                )
            )
        if all(
            np.array_equal(new.noise.own, old.noise.own)
            for new, old in zip(logs, self.logs, strict=True)
        ):
            return None
        found = copy(self)
        found.logs = logs
        found._take_noise()
        return found

    def moves(self, nu: Signal, *kinds: str) -> list[tuple[Nuisance, float]]:
        """Nuisances of some kinds that move, and by how much, in their own unit."""
        return [
            (n, float(nu[j]) * n.sd)
            for kind in kinds
            for j, n in self._of_kind.get(kind, ())
            if nu[j]
        ]

    def model(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Model:
        """The model of the rig: its numbers and laws moved by nuisances in units of their
        tolerance, then changed by effects.

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
                each = zip(found, self.places, strict=True)
                found = [effect.in_run(place).apply(one) for one, place in each]
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
        """What the discrepancy of the model adds to the blocks of each log, (m, 5) each, SI
        units.
        """
        numbers, sd, loads, places = self._deviations
        if not nu[numbers].any():
            return [np.zeros_like(log.measured) for log in self.logs]
        share = np.zeros((len(loads), len(PHASES), len(CHANNELS), len(COURSES)))
        np.add.at(share, places, nu[numbers] * sd)
        return [
            np.sum(log.courses * share[loads[log.load]][log.course.blocks.phase], axis=2)
            for log in self.logs
        ]

    def _places_of_deviations(
        self,
    ) -> tuple[NDArray[np.intp], Signal, dict[float, int], tuple[NDArray[np.intp], ...]]:
        """Numbers of the nuisances of the discrepancy, one row for each load that they concern,
        with standard deviations.

        Also the row of each load, and where a nuisance stands among loads, phases, channels and
        courses.
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
        """Standard deviation of the discrepancy of the model along each of its courses, (M, 5,
        courses), SI units.
        """
        sd = self.rig.model.discrepancy / math.sqrt(len(COURSES))
        return np.concatenate([log.courses * sd for log in self.logs])

    def predict(
        self, nu: Signal, effects: Sequence[ActiveEffect], logs: Iterable[int] | None = None
    ) -> Signal:
        """Blocks that the model gives, (M, 5), with zeros of sensors and discrepancy of the
        model; of some logs where named.
        """
        return self.predictions([(nu, effects)], logs)[:, :, 0]

    def predictions(self, variants: Sequence[Variant], logs: Iterable[int] | None = None) -> Signal:
        """Blocks that several models give, (M, 5, variants), each as `predict` gives them."""
        which = range(len(self.logs)) if logs is None else sorted(logs)
        models, skews = (
            [self.models(*variant) for variant in variants],
            [self.skew(nu) for nu, _ in variants],
        )
        zeros, deviations = (
            [self.zeros(nu) for nu, _ in variants],
            [self.discrepancy(nu) for nu, _ in variants],
        )

        def of_log(k: int) -> Signal:
            log = self.logs[k]
            each = zip(models, skews, zeros, deviations, strict=True)
            several = [
                log.course.predict(own[k], skew=skew) + zero[k] + off[k]
                for own, skew, zero, off in each
            ]
            return np.stack(several, axis=2) + log.offset[:, :, None]

        return np.concatenate(
            all_at_once([partial(of_log, k) for k in which], [self.sizes[k] for k in which])
        )

    def nearby(self, place: Variant) -> Nearby:
        """A place of a fit with the derivatives that are known there."""
        nu, effects = place

        def made() -> Nearby:
            courses = [log.course for log in self.logs]
            at = self.predict(nu, effects)
            return Nearby(courses, self.models(nu, effects), self.skew(nu), at)

        return self._places.of(nu, effects, made, self.whiten)

    def predictions_near(
        self, place: Variant, variants: Sequence[Variant], serves: float = SERVES
    ) -> Signal:
        """Blocks that several models near to a place give, (M, 5, variants): the change of a single
        number by its derivative.

        Zeros of sensors and discrepancy of the model are those of the place.

        Parameters
        ----------
        serves : share of the way from another place that its derivatives may miss [1]
        """
        models, skews = (
            [self.models(*variant) for variant in variants],
            [self.skew(nu) for nu, _ in variants],
        )
        return self.nearby(place).predictions(models, skews, serves)

    def cells(self) -> Iterator[tuple[int, int, int, NDArray[np.intp]]]:
        """Every channel in every phase of every log: numbers of log, channel and phase, and of
        the blocks that count there.
        """
        for log, rows in enumerate(self.rows):
            for k in range(len(CHANNELS)):
                for phase in range(len(PHASES)):
                    here = self.seen[rows, k] & (self.blocks.phase[rows] == phase)
                    yield log, k, phase, rows.start + np.flatnonzero(here)

    @property
    def stated(self) -> Signal:
        """Blocks that the model of the rig file gives, (M, 5), without errors of sensors."""
        return self.predict(np.zeros(len(self.nuisances)), [])

    def gap(self, predicted: Signal) -> Signal:
        """Measured minus predicted blocks, (M, 5), without the zeros of each log."""
        return self.without_zeros(self.measured - predicted)

    def without_zeros(self, residual: Signal) -> Signal:
        """Residual blocks of every log, (M, 5), without the zeros of each log: weighted means, at
        most `ZERO_REACH` tolerances.

        Parameters
        ----------
        residual : (M, 5) measured minus predicted blocks, no zero taken off
        """
        left = residual.copy()
        for rows, log, u_zero in zip(
            self.rows, self.logs, self.zeros(np.ones(len(self.nuisances))), strict=True
        ):
            with np.errstate(divide="ignore", invalid="ignore"):
                weight = np.where(log.noise.seen, 1.0 / log.noise.total**2, 0.0)
                prior = np.where(u_zero > 0.0, 1.0 / u_zero**2, np.inf)
                mean = np.sum(weight * residual[rows], axis=0) / (np.sum(weight, axis=0) + prior)
            left[rows] -= np.nan_to_num(mean).clip(-ZERO_REACH * u_zero, ZERO_REACH * u_zero)
        return left

    def whiten(self, residual: Signal) -> Signal:
        """Residual blocks as independent numbers of unit variance, (M * 5, ...) from (M, 5,
        ...).
        """
        rows = residual.shape[0] * len(CHANNELS)
        return np.asarray(self.whitener @ residual.reshape(rows, *residual.shape[2:]))

    def residual(self, nu: Signal, effects: Sequence[ActiveEffect]) -> Signal:
        """Measured minus predicted blocks, whitened, (M * 5,)."""
        return self.whiten(self.measured - self.predict(nu, effects))

    def columns(
        self,
        nu: Signal,
        effects: Sequence[ActiveEffect],
        used: Signal | None = None,
        serves: float = SERVES,
    ) -> Columns:
        """Whitened derivative of the prediction over the nuisances.

        Parameters
        ----------
        used : (5,) weights of the channels in what is simulated, all 1 by default
        serves : as for `predictions_near`
        """
        moved = self.tolerances(nu, effects, serves)
        return Columns(self.whiten(moved if used is None else moved * used[:, None]), self.local)

    def tolerances(
        self, nu: Signal, effects: Sequence[ActiveEffect], serves: float = SERVES
    ) -> Signal:
        """What one tolerance of each nuisance that is simulated moves, (M, 5, `simulated`), SI
        units.
        """
        at = self.nearby((nu, effects)).at
        columns, one = np.zeros((*at.shape, self.simulated)), np.eye(nu.size)
        moved = [j for j, n in enumerate(self.nuisances[: self.simulated]) if n.kind != "gain"]
        variants = [(nu + PART * one[j], effects) for j in moved]
        there = self.predictions_near((nu, effects), variants, serves)
        columns[:, :, moved] = (there - at[:, :, None]) / PART
        for j, n in self._of_kind.get("gain", ()):
            columns[:, CHANNELS.index(n.name), j] = at[:, CHANNELS.index(n.name)] * n.sd
        return columns

    def _local_columns(self) -> csr_array:
        """What one tolerance of each nuisance that is not simulated moves, (M * 5, q), SI units."""
        from scipy.sparse import csr_array

        local = self.nuisances[self.simulated :]
        shape = self.measured.size, len(local)
        places, columns, values = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)], [np.zeros(0)]
        for j, n in enumerate(local):
            everywhere = enumerate(self.logs)
            of_load = [k for k, log in everywhere if math.isnan(n.load) or log.load == n.load]
            for number in [n.log] if n.kind == "zero" else of_load:
                blocks, moved = self._moved_by(n, number)
                cells = (self.rows[number].start + blocks) * len(CHANNELS)
                places.append(cells + CHANNELS.index(n.name))
                columns.append(np.full(blocks.size, j))
                values.append(n.sd * moved)
        where = np.concatenate(places), np.concatenate(columns)
        return csr_array((np.concatenate(values), where), shape=shape)

    def _moved_by(self, n: Nuisance, number: int) -> tuple[NDArray[np.intp], Signal]:
        """Blocks of a log that a nuisance of 1 that is not simulated moves, and by how much, SI
        units.
        """
        log = self.logs[number]
        phase = log.course.blocks.phase
        if n.kind == "zero":
            return np.arange(phase.size), np.ones(phase.size)
        here = np.flatnonzero(phase == PHASES.index(n.phase))
        return here, log.courses[here, CHANNELS.index(n.name), COURSES.index(n.course)]


PART = 0.2
"""Share of a tolerance by which derivatives are taken: wide tolerances are not linear as a
whole.
"""

LOCAL = ("zero", "discrepancy")
"""Kinds of nuisances that are not simulated; they come last."""


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
    kept = {
        name: stated
        for name, stated in rig.effects.items()
        if name not in {one.effect.name for one in by_run}
    }
    return msgspec.structs.replace(rig, effects=kept), by_run


def _order(runs: Sequence[Run]) -> RunOrder:
    """When the runs were made, the heat of their currents and their temperatures."""
    squares = tuple(
        float(np.mean(run.channels["idc"] ** 2)) if "idc" in run.channels else 0.0 for run in runs
    )
    return order_of(
        tuple(run.started for run in runs), squares, tuple(run.temperature for run in runs)
    )
