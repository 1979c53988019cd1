"""Selection of suspects: every set is fitted, weighed by its evidence, and predicts each cycle by a fit without it."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.causes import AS_GOOD
from winchcascade.diagnosis.evidence import CLEARLY, Linear, cost_of
from winchcascade.diagnosis.line.line_data import CyclePart, Lines, beside, with_span
from winchcascade.diagnosis.line.line_noise import Cells, cells_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names

FOLDS = 8
"""Minimum number of folds: fewer cycles are cut into about as many pieces in order of time."""


class Moments(msgspec.Struct, frozen=True):
    """Sums over the samples of G folds: weighted ones for a fit, and as they are by cell.

    `curve` (G, k, k) and `slope` (G, k) of the columns are weighted by the inverse of the `variance` (C,) of each of the
    `cells` [W2]. `scale` is the number of coefficients for each independent one, at least 1. `cycle` (G,) numbers the cycle
    of a fold.
    """

    curve: Signal
    slope: Signal
    cells: Cells
    variance: Signal
    scale: float
    cycle: Index

    @property
    def folds(self) -> int:
        """How many there are."""
        return int(self.cycle.size)


class Choice(msgspec.Struct, frozen=True):
    """Every set of suspects with its `evidence`, a logarithm, and its squared `errors` in each fold left out of its fit,
    (G,) [W2].

    `best` has the most evidence, `chosen` is the smallest set that no larger one beats clearly.
    """

    errors: Mapping[Names, Signal]
    evidence: Mapping[Names, float]
    best: Names
    chosen: Names
    probability: Mapping[Names, float]

    @property
    def gap(self) -> float:
        """Squared error without any cause, over all folds. [W2]"""
        return float(self.errors[()].sum())

    def error(self, names: Names) -> float:
        """Squared error of a set on folds without them in the fit, over that without any cause. [1]"""
        return float(self.errors[names].sum()) / max(self.gap, 1e-300)

    def as_good(self, names: Names) -> bool:
        """Whether the evidence for a set is not clearly below that for the chosen one."""
        return self.evidence[names] >= self.evidence[self.chosen] - AS_GOOD

    def share_with(self, name: str) -> float:
        """Probability of all sets that contain a suspect. [1]"""
        return sum(p for names, p in self.probability.items() if name in names)


def fold_labels(parts: Sequence[CyclePart]) -> list[Index]:
    """Number the folds: the cycles of all parts or, where they are few, pieces of them; of each part (k,) from 0."""
    cycles = sum(np.unique(part.cycle).size for part in parts)
    pieces = -(-FOLDS // cycles) if cycles < FOLDS else 1
    labels, first = [], 0
    for part in parts:
        own, place, count = np.unique(part.cycle, return_inverse=True, return_counts=True)
        rank = np.arange(place.size) - np.searchsorted(place, place)  # within the cycle
        labels.append(first + place * pieces + rank * pieces // count[place])
        first += own.size * pieces
    return labels


def moments_of(lines: Lines, parts: Sequence[CyclePart]) -> Moments:
    """Sums of some parts, fold by fold, weighted by the noise of each cell in the residual of all suspects together.

    The variances follow from a few rounds of fit and residual; what the fit takes from a cell is added to its residual. Scores
    of whole folds against the curvature show how far the coefficients of a cell depend on each other (the adjustment of a
    composite likelihood by Pauli, Racugno and Ventura 2011).
    """
    gap, fold = np.concatenate([part.gap for part in parts]), np.concatenate(fold_labels(parts))
    columns, phase = np.vstack([part.columns for part in parts]), np.concatenate([part.phase for part in parts])
    cells = cells_of(columns, gap, fold, phase)
    count, floor = cells.count.sum(axis=0), QUIET * float(np.mean(gap**2)) + 1e-300
    m = _weighted(cells, np.full(count.size, max(float(np.mean(gap**2)), 1e-300)), _cycles_of_folds(parts, fold))
    for _ in range(ROUNDS):
        x = coefficients(m, lines, lines.names)
        taken = np.einsum("cij,ji->c", cells.curve.sum(axis=0), np.linalg.pinv(m.curve.sum(axis=0), hermitian=True))
        freedom = np.maximum(count - taken / m.variance, 0.5 * count)
        m = _weighted(cells, np.maximum(cells.residual(x).sum(axis=0) / np.maximum(freedom, 1.0), floor), m.cycle)
    scores = m.slope - m.curve @ coefficients(m, lines, lines.names)
    inverse = np.linalg.pinv(m.curve.sum(axis=0), hermitian=True)
    spread = m.folds / (m.folds - 1.0) * float(np.trace(inverse @ scores.T @ scores)) / scores.shape[1]
    return msgspec.structs.replace(m, scale=max(spread, 1.0))


def _weighted(cells: Cells, variance: Signal, cycle: Index) -> Moments:
    weight = 1.0 / variance
    curve, slope = np.einsum("gcij,c->gij", cells.curve, weight), np.einsum("gci,c->gi", cells.slope, weight)
    return Moments(curve, slope, cells, variance, 1.0, cycle)


def _cycles_of_folds(parts: Sequence[CyclePart], fold: Index) -> Index:
    """Number of the cycle that each fold is of, over all parts in a row, (G,) from 0."""
    own = [np.unique(part.cycle, return_inverse=True) for part in parts]
    first = np.cumsum([0, *(cycles.size for cycles, _ in own)])
    cycle = np.concatenate([place + k for (_, place), k in zip(own, first, strict=False)])
    return np.asarray(cycle[np.unique(fold, return_index=True)[1]])


def _quadratic(m: Moments, lines: Lines, without: int | None = None) -> Linear:
    """Half of the weighted squares as a function of the coefficients."""
    curve, slope = m.curve.sum(axis=0), m.slope.sum(axis=0)
    if without is not None:
        curve, slope = curve - m.curve[without], slope - m.slope[without]
    nothing, place = np.zeros(slope.size), {name: slice(k, k + 1) for k, name in enumerate(lines.names)}
    return Linear(curve, slope, nothing, nothing, lines.bounds, place)


def coefficients(m: Moments, lines: Lines, names: Names, without: int | None = None) -> Signal:
    """Coefficients of a set by bounded, weighted least squares, (suspects,), 0 outside the set.

    Parameters
    ----------
    without : a fold that is left out
    """
    return _quadratic(m, lines, without).best(names)[1]


def evidence_of(m: Moments, lines: Lines, names: Names) -> float:
    """Logarithm of the evidence for a set, up to a constant (Laplace; MacKay 2003, ch. 28).

    It is minus half of the weighted squares, less what the freedom of the numbers costs over their plausible ranges, less the
    logarithm of the number of suspects for each cause.
    """
    quadratic = _quadratic(m, lines)
    (objective, x), own = quadratic.best(names), quadratic.index(names)
    slope, curve = (quadratic.slope - quadratic.curve @ x)[own], quadratic.curve[np.ix_(own, own)]
    bounds = lines.bounds.some(np.array(own, dtype=np.intp))
    cost = cost_of(curve / m.scale, slope / m.scale, x[own], bounds) if own else 0.0
    return -objective / m.scale - cost - len(names) * math.log(max(len(lines.names), 2))


def errors_of(m: Moments, lines: Lines, names: Names) -> Signal:
    """Squared error of a set in every fold, predicted by a fit without the fold, (G,) [W2]."""
    fits = [coefficients(m, lines, names, without=g) for g in range(m.folds)]
    return np.array([float(m.cells.residual(x)[g].sum()) for g, x in enumerate(fits)])


def with_best_span(lines: Lines) -> Lines:
    """Take the slope of the velocity over the span with which all suspects together best predict folds left out of the fit.

    The withheld parts take no part. A short span keeps fast motion, a long one removes the noise of the velocity.
    """
    if "drum_inertia" not in lines.names or len(lines.spans) == 1:
        return lines
    spanned = [with_span(lines, span) for span in lines.spans]
    return min(spanned, key=lambda there: float(errors_of(moments_of(there, there.fitted), there, there.names).sum()))


MATERIAL = 0.01
"""Share of the gap that a cause closes, or of the energy of a phase that it takes, from which it is named: in logs of an hour
far smaller ones are significant, and force cells and powers of field winches are no better than to one per cent."""

QUIET = 1e-8
"""Minimum variance of a cell in mean squares of the gap: logs are written with some four digits. [1]"""

ROUNDS = 4
"""Rounds of fit and residual in which the variances settle."""


def choose(lines: Lines, m: Moments) -> Choice:
    """Weigh every set of suspects, and choose the smallest that no larger one beats by `CLEARLY` for each further cause."""
    every = [names for size in range(len(lines.names) + 1) for names in combinations(lines.names, size)]
    evidence = {names: evidence_of(m, lines, names) for names in every}
    best = max(every, key=lambda names: evidence[names])
    weights = {names: math.exp(evidence[names] - evidence[best]) for names in every}
    whole = sum(weights.values())
    return Choice(
        errors={names: errors_of(m, lines, names) for names in every},
        evidence=evidence,
        best=best,
        chosen=max(every, key=lambda names: evidence[names] - CLEARLY * len(names)),
        probability={names: weight / whole for names, weight in weights.items()},
    )


def line_covariance(lines: Lines, m: Moments, names: Names) -> Signal:
    """Covariance of the coefficients of a set, (suspects, suspects), 0 for those outside it or at a bound.

    Samples of one fold are no independent numbers: the sum of its scores varies (Liang and Zeger 1986), with G / (G - k) for G
    folds and k coefficients. A wider span for the slope of the velocity moves the numbers too, as either smooths fast
    motion: the error of the span in use follows from two of them and is added as a standard uncertainty, in the diagonal.
    """
    x = coefficients(m, lines, names)
    free = (lines.bounds.low < x) & (x < lines.bounds.high) & [name in names for name in lines.names]
    inside, found = np.flatnonzero(free), np.zeros((x.size, x.size))
    if inside.size:
        within = np.ix_(inside, inside)
        scores = (m.slope - m.curve @ x)[:, inside]
        inverse = np.linalg.pinv(m.curve.sum(axis=0)[within], hermitian=True)
        found[within] = m.folds / max(m.folds - inside.size, 1.0) * inverse @ scores.T @ scores @ inverse
        found[inside, inside] += (_error_of_span(lines, names) ** 2)[inside]
    return found


LONGER = 0.1
"""By how much the span is longer with which the error of a span is estimated, at least a sample on either side. [s]"""


def _error_of_span(lines: Lines, names: Names) -> Signal:
    """Error of each coefficient due to the span of the slope, (suspects,), from its change with another span.

    The error of the slope of a quadratic over k samples on either side is the third derivative times (3 k^2 + 3 k - 1) / 5, in
    squares of the step (Savitzky and Golay 1964).
    """
    if "drum_inertia" not in names:
        return np.zeros(len(lines.names))
    step = 2.0 * lines.span / (2.0 * beside(lines.parts[0].run, lines.span))
    other = lines.span + max(LONGER, step)
    there = with_span(lines, other)
    counts = (beside(lines.parts[0].run, span) for span in (lines.span, other))
    own, its = ((3.0 * k * k + 3.0 * k - 1.0) / 5.0 for k in counts)
    moved = coefficients(moments_of(there, there.fitted), there, names) - coefficients(
        moments_of(lines, lines.fitted), lines, names
    )
    return moved * (own / (its - own))
