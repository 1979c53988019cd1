"""Efficiencies that change within a log by more than uncertainty and repeatability allow.

The load of a log is fixed, and the gains of its sensors are too. What may change an efficiency is
then the speed. A loss force or torque lies between a constant one and one with the square of the
speed v, so its power lies between v and v^3. Into a resistor the power is proportional to v^2: the
share of the loss changes by no more than v does, or by half of what the power does. Without a
resistor the bound is the change of the power itself.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache

import numpy as np

from winchcascade.core.integrate import distinct, white_noise
from winchcascade.core.run import Mask, Signal
from winchcascade.reduction.checks.phased_log import Fault, PhasedLog
from winchcascade.reduction.efficiency import SMALLEST
from winchcascade.reduction.reduction_result import CycleResult

ALPHA = 0.01
"""Probability of a false finding in one log, or between the logs of one campaign, all
comparisons together. [1]
"""

REPEATABILITY = 0.003
"""Repeatability of an efficiency between cycles, relative standard deviation that is assumed before
any is measured: where a tenth of the power rings at 2 Hz, a window of 5 s that cuts it anywhere
changes an energy by 0.1 / (2 pi 5) = 0.3 %."""

PRIOR = 10
"""The assumed standard deviation has this number of degrees of freedom; more cycles than that
decide for themselves.
"""

MANY = 100
"""Number of cycles of which single ones and a drift are compared, and number of splits of a longer
log: one cycle in more moves the mean too little."""

MOVES = 0.0025
"""Smallest change of interest: it moves the mean efficiency of the log by this. The budget of the
paper's rig, the best on which the tool was used, states efficiencies to 0.003 to 0.005."""

INDEPENDENT = 1 / 15
"""Time over which samples are averaged first, as a share of the width that smooths the velocity:
noise of a sensor that is sampled faster than it responds is not white. [1]"""

LOOK_AT = {
    "eta_trans": "force, torque and the transmission",
    "eta_gen": "torque, Vdc, Idc, the load and the generator",
    "eta_pto": "force, Vdc, Idc, the load and the machine",
}
"""What may have changed, by efficiency."""


def changed_efficiencies(log: PhasedLog) -> Iterator[Fault]:
    """Efficiencies that step or drift over the complete cycles of a log, or that one cycle has
    apart from the others.

    A machine that runs as in an open circuit has no efficiency of interest.
    """
    cascade, given = log.rig.cascade, dict[str, list[int]]()
    for metric in cascade.ratios:
        given[metric] = [k for k, c in enumerate(log.complete) if c.metrics[metric]]
    tested = [m for m in cascade.neighbours if len(given[m]) > 1] or [
        m for m in given if len(given[m]) > 1
    ]
    for metric in () if log.idle else tested:
        yield from largest_change(log, metric, given[metric], len(tested))


def largest_change(
    log: PhasedLog, metric: str, given: Sequence[int], metrics: int
) -> Iterator[Fault]:
    """The most significant change of an efficiency, none where chance, speed, gaps, zeros or
    sampling explain it.

    Parameters
    ----------
    given : which of the complete cycles have the efficiency
    metrics : number of efficiencies that are tested
    """
    stages = [energy.removeprefix("energy_") for energy in log.rig.cascade.ratios[metric]]
    cycles, n = [log.complete[k] for k in given], len(given)
    eta = np.array([c.metrics.value(metric) for c in cycles])
    mean = float(eta.sum()) / n
    joules = np.array([[c.metrics.value(f"energy_{stage}") for stage in stages] for c in cycles])
    joules = np.maximum(joules, log.energies.nothing)
    hidden = sampling_error(log, stages)[given]
    for stage, joule in zip(stages, joules.T, strict=True):
        bridged = log.energies.bridged.get(stage)
        if bridged is not None:
            hidden = (
                hidden + np.array(bridged)[[c.cycle - log.phased.first for c in cycles]] / joule
            )
    lengths = np.array([[c.window.cutoff - c.window.onset] for c in cycles])
    masks, weights = comparisons(n)
    change, unknown = weights @ (eta / mean), np.abs(weights) @ hidden
    differs = np.abs(weights @ np.log(np.hstack([joules, joules / lengths])))
    differs = np.maximum(
        differs[:, :2].min(axis=1), differs[:, 2:].min(axis=1)
    )  # of energies and of powers
    share = (
        0.5 if log.run.load is not None else 1.0
    )  # change of the share of the loss over that of the power
    allowed = share * (1.0 - mean + zero_share(log, cycles)) * differs + unknown
    spread, freedom = np.sum(weights**2, axis=1), PRIOR + n - 2
    within = np.maximum(float(np.sum((eta / mean - 1.0) ** 2)) - change**2 / spread, 0.0)
    for noisy in ((), stages):  # noise makes a change less significant
        repeats = math.hypot(REPEATABILITY, *(energy_noise(log, stage) for stage in noisy))
        t = np.maximum(np.abs(change) - allowed, 0.0) / np.sqrt(
            (PRIOR * repeats**2 + within) / freedom * spread
        )
        best, allowed_chance = int(t.argmax()), ALPHA / (change.size * metrics)
        # The tails of Student's t are above those of the normal distribution, which need no import.
        if math.erfc(float(t[best]) / math.sqrt(2.0)) > allowed_chance:
            return
        if probability(float(t[best]), freedom) > allowed_chance:
            return
    # Cycles of the smaller part; of a drift half.
    apart = min(int(masks[best].sum()), n - int(masks[best].sum())) or 0.5 * n
    if (abs(change[best]) - allowed[best]) * mean * apart / n >= MOVES:
        yield _fault(metric, cycles, masks[best], mean, float(change[best]), float(allowed[best]))


def probability(t: float, freedom: float) -> float:
    """Probability that Student's t lies beyond t on either side.

    >>> round(probability(2.228, 10), 3)
    0.05
    """
    from scipy.special import stdtr

    return 2.0 * float(stdtr(freedom, -t))


@lru_cache(maxsize=16)
def comparisons(n: int) -> tuple[Mask, Signal]:
    """Which of n cycles are set against the others in each of m comparisons, and their weights in
    the change, (m, n) each.

    The first cycles of every split, every cycle alone, and the change along a fitted straight line,
    which sets none apart.
    """
    splits = distinct(np.linspace(1, n - 1, min(n - 1, MANY)).astype(np.intp))
    alone = np.arange(1, n - 1 if n <= MANY else 1)
    masks = np.vstack([np.arange(n) < splits[:, None], np.arange(n) == alone[:, None]])
    size = masks.sum(axis=1, keepdims=True)
    weights = np.where(masks, -1.0 / size, 1.0 / (n - size))
    if 2 < n <= MANY:
        along = np.linspace(-0.5, 0.5, n)
        masks, weights = (
            np.vstack([masks, np.zeros(n, dtype=bool)]),
            np.vstack([weights, along / (along @ along)]),
        )
    return masks, weights


def _fault(
    metric: str,
    cycles: Sequence[CycleResult],
    here: Mask,
    mean: float,
    change: float,
    explained: float,
) -> Fault:
    """The fault of some cycles that differ from the others, or of all that drift."""
    eta, numbers = (
        np.array([c.metrics.value(metric) for c in cycles]),
        np.array([c.cycle for c in cycles]),
    )
    one, other, course = mean * (1.0 - 0.5 * change), mean * (1.0 + 0.5 * change), "drifts from"
    named, apart = [numbers[:1], numbers[-1:]], list(cycles)
    if here.any():
        one, other, course, named = (
            float(np.mean(eta[here])),
            float(np.mean(eta[~here])),
            "is",
            [numbers[here], numbers[~here]],
        )
        fewer = here if here.sum() <= (~here).sum() else ~here
        apart = [c for c, chosen in zip(cycles, fewer, strict=True) if chosen]
    values = {
        "metric": metric, "course": course, "one": one, "other": other, "in_one": _cycles(named[0]),
        "in_other": _cycles(named[1]), "change": abs(other - one) / max(one, other), "explained": explained,
        "look_at": LOOK_AT.get(metric, "the sensors of both stages and what lies between them"),
    }  # fmt: skip
    return Fault(
        "changed_efficiency", None, [(c.window.onset, c.window.cutoff) for c in apart], values
    )


def _cycles(numbers: Signal) -> str:
    """Cycles by their numbers: one, a stretch, or all the others."""
    if len(numbers) == 1:
        return f"cycle {numbers[0]}"
    return (
        f"cycles {numbers[0]} to {numbers[-1]}"
        if numbers[-1] - numbers[0] == len(numbers) - 1
        else "the others"
    )


def sampling_error(log: PhasedLog, stages: Sequence[str]) -> Signal:
    """What sampling may change of an efficiency in each whole cycle, (k,): a third of what
    thinning does (Richardson). [1]
    """
    changes = [log.thinned[stage][:2] for stage in stages if stage in log.thinned]
    if len(changes) < 2:
        return np.zeros(len(log.complete))
    return np.asarray(np.max(np.nan_to_num(np.abs(changes[0] - changes[1]), nan=1.0), axis=0) / 3.0)


def zero_share(log: PhasedLog, cycles: Sequence[CycleResult]) -> float:
    """Share that the zeros of force cell and torque sensor may have in what they read on the
    plateau. [1]
    """
    total, plateaus = 0.0, [p for c in cycles if (p := c.summary.payout.plateau) is not None]
    for channel, values in (
        ("force", [p.force for p in plateaus]),
        ("torque", [p.torque for p in plateaus]),
    ):
        read, zero = [abs(x) for x in values if x is not None], 2.0 * log.phased.u_zero(channel)
        total += zero / max(sum(read) / len(read), zero) if read and zero else 0.0
    return total


def energy_noise(log: PhasedLog, stage: str) -> float:
    """Relative standard deviation of the energy of a stage in a window by the white noise of its
    power in the payout. [1]

    In the sum of the power over n samples the noise averages out by the square root of n.
    """
    count, shares = (
        max(1, int(INDEPENDENT * log.rig.thresholds.smoothing * log.run.fs + 1e-6)),
        [0.0],
    )
    stream = log.powers[stage].stream(log.run.channels, log.rig.r_drum)
    for cycle in log.complete:
        spans = (
            (cycle.phases.onset, cycle.phases.payout_end),
            (cycle.window.onset, cycle.window.cutoff),
        )
        watts = [stream(log.phased.rows(*span)) for span in spans]
        payout, window = (
            x[: x.size // count * count].reshape(-1, count).mean(axis=1) for x in watts
        )
        shares.append(
            white_noise(payout) * math.sqrt(window.size) / max(abs(float(window.sum())), SMALLEST)
        )
    return math.sqrt(float(np.sum(np.square(shares))) / max(len(log.complete), 1))
