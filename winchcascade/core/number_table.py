"""Small tables of numbers as CSV, with the columns that a command expects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from winchcascade.core.errors import OptionError

LONGEST_LINE = 60
"""Characters of a line that a message quotes."""


def number_rows(
    path: Path,
    columns: Sequence[str],
    holds: Callable[..., object],
    expected: str,
    option: str = "",
) -> list[tuple[float, ...]]:
    """Rows of a table whose first line names the columns; blank lines are left out.

    Parameters
    ----------
    holds : whether the numbers of a row are possible
    expected : the numbers of a row in words, for the message
    option : that names the file, for the message

    Raises
    ------
    OptionError : the file cannot be read, has other columns or no row, or a row is none
    """
    place, header = f"{option} {path}".strip(), ",".join(columns)
    if path.exists() and not path.is_file():
        raise OptionError(f"{place}: is not a file; expected a table that begins with {header}.")
    try:
        head, *lines = path.read_text(encoding="utf-8-sig").splitlines() or [""]
    except (OSError, ValueError) as fault:
        raise OptionError(f"{place}: cannot be read ({fault}); expected {header}.") from None
    if [cell.strip() for cell in head.split(",")] != [*columns]:
        raise OptionError(
            f"{place}: begins with {head[:LONGEST_LINE]!r}; expected the line {header}."
        )
    rows = []
    for number, line in enumerate(lines, 2):
        if not line.strip():
            continue
        try:
            row = tuple(map(float, line.split(",")))
        except ValueError:
            row = ()
        if len(row) != len(columns) or not holds(*row):
            raise OptionError(
                f"{place}: line {number} is {line[:LONGEST_LINE]!r}; expected {expected}."
            )
        rows.append(row)
    if not rows:
        raise OptionError(f"{place}: has no row below {header}; expected {expected} in each.")
    return rows
