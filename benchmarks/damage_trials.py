"""Kinds of damage that the gate of faults does not have: how often a wrong mean has no finding.

`python benchmarks/damage_trials.py --cases 12` damages shipped logs in each of the kinds of `KINDS`,
at random sizes, places and rates. A case is silent if the log has no finding beyond those of the
undamaged one, and a mean that differs from its by more than two standard uncertainties. `--list`
prints the silent cases."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

TESTS = Path(__file__).parents[1] / "tests"
sys.path[:0] = [str(TESTS), str(TESTS / "faults")]

from fault_logs import LOADS, METRICS, NOISE, Log, base, rig_of  # noqa: E402

from winchcascade import Reduction, WinchcascadeError, read_run, reduce  # noqa: E402
from winchcascade.reduction.uncertainty import uncertainty  # noqa: E402

RATES = (10.0, 25.0, 100.0)
POWERS = ("velocity", "force", "torque", "vdc", "idc")
"""Channels of which the powers are made."""

Signal = NDArray[np.float64]


class Damaged(NamedTuple):
    """What a kind of damage is given: the log, a generator, the name of a channel with its samples
    and its top value, and rows around a place in a payout."""

    log: Log
    rng: np.random.Generator
    name: str
    x: Signal
    top: float
    first: int
    last: int

    @property
    def rows(self) -> slice:
        """The rows of the place."""
        return slice(self.first, self.last)

    @property
    def moves(self) -> Signal:
        """1 while the line pays out, (n,)."""
        return np.asarray(self.log["velocity"] > 0.05, dtype=np.float64)

    def size(self, low: float, high: float) -> float:
        """A size, of either sign, even in its logarithm."""
        size = np.exp(self.rng.uniform(np.log(low), np.log(high)))
        return float(self.rng.choice([-1.0, 1.0]) * size)

    def changed(self, x: Signal) -> Log:
        """The log with another channel."""
        return self.log.changed(**{self.name: x})


def smoothed(x: Signal, samples: int) -> Signal:
    """A running mean, (n,)."""
    kernel = np.ones(2 * (samples // 2) + 1)
    padded = np.pad(x, kernel.size // 2, "edge")
    return np.convolve(padded, kernel / kernel.sum(), "valid")


def filtered(x: Signal, samples: float) -> Signal:
    """A low-pass filter of first order with a time constant in samples, (n,)."""
    found, share = np.empty_like(x), 1.0 - np.exp(-1.0 / samples)
    level = x[0]
    for k, value in enumerate(x.tolist()):
        level += share * (value - level)
        found[k] = level
    return found


def renumbered(d: Damaged, kept: Signal) -> Log:
    """Rows in an order, under stamps of row numbers."""
    rows = d.log.rows(kept.astype(np.intp))
    return rows.changed(time=d.log.t[0] + np.arange(len(kept)) / d.log.rate)


def straight(d: Damaged) -> Log:
    """A gap filled with a straight line."""
    x = d.x.copy()
    x[d.rows] = np.linspace(x[d.first], x[d.last], d.last - d.first)
    return d.changed(x)


def written(d: Damaged, value: float | Signal) -> Log:
    """Another value at the place."""
    x = d.x.copy()
    x[d.rows] = value
    return d.changed(x)


def exchanged(d: Damaged) -> Log:
    """Two channels under each other's name."""
    one, other = (("vdc", "idc"), ("force", "torque"), ("torque", "vdc"))[d.rng.integers(3)]
    return d.log.changed(**{one: d.log[other], other: d.log[one]})


def hysteresis(d: Damaged) -> Log:
    """A channel that lags behind a change of direction by a width."""
    width, level, found = abs(d.size(0.01, 0.1)) * d.top, float(d.x[0]), []
    for value in d.x.tolist():
        level = min(max(level, value - width), value + width)
        found.append(level)
    return d.changed(np.array(found))


def held(d: Damaged) -> Log:
    """A channel that is updated every few samples."""
    every = int(d.rng.integers(3, 12))
    return d.changed(d.x[np.arange(d.x.size) // every * every])


def late_group(d: Damaged) -> Log:
    """Channels of one logger late together."""
    group = (("force", "torque"), ("vdc", "idc"), ("torque", "vdc", "idc"))[d.rng.integers(3)]
    t = d.log.t - d.size(0.1, 0.6)
    return d.log.changed(**{name: np.interp(t, d.log.t, d.log[name]) for name in group})


def smooth_group(d: Damaged) -> Log:
    """Running means of all channels but the motion."""
    samples = max(3, round(abs(d.size(0.15, 1.0)) * d.log.rate))
    return d.log.changed(**{n: smoothed(d.log[n], samples) for n in POWERS[1:]})


KINDS: dict[str, Callable[[Damaged], Log]] = {
    "gain": lambda d: d.changed(d.x * (1.0 + d.size(0.03, 0.2))),
    "offset": lambda d: d.changed(d.x + d.size(0.01, 0.1) * d.top),
    "offset while moving": lambda d: d.changed(d.x + d.size(0.01, 0.1) * d.top * d.moves),
    "drift of the zero": lambda d: d.changed(
        d.x + d.size(0.01, 0.1) * d.top * np.linspace(0.0, 1.0, d.x.size)
    ),
    "drift of the gain": lambda d: d.changed(
        d.x * (1.0 + d.size(0.03, 0.2) * np.linspace(0.0, 1.0, d.x.size))
    ),
    "step of the zero": lambda d: d.changed(
        d.x + d.size(0.01, 0.1) * d.top * (np.arange(d.x.size) > d.first)
    ),
    "step of the gain": lambda d: d.changed(
        d.x * (1.0 + d.size(0.03, 0.2) * (np.arange(d.x.size) > d.first))
    ),
    "curved": lambda d: d.changed(d.x * (1.0 + d.size(0.03, 0.2) * d.x / d.top)),
    "hysteresis": hysteresis,
    "dead zone": lambda d: d.changed(
        np.where(np.abs(d.x) < abs(d.size(0.02, 0.2)) * d.top, 0.0, d.x)
    ),
    "saturated": lambda d: d.changed(np.minimum(d.x, d.rng.uniform(0.6, 0.95) * d.top)),
    "coarse": lambda d: d.changed(
        np.round(d.x / (step := abs(d.size(0.01, 0.1)) * d.top)) * step
    ),
    "rectified": lambda d: d.changed(np.abs(d.x)),
    "low-pass": lambda d: d.changed(filtered(d.x, abs(d.size(0.1, 0.8)) * d.log.rate)),
    "running mean": lambda d: d.changed(smoothed(d.x, round(abs(d.size(0.2, 1.5)) * d.log.rate))),
    "running means but of the motion": smooth_group,
    "late": lambda d: d.changed(np.interp(d.log.t - d.size(0.1, 0.6), d.log.t, d.x)),
    "late together": late_group,
    "held": held,
    "noise": lambda d: d.changed(
        d.x + abs(d.size(0.02, 0.3)) * d.top * d.rng.standard_normal(d.x.size)
    ),
    "hum": lambda d: d.changed(
        d.x + d.size(0.02, 0.2) * d.top * np.sin(2.0 * np.pi * d.rng.uniform(0.5, 4.0) * d.log.t)
    ),
    "crosstalk of vdc": lambda d: d.changed(
        d.x + d.size(0.02, 0.2) * d.top * d.log["vdc"] / np.max(d.log["vdc"])
    ),
    "stuck": lambda d: written(d, float(d.x[d.first])),
    "stuck with noise": lambda d: written(
        d, d.x[d.first] + NOISE.get(d.name, 0.0) * d.rng.standard_normal(d.last - d.first)
    ),
    "zeros": lambda d: written(d, 0.0),
    "half values": lambda d: written(d, 0.5 * d.x[d.rows]),
    "bridged": straight,
    "empty": lambda d: written(d, np.nan),
    "rows lost": lambda d: renumbered(d, np.delete(np.arange(d.x.size), d.rows)),
    "rows twice": lambda d: renumbered(
        d, np.concatenate((np.arange(d.last), np.arange(d.first, d.x.size)))
    ),
    "rows lost at random": lambda d: d.log.rows(
        np.flatnonzero(d.rng.random(d.x.size) > abs(d.size(0.01, 0.3)))
    ),
    "rate of the clock": lambda d: d.log.changed(time=d.log.t * (1.0 + d.size(0.02, 0.3))),
    "clock of one channel": lambda d: d.changed(
        np.interp(d.log.t * (1.0 + d.size(0.003, 0.03)), d.log.t, d.x)
    ),
    "clock that steps": lambda d: d.log.changed(
        time=d.log.t + abs(d.size(0.2, 5.0)) * (np.arange(d.x.size) > d.first)
    ),
    "exchanged": exchanged,
    "sign in a part": lambda d: written(d, -d.x[d.rows]),
    "spikes": lambda d: d.changed(
        np.where(d.rng.random(d.x.size) < 0.01, d.x + d.size(0.3, 3.0) * d.top, d.x)
    ),
    "load": lambda d: Log(
        d.log.name, d.log.rate, d.log.table, (d.log.load or 0.0) * (1.0 + d.size(0.03, 0.3)), d.log.window
    ),
}  # fmt: skip
"""The kinds; each gives a damaged log."""


def reduced(log: Log) -> Reduction | None:
    """Read and reduce a log; None if it is rejected, which is a finding."""
    try:
        run = read_run(log.frame(), load=log.load, rig=rig_of(log.rig))
        return reduce(run, window=log.window)
    except WinchcascadeError:
        return None


def beyond(true: Reduction, found: Reduction) -> dict[str, float]:
    """Errors of the means that exceed two standard uncertainties of the damaged log. [u]"""
    u, errors = uncertainty(found).standard, {}
    for m in METRICS:
        a, b = true.mean[m], found.mean[m]
        if a is not None and b is not None and u[m]:
            errors[m] = round((b - a) / u.value(m), 1)
    return {m: error for m, error in errors.items() if abs(error) > 2.0}


def case(kind: str, k: int, seed: int) -> tuple[str, str]:
    """Whether a case is `found`, `harmless` or `silent`, and what it is in words."""
    rng = np.random.default_rng([seed, [*KINDS].index(kind), k])
    log = base(str(rng.choice([*LOADS])), float(rng.choice(RATES)))
    name = str(rng.choice(POWERS))
    moving = np.flatnonzero(log["velocity"] > 0.5 * np.max(log["velocity"]))
    first = int(rng.choice(moving[: -round(4.0 * log.rate)]))
    last = first + max(3, round(np.exp(rng.uniform(np.log(0.2), np.log(3.0))) * log.rate))
    x = log[name]
    place = Damaged(log, rng, name, x, float(np.max(np.abs(x))), first, last)
    true, found = reduced(log), reduced(KINDS[kind](place))
    if true is None or found is None:
        return "found", "rejected"
    known = {(f.kind, f.channel) for f in true.quality}
    new = [f.kind for f in found.quality if (f.kind, f.channel) not in known]
    errors = beyond(true, found)
    verdict = "found" if new else "silent" if errors else "harmless"
    return verdict, f"{kind} {k}: {log.name} {log.rate:g} Hz {name} {errors} {new}"


def main() -> None:
    """Run the trials."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=12, help="of each kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="kinds whose name contains this")
    parser.add_argument("--list", action="store_true", help="print the silent cases")
    given = parser.parse_args()
    silent, all_cases = 0, 0
    for kind in KINDS:
        if given.only not in kind:
            continue
        found = [case(kind, k, given.seed) for k in range(given.cases)]
        count = {v: sum(of == v for of, _ in found) for v in ("found", "harmless", "silent")}
        print(f"{kind:34}" + "".join(f"{v} {n:3}  " for v, n in count.items()), flush=True)
        for verdict, words in found if given.list else ():
            if verdict == "silent":
                print(f"    {words}")
        silent, all_cases = silent + count["silent"], all_cases + len(found)
    print(f"silent beyond 2 u: {silent} of {all_cases} ({silent / max(all_cases, 1):.1%})")


if __name__ == "__main__":
    main()
