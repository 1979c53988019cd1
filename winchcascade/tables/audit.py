"""Consistency of a published table with itself, without any log.

Every row: is there a set of unrounded values behind the printed ones (`feasible`)? Every sum, every claim of the text.
And the integration windows that the table does not print, recovered from its energies and powers.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import msgspec

from winchcascade.core.arguments import FLAG, PATH_OR_NONE, WATCH, check_arguments
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import Watch
from winchcascade.core.published_table import (
    PrintedColumn,
    PublishedTable,
    Span,
    TableRow,
    load_table,
    load_text,
    unit_suffix,
)
from winchcascade.core.rig_file import Rig
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.claims import ClaimVerdict, claim_verdict
from winchcascade.tables.feasible import (
    STAGES,
    Repeatability,
    allowed,
    contradictions,
    lacking,
    repairs,
    repeatability,
    stage_window,
    window,
)
from winchcascade.tables.point_audit import LawUse, PointAudit, audit_points
from winchcascade.tables.point_table import PointTable, open_table

if TYPE_CHECKING:
    from winchcascade.tables.attainable import AttainableRanges


class Repair(msgspec.Struct, frozen=True):
    """A cell whose change alone makes its row consistent: the printed values that do, in the unit of the column."""

    metric: str
    low: float
    high: float
    text: str


class Contradiction(msgspec.Struct, frozen=True):
    """A smallest set of cells that cannot all be true, whatever the rounding and the scatter of the cycles.

    `printed` is the cell `metric`, `allowed` what the others of the set allow of it and `missed_by` the gap between, all in
    the unit printed. `load` is None for the row of sums and for a whole column.
    """

    kind: Literal["row", "column", "total"]
    load: float | None
    cells: tuple[str, ...]
    metric: str
    printed: float
    unit: str
    allowed: Span
    missed_by: float
    sentence: str
    repairs: tuple[Repair, ...] = ()
    line: int | None = None


class RecoveredWindow(msgspec.Struct, frozen=True):
    """Window of one row, as the interval that its energies and powers leave; None where they leave none. [s]"""

    load: float
    span: Span | None


class SharedWindow(msgspec.Struct, frozen=True):
    """Rows that can have the same window: the interval that all of them leave, and the number of fewest decimals in it. [s]"""

    loads: tuple[float, ...]
    span: Span
    shortest: float


class Audit(msgspec.Struct, frozen=True):
    """Contradictions within a table and its text, and the windows that follow from it.

    `contradictions` are of rows, columns and sums; `claims` holds a verdict for every claim of the text. `uses` states in how
    many rows each law was evaluated. `physics` is what a rig can attain, where that was requested.
    """

    table: PublishedTable
    known: Repeatability
    contradictions: tuple[Contradiction, ...]
    claims: tuple[ClaimVerdict, ...]
    windows: tuple[RecoveredWindow, ...]
    shared: tuple[SharedWindow, ...]
    uses: tuple[LawUse, ...] = ()
    physics: AttainableRanges | None = None

    def __repr__(self) -> str:
        """One line instead of every number."""
        cells, claims = len(self.contradictions), len(self.contradicted)
        return f"Audit({self.table.name!r}, contradictions: {cells}, contradicted claims: {claims})"

    @property
    def contradicted(self) -> tuple[ClaimVerdict, ...]:
        """The claims that the rows contradict."""
        return tuple(claim for claim in self.claims if claim.verdict == "contradicted")

    @property
    def evaluated(self) -> bool:
        """Whether a law was compared with cells, or a claim with the table."""
        return any(use.rows for use in self.uses) or any(claim.verdict != "not_checkable" for claim in self.claims)

    @property
    def consistent(self) -> bool:
        """Whether something was evaluated and nothing contradicts itself."""
        return self.evaluated and not self.contradictions and not self.contradicted

    @property
    def ok(self) -> bool:
        """Whether the table is consistent, and the rig can attain it where that was requested."""
        return self.consistent and (self.physics is None or self.physics.ok)


def audit_by_load(table: PublishedTable | str | Path) -> Audit:
    """Hold a table and its claims against themselves.

    Parameters
    ----------
    table : a table, a table file, or the name of a built-in table

    >>> found = audit_by_load("hsu2026-table2")
    >>> [(item.load, item.cells) for item in found.contradictions], len(found.contradicted)
    ([(27.0, ('energy_line', 'energy_gen', 'eta_pto'))], 2)
    """
    table = table if isinstance(table, PublishedTable) else load_table(table)
    known = repeatability(table)
    recovered = windows(table)
    return Audit(
        table=table,
        known=known,
        contradictions=row_contradictions(table, known) + total_contradictions(table),
        claims=tuple(claim_verdict(claim, table, known) for claim in table.claims),
        windows=recovered,
        shared=shared_windows(recovered),
        uses=_uses(table),
    )


def _uses(table: PublishedTable) -> tuple[LawUse, ...]:
    """In how many rows each law was evaluated, and what the others lack; the sums where the table has them."""
    rows = [lacking(row.cells) for row in table.rows]
    found = []
    for law in lacking(()):
        without = [row[law] for row in rows if row[law]]
        count, missing = len(rows) - len(without), tuple(dict.fromkeys(itertools.chain(*without)))
        found.append(LawUse(law, "evaluated" if count else "not_evaluated", count, missing))
    if table.total is not None:
        missing = tuple(m for m in table.total.cells if not any(m in row.cells for row in table.rows))
        summed = len(missing) < len(table.total.cells)
        found.append(
            LawUse("total = sum of the rows", "evaluated" if summed else "not_evaluated", int(summed), missing)
        )
    return tuple(found)


def windows(table: PublishedTable) -> tuple[RecoveredWindow, ...]:
    """Window of every row that prints an energy and a power of the same stage (E = P t)."""
    return tuple(
        RecoveredWindow(row.load, window(table.spans(row)))
        for row in table.rows
        if any({f"energy_{stage}", f"power_{stage}"} <= set(row.cells) for stage in STAGES)
    )


def shared_windows(found: Sequence[RecoveredWindow]) -> tuple[SharedWindow, ...]:
    """Fewest windows that all rows can have, from the shortest to the longest.

    Rows are taken by the upper end of their interval; each group takes all that reach below the first one's.
    """
    rest = sorted(((w.span, w.load) for w in found if w.span is not None), key=lambda item: item[0].high)
    groups = []
    while rest:
        last = rest[0][0].high
        group = [item for item in rest if item[0].low <= last]
        rest = [item for item in rest if item[0].low > last]
        span, members = Span(max(item[0].low for item in group), last), {load for _, load in group}
        groups.append(SharedWindow(tuple(w.load for w in found if w.load in members), span, shortest(span)))
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


def row_contradictions(table: PublishedTable, known: Repeatability) -> tuple[Contradiction, ...]:
    """Contradictions within the rows; a column that deviates by the same power of ten in every row counts once."""
    found = _of_rows(table, known)
    for metric, column in table.columns.items():
        inside = [item for item in found if item.metric == metric]
        rows = {row.load for row in table.rows if metric in row.cells}
        powers = {_power_of_ten(item, column) for item in inside if item.repairs}
        if len(rows) > 1 and {item.load for item in inside} == rows and len(powers) == 1 and (power := powers.pop()):
            scaled = msgspec.structs.replace(column, factor=column.factor * 10.0**power)
            mended = msgspec.structs.replace(table, columns={**table.columns, metric: scaled})
            sentence = (
                f"column {metric}: every one of its {len(inside)} rows is consistent if the numbers are taken times "
                f"{10.0**power:g}; the unit of the column, printed as {column.unit}, is wrong."
            )
            of_column = msgspec.structs.replace(
                inside[0], kind="column", load=None, cells=(metric,), sentence=sentence, repairs=(), line=None
            )
            return (of_column, *_of_rows(mended, known))
    return tuple(found)


def _power_of_ten(item: Contradiction, column: PrintedColumn) -> int | None:
    """Power of ten that mends the cell, as a wrong unit or a lost decimal point would need."""
    for repair in item.repairs:
        for power in (-6, -3, -2, -1, 1, 2, 3, 6):
            scaled, slack = item.printed * 10.0**power, column.rounding * 10.0**power + column.rounding
            if repair.metric == item.metric and repair.low - slack <= scaled <= repair.high + slack:
                return power
    return None


def _of_rows(table: PublishedTable, known: Repeatability) -> list[Contradiction]:
    found = []
    for row in table.rows:
        spans = table.spans(row)
        sets = list(contradictions(spans, known.bounds))
        mended = _repairs(table, row, repairs(spans, known.bounds)) if len(sets) == 1 else ()
        found += [_of_cells(table, row, names, mended, known) for names in sets]
    return found


def total_contradictions(table: PublishedTable) -> tuple[Contradiction, ...]:
    """Sums of energies that the rows, each within its rounding, cannot give."""
    found = []
    total = table.total or TableRow(math.nan, {})
    for metric, printed in total.cells.items():
        column = table.columns[metric]
        cells = [row.cells[metric] for row in table.rows if metric in row.cells]
        slack = len(cells) * column.rounding
        whole = len(cells) == len(table.rows)  # rows without the cell can only add to the sum
        span = Span(sum(cells) - slack, sum(cells) + slack if whole else math.inf)
        missed = _missed(span, printed, column)
        if missed > 1e-9 * printed:
            sentence = (
                f"total of {metric}: {column.text(printed)} is printed, but the {len(cells)} rows add up to "
                f"{_range(span, column)}; missed by {_fine(missed, column)}."
            )
            line = total.lines.get(metric)
            found.append(
                Contradiction("total", None, (metric,), metric, printed, column.unit, span, missed, sentence, line=line)
            )
    return tuple(found)


def _of_cells(
    table: PublishedTable, row: TableRow, names: tuple[str, ...], mended: tuple[Repair, ...], known: Repeatability
) -> Contradiction:
    """Put one contradiction in a sentence, seen from the cell that needs the smallest change."""
    metric = mended[0].metric if mended else names[-1]
    column, printed = table.columns[metric], row.cells[metric]
    others = [name for name in names if name != metric]
    spans = table.spans(row)
    span = allowed({name: spans[name] for name in others}, known.bounds, metric) or Span(0.0, math.inf)
    span = Span(span.low / column.factor, span.high / column.factor)
    missed = _missed(span, printed, column)
    by = " and ".join(f"{name} {table.cell(row, name)}" for name in others)
    sentence = (
        f"{load_text(row.load)}, {metric}: {column.text(printed)} is printed, but {by or 'conservation of energy'} "
        f"allow{'s' if len(others) < 2 else ''} {_range(span, column)}, missed by {_fine(missed, column)} after rounding: "
        f"{_reason(set(names), spans, known)}."
    )
    line = row.lines.get(metric)
    return Contradiction("row", row.load, names, metric, printed, column.unit, span, missed, sentence, mended, line)


def _reason(cells: set[str], spans: Mapping[str, Span], known: Repeatability) -> str:
    """Why these cells cannot all be true, by the law that connects them."""
    for kind in ("energy", "power"):
        for eta, pair in RATIOS.items():
            part, of = (name.replace("energy", kind) for name in pair)
            if cells == {part, of, eta}:
                middle = (spans[part].low + spans[part].high) / (spans[of].low + spans[of].high)
                return (
                    f"{part} / {of} is {middle:.4f}, which differs from {eta} by at least "
                    f"{_apart(spans[part].over(spans[of]), spans[eta])}, and over {known.basis} the two can differ by "
                    f"{percent(known.bounds.ratio)}"
                )
            if cells == {part, of}:
                return f"{part} cannot exceed {of}"
    if cells == {"eta_trans", "eta_gen", "eta_pto"}:
        trans, gen = spans["eta_trans"], spans["eta_gen"]
        return (
            "eta_pto and eta_trans eta_gen differ by at least "
            f"{_apart(spans['eta_pto'], Span(trans.low * gen.low, trans.high * gen.high))}, and over {known.basis} they can "
            f"differ by {percent(known.bounds.product)}"
        )
    for one, other in itertools.combinations(STAGES, 2):
        if cells == {f"energy_{one}", f"power_{one}", f"energy_{other}", f"power_{other}"}:
            return (
                f"energy over power gives a window of {_seconds(spans, one)} for {one} and of {_seconds(spans, other)} for "
                f"{other}, and all stages share one"
            )
    if len(cells) == 1:
        return "no stage gives out more than it takes in"
    return "E = P t with one window, the efficiencies and what the scatter of the cycles allows leave no common values"


def _apart(quotient: Span, reference: Span) -> str:
    """Smallest share by which a value of the one differs from a value of the other, in percent."""
    return percent(max(quotient.low / reference.high - 1.0, 1.0 - quotient.high / max(reference.low, 1e-300), 0.0))


def _repairs(table: PublishedTable, row: TableRow, spans: Mapping[str, Span]) -> tuple[Repair, ...]:
    """Turn the values that mend a row into those that would be printed for them; the smallest change first."""
    found = []
    for metric, span in spans.items():
        column = table.columns[metric]
        step = 2.0 * column.rounding
        low = max(math.ceil((span.low / column.factor - column.rounding) / step - 1e-9) * step, 0.0)
        high = span.high
        if math.isfinite(high):
            high = math.floor((high / column.factor + column.rounding) / step + 1e-9) * step
        first, last = (f"{end:.{max(column.decimals, 0)}f}" for end in (low, high))
        text = first if first == last else f"at least {first}" if math.isinf(high) else f"{first} to {last}"
        changed = max(low - row.cells[metric], row.cells[metric] - high) / column.rounding
        found.append((changed, Repair(metric, low, high, text + unit_suffix(column.unit))))
    return tuple(repair for _, repair in sorted(found, key=lambda item: item[0]))


def percent(share: float) -> str:
    """A share in percent, with two decimals.

    >>> percent(0.00314)
    '0.31 %'
    """
    return f"{100.0 * share:.2f} %"


def _missed(span: Span, printed: float, column: PrintedColumn) -> float:
    """Gap between an interval and what rounds to the printed value, in the unit of the column."""
    return max(span.low - (printed + column.rounding), printed - column.rounding - span.high, 0.0)


def _fine(value: float, column: PrintedColumn) -> str:
    """A gap with two digits, in the unit of the column."""
    decimals = max(0, 1 - math.floor(math.log10(value))) if value > 0 else 0
    return f"{value:.{decimals}f}{unit_suffix(column.unit)}"


def _range(span: Span, column: PrintedColumn) -> str:
    """An interval with one decimal more than is printed."""
    low, high = (f"{end:.{max(column.decimals + 1, 0)}f}" for end in (span.low, span.high))
    unit = unit_suffix(column.unit)
    if math.isinf(span.high):
        return f"{low}{unit} or more"
    return f"at most {high}{unit}" if span.low <= 0 else f"{low} to {high}{unit}"


def _seconds(spans: Mapping[str, Span], stage: str) -> str:
    span = stage_window(spans, stage)
    return "unknown length" if span is None else f"{span.low:.4g} to {span.high:.4g} s"


def audit(
    table: PublishedTable | PointTable | str | Path,
    *,
    physics: bool = False,
    rig: Rig | str | Path | None = None,
    watch: Watch | None = None,
) -> Audit | PointAudit:
    """Check a published table and its text for contradictions, without any log.

    Parameters
    ----------
    table : a table by load or of operating points, its file, or the name of a built-in table
    physics : also compare a table by load with the model of a rig; the result is the field `physics`
    rig : of that comparison: a rig, its file, or the name of a built-in one; that of the paper if not given
    watch : called with the progress of that comparison

    Raises
    ------
    TableError : the table cannot be used
    OptionError : `physics` with a table of operating points, or a rig without `physics`
    """
    check_arguments("audit", ("physics", physics, FLAG), ("watch", watch, WATCH))
    if not isinstance(rig, Rig):
        check_arguments("audit", ("rig", rig, PATH_OR_NONE))
    if rig is not None and not physics:
        name = rig.name if isinstance(rig, Rig) else rig
        raise OptionError(f"rig {name}: is of use with physics alone; add that, or leave the rig out.")
    opened = open_table(table)
    if isinstance(opened, PublishedTable):
        found = audit_by_load(opened)
        return msgspec.structs.replace(found, physics=_physics(found, rig, watch)) if physics else found
    if physics:
        name = opened.path or opened.name
        raise OptionError(f"physics: {name} is a table of operating points; expected one of loads; leave physics out.")
    return audit_points(opened)


def _physics(found: Audit, rig: Rig | str | Path | None, watch: Watch | None) -> AttainableRanges:
    """What a rig can attain of the efficiencies of a table."""
    from winchcascade.core.rig_toml import DEFAULT_RIG
    from winchcascade.reduction.reduce import first_metrics
    from winchcascade.rig.baseline import load_rig
    from winchcascade.rig.effects.catalogue import OF_THE_RIG
    from winchcascade.tables.attainable import attainable_ranges

    of = rig if isinstance(rig, Rig) else load_rig(rig or DEFAULT_RIG)
    return attainable_ranges(
        found.table, of, OF_THE_RIG, lambda run, window: first_metrics(run, of, window), scatter=found.known.eta, watch=watch
    )  # fmt: skip
