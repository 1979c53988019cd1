"""Bounded quadratic minimisation, of a winch without a model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.core.run import Signal


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
