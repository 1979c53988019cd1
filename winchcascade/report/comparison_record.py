"""A comparison as nested records, schema `winchcascade/comparison/1`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import ComparedSide, Comparison
from winchcascade.comparison.differences import Difference
from winchcascade.comparison.gate import Gate
from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.cascade import field_of
from winchcascade.core.version import __version__

COMPARISON_SCHEMA = "winchcascade/comparison/1"


def comparison_record(found: Comparison, gate: Gate | None = None) -> dict[str, Any]:
    """The comparison as it is written; differences are B - A in the unit of the name, null where a side has no such mean."""
    return {
        "schema": COMPARISON_SCHEMA,
        "version": __version__,
        "a": _side(found.a),
        "b": _side(found.b),
        "sensors": "same" if found.same_sensors else "independent",
        "shared_gains": list(found.shared),
        "matched_by": found.matched_by,
        "runs": [
            {
                "label": runs.label,
                "load_ohm": _ohms(runs.load),
                "open_circuit": runs.load is not None and math.isinf(runs.load),
                "a": [_log(run) for run in runs.a],
                "b": [_log(run) for run in runs.b],
                "differences": {
                    field_of(m): None if (one := runs.of(m)) is None else difference_record(one) for m in found.metrics
                },
            }
            for runs in found.runs
        ],
        "unmatched": {"a": [_log(run) for run in found.alone_a], "b": [_log(run) for run in found.alone_b]},
        "notes": [
            {"kind": note.kind, "message": note.message, "runs": list(note.runs), "details": list(note.details)}
            for note in found.notes
        ],
        "gate": None if gate is None else _gate(gate),
    }  # fmt: skip


def difference_record(one: Difference) -> dict[str, Any]:
    """One difference; degrees of freedom are null where they are infinite."""
    freedom = one.freedom
    return {
        "a": one.a,
        "b": one.b,
        "difference": one.value,
        "relative": one.relative,
        "standard_uncertainty": one.uncertainty,
        "degrees_of_freedom": None if freedom is None or math.isinf(freedom) else freedom,
        "interval_95": one.interval,
        "excludes_zero": one.excludes_zero,
        "repeatability": one.repeatability,
        "sensors": one.sensors,
        "interval_95_repeatability": one.interval_repeatability,
        "cycles": [one.cycles_a, one.cycles_b],
    }


def difference_rows_of(found: Comparison) -> list[Mapping[str, Any]]:
    """A row for each difference, for frames."""
    rows: list[Mapping[str, Any]] = []
    for runs in found.runs:
        for one in runs.differences:
            low, high = one.interval or (None, None)
            record = difference_record(one) | {"low_95": low, "high_95": high}
            rows.append({"run": runs.label, "load_ohm": runs.load, "metric": field_of(one.metric), **record})
    return rows


def _side(side: ComparedSide) -> dict[str, Any]:
    return {
        "name": side.name,
        "logs": len(side.runs),
        "data": origin_record(joint_origin([run.origin for run in side.runs])),
    }


def _log(run: ComparedRun) -> dict[str, Any]:
    """What a run is called, and what decides whether it can be compared."""
    return {
        "name": run.name,
        "load_ohm": _ohms(run.load),
        "sha256": run.digest,
        "rig": run.rig,
        "measured": run.origin.measured,
        "simulated": True if run.simulated else None,
        "window": run.window,
        "window_s": run.window_length,
        "speed_mps": run.speed,
        "complete": run.complete,
        "findings": run.findings,
    }


def _ohms(load: float | None) -> float | None:
    return None if load is None or math.isinf(load) else load


def _gate(gate: Gate) -> dict[str, Any]:
    return {
        "metric": gate.metric,
        "max_drop": gate.limit,
        "ok": gate.ok,
        "drops": [
            {"label": drop.label, "load_ohm": _ohms(drop.load), "drop": drop.value, "interval_95": drop.interval,
             "verdict": drop.verdict}
            for drop in gate.drops
        ],
        "without": list(gate.without),
    }  # fmt: skip
