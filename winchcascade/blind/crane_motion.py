"""The motion of a crane that moves the line in payout, hold and haul-in, three times in a log, no
two alike.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from winchcascade.blind.drive import GRID
from winchcascade.blind.twin_numbers import (  # fmt: skip
    CRANE,
    Crane,
)
from winchcascade.core.run import Signal

CYCLES = 3
"""Cycles of a log."""


SPEED = {
    "open_circuit": 1.015, "r45ohm": 1.015, "r36ohm": 1.015, "r27ohm": 0.966, "r18ohm": 0.864, "r9ohm": 0.509,
    "r4p5ohm": 0.305,
}  # fmt: skip
"""Plateau of the payout by log, as in logs of the crane, which is slower against a heavy load.
[m/s]
"""


GUST, GUST_WIDTH = 0.0046, 0.085
"""Wobble of the speed: standard deviation as a share, and width of the bell curve that smooths
it. [1, s]
"""


_LEAD_IN, _SPREAD = 4.0, 0.01
"""Rest before the first cycle [s]; scatter of the plateaus from log to log, and from cycle to
cycle [1].
"""


def line_motion(log: str, rng: np.random.Generator, crane: Crane = CRANE) -> tuple[Signal, Signal]:
    """Draw the motion of one log on the grid of the twin.

    Returns
    -------
    x, v : (n + 1,) payout and its rate at the ends of the intervals, starting at rest [m, m/s]
    """
    legs = [np.zeros(round(_LEAD_IN / GRID))]
    top = SPEED[log] * (1.0 + _SPREAD * rng.standard_normal())
    ramp, shape = rng.normal(4.55, 0.22) * crane.ramp, rng.normal(1.0, 0.06)
    length, back = rng.normal(9.59, 0.05) * crane.stroke, rng.normal(1.255, 0.028) * crane.back
    hold, rest = rng.uniform(4.2, 6.9) * crane.wait, rng.uniform(4.3, 7.2) * crane.wait
    for _ in range(CYCLES):
        here = length + rng.normal(0.0, 0.02) * crane.stroke
        payout = top * (1.0 + _SPREAD * rng.standard_normal())
        rise = ramp * (1.0 + 0.02 * rng.standard_normal())
        legs.append(payout * _leg(here / payout, rise, 0.355 * rise, shape))
        legs.append(np.zeros(round((hold + rng.normal(0.0, 0.2) * crane.wait) / GRID)))
        haul = back * (1.0 + 0.008 * rng.standard_normal())
        travel = here + rng.normal(0.0, 0.012) * crane.stroke
        legs.append(-haul * _leg(travel / haul, 2.0 * crane.stroke, 0.8 * crane.stroke, 1.0))
        legs.append(np.zeros(round((rest + rng.normal(0.0, 0.3) * crane.wait) / GRID)))
    v = np.concatenate([*legs, [0.0]])
    v = v * (1.0 + GUST * smooth_noise(v.size, GUST_WIDTH, rng))
    return np.concatenate([[0.0], np.cumsum(0.5 * GRID * (v[1:] + v[:-1]))]), v


def _leg(length: float, rise: float, fall: float, shape: float) -> Signal:
    """A speed of plateau 1 that covers a length: up in a time, a plateau, down in a time. [1]"""
    up, down = _rise(rise, shape), _rise(fall, 1.0)[::-1]
    flat = max(length - GRID * (np.sum(up) + np.sum(down)), 0.0)
    return np.concatenate([up, np.ones(round(flat / GRID)), down])


def _rise(duration: float, shape: float) -> Signal:
    """From 0 to 1 in a time, with no jerk at either end; a shape above 1 begins later. [1]"""
    ramp: Signal = (np.arange(round(duration / GRID), dtype=np.float64) * GRID / duration) ** shape
    return ramp * ramp * (3.0 - 2.0 * ramp)


def smooth_noise(size: int, width: float, rng: np.random.Generator) -> Signal:
    """Noise of unit variance, smoothed by a bell curve of a standard deviation in seconds,
    (size,).
    """
    half_width = round(4.0 * width / GRID)
    bell = np.exp(-0.5 * (np.arange(-half_width, half_width + 1) * GRID / width) ** 2)
    smooth: Signal = fftconvolve(rng.standard_normal(size + 2 * half_width), bell, "valid")
    return smooth / float(np.sqrt(np.sum(bell**2)))


RESTING, RESTING_MEAN = 0.22, -0.06
"""Friction at rest lies between its values in the two directions, -1 and 1: scatter from log to
log, and mean. [1]
"""


def draw_motion(
    log: str, rng: np.random.Generator, crane: Crane = CRANE
) -> tuple[Signal, Signal, float]:
    """Draw the motion of one log, and where friction holds at rest; see `solve_twin`."""
    x, v = line_motion(log, rng, crane)
    return x, v, float(np.clip(rng.normal(RESTING_MEAN, RESTING), -0.9, 0.9))
