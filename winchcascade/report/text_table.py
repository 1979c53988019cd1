"""Tables and sentences in plain text for the terminal: a table library would cost more time than a reduction."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from winchcascade.core.plain_text import one_line
from winchcascade.report.report_model import Cell, T, TableColumn, rows_of

WIDTH = 100


def table_lines(
    rows: Sequence[Sequence[str]], *, left: Collection[int] = (0,), close: Collection[int] = (), indent: str = ""
) -> list[str]:
    """Rows of texts in aligned columns, two spaces apart.

    Parameters
    ----------
    left : columns that are aligned to the left; all others are aligned to the right
    close : columns that stand one space behind the one before them

    Examples
    --------
    >>> table_lines([("log", "load"), ("a.csv", "9")])
    ['log    load', 'a.csv     9']
    """
    width = [max(map(len, column)) for column in zip(*rows, strict=True)]
    gaps = ["" if k == 0 else " " if k in close else "  " for k in range(len(width))]
    lines = []
    for row in rows:
        cells = [c.ljust(w) if k in left else c.rjust(w) for k, (c, w) in enumerate(zip(row, width, strict=True))]
        lines.append(indent + "".join(gap + cell for gap, cell in zip(gaps, cells, strict=True)).rstrip())
    return lines


def plain_cell(value: Cell, decimals: int = 0) -> str:
    """Text of a cell in the terminal; a hyphen for a value that does not exist.

    >>> plain_cell(None), plain_cell(0.25, 3), plain_cell("auto")
    ('-', '0.250', 'auto')
    """
    return "-" if value is None else value if isinstance(value, str) else f"{value:.{decimals}f}"


def without_empty(rows: Sequence[Sequence[str]], head: int = 2) -> list[list[str]]:
    """Rows without the columns that have no entry below the head; the first column stays."""
    used = [k for k in range(len(rows[0])) if k == 0 or any(row[k] not in ("", "-") for row in rows[head:])]
    return [[row[k] for k in used] for row in rows]


def listing(
    columns: Sequence[TableColumn[T]],
    items: Sequence[T],
    *,
    most: int,
    more: str,
    below: Sequence[Sequence[str]] = (),
    used: bool = False,
) -> list[str]:
    """A table of items under their names and units; of more than `most`, the first and the last half of that.

    Parameters
    ----------
    more : what follows the number of the items that are not listed
    below : rows that summarise the others
    used : leave out columns without any entry
    """
    half, rest = most // 2, len(items) - most
    shown = items if rest <= 0 else [*items[:half], *items[-half:]]
    rows = [
        [column.name for column in columns],
        [column.unit for column in columns],
        *([plain_cell(x, c.decimals) for x, c in zip(row, columns, strict=True)] for row in rows_of(columns, shown)),
        *below,
    ]
    lines = table_lines(without_empty(rows) if used else rows)
    if rest > 0:
        lines.insert(2 + half, f"... {rest} {more} ...")
    return lines


def at_most(blocks: Sequence[list[str]], most: int, more: str, indent: str = "") -> list[str]:
    """Lines of the first blocks, and how many more there are.

    >>> at_most([["a"], ["b"], ["c"]], 1, "more, all in --json")
    ['a', '... 2 more, all in --json']
    """
    lines = [line for block in blocks[:most] for line in block]
    return lines if len(blocks) <= most else [*lines, f"{indent}... {len(blocks) - most} {more}"]


def wrapped(text: str, indent: str = "", width: int = WIDTH) -> list[str]:
    """A sentence in lines of so many characters at most."""
    import textwrap

    whole = one_line(text).replace(" %", "\N{NO-BREAK SPACE}%")  # a number and its percent sign stay on one line
    lines = textwrap.wrap(whole, width, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def indented(text: str) -> list[str]:
    """A sentence in lines two columns in."""
    return wrapped(text, indent="  ")
