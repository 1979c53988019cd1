"""What texts are laid out for: width and colours of the terminal, or of a pipe.

A command sets width and colours once, before it prints; without that, texts are those of a pipe.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextvars import ContextVar
from typing import NamedTuple, TextIO

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
