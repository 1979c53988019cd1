"""Efficiencies that change within a log by more than uncertainty and repeatability allow.

The load of a log is fixed, and the gains of its sensors are too. What may change an efficiency is then the speed. A loss
force or torque lies between a constant one and one with the square of the speed v, so its power lies between v and v^3.
Into a resistor the power is proportional to v^2: the share of the loss changes by no more than v does, or by half of what
the power does. Without a resistor the bound is the change of the power itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from winchcascade.core.accuracy import error_sources
from winchcascade.core.integrate import white_noise
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.efficiency import NOTHING, runs_idle
from winchcascade.reduction.reduction_result import CycleResult

ALPHA = 0.01
"""Probability of a false finding in one log, or between the logs of one campaign, all comparisons together. [1]"""

REPEATABILITY = 0.003
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

INDEPENDENT = 0.04
"""Time over which samples are averaged first: noise of a sensor that is sampled faster than it responds is not white. [s]"""

LOOK_AT = {
    "eta_trans": "force, torque and the transmission",
    "eta_gen": "torque, Vdc, Idc, the load and the generator",
    "eta_pto": "force, Vdc, Idc, the load and the machine",
}
"""What may have changed, by efficiency."""


def changed_efficiencies(log: PhasedLog) -> Iterator[Fault]:
    """Efficiencies that step or drift over the complete cycles of a log, or that one cycle has apart from the others.

    Every split into first and last cycles is compared, every cycle with the others, and a straight line is fitted to all. An
    open circuit, or a machine that runs as in one, has no efficiency of interest.
    """
    cascade, whole = log.phased.rig.cascade, [c for c in log.results if c.complete]
    if log.phased.run.open_circuit or not cascade.neighbours:
        return
    last, overall = cascade.neighbours[-1], cascade.overall
    if runs_idle([c.metrics[last] if c.metrics[overall] is None else c.metrics[overall] for c in whole]):
        return
    given = {m: [k for k, c in enumerate(whole) if c.metrics[m] is not None] for m in cascade.ratios}
    tested = [m for m in cascade.neighbours if len(given[m]) > 1] or [overall] * (len(given[overall]) > 1)
    for metric in tested:
        found = largest_change(log, metric, given[metric], len(tested))
        if found is not None:
            yield found


def largest_change(log: PhasedLog, metric: str, given: Sequence[int], metrics: int) -> Fault | None:
    """The most significant change of an efficiency, None where chance, speed, gaps, zeros or sampling explain it.

    Parameters
    ----------
    given : which of the complete cycles have the efficiency
    metrics : number of efficiencies that are tested
    """
    whole = [(k, c) for k, c in enumerate(log.results) if c.complete]
    stages = [energy.removeprefix("energy_") for energy in log.phased.rig.cascade.ratios[metric]]
    cycles, n = [whole[k][1] for k in given], len(given)
    eta = np.array([c.metrics.value(metric) for c in cycles])
    mean = float(eta.sum()) / n
    if mean <= 0.0:
        return None
    eta = eta / mean
    energies = np.array([[c.metrics.value(f"energy_{stage}") for stage in stages] for c in cycles])
    hidden = sampling_error(log, stages)[given]
    for stage, joule in zip(stages, energies.T, strict=True):
        bridged = log.energies.bridged.get(stage)
        hidden = hidden + (
            0.0 if bridged is None else np.array([bridged[whole[k][0]] for k in given]) / np.maximum(joule, NOTHING)
        )
    energies = np.maximum(energies, NOTHING)
    lengths = np.array([[c.window.cutoff - c.window.onset] for c in cycles])
    size = np.log(np.hstack([energies, energies / lengths]))
    first, drift, spread = _comparisons(n)
    one, other = _means(np.column_stack([eta, hidden, size]), first)
    change = np.concatenate([other[:, 0] - one[:, 0], drift @ eta])
    unknown = np.concatenate([other[:, 1] + one[:, 1], np.abs(drift) @ hidden])
    differs = np.abs(np.concatenate([other[:, 2:] - one[:, 2:], drift @ size]))
    differs = np.maximum(differs[:, :2].min(axis=1), differs[:, 2:].min(axis=1))  # of energies and of powers
    share = 0.5 if log.phased.run.load is not None else 1.0  # change of the share of the loss over that of the power
    allowed = share * (1.0 - mean + zero_share(log, cycles)) * differs + unknown
    within = np.maximum(float((eta - 1.0) @ (eta - 1.0)) - change**2 / spread, 0.0)
    freedom = PRIOR + n - 2
    for noisy in ((), stages):  # noise makes a change less significant
        repeats = math.hypot(REPEATABILITY, *(energy_noise(log, stage) for stage in noisy))
        scatter = np.sqrt((PRIOR * repeats**2 + within) / freedom * spread)
        t = np.maximum(np.abs(change) - allowed, 0.0) / scatter
        best = int(t.argmax())
        if probability(float(t[best]), freedom) * change.size * metrics > ALPHA:
            return None
    of_mean = min(first[best], n - first[best]) / n if best < first.size else 0.5
    if (abs(change[best]) - allowed[best]) * mean * of_mean < MOVES:
        return None
    here = None
    if best < first.size:
        here = np.arange(n) <= best if best < n - 1 else np.arange(n) == best - n + 2
    return _fault(metric, cycles, here, mean, float(change[best]), float(allowed[best]))


def _fault(
    metric: str, cycles: Sequence[CycleResult], here: Mask | None, mean: float, change: float, explained: float
) -> Fault:
    """The fault of some cycles that differ from the others, or of all that drift."""
    values: dict[str, object] = {"metric": metric, "explained": explained}
    values["look_at"] = LOOK_AT.get(metric, "the sensors of both stages and what lies between them")
    places, apart = (f"cycle {cycles[0].cycle}", f"cycle {cycles[-1].cycle}"), cycles
    one, other, course = mean * (1.0 - 0.5 * change), mean * (1.0 + 0.5 * change), "drifts from"
    if here is not None:
        eta, course = np.array([c.metrics.value(metric) for c in cycles]), "is"
        one, other = float(np.mean(eta[here])), float(np.mean(eta[~here]))
        named = [[c.cycle for c, chosen in zip(cycles, mask, strict=True) if chosen] for mask in (here, ~here)]
        places = (_cycles(named[0]), _cycles(named[1]))
        fewer = here if here.sum() <= (~here).sum() else ~here
        apart = [c for c, chosen in zip(cycles, fewer, strict=True) if chosen]
    values |= {"course": course, "one": one, "other": other, "in_one": places[0], "in_other": places[1]}
    values["change"] = abs(other - one) / max(one, other)
    return Fault("changed_efficiency", None, values, spans=[(c.window.onset, c.window.cutoff) for c in apart])


def _cycles(numbers: Sequence[int]) -> str:
    """Cycles by their numbers: one, a stretch, or all the others."""
    if len(numbers) == 1:
        return f"cycle {numbers[0]}"
    return f"cycles {numbers[0]} to {numbers[-1]}" if numbers[-1] - numbers[0] == len(numbers) - 1 else "the others"


def sampling_error(log: PhasedLog, stages: Sequence[str]) -> Signal:
    """What sampling may change of an efficiency in each whole cycle, (k,): a third of what thinning does (Richardson). [1]"""
    changes = [log.thinned[stage][:2] for stage in stages if stage in log.thinned]
    if len(changes) < 2:
        return np.zeros(sum(c.complete for c in log.results))
    error: Signal = np.max(np.nan_to_num(np.abs(changes[0] - changes[1]), nan=1.0), axis=0) / 3.0
    return error


def zero_share(log: PhasedLog, cycles: Sequence[CycleResult]) -> float:
    """Share that the zeros of force cell and torque sensor may have in what they read on the plateau. [1]"""
    total, sensors = 0.0, log.phased.rig.sensors
    plateaus = [p for c in cycles if (p := c.summary.payout.plateau) is not None]
    for channel, values in (("force", [p.force for p in plateaus]), ("torque", [p.torque for p in plateaus])):
        read = [abs(x) for x in values if x is not None]
        if read and channel in sensors:
            zero = sum(s.limit or 2.0 * s.u for s in error_sources(channel, sensors[channel]) if s.part == "zero")
            total += zero / max(sum(read) / len(read), zero) if zero else 0.0
    return total


def energy_noise(log: PhasedLog, stage: str) -> float:
    """Relative standard deviation of the energy of a stage in a window by the white noise of its channels. [1]

    In the sum of the power over n samples the noise averages out by the square root of n.
    """
    run, rig = log.phased.run, log.phased.rig
    power = next(one for one in rig.cascade.stages if one.name == stage).power(run.channels, rig.r_drum)
    count, square = max(1, int(INDEPENDENT * run.fs + 1e-6)), []
    for k in log.phased.chosen() if power is not None else ():
        cycle, window = log.phased.cycles[k], log.energies.windows[k]
        rows = log.phased.rows(window.onset, window.cutoff)
        if power is None or window.fault is not None or rows.stop - rows.start < count:
            continue
        payout = log.phased.rows(cycle.onset, cycle.payout_end)
        means = {name: _averaged(run.channels[name][rows], count) for name in power.channels}
        variance = 0.0
        for name in power.channels:  # a term is linear in each of its channels
            terms = [term for term in power.terms if name in term.channels]
            others = means | {name: np.ones(means[name].size)}
            slope = sum(term.watts(others, rig.r_drum, slice(None)) for term in terms)
            variance += white_noise(_averaged(run.channels[name][payout], count)) ** 2 * float(np.sum(slope**2))
        joules = float(np.sum(power.stream(means, rig.r_drum)(slice(None))))
        square.append(variance / max(joules**2, NOTHING))
    return math.sqrt(sum(square) / len(square)) if square else 0.0


def _averaged(x: Signal, count: int) -> Signal:
    """Means over groups of samples of equal size."""
    means: Signal = x[: x.size // count * count].reshape(-1, count).mean(axis=1)
    return means


def _means(x: Signal, first: Index) -> tuple[Signal, Signal]:
    """Means of columns over the first cycles of every split and then over each cycle but the first and the last, and means
    over the other cycles, (2 n - 3, columns) each."""
    sums = np.concatenate([np.cumsum(x, axis=0)[:-1], x[1:-1]])
    return sums / first[:, None], (x.sum(axis=0) - sums) / (len(x) - first)[:, None]


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
