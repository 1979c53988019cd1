"""Fit of a winch without a model: the noise of its power, and the search for the suspects that explain it.

The residual of a fit is no white noise: losses that vary make it last. Haar's orthonormal transform of each phase of each cycle
separates the two: a coefficient compares the means of two neighbouring stretches of 1, 2, 4 ... blocks, and the last one is the
mean of the phase, which is its energy. Between lengths the coefficients of correlated noise are nearly independent (McCoy and
Walden 1996), so that weights by their variances make generalised least squares: energies count by how well they repeat.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from scipy.sparse import csr_array

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.causes import posterior_of
from winchcascade.diagnosis.line.line_data import coefficients_of
from winchcascade.diagnosis.marginal import Columns, weights
from winchcascade.diagnosis.search import Fit, Found, columns_of, search

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.line.line_data import LineRows, Lines
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect

LEVELS = 24
"""Columns of a table of variances: differences of 1, 2, 4 ... blocks, and in the last column the means of stretches."""

FEW = 4.0
"""Number of coefficients as which the variance of the next shorter length counts where a length has few of its own."""

FOLDS = 10
"""Minimum number of folds: fewer cycles are cut into about as many pieces in order of time."""

QUIET = 1e-8
"""Minimum variance in mean squares of the gap: logs are written with some four digits. [1]"""

ROUNDS = 4
"""Rounds of fit and residual in which the variances settle."""


def haar(values: Signal, owner: Index) -> tuple[Signal, Index, Index]:
    """Transform stretches of rows: coefficients (n, k), their level (n,) and the stretch of each, (n,).

    A difference of the means of two neighbours has the level 0 for single rows and 1 more for each doubling, a mean the last
    one. An odd node is passed on, so that the transform is orthonormal for any length.

    Parameters
    ----------
    values : (n, k) of the rows
    owner : (n,) stretch of each row, equal ones side by side

    >>> coefficients, level, _ = haar(np.array([[1.0], [3.0], [8.0]]), np.array([0, 0, 0]))
    >>> level.tolist(), round(float(np.sum(coefficients**2)), 9)
    ([0, 1, 23], 74.0)
    """
    total, count, level, found = values.copy(), np.ones(owner.size), 0, []
    while True:
        first = np.concatenate(([True], owner[1:] != owner[:-1]))
        begin = np.flatnonzero(first)
        rank = np.arange(owner.size) - np.repeat(begin, np.diff(np.append(begin, owner.size)))
        left = np.flatnonzero((rank[:-1] % 2 == 0) & ~first[1:])
        if not left.size:
            break
        a, b = count[left, None], count[left + 1, None]
        difference = np.sqrt(a * b / (a + b)) * (total[left + 1] / b - total[left] / a)
        found.append((difference, np.full(left.size, level), owner[left]))
        total[left] += total[left + 1]
        count[left] += count[left + 1]
        kept = np.delete(np.arange(owner.size), left + 1)
        total, count, owner = total[kept], count[kept], owner[kept]
        level += 1
    found.append((total / np.sqrt(count)[:, None], np.full(owner.size, LEVELS - 1), owner))
    coefficients, levels, owners = (np.concatenate(each) for each in zip(*found, strict=True))
    return coefficients, levels, owners


class LineNoise(msgspec.Struct, frozen=True):
    """Coefficients of columns and gap, `values` (n, k + 1) [W], by `fold`, `phase` and `level`, (n,) each, and the `variance`
    of the gap by phase and level, (3, LEVELS) [W2].
    """

    values: Signal
    fold: Index
    phase: Index
    level: Index
    variance: Signal

    def whitened(self, variance: Signal) -> Signal:
        """The coefficients in units of a noise by phase and level, (n, k + 1)."""
        return np.asarray(self.values / np.sqrt(variance[self.phase, self.level])[:, None])

    @property
    def within(self) -> Signal:
        """Variance by phase and level if the means of stretches scattered no more than what lasts long within them."""
        last = np.minimum(self.variance[:, -2], self.variance[:, -1])
        return np.column_stack([self.variance[:, :-1], last])


def folds_of(cycle: Index) -> Index:
    """Fold of each row, (m,) from 0: its cycle or, where cycles are few, a piece of it."""
    own, place, count = np.unique(cycle, return_inverse=True, return_counts=True)
    pieces = -(-FOLDS // own.size)
    rank = np.arange(place.size) - np.searchsorted(place, place)
    found: Index = place * pieces + rank * pieces // count[place]
    return found


def noise_of(rows: LineRows) -> LineNoise:
    """Noise of the gap in the residual of all suspects together, in a few rounds of fit and residual.

    What the fit takes from a coefficient, its leverage, is added to its residual.
    """
    stretch = folds_of(rows.blocks.cycle) * len(PHASES) + rows.blocks.phase
    order = np.argsort(stretch, kind="stable")
    values, level, owner = haar(np.column_stack([rows.columns, rows.gap])[order], stretch[order])
    order = np.argsort(owner // len(PHASES), kind="stable")
    order = order[level[order] > 0]  # differences of single blocks hold the noise of the velocity
    values, level, (fold, phase) = values[order], level[order], np.divmod(owner[order], len(PHASES))
    floor = QUIET * float(np.mean(rows.gap**2)) + 1e-300
    variance = np.full((len(PHASES), LEVELS), max(float(np.mean(rows.gap**2)), floor))
    for _ in range(ROUNDS):
        weighted = values / np.sqrt(variance[phase, level])[:, None]
        columns = weighted[:, :-1]
        inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
        left = values[:, -1] - values[:, :-1] @ (inverse @ (columns.T @ weighted[:, -1]))
        leverage = np.sum(columns @ inverse * columns, axis=1)
        squares, count = np.zeros_like(variance), np.zeros_like(variance)
        np.add.at(squares, (phase, level), left**2)
        np.add.at(count, (phase, level), 1.0 - leverage)
        shorter = np.full(len(PHASES), float(np.mean(left**2)))
        for k in range(LEVELS):
            shorter = (squares[:, k] + FEW * shorter) / (np.maximum(count[:, k], 0.0) + FEW)
            variance[:, k] = np.maximum(shorter, floor)
    return LineNoise(values, fold, phase, level, variance)


class LineProblem(msgspec.Struct, frozen=True):
    """The power of a winch as a problem of `search`: whitened coefficients of columns and gap, `rows` (n, k + 1) [1], in groups
    of one fold each, (n,). It has no nuisances.
    """

    suspects: Suspects
    rows: Signal
    groups: Index

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        """None: the problem is nearly linear."""
        return {}

    def price(self, _name: str) -> float:
        """Logarithm of the number of suspects [1]."""
        return math.log(max(len(self.suspects), 2))

    def residuals(self, several: Sequence[Sequence[ActiveEffect]]) -> Signal:
        """Measured minus predicted coefficients of several sets of effects, (n, sets)."""
        numbers = [{one.effect.name: one.values[0] for one in effects} for effects in several]
        coefficients = np.array([coefficients_of(tuple(self.suspects), each) for each in numbers])
        found: Signal = self.rows[:, -1:] - self.rows[:, :-1] @ coefficients.reshape(len(several), -1).T
        return found

    def nuisance_columns(self, _effects: Sequence[ActiveEffect]) -> Columns:
        """None."""
        return Columns(np.zeros((len(self.rows), 0)), csr_array((len(self.rows), 0)))


class LineFit(msgspec.Struct, frozen=True):
    """What a search found for the rows that take part in choice and fit, and the probability of every set of suspects."""

    lines: Lines
    noise: LineNoise
    found: Found
    probability: dict[Names, float]

    def numbers(self, fit: Fit) -> dict[str, float]:
        """The number of each suspect of a fit."""
        return dict(zip(fit.names, fit.x.tolist(), strict=True))

    def power(self, rows: LineRows, numbers: dict[str, float]) -> Signal:
        """What some numbers add to the power of the line, (m,). [W]"""
        found: Signal = rows.columns @ coefficients_of(self.lines.names, numbers)
        return found

    def by_number(self, rows: LineRows, fit: Fit) -> Signal:
        """Derivative of the power over the numbers of a fit, (m, k). [W per unit]"""
        numbers, made = self.numbers(fit), []
        for name, sd in zip(fit.names, fit.free.sd.tolist(), strict=True):
            step = 1e-6 * sd
            more = self.power(rows, {**numbers, name: numbers[name] + step})
            made.append((more - self.power(rows, numbers)) / step)
        return np.array(made).reshape(len(made), rows.t.size).T

    def covariance(self, fit: Fit) -> Signal:
        """Covariance of the numbers of a fit, (k, k)."""
        return posterior_of(self.found, fit).covariance

    def residual(self, fit: Fit) -> Signal:
        """Measured minus predicted power of the judged rows, (m,) [W].

        Withheld ones by the fit as it is, others by that without their fold, which follows from the quadratic about the fit.
        """
        rows, numbers = self.lines.judged, self.numbers(fit)
        left: Signal = rows.gap - self.power(rows, numbers)
        if self.lines.withheld.any() or not fit.names:
            return left
        columns = columns_of(self.found.problem, self.found.marginal, fit, fit.names)
        weighted, groups = columns * weights(fit.r)[:, None], self.found.problem.groups
        whole, fold = weighted.T @ columns + np.diag(fit.free.sd**-2.0), folds_of(rows.blocks.cycle)
        for g in range(int(fold.max()) + 1):
            own = groups == g
            change = np.linalg.solve(whole - weighted[own].T @ columns[own], weighted[own].T @ fit.r[own])
            x = np.clip(fit.x + change, fit.free.minimum, fit.free.maximum)
            here = rows.some(fold == g)
            left[fold == g] = here.gap - self.power(here, dict(zip(fit.names, x.tolist(), strict=True)))
        return left


def fit_of(lines: Lines) -> LineFit:
    """Search the suspects that explain the rows that take part in choice and fit, and weigh every set."""
    noise = noise_of(lines.fitted)
    rows = noise.whitened(noise.variance)
    found = search(LineProblem(lines.suspects, rows / math.sqrt(_dependence(rows, noise.fold)), noise.fold))
    every = [tuple(sorted(s)) for size in range(len(lines.names) + 1) for s in combinations(lines.names, size)]
    evidence = np.array([found.expansion.rated(names) for names in every])
    odds = np.exp(evidence - evidence.max())
    return LineFit(lines, noise, found, dict(zip(every, (odds / odds.sum()).tolist(), strict=True)))


def _dependence(rows: Signal, fold: Index) -> float:
    """Number of whitened coefficients for each independent one, at least 1: scores of whole folds against the curvature (the
    composite likelihood of Pauli, Racugno and Ventura 2011).
    """
    columns, gap = rows[:, :-1], rows[:, -1]
    inverse = np.linalg.pinv(columns.T @ columns, hermitian=True)
    scores = np.zeros((int(fold.max()) + 1, columns.shape[1]))
    np.add.at(scores, fold, columns * (gap - columns @ (inverse @ (columns.T @ gap)))[:, None])
    spread = float(np.sum(scores @ inverse * scores))
    return max(len(scores) / (len(scores) - 1.0) * spread / int(columns.shape[1]), 1.0)
