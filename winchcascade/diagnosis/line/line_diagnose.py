"""Diagnose a winch without a model: where its gap lies, which losses and inertia explain it, and what the residual holds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.core.log_thresholds import with_thresholds
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    DiagnosisResult,
    Entries,
    GapClosure,
    Place,
    Remainder,
    Shrunk,
    Spot,
    StageEnergy,
    Verdict,
    Where,
)
from winchcascade.diagnosis.explain.gap_map import weigh
from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT, PHASES, scatter_about_course
from winchcascade.diagnosis.judge.closure import DRAWS
from winchcascade.diagnosis.line.line_causes import is_material, line_causes, plan
from winchcascade.diagnosis.line.line_data import POWER, LineRows, Lines, lines_of
from winchcascade.diagnosis.line.line_fit import LineFit, fit_of, folds_of
from winchcascade.diagnosis.verdict_limits import CHANCE, HALF, MOSTLY, ROUGH

if TYPE_CHECKING:
    from collections.abc import Callable

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.suspects import Suspects

PART_OF_GAP = 0.01
"""A structure with less than this share of the squared gap has no effect on the verdict."""

FEW = 12
"""Minimum number of triples of neighbouring blocks for an estimate of their noise."""

SMALL_ENERGY = 0.03
"""Share of the measured energy of a phase below which a difference has no effect on the verdict: force cells and powers of
field winches are accurate to 1 to 3 % of the reading."""


class LineClosure(GapClosure, frozen=True):
    """Share of the squared gap that the causes close on the rows that they are tested on: 1 - sum(after^2) / sum(gap^2).

    `after` is measured minus predicted at these rows, (m,) [W], by a fit without them.
    """

    rows: LineRows
    after: Signal

    @property
    def power(self) -> Shrunk:
        """Root mean squares of the power. [W]"""
        return self.channels[POWER]

    @property
    def beyond_noise(self) -> float:
        """Share that is closed of what exceeds the noise of the power. [1]"""
        before, after, noise = (x**2 for x in (self.power.before, self.power.after, self.power.noise))
        return 1.0 - max(after - noise, 0.0) / (before - noise) if before > noise else 0.0


class LineDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis of a winch without a model.

    `places` map the gap phase by phase, `energies` are those of the winch by cycle and phase.
    """

    lines: Lines
    fit: LineFit
    closure: LineClosure | None = None
    energies: tuple[StageEnergy, ...] = ()


@linear_algebra_on_one_thread()
def diagnose_line(
    entries: Entries,
    rig: Rig,
    suspects: Suspects,
    *,
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> LineDiagnosis:
    """Diagnose logs of line tension, speed and mechanical power, of a rig for which no model can be made.

    Parameters
    ----------
    entries : runs; if none is withheld, causes are chosen on all cycles and each is left out of the fit once
    suspects : effects by name that may be named; those that act between line and shaft count
    seed : of the resampling of cycles
    on_progress : called with a sentence on each step

    Raises
    ------
    CampaignError, LogError, OptionError : something cannot be used; the message names it
    """
    rig = with_thresholds(rig, entries.runs)
    entries.check_withheld()
    on_progress("taking the samples that count")
    lines = lines_of(entries, rig, suspects)
    on_progress("leaving each cycle out in turn")
    fit = fit_of(lines)
    closure = _closure(fit, seed)
    on_progress("looking for alternative explanations")
    fitted, chosen = line_causes(fit), fit.found.best.names
    causes = tuple(cause for cause in fitted if is_material(fit, cause.effect))
    energies, alarms = _energies(fit, closure.after)
    remainder = _remainder(closure, alarms)
    verdict = _verdict(closure, remainder, named=bool(causes))
    places, experiment = _places(lines.rows), plan(fit, causes)
    causes, no_gap = () if verdict == "unexplained" else causes, verdict == "no_gap"
    largest = max(places, key=lambda place: place.share)
    return LineDiagnosis(
        title=entries.title,
        rig=rig,
        seed=seed,
        runs=tuple(part.run for part in lines.parts),
        suspects=lines.suspects,
        verdict=verdict,
        where=None if no_gap else Where(causes[0].stage if causes else "transmission", largest),
        chosen=chosen,
        causes=causes,
        fitted=fitted,
        closure=closure if chosen and not no_gap else None,
        remainder=None if no_gap else remainder,
        experiment=experiment,
        sets=fit.probability,
        lines=lines,
        fit=fit,
        places=places,
        energies=energies,
    )


def _verdict(closure: LineClosure, remainder: Remainder, *, named: bool) -> Verdict:
    """Explained when no alarm remains and at least `MOSTLY` of what exceeds noise is closed.

    A number that changes from cycle to cycle does not forbid it by itself: what it does to the energies of held-out cycles
    does.
    """
    if not named:
        return "unexplained" if remainder.alarms else "no_gap"
    if not remainder.alarms and closure.beyond_noise >= MOSTLY:
        return "explained"
    return "partly_explained" if closure.share >= HALF or not remainder.alarms else "unexplained"


# --------------------------------------------------------------------------------------------- where, and how far it closes
def _places(rows: LineRows) -> tuple[Place, ...]:
    """Map the gap: one row for each phase of which there are blocks."""
    squares, found = rows.gap**2, []
    for number, name in enumerate(PHASES):
        here = rows.blocks.phase == number
        size = int(np.count_nonzero(here))
        if size < 2:
            continue
        noise = scatter_about_course(rows.blocks, rows.gap, here, FEW)
        noise = noise if math.isfinite(noise) else float(np.std(rows.gap[here]))
        share = float(squares[here].sum()) / max(float(squares.sum()), 1e-300)
        by = weigh(rows.gap[here], rows.blocks.cycle[here], np.full(size, noise), 0.0, np.zeros((size, 1)))
        found.append(msgspec.structs.replace(by, channel=POWER, phase=name, share=share))
    return tuple(found)


def _closure(fit: LineFit, seed: int) -> LineClosure:
    """Predict every judged row from a fit without it, and resample the cycles for the interval of the share."""
    rows, after = fit.lines.judged, fit.residual(fit.found.best)
    fold = folds_of(rows.blocks.cycle)
    old, new = np.bincount(fold, rows.gap**2), np.bincount(fold, after**2)
    draws = np.random.default_rng(seed).integers(old.size, size=(DRAWS, old.size))
    shares = 1.0 - new[draws].sum(axis=1) / np.maximum(old[draws].sum(axis=1), 1e-300)
    share = float(1.0 - new.sum() / max(old.sum(), 1e-300))
    low, high = np.quantile(shares, (0.025, 0.975)).tolist()
    noise = [_noise(rows, after, phase) ** 2 * np.mean(rows.blocks.phase == phase) for phase in range(len(PHASES))]
    before, left = (float(np.sqrt(np.mean(x**2))) for x in (rows.gap, after))
    power = Shrunk(before, left, math.sqrt(float(np.nansum(noise))))
    return LineClosure({POWER: power}, share, min(low, share), max(high, share), rows=rows, after=after)


def _noise(rows: LineRows, after: Signal, phase: int) -> float:
    """Noise of a residual in one phase, about its smooth course; NaN where there are too few blocks. [W]"""
    return scatter_about_course(rows.blocks, after, rows.blocks.phase == phase, FEW)


def _remainder(closure: LineClosure, energies: tuple[Alarm, ...]) -> Remainder:
    """Distinguish the residual from noise: energies that are not explained, and phases in which it has a smooth course."""
    rows, after, alarms = closure.rows, closure.after, list(energies)
    squares = np.bincount(rows.blocks.phase, after**2, len(PHASES))
    counts = np.bincount(rows.blocks.phase, minlength=len(PHASES))
    for phase, name in enumerate(PHASES):
        noise = _noise(rows, after, phase)
        ratio = math.sqrt(squares[phase] / counts[phase]) / noise if noise > 0.0 else 0.0
        beyond = float(squares[phase]) - counts[phase] * noise**2
        if ratio > ROUGH and beyond > PART_OF_GAP * float(np.sum(rows.gap**2)):
            alarms.append(Alarm("structure", Spot(POWER, name), ratio, ROUGH))
    worst = energies[0].about if energies else Spot(POWER, PHASES[int(np.argmax(squares))])
    return Remainder(
        share=max(1.0 - closure.share, 0.0),
        alarms=tuple(sorted(alarms, key=lambda alarm: -alarm.size / alarm.limit)),
        worst=worst,
    )


# ---------------------------------------------------------------------------------------------------------------- energies
def _energies(fit: LineFit, after: Signal) -> tuple[tuple[StageEnergy, ...], tuple[Alarm, ...]]:
    """Energies of the judged cycles by phase, and an alarm for each phase whose energies the causes do not explain.

    The residuals of a phase are an alarm where their root mean square, or their sum, is more than a small share of the energy,
    and more than the noise within the phases and the uncertainty of the coefficients allow. The uncertainty that is reported
    contains the scatter of cycles, too.
    """
    from scipy.special import chdtrc

    rows = fit.lines.judged
    code, row, place = np.unique(
        rows.blocks.cycle * len(PHASES) + rows.blocks.phase, return_index=True, return_inverse=True
    )
    phase = code % len(PHASES)

    def energy(power: Signal) -> Signal:
        return np.bincount(place, power * rows.width).astype(np.float64)

    measured, before, residual = map(energy, (rows.gap + rows.given, rows.given, after))
    columns = np.array([energy(column) for column in fit.by_number(rows, fit.found.best).T]).reshape(-1, code.size).T
    of_numbers = columns @ fit.covariance(fit.found.best) @ columns.T
    # a sum of n rows has n times the variance of a mean
    scale = float(np.median(rows.width)) * energy(np.ones(rows.t.size))
    within, between = (np.diag(scale * variance[phase, -1]) for variance in (fit.noise.within, fit.noise.variance))
    alarms = []
    for p in (PAYOUT, HAUL_IN):
        here = np.flatnonzero(phase == p)
        for sums, noise in ((np.eye(here.size), within), (np.ones((1, here.size)), between)):  # each cycle, then all
            left, ruler = sums @ residual[here], sums @ measured[here]
            spread = sums @ (noise + of_numbers)[np.ix_(here, here)] @ sums.T
            size = float(np.linalg.norm(left)) / max(float(np.linalg.norm(ruler)), 1e-300)
            squares = max(float(left @ np.linalg.pinv(spread, hermitian=True) @ left), 0.0)
            if size > SMALL_ENERGY and float(chdtrc(left.size, squares)) < CHANCE:
                alarms.append(Alarm("energy", Spot(POWER, PHASES[p]), size, SMALL_ENERGY))
    u = np.sqrt(np.diag(between + of_numbers))
    numbers = np.array([measured, before, measured - residual, u]).T.tolist()
    energies = [
        StageEnergy(int(rows.part[k]), PHASES[p], "mech", was, given, fitted, sd, cycle=int(rows.own_cycle[k]))
        for k, p, (was, given, fitted, sd) in zip(row, phase, numbers, strict=True)
    ]
    largest = {alarm.about: alarm for alarm in sorted(alarms, key=lambda alarm: alarm.size)}
    return tuple(energies), tuple(sorted(largest.values(), key=lambda alarm: -alarm.size))
