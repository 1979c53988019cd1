"""Logs of a winch with known mass, friction and drag, made from the same balance of power, with noise of their own."""

from __future__ import annotations

import numpy as np

from winchcascade.core.run import Run
from winchcascade.rig.open_rig import load_rig

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
    """A log in SI units. `other` is a power that no suspect takes, `noise` one standard deviation of the power [W],
    `v_noise` of the velocity [m/s]."""
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
