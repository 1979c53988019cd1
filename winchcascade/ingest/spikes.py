"""Single-sample spikes: one sample far off while its neighbours agree."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.order import median, quantile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Signal

    Index = NDArray[np.intp]

LEAST_SHARE = 0.02
"""A spike is at least this share of the range in which the channel moves."""

NOISE = 8.0
"""And so many times the usual change from sample to sample, in the whole log and around it."""

APART = 6.0
"""And so many times what three in four curvatures around it stay below; ringing has neighbours as large as itself."""

AGREE = 0.3
"""Its two neighbours on either side differ from each other by less than this share of it: no step, no overshoot."""

AROUND = 12
"""Samples on either side that it is compared with."""

_BLOCK = 1 << 16

_ENOUGH = 400_000
"""Samples at the beginning of a log that say how noisy a channel is."""


def find_spikes(x: Signal) -> Index:
    """Find single samples far off both neighbours, which agree with each other, in a calm surrounding.

    Parameters
    ----------
    x : (n,) a channel; NaN is never a spike nor a neighbour of one

    Examples
    --------
    >>> x = np.sin(np.arange(100) / 10)
    >>> x[40] += 3
    >>> find_spikes(x).tolist()
    [40]
    """
    if x.size < 2 * AROUND:
        return np.empty(0, dtype=np.intp)
    least = max(LEAST_SHARE * _span(x), NOISE * _usual_change(x))
    found = _candidates(x, least)
    found = found[(found >= 2) & (found < x.size - 2)]
    return found[_stands_out(x, found)] if found.size else found


def _span(x: Signal) -> float:
    """Range in which a channel moves, a few wild values left out."""
    some = x[:: max(1, x.size // 20_000)]
    some = some[np.isfinite(some)]
    if some.size == 0:
        return 0.0
    return quantile(some, 0.995) - quantile(some, 0.005)


def _usual_change(x: Signal) -> float:
    """Median change from sample to sample where there is any: the noise of the channel."""
    some = np.abs(np.diff(x[:_ENOUGH]))
    some = some[some > 0]
    return median(some) if some.size else 0.0


def _candidates(x: Signal, least: float) -> Index:
    """Samples that lie to one side of both neighbours by at least `least`, block by block."""
    found = []
    for start in range(0, x.size - 2, _BLOCK):
        part = x[start : start + _BLOCK + 2]
        step = np.diff(part)
        large = np.abs(step) > least
        there = np.flatnonzero(large[:-1] & large[1:])
        before, back = step[there], -step[there + 1]
        off = np.minimum(np.abs(before), np.abs(back))
        found.append(there[(before * back > 0) & (np.abs(before - back) < AGREE * off)] + start + 1)
    return np.concatenate(found)


def _stands_out(x: Signal, found: Index) -> NDArray[np.bool_]:
    """Whether each candidate exceeds the changes and curvatures around it by far."""
    offset = np.concatenate((np.arange(-AROUND, -1), np.arange(2, AROUND + 1)))
    keep = np.zeros(found.size, dtype=bool)
    for start in range(0, found.size, _BLOCK // 8):
        block = found[start : start + _BLOCK // 8]
        centre = np.clip(block[:, None] + offset, 1, x.size - 2)
        curvature = np.abs(x[centre - 1] - 2 * x[centre] + x[centre + 1])
        change = np.abs(x[centre + 1] - x[centre])
        off = np.abs(x[block] - 0.5 * (x[block - 1] + x[block + 1]))
        calm = APART * _upper_quartile(curvature)
        quiet = NOISE * np.median(np.where(np.isfinite(change), change, 0.0), axis=1)
        sides = np.maximum(np.abs(x[block - 1] - x[block - 2]), np.abs(x[block + 1] - x[block + 2]))
        keep[start : start + block.size] = (2 * off > calm) & (off > quiet) & ~(sides >= AGREE * off)
    return keep


def _upper_quartile(curvature: Signal) -> Signal:
    filled = np.where(np.isfinite(curvature), curvature, 0.0)
    place = int(0.75 * (filled.shape[1] - 1))
    quartile: Signal = np.partition(filled, place, axis=1)[:, place]
    return quartile
