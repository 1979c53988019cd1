"""What the sensors of a twin write: gains, zeros, noise, resolution, the ringing of the tether, late and bent readings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numba import njit

from winchcascade.blind.crane import line_motion, smooth_noise
from winchcascade.blind.drive import COLUMNS, FINE, GRID, LEDGER, Drive, run_drive
from winchcascade.blind.injected import Hidden
from winchcascade.blind.twin_numbers import (  # fmt: skip
    AIR,
    LOAD_SCATTER,
    LOADS,
    SCATTER,
    SENSORS,
    VELOCITY_NOISE,
    VELOCITY_STEP,
    Fixed,
    Numbers,
)

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


STAMP = 0.04
"""Between two rows of a log. [s]"""

_WINDOW = 5
"""Intervals on either side of a stamp that a reading is averaged over."""

TETHER_HZ, TETHER_DAMPING, TETHER_MASS = 2.2, 0.12, 3.0
"""Ringing of the tether after a jerk: frequency, damping ratio, and newtons for each m/s2 that it has yet to follow."""

TETHER_NOISE, TETHER_WIDTH = 3.4, 0.14
"""What else the tether does: standard deviation, and width of the bell curve that smooths it. [N, s]"""


def read_log(twin: Twin, solved: Solved, rng: np.random.Generator) -> dict[str, Signal]:
    """What the sensors write of one log, by channel in the units of the log, with `time`."""
    stamps = stamps_of(solved)
    grid = np.arange(solved.x.size, dtype=np.float64) * GRID
    x, v = _encoder(twin.hidden, solved)
    speed = np.interp(stamps, grid, v) + rng.normal(0.0, VELOCITY_NOISE, stamps.size)
    columns = {
        "time": np.round(stamps, 4),
        "displacement": np.round(np.interp(stamps, grid, x), 4),
        "velocity": _stepped(speed, VELOCITY_STEP, 3),
    }
    tether = TETHER_NOISE * smooth_noise(solved.t.size, TETHER_WIDTH, rng)
    for name, value in noiseless(twin, solved, stamps).items():
        sensor = SENSORS[name]
        swaying = np.interp(stamps, solved.t, tether) if name == "force" else 0.0
        noise = rng.normal(0.0, sensor.zero) + rng.normal(0.0, sensor.noise, stamps.size) + swaying
        columns[name] = _stepped(value + noise, sensor.step, sensor.decimals)
    return columns


def stamps_of(solved: Solved) -> Signal:
    """Stamps of the log of a solved motion. [s]"""
    return np.arange(0.0, solved.t[-1] - 0.01, STAMP)


def noiseless(twin: Twin, solved: Solved, stamps: Signal) -> dict[str, Signal]:
    """What the sensors would write without zeros, noise and resolution, by channel in the units of the log."""
    hidden, found = twin.hidden, {}
    for name, sensor in SENSORS.items():
        true = solved.channels[name] + (_ringing(solved) if name == "force" else 0.0)
        late = hidden.get("electrical_lag") * (name in ("vdc", "idc")) + hidden.get("late_force") * (name == "force")
        value = np.interp(stamps - late, solved.t, _averaged(true)) / sensor.unit
        read = value * twin.gains[name] * (1.0 + _gain_error(hidden, name)) + _bent(hidden, name, value)
        found[name] = read + hidden.get("force_zero") * (name == "force")
    return found


_GAINS = {"torque": "torque_gain", "force": "force_gain", "vdc": "voltage_gain", "idc": "current_gain"}


def _gain_error(hidden: Hidden, name: str) -> float:
    return hidden.get(_GAINS[name]) if name in _GAINS else 0.0


def _bent(hidden: Hidden, name: str, value: Signal) -> Signal:
    """What a sensor that no catalogue has adds to its reading, in the unit of the log."""
    if name == "torque" and hidden.get("curved_torque"):
        return -hidden.get("curved_torque") * value * np.abs(value) / 500.0
    if name == "idc" and hidden.get("saturated_current"):
        past = np.maximum(value - 5.0, 0.0)
        return -hidden.get("saturated_current") * 15.0 * (past / 10.0) ** 2
    if name == "pressure" and hidden.get("pressure_play"):
        return _play(value, hidden.get("pressure_play")) - value
    return np.zeros(value.size)


def _play(value: Signal, width: float) -> Signal:
    """Follow a reading through a play of half a width to either side."""
    out = np.empty(value.size)
    now = value[0]
    for k, here in enumerate(value):
        now = min(max(now, here - 0.5 * width), here + 0.5 * width)
        out[k] = now
    return out


def _encoder(hidden: Hidden, solved: Solved) -> tuple[Signal, Signal]:
    """Displacement and velocity as the encoder sees them; one behind an elastic drive follows late."""
    delay = hidden.get("elastic_encoder")
    if delay == 0.0:
        return solved.x, solved.v
    return follow(solved.x, delay), follow(solved.v, delay)


@njit(cache=True)
def follow(value: Signal, delay: float) -> Signal:
    """A first-order lag on the grid, starting at rest."""
    out = np.empty(value.size)
    now = value[0]
    for k in range(value.size):
        now += (value[k] - now) * (1.0 - math.exp(-GRID / delay))
        out[k] = now
    return out


def _averaged(value: Signal) -> Signal:
    """Mean over the intervals around each, as a sensor's filter takes it."""
    ends = np.pad(np.cumsum(value), (1, 0))
    k = np.arange(value.size)
    low, high = np.maximum(k - _WINDOW, 0), np.minimum(k + _WINDOW + 1, value.size)
    mean: Signal = (ends[high] - ends[low]) / (high - low)
    return mean


def _ringing(solved: Solved) -> Signal:
    """Force by which the tether rings after a jerk, (n,) [N]."""
    return -TETHER_MASS * ring(np.diff(solved.v) / GRID)


@njit(cache=True)
def ring(pull: Signal) -> Signal:
    """What a lightly damped mass on the tether has yet to follow of the line's acceleration. [m/s2]"""
    omega = 2.0 * math.pi * TETHER_HZ
    out = np.empty(pull.size)
    here = rate = 0.0
    for k in range(pull.size):
        rate += GRID * (omega**2 * (pull[k] - here) - 2.0 * TETHER_DAMPING * omega * rate)
        here += GRID * rate
        out[k] = pull[k] - here
    return out


def _stepped(value: Signal, step: float, decimals: int) -> Signal:
    return np.round(np.round(value / step) * step, decimals)


FIXED = Fixed()
REST = 0.01
"""Friction of screw, seals and line turns round within this speed of the line. [m/s]"""

RESTING, RESTING_MEAN = 0.22, -0.06
"""At rest friction holds somewhere between its two directions: scatter from log to log, and mean, of -1 to 1."""


class Twin(msgspec.Struct, frozen=True):
    """One campaign's rig: its own numbers, its loads, the gains of its sensors, and what is hidden in it."""

    numbers: Numbers
    loads: dict[str, float]
    gains: dict[str, float]
    hidden: Hidden


class Solved(msgspec.Struct, frozen=True):
    """What a twin truly does in one log, on the grid's intervals, (n,) each in SI units; `energy` until its end [J]."""

    t: Signal
    x: Signal
    v: Signal
    channels: dict[str, Signal]
    energy: dict[str, float]


def draw_twin(hidden: Hidden, rng: np.random.Generator) -> Twin:
    """Draw a campaign's rig within what is known of it."""
    numbers = Numbers(*(rng.normal(mean, u) for mean, u in zip(Numbers(), SCATTER, strict=True)))
    loads = {log: rng.normal(1.0, LOAD_SCATTER if log != "open_circuit" else 0.0) * ohm for log, ohm in LOADS.items()}
    gains = {name: rng.normal(1.0, LOAD_SCATTER) for name in SENSORS}
    return Twin(numbers, loads, gains, hidden)


def drive_of(twin: Twin, log: str) -> Drive:
    """Numbers of the drive for one log, with what is hidden in them."""
    n, hidden = twin.numbers, twin.hidden
    changed = {
        "gear": FIXED.gear,
        "k_shaft": FIXED.k_shaft,
        "c_shaft": FIXED.c_shaft,
        "pole_pairs": FIXED.pole_pairs,
        "c_dc": n.c_dc,
        "eta_mesh": n.eta_mesh + hidden.get("gear_mesh_loss"),
        "j_rotor": FIXED.j_rotor * (1.0 + hidden.get("rotor_inertia")),
        "b_rotor": n.b_rotor + hidden.get("rotor_viscous"),
        "windage": hidden.get("rotor_windage"),
        "friction": hidden.get("rotor_friction"),
        "k_e": n.k_e * (1.0 + hidden.get("ke_shift")),
        "r_s": n.r_s * (1.0 + hidden.get("copper_heating")),
        "l_s": n.l_s * (1.0 + hidden.get("sync_inductance")),
        "v_diode": FIXED.v_diode + hidden.get("diode_drop"),
        "load": twin.loads[log] * (1.0 + hidden.get("load_drift") * (log != "open_circuit")),
        "leak": hidden.get("leaking_link"),
        "leak_power": 4.0,
    }
    if "ke_rolloff" in hidden.effects:
        changed |= {name: hidden.laws[name] for name in ("law", "knee", "width", "power")}
    if "warming_load" in hidden.outsiders:
        changed |= {"warming": hidden.get("warming_load") / 40e3, "cooling": 60.0}
    return Drive(**changed)


@njit(cache=True)
def gas_pressure(volume: Signal, pressure: float, exponent: float, cooling: float) -> Signal:
    """Absolute pressure of a gas that heats by the first law and gives its heat away. [Pa]

    With c_v = R / (exponent - 1): dT/dt = -(exponent - 1) T / V dV/dt - (T - T_0) / cooling.

    Parameters
    ----------
    volume : (n,) on the grid [m3]
    pressure : at the first volume [Pa]
    exponent : 1 keeps the temperature [1]
    cooling : [s]
    """
    out = np.empty(volume.size)
    warm = 1.0
    for n in range(volume.size):
        if n > 0 and exponent != 1.0:
            warm *= (volume[n - 1] / volume[n]) ** (exponent - 1.0)
            warm = 1.0 + (warm - 1.0) * math.exp(-GRID / cooling)
        out[n] = pressure * volume[0] / volume[n] * warm
    return out


def efficiencies(mu: float) -> tuple[float, float]:
    """Forward and reverse efficiency of the screw, Sec. 4.1.1."""
    lead, thread = math.radians(FIXED.lead_angle), math.radians(FIXED.thread_angle)
    rise, flank = math.tan(lead), math.cos(thread)
    return (flank - mu * rise) / (flank + mu / rise), (flank - mu / rise) / (flank + mu * rise)


def solve(twin: Twin, log: str, x: Signal, v: Signal, resting: float, *, fine: int = FINE) -> Solved:
    """Let a twin follow a motion of the line.

    Parameters
    ----------
    x, v : (n + 1,) payout and its rate at the ends of the grid's intervals [m, m/s]
    resting : where friction holds at rest, -1 as in haul-in, 1 as in payout
    """
    hidden, r = twin.hidden, FIXED.r_drum
    t: Signal = (np.arange(x.size - 1, dtype=np.float64) + 0.5) * GRID
    middle: Signal = 0.5 * (x[1:] + x[:-1])
    speed, pull = 0.5 * (v[1:] + v[:-1]), np.diff(v) / GRID
    turned = speed / np.sqrt(speed**2 + REST**2)
    way = turned + resting * (1.0 - turned**2)
    gauge = _gauge(twin, middle, t)
    out, ledger = np.empty((t.size, len(COLUMNS))), np.zeros(len(LEDGER))
    run_drive(v / r, _mesh(twin, middle), drive_of(twin, log), fine, out, ledger)
    held = -hidden.get("clutch_drag") * np.where(speed < 0.0, np.abs(turned), 0.0)
    torque = out[:, 0] + held
    screw = _screw(twin, gauge, way)
    inertia = (FIXED.j_drum + hidden.get("drum_inertia")) * pull / r
    lost = hidden.get("line_friction") * way + hidden.get("line_drag") * speed / r + _braking(twin, t, turned)
    reach = r * (1.0 + hidden.get("drum_layering") * middle / 10.0)
    reach = reach * (1.0 + hidden.get("eccentric_drum") * np.cos(middle / r + hidden.laws.get("phase", 0.0)))
    force = (screw + torque + inertia + lost) / reach
    channels = {"pressure": gauge, "force": force, "torque": torque, "vdc": out[:, 1], "idc": out[:, 2]}
    channels |= {"omega": out[:, 3], "screw": screw}
    return Solved(t, x, v, channels, dict(zip(LEDGER, ledger.tolist(), strict=True)))


def _gauge(twin: Twin, x: Signal, t: Signal) -> Signal:
    """Gauge pressure in the accumulator. [Pa]"""
    hidden, n = twin.hidden, twin.numbers
    area = n.area * (1.0 + hidden.get("piston_area"))
    volume = n.v_gas + hidden.get("gas_volume") - area * FIXED.lead * x / (2.0 * math.pi * FIXED.r_drum)
    start = n.p_gas * (1.0 + hidden.get("precharge"))
    exponent = 1.0 + hidden.get("gas_polytropic")
    absolute = gas_pressure(volume, start, exponent, hidden.laws.get("gas_cooling", 1.0))
    return absolute * np.exp(-hidden.get("leaking_gas") * t / 100.0) - AIR


def _screw(twin: Twin, gauge: Signal, way: Signal) -> Signal:
    """Torque of the screw at the drum: thrust times lead, over the efficiency in payout, times it in haul-in. [N m]"""
    hidden, n = twin.hidden, twin.numbers
    forward, reverse = efficiencies(n.mu + hidden.get("screw_friction"))
    thrust = gauge * n.area * (1.0 + hidden.get("piston_area")) + hidden.get("seal_friction") * way
    return thrust * FIXED.lead / (2.0 * math.pi) * (0.5 * (1.0 + way) / forward + 0.5 * (1.0 - way) * reverse)


def _mesh(twin: Twin, x: Signal) -> Signal:
    """Factor on the torque that the gear needs: a worn one's goes up and down three times a turn of the drum. [1]"""
    ripple = twin.hidden.get("worn_gear")
    return 1.0 + ripple * np.cos(3.0 * x / FIXED.r_drum + twin.hidden.laws.get("phase", 0.0))


def _braking(twin: Twin, t: Signal, turned: Signal) -> Signal:
    """Torque of a brake that drags for a second or two and lets go again, in each log at other times. [N m]"""
    torque = twin.hidden.get("brake_drag")
    if torque == 0.0:
        return np.zeros(t.size)
    rng = np.random.default_rng([round(1e6 * twin.hidden.laws["phase"]), t.size])
    flips = np.cumsum(rng.exponential(1.6, size=int(t[-1])) + 0.5)
    return np.where(np.searchsorted(flips, t) % 2 == 1, torque * turned, 0.0)


def make_log(twin: Twin, log: str, rng: np.random.Generator) -> dict[str, Signal]:
    """Move the crane, follow it, and read the sensors: one log of a campaign."""
    x, v = line_motion(log, rng)
    resting = float(np.clip(rng.normal(RESTING_MEAN, RESTING), -0.9, 0.9))
    return read_log(twin, solve(twin, log, x, v, resting), rng)
