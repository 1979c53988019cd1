"""Plots of results: what each class has to draw, and how it is drawn on the Axes of the caller
or on new ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial, singledispatch
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.errors import check_type, reject_result
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run
from winchcascade.core.viewed import LateModule
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.campaign_record import CampaignReduction, runs_by_load
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.rig.simulate import Simulation

if TYPE_CHECKING:
    from matplotlib import axes

    from winchcascade.report.figures.histories import History
else:
    axes = LateModule("matplotlib.axes")


class Plot(NamedTuple):
    """A plot: what draws it on its Axes, and what the result `lacks` for it, empty for nothing.

    Parameters
    ----------
    rows : number of Axes
    height : of each [in]
    share : axis that the rows have in common
    """

    draw: Callable[[list[axes.Axes]], object]
    lacks: str = ""
    rows: int = 1
    height: float = 2.9
    share: Literal["x", "y", ""] = ""


GROUPS = {
    "motion": ("displacement", "velocity", "speed"),
    "mechanical": ("force", "torque", "power_mech"),
    "hydraulic": ("pressure", "flow"),
    "electrical": ("vdc", "idc", "power_ac"),
}
"""Channels of a run that are drawn together."""

Plots = Mapping[str, Plot]
"""The plots of a result, by their names; the first is the main one."""


@singledispatch
def plots_of(result: object) -> Plots:
    """Plots of a result; one with several Axes draws its most telling part on a single one."""
    reject_result("plot", "plot", result, plots_of.registry)


def _single(
    draw: Callable[..., object], *drawn: object, lacks: str = "", height: float = 2.9
) -> Plot:
    """A plot on one Axes by a function of these and of what is `drawn`."""
    return Plot(lambda axes: draw(axes[0], *drawn), lacks, height=height)


def _history(rows: int, make: Callable[[], History]) -> Plot:
    """Panels of a history one below the other, as many as rows; the history is made when it is
    drawn.
    """
    from winchcascade.report.figures.histories import draw_history

    return Plot(lambda axes: draw_history(axes, make()), "", rows, 2.9 if rows == 1 else 1.2, "x")


@plots_of.register(Run)
def _(result: Run) -> Plots:
    """Histories of all channels, of those of a group, and of each channel."""
    from winchcascade.report.figures.histories import channels_drawn, run_history

    known = [name for name, *_ in channels_drawn(result, given_rig("plot", None, result.rig))]
    groups = {group: [name for name in names if name in known] for group, names in GROUPS.items()}
    drawn = {"history": known, **groups, **{name: [name] for name in known}}
    return {
        what: _history(len(names), partial(run_history, result, names))
        for what, names in drawn.items()
        if names
    }


@plots_of.register(Simulation)
def _(result: Simulation) -> Plots:
    """Histories of what the sensors give."""
    return plots_of(result.run)


@plots_of.register(Reduction)
def _(result: Reduction) -> Plots:
    """Powers of one cycle, histories of the log, powers over generator speed, efficiencies of
    the cycles.
    """
    from winchcascade.report.figures import histories
    from winchcascade.report.figures import reduction_figures as figures

    powers, ratios = histories.powers_of(result), figures.known_ratios(result)
    history = histories.log_history(result)
    lacks = {
        "power": "" if powers and result.cycles else "a cycle and a power",
        "speed": "" if result.bins else "the speed of the generator in a complete cycle",
        "efficiency": "" if ratios and result.complete else "an efficiency of a complete cycle",
    }
    return {
        "power": _single(figures.draw_one_cycle, result, powers, lacks=lacks["power"]),
        "history": _history(len(history.panels), lambda: history),
        "speed": _single(figures.draw_over_speed, result, powers, lacks=lacks["speed"]),
        "efficiency": _single(_draw_efficiencies, result, ratios, lacks=lacks["efficiency"]),
    }


def _draw_efficiencies(ax: axes.Axes, reduction: Reduction, ratios: Sequence[str]) -> None:
    from matplotlib.ticker import MaxNLocator

    from winchcascade.report.figures import reduction_figures as figures

    figures.draw_trend(ax, reduction, ratios, "1")
    ax.set(xlabel="Cycle", ylabel="Efficiency (1)")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


@plots_of.register(CampaignReduction)
def _(result: CampaignReduction) -> Plots:
    """Mean powers or efficiencies of the runs over their loads."""
    from winchcascade.report.figures import campaign_figures as figures

    reduced = result.summary.reduced
    runs = [run for run in runs_by_load(reduced) if not run.open_circuit] or reduced
    lacks = "" if runs else "a run that could be reduced"
    return {
        what: _single(figures.draw_over_load, runs, what, lacks=lacks)
        for what in ("power", "efficiency")
    }


@plots_of.register(DiagnosisResult)
def _(result: DiagnosisResult) -> Plots:
    """The map of the gap (without a model by phase alone), or, of a model, what each cause costs
    of an efficiency, by load.
    """
    from winchcascade.report.figures.diagnosis_figures import draw_gap_map

    height = 0.6 + 0.235 * len({(place.channel, place.phase) for place in result.places})
    lacks = "" if result.places else "a place with a gap that can be weighed"
    return {
        "map": _single(draw_gap_map, result, lacks=lacks, height=height),
        "waterfall": _waterfalls(result),
    }


def _waterfalls(found: DiagnosisResult) -> Plot:
    """What each cause costs, by load, on one Axes of the largest difference alone."""
    from winchcascade.diagnosis.explain.figure_data import load_costs, worst_costs
    from winchcascade.report.diagnosis_names import word_of
    from winchcascade.report.figures.cause_figures import BAR, draw_waterfalls

    if not isinstance(found, ModelDiagnosis):
        return Plot(
            list,
            "a model that splits an efficiency by its causes, of a rig file with all numbers of "
            "the rig",
        )
    largest = worst_costs(found)
    if largest is None:
        return Plot(list, "a split of an efficiency at a load")
    costs = load_costs(found, largest.metric)

    def draw(axes: list[axes.Axes]) -> None:
        draw_waterfalls(axes, found, [largest] if len(axes) == 1 else costs, word_of(found))

    return Plot(draw, "", len(costs), 0.6 + BAR * (len(costs[0].parts) + 2), "y")


@plots_of.register(Comparison)
def _(result: Comparison) -> Plots:
    """Differences of the efficiencies with their 95 % intervals, run by run; on one Axes that of
    the whole cascade.
    """
    from winchcascade.report.results.comparison import by_metric, draw_differences, rows_of

    metrics = list(by_metric(rows_of(result, "eta", whole=False)))
    whole = [name for name in metrics if name == result.overall] or metrics[:1]
    lacks = "" if metrics else "an efficiency that both sides have"

    def draw(axes: list[axes.Axes]) -> None:
        draw_differences(axes, result, whole if len(axes) == 1 else metrics)

    return {"efficiency": Plot(draw, lacks, len(metrics), 1.5, "x")}


def draw(made: Plot, ax: axes.Axes | None) -> Any:
    """Draw on the given Axes, or on new ones of pyplot, which notebooks show; gives the Axes, of
    several an array.
    """
    from winchcascade.report.figures.style import COLOURS, WIDTH, house_style

    with house_style():
        if ax is None:
            import matplotlib.pyplot as plt

            _, grid = plt.subplots(
                made.rows, 1, figsize=(WIDTH, made.height * made.rows), squeeze=False, layout="constrained",
                facecolor=COLOURS["paper"], sharex="col" if made.share == "x" else False,
                sharey="col" if made.share == "y" else False,
            )  # fmt: skip
            found = grid[:, 0]
        else:
            check_type("plot, ax", ax, axes.Axes, "matplotlib")
            found = np.array([ax], dtype=object)
        made.draw(found.tolist())
        title = found[0].get_title(loc="left")
        if len(found) == 1 and title.startswith("("):  # the letter of a panel among others
            found[0].set_title(title.partition(") ")[2], loc="left", pad=3)
    return found[0] if len(found) == 1 else found
