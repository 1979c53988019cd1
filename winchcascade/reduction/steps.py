"""Steady operating points of a dynamometer: stretches in which speed and torque stay within a band."""

from __future__ import annotations

import math

import numpy as np

from winchcascade.core.integrate import GAUSS, median, quantile
from winchcascade.core.rig_file import PhaseRule
from winchcascade.core.run import Index, Mask, Run, Signal
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.phases import Cycle

BLOCKS = 8
"""Number of blocks in the shortest step: noise of torque averages out in each, and a step begins in time to an eighth."""

NOISE = 5.0
"""Widening of a band: range of a few dozen block means that scatter by noise alone, in their standard deviations."""

MIN_CHANGES = 20
"""Fewer changes show no noise."""

WIDTH_QUANTILE = 0.99
"""Quantile of |speed| and |torque| whose share is the width of a band: a single peak does not widen it. [1]"""


def find_steps(run: Run, rule: PhaseRule, gap_max: float) -> list[Cycle]:
    """Find the steady operating points of a run in order of time; its settling is left out of each.

    Speed, and torque where it is logged, are averaged over blocks of an eighth of the shortest step. A step is the longest
    stretch of blocks from its first one on that stay within both bands; blocks of the settling before it, which still lie
    within the bands, do not make it shorter. It is none where the shaft rests.

    Parameters
    ----------
    gap_max : a longer gap ends a step [s]
    """
    at = _blocks(run, rule)
    if at.size < 2:
        return []
    found = []
    names = [name for name in ("speed", "torque") if name in run.channels]
    means = np.array([np.add.reduceat(run.channels[name], at[:-1]) / np.diff(at) for name in names])
    shares = {"speed": rule.speed_band, "torque": rule.torque_band}
    rows = int(at[1] - at[0])
    widths = [
        shares[name] * quantile(np.abs(run.channels[name]), WIDTH_QUANTILE) + NOISE * _noise(run.channels[name], rows)
        for name in names
    ]
    unusable = _touched(run, at, gap_max) | (np.abs(means[0]) <= rule.omega_onset)
    t, ends = run.t, at[1:] - 1
    settling = math.ceil(rule.settle * run.fs / rows)
    k = 0
    while k < ends.size:
        k, stop = _longest(means, widths, unusable, range(k, min(k + settling + 1, ends.size)))
        first = int(np.searchsorted(t, t[at[k]] + rule.settle))
        last = int(ends[stop - 1])
        if not unusable[k] and first < last and t[last] - t[first] >= rule.step_min:
            found.append(Cycle(float(t[first]), float(t[last]), None, None, begins_inside=False, ends_inside=False))
            k = stop
        else:
            k += 1
    return found


def _noise(x: Signal, rows: int) -> float:
    """Standard deviation of block means by the noise of the samples, where the channel is not constant."""
    change = np.diff(x)
    change = change[change != 0.0]
    if change.size < MIN_CHANGES:
        return 0.0
    return GAUSS * median(np.abs(change - median(change))) / math.sqrt(2.0 * rows)


def _blocks(run: Run, rule: PhaseRule) -> Index:
    """First rows of the blocks and the row after the last one; a block is one sample at least."""
    rows = max(1, round(rule.step_min / BLOCKS * run.fs))
    return np.append(np.arange(0, run.t.size - rows + 1, rows), run.t.size)


def _touched(run: Run, at: Index, gap_max: float) -> Mask:
    """Blocks in which, or directly before which, a long gap lies."""
    gaps = all_gaps(run, [name for name in ("speed", "torque") if name in run.channels])
    after = np.searchsorted(run.t, gaps[gaps[:, 1] - gaps[:, 0] > gap_max, 1])
    touched = np.zeros(at.size - 1, dtype=bool)
    touched[np.clip(np.searchsorted(at, after, side="right") - 1, 0, touched.size - 1)] = True
    return touched


def _longest(means: Signal, widths: list[float], unusable: Mask, begins: range) -> tuple[int, int]:
    """First block of the longest stretch, of those that begin within some steady blocks, and the block after it."""
    first, stop = begins[0], _steady_until(means, widths, unusable, begins[0])
    for k in begins[1:]:
        if k >= stop:
            break
        if (end := _steady_until(means, widths, unusable, k)) - k > stop - first:
            first, stop = k, end
    return first, stop


def _steady_until(means: Signal, widths: list[float], unusable: Mask, first: int) -> int:
    """Number of the first block that does not belong to the steady stretch from a block on."""
    low, high = means[:, first].copy(), means[:, first].copy()
    for k in range(first + 1, means.shape[1]):
        if unusable[k]:
            return k
        np.minimum(low, means[:, k], out=low)
        np.maximum(high, means[:, k], out=high)
        if np.any(high - low > widths):
            return k
    return int(means.shape[1])
