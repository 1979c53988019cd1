"""Make texts from files safe to print: names may contain control characters, which a terminal
obeys; list some of many.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


def one_line(text: str) -> str:
    """Text in one line: a blank for each other space, a question mark for each character that
    cannot be printed.

    >>> one_line("Force\\x1b[31m\\t(N)")
    'Force?[31m (N)'
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


def first_of(texts: Sequence[str], limit: int, between: str = ", ") -> str:
    """List of texts for a sentence: up to a limit of them, and how many there are beyond it.

    >>> first_of(["a", "b"], 2), first_of(["a", "b", "c"], 2)
    ('a, b', 'a, b and 1 more')
    """
    more = f" and {len(texts) - limit} more" if len(texts) > limit else ""
    return between.join(texts[:limit]) + more


MAX_RUNS = 12
"""Maximum number of ranges that a list of numbers states. [1]"""


def numbers_text(numbers: Iterable[int]) -> str:
    """List of rising numbers for a sentence, three and more in a row as a range.

    >>> numbers_text([1, 2, 4, 5, 6])
    '1, 2, 4 to 6'
    """
    runs: list[list[int]] = []
    for number in numbers:
        if not runs or number != runs[-1][-1] + 1:
            runs.append([])
        runs[-1].append(number)
    texts = [f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(map(str, run)) for run in runs]
    return first_of(texts, MAX_RUNS)


def printable(text: str) -> str:
    """Text whose line ends alone are kept, each line as `one_line` has it."""
    return "\n".join(map(one_line, text.split("\n")))


def lines(text: str) -> str:
    """Text as `printable` has it, with a blank in whatever a runner of GitHub would take for a
    command.

    A runner reads what a step prints: a command begins a line with two colons, or follows ##[
    anywhere.

    >>> lines("a title\\n  ::error::of it, and ##[debug]more")
    'a title\\n  : :error::of it, and ## [debug]more'
    """
    return re.sub(r"(?m)^(\s*)::", r"\1: :", printable(text)).replace("##[", "## [")


_FORMULA = "=+-@\t\r"
"""Signs with which a spreadsheet begins a formula, also behind a tabulator."""


def cell_text(text: str) -> str:
    """Text for a cell of a table that a spreadsheet opens: an apostrophe before what it would take
    for a formula.

    Numbers stay as they are, and so does a dash for a missing one.

    >>> cell_text("=1+1"), cell_text("-1.5"), cell_text("-"), cell_text("r36.csv")
    ("'=1+1", '-1.5', '-', 'r36.csv')
    """
    if not text.startswith(tuple(_FORMULA)) or len(text) == 1:
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def json_without_commands(content: bytes) -> bytes:
    """JSON of the same value in which a runner of GitHub finds no command.

    >>> json_without_commands(b'{"title": "##[debug]"}')
    b'{"title": "#\\\\u0023[debug]"}'
    """
    return content.replace(b"##[", b"#\\u0023[")
