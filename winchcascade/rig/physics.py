"""The laws of the rig, each written once: the compiled step, the ledger and the stages use these.

A law is plain arithmetic of numbers, or of arrays of one length, (n,), in SI units, payout
positive. `sign` is the direction of friction: 1 in payout, -1 in haul-in, in between near rest; a
caller computes it once, by `direction`.

Numba does not see a change of this file: delete the compiled code of the files that use it, `find .
-name "*.nb[ic]" -delete`.
"""

import math
from typing import TypeVar

import numpy as np
from numba.extending import register_jitable

from winchcascade.core.quantity import KGF
from winchcascade.core.run import Signal
from winchcascade.rig.parts import DrivetrainModel, GeneratorModel, RestoringModel, WinchModel

FASTMATH = {"contract", "arcp"}
"""Of compiled loops: a product and a sum may be rounded once, and a division by a constant may be a
product. Zeros and what is not a number stay as they are."""

REST = 0.01
"""Friction at the line changes its sign within this share of the top speed of the line. [1]"""

TURN = 0.13
"""That of the high-speed shaft does within this share of its speed at the line speed of `REST`.
[1]"""

RPM = 30.0 / math.pi
"""Of a speed in rad/s. [rpm s/rad]"""

RECTIFIED = 3.0 * math.sqrt(2.0) / math.pi
"""Mean of a rectified three-phase voltage over its rms, line to line (Mohan, Undeland and
Robbins 2003, chapter 5). [1]
"""

X = TypeVar("X", float, Signal)
"""A number or an array."""

law = register_jitable(fastmath=FASTMATH, error_model="numpy")
"""Of a law: it is part of the compiled code that calls it, and a plain function of arrays
elsewhere.
"""


def direction(speed: Signal, within: float) -> Signal:
    """Direction of friction at some speeds, (n,): 1 or -1, in between within a speed. [1]"""
    sign: Signal = np.tanh(speed / within)
    return sign


# --------------------------------------------------------------------------------- line and screw
@law
def both_ways(sign: X, payout: float, haul_in: float) -> X:
    """A factor that is another one in payout and in haul-in. [1]"""
    return 0.5 * (1.0 + sign) * payout + 0.5 * (1.0 - sign) * haul_in


@law
def near_rest(v: X, sign: X, winch: WinchModel) -> X:
    """Direction of the friction that fades with the speed of the line (Armstrong-Helouvry et al.
    1994). [1]
    """
    slow: X = sign * np.exp(-((v / winch.stribeck_speed) ** 2))
    return slow


@law
def line_losses(omega_drum: X, sign: X, slow: X, winch: WinchModel) -> X:
    """Torque against the motion between line and torque sensor, at the drum. [N m]

    Parameters
    ----------
    slow : as `near_rest` gives it
    """
    return winch.friction * sign + winch.drag * omega_drum + winch.stribeck * slow


@law
def line_over_drum(sign: X, winch: WinchModel) -> X:
    """Tension at the crane over that at the drum: sheaves and bending rope take a share of what
    drives. [1]
    """
    return both_ways(sign, 1.0 / (1.0 - winch.loss_share), 1.0 - winch.loss_share)


@law
def rope_radius(x: X, winch: WinchModel) -> X:
    """Radius at which the rope pulls at a displacement. [m]"""
    return winch.r_drum * (1.0 + winch.layering * x)


@law
def seal_torque(sign: X, slow: X, gas: RestoringModel) -> X:
    """Friction of the seals as a torque at the drum, before the losses of the screw. [N m]"""
    return gas.lead * gas.seal_friction * sign + gas.stribeck * slow


@law
def piston_torque(pressure: X, gas: RestoringModel) -> X:
    """Thrust of a gauge pressure as a torque at the drum, before the losses of the screw. [N m]"""
    return gas.lead * pressure * gas.area


@law
def pulls(part: RestoringModel) -> bool:
    """Whether a spring or a counterweight pulls at the drum."""
    return part.force != 0.0 or part.stiffness != 0.0 or part.mass != 0.0 or part.friction != 0.0


@law
def pull_torque(angle: X, rise: X, r_drum: float, part: RestoringModel) -> X:
    """Torque at the drum of a spring, F0 + k x, and of a counterweight, m (g + a), that the line of
    the drum moves. [N m]

    Parameters
    ----------
    angle, rise : of the drum since zero payout [rad], and its acceleration [rad/s2]
    """
    return r_drum * (
        part.force + part.stiffness * r_drum * angle + part.mass * (KGF + r_drum * rise)
    )


@law
def pull_friction(sign: X, r_drum: float, part: RestoringModel) -> X:
    """Friction of a spring or a counterweight as a torque at the drum. [N m]"""
    return r_drum * part.friction * sign


def tension(force: Signal, winch: WinchModel) -> Signal:
    """Tension that a cell in the line can read, (n,): a slack rope has none. [N]"""
    return np.maximum(force, 0.0) if winch.goes_slack else force


@law
def open_clutch(sign: X, shaft: DrivetrainModel) -> X:
    """Torque of the open clutch on the PTO shaft while the line is hauled in, below zero. [N m]"""
    return -shaft.clutch_drag * 0.5 * (1.0 - sign) * abs(sign)


# -------------------------------------------------------------------------------- high-speed shaft
SHAFT_LOSSES = {
    "friction": "constant drag of the high-speed shaft",
    "damper": "viscous drag of the high-speed shaft",
    "windage": "drag of the high-speed shaft with its speed squared",
}
"""Losses of the high-speed shaft, in the order of `shaft_losses`, with what they are."""


@law
def has_dry_friction(shaft: DrivetrainModel) -> bool:
    """Whether a law of the high-speed shaft depends on the direction of friction, which takes long
    to compute.
    """
    return shaft.friction != 0.0 or shaft.coast_drag != 0.0


@law
def shaft_losses(
    omega: X, sign: X, turn: float, shaft: DrivetrainModel
) -> tuple[tuple[X, X | float], ...]:
    """Torque against the high-speed shaft by each of `SHAFT_LOSSES` [N m], with the slope by which
    it is stepped [N m s/rad].

    Dry friction comes first: it alone may be negative, within the tolerance of a fit.

    Parameters
    ----------
    turn : speed within which friction changes its sign [rad/s]
    """
    speed = abs(omega)
    return (
        (shaft.friction * sign, shaft.friction * (1.0 - sign * sign) / turn),
        (shaft.b_rotor * omega, shaft.b_rotor),
        (shaft.windage * speed * omega, shaft.windage * speed),
    )


@law
def total(losses: tuple[tuple[X, X | float], ...]) -> tuple[X, X | float]:
    """Sum of some torques and of their slopes."""
    torque, slope = losses[0]
    for one, by in losses[1:]:
        torque, slope = torque + one, slope + by
    return torque, slope


# -------------------------------------------------------------------------------------- generator
@law
def reactance(omega: X, machine: GeneratorModel) -> X:
    """Reactance of a phase at a speed of the high-speed shaft. [ohm]"""
    return machine.pole_pairs * omega * machine.l_s


ELECTRICAL_LOSSES = {"copper": "resistance of the stator", "diodes": "drop of the bridge"}
"""Losses between air gap and DC link, in the order of `electrical_losses`, with what they are."""


@law
def electrical_losses(i_bridge: X, i_s: X, machine: GeneratorModel) -> tuple[X, X]:
    """Power by each of `ELECTRICAL_LOSSES` at a current of the bridge and a stator current, rms.
    [W]
    """
    square = 3.0 * i_s * i_s
    return machine.r_s * square, 2.0 * machine.v_diode * i_bridge + machine.r_diode * square


@law
def air_gap_power(v_dc: X, i_bridge: X, i_s: X, machine: GeneratorModel) -> X:
    """Power that the rotor gives the stator: what reaches the DC link, and what is lost before.
    [W]
    """
    copper, diodes = electrical_losses(i_bridge, i_s, machine)
    return v_dc * i_bridge + copper + diodes
