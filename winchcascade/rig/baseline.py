"""Read a rig file, and make its baseline model with the effects that the file states."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from winchcascade.core.arguments import RIG_NAME, check_arguments
from winchcascade.core.errors import OptionError, RigError, check_type
from winchcascade.core.machine_parts import NUMBERS_OF
from winchcascade.core.quantity import ATMOSPHERE, Quantity, find_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import DEFAULT_RIG, read_rig
from winchcascade.core.scales import rated_current
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.parts import (
    IN_RIG,
    PARTS,
    Model,
    in_rig_file,
    model_of_numbers,
    with_part,
)


def load_rig(rig: str | Path) -> Rig:
    """Read a rig file, or the built-in rig of that name where no such file exists.

    Raises
    ------
    OptionError : this is no path and no name
    RigError : an entry of the file is wrong, or an effect that it states is not one of the
        catalogue; names which
    """
    check_arguments("load_rig", ("rig", rig, RIG_NAME))
    found = read_rig(rig)
    stated_effects(found)
    return found


class NoModel(msgspec.Struct, frozen=True):
    """Reason why no model can be made from a rig file, in one sentence."""

    why: str


def baseline(rig: Rig) -> Model:
    """Make the model of a rig file with the effects that it states, from which a diagnosis starts.

    Errors of sensors are among them, as logs have them; `physics` of the model is without.

    Raises
    ------
    RigError : the rig file lacks numbers that a part needs, all of them named, the rig has no
        one-way clutch, or a stated effect is not one of the catalogue
    """
    check_type("baseline", rig, Rig, "load_rig(name)")
    found = model_of(rig)
    if isinstance(found, NoModel):
        raise RigError(found.why)
    return found


NEAR_STANDSTILL = 10.0 / 3.0
"""Speed of the line at which 1/e of a larger friction near standstill is left, over that at
which a payout begins. [1]
"""


def model_of(rig: Rig) -> Model | NoModel:
    """Make the model of a rig file, as `baseline` does, or report why that is not possible."""
    numbers: dict[str, dict[str, float]] = {}
    missing: dict[str, list[str]] = {}
    for section in PARTS:
        stated: dict[str, Quantity | None] = {
            name: getattr(getattr(rig, section), in_rig)
            for name, in_rig in in_rig_file(section).items()
        }
        numbers[section] = {
            name: number.value / IN_RIG.get(f"{section}.{name}", 1.0)
            for name, number in stated.items()
            if number is not None
        }
        lacking = [
            name for name in needed(rig, section) if getattr(getattr(rig, section), name) is None
        ]
        missing |= {section: lacking} if lacking else {}
    if missing:
        return NoModel(_lacking(rig, missing))
    if rig.drivetrain.one_way_clutch is False:
        return NoModel(
            f"rig {rig.name}: no model can be made, as one_way_clutch under [drivetrain] is false, "
            "and the generator of the model is driven in payout alone."
        )
    if rig.restoring.has_gas:
        numbers["restoring"]["pressure"] += ATMOSPHERE
    if rig.drivetrain.direct:
        numbers["drivetrain"]["eta_mesh"] = 1.0
    numbers["generator"]["i_rated"] = rated_current(rig)
    if math.isfinite(rig.thresholds.v_onset):
        numbers["winch"]["stribeck_speed"] = NEAR_STANDSTILL * rig.thresholds.v_onset
    model = with_part(
        model_of_numbers(numbers),
        "winch",
        goes_slack=not (rig.restoring.has_gas or rig.winch.line_can_push),
    )
    for effect in stated_effects(rig):
        model = effect.apply(model)
    return model


def needed(rig: Rig, section: str) -> tuple[str, ...]:
    """Numbers of a part that a model of a rig needs, by their names in a rig file."""
    if section == "restoring":
        return rig.restoring.needed
    given = ("i_rated", "eta_mesh") if rig.drivetrain.direct else ("i_rated",)
    return tuple(name for name in in_rig_file(section).values() if name not in given)


def _lacking(rig: Rig, missing: Mapping[str, Sequence[str]]) -> str:
    """A sentence on the numbers that a rig file lacks, by part, and what to do."""
    parts = [
        f"{', '.join(names)} under [{section}]"
        for section, names in missing.items()
        if section != "restoring"
    ]
    if "restoring" in missing:
        kind, others = (
            rig.restoring.kind,
            " or ".join(f'"{kind}"' for kind in NUMBERS_OF if kind != rig.restoring.kind),
        )
        parts.append(
            f"{', '.join(missing['restoring'])} under [restoring], which a restoring module of "
            f"kind {kind} needs (for another one state kind = {others} there)"
        )
    return (
        f"rig {rig.name}: no model can be made, as it lacks {'; '.join(parts)}. Add them to the "
        f"rig file; "
        f'based_on = "{DEFAULT_RIG}" takes all that it does not state from the rig of the paper.'
    )


GEAR = ("drivetrain.gear", "drivetrain.eta_mesh")
"""Numbers that only a rig with a gear has."""


def missing_part(effect: Effect, rig: Rig) -> str:
    """The part that an effect acts on and a rig does not have; empty where it has it.

    >>> from winchcascade.rig.effects.catalogue import EFFECTS
    >>> missing_part(EFFECTS["gas_volume"], load_rig("hsu2026"))
    ''
    """
    if not rig.restoring.has_gas and (
        effect.stage == "restoring" or effect.path == "sensors.gain.pressure"
    ):
        return "gas, screw and seals"
    return "gear" if rig.drivetrain.direct and effect.path in GEAR else ""


def stated_effects(rig: Rig) -> list[ActiveEffect]:
    """Effects that a rig file states, with their values.

    Raises
    ------
    RigError : no such effect or field, or a value that is not possible
    """
    if not rig.effects:
        return []
    from winchcascade.rig.effects.catalogue import make_effect  # for which a plain log would wait

    effects = []
    for name, stated in rig.effects.items():
        place = f"{rig.path}: [{stated.table(name)}]"
        try:
            effect = make_effect(name, {key: number.value for key, number in stated.fields.items()})
        except OptionError as fault:
            raise RigError(f"{place}: {fault}") from None
        if part := missing_part(effect.effect, rig):
            raise RigError(f"{place}: the rig has no {part}, which this effect acts on; remove it.")
        if stated.of_a_sensor and not effect.effect.of_a_sensor:
            raise RigError(f"{place} is no error of a sensor; state it as [effects.{name}].")
        if not stated.fields:
            raise RigError(
                f"{place} has no field; expected "
                f"{', '.join(field.name for field in effect.effect.fields)}."
            )
        units = {field.name: field.unit for field in effect.effect.fields}
        for key, number in stated.fields.items():
            given, known = find_unit(number.unit), find_unit(units[key])
            if number.unit and (
                given is None or known is None or given.dimension != known.dimension
            ):
                raise RigError(
                    f"{place} {key}: the unit is {number.unit!r}; expected {units[key]!r}."
                )
        effects.append(effect)
    return effects


def sensor_errors(rig: Rig) -> list[str]:
    """Names of the effects that a rig file states and that are errors of its sensors. Raises as
    `stated_effects`.
    """
    return [one.effect.name for one in stated_effects(rig) if one.effect.of_a_sensor]
