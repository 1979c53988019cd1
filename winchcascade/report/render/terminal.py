"""A report in a terminal, or as plain text in a pipe: its title, its points, and section by section what is brief."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade.core.plain_text import lines
from winchcascade.report.content import Note, Report, Table, Tone
from winchcascade.report.screen import ESCAPE, PIPED, Screen, present_screen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console, RenderableType
    from rich.table import Table as Grid

MARGIN = 11
"""Columns of what a sentence is about. [characters]"""

STYLES: dict[Tone, str] = {"plain": "", "good": "green", "warn": "yellow"}
"""Colours of the tones."""

UNBROKEN = 10_000
"""Width of a table in a pipe, which gets all of it. [characters]"""


def terminal_text(report: Report, files: Sequence[Path | str] = ()) -> str:
    """A report as it is printed, with colours in a terminal alone.

    Parameters
    ----------
    files : what was written, listed above the verdict
    """
    from rich.text import Text

    screen, out = present_screen(), io.StringIO()
    console, wide = (console_of(screen, out, width) for width in (screen.width or PIPED, screen.width or UNBROKEN))
    console.print(Text(_safe(report.title), style="bold"))
    if report.subtitle:
        console.print(Text(_safe(report.subtitle), style="dim"))
    for note in report.notes:
        if note.brief:
            console.print(_note(note))
    for section in report.filled:
        brief = [block for block in section.blocks if isinstance(block, Table | Note) and block.brief]
        if brief:
            console.print(Text(f"\n{_safe(section.heading)}", style="bold"))
        for k, block in enumerate(brief):
            if isinstance(block, Table):
                if k:
                    console.print()
                wide.print(_grid(block))
            else:
                console.print(_note(block))
    for k, path in enumerate(files):  # a path is never broken
        head = f"{'' if k else 'files':<{MARGIN}}"
        console.print(Text.assemble((head, "bold"), _safe(str(path))), soft_wrap=True)
    if report.verdict is not None:
        console.print("", _note(report.verdict), sep="\n")
    return "".join(f"{line.rstrip()}\n" for line in out.getvalue().replace("\x1b", ESCAPE).splitlines())


def console_of(screen: Screen, out: io.StringIO, width: int) -> Console:
    """A console of a width with the colours of a screen."""
    from rich.console import Console

    return Console(
        file=out, width=width, color_system="standard" if screen.colour else None,
        force_terminal=screen.colour, highlight=False, markup=False, emoji=False, legacy_windows=False,
    )  # fmt: skip


def _safe(text: str) -> str:
    """A text with signs that every terminal shows, without control characters and commands of a runner."""
    return lines(text.translate(SIGNS).replace("Ω", "ohm"))


SIGNS = str.maketrans({"−": "-", "–": "-", "\u00a0": " ", "·": "."})
"""Signs of the field, and what stands for them in a terminal."""


def _beside(about: str, text: RenderableType) -> RenderableType:
    """A text behind what it is about, with a hanging margin."""
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid.grid(padding=0)
    grid.add_column(width=MARGIN, no_wrap=len(about) < MARGIN)
    grid.add_column(overflow="fold")
    grid.add_row(Text(about, style="bold"), text)
    return grid


def _note(note: Note) -> RenderableType:
    """A sentence in the colour of its tone, behind what it is about."""
    from rich.text import Text

    text = Text(_safe(note.text), style=STYLES[note.tone])
    return _beside(_safe(note.about.lower()), text) if note.about else text


def _grid(table: Table[Any]) -> Grid:
    """A table with its brief columns, those without any entry left out."""
    from rich.table import Table as Grid
    from rich.text import Text

    table = table.used()
    brief = [k for k, column in enumerate(table.columns) if column.brief]
    left, units = table.left, any(table.columns[k].unit for k in brief)
    grid = Grid(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    for k in brief:
        column = table.columns[k]
        head = Text(f"{column.name}\n{column.unit}" if units else column.name)
        grid.add_column(head, justify="left" if left[k] else "right", overflow="fold", no_wrap=not left[k])
    rows = table.texts
    for row in [*table.shortened(rows[: len(table.items)]), *rows[len(table.items) :]]:
        grid.add_row(*(Text(_safe(row[k])) for k in brief))
    return grid
