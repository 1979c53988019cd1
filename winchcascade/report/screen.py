"""Width and colours of what is printed: those of the terminal, or the fixed widths of a pipe.

A command sets them once, before it prints; without that, texts are those of a pipe.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextvars import ContextVar
from typing import Literal, NamedTuple, TextIO

NARROWEST, WIDEST = 60, 120
"""Columns between which lines follow the terminal; a narrower one is treated as the first, a wider one as the second."""

PIPED = 100
"""Columns of a sentence in a pipe, a file or the log of a runner."""

UNKNOWN = 80
"""Columns of a terminal that does not report its size."""

Tone = Literal["good", "warning", "contradiction"]


class Screen(NamedTuple):
    """What lines are laid out for: columns of a terminal, None for a pipe, and whether it shows colours."""

    width: int | None = None
    colour: bool = False


PIPE = Screen()
"""No terminal."""

_PRESENT: ContextVar[Screen] = ContextVar("screen", default=PIPE)


QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
"""Whether a command prints only what fails, and no progress."""


def screen_of(stream: TextIO) -> Screen:
    """The width that COLUMNS states, else that of the terminal, else none; colours in a terminal without NO_COLOR only."""
    terminal = stream.isatty()
    stated = os.environ.get("COLUMNS", "")
    width = int(stated) if stated.isdecimal() and len(stated) < 7 else 0
    if not width and terminal:
        try:
            width = os.get_terminal_size(stream.fileno()).columns or UNKNOWN
        except OSError:  # also that of a stream without a number
            width = UNKNOWN
    known = os.name != "nt" or "WT_SESSION" in os.environ
    colour = terminal and known and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return Screen(min(max(width, NARROWEST), WIDEST) if width else None, colour)


def use_screen(screen: Screen) -> None:
    """Lay out what follows for a screen."""
    _PRESENT.set(screen)


def line_width(piped: int = PIPED) -> int:
    """Columns of a sentence. [characters]

    Parameters
    ----------
    piped : columns in a pipe
    """
    return _PRESENT.get().width or piped


def table_width() -> int | None:
    """Columns that a table may have; None in a pipe, which gets all of it. [characters]"""
    return _PRESENT.get().width


# --------------------------------------------------------------------------------------------------------------- colours
_MARKS: dict[Tone, str] = {"good": "\ufdd0", "warning": "\ufdd1", "contradiction": "\ufdd2"}
_END = "\ufdd3"
_CODES = {"\ufdd0": "\x1b[32m", "\ufdd1": "\x1b[33m", "\ufdd2": "\x1b[31m", _END: "\x1b[0m"}
"""Signs that stand for a colour until the text is printed, no characters of any language: texts from files lose them."""

_NO_MARKS = str.maketrans(dict.fromkeys(_CODES))


def toned(text: str, tone: Tone) -> str:
    """A text marked as good, as a warning or as a contradiction; in a pipe the text alone."""
    return f"{_MARKS[tone]}{text}{_END}" if text and _PRESENT.get().colour else text


def without_tones(text: str) -> str:
    """A text without its marks."""
    return text.translate(_NO_MARKS)


def length(text: str) -> int:
    """Columns that a text takes. [characters]"""
    return len(without_tones(text))


def painted(text: str, clean: Callable[[str], str]) -> str:
    """A text with colours instead of marks, cleaned in between; in a pipe the clean text."""
    if not _PRESENT.get().colour:
        return clean(text)
    parts, begin = [], 0
    for k, sign in enumerate(text):
        if sign in _CODES:
            parts += [clean(text[begin:k]), _CODES[sign]]
            begin = k + 1
    return "".join([*parts, clean(text[begin:])])
