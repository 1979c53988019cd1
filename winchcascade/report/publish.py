"""Write a report into its files: one page without external files or requests, and a PDF from the same rows and figures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.files import write_content
from winchcascade.report.content import Report as Stated
from winchcascade.report.figures.style import COLOURS
from winchcascade.report.sheet import SUBSCRIPTS, Report, Table, made_at

if TYPE_CHECKING:
    import jinja2
    import typst

FEW = 4
"""A table of numbers with no more columns than this is not stretched over the page."""


def publish(report: Report | Stated, *, html: Path | None = None, pdf: Path | None = None, force: bool = False) -> None:
    """Write a report as a self-contained page, as a PDF, or both, each whole or not at all.

    Raises
    ------
    OutputError : a file that cannot be written, or that this tool did not write and `force` does not allow to replace
    """
    if isinstance(report, Stated):
        from winchcascade.report.render.page import page_text
        from winchcascade.report.render.pdf import pdf_bytes as stated_pdf

        if html is not None:
            write_content(html, page_text(report), force=force)
        if pdf is not None:
            write_content(pdf, stated_pdf(report), force=force)
        return
    for path, content in ((html, html_text), (pdf, pdf_bytes)):
        if path is not None:
            write_content(path, content(report), force=force)


def html_text(report: Report) -> str:
    """A report as one self-contained page; every text is escaped, colours follow the reader's theme."""
    from markupsafe import Markup

    folder, report = template_folder(), cleaned(report)
    return (
        _environment(report.subscripts)
        .get_template("report.html.j2")
        .render(
            report=report,
            style=Markup((folder / "style.css").read_text(encoding="utf-8")),
            script=Markup((folder / "report.js").read_text(encoding="utf-8")),
        )
    )


def table_html(heading: str, table: Table | None) -> str:
    """A heading and a table of a report as HTML for a notebook, without scripts and links; every text is escaped."""
    block = None if table is None else msgspec.convert(_clean(_plain(table) | {"links": ()}), Table)
    return _environment(SUBSCRIPTS).get_template("summary.html.j2").render(heading=shown(heading), block=block)


def _environment(subscripts: Sequence[str]) -> jinja2.Environment:
    """The templates, with what they need to set texts and figures."""
    import jinja2
    from markupsafe import Markup, escape

    symbol = re.compile(rf"\b([EPFvpητ])_({'|'.join(subscripts)})\b")
    between = re.compile(rf"(?<![^\s(]){symbol.pattern}(?![^\s,;:)])")

    def symbols(text: str) -> Markup:
        return Markup(symbol.sub(r"\1<sub>\2</sub>", str(escape(text))).replace(" %", "\u00a0%"))

    def sentence(text: str) -> Markup:
        """A sentence in a cell may hold symbols between other words, and names from files beside them."""
        return Markup(between.sub(r"\1<sub>\2</sub>", str(escape(text))))

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(template_folder()), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    environment.filters |= {
        "symbols": symbols,
        "symbol": lambda text: symbols(text) if symbol.fullmatch(text) else escape(text),
        "sentence": sentence,
        "drawing": lambda svg: Markup(themed(svg)),
        "json": lambda text: Markup(text.replace("<", "\\u003c")),
        "width": width,
        "kind": lambda block: type(block).__name__,
    }
    return environment


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


@cache
def _fonts(folders: tuple[Path, ...]) -> typst.Fonts:
    """The fonts in some folders, which the PDFs of a batch share."""
    import typst

    return typst.Fonts(include_system_fonts=False, font_paths=list(folders))


def pdf_bytes(report: Report) -> bytes:
    """Typeset a report with Typst. Texts reach Typst as data and never as markup, so nothing in them can be a command."""
    import matplotlib
    import typst

    report = cleaned(report)
    text = msgspec.json.encode(report).decode()
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    strange = lacking_letters(msgspec.json.encode(msgspec.structs.replace(report, traces="")).decode())
    fallback = fonts_for(strange) if strange else []
    for c in strange - {c for _, covers in fallback for c in covers}:
        text = text.replace(c, f"⟨U+{ord(c):04X}⟩")
    content = typst.Compiler(
        (template_folder() / "report.typ").read_bytes(),
        font_paths=_fonts((fonts, *(Path(file).parent for file, _ in fallback))),
        sys_inputs={"report": text},
    ).compile(timestamp=int(made_at().timestamp()))
    assert isinstance(content, bytes)
    return content


def lacking_letters(text: str) -> set[str]:
    """Letters of a text that the font which is always there lacks."""
    import matplotlib

    font = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    return {c for c in set(text) if ord(c) > 0x7F and ord(c) not in _covered(font)}


@cache
def _covered(font: Path) -> frozenset[int]:
    """Characters of the font that is always there."""
    return frozenset(_characters(str(font)))


def _characters(font: str) -> set[int]:
    from matplotlib.ft2font import FT2Font

    return set(FT2Font(font).get_charmap())


def fonts_for(strange: set[str]) -> list[tuple[str, set[str]]]:
    """Fonts of this system that hold characters which the fonts at hand lack, likely ones first."""
    from matplotlib.font_manager import findSystemFonts

    likely = re.compile(
        r"cjk|noto|han|hei|ming|song|gothic|malgun|msjh|pingfang|hiragino|arialuni|unifont", re.IGNORECASE
    )
    found: list[tuple[str, set[str]]] = []
    missing = set(strange)
    for file in sorted(findSystemFonts(), key=lambda file: (likely.search(Path(file).name) is None, file)):
        try:
            known = _characters(file)
        except (RuntimeError, OSError):  # a font that cannot be read is none
            continue
        covers = {c for c in missing if ord(c) in known}
        if covers:
            found.append((file, covers))
            missing -= covers
        if not missing:
            break
    return found


# ------------------------------------------------------------------------------------------------- texts and templates
_PACKAGE = Path(__file__).parent.parent


def template_folder() -> Path:
    """Folder of the report's templates."""
    inside = _PACKAGE / "templates"
    return inside if inside.is_dir() else _PACKAGE.parent / "templates"


MAX_CHARACTERS = 1000
"""A text longer than this is cut: no cell may be taller than a page."""

_UNSHOWN = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""Control characters, marks of writing direction, and bytes of a name that are no text."""

_KEPT = {"svg", "traces", "marks"}
"""Fields that are no texts."""


def shown(text: str) -> str:
    """A text with the code of each character that cannot be shown, and of reasonable length.

    >>> shown("a\x07b")
    'a⟨U+0007⟩b'
    """
    text = _UNSHOWN.sub(lambda found: " " if found[0] in "\n\r\t" else f"⟨U+{ord(found[0]):04X}⟩", text)
    if len(text) > MAX_CHARACTERS:
        text = f"{text[:MAX_CHARACTERS]} … ({len(text) - MAX_CHARACTERS} characters more)"
    return text


def cleaned(report: Report) -> Report:
    """A report all of whose texts can be shown."""
    return msgspec.convert(_clean(_plain(report)), Report)


def _plain(block: msgspec.Struct) -> Any:
    """Plain values of a report or a table; a number that keeps what was rounded is a text."""
    return msgspec.to_builtins(block, enc_hook=str)


def _clean(value: Any) -> Any:
    if isinstance(value, str):
        return shown(value)
    if isinstance(value, dict):
        return {k: inner if k in _KEPT else _clean(inner) for k, inner in value.items() if k != "values"}
    if isinstance(value, list | tuple):
        return [_clean(inner) for inner in value]
    return value
