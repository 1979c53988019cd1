"""Efficiencies that change within a log by more than uncertainty and repeatability allow.

The load of a log is fixed, and the gains of its sensors are too. What may change an efficiency is then the speed. A loss
force or torque lies between a constant one and one with the square of the speed v, so its power lies between v and v^3.
Into a resistor the power is proportional to v^2: the share of the loss changes by no more than v does, or by half of what
the power does. Without a resistor the bound is the change of the power itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import msgspec
import numpy as np

from winchcascade.core.accuracy import error_sources
from winchcascade.core.integrate import white_noise
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Finding, Index, Mask, Run, Signal
from winchcascade.reduction.efficiency import NOTHING, runs_idle
from winchcascade.reduction.phased_run import Window
from winchcascade.reduction.reduction_result import CycleResult

ALPHA = 0.01
"""Probability of a false finding in one log, or between the logs of one campaign, all comparisons together. [1]"""

REPEATS = 0.003
"""Repeatability of an efficiency between cycles, relative standard deviation that is assumed before any is measured: where a
tenth of the power rings at 2 Hz, a window of 5 s that cuts it anywhere changes an energy by 0.1 / (2 pi 5) = 0.3 %."""

PRIOR = 10
"""The assumed standard deviation has this number of degrees of freedom; more cycles than that decide for themselves."""


MAX_ALONG = 20
"""Maximum number of cycles to which a straight line is fitted, about a quarter of an hour on the bench. Over longer logs the
operating conditions drift as well; of many cycles the two halves show a drift nearly as clearly as the line does."""

MOVES = 0.0025
"""Smallest change of interest: it moves the mean efficiency of the log by this. The budget of the paper's rig, the best on
which the tool was used, states efficiencies to 0.003 to 0.005."""


MAX_WINDOWS = 12
"""Number of windows that are evaluated: an even selection of those of a longer log. Noise belongs to the sensors. [1]"""

INDEPENDENT = 0.04
"""Time over which samples are averaged first: noise of a sensor that is sampled faster than it responds is not white. [s]"""


class CycleComparison(msgspec.Struct, frozen=True):
    """The most significant change of one efficiency over the cycles of a log.

    `change` is relative to the mean, `explained` what speed, gaps and zeros explain of it, `scatter` the standard deviation of
    such a change by repeatability, with `freedom` degrees of freedom; `chance` is the probability of the change, all
    comparisons together, `moved` what it moves of the mean efficiency [1]. `here` are the cycles that differ from the
    others, (k,); None for a drift.
    """

    metric: str
    cycles: Sequence[CycleResult]
    mean: float
    change: float
    explained: float
    scatter: float
    freedom: int
    chance: float
    moved: float
    here: Mask | None

    @property
    def reported(self) -> bool:
        """Whether the change is significant and of interest."""
        return self.chance <= ALPHA and self.moved >= MOVES


class _Known(NamedTuple):
    """What may change an efficiency without a fault, all relative. [1]

    `gaps` is what bridged gaps may have changed of that of each cycle, (k,); `zeros` the share of the zeros in what is read;
    `power_share` the change of the share of the loss over that of the power; `repeats` the assumed repeatability with the
    noise of the sensors in the window.
    """

    gaps: Signal
    zeros: float
    power_share: float
    repeats: float


def changes_within(
    cycles: Sequence[CycleResult], rig: Rig, bridged: Mapping[str, tuple[float, ...]], run: Run
) -> list[Finding]:
    """Find efficiencies that step or drift over the complete cycles of a log, or that one cycle has apart from the others.

    Parameters
    ----------
    bridged : what bridging gaps may have changed of each cycle's energy, by stage [J]
    run : an open circuit has no efficiency of interest
    """
    without_noise = compare_cycles(cycles, rig, bridged, run, noise={})
    if not any(found.chance <= ALPHA for found in without_noise):  # noise makes a change less significant
        return []
    return [_finding(found) for found in compare_cycles(cycles, rig, bridged, run) if found.reported]


def compare_cycles(
    cycles: Sequence[CycleResult],
    rig: Rig,
    bridged: Mapping[str, tuple[float, ...]],
    run: Run,
    *,
    noise: Mapping[str, float] | None = None,
) -> list[CycleComparison]:
    """Compare the cycles of a log by each efficiency, parameters as of `changes_within`.

    Every split into first and last cycles is compared, every cycle with the others, and a straight line is fitted to all.

    Parameters
    ----------
    noise : of the energies of the stages as `energy_noise` gives it, which is the default [1]
    """
    if run.open_circuit or not rig.cascade.neighbours:
        return []
    cascade, whole = rig.cascade, [c for c in cycles if c.complete]
    last, overall = cascade.neighbours[-1], cascade.overall
    if runs_idle([c.metrics[last] if c.metrics[overall] is None else c.metrics[overall] for c in whole]):
        return []
    if noise is None:
        noise = energy_noise(run, rig, [c.window for c in whole])
    ratios = cascade.ratios
    given = {m: [k for k, c in enumerate(cycles) if c.complete and c.metrics[m] is not None] for m in ratios}
    tested = [m for m in cascade.neighbours if len(given[m]) > 1] or [overall] * (len(given[overall]) > 1)
    compared = []
    for metric in tested:
        here = [cycles[k] for k in given[metric]]
        gaps = np.zeros(len(here))
        energies = np.array([[cycles[c].metrics[energy] for c in given[metric]] for energy in ratios[metric]])
        for energy, joule in zip(ratios[metric], energies, strict=True):
            joules = bridged.get(energy.removeprefix("energy_"), np.zeros(len(cycles)))
            gaps += [joules[c] / max(j, NOTHING) for c, j in zip(given[metric], joule, strict=True)]
        repeats = math.hypot(REPEATS, *(noise.get(energy.removeprefix("energy_"), 0.0) for energy in ratios[metric]))
        known = _Known(gaps, _zeros(here, rig), 0.5 if run.load is not None else 1.0, repeats)
        compared.append(_largest_change(metric, here, energies.T, known, len(tested)))
    return [found for found in compared if found is not None]


def _zeros(cycles: Sequence[CycleResult], rig: Rig) -> float:
    """Share that the zeros of force cell and torque sensor may have in what they read on the plateau. [1]"""
    total = 0.0
    plateaus = [p for c in cycles if (p := c.summary.payout.plateau) is not None]
    for channel, values in (("force", [p.force for p in plateaus]), ("torque", [p.torque for p in plateaus])):
        read = [abs(x) for x in values if x is not None]
        if read and channel in rig.sensors:
            zero = sum(s.limit or 2.0 * s.u for s in error_sources(channel, rig.sensors[channel]) if s.part == "zero")
            total += zero / max(sum(read) / len(read), zero) if zero else 0.0
    return total


def energy_noise(run: Run, rig: Rig, windows: Sequence[Window]) -> dict[str, float]:
    """Relative standard deviation of an energy in a window by the white noise of its channels, by stage. [1]

    The noise of a channel is that of its samples in the window. In the sum of the power over n samples it averages out by the
    square root of n.

    Parameters
    ----------
    windows : those that are whole
    """
    chosen = windows[:: -(-len(windows) // MAX_WINDOWS)] if windows else ()
    rows = [slice(*np.searchsorted(run.t, (w.onset, w.cutoff)).tolist()) for w in chosen]
    count = max(1, int(INDEPENDENT * run.fs + 1e-6))
    found = {}
    for stage in rig.cascade.stages:
        product = stage.power(run.channels, rig.r_drum)
        if rows and product is not None:
            names = product.channels
            square = [_square([_averaged(run.channels[name][part], count) for name in names]) for part in rows]
            found[stage.name] = float(np.sqrt(np.mean(square)))
    return found


def _averaged(x: Signal, count: int) -> Signal:
    """Means over groups of samples of equal size."""
    means: Signal = x[: x.size // count * count].reshape(-1, count).mean(axis=1)
    return means


def _square(factors: Sequence[Signal]) -> float:
    """Relative variance of the integral of a power, one channel or the product of two, by the noise of these. [1]"""
    x, y = (*factors, np.ones(factors[0].size))[:2]
    square = white_noise(x) ** 2 * float(y @ y) + white_noise(y) ** 2 * float(x @ x)
    return square / max(float(x @ y) ** 2, NOTHING)


def _largest_change(
    metric: str, cycles: Sequence[CycleResult], energies: Signal, known: _Known, metrics: int
) -> CycleComparison | None:
    """The most significant change of an efficiency over the cycles; None where the efficiency is not positive.

    Parameters
    ----------
    energies : of the cycles, out of the stages and into them, (k, 2) [J]
    metrics : number of efficiencies that are tested
    """
    eta, n = np.array([c.metrics.value(metric) for c in cycles]), len(cycles)
    mean = float(eta.sum()) / n
    if mean <= 0.0:
        return None
    eta = eta / mean
    energies = np.maximum(energies, NOTHING)
    lengths = np.array([[c.window.cutoff - c.window.onset] for c in cycles])
    size = np.log(np.hstack([energies, energies / lengths]))
    first, drift, spread = _comparisons(n)
    one, other = _means(np.column_stack([eta, known.gaps, size]), first)
    change = np.concatenate([other[:, 0] - one[:, 0], drift @ eta])
    bridged = np.concatenate([other[:, 1] + one[:, 1], np.abs(drift) @ known.gaps])
    differs = np.abs(np.concatenate([other[:, 2:] - one[:, 2:], drift @ size]))
    differs = np.maximum(differs[:, :2].min(axis=1), differs[:, 2:].min(axis=1))  # of energies and of powers
    allowed = known.power_share * (1.0 - mean + known.zeros) * differs + bridged
    within = np.maximum(float((eta - 1.0) @ (eta - 1.0)) - change**2 / spread, 0.0)
    freedom = PRIOR + n - 2
    scatter = np.sqrt((PRIOR * known.repeats**2 + within) / freedom * spread)
    t = np.maximum(np.abs(change) - allowed, 0.0) / scatter
    best = int(t.argmax())
    of_mean = min(first[best], n - first[best]) / n if best < first.size else 0.5
    return CycleComparison(
        metric=metric,
        cycles=cycles,
        mean=mean,
        change=float(change[best]),
        explained=float(allowed[best]),
        scatter=float(scatter[best]),
        freedom=freedom,
        chance=probability(float(t[best]), freedom) * change.size * metrics,
        moved=float((abs(change[best]) - allowed[best]) * mean * of_mean),
        here=_cycles_apart(n, best),
    )


def _means(x: Signal, first: Index) -> tuple[Signal, Signal]:
    """Means of columns over the first cycles of every split and then over each cycle but the first and the last, and means
    over the other cycles, (2 n - 3, columns) each."""
    sums = np.concatenate([np.cumsum(x, axis=0)[:-1], x[1:-1]])
    return sums / first[:, None], (x.sum(axis=0) - sums) / (len(x) - first)[:, None]


def _cycles_apart(n: int, row: int) -> Mask | None:
    """Cycles that a comparison sets against the others, (n,), by its number; None for the drift, which is the last one."""
    if row >= 2 * n - 3:
        return None
    return np.arange(n) <= row if row < n - 1 else np.arange(n) == row - n + 2


@lru_cache(maxsize=16)
def _comparisons(n: int) -> tuple[Index, Signal, Signal]:
    """Comparisons of n cycles: how many are set against the others in each of the first 2 n - 3, the weights of the drift, and
    the variance of each change over that of a cycle.

    The weights, (1, n), give the change from the first to the last cycle along a fitted straight line. Of two cycles that is
    their difference, which is compared anyway: then (0, 2), and so of more than `MAX_ALONG`.
    """
    first = np.concatenate([np.arange(1, n), np.ones(max(n - 2, 0), dtype=np.int64)])
    along = np.linspace(-0.5, 0.5, n)
    drift = (along / (along @ along))[None][: 0 if n > MAX_ALONG else n - 2]
    return first, drift, np.concatenate([1.0 / first + 1.0 / (n - first), np.sum(drift**2, axis=1)])


def probability(t: float, freedom: float) -> float:
    """Probability that Student's t lies beyond t on either side, by Wallace's normal approximation (Biometrika 46, 1959).

    >>> round(probability(2.228, 10), 3)
    0.05
    """
    z = (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) * math.sqrt(freedom * math.log1p(t * t / freedom))
    return math.erfc(z / math.sqrt(2.0))


def _finding(found: CycleComparison) -> Finding:
    """The finding: which cycles differ from which, by how much, and what of it the motion and the gaps explain."""
    cycles, here, span = found.cycles, found.here, found.cycles
    if here is None:
        one, other = found.mean * (1.0 - 0.5 * found.change), found.mean * (1.0 + 0.5 * found.change)
        course = f"drifts from {one:.3f} in cycle {cycles[0].cycle} to {other:.3f} in cycle {cycles[-1].cycle}"
    else:
        eta = np.array([c.metrics[found.metric] for c in cycles])
        one, other = float(np.mean(eta[here])), float(np.mean(eta[~here]))
        fewer = here if here.sum() <= (~here).sum() else ~here
        span = [c for c, chosen in zip(cycles, fewer, strict=True) if chosen]
        course = f"is {one:.3f} in {_named(cycles, here)} and {other:.3f} in {_named(cycles, ~here)}"
    explained = f"; speed, gaps and zeros explain {found.explained:.1%} at most" if found.explained >= 0.0005 else ""
    return Finding(
        "efficiency_change",
        f"{found.metric} {course}, a change of {abs(other - one) / max(one, other):.1%}{explained}",
        f"kept as logged; look at {LOOK_AT.get(found.metric, OTHER_STAGES)}",
        start=span[0].window.onset,
        end=span[-1].window.cutoff,
        count=len(span),
    )


LOOK_AT = {
    "eta_trans": "force, torque and the transmission",
    "eta_gen": "torque, Vdc, Idc, the load and the generator",
    "eta_pto": "force, Vdc, Idc, the load and the machine",
}
"""What may have changed, by efficiency."""

OTHER_STAGES = "the sensors of both stages and what lies between them"
"""What may have changed for an efficiency of stages of a rig file."""


def _named(cycles: Sequence[CycleResult], here: Mask) -> str:
    """Cycles by their numbers: one, a stretch, or all the others."""
    numbers = [c.cycle for c, chosen in zip(cycles, here, strict=True) if chosen]
    if len(numbers) == 1:
        return f"cycle {numbers[0]}"
    rows = np.flatnonzero(here)
    return f"cycles {numbers[0]} to {numbers[-1]}" if rows[-1] - rows[0] == rows.size - 1 else "the others"
