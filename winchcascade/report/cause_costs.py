"""What each cause costs in efficiency, load by load, and the waterfall of it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Contribution, ContributionPart
from winchcascade.diagnosis.load_costs import OTHER, waterfall_costs
from winchcascade.report.diagnosis_words import word_of
from winchcascade.report.digits import number
from winchcascade.report.figures.style import COLOURS, Margins, panel_figure
from winchcascade.report.gap_words import has_own_simulation
from winchcascade.report.wording import load_words, tex

NAMES = {"tolerances": "tolerances", "model_form": "model form", "residual": "residual"}
"""Parts that are no cause."""

NO_ENERGY = {
    "sensor": "costs no energy: it changes what is read",
    "entry": "costs no energy: it changes a stated number, not the rig",
}
"""What is said of a cause that does not cost energy, by its kind."""


def part_name(found: ModelDiagnosis, part: ContributionPart) -> str:
    """Plain name of a part."""
    if part.effect is None or part.effect == OTHER:
        return NAMES.get(part.kind, OTHER)
    return found.suspects[part.effect].label


def points_words(value: float) -> str:
    """A part in points of efficiency, with its sign."""
    text = number(value, 1)
    return f"+{text}" if value > 0.0 and float(text) else text


def given_head(found: ModelDiagnosis) -> str:
    """What the parts begin from, as a head of a column."""
    return "your simulation" if has_own_simulation(found) else "nominal"


def no_energy_words(found: ModelDiagnosis) -> str:
    """Which causes cost no energy."""
    return " ".join(
        f"{found.suspects[cause.effect].label} {what}."
        for kind, what in NO_ENERGY.items()
        for cause in found.causes
        if cause.stage == kind
    )


COLUMNS = 3
"""Panels of the waterfall figure side by side."""

BAR = 0.165
"""Height of a bar with its margin. [in]"""


def waterfall_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw an efficiency from the model of the rig file to that of the runs, cause by cause, at three loads at most."""
    every = waterfall_costs(found)
    if not every:
        return None
    table = [every[k] for k in sorted({0, len(every) // 2, len(every) - 1})] if len(every) > COLUMNS else every
    height = BAR * (len(table[0].parts) + 2) + 0.75
    margins, gaps = Margins(left=0.2, head=0.24), {"wspace": 0.08}
    figure, panels = panel_figure(height, 1, COLUMNS, margins=margins, gaps=gaps, share="y")
    draw_waterfalls(panels, found, table)
    for ax in panels[len(table) :]:
        ax.set_visible(False)
    return figure


def draw_waterfalls(panels: Sequence[Axes], found: ModelDiagnosis, table: Sequence[Contribution]) -> None:
    """Draw one waterfall for each load, with the names of the bars at the first."""
    bars = len(table[0].parts) + 2
    span = max(_extent(costs)[1] - _extent(costs)[0] for costs in table)
    for ax, costs in zip(panels, table, strict=False):
        _waterfall(ax, costs, span)
        ax.set_title(load_words(costs.load), loc="left", pad=3)
        ax.set_xlabel(f"{tex(table[0].metric)} (%)")
    panels[0].set(
        yticks=range(bars),
        yticklabels=[given_head(found), *(part_name(found, part) for part in table[0].parts), word_of(found)],
        ylim=(bars - 0.45, -0.55),
    )


def _extent(costs: Contribution) -> tuple[float, float]:
    """Smallest and largest efficiency that a waterfall passes, with the ends of its intervals. [%]"""
    levels = [*accumulate((part.value for part in costs.parts), initial=costs.as_given)]
    ends = [level + end for level, part in zip(levels, costs.parts, strict=False) for end in (part.low, part.high)]
    return min(costs.measured, *levels, *ends), max(costs.measured, *levels, *ends)


def _waterfall(ax: Axes, costs: Contribution, span: float) -> None:
    """Draw the waterfall of one load, from above; all panels have the same scale.

    Parameters
    ----------
    span : of the widest waterfall [points]
    """
    low, high = _extent(costs)
    middle, half = 0.5 * (low + high), max(0.85 * span, 0.5)
    left = middle - half
    level, end = costs.as_given, len(costs.parts) + 1
    for place, value in ((0, costs.as_given), (end, costs.measured)):
        ax.barh(place, value - left, left=left, height=0.66, color=COLOURS["line"], lw=0)
        ax.text(value, place, f" {number(value, 1)}", va="center", ha="left", fontsize=6.8)
    for place, part in enumerate(costs.parts, 1):
        ax.plot([level, level], [place - 1.33, place + 0.33], color=COLOURS["soft"], lw=0.5)
        ax.barh(place, part.value, left=level, height=0.66, color=COLOURS[_colour(part)], lw=0)
        level += part.value
        ax.plot(
            [level - part.value + part.low, level - part.value + part.high], [place] * 2, color=COLOURS["ink"], lw=0.8
        )
        right = max(level - min(part.value, 0.0), level - part.value + part.high)
        ax.text(right, place, f" {points_words(part.value)}", va="center", ha="left", fontsize=6.8)
    ax.plot([level, level], [end - 1.33, end + 0.33], color=COLOURS["soft"], lw=0.5)
    ax.set_xlim(left, middle + 1.15 * half)
    ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


def _colour(part: ContributionPart) -> str:
    """Colour of a part by its kind and, of one that costs energy, its sign."""
    if part.kind == "physical":
        return "below" if part.value < 0.0 else "above"
    return {"sensor": "extra", "entry": "load4"}.get(part.kind, "loss")
