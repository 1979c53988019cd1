"""Figures of a loss map: heat map with the operating points and hatching where none lie, and the laws along the motion."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from winchcascade.diagnosis.causes import COVERED
from winchcascade.diagnosis.stages.stage_map import LossMap
from winchcascade.report.figures.style import COLOURS, evenly, panel_figure

DOTS = 1500
"""Points that are drawn at most; of more, an even selection."""

LEVELS = 12
"""Steps of colour at most."""

CUTS = (0.25, 0.5, 0.9)
"""Loads, as shares of the largest, along which the loss is drawn over the motion. [1]"""

NEAR = 0.1
"""Points within this share of the largest load are drawn beside a cut. [1]"""

_HEAT = LinearSegmentedColormap.from_list("loss", ["#fff3d6", "#f2a65a", "#b8432f", "#4a1230"])


def loss_figure(found: LossMap, labels: tuple[str, str]) -> Figure:
    """Heat map of the laws with the points; hatched outside their hull."""
    figure, (axes,) = panel_figure(3.4)
    if np.ptp(found.motion) > 0.0 and np.ptp(found.load) > 0.0:
        heat = axes.contourf(found.motion, found.load, found.loss, LEVELS, cmap=_HEAT)
        figure.colorbar(heat, ax=axes).set_label("Loss (W)")
        outside = np.where(found.inside, np.nan, 1.0)
        axes.contourf(found.motion, found.load, outside, levels=[0.0, 2.0], colors="none", hatches=["////"])
    rows = np.array(evenly(range(len(found.points)), DOTS))
    axes.plot(*found.points[rows, :2].T, "o", ms=2.2, mew=0.4, mfc="none", mec=COLOURS["ink"])
    axes.set(xlabel=labels[0], ylabel=labels[1])
    return figure


def cuts_figure(found: LossMap, labels: tuple[str, str]) -> Figure:
    """The loss over the motion at some loads, with its 95 % band and the points near each load."""
    figure, panels = panel_figure(3.0, 1, len(CUTS), share="xy")
    top = float(found.load[np.argmax(np.abs(found.load))])
    for ax, share in zip(panels, CUTS, strict=True):
        row = int(np.argmin(np.abs(found.load - share * top)))
        loss, half = found.loss[row], COVERED * found.u_loss[row]
        ax.fill_between(found.motion, loss - half, loss + half, color=COLOURS["gen"], alpha=0.25, lw=0)
        ax.plot(found.motion, loss, color=COLOURS["gen"], lw=1.3)
        near = np.flatnonzero(np.abs(found.points[:, 1] - found.load[row]) <= NEAR * abs(top))
        rows = np.array(evenly(range(near.size), DOTS), dtype=np.intp)
        ax.plot(
            found.points[near[rows], 0], found.lost[near[rows]], "o", ms=2.2, mew=0.4, mfc="none", mec=COLOURS["ink"]
        )
        ax.set_title(f"{labels[1].partition(' (')[0]} {found.load[row]:.3g}", fontsize=7.5)
        ax.set_xlabel(labels[0])
    panels[0].set_ylabel("Loss (W)")
    return figure
