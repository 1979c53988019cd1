"""Dropouts: a channel jumps to one value, repeats it exactly, and jumps back, while the machine continues.

Error codes (-999, 9999), zeros of a lost signal and held constants are of this kind, from one sample to many seconds. One
channel gives the stretches (`_stretches`); the others decide whether the machine did it. With a line (`_contradicted`), a
torque that vanishes while Vdc, Idc and the velocity continue cannot be the clutch, and a stopped crane makes all of them fall.
On a bench without a line a load may be switched at any speed, and the powers of the stages decide (`breaks_balance`): what one
stage loses, its neighbours must show.
A slow channel that is written as zero between its updates is found by its pattern alone (`find_filled`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import msgspec
import numpy as np

from winchcascade.core.integrate import median, smallest_step
from winchcascade.core.run import Index, Mask, Signal
from winchcascade.ingest.checks.balance import HOLDS, beside, breaks_balance, powers_of, whole
from winchcascade.ingest.checks.glitches import BEYOND, LONGEST, MIN_SHARE, NOISE, TEARS, travelled
from winchcascade.ingest.checks.spikes import FAR, SHOWN, STILL, UPDATES, Bends, Usual, usual_without
from winchcascade.ingest.checks.witnesses import Witnesses

ALONE = 0.1
"""The same where the velocity is the only other channel: with a light load, a small loss of speed opens the clutch."""

RISES = 0.05
"""A load that is cut off lets Vdc rise by more than this share: without a torque channel the current is then believed."""

ONE_SIDED = 0.25
"""Share of the range that a jump must have where the stretch begins or ends without one: a clutch engages by less."""

VALUES = 8
"""Number of values of one channel that are evaluated, those that most jumps lead to or from first."""

OFTEN = 5
"""A channel passes one exact value in single samples less often than this; the search for spikes finds rarer ones."""

ROUNDS = 4
"""Maximum number of repetitions of the search: one code next to another is found once that one is removed."""

FILLED = 0.02
"""Of a slow channel with filled rows hardly any two neighbours hold a value: at most this share of those that do."""

COARSE = 3.0
"""Smallest jump of a fault, in steps of the resolution of the channel."""

WITNESSES = {
    "force": ("torque", "power_mech", "vdc", "idc", "velocity"),
    "torque": ("vdc", "idc", "velocity"),
    "power_mech": ("vdc", "idc", "velocity"),
    "vdc": ("idc", "torque", "power_mech", "velocity"),
    "idc": ("vdc", "torque", "power_mech", "velocity"),
    "velocity": ("torque", "power_mech", "vdc", "idc"),
}
"""Channels that fall together with a channel if the machine, not a fault of the logger, makes it fall."""

WITNESSES_OF_ONE_STAGE = {"vdc": ("idc",)}
"""The same on a bench without a line of which one power is logged: its load may be switched off, but no load draws a current
without a voltage."""


class Dropout(msgspec.Struct, frozen=True):
    """One stretch of a channel that repeats `value`: the good samples on either side, -1 or n at an end of the log, its smaller
    jump (the only one at an end), and its size relative to the channel's range.

    `far`: no measurement lies there. `usual`: largest step of the channel that belongs to no such stretch.
    `even`: every sample is `value`, which else is their median.
    """

    before: int
    after: int
    value: float
    jump: float
    share: float
    far: bool
    usual: float
    even: bool = True


def find_dropouts(
    t: Signal,
    channels: Mapping[str, Signal],
    bends: Mapping[str, Bends],
    stages: Sequence[tuple[str, ...]] = (),
    *,
    open_circuit: bool,
) -> dict[str, list[Dropout]]:
    """Find the dropouts of a log's channels.

    Parameters
    ----------
    t : (n,) stamps [s]
    channels : (n,) each, NaN where they have holes
    bends : where each channel bends sharply
    stages : channels whose product is the power of each stage, in the direction in which power flows; for a log without a line
    open_circuit : no current flows, and a voltage does not show a load
    """
    level: dict[str, Usual] = {}
    suspects = {name: _stretches(t, bends[name], level, name) for name in channels}
    if not any(suspects.values()):
        return {}
    for name in channels:
        level.setdefault(name, usual_without(bends[name].x, np.empty(0)))
    is_shown = _shown(suspects, level, channels)
    sure = {
        (d.before, d.after)
        for name, stretches in suspects.items()
        for d in stretches
        if d.far or (_cannot_be(t, name, d, channels) and not (name == "pressure" and is_shown(name, d)))
    }
    by_line = _has_line(channels)
    powers = [] if by_line else powers_of(channels, stages)

    def is_fault(name: str, d: Dropout) -> bool:
        if is_shown(name, d):
            return False
        if len(powers) > 1:
            return breaks_balance(t, name, d.before, d.after, powers)
        witnesses = WITNESSES if by_line else WITNESSES_OF_ONE_STAGE
        return _contradicted(name, d, channels, suspects, level, witnesses.get(name, ()), open_circuit)

    found = {
        name: [d for d in stretches if (d.before, d.after) in sure or is_fault(name, d)]
        for name, stretches in suspects.items()
    }
    if powers:
        found = {name: _without_neighbours(dropouts) for name, dropouts in found.items()}
    return {name: dropouts for name, dropouts in found.items() if dropouts}


def _shown(
    suspects: Mapping[str, list[Dropout]], level: Mapping[str, Usual], channels: Mapping[str, Signal]
) -> Callable[[str, Dropout], bool]:
    """What answers whether another channel shows a stretch of a channel.

    Zeros and values that come again may be codes, and many lie where another channel happens to change: only a stretch of
    another channel between the same samples that holds something else shows them.
    """
    witnesses = Witnesses(channels, level)
    repeats = {name: Counter(d.value for d in stretches) for name, stretches in suspects.items()}
    between: dict[tuple[int, int], list[tuple[str, Dropout]]] = {}
    for name, stretches in suspects.items():
        for d in stretches:
            between.setdefault((d.before, d.after), []).append((name, d))

    def is_shown(name: str, d: Dropout) -> bool:
        is_code = d.even and (repeats[name][d.value] > 1 or _is_zero(d, level[name]))
        if not is_code:
            return witnesses.show(name, d.before, d.after)
        others = [(other, e) for other, e in between[d.before, d.after] if other != name]
        return any(
            _differs(d, e) and not (_is_zero(d, level[name]) and _is_zero(e, level[other])) for other, e in others
        )

    return is_shown


def _without_neighbours(dropouts: list[Dropout]) -> list[Dropout]:
    """Dropouts without those beside a shorter one, against whose value any measured one departs: the next search decides."""
    kept: list[Dropout] = []
    for d in sorted(dropouts, key=lambda d: d.after - d.before):
        if not any(e.before < end < e.after for e in kept for end in (d.before, d.after)):
            kept.append(d)
    return sorted(kept, key=lambda d: d.before)


def find_filled(x: Signal) -> Mask | None:
    """Find the rows of a slow channel that hold 0 because it had no new value, (n,); None where there are none.

    Zeros that last longer than two updates are measurements: of them the rows of the updates are kept.

    >>> x = np.zeros(200)
    >>> x[::4] = 5.0
    >>> int(find_filled(x).sum())
    147
    """
    if 2 * np.count_nonzero(x) > 1.1 * x.size:
        return None
    held = np.flatnonzero(x)
    steps = np.diff(held)
    if held.size < UPDATES or np.count_nonzero(steps == 1) > FILLED * held.size:
        return None
    every = int(median(steps.astype(np.float64)))
    if every < 2 or np.count_nonzero(steps % every) > FILLED * held.size:
        return None
    filled = np.zeros(x.size, dtype=bool)
    filled[held[0] : held[-1]] = True
    filled[held] = False
    for a, b in zip(held[:-1][steps > 2 * every].tolist(), held[1:][steps > 2 * every].tolist(), strict=True):
        filled[a:b:every] = False
    return filled


def _stretches(t: Signal, bends: Bends, level: dict[str, Usual], name: str) -> list[Dropout]:
    """Stretches of one channel that repeat a value to which it jumped; `level` gets what the channel does without them."""
    x = bends.x
    at = _jumps(bends)
    if at.size == 0:
        return []
    values = _values(x, at)
    usual = usual_without(x, values)
    level[name] = usual
    samples = Bends(x, bends.places, usual, bends.found, bends.calm)
    steps, step = np.abs(np.diff(x)), smallest_step(x)
    found = []
    for value in values.tolist():
        same = np.flatnonzero(x == value)
        first = same[np.diff(same, prepend=-9) > 1]
        last = same[np.diff(same, append=x.size + 9) > 1] + 1
        into = x[np.maximum(first - 1, 0)] - value
        out = x[np.minimum(last, x.size - 1)] - value
        big = np.maximum(np.abs(into), np.abs(out)) > usual.minimum(MIN_SHARE, NOISE)
        if not big.any():
            continue
        other = (x[1:] != value) & (x[:-1] != value) & (steps < FAR * usual.span)
        largest = float(np.max(steps, initial=0.0, where=other))
        ends = zip(first[big].tolist(), last[big].tolist(), strict=True)
        known = [d for a, b in ends if (d := _dropout(t, samples, a, b, largest)) is not None]
        few = len(known) < OFTEN
        found += [d for d in known if not (few and d.after - d.before == 2) or (d.far and same.size > 1)]
    found = [d for d in found if d.far or d.jump > COARSE * step]
    return found if any(d.far for d in found) else found + _uneven(t, samples, at)


def _jumps(bends: Bends) -> Index:
    """First samples of large steps."""
    minimum = MIN_SHARE * bends.usual.span
    if bends.x.size < 2 or minimum <= 0.0:
        return bends.found[:0]
    if NOISE * bends.usual.noise >= minimum:  # the codes are too many to differ from noise, or there is only noise
        return np.flatnonzero(np.abs(np.diff(bends.x)) > minimum)
    return bends.steps(minimum, bends.found[:0])


def _values(x: Signal, at: Index) -> Signal:
    """Values that large jumps lead to and from and that occur more than once, most jumps first; extremes among them."""
    ends = np.sort(np.concatenate((x[at[:SHOWN]], x[at[:SHOWN] + 1], [x.min(), x.min(), x.max(), x.max()])))
    first = np.flatnonzero(np.diff(ends, prepend=np.nan) != 0)
    count = np.diff(first, append=ends.size)
    by_count = np.argsort(-count, kind="stable")
    return ends[first[by_count[count[by_count] >= 2][:VALUES]]]


def _dropout(t: Signal, samples: Bends, first: int, last: int, largest: float) -> Dropout | None:
    """A stretch of equal samples as a dropout: None where the channel moves into and out of it as it does elsewhere."""
    x, place, usual = samples.x, samples.places, samples.usual
    value = float(x[first])
    ends = [float(x[k]) for k in (first - 1, last) if 0 <= k < x.size]
    jumps = [abs(end - value) for end in ends]
    if not ends or (ends[0] - value) * (ends[-1] - value) < 0.0:  # the whole log, a step of a staircase
        return None
    before, after = (int(place[first - 1]) if first else -1), (int(place[last]) if last < x.size else t.size)
    low, high = min(usual.low, 0.0), max(usual.high, 0.0)  # every machine may rest
    far = value < low - FAR * (high - low) or value > high + FAR * (high - low)
    minimum = usual.minimum(MIN_SHARE, NOISE)
    small = min(jumps) <= minimum and not far
    one_sided = t[after - 1] - t[before + 1] >= LONGEST and max(jumps) >= max(ONE_SIDED * usual.span, minimum)
    if small and not one_sided:
        return None
    share = max(jump / max(abs(end), MIN_SHARE * usual.span, 1e-300) for jump, end in zip(jumps, ends, strict=True))
    return Dropout(before, after, value, min(jumps), share, far, largest)


def _uneven(t: Signal, samples: Bends, at: Index) -> list[Dropout]:
    """Stretches between two jumps that hold no single value: noise about zero, values in another unit."""
    x, place, usual = samples.x, samples.places, samples.usual
    size = x[at + 1] - x[at]
    large = np.abs(size) > usual.minimum(MIN_SHARE, NOISE)
    at, size = at[large], size[large]
    found = []
    for k in np.flatnonzero(size[1:] * size[:-1] < 0.0).tolist():
        a, b = int(at[k]) + 1, int(at[k + 1]) + 1
        jump, larger = sorted((float(abs(size[k])), float(abs(size[k + 1]))))
        if larger < ONE_SIDED * usual.span or t[place[b - 1]] - t[place[a]] < LONGEST:
            continue
        if not 0.0 < np.ptp(x[a:b]) < HOLDS * larger:
            continue
        value = median(x[a:b])
        share = min(abs(value - end) / max(abs(end), MIN_SHARE * usual.span) for end in (x[a - 1], x[b]))
        largest = float(np.delete(np.abs(size), (k, k + 1)).max(initial=0.0))
        ends = int(place[a - 1]), int(place[b])
        found.append(Dropout(*ends, value, jump, float(share), far=False, usual=largest, even=False))
    return found


def _is_zero(d: Dropout, usual: Usual) -> bool:
    """Whether a stretch holds no more than noise about zero."""
    return abs(d.value) < MIN_SHARE * usual.span


def _differs(d: Dropout, e: Dropout) -> bool:
    """Whether the stretch of another channel between the same samples is a measurement, so that both are.

    A logger writes the same code into all channels; what differs is what the machine did.
    """
    return not e.far and e.value != d.value


def _cannot_be(t: Signal, name: str, d: Dropout, channels: Mapping[str, Signal]) -> bool:
    """Whether a channel that only motion can change jumps where there is no such motion."""
    usual = BEYOND * d.usual
    if name == "pressure":  # that of a flow changes with a valve
        return "flow" not in channels and _has_line(channels) and d.jump > usual > 0.0
    if name == "displacement":
        return d.jump > max(usual, TEARS * _fastest(t, d, channels))
    if name != "velocity" or "displacement" not in channels or d.before < 0 or d.after >= t.size or d.jump < usual:
        return False
    moved, with_it, without = travelled(t, channels, d.before, d.after)
    return abs(moved - without) < HOLDS * abs(moved - with_it)


def _has_line(channels: Mapping[str, Signal]) -> bool:
    return "velocity" in channels or "displacement" in channels


def _fastest(t: Signal, d: Dropout, channels: Mapping[str, Signal]) -> float:
    """Maximum travel of the line between two samples, by its velocity at the ends of a stretch; 0 where it is unknown. [m]"""
    if "velocity" not in channels:
        return 0.0
    around = slice(max(d.before, 0), d.after + 1)
    v = np.abs(channels["velocity"][around][[0, -1]])
    return float(v.max() * np.diff(t[around]).max()) if np.isfinite(v).all() else 0.0


def _contradicted(
    name: str,
    d: Dropout,
    channels: Mapping[str, Signal],
    suspects: Mapping[str, list[Dropout]],
    level: Mapping[str, Usual],
    witnesses: Sequence[str],
    open_circuit: bool,
) -> bool:
    """Whether the channels that would fall with this one, its witnesses, continue as if nothing had happened."""
    if name == "velocity" and "displacement" in channels:
        return False
    departs = {}
    together = False
    ends = [float(channels[name][k]) for k in (d.before, d.after) if 0 <= k < channels[name].size]
    side = float(np.sign(d.value - max(ends, key=lambda end: abs(end - d.value))))
    for other in witnesses:
        if other not in channels or (open_circuit and other in ("vdc", "idc")):
            continue
        beside = [e for e in suspects[other] if e.before < d.after - 1 and d.before < e.after - 1]
        if beside:
            together |= not d.even and any(not e.even for e in beside)
            continue
        minimum = MIN_SHARE * level[other].span
        moves = level[other].span > STILL * level[other].noise
        if moves and (off := _departure(channels[other], d, side, minimum, idle=other != "velocity")) is not None:
            departs[other] = off
    at_once = name == "vdc" and "idc" in departs and d.even  # a load without voltage carries no current
    if d.jump < BEYOND * d.usual and not at_once:
        return False
    if together and not departs.keys() - {"velocity"}:  # all of a machine's forces and currents fall: a clutch may slip
        return False
    if name == "idc" and "vdc" in departs and departs.keys() <= {"vdc", "velocity"}:
        rise = _departure(channels["vdc"], d, -side, MIN_SHARE * level["vdc"].span, idle=True)
        if rise is not None and rise > RISES:
            return False
    share = HOLDS if departs.keys() - {"velocity"} else ALONE
    return bool(departs) and max(departs.values()) < share * d.share


def _departure(y: Signal, d: Dropout, side: float, minimum: float, *, idle: bool) -> float | None:
    """How far another channel leaves its straight line over a stretch to one side, relative to its level beside it.

    None if it is lost itself, or if it idles (`idle`: what that channel does) below `minimum` and so could not fall.
    """
    span = whole(d.before, d.after, y.size)
    part = y[span.first : span.last + 1]
    part = part[np.isfinite(part)]
    there = beside(y, span, part[:1], part[-1:])
    if there is None or there.held or (idle and there.level < minimum):
        return None
    return float(np.max(side * there.off) / max(there.level, minimum))
