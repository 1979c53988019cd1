"""What is reported of each cause of a winch without a model: its number, its probability, its alternatives, its number cycle by
cycle, and the motion that would best distinguish a cause from its strongest alternative.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    Experiment,
    NamedCause,
    Names,
    RunValue,
    Spot,
    Stability,
)
from winchcascade.diagnosis.fit.block_means import BLOCK, PHASES
from winchcascade.diagnosis.fit.fit_set import columns_of
from winchcascade.diagnosis.fit.search import marginal_about
from winchcascade.diagnosis.judge.causes import COVERED, parameters_of, posterior_of, swap
from winchcascade.diagnosis.judge.stability import trends_of
from winchcascade.diagnosis.line.line_data import POWER, Lines, power_columns
from winchcascade.diagnosis.line.line_fit import FOLDS, LineFit, LineNoise, LineProblem, noise_of
from winchcascade.diagnosis.verdict_limits import AS_GOOD, LAW, OPEN

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.fit.evidence import Fit

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


def line_causes(fit: LineFit) -> tuple[NamedCause, ...]:
    """Every suspect of the best set with its numbers, the one that closes most first."""
    found, suspects, noise = fit.found, fit.lines.suspects, noise_of(fit.lines.rows)
    posterior, gap = posterior_of(found, found.best), max(float(np.sum(fit.lines.judged.gap**2)), 1e-300)
    closed, causes = 1.0 - float(np.sum(fit.residual(found.best) ** 2)) / gap, []
    for name in found.best.names:
        without = found.fit(tuple(n for n in found.best.names if n != name))
        ablation, alike = 1.0 - float(np.sum(fit.residual(without) ** 2)) / gap, _look_alikes(fit, name)
        stability, numbers = _stability(fit, noise, name), parameters_of(posterior, suspects[name], name)
        doubtful = stability.trends or any(number.beyond_range for number in numbers.values())
        most = OPEN if doubtful else AMBIGUOUS if alike else 1.0
        causes.append(
            NamedCause(
                effect=name,
                stage=suspects[name].stage,
                probability=min(share_with(fit, name), most),
                parameters=numbers,
                weight=closed - ablation,
                stability=stability,
                look_alikes=alike,
                ablation=ablation,
            )
        )
    return tuple(sorted(causes, key=lambda cause: -cause.weight))


def share_with(fit: LineFit, name: str) -> float:
    """Probability of all sets that contain a suspect. [1]"""
    return sum(p for names, p in fit.probability.items() if name in names)


def is_material(fit: LineFit, cause: str) -> bool:
    """Whether the power that a cause takes is a share of that of the winch that matters."""
    rows, number = fit.lines.fitted, fit.numbers(fit.found.best)[cause]
    power = np.linalg.norm(fit.power(rows, {cause: number}))
    return bool(power >= MATERIAL * np.linalg.norm(rows.gap + rows.given))


def _look_alikes(fit: LineFit, name: str) -> tuple[Alternative, ...]:
    """Suspects of the smallest sets without a cause for which the evidence is not clearly lower, the most likely first."""
    chosen, least = fit.found.best.names, fit.probability[fit.found.best.names] * math.exp(-AS_GOOD)
    good = [names for names, p in fit.probability.items() if name not in names and p >= least]
    smallest = [names for names in good if not any(set(other) < set(names) for other in good)]
    best: dict[str, Names] = {}
    for names in sorted(smallest, key=lambda names: -fit.probability[names]):
        for other in names:
            if other not in chosen:
                best.setdefault(other, names)
    return tuple(Alternative(other, share_with(fit, other), _difference(fit, names)) for other, names in best.items())


def _difference(fit: LineFit, other: Names) -> Spot:
    """In which phase the best set and another one differ most, as a root mean square."""
    rows = fit.lines.rows
    squares = (fit.power(rows, fit.numbers(fit.found.best)) - fit.power(rows, fit.numbers(fit.found.fit(other)))) ** 2
    sums, counts = (np.bincount(rows.blocks.phase, x, len(PHASES)) for x in (squares, np.ones(squares.size)))
    worst = int(np.argmax(sums))
    return Spot(POWER, PHASES[worst], bias=math.sqrt(float(sums[worst] / counts[worst])))


# --------------------------------------------------------------------------------------------------------- cycle by cycle
def _stability(fit: LineFit, noise: LineNoise, cause: str) -> Stability:
    """The number of one cause from every cycle alone, the other numbers as the joint fit has them.

    The noise within the phases, not the scatter of their means, is the uncertainty: the scatter is what is looked for.

    Parameters
    ----------
    noise : of all cycles, the withheld ones too: they only show here whether the numbers are the same
    """
    lines, best = fit.lines, fit.found.best
    problem, k = LineProblem(lines.suspects, noise.whitened(noise.within), noise.fold), best.names.index(cause)
    cycles = np.unique(lines.rows.blocks.cycle)
    cycle = noise.fold // -(-FOLDS // cycles.size)  # the folds of a cycle together
    marginal = marginal_about(problem, [], np.zeros(0))
    given = problem.residuals([best.effects(lines.suspects)], marginal.place)[:, 0]
    column = columns_of(problem, marginal, msgspec.structs.replace(best, given=given), (cause,))[:, 0]
    height = np.maximum(np.bincount(cycle, column**2, cycles.size), 1e-300)
    own = best.x[k] - np.bincount(cycle, column * given, cycles.size) / height
    u, runs = np.hypot(height**-0.5, LAW * best.x[k]), []
    known = COVERED * u < 2.0 * best.free.sd[k]
    for row, (value, half) in enumerate(zip(own.tolist(), (COVERED * u).tolist(), strict=True)):
        runs.append(RunValue(row, value, value - half, value + half) if known[row] else RunValue(row))
    order = np.flatnonzero(known)
    order = (order - order.min(initial=0)) / max(int(np.ptp(order)) if order.size else 1, 1)
    trends, _ = trends_of(own[known], np.diag(u[known] ** 2), {"order": order})
    return Stability(tuple(runs), tuple(trends))


# ------------------------------------------------------------------------------------------------------------ the next run
def plan(fit: LineFit, causes: tuple[NamedCause, ...]) -> Experiment | None:
    """Choose the motion in which the causes and the set that comes nearest with one of them swapped differ most."""
    chosen = fit.found.best.names
    others = [name for name in fit.lines.names if name not in chosen]
    swaps = [(swap(chosen, cause.effect, other), cause.effect, other) for cause in causes for other in others]
    if not swaps:
        return None
    swapped, name, other = max(swaps, key=lambda one: fit.probability[one[0]])
    motions, pull = _motions(fit.lines)
    scores = {motion: _significance(fit, fit.found.fit(swapped), *made) for motion, made in motions.items()}
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


def _significance(fit: LineFit, other: Fit, t: Signal, v: Signal, f: Signal) -> float:
    """Significance with which a motion distinguishes the best set from another one, whose numbers may adapt. [sigma]"""
    best, rows = fit.found.best, fit.lines.fitted
    noise = math.sqrt(max(float(np.mean((rows.gap - fit.power(rows, fit.numbers(best))) ** 2)), 1e-18))
    made = power_columns(t, v, f, float(np.max(np.abs(v))))
    columns = np.column_stack([made[name] for name in fit.lines.names]) / noise
    planned = msgspec.structs.replace(rows, columns=columns, t=t)
    z = fit.power(planned, fit.numbers(best)) - fit.power(planned, fit.numbers(other))
    j = fit.by_number(planned, other)
    pull, precision = j.T @ z, np.linalg.pinv(fit.covariance(other), hermitian=True)
    return math.sqrt(max(float(z @ z - pull @ np.linalg.pinv(j.T @ j + precision, hermitian=True) @ pull), 0.0))
