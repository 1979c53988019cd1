"""Samples that no machine gives: filled rows, spikes, codes, dropouts, filled gaps and stale
values.

A check takes a log and the name of a channel and returns a mask of the samples that have the fault,
(n,); it changes nothing. `witnesses` decides what the machine did.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from winchcascade.core.integrate import BLOCK, distinct, median, stretches_of
from winchcascade.core.run import FindingKind, Index, Mask, Signal
from winchcascade.ingest.checks.samples import OF_NOISE, Samples, limits_of
from winchcascade.ingest.checks.witnesses import (
    FOLLOW,
    HOLDS,
    NEARBY,
    SPIKE_LENGTH_MAX,
    is_by_machine,
)

AGREE = 0.25
"""The neighbours of a spike agree, and so do its samples, within this share of it: no step and no
ringing. [1]"""

BEYOND = 1.5
"""Smallest jump of a held value over the largest jump of the channel elsewhere: what the machine
does in one sample. [1]"""

MOST = 0.5
"""Longest stretch that jumps away, as a share of the log: what lasts longer is the usual state.
[1]"""

ONE_END = 0.25
"""Smallest jump into or out of a held value that is left or entered without one, in ranges: a
clutch engages by less. [1]"""

HELD_MIN = 6
"""Fewest equal samples of a stale value: by chance a channel that repeats one sample in fifty does
so once in 3e8. [1]"""

CERTAIN = math.log(1e-8)
"""Logarithm of the chance below which a channel does not hold still by accident: not once in the
samples of a long log. [1]"""

BESIDE = 96
"""Number of samples on either side, in the same state of motion, that show whether a channel is
noisy: enough for a chance of one in a hundred. [1]"""

NEAR = 0.2
"""Largest distance of these from the values of the stretch, in ranges: noise may grow with the
value. [1]"""

TURNS = 0.3
"""Smallest share of the bends of a noisy channel that reverse at once; two thirds of white noise,
none of a ramp. [1]"""

STRAIGHT = 0.05
"""Largest second difference of a filled gap, in usual ones. [1]"""

ROUNDED = 2.001
"""The same in steps of the resolution, and twice the bend of a smooth channel that is rounded.
[1]"""

CONTINUES = 2.5
"""A sample of white noise continues the line of those before it so many times as often as any three
samples lie on a line: the standard deviation of a second difference is sqrt(6) times that of the
noise. [1]"""

STEPS = 5.0
"""Travel after which a channel that follows the line must show it, in steps of its resolution.
[1]"""

TRAVEL = 0.5
"""The same as a share of the smallest stroke: beyond lag and stretch of the line. [1]"""

IDLE_SHARE = 0.05
"""A stage may give out nothing, without noise, below this share of its largest value. [1]"""

SLOW = 0.02
"""Largest share of the updates of a slow channel with filled rows that come too early. [1]"""

MOTIONS = ("velocity", "displacement", "speed")
"""Channels that are not idle where they hold zero."""


class Fault(NamedTuple):
    """One fault: the kind of its finding, the words after the number of samples, the function that
    marks them, and how often it is repeated."""

    kind: FindingKind
    words: str
    mask: Callable[[Samples, str], Mask]
    rounds: int = 1


def filled_rows(log: Samples, name: str) -> Mask:
    """Rows of a slow channel that hold 0 because it had no new value.

    Zeros that last longer than two updates are measurements: of them the rows of the updates are
    kept.
    """
    x = log.channels[name]
    filled = np.zeros(x.size, dtype=bool)
    if not 4 * SPIKE_LENGTH_MAX <= np.count_nonzero(x) <= 0.55 * x.size:
        return filled
    updates = np.flatnonzero(x)
    steps = np.diff(updates)
    every = int(median(steps.astype(np.float64)))
    if every < 2 or np.count_nonzero(steps % every) > SLOW * updates.size:
        return filled
    filled[updates[0] : updates[-1]] = True
    filled[updates] = False
    for k in np.flatnonzero(steps > 2 * every).tolist():
        filled[updates[k] : updates[k + 1] : every] = False
    return filled


# ------------------------------------------------------------------------------- what jumps away
def jumped(log: Samples, name: str) -> Mask:
    """Spikes, codes and dropouts: what lies beyond all measurements, or jumps away and back without
    the machine."""
    level = log.level(name)
    bad = level.is_far(log.channels[name])
    kept = np.isfinite(log.channels[name]) & ~bad
    x = log.channels[name] if kept.all() else log.channels[name][kept]
    at = _jumps(x, level.fault)
    if not at.size:
        return bad
    place = np.flatnonzero(kept)
    limit = max(map(abs, limits_of(log.rig.sensors.get(name))))  # whichever sign is that of payout
    spikes = set(_spikes(log, name, x, at))
    stretches = spikes.union(_held(log, name, x, at))
    by_travel = log.has_travel(name) or (log.by_line and name in FOLLOW)
    for first, after in sorted(stretches, key=lambda ends: ends[1] - ends[0]):
        begin, last, spike = int(place[first]), int(place[after - 1]) + 1, (first, after) in spikes
        # Beside a code, any value departs.
        if last - begin == bad.size or bad[max(begin - 1, 0) : last + 1].any():
            continue
        if np.ptp(x[first:after]) == 0.0 and limit < abs(x[first]):
            bad[begin:last] = True
            continue
        if last - begin > MOST * x.size:
            continue
        apart = by_travel or (after - first == 1 if spike else not log.by_line)
        if apart or _jumps_apart(x, at, first, after):
            bad[begin:last] = not is_by_machine(log, name, begin, last, spike=spike)
    return bad


def _jumps(x: Signal, size: float) -> Index:
    """Samples after which a channel changes by more than a size, (k,); by blocks, so that a long
    log needs no memory."""
    starts = range(0, x.size - 1, BLOCK) if size > 0.0 else ()
    large = [s + np.flatnonzero(np.abs(np.diff(x[s : s + BLOCK + 1])) > size) for s in starts]
    return np.concatenate([np.empty(0, dtype=np.intp), *large])


def _spikes(log: Samples, name: str, x: Signal, at: Index) -> Iterator[tuple[int, int]]:
    """Stretches [first, after) of a few samples that lie off a straight line through their neighbours
    alike (a Hampel filter at the jumps after the samples `at`)."""
    level, jump = log.level(name), x[at + 1] - x[at]
    ends = at + np.arange(1, SPIKE_LENGTH_MAX + 1)[:, None]
    back = np.minimum(at.searchsorted(ends), at.size - 1)
    comes_back = (at[back] == ends) & (jump * jump[back] < 0.0)
    for length, chosen in enumerate(comes_back, 1):
        before = at[chosen]
        if length == 1:  # one that repeats its neighbour on a ramp jumps at one end only
            before = np.append(before, at[(at > 0) & (x[at] == x[at - 1])] - 1)
        if not before.size:
            continue
        rows = before[:, None]
        around = np.append(np.arange(-NEARBY, 1), np.arange(length + 1, length + NEARBY + 2))
        steps = np.delete(np.diff(x[np.clip(rows + around, 0, x.size - 1)]), NEARBY, axis=1)
        slope = _medians(steps[:, NEARBY - SPIKE_LENGTH_MAX : NEARBY + SPIKE_LENGTH_MAX])
        noise = _medians(np.abs(np.diff(steps)))[:, 0] / 1.652  # ringing and noise have no spikes
        beside = np.array([-1, 0, length + 1, length + 2])
        ends = x[np.clip(rows + beside, 0, x.size - 1)] - slope * beside
        inside = x[rows + 1 + np.arange(length)]
        middle = 0.5 * (ends[:, 1:2] + ends[:, 2:3])
        off = inside - slope * (1 + np.arange(length)) - middle
        size = np.min(np.abs(off), axis=1)
        alike = (np.ptp(np.sign(off), axis=1) == 0) & (np.ptp(off, axis=1) <= AGREE * size)
        # Many losses that are filled with the sample before pass for noise.
        far = (inside[:, 0] == x[before]) | (size > OF_NOISE * noise)
        far &= size > (level.fault if length == 1 else level.long_fault)
        agreeing = np.ptp(ends, axis=1) < AGREE * size
        for first in (before[alike & far & agreeing] + 1).tolist():
            yield first, first + length


def _medians(rows: Signal) -> Signal:
    """Median of each row, (k, 1); `numpy.median` takes several times as long."""
    middle = (rows.shape[1] - 1) // 2, rows.shape[1] // 2
    return np.asarray(np.partition(rows, middle, axis=1)[:, [*middle]].mean(axis=1, keepdims=True))


def _held(log: Samples, name: str, x: Signal, at: Index) -> Iterator[tuple[int, int]]:
    """Stretches [first, after) between two jumps apart that hold one value, or vary little beside
    these jumps; and those that hold one value and are entered or left without a jump."""
    level = log.level(name)
    starts, ends = np.append(0, at + 1), np.append(at + 1, x.size)
    change = np.concatenate(([np.nan], x[at + 1] - x[at], [np.nan]))
    into, out = change[:-1], change[1:]
    jump, at_end = np.fmin(np.abs(into), np.abs(out)), np.isnan(into * out)
    low, width = np.minimum.reduceat(x, starts), np.maximum.reduceat(x, starts)
    width -= low
    rising = np.sort(low)
    times = rising.searchsorted(low, side="right") - rising.searchsorted(low)
    # Single samples of a code are no spikes where some lie side by side.
    again = (ends - starts > 1) | (times >= SPIKE_LENGTH_MAX) | at_end
    little = (width < HOLDS * jump) & (ends - starts > SPIKE_LENGTH_MAX) & ~at_end
    chosen = ((width == 0.0) & again | little) & (jump > level.long_fault) & ~(into * out > 0.0)
    yield from zip(starts[chosen].tolist(), ends[chosen].tolist(), strict=True)
    # The displacement decides on a velocity, however small its jump.
    least = 0.0 if log.has_travel(name) else ONE_END * level.span
    for k in at[np.abs(x[at + 1] - x[at]) > max(least, level.long_fault)].tolist():
        for rest, sign in ((x[k + 1 :], 1), (x[k::-1], -1)):
            if rest.size >= HELD_MIN and np.all(rest[:HELD_MIN] == rest[0]):
                length = int(np.argmax(rest != rest[0])) or rest.size
                yield (k + 1, k + 1 + length) if sign > 0 else (k + 1 - length, k + 1)


def _jumps_apart(x: Signal, at: Index, first: int, after: int) -> bool:
    """Whether a stretch is entered and left by larger jumps than any to and from other values."""
    size, ends = np.abs(x[at + 1] - x[at]), (at == first - 1) | (at == after - 1)
    same = ends
    if np.ptp(x[first:after]) == 0.0:
        same = (x[at] == x[first]) | (x[at + 1] == x[first])
    return bool(np.min(size[ends]) >= BEYOND * np.max(size[~(ends | same)], initial=0.0))


# ---------------------------------------------------------------------------- what has no noise
def stale(log: Samples, name: str) -> Mask:
    """Values that a noisy channel repeats for longer than chance allows, or one that holds still
    although the line travels."""
    x, level = log.channels[name], log.level(name)
    held = np.append(False, x[1:] == x[:-1])
    follows = log.by_line and name in FOLLOW and "velocity" in log.channels
    if follows:
        return _still_while_travelling(log, name, held)
    low, high = limits_of(log.rig.sensors.get(name))
    idle = 0.0 if name in MOTIONS else IDLE_SHARE * level.top
    bad = _beyond_chance(log, name, held, _stretches(held, HELD_MIN), 1.0)
    if bad.any():  # beyond its limits it was clipped
        bad &= (np.abs(x) > idle) & (x >= low) & (x <= high)
    return bad | _still_while_travelling(log, name, held) if log.has_travel(name) else bad


def _still_while_travelling(log: Samples, name: str, held: Mask) -> Mask:
    """Samples of a channel that follows the line and holds one value while another channel shows
    that the line travels."""
    bad, stretches = np.zeros(held.size, dtype=bool), _stretches(held, HELD_MIN - 1)
    if not stretches:
        return bad
    level, t, v = log.level(name), log.t, log.channels["velocity"]
    moves = np.where(np.abs(v) > 2.0 * log.rig.thresholds.v_onset, v, 0.0)  # no zero error, no hole
    least = max(STEPS * level.step, OF_NOISE * level.noise)
    if name == "pressure":  # in metres, by the travel of the line over the range of the pressure
        least *= np.ptp(np.cumsum(moves)) * log.interval / (level.span or math.inf)
    least = max(least, TRAVEL * log.rig.thresholds.stroke_min)
    for a, b in stretches:
        travel = abs(float(np.trapezoid(moves[a - 1 : b], t[a - 1 : b])))
        if name == "velocity":
            travel, least = _apart(log, a - 1, b)
        bad[a:b] = travel > least
    return bad


def _apart(log: Samples, first: int, last: int) -> tuple[float, float]:
    """How far the travel by the displacement is from that of a held velocity over a stretch, and
    how far lag, resolution and a slow update of the displacement may put it. [m]"""
    x, seconds = log.channels["displacement"][first:last], float(log.t[last - 1] - log.t[first])
    x = x[np.isfinite(x)]
    moved = float(np.ptp(x)) if x.size else 0.0
    along = abs(float(log.channels["velocity"][first])) * seconds
    update = 1.5 * float(np.max(np.abs(np.diff(x)), initial=0.0))
    coarse = STEPS * max(log.level("velocity").step * seconds, log.level("displacement").step)
    least = max(TRAVEL * log.rig.thresholds.stroke_min, coarse, update, 0.2 * max(moved, along))
    return (abs(moved - along) if moved > 0.0 else 0.0), least


def filled_gaps(log: Samples, name: str) -> Mask:
    """Samples of a noisy channel on a line between two measured ones, for longer than chance
    allows."""
    x, level = log.channels[name], log.level(name)
    straight, usual = np.zeros(x.size, dtype=bool), 1.652 * level.noise
    if not usual > ROUNDED * level.step or name == "displacement":
        return straight
    for start in range(0, x.size - 2, BLOCK):
        bend = np.abs(np.diff(x[start : start + BLOCK + 2], 2))
        least = max(STRAIGHT * usual, ROUNDED * level.step)
        straight[start + 1 : start + 1 + bend.size] = bend <= least
    for a, b in _stretches(x[1:] == x[:-1], HELD_MIN - 1):
        straight[a : b + 1] = False  # what holds one value is judged as stale
    stretches = []
    for a, b in _uncommon(log, name, straight, _stretches(straight, HELD_MIN)):
        change = np.diff(x[max(a - 2, 0) : b + 2])
        jump = np.max(np.abs(change[[0, -1]] - median(change)))
        if jump <= level.long_fault and _turns(change[2:-2]) < 0.5 * TURNS:  # no step, no flicker
            stretches.append((a, b))
    return _beyond_chance(log, name, straight, stretches, CONTINUES)


def _uncommon(
    log: Samples, name: str, straight: Mask, stretches: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, int]]:
    """Stretches on a straight line that `_beyond_chance` may find, as few of the samples next to
    them are on one. These are among the samples that it counts, so they bound its share."""
    x, motion, reach = log.channels[name], log.motion(), NEAR * log.level(name).span
    beside = np.concatenate((np.arange(-BESIDE, 0), np.arange(BESIDE)))
    for start in range(0, len(stretches), BLOCK // beside.size):
        part = np.array(stretches[start : start + BLOCK // beside.size])
        first, after = part[:, :1], part[:, 1:]
        rows = np.clip(np.where(beside < 0, first, after) + beside, 0, x.size - 1)
        same = (np.abs(x[rows] - x[first]) <= reach) & (
            motion[rows] == motion[(first + after) // 2]
        )
        share = (np.count_nonzero(same & straight[rows], axis=1) + 1.0) / (beside.size + 2.0)
        few = CONTINUES * share < np.exp(CERTAIN / (after - first)[:, 0])
        yield from map(tuple, part[few].tolist())


def _beyond_chance(
    log: Samples,
    name: str,
    still: Mask,
    stretches: Sequence[tuple[int, int]],
    factor: float,
) -> Mask:
    """Stretches that are still for longer than by chance, where a channel is noisy beside them.

    The chance of one more still sample is the share of the samples beside a stretch that are still,
    by the rule of succession of Laplace, times a factor; after a still sample it may be larger.
    """
    bad = np.zeros(still.size, dtype=bool)
    if not stretches or log.level(name).noise == 0.0:
        return bad
    x, level, motion = log.channels[name], log.level(name), log.motion()
    usual = 2 * np.bincount(motion[still] + 1, minlength=3) > np.bincount(motion + 1, minlength=3)
    for a, b in stretches:
        state = int(motion[(a + b) // 2])
        if factor == 1.0 and usual[state + 1]:
            continue  # in this state it rests
        first = max(a - 8 * BESIDE, 1)
        around = slice(first, b + 8 * BESIDE)
        low, high = np.min(x[a:b]) - NEAR * level.span, np.max(x[a:b]) + NEAR * level.span
        near = (x[around] >= low) & (x[around] <= high) & (motion[around] == state)
        rows = first + np.flatnonzero(near)
        sides = [rows[rows < a][-BESIDE:], rows[rows >= b][:BESIDE]]
        both = np.concatenate(sides)
        if both.size < BESIDE // 4:
            continue
        groups = [both]
        if factor == 1.0:  # a value repeats rather after one that repeats, as of coarse steps
            groups = [*sides, *(rows[still[rows - 1]] for rows in sides)]
        known = [still[rows] for rows in groups if rows.size >= BESIDE // 8]
        shares = [(np.count_nonzero(part) + 1.0) / (part.size + 2.0) for part in known]
        if (b - a) * math.log(min(factor * max(shares, default=1.0), 1.0)) < CERTAIN:
            held = distinct(x[both[still[both]]])
            # The steps of a coarse channel, though a logger interpolates between them.
            coarse = factor == 1.0 and held.size >= SPIKE_LENGTH_MAX
            step = float(np.diff(held).min()) if coarse else level.step
            shown = [rows for rows in sides if rows.size >= BESIDE // 4] or [both]
            bad[a:b] = all(_is_noisy(x[rows], step) for rows in shown)
    return bad


def _is_noisy(x: Signal, step: float) -> bool:
    """Whether the bends of a channel from one new value to the next reverse again and again.

    Those of a smooth channel do not, or are no larger than rounding makes them, also where it is
    held between updates.
    """
    x = x[np.isfinite(x)]
    bends = np.diff(x[np.diff(x, prepend=np.nan) != 0], 2)
    size = np.abs(bends)
    if bends.size < 2 * HELD_MIN or np.mean(size) <= ROUNDED * step:
        return False
    if 8.0 * median(size) < np.mean(size):  # a few kinks between straight lines
        return False
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

JUMPS = Fault(
    "spike",
    "jump far from their neighbours, or to a value that no other channel shows",
    jumped,
    rounds=5,
)
"""Sought before the clock is checked, again until none is found: one code next to another is found
after it."""

STILL = (
    Fault(
        "dropped_samples",
        "run between their neighbours without noise, as if a gap had been filled in",
        filled_gaps,
    ),
    Fault("stuck", "repeat one value where it should change", stale),
)
"""Faults that motion and noise show."""
