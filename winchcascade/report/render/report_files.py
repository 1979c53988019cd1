"""Files of a report: page and PDF; for papers its figures, and its tables as CSV with numbers in
full, as LaTeX and as Markdown as shown.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade.core.errors import OutputError
from winchcascade.core.files import write_content, write_set
from winchcascade.core.plain_text import cell_text
from winchcascade.core.store import inside, make_one
from winchcascade.core.version import GENERATOR
from winchcascade.report.content import PROVENANCE, Report, Table
from winchcascade.report.figures.style import drawn
from winchcascade.report.glossary import RAISED, SUBSCRIPT, typeset

if TYPE_CHECKING:
    import pandas as pd


ENDINGS = (".html", ".pdf")
"""Endings of the files of a report."""

FIGURE_FORMATS = ("svg", "pdf", "png")
"""Files of a figure."""


def stem_of(name: str) -> str:
    """How the names of files about a log or a campaign begin: its name with hyphens for blanks and
    signs.

    >>> stem_of("Versuch 3 (März)"), stem_of("...")
    ('Versuch-3-März', 'report')
    """
    return re.sub(r"[^\w.]+", "-", unicodedata.normalize("NFC", name)).strip("-._")[:80] or "report"


def write_tables(report: Report, folder: Path, name: str, *, force: bool = False) -> None:
    """Write each table of a report but its provenance as CSV, LaTeX and Markdown into a folder,
    all or none.

    Raises
    ------
    OutputError : the folder cannot be written, or holds a file of that name from elsewhere and
        `force` does not allow it
    """
    tables = (b for b in report.blocks if isinstance(b, Table) and b.id != PROVENANCE)
    _write(
        {f"{stem_of(name)}_{t.id}.{ending}": text for t in tables for ending, text in _texts(t)},
        folder,
        force=force,
    )


def write_figures(report: Report, folder: Path, name: str, *, force: bool = False) -> None:
    """Write each figure of a report as SVG, PDF and PNG into a folder, all or none; errors as of
    `write_tables`.
    """
    _write(
        {
            f"{stem_of(name)}_{one.id}.{ending}": drawn(one.figure, ending)
            for one in report.pictures
            if one.figure is not None
            for ending in FIGURE_FORMATS
        },
        folder,
        force=force,
    )


def _write(contents: dict[str, bytes], folder: Path, *, force: bool) -> None:
    make_one(folder)
    parts = {inside(folder, name): content for name, content in contents.items()}
    for path in parts:
        marked = path.with_suffix(".md") if path.suffix == ".csv" else path
        if (
            path.exists()
            and not force
            and not (marked.is_file() and b"winchcascade/" in marked.read_bytes())
        ):
            raise OutputError(
                f"{path}: exists and was not written by winchcascade; choose another folder or "
                f"add --force."
            )
    if parts:
        write_set(parts)


def _texts(table: Table[Any]) -> Iterator[tuple[str, bytes]]:
    """Endings and contents of the files of a table."""
    used = table.used()
    yield "csv", csv_text(used.frame()).encode()
    yield "tex", latex_text(used).encode()
    yield "md", markdown_text(used).encode()


def csv_text(frame: pd.DataFrame) -> str:
    """A frame as CSV; a text that a spreadsheet would take for a formula stands behind an
    apostrophe.

    >>> import pandas as pd
    >>> csv_text(pd.DataFrame({"a": ["=1+1", "b"], "n": [-1.5, 2.0]}))
    "a,n\\n'=1+1,-1.5\\nb,2.0\\n"
    """
    safe = frame.map(lambda cell: cell_text(cell) if isinstance(cell, str) else cell)
    return str(safe.rename(columns=cell_text).to_csv(index=False, lineterminator="\n"))


def _shown_frame(table: Table[Any]) -> pd.DataFrame:
    """The table as it is shown."""
    import pandas as pd

    heads = [f"{c.name} ({c.unit})" if c.unit else c.name for c in table.columns]
    return pd.DataFrame(
        [[typeset(cell) for cell in row] for row in table.texts],
        columns=[typeset(h) for h in heads],
    )


def latex_text(table: Table[Any]) -> str:
    """A table for LaTeX with the package booktabs."""
    kinds = "".join("l" if left else "r" for left in table.left)
    frame = _shown_frame(table).map(latex).rename(columns=latex)
    text = frame.to_latex(
        index=False,
        escape=False,
        column_format=kinds,
        caption=latex(typeset(table.caption)),
        label=f"tab:{table.id}",
    )
    return f"% {GENERATOR}; requires the package booktabs\n{text}"


_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}", "\u00a0": "~",
    "\u2212": "$-$", "–": "--", "·": r"$\cdot$", "×": r"$\times$", "±": r"$\pm$", "≤": r"$\leq$", "≥": r"$\geq$",
    "→": r"$\rightarrow$", "°": r"$^{\circ}$", "µ": r"$\mu$", "η": r"$\eta$", "τ": r"$\tau$", "Ω": r"$\Omega$",
    "ω": r"$\omega$", "Δ": r"$\Delta$", "σ": r"$\sigma$", "ρ": r"$\rho$",
} | {chr(raised): f"$^{{{chr(plain)}}}$" for plain, raised in RAISED.items()}  # fmt: skip
"""What LaTeX writes for a character that means something else to it, or that its usual fonts do
not hold.
"""


def latex(text: str) -> str:
    r"""A text for LaTeX: special characters escaped, symbols with their subscripts in mathematics.

    >>> print(latex("η_pto"), latex("50 % of a_b & c"))
    $\eta$$_{\mathrm{pto}}$ 50 \% of a\_b \& c
    """
    parts = SUBSCRIPT.split(
        text
    )  # what is between symbols, and of each symbol its letter and what stands low
    plain = ["".join(_SPECIAL.get(letter, letter) for letter in part) for part in parts]
    low = (f"$_{{\\mathrm{{{part}}}}}$" for part in plain[2::3])
    symbols = [
        f"{letter if '$' in letter else f'${letter}$'}{part}"
        for letter, part in zip(plain[1::3], low, strict=True)
    ]
    return "".join(a + b for a, b in zip(plain[::3], [*symbols, ""], strict=True))


def markdown_text(table: Table[Any]) -> str:
    """A table for Markdown, under its caption and above its note."""
    frame = _shown_frame(table)
    escaped = [[_escaped(cell) for cell in row] for row in (frame.columns, *frame.to_numpy())]
    rules = [":--" if left else "--:" for left in table.left]
    rows = "\n".join(f"| {' | '.join(row)} |" for row in (escaped[0], rules, *escaped[1:]))
    note = f"\n\n{_escaped(typeset(table.note))}" if table.note else ""
    caption = _escaped(typeset(table.caption))
    return f"**Table.** {caption}\n\n{rows}{note}\n\n<!-- {GENERATOR} -->\n"


def _escaped(text: str) -> str:
    return re.sub(r"([\\`*_{}\[\]<>|~#])", r"\\\1", text)


def publish(
    report: Report, *, html: Path | None = None, pdf: Path | None = None, force: bool = False
) -> None:
    """Write a report as a self-contained page, as a PDF, or both, each whole or not at all.

    Raises
    ------
    OutputError : a file that cannot be written, or that this tool did not write and `force` does
        not allow to replace
    """
    from winchcascade.report.render.page import page_text
    from winchcascade.report.render.pdf import pdf_bytes

    if html is not None:
        write_content(html, page_text(report), force=force)
    if pdf is not None:
        write_content(pdf, pdf_bytes(report), force=force)
