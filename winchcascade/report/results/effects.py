"""What the catalogue states of the effects that the model of a rig may lack: all of them by
stage, or one in full.
"""

from __future__ import annotations

from winchcascade.report.content import Column, Note, Report, section, table
from winchcascade.rig.effects.catalogue import EFFECTS, find_effect
from winchcascade.rig.effects.effect import Effect, Parameter

EFFECT_COLUMNS: tuple[Column[Effect], ...] = (
    Column("effect", lambda effect: effect.name),
    Column("parameter", lambda effect: effect.parameter),
    Column("what the model leaves out", lambda effect: effect.summary),
)

FIELD_COLUMNS: tuple[Column[Parameter], ...] = (
    Column("field", lambda field: field.name),
    Column("unit", lambda field: field.unit),
    Column("plausible", lambda field: f"{field.low:g} to {field.high:g}"),
    Column("as a share of", lambda field: field.scale.replace("_", " ")),
    Column("absent", lambda field: f"{field.absent:g}"),
    Column("source", lambda field: field.source),
)


def effects_report(name: str | None = None) -> Report:
    """Report of one effect, or of all of them; OptionError where no effect has that name."""
    if name is None:
        stages = dict.fromkeys(effect.stage for effect in EFFECTS.values())
        by_stage = {
            stage: [effect for effect in EFFECTS.values() if effect.stage == stage]
            for stage in stages
        }
        sections = [
            section(stage, stage, table(stage, "", EFFECT_COLUMNS, effects))
            for stage, effects in by_stage.items()
        ]
        return Report(
            "Catalogue of effects",
            f"{len(EFFECTS)} effects that a model may lack",
            sections=sections,
        )
    effect = find_effect(name)
    return Report(
        kind="Effect",
        title=f"{effect.name} ({effect.stage}): {effect.summary}",
        points=[
            Note(effect.shows_as, "Shows as"),
            Note(effect.taken_for, "Taken for"),
            Note(f"{effect.parameter} ({effect.unit})", "Reports"),
            Note(effect.source, "Source"),
        ],
        sections=[
            section(
                "fields",
                "Fields",
                table("fields", "Fields of the effect.", FIELD_COLUMNS, effect.fields),
            )
        ],
    )
