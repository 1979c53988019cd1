"""Gauss-Newton with priors, bounds and a convex robust loss: the fit of nuisances and of the numbers of some effects."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

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
    found: Signal = HUBER / np.maximum(np.abs(z), HUBER)
    return found


class Quadratic(msgspec.Struct, frozen=True):
    """A fit's objective near a place, with the nuisances done away with.

    `curve` (k, k) and `slope` (k,) are those of the effects' numbers; `back` (n, k) and `own` (n,) give the nuisances that
    belong to a step of these, `inner` (n, n) is the nuisances' own curvature with their prior.
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


def bounded_step(q: Quadratic, low: Signal, high: Signal) -> tuple[Signal, Signal]:
    """Best step of the effects' numbers within bounds, (k,), and of the nuisances, (n,)."""
    phi = box_minimum(q.curve, q.slope, low, high)
    return phi, q.own - q.back @ phi


def joint_step(
    z: Signal, w: Signal, columns: tuple[Signal, Signal], nu: Signal, bounds: tuple[Signal, Signal], reach: float
) -> tuple[Signal, Signal]:
    """Best step of the effects' numbers within bounds and of the nuisances within a reach, (k,) and (n,).

    Parameters
    ----------
    columns : of the effects' numbers and of the nuisances
    bounds : (k,) each, least and largest step of the effects' numbers
    reach : largest magnitude of a nuisance, in units of its tolerance
    """
    j = np.hstack(columns)
    k = columns[0].shape[1]
    prior = np.concatenate((np.zeros(k), np.ones(nu.size)))
    curve = (j * w[:, None]).T @ j + np.diag(prior)
    slope = (j * w[:, None]).T @ z - np.concatenate((np.zeros(k), nu))
    low, high = (np.concatenate((end, side * reach - nu)) for end, side in zip(bounds, (-1.0, 1.0), strict=True))
    step = box_minimum(curve, slope, low, high)
    return step[:k], step[k:]


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
    step: Signal = x / scale
    return step
