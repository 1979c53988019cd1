"""What a comparison needs of one reduced log, read from its JSON: means, cycles, and the sources
of their uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import PurePath

import msgspec

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import Cascade, field_of
from winchcascade.core.errors import WinchcascadeError
from winchcascade.reduction.campaign_record import configured_cascade
from winchcascade.reduction.error_model import SAMPLING
from winchcascade.reduction.run_record import CycleRecord, Numbers, RunRecord, UncertaintyRecord
from winchcascade.reduction.timing import TIMING


class CompareError(WinchcascadeError):
    """Results that cannot be compared."""


class Gain(msgspec.Struct, frozen=True):
    """Error of a sensor, or of the drum radius, that is the same in all logs of a side: its
    standard uncertainty, and what it contributes to each mean. A gain may be `sharable` by both
    sides; a zero may be set anew between them.
    """

    u: float
    of: Mapping[str, float]
    sharable: bool = True


class ComparedRun(msgspec.Struct, frozen=True):
    """One reduced log, in SI units by metric; None for what it cannot give.

    Parameters
    ----------
    file : name of the log without folder and ending, which matches logs without a load
    load : inf for an open circuit, None where it is not known [ohm]
    simulated : whether `simulate` made the log: no error of a sensor acts on it
    window : rule or length of the integration windows [s]
    cycles_from : source of the cycles by [phases] of the rig file
    window_length, speed : means over the complete cycles: window [s] and plateau of the payout
        [m/s]
    cycles : values of each metric in the complete cycles that have it
    repeats : whether the cycles repeat each other, so that their scatter shows the repeatability
    sensors : standard uncertainty of each mean by the errors of the sensors; None where it is not
        known
    gains : by sensor, their errors that are the same in all logs of the same sensors; a zero that
        only the accuracy of a sensor limits has an entry of its own
    split : metrics whose contributions are known by source
    measures : channels with an error that each energy depends on
    unknown : channels without a stated accuracy
    formulas : what the power of each stage is made of, where a rig file states the stages
    """

    name: str
    file: str
    load: float | None
    digest: str
    rig: str
    origin: Origin
    simulated: bool
    cascade: Cascade
    window: str | float
    cycles_from: str
    window_length: float | None
    speed: float | None
    complete: int
    findings: int
    mean: Mapping[str, float | None]
    cycles: Mapping[str, tuple[float, ...]]
    repeats: bool
    sensors: Mapping[str, float | None]
    gains: Mapping[str, Gain]
    split: frozenset[str]
    measures: Mapping[str, frozenset[str]]
    unknown: frozenset[str]
    formulas: Mapping[str, str | None]

    def rest(self, metric: str) -> float:
        """Standard uncertainty of a mean by what is of this log alone: calibrated zeros,
        sampling and bridged gaps.
        """
        gains = sum(gain.of.get(metric, 0.0) ** 2 for gain in self.gains.values())
        return math.sqrt(max((self.sensors[metric] or 0.0) ** 2 - gains, 0.0))


def compared_run(record: RunRecord, where: str) -> ComparedRun:
    """Take what a comparison needs from the record of a reduction.

    Parameters
    ----------
    where : name of the log or of the file
    """
    log, cascade = record.log, configured_cascade(record.stages.order if record.stages else ())
    metrics = {m: field_of(m) for m in cascade.all_metrics}
    done = [cycle for cycle in record.cycles if cycle.complete]
    cycles = _cycles(done, metrics)
    simulated, parts = log.simulated is True, record.uncertainty
    deviation = _of(record, "max_deviation_percent", metrics)
    repeats = any(value is not None for value in deviation.values())
    sensors = _sensors(_of(record, "standard_uncertainty", metrics), cycles if repeats else {})
    return ComparedRun(
        name=where,
        file=PurePath(log.path).name.partition(".")[0]
        + ("" if log.table is None else f" {log.table}"),
        load=math.inf if log.open_circuit else log.load_ohm,
        digest=log.sha256,
        rig=record.rig_name,
        origin=origin_from(record.data),
        simulated=simulated,
        cascade=cascade,
        window=record.window,
        cycles_from=record.cycles_from or "velocity",
        window_length=mean_of_known([cycle.window["duration_s"] for cycle in done]),
        speed=record.plateau_speed,
        complete=len(done),
        findings=len(record.quality),
        mean=_of(record, "mean", metrics),
        cycles=cycles,
        repeats=repeats,
        sensors=dict.fromkeys(metrics, 0.0) if simulated else sensors,
        gains={} if simulated else _gains(parts, metrics, sensors),
        split=frozenset(
            m
            for m, name in metrics.items()
            if any(name in row.contribution for row in parts.budget)
        ),
        measures=_measures(parts, cascade),
        unknown=frozenset(parts.without_accuracy),
        formulas=record.stages.power if record.stages else {},
    )


def _of(record: RunRecord, part: str, metrics: Mapping[str, str]) -> Numbers:
    """Numbers of the metrics of a part of the record, those of configured stages among them."""
    values = getattr(record, part)
    return {m: values.get(name) for m, name in metrics.items()}


def _cycles(
    cycles: Sequence[CycleRecord], metrics: Mapping[str, str]
) -> dict[str, tuple[float, ...]]:
    """Values of each metric in the complete cycles that have it."""
    columns = {m: [cycle.numbers.get(name) for cycle in cycles] for m, name in metrics.items()}
    return {m: tuple(x for x in column if x is not None) for m, column in columns.items()}


def _sensors(stated: Numbers, cycles: Mapping[str, Sequence[float]]) -> Numbers:
    """Part of stated standard uncertainties that the sensors' errors make: they and the scatter of
    cycles, in squares.

    Parameters
    ----------
    cycles : values of each metric, where their scatter is part of what is stated
    """
    found: Numbers = {}
    for metric, u in stated.items():
        values = cycles.get(metric, ())
        scatter = scatter_of(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0
        found[metric] = None if u is None else math.sqrt(max(u**2 - scatter**2, 0.0))
    return found


def scatter_of(values: Sequence[float]) -> float:
    """Standard deviation of single values, two or more.

    >>> round(scatter_of([1.0, 2.0, 3.0]), 6)
    1.0
    """
    mean = sum(values) / len(values)
    return math.sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))


def _gains(
    parts: UncertaintyRecord, metrics: Mapping[str, str], sensors: Mapping[str, float | None]
) -> dict[str, Gain]:
    """Gains by sensor, that of its acquisition system with it; scaled where a Monte Carlo states
    more than the budget.

    A zero that is calibrated in place is one of each log. One that an accuracy limits may be the
    whole limit in every log: no number of logs averages it out.
    """
    found: dict[str, Gain] = {}
    for row in parts.budget:
        by_accuracy = row.part == "zero" and row.basis in ("limits", "expanded_uncertainty")
        if not (by_accuracy or row.part in ("gain", "lag")) or row.source == SAMPLING:
            continue
        error = f"{row.source}, zero" if by_accuracy else row.source
        before = found.get(error, Gain(0.0, {}))
        of = {}
        for metric, name in metrics.items():
            linear, stated = parts.sensors.get(name), sensors[metric]
            scale = stated / linear if linear and stated else 1.0
            of[metric] = math.hypot(
                before.of.get(metric, 0.0), scale * (row.contribution.get(name) or 0.0)
            )
        found[error] = Gain(
            math.hypot(before.u, row.standard_uncertainty or 0.0), of, sharable=not by_accuracy
        )
    return found


def _measures(parts: UncertaintyRecord, cascade: Cascade) -> dict[str, frozenset[str]]:
    """Channels, and the drum radius, whose errors act on each energy of a window."""
    return {
        m: frozenset(
            row.source for row in parts.budget if row.part and row.contribution.get(field_of(m))
        )
        - {SAMPLING, TIMING}
        for m in cascade.energies
    }


def mean_of_known(values: Sequence[float | None]) -> float | None:
    """Mean of the values that are known, None without any."""
    given = [value for value in values if value is not None]
    return sum(given) / len(given) if given else None
