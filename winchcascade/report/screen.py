"""What is shown while a command runs: width and colours of the terminal, or of a pipe, and the
progress on the error stream.

A command sets width and colours once, before it prints; without that, texts are those of a pipe.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, TextIO

from winchcascade.core.plain_text import lines, one_line

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


@contextmanager
def status_line(title: str) -> Iterator[Callable[[str], None]]:
    """Show in one changing line of a terminal the present step and the time until now; elsewhere
    show nothing.
    """
    if QUIET.get() or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress as Bar
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.table import Column

    step = TextColumn("{task.description}", table_column=Column(no_wrap=True, overflow="ellipsis"))
    with Bar(
        SpinnerColumn(), TimeElapsedColumn(), step, console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task(escape(one_line(title)))
        yield lambda text: bar.update(task, description=escape(one_line(text)))


class Progress:
    """Shows a bar while it is a context, and reports faults as they come."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._bar: Any = None

    def __enter__(self) -> Progress:
        """Start with nothing shown: a batch that has nothing to do shows nothing."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        fault: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.stop()

    def begin(self, kept: int, todo: int) -> None:
        """Show the bar in a terminal, if there is something to do."""
        if not todo or QUIET.get() or not sys.stderr.isatty():
            return
        from rich.console import Console
        from rich.markup import escape
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        self._bar = Bar(
            TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
            console=Console(stderr=True),
        )  # fmt: skip
        self._bar.add_task(escape(self._title), total=kept + todo, completed=kept)
        self._bar.start()

    def waiting(self, folder: Path) -> None:
        """Report that another call works in the folder of the results, so that the wait does not
        look like a fault.
        """
        if QUIET.get():
            return
        sys.stderr.write(lines(f"waiting for another call that works in {one_line(str(folder))}\n"))
        sys.stderr.flush()

    def done(self, name: str, fault: str | None) -> None:
        """Count one more as done; of one that failed show the name at once, the reason comes
        with the others at the end.
        """
        if self._bar is not None:
            self._bar.advance(self._bar.task_ids[0])
        if fault is None or QUIET.get():
            return
        line = lines(one_line(f"failed: {name}"))
        if self._bar is not None:
            self._bar.console.print(line, markup=False, highlight=False)
        else:
            sys.stderr.write(f"{line}\n")
