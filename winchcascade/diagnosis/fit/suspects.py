"""Suspects as a fit uses them: effects by name, their fields in a row, and an effect with
values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

import msgspec
import numpy as np

from winchcascade.core.run import Index, Signal
from winchcascade.rig.effects.effect import ActiveEffect, Effect

Suspects = Mapping[str, Effect]
"""Effects that a diagnosis may name, by their names."""


class Freedom(msgspec.Struct, frozen=True):
    """Fields of some suspects, (..., k) each: values where the effects are absent, ends `low` and
    `high` of what is plausible, and the bounds `minimum` and `maximum` of what is physically
    possible.
    """

    absent: Signal
    low: Signal
    high: Signal
    minimum: Signal
    maximum: Signal

    @property
    def sd(self) -> Signal:
        """Standard deviation of the prior: half of the plausible range. [unit of the field]"""
        return np.asarray(0.5 * (self.high - self.low))

    def some(self, own: Sequence[int] | Index) -> Freedom:
        """Those of some numbers, a row of them or several."""
        arrays = (self.absent, self.low, self.high, self.minimum, self.maximum)
        return Freedom(*(array[own] for array in arrays))


def freedom(*effects: Effect) -> Freedom:
    """The fields of some suspects in a row."""
    fields = [field for effect in effects for field in effect.fields]
    begins = [f.absent if f.start is None else f.start for f in fields]
    ends = [(f.low, f.high, *f.limits) for f in fields]
    table = np.column_stack([np.array(begins), np.array(ends, dtype=np.float64).reshape(-1, 4)])
    return Freedom(*np.ascontiguousarray(table.T))


def places_of(suspects: Suspects, names: Iterable[str]) -> dict[str, slice]:
    """Where each of some suspects has its fields in a row of all of them."""
    names = list(names)
    ends = np.cumsum([0, *(len(suspects[name].fields) for name in names)]).tolist()
    return {name: slice(a, b) for name, (a, b) in zip(names, pairwise(ends), strict=True)}


def with_values(effect: Effect, values: Signal) -> ActiveEffect:
    """A suspect with values, (k,), in the order of its fields."""
    return ActiveEffect(effect, tuple(values.tolist()))


def varied(effect: Effect, values: Signal, share: float) -> Iterator[tuple[ActiveEffect, float]]:
    """A suspect with one field after the other moved by a share of its range, down at its upper
    bound, and by how much.
    """
    free = freedom(effect)
    step = share * (free.high - free.low)
    step = np.where(values + step > free.maximum, -step, step)
    return (
        (with_values(effect, x), dx)
        for x, dx in zip(values + np.diag(step), step.tolist(), strict=True)
    )
