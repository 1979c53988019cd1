"""The twin's drive in time: clutch, shaft, gear, rotor, bridge and DC link along a given speed of the drum."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import njit

from winchcascade.blind.circuit import PEAK, BridgeSource, bridge_step
from winchcascade.blind.twin_numbers import BELL, KNEE, LINE

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

GRID = 1e-3
"""Interval over which what the drive does is averaged. [s]"""

FINE = 20
"""Steps of an interval while a diode may conduct: 50 us; half of it changes no channel by more than 0.05 %."""

COARSE = 4
"""Steps of an interval while none can."""

_QUIET = 0.97
"""Below this share of the voltage that a diode would need, none is looked for. [1]"""

_EMPTY = 1e-9
"""A DC link below this is empty. [V]"""

_FADE = 5e-3
"""Time over which the stator current is averaged that weakens the magnets. [s]"""

_TURN = 1.0
"""Friction of the fast shaft turns round within this speed. [rad/s]"""


class Drive(NamedTuple):
    """Numbers of the drive, SI units; what an effect or an outsider adds is absent at its default.

    Parameters
    ----------
    gear, eta_mesh, k_shaft, c_shaft, j_rotor : of the slow shaft and the gear [1, 1, N m/rad, N m s/rad, kg m2]
    b_rotor, windage, friction : drag on the fast shaft [N m s/rad, N m s2/rad2, N m]
    pole_pairs, k_e, r_s, l_s : of the generator, k_e line to line, rms [1, V/rpm, ohm, H]
    v_diode, c_dc, load : of bridge and DC link [V, F, ohm]
    law, knee, width, power : of the roll-off [one of `KNEE`, `LINE`, `BELL`; A, A or 1/A, 1]
    warming, cooling : rise of the load with the heat in it [1/J], and how fast that leaves [s]
    leak, leak_volt, leak_power : current across the DC link before the sensor, leak (v / leak_volt)^leak_power [A, V, 1]
    """

    gear: float
    eta_mesh: float
    k_shaft: float
    c_shaft: float
    j_rotor: float
    b_rotor: float
    pole_pairs: float
    k_e: float
    r_s: float
    l_s: float
    v_diode: float
    c_dc: float
    load: float
    windage: float = 0.0
    friction: float = 0.0
    law: float = KNEE
    knee: float = 1e3
    width: float = 1.0
    power: float = 1.0
    warming: float = 0.0
    cooling: float = 1e9
    leak: float = 0.0
    leak_volt: float = 300.0
    leak_power: float = 1.0


COLUMNS = ("torque", "vdc", "idc", "omega")
"""What the drive gives, as means over each interval: torque at the sensor [N m], Vdc [V], Idc [A], rotor's speed [rad/s]."""

LEDGER = (
    "shaft", "mesh", "damper", "rotor_drag", "copper", "diodes", "leak", "load", "spring", "rotor", "field", "link",
)  # fmt: skip
"""Where energy went until the end: in at the shaft, then lost, delivered and stored; all but the first add up to it. [J]"""


@njit(cache=True)
def weakened(i_s: float, law: float, knee: float, width: float, power: float) -> float:
    """Share of the back-EMF that a stator current leaves, rms. [1]"""
    if law == BELL:
        return float(math.exp(-((i_s / width) ** power)))
    past = i_s - knee
    if past <= 0.0:
        return 1.0
    if law == LINE:
        return max(1.0 - width * past, 0.3)
    return float(1.0 / (1.0 + (past / width) ** power))


@njit(cache=True)
def _clutch(twist: float, slip: float, d: Drive) -> tuple[float, float]:
    """Torque of the slow shaft [N m], and twisting of its spring [rad/s]; it lets go where both would pull."""
    torque = d.k_shaft * twist + d.c_shaft * slip
    if torque > 0.0:
        return torque, slip
    return 0.0, -d.k_shaft * twist / d.c_shaft


@njit(cache=True)
def _link(v_dc: float, charge: float, load: float, dt: float, d: Drive) -> tuple[float, float]:
    """Voltage of the DC link after a step that brings it a charge [V], and the current that leaks past the load [A]."""
    leaking = d.leak * (v_dc / d.leak_volt) ** d.leak_power if d.leak > 0.0 and v_dc > 0.0 else 0.0
    fade = 0.5 * dt / (load * d.c_dc)
    then = max((v_dc * (1.0 - fade) + (charge - leaking * dt) / d.c_dc) / (1.0 + fade), 0.0)
    return (then if then > _EMPTY else 0.0), leaking


@njit(cache=True)
def _store(ledger: Signal, twist: float, omega: float, i: Signal, v_dc: float, d: Drive) -> None:
    """Book the energy that spring, rotor, field and DC link hold in the end."""
    ledger[8] = 0.5 * d.k_shaft * twist**2
    ledger[9] = 0.5 * d.j_rotor * omega**2
    ledger[10] = 0.5 * d.l_s * (i[0] ** 2 + i[1] ** 2 + i[2] ** 2)
    ledger[11] = 0.5 * d.c_dc * v_dc**2


@njit(cache=True)
def run_drive(omega_drum: Signal, mesh: Signal, d: Drive, fine: int, out: Signal, ledger: Signal) -> None:
    """Step the drive from rest.

    Parameters
    ----------
    omega_drum : (n + 1,) speed of the drum at the ends of the intervals, payout positive [rad/s]
    mesh : (n,) factor on the torque that the gear needs, 1 where it meshes evenly
    fine : steps of an interval while a diode may conduct
    out : (n, 4) is filled with `COLUMNS`, ledger : (12,) with `LEDGER`
    """
    i, on, work = np.zeros(3), np.zeros(3, dtype=np.int64), np.zeros((4, 3))
    twist = omega = v_dc = angle = heat = mean_square = 0.0
    rpm = 30.0 / math.pi
    share = d.eta_mesh / d.gear
    for n in range(out.shape[0]):
        first, last = omega_drum[n], omega_drum[n + 1]
        torque_sum = volt_sum = ampere_sum = speed_sum = 0.0
        reach = d.k_e * omega * rpm * math.sqrt(2.0)
        awake = on[0] != 0 or on[1] != 0 or on[2] != 0 or reach > _QUIET * (v_dc + 2.0 * d.v_diode)
        steps = fine if awake else COARSE
        dt = GRID / steps
        for m in range(steps):
            drum = first + (last - first) * (m + 0.5) / steps
            torque, rate = _clutch(twist, drum - omega / d.gear, d)
            twist_then = twist + dt * rate
            # generator and bridge
            turn = d.pole_pairs * omega
            charge = energy = square = 0.0
            if awake and omega > 0.0:
                left = weakened(math.sqrt(mean_square), d.law, d.knee, d.width, d.power)
                amplitude = PEAK * d.k_e * left * omega * rpm
                source = BridgeSource(angle, turn, amplitude, v_dc + 2.0 * d.v_diode, d.r_s, d.l_s)
                charge, energy, square = bridge_step(i, on, source, dt, work)
            mean_square += (square / 3.0 - dt * mean_square) / _FADE
            angle = (angle + turn * dt) % (2.0 * math.pi)
            brake = energy / (omega * dt) if omega > 1e-6 else 0.0
            # fast shaft
            drag = omega * (d.b_rotor + d.windage * abs(omega)) + d.friction * omega / math.sqrt(omega**2 + _TURN**2)
            driving = torque * share / mesh[n]
            then = max(omega + dt * (driving - brake - drag) / d.j_rotor, 0.0)
            load = d.load * (1.0 + d.warming * heat)
            v_then, leaking = _link(v_dc, charge, load, dt, d)
            middle = 0.5 * (v_dc + v_then)
            heat += dt * (middle * middle / load - heat / d.cooling)
            ledger[0] += dt * torque * drum
            ledger[1] += dt * (torque * omega / d.gear - driving * omega)
            ledger[2] += dt * d.c_shaft * rate * rate
            ledger[3] += dt * drag * 0.5 * (omega + then)
            ledger[4] += d.r_s * square
            ledger[5] += 2.0 * d.v_diode * charge
            ledger[6] += dt * leaking * middle
            ledger[7] += dt * middle * middle / load
            torque_sum += torque
            volt_sum += middle
            ampere_sum += middle / load
            speed_sum += omega
            twist, omega, v_dc = twist_then, then, v_then
        out[n, 0], out[n, 1] = torque_sum / steps, volt_sum / steps
        out[n, 2], out[n, 3] = ampere_sum / steps, speed_sum / steps
    _store(ledger, twist, omega, i, v_dc, d)
