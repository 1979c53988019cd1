"""The claims of a text compared with the rows of its table: confirmed, contradicted, or not verifiable from the table."""

from __future__ import annotations

import itertools
import math
from typing import Literal

import msgspec

from winchcascade.core.quantity import load_text
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.feasible import Repeatability, allowed, is_feasible
from winchcascade.tables.published_table import DEVIATIONS, SHARES, Claim, PublishedTable, Span, TableRow

Verdict = Literal["confirmed", "contradicted", "not_checkable"]


class ClaimVerdict(msgspec.Struct, frozen=True):
    """A claim, whether the table confirms it, and the reason in one sentence."""

    claim: Claim
    verdict: Verdict
    sentence: str


def claim_verdict(claim: Claim, table: PublishedTable, known: Repeatability) -> ClaimVerdict:
    """Compare one claim with the rows."""
    names = " out of ".join(claim.metrics) if claim.kind == "part" else ", ".join(claim.metrics)
    if claim.kind in ("largest_at_ohm", "rises_from_ohm"):
        what = "largest at" if claim.kind == "largest_at_ohm" else "rising from"
        joint = " and " if claim.kind == "largest_at_ohm" else " to "
        said, judge = f"{what} {joint.join(map(load_text, claim.loads))}", _order
    elif claim.kind.startswith("at_"):
        said, judge = f"{claim.kind.replace('_', ' ')} {claim.number.words}", _bound
    else:
        said, judge = f"{claim.number.words} at {load_text(claim.loads[0])}", _share if claim.kind == "part" else _value
    verdict, reason = judge(claim, table, known)
    return ClaimVerdict(claim, verdict, f"{names}: the text states {said}; {reason}.")


def _value(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    """A value at a load, against its cell and what the rest of the row allows."""
    row, metric, span = table.row(claim.loads[0]), claim.metrics[0], claim.number.span
    if row is None:
        return "not_checkable", "the table has no row of this load"
    rest = {name: cell for name, cell in row.spans.items() if name != metric}
    left = allowed(rest, known, metric)
    if metric not in row.spans:
        if left is None or (left.low <= 0.0 and math.isinf(left.high)):
            return "not_checkable", "the table has no such cell, and its row does not confine it"
        return "confirmed" if left.meets(span) else "contradicted", f"the row allows {claim.number.range(left)}"
    cell = row.cells[metric]
    if cell.span.meets(span):
        return "confirmed", f"the table prints {cell.words}"
    leaves = "" if left is None else f", which leaves {cell.range(left)}"
    fits = {words: is_feasible(rest | {metric: one}, known)
            for words, one in ((cell.words, cell.span), (claim.number.words, span))}  # fmt: skip
    consistent = [words for words, fit in fits.items() if fit]
    which = f"{consistent[0]} is" if len(consistent) == 1 else "both are" if consistent else "neither is"
    return "contradicted", f"the table prints {cell.words}; {which} consistent with the rest of the row{leaves}"


def _share(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    """A share of an energy or a power that arrives at a later stage, against the efficiency between the two."""
    row, meant = table.row(claim.loads[0]), SHARES[claim.metrics]
    readings = {} if row is None else {eta: span for eta in RATIOS if (span := _reading(eta, row, known)) is not None}
    if meant not in readings:
        return "not_checkable", f"the table does not state {meant} there"
    gives = f"the row gives {claim.number.range(readings[meant])} ({meant})"
    fitting = [eta for eta, span in readings.items() if claim.number.span.meets(span)]
    if meant in fitting:
        return "confirmed", gives
    others = " or ".join(f"{eta} ({claim.number.range(readings[eta])})" for eta in fitting)
    return "contradicted", f"{gives}; {claim.number.words} is {others}" if others else gives


def _reading(eta: str, row: TableRow, known: Repeatability) -> Span | None:
    """What a row gives for a share, as mean of ratios and as ratio of means together. [1]"""
    spans, (out, into) = row.spans, RATIOS[eta]
    found = [spans[eta]] if eta in spans else []
    if is_feasible(spans, known):
        quotient = allowed(spans, known, out, into)
        found += [] if quotient is None or math.isinf(quotient.high) else [quotient]
    elif out in spans and into in spans and spans[into].low > 0:
        found.append(spans[out].over(spans[into]))
    return Span(min(s.low for s in found), max(s.high for s in found)) if found else None


def _bound(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    """A bound on a metric in all rows or in one, or on the deviation of the cycles, which means confine by their rows alone."""
    metric = claim.metrics[0]
    if metric in DEVIATIONS:
        printed = table.deviations.get(metric)
        if printed is not None and not printed.span.meets(claim.number.span):
            return "contradicted", f"the table file gives {printed.words} as {metric}_percent"
        odd = ", ".join(row.name for row in table.rows if not is_feasible(row.spans, known))
        return (
            "not_checkable",
            f"means cannot confirm it; all rows{f' but {odd}' if odd else ''} are consistent with it",
        )
    rows = table.rows if not claim.loads else [table.row(claim.loads[0])]
    cells = [(row, row.cells[metric]) for row in rows if row is not None and metric in row.cells]
    if not cells:
        return "not_checkable", "the table has no cell for it"
    sign = 1.0 if claim.kind == "at_most" else -1.0
    limit = sign * claim.number.value * claim.number.factor + claim.number.rounding * claim.number.factor
    row, cell = max(cells, key=lambda item: sign * (item[1].span.low + item[1].span.high))
    nearest, farthest = sorted((sign * cell.span.low, sign * cell.span.high))
    verdict: Verdict = "contradicted" if nearest > limit else "confirmed" if farthest <= limit else "not_checkable"
    return verdict, f"the table prints {cell.words} at {row.name}"


def _order(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    """Which of two cells is the larger: those at some loads than all others, or each than the one before it."""
    pairs = []
    for metric in claim.metrics:
        rows = [row for row in table.rows if metric in row.cells]
        at = [row for load in claim.loads if (row := table.row(load)) is not None and row in rows]
        if len(at) < len(claim.loads):
            return "not_checkable", "the table lacks a cell there"
        if claim.kind == "largest_at_ohm":
            pairs += [(metric, other, row) for row in at for other in rows if other not in at]
        else:
            low, high = sorted(claim.loads)
            run = sorted((row for row in rows if low <= (row.load or 0.0) <= high), key=lambda row: row.load or 0.0)
            run = run if claim.loads[0] < claim.loads[1] else run[::-1]
            pairs += [(metric, *pair) for pair in itertools.pairwise(run)]
    unsure = ""
    for metric, less, more in pairs:
        small, large = less.cells[metric].span, more.cells[metric].span
        both = " and ".join(f"{metric} {row.cells[metric].words} at {row.name}" for row in (less, more))
        if small.low >= large.high:
            return "contradicted", f"the table prints {both}"
        if small.high > large.low:
            unsure = unsure or f"{both} are the same within rounding"
    return ("not_checkable", unsure) if unsure else ("confirmed", "the cells bear it out")
