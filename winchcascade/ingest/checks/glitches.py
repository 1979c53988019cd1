"""Glitches: a few consecutive samples that jump away from both neighbours and jump back, which no machine does.

One channel shows what jumps away and back (`find_pulses`); the others show whether the machine moved (`follows`); and the
remaining jumps, as of a torque when the clutch engages, show which jumps are usual for the channel itself.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
import numpy as np

from winchcascade.core.integrate import quantile
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.ingest.checks.spikes import AROUND, Bends
from winchcascade.ingest.checks.witnesses import Witnesses

LONGEST = 0.2
"""A glitch lasts no longer: five samples at 25 Hz. Stops of the crane and saturated sensors do. [s]"""

MAX_SAMPLES = 5
"""Maximum number of samples of a glitch whose values no sensor can give."""

MIN_SHARE = 0.1
"""Minimum size of either of its jumps, as a share of the range in which the channel moves. [1]"""

NOISE = 15.0
"""Minimum size of either of its jumps, in usual curvatures of the log: of white noise these are 25 standard deviations. [1]"""

BEYOND = 1.5
"""Minimum size of either of its jumps over the largest jump without a glitch: what the machine does in one sample. [1]"""

APART = 5.0
"""Minimum size of either of its jumps over the upper quartile of the steps around it: in ringing and noise is no glitch. [1]"""

BACK = 0.2
"""Its neighbours agree with each other, and with theirs, within this share of its jumps: after a snap load the line rings."""

EVEN = 0.75
"""Its samples deviate alike, the nearest at least this share of the farthest: a load that comes and goes has flanks; of a
half sine that spans four intervals, the middle three samples are 0.71 of each other."""

RESOLVED = 3
"""Where fewer samples fit into the longest glitch, as below 15 Hz, a load could come and go within two alike: a glitch then
repeats one value exactly."""

MAX_SHARE = 0.01
"""A channel that jumps away and back in a larger share of its samples does so by itself: pulses, a chopper."""

FEW = 20
"""Number of samples that may always be glitches, however short the log."""

WITNESS = 0.05
"""Another channel moves too if it leaves its own straight line by this share of its range, and comes back."""

TEARS = 10.0
"""A displacement that jumps farther than this multiple of the line's motion in a sample is a fault.

No other channel is evaluated there, and what jumps in another one between the same samples is a fault of the logger too.
"""

_JUMPS = 6
"""Maximum number of jumps in one glitch."""


class Pulse(msgspec.Struct, frozen=True):
    """A stretch that jumps away and back: the good samples on either side, -1 or n at an end of the log, its smaller jump,
    whether it lies beyond the sensor's range (`wild`), and far beyond all that the channel does (`lost`)."""

    before: int
    after: int
    jump: float
    wild: bool
    lost: bool


class Pulses(msgspec.Struct, frozen=True):
    """What jumps away and back in one channel, every large jump as its first sample and its size, and what shows whether
    the channel moves: more than `moves` off a straight line."""

    found: tuple[Pulse, ...]
    at: Index
    size: Signal
    moves: float


def find_glitches(t: Signal, witnesses: Witnesses, pulses: Mapping[str, Pulses]) -> dict[str, list[slice]]:
    """Find the glitches of a log's channels, as slices of its samples.

    Parameters
    ----------
    t : (n,) stamps [s]
    witnesses : the channels, NaN where they have holes or single-sample spikes
    pulses : what jumps away and back in each
    """
    channels = witnesses.channels
    sure = {
        (p.before, p.after)
        for name, channel in pulses.items()
        for p in channel.found
        if p.lost or (name == "displacement" and is_torn(t, channels, p.before, p.after, p.jump))
    }
    glitches = {}
    for name, channel in pulses.items():
        alone = [p for p in channel.found if (p.before, p.after) in sure or not follows(t, name, p, witnesses, pulses)]
        usual = np.ones(channel.at.size, dtype=np.bool_)
        for p in alone:
            usual[np.searchsorted(channel.at, p.before) : np.searchsorted(channel.at, p.after)] = False
        minimum = BEYOND * float(channel.size[usual].max(initial=0.0))
        glitches[name] = [slice(p.before + 1, p.after) for p in alone if p.wild or p.jump > minimum]
    return {name: found for name, found in glitches.items() if found}


def find_pulses(bends: Bends, singles: Index, longest: int, limit: float) -> Pulses:
    """Find the stretches of one channel that jump away and back.

    Parameters
    ----------
    bends : where the channel bends sharply
    singles : its single-sample spikes, as indices of its finite samples; their jumps do not count
    longest : samples that a glitch may last
    limit : magnitude beyond which its sensor measures nothing, inf where that is unknown
    """
    x, usual = bends.x, bends.usual
    moves = max(WITNESS * usual.span, 2 * bends.minimum)
    steps = bends.steps(usual.minimum(MIN_SHARE, NOISE), singles)
    if steps.size == 0:
        return Pulses((), steps, np.empty(0), moves)
    place = bends.places
    lost = _Lost(usual.low - usual.reach, usual.high + usual.reach, limit)
    pulses: list[Pulse] = []
    free = -1
    for i, j in _pairs(x, steps, place, max(longest, MAX_SAMPLES)):
        pulse = None if i < free else _pulse(x, i, j, place, longest, lost)
        if pulse is not None:
            pulses.append(pulse)
            free = j + 1
    pulses += _ends(x, steps, place, lost)
    genuine = steps[~lost.wild(x[steps]) & ~lost.wild(x[steps + 1]) & (place[steps + 1] - place[steps] <= 2)]
    inside = sum(p.after - p.before - 1 for p in pulses if not p.wild)
    seldom = tuple(p for p in pulses if p.wild or inside <= max(FEW, MAX_SHARE * x.size))
    return Pulses(seldom, place[genuine], np.abs(x[genuine + 1] - x[genuine]), moves)


class _Lost(msgspec.Struct, frozen=True):
    """What no sensor of a channel measures: below `low` or above `high` is far beyond all that the channel does, and beyond
    `limit` in magnitude is its sensor's range left."""

    low: float
    high: float
    limit: float

    def far(self, x: Signal) -> Mask:
        """Whether values are far beyond all that the channel does."""
        return (x < self.low) | (x > self.high)

    def wild(self, x: Signal) -> Mask:
        """Whether values are that, or beyond the sensor's range."""
        return self.far(x) | (np.abs(x) > self.limit)


def _pairs(x: Signal, steps: Index, place: Index, longest: int) -> list[tuple[int, int]]:
    """Pairs of large jumps (first samples), the second of which leads back to where the first began, in their order."""
    pairs: list[tuple[int, int]] = []
    size = np.abs(x[steps + 1] - x[steps])
    for more in range(1, _JUMPS + 1):
        i, j = steps[:-more], steps[more:]
        back = np.abs(x[j + 1] - x[i]) < BACK * np.minimum(size[:-more], size[more:])
        good = back & (place[j + 1] - place[i] - 1 <= longest)
        pairs += zip(i[good].tolist(), j[good].tolist(), strict=True)
    return sorted(pairs)


def _pulse(x: Signal, i: int, j: int, place: Index, longest: int, lost: _Lost) -> Pulse | None:
    """The samples i + 1 to j as a pulse, None if they are not far off a calm line alike."""
    after = j + 1
    inside, ends = x[i + 1 : after], x[[i, after]]
    off = inside - np.interp(np.arange(i + 1, after), [i, after], ends)
    size = np.abs(off)
    edge = float(min(abs(x[i + 1] - x[i]), abs(x[after] - x[j])))
    pulse = Pulse(int(place[i]), int(place[after]), edge, bool(lost.wild(inside).all()), bool(lost.far(inside).all()))
    if lost.wild(ends).any():
        return None
    calm = max(abs(x[i] - x[max(i - 1, 0)]), abs(x[min(after + 1, x.size - 1)] - x[after])) < BACK * edge
    if pulse.lost or (pulse.wild and calm):
        return pulse
    few = place[after] - place[i] - 1 <= longest and inside.size >= 2
    alike = size.min() > EVEN * size.max() and (off.min() > 0 or off.max() < 0)
    alike &= longest >= RESOLVED or bool(np.all(inside == inside[0]))
    steps = np.abs(np.concatenate((np.diff(x[max(i - AROUND, 0) : i + 1]), np.diff(x[after : after + AROUND + 1]))))
    if few and alike and calm and steps.size and APART * quantile(steps, 0.75) < edge:
        return pulse
    return None


def _ends(x: Signal, steps: Index, place: Index, lost: _Lost) -> list[Pulse]:
    """The first and the last few samples of a log, where nothing measured can be what they are."""
    ends = []
    for part, before, after, good in (
        (x[: steps[0] + 1], -1, int(place[steps[0] + 1]), x[steps[0] + 1]),
        (x[steps[-1] + 1 :], int(place[steps[-1]]), int(place[-1]) + 1, x[steps[-1]]),
    ):
        if part.size <= MAX_SAMPLES and lost.wild(part).all() and not lost.wild(good):
            ends.append(Pulse(before, after, 0.0, wild=True, lost=bool(lost.far(part).all())))
    return ends


def follows(t: Signal, name: str, pulse: Pulse, witnesses: Witnesses, pulses: Mapping[str, Pulses]) -> bool:
    """Whether another channel goes with a pulse of this one, so that the machine moved."""
    if witnesses.show(name, pulse.before, pulse.after):
        return True
    channels = witnesses.channels
    before, after = max(pulse.before, 0), min(pulse.after, t.size - 1)
    if name == "velocity" and "displacement" in channels:
        moved, with_it, without = travelled(t, channels, before, after)
        if abs(moved - with_it) < abs(moved - without):
            return True
    around = slice(max(before - 1, 0), after + 2)
    return any(
        np.any((pulses[other].at >= around.start) & (pulses[other].at < around.stop - 1))
        or _moves(channels[other][around], pulses[other].moves, returns=not pulse.wild)
        for other in channels
        if other != name and not any(p.lost and p.before < after and before < p.after for p in pulses[other].found)
    )


def is_torn(t: Signal, channels: Mapping[str, Signal], before: int, after: int, jump: float) -> bool:
    """Whether a displacement jumps, between two samples, by much more [m] than the velocity allows."""
    if "velocity" not in channels or before < 0 or after >= t.size:
        return False
    around = slice(before, after + 1)
    v = np.abs(channels["velocity"][around])
    farthest = v.max(initial=0.0, where=np.isfinite(v)) * np.diff(t[around]).max()
    return bool(np.isfinite(v[[0, -1]]).all() and jump > TEARS * farthest)


def travelled(t: Signal, channels: Mapping[str, Signal], before: int, after: int) -> tuple[float, float, float]:
    """Travel between two samples: by the displacement, by the velocity, and by the line between its two end samples. [m]"""
    v, stamps = channels["velocity"][before : after + 1], t[before : after + 1]
    moved = channels["displacement"][after] - channels["displacement"][before]
    good = np.isfinite(v)
    along = 0.5 * (v[0] + v[-1]) * (stamps[-1] - stamps[0])
    return float(moved), float(np.trapezoid(v[good], stamps[good])), float(along)


def _moves(x: Signal, moves: float, *, returns: bool) -> bool:
    """Whether a channel leaves its straight line over a stretch, and, if required, returns to it as no ramp does."""
    x = x[np.isfinite(x)]
    if x.size < 3:
        return False
    off = float(np.max(np.abs(x - np.linspace(x[0], x[-1], x.size))))
    return off > moves and (not returns or abs(float(x[-1] - x[0])) < 0.5 * off)
