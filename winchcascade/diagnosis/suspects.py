"""Suspects as a fit uses them: effects by name, their fields in a row, and an effect with values."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.rig.effects.effect import ActiveEffect, Effect

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from winchcascade.core.run import Signal

Suspects = Mapping[str, Effect]
"""Effects that a diagnosis may name, by their names."""


class Freedom(msgspec.Struct, frozen=True):
    """Fields of some suspects, (k,) each: names, values where the effects are absent, and bounds of what is plausible."""

    names: tuple[str, ...]
    absent: Signal
    low: Signal
    high: Signal


def freedom(*effects: Effect) -> Freedom:
    """The fields of some suspects in a row."""
    fields = [field for effect in effects for field in effect.fields]
    table = np.array([(field.absent, field.low, field.high) for field in fields], dtype=np.float64).reshape(-1, 3)
    return Freedom(tuple(field.name for field in fields), *np.ascontiguousarray(table.T))


def places_of(suspects: Suspects, names: Iterable[str]) -> dict[str, slice]:
    """Where each of some suspects has its fields in a row of all of them."""
    names = list(names)
    ends = np.cumsum([0, *(len(suspects[name].fields) for name in names)]).tolist()
    return {name: slice(a, b) for name, (a, b) in zip(names, pairwise(ends), strict=True)}


def with_values(effect: Effect, values: Signal) -> ActiveEffect:
    """A suspect with values, (k,), in the order of its fields."""
    return ActiveEffect(effect, tuple(values.tolist()))


def varied(effect: Effect, values: Signal, share: float) -> Iterator[tuple[ActiveEffect, float]]:
    """A suspect with one field after the other moved by a share of its range, down at its upper bound, and by how much."""
    free = freedom(effect)
    step = share * (free.high - free.low)
    step = np.where(values + step > free.high, -step, step)
    return ((with_values(effect, x), dx) for x, dx in zip(values + np.diag(step), step.tolist(), strict=True))
