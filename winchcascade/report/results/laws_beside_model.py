"""Laws of stages beside a model: the laws that act, and whether each stage agrees with the causes
of the model, as a section of a report and as JSON.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause
from winchcascade.diagnosis.stages.diagnose_stages import StageAgreement, StageDiagnosis
from winchcascade.report.content import Column, Measured, Note, Section, Table, section, table
from winchcascade.report.diagnosis_names import probability_words, shown_as
from winchcascade.report.results import diagnosis_words as words
from winchcascade.report.results.diagnosis_parts import EffectNumber, number_columns

if TYPE_CHECKING:
    from collections.abc import Iterator


def stage_laws_section(found: ModelDiagnosis) -> Section:
    """The laws that act beside the model, and the power of each stage by laws and by causes."""
    own = found.by_laws
    if own is None:
        return section("stage-laws", "Laws of the stages")
    return section(
        "stage-laws", "Laws of the stages",
        Note(
            f"{words.VERDICTS[own.verdict]}, by the power that each stage gives beyond its model "
            f"for its own inputs from the log."
        ),
        *_conflicts(found, own),
        _laws(own),
        table(
            "stage-agreement", "Mean power beyond the model while the line pays out.",
            [
                Column[StageAgreement]("stage", lambda one: one.stage),
                Column("flows", lambda one: one.flows, "W", 0),
                Column("by laws", lambda one: Measured(one.by_laws, one.u_laws or None), "W"),
                Column("by causes", lambda one: Measured(one.by_causes, one.u_causes or None), "W"),
                Column("agree", lambda one: "yes" if one.agrees else "no"),
            ],
            own.agreement,
        ),
    )  # fmt: skip


def _conflicts(found: ModelDiagnosis, own: StageDiagnosis) -> Iterator[Note]:
    """In what laws and model differ."""
    if opposed := _opposed(own):
        yield Note(
            f"Laws and causes of the model differ at {', '.join(opposed)} by more than their "
            f"intervals allow.",
            "Conflict",
            "warn",
        )
    if not _same_stages(found, own):
        of_model, of_laws = (", ".join(_stages(one)) or "no stage" for one in (found, own))
        yield Note(
            f"What is missing lies at {of_model} by the model, and at {of_laws} by the mean powers "
            f"of the stages.",
            "Conflict",
            "warn",
        )


def _opposed(own: StageDiagnosis) -> list[str]:
    """Stages whose power by laws is another than by causes."""
    return [one.stage for one in own.agreement if not one.agrees]


def _stages(found: DiagnosisResult) -> list[str]:
    """Stages of what a diagnosis names or, where it names nothing, that of its gap."""
    named = [one.stage for one in (*found.causes, *found.candidates)]
    gap = [found.where.stage] if found.where is not None and found.verdict != "no_gap" else []
    return list(dict.fromkeys(named or gap))


def _same_stages(found: ModelDiagnosis, own: StageDiagnosis) -> bool:
    """Whether model and laws have a stage in common, or both none."""
    of_model, of_laws = {*_stages(found)}, {*_stages(own)}
    return of_model == of_laws or bool(of_model & of_laws)


def _laws(own: StageDiagnosis) -> Table[Any]:
    """Number and interval of each law that acts."""
    causes = {cause.effect: cause for cause in (*own.causes, *own.candidates)}
    rows = [
        EffectNumber(name, shown_as(own, one), next(iter(one.parameters.values())), one.stage)
        for name, one in causes.items()
    ]
    return table(
        "stage-laws", "Laws that act beside the model.",
        [
            Column[EffectNumber]("law", lambda row: own.suspects[row.effect].label),
            Column("stage", lambda row: row.role),
            *number_columns(),
            Column("prob.", lambda row: probability_words(causes[row.effect].probability)),
        ],
        rows,
    )  # fmt: skip


def stage_laws_record(found: ModelDiagnosis) -> dict[str, Any]:
    """Verdict, place, laws and agreement by stage; nothing where no laws were fitted."""
    own = found.by_laws
    if own is None:
        return {}
    return {
        "stage_laws": {
            "verdict": own.verdict,
            "stage": None if own.where is None else own.where.stage,
            "causes": [_law(own, one) for one in own.causes],
            "candidates": [_law(own, one) for one in own.candidates],
            "share_closed": None if own.closure is None else own.closure.share,
            "agrees": not _opposed(own) and _same_stages(found, own),
            "agreement": [
                {
                    "stage": one.stage,
                    "power_w": one.flows,
                    "by_laws_w": one.by_laws,
                    "u_laws_w": one.u_laws,
                    "by_causes_w": one.by_causes,
                    "u_causes_w": one.u_causes,
                    "agrees": one.agrees,
                }
                for one in own.agreement
            ],
        }
    }


def _law(own: StageDiagnosis, cause: NamedCause) -> dict[str, Any]:
    return {
        "effect": own.suspects[cause.effect].name,
        "label": own.suspects[cause.effect].label,
        "stage": cause.stage,
        "probability": cause.probability,
        "parameters": cause.parameters,
        "look_alikes": [one.effect for one in cause.look_alikes],
    }
