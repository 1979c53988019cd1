"""Gauss-Newton with priors, bounds and a convex robust loss: the fit of nuisances and of the fields of some effects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import msgspec
import numpy as np

if TYPE_CHECKING:
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


def quadratic(z: Signal, w: Signal, j_nu: Signal, j_phi: Signal, nu: Signal) -> Quadratic:
    """Expand the objective about a place: residuals z minus the columns times a step, nuisances with unit priors about 0."""
    weighted = j_nu * w[:, None]
    inner = weighted.T @ j_nu + np.eye(j_nu.shape[1])
    pull = weighted.T @ z - nu
    across = weighted.T @ j_phi
    own = np.linalg.solve(inner, pull).astype(np.float64)
    back = np.linalg.solve(inner, across).astype(np.float64)
    curve = (j_phi * w[:, None]).T @ j_phi - across.T @ back
    slope = (j_phi * w[:, None]).T @ z - across.T @ own
    return Quadratic(0.5 * (curve + curve.T), slope, back, own, inner)


def best_step(z: Signal, j: Signal, x: Signal, bounds: tuple[Signal, Signal], nuisances: int) -> Signal:
    """Step from x, (k,), to the minimum within bounds of the quadratic in which residuals are z minus columns j times it.

    Parameters
    ----------
    nuisances : the first so many numbers have unit priors about 0 and seldom reach their bounds
    """
    w, n, (low, high) = weights(z), nuisances, (end - x for end in bounds)
    q = quadratic(z, w, j[:, :n], j[:, n:], x[:n])
    phi = box_minimum(q.curve, q.slope, low[n:], high[n:])
    step = np.concatenate((q.own - q.back @ phi, phi))
    if np.all((step >= low)[:n] & (step <= high)[:n]):
        return step
    prior, weighted = (np.arange(x.size) < n).astype(np.float64), (j * w[:, None]).T
    return box_minimum(weighted @ j + np.diag(prior), weighted @ z - prior * x, low, high)


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
                with np.errstate(divide="ignore", invalid="ignore"):
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
    def bounds(self) -> tuple[Signal, Signal]:
        """Lower and upper bound of each number, (k,)."""

    def residual(self, x: Signal) -> Signal:
        """Whitened residuals, (n,)."""

    def jacobian(self, x: Signal) -> Signal:
        """Whitened derivative of what is subtracted from the measured values, (n, k)."""


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
    """Where a fit ended: its numbers, the objective with the priors, the residuals and the columns in use."""

    x: Signal
    loss: float
    z: Signal
    j: Signal


SHARES = (1.0, 0.4, 0.15, 0.05)
"""Shares of a step that are tried until one lowers the objective."""


def gauss_newton(problem: Problem, x: Signal, j: Signal, effort: Effort) -> Solution:
    """Minimise the robust objective of a problem by Gauss and Newton.

    Parameters
    ----------
    x, j : numbers to begin from and columns there, which serve as long as they foresee what a step brings
    """
    n, renewals, fresh = problem.nuisances, effort.renewals, True
    here = _solution(problem, x, j)
    for _ in range(effort.rounds):
        step = best_step(here.z, here.j, here.x, problem.bounds, n)
        promised = here.loss - _objective(here.z - here.j @ step, (here.x + step)[:n])
        tried = (_solution(problem, here.x + share * step, here.j) for share in SHARES)
        there = next((one for one in tried if one.loss < here.loss), here)
        gained, here = here.loss - there.loss, there
        if gained < effort.settled and (fresh or promised < effort.settled or not renewals):
            break
        if gained and abs(promised - gained) < effort.settled:
            break  # as foreseen: this is the minimum
        fresh = renewals > 0 and gained < effort.foreseen * promised
        if fresh:
            renewals -= 1
            here = here._replace(j=problem.jacobian(here.x))
    return here


def _solution(problem: Problem, x: Signal, j: Signal) -> Solution:
    z = problem.residual(x)
    return Solution(x, _objective(z, x[: problem.nuisances]), z, j)


def _objective(z: Signal, nu: Signal) -> float:
    return huber(z) + 0.5 * float(nu @ nu)
