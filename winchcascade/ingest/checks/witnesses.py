"""What the other channels of a log show: a fault of a sensor or a logger is what none of them
shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import TypeAlias

import numpy as np

from winchcascade.core.integrate import median, quantile
from winchcascade.core.run import Signal
from winchcascade.ingest.checks.samples import OF_NOISE, OF_RANGE, Samples

NEARBY = 12
"""Number of samples on either side of an event that show what a channel does without it. [1]"""

OUTRUNS = 5.0
"""Smallest jump of a channel that follows the line, over what the velocity gives with the mean
slope of the channel along the stroke: a gas is stiffer at its end. [1]"""

APART = 2.0
"""Smallest change at an event, over the upper quartile of such changes nearby, by which a channel
shows it. [1]"""

SPIKE_LENGTH_MAX = 5
"""Samples of the longest spike. What lasts longer is judged by the value that it holds. [1]"""

MEDIAN_OF = 3
"""Number of samples whose median is the level beside an edge: a neighbour may be a spike. [1]"""

SETTLES = 5 / 6
"""Time after an edge in which the powers of other stages have followed it, as a share of the width
that smooths the velocity: five times that of rotor and DC link. [1]"""

HOLDS = 0.5
"""Another channel continues if it departs, relative to its level, by less than this share of what
the suspect does: it is nearer to none than to all of it. [1]"""

OF_SUSPECT = 0.05
"""Smallest change by which another channel shows an event, in its range, over that of the suspect
in the range of the suspect. [1]"""

AtEnds: TypeAlias = "Callable[[Iterable[bool]], bool]"
"""`all` or `any`: whether both ends of a stretch count, or one."""

FOLLOW = ("displacement", "pressure")
"""Channels that only the travel of the line changes."""


def is_by_machine(log: Samples, name: str, first: int, last: int, *, spike: bool) -> bool:
    """Whether the machine made a channel depart over a stretch [first, last): another channel
    departs with it.

    A displacement jumps by no more than the velocity gives, and the displacement decides on the
    velocity. The pressure of a volume cannot jump for long, but that of a flow follows a valve.
    """
    if log.by_line and name in FOLLOW and "flow" not in log.channels:
        if not spike and name == "pressure" and last - first <= SPIKE_LENGTH_MAX:
            return True
        if not spike or name == "displacement":
            outruns = _outruns(log, name, first, last)
            if outruns or not spike:
                return not outruns
    if log.has_travel(name):
        with_it, without = _apart_by_travel(log, first, last)
        if with_it < without or (not spike and without < HOLDS * with_it):
            return with_it < without
        if spike:
            return False
    at_ends = any if spike else all
    if _is_shown(log, name, first, last, at_ends):
        return True
    return not spike and not _is_contradicted(log, name, first, last)


def _outruns(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether a channel that follows the line jumps into or out of a stretch by more than the
    velocity gives."""
    x, v = log.channels[name], log.channels.get("velocity")
    edges = np.array([k for k in (first, last) if 0 < k < log.t.size])
    if v is None or not edges.size:
        return True
    near = np.clip(edges[:, None] + (-2, -1, 0, 1), 0, v.size - 1)
    travel = np.nanmax(np.abs(v[near]), initial=0.0) * (log.t[edges] - log.t[edges - 1])
    if name != "displacement" and "displacement" in log.channels:
        travel *= log.level(name).span / (log.level("displacement").span or math.inf)
    return bool(np.any(np.abs(x[edges] - x[edges - 1]) > OUTRUNS * travel))


def _apart_by_travel(log: Samples, first: int, last: int) -> tuple[float, float]:
    """How far the travel by the displacement is from that by the velocity over a stretch, and from
    that by the line between its two neighbours; NaN where it shows nothing. [m]"""
    if first == 0 or last == log.t.size:
        return math.nan, math.nan
    part = slice(first - 1, last + 1)
    t, v, x = (y[part] for y in (log.t, log.channels["velocity"], log.channels["displacement"]))
    if np.ptp(x[1:-1]) == 0.0 and x.size > 2 * MEDIAN_OF:  # it holds one value, too
        return math.nan, math.nan
    good, moved = np.isfinite(v), float(x[-1] - x[0])
    line = 0.5 * float((v[0] + v[-1]) * (t[-1] - t[0]))
    return abs(moved - float(np.trapezoid(v[good], t[good]))), abs(moved - line)


def _is_shown(log: Samples, name: str, first: int, last: int, at_ends: AtEnds) -> bool:
    """Whether another channel changes as sharply as nowhere nearby at each end of a stretch
    [first, last), or at one of them. An end of the log is no edge."""
    inside = _finite(log.channels[name][first:last])
    beside = _finite(log.channels[name][[max(first - 1, 0), min(last, log.t.size - 1)]])
    if not inside.size or not beside.size:
        return False
    size = float(np.max(np.abs(inside - median(beside)))) / (log.level(name).span or math.inf)
    share = max(OF_RANGE, OF_SUSPECT * size)
    others = (other for other in log.channels if other != name)
    seen = (other for other in others if _changes(log, other, first, last, share, at_ends))
    return any(not _is_lost(log, other, name, first, last) for other in seen)


def _changes(log: Samples, name: str, first: int, last: int, share: float, at_ends: AtEnds) -> bool:
    """Whether a channel or its slope changes by a share of its range at the ends of a stretch, and
    much more than nearby."""
    y, n, level = log.channels[name], log.t.size, log.level(name)
    begin, end = max(first - 2, 0), min(last + 2, n)
    edges = [y[begin:end]]
    if last - first > 1:
        # Converters read one channel after the other: a step of one sample counts beside an edge.
        ends = (y[begin : first + 2], first > 0), (y[last - 2 : end], last < n)
        edges = [part for part, inside in ends if inside]
    beside = y[max(begin - NEARBY, 0) : begin + 1], y[end - 1 : end + NEARBY]
    for order in (1, 2):
        usual = _finite(np.abs(np.concatenate([np.diff(part, order) for part in beside])))
        if not usual.size:
            continue
        nearby = APART * quantile(usual, 0.75)
        least = max(share * level.span, OF_NOISE * level.noise, nearby)
        sizes = (np.max(_finite(np.abs(np.diff(part, order))), initial=0.0) for part in edges)
        if at_ends(bool(size > least) for size in sizes):
            return True
    return False


def _is_contradicted(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether the channels that would depart with this one continue where it jumps away.

    In the course of a stretch that begins or ends without a jump, the machine may do something
    else: only its jump counts.
    """
    x, least, n = log.channels[name], log.level(name).long_fault, log.t.size
    begins, ends = (0 < k < n and bool(abs(x[k] - x[k - 1]) > least) for k in (first, last))
    reach = max(MEDIAN_OF, log.rows(SETTLES * log.smoothing))
    if not ends:
        last = min(first + reach, last)
    elif not begins:
        first = max(last - reach, first)
    jumps = begins, ends
    own = _departure(log, name, first, last, jumps, 0.0)
    # Without a line, a supply may raise a channel, or another load lower it, as it likes: only what
    # falls towards zero is lost.
    if own is None or (not log.by_line and own > -HOLDS):
        return False
    names = [n for n in _witnesses(log, name, abs(own)) if not _is_lost(log, n, name, first, last)]
    departs = {n: _departure(log, n, first, last, jumps, own) for n in names}
    sizes = {n: size for n, size in departs.items() if size is not None}
    if name == "idc" and [*sizes] == ["vdc"]:  # a load that is switched off
        return False
    return bool(sizes) and max(sizes.values()) < HOLDS * abs(own)


def _departure(
    log: Samples,
    name: str,
    first: int,
    last: int,
    jumps: tuple[bool, bool],
    side: float,
) -> float | None:
    """Largest departure of the magnitude of a channel from the line between the levels beside a
    stretch, over the larger one; None where it idles, or where most of it is lost.

    Parameters
    ----------
    jumps : whether the level before and after it shows what the channel departs from
    side : departure of the suspect, 0 if the channel is the suspect itself; of a witness that to
        the same side counts
    """
    x, least = log.channels[name], log.level(name).long_fault
    beside = _finite(x[max(first - MEDIAN_OF, 0) : first]), _finite(x[last : last + MEDIAN_OF])
    sides = [median(y) for y, counts in zip(beside, jumps, strict=True) if counts and y.size]
    inside = x[first:last]
    known = np.isfinite(inside)
    if not sides or 2 * np.count_nonzero(known) < known.size:
        return None
    sign = -1.0 if sum(sides) < 0.0 else 1.0
    line = np.linspace(sides[0], sides[-1], inside.size)
    off = sign * (inside - line)[known]
    size = max(abs(sides[0]), abs(sides[-1]), float(np.max(np.abs(inside[known]))))
    # A slow line still shows that it goes on.
    if size == 0.0 or (size < least and name != "velocity"):
        return None
    to_side = math.copysign(1.0, side or median(off))
    return float(np.max(to_side * off)) * (1.0 if side else to_side) / max(size, least)


def _witnesses(log: Samples, name: str, size: float) -> list[str]:
    """Channels that depart with a channel if the machine makes it depart by so much of its level:
    all of a line, else those of complete stages. One that never departs so far, as a supply, shows
    nothing."""
    if not log.by_line and len(log.stages()) < 2 and name != "vdc":
        return []  # the only load may be switched off
    names = [*log.channels] if log.by_line else [n for stage in log.stages() for n in stage]
    excluded = {name, "displacement", "pressure", "speed"}
    if log.open_circuit:
        excluded |= {"vdc", "idc"}
    levels = {n: log.level(n) for n in dict.fromkeys(names) if n not in excluded}
    least = min(HOLDS * size, HOLDS)
    return [n for n, level in levels.items() if level.moves and level.span >= least * level.top]


def _is_lost(log: Samples, other: str, name: str, first: int, last: int) -> bool:
    """Whether another channel holds no measurement over a stretch: far values, one value, or the
    code or zero of the suspect."""
    x, y = _finite(log.channels[name][first:last]), _finite(log.channels[other][first:last])
    if not y.size or not x.size:
        return True
    level, here, there = log.level(other), median(x), median(y)
    if bool(level.is_far(y[:1])[0]) or here == there:
        return True
    zero = abs(here) < OF_RANGE * log.level(name).span and abs(there) < OF_RANGE * level.span
    held = last - first > MEDIAN_OF and bool(np.ptp(y) == 0.0)
    return zero or (held and abs(there) > OF_RANGE * level.span)


def _finite(x: Signal) -> Signal:
    return x[np.isfinite(x)]
