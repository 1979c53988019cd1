"""Figures of the numbers of the causes, jointly and run by run, and of the law of the back-EMF constant (Fig. 18e)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.diagnosis.cause_numbers import CauseNumber, cause_numbers, profile_of
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report.cause_words import runs_with_number, shown_as
from winchcascade.report.figures.style import (
    COLOURS,
    Margins,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.gap_words import display_of
from winchcascade.report.wording import load_words
from winchcascade.rig.parts import ROLLOFF_KNOTS

ROW = 0.52
"""Height of the row of a number. [in]"""


def numbers_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw each number of the causes with its interval, beside its absent value, the tolerance there, and what is plausible."""
    rows = cause_numbers(found)
    if not rows:
        return None
    height = 0.3 + ROW * len(rows)
    figure, panels = panel_figure(height, len(rows), margins=Margins(left=0.3, foot=0.2), gaps={"hspace": 1.1})
    for ax, row in zip(panels, rows, strict=True):
        how = display_of(row.cause.effect, row.name, row.found.unit)
        _number(ax, row, how.factor)
        ax.set_yticks([0], [f"{found.suspects[row.cause.effect].label}\n{how.what}, {how.unit}".removesuffix(", ")])
    legend_above(
        figure,
        [
            line_entry("found, 95 %", "gen", marker="s", ms=4.5, lw=2.4),
            line_entry("rig file", lw=1.0, ls="--"),
            patch_entry("its tolerance, 95 %", "line", alpha=0.3, lw=0),
            patch_entry("plausible", "hold", ec=COLOURS["grid"]),
        ],
    )
    return figure


def _number(ax: Axes, row: CauseNumber, factor: float) -> None:
    low, high, absent, half = (x * factor for x in (row.low, row.high, row.absent, 1.96 * row.tolerance))
    ax.axvspan(low, high, color=COLOURS["hold"], lw=0, zorder=0.1)
    if half:
        ax.axvspan(absent - half, absent + half, color=COLOURS["line"], alpha=0.3, lw=0, zorder=0.2)
    ax.axvline(absent, color=COLOURS["ink"], lw=1.0, ls="--", zorder=0.3)
    value, left, right = (x * factor for x in (row.found.value, row.found.low, row.found.high))
    ax.plot([left, right], [0, 0], color=COLOURS["gen"], lw=2.4, solid_capstyle="butt")
    ax.plot([value], [0], "s", ms=4.5, color=COLOURS["gen"])
    pad = 0.03 * max(high - low, 1e-12)
    ax.set(xlim=(min(low, left) - pad, max(high, right) + pad), ylim=(-1, 1))
    ax.spines["left"].set_visible(False)
    ax.grid(False)
    ax.tick_params(labelsize=6.5)
    ax.tick_params(axis="y", length=0)


# ------------------------------------------------------------------------------------------------------------- Fig 18e
def profile_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the roll-off of the back-EMF constant over the stator current with its band (Fig. 18e)."""
    profile = profile_of(found)
    if profile is None:
        return None
    figure, (ax,) = panel_figure(2.7, margins=Margins(head=0.28))
    ax.fill_between(profile.current, profile.low, profile.high, color=COLOURS["gen"], alpha=0.3, lw=0)
    ax.plot(profile.current, profile.left, color=COLOURS["gen"], lw=1.4)
    knots = np.array([x for x in ROLLOFF_KNOTS if x <= profile.current[-1]])
    ax.plot(knots, np.interp(knots, profile.current, profile.left), "s", ms=3.5, color=COLOURS["gen"])
    ax.axhline(1.0, color=COLOURS["ink"], lw=0.9, ls="--")
    entries = [
        line_entry("found, with knots", "gen", marker="s", ms=3.5, lw=1.4),
        patch_entry("95 % band", "gen", alpha=0.3, lw=0),
        line_entry("rig file", lw=0.9, ls="--"),
    ]
    rated = found.rig.generator.i_rated
    if rated is not None:
        ax.axvline(rated.value, color=COLOURS["soft"], lw=0.9, ls=":")
        entries.append(line_entry(f"rated, {rated.value:g} A", "soft", lw=0.9, ls=":"))
    ax.set(
        xlim=(0.0, profile.current[-1] * 1.01), xlabel="Stator current (A rms)",
        ylabel=r"$k_\mathrm{e}$ over its nominal value (1)",
    )  # fmt: skip
    legend_above(figure, entries)
    return figure


# ----------------------------------------------------------------------------------------------------------- run by run
BESIDE = 2
"""Panels in a row."""

PANEL, AROUND, BETWEEN = 1.12, 0.97, 0.78
"""Height of a panel, margins above and below all of them, and space between two rows. [in]"""

NAMED_RUNS = 8
"""Maximum number of runs of which each is named by its load."""

WIDE = 4.0
"""An interval that is longer than the median one by more than this factor leaves its panel."""

MARKED = {"order": "drifts", "load": "changes with the load", "scatter": "scatters"}
"""What the title of a panel states of a number that is not steady."""


def stability_figure(found: DiagnosisResult) -> Figure | None:
    """Draw the number of each cause from every run alone, one panel per cause, with the joint number and its interval."""
    causes = [cause for cause in found.causes if runs_with_number(cause)]
    if not causes:
        return None
    rows, item = -(-len(causes) // BESIDE), "cycle" if isinstance(found, LineDiagnosis) else "run"
    height = AROUND + PANEL * rows + BETWEEN * (rows - 1)
    margins, gaps = Margins(left=0.075, head=0.52, foot=0.45), {"wspace": 0.2, "hspace": BETWEEN / PANEL}
    figure, panels = panel_figure(height, rows, BESIDE, margins=margins, gaps=gaps)
    for ax, cause in zip(panels, causes, strict=False):
        _run_by_run(ax, found, cause)
    for ax in panels[len(causes) :]:
        ax.set_axis_off()
    legend_above(
        figure,
        [
            line_entry(f"one {item} alone, 95 %", "ink", marker="o", ms=3.5, lw=1.1),
            line_entry("joint fit", "gen", lw=1.2),
            patch_entry("its interval, 95 %", "gen", alpha=0.25, lw=0),
        ],
    )
    return figure


def _run_by_run(ax: Axes, found: DiagnosisResult, cause: NamedCause) -> None:
    """Draw the numbers of one cause over the runs."""
    how, joint, stability = shown_as(found, cause), next(iter(cause.parameters.values())), cause.stability
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
    if isinstance(found, LineDiagnosis):
        ax.set_xlabel("Cycle, one after the other")
    elif len(table) <= NAMED_RUNS:
        ax.set_xticks(at, [load_words(run.load).replace("open circuit", "open") for run in found.runs], fontsize=6.5)
    else:
        ax.set_xlabel("Run, in the order of the campaign")
    marks = ", ".join(MARKED[trend.along] for trend in stability.trends)
    ax.set_title(
        f"{found.suspects[cause.effect].label}{f': {marks}' if marks else ''}\n{how.what} ({how.unit or 1})",
        loc="left", pad=3, fontsize=7.2, color=COLOURS["mech" if marks else "ink"],
    )  # fmt: skip
    ax.grid(False, axis="x")
