"""A diagnosis as JSON: the fields that others rely on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.diagnosis.line.line_closure import LineClosure, LineRemainder
from winchcascade.diagnosis.line.line_data import beside
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report.diagnosis_words import (
    about_text,
    arises_sentence,
    differs_text,
    origins_of,
    profile_words,
    where_sentence,
)

if TYPE_CHECKING:
    from winchcascade.diagnosis.closure import ModelClosure
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import Experiment, NamedCause, Remainder
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.line.line_data import CyclePart
    from winchcascade.diagnosis.stagewise import StagePlace

SCHEMA = "winchcascade/diagnosis/1"


def as_json(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units, loads in ohm, `inf` for an open circuit."""
    line = isinstance(found, LineDiagnosis)
    record = {
        "schema": SCHEMA,
        "title": found.title,
        "data": origin_record(joint_origin(origins_of(found))),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(found.suspects),
        "logs": _line_logs(found) if isinstance(found, LineDiagnosis) else _logs(found),
        "verdict": found.verdict,
        "where": _where(found),
        "causes": [
            {**_cause(cause), **({"closes_alone_of_the_gap": number(cause.weight)} if line else {})}
            for cause in found.causes
        ],
        "closure": None if found.closure is None else _closure(found, found.closure),
        "remainder": None if found.remainder is None else _remainder(found.remainder),
        "next_experiment": None if found.experiment is None else _experiment(found.experiment),
    }
    return {**record, **_choice(found)} if isinstance(found, LineDiagnosis) else record


def _logs(found: ModelDiagnosis) -> list[dict[str, Any]]:
    return [
        {"file": run.name, "sha256": run.sha256, "load_ohm": _load(run.load), "data": origin_record(run.origin)}
        for run in found.runs
    ]


def _line_logs(found: LineDiagnosis) -> list[dict[str, Any]]:
    return [
        {**_part(part), "sha256": part.run.sha256, "load_ohm": None, "data": origin_record(part.run.origin)}
        for part in found.lines.parts
    ]


def _part(part: CyclePart) -> dict[str, Any]:
    cycles = [int(part.cycle.min()), int(part.cycle.max())]
    return {"file": part.run.name, "cycles": cycles, "withheld": part.withheld, "samples": int(part.here.size)}


def _where(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any] | None:
    where = found.where
    if where is None:
        return None
    line, worst = isinstance(found, LineDiagnosis), where.worst
    record = {
        "stage": where.stage,
        "channel": worst.channel,
        "phase": worst.phase,
        "load_ohm": _load(worst.load),
        "rpm": None if line else [number(x) for x in where.rpm],
        "i_dc_a": None if line else [number(x) for x in where.i_dc],
        "sentence": f"{where_sentence(where)} {arises_sentence(where.arises)}".rstrip(),
    }
    if isinstance(found, LineDiagnosis):
        return {**record, "map": [{**_place(p), "share_of_squares": number(p.share)} for p in found.places]}
    files = [run.name for run in found.runs]
    return {
        **record,
        "map": [_place(place, files) for place in found.places],
        "stages": [
            {"stage": place.stage, "inputs": list(place.inputs), **_place(place, files)} for place in found.stages
        ],
    }


def _place(place: Place | StagePlace, files: list[str] | None = None) -> dict[str, Any]:
    """One place of a map; with a model its log and the tolerance of the rig too."""
    return {
        "channel": place.channel,
        "phase": place.phase,
        **({"file": files[place.log]} if files else {}),
        "load_ohm": _load(place.load),
        "blocks": place.blocks,
        "bias": number(place.bias),
        "rms": number(place.rms),
        "noise": number(place.noise),
        "u_noise": number(place.u_noise),
        "u_repeat": number(place.u_repeat),
        **({"u_tolerance": number(place.u_tolerance)} if files else {}),
        "z": number(place.z),
    }


def _cause(cause: NamedCause) -> dict[str, Any]:
    return {
        "effect": cause.effect,
        "stage": cause.stage,
        "probability": number(cause.probability),
        "parameters": {
            name: {"value": number(x.value), "low": number(x.low), "high": number(x.high), "unit": x.unit}
            for name, x in cause.parameters.items()
        },
        "rivals": [
            {"effect": r.effect, "probability": number(r.probability), "told_apart_by": differs_text(r.differs)}
            for r in cause.rivals
        ],
    }


def _closure(found: ModelDiagnosis | LineDiagnosis, closure: ModelClosure | LineClosure) -> dict[str, Any]:
    channels = {
        name: {"before": number(x.before), "after": number(x.after), "noise": number(x.noise)}
        for name, x in closure.channels.items()
    }
    record = {"channels": channels, "share_closed": number(closure.share)}
    interval = {"interval": [number(closure.low), number(closure.high)]}
    if isinstance(closure, LineClosure):
        withheld, turn = [_part(part) for part in closure.parts if part.withheld], closure.left_out_in_turn
        beyond = {"share_closed_beyond_noise": number(closure.beyond_noise)}
        return {"withheld": withheld, "left_out_in_turn": turn, **record, **beyond, **interval}
    return {"withheld": [_load(found.runs[k].load) for k in closure.withheld], **record, **interval}


def _remainder(left: Remainder) -> dict[str, Any]:
    shape = {}
    if isinstance(left, LineRemainder):
        shape = {"slower_than_a_second": number(left.slow), "in_bursts": number(left.bursts)}
    return {
        "share": number(left.share),
        "where": None if left.worst is None else about_text(left.worst),
        **shape,
        "alarms": [
            {"kind": alarm.kind, "where": about_text(alarm.about), "size": alarm.size, "limit": alarm.limit}
            for alarm in left.alarms
        ],
    }


def _experiment(plan: Experiment) -> dict[str, Any]:
    return {
        "loads": [] if plan.load is None else [_load(plan.load)],
        "profile": profile_words(plan),
        "speed_mps": number(plan.speed),
        **({"length_m": number(plan.length)} if plan.motion == "cycle" else {}),
        "separates": list(plan.separates),
        "expected_z": number(plan.expected_z),
    }


def _choice(found: LineDiagnosis) -> dict[str, Any]:
    """Every set of suspects of a winch without a model, and over what its acceleration was taken."""
    choice, lines = found.choice, found.lines
    return {
        "sets": [
            {
                "effects": list(names),
                "error": number(choice.error(names)),
                "probability": number(choice.probability[names]),
                "as_good_as_the_best": choice.as_good(names),
            }
            for names in sorted(choice.errors, key=choice.error)
        ],
        "acceleration": {
            "samples": 2 * beside(lines.parts[0].run, lines.span) + 1,
            "span_s": number(lines.span),
            "tried_s": [number(span) for span in lines.spans],
        },
    }


def _load(load: float | None) -> float | str | None:
    return "inf" if load is not None and math.isinf(load) else load


def number(x: float) -> float | None:
    """A number at six digits, None for one that is not finite."""
    return float(f"{x:.6g}") if math.isfinite(x) else None
