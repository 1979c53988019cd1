"""A reduction as plain records: the JSON of one log."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade.core.campaign_file import origin_record
from winchcascade.core.files import write_content
from winchcascade.core.quantity import KGF, si_unit
from winchcascade.core.run import CHANNELS
from winchcascade.core.version import __version__
from winchcascade.reduction.efficiency import ALL_METRICS
from winchcascade.reduction.energies import STAGES
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.uncertainty import shares

if TYPE_CHECKING:
    from winchcascade.core.run import Finding
    from winchcascade.reduction.bins import Bin
    from winchcascade.reduction.efficiency import Metrics
    from winchcascade.reduction.montecarlo import Interval, Uncertainty
    from winchcascade.reduction.phase_summary import HaulInSummary, HoldSummary, PayoutSummary
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.reduction.uncertainty import Contribution

SCHEMA = "winchcascade/reduction/1"
_KGCM2 = KGF * 1e4

FIELDS = {
    name: name + ("_j" if name.startswith("energy") else "_w" if name.startswith("power") else "")
    for name in ALL_METRICS
}
"""The metrics of windows and of whole cycles as written files call them: with their unit."""


def reduction_json(reduction: Reduction, found: Uncertainty | None = None) -> bytes:
    """The reduction of one log as JSON, schema `winchcascade/reduction/1`, with its uncertainty, made here if not given."""
    import msgspec

    return msgspec.json.format(msgspec.json.encode(reduction_record(reduction, found)), indent=1) + b"\n"


def reduction_record(reduction: Reduction, found: Uncertainty | None = None) -> dict[str, Any]:
    """The reduction of one log with its uncertainty as nested records; numbers that do not exist are None."""
    found = found or uncertainty(reduction)
    run = reduction.run
    return {
        "schema": SCHEMA,
        "version": __version__,
        "data": origin_record(run.origin),
        "log": {
            "path": run.path,
            "table": run.table,
            "sha256": run.sha256,
            "samples": run.samples,
            "fs_hz": run.fs,
            "load_ohm": run.load if run.load is not None and math.isfinite(run.load) else None,
            "load_source": run.load_source,
            "open_circuit": run.open_circuit,
            "simulated": True if run.simulated else None,
            "about": run.about or None,
        },
        "rig": reduction.rig.name,
        "window": reduction.window,
        "quality": [finding_record(f, run.samples) for f in reduction.quality],
        "cycles": [
            {**cycle_record(c), "standard_uncertainty": metrics_record(u)}
            for c, u in zip(reduction.cycles, found.budget.cycles, strict=True)
        ],
        "mean": metrics_record(reduction.mean),
        "max_deviation_percent": metrics_record(reduction.max_deviation_percent),
        "standard_uncertainty": metrics_record(found.standard),
        "interval_95": interval_record(found.interval_95),
        "uncertainty": uncertainty_record(found),
        "total": metrics_record(reduction.total),
        "bins": [bin_record(b) for b in reduction.bins],
    }


def metrics_record(metrics: Metrics) -> dict[str, float | None]:
    """The metrics under the names of written files."""
    return {field: getattr(metrics, name) for name, field in FIELDS.items()}


def interval_record(intervals: Mapping[str, Interval]) -> dict[str, list[float] | None]:
    """95 % intervals under the names of written files, None for a metric that has none."""
    return {
        field: None if (ends := intervals.get(name)) is None else [ends.low, ends.high]
        for name, field in FIELDS.items()
    }


def uncertainty_record(found: Uncertainty) -> dict[str, Any]:
    """How the uncertainty of the means came about: its parts, the Monte Carlo, and the budget of the sensors."""
    known = found.budget
    return {
        "seed": found.seed,
        "draws": found.draws,
        "stated": {field: found.method.get(name) for name, field in FIELDS.items()},
        "sensors": metrics_record(known.sensors),
        "repeatability": metrics_record(known.repeatability),
        "monte_carlo": metrics_record(found.drawn),
        "interval_95_sensors": interval_record(found.interval_95_sensors),
        "degrees_of_freedom": {
            field: None if (n := getattr(known.freedom, name)) is None or math.isinf(n) else n
            for name, field in FIELDS.items()
        },
        "budget": [_budget_row(row, known.mean) for row in known.rows],
        "taken_as_exact": list(known.exact),
        "without_accuracy": list(known.unknown),
        "undetermined": [FIELDS[name] for name in known.undetermined],
    }


def _budget_row(row: Contribution, mean: Metrics) -> dict[str, Any]:
    """One row of the budget: in the SI unit of the channel, or relative for a gain; shares are of the mean's variance."""
    source = row.source
    about: dict[str, Any] = {"source": "bridged gaps"}
    if source is not None:
        unit = "1" if source.part == "gain" else si_unit(CHANNELS[source.channel].dimension)
        about = {
            "source": source.channel,
            "part": source.part,
            "unit": unit,
            "distribution": source.shape,
            "limit": source.limit,
            "standard_uncertainty": source.u,
            "from": source.origin,
        }
    return {**about, "contribution": metrics_record(row.of), "share": metrics_record(shares(row.of, mean))}


def finding_record(finding: Finding, samples: int) -> dict[str, Any]:
    """One finding, with the share of the log's samples that it removed."""
    return {
        "kind": finding.kind,
        "channel": finding.channel,
        "start_s": finding.start,
        "end_s": finding.end,
        "count": finding.count,
        "action": finding.action,
        "message": finding.message,
        "removed_share": finding.removed / samples if samples else 0.0,
    }


def cycle_record(cycle: CycleResult) -> dict[str, Any]:
    """One cycle with its phases, their summary, its window and its metrics."""
    phases, window = cycle.phases, cycle.window
    return {
        "cycle": cycle.cycle,
        "complete": cycle.complete,
        "phases": {
            "payout": [phases.onset, phases.payout_end],
            "hold": None if phases.hold is None else list(phases.hold),
            "haul_in": None if phases.haul_in is None else list(phases.haul_in),
        },
        "phase_summary": {
            "payout": _payout(cycle.summary.payout),
            "hold": _hold(cycle.summary.hold),
            "haul_in": _haul_in(cycle.summary.haul_in),
        },
        "window": {
            "onset_s": window.onset,
            "cutoff_s": window.cutoff,
            "duration_s": _seconds(window.cutoff - window.onset),
        },
        "net_span": {
            "begin_s": cycle.net.begin,
            "end_s": cycle.net.end,
            "travel_m": cycle.net.travel,
            "reason": cycle.net.reason,
        },
        **metrics_record(cycle.metrics),
    }


def _seconds(duration: float) -> float:
    """A difference of stamps without the dust of their subtraction."""
    return round(duration, 9)


def _payout(payout: PayoutSummary) -> dict[str, Any]:
    flat = payout.plateau
    return {
        "duration_s": _seconds(payout.duration),
        "travel_m": payout.travel,
        "speed_max_mps": payout.speed_max,
        "plateau": None
        if flat is None
        else {
            "begin_s": flat.begin,
            "braking_s": flat.braking,
            "speed_mps": flat.speed,
            "force_n": flat.force,
            "torque_nm": flat.torque,
            "power_line_w": flat.power_line,
            "power_mech_w": flat.power_mech,
            "power_gen_w": flat.power_gen,
        },
    }


def _hold(hold: HoldSummary | None) -> dict[str, Any] | None:
    if hold is None:
        return None
    return {
        "duration_s": _seconds(hold.duration),
        "force_n": hold.force,
        "torque_nm": hold.torque,
        "pressure_kgcm2": None if hold.pressure is None else hold.pressure / _KGCM2,
    }


def _haul_in(haul_in: HaulInSummary | None) -> dict[str, Any] | None:
    if haul_in is None:
        return None
    return {
        "duration_s": _seconds(haul_in.duration),
        "speed_max_mps": haul_in.speed_max,
        "force_n": haul_in.force,
        "force_min_n": haul_in.force_min,
        "energy_line_j": haul_in.energy_line,
    }


def bin_record(item: Bin) -> dict[str, Any]:
    """One bin of generator speed with mean powers and their standard errors."""
    record: dict[str, Any] = {"rpm_low": item.rpm_low, "rpm_high": item.rpm_high, "count": item.count}
    for stage in STAGES:
        record[f"power_{stage}_w"] = item.power[stage]
        record[f"power_{stage}_w_standard_error"] = item.standard_error[stage]
    return record | {"torque_nm": item.torque, "torque_nm_standard_error": item.torque_standard_error}


def write_json(reduction: Reduction, found: Uncertainty, path: Path, *, force: bool = False) -> None:
    """Write the JSON of one log; whole or not at all."""
    write_content(path, reduction_json(reduction, found), force=force)
