"""A report as one self-contained page without requests; every text is escaped, colours follow
the reader's theme.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade.core.version import GENERATOR
from winchcascade.report.content import Picture, Report, Table
from winchcascade.report.figures.style import COLOURS, WIDTH, drawn
from winchcascade.report.glossary import SUBSCRIPT, clean, typeset

if TYPE_CHECKING:
    import jinja2
    from markupsafe import Markup


LONG = 32
"""A longer text in a cell may break into lines. [characters]"""


def page_text(report: Report) -> str:
    """A report as a page."""
    from markupsafe import Markup

    report, folder = report.illustrated(), template_folder()
    histories = any(one.histories for one in report.pictures)
    lead = None if report.lead is None else report.lead.figure
    scripts = [*(["uplot.js"] if histories else []), "page.js"]
    styles = [*(["uplot.css"] if histories else []), "page.css"]
    return (
        _environment()
        .get_template("page.html.j2")
        .render(
            report=report,
            generator=GENERATOR,
            style=Markup("".join((folder / name).read_text(encoding="utf-8") for name in styles)),
            scripts=[Markup((folder / name).read_text(encoding="utf-8")) for name in scripts],
            numbers=_numbered(report),
            beside=lead is not None and lead.get_figwidth() < WIDTH,
        )
    )


def table_html(heading: str, table: Table[Any] | None) -> str:
    """A heading and a table as HTML for a notebook, without scripts and links."""
    return _environment().get_template("notebook.html.j2").render(heading=heading, block=table)


def _numbered(report: Report) -> dict[str, int]:
    """Numbers of figures and tables by their names, each from 1 on."""
    tables = [block for block in report.blocks if isinstance(block, Table)]
    named = ([block.id for block in kind] for kind in (report.pictures, tables))
    return {name: k for names in named for k, name in enumerate(names, start=1)}


@cache
def _environment() -> jinja2.Environment:
    """The templates, with what they need to set texts and figures."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_folder()), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {"text": _text, "svg": _svg, "rows": _rows, "json": _json}
    environment.filters["plain"] = lambda text: typeset(clean(text))
    environment.filters["kind"] = lambda block: type(block).__name__
    environment.globals |= {"long": LONG}
    return environment


def _text(text: str) -> Markup:
    """A text as a page sets it."""
    from markupsafe import Markup, escape

    low = SUBSCRIPT.sub(r"\1<sub>\2</sub>", str(escape(typeset(clean(text)))))
    return Markup(_identifiers().sub(r"<small>\g<0></small>", low))


@cache
def _identifiers() -> re.Pattern[str]:
    """Identifiers in brackets behind labels: those of several words, and those of the catalogue."""
    from winchcascade.rig.effects.catalogue import EFFECTS

    return re.compile(rf"\((?:{'|'.join(EFFECTS)}|[a-z][a-z0-9]*(?:_[a-z0-9]+)+)(?:\([^()]*\))?\)")


def _rows(table: Table[Any]) -> dict[str, Any]:
    """Columns and rows of a table as a page shows them: those that hold something, up to the
    limit.
    """
    used = table.used()
    (body, below), left = used.listed(), used.left
    return {
        "columns": list(zip(used.columns, left, strict=True)),
        "body": body,
        "addresses": used.shortened(used.addresses, counted=False),
        "below": below,
        "left": left,
        "fixed": all(len(row[0]) <= LONG for row in (*body, *below)),
    }


def _svg(picture: Picture) -> Markup:
    """A figure as SVG whose ids are its own and whose colours are those of the page."""
    from markupsafe import Markup

    text = re.sub(r"<metadata>.*?</metadata>", "", drawn(picture.figure).decode(), flags=re.DOTALL)
    text = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{picture.id}-", text[text.index("<svg") :])
    for size in ("width", "height"):
        text = re.sub(rf'(<svg[^>]*?) {size}="[^"]*"', r"\1", text, count=1)
    for name, colour in COLOURS.items():
        text = text.replace(colour, f"var(--{name})")
    return Markup(text)


def _json(text: str) -> Markup:
    """JSON within a script of a page."""
    from markupsafe import Markup

    return Markup(text.replace("<", "\\u003c"))


_PACKAGE = Path(__file__).parents[2]


def template_folder() -> Path:
    """Folder of the report's templates."""
    inside = _PACKAGE / "templates"
    return inside if inside.is_dir() else _PACKAGE.parent / "templates"
