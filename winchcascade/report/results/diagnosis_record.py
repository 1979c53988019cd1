"""The record of a diagnosis: JSON by the names of the interface, SI units, loads in ohm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.run import Run
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alternative,
    DiagnosisResult,
    LargestChange,
    NamedCause,
)
from winchcascade.diagnosis.explain.validation import Validated
from winchcascade.diagnosis.fit.entries import effect_name
from winchcascade.diagnosis.fit.nuisances import calibrated_numbers
from winchcascade.diagnosis.handover.posterior import posterior_of_rig
from winchcascade.diagnosis.handover.posterior_record import posterior_record
from winchcascade.diagnosis.handover.tested import tested_by
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report.diagnosis_names import about_words, files_of, items_of, origins_of
from winchcascade.report.results import diagnosis_sentences as sentences
from winchcascade.report.results.laws_beside_model import stage_laws_record
from winchcascade.rig.parts import path_in_rig

SCHEMA = "winchcascade/diagnosis/1"

DIGITS, SUMMED, ALL = 6, 12, 17
"""Significant digits of numbers, of those that add up, and all that a number has."""

_LOADS = ("load", "load_ohm")
_PART = ("cycles", "withheld", "samples")
_PLACE = (
    "channel",
    "phase",
    "load",
    "blocks",
    "bias",
    "rms",
    "noise",
    "u_noise",
    "u_repeat",
    "u_tolerance",
    "z",
)
_ENERGY = ("measured", "before", "after", "u")
_SILENT = {False: "the run hardly depends on this cause", True: "withheld"}
"""Why a run gives no number, by whether it is withheld."""


def plain(x: object, digits: int = DIGITS) -> Any:
    """A value as JSON has it: structs as objects, numbers to some significant digits, null for what
    is not finite.

    A load is given as `load_ohm`, with all its digits, `inf` for an open circuit.

    >>> plain({"load": math.inf, "z": [1.23456789, math.nan]})
    {'load_ohm': 'inf', 'z': [1.23457, None]}
    """
    if isinstance(x, msgspec.Struct):
        x = msgspec.structs.asdict(x)
    if isinstance(x, Mapping):
        names = {"load": "load_ohm"}
        return {
            names.get(name, name): _load(value)
            if name in _LOADS and not isinstance(value, msgspec.Struct)
            else plain(value, digits)
            for name, value in x.items()
        }
    if isinstance(x, list | tuple):
        return [plain(one, digits) for one in x]
    if isinstance(x, float):
        return float(f"{x:.{digits}g}") if math.isfinite(x) else None
    return x


def _load(load: float | None) -> float | str | None:
    return "inf" if load == math.inf else load


def _some(of: object, *names: str, end: str = "") -> dict[str, Any]:
    """Some fields of a value."""
    return {f"{name}{end}": getattr(of, name) for name in names}


def as_json(found: DiagnosisResult) -> dict[str, Any]:
    """What a diagnosis found, by the interface's names; SI units, loads in ohm, `inf` for an
    open circuit.
    """
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    named = {one.effect for one in found.causes}
    record: dict[str, Any] = {
        "schema": SCHEMA,
        "kind": "stages" if isinstance(found, StageDiagnosis) else "model",
        "title": found.title,
        "data": origin_record(joint_origin(origins_of(found))),
        "rig": found.rig.name,
        "seed": found.seed,
        "suspects": list(dict.fromkeys(effect.name for effect in found.suspects.values())),
        "logs": _logs(found),
        "simulations": [
            {"file": run.name, "findings": _findings(run)} for run in (own.runs if own else ())
        ],
        "verdict": found.verdict,
        "baseline": "own_simulation" if own else "rig",
        "model_form": own.forms if own else [],
        "calibrated": _calibrated(found),
        "where": _where(found),
        "causes": [_cause(cause, found) for cause in found.causes],
        "candidates": [_cause(cause, found) for cause in found.candidates],
        "minor": [
            {
                **_some(one, "effect", "stage", "parameters"),
                "largest": _largest(one.largest),
                "hint": one.hint,
            }
            for one in found.minor
        ],
        "fitted": [
            {
                "effect": found.suspects[cause.effect].name,
                "stage": cause.stage,
                "named": cause.effect in named,
            }
            | {"parameters": cause.parameters}
            for cause in found.fitted
        ],
        "closure": _closure(found),
        "remainder": _remainder(found),
        "next_experiment": _experiment(found),
    }
    if isinstance(found, ModelDiagnosis):
        record |= _model_record(found) | stage_laws_record(found)
    elif isinstance(found, StageDiagnosis):
        record |= _line_record(found)
    digits = {"contributions": SUMMED, "remainder": ALL, "posterior": ALL}
    return {name: plain(value, digits.get(name, DIGITS)) for name, value in record.items()}


# --------------------------------------------------------------------------------- what was given
def _logs(found: DiagnosisResult) -> list[dict[str, Any]]:
    """Every log with what is stated and was found of it; without a model every part of a log,
    which has no load.
    """
    parts = found.data.parts if isinstance(found, StageDiagnosis) else None
    heads = (
        [({}, run) for run in found.runs]
        if parts is None
        else [(_some(part, *_PART), part.run) for part in parts]
    )
    return [
        {
            "file": run.name,
            **head,
            "sha256": run.sha256,
            "load": run.load if parts is None else None,
        }
        | {"data": origin_record(run.origin), "findings": _findings(run)}
        for head, run in heads
    ]


def _findings(run: Run) -> list[dict[str, Any]]:
    return [_some(finding, "kind", "channel", "message") for finding in run.findings]


def _calibrated(found: DiagnosisResult) -> list[dict[str, Any]]:
    """Calibrated numbers, and what a diagnosis starts from in their place, null where the rig
    file had no number before.
    """
    numbers = calibrated_numbers(found.rig) if isinstance(found, ModelDiagnosis) else {}
    return [
        {"number": ".".join(place), "log": record.log, "value": number.value}
        | {"prior": None if record.prior is None else record.prior.value}
        for place, number in numbers.items()
        if (record := number.calibrated) is not None
    ]


# ------------------------------------------------------------------------- the gap and its causes
def _where(found: DiagnosisResult) -> dict[str, Any] | None:
    where = found.where
    if where is None:
        return None
    spans = (where.rpm, where.i_dc) if isinstance(found, ModelDiagnosis) else (None, None)
    record = {"stage": where.stage, **_some(where.worst, "channel", "phase", "load")}
    record |= dict(zip(("rpm", "i_dc_a"), spans, strict=True))
    record["map"] = map_record(found)
    if isinstance(found, ModelDiagnosis):
        record["stages"] = [
            {**_some(one, "stage", "inputs", *_PLACE), "file": found.runs[one.log].name}
            for one in found.stages
        ]
    return record


def map_record(found: DiagnosisResult) -> list[dict[str, Any]]:
    """Every place of the map of the gap, also where there is no gap; without a model with its
    share of the squared gap.
    """
    if isinstance(found, ModelDiagnosis):
        return [
            plain({**_some(one, *_PLACE), "file": found.runs[one.log].name}) for one in found.places
        ]
    names = [name for name in _PLACE if name != "u_tolerance"]
    return [plain({**_some(one, *names), "share_of_squares": one.share}) for one in found.places]


def _cause(cause: NamedCause, found: DiagnosisResult) -> dict[str, Any]:
    """A cause; of a wrong load with its run and load."""
    effect = found.suspects[cause.effect]
    record: dict[str, Any] = {"effect": effect.name}
    if effect.entry is not None and effect.entry.log >= 0:
        record |= {"run": effect.entry.source, "load": effect.entry.value}
    record |= {"label": effect.label, **_some(cause, "stage", "probability", "parameters")}
    record |= {
        name: [_alternative(found, one) for one in getattr(cause, name)]
        for name in ("rivals", "look_alikes")
    }
    own = found.judgement.classes.get(cause.effect)
    record["class"] = None if own is None else msgspec.structs.asdict(own)
    record["ablation"] = cause.ablation
    if cause.stability is not None:
        items = items_of(found)
        record["stability"] = [
            {"run": items[one.run], **_some(one, "value", "low", "high")}
            | ({} if math.isfinite(one.value) else {"reason": _SILENT[one.withheld]})
            for one in cause.stability.runs
        ]
        record["trends"] = cause.stability.trends
    return record | (
        {"closes_alone_of_the_gap": cause.weight} if isinstance(found, StageDiagnosis) else {}
    )


def _alternative(found: DiagnosisResult, one: Alternative) -> dict[str, Any]:
    number = one.number
    return {
        "effect": found.suspects[one.effect].name,
        "probability": one.probability,
        "told_apart_by": sentences.differs_text(one.differs),
        "number": None if number is None else _some(number, "value", "unit", "beyond_range"),
    }


def _largest(largest: LargestChange) -> dict[str, Any]:
    """What a minor effect changes most: a metric, or a channel in a phase."""
    what = (
        {"metric": largest.name}
        if largest.phase is None
        else {"channel": largest.name, "phase": largest.phase}
    )
    return {**what, **_some(largest, "load", "change")}


# ----------------------------------------------------------------------- with and without a model
def _model_record(found: ModelDiagnosis) -> dict[str, Any]:
    """Of a rig with a model, the energies, and what the logs cannot show."""
    suspects = found.suspects
    return {
        "contributions": _contributions(found),
        "energies": [
            {
                "run": run.name,
                "load": run.load,
                **_some(one, "phase", "stage"),
                **_some(one, *_ENERGY, end="_j"),
            }
            for one in found.energies
            for run in [found.runs[one.run]]
        ],
        "not_visible": {
            "missing_channels": found.missing_channels,
            "effects": list(dict.fromkeys(suspects[name].name for name in found.not_visible)),
        },
        "singles": [
            {
                "effect": suspects[one.effect].name,
                "evidence": one.evidence,
                "share_closed": one.closure,
            }
            for one in found.singles
        ],
        "undetermined": [
            {
                "numbers": {path_in_rig(path): power for path, power in one.powers.items()},
                "leading": [path_in_rig(path) for path in one.leading],
                "product": one.product is not None,
            }
            for one in found.undetermined
        ],
        "thresholds": [
            {"effect": suspects[one.effect].name, "parameter": suspects[one.effect].parameter}
            | {"named_from": one.value, "unit": one.unit}
            for one in found.thresholds
        ],
        "validation": [
            {"run": found.runs[one.log].name} | _validated(one) for one in found.validation
        ],
        "posterior": None
        if (tested := tested_by(found)) is None
        else posterior_record(posterior_of_rig(found), tested),
    }


def _validated(one: Validated) -> dict[str, Any]:
    """One comparison of a validation, without the number of its log."""
    record: dict[str, Any] = msgspec.structs.asdict(one)
    record["speed_mps"] = record.pop("speed")
    return {name: value for name, value in record.items() if name != "log"}


def _contributions(found: ModelDiagnosis) -> list[dict[str, Any]]:
    """The split of every metric of every run."""
    return [
        {
            "run": found.runs[one.log].name,
            "load": one.load,
            "plateau_speed_mps": plain(one.plateau_speed),
        }
        | {"metric": FIELDS.get(one.metric, one.metric), **_some(one, "as_given", "measured")}
        | {
            "parts": [
                {
                    "effect": part.effect and effect_name(part.effect),
                    "kind": part.kind,
                    "value": part.value,
                }
                | plain(_some(part, "low", "high"))
                for part in one.parts
            ]
        }
        for one in found.contributions
    ]


def _line_record(found: StageDiagnosis) -> dict[str, Any]:
    """Of a winch without a model, the energies of the judged cycles, and every set of suspects."""
    return {
        "energies": [
            {
                "run": found.runs[one.run].name,
                **_some(one, "cycle", "phase", "stage"),
                **_some(one, *_ENERGY, end="_j"),
            }
            for one in found.energies
        ],
        "sets": [
            {
                "effects": names,
                "evidence": math.log(max(probability, 1e-300) / found.sets[found.chosen]),
                "probability": probability,
            }
            for names, probability in sorted(found.sets.items(), key=lambda one: -one[1])
        ],
    }


# ------------------------------------------------------------- closure, residual and the next run
def _closure(found: DiagnosisResult) -> dict[str, Any] | None:
    closure = found.closure
    if closure is None:
        return None
    withheld: list[object] = []
    beyond = {}
    if isinstance(found, ModelDiagnosis) and found.closure is not None:
        withheld += [_load(found.runs[k].load) for k in found.closure.withheld]
    elif isinstance(found, StageDiagnosis) and found.closure is not None:
        withheld += [
            {"file": part.run.name, **_some(part, *_PART)}
            for part in found.data.parts
            if part.withheld
        ]
        beyond = {"share_closed_beyond_noise": found.closure.beyond_noise}
    return {
        "kind": sentences.closure_kind(found),
        "withheld": withheld,
        "channels": {
            name: {**msgspec.structs.asdict(one), "worse": one.worse}
            for name, one in closure.channels.items()
        },
        "share_closed": closure.share,
        **beyond,
        "interval": [closure.low, closure.high],
    }


def _remainder(found: DiagnosisResult) -> dict[str, Any] | None:
    left, files = found.remainder, files_of(found)
    if left is None:
        return None
    return {
        "share": plain(left.share),
        "where": None if left.worst is None else about_words(left.worst, files, {}),
        "alarms": [
            {
                "kind": one.kind,
                "where": about_words(one.about, files, {}),
                "size": one.size,
                "limit": one.limit,
            }
            for one in left.alarms
        ],
    }


def _experiment(found: DiagnosisResult) -> dict[str, Any] | None:
    plan = found.experiment
    if plan is None:
        return None
    return {
        "loads": [] if plan.load is None else [_load(plan.load)],
        "profile": sentences.profile_words(plan),
        "speed_mps": plan.speed,
        **({"length_m": plan.length} if plan.motion == "cycle" else {}),
        "repeats": plan.repeats or None,
        "separates": [found.suspects[name].name for name in plan.separates],
        "expected_z": plan.expected_z,
    }
