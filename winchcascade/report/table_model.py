"""Tables of a report: columns with a name, a unit and decimals, and the rows that they take from items."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Generic, TypeVar

import msgspec

from winchcascade.report.digits import NumberText, common_decimals, number

Cell = str | float | None
"""Value of a cell: a number, a text that is formatted already, or None for what does not exist."""

T = TypeVar("T")

LONG = 32
"""A column with a longer text than this is one of sentences. [characters]"""


class Table(msgspec.Struct, frozen=True, tag="table"):
    """Rows of texts under a head of names and units; `summary` rows at the end stand apart.

    `text_columns` are set to the left, all others are numbers. `note` follows the table. `links` are addresses that the
    first cell of each row leads to, none or one for every row. `values` are the cells before they are rounded, for tables
    in files of their own.
    """

    id: str
    caption: str
    head: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: tuple[int, ...] = (0,)
    summary: int = 0
    note: str = ""
    links: tuple[str, ...] = ()
    values: tuple[tuple[Cell, ...], ...] = ()

    def is_long(self, column: int) -> bool:
        """Whether a column holds sentences, which may be broken into lines."""
        return any(len(row[column]) > LONG for row in self.rows)


class TableColumn(msgspec.Struct, Generic[T], frozen=True):
    """Column of a table: its name, its unit, the decimals of its numbers, and the cell that it has for the item of a row.

    `text` columns are aligned to the left, all others to the right.
    """

    name: str
    unit: str = ""
    decimals: int = 0
    text: bool = False
    of: Callable[[T], Cell] | None = None


_EVERY_ROW: ContextVar[bool] = ContextVar("every_row", default=False)


@contextmanager
def every_row() -> Iterator[None]:
    """Make tables with all their rows within this context: a file has no page that a long one would fill."""
    token = _EVERY_ROW.set(True)
    try:
        yield
    finally:
        _EVERY_ROW.reset(token)


def row_limit(most: int | None) -> int | None:
    """Rows that a table lists at most: what is given, or no limit where every row is wanted."""
    return None if _EVERY_ROW.get() else most


class Limit(msgspec.Struct, frozen=True):
    """How many items a table lists: of more than `most`, the first and the last half of that. `more` names the others."""

    most: int
    more: str = "more"


def rows_of(
    columns: Sequence[TableColumn[T]], items: Sequence[T], limit: Limit | None = None
) -> list[tuple[Cell, ...]]:
    """Cells of the columns for each item, as many as the limit allows.

    >>> rows_of([TableColumn("k", of=int), TableColumn("text", of=str)], range(9), Limit(2))
    [(0, '0'), ('… 7 more', ''), (8, '8')]
    """
    most = None if limit is None else row_limit(limit.most)
    rows = [
        tuple(column.of(item) for column in columns if column.of is not None)
        for item in (items if most is None or len(items) <= most else [*items[: most // 2], *items[-(most // 2) :]])
    ]
    if limit is not None and most is not None and len(items) > most:
        rows.insert(most // 2, (f"… {len(items) - most} {limit.more}", *[""] * (len(columns) - 1)))
    return rows


def with_common_decimals(
    columns: Sequence[TableColumn[T]], rows: Sequence[Sequence[Cell]]
) -> tuple[tuple[Cell, ...], ...]:
    """Rows whose numbers with an uncertainty have the same decimals in each column, unless the rows differ in their units."""
    cells = [list(row) for row in rows]
    if not any(column.name.lower() == ROW_UNIT.lower() for column in columns):
        for k in range(len(columns)):
            decimals = common_decimals(row[k] for row in cells)
            for row in cells if decimals is not None else ():
                cell = row[k]
                if isinstance(cell, NumberText) and cell.decimals is not None and decimals is not None:
                    row[k] = cell.at(decimals)
    return tuple(tuple(row) for row in cells)


ROW_UNIT = "Unit"
"""Name of a column that states the unit of its row."""


def make_table(
    name: str,
    caption: str,
    columns: Sequence[TableColumn[T]],
    rows: Iterable[Sequence[Cell]],
    *,
    below: Sequence[Sequence[Cell]] = (),
    note: str = "",
) -> Table:
    """A table of cells under the names and units of its columns; texts of cells stay, numbers get the decimals of the column.

    Parameters
    ----------
    below : rows that summarise the others
    """
    values = with_common_decimals(columns, [*rows, *below])
    return Table(
        id=name,
        caption=caption,
        head=tuple(column.name for column in columns),
        units=tuple(column.unit for column in columns),
        rows=tuple(
            tuple(
                str(cell if isinstance(cell, str) else number(cell, column.decimals))
                for cell, column in zip(row, columns, strict=True)
            )
            for row in values
        ),
        values=values,
        text_columns=tuple(k for k, column in enumerate(columns) if column.text),
        summary=len(below),
        note=note,
    )


def items_table(
    name: str,
    caption: str,
    columns: Sequence[TableColumn[T]],
    items: Sequence[T],
    *,
    limit: Limit | None = None,
    note: str = "",
) -> Table | None:
    """A table with a row for each item, as many as the limit allows; None without items."""
    return make_table(name, caption, columns, rows_of(columns, items, limit), note=note) if items else None


def text_column(name: str, unit: str = "") -> TableColumn[object]:
    """A column of texts."""
    return TableColumn(name, unit, text=True)


def number_column(name: str, unit: str = "") -> TableColumn[object]:
    """A column of numbers that are formatted already."""
    return TableColumn(name, unit)


def formatted_table(
    name: str, caption: str, columns: Sequence[TableColumn[T]], rows: Sequence[Sequence[str]], note: str = ""
) -> Table | None:
    """A table of texts; None without rows."""
    return make_table(name, caption, columns, rows, note=note) if rows else None
