"""How a diagnosis is laid out in the terminal: a name in a margin and its text beside it."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from winchcascade.core.plain_text import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

WIDTH, INDENT = 100, 11
"""Columns of a line, and of the margin that holds the names."""


def entry(name: str, text: str) -> list[str]:
    """A name and its text, wrapped beside it; nothing for an empty text."""
    lines = [
        line
        for part in plain(text).split("\n")
        if part
        for line in textwrap.wrap(one_line(part), WIDTH - INDENT, break_on_hyphens=False)
    ]
    return [f"{name if k == 0 else '':<{INDENT}}{line}" for k, line in enumerate(lines)]


def file_lines(name: str, files: Sequence[Path | str]) -> str:
    """What was written, one a line; a path is never broken."""
    return "".join(f"{name if k == 0 else '':<{INDENT}}{one_line(str(path))}\n" for k, path in enumerate(files))


def plain(text: str) -> str:
    """A text with signs that every terminal shows."""
    return text.replace("−", "-").replace("–", "-").replace("Ω", "ohm").replace("N·s/m", "N s/m")
