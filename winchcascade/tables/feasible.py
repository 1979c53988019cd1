"""Whether one row of a table by load can be true: a linear programme in the logarithms of its
unrounded values.

For every stage ``E = P t`` with one window t; for every efficiency ``E_out / E_in = eta (1 + x)``
with ``|x| <= ratio``, and ``eta_pto = eta_trans eta_gen (1 + y)`` with ``|y| <= product`` (see
`Repeatability`); no stage gives out more than it takes in. A printed cell confines its value to
what rounds to it. In logarithms all of this is linear, so that the programme finds a set of values
exactly if there is one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache

import msgspec

from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import METRICS, RATIOS
from winchcascade.tables.published_table import DEVIATIONS, PublishedTable, Span

STAGES = ("line", "mech", "gen")

ASSUMED = {"deviation_energy": 0.20, "deviation_eta": 0.03}
"""Largest deviations of a cycle that are assumed for a table that prints none; the audit reports
this. [1]
"""

_UNKNOWN = 60.0
"""Logarithm that no value passes, so that a value nothing confines has finite ends."""

_DUST = 1e-9
"""Share by which an interval is widened: a value on the edge of its rounding must not be lost to
the arithmetic.
"""

_VARIABLES = (*METRICS, "window")


def mean_of_products(one: float, other: float, cycles: int | None) -> float:
    """Largest mean of products of two sets of relative deviations from their means. [1]

    N deviations that sum to zero and stay within d make ``|sum(e h)| / N`` at most ``d_e d_h`` for
    even N, and ``d_e d_h (N - 1) / N`` for odd N, where one of them has to be zero. As ``mean(out)
    = mean(eta in) = mean(eta) mean(in) (1 + sum(e h) / N)``, this is how far a ratio of means can
    lie from the mean of ratios.

    Parameters
    ----------
    one, other : maximum deviations of the two [1]
    cycles : their number N; None takes the larger bound, that of even N

    Examples
    --------
    >>> round(mean_of_products(0.18, 0.025, 3), 6), mean_of_products(0.18, 0.025, 1)
    (0.003, 0.0)
    """
    return one * other * (1.0 if cycles is None or cycles % 2 == 0 else (cycles - 1) / cycles)


class Repeatability(msgspec.Struct, frozen=True):
    """Bounds of the deviations of the cycles behind a table, as the table prints them or as
    assumed.

    `energy` and `eta` are the maximum deviations of any cycle from the mean, rounding included [1];
    `basis` describes them in words, `assumed` names what the table does not print.
    """

    energy: float
    eta: float
    cycles: int | None
    basis: str
    assumed: tuple[str, ...]

    @property
    def ratio(self) -> float:
        """How far an efficiency can lie from the ratio of its mean energies. [1]"""
        return mean_of_products(self.energy, self.eta, self.cycles)

    @property
    def product(self) -> float:
        """How far eta_pto can lie from eta_trans eta_gen. [1]"""
        return mean_of_products(self.eta, self.eta, self.cycles)


def repeatability(table: PublishedTable) -> Repeatability:
    """Read the repeatability of a table's cycles; what is not printed takes the assumed values.

    A printed deviation counts with its rounding: 18 % is anything below 18.5 %.

    >>> from winchcascade.tables.table_file import load_table
    >>> round(repeatability(load_table("hsu2026-table2")).ratio, 6)
    0.003145
    """
    printed = {name: table.deviations.get(name) for name in DEVIATIONS}
    words = [
        f"{100 * ASSUMED[name]:g} %" if of is None else of.words for name, of in printed.items()
    ]
    assumed = [f"{name}_percent" for name, of in printed.items() if of is None]
    assumed += ["cycles"] if table.cycles is None else []
    energy, eta = (ASSUMED[name] if of is None else of.span.high for name, of in printed.items())
    cycles = (
        "any number of cycles"
        if table.cycles is None
        else f"{table.cycles} cycle{'s'[: table.cycles != 1]}"
    )
    basis = f"{cycles} with deviations of {words[0]} and {words[1]}" + (
        " (assumed)" if assumed else ""
    )
    return Repeatability(energy, eta, table.cycles, basis, tuple(assumed))


def is_feasible(cells: Mapping[str, Span], known: Repeatability) -> bool:
    """Whether there are values in all the cells that agree with each other."""
    return _solve(cells, known, {}) is not None


def allowed(
    cells: Mapping[str, Span], known: Repeatability, numerator: str, denominator: str | None = None
) -> Span | None:
    """What the cells allow of one value, or of the quotient of two; None if the cells contradict
    each other.

    The value may be a metric or `window`, whether it has a cell or not; an end that nothing
    confines is 0 or inf.
    """
    aim = {numerator: 1.0} | ({denominator: -1.0} if denominator else {})
    found = [
        _solve(cells, known, {name: side * sign for name, sign in aim.items()})
        for side in (1.0, -1.0)
    ]
    low, high = (
        None if x is None else sum(s * float(x[_VARIABLES.index(n)]) for n, s in aim.items())
        for x in found
    )
    if low is None or high is None:
        return None
    free = 0.5 * _UNKNOWN
    return Span(0.0 if low < -free else math.exp(low), math.inf if high > free else math.exp(high))


def window(spans: Mapping[str, Span], stages: Collection[str] = STAGES) -> Span | None:
    """Window that the energies and powers of stages leave together (E = P t); None if none does,
    or without both. [s]
    """
    pairs = [
        (spans[f"energy_{s}"], spans[f"power_{s}"])
        for s in stages
        if {f"energy_{s}", f"power_{s}"} <= set(spans)
    ]
    low = max((max(energy.low, 0.0) / power.high for energy, power in pairs), default=0.0)
    high = min(
        (energy.high / power.low for energy, power in pairs if power.low > 0.0), default=math.inf
    )
    return Span(low, high) if low <= high * (1.0 + 1e-9) and math.isfinite(high) else None


def lacking(cells: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Metrics that a row lacks for each law of a row, by the law; none where its cells can
    contradict the law.

    >>> lacking(["power_line", "power_mech", "eta_trans"])["eta_trans = energy_mech / energy_line"]
    ()
    """

    def missing(*names: str) -> tuple[str, ...]:
        return tuple(name for name in names if name not in cells)

    stages = sorted((missing(f"energy_{stage}", f"power_{stage}") for stage in STAGES), key=len)
    found = {"energy = power * window": (*stages[0], *stages[1])}  # two stages share the window
    pairs = {
        eta: min(missing(*pair), missing(*powers_of(pair)), key=len) for eta, pair in RATIOS.items()
    }
    found |= {
        f"{eta} = {out} / {into}": (*missing(eta), *pairs[eta])
        for eta, (out, into) in RATIOS.items()
    }
    found["eta_pto = eta_trans * eta_gen"] = missing(*RATIOS)
    bounded = any(eta in cells or not pairs[eta] for eta in RATIOS)
    return found | {"no stage delivers more than its input": () if bounded else tuple(RATIOS)}


def powers_of(energies: Iterable[str]) -> tuple[str, ...]:
    """The powers of the stages of some energies."""
    return tuple(name.replace("energy", "power") for name in energies)


def contradictory_sets(
    cells: Mapping[str, Span], known: Repeatability
) -> Iterator[tuple[str, ...]]:
    """Smallest sets of cells that cannot all be true, one after the other, no cell in two of
    them.
    """
    rest = dict(cells)
    while not is_feasible(rest, known):
        thin = dict(rest)
        for name in reversed(list(rest)):
            less = {other: span for other, span in thin.items() if other != name}
            thin = thin if is_feasible(less, known) else less
        smaller = (
            names for size in range(1, len(thin)) for names in itertools.combinations(rest, size)
        )
        found = next(
            (n for n in smaller if not is_feasible({name: rest[name] for name in n}, known)),
            tuple(thin),
        )
        yield found
        rest = {name: span for name, span in rest.items() if name not in found}


def repairs(cells: Mapping[str, Span], known: Repeatability) -> dict[str, Span]:
    """Cells of which a change of that one alone makes the row consistent, with the values that
    do.
    """
    found = {
        name: allowed({n: span for n, span in cells.items() if n != name}, known, name)
        for name in cells
    }
    return {name: span for name, span in found.items() if span is not None}


def _solve(
    cells: Mapping[str, Span], known: Repeatability, aim: Mapping[str, float]
) -> Signal | None:
    """Logarithms of values in all cells that make the aim smallest; None if there are none."""
    from scipy.optimize import linprog

    confined = [(-_UNKNOWN, _UNKNOWN)] * len(_VARIABLES)
    for name, span in cells.items():  # a cell of zero has no lower end
        confined[_VARIABLES.index(name)] = (
            _log(span.low * (1.0 - _DUST)),
            _log(span.high * (1.0 + _DUST)),
        )
    if any(low > high for low, high in confined):
        return None
    a_ub, a_eq = _relations()
    slack = [
        end
        for share in (*[known.ratio] * 3, known.product)
        for end in (math.log1p(share), -_log(1.0 - share))
    ]
    found = linprog(
        [aim.get(name, 0.0) for name in _VARIABLES],
        A_ub=a_ub,
        b_ub=[*slack, *[0.0] * (len(a_ub) - len(slack))],
        A_eq=a_eq,
        b_eq=[0.0] * len(a_eq),
        bounds=confined,
        method="highs",
    )
    return found.x if found.status == 0 else None


def _log(value: float) -> float:
    return -_UNKNOWN if value <= 0 else min(_UNKNOWN, math.log(value))


@cache
def _relations() -> tuple[list[list[float]], list[list[float]]]:
    """Rows of the programme: inequalities (ratios both ways, product both ways, efficiencies)
    and equalities (windows).
    """
    ratios = [{out: 1.0, into: -1.0, eta: -1.0} for eta, (out, into) in RATIOS.items()]
    ratios.append({"eta_pto": 1.0, "eta_trans": -1.0, "eta_gen": -1.0})
    both = [
        {name: sign * side for name, sign in rule.items()}
        for rule in ratios
        for side in (1.0, -1.0)
    ]
    passive = [{eta: 1.0} for eta in RATIOS] + [
        {out: 1.0, into: -1.0} for out, into in RATIOS.values()
    ]
    windows = [{f"energy_{stage}": 1.0, f"power_{stage}": -1.0, "window": -1.0} for stage in STAGES]
    above, equal = (
        [[rule.get(name, 0.0) for name in _VARIABLES] for rule in rules]
        for rules in (both + passive, windows)
    )
    return above, equal
