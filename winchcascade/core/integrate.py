"""Integrals, means and extremes of signals over windows, in blocks that stay in the processor's
cache; order statistics and white noise.

`numpy.median`, `numpy.quantile` and `numpy.unique` import numpy's masked arrays, which takes longer
than the reduction of a log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeAlias, TypeVar

import numpy as np

from winchcascade.core.run import Index, Mask, Signal

Ordered = TypeVar("Ordered", Signal, Index)

Stretch: TypeAlias = Callable[[slice], Signal]
"""A signal as a function of a stretch of rows of the log, which need not be made for all of it."""

BLOCK = 1 << 17
"""Samples that are worked on at a time."""

ENOUGH = 400_000
"""Number of samples at the beginning of a log that show the resolution and the noise of a
channel.
"""

ROUNDED = 1e-9
"""Share by which even intervals differ as the digits of stamps are rounded. [1]"""

GAUSS = 1.4826
"""Standard deviation of a normal variable over the median of its magnitude."""

MIN_SAMPLES = 12
"""Fewer samples show no noise."""


def quantile(x: Signal, q: float) -> float:
    """Quantile of finite values by linear interpolation, as `numpy.quantile` has it; x must not be
    empty.

    >>> quantile(np.array([4.0, 1.0, 3.0, 2.0]), 0.5)
    2.5
    """
    return _in_order(x.copy(), q * (x.size - 1))


def _in_order(x: Signal, place: float) -> float:
    """Value at a place in the order of values, between two places by linear interpolation; NaN
    comes last.

    The values are put into another order.
    """
    low = int(place)
    x.partition(low)  # at one place, and the next by a minimum: two at once take far longer
    value = float(x[low])
    return (
        value + (place - low) * (float(np.fmin.reduce(x[low + 1 :])) - value)
        if place > low
        else value
    )


def median(x: Signal) -> float:
    """Median of finite values; x must not be empty."""
    return quantile(x, 0.5)


def between(rising: Signal, share: float) -> float:
    """Value at a share of the places of rising values, by linear interpolation; there is one.

    >>> between(np.array([1.0, 2.0, 4.0]), 0.75)
    3.0
    """
    place = share * (rising.size - 1)
    low, high = float(rising[int(place)]), float(rising[math.ceil(place)])
    return low + (place - int(place)) * (high - low)


def distinct(x: Ordered) -> Ordered:
    """Different finite values in rising order, as `numpy.unique` has them.

    >>> distinct(np.array([2.0, 1.0, 2.0])).tolist()
    [1.0, 2.0]
    """
    rising = np.sort(x)
    return np.concatenate((rising[:1], rising[1:][rising[1:] != rising[:-1]]))


def medians_of_others(x: Signal) -> Signal:
    """Median of all other values for each of at least two finite ones, (n,).

    >>> medians_of_others(np.array([4.0, 1.0, 3.0, 2.0])).tolist()
    [2.0, 3.0, 2.0, 3.0]
    """
    order, places = np.argsort(x), np.arange(x.size)
    low, high = (x[order[k + (k >= places)]] for k in ((x.size - 2) // 2, (x.size - 1) // 2))
    found = np.empty(x.size)
    found[order] = low + 0.5 * (high - low)
    return found


def rms(x: Signal) -> float:
    """Root mean square of a signal, in its unit.

    >>> rms(np.array([3.0, -4.0, 5.0, 0.0]))
    3.5355339059327378
    """
    return float(np.sqrt(np.mean(x**2)))


def largest(x: Signal) -> float:
    """Largest magnitude of finite values, without a copy; x must not be empty."""
    return max(float(x.max()), -float(x.min()))


def ends_of(x: Signal) -> tuple[float, float]:
    """Smallest and largest value, without holes; x must hold a number."""
    low, high = float(x.min()), float(x.max())
    return (low, high) if low <= high else (float(np.nanmin(x)), float(np.nanmax(x)))


def stretches_of(mask: Mask) -> Index:
    """First sample, and the one after the last, of each stretch in which a mask is set, (k, 2).

    >>> stretches_of(np.array([True, False, True, True])).tolist()
    [[0, 1], [2, 4]]
    """
    inside = np.concatenate(([False], mask, [False]))
    return np.flatnonzero(inside[1:] != inside[:-1]).reshape(-1, 2)


def median_and_error(x: Signal) -> tuple[float, float]:
    """Median and its standard uncertainty by the median deviation, as of values that scatter
    normally; 0 for a single value.

    >>> median_and_error(np.array([1.0, 2.0, 9.0]))[0]
    2.0
    """
    middle = median(x)
    return middle, GAUSS * median(np.abs(x - middle)) * float(np.sqrt(0.5 * np.pi / x.size))


def positive_median(x: Signal) -> float:
    """Median of the values above zero, 0 where there is none: the usual interval of stamps, the
    usual size of changes.
    """
    above = x[x > 0]
    return _in_order(above, 0.5 * (above.size - 1)) if above.size else 0.0


def usual_interval(t: Signal) -> float:
    """Median of the intervals between the first stamps; of even ones, whose digits are rounded, the
    middle, as their order takes long. [s]
    """
    steps = np.diff(t[:BLOCK])
    low, high = float(steps.min()), float(steps.max())
    return 0.5 * (low + high) if high - low < ROUNDED * high else median(steps)


def smallest_step(x: Signal) -> float:
    """Smallest change between neighbouring samples that is not 0: the resolution of a channel,
    in its unit.
    """
    changes = np.abs(np.diff(x[:ENOUGH]))
    changes = changes[changes > 0]
    return float(changes.min()) if changes.size else 0.0


def white_noise(x: Signal) -> float:
    """Standard deviation of a signal's white noise, in its unit, whatever smooth signal it sits on.

    From its fourth differences, which take out a cubic and most of a ringing that is slow beside
    the samples, by their median magnitude. A signal that rarely changes has at least the noise of
    its resolution.
    """
    if x.size < MIN_SAMPLES:
        return 0.0
    steps = np.abs(np.diff(x))
    changes = steps[steps > 1e-12 * np.max(np.abs(x), initial=1e-300)]
    resolution = float(changes.min()) if changes.size else 0.0
    return max(
        float(GAUSS * median(np.abs(np.diff(x, 4))) / np.sqrt(70.0)), resolution / math.sqrt(12.0)
    )


def values_at(t: Signal, x: Signal, instants: Signal) -> Signal:
    """Value of a signal at some instants by linear interpolation, that of the first or last sample
    beyond the log; `numpy.interp` copies a signal that cannot be written to.

    >>> values_at(np.array([0.0, 2.0]), np.array([1.0, 5.0]), np.array([-1.0, 0.5, 2.0])).tolist()
    [1.0, 2.0, 5.0]
    """
    at = np.maximum(np.searchsorted(t, instants, side="right") - 1, 0)
    after = np.minimum(at + 1, t.size - 1)
    length = t[after] - t[at]
    share = np.clip(instants - t[at], 0.0, length) / np.where(length > 0.0, length, 1.0)
    return np.asarray(x[at] + share * (x[after] - x[at]))


def slope_of(t: Signal, x: Signal) -> Stretch:
    """The slope of a signal by its neighbours on both sides, as `numpy.gradient` has it, in the unit
    of the signal per second.

    >>> slope_of(np.array([0.0, 1.0, 3.0]), np.array([0.0, 1.0, 9.0]))(slice(0, 3)).tolist()
    [1.0, 2.0, 4.0]
    """

    def slope(rows: slice) -> Signal:
        begin = max(rows.start - 1, 0)
        part = slice(begin, rows.stop + 1)
        step = np.diff(t[part])
        before = np.diff(x[part]) / step
        within = (step[1:] * before[:-1] + step[:-1] * before[1:]) / (step[1:] + step[:-1])
        near = np.concatenate((before[:1], within, before[-1:]))[rows.start - begin :]
        return near[: rows.stop - rows.start]

    return slope


def integrals(t: Signal, stream: Stretch, windows: Signal) -> Signal:
    """Integrate a signal over windows, (k,), as `integrals_of` does several.

    >>> x = np.array([0.0, 2.0, 4.0])
    >>> integrals(np.array([0.0, 1.0, 2.0]), x.__getitem__, np.array([[0.5, 1.5]])).tolist()
    [2.0]
    """
    return np.asarray(integrals_of(t, [stream], windows)[0])


def integrals_of(t: Signal, streams: Sequence[Stretch], windows: Signal) -> Signal:
    """Integrate signals over windows: trapezoids whose two ends are interpolated (Eq. 5).

    Parameters
    ----------
    t : (n,) stamps that rise [s]
    streams : the signals
    windows : (k, 2) begin and end of each window [s], within the log

    Returns
    -------
    (m, k) in the unit of the signals times seconds
    """
    to_ends = integrals_to(t, streams, windows.ravel())
    return np.asarray(to_ends[:, 1::2] - to_ends[:, ::2])


def integrals_to(t: Signal, streams: Sequence[Stretch], ends: Signal) -> Signal:
    """Integrate signals from one common instant to each of k others, (k,), as `integrals_of` does
    over windows, (m, k)."""
    at = np.minimum(np.maximum(t.searchsorted(ends, side="right") - 1, 0), t.size - 2)
    order = at.argsort(kind="stable")
    rows, into = at[order], (ends - t[at])[order]
    found, before = np.empty((len(streams), rows.size)), np.zeros(len(streams))
    size = BLOCK // max(1, len(streams))
    for start in range(int(rows[0]), int(rows[-1]) + 1, size) if found.size else ():
        stop = min(start + size, int(rows[-1]) + 1)
        x = np.array([stream(slice(start, stop + 1)) for stream in streams])
        first, last = rows.searchsorted((start, stop))
        step, here = np.diff(t[start : stop + 1]), rows[first:last] - start
        areas, cuts = (x[:, 1:] + x[:, :-1]) * (0.5 * step), np.append(0, here)
        parts = np.add.reduceat(areas, cuts, axis=1)
        # reduceat gives the sample itself for a part without length
        parts[:, :-1][:, cuts[1:] == cuts[:-1]] = 0.0
        parts[:, 0] += before
        sums = parts.cumsum(axis=1)
        # On to each end, along the straight line between two samples.
        inside, near, after = into[first:last], x.take(here, axis=1), x.take(here + 1, axis=1)
        half_share = 0.5 * inside / step[here]
        found[:, first:last] = sums[:, :-1] + inside * (near + half_share * (after - near))
        before = sums[:, -1]
    return found.take(order.argsort(), axis=1)


def means_of(t: Signal, streams: Sequence[Stretch], windows: Signal) -> Signal:
    """Time means of several signals over the same windows, (m, k), in their units; NaN for a
    window without length.
    """
    length = windows[:, 1] - windows[:, 0]
    return integrals_of(t, streams, windows) / np.where(length > 0, length, np.nan)


def extremes(t: Signal, x: Signal, windows: Signal) -> tuple[Signal, Signal]:
    """Minimum and maximum sample in each of k windows in order of time; the next one for a
    window between two samples.
    """
    first = np.minimum(np.searchsorted(t, windows[:, 0], side="left"), t.size - 1)
    last = np.maximum(np.searchsorted(t, windows[:, 1], side="right"), first + 1)
    if first.size == 0:
        return np.empty(0), np.empty(0)
    edges = np.column_stack((first, last)).ravel()[: -1 if last[-1] == t.size else None]
    return np.minimum.reduceat(x, edges)[::2], np.maximum.reduceat(x, edges)[::2]
