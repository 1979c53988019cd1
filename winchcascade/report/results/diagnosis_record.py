"""The record of a diagnosis: JSON by the names of the interface, SI units, loads in ohm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    DiagnosisResult,
    Minor,
    NamedCause,
    Place,
    Remainder,
    Reported,
)
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.line.line_data import LinePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.nuisances import calibrated_numbers
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report.diagnosis_names import about_words, files_of, items_of, origins_of
from winchcascade.report.results import diagnosis_sentences as sentences

SCHEMA = "winchcascade/diagnosis/1"

SUMMED = 12
"""Significant digits of numbers that add up."""

_PLACE = ("bias", "rms", "noise", "u_noise", "u_repeat", "u_tolerance", "z")
_ENERGY = ("measured", "before", "after", "u")
_SILENT = {False: "the run hardly depends on this cause", True: "withheld"}
"""Why a run gives no number, by whether it is withheld."""


# ------------------------------------------------------------------------------------------------------ numbers and fields
def rounded_number(x: float, digits: int = 6) -> float | None:
    """A number at some significant digits, None for one that is not finite."""
    return float(f"{x:.{digits}g}") if math.isfinite(x) else None


def _fields(of: msgspec.Struct, *names: str, end: str = "", digits: int = 6) -> dict[str, Any]:
    """Some fields of a struct, all by default, numbers at some digits; a load becomes `load_ohm`, `inf` for an open circuit."""
    found: dict[str, Any] = {}
    for name in names or of.__struct_fields__:
        value = getattr(of, name)
        if name == "load":
            found["load_ohm"] = _load(value)
        else:
            found[f"{name}{end}"] = rounded_number(value, digits) if isinstance(value, float) else value
    return found


def _load(load: float | None) -> float | str | None:
    return "inf" if load is not None and math.isinf(load) else load


def _parameters(numbers: Mapping[str, Reported]) -> dict[str, Any]:
    return {name: _fields(number) for name, number in numbers.items()}


# ------------------------------------------------------------------------------------------------------------- the record
def as_json(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units, loads in ohm, `inf` for an open circuit."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    return {
        "schema": SCHEMA,
        "title": found.title,
        "data": origin_record(joint_origin(origins_of(found))),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(dict.fromkeys(effect.name for effect in found.suspects.values())),
        "logs": _logs(found),
        "simulations": [{"file": run.name, "findings": _findings(run)} for run in (own.runs if own else ())],
        "verdict": found.verdict,
        "baseline": "own_simulation" if own else "rig",
        "model_form": [_fields(form) for form in (own.forms if own else ())],
        "calibrated": _calibrated(found.rig) if isinstance(found, ModelDiagnosis) else [],
        "where": _where(found),
        "causes": [_cause(cause, found) for cause in found.causes],
        "minor": [_minor(one) for one in found.minor],
        "fitted": [
            {
                "effect": found.suspects[cause.effect].name,
                "stage": cause.stage,
                "named": cause in found.causes,
                "parameters": _parameters(cause.parameters),
            }
            for cause in found.fitted
        ],
        **(_line_record(found) if isinstance(found, LineDiagnosis) else _model_record(found)),
        "closure": _closure(found),
        "remainder": None if found.remainder is None else _remainder(found.remainder, found),
        "next_experiment": _experiment(found),
    }


def _logs(found: ModelDiagnosis | LineDiagnosis) -> list[dict[str, Any]]:
    rows: list[tuple[dict[str, Any], Run]] = [({"file": run.name}, run) for run in found.runs]
    line = isinstance(found, LineDiagnosis)
    if isinstance(found, LineDiagnosis):
        rows = [(_part(part), part.run) for part in found.lines.parts]
    return [
        {**head, "sha256": run.sha256, "load_ohm": None if line else _load(run.load), "data": origin_record(run.origin)}
        | {"findings": _findings(run)}
        for head, run in rows
    ]


def _findings(run: Run) -> list[dict[str, Any]]:
    return [_fields(finding, "kind", "channel", "message") for finding in run.findings]


def _part(part: LinePart) -> dict[str, Any]:
    return {
        "file": part.run.name,
        **_fields(part, "cycles", "withheld", "samples"),
    }


def _calibrated(rig: Rig) -> list[dict[str, Any]]:
    """Calibrated numbers, and what a diagnosis starts from in their place, null where the rig file had no number before."""
    return [
        {
            "number": ".".join(place),
            "log": record.log,
            "value": rounded_number(number.value),
            "prior": None if record.prior is None else rounded_number(record.prior.value),
        }
        for place, number in calibrated_numbers(rig).items()
        if (record := number.calibrated) is not None
    ]


def _where(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any] | None:
    where = found.where
    if where is None:
        return None
    line = isinstance(found, LineDiagnosis)
    record = {
        "stage": where.stage,
        **_fields(where.worst, "channel", "phase", "load"),
        "rpm": None if line else [rounded_number(x) for x in where.rpm],
        "i_dc_a": None if line else [rounded_number(x) for x in where.i_dc],
        "sentence": sentences.place_sentence(found),
        "map": map_record(found),
    }
    if isinstance(found, ModelDiagnosis):
        files = files_of(found)
        stages = [{"stage": one.stage, "inputs": list(one.inputs), **_place(one, files)} for one in found.stages]
        return {**record, "stages": stages}
    return record


def map_record(found: ModelDiagnosis | LineDiagnosis) -> list[dict[str, Any]]:
    """Every place of the map of the gap, also where there is no gap."""
    files = files_of(found) if isinstance(found, ModelDiagnosis) else []
    return [_place(one, files) for one in found.places]


def _place(one: Place, files: Sequence[str]) -> dict[str, Any]:
    """One place of a map; with a model its log and the tolerance of the rig, without one its share of the squared gap."""
    if files:
        return {**_fields(one, "channel", "phase"), "file": files[one.log]} | _fields(one, "load", "blocks", *_PLACE)
    numbers = [name for name in _PLACE if name != "u_tolerance"]
    share = {"share_of_squares": rounded_number(one.share)}
    return _fields(one, "channel", "phase", "load", "blocks", *numbers) | share


# -------------------------------------------------------------------------------------------------------------- the causes
def _cause(cause: NamedCause, found: DiagnosisResult) -> dict[str, Any]:
    """A cause; of a wrong entry with the sentence on what is stated and what fits, of a wrong load with its run and load."""
    effect = found.suspects[cause.effect]
    entry: dict[str, Any] = {}
    if effect.entry is not None:
        entry = {"run": effect.entry.source, "load_ohm": effect.entry.value} if effect.entry.log >= 0 else {}
        explained = found.verdict == "explained"
        entry["sentence"] = sentences.entry_sentence(cause, effect, explained=explained)
    return {
        "effect": effect.name,
        **entry,
        "label": effect.label,
        **_fields(cause, "stage", "probability"),
        "parameters": _parameters(cause.parameters),
        "rivals": [_alternative(found, one) for one in cause.rivals],
        "look_alikes": [_alternative(found, one) for one in cause.look_alikes],
        "ablation": rounded_number(cause.ablation),
        **_stability(found, cause),
        **({"closes_alone_of_the_gap": rounded_number(cause.weight)} if isinstance(found, LineDiagnosis) else {}),
    }


def _alternative(found: DiagnosisResult, one: Alternative) -> dict[str, Any]:
    return {
        "effect": found.suspects[one.effect].name,
        "probability": rounded_number(one.probability),
        "told_apart_by": sentences.differs_text(one.differs),
    }


def _stability(found: DiagnosisResult, cause: NamedCause) -> dict[str, Any]:
    """The number of a cause run by run, or cycle by cycle without a model, and what differs between them."""
    if cause.stability is None:
        return {}
    items = items_of(found)
    return {
        "stability": [
            {"run": items[one.run], **_fields(one, "value", "low", "high")}
            | ({} if math.isfinite(one.value) else {"reason": _SILENT[one.withheld]})
            for one in cause.stability.runs
        ],
        "trends": [
            {**_fields(trend), "sentence": sentences.trend_sentence(found, cause, trend)}
            for trend in cause.stability.trends
        ],
    }


def _minor(one: Minor) -> dict[str, Any]:
    largest = one.largest
    channel = {"metric": largest.name} if largest.phase is None else {"channel": largest.name, "phase": largest.phase}
    return {
        "effect": one.effect,
        "stage": one.stage,
        "parameters": _parameters(one.parameters),
        "largest": {**channel, **_fields(largest, "load", "change")},
        "hint": rounded_number(one.hint),
    }


# ------------------------------------------------------------------------------------------------- with and without a model
def _model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """Of a rig with a model, what each cause contributes, the energies, and what the logs cannot show."""
    suspects = found.suspects
    return {
        "contributions": _contributions(found),
        "energies": [
            {"run": run.name, "load_ohm": _load(run.load), **_fields(one, "phase", "stage")}
            | _fields(one, *_ENERGY, end="_j")
            for one in found.energies
            for run in [found.runs[one.run]]
        ],
        "not_visible": {
            "missing_channels": found.missing_channels,
            "effects": list(dict.fromkeys(suspects[name].name for name in found.not_visible)),
        },
        "thresholds": [
            {
                "effect": suspects[one.effect].name,
                "parameter": suspects[one.effect].parameter,
                "named_from": None if one.value is None else rounded_number(one.value),
                "unit": one.unit,
            }
            for one in found.thresholds
        ],
    }


def _contributions(found: ModelDiagnosis) -> list[dict[str, Any]]:
    """The split of every metric of every run; with the digits with which the parts add up."""
    return [
        {
            "run": found.runs[one.log].name,
            "load_ohm": _load(one.load),
            "plateau_speed_mps": None if one.plateau_speed is None else rounded_number(one.plateau_speed),
            "metric": FIELDS.get(one.metric, one.metric),
            **_fields(one, "as_given", "measured", digits=SUMMED),
            "parts": [
                {
                    "effect": None if part.effect is None else effect_name(part.effect),
                    "kind": part.kind,
                    **_fields(part, "value", digits=SUMMED),
                    **_fields(part, "low", "high"),
                }
                for part in one.parts
            ],
        }
        for one in found.contributions
    ]


def _line_record(found: LineDiagnosis) -> dict[str, Any]:
    """Of a winch without a model, the energies of the judged cycles, and every set of suspects."""
    choice = found.choice
    return {
        "energies": [
            _fields(one, "run", "cycle", "phase", "stage") | _fields(one, *_ENERGY, end="_j") for one in found.energies
        ],
        "sets": [
            {
                "effects": list(names),
                "error": rounded_number(choice.errors[names]),
                "evidence": rounded_number(choice.evidence[names] - choice.evidence[choice.chosen]),
                "probability": rounded_number(choice.probability[names]),
                "as_good_as_the_best": choice.as_good(names),
            }
            for names in sorted(choice.errors, key=lambda names: -choice.evidence[names])
        ],
    }


# -------------------------------------------------------------------------------------- closure, residual and the next run
def _closure(found: ModelDiagnosis | LineDiagnosis) -> dict[str, Any] | None:
    held: dict[str, Any] = {}
    beyond = {}
    if isinstance(found, ModelDiagnosis) and found.closure is not None:
        held = {"withheld": [_load(found.runs[k].load) for k in found.closure.withheld]}
    elif isinstance(found, LineDiagnosis) and found.closure is not None:
        withheld = [_part(part) for part in found.lines.parts if part.withheld]
        held = {"withheld": withheld}
        beyond = {"share_closed_beyond_noise": rounded_number(found.closure.beyond_noise)}
    closure = found.closure
    if closure is None:
        return None
    return {
        "kind": sentences.closure_kind(found),
        **held,
        "channels": {name: {**_fields(one), "worse": one.worse} for name, one in closure.channels.items()},
        "share_closed": rounded_number(closure.share),
        **beyond,
        "interval": [rounded_number(closure.low), rounded_number(closure.high)],
    }


def _remainder(left: Remainder, found: DiagnosisResult) -> dict[str, Any]:
    files = files_of(found)
    return {
        "share": rounded_number(left.share),
        "where": None if left.worst is None else about_words(left.worst, files, {}),
        "alarms": [
            {
                "kind": alarm.kind,
                "where": about_words(alarm.about, files, {}),
                "size": alarm.size,
                "limit": alarm.limit,
            }
            for alarm in left.alarms
        ],
    }


def _experiment(found: DiagnosisResult) -> dict[str, Any] | None:
    plan = found.experiment
    if plan is None:
        return None
    return {
        "loads": [] if plan.load is None else [_load(plan.load)],
        "profile": sentences.profile_words(plan),
        "speed_mps": rounded_number(plan.speed),
        **({"length_m": rounded_number(plan.length)} if plan.motion == "cycle" else {}),
        "repeats": plan.repeats or None,
        "separates": [found.suspects[name].name for name in plan.separates],
        "expected_z": rounded_number(plan.expected_z),
    }
