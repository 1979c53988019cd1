"""A report as PDF, typeset by Typst from the same rows and figures."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.core.files import write_content
from winchcascade.report.page_setup import cleaned, made_at, template_folder

if TYPE_CHECKING:
    from winchcascade.report.report_model import Report


def write_pdf(report: Report, path: Path, *, force: bool = False) -> None:
    """Write a report as PDF; whole or not at all."""
    write_content(path, pdf_bytes(report), force=force)


def pdf_bytes(report: Report) -> bytes:
    """Typeset a report. Texts reach Typst as data and never as markup, so nothing in them can be a command."""
    import matplotlib
    import msgspec
    import typst

    report = cleaned(report)
    text = msgspec.json.encode(report).decode()
    own = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    strange = {c for c in _words(report) if ord(c) > 0x7F and ord(c) not in _covered()}
    fallback = _fonts_for(strange) if strange else []
    for c in strange - {c for _, covers in fallback for c in covers}:
        text = text.replace(c, f"⟨U+{ord(c):04X}⟩")
    fonts = typst.Fonts(include_system_fonts=False, font_paths=[own, *(Path(file).parent for file, _ in fallback)])
    template = (template_folder() / "report.typ").read_bytes()
    made = int(made_at().timestamp())
    content = typst.Compiler(template, font_paths=fonts, sys_inputs={"report": text}).compile(timestamp=made)
    assert isinstance(content, bytes)
    return content


def _words(report: Report) -> set[str]:
    """Characters of all texts of a report."""
    import msgspec

    plain = msgspec.structs.replace(report, traces="")
    return set(msgspec.json.encode(plain).decode())


@cache
def _covered() -> frozenset[int]:
    """Characters of the font that is always there."""
    return frozenset(_characters(_default_font()))


def _default_font() -> str:
    import matplotlib

    return str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf")


def _characters(font: str) -> set[int]:
    from matplotlib.ft2font import FT2Font

    return set(FT2Font(font).get_charmap())


def _fonts_for(strange: set[str]) -> list[tuple[str, set[str]]]:
    """Fonts of this system that hold characters which the fonts at hand lack, likely ones first."""
    from matplotlib.font_manager import findSystemFonts

    likely = re.compile(
        r"cjk|noto|han|hei|ming|song|gothic|malgun|msjh|pingfang|hiragino|arialuni|unifont", re.IGNORECASE
    )
    files = sorted(findSystemFonts(), key=lambda file: (likely.search(Path(file).name) is None, file))
    found: list[tuple[str, set[str]]] = []
    missing = set(strange)
    for file in files:
        try:
            covers = {c for c in missing if ord(c) in _characters(file)}
        except (RuntimeError, OSError):  # a font that cannot be read is none
            continue
        if covers:
            found.append((file, covers))
            missing -= covers
        if not missing:
            break
    return found
