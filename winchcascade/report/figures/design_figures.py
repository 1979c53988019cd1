"""Figures of a design: best load over generator speed, power and efficiency over line speed at
each load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.design.design import METRIC, Design
from winchcascade.report.figures.style import (
    COLOURS,
    Entry,
    LineStyle,
    from_zero,
    label_panel,
    legend_above,
    line_entry,
    load_looks,
    panel_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from winchcascade.core.run import Mask, Signal

LOOKS = {"power": ("gen", "o"), "efficiency": ("mech", "s")}
"""Colour and marker of each criterion."""


OUTSIDE: LineStyle = {"ls": "--", "marker": "o", "ms": 4, "mfc": COLOURS["paper"]}
"""Look of points that the logs do not cover, in a legend."""


def _outside_entry() -> Entry:
    return line_entry("outside what the logs cover", "soft", **OUTSIDE)


def schedule_figure(found: Design) -> Figure | None:
    """Best load over generator speed by criterion; None without any."""
    known = [one for one in found.schedule if one.load is not None]
    if not known:
        return None
    figure, (axes,) = panel_figure(2.4)
    for criterion in METRIC:
        colour, mark = LOOKS[criterion]
        own = [one for one in known if one.criterion == criterion]
        middle = np.array([0.5 * (one.rpm_low + one.rpm_high) for one in own])
        load = np.array([one.load for one in own], dtype=np.float64)
        inside = np.array([one.within_domain for one in own], dtype=bool)
        _points(axes, middle, load, inside, colour, mark)
    axes.set(xlabel="Generator speed (rpm)", ylabel="Load (Ω)")
    from_zero(axes)
    most = [
        line_entry(f"most {name}", colour, marker=mark, ms=4)
        for name, (colour, mark) in LOOKS.items()
    ]
    legend_above(figure, [*most, _outside_entry()])
    return figure


def _points(axes: Axes, x: Signal, y: Signal, inside: Mask, colour: str, mark: str) -> None:
    """A curve with its points: dashed and hollow outside what the logs cover."""
    covered = inside[1:] & inside[:-1]
    for dashes, along in (("-", covered), ("--", ~covered)):
        for k in np.flatnonzero(along):
            axes.plot(x[k : k + 2], y[k : k + 2], dashes, color=COLOURS[colour], lw=1.0)
    axes.plot(x[inside], y[inside], mark, color=COLOURS[colour], ms=4)
    axes.plot(x[~inside], y[~inside], mark, mec=COLOURS[colour], mfc=COLOURS["paper"], ms=4)


def map_figure(found: Design) -> Figure:
    """Power and efficiency over line speed at each load, with bands."""
    figure, panels = panel_figure(3.4, columns=2)
    loads = sorted({row.load for row in found.rows})
    looks, entries = load_looks([*found.tested.loads, *loads]), []
    for load in loads:
        colour, mark = looks[load]
        own = [row for row in found.rows if row.load == load]
        speed = np.array([row.speed for row in own])
        inside = np.array([row.within_domain for row in own], dtype=bool)
        over = np.array([bool(row.exceeds) for row in own], dtype=bool)
        for axes, name in zip(panels, ("p_gen_w", "eta_pto"), strict=True):
            value, low, high = (
                np.array([getattr(row.values[name], end) for row in own])
                for end in ("value", "low", "high")
            )
            axes.fill_between(speed, low, high, color=COLOURS[colour], alpha=0.2, lw=0)
            _points(axes, speed, value, inside, colour, mark)
            axes.plot(speed[over], value[over], "x", color=COLOURS["ink"], ms=7, mew=1.2)
        entries.append(line_entry(f"{load:g} Ω", colour, marker=mark, ms=4))
    label_panel(panels[0], "a", "Power at the DC link", x="Line speed (m/s)", unit="W")
    label_panel(panels[1], "b", r"Efficiency $\eta_{pto}$", x="Line speed (m/s)")
    if not all(row.within_domain for row in found.rows):
        entries.append(_outside_entry())
    if any(row.exceeds for row in found.rows):
        entries.append(line_entry("over a limit", ls="none", marker="x", ms=7, mew=1.2))
    legend_above(figure, entries)
    return figure
