"""The claims of a text compared with the rows of its table: confirmed, contradicted, or not
verifiable from the table.
"""

from __future__ import annotations

import itertools
import math
from typing import Literal

import msgspec

from winchcascade.core.quantity import load_text
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.feasible import Repeatability, allowed, is_feasible
from winchcascade.tables.published_table import DEVIATIONS, SHARES, Claim, PublishedTable

Verdict = Literal["confirmed", "contradicted", "not_checkable"]


class ClaimVerdict(msgspec.Struct, frozen=True):
    """A claim, whether the table confirms it, and the reason in one sentence."""

    claim: Claim
    verdict: Verdict
    sentence: str


def claim_verdict(claim: Claim, table: PublishedTable, known: Repeatability) -> ClaimVerdict:
    """Compare one claim with the rows."""
    loads, joint = [*map(load_text, claim.loads)], " out of " if claim.kind == "part" else ", "
    if claim.kind in ("largest_at_ohm", "rises_from_ohm"):
        rises = claim.kind == "rises_from_ohm"
        said, judge = (
            f"rising from {' to '.join(loads)}" if rises else f"largest at {' and '.join(loads)}",
            _order,
        )
    elif claim.kind.startswith("at_"):
        said, judge = f"{claim.kind.replace('_', ' ')} {claim.number.words}", _bound
    else:
        said, judge = f"{claim.number.words} at {loads[0]}", _value
    verdict, reason = judge(claim, table, known)
    return ClaimVerdict(
        claim, verdict, f"{joint.join(claim.metrics)}: the text states {said}; {reason}."
    )


def _value(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    """A value at a load, against its cell and what the rest of the row allows; a share may also
    be that of the means.
    """
    row, metric, said = (
        table.row(claim.loads[0]),
        SHARES.get(claim.metrics, claim.metrics[0]),
        claim.number,
    )
    if row is None:
        return "not_checkable", "the table has no row of this load"
    cell, rest = (
        row.cells.get(metric),
        {name: span for name, span in row.spans.items() if name != metric},
    )
    left = allowed(rest, known, *claim.metrics)
    if cell is not None and cell.span.meets(said.span):
        return "confirmed", f"the table prints {metric} {cell.words}"
    bounded = left is not None and (left.low > 0.0 or math.isfinite(left.high))
    if (
        left is not None
        and bounded
        and (cell is None or claim.kind == "part")
        and left.meets(said.span)
    ):
        return "confirmed", f"the row allows {said.range(left)}"
    if cell is None:
        allows = (
            "and its row does not confine it"
            if left is None or not bounded
            else f"and the row allows {said.range(left)}"
        )
        return (
            "contradicted" if bounded else "not_checkable",
            f"the table has no such cell, {allows}",
        )
    others = [
        name
        for name in RATIOS
        if metric in RATIOS and name in row.spans and row.spans[name].meets(said.span)
    ]
    hint = f"; {said.words} is {' or '.join(others)}" if others else ""
    if claim.kind == "part":
        means = f", its means {cell.range(left)}" if left is not None else ""
        return "contradicted", f"the table prints {metric} {cell.words}{means}{hint}"
    fits = [one.words for one in (cell, said) if is_feasible(rest | {metric: one.span}, known)]
    which = f"{fits[0]} is" if len(fits) == 1 else "both are" if fits else "neither is"
    leaves = f", which leaves {cell.range(left)}" if left is not None else ""
    reason = f"the table prints {metric} {cell.words}; {which} consistent with the rest of the row{leaves}{hint}"
    return "contradicted", reason


def _bound(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:
    """A bound on a metric in all rows or in one, or on the deviation of the cycles, which means
    confine by their rows alone.
    """
    metric = claim.metrics[0]
    if metric in DEVIATIONS:
        printed = table.deviations.get(metric)
        if printed is not None and not printed.span.meets(claim.number.span):
            return "contradicted", f"the table file gives {printed.words} as {metric}_percent"
        odd = ", ".join(row.name for row in table.rows if not is_feasible(row.spans, known))
        return (
            "not_checkable",
            f"means cannot confirm it; all rows{f' but {odd}' if odd else ''} are consistent with "
            f"it",
        )
    rows = table.rows if not claim.loads else [table.row(claim.loads[0])]
    cells = [(row, row.cells[metric]) for row in rows if row is not None and metric in row.cells]
    if not cells:
        return "not_checkable", "the table has no cell for it"
    sign = 1.0 if claim.kind == "at_most" else -1.0
    limit = (
        sign * claim.number.value * claim.number.factor
        + claim.number.rounding * claim.number.factor
    )
    row, cell = max(cells, key=lambda item: sign * (item[1].span.low + item[1].span.high))
    nearest, farthest = sorted((sign * cell.span.low, sign * cell.span.high))
    verdict: Verdict = (
        "contradicted" if nearest > limit else "confirmed" if farthest <= limit else "not_checkable"
    )
    return verdict, f"the table prints {cell.words} at {row.name}"


def _order(claim: Claim, table: PublishedTable, known: Repeatability) -> tuple[Verdict, str]:  # noqa: ARG001
    """Which of two cells is the larger: those at some loads than all others, or each than the
    one before it.
    """
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
            run = sorted(
                (row for row in rows if low <= (row.load or 0.0) <= high),
                key=lambda row: row.load or 0.0,
            )
            run = run if claim.loads[0] < claim.loads[1] else run[::-1]
            pairs += [(metric, *pair) for pair in itertools.pairwise(run)]
    unsure = ""
    for metric, less, more in pairs:
        small, large = less.cells[metric].span, more.cells[metric].span
        both = " and ".join(
            f"{metric} {row.cells[metric].words} at {row.name}" for row in (less, more)
        )
        if small.low >= large.high:
            return "contradicted", f"the table prints {both}"
        if small.high > large.low:
            unsure = unsure or f"{both} are the same within rounding"
    return ("not_checkable", unsure) if unsure else ("confirmed", "the cells bear it out")
