"""Effects between line and torque sensor."""

import math
from functools import partial

from msgspec.structs import replace

from winchcascade.rig.effects.effect import Display, Effect, Parameter, Values
from winchcascade.rig.parts import Model

_effect = partial(Effect, stage="transmission")

SPAN = 10.0
"""Payout over which the change of radius is given. [m]"""

SLOW = 0.05
"""Speed of the line at which the larger friction near standstill is reported: logs show it there, but not at rest. [m/s]"""


def _sticking(model: Model, values: Values) -> Model:
    """Add friction near standstill to line and seals; what the model has of it already fades at the mean of both speeds."""
    winch, gas, (torque, _, seals) = model.winch, model.restoring, values
    before = max(winch.stribeck + gas.stribeck, 0.0)  # below zero where a fit moves it within its tolerance
    _, speed, _ = _stickier((before, winch.stribeck_speed, 0.0), values)
    return replace(
        model,
        winch=replace(winch, stribeck=winch.stribeck + torque * (1.0 - seals), stribeck_speed=speed),
        restoring=replace(gas, stribeck=gas.stribeck + torque * seals),
    )


def _stickier(first: Values, second: Values) -> Values:
    """Two frictions near standstill together: torques add, speed and share of the seals by the share of each torque."""
    both = first[0] + second[0]
    share = second[0] / both if both > 0.0 else 0.0
    return both, *(a + share * (b - a) for a, b in zip(first[1:], second[1:], strict=True))


TRANSMISSION = (
    _effect(
        name="line_friction",
        label="Line friction",
        summary="Constant friction between line and torque sensor, against the motion.",
        shows_as="force above the baseline in payout and below it in haul-in by the same amount; torque and pressure agree.",
        taken_for="seals or screw (seal_friction, screw_friction), which also show in force alone, but whose share in "
        "haul-in differs and grows with pressure.",
        source="Hsu et al. 2026, Sec. 4.2: chain and sprockets are lumped into other blocks; plausible range.",
        fields=(Parameter("torque", "N.m", 0.0, 20.0, (0.0, 1000.0), "haul-in leaves about 14 N m", "winch.friction"),),
        unit="N.m, at the drum",
        display=Display("friction of line and drum", 1.0, "N·m", signed=False),
    ),
    _effect(
        name="line_drag",
        label="Line drag",
        summary="Drag between line and torque sensor in proportion to speed.",
        shows_as="force above the baseline in payout and below it in haul-in, in proportion to the speed of the line; "
        "torque and pressure agree.",
        taken_for="drag on the fast shaft (rotor_viscous), which torque shows and haul-in does not; constant friction "
        "(line_friction).",
        source="Hsu et al. 2026, Sec. 4.3.2 (drag of the drivetrain that grows with speed); plausible range.",
        fields=(Parameter("b", "N.m.s/rad", 0.0, 3.0, (0.0, 1000.0), "20 N m at 0.9 m/s", "winch.drag"),),
        unit="N.m.s/rad, at the drum",
        display=Display("drag of line and drum", 1.0, "N·m·s/rad", signed=False),
    ),
    _effect(
        name="load_proportional_loss",
        label="Rope and sheave loss",
        summary="A share of the tension is lost between crane and drum: hysteresis of the rope, sheaves, chain.",
        shows_as="force above the baseline in payout and below it in haul-in, by the same share of the tension; torque and "
        "pressure agree.",
        taken_for="a gain error of the force cell (force_gain), which reads alike in payout but costs no energy and has the "
        "same sign in haul-in, where the tension is small.",
        source="Feyrer 2015, Wire Ropes, ch. 2 (efficiency of a rope over a sheave, 0.94 to 0.99); plausible range.",
        fields=(Parameter("share", "1", 0.0, 0.15, (0.0, 0.9), "a few sheaves", "winch.loss_share"),),
        unit="relative",
        display=Display("share of the tension lost", 100.0, "%", signed=False),
        same_as=("force_gain",),
    ),
    _effect(
        name="stribeck",
        label="Stribeck friction",
        summary="Friction is larger near standstill, at line and seals, and falls to its constant value as the line speeds up.",
        shows_as="force above the baseline where a payout begins and ends and below it where a haul-in does, at less than "
        "about 0.2 m/s; at the plateau nothing; torque and pressure agree.",
        taken_for="constant friction (line_friction, seal_friction), which the plateau shows as well; inertia at the drum "
        "(drum_inertia), whose sign differs between speeding up and braking.",
        source="Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30, 1083; plausible range.",
        fields=(
            Parameter("torque", "N.m", 0.0, 15.0, (0.0, 1000.0), "at standstill, beyond the constant friction"),
            Parameter("speed", "m/s", 0.03, 0.3, (0.001, 10.0), "speed at which a third is left", absent=0.1),
            Parameter(
                "seal_share", "1", 0.0, 1.0, (0.0, 1.0), "share of it at the seals, before the losses of the screw"
            ),
        ),
        parameter="slow_torque",
        unit="N.m, at the drum",
        display=Display("further friction at 0.05 m/s", 1.0, "N·m", signed=False),
        law=_sticking,
        together=_stickier,
        reported_from=lambda values: values[0] * math.exp(-((SLOW / values[1]) ** 2)),
    ),
    _effect(
        name="drum_inertia",
        label="Drum inertia",
        summary="Inertia at the drum differs: rope on the drum, chain and sprockets.",
        shows_as="force deviates while the line speeds up or brakes, in payout and haul-in; torque and pressure agree.",
        taken_for="inertia of the fast shaft (rotor_inertia), which torque shows and haul-in does not.",
        source="Hsu et al. 2026, Table 4: 0.3 kg m2.",
        fields=(Parameter("j_extra", "kg.m2", -0.2, 1.0, (-0.29, 100.0), "plausible range", "winch.inertia"),),
        display=Display("inertia at the drum", 1.0, "kg·m²"),
    ),
    _effect(
        name="drum_layering",
        label="Rope layering",
        summary="Effective radius of the rope changes linearly with the payout, from none at zero payout.",
        shows_as="force alone, by a share that grows with the displacement, in payout, hold and haul-in alike.",
        taken_for="a gain error of the force cell (force_gain), whose share is the same at every displacement; gas "
        "(gas_volume), which pressure shows.",
        source="Hsu et al. 2026, Secs. 2.1.1 and 2.2: a rope of 24 mm on a drum of radius 0.13 m, 12 turns in 10 m.",
        fields=(
            Parameter(
                "radius_change_per_10_m",
                "1",
                -0.2,
                0.2,
                (-0.8, 0.8),
                "one layer within 10 m",
                "winch.layering",
                per=SPAN,
            ),
        ),
        unit="relative",
        display=Display("rope radius per 10 m", 100.0, "%"),
    ),
)
"""Effects of the stage transmission."""
