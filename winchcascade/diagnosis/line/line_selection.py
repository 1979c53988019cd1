"""Selection of suspects by cross-validation: every set is fitted without each cycle in turn and predicts it."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.evidence import Linear
from winchcascade.diagnosis.line.line_data import CyclePart, Lines, with_span
from winchcascade.diagnosis.solve import Bounds

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names

FOLDS = 8
"""Minimum number of folds: fewer cycles are cut into about as many pieces in order of time."""


class Moments(msgspec.Struct, frozen=True):
    """Sums over the samples of G folds: of the columns `curve` (G, k, k) and `slope` (G, k), of the gap `square` (G,) [W2]."""

    curve: Signal
    slope: Signal
    square: Signal

    @property
    def folds(self) -> int:
        """How many there are."""
        return int(self.square.size)


EVEN = 2.0
"""Standard errors within which two sets cannot be distinguished."""


class Choice(msgspec.Struct, frozen=True):
    """Result of the cross-validation: `errors` are squared errors of each set in each fold, left out of its fit, (G,) [W2].

    `best` has the minimum error; sets within `tolerance` of it are as good [W2], and `chosen` is the smallest of these.
    """

    errors: Mapping[Names, Signal]
    best: Names
    chosen: Names
    tolerance: float
    probability: Mapping[Names, float]

    @property
    def gap(self) -> float:
        """Squared error without any cause, over all folds. [W2]"""
        return float(self.errors[()].sum())

    def error(self, names: Names) -> float:
        """Squared error of a set on folds without them in the fit, over that without any cause. [1]"""
        return float(self.errors[names].sum()) / max(self.gap, 1e-300)

    def as_good(self, names: Names) -> bool:
        """Whether a set predicts as well as the best one."""
        return float(self.errors[names].sum()) <= float(self.errors[self.best].sum()) + self.tolerance

    def even(self, names: Names) -> bool:
        """Whether a set cannot be distinguished from the chosen one: their errors differ by less than two standard errors."""
        apart = self.errors[names] - self.errors[self.chosen]
        return float(apart.sum()) <= EVEN * float(np.std(apart, ddof=1)) * math.sqrt(apart.size)


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


def moments_of(parts: Sequence[CyclePart]) -> Moments:
    """Sums of all parts, fold by fold."""
    gap = np.concatenate([part.gap for part in parts])
    columns, label = np.vstack([part.columns for part in parts]), np.concatenate(fold_labels(parts))
    folds = [(columns[label == g], gap[label == g]) for g in np.unique(label)]
    return Moments(
        curve=np.array([x.T @ x for x, _ in folds]),
        slope=np.array([x.T @ y for x, y in folds]),
        square=np.array([y @ y for _, y in folds]),
    )


def coefficients(m: Moments, lines: Lines, names: Names, without: int | None = None) -> Signal:
    """Coefficients of a set by bounded least squares, (suspects,), 0 outside the set.

    Parameters
    ----------
    without : a fold that is left out
    """
    curve, slope = m.curve.sum(axis=0), m.slope.sum(axis=0)
    if without is not None:
        curve, slope = curve - m.curve[without], slope - m.slope[without]
    nothing, place = np.zeros(slope.size), {name: slice(k, k + 1) for k, name in enumerate(lines.names)}
    return Linear(curve, slope, nothing, nothing, Bounds.of(lines.low, lines.high), place).best(names)[1]


def errors_of(m: Moments, lines: Lines, names: Names) -> Signal:
    """Squared error of a set in every fold, predicted by a fit without the fold, (G,) [W2]."""
    fits = [coefficients(m, lines, names, without=g) for g in range(m.folds)]
    folds = zip(m.square, m.slope, m.curve, fits, strict=True)
    return np.array([max(float(square - 2.0 * x @ slope + x @ curve @ x), 0.0) for square, slope, curve, x in folds])


def with_best_span(lines: Lines) -> Lines:
    """Take the slope of the velocity over the span with which all suspects together best predict folds left out of the fit.

    The withheld parts take no part. A short span keeps fast motion, a long one removes the noise of the velocity.
    """
    if "drum_inertia" not in lines.names or len(lines.spans) == 1:
        return lines
    spanned = [with_span(lines, span) for span in lines.spans]
    return min(spanned, key=lambda there: float(errors_of(moments_of(there.fitted), there, there.names).sum()))


MATERIAL = 0.01
"""Minimum share of the gap that a cause closes: in logs of an hour far smaller ones are significant, and of no importance."""

DRAWS = 1000
"""Resampled sets of cycles from which probabilities come."""


def choose(lines: Lines, m: Moments, seed: int) -> Choice:
    """Choose the smallest set of suspects that predicts cycles left out of its fit as well as the best set.

    As good means within one standard error, over folds, of the best set's error (Breiman, Friedman, Olshen and Stone 1984,
    Sec. 3.4.3), or within `MATERIAL` of the gap. The probability of a set is the share of resampled sets of folds in which the
    same rule chooses it (Efron 1979), errors of each fold as they are.

    Parameters
    ----------
    seed : of the resampling
    """
    every = [names for size in range(len(lines.names) + 1) for names in combinations(lines.names, size)]
    table = np.array([errors_of(m, lines, names) for names in every])
    sizes = np.array([len(names) for names in every])
    chosen, best, tolerance = _pick(table, sizes)
    chosen = _without_the_trivial(every, table.sum(axis=1), chosen)
    rng, counts = np.random.default_rng(seed), np.zeros(len(every))
    for _ in range(DRAWS):
        picked = table[:, rng.integers(m.folds, size=m.folds)]
        counts[_without_the_trivial(every, picked.sum(axis=1), _pick(picked, sizes)[0])] += 1.0
    return Choice(
        errors=dict(zip(every, table, strict=True)),
        best=every[best],
        chosen=every[chosen],
        tolerance=tolerance,
        probability=dict(zip(every, (counts / DRAWS).tolist(), strict=True)),
    )


def _pick(table: Signal, sizes: Signal) -> tuple[int, int, float]:
    """Number of the smallest set that is as good as the best, number of the best, and how far as good reaches [W2].

    Parameters
    ----------
    table : (sets, G) squared errors
    sizes : (sets,) suspects in each set
    """
    total = table.sum(axis=1)
    best = int(np.argmin(total))
    one_error = float(np.std(table[best], ddof=1)) * math.sqrt(table.shape[1])
    tolerance = max(one_error, MATERIAL * float(total[0] - total[best]))
    good = np.flatnonzero(total <= total[best] + tolerance)
    smallest = good[sizes[good] == sizes[good].min()]
    return int(smallest[np.argmin(total[smallest])]), best, tolerance


def _without_the_trivial(every: Sequence[Names], total: Signal, chosen: int) -> int:
    """Leave out, one by one, causes that close less than `MATERIAL` of what the set closes."""
    while every[chosen]:
        fewer = [every.index(tuple(n for n in every[chosen] if n != name)) for name in every[chosen]]
        best = min(fewer, key=lambda k: float(total[k]))
        if total[best] - total[chosen] >= MATERIAL * (total[0] - total[chosen]) > 0.0:
            break
        chosen = best
    return chosen
