"""A table's rows on the bench: what a bent model gives in all of them, and how far that is from what is printed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.diagnosis.suspects import Freedom, freedom, with_values
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.plausible_payouts import PayoutMetrics, measure, meet

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.rig.effects.effect import ActiveEffect, Effect
    from winchcascade.rig.parts import Model
    from winchcascade.tables.attainable_row import RowReach
    from winchcascade.tables.plausible_payouts import Reduce


ETAS = tuple(RATIOS)
"""Efficiencies in the order of the columns of every array here."""

DUST = 2e-4
"""What may be left out of reach in all rows together: simulations of a table are no better. [1]"""


class Bench:
    """The rows of a table, ready to be simulated with one bent model after the other.

    All arrays are (rows, 3), columns as `ETAS`, NaN where the row has no such efficiency: `printed`; `allowed` by rounding and
    repeatability; `below` and `above`, how far the ends of the reach lie from the middle payout; `sigma`, the standard
    uncertainty of printed minus nominal. [1]
    """

    def __init__(self, rows: Sequence[RowReach], model: Model, reduce: Reduce) -> None:
        self.rows, self.model, self.reduce = rows, model, reduce
        self.printed, self.allowed, self.nominal, low, high, u = (
            np.array([[_of(row, metric, name) for metric in ETAS] for row in rows])
            for name in ("printed", "allowed", "nominal", "low", "high", "u")
        )
        self.below, self.above = self.nominal - low, high - self.nominal
        self.sigma = np.sqrt((0.5 * self.allowed) ** 2 + u**2 + (0.5 * (high - low) - u) ** 2 / 3.0)
        self.speeds = np.array([row.speed for row in rows])

    def efficiencies(self, model: Model, speeds: Signal) -> tuple[Signal, Signal] | None:
        """What a model gives along each row's middle payout at its printed power, (rows, 3), and the speeds [m/s].

        None where it cannot give a printed power at all.

        Parameters
        ----------
        speeds : guesses, (rows,) [m/s]
        """
        points = all_at_once(
            [partial(self._point, model, row, guess) for row, guess in zip(self.rows, speeds.tolist(), strict=True)]
        )
        found = [point for point in points if point is not None]
        if len(found) < len(points):
            return None
        eta = [[_or_nan(point.metrics[metric]) for metric in ETAS] for point in found]
        return np.where(np.isnan(self.printed), np.nan, np.array(eta)), np.array([point.speed for point in found])

    def _point(self, model: Model, row: RowReach, guess: float) -> PayoutMetrics | None:
        if row.target is not None:
            return meet(self.reduce, model, row.payout, row.load, row.target, guess)
        metrics = measure(self.reduce, model, row.payout, guess, row.load)
        return None if metrics is None else PayoutMetrics(guess, metrics)

    def excess(self, eta: Signal) -> Signal:
        """How far printed values lie out of reach about such efficiencies, beyond what is allowed, (..., rows, 3)."""
        gap = np.maximum(self.printed - eta - self.above, 0.0) + np.maximum(eta - self.below - self.printed, 0.0)
        over: Signal = np.maximum(gap - self.allowed, 0.0)
        return over

    def side(self, eta: Signal) -> Signal:
        """Which way the excess grows with the efficiencies: 1 where these are too high, -1 too low, 0 within reach."""
        low = self.printed - eta - self.above > self.allowed
        high = eta - self.below - self.printed > self.allowed
        return np.where(high, 1.0, np.where(low, -1.0, 0.0))

    def excess_by_metric(self, eta: Signal) -> Signal:
        """The same, summed over the rows, (3,)."""
        total: Signal = np.nansum(self.excess(eta), axis=0)
        return np.where(total < DUST, 0.0, total)

    def misfit(self, eta: Signal) -> Signal:
        """Printed minus simulated, in standard uncertainties, (..., rows, 3)."""
        z: Signal = (self.printed - eta) / self.sigma
        return z


def _of(row: RowReach, metric: str, name: str) -> float:
    return next((float(getattr(cell, name)) for cell in row.cells if cell.metric == metric), np.nan)


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


BEYOND = 4.0
"""Values are looked at up to this many times the plausible ones, where that is possible at all. [1]"""

NODES = (1.0, 0.5, 2.0, BEYOND)
"""Where a field is simulated, as shares of the way from absent to the end of what is plausible; the end itself first. [1]"""

FEW_NODES = (1.0, 2.0)
"""The same for each field of a suspect that has several: they are simulated together where it matters."""

SILENT = 2e-4
"""An effect that moves no efficiency by more than this at the end of what is plausible says nothing here. [1]"""

HELPS = 0.9
"""An effect is looked at beyond what is plausible if it leaves less than this share of what is out of reach, but some. [1]"""

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


def field_curves(bench: Bench, kind: Effect) -> list[EffectCurve | None]:
    """The curve of each field of a suspect, None for a field that alone moves nothing."""
    free = freedom(kind)
    return [_curve(bench, kind, free, k) for k in range(len(free.names))]


def reach_of(kind: Effect) -> tuple[Signal, Signal]:
    """Lowest and highest values that are looked at, (k,) each: `BEYOND` what is plausible, within what is possible."""
    free = freedom(kind)
    least, most = (np.array([field.possible[end] for field in kind.fields]) for end in (0, 1))
    return (
        np.maximum(least, free.absent + BEYOND * (free.low - free.absent)),
        np.minimum(most, free.absent + BEYOND * (free.high - free.absent)),
    )


def _curve(bench: Bench, kind: Effect, free: Freedom, k: int) -> EffectCurve | None:
    nodes = {float(free.absent[k]): np.zeros(bench.printed.shape)}
    for end in (free.low[k], free.high[k]):
        if end != free.absent[k]:
            nodes |= _side(bench, kind, free, k, float(end))
    if len(nodes) == 1 or max(float(np.nanmax(np.abs(ratio))) for ratio in nodes.values()) < SILENT:
        return None
    from scipy.interpolate import PchipInterpolator

    at = np.array(sorted(nodes))
    x = np.linspace(at[0], at[-1], GRID + 1)
    ratio = PchipInterpolator(at, np.array([nodes[value] for value in at.tolist()]))(x)
    return EffectCurve(x, ratio, float(free.absent[k]))


def _side(bench: Bench, kind: Effect, free: Freedom, k: int, end: float) -> dict[float, Signal]:
    """Simulated nodes from absent to one end of what is plausible, and beyond it as long as that still may help."""
    found: dict[float, Signal] = {}
    helps, speeds = True, bench.speeds
    low, high = reach_of(kind)
    before = bench.excess_by_metric(bench.nominal)
    for share in NODES if len(free.names) == 1 else FEW_NODES:
        values = free.absent.copy()
        values[k] = min(max(values[k] + share * (end - values[k]), low[k]), high[k])
        if float(values[k]) in found:
            continue
        there = bent(bench, [with_values(kind, values)], bench.speeds + share * (speeds - bench.speeds))
        if there is None:
            continue
        eta, at = there
        ratio = np.where(np.isnan(bench.printed), 0.0, np.log(eta / bench.nominal))
        found[float(values[k])] = ratio
        if share == 1.0:
            speeds = at
            if float(np.max(np.abs(ratio))) < SILENT:
                break
        if share >= 1.0:
            after = bench.excess_by_metric(eta)
            helps = bool(np.any((after < HELPS * before) & (after > 0.0)))
        if share != 1.0 and not helps:
            break
    return found


def bent(bench: Bench, effects: Sequence[ActiveEffect], speeds: Signal) -> tuple[Signal, Signal] | None:
    """Efficiencies with some effects, (rows, 3), and the speeds of the line; None where no model comes of them.

    Parameters
    ----------
    speeds : guesses, (rows,) [m/s]
    """
    model = bench.model
    for effect in effects:
        model = effect.apply(model)
    found = bench.efficiencies(model, speeds)
    return None if found is None or np.any(np.isnan(found[0]) & ~np.isnan(bench.printed)) else found
