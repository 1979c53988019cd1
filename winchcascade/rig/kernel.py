"""The compiled step of the rig through time: every part and every law in one loop.

The line's motion is given, so force and pressure follow from it at once; what has a state is the fast shaft behind clutch
and shaft spring, the gas's temperature and the DC link. All are stepped by the trapezoidal rule, linearly implicitly (the
spring by its own stiffness, the DC link by the slope of the bridge's characteristic), so the error falls with the square of
the step.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from numba import njit

from winchcascade.quantity import ATMOSPHERE
from winchcascade.rig.bridge import bridge_currents
from winchcascade.rig.generator import ROLLOFF_KNOTS

if TYPE_CHECKING:
    from winchcascade.rig.model import Model
    from winchcascade.run import Signal

COLUMNS = (
    "pressure", "force", "torque", "vdc", "idc", "omega_gen", "i_s", "torque_em", "i_bridge", "twist", "screw",
)  # fmt: skip
"""What the kernel gives at every step: gauge pressure [Pa], line force [N], torque that the sensor sees [N m], DC voltage [V]
and current of the load [A], speed of the fast shaft [rad/s], stator current, rms [A], air-gap torque [N m], current of the
bridge [A], twist of the shaft spring [rad], torque of the screw at the drum [N m]."""

REST = 0.01
"""Friction turns round within this speed of the line. [m/s]"""

TURN = 0.5
"""And that of the fast shaft within this speed. [rad/s]"""

_PROBE = 0.05
"""Step by which the slope of the bridge's characteristic is found. [V]"""


class Constants(NamedTuple):
    """Numbers of the parts as the kernel takes them, SI units."""

    r_drum: float
    inertia_drum: float
    line_friction: float
    line_drag: float
    layering: float
    lead: float
    eta_forward: float
    eta_reverse: float
    area: float
    pressure: float
    volume: float
    exponent: float
    cooling: float
    seal_friction: float
    gear: float
    eta_mesh: float
    b_rotor: float
    windage: float
    friction: float
    clutch_drag: float
    k_shaft: float
    c_shaft: float
    inertia_rotor: float
    pole_pairs: float
    k_e: float
    r_s: float
    l_s: float
    v_diode: float
    rolloff_1: float
    rolloff_2: float
    rolloff_3: float
    rolloff_4: float
    c_dc: float
    load: float


def constants(model: Model, load: float) -> Constants:
    """Put a model's numbers together for one load; inf is an open circuit, which the bleed alone discharges. [ohm]"""
    winch, gas, shaft, machine, link = (
        model.winch, model.restoring, model.drivetrain, model.generator, model.dc_link,
    )  # fmt: skip
    return Constants(
        winch.r_drum, winch.inertia, winch.friction, winch.drag, winch.layering,
        gas.lead, gas.eta_forward, gas.eta_reverse, gas.area, gas.pressure, gas.volume, gas.exponent, gas.cooling,
        gas.seal_friction,
        shaft.gear, shaft.eta_mesh, shaft.b_rotor, shaft.windage, shaft.friction, shaft.clutch_drag, shaft.k_shaft,
        shaft.c_shaft, shaft.inertia_rotor,
        machine.pole_pairs, machine.k_e, machine.r_s, machine.l_s, machine.v_diode, *machine.rolloff,
        link.c_dc, link.r_bleed if math.isinf(load) else load * (1.0 + link.load_change),
    )  # fmt: skip


_K1, _K2, _K3, _K4 = ROLLOFF_KNOTS[1:]


@njit(cache=True)
def _left_of_k_e(i_s: float, c: Constants) -> float:
    """What is left of the back-EMF constant at a stator current. [1]"""
    if i_s <= _K1:
        return 1.0 + (c.rolloff_1 - 1.0) * i_s / _K1
    if i_s <= _K2:
        return c.rolloff_1 + (c.rolloff_2 - c.rolloff_1) * (i_s - _K1) / (_K2 - _K1)
    if i_s <= _K3:
        return c.rolloff_2 + (c.rolloff_3 - c.rolloff_2) * (i_s - _K2) / (_K3 - _K2)
    return c.rolloff_3 + (c.rolloff_4 - c.rolloff_3) * min(i_s - _K3, _K4 - _K3) / (_K4 - _K3)


_SETTLED = 1e-9
"""Stator current is found to this. [A]"""


@njit(cache=True)
def _weakened_currents(
    v_total: float, v_full: float, reactance: float, guess: float, c: Constants, table: Signal
) -> tuple[float, float]:
    """Currents of the bridge while the stator current weakens the back-EMF: more current, less of it, so one root alone.

    A guess from the step before would overshoot, and jump to and fro, where the roll-off is steep: Newton, kept in a bracket.
    """
    low = 0.0
    i_b, high = bridge_currents(v_total, v_full, c.r_s, reactance, table)
    if high == 0.0 or c.rolloff_4 == 1.0:
        return i_b, high
    i_s, now = high, min(max(guess, 0.0), high)
    for _ in range(60):
        i_b, i_s = bridge_currents(v_total, v_full * _left_of_k_e(now, c), c.r_s, reactance, table)
        if abs(i_s - now) < _SETTLED:
            break
        if i_s > now:
            low = now
        else:
            high = now
        _, beside = bridge_currents(v_total, v_full * _left_of_k_e(now + 1e-4, c), c.r_s, reactance, table)
        newton = now + (i_s - now) / (1.0 - (beside - i_s) / 1e-4)
        now = newton if low < newton < high else 0.5 * (low + high)
    return i_b, i_s


@njit(cache=True)
def run_rig(x: Signal, v: Signal, a: Signal, dt: float, c: Constants, table: Signal, out: Signal) -> None:
    """Step the rig along a line motion.

    Parameters
    ----------
    x, v, a : (n,) displacement, velocity and acceleration of the line at even steps, payout positive [m, m/s, m/s2]
    dt : step [s]
    table : as `bridge_table` gives it
    out : (n, 11) is filled with `COLUMNS`
    """
    omega = omega_before = twist = v_dc = i_s = heat = log_volume = 0.0
    torque_mid = em_mid = i_mid = is_mid = 0.0
    rpm = 30.0 / math.pi
    share = c.eta_mesh / c.gear
    for n in range(v.size):
        omega_drum = v[n] / c.r_drum
        direction = math.tanh(v[n] / REST)
        # gas: isothermal, and hotter by what its compression has not yet given away
        volume = c.volume - c.area * c.lead * x[n] / c.r_drum
        gauge = c.pressure * (c.volume / volume) - ATMOSPHERE
        if c.exponent != 1.0:
            squeezed = math.log(c.volume / volume)
            if n > 0:
                fade = 0.5 * dt / c.cooling
                heat = (heat * (1.0 - fade) + (c.exponent - 1.0) * (squeezed - log_volume)) / (1.0 + fade)
            log_volume = squeezed
            gauge = (gauge + ATMOSPHERE) * math.exp(heat) - ATMOSPHERE
        thrust = gauge * c.area + c.seal_friction * direction
        screw = c.lead * thrust * (0.5 * (1.0 + direction) / c.eta_forward + 0.5 * (1.0 - direction) * c.eta_reverse)
        # DC link, from here to the next step: the bridge at the speed half-way, its current by its slope half-way too
        half_way = max(omega + 0.5 * (omega - omega_before), 0.0)
        v_full = c.k_e * half_way * rpm
        reactance = max(c.pole_pairs * half_way * c.l_s, 1e-6)
        v_total = v_dc + 2.0 * c.v_diode
        i_b, i_s = _weakened_currents(v_total, v_full, reactance, i_s, c, table)
        i_probe = 0.0
        if i_b > 0.0:
            i_probe, _ = _weakened_currents(v_total + _PROBE, v_full, reactance, i_s, c, table)
        leak = 1.0 / c.load - (i_probe - i_b) / _PROBE
        change = dt / c.c_dc * (i_b - v_dc / c.load) / (1.0 + 0.5 * dt / c.c_dc * leak)
        change = max(change, -v_dc)
        v_half = v_dc + 0.5 * change
        i_b = max(c.c_dc * change / dt + v_half / c.load, 0.0)
        p_em = (v_half + 2.0 * c.v_diode) * i_b + 3.0 * c.r_s * i_s * i_s
        torque_em = p_em / half_way if half_way > 1.0 else 0.0
        # fast shaft, from here to the next step, by the trapezoidal rule
        drum_half = omega_drum if n + 1 == v.size else 0.5 * (v[n] + v[n + 1]) / c.r_drum
        losses = 0.5 * (c.b_rotor + c.windage * abs(half_way))
        mass = c.inertia_rotor / dt
        driven = (mass - losses) * omega - torque_em
        if c.friction != 0.0:
            driven -= c.friction * math.tanh(half_way / TURN)
        stiff = 0.5 * dt * c.k_shaft + c.c_shaft
        after = (driven + share * (c.k_shaft * twist + stiff * (drum_half - 0.5 * omega / c.gear))) / (
            mass + losses + 0.5 * share * stiff / c.gear
        )
        slip = drum_half - 0.5 * (omega + after) / c.gear
        torque = c.k_shaft * twist + stiff * slip
        if torque > 0.0:
            twist += dt * slip
        else:
            torque, twist = 0.0, 0.0
            after = driven / (mass + losses)
        after = max(after, 0.0)
        # what is seen at this step: the line here, torque and currents as the mean of the half steps on either side
        first = 1.0 if n == 0 else 0.5
        drag = -c.clutch_drag * 0.5 * (1.0 - direction) * abs(direction)
        seen = torque if n == 0 else 0.5 * (torque_mid + torque)
        lost = c.line_friction * direction + c.line_drag * omega_drum
        force = (screw + seen + drag + lost + c.inertia_drum * a[n] / c.r_drum) / (c.r_drum * (1.0 + c.layering * x[n]))
        out[n, 0], out[n, 1], out[n, 2] = gauge, force, seen + drag
        out[n, 3], out[n, 4], out[n, 5] = v_dc, v_dc / c.load, omega
        out[n, 6] = first * i_s + (1.0 - first) * is_mid
        out[n, 7] = first * torque_em + (1.0 - first) * em_mid
        out[n, 8] = first * i_b + (1.0 - first) * i_mid
        out[n, 9], out[n, 10] = twist, screw
        torque_mid, em_mid, i_mid, is_mid = torque, torque_em, i_b, i_s
        omega_before, omega, v_dc = omega, after, v_dc + change
