"""An independent twin of the rig: from the motion of the line to the true channels of one log.

The twin shares no code with the rig that a diagnosis fits: the bridge is a switched circuit, the
gas of the accumulator obeys the first law, and the injected effects have laws of their own.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np
from numba import njit

from winchcascade.blind.drive import FINE, GRID, LEDGER, Drive, run_drive
from winchcascade.blind.injected import Hidden
from winchcascade.blind.twin_numbers import (  # fmt: skip
    AIR,
    LOAD_SCATTER,
    LOADS,
    RESTORING_SHARES,
    SCATTER,
    SENSORS,
    Fixed,
    Numbers,
    Restoring,
)
from winchcascade.core.run import Signal

FIXED = Fixed()
"""The numbers of the paper's rig that every campaign shares."""


class Twin(msgspec.Struct, frozen=True):
    """Rig of one campaign, or of one run of it: its numbers, its loads, the gains of its sensors,
    and what is injected.

    A rig of another size is a twin in units of nature in which its drum and its machine are the
    paper's: see `Machine`.

    `zeros` are zeros of sensors by channel beside those that a log draws, in the unit of the log.
    `fixed` are the numbers that no campaign draws. A `schedule` is that of a controller of the
    load: speeds of the rotor [rad/s] and shares of the load [1], as `Drive` has them.
    """

    numbers: Numbers
    loads: dict[str, float]
    gains: dict[str, float]
    hidden: Hidden
    zeros: dict[str, float] = {}
    fixed: Fixed = FIXED
    restoring: Restoring = Restoring()
    schedule: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0,), (1.0,))


class Solved(msgspec.Struct, frozen=True):
    """True motion and channels of one log, on the intervals of the grid, (n,) each in SI units;
    `energy` until the end [J].
    """

    t: Signal
    x: Signal
    v: Signal
    channels: dict[str, Signal]
    energy: dict[str, float]


def taut(twin: Twin, force: Signal) -> Signal:
    """Tension of a line, which is slack where nothing pulls; the gas of the paper's rig always
    does. [N]
    """
    return force if twin.restoring.has_gas else np.maximum(force, 0.0)


FULL_TORQUE = 500.0
"""Torque at the slow shaft against which a loss of the gear under load is stated. [N m]"""


REST = 0.01
"""Friction of screw, seals and line changes its sign within this speed of the line. [m/s]"""


NOMINAL = Twin(Numbers(), dict(LOADS), dict.fromkeys(SENSORS, 1.0), Hidden())
"""The rig of the paper, as its rig file states it."""


def draw_twin(
    hidden: Hidden, rng: np.random.Generator, scatter: float = 1.0, stated: Twin = NOMINAL
) -> Twin:
    """Draw the rig of a campaign within the uncertainties of its numbers.

    Parameters
    ----------
    scatter : true standard deviation of its numbers and of the gains of its sensors over the stated
        uncertainty [1]
    stated : the rig as its file states it, each number known to the same share of it as in the
        paper; without a gear if its mesh has no loss
    """
    known = zip(stated.numbers, NOMINAL.numbers, SCATTER, strict=True)
    numbers = Numbers(*(rng.normal(own, scatter * u * (own / paper)) for own, paper, u in known))
    loads = {
        log: rng.normal(1.0, LOAD_SCATTER if log != "open_circuit" else 0.0) * ohm
        for log, ohm in stated.loads.items()
    }
    gains = {name: rng.normal(1.0, scatter * LOAD_SCATTER) for name in SENSORS}
    restoring = stated.restoring
    if not restoring.has_gas:
        factors = {name: 1.0 + u * rng.standard_normal() for name, u in RESTORING_SHARES.items()}
        restoring = restoring._replace(
            **{name: by * getattr(restoring, name) for name, by in factors.items()}
        )
    if stated.numbers.eta_mesh == 1.0:
        numbers = numbers._replace(eta_mesh=1.0)
    return Twin(numbers, loads, gains, hidden, fixed=stated.fixed, restoring=restoring)


def drive_of(twin: Twin, log: str) -> Drive:
    """Numbers of the drive for one log, with what is injected."""
    n, fixed, hidden = twin.numbers, twin.fixed, twin.hidden
    numbers = n._replace(
        eta_mesh=n.eta_mesh + hidden.get("gear_mesh_loss"),
        b_rotor=n.b_rotor + hidden.get("rotor_viscous"),
        k_e=n.k_e * (1.0 + hidden.get("ke_shift")),
        r_s=n.r_s * (1.0 + hidden.get("copper_heating")),
        l_s=n.l_s * (1.0 + hidden.get("sync_inductance")),
    )
    rotor = fixed.j_rotor * (1.0 + hidden.get("rotor_inertia"))
    diodes = fixed.v_diode + hidden.get("diode_drop") + hidden.get("diode_extra")
    same = (
        "rotor_windage",
        "rotor_friction",
        "leaking_link",
        "diode_slope",
        "diode_scale",
        "cable",
        "overrunning_drag",
    )
    rolloff = {
        name: hidden.laws[name] for name in ("law", "knee", "width", "power") if name in hidden.laws
    }
    return Drive(
        fixed=fixed._replace(j_rotor=rotor, v_diode=diodes),
        numbers=numbers,
        load=twin.loads[log] * (1.0 + hidden.get("load_drift") * (log != "open_circuit")),
        speeds=twin.schedule[0],
        shares=twin.schedule[1],
        warming=hidden.get("warming_load") / 40e3,
        gear_slope=hidden.get("gear_slope") / FULL_TORQUE,
        gear_curve=hidden.get("gear_curve") / FULL_TORQUE**2,
        dead_phase=round(hidden.get("dead_diode")) - 1,
        **{name: hidden.get(name) for name in same},
        **rolloff,
    )


@njit(cache=True)
def gas_pressure(volume: Signal, pressure: float, exponent: float, cooling: float) -> Signal:
    """Absolute pressure of a gas that heats by the first law and loses its heat. [Pa]

    With c_v = R / (exponent - 1): dT/dt = -(exponent - 1) T / V dV/dt - (T - T_0) / cooling.

    Parameters
    ----------
    volume : (n,) on the grid [m3]
    pressure : at the first volume [Pa]
    exponent : 1 keeps the temperature [1]
    cooling : [s]
    """
    out = np.empty(len(volume))
    warm = 1.0
    for n in range(len(volume)):
        if n > 0 and exponent != 1.0:
            warm *= (volume[n - 1] / volume[n]) ** (exponent - 1.0)
            warm = 1.0 + (warm - 1.0) * math.exp(-GRID / cooling)
        out[n] = pressure * volume[0] / volume[n] * warm
    return out


def efficiencies(mu: float, fixed: Fixed) -> tuple[float, float]:
    """Forward and reverse efficiency of the screw, Sec. 4.1.1."""
    lead, thread = math.radians(fixed.lead_angle), math.radians(fixed.thread_angle)
    rise, flank = math.tan(lead), math.cos(thread)
    return (flank - mu * rise) / (flank + mu / rise), (flank - mu / rise) / (flank + mu * rise)


def solve_twin(
    twin: Twin, log: str, x: Signal, v: Signal, resting: float, *, fine: int = FINE
) -> Solved:
    """Solve a twin along a motion of the line.

    Parameters
    ----------
    x, v : (n + 1,) payout and its rate at the ends of the grid's intervals [m, m/s]
    resting : where friction holds at rest, -1 as in haul-in, 1 as in payout
    """
    hidden, fixed, r, phase = (
        twin.hidden,
        twin.fixed,
        twin.fixed.r_drum,
        twin.hidden.laws.get("phase", 0.0),
    )
    t: Signal = (np.arange(x.size - 1, dtype=np.float64) + 0.5) * GRID
    middle: Signal = 0.5 * (x[1:] + x[:-1])
    speed, pull = 0.5 * (v[1:] + v[:-1]), np.diff(v) / GRID
    turned = speed / np.sqrt(speed**2 + REST**2)
    way = turned + resting * (1.0 - turned**2)
    mesh = 1.0 + hidden.get("worn_gear") * np.cos(
        3.0 * middle / r + phase
    )  # three times a turn of the drum
    out, stored = run_drive(v / r, mesh, drive_of(twin, log), fine)
    torque = out[:, 0] - hidden.get("clutch_drag") * np.where(speed < 0.0, np.abs(turned), 0.0)
    slow, seals = (
        _slow_friction(hidden, speed),
        hidden.laws.get("slow_seals", 0.0) * twin.restoring.has_gas,
    )
    inertia = (fixed.j_drum + hidden.get("drum_inertia")) * pull / r
    friction = (
        hidden.get("line_friction") * way
        + hidden.get("line_drag") * speed / r
        + _braking(twin, t, turned)
    )
    lost = friction + slow * way * (1.0 - seals)
    channels = {"torque": torque, "vdc": out[:, 1], "idc": out[:, 2]}
    if twin.restoring.has_gas:
        gauge = _gauge(twin, middle, t)
        held = _screw(twin, gauge, way, slow * way * seals * 2.0 * math.pi / fixed.lead)
        channels["pressure"] = gauge
    else:
        held = r * held_by(twin.restoring, middle, pull, way)
    eccentric = hidden.get("eccentric_drum") * np.cos(middle / r + phase)
    radius = r * (1.0 + hidden.get("drum_layering") * middle / 10.0) * (1.0 + eccentric)
    force = (
        (held + torque + inertia + lost)
        / radius
        * np.exp(-math.log1p(-hidden.get("rope_loss")) * way)
    )
    channels["force"] = taut(twin, force)
    energy = dict(zip(LEDGER, [*out[:, 4:].sum(axis=0), *stored], strict=True))
    return Solved(t, x, v, channels | {"omega": out[:, 3]}, energy)


def held_by(restoring: Restoring, x: Signal, pull: Signal, way: Signal) -> Signal:
    """Force at the drum of a spring or a counterweight, (n,); without either none. [N]

    Parameters
    ----------
    x, pull : payout and its acceleration [m, m/s2]
    way : direction of friction [1]
    """
    spring = restoring.force + restoring.stiffness * x
    weight = restoring.weight * (1.0 + pull / restoring.gravity)
    return spring + weight + restoring.friction * way


def _gauge(twin: Twin, x: Signal, t: Signal) -> Signal:
    """Gauge pressure in the accumulator. [Pa]"""
    hidden, n, fixed = twin.hidden, twin.numbers, twin.fixed
    area = n.area * (1.0 + hidden.get("piston_area"))
    volume = (
        n.v_gas + hidden.get("gas_volume") - area * fixed.lead * x / (2.0 * math.pi * fixed.r_drum)
    )
    absolute = gas_pressure(
        volume,
        pressure=n.p_gas * (1.0 + hidden.get("precharge")),
        exponent=1.0 + hidden.get("gas_polytropic"),
        cooling=hidden.laws.get("gas_cooling", 1.0),
    )
    return absolute * np.exp(-hidden.get("leaking_gas") * t / 100.0) - AIR


def _slow_friction(hidden: Hidden, speed: Signal) -> Signal:
    """Friction torque at the line that is larger near standstill, by its amount. [N m]

    It falls as exp(-(v / v_s)^d) with the speed, d about 2 (Bo and Pavelescu 1982); its size is
    that at 0.05 m/s.
    """
    slow, power = hidden.laws.get("slow_speed", 1.0), hidden.laws.get("slow_power", 2.0)
    share: Signal = np.exp((0.05 / slow) ** power - (np.abs(speed) / slow) ** power)
    return hidden.get("stribeck") * share


def _screw(twin: Twin, gauge: Signal, way: Signal, seal_slow: Signal) -> Signal:
    """Torque of the screw at the drum: thrust times lead, over the efficiency in payout, times it
    in haul-in. [N m]

    Parameters
    ----------
    seal_slow : further friction of the seals near standstill, (n,) [N]
    """
    hidden, n, lead = twin.hidden, twin.numbers, twin.fixed.lead
    forward, reverse = efficiencies(n.mu + hidden.get("screw_friction"), twin.fixed)
    thrust = (
        gauge * n.area * (1.0 + hidden.get("piston_area"))
        + hidden.get("seal_friction") * way
        + seal_slow
    )
    return (
        thrust
        * lead
        / (2.0 * math.pi)
        * (0.5 * (1.0 + way) / forward + 0.5 * (1.0 - way) * reverse)
    )


def _braking(twin: Twin, t: Signal, turned: Signal) -> Signal:
    """Torque of a brake that drags for a second or two and releases, in each log at other times.
    [N m]
    """
    torque = twin.hidden.get("brake_drag")
    if torque == 0.0:
        return np.zeros(t.size)
    rng = np.random.default_rng([round(1e6 * twin.hidden.laws["phase"]), t.size])
    flips = np.cumsum(rng.exponential(1.6, size=int(t[-1])) + 0.5)
    return np.where(np.searchsorted(flips, t) % 2 == 1, torque * turned, 0.0)
