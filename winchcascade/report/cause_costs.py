"""What each cause costs in efficiency, load by load, as numbers, sentences and a table for the terminal."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, NamedTuple

from winchcascade.diagnosis.contributions import leading_metric, loaded_part
from winchcascade.report.diagnosis_names import load_words
from winchcascade.report.diagnosis_words import word_of
from winchcascade.report.digits import number
from winchcascade.report.own_simulation_words import has_own_simulation
from winchcascade.report.text_table import table_lines

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import ContributionKind, ContributionPart

PERCENT = 100.0

NAMES = {"tolerances": "tolerances", "model_form": "model form", "residual": "residual"}
"""Parts that are no cause."""

NO_ENERGY = {
    "sensor": "costs no energy: it changes what is read",
    "entry": "costs no energy: the rig or the run is another one than is stated",
}
"""What is said of a cause that does not cost energy, by its kind."""


class LoadCosts(NamedTuple):
    """An efficiency at one load as the mean of its runs: by the rig as given, as measured, and its parts. [%, points]"""

    load: float
    as_given: float
    measured: float
    parts: tuple[LoadPart, ...]


class LoadPart(NamedTuple):
    """A part of a difference of efficiency: its effect, None for what is no cause, and its value with 95 % bounds. [points]"""

    effect: str | None
    kind: ContributionKind
    value: float
    low: float
    high: float


def load_costs(found: ModelDiagnosis, metric: str | None) -> list[LoadCosts]:
    """The split of an efficiency at every load, from the largest resistance to the smallest."""
    runs = loaded_part(found.contributions, metric)
    table = []
    for load in sorted({run.load for run in runs if run.load is not None}, reverse=True):
        own = [run for run in runs if run.load == load]
        parts = [_mean_part(alike) for alike in zip(*(run.parts for run in own), strict=True)]
        table.append(
            LoadCosts(load, _mean([run.as_given for run in own]), _mean([run.measured for run in own]), tuple(parts))
        )
    return table


def _mean(values: Sequence[float]) -> float:
    """Mean of efficiencies, in percent."""
    return PERCENT * sum(values) / len(values)


def _mean_part(parts: Sequence[ContributionPart]) -> LoadPart:
    """Mean of the same part of several runs: their errors are mostly the same, so the bounds are means too."""
    value, low, high = (_mean([getattr(part, name) for part in parts]) for name in ("value", "low", "high"))
    return LoadPart(parts[0].effect, parts[0].kind, value, low, high)


def part_name(found: ModelDiagnosis, part: LoadPart) -> str:
    """Plain name of a part."""
    return NAMES[part.kind] if part.effect is None else found.suspects[part.effect].label


def points_words(value: float, decimals: int = 2) -> str:
    """A part in points of efficiency, with its sign."""
    text = number(value, decimals)
    return f"+{text}" if value > 0.0 and float(text) else text


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
        f"At {load_words(worst.load)} {metric} is {number(worst.measured, 1)} % ({word_of(found)}) and "
        f"{number(worst.as_given, 1)} % by {given_words(found)}. The difference in points: {parts}."
    )
    return f"{text} {no_energy_words(found)}".rstrip()


def cost_title(found: ModelDiagnosis) -> str:
    """What the table of the terminal shows."""
    metric = leading_metric(found.contributions)
    value = "as measured" if word_of(found) == "measured" else "of the log"
    return f"{metric} by {given_words(found)} and {value} in %, parts of the difference in points"


def given_words(found: ModelDiagnosis) -> str:
    """What the parts begin from."""
    return "your simulation" if has_own_simulation(found) else "the rig as given"


def given_head(found: ModelDiagnosis) -> str:
    """What the parts begin from, as a head of a column."""
    return "your simulation" if has_own_simulation(found) else "as given"


def goal_words(found: ModelDiagnosis) -> str:
    """What the parts lead to: the measured value, or that of a log of which it is not stated whether it is measured."""
    return "the measured value" if word_of(found) == "measured" else "the value of the log"


def no_energy_words(found: ModelDiagnosis) -> str:
    """Which causes cost no energy."""
    sentences = []
    for kind, what in NO_ENERGY.items():
        names = [found.suspects[cause.effect].label for cause in found.causes if cause.stage == kind]
        sentences += [f"{name} {what}." for name in names]
    return " ".join(sentences)


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
        lines = _cost_table(found, table, shown)
        if max(map(len, lines)) <= width:
            break
    return lines


def _cost_table(found: ModelDiagnosis, table: Sequence[LoadCosts], shown: int) -> list[str]:
    """Rows of loads, with columns for so many of the causes."""
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
    return table_lines([*above, *rows])
