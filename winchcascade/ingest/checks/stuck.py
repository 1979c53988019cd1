"""Stuck channels, of which one value is held while they should have changed, and rows that were written twice.

A channel at rest is not stuck: an encoder holds its value while the line does, and the output of a stage is zero while
nothing drives it. A channel is stuck if the motion should have changed it, or if its noise is missing. It is not if another
channel shows that it jumped to its value, or if it is as still elsewhere in the same state of all other channels, as a coarse
power is at low speed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

import msgspec
import numpy as np

from winchcascade.core.integrate import ENOUGH, ends_of, median, smallest_step, stretches_of
from winchcascade.core.run import Finding, Index, Mask, Signal
from winchcascade.ingest.checks.witnesses import LookAlikes, Witnesses

HELD = 0.3
"""Minimum time for which a value is held, to be evaluated. [s]"""

MIN_STILL = 6
"""Minimum number of samples for which it is held: a channel with noise repeats itself so often in no log. `_held` is written
for six."""

MIN_MOVING = 10
"""Minimum number of samples where motion shows that the channel should have changed."""

SPEED_RANGE = 0.15
"""A channel that depends on speed must change when the speed of payout does by this share of its top."""

DRIVES = 0.3
"""The generator is driven, for sure, above this share of the top speed of payout."""

RISE = 0.05
"""The line speeds up if it gains this share of its top speed in 0.6 s."""

IDLE = 0.02
"""A stage delivers nothing below this share of its largest value."""

LOADED = 0.2
"""With more than this share of its largest torque the shaft turns."""

MIN_TORQUE = 5.0
"""And with more than this. [N m]"""

TRAVEL = 0.1
"""Travel of the line at which a channel that depends on the displacement must change. [m]"""

APART = 0.01
"""Maximum difference of velocity and displacement over a stretch. [m]"""

STEPS = 5.0
"""Minimum change that is expected from travel, in steps of the channel."""

SPEED_STEPS = 60.0
"""Minimum change that is expected from speed, in steps of the channel: other causes may offset a part of it."""

LAG = 5
"""Number of slowest and fastest samples that do not count: a logger that repeats each value lags behind the speed."""

UNLIKELY = -18.0
"""Logarithm of the chance below which a noisy channel does not repeat itself by accident: once in 60 million samples."""

MIN_REPEATS = 0.02
"""Smallest chance that is believed: that a noisy channel repeats itself. [1]"""

TURNS = 0.15
"""Minimum share of the changes of a noisy channel that reverse at once. [1]"""

LARGE = 0.3
"""Minimum share of these changes that are two steps of a noisy channel or more: finer noise leaves it at one value or not,
depending on where between two steps it lies. [1]"""

BESIDE = 24
"""Number of samples on either side of a stretch that show whether the channel holds still there, too."""

DRIVEN = ("torque", "power_mech", "vdc", "idc")

MIN_ROWS = 20
"""Smallest number of rows that equal earlier ones: noise of two channels repeats none by chance."""

MAX_ROWS = 1_000_000
"""Longer logs are not searched, as sorting their rows would take longer than all other checks."""

RARELY = 0.3
"""Chance that a sample repeats the one before, up to which a channel is noisy enough to distinguish rows. [1]"""


class ObservedMotion(msgspec.Struct, frozen=True):
    """What the line does: stamps [s], its velocity [m/s], the threshold of motion [m/s], when it pays out or hauls in,
    top speed of payout [m/s]. Of a bench without a line the shaft, and its speeds in rad/s."""

    t: Signal
    v: Signal
    v_onset: float
    out: Mask
    back: Mask
    top_speed: float

    def position(self) -> Signal:
        """Where the line is, by integration. [m]"""
        position = np.zeros(self.v.size)
        travel = self.v[1:] + self.v[:-1]
        travel *= np.diff(self.t)
        travel *= 0.5
        np.cumsum(travel, out=position[1:])
        return position


def motion(t: Signal, v: Signal, v_onset: float) -> ObservedMotion:
    """Prepare the motion with which every channel is compared; v finite, payout positive."""
    return ObservedMotion(t, v, v_onset, v > v_onset, v < -v_onset, float(v.max(initial=v_onset)))


def find_stuck(name: str, line: ObservedMotion, witnesses: Witnesses) -> list[tuple[int, int]]:
    """Find stretches [first, last) in which a channel is stuck.

    Parameters
    ----------
    name : channel; its name decides on what it depends
    witnesses : all channels of the log, finite or NaN: displacement and torque show whether a velocity is stuck
    """
    channels = witnesses.channels
    x = channels[name]
    first, last = _held(x, line.t)
    if first.size == 0:
        return []
    stuck = _too_still(name, x, line, first, last)
    stuck[stuck] = ~_usual_there(name, witnesses, first[stuck], last[stuck])
    if name == "velocity":
        stuck |= _loaded(first, last, line, channels) & (x[first] < line.v_onset)
        stuck |= _apart(first, last, x, line, channels)
    elif name in ("displacement", "pressure"):
        stuck |= _unmoved(name, first, last, x, line)
        if name == "displacement":
            stuck |= _loaded(first, last, line, channels)
    else:
        unchanged = _unchanged(name, first, last, x, line) & ~stuck
        unchanged[unchanged] = ~_usual_there(name, witnesses, first[unchanged], last[unchanged])
        stuck |= unchanged
    return list(zip(first[stuck].tolist(), last[stuck].tolist(), strict=True))


def find_still(name: str, shaft: ObservedMotion, witnesses: Witnesses, loaded: Mask) -> list[tuple[int, int]]:
    """Find stretches [first, last) in which a noisy channel of a log without a line holds a value.

    The motion of the shaft does not show what should have changed, so only the missing noise counts. A stretch at the largest
    value is saturation, one near zero an idle output, and a value that is held in two stretches a step of a coarse channel.

    Parameters
    ----------
    loaded : (n,) whether other stages have a power: at no load a drag may be constant
    """
    x = witnesses.channels[name]
    first, last = _held(x, shaft.t)
    if first.size == 0:
        return []
    still, size, largest = _too_still("", x, shaft, first, last), np.abs(x[first]), float(np.nanmax(np.abs(x)))
    still &= (size > IDLE * largest) & (size < largest) & (2 * _among(loaded, first, last) > last - first)
    values, held = np.unique(x[first], return_counts=True)
    still &= held[np.searchsorted(values, x[first])] == 1
    still[still] = ~_dithers(x, first[still], last[still])
    still[still] = ~_usual_there(name, witnesses, first[still], last[still])
    return list(zip(first[still].tolist(), last[still].tolist(), strict=True))


def _usual_there(name: str, witnesses: Witnesses, first: Index, last: Index) -> Mask:
    """Whether each stretch [first, last) of a held value is what the machine does, (k,).

    Others show that the channel jumps to the value, or the channel holds it, or any, elsewhere in their state. The largest
    value of a channel does not count: a saturated sensor holds it in each payout.
    """
    if not first.size:
        return np.zeros(0, dtype=bool)
    x, alike = witnesses.channels[name], LookAlikes(witnesses.channels)
    low, high = ends_of(x)
    top = high if high >= -low else low
    usual: Mask = np.array(
        [
            x[a] != top
            and (
                witnesses.show(name, a - 1, b)
                or (b - a - 1) * math.log(max(alike.repeats(name, (a, b)), MIN_REPEATS)) >= UNLIKELY
            )
            for a, b in zip(first.tolist(), last.tolist(), strict=True)
        ]
    )
    return usual


def _held(x: Signal, t: Signal) -> tuple[Index, Index]:
    """Stretches of one value, [first, last), that are long enough to be evaluated."""
    alike = x[1:] == x[:-1]
    span = 1
    for more in (1, 2, 1):  # alike over 2, 4 and then 5 steps: six samples of one value
        alike = alike[:-more] & alike[more:]
        span += more
    if not alike.any():
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    first, last = stretches_of(alike).T
    last = last + span
    long = t[last - 1] - t[first] >= HELD
    return first[long], last[long]


def _among(mask: Mask, first: Index, last: Index) -> Index:
    """Samples of each stretch at which a mask is set."""
    return np.array([np.count_nonzero(mask[a:b]) for a, b in zip(first.tolist(), last.tolist(), strict=True)])


def _apart(first: Index, last: Index, v: Signal, line: ObservedMotion, channels: Mapping[str, Signal]) -> Mask:
    """Whether the displacement moved otherwise than by a held velocity, in blocks of 0.25 s."""
    apart = np.zeros(first.size, dtype=bool)
    if "displacement" not in channels:
        return apart
    displacement = channels["displacement"].copy()
    for a, b in zip(*_held(displacement, line.t), strict=True):
        displacement[a + 1 : b] = np.nan  # at rest, or stuck itself
    slack = max(line.v_onset, 2 * smallest_step(v))
    for k, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        seconds, moved = _blocks(line.t[a:b], displacement[a:b], 0.25)
        off = np.abs(moved - v[a] * seconds)
        jump = np.nanmax(np.abs(np.diff(displacement[a:b])), initial=0.0)
        off = off[(off > np.maximum(slack * seconds, 0.2 * np.abs(moved))) & (off > 1.5 * jump)]
        apart[k] = off.sum() > APART and b - a >= MIN_MOVING
    return apart


def _blocks(t: Signal, x: Signal, seconds: float) -> tuple[Signal, Signal]:
    """Durations [s] and changes of x over blocks of a stretch."""
    good = np.isfinite(x)
    t, x = t[good], x[good]
    if t.size < 3:
        return np.empty(0), np.empty(0)
    blocks = max(1, round(t.size * median(np.diff(t)) / seconds))
    ends = np.linspace(1, t.size - 2, 1 + blocks).astype(np.intp)
    around = np.sort((x[ends - 1], x[ends], x[ends + 1]), axis=0)  # the middle one of three is never a single wild one
    return np.diff(t[ends]), np.diff(around[1])


def _loaded(first: Index, last: Index, line: ObservedMotion, channels: Mapping[str, Signal]) -> Mask:
    """Whether the shaft carries torque, so that the line pays out, while an encoder holds its value."""
    torque = channels.get("torque")
    if torque is None or not np.isfinite(torque).any():
        return np.zeros(first.size, dtype=bool)
    alive = np.append(True, torque[1:] != torque[:-1])  # a torque that is stuck itself is no evidence
    high = alive & (torque > max(LOADED * float(np.nanmax(torque)), MIN_TORQUE))
    high[1:-1] &= high[:-2] & high[2:]  # three in a row are no noise
    loaded = _among(high, first, last)
    return (loaded >= MIN_MOVING) & (loaded * median(np.diff(line.t[:1000])) >= HELD)


def _unmoved(name: str, first: Index, last: Index, x: Signal, line: ObservedMotion) -> Mask:
    """Whether a channel that depends on where the line is holds still while the line travels."""
    stuck = np.zeros(first.size, dtype=bool)
    during_motion = np.flatnonzero(_among(line.out | line.back, first, last) >= MIN_MOVING).tolist()
    if not during_motion:
        return stuck
    position = line.position()
    share = 1.0 if name == "displacement" else _range(x) / max(float(np.ptp(position)), 1e-9)
    minimum = max(TRAVEL, STEPS * smallest_step(x) / share if share else 0.0)
    for k in during_motion:
        a, b = first[k], last[k]
        seconds, moved = _blocks(line.t[a:b], position[a:b], 1.0)
        stuck[k] = np.abs(moved[np.abs(moved) > line.v_onset * seconds]).sum() > minimum
    return stuck


def _unchanged(name: str, first: Index, last: Index, x: Signal, line: ObservedMotion) -> Mask:
    """Whether a channel that depends on speed holds still while the speed of payout changes."""
    stuck = np.zeros(first.size, dtype=bool)
    span, step, largest = _range(x), smallest_step(x), float(np.nanmax(np.abs(x)))
    for k in np.flatnonzero(_among(line.out, first, last) >= MIN_MOVING).tolist():
        t, v = line.t[first[k] : last[k]], line.v[first[k] : last[k]]
        driven = line.out[first[k] : last[k]]
        if name in DRIVEN:
            driven = driven & (v > DRIVES * line.top_speed)
            if (
                abs(x[first[k]]) <= IDLE * largest
            ):  # a line that slows down does not drive the shaft: the rotor runs on alone
                gain = np.interp(t + 0.3, line.t, line.v) - np.interp(t - 0.3, line.t, line.v)
                driven &= gain > RISE * line.top_speed
        speeds = np.sort(v[driven])
        if speeds.size >= MIN_MOVING:
            change = (speeds[-LAG] - speeds[LAG - 1]) / line.top_speed
            stuck[k] = change > SPEED_RANGE and (span == 0 or change * span > SPEED_STEPS * step)
    return stuck


def _range(x: Signal) -> float:
    low, high = ends_of(x)
    return high - low


def _too_still(name: str, x: Signal, line: ObservedMotion, first: Index, last: Index) -> Mask:
    """Whether a noisy channel holds still for longer than chance allows, by its noise in the same kind of motion."""
    free = np.ones(min(x.size, ENOUGH) - 1, dtype=bool)
    for a, b in zip(first[first < ENOUGH].tolist(), last[first < ENOUGH].tolist(), strict=True):
        free[max(a - 1, 0) : b] = False
    change = np.diff(x[:ENOUGH])
    free &= np.isfinite(change)
    whole = repeats_of(change[free])
    if whole == 1.0:
        return np.zeros(first.size, dtype=bool)
    chance = np.zeros(first.size)
    for where in (line.out, line.back, ~(line.out | line.back)):
        inside = where[1:ENOUGH]
        here = change[free & inside]
        repeats = repeats_of(here) if here.size >= 50 else whole
        if 2 * here.size < np.count_nonzero(inside):  # it holds still most of the time
            repeats = 1.0
        chance += np.maximum(_among(where, first, last) - 1, 0) * np.log(repeats)
    still: Mask = chance < UNLIKELY
    return still & (x[first] != 0) if name in DRIVEN else still


def _dithers(x: Signal, first: Index, last: Index) -> Mask:
    """Whether a channel holds still so often next to a stretch that chance explains it.

    At a small load the noise of a machine may be smaller than the steps of a channel.
    """
    same = np.append(False, x[1:] == x[:-1])
    share = [
        max(_share(same[max(a - BESIDE, 0) : a]), _share(same[b : b + BESIDE]))
        for a, b in zip(first, last, strict=True)
    ]
    dithers: Mask = (last - first - 1) * np.log(np.maximum(share, 1e-9)) >= UNLIKELY
    return dithers


def _share(mask: Mask) -> float:
    return float(np.mean(mask)) if mask.size else 0.0


def repeats_of(change: Signal) -> float:
    """Chance that a sample repeats the one before; 1 for a channel without noise or with steps as coarse as its noise."""
    some = change[change != 0]
    if some.size < 20:
        return 1.0
    turn = some[1:] * some[:-1] < 0
    large = np.minimum(np.abs(some[1:]), np.abs(some[:-1]))[turn] > 1.5 * np.abs(some).min()
    if np.mean(turn) < TURNS or np.mean(large) < LARGE:
        return 1.0
    return float(max(1.0 - some.size / change.size, MIN_REPEATS))


def repeated_rows(t: Signal, channels: Mapping[str, Signal]) -> list[Finding]:
    """Report stretches of rows that equal earlier ones in all channels; they are kept, as the log does not show which count.

    Only logs with a noisy channel are searched: without noise, equal cycles are equal in every digit. Where the displacement is
    logged, it jumps back, which the check of the clock reports.
    """
    if t.size > MAX_ROWS or not any(repeats_of(np.diff(x)) < RARELY for x in channels.values()):
        return []
    rng = np.random.default_rng(0)
    key = np.zeros(t.size)
    for x in channels.values():  # rows that are equal have equal sums, others almost never
        key += rng.uniform(1.0, 2.0) * x
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    later = np.zeros(t.size, dtype=np.intp)  # by how many rows the earlier one of a pair lies before
    later[order[same + 1]] = order[same + 1] - order[same]
    edges = np.flatnonzero(np.diff(later, prepend=0, append=0))
    found = [
        (a, b) for a, b in pairwise(edges.tolist()) if later[a] > 1 and b - a >= MIN_ROWS and _changes(channels, a, b)
    ]
    if not found:
        return []
    rows, first = sum(b - a for a, b in found), found[0]
    places = f"{len(found)} stretch{'es' if len(found) > 1 else ''}"
    what = f"{rows} rows equal earlier ones in every channel, in {places}: they were written twice; check how the file was made"
    start, end = float(t[first[0]]), float(t[found[-1][1] - 1])
    return [Finding("repeated_rows", what, "reported and kept", start=start, end=end, count=rows)]


def _changes(channels: Mapping[str, Signal], first: int, last: int) -> bool:
    """Whether any channel changes in most rows of a stretch: rests may repeat."""
    return any(2 * np.count_nonzero(np.diff(x[first:last])) > last - first for x in channels.values())
