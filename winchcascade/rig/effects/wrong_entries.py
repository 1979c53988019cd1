"""Wrong entries: numbers that the rig file or the campaign states wrongly.

The logged motion of the line is the input of the model. A radius that deviates changes the speed of the drum, unless the
logger computes the motion with the same radius.
"""

import math

import msgspec

from winchcascade.rig.effects.effect import Change, Display, Effect, Field, Values, WrongEntry
from winchcascade.rig.parts import Model, changed

USUAL = tuple(ratio - 1.0 for ratio in (1 / 2, 2 / 3, 3 / 2, 2.0))
"""Usual ratios of a true number to a wrong one, minus 1: diameter for radius, both for one of two, and the like."""

ANY = (-0.9, 9.0)
"""Values at which a number that is changed by a share of itself has a physical meaning."""

_RANGE = "plausible range: from half to twice the stated number"


def _change(name: str, source: str = _RANGE, low: float = -0.55, high: float = 1.1) -> tuple[Field, ...]:
    return (Field(name, "1", low, high, ANY, source),)


def _ratio(values: Values) -> float:
    return 1.0 + values[0]


_K_E = tuple(ratio - 1.0 for ratio in (math.sqrt(3.0), math.sqrt(2.0), math.sqrt(1.5))) + tuple(
    1.0 / ratio - 1.0 for ratio in (math.sqrt(3.0), math.sqrt(2.0), math.sqrt(1.5))
)
"""Relative changes of a back-EMF constant between line to line and phase, rms and peak, and both at once."""


def _line_to_line(
    symbol: str, what: str, *, shows_as: str, taken_for: str, scatter: float, same_as: tuple[str, ...] = ()
) -> Effect:
    """Declare that the rig file states a number of the generator line to line, not of a phase."""
    return Effect(
        name=f"{symbol}_convention",
        label=f"Form of {symbol}",
        stage="entry",
        summary=f"The rig file states the {what} line to line, not of a phase.",
        shows_as=shows_as,
        taken_for=taken_for,
        source="line to line over phase, star connection: 2.",
        fields=_change(f"{symbol}_change", "2 and 1/2", -0.65, 1.6),
        parameter=f"{symbol}_ratio",
        unit="1",
        display=Display(f"{symbol}, true over stated", signed=False),
        law=Change(f"generator.{symbol}", "scale"),
        reported_from=_ratio,
        entry=WrongEntry(f"generator.{symbol}", (-0.5, 1.0), scatter, always_usual=True, same_as=same_as),
    )


ENTRY = (
    Effect(
        name="drum_radius",
        label="Drum radius",
        stage="entry",
        summary="The rig file states another drum radius than the drum has; the logged line motion is true.",
        shows_as="vdc and idc deviate by the share of the radius as the drum turns at another speed, torque with them, "
        "pressure in proportion to displacement, and force, also at rest.",
        taken_for="a wrong gear ratio (gear_ratio), which force and pressure do not show in haul-in; another scale of the "
        "logged motion (encoder_scale), which leaves the force at rest alone.",
        source="Hsu et al. 2026, Secs. 2.1.1 and 2.2: a rope of 24 mm on a drum of radius 0.13 m.",
        fields=_change("r_drum_change"),
        parameter="r_drum",
        unit="m",
        display=Display("drum radius", 1.0, "m", signed=False),
        law=Change("winch.r_drum", "scale"),
        entry=WrongEntry("winch.r_drum", USUAL),
    ),
    Effect(
        name="gear_ratio",
        label="Gear ratio",
        stage="entry",
        summary="The rig file states another gear ratio than the gear has.",
        shows_as="vdc and idc deviate by the share of the ratio, torque and force in payout by about twice that; pressure "
        "agrees.",
        taken_for="another back-EMF constant (ke_shift), which differs by reactance, drag and inertia of the fast shaft only.",
        source="Hsu et al. 2026, Table 4: 1:50.",
        fields=_change("gear_ratio_change"),
        parameter="gear_ratio",
        unit="1",
        display=Display("gear ratio", signed=False),
        law=Change("drivetrain.gear", "scale"),
        entry=WrongEntry("drivetrain.gear_ratio", USUAL),
    ),
    Effect(
        name="pole_pairs",
        label="Pole pairs",
        stage="entry",
        summary="The rig file states another number of pole pairs than the machine has: poles for pole pairs, say.",
        shows_as="vdc, idc, torque and force deviate where speed and current are both high: the reactance differs.",
        taken_for="another phase inductance (sync_inductance): only the product of both enters.",
        source="Hsu et al. 2026, Table 4.",
        fields=_change("pole_pairs_change"),
        parameter="pole_pairs",
        unit="1",
        display=Display("pole pairs", signed=False),
        law=Change("generator.pole_pairs", "scale"),
        entry=WrongEntry("generator.pole_pairs", USUAL, same_as=("sync_inductance", "l_s_convention")),
    ),
    Effect(
        name="screw_lead",
        label="Screw lead",
        stage="entry",
        summary="The rig file states another lead than the screw has.",
        shows_as="pressure deviates in proportion to displacement, and force by the share of the lead.",
        taken_for="another piston area (piston_area): only the product of both enters.",
        source="Hsu et al. 2026, Table 3: 10 mm/rev.",
        fields=_change("lead_change"),
        parameter="lead",
        unit="m/rev",
        display=Display("lead of the screw", 1000.0, "mm/rev", signed=False),
        law=Change("restoring.lead", "scale"),
        entry=WrongEntry("restoring.lead", USUAL, same_as=("piston_area",)),
    ),
    Effect(
        name="encoder_scale",
        label="Scale of the motion",
        stage="entry",
        summary="Logged velocity and displacement have another scale than the motion of the line.",
        shows_as="vdc and idc deviate by the share of the scale, torque with them, and pressure and force in proportion to "
        "displacement; the force at rest agrees.",
        taken_for="a wrong drum radius (drum_radius), which the force also shows at rest.",
        source="Hsu et al. 2026, Table 1: an encoder at the drum; plausible range.",
        fields=_change("scale_error", "plausible range: logged motion of half to twice the true one"),
        parameter="scale",
        unit="1",
        display=Display("logged over true line motion", signed=False),
        law=Change("sensors.motion_scale", "compound"),
        reported_from=_ratio,
        entry=WrongEntry("", USUAL),
    ),
    Effect(
        name="load_entry",
        label="Load of a run",
        stage="entry",
        summary="The load of one run is another one than the campaign states.",
        shows_as="in one run alone vdc and idc deviate in opposite directions, and torque and force with them.",
        taken_for="a load that differs in all runs (load_drift); gain errors of Vdc or Idc (voltage_gain, current_gain), "
        "which all runs show.",
        source="plausible range: loads are switched by hand and by the same bank.",
        fields=_change("load_change", "plausible range: from a quarter to four times the stated load", -0.8, 3.2),
        parameter="load_ohm",
        unit="ohm",
        display=Display("load of the run", 1.0, "Ω", signed=False),
        law=Change("dc_link.load_change", "compound"),
        entry=WrongEntry("", USUAL),
    ),
    Effect(
        name="k_e_convention",
        label="Form of k_e",
        stage="entry",
        summary="The rig file states the back-EMF constant of a phase or of the peak, not line to line and rms.",
        shows_as="vdc, idc, torque and force deviate by factors of sqrt(3), sqrt(2) or both, in open circuit too.",
        taken_for="another back-EMF constant (ke_shift), which lies within its tolerance.",
        source="line to line over phase: sqrt(3); peak over rms of a sine: sqrt(2).",
        fields=_change("k_e_change", "sqrt(3), sqrt(2), sqrt(3/2) and their inverses"),
        parameter="k_e_ratio",
        unit="1",
        display=Display("k_e, true over stated", signed=False),
        law=Change("generator.k_e", "scale"),
        reported_from=_ratio,
        entry=WrongEntry("generator.k_e", _K_E, 0.02, always_usual=True),
    ),
    _line_to_line(
        "r_s",
        "stator resistance",
        shows_as="vdc and idc deviate at small load resistance, torque and force by less; the resistance by a factor of 2.",
        taken_for="hot copper (copper_heating), which raises the resistance by less than a factor of 2.",
        scatter=0.05,
    ),
    _line_to_line(
        "l_s",
        "inductance",
        shows_as="vdc, idc, torque and force deviate where speed and current are both high; the inductance by a factor of 2.",
        taken_for="a wrong number of pole pairs (pole_pairs): only the product of both enters.",
        scatter=0.02,
        same_as=("sync_inductance", "pole_pairs"),
    ),
)
"""Wrong entries, suspects of every diagnosis."""


def _shared_radius(model: Model, values: Values) -> Model:
    """Another radius with which the logger computes the motion too: the angle of the drum stays."""
    other = changed(model, "winch.r_drum", "scale", values[0])
    return changed(other, "sensors.motion_scale", "compound", 1.0 / (1.0 + values[0]) - 1.0)


SHARED_RADIUS = msgspec.structs.replace(
    ENTRY[0],
    summary="The rig file and the logger use another drum radius than the drum has; the encoder sits at the drum.",
    shows_as="force alone, by the same share in every phase.",
    taken_for="a gain error of the force cell (force_gain), which looks the same.",
    law=_shared_radius,
    entry=WrongEntry("winch.r_drum", USUAL, same_as=("force_gain", "load_proportional_loss")),
)
"""The drum radius where encoder and logger share it: a second form of `drum_radius`, no effect of its own in the catalogue."""
