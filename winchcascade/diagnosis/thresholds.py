"""How large each effect, acting alone, would have to be to be named in some logs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.evidence import CLEARLY, Found, Linear
from winchcascade.diagnosis.suspects import Suspects, freedom, with_values

if TYPE_CHECKING:
    from collections.abc import Callable

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.rig.effects.effect import ActiveEffect

SURELY = 1.28
"""Standard deviations by which noise may make an effect look smaller than it is: nine of ten are named then."""

HALVINGS = 24
"""Rounds of halving in which the smallest share of a range is found."""


class Threshold(msgspec.Struct, frozen=True):
    """The size from which nine of ten effects would be named: `value` of the reported number in its `unit`, None where no
    plausible one would be; at `absent` the effect is absent.
    """

    effect: str
    absent: float
    value: float | None
    unit: str


def not_visible(suspects: Suspects, found: Found) -> Names:
    """Effects beside the best set that these logs would not show at any plausible size."""
    others = (name for name in suspects if name not in found.best.names)
    return tuple(name for name in others if not _is_named(found.linear, name, found.scale, 1.0))


def thresholds(suspects: Suspects, found: Found, relevance: Callable[[ActiveEffect], float]) -> tuple[Threshold, ...]:
    """The threshold of every suspect, by the rule that chooses causes and calls them relevant.

    Parameters
    ----------
    relevance : size of what an effect changes most, beside the best fit, in what the rig file calls relevant [1]
    """
    rows = []
    for name, effect in suspects.items():
        free, share = freedom(effect), _smallest_share(found.linear, name, found.scale)
        way = np.where(free.high - free.absent >= free.absent - free.low, free.high, free.low) - free.absent
        absent, value = with_values(effect, free.absent).reported, None
        if share is not None:
            size = relevance(with_values(effect, free.absent + share * way))
            share = share / size if 0.0 < size < 1.0 else share
            value = with_values(effect, free.absent + share * way).reported if size > 0.0 and share <= 1.0 else None
        rows.append(Threshold(name, absent, value, effect.unit))
    return tuple(rows)


def _smallest_share(linear: Linear, name: str, scale: float) -> float | None:
    """Share of the way from absent to the far end of its range at which an effect is named, by halving; None beyond that."""
    if not _is_named(linear, name, scale, 1.0):
        return None
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _is_named(linear, name, scale, middle) else (middle, high)
    return high


def _is_named(linear: Linear, name: str, scale: float, share: float) -> bool:
    """Whether logs with a share of an effect, as the expansion foresees them, have clearly more evidence for it than for
    nothing, also where noise makes it look smaller.
    """
    step = _far(linear, name, share)
    z = math.sqrt(max(float(step @ linear.curve @ step) / scale, 0.0))
    seen = linear.curve @ step * max(1.0 - SURELY / max(z, 1e-12), 0.0)
    injected = msgspec.structs.replace(linear, value=linear.absent, slope=seen)
    return injected.evidence((name,), scale) - injected.evidence((), scale) > CLEARLY


def _far(linear: Linear, name: str, share: float) -> Signal:
    """A share of the way to the end of the range of an effect that is farther from its absence, in the row of all fields."""
    up, down = linear.bounds.inner_high - linear.absent, linear.bounds.inner_low - linear.absent
    step = np.zeros_like(linear.absent)
    step[linear.place[name]] = share * np.where(up >= -down, up, down)[linear.place[name]]
    return step
