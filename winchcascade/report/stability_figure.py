"""Figure of the numbers of causes run by run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause
from winchcascade.report.diagnosis_names import load_words
from winchcascade.report.model_figures import legend_above, line_entry, patch_entry
from winchcascade.report.stability_words import runs_with_number, shown_as
from winchcascade.report.style import COLOURS, Room, panel_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BESIDE = 2
"""Panels in a row."""

ROW, AROUND, BETWEEN = 1.12, 0.85, 0.62
"""Height of a panel, room above and below all of them, and room between two rows. [in]"""

NAMED_RUNS = 8
"""Up to so many runs each is named by its load."""

WIDE = 4.0
"""An interval that is so many times as long as the median one leaves its panel."""

MARKED = {"order": "changes from run to run", "load": "changes with the load", "scatter": "differs between runs"}
"""What the title of a panel states of a number that is not steady."""


def stability_figure(found: DiagnosisResult) -> Figure | None:
    """Draw the number of each cause from every run alone, one panel per cause, with the joint number and its interval."""
    causes = [cause for cause in found.causes if runs_with_number(cause)]
    if not causes:
        return None
    rows = -(-len(causes) // BESIDE)
    height = AROUND + ROW * rows + BETWEEN * (rows - 1)
    room, gaps = Room(left=0.075, head=0.52, foot=0.33), {"wspace": 0.2, "hspace": BETWEEN / ROW}
    figure, panels = panel_figure(height, rows, BESIDE, room=room, gaps=gaps)
    for ax, cause in zip(panels, causes, strict=False):
        _panel(ax, found, cause)
    for ax in panels[len(causes) :]:
        ax.set_axis_off()
    entries = [
        line_entry("one run alone, 95 %", "ink", marker="o", ms=3.5, lw=1.1),
        line_entry("joint fit", "gen", lw=1.2),
        patch_entry("its interval, 95 %", "gen", alpha=0.25, lw=0),
    ]
    legend_above(figure, entries)
    return figure


def _panel(ax: Axes, found: DiagnosisResult, cause: NamedCause) -> None:
    """Draw the numbers of one cause over the runs."""
    how, joint, stability = shown_as(cause), next(iter(cause.parameters.values())), cause.stability
    if stability is None:
        return
    table = np.array([(one.value, one.low, one.high) for one in stability.runs]) * how.factor
    at, (value, low, high) = np.arange(1, len(table) + 1), table.T
    ax.axhspan(joint.low * how.factor, joint.high * how.factor, color=COLOURS["gen"], alpha=0.25, lw=0)
    ax.axhline(joint.value * how.factor, color=COLOURS["gen"], lw=1.2)
    ax.vlines(at, low, high, color=COLOURS["ink"], lw=1.1)
    ax.plot(at, value, ls="none", marker="o", ms=3.5, color=COLOURS["ink"])
    usual = high - low <= WIDE * np.nanmedian(high - low)
    ends = np.array([*low[usual], *high[usual], joint.low * how.factor, joint.high * how.factor])
    pad = 0.08 * float(np.ptp(ends))
    ax.set(xlim=(0.5, len(table) + 0.5), ylim=(ends.min() - pad, ends.max() + pad))
    if len(table) <= NAMED_RUNS:
        texts = [load_words(run.load).replace("open circuit", "open") for run in found.runs]
        ax.set_xticks(at, texts, fontsize=6.5)
    else:
        ax.set_xlabel("Run, in the order of the campaign")
    marks = ", ".join(MARKED[trend.along] for trend in stability.trends)
    ax.set_title(
        f"{found.suspects[cause.effect].label}{f': {marks}' if marks else ''}\n{how.what}, {how.unit}".removesuffix(", "),
        loc="left", pad=3, fontsize=7.2, color=COLOURS["mech" if marks else "ink"],
    )  # fmt: skip
    ax.grid(False, axis="x")
