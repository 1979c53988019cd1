"""Figure of a comparison: differences of the efficiencies with their 95 % intervals, run by run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.comparison.comparison_result import Comparison, MatchedRuns
from winchcascade.core.cascade import PAPER
from winchcascade.report.style import (
    COLOURS,
    Look,
    Margins,
    cut_apart,
    is_narrow,
    label_panel,
    look_of,
    panel_figure,
    text_width,
)
from winchcascade.report.wording import SYMBOL, load_words, tex

PANEL = 1.02
"""Height of a panel: three of them fit below the summary of a page of A4. [in]"""

_HEAD, _GAP = 0.3, 0.34
"""Margin above the first panel, and space between two panels. [in]"""

MOST_DRAWN = 16
"""Runs in a panel at most; of more, an even selection."""

UPRIGHT, UPRIGHT_NARROW = 9, 4
"""Runs whose names stand under a panel as they are, in a figure of a page and in a narrow one; those of more are turned."""

_SHORT = 14


def difference_figure(found: Comparison, metrics: Sequence[str]) -> Figure | None:
    """Draw the differences of some efficiencies, each in a panel of its own, as their intervals differ in width."""
    if not metrics:
        return None
    runs = drawn(found)
    foot = 0.2 + max(map(text_width, _names(runs))) if _turned(len(runs)) else 0.5
    height = _HEAD + foot + PANEL * len(metrics) + _GAP * (len(metrics) - 1)
    margins = Margins(left=0.115, head=_HEAD, foot=foot)
    figure, axes = panel_figure(height, len(metrics), 1, margins=margins, gaps={"hspace": _GAP / PANEL}, share="x")
    draw_differences(axes, found, metrics)
    return figure


def _turned(runs: int) -> bool:
    """Whether names stand under a panel at an angle."""
    return runs > (UPRIGHT_NARROW if is_narrow() else UPRIGHT)


def drawn(found: Comparison) -> list[MatchedRuns]:
    """The runs that are drawn, from the heaviest load to the open circuit."""
    runs = [*reversed(found.runs)]
    even = np.linspace(0, len(runs) - 1, min(len(runs), MOST_DRAWN)).round().astype(int)
    return [runs[k] for k in even.tolist()]


def _names(runs: Sequence[MatchedRuns]) -> list[str]:
    """What runs are called under a panel: their loads, or their names, cut."""
    cut = cut_apart([run.label for run in runs], _SHORT)
    return [load_words(run.load, unknown=name) for run, name in zip(runs, cut, strict=True)]


def draw_differences(axes: Sequence[Axes], found: Comparison, metrics: Sequence[str]) -> None:
    """Draw one efficiency on each of some Axes; a marker is full where the interval excludes zero."""
    runs = drawn(found)
    for k, (ax, metric) in enumerate(zip(axes, metrics, strict=True)):
        look = _look(metric)
        ax.axhline(0.0, color=COLOURS["ink"], lw=0.8, zorder=1)
        for x, one in enumerate(r.of(metric) for r in runs):
            if one is None:
                continue
            low, high = one.interval or (math.nan, math.nan)
            full = COLOURS[look.colour] if one.excludes_zero else COLOURS["paper"]
            bars = None if one.interval is None else [[one.value - low], [high - one.value]]
            ax.errorbar(
                [x], [one.value], yerr=bars, color=COLOURS[look.colour], marker=look.mark, ms=5, mfc=full, mew=1.0,
                capsize=3, lw=1.1,
            )  # fmt: skip
        ax.set_xlim(-0.6, len(runs) - 0.4)
        ax.grid(axis="x", visible=False)
        ax.locator_params(axis="y", nbins=5)
        label_panel(ax, "abcdefghij"[k % 10], f"{tex(metric)} of B less that of A", y="B − A (1)")
    turn: Any = {"rotation": 90} if _turned(len(runs)) else {}
    axes[-1].set_xticks(range(len(runs)), _names(runs), **turn)
    axes[-1].set_xlabel("" if turn else "Load" if all(r.load is not None for r in runs) else "Run")


def _look(metric: str) -> Look:
    """Look of an efficiency: that of the stage that it leads to, of the whole cascade that of the line."""
    if metric in PAPER.ratios:
        return look_of({"eta_trans": "mech", "eta_gen": "gen", "eta_pto": "line"}[metric])
    return look_of(SYMBOL[metric].rpartition("→")[2])
