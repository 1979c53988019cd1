"""Share of logs whose 95 % interval of a mean holds the true one, by metric.

`python benchmarks/interval_trials.py --logs 200` gives the sensors of clean logs of the twin drawn
errors: gains and zeros as the rig file states them, rectangular between limits and else normal, and
lags of a standard deviation that it states, too. The true means are those of the same motion
without errors and noise. `--alike` draws one lag for force and torque and one for Vdc and Idc, which
no rig file states, so that the log itself has to show them. A log whose error is a finding does not
count, and is printed."""

from __future__ import annotations

import argparse
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from msgspec.structs import replace
from numpy.typing import NDArray

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "faults")]

from fault_logs import HEADERS, NOISE, STEPS, stroke_velocity, twin  # noqa: E402

from winchcascade import Reduction, read_run, reduce  # noqa: E402
from winchcascade.core.accuracy import error_sources  # noqa: E402
from winchcascade.core.channels import CHANNELS  # noqa: E402
from winchcascade.core.quantity import find_unit  # noqa: E402
from winchcascade.core.rig_file import Rig  # noqa: E402
from winchcascade.core.rig_toml import built_in  # noqa: E402
from winchcascade.reduction.uncertainty import uncertainty  # noqa: E402

LAG = 0.02
"""Standard deviation of a lag. [s]"""

LOADS = (4.5, 9.0, 18.0, 27.0, 36.0, 45.0)
RATES = (25.0, 50.0, 100.0)
FINE = 100.0
"""Rate of the simulation. [Hz]"""

WINDOW = 5.0
GROUPS = (("force", "torque"), ("vdc", "idc"))
ERRORS = ("gain_mismatch", "channel_lag", "zero_offset", "load_mismatch", "gain_step")
METRICS = ("energy_line", "energy_mech", "energy_gen", "eta_trans", "eta_gen", "eta_pto")

Signal = NDArray[np.float64]


@cache
def fine(load: float) -> pd.DataFrame:
    """Three strokes of the twin at a load [ohm], with rounded corners."""
    speed = 0.85 if load >= 18.0 else 0.5
    t, v = stroke_velocity([(9.0, speed, 0.5, 0.0)] * 3, FINE)
    corner = np.bartlett(61)
    return twin(t, np.convolve(v, corner / corner.sum(), "same"), load)


def reduced(channels: dict[str, Signal], load: float, rig: Rig) -> Reduction:
    """Read and reduce a table, by channel in the units of a file."""
    table = pd.DataFrame(channels).rename(columns=dict(HEADERS))
    return reduce(read_run(table, load=load, rig=rig), window=WINDOW)


@cache
def truth(load: float, rate: float) -> Reduction:
    """The reduction of the motion without errors."""
    table, t = fine(load), stamps(load, rate)
    return reduced(
        {"time": t, **{c: np.interp(t, table.time, table[c]) for c in table if c != "time"}},
        load,
        built_in(),
    )


def stamps(load: float, rate: float) -> Signal:
    """Stamps of a log, (n,), whose lags the simulation covers. [s]"""
    t = fine(load).time
    return np.arange(t.iloc[0], t.iloc[-1] - 1.0, 1.0 / rate)


def logged(
    load: float, rate: float, rig: Rig, rng: np.random.Generator, *, alike: bool
) -> Reduction:
    """The reduction of a log with drawn errors, noise and resolution."""
    table, t = fine(load), stamps(load, rate)
    lags = {name: LAG * rng.standard_normal() for group in GROUPS for name in group}
    if alike:
        lags = {name: lags[group[0]] for group in GROUPS for name in group}
    channels = {"time": t}
    for name in (c for c in table if c != "time"):
        x = np.interp(t - lags.get(name, 0.0), table.time, table[name])
        unit = find_unit(CHANNELS[name].unit)
        assert unit is not None
        sensor = rig.sensors.get(name)
        for source in () if name not in lags or sensor is None else error_sources(name, sensor):
            normal = source.limit is None
            error = source.u * (
                rng.standard_normal() if normal else rng.uniform(-1.0, 1.0) * np.sqrt(3.0)
            )
            x = x * (1.0 + error) if source.part == "gain" else x + error / unit.factor
        x = x + NOISE.get(name, 0.0) * rng.standard_normal(t.size)
        channels[name] = np.round(x / STEPS[name]) * STEPS[name]
    return reduced(channels, load, rig)


def main() -> None:
    """Run the trials."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alike", action="store_true")
    given = parser.parse_args()
    rig = built_in()
    if not given.alike:
        stated = {
            name: replace(s, u_lag=LAG) if any(name in group for group in GROUPS) else s
            for name, s in rig.sensors.items()
        }
        rig = replace(rig, sensors=stated)
    scores: dict[str, list[tuple[bool, float]]] = {m: [] for m in METRICS}
    left_out = 0
    for k in range(given.logs):
        rng = np.random.default_rng([given.seed, k])
        load, rate = float(rng.choice(LOADS)), float(rng.choice(RATES))
        found = logged(load, rate, rig, rng, alike=given.alike)
        words = [f.message for f in found.quality if f.kind in ERRORS]
        if words:
            left_out += 1
            print(f"{k:4} {load:g} ohm {rate:g} Hz: {'; '.join(words)}")
            continue
        known = uncertainty(found)
        for m, score in scores.items():
            low, high = known.interval_95_sensors[m]
            error = found.mean.value(m) - truth(load, rate).mean.value(m)
            score.append(
                (low <= found.mean.value(m) - error <= high, error / known.budget.sensors.value(m))
            )
    print(f"{left_out} of {given.logs} logs with a finding on an error")
    for m, score in scores.items():
        held, errors = np.array(score).T
        print(
            f"{m:12} holds in {held.mean():6.1%}; errors {np.sqrt(np.mean(errors**2)):.2f} u (rms)"
        )
    every = np.array([of for score in scores.values() for of in score])
    print(f"{'all':12} holds in {every[:, 0].mean():6.1%}")


if __name__ == "__main__":
    main()
