"""Samples that no machine gives: filled rows, codes and dropouts, spikes, filled gaps and stale values. One function per fault.

A check takes a log and the name of a channel and returns a mask of the samples that have the fault, (n,); it changes nothing.
`FAULTS` lists the checks with the kind and the words of their findings.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, median, stretches_of
from winchcascade.core.run import FindingKind, Index, Mask, Signal
from winchcascade.ingest.checks.samples import OF_RANGE, Level, Samples, limits_of
from winchcascade.ingest.checks.witnesses import NEARBY, contradicted, shown

SHORT = 5
"""Samples of the longest spike; what lasts longer is judged by the value that it holds and by the other channels. [1]"""

AGREE = 0.25
"""The neighbours of a spike agree with each other, and its samples with it, within this share of it: no step, no ringing. [1]"""

APART = 5.0
"""Smallest jump of a spike over the usual change from sample to sample beside it: ringing and noise have no spikes. [1]"""

HELD_TIME = 0.2
"""Shortest time for which a value is held that is entered or left without a jump. [s]"""

MIN_HELD = 6
"""Fewest equal samples of a stale value: by chance a channel that repeats one sample in fifty does so once in 3e8. [1]"""

BESIDE = 48
"""Number of samples on either side, in the same state of motion, that show how often a channel holds still: enough for a chance
of one in fifty. [1]"""

CERTAIN = math.log(1e-8)
"""Logarithm of the chance below which a channel does not hold still by accident: not once in the samples of a long log. [1]"""

TURNS = 0.3
"""Smallest share of the changes of a noisy channel that reverse at once; two thirds of white noise, none of a ramp. [1]"""

CALM = 0.05
"""Largest second difference of a filled gap, in usual ones; and each sample is rounded by up to half a step of the channel. [1]"""

CONTINUES = 2.5
"""A sample of white noise continues the line of those before it so many times as often as any three samples lie on a line: the
standard deviation of a second difference is the square root of 6 times that of the noise. [1]"""

TRAVEL = 0.1
"""Travel of the line after which displacement, pressure and a held velocity must show it: beyond lag and stretch. [m]"""

STEPS = 5.0
"""The same in steps of the resolution of the channel. [1]"""

SLOW = 0.02
"""Largest share of the values of a slow channel with filled rows whose neighbours hold a value, too. [1]"""


class Check(NamedTuple):
    """One fault: the kind of its finding, the words after the number of samples, and the function that marks them."""

    kind: FindingKind
    words: str
    mask: Callable[[Samples, str], Mask]


# ------------------------------------------------------------------------------------------------- rows of a slow channel
def filled_rows(log: Samples, name: str) -> Mask:
    """Rows of a slow channel that hold 0 because it had no new value.

    Zeros that last longer than two updates are measurements: of them the rows of the updates are kept.
    """
    x, filled = log.channels[name], np.zeros(log.t.size, dtype=bool)
    held = np.flatnonzero(x)
    steps = np.diff(held)
    if 2 * held.size > 1.1 * x.size or held.size < 4 * SHORT or np.count_nonzero(steps == 1) > SLOW * held.size:
        return filled
    every = int(median(steps.astype(np.float64)))
    if every < 2 or np.count_nonzero(steps % every) > SLOW * held.size:
        return filled
    filled[held[0] : held[-1]] = True
    filled[held] = False
    for a, b in zip(held[:-1][steps > 2 * every].tolist(), held[1:][steps > 2 * every].tolist(), strict=True):
        filled[a:b:every] = False
    return filled


# ------------------------------------------------------------------------------------------------------- what jumps away
def spikes(log: Samples, name: str) -> Mask:
    """A few samples that jump away from their neighbours and back (a Hampel filter at the jumps), shown by no other channel."""
    bad = np.zeros(log.t.size, dtype=bool)
    x, place = _known(log.channels[name])
    level = log.level(name)
    at = _jumps(x, level.fault)
    if not at.size:
        return bad
    jumps = np.zeros(x.size + 1, dtype=bool)
    jumps[at + 1] = jumps[0] = jumps[-1] = True  # into each sample; a spike may be the first or the last of a log
    for length in range(1, SHORT + 1):
        before = np.flatnonzero(jumps[: x.size + 1 - length] & jumps[length : x.size + 1]) - 1
        for first in before[_are_spikes(log, name, x, before, length)].tolist():
            begin, last = int(place[first + 1]), int(place[first + length]) + 1
            if last - begin <= SHORT and (_cannot_be(log, name, begin, last) or not _is_shown(log, name, begin, last)):
                bad[begin:last] = True
    return bad


def _are_spikes(log: Samples, name: str, x: Signal, before: Index, length: int) -> Mask:
    """Which stretches of a length, each after the sample `before`, are off a calm line through their neighbours alike, (k,)."""
    if not before.size:
        return np.zeros(0, dtype=bool)
    rows = before[:, None]
    inside = x[rows + 1 + np.arange(length)]
    ends = x[_within(rows + np.array([-1, 0, length + 1, length + 2]), x.size, length)]
    off = inside - 0.5 * (ends[:, 1:2] + ends[:, 2:3])
    size = np.min(np.abs(off), axis=1)
    alike = (np.ptp(np.sign(off), axis=1) == 0) & (np.ptp(off, axis=1) <= AGREE * size)
    agree = np.ptp(ends, axis=1) < AGREE * size
    around = np.concatenate((np.arange(-NEARBY, 0), np.arange(length + 1, length + NEARBY + 1)))
    later, earlier = (x[_within(rows + around + k, x.size, length)] for k in (1, 0))
    usual = np.median(np.abs(later - earlier), axis=1)
    far = _is_wild(log, name, inside).all(axis=1) & ~_is_wild(log, name, ends[:, 1:3]).any(axis=1)
    found: Mask = (size > log.level(name).fault) & agree & ((alike & (size > APART * usual)) | far)
    return found


def _within(rows: Index, n: int, length: int) -> Index:
    """Rows, with those beyond an end of the log taken from the other side of a stretch of this length."""
    rows = np.where(rows < 0, length - 1 - rows, rows)
    found: Index = np.clip(np.where(rows >= n, 2 * n - 1 - length - rows, rows), 0, n - 1)
    return found


def dropouts(log: Samples, name: str) -> Mask:
    """Stretches in which a channel jumps to a value and holds it, or nearly so, while the machine continues."""
    bad = np.zeros(log.t.size, dtype=bool)
    x, place = _known(log.channels[name])
    level = log.level(name)
    at = _jumps(x, level.fault)
    for first, after in _held_stretches(x, at, level, int(HELD_TIME / float(log.t[1] - log.t[0]))):
        begin, last = int(place[first]), int(place[after - 1]) + 1
        if last - begin >= log.t.size or bad[begin]:
            continue
        far = bool(_is_wild(log, name, x[first:after]).all())
        if far or _cannot_be(log, name, begin, last):
            bad[begin:last] = True
        elif name not in ("displacement", "pressure") or not log.by_line:
            fault = not _is_shown(log, name, begin, last) and contradicted(log, name, begin, last)
            bad[begin:last] |= fault
    return bad


def _held_stretches(x: Signal, at: Index, level: Level, least: int) -> list[tuple[int, int]]:
    """Stretches [first, after) that a jump begins or ends and that hold one value, or vary little beside their two jumps.

    Parameters
    ----------
    at : samples before the jumps
    least : samples of a stretch that is entered or left without a jump
    """
    if not at.size:
        return []
    found, starts = [], np.concatenate(([0], at + 1))
    size = np.concatenate(([np.nan], x[at + 1] - x[at], [np.nan]))
    into, out = size[:-1], size[1:]
    low, high = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    count = np.diff(np.append(starts, x.size))
    jump = np.fmin(np.abs(into), np.abs(out))
    back = ~(into * out > 0.0) & (jump > 2.0 * OF_RANGE * level.span)
    flat = np.where(count > SHORT, high - low < 0.5 * jump, high == low) & np.where(np.isnan(into * out), high == low, True)
    chosen = back & flat
    found += list(zip(starts[chosen].tolist(), (starts + count)[chosen].tolist(), strict=True))
    least = max(least, MIN_HELD)
    for k in at[np.abs(x[at + 1] - x[at]) > 5.0 * OF_RANGE * level.span].tolist():  # one end alone
        for first, step in ((k + 1, 1), (k, -1)):
            if 0 <= first + step * (least - 1) < x.size and np.all(x[first : first + step * least : step] == x[first]):
                rest = x[first:] if step > 0 else x[first::-1]
                other = np.flatnonzero(rest != x[first])
                length = int(other[0]) if other.size else rest.size
                found.append((first, first + length) if step > 0 else (first - length + 1, first + 1))
    return sorted(set(found))


def _known(x: Signal) -> tuple[Signal, Index]:
    """Samples without holes, and their places in the log."""
    place = np.flatnonzero(np.isfinite(x))
    return x[place], place


def _jumps(x: Signal, size: float) -> Index:
    """Samples after which a channel changes by more than a size, (k,); block by block, so that a long log needs no memory."""
    if size <= 0.0:
        return np.empty(0, dtype=np.intp)
    found = [
        start + np.flatnonzero(np.abs(np.diff(x[start : start + BLOCK + 1])) > size) for start in range(0, x.size - 1, BLOCK)
    ]
    return np.concatenate([np.empty(0, dtype=np.intp), *found])


def _is_wild(log: Samples, name: str, x: Signal) -> Mask:
    """Whether values are beyond what the sensor or the channel can give."""
    low, high = limits_of(log.rig.sensors.get(name))
    limit = max(-low if math.isfinite(low) else high, high)  # whichever sign is that of payout
    wild: Mask = log.level(name).is_far(x) | (np.abs(x) > limit)
    return wild


def _cannot_be(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether a channel that motion alone can change jumps over a stretch [first, last) without it."""
    x, t = log.channels[name], log.t
    before, after = max(first - 1, 0), min(last, t.size - 1)
    if name == "pressure":  # that of a flow changes with a valve
        return log.by_line and "flow" not in log.channels and last - first > SHORT
    if name == "displacement":
        v = log.channels.get("velocity")
        beside = np.abs(v[[before, after]]) if v is not None else np.array([0.0])
        fastest = float(np.max(beside)) * float(np.max(np.diff(t[before : after + 1])))
        return bool(np.abs(x[first] - x[first - 1 if first else last % t.size]) > 10.0 * fastest)
    if name != "velocity" or "displacement" not in log.channels or first == 0 or last == t.size:
        return False
    with_it, without, moved = _travels(log, before, after)
    return abs(moved - without) < 0.5 * abs(moved - with_it)


def _is_shown(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether another channel, or of the velocity the displacement, shows that the machine did it."""
    if name == "velocity" and "displacement" in log.channels and 0 < first and last < log.t.size:
        with_it, without, moved = _travels(log, first - 1, last)
        if abs(moved - with_it) < abs(moved - without):
            return True
    return shown(log, name, first, last)


def _travels(log: Samples, before: int, after: int) -> tuple[float, float, float]:
    """Travel between two samples: by the velocity, by the line between its two end samples, and by the displacement. [m]"""
    t, v, x = (y[before : after + 1] for y in (log.t, log.channels["velocity"], log.channels["displacement"]))
    good = np.isfinite(v)
    if np.ptp(x[1:-1]) == 0.0 and x.size > MIN_HELD:  # it holds one value, too
        return math.nan, math.nan, math.nan
    along = 0.5 * (v[0] + v[-1]) * (t[-1] - t[0])
    return float(np.trapezoid(v[good], t[good])), float(along), float(x[-1] - x[0])


# --------------------------------------------------------------------------------------------------------- what holds still
def stale(log: Samples, name: str) -> Mask:
    """Values that a noisy channel repeats for longer than chance allows, or one that holds still although the line travels."""
    x, bad = log.channels[name], np.zeros(log.t.size, dtype=bool)
    held = _stretches(x[1:] == x[:-1], MIN_HELD - 1)
    if not held:
        return bad
    moving, (low, high) = log.moving(), limits_of(log.rig.sensors.get(name))
    repeats = np.concatenate(([False], x[1:] == x[:-1]))
    for a, b in held:
        last = b + 1
        stuck = _travels_on(log, name, a, last)
        if stuck is None:
            stuck = _is_noisy_beside(x, a, last, moving) and _by_chance(repeats, a, last, moving, last - a - 1) < CERTAIN
        bad[a + 1 : last] = stuck and low <= x[a] <= high  # beyond that it was clipped
    return bad


def _travels_on(log: Samples, name: str, first: int, last: int) -> bool | None:
    """Whether the line travels while a channel that follows it is held; None for other channels."""
    v, x = log.channels.get("velocity"), log.channels.get("displacement")
    t, part = log.t[first:last], slice(first, last)
    if v is None or (x is None and name == "velocity"):
        return None
    if name == "velocity" and x is not None:
        moved = float(np.nanmax(x[part], initial=-np.inf) - np.nanmin(x[part], initial=np.inf))
        along = abs(float(v[first])) * float(t[-1] - t[0])
        off = abs(moved - along) > max(TRAVEL, STEPS * log.level("displacement").step) and moved > 0.0
        return True if off else None
    if name not in ("displacement", "pressure") or not log.by_line:
        return None
    level = log.level(name)
    reach = log.level("displacement").span if x is not None else float(np.nansum(np.abs(v)) / v.size * (log.t[-1] - log.t[0]))
    per_metre = 1.0 if name == "displacement" else level.span / (reach or np.inf)
    travel = abs(float(np.trapezoid(np.nan_to_num(v[part]), t)))
    return travel > max(TRAVEL, STEPS * level.step / (per_metre or np.inf))


def filled_gaps(log: Samples, name: str) -> Mask:
    """Samples of a noisy channel on a line between two measured ones, for longer than chance allows."""
    x, bad = log.channels[name], np.zeros(log.t.size, dtype=bool)
    level = log.level(name)
    usual = 1.652 * level.noise
    if not usual > 3.0 * level.step or name == "displacement":
        return bad
    calm = np.zeros(x.size, dtype=bool)
    for start in range(0, x.size - 2, BLOCK):
        bend = np.abs(np.diff(x[start : start + BLOCK + 2], 2))
        calm[start + 1 : start + 1 + bend.size] = bend <= max(CALM * usual, 2.001 * level.step)
    stretches = _stretches(calm, MIN_HELD)
    moving = log.moving() if stretches else calm
    for a, b in stretches:
        change = np.diff(x[a - 1 : b + 1])
        line = abs(change[0]) < 8.0 * level.noise and np.ptp(x[a:b]) > 0.0 and _turns(change) < 0.5 * TURNS
        if line and _is_noisy_beside(x, a, b, moving):
            bad[a:b] = _by_chance(calm, a, b, moving, b - a, CONTINUES) < CERTAIN
    return bad


def _by_chance(still: Mask, first: int, last: int, moving: Mask, count: int, factor: float = 1.0) -> float:
    """Logarithm of the chance that a channel holds still for some samples, by the nearest ones in the same state of motion.

    The rule of succession of Laplace gives the chance of each; 0 where too few samples show it.
    """
    sides = _beside(first, last, moving)
    known = [still[rows] for rows in sides if rows.size >= BESIDE // 4]
    if sum(part.size for part in known) < BESIDE // 2:
        return 0.0
    chance = max((np.count_nonzero(part) + 1.0) / (part.size + 2.0) for part in known)
    return count * math.log(min(factor * chance, 1.0))


def _beside(first: int, last: int, moving: Mask) -> tuple[Index, Index]:
    """The nearest samples before and after a stretch [first, last) in which the line moves, or rests, as it mostly does there."""
    state = 2 * np.count_nonzero(moving[first:last]) > last - first
    begin, end = max(first - 8 * BESIDE, 1), min(last + 8 * BESIDE, moving.size - 1)
    before, after = (np.flatnonzero(moving[part] == state) for part in (slice(begin, first), slice(last, end)))
    return begin + before[-BESIDE:], last + after[:BESIDE]


def _is_noisy_beside(x: Signal, first: int, last: int, moving: Mask) -> bool:
    """Whether a channel has noise on both sides of a stretch, which reverses its changes again and again."""
    return all(_turns(x[rows] - x[rows - 1]) > TURNS for rows in _beside(first, last, moving) if rows.size >= BESIDE // 4)


def _turns(change: Signal) -> float:
    """Share of the changes that reverse at once."""
    change = change[(change != 0) & np.isfinite(change)]
    return float(np.mean(change[1:] * change[:-1] < 0)) if change.size > 1 else 0.0


def _stretches(mask: Mask, least: int) -> list[tuple[int, int]]:
    """Stretches [first, last) of at least so many samples in which a mask is set."""
    found = stretches_of(mask)
    return [(a, b) for a, b in found[found[:, 1] - found[:, 0] >= least].tolist()]


JUMPS = (
    Check("spike", "jump to a value that no other channel shows", dropouts),
    Check("spike", "deviate far from their neighbours", spikes),
)
"""Faults that are sought before the clock is checked, again until none is found: one code next to another is found after it."""

STILL = (
    Check("dropped_samples", "run between their neighbours without noise, as if a gap had been filled in", filled_gaps),
    Check("stuck", "repeat one value where it should change", stale),
)
"""Faults that motion and noise show."""
