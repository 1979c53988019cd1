"""Figures of a loss map: heat map with the operating points, efficiency over speed and torque."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from winchcascade.core.run import Signal
from winchcascade.reduction.loss_map import LossMap
from winchcascade.reduction.loss_points import LossPoints, columns_at
from winchcascade.report.figures.style import COLOURS, evenly, panel_figure

DOTS = 1500
"""Points that are drawn at most; of more, an even selection."""

LEVELS = 12
"""Steps of colour, and lines of constant power, at most."""

_HEAT = LinearSegmentedColormap.from_list("loss", ["#fff3d6", "#f2a65a", "#b8432f", "#4a1230"])
_GOOD = LinearSegmentedColormap.from_list("efficiency", ["#4a1230", "#3a7fc4", "#8fd3b6", "#fdf3b4"])


def loss_figure(found: LossMap) -> Figure:
    """Heat map of the surface within the hull of the points, with the points."""
    figure, (axes,) = panel_figure(3.4)
    points = found.points
    if len(found.hull) >= 3:
        torque, speed = np.meshgrid(found.torque, found.speed, indexing="ij")
        heat = axes.contourf(speed, torque, columns_at(torque, speed) @ found.surface.values, LEVELS, cmap=_HEAT)
        heat.set_clip_path(Polygon(found.hull[:, ::-1], transform=axes.transData))
        figure.colorbar(heat, ax=axes).set_label("Loss (W)")
    rows = np.array(evenly(range(points.loss.size), DOTS))
    axes.plot(points.speed[rows], points.torque[rows], "o", ms=2.2, mew=0.4, mfc="none", mec=COLOURS["ink"])
    axes.set(xlabel="Speed of the shaft (rad/s)", ylabel="Torque (N·m)")
    return figure


def efficiency_figure(points: LossPoints) -> Figure:
    """Efficiency at the operating points, with lines of constant power."""
    figure, (axes,) = panel_figure(3.4)
    taken = points.power_in - points.stored
    eta = np.divide(points.power_out, taken, out=np.full(taken.size, np.nan), where=taken > 0.0)
    rows = np.array(evenly(range(points.loss.size), DOTS))
    rows = rows[(eta[rows] >= 0.0) & (eta[rows] <= 1.0)]
    _constant_power(axes, points)
    if rows.size:
        dots = axes.scatter(
            points.speed[rows], points.torque[rows], c=eta[rows], s=10, cmap=_GOOD, edgecolors=COLOURS["ink"],
            linewidths=0.2, zorder=3,
        )  # fmt: skip
        figure.colorbar(dots, ax=axes).set_label("Efficiency (1)")
    axes.set(xlabel="Speed of the shaft (rad/s)", ylabel="Torque (N·m)")
    return figure


def _constant_power(axes: Axes, points: LossPoints) -> None:
    """Lines of constant power of the shaft, labelled in watts."""
    speed = np.linspace(float(points.speed.min()), float(points.speed.max()), 80)
    torque = np.linspace(float(points.torque.min()), float(points.torque.max()), 80)
    x, y = np.meshgrid(speed, torque)
    power: Signal = x * y
    if np.ptp(power) <= 0.0:
        return
    lines = axes.contour(x, y, power, 6, colors=COLOURS["soft"], linewidths=0.6, linestyles="--")
    axes.clabel(lines, fmt="%g W", fontsize=6.5)
