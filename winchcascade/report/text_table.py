"""Tables and sentences in plain text for the terminal: a table library would cost more time than a reduction."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from winchcascade.core.campaign_file import Origin, origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.report.screen import PIPED, Tone, length, line_width, table_width, toned, without_tones
from winchcascade.report.sheet import Cell, Limit, T, TableColumn, rows_of, with_common_decimals


def aligned_lines(
    rows: Sequence[Sequence[str]], *, left: Collection[int] = (0,), close: Collection[int] = (), indent: str = ""
) -> list[str]:
    """Rows of texts in aligned columns, two spaces apart, however wide they get.

    Parameters
    ----------
    left : columns that are aligned to the left; all others are aligned to the right
    close : columns that stand one space behind the one before them

    Examples
    --------
    >>> aligned_lines([("log", "load"), ("a.csv", "9")])
    ['log    load', 'a.csv     9']
    """
    width = _widths(rows)
    gaps = ["" if k == 0 else " " if k in close else "  " for k in range(len(width))]
    lines = []
    for row in rows:
        blanks = [" " * (w - length(cell)) for w, cell in zip(width, row, strict=True)]
        cells = [c + b if k in left else b + c for k, (c, b) in enumerate(zip(row, blanks, strict=True))]
        lines.append(indent + "".join(gap + cell for gap, cell in zip(gaps, cells, strict=True)).rstrip())
    return lines


def _widths(rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(length, column)) for column in zip(*rows, strict=True)]


def table_lines(
    rows: Sequence[Sequence[str]],
    *,
    left: Collection[int] = (0,),
    close: Collection[int] = (),
    indent: str = "",
    omit: Sequence[str] = (),
    heads: Sequence[str] = (),
) -> list[str]:
    """Rows of texts in aligned columns within the width of the terminal; a last line names the columns that are left out.

    Parameters
    ----------
    left, close : as for `aligned_lines`
    omit : heads of columns in the order in which they are left out, those of one step parted by commas; then the longest
        texts are cut
    heads : of the columns, by default the first row
    """
    limit = table_width()
    if limit is None:
        return aligned_lines(rows, left=left, close=close, indent=indent)
    names, width, gone = [head.strip() for head in heads or rows[0]], _widths(rows), []
    shown = list(range(len(names)))

    def over() -> int:
        return len(indent) + sum(width[k] + (k != shown[0]) * (2 - (k in close)) for k in shown) - limit

    for step in omit:
        if over() <= 0:
            break
        gone += [k for k in shown if names[k] in step.split(", ")]
        shown = [k for k in shown if k not in gone]
    texts = [k for k in shown if k in left]
    if over() > 0 and texts:
        longest = max(texts, key=lambda k: width[k])
        width[longest] = max(width[longest] - over(), _SHORTEST)
    lines = aligned_lines(
        [[_cut(row[k], width[k]) for k in shown] for row in rows],
        left={shown.index(k) for k in texts},
        close={shown.index(k) for k in shown if k in close},
        indent=indent,
    )
    absent = ", ".join(dict.fromkeys(names[k] for k in gone))
    return lines + (wrapped(f"(omitted at {limit} columns: {absent})", indent) if gone else [])


_SHORTEST = 8
"""Columns to which a text is cut at most. [characters]"""


def _cut(text: str, width: int) -> str:
    """A text that ends in a sign of omission where it is too long."""
    return text if length(text) <= width else f"{without_tones(text)[: width - 1]}…"


def plain_cell(value: Cell, decimals: int = 0) -> str:
    """Text of a cell in the terminal; a hyphen for a value that does not exist.

    >>> plain_cell(None), plain_cell(0.25, 3), plain_cell("auto")
    ('-', '0.250', 'auto')
    """
    return "-" if value is None else value if isinstance(value, str) else f"{value:.{decimals}f}"


def without_empty(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Rows without the columns that have no entry below names and units; the first column stays."""
    used = [k for k in range(len(rows[0])) if k == 0 or any(row[k] not in ("", "-") for row in rows[2:])]
    return [[row[k] for k in used] for row in rows]


def listing(
    columns: Sequence[TableColumn[T]],
    items: Sequence[T],
    limit: Limit,
    *,
    below: Sequence[Sequence[str]] = (),
    used: bool = False,
    omit: Sequence[str] = (),
) -> list[str]:
    """A table of items under their names and units, as many as the limit allows.

    Parameters
    ----------
    below : rows that summarise the others
    used : leave out columns without any entry
    omit : as for `table_lines`
    """
    maximum = limit.maximum
    half, rest = (
        maximum // 2,
        len(items) - maximum if len(items) != maximum + 1 else 0,
    )  # a line for one would save none
    shown = items if rest <= 0 else [*items[:half], *items[-half:]]
    rows = [
        [column.name for column in columns],
        [column.unit for column in columns],
        *(
            [plain_cell(x, c.decimals) for x, c in zip(row, columns, strict=True)]
            for row in with_common_decimals(columns, rows_of(columns, shown))
        ),
        *below,
    ]
    lines = table_lines(without_empty(rows) if used else rows, omit=omit)
    if rest > 0:
        lines.insert(2 + half, f"... {rest} {limit.more} ...")
    return lines


def metric_steps(energies: Sequence[str], ratios: Iterable[str]) -> list[str]:
    """Metrics in the order in which a table leaves them out: energies of inner stages, efficiencies but the last, the others.

    >>> metric_steps(["energy_line", "energy_mech", "energy_gen"], ["eta_trans", "eta_gen", "eta_pto"])
    ['E_mech', 'eta_trans', 'eta_gen', 'E_line']
    """
    return [name.replace("energy", "E") for name in (*energies[1:-1], *list(ratios)[:-1], *energies[:1])]


def at_most(blocks: Sequence[list[str]], maximum: int, more: str, indent: str = "") -> list[str]:
    """Lines of the first blocks, and how many more there are.

    >>> at_most([["a"], ["b"], ["c"]], 1, "more, all in --json")
    ['a', '... 2 more, all in --json']
    """
    lines = [line for block in blocks[:maximum] for line in block]
    return lines if len(blocks) <= maximum else [*lines, f"{indent}... {len(blocks) - maximum} {more}"]


def wrapped(text: str, indent: str = "", piped: int | None = PIPED) -> list[str]:
    """A sentence in lines that fit into the terminal.

    Parameters
    ----------
    piped : columns in a pipe; None for one line [characters]
    """
    import textwrap

    whole = one_line(text).replace(" %", "\N{NO-BREAK SPACE}%")  # a number and its percent sign stay on one line
    width = line_width(piped or length(whole) + len(indent) + 1)
    lines = textwrap.wrap(whole, width, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def joined(lines: Iterable[str]) -> str:
    """Lines as a text, each with its end."""
    return "".join(f"{line}\n" for line in lines)


def indented(text: str) -> list[str]:
    """A sentence in lines two columns in."""
    return wrapped(text, indent="  ")


def headed(lines: Sequence[str], head: str, tone: Tone) -> list[str]:
    """Lines with the first mention of a word in the first of them in colour."""
    return [line if k else line.replace(head, toned(head, tone), 1) for k, line in enumerate(lines)]


def data_lines(origins: Sequence[Origin], piped: int | None = PIPED) -> list[str]:
    """Whether data are measured and where they come from; a warning where any are not."""
    return headed(wrapped(f"data: {one_line(origin_words(origins))}", piped=piped), "not measured", "warning")


def file_lines(name: str, files: Sequence[Path | str], margin: int = 0) -> str:
    """What was written, one a line; a path is never broken.

    >>> file_lines("files:", ["a.html", "a.pdf"])
    'files: a.html\\n       a.pdf\\n'
    """
    beside = f"{name:<{margin or len(name) + 1}}"
    return "".join(f"{' ' * len(beside) if k else beside}{one_line(str(path))}\n" for k, path in enumerate(files))
