"""Consistency of a table of operating points with itself: what its columns are of each other, and heads that are exchanged."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from typing import Literal

import msgspec

from winchcascade.core.published_table import Span, unit_suffix
from winchcascade.core.quantity import unit_names
from winchcascade.tables.point_table import Law, PointCell, PointColumn, PointTable

MAX_WRONG = 0.02
"""Share of its laws that a table may still break after an exchange of heads or another unit that explains it. [1]"""

MIN_ROWS = 3
"""Fewer rows show no fault of a whole column."""

POWERS = (-6, -3, -2, -1, 1, 2, 3, 6)
"""Powers of ten by which a wrong unit or a lost decimal point changes a column."""

_DUST = 1e-6
"""Share by which numbers of a spreadsheet may miss each other: heads and cells are copied with seven digits. [1]"""

_Row = Mapping[str, PointCell]

_ANY = Span(-math.inf, math.inf)
"""Any value: what a quotient can be whose divisor may be zero."""


class BrokenLaw(msgspec.Struct, frozen=True):
    """A cell of a row that its law, or its bound, does not allow; numbers in the unit printed."""

    row: int
    column: str
    printed: float
    allowed: Span
    sentence: str


class ColumnFault(msgspec.Struct, frozen=True):
    """One fault of whole columns that explains the broken laws: heads exchanged, or another unit."""

    kind: str
    columns: tuple[str, ...]
    broken_before: int
    broken_after: int
    sentence: str


Status = Literal["evaluated", "derived", "not_evaluated"]
"""What becomes of a law."""


class LawUse(msgspec.Struct, frozen=True):
    """What became of a law: `rows` in which it was compared with cells, and the columns whose cells it lacks in the others.

    A law is `derived` if its column has no cells and others use what it gives instead.
    """

    law: str
    status: Status
    rows: int
    missing: tuple[str, ...] = ()


class PointAudit(msgspec.Struct, frozen=True):
    """Broken laws of a table; `faults` of whole columns explain those that `explained` counts.

    `laws` is the number of cells that were compared with a law or a bound, `uses` what became of each declared law.
    """

    table: PointTable
    laws: int
    broken: tuple[BrokenLaw, ...]
    faults: tuple[ColumnFault, ...]
    explained: int = 0
    uses: tuple[LawUse, ...] = ()

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"PointAudit({self.table.name!r}, {len(self.broken)} cells contradicted, {len(self.faults)} faults of columns)"

    @property
    def ok(self) -> bool:
        """Whether something was compared and no law is broken."""
        return self.laws > 0 and not self.broken and not self.faults


def audit_points(table: PointTable) -> PointAudit:
    """Hold every row against the laws of its columns; look for one fault of whole columns where many are broken."""
    laws = sum(len(_checked(table, row)) for row in table.rows)
    broken = broken_laws(table)
    found = PointAudit(table, laws, broken, (), uses=_uses(table))
    rows = {item.row for item in broken}
    if len(rows) < max(MIN_ROWS, 0.5 * len(table.rows)):
        return found
    for fault, mended in (*_exchanges(table, broken), *_units(table, broken)):
        explained = len(broken) - len(mended)
        return msgspec.structs.replace(found, broken=mended, faults=(fault,), explained=explained)
    return found


def _uses(table: PointTable) -> tuple[LawUse, ...]:
    """What became of each law of the columns."""
    columns, given = table.columns, {name for row in table.rows for name in row}
    laws = {name: column.law for name, column in columns.items() if column.law is not None}
    rows = {name: [name in row and _inputs_known(name, row, columns) for row in table.rows] for name in laws}
    used = {c for name in laws if any(rows[name]) for c in _made_of(name, columns)}
    found = []
    for name, law in laws.items():
        lacking = [c for row in table.rows for c in _lacking(name, row, columns)]
        status: Status = "evaluated" if any(rows[name]) else "derived" if name in used - given else "not_evaluated"
        found.append(LawUse(f"{name} = {law.text}", status, sum(rows[name]), tuple(dict.fromkeys(lacking))))
    return tuple(found)


def _lacking(name: str, row: _Row, columns: Mapping[str, PointColumn]) -> list[str]:
    """Columns whose cells a row lacks to compare a column with its law."""
    law = columns[name].law
    inputs = () if law is None else (*law.times, *law.over)
    return [*([] if name in row else [name]), *(c for c in inputs if _span(c, row, columns, (name,)) is None)]


def _made_of(name: str, columns: Mapping[str, PointColumn], above: tuple[str, ...] = ()) -> set[str]:
    """Columns that the law of a column is made of, those of laws of laws among them."""
    law = columns[name].law
    inputs = set() if law is None or name in above else {*law.times, *law.over}
    return inputs.union(*(_made_of(c, columns, (*above, name)) for c in inputs))


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
        if name in row and (math.isfinite(column.at_most) or _inputs_known(name, row, table.columns))
    ]


def _inputs_known(name: str, row: _Row, columns: Mapping[str, PointColumn]) -> bool:
    """Whether a column has a law of which every column has a cell, or a law that gives what the cell would hold."""
    law = columns[name].law
    return law is not None and _value(law, row, columns, (name,)) is not None


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
    span = None if law is None else _value(law, row, table.columns, (name,))
    if law is None or span is None:
        return None
    wide = Span(span.low - slack * abs(span.low), span.high + slack * abs(span.high))
    if wide.meets(printed):
        return None
    allowed = Span(wide.low / column.factor, wide.high / column.factor)
    limits = f"{allowed.low:.6g} to {allowed.high:.6g}{unit_suffix(column.unit)}"
    sentence = f"{where}, but {law.text} allows {limits} after rounding."
    return BrokenLaw(k, name, cell.value, allowed, sentence)


def _span(name: str, row: _Row, columns: Mapping[str, PointColumn], above: tuple[str, ...] = ()) -> Span | None:
    """What a row gives for a column, in SI units: its cell, else what its law gives; None without both.

    Parameters
    ----------
    above : columns that are compared or derived: what leads back to one of them gives nothing
    """
    law = columns[name].law
    if name in above or (name not in row and law is None):
        return None
    if name in row:
        return row[name].span(columns[name].factor)
    return None if law is None else _value(law, row, columns, (*above, name))


def _value(law: Law, row: _Row, columns: Mapping[str, PointColumn], above: tuple[str, ...] = ()) -> Span | None:
    """What a row gives for a law, in SI units; None where it lacks a column."""
    span = Span(1.0, 1.0)
    for name in law.times:
        if (factor := _span(name, row, columns, above)) is None:
            return None
        span = _product(span, factor)
    for name in law.over:
        if (other := _span(name, row, columns, above)) is None:
            return None
        span = _product(span, Span(1.0 / other.high, 1.0 / other.low) if other.low > 0.0 or other.high < 0.0 else _ANY)
    return span


def _product(one: Span, other: Span) -> Span:
    ends = [a * b for a, b in itertools.product((one.low, one.high), (other.low, other.high))]
    return Span(min(ends), max(ends)) if all(map(math.isfinite, ends)) else _ANY


def _exchanges(table: PointTable, broken: Sequence[BrokenLaw]) -> list[tuple[ColumnFault, tuple[BrokenLaw, ...]]]:
    """Pairs of columns whose heads, exchanged, leave nearly no law broken; the best one first."""
    suspects = {item.column for item in broken}
    suspects |= {c for name in suspects for c in _made_of(name, table.columns)}
    found = []
    for one, other in itertools.combinations(table.columns, 2):
        if suspects.isdisjoint((one, other)):
            continue
        mended = broken_laws(
            msgspec.structs.replace(table, rows=tuple(_exchanged(row, one, other) for row in table.rows))
        )
        if len(mended) <= MAX_WRONG * len(broken):
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


class _Rescaled(msgspec.Struct, frozen=True):
    """Columns of one unit, the factor by which it may be wrong, and the unit that this gives, empty for none that is known."""

    names: tuple[str, ...]
    factor: float
    unit: str


def _units(table: PointTable, broken: Sequence[BrokenLaw]) -> list[tuple[ColumnFault, tuple[BrokenLaw, ...]]]:
    """Columns that one other unit makes consistent; the best ones first: to a unit that is known, and of few columns."""
    suspects = {item.column for item in broken}
    suspects |= {c for name in suspects for c in _made_of(name, table.columns)}
    found = []
    for rescaled in _other_units(table, suspects):
        scaled = {
            name: msgspec.structs.replace(column, factor=column.factor * rescaled.factor)
            for name in rescaled.names
            for column in [table.columns[name]]
        }
        mended = broken_laws(msgspec.structs.replace(table, columns={**table.columns, **scaled}))
        if len(mended) <= MAX_WRONG * len(broken):
            found.append((rescaled, mended))
    found.sort(key=lambda item: (len(item[1]), not item[0].unit, len(item[0].names)))
    return [(_wrong_unit(table, broken, one, mended, [r for r, _ in found]), mended) for one, mended in found]


def _other_units(table: PointTable, suspects: AbstractSet[str]) -> Iterator[_Rescaled]:
    """Other units of single columns, and of all columns that share one: powers of ten, and units of the same dimension."""
    shared: dict[tuple[str, float], list[str]] = {}
    for name, column in sorted(table.columns.items()):
        shared.setdefault((column.dimension, column.factor), []).append(name)
    for (dimension, printed), names in shared.items():
        known = {factor / printed: unit for factor, unit in unit_names(dimension).items()}
        factors = {10.0**power: "" for power in POWERS}
        for factor, unit in known.items():
            same = next((f for f in factors if math.isclose(f, factor)), factor)
            factors[same] = unit
        groups: list[tuple[str, ...]] = [(name,) for name in names if name in suspects]
        groups += [tuple(names)] if len(names) > 1 and not suspects.isdisjoint(names) else []
        yield from (
            _Rescaled(group, factor, unit)
            for group in groups
            for factor, unit in factors.items()
            if not math.isclose(factor, 1.0)
        )


def _wrong_unit(
    table: PointTable,
    broken: Sequence[BrokenLaw],
    one: _Rescaled,
    mended: Sequence[BrokenLaw],
    others: Sequence[_Rescaled],
) -> ColumnFault:
    """The fault of a unit, with another one to a known unit that the table cannot distinguish from it."""
    heads, many = " and ".join(repr(table.columns[name].head) for name in one.names), len(one.names) > 1
    sentence = (
        f"column{'s' if many else ''} {heads}: {len(broken)} cells contradict others as printed, {len(mended) or 'none'} if "
        f"{'their' if many else 'its'} numbers are taken times {one.factor:g}; {'their' if many else 'its'} unit, printed as "
        f"{table.columns[one.names[0]].unit}, is wrong" + (f"; {one.unit} fits." if one.unit else ".")
    )
    alike = [o for o in others if o.unit and len(o.names) == 1 and set(o.names).isdisjoint(one.names)]
    if one.unit and alike:
        sentence += f" {alike[0].unit} for column {table.columns[alike[0].names[0]].head!r} fits too."
    return ColumnFault("unit", one.names, len(broken), len(mended), sentence)
