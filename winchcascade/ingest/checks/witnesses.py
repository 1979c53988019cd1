"""What the other channels of a log show: a fault of a sensor or a logger is what none of them shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np

from winchcascade.core.integrate import median, quantile
from winchcascade.core.run import Signal
from winchcascade.ingest.checks.samples import OF_NOISE, OF_RANGE, Samples

NEARBY = 12
"""Number of samples on either side of an event that show what a channel does without it. [1]"""

APART = 2.0
"""Smallest change at an event, over the upper quartile of such changes nearby, by which a channel shows it. [1]"""

MEDIAN_OF = 3
"""Number of samples whose median is the level beside an edge: a neighbour may be a spike. [1]"""

SETTLES = 5 / 6
"""Time after an edge in which the powers of other stages have followed it, as a share of the width that smooths the velocity:
five times that of rotor and DC link. [1]"""

HOLDS = 0.5
"""Another channel continues if it departs, relative to its level, by less than this share of what the suspect does. [1]"""

AtEnds: TypeAlias = "Callable[[Iterable[bool]], bool]"
"""`all` or `any`: whether both ends of a stretch count, or one."""


def shown(log: Samples, name: str, first: int, last: int, at_ends: AtEnds) -> bool:
    """Whether another channel changes as sharply as nowhere nearby at each end of a stretch [first, last), or at one of them.

    A channel that holds a code there, or is lost like this one, is no witness. An end of the log is no edge.
    """
    inside = _finite(log.channels[name][first:last])
    beside = _finite(log.channels[name][[max(first - 1, 0), min(last, log.t.size - 1)]])
    if not inside.size or not beside.size:
        return False
    share = float(np.max(np.abs(inside - median(beside)))) / (log.level(name).span or np.inf)
    return any(
        _changes(log, other, first, last, max(OF_RANGE, 0.05 * share), at_ends)
        and not is_lost(log, other, name, first, last)
        for other in log.channels
        if other != name
    )


def _changes(log: Samples, name: str, first: int, last: int, share: float, at_ends: AtEnds) -> bool:
    """Whether a channel or its slope changes by a share of its range at the ends of a stretch, and much more than nearby."""
    y, n, level = log.channels[name], log.t.size, log.level(name)
    begin, end = max(first - 2, 0), min(last + 2, n)
    edges = [y[begin:end]]
    # Converters read one channel after the other, so that a step of one sample counts beside an edge.
    if last - first > 1:
        edges = [part for part, inside in ((y[begin : first + 2], first > 0), (y[last - 2 : end], last < n)) if inside]
    beside = y[max(begin - NEARBY, 0) : begin + 1], y[end - 1 : end + NEARBY]
    for order in (1, 2):
        usual = _finite(np.abs(np.concatenate([np.diff(part, order) for part in beside])))
        minimum = (
            max(share * level.span, OF_NOISE * level.noise, APART * quantile(usual, 0.75)) if usual.size else np.inf
        )
        if at_ends(bool(np.max(_finite(np.abs(np.diff(part, order))), initial=0.0) > minimum) for part in edges):
            return True
    return False


def is_lost(log: Samples, other: str, name: str, first: int, last: int) -> bool:
    """Whether another channel holds no measurement over a stretch: far values, one value, or code or zero of the suspect."""
    x, y = _finite(log.channels[name][first:last]), _finite(log.channels[other][first:last])
    if not y.size or not x.size:
        return True
    level, here, there = log.level(other), median(x), median(y)
    if log.level(other).is_far(y[:1])[0] or here == there:
        return True
    zero = all(abs(y) < OF_RANGE * span for y, span in ((here, log.level(name).span), (there, level.span)))
    held = last - first > MEDIAN_OF and bool(np.ptp(y) == 0.0) and abs(there) > OF_RANGE * level.span
    return zero or held


def contradicted(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether the channels that would depart with this one continue where it jumps away, in a stretch [first, last).

    In the course of a stretch that begins or ends without a jump, the machine may do something else: only its jump counts.
    """
    x, least, n = log.channels[name], log.level(name).long_fault, log.t.size
    begins, ends = (0 < k < n and bool(abs(x[k] - x[k - 1]) > least) for k in (first, last))
    reach = max(MEDIAN_OF, log.rows(SETTLES * log.smoothing))
    if not ends:
        last = min(first + reach, last)
    elif not begins:
        first = max(last - reach, first)
    own = _departure(log, name, first, last, (begins, ends), 0.0)
    if own is None:
        return False
    witnesses = [y for y in _witnesses(log, name) if log.level(y).moves and not is_lost(log, y, name, first, last)]
    off = {other: _departure(log, other, first, last, (begins, ends), own) for other in witnesses}
    departs = {other: size for other, size in off.items() if size is not None}
    if name == "idc" and departs.keys() == {"vdc"}:  # a load that is switched off
        return False
    return bool(departs) and max(departs.values()) < HOLDS * abs(own)


def _departure(log: Samples, name: str, first: int, last: int, jumps: tuple[bool, bool], side: float) -> float | None:
    """Largest departure of the magnitude of a channel from the line between the levels beside a stretch, over the larger one.

    None where it idles, or where most of it is lost.

    Parameters
    ----------
    jumps : whether the level before and after it shows what the channel departs from
    side : departure of the suspect, 0 if the channel is the suspect itself; of a witness that to the same side counts
    """
    x, least = log.channels[name], log.level(name).long_fault
    beside = _finite(x[max(first - MEDIAN_OF, 0) : first]), _finite(x[last : last + MEDIAN_OF])
    sides = [median(level) for level, counts in zip(beside, jumps, strict=True) if counts and level.size]
    inside, place = x[first:last], np.linspace(0.0, 1.0, last - first)
    known = np.isfinite(inside)
    if not sides or 2 * np.count_nonzero(known) < known.size:
        return None
    sign = -1.0 if sum(sides) < 0.0 else 1.0
    off = sign * (inside - (sides[0] + (sides[-1] - sides[0]) * place))[known]
    size = max(*map(abs, (sides[0], sides[-1])), float(np.max(np.abs(inside[known]))))
    if size == 0.0 or (size < least and name != "velocity"):  # a line that hardly moves still shows that it goes on
        return None
    to_side = 1.0 if (side or median(off)) > 0.0 else -1.0
    return float(np.max(to_side * off)) * (to_side if side == 0.0 else 1.0) / max(size, least)


def _witnesses(log: Samples, name: str) -> list[str]:
    """Channels that depart with a channel if the machine makes it depart: all of a line, else those of complete stages."""
    names = [*log.channels] if log.by_line else [other for stage in log.stages() for other in stage]
    excluded = {name, "displacement", "pressure", "speed"} | ({"vdc", "idc"} if log.open_circuit else set())
    if not log.by_line and len(log.stages()) < 2 and name != "vdc":  # the only load may be switched off
        return []
    return [other for other in dict.fromkeys(names) if other not in excluded]


def _finite(x: Signal) -> Signal:
    return x[np.isfinite(x)]
