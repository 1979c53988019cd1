"""Consistency of a table of operating points with itself: what its columns are of each other, and heads that are exchanged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import msgspec

from winchcascade.core.published_table import Span, unit_suffix
from winchcascade.tables.point_table import Law, PointCell, PointColumn, PointTable

MOST_WRONG = 0.02
"""Share of its laws that a table may still break after an exchange of heads or another unit that explains it. [1]"""

FEWEST_ROWS = 3
"""Fewer rows show no fault of a whole column."""

POWERS = (-6, -3, -2, -1, 1, 2, 3, 6)
"""Powers of ten by which a wrong unit or a lost decimal point changes a column."""

_DUST = 1e-6
"""Share by which numbers of a spreadsheet may miss each other: heads and cells are copied with seven digits. [1]"""

_Row = Mapping[str, PointCell]


class BrokenLaw(msgspec.Struct, frozen=True):
    """A cell of a row that its law, or its bound, does not allow; numbers in the unit printed."""

    row: int
    column: str
    printed: float
    allowed: Span
    sentence: str


class ColumnFault(msgspec.Struct, frozen=True):
    """One fault of whole columns that explains the broken laws: heads exchanged, or a power of ten in a unit."""

    kind: str
    columns: tuple[str, ...]
    broken_before: int
    broken_after: int
    sentence: str


class PointAudit(msgspec.Struct, frozen=True):
    """Broken laws of a table; `faults` of whole columns explain those that `explained` counts."""

    table: PointTable
    laws: int
    broken: tuple[BrokenLaw, ...]
    faults: tuple[ColumnFault, ...]
    explained: int = 0

    @property
    def ok(self) -> bool:
        """Whether no law is broken."""
        return not self.broken and not self.faults


def audit_points(table: PointTable) -> PointAudit:
    """Hold every row against the laws of its columns; look for one fault of whole columns where many are broken."""
    laws = sum(len(_checked(table, row)) for row in table.rows)
    broken = broken_laws(table)
    rows = {item.row for item in broken}
    if len(rows) < max(FEWEST_ROWS, 0.5 * len(table.rows)):
        return PointAudit(table, laws, broken, ())
    for fault, mended in (*_exchanges(table, broken), *_units(table, broken)):
        return PointAudit(table, laws, mended, (fault,), len(broken) - len(mended))
    return PointAudit(table, laws, broken, ())


def broken_laws(table: PointTable) -> tuple[BrokenLaw, ...]:
    """Cells that the laws do not allow, row by row."""
    return tuple(
        item
        for k, row in enumerate(table.rows)
        for name in _checked(table, row)
        for item in [_broken(table, k, name)]
        if item is not None
    )


def _checked(table: PointTable, row: _Row) -> list[str]:
    """Columns of a row with a bound or a law of which every column has a cell."""
    return [
        name
        for name, column in table.columns.items()
        if name in row
        and (
            math.isfinite(column.at_most)
            or (column.law and all(c in row for c in (*column.law.times, *column.law.over)))
        )
    ]


def _broken(table: PointTable, k: int, name: str) -> BrokenLaw | None:
    row, column = table.rows[k], table.columns[name]
    cell = row[name]
    printed, where = (
        cell.span(column.factor),
        f"{table.row_name(k)}, {name}: {cell.text}{unit_suffix(column.unit)} is printed",
    )
    slack = _DUST + table.tolerance
    if min(abs(printed.low), abs(printed.high)) > column.at_most * (1.0 + slack):
        allowed = Span(-column.at_most / column.factor, column.at_most / column.factor)
        return BrokenLaw(k, name, cell.value, allowed, f"{where}, but no such share exceeds 1.")
    law = column.law
    if law is None or not all(c in row for c in (*law.times, *law.over)):
        return None
    span = _value(law, row, table.columns)
    wide = Span(span.low - slack * abs(span.low), span.high + slack * abs(span.high))
    if wide.meets(printed):
        return None
    allowed = Span(wide.low / column.factor, wide.high / column.factor)
    limits = f"{allowed.low:.6g} to {allowed.high:.6g}{unit_suffix(column.unit)}"
    sentence = f"{where}, but {law.text} allows {limits} after rounding."
    return BrokenLaw(k, name, cell.value, allowed, sentence)


def _value(law: Law, row: _Row, columns: Mapping[str, PointColumn]) -> Span:
    """What the cells of a row give for a law, in SI units."""
    span = Span(1.0, 1.0)
    for name in law.times:
        span = _product(span, row[name].span(columns[name].factor))
    for name in law.over:
        other = row[name].span(columns[name].factor)
        if other.low <= 0.0 <= other.high:
            return Span(-math.inf, math.inf)
        span = _product(span, Span(1.0 / other.high, 1.0 / other.low))
    return span


def _product(one: Span, other: Span) -> Span:
    ends = [a * b for a, b in itertools.product((one.low, one.high), (other.low, other.high))]
    return Span(min(ends), max(ends))


def _exchanges(table: PointTable, broken: Sequence[BrokenLaw]) -> list[tuple[ColumnFault, tuple[BrokenLaw, ...]]]:
    """Pairs of columns whose heads, exchanged, leave nearly no law broken; the best one first."""
    suspects = {item.column for item in broken}
    suspects |= {c for name in suspects if (law := table.columns[name].law) for c in (*law.times, *law.over)}
    found = []
    for one, other in itertools.combinations(table.columns, 2):
        if suspects.isdisjoint((one, other)):
            continue
        mended = broken_laws(
            msgspec.structs.replace(table, rows=tuple(_exchanged(row, one, other) for row in table.rows))
        )
        if len(mended) <= MOST_WRONG * len(broken):
            heads = " and ".join(repr(table.columns[name].head) for name in (one, other))
            sentence = (
                f"columns {heads} are swapped: {len(broken)} cells contradict others as printed, "
                f"{len(mended) or 'none'} with the two heads exchanged."
            )
            found.append((ColumnFault("swapped", (one, other), len(broken), len(mended), sentence), mended))
    return sorted(found, key=lambda item: item[0].broken_after)


def _exchanged(row: _Row, one: str, other: str) -> dict[str, PointCell]:
    names = {one: other, other: one}
    return {names.get(name, name): cell for name, cell in row.items()}


def _units(table: PointTable, broken: Sequence[BrokenLaw]) -> list[tuple[ColumnFault, tuple[BrokenLaw, ...]]]:
    """Columns that one power of ten in their unit makes consistent; the best one first."""
    suspects = {item.column for item in broken}
    suspects |= {c for name in suspects if (law := table.columns[name].law) for c in (*law.times, *law.over)}
    found = []
    for name, power in itertools.product(sorted(suspects), POWERS):
        column = table.columns[name]
        scaled = msgspec.structs.replace(column, factor=column.factor * 10.0**power)
        mended = broken_laws(msgspec.structs.replace(table, columns={**table.columns, name: scaled}))
        if len(mended) <= MOST_WRONG * len(broken):
            sentence = (
                f"column {column.head!r}: {len(broken)} cells contradict others as printed, {len(mended) or 'none'} if its "
                f"numbers are taken times {10.0**power:g}; its unit, printed as {column.unit}, is wrong."
            )
            found.append((ColumnFault("unit", (name,), len(broken), len(mended), sentence), mended))
    return sorted(found, key=lambda item: item[0].broken_after)
