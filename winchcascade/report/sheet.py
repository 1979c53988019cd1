"""The content of a report: sections of tables, figures and notes, made once, which HTML and PDF only lay out."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Literal, TypeVar

import msgspec

from winchcascade.core.campaign_file import Origin, origin_words
from winchcascade.core.version import __version__
from winchcascade.report.content import Cell as StatedCell
from winchcascade.report.content import Measured, Span
from winchcascade.report.content import Note as StatedNote
from winchcascade.report.content import Picture as StatedPicture
from winchcascade.report.content import Section as StatedSection
from winchcascade.report.content import Table as StatedTable
from winchcascade.report.digits import PLUS_MINUS, NumberText, common_decimals, number, upper
from winchcascade.report.glossary import typeset

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def row_limit(maximum: int | None) -> int | None:
    """Rows that a table lists at most: what is given, or no limit where every row is wanted."""
    return None if _EVERY_ROW.get() else maximum


class Limit(msgspec.Struct, frozen=True):
    """How many items a table lists: of more than `maximum`, the first and the last half of that. `more` names the others."""

    maximum: int
    more: str = "more"


def rows_of(
    columns: Sequence[TableColumn[T]], items: Sequence[T], limit: Limit | None = None
) -> list[tuple[Cell, ...]]:
    """Cells of the columns for each item, as many as the limit allows.

    >>> rows_of([TableColumn("k", of=int), TableColumn("text", of=str)], range(9), Limit(2))
    [(0, '0'), ('… 7 more', ''), (8, '8')]
    """
    maximum = None if limit is None else row_limit(limit.maximum)
    rows = [
        tuple(column.of(item) for column in columns if column.of is not None)
        for item in (
            items if maximum is None or len(items) <= maximum else [*items[: maximum // 2], *items[-(maximum // 2) :]]
        )
    ]
    if limit is not None and maximum is not None and len(items) > maximum:
        rows.insert(maximum // 2, (f"… {len(items) - maximum} {limit.more}", *[""] * (len(columns) - 1)))
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


class ItemTable(msgspec.Struct, Generic[T], frozen=True):
    """Declaration of a table with a row for each item: its name, its caption and its columns.

    `limit` is how many items it lists.
    """

    name: str
    caption: str
    columns: Sequence[TableColumn[T]]
    note: str = ""
    limit: Limit | None = None

    def of(self, items: Sequence[T]) -> Table | None:
        """The table of some items, as many as the limit allows; None without items."""
        return self.always(items) if items else None

    def always(self, items: Sequence[T], below: Sequence[Sequence[Cell]] = ()) -> Table:
        """The table of some items, also without any; `below` are rows that summarise the others."""
        rows = rows_of(self.columns, items, self.limit)
        return make_table(self.name, self.caption, self.columns, rows, below=below, note=self.note)


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


Tone = Literal["plain", "good", "warn"]


class Picture(msgspec.Struct, frozen=True, tag="picture"):
    """A figure as SVG text with named colours in it (`figures.COLOURS`); `alt` describes in words what it shows.

    `marks` is the JSON of its axes and series, with which a page zooms, reads and switches them.
    """

    id: str
    caption: str
    alt: str
    svg: str
    interactive: bool = False
    marks: str = ""


class Note(msgspec.Struct, frozen=True, tag="note"):
    """A paragraph, and what it is about where that is set before it."""

    text: str
    about: str = ""


def picture(figure: Figure | None, name: str, caption: str, alt: str, *, interactive: bool = False) -> Picture | None:
    """A figure as a block of a report; None for none."""
    import io

    if figure is None:
        return None
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return Picture(name, caption, alt, out.getvalue()[out.getvalue().index("<svg") :], interactive)


Block = Table | Picture | Note


class Section(msgspec.Struct, frozen=True):
    """A heading and what stands under it."""

    id: str
    heading: str
    blocks: tuple[Block, ...]


def section(name: str, heading: str, *blocks: Block | None) -> Section:
    """A section of the blocks that there are."""
    return Section(name, heading, tuple(b for b in blocks if b is not None))


def filled(*sections: Section) -> tuple[Section, ...]:
    """Those of some sections that have blocks."""
    return tuple(s for s in sections if s.blocks)


def of_stated(stated: StatedSection) -> Section:
    """A section of the content model (`content.py`) within a report of this one. Called within the style of figures."""
    blocks: list[Block | None] = []
    for block in stated.blocks:
        if isinstance(block, StatedNote):
            blocks.append(Note(typeset(block.text), block.about))
        elif isinstance(block, StatedPicture):
            blocks.append(picture(block.figure, block.id, typeset(block.caption), typeset(block.alt)))
        else:
            blocks.append(_of_stated_table(block.used()))
    return section(stated.id, stated.heading, *blocks)


def _of_stated_table(stated: StatedTable[Any]) -> Table:
    """A table of the content model, with the values behind its texts."""
    rows = [
        [_of_stated_cell(typeset(text), cell) for text, cell in zip(texts, cells, strict=True)]
        for texts, cells in zip(stated.texts, stated.cells, strict=True)
    ]
    items, below = rows[: len(stated.items)], rows[len(stated.items) :]
    if row_limit(stated.limit) is not None:
        items = [list(row) for row in stated.shortened(items)]
    columns = [
        TableColumn[Any](typeset(column.name), typeset(column.unit), text=left)
        for column, left in zip(stated.columns, stated.left, strict=True)
    ]
    return make_table(stated.id, typeset(stated.caption), columns, items, below=below, note=typeset(stated.note))


def _of_stated_cell(text: str, cell: StatedCell) -> str:
    if isinstance(cell, Span):
        return NumberText(text, cell.low, cell.high)
    if isinstance(cell, Measured):
        return NumberText(text, cell.value, cell.u, form=PLUS_MINUS) if cell.both else NumberText(text, cell.value)
    return text if cell is None or isinstance(cell, str) else NumberText(text, cell)


class Tile(msgspec.Struct, frozen=True):
    """One number of the summary: its name, value, 95 % interval, and what it is."""

    symbol: str
    name: str
    value: str
    interval: str


class Point(msgspec.Struct, frozen=True):
    """One sentence of the summary: about what, the sentence, and whether it is a warning."""

    about: str
    text: str
    tone: Tone = "plain"


SUBSCRIPTS = (
    "line", "mech", "gen, cycle", "gen", "trans", "pto", "max", "min", "mean", "plateau", "hold", "payout", "returned", "net",
)  # fmt: skip
"""Subscripts of the symbols of every report."""


class Link(msgspec.Struct, frozen=True):
    """A page beside a report: what it is, and its address from there."""

    text: str
    address: str


class Report(msgspec.Struct, frozen=True):
    """A whole report, in order.

    `traces` is the JSON that the page's time histories read values from. `banner` is a warning on every page. `subscripts` are
    what may stand low behind a letter and an underscore in a text. `links` lead to the pages that belong to it. `lead` is a
    figure that stands beside the tiles.
    """

    kind: str
    title: str
    subtitle: str
    tiles: tuple[Tile, ...]
    points: tuple[Point, ...]
    sections: tuple[Section, ...]
    traces: str = ""
    banner: str = ""
    subscripts: tuple[str, ...] = SUBSCRIPTS
    links: tuple[Link, ...] = ()
    lead: Picture | None = None
    generator: str = f"winchcascade/{__version__}"


def data_point(origins: Sequence[Origin]) -> Point:
    """State whether the data are measured and where they come from; a warning where any are not measured."""
    words = origin_words(origins)
    text = words if words.endswith(".") else f"{words}."
    made = any(origin.measured is False for origin in origins)
    return Point("Data", upper(text), "warn" if made else "plain")


def provenance_section(rows: Sequence[tuple[str, str]], command: str, *before: Table | None) -> Section:
    """Where every number comes from: items with their values, those without one left out, and how the report was made.

    Parameters
    ----------
    before : tables that stand before that of the items
    """
    import platform

    import numpy

    versions = f"winchcascade {__version__}, Python {platform.python_version()}, numpy {numpy.__version__}"
    made = (
        ("Made by", versions),
        ("Command", command),
        ("Made on", made_at().strftime("%Y-%m-%d %H:%M:%S UTC")),
    )
    given = [row for row in (*rows, *made) if row[1]]
    return section(
        "provenance", "Provenance", *before, pairs_table("provenance", "What the report was made from, and how.", given)
    )


def pairs_table(
    name: str, caption: str, rows: Sequence[Sequence[Cell]], heads: tuple[str, str] = ("Item", "Value")
) -> Table:
    """A table of two columns of texts."""
    return make_table(name, caption, [text_column(head) for head in heads], rows)


def made_at() -> datetime:
    """Give the time of making, or SOURCE_DATE_EPOCH where a build must be repeatable; UTC, whole seconds."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    given = epoch.isdigit() and len(epoch) <= 11
    now = datetime.fromtimestamp(int(epoch), UTC) if given else datetime.now(UTC)
    return now.replace(microsecond=0)


def file_digest(path: str) -> str:
    """SHA-256 of a rig file, nothing for a built-in one."""
    from winchcascade.core.store import digest_of

    return digest_of(Path(path).read_bytes()) if Path(path).is_file() else ""
