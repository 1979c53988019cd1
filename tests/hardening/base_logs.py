"""The undamaged logs of the corruption matrix: three fixture logs at three rates, as columns in the units of the file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Signal = NDArray[np.float64]

ROOT = Path(__file__).parents[2]
CAMPAIGN = ROOT / "fixtures" / "campaign"

TIME = "time"
HEADERS = {
    TIME: "Time (s)",
    "displacement": "Displacement (m)",
    "velocity": "Velocity (m/s)",
    "pressure": "Pressure (kg/cm2)",
    "force": "Force (N)",
    "torque": "Torque (N.m)",
    "vdc": "Vdc (V)",
    "idc": "Idc (A)",
}
"""Columns of a fixture log, by channel."""

NOISE = {"velocity": 0.003, "pressure": 0.01, "force": 5.0, "torque": 0.4, "vdc": 0.26, "idc": 0.015}
"""Standard deviation of each channel at rest in the fixture logs, in the unit of the file."""

STEPS = {
    "displacement": 0.0002, "velocity": 0.002, "pressure": 0.001, "force": 1.961, "torque": 0.01, "vdc": 0.01, "idc": 0.001,
}  # fmt: skip
"""Resolution of each channel in the fixture logs, in the unit of the file."""

DECIMALS = {"displacement": 4, "velocity": 3, "pressure": 3, "force": 1, "torque": 2, "vdc": 2, "idc": 3}

ADDED = 0.7
"""Share of a channel's noise that is added after interpolation to a higher rate: interpolated noise keeps the rest."""

LOGS = {"r4p5ohm": (4.5, 5.96), "r18ohm": (18.0, 5.96), "r45ohm": (45.0, 5.48)}
"""Load [ohm] and window [s] of the fixture logs, as in their campaign.toml."""

RATES = (10, 25, 100)


@dataclass(frozen=True)
class Log:
    """A log as a table: columns by channel in the unit of the file, with the load and the window of its campaign."""

    name: str
    rate: float
    load: float
    window: float
    columns: Mapping[str, Signal]
    headers: Mapping[str, str] = field(default_factory=lambda: HEADERS)

    def __repr__(self) -> str:
        return f"{self.name} at {self.rate:g} Hz"

    @property
    def t(self) -> Signal:
        """Stamps. [s]"""
        return self.columns[TIME]

    @property
    def step(self) -> float:
        """Sampling interval. [s]"""
        return 1.0 / self.rate

    def changed(self, **columns: Signal) -> "Log":
        """Replace columns."""
        return Log(self.name, self.rate, self.load, self.window, {**self.columns, **columns}, self.headers)

    def rows(self, keep: NDArray[np.intp]) -> "Log":
        """Take rows in an order."""
        columns = {name: x[keep] for name, x in self.columns.items()}
        return Log(self.name, self.rate, self.load, self.window, columns, self.headers)

    def without(self, *names: str) -> "Log":
        """Leave columns out."""
        columns = {name: x for name, x in self.columns.items() if name not in names}
        return Log(self.name, self.rate, self.load, self.window, columns, self.headers)

    def cells(self) -> list[list[str]]:
        """Write each column as texts; NaN is an empty cell."""
        return [_texts(x) for x in self.columns.values()]

    def names(self) -> list[str]:
        """Headers in the order of the columns."""
        return [self.headers[name] for name in self.columns]

    def text(self, *, preamble: str = "") -> str:
        """Write the log as CSV."""
        rows = map(",".join, zip(*self.cells(), strict=True))
        return preamble + "\n".join([",".join(self.names()), *rows, ""])


def _texts(x: Signal) -> list[str]:
    return ["" if value != value else repr(value) for value in x.tolist()]


def quantised(columns: Mapping[str, Signal]) -> dict[str, Signal]:
    """Round each channel to its resolution, as the logger does."""
    return {
        name: x if name == TIME else np.round(np.round(x / STEPS[name]) * STEPS[name], DECIMALS[name])
        for name, x in columns.items()
    }


def read_table(path: Path) -> dict[str, Signal]:
    """Read the columns of a fixture log."""
    table = np.genfromtxt(path, delimiter=",", skip_header=1)
    return dict(zip(HEADERS, table.T.copy(), strict=True))


def resampled(columns: Mapping[str, Signal], rate: float, seed: int, *, noise: bool = True) -> dict[str, Signal]:
    """Resample a table: interpolate smoothly and add noise of the sensors, or filter and thin out."""
    t = columns[TIME]
    usual = 1.0 / float(np.median(np.diff(t)))
    if abs(rate - usual) < 1e-6 * usual:
        return dict(columns)
    if rate > usual:
        return quantised(_finer(columns, rate, np.random.default_rng(seed), noise=noise))
    fine = 10.0 * max(rate, usual)
    return quantised(_coarser(_finer(columns, fine, np.random.default_rng(seed), noise=False), rate))


def _finer(columns: Mapping[str, Signal], rate: float, rng: np.random.Generator, *, noise: bool) -> dict[str, Signal]:
    t = columns[TIME]
    new = np.arange(int(np.floor((t[-1] - t[0]) * rate + 1e-6)) + 1) / rate
    found = {TIME: np.round(t[0] + new, 6)}
    for name, x in columns.items():
        if name != TIME:
            found[name] = PchipInterpolator(t, x)(found[TIME])
            if noise and name in NOISE:
                found[name] += ADDED * NOISE[name] * rng.standard_normal(len(new))
    return found


def _coarser(columns: Mapping[str, Signal], rate: float) -> dict[str, Signal]:
    """Average over two new intervals with weights that fall to zero (a symmetric filter has no lag), and thin out."""
    t = columns[TIME]
    new = t[0] + np.arange(int(np.floor((t[-1] - t[0]) * rate)) + 1) / rate
    half = round(1.0 / (rate * float(np.median(np.diff(t)))))
    weights = np.bartlett(2 * half + 1)
    found = {TIME: np.round(new, 6)}
    for name, x in columns.items():
        if name != TIME:
            padded = np.concatenate((np.full(half, x[0]), x, np.full(half, x[-1])))
            found[name] = np.interp(new, t, np.convolve(padded, weights / weights.sum(), "valid"))
    return found


@cache
def base(name: str, rate: int) -> Log:
    """Give one of the nine undamaged logs."""
    load, window = LOGS[name]
    return Log(name, rate, load, window, resampled(read_table(CAMPAIGN / f"{name}.csv"), rate, seed=rate))


def bases(rates: Sequence[int] = RATES) -> list[Log]:
    """List the undamaged logs at some rates."""
    return [base(name, rate) for name in LOGS for rate in rates]
