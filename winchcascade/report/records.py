"""Make the record of a reduction, and its JSON."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import UNSET, UnsetType

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.cascade import PAPER, Cascade, field_of
from winchcascade.core.files import json_bytes
from winchcascade.core.quantity import si_unit
from winchcascade.core.version import __version__
from winchcascade.reduction.bins import STORES
from winchcascade.reduction.efficiency import ALL_METRICS, Metrics, ratio
from winchcascade.reduction.run_record import (
    MAX_SPANS,
    REDUCTION_SCHEMA,
    BudgetRecord,
    CycleRecord,
    FindingRecord,
    Interval95,
    LogRecord,
    Numbers,
    RunRecord,
    StagesRecord,
    UncertaintyRecord,
)
from winchcascade.reduction.uncertainty import BudgetRow, Interval, Uncertainty, shares, uncertainty
from winchcascade.reduction.wave_energies import waves_of

if TYPE_CHECKING:
    from winchcascade.core.channels import Channel
    from winchcascade.core.run import Finding
    from winchcascade.reduction.bins import Bin
    from winchcascade.reduction.reduction_result import CycleResult, Reduction


def read_results(results: Mapping[str, Path]) -> Iterator[tuple[str, RunRecord]]:
    """Results of logs, JSON files, one after the other, with the names of the logs."""
    for name, path in results.items():
        yield name, msgspec.json.decode(path.read_bytes(), type=RunRecord)


def reduction_json(reduction: Reduction, found: Uncertainty | None = None) -> bytes:
    """The reduction of one log as JSON, schema `winchcascade/reduction/1`, with its uncertainty, made here if not given."""
    return json_bytes(reduction_record(reduction, found))


def reduction_record(reduction: Reduction, found: Uncertainty | None = None) -> RunRecord:
    """The record of the reduction of one log with its uncertainty."""
    found = found or uncertainty(reduction)
    run, rig, measured = reduction.run, reduction.rig, reduction.measured_load
    known, names = found.budget, tuple(dict.fromkeys((*ALL_METRICS, *rig.cascade.metrics)))
    freedom = Metrics({m: None if n is None or math.isinf(n) else n for m, n in known.freedom.items()})
    return RunRecord(
        schema=REDUCTION_SCHEMA,
        version=__version__,
        data=origin_record(run.origin),
        log=LogRecord(
            path=run.path,
            table=run.table,
            sha256=run.sha256,
            samples=run.samples,
            fs_hz=run.fs,
            load_ohm=run.load if run.load is not None and math.isfinite(run.load) else None,
            load_source=run.load_source,
            load_measured_ohm=None if measured is None else measured.ohm,
            load_measured_u_ohm=None if measured is None else measured.u,
            open_circuit=run.open_circuit,
            simulated=True if run.simulated else None,
            about=run.about or None,
            repairs=run.repairs,
        ),
        rig={"name": rig.name, "assumed": rig.assumed, "r_drum_m": rig.r_drum},
        window=reduction.window,
        quality=tuple(_finding(f, run.samples) for f in reduction.quality),
        cycles=tuple(
            _cycle(c, rig.cascade, u, limits)
            for c, u, limits in zip(reduction.cycles, known.cycles, known.cycles_by_limits, strict=True)
        ),
        mean=reduction.mean.fields(),
        max_deviation_percent=reduction.max_deviation_percent.fields(),
        standard_uncertainty=found.standard.fields(),
        interval_95=_intervals(found.interval_95),
        uncertainty=UncertaintyRecord(
            seed=found.seed,
            draws=found.draws,
            stated={field_of(name): found.method.get(name) for name in names},
            sensors=known.sensors.fields(names),
            sensors_by_limits=known.by_limits.fields(names) if known.by_limits else {},
            repeatability=known.repeatability.fields(names),
            monte_carlo=found.drawn.fields(names),
            interval_95_sensors=_intervals(found.interval_95_sensors, names),
            degrees_of_freedom=freedom.fields(names),
            budget=tuple(_budget_row(row, known.mean, rig.known_channels, names) for row in known.rows),
            taken_as_exact=tuple(known.exact),
            without_accuracy=tuple(known.unknown),
            undetermined=tuple(field_of(name) for name in known.undetermined),
        ),
        total=reduction.total.fields(),
        bins=tuple(_bin(b, rig.cascade) for b in reduction.bins),
        stages=_stages(reduction, found),
        cycles_from=UNSET if rig.phases.source == "velocity" else rig.phases.source,
        waves=waves_of(reduction) or UNSET,
    )


def _stages(reduction: Reduction, found: Uncertainty) -> StagesRecord | UnsetType:
    """Numbers of the stages where a rig file configures them."""
    cascade, run = reduction.rig.cascade, reduction.run
    if not cascade.configured:
        return UNSET
    powers = {stage.name: stage.power(run.channels, reduction.rig.r_drum) for stage in cascade.stages}
    out: Numbers = {name: both.positive for name, both in reduction.both_ways.items()}
    back: Numbers = {name: both.negative for name, both in reduction.both_ways.items()}
    delivered = {e: pair for e, pair in cascade.pairs.items() if not (run.open_circuit and cascade.undelivered(e))}
    return StagesRecord(
        order=cascade.names,
        power={name: None if power is None else power.text for name, power in powers.items()},
        efficiency=cascade.pairs,
        mean=reduction.mean.fields(cascade.metrics),
        max_deviation_percent=reduction.max_deviation_percent.fields(cascade.metrics),
        standard_uncertainty=found.standard.fields(cascade.metrics),
        interval_95=_intervals(found.interval_95, cascade.metrics),
        total=reduction.total.fields(cascade.metrics),
        energy_out_j=out,
        energy_back_j=back,
        efficiency_out={eta: ratio(out.get(b), out.get(a)) for eta, (a, b) in delivered.items()},
        efficiency_back={eta: ratio(_taken(back.get(a)), _taken(back.get(b))) for eta, (a, b) in delivered.items()},
    )


def _taken(energy: float | None) -> float | None:
    """An energy that flows against the cascade, as a positive number. [J]"""
    return None if energy is None else -energy


def _intervals(intervals: Mapping[str, Interval], names: Sequence[str] = ALL_METRICS) -> dict[str, Interval95 | None]:
    """95 % intervals under the names of written files, None for a metric that has none."""
    return {field_of(m): None if (ends := intervals.get(m)) is None else (ends.low, ends.high) for m in names}


def _budget_row(row: BudgetRow, mean: Metrics, channels: Mapping[str, Channel], names: Sequence[str]) -> BudgetRecord:
    source, contribution, share = row.source, row.of.fields(names), shares(row.of, mean).fields(names)
    if source is None:
        return BudgetRecord(source="bridged gaps", contribution=contribution, share=share)
    return BudgetRecord(
        source=source.channel,
        part=source.part,
        unit="1" if source.part == "gain" else si_unit(channels[source.channel].dimension),
        distribution=source.shape,
        basis=source.basis,
        limit=source.limit,
        standard_uncertainty=source.u,
        origin=source.origin,
        contribution=contribution,
        share=share,
    )


def _finding(finding: Finding, samples: int) -> FindingRecord:
    """One finding of a log with a given number of samples."""
    repair, repaired = finding.repaired, None
    if repair is not None:
        repaired = {"what": repair.what, "applied": repair.applied, "samples": repair.samples}
        repaired |= {"places": len(repair.spans), "spans_s": repair.spans[:MAX_SPANS]}
    return FindingRecord(
        finding.kind, finding.channel, finding.start, finding.end, finding.count, finding.action, finding.message,
        finding.lost_share(samples), repaired,
    )  # fmt: skip


def _cycle(cycle: CycleResult, cascade: Cascade, u: Metrics, by_limits: Metrics | None) -> CycleRecord:
    """One cycle with the standard uncertainties of its metrics, and those by replaced accuracies of its sensors."""
    window = cycle.window
    names = tuple(dict.fromkeys((*ALL_METRICS, *cascade.metrics)))
    return CycleRecord(
        cycle=cycle.cycle,
        complete=cycle.complete,
        phases=cycle.phases.spans,
        phase_summary=cycle.summary,
        window={
            "onset_s": window.onset,
            "cutoff_s": window.cutoff,
            "duration_s": round(window.cutoff - window.onset, 9),
        },
        net_span=cycle.net,
        **cycle.metrics.fields(),
        standard_uncertainty=u.fields(names),
        sensors_by_limits=by_limits.fields(names) if by_limits else {},
        stages=cycle.metrics.fields(cascade.metrics) if cascade.configured else UNSET,
    )


def _bin(item: Bin, cascade: Cascade) -> dict[str, Any]:
    """One bin of generator speed with mean powers, their standard errors, and the powers that are stored meanwhile.

    Those go into the rotor, the spring of the shaft and the capacitor of the DC link while the speed changes, null where the
    rig file states no inertia, stiffness or capacitance. The loss between shaft and DC link is P_mech - P_gen less these.
    """
    row: dict[str, Any] = {"rpm_low": item.rpm_low, "rpm_high": item.rpm_high, "count": item.count}
    for stage in PAPER.names:
        row[f"power_{stage}_w"] = item.power.get(stage)
        row[f"power_{stage}_w_standard_error"] = item.standard_error.get(stage)
    row |= {"torque_nm": item.torque, "torque_nm_standard_error": item.torque_standard_error}
    row |= {f"power_{store}_w": item.stored.get(store) for store in STORES}
    if cascade.configured:
        powers = {f"power_{stage}_w": watts for stage, watts in item.power.items()}
        errors = {f"power_{stage}_w_standard_error": watts for stage, watts in item.standard_error.items()}
        row["stages"] = powers | errors
    return row
