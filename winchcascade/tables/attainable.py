"""Compare a published table with the attainable ranges of a rig, and search the suspects that could explain a difference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal

import msgspec
import numpy as np

from winchcascade.core.jobs import Nobody, Watch
from winchcascade.core.published_table import PublishedTable, load_text
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Signal
from winchcascade.diagnosis.suspects import Suspects
from winchcascade.rig.baseline import baseline
from winchcascade.rig.effects.effect import Effect, Parameter
from winchcascade.tables.attainable_row import AttainableRow, Cell, NotJudged, Reduce, bounds_of_row, row_windows
from winchcascade.tables.effect_search import ETAS, Curves, EffectCurve, Search, TableSimulator, Values, field_curves

Verdict = Literal["explains", "beyond_plausible", "no"]
"""Whether one value of the effect brings all rows within the attainable range: a plausible one, an implausible one, none."""

MAX_SETS = 8
"""Sets of effects that are named."""

MAX_EFFECTS = 3
"""Effects of a set at most: more would explain anything."""


class Ability(msgspec.Struct, frozen=True):
    """The effect of one suspect alone on one efficiency.

    `closed` is the share of the excess over the attainable range that its best plausible value removes, over all rows [1].
    `needed` has, for each row, the value nearest to absent that brings the row within the attainable range, None where none
    does or where none is needed; empty for an effect of several fields.
    """

    metric: str
    verdict: Verdict
    closed: float
    needed: tuple[float | None, ...]


class SuspectResult(msgspec.Struct, frozen=True):
    """One suspect and its fields: its effect on each efficiency that is outside the attainable range.

    `best` has its best values over all rows and efficiencies, plausible or not; None for a suspect that moves nothing here.
    """

    effect: str
    stage: str
    fields: tuple[Parameter, ...]
    abilities: tuple[Ability, ...] = ()
    best: Values | None = None

    def ability(self, metric: str) -> Ability:
        """Its effect on one efficiency."""
        return next((one for one in self.abilities if one.metric == metric), Ability(metric, "no", 0.0, ()))


class Explanation(msgspec.Struct, frozen=True):
    """Suspects one by one, and the smallest sets that bring a whole table within the attainable range at plausible values.

    `sets` are of `size` effects, best fit first; where no set of up to `MAX_EFFECTS` will do, there is none, and `closest` is
    what comes nearest.
    """

    suspects: tuple[SuspectResult, ...]
    sets: tuple[Values, ...] = ()
    size: int = 0
    closest: Values | None = None


def explain(simulator: TableSimulator, suspects: Suspects, on_progress: Callable[[str], None]) -> Explanation:
    """Look at every suspect alone, then at sets of those that move something.

    Parameters
    ----------
    on_progress : called with the name of each suspect when it is done
    """
    curves: dict[str, Sequence[EffectCurve | None]] = {}
    results = []
    for name, kind in suspects.items():
        curves[name] = field_curves(simulator, kind)
        results.append(_suspect_result(simulator, name, kind, curves))
        on_progress(name)
    active = {name: suspects[name] for name in suspects if any(curve is not None for curve in curves[name])}
    return msgspec.structs.replace(_smallest_sets(simulator, active, curves), suspects=tuple(results))


def _suspect_result(simulator: TableSimulator, name: str, kind: Effect, curves: Curves) -> SuspectResult:
    if all(curve is None for curve in curves[name]):
        return SuspectResult(name, kind.stage, kind.fields)
    before = simulator.excess_by_metric(simulator.nominal)
    search = Search(simulator, {name: kind}, curves)
    outside = [k for k in range(len(ETAS)) if before[k] > 0.0]
    stages = [k for k in outside if ETAS[k] != "eta_pto"]  # the whole is their product
    abilities = tuple(_ability(search, k, float(before[k])) for k in stages or outside)
    best = search.simulated_values(search.polished(search.fit(wide=True), wide=True)) if before.any() else None
    return SuspectResult(name, kind.stage, kind.fields, abilities, best)


def _ability(search: Search, k: int, before: float) -> Ability:
    """Effect of a suspect on one efficiency, the k-th of `ETAS`; `before` is its excess over all rows. [1]"""
    left = search.best_excess(k)
    verdict: Verdict = "explains"
    if left > 0.0:
        verdict = "no" if search.best_excess(k, wide=True) > 0.0 else "beyond_plausible"
    curve, simulator = search.single, search.simulator
    needed = () if curve is None else tuple(_needed(simulator, curve, row, k) for row in range(len(simulator.rows)))
    return Ability(ETAS[k], verdict, max(1.0 - left / before, 0.0), needed)


def _needed(simulator: TableSimulator, curve: EffectCurve, row: int, k: int) -> float | None:
    """Value of a field nearest to absent that brings one cell within the attainable range."""
    if not simulator.excess(simulator.nominal)[row, k] > 0.0:
        return None
    inside = simulator.excess(simulator.nominal * np.exp(curve.ratio))[:, row, k] == 0.0
    return min(curve.x[inside].tolist(), key=lambda value: abs(value - curve.absent), default=None)


CANDIDATES = 12
"""Sets of a size that are simulated."""

SEEDS = 8
"""Sets of a size that the next size is grown from; singles all."""


def _smallest_sets(simulator: TableSimulator, suspects: Suspects, curves: Curves) -> Explanation:
    """The smallest sets that bring all cells within the attainable range: ranked on the curves, the first ones simulated."""
    if not simulator.excess_by_metric(simulator.nominal).any():
        return Explanation(())
    grown: list[tuple[str, ...]] = [(name,) for name in suspects]
    closest: Values | None = None
    for size in range(1, MAX_EFFECTS + 1):
        ranked = _ranked(simulator, suspects, curves, grown)
        simulated = [values for search, x in ranked[:CANDIDATES] if (values := _simulated(search, x)) is not None]
        closest = min((*simulated, *([closest] if closest else [])), key=lambda one: one.out_of_reach, default=None)
        enough = sorted((one for one in simulated if one.enough), key=lambda one: one.misfit)
        if enough:
            return Explanation((), tuple(enough[:MAX_SETS]), size)
        seeds = [tuple(search.kinds) for search, _ in ranked[: None if size == 1 else SEEDS]]
        grown = sorted({tuple(sorted((*names, other))) for names in seeds for other in suspects if other not in names})
    return Explanation((), (), MAX_EFFECTS, closest)


LOOKED_AT = 40
"""Sets of a size that are fitted on the curves, after a first look at all."""


def _ranked(
    simulator: TableSimulator, suspects: Suspects, curves: Curves, sets: Sequence[tuple[str, ...]]
) -> list[tuple[Search, Signal]]:
    """Sets with their values: first those with the smallest excess on the curves, then those that fit best."""
    searches = (Search(simulator, {name: suspects[name] for name in names}, curves) for names in sets)
    found: list[tuple[tuple[float, float], Search, Signal]] = []
    for search in sorted(searches, key=Search.first_look)[:LOOKED_AT]:
        x = search.fit()
        if simulator.sums(search.on_curves(x))[0] > 0.0:
            x = search.fit(hinge=True)
        found.append((simulator.sums(search.on_curves(x)), search, x))
    return [(search, x) for _, search, x in sorted(found, key=lambda one: one[0])]


MENDED = 0.01
"""A set that leaves more outside the attainable range in all than this is not tried again with better values. [1]"""


def _simulated(search: Search, x: Signal) -> Values | None:
    """Simulate a set; improve its values by simulations if the curves were too optimistic."""
    values = search.simulated_values(x)
    if values is None or values.enough or values.out_of_reach > MENDED:
        return values
    return search.simulated_values(search.polished(x, hinge=True))


class AttainableRanges(msgspec.Struct, frozen=True):
    """Attainable ranges of a rig for the rows of a table, and suspects that could explain the printed values.

    `not_judged` holds rows that cannot be held against the rig, `notes` say what was assumed. `scatter` is the largest
    deviation of a cycle's efficiency that counts [1].
    """

    rig: Rig
    scatter: float
    rows: tuple[AttainableRow, ...]
    not_judged: tuple[NotJudged, ...]
    notes: tuple[str, ...]
    explanation: Explanation

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
    suspects: Suspects,
    reduce: Reduce,
    *,
    scatter: float,
    watch: Watch | None = None,
) -> AttainableRanges:
    """Hold a published table against what the constants of a rig allow, and name the suspects that could explain a difference.

    Parameters
    ----------
    suspects : effects by name, as a catalogue lists them
    reduce : turns a simulated log into metrics, by the rules of any log
    scatter : largest deviation of a cycle's efficiency from the mean that the table prints or is taken to have [1]

    Raises
    ------
    RigError : the rig file lacks numbers that a model needs
    """
    model = baseline(rig)
    windows, notes = row_windows(table)
    watch = watch or Nobody()
    watch.begin(0, len(table.rows) + len(suspects))
    found: list[AttainableRow | NotJudged] = []
    for row in table.rows:
        found.append(bounds_of_row(table, row, windows[row.load], rig, reduce, scatter))
        watch.done(load_text(row.load), None)
    rows = tuple(row for row in found if isinstance(row, AttainableRow))
    not_judged = tuple(row for row in found if isinstance(row, NotJudged))
    explanation = Explanation(())
    if any(cell.outside for row in rows for cell in row.cells):
        explanation = explain(TableSimulator(rows, model, reduce), suspects, partial(watch.done, fault=None))
    return AttainableRanges(rig, scatter, rows, not_judged, notes, explanation)
