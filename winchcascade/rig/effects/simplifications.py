"""What simulations of such rigs leave out: simplifications of the model, declared as effects.

A simulation of the owner is compared with them beside the catalogue. They are no suspects of a log, as no rig is simplified.
"""

from collections.abc import Callable

from msgspec.structs import replace

from winchcascade.rig.effects.effect import Display, Effect, Parameter, Values
from winchcascade.rig.parts import Model

_LEAK = 1e-3
"""Share of the conductance of the bleed resistor that remains where a simulation has none. [1]"""


def _without_bleed(model: Model, values: Values) -> Model:
    link = model.dc_link
    return replace(model, dc_link=replace(link, r_bleed=link.r_bleed / max(1.0 - values[0], _LEAK)))


def _isothermal(model: Model, values: Values) -> Model:
    gas = model.restoring
    return replace(model, restoring=replace(gas, exponent=gas.exponent - values[0] * (gas.exponent - 1.0)))


def _simplification(
    name: str,
    label: str,
    stage: str,
    what: str,
    shows_as: str,
    *,
    path: str = "",
    relative: bool = False,
    law: Callable[[Model, Values], Model] | None = None,
) -> Effect:
    """Declare a simplification, whose one field is the share of what is left out: of a number, or by a law.

    Parameters
    ----------
    what : what such a simulation has, with its article
    """
    how = "from the law of the model to the simplified one"
    share = Parameter("share", "1", 0.0, 1.0, (0.0, 1.0), how, path)
    return Effect(
        name=name,
        stage=stage,
        label=label,
        summary=f"The simulation has {what}.",
        shows_as=shows_as,
        taken_for="",
        source="A usual simplification of simulations; its share is plausible from none to all.",
        fields=(replace(share, operation="scale", per=-1.0) if relative else share,),
        unit="1",
        display=Display(what, 100.0, "%", signed=False),
        law=law,
    )


SIMPLIFICATIONS = {
    effect.name: effect
    for effect in (
        _simplification(
            "averaged_bridge", "Averaged bridge", "generator", "an averaged bridge",
            "vdc low in open circuit and at small load resistance, torque with it.", path="generator.averaged",
        ),
        _simplification(
            "uncommutated_bridge", "No commutation", "generator", "an averaged bridge without commutation",
            "vdc, idc and torque high where speed and current are both high.", path="generator.uncommutated",
        ),
        _simplification(
            "no_bleed", "No bleed resistor", "generator", "no bleed resistor",
            "vdc of an open circuit stays at its peak after a payout.", law=_without_bleed,
        ),
        _simplification(
            "quasi_static", "Quasi-static shaft", "gearbox", "a quasi-static shaft and DC link",
            "vdc and idc follow the speed of the line at once.", path="drivetrain.quasi_static",
        ),
        _simplification(
            "no_rotor_inertia", "No rotor inertia", "gearbox", "no inertia of the rotor",
            "torque low while the line speeds up; vdc and idc follow the speed of the line at once.",
            path="drivetrain.weightless",
        ),
        _simplification(
            "no_drum_inertia", "No drum inertia", "transmission", "no inertia of the drum",
            "force low while the line speeds up and high while it brakes; torque as it is.",
            path="winch.inertia", relative=True,
        ),
        _simplification(
            "isothermal_gas", "Isothermal gas", "restoring", "an isothermal gas",
            "pressure and force without the heat of compression; only of a rig whose gas heats.", law=_isothermal,
        ),
    )
}  # fmt: skip
"""Every simplification by its name."""
