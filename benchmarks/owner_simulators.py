"""Simulations without noise: what the twin itself reads of a motion, and the simulators that the
owner of a rig may have.

`same` is the twin with the nominal numbers. `averaged` is quasi-static: it replaces the switched
bridge by the formula of its mean voltage, with the drop of commutation or without, and the speed of
the rotor by that of the drum.
"""

from __future__ import annotations

import math

import numpy as np

from winchcascade.blind.twin import FIXED, NOMINAL, Solved, Twin, solve_twin
from winchcascade.blind.twin_log import noiseless, stamps_of
from winchcascade.blind.twin_numbers import LOADS, Numbers
from winchcascade.core.run import Signal

DECIMALS = 6
"""Digits of a simulated log after the point."""

SIMULATORS = {"same": math.nan, "averaged": 3.0 / math.pi, "averaged without commutation": 0.0}
"""Simulators of the owner, each with its drop of the mean voltage by commutation over electrical
speed, inductance and current. [1]"""


def noise_free(twin: Twin, solved: Solved) -> dict[str, Signal]:
    """One log without zeros, noise and steps, by channel in the units of the log."""
    stamps = stamps_of(solved)
    grid = np.concatenate([[0.0], solved.t + solved.t[0]])
    motion = {
        "displacement": np.interp(stamps, grid, solved.x),
        "velocity": np.interp(stamps, grid, solved.v),
    }
    columns = {"time": stamps, **motion, **noiseless(twin, solved, stamps)}
    return {name: np.round(value, DECIMALS) for name, value in columns.items()}


def simulated_log(simulator: str, log: str, x: Signal, v: Signal) -> dict[str, Signal]:
    """The owner's own simulation of one log, by channel in the units of the log.

    Parameters
    ----------
    simulator : a name of `SIMULATORS`
    x, v : motion on the grid of the twin [m, m/s]
    """
    solved = solve_twin(NOMINAL, log, x, v, 0.0)
    return noise_free(
        NOMINAL,
        solved if simulator == "same" else _averaged(solved, LOADS[log], SIMULATORS[simulator]),
    )


def _averaged(solved: Solved, load: float, commutation: float) -> Solved:
    """Replace torque, Vdc, Idc and line tension of a solved log by those of a quasi-static
    generator with a mean-value bridge.

    The mean voltage of a diode bridge is 3 sqrt(2) / pi of the line-to-line voltage, less two
    diodes, two phase resistances and the drop of commutation (Mohan, Undeland, Robbins, Power
    Electronics, Sec. 5-6).
    """
    n = Numbers()
    speed = np.maximum(0.5 * (solved.v[1:] + solved.v[:-1]) / FIXED.r_drum, 0.0) * FIXED.gear
    emf = 3.0 * math.sqrt(2.0) / math.pi * n.k_e * speed * 30.0 / math.pi
    overlap = commutation * FIXED.pole_pairs * speed * n.l_s  # lowers the voltage without a loss
    i_dc = np.maximum(emf - 2.0 * FIXED.v_diode, 0.0) / (2.0 * n.r_s + overlap + load)
    brake = np.divide(
        (emf - overlap * i_dc) * i_dc, speed, out=np.zeros_like(speed), where=speed > 1.0
    )
    driving = brake + n.b_rotor * speed + FIXED.j_rotor * np.gradient(speed, solved.t)
    torque = np.maximum(driving, 0.0) * FIXED.gear / n.eta_mesh
    force = solved.channels["force"] + (torque - solved.channels["torque"]) / FIXED.r_drum
    channels = solved.channels | {"torque": torque, "vdc": i_dc * load, "idc": i_dc, "force": force}
    return Solved(solved.t, solved.x, solved.v, channels, {})
