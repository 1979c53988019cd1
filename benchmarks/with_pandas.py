"""Reduce logs as one would with pandas: read_csv, a rolling mean, phases by thresholds, trapezoidal
energies.

python benchmarks/with_pandas.py LOG-OR-FOLDER... [--window 5.48] [--jobs 2] [--out TABLE.csv]
[--plot FIGURE]

It knows one dialect of one format, trusts every row, and gives neither uncertainty nor findings.
"""

from __future__ import annotations

import argparse
from functools import partial
from multiprocessing import Pool
from pathlib import Path

import numpy as np
import pandas as pd

COLUMNS = ["t", "x", "v", "p", "force", "torque", "vdc", "idc"]
R_DRUM = 0.13
SMOOTHING = 0.6
"""Width of the rolling mean [s]."""
V_ONSET = 0.03
"""Line speed above which the line pays out [m/s]."""
STROKE_MIN = 0.2
"""What moves less is no payout [m]."""


def read(path: Path) -> pd.DataFrame:
    """Read a log, smooth its velocity and add its powers. [W]"""
    log = pd.read_csv(path, header=0, names=COLUMNS)
    samples = round(SMOOTHING / (log.t[1] - log.t[0]))
    log["v_smooth"] = log.v.rolling(samples, center=True, min_periods=1).mean()
    log["p_line"] = log.force * log.v
    log["p_mech"] = log.torque * log.v / R_DRUM
    log["p_gen"] = log.vdc * log.idc
    return log


def payouts(log: pd.DataFrame) -> list[tuple[int, int]]:
    """Find the rows of each payout, [first, last)."""
    moving = (log.v_smooth > V_ONSET).to_numpy().astype(int)
    edges = np.diff(moving, prepend=0, append=0)
    spans = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    x = log.x.to_numpy()
    return [(int(a), int(b)) for a, b in spans if x[b - 1] - x[a] > STROKE_MIN]


def window_end(t: np.ndarray, v: np.ndarray, window: float | None) -> float:
    """Give the end of a payout's window: after a length, or 0.5 s after the speed is on its
    plateau. [s]
    """
    if window is not None:
        return float(t[0] + window)
    plateau = np.median(v[v > 0.9 * v.max()])
    return float(t[np.argmax(v >= 0.98 * plateau)] + 0.5)


def reduce(path: Path, window: float | None = None) -> pd.DataFrame:
    """Give the energies [J] and efficiencies of every payout of a log."""
    log = read(path)
    t, v = log.t.to_numpy(), log.v_smooth.to_numpy()
    powers = log[["p_line", "p_mech", "p_gen"]].to_numpy()
    found = []
    for first, last in payouts(log):
        last = int(
            np.searchsorted(t, window_end(t[first:last], v[first:last], window), side="right")
        )
        line, mech, gen = np.trapezoid(powers[first:last], t[first:last], axis=0)
        found.append((path.name, t[first], line, mech, gen, mech / line, gen / mech, gen / line))
    names = ["log", "onset", "e_line", "e_mech", "e_gen", "eta_trans", "eta_gen", "eta_pto"]
    return pd.DataFrame(found, columns=names)


def plot(path: Path, figure_file: Path) -> None:
    """Draw speed, force, torque and power of a log over time."""
    parts = [("v", "v_smooth"), ("force",), ("torque",), ("p_line", "p_mech", "p_gen")]
    columns = [name for part in parts for name in part]
    axes = read(path).plot(x="t", y=columns, subplots=parts, figsize=(8, 10), xlabel="time (s)")
    axes[0].figure.savefig(figure_file)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument(
        "--window", type=float, help="length from the onset [s]; until the plateau by default"
    )
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--plot", type=Path)
    asked = parser.parse_args()
    logs = [
        log
        for given in asked.logs
        for log in (sorted(given.glob("*.csv")) if given.is_dir() else [given])
    ]
    work = partial(reduce, window=asked.window)
    if asked.jobs > 1:
        with Pool(asked.jobs) as pool:
            table = pd.concat(pool.map(work, logs))
    else:
        table = pd.concat(map(work, logs))
    if asked.plot is not None:
        plot(logs[0], asked.plot)
    if asked.out is not None:
        table.to_csv(asked.out, index=False)
    else:
        print(table.groupby("log").mean(numeric_only=True).round(4).to_string())


if __name__ == "__main__":
    main()
