"""Figure of a campaign: powers and efficiencies over load (Fig. 7)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.core.cascade import field_of
from winchcascade.core.run import Signal
from winchcascade.reduction.campaign_record import LogSummary, cascade_of, rule_of, unlike_motion
from winchcascade.report.figures.reduction_figures import stage_of
from winchcascade.report.figures.style import (
    COLOURS,
    label_panel,
    look_of,
    panel_figure,
    readable,
)
from winchcascade.report.glossary import tex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN_RUNS = 12
"""Runs that share one panel at most; of more, an even selection."""


CHARACTER = 0.026
"""Width of a character of a number under a load, as a share of the axis."""


def over_load(runs: Sequence[LogSummary]) -> Figure | None:
    """Draw mean powers and efficiencies over the load, with 95 % intervals; over the runs' order
    where loads are unknown.
    """
    if not runs:
        return None
    figure, (left, right) = panel_figure(2.9, 1, 2)
    cascade = cascade_of(runs)
    unit = _points(left, runs, [f"power_{name}" for name in cascade.names], "W")
    label_panel(left, "a", "Mean power in the window", y=f"Power ({unit})")
    _points(right, runs, [*cascade.ratios], "1")
    label_panel(right, "b", "Efficiency", y="Efficiency (1)")
    return figure


def over_what(runs: Sequence[LogSummary]) -> str:
    """What the points of `over_load` are drawn over."""
    return "the load" if _places(runs) is not None else "the logs, in the order of the tables"


def repeated(runs: Sequence[LogSummary]) -> bool:
    """Whether the points of `over_load` are drawn over loads of which some have several logs."""
    at = _places(runs)
    return at is not None and len(set(at)) < len(at)


def comparable(runs: Sequence[LogSummary]) -> list[list[int]]:
    """Places of the runs that may be joined by a line: those of one window rule and of one kind
    of data.
    """
    kinds = [(rule_of(run), run.origin.measured) for run in runs]
    return [[k for k, other in enumerate(kinds) if other == kind] for kind in dict.fromkeys(kinds)]


def _places(runs: Sequence[LogSummary]) -> list[float] | None:
    """Loads of the runs where all have one that can be drawn, None else. [ohm]"""
    known = [run.load for run in runs if run.load is not None and math.isfinite(run.load)]
    return known if len(known) == len(runs) and len(set(known)) > 1 else None


def _points(ax: Axes, runs: Sequence[LogSummary], names: Sequence[str], unit: str) -> str:
    """Draw the means of some metrics with their intervals; gives the unit of the axis."""
    at = _places(runs)
    x = np.arange(1.0, len(runs) + 1) if at is None else np.array(at)
    order = np.argsort(x, kind="stable")
    means = {m: np.array([run.mean.get(field_of(m)) for run in runs], dtype=float) for m in names}
    columns, cascade = {m: y for m, y in means.items() if np.isfinite(y).any()}, cascade_of(runs)
    short, unit = readable(unit, *(y[np.isfinite(y)] for y in columns.values()))
    for m, y in columns.items():
        ends = [run.interval_95.get(field_of(m)) or (math.nan, math.nan) for run in runs]
        low, high = np.array(ends, dtype=float).T
        bars = np.nan_to_num(np.vstack((y - low, high - y)))[:, order].clip(0.0) * short
        look = look_of(stage_of(cascade, m))
        line: Any = {"color": COLOURS[look.colour], "lw": 0.9, "ls": look.dashes}
        mark: Any = {"marker": look.mark, "ms": 4, "label": tex(m)}
        for n, members in enumerate(comparable(runs)):
            here = np.isin(order, members)
            own_x, own_y = x[order[here]], y[order[here]] * short
            hollow: Any = {"mfc": COLOURS["paper"], "label": "_"} if n else {"label": "_"}
            ax.errorbar(
                own_x,
                own_y,
                yerr=bars[:, here],
                capsize=2,
                **line | {"ls": "none"},
                **mark | hollow,
            )
            if not unlike_motion(runs):
                ax.plot(*(_means(own_x, own_y) if repeated(runs) else (own_x, own_y)), **line)
        joined = {"ls": "none"} if unlike_motion(runs) else {}
        ax.plot([], [], **line | joined, **mark)  # for the legend: the points on their line
    if at is not None:
        _label_loads(ax, sorted(set(at)))
    elif len(runs) <= DRAWN_RUNS:
        ax.set_xticks(x, [f"{k:g}" for k in x])
    ax.set_xlabel("Load resistance (Ω)" if at is not None else "Log, in the order of the table")
    if columns:
        ax.legend(loc="best")
    return unit


def _means(x: Signal, y: Signal) -> tuple[list[float], list[float]]:
    """Each load once, and the mean of what its logs give; without the loads of which none gives
    anything.
    """
    given = np.isfinite(y)
    loads = np.unique(x[given]).tolist()
    return loads, [float(np.mean(y[given & (x == load)])) for load in loads]


def _label_loads(ax: Axes, loads: Sequence[float]) -> None:
    """Set the loads on a logarithmic axis, with a tick and its number where there is space."""
    from matplotlib.ticker import FixedLocator, NullLocator

    ax.set_xscale("log")
    a_character = CHARACTER * math.log(loads[-1] / loads[0])
    named = [loads[0]]
    for load in loads[1:]:
        characters = 1.0 + 0.5 * (len(f"{named[-1]:g}") + len(f"{load:g}"))
        if math.log(load / named[-1]) > characters * a_character:
            named.append(load)
    ax.xaxis.set_major_locator(FixedLocator(named))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticklabels([f"{load:g}" for load in named])
