"""Fonts that a PDF needs beside the one that is always there, and the folder of the templates."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typst

_PACKAGE = Path(__file__).parents[2]


def template_folder() -> Path:
    """Folder of the report's templates."""
    inside = _PACKAGE / "templates"
    return inside if inside.is_dir() else _PACKAGE.parent / "templates"


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
