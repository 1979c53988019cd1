"""The state of a rig, and one step of it through time: velocity of the line in, tension out.

Loops over a whole motion and solvers of other bodies step a rig by these functions. Each takes a
state and gives the next one, so that a state can be kept and gone back to. The high-speed shaft
behind clutch and shaft spring, the temperature of the gas and the DC link have a state. All are
stepped by the trapezoidal rule, linearly implicitly (the spring by its stiffness, DC link and
machine together by the slopes of the bridge, dry friction by its slope), so the error falls with
the square of the step.

Numba does not see in the files of the loops that this file has changed: delete the compiled code,
as for `physics.py`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from numba import njit

from winchcascade.core.quantity import ATMOSPHERE
from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.bridge import bridge_state
from winchcascade.rig.parts import (
    ROLLOFF_KNOTS,
    DrivetrainModel,
    GeneratorModel,
    Model,
    RestoringModel,
    WinchModel,
    rolloff_curve,
)
from winchcascade.rig.physics import FASTMATH, RPM

SATURATED = 20.0
"""Speed in multiples of that within which friction turns, from which it has its full size to the
last digit. [1]
"""

MAX_RETURNED = 0.5
"""Share of the damping of the high-speed shaft that a negative friction, a deviation of the model
within its tolerance, may return: the shaft still comes to rest. [1]"""

FADED = 1e-30
"""A speed or voltage that has decayed to less is zero [rad/s, V]. At rest both would become
subnormal numbers, with which a processor takes many times as long."""

MIN_REACTANCE = 1e-6
"""Of a phase at rest as a share of its resistance, so that its angle is defined. [1]"""

MIN_VOLUME = 0.01
"""Minimum share of the gas volume that remains, as a fit may try numbers with which the gas
would vanish. [1]
"""


class ShaftNumbers(NamedTuple):
    """Numbers that the solution of the shaft depends on, SI units: parts, capacitor, load,
    `r_motion` as in `Constants`, the speed `turn` within which friction changes its sign, and the
    remaining share of the back-EMF constant at `ROLLOFF_KNOTS` with its slopes there.
    """

    drivetrain: DrivetrainModel
    generator: GeneratorModel
    c_dc: float
    load: float
    r_motion: float
    turn: float
    rolloff: tuple[float, ...]
    rolloff_slope: tuple[float, ...]


class Constants(NamedTuple):
    """Numbers of a model at one load as compiled code takes them, SI units; `shaft` are those of
    the generator's side.

    `r_motion` is the logged motion over the angle of the drum [m]: `r_drum`, unless the logged
    motion has another scale.
    """

    winch: WinchModel
    restoring: RestoringModel
    eta_forward: float
    eta_reverse: float
    r_motion: float
    drivetrain: DrivetrainModel
    shaft: ShaftNumbers


def constants(model: Model, load: float, rest: float) -> Constants:
    """Put the numbers of a model together for one load; inf is an open circuit, which the bleed
    alone discharges. [ohm]

    Parameters
    ----------
    rest : speed of the line within which friction changes its sign [m/s]
    """
    gas, machine, r_motion = model.restoring, model.generator, model.r_motion
    shaft = ShaftNumbers(
        model.drivetrain._replace(clutch_drag=0.0),  # it acts on the line alone
        machine,
        model.dc_link.c_dc,
        model.dc_link.resistance(load),
        r_motion,
        physics.TURN * rest / r_motion * model.drivetrain.gear,
        (1.0, *machine.rolloff),
        rolloff_slopes(machine.rolloff),
    )
    return Constants(
        model.winch, gas, gas.eta_forward, gas.eta_reverse, r_motion, model.drivetrain, shaft
    )


@lru_cache(maxsize=256)
def rolloff_slopes(rolloff: tuple[float, ...]) -> tuple[float, ...]:
    """Slopes of `rolloff_curve` at `ROLLOFF_KNOTS`. [1]"""
    return tuple(rolloff_curve(rolloff)(ROLLOFF_KNOTS, 1).tolist())


@njit(cache=True, error_model="numpy", fastmath=FASTMATH)
def rolloff_at(
    i_s: float, rolloff: tuple[float, ...] | Signal, slopes: tuple[float, ...] | Signal
) -> tuple[float, float]:
    """Share of the back-EMF constant that remains at a stator current, and its slope. [1]

    Parameters
    ----------
    i_s : over the rated current [1]
    rolloff, slopes : share at `ROLLOFF_KNOTS` and its slopes there, or the change of both along a
        direction [1]
    """
    if i_s >= ROLLOFF_KNOTS[-1]:
        return rolloff[-1], 0.0
    k = 0
    while i_s > ROLLOFF_KNOTS[k + 1]:
        k += 1
    width = ROLLOFF_KNOTS[k + 1] - ROLLOFF_KNOTS[k]
    x = (i_s - ROLLOFF_KNOTS[k]) / width
    rise = rolloff[k + 1] - rolloff[k]
    first, last = slopes[k] * width, slopes[k + 1] * width
    square, cube = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
    slope = (first + x * (2.0 * square + 3.0 * x * cube)) / width
    return rolloff[k] + x * (first + x * (square + x * cube)), slope


_NEAR = 2e-4
"""Distance of the stator current from the root before the last Newton step, over the rated one;
after it about 1e-8. [1]
"""

NEWTON_ALONE = 4
"""Newton steps before a bracket is used: from the previous time step, one is nearly always
enough.
"""

_SQRT2 = math.sqrt(2.0)


# inline: the numbers of the parts would be copied at every call
@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def weakened_bridge(
    v_total: float,
    v_full: float,
    ohm: tuple[float, float],
    guess: float,
    c: ShaftNumbers,
    table: Signal,
) -> tuple[float, float, float, float, float, float]:
    """Currents of the bridge, DC and stator rms [A], while the latter weakens the back-EMF; the
    slopes of both over the DC voltage [A/V], and over the back-EMF that no current weakens, at one
    reactance [A/V].

    More current leaves less back-EMF, so there is one root. Newton steps start at a guess; where
    the roll-off is steep they may overshoot, and then they stay in a bracket.

    Parameters
    ----------
    ohm : resistance and reactance of a phase [ohm]
    """
    r_s, reactance = ohm
    if v_total >= _SQRT2 * v_full:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if c.rolloff[-1] == 1.0:
        i_b, i_s, d_b, d_s = bridge_state(v_total, v_full, r_s, reactance, table)
        return i_b, i_s, d_b, d_s, (i_b - v_total * d_b) / v_full, (i_s - v_total * d_s) / v_full
    low, high, now, rated = 0.0, math.inf, max(guess, 0.0), c.generator.i_rated
    left = steep = loop = missed = by_b = by_s = i_b = d_b = d_s = 0.0
    for turn in range(60):
        if turn == NEWTON_ALONE:
            _, high, _, _ = bridge_state(v_total, v_full, r_s, reactance, table)
            now = min(max(now, low), high)
        left, slope = rolloff_at(now / rated, c.rolloff, c.rolloff_slope)
        v_ll, steep = v_full * left, v_full * slope / rated
        i_b, i_s, d_b, d_s = bridge_state(v_total, v_ll, r_s, reactance, table)
        by_b, by_s = (i_b - v_total * d_b) / v_ll, (i_s - v_total * d_s) / v_ll
        loop, missed = 1.0 / (1.0 - by_s * steep), i_s - now
        if abs(missed) < _NEAR * rated:
            break
        if turn >= NEWTON_ALONE:
            if missed > 0.0:
                low = now
            else:
                high = now
        newton = now + missed * loop
        now = newton if low < newton < high else 0.5 * (low + min(high, 2.0 * now + rated))
    s_total, s_full, last = d_s * loop, by_s * left * loop, missed * loop
    b_total, b_full = d_b + by_b * steep * s_total, by_b * (left + steep * s_full)
    return i_b + by_b * steep * last, now + last, min(b_total, 0.0), s_total, b_full, s_full


# inline: as above
@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def _turned(
    speeds: tuple[float, float, float],
    twist: float,
    machine: tuple[float, float],
    times: tuple[float, float],
    shaft: DrivetrainModel,
) -> tuple[float, float, float]:
    """Turn the high-speed shaft by one step, by the trapezoidal rule: torque of the clutch [N m],
    then twist [rad] and speed [rad/s] at the end of the step.

    Parameters
    ----------
    speeds : of the high-speed shaft now and half-way (predicted), of the drum half-way [rad/s]
    machine : air-gap torque at the predicted speed [N m], and its slope over the speed [N m s/rad]
    times : the step [s], and the speed within which friction changes its sign [rad/s]
    """
    omega, half_way, drum_half = speeds
    em, brakes = machine
    dt, turn = times
    share = shaft.eta_mesh / shaft.gear
    stiff = 0.5 * dt * shaft.k_shaft + shaft.c_shaft
    mass = shaft.inertia_rotor / dt
    sign = (
        math.tanh(half_way / turn)
        if physics.has_dry_friction(shaft) and half_way < SATURATED * turn
        else 1.0
    )
    each = physics.shaft_losses(half_way, sign, turn, shaft)
    drag, slope = physics.total(each)
    dry, steep = each[0]
    if dry < 0.0 and dry < -MAX_RETURNED * (drag - dry):
        drag, slope = (1.0 - MAX_RETURNED) * (drag - dry), (1.0 - MAX_RETURNED) * (slope - steep)
    losses, pull = 0.5 * (slope + brakes), (brakes + slope) * half_way - (em + drag)
    driven = (mass - losses) * omega + pull
    after = (
        driven + share * (shaft.k_shaft * twist + stiff * (drum_half - 0.5 * omega / shaft.gear))
    ) / (mass + losses + 0.5 * share * stiff / shaft.gear)
    slip = drum_half - 0.5 * (omega + after) / shaft.gear
    torque = shaft.k_shaft * twist + stiff * slip
    if torque > 0.0:
        return torque, twist + dt * slip, max(after, 0.0)
    if shaft.coast_drag != 0.0:  # the overrunning clutch brakes the rotor
        steep = shaft.coast_drag / shaft.gear * (1.0 - sign * sign) / turn
        losses += 0.5 * steep
        driven -= shaft.coast_drag / shaft.gear * sign - steep * (half_way - 0.5 * omega)
    return -shaft.coast_drag * sign, 0.0, max(driven / (mass + losses), 0.0)


class ShaftState(NamedTuple):
    """State of the generator's side: speed of the high-speed shaft and that of the step before
    [rad/s], twist of the shaft spring [rad], DC voltage [V], and the stator current that is
    expected next and that of the step before [A].
    """

    omega: float = 0.0
    omega_before: float = 0.0
    twist: float = 0.0
    v_dc: float = 0.0
    guess: float = 0.0
    i_before: float = 0.0


class GasState(NamedTuple):
    """State of the gas: heat of compression that it still holds, as the logarithm of the pressure
    ratio, and logarithm of its compression, (volume at zero payout over the present one) [1].
    """

    heat: float = 0.0
    log_volume: float = 0.0


# inline: the numbers of the parts would be copied at every call
@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def step_shaft(
    state: ShaftState,
    speeds: tuple[float, float],
    dt: float,
    load: float,
    c: ShaftNumbers,
    table: Signal,
) -> tuple[ShaftState, tuple[float, float, float, float]]:
    """Step the generator's side once: clutch, shaft, gear, machine, bridge and DC link.

    Parameters
    ----------
    speeds : of the line now and at the end of the step, payout positive [m/s]
    dt, load : the step [s] and the load during it [ohm]
    table : of the bridge, as `blended_table` gives it

    Returns
    -------
    The state at the end, and half-way torque of the clutch [N m], stator current, rms [A], air-gap
    torque [N m] and current of the bridge [A].
    """
    machine, r_s = c.generator, c.generator.r_s + c.generator.r_diode
    omega, v_dc, slow = state.omega, state.v_dc, 2.0 * c.turn
    # bridge at the present DC voltage and the predicted speed half-way
    half_way = max(omega + 0.5 * (omega - state.omega_before), 0.0)
    v_total = v_dc + 2.0 * machine.v_diode
    v_full = machine.k_e * half_way * RPM
    i_b = i_s = b_h = s_h = b_v = s_v = em = brakes = 0.0
    conducts = (
        v_total < _SQRT2 * v_full
    )  # most steps do not, and are then done in two thirds of the time
    if conducts:
        ohm = r_s, max(physics.reactance(half_way, machine), MIN_REACTANCE * r_s)
        i_b, i_s, b_v, s_v, b_full, s_full = weakened_bridge(
            v_total, v_full, ohm, state.guess, c, table
        )
        # half-way, DC voltage and air-gap torque follow the speed there by the bridge's slopes
        b_h, s_h = b_full * machine.k_e * RPM, s_full * machine.k_e * RPM
    guess, i_before = (
        max(2.0 * i_s - state.i_before, 0.0),
        i_s,
    )  # the stator current goes on as it went
    holds = 2.0 * c.c_dc / dt + 1.0 / load - b_v
    fills = (i_b - v_dc / load) / holds
    if conducts:
        per = 1.0 / half_way if half_way > slow else 0.0
        em = physics.air_gap_power(v_dc, i_b, i_s, machine) * per
        em_v = (i_b + v_total * b_v + 6.0 * r_s * i_s * s_v) * per
        em_h = (v_total * b_h + 6.0 * r_s * i_s * s_h - em) * per
        em += em_v * fills
        brakes = max(em_h + em_v * b_h / holds, 0.0)
    drum_half = 0.5 * (speeds[0] + speeds[1]) / c.r_motion
    torque = wound = after = 0.0  # of a shaft at rest
    if omega > 0.0 or state.twist > 0.0 or drum_half > 0.0:
        torque, wound, after = _turned(
            (omega, half_way, drum_half), state.twist, (em, brakes), (dt, c.turn), c.drivetrain
        )
    # DC link
    faster = 0.5 * (omega + after) - half_way
    change = max(2.0 * (fills + b_h * faster / holds), -v_dc)
    i_b = max(c.c_dc * change / dt + (v_dc + 0.5 * change) / load, 0.0)
    i_s = max(i_s + 0.5 * s_v * change + s_h * faster, 0.0)
    em += brakes * faster
    now = 0.0 if after < FADED else after
    v_now = 0.0 if v_dc + change < FADED else v_dc + change
    return ShaftState(now, omega, wound, v_now, guess, i_before), (torque, i_s, em, i_b)


# inline: as above
@njit(cache=True, error_model="numpy", inline="always", fastmath=FASTMATH)
def step_line(
    state: GasState,
    motion: tuple[float, float, float],
    direction: tuple[float, float],
    torque: float,
    dt: float,
    c: Constants,
) -> tuple[GasState, tuple[float, float, float, float]]:
    """Compute the line tension after a step: gas and screw, spring or counterweight, losses and
    inertia at the drum, clutch.

    Parameters
    ----------
    state : of the gas at the step before; the heat of the gas alone depends on earlier steps
    motion : displacement, velocity and acceleration of the line [m, m/s, m/s2]
    direction : of friction, and that of the friction which fades with the speed [1]
    torque : of the clutch, below zero where it drags while the rotor overruns the drum [N m]
    dt : the step; 0 where there was none before [s]

    Returns
    -------
    The state now, and gauge pressure [Pa], line tension [N], torque that the sensor sees and that
    of the screw at the drum [N m].
    """
    winch, gas = c.winch, c.restoring
    x, v, a = motion
    sign, slow = direction
    # gas: isothermal, and hotter by the heat of compression that it still holds
    volume = max(gas.volume - gas.area * gas.lead * x / c.r_motion, MIN_VOLUME * gas.volume)
    gauge = gas.pressure * (gas.volume / volume) - ATMOSPHERE
    if gas.exponent != 1.0:
        heat, squeezed = state.heat, math.log(gas.volume / volume)
        if dt > 0.0:
            fade = 0.5 * dt / gas.cooling
            heat = (heat * (1.0 - fade) + (gas.exponent - 1.0) * (squeezed - state.log_volume)) / (
                1.0 + fade
            )
        state = GasState(heat, squeezed)
        gauge = (gauge + ATMOSPHERE) * math.exp(heat) - ATMOSPHERE
    screw = physics.piston_torque(gauge, gas) + physics.seal_torque(sign, slow, gas)
    screw *= physics.both_ways(sign, 1.0 / c.eta_forward, c.eta_reverse)
    drag = physics.open_clutch(sign, c.drivetrain)
    seen = torque + drag if torque >= 0.0 else min(torque, drag)
    needed = (
        screw
        + seen
        + physics.line_losses(v / c.r_motion, sign, slow, winch)
        + winch.inertia * a / c.r_motion
    )
    if physics.pulls(gas):
        needed += physics.pull_torque(x / c.r_motion, a / c.r_motion, winch.r_drum, gas)
        needed += physics.pull_friction(sign, winch.r_drum, gas)
    force = needed / physics.rope_radius(x, winch) * physics.line_over_drum(sign, winch)
    return state, (gauge, force, seen, screw)
