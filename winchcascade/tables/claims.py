"""What a text says of its table, held against the rows: confirmed, contradicted, or not to be told from the table."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from typing import Any, Literal

import msgspec

from winchcascade.core.published_table import (
    DEVIATIONS,
    BoundClaim,
    Claim,
    Column,
    LargestClaim,
    RisesClaim,
    Row,
    ShareClaim,
    Span,
    Table,
    ValueClaim,
    load_text,
    same_load,
    unit_suffix,
)
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.feasible import allowed, is_feasible
from winchcascade.tables.ratio_of_means import Repeatability
from winchcascade.tables.row_audit import window

Verdict = Literal["confirmed", "contradicted", "not_checkable"]


class ClaimVerdict(msgspec.Struct, frozen=True):
    """A claim, whether the table bears it out, and why in one sentence."""

    claim: Claim
    verdict: Verdict
    sentence: str


def claim_verdict(claim: Claim, table: Table, known: Repeatability) -> ClaimVerdict:
    """Hold one claim against the rows."""
    verdict, sentence = _JUDGES[type(claim)](claim, table, known)
    return ClaimVerdict(claim, verdict, sentence)


def _value(claim: ValueClaim, table: Table, known: Repeatability) -> tuple[Verdict, str]:
    row = table.row(claim.load)
    said, place = claim.column.text(claim.value), f"{load_text(claim.load)}, {claim.metric}"
    if row is None:
        return "not_checkable", f"{place}: the text says {said}, and the table has no row of this load."
    spans, span = table.spans(row), claim.column.span(claim.value)
    rest = {name: cell for name, cell in spans.items() if name != claim.metric}
    if claim.metric not in row.cells:
        return _beside(place, said, allowed(rest, known.bounds, claim.metric), span, claim.column)
    cell = table.cell(row, claim.metric)
    if span.meets(spans[claim.metric]):
        return "confirmed", f"{place}: the text says {said}, and the table prints {cell}."
    sentence = f"{place}: the text says {said}, but the table prints {cell}"
    table_fits, text_fits = (
        is_feasible(rest | {claim.metric: one}, known.bounds) for one in (spans[claim.metric], span)
    )
    column = table.columns[claim.metric]
    leaves = _leaves(allowed(rest, known.bounds, claim.metric), column)
    if table_fits and not text_fits:
        return (
            "contradicted",
            f"{sentence}. {cell} is consistent with the rest of its row{leaves}; {said} {_needs(claim, row, table)}.",
        )
    if text_fits and not table_fits:
        return "contradicted", f"{sentence}. {said} is consistent with the rest of the row{leaves}, {cell} is not."
    both = "both are" if text_fits else "neither is"
    return "contradicted", f"{sentence}; {both} consistent with the rest of the row{leaves}."  # fmt: skip


def _beside(place: str, said: str, span: Span | None, claimed: Span, column: Column) -> tuple[Verdict, str]:
    """Judge a value of which the table prints no cell, by what the other cells of the row allow."""
    if span is None or (span.low <= 0 and math.isinf(span.high)):
        why = "and its row contradicts itself" if span is None else "and nothing in the row confines it"
        return "not_checkable", f"{place}: the text says {said}; the table has no such cell, {why}."
    fits = span.meets(claimed)
    verdict: Verdict = "confirmed" if fits else "contradicted"
    return verdict, f"{place}: the text says {said}, {'and' if fits else 'but'} the row allows {_text(span, column)}."


def _leaves(span: Span | None, column: Column) -> str:
    return "" if span is None else f", which leaves {_text(span, column)}"


def _needs(claim: ValueClaim, row: Row, table: Table) -> str:
    """What the row would have to be for a claimed value, against what it prints: efficiencies and the window."""
    value = claim.value * claim.column.factor
    cells = {name: printed * table.columns[name].factor for name, printed in row.cells.items()}
    needs = []
    for eta, (out, into) in RATIOS.items():
        for kind in ("energy", "power"):
            part, of = out.replace("energy", kind), into.replace("energy", kind)
            if eta in cells and claim.metric in (part, of) and {part, of} <= set(cells):
                both = cells | {claim.metric: value}
                ratio = f"{both[part] / both[of]:.3f}" if both[of] > 0 else "without end"
                needs.append(f"{eta} {ratio} where {table.cell(row, eta)} is printed")
    kind, _, stage = claim.metric.partition("_")
    other = f"{'power' if kind == 'energy' else 'energy'}_{stage}"
    span = window({name: cell for name, cell in table.spans(row).items() if not name.endswith(f"_{stage}")})
    if kind != "eta" and cells.get(other, 0.0) > 0 and span is not None and value > 0:
        seconds = value / cells[other] if kind == "energy" else cells[other] / value
        needs.append(f"a window of {seconds:.2f} s where the other stages have {0.5 * (span.low + span.high):.2f} s")
    return f"needs {', '.join(needs)}" if needs else "is not"


def _share(claim: ShareClaim, table: Table, known: Repeatability) -> tuple[Verdict, str]:
    row = table.row(claim.load)
    said = claim.column.text(claim.value)
    place = f"{load_text(claim.load)}, {claim.part} out of {claim.of}"
    if row is None:
        return "not_checkable", f"{place}: the text says {said}, and the table has no row of this load."
    span = claim.column.span(claim.value)
    readings = {eta: found for eta in RATIOS for found in [_reading(eta, row, table, known)] if found is not None}
    stages = tuple(name.partition("_")[2] for name in (claim.part, claim.of))
    meant = next(eta for eta, pair in RATIOS.items() if tuple(n.partition("_")[2] for n in pair) == stages)
    if meant not in readings:
        return "not_checkable", f"{place}: the text says {said}; the row does not tell {meant}."
    if span.meets(readings[meant]):
        return (
            "confirmed",
            f"{place}: the text says {said}, and the row gives {_text(readings[meant], claim.column)} ({meant}).",
        )
    fitting = [
        f"{eta}, {out.partition('_')[2]} out of {into.partition('_')[2]} ({_text(readings[eta], claim.column)})"
        for eta, (out, into) in RATIOS.items()
        if eta in readings and span.meets(readings[eta])
    ]
    sentence = f"{place}: the text says {said}, but the row gives {_text(readings[meant], claim.column)} ({meant})"
    return "contradicted", f"{sentence}; {said} is {' or '.join(fitting)}." if fitting else f"{sentence}."


def _reading(eta: str, row: Row, table: Table, known: Repeatability) -> Span | None:
    """What a row gives for a share, as mean of ratios and as ratio of means together. [1]"""
    spans = table.spans(row)
    found = [spans[eta]] if eta in spans else []
    out, into = RATIOS[eta]
    if is_feasible(spans, known.bounds):
        quotient = allowed(spans, known.bounds, out, into)
        found += [] if quotient is None or math.isinf(quotient.high) else [quotient]
    elif out in spans and into in spans and spans[into].low > 0:
        found.append(Span(spans[out].low / spans[into].high, spans[out].high / spans[into].low))
    return Span(min(s.low for s in found), max(s.high for s in found)) if found else None


def _bound(claim: BoundClaim, table: Table, known: Repeatability) -> tuple[Verdict, str]:
    said = f"{claim.side.replace('_', ' ')} {claim.column.text(claim.value)}"
    if claim.metric in DEVIATIONS:
        return _deviation(claim, table, known, said)
    rows = [row for row in table.rows if claim.load is None or same_load(row.load, claim.load)]
    cells = [(row, table.span(claim.metric, row.cells[claim.metric])) for row in rows if claim.metric in row.cells]
    if not cells:
        return "not_checkable", f"{claim.metric}: the text says {said}, and the table has no cell for it."
    sign = 1.0 if claim.side == "at_most" else -1.0
    limit, slack = sign * claim.value * claim.column.factor, claim.column.rounding * claim.column.factor
    row, span = max(cells, key=lambda cell: sign * (cell[1].low + cell[1].high))
    place = f"{load_text(row.load)}, {claim.metric}: the text says {said}"
    cell = table.cell(row, claim.metric)
    nearest, farthest = sorted((sign * span.low, sign * span.high))
    if nearest > limit + slack:
        return "contradicted", f"{place}, but the table prints {cell}."
    if farthest <= limit + slack:
        return "confirmed", f"{place}, and the table prints {cell}{'' if len(cells) == 1 else ' as its extreme'}."
    return "not_checkable", f"{place}; the printed {cell} lies within its rounding of that."


def _deviation(claim: BoundClaim, table: Table, known: Repeatability, said: str) -> tuple[Verdict, str]:
    """Judge a claimed deviation: a table of means tells it only by rows that need more scatter than that."""
    name = next(d for d in DEVIATIONS if d == claim.metric)
    printed = table.deviations.get(name)
    place = f"{claim.metric}: the text says {said}"
    if printed is not None and not printed[1].span(printed[0]).meets(claim.column.span(claim.value)):
        return "contradicted", f"{place}, but the table file gives {printed[1].text(printed[0])} as {name}_percent."
    odd = [load_text(row.load) for row in table.rows if not is_feasible(table.spans(row), known.bounds)]
    but = f" but {', '.join(odd)}" if odd else ""
    return "not_checkable", f"{place}; means alone cannot confirm it, and all rows{but} are consistent with it."


def _largest(claim: LargestClaim, table: Table, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    said = (
        f"{', '.join(claim.metrics)}: the text says largest at {' and '.join(load_text(load) for load in claim.loads)}"
    )
    pairs = []
    for metric in claim.metrics:
        rows = [row for row in table.rows if metric in row.cells]
        inside = [row for row in rows if any(same_load(row.load, load) for load in claim.loads)]
        if len(inside) < len(claim.loads):
            return "not_checkable", f"{said}, and the table lacks a cell there."
        pairs += [(metric, other, row) for row in inside for other in rows if other not in inside]
    return _ordered(pairs, table, said)


def _rises(claim: RisesClaim, table: Table, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    said = f"{', '.join(claim.metrics)}: the text says rising from {load_text(claim.first)} to {load_text(claim.last)}"
    low, high = sorted((claim.first, claim.last))
    pairs = []
    for metric in claim.metrics:
        rows = [row for row in table.rows if metric in row.cells]
        ends = all(any(same_load(row.load, load) for row in rows) for load in (low, high))
        if not ends:
            return "not_checkable", f"{said}, and the table lacks a cell there."
        between = [r for r in rows if same_load(r.load, low) or same_load(r.load, high) or low < r.load < high]
        between.sort(key=lambda row: row.load, reverse=claim.first > claim.last)
        pairs += [(metric, one, other) for one, other in itertools.pairwise(between)]
    return _ordered(pairs, table, said)


def _ordered(pairs: list[tuple[str, Row, Row]], table: Table, said: str) -> tuple[Verdict, str]:
    """Judge whether in every pair of rows the second one's cell is the larger."""
    unsure = ""
    for metric, less, more in pairs:
        small, large = (table.span(metric, row.cells[metric]) for row in (less, more))
        both = f"{table.cell(less, metric)} at {load_text(less.load)} and {table.cell(more, metric)} at {load_text(more.load)}"
        if small.low >= large.high:
            return "contradicted", f"{said}, but the table prints {metric} {both}."
        if small.high > large.low:
            unsure = unsure or f"{said}; {metric} {both} are the same within rounding."
    return ("not_checkable", unsure) if unsure else ("confirmed", f"{said}, and the cells bear it out.")


def _text(span: Span, column: Column) -> str:
    """An interval in SI units as a text, in the unit of a column with one decimal more."""
    decimals = max(column.decimals + 1, 0)
    low, high = (f"{end / column.factor:.{decimals}f}" for end in (span.low, span.high))
    return f"{low if low == high else f'{low} to {high}'}{unit_suffix(column.unit)}"


_JUDGES: Mapping[type[Any], Callable[[Any, Table, Repeatability], tuple[Verdict, str]]] = {
    ValueClaim: _value,
    ShareClaim: _share,
    BoundClaim: _bound,
    LargestClaim: _largest,
    RisesClaim: _rises,
}
