"""Sizes of texts in the font of the figures."""

from __future__ import annotations

import warnings
from functools import lru_cache
from typing import NamedTuple

from matplotlib.cbook import is_math_text
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

FONT = "DejaVu Sans"
"""Font of the figures, which matplotlib brings along."""

ASCENT, DESCENT = 0.76, 0.24
"""Height and depth of a line of `FONT` about its base line, in sizes of the font."""


class Size(NamedTuple):
    """Size of a text: its width, its whole height, and the part of it below the base line. [pt]"""

    width: float
    height: float
    descent: float


@lru_cache(maxsize=4096)
def text_size(text: str, size: float) -> Size:
    """Size of a text of one line at a size of the font [pt]; a process measures each text once."""
    with warnings.catch_warnings():  # a letter that the font lacks is drawn as a box, and is as wide
        warnings.simplefilter("ignore")
        font = FontProperties(family=FONT, size=size)
        return Size(*map(float, text_to_path.get_text_width_height_descent(text, font, is_math_text(text))))
