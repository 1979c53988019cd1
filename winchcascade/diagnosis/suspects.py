"""Suspects as a fit sees them: effects by name, their free fields, and an effect with values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.effects.effect import ActiveEffect, Effect

if TYPE_CHECKING:
    from winchcascade.core.run import Signal

Suspects = Mapping[str, Effect]
"""Effects that a diagnosis may name, by their names."""


class Freedom(msgspec.Struct, frozen=True):
    """Fields of one suspect, (k,) each: names, values where the effect is absent, and bounds of what is plausible."""

    names: tuple[str, ...]
    absent: Signal
    low: Signal
    high: Signal


def freedom(effect: Effect) -> Freedom:
    """What a fit may move of a suspect."""
    columns = zip(*((field.absent, field.low, field.high) for field in effect.fields), strict=True)
    return Freedom(tuple(field.name for field in effect.fields), *(np.array(x, dtype=np.float64) for x in columns))


def with_values(effect: Effect, values: Signal) -> ActiveEffect:
    """A suspect with values, (k,), in the order of its fields."""
    return ActiveEffect(effect, tuple(values.tolist()))
