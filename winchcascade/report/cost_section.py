"""What each cause costs, as a section of the report of a diagnosis: a waterfall figure and tables."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.ticker import MaxNLocator

from winchcascade.diagnosis.contributions import EFFICIENCIES, leading_metric
from winchcascade.report.cause_costs import (
    LoadCosts,
    LoadPart,
    given_head,
    given_words,
    goal_words,
    load_costs,
    no_energy_words,
    part_name,
    points_words,
)
from winchcascade.report.diagnosis_names import load_words
from winchcascade.report.diagnosis_words import named, word_of
from winchcascade.report.digits import number
from winchcascade.report.report_model import (
    Section,
    Table,
    formatted_table,
    number_column,
    picture,
    section,
    text_column,
)
from winchcascade.report.style import COLOURS, Room, panel_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from winchcascade.diagnosis.diagnose import ModelDiagnosis


def cost_section(found: ModelDiagnosis) -> Section:
    """The waterfall figure and a table of each efficiency; without blocks where no run has an efficiency."""
    return section(
        "costs", "What each cause costs",
        picture(
            waterfall_figure(found), "waterfall",
            f"{leading_metric(found.contributions)} from {given_words(found)} to {goal_words(found)}, cause by cause, at each "
            "load. Red: a cause that costs efficiency; green: one that adds some; purple: a sensor, which costs no energy; "
            "yellow: a wrong entry; grey: tolerances and residual. Black lines: 95 %.",
            "Bars from one level to the next; the values are in the table.",
        ),
        *cost_tables(found),
    )  # fmt: skip


def cost_tables(found: ModelDiagnosis) -> list[Table | None]:
    """The split of every efficiency by load."""
    return [_cost_table_of(found, metric) for metric in EFFICIENCIES]


def _cost_table_of(found: ModelDiagnosis, metric: str) -> Table | None:
    table = load_costs(found, metric)
    if not table:
        return None
    rows = [
        (
            part_name(found, part) if part.effect is None else named(found, part.effect),
            "" if part.effect is None else part.kind,
            *(_beside(costs.parts[k]) for costs in table),
        )
        for k, part in enumerate(table[0].parts)
    ]
    ends = [
        (name, "", *(number(getattr(costs, of), 2) for costs in table))
        for name, of in ((f"{given_head(found)} [%]", "as_given"), (f"{word_of(found)} [%]", "measured"))
    ]
    return formatted_table(
        f"costs-{metric.replace('_', '-')}",
        f"{metric}: from {given_words(found)} to {goal_words(found)}, in points of efficiency (±: 95 %).",
        (text_column("Part"), text_column("Kind"), *(number_column(load_words(costs.load)) for costs in table)),
        [ends[0], *rows, ends[1]],
        f"{no_energy_words(found)} {ABOUT}".strip(),
    )


ABOUT = (
    "A cause contributes what it adds to a simulation, averaged over all orders in which the causes may be added. Tolerances: "
    "numbers and sensors of the rig as the fit moved them within their tolerances. The parts add up to the difference."
)


def _beside(part: LoadPart) -> str:
    """A part with half its interval."""
    return f"{points_words(part.value)} ± {number(0.5 * (part.high - part.low), 2)}"


COLUMNS = 3
"""Panels of the waterfall figure side by side."""

MOST_LOADS = 9
"""Loads in the waterfall figure at most; all are in the table."""

BAR = 0.165
"""Height of a bar with its room. [in]"""


def waterfall_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw an efficiency from the rig as given to that of the runs, cause by cause, a panel for each load."""
    metric = leading_metric(found.contributions)
    table = load_costs(found, metric)[:MOST_LOADS]
    if not table:
        return None
    bars, lines = len(table[0].parts) + 2, -(-len(table) // COLUMNS)
    height = lines * (bars * BAR + 0.5) + 0.25
    gaps = {"wspace": 0.08, "hspace": 0.5 / (bars * BAR)}
    figure, panels = panel_figure(height, lines, COLUMNS, room=Room(left=0.2, head=0.24), gaps=gaps, share="y")
    span = max(_reach(costs)[1] - _reach(costs)[0] for costs in table)
    for k, ax in enumerate(panels):
        if k >= len(table):
            ax.set_visible(False)
            continue
        _waterfall(ax, table[k], span)
        ax.set_title(load_words(table[k].load), loc="left", pad=3)
        if k + COLUMNS >= len(table):
            ax.set_xlabel(f"{metric} (%)")
    names = [given_head(found), *(part_name(found, part) for part in table[0].parts), word_of(found)]
    panels[0].set(yticks=range(bars), yticklabels=names, ylim=(bars - 0.45, -0.55))
    return figure


def _reach(costs: LoadCosts) -> tuple[float, float]:
    """Smallest and largest efficiency that a waterfall passes. [%]"""
    level, levels = costs.as_given, [costs.as_given, costs.measured]
    for part in costs.parts:
        level += part.value
        levels.append(level)
    return min(levels), max(levels)


def _waterfall(ax: Axes, costs: LoadCosts, span: float) -> None:
    """Draw the waterfall of one load, from above; all panels have the same scale.

    Parameters
    ----------
    span : of the widest waterfall [points]
    """
    low, high = _reach(costs)
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
        ax.text(right, place, f" {points_words(part.value, 1)}", va="center", ha="left", fontsize=6.8)
    ax.plot([level, level], [end - 1.33, end + 0.33], color=COLOURS["soft"], lw=0.5)
    ax.set_xlim(left, middle + 1.15 * half)
    ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


def _colour(part: LoadPart) -> str:
    """Colour of a part by its kind and, of one that costs energy, its sign."""
    if part.kind == "physical":
        return "mech" if part.value < 0.0 else "gen"
    return {"sensor": "extra", "entry": "load4"}.get(part.kind, "loss")
