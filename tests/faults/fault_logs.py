"""Logs without a fault: fixture logs at any rate, benches without a line, logs of the twin; and
what reading one gives.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

import winchcascade
from winchcascade import WinchcascadeError, load_rig, open_campaign, read_run, reduce, simulate

Signal = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
CAMPAIGN = ROOT / "fixtures" / "campaign"

HEADERS = {
    "time": "Time (s)",
    "displacement": "Displacement (m)",
    "velocity": "Velocity (m/s)",
    "pressure": "Pressure (kg/cm2)",
    "force": "Force (N)",
    "torque": "Torque (N.m)",
    "vdc": "Vdc (V)",
    "idc": "Idc (A)",
    "speed": "Speed (rpm)",
}
"""Columns of a log, by channel."""

NOISE = {
    "velocity": 0.003,
    "pressure": 0.01,
    "force": 5.0,
    "torque": 0.4,
    "vdc": 0.26,
    "idc": 0.015,
    "speed": 2.0,
}
"""Standard deviation of each channel at rest in the fixture logs, in the unit of the file."""

STEPS = {
    "displacement": 0.0002, "velocity": 0.002, "pressure": 0.001, "force": 1.961, "torque": 0.01, "vdc": 0.01, "idc": 0.001,
    "speed": 0.1,
}  # fmt: skip
"""Resolution of each channel in the fixture logs, in the unit of the file."""

ADDED = 0.7
"""Share of a channel's noise that is added after interpolation to a higher rate: interpolated
noise keeps the rest.
"""

LOADS = {"r4p5ohm": (4.5, 5.96), "r18ohm": (18.0, 5.96), "r36ohm": (36.0, 5.48)}
"""Load [ohm] and window [s] of three fixture logs, as in their campaign.toml."""

BENCH_RIG = """name = "bench"
[cascade]
stages = ["mech", "gen"]
[phases]
from = "steps"
[columns]
speed = { name = "Speed", unit = "rpm", side = "shaft" }
"""

METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen")


class Finding(NamedTuple):
    """What a test asks of a finding; times on the clock of the log. [s]"""

    kind: str
    channel: str | None
    message: str
    start: float | None
    end: float | None


class Result(NamedTuple):
    """What reading and reducing a log gave: means by metric, complete cycles, findings, load
    [ohm]; or why it was rejected.
    """

    mean: Mapping[str, float | None]
    cycles: int
    findings: tuple[Finding, ...]
    load: float | None = None
    rejected: str = ""


@dataclass(frozen=True, eq=False)
class Log:
    """A log as a table, columns by channel in the unit of the file, and how it is read.

    `rig` is the text of a rig file, "" for that of the paper; `write` makes a file in a folder from
    the table with its headers, without it the table is read as a DataFrame. What it makes may be
    the folder of a campaign, which is reduced as a whole.
    """

    name: str
    rate: float
    table: pd.DataFrame
    load: float | None
    window: float | str | None = None
    rig: str = ""
    headers: Mapping[str, str] = field(default_factory=lambda: HEADERS)
    write: Callable[[pd.DataFrame, Path], Path] | None = None

    @property
    def t(self) -> Signal:
        """Stamps. [s]"""
        return self["time"]

    @property
    def step(self) -> float:
        """Sampling interval. [s]"""
        return 1.0 / self.rate

    def __getitem__(self, channel: str) -> Signal:
        return np.asarray(self.table[channel], dtype=np.float64)

    def changed(self, **columns: Signal) -> Log:
        """Replace columns."""
        return replace(self, table=self.table.assign(**columns))

    def rows(self, keep: NDArray[np.intp]) -> Log:
        """Take rows in an order."""
        return replace(self, table=self.table.iloc[keep].reset_index(drop=True))

    def frame(self) -> pd.DataFrame:
        """The table with the headers of the file."""
        return self.table.rename(columns=dict(self.headers))


def result(log: Log) -> Result:
    """Read and reduce a log through the public functions."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        source = log.frame() if log.write is None else log.write(log.frame(), Path(folder))
        try:
            if isinstance(source, Path) and source.is_dir():
                return found_in_campaign(open_campaign(source).reduce())
            return found(
                reduce(read_run(source, load=log.load, rig=rig_of(log.rig)), window=log.window)
            )
        except WinchcascadeError as fault:
            return Result({}, 0, (), rejected=str(fault))


def found(reduction: winchcascade.Reduction) -> Result:
    """Take from a reduction what the JSON has under `mean`, `cycles` and `quality`."""
    findings = (Finding(f.kind, f.channel, f.message, f.start, f.end) for f in reduction.quality)
    cycles = sum(cycle.complete for cycle in reduction.cycles)
    mean = {m: getattr(reduction.mean, m, None) for m in METRICS}
    return Result(mean, cycles, tuple(findings), reduction.run.load)


def found_in_campaign(reduction: winchcascade.CampaignReduction) -> Result:
    """Take the findings of all runs of a campaign, and those of one run beside the others."""
    single = [finding for record in reduction.records.values() for finding in record.quality]
    between = [finding for _, finding in reduction.summary.between]
    findings = (
        Finding(f.kind, f.channel, f.message, f.start_s, f.end_s) for f in (*single, *between)
    )
    return Result({}, 0, tuple(findings))


@lru_cache(maxsize=128)
def truth(log: Log) -> Result:
    """Read and reduce a log that has no fault."""
    return result(log)


@cache
def rig_of(text: str) -> winchcascade.Rig:
    """The rig of a rig file's text; that of the paper for none."""
    if not text:
        return load_rig(CAMPAIGN / "rig.toml")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rig.toml"
        path.write_text(text, encoding="utf-8")
        return load_rig(path)


def rounded(channel: str, x: Signal) -> Signal:
    """Round a channel as the logger does."""
    return np.round(np.round(x / STEPS[channel]) * STEPS[channel], 6)


def noisy(
    table: Mapping[str, Signal] | pd.DataFrame, rng: np.random.Generator, share: float = 1.0
) -> pd.DataFrame:
    """Add a share of the noise of the sensors, and round as the logger does."""
    columns = {}
    for channel, column in table.items():
        x = np.asarray(column, dtype=np.float64)
        noise = share * NOISE.get(channel, 0.0) * rng.standard_normal(len(x))
        columns[channel] = np.round(x, 6) if channel == "time" else rounded(channel, x + noise)
    return pd.DataFrame(columns)


@cache
def base(name: str, rate: float) -> Log:
    """A fixture log at any rate: interpolated smoothly with noise of the sensors added, or
    filtered and thinned out.
    """
    load, window = LOADS[name]
    raw = pd.read_csv(CAMPAIGN / f"{name}.csv").rename(
        columns={header: channel for channel, header in HEADERS.items()}
    )
    t, end = raw["time"].to_numpy(), float(raw["time"].iloc[-1])
    if abs(rate * float(np.median(np.diff(t))) - 1.0) < 1e-6:
        return Log(name, rate, raw, load, window)
    fine = max(rate, 250.0 if rate < 25.0 else rate)
    dense = np.arange(int(end * fine + 1e-6) + 1) / fine
    columns = {
        channel: PchipInterpolator(t, raw[channel])(dense) for channel in raw if channel != "time"
    }
    rng = np.random.default_rng(round(rate))
    if rate > 25.0:
        return Log(name, rate, noisy({"time": dense, **columns}, rng, ADDED), load, window)
    half = round(fine / rate)
    weights = (
        np.bartlett(2 * half + 1) / np.bartlett(2 * half + 1).sum()
    )  # symmetric: a filter without lag
    stamps = np.arange(int(end * rate + 1e-6) + 1) / rate
    smooth = {
        c: np.interp(stamps, dense, np.convolve(np.pad(x, half, "edge"), weights, "valid"))
        for c, x in columns.items()
    }
    return Log(name, rate, noisy({"time": stamps, **smooth}, rng, 0.0), load, window)


@cache
def bench(rate: float, load: float = 18.0) -> Log:
    """A shaft with a generator that runs through steps of speed, from Ohm's law and a constant
    efficiency alone.
    """
    t = np.arange(int(75.0 * rate) + 1) / rate
    corners = [0, 4, 5, 17, 18, 30, 31, 43, 44, 56, 57, 69, 70, 75]
    speed = np.interp(
        t, corners, [0, 0, 1000, 1000, 1800, 1800, 2600, 2600, 1400, 1400, 700, 700, 0, 0]
    )
    vdc = 0.08 * speed
    torque = vdc**2 / load / np.maximum(speed * np.pi / 30.0, 1.0) / 0.85 + 0.3 * (speed > 1.0)
    table = noisy(
        {"time": t, "speed": speed, "torque": torque, "vdc": vdc, "idc": vdc / load},
        np.random.default_rng(7),
    )
    return Log("bench", rate, table, load, rig=BENCH_RIG)


def twin(t: Signal, velocity: Signal, load: float) -> pd.DataFrame:
    """Simulate the paper's rig along a motion; columns by channel in the units of the file,
    without noise.
    """
    run = read_run(
        pd.DataFrame({"time_s": t, "velocity_mps": velocity}),
        load=load,
        rig=rig_of(""),
        repairs="off",
    )
    channels = simulate(run).run.channels
    units = {"pressure": 98066.5}
    return pd.DataFrame(
        {"time": t, **{c: channels[c] / units.get(c, 1.0) for c in HEADERS if c in channels}}
    )


def stroke_velocity(
    cycles: list[tuple[float, float, float, float]], rate: float
) -> tuple[Signal, Signal]:
    """Lay payouts and haul-ins one after the other.

    Parameters
    ----------
    cycles : length [m], speed [m/s], acceleration [m/s2] and stop in the middle of the payout [s]
        of each cycle
    rate : of the stamps [Hz]
    """
    corners: list[tuple[float, float]] = [(0.0, 0.0)]

    def go(seconds: float, speed: float) -> None:
        corners.append((corners[-1][0] + seconds, speed))

    for length, speed, acceleration, stop in cycles:
        go(4.0, 0.0)
        for sign, top in ((1.0, speed), (-1.0, min(1.25, 1.3 * speed))):
            ramp = min(top / acceleration, length / top / 2.0)
            parts = 2 if sign > 0 and stop else 1
            steady = max((length - parts * top * ramp) / top / parts, 0.1)
            for part in range(parts):
                go(ramp, sign * top)
                go(steady, sign * top)
                go(ramp, 0.0)
                go(stop if part < parts - 1 else 5.0, 0.0)
    seconds, speeds = np.array(corners).T
    t = np.arange(int(seconds[-1] * rate)) / rate
    return t, np.interp(t, seconds, speeds)
