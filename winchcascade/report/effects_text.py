"""The catalogue of effects as text for the terminal."""

from __future__ import annotations

from winchcascade.report.text_table import joined, table_lines, wrapped
from winchcascade.rig.effects.catalogue import EFFECTS, find_effect
from winchcascade.rig.effects.effect import Effect


def effects_text(name: str | None = None) -> str:
    """Describe one effect, or list all of them.

    Raises
    ------
    OptionError : no effect has that name
    """
    return joined(_list() if name is None else _sheet(find_effect(name)))


def _list() -> list[str]:
    """A table of the effects, below each what is unmodelled without it."""
    rows = [("name", "stage", "parameter (unit)")]
    rows += [(e.name, e.stage, f"{e.parameter} ({e.unit})") for e in EFFECTS.values()]
    head, *lines = table_lines(rows, left=range(3), omit=("stage",))
    below = lines[len(EFFECTS) :]
    listed = zip(lines, EFFECTS.values(), strict=False)
    return [head, *(line for row, effect in listed for line in (row, *wrapped(effect.summary, "    "))), *below]


def _sheet(effect: Effect) -> list[str]:
    """Everything that is known of one effect."""
    paragraphs = [
        f"{effect.name} ({effect.stage}): {effect.summary}",
        f"Shows as: {effect.shows_as}",
        f"Easily taken for: {effect.taken_for}",
        f"Source: {effect.source}",
        f"Reports: {effect.parameter} ({effect.unit})",
        *(f"{f.name} [{f.unit}]: {f.low:g} to {f.high:g}, absent {f.absent:g}; {f.source}." for f in effect.fields),
    ]
    return [line for text in paragraphs for line in wrapped(text)]
