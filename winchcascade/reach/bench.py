"""A table's rows on the bench: what a bent model gives in all of them, and how far that is from what is printed."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.cascade.efficiency import RATIOS
from winchcascade.reach.payouts import Point, measure, meet
from winchcascade.threads import all_at_once

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.reach.payouts import Reduce
    from winchcascade.reach.rows import RowReach
    from winchcascade.rig.model import Model
    from winchcascade.run import Signal

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

    def _point(self, model: Model, row: RowReach, guess: float) -> Point | None:
        if row.target is not None:
            return meet(self.reduce, model, row.payout, row.load, row.target, guess)
        metrics = measure(self.reduce, model, row.payout, guess, row.load)
        return None if metrics is None else Point(guess, metrics)

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
