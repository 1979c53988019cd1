"""Places of the panels of a figure: as large as their labels and the legend above them allow.

Matplotlib's constrained layout gives the same places for a plain grid of panels; it measures every
text twice, which took a quarter of the time of a PDF.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.layout_engine import LayoutEngine

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec
    from numpy.typing import ArrayLike

    from winchcascade.core.run import Signal

POINTS = 72
"""Dots per inch of SVG and PDF, in which texts are measured."""

PAD = 3.0
"""Free space about a panel with its labels, and about the legend, as in constrained layout.
[points]
"""

ROUNDS = 2
"""How often panels are placed: with the room, the ticks and so the labels of an axis may change."""


class PanelLayout(LayoutEngine):
    """Lays out a plain grid of panels with a legend above it: panels as wide, and as tall, as the
    ratios of their grid demand.

    Parameters
    ----------
    aligned : whether the vertical labels of the panels, in one column, stand below each other
    """

    _adjust_compatible = False
    _colorbar_gridspec = False

    def __init__(self, *, aligned: bool = False) -> None:
        super().__init__()
        self._aligned = aligned
        self._labels: dict[Axes, float] = {}

    def execute(self, fig: Figure) -> None:
        """Place the panels of a figure; those that have no room for their labels stay."""
        dots, fig.dpi = fig.dpi, POINTS
        renderer = RendererSVG(*fig.bbox.size, io.StringIO())  # type: ignore[no-untyped-call]
        legend = sum(
            (one.get_window_extent(renderer).height + 2.0 * PAD for one in fig.legends), 0.0
        )
        ticks: dict[Axes, list[list[float]]] = {}
        margins: dict[Axes, Signal] = {}
        labels = self._labels.copy()
        for _ in range(ROUNDS):
            for axes in fig.axes:
                present = _ticks(axes)
                if ticks.get(axes) != present:
                    ticks[axes], margins[axes] = present, _margins(axes, renderer)
                    if axes not in self._labels:  # whose label has not been moved yet
                        labels[axes] = axes.bbox.x0 - axes.yaxis.label.get_position()[0]
            _place(fig, margins, legend)
        if self._aligned:
            _align(labels)
            self._labels = labels
        fig.dpi = dots


def _ticks(axes: Axes) -> list[list[float]]:
    """Places of the ticks of a panel and of the axes that belong to it."""
    every = [axis for one in (axes, *axes.child_axes) for axis in (one.xaxis, one.yaxis)]
    return [list(axis.get_majorticklocs()) for axis in every]


def _margins(axes: Axes, renderer: RendererSVG) -> Signal:
    """Room that the labels of a panel take to its left, right, top and bottom, with the free space
    beyond them, (4,) [points].
    """
    inside, outside = axes.bbox, axes.get_tightbbox(renderer, for_layout_only=True)
    if outside is None:  # a panel that is not shown
        return np.full(4, PAD)
    return PAD + np.array(
        [
            inside.x0 - outside.x0,
            outside.x1 - inside.x1,
            outside.y1 - inside.y1,
            inside.y0 - outside.y0,
        ]
    )


def _place(fig: Figure, margins: dict[Axes, Signal], legend: float) -> None:
    """Place panels by the largest margins of each row and column, below a legend of some height.
    [points]
    """
    grid = _cell(fig.axes[0]).get_gridspec()
    rows, columns = grid.get_geometry()
    across, down = np.zeros((columns, 2)), np.zeros((rows, 2))
    for axes, margin in margins.items():
        place = _cell(axes)
        across[place.colspan.start] = np.maximum(across[place.colspan.start], margin[:2])
        down[place.rowspan.start] = np.maximum(down[place.rowspan.start], margin[2:])
    width, height = fig.bbox.size
    lefts, widths = _spread(across, grid.get_width_ratios(), width)
    tops, heights = _spread(down, grid.get_height_ratios(), height - legend)
    if min(*widths, *heights) <= 0.0:
        return
    for axes in margins:
        column, row = _cell(axes).colspan.start, _cell(axes).rowspan.start
        bottom = height - legend - tops[row] - heights[row]
        axes.set_position(
            (lefts[column] / width, bottom / height, widths[column] / width, heights[row] / height)
        )
        axes.set_in_layout(True)  # which `set_position` ends


def _align(labels: dict[Axes, float]) -> None:
    """Set every vertical label as far from its panel as the one beyond the longest numbers.
    [points]
    """
    for axes in labels:
        axes.yaxis.set_label_coords(-max(labels.values()) / axes.bbox.width, 0.5)


def _cell(axes: Axes) -> SubplotSpec:
    """Row and column of a panel in its grid."""
    cell = axes.get_subplotspec()
    assert cell is not None  # figures add their panels in a grid alone
    return cell


def _spread(margins: Signal, ratios: ArrayLike, room: float) -> tuple[Signal, Signal]:
    """Beginnings and lengths of panels side by side, with a margin before and behind each, (n, 2)."""
    sizes = (room - margins.sum()) * np.array(ratios) / np.sum(ratios)
    beginnings = np.cumsum(margins[:, 0]) + np.r_[0.0, np.cumsum(margins[:, 1] + sizes)[:-1]]
    return beginnings, sizes
