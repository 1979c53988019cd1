"""Samples that no machine gives: filled rows, codes and dropouts, spikes, filled gaps and stale values. One function per fault.

A check takes a log and the name of a channel and returns a mask of the samples that have the fault, (n,); it changes nothing.
`FAULTS` lists the checks with the kind and the words of their findings.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, median, stretches_of
from winchcascade.core.run import FindingKind, Index, Mask, Signal
from winchcascade.ingest.checks.samples import OF_NOISE, Directions, Level, Samples, limits_of
from winchcascade.ingest.checks.witnesses import NEARBY, contradicted, shown

SHORT = 5
"""Samples of the longest spike; what lasts longer is judged by the value that it holds and by the other channels. [1]"""

AGREE = 0.25
"""The neighbours of a spike agree, and so do its samples, within this share of it: no step, no ringing. [1]"""

BEYOND = 1.5
"""Smallest jump of a spike of several samples, over the largest jump of the channel that belongs to no spike. [1]"""

ONE_END = 0.25
"""Smallest jump into or out of a held value that is left or entered without one, in ranges: a clutch engages by less. [1]"""

HELD_TIME = 0.2
"""Shortest time for which a value is held that is entered or left without a jump. [s]"""

OFTEN = 5
"""Number of stretches of one value, each between two jumps, from which on that value is a code. [1]"""

MIN_HELD = 6
"""Fewest equal samples of a stale value: by chance a channel that repeats one sample in fifty does so once in 3e8. [1]"""

BESIDE = 96
"""Number of samples on either side, in the same state of motion, that show how often a channel holds still: enough for a chance
of one in a hundred. [1]"""

NEAR = 0.2
"""Largest distance of these from the values of the stretch, in ranges: noise may grow with the value. [1]"""

IDLE_SHARE = 0.05
"""A stage may give out nothing, without noise, below this share of its largest value. [1]"""

MOTIONS = ("velocity", "displacement", "speed")
"""Channels that are not idle where they hold zero."""

CERTAIN = math.log(1e-8)
"""Logarithm of the chance below which a channel does not hold still by accident: not once in the samples of a long log. [1]"""

TURNS = 0.3
"""Smallest share of the changes of a noisy channel that reverse at once; two thirds of white noise, none of a ramp. [1]"""

CALM = 0.05
"""Largest second difference of a filled gap, in usual ones. [1]"""

ROUNDED = 2.001
"""The same in steps of the resolution, and twice the bend of a smooth channel that is rounded. [1]"""

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
    if not at.size or x.size < 3:
        return bad
    jumps = np.zeros(x.size + 1, dtype=bool)
    jumps[at + 1] = jumps[0] = jumps[-1] = True  # into each sample; a spike may be the first or the last of a log
    found = []
    for length in range(1, SHORT + 1):
        before = np.flatnonzero(jumps[: x.size + 1 - length] & jumps[length : x.size + 1]) - 1
        if length == 1:  # one that repeats its neighbour on a ramp jumps at one end only
            ends = at[(at > 0) & (at < x.size - 2)]
            before = np.unique(np.concatenate((before, ends[x[ends] == x[ends - 1]] - 1)))
        found += [(k + 1, k + 1 + length) for k in before[_are_spikes(log, name, x, before, length)].tolist()]
    usual = _usual_jump(x, at, found)
    for first, after in found:
        begin, last = int(place[first]), int(place[after - 1]) + 1
        inside, wild = x[first:after], bool(_is_wild(log, name, x[first:after]).all())
        beside = x[first - 1 if first else min(after, x.size - 1)]
        alone = after - first == 1 or wild or np.ptp(inside) == 0.0 or float(np.min(np.abs(inside - beside))) > usual
        if (
            last - begin <= SHORT
            and alone
            and (wild or _cannot_be(log, name, begin, last) or not _is_shown(log, name, begin, last, at_each_end=False))
        ):
            bad[begin:last] = True
    return bad


def _usual_jump(x: Signal, at: Index, suspects: Sequence[tuple[int, int]]) -> float:
    """Size that the jumps of a fault exceed, by those, after the samples `at`, at no end of a suspect stretch."""
    own = np.zeros(x.size + 1, dtype=bool)
    own[[end for ends in suspects for end in ends]] = True
    others = at[~own[at + 1]]
    return BEYOND * float(np.max(np.abs(x[others + 1] - x[others]), initial=0.0))


def _are_spikes(log: Samples, name: str, x: Signal, before: Index, length: int) -> Mask:
    """Which stretches of a length, each after the sample `before`, are off a calm line through their neighbours alike, (k,)."""
    level, places, beside = log.level(name), 1 + np.arange(length), np.array([-1, 0, length + 1, length + 2])
    least = level.fault if length == 1 else level.long_fault
    inside, ends = x[before[:, None] + places], x[_within(before[:, None] + beside, x.size, length)]
    far: Mask = np.asarray(_is_wild(log, name, inside).all(axis=1) & ~_is_wild(log, name, ends[:, 1:3]).any(axis=1))
    aside = np.abs(inside.mean(axis=1) - ends[:, 1:3].mean(axis=1))  # whatever the slope
    found: Mask = far | (aside > 0.99 * least)
    if not found.any():
        return found
    rows, inside, ends = before[found, None], inside[found], ends[found]
    around = np.concatenate(
        (np.arange(-NEARBY, 0), np.arange(length + 1, length + NEARBY + 1))
    )  # the nearest show the slope
    steps = x[_within(rows + around + 1, x.size, length)] - x[_within(rows + around, x.size, length)]
    slope = _medians(steps[:, NEARBY - SHORT : NEARBY + SHORT])
    bends = np.concatenate((np.diff(steps[:, :NEARBY]), np.diff(steps[:, NEARBY:])), axis=1)
    noise = _medians(np.abs(bends))[:, 0] / 1.652  # beside it: ringing and noise have no spikes
    level_ends = ends - slope * beside
    off = inside - slope * places - 0.5 * (level_ends[:, 1:2] + level_ends[:, 2:3])
    size = np.min(np.abs(off), axis=1)
    alike = (np.ptp(np.sign(off), axis=1) == 0) & (np.ptp(off, axis=1) <= AGREE * size)
    agree = np.ptp(level_ends, axis=1) < AGREE * size
    again = inside[:, 0] == ends[:, 1]  # a loss that is filled with the sample before; many of them pass for noise
    found[found] = (size > least) & agree & ((alike & (again | (size > OF_NOISE * noise))) | far[found])
    return found


def _medians(rows: Signal) -> Signal:
    """Median of each row of an even number of values, (k, 1); `numpy.median` takes several times as long."""
    half = rows.shape[1] // 2
    return np.asarray(np.partition(rows, (half - 1, half), axis=1)[:, half - 1 : half + 1].mean(axis=1, keepdims=True))


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
    decided = name == "velocity" and "displacement" in log.channels  # by the travel, however small the jump
    one_end = level.long_fault if decided else ONE_END * level.span
    found = _held_stretches(x, at, level, int(HELD_TIME / float(log.t[1] - log.t[0])), one_end)
    for first, after in sorted(found, key=lambda ends: ends[1] - ends[0]):
        begin, last = int(place[first]), int(place[after - 1]) + 1
        beside = bad[max(begin - 1, 0)] or bad[min(last, log.t.size - 1)]  # a code, from which any value departs
        if last - begin >= log.t.size or bad[begin] or beside:
            continue
        inside = x[first:after]
        wild = _is_wild(log, name, inside) if np.ptp(inside) == 0.0 else level.is_far(inside)
        far = bool(wild.all())
        if far or _cannot_be(log, name, begin, last):
            bad[begin:last] = True
        elif not log.by_line or (name not in ("displacement", "pressure") and _jumps_apart(x, at, first, after)):
            fault = not _is_shown(log, name, begin, last) and contradicted(log, name, begin, last)
            bad[begin:last] |= fault
    return bad


def _jumps_apart(x: Signal, at: Index, first: int, after: int) -> bool:
    """Whether a stretch [first, after) is entered and left by larger jumps than any to and from other values."""
    size = np.abs(x[at + 1] - x[at])
    own = (at == first - 1) | (at == after - 1)
    if np.ptp(x[first:after]) == 0.0:
        own |= (x[at] == x[first]) | (x[at + 1] == x[first])
    ends = size[(at == first - 1) | (at == after - 1)]
    return bool(np.min(ends) >= BEYOND * np.max(size[~own], initial=0.0))


def _held_stretches(x: Signal, at: Index, level: Level, least: int, one_end: float) -> list[tuple[int, int]]:
    """Stretches [first, after) that a jump begins or ends and that hold one value, or vary little beside their two jumps.

    Parameters
    ----------
    at : samples before the jumps
    least, one_end : samples of a stretch that is entered or left without a jump, and size of the jump at its other end
    """
    if not at.size:
        return []
    found, starts = [], np.concatenate(([0], at + 1))
    size = np.concatenate(([np.nan], x[at + 1] - x[at], [np.nan]))
    into, out = size[:-1], size[1:]
    low, high = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    count = np.diff(np.append(starts, x.size))
    jump = np.fmin(np.abs(into), np.abs(out))
    back = ~(into * out > 0.0) & (jump > level.long_fault)
    held = high == low
    _, which, times = np.unique(low, return_inverse=True, return_counts=True)
    often = (times >= OFTEN)[
        which
    ]  # one code again and again, of which single samples are no spikes: some lie side by side
    flat = np.where(count > SHORT, high - low < 0.5 * jump, held & ((count > 1) | often)) & (
        held | ~np.isnan(into * out)
    )
    chosen = back & flat
    found += list(zip(starts[chosen].tolist(), (starts + count)[chosen].tolist(), strict=True))
    least = max(least, MIN_HELD)
    for k in at[np.abs(x[at + 1] - x[at]) > one_end].tolist():
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
        start + np.flatnonzero(np.abs(np.diff(x[start : start + BLOCK + 1])) > size)
        for start in range(0, x.size - 1, BLOCK)
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


def _is_shown(log: Samples, name: str, first: int, last: int, *, at_each_end: bool = True) -> bool:
    """Whether another channel, or of the velocity the displacement, shows that the machine did it.

    A few samples beside an edge are a transient, which another channel shows at the edge alone.
    """
    if name == "velocity" and "displacement" in log.channels and first > 0 and last < log.t.size:
        with_it, without, moved = _travels(log, first - 1, last)
        if abs(moved - with_it) < abs(moved - without):
            return True
    return shown(log, name, first, last, at_each_end=at_each_end)


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
    motion, (low, high) = log.motion(), limits_of(log.rig.sensors.get(name))
    idle_below = IDLE_SHARE * max(map(abs, log.level(name)[:2]))  # a stage may give nothing
    repeats = np.concatenate(([False], x[1:] == x[:-1]))
    still = repeats.copy()
    for a, b in held:
        still[a : b + 1] = True
    usual = [way for way in (-1, 0, 1) if 2 * np.count_nonzero(still[motion == way]) > np.count_nonzero(motion == way)]
    for a, b in held:
        last = b + 1
        travels = stuck = _travels_on(log, name, a, last)
        if stuck is None:
            sides = _beside(log, name, motion, a, last, NEAR)
            again = [
                rows[repeats[rows - 1]] for rows in sides
            ]  # in a log that is held, one sample repeats after another
            chance = (last - a - 1) * _chance(repeats, *sides, *again)
            unlikely = motion[(a + last) // 2] not in usual and chance < CERTAIN
            stuck = unlikely and _are_noisy(x, sides, log.level(name).step) and not shown(log, name, a, last)
        # A machine may be at rest, and a stage may give nothing.
        idle = not travels and x[a] == 0.0 if name in MOTIONS else abs(x[a]) <= idle_below
        bad[a + 1 : last] = stuck and not idle and low <= x[a] <= high  # beyond that it was clipped
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
        update = 1.5 * float(np.nanmax(np.abs(np.diff(x[part])), initial=0.0))  # of a displacement that is held, too
        least = max(TRAVEL, STEPS * log.level("displacement").step, 0.2 * max(moved, along), update)
        coarse = STEPS * log.level("velocity").step * float(t[-1] - t[0])
        return True if abs(moved - along) > max(least, coarse) and moved > 0.0 else None
    if name not in ("displacement", "pressure") or not log.by_line:
        return None
    level = log.level(name)
    reach = (
        log.level("displacement").span
        if x is not None
        else float(np.nansum(np.abs(v)) / v.size * (log.t[-1] - log.t[0]))
    )
    per_metre = 1.0 if name == "displacement" else level.span / (reach or np.inf)
    moves = np.where(np.abs(v[part]) > 2.0 * log.rig.thresholds.v_onset, v[part], 0.0)  # no zero error, and no hole
    travel = abs(float(np.trapezoid(moves, t)))
    return travel > max(TRAVEL, max(STEPS * level.step, OF_NOISE * level.noise) / (per_metre or np.inf))


def filled_gaps(log: Samples, name: str) -> Mask:
    """Samples of a noisy channel on a line between two measured ones, for longer than chance allows."""
    x, bad = log.channels[name], np.zeros(log.t.size, dtype=bool)
    level = log.level(name)
    usual = 1.652 * level.noise
    if not usual > ROUNDED * level.step or name == "displacement":
        return bad
    calm = np.zeros(x.size, dtype=bool)  # what holds one value is judged as stale
    for start in range(0, x.size - 2, BLOCK):
        bend = np.abs(np.diff(x[start : start + BLOCK + 2], 2))
        calm[start + 1 : start + 1 + bend.size] = bend <= max(CALM * usual, ROUNDED * level.step)
    for a, b in _stretches(x[1:] == x[:-1], MIN_HELD):
        calm[a : b + 1] = False
    stretches = _stretches(calm, MIN_HELD)
    motion = log.motion() if stretches else calm
    for a, b in stretches:
        change = np.diff(x[max(a - 2, 0) : b + 2])
        jumps = np.max(np.abs(change[[0, -1]] - median(change))) > level.long_fault
        if not jumps and np.ptp(x[a:b]) > 0.0 and _turns(change[2:-2]) < 0.5 * TURNS:
            sides = _beside(log, name, motion, a, b, NEAR)
            chance = _chance(calm, np.concatenate(sides)) + math.log(CONTINUES)
            bad[a:b] = (b - a) * chance < CERTAIN and _are_noisy(x, sides, level.step)
    return bad


def _chance(still: Mask, *rows: Index) -> float:
    """Logarithm of the chance that a channel holds still for one more sample, by the largest share of some groups of rows in
    which it does; 0 where too few rows show it. The share follows the rule of succession of Laplace.
    """
    known = [group for group in rows if group.size >= BESIDE // 8]
    if sum(group.size for group in known) < BESIDE // 4:
        return 0.0
    return math.log(max(_share(still[group]) for group in known))


def _share(still: Mask) -> float:
    """Chance of a sample to be still, by the rule of succession of Laplace."""
    return (np.count_nonzero(still) + 1.0) / (still.size + 2.0)


def _beside(
    log: Samples, name: str, motion: Directions, first: int, last: int, near: float = np.inf
) -> tuple[Index, Index]:
    """The nearest samples before and after a stretch [first, last) in the same state: the line moves in the same direction, or
    rests, too, and the channel is within `near` ranges of its values there.
    """
    x, margin = log.channels[name], near * log.level(name).span
    inside = x[first:last]
    low, high, state = np.nanmin(inside) - margin, np.nanmax(inside) + margin, motion[(first + last) // 2]

    def alike(begin: int, end: int) -> Index:
        part = slice(max(begin, 1), min(end, x.size - 1))
        return part.start + np.flatnonzero((motion[part] == state) & (x[part] >= low) & (x[part] <= high))

    return alike(first - 8 * BESIDE, first)[-BESIDE:], alike(last, last + 8 * BESIDE)[:BESIDE]


def _are_noisy(x: Signal, sides: Sequence[Index], step: float) -> bool:
    """Whether a channel has noise on both sides of a stretch: the bends from one new value to the next reverse again and again.

    Those of a smooth channel do not, or are no larger than rounding makes them, also where it is held between updates.
    """
    for rows in [rows for rows in sides if rows.size >= BESIDE // 4] or [np.concatenate(sides)]:
        values = x[rows[np.isfinite(x[rows])]]
        new = values[np.diff(values, prepend=np.nan) != 0]
        bends = np.diff(new, 2)
        size = np.abs(bends)
        if bends.size < BESIDE // 8 or np.mean(size) <= ROUNDED * step or 8.0 * median(size) < np.mean(size):
            return False  # rounded, or a few kinks between straight lines
        if _turns(bends) <= TURNS:
            return False
    return True


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
