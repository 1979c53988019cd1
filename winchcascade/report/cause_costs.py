"""What each cause costs in efficiency, load by load: numbers, sentences, a waterfall figure, and tables."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from itertools import accumulate
from typing import TYPE_CHECKING, TypeVar

import msgspec

from winchcascade.diagnosis.contributions import EFFICIENCIES, leading_metric, loaded_part
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Contribution, ContributionPart
from winchcascade.report import sheet as content
from winchcascade.report.cause_words import named
from winchcascade.report.diagnosis_words import word_of
from winchcascade.report.digits import NumberText, number
from winchcascade.report.gap_words import has_own_simulation
from winchcascade.report.sheet import number_column, text_column
from winchcascade.report.text_table import aligned_lines, table_lines
from winchcascade.report.wording import SYMBOL, load_words, tex

if TYPE_CHECKING:  # the text of a diagnosis needs no figure
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

T = TypeVar("T", Contribution, ContributionPart)

PERCENT = 100.0

NAMES = {"tolerances": "tolerances", "model_form": "model form", "residual": "residual"}
"""Parts that are no cause."""

NO_ENERGY = {
    "sensor": "costs no energy: it changes what is read",
    "entry": "costs no energy: it changes a stated number, not the rig",
}
"""What is said of a cause that does not cost energy, by its kind."""


def load_costs(found: ModelDiagnosis, metric: str | None) -> list[Contribution]:
    """The split of an efficiency at every load, from the largest resistance to the smallest: means of its runs [%, points].

    The errors of runs of one load are mostly the same, so the bounds of a part are means too.
    """
    runs = loaded_part(found.contributions, metric)
    loads = sorted({run.load for run in runs if run.load is not None}, reverse=True)
    return [_mean_costs([run for run in runs if run.load == load]) for load in loads]


def _mean_costs(runs: Sequence[Contribution]) -> Contribution:
    parts = tuple(_mean(alike, "value", "low", "high") for alike in zip(*(run.parts for run in runs), strict=True))
    return msgspec.structs.replace(_mean(runs, "as_given", "measured"), parts=parts)


def _mean(alike: Sequence[T], *fields: str) -> T:
    """The first of some contributions or parts with the means of some fields, in percent."""
    means = {name: PERCENT * sum(getattr(one, name) for one in alike) / len(alike) for name in fields}
    return msgspec.structs.replace(alike[0], **means)


def part_name(found: ModelDiagnosis, part: ContributionPart) -> str:
    """Plain name of a part."""
    return NAMES[part.kind] if part.effect is None else found.suspects[part.effect].label


def points_words(value: float, decimals: int = 2) -> str:
    """A part in points of efficiency, with its sign."""
    text = number(value, decimals)
    return NumberText(f"+{text}", value) if value > 0.0 and float(text) else text


# ------------------------------------------------------------------------------------------------------------- sentences
def cost_words(found: ModelDiagnosis) -> str:
    """What the causes cost at the load at which model and run differ most."""
    metric = leading_metric(found.contributions)
    table = load_costs(found, metric)
    if not found.causes or not table:
        return ""
    worst = max(table, key=lambda costs: abs(costs.measured - costs.as_given))
    parts = ", ".join(f"{part_name(found, part)} {points_words(part.value, 1)}" for part in worst.parts)
    text = (
        f"At {load_words(worst.load)} {SYMBOL[worst.metric]} is {number(worst.measured, 1)} % ({word_of(found)}) and "
        f"{number(worst.as_given, 1)} % by {given_words(found)}. The difference in points: {parts}."
    )
    return f"{text} {no_energy_words(found)}".rstrip()


def cost_title(found: ModelDiagnosis) -> str:
    """What the table of the terminal shows."""
    metric = leading_metric(found.contributions)
    value = "as measured" if word_of(found) == "measured" else "of the log"
    return f"{metric} by {given_words(found)} and {value} in %, the difference in points"


def given_words(found: ModelDiagnosis) -> str:
    """What the parts begin from."""
    return "your simulation" if has_own_simulation(found) else "the model of the rig file"


def given_head(found: ModelDiagnosis) -> str:
    """What the parts begin from, as a head of a column."""
    return "your simulation" if has_own_simulation(found) else "nominal"


def goal_words(found: ModelDiagnosis) -> str:
    """What the parts lead to: the measured value, or that of a log of which it is not stated whether it is measured."""
    return "the measured value" if word_of(found) == "measured" else "the value of the log"


def no_energy_words(found: ModelDiagnosis) -> str:
    """Which causes cost no energy."""
    return " ".join(
        f"{found.suspects[cause.effect].label} {what}."
        for kind, what in NO_ENERGY.items()
        for cause in found.causes
        if cause.stage == kind
    )


# -------------------------------------------------------------------------------------------------------------- terminal
HEAD = 10
"""Width to which the head of a column is broken. [characters]"""


def cost_lines(found: ModelDiagnosis, width: int) -> list[str]:
    """The split of the leading efficiency by load as plain text; the smallest causes are summed where it gets too wide.

    Parameters
    ----------
    width : of a line at most [characters]
    """
    table = load_costs(found, leading_metric(found.contributions))
    if not table:
        return []
    for shown in range(len(found.causes), -1, -1):
        heads, rows = _cost_rows(found, table, shown)
        lines = aligned_lines(rows)
        if max(map(len, lines)) <= width:
            return lines
    return table_lines(rows, heads=heads, omit=("tolerances", "model form"))


def _cost_rows(
    found: ModelDiagnosis, table: Sequence[Contribution], shown: int
) -> tuple[list[str], list[Sequence[str]]]:
    """Heads, and rows of loads below broken heads, with columns for some of the causes."""
    count = len(found.causes)
    heads = [found.suspects[cause.effect].label for cause in found.causes[:shown]]
    heads += ["other causes"] if shown < count else []
    heads = ["load", given_head(found), *heads, *(NAMES[part.kind] for part in table[0].parts[count:]), word_of(found)]
    rows = []
    for costs in table:
        values = [part.value for part in costs.parts]
        own = [*values[:shown], *([sum(values[shown:count])] if shown < count else []), *values[count:]]
        rows.append(
            [
                load_words(costs.load, "ohm"),
                number(costs.as_given, 2),
                *map(points_words, own),
                number(costs.measured, 2),
            ]
        )
    broken = [textwrap.wrap(head, HEAD, break_long_words=False, break_on_hyphens=False) for head in heads]
    depth = max(map(len, broken))
    above = [["" if k < depth - len(head) else head[k - depth + len(head)] for head in broken] for k in range(depth)]
    return heads, [*above, *rows]


def cost_section(found: ModelDiagnosis) -> content.Section:
    """The waterfalls of all loads, unless the head of the report shows them, and a table of each efficiency; without blocks
    where no run has an efficiency.
    """
    return content.section(
        "costs", "What each cause costs",
        content.picture(
            waterfall_figure(found) if len(waterfall_costs(found)) > COLUMNS else None, "waterfall",
            _waterfall_words(found),
            "Bars from one level to the next; the values are in the table.",
        ),
        *cost_tables(found),
    )  # fmt: skip


def cost_tables(found: ModelDiagnosis) -> list[content.Table | None]:
    """The split of every efficiency by load."""
    tables = ((metric, load_costs(found, metric)) for metric in EFFICIENCIES)
    return [_cost_table_of(found, metric, table) for metric, table in tables if table]


def _cost_table_of(found: ModelDiagnosis, metric: str, table: Sequence[Contribution]) -> content.Table | None:
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
    return content.formatted_table(
        f"costs-{metric.replace('_', '-')}",
        f"{SYMBOL[metric]}: from {given_words(found)} to {goal_words(found)}, in points of efficiency (±: 95 %).",
        (
            text_column("Part"),
            text_column("Kind"),
            *(number_column(load_words(costs.load)) for costs in table),
        ),
        [ends[0], *rows, ends[1]],
        f"{no_energy_words(found)} {ABOUT}".strip(),
    )


ABOUT = (
    "A cause contributes what it adds to a simulation, averaged over all orders in which the causes may be added. Tolerances: "
    "numbers and sensors of the rig as the fit moved them within their tolerances. The parts add up to the difference."
)


def _beside(part: ContributionPart) -> str:
    """A part with half its interval."""
    return NumberText(
        f"{points_words(part.value)} ± {number(0.5 * (part.high - part.low), 2)}", part.value, part.low, part.high
    )


COLUMNS = 3
"""Panels of the waterfall figure side by side."""

MAX_LOADS = 9
"""Loads in the waterfall figure at most; all are in the table."""

BAR = 0.165
"""Height of a bar with its margin. [in]"""


def _waterfall_words(found: ModelDiagnosis) -> str:
    metric = leading_metric(found.contributions)
    return (
        f"{'' if metric is None else SYMBOL[metric]} from {given_words(found)} to {goal_words(found)}, cause by cause, at each "
        "load. Orange: a cause that costs efficiency; blue: one that adds some; purple: a sensor, which costs no energy; "
        "yellow: a wrong entry; grey: tolerances and residual. Black lines: 95 %."
    )


LEAD = 2.35
"""Height of the waterfalls at the head of a report at most: verdict, tiles and they share the first screen. [in]"""


def lead_picture(found: ModelDiagnosis) -> content.Picture | None:
    """The waterfalls of up to three loads, from the largest to the smallest, in one row for the head of a report."""
    table = waterfall_costs(found)
    bar = min(BAR, (LEAD - 0.75) / (len(table[0].parts) + 2)) if table else BAR
    chosen = sorted({0, len(table) // 2, len(table) - 1}) if len(table) > COLUMNS else range(len(table))
    return content.picture(
        _waterfalls(found, [table[k] for k in chosen], bar), "lead",
        _waterfall_words(found)
        + (" All loads are in the section on what each cause costs." if len(table) > COLUMNS else "")
        if table
        else "",
        "Bars from one level to the next; the values are in the tables of what each cause costs.",
    )  # fmt: skip


def waterfall_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw an efficiency from the model of the rig file to that of the runs, cause by cause, a panel for each load."""
    return _waterfalls(found, waterfall_costs(found), BAR)


def _waterfalls(found: ModelDiagnosis, table: Sequence[Contribution], bar: float) -> Figure | None:
    from winchcascade.report.style import Margins, panel_figure

    if not table:
        return None
    bars, lines = len(table[0].parts) + 2, -(-len(table) // COLUMNS)
    height = lines * (bars * bar + 0.5) + 0.25
    gaps = {"wspace": 0.08, "hspace": 0.5 / (bars * bar)}
    figure, panels = panel_figure(height, lines, COLUMNS, margins=Margins(left=0.2, head=0.24), gaps=gaps, share="y")
    draw_waterfalls(panels, found, table)
    for k, ax in enumerate(panels):
        ax.set_visible(k < len(table))
        if k + COLUMNS < len(table):
            ax.set_xlabel("")
    return figure


def waterfall_costs(found: ModelDiagnosis) -> list[Contribution]:
    """The split of the leading efficiency at the loads that are drawn."""
    return load_costs(found, leading_metric(found.contributions))[:MAX_LOADS]


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
    """Smallest and largest efficiency that a waterfall passes. [%]"""
    levels = [costs.measured, *accumulate((part.value for part in costs.parts), initial=costs.as_given)]
    return min(levels), max(levels)


def _waterfall(ax: Axes, costs: Contribution, span: float) -> None:
    """Draw the waterfall of one load, from above; all panels have the same scale.

    Parameters
    ----------
    span : of the widest waterfall [points]
    """
    from matplotlib.ticker import MaxNLocator

    from winchcascade.report.style import COLOURS

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
        ax.text(right, place, f" {points_words(part.value, 1)}", va="center", ha="left", fontsize=6.8)
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
