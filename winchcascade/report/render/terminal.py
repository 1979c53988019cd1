"""A report in a terminal, or as plain text in a pipe: its title, its points, and section by
section what is brief; and the width and the colours of either.

A command sets width and colours once, before it prints; without that, texts are those of a pipe.
"""

from __future__ import annotations

import io
import os
import re
from collections.abc import Callable
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TextIO

from winchcascade.core.plain_text import lines
from winchcascade.report.content import Note, Report, Table, Tone

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console, RenderableType
    from rich.table import Table as Grid


NARROWEST, WIDEST = 60, 120
"""Columns between which lines follow the terminal; a narrower one is treated as the first, a
wider one as the second.
"""

PIPED = 100
"""Columns of a sentence in a pipe, a file or the log of a runner."""

UNKNOWN = 80
"""Columns of a terminal that does not report its size."""


class Screen(NamedTuple):
    """What lines are laid out for: columns of a terminal, None for a pipe, and whether it shows
    colours.
    """

    width: int | None = None
    colour: bool = False


PIPE = Screen()
"""No terminal."""

_PRESENT: ContextVar[Screen] = ContextVar("screen", default=PIPE)


QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether a command prints only what fails, and no progress."""


def screen_of(stream: TextIO) -> Screen:
    """The width that COLUMNS states, else that of the terminal, else none; colours in a terminal
    without NO_COLOR only.
    """
    terminal = stream.isatty()
    stated = os.environ.get("COLUMNS", "")
    width = int(stated) if stated.isdecimal() and len(stated) < 7 else 0
    if not width and terminal:
        try:
            width = os.get_terminal_size(stream.fileno()).columns or UNKNOWN
        except OSError:  # also that of a stream without a number
            width = UNKNOWN
    known = os.name != "nt" or "WT_SESSION" in os.environ
    colour = (
        terminal and known and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    )
    return Screen(min(max(width, NARROWEST), WIDEST) if width else None, colour)


def use_screen(screen: Screen) -> None:
    """Lay out what follows for a screen."""
    _PRESENT.set(screen)


def present_screen() -> Screen:
    """The screen for which texts are laid out now."""
    return _PRESENT.get()


def line_width(piped: int = PIPED) -> int:
    """Columns of a sentence. [characters]

    Parameters
    ----------
    piped : columns in a pipe
    """
    return _PRESENT.get().width or piped


# ---------------------------------------------------------------------------------------- colours
ESCAPE = "\ufdd4"
"""Stands for the escape with which the codes of a text begin that is laid out already, no
character of any language.
"""


def painted(text: str, clean: Callable[[str], str]) -> str:
    """A text with its colours, cleaned in between; in a pipe the clean text."""
    return ("\x1b" if _PRESENT.get().colour else "").join(map(clean, text.split(ESCAPE)))


# ---------------------------------------------------------------------------------------- reports
MARGIN = 11
"""Columns of what a sentence is about. [characters]"""

STYLES: dict[Tone, str] = {"plain": "", "good": "green", "warn": "yellow"}
"""Colours of the tones."""

SHORT = 20
"""Texts of a column that are no longer than this are never broken, longer ones are at least as
wide. [characters]
"""

GAP = 2
"""Blanks between columns. [characters]"""

IDENTIFIER = re.compile(r" \([a-z][a-z0-9_]*(\([^()]*\))?\)")
"""An identifier in brackets behind a label; what it is of, in brackets of its own, stays."""

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
    console, wide = (
        console_of(screen, out, width)
        for width in (screen.width or PIPED, screen.width or UNBROKEN)
    )
    console.print(Text(_safe(report.title), style="bold"))
    if report.subtitle:
        console.print(Text(_safe(report.subtitle), style="dim"))
    for note in report.notes:
        if note.brief:
            console.print(_note(note))
    for section in report.sections:
        brief = section.brief
        if brief:
            console.print(Text(f"\n{_safe(section.heading)}", style="bold"))
        for k, block in enumerate(brief):
            if isinstance(block, Table):
                if k:
                    console.print()
                for j, grid in enumerate(_grids(block, wide.width)):
                    if j:
                        console.print()
                    wide.print(grid)
            else:
                console.print(_note(block))
    for k, path in enumerate(files):  # a path is never broken
        head = f"{'' if k else 'files':<{MARGIN}}"
        console.print(Text.assemble((head, "bold"), _safe(str(path))), soft_wrap=True)
    if report.verdict is not None:
        console.print("", _note(report.verdict), sep="\n")
    return "".join(
        f"{line.rstrip()}\n" for line in out.getvalue().replace("\x1b", ESCAPE).splitlines()
    )


def console_of(screen: Screen, out: io.StringIO, width: int) -> Console:
    """A console of a width with the colours of a screen."""
    from rich.console import Console

    return Console(
        file=out, width=width, color_system="standard" if screen.colour else None,
        force_terminal=screen.colour, highlight=False, markup=False, emoji=False, legacy_windows=False,
    )  # fmt: skip


def _safe(text: str) -> str:
    """A text with signs that every terminal shows, without control characters and commands of a
    runner.
    """
    return lines(text.translate(SIGNS).replace("Ω", "ohm"))


SIGNS = str.maketrans({"−": "-", "–": "-", "\u00a0": " ", "·": ".", ESCAPE: ""})
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


def _grids(table: Table[Any], width: int) -> list[Grid]:
    """A table with its brief columns, empty ones left out; columns that do not fit are printed
    below, after the first one.
    """
    table = table.used()
    brief = [k for k, column in enumerate(table.columns) if column.brief]
    body, below = table.listed()
    rows = [
        [
            _safe(_label(cell) if column.named else cell)
            for column, cell in zip(table.columns, row, strict=True)
        ]
        for row in (*body, *below)
    ]
    heads = [(column.name, column.unit) for column in table.columns]
    longest = [max(map(len, (*heads[k], *(row[k] for row in rows)))) for k in range(len(heads))]
    left = table.left
    fixed = [not left[k] or longest[k] <= SHORT for k in range(len(heads))]
    parts: list[list[int]] = [brief[:1]]
    for k in brief[1:]:
        needed = sum((longest[j] if fixed[j] else SHORT) + GAP for j in (*parts[-1], k)) - GAP
        if needed > width and len(parts[-1]) > 1:
            parts.append(brief[:1])
        parts[-1].append(k)
    return [
        _grid([(heads[k], left[k], fixed[k], [row[k] for row in rows]) for k in part])
        for part in parts
    ]


def _label(text: str) -> str:
    """A label without the identifier behind it.

    >>> _label("Stator resistance (copper_heating)"), _label("Load of a run (load_entry(r9ohm.csv))")
    ('Stator resistance', 'Load of a run (r9ohm.csv)')
    """
    return IDENTIFIER.sub(lambda found: f" {found[1]}" if found[1] else "", text)


def _grid(columns: Sequence[tuple[tuple[str, str], bool, bool, list[str]]]) -> Grid:
    """Columns of a table: name and unit, whether they stand to the left, whether they are never
    broken, and cells.
    """
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="bold")
    units = any(unit for (_, unit), *_ in columns)
    for (name, unit), left, fixed, _ in columns:
        head = Text(f"{name}\n{unit}" if units else name)
        grid.add_column(head, justify="left" if left else "right", overflow="fold", no_wrap=fixed)
    for row in zip(*(cells for *_, cells in columns), strict=True):
        grid.add_row(*map(Text, row))
    return grid
