"""Runs of equal cycles without noise, whose channels may get an amplitude of their own in each
cycle.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from winchcascade.core.run import Run

Signal = NDArray[np.float64]
Channels = Mapping[str, Signal]

RATE, PERIOD, LENGTH = 50.0, 10.0, 3.0
"""Samples a second [Hz], seconds from cycle to cycle and in a window [s]."""

CORNERS = (
    (0.0, 0.0),
    (1.0, 0.0),
    (2.5, 0.8),
    (4.5, 0.8),
    (5.3, 0.0),
    (6.0, 0.0),
    (6.6, -1.1),
    (8.4, -1.1),
    (9.0, 0.0),
)
"""Ramp, plateau, ramp down, hold and haul-in of one cycle: time [s] and velocity [m/s]."""


def cycles_of(n: int) -> tuple[Signal, Channels]:
    """Make n equal cycles without noise: 1.7 kN, 200 N m, 100 V and 8 A on the plateau."""
    samples = round(PERIOD * RATE)
    t = np.arange(n * samples + 1) / RATE
    at, speed = np.array(CORNERS).T
    v = np.interp(t - PERIOD * np.floor(t / PERIOD + 1e-9), at, speed)
    out = np.maximum(v, 0.0) / 0.8
    haul = np.where(v < 0, 600.0, 0.0)
    channels = {
        "velocity": v,
        "force": 400.0 + 1300.0 * out**0.5 + haul,
        "torque": 200.0 * out**0.7,
        "vdc": 100.0 * out,
        "idc": 8.0 * out,
    }
    return t, channels


def amplified(channels: Channels, factors: Mapping[str, Signal]) -> Channels:
    """Multiply channels by a factor of their own in each cycle."""
    samples = round(PERIOD * RATE)

    def by_cycle(k: Signal) -> Signal:
        return np.append(np.repeat(k, samples), k[-1])

    return {
        name: x * by_cycle(factors[name]) if name in factors else x for name, x in channels.items()
    }


def run_of(t: Signal, channels: Channels) -> Run:
    return Run("invented", t, channels, RATE, t.size, load=12.5)
