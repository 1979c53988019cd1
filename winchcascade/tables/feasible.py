"""Whether one row of a table can be true: a linear programme in the logarithms of its unrounded values.

For every stage ``E = P t`` with one window t; for every efficiency ``E_out / E_in = eta (1 + x)`` with ``|x| <= ratio``,
and ``eta_pto = eta_trans eta_gen (1 + y)`` with ``|y| <= product`` (see `Bounds`); no stage gives out more than it takes
in. A printed cell confines its value to what rounds to it. In logarithms all of this is linear, so that the programme finds a
set of values exactly if there is one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING

from winchcascade.core.published_table import Span
from winchcascade.reduction.efficiency import METRICS, RATIOS
from winchcascade.tables.ratio_of_means import Bounds

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

STAGES = ("line", "mech", "gen")

_UNKNOWN = 60.0
"""Logarithm that no value passes, so that a value nothing confines has finite ends."""

_DUST = 1e-9
"""Share by which an interval is widened: a value on the edge of its rounding must not be lost to the arithmetic."""

_VARIABLES = (*METRICS, "window")


def is_feasible(cells: Mapping[str, Span], bounds: Bounds) -> bool:
    """Whether there are values in all the cells that agree with each other."""
    return _solve(cells, bounds, {}) is not None


def allowed(cells: Mapping[str, Span], bounds: Bounds, numerator: str, denominator: str | None = None) -> Span | None:
    """What the cells allow of one value, or of the quotient of two; None if the cells contradict each other.

    The value may be a metric or `window`, whether it has a cell or not; an end that nothing confines is 0 or inf.
    """
    aim = {numerator: 1.0} | ({denominator: -1.0} if denominator else {})
    low = _solve(cells, bounds, aim)
    high = _solve(cells, bounds, {name: -sign for name, sign in aim.items()})
    if low is None or high is None:
        return None
    ends = [sum(sign * float(x[_VARIABLES.index(name)]) for name, sign in aim.items()) for x in (low, high)]
    free = 0.5 * _UNKNOWN
    return Span(0.0 if ends[0] < -free else math.exp(ends[0]), math.inf if ends[1] > free else math.exp(ends[1]))


def contradictions(cells: Mapping[str, Span], bounds: Bounds) -> Iterator[tuple[str, ...]]:
    """Smallest sets of cells that cannot all be true, one after the other, no cell in two of them."""
    rest = dict(cells)
    while not is_feasible(rest, bounds):
        found = _smallest(rest, bounds)
        yield found
        rest = {name: span for name, span in rest.items() if name not in found}


def repairs(cells: Mapping[str, Span], bounds: Bounds) -> dict[str, Span]:
    """Cells of which a change of that one alone makes the row consistent, with the values that do."""
    spans = {}
    for name in cells:
        span = allowed({other: cells[other] for other in cells if other != name}, bounds, name)
        if span is not None:
            spans[name] = span
    return spans


def _smallest(cells: Mapping[str, Span], bounds: Bounds) -> tuple[str, ...]:
    """A contradictory set of the fewest cells: one that cannot be thinned out, unless a smaller one exists."""
    thin = dict(cells)
    for name in reversed(list(cells)):
        less = {other: span for other, span in thin.items() if other != name}
        if not is_feasible(less, bounds):
            thin = less
    for size in range(1, len(thin)):
        for names in itertools.combinations(cells, size):
            if not is_feasible({name: cells[name] for name in names}, bounds):
                return names
    return tuple(thin)


def _solve(cells: Mapping[str, Span], bounds: Bounds, aim: Mapping[str, float]) -> NDArray[np.float64] | None:
    """Logarithms of values in all cells that make the aim smallest; None if there are none."""
    from scipy.optimize import linprog

    confined = [_logs(cells.get(name)) for name in _VARIABLES]
    if any(low > high for low, high in confined):
        return None
    a_ub, a_eq = _relations()
    ratio = [math.log1p(bounds.ratio), -_log(1.0 - bounds.ratio)] * 3
    product = [math.log1p(bounds.product), -_log(1.0 - bounds.product)]
    found = linprog(
        [aim.get(name, 0.0) for name in _VARIABLES],
        A_ub=a_ub,
        b_ub=[*ratio, *product, *[0.0] * (len(a_ub) - 8)],
        A_eq=a_eq,
        b_eq=[0.0] * len(a_eq),
        bounds=confined,
        method="highs",
    )
    return found.x if found.status == 0 else None


def _log(value: float) -> float:
    return -_UNKNOWN if value <= 0 else min(_UNKNOWN, math.log(value))


def _logs(span: Span | None) -> tuple[float, float]:
    """Ends of an interval in logarithms; a cell of zero has no lower one."""
    if span is None:
        return -_UNKNOWN, _UNKNOWN
    return _log(span.low * (1.0 - _DUST)), _log(span.high * (1.0 + _DUST))


@cache
def _relations() -> tuple[tuple[tuple[float, ...], ...], tuple[tuple[float, ...], ...]]:
    """Rows of the programme: inequalities (ratios both ways, product both ways, efficiencies) and equalities (windows)."""
    ratio = [{out: 1.0, into: -1.0, eta: -1.0} for eta, (out, into) in RATIOS.items()]
    product = {"eta_pto": -1.0, "eta_trans": 1.0, "eta_gen": 1.0}
    both = [{name: sign * side for name, sign in rule.items()} for rule in ratio for side in (1.0, -1.0)]
    both += [{name: -sign for name, sign in product.items()}, product]
    passive = [{eta: 1.0} for eta in RATIOS] + [{out: 1.0, into: -1.0} for out, into in RATIOS.values()]
    windows = [{f"energy_{stage}": 1.0, f"power_{stage}": -1.0, "window": -1.0} for stage in STAGES]

    def matrix(rules: list[dict[str, float]]) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(rule.get(name, 0.0) for name in _VARIABLES) for rule in rules)

    return matrix(both + passive), matrix(windows)
