"""Which suspects: every set of them is fitted without each cycle in turn and must predict it (cross-validation)."""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.line.line_data import with_span
from winchcascade.diagnosis.solve import box_minimum

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import CyclePart, Index, Lines

Names = tuple[str, ...]

FOLDS = 8
"""With fewer cycles each is cut into pieces in order of time, until there are about as many."""

MATERIAL = 0.01
"""A cause closes at least this share of the gap: logs of an hour tell far smaller ones, which decide nothing."""

EVEN = 2.0
"""Standard errors within which two sets are told apart by chance."""

DRAWS = 1000
"""Resampled sets of cycles from which probabilities come."""


class Moments(msgspec.Struct, frozen=True):
    """Sums over the samples of G folds: of the columns `curve` (G, k, k) and `slope` (G, k), of the gap `square` (G,) [W2]."""

    curve: Signal
    slope: Signal
    square: Signal

    @property
    def folds(self) -> int:
        """How many there are."""
        return int(self.square.size)


class Choice(msgspec.Struct, frozen=True):
    """What cross-validation says: `errors` are squared errors of each set in each fold that it did not know, (G,) each [W2].

    `best` has the least error; sets within `tolerance` of it are as good [W2], and `chosen` is the smallest of these.
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
        """Squared error of a set on folds that it did not know, over that without any cause. [1]"""
        return float(self.errors[names].sum()) / max(self.gap, 1e-300)

    def as_good(self, names: Names) -> bool:
        """Whether a set predicts as well as the best one."""
        return float(self.errors[names].sum()) <= float(self.errors[self.best].sum()) + self.tolerance

    def even(self, names: Names) -> bool:
        """Whether folds do not tell a set from the chosen one: their errors differ by less than two standard errors."""
        apart = self.errors[names] - self.errors[self.chosen]
        return float(apart.sum()) <= EVEN * float(np.std(apart, ddof=1)) * math.sqrt(apart.size)


def fold_labels(parts: Sequence[CyclePart]) -> list[Index]:
    """Number the folds: the cycles of all parts or, where they are few, pieces of them; of each part (k,) from 0."""
    keys = [np.unique(part.cycle, return_inverse=True) for part in parts]
    cycles = sum(own.size for own, _ in keys)
    pieces = -(-FOLDS // cycles) if cycles < FOLDS else 1
    labels, first = [], 0
    for own, place in keys:
        rank = np.zeros(place.size, dtype=np.intp)
        for k in range(own.size):
            inside = np.flatnonzero(place == k)
            rank[inside] = np.arange(inside.size) * pieces // inside.size
        labels.append(first + place * pieces + rank)
        first += own.size * pieces
    return labels


def moments_of(parts: Sequence[CyclePart]) -> Moments:
    """Sums of all parts, fold by fold."""
    gap = np.concatenate([part.gap for part in parts])
    columns = np.vstack([part.columns for part in parts])
    label = np.concatenate(fold_labels(parts))
    order = np.argsort(label, kind="stable")
    edges = np.flatnonzero(np.diff(label[order])) + 1
    curve, slope, square = [], [], []
    for x, y in zip(np.split(columns[order], edges), np.split(gap[order], edges), strict=True):
        curve.append(x.T @ x)
        slope.append(x.T @ y)
        square.append(float(y @ y))
    return Moments(np.array(curve), np.array(slope), np.array(square))


def coefficients(m: Moments, lines: Lines, names: Names, without: int | None = None) -> Signal:
    """Coefficients of a set by bounded least squares, (suspects,), 0 outside the set.

    Parameters
    ----------
    without : a fold that is left out
    """
    found = np.zeros(len(lines.names))
    if names:
        curve, slope = m.curve.sum(axis=0), m.slope.sum(axis=0)
        if without is not None:
            curve, slope = curve - m.curve[without], slope - m.slope[without]
        own = np.array([lines.names.index(name) for name in names])
        found[own] = box_minimum(curve[np.ix_(own, own)], slope[own], lines.low[own], lines.high[own])
    return found


def square_left(m: Moments, fold: int, x: Signal) -> float:
    """Squared error that coefficients leave in one fold. [W2]"""
    return max(float(m.square[fold] - 2.0 * x @ m.slope[fold] + x @ m.curve[fold] @ x), 0.0)


def errors_of(m: Moments, lines: Lines, names: Names) -> Signal:
    """Squared error of a set in every fold, predicted without it, (G,) [W2]."""
    return np.array([square_left(m, g, coefficients(m, lines, names, without=g)) for g in range(m.folds)])


def with_best_span(lines: Lines) -> Lines:
    """Take the slope of the velocity over the span with which all suspects together best predict folds they did not know.

    The withheld parts have no say. A short span keeps what the winch does fast, a long one the noise of the velocity away.
    """
    if "drum_inertia" not in lines.names or len(lines.spans) == 1:
        return lines
    return min((with_span(lines, span) for span in lines.spans), key=_least_error)


def _least_error(lines: Lines) -> float:
    return float(errors_of(moments_of(lines.fitted), lines, lines.names).sum())


def choose(lines: Lines, m: Moments, seed: int) -> Choice:
    """Choose the smallest set of suspects that predicts cycles it did not know as well as the best set.

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
        least = min(fewer, key=lambda k: float(total[k]))
        if total[least] - total[chosen] >= MATERIAL * (total[0] - total[chosen]) > 0.0:
            break
        chosen = least
    return chosen
