"""What the other channels of a log show: a fault of a sensor or a logger is one that none of them shows.

`Witnesses` decides on values that jump: where another channel jumps at the same instants, the machine did it. `LookAlikes`
decides on values that are held and on noise that is missing: where the channel is as still elsewhere in the same state of all
other channels, the machine is, too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import msgspec
import numpy as np

from winchcascade.core.integrate import median, quantile, quantiles_in_place, smallest_step
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.ingest.checks.spikes import AROUND, MIN_CALM, MIN_SHARE, NOISE, Usual

CHANGE_MIN = 2.0
"""Minimum change of a channel that shows an event, of its value or its slope from sample to sample, over the upper quartile of
such changes nearby. The change is as large as a spike, too, so that noise shows none. [1]"""

COMMENSURATE = 0.05
"""Minimum change of a channel that shows an event, over that of the event, both in ranges: inertia makes a spike of a power
from a change of the velocity that is a tenth of it. [1]"""

REACH = 1
"""Steps before and after an edge within which another channel shows it: converters read one channel after the other."""

SINGLE = 2
"""Steps from one edge to the other of a single sample. Its edges count as one: the power has a spike where the velocity changes
for good. What lasts longer shows at both."""

REFERENCES = 60_000
"""Maximum number of samples, evenly over the log, among which look-alikes are sought."""

QUERIES = 5
"""Number of samples of a stretch, evenly over it, whose look-alikes are sought."""

NEAREST = 50
"""Number of look-alikes of each."""

AS_HELD = 0.8
"""Share of look-alikes with a held value, within one step of the channel, from which they all have it. [1]"""


class Witnesses(msgspec.Struct, frozen=True):
    """Channels of a log, (n,) each, NaN where they have holes, and what each usually does."""

    channels: Mapping[str, Signal]
    usual: Mapping[str, Usual]

    def show(self, name: str, before: int, after: int) -> bool:
        """Whether another channel jumps where this one jumps away after the sample `before` and back before `after`.

        A channel that holds a code there, or is lost like this one, is no witness. An end of the log (-1, n) is no edge.
        """
        share = COMMENSURATE * self._size(name, before, after)
        return name in self.usual and any(
            self._changes_with(other, before, after, share) and not self._is_lost(other, name, slice(before + 1, after))
            for other in self.channels
            if other != name and other in self.usual
        )

    def _size(self, name: str, before: int, after: int) -> float:
        """How far a channel departs over an event from the samples beside it, in ranges. [1]"""
        x, span = self.channels[name], self.usual[name].span if name in self.usual else 0.0
        inside, ends = x[before + 1 : after], [x[k] for k in (before, after) if 0 <= k < x.size]
        inside, beside = inside[np.isfinite(inside)], np.array(ends)[np.isfinite(ends)]
        return float(np.abs(inside - median(beside)).max()) / span if inside.size and beside.size and span else 0.0

    def _changes_with(self, name: str, before: int, after: int, share: float) -> bool:
        """Whether a channel or its slope changes much more at the edges of an event than nearby, by a share of its range."""
        y, usual = self.channels[name], self.usual[name]
        first, last = max(before - REACH, 0), min(after + REACH, y.size - 1)
        edges = [y[first : last + 1]]
        if after - before > SINGLE:
            begin, end = y[first : before + REACH + 2], y[max(after - REACH - 1, 0) : last + 1]
            edges = [part for part, inside in ((begin, before >= 0), (end, after < y.size)) if inside]
        beside = y[max(first - AROUND, 0) : first + 1], y[last : last + AROUND + 1]
        minimum = usual.minimum(max(MIN_SHARE, share), NOISE)
        return any(
            all(_largest_change(part, order) > max(minimum, limit) for part in edges)
            for order in (1, 2)
            if (limit := CHANGE_MIN * _usual_change(beside, order)) < np.inf
        )

    def _is_lost(self, other: str, name: str, inside: slice) -> bool:
        """Whether another channel holds no measurement over an event: far values, the code or the zero of this one, or a value
        that it holds there alone.
        """
        x, y = self.channels[name][inside], self.channels[other][inside]
        x, y = x[np.isfinite(x)], y[np.isfinite(y)]
        if not (x.size and y.size):
            return True
        usual, here, there = self.usual[other], median(x), median(y)
        if usual.is_far(there) or here == there or self._is_held(other, inside):
            return True
        return bool(abs(here) < MIN_SHARE * self.usual[name].span and abs(there) < MIN_SHARE * usual.span)

    def _is_held(self, name: str, inside: slice) -> bool:
        """Whether a channel holds one value over an event of six samples or more, although it rarely does beside it.

        At zero a stage gives nothing out: that is a measurement.
        """
        y = self.channels[name]
        idle = float(np.max(np.abs(y[inside]))) < MIN_SHARE * self.usual[name].span
        if idle or inside.stop - inside.start < MIN_CALM or np.ptp(y[inside]) != 0.0:
            return False
        beside = y[max(inside.start - AROUND, 0) : inside.start], y[inside.stop : inside.stop + AROUND]
        steps = np.concatenate([np.diff(part) for part in beside])
        return bool(np.count_nonzero(steps) > 0.5 * steps.size)


def _largest_change(x: Signal, order: int) -> float:
    """Largest difference of an order, 0 where holes leave none."""
    change = np.abs(np.diff(x, order))
    return float(np.max(change, initial=0.0, where=np.isfinite(change)))


def _usual_change(parts: Sequence[Signal], order: int) -> float:
    """Upper quartile of the differences of an order over some parts of a channel, inf where there is none."""
    change = np.abs(np.concatenate([np.diff(part, order) for part in parts]))
    change = change[np.isfinite(change)]
    return quantile(change, 0.75) if change.size else float("inf")


def samples_of(stretches: Sequence[tuple[int, int]], samples: int) -> Mask:
    """Samples of some stretches [first, last), (n,)."""
    inside = np.zeros(samples, dtype=bool)
    for first, last in stretches:
        inside[first:last] = True
    return inside


class LookAlikes:
    """Samples of a log at which all other channels are as at given ones, each in shares of its range."""

    def __init__(self, channels: Mapping[str, Signal]) -> None:
        self._channels = channels

    @cached_property
    def _rows(self) -> Index:
        """Samples among which look-alikes are sought."""
        samples = next(iter(self._channels.values())).size
        return np.arange(1, samples - 1, max(1, samples // REFERENCES))

    @cached_property
    def _ranges(self) -> dict[str, tuple[float, float]]:
        """Median and range, without a few wild values, of each channel that changes."""
        ranges = {}
        for name, x in self._channels.items():
            some = x[self._rows]
            some = some[np.isfinite(some)]
            low, middle, high = quantiles_in_place(some, [0.005, 0.5, 0.995]) if some.size else (0.0, 0.0, 0.0)
            if high > low:
                ranges[name] = middle, high - low
        return ranges

    def _state(self, name: str, rows: Index) -> Signal:
        """A channel at some samples from its median, in shares of its range; 0 in holes."""
        middle, span = self._ranges[name]
        return np.nan_to_num((self._channels[name][rows] - middle) / span)

    @cached_property
    def _states(self) -> dict[str, Signal]:
        """Channels at the samples among which look-alikes are sought."""
        return {name: self._state(name, self._rows) for name in self._ranges}

    def of(self, name: str, stretch: tuple[int, int], suspects: Mask) -> Index:
        """Samples that look like those of a stretch [first, last) in all channels but one; none without others.

        Parameters
        ----------
        suspects : (n,) samples of this and other stretches, which do not count
        """
        first, last = stretch
        others = [other for other in self._ranges if other != name]
        apart = ~suspects[self._rows]
        if name not in self._ranges or not others or np.count_nonzero(apart) <= NEAREST:
            return self._rows[:0]
        places = first + ((np.arange(QUERIES) + 0.5) * (last - first) / QUERIES).astype(np.intp)
        distance = np.zeros((places.size, self._rows.size))
        for other in others:
            distance += (self._state(other, places)[:, None] - self._states[other]) ** 2
        distance[:, ~apart] = np.inf
        near: Index = self._rows[np.argpartition(distance, NEAREST, axis=1)[:, :NEAREST]].ravel()
        return near

    def calm(self, name: str, stretch: tuple[int, int], calm: Mask, suspects: Mask) -> float:
        """Share of the look-alikes at which a channel is calm at values of a stretch [first, last), 0 where there are none. [1]

        Parameters
        ----------
        calm : (n,) where the channel is
        suspects : (n,) samples of this and other stretches, which do not count
        """
        near = self.of(name, stretch, suspects)
        return self._share(name, near, stretch, calm[near], MIN_SHARE * self._ranges[name][1]) if near.size else 0.0

    def repeats(self, name: str, stretch: tuple[int, int]) -> float:
        """Chance that a sample of a stretch of one value repeats the one before, by its look-alikes, 0 without any. [1]

        The share of them that do; or half that of those with the held value within a step, as some states are less still; or 1
        where nearly all have that value. Of the velocity values do not count: it is what the others follow.
        """
        x, near = self._channels[name], self.of(name, stretch, samples_of([stretch], self._channels[name].size))
        if not near.size:
            return 0.0
        share = self._share(name, near, stretch, x[near] == x[near - 1], MIN_SHARE * self._ranges[name][1])
        if name == "velocity":
            return share
        held = self._share(name, near, stretch, np.ones(near.size, dtype=bool), smallest_step(x))
        return 1.0 if held >= AS_HELD else max(share, 0.5 * held)

    def _share(self, name: str, near: Index, stretch: tuple[int, int], chosen: Mask, margin: float) -> float:
        """Share of samples that are chosen and have values of a stretch, within a margin in the unit of the channel. [1]"""
        x = self._channels[name]
        inside = x[slice(*stretch)]
        low, high = np.nanmin(inside) - 1.001 * margin, np.nanmax(inside) + 1.001 * margin
        return float(np.mean(chosen & (x[near] >= low) & (x[near] <= high)))
