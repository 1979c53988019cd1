"""Gauss-Newton with priors, bounds and a convex robust loss: the fit of nuisances and of the fields of some effects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import msgspec
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal

HUBER = 3.0
"""Whitened residuals beyond this count by their magnitude, not by their square (Huber 1964)."""


WILD = 1e6
"""A residual counts as no larger than this, and so does one of numbers with which nothing can be simulated."""


def huber(z: Signal) -> float:
    """Robust half sum of squares of whitened residuals. [1]"""
    size = np.minimum(np.nan_to_num(np.abs(z), nan=WILD, posinf=WILD), WILD)
    return float(np.sum(np.where(size <= HUBER, 0.5 * size * size, HUBER * (size - 0.5 * HUBER))))


def weights(z: Signal) -> Signal:
    """Weights with which least squares follow `huber`, (n,)."""
    return np.asarray(HUBER / np.maximum(np.abs(z), HUBER))


class Local(msgspec.Struct, frozen=True):
    """Columns of numbers that concern some rows of a problem alone.

    `columns` (m, q) belong to the rows `rows`, (m,). Number `at[i]` of the problem has the column `take[i]` of them: one column
    may serve several numbers, whose sum then counts.
    """

    rows: NDArray[np.intp]
    columns: Signal
    at: NDArray[np.intp]
    take: NDArray[np.intp]


class Jacobian(msgspec.Struct, frozen=True):
    """Derivative of a prediction over `size` numbers: columns that are dense, and those of numbers that concern few rows.

    `dense` (n, k) are the columns of the numbers `at`, (k,). No number is in both. The rows of the `local` parts, if there are
    any, are together all n.
    """

    size: int
    dense: Signal
    at: NDArray[np.intp]
    local: Sequence[Local] = ()

    @classmethod
    def of(cls, dense: Signal) -> Jacobian:
        """One of dense columns alone, (n, k)."""
        return cls(dense.shape[1], dense, np.arange(dense.shape[1]))

    def beside(self, dense: Signal) -> Jacobian:
        """This one with further numbers behind its own, whose columns are dense, (n, k)."""
        more = np.arange(self.size, self.size + dense.shape[1])
        return Jacobian(
            self.size + more.size, np.hstack([self.dense, dense]), np.concatenate((self.at, more)), self.local
        )

    def split(self, first: int) -> tuple[Jacobian, Signal]:
        """The numbers before `first`, and the dense columns of the others, (n, k)."""
        own = self.at < first
        return Jacobian(first, self.dense[:, own], self.at[own], self.local), self.dense[:, ~own]

    def weighted(self, rows: Signal) -> Jacobian:
        """This one with each row times a weight, (n,)."""
        local = [msgspec.structs.replace(part, columns=part.columns * rows[part.rows, None]) for part in self.local]
        return Jacobian(self.size, self.dense * rows[:, None], self.at, local)

    def normal(self, w: Signal) -> Signal:
        """Columns times columns, each row weighted, (size, size) for weights (n,), which are not negative."""
        found, root = np.zeros((self.size, self.size)), np.sqrt(w)
        if not self.local:
            found[np.ix_(self.at, self.at)] = _squared(self.dense * root[:, None])
        for part in self.local:
            product = _squared(np.hstack([self.dense[part.rows], part.columns]) * root[part.rows, None])
            take = np.concatenate((np.arange(self.at.size), self.at.size + part.take))
            at = np.concatenate((self.at, part.at))
            found[np.ix_(at, at)] += product[np.ix_(take, take)]
        return found

    def summed(self, rows: Signal) -> Signal:
        """Rows (n,) times the columns, (size,)."""
        found = np.zeros(self.size)
        found[self.at] = rows @ self.dense
        for part in self.local:
            found[part.at] += (rows[part.rows] @ part.columns)[part.take]
        return found

    def __matmul__(self, step: Signal) -> Signal:
        """What a step of the numbers moves, (n, ...) from (size, ...)."""
        found: Signal = self.dense @ step[self.at]
        for part in self.local:
            own = np.zeros((part.columns.shape[1], *step.shape[1:]))
            np.add.at(own, part.take, step[part.at])
            found[part.rows] += part.columns @ own
        return found


def _squared(columns: Signal) -> Signal:
    """Columns times columns, (k, k) of (n, k): NumPy computes one triangle, as both factors are the same array."""
    return np.asarray(columns.T @ columns)


class Bounds(msgspec.Struct, frozen=True):
    """Bounds of some numbers, (k,) each: `low` and `high` cannot be passed; beyond `inner_low` and `inner_high` the objective
    rises by `rate` for each unit.
    """

    low: Signal
    high: Signal
    inner_low: Signal
    inner_high: Signal
    rate: Signal

    @classmethod
    def of(cls, low: Signal, high: Signal) -> Bounds:
        """Bounds that cannot be passed."""
        return cls(low, high, low, high, np.zeros_like(low))

    def some(self, which: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Bounds:
        """Those of some of the numbers."""
        return Bounds(*(part[which] for part in msgspec.structs.astuple(self)))

    def about(self, x: Signal) -> Bounds:
        """Bounds of a step from x, (k,)."""
        return Bounds(self.low - x, self.high - x, self.inner_low - x, self.inner_high - x, self.rate)

    def beside(self, other: Bounds) -> Bounds:
        """These and others behind them."""
        pairs = zip(msgspec.structs.astuple(self), msgspec.structs.astuple(other), strict=True)
        return Bounds(*(np.concatenate(pair) for pair in pairs))

    def excess(self, x: Signal) -> Signal:
        """By how much numbers lie beyond the inner bounds, (k,)."""
        return np.asarray(np.maximum(x - self.inner_high, 0.0) + np.maximum(self.inner_low - x, 0.0))

    def penalty(self, x: Signal) -> float:
        """What the objective has risen by beyond the inner bounds."""
        return float(self.rate @ self.excess(x)) if self.rate.any() else 0.0


class Quadratic(msgspec.Struct, frozen=True):
    """The objective of a fit near a place, with the nuisances eliminated.

    `curve` (k, k) and `slope` (k,) are those of the fields of effects; `back` (n, k) and `own` (n,) give the nuisances that
    belong to a step of these, `inner` (n, n) is the curvature of the nuisances with their prior.
    """

    curve: Signal
    slope: Signal
    back: Signal
    own: Signal
    inner: Signal


def normal_equations(z: Signal, j: Jacobian, nu: Signal) -> tuple[Signal, Signal]:
    """Curvature (k, k) and slope (k,) of the objective: residuals z minus the columns times a step, the first numbers `nu`
    being nuisances with unit priors about 0.
    """
    w, n = weights(z), nu.size
    curve, slope = j.normal(w), j.summed(w * z)
    curve[np.arange(n), np.arange(n)] += 1.0
    slope[:n] -= nu
    return curve, slope


def quadratic(curve: Signal, slope: Signal, nuisances: int) -> Quadratic:
    """Eliminate the nuisances, which come first, from normal equations."""
    n = nuisances
    inner, across = curve[:n, :n], curve[:n, n:]
    solved = np.linalg.solve(inner, np.column_stack([slope[:n], across])).astype(np.float64)
    own, back = solved[:, 0], solved[:, 1:]
    outer = curve[n:, n:] - across.T @ back
    return Quadratic(0.5 * (outer + outer.T), slope[n:] - across.T @ own, back, own, inner)


def best_step(z: Signal, j: Jacobian, x: Signal, bounds: Bounds, nuisances: int) -> Signal:
    """Step from x, (k,), to the minimum within bounds of the quadratic in which residuals are z minus columns j times it.

    Parameters
    ----------
    nuisances : number of nuisances, which come first; they have unit priors about 0 and rarely reach their bounds, so that
        they are eliminated
    """
    within = bounds.about(x)
    curve, slope = normal_equations(z, j, x[:nuisances])
    step, unbounded = np.zeros(x.size), np.arange(x.size) < nuisances
    while True:
        order = np.argsort(~unbounded, kind="stable")
        q = quadratic(curve[np.ix_(order, order)], slope[order], int(np.sum(unbounded)))
        phi = minimum_within(q.curve, q.slope, within.some(~unbounded))
        step[order] = np.concatenate((q.own - q.back @ phi, phi))
        beyond = unbounded & ((step < within.low) | (step > within.high))
        if not beyond.any():
            return step
        unbounded &= ~beyond


def minimum_within(curve: Signal, slope: Signal, bounds: Bounds) -> Signal:
    """Where x' curve x / 2 - slope' x, with what is added beyond the inner bounds, is least within bounds, (k,).

    Each number lies below, between or above its inner bounds; where the objective falls across one, it changes sides.
    """
    if not bounds.rate.any():
        return box_minimum(curve, slope, bounds.low, bounds.high)
    span = bounds.inner_high - bounds.inner_low
    eps = np.where(np.isfinite(span), 1e-9 * span, 0.0)
    side = np.where(bounds.inner_high < -eps, 1.0, np.where(bounds.inner_low > eps, -1.0, 0.0))
    for _ in range(4 * side.size + 8):
        low = np.where(side > 0.0, bounds.inner_high, np.where(side < 0.0, bounds.low, bounds.inner_low))
        high = np.where(side > 0.0, bounds.high, np.where(side < 0.0, bounds.inner_low, bounds.inner_high))
        x = box_minimum(curve, slope - side * bounds.rate, low, high)
        push = slope - curve @ x
        over = (side == 0.0) & (x >= bounds.inner_high - eps) & (push > bounds.rate) & (bounds.high > bounds.inner_high)
        under = (side == 0.0) & (x <= bounds.inner_low + eps) & (push < -bounds.rate) & (bounds.low < bounds.inner_low)
        back = (side > 0.0) & (x <= bounds.inner_high + eps) & (push < bounds.rate)
        back |= (side < 0.0) & (x >= bounds.inner_low - eps) & (push > -bounds.rate)
        if not (over | under | back).any():
            break
        side = np.where(over, 1.0, np.where(under, -1.0, np.where(back, 0.0, side)))
    return x


def box_minimum(curve: Signal, slope: Signal, low: Signal, high: Signal) -> Signal:
    """Where x' curve x / 2 - slope' x is least within a box, by active sets (Lawson and Hanson 1974)."""
    scale = np.sqrt(np.maximum(np.diag(curve), 1e-300))
    a = curve / np.outer(scale, scale) + 1e-10 * np.eye(scale.size)
    b, lo, hi = slope / scale, low * scale, high * scale
    x = np.clip(np.zeros_like(b), lo, hi)
    free = np.ones(b.size, dtype=bool)
    for _ in range(20 * b.size + 20):
        if free.any():
            wanted = x.copy()
            rest = b[free] - a[np.ix_(free, ~free)] @ x[~free]
            wanted[free] = np.linalg.solve(a[np.ix_(free, free)], rest)
            over = (wanted < lo - 1e-12) | (wanted > hi + 1e-12)
            if over.any():
                bound = np.where(wanted < lo, lo, hi)
                with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                    share = np.where(over, (bound - x) / (wanted - x), math.inf)
                first = int(np.argmin(share))
                x = x + max(float(share[first]), 0.0) * (wanted - x)
                x[first] = bound[first]
                free[first] = False
                continue
            x = wanted
        push = b - a @ x
        wrong = ~free & (((x <= lo) & (push > 1e-9)) | ((x >= hi) & (push < -1e-9)) | ((x > lo) & (x < hi)))
        if not wrong.any():
            break
        free[int(np.argmax(np.where(wrong, np.abs(push), -1.0)))] = True
    return x / scale


class Problem(Protocol):
    """A robust least-squares problem in some numbers x, (k,), of which the first are `nuisances` with unit priors about 0."""

    @property
    def nuisances(self) -> int:
        """How many of the numbers are nuisances."""

    @property
    def bounds(self) -> Bounds:
        """Bounds of the numbers."""

    def residual(self, x: Signal) -> Signal:
        """Whitened residuals, (n,)."""

    def jacobian(self, x: Signal) -> Jacobian:
        """Whitened derivative of what is subtracted from the measured values, over the k numbers."""


class Effort(NamedTuple):
    """Steps of a fit at most, renewals of its columns at most, and what counts as settled and as foreseen.

    A fit has settled when a step improves the objective by less than `settled`; columns are found anew when a step brings less
    than the share `foreseen` of what they promised.
    """

    rounds: int
    renewals: int
    settled: float
    foreseen: float


class Solution(NamedTuple):
    """Where a fit ended: its numbers, the objective with the priors, the residuals, the columns in use, and whether it has
    settled: its columns foresee nothing more.
    """

    x: Signal
    loss: float
    z: Signal
    j: Jacobian
    settled: bool = False


WORN = 2000.0
"""Improvement of the objective, in units of what counts as settled, after which columns are renewed before a fit ends. [1]"""

SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried until one lowers the objective."""


def gauss_newton(problem: Problem, x: Signal, j: Jacobian, effort: Effort) -> Solution:
    """Minimise the robust objective of a problem by Gauss and Newton.

    Parameters
    ----------
    x, j : numbers to begin from and columns there, which serve as long as they foresee what a step brings
    """
    n, renewals, fresh, served = problem.nuisances, effort.renewals, True, 0.0
    here = _solution(problem, x, j)
    for _ in range(effort.rounds):
        step = best_step(here.z, here.j, here.x, problem.bounds, n)
        promised = here.loss - _objective(problem, here.x + step, here.z - here.j @ step)
        tried = (_solution(problem, here.x + share * step, here.j) for share in SHARES)
        there = next((one for one in tried if one.loss < here.loss), here)
        gained, here = here.loss - there.loss, there
        served += gained
        worn = renewals > 0 and served > WORN * effort.settled
        settled = not worn and (promised < effort.settled or (gained > 0.0 and abs(promised - gained) < effort.settled))
        if settled or (gained < effort.settled and (fresh or not renewals) and not worn):
            return here._replace(settled=settled)
        fresh = worn or (renewals > 0 and gained < effort.foreseen * promised)
        if fresh:
            renewals, served = renewals - 1, 0.0
            here = here._replace(j=problem.jacobian(here.x))
    return here


def _solution(problem: Problem, x: Signal, j: Jacobian) -> Solution:
    z = problem.residual(x)
    return Solution(x, _objective(problem, x, z), z, j)


def _objective(problem: Problem, x: Signal, z: Signal) -> float:
    nu = x[: problem.nuisances]
    return huber(z) + 0.5 * float(nu @ nu) + problem.bounds.penalty(x)
