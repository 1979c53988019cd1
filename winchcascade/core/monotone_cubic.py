"""Monotone cubics through samples, which neither overshoot nor ring between them.

`scipy.interpolate` has them too; its import takes longer than the simulation of a log.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.run import Signal


class MonotoneCubic(NamedTuple):
    """A cubic in each interval between knots; the first and the last one go on beyond the ends.

    Parameters
    ----------
    knots : (k,), rising
    coefficients : (4, k - 1, ...), those of each interval from the constant one on, of the distance
        from its first knot
    """

    knots: Signal
    coefficients: Signal

    def __call__(self, at: Signal | Sequence[float] | float) -> Signal:
        """Values at some places; a last axis holds those of several curves."""
        distance, (constant, linear, square, cube) = self._intervals(at)
        values: Signal = (
            constant + linear * distance + square * distance**2 + cube * (distance**2 * distance)
        )
        return values

    def slope(self, at: Signal | Sequence[float] | float) -> Signal:
        """Slopes at some places."""
        distance, (_, linear, square, cube) = self._intervals(at)
        slopes: Signal = linear + square * distance * 2.0 + cube * distance**2 * 3.0
        return slopes

    def _intervals(self, at: Signal | Sequence[float] | float) -> tuple[Signal, Signal]:
        """Distance of each place from the knot before it, and the coefficients there."""
        place = np.asarray(at, dtype=np.float64)
        before = np.searchsorted(self.knots[1:-1], place, side="right")
        found = self.coefficients.take(before, axis=1)
        return _beside(place - self.knots[before], found[0]), found


def monotone_cubic(
    knots: Signal | Sequence[float], values: Signal | Sequence[float]
) -> MonotoneCubic:
    """Lay a monotone cubic through values at knots (Fritsch and Butland 1984).

    Parameters
    ----------
    knots : (k,), at least two, which rise
    values : (k, ...), of one curve or several

    Examples
    --------
    >>> curve = monotone_cubic([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0])
    >>> curve([0.5, 1.5, 2.5]).tolist(), curve.slope(1.5).item()
    ([0.0, 0.5, 1.0], 1.5)
    """
    x, y = np.asarray(knots, dtype=np.float64), np.asarray(values, dtype=np.float64)
    width = _beside(np.diff(x), y)
    secant = np.diff(y, axis=0) / width
    slope = np.concatenate(
        [
            _end_slope(width, secant),
            _inner_slopes(width, secant),
            _end_slope(width[::-1], secant[::-1]),
        ]
    )
    bend = (slope[:-1] + slope[1:] - 2.0 * secant) / width
    square = (secant - slope[:-1]) / width - bend
    return MonotoneCubic(x, np.array([y[:-1], slope[:-1], square, bend / width]))


def _beside(x: Signal, y: Signal) -> Signal:
    """An array with axes of length one behind its own, as many as another has."""
    return x.reshape(x.shape + (1,) * (y.ndim - x.ndim))


def _inner_slopes(width: Signal, secant: Signal) -> Signal:
    """Slopes between two intervals: the weighted harmonic mean of both secants, zero at an
    extreme.
    """
    rising = np.sign(secant[:-1]) * np.sign(secant[1:]) > 0.0
    before, after = (np.where(rising, side, 1.0) for side in (secant[:-1], secant[1:]))
    first, second = width[:-1] + 2.0 * width[1:], 2.0 * width[:-1] + width[1:]
    inverse = (first / before + second / after) / (first + second)
    return np.where(rising, 1.0 / inverse, 0.0)


def _end_slope(width: Signal, secant: Signal) -> Signal:
    """Slope at the first knot, (1, ...): that of the parabola through three knots, as far as it
    keeps the shape.
    """
    if len(width) == 1:
        return secant
    (one, other), (own, next_one) = width[:2], secant[:2]
    slope = ((2.0 * one + other) * own - one * next_one) / (one + other)
    turns = np.sign(own) != np.sign(next_one)
    kept = np.where(turns & (np.abs(slope) > 3.0 * np.abs(own)), 3.0 * own, slope)
    return np.where(np.sign(slope) == np.sign(own), kept, 0.0)[np.newaxis]
