"""Fit of a winch without a model: the noise of its power, every set of suspects by its evidence, and their covariance.

The residual of a fit is no white noise: losses that vary make it last. Haar's orthonormal transform of each phase of each cycle
separates the two: a coefficient compares the means of two neighbouring stretches of 1, 2, 4 ... blocks, and the last one is the
mean of the phase, which is its energy. Between lengths the coefficients of correlated noise are nearly independent (McCoy and
Walden 1996), so that weights by their variances make generalised least squares: energies count by how well they repeat.
"""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.causes import AS_GOOD
from winchcascade.diagnosis.evidence import CLEARLY

if TYPE_CHECKING:
    from collections.abc import Mapping

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.line.line_data import LineRows, Lines

LEVELS = 24
"""Columns of a table of variances: differences of 1, 2, 4 ... blocks, and in the last column the means of stretches."""

FEW = 4.0
"""Number of coefficients as which the variance of the next shorter length counts where a length has few of its own."""

FOLDS = 8
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

    def gram(self, variance: Signal) -> Signal:
        """Products of the coefficients of each fold, weighted by the inverse of a variance, (G, k + 1, k + 1)."""
        weighted = self.values / np.sqrt(variance[self.phase, self.level])[:, None]
        ends = np.searchsorted(self.fold, np.arange(int(self.fold.max()) + 2))
        return np.array([weighted[a:b].T @ weighted[a:b] for a, b in pairwise(ends)])

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


class LineFit(msgspec.Struct, frozen=True):
    """The weighted squares of a winch as a quadratic of its coefficients: `gram` (G, k + 1, k + 1) of columns and gap by fold.

    `scale` is the number of coefficients for each independent one, at least 1: scores of whole folds against the curvature
    show how far they depend on each other (the composite likelihood of Pauli, Racugno and Ventura 2011).
    """

    lines: Lines
    rows: LineRows
    noise: LineNoise
    gram: Signal
    scale: float = 1.0

    @property
    def folds(self) -> int:
        """How many there are."""
        return len(self.gram)

    def own(self, names: Names) -> Index:
        """Numbers of the coefficients of some suspects."""
        return np.array([self.lines.names.index(name) for name in names], dtype=np.intp)

    def curvature(self, names: Names, gram: Signal) -> Signal:
        """Curvature of the negative logarithm of the posterior; half of a plausible range is one standard deviation."""
        own = self.own(names)
        prior = np.diag((0.5 * self.lines.span[own]) ** -2.0)
        curve: Signal = gram[np.ix_(own, own)] / self.scale + prior
        return curve

    def coefficients(self, names: Names, without: int | None = None) -> Signal:
        """Coefficients of a set within their bounds, (suspects,), 0 outside the set.

        Parameters
        ----------
        without : a fold that is left out
        """
        from scipy.optimize import lsq_linear

        gram = self.gram.sum(axis=0) - (0.0 if without is None else self.gram[without])
        own, found = self.own(names), np.zeros(len(self.lines.names))
        if not names:
            return found
        curve, slope = self.curvature(names, gram), gram[own, -1] / self.scale
        low, high = self.lines.low[own], self.lines.high[own]
        x = np.linalg.solve(curve, slope)
        if np.any((x < low) | (x > high)):
            lower = np.linalg.cholesky(curve)
            x = lsq_linear(lower.T, np.linalg.solve(lower, slope), bounds=(low, high), method="bvls").x
        found[own] = x
        return found

    def inside(self, names: Names) -> list[str]:
        """Suspects of a set whose coefficients lie at no bound."""
        x, lines = self.coefficients(names), self.lines
        eps = 1e-9 * lines.span
        free = (x > lines.low + eps) & (x < lines.high - eps)
        return [name for name in names if free[lines.names.index(name)]]

    def residual(self, names: Names) -> Signal:
        """Measured minus predicted power of the rows of the fit, each by a fit without its fold, (m,) [W]."""
        fits = np.array([self.coefficients(names, without=g) for g in range(self.folds)])
        left: Signal = self.rows.gap - np.sum(self.rows.columns * fits[folds_of(self.rows.blocks.cycle)], axis=1)
        return left

    def judged_residual(self, names: Names) -> Signal:
        """Measured minus predicted power of the judged rows by a fit without them, (m,) [W]."""
        if not self.lines.withheld.any():
            return self.residual(names)
        judged = self.lines.judged
        left: Signal = judged.gap - judged.columns @ self.coefficients(names)
        return left

    def evidence(self, names: Names) -> float:
        """Logarithm of the evidence for a set, up to a constant, by Laplace (MacKay 2003, ch. 28).

        It is minus half of the weighted squares, less what the freedom of the numbers costs over their plausible ranges, less
        the logarithm of the number of suspects for each cause.
        """
        gram, x, sd = self.gram.sum(axis=0), self.coefficients(names), 0.5 * self.lines.span
        with_gap = np.append(-x, 1.0)
        squares = float(with_gap @ gram @ with_gap) / self.scale + float(np.sum((x / sd) ** 2))
        free = tuple(self.inside(names))
        widths = sd[self.own(free)]
        occam = float(np.linalg.slogdet(self.curvature(free, gram) * np.outer(widths, widths))[1]) if free else 0.0
        return -0.5 * squares - 0.5 * occam - len(names) * math.log(max(len(self.lines.names), 2))

    def covariance(self, names: Names) -> Signal:
        """Covariance of the coefficients of a set, (suspects, suspects), 0 for those outside it or at a bound.

        For each coefficient the larger one of Laplace's and that of the sums of the scores of each fold, whose rows depend on
        each other (Liang and Zeger 1986), with G / (G - k) for G folds and k coefficients.
        """
        free, found = tuple(self.inside(names)), np.zeros((len(self.lines.names),) * 2)
        if free:
            own, gram = self.own(free), self.gram
            scores = (gram[:, :-1, -1] - gram[:, :-1, :-1] @ self.coefficients(names))[:, own] / self.scale
            inverse = np.linalg.inv(self.curvature(free, gram.sum(axis=0)))
            spread = self.folds / max(self.folds - own.size, 1.0) * inverse @ scores.T @ scores @ inverse
            more = np.sqrt(np.maximum(np.diag(spread) / np.diag(inverse), 1.0))
            found[np.ix_(own, own)] = inverse * np.outer(more, more)
        return found


def fit_of(lines: Lines) -> LineFit:
    """The quadratic of the rows that take part in choice and fit."""
    noise = noise_of(lines.fitted)
    fit = LineFit(lines, lines.fitted, noise, noise.gram(noise.variance))
    x = fit.coefficients(lines.names)
    scores = fit.gram[:, :-1, -1] - fit.gram[:, :-1, :-1] @ x
    inverse = np.linalg.pinv(fit.gram.sum(axis=0)[:-1, :-1], hermitian=True)
    spread = fit.folds / (fit.folds - 1.0) * float(np.sum(scores @ inverse * scores)) / x.size
    return msgspec.structs.replace(fit, scale=max(spread, 1.0))


class Choice(msgspec.Struct, frozen=True):
    """Every set of suspects: its `evidence`, its squared error in folds left out of its fit, over that without any cause, and
    its `probability`. `chosen` is the smallest set that no larger one beats clearly.
    """

    evidence: Mapping[Names, float]
    errors: Mapping[Names, float]
    probability: Mapping[Names, float]
    chosen: Names

    def as_good(self, names: Names) -> bool:
        """Whether the evidence for a set is not clearly below that for the chosen one."""
        return self.evidence[names] >= self.evidence[self.chosen] - AS_GOOD

    def share_with(self, name: str) -> float:
        """Probability of all sets that contain a suspect. [1]"""
        return sum(p for names, p in self.probability.items() if name in names)


def choose(fit: LineFit) -> Choice:
    """Weigh every set of suspects, and choose the smallest that no larger one beats by `CLEARLY` for each further cause."""
    suspects = fit.lines.names
    every = [names for size in range(len(suspects) + 1) for names in combinations(suspects, size)]
    evidence = {names: fit.evidence(names) for names in every}
    gap, most = max(float(np.sum(fit.rows.gap**2)), 1e-300), max(evidence.values())
    weights = {names: math.exp(value - most) for names, value in evidence.items()}
    whole = sum(weights.values())
    return Choice(
        evidence=evidence,
        errors={names: float(np.sum(fit.residual(names) ** 2)) / gap for names in every},
        probability={names: weight / whole for names, weight in weights.items()},
        chosen=max(every, key=lambda names: evidence[names] - CLEARLY * len(names)),
    )
