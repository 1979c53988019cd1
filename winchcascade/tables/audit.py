"""Consistency of a published table with itself, without any log.

Every row: is there a set of unrounded values behind the printed ones (`feasible`)? Do columns
follow from others (`column_laws`)? Every claim of the text. And the integration windows that the
table does not print, recovered from its energies and powers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.arguments import FLAG, PATH_OR_NONE, WATCH, check_arguments
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import Watch
from winchcascade.core.quantity import unit_suffix
from winchcascade.core.rig_file import Rig
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.claims import ClaimVerdict, claim_verdict
from winchcascade.tables.column_laws import (
    MIN_ROWS,
    ColumnFault,
    LawUse,
    broken_cells,
    find_column_fault,
    law_uses,
    made_of,
    mended,
)
from winchcascade.tables.feasible import (
    STAGES,
    Repeatability,
    allowed,
    contradictory_sets,
    is_feasible,
    lacking,
    repairs,
    repeatability,
    window,
)
from winchcascade.tables.published_table import Printed, PublishedTable, Span, TableRow
from winchcascade.tables.row_order import exchanged_rows
from winchcascade.tables.table_file import load_table

if TYPE_CHECKING:
    from winchcascade.tables.attainable import AttainableRanges


class Repair(msgspec.Struct, frozen=True):
    """A cell whose change alone makes its row consistent: the printed values that do, in the
    unit of the column.
    """

    metric: str
    low: float
    high: float
    text: str


class Contradiction(msgspec.Struct, frozen=True):
    """A smallest set of cells that cannot all be true, whatever the rounding and the scatter of the
    cycles.

    `printed` is the cell `metric`, `allowed` what the others of the set allow of it and `missed_by`
    the gap between, both in the unit printed.
    """

    row: TableRow
    cells: tuple[str, ...]
    metric: str
    printed: Printed
    allowed: Span
    missed_by: float
    sentence: str
    repairs: tuple[Repair, ...] = ()


class RecoveredWindow(msgspec.Struct, frozen=True):
    """Window of one row by its load, as the interval that its energies and powers leave; None
    where they leave none. [s]
    """

    load: float
    span: Span | None


class SharedWindow(msgspec.Struct, frozen=True):
    """Rows that can have the same window: the interval that all of them leave, and the number of
    fewest decimals in it. [s]
    """

    loads: tuple[float, ...]
    span: Span
    shortest: float


class Audit(Viewed, frozen=True):
    """Contradictions within a table and its text, and the windows that follow from it.

    `contradictions` are of rows; `faults` of whole columns mend others, which are in `explained`.
    `claims` holds a verdict for every claim of the text. `uses` states in how many rows each law
    was evaluated, `compared` how many cells were compared with laws of columns. `physics` is what a
    rig can attain, where that was requested.
    """

    table: PublishedTable
    known: Repeatability
    contradictions: tuple[Contradiction, ...]
    faults: tuple[ColumnFault, ...]
    explained: tuple[Contradiction, ...]
    claims: tuple[ClaimVerdict, ...]
    windows: tuple[RecoveredWindow, ...]
    shared: tuple[SharedWindow, ...]
    uses: tuple[LawUse, ...]
    compared: int = 0
    physics: AttainableRanges | None = None

    def __repr__(self) -> str:
        """One line instead of every number."""
        cells, claims = len(self.contradictions) + len(self.faults), len(self.contradicted)
        return f"Audit({self.table.name!r}, contradictions: {cells}, contradicted claims: {claims})"

    @property
    def contradicted(self) -> tuple[ClaimVerdict, ...]:
        """The claims that the rows contradict."""
        return tuple(claim for claim in self.claims if claim.verdict == "contradicted")

    @property
    def evaluated(self) -> bool:
        """Whether a law was compared with cells, or a claim with the table."""
        laws = any(use.rows for use in self.uses) or self.compared > 0
        return laws or any(claim.verdict != "not_checkable" for claim in self.claims)

    @property
    def ok(self) -> bool:
        """Whether something was evaluated, nothing contradicts itself, and the rig can attain
        the table where requested.
        """
        consistent = self.evaluated and not (
            self.contradictions or self.faults or self.contradicted
        )
        return consistent and (self.physics is None or self.physics.ok)


def audit(
    table: PublishedTable | str | Path,
    *,
    physics: bool = False,
    rig: Rig | str | Path | None = None,
    watch: Watch | None = None,
) -> Audit:
    """Check a published table and its text for contradictions, without any log.

    Parameters
    ----------
    table : a table by load or of operating points, its file, or the name of a built-in table
    physics : also compare a table by load with the model of a rig; the result is the field
        `physics`
    rig : of that comparison: a rig, its file, or the name of a built-in one; that of the paper if
        not given
    watch : called with the progress of that comparison

    Raises
    ------
    TableError : the table cannot be used
    OptionError : `physics` with a table of operating points, or a rig without `physics`

    >>> found = audit("hsu2026-table2")
    >>> [(item.row.load, item.cells) for item in found.contradictions], len(found.contradicted)
    ([(27.0, ('energy_line', 'energy_gen', 'eta_pto'))], 2)
    """
    check_arguments("audit", ("physics", physics, FLAG), ("watch", watch, WATCH))
    if not isinstance(rig, Rig):
        check_arguments("audit", ("rig", rig, PATH_OR_NONE))
    if rig is not None and not physics:
        name = rig.name if isinstance(rig, Rig) else rig
        raise OptionError(
            f"rig {name}: is of use with physics alone; add that, or leave the rig out."
        )
    table = load_table(table)
    if physics and not table.by_load:
        name = table.path or table.name
        raise OptionError(
            f"physics: {name} is a table of operating points; expected one of loads; leave "
            f"physics out."
        )
    known = repeatability(table)
    found, fault = _contradictions(table, known), None
    rows = {item.row.number for item in found}
    if len(rows) >= max(MIN_ROWS, 0.5 * len(table.rows)):
        suspects = {
            name
            for item in found
            for cell in item.cells
            for name in (cell, *made_of(cell, table.columns))
        }
        fault = find_column_fault(table, suspects, lambda other: _contradicted(other, known))
    kept = found if fault is None else _contradictions(mended(table, fault), known)
    recovered, order = (
        (_windows(table), exchanged_rows(table, known)) if table.by_load else ((), None)
    )
    return Audit(
        table=table,
        known=known,
        contradictions=kept,
        faults=tuple(one for one in (fault, order) if one is not None),
        explained=() if fault is None else found,
        claims=tuple(claim_verdict(claim, table, known) for claim in table.claims),
        windows=recovered,
        shared=_shared_windows(recovered),
        uses=(_uses_by_load(table) if table.by_load else ()) + law_uses(table),
        compared=broken_cells(table)[1],
        physics=_physics(table, known, rig, watch) if physics else None,
    )


def _physics(
    table: PublishedTable, known: Repeatability, rig: Rig | str | Path | None, watch: Watch | None
) -> AttainableRanges:
    """What a rig can attain of the efficiencies of a table."""
    from winchcascade.core.rig_toml import DEFAULT_RIG
    from winchcascade.rig.baseline import load_rig
    from winchcascade.rig.effects.catalogue import OF_THE_RIG
    from winchcascade.tables.attainable import attainable_ranges

    of = rig if isinstance(rig, Rig) else load_rig(rig or DEFAULT_RIG)
    return attainable_ranges(table, of, OF_THE_RIG, scatter=known.eta, watch=watch)


# --------------------------------------------------------------------------------- contradictions
def _contradicted(table: PublishedTable, known: Repeatability) -> int:
    """Number of cells that laws of columns contradict, and of rows by load that contradict
    themselves.
    """
    rows = sum(not is_feasible(row.spans, known) for row in table.rows) if table.by_load else 0
    return rows + sum(
        int((~np.isnan(limits[0])).sum()) for limits in broken_cells(table)[0].values()
    )


def _contradictions(table: PublishedTable, known: Repeatability) -> tuple[Contradiction, ...]:
    """Contradictions within the rows, row by row."""
    broken, _ = broken_cells(table)
    found = []
    for k, row in enumerate(table.rows):
        if table.by_load:
            sets = list(contradictory_sets(row.spans, known))
            changes = _repairs(row, repairs(row.spans, known)) if len(sets) == 1 else ()
            found += [_of_cells(row, names, changes, known) for names in sets]
        for name, limits in broken.items():
            if not math.isnan(limits[0, k]):
                found.append(_of_law(table, row, name, Span(*limits[:, k].tolist())))
    return tuple(found)


def _of_law(table: PublishedTable, row: TableRow, name: str, limits: Span) -> Contradiction:
    """A cell that its law, or its bound, does not allow."""
    column, printed = table.columns[name], row.cells[name]
    span = Span(limits.low / column.factor, limits.high / column.factor)
    place = f"{row.name}, {name}: {printed.words} is printed"
    if column.law is None or span.high == column.at_most == -span.low:
        sentence, others = f"{place}, but no such share exceeds 1.", tuple[str, ...]()
    else:
        limits_words = f"{span.low:.6g} to {span.high:.6g}{unit_suffix(column.unit)}"
        sentence, others = (
            f"{place}, but {column.law.text} allows {limits_words} after rounding.",
            column.law.names,
        )
    return Contradiction(
        row, (name, *others), name, printed, span, _missed(span, printed), sentence
    )


def _of_cells(
    row: TableRow, names: tuple[str, ...], changes: tuple[Repair, ...], known: Repeatability
) -> Contradiction:
    """Put one contradiction in a sentence, seen from the cell that needs the smallest change."""
    metric = changes[0].metric if changes else names[-1]
    printed = row.cells[metric]
    others = {name: row.spans[name] for name in names if name != metric}
    limits = allowed(others, known, metric) or Span(0.0, math.inf)
    span = Span(limits.low / printed.factor, limits.high / printed.factor)
    missed = _missed(span, printed)
    by = (
        " and ".join(f"{name} {row.cells[name].words}" for name in others)
        or "conservation of energy"
    )
    sentence = (
        f"{row.name}, {metric}: {printed.words} is printed, but {by} "
        f"allow{'s' if len(others) < 2 else ''} "
        f"{printed.range(limits)}, missed by {missed:.2g}{unit_suffix(printed.unit)} after "
        f"rounding: {_law(set(names), known)}."
    )
    return Contradiction(row, names, metric, printed, span, missed, sentence, changes)


def _law(cells: set[str], known: Repeatability) -> str:
    """The law that connects some cells, with what it allows for the scatter of the cycles."""
    for kind, (eta, pair) in itertools.product(("energy", "power"), RATIOS.items()):
        out, into = (name.replace("energy", kind) for name in pair)
        if cells == {out, into, eta}:
            return f"{eta} = {out} / {into} within {percent(known.ratio)} over {known.basis}"
        if cells in ({out, into}, {eta}):
            return "no stage gives out more than it takes in"
    if cells == set(RATIOS):
        return f"eta_pto = eta_trans eta_gen within {percent(known.product)} over {known.basis}"
    if len(cells) == 4 and not cells & set(RATIOS):
        return "energy over power is the window, and all stages share one"
    return "E = P t with one window, the efficiencies and what the scatter of the cycles allows leave no common values"


def _repairs(row: TableRow, spans: Mapping[str, Span]) -> tuple[Repair, ...]:
    """Turn the values that mend a row into those that would be printed for them; the smallest
    change first.
    """
    found = []
    for metric, span in spans.items():
        cell = row.cells[metric]
        step, high = 2.0 * cell.rounding, span.high
        low = max(math.ceil((span.low / cell.factor - cell.rounding) / step - 1e-9) * step, 0.0)
        if math.isfinite(high):
            high = math.floor((high / cell.factor + cell.rounding) / step + 1e-9) * step
        first, last = cell.fixed(low), cell.fixed(high)
        text = (
            first
            if first == last
            else f"at least {first}"
            if math.isinf(high)
            else f"{first} to {last}"
        )
        changed = max(low - cell.value, cell.value - high) / cell.rounding
        found.append((changed, Repair(metric, low, high, text + unit_suffix(cell.unit))))
    return tuple(repair for _, repair in sorted(found, key=lambda item: item[0]))


def percent(share: float) -> str:
    """A share in percent, with two decimals.

    >>> percent(0.00314)
    '0.31 %'
    """
    return f"{100.0 * share:.2f} %"


def _missed(span: Span, printed: Printed) -> float:
    """Gap between an interval and what rounds to the printed value, in the unit printed."""
    return max(
        span.low - (printed.value + printed.rounding),
        printed.value - printed.rounding - span.high,
        0.0,
    )


# ------------------------------------------------------------------------------- laws and windows
def _uses_by_load(table: PublishedTable) -> tuple[LawUse, ...]:
    """In how many rows each law of the cascade was evaluated, and what the others lack."""
    rows = [lacking(row.spans) for row in table.rows]
    found = []
    for law in lacking(()):
        without = [row[law] for row in rows if row[law]]
        count, missing = len(rows) - len(without), tuple(dict.fromkeys(itertools.chain(*without)))
        found.append(LawUse(law, "evaluated" if count else "not_evaluated", count, missing))
    return tuple(found)


def _windows(table: PublishedTable) -> tuple[RecoveredWindow, ...]:
    """Window of every row that prints an energy and a power of the same stage (E = P t)."""
    return tuple(
        RecoveredWindow(row.load or 0.0, window(row.spans))
        for row in table.rows
        if any({f"energy_{stage}", f"power_{stage}"} <= set(row.cells) for stage in STAGES)
    )


def _shared_windows(found: Sequence[RecoveredWindow]) -> tuple[SharedWindow, ...]:
    """Fewest windows that all rows can have, from the shortest to the longest.

    Rows are taken by the upper end of their interval; each group takes all that reach below the
    first one's.
    """
    rest = sorted(
        ((w.span, w.load) for w in found if w.span is not None), key=lambda item: item[0].high
    )
    groups = []
    while rest:
        last = rest[0][0].high
        group = [item for item in rest if item[0].low <= last]
        rest = [item for item in rest if item[0].low > last]
        span, members = Span(max(item[0].low for item in group), last), {load for _, load in group}
        groups.append(
            SharedWindow(tuple(w.load for w in found if w.load in members), span, shortest(span))
        )
    return tuple(groups)


def shortest(span: Span) -> float:
    """The number with the fewest decimals inside an interval.

    >>> shortest(Span(5.4790, 5.4815)), shortest(Span(5.3, 6.2))
    (5.48, 6.0)
    """
    for decimals in range(12):
        step = 10.0**-decimals
        first = math.ceil(span.low / step - 1e-9)
        if first * step <= span.high * (1.0 + 1e-12):
            return round(first * step, decimals)
    return 0.5 * (span.low + span.high)
