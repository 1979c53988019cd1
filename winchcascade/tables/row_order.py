"""Rows of a table by load whose cells are exchanged: each row is consistent, and yet no column
follows the load.

Power, energy and efficiency of a machine have one maximum at most over its load. A cell between two
higher ones, lower by more than the repeatability of means, is in the wrong row; where one exchange
of two rows leaves no such cell, it is found.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from winchcascade.core.run import Signal
from winchcascade.reduction.efficiency import METRICS
from winchcascade.tables.column_laws import MIN_ROWS, ColumnFault
from winchcascade.tables.feasible import Repeatability
from winchcascade.tables.published_table import PublishedTable


def exchanged_rows(table: PublishedTable, known: Repeatability) -> ColumnFault | None:
    """The two rows whose exchange gives every column one maximum at most; None where all have
    it, or several pairs give it.
    """
    rows = sorted(table.rows, key=lambda row: row.load or 0.0)
    columns = []
    for metric in METRICS:
        cells = [(row.cells[metric].value if metric in row.cells else math.nan) for row in rows]
        spread = (known.eta if metric.startswith("eta") else known.energy) / math.sqrt(
            table.cycles or 1
        )
        columns.append((np.array(cells), spread))

    def hollows(order: list[int]) -> int:
        return sum(_hollows(cells[order], spread) for cells, spread in columns)

    usual = [*range(len(rows))]
    before = hollows(usual)
    if not before or len(rows) <= MIN_ROWS:
        return None
    mends = []
    for one, other in combinations(usual, 2):
        order = usual.copy()
        order[one], order[other] = other, one
        mends += [(rows[one].name, rows[other].name)] if not hollows(order) else []
    if len(mends) != 1:
        return None
    first, second = mends[0]
    sentence = (
        f"rows {first} and {second} are exchanged: {before} cells are lower than those of a "
        f"smaller and of a larger load, none "
        "if the two rows change places."
    )
    return ColumnFault("rows", mends[0], broken_before=before, sentence=sentence)


def _hollows(cells: Signal, spread: float) -> int:
    """Number of cells that lie by more than a share [1] below one before and one after them,
    (n,).
    """
    values = cells[np.isfinite(cells)]
    before, after = np.maximum.accumulate(values), np.maximum.accumulate(values[::-1])[::-1]
    return int(np.sum(values * (1.0 + spread) < np.minimum(before, after)))
