"""Diagnose a winch without a model: where its gap lies, which losses and inertia explain it, and what the residual holds."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import white_noise
from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.diagnosis.block_means import PHASES, Blocks, scatter_about_course
from winchcascade.diagnosis.closure import DRAWS, ROUGH
from winchcascade.diagnosis.diagnosis_result import (
    HALF,
    MOSTLY,
    Alarm,
    CycleEnergy,
    DiagnosisResult,
    Entries,
    FittedEffect,
    GapClosure,
    Names,
    Place,
    Remainder,
    Reported,
    Shrunk,
    Spot,
    Verdict,
    Where,
)
from winchcascade.diagnosis.gap_map import weigh
from winchcascade.diagnosis.line.line_causes import again_alone, fitted_effects, line_causes, plan
from winchcascade.diagnosis.line.line_data import POWER, CyclePart, Lines, block_means_of, lines_of
from winchcascade.diagnosis.line.line_energies import energy_alarms, energy_rows, energy_table
from winchcascade.diagnosis.line.line_selection import (
    Choice,
    Moments,
    choose,
    coefficients,
    fold_labels,
    moments_of,
    with_best_span,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.suspects import Suspects

SLOW = 0.2
"""The residual has a structure if more than this share of its squares lasts longer than a second."""

LAGS = range(3, 8)
"""Blocks between two that are multiplied to find what lasts: 1.3 s to 3.1 s where blocks are not longer than usual."""

PART_OF_GAP = 0.01
"""A structure with less than this share of the squared gap has no effect on the verdict."""

FEW = 12
"""Minimum number of triples of neighbouring blocks for an estimate of their noise."""

BURST = 0.05
"""Share of the samples, those with the largest residuals, whose part of the squares is reported."""

NOISY = 1.25
"""Root mean square of the residual, in its white noise, below which it is not significant."""


class LineClosure(GapClosure, frozen=True):
    """Share of the squared gap that the causes close on the parts that they are tested on: 1 - sum(after^2) / sum(gap^2).

    `after` are, part by part, measured minus predicted at the samples that count, (k,) each [W], by a fit without them. It is
    `quiet` where it is no more than white noise while the line moves.
    """

    parts: tuple[CyclePart, ...]
    after: tuple[Signal, ...]
    quiet: bool

    @property
    def samples(self) -> Signal:
        """Measured power, line tension times speed, and power with the causes, at all samples that count, (3, n) [W]."""
        given = np.concatenate([part.line_power for part in self.parts])
        measured = given + np.concatenate([part.gap for part in self.parts])
        return np.array([measured, given, measured - np.concatenate(self.after)])

    @property
    def power(self) -> Shrunk:
        """Root mean squares of the power. [W]"""
        return self.channels[POWER]

    @property
    def beyond_noise(self) -> float:
        """Share that is closed of what exceeds the white noise of the power. [1]"""
        before, after, noise = (x**2 for x in (self.power.before, self.power.after, self.power.noise))
        return 1.0 - max(after - noise, 0.0) / (before - noise) if before > noise else 0.0

    @property
    def left_out_in_turn(self) -> bool:
        """Whether the parts took part in the choice and each fold was left out of the fit once."""
        return not self.parts[0].withheld


class LineRemainder(Remainder, frozen=True):
    """The residual of the causes on the parts that they are tested on: signs of structure, and how bursty it is.

    `slow` is the share of its squares that lasts longer than a second, `bursts` that of the largest `BURST` of the samples,
    `in_worst` that of the worst phase: the one whose energy deviates most, else the one that holds most of the squares.
    """

    slow: float
    bursts: float
    in_worst: float


def map_of(parts: Sequence[CyclePart]) -> tuple[Place, ...]:
    """Map the gap: one row for each phase of which there are blocks."""
    blocks, mean = block_means_of(parts, [part.gap for part in parts])
    square = blocks.count * mean**2
    rows = []
    for number, name in enumerate(PHASES):
        here = (blocks.phase == number) & np.isfinite(mean)
        size = int(np.count_nonzero(here))
        if size < 2:
            continue
        noise = scatter_about_course(blocks, mean, here, FEW)
        noise = noise if math.isfinite(noise) else float(np.std(mean[here]))
        share = float(square[here].sum()) / max(float(np.nansum(square)), 1e-300)
        by = weigh(mean[here], blocks.cycle[here], np.full(size, noise), 0.0, np.zeros((size, 1)))
        rows.append(
            Place(**msgspec.structs.asdict(by), channel=POWER, phase=name, log=-1, load=None, blocks=size, share=share)
        )
    return tuple(rows)


def judge(lines: Lines, m: Moments, names: Names, seed: int) -> LineClosure:
    """Predict every held-out sample from a fit without it: withheld parts by the fit as it is, others fold by fold."""
    parts, labels = lines.judged, fold_labels(lines.judged)
    in_turn = not parts[0].withheld
    fits = np.array([coefficients(m, lines, names, fold) for fold in (range(m.folds) if in_turn else [None])])
    after = [
        part.gap - np.sum(part.columns * fits[own if in_turn else 0], axis=1)
        for part, own in zip(parts, labels, strict=True)
    ]
    gap, left, label = np.concatenate([part.gap for part in parts]), np.concatenate(after), np.concatenate(labels)
    old, new = np.bincount(label, gap**2), np.bincount(label, left**2)
    draws = np.random.default_rng(seed).integers(old.size, size=(DRAWS, old.size))
    shares = 1.0 - new[draws].sum(axis=1) / np.maximum(old[draws].sum(axis=1), 1e-300)
    share = float(1.0 - new.sum() / max(old.sum(), 1e-300))
    low, high = np.quantile(shares, (0.025, 0.975)).tolist()
    before, after_rms = (float(np.sqrt(np.mean(x**2))) for x in (gap, left))
    noise, quiet = noise_of(parts, after)
    return LineClosure(
        channels={POWER: Shrunk(before, after_rms, noise)},
        share=share,
        low=min(low, share),
        high=max(high, share),
        parts=parts,
        after=tuple(after),
        quiet=quiet,
    )


def noise_of(parts: Sequence[CyclePart], after: Sequence[Signal]) -> tuple[float, bool]:
    """White noise of a residual, phase by phase, and whether the residual is no more than that where the machine works. [W]"""
    left, phase = np.concatenate(after), np.concatenate([part.phase for part in parts])
    own = [white_noise(left[phase == p]) ** 2 * np.count_nonzero(phase == p) for p in range(len(PHASES))]
    works = [p for p, name in enumerate(PHASES) if name != "hold"]
    squares = float(np.sum(left[np.isin(phase, works)] ** 2))
    return math.sqrt(sum(own) / left.size), squares < NOISY**2 * sum(own[p] for p in works)


def left_in(
    parts: Sequence[CyclePart], after: Sequence[Signal], share: float, energies: tuple[Alarm, ...] = ()
) -> LineRemainder:
    """Distinguish the residual from noise.

    Parameters
    ----------
    after : measured minus predicted, part by part, (k,) each [W]
    share : of the squared gap that stays open
    energies : phases whose energies are not explained
    """
    blocks, mean = block_means_of(parts, after)
    square = np.concatenate(after) ** 2
    matters = PART_OF_GAP * float(sum(np.sum(part.gap**2) for part in parts))
    slow = _lasting(blocks, mean, float(np.mean(square)))
    alarms = list(energies)
    if slow > SLOW and slow * float(square.sum()) > matters:
        alarms.append(Alarm("slow", Spot(POWER), slow, SLOW))
    for phase, name in enumerate(PHASES):
        here = (blocks.phase == phase) & np.isfinite(mean)
        noise = scatter_about_course(blocks, mean, here, FEW)
        mean_square = float(np.mean(mean[here] ** 2)) if here.any() else 0.0
        ratio = math.sqrt(mean_square) / noise if noise > 0.0 else 0.0
        if ratio > ROUGH and (mean_square - noise**2) * float(blocks.count[here].sum()) > matters:
            alarms.append(Alarm("structure", Spot(POWER, name), ratio, ROUGH))
    largest, (_, squares) = np.sort(square)[::-1], block_means_of(parts, [x**2 for x in after])
    by_phase = np.bincount(blocks.phase, np.nan_to_num(squares) * blocks.count, len(PHASES))
    worst = _phase_of(energies[0]) if energies else int(np.argmax(by_phase))
    return LineRemainder(
        share=share,
        alarms=tuple(sorted(alarms, key=lambda alarm: -alarm.size / alarm.limit)),
        worst=Spot(POWER, PHASES[worst]),
        slow=slow,
        bursts=float(largest[: max(int(BURST * square.size), 1)].sum() / max(square.sum(), 1e-300)),
        in_worst=float(by_phase[worst] / max(by_phase.sum(), 1e-300)),
    )


def _phase_of(alarm: Alarm) -> int:
    """Number of the phase that an alarm of an energy is about."""
    return PHASES.index(alarm.about.phase) if isinstance(alarm.about, Spot) and alarm.about.phase else 0


def _lasting(blocks: Blocks, mean: Signal, mean_square: float) -> float:
    """Share of the squares that lasts longer than a second: products of blocks that far apart in one phase. [1]

    The mean is not subtracted, so a constant residual lasts.
    """
    stretch = np.cumsum(~blocks.joined)
    pairs = np.concatenate([(mean[k:] * mean[:-k])[stretch[k:] == stretch[:-k]] for k in LAGS])
    pairs = pairs[np.isfinite(pairs)]
    return max(float(np.mean(pairs)) / mean_square, 0.0) if pairs.size and mean_square > 0.0 else 0.0


class LineDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis of a winch without a model.

    `places` map the gap phase by phase; `again` are the numbers of the causes as the withheld cycles alone give them;
    `fitted_effects` are the suspects of the final fit, and those that it leaves out though they close more.
    """

    lines: Lines
    moments: Moments
    choice: Choice
    closure: LineClosure | None = None
    remainder: LineRemainder | None = None
    again: dict[str, Reported]
    fitted_effects: tuple[FittedEffect, ...]
    energies: tuple[CycleEnergy, ...] = ()


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
    entries.check_withheld()
    on_progress("taking the samples that count")
    lines = with_best_span(lines_of(entries, rig, suspects))
    on_progress("leaving each cycle out in turn")
    moments = moments_of(lines, lines.fitted)
    choice = choose(lines, moments)
    closure = judge(lines, moments, choice.chosen, seed) if choice.chosen else None
    on_progress("looking for alternative explanations")
    causes = line_causes(lines, moments, choice, suspects)
    after = [part.gap for part in lines.judged] if closure is None else closure.after
    table = energy_table(moments, lines.judged, after)
    energies = energy_alarms(lines, moments, choice.chosen, table)
    remainder = left_in(lines.judged, after, 1.0 if closure is None else max(1.0 - closure.share, 0.0), energies)
    verdict = _verdict(closure, remainder, named=bool(causes))
    causes, places, no_gap = () if verdict == "unexplained" else causes, map_of(lines.parts), verdict == "no_gap"
    largest = max(places, key=lambda place: place.share)
    return LineDiagnosis(
        title=entries.title,
        rig=rig,
        seed=seed,
        runs=tuple(part.run for part in lines.parts),
        suspects={name: suspects[name] for name in lines.names},
        verdict=verdict,
        where=None if no_gap else Where(causes[0].stage if causes else "transmission", largest),
        chosen=choice.chosen,
        causes=causes,
        closure=None if no_gap else closure,
        remainder=None if no_gap else remainder,
        experiment=plan(lines, moments, choice, [cause.effect for cause in causes]),
        sets=dict(choice.probability),
        lines=lines,
        moments=moments,
        choice=choice,
        places=places,
        again=again_alone(lines, choice.chosen),
        fitted_effects=fitted_effects(lines, moments, choice, [cause.effect for cause in causes]),
        energies=energy_rows(lines, moments, choice.chosen, table),
    )


def _verdict(closure: LineClosure | None, remainder: LineRemainder, *, named: bool) -> Verdict:
    """Explained when no alarm remains and at least `MOSTLY` is closed, or when the residual is no more than noise.

    A number that changes from cycle to cycle does not forbid it by itself: what it does to the energies of held-out cycles
    does.
    """
    if closure is None or not named:
        return "unexplained" if remainder.alarms else "no_gap"
    if not remainder.alarms and (closure.quiet or closure.share >= MOSTLY):
        return "explained"
    return "partly_explained" if closure.share >= HALF or not remainder.alarms else "unexplained"
