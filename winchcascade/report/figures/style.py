"""Style of all figures: named colours that a page may turn dark, panels by constrained layout,
looks and legends.
"""

from __future__ import annotations

import io
import logging
import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from winchcascade.core.version import GENERATOR

logging.getLogger("matplotlib").setLevel(
    logging.ERROR
)  # what it says of its own caches and settings is not our user's

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from winchcascade.core.run import Signal

T = TypeVar("T")

WIDTH = 6.7
"""Width of every figure but the first one of a diagnosis: that of a page of A4 between its
margins. [in]
"""

NARROW = 4.4
"""Width of a figure that stands beside the sentences of the first screen. [in]"""

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
    "above": "#2f74b5",
    "below": "#c26a1b",
    "payout": "#dbe7f5",
    "hold": "#efeff0",
    "over": "#f6e7d8",
    "repaired": "#d1478f",
    "load0": "#5b5f9e",
    "load1": "#3a7fc4",
    "load2": "#1f9aa0",
    "load3": "#4f9a3d",
    "load4": "#b58900",
    "load5": "#d0601f",
    "load6": "#a8246f",
}
"""Colours by name, each used once: apart in grey (line, mech, gen from dark to light) and to the
colour-blind; signs are blue (above) and orange (below).
"""

LOAD_COLOURS = tuple(f"load{k}" for k in range(7))
"""Colours of loads: that of an open circuit, then those of the others in their order."""


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
    """Look of a stage, the same in every report; lines differ in dashes too, for those who
    cannot distinguish the colours.
    """
    return _STAGES.get(stage) or _OWN_STAGES[sum(map(ord, stage)) % len(_OWN_STAGES)]


FONT = "DejaVu Sans"
"""Font of figures and of the PDF, which Matplotlib brings along."""

OTHER_FONTS = (
    "Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans SC", "Microsoft YaHei", "PingFang SC", "Hiragino Sans", "MS Gothic",
    "Malgun Gothic", "WenQuanYi Micro Hei", "Arial Unicode MS", "Unifont",
)  # fmt: skip
"""Fonts of systems for letters that it lacks, as far as they are there."""

_RC = {
    "text.hinting": "none",  # texts as wide as in SVG and PDF, so that a layout holds there
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 3.0,
    "axes.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.edgecolor": COLOURS["soft"],
    "axes.labelcolor": COLOURS["ink"],
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,  # every tick has its number in full, up to nine digits
    "axes.formatter.limits": (-9, 9),
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
    "legend.handlelength": 2.4,
    "legend.columnspacing": 1.2,
    "legend.borderaxespad": 0.2,
    "lines.linewidth": 0.9,
    "hatch.linewidth": 0.5,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "svg.hashsalt": "winchcascade",
    "path.simplify": True,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw within this context in the project's style, whatever the user's matplotlib is set to."""
    import matplotlib
    from matplotlib.font_manager import get_font_names

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        there = set(get_font_names())
        matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]  # its keys are typed as literals
        matplotlib.rcParams["font.family"] = [
            FONT,
            *(name for name in OTHER_FONTS if name in there),
        ]
        yield


# ------------------------------------------------------------------------------- files of a figure
_ABOUT: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": GENERATOR},
    "pdf": {"CreationDate": None, "Creator": GENERATOR},
    "png": {"Software": GENERATOR},
}


_DRAWN: WeakKeyDictionary[Figure, dict[str, bytes]] = WeakKeyDictionary()
"""Files of the figures of a report, by their endings: its page, its PDF and its folder of
figures share them.
"""


def drawn(figure: Figure | None, ending: str = "svg") -> bytes:
    """The figure of a picture, which does not change afterwards, as SVG, PDF or PNG."""
    assert figure is not None  # renderers leave out pictures of nothing
    files = _DRAWN.setdefault(figure, {})
    if ending not in files:
        files[ending] = _draw(figure, ending)
    return files[ending]


@house_style()
def _draw(figure: Figure, ending: str) -> bytes:
    """Draw a figure; its layout is made once, as a second one would differ by rounding."""
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)
    out = io.BytesIO()
    figure.savefig(out, format=ending, dpi=300, metadata=_ABOUT[ending])
    return out.getvalue()


# ----------------------------------------------------------------------------------------- panels
def wide_figure(height: float) -> Figure:
    """An empty figure of some height [in], laid out by constrained layout when it is drawn."""
    from matplotlib.figure import Figure

    return Figure((WIDTH, height), layout="constrained")


def panel_figure(
    height: float, rows: int = 1, columns: int = 1, *, share: Literal["", "x", "y", "xy"] = ""
) -> tuple[Figure, list[Axes]]:
    """A figure with its panels, row by row.

    Parameters
    ----------
    height : [in]
    share : axes that all panels have in common
    """
    figure = wide_figure(height)
    grid = figure.subplots(rows, columns, sharex="x" in share, sharey="y" in share, squeeze=False)
    return figure, list(grid.ravel())


def label_panel(
    axes: Axes, letter: str, title: str, *, x: str = "", y: str = "", unit: str = ""
) -> None:
    """Write a panel's letter and title above it, to the left, and the labels of its axes that are
    given.

    The title has a fixed place, unless there is a second axis above the panel: to look for a free
    one, Matplotlib would measure all ticks once more in each pass of the layout. A power of ten,
    which numbers from 1e9 on have, is to the right.

    Parameters
    ----------
    unit : that of the vertical axis, where the title says which quantity it has
    """
    axes.set_title(f"({letter}) {title}", loc="left", y=None if axes.child_axes else 1.0)
    axes.yaxis.set_offset_position("right")
    label = y or unit
    axes.set(**{"xlabel": x} if x else {}, **{"ylabel": label} if label else {})


def from_zero(ax: Axes) -> None:
    """Begin a vertical axis at zero, or below it where a mark lies there."""
    ax.set_ylim(bottom=min(0.0, ax.dataLim.y0))


def shade_over_speed(ax: Axes, rated: float | None) -> bool:
    """Shade what lies over the rated speed of the generator, if the axis extends that far; True
    if it does.
    """
    low, high = ax.get_xlim()
    if rated is None or rated >= high:
        return False
    ax.axvspan(max(rated, low), high, color=COLOURS["over"], lw=0, zorder=0.1)
    ax.set_xlim(low, high)
    return True


def dots(ax: Axes, x: Signal, y: Signal, colour: str) -> None:
    """Draw points as one path of very short strokes: a marker each would make the file ten times
    as large.
    """
    gap, short = np.full(x.size, np.nan), 1e-3 * float(np.ptp(x, axis=None)) if x.size else 0.0
    across, up = np.column_stack((x, x + short, gap)).ravel(), np.column_stack((y, y, gap)).ravel()
    ax.plot(across, up, color=colour, lw=1.7, alpha=0.45, solid_capstyle="round")


def draw_intervals(
    ax: Axes, x: Sequence[float], ends: Sequence[Sequence[float]], look: Look, full: Sequence[bool]
) -> None:
    """Draw values with their intervals.

    Parameters
    ----------
    x : place of each
    ends : value, low and high of each; an end that is not finite is not drawn
    full : whether the marker of each is full
    """
    at, filled = np.array(x), np.array(full, dtype=bool)
    value, low, high = np.array(ends, dtype=float).reshape(-1, 3).T
    colour = COLOURS[look.colour]
    ax.vlines(at, low, high, color=colour, lw=1.1, ls=look.dashes)
    for some, face in ((filled, colour), (~filled, COLOURS["paper"])):
        ax.plot(at[some], value[some], look.mark, color=colour, mfc=face, ms=4)


def readable(unit: str, *signals: Signal) -> tuple[float, str]:
    """Factor and unit that keep the numbers of an axis short: thousands from 10 000 on, smaller
    units below 0.01.
    """
    peak = max((float(np.max(np.abs(x))) for x in signals if x.size), default=0.0)
    if unit not in ("N", "W", "J", "N·m") or 0.01 <= peak < 1e4 or peak == 0.0:
        return 1.0, unit
    return (
        (1e-3, f"k{unit}")
        if peak >= 1e4
        else (1e3, f"m{unit}")
        if peak >= 1e-5
        else (1e6, f"µ{unit}")
    )


def evenly(items: Sequence[T], maximum: int) -> list[T]:
    """Items that are evenly spread, up to a maximum number, the first and the last among them.

    >>> evenly("abcdefg", 3), evenly("ab", 3)
    (['a', 'd', 'g'], ['a', 'b'])
    """
    even = np.linspace(0, max(len(items) - 1, 0), min(len(items), maximum)).round().astype(int)
    return [items[k] for k in even.tolist()]


# ------------------------------------------------------------------------------------------ names
SHORT = 18
"""Characters of a log's name where it must be short."""


def broken(text: str, characters: int) -> str:
    """A text in lines of a maximum number of characters, broken at blanks."""
    return "\n".join(textwrap.wrap(text, characters, break_on_hyphens=False))


def cut_apart(names: Sequence[str], maximum: int = SHORT) -> list[str]:
    """Cut names in the middle, or as near to it as leaves them apart; names that no such cut
    distinguishes are numbered.

    >>> cut_apart(["r9.csv", "2026-03-01_winch_r9.csv", "2026-03-02_winch_r9.csv"])
    ['r9.csv', '2026-03-01…_r9.csv', '2026-03-02…_r9.csv']
    """
    room = maximum - 1
    for head in sorted(range(2, room - 1), key=lambda head: (abs(head - room / 2.0), head)):
        cut = [
            name if len(name) <= maximum else f"{name[:head]}…{name[head - room :]}"
            for name in names
        ]
        if len(set(cut)) == len(set(names)):
            return cut
    number = {name: k for k, name in enumerate(dict.fromkeys(names), 1)}
    return [
        name if len(name) <= maximum else f"{name[: room - 5]}… ({number[name]})" for name in names
    ]


# ---------------------------------------------------------------------------------------- legends
MARKS = ("o", "s", "^", "D", "v", "P", "X")
"""Markers of the logs in the order of their loads."""

MARK_SIZE = 3.0

Dashes = str | tuple[float, tuple[float, ...]]
"""Dashes of a line, by a name of Matplotlib's or as an offset and lengths."""


class LineStyle(TypedDict, total=False):
    """Keywords of a line and of its marks, by Matplotlib's names; sizes in points."""

    color: str
    alpha: float
    lw: float
    ls: Dashes
    marker: str
    ms: float
    mew: float
    mfc: str
    mec: str
    label: str


Entry = tuple[Any, str]
"""What a legend shows, and its text."""


class LoadLook(NamedTuple):
    """Look of a load in every figure of its campaign: name of its colour, and marker."""

    colour: str
    mark: str


def load_looks(loads: Iterable[float | None]) -> dict[float | None, LoadLook]:
    """Look of each load of a campaign: the open circuit and an unknown one have a fixed one, the
    others have theirs in their order, from the largest resistance on. [ohm]

    A page that shows the loads of a campaign with or without its open circuit gives each the same
    look. Where colours come again, the markers are others.

    >>> load_looks([9.0, math.inf, 18.0])[18.0] == load_looks([18.0, 9.0])[18.0]
    True
    """
    known = sorted({load for load in loads if load is not None and load != math.inf}, reverse=True)
    colours = LOAD_COLOURS[1:]
    looks: dict[float | None, LoadLook] = {
        math.inf: LoadLook(LOAD_COLOURS[0], MARKS[0]),
        None: LoadLook("soft", MARKS[0]),
    }
    for k, load in enumerate(known):
        mark = MARKS[(1 + k + 2 * (k // len(colours))) % len(MARKS)]
        looks[load] = LoadLook(colours[k % len(colours)], mark)
    return looks


def line_entry(text: str, colour: str = "ink", **style: Any) -> Entry:
    """Entry of a legend for a line or, with a marker in its style, for points."""
    from matplotlib.lines import Line2D

    return Line2D([], [], **{"color": COLOURS[colour], **style}), text


def samples_entry(text: str, colour: str) -> Entry:
    """Entry of a legend for dots."""
    return line_entry(text, colour, ls="none", marker=".", ms=4, mew=0, alpha=0.6)


def patch_entry(text: str, colour: str, **style: Any) -> Entry:
    """Entry of a legend for a shade."""
    from matplotlib.patches import Rectangle

    return Rectangle(
        (0, 0), 1, 1, **{"fc": COLOURS[colour], "ec": COLOURS["soft"], "lw": 0.4, **style}
    ), text


def legend_above(figure: Figure, entries: Sequence[Entry]) -> None:
    """Set a legend above the panels, as many entries in a line as fit."""
    handles, texts = zip(*entries, strict=True)
    figure.legend(handles, texts, loc="outside upper left", ncols=columns_of(texts))


LINE_OF_LEGEND, KEY = 112, 7
"""Characters of the legend that a figure is wide, and those that a key with its margins takes."""


def columns_of(texts: Sequence[str]) -> int:
    """Columns of a legend in as few lines as its width allows, which are filled evenly.

    >>> columns_of(["9 ohm"] * 9), columns_of(["a log with a long name"] * 5), columns_of(["x" * 400] * 3)
    (9, 3, 1)
    """
    lengths = np.array([len(re.sub(r"\\[a-z]+|[${}^_]", "", text)) + KEY for text in texts])
    fitting = (
        n
        for n in range(len(texts), 1, -1)
        if sum(p.max() for p in np.array_split(lengths, n)) <= LINE_OF_LEGEND
    )
    lines = -(-len(texts) // next(fitting, 1))
    return -(-len(texts) // lines)
