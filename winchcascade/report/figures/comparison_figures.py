"""Figure of a comparison: differences of the efficiencies with their intervals, run by run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.report.figures.style import (
    COLOURS,
    cut_apart,
    evenly,
    label_panel,
    look_of,
    panel_figure,
)
from winchcascade.report.glossary import tex, typeset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_DRAWN = 16
"""Runs in a panel at most, of more an even selection; names are turned where there are more than
half as many.
"""


def difference_figure(found: Comparison, metrics: Sequence[str]) -> Figure:
    """Draw the differences of some efficiencies, each in a panel of its own, as their intervals
    differ in width.
    """
    figure, axes = panel_figure(0.5 + 1.1 * len(metrics), len(metrics), share="x")
    draw_differences(axes, found, metrics)
    return figure


def draw_differences(axes: Sequence[Axes], found: Comparison, metrics: Sequence[str]) -> None:
    """Draw an efficiency on each of some Axes, from the heaviest load on; full markers: the
    interval excludes zero.
    """
    runs = evenly([*reversed(found.runs)], MAX_DRAWN)
    for k, (ax, name) in enumerate(zip(axes, metrics, strict=True)):
        place = name.rpartition("_")[2]
        look = look_of({"trans": "mech", "pto": "line"}.get(place, place))
        ax.axhline(0.0, color=COLOURS["ink"], lw=0.8, zorder=1)
        for x, one in ((x, one) for x, run in enumerate(runs) if (one := run.of(name)) is not None):
            low, high = one.interval or (math.nan, math.nan)
            ax.errorbar(
                [x], [one.value], yerr=[[one.value - low], [high - one.value]], color=COLOURS[look.colour], marker=look.mark,
                mfc=COLOURS[look.colour if one.excludes_zero else "paper"], ms=5, mew=1.0, capsize=3, lw=1.1,
            )  # fmt: skip
        ax.set_xlim(-0.6, len(runs) - 0.4)
        ax.grid(axis="x", visible=False)
        ax.locator_params(axis="y", nbins=5)
        label_panel(ax, "abcdefghij"[k % 10], f"{tex(name)} of B less that of A", y="B - A (1)")
    names = [typeset(name) for name in cut_apart([run.label for run in runs], 14)]
    axes[-1].set_xticks(
        range(len(runs)), names, rotation=90 if len(runs) > MAX_DRAWN // 2 else 0, parse_math=False
    )
