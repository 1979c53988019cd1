"""A report as one page that needs no other file and makes no request."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.core.files import write_content
from winchcascade.report.page_setup import cleaned, template_folder
from winchcascade.report.style import COLOURS

if TYPE_CHECKING:
    from winchcascade.report.report_model import Report, Table

_SYMBOL = re.compile(
    r"\b([EPFvpητ])_(line|mech|gen, cycle|gen|trans|pto|max|min|mean|plateau|hold|payout|returned|net)\b"
)


FEW = 4
"""A table of numbers with no more columns than this is not stretched over the page."""


def write_html(report: Report, path: Path, *, force: bool = False) -> None:
    """Write a report as a page; whole or not at all."""
    write_content(path, html_text(report), force=force)


def html_text(report: Report) -> str:
    """A report as one self-contained page; every text is escaped, colours follow the reader's theme."""
    import jinja2
    from markupsafe import Markup, escape

    def symbols(text: str) -> Markup:
        return Markup(_SYMBOL.sub(r"\1<sub>\2</sub>", str(escape(text))).replace(" %", "\u00a0%"))

    def symbol(text: str) -> Markup:
        return symbols(text) if _SYMBOL.fullmatch(text) else escape(text)

    def drawing(svg: str) -> Markup:
        return Markup(themed(svg))

    report = cleaned(report)
    folder = template_folder()
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {
        "symbols": symbols,
        "symbol": symbol,
        "drawing": drawing,
        "width": width,
        "kind": lambda block: type(block).__name__,
    }
    style = (folder / "style.css").read_text(encoding="utf-8")
    script = (folder / "report.js").read_text(encoding="utf-8")
    return environment.get_template("report.html.j2").render(
        report=report,
        style=Markup(style),
        script=Markup(script),
        traces=Markup(report.traces.replace("<", "\\u003c")),
    )


def width(table: Table) -> str:
    """How wide a table is: few columns of numbers stand close together; of many the first stays in sight on a phone."""
    if len(table.head) <= FEW and set(table.text_columns) <= {0}:
        return "narrow"
    return "wide" if len(table.head) > FEW and not table.is_long(0) else "full"


def themed(svg: str) -> str:
    """A figure whose named colours are variables of the page, so that it turns dark with it."""
    for name, colour in COLOURS.items():
        svg = svg.replace(colour, f"var(--{name})")
    return svg
