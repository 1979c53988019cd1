"""Style of all figures: named colours that a page may turn dark, sizes of texts and legends, and figures as SVG text."""

from __future__ import annotations

import io
import logging
import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Literal, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # what it says of its own caches and settings is not our user's

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 6.7
"""Width of a figure: that of a page of A4 between its margins. [in]"""

COLOURS = {
    "ink": "#1b1e23",
    "soft": "#5c6470",
    "grid": "#d9dde3",
    "paper": "#fefefe",
    "line": "#12355b",
    "mech": "#b8432f",
    "gen": "#2f8f7b",
    "extra": "#8a6fb0",
    "loss": "#b9bec6",
    "payout": "#dbe7f5",
    "hold": "#efeff0",
    "over": "#f6e7d8",
    "load0": "#5b5f9e",
    "load1": "#3a7fc4",
    "load2": "#1f9aa0",
    "load3": "#4f9a3d",
    "load4": "#b58900",
    "load5": "#d0601f",
    "load6": "#a8246f",
}
"""Colours by name, each used once: apart in grey (line, mech, gen from dark to light) and to the colour-blind."""

LOAD_COLOURS = tuple(f"load{k}" for k in range(7))
"""Colours of logs in the order of their loads, from an open circuit to the heaviest."""


class Look(NamedTuple):
    """Look of a stage in figures: name of its colour, dashes of its lines, and marker."""

    colour: str
    dashes: str | tuple[int, tuple[float, ...]]
    mark: str


_STAGES = {
    "line": Look("line", "-", "o"),
    "mech": Look("mech", (0, (5, 1.2)), "s"),
    "gen": Look("gen", (0, (2.2, 1.2)), "^"),
    "hyd": Look("load1", (0, (7, 1.2, 1.2, 1.2)), "D"),
    "ac": Look("extra", (0, (1.2, 1.2)), "v"),
}
_OWN_STAGES = (
    Look("load4", (0, (5, 1.2, 1.2, 1.2)), "P"), Look("load6", (0, (3, 1.2)), "X"), Look("load3", (0, (8, 2)), "<"),
    Look("load5", (0, (4, 1, 1, 1, 1, 1)), ">"), Look("load0", (0, (1.6, 0.8)), "h"),
)  # fmt: skip


def look_of(stage: str) -> Look:
    """Look of a stage, the same in every report; lines differ in dashes too, for those who cannot distinguish the colours."""
    return _STAGES.get(stage) or _OWN_STAGES[sum(map(ord, stage)) % len(_OWN_STAGES)]


_RC = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titley": 1.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": COLOURS["soft"],
    "axes.labelcolor": COLOURS["ink"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": COLOURS["grid"],
    "grid.linewidth": 0.5,
    "xtick.color": COLOURS["soft"],
    "ytick.color": COLOURS["soft"],
    "xtick.labelcolor": COLOURS["ink"],
    "ytick.labelcolor": COLOURS["ink"],
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "text.color": COLOURS["ink"],
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "legend.handlelength": 2.6,
    "lines.linewidth": 0.9,
    "hatch.linewidth": 0.5,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "svg.fonttype": "path",
    "svg.hashsalt": "winchcascade",
    "path.simplify": True,
    "figure.constrained_layout.use": False,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw within this context in the project's style, whatever the user's matplotlib is set to."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]  # its keys are typed as literals
        yield


class Room(NamedTuple):
    """Edges of the panels of a figure, as shares of its width, and the room above and below them [in]."""

    left: float = 0.09
    right: float = 0.985
    head: float = 0.3
    foot: float = 0.42


def wide_figure(height: float, room: Room = Room()) -> Figure:  # noqa: B008  # a named tuple does not change
    """An empty figure as wide as a page and of some height [in]."""
    figure = Figure((WIDTH, height))
    figure.subplots_adjust(room.left, room.foot / height, room.right, 1 - room.head / height)
    return figure


def panel_figure(
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    room: Room = Room(),  # noqa: B008
    gaps: Mapping[str, float] | None = None,
    share: Literal["", "x", "y", "xy"] = "",
) -> tuple[Figure, list[Axes]]:
    """A figure as wide as a page with its panels, row by row.

    Parameters
    ----------
    height : [in]
    gaps : `wspace` and `hspace` between the panels, as shares of a panel
    share : axes that all panels have in common
    """
    figure = wide_figure(height, room)
    grid = figure.subplots(
        rows, columns, sharex="x" in share, sharey="y" in share, squeeze=False, gridspec_kw=dict(gaps or {})
    )
    return figure, list(grid.ravel())


def label_panel(axes: Axes, letter: str, title: str, *, x: str = "", y: str = "") -> None:
    """Write a panel's letter and title above it, to the left, and the labels of its axes that are given."""
    axes.set_title(f"({letter}) {title}", loc="left", pad=3)
    axes.set(**{"xlabel": x} if x else {}, **{"ylabel": y} if y else {})


def svg_text(figure: Figure, name: str) -> str:
    """A figure as one SVG element whose ids begin with its name, so that several may stand in one page."""
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    text = text.replace("url(#", f"url(#{name}-")
    text = re.sub(r' d="[^"]*"', lambda found: _shorter(found[0]), text)
    return re.sub(r"\s*\n\s*", "\n", text).strip()


def _shorter(outline: str) -> str:
    """An outline with hundredths of a point, which no screen shows, and without line breaks."""
    return re.sub(r"\s+", " ", re.sub(r"(\.\d\d)\d+", r"\1", outline))


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
    """Cut names in the middle, or as near to it as leaves them apart; names that no such cut distinguishes are numbered.

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
