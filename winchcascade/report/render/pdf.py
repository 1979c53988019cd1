"""A report as a PDF, typeset by Typst from the same rows and figures as the page; texts reach it
as data, never as markup.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.version import GENERATOR, made_at
from winchcascade.report.content import Block, Picture, Report, Table
from winchcascade.report.figures.style import WIDTH
from winchcascade.report.glossary import SUBSCRIPTS, clean, typeset
from winchcascade.report.render import drawing
from winchcascade.report.render.fonts import fonts_for, fonts_in, lacking_letters, template_folder


def pdf_bytes(report: Report) -> bytes:
    """Typeset a report."""
    import matplotlib
    import typst

    report = report.illustrated()
    text = msgspec.json.encode(_record(report, drawn=True)).decode()
    strange = lacking_letters(msgspec.json.encode(_record(report, drawn=False)).decode())
    fallback = fonts_for(strange) if strange else []
    for letter in strange - {letter for _, covers in fallback for letter in covers}:
        text = text.replace(letter, f"⟨U+{ord(letter):04X}⟩")
    fonts = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    content = typst.Compiler(
        (template_folder() / "report.typ").read_bytes(),
        font_paths=fonts_in((fonts, *(Path(file).parent for file, _ in fallback))),
        sys_inputs={"report": text},
    ).compile(timestamp=int(made_at().timestamp()))
    assert isinstance(content, bytes)
    return content


def _text(text: str) -> str:
    return typeset(clean(text))


def _record(report: Report, *, drawn: bool) -> dict[str, Any]:
    """A report as the template reads it; `drawn` with its figures."""
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
        "lead": None if report.lead is None else _block(report.lead, drawn=drawn),
        "sections": [
            {
                "heading": _text(one.heading),
                "blocks": [_block(block, drawn=drawn) for block in one.blocks],
            }
            for one in report.sections
        ],
    }


def _block(block: Block, *, drawn: bool) -> dict[str, Any]:
    if isinstance(block, Picture):
        svg = drawing.drawn(block).decode() if drawn else ""
        share = float(block.figure.get_figwidth() / WIDTH) if block.figure is not None else 1.0
        return {
            "type": "picture",
            "caption": _text(block.caption),
            "alt": _text(block.alt),
            "svg": svg,
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
