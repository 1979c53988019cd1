"""The compiled loops of the rig through time: every part and every law along a given motion of the
line.

Each step is that of `state.py`. The motion of the line is given, so force and pressure follow from
it at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.bridge import blended_table, dc_voltages
from winchcascade.rig.physics import FASTMATH
from winchcascade.rig.state import (
    Constants,
    GasState,
    ShaftNumbers,
    ShaftState,
    step_line,
    step_shaft,
)

SHAFT = ("clutch", "i_s", "torque_em", "i_bridge", "vdc", "idc", "omega_gen", "twist")
"""Output of `run_shaft` at every step: torque of the clutch [N m], stator current, rms [A], air-gap
torque [N m], current of the bridge [A], DC voltage [V], current of the load [A], speed of the fast
shaft [rad/s], twist of the shaft spring [rad]."""

LINE = ("pressure", "force", "torque", "screw")
"""Output of `run_line` at every step: gauge pressure [Pa], line tension [N], torque that the sensor
sees [N m], torque of the screw at the drum [N m]."""

COLUMNS = (*SHAFT, *LINE)
"""Columns of a solution."""


class LineMotion(NamedTuple):
    """A line motion at even steps: times, displacement, velocity and acceleration, (n,) each,
    payout positive, the step, and `rest`, the speed within which friction changes its sign. SI
    units.
    """

    t: Signal
    x: Signal
    v: Signal
    a: Signal
    step: float
    rest: float


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_shaft(
    v: Signal, dt: float, c: ShaftNumbers, table: Signal, every: int, out: Signal
) -> None:
    """Step the generator's side along a line motion: clutch, shaft, gear, machine, bridge and DC
    link.

    Parameters
    ----------
    v, dt : velocity of the line at even steps, (n,), payout positive [m/s], and the step [s]
    table : of the bridge, as `blended_table` gives it
    every : number of steps from one that is kept to the next
    out : (m, 8) is filled with `SHAFT` at the steps that are kept; torque and currents are the mean
        of the half steps on either side
    """
    state, middle_before = ShaftState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    for n in range(len(v)):
        omega, twist, v_dc = state.omega, state.twist, state.v_dc
        state, middle = step_shaft(state, (v[n], v[min(n + 1, len(v) - 1)]), dt, c.load, c, table)
        if n == 0:
            middle_before = middle
        if n % every == 0:
            row = n // every
            for k in range(4):
                out[row, k] = 0.5 * (middle[k] + middle_before[k])
            out[row, 4], out[row, 5], out[row, 6], out[row, 7] = v_dc, v_dc / c.load, omega, twist
        middle_before = middle


def steady_shaft(v: Signal, a: Signal, c: ShaftNumbers, table: Signal, inertia: float) -> Signal:
    """Compute the generator's side in the steady state of each instant, (m, 8): a stiff shaft, no
    capacitor.

    Parameters
    ----------
    v, a : (m,) velocity and acceleration of the line [m/s, m/s2]
    inertia : of the rotor [kg m2]
    """
    shaft, machine, per = c.drivetrain, c.generator, c.drivetrain.gear / c.r_motion
    omega = np.maximum(v * per, 0.0)
    v_total, i_s = dc_voltages(machine, omega, np.zeros(v.size), table, 1.0 / c.load)
    v_dc = np.maximum(v_total - 2.0 * machine.v_diode, 0.0)
    idc = v_dc / c.load
    turns = omega > 2.0 * c.turn
    em = np.where(
        turns, physics.air_gap_power(v_dc, idc, i_s, machine) / np.where(turns, omega, 1.0), 0.0
    )
    drag, _ = physics.total(
        physics.shaft_losses(omega, physics.direction(omega, c.turn), c.turn, shaft)
    )
    torque = (
        shaft.gear / shaft.eta_mesh * (em + drag + inertia * np.where(omega > 0.0, a * per, 0.0))
    )
    return np.column_stack(
        [np.maximum(torque, 0.0), i_s, em, idc, v_dc, idc, omega, np.zeros(v.size)]
    )


def solve_shaft(v: Signal, dt: float, numbers: Constants, every: int = 1) -> Signal:
    """Solve the generator's side along a line motion, (m, 8): the columns of `SHAFT`.

    Parameters
    ----------
    v, dt : as `run_shaft` takes them
    every : number of steps from one that is kept to the next
    """
    c, shaft, machine = numbers.shaft, numbers.shaft.drivetrain, numbers.shaft.generator
    table, out = (
        blended_table(machine.averaged, machine.uncommutated),
        np.empty((-(-v.size // every), len(SHAFT))),
    )
    run_shaft(v, dt, c, table, every, out)
    if shaft.quasi_static == shaft.weightless == 0.0:
        return out
    motion = v[::every], np.gradient(v, dt)[::every]
    dynamic = 1.0 - shaft.quasi_static - shaft.weightless
    steady = shaft.quasi_static * steady_shaft(*motion, c, table, shaft.inertia_rotor)
    return dynamic * out + steady + shaft.weightless * steady_shaft(*motion, c, table, 0.0)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_line(
    motion: LineMotion, direction: Signal, c: Constants, torque: Signal, out: Signal
) -> None:
    """Compute the line tension and its parts: gas and screw, spring or counterweight, losses and
    inertia at the drum, clutch.

    Parameters
    ----------
    motion : of the line; only the heat of the gas depends on earlier steps
    direction : (n,) as `physics.direction` gives it, once for all models [1]
    torque : (n,) of the clutch, below zero where it drags while the rotor overruns the drum [N m]
    out : (n, 4) is filled with `LINE`
    """
    x, v, a = motion.x, motion.v, motion.a
    winch = c.winch
    fades = winch.stribeck != 0.0 or c.restoring.stribeck != 0.0
    state = GasState(0.0, 0.0)
    for n in range(len(v)):
        sign, dt = direction[n], motion.step if n > 0 else 0.0
        slow = physics.near_rest(v[n], sign, winch) if fades else 0.0
        state, found = step_line(state, (x[n], v[n], a[n]), (sign, slow), torque[n], dt, c)
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = found
