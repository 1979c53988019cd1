"""The JSON of a comparison."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import ComparedSide, Comparison
from winchcascade.comparison.differences import Difference
from winchcascade.comparison.gate import Gate
from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.cascade import field_of
from winchcascade.core.version import __version__


def comparison_record(found: Comparison, gate: Gate | None = None) -> dict[str, Any]:
    """The comparison as it is written: inf is null there; differences are B - A, null where a
    side has no such mean.
    """
    return {
        "schema": "winchcascade/comparison/1",
        "version": __version__,
        "a": _side(found.a),
        "b": _side(found.b),
        "sensors": "same" if found.same_sensors else "independent",
        "shared_gains": found.shared,
        "matched_by": found.matched_by,
        "runs": [
            {
                "label": runs.label,
                "load_ohm": runs.load,
                "open_circuit": runs.load == math.inf,
                "a": _logs(runs.a),
                "b": _logs(runs.b),
                "differences": {field_of(m): (one := runs.of(m)) and difference_record(one) for m in found.metrics},
            }
            for runs in found.runs
        ],
        "unmatched": {"a": _logs(found.alone_a), "b": _logs(found.alone_b)},
        "notes": msgspec.to_builtins(found.notes),
        "gate": None if gate is None else {
            "metric": gate.metric,
            "max_drop": gate.limit,
            "ok": gate.ok,
            "drops": msgspec.to_builtins(gate.drops),
            "without": gate.without,
        },
    }  # fmt: skip


def difference_record(one: Difference) -> dict[str, Any]:
    """One difference; degrees of freedom are null where they are infinite."""
    row: dict[str, Any] = msgspec.to_builtins(one)
    del row["metric"]
    return row | {"degrees_of_freedom": None if one.freedom == math.inf else one.freedom}


def _side(side: ComparedSide) -> dict[str, Any]:
    data = origin_record(joint_origin([run.origin for run in side.runs]))
    return {"name": side.name, "logs": len(side.runs), "data": data}


def _logs(runs: Sequence[ComparedRun]) -> list[dict[str, Any]]:
    """What runs are called, and what decides whether they can be compared."""
    return [
        {
            "name": run.name,
            "load_ohm": run.load,
            "sha256": run.digest,
            "rig": run.rig,
            "measured": run.origin.measured,
            "simulated": run.simulated or None,
            "window": run.window,
            "window_s": run.window_length,
            "speed_mps": run.speed,
            "complete": run.complete,
            "findings": run.findings,
        }
        for run in runs
    ]
