"""Texts from files as text alone: names may hold anything, and a terminal obeys control characters."""

from __future__ import annotations


def one_line(text: str) -> str:
    """Text in one line: a blank for each other space, a question mark for each character that cannot be printed.

    >>> one_line("Force\\x1b[31m\\t(N)")
    'Force?[31m (N)'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def lines(text: str) -> str:
    """Text whose line ends alone are kept, each line as `one_line` has it."""
    return "\n".join(map(one_line, text.split("\n")))
