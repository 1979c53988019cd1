"""A float that heaves with the tension of the rig at each step (Cummins 1962): excitation,
radiation, stiffness and rig.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from winchcascade.core.errors import OptionError
from winchcascade.core.run import Signal
from winchcascade.rig import physics
from winchcascade.rig.bridge import blended_table
from winchcascade.rig.kernel import LINE, LineMotion, run_line
from winchcascade.rig.parts import Model
from winchcascade.rig.physics import FASTMATH
from winchcascade.rig.state import Constants, GasState, ShaftState, constants, step_line, step_shaft
from winchcascade.sea.hydrodynamics import Hydrodynamics
from winchcascade.sea.in_sea import Control, knots_of, load_at
from winchcascade.sea.line_motion import LEAD_IN, SeaPath, scale_of_motion, steps_of
from winchcascade.sea.wave_spectra import Waves

POWERS = ("v", "z", "waves", "radiated", "rig", "stored")
"""Output of `run_coupled` at the end of each step: velocity [m/s] and heave [m]; half-way power
that the waves give, that is radiated, and that the rig takes, and of the change of kinetic and
potential energy [W]."""

CLOSE = 1e-9
"""Change of the velocity, as a share of that within which friction changes its sign, at which a
step is solved. [1]
"""

TURNS = 60
"""Maximum number of secant steps: two to four are usual."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FASTMATH | {"reassoc"})
def run_coupled(
    force: Signal,
    body: tuple[float, float],
    memory: Signal,
    rig: tuple[float, float, float],
    times: tuple[float, float],
    c: Constants,
    table: Signal,
    speeds: Signal,
    loads: Signal,
    half: Signal,
    out: Signal,
) -> int:
    """Step a float with its rig, each step solved for the velocity at its end by the secant rule.

    Parameters
    ----------
    force : (n,) excitation half-way in each step [N]
    body : mass with the added one at infinite frequency [kg], and stiffness [N/m]
    memory : (m,) retardation function at even steps [N/m]
    rig : share of its tension that acts, 1 or 0 without a rig, its tension in still water [N], and
        the payout there [m]
    times : the step [s], and the speed of the line within which friction changes its sign [m/s]
    speeds, loads : of the control, as `load_at` takes them
    half : (n,) is filled with the velocity half-way [m/s]
    out : (n, 6) is filled with `POWERS`

    Returns
    -------
    The number of the step that could not be solved, -1 where all were.
    """
    dt, rest = times
    mass, stiffness = body
    acts, still, payout = rig
    state, gas = ShaftState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), GasState(0.0, 0.0)
    v = z = a = 0.0
    fades = c.winch.stribeck != 0.0 or c.restoring.stribeck != 0.0
    for n in range(len(force)):
        past = 0.0
        for k in range(1, min(n + 1, len(memory))):
            past += memory[k] * half[n - k]
        load = load_at(state.omega, speeds, loads)
        after, gas_after, pull = state, gas, 0.0
        now, other, missed = v + a * dt, 0.0, 0.0
        solved = False
        for turn in range(TURNS):
            v_half = 0.5 * (v + now)
            z_half, rise = z + 0.5 * dt * v_half, (now - v) / dt
            if acts != 0.0:
                after, middle = step_shaft(state, (v, now), dt, load, c.shaft, table)
                sign = math.tanh(v_half / rest)
                slow = physics.near_rest(v_half, sign, c.winch) if fades else 0.0
                gas_after, line = step_line(
                    gas,
                    (payout + z_half, v_half, rise),
                    (sign, slow),
                    middle[0],
                    dt if n > 0 else 0.0,
                    c,
                )
                pull = acts * (line[1] - still)
            radiated = dt * (0.5 * memory[0] * v_half + past)
            left = force[n] - radiated - stiffness * z_half - pull - mass * rise
            if turn == 0:
                change = left * dt / mass
            else:
                change = left * (now - other) / (missed - left) if missed != left else 0.0
            solved = abs(change) < CLOSE * rest
            if solved:
                break
            other, missed = now, left
            now += change
        if not solved:
            return n
        v_half = 0.5 * (v + now)
        half[n] = v_half
        z_next = z + dt * v_half
        stored = 0.5 * (mass * (now * now - v * v) + stiffness * (z_next * z_next - z * z)) / dt
        out[n, 0], out[n, 1], out[n, 2] = now, z_next, force[n] * v_half
        out[n, 3], out[n, 4], out[n, 5] = radiated * v_half, pull * v_half, stored
        a, v, z, state, gas = (now - v) / dt, now, z_next, after, gas_after
    return -1


def float_in_waves(
    model: Model,
    waves: Waves,
    body: Hydrodynamics,
    tp: float,
    payout: float,
    control: Control,
    *,
    acts: bool = True,
) -> tuple[SeaPath, Signal]:
    """The motion of a line on a float that its rig pulls, and `POWERS` of the float, (n, 6).

    The tension in still water is balanced by the float, so that only what differs from it moves the
    float.

    Parameters
    ----------
    tp : peak period of the waves [s]
    payout : of the line in still water [m]
    acts : whether the rig pulls

    Raises
    ------
    OptionError : a step cannot be solved, as the float is too light for its rig
    """
    excitation, omega = body.response.at(waves), 2.0 * math.pi * waves.frequency
    scale = scale_of_motion(waves, waves.amplitude)
    count = steps_of(model, waves, scale)
    step, rest = waves.duration / count, physics.REST * scale.speed
    memory, added = body.memory(step)
    lead = min(count, max(math.ceil(2.0 * LEAD_IN * tp / step), memory.size))
    whole = waves.sampled(excitation * np.exp(0.5j * omega * step), count)
    force = np.concatenate([whole[count - lead :], whole])
    force[:lead] *= 0.5 - 0.5 * np.cos(np.pi * np.arange(lead) / lead)
    numbers = constants(model, control.loads[0], rest)
    table = blended_table(model.generator.averaged, model.generator.uncommutated)
    half, out = np.zeros(force.size), np.zeros((force.size, len(POWERS)))
    pulls = 1.0 if acts else 0.0, still_tension(payout, numbers), payout
    knots = knots_of(model, control)
    masses = body.mass + added, body.stiffness
    failed = run_coupled(
        force, masses, memory, pulls, (step, rest), numbers, table, *knots, half, out
    )
    if failed >= 0:
        raise OptionError(
            f"--float: {failed * step:.3g} s after its start the float cannot be solved with this "
            f"rig; expected a mass of more "
            "than the inertia of the drum over the square of its radius, so check the "
            "coefficients and --froude."
        )
    v, z = np.append(0.0, out[:-1, 0]), np.append(0.0, out[:-1, 1])
    motion = LineMotion(
        step * np.arange(-float(lead), count), payout + z, v, np.gradient(v, step), step, rest
    )
    return SeaPath(motion, physics.direction(v, rest), lead), out


def still_tension(payout: float, numbers: Constants) -> float:
    """Tension of a line at rest. [N]"""
    zero, line = np.zeros(1), np.zeros((1, len(LINE)))
    run_line(LineMotion(zero, zero + payout, zero, zero, 1.0, 1.0), zero, numbers, zero, line)
    return float(line[0, LINE.index("force")])
