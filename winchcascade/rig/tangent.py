"""Derivatives of a solution of the shaft over its numbers, computed step by step beside the solution.

One pass costs about as much as two solutions, for any number of derivatives; differences of solutions would cost one each.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numba import njit

from winchcascade.core.run import Signal
from winchcascade.rig.bridge import FASTMATH, bridge_slopes
from winchcascade.rig.kernel import (
    MAX_RETURNED,
    SATURATED,
    TURN,
    Constants,
    DrivenShaft,
    driven_shaft,
    rolloff_at,
    weakened_bridge,
)
from winchcascade.rig.parts import ROLLOFF_KNOTS

NUMBERS = (
    "r_motion", "gear", "eta_mesh", "b_rotor", "windage", "friction", "k_shaft", "c_shaft", "inertia_rotor", "k_e", "r_s",
    "inductance", "v_diode", "c_dc", "load",
)  # fmt: skip
"""Fields of `Constants` whose derivatives are computed: nine mechanical ones first; directions of the roll-off follow them."""

_R_MOTION, _GEAR, _, _, _, _, _K, _C, _, _K_E, _R_S, _INDUCTANCE, _V_DIODE, _C_DC, _LOAD = range(len(NUMBERS))
_FIRST_WAY = len(NUMBERS)

WIDE = 24
"""Number of derivatives that are computed at once, a constant, so that the compiler takes four or eight at a time."""

MAX_WAYS = WIDE - len(NUMBERS)
"""Maximum number of directions of the roll-off among them."""

FADED_SLOPE = 1e-200
"""A derivative of the DC voltage that has decayed to less is zero, as the voltage is below `kernel.FADED`. [V over the unit of
the number]"""

_ROWS = 13
_D_OMEGA, _D_TWIST, _D_V, _D_LAST, _D_MEAN, _D_SEEN = (WIDE * row for row in range(6))
"""Offsets of the derivatives of the state in the working array: speed of the fast shaft, twist, DC voltage, torque of the
clutch in the previous step and its mean of two steps, DC voltage at the beginning of the step."""

_S, _B, _V, _EM, _AFTER, _SLIP, _TORQUE = (WIDE * row for row in range(6, _ROWS))
"""Offsets of the partial derivatives at a fixed state: stator and bridge current, DC voltage half-way, air-gap torque, torque
on the fast shaft, slip of the shaft spring, its torque."""

Direction = tuple[float, ...]
"""Change of the roll-off at every knot and of its slopes there, in a row."""

_SAME: Direction = (0.0,) * (2 * len(ROLLOFF_KNOTS))


class Tangent(msgspec.Struct, frozen=True):
    """Derivatives of a solution of the shaft, at some of its steps.

    `slopes` (2, k, n) are those of the torque of the clutch [N m] and of the DC voltage [V] over each of `NUMBERS` and then
    along each of `directions` of the roll-off; `numbers` are those of the solution itself.
    """

    numbers: Constants
    directions: tuple[Direction, ...]
    slopes: Signal

    def moves(self, numbers: Constants) -> Signal:
        """Differences of other numbers from its own and the share of each direction, (k,): what `slopes` are multiplied by."""
        moves = np.zeros(self.slopes.shape[1])
        moves[:_FIRST_WAY] = [getattr(numbers, name) - getattr(self.numbers, name) for name in NUMBERS]
        way = direction(self.numbers, numbers)
        if any(way):
            moves[_FIRST_WAY + self.directions.index(way)] = 1.0
        return moves


def direction(here: Constants, there: Constants) -> Direction:
    """Change of the roll-off from one set of numbers to another."""
    if (here.rolloff, here.rolloff_slope) == (there.rolloff, there.rolloff_slope):
        return _SAME
    return tuple(
        b - a for a, b in zip((*here.rolloff, *here.rolloff_slope), (*there.rolloff, *there.rolloff_slope), strict=True)
    )


def tangent_of(
    v: Signal, dt: float, numbers: Constants, state: Signal, every: int, ways: Sequence[Direction]
) -> Tangent:
    """Differentiate a solution of `run_shaft`.

    Parameters
    ----------
    v, dt, numbers : as the solution was computed with
    state : (n, 3) as `kernel.solve_shaft` fills it
    every : number of steps from one at which derivatives are kept to the next
    ways : directions of the roll-off

    Raises
    ------
    ValueError : more directions than are computed at once
    """
    if len(ways) > MAX_WAYS:
        raise ValueError(f"{len(ways)} directions of the roll-off; at most {MAX_WAYS} are computed at once.")
    bent = np.array(ways, dtype=np.float64).reshape(-1, 2, len(ROLLOFF_KNOTS))
    kept = np.zeros((2, len(NUMBERS) + bent.shape[0], -(-v.size // every)))
    run_tangent(driven_shaft(v, dt, numbers), state, every, bent, kept)
    return Tangent(numbers, tuple(ways), kept)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH)
def run_tangent(driven: DrivenShaft, state: Signal, every: int, bent: Signal, kept: Signal) -> None:
    """Compute derivatives along a solution, step by step as `run_shaft` made it.

    Parameters
    ----------
    state : (n, 3) as `kernel.solve_shaft` fills it
    bent : (j, 2, knots) directions of the roll-off: change of the share at the knots, and of its slopes
    kept : (2, k, m) is filled with derivatives of the torque of the clutch and of the DC voltage
    """
    v, dt, c, table = driven.v, driven.dt, driven.numbers, driven.table
    size = kept.shape[1]
    rpm = 30.0 / math.pi
    share = c.eta_mesh / c.gear
    stiff = 0.5 * dt * c.k_shaft + c.c_shaft
    mass = c.inertia_rotor / dt
    w = np.zeros(_ROWS * WIDE)
    guess = 0.0
    for n in range(v.size - 1):
        omega, twist, v_dc = state[n, 0], state[n, 1], state[n, 2]
        omega_after, v_after = state[n + 1, 0], state[n + 1, 2]
        half_way, v_half, change = 0.5 * (omega + omega_after), 0.5 * (v_dc + v_after), v_after - v_dc
        # bridge: currents over speed and voltage half-way, and over its own numbers
        v_total = v_half + 2.0 * c.v_diode
        reactance = max(half_way * c.inductance, 1e-6)
        v_full = c.k_e * half_way * rpm
        i_b, i_s, b_v, s_v, b_full, s_full = weakened_bridge(v_total, v_full, reactance, guess, c, table)
        guess = i_s
        s_h = b_h = 0.0
        if i_b > 0.0:
            left, left_slope = rolloff_at(i_s, c.rolloff, c.rolloff_slope)
            v_ll = v_full * left
            _, _, b_total, s_total, b_turned, s_turned = bridge_slopes(v_total, v_ll, c.r_s, reactance, table)
            square = c.r_s * c.r_s + reactance * reactance
            b_ll, s_ll = (i_b - v_total * b_total) / v_ll, (i_s - v_total * s_total) / v_ll
            b_r, s_r = (b_turned * reactance - i_b * c.r_s) / square, (s_turned * reactance - i_s * c.r_s) / square
            b_x, s_x = (-b_turned * c.r_s - i_b * reactance) / square, (-s_turned * c.r_s - i_s * reactance) / square
            loop = 1.0 / (1.0 - s_ll * v_full * left_slope)
            through = b_ll * v_full * left_slope
            s_r, s_x = s_r * loop, s_x * loop
            b_r, b_x = b_r + through * s_r, b_x + through * s_x
            s_h = s_full * c.k_e * rpm + s_x * c.inductance
            b_h = b_full * c.k_e * rpm + b_x * c.inductance
            w[_S + _V_DIODE], w[_B + _V_DIODE] = 2.0 * s_v, 2.0 * b_v
            w[_S + _K_E], w[_B + _K_E] = s_full * rpm * half_way, b_full * rpm * half_way
            w[_S + _R_S], w[_B + _R_S] = s_r, b_r
            w[_S + _INDUCTANCE], w[_B + _INDUCTANCE] = s_x * half_way, b_x * half_way
            for j in range(bent.shape[0]):
                v_bent = v_full * rolloff_at(i_s, bent[j, 0], bent[j, 1])[0]
                w[_S + _FIRST_WAY + j] = s_ll * v_bent * loop
                w[_B + _FIRST_WAY + j] = b_ll * v_bent + through * w[_S + _FIRST_WAY + j]
        else:
            w[_S : _S + WIDE] = 0.0
            w[_B : _B + WIDE] = 0.0
        # DC link: its voltage half-way over the speed there, and over its own numbers
        stores = 2.0 * c.c_dc / dt
        holds = stores + 1.0 / c.load - b_v
        v_h = b_h / holds
        w[_V + _LOAD], w[_V + _C_DC] = v_half / (c.load * c.load) / holds, -change / dt / holds
        # air-gap torque over speed and voltage half-way
        per = 1.0 / half_way if half_way > 1.0 else 0.0
        em = (v_total * i_b + 3.0 * c.r_s * i_s * i_s) * per
        em_b, em_s = v_total * per, 6.0 * c.r_s * i_s * per
        em_v = i_b * per + em_b * b_v + em_s * s_v
        em_h = em_b * b_h + em_s * s_h - em * per
        w[_EM + _V_DIODE], w[_EM + _R_S] = 2.0 * i_b * per, 3.0 * i_s * i_s * per
        # fast shaft
        sign, edge = 1.0, 0.0
        if half_way < SATURATED * TURN:
            sign = math.tanh(half_way / TURN)
            edge = (1.0 - sign * sign) / TURN
        viscous = 1.0  # share of the damping that acts
        if c.friction * sign < -MAX_RETURNED * (c.b_rotor + c.windage * half_way) * half_way:
            sign, edge, viscous = 0.0, 0.0, 1.0 - MAX_RETURNED
        damping = viscous * (c.b_rotor + 2.0 * c.windage * half_way)
        losses = 0.5 * (damping + c.friction * edge + em_h + em_v * v_h)
        drum_half = 0.5 * (v[n] + v[n + 1]) / c.r_motion
        slip = drum_half - half_way / c.gear
        torque = c.k_shaft * twist + stiff * slip
        on = 1.0 if torque > 0.0 else 0.0
        bound = on * 0.5 * share * stiff / c.gear
        if on == 0.0 and c.coast_drag != 0.0 and half_way < SATURATED * TURN:
            losses += 0.5 * c.coast_drag / c.gear * (1.0 - math.tanh(half_way / TURN) ** 2) / TURN
        moved = 1.0 / (mass + losses + bound) if omega_after > 0.0 else 0.0
        mechanical = (
            -on * share * stiff * drum_half / c.r_motion,
            on * share / c.gear * (stiff * half_way / c.gear - torque),
            on * torque / c.gear,
            -viscous * half_way,
            -viscous * half_way * half_way,
            -sign,
            on * share * (twist + 0.5 * dt * slip),
            on * share * slip,
            -(omega_after - omega) / dt,
        )
        for k in range(9):
            w[_AFTER + k] = mechanical[k]
        w[_SLIP + _GEAR], w[_SLIP + _R_MOTION] = half_way / (c.gear * c.gear), -drum_half / c.r_motion
        w[_TORQUE + _K], w[_TORQUE + _C] = twist + 0.5 * dt * slip, slip
        keeps, pulls = mass - losses - bound, on * share * c.k_shaft
        for k in range(WIDE):
            d_omega, d_v, d_twist = w[_D_OMEGA + k], w[_D_V + k], w[_D_TWIST + k]
            d_given = (stores * d_v + w[_B + k]) / holds + w[_V + k]
            d_em = em_v * d_given + em_b * w[_B + k] + em_s * w[_S + k] + w[_EM + k]
            d_after = moved * (keeps * d_omega + pulls * d_twist - d_em + w[_AFTER + k])
            d_half = 0.5 * (d_omega + d_after)
            d_slip = w[_SLIP + k] - d_half / c.gear
            d_torque = on * (c.k_shaft * d_twist + stiff * d_slip + w[_TORQUE + k])
            w[_D_TWIST + k] = on * (d_twist + dt * d_slip)
            w[_D_MEAN + k] = 0.5 * (d_torque + w[_D_LAST + k])
            w[_D_LAST + k] = d_torque
            w[_D_OMEGA + k] = d_after
            w[_D_SEEN + k] = d_v
            d_v = 2.0 * (d_given + v_h * d_half) - d_v
            w[_D_V + k] = d_v if abs(d_v) > FADED_SLOPE else 0.0
        if n % every == 0:
            kept[0, :, n // every], kept[1, :, n // every] = w[_D_MEAN:][:size], w[_D_SEEN:][:size]
    if (v.size - 1) % every == 0:
        kept[0, :, -1], kept[1, :, -1] = w[_D_LAST:][:size], w[_D_V:][:size]
