"""What is reported of each cause of a winch without a model: its number, its probability, its alternatives, its number cycle by
cycle, and the motion that would best distinguish a cause from its strongest alternative.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from winchcascade.core.accuracy import student
from winchcascade.diagnosis.block_means import BLOCK, PHASES
from winchcascade.diagnosis.causes import COVERED, LAW
from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    Experiment,
    NamedCause,
    Names,
    Reported,
    RunValue,
    Spot,
    Stability,
)
from winchcascade.diagnosis.line.line_data import NUMBERS, POWER, RANGED, Lines, columns_of, reported_number
from winchcascade.diagnosis.line.line_fit import Choice, LineFit, folds_of, noise_of
from winchcascade.diagnosis.stability import trends_of

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.suspects import Suspects

MATERIAL = 0.01
"""Share of the power of the winch, root mean squares, that a cause must take to be named: in logs of an hour far smaller ones
are significant, and force cells and powers of field winches are no better than to one per cent."""

AMBIGUOUS = 0.95
"""Maximum probability of a cause that another suspect can replace: the list of suspects is not complete. [1]"""

STEP, RAMP = 10.0, 1.0
"""Length of a step of a planned motion, and of the ramp to it. [s]"""

SWING = 4.0
"""Period of a planned swing of the speed. [s]"""

TOP = 0.97
"""Quantile of the speed in payout that a planned motion takes for its top."""


def line_causes(fit: LineFit, choice: Choice, suspects: Suspects) -> tuple[NamedCause, ...]:
    """Every suspect of the chosen set with its numbers, the one that closes most first."""
    numbers, noise = reported(fit, choice.chosen), noise_of(fit.lines.rows)
    every = LineFit(fit.lines, fit.lines.rows, noise, noise.gram(noise.within))
    gap, causes = max(float(np.sum(fit.lines.judged.gap**2)), 1e-300), []
    for name in choice.chosen:
        without = tuple(n for n in choice.chosen if n != name)
        alike = _look_alikes(fit, choice, name)
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=min(choice.share_with(name), AMBIGUOUS if alike else 1.0),
                parameters={NUMBERS[name][0]: numbers[name]},
                weight=choice.errors[without] - choice.errors[choice.chosen],
                stability=_stability(every, choice.chosen, name),
                look_alikes=alike,
                ablation=1.0 - float(np.sum(fit.judged_residual(without) ** 2)) / gap,
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def is_material(fit: LineFit, names: Names, cause: str) -> bool:
    """Whether the power that a cause takes is a share of that of the winch that matters."""
    k = fit.lines.names.index(cause)
    power = np.linalg.norm(fit.rows.columns[:, k] * fit.coefficients(names)[k])
    return bool(power >= MATERIAL * np.linalg.norm(fit.rows.gap + fit.rows.given))


def reported(fit: LineFit, names: Names) -> dict[str, Reported]:
    """The number of each suspect of a set with its 95 % interval; Student's t for few folds."""
    lines, x = fit.lines, fit.coefficients(names)
    half = np.hypot(np.sqrt(np.diag(fit.covariance(names))), LAW * x) * student(fit.folds - 1)
    ends = np.array([x, np.maximum(x - half, lines.low), np.minimum(x + half, lines.high)])
    gain = reported_number("force_gain", float(x[lines.names.index("force_gain")])) if "force_gain" in names else 0.0
    inside, found = fit.inside(names), {}
    for name in names:
        k = lines.names.index(name)
        value, *interval = (
            reported_number(name, end) * (1.0 + gain if name == "force_zero" else 1.0) for end in ends[:, k].tolist()
        )
        low, high = lines.plausible[:, k]
        side: Literal["low", "high"] = "low" if x[k] <= lines.low[k] + 1e-9 * lines.span[k] else "high"
        found[name] = Reported(
            value,
            min(interval),
            max(interval),
            NUMBERS[name][1],
            None if name in inside else side,
            beyond_range=name in RANGED and not low <= x[k] <= high,
        )
    return found


def _look_alikes(fit: LineFit, choice: Choice, name: str) -> tuple[Alternative, ...]:
    """Suspects of the smallest sets without a cause for which the evidence is not clearly lower, the most likely first."""
    good = [names for names in choice.evidence if name not in names and choice.as_good(names)]
    smallest = [names for names in good if not any(set(other) < set(names) for other in good)]
    best: dict[str, Names] = {}
    for names in sorted(smallest, key=lambda names: -choice.evidence[names]):
        for other in names:
            if other not in choice.chosen:
                best.setdefault(other, names)
    return tuple(
        Alternative(other, choice.share_with(other), _difference(fit, choice.chosen, names))
        for other, names in best.items()
    )


def _difference(fit: LineFit, one: Names, other: Names) -> Spot:
    """In which phase two sets differ most, as a root mean square."""
    rows = fit.lines.rows
    squares = (rows.columns @ (fit.coefficients(one) - fit.coefficients(other))) ** 2
    sums, counts = (np.bincount(rows.blocks.phase, x, len(PHASES)) for x in (squares, np.ones(squares.size)))
    worst = int(np.argmax(sums))
    return Spot(POWER, PHASES[worst], bias=math.sqrt(float(sums[worst] / counts[worst])))


# --------------------------------------------------------------------------------------------------------- cycle by cycle
def _stability(fit: LineFit, names: Names, cause: str) -> Stability:
    """Estimate the number of one cause from every cycle, the other numbers common to the cycles.

    The noise within the phases, not the scatter of their means, is the uncertainty: the scatter is what is looked for.

    Parameters
    ----------
    fit : of all cycles, the withheld ones too: they only show here whether the numbers are the same
    names : the set of the fit
    """
    lines, cycle = fit.lines, fit.rows.blocks.cycle
    first_row, number = np.unique(cycle, return_index=True)[1], np.unique(cycle, return_inverse=True)[1]
    of_fold = number[np.unique(folds_of(cycle), return_index=True)[1]]
    gram = np.zeros((first_row.size, *fit.gram.shape[1:]))
    np.add.at(gram, of_fold, fit.gram)
    k, others = lines.names.index(cause), fit.own(tuple(name for name in names if name != cause))
    # each cycle has a coefficient of its own, in the last rows; those of the other suspects are common, in the first ones
    common, size = gram.sum(axis=0), others.size
    whole = np.diag(np.concatenate([np.zeros(size), gram[:, k, k]]))
    whole[:size, :size] = common[np.ix_(others, others)]
    whole[:size, size:] = gram[:, others, k].T
    whole[size:, :size] = gram[:, others, k]
    silent = gram[:, k, k] <= 1e-9 * gram[:, k, k].max(initial=1e-300)
    whole[size:, size:] += np.diag(1.0 * silent)
    covariance = np.linalg.pinv(whole, hermitian=True)
    x = (covariance @ np.concatenate([common[others, -1], gram[:, k, -1]]))[size:]
    joint = float(fit.coefficients(names)[k])
    spread = covariance[size:, size:] + np.diag(np.full(x.size, (LAW * joint) ** 2))
    half = COVERED * np.sqrt(np.diag(spread))
    known = ~silent & (2.0 * half < lines.span[k])
    runs = []
    for row in range(x.size):
        ends = [reported_number(cause, float(end)) for end in (x[row], x[row] - half[row], x[row] + half[row])]
        runs.append(RunValue(row, ends[0], min(ends), max(ends)) if known[row] else RunValue(row))
    slope = -1.0 / (1.0 + joint) ** 2 if cause == "force_gain" else 1.0  # of the reported number over the coefficient
    order = np.flatnonzero(known) / max(float(np.ptp(np.flatnonzero(known))) if known.any() else 1.0, 1.0)
    trends, _ = trends_of(slope * x[known], slope**2 * spread[np.ix_(known, known)], {"order": order})
    return Stability(tuple(runs), tuple(trends))


# ------------------------------------------------------------------------------------------------------------ the next run
def plan(fit: LineFit, choice: Choice, causes: tuple[NamedCause, ...]) -> Experiment | None:
    """Choose the motion in which the causes and the set that comes nearest with one of them swapped differ most."""
    others = [name for name in fit.lines.names if name not in choice.chosen]
    swaps = [
        (choice.evidence[swapped], cause.effect, other, swapped)
        for cause in causes
        for other in others
        for swapped in [tuple(n for n in fit.lines.names if n in {*choice.chosen, other} - {cause.effect})]
    ]
    if not swaps:
        return None
    _, name, other, swapped = max(swaps)
    motions, pull = _motions(fit.lines)
    scores = {motion: _significance(fit, choice.chosen, swapped, *made) for motion, made in motions.items()}
    best = max(scores, key=lambda motion: scores[motion])
    return Experiment(best, float(motions[best][1].max()), (name, other), scores[best], force=pull)


Motion = Literal["speed_steps", "force_steps", "out_and_back", "swing"]


def _motions(lines: Lines) -> tuple[dict[Motion, tuple[Signal, Signal, Signal]], float]:
    """Stamps, speed and tension of the motions that are tried, at those of the campaign, and the tension they are about [N]."""
    v, f = lines.fitted.motion.T
    top = float(np.quantile(v[v > 0.0] if np.any(v > 0.0) else np.abs(v), TOP))
    pull = float(np.median(f[v > 0.5 * top] if np.any(v > 0.5 * top) else f))
    t, quarters = np.arange(0.0, 4.0 * STEP + RAMP, BLOCK), np.linspace(0.25, 1.0, 4)
    corners = np.ravel(np.column_stack([np.arange(4) * STEP + RAMP, np.arange(1, 5) * STEP]))

    def steps(levels: Signal) -> Signal:
        return np.asarray(np.interp(t, [0.0, *corners, t[-1]], [0.0, *np.repeat(levels, 2), 0.0]))

    constant, forces = np.full(t.size, pull), np.interp(t, corners, np.repeat(np.linspace(0.5, 1.5, 4) * pull, 2))
    return {
        "speed_steps": (t, steps(top * quarters), constant),
        "force_steps": (t, steps(np.full(4, 0.5 * top)), forces),
        "out_and_back": (t, steps(0.5 * top * np.array([1.0, -1.0, 1.0, -1.0])), constant),
        "swing": (t, top * (0.75 - 0.25 * np.cos(2.0 * math.pi * t / SWING)), constant),
    }, pull


def _significance(fit: LineFit, one: Names, other: Names, t: Signal, v: Signal, f: Signal) -> float:
    """Significance with which a motion distinguishes two sets; the numbers of the second may adapt within the logs. [sigma]"""
    noise = math.sqrt(max(float(np.mean(fit.residual(one) ** 2)), 1e-18))
    made = columns_of(t, v, f)
    columns = np.column_stack([made[name] for name in fit.lines.names]) / noise
    own = fit.own(other)
    z, j = columns @ (fit.coefficients(one) - fit.coefficients(other)), columns[:, own]
    precision = np.linalg.pinv(fit.covariance(other)[np.ix_(own, own)], hermitian=True)
    pull = j.T @ z
    return math.sqrt(max(float(z @ z - pull @ np.linalg.pinv(j.T @ j + precision, hermitian=True) @ pull), 0.0))
