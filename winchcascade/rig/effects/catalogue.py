"""The catalogue of effects that the baseline leaves out, in the order of the energy cascade from
its end.

The effects are declared in `catalogue.toml`, and what they do beyond changing numbers in `laws.py`.
Simplifications are what a simulation of the owner may leave out; they are no suspects of a log, as
no rig is simplified.
"""

import difflib
import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec

from winchcascade.core.arguments import NUMBER, check_arguments
from winchcascade.core.errors import OptionError
from winchcascade.core.scales import Scales
from winchcascade.rig.effects.effect import ActiveEffect, Effect, LookAlikes, StageLaw
from winchcascade.rig.effects.laws import ACTS, shared_radius

ENTRY, SIMPLIFICATION = "entry", "simplification"

DEFAULTS: Mapping[str, Mapping[str, object]] = {
    ENTRY: {
        "low": -0.55,
        "high": 1.1,
        "possible": [-0.9, 9.0],
        "source": "plausible range: from half to twice the stated number",
        "operation": "scale",
        "role": "entry",
        "usual": [
            ratio - 1.0 for ratio in (1 / 2, 2 / 3, 3 / 2, 2.0)
        ],  # diameter for radius, both for one of two
    },
    SIMPLIFICATION: {
        "low": 0.0,
        "high": 1.0,
        "possible": [0.0, 1.0],
        "source": "from the law of the model to its own",
    },
}
"""What the fields of a kind of effects have unless a declaration says otherwise."""


def _texts(table: dict[str, object]) -> dict[str, object]:
    """A table whose texts have blanks for line breaks."""
    return {
        key: " ".join(value.split()) if isinstance(value, str) else value
        for key, value in table.items()
    }


def _declared(
    kind: str, name: str, table: dict[str, object], fields: list[dict[str, object]]
) -> Effect:
    """Make an effect of its table: stage and name are its place."""
    declared = [{**DEFAULTS.get(kind, {}), **field} for field in fields]
    effect: Effect = msgspec.convert(
        {"stage": kind, **_texts(table), "name": name, "fields": declared}, Effect
    )
    return msgspec.structs.replace(effect, **ACTS.get(name, {}))


_TABLES = tomllib.loads(Path(__file__).with_name("catalogue.toml").read_text(encoding="utf-8"))

CLASSES = tuple(
    msgspec.convert({**_texts(table), "name": name}, LookAlikes)
    for name, table in _TABLES.pop("class").items()
)
"""Classes of look-alikes; an effect belongs to the first class that has it with another of its
members.
"""

LAWS = {
    name: msgspec.convert({**_texts(table), "name": name}, StageLaw)
    for name, table in _TABLES.pop("law").items()
}
"""Laws of stages by name; a suspect by the name of an effect is that effect."""

_ALL = {
    kind: {name: _declared(kind, name, table, table["fields"]) for name, table in tables.items()}
    for kind, tables in _TABLES.items()
}

SIMPLIFICATIONS = _ALL.pop(SIMPLIFICATION)
"""What a simulation of the owner may leave out, by name."""

EFFECTS = {name: effect for effects in _ALL.values() for name, effect in effects.items()}
"""Every effect by its name."""

ENTRIES = _ALL.pop(ENTRY)
"""Wrong entries by name: numbers that the rig file or the campaign states wrongly. The logged
motion of the line is the input of the model, so that a radius that deviates changes the speed of
the drum, unless the logger computes the motion with it."""

OF_THE_RIG = {name: effect for name, effect in EFFECTS.items() if name not in ENTRIES}
"""Effects of the rig, its sensors and its logger by name: every effect but wrong entries."""

SHARED_RADIUS = msgspec.structs.replace(
    ENTRIES["drum_radius"],
    summary="The rig file and the logger use another drum radius than the drum has; the encoder "
    "sits at the drum.",
    shows_as="force alone, by the same share in every phase.",
    taken_for="a gain error of the force cell (force_gain), which looks the same.",
    law=shared_radius,
)
"""The drum radius where encoder and logger share it: a second form of `drum_radius`, no effect
of its own in the catalogue.
"""


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
    raise OptionError(
        f"effect {name!r} is not in the catalogue{hint}; `winchcascade effects` lists all."
    )


def suspected(names: Iterable[str]) -> Mapping[str, Effect]:
    """The effects of some names, or all where none is given; OptionError for a name that no
    effect has.
    """
    return {name: find_effect(name) for name in names} or EFFECTS


def make_effect(
    name: str, values: Mapping[str, float], scales: Scales | None = None
) -> ActiveEffect:
    """Make an active effect from its name and the fields that are not absent.

    Parameters
    ----------
    scales : of the campaign that fields which are not given follow; without it they have their
        assumed values

    >>> make_effect("gas_polytropic", {"n": 1.3}).values
    (1.3, 6.0)

    Raises
    ------
    OptionError : no such effect or field, or a value that is not finite or has no physical meaning
    """
    effect = find_effect(name) if scales is None else find_effect(name).at(scales)
    fields = {field.name: field for field in effect.fields}
    for key, value in values.items():
        if key not in fields:
            raise OptionError(f"effect {name} has no field {key!r}; it has {', '.join(fields)}.")
        check_arguments(f"effect {name}", (key, value, NUMBER))
        low, high = fields[key].limits
        if not (math.isfinite(value) and low <= value <= high):
            raise OptionError(
                f"effect {name}: {key} is {value:g}, but must lie between {low:g} and {high:g} "
                f"[{fields[key].unit}]."
            )
    return ActiveEffect(
        effect, tuple(values.get(key, field.unstated) for key, field in fields.items())
    )
