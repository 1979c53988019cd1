"""Parts of every report: sections, pictures, tables of texts, and the sources of its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import Origin, origin_words
from winchcascade.core.store import digest_of
from winchcascade.report.page_setup import made_at
from winchcascade.report.report_model import Block, Picture, Point, Section, Table, TableColumn, make_table
from winchcascade.report.style import svg_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def section(name: str, heading: str, *blocks: Block | None) -> Section:
    """A section of the blocks that there are."""
    return Section(name, heading, tuple(b for b in blocks if b is not None))


def picture(figure: Figure | None, name: str, caption: str, alt: str, *, interactive: bool = False) -> Picture | None:
    """A figure as a block of a report; None for none."""
    return None if figure is None else Picture(name, caption, alt, svg_text(figure, name), interactive)


def data_point(origins: Sequence[Origin]) -> Point:
    """State whether the data are measured and where they come from; a warning where any are not measured."""
    words = origin_words(origins)
    text = words if words.endswith(".") else f"{words}."
    made = any(origin.measured is False for origin in origins)
    return Point("Data", text[0].upper() + text[1:], "warn" if made else "plain")


def provenance_table(rows: Sequence[tuple[str, str]]) -> Table:
    """Where every number comes from: items with their values, those without one left out."""
    return Table(
        id="provenance",
        caption="What the report was made from, and how.",
        head=("Item", "Value"),
        units=("", ""),
        rows=tuple(row for row in rows if row[1]),
        text_columns=(0, 1),
    )


def file_digest(path: str) -> str:
    """SHA-256 of a rig file, nothing for a built-in one."""
    return digest_of(Path(path).read_bytes()) if Path(path).is_file() else ""


def made_on() -> str:
    """The time of making, as it stands in a report."""
    return made_at().strftime("%Y-%m-%d %H:%M:%S UTC")


def text_column(name: str, unit: str = "") -> TableColumn[object]:
    """A column of texts."""
    return TableColumn(name, unit, text=True)


def number_column(name: str, unit: str = "") -> TableColumn[object]:
    """A column of numbers that are formatted already."""
    return TableColumn(name, unit)


def formatted_table(
    name: str, caption: str, columns: Sequence[TableColumn[object]], rows: Sequence[Sequence[str]], note: str = ""
) -> Table | None:
    """A table of texts; None without rows."""
    return make_table(name, caption, columns, rows, note=note) if rows else None
