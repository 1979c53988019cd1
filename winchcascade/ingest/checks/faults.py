"""Samples that no machine gives: filled rows, codes and dropouts, spikes, filled gaps and stale values. One function per fault.

A check takes a log and the name of a channel and returns a mask of the samples that have the fault, (n,); it changes nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, median, stretches_of
from winchcascade.core.run import FindingKind, Index, Mask, Signal
from winchcascade.ingest.checks.samples import OF_NOISE, Samples, limits_of
from winchcascade.ingest.checks.witnesses import HOLDS, NEARBY, AtEnds, contradicted, shown

SHORT = 5
"""Samples of the longest spike, and stretches of one value between jumps from which on it is a code. What lasts longer is
judged by the value that it holds and by the other channels. [1]"""

AGREE = 0.25
"""The neighbours of a spike agree, and so do its samples, within this share of it: no step, no ringing. [1]"""

BEYOND = 1.5
"""Smallest jump of a held value over the largest jump of the channel elsewhere: what the machine does in one sample. [1]"""

ONE_END = 0.25
"""Smallest jump into or out of a held value that is left or entered without one, in ranges: a clutch engages by less. [1]"""

HELD_TIME = 1 / 3
"""Shortest time for which a value is held that is entered or left without a jump, as a share of the width that smooths the
velocity. [1]"""

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

TRAVEL = 0.5
"""Travel of the line after which displacement, pressure and a held velocity must show it, as a share of the smallest stroke:
beyond lag and stretch. [1]"""

STEPS = 5.0
"""The same in steps of the resolution of the channel. [1]"""

SLOW = 0.02
"""Largest share of the values of a slow channel with filled rows whose neighbours hold a value, too. [1]"""


class Fault(NamedTuple):
    """One fault: the kind of its finding, the words after the number of samples, the function that marks them, and how often
    it is repeated."""

    kind: FindingKind
    words: str
    mask: Callable[[Samples, str], Mask]
    rounds: int = 1


def filled_rows(log: Samples, name: str) -> Mask:
    """Rows of a slow channel that hold 0 because it had no new value.

    Zeros that last longer than two updates are measurements: of them the rows of the updates are kept.
    """
    x, filled = log.channels[name], np.zeros(log.t.size, dtype=bool)
    if not 4 * SHORT <= np.count_nonzero(x) <= 0.55 * x.size:
        return filled
    held = np.flatnonzero(x)
    steps = np.diff(held)
    if np.count_nonzero(steps == 1) > SLOW * held.size:
        return filled
    every = int(median(steps.astype(np.float64)))
    if every < 2 or np.count_nonzero(steps % every) > SLOW * held.size:
        return filled
    filled[held[0] : held[-1]] = True
    filled[held] = False
    for k in np.flatnonzero(steps > 2 * every).tolist():
        filled[held[k] : held[k + 1] : every] = False
    return filled


# ------------------------------------------------------------------------------------------------------- what jumps away
def jumped(log: Samples, name: str) -> Mask:
    """Spikes, codes and dropouts: what lies beyond all measurements, or jumps away and back without the machine."""
    level = log.level(name)
    bad = level.is_far(log.channels[name])
    x = log.channels[name]
    good = np.isfinite(x) & ~bad
    place: Sequence[int] | Index = range(x.size)
    if not good.all():
        place, x = np.flatnonzero(good), x[good]
    at = _jumps(x, level.fault)
    if not at.size:
        return bad
    low, high = limits_of(log.rig.sensors.get(name))
    limit = max(-low if math.isfinite(low) else high, high)  # whichever sign is that of payout
    spikes = set(_spikes(log, name, x, at))
    by_travel = name == "velocity" and "displacement" in log.channels  # which decides, however small the jump
    one_end = (
        level.long_fault if by_travel else ONE_END * level.span,
        max(log.rows(HELD_TIME * log.smoothing), MIN_HELD),
    )
    stretches = spikes.union(_held(x, at, level.long_fault, one_end))
    for first, after in sorted(stretches, key=lambda ends: ends[1] - ends[0]):
        begin, last, inside = int(place[first]), int(place[after - 1]) + 1, x[first:after]
        beside = bad[max(begin - 1, 0)] or bad[min(last, bad.size - 1)]  # a code, from which any value departs
        if last - begin >= bad.size or bad[begin] or beside:
            continue
        if (np.ptp(inside) == 0.0 and abs(inside[0]) > limit) or _cannot_be(log, name, begin, last):
            bad[begin:last] = True
            continue
        ends = int(place[max(first - 1, 0)]), int(place[min(after, x.size - 1)])
        if last - begin > SHORT and max(begin - ends[0], ends[1] - last) > SHORT:
            continue  # beside a hole
        if (first, after) in spikes:
            apart = after - first == 1 or _jumps_apart(x, at, first, after)
            bad[begin:last] = apart and last - begin <= SHORT and not _is_shown(log, name, begin, last, any)
        elif not log.by_line or (name not in ("displacement", "pressure") and _jumps_apart(x, at, first, after)):
            bad[begin:last] = not _is_shown(log, name, begin, last, all) and contradicted(log, name, begin, last)
    return bad


def _jumps(x: Signal, size: float) -> Index:
    """Samples after which a channel changes by more than a size, (k,); block by block, so that a long log needs no memory."""
    starts = range(0, x.size - 1, BLOCK) if size > 0.0 else ()
    large = [start + np.flatnonzero(np.abs(np.diff(x[start : start + BLOCK + 1])) > size) for start in starts]
    return np.concatenate([np.empty(0, dtype=np.intp), *large])


def _spikes(log: Samples, name: str, x: Signal, at: Index) -> Iterator[tuple[int, int]]:
    """Stretches [first, after) of a few samples that lie off a calm line through their neighbours alike (a Hampel filter at
    the jumps after the samples `at`)."""
    level, jump = log.level(name), x[at + 1] - x[at]
    for length in range(1, SHORT + 1):
        back = np.minimum(np.searchsorted(at, at + length), at.size - 1)  # the jump after so many samples
        before = at[(at[back] == at + length) & (jump * jump[back] < 0.0)]
        if length == 1:  # one that repeats its neighbour on a ramp jumps at one end only
            before = np.append(before, at[(at > 0) & (x[at] == x[at - 1])] - 1)
        if not before.size:
            continue
        rows = before[:, None]
        beside = np.array([-1, 0, length + 1, length + 2])
        around = np.concatenate((np.arange(-NEARBY, 1), np.arange(length + 1, length + NEARBY + 2)))
        steps = np.delete(np.diff(x[np.clip(rows + around, 0, x.size - 1)]), NEARBY, axis=1)
        slope = _medians(steps[:, NEARBY - SHORT : NEARBY + SHORT])  # of the nearest
        noise = _medians(np.abs(np.diff(steps)))[:, 0] / 1.652  # beside it: ringing and noise have no spikes
        inside, ends = x[rows + 1 + np.arange(length)], x[np.clip(rows + beside, 0, x.size - 1)] - slope * beside
        off = inside - slope * (1 + np.arange(length)) - 0.5 * (ends[:, 1:2] + ends[:, 2:3])
        size = np.min(np.abs(off), axis=1)
        alike = (np.ptp(np.sign(off), axis=1) == 0) & (np.ptp(off, axis=1) <= AGREE * size)
        again = inside[:, 0] == x[before]  # a loss that is filled with the sample before; many of them pass for noise
        far = (size > (level.fault if length == 1 else level.long_fault)) & (again | (size > OF_NOISE * noise))
        for first in (before[alike & far & (np.ptp(ends, axis=1) < AGREE * size)] + 1).tolist():
            yield first, first + length


def _medians(rows: Signal) -> Signal:
    """Median of each row, (k, 1); `numpy.median` takes several times as long."""
    middle = (rows.shape[1] - 1) // 2, rows.shape[1] // 2
    return np.asarray(np.partition(rows, middle, axis=1)[:, [*middle]].mean(axis=1, keepdims=True))


def _held(x: Signal, at: Index, least: float, one_end: tuple[float, int]) -> list[tuple[int, int]]:
    """Stretches [first, after) between two jumps that hold one value, or vary little beside these jumps.

    Parameters
    ----------
    least : smaller jump of a stretch between two
    one_end : jump, and number of equal samples, of one that is entered or left without a jump
    """
    starts = np.concatenate(([0], at + 1))
    into, out = np.concatenate(([np.nan], x[at + 1] - x[at])), np.concatenate((x[at + 1] - x[at], [np.nan]))
    low, high, count = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts), np.diff(starts, append=x.size)
    jump, end, held = np.fmin(np.abs(into), np.abs(out)), np.isnan(into * out), low == high
    _, which, times = np.unique(low, return_inverse=True, return_counts=True)
    often = (times >= SHORT)[which]  # a code, of which single samples are no spikes: some lie side by side
    flat = np.where(held, (count > 1) | often | end, (count > SHORT) & (high - low < HOLDS * jump) & ~end)
    chosen = ~(into * out > 0.0) & (jump > least) & flat
    found = list(zip(starts[chosen].tolist(), (starts + count)[chosen].tolist(), strict=True))
    for k in at[np.abs(x[at + 1] - x[at]) > one_end[0]].tolist():
        for rest, sign in ((x[k + 1 :], 1), (x[k::-1], -1)):
            if rest.size >= one_end[1] and np.all(rest[: one_end[1]] == rest[0]):
                length = int(np.argmax(rest != rest[0])) or rest.size
                found.append((k + 1, k + 1 + length) if sign > 0 else (k + 1 - length, k + 1))
    return found


def _jumps_apart(x: Signal, at: Index, first: int, after: int) -> bool:
    """Whether a stretch [first, after) is entered and left by larger jumps than any to and from other values."""
    size, ends = np.abs(x[at + 1] - x[at]), (at == first - 1) | (at == after - 1)
    same = (x[at] == x[first]) | (x[at + 1] == x[first]) if np.ptp(x[first:after]) == 0.0 else ends
    return bool(np.min(size[ends]) >= BEYOND * np.max(size[~(ends | same)], initial=0.0))


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
    with_it, without = _apart_by_travel(log, name, first, last)
    return without < HOLDS * with_it


def _is_shown(log: Samples, name: str, first: int, last: int, at_ends: AtEnds) -> bool:
    """Whether another channel, or of the velocity the displacement, shows that the machine did it.

    A few samples beside an edge are a transient, which another channel shows at the edge alone.
    """
    with_it, without = _apart_by_travel(log, name, first, last)
    return with_it < without or shown(log, name, first, last, at_ends)


def _apart_by_travel(log: Samples, name: str, first: int, last: int) -> tuple[float, float]:
    """How far the travel by the displacement is from that by the velocity over a stretch, and from that by the line between its
    two neighbours; NaN where it shows nothing. [m]"""
    part = slice(first - 1, last + 1)
    if name != "velocity" or "displacement" not in log.channels or first == 0 or last == log.t.size:
        return math.nan, math.nan
    t, v, x = (y[part] for y in (log.t, log.channels["velocity"], log.channels["displacement"]))
    if np.ptp(x[1:-1]) == 0.0 and x.size > MIN_HELD:  # it holds one value, too
        return math.nan, math.nan
    good, moved = np.isfinite(v), float(x[-1] - x[0])
    return abs(moved - float(np.trapezoid(v[good], t[good]))), abs(moved - 0.5 * (v[0] + v[-1]) * float(t[-1] - t[0]))


# --------------------------------------------------------------------------------------------------------- what holds still
def stale(log: Samples, name: str) -> Mask:
    """Values that a noisy channel repeats for longer than chance allows, or one that holds still although the line travels."""
    x, bad = log.channels[name], np.zeros(log.t.size, dtype=bool)
    repeats = np.concatenate(([False], x[1:] == x[:-1]))
    held = _stretches(repeats, MIN_HELD - 1)
    if not held:
        return bad
    motion, (low, high) = log.motion(), limits_of(log.rig.sensors.get(name))
    idle_below = IDLE_SHARE * max(map(abs, log.level(name)[:2]))  # a stage may give nothing
    still = repeats.copy()
    for a, last in held:
        still[a - 1 : last] = True
    usual = [way for way in (-1, 0, 1) if 2 * np.count_nonzero(still[motion == way]) > np.count_nonzero(motion == way)]
    for a, last in held:
        travels = stuck = _travels_on(log, name, a - 1, last)
        if stuck is None and motion[(a + last) // 2] not in usual:
            stuck = _is_noise_that_stops(log, name, repeats, a, last, 1.0)
        # A machine may be at rest, and a stage may give nothing.
        idle = not travels and x[a] == 0.0 if name in MOTIONS else abs(x[a]) <= idle_below
        bad[a:last] = bool(stuck) and not idle and low <= x[a] <= high  # beyond that it was clipped
    return bad


def _travels_on(log: Samples, name: str, first: int, last: int) -> bool | None:
    """Whether the line travels while a channel that follows it is held; None for other channels."""
    v, x = log.channels.get("velocity"), log.channels.get("displacement")
    t, part, level = log.t[first:last], slice(first, last), log.level(name)
    travel = TRAVEL * log.rig.thresholds.stroke_min
    if v is None or (x is None and name == "velocity"):
        return None
    if name == "velocity" and x is not None:
        moved = float(np.nanmax(x[part], initial=-np.inf) - np.nanmin(x[part], initial=np.inf))
        along = abs(float(v[first])) * float(t[-1] - t[0])
        update = 1.5 * float(np.nanmax(np.abs(np.diff(x[part])), initial=0.0))  # of a displacement that is held, too
        coarse = STEPS * level.step * float(t[-1] - t[0])
        least = max(travel, STEPS * log.level("displacement").step, 0.2 * max(moved, along), update, coarse)
        return True if abs(moved - along) > least and moved > 0.0 else None
    if name not in ("displacement", "pressure") or not log.by_line:
        return None
    reach = log.level("displacement").span if x is not None else float(np.nanmean(np.abs(v)) * (log.t[-1] - log.t[0]))
    per_metre = (1.0 if name == "displacement" else level.span / (reach or np.inf)) or math.inf
    moves = np.where(np.abs(v[part]) > 2.0 * log.rig.thresholds.v_onset, v[part], 0.0)  # no zero error, and no hole
    return abs(float(np.trapezoid(moves, t))) > max(travel, max(STEPS * level.step, OF_NOISE * level.noise) / per_metre)


def filled_gaps(log: Samples, name: str) -> Mask:
    """Samples of a noisy channel on a line between two measured ones, for longer than chance allows."""
    x, level = log.channels[name], log.level(name)
    bad, usual = np.zeros(x.size, dtype=bool), 1.652 * level.noise
    if not usual > ROUNDED * level.step or name == "displacement":
        return bad
    calm = np.zeros(x.size, dtype=bool)
    for start in range(0, x.size - 2, BLOCK):
        bend = np.abs(np.diff(x[start : start + BLOCK + 2], 2))
        calm[start + 1 : start + 1 + bend.size] = bend <= max(CALM * usual, ROUNDED * level.step)
    if _stretches(calm, MIN_HELD):
        for a, b in _stretches(x[1:] == x[:-1], MIN_HELD - 1):
            calm[a : b + 1] = False  # what holds one value is judged as stale
    for a, b in _stretches(calm, MIN_HELD):
        change = np.diff(x[max(a - 2, 0) : b + 2])
        jumps = np.max(np.abs(change[[0, -1]] - median(change))) > level.long_fault
        if not jumps and _turns(change[2:-2]) < 0.5 * TURNS:
            bad[a:b] = _is_noise_that_stops(log, name, calm, a, b, CONTINUES)
    return bad


def _is_noise_that_stops(log: Samples, name: str, still: Mask, first: int, last: int, factor: float) -> bool:
    """Whether a channel that is noisy beside a stretch [first, last) is still in it for longer than chance allows.

    The chance of one more still sample is the share of the samples beside it that are still, by the rule of succession of
    Laplace, times a factor: for values that repeat, on the side where it is larger, or after a sample that repeats as well.

    Parameters
    ----------
    still : (n,) samples that repeat the one before, or continue a line
    """
    sides = _beside(log, name, first, last)
    groups = [*sides, *(rows[still[rows - 1]] for rows in sides)] if factor == 1.0 else [np.concatenate(sides)]
    known = [rows for rows in groups if rows.size >= BESIDE // 8]
    if sum(rows.size for rows in known) < BESIDE // 4:
        return False
    chance = max((np.count_nonzero(still[rows]) + 1.0) / (rows.size + 2.0) for rows in known)
    if (last - first) * math.log(chance * factor) >= CERTAIN:
        return False
    x, both, step = log.channels[name], np.concatenate(sides), log.level(name).step
    held = np.unique(x[both[still[both]]])  # the steps of a coarse channel, though a logger interpolates between them
    if factor == 1.0 and held.size >= SHORT:
        step = max(step, float(np.diff(held).min()))
    return all(_is_noisy(x[rows], step) for rows in [rows for rows in sides if rows.size >= BESIDE // 4] or [both])


def _beside(log: Samples, name: str, first: int, last: int) -> tuple[Index, Index]:
    """The nearest samples before and after a stretch [first, last) in the same state: the line moves in the same direction, or
    rests, too, and the channel is near its values there.
    """
    x, margin, motion = log.channels[name], NEAR * log.level(name).span, log.motion()
    low, high, state = np.nanmin(x[first:last]) - margin, np.nanmax(x[first:last]) + margin, motion[(first + last) // 2]

    def alike(begin: int, end: int) -> Index:
        part = slice(max(begin, 1), min(end, x.size - 1))
        return part.start + np.flatnonzero((motion[part] == state) & (x[part] >= low) & (x[part] <= high))

    return alike(first - 8 * BESIDE, first)[-BESIDE:], alike(last, last + 8 * BESIDE)[:BESIDE]


def _is_noisy(x: Signal, step: float) -> bool:
    """Whether the bends of a channel from one new value to the next reverse again and again.

    Those of a smooth channel do not, or are no larger than rounding makes them, also where it is held between updates.
    """
    x = x[np.isfinite(x)]
    bends = np.diff(x[np.diff(x, prepend=np.nan) != 0], 2)
    size = np.abs(bends)
    if bends.size < BESIDE // 8 or np.mean(size) <= ROUNDED * step or 8.0 * median(size) < np.mean(size):
        return False  # rounded, or a few kinks between straight lines
    return _turns(bends) > TURNS


def _turns(change: Signal) -> float:
    """Share of the changes that reverse at once."""
    change = change[(change != 0) & np.isfinite(change)]
    return float(np.mean(change[1:] * change[:-1] < 0)) if change.size > 1 else 0.0


def _stretches(mask: Mask, least: int) -> list[tuple[int, int]]:
    """Stretches [first, last) of at least so many samples in which a mask is set."""
    found = stretches_of(mask)
    return [(a, b) for a, b in found[found[:, 1] - found[:, 0] >= least].tolist()]


FILLED_ROWS = Fault("dropped_samples", "are 0 between the updates of a slower channel", filled_rows)

JUMPS = Fault("spike", "jump far from their neighbours, or to a value that no other channel shows", jumped, rounds=5)
"""Sought before the clock is checked, again until none is found: one code next to another is found after it."""

STILL = (
    Fault("dropped_samples", "run between their neighbours without noise, as if a gap had been filled in", filled_gaps),
    Fault("stuck", "repeat one value where it should change", stale),
)
"""Faults that motion and noise show."""
