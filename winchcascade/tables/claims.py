"""The claims of a text compared with the rows of its table: confirmed, contradicted, or not verifiable from the table."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Literal

import msgspec

from winchcascade.core.published_table import (
    DEVIATIONS,
    Claim,
    PrintedColumn,
    PublishedTable,
    Span,
    TableRow,
    load_text,
    same_load,
    unit_suffix,
)
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.feasible import Repeatability, allowed, is_feasible, window

Verdict = Literal["confirmed", "contradicted", "not_checkable"]


class ClaimVerdict(msgspec.Struct, frozen=True):
    """A claim, whether the table confirms it, and the reason in one sentence."""

    claim: Claim
    verdict: Verdict
    sentence: str


def claim_verdict(claim: Claim, table: PublishedTable, known: Repeatability) -> ClaimVerdict:
    """Compare one claim with the rows."""
    return ClaimVerdict(claim, *_JUDGES[claim.kind](claim, table, known))


def _placed(claim: Claim, what: str) -> str:
    """Where a claim about one row applies, and what the text states."""
    return f"{load_text(claim.load)}, {what}: the text states {claim.column.text(claim.number)}"


def _without_row(place: str) -> tuple[Verdict, str]:
    """The verdict on a claim about a load that the table lacks."""
    return "not_checkable", f"{place}, and the table has no row of this load."


def _value(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    place, row = _placed(claim, claim.metrics[0]), table.row(claim.load)
    if row is None:
        return _without_row(place)
    said = claim.column.text(claim.number)
    spans, span = table.spans(row), claim.column.span(claim.number)
    if claim.metrics[0] in spans and span.meets(spans[claim.metrics[0]]):
        return "confirmed", f"{place}, and the table prints {table.cell(row, claim.metrics[0])}."
    rest = {name: cell for name, cell in spans.items() if name != claim.metrics[0]}
    left = allowed(rest, known.bounds, claim.metrics[0])
    if claim.metrics[0] not in spans:
        return _beside(place, left, span, claim.column)
    cell = table.cell(row, claim.metrics[0])
    table_fits, text_fits = (
        is_feasible(rest | {claim.metrics[0]: one}, known.bounds) for one in (spans[claim.metrics[0]], span)
    )
    leaves = "" if left is None else f", which leaves {_text(left, table.columns[claim.metrics[0]])}"
    if table_fits and not text_fits:
        reason = f". {cell} is consistent with the rest of its row{leaves}; {said} {_needs(claim, row, table)}"
    elif text_fits and not table_fits:
        reason = f". {said} is consistent with the rest of the row{leaves}, {cell} is not"
    else:
        reason = f"; {'both are' if text_fits else 'neither is'} consistent with the rest of the row{leaves}"
    return "contradicted", f"{place}, but the table prints {cell}{reason}."


def _beside(place: str, left: Span | None, claimed: Span, column: PrintedColumn) -> tuple[Verdict, str]:
    """Judge a value of which the table prints no cell, by what the other cells of the row allow."""
    if left is None:
        return "not_checkable", f"{place}; the table has no such cell, and its row contradicts itself."
    if left.low <= 0 and math.isinf(left.high):
        return "not_checkable", f"{place}; the table has no such cell, and nothing in the row confines it."
    if left.meets(claimed):
        return "confirmed", f"{place}, and the row allows {_text(left, column)}."
    return "contradicted", f"{place}, but the row allows {_text(left, column)}."


def _needs(claim: Claim, row: TableRow, table: PublishedTable) -> str:
    """Efficiencies and window that a claimed value requires, beside those that the row prints."""
    value = claim.number * claim.column.factor
    cells = {name: printed * table.columns[name].factor for name, printed in row.cells.items()}
    kind, _, stage = claim.metrics[0].partition("_")
    needs = []
    for eta, pair in RATIOS.items():
        part, of = (name.replace("energy", kind) for name in pair)
        if claim.metrics[0] in (part, of) and {part, of, eta} <= set(cells):
            both = cells | {claim.metrics[0]: value}
            ratio = f"{both[part] / both[of]:.3f}" if both[of] > 0 else "without end"
            needs.append(f"{eta} {ratio} where {table.cell(row, eta)} is printed")
    other = cells.get(f"{'power' if kind == 'energy' else 'energy'}_{stage}", 0.0)
    span = window({name: cell for name, cell in table.spans(row).items() if not name.endswith(f"_{stage}")})
    if kind != "eta" and other > 0 and span is not None and value > 0:
        seconds = value / other if kind == "energy" else other / value
        needs.append(f"a window of {seconds:.2f} s where the other stages have {0.5 * (span.low + span.high):.2f} s")
    return f"needs {', '.join(needs)}" if needs else "is not"


def _share(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    place, row = _placed(claim, f"{claim.part} out of {claim.of}"), table.row(claim.load)
    if row is None:
        return _without_row(place)
    readings = {eta: found for eta in RATIOS if (found := _reading(eta, row, table, known)) is not None}
    stages = {eta: tuple(name.partition("_")[2] for name in pair) for eta, pair in RATIOS.items()}
    meant = next(eta for eta in RATIOS if stages[eta] == (claim.part.partition("_")[2], claim.of.partition("_")[2]))
    if meant not in readings:
        return "not_checkable", f"{place}; the row does not state {meant}."
    texts = {eta: _text(found, claim.column) for eta, found in readings.items()}
    fitting = [eta for eta in readings if claim.column.span(claim.number).meets(readings[eta])]
    if meant in fitting:
        return "confirmed", f"{place}, and the row gives {texts[meant]} ({meant})."
    others = " or ".join(f"{eta}, {stages[eta][0]} out of {stages[eta][1]} ({texts[eta]})" for eta in fitting)
    sentence = f"{place}, but the row gives {texts[meant]} ({meant})"
    return "contradicted", f"{sentence}; {claim.column.text(claim.number)} is {others}." if others else f"{sentence}."


def _reading(eta: str, row: TableRow, table: PublishedTable, known: Repeatability) -> Span | None:
    """What a row gives for a share, as mean of ratios and as ratio of means together. [1]"""
    spans = table.spans(row)
    found = [spans[eta]] if eta in spans else []
    out, into = RATIOS[eta]
    if is_feasible(spans, known.bounds):
        quotient = allowed(spans, known.bounds, out, into)
        found += [] if quotient is None or math.isinf(quotient.high) else [quotient]
    elif out in spans and into in spans and spans[into].low > 0:
        found.append(spans[out].over(spans[into]))
    return Span(min(s.low for s in found), max(s.high for s in found)) if found else None


def _bound(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    said = f"the text states {claim.kind.replace('_', ' ')} {claim.column.text(claim.number)}"
    if claim.metrics[0] in DEVIATIONS:
        return _deviation(claim, table, known, f"{claim.metrics[0]}: {said}")
    cells = [
        (row, table.span(claim.metrics[0], row.cells[claim.metrics[0]]))
        for row in table.rows
        if claim.metrics[0] in row.cells and (math.isnan(claim.load) or same_load(row.load, claim.load))
    ]
    if not cells:
        return "not_checkable", f"{claim.metrics[0]}: {said}, and the table has no cell for it."
    sign = 1.0 if claim.kind == "at_most" else -1.0
    limit = sign * claim.number * claim.column.factor + claim.column.rounding * claim.column.factor
    row, span = max(cells, key=lambda cell: sign * (cell[1].low + cell[1].high))
    place, cell = f"{load_text(row.load)}, {claim.metrics[0]}: {said}", table.cell(row, claim.metrics[0])
    nearest, farthest = sorted((sign * span.low, sign * span.high))
    if nearest > limit:
        return "contradicted", f"{place}, but the table prints {cell}."
    if farthest <= limit:
        return "confirmed", f"{place}, and the table prints {cell}{'' if len(cells) == 1 else ' as its extreme'}."
    return "not_checkable", f"{place}; the printed {cell} lies within its rounding of that."


def _deviation(claim: Claim, table: PublishedTable, known: Repeatability, said: str) -> tuple[Verdict, str]:
    """Judge a claimed deviation: a table of means confines it only by rows that need more scatter than that."""
    name = next(d for d in DEVIATIONS if d == claim.metrics[0])
    printed = table.deviations.get(name)
    if printed is not None and not printed[1].span(printed[0]).meets(claim.column.span(claim.number)):
        return "contradicted", f"{said}, but the table file gives {printed[1].text(printed[0])} as {name}_percent."
    odd = [load_text(row.load) for row in table.rows if not is_feasible(table.spans(row), known.bounds)]
    but = f" but {', '.join(odd)}" if odd else ""
    return "not_checkable", f"{said}; means alone cannot confirm it, and all rows{but} are consistent with it."


def _largest(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    loads = " and ".join(load_text(load) for load in claim.loads)
    said = f"{', '.join(claim.metrics)}: the text states largest at {loads}"
    return _ordered(
        said, claim, claim.loads, table, lambda at, others: [(other, row) for row in at for other in others]
    )


def _rises(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    said = (
        f"{', '.join(claim.metrics)}: the text states rising from {load_text(claim.first)} to {load_text(claim.last)}"
    )
    low, high = sorted((claim.first, claim.last))

    def steps(ends: list[TableRow], others: list[TableRow]) -> Iterable[tuple[TableRow, TableRow]]:
        between = [*ends, *(row for row in others if low < row.load < high)]
        return itertools.pairwise(sorted(between, key=lambda row: row.load, reverse=claim.first > claim.last))

    return _ordered(said, claim, (low, high), table, steps)


def _ordered(
    said: str,
    claim: Claim,
    loads: Sequence[float],
    table: PublishedTable,
    pairs_of: Callable[[list[TableRow], list[TableRow]], Iterable[tuple[TableRow, TableRow]]],
) -> tuple[Verdict, str]:
    """Judge whether in every pair of rows the second one's cell is the larger, for each metric of a claim.

    Parameters
    ----------
    pairs_of : makes the pairs from the rows at the loads and the other rows
    """
    pairs = []
    for metric in claim.metrics:
        rows = [row for row in table.rows if metric in row.cells]
        at = [row for row in rows if any(same_load(row.load, load) for load in loads)]
        if len(at) < len(loads):
            return "not_checkable", f"{said}, and the table lacks a cell there."
        pairs += [(metric, *pair) for pair in pairs_of(at, [row for row in rows if row not in at])]
    unsure = ""
    for metric, less, more in pairs:
        small, large = (table.span(metric, row.cells[metric]) for row in (less, more))
        both = " and ".join(f"{table.cell(row, metric)} at {load_text(row.load)}" for row in (less, more))
        if small.low >= large.high:
            return "contradicted", f"{said}, but the table prints {metric} {both}."
        if small.high > large.low:
            unsure = unsure or f"{said}; {metric} {both} are the same within rounding."
    return ("not_checkable", unsure) if unsure else ("confirmed", f"{said}, and the cells bear it out.")


def _text(span: Span, column: PrintedColumn) -> str:
    """An interval in SI units as a text, in the unit of a column with one decimal more."""
    low, high = (f"{end / column.factor:.{max(column.decimals + 1, 0)}f}" for end in (span.low, span.high))
    return f"{low if low == high else f'{low} to {high}'}{unit_suffix(column.unit)}"


_JUDGES: Mapping[str, Callable[[Claim, PublishedTable, Repeatability], tuple[Verdict, str]]] = {
    "value": _value,
    "part": _share,
    "at_most": _bound,
    "at_least": _bound,
    "loads": _largest,
    "first": _rises,
}
