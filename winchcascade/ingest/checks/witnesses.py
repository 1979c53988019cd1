"""What the other channels of a log show: a fault of a sensor or a logger is what none of them shows."""

from __future__ import annotations

import numpy as np

from winchcascade.core.integrate import median, quantile
from winchcascade.core.run import Mask, Signal
from winchcascade.ingest.checks.samples import OF_NOISE, OF_RANGE, Samples

NEARBY = 12
"""Number of samples on either side of an event that show what a channel does without it. [1]"""

APART = 2.0
"""Smallest change at an event, over the upper quartile of such changes nearby, by which a channel shows it. [1]"""

MEDIAN_OF = 5
"""Number of samples whose median is the level beside an edge: a neighbour may be a spike. [1]"""

SETTLES = 0.5
"""Time after an edge in which the powers of other stages have followed it: five times that of rotor and DC link. [s]"""

HOLDS = 0.5
"""Another channel continues if it departs, relative to its level, by less than this share of what the suspect does. [1]"""

BY_SPEED = 5.0
"""Loss of torque, force or current over the loss of speed that explains it: with a light load, a fifth of the speed opens the
clutch. [1]"""


def shown(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether another channel changes as sharply as nowhere nearby at the ends of a stretch [first, last).

    A channel that holds a code there, or is lost like this one, is no witness. An end of the log is no edge.
    """
    inside = _finite(log.channels[name][first:last])
    beside = _finite(log.channels[name][[max(first - 1, 0), min(last, log.t.size - 1)]])
    if not inside.size or not beside.size:
        return False
    share = float(np.max(np.abs(inside - median(beside)))) / (log.level(name).span or np.inf)
    return any(
        _changes(log, other, first, last, OF_RANGE * max(share, 0.4)) and not is_lost(log, other, name, first, last)
        for other in log.channels
        if other != name
    )


def _changes(log: Samples, name: str, first: int, last: int, share: float) -> bool:
    """Whether a channel or its slope changes by a share of its range at the ends of a stretch, and much more than nearby."""
    y, n, level = log.channels[name], log.t.size, log.level(name)
    begin, end = max(first - 2, 0), min(last + 2, n)
    edges = [y[begin:end]]
    if last - first > 1:  # converters read one channel after the other, so that a step of one sample counts beside an edge
        edges = [part for part, inside in ((y[begin : first + 2], first > 0), (y[last - 2 : end], last < n)) if inside]
    beside = y[max(begin - NEARBY, 0) : begin + 1], y[end - 1 : end + NEARBY]
    for order in (1, 2):
        usual = _finite(np.abs(np.concatenate([np.diff(part, order) for part in beside])))
        minimum = max(share * level.span, OF_NOISE * level.noise, APART * quantile(usual, 0.75)) if usual.size else np.inf
        if all(np.max(_finite(np.abs(np.diff(part, order))), initial=0.0) > minimum for part in edges):
            return True
    return False


def is_lost(log: Samples, other: str, name: str, first: int, last: int) -> bool:
    """Whether another channel holds no measurement over a stretch: far values, the code or the zero of the suspect, or one value
    between two jumps.
    """
    x, y = _finite(log.channels[name][first:last]), _finite(log.channels[other][first:last])
    if not y.size or not x.size:
        return True
    level, here, there = log.level(other), median(x), median(y)
    if log.level(other).is_far(y[:1])[0] or here == there:
        return True
    zero = abs(here) < OF_RANGE * log.level(name).span and abs(there) < OF_RANGE * level.span
    held = last - first >= MEDIAN_OF and bool(np.ptp(y) == 0.0) and abs(there) > OF_RANGE * level.span
    return zero or held


def contradicted(log: Samples, name: str, first: int, last: int) -> bool:
    """Whether the channels that would depart with this one continue at each end of a stretch [first, last) where it jumps."""
    x, level = log.channels[name], log.level(name)
    edges = [(k, step) for k, step in ((first, 1), (last, -1)) if 0 < k < log.t.size]
    edges = [(k, step) for k, step in edges if abs(x[k] - x[k - 1]) > level.fault]
    return bool(edges) and all(_continues(log, name, k, step, first, last) for k, step in edges)


def _continues(log: Samples, name: str, edge: int, step: int, first: int, last: int) -> bool:
    """Whether the witnesses of a channel continue at an edge, behind which, in the direction of `step`, the suspect lies."""
    departs = {}
    own = _departure(log, name, edge, step, last - first, 0.0)
    for other in _witnesses(log, name):
        if not is_lost(log, other, name, first, last) and log.level(other).moves:
            off = _departure(log, other, edge, step, last - first, own)
            if off is not None:
                departs[other] = off * (BY_SPEED if other == "velocity" else 1.0)
    if own is None or not departs or (name == "idc" and departs.keys() == {"vdc"}):
        return False
    return max(departs.values()) < HOLDS * abs(own)


def _departure(log: Samples, name: str, edge: int, step: int, length: int, side: float | None) -> float | None:
    """Change of the magnitude of a channel from before an edge to behind it, over the larger one; None where it idles.

    Parameters
    ----------
    step : 1 if the suspect stretch begins at the edge, -1 if it ends there
    length : of the stretch, in samples
    side : change of the suspect, 0 if the channel is the suspect itself: of a witness the largest departure to that side counts
    """
    x, level = log.channels[name], log.level(name)
    here, behind = slice(max(edge - MEDIAN_OF, 0), edge), slice(edge, edge + MEDIAN_OF)
    reach = min(length, max(MEDIAN_OF, int(SETTLES / float(log.t[1] - log.t[0]))))
    inside = slice(edge, edge + reach) if step > 0 else slice(max(edge - reach, 0), edge)
    outside = _finite(x[here] if step > 0 else x[behind])
    within = _finite(x[inside])
    if side is None or not outside.size or 2 * within.size < reach:
        return None
    usual = median(outside)
    sign = -1.0 if usual < 0.0 else 1.0
    change = sign * (within - usual)
    off = median(change) if side == 0.0 else float(np.max(np.sign(side) * change))
    size = max(abs(usual), float(np.max(np.abs(within))))
    if size < 2.0 * OF_RANGE * level.span or size == 0.0:
        return None
    return off / size


def _witnesses(log: Samples, name: str) -> list[str]:
    """Channels that depart with a channel if the machine makes it depart: all of a line, else those of complete stages."""
    names = [*log.channels] if log.by_line else [other for stage in log.stages() for other in stage]
    excluded = {name, "displacement", "pressure", "speed"} | ({"vdc", "idc"} if log.open_circuit else set())
    if not log.by_line and len(log.stages()) < 2 and name != "vdc":  # the only load may be switched off
        return []
    return [other for other in dict.fromkeys(names) if other not in excluded]


def _finite(x: Signal) -> Signal:
    return x[np.isfinite(x)]
