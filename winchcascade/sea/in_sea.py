"""What a model of a rig does along a motion in waves, at a fixed or a scheduled load: powers,
efficiencies, peaks, losses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.bridge import blended_table
from winchcascade.rig.kernel import COLUMNS, LineMotion
from winchcascade.rig.ledger import LEDGER, energies
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import FASTMATH, RECTIFIED, RPM
from winchcascade.rig.state import (
    Constants,
    GasState,
    ShaftNumbers,
    ShaftState,
    constants,
    step_line,
    step_shaft,
)
from winchcascade.sea.line_motion import SeaPath

QUANTITIES = {
    "p_line_w": "W", "p_mech_w": "W", "p_gen_w": "W", "eta_pto": "1", "eta_net": "1", "force_n": "N", "rpm": "rpm",
    "i_s_a": "A", "i_dc_rms_a": "A", "torque_nm": "N.m", "vdc_v": "V", "slack": "1", "ripple_w": "W",
}  # fmt: skip
"""What a rig does in a sea, with units: mean net power of the line, of the shaft and at the DC
link; power at the DC link over that of the line while it pays out, and over its net power; largest
tension, speed of the generator, stator current (rms), DC current (rms over the sea), largest torque
and DC voltage, a mean over a pulse of the bridge; share of the time in which the line would have to
push; mean power that the pulses cost, which `with_ripple` adds to the others."""

PLACE = {name: k for k, name in enumerate(QUANTITIES)}
"""Number of each quantity in a row."""

PEAKS = {"current": "i_s_a", "speed": "rpm", "tension": "force_n", "heating": "i_dc_rms_a"}
"""Quantity that each limit concerns."""

LOST = tuple(name for name, one in LEDGER.items() if one.words.startswith("lost"))
"""Entries of the ledger that are losses, from the DC link to the line."""


NO_ROWS = np.zeros((0, len(COLUMNS)))
"""Rows of a solution that are not wanted."""


class Control(NamedTuple):
    """The load of a rig: fixed, or over the speed of the generator by straight lines between some
    speeds.

    Parameters
    ----------
    loads : (k,) [ohm], one of a fixed load
    rpm : (k,) speeds of the generator that rise, below and beyond which the load stays [rpm]
    """

    loads: tuple[float, ...]
    rpm: tuple[float, ...] = (0.0,)


def fixed(load: float) -> Control:
    """A load that stays. [ohm]"""
    return Control((load,))


def scheduled(rows: Sequence[tuple[float, float, float]], place: str) -> Control:
    """A schedule of rows of lowest and highest generator speed [rpm] and load [ohm]: each load is
    reached in the middle.

    Raises
    ------
    OptionError : the speeds do not rise, or a load is not above 0
    """
    rpm = [0.5 * (low + high) for low, high, _ in rows]
    loads = [load for _, _, load in rows]
    rises = all(one < other for one, other in pairwise(rpm))
    if not rows or not rises or not all(0.0 < load < math.inf for load in loads):
        raise OptionError(
            f"{place}: no schedule; expected bands of generator speed that rise, each with a load "
            f"above 0."
        )
    return Control(tuple(loads), tuple(rpm))


@njit(cache=True, error_model="numpy", fastmath=FASTMATH)
def load_at(omega: float, speeds: Signal, loads: Signal) -> float:
    """Load at a speed of the high-speed shaft, by straight lines between some speeds, (k,) [rad/s].
    [ohm]
    """
    last = k = len(speeds) - 1
    while k > 0 and omega < speeds[k]:
        k -= 1
    found: float = loads[k]
    if k < last and omega > speeds[k]:
        found += (loads[k + 1] - found) * (omega - speeds[k]) / (speeds[k + 1] - speeds[k])
    return found


OVERLAP = math.pi / 3.0
"""Largest angle in which a current passes from one phase to the next while two phases carry it
before and after. [rad]
"""


@njit(cache=True, error_model="numpy", fastmath=FASTMATH)
def ripple_of(omega: float, i_bridge: float, load: float, c: ShaftNumbers) -> float:
    """Power that the pulses of a bridge cost beyond those on a stiff DC link. [W]

    The sixth harmonic of the rectified back-EMF, which overlap enlarges (Kimbark 1971, chapter 8),
    drives a current through two phases into the capacitor of the DC link. The rotor gives way, so
    its inertia J acts as a second capacitor J / k^2 in series (as of a DC machine of the constant
    k). Where their resonance with the phases is at six times the electrical frequency, the current
    pulses by half of its mean and more. The model of the bridge has the pulses at constant voltage
    and speed. A current that pulses by more than its mean stops.
    """
    machine = c.generator
    if i_bridge <= 0.0 or omega <= 0.0:
        return 0.0
    k, r_phase, turn = (
        RECTIFIED * machine.k_e * RPM,
        machine.r_s + machine.r_diode,
        6.0 * machine.pole_pairs * omega,
    )
    fall = machine.pole_pairs * machine.l_s * i_bridge * math.sqrt(2.0) / (machine.k_e * RPM)
    overlap = math.acos(max(1.0 - fall, math.cos(OVERLAP)))
    fifth, seventh = math.cos(2.5 * overlap) / 5.0, math.cos(3.5 * overlap) / 7.0
    sixth = math.sqrt(fifth * fifth + seventh * seventh - 2.0 * fifth * seventh * math.cos(overlap))
    phases = 2.0 - 0.5 * overlap / OVERLAP  # two of them, one and a half in overlap
    drive, ohm, stiff = sixth * k * omega, phases * r_phase, phases * turn * machine.l_s
    conductance, susceptance = 1.0 / load, turn * c.c_dc
    square = conductance * conductance + susceptance * susceptance
    free = stiff - k * k / (turn * c.drivetrain.inertia_rotor) - susceptance / square
    pulse = min(drive / math.hypot(ohm + conductance / square, free), i_bridge)
    known = min(drive / math.hypot(ohm, stiff), i_bridge)
    costs: float = r_phase * (pulse * pulse - known * known)
    return costs


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_in_sea(
    motion: LineMotion,
    direction: Signal,
    c: Constants,
    table: Signal,
    speeds: Signal,
    loads: Signal,
    first: int,
    found: Signal,
    out: Signal,
) -> None:
    """Step a rig along a motion in waves, and sum up what it does from the first step that counts.

    Parameters
    ----------
    motion, direction : of the line, and of friction, (n,) [1]
    table : of the bridge, as `blended_table` gives it
    speeds, loads : of the control, as `load_at` takes them
    first : number of the first step that counts
    found : (12,) zeros, to which sums and largest values are added, in the order of `run`
    out : (n, 12) is filled with `kernel.COLUMNS`; (0, 12) where those are not wanted
    """
    x, v, a, dt = motion.x, motion.v, motion.a, motion.step
    fades = c.winch.stribeck != 0.0 or c.restoring.stribeck != 0.0
    state, gas, before = (
        ShaftState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        GasState(0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0),
    )
    for n in range(len(v)):
        omega, twist, v_dc = state.omega, state.twist, state.v_dc
        load = load_at(omega, speeds, loads)
        state, middle = step_shaft(
            state, (v[n], v[min(n + 1, len(v) - 1)]), dt, load, c.shaft, table
        )
        if n == 0:
            before = middle
        torque, i_s = 0.5 * (middle[0] + before[0]), 0.5 * (middle[1] + before[1])
        slow = physics.near_rest(v[n], direction[n], c.winch) if fades else 0.0
        gas, line = step_line(
            gas, (x[n], v[n], a[n]), (direction[n], slow), torque, dt if n > 0 else 0.0, c
        )
        idc = v_dc / load
        if len(out):
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = (
                torque,
                i_s,
                0.5 * (middle[2] + before[2]),
                0.5 * (middle[3] + before[3]),
            )
            out[n, 4], out[n, 5], out[n, 6], out[n, 7] = v_dc, idc, omega, twist
            out[n, 8], out[n, 9], out[n, 10], out[n, 11] = line
        i_before, before = before[3], middle
        if n < first:
            continue
        force, seen = line[1], line[2]
        pull = max(force, 0.0) if c.winch.goes_slack else force
        found[0] += pull * v[n]
        found[1] += max(pull * v[n], 0.0) if v[n] > 0.0 else 0.0
        found[2] += seen * v[n]
        found[3] += v_dc * idc
        found[4] += idc * idc
        found[5] += 1.0 if force < 0.0 else 0.0
        found[6] = max(found[6], pull)
        found[7] = max(found[7], omega)
        found[8] = max(found[8], i_s)
        found[9] = max(found[9], seen)
        found[10] = max(found[10], v_dc)
        found[11] += ripple_of(omega, 0.5 * (middle[3] + i_before), load, c.shaft)


def run(model: Model, path: SeaPath, control: Control, out: Signal = NO_ROWS) -> Signal:
    """What a model does along a motion in waves: `QUANTITIES` in a row.

    Parameters
    ----------
    out : (n, 12) is filled with `kernel.COLUMNS` where that is wanted
    """
    found, motion = np.zeros(12), path.motion
    numbers = constants(model, control.loads[0], motion.rest)
    table = blended_table(model.generator.averaged, model.generator.uncommutated)
    run_in_sea(
        motion, path.direction, numbers, table, *knots_of(model, control), path.first, found, out
    )
    line_w, paid_w, mech_w, gen_w, square, slack, costs = (
        found[[0, 1, 2, 3, 4, 5, 11]] / (motion.v.size - path.first)
    ).tolist()
    force, omega, i_s, torque, v_dc = found[6:11].tolist()
    ratios = [gen_w / over if over > 0.0 else math.nan for over in (paid_w, line_w)]
    means = [line_w, mech_w / model.r_motion, gen_w, *ratios]
    return np.array(
        [*means, force, omega * RPM, i_s, math.sqrt(square), torque, v_dc, slack, costs]
    )


def with_ripple(rows: Signal) -> Signal:
    """Rows of `QUANTITIES`, (k, quantities), with the power that the ripple of the bridge takes
    from shaft and line.
    """
    found, costs = rows.copy(), rows[:, PLACE["ripple_w"]]
    for name in ("p_line_w", "p_mech_w"):
        found[:, PLACE[name]] += costs
    for name in ("eta_pto", "eta_net"):
        gen, efficiency = rows[:, PLACE["p_gen_w"]], rows[:, PLACE[name]]
        found[:, PLACE[name]] = gen * efficiency / (gen + costs * efficiency)
    return found


def losses(model: Model, path: SeaPath, out: Signal) -> dict[str, float]:
    """Mean power by each of `LOST` of a solution along a motion in waves. [W]"""
    counted, whole = slice(path.first, None), path.motion
    t, x, v, a = (signal[counted] for signal in (whole.t, whole.x, whole.v, whole.a))
    motion = LineMotion(t, x, v, a, whole.step, whole.rest)
    booked = energies(model, motion, math.inf, out[counted])
    takes = float(motion.t[-1] - motion.t[0])
    return {name: float(booked[name][-1]) / takes for name in LOST}


def knots_of(model: Model, control: Control) -> tuple[Signal, Signal]:
    """Speeds of the high-speed shaft [rad/s] and resistances at the DC link [ohm] of a control,
    (k,) each.
    """
    return np.array(control.rpm) / RPM, np.array(
        [model.dc_link.resistance(load) for load in control.loads]
    )
