"""Style of all figures: named colours that a page may turn dark, panels, marks and legends."""

from __future__ import annotations

import gc
import logging
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypedDict, TypeVar

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.report.svg_drawing import FONT, text_size

logging.getLogger("matplotlib").setLevel(logging.ERROR)  # what it says of its own caches and settings is not our user's

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal

T = TypeVar("T")

WIDTH = 6.7
"""Width of a figure of a report: that of a page of A4 between its margins. [in]"""

NARROW = 4.5
"""Figures that are narrower have one panel in a row. [in]"""


class Format(NamedTuple):
    """What figures are drawn for: their width [in], and what takes each with its name in place of the page of a report."""

    width: float = WIDTH
    take: Callable[[str, Figure], None] | None = None


_FORMAT: ContextVar[Format] = ContextVar("figure_format", default=Format())  # noqa: B039  # a named tuple does not change


@contextmanager
def figure_format(wanted: Format) -> Iterator[None]:
    """Draw every figure that is made within this context in another format; a thread begins with that of reports."""
    token = _FORMAT.set(wanted)
    try:
        yield
    finally:
        _FORMAT.reset(token)


def present_format() -> Format:
    """The format in which figures are drawn now: that of reports if no other was set."""
    return _FORMAT.get()


def figure_width() -> float:
    """Width of the figures that are drawn now. [in]"""
    return _FORMAT.get().width


def is_narrow() -> bool:
    """Whether figures are so narrow now that their panels stand one below the other."""
    return figure_width() < NARROW


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
"""Colours by name, each used once: apart in grey (line, mech, gen from dark to light) and to the colour-blind; signs are blue
(above) and orange (below).
"""

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
    "font.family": FONT,
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
    "pdf.fonttype": 42,
    "svg.hashsalt": "winchcascade",
    "path.simplify": True,
    "figure.constrained_layout.use": False,
}

_NARROW_RC = {"font.size": 7.5, "axes.titlesize": 7.5, "axes.labelsize": 7.5, "legend.fontsize": 7.0} | dict.fromkeys(
    ("xtick.labelsize", "ytick.labelsize"), 7.0
)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Do not search for unused objects within this context: a figure makes very many, each searched for several times."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@contextmanager
def house_style() -> Iterator[None]:
    """Draw within this context in the project's style, whatever the user's matplotlib is set to."""
    with matplotlib.rc_context(), _uncollected():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)  # type: ignore[arg-type]  # its keys are typed as literals
        if is_narrow():
            matplotlib.rcParams.update(_NARROW_RC)  # type: ignore[arg-type]
        yield


class Margins(NamedTuple):
    """Edges of the panels of a figure, as shares of the width of a report, and the margins above and below them [in]."""

    left: float = 0.09
    right: float = 0.985
    head: float = 0.3
    foot: float = 0.42

    @property
    def edges(self) -> tuple[float, float]:
        """Left and right edge as shares of the width of the figures that are drawn now; the margins stay as wide in inches."""
        scale = WIDTH / figure_width()
        return self.left * scale, 1.0 - (1.0 - self.right) * scale


def wide_figure(height: float, margins: Margins = Margins()) -> Figure:  # noqa: B008  # a named tuple does not change
    """An empty figure as wide as figures are drawn now and of some height [in]."""
    figure = Figure((figure_width(), height))
    left, right = margins.edges
    figure.subplots_adjust(left, margins.foot / height, max(right, left + 0.1), 1 - margins.head / height)
    return figure


def panel_figure(
    height: float,
    rows: int = 1,
    columns: int = 1,
    *,
    margins: Margins = Margins(),  # noqa: B008
    gaps: Mapping[str, float] | None = None,
    share: Literal["", "x", "y", "xy"] = "",
) -> tuple[Figure, list[Axes]]:
    """A figure with its panels, row by row; a narrow one has as many panels as high, one below the other.

    Parameters
    ----------
    height : [in]
    gaps : `wspace` and `hspace` between the panels, as shares of a panel
    share : axes that all panels have in common
    """
    if is_narrow() and columns > 1:
        panel = (height - margins.head - margins.foot) / (rows + (rows - 1) * (gaps or {}).get("hspace", 0.2))
        rows, columns, gaps = rows * columns, 1, {"hspace": 0.5}
        height = margins.head + margins.foot + panel * (rows + 0.5 * (rows - 1))
    figure = wide_figure(height, margins)
    grid = figure.subplots(
        rows, columns, sharex="x" in share, sharey="y" in share, squeeze=False, gridspec_kw=dict(gaps or {})
    )
    return figure, list(grid.ravel())


def label_panel(axes: Axes, letter: str, title: str, *, x: str = "", y: str = "", unit: str = "") -> None:
    """Write a panel's letter and title above it, to the left, and the labels of its axes that are given.

    Parameters
    ----------
    unit : that of the vertical axis, whose label is then the quantity of the title with it
    """
    axes.set_title(f"({letter}) {title}", loc="left", pad=3)
    axes.set(**{"xlabel": x} if x else {}, **{"ylabel": y} if y else {})
    if unit:
        label_upright(axes, title, unit)


QUANTITIES = (
    "displacement", "velocity", "pressure", "tension", "torque", "voltage", "current", "back-EMF", "speed", "flow", "power",
    "energy", "efficiency", "resistance", "loss",
)  # fmt: skip
"""Quantities that the titles of panels contain."""


def axis_label(title: str, unit: str) -> str:
    """Label of an axis: the quantity that a title contains, or else the title, with the unit.

    >>> axis_label("Torque of the PTO shaft", "N·m"), axis_label("brake", "bar")
    ('Torque (N·m)', 'Brake (bar)')
    """
    found = next((word for word in QUANTITIES if word.lower() in title.lower()), title)
    return f"{found[:1].upper()}{found[1:]} ({unit})"


def label_upright(axes: Axes, title: str, unit: str) -> None:
    """Label the vertical axis with the quantity of a title and its unit, in two lines where the panel is low."""
    text, figure = axis_label(title, unit), axes.get_figure(root=True)
    height = axes.get_position().height * (figure.get_figheight() if figure is not None else 0.0)
    low = text_size(text, float(axes.yaxis.label.get_fontsize())).width * _POINT > height
    axes.set_ylabel(text.replace(" (", "\n(") if low else text)
    if low:
        axes.yaxis.label.set_fontsize(_LOW)


_LOW = 7.0
"""Size of a label of two lines. [pt]"""


MAX_COLUMNS = 7
"""Entries in a line of a legend at most."""

SHORT = 18
"""Characters of a log's name where there is little room."""

_POINT = 1.0 / 72.0
"""[in]"""


def text_width(text: str) -> float:
    """Width of a text in a legend. [in]"""
    size = float(matplotlib.rcParams["legend.fontsize"])
    return text_size(text, size).width * _POINT


def broken(text: str, characters: int) -> str:
    """A text in lines of a maximum number of characters, broken at blanks."""
    return "\n".join(textwrap.wrap(text, characters, break_on_hyphens=False))


def columns_within(texts: Sequence[str], *, handle: float = 2.0, gap: float = 1.1) -> int:
    """Give the columns of a legend that stay within the width of the figures that are drawn now.

    Parameters
    ----------
    handle, gap : length of a key, and space between two columns, in sizes of the font
    """
    width = 0.98 * figure_width()
    size = float(matplotlib.rcParams["legend.fontsize"]) * _POINT
    key = (handle + float(matplotlib.rcParams["legend.handletextpad"])) * size
    edge = 2.0 * float(matplotlib.rcParams["legend.borderpad"]) * size
    widths = np.array([key + text_width(text) for text in texts])
    for columns in range(min(MAX_COLUMNS, len(texts)), 1, -1):
        filled = sum(float(column.max()) for column in np.array_split(widths, columns))
        if filled + gap * size * (columns - 1) + edge <= width:
            return columns
    return 1


def lines_within(texts: Sequence[str], *, handle: float = 2.0, gap: float = 1.1) -> int:
    """Lines of a legend as wide as the figure."""
    return -(-len(texts) // columns_within(texts, handle=handle, gap=gap))


def cut_apart(names: Sequence[str], maximum: int = SHORT) -> list[str]:
    """Cut names in the middle, or as near to it as leaves them apart; names that no such cut distinguishes are numbered.

    >>> cut_apart(["r9.csv", "2026-03-01_winch_r9.csv", "2026-03-02_winch_r9.csv"])
    ['r9.csv', '2026-03-01…_r9.csv', '2026-03-02…_r9.csv']
    """
    room = maximum - 1
    for head in sorted(range(2, room - 1), key=lambda head: (abs(head - room / 2.0), head)):
        cut = [name if len(name) <= maximum else f"{name[:head]}…{name[head - room :]}" for name in names]
        if len(set(cut)) == len(set(names)):
            return cut
    number = {name: k for k, name in enumerate(dict.fromkeys(names), 1)}
    return [name if len(name) <= maximum else f"{name[: room - 5]}… ({number[name]})" for name in names]


# --------------------------------------------------------------------------- what figures share
MARKS = ("o", "s", "^", "D", "v", "P", "X")
"""Markers of the logs in the order of their loads."""

MARK_SIZE = 3.0

LINE = 0.17
"""Height of a line of a legend. [in]"""

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


def load_style(k: int) -> tuple[str, str]:
    """Colour and marker of the load at place k; where colours come again, the markers are others."""
    return LOAD_COLOURS[k % len(LOAD_COLOURS)], MARKS[(k + k // len(LOAD_COLOURS)) % len(MARKS)]


def shade_over_speed(ax: Axes, rated: float | None) -> bool:
    """Shade what lies over the rated speed of the generator, if the axis extends that far; True if it does."""
    low, high = ax.get_xlim()
    if rated is None or rated >= high:
        return False
    ax.axvspan(max(rated, low), high, color=COLOURS["over"], lw=0, zorder=0.1)
    ax.set_xlim(low, high)
    return True


def line_entry(text: str, colour: str = "ink", **style: Any) -> Entry:
    """Entry of a legend for a line or, with a marker in its style, for points."""
    return Line2D([], [], **{"color": COLOURS[colour], **style}), text


def samples_entry(text: str, colour: str) -> Entry:
    """Entry of a legend for dots."""
    return line_entry(text, colour, ls="none", marker=".", ms=4, mew=0, alpha=0.6)


def patch_entry(text: str, colour: str, **style: Any) -> Entry:
    """Entry of a legend for a shade."""
    return Rectangle((0, 0), 1, 1, **{"fc": COLOURS[colour], "ec": COLOURS["soft"], "lw": 0.4, **style}), text


def legend_above(figure: Figure, entries: Sequence[Entry], *, line: int = 0) -> None:
    """Set a legend in one of the lines above the panels, as many entries in a line as there is room for."""
    handles, texts = zip(*entries, strict=True)
    figure.legend(
        handles, texts, loc="upper left", ncols=columns_within(texts), columnspacing=1.1, handlelength=2.0,
        bbox_to_anchor=(0.01, 1.0 - LINE * line / float(figure.get_figheight())), borderaxespad=0.1,
    )  # fmt: skip


def evenly(items: Sequence[T], maximum: int) -> list[T]:
    """Items that are evenly spread, up to a maximum number, the first and the last among them.

    >>> evenly("abcdefg", 3), evenly("ab", 3)
    (['a', 'd', 'g'], ['a', 'b'])
    """
    even = np.linspace(0, max(len(items) - 1, 0), min(len(items), maximum)).round().astype(int)
    return [items[k] for k in even.tolist()]


def readable(unit: str, *signals: Signal) -> tuple[float, str]:
    """Factor and unit that keep the numbers of an axis short: thousands from 10 000 on, smaller units below 0.01."""
    peak = max((float(np.max(np.abs(x))) for x in signals if x.size), default=0.0)
    if unit not in ("N", "W", "J", "N·m") or 0.01 <= peak < 1e4 or peak == 0.0:
        return 1.0, unit
    return (1e-3, f"k{unit}") if peak >= 1e4 else (1e3, f"m{unit}") if peak >= 1e-5 else (1e6, f"µ{unit}")


def dots(ax: Axes, x: Signal, y: Signal, colour: str) -> None:
    """Draw points as one path of very short strokes: a marker each would make the file ten times as large."""
    gap, short = np.full(x.size, np.nan), 1e-3 * float(np.ptp(x, axis=None)) if x.size else 0.0
    across, up = np.column_stack((x, x + short, gap)).ravel(), np.column_stack((y, y, gap)).ravel()
    ax.plot(across, up, color=colour, lw=1.7, alpha=0.45, solid_capstyle="round")
