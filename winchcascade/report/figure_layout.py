"""Layout of a figure at another width than that of a report: texts, legends, titles and ticks that fit, and its height."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from winchcascade.report.style import broken, columns_within, is_narrow

SMALLEST, LARGEST = 7.0, 9.0
"""Sizes between which every text is set. [pt]"""

_EDGE = 0.03
"""Free space at the edges of a figure and between its legends. [in]"""

_ROUNDS = 3
"""Passes of the layout: a title that is broken moves what stands below it."""

_APART = 0.05
"""Free space between two panels, over their height."""

_NAMES = 0.4
"""Share of the width that the names of rows may take before they are broken into lines."""


def lay_out(figure: Figure) -> None:
    """Fit a figure that was drawn for the present width to it; its panels keep their heights, and its own height follows.

    A figure that places its panels itself keeps its layout, apart from the sizes of its texts.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontsize(min(max(float(text.get_fontsize()), SMALLEST), LARGEST))
    _close_gaps(figure)
    if not is_narrow() or any(ax.get_subplotspec() is None for ax in figure.axes):
        return
    wanted = sum(_height(figure, ax) for ax in figure.axes)
    legends = [_in_columns(figure, legend) for legend in [*figure.legends, *_too_wide(figure)]]
    for grid in {ax.get_gridspec() for ax in figure.axes}:
        assert grid is not None
        grid.hspace = _APART
    for _ in range(_ROUNDS):
        height = float(figure.get_figheight())
        head = _stack(figure, legends)
        figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - head / height), h_pad=_EDGE, w_pad=_EDGE)
        figure.draw_without_rendering()
        for ax in figure.axes:
            _fit_panel(figure, ax)
        figure.set_figheight(height + wanted - sum(_height(figure, ax) for ax in figure.axes))
    _stack(figure, legends)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


def _height(figure: Figure, ax: Axes) -> float:
    """Height of a panel. [in]"""
    return float(ax.get_position().height * figure.get_figheight())


def _extent(figure: Figure, item: Text | Legend) -> Bbox:
    """What a text or a legend covers. [in]"""
    return item.get_window_extent().transformed(figure.dpi_scale_trans.inverted())


def _close_gaps(figure: Figure) -> None:
    """Take away panels that hold nothing, and the rows that only they have."""
    for ax in [ax for ax in figure.axes if not ax.get_visible() or not ax.axison]:
        spec = ax.get_subplotspec()
        if spec is None:
            continue
        ax.remove()
        grid = spec.get_gridspec()
        used = {row for other in figure.axes if (own := other.get_subplotspec()) for row in own.rowspan}
        grid.set_height_ratios([1.0 if row in used else 1e-6 for row in range(grid.nrows)])


def _too_wide(figure: Figure) -> list[Legend]:
    """Legends above a panel that are wider than it."""
    found = [(ax, legend) for ax in figure.axes if (legend := ax.get_legend()) is not None]
    widths = [(legend, float(ax.get_position().width * figure.get_figwidth())) for ax, legend in found]
    return [legend for legend, width in widths if _extent(figure, legend).width > width]


def _in_columns(figure: Figure, legend: Legend) -> Legend:
    """The same legend with as many columns as the width has room for."""
    texts = [text.get_text() for text in legend.get_texts()]
    handles = [handle for handle in legend.legend_handles if handle is not None]
    legend.remove()
    return figure.legend(
        handles, texts, loc="upper left", ncols=columns_within(texts), columnspacing=1.1, handlelength=2.0, borderaxespad=0.1
    )  # fmt: skip


def _stack(figure: Figure, legends: Sequence[Legend]) -> float:
    """Set the legends one below the other at the top, texts of the figure beside the last; gives the height of all [in]."""
    height, top = float(figure.get_figheight()), 0.0
    for legend in legends:
        legend.set_bbox_to_anchor((0.01, 1.0 - top / height), transform=figure.transFigure)
        top += _extent(figure, legend).height + _EDGE
    for text in figure.texts:
        text.set_position((0.985, 1.0 - (top + 0.5 * _extent(figure, text).height) / height))
        top += _extent(figure, text).height + _EDGE
    return top


def _fit_panel(figure: Figure, ax: Axes) -> None:
    """Break texts of a panel that are wider than there is room, and part its title from its legend, and its ticks."""
    room = float(figure.get_figwidth()) - 2.0 * _EDGE
    left = float(ax.get_position().x0) * room
    title = ax.get_title(loc="left")
    size = float(ax.title.get_fontsize())
    lines = _broken(figure, title, size, room - left)
    ax.set_title(lines, loc="left", pad=3.0 + _legend_beside(figure, ax, lines), fontsize=size)
    ax.set_xlabel(_broken(figure, ax.get_xlabel(), float(ax.xaxis.label.get_fontsize()), room - left))
    _break_names(figure, ax, room)
    _part_ticks(figure, ax)


def _broken(figure: Figure, text: str, size: float, width: float) -> str:
    """A text in lines of some width [in]; one with mathematics stays as it is."""
    if not text or "$" in text:
        return text
    probe = figure.text(0.0, 0.0, text, fontsize=size)
    wide = _extent(figure, probe).width
    probe.remove()
    whole = " ".join(text.split())
    return text if wide <= width else broken(whole, max(int(len(whole) * width / wide), 8))


def _legend_beside(figure: Figure, ax: Axes, title: str) -> float:
    """Height of a legend above a panel that its title would touch, 0 where they stand apart. [pt]"""
    legend = ax.get_legend()
    if legend is None or not title:
        return 0.0
    covered, panel = _extent(figure, legend), ax.get_position()
    above = covered.y0 >= (panel.y1 * float(figure.get_figheight())) - 0.05
    own = _extent(figure, next(t for t in ax.findobj(Text) if isinstance(t, Text) and t.get_text() == title))
    return 72.0 * covered.height if above and own.x1 + _EDGE > covered.x0 else 0.0


def _break_names(figure: Figure, ax: Axes, room: float) -> None:
    """Break names of rows that would take too much of the width."""
    labels = ax.get_yticklabels()
    if any(_extent(figure, label).width > _NAMES * room for label in labels):
        size = float(labels[0].get_fontsize())
        names = [_broken(figure, label.get_text(), size, _NAMES * room) for label in labels]
        ax.set_yticks(ax.get_yticks(), names, fontsize=size)


def _part_ticks(figure: Figure, ax: Axes) -> None:
    """Turn numbers below a panel that touch each other."""
    extents = [_extent(figure, label) for label in ax.get_xticklabels() if label.get_text() and label.get_visible()]
    if any(a.x1 > b.x0 for a, b in pairwise(extents)):
        ax.tick_params(axis="x", rotation=90)
