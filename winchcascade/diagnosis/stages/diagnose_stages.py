"""Diagnose stages without a model: where their gap lies, which losses, stores and sensors explain
it, and what remains.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import rms
from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.diagnosis.campaign_entries import Entries
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    DiagnosisResult,
    GapClosure,
    NamedCause,
    Place,
    Remainder,
    Shrunk,
    Spot,
    StageEnergy,
    Verdict,
    Where,
)
from winchcascade.diagnosis.explain.gap_map import weigh
from winchcascade.diagnosis.fit.block_means import HOLD, scatter_about_course
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.judge.closure import DRAWS
from winchcascade.diagnosis.judge.verdict import doubted
from winchcascade.diagnosis.stages.stage_causes import (
    MATERIAL,
    is_material,
    is_steady,
    plan,
    stage_causes,
)
from winchcascade.diagnosis.stages.stage_fit import StageFit, fit_of, folds_of
from winchcascade.diagnosis.stages.stage_rows import PARTS_OF_RUN, StageData, StageRows
from winchcascade.diagnosis.stages.stage_samples import stage_data
from winchcascade.diagnosis.verdict_limits import CHANCE, HALF, MOSTLY, ROUGH

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.fit.suspects import Suspects

PART_OF_GAP = 0.01
"""A structure with less than this share of the squared gap has no effect on the verdict."""

TRIPLES_MIN = 12
"""Minimum number of triples of neighbouring blocks for an estimate of their noise."""

SMALL_ENERGY = 0.03
"""Share of the measured energy of a phase below which a difference has no effect on the verdict:
force cells and powers of field winches are accurate to 1 to 3 % of the reading."""


class StageClosure(GapClosure, frozen=True):
    """Share of the squared gap that the causes close on the rows that they are tested on: 1 -
    sum(after^2) / sum(gap^2).

    `after` is measured minus predicted at these rows, (m,) [W], by a fit without them.
    """

    rows: StageRows
    after: Signal

    @property
    def beyond_noise(self) -> float:
        """Share that is closed of what exceeds the noise of the powers. [1]"""
        powers = self.channels.values()
        before, after, noise = (
            sum(getattr(one, of) ** 2 for one in powers) for of in ("before", "after", "noise")
        )
        return 1.0 - max(after - noise, 0.0) / (before - noise) if before > noise else 0.0


class StageAgreement(msgspec.Struct, frozen=True):
    """Mean power that a stage gives beyond its model while the line pays out, by its laws and by
    the causes of the model, with standard uncertainties, and the power that `flows` [W].
    """

    stage: str
    flows: float
    by_laws: float
    u_laws: float
    by_causes: float
    u_causes: float

    @property
    def agrees(self) -> bool:
        """Whether the difference is within its 95 % interval, or too small to matter.

        >>> StageAgreement("generator", 900.0, -40.0, 3.0, -44.0, 2.0).agrees
        True
        """
        allowed = COVERED * math.hypot(self.u_laws, self.u_causes)
        return abs(self.by_laws - self.by_causes) <= max(allowed, MATERIAL * self.flows)


class StageDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis of stages without a model, or beside one.

    `places` map the gap path by path and phase by phase, `energies` are those of the judged cycles.
    Beside a model, `agreement` compares each stage with its causes.
    """

    data: StageData
    fit: StageFit
    closure: StageClosure | None = None
    energies: tuple[StageEnergy, ...] = ()
    agreement: tuple[StageAgreement, ...] = ()


@linear_algebra_on_one_thread()
def diagnose_stages(
    entries: Entries,
    rig: Rig,
    suspects: Suspects,
    *,
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> StageDiagnosis:
    """Diagnose the losses between the stages of a cascade, of which two powers at least are logged.

    Parameters
    ----------
    entries : runs; if none is withheld, causes are chosen on all cycles and each is held out of the
        fit once
    suspects : effects by name that may be named; those that are laws of the stages count
    seed : of the resampling of cycles
    on_progress : called with a sentence on each step

    Raises
    ------
    CampaignError, LogError, OptionError : something cannot be used; the message names it
    """
    rig = with_thresholds(rig, entries.runs)
    entries.check_withheld()
    on_progress("taking the samples that count")
    data = stage_data(entries, rig, suspects)
    return diagnosed(data, entries.title, rig, seed, on_progress)


def diagnosed(
    data: StageData, title: str, rig: Rig, seed: int, on_progress: Callable[[str], None]
) -> StageDiagnosis:
    """Find the laws that explain some rows, and judge them."""
    on_progress("holding each cycle out in turn")
    fit = fit_of(data)
    closure = _closure(fit, seed)
    on_progress("looking for alternative explanations")
    fitted, chosen = stage_causes(fit), fit.found.best.names
    material = [cause for cause in fitted if is_material(fit, cause.effect)]
    causes = tuple(cause for cause in material if is_steady(cause))
    candidates = tuple(cause for cause in material if cause not in causes)
    energies, alarms = _energies(fit, closure.after)
    remainder = _remainder(fit, closure, alarms)
    verdict = _verdict(closure, remainder, causes, candidates)
    places, experiment = _places(data), plan(fit, causes)
    no_gap = verdict == "no_gap"
    if verdict == "partly_explained":  # what else acts, a cause may imitate
        causes, candidates, fitted = map(doubted, (causes, candidates, fitted))
    causes, candidates = ((), ()) if verdict == "unexplained" else (causes, candidates)
    largest = max(places, key=lambda place: place.share)
    return StageDiagnosis(
        title=title,
        rig=rig,
        seed=seed,
        runs=tuple(part.run for part in data.parts),
        suspects=data.suspects,
        verdict=verdict,
        where=None if no_gap else Where(causes[0].stage if causes else largest.stage, largest),
        chosen=chosen,
        causes=causes,
        candidates=candidates,
        fitted=fitted,
        closure=closure if chosen and not no_gap else None,
        remainder=None if no_gap else remainder,
        experiment=experiment,
        sets=fit.probability,
        data=data,
        fit=fit,
        places=places,
        energies=energies,
    )


def _verdict(
    closure: StageClosure,
    remainder: Remainder,
    causes: Sequence[NamedCause],
    candidates: Sequence[NamedCause],
) -> Verdict:
    """Explained when no alarm and no candidate remains and at least `MOSTLY` of what exceeds noise
    is closed.

    A number that changes little from cycle to cycle does not forbid it by itself: what it does to
    the energies of held-out cycles does.
    """
    if not causes and not candidates:
        return "unexplained" if remainder.alarms else "no_gap"
    if not remainder.alarms and not candidates and closure.beyond_noise >= MOSTLY:
        return "explained"
    return "partly_explained" if closure.share >= HALF or not remainder.alarms else "unexplained"


# ------------------------------------------------------------------- where, and how far it closes
def _kinds(rows: StageRows) -> Iterator[tuple[int, Index]]:
    """Numbers of path and phase of which there are rows, and these rows."""
    for kind in np.unique(rows.kind).tolist():
        yield kind, np.flatnonzero(rows.kind == kind)


def _places(data: StageData) -> tuple[Place, ...]:
    """Map the gap: one row for each path and phase of which there are rows."""
    found, squares = [], max(float(np.sum(data.rows.gap**2)), 1e-300)
    for kind, here in _kinds(data.rows):
        rows = data.rows.some(here)
        if rows.t.size < 2:
            continue
        noise = _noise(rows, rows.gap)
        noise = noise if math.isfinite(noise) else float(np.std(rows.gap))
        by = weigh(
            rows.gap,
            rows.blocks.cycle,
            np.full(rows.t.size, noise),
            0.0,
            np.zeros((rows.t.size, 1)),
        )
        path, phase = data.named(kind)
        share = float(np.sum(rows.gap**2)) / squares
        found.append(
            msgspec.structs.replace(
                by, channel=path.channel, phase=phase, stage=path.place, share=share
            )
        )
    return tuple(found)


def _noise(rows: StageRows, x: Signal) -> float:
    """Noise of the rows of one path and phase, about their smooth course; NaN where there are too
    few blocks. [W]
    """
    return scatter_about_course(rows.blocks, x, np.ones(x.size, dtype=bool), TRIPLES_MIN)


def _closure(fit: StageFit, seed: int) -> StageClosure:
    """Predict every judged row from a fit without it, and resample the cycles for the interval of
    the share.

    Beside a model, whose stages each have a gap of their own size, the stages count on which the
    laws act.
    """
    data, rows, after = fit.data, fit.data.judged, fit.residual(fit.found.best)
    acted = {k for name in fit.found.best.names for k in data.laws[name].paths}
    counted = [k for k in range(len(data.paths)) if not (data.beside_model and acted) or k in acted]
    fold, counts = folds_of(rows.blocks.cycle), np.isin(rows.path, counted)
    old, new = (np.bincount(fold, counts * x**2) for x in (rows.gap, after))
    draws = np.random.default_rng(seed).integers(old.size, size=(DRAWS, old.size))
    shares = 1.0 - new[draws].sum(axis=1) / np.maximum(old[draws].sum(axis=1), 1e-300)
    share = float(1.0 - new.sum() / max(old.sum(), 1e-300))
    low, high = np.quantile(shares, (0.025, 0.975)).tolist()
    channels = {}
    for number in counted:
        here = rows.path == number
        noise = [
            _noise(rows.some(blocks), after[blocks]) ** 2
            * blocks.size
            / max(int(np.count_nonzero(here)), 1)
            for kind, blocks in _kinds(rows)
            if kind // len(PARTS_OF_RUN) == number
        ]
        before, left = (rms(x[here]) if here.any() else 0.0 for x in (rows.gap, after))
        squares = float(np.nansum(noise))
        channels[data.paths[number].channel] = Shrunk(before, left, math.sqrt(squares))
    return StageClosure(channels, share, min(low, share), max(high, share), rows=rows, after=after)


def _remainder(fit: StageFit, closure: StageClosure, energies: tuple[Alarm, ...]) -> Remainder:
    """Distinguish the residual from noise: energies that are not explained, and phases in which it
    has a smooth course.
    """
    data, rows, after, alarms = fit.data, closure.rows, closure.after, list(energies)
    noisiest: dict[float, Spot] = {}
    for kind, here in _kinds(rows):
        path, phase = data.named(kind)
        spot, squares = Spot(path.channel, phase), float(np.sum(after[here] ** 2))
        noisiest[squares] = spot
        noise = _noise(rows.some(here), after[here])
        ratio = math.sqrt(squares / here.size) / noise if noise > 0.0 else 0.0
        if ratio > ROUGH and squares - here.size * noise**2 > PART_OF_GAP * float(
            np.sum(rows.gap**2)
        ):
            alarms.append(Alarm("structure", spot, ratio, ROUGH))
    return Remainder(
        share=max(1.0 - closure.share, 0.0),
        alarms=tuple(sorted(alarms, key=lambda alarm: -alarm.size / alarm.limit)),
        worst=energies[0].about if energies else noisiest[max(noisiest)],
    )


# --------------------------------------------------------------------------------------- energies
def _energies(fit: StageFit, after: Signal) -> tuple[tuple[StageEnergy, ...], tuple[Alarm, ...]]:
    """Energies of the judged cycles by path and phase, and an alarm for each whose energies the
    causes do not explain.

    The uncertainty that is reported contains the scatter of cycles, too.
    """
    data, rows, kinds = fit.data, fit.data.judged, len(fit.data.paths) * len(PARTS_OF_RUN)
    code, row, place = np.unique(
        rows.blocks.cycle * kinds + rows.kind, return_index=True, return_inverse=True
    )
    kind = code % kinds

    def energy(power: Signal) -> Signal:
        return np.bincount(place, power * rows.width).astype(np.float64)

    measured, before, residual = map(energy, (rows.gap + rows.given, rows.given, after))
    slopes = np.hstack([rows.columns[:, fit.columns_of(fit.found.best)], rows.known])
    columns = np.array([energy(column) for column in slopes.T]).reshape(-1, code.size).T
    size = len(fit.found.best.names)
    spread = np.eye(columns.shape[1])
    spread[:size, :size] = fit.covariance(fit.found.best)
    if columns.shape[1] > size:
        spread[size:, size:] = fit.found.marginal.spread
    of_numbers = columns @ spread @ columns.T
    # a sum of n rows has n times the variance of a mean
    scale = float(np.median(rows.width)) * energy(np.ones(rows.t.size))
    within, between = (
        np.diag(scale * variance[kind, -1]) for variance in (fit.noise.within, fit.noise.variance)
    )
    u = np.sqrt(np.diag(between + of_numbers))
    numbers = np.array([measured, before, measured - residual, u]).T.tolist()
    energies = [
        StageEnergy(
            int(rows.part[k]),
            phase,
            path.out.name,
            was,
            given,
            fitted,
            sd,
            cycle=int(rows.own_cycle[k]),
        )
        for k, (path, phase), (was, given, fitted, sd) in zip(
            row, map(data.named, kind.tolist()), numbers, strict=True
        )
    ]
    allowed = within + of_numbers, between + of_numbers
    return tuple(energies), _energy_alarms(data, kind, measured, residual, allowed)


def _energy_alarms(
    data: StageData, kind: Index, measured: Signal, residual: Signal, allowed: tuple[Signal, Signal]
) -> tuple[Alarm, ...]:
    """Energies that are not explained, the largest of a path and phase.

    The residuals of a phase are an alarm where their root mean square, or their sum, is more than a
    small share of the energy, and more than the noise within the phases and the uncertainty of the
    coefficients allow. Beside a model it is a share of the energy of the phase that has most, as of
    the torque of an open clutch no share matters.

    Parameters
    ----------
    measured, residual : energies by cycle, path and phase, (n,) [J]
    allowed : covariances of the residuals, (n, n), of single cycles and of the sum of all [J2]
    """
    from scipy.special import chdtrc

    path_of, phase_of = np.divmod(kind, len(PARTS_OF_RUN))
    found: dict[Spot, Alarm] = {}
    for one in np.unique(kind[phase_of != HOLD]).tolist():
        path, phase = data.named(one)
        here, spot = np.flatnonzero(kind == one), Spot(path.channel, phase)
        same = np.unique(kind[path_of == one // len(PARTS_OF_RUN)]) if data.beside_model else (one,)
        each = np.eye(here.size), np.ones((1, here.size))
        for sums, covariance in zip(each, allowed, strict=True):
            left = sums @ residual[here]
            of_phases = [measured[kind == other] for other in same]
            rulers = [float(np.linalg.norm(x if len(sums) > 1 else x.sum())) for x in of_phases]
            size = float(np.linalg.norm(left)) / max(*rulers, 1e-300)
            inverse = np.linalg.pinv(sums @ covariance[np.ix_(here, here)] @ sums.T, hermitian=True)
            chance = float(chdtrc(left.size, max(float(left @ inverse @ left), 0.0)))
            least = found[spot].size if spot in found else SMALL_ENERGY
            if size > least and chance < CHANCE:
                found[spot] = Alarm("energy", spot, size, SMALL_ENERGY)
    return tuple(sorted(found.values(), key=lambda alarm: -alarm.size))
