"""Which row of a published table each measured result belongs to, and which columns compare."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import PurePath

import numpy as np

from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.plain_text import first_of
from winchcascade.core.quantity import unit_suffix
from winchcascade.reduction.efficiency import METRICS
from winchcascade.tables.measured import Measured
from winchcascade.tables.published_table import RESULTS_AT, PublishedTable, TableError

MAX_NAMED = 8
"""Results without a row that a note names."""

_SAME_LOAD = 1e-9
"""Two loads that differ by less than this share are the same number of ohms. [1]"""


class CheckError(WinchcascadeError):
    """Results that cannot be held against the table."""


def compared_columns(
    table: PublishedTable, results: Sequence[Measured], notes: list[str]
) -> list[str]:
    """Columns that results have something of; a note is added on those of which they have
    nothing.
    """
    others = [name for name in table.columns if name not in table.keys]
    given = {
        m
        for result in results
        for m, value in result.values.items()
        if value is not None or m not in RESULTS_AT
    }
    compared = [
        n for n in others if table.columns[n].measured in given or (table.by_load and n in METRICS)
    ]
    if results and not compared:
        metrics = sorted(given - set(RESULTS_AT))
        raise TableError(
            f"{table.path}: no column is a quantity of the results, which have "
            f"{', '.join(metrics) or 'no cycle'}; give a "
            f'column such a name, or add measured = "{(metrics or ["power_gen"])[0]}" to its '
            f"entry."
        )
    left = [name for name in others if name not in compared]
    notes += (
        [f"columns {', '.join(left)}: the results have no quantity of these names; not compared."]
        if left
        else []
    )
    return compared


def by_rows(
    results: Sequence[Measured], table: PublishedTable, notes: list[str]
) -> dict[int, list[Measured]]:
    """Results by the row that each belongs to, the nearest one; a note is added on results that
    belong to none.
    """
    found: dict[int, list[Measured]] = {}
    without = []
    for result, nearest in zip(results, _nearest_rows(results, table), strict=True):
        if nearest is None:
            without.append(f"{result.name} ({_place(result, table)})")
        else:
            found.setdefault(nearest, []).append(result)
    if not found:
        raise CheckError(
            f"no result belongs to a row of {table.name}: "
            f"{'; '.join(without[:3]) or 'no log has a complete cycle'}. Its "
            f"rows are {first_of([row.name for row in table.rows], MAX_NAMED)}; correct the key "
            f"or its units (a key may be "
            f"{', '.join(RESULTS_AT)} or a metric), or state the load of the log (load_ohm in "
            f"campaign.toml, or --load-ohm)."
        )
    notes += [f"without a row, left out: {first_of(without, MAX_NAMED)}."] if without else []
    return found


def _nearest_rows(results: Sequence[Measured], table: PublishedTable) -> Iterator[int | None]:
    """Number of the row that each result belongs to, the nearest one; None for another operating
    point.

    A number may differ by the rounding of the cell and a share of the largest number of its column,
    the number of a cycle by the rounding alone, the load of a table by load not at all; a name of a
    log has to be that of the log.
    """
    keys = []
    for name in table.keys:
        cells, column = [row.cells.get(name) for row in table.rows], table.columns[name]
        value, near = (
            np.array(
                [math.nan if c is None else getattr(c, part) * column.factor for c in cells],
                dtype=np.float64,
            )
            for part in ("value", "rounding")
        )
        if table.by_load:
            near = _SAME_LOAD * np.abs(value)
        elif column.measured != "cycle":
            near = near + table.key_share * max(
                (abs(x) for x in value.tolist() if math.isfinite(x)), default=0.0
            )
        texts = ["" if c is None else c.text.casefold() for c in cells]
        keys.append(
            (
                column.measured,
                value,
                near,
                [text.lstrip("0") if text.isdecimal() else text for text in texts],
            )
        )
    for result in results:
        square = np.zeros(len(table.rows))
        for quantity, printed, near, texts in keys:
            found, names = result.values.get(quantity), log_names(result.log)
            here = math.nan if found is None else found
            with np.errstate(invalid="ignore"):
                share = np.abs(here - printed) / near
            if quantity == "load":
                share = np.where(np.isclose(here, printed, rtol=_SAME_LOAD, atol=0.0), 0.0, share)
            if quantity == "file":
                share = np.array([0.0 if text in names else math.inf for text in texts])
            square = np.where(share <= 1.0, square + share**2, math.inf)
        nearest = int(np.argmin(square)) if square.size else 0
        yield nearest if square.size and math.isfinite(square[nearest]) else None


def log_names(log: str) -> list[str]:
    """What a cell may name a log by: its file with or without the ending, or the last number of its
    name.

    >>> log_names("logs/run_07.csv")
    ['run_07.csv', 'run_07', '7']
    """
    name = PurePath(log).name.casefold()
    stem = name.partition(".")[0]
    return [name, stem, *(digits.lstrip("0") for digits in re.findall(r"\d+", stem)[-1:])]


def _place(result: Measured, table: PublishedTable) -> str:
    """What a result has in the columns of the key, in their units."""
    texts = []
    for name in table.keys:
        column = table.columns[name]
        value = result.values.get(column.measured)
        text = (
            "unknown" if value is None else f"{value / column.factor:.4g}{unit_suffix(column.unit)}"
        )
        texts.append(f"{name} {result.log if column.measured == 'file' else text}")
    return ", ".join(texts)
