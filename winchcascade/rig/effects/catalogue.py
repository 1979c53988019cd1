"""The catalogue of effects that the baseline leaves out, in the order of the energy cascade from its end."""

import difflib
import math
import textwrap
from collections.abc import Mapping

from winchcascade.core.errors import OptionError
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.effects.gearbox import GEARBOX
from winchcascade.rig.effects.generator import GENERATOR
from winchcascade.rig.effects.restoring import RESTORING
from winchcascade.rig.effects.sensor import SENSOR
from winchcascade.rig.effects.transmission import TRANSMISSION
from winchcascade.rig.effects.wrong_entries import ENTRY

OF_THE_RIG = {effect.name: effect for effect in (*GENERATOR, *GEARBOX, *TRANSMISSION, *RESTORING, *SENSOR)}
"""Effects of the rig, its sensors and its logger by name: every effect but wrong entries."""

EFFECTS = OF_THE_RIG | {effect.name: effect for effect in ENTRY}
"""Every effect by its name."""


def find_effect(name: str) -> Effect:
    """Look an effect up by its name.

    Raises
    ------
    OptionError : no effect has that name
    """
    if name in EFFECTS:
        return EFFECTS[name]
    near = difflib.get_close_matches(name, EFFECTS, n=3, cutoff=0.5)
    hint = f"; names like it: {', '.join(near)}" if near else ""
    raise OptionError(f"effect {name!r} is not in the catalogue{hint}; `winchcascade effects` lists all.")


def make_effect(name: str, values: Mapping[str, float]) -> ActiveEffect:
    """Make an active effect from its name and the fields that are not absent.

    >>> make_effect("gas_polytropic", {"n": 1.3}).values
    (1.3, 6.0)

    Raises
    ------
    OptionError : no such effect or field, or a value that is not finite or has no physical meaning
    """
    effect = find_effect(name)
    fields = {field.name: field for field in effect.fields}
    for key, value in values.items():
        if key not in fields:
            raise OptionError(f"effect {name} has no field {key!r}; it has {', '.join(fields)}.")
        low, high = fields[key].possible
        if not (math.isfinite(value) and low <= value <= high):
            raise OptionError(
                f"effect {name}: {key} is {value:g}, but must lie between {low:g} and {high:g} [{fields[key].unit}]."
            )
    return ActiveEffect(effect, tuple(values.get(key, field.absent) for key, field in fields.items()))


def describe(name: str | None = None) -> str:
    """Describe one effect, or all of them in a table.

    Raises
    ------
    OptionError : no effect has that name
    """
    return _table() if name is None else _sheet(find_effect(name))


_WHAT = 36
"""Width of the column of what is unmodelled."""


def _table() -> str:
    rows = [("name", "stage", "what is unmodelled", "parameter (unit)")]
    rows += [(e.name, e.stage, e.summary, f"{e.parameter} ({e.unit})") for e in EFFECTS.values()]
    lines = []
    for name, stage, what, parameter in rows:
        first, *more = textwrap.wrap(what, _WHAT, break_on_hyphens=False)
        lines.append(f"{name:<16} {stage:<12} {first:<{_WHAT}} {parameter}")
        lines += [f"{'':<29} {line}".rstrip() for line in more]
    return "\n".join(lines)


def _sheet(effect: Effect) -> str:
    paragraphs = [
        f"{effect.name} ({effect.stage}): {effect.summary}",
        f"Shows as: {effect.shows_as}",
        f"Easily taken for: {effect.taken_for}",
        f"Source: {effect.source}",
        f"Reports: {effect.parameter} ({effect.unit})",
        *(f"{f.name} [{f.unit}]: {f.low:g} to {f.high:g}, absent {f.absent:g}; {f.source}." for f in effect.fields),
    ]
    return "\n".join(textwrap.fill(text, 100, subsequent_indent="    ", break_on_hyphens=False) for text in paragraphs)
