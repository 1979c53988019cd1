"""Suspects as a fit uses them: effects by name, their fields in a row, and an effect with values."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import msgspec
import numpy as np

from winchcascade.core.run import Signal
from winchcascade.diagnosis.solve import Bounds
from winchcascade.rig.effects.effect import ActiveEffect, Effect

Suspects = Mapping[str, Effect]
"""Effects that a diagnosis may name, by their names."""


TAIL = 0.25
"""Beyond the plausible range of a field the probability falls by a factor e for each such share of the range. Assumed. [1]"""


class Freedom(msgspec.Struct, frozen=True):
    """Fields of some suspects, (k,) each: names, values where the effects are absent, ends `low` and `high` of what is
    plausible, and bounds of a fit: the outer ones of what is physically possible, the inner ones of what is plausible.
    """

    names: tuple[str, ...]
    absent: Signal
    low: Signal
    high: Signal
    bounds: Bounds


def freedom(*effects: Effect) -> Freedom:
    """The fields of some suspects in a row."""
    fields = [field for effect in effects for field in effect.fields]
    table = np.array([(f.absent, f.low, f.high, *f.possible) for f in fields], dtype=np.float64).reshape(-1, 5)
    absent, low, high, minimum, maximum = np.ascontiguousarray(table.T)
    bounds = Bounds(minimum, maximum, low, high, 1.0 / (TAIL * (high - low)))
    return Freedom(tuple(field.name for field in fields), absent, low, high, bounds)


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
    step = np.where(values + step > free.bounds.high, -step, step)
    return ((with_values(effect, x), dx) for x, dx in zip(values + np.diag(step), step.tolist(), strict=True))
