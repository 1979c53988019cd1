"""Texts of figures as runs of glyphs, each laid out once in a process: pages repeat their labels."""

from __future__ import annotations

import re
import warnings
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.cbook import is_math_text
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.textpath import text_to_path

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from winchcascade.core.run import Signal

FONT = "DejaVu Sans"
"""Font of the figures, which matplotlib brings along."""

ASCENT, DESCENT = 0.76, 0.24
"""Height and depth of a line of `FONT` about its base line, in sizes of the font."""

EM = float(text_to_path.FONT_SCALE)
"""Size of the font at which glyphs are given."""

LOWERED, SMALLER, AFTER = -0.15 * EM, 0.7, 0.035 * EM
"""Base line and size of a subscript, and room behind it, as matplotlib sets it."""


class Glyph(NamedTuple):
    """One glyph of a run: its name, its place and its size; a run is set at the size `EM`."""

    name: str
    x: float
    y: float
    size: float


class TextRun(NamedTuple):
    """A text of one line: its width, its height, the part of it below the base line, its glyphs, and bars as outlines."""

    width: float
    height: float
    descent: float
    glyphs: tuple[Glyph, ...]
    bars: tuple[str, ...] = ()


class Size(NamedTuple):
    """Size of a text: its width, its whole height, and the part of it below the base line. [pt]"""

    width: float
    height: float
    descent: float


def text_size(text: str, size: float) -> Size:
    """Size of a text of one line in the font of the figures, at a size of the font. [pt]"""
    run = _run(text, (FONT,), "normal", "normal", is_math_text(text))
    return Size(*(size / EM * x for x in run[:3]))


def text_run(text: str, font: FontProperties, *, is_math: bool) -> TextRun:
    """Lay out a text of one line; with `is_math` it holds mathematics between dollars."""
    return _run(text, tuple(font.get_family()), font.get_style(), font.get_weight(), is_math)


_OUTLINES: dict[str, str] = {}
"""Outline of every glyph of the runs so far, by its name."""


def outline_of(name: str) -> str:
    """Outline of a glyph of a run, as the data of an SVG path in steps of a hundredth of its size."""
    return _OUTLINES[name]


@lru_cache(maxsize=4096)
def _run(text: str, family: tuple[str, ...], style: str, weight: str | int, is_math: bool) -> TextRun:
    font = FontProperties(family=list(family), style=style, weight=weight, size=EM)  # type: ignore[arg-type]  # typed as literals
    with warnings.catch_warnings():  # a letter that the font lacks is drawn as a box
        warnings.simplefilter("ignore")
        if is_math:
            return _with_symbols(text, font) or _mathematics(text, font)
        width, height, descent = text_to_path.get_text_width_height_descent(text, font, False)
        face = get_font(findfont(font))
        face.set_size(EM, text_to_path.DPI)
        glyphs, outlines, _ = text_to_path.get_glyphs_with_font(face, text, return_new_glyphs_only=True)
    return TextRun(float(width), float(height), float(descent), _kept(glyphs, outlines))


def _mathematics(text: str, font: FontProperties) -> TextRun:
    """Lay out mathematics of any kind, which takes some milliseconds."""
    width, height, descent = text_to_path.get_text_width_height_descent(text, font, True)
    glyphs, outlines, bars = text_to_path.get_glyphs_mathtext(font, text)
    drawn = tuple(_outline(np.asarray(points, dtype=np.float64), codes) for points, codes in bars)
    return TextRun(float(width), float(height), float(descent), _kept(glyphs, outlines), drawn)


def _with_symbols(text: str, font: FontProperties) -> TextRun | None:
    """Lay out a text whose mathematics are letters with an upright subscript alone; None for any other."""
    plain, *symbols = _SYMBOL.split(text)
    parts = [(plain, "normal", 1.0, 0.0)]
    for letter, subscript, after in zip(symbols[::3], symbols[1::3], symbols[2::3], strict=True):
        parts += [
            (_GREEK.get(letter, letter), "italic", 1.0, 0.0),
            (subscript, "normal", SMALLER, LOWERED),
            (after, "normal", 1.0, 0.0),
        ]
    if any(_SPECIAL.search(part[0]) for part in parts):
        return None
    x = ascent = descent = 0.0
    glyphs: list[Glyph] = []
    for words, style, size, y in parts:
        run = _run(words, tuple(font.get_family()), style, font.get_weight(), False)
        glyphs += (Glyph(glyph.name, x + size * glyph.x, y, size) for glyph in run.glyphs)
        x += size * run.width + (AFTER if size != 1.0 else 0.0)
        ascent, descent = max(ascent, size * (run.height - run.descent) + y), max(descent, size * run.descent - y)
    return TextRun(x, ascent + descent, descent, tuple(glyphs))


_SYMBOL = re.compile(r"\$(\\[a-z]+|[A-Za-z])_\\mathrm\{([A-Za-z0-9]+)\}\$")
_GREEK = {r"\eta": "η", r"\tau": "τ"}
_SPECIAL = re.compile(r"[$\\]")


def _kept(glyphs: Iterable[Sequence[Any]], outlines: Mapping[str, tuple[Any, Any]]) -> tuple[Glyph, ...]:
    """The glyphs of a run; outlines that are new are kept."""
    for name, (points, codes) in outlines.items():
        if name not in _OUTLINES:
            _OUTLINES[name] = _outline(np.asarray(points, dtype=np.float64), codes)
    return tuple(Glyph(name, float(x), float(y), float(size)) for name, x, y, size in glyphs)


_LETTER = {1: "M", 2: "L", 3: "Q", 4: "C", 79: "z"}
"""Letters of an SVG path by matplotlib's codes of a path."""


def _outline(points: Signal, codes: Iterable[int]) -> str:
    """Points and codes of a path as data of an SVG path; y rises, as in a font."""
    words, before = [], 0
    for (x, y), code in zip(points.tolist(), map(int, codes), strict=True):
        if code != before or code == 1:
            words.append(_LETTER[code])
        if code != 79:
            words.append(f"{x:.2f} {y:.2f}")
        before = code
    return " ".join(words)
