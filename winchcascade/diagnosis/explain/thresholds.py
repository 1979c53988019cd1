"""How large each effect, acting alone, would have to be to be named in some logs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.fit.expansion import Expansion
from winchcascade.diagnosis.fit.search import Found
from winchcascade.diagnosis.fit.suspects import freedom, with_values

if TYPE_CHECKING:
    from collections.abc import Callable

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.fit.suspects import Freedom
    from winchcascade.rig.effects.effect import ActiveEffect

SURELY = 1.28
"""Standard deviations by which noise may make an effect look smaller than it is: nine of ten are
named then.
"""


class Threshold(msgspec.Struct, frozen=True):
    """The size from which nine of ten effects would be named: `value` of the reported number in its
    `unit`, None where no plausible one would be; at `absent` the effect is absent.
    """

    effect: str
    absent: float
    value: float | None
    unit: str


def not_visible(found: Found) -> Names:
    """Effects beside the best set that these logs would not show at any plausible size."""
    others = (name for name in found.problem.suspects if name not in found.best.names)
    return tuple(name for name in others if _beyond(found.expansion, name, 1.0) <= 0.0)


def thresholds(found: Found, relevance: Callable[[ActiveEffect], float]) -> tuple[Threshold, ...]:
    """The threshold of every suspect, by the rule that chooses causes and calls them relevant.

    Parameters
    ----------
    relevance : size of what an effect changes most, beside the best fit, in what the rig file calls
        relevant [1]
    """
    rows = []
    for name, effect in found.problem.suspects.items():
        free, share = freedom(effect), _smallest_share(found.expansion, name)
        absent, value, way = with_values(effect, free.absent).reported, None, _way(free)
        if share is not None:
            size = relevance(with_values(effect, free.absent + share * way))
            if share <= min(size, 1.0):
                named = free.absent + share / min(size, 1.0) * way
                value = with_values(effect, named).reported
        rows.append(Threshold(name, absent, value, effect.unit))
    return tuple(rows)


def _way(free: Freedom) -> Signal:
    """The way of each field from where its effect is absent to the far end of its range, (k,)."""
    up, down = free.high - free.absent, free.low - free.absent
    return np.where(up >= -down, up, down)


PRECISE = 1e-6
"""Share of itself to which the smallest share of a range is found. [1]"""


def _smallest_share(expansion: Expansion, name: str) -> float | None:
    """Share of the way from absent to the far end of its range at which an effect is named; None
    beyond that.
    """
    from scipy.optimize import brentq

    if _beyond(expansion, name, 1.0) <= 0.0:
        return None
    return float(brentq(lambda share: _beyond(expansion, name, share), 0.0, 1.0, rtol=PRECISE))


def _beyond(expansion: Expansion, name: str, share: float) -> float:
    """By how much logs with a share of an effect, as the expansion foresees them, have more
    evidence for it than for nothing, also where noise makes it look smaller, beyond what names
    it. [nats]
    """
    free, step = expansion.free, np.zeros_like(expansion.slope)
    own = expansion.index((name,))
    step[own] = share * _way(free)[own]
    z = math.sqrt(max(float(step @ expansion.curve @ step) / expansion.evidence.scale, 0.0))
    seen = expansion.curve @ step * max(1.0 - SURELY / max(z, 1e-12), 0.0)
    injected = msgspec.structs.replace(expansion, value=free.absent, slope=seen, acting=())
    return injected.worth([(name,)])[(name,)]  # that of nothing is 0
