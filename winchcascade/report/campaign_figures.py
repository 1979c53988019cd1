"""Figures of a campaign: powers and efficiencies over load (Fig. 7), torque and power over speed for all loads (Fig. 15)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from winchcascade.reduction.efficiency import FIELDS
from winchcascade.report.campaign_tables import Run, comparable, load_of, load_text
from winchcascade.report.figures import readable
from winchcascade.report.model_figures import LINE, MARK_SIZE, load_style
from winchcascade.report.style import (
    COLOURS,
    LOAD_COLOURS,
    STAGE_STYLE,
    WIDTH,
    columns_within,
    cut_apart,
    label_panel,
    lines_within,
    text_width,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal

DRAWN_RUNS = 12
"""Runs that share one panel at most; of more, an even selection."""

_POWERS = {"line": "power_line", "mech": "power_mech", "gen": "power_gen"}
_ETAS = {"mech": "eta_trans", "gen": "eta_gen", "line": "eta_pto"}
_TEX = {
    "power_line": r"$P_\mathrm{line}$", "power_mech": r"$P_\mathrm{mech}$", "power_gen": r"$P_\mathrm{gen}$",
    "eta_trans": r"$\eta_\mathrm{trans}$", "eta_gen": r"$\eta_\mathrm{gen}$", "eta_pto": r"$\eta_\mathrm{pto}$",
}  # fmt: skip
_MARKS: dict[str, Any] = {"line": "o", "mech": "s", "gen": "^"}
_PANEL, _APART = 2.4, 0.05
"""Room between the first and the last load in a panel, and between two numbers under it. [in]"""

_HANDLE, _GAP = 2.6, 2.0
"""Length of a key, and room between two columns, of the legend over speed, in sizes of its font."""

_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))


def over_load(runs: Sequence[Run]) -> Figure | None:
    """Draw mean powers and efficiencies over the load, with 95 % intervals; over the runs' order where loads are unknown."""
    at = _places(runs)
    if not runs:
        return None
    figure = Figure((WIDTH, 2.9))
    left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.26})
    figure.subplots_adjust(left=0.095, right=0.985, top=0.85, bottom=0.17)
    _points(left, runs, at, _POWERS, "a", "Mean power in the window")
    _points(right, runs, at, _ETAS, "b", "Efficiency")
    return figure


def over_what(runs: Sequence[Run]) -> str:
    """What the points of `over_load` are drawn over."""
    return "the load" if _places(runs) is not None else "the logs, in the order of the tables"


def repeated(runs: Sequence[Run]) -> bool:
    """Whether the points of `over_load` are drawn over loads of which some have several logs."""
    at = _places(runs)
    return at is not None and len(set(at)) < len(at)


def _places(runs: Sequence[Run]) -> list[float] | None:
    """Loads of the runs where all have one that can be drawn, None else. [ohm]"""
    loads = [load_of(run) for run in runs]
    known = [load for load in loads if load is not None and math.isfinite(load)]
    return known if len(known) == len(runs) and len(set(known)) > 1 else None


def _points(
    ax: Axes, runs: Sequence[Run], at: list[float] | None, names: Mapping[str, str], letter: str, title: str
) -> None:
    x = np.arange(1.0, len(runs) + 1) if at is None else np.array(at)
    order = np.argsort(x, kind="stable")
    groups = comparable(runs)
    columns = {stage: np.array([_number(run["mean"][FIELDS[m]]) for run in runs]) for stage, m in names.items()}
    columns = {stage: y for stage, y in columns.items() if np.isfinite(y).any()}
    short, unit = readable("W" if names is _POWERS else "1", *(y[np.isfinite(y)] for y in columns.values()))
    for stage, y in columns.items():
        ends = [run["interval_95"][FIELDS[names[stage]]] or (math.nan, math.nan) for run in runs]
        low, high = np.array(ends, dtype=float).T
        bars = np.nan_to_num(np.vstack((y - low, high - y)))[:, order].clip(0.0)
        line: Any = {"color": COLOURS[stage], "lw": 0.9, "ls": STAGE_STYLE[stage]}
        mark: Any = {"marker": _MARKS[stage], "ms": 4, "label": _TEX[names[stage]]}
        for n, members in enumerate(groups):
            here = np.isin(order, members)
            own_x, own_y = x[order[here]], y[order[here]] * short
            hollow: Any = {"mfc": COLOURS["paper"], "label": "_"} if n else {"label": "_"}
            ends = bars[:, here] * short
            ax.errorbar(own_x, own_y, yerr=ends, capsize=2, **line | {"ls": "none"}, **mark | hollow)
            ax.plot(*(_means(own_x, own_y) if repeated(runs) else (own_x, own_y)), **line)
        ax.plot([], [], **line, **mark)  # for the legend: the points on their line
    if at is not None:
        _label_loads(ax, sorted(set(at)))
    elif len(runs) <= DRAWN_RUNS:
        ax.set_xticks(x, [f"{k:g}" for k in x])
    ax.set_xlabel("Load resistance (Ω)" if at is not None else "Log, in the order of the table")
    ax.set_ylabel(f"Power ({unit})" if names is _POWERS else "Efficiency (1)")
    label_panel(ax, letter, title)
    if columns:
        ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.01, 1.07), borderaxespad=0.0, columnspacing=1.0)


def _means(x: Signal, y: Signal) -> tuple[list[float], list[float]]:
    """Each load once, and the mean of what its logs give; without the loads of which none gives anything."""
    given = np.isfinite(y)
    loads = np.unique(x[given]).tolist()
    return loads, [float(np.mean(y[given & (x == load)])) for load in loads]


def _label_loads(ax: Axes, loads: Sequence[float]) -> None:
    """Set the loads on a logarithmic axis, with a number at each that has the room for it."""
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(FixedLocator(loads))
    ax.xaxis.set_minor_locator(NullLocator())
    inches = _PANEL / math.log(loads[-1] / loads[0])
    texts: list[str] = []
    end = -math.inf
    for load in loads:
        at, half = inches * math.log(load / loads[0]), 0.5 * text_width(f"{load:g}")
        free = at - half > end
        texts.append(f"{load:g}" if free else "")
        end = at + half + _APART if free else end
    ax.set_xticklabels(texts)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def drawn_runs(runs: Sequence[Run]) -> list[Run]:
    """The runs that share a panel: all, or an even selection."""
    even = np.linspace(0, max(len(runs) - 1, 0), min(len(runs), DRAWN_RUNS)).round().astype(int)
    return [runs[k] for k in even.tolist()]


def load_names(runs: Sequence[Run]) -> list[str]:
    """Load of each run with its unit, the name of the log, cut, where it is unknown."""
    names = cut_apart([run["name"] for run in runs])
    return [name if load_of(run) is None else _with_unit(run) for run, name in zip(runs, names, strict=True)]


def _with_unit(run: Run) -> str:
    return load_text(run) if math.isinf(load_of(run) or 0.0) else f"{load_text(run)} Ω"


def over_speed(runs: Sequence[Run], bins: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure | None:
    """Draw binned torque and power over the generator's speed, one curve a run; runs of one load look alike.

    Parameters
    ----------
    bins : bins of each run by its name
    """
    shown = [run for run in drawn_runs(runs) if bins.get(run["name"])]
    fields = [
        (field, title, unit)
        for field, title, unit in (
            ("torque_nm", "Torque behind the clutch", "N·m"),
            ("power_mech_w", "Power of the shaft", "W"),
            ("power_gen_w", "Power at the DC link", "W"),
        )
        if any(b[field] is not None for run in shown for b in bins[run["name"]])
    ][-3:]
    if not shown or not fields:
        return None
    names = [_entry(run, runs) for run in shown]
    place = {name: k for k, name in enumerate(dict.fromkeys(names))}
    head = 0.27 + LINE * lines_within(list(place), handle=_HANDLE, gap=_GAP)
    height = head + 2.42
    figure = Figure((WIDTH, height))
    axes: list[Axes] = list(figure.subplots(1, len(fields), squeeze=False, gridspec_kw={"wspace": 0.34})[0])
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - head / height, bottom=0.46 / height)
    for k, (ax, (field, title, unit)) in enumerate(zip(axes, fields, strict=True)):
        columns = [_curve(bins[run["name"]], field) for run in shown]
        short, unit = readable(unit, *(y for _, y in columns))
        for n, (name, (x, y)) in enumerate(zip(names, columns, strict=True)):
            colour, mark = load_style(place[name])
            dashes = _DASHES[place[name] // len(LOAD_COLOURS) % len(_DASHES)]
            marks: Any = {"marker": mark, "ms": MARK_SIZE, "mfc": COLOURS["paper"], "mew": 0.7}
            every = (n % 3, max(1, x.size // 6))
            ax.plot(x, y * short, color=COLOURS[colour], ls=dashes, **marks, markevery=every, label=name)
        label_panel(ax, "abc"[k], title)
        ax.set_xlabel("Generator speed (rpm)")
        ax.set_ylabel(unit)
    handles, labels = axes[0].get_legend_handles_labels()
    entries = dict(zip(reversed(labels), reversed(handles), strict=True))
    columns_in = columns_within(list(place), handle=_HANDLE, gap=_GAP)
    figure.legend(
        [entries[name] for name in place], list(place), loc="upper right", ncols=columns_in, columnspacing=_GAP
    )
    return figure


def look_alike(runs: Sequence[Run]) -> bool:
    """Whether some of the runs that share a panel have one load, and so one colour and marker."""
    names = [_entry(run, runs) for run in drawn_runs(runs)]
    return len(set(names)) < len(names)


def _entry(run: Run, runs: Sequence[Run]) -> str:
    """What the legend calls a run: its load, or its number in the tables where that is unknown."""
    return f"log {runs.index(run) + 1}" if load_of(run) is None else _with_unit(run)


def _curve(bins: Sequence[Mapping[str, Any]], field: str) -> tuple[Any, Any]:
    points = [(0.5 * (b["rpm_low"] + b["rpm_high"]), b[field]) for b in bins if b[field] is not None]
    x, y = np.array(points, dtype=float).reshape(-1, 2).T
    return x, y
