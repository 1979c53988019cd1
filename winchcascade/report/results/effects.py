"""The effects that the model of a rig may lack: what every text calls them, and what the catalogue
states of all of them by stage, or of one in full.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from winchcascade.diagnosis.fit.entries import effect_name
from winchcascade.report.content import Column, Note, Report, section, table
from winchcascade.rig.effects.catalogue import EFFECTS, find_effect
from winchcascade.rig.effects.effect import Effect, Parameter


def called(name: str, suspects: Mapping[str, Effect] = EFFECTS) -> str:
    """An effect as every text calls it: its label, and its identifier in brackets, which a page
    sets small.

    Parameters
    ----------
    suspects : those of the diagnosis, which may be more than the effects of the catalogue

    Examples
    --------
    >>> called("copper_heating"), called("load_entry(r9ohm.csv)"), called("unknown")
    ('Stator resistance (copper_heating)', 'Load of a run (load_entry(r9ohm.csv))', 'unknown')
    """
    effect = suspects.get(name) or EFFECTS.get(effect_name(name))
    return name if effect is None else f"{effect.label} ({name})"


def call_all(
    names: Iterable[str], suspects: Mapping[str, Effect] = EFFECTS, between: str = ", "
) -> str:
    """Several effects as texts call them."""
    return between.join(called(name, suspects) for name in names)


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
