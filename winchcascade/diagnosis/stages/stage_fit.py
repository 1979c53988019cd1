"""Fit of the laws of stages: the noise of their powers, and the search for the laws and sensors
that explain them.

The residual of a fit is no white noise: losses that vary make it last. It has two parts, that of
single rows about the mean of a phase of a cycle, and that of this mean, which is the energy of the
phase. Weights by the variances of both make generalised least squares (random effects: Laird and
Ware 1982): energies count by how well they repeat from cycle to cycle. What the rig file knows of
sensors and stated laws is a nuisance of every fit, within its standard uncertainty.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from scipy.sparse import csr_array

from winchcascade.diagnosis.fit.evidence import Evidence, Fit, minimum_within
from winchcascade.diagnosis.fit.expansion import (
    Centre,
    Expansion,
    expand,
    marginal_about,
    neighbours,
)
from winchcascade.diagnosis.fit.fit_set import fit_set
from winchcascade.diagnosis.fit.marginal import Columns, Marginal, Together, weights
from winchcascade.diagnosis.fit.search import Found
from winchcascade.diagnosis.fit.suspects import freedom
from winchcascade.diagnosis.judge.causes import posterior_of, probabilities
from winchcascade.diagnosis.stages.stage_rows import PARTS_OF_RUN
from winchcascade.diagnosis.verdict_limits import LAW, RARER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Index, Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Suspects
    from winchcascade.diagnosis.stages.stage_rows import StageData, StageRows
    from winchcascade.rig.effects.effect import ActiveEffect

TOGETHER = 2
"""Blocks that make one row of the fit, about a second: the velocity of single ones is known too
badly for the inertia."""

CYCLES_OF_PHASES = 4.0
"""Number of cycles as which the variance within the phases counts in that of the means, where there
are few cycles."""

FOLDS = 10
"""Minimum number of folds: fewer cycles are cut into about as many pieces in order of time."""

VARIANCE_MIN = 1e-8
"""Minimum variance in mean squares of the power: logs are written with some four digits. [1]"""

ROUNDS = 4
"""Rounds of fit and residual in which the variances settle."""

DIRECTION_MIN = 1e-10
"""Share of the largest direction of scaled columns below which a direction is none. [1]"""

LAW_BESIDE_MODEL = 0.05
"""Share of the gap that the best law of one number misses beside a model: that whose exponent is a
quarter off, as windage is between square and cube, misses 0.056 of a square. [1]"""

SUSPECTS_OF_EVERY_SET = 10
"""Number of suspects up to which every set of them is weighed; of more, those that the search finds
near the best."""


class StageNoise(msgspec.Struct, frozen=True):
    """Rows of columns, nuisances and gap, `values` (n, k + q + 1) [W]: those about the mean of a
    phase of a fold, and these means, both times the square root of the number of their blocks.

    `fold`, `kind` (of path and phase) and `of_mean` (n,) are those of each row, `variance` (kinds,
    2) is that of the gap [W2].
    """

    values: Signal
    fold: Index
    kind: Index
    of_mean: Index
    variance: Signal

    @property
    def within(self) -> Signal:
        """Variances if the means scattered no more than single rows do, (kinds, 2). [W2]"""
        return self.variance[:, [0, 0]]

    def whitened(self, variance: Signal) -> Signal:
        """The rows in units of a noise by kind, (n, k + q + 1)."""
        return np.asarray(self.values / np.sqrt(variance[self.kind, self.of_mean])[:, None])


def folds_of(cycle: Index) -> Index:
    """Fold of each row, (m,) from 0: its cycle or, where cycles are few, a piece of it."""
    cycles, place, count = np.unique(cycle, return_inverse=True, return_counts=True)
    pieces = -(-FOLDS // cycles.size)
    rank = np.arange(place.size) - np.searchsorted(place, place)
    found: Index = place * pieces + rank * pieces // count[place]
    return found


def noise_of(data: StageData, rows: StageRows) -> StageNoise:
    """Noise of the gap of some rows in the residual of all laws together, in a few rounds of fit
    and residual.

    Errors of sensors of a power that comes out take no part: with those of the power that goes in
    they imitate any gap.
    """
    paths, plain = (
        len(data.paths),
        np.concatenate([data.plain, np.ones(rows.known.shape[1], dtype=bool)]),
    )
    precision = np.where(np.arange(plain.size) < len(data.names), 0.0, 1.0)[plain]
    values, fold, kind, of_mean = _split(rows, paths)
    columns = values[:, :-1][:, plain]
    kinds = paths * len(PARTS_OF_RUN)
    blocks = np.bincount(rows.kind, minlength=kinds)
    floor = VARIANCE_MIN * np.bincount(rows.kind, rows.given**2 + rows.gap**2, kinds) + 1e-300
    floor /= np.maximum(blocks, 1)
    variance = np.tile(np.maximum(floor / VARIANCE_MIN, 1e-300)[:, None], 2)
    for _ in range(ROUNDS):
        noise = np.sqrt(variance[kind, of_mean])
        weighted = columns / noise[:, None]
        inverse = independent(weighted, precision)
        left = values[:, -1] - columns @ (inverse @ (weighted.T @ (values[:, -1] / noise)))
        leverage = np.sum(weighted @ inverse * weighted, axis=1)
        squares, count, fitted = np.zeros((3, *variance.shape))
        for sums, x in ((squares, left**2), (count, np.ones(kind.size)), (fitted, leverage)):
            np.add.at(sums, (kind, of_mean), x)
        free = np.maximum(count[:, 0] - 2.0 * count[:, 1], 1.0)  # each half has its own mean
        variance[:, 0] = np.maximum(squares[:, 0] / free, floor)
        means = (squares[:, 1] + CYCLES_OF_PHASES * variance[:, 0]) / (
            count[:, 1] + CYCLES_OF_PHASES
        )
        alone = squares[:, 1] / np.maximum(count[:, 1] - fitted[:, 1] - 2.0, 1.0)
        means = np.where(
            count[:, 0] > 2.0 * count[:, 1], means, alone
        )  # of single rows none shows the noise within
        variance[:, 1] = np.maximum(means, variance[:, 0])
    # no law is exact: what it misses of the gap lasts, and so counts in a mean as often as this has
    # rows
    law = LAW_BESIDE_MODEL if data.beside_model else LAW
    missed = law**2 * np.bincount(rows.kind, rows.gap**2, kinds) / np.maximum(blocks, 1)
    folds = np.array([np.unique(fold[(kind == k) & (of_mean == 1)]).size for k in range(kinds)])
    lasting = blocks / np.maximum(folds, 1)
    variance += missed[:, None] * np.column_stack([np.full(kinds, float(TOGETHER)), lasting])
    return StageNoise(values, fold, kind, of_mean, variance)


def _split(rows: StageRows, paths: int) -> tuple[Signal, Index, Index, Index]:
    """Values, fold, kind and whether it is a mean of the rows of a fit, as in `StageNoise`, in the
    order of the folds.

    Rows about a mean have the gap of one half of the samples beside the columns of the other half:
    noise of a channel that is in both would otherwise explain itself.
    """

    def summed(key: Index, x: Signal) -> Signal:
        return np.array([np.bincount(key, column) for column in x.T]).T

    kinds = paths * len(PARTS_OF_RUN)
    stretch = folds_of(rows.blocks.cycle) * kinds + rows.kind
    order = np.argsort(stretch, kind="stable")
    stretches, begin, place, size = np.unique(
        stretch[order], return_index=True, return_inverse=True, return_counts=True
    )
    rank = np.arange(order.size) - np.repeat(begin, size)
    _, first, key = np.unique(
        place * order.size + rank // TOGETHER, return_index=True, return_inverse=True
    )
    count, owner = np.bincount(key).astype(np.float64)[:, None], place[first]
    total = summed(owner, count)
    about = []
    for half in (0, 1):
        row = summed(key, rows.halves[order, half]) / count
        about.append(np.sqrt(0.5 * count) * (row - (summed(owner, row * count) / total)[owner]))
    whole = np.column_stack([rows.columns, rows.known, rows.gap])[order]
    values = np.vstack([*about, summed(place, whole) / np.sqrt(total)])
    fold, kind = np.divmod(np.concatenate([stretches[owner], stretches[owner], stretches]), kinds)
    of_mean = np.repeat([0, 1], [2 * owner.size, stretches.size])
    order = np.argsort(fold, kind="stable")
    return values[order], fold[order], kind[order], of_mean[order]


class StageProblem(msgspec.Struct, frozen=True):
    """Powers of stages as a problem of `search`: whitened columns, nuisances and gap, `rows` (n, k
    + q + 1) [1], in groups of one fold each, (n,). `rarer` are suspects that the rig file knows
    better than others.
    """

    suspects: Suspects
    rows: Signal
    groups: Index
    rarer: frozenset[str] = frozenset()

    @property
    def begins(self) -> dict[str, tuple[float, ...]]:
        """None: the problem is linear."""
        return {}

    @property
    def exclusive(self) -> tuple[Together, ...]:
        """None."""
        return ()

    def price(self, name: str) -> float:
        """Logarithm of the number of suspects, and more for what the rig file states with its
        uncertainty [1].
        """
        return math.log(max(len(self.suspects), 2)) + (RARER if name in self.rarer else 0.0)

    @property
    def nuisances(self) -> int:
        """Number of what is known within an uncertainty."""
        return int(self.rows.shape[1]) - len(self.suspects) - 1

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        nu: Signal,
        _near: Sequence[ActiveEffect] | None = None,
        _serves: float = 0.0,
    ) -> Signal:
        """Measured minus predicted coefficients of several sets of effects, (n, sets)."""
        names = list(self.suspects)
        left = self.rows[:, -1] - self.rows[:, len(names) : -1] @ nu
        found = np.repeat(left[:, None], len(several), axis=1)
        for k, effects in enumerate(several):
            columns = [names.index(one.effect.name) for one in effects]
            found[:, k] -= self.rows[:, columns] @ np.array([one.values[0] for one in effects])
        return found

    def nuisance_columns(self, _effects: Sequence[ActiveEffect], _nu: Signal) -> Columns:
        """Those of the rows."""
        return Columns(self.rows[:, len(self.suspects) : -1], csr_array((len(self.rows), 0)))


class StageFit(msgspec.Struct, frozen=True):
    """What a search found for the whitened `rows` that take part in choice and fit, and the
    probability of the sets.
    """

    data: StageData
    noise: StageNoise
    rows: Signal
    found: Found
    probability: dict[Names, float]

    def columns_of(self, fit: Fit) -> list[int]:
        """Columns of the suspects of a fit, in their order."""
        return [self.data.names.index(name) for name in fit.names]

    def power(self, rows: StageRows, fit: Fit) -> Signal:
        """What the numbers of a fit add to the power that comes out, (m,). [W]"""
        found: Signal = rows.columns[:, self.columns_of(fit)] @ fit.x
        return found

    def covariance(self, fit: Fit) -> Signal:
        """Covariance of the numbers of a fit, (k, k)."""
        return posterior_of(self.found, fit).covariance

    def residual(self, fit: Fit) -> Signal:
        """Measured minus predicted power of the judged rows, (m,) [W].

        Withheld ones by the fit as it is, others by that without their fold, which follows from the
        quadratic about the fit.
        """
        rows, columns, size, groups = (
            self.data.judged,
            self.columns_of(fit),
            fit.x.size,
            self.found.problem.groups,
        )
        left: Signal = rows.gap - self.power(rows, fit) - rows.known @ fit.nu
        if self.data.withheld.any() or not (fit.names or fit.nu.size):
            return left
        design = np.hstack([self.rows[:, columns], self.rows[:, len(self.data.names) : -1]])
        there = np.hstack([rows.columns[:, columns], rows.known])
        weighted, fold = design * weights(fit.z)[:, None], folds_of(rows.blocks.cycle)
        whole = weighted.T @ design + np.diag([*fit.free.sd**-2.0, *np.ones(fit.nu.size)])
        for g in range(int(fold.max()) + 1):
            out, here = groups == g, fold == g
            change = -np.linalg.solve(
                whole - weighted[out].T @ design[out], weighted[out].T @ fit.z[out]
            )
            change[:size] = (
                np.clip(fit.x + change[:size], fit.free.minimum, fit.free.maximum) - fit.x
            )
            left[here] -= there[here] @ change
        return left


def fit_of(data: StageData) -> StageFit:
    """Search the suspects that explain the rows that take part in choice and fit, and weigh sets of
    them.
    """
    noise = noise_of(data, data.fitted)
    rows = noise.whitened(noise.variance)
    rows = rows / math.sqrt(_dependence(data, rows, noise.fold))
    known = (name for name, one in data.laws.items() if one.stated is not None or one.known)
    problem = StageProblem(data.suspects, rows, noise.fold, frozenset(known))
    found = linear_search(problem, pruned=not data.beside_model)
    sets = _sets(data.names, found)
    return StageFit(data, noise, rows, found, probabilities(found.expansion.rated(sets)))


def linear_search(problem: StageProblem, *, pruned: bool = True) -> Found:
    """Find the set with the most evidence of a linear problem: in closed form about the fit of all
    suspects, whose residuals show the noise, and then about the best set itself.

    Parameters
    ----------
    pruned : sets are also pruned from all suspects, not only grown. Beside a model, whose gap is
        small, a pruned set would be one of large laws that cancel each other but for that gap.
    """
    marginal, every = (
        marginal_about(problem, [], np.zeros(problem.nuisances)),
        tuple(sorted(problem.suspects)),
    )
    full, expansion = expand(
        problem, marginal, every, _least_squares(problem, marginal, every), 1.0
    )
    expansion = msgspec.structs.replace(expansion, evidence=Evidence(problem, full.scale))
    begins = [(), _pruned(expansion, every)] if pruned else [()]
    worth = expansion.worth([_climbed(expansion, begin) for begin in begins])
    best = max(worth, key=worth.__getitem__)
    for _ in range(ROUNDS):
        fit, expansion = expand(
            problem, marginal, best, _least_squares(problem, marginal, best), full.scale
        )
        further = _climbed(expansion, best)
        if further == best:
            break
        best = further
    centre = Centre(fit, expansion, marginal)
    fits = {(): fit_set(problem, marginal, ()), fit.names: fit}
    return Found(fit, fits, expansion, marginal, {fit.names: centre})


def most_probable(fit: StageFit) -> StageFit:
    """The fit of the most probable set: for a prediction no law needs clearly more evidence than
    another.
    """
    found, names = fit.found, max(fit.probability, key=lambda names: fit.probability[names])
    if names == found.best.names:
        return fit
    problem = found.problem
    assert isinstance(problem, StageProblem)
    begin = _least_squares(problem, found.marginal, names)
    best, expansion = expand(problem, found.marginal, names, begin, found.scale)
    found.fits[names] = best
    return msgspec.structs.replace(
        fit, found=msgspec.structs.replace(found, best=best, expansion=expansion)
    )


def _least_squares(problem: StageProblem, marginal: Marginal, names: Names) -> dict[str, Signal]:
    """Fields of a set by least squares within their bounds, for a robust fit to begin from."""
    free, names_of_columns = (
        freedom(*(problem.suspects[name] for name in names)),
        [*problem.suspects],
    )
    columns = marginal(problem.rows[:, [names_of_columns.index(name) for name in names]])
    curve = columns.T @ columns + np.diag(free.sd**-2.0)
    x = minimum_within(curve, columns.T @ marginal(problem.rows[:, -1]), free.minimum, free.maximum)
    return {name: x[k : k + 1] for k, name in enumerate(names)}


def _pruned(expansion: Expansion, names: Names) -> Names:
    """A set without the suspects that its closed form does not need, one after the other."""
    while names:
        worth = expansion.worth([names, *(tuple(n for n in names if n != gone) for gone in names)])
        least = worth.pop(names)
        fewer = max(worth, key=worth.__getitem__)
        if worth[fewer] < least:
            return names
        names = fewer
    return names


def _climbed(expansion: Expansion, names: Names) -> Names:
    """The best set by the closed form that single steps lead to from another."""
    while (top := next(iter(neighbours(expansion, names)))) != tuple(sorted(names)):
        names = top
    return tuple(sorted(names))


def _sets(names: Sequence[str], found: Found) -> list[Names]:
    """Every set of a few suspects; of many, the sets near the best one and all that were fitted."""
    if len(names) <= SUSPECTS_OF_EVERY_SET:
        return [
            tuple(sorted(one))
            for size in range(len(names) + 1)
            for one in combinations(names, size)
        ]
    best = found.best.names
    near = neighbours(found.expansion, best)
    return list(dict.fromkeys((best, (), *near, *found.sets())))


def independent(columns: Signal, precision: Signal) -> Signal:
    """Inverse of the squares of columns, (k, k) from (n, k), where they may depend on each other
    and differ in size.

    Parameters
    ----------
    precision : (k,) of what is known of each coefficient
    """
    size = np.sqrt(np.sum(columns**2, axis=0) + precision)
    size = np.where(size > 0.0, size, 1.0)
    scaled = columns / size
    square = scaled.T @ scaled + np.diag(precision / size**2)
    inverse: Signal = np.linalg.pinv(square, rcond=DIRECTION_MIN, hermitian=True) / np.outer(
        size, size
    )
    return inverse


def _dependence(data: StageData, rows: Signal, fold: Index) -> float:
    """Number of whitened coefficients for each independent one, at least 1: scores of whole folds
    against the curvature (the composite likelihood of Pauli, Racugno and Ventura 2011).
    """
    plain, gap = np.flatnonzero(data.plain), rows[:, -1]
    known = np.arange(len(data.names), rows.shape[1] - 1)
    columns = rows[:, np.concatenate([plain, known])]
    inverse = independent(columns, np.concatenate([np.zeros(plain.size), np.ones(known.size)]))
    left = gap - columns @ (inverse @ (columns.T @ gap))
    laws = columns[:, : plain.size]
    inner = independent(laws, np.zeros(plain.size))
    scores = np.zeros((int(fold.max()) + 1, plain.size))
    np.add.at(scores, fold, laws * left[:, None])
    spread, count = float(np.sum(scores @ inner * scores)), float(np.trace(inner @ laws.T @ laws))
    return max(len(scores) / (len(scores) - 1.0) * spread / max(count, 1.0), 1.0)
