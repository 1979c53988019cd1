"""What a comparison needs of one reduced log, read from its JSON: means, cycles, and the sources of their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

import msgspec

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Stage, field_of
from winchcascade.core.errors import WinchcascadeError
from winchcascade.reduction.uncertainty import SAMPLING

SCHEMA = "winchcascade/reduction/1"

Numbers = dict[str, float | None]
"""Numbers by the names of metrics in written files."""


class CompareError(WinchcascadeError):
    """Results that cannot be compared."""


class Gain(msgspec.Struct, frozen=True):
    """Gain of a sensor, or of the drum radius: its relative standard uncertainty, and what it contributes to each mean."""

    u: float
    of: Mapping[str, float]


class ComparedRun(msgspec.Struct, frozen=True):
    """One reduced log, in SI units by metric; None for what it cannot give.

    Parameters
    ----------
    file : name of the log without folder and ending, which matches logs without a load
    load : inf for an open circuit, None where it is not known [ohm]
    simulated : whether `simulate` made the log: no sensor's error acts on it
    window : rule or length of the integration windows [s]
    cycles_from : source of the cycles by [phases] of the rig file
    window_length, speed : means over the complete cycles: window [s] and plateau of the payout [m/s]
    cycles : values of each metric in the complete cycles that have it
    repeats : whether the cycles repeat each other, so that their scatter shows the repeatability
    sensors : standard uncertainty of each mean by the errors of the sensors; None where it is not known
    gains : by sensor, their sources that are the same in all logs of the same sensors
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
        """Standard uncertainty of a mean by what is of this log alone: zeros, sampling and bridged gaps."""
        gains = sum(gain.of.get(metric, 0.0) ** 2 for gain in self.gains.values())
        return math.sqrt(max((self.sensors[metric] or 0.0) ** 2 - gains, 0.0))


class _Log(msgspec.Struct):
    path: str
    sha256: str = ""
    table: str | None = None
    load_ohm: float | None = None
    open_circuit: bool = False
    simulated: bool | None = None


class _Window(msgspec.Struct):
    duration_s: float


class _Plateau(msgspec.Struct):
    speed_mps: float | None = None


class _Payout(msgspec.Struct):
    plateau: _Plateau | None = None


class _Phases(msgspec.Struct):
    payout: _Payout


class _Cycle(msgspec.Struct):
    complete: bool
    window: _Window
    phase_summary: _Phases


class _Source(msgspec.Struct):
    source: str
    contribution: Numbers
    part: str | None = None
    standard_uncertainty: float | None = None


class _Parts(msgspec.Struct):
    sensors: Numbers = {}
    budget: list[_Source] = []
    without_accuracy: list[str] = []


class _Stages(msgspec.Struct):
    order: list[str]
    power: dict[str, str | None]
    mean: Numbers
    max_deviation_percent: Numbers
    standard_uncertainty: Numbers


class _Record(msgspec.Struct):
    """What is read of a reduction's JSON; versions before the present one lack some of it."""

    log: _Log
    rig: str
    window: str | float
    quality: list[dict[str, Any]]
    cycles: list[_Cycle]
    mean: Numbers
    max_deviation_percent: Numbers
    standard_uncertainty: Numbers
    uncertainty: _Parts | None = None
    cycles_from: str = "velocity"
    stages: _Stages | None = None


def compared_run(record: object, where: str) -> ComparedRun:
    """Take what a comparison needs from a reduction's JSON (schema `winchcascade/reduction/1`).

    Parameters
    ----------
    where : name of the log or of the file, for the sentence of a fault

    Raises
    ------
    CompareError : this is no reduction
    """
    found = record.get("schema") if isinstance(record, dict) else None
    if not isinstance(record, dict) or found != SCHEMA:
        raise CompareError(
            f"{where}: its schema is {found!r}; expected {SCHEMA}, as `winchcascade reduce LOG --json FILE` writes."
        )
    try:
        read = msgspec.convert(record, _Record)
    except msgspec.ValidationError as fault:
        raise CompareError(f"{where}: is no JSON of a reduction ({fault}); reduce its log again.") from None
    log, cascade = read.log, _cascade(read)
    metrics = {m: field_of(m) for m in cascade.all_metrics}
    cycles = _cycles(record["cycles"], metrics)
    done = [cycle for cycle in read.cycles if cycle.complete]
    simulated, parts = log.simulated is True, read.uncertainty or _Parts()
    deviation = _of(read, "max_deviation_percent", metrics)
    repeats = any(value is not None for value in deviation.values())
    sensors = _sensors(_of(read, "standard_uncertainty", metrics), cycles if repeats else {})
    return ComparedRun(
        name=where,
        file=PurePath(log.path).name.partition(".")[0] + ("" if log.table is None else f" {log.table}"),
        load=math.inf if log.open_circuit else log.load_ohm,
        digest=log.sha256,
        rig=read.rig,
        origin=origin_from(record),
        simulated=simulated,
        cascade=cascade,
        window=read.window,
        cycles_from=read.cycles_from,
        window_length=mean_of_known([cycle.window.duration_s for cycle in done]),
        speed=mean_of_known([c.phase_summary.payout.plateau.speed_mps for c in done if c.phase_summary.payout.plateau]),
        complete=len(done),
        findings=len(read.quality),
        mean=_of(read, "mean", metrics),
        cycles=cycles,
        repeats=repeats,
        sensors=dict.fromkeys(metrics, 0.0) if simulated else sensors,
        gains={} if simulated else _gains(parts, metrics, sensors),
        split=frozenset(m for m, name in metrics.items() if any(name in row.contribution for row in parts.budget)),
        measures=_measures(parts, cascade),
        unknown=frozenset(parts.without_accuracy),
        formulas={} if read.stages is None else read.stages.power,
    )


def _cascade(read: _Record) -> Cascade:
    if read.stages is None:
        return PAPER
    return Cascade(tuple(BUILT_IN.get(name) or Stage(name, ()) for name in read.stages.order), configured=True)


def _of(read: _Record, part: str, metrics: Mapping[str, str]) -> Numbers:
    """Numbers of the metrics of a part of the record, those of configured stages among them."""
    values: Numbers = getattr(read, part) | (getattr(read.stages, part) if read.stages else {})
    return {m: values.get(name) for m, name in metrics.items()}


def _cycles(cycles: Sequence[Mapping[str, Any]], metrics: Mapping[str, str]) -> dict[str, tuple[float, ...]]:
    """Values of each metric in the complete cycles that have it."""
    whole = [{**cycle, **(cycle.get("stages") or {})} for cycle in cycles if cycle["complete"]]
    columns = {m: [cycle.get(name) for cycle in whole] for m, name in metrics.items()}
    return {m: tuple(float(x) for x in column if isinstance(x, float | int)) for m, column in columns.items()}


def _sensors(stated: Numbers, cycles: Mapping[str, Sequence[float]]) -> Numbers:
    """Part of stated standard uncertainties that the sensors' errors make: they and the scatter of cycles, in squares.

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


def _gains(parts: _Parts, metrics: Mapping[str, str], sensors: Mapping[str, float | None]) -> dict[str, Gain]:
    """Gains by sensor, that of its acquisition system with it; scaled where a Monte Carlo states more than the budget."""
    found: dict[str, Gain] = {}
    for row in parts.budget:
        if row.part != "gain" or row.source == SAMPLING:
            continue
        before = found.get(row.source, Gain(0.0, {}))
        of = {}
        for metric, name in metrics.items():
            linear, stated = parts.sensors.get(name), sensors[metric]
            scale = stated / linear if linear and stated else 1.0
            of[metric] = math.hypot(before.of.get(metric, 0.0), scale * (row.contribution.get(name) or 0.0))
        found[row.source] = Gain(math.hypot(before.u, row.standard_uncertainty or 0.0), of)
    return found


def _measures(parts: _Parts, cascade: Cascade) -> dict[str, frozenset[str]]:
    """Channels, and the drum radius, whose errors act on each energy of a window."""
    return {
        m: frozenset(row.source for row in parts.budget if row.part and row.contribution.get(field_of(m))) - {SAMPLING}
        for m in cascade.energies
    }


def mean_of_known(values: Sequence[float | None]) -> float | None:
    """Mean of the values that are known, None without any."""
    given = [value for value in values if value is not None]
    return sum(given) / len(given) if given else None
