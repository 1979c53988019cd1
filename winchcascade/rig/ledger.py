"""The ledger of a simulation: where the energy of the line goes, stored, lost in each part, or
delivered.
"""

from typing import NamedTuple

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.kernel import COLUMNS, LineMotion
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import ELECTRICAL_LOSSES, SHAFT_LOSSES
from winchcascade.rig.state import constants


class Booked(NamedTuple):
    """An entry of the ledger in words, the group of entries that is shown of it, and what that is.

    `before` the torque sensor, seen from the line, or behind it.
    """

    words: str
    group: str
    about: str = ""
    before: bool = False


_STILL_TURNING = "rotor and drum still turning"
_SPRING = "its spring and damping"

LEDGER = {
    "line": Booked("delivered by the line", "line"),
    "dc": Booked("delivered by the DC link", "DC link", "delivered"),
    **{
        name: Booked(f"lost to {about}", name, about)
        for name, about in (ELECTRICAL_LOSSES | SHAFT_LOSSES).items()
    },
    "mesh": Booked("lost in the gear mesh", "mesh", "gear teeth"),
    "clutch": Booked("lost in the clutch", "clutch", "its drag while open"),
    "shaft": Booked("stored in the torsion of the shaft", "shaft", _SPRING),
    "shaft_loss": Booked("lost in the shaft", "shaft", _SPRING),
    "capacitor": Booked(
        "stored in the capacitor of the DC link", "capacitor", "charge of the DC link"
    ),
    "rotor": Booked("stored in the rotor", "inertia", _STILL_TURNING),
    "drum": Booked("stored in the drum", "inertia", _STILL_TURNING, True),
    "line_loss": Booked(
        "lost between line and torque sensor", "line losses", "between line and torque sensor", True
    ),
    "seal": Booked("lost to friction of the seals", "seal", "friction of the piston", True),
    "screw": Booked("lost to friction of the screw", "screw", "friction of the ball screw", True),
    "gas": Booked(
        "stored in the gas", "stored gas", "held by the accumulator when the window ends", True
    ),
    "pull": Booked(
        "stored in spring or counterweight",
        "stored pull",
        "held by them when the window ends",
        True,
    ),
}
"""Energy of the line and where it goes, from the DC link back to the line: delivered, stored, or
lost.
"""


def energies(model: Model, motion: LineMotion, load: float, out: Signal) -> dict[str, Signal]:
    """Book the energy of a solution from its beginning to each step by the entries of `LEDGER`,
    (n,) each [J].

    The energy of the line is that of the true line speed, which layers of rope change; the other
    entries add up to it. While a rope is slack, it is that of what turns the drum.
    """
    c, got = constants(model, load, motion.rest), dict(zip(COLUMNS, out.T, strict=True))
    omega_drum, omega, shaft = motion.v / c.r_motion, got["omega_gen"], model.drivetrain
    watts = rates(model, motion, load, out)
    stores = {
        "drum": (model.winch.inertia, omega_drum),
        "shaft": (shaft.k_shaft, got["twist"]),
        "rotor": (shaft.inertia_rotor, omega),
        "capacitor": (c.shaft.c_dc, got["vdc"]),
    }
    booked = {name: integral(watt, motion.step) for name, watt in watts.items()}
    booked |= {
        name: 0.5 * number * (state**2 - state[0] ** 2) for name, (number, state) in stores.items()
    }
    booked["shaft_loss"] -= booked["shaft"]
    return {name: booked[name] for name in LEDGER}


def rates(model: Model, motion: LineMotion, load: float, out: Signal) -> dict[str, Signal]:
    """Powers by the entries of `LEDGER` that are no stores, (n,) each [W]; `shaft_loss` includes
    what the spring stores.
    """
    c, got, shaft = (
        constants(model, load, motion.rest),
        dict(zip(COLUMNS, out.T, strict=True)),
        model.drivetrain,
    )
    omega_drum, omega, sign = (
        motion.v / c.r_motion,
        got["omega_gen"],
        physics.direction(motion.v, motion.rest),
    )
    slow = physics.near_rest(motion.v, sign, model.winch)
    line = got["force"] * omega_drum * physics.rope_radius(motion.x, model.winch)
    driven, overrun = np.maximum(got["clutch"], 0.0), np.minimum(got["clutch"], 0.0)
    push = physics.piston_torque(got["pressure"], model.restoring)
    seal = physics.seal_torque(sign, slow, model.restoring)
    fast = physics.shaft_losses(omega, physics.direction(omega, c.shaft.turn), c.shaft.turn, shaft)
    electrical = physics.electrical_losses(got["i_bridge"], got["i_s"], model.generator)
    return {
        "line": line,
        "gas": push * omega_drum,
        "pull": physics.pull_torque(
            motion.x / c.r_motion, motion.a / c.r_motion, model.winch.r_drum, model.restoring
        )
        * omega_drum,
        "screw": (got["screw"] - push - seal) * omega_drum,
        "seal": seal * omega_drum,
        "line_loss": physics.line_losses(omega_drum, sign, slow, model.winch) * omega_drum
        + physics.pull_friction(sign, model.winch.r_drum, model.restoring) * omega_drum
        + line * (1.0 - 1.0 / physics.line_over_drum(sign, model.winch)),
        "clutch": (got["torque"] - driven) * omega_drum - overrun * omega / shaft.gear,
        "mesh": driven * omega / shaft.gear * (1.0 - shaft.eta_mesh),
        **{name: torque * omega for name, (torque, _) in zip(SHAFT_LOSSES, fast, strict=True)},
        **dict(zip(ELECTRICAL_LOSSES, electrical, strict=True)),
        "dc": got["vdc"] ** 2 / c.shaft.load,
        "shaft_loss": driven * (omega_drum - omega / shaft.gear),
    }


def integral(y: Signal, step: float) -> Signal:
    """Integrate a signal at even steps from the beginning to each step, by the trapezoidal rule."""
    return np.concatenate(([0.0], np.cumsum(0.5 * step * (y[1:] + y[:-1]))))
