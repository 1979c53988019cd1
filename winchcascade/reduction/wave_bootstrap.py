"""Ratios of sums over many waves, their efficiency and their mean power, with an interval of the waves and of the sensors.

Waves that follow each other are not independent: a group of high waves lasts for several. What the waves contribute to the
interval therefore comes from a circular block bootstrap (Politis and Romano 1992), whose blocks are as long as the data require
(Politis and White 2004, with the correction of Patton, Politis and White 2009). What the sensors contribute is drawn from their
budget, linearly, and added: a zero or a gain is the same in all waves, so that it does not average out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.accuracy import Shape, student
from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import not_negative, ratio

BOOTSTRAP_DRAWS = 4000
BOOTSTRAP_SEED = 20260101
"""Draws of the bootstrap and the seed of its random numbers: the same data give the same interval."""

MIN_WAVES = 8
"""Fewer waves give no interval: their blocks would be the sample itself."""

SIGNIFICANT = 2.0
"""Number of standard deviations below which an autocorrelation counts as zero (Politis and White 2004, Sec. 3.2: about 2)."""

RECORD_MIN = 1e-9
"""No record is shorter. [s]"""

_AT_ONCE = 2_000_000
"""Blocks that are drawn at a time: memory does not grow with the number of waves."""

Errors = Sequence[tuple[float, Shape]]
"""Change of a ratio with one standard uncertainty of each source of the sensors, and the shape of that error."""


class EnergyError(msgspec.Struct, frozen=True):
    """What one standard uncertainty of a source changes of the energies of all waves together, and of the record, by stage. [J]

    `shared`: of a sensor, and so the same in all stages; else each stage has its own, as of bridged gaps.
    """

    source: str
    part: str
    shape: Shape
    shared: bool
    energy: Mapping[str, float]
    record: Mapping[str, float] = msgspec.field(default_factory=dict)

    def of_ratio(self, into: tuple[str, float], out: tuple[str, float]) -> float:
        """Change of an efficiency with it; the stages by name and energy [J]. [1]"""
        up = self.energy.get(out[0], 0.0) / into[1]
        down = out[1] / into[1] * self.energy.get(into[0], 0.0) / into[1]
        return up - down if self.shared else math.hypot(up, down)


WRITTEN_RATIO = {
    "interval": "interval_95", "block": "block_waves", "u_waves": "standard_uncertainty_waves",
    "u_sensors": "standard_uncertainty_sensors",
}  # fmt: skip
"""Names of the fields in written files."""


class RatioOfSums(msgspec.Struct, frozen=True, rename=WRITTEN_RATIO):
    """An efficiency of all waves together [1], or the mean power of the record [W].

    `interval` holds 95 % by the waves, and by the sensors where `u_sensors`, their standard uncertainty, is known; `u_waves` is
    that of the waves, `block` the length of the blocks that gave it, of several logs the longest [waves]. An efficiency leads
    from and to the stages `between`.
    """

    value: float | None
    interval: tuple[float, float] | None = None
    block: int | None = None
    u_waves: float | None = None
    u_sensors: float | None = None
    between: tuple[str, str] | msgspec.UnsetType = msgspec.UNSET


def ratio_of_sums(
    into: Signal, out: Signal, *, counts: Sequence[int] = (), errors: Errors | None = None
) -> RatioOfSums:
    """Efficiency of many waves together, with its 95 % interval.

    Parameters
    ----------
    into, out : (k,) energies of the waves in order of time [J]
    counts : waves of each log, in order, where they are of several: no block leads from one log into another
    errors : None where an accuracy is unknown
    """
    value = not_negative(ratio(float(out.sum()), float(into.sum())))
    return _with_interval(value, (into, out), 1.0, counts or [into.size], errors)


def mean_power(
    record: tuple[float, float],
    waves: tuple[Signal, Signal] | None,
    *,
    counts: Sequence[int] = (),
    errors: Errors | None = None,
) -> RatioOfSums:
    """Mean power of a record, with its 95 % interval: its waves are resampled, what lies between them is kept.

    Parameters
    ----------
    record : duration [s] and energy [J]
    waves : periods [s] and energies [J] of its waves in order of time; None where the energies of some are unknown
    counts, errors : as of `ratio_of_sums`, errors of the power [W]
    """
    periods, joules = waves or (np.empty(0), np.empty(0))
    share = float(periods.sum()) / max(record[0], RECORD_MIN)
    return _with_interval(ratio(record[1], record[0]), (periods, joules), share, counts or [periods.size], errors)


def _with_interval(
    value: float | None, of: tuple[Signal, Signal], share: float, counts: Sequence[int], errors: Errors | None
) -> RatioOfSums:
    """A value of which the ratio of the sums of two series makes a share, with its interval."""
    u_sensors = None if errors is None else math.hypot(*(size for size, _ in errors))
    x, y = of
    if value is None or x.size < MIN_WAVES:
        return RatioOfSums(value, u_sensors=u_sensors)
    rng, measured = np.random.default_rng(BOOTSTRAP_SEED), float(y.sum()) / float(x.sum())
    logs = [log for log in np.split(np.array(of), np.cumsum(counts)[:-1], axis=1) if log.size]
    blocks = [block_length(log[1] - measured * log[0]) for log in logs]
    sums = np.sum([_resampled(log, block, rng) for log, block in zip(logs, blocks, strict=True)], axis=0)
    # Few blocks scatter less than what they are drawn from, and their scatter is known by few.
    freedom = max(1, sum(math.ceil(log.shape[1] / block) for log, block in zip(logs, blocks, strict=True)) - 1)
    around = share * math.sqrt(1.0 + 1.0 / freedom) * (sums[1] / sums[0] - measured)
    drawn = value + around * (student(freedom) / student(math.inf))
    for size, shape in errors or ():  # independent of which waves came
        root = math.sqrt(3.0)
        drawn += size * (
            rng.standard_normal(BOOTSTRAP_DRAWS) if shape == "normal" else rng.uniform(-root, root, BOOTSTRAP_DRAWS)
        )
    low, high = np.quantile(drawn, (0.025, 0.975)).tolist()
    return RatioOfSums(value, (low, high), max(blocks), float(np.std(around)), u_sensors)


def _resampled(x: Signal, block: int, rng: np.random.Generator) -> Signal:
    """Sums of resampled blocks of the columns of some rows, (rows, BOOTSTRAP_DRAWS)."""
    n = x.shape[1]
    lengths = np.full(math.ceil(n / block), block)
    lengths[-1] = n - block * (lengths.size - 1)
    summed = np.concatenate((np.zeros((x.shape[0], 1)), np.cumsum(np.tile(x, 2), axis=1)), axis=1)
    found, step = [], max(1, _AT_ONCE // lengths.size)
    for begin in range(0, BOOTSTRAP_DRAWS, step):
        starts = rng.integers(0, n, (min(step, BOOTSTRAP_DRAWS - begin), lengths.size))
        found.append((summed[:, starts + lengths] - summed[:, starts]).sum(axis=2))
    return np.concatenate(found, axis=1)


def block_length(x: Signal) -> int:
    """Length of the blocks of a circular block bootstrap of the mean of a series, from its autocorrelation; at most a third.

    >>> block_length(np.random.default_rng(0).normal(size=400))
    1
    """
    n, y = x.size, x - x.mean()
    longest, lags = max(1, n // 3), min(n - 1, math.ceil(math.sqrt(n)) + 10)
    covariance = np.array([float(y[: n - k] @ y[k:]) / n for k in range(lags + 1)])
    if covariance[0] <= 0.0:
        return 1
    below = np.abs(covariance[1:] / covariance[0]) < SIGNIFICANT * math.sqrt(math.log10(n) / n)
    run = max(5, math.ceil(math.sqrt(math.log10(n))))  # so many small ones in a row end the correlation
    ends = [lag for lag in range(below.size - run + 1) if below[lag : lag + run].all()]
    last = ends[0] if ends else int(np.max(np.flatnonzero(~below) + 1, initial=0))
    if last == 0:
        return 1
    reach = min(2 * last, lags)
    k = np.arange(-reach, reach + 1)
    r = covariance[np.abs(k)] * np.minimum(1.0, 2.0 * (1.0 - np.abs(k) / reach))  # flat top of Politis and Romano 1995
    spread, slope = float(r.sum()), float(np.abs(k) @ r)
    if spread <= 0.0:
        return longest
    length = (2.0 * slope**2 / (4.0 / 3.0 * spread**2)) ** (1.0 / 3.0) * n ** (1.0 / 3.0)
    return int(min(max(1, math.ceil(length)), longest))
