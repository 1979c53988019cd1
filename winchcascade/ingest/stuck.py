"""Stuck channels: one value held while the line moves and the channel should have changed.

A channel at rest is not stuck: an encoder holds its value while the line does, and what a stage gives out is zero while
nothing drives it. So only stretches in which the line moves count, and for what the generator does only the payout.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from winchcascade.run import Signal

    Index = NDArray[np.intp]
    Mask = NDArray[np.bool_]

HELD = 0.5
"""A value must be held this long to be looked at. [s]"""

FEWEST = 10
"""And for this many samples; `_held` is written for ten."""

SPEED_RANGE = 0.3
"""A channel that depends on speed must change when the speed does by this share of its top."""

TRAVEL = 0.1
"""The displacement must follow what the velocity says to within this. [m]"""

STEPS = 5.0
"""What depends on the displacement must change when the travel says so by this many of its own steps."""

UNLIKELY = -25.0
"""Logarithm of the chance below which a noisy channel does not repeat itself by accident."""

NOISY = 0.3
"""A channel is noisy if this share of its changes turn back at once."""

_ENOUGH = 400_000
"""Samples at the beginning of a log that say how its channels behave."""

DRIVEN = ("torque", "power_mech", "vdc", "idc")


class Motion(msgspec.Struct, frozen=True):
    """What the line does: stamps [s], its velocity [m/s], when it moves and when it pays out, its top speed [m/s]."""

    t: Signal
    v: Signal
    moving: Mask
    paying_out: Mask
    top_speed: float

    def position(self) -> Signal:
        """Where the line is, by integration. [m]"""
        position = np.zeros(self.v.size)
        np.cumsum(0.5 * (self.v[1:] + self.v[:-1]) * np.diff(self.t), out=position[1:])
        return position


def motion(t: Signal, v: Signal, v_onset: float) -> Motion:
    """Prepare what every channel is held against; v finite, payout positive."""
    out = v > v_onset
    return Motion(t, v, out | (v < -v_onset), out, float(max(v.max(initial=0.0), -v.min(initial=0.0))))


def find_stuck(name: str, x: Signal, line: Motion, channels: Mapping[str, Signal]) -> list[tuple[int, int]]:
    """Find stretches [first, last) in which a channel is stuck.

    Parameters
    ----------
    name : channel, which says what it depends on
    x : (n,) its values, finite or NaN
    channels : the other channels of the log, of which the displacement is held against a velocity that is stuck
    """
    first, last = _held(x, line.t)
    if first.size == 0:
        return []
    if name == "velocity":
        return [(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True) if _outrun(a, b, x, line, channels)]
    where = line.paying_out if name in DRIVEN else line.moving
    active = np.zeros(where.size + 1, dtype=np.int32)
    np.cumsum(where, out=active[1:])
    long = active[last] - active[first] >= FEWEST
    first, last = first[long], last[long]
    if first.size == 0:
        return []
    repeats = _repeats(x, where, first, last)
    return [
        (a, b)
        for a, b in zip(first.tolist(), last.tolist(), strict=True)
        if _must_change(name, x, a, b, line, where) or _too_still(name, x[a], int(active[b] - active[a]), repeats)
    ]


def _held(x: Signal, t: Signal) -> tuple[Index, Index]:
    """Stretches of one value, [first, last), that are long enough to be looked at."""
    alike = x[1:] == x[:-1]
    span = 1
    for more in (1, 2, 4, 1):  # alike over 2, 4, 8 and then 9 steps: ten samples of one value
        alike = alike[:-more] & alike[more:]
        span += more
    edges = np.flatnonzero(np.diff(np.concatenate(([False], alike, [False])).astype(np.int8)))
    first, last = edges[::2], edges[1::2] + span
    long = t[last - 1] - t[first] >= HELD
    return first[long], last[long]


def _outrun(a: int, b: int, v: Signal, line: Motion, channels: Mapping[str, Signal]) -> bool:
    """Whether the displacement moved on other than a held velocity says."""
    displacement = channels.get("displacement")
    if displacement is None:
        return False
    moved = displacement[b - 1] - displacement[a]
    return bool(abs(moved - v[a] * (line.t[b - 1] - line.t[a])) > max(TRAVEL, 0.2 * abs(moved)))


def _must_change(name: str, x: Signal, a: int, b: int, line: Motion, where: Mask) -> bool:
    """Whether physics moves the channel in a stretch in which it holds still."""
    if name in ("displacement", "pressure"):
        position = line.position()
        travel, whole = float(np.ptp(position[a:b])), float(np.ptp(position))
        span = float(np.ptp(x[np.isfinite(x)]))
        if span == 0:
            return travel > TRAVEL
        step = _smallest_step(x)
        share = 1.0 if name == "displacement" else span / whole
        return travel > TRAVEL and travel * share > STEPS * step
    speeds = line.v[a:b][where[a:b]]
    if name in DRIVEN:
        speeds = speeds[speeds > SPEED_RANGE * line.top_speed]
    return speeds.size >= FEWEST and float(np.ptp(speeds)) > SPEED_RANGE * line.top_speed


def _smallest_step(x: Signal) -> float:
    some = np.abs(np.diff(x[:_ENOUGH]))
    some = some[some > 0]
    return float(np.min(some, initial=np.inf)) if some.size else 0.0


def _repeats(x: Signal, where: Mask, first: Index, last: Index) -> float:
    """Chance that a sample repeats the one before while the line moves, 1 for a channel without noise."""
    free = where[1:_ENOUGH].copy()
    for a, b in zip(first[first < _ENOUGH], last[first < _ENOUGH], strict=True):
        free[max(a - 1, 0) : b] = False
    change = np.diff(x[:_ENOUGH])[free]
    change = change[np.isfinite(change)]
    if change.size < 50:
        return 1.0
    turning = float(np.mean(change[1:] * change[:-1] < 0))
    return max(float(np.mean(change == 0)), 0.02) if turning > NOISY else 1.0


def _too_still(name: str, value: float, samples: int, repeats: float) -> bool:
    """Whether a noisy channel holds still for longer than chance allows; nothing given out is no sign of it."""
    if name in DRIVEN and value == 0:
        return False
    return repeats < 1 and samples * float(np.log(repeats)) < UNLIKELY
