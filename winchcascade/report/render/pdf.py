"""A report as a PDF, typeset by Typst from the same rows and figures as the page; texts reach it
as data, never as markup; and the fonts that it needs.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.version import GENERATOR, made_at
from winchcascade.report.content import Block, Picture, Report, Table
from winchcascade.report.figures.style import WIDTH, drawn
from winchcascade.report.glossary import SUBSCRIPTS, clean, typeset
from winchcascade.report.render.page import template_folder

if TYPE_CHECKING:
    import typst


def pdf_bytes(report: Report) -> bytes:
    """Typeset a report."""
    import matplotlib
    import typst

    report = report.illustrated()
    text = msgspec.json.encode(_record(report)).decode()
    figures = {one.id: drawn(one.figure).decode() for one in report.pictures}
    strange = lacking_letters(text)
    fallback = fonts_for(strange) if strange else []
    for letter in strange - {letter for _, covers in fallback for letter in covers}:
        text = text.replace(letter, f"⟨U+{ord(letter):04X}⟩")
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    content = typst.Compiler(
        (template_folder() / "report.typ").read_bytes(),
        font_paths=fonts_in((fonts, *(Path(file).parent for file, _ in fallback))),
        sys_inputs={"report": text, "figures": msgspec.json.encode(figures).decode()},
    ).compile(timestamp=int(made_at().timestamp()))
    assert isinstance(content, bytes)
    return content


def _text(text: str) -> str:
    return typeset(clean(text))


def _record(report: Report) -> dict[str, Any]:
    """A report as the template reads it, figures by their names."""
    return {
        "kind": report.kind,
        "title": _text(report.title),
        "subtitle": _text(report.subtitle),
        "generator": GENERATOR,
        "banner": _text(report.banner),
        "subscripts": SUBSCRIPTS,
        "tiles": [
            {
                "symbol": _text(t.name),
                "name": _text(t.about),
                "value": _text(t.value),
                "interval": _text(t.beside),
            }
            for t in report.tiles
        ],
        "points": [
            {"about": note.about, "text": _text(note.text), "tone": note.tone}
            for note in report.notes
        ],
        "lead": None if report.lead is None else _block(report.lead),
        "sections": [
            {
                "heading": _text(one.heading),
                "blocks": [_block(block) for block in one.blocks],
            }
            for one in report.sections
        ],
    }


def _block(block: Block) -> dict[str, Any]:
    if isinstance(block, Picture):
        share = float(block.figure.get_figwidth() / WIDTH) if block.figure is not None else 1.0
        return {
            "type": "picture",
            "caption": _text(block.caption),
            "alt": _text(block.alt),
            "figure": block.id,
            "share": share,
        }
    if isinstance(block, Table):
        used = block.used()
        body, below = used.listed()
        return {
            "type": "table",
            "caption": _text(block.caption),
            "note": _text(block.note),
            "head": [_text(column.name) for column in used.columns],
            "units": [_text(column.unit) for column in used.columns],
            "text_columns": [k for k, left in enumerate(used.left) if left],
            "rows": [[_text(cell) for cell in row] for row in (*body, *below)],
            "summary": len(below),
        }
    return {"type": "note", "about": _text(block.about), "text": _text(block.text)}


@cache
def fonts_in(folders: tuple[Path, ...]) -> typst.Fonts:
    """The fonts in some folders, which the PDFs of a batch share."""
    import typst

    return typst.Fonts(include_system_fonts=False, font_paths=list(folders))


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
        r"cjk|noto|han|hei|ming|song|gothic|malgun|msjh|pingfang|hiragino|arialuni|unifont",
        re.IGNORECASE,
    )
    found: list[tuple[str, set[str]]] = []
    missing = set(strange)
    for file in sorted(
        findSystemFonts(), key=lambda file: (likely.search(Path(file).name) is None, file)
    ):
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
