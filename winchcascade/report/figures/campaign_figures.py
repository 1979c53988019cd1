"""Figures of a campaign: powers and efficiencies over load (Fig. 7), torque and power over speed
for all loads (Fig. 15).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from winchcascade.core.cascade import field_of
from winchcascade.core.run import Signal
from winchcascade.reduction.campaign_record import LogSummary, cascade_of, rule_of
from winchcascade.report.figures.reduction_figures import stage_of
from winchcascade.report.figures.style import (
    COLOURS,
    LOAD_COLOURS,
    MARK_SIZE,
    Entry,
    cut_apart,
    evenly,
    label_panel,
    legend_above,
    load_style,
    look_of,
    panel_figure,
    readable,
)
from winchcascade.report.glossary import tex
from winchcascade.report.wording import load_text

DRAWN_RUNS = 12
"""Runs that share one panel at most; of more, an even selection."""


Bins = Mapping[str, Sequence[Mapping[str, float]]]
"""Bins of each run by its name, their known values by the names of the dataset."""

CHARACTER = 0.026
"""Width of a character of a number under a load, as a share of the axis."""

_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))

_FIELDS = (
    ("torque_nm", "Torque of the PTO shaft", "N·m"),
    ("power_mech_w", "Power of the shaft", "W"),
    ("power_gen_w", "Power at the DC link", "W"),
)
"""What is drawn over speed: names of the dataset, titles and units."""


def over_load(runs: Sequence[LogSummary]) -> Figure | None:
    """Draw mean powers and efficiencies over the load, with 95 % intervals; over the runs' order
    where loads are unknown.
    """
    if not runs:
        return None
    figure, (left, right) = panel_figure(2.9, 1, 2)
    draw_over_load(left, runs, "power")
    draw_over_load(right, runs, "efficiency")
    return figure


def draw_over_load(ax: Axes, runs: Sequence[LogSummary], what: str) -> None:
    """Draw mean powers, for `power`, or efficiencies of the runs over the load."""
    cascade = cascade_of(runs)
    if what == "power":
        unit = _points(ax, runs, [f"power_{name}" for name in cascade.names], "W")
        label_panel(ax, "a", "Mean power in the window", y=f"Power ({unit})")
    else:
        _points(ax, runs, [*cascade.ratios], "1")
        label_panel(ax, "b", "Efficiency", y="Efficiency (1)")


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
            ax.plot(*(_means(own_x, own_y) if repeated(runs) else (own_x, own_y)), **line)
        ax.plot([], [], **line, **mark)  # for the legend: the points on their line
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
    """Set the loads on a logarithmic axis, with a number at each that has the space for it."""
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(FixedLocator(loads))
    ax.xaxis.set_minor_locator(NullLocator())
    width = (
        CHARACTER * (1 + max(len(f"{load:g}") for load in loads)) * math.log(loads[-1] / loads[0])
    )
    named: list[float] = []
    for load in loads:
        if not named or math.log(load / named[-1]) > width:
            named.append(load)
    ax.set_xticklabels([f"{load:g}" if load in named else "" for load in loads])


def drawn_runs(runs: Sequence[LogSummary]) -> list[LogSummary]:
    """The runs that share a panel: all, or an even selection."""
    return evenly(runs, DRAWN_RUNS)


def load_names(runs: Sequence[LogSummary]) -> list[str]:
    """Load of each run with its unit, the name of the log, cut, where it is unknown."""
    return [
        _load(run, name)
        for run, name in zip(runs, cut_apart([run.name for run in runs]), strict=True)
    ]


def _load(run: LogSummary, unknown: str) -> str:
    """Load of a run with its unit, or what it is called where that is unknown."""
    return unknown if run.load is None else f"{load_text(run.load)}{' Ω' * math.isfinite(run.load)}"


def runs_over_speed(runs: Sequence[LogSummary], bins: Bins) -> Figure | None:
    """Draw binned torque and power over the generator's speed, one curve a run; runs of one load
    look alike.
    """
    names, shown, fields = _binned(runs, bins)
    if not fields:
        return None
    figure, axes = panel_figure(2.9, 1, len(fields))
    for k, (ax, (field, title, unit)) in enumerate(zip(axes, fields, strict=True)):
        unit = _curves(ax, names, [_curve(found, field) for found in shown], unit)
        label_panel(ax, "abc"[k], title, x="Generator speed (rpm)", unit=unit)
    legend_above(figure, _named_lines(axes[0], names))
    return figure


def draw_power_over_speed(ax: Axes, runs: Sequence[LogSummary], bins: Bins) -> None:
    """Draw the power of the last stage that any run has over the speed of the generator, one
    curve a run.
    """
    names, shown, fields = _binned(runs, bins)
    field, title, unit = fields[-1]
    unit = _curves(ax, names, [_curve(found, field) for found in shown], unit)
    label_panel(ax, "a", title, x="Generator speed (rpm)", y=f"Power ({unit})")
    ax.legend(*zip(*_named_lines(ax, names), strict=True))


def _binned(
    runs: Sequence[LogSummary], bins: Bins
) -> tuple[list[str], list[Sequence[Mapping[str, float]]], list[tuple[str, str, str]]]:
    """What the runs that have bins are called, their bins, and which of `_FIELDS` any of them
    has.
    """
    drawn = [
        (name, bins[run.name])
        for run, name in zip(drawn_runs(runs), _entries(runs), strict=True)
        if bins.get(run.name)
    ]
    fields = [row for row in _FIELDS if any(row[0] in item for _, found in drawn for item in found)]
    return [name for name, _ in drawn], [found for _, found in drawn], fields


def _named_lines(ax: Axes, names: Sequence[str]) -> list[Entry]:
    """Entries of a legend for the lines of a panel, each name once."""
    first = dict(zip(reversed(names), reversed(ax.lines), strict=True))
    return [(first[name], name) for name in dict.fromkeys(names)]


def _curves(ax: Axes, names: Sequence[str], curves: Sequence[Signal], unit: str) -> str:
    """Draw a curve for each run, those of one name alike; gives the unit of the axis."""
    place = {name: k for k, name in enumerate(dict.fromkeys(names))}
    short, unit = readable(unit, *(y for _, y in curves))
    for n, (name, (x, y)) in enumerate(zip(names, curves, strict=True)):
        colour, mark = load_style(place[name])
        dashes = _DASHES[place[name] // len(LOAD_COLOURS) % len(_DASHES)]
        marks: Any = {"marker": mark, "ms": MARK_SIZE, "mfc": COLOURS["paper"], "mew": 0.7}
        ax.plot(
            x,
            y * short,
            color=COLOURS[colour],
            ls=dashes,
            **marks,
            markevery=(n % 3, max(1, x.size // 6)),
        )
    return unit


def look_alike(runs: Sequence[LogSummary]) -> bool:
    """Whether some of the runs that share a panel have one load, and so one colour and marker."""
    names = _entries(runs)
    return len(set(names)) < len(names)


def _entries(runs: Sequence[LogSummary]) -> list[str]:
    """What the legend calls the runs that are drawn: their loads, or their numbers in the tables
    where these are unknown.
    """
    return [_load(run, f"log {runs.index(run) + 1}") for run in drawn_runs(runs)]


def _curve(bins: Sequence[Mapping[str, float]], field: str) -> Signal:
    """Generator speed and mean of the bins that have one, (2, n)."""
    points = [(0.5 * (b["rpm_low"] + b["rpm_high"]), b[field]) for b in bins if field in b]
    return np.array(points, dtype=float).reshape(-1, 2).T
