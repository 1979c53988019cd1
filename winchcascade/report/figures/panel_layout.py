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

    from winchcascade.core.run import Signal

POINTS = 72
"""Dots per inch of SVG and PDF, in which texts are measured."""

PAD = 3.0
"""Free space about a panel with its labels, and about the legend, as in constrained layout.
[points]
"""

ROUNDS = 2
"""How often panels are placed: with the room, the ticks and so the labels of an axis may change."""


class PanelLayout(LayoutEngine):  # type: ignore[misc]  # Matplotlib's own class has no types
    """Lays out a plain grid of panels with a legend above it: panels as wide, and as tall, as the
    ratios of their grid demand.
    """

    _adjust_compatible = False
    _colorbar_gridspec = False
    _aligned = False

    def set(self, *, aligned: bool) -> None:
        """Set whether the vertical labels of all panels, in one column, stand below each other."""
        self._aligned = aligned

    def execute(self, fig: Figure) -> None:
        """Place the panels of a figure; those that have no room for their labels stay."""
        dots, fig.dpi = fig.dpi, POINTS
        renderer = RendererSVG(*fig.bbox.size, io.StringIO())
        legend = sum(one.get_tightbbox(renderer).height + 2.0 * PAD for one in fig.legends)
        ticks: dict[Axes, list[list[float]]] = {}
        margins: dict[Axes, Signal] = {}
        labels: dict[Axes, float] = {}
        for _ in range(ROUNDS):
            for axes in fig.axes:
                present = _ticks(axes)
                if ticks.get(axes) != present:
                    ticks[axes], margins[axes] = present, _margins(axes, renderer)
                    labels[axes] = axes.bbox.x0 - axes.yaxis.label.get_position()[0]
            _place(fig, margins, legend)
        if self._aligned:
            _align(labels)
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
    grid = fig.axes[0].get_gridspec()
    rows, columns = grid.get_geometry()
    across, down = np.zeros((columns, 2)), np.zeros((rows, 2))
    for axes, margin in margins.items():
        place = axes.get_subplotspec()
        across[place.colspan.start] = np.maximum(across[place.colspan.start], margin[:2])
        down[place.rowspan.start] = np.maximum(down[place.rowspan.start], margin[2:])
    width, height = fig.bbox.size
    lefts, widths = _spread(across, grid.get_width_ratios(), width)
    tops, heights = _spread(down, grid.get_height_ratios(), height - legend)
    if min(*widths, *heights) <= 0.0:
        return
    for axes in margins:
        column, row = axes.get_subplotspec().colspan.start, axes.get_subplotspec().rowspan.start
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


def _spread(margins: Signal, ratios: list[float], room: float) -> tuple[Signal, Signal]:
    """Beginnings and lengths of panels side by side, with a margin before and behind each, (n, 2)."""
    sizes = (room - margins.sum()) * np.array(ratios) / sum(ratios)
    beginnings = np.cumsum(margins[:, 0]) + np.r_[0.0, np.cumsum(margins[:, 1] + sizes)[:-1]]
    return beginnings, sizes
