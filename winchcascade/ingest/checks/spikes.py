"""Single-sample spikes: one sample far off while its neighbours go on as if it were not there.

Longer ones are found by `glitches`, which begins at the same bends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.integrate import ENOUGH, positive_median, quantile

if TYPE_CHECKING:
    from winchcascade.core.run import Index, Mask, Signal


LEAST_SHARE = 0.019
"""A spike is at least this share of the range in which the channel moves."""

NOISE = 5.0
"""And so many times the usual curvature of the whole log; of white noise these are 8.3 standard deviations."""

APART = 3.0
"""And so many times what three in four curvatures around it stay below; ringing has neighbours as large as itself."""

AGREE = 0.3
"""Without it, its two neighbours on either side lie on a line within this share of it: no step, no overshoot."""

AROUND = 12
"""Samples on either side that it is compared with."""

ALONG = 5
"""Samples on either side whose usual change is the slope of the line."""

NEAR = 6
"""Neighbours are at most so many samples away where the channel has holes."""

_BLOCK = 1 << 16

_ROWS = _BLOCK // 8

_END = 64


class Bends(msgspec.Struct, frozen=True):
    """Where a channel bends sharply: its finite samples, their places in the log (None: all), the ends of the range in
    which it moves, its usual curvature, and the samples that stand off the middle of their neighbours by more than `least`."""

    x: Signal
    place: Index | None
    low: float
    high: float
    noise: float
    found: Index

    @property
    def span(self) -> float:
        """Range in which the channel moves."""
        return self.high - self.low

    @property
    def least(self) -> float:
        """What no spike stays below."""
        return max(LEAST_SHARE * self.span, NOISE * self.noise)

    def logged(self, index: Index) -> Index:
        """Places in the log of finite samples."""
        return index if self.place is None else self.place[index]


def find_bends(x: Signal) -> Bends:
    """Find where a channel bends sharply; x NaN where it has holes, which are left out."""
    place = None
    if not np.isfinite(x.sum()):
        place = np.flatnonzero(np.isfinite(x))
        x = x[place]
    if x.size < 4 * AROUND:
        return Bends(x, place, 0.0, 0.0, 0.0, np.empty(0, dtype=np.intp))
    low, high = _range(x)
    noise = positive_median(np.abs(np.diff(x[:ENOUGH], 2)))
    return Bends(x, place, low, high, noise, _candidates(x, max(LEAST_SHARE * (high - low), NOISE * noise)))


def single_spikes(bends: Bends) -> Index:
    """Find single-sample spikes among the bends of a channel, as indices of its finite samples."""
    x, found, least = bends.x, bends.found, bends.least
    if x.size < 4 * AROUND:
        return found
    inside = found[_stands_out(x, found, least)] if found.size else found
    ends = ([0] if _begins(x, least) else []), ([x.size - 1] if _begins(x[::-1], least) else [])
    spikes: Index = np.concatenate((ends[0], inside, ends[1])).astype(np.intp)
    if bends.place is None:
        return spikes
    good = bends.place
    near = good[np.minimum(spikes + 1, good.size - 1)] - good[np.maximum(spikes - 1, 0)] <= NEAR
    return spikes[near]


def _begins(x: Signal, least: float) -> bool:
    """Whether the first sample is a spike, held against the mirrored beginning of the log."""
    beginning = x[: 4 * AROUND]
    mirrored = np.concatenate((beginning[2:0:-1], beginning))
    return bool(_stands_out(mirrored, np.array([2]), least)[0])


def _range(x: Signal) -> tuple[float, float]:
    """Range in which a channel moves, a few wild values left out."""
    some = x[:: max(1, x.size // 20_000)]
    return quantile(some, 0.005), quantile(some, 0.995)


def _candidates(x: Signal, least: float) -> Index:
    """Samples that lie off the middle of their two neighbours by at least `least`, block by block."""
    found = []
    for start in range(0, x.size - 2, _BLOCK):
        part = x[start : start + _BLOCK + 2]
        step = np.diff(part)
        found.append(np.flatnonzero(np.abs(step[1:] - step[:-1]) > 2 * least) + start + 1)
    return np.concatenate(found)


def _stands_out(x: Signal, found: Index, least: float) -> Mask:
    """Whether each candidate exceeds the curvatures around it by far, on a line through its neighbours."""
    around = np.concatenate((np.arange(-AROUND, -1), np.arange(2, AROUND + 1)))
    line = np.concatenate((np.arange(-ALONG, -1), np.arange(1, ALONG)))
    keep = np.zeros(found.size, dtype=bool)
    for start in range(0, found.size, _ROWS):
        k = found[start : start + _ROWS]
        centre = _within(k[:, None] + around, 1, x.size - 2)
        place = int(0.75 * (centre.shape[1] - 1))  # the upper quartile of the curvatures around
        calm = APART * np.partition(np.abs(x[centre - 1] - 2 * x[centre] + x[centre + 1]), place, axis=1)[:, place]
        along = _within(k[:, None] + line, 0, x.size - 2)
        slope = _middle(x[along + 1] - x[along])
        off = np.abs(x[k] - 0.5 * (x[k - 1] + x[k + 1]))
        before = x[k - 1] - x[np.maximum(k - 2, 0)] - slope
        after = x[np.minimum(k + 2, x.size - 1)] - x[k + 1] - slope
        step = x[k + 1] - x[k - 1] - 2 * slope
        bent = np.maximum(np.maximum(np.abs(before), np.abs(after)), np.abs(step))
        keep[start : start + k.size] = (off > np.maximum(least, calm)) & (bent < AGREE * off)
    return keep


def _within(place: Index, first: int, last: int) -> Index:
    """Take what lies beyond an end of the log from beyond the other side of the surrounding."""
    place = np.where(place < first, place + 2 * AROUND + 1, place)
    within: Index = np.where(place > last, place - 2 * AROUND - 1, place)
    return within


def _middle(rows: Signal) -> Signal:
    place = rows.shape[1] // 2
    part = np.partition(rows, (place - 1, place), axis=1)
    middle: Signal = 0.5 * (part[:, place - 1] + part[:, place])
    return middle
