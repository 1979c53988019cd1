"""Values of some suspects that bring a table's efficiencies to what is printed: sought on curves, then simulated."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.diagnosis.suspects import freedom, with_values
from winchcascade.tables.effect_curves import ETAS, EffectCurve, bent, reach_of

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.suspects import Suspects
    from winchcascade.rig.effects.effect import ActiveEffect
    from winchcascade.tables.effect_curves import Bench

Curves = Mapping[str, Sequence[EffectCurve | None]]

SOFT = 1e-3
"""Weight, in a search for what brings all rows within reach, of lying close to the printed values themselves. [1]"""

FEW = 7
"""Values of a field in a first look at many sets."""

TRIALS, POLISH, FIELDS = 40, 3, 16
"""Steps of a search on the curves, and of one that simulates: fewer of these where many fields make each step long."""

STEP = 0.02
"""Share of a field's range by which its derivative is taken."""

AT_BOUND = 1e-3
"""A field stops at a bound when it is this close to it, as a share of its range. [1]"""


class Values(msgspec.Struct, frozen=True):
    """Effects with values, and what they leave of a table.

    `fields` and `reported` by effect. `left` is the rms of printed minus simulated by metric, `excess` the sum of what is still
    out of reach [1], `misfit` the sum of squares of printed minus simulated in standard uncertainties. `plausible` tells
    whether all fields lie within their bounds, `at_bound` names those that stop at the end of what was looked at.
    """

    fields: Mapping[str, Mapping[str, float]]
    reported: Mapping[str, Mapping[str, float]]
    left: Mapping[str, float]
    excess: float
    misfit: float
    plausible: bool
    at_bound: tuple[str, ...]

    @property
    def enough(self) -> bool:
        """Whether all that the table prints is within reach then."""
        return self.excess <= 0.0


class Search:
    """Some suspects before a table.

    On curves, the logarithms of the efficiencies' changes add up: exact for one field, near enough to start from for more.
    """

    def __init__(self, bench: Bench, kinds: Suspects, curves: Curves) -> None:
        self.bench, self.kinds = bench, kinds
        free = [freedom(kind) for kind in kinds.values()]
        self.places = [(name, field) for name, own in zip(kinds, free, strict=True) for field in own.names]
        self.absent = np.concatenate([own.absent for own in free])
        self.plausible = tuple(np.concatenate([getattr(own, end) for own in free]) for end in ("low", "high"))
        self.curves = [curve for name in kinds for curve in curves[name]]
        ends = zip(*(reach_of(kind) for kind in kinds.values()), strict=True)
        low, high = (np.concatenate(end) for end in ends)
        for k, curve in enumerate(self.curves):
            if curve is not None:
                low[k], high[k] = max(low[k], curve.x[0]), min(high[k], curve.x[-1])
        self.examined = (low, high)
        self.speeds = bench.speeds

    @property
    def single(self) -> EffectCurve | None:
        """The one curve of a suspect of one field, which is exact; None for more."""
        return self.curves[0] if len(self.curves) == 1 else None

    def fit(self, *, metric: int | None = None, hinge: bool = False, wide: bool = False) -> Signal:
        """Best values of all fields, (k,), on the curves.

        Parameters
        ----------
        metric : one efficiency alone, by its place in `ETAS`; all by default
        hinge : of what is out of reach; by default of printed minus simulated
        wide : beyond what is plausible too
        """
        low, high = self._bounds(wide)
        if self.single is not None:
            x = self.single.x[(self.single.x >= low[0] - 1e-12) & (self.single.x <= high[0] + 1e-12)]
            x = np.concatenate((x, low, high, self.absent))
            eta = self.bench.nominal * np.exp(self.single.at(x))
            cost = np.sum(self._residual(eta, metric, hinge) ** 2, axis=-1)
            return x[[int(np.argmin(cost))]]
        return _descend(
            lambda x: self._residual(self._eta(x), metric, hinge), self.absent, low, high, TRIALS,
            slopes=lambda x: self._slopes(x, metric, hinge),
        )  # fmt: skip

    def best_excess(self, metric: int, *, wide: bool = False) -> float:
        """What the best values leave out of reach of one efficiency, in all rows. [1]

        Of several fields the best on the curves and all of them at either end are simulated.
        """
        best = self.fit(metric=metric, hinge=True, wide=wide)
        if self.single is not None:
            return float(self.bench.excess_by_metric(self._eta(best))[metric])
        found = [self.simulated(x) for x in (best, *self._bounds(wide))]
        return min(
            (float(self.bench.excess_by_metric(eta)[metric]) for eta in found if eta is not None), default=np.inf
        )

    def on_curves(self, x: Signal) -> float:
        """The same in all, on the curves."""
        return float(np.sum(self.bench.excess_by_metric(self._eta(x))))

    def glimpse(self) -> float:
        """What a few plausible values leave out of reach at best, on the curves: a first look at many sets. [1]

        The fields of one suspect go together from absent to an end of what is plausible, suspects go independently.
        """
        ratio = np.zeros((1, *self.bench.printed.shape))
        for name in self.kinds:
            own = [k for k, (of, _) in enumerate(self.places) if of == name]
            few = np.concatenate([self._along(own, end) for end in self._bounds(wide=False)])
            ratio = (ratio[:, None] + few[None]).reshape(-1, *few.shape[1:])
        over = np.nansum(self.bench.excess(self.bench.nominal * np.exp(ratio)), axis=(1, 2))
        return float(over.min())

    def _along(self, own: Sequence[int], end: Signal) -> Signal:
        """Logarithmic ratios on the way of some fields from absent to an end, (FEW, rows, 3)."""
        total = np.zeros((FEW, *self.bench.printed.shape))
        for k in own:
            curve = self.curves[k]
            if curve is not None:
                total += curve.at(np.linspace(self.absent[k], end[k], FEW))
        return total

    def misfit_on_curves(self, x: Signal) -> float:
        """Sum of squares of printed minus simulated in standard uncertainties, on the curves."""
        return float(np.nansum(self.bench.misfit(self._eta(x)) ** 2))

    def effects(self, x: Signal) -> list[ActiveEffect]:
        """The suspects with values, (k,) in the order of their fields."""
        ends = np.cumsum([len(kind.fields) for kind in self.kinds.values()])[:-1]
        return [with_values(kind, part) for kind, part in zip(self.kinds.values(), np.split(x, ends), strict=True)]

    def simulated(self, x: Signal) -> Signal | None:
        """Efficiencies at values of the fields, simulated, (rows, 3)."""
        found = bent(self.bench, self.effects(x), self.speeds)
        if found is None:
            return None
        eta, self.speeds = found
        return eta

    def polished(self, x: Signal, *, hinge: bool = False, wide: bool = False) -> Signal:
        """Better values from those found on the curves, by simulations."""

        def residual(values: Signal) -> Signal:
            eta = self.simulated(values)
            return self._residual(self.bench.nominal if eta is None else eta, None, hinge)

        return (
            x
            if self.single is not None
            else _descend(residual, x, *self._bounds(wide), max(2, min(POLISH, FIELDS // x.size)))
        )

    def told(self, x: Signal) -> Values | None:
        """Say of values of the fields what they leave, simulated; None where no model comes of them."""
        eta = self.simulated(x)
        if eta is None:
            return None
        bench, (low, high), (least, most) = self.bench, self.plausible, self.examined
        gone = [
            f"{name}.{field}"
            for (name, field), value, a, b in zip(self.places, x.tolist(), least, most, strict=True)
            if min(value - a, b - value) < AT_BOUND * (b - a) and value != self._absent_of(name, field)
        ]
        made = dict(zip(self.kinds, self.effects(x), strict=True))
        fields = {
            name: {field: value for (of, field), value in zip(self.places, x.tolist(), strict=True) if of == name}
            for name in self.kinds
        }
        away = {metric: (bench.printed - eta)[:, k] for k, metric in enumerate(ETAS)}
        known = {metric: gap[~np.isnan(gap)] for metric, gap in away.items()}
        return Values(
            fields=fields,
            reported={name: {one.effect.parameter: one.reported} for name, one in made.items()},
            left={metric: float(np.sqrt(np.mean(gap**2))) for metric, gap in known.items() if gap.size},
            excess=float(np.sum(bench.excess_by_metric(eta))),
            misfit=float(np.nansum(bench.misfit(eta) ** 2)),
            plausible=bool(np.all((x >= low - 1e-9) & (x <= high + 1e-9))),
            at_bound=tuple(gone),
        )

    def _absent_of(self, name: str, field: str) -> float:
        return float(self.absent[self.places.index((name, field))])

    def _bounds(self, wide: bool) -> tuple[Signal, Signal]:
        low, high = self.examined
        if wide:
            return low, high
        return np.maximum(low, self.plausible[0]), np.minimum(high, self.plausible[1])

    def _eta(self, x: Signal) -> Signal:
        """Efficiencies on the curves, (rows, 3)."""
        ratio = sum(curve.at(x[k : k + 1])[0] for k, curve in enumerate(self.curves) if curve is not None)
        eta: Signal = self.bench.nominal * np.exp(ratio)
        return eta

    def _residual(self, eta: Signal, metric: int | None, hinge: bool) -> Signal:
        """What a search makes small, (..., n) from (..., rows, 3), nothing where the table prints nothing."""
        z = self.bench.misfit(eta)
        parts = [SOFT * z, self.bench.excess(eta) / self.bench.sigma] if hinge else [z]
        return _flat(parts, metric)

    def _slopes(self, x: Signal, metric: int | None, hinge: bool) -> Signal:
        """Its derivatives on the curves, (n, k)."""
        eta, sigma = self._eta(x), self.bench.sigma
        way = [
            np.zeros_like(eta) if curve is None else eta * curve.slope(value) / sigma
            for curve, value in zip(self.curves, x.tolist(), strict=True)
        ]
        step = np.array(way)
        parts = [-SOFT * step, self.bench.side(eta) * step] if hinge else [-step]
        return _flat(parts, metric).T


def _flat(parts: Sequence[Signal], metric: int | None) -> Signal:
    """Residuals in a row, of one efficiency or of all, (..., n)."""
    chosen = [part if metric is None else part[..., metric : metric + 1] for part in parts]
    flat: Signal = np.concatenate([part.reshape(*part.shape[:-2], -1) for part in chosen], axis=-1)
    return np.where(np.isnan(flat), 0.0, flat)


def _descend(
    residual: Callable[[Signal], Signal],
    start: Signal,
    low: Signal,
    high: Signal,
    steps: int,
    *,
    slopes: Callable[[Signal], Signal] | None = None,
) -> Signal:
    """Least squares within bounds, in shares of their width; derivatives by differences unless given."""
    from scipy.optimize import least_squares

    scale = np.maximum(high - low, 1e-12)

    def of_share(share: Signal) -> Signal:
        return residual(low + scale * share)

    def slopes_of_share(share: Signal) -> Signal:
        assert slopes is not None
        return slopes(low + scale * share) * scale

    found = least_squares(
        of_share,
        (np.clip(start, low, high) - low) / scale,
        jac="2-point" if slopes is None else slopes_of_share,
        bounds=(0.0, 1.0),
        method="dogbox",
        diff_step=[STEP] * low.size,
        max_nfev=steps,
    )
    x: Signal = low + scale * found.x
    return x
