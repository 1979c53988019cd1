"""The monotone cubic between knots: it neither overshoots nor turns where the values do not."""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from winchcascade.core.run import Signal


class MonotoneCubic(msgspec.Struct, frozen=True):
    """A cubic in each interval between knots (k,), as coefficients of rising powers of the distance from its left knot.

    Beyond the knots the first and the last cubic go on. Made by `monotone_cubic`.
    """

    knots: Signal
    coefficients: tuple[Signal, Signal, Signal, Signal]

    def __call__(self, x: ArrayLike) -> Signal:
        """Values at some places, (...)."""
        at, (y, slope, square, cube) = self._cubics(x)
        return y + at * (slope + at * (square + at * cube))

    def slope(self, x: ArrayLike) -> Signal:
        """Slopes at some places, (...)."""
        at, (_, slope, square, cube) = self._cubics(x)
        return slope + at * (2.0 * square + at * 3.0 * cube)

    def _cubics(self, x: ArrayLike) -> tuple[Signal, list[Signal]]:
        """Distance of each place from the knot to its left, and the coefficients there."""
        places = np.asarray(x, dtype=np.float64)
        rows = np.clip(np.searchsorted(self.knots, places, side="right") - 1, 0, self.knots.size - 2)
        found = [coefficient[rows] for coefficient in self.coefficients]
        away = places - self.knots[rows]
        return away.reshape(away.shape + (1,) * (found[0].ndim - away.ndim)), found


def monotone_cubic(knots: ArrayLike, values: ArrayLike) -> MonotoneCubic:
    """Lay a monotone cubic through values (Fritsch and Butland 1984, doi 10.1137/0905021).

    At a knot the slope is the weighted harmonic mean of the slopes of its two intervals, none where those differ in sign; at
    both ends it is that of a parabola through three knots, limited so that the curve stays monotone.

    Parameters
    ----------
    knots : (k,) rising, two at least
    values : (k, ...) one curve for each column

    Examples
    --------
    >>> curve = monotone_cubic([0.0, 1.0, 2.0, 3.0], [0.0, 0.0, 1.0, 1.0])
    >>> curve([0.5, 1.5, 2.5]).tolist()
    [0.0, 0.5, 1.0]
    >>> curve.slope([1.0, 1.5]).tolist()
    [0.0, 1.5]
    """
    x, y = np.asarray(knots, dtype=np.float64), np.asarray(values, dtype=np.float64)
    width = np.diff(x).reshape(-1, *(1,) * (y.ndim - 1))
    rise = np.diff(y, axis=0) / width
    slope = _slopes(width, rise)
    excess = (slope[:-1] + slope[1:] - 2.0 * rise) / width
    return MonotoneCubic(x, (y[:-1], slope[:-1], (rise - slope[:-1]) / width - excess, excess / width))


def _slopes(width: Signal, rise: Signal) -> Signal:
    """Slope at each knot, (k, ...), from widths and slopes of the intervals."""
    if rise.shape[0] == 1:
        return np.concatenate((rise, rise))
    before, after = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        mean = (before + after) / (before / rise[:-1] + after / rise[1:])
    inner = np.where(np.sign(rise[:-1]) * np.sign(rise[1:]) > 0.0, mean, 0.0)
    first = _end_slope(width[0], width[1], rise[0], rise[1])
    last = _end_slope(width[-1], width[-2], rise[-1], rise[-2])
    return np.concatenate((first[None], inner, last[None]))


def _end_slope(width: Signal, next_width: Signal, rise: Signal, next_rise: Signal) -> Signal:
    """Slope at an end of the curve, from its outer two intervals."""
    slope = ((2.0 * width + next_width) * rise - width * next_rise) / (width + next_width)
    limited = np.where((np.sign(rise) != np.sign(next_rise)) & (np.abs(slope) > 3.0 * np.abs(rise)), 3.0 * rise, slope)
    return np.where(np.sign(slope) == np.sign(rise), limited, 0.0)
