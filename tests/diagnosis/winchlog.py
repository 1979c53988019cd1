"""Logs of a winch with known mass, friction and drag, made from the same balance of power, with
noise of their own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from winchcascade.core.run import Mask, Run, Signal
from winchcascade.rig.baseline import load_rig

RIG = load_rig("kitepower")

CYCLE = 60.0
"""Length of a planted cycle: reel-out, then haul-in twice as fast. [s]"""


def planted(
    seed: int,
    *,
    cycles: int = 10,
    mass: float = 0.0,
    friction: float = 0.0,
    drag: float = 0.0,
    gain: float = 0.0,
    zero: float = 0.0,
    other: float = 0.0,
    noise: float = 200.0,
    v_noise: float = 0.002,
    fs: float = 10.0,
) -> Run:
    """A log in SI units. `other` is a power that no suspect takes, `noise` one standard deviation
    of the power [W], `v_noise` of the velocity [m/s]."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, cycles * CYCLE, 1.0 / fs)
    v, a, pull = np.zeros(t.size), np.zeros(t.size), np.full(t.size, 2500.0)
    for k in range(cycles):
        speeds = 1.2 * rng.uniform(0.7, 1.3), 3.0 * rng.uniform(0.8, 1.2)
        for begin, end, top in (
            (k * CYCLE, k * CYCLE + 40.0, speeds[0]),
            (k * CYCLE + 40.0, (k + 1) * CYCLE, -speeds[1]),
        ):
            inside = (t >= begin) & (t < end)
            angle = 2.0 * np.pi * (t[inside] - begin) / (end - begin)
            v[inside] = top * 0.5 * (1.0 - np.cos(angle))
            a[inside] = top * np.pi / (end - begin) * np.sin(angle)
    for period in (2.7, 4.1, 7.3):  # gusts
        phase, size = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.1, 0.3)
        v += 0.2 * size * np.sin(2.0 * np.pi * t / period + phase)
        a += 0.2 * size * 2.0 * np.pi / period * np.cos(2.0 * np.pi * t / period + phase)
        pull += 900.0 * rng.uniform(0.5, 1.0) * np.sin(2.0 * np.pi * t / (5.0 * period) + phase)
    power = v * (pull - mass * a - friction * np.sign(v) - drag * v) - other
    channels = {
        "velocity": v + rng.normal(0.0, v_noise, t.size),
        "force": (1.0 + gain) * pull + zero + rng.normal(0.0, 5.0, t.size),
        "power_mech": power + rng.normal(0.0, noise, t.size),
    }
    return Run(name="planted.csv", t=t, channels=channels, fs=fs, samples=t.size, sha256="0" * 64)


class RandomWinch(NamedTuple):
    """A winch with random numbers, SI units of the line: what acts, by effect, and the share of
    power that each takes at most.

    `size` is the larger one of its shares of the energy of all payouts and of all haul-ins at the
    line or, of the inertia, of the root mean square of the power.
    """

    run: Run
    numbers: dict[str, float]
    size: dict[str, float]
    drift: float


def random_winch(seed: int) -> RandomWinch:
    """Draw a winch and log it at 10 Hz.

    Reel-outs at a high and haul-ins at a low tension, with gusts, holds, sometimes hours of rest;
    the losses of some winches change by up to 40 % from the first cycle to the last. The tension at
    the drum follows from that of the line exactly, and the force cell errs last, so that no number
    is linear in the fit's own way.
    """
    rng = np.random.default_rng(seed)
    t, v, pull, rest = _motion_of_cycles(rng, int(rng.integers(8, 16)), hours=rng.random() < 0.25)
    a = np.gradient(v, t)
    kinds = {
        "drum_inertia": (0.8, 500.0, 6000.0), "line_friction": (0.5, 100.0, 800.0), "line_drag": (0.5, 50.0, 400.0),
        "load_proportional_loss": (0.25, 0.02, 0.12), "force_gain": (0.25, 0.02, 0.1), "force_zero": (0.25, 30.0, 150.0),
    }  # fmt: skip
    numbers = {
        name: float(rng.uniform(low, high))
        for name, (p, low, high) in kinds.items()
        if rng.random() < p
    }
    for name in ("force_gain", "force_zero"):
        if name in numbers:
            numbers[name] *= float(rng.choice([-1.0, 1.0]))
    drift = float(rng.uniform(-0.4, 0.4)) if rng.random() < 0.25 else 0.0
    now, share = 1.0 + drift * t / t[-1], numbers.get("load_proportional_loss", 0.0)
    moves = np.tanh(v / 0.01)
    kept = np.where(v > 0.0, 1.0 - share * now, 1.0 / (1.0 - share * now))
    taken = {
        "drum_inertia": numbers.get("drum_inertia", 0.0) * a * v,
        "line_friction": now * numbers.get("line_friction", 0.0) * moves * v,
        "line_drag": now * numbers.get("line_drag", 0.0) * v**2,
        "load_proportional_loss": v * pull * (1.0 - kept),
        "force_gain": numbers.get("force_gain", 0.0) * pull * v,
        "force_zero": numbers.get("force_zero", 0.0) * v,
    }
    power = v * pull - sum(taken[name] for name in kinds if not name.startswith("force"))
    sides = [(v > 0.05) & ~rest, (v < -0.05) & ~rest]
    size = {
        name: max(abs(float(taken[name][side].sum() / (v * pull)[side].sum())) for side in sides)
        if name != "drum_inertia"
        else float(np.sqrt(np.mean(taken[name] ** 2) / np.mean((v * pull) ** 2)))
        for name in numbers
    }
    slow = np.zeros(
        t.size
    )  # what the balance lacks: a share of the power that wanders within some twenty seconds
    if rng.random() < 0.5:
        kicks = rng.normal(0.0, math.sqrt(2.0 * 0.1 / 20.0), t.size)
        slow = 10.0 ** rng.uniform(-2.5, -1.3) * lfilter([1.0], [1.0, -(1.0 - 0.1 / 20.0)], kicks)
    noise, v_noise = 10.0 ** rng.uniform(1.0, 3.0), 10.0 ** rng.uniform(-3.0, -2.0)
    channels = {
        "velocity": v + rng.normal(0.0, v_noise, t.size),
        "force": (1.0 + numbers.get("force_gain", 0.0)) * pull
        + numbers.get("force_zero", 0.0)
        + rng.normal(0.0, 10.0, t.size),
        "power_mech": power * (1.0 + slow) + rng.normal(0.0, noise, t.size),
    }
    run = Run(
        name="random.csv", t=t, channels=channels, fs=10.0, samples=t.size, sha256=f"{seed:064d}"
    )
    return RandomWinch(run, numbers, size, drift)


def _motion_of_cycles(
    rng: np.random.Generator, cycles: int, *, hours: bool
) -> tuple[Signal, Signal, Signal, Mask]:
    """Stamps, line velocity and tension, and where the winch rests."""
    speeds, pulls = list[Signal](), list[Signal]()
    for _ in range(cycles):
        out, back = rng.uniform(60.0, 150.0), rng.uniform(0.25, 0.5)
        top, fast = rng.uniform(0.7, 1.8), rng.uniform(2.0, 5.0)
        for length, speed, tension in (
            (rng.uniform(5.0, 20.0), 0.0, 800.0), (out, top, rng.uniform(1500.0, 4000.0)),
            (rng.uniform(2.0, 10.0), 0.0, 1000.0), (back * out, -fast, rng.uniform(300.0, 1500.0)),
        ):  # fmt: skip
            t = np.arange(0.0, length, 0.1)
            gust = 0.15 * np.sin(2.0 * np.pi * t / rng.uniform(10.0, 40.0) + rng.uniform(0.0, 6.0))
            slow = 0.3 * np.sin(2.0 * np.pi * t / rng.uniform(15.0, 60.0) + rng.uniform(0.0, 6.0))
            speeds.append(speed * (1.0 + gust))
            pulls.append(tension * (1.0 + slow))
    still = np.zeros(rng.integers(36000, 72000) if hours else 600)
    ramp = np.hanning(26) / np.hanning(26).sum()  # motions begin and end within two seconds
    v: Signal = np.convolve(np.concatenate([*speeds, still]), ramp, mode="same").astype(np.float64)
    pull: Signal = np.convolve(np.concatenate([*pulls, still + 800.0]), ramp, mode="same").astype(
        np.float64
    )
    return np.arange(v.size) / 10.0, v, pull, np.abs(v) < 0.05
