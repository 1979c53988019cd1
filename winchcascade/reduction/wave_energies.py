"""Energies of irregular waves: of each, of the whole record, and by classes of payout and period.

Waves that follow each other are not independent: a group of high waves lasts for several. The interval of an efficiency, a
ratio of sums, therefore comes from a circular block bootstrap (Politis and Romano 1992), whose blocks are as long as the data
require (Politis and White 2004, with the correction of Patton, Politis and White 2009).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.integrate import integrals, quantile
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.reduction.efficiency import is_efficiency, ratio
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction

DRAWS = 4000
SEED = 20260101
"""Draws of the bootstrap and the seed of its random numbers: the same data give the same interval."""

FEWEST = 8
"""Fewer waves give no interval: their blocks would be the sample itself."""

MOST_CLASSES = 6
"""Classes of payout, and of period, at most."""

SIGNIFICANT = 2.0
"""Autocorrelations below so many standard deviations count as none (Politis and White 2004, Sec. 3.2: about 2)."""


class WaveClass(msgspec.Struct, frozen=True):
    """Waves whose payout and period lie in a class: their number, their energies together [J], ratios of these sums [1].

    `payout` is in metres, in radians for a shaft without a line; `period` in seconds.
    """

    payout: tuple[float, float]
    period: tuple[float, float]
    count: int
    energy: Mapping[str, float | None]
    efficiency: Mapping[str, float | None]


class RatioOfSums(msgspec.Struct, frozen=True):
    """An efficiency of all waves together with its 95 % interval, and the length of the blocks that gave it. [1], [waves]"""

    value: float | None
    interval: tuple[float, float] | None = None
    block: int | None = None


class WaveEnergies(msgspec.Struct, frozen=True):
    """Energies of the complete waves of a log and of its whole record.

    Parameters
    ----------
    cycle : numbers of the waves, (k,)
    payout, payout_unit : travel of the positive half, (k,), in m, or rad for a shaft without a line
    period : (k,) [s]
    energy : of each wave, (k,), by stage [J]
    efficiency : of all waves together, by name
    record_duration : of the record without long gaps [s]
    record_energy : over that, by stage [J]
    """

    cycle: Index
    payout: Signal
    payout_unit: str
    period: Signal
    energy: Mapping[str, Signal]
    efficiency: Mapping[str, RatioOfSums]
    classes: tuple[WaveClass, ...]
    record_duration: float
    record_energy: Mapping[str, float]

    @property
    def record_power(self) -> dict[str, float]:
        """Mean powers of the record, by stage. [W]"""
        return {stage: joule / self.record_duration for stage, joule in self.record_energy.items()}


def wave_energies(reduction: Reduction) -> WaveEnergies:
    """Energies of the waves of a log, or of any cycles of it."""
    waves, cascade = reduction.complete, reduction.rig.cascade
    energy = {
        stage: np.array([c.metrics.value(f"energy_{stage}") for c in waves])
        for stage in cascade.names
        if all(c.metrics[f"energy_{stage}"] is not None for c in waves)
    }
    payout, unit = _payouts(reduction, waves)
    period = np.array([_period(reduction, c) for c in waves])
    duration, record = _record(reduction)
    return WaveEnergies(
        cycle=np.array([c.cycle for c in waves], dtype=np.intp),
        payout=payout,
        payout_unit=unit,
        period=period,
        energy=energy,
        efficiency={
            name: ratio_of_sums(energy[into], energy[out])
            for name, (into, out) in _pairs(reduction).items()
            if into in energy and out in energy
        },
        classes=_classes(reduction, payout, period, energy),
        record_duration=duration,
        record_energy=record,
    )


def _pairs(reduction: Reduction) -> dict[str, tuple[str, str]]:
    """Stages that each efficiency leads from and to, without those that an open circuit does not have."""
    cascade = reduction.rig.cascade
    names = [m for m in cascade.ratios if not (reduction.run.open_circuit and cascade.undelivered(m))]
    return {name: cascade.between(name) for name in names}


def ratio_of_sums(into: Signal, out: Signal) -> RatioOfSums:
    """Efficiency of many waves together, with the 95 % interval of a circular block bootstrap.

    Parameters
    ----------
    into, out : (k,) energies of the waves in order of time [J]
    """
    value = _efficiency(float(out.sum()), float(into.sum()))
    if value is None or into.size < FEWEST:
        return RatioOfSums(value)
    block = block_length(out - value * into)
    rng, n = np.random.default_rng(SEED), into.size
    starts = rng.integers(0, n, (DRAWS, -(-n // block)))
    rows = ((starts[:, :, None] + np.arange(block)) % n).reshape(DRAWS, -1)[:, :n]
    drawn = out[rows].sum(axis=1) / into[rows].sum(axis=1)
    return RatioOfSums(value, (quantile(drawn, 0.025), quantile(drawn, 0.975)), block)


def _efficiency(out: float | None, into: float | None) -> float | None:
    """A ratio of sums, None where it is no efficiency."""
    value = ratio(out, into)
    return value if value is None or is_efficiency(value) else None


def block_length(x: Signal) -> int:
    """Length of the blocks of a circular block bootstrap of the mean of a series, from its autocorrelation; at most a third.

    >>> block_length(np.random.default_rng(0).normal(size=400))
    1
    """
    n = x.size
    y = x - x.mean()
    most = max(1, n // 3)
    lags = min(n - 1, math.ceil(math.sqrt(n)) + 10)
    covariance = np.array([float(y[: n - k] @ y[k:]) / n for k in range(lags + 1)])
    if covariance[0] <= 0.0:
        return 1
    below = np.abs(covariance[1:] / covariance[0]) < SIGNIFICANT * math.sqrt(math.log10(n) / n)
    last = _last_correlated(below, max(5, math.ceil(math.sqrt(math.log10(n)))))
    if last == 0:
        return 1
    reach = min(2 * last, lags)
    k = np.arange(-reach, reach + 1)
    weight = np.minimum(1.0, 2.0 * (1.0 - np.abs(k) / reach))  # flat top of Politis and Romano 1995
    r = covariance[np.abs(k)] * weight
    spread, slope = float(r.sum()), float(np.abs(k) @ r)
    if spread <= 0.0:
        return most
    length = (2.0 * slope**2 / (4.0 / 3.0 * spread**2)) ** (1.0 / 3.0) * n ** (1.0 / 3.0)
    return int(min(max(1, math.ceil(length)), most))


def _last_correlated(below: Mask, run: int) -> int:
    """Lag after which a run of autocorrelations counts as none; the largest lag where there is no such run."""
    for lag in range(below.size - run + 1):
        if below[lag : lag + run].all():
            return lag
    return int(np.flatnonzero(~below)[-1]) + 1 if not below.all() else 0


def _payouts(reduction: Reduction, waves: Sequence[CycleResult]) -> tuple[Signal, str]:
    """Travel of each payout and its unit: of the line, else the angle of the shaft."""
    run = reduction.run
    travel = np.array([c.summary.payout.travel for c in waves], dtype=np.float64)
    if np.isfinite(travel).all() or "speed" not in run.channels:
        return travel, "m"
    spans = np.array([(c.phases.onset, c.phases.payout_end) for c in waves]).reshape(-1, 2)
    return integrals(run.t, run.channels["speed"].__getitem__, spans), "rad"


def _period(reduction: Reduction, wave: CycleResult) -> float:
    """Time from one upward zero crossing to the next; of other cycles that from onset to onset. [s]"""
    if reduction.rig.phases.source == "waves":
        return wave.window.cutoff - wave.window.onset
    return wave.net.end - wave.net.begin


def _record(reduction: Reduction) -> tuple[float, dict[str, float]]:
    """Length of the record without long gaps [s], and the energy of each stage over it [J]."""
    run, rig = reduction.run, reduction.rig
    gaps = all_gaps(run, rig.cascade.channels)
    gaps = gaps[gaps[:, 1] - gaps[:, 0] > rig.thresholds.gap_max]
    whole = np.array([[run.t[0], run.t[-1]]])
    unknown = _united(gaps)
    energy = {}
    for stage in rig.cascade.stages:
        watts = stage.stream(run.channels, rig.r_drum)
        if watts is not None:
            lost = float(integrals(run.t, watts, unknown).sum()) if len(unknown) else 0.0
            energy[stage.name] = float(integrals(run.t, watts, whole)[0]) - lost
    return float(run.t[-1] - run.t[0]) - float(np.ptp(unknown, axis=1).sum()), energy


def _united(gaps: Signal) -> Signal:
    """Gaps in order of time without overlaps, (k, 2). [s]"""
    found: list[list[float]] = []
    for begin, end in gaps.tolist():
        if found and begin <= found[-1][1]:
            found[-1][1] = max(found[-1][1], end)
        else:
            found.append([begin, end])
    return np.array(found).reshape(-1, 2)


def _classes(
    reduction: Reduction, payout: Signal, period: Signal, energy: Mapping[str, Signal]
) -> tuple[WaveClass, ...]:
    """Classes of payout and period that have a wave, in rising order."""
    if not payout.size or not np.isfinite(payout).all():
        return ()
    across, along = class_width(payout), class_width(period)
    places = np.column_stack((np.floor(payout / across), np.floor(period / along))).astype(np.intp)
    found = []
    for a, b in np.unique(places, axis=0).tolist():
        of = (places == (a, b)).all(axis=1)
        joule = {stage: float(x[of].sum()) for stage, x in energy.items()}
        found.append(
            WaveClass(
                payout=(a * across, (a + 1) * across),
                period=(b * along, (b + 1) * along),
                count=int(of.sum()),
                energy=dict(joule),
                efficiency={
                    name: _efficiency(joule.get(out), joule.get(into))
                    for name, (into, out) in _pairs(reduction).items()
                },
            )
        )
    return tuple(found)


def class_width(x: Signal) -> float:
    """Width of classes that begin at zero: 1, 2 or 5 times a power of ten, and no more classes than `MOST_CLASSES`.

    >>> class_width(np.array([0.3, 4.0])), class_width(np.array([11.9]))
    (1.0, 2.0)
    """
    top = float(np.max(np.abs(x)))
    if not top > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(top / MOST_CLASSES))
    return next(width * power for width in (1.0, 2.0, 5.0, 10.0) if top < MOST_CLASSES * width * power)
