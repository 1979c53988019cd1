"""Figures of a campaign: powers and efficiencies over load (Fig. 7), torque and power over speed for all loads (Fig. 15)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from winchcascade.report.campaign_tables import Run, load_of, load_text
from winchcascade.report.figures import readable
from winchcascade.report.model_figures import MARK_SIZE, MARKS
from winchcascade.report.records import FIELDS
from winchcascade.report.style import COLOURS, LOAD_COLOURS, STAGE_STYLE, WIDTH, label_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DRAWN_RUNS = 12
"""Runs that share one panel at most; of more, an even selection."""

_POWERS = {"line": "power_line", "mech": "power_mech", "gen": "power_gen"}
_ETAS = {"mech": "eta_trans", "gen": "eta_gen", "line": "eta_pto"}
_TEX = {
    "power_line": r"$P_\mathrm{line}$", "power_mech": r"$P_\mathrm{mech}$", "power_gen": r"$P_\mathrm{gen}$",
    "eta_trans": r"$\eta_\mathrm{trans}$", "eta_gen": r"$\eta_\mathrm{gen}$", "eta_pto": r"$\eta_\mathrm{pto}$",
}  # fmt: skip
_MARKS: dict[str, Any] = {"line": "o", "mech": "s", "gen": "^"}
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
    columns = {stage: np.array([_number(run["mean"][FIELDS[m]]) for run in runs]) for stage, m in names.items()}
    columns = {stage: y for stage, y in columns.items() if np.isfinite(y).any()}
    short, unit = readable("W" if names is _POWERS else "1", *(y[np.isfinite(y)] for y in columns.values()))
    for stage, y in columns.items():
        ends = [run["interval_95"][FIELDS[names[stage]]] or (math.nan, math.nan) for run in runs]
        low, high = np.array(ends, dtype=float).T
        bars = np.nan_to_num(np.vstack((y - low, high - y)))[:, order].clip(0.0)
        ax.errorbar(
            x[order], y[order] * short, yerr=bars * short, color=COLOURS[stage], ls=STAGE_STYLE[stage], lw=0.9, ms=4,
            marker=_MARKS[stage], capsize=2, label=_TEX[names[stage]],
        )  # fmt: skip
    if at is not None:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(FixedLocator(sorted(set(at))))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.set_xticklabels([f"{load:g}" for load in sorted(set(at))])
    elif len(runs) <= DRAWN_RUNS:
        ax.set_xticks(x, [f"{k:g}" for k in x])
    ax.set_xlabel("Load resistance (Ω)" if at is not None else "Log, in the order of the table")
    ax.set_ylabel(f"Power ({unit})" if names is _POWERS else "Efficiency (1)")
    label_panel(ax, letter, title)
    if columns:
        ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.01, 1.07), borderaxespad=0.0, columnspacing=1.0)


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def drawn_runs(runs: Sequence[Run]) -> list[Run]:
    """The runs that share a panel: all, or an even selection."""
    even = np.linspace(0, max(len(runs) - 1, 0), min(len(runs), DRAWN_RUNS)).round().astype(int)
    return [runs[k] for k in even.tolist()]


def load_name(run: Run, among: Sequence[Run]) -> str:
    """Load of a run with its unit; with its name where others have the same load, and that alone for an unknown one."""
    load = load_of(run)
    if load is None:
        return _short(run["name"])
    text = load_text(run) if math.isinf(load) else f"{load_text(run)} Ω"
    return text if sum(load_of(other) == load for other in among) == 1 else f"{text}, {_short(run['name'])}"


def over_speed(runs: Sequence[Run], bins: Mapping[str, Sequence[Mapping[str, Any]]]) -> Figure | None:
    """Draw binned torque and power over the generator's speed, one curve a run.

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
    head = 0.27 + 0.17 * -(-len(shown) // 7)
    height = head + 2.42
    figure = Figure((WIDTH, height))
    axes: list[Axes] = list(figure.subplots(1, len(fields), squeeze=False, gridspec_kw={"wspace": 0.34})[0])
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - head / height, bottom=0.46 / height)
    for k, (ax, (field, title, unit)) in enumerate(zip(axes, fields, strict=True)):
        columns = [_curve(bins[run["name"]], field) for run in shown]
        short, unit = readable(unit, *(y for _, y in columns))
        for n, (run, (x, y)) in enumerate(zip(shown, columns, strict=True)):
            label = load_text(run) if load_of(run) is not None else f"log {runs.index(run) + 1}"
            dashes = _DASHES[n // len(LOAD_COLOURS) % len(_DASHES)]
            marks: Any = {"marker": MARKS[n % len(MARKS)], "ms": MARK_SIZE, "mfc": COLOURS["paper"], "mew": 0.7}
            ax.plot(
                x, y * short, color=COLOURS[LOAD_COLOURS[n % len(LOAD_COLOURS)]], ls=dashes, **marks,
                markevery=(n % 3, max(1, x.size // 6)),
                label=label if math.isinf(load_of(run) or 0.0) or load_of(run) is None else f"{label} Ω",
            )  # fmt: skip
        label_panel(ax, "abc"[k], title)
        ax.set_xlabel("Generator speed (rpm)")
        ax.set_ylabel(unit)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, [_short(text) for text in labels], loc="upper right", ncols=min(7, len(labels)))
    return figure


def _curve(bins: Sequence[Mapping[str, Any]], field: str) -> tuple[Any, Any]:
    points = [(0.5 * (b["rpm_low"] + b["rpm_high"]), b[field]) for b in bins if b[field] is not None]
    x, y = np.array(points, dtype=float).reshape(-1, 2).T
    return x, y


def _short(text: str) -> str:
    return text if len(text) <= 18 else f"{text[:8]}…{text[-8:]}"
