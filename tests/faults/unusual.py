"""Clean logs of the twin that no other set has: other rigs in other units of nature, motions, loads,
rates and channels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from fault_logs import NOISE, STEPS, Result, Signal, found, stroke_velocity
from injected import Rng, log_uniform
from msgspec.structs import replace
from similar import Nature, scaled_rig

from winchcascade import Rig, WinchcascadeError, read_run, reduce, simulate
from winchcascade.core.channels import CHANNELS
from winchcascade.core.quantity import Quantity
from winchcascade.core.rig_toml import built_in

SEED = 521905
LOGS = 100
FINE = 200.0
"""Rate of the simulation at the time scale of the paper's rig. [Hz]"""

UNITS = {
    "displacement": "m", "velocity": "m/s", "pressure": "Pa", "force": "N", "torque": "N.m", "vdc": "V", "idc": "A",
}  # fmt: skip
LEFT_OUT = ("displacement", "pressure", "force", "torque", "velocity")
HERE = Nature(1.0, 1.0, 1.0, 1.0)
PRESSURE = 98066.5
"""Unit in which the logger writes the pressure. [Pa]"""


class Unusual(NamedTuple):
    """A log as a logger wrote it, the same without noise at a high rate, how both are read, and the
    logged channels in the units of the paper's rig."""

    name: str
    logged: pd.DataFrame
    fine: pd.DataFrame
    rig: Rig
    load: float
    window: str
    channels: Mapping[str, Signal]

    def result(self, table: pd.DataFrame) -> Result:
        """Read and reduce one of both tables."""
        try:
            run = read_run(table, load=self.load, rig=self.rig)
            return found(reduce(run, window=self.window))
        except WinchcascadeError as fault:
            return Result({}, 0, (), rejected=str(fault))


def machine(rng: Rng) -> Rig:
    """The paper's rig with another shaft, rotor, mesh, capacitor and screw."""

    def times(number: Quantity | None, factor: float) -> Quantity:
        assert number is not None
        return replace(number, value=number.value * factor)

    rig = built_in()
    drivetrain = replace(
        rig.drivetrain,
        k_shaft=times(rig.drivetrain.k_shaft, log_uniform(rng, 0.3, 4.0)),
        inertia_rotor=times(rig.drivetrain.inertia_rotor, log_uniform(rng, 0.3, 3.0)),
        eta_mesh=times(rig.drivetrain.eta_mesh, rng.uniform(0.85, 1.03)),
    )
    link = replace(rig.dc_link, c_dc=times(rig.dc_link.c_dc, log_uniform(rng, 0.1, 4.0)))
    screw = replace(
        rig.restoring, mu_screw=times(rig.restoring.mu_screw, log_uniform(rng, 0.5, 1.3))
    )
    return replace(rig, drivetrain=drivetrain, dc_link=link, restoring=screw)


def motion(rng: Rng, load: float) -> tuple[Signal, Signal, str]:
    """One to six strokes, also of different lengths and speeds, rounded ones, and waves on them."""
    speed = log_uniform(rng, 0.1, min(2.0, 0.45 + 0.03 * min(load, 60.0)))
    acceleration = log_uniform(rng, max(0.1, speed**2 / 1.8), 8.0)
    length = rng.uniform(2.0, 8.5) if rng.random() < 0.6 else 2.0
    uneven = rng.random() < 0.25
    cycles = [
        (
            length * (rng.uniform(0.7, 1.0) if uneven else 1.0),
            speed * (rng.uniform(0.6, 1.0) if uneven else rng.uniform(0.98, 1.02)),
            acceleration,
            0.0,
        )
        for _ in range(rng.integers(1, 7))
    ]
    t, v = stroke_velocity(cycles, FINE)
    if rng.random() < 0.4:
        corner = np.hanning(int(FINE * log_uniform(rng, 0.1, 1.0)) + 5)
        v = np.convolve(v, corner / corner.sum(), "same")
    if rng.random() < 0.25:
        waves = np.sin(2.0 * np.pi * rng.uniform(0.2, 1.5) * t)
        v = v * (1.0 + rng.uniform(0.01, 0.08) * waves)
    what = f"{speed:.2f} m/s, {acceleration:.2f} m/s2, {length:.1f} m x {len(cycles)}"
    return t, v, what + ", uneven" * uneven


def unusual(k: int) -> Unusual:
    """The log of this number."""
    rng = np.random.default_rng([SEED, k])
    rig, nature = machine(rng) if k % 2 else built_in(), HERE
    if k % 4 > 1:
        ends = (0.1, 5.0), (0.35, 3.0), (0.02, 40.0), (0.3, 6.0)
        nature = Nature(*(log_uniform(rng, *end) for end in ends))
    load = log_uniform(rng, 3.5, 90.0) if rng.random() < 0.93 else np.inf
    rate = float(rng.choice([5.0, 10.0, 20.0, 25.0, 40.0, 50.0, 100.0, 200.0]))
    t, v, what = motion(rng, load)
    window, stated = str(rng.choice(["auto", "payout"])), bool(rng.random() < 0.7)
    left_out = str(rng.choice(LEFT_OUT)) if rng.random() < 0.3 else ""

    t, ohm = t * nature.time, load * nature.of("resistance")
    start = pd.DataFrame({"time_s": t, "velocity_mps": v * nature.of("velocity")})
    own = scaled_rig(rig, nature, stated=True)
    simulated = dict(simulate(read_run(start, load=ohm, rig=own, repairs="off")).run.channels)
    simulated["velocity"] = np.gradient(simulated["displacement"], t)  # the twin rounds corners
    stamps = t[:: round(FINE / rate)]
    fine, logged, channels = {"Time (s)": t}, {"Time (s)": stamps}, {}
    for name, unit in UNITS.items():
        if name != left_out:
            header, size = f"{name} ({unit})", nature.of(CHANNELS[name].dimension)
            logger = PRESSURE if name == "pressure" else 1.0
            noise = NOISE.get(name, 0.0) * rng.standard_normal(stamps.size)
            x = simulated[name][:: round(FINE / rate)] / (size * logger) + noise
            channels[name] = np.round(x / STEPS[name]) * STEPS[name]
            fine[header], logged[header] = simulated[name], size * logger * channels[name]
    factors = ", ".join(f"{factor:.2g}" for factor in nature)
    name = (
        f"{k}: {what}, {load:.3g} ohm, {rate:g} Hz, {window}, length, time, force and voltage "
        f"times {factors}, without {left_out or 'none'}"
    )
    seen = scaled_rig(rig, nature, stated=stated)
    return Unusual(name, pd.DataFrame(logged), pd.DataFrame(fine), seen, ohm, window, channels)


def unusual_rigs() -> Iterator[tuple[str, Result, Result | None, Mapping[str, Signal]]]:
    """All of these logs, each with its result, that of the same motion at a high rate, and its
    channels in the units of the paper's rig."""
    for k in range(LOGS):
        log = unusual(k)
        yield log.name, log.result(log.logged), log.result(log.fine), log.channels
