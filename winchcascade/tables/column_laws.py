"""Laws between the columns of a table, and faults of whole columns that explain why many cells
break them.

A printed number is an interval; a law of a column is evaluated in intervals over all rows at once.
Arrays are (2, n): both ends in SI units, NaN in rows without a cell.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.quantity import unit_names
from winchcascade.core.run import Signal
from winchcascade.tables.published_table import PrintedColumn, PublishedTable, TableRow

MAX_WRONG = 0.02
"""Share of its contradicted cells that a fault of whole columns may leave: it has to explain
nearly all of them. [1]
"""

ONE_OF = 6
"""Of so many contradicted cells, one may be a fault of its own."""

MIN_ROWS = 3
"""Fewer rows show no fault of a whole column."""

POWERS = (-6, -3, -2, -1, 1, 2, 3, 6)
"""Powers of ten by which a wrong unit or a lost decimal point changes a column."""

DUST = 1e-6
"""Share by which numbers of a spreadsheet may miss each other: heads and cells are copied with
seven digits. [1]
"""

Ends = Mapping[str, Signal]
"""Both ends of the cells of each column, (2, n), SI units."""


Status = Literal["evaluated", "derived", "not_evaluated"]
"""What becomes of a law."""


class LawUse(msgspec.Struct, frozen=True):
    """What became of a law: `rows` in which it was compared with cells, and the columns whose cells
    it lacks in the others.

    A law is `derived` if its column has no cells and others use what it gives instead.
    """

    law: str
    status: Status
    rows: int
    missing: tuple[str, ...] = ()


class ColumnFault(msgspec.Struct, frozen=True):
    """One fault of whole columns that explains contradicted cells: heads exchanged, or another
    unit, by a factor; or two rows exchanged, whose names stand for the columns.
    """

    kind: Literal["swapped", "unit", "rows"]
    columns: tuple[str, ...]
    factor: float = 1.0
    unit: str = ""
    broken_before: int = 0
    broken_after: int = 0
    sentence: str = ""


def cell_ends(table: PublishedTable) -> dict[str, Signal]:
    """Both ends of all cells by column."""
    nothing = (math.nan, math.nan)
    spans = {
        name: [row.cells[name].span if name in row.cells else None for row in table.rows]
        for name in table.columns
    }
    return {
        name: np.array(
            [nothing if s is None else (s.low, s.high) for s in column], dtype=np.float64
        )
        .reshape(-1, 2)
        .T
        for name, column in spans.items()
    }


def allowed_by_law(
    name: str, table: PublishedTable, ends: Ends, above: tuple[str, ...] = ()
) -> Signal:
    """What the law of a column allows, (2, n); NaN in rows that lack a column of it, and without a
    law.

    Where a column of the law has no cell, its own law gives it. Each term is widened by the
    tolerance of the table.

    Parameters
    ----------
    above : columns whose laws are being evaluated: what leads back to one of them gives nothing
    """
    law, shape = table.columns[name].law, ends[name].shape
    if law is None:
        return np.full(shape, math.nan)
    total = np.zeros(shape)
    for term in law.terms:
        product = np.full(shape, term.constant)
        for k, factor in enumerate((*term.times, *term.over)):
            known = np.full(shape, math.nan)
            if factor not in (*above, name):
                derived = table.columns[factor].law is not None and np.isnan(ends[factor]).any()
                inner = allowed_by_law(factor, table, ends, (*above, name)) if derived else known
                known = np.where(np.isnan(ends[factor]), inner, ends[factor])
            product = _product(product, _inverse(known) if k >= len(term.times) else known)
        if not above:
            product = product + np.array([[-1.0], [1.0]]) * (DUST + table.tolerance) * np.abs(
                product
            )
        total = total + product
    return total


def _product(one: Signal, other: Signal) -> Signal:
    """Product of two intervals; any value where one of them is unbounded."""
    with np.errstate(invalid="ignore"):
        ends = (one[:, None] * other[None]).reshape(4, -1)
    product = np.stack([ends.min(axis=0), ends.max(axis=0)])
    unbounded = (np.isinf(one) | np.isinf(other)).any(axis=0) & ~(
        np.isnan(one) | np.isnan(other)
    ).any(axis=0)
    return np.where(unbounded, [[-math.inf], [math.inf]], product)


def _inverse(ends: Signal) -> Signal:
    """Inverse of an interval; any value where it holds zero."""
    holds_zero = (ends[0] <= 0.0) & (ends[1] >= 0.0)
    return np.where(
        holds_zero, [[-math.inf], [math.inf]], 1.0 / np.where(holds_zero, 1.0, ends[::-1])
    )


def broken_cells(table: PublishedTable) -> tuple[dict[str, Signal], int]:
    """What laws and bounds allow of the cells that they contradict, (2, n) by column, NaN
    elsewhere; and the cells compared.
    """
    found, compared, ends = {}, 0, cell_ends(table)
    for name, column in table.columns.items():
        cell, law = ends[name], allowed_by_law(name, table, ends)
        above = np.abs(cell).min(axis=0) > column.at_most * (1.0 + DUST + table.tolerance)
        missed = (law[0] > cell[1]) | (law[1] < cell[0])
        known = ~np.isnan(cell[0]) & (np.isfinite(column.at_most) | ~np.isnan(law[0]))
        compared += int(known.sum())
        limit = np.where(above, [[-column.at_most], [column.at_most]], law)
        found[name] = np.where(above | missed, limit, math.nan)
    return found, compared


def law_uses(table: PublishedTable) -> tuple[LawUse, ...]:
    """What became of each law of the columns."""
    ends = cell_ends(table)
    laws = {name: column.law for name, column in table.columns.items() if column.law is not None}
    given = {name: ~np.isnan(ends[name][0]) for name in table.columns}
    known = {name: ~np.isnan(allowed_by_law(name, table, ends)[0]) for name in laws}
    rows = {name: int((given[name] & known[name]).sum()) for name in laws}
    used = set().union(*(made_of(name, table.columns) for name in laws if rows[name]))
    found = []
    for name, law in laws.items():
        inputs = [
            c
            for c in law.names
            if np.any(np.isnan(allowed_by_law(c, table, ends, (name,))[0]) & ~given[c])
        ]
        missing = (*([] if np.all(given[name]) else [name]), *inputs)
        derived = name in used and not given[name].any()
        status: Status = "evaluated" if rows[name] else "derived" if derived else "not_evaluated"
        found.append(LawUse(f"{name} = {law.text}", status, rows[name], missing))
    return tuple(found)


def made_of(
    name: str, columns: Mapping[str, PrintedColumn], above: tuple[str, ...] = ()
) -> set[str]:
    """Columns that the law of a column is made of, those of laws of laws among them."""
    law = columns[name].law
    inputs = set() if law is None or name in above else {*law.names}
    return inputs.union(*(made_of(c, columns, (*above, name)) for c in inputs))


def find_column_fault(
    table: PublishedTable, suspects: Collection[str], count: Callable[[PublishedTable], int]
) -> ColumnFault | None:
    """The fault of whole columns that explains nearly all contradicted cells: exchanged heads, else
    another unit.

    Parameters
    ----------
    suspects : columns of the contradicted cells, and those of their laws
    count : counts the contradicted cells of a table
    """
    before = count(table)
    left = max(MAX_WRONG * before, float(before >= ONE_OF))
    for candidates in (_exchanges(table, suspects), _other_units(table, suspects)):
        counted = [
            replace(one, broken_before=before, broken_after=count(mended(table, one)))
            for one in candidates
        ]
        good = [one for one in counted if one.broken_after <= left]
        good.sort(
            key=lambda one: (
                one.broken_after,
                one.kind == "unit" and not one.unit,
                len(one.columns),
            )
        )
        if good:
            return replace(good[0], sentence=_sentence(good[0], table))
    return None


def _exchanges(table: PublishedTable, suspects: Collection[str]) -> Iterator[ColumnFault]:
    """Pairs of columns with cells whose heads may be exchanged."""
    names = [
        n
        for n in table.columns
        if any(n in row.cells for row in table.rows) and not (table.by_load and n in table.keys)
    ]
    pairs = itertools.combinations(names, 2)
    return (ColumnFault("swapped", pair) for pair in pairs if not set(suspects).isdisjoint(pair))


def _other_units(table: PublishedTable, suspects: Collection[str]) -> Iterator[ColumnFault]:
    """Other units of single columns, and of all columns that share one: powers of ten, and units
    of the same dimension.
    """
    shared: dict[tuple[str, float], list[str]] = {}
    for name, column in sorted(table.columns.items()):
        shared.setdefault((column.dimension, column.factor), []).append(name)
    for (dimension, printed), names in shared.items():
        factors = {10.0**power: "" for power in POWERS}
        for known, unit in unit_names(dimension).items():
            same = next((f for f in factors if math.isclose(f, known / printed)), known / printed)
            factors[same] = unit
        groups: list[tuple[str, ...]] = [(name,) for name in names if name in suspects]
        groups += [tuple(names)] if len(names) > 1 and not set(suspects).isdisjoint(names) else []
        for group, (factor, unit) in itertools.product(groups, factors.items()):
            if not math.isclose(factor, 1.0):
                yield ColumnFault("unit", group, factor, unit)


def mended(table: PublishedTable, fault: ColumnFault) -> PublishedTable:
    """The table without a fault of its columns."""
    columns = table.columns
    if fault.kind == "unit":
        scaled = {
            name: replace(columns[name], factor=fault.factor * columns[name].factor)
            for name in fault.columns
        }
        columns, names = {**columns, **scaled}, {}
    else:
        names = dict(zip(fault.columns, reversed(fault.columns), strict=True))

    def moved(row: TableRow) -> TableRow:
        cells = {names.get(name, name): cell for name, cell in row.cells.items()}
        of = {
            name: replace(c, unit=columns[name].unit, factor=columns[name].factor)
            for name, c in cells.items()
        }
        return replace(row, cells=of)

    return replace(table, columns=columns, rows=tuple(map(moved, table.rows)))


def _sentence(fault: ColumnFault, table: PublishedTable) -> str:
    """The fault in words."""
    heads = " and ".join(repr(table.columns[name].head) for name in fault.columns)
    counts = (
        f"{fault.broken_before} cells contradict others as printed, {fault.broken_after or 'none'}"
    )
    if fault.kind == "swapped":
        return f"columns {heads} are swapped: {counts} with the two heads exchanged."
    printed, fits = (
        table.columns[fault.columns[0]].unit,
        f"; {fault.unit} fits" if fault.unit else "",
    )
    return f"unit of {heads}: {counts} if taken times {fault.factor:g}; the unit, printed as {printed}, is wrong{fits}."
