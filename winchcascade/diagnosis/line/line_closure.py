"""How far the gap shrinks on cycles that the fit did not know, and what is left of it there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.white_noise import GAUSS, white_noise
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.closure import DRAWS
from winchcascade.diagnosis.diagnosis_result import Alarm, GapClosure, Remainder, Shrunk, Spot
from winchcascade.diagnosis.line.line_data import POWER, Lines
from winchcascade.diagnosis.line.line_selection import Moments, coefficients, fold_labels
from winchcascade.diagnosis.remainder import ROUGH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import CyclePart
    from winchcascade.diagnosis.line.line_selection import Names

SLOW = 0.2
"""What is left keeps a structure if more than this share of its squares lasts longer than a second."""

LAGS = range(3, 8)
"""Blocks of 0.44 s between two that are multiplied to tell what lasts: 1.3 s to 3.1 s."""

PART_OF_GAP = 0.01
"""A structure that makes less of the squared gap than this decides nothing."""

FEW = 12
"""Fewer threes of neighbouring blocks tell no noise."""

BURST = 0.05
"""The samples that are off most: this share of all."""


class LineClosure(GapClosure, frozen=True):
    """Share of the squared gap that the causes close on the parts that they are judged on: 1 - sum(after^2) / sum(gap^2).

    `after` are, part by part, measured minus predicted at the samples that count, (k,) each [W], by a fit that did not know
    them.
    """

    parts: tuple[CyclePart, ...]
    after: tuple[Signal, ...]

    @property
    def power(self) -> Shrunk:
        """Root mean squares of the power. [W]"""
        return self.channels[POWER]

    @property
    def beyond_noise(self) -> float:
        """Share that is closed of what exceeds the white noise of the power. [1]"""
        before, after, noise = (x**2 for x in (self.power.before, self.power.after, self.power.noise))
        return 1.0 - max(after - noise, 0.0) / (before - noise) if before > noise else 0.0

    @property
    def left_out_in_turn(self) -> bool:
        """Whether the parts took part in the choice and each fold was left out of the fit once."""
        return not self.parts[0].withheld


class LineRemainder(Remainder, frozen=True):
    """What the causes leave on the parts that they are judged on: signs of structure, and how bursty it is.

    `slow` is the share of its squares that lasts longer than a second, `bursts` that of the `BURST` of the samples that are off
    most, `in_worst` that of the phase that holds most of them.
    """

    slow: float
    bursts: float
    in_worst: float


def judge(lines: Lines, m: Moments, names: Names, seed: int) -> LineClosure:
    """Predict every judged sample from a fit without it: withheld parts by the fit as it is, others fold by fold."""
    parts = lines.judged
    labels = fold_labels(parts)
    if parts[0].withheld:
        whole = coefficients(m, lines, names)
        after = [part.gap - part.columns @ whole for part in parts]
    else:
        left_out = np.array([coefficients(m, lines, names, without=g) for g in range(m.folds)])
        after = [
            part.gap - np.sum(part.columns * left_out[own], axis=1) for part, own in zip(parts, labels, strict=True)
        ]
    gap = np.concatenate([part.gap for part in parts])
    left = np.concatenate(after)
    label = np.concatenate(labels)
    old, new = np.bincount(label, gap**2), np.bincount(label, left**2)
    draws = np.random.default_rng(seed).integers(old.size, size=(DRAWS, old.size))
    shares = 1.0 - new[draws].sum(axis=1) / np.maximum(old[draws].sum(axis=1), 1e-300)
    closed = float(1.0 - new.sum() / max(old.sum(), 1e-300))
    low, high = (float(np.quantile(shares, q)) for q in (0.025, 0.975))
    return LineClosure(
        channels={POWER: Shrunk(_rms(gap), _rms(left), white_noise(left))},
        share=closed,
        low=min(low, closed),
        high=max(high, closed),
        parts=parts,
        after=tuple(after),
    )


def _rms(x: Signal) -> float:
    return float(np.sqrt(np.mean(x**2)))


def left_in(parts: Sequence[CyclePart], after: Sequence[Signal], share: float) -> LineRemainder:
    """Tell what is left from noise.

    Parameters
    ----------
    after : measured minus predicted, part by part, (k,) each [W]
    share : of the squared gap that stays open
    """
    square = float(sum(np.sum(part.gap**2) for part in parts))
    means = [part.means(x) for part, x in zip(parts, after, strict=True)]
    alarms = []
    slow = lasting(parts, means, after)
    left = np.concatenate(after) ** 2
    if slow > SLOW and slow * float(left.sum()) > PART_OF_GAP * square:
        alarms.append(Alarm("slow", Spot(POWER), slow, SLOW))
    for phase, name in enumerate(PHASES):
        ratio, beyond = _rough(parts, means, phase)
        if ratio > ROUGH and beyond > PART_OF_GAP * square:
            alarms.append(Alarm("structure", Spot(POWER, name), ratio, ROUGH))
    largest = np.sort(left)[::-1]
    phases = _by_phase(parts, after)
    worst = max(phases, key=lambda name: phases[name])
    return LineRemainder(
        share=share,
        alarms=tuple(sorted(alarms, key=lambda alarm: -alarm.size / alarm.limit)),
        worst=Spot(POWER, worst),
        slow=slow,
        bursts=float(largest[: max(int(BURST * left.size), 1)].sum() / max(left.sum(), 1e-300)),
        in_worst=phases[worst],
    )


def lasting(parts: Sequence[CyclePart], means: Sequence[Signal], after: Sequence[Signal]) -> float:
    """Share of the squares that lasts longer than a second: products of blocks that far apart in one phase. [1]

    No mean is taken off, so a constant that is left lasts.
    """
    total, count = 0.0, 0
    for part, mean in zip(parts, means, strict=True):
        stretch = np.cumsum(~part.blocks.joined)
        for lag in LAGS:
            pairs = mean[lag:] * mean[:-lag]
            both = (stretch[lag:] == stretch[:-lag]) & np.isfinite(pairs)
            total += float(pairs[both].sum())
            count += int(np.count_nonzero(both))
    whole = float(np.mean(np.concatenate(after) ** 2))
    return max(total / count / whole, 0.0) if count and whole > 0.0 else 0.0


def _rough(parts: Sequence[CyclePart], means: Sequence[Signal], phase: int) -> tuple[float, float]:
    """Root mean square of the blocks of one phase over their noise, and the squares beyond it, sample by sample [W2]."""
    noise = block_noise(parts, means, phase)
    own = [mean[(part.blocks.phase == phase) & np.isfinite(mean)] for part, mean in zip(parts, means, strict=True)]
    blocks = np.concatenate(own)
    if not blocks.size or not noise > 0.0:
        return 0.0, 0.0
    samples = sum(
        float(part.blocks.count[(part.blocks.phase == phase) & np.isfinite(mean)].sum())
        for part, mean in zip(parts, means, strict=True)
    )
    square = float(np.mean(blocks**2))
    return math.sqrt(square) / noise, max(square - noise**2, 0.0) * samples


def block_noise(parts: Sequence[CyclePart], means: Sequence[Signal], phase: int) -> float:
    """Standard deviation of a block's mean in one phase, by the median of second differences; NaN where few tell it. [W]"""
    bends = []
    for part, mean in zip(parts, means, strict=True):
        b = part.blocks
        here = (b.phase == phase) & np.isfinite(mean)
        threes = here[:-2] & here[1:-1] & here[2:] & b.joined[1:-1] & b.joined[2:]
        bends.append(np.abs(mean[:-2] - 2.0 * mean[1:-1] + mean[2:])[threes] / math.sqrt(6.0))
    together = np.concatenate(bends)
    return GAUSS * median(together) if together.size >= FEW else math.nan


def _by_phase(parts: Sequence[CyclePart], after: Sequence[Signal]) -> dict[str, float]:
    """Share of the squares in each phase."""
    sums = np.zeros(len(PHASES))
    for part, x in zip(parts, after, strict=True):
        mean = part.means(x**2)
        for phase in range(len(PHASES)):
            here = (part.blocks.phase == phase) & np.isfinite(mean)
            sums[phase] += float(np.sum((mean * part.blocks.count)[here]))
    return dict(zip(PHASES, (sums / max(sums.sum(), 1e-300)).tolist(), strict=True))
