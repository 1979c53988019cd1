"""Where the line's energy goes: stored, lost in each part, or delivered."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.rig.kernel import COLUMNS, REST, TURN

if TYPE_CHECKING:
    from winchcascade.rig.model import Model
    from winchcascade.rig.motion import Motion
    from winchcascade.run import Signal

STORED = ("gas", "drum", "shaft", "rotor", "capacitor")
LOST = (
    "screw",
    "seal",
    "line_loss",
    "clutch",
    "shaft_loss",
    "mesh",
    "damper",
    "windage",
    "friction",
    "copper",
    "diodes",
)
LEDGER = ("line", *STORED, *LOST, "dc")
"""The line's energy; what is stored in gas, drum, shaft spring, rotor and capacitor; what is lost in screw, seals, between
line and torque sensor, clutch, shaft, gear mesh, on the fast shaft, in copper and diodes; what the DC link delivers."""


def energies(model: Model, motion: Motion, load: float, out: Signal) -> dict[str, Signal]:
    """Book the energy of a solution from its beginning to each step, (n,) each [J].

    The line's energy is that of the true line speed, which layers of rope change; the other entries add up to it.
    """
    winch, gas, shaft, machine, link = (
        model.winch, model.restoring, model.drivetrain, model.generator, model.dc_link,
    )  # fmt: skip
    got = dict(zip(COLUMNS, out.T, strict=True))
    omega_drum, omega = motion.v / winch.r_drum, got["omega_gen"]
    direction = np.tanh(motion.v / REST)
    drag = -shaft.clutch_drag * 0.5 * (1.0 - direction) * np.abs(direction)
    torque = got["torque"] - drag
    resistance = link.r_bleed if math.isinf(load) else load * (1.0 + link.load_change)
    push = gas.lead * omega_drum * got["pressure"] * gas.area
    seal = gas.lead * omega_drum * gas.seal_friction * direction
    lost = winch.friction * direction + winch.drag * omega_drum
    copper, diodes = 3.0 * machine.r_s * got["i_s"] ** 2, 2.0 * machine.v_diode * got["i_bridge"]
    watts = {
        "line": got["force"] * omega_drum * winch.r_drum * (1.0 + winch.layering * motion.x),
        "gas": push,
        "screw": got["screw"] * omega_drum - push - seal,
        "seal": seal,
        "line_loss": lost * omega_drum,
        "clutch": drag * omega_drum,
        "mesh": torque * omega / shaft.gear * (1.0 - shaft.eta_mesh),
        "damper": shaft.b_rotor * omega**2,
        "windage": shaft.windage * np.abs(omega) ** 3,
        "friction": shaft.friction * np.tanh(omega / TURN) * omega,
        "copper": copper,
        "diodes": diodes,
        "dc": got["vdc"] ** 2 / resistance,
    }
    booked = {name: _running(watt, motion.step) for name, watt in watts.items()}
    spring = 0.5 * shaft.k_shaft * got["twist"] ** 2
    through = _running(torque * (omega_drum - omega / shaft.gear), motion.step)
    booked["shaft"] = spring - spring[0]
    booked["shaft_loss"] = through - booked["shaft"]
    for name, half, state in (
        ("drum", 0.5 * winch.inertia, omega_drum), ("rotor", 0.5 * shaft.inertia_rotor, omega),
        ("capacitor", 0.5 * link.c_dc, got["vdc"]),
    ):  # fmt: skip
        booked[name] = half * (state**2 - state[0] ** 2)
    return {name: booked[name] for name in LEDGER}


def _running(watt: Signal, step: float) -> Signal:
    """Integrate a power from the beginning to each step. [J]"""
    joule: Signal = np.concatenate(([0.0], np.cumsum(0.5 * step * (watt[1:] + watt[:-1]))))
    return joule
