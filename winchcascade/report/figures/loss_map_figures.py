"""Figure of a loss map: heat map of the laws and of their band, with the operating points, hatched
where none lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.diagnosis.stages.stage_map import LossMap
from winchcascade.report.figures.style import COLOURS, evenly, label_panel, panel_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS = 1500
"""Points that are drawn at most; of more, an even selection."""

LEVELS = 12
"""Steps of colour at most."""

HEAT = ("#fff3d6", "#f2a65a", "#b8432f", "#4a1230")
"""Colours of a loss, from none to the largest."""


def loss_figure(found: LossMap, labels: Sequence[str]) -> Figure:
    """Loss, and half the width of its 95 % interval, with the points; hatched outside their
    hull.
    """
    from matplotlib.colors import LinearSegmentedColormap

    figure, panels = panel_figure(3.1, 1, 2, share="xy")
    heat_map = LinearSegmentedColormap.from_list("loss", HEAT)
    outside = np.where(found.inside, np.nan, 1.0)
    points = found.points[evenly(range(len(found.points)), DOTS), :2].T
    shown = (("a", "Loss (W)", found.loss), ("b", "95 % band, +- (W)", COVERED * found.u_loss))
    for ax, (letter, title, values) in zip(panels, shown, strict=True):
        if np.ptp(found.motion) > 0.0 and np.ptp(found.load) > 0.0:
            heat = ax.contourf(found.motion, found.load, values, LEVELS, cmap=heat_map)
            figure.colorbar(heat, ax=ax)
            ax.contourf(
                found.motion,
                found.load,
                outside,
                levels=[0.0, 2.0],
                colors="none",
                hatches=["////"],
            )
        ax.plot(*points, "o", ms=2.2, mew=0.4, mfc="none", mec=COLOURS["ink"])
        label_panel(ax, letter, title, x=labels[0])
    panels[0].set_ylabel(labels[1])
    return figure
