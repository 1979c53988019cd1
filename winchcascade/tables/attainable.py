"""Compare a published table with the attainable ranges of a rig, and search the effects that could
explain a difference.

The rows of the table are simulated with effects in the model. Over one field, a monotone cubic
through a few simulations gives the efficiencies; over several fields of one effect their logarithms
add up, near enough to begin from. Sets are searched as causes are in a diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.jobs import Nobody, Watch
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Signal
from winchcascade.core.scales import MotionScale, scales_of
from winchcascade.diagnosis.fit.expansion import neighbours
from winchcascade.diagnosis.fit.search import search
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.effect import Effect, Parameter
from winchcascade.tables.payouts import (
    USUAL_WINDOW,
    AttainableRow,
    Cell,
    NotJudged,
    attainable_row,
    row_windows,
)
from winchcascade.tables.published_table import PublishedTable
from winchcascade.tables.table_problem import ETAS, TableProblem, make_curves

DIFFERENCE = 0.02
"""Share of a field's range by which its derivative is taken. [1]"""

HOPELESS = 0.02
"""A set that leaves more outside the attainable range in all than this is not fitted by
simulations. [1]
"""

MAX_SIMULATED, MAX_SETS = 12, 8
"""Sets of the size with the most evidence that are simulated, and of these those that are named."""

Verdict = Literal["explains", "beyond_plausible", "no"]
"""Whether one value of the effect brings all rows within the attainable range: a plausible one,
an implausible one, none.
"""


class Ability(msgspec.Struct, frozen=True):
    """The effect of one suspect alone on one efficiency.

    `closed` is the share of the excess over the attainable range that its best plausible value
    removes, over all rows [1]. `needed` has, for each row, the value nearest to absent that brings
    the row within the attainable range, None where none does or where none is needed; empty for an
    effect of several fields.
    """

    metric: str
    verdict: Verdict
    closed: float
    needed: tuple[float | None, ...]


class Values(msgspec.Struct, frozen=True):
    """Effects with values, and what they leave of a table.

    `fields` and `reported` by effect. `left_rms` is the rms of printed minus simulated by metric,
    `out_of_reach` the sum of what no value attains [1], `misfit` the sum of squares of printed
    minus simulated in standard uncertainties. `plausible` states whether all fields lie within
    their bounds, `at_bound` names those that stop at the end of what was looked at.
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


class SuspectResult(msgspec.Struct, frozen=True):
    """One suspect and its fields: its effect on each efficiency that is outside the attainable
    range.

    `best` has its best values over all rows and efficiencies, plausible or not; None for a suspect
    that moves nothing here.
    """

    effect: str
    stage: str
    fields: tuple[Parameter, ...]
    abilities: tuple[Ability, ...] = ()
    best: Values | None = None

    def ability(self, metric: str) -> Ability:
        """Its effect on one efficiency."""
        return next(
            (one for one in self.abilities if one.metric == metric), Ability(metric, "no", 0.0, ())
        )


class AttainableRanges(msgspec.Struct, frozen=True):
    """Attainable ranges of a rig for the rows of a table, and effects that could explain the
    printed values.

    `not_judged` holds rows that cannot be held against the rig, `notes` say what was assumed.
    `scatter` is the maximum deviation of a cycle's efficiency that counts [1]. `sets` are the
    smallest that bring the whole table within the attainable range at plausible values, best fit
    first; where no set of that size will do, `closest` comes nearest.
    """

    rig: Rig
    scatter: float
    rows: tuple[AttainableRow, ...]
    not_judged: tuple[NotJudged, ...]
    notes: tuple[str, ...]
    suspects: tuple[SuspectResult, ...] = ()
    sets: tuple[Values, ...] = ()
    closest: Values | None = None

    @property
    def outside(self) -> tuple[tuple[AttainableRow, Cell], ...]:
        """The cells outside their attainable range."""
        return tuple((row, cell) for row in self.rows for cell in row.cells if cell.outside)

    @property
    def ok(self) -> bool:
        """Whether all cells that could be judged are within their attainable range."""
        return not self.outside


def attainable_ranges(
    table: PublishedTable,
    rig: Rig,
    suspects: Mapping[str, Effect],
    *,
    scatter: float,
    watch: Watch | None = None,
) -> AttainableRanges:
    """Hold a published table against what the constants of a rig allow, and name the effects that
    could explain a difference.

    Parameters
    ----------
    suspects : effects by name, as a catalogue lists them
    scatter : maximum deviation of a cycle's efficiency from the mean that the table prints or is
        taken to have [1]

    Raises
    ------
    RigError : the rig file lacks numbers that a model needs
    """
    baseline(rig)
    windows, notes = row_windows(table)
    watch = watch or Nobody()
    watch.begin(0, len(table.rows) + len(suspects))
    found: list[AttainableRow | NotJudged] = []
    for row, window in zip(table.rows, windows, strict=True):
        found.append(attainable_row(table, row, window, rig, scatter))
        watch.done(row.name, None)
    rows = tuple(row for row in found if isinstance(row, AttainableRow))
    not_judged = tuple(row for row in found if isinstance(row, NotJudged))
    ranges = AttainableRanges(rig, scatter, rows, not_judged, notes)
    if ranges.ok:
        return ranges
    scales = scales_of(rig, _motion_of(rows))
    own = {name: effect.at(scales) for name, effect in suspects.items()}
    return _explained(ranges, own, partial(watch.done, fault=None))


def _motion_of(rows: Sequence[AttainableRow]) -> MotionScale:
    """Scales of the motion of the payouts that the rows imply."""
    speeds, ramps = np.array([(row.speed, RISES * row.payout.ramp) for row in rows]).T
    windows = np.array([row.window or USUAL_WINDOW for row in rows])
    return MotionScale(
        float(speeds.max()), float(np.median(ramps)), float(np.median(speeds * windows))
    )


RISES = 0.7
"""Part of a ramp between a tenth and nine tenths of its speed: of 3 u^2 - 2 u^3 it is 0.61, of
an even one 0.8. [1]
"""


def fit(
    residual: Callable[[Signal], Signal], start: Signal, bounds: tuple[Signal, Signal], steps: int
) -> Signal:
    """Values within bounds that make a residual smallest, by bounded least squares from a start, in
    shares of the bounds.

    The start is moved off the bounds, where the method would stall, and differences are taken
    towards the inside.
    """
    from scipy.optimize import least_squares

    low, high = bounds
    width = np.maximum(high - low, 1e-12)

    def of_share(share: Signal) -> Signal:
        return residual(low + width * share)

    def slopes(share: Signal) -> Signal:
        by = np.where(share < 0.5, DIFFERENCE, -DIFFERENCE)
        here = of_share(share)
        return np.stack(
            [
                (of_share(share + d) - here) / b
                for d, b in zip(np.diag(by), by.tolist(), strict=True)
            ],
            axis=1,
        )

    inside = np.clip((start - low) / width, DIFFERENCE, 1.0 - DIFFERENCE)
    found = least_squares(
        of_share, inside, jac=slopes, bounds=(0.0, 1.0), method="dogbox", max_nfev=steps
    )
    return low + width * found.x


def _explained(
    ranges: AttainableRanges, suspects: Mapping[str, Effect], on_progress: Callable[[str], None]
) -> AttainableRanges:
    """Look at every suspect alone, then search the sets of those that move something by their
    evidence.

    Sets of the size of the one with the most evidence are named if they bring all rows within the
    attainable range.
    """
    problem, results = TableProblem(ranges.rows, ranges.rig, suspects), []
    for name in suspects:
        make_curves(problem, name)
        results.append(_alone(problem, name))
        on_progress(name)
    problem.suspects = {one.effect: suspects[one.effect] for one in results if one.best is not None}
    if not problem.suspects:
        return msgspec.structs.replace(ranges, suspects=tuple(results))
    found = search(problem)
    size = max(len(found.best.names), 1)
    near = [names for names in neighbours(found.expansion, found.best.names) if len(names) == size]
    values = [_improved(problem, names, found.fit(names).x) for names in near[:MAX_SIMULATED]]
    sets = tuple(
        sorted((one for one in values if one.enough), key=lambda one: one.misfit)[:MAX_SETS]
    )
    closest = None if sets else min(values, key=lambda one: one.out_of_reach)
    return msgspec.structs.replace(ranges, suspects=tuple(results), sets=sets, closest=closest)


def _improved(problem: TableProblem, names: Sequence[str], x: Signal) -> Values:
    """A set with plausible values, which simulations improve where it is near enough."""

    def residual(values: Signal) -> Signal:
        return problem.out_of_range(problem.efficiencies(problem.active(names, values)))

    bounds = problem.bounds(names, wide=False)
    values = _values(problem, names, np.clip(x, *bounds))
    if values.enough or values.out_of_reach > HOPELESS:
        return values
    return _values(problem, names, fit(residual, x, bounds, 3))


def _alone(problem: TableProblem, name: str) -> SuspectResult:
    """What one suspect can do alone."""
    effect = problem.suspects[name]
    curves, before = problem.curves[name], problem.by_metric(problem.nominal)
    if all(curve is None for curve in curves):
        return SuspectResult(name, effect.stage, effect.fields)
    outside = [k for k in range(len(ETAS)) if before[k] > 0.0]
    stages = [k for k in outside if ETAS[k] != "eta_pto"]  # the whole is their product
    start = np.array([field.absent for field in effect.fields])
    abilities = tuple(_ability(problem, name, k, float(before[k])) for k in stages or outside)
    low, high = problem.bounds([name], wide=True)
    best = fit(lambda x: problem.misfit(problem.on_curves([name], x)), start, (low, high), 30)
    return SuspectResult(
        name, effect.stage, effect.fields, abilities, _values(problem, [name], best)
    )


def _ability(problem: TableProblem, name: str, k: int, before: float) -> Ability:
    """Effect of a suspect on one efficiency, the k-th of `ETAS`; `before` is its excess over all
    rows. [1]
    """
    (curve, *more), needed = problem.curves[name], tuple[float | None, ...]()
    field = problem.suspects[name].fields[0]
    if curve is not None and not more:
        x = np.unique(
            np.concatenate(
                [np.linspace(curve.x[0], curve.x[-1], 1601), [field.low, field.high, field.absent]]
            )
        )
        eta = problem.nominal * np.exp(curve(x))
        excess, plausible = problem.by_metric(eta)[:, k], (x >= field.low) & (x <= field.high)
        left, wide = float(excess[plausible].min()), float(excess.min())
        inside = problem.excess(eta)[:, :, k] == 0.0
        needed = tuple(
            min(x[inside[:, row]].tolist(), key=lambda value: abs(value - field.absent), default=None)
            if problem.excess(problem.nominal)[row, k] > 0.0 else None
            for row in range(len(problem.rows))
        )  # fmt: skip
    else:
        left, wide = (_best_excess(problem, name, k, wide=end) for end in (False, True))
    verdict: Verdict = "explains" if not left else "no" if wide > 0.0 else "beyond_plausible"
    return Ability(ETAS[k], verdict, max(1.0 - left / before, 0.0), needed)


def _best_excess(problem: TableProblem, name: str, k: int, *, wide: bool) -> float:
    """What the best values of a suspect of several fields leave of one efficiency: fitted on the
    curves, then simulated. [1]
    """
    bounds = problem.bounds([name], wide=wide)
    start = np.array([field.absent for field in problem.suspects[name].fields])
    x = fit(lambda x: problem.out_of_range(problem.on_curves([name], x), k), start, bounds, 30)
    found = [
        problem.by_metric(problem.efficiencies(problem.active([name], values)))[k]
        for values in (x, *bounds)
    ]
    return float(np.min(found))


def _values(problem: TableProblem, names: Sequence[str], x: Signal) -> Values:
    """What values of the fields leave, simulated."""
    made = problem.active(names, x)
    eta = problem.efficiencies(made)
    (low, high), (minimum, maximum) = (
        problem.bounds(names, wide=False),
        problem.bounds(names, wide=True),
    )
    near = np.minimum(x - minimum, maximum - x) < 1e-3 * (maximum - minimum)
    fields = [(name, field) for name in names for field in problem.suspects[name].fields]
    away = [gap[~np.isnan(gap)] for gap in (problem.printed - eta).T]
    return Values(
        fields={
            one.effect.name: dict(zip((f.name for f in one.effect.fields), one.values, strict=True))
            for one in made
        },
        reported={one.effect.name: {one.effect.parameter: one.reported} for one in made},
        left_rms={
            metric: float(np.sqrt(np.mean(gap**2)))
            for metric, gap in zip(ETAS, away, strict=True)
            if gap.size
        },
        out_of_reach=float(problem.by_metric(eta).sum()),
        misfit=float(np.sum(problem.misfit(eta) ** 2)),
        plausible=bool(np.all((x >= low - 1e-9) & (x <= high + 1e-9))),
        at_bound=tuple(
            f"{name}.{field.name}"
            for (name, field), value, close in zip(fields, x.tolist(), near.tolist(), strict=True)
            if close and value != field.absent
        ),
    )
