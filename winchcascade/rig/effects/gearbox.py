"""Effects of gear, clutch and fast shaft."""

from functools import partial

from msgspec.structs import replace

from winchcascade.rig.effects.effect import ANY, Display, Effect, Parameter, Values
from winchcascade.rig.parts import Model

_effect = partial(Effect, stage="gearbox")


def _dragging(model: Model, values: Values) -> Model:
    shaft, (torque, share) = model.drivetrain, values
    dragged = replace(shaft, clutch_drag=shaft.clutch_drag + torque, coast_drag=shaft.coast_drag + torque * share)
    return replace(model, drivetrain=dragged)


def _dragging_more(first: Values, second: Values) -> Values:
    both = first[0] + second[0]
    return both, (first[0] * first[1] + second[0] * second[1]) / both if both else second[1]


GEARBOX = (
    _effect(
        name="gear_mesh_loss",
        label="Gear mesh loss",
        summary="Mesh efficiency of the gear below its given value.",
        shows_as="torque and force above the baseline in payout by the same share at every speed and load; vdc and idc agree.",
        taken_for="a gain error of the torque sensor (torque_gain), which leaves the force alone; constant drag "
        "(rotor_friction), whose share shrinks with load.",
        source="Hsu et al. 2026: 0.9 in Sec. 4.1.3, 0.95 in Table 4, three times over.",
        fields=(Parameter("efficiency_change", "1", -0.15, 0.0, (-0.9, 0.0), "Table 4", "drivetrain.eta_mesh"),),
        display=Display("mesh efficiency", 100.0, "points"),
    ),
    _effect(
        name="rotor_viscous",
        label="Rotor viscous drag",
        summary="Drag on the fast shaft in proportion to its speed, beyond the calibrated damper: oil in gear and bearings or "
        "eddy currents in the iron, which logs cannot separate.",
        shows_as="torque and force above the baseline in payout, in proportion to speed, the same at every load; the "
        "rotor runs down faster after payout.",
        taken_for="drag with speed squared (rotor_windage); drag between line and torque sensor (line_drag), which the "
        "torque does not show.",
        source="Hsu et al. 2026, Sec. 4.2, Fig. 11 (viscous damper, 7.5e-4) and Sec. 4.3.2 (oil churning).",
        fields=(Parameter("b_extra", "N.m.s/rad", 0.0, 0.002, (0.0, 1.0), "plausible range", "drivetrain.b_rotor"),),
        display=Display("fast shaft, drag over speed", 1000.0, "mN·m·s/rad"),
    ),
    _effect(
        name="rotor_windage",
        label="Rotor windage",
        summary="Drag on the fast shaft in proportion to its speed squared.",
        shows_as="torque and force above the baseline in payout at high speed, the same at every load.",
        taken_for="drag in proportion to speed (rotor_viscous), which also shows at low speed.",
        source="Hsu et al. 2026, Sec. 4.3.2 (bearing windage); plausible range: 0.66 N m at the rated 2000 rpm.",
        fields=(
            Parameter("c_extra", "N.m.s2/rad2", 0.0, 1.5e-5, (0.0, 0.01), "plausible range", "drivetrain.windage"),
        ),
        display=Display("fast shaft, drag over speed²", 1000000.0, "µN·m·s²/rad²"),
    ),
    _effect(
        name="rotor_friction",
        label="Rotor friction",
        summary="Constant drag torque on the fast shaft: seals, bearings or iron hysteresis, which logs cannot separate.",
        shows_as="torque and force above the baseline in payout by the same amount at every speed and load, open "
        "circuit included.",
        taken_for="a zero error of the torque sensor, which also shows at rest; friction before the sensor "
        "(line_friction), which torque does not show.",
        source="Hsu et al. 2026, Sec. 4.3.2 (sliding friction left out of models); plausible range.",
        fields=(Parameter("torque", "N.m", 0.0, 0.6, (0.0, 100.0), "1/8 of the rated torque", "drivetrain.friction"),),
        display=Display("fast shaft, constant drag", 1.0, "N·m"),
    ),
    _effect(
        name="rotor_inertia",
        label="Rotor inertia",
        summary="Inertia of the fast shaft differs: coupling, gear or brake disc not in the data of the rotor.",
        shows_as="torque and force deviate while the line speeds up and at the edge of braking; vdc runs down slower or "
        "faster after payout; the plateau agrees.",
        taken_for="inertia at the drum (drum_inertia), which torque does not show; drag (rotor_viscous), which the "
        "plateau shows.",
        source="Hsu et al. 2026, Table 4: the rotor of the generator alone.",
        fields=(Parameter("j_change", "1", -0.5, 6.0, ANY, "gear and couplings", "drivetrain.inertia_rotor", "scale"),),
        display=Display("fast shaft, inertia", 100.0, "%"),
    ),
    _effect(
        name="clutch_drag",
        label="Clutch drag",
        summary="Overrunning clutch drags while the line is hauled in, and on the rotor while it coasts.",
        shows_as="torque below zero, and force lower, in haul-in; the coasting rotor stops sooner.",
        taken_for="a zero error of the torque sensor, which payout and hold show too; friction before the sensor "
        "(line_friction), which torque does not show.",
        source="Hsu et al. 2026, Sec. 4.1.3: an ideal clutch is assumed; plausible range.",
        fields=(
            Parameter("torque", "N.m", 0.0, 10.0, (0.0, 1000.0), "less than the screw returns in haul-in"),
            Parameter("coasting_share", "1", 0.0, 1.0, (0.0, 1.0), "share on the coasting rotor", absent=1.0),
        ),
        display=Display("clutch drag in haul-in", 1.0, "N·m", signed=False),
        law=_dragging,
        together=_dragging_more,
    ),
)
"""Effects of the stage gearbox."""
