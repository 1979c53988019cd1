"""The local quadratic that smooths a signal, on even and on uneven stamps."""

from __future__ import annotations

from functools import partial

import numpy as np

from winchcascade.core.integrate import BLOCK, usual_interval
from winchcascade.core.run import Index, Mask, Signal

EVEN = 0.05
"""Intervals that differ from the usual one by less than this share count as even: the fit moves
by far less than noise.
"""

_CELLS = 2_000_000
"""Size of the matrices in which uneven stretches are fitted, so that a long log needs no more
memory than a short one.
"""

_MAX_NEIGHBOURS = 1000
"""Neighbours that a quadratic is fitted to: stamps that crowd would cost the square of their
number.
"""


def local_quadratic(t: Signal, x: Signal, width: float) -> Signal:
    """Smooth a signal by a quadratic fitted around each sample (Savitzky and Golay 1964), at that
    sample's stamp.

    Evenly stamped stretches are convolved; near gaps, uneven stamps and both ends the quadratic is
    fitted to the stamps that lie within half a width on either side.

    Parameters
    ----------
    t, x : (n,) stamps that rise [s], and a finite signal, (n,), or several, (m, n)
    width : whole width of the neighbourhood [s]

    Returns
    -------
    the smoothed signals as x, in its units

    Examples
    --------
    >>> t = np.arange(9.0)
    >>> bool(np.allclose(local_quadratic(t, t**2, 4.0), t**2))
    True
    """
    if t.size < 3:
        return x.copy()
    usual = usual_interval(t)
    half = int(width / 2 / usual + 1e-6)
    if half < 1:
        return x.copy()
    if t.size > 2 * half:  # a width of more intervals than the log has would make as many weights
        smooth = partial(np.convolve, v=smoothing_weights(half), mode="same")
        smoothed = smooth(x) if x.ndim == 1 else np.stack([smooth(row) for row in x])
    else:
        smoothed = x.copy()
    by_fit = _near(_uneven(t, usual), half, t.size)
    smoothed[..., by_fit] = _fit(t, x, by_fit, max(width / 2, usual) * (1 + 1e-6))
    return smoothed


def smoothing_weights(half: int) -> Signal:
    """Weights of the value at the middle of 2 half + 1 even samples (Savitzky and Golay 1964,
    Table I).
    """
    k = np.arange(-half, half + 1.0)
    weights = 3.0 * (3.0 * half * half + 3.0 * half - 1.0 - 5.0 * k * k)
    return weights / ((2.0 * half - 1.0) * (2.0 * half + 1.0) * (2.0 * half + 3.0))


def evenly_stamped(t: Signal, half: int) -> Mask:
    """Samples with `half` neighbours on either side, all at the usual interval, (n,)."""
    even = np.ones(t.size, dtype=bool)
    even[_near(_uneven(t, usual_interval(t)), half, t.size)] = False
    return even


def _uneven(t: Signal, usual: float) -> Index:
    """Intervals that are not the usual one, block by block, so that a long log needs no more
    memory.
    """
    starts = range(0, t.size - 1, BLOCK)
    deviations = (np.abs(np.diff(t[start : start + BLOCK + 1]) - usual) for start in starts)
    return np.concatenate(
        [np.flatnonzero(d > EVEN * usual) + k for k, d in zip(starts, deviations, strict=True)]
    )


def _near(breaks: Index, half: int, n: int) -> Index:
    """Indices of the samples whose neighbourhood holds an uneven interval or an end of the log."""
    near = np.zeros(n, dtype=bool)
    if breaks.size:
        touched = np.zeros(n + 1, dtype=np.int32)
        np.add.at(touched, np.maximum(breaks + 1 - half, 0), 1)
        np.add.at(touched, np.minimum(breaks + 1 + half, n), -1)
        near = np.cumsum(touched[:-1]) > 0
    near[:half] = True
    near[-half:] = True
    return np.flatnonzero(near)


def _fit(t: Signal, x: Signal, where: Index, half_width: float) -> Signal:
    """Value, at each sample, of the quadratic through its neighbours within `half_width` [s]; of
    many every so-manyth.
    """
    first = np.searchsorted(t, t[where] - half_width, side="left")
    last = np.searchsorted(t, t[where] + half_width, side="right")
    every = np.maximum(-(-(last - first) // _MAX_NEIGHBOURS), 1)
    maximum = int((-(-(last - first) // every)).max(initial=1))
    fitted = np.empty((*x.shape[:-1], where.size))
    rows = max(1, _CELLS // maximum)
    for start in range(0, where.size, rows):
        block = slice(start, start + rows)
        index = first[block, None] + every[block, None] * np.arange(maximum)
        inside = index < last[block, None]
        index = np.minimum(index, t.size - 1)
        u = np.where(inside, (t[index] - t[where[block], None]) / half_width, 0.0)
        y = np.where(inside, x[..., index], 0.0)
        fitted[..., block] = _value_at_zero(u, y, inside, x[..., where[block]])
    return fitted


def _value_at_zero(u: Signal, y: Signal, inside: Mask, otherwise: Signal) -> Signal:
    """Constant of the least-squares quadratic in u, row by row; `otherwise` where fewer than
    three points determine it.
    """
    s0 = inside.sum(axis=1).astype(np.float64)
    s1, s2, s3, s4 = (np.sum(u**k, axis=1) for k in (1, 2, 3, 4))
    b0, b1, b2 = y.sum(axis=-1), np.sum(u * y, axis=-1), np.sum(u * u * y, axis=-1)
    minor_0, minor_1, minor_2 = s2 * s4 - s3 * s3, s1 * s4 - s2 * s3, s1 * s3 - s2 * s2
    determinant = s0 * minor_0 - s1 * minor_1 + s2 * minor_2
    sound = determinant > 1e-9 * s0**3
    return np.where(
        sound,
        (b0 * minor_0 - b1 * minor_1 + b2 * minor_2) / np.where(sound, determinant, 1.0),
        otherwise,
    )
