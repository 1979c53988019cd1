"""The integration windows that a table does not print, recovered from its energies and powers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from winchcascade.core.published_table import Span, Table
from winchcascade.tables.row_audit import window


class RecoveredWindow(msgspec.Struct, frozen=True):
    """RecoveredWindow of one row, as the interval that its energies and powers leave; None where they leave none. [s]"""

    load: float
    span: Span | None


class SharedWindow(msgspec.Struct, frozen=True):
    """Rows that can have the same window: what all of them leave, and the number of fewest decimals in it. [s]"""

    loads: tuple[float, ...]
    span: Span
    shortest: float


def windows(table: Table) -> tuple[RecoveredWindow, ...]:
    """RecoveredWindow of every row that prints an energy and a power of the same stage (E = P t)."""
    return tuple(
        RecoveredWindow(row.load, window(table.spans(row)))
        for row in table.rows
        if any(f"energy_{s}" in row.cells and f"power_{s}" in row.cells for s in ("line", "mech", "gen"))
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
        span = Span(max(item[0].low for item in group), last)
        loads = tuple(load for load in (w.load for w in found) if any(load == item[1] for item in group))
        groups.append(SharedWindow(loads, span, shortest(span)))
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
