"""What a report states, as texts: its tables as they are shown, its sentences, and its numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from winchcascade.report.content import Note, Report, Table

if TYPE_CHECKING:
    from collections.abc import Iterator


def tables(report: Report) -> list[Table[Any]]:
    """The tables of a report without the columns that hold nothing."""
    return [block.used() for block in report.blocks if isinstance(block, Table)]


def sentences(report: Report) -> Iterator[str]:
    """Texts beside the tables and the figures."""
    yield from (report.title, report.subtitle, report.banner)
    notes = [*report.notes, *([report.verdict] if report.verdict else [])]
    for note in (*notes, *(block for block in report.blocks if isinstance(block, Note))):
        yield from (note.about, note.text)
    for tile in report.tiles:
        yield from (tile.name, tile.about, tile.value, tile.beside)


def texts(report: Report) -> Iterator[str]:
    """Every text of a report but those of its figures."""
    yield from sentences(report)
    for table in tables(report):
        yield from (table.caption, table.note, *(text for row in table.texts for text in row))
    for picture in report.pictures:
        yield from (picture.caption, picture.alt)


def rows(report: Report, name: str) -> list[dict[str, str]]:
    """Rows of a table as they are shown, by the names of the columns; none without the table."""
    return [
        dict(zip((column.name for column in table.columns), row, strict=True))
        for table in tables(report)
        if table.id == name
        for row in table.texts
    ]
