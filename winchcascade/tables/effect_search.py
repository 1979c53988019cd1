"""Values of some suspects that bring the efficiencies of a table to what is printed: searched on curves, then simulated.

A curve shows how each efficiency follows one field of a suspect: it is simulated at a few values and interpolated between.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.run import Signal
from winchcascade.diagnosis.suspects import Freedom, Suspects, freedom, with_values
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.rig.parts import Model
from winchcascade.tables.attainable_row import AttainableRow, PayoutMetrics, Reduce, measure, meet

ETAS = tuple(RATIOS)
"""Efficiencies in the order of the columns of every array here."""

DUST = 2e-4
"""What may be left outside the attainable range in all rows together: simulations of a table are no better. [1]"""


class TableSimulator:
    """Simulate the rows of a table with one changed model after the other.

    All arrays are (rows, 3), columns as `ETAS`, NaN where the row has no such efficiency: `printed`; `allowed` by rounding and
    repeatability; `below` and `above`, how far the ends of the attainable range lie from the middle payout; `sigma`, the
    standard uncertainty of printed minus nominal. [1]
    """

    def __init__(self, rows: Sequence[AttainableRow], model: Model, reduce: Reduce) -> None:
        self.rows, self.model, self.reduce = rows, model, reduce
        cells = [{cell.metric: cell for cell in row.cells} for row in rows]
        self.printed, self.allowed, self.nominal, low, high, u = (
            np.array(
                [[getattr(of[eta], name) if eta in of else np.nan for eta in ETAS] for of in cells], dtype=np.float64
            )
            for name in ("printed", "allowed", "nominal", "low", "high", "u")
        )
        self.below, self.above = self.nominal - low, high - self.nominal
        self.sigma: Signal = np.sqrt((0.5 * self.allowed) ** 2 + u**2 + (0.5 * (high - low) - u) ** 2 / 3.0)
        self.speeds = np.array([row.speed for row in rows])

    def efficiencies(self, effects: Sequence[ActiveEffect], speeds: Signal) -> tuple[Signal, Signal] | None:
        """Efficiencies with some effects along each row's middle payout at its printed power, (rows, 3), and the speeds [m/s].

        None where the model cannot give a printed power or an efficiency.

        Parameters
        ----------
        speeds : guesses, (rows,) [m/s]
        """
        model = self.model
        for effect in effects:
            model = effect.apply(model)
        points = all_at_once(
            [partial(self._point, model, row, guess) for row, guess in zip(self.rows, speeds.tolist(), strict=True)]
        )
        found = [point for point in points if point is not None]
        if len(found) < len(points):
            return None
        eta = np.array([[point.metrics[metric] for metric in ETAS] for point in found], dtype=np.float64)  # None is NaN
        if np.any(np.isnan(eta) & ~np.isnan(self.printed)):
            return None
        return np.where(np.isnan(self.printed), np.nan, eta), np.array([point.speed for point in found])

    def _point(self, model: Model, row: AttainableRow, guess: float) -> PayoutMetrics | None:
        if row.target is None:
            return measure(self.reduce, model, row.payout, guess, row.load)
        return meet(self.reduce, model, row.payout, row.load, row.target, guess)

    def deviation(self, eta: Signal) -> Signal:
        """How far such efficiencies are too high (positive) or too low for what is printed and allowed, (..., rows, 3).

        0 where the printed value is within the attainable range.
        """
        high, low = eta - self.below - self.printed, self.printed - eta - self.above
        return np.where(high > self.allowed, high - self.allowed, np.minimum(self.allowed - low, 0.0))

    def excess(self, eta: Signal) -> Signal:
        """Excess of printed values over the attainable range about such efficiencies and what is allowed, (..., rows, 3)."""
        excess: Signal = np.abs(self.deviation(eta))
        return excess

    def excess_by_metric(self, eta: Signal) -> Signal:
        """The same, summed over the rows, (3,)."""
        total = np.nansum(self.excess(eta), axis=0)
        return np.where(total < DUST, 0.0, total)

    def sums(self, eta: Signal) -> tuple[float, float]:
        """Sum of the excess [1], and sum of squares of printed minus simulated values in standard uncertainties."""
        return float(np.sum(self.excess_by_metric(eta))), float(np.nansum(self.misfit(eta) ** 2))

    def misfit(self, eta: Signal) -> Signal:
        """Printed minus simulated, in standard uncertainties, (..., rows, 3)."""
        return (self.printed - eta) / self.sigma


BEYOND = 4.0
"""Values are looked at up to this many times the plausible ones, where that is possible at all. [1]"""

NODES = (1.0, 0.5, 2.0, BEYOND)
"""Where a field is simulated, as shares of the way from absent to the end of what is plausible; the end itself first. [1]"""

FEW_NODES = (1.0, 2.0)
"""The same for each field of a suspect that has several: they are simulated together where it matters."""

SILENT = 2e-4
"""An effect that moves no efficiency by more than this at the end of what is plausible has no curve here. [1]"""

HELPS = 0.9
"""An effect is searched beyond its plausible values if it leaves less than this share of the excess, but not nothing. [1]"""

GRID = 400
"""Intervals that a curve is laid out on."""


class EffectCurve(msgspec.Struct, frozen=True):
    """Efficiencies over one field, the others absent.

    `x` (n,) are even values, `ratio` (n, rows, 3) the logarithms of the efficiencies over those without the effect, `absent` is
    the value without it.
    """

    x: Signal
    ratio: Signal
    absent: float

    def at(self, values: Signal) -> Signal:
        """Logarithmic ratio at some values of the field, (n, rows, 3)."""
        place = np.clip((values - self.x[0]) / (self.x[1] - self.x[0]), 0.0, self.x.size - 1.0)
        before = np.minimum(place.astype(np.intp), self.x.size - 2)
        share = (place - before)[:, None, None]
        ratio: Signal = (1.0 - share) * self.ratio[before] + share * self.ratio[before + 1]
        return ratio

    def slope(self, value: float) -> Signal:
        """How the logarithmic ratio rises with the field at a value, (rows, 3)."""
        width = self.x[1] - self.x[0]
        before = min(max(int((value - self.x[0]) / width), 0), self.x.size - 2)
        rise: Signal = (self.ratio[before + 1] - self.ratio[before]) / width
        return rise


def field_curves(simulator: TableSimulator, kind: Effect) -> list[EffectCurve | None]:
    """The curve of each field of a suspect, None for a field that alone moves nothing."""
    free = freedom(kind)
    return [_curve(simulator, kind, free, k) for k in range(len(free.names))]


def search_bounds(kind: Effect) -> tuple[Signal, Signal]:
    """Lowest and highest values that are looked at, (k,) each: `BEYOND` what is plausible, within what is possible."""
    free = freedom(kind)
    minimum, maximum = (np.array([field.possible[end] for field in kind.fields]) for end in (0, 1))
    return (
        np.maximum(minimum, free.absent + BEYOND * (free.low - free.absent)),
        np.minimum(maximum, free.absent + BEYOND * (free.high - free.absent)),
    )


def _curve(simulator: TableSimulator, kind: Effect, free: Freedom, k: int) -> EffectCurve | None:
    from scipy.interpolate import PchipInterpolator

    nodes = {float(free.absent[k]): np.zeros(simulator.printed.shape)}
    for end in (free.low[k], free.high[k]):
        if end != free.absent[k]:
            nodes |= _side(simulator, kind, free, k, float(end))
    if len(nodes) == 1 or max(float(np.nanmax(np.abs(ratio))) for ratio in nodes.values()) < SILENT:
        return None
    at = np.array(sorted(nodes))
    x = np.linspace(at[0], at[-1], GRID + 1)
    ratio = PchipInterpolator(at, np.array([nodes[value] for value in at.tolist()]))(x)
    return EffectCurve(x, ratio, float(free.absent[k]))


def _side(simulator: TableSimulator, kind: Effect, free: Freedom, k: int, end: float) -> dict[float, Signal]:
    """Simulated nodes from absent to one end of what is plausible, and beyond it as long as that still may help."""
    found: dict[float, Signal] = {}
    helps, speeds = True, simulator.speeds
    low, high = search_bounds(kind)
    for share in NODES if len(free.names) == 1 else FEW_NODES:
        values = free.absent.copy()
        values[k] = min(max(values[k] + share * (end - values[k]), low[k]), high[k])
        if float(values[k]) in found:
            continue
        there = simulator.efficiencies(
            [with_values(kind, values)], simulator.speeds + share * (speeds - simulator.speeds)
        )
        if there is None:
            continue
        ratio = np.where(np.isnan(simulator.printed), 0.0, np.log(there[0] / simulator.nominal))
        found[float(values[k])] = ratio
        if share == 1.0:
            speeds = there[1]
            if float(np.max(np.abs(ratio))) < SILENT:
                break
        if share >= 1.0:
            before, after = simulator.excess_by_metric(simulator.nominal), simulator.excess_by_metric(there[0])
            helps = bool(np.any((after < HELPS * before) & (after > 0.0)))
        if share != 1.0 and not helps:
            break
    return found


Curves = Mapping[str, Sequence[EffectCurve | None]]

SOFT = 1e-3
"""Weight of the distance from the printed values in a search for what brings all rows within the attainable range. [1]"""

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

    `fields` and `reported` by effect. `left_rms` is the rms of printed minus simulated by metric, `out_of_reach` the sum of
    what no value attains [1], `misfit` the sum of squares of printed minus simulated in standard uncertainties. `plausible`
    states whether all fields lie within their bounds, `at_bound` names those that stop at the end of what was looked at.
    """

    fields: Mapping[str, Mapping[str, float]]
    reported: Mapping[str, Mapping[str, float]]
    left_rms: Mapping[str, float]
    out_of_reach: float
    misfit: float
    plausible: bool
    at_bound: tuple[str, ...]

    @property
    def enough(self) -> bool:
        """Whether all printed values are within their attainable range then."""
        return self.out_of_reach <= 0.0


class Search:
    """Some suspects before a table.

    On curves, the logarithms of the efficiencies' changes add up: exact for one field, near enough to start from for more.
    """

    def __init__(self, simulator: TableSimulator, kinds: Suspects, curves: Curves) -> None:
        self.simulator, self.kinds = simulator, kinds
        free = [freedom(kind) for kind in kinds.values()]
        self.places = [(name, field) for name, own in zip(kinds, free, strict=True) for field in own.names]
        self.absent = np.concatenate([own.absent for own in free])
        self.plausible = tuple(np.concatenate([getattr(own, end) for own in free]) for end in ("low", "high"))
        self.curves = [curve for name in kinds for curve in curves[name]]
        ends = zip(*(search_bounds(kind) for kind in kinds.values()), strict=True)
        low, high = (np.concatenate(end) for end in ends)
        for k, curve in enumerate(self.curves):
            if curve is not None:
                low[k], high[k] = max(low[k], curve.x[0]), min(high[k], curve.x[-1])
        self.examined = (low, high)
        self.speeds = simulator.speeds

    @property
    def single(self) -> EffectCurve | None:
        """The one curve of a suspect of one field, which is exact; None for more."""
        return self.curves[0] if len(self.curves) == 1 else None

    def fit(self, *, metric: int | None = None, hinge: bool = False, wide: bool = False) -> Signal:
        """Best values of all fields, (k,), on the curves.

        Parameters
        ----------
        metric : one efficiency alone, by its place in `ETAS`; all by default
        hinge : of what is outside the attainable range; by default of printed minus simulated
        wide : beyond what is plausible too
        """
        low, high = self._bounds(wide)
        if self.single is not None:
            x = self.single.x[(self.single.x >= low[0] - 1e-12) & (self.single.x <= high[0] + 1e-12)]
            x = np.concatenate((x, low, high, self.absent))
            residual = self._residual(self.simulator.nominal * np.exp(self.single.at(x)), metric, hinge)
            return x[[int(np.argmin(np.sum(residual**2, axis=-1)))]]
        return _descend(
            lambda x: self._residual(self.on_curves(x), metric, hinge), self.absent, (low, high), TRIALS,
            slopes=lambda x: self._slopes(x, metric, hinge),
        )  # fmt: skip

    def best_excess(self, metric: int, *, wide: bool = False) -> float:
        """What the best values leave outside the attainable range of one efficiency, in all rows. [1]

        Of several fields the best on the curves and all of them at either end are simulated.
        """
        best = self.fit(metric=metric, hinge=True, wide=wide)
        if self.single is not None:
            return float(self.simulator.excess_by_metric(self.on_curves(best))[metric])
        found = [self.simulated(x) for x in (best, *self._bounds(wide))]
        return min(
            (float(self.simulator.excess_by_metric(eta)[metric]) for eta in found if eta is not None), default=np.inf
        )

    def first_look(self) -> float:
        """What a few plausible values leave outside the attainable range at best, on the curves: a first look at many sets. [1]

        The fields of one suspect go together from absent to an end of what is plausible, suspects go independently.
        """
        ratio = np.zeros((1, *self.simulator.printed.shape))
        for name in self.kinds:
            few = np.zeros((2, FEW, *self.simulator.printed.shape))
            for k, curve in enumerate(self.curves):
                if curve is not None and self.places[k][0] == name:
                    few += [curve.at(np.linspace(self.absent[k], end[k], FEW)) for end in self._bounds(wide=False)]
            ratio = (ratio[:, None] + few.reshape(1, -1, *few.shape[2:])).reshape(-1, *few.shape[2:])
        return float(np.nansum(self.simulator.excess(self.simulator.nominal * np.exp(ratio)), axis=(1, 2)).min())

    def effects(self, x: Signal) -> list[ActiveEffect]:
        """The suspects with values, (k,) in the order of their fields."""
        ends = np.cumsum([len(kind.fields) for kind in self.kinds.values()])[:-1]
        return [with_values(kind, part) for kind, part in zip(self.kinds.values(), np.split(x, ends), strict=True)]

    def simulated(self, x: Signal) -> Signal | None:
        """Efficiencies at values of the fields, simulated, (rows, 3)."""
        found = self.simulator.efficiencies(self.effects(x), self.speeds)
        if found is None:
            return None
        eta, self.speeds = found
        return eta

    def polished(self, x: Signal, *, hinge: bool = False, wide: bool = False) -> Signal:
        """Better values from those found on the curves, by simulations."""

        def residual(values: Signal) -> Signal:
            eta = self.simulated(values)
            return self._residual(self.simulator.nominal if eta is None else eta, None, hinge)

        if self.single is not None:
            return x
        return _descend(residual, x, self._bounds(wide), max(2, min(POLISH, FIELDS // x.size)))

    def simulated_values(self, x: Signal) -> Values | None:
        """What values of the fields leave, simulated; None where no model results from them."""
        eta = self.simulated(x)
        if eta is None:
            return None
        (low, high), (minimum, maximum) = self.plausible, self.examined
        near = np.minimum(x - minimum, maximum - x) < AT_BOUND * (maximum - minimum)
        made = dict(zip(self.kinds, self.effects(x), strict=True))
        away = [gap[~np.isnan(gap)] for gap in (self.simulator.printed - eta).T]
        excess, misfit = self.simulator.sums(eta)
        return Values(
            fields={
                name: {field.name: value for field, value in zip(one.effect.fields, one.values, strict=True)}
                for name, one in made.items()
            },
            reported={name: {one.effect.parameter: one.reported} for name, one in made.items()},
            left_rms={eta: float(np.sqrt(np.mean(gap**2))) for eta, gap in zip(ETAS, away, strict=True) if gap.size},
            out_of_reach=excess,
            misfit=misfit,
            plausible=bool(np.all((x >= low - 1e-9) & (x <= high + 1e-9))),
            at_bound=tuple(".".join(self.places[k]) for k in np.flatnonzero(near & (x != self.absent))),
        )

    def _bounds(self, wide: bool) -> tuple[Signal, Signal]:
        low, high = self.examined
        if wide:
            return low, high
        return np.maximum(low, self.plausible[0]), np.minimum(high, self.plausible[1])

    def on_curves(self, x: Signal) -> Signal:
        """Efficiencies on the curves, (rows, 3)."""
        ratio = sum(curve.at(x[k : k + 1])[0] for k, curve in enumerate(self.curves) if curve is not None)
        eta: Signal = self.simulator.nominal * np.exp(ratio)
        return eta

    def _residual(self, eta: Signal, metric: int | None, hinge: bool) -> Signal:
        """What a search minimizes, (..., n) from (..., rows, 3), nothing where the table prints nothing."""
        z = self.simulator.misfit(eta)
        return _flat([SOFT * z, self.simulator.excess(eta) / self.simulator.sigma] if hinge else [z], metric)

    def _slopes(self, x: Signal, metric: int | None, hinge: bool) -> Signal:
        """Its derivatives on the curves, (n, k)."""
        eta = self.on_curves(x)
        slopes = [curve.slope(x[k]) if curve is not None else np.zeros_like(eta) for k, curve in enumerate(self.curves)]
        step = np.array(slopes) * eta / self.simulator.sigma
        return _flat([-SOFT * step, np.sign(self.simulator.deviation(eta)) * step] if hinge else [-step], metric).T


def _flat(parts: Sequence[Signal], metric: int | None) -> Signal:
    """Residuals in a row, of one efficiency or of all, (..., n)."""
    chosen = [part if metric is None else part[..., metric : metric + 1] for part in parts]
    flat = np.concatenate([part.reshape(*part.shape[:-2], -1) for part in chosen], axis=-1)
    return np.where(np.isnan(flat), 0.0, flat)


def _descend(
    residual: Callable[[Signal], Signal],
    start: Signal,
    bounds: tuple[Signal, Signal],
    steps: int,
    *,
    slopes: Callable[[Signal], Signal] | None = None,
) -> Signal:
    """Least squares within bounds, in shares of their width; derivatives by differences unless given."""
    from scipy.optimize import least_squares

    low, high = bounds
    scale = np.maximum(high - low, 1e-12)

    def of_share(share: Signal) -> Signal:
        return residual(low + scale * share)

    def slopes_of_share(share: Signal) -> Signal:
        return slopes(low + scale * share) * scale if slopes else scale

    found = least_squares(
        of_share,
        (np.clip(start, low, high) - low) / scale,
        jac="2-point" if slopes is None else slopes_of_share,
        bounds=(0.0, 1.0),
        method="dogbox",
        diff_step=[STEP] * low.size,
        max_nfev=steps,
    )
    return low + scale * found.x
