"""The objective about a fit as a quadratic, and what the freedom of its fields costs, of a winch without a model."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.solve import Bounds, minimum_within

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnosis_result import Names

CLEARLY = 5.0
"""The smaller set wins unless the larger one has so much more evidence, prices paid: very strong by Kass and Raftery (1995),
odds of a hundred and fifty to one."""


class Linear(msgspec.Struct, frozen=True):
    """The objective about a fit as a quadratic in the fields of every suspect, nuisances eliminated.

    `curve` (k, k) and `slope` (k,) are in the units of the fields; `value` and `absent` (k,) are the fields at the place of
    expansion and where they are absent. The fields of a suspect are at its `place`.
    """

    curve: Signal
    slope: Signal
    value: Signal
    absent: Signal
    bounds: Bounds
    place: Mapping[str, slice]

    def index(self, names: Names) -> list[int]:
        """Numbers of the fields of some suspects, in their order."""
        return [k for name in names for k in range(self.value.size)[self.place[name]]]

    def best(self, names: Names) -> tuple[float, Signal]:
        """Lowest objective of a set, relative to the place of expansion, and its fields, (k,)."""
        chosen = np.zeros(self.value.size, dtype=bool)
        chosen[self.index(names)] = True
        step = np.where(chosen, 0.0, self.absent - self.value)
        if names:
            pull = self.slope[chosen] - self.curve[np.ix_(chosen, ~chosen)] @ step[~chosen]
            bounds = self.bounds.some(chosen).about(self.value[chosen])
            step[chosen] = minimum_within(self.curve[np.ix_(chosen, chosen)], pull, bounds)
        objective = 0.5 * float(step @ self.curve @ step) - float(self.slope @ step)
        x = self.value + step
        return objective + self.bounds.penalty(x) - self.bounds.penalty(self.value), x


def cost_of(curve: Signal, slope: Signal, x: Signal, bounds: Bounds) -> float:
    """What the freedom of fields costs: the share of their plausible ranges that the data leave (Laplace).

    A field at one of its bounds keeps a half of its normal or, where the objective rises from the bound, an exponential.

    Parameters
    ----------
    curve, slope : (k, k) and (k,) of the objective at the fields `x`, (k,)
    """
    span, inside = bounds.inner_high - bounds.inner_low, inside_of(x, bounds)
    cost = 0.0
    if inside.any():
        scaled = curve[np.ix_(inside, inside)] * np.outer(span[inside], span[inside]) + np.eye(int(inside.sum()))
        cost += 0.5 * float(np.linalg.slogdet(scaled)[1]) - 0.5 * int(inside.sum()) * math.log(2.0 * math.pi)
    for k in np.flatnonzero(~inside):
        width = math.sqrt(0.5 * math.pi / max(float(curve[k, k]), 1e-300))
        cost += math.log(span[k] / min(width, 1.0 / max(abs(float(slope[k])), 1e-300), span[k]))
    return max(cost, 0.0)


def inside_of(x: Signal, bounds: Bounds) -> NDArray[np.bool_]:
    """Whether fields lie at none of their bounds, inner or outer, (k,)."""
    eps = 1e-9 * (bounds.inner_high - bounds.inner_low)
    ends = (bounds.low, bounds.high, bounds.inner_low, bounds.inner_high)
    return np.asarray(np.all([np.abs(x - end) > eps for end in ends], axis=0))
