"""Difference of the means of two sides with its 95 % interval, by the GUM (JCGM 100:2008, 5.2 and
G.4).

A side is one log, or the repeats of one load. Its uncertainty has three parts:

- the scatter of the cycles (type A), s/sqrt(N) with N - 1 degrees of freedom; of repeats that
  within the logs, and what the means of the logs scatter beyond it and beyond their zeros;
- gains of the sensors (type B), the same in all logs of a side;
- zeros, sampling and bridged gaps (type B), of each log alone.

The parts of both sides add in squares, but for gains that both sides share: these change both means
alike, so that their contributions are subtracted before they are squared (GUM 5.2.2 with a
correlation of 1). The interval is t times the combined standard uncertainty; its effective degrees
of freedom follow from those of the scatters, as parts of type B have infinitely many (Welch and
Satterthwaite, GUM G.4.1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.comparison.compared_run import ComparedRun, scatter_of
from winchcascade.core.accuracy import Interval, Scatter, effective_freedom, interval_95
from winchcascade.reduction.timing import TIMING

SAME = 1e-6
"""Relative difference up to which two standard uncertainties of a gain are the same number. [1]"""


WRITTEN = {
    "value": "difference",
    "uncertainty": "standard_uncertainty",
    "freedom": "degrees_of_freedom",
    "interval": "interval_95",
    "interval_repeatability": "interval_95_repeatability",
}
"""Names of the fields in written files."""


class Difference(msgspec.Struct, frozen=True, rename=WRITTEN):
    """Difference B - A of the means of one metric, in its SI unit; its fields are those of the
    JSON.

    Parameters
    ----------
    value, relative : B - A, and as a share of A; None where A is zero
    uncertainty, freedom, interval : of scatter and sensors together; `freedom` is inf where no
        scatter counts; None with `sensors`
    excludes_zero : whether the 95 % interval excludes no difference; None without an interval
    repeatability : standard uncertainty by the scatter of cycles; None where neither side shows it
    sensors : standard uncertainty by the errors of sensors; None where an accuracy is unknown
    interval_repeatability : of the scatter alone, as if the sensors had no errors
    cycles : complete cycles that the means of A and B are of
    """

    metric: str
    a: float
    b: float
    value: float
    relative: float | None
    uncertainty: float | None
    freedom: float | None
    interval: tuple[float, float] | None
    excludes_zero: bool | None
    repeatability: float | None
    sensors: float | None
    interval_repeatability: tuple[float, float] | None
    cycles: tuple[int, int]


class _Side(msgspec.Struct, frozen=True):
    """Mean of one metric over the logs of a side, and the parts of its uncertainty; `gains` are
    signed, by error.
    """

    mean: float
    cycles: int
    scatters: tuple[Scatter, ...]
    known: bool
    gains: Mapping[str, float]
    rest: float


def difference(
    metric: str,
    a: Sequence[ComparedRun],
    b: Sequence[ComparedRun],
    *,
    shared: frozenset[str] = frozenset(),
) -> Difference | None:
    """Difference of a metric between the logs of two sides; None where no log of a side has it.

    Parameters
    ----------
    a, b : logs of one load, or of one key
    shared : sensors whose gain both sides have in common
    """
    sides = [_side(metric, runs) for runs in (a, b)]
    first, second = sides
    if first is None or second is None:
        return None
    scatters = (*first.scatters, *second.scatters)
    known = first.known and second.known
    sensors = _sensors(first, second, shared) if known else None
    value = second.mean - first.mean
    repeatability = math.hypot(*(part.u for part in scatters)) if scatters else None
    combined = None if sensors is None else math.hypot(sensors, repeatability or 0.0)

    def interval_of(u: float) -> Interval:
        return interval_95(value, u, effective_freedom(scatters, u))

    interval = None if combined is None else interval_of(combined)
    return Difference(
        metric=metric,
        a=first.mean,
        b=second.mean,
        value=value,
        relative=value / abs(first.mean) if first.mean else None,
        uncertainty=combined,
        freedom=None if combined is None else effective_freedom(scatters, combined),
        interval=interval,
        excludes_zero=None if interval is None else interval[0] > 0.0 or interval[1] < 0.0,
        repeatability=repeatability,
        sensors=sensors,
        interval_repeatability=None if repeatability is None else interval_of(repeatability),
        cycles=(first.cycles, second.cycles),
    )


def _sensors(a: _Side, b: _Side, shared: frozenset[str]) -> float:
    """Standard uncertainty of the difference by the errors of sensors."""
    both = math.hypot(*(b.gains.get(name, 0.0) - a.gains.get(name, 0.0) for name in shared), 0.0)
    single = (u for side in (a, b) for name, u in side.gains.items() if name not in shared)
    return math.hypot(both, *single, a.rest, b.rest)


def _side(metric: str, runs: Sequence[ComparedRun]) -> _Side | None:
    """Pool the logs of a side, each weighted with its cycles."""
    given = [
        (run, mean)
        for run in runs
        if (mean := run.mean.get(metric)) is not None and run.cycles[metric]
    ]
    if not given:
        return None
    counts = [len(run.cycles[metric]) for run, _ in given]
    total = sum(counts)
    weights = [n / total for n in counts]
    gains: dict[str, float] = {}
    for (run, mean), weight in zip(given, weights, strict=True):
        for name, gain in run.gains.items():
            gains[name] = gains.get(name, 0.0) + weight * math.copysign(
                gain.of.get(metric, 0.0), mean
            )
    rests = [run.rest(metric) for run, _ in given]
    return _Side(
        mean=sum(weight * mean for (_, mean), weight in zip(given, weights, strict=True)),
        cycles=total,
        scatters=_scatters(
            [run.cycles[metric] for run, _ in given],
            rests,
            repeats=all(run.repeats for run, _ in given if run.complete > 1),
        ),
        known=all(run.sensors[metric] is not None for run, _ in given),
        gains=gains,
        rest=math.hypot(*(weight * rest for weight, rest in zip(weights, rests, strict=True))),
    )


def _scatters(
    cycles: Sequence[Sequence[float]], rests: Sequence[float], *, repeats: bool
) -> tuple[Scatter, ...]:
    """Parts of type A of the mean of all cycles of some logs.

    A single log has the scatter of its cycles. Several logs have that within them, and the part of
    the scatter of their means that neither it nor their zeros explain (one-way analysis of
    variance, by the method of moments). Logs whose cycles show no repeatability have the scatter of
    their means alone.
    """
    counts = [len(values) for values in cycles]
    total, logs = sum(counts), len(cycles)
    if logs == 1:
        return (
            (Scatter(scatter_of(cycles[0]) / math.sqrt(total), total - 1.0),)
            if repeats and total > 1
            else ()
        )
    means = [sum(values) / len(values) for values in cycles]
    grand = sum(n * mean for n, mean in zip(counts, means, strict=True)) / total
    between = sum(n * (mean - grand) ** 2 for n, mean in zip(counts, means, strict=True)) / (
        logs - 1
    )
    if total == logs or not repeats:
        return (Scatter(math.sqrt(between / total), logs - 1.0),)
    within = sum(
        (n - 1) * scatter_of(x) ** 2 for n, x in zip(counts, cycles, strict=True) if n > 1
    ) / (total - logs)
    squares = sum(n * n for n in counts)
    usual = (total - squares / total) / (logs - 1)
    zeros = sum(rest**2 for rest in rests) / logs
    excess = max((between - within) / usual - zeros, 0.0) * squares / total**2
    parts = (
        Scatter(math.sqrt(within / total), total - logs),
        Scatter(math.sqrt(excess), logs - 1.0),
    )
    return tuple(part for part in parts if part.u > 0.0) or parts[:1]


def shared_gains(
    a: Sequence[ComparedRun], b: Sequence[ComparedRun]
) -> tuple[frozenset[str], tuple[str, ...]]:
    """Sensors whose gains logs of both sides can share, and those whose rig files state unlike
    gains.

    A simulated log has no sensors and so shares no error.
    """
    stated: dict[str, list[float]] = {}
    for run in (*a, *b):
        for name, gain in run.gains.items():
            if gain.sharable:
                stated.setdefault(name, []).append(gain.u)
    # Each log has its own uncertainty of the lags of one logger.
    alike = {name: found for name, found in stated.items() if name != TIMING}
    unlike = {name for name, found in alike.items() if max(found) - min(found) > SAME * max(found)}
    return frozenset(stated) - unlike, tuple(sorted(unlike))
