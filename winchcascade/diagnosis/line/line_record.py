"""The diagnosis of a winch without a model as JSON: the fields that others rely on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.diagnosis.diagnosis_record import SCHEMA, cause_record, number
from winchcascade.diagnosis.line.line_data import beside
from winchcascade.diagnosis.line.line_gap import sentence

if TYPE_CHECKING:
    from winchcascade.diagnosis.line.line_closure import Judged
    from winchcascade.diagnosis.line.line_data import Part
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.diagnosis.line.line_gap import Row
    from winchcascade.diagnosis.line.line_next_run import LineExperiment


def as_json(found: LineDiagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units. There is no load, no shaft speed and no current."""
    gap = found.verdict != "no_gap"
    return {
        "schema": SCHEMA,
        "title": found.title,
        "data": origin_record(joint_origin([part.run.origin for part in found.lines.parts])),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(found.lines.names),
        "logs": [
            {**_part(part), "sha256": part.run.sha256, "load_ohm": None, "data": origin_record(part.run.origin)}
            for part in found.lines.parts
        ],
        "verdict": found.verdict,
        "where": _where(found) if gap else None,
        "causes": [{**cause_record(cause), "closes_alone_of_the_gap": number(cause.weight)} for cause in found.causes],
        "closure": None if found.judged is None else _closure(found.judged),
        "remainder": _remainder(found) if gap else None,
        "next_experiment": None if found.experiment is None else _experiment(found.experiment),
        "sets": [
            {
                "effects": list(names),
                "error": number(found.choice.error(names)),
                "probability": number(found.choice.probability[names]),
                "as_good_as_the_best": found.choice.as_good(names),
            }
            for names in sorted(found.choice.errors, key=found.choice.error)
        ],
        "acceleration": {
            "samples": 2 * beside(found.lines.parts[0].run, found.lines.span) + 1,
            "span_s": number(found.lines.span),
            "tried_s": [number(span) for span in found.lines.spans],
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
        "bias": number(row.bias),
        "rms": number(row.rms),
        "noise": number(row.noise),
        "u_noise": number(row.u_noise),
        "u_repeat": number(row.u_repeat),
        "z": number(row.z),
        "share_of_squares": number(row.share),
    }


def _closure(judged: Judged) -> dict[str, Any]:
    power = judged.power
    return {
        "withheld": [_part(part) for part in judged.parts if part.withheld],
        "left_out_in_turn": judged.left_out_in_turn,
        "channels": {
            "power_mech": {
                "before": number(power.before), "after": number(power.after), "noise": number(power.noise)
            }
        },
        "share_closed": number(judged.closed),
        "share_closed_beyond_noise": number(judged.beyond_noise),
        "interval": [number(judged.low), number(judged.high)],
    }  # fmt: skip


def _remainder(found: LineDiagnosis) -> dict[str, Any]:
    left = found.left
    return {
        "share": number(1.0 if found.judged is None else max(1.0 - found.judged.closed, 0.0)),
        "where": f"power_mech during {left.phase.replace('_', '-')}",
        "slower_than_a_second": number(left.slow),
        "in_bursts": number(left.bursts),
        "alarms": [msgspec.to_builtins(alarm) for alarm in left.alarms],
    }


def _experiment(plan: LineExperiment) -> dict[str, Any]:
    return {
        "loads": [],
        "profile": plan.profile,
        "speed_mps": number(plan.speed),
        "separates": list(plan.separates),
        "expected_z": number(plan.expected_z),
    }
