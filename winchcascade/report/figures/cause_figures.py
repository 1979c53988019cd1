"""Figures of the causes: what they cost, their numbers run by run, and the roll-off (Fig. 18e)."""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    ContributionPart,
    DiagnosisResult,
    NamedCause,
)
from winchcascade.diagnosis.explain.figure_data import profile_of, worst_costs
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.content import number_text
from winchcascade.report.diagnosis_names import baseline_words, runs_with_number, shown_as
from winchcascade.report.figures.style import (
    COLOURS,
    NARROW,
    LineStyle,
    broken,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.glossary import tex, typeset
from winchcascade.report.wording import load_words
from winchcascade.rig.parts import ROLLOFF_KNOTS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# ---------------------------------------------------------------------------------- the waterfall
BAR = 0.155
"""Height of a bar with its margin. [in]"""

COLOUR_OF = {"sensor": "extra", "entry": "load4"}
"""Colour of a part that costs no energy, by its kind."""


def part_name(found: ModelDiagnosis, part: ContributionPart) -> str:
    """Plain name of a part."""
    return part.kind.replace("_", " ") if part.effect is None else found.suspects[part.effect].label


def waterfall_figure(found: ModelDiagnosis, word: str) -> Figure | None:
    """Draw an efficiency from the model of the rig file to that of the runs, cause by cause, at the
    load of the largest gap.

    Parameters
    ----------
    word : what the logs are called
    """
    largest = worst_costs(found)
    if largest is None:
        return None
    figure, (ax,) = panel_figure(BAR * (len(largest.parts) + 2) + 0.6)
    figure.set_figwidth(NARROW)
    _waterfall(ax, largest)
    ax.set_title(load_words(largest.load))
    ax.set_xlabel(f"{tex(largest.metric)} (%)")
    names = [baseline_words(found), *(part_name(found, part) for part in largest.parts), word]
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.45, -0.55)
    return figure


def _extent(costs: Contribution) -> tuple[float, float]:
    """Smallest and largest efficiency that a waterfall passes, with the ends of its intervals.
    [%]
    """
    levels = [*accumulate((part.value for part in costs.parts), initial=costs.as_given)]
    ends = [
        level + end
        for level, part in zip(levels, costs.parts, strict=False)
        for end in (part.low, part.high)
    ]
    return min(costs.measured, *levels, *ends), max(costs.measured, *levels, *ends)


def _waterfall(ax: Axes, costs: Contribution) -> None:
    """Draw the waterfall of one load, from above, on an axis that is wider than its levels."""
    from matplotlib.ticker import MaxNLocator

    low, high = _extent(costs)
    middle, half = 0.5 * (low + high), max(0.85 * (high - low), 0.5)
    left, level, end = middle - half, costs.as_given, len(costs.parts) + 1
    for place, value in ((0, costs.as_given), (end, costs.measured)):
        ax.barh(place, value - left, left=left, height=0.66, color=COLOURS["line"], lw=0)
        ax.text(value, place, f" {number_text(value, 1)}", va="center", fontsize=6.8)
    for place, part in enumerate(costs.parts, 1):
        ax.plot([level, level], [place - 1.33, place + 0.33], color=COLOURS["soft"], lw=0.5)
        colour = COLOUR_OF.get(part.kind, "loss")
        if part.kind == "physical":
            colour = "below" if part.value < 0.0 else "above"
        ax.barh(place, part.value, left=level, height=0.66, color=COLOURS[colour], lw=0)
        ax.plot([level + part.low, level + part.high], [place, place], color=COLOURS["ink"], lw=0.8)
        right = level + max(part.value, 0.0, part.high)
        ax.text(
            right,
            place,
            f" {typeset(number_text(part.value, 1, signed=True))}",
            va="center",
            fontsize=6.8,
        )
        level += part.value
    ax.plot([level, level], [end - 1.33, end + 0.33], color=COLOURS["soft"], lw=0.5)
    ax.set_xlim(left, middle + 1.25 * half)
    ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


# ----------------------------------------------------------------------------------- the roll-off
def profile_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the roll-off of the back-EMF constant over the stator current with its band (Fig.
    18e).
    """
    profile = profile_of(found)
    if profile is None:
        return None
    current, left, low, high = profile
    figure, (ax,) = panel_figure(2.6)
    ax.fill_between(current, low, high, color=COLOURS["gen"], alpha=0.3, lw=0)
    ax.plot(current, left, color=COLOURS["gen"], lw=1.4)
    knots = np.array(ROLLOFF_KNOTS) * found.data.nominal.generator.i_rated
    knots = knots[knots <= current[-1]]
    ax.plot(knots, np.interp(knots, current, left), "s", ms=3.5, color=COLOURS["gen"])
    ax.axhline(1.0, color=COLOURS["ink"], lw=0.9, ls="--")
    entries = [
        line_entry("found, with knots", "gen", marker="s", ms=3.5, lw=1.4),
        patch_entry("95 % band", "gen", alpha=0.3, lw=0),
        line_entry("rig file", lw=0.9, ls="--"),
    ]
    rated = found.rig.generator.i_rated
    if rated is not None and rated.value <= current[-1]:
        ax.axvline(rated.value, color=COLOURS["soft"], lw=0.9, ls=":")
        entries.append(line_entry(f"rated, {rated.value:g} A", "soft", lw=0.9, ls=":"))
    ax.set(xlim=(0.0, current[-1] * 1.01), xlabel="Stator current (A rms)")
    ax.set_ylabel(r"$k_\mathrm{e}$ over its nominal value (1)")
    legend_above(figure, entries)
    return figure


# ------------------------------------------------------------------------------------- run by run
NAMED_RUNS = 8
"""Maximum number of runs of which each is named by its load."""

WIDE = 4.0
"""An interval that is longer than the median one by more than this factor leaves its panel, with an
arrow there."""

TITLE = 46
"""Characters of a line of a panel's title."""

MARKED = {"order": "drifts", "load": "changes with the load", "scatter": "scatters"}
"""What the title of a panel states of a number that is not steady."""


def stability_figure(found: DiagnosisResult) -> Figure | None:
    """Draw the number of each cause in every run, one panel per cause, with the joint number and
    its interval.
    """
    causes = [cause for cause in found.causes if runs_with_number(cause)]
    if not causes:
        return None
    rows = -(-len(causes) // 2)
    figure, panels = panel_figure(0.4 + 1.7 * rows, rows, 2)
    for ax, cause in zip(panels, causes, strict=False):
        _run_by_run(ax, found, cause)
    for ax in panels[len(causes) :]:
        ax.set_axis_off()
    item = "cycle" if isinstance(found, StageDiagnosis) else "run"
    entries = [
        line_entry(f"one {item}, 95 %", "ink", marker="o", ms=3.5, lw=1.1),
        line_entry("joint fit", "gen", lw=1.2),
        patch_entry("its interval, 95 %", "gen", alpha=0.25, lw=0),
    ]
    legend_above(figure, entries)
    return figure


def _run_by_run(ax: Axes, found: DiagnosisResult, cause: NamedCause) -> None:
    """Draw the numbers of one cause over the runs."""
    how, joint, stability = (
        shown_as(found, cause),
        next(iter(cause.parameters.values())),
        cause.stability,
    )
    if stability is None:
        return
    table = np.array([(one.value, one.low, one.high) for one in stability.runs]) * how.factor
    at, (value, low, high) = np.arange(1, len(table) + 1), table.T
    band = (
        np.array([joint.low, joint.high] if joint.determined else [joint.value, joint.value])
        * how.factor
    )
    ax.axhspan(*band, color=COLOURS["gen"], alpha=0.25, lw=0)
    ax.axhline(joint.value * how.factor, color=COLOURS["gen"], lw=1.2)
    usual = high - low <= WIDE * np.nanmedian(high - low)
    ends = np.array([*low[usual], *high[usual], *band])
    pad = 0.08 * float(np.ptp(ends))
    bottom, top = float(ends.min() - pad), float(ends.max() + pad)
    ax.set(xlim=(0.5, len(table) + 0.5), ylim=(bottom, top))
    ax.vlines(at, np.maximum(low, bottom), np.minimum(high, top), color=COLOURS["ink"], lw=1.1)
    inside = (value >= bottom) & (value <= top)
    dots: LineStyle = {"ls": "none", "ms": 3.5, "color": COLOURS["ink"]}
    ax.plot(at[inside], value[inside], marker="o", **dots)
    for beyond, edge, arrow in ((high > top, top, "^"), (low < bottom, bottom, "v")):
        if beyond.any():
            ax.plot(at[beyond], np.full(np.count_nonzero(beyond), edge), marker=arrow, **dots)
    if isinstance(found, StageDiagnosis):
        ax.set_xlabel("Cycle, one after the other")
    elif len(table) <= NAMED_RUNS:
        loads = [load_words(run.load).replace("open circuit", "open") for run in found.runs]
        ax.set_xticks(at, loads, fontsize=6.5)
    else:
        ax.set_xlabel("Run, in the order of the campaign")
    marks = ", ".join(MARKED[trend.along] for trend in stability.trends)
    title = f"{found.suspects[cause.effect].label}{f': {marks}' if marks else ''}"
    what = f"{how.what} ({how.unit})" if how.unit else how.what
    ax.set_title(
        f"{broken(title, TITLE)}\n{what}", fontsize=7.2, color=COLOURS["mech" if marks else "ink"]
    )
    ax.grid(False, axis="x")
