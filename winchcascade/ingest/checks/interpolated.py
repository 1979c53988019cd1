"""Stretches in which a noisy channel has no noise: a gap that was filled in by interpolation before the log was read.

The samples of such a stretch lie on a line, straight or slightly curved, between two measured ones. Energies over it are those
of the line. A channel may be calm while the machine rests, or at zero while its clutch is open: such stretches do not count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from winchcascade.core.integrate import ENOUGH, largest, median
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.core.smooth import evenly_stamped
from winchcascade.ingest.checks.spikes import AROUND, Bends
from winchcascade.ingest.checks.stuck import IDLE, TURNS, UNLIKELY
from winchcascade.ingest.checks.witnesses import LookAlikes, samples_of

MOSTLY_EVEN = 0.9
"""Smallest share of evenly stamped samples. [1]"""

SHOWN = 50
"""Smallest number of other samples in motion that show the usual noise of a channel."""

FOLLOWS = 2.5
"""A sample of white noise continues the line of those before it so many times as often as any three lie on a line: the standard
deviation of a curvature is the square root of 6 times that of the noise. [1]"""

RARELY = 0.02
"""Smallest chance of this that is believed. [1]"""

REPEATS = 0.3
"""Largest share of the samples that may repeat the one before: of values that are held, each step is a bend. [1]"""

REVERSES = 1.2
"""Minimum median change of the curvature from sample to sample, in median curvatures: 1.8 of white noise, and less than 1 of a
smooth course, which is straight where it turns. [1]"""

MIN_TURNS = 2
"""Reversals that even a short curve may have."""

NEAR = 4 * AROUND
"""Samples before and after a stretch among which the nearest `AROUND` outside of calm stretches are sought."""

NOISY = 0.25
"""Minimum median curvature of the samples just before and after a stretch, as a share of the usual one. [1]"""

ROUNDING = 1e-12
"""Largest error of a computed line, as a share of its values. [1]"""

SAME = 3
"""Samples by which the ends of a stretch may differ between channels that were filled in together."""


def find_interpolated(
    t: Signal, channels: Mapping[str, Signal], bends: Mapping[str, Bends], moving: Mask
) -> dict[str, Index]:
    """Find the samples that were filled in, (k,) places in the log, for each channel that has any.

    Where one channel shows a filled gap for sure, it also counts in each other channel that is calm over the same samples.

    Parameters
    ----------
    t : (n,) stamps [s]; mostly uneven ones bend a channel without noise, too, and nothing is found
    channels : (n,) each, NaN where they have holes
    bends : where each channel bends sharply and where it is calm; that of a channel that is left out does not count
    moving : (n,) whether the line moves; all are set where that is unknown
    """
    calm = {name: _calm_in_motion(bends[name], moving) for name in channels if name in bends}
    certain = [_certain(name, channels, bends[name], moving, stretches) for name, stretches in calm.items()]
    sure = np.concatenate([np.empty((0, 2), dtype=np.intp), *certain])
    found: dict[str, Index] = {}
    if not len(sure) or np.count_nonzero(evenly_stamped(t, 1)) < MOSTLY_EVEN * t.size:
        return found
    for name, stretches in calm.items():
        filled = [np.arange(a, b + 1) for a, b in sure.tolist() if _is_among((a, b), stretches)]
        if filled:
            found[name] = np.unique(np.concatenate(filled))
    return found


def _is_among(one: tuple[int, int], stretches: Index) -> bool:
    """Whether a stretch has about the same ends as one of others, which are in order."""
    first, last = np.searchsorted(stretches[:, 0], (one[0] - SAME, one[0] + SAME + 1))
    return bool((np.abs(stretches[first:last, 1] - one[1]) <= SAME).any())


def _calm_in_motion(bends: Bends, moving: Mask) -> Index:
    """Calm stretches of a channel, first and last place in the log, (k, 2), in which the line moves for most of the time."""
    stretches = bends.logged(bends.calm)
    return stretches[2 * _count(moving, stretches) > stretches[:, 1] - stretches[:, 0]]


def _count(mask: Mask, stretches: Index) -> Index:
    """Number of samples in each stretch at which a mask is set, (k,)."""
    return np.array([np.count_nonzero(mask[a : b + 1]) for a, b in stretches.tolist()], dtype=np.intp)


def _certain(name: str, channels: Mapping[str, Signal], bends: Bends, moving: Mask, stretches: Index) -> Index:
    """Those of some calm stretches of a channel that are longer than its noise allows, (k, 2).

    They are not longer if the channel is as calm elsewhere in the same state of all other channels.
    """
    free = moving.copy()
    for a, b in stretches.tolist():
        free[a : b + 1] = False
    if not len(stretches) or 2 * np.count_nonzero(free) < np.count_nonzero(moving):
        return stretches[:0]
    x, place = bends.x, bends.place
    shown = np.flatnonzero(free[:ENOUGH] if place is None else free[place[:ENOUGH]])
    shown = shown[(shown > 0) & (shown < x.size - 2)]
    bend = np.diff(x[: ENOUGH + 2], 2)
    curvature, reversal = np.abs(bend[shown - 1]), np.abs(bend[shown] - bend[shown - 1])
    repeats = np.count_nonzero(x[shown] == x[shown - 1])
    if shown.size < SHOWN or repeats > REPEATS * shown.size or median(reversal) < REVERSES * median(curvature):
        return stretches[:0]
    chance = FOLLOWS * max(np.count_nonzero(curvature <= bends.usual.calm) / shown.size, RARELY)
    stretches = stretches[_count(moving, stretches) * math.log(min(chance, 1.0)) < UNLIKELY]
    rows = stretches if place is None else np.searchsorted(place, stretches)
    idle = IDLE * max(abs(bends.usual.low), abs(bends.usual.high))
    sure = [_is_line(x[a : b + 1], idle) and _has_noise_beside(bends, a, b) for a, b in rows.tolist()]
    found: Index = stretches[np.array(sure, dtype=bool)]
    if not len(found):
        return found
    line = np.zeros(channels[name].size, dtype=bool)
    line[1:-1] = np.abs(np.diff(channels[name], 2)) <= bends.usual.calm
    ends = [(a, b + 1) for a, b in found.tolist()]
    alike, suspects = LookAlikes(channels), samples_of(ends, line.size)
    chances = [FOLLOWS * max(alike.calm(name, stretch, line, suspects), RARELY) for stretch in ends]
    usual = np.array(
        [n * math.log(min(c, 1.0)) >= UNLIKELY for n, c in zip(_count(moving, found), chances, strict=True)]
    )
    apart: Index = found[~usual]
    return apart


def _is_line(x: Signal, idle: float) -> bool:
    """Whether a calm stretch goes one way as a line does, is no idle output, and not mostly one value, which `stuck` judges."""
    if largest(x) <= idle or 2 * np.count_nonzero(x == x[x.size // 2]) >= x.size:
        return False
    change = np.diff(x)
    change = change[np.abs(change) > ROUNDING * largest(x)]
    turns = np.count_nonzero(change[1:] * change[:-1] < 0)
    return bool(turns <= max(MIN_TURNS, TURNS * change.size))


def _has_noise_beside(bends: Bends, first: int, last: int) -> bool:
    """Whether the channel has its noise just before and after a stretch, apart from other calm stretches.

    At an end of the log nothing can be filled in.
    """
    x, begins, ends = bends.x, *bends.calm.T
    for part in (slice(max(first - NEAR, 1), first), slice(last + 1, min(last + 1 + NEAR, x.size - 1))):
        outside = np.ones(max(part.stop - part.start, 0), dtype=bool)
        for k in range(int(np.searchsorted(ends, part.start)), int(np.searchsorted(begins, part.stop))):
            outside[max(begins[k] - part.start, 0) : ends[k] + 1 - part.start] = False
        if not outside.any():
            return False
        curvature = np.abs(np.diff(x[part.start - 1 : part.stop + 1], 2))[outside]
        beside = curvature[-AROUND:] if part.stop == first else curvature[:AROUND]
        if median(beside) < NOISY * bends.usual.noise:
            return False
    return True
