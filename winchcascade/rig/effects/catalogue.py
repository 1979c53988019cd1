"""The catalogue of effects that the baseline leaves out, in the order of the energy cascade from its end."""

import difflib
import math
from collections.abc import Iterable, Mapping

from winchcascade.core.arguments import NUMBER, check_arguments
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


def suspected(names: Iterable[str]) -> Mapping[str, Effect]:
    """The effects of some names, or all where none is given; OptionError for a name that no effect has."""
    return {name: find_effect(name) for name in names} or EFFECTS


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
        check_arguments(f"effect {name}", (key, value, NUMBER))
        low, high = fields[key].possible
        if not (math.isfinite(value) and low <= value <= high):
            raise OptionError(
                f"effect {name}: {key} is {value:g}, but must lie between {low:g} and {high:g} [{fields[key].unit}]."
            )
    return ActiveEffect(effect, tuple(values.get(key, field.absent) for key, field in fields.items()))
