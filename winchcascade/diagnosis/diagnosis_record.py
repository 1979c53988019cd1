"""A diagnosis as JSON: the fields that others rely on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record

if TYPE_CHECKING:
    from winchcascade.diagnosis.causes import Cause
    from winchcascade.diagnosis.closure import Closure
    from winchcascade.diagnosis.diagnose import Diagnosis
    from winchcascade.diagnosis.gap_location import Where
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.next_run import Experiment
    from winchcascade.diagnosis.stagewise import StagePlace

SCHEMA = "winchcascade/diagnosis/1"


def as_json(found: Diagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units, loads in ohm, `inf` for an open circuit."""
    return {
        "schema": SCHEMA,
        "title": found.title,
        "data": origin_record(joint_origin([log.run.origin for log in found.data.logs])),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(found.suspects),
        "logs": [
            {
                "file": log.run.name,
                "sha256": log.run.sha256,
                "load_ohm": _load(log.run.load),
                "data": origin_record(log.run.origin),
            }
            for log in found.data.logs
        ],
        "verdict": found.verdict,
        "where": None if found.where is None else _where(found.where, found),
        "causes": [cause_record(cause) for cause in found.causes],
        "closure": None if found.closure is None else _closure(found.closure, found),
        "remainder": None
        if found.remainder is None
        else {
            "share": number(found.remainder.share),
            "where": found.remainder.where or None,
            "alarms": [msgspec.to_builtins(alarm) for alarm in found.remainder.alarms],
        },
        "next_experiment": None if found.experiment is None else _experiment(found.experiment),
    }


def _where(where: Where, found: Diagnosis) -> dict[str, Any]:
    return {
        "stage": where.stage,
        "channel": where.channel,
        "phase": where.phase,
        "load_ohm": _load(where.load),
        "rpm": [number(x) for x in where.rpm],
        "i_dc_a": [number(x) for x in where.i_dc],
        "sentence": f"{where.sentence} {where.arises}".rstrip(),
        "map": [_place(place, found) for place in found.places],
        "stages": [
            {"stage": place.stage, "inputs": list(place.inputs), **_place(place, found)} for place in found.stages
        ],
    }


def _place(place: Place | StagePlace, found: Diagnosis) -> dict[str, Any]:
    return {
        "channel": place.channel,
        "phase": place.phase,
        "file": found.data.logs[place.log].run.name,
        "load_ohm": _load(place.load),
        "blocks": place.blocks,
        "bias": number(place.bias),
        "rms": number(place.rms),
        "noise": number(place.noise),
        "u_noise": number(place.u_noise),
        "u_repeat": number(place.u_repeat),
        "u_tolerance": number(place.u_tolerance),
        "z": number(place.z),
    }


def cause_record(cause: Cause) -> dict[str, Any]:
    """One cause by the interface's names."""
    return {
        "effect": cause.effect,
        "stage": cause.stage,
        "probability": number(cause.probability),
        "parameters": {
            name: {"value": number(x.value), "low": number(x.low), "high": number(x.high), "unit": x.unit}
            for name, x in cause.parameters.items()
        },
        "rivals": [
            {"effect": r.effect, "probability": number(r.probability), "told_apart_by": r.told_apart_by}
            for r in cause.rivals
        ],
    }


def _closure(closure: Closure, found: Diagnosis) -> dict[str, Any]:
    return {
        "withheld": [_load(found.data.logs[k].run.load) for k in closure.withheld],
        "channels": {
            name: {"before": number(x.before), "after": number(x.after), "noise": number(x.noise)}
            for name, x in closure.channels.items()
        },
        "share_closed": number(closure.share),
        "interval": [number(closure.low), number(closure.high)],
    }


def _experiment(plan: Experiment) -> dict[str, Any]:
    return {
        "loads": [_load(plan.load)],
        "profile": plan.profile,
        "speed_mps": number(plan.speed),
        "length_m": number(plan.length),
        "separates": list(plan.separates),
        "expected_z": number(plan.expected_z),
    }


def _load(load: float | None) -> float | str | None:
    return "inf" if load is not None and math.isinf(load) else load


def number(x: float) -> float | None:
    """A number at six digits, None for one that is not finite."""
    return float(f"{x:.6g}") if math.isfinite(x) else None
