"""Single-sample spikes: one sample deviates far from its neighbours, which continue as if it were not there.

Longer ones are found by `glitches`, which begins at the same bends.
"""

from __future__ import annotations

import msgspec
import numpy as np

from winchcascade.core.integrate import (
    ENOUGH,
    positive_median,
    quantile,
    quantiles_in_place,
    smallest_step,
    stretches_of,
)
from winchcascade.core.run import Index, Mask, Signal

MIN_SHARE = 0.019
"""Minimum size of a spike, as a share of the range in which the channel moves. [1]"""

NOISE = 5.0
"""Minimum size of a spike, in usual curvatures of the whole log: of white noise these are 8.3 standard deviations. [1]"""

APART = 3.0
"""Minimum size of a spike over the upper quartile of the curvatures near it: ringing has neighbours as large as itself. [1]"""

AGREE = 0.3
"""Without it, its two neighbours on either side lie on a line within this share of it: no step, no overshoot."""

AROUND = 12
"""Number of samples on either side with which it is compared."""

ALONG = 5
"""Number of samples on either side whose usual change is the slope of the line."""

CALM = 0.05
"""Largest curvature of a line that was filled in, in usual curvatures of the whole log. [1]"""

ROUNDED = 2.0 * (1.0 + 1e-6)
"""And in steps of the resolution, if that is more: each sample of the line is rounded by up to half a step. [1]"""

MIN_CALM = 6
"""Minimum number of samples of such a line. `find_bends` is written for six."""

NEAR = 6
"""Maximum distance of its two neighbours where the channel has holes, in samples."""

SHOWN = 20_000
"""Number of samples that show the range and the noise of a channel."""

UPDATES = 20
"""Smallest number of samples that shows a pattern or a range."""

OTHERS = 0.01
"""Fewer samples than this share do not show what a channel does: it may switch between two values, as a friction does. [1]"""

FAR = 5.0
"""Distance of a value from the range of the channel, in ranges, beyond which it is no measurement. [1]"""

STILL = 20.0
"""Minimum range of a channel over its usual curvature: below it the channel contains only noise. [1]"""

_BLOCK = 1 << 16

_ROWS = _BLOCK // 8


class Usual(msgspec.Struct, frozen=True):
    """What a channel usually does: ends of the range in which it moves, its curvature, and the largest curvature of a line that
    was filled in."""

    low: float
    high: float
    noise: float
    calm: float = 0.0

    @property
    def span(self) -> float:
        """Range in which the channel moves."""
        return self.high - self.low

    @property
    def reach(self) -> float:
        """Distance from that range beyond which a value is no measurement, inf for a channel of noise alone."""
        return FAR * self.span if self.span > STILL * self.noise else float("inf")

    def is_far(self, value: float) -> bool:
        """Whether a value is no measurement."""
        return value < self.low - self.reach or value > self.high + self.reach

    def minimum(self, share: float, noise: float) -> float:
        """Minimum size of a fault: a share of the range, and a multiple of the curvature."""
        return max(share * self.span, noise * self.noise)


class Bends(msgspec.Struct, frozen=True):
    """Where a channel bends sharply, and where it is calm.

    Its finite samples, their places in the log (None: all), what it usually does, the samples that deviate from the middle of
    their neighbours by more than the minimum of a spike, and first and last sample, (k, 2), of the stretches of `MIN_CALM`
    samples or more that bend by no more than a line that was filled in.
    """

    x: Signal
    place: Index | None
    usual: Usual
    found: Index
    calm: Index

    @property
    def minimum(self) -> float:
        """Minimum size of a spike."""
        return self.usual.minimum(MIN_SHARE, NOISE)

    def steps(self, minimum: float, spikes: Index) -> Index:
        """First samples of the steps at the bends that are larger than `minimum`, without those of single spikes."""
        chosen = np.zeros(self.x.size + 1, dtype=bool)  # the step from sample k is at place k + 1
        chosen[np.concatenate((self.found, self.found + 1))] = True
        chosen[np.concatenate((spikes, spikes + 1))] = False
        first = np.flatnonzero(chosen) - 1
        return first[np.abs(self.x[first + 1] - self.x[first]) > minimum]

    def logged(self, index: Index) -> Index:
        """Places in the log of finite samples."""
        return index if self.place is None else self.place[index]

    @property
    def places(self) -> Index:
        """Places in the log of all finite samples."""
        return np.arange(self.x.size) if self.place is None else self.place


def find_bends(x: Signal) -> Bends:
    """Find where a channel bends sharply; x NaN where it has holes, which are left out."""
    place = None
    if not np.isfinite(x.sum()):
        place = np.flatnonzero(np.isfinite(x))
        x = x[place]
    if x.size < 4 * AROUND:
        nowhere = np.empty(0, dtype=np.intp)
        return Bends(x, place, Usual(0.0, 0.0, 0.0), nowhere, nowhere.reshape(0, 2))
    some = x[:: max(1, x.size // SHOWN)]  # without a few wild values
    noise = positive_median(np.abs(np.diff(x[:ENOUGH], 2)))
    low, high = quantiles_in_place(some.copy(), [0.005, 0.995])
    usual = Usual(low, high, noise, max(CALM * noise, ROUNDED * smallest_step(x)))
    found, calm = [], np.zeros(x.size, dtype=bool)  # whether a sample begins a line of `MIN_CALM`
    for start in range(0, x.size - 2, _BLOCK):
        step = np.diff(x[start : start + _BLOCK + MIN_CALM + 1])
        bend = np.abs(step[1:] - step[:-1])
        found.append(np.flatnonzero(bend[:_BLOCK] > 2 * usual.minimum(MIN_SHARE, NOISE)) + start + 1)
        if usual.calm < noise:
            line = bend <= usual.calm
            line = line[2:] & line[1:-1] & line[:-2]
            line = line[3:] & line[:-3]
            calm[start + 1 : start + 1 + line.size] = line
    first, after = stretches_of(calm).T
    return Bends(x, place, usual, np.concatenate(found), np.column_stack((first, after + MIN_CALM - 2)))


def usual_without(x: Signal, without: Signal) -> Usual:
    """Range and usual curvature of a channel without some values; with them if a coarse channel has no others."""
    spread, begin = x[:: max(1, x.size // SHOWN)], x[:SHOWN]
    others = ~(spread[:, None] == without).any(axis=1)
    if np.count_nonzero(others) >= max(min(UPDATES, spread.size // 2), OTHERS * spread.size):
        spread, begin = spread[others], begin[~(begin[:, None] == without).any(axis=1)]
    spread = np.sort(spread)
    spread = spread[np.diff(spread, prepend=-np.inf) > 0]  # each once: a log may rest for hours and move for seconds
    return Usual(quantile(spread, 0.005), quantile(spread, 0.995), positive_median(np.abs(np.diff(begin, 2))))


def single_spikes(bends: Bends) -> Index:
    """Find single-sample spikes among the bends of a channel, as indices of its finite samples."""
    x, found, minimum = bends.x, bends.found, bends.minimum
    if x.size < 4 * AROUND:
        return found
    inside = found[_is_spike(x, found, minimum)] if found.size else found
    ends = [[k] if _begins(course, minimum) else [] for k, course in ((0, x), (x.size - 1, x[::-1]))]
    spikes: Index = np.concatenate((ends[0], inside, ends[1])).astype(np.intp)
    if bends.place is None:
        return spikes
    good = bends.place
    return spikes[good[np.minimum(spikes + 1, good.size - 1)] - good[np.maximum(spikes - 1, 0)] <= NEAR]


def _begins(x: Signal, minimum: float) -> bool:
    """Whether the first sample is a spike, compared with the mirrored beginning of the log."""
    if abs(x[0] - x[1]) <= minimum:  # most logs
        return False
    mirrored = np.concatenate((x[2:0:-1], x[: 4 * AROUND]))
    return bool(_is_spike(mirrored, np.array([2]), minimum)[0])


def _is_spike(x: Signal, found: Index, minimum: float) -> Mask:
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
        changes = np.sort(x[along + 1] - x[along], axis=1)
        slope = 0.5 * (changes[:, line.size // 2 - 1] + changes[:, line.size // 2])
        off = np.abs(x[k] - 0.5 * (x[k - 1] + x[k + 1]))
        before = x[k - 1] - x[np.maximum(k - 2, 0)] - slope
        after = x[np.minimum(k + 2, x.size - 1)] - x[k + 1] - slope
        step = x[k + 1] - x[k - 1] - 2 * slope
        bent = np.maximum(np.maximum(np.abs(before), np.abs(after)), np.abs(step))
        keep[start : start + k.size] = (off > np.maximum(minimum, calm)) & (bent < AGREE * off)
    return keep


def _within(place: Index, first: int, last: int) -> Index:
    """Take what lies beyond an end of the log from beyond the other side of the surrounding."""
    place = np.where(place < first, place + 2 * AROUND + 1, place)
    within: Index = np.where(place > last, place - 2 * AROUND - 1, place)
    return within
