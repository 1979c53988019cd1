"""Wrong entries: numbers that the rig file or the campaign states wrongly.

The logged motion of the line is the input of the model. A radius that deviates changes the speed of the drum, unless the
logger computes the motion with the same radius.
"""

import math
from functools import partial

from msgspec.structs import replace

from winchcascade.rig.effects.effect import ANY, Display, Effect, Parameter, Values
from winchcascade.rig.parts import Model, changed

USUAL = tuple(ratio - 1.0 for ratio in (1 / 2, 2 / 3, 3 / 2, 2.0))
"""Usual ratios of a true number to a wrong one, minus 1: diameter for radius, both for one of two, and the like."""

CONVENTIONS = tuple(
    ratio - 1.0 for root in (math.sqrt(3.0), math.sqrt(2.0), math.sqrt(1.5)) for ratio in (root, 1.0 / root)
)
"""Relative changes of a back-EMF constant between line to line and phase, rms and peak, and both at once."""

_entry = partial(Effect, stage="entry")
_changed = partial(
    Parameter,
    unit="1",
    low=-0.55,
    high=1.1,
    possible=ANY,
    source="plausible range: from half to twice the stated number",
    operation="scale",
    role="entry",
    usual=USUAL,
)
_of_phase = partial(
    _changed, low=-0.65, high=1.6, source="line to line over phase: 2 and 1/2", usual=(-0.5, 1.0), usual_share=1.0
)


def _ratio(values: Values) -> float:
    return 1.0 + values[0]


ENTRY = (
    _entry(
        name="drum_radius",
        label="Drum radius",
        summary="The rig file states another drum radius than the drum has; the logged line motion is true.",
        shows_as="vdc and idc deviate by the share of the radius as the drum turns at another speed, torque with them, "
        "pressure in proportion to displacement, and force, also at rest.",
        taken_for="a wrong gear ratio (gear_ratio), which force and pressure do not show in haul-in; another scale of the "
        "logged motion (encoder_scale), which leaves the force at rest alone.",
        source="Hsu et al. 2026, Secs. 2.1.1 and 2.2: a rope of 24 mm on a drum of radius 0.13 m.",
        fields=(_changed("r_drum_change", path="winch.r_drum"),),
        parameter="r_drum",
        unit="m",
        display=Display("drum radius", 1.0, "m", signed=False),
    ),
    _entry(
        name="gear_ratio",
        label="Gear ratio",
        summary="The rig file states another gear ratio than the gear has.",
        shows_as="vdc and idc deviate by the share of the ratio, torque and force in payout by about twice that; pressure "
        "agrees.",
        taken_for="another back-EMF constant (ke_shift), which differs by reactance, drag and inertia of the fast shaft only.",
        source="Hsu et al. 2026, Table 4: 1:50.",
        fields=(_changed("gear_ratio_change", path="drivetrain.gear"),),
        parameter="gear_ratio",
        unit="1",
        display=Display("gear ratio", signed=False),
    ),
    _entry(
        name="pole_pairs",
        label="Pole pairs",
        summary="The rig file states another number of pole pairs than the machine has: poles for pole pairs, say.",
        shows_as="vdc, idc, torque and force deviate where speed and current are both high: the reactance differs.",
        taken_for="another phase inductance (sync_inductance): only the product of both enters.",
        source="Hsu et al. 2026, Table 4.",
        fields=(_changed("pole_pairs_change", path="generator.pole_pairs"),),
        parameter="pole_pairs",
        unit="1",
        display=Display("pole pairs", signed=False),
        same_as=("sync_inductance", "l_s_convention"),
    ),
    _entry(
        name="screw_lead",
        label="Screw lead",
        summary="The rig file states another lead than the screw has.",
        shows_as="pressure deviates in proportion to displacement, and force by the share of the lead.",
        taken_for="another piston area (piston_area): only the product of both enters.",
        source="Hsu et al. 2026, Table 3: 10 mm/rev.",
        fields=(_changed("lead_change", path="restoring.lead"),),
        parameter="lead",
        unit="m/rev",
        display=Display("lead of the screw", 1000.0, "mm/rev", signed=False),
        same_as=("piston_area",),
    ),
    _entry(
        name="encoder_scale",
        label="Scale of the motion",
        summary="Logged velocity and displacement have another scale than the motion of the line.",
        shows_as="vdc and idc deviate by the share of the scale, torque with them, and pressure and force in proportion to "
        "displacement; the force at rest agrees.",
        taken_for="a wrong drum radius (drum_radius), which the force also shows at rest.",
        source="Hsu et al. 2026, Table 1: an encoder at the drum; plausible range.",
        fields=(_changed("scale_error", path="sensors.motion_scale", operation="compound"),),
        parameter="scale",
        unit="1",
        display=Display("logged over true line motion", signed=False),
        reported_from=_ratio,
    ),
    _entry(
        name="load_entry",
        label="Load of a run",
        summary="The load of one run is another one than the campaign states.",
        shows_as="in one run alone vdc and idc deviate in opposite directions, and torque and force with them.",
        taken_for="a load that differs in all runs (load_drift); gain errors of Vdc or Idc (voltage_gain, current_gain), "
        "which all runs show.",
        source="plausible range, from a quarter to four times: loads are switched by hand and by the same bank.",
        fields=(_changed("load_change", low=-0.8, high=3.2, path="dc_link.load_change", operation="compound"),),
        parameter="load_ohm",
        unit="ohm",
        display=Display("load of the run", 1.0, "Ω", signed=False),
    ),
    _entry(
        name="k_e_convention",
        label="Form of k_e",
        summary="The rig file states the back-EMF constant of a phase or of the peak, not line to line and rms.",
        shows_as="vdc, idc, torque and force deviate by factors of sqrt(3), sqrt(2) or both, in open circuit too.",
        taken_for="another back-EMF constant (ke_shift), which lies within its tolerance.",
        source="line to line over phase: sqrt(3); peak over rms of a sine: sqrt(2).",
        fields=(_changed("k_e_change", path="generator.k_e", usual=CONVENTIONS, scatter=0.02, usual_share=1.0),),
        parameter="k_e_ratio",
        unit="1",
        display=Display("k_e, true over stated", signed=False),
        reported_from=_ratio,
    ),
    _entry(
        name="r_s_convention",
        label="Form of r_s",
        summary="The rig file states the stator resistance line to line, not of a phase.",
        shows_as="vdc and idc deviate at small load resistance, torque and force by less; the resistance by a factor of 2.",
        taken_for="hot copper (copper_heating), which raises the resistance by less than a factor of 2.",
        source="line to line over phase, star connection: 2.",
        fields=(_of_phase("r_s_change", path="generator.r_s", scatter=0.05),),
        parameter="r_s_ratio",
        unit="1",
        display=Display("r_s, true over stated", signed=False),
        reported_from=_ratio,
    ),
    _entry(
        name="l_s_convention",
        label="Form of l_s",
        summary="The rig file states the inductance line to line, not of a phase.",
        shows_as="vdc, idc, torque and force deviate where speed and current are both high; the inductance by a factor of 2.",
        taken_for="a wrong number of pole pairs (pole_pairs): only the product of both enters.",
        source="line to line over phase, star connection: 2.",
        fields=(_of_phase("l_s_change", path="generator.l_s", scatter=0.02),),
        parameter="l_s_ratio",
        unit="1",
        display=Display("l_s, true over stated", signed=False),
        reported_from=_ratio,
        same_as=("sync_inductance", "pole_pairs"),
    ),
)
"""Wrong entries, suspects of every diagnosis."""


def _shared_radius(model: Model, values: Values) -> Model:
    """Another radius with which the logger computes the motion too: the angle of the drum stays."""
    other = changed(model, "winch.r_drum", "scale", values[0])
    return changed(other, "sensors.motion_scale", "compound", 1.0 / (1.0 + values[0]) - 1.0)


SHARED_RADIUS = replace(
    ENTRY[0],
    summary="The rig file and the logger use another drum radius than the drum has; the encoder sits at the drum.",
    shows_as="force alone, by the same share in every phase.",
    taken_for="a gain error of the force cell (force_gain), which looks the same.",
    law=_shared_radius,
    same_as=("force_gain", "load_proportional_loss"),
)
"""The drum radius where encoder and logger share it: a second form of `drum_radius`, no effect of its own in the catalogue."""
