"""The record of a diagnosis: JSON by the names of the interface, SI units, loads in ohm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.rig_file import Rig
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    DiagnosisResult,
    Minor,
    NamedCause,
    Place,
    Remainder,
    StagePlace,
)
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.line.line_data import CyclePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis, LineRemainder
from winchcascade.diagnosis.nuisances import calibrated_numbers
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report import diagnosis_words as words
from winchcascade.report.cause_words import SILENT, check_words, items_of, samples_of, trend_sentence
from winchcascade.report.finding_words import finding_records, simulations_of
from winchcascade.report.gap_words import about_text, arises_sentence, differs_text, has_own_simulation, where_sentence

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
            | {"findings": finding_records(run)}
            for head, run, load in (
                [(_part(part), part.run, None) for part in found.lines.parts]
                if isinstance(found, LineDiagnosis)
                else [({"file": run.name}, run, _load(run.load)) for run in found.runs]
            )
        ],
        "simulations": [{"file": run.name, "findings": finding_records(run)} for run in simulations_of(found)],
        "verdict": found.verdict,
        **_baseline(found),
        "calibrated": [] if isinstance(found, LineDiagnosis) else _calibrated(found.rig),
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
        **(_line_record(found) if isinstance(found, LineDiagnosis) else _model_record(found)),
        "closure": _closure(found),
        "remainder": None if found.remainder is None else _remainder(found.remainder, words.files_of(found)),
        "next_experiment": None
        if found.experiment is None
        else {
            "loads": [] if found.experiment.load is None else [_load(found.experiment.load)],
            "profile": words.profile_words(found.experiment),
            "speed_mps": rounded_number(found.experiment.speed),
            **({"length_m": rounded_number(found.experiment.length)} if found.experiment.motion == "cycle" else {}),
            "repeats": found.experiment.repeats or None,
            "separates": [found.suspects[name].name for name in found.experiment.separates],
            "expected_z": rounded_number(found.experiment.expected_z),
        },
        **(_choice(found) if isinstance(found, LineDiagnosis) else {}),
    }


def _model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """Of a rig with a model, what each cause contributes, the energies, and what the logs cannot show."""
    return {
        "fitted": [
            {
                "effect": found.suspects[cause.effect].name,
                "stage": cause.stage,
                "named": cause.effect in {one.effect for one in found.causes},
                "parameters": {name: _numbers(x) for name, x in cause.parameters.items()},
            }
            for cause in found.fitted
        ],
        "contributions": _contributions(found),
        "energies": _energies(found),
        "not_visible": {
            "missing_channels": found.missing_channels,
            "effects": list(dict.fromkeys(found.suspects[name].name for name in found.not_visible)),
        },
        "thresholds": [
            {
                "effect": found.suspects[one.effect].name,
                "parameter": found.suspects[one.effect].parameter,
                "named_from": None if one.value is None else rounded_number(one.value),
                "unit": one.unit,
            }
            for one in found.thresholds
        ],
    }


def _line_record(found: LineDiagnosis) -> dict[str, Any]:
    """Of a winch without a model, every effect that was fitted, and the energies of the judged cycles."""
    return {
        "fitted": [
            {
                "effect": one.effect,
                "named": one.named,
                "in_final_fit": one.chosen,
                "parameters": {name: _numbers(x) for name, x in one.parameters.items()},
            }
            for one in found.fitted_effects
        ],
        "energies": [
            {
                "run": one.run,
                "cycle": one.cycle,
                "phase": one.phase,
                "stage": one.stage,
                **{f"{name}_j": rounded_number(getattr(one, name)) for name in ("measured", "before", "after", "u")},
            }
            for one in found.energies
        ],
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
    lies = where_sentence(where, own_simulation=has_own_simulation(found), explained=found.verdict == "explained")
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
        **_entry(found, cause),
        "label": effect.label,
        "stage": cause.stage,
        "probability": rounded_number(cause.probability),
        "parameters": {name: _numbers(x) for name, x in cause.parameters.items()},
        "rivals": [_alternative(found, one) for one in cause.rivals],
        "look_alikes": [_alternative(found, one) for one in cause.look_alikes],
        "ablation": rounded_number(cause.ablation),
    }


def _alternative(found: DiagnosisResult, one: Alternative) -> dict[str, Any]:
    return {
        "effect": found.suspects[one.effect].name,
        "probability": rounded_number(one.probability),
        "told_apart_by": differs_text(one.differs),
    }


def _energies(found: ModelDiagnosis) -> list[dict[str, Any]]:
    """Signed energies by run, phase and stage. [J]"""
    return [
        {
            "run": found.runs[one.run].name,
            "load_ohm": _load(found.runs[one.run].load),
            "phase": one.phase,
            "stage": one.stage,
            "measured_j": rounded_number(one.measured),
            "before_j": rounded_number(one.before),
            "after_j": rounded_number(one.after),
            "u_j": rounded_number(one.u),
        }
        for one in found.energies
    ]


def _stability(found: DiagnosisResult, cause: NamedCause) -> dict[str, Any]:
    """The number of a cause run by run, or cycle by cycle without a model, and what differs between them."""
    if cause.stability is None:
        return {}
    files = items_of(found)
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


def _entry(found: DiagnosisResult, cause: NamedCause) -> dict[str, Any]:
    """Of a wrong entry, the sentence on what is stated and what fits; of a wrong load, its run and the stated load."""
    entry = found.suspects[cause.effect].entry
    if entry is None:
        return {}
    run = {"run": entry.source, "load_ohm": entry.stated} if entry.log >= 0 else {}
    return {**run, "sentence": check_words(found, cause)}


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
        "hint": rounded_number(one.hint),
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
            "plateau_speed_mps": None if one.plateau_speed is None else rounded_number(one.plateau_speed),
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
        "kind": words.closure_kind(found),
        "withheld": withheld,
        **in_turn,
        "channels": {name: {**_numbers(x), "worse": x.worse} for name, x in found.closure.channels.items()},
        "share_closed": rounded_number(found.closure.share),
        **beyond,
        "interval": [rounded_number(found.closure.low), rounded_number(found.closure.high)],
    }


def _remainder(left: Remainder, files: Sequence[str]) -> dict[str, Any]:
    shape = {}
    if isinstance(left, LineRemainder):
        shape = {"slower_than_a_second": rounded_number(left.slow), "in_bursts": rounded_number(left.bursts)}
    return {
        "share": rounded_number(left.share),
        "where": None if left.worst is None else about_text(left.worst, files),
        **shape,
        "alarms": [
            {"kind": alarm.kind, "where": about_text(alarm.about, files), "size": alarm.size, "limit": alarm.limit}
            for alarm in left.alarms
        ],
    }


def _choice(found: LineDiagnosis) -> dict[str, Any]:
    """Every set of suspects of a winch without a model, and over what its acceleration was taken."""
    choice = found.choice
    return {
        "sets": [
            {
                "effects": list(names),
                "error": rounded_number(choice.error(names)),
                "evidence": rounded_number(choice.evidence[names] - choice.evidence[choice.chosen]),
                "probability": rounded_number(choice.probability[names]),
                "as_good_as_the_best": choice.as_good(names),
            }
            for names in sorted(choice.errors, key=lambda names: -choice.evidence[names])
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
