"""Fit of a winch without a model: the noise of its power, and the search for the suspects that explain it.

The residual of a fit is no white noise: losses that vary make it last. It has two parts, that of single rows about the mean of
a phase of a cycle, and that of this mean, which is the energy of the phase. Weights by the variances of both make generalised
least squares (random effects: Laird and Ware 1982): energies count by how well they repeat from cycle to cycle.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from scipy.sparse import csr_array

from winchcascade.diagnosis.fit.block_means import PHASES
from winchcascade.diagnosis.fit.evidence import Fit
from winchcascade.diagnosis.fit.fit_set import columns_of
from winchcascade.diagnosis.fit.marginal import Columns, Together, weights
from winchcascade.diagnosis.fit.search import Found, search
from winchcascade.diagnosis.judge.causes import posterior_of
from winchcascade.diagnosis.line.line_data import coefficients_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.diagnosis.line.line_data import LineRows, Lines
    from winchcascade.rig.effects.effect import ActiveEffect

TOGETHER = 2
"""Blocks that make one row of the fit, about a second: the velocity of single ones is known too badly for the inertia."""

FEW = 4.0
"""Number of cycles as which the variance within the phases counts in that of the means, where there are few cycles."""

FOLDS = 10
"""Minimum number of folds: fewer cycles are cut into about as many pieces in order of time."""

QUIET = 1e-8
"""Minimum variance in mean squares of the gap: logs are written with some four digits. [1]"""

ROUNDS = 4
"""Rounds of fit and residual in which the variances settle."""


class LineNoise(msgspec.Struct, frozen=True):
    """Rows of columns and gap, `values` (n, k + 1) [W]: those about the mean of a phase of a fold, and these means, both times
    the square root of the number of their blocks.

    `fold`, `phase` and `of_mean` (n,) are those of each row, `variance` (3, 2) is that of the gap by phase and kind [W2].
    """

    values: Signal
    fold: Index
    phase: Index
    of_mean: Index
    variance: Signal

    @property
    def within(self) -> Signal:
        """Variances if the means scattered no more than single rows do, (3, 2). [W2]"""
        return self.variance[:, [0, 0]]

    def whitened(self, variance: Signal) -> Signal:
        """The rows in units of a noise by phase and kind, (n, k + 1)."""
        return np.asarray(self.values / np.sqrt(variance[self.phase, self.of_mean])[:, None])


def folds_of(cycle: Index) -> Index:
    """Fold of each row, (m,) from 0: its cycle or, where cycles are few, a piece of it."""
    own, place, count = np.unique(cycle, return_inverse=True, return_counts=True)
    pieces = -(-FOLDS // own.size)
    rank = np.arange(place.size) - np.searchsorted(place, place)
    found: Index = place * pieces + rank * pieces // count[place]
    return found


def noise_of(rows: LineRows) -> LineNoise:
    """Noise of the gap in the residual of all suspects together, in a few rounds of fit and residual."""
    values, fold, phase, of_mean = _split(rows)
    gap = float(np.mean(rows.gap**2))
    variance = np.full((len(PHASES), 2), max(gap, 1e-300))
    for _ in range(ROUNDS):
        weighted = values / np.sqrt(variance[phase, of_mean])[:, None]
        inverse = np.linalg.pinv(weighted[:, :-1].T @ weighted[:, :-1], hermitian=True)
        left = values[:, -1] - values[:, :-1] @ (inverse @ (weighted[:, :-1].T @ weighted[:, -1]))
        squares, count = np.zeros_like(variance), np.zeros_like(variance)
        np.add.at(squares, (phase, of_mean), left**2)
        np.add.at(count, (phase, of_mean), 1.0)
        free = np.maximum(count[:, 0] - count[:, 1], 1.0)  # each mean is taken from its rows
        variance[:, 0] = np.maximum(squares[:, 0] / free, QUIET * gap + 1e-300)
        means = (squares[:, 1] + FEW * variance[:, 0]) / (count[:, 1] + FEW)
        variance[:, 1] = np.maximum(means, variance[:, 0])
    return LineNoise(values, fold, phase, of_mean, variance)


def _split(rows: LineRows) -> tuple[Signal, Index, Index, Index]:
    """Values, fold, phase and kind of the rows of a fit, as in `LineNoise`, in the order of the folds."""

    def summed(key: Index, x: Signal) -> Signal:
        return np.array([np.bincount(key, column) for column in x.T]).T

    stretch = folds_of(rows.blocks.cycle) * len(PHASES) + rows.blocks.phase
    order = np.argsort(stretch, kind="stable")
    own, begin, place, size = np.unique(stretch[order], return_index=True, return_inverse=True, return_counts=True)
    rank = np.arange(order.size) - np.repeat(begin, size)
    _, first, key = np.unique(place * order.size + rank // TOGETHER, return_index=True, return_inverse=True)
    count, owner = np.bincount(key).astype(np.float64)[:, None], place[first]
    row = summed(key, np.column_stack([rows.columns, rows.gap])[order]) / count
    total = summed(owner, count)
    mean = summed(owner, row * count) / total
    values = np.vstack([np.sqrt(count) * (row - mean[owner]), np.sqrt(total) * mean])
    fold, phase = np.divmod(np.concatenate([own[owner], own]), len(PHASES))
    of_mean = np.repeat([0, 1], [owner.size, own.size])
    order = np.argsort(fold, kind="stable")
    return values[order], fold[order], phase[order], of_mean[order]


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

    @property
    def exclusive(self) -> tuple[Together, ...]:
        """None."""
        return ()

    def price(self, _name: str) -> float:
        """Logarithm of the number of suspects [1]."""
        return math.log(max(len(self.suspects), 2))

    @property
    def nuisances(self) -> int:
        """None."""
        return 0

    def residuals(
        self, several: Sequence[Sequence[ActiveEffect]], _nu: Signal, _near: Sequence[ActiveEffect] | None = None
    ) -> Signal:
        """Measured minus predicted coefficients of several sets of effects, (n, sets)."""
        numbers = [{one.effect.name: one.values[0] for one in effects} for effects in several]
        coefficients = np.array([coefficients_of(tuple(self.suspects), each) for each in numbers])
        found: Signal = self.rows[:, -1:] - self.rows[:, :-1] @ coefficients.reshape(len(several), -1).T
        return found

    def nuisance_columns(self, _effects: Sequence[ActiveEffect], _nu: Signal) -> Columns:
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
