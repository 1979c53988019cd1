"""Ratios of sums over many waves, their efficiency and their mean power, with an interval of the
waves and of the sensors.

Waves that follow each other are not independent: a group of high waves lasts for several. What the
waves contribute to the interval therefore comes from a circular block bootstrap (Politis and Romano
1992), whose blocks are as long as the data require (Politis and White 2004, with the correction of
Patton, Politis and White 2009). What the sensors contribute is drawn from their budget, linearly,
and added: a zero or a gain is the same in all waves, so that it does not average out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import Shape, student
from winchcascade.core.run import Signal

BOOTSTRAP = {"draws": 4000, "seed": 20260101}
"""Draws of the bootstrap and the seed of its random numbers: the same data give the same
interval.
"""

MIN_WAVES = 8
"""Fewer waves give no interval: their blocks would be the sample itself."""

SIGNIFICANT = 2.0
"""Number of standard deviations below which an autocorrelation counts as zero (Politis and White
2004, Sec. 3.2: about 2).
"""

BLOCKS_AT_ONCE = 2_000_000
"""Blocks that are drawn at a time: memory does not grow with the number of waves."""

Errors = Sequence[tuple[float, Shape]]
"""Change of a ratio with one standard uncertainty of each source of the sensors, and the shape
of that error.
"""

WRITTEN_RATIO = {
    "interval": "interval_95", "block": "block_waves", "u_waves": "standard_uncertainty_waves",
    "u_sensors": "standard_uncertainty_sensors",
}  # fmt: skip
"""Names of the fields in written files."""


class RatioOfSums(msgspec.Struct, frozen=True, rename=WRITTEN_RATIO):
    """An efficiency of all waves together [1], or the mean power of the record [W].

    `interval` holds 95 % by the waves, and by the sensors where `u_sensors`, their standard
    uncertainty, is known; `u_waves` is that of the waves, `block` the length of the blocks that
    gave it, of several logs the longest [waves]. An efficiency leads from and to the stages
    `between`.
    """

    value: float | None
    interval: tuple[float, float] | None = None
    block: int | None = None
    u_waves: float | None = None
    u_sensors: float | None = None
    between: tuple[str, str] | msgspec.UnsetType = msgspec.UNSET


def ratio_of_sums(
    value: float | None,
    x: Signal,
    y: Signal,
    *,
    share: float = 1.0,
    counts: Sequence[int] = (),
    errors: Errors | None = None,
) -> RatioOfSums:
    """Give a value its 95 % interval by waves and sensors.

    Parameters
    ----------
    value : the ratio of the sums of y and x; of a record with waves in it that ratio makes a share
        of the value
    x, y : (k,) of the waves in order of time, such as energies that go in and come out [J], or
        periods [s] and energies
    share : the share of the value that the waves make, which alone is resampled [1]
    counts : waves of each log, in order, where they are of several: no block leads from one log
        into another
    errors : of the value by the sensors; None where an accuracy is unknown
    """
    u_sensors = None if errors is None else math.hypot(*(size for size, _ in errors))
    if value is None or x.size < MIN_WAVES:
        return RatioOfSums(value, u_sensors=u_sensors)
    rng, measured = np.random.default_rng(BOOTSTRAP["seed"]), float(y.sum()) / float(x.sum())
    logs = [log for log in np.split(np.array((x, y)), np.cumsum(counts)[:-1], axis=1) if log.size]
    blocks = [block_length(log[1] - measured * log[0]) for log in logs]
    sums = np.sum(
        [_resampled(log, block, rng) for log, block in zip(logs, blocks, strict=True)], axis=0
    )
    # Few blocks scatter less than what they are drawn from, and their scatter is known by few.
    freedom = max(
        1, sum(math.ceil(log.shape[1] / block) for log, block in zip(logs, blocks, strict=True)) - 1
    )
    around = share * math.sqrt(1.0 + 1.0 / freedom) * (sums[1] / sums[0] - measured)
    drawn = value + around * (student(freedom) / student(math.inf))
    root = math.sqrt(3.0)
    for size, shape in errors or ():  # independent of which waves came
        normal = shape == "normal"
        drawn += size * (
            rng.standard_normal(drawn.size) if normal else rng.uniform(-root, root, drawn.size)
        )
    low, high = np.quantile(drawn, (0.025, 0.975)).tolist()
    return RatioOfSums(value, (low, high), max(blocks), float(np.std(around)), u_sensors)


def _resampled(x: Signal, block: int, rng: np.random.Generator) -> Signal:
    """Sums of resampled blocks of the columns of some rows, (rows, draws)."""
    n = x.shape[1]
    lengths = np.full(math.ceil(n / block), block)
    lengths[-1] = n - block * (lengths.size - 1)
    summed = np.concatenate((np.zeros((x.shape[0], 1)), np.cumsum(np.tile(x, 2), axis=1)), axis=1)
    found, step = [], max(1, BLOCKS_AT_ONCE // lengths.size)
    for begin in range(0, BOOTSTRAP["draws"], step):
        starts = rng.integers(0, n, (min(step, BOOTSTRAP["draws"] - begin), lengths.size))
        found.append((summed[:, starts + lengths] - summed[:, starts]).sum(axis=2))
    return np.concatenate(found, axis=1)


def block_length(x: Signal) -> int:
    """Length of the blocks of a circular block bootstrap of the mean of a series, from its
    autocorrelation; at most a third.

    >>> block_length(np.random.default_rng(0).normal(size=400))
    1
    """
    n, y = x.size, x - x.mean()
    longest, lags = max(1, n // 3), min(n - 1, math.ceil(math.sqrt(n)) + 10)
    covariance = np.array([float(y[: n - k] @ y[k:]) / n for k in range(lags + 1)])
    if covariance[0] <= 0.0:
        return 1
    below = np.abs(covariance[1:] / covariance[0]) < SIGNIFICANT * math.sqrt(math.log10(n) / n)
    run = max(
        5, math.ceil(math.sqrt(math.log10(n)))
    )  # so many small ones in a row end the correlation
    ends = [lag for lag in range(below.size - run + 1) if below[lag : lag + run].all()]
    last = ends[0] if ends else int(np.max(np.flatnonzero(~below) + 1, initial=0))
    if last == 0:
        return 1
    reach = min(2 * last, lags)
    k = np.arange(-reach, reach + 1)
    r = covariance[np.abs(k)] * np.minimum(
        1.0, 2.0 * (1.0 - np.abs(k) / reach)
    )  # flat top of Politis and Romano 1995
    spread, slope = float(r.sum()), float(np.abs(k) @ r)
    if spread <= 0.0:
        return longest
    length = (2.0 * slope**2 / (4.0 / 3.0 * spread**2)) ** (1.0 / 3.0) * n ** (1.0 / 3.0)
    return int(min(max(1, math.ceil(length)), longest))
