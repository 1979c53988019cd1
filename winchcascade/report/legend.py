"""How much room texts take in a figure: columns of a legend that stay within it, and names cut so that they stay apart."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from winchcascade.report.style import WIDTH

MOST_COLUMNS = 7
"""Entries in a line of a legend at most."""

SHORT = 18
"""Characters of a log's name where there is little room."""

_POINT = 1.0 / 72.0
"""[in]"""


def text_width(text: str) -> float:
    """Width of a text in a legend. [in]"""
    size = float(matplotlib.rcParams["legend.fontsize"])
    with warnings.catch_warnings():  # a letter that the font lacks is drawn as a box, and is as wide
        warnings.simplefilter("ignore")
        width, _, _ = text_to_path.get_text_width_height_descent(text, FontProperties(size=size), False)
    return float(width) * _POINT


def columns_within(texts: Sequence[str], *, handle: float = 2.0, gap: float = 1.1, width: float = 0.98 * WIDTH) -> int:
    """Give the columns of a legend that stay within a width.

    Parameters
    ----------
    handle, gap : length of a key, and room between two columns, in sizes of the font
    width : [in]
    """
    size = float(matplotlib.rcParams["legend.fontsize"]) * _POINT
    key = (handle + float(matplotlib.rcParams["legend.handletextpad"])) * size
    edge = 2.0 * float(matplotlib.rcParams["legend.borderpad"]) * size
    widths = np.array([key + text_width(text) for text in texts])
    for columns in range(min(MOST_COLUMNS, len(texts)), 1, -1):
        filled = sum(float(column.max()) for column in np.array_split(widths, columns))
        if filled + gap * size * (columns - 1) + edge <= width:
            return columns
    return 1


def lines_within(texts: Sequence[str], *, handle: float = 2.0, gap: float = 1.1) -> int:
    """Lines of a legend as wide as the figure."""
    return -(-len(texts) // columns_within(texts, handle=handle, gap=gap))


def cut_apart(names: Sequence[str], most: int = SHORT) -> list[str]:
    """Cut names in the middle, or as near to it as leaves them apart; names that no such cut tells apart are numbered.

    >>> cut_apart(["r9.csv", "2026-03-01_winch_r9.csv", "2026-03-02_winch_r9.csv"])
    ['r9.csv', '2026-03-01…_r9.csv', '2026-03-02…_r9.csv']
    """
    room = most - 1
    for head in sorted(range(2, room - 1), key=lambda head: (abs(head - room / 2.0), head)):
        cut = [name if len(name) <= most else f"{name[:head]}…{name[head - room :]}" for name in names]
        if len(set(cut)) == len(set(names)):
            return cut
    number = {name: k for k, name in enumerate(dict.fromkeys(names), 1)}
    return [name if len(name) <= most else f"{name[: room - 5]}… ({number[name]})" for name in names]
