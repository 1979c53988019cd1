"""Payouts that a published row may have been measured on, and what a model gives out along them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.run import Run
from winchcascade.rig.simulate import LineMotion, motion_of, simulate_along

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.rig.parts import Model

Reduce = Callable[[Run, float | None], Mapping[str, float | None]]
"""Reduces a log over windows of a length [s], or by the rig's own rule without one, to its nine metrics, SI units."""

RATE = 25.0
"""Samples of a payout in a second. [Hz]"""

STEP = 1e-3
"""Step of these simulations: half of it changes no efficiency by more than 0.0001. [s]"""

REST, FLAT, BRAKE = 1.0, 0.5, 0.6
"""Before the ramp, between window and braking, and braking. [s]"""

RAMPS = (0.6, 0.25, 0.95)
"""How long the line speeds up, as shares of the window; the first is the middle one. [1]"""

OPEN_RAMPS = (3.0, 1.0, 6.0)
"""How long it does where no window is known. [s]"""

SHAPES: tuple[Literal["smooth", "straight"], ...] = ("smooth", "straight")
"""How it speeds up: as 3 u^2 - 2 u^3, or evenly."""

STARTED = 1.0
"""Payout at the start where the haul-in before has left some of the line out. [m]"""

CLOSE = 2e-3
"""A printed power is met within this share, which moves no efficiency by 0.0001. [1]"""

NEAR, APART = 0.015, 0.25
"""Of two payouts whose powers are no further apart, and one of them as near to the printed one, a straight line gives the
efficiencies to 0.0001. Logarithms of powers. [1]"""

SLOPE = 1.85
"""Powers grow about with such a power of the speed. [1]"""

FASTEST = 20.0
"""No line is pulled faster. [m/s]"""

TRIES = 12


class Payout(msgspec.Struct, frozen=True):
    """One payout: how long the line speeds up [s] and by which curve, what is paid out at its start [m], the window [s] and the
    speed at which that begins [m/s].
    """

    ramp: float
    shape: Literal["smooth", "straight"]
    start: float
    window: float | None
    v_onset: float


class PayoutMetrics(msgspec.Struct, frozen=True):
    """What a model gives out along a payout of some plateau speed [m/s]: the nine metrics, SI units."""

    speed: float
    metrics: Mapping[str, float | None]


class Target(msgspec.Struct, frozen=True):
    """A printed power or energy that a payout has to give, SI units."""

    metric: str
    value: float


def payouts(window: float | None, v_onset: float) -> tuple[Payout, ...]:
    """Payouts that are plausible for a window, the middle one first."""
    ramps = [window * share for share in RAMPS] if window is not None else OPEN_RAMPS
    fresh = [Payout(ramp, shape, 0.0, window, v_onset) for shape in SHAPES for ramp in ramps]
    return (*fresh, *(Payout(ramp, "smooth", STARTED, window, v_onset) for ramp in ramps))


def drive(payout: Payout, speed: float, load: float) -> tuple[Run, LineMotion]:
    """A log of one payout (rest, ramp, plateau past the end of the window, braking) and the motion that drives a model."""
    u = np.linspace(0.0, 1.0, 101)
    onset = float(np.interp(payout.v_onset / speed, _rise(payout, u), u))
    unit = _unit(payout, math.ceil(10.0 * onset) / 10.0)
    x, v = payout.start + speed * unit.x, speed * unit.v
    run = Run(
        "a payout", unit.t, {"displacement": x, "velocity": v}, RATE, unit.t.size, load=load, load_source="the table"
    )
    of = unit.motion
    motion = msgspec.structs.replace(of, x=payout.start + speed * of.x, v=speed * of.v, a=speed * of.a)
    return run, motion


def _rise(payout: Payout, u: Signal) -> Signal:
    """Speed along the ramp, 0 to 1 over 0 to 1."""
    return u if payout.shape == "straight" else u * u * (3.0 - 2.0 * u)


class _Unit(msgspec.Struct, frozen=True):
    """A payout at a plateau speed of 1 m/s, at the stamps and at the simulation's steps: all that moves is in proportion."""

    t: Signal
    x: Signal
    v: Signal
    motion: LineMotion


@lru_cache(maxsize=256)
def _unit(payout: Payout, onset: float) -> _Unit:
    """Make a payout of 1 m/s whose window begins after such a share of the ramp."""
    flat = REST + max(payout.ramp, onset * payout.ramp + (payout.window or payout.ramp + 1.0)) + FLAT
    t = np.arange(0.0, flat + BRAKE + FLAT, 1.0 / RATE)
    v = _rise(payout, np.clip((t - REST) / payout.ramp, 0.0, 1.0)) * (1.0 - np.clip((t - flat) / BRAKE, 0.0, 1.0))
    x = np.concatenate(([0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) / RATE)))
    run = Run("a payout", t, {"displacement": x, "velocity": v}, RATE, t.size)
    return _Unit(t, x, v, motion_of(run, STEP))


def measure(
    reduce: Reduce, model: Model, payout: Payout, speed: float, load: float
) -> Mapping[str, float | None] | None:
    """The nine metrics of a model along a payout; None where the model cannot follow it."""
    run, motion = drive(payout, speed, load)
    try:
        return reduce(simulate_along(run, model, motion).run, payout.window)
    except WinchcascadeError:
        return None


def meet(
    reduce: Reduce, model: Model, payout: Payout, load: float, target: Target, guess: float
) -> PayoutMetrics | None:
    """Find the plateau speed at which a payout gives a printed power or energy; None where none does.

    Parameters
    ----------
    guess : of the speed [m/s]
    """
    speed, before = guess, None
    for _ in range(TRIES):
        found = measure(reduce, model, payout, speed, load)
        if found is None:
            return None
        value = found[target.metric]
        if value is None or value <= 0.0:
            speed, before = 2.0 * speed, None
        else:
            here = PayoutMetrics(speed, found)
            miss, slope = math.log(target.value / value), SLOPE
            if abs(miss) < CLOSE:
                return here
            if before is not None and before[1].speed != speed:
                rise = math.log(value) - before[0]
                if abs(miss) < NEAR and abs(miss) < abs(rise) < APART:
                    return _between(before[1], here, miss / rise)
                slope = rise / (math.log(speed) - math.log(before[1].speed))
            before = (math.log(value), here)
            speed *= math.exp(min(max(miss / min(max(slope, 0.5), 4.0), -1.0), 1.0))
        if speed > FASTEST:
            return None
    return None


def _between(one: PayoutMetrics, other: PayoutMetrics, further: float) -> PayoutMetrics:
    """A point so much further than from the one to the other; efficiencies bend too little over that to matter."""
    metrics = {
        name: None
        if value is None or one.metrics[name] is None
        else value + further * (value - (one.metrics[name] or 0.0))
        for name, value in other.metrics.items()
    }
    return PayoutMetrics(other.speed + further * (other.speed - one.speed), metrics)
