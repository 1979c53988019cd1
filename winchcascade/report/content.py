"""What a result states, each number once: tables, figures and sentences. Renderers lay it out and
add nothing.

Texts are plain: metrics by their names (`eta_pto`), units as `ohm` and `N.m`, a hyphen for a minus.
`glossary.typeset` sets them for a page.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, Literal, NamedTuple, TypeGuard, TypeVar

import msgspec

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

T = TypeVar("T")

Tone = Literal["plain", "good", "warn"]


class Measured(NamedTuple):
    """A value with its standard uncertainty, which decides its digits; shown with it where `both`,
    with a plus where `signed`.
    """

    value: float | None
    u: float | None = None
    both: bool = False
    signed: bool = False


class Span(NamedTuple):
    """The ends of an interval, with the standard uncertainty that decides their digits."""

    low: float | None
    high: float | None
    u: float | None = None


Cell = str | float | Measured | Span | None
"""A text, a number, a number with its uncertainty, an interval, or None for what does not exist."""


# ----------------------------------------------------------------------------- one rule of digits
def places(u: float) -> int:
    """Decimals that a standard uncertainty allows: those of its first two digits (GUM 7.2.6).

    >>> places(0.0048), places(116.0), places(0.0996)
    (4, -1, 2)
    """
    return 1 - math.floor(math.log10(float(f"{u:.1e}")))


def known(u: float | None) -> TypeGuard[float]:
    """Whether an uncertainty decides digits."""
    return u is not None and u != 0.0 and math.isfinite(u)


def number_text(value: float | None, decimals: int | None = None, *, signed: bool = False) -> str:
    """Text of a number, with four significant digits unless its decimals are given; never a zero
    with a minus.

    >>> number_text(None), number_text(-7114.9, -1), number_text(-0.0004, 3), number_text(2.0, 1, signed=True)
    ('-', '-7110', '0.000', '+2.0')
    """
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    if decimals is None:
        if value and not 1e-4 <= abs(value) < 1e8:
            return f"{value:.3e}"
        decimals = 0 if isinstance(value, int) else 3 - math.floor(math.log10(abs(value) or 1.0))
    rounded = round(value, decimals) + 0.0
    return f"{rounded:{'+' if signed and rounded > 0.0 else ''}.{max(decimals, 0)}f}"


def shown(cell: Cell, decimals: int | None = None, *, signed: bool = False) -> str:
    """Text of a cell; the decimals of a column hold where no uncertainty decides.

    >>> shown(None), shown(0.90337, 3), shown(Measured(0.90337, 0.0048)), shown(Span(5.479, 5.4817), 2)
    ('-', '0.903', '0.9034', '5.48 to 5.48')
    >>> shown(Measured(0.90337, 0.0048, both=True))
    '0.9034 +- 0.0048'
    """
    if not isinstance(cell, Measured | Span):
        return cell if isinstance(cell, str) else number_text(cell, decimals, signed=signed)
    own = places(cell.u) if known(cell.u) else decimals
    if isinstance(cell, Measured):
        text = number_text(cell.value, own, signed=signed or cell.signed)
        return f"{text} +- {number_text(cell.u, own)}" if cell.both and known(cell.u) else text
    ends = [number_text(end, own, signed=signed) for end in (cell.low, cell.high)]
    return " to ".join(ends) if ends != ["-", "-"] else "-"


# ----------------------------------------------------------------------------------------- tables
class Column(msgspec.Struct, Generic[T], frozen=True):
    """Column of a table: name, what its cell is for the item of a row, unit, and the decimals of
    numbers whose uncertainty is unknown; four significant digits without any.

    `brief` ones stand in a terminal too. `signed` numbers above zero have a plus. `link` is the
    address that a cell leads to on a page. The cells of `named` columns hold labels with
    identifiers in brackets behind them, which a terminal leaves out.
    """

    name: str
    of: Callable[[T], Cell]
    unit: str = ""
    decimals: int | None = None
    brief: bool = True
    signed: bool = False
    link: Callable[[T], str] | None = None
    named: bool = False

    def text(self, cell: Cell) -> str:
        """A cell as it is shown."""
        return shown(cell, self.decimals, signed=self.signed)


class Table(msgspec.Struct, Generic[T], frozen=True):
    """A row for each item; rows `below` summarise. `brief` tables stand in a terminal too.

    `limit` is how many rows are shown at most, the first and the last half of them; files hold all.
    """

    id: str
    caption: str
    columns: Sequence[Column[T]]
    items: Sequence[T]
    below: Sequence[Sequence[Cell]] = ()
    note: str = ""
    brief: bool = True
    limit: int = 60

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to show."""
        return not self.items and not self.below

    @property
    def _shown(self) -> Table[T]:
        """The table with the items that are shown alone."""
        count, half = len(self.items), self.limit // 2
        if count <= self.limit + 1:
            return self
        ends = [*self.items[:half], *self.items[count - half :]]
        return msgspec.structs.replace(self, items=ends)

    @property
    def cells(self) -> list[list[Cell]]:
        """Rows as they are, unrounded."""
        return [[column.of(item) for column in self.columns] for item in self.items] + [
            list(row) for row in self.below
        ]

    @property
    def texts(self) -> list[list[str]]:
        """Rows as they are shown, all of them."""
        return [
            [column.text(cell) for column, cell in zip(self.columns, row, strict=True)]
            for row in self.cells
        ]

    @property
    def left(self) -> list[bool]:
        """Which columns hold texts, which stand to the left."""
        cells = self._shown.cells
        rows = cells[: len(cells) - len(self.below)] or cells
        return [any(isinstance(row[k], str) for row in rows) for k in range(len(self.columns))]

    @property
    def addresses(self) -> list[list[str]]:
        """What the cells of the items lead to, "" where they do not."""
        return [
            [column.link(item) if column.link else "" for column in self.columns]
            for item in self.items
        ]

    def shortened(self, rows: Sequence[Sequence[str]], *, counted: bool = True) -> list[list[str]]:
        """Texts of rows up to the limit, with one row in place of those left out; it states
        their number if `counted`.
        """
        count, half = len(self.items), self.limit // 2
        if count <= self.limit + 1:
            return [list(row) for row in rows]
        more = [f"... {count - 2 * half} more" if counted else "", *[""] * (len(self.columns) - 1)]
        return [*map(list, rows[:half]), more, *map(list, rows[len(rows) - half :])]

    def listed(self) -> tuple[list[list[str]], list[list[str]]]:
        """Texts of the items up to the limit, and of the rows below them."""
        texts, count = self._shown.texts, len(self._shown.items)
        return self.shortened(texts[:count]), texts[count:]

    def used(self) -> Table[T]:
        """The table without the columns that hold nothing; the first one stays."""
        rows = self.cells
        keep = [
            k
            for k in range(len(self.columns))
            if k == 0 or any(row[k] not in (None, "") for row in rows)
        ]
        return msgspec.structs.replace(
            self,
            columns=[self.columns[k] for k in keep],
            below=[[row[k] for k in keep] for row in self.below],
        )

    def frame(self) -> pd.DataFrame:
        """The table with units in the heads and numbers in full; intervals and uncertainties
        have columns of their own.
        """
        import pandas as pd

        found: dict[str, list[object]] = {}
        for k, column in enumerate(self.columns):
            cells = [row[k] for row in self.cells]
            head = f"{column.name} ({column.unit})" if column.unit else column.name
            names = [head]
            if any(isinstance(cell, Span) for cell in cells):
                names = [f"{head}, low", f"{head}, high"]
            elif any(isinstance(cell, Measured) and cell.both for cell in cells):
                names = [head, f"{head}, standard uncertainty"]
            for j, name in enumerate(names):
                values: list[object] = [
                    cell[j] if isinstance(cell, tuple) else cell if j == 0 else None
                    for cell in cells
                ]
                found[name if name not in found else f"{name}, {len(found)}"] = values
        return pd.DataFrame(found)


def table(
    name: str,
    caption: str,
    columns: Sequence[Column[T]],
    items: Iterable[T],
    *,
    note: str = "",
    brief: bool = True,
) -> Table[T]:
    """A table of some items; a section leaves out one without any."""
    return Table(name, caption, columns, list(items), note=note, brief=brief)


PAIRS: tuple[Column[tuple[str, Cell]], ...] = (
    Column("Item", lambda row: row[0]),
    Column("Value", lambda row: row[1]),
)
"""Columns of a table of two texts."""


PROVENANCE = "provenance"
"""Name of the section, and of its table, that states where every number comes from."""


# ------------------------------------------------------------------------------- the other blocks
class Note(msgspec.Struct, frozen=True):
    """A sentence, what it is about, and whether it is a warning; `brief` ones stand in a
    terminal too.
    """

    text: str
    about: str = ""
    tone: Tone = "plain"
    brief: bool = True

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to say."""
        return not self.text


class Picture(msgspec.Struct, frozen=True, dict=True):
    """A figure, its caption, and what it shows in words.

    Parameters
    ----------
    draw : makes the figure when a renderer needs it, within the style of figures; None where there
        is nothing to draw
    histories : makes the JSON of an interactive one (`render/page.py`), which always has a figure
    """

    id: str
    caption: str
    alt: str
    draw: Callable[[], Figure | None]
    histories: Callable[[], str] | None = None

    @cached_property
    def figure(self) -> Figure | None:
        """The figure, drawn once."""
        from winchcascade.report.figures.style import house_style

        with house_style():
            return self.draw()

    def _repr_svg_(self) -> str:
        """The figure, for notebooks."""
        from winchcascade.report.figures.style import drawn

        return drawn(self.figure).decode()

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to draw."""
        return self.histories is None and self.figure is None


Block = Table[Any] | Picture | Note


Blocks = Sequence[Block | None]


class Section(msgspec.Struct, frozen=True, dict=True):
    """A heading and what stands under it; a `folded` one is opened by the reader, and open in
    print.

    `parts` may be what makes them, which is called when a page or a file needs them: nothing of
    such a section stands in a terminal.
    """

    id: str
    heading: str
    parts: Blocks | Callable[[], Blocks]
    folded: bool = False

    @cached_property
    def blocks(self) -> list[Block]:
        """The parts that hold something; pictures are drawn later (`Report.illustrated`)."""
        parts = self.parts() if callable(self.parts) else self.parts
        given = [block for block in parts if block is not None]
        return [block for block in given if isinstance(block, Picture) or not block.is_empty]

    @property
    def brief(self) -> list[Note | Table[Any]]:
        """What stands in a terminal too."""
        blocks = [] if callable(self.parts) else self.blocks
        return [one for one in blocks if isinstance(one, Note | Table) and one.brief]


def section(name: str, heading: str, *blocks: Block | None, folded: bool = False) -> Section:
    """A section of some blocks, of which it shows those that hold something."""
    return Section(name, heading, blocks, folded)


class Tile(msgspec.Struct, frozen=True):
    """One number of the first screen: its name, what it is, its value as shown, and what stands
    below it.
    """

    name: str
    about: str
    value: str
    beside: str = ""


class Link(msgspec.Struct, frozen=True):
    """A page beside a report: what it is, and its address from there."""

    text: str
    address: str


class Report(msgspec.Struct, frozen=True):
    """Everything that is said of a result, in order.

    `banner` is a warning on every page. `lead` is a figure beside the tiles. `verdict` is the last
    line in a terminal.
    """

    kind: str
    title: str
    subtitle: str = ""
    tiles: Sequence[Tile] = ()
    points: Sequence[Note | None] = ()
    sections: Sequence[Section] = ()
    verdict: Note | None = None
    banner: str = ""
    lead: Picture | None = None
    links: Sequence[Link] = ()

    @property
    def notes(self) -> list[Note]:
        """The points that have a text."""
        return [point for point in self.points if point is not None and not point.is_empty]

    @property
    def blocks(self) -> list[Block]:
        """All blocks, in order."""
        return [block for one in self.sections for block in one.blocks]

    @property
    def pictures(self) -> list[Picture]:
        """All pictures, in order."""
        lead = [] if self.lead is None else [self.lead]
        return [*lead, *(block for block in self.blocks if isinstance(block, Picture))]

    def illustrated(self) -> Report:
        """The report with its figures drawn, without pictures of nothing and empty sections."""
        kept = [
            Section(one.id, one.heading, [b for b in one.blocks if not b.is_empty], one.folded)
            for one in self.sections
        ]
        return msgspec.structs.replace(
            self,
            lead=None if self.lead is None or self.lead.is_empty else self.lead,
            sections=[one for one in kept if one.blocks],
        )
