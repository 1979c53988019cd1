"""The diagnosis of a winch without a model as JSON: the fields that others rely on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.diagnose.line.data import beside
from winchcascade.diagnose.line.where import sentence
from winchcascade.diagnose.record import SCHEMA

if TYPE_CHECKING:
    from winchcascade.diagnose.causes import Cause
    from winchcascade.diagnose.line.campaign import LineDiagnosis
    from winchcascade.diagnose.line.closure import Judged
    from winchcascade.diagnose.line.data import Part
    from winchcascade.diagnose.line.experiment import LineExperiment
    from winchcascade.diagnose.line.where import Row


def as_json(found: LineDiagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units. There is no load, no shaft speed and no current."""
    gap = found.verdict != "no_gap"
    return {
        "schema": SCHEMA,
        "title": found.title,
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(found.lines.names),
        "logs": [{**_part(part), "sha256": part.run.sha256, "load_ohm": None} for part in found.lines.parts],
        "verdict": found.verdict,
        "where": _where(found) if gap else None,
        "causes": [_cause(cause) for cause in found.causes],
        "closure": None if found.judged is None else _closure(found.judged),
        "remainder": _remainder(found) if gap else None,
        "next_experiment": None if found.experiment is None else _experiment(found.experiment),
        "sets": [
            {
                "effects": list(names),
                "error": _number(found.choice.error(names)),
                "probability": _number(found.choice.probability[names]),
                "as_good_as_the_best": found.choice.as_good(names),
            }
            for names in sorted(found.choice.errors, key=found.choice.error)
        ],
        "acceleration": {
            "samples": 2 * beside(found.lines.parts[0].run, found.lines.span) + 1,
            "span_s": _number(found.lines.span),
            "tried_s": [_number(span) for span in found.lines.spans],
        },
    }


def _part(part: Part) -> dict[str, Any]:
    cycles = [int(part.cycle.min()), int(part.cycle.max())]
    return {"file": part.run.name, "cycles": cycles, "withheld": part.withheld, "samples": int(part.here.size)}


def _where(found: LineDiagnosis) -> dict[str, Any]:
    return {
        "stage": found.stage,
        "channel": "power_mech",
        "phase": found.phase,
        "load_ohm": None,
        "rpm": None,
        "i_dc_a": None,
        "sentence": sentence(found.stage, found.rows),
        "map": [_row(row) for row in found.rows],
    }


def _row(row: Row) -> dict[str, Any]:
    return {
        "channel": "power_mech",
        "phase": row.phase,
        "load_ohm": None,
        "blocks": row.blocks,
        "bias": _number(row.bias),
        "rms": _number(row.rms),
        "noise": _number(row.noise),
        "u_noise": _number(row.u_noise),
        "u_repeat": _number(row.u_repeat),
        "z": _number(row.z),
        "share_of_squares": _number(row.share),
    }


def _cause(cause: Cause) -> dict[str, Any]:
    return {
        "effect": cause.effect,
        "stage": cause.stage,
        "probability": _number(cause.probability),
        "closes_alone_of_the_gap": _number(cause.weight),
        "parameters": {
            name: {"value": _number(x.value), "low": _number(x.low), "high": _number(x.high), "unit": x.unit}
            for name, x in cause.parameters.items()
        },
        "rivals": [
            {"effect": r.effect, "probability": _number(r.probability), "told_apart_by": r.told_apart_by}
            for r in cause.rivals
        ],
    }


def _closure(judged: Judged) -> dict[str, Any]:
    power = judged.power
    return {
        "withheld": [_part(part) for part in judged.parts if part.withheld],
        "left_out_in_turn": judged.left_out_in_turn,
        "channels": {
            "power_mech": {
                "before": _number(power.before), "after": _number(power.after), "noise": _number(power.noise)
            }
        },
        "share_closed": _number(judged.closed),
        "share_closed_beyond_noise": _number(judged.beyond_noise),
        "interval": [_number(judged.low), _number(judged.high)],
    }  # fmt: skip


def _remainder(found: LineDiagnosis) -> dict[str, Any]:
    left = found.left
    return {
        "share": _number(1.0 if found.judged is None else max(1.0 - found.judged.closed, 0.0)),
        "where": f"power_mech during {left.phase.replace('_', '-')}",
        "slower_than_a_second": _number(left.slow),
        "in_bursts": _number(left.bursts),
        "alarms": [msgspec.to_builtins(alarm) for alarm in left.alarms],
    }


def _experiment(plan: LineExperiment) -> dict[str, Any]:
    return {
        "loads": [],
        "profile": plan.profile,
        "speed_mps": _number(plan.speed),
        "separates": list(plan.separates),
        "expected_z": _number(plan.expected_z),
    }


def _number(x: float) -> float | None:
    return float(f"{x:.6g}") if math.isfinite(x) else None
