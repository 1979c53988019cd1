"""What the sensors of a twin write: gains, zeros, noise, resolution, the ringing of the tether, late and bent readings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit

from winchcascade.blind.crane import smooth_noise
from winchcascade.blind.drive import GRID
from winchcascade.blind.numbers import SENSORS, VELOCITY_NOISE, VELOCITY_STEP

if TYPE_CHECKING:
    from winchcascade.blind.hidden import Hidden
    from winchcascade.blind.twin import Solved, Twin
    from winchcascade.run import Signal

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
