"""The rows of a published table as a problem of least squares in the fields of its suspects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.jobs import all_at_once
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Signal
from winchcascade.diagnosis.fit.marginal import Columns, Together
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.effect import ActiveEffect, Effect
from winchcascade.tables.payouts import AttainableRow, meet

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

ETAS = tuple(RATIOS)
"""Efficiencies in the order of the columns of every array here."""

LOST = -1.0
"""In place of the efficiencies of a model that cannot give a printed power: far from any that is
printed. [1]
"""

DUST = 2e-4
"""What may be left outside the attainable range in all rows together: simulations of a table are
no better. [1]
"""

NODES = (0.5, 1.0, 2.0, 4.0)
"""Where a field is simulated, as shares of the way from absent to the end of what is plausible,
within what is possible; one of several fields of an effect at the middle two alone. [1]"""

SILENT = 2e-4
"""An effect that moves no efficiency by more than this at the end of what is plausible does
nothing here. [1]
"""

SOFT = 1e-3
"""Weight of the distance from the printed values in a search for what brings all rows within the
attainable range. [1]
"""


class TableProblem:
    """Efficiencies of the rows of a table with suspects in the model.

    Arrays are (rows, 3), columns as `ETAS`, NaN where the row has no such efficiency: `printed`;
    `allowed` by rounding and repeatability; `below` and `above`, how far the ends of the attainable
    range lie from the middle payout; `sigma`, the standard uncertainty of printed minus nominal.
    [1] A value of a suspect is an array of its fields, (k,); values of several follow each other in
    the order of their names.
    """

    def __init__(
        self, rows: Sequence[AttainableRow], rig: Rig, suspects: Mapping[str, Effect]
    ) -> None:
        self.rows, self.rig, self.suspects = rows, rig, suspects
        cells = [{cell.metric: cell for cell in row.cells} for row in rows]
        self.printed, self.allowed, self.nominal, low, high, u = (
            np.array(
                [[getattr(of[eta], name) if eta in of else np.nan for eta in ETAS] for of in cells],
                dtype=np.float64,
            )
            for name in ("printed", "allowed", "nominal", "low", "high", "u")
        )
        self.below, self.above = self.nominal - low, high - self.nominal
        self.sigma: Signal = np.sqrt(
            (0.5 * self.allowed) ** 2 + u**2 + (0.5 * (high - low) - u) ** 2 / 3.0
        )
        self.speeds = [row.speed for row in rows]
        self.groups = np.repeat(np.arange(len(rows)), len(ETAS))
        self.begins: Mapping[str, Sequence[float]] = {}
        self.exclusive: Sequence[Together] = ()
        self.curves: dict[str, list[PchipInterpolator | None]] = {}

    def active(self, names: Sequence[str], x: Signal) -> list[ActiveEffect]:
        """Suspects with values."""
        ends = np.cumsum([len(self.suspects[name].fields) for name in names])[:-1]
        return [
            ActiveEffect(self.suspects[name], tuple(part.tolist()))
            for name, part in zip(names, np.split(x, ends), strict=True)
        ]

    def efficiencies(self, effects: Sequence[ActiveEffect]) -> Signal:
        """Efficiencies along each row's middle payout at its printed power, simulated; `LOST`
        where the model has none.
        """
        model = baseline(self.rig)
        for effect in effects:
            model = effect.apply(model)
        jobs = [
            partial(meet, self.rig, model, row.payout, row.load, row.target, guess)
            for row, guess in zip(self.rows, self.speeds, strict=True)
        ]
        points = all_at_once(jobs)
        eta = np.array(
            [[p.metrics[m] if p else None for m in ETAS] for p in points], dtype=np.float64
        )  # None is NaN
        lost = np.any(np.isnan(eta) & ~np.isnan(self.printed))
        return np.where(np.isnan(self.printed), np.nan, LOST if lost else eta)

    def on_curves(self, names: Sequence[str], x: Signal) -> Signal:
        """The same without a simulation: on the curves of the fields, whose logarithms add up."""
        curves = [curve for name in names for curve in self.curves[name]]
        ratio = sum(
            curve(value)
            for curve, value in zip(curves, x.tolist(), strict=True)
            if curve is not None
        )
        return self.nominal * np.exp(ratio)

    def excess(self, eta: Signal) -> Signal:
        """Excess of printed values over the attainable range about such efficiencies and what is
        allowed, (..., rows, 3).
        """
        over = np.maximum(eta - self.below - self.printed, self.printed - eta - self.above)
        return np.maximum(over - self.allowed, 0.0)

    def by_metric(self, eta: Signal) -> Signal:
        """The same, summed over the rows, (..., 3)."""
        total = np.nansum(self.excess(eta), axis=-2)
        return np.where(total < DUST, 0.0, total)

    @property
    def nuisances(self) -> int:
        """None."""
        return 0

    def residuals(
        self,
        several: Sequence[Sequence[ActiveEffect]],
        _nu: Signal,
        _near: Sequence[ActiveEffect] | None = None,
        _serves: float = 0.0,
    ) -> Signal:
        """Printed minus simulated efficiencies in standard uncertainties with each of several
        lists of effects, (n, k).
        """
        return np.stack([self.misfit(self.efficiencies(effects)) for effects in several], axis=1)

    def price(self, name: str) -> float:  # noqa: ARG002
        """No suspect is less probable than another."""
        return 0.0

    def nuisance_columns(self, _effects: Sequence[ActiveEffect], _nu: Signal) -> Columns:
        """No nuisance: the standard uncertainties hold the tolerances of the rig."""
        from scipy.sparse import csr_array

        return Columns(np.zeros((self.printed.size, 0)), csr_array((self.printed.size, 0)))

    def misfit(self, eta: Signal) -> Signal:
        """Printed minus such efficiencies in standard uncertainties, (n,)."""
        z = ((self.printed - eta) / self.sigma).ravel()
        return np.where(np.isnan(z), 0.0, z)

    def out_of_range(self, eta: Signal, metric: int | None = None) -> Signal:
        """What a search for values within the attainable range minimizes, (2 n,): excess, and
        softly the misfit.

        Parameters
        ----------
        metric : one efficiency alone, by its place in `ETAS`
        """
        weight = np.ones(len(ETAS)) if metric is None else np.eye(len(ETAS))[metric]
        excess = np.nan_to_num(self.excess(eta) / self.sigma * weight).ravel()
        soft = (SOFT * self.misfit(eta).reshape(-1, len(ETAS)) * weight).ravel()
        return np.concatenate([excess, soft])

    def bounds(self, names: Sequence[str], *, wide: bool) -> tuple[Signal, Signal]:
        """Lowest and highest values of fields: the plausible ones, or the ends of the curves."""
        pairs = (
            pair
            for name in names
            for pair in zip(self.suspects[name].fields, self.curves[name], strict=True)
        )
        ends = [
            (c.x[0], c.x[-1]) if wide and c is not None else (field.low, field.high)
            for field, c in pairs
        ]
        low, high = np.array(ends, dtype=np.float64).reshape(-1, 2).T
        return low, high


def make_curves(problem: TableProblem, name: str) -> None:
    """Lay a monotone cubic through the logarithms of the efficiencies over each field of a
    suspect; none if it does nothing.
    """
    from scipy.interpolate import PchipInterpolator

    effect = problem.suspects[name]
    absent = np.array([field.absent for field in effect.fields])
    curves: list[PchipInterpolator | None] = []
    for k, field in enumerate(effect.fields):
        nodes = {field.absent: np.zeros(problem.printed.shape)}
        for end, share in product(
            {field.low, field.high} - {field.absent}, NODES if absent.size == 1 else NODES[1:3]
        ):
            value = float(np.clip(field.absent + share * (end - field.absent), *field.possible))
            if value not in nodes:
                eta = problem.efficiencies(
                    problem.active([name], np.where(np.arange(absent.size) == k, value, absent))
                )
                if np.all(eta != LOST):
                    nodes[value] = np.nan_to_num(np.log(eta / problem.nominal))
        moved = max(float(np.abs(ratio).max()) for ratio in nodes.values())
        at = sorted(nodes)
        curves.append(
            PchipInterpolator(at, np.array([nodes[x] for x in at])) if moved > SILENT else None
        )
    problem.curves[name] = curves
