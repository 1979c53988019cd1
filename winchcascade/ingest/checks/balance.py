"""The balance of the powers of a bench: a fault of one channel breaks it, and a load that is switched does not.

A stage upstream delivers what another one loses or gains, and a stage downstream has no other source. So a power that vanishes
while its neighbours continue was not measured.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import reduce

import msgspec
import numpy as np

from winchcascade.core.integrate import median
from winchcascade.core.run import Mask, Signal
from winchcascade.ingest.checks.glitches import MIN_SHARE
from winchcascade.ingest.checks.spikes import STILL, UPDATES, usual_without
from winchcascade.ingest.checks.stuck import IDLE

HOLDS = 0.5
"""Another channel continues if it departs, relative to its range, by less than this share of what the suspect departs."""

SETTLES = 2.0
"""Time after a jump in which the other powers must have followed it, filters of their meters included. [s]"""

LEVEL = 5
"""Number of samples next to a stretch whose median is the level there: a neighbour may be a spike."""


class Power(msgspec.Struct, frozen=True):
    """Power of a stage of a bench without a line: the channels that it is made of, its values and their range [W], and whether
    they contain more than noise."""

    channels: tuple[str, ...]
    watts: Signal
    span: float
    moves: bool


def powers_of(channels: Mapping[str, Signal], stages: Sequence[tuple[str, ...]]) -> list[Power]:
    """Powers of the stages of which channels are logged at the same instants, each as the product of its channels."""
    powers = []
    for factors in stages:
        watts = reduce(np.multiply, (channels[name] for name in factors))
        known = watts[np.isfinite(watts)]
        if known.size:
            usual, sign = usual_without(known, np.empty(0)), -1.0 if known.sum() < 0.0 else 1.0
            moves = usual.span > STILL * usual.noise
            powers.append(Power(factors, sign * watts, usual.span, moves))
    return powers


def others_deliver(name: str, powers: Sequence[Power], samples: int) -> Mask:
    """Whether another stage than that of a channel has a power, (samples,); all are set where none is known."""
    others = [power for power in powers if name not in power.channels]
    if not others:
        return np.ones(samples, dtype=bool)
    deliver: Mask = np.logical_or.reduce([np.abs(power.watts) > IDLE * power.span for power in others])
    return deliver


MOTIONS = ("velocity", "speed")
"""Channels that a stage may hold at zero under power: a machine that is blocked takes a current and gives a torque."""

CLEAR = 5.0
"""A mean power that exceeds this many of its standard errors is more than noise."""


def is_dead(name: str, channels: Mapping[str, Signal], powers: Sequence[Power], *, turns: bool) -> bool:
    """Whether a channel is zero throughout although its stage works: the other channels of its power are there, and so is the
    power of another stage, where one is known. A motion is lost only if a stage downstream has a power.

    Parameters
    ----------
    powers : of the stages, in the direction in which power flows
    turns : whether line or shaft move at all
    """
    own = [k for k, power in enumerate(powers) if name in power.channels]
    if not own or np.any(np.nan_to_num(channels[name])):
        return False
    if name in MOTIONS:
        return any(_delivers(power) for power in powers[own[-1] + 1 :])
    factors = [factor for factor in powers[own[0]].channels if factor != name]
    working = all(turns if factor in MOTIONS else np.any(np.nan_to_num(channels[factor])) for factor in factors)
    others = [power for power in powers if name not in power.channels]
    return working and (any(map(_delivers, others)) or (not others and bool(factors)))


def _delivers(power: Power) -> bool:
    """Whether a power contains more than noise about zero."""
    watts = power.watts[np.isfinite(power.watts)]
    error = float(np.std(np.diff(watts))) / math.sqrt(2.0 * watts.size) if watts.size > 1 else 0.0
    return power.moves or abs(float(watts.mean())) > CLEAR * error


class Span(msgspec.Struct, frozen=True):
    """First and last sample of a span, and whether these are good neighbours of the stretch in it."""

    first: int
    last: int
    before: bool
    after: bool


def whole(before: int, after: int, samples: int) -> Span:
    """A stretch between two samples, -1 or n at an end of the log, of a log with this number of samples."""
    return Span(max(before, 0), min(after, samples - 1), before=before >= 0, after=after < samples)


class Beside(msgspec.Struct, frozen=True):
    """A signal over a span: how far each sample is off the straight line between the levels at its ends, the larger one of
    these, the largest magnitude, and whether it holds one value for so long that it may be lost."""

    off: Signal
    level: float
    size: float
    held: bool


def beside(y: Signal, span: Span, begin: Signal, end: Signal) -> Beside | None:
    """A signal over a span, for samples that show its level before and after; None if too much of it is missing.

    At an end of the log the level on the other side counts for both.
    """
    part = y[span.first : span.last + 1]
    good = np.flatnonzero(np.isfinite(part))
    inside = part[span.before : part.size - span.after]
    begin, end = begin if span.before else end, end if span.after else begin
    begin, end = begin[np.isfinite(begin)], end[np.isfinite(end)]
    if 2 * np.count_nonzero(np.isfinite(inside)) < inside.size or good.size < 2 or not (begin.size and end.size):
        return None
    held = inside.size >= UPDATES and bool(np.ptp(inside[np.isfinite(inside)]) == 0.0)
    levels = np.array([median(begin), median(end)])
    line = levels[0] + (levels[1] - levels[0]) * (good - good[0]) / (good[-1] - good[0])
    level = float(np.abs(levels).max())
    return Beside(part[good] - line, level, max(level, float(np.max(np.abs(part[good])))), held)


def breaks_balance(t: Signal, name: str, before: int, after: int, powers: Sequence[Power]) -> bool:
    """Whether the powers of all other stages continue, although that of a channel's stage departs with the channel.

    In the course of a long stretch the machine may do something else: its begin counts, too.

    Parameters
    ----------
    t : (n,) stamps [s]
    name : the channel
    before, after : samples on either side of the stretch, -1 or n at an end of the log
    powers : of the stages, in the direction in which power flows
    """
    spans = [whole(before, after, t.size)]
    begin = max(int(np.searchsorted(t, t[spans[0].first] + SETTLES)), spans[0].first + LEVEL)
    if spans[0].before and begin < spans[0].last:
        spans.append(Span(spans[0].first, begin, before=True, after=False))
    return any(_is_unbalanced(t, name, span, powers) for span in spans)


def _is_unbalanced(t: Signal, name: str, span: Span, powers: Sequence[Power]) -> bool:
    """Whether the power of a channel's stage departs over a span, and those of all others do not.

    A stage upstream delivers what the stage loses or gains; one downstream has no other source. Their meters may be slower.
    """
    own = next((k for k, power in enumerate(powers) if name in power.channels), None)
    if own is None:
        return False
    here = _between(powers[own].watts, span, span.last)
    inside = np.empty(0) if here is None else here.off[span.before : here.off.size - span.after]
    if here is None or not inside.size:
        return False
    change = median(inside)
    if change == 0.0 or abs(change) < max(MIN_SHARE * powers[own].span, HOLDS * here.size):
        return False
    settled = min(int(np.searchsorted(t, t[span.last] + SETTLES)), t.size - 1)
    follow = []
    for k, power in enumerate(powers):
        there = _between(power.watts, span, settled) if power.moves and name not in power.channels else None
        if there is None or there.held:
            continue
        gained = float(np.max(math.copysign(1.0, change) * there.off))
        if k < own:
            follow.append(gained / abs(change))
        elif there.level >= MIN_SHARE * power.span:
            follow.append(gained / there.size * here.size / abs(change))
    return bool(follow) and max(follow) < HOLDS


def _between(watts: Signal, span: Span, settled: int) -> Beside | None:
    """A power over a span between its levels before and, from a sample on, after it: medians, as neighbours may be spikes."""
    before, after = watts[max(span.first - LEVEL + 1, 0) : span.first + 1], watts[settled : settled + LEVEL]
    return beside(watts, span, before, after)
