"""Figures of the cycles of one reduction: laid over each other, and one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from winchcascade.reduction.efficiency import RATIOS
from winchcascade.report.figures import DRAWN, ETA_TEX, TEX, dots, readable
from winchcascade.report.style import COLOURS, WIDTH, label_panel
from winchcascade.report.traces import PANELS, envelope

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.reduction_result import CycleResult, Reduction

TREND_FROM = 6
"""With fewer cycles than this the table shows a drift as well."""

OVERLAID = 40
"""Cycles that are laid over each other at most; of more, an even selection."""

OVERLAID_POINTS = 6000
"""Points of all overlaid cycles together in one panel, about."""


def overlaid(reduction: Reduction, powers: dict[str, Signal], best: int | None, worst: int | None) -> Figure | None:
    """Lay the cycles over each other on a clock that starts at each onset; best and worst stand out.

    Parameters
    ----------
    best, worst : numbers of the cycles of the highest and the lowest efficiency, None where they cannot be told
    """
    run, cycles = reduction.run, reduction.cycles
    names = [n for n in ("velocity", "force", "torque", "pressure") if n in run.channels][:3]
    panels = [p for p in PANELS if p[0] in names]
    columns: list[tuple[str, str, Signal]] = [(t, u, run.channels[n] * f) for n, t, u, f in panels]
    last = [s for s in ("gen", "mech", "line") if s in powers][:1]
    columns += [(f"Power {TEX[s]}", "W", powers[s]) for s in last]
    if not cycles or not columns:
        return None
    rows = -(-len(columns) // 2)
    height = 0.5 + 1.55 * rows
    figure = Figure((WIDTH, height))
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.36, "wspace": 0.24})
    figure.subplots_adjust(left=0.095, right=0.985, top=1 - 0.42 / height, bottom=0.42 / height)
    axes: list[Axes] = list(grid.ravel())
    for ax in axes[len(columns) :]:
        ax.set_visible(False)
    chosen = _selection(cycles, best, worst)
    longest = max(_end_of(c, run) - c.phases.onset for c in chosen)
    for k, (ax, (title, unit, x)) in enumerate(zip(axes, columns, strict=False)):
        short, unit = readable(unit, x)
        for c in chosen:
            _one_overlaid(ax, run, x * short, c, best, worst, most=max(150, OVERLAID_POINTS // len(chosen)))
        for c in chosen[:1]:
            ax.axvline(c.window.cutoff - c.window.onset, color=COLOURS["soft"], ls="--", lw=0.8)
        label_panel(ax, "abcdefgh"[k], title)
        ax.set_ylabel(unit)
        ax.set_xlim(-1.0, longest)
        if k + 2 >= len(columns):
            ax.set_xlabel("Time since onset (s)")
            ax.tick_params(labelbottom=True)
    handles, labels = axes[0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if len(named) > 1:
        figure.legend(named.values(), named.keys(), loc="upper right", ncols=len(named), bbox_to_anchor=(0.99, 1.0))
    return figure


def trend(reduction: Reduction) -> Figure | None:
    """Draw efficiencies and energies over the number of the cycle, so that a drift is seen; None for few cycles."""
    complete = reduction.complete
    etas = [m for m in RATIOS if getattr(reduction.mean, m) is not None]
    energies = [m for m in ETA_TEX if m.startswith("energy") and getattr(reduction.mean, m) is not None]
    groups = [(title, names) for title, names in (("Efficiencies", etas), ("Energies", energies)) if names]
    if len(complete) < TREND_FROM or not groups:
        return None
    height = 0.55 + 1.5 * len(groups)
    figure = Figure((WIDTH, height))
    axes: list[Axes] = list(
        figure.subplots(len(groups), 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.3})[:, 0]
    )
    figure.subplots_adjust(left=0.095, right=0.985, top=1 - 0.25 / height, bottom=0.42 / height)
    number = np.array([c.cycle for c in complete], dtype=float)
    for k, (ax, (title, names)) in enumerate(zip(axes, groups, strict=True)):
        columns = {name: np.array([getattr(c.metrics, name) for c in complete], dtype=float) for name in names}
        short, unit = readable("J" if title == "Energies" else "1", *columns.values())
        ax.set_ylabel(unit)
        for name, joule in columns.items():
            values = joule * short
            rows = envelope(values, DRAWN // 2)
            stage = _TREND_STAGE[name]
            ax.plot(number[rows], values[rows], color=COLOURS[stage], lw=0.5, alpha=0.5)
            mark: Any = {"line": "o", "mech": "s", "gen": "^"}[stage]
            few = len(rows) <= 200
            ax.plot(
                number[rows] if few else [], values[rows] if few else [], ls="none", marker=mark, ms=2.2, mew=0,
                color=COLOURS[stage], label=ETA_TEX[name],
            )  # fmt: skip
            if not few:
                dots(ax, number[rows], values[rows], COLOURS[stage])
        label_panel(ax, "ab"[k], title)
        ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0, markerscale=1.8)
    axes[-1].set_xlabel("Cycle")
    return figure


_TREND_STAGE = {
    "eta_trans": "mech", "eta_gen": "gen", "eta_pto": "line", "energy_line": "line", "energy_mech": "mech", "energy_gen": "gen",
}  # fmt: skip


def _selection(cycles: Sequence[CycleResult], best: int | None, worst: int | None) -> list[CycleResult]:
    """Cycles to be drawn, best and worst last so that they lie on top."""
    even = np.linspace(0, len(cycles) - 1, min(len(cycles), OVERLAID)).round().astype(int)
    rest = [cycles[k] for k in even.tolist() if cycles[k].cycle not in (best, worst)]
    return rest + [c for number in (worst, best) for c in cycles if c.cycle == number]


def _end_of(cycle: CycleResult, run: Run) -> float:
    phases = cycle.phases
    end = phases.haul_in[1] if phases.haul_in is not None else phases.hold[1] if phases.hold else phases.payout_end
    return min(end, float(run.t[-1]))


def _one_overlaid(
    ax: Axes, run: Run, x: Signal, c: CycleResult, best: int | None, worst: int | None, *, most: int
) -> None:
    part = slice(*np.searchsorted(run.t, (c.phases.onset - 1.0, _end_of(c, run))).tolist())
    rows = envelope(x[part], most)
    t = run.t[part][rows] - c.phases.onset
    style: dict[str, Any] = {"color": COLOURS["soft"], "lw": 0.7, "label": "other cycles" if best else "complete"}
    if c.cycle == best:
        style = {"color": COLOURS["line"], "lw": 1.1, "label": f"best, cycle {best}"}
    elif c.cycle == worst:
        style = {"color": COLOURS["mech"], "lw": 1.1, "ls": (0, (4, 1.2)), "label": f"worst, cycle {worst}"}
    elif not c.complete:
        style = {"color": COLOURS["soft"], "lw": 0.7, "ls": ":", "label": "incomplete"}
    ax.plot(t, x[part][rows], **style)
