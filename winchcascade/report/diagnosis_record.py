"""A diagnosis as a record for JSON, with documented fields."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    DiagnosisResult,
    Experiment,
    Minor,
    NamedCause,
    Place,
    Remainder,
    StagePlace,
)
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.line.line_data import CyclePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis, LineRemainder
from winchcascade.diagnosis.suspects import Suspects
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report import diagnosis_words as words
from winchcascade.report.cause_words import SILENT, entry_sentence, trend_sentence
from winchcascade.report.gap_words import about_text, arises_sentence, differs_text, has_own_simulation, where_sentence
from winchcascade.report.line_words import samples_of
from winchcascade.rig.effects.effect import WrongEntry

SCHEMA = "winchcascade/diagnosis/1"


def as_json(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units, loads in ohm, `inf` for an open circuit."""
    return {
        "schema": SCHEMA,
        "title": found.title,
        "data": origin_record(joint_origin(words.origins_of(found))),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(dict.fromkeys(effect.name for effect in found.suspects.values())),
        "logs": [
            {**head, "sha256": run.sha256, "load_ohm": load, "data": origin_record(run.origin)}
            for head, run, load in (
                [(_part(part), part.run, None) for part in found.lines.parts]
                if isinstance(found, LineDiagnosis)
                else [({"file": run.name}, run, _load(run.load)) for run in found.runs]
            )
        ],
        "verdict": found.verdict,
        **_baseline(found),
        "where": _where(found),
        "causes": [
            {
                **_cause(cause, found),
                **_stability(found, cause),
                **(
                    {"closes_alone_of_the_gap": rounded_number(cause.weight)}
                    if isinstance(found, LineDiagnosis)
                    else {}
                ),
            }
            for cause in found.causes
        ],
        "minor": [_minor(one) for one in found.minor],
        **({} if isinstance(found, LineDiagnosis) else {"contributions": _contributions(found)}),
        "closure": _closure(found),
        "remainder": None if found.remainder is None else _remainder(found.remainder),
        "next_experiment": None if found.experiment is None else _experiment(found.experiment, found.suspects),
        **(_choice(found) if isinstance(found, LineDiagnosis) else {}),
    }


def _baseline(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any]:
    """What the logs are compared with, and what an own simulation has in another form than the rig's model."""
    own = None if isinstance(found, LineDiagnosis) else found.own_simulation
    if own is None:
        return {"baseline": "rig", "model_form": []}
    forms = [
        {
            "stage": form.stage,
            "channel": form.channel,
            "phase": form.phase,
            "load_ohm": _load(form.load),
            "bias": rounded_number(form.bias),
            "z": rounded_number(form.z),
            "likely": form.likely,
        }
        for form in own.forms
    ]
    return {"baseline": "own_simulation", "model_form": forms}


def _part(part: CyclePart) -> dict[str, Any]:
    return {
        "file": part.run.name,
        "cycles": [int(part.cycle.min()), int(part.cycle.max())],
        "withheld": part.withheld,
        "samples": int(part.here.size),
    }


def _where(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any] | None:
    where = found.where
    if where is None:
        return None
    line, files = isinstance(found, LineDiagnosis), [run.name for run in found.runs]
    lies = where_sentence(where, own_simulation=has_own_simulation(found))
    record = {
        "stage": where.stage,
        "channel": where.worst.channel,
        "phase": where.worst.phase,
        "load_ohm": _load(where.worst.load),
        "rpm": None if line else [rounded_number(x) for x in where.rpm],
        "i_dc_a": None if line else [rounded_number(x) for x in where.i_dc],
        "sentence": f"{lies} {arises_sentence(where.arises)}".rstrip(),
    }
    if isinstance(found, LineDiagnosis):
        return {**record, "map": map_record(found)}
    return {
        **record,
        "map": map_record(found),
        "stages": [{"stage": p.stage, "inputs": list(p.inputs), **_place(p, files)} for p in found.stages],
    }


def map_record(found: ModelDiagnosis | LineDiagnosis) -> list[dict[str, Any]]:
    """Every place of the map of the gap, also where there is no gap."""
    if isinstance(found, LineDiagnosis):
        return [{**_place(p), "share_of_squares": rounded_number(p.share)} for p in found.places]
    files = [run.name for run in found.runs]
    return [_place(place, files) for place in found.places]


def _place(place: Place | StagePlace, files: list[str] | None = None) -> dict[str, Any]:
    """One place of a map; with a model its log and the tolerance of the rig too."""
    return {
        "channel": place.channel,
        "phase": place.phase,
        **({"file": files[place.log]} if files else {}),
        "load_ohm": _load(place.load),
        "blocks": place.blocks,
        "bias": rounded_number(place.bias),
        "rms": rounded_number(place.rms),
        "noise": rounded_number(place.noise),
        "u_noise": rounded_number(place.u_noise),
        "u_repeat": rounded_number(place.u_repeat),
        **({"u_tolerance": rounded_number(place.u_tolerance)} if files else {}),
        "z": rounded_number(place.z),
    }


def _cause(cause: NamedCause, found: DiagnosisResult) -> dict[str, Any]:
    effect = found.suspects[cause.effect]
    return {
        "effect": effect.name,
        **_entry(cause, effect.entry),
        "label": effect.label,
        "stage": cause.stage,
        "probability": rounded_number(cause.probability),
        "parameters": {name: _numbers(x) for name, x in cause.parameters.items()},
        "rivals": [
            {
                "effect": found.suspects[r.effect].name,
                "probability": rounded_number(r.probability),
                "told_apart_by": differs_text(r.differs),
            }
            for r in cause.rivals
        ],
    }


def _stability(found: DiagnosisResult, cause: NamedCause) -> dict[str, Any]:
    """The number of a cause run by run, and what differs between the runs; nothing without a model."""
    if cause.stability is None:
        return {}
    files = words.files_of(found)
    return {
        "stability": [
            {
                "run": files[one.run],
                "value": rounded_number(one.value),
                "low": rounded_number(one.low),
                "high": rounded_number(one.high),
            }
            | ({} if math.isfinite(one.value) else {"reason": SILENT[one.withheld]})
            for one in cause.stability.runs
        ],
        "trends": [
            {**_numbers(trend), "sentence": trend_sentence(found, cause, trend)} for trend in cause.stability.trends
        ],
    }


def _entry(cause: NamedCause, entry: WrongEntry | None) -> dict[str, Any]:
    """Of a wrong entry, the sentence on what is stated and what fits; of a wrong load, its run and the stated load."""
    if entry is None:
        return {}
    run = {"run": entry.source, "load_ohm": entry.stated} if entry.log >= 0 else {}
    return {**run, "sentence": entry_sentence(cause, entry)}


def _minor(one: Minor) -> dict[str, Any]:
    largest = one.largest
    return {
        "effect": one.effect,
        "stage": one.stage,
        "parameters": {name: _numbers(x) for name, x in one.parameters.items()},
        "largest": {
            "metric" if largest.phase is None else "channel": largest.name,
            **({} if largest.phase is None else {"phase": largest.phase}),
            "load_ohm": _load(largest.load),
            "change": rounded_number(largest.change),
        },
    }


def _numbers(of: msgspec.Struct) -> dict[str, Any]:
    """Fields of a struct of numbers and texts."""
    return {name: rounded_number(x) if isinstance(x, float) else x for name, x in msgspec.structs.asdict(of).items()}


def _contributions(found: ModelDiagnosis) -> list[dict[str, Any]]:
    """The split of every metric of every run; with the digits with which the parts add up."""
    return [
        {
            "run": found.runs[one.log].name,
            "load_ohm": _load(one.load),
            "metric": FIELDS.get(one.metric, one.metric),
            "as_given": rounded_number(one.as_given, SUMMED),
            "measured": rounded_number(one.measured, SUMMED),
            "parts": [
                {
                    "effect": None if part.effect is None else effect_name(part.effect),
                    "kind": part.kind,
                    "value": rounded_number(part.value, SUMMED),
                    "low": rounded_number(part.low),
                    "high": rounded_number(part.high),
                }
                for part in one.parts
            ],
        }
        for one in found.contributions
    ]


def _closure(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any] | None:
    if found.closure is None:
        return None
    withheld: list[Any]
    in_turn, beyond = {}, {}
    if isinstance(found, LineDiagnosis):
        withheld = [_part(part) for part in found.lines.parts if part.withheld]
        in_turn = {"left_out_in_turn": not withheld}
        beyond = {"share_closed_beyond_noise": rounded_number(found.closure.beyond_noise)}
    else:
        withheld = [_load(found.runs[k].load) for k in found.closure.withheld]
    return {
        "withheld": withheld,
        **in_turn,
        "channels": {name: _numbers(x) for name, x in found.closure.channels.items()},
        "share_closed": rounded_number(found.closure.share),
        **beyond,
        "interval": [rounded_number(found.closure.low), rounded_number(found.closure.high)],
    }


def _remainder(left: Remainder) -> dict[str, Any]:
    shape = {}
    if isinstance(left, LineRemainder):
        shape = {"slower_than_a_second": rounded_number(left.slow), "in_bursts": rounded_number(left.bursts)}
    return {
        "share": rounded_number(left.share),
        "where": None if left.worst is None else about_text(left.worst),
        **shape,
        "alarms": [
            {"kind": alarm.kind, "where": about_text(alarm.about), "size": alarm.size, "limit": alarm.limit}
            for alarm in left.alarms
        ],
    }


def _experiment(plan: Experiment, suspects: Suspects) -> dict[str, Any]:
    return {
        "loads": [] if plan.load is None else [_load(plan.load)],
        "profile": words.profile_words(plan),
        "speed_mps": rounded_number(plan.speed),
        **({"length_m": rounded_number(plan.length)} if plan.motion == "cycle" else {}),
        "separates": [suspects[name].name for name in plan.separates],
        "expected_z": rounded_number(plan.expected_z),
    }


def _choice(found: LineDiagnosis) -> dict[str, Any]:
    """Every set of suspects of a winch without a model, and over what its acceleration was taken."""
    choice = found.choice
    return {
        "sets": [
            {
                "effects": list(names),
                "error": rounded_number(choice.error(names)),
                "probability": rounded_number(choice.probability[names]),
                "as_good_as_the_best": choice.as_good(names),
            }
            for names in sorted(choice.errors, key=choice.error)
        ],
        "acceleration": {
            "samples": samples_of(found),
            "span_s": rounded_number(found.lines.span),
            "tried_s": [rounded_number(span) for span in found.lines.spans],
        },
    }


def _load(load: float | None) -> float | str | None:
    return "inf" if load is not None and math.isinf(load) else load


SUMMED = 12
"""Significant digits of numbers that add up."""


def rounded_number(x: float, digits: int = 6) -> float | None:
    """A number at some significant digits, None for one that is not finite."""
    return float(f"{x:.{digits}g}") if math.isfinite(x) else None
