"""What the logger of a twin writes: readings of the sensors with their gains, zeros, noise,
resolution, lag and nonlinearity, of a tether that rings.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from winchcascade.blind.crane_motion import smooth_noise
from winchcascade.blind.drive import GRID
from winchcascade.blind.injected import Hidden
from winchcascade.blind.twin import Solved, Twin, taut
from winchcascade.blind.twin_numbers import (  # fmt: skip
    CRANE_LOGGER,
    SENSORS,
    VELOCITY_NOISE,
    VELOCITY_STEP,
    Logger,
)
from winchcascade.core.run import Signal

_WINDOW = 5
"""Number of intervals on either side of a stamp over which a reading is averaged."""


TETHER_HZ, TETHER_DAMPING, TETHER_MASS = 2.2, 0.12, 3.0
"""Ringing of the tether after a jerk: frequency, damping ratio, and force over the acceleration
that it lags behind. [Hz, 1, kg]"""


TETHER_NOISE, TETHER_WIDTH = 3.4, 0.14
"""Other noise of the tether: standard deviation, and width of the bell curve that smooths it.
[N, s]
"""


def read_log(
    twin: Twin, solved: Solved, rng: np.random.Generator, logger: Logger
) -> dict[str, Signal]:
    """Readings of the sensors for one log, by channel in the units of the log, with `time`."""
    stamps, delay = stamps_of(solved, logger), twin.hidden.get("elastic_encoder")
    grid = np.arange(solved.x.size, dtype=np.float64) * GRID
    x, v = (
        _follow(y, delay) if delay else y for y in (solved.x, solved.v)
    )  # behind an elastic drive
    columns = {
        "time": np.round(stamps, logger.decimals_time),
        "displacement": np.round(np.interp(stamps, grid, x), logger.decimals(4)),
        "velocity": _stepped(
            np.interp(stamps, grid, v)
            + rng.normal(0.0, VELOCITY_NOISE * logger.noise, stamps.size),
            logger.step(VELOCITY_STEP),
            logger.decimals(3),
        ),
    }
    tether = TETHER_NOISE * logger.noise * smooth_noise(solved.t.size, TETHER_WIDTH, rng)
    for name, value in noiseless(twin, solved, stamps).items():
        sensor = SENSORS[name]
        swaying = np.interp(stamps, solved.t, tether) if name == "force" else 0.0
        noise = (
            rng.normal(0.0, sensor.zero)
            + rng.normal(0.0, sensor.noise * logger.noise, stamps.size)
            + swaying
        )
        columns[name] = _stepped(
            value + noise, logger.step(sensor.step), logger.decimals(sensor.decimals)
        )
    return columns


def stamps_of(solved: Solved, logger: Logger = CRANE_LOGGER) -> Signal:
    """Stamps of the log of a solved motion. [s]"""
    return np.arange(0.0, solved.t[-1] - 0.01, logger.interval)


_SENSOR_EFFECTS = {
    "pressure": ("pressure_gain", "", ""),
    "force": ("force_gain", "late_force", "force_zero"),
    "torque": ("torque_gain", "", ""),
    "vdc": ("voltage_gain", "electrical_lag", ""),
    "idc": ("current_gain", "electrical_lag", ""),
}
"""Effects and outsiders that give the sensor of a channel a gain, a delay and a zero."""


def noiseless(twin: Twin, solved: Solved, stamps: Signal) -> dict[str, Signal]:
    """Readings of the sensors without zeros, noise and resolution, by channel in the units of
    the log.
    """
    found = {}
    for name, sensor in SENSORS.items():
        if name not in solved.channels:
            continue
        true = solved.channels[name]
        if name == "force":
            true = taut(twin, true - TETHER_MASS * ring(np.diff(solved.v) / GRID))
        gain, delay, zero = map(twin.hidden.get, _SENSOR_EFFECTS[name])
        value = np.interp(stamps - delay, solved.t, _averaged(true)) / sensor.unit
        reading = value * twin.gains[name] * (1.0 + gain) + _distortion(twin.hidden, name, value)
        found[name] = reading + zero + twin.zeros.get(name, 0.0)
    return found


def _distortion(hidden: Hidden, name: str, value: Signal) -> Signal | float:
    """Error of a sensor by a law that is not in the catalogue, in the unit of the log."""
    if name == "torque":
        return -hidden.get("curved_torque") * value * np.abs(value) / 500.0
    if name == "idc":
        return -hidden.get("saturated_current") * 15.0 * (np.maximum(value - 5.0, 0.0) / 10.0) ** 2
    return _play(value, hidden.get("pressure_play")) - value if name == "pressure" else 0.0


def _play(value: Signal, width: float) -> Signal:
    """A reading behind a play of half a width to either side."""
    out = np.empty(value.size)
    now = value[0]
    for k, here in enumerate(value):
        now = min(max(now, here - 0.5 * width), here + 0.5 * width)
        out[k] = now
    return out


def _follow(value: Signal, delay: float) -> Signal:
    """A first-order lag on the grid, starting at rest."""
    fade = math.exp(-GRID / delay)
    lagging: Signal = lfilter([1.0 - fade], [1.0, -fade], value, zi=[fade * value[0]])[0]
    return lagging


def _averaged(value: Signal) -> Signal:
    """Mean over the intervals around each, as by the filter of a sensor."""
    box = np.ones(2 * _WINDOW + 1)
    return np.convolve(value, box, "same") / np.convolve(np.ones(value.size), box, "same")


def ring(pull: Signal) -> Signal:
    """Acceleration of the line less that of a lightly damped mass on the tether. [m/s2]

    The mass follows by d2h/dt2 = w^2 (pull - h) - 2 d w dh/dt, stepped on the grid by the
    semi-implicit rule of Euler.
    """
    turn = 2.0 * math.pi * TETHER_HZ * GRID
    keeps = 1.0 - 2.0 * TETHER_DAMPING * turn
    return pull - lfilter([turn**2], [1.0, turn**2 - 1.0 - keeps, keeps], pull)


def _stepped(value: Signal, step: float, decimals: int) -> Signal:
    return np.round(np.round(value / step) * step, decimals)
