"""Lags between the channels of the shipped campaign: each is found, or its error lies within 2 u.

`python benchmarks/lag_trials.py --cases 400` moves groups of channels of the logs, alone and
together, by 0.06 to 0.8 s to either side, at 5 to 200 Hz. It prints the share of cases that hold,
and every case that does not. `--clean` moves none and prints the findings, which are false."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from winchcascade import Reduction, Run, read_run, reduce
from winchcascade.reduction.uncertainty import uncertainty

CAMPAIGN = Path(__file__).parents[1] / "fixtures" / "campaign"
GROUPS = (
    ("torque",), ("force",), ("vdc",), ("idc",), ("velocity",), ("torque", "force"), ("vdc", "idc"),
    ("torque", "force", "vdc", "idc"),
)  # fmt: skip
RATES = (5.0, 10.0, 25.0, 50.0, 100.0, 200.0)
NOISE = {
    "velocity": 0.003,
    "force": 5.0,
    "torque": 0.4,
    "vdc": 0.26,
    "idc": 0.015,
    "pressure": 981.0,
}
"""Standard deviation of each channel at rest in the shipped logs. [SI]"""

METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto")

Signal = NDArray[np.float64]


def resampled(run: Run, rate: float, lags: dict[str, float], rng: np.random.Generator) -> Run:
    """The log at another rate, smoothed before it is thinned out, each channel late by its lag
    [s]."""
    t = np.arange(run.t[0], run.t[-1], 1.0 / rate)
    half = max(1, round(0.5 * run.fs / rate))
    kernel = np.bartlett(2 * half + 1) / np.bartlett(2 * half + 1).sum()
    channels = {}
    for name, x in run.channels.items():
        smooth = np.convolve(np.pad(x, half, "edge"), kernel, "valid") if rate < run.fs else x
        at = np.clip(t - lags.get(name, 0.0), run.t[0], run.t[-1])
        channels[name] = PchipInterpolator(run.t, smooth)(at) + NOISE.get(name, 0.0) * (
            rng.standard_normal(t.size) if rate > run.fs else 0.0
        )
    return replace(run, t=t, channels=channels, fs=rate, samples=t.size, gaps={}, findings=())


def beyond(true: Reduction, found: Reduction) -> dict[str, float]:
    """Errors of the means in standard uncertainties, of those that exceed two."""
    u = uncertainty(found).standard
    off = {}
    for m in METRICS:
        a, b = true.mean[m], found.mean[m]
        if a is not None and b is not None and u[m] and abs(a - b) > 2.0 * u.value(m):
            off[m] = (b - a) / u.value(m)
    return off


def main() -> None:
    """Run the trials."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clean", action="store_true")
    given = parser.parse_args()
    runs = [read_run(path) for path in sorted(CAMPAIGN.glob("*.csv"))]
    runs = [run for run in runs if not run.open_circuit or given.clean]
    counts = {"found": 0, "within": 0, "silent": 0}
    for k in range(given.cases):
        rng = np.random.default_rng([given.seed, k])
        run, rate, group = (
            runs[k % len(runs)],
            RATES[rng.integers(len(RATES))],
            GROUPS[rng.integers(len(GROUPS))],
        )
        lag = (
            0.0
            if given.clean
            else float(rng.choice([-1.0, 1.0]) * np.exp(rng.uniform(np.log(0.06), np.log(0.8))))
        )
        fixed = np.random.default_rng([given.seed, k, 1]), np.random.default_rng([given.seed, k, 1])
        true = reduce(resampled(run, rate, {}, fixed[0]))
        found = reduce(resampled(run, rate, dict.fromkeys(group, lag), fixed[1]))
        named = [f.message for f in found.quality if f.kind == "channel_lag"]
        off = beyond(true, found)
        verdict = "found" if named else "silent" if off else "within"
        counts[verdict] += 1
        if verdict == "silent" or (given.clean and found.quality):
            words = [f.message for f in found.quality] or {m: round(z, 1) for m, z in off.items()}
            print(f"{k:4} {run.name:16} {rate:5g} Hz {' '.join(group):26} {lag:+.3f} s  {words}")
    print(counts, f"hold: {1.0 - counts['silent'] / given.cases:.1%}")


if __name__ == "__main__":
    main()
