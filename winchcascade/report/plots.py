"""Results in a notebook: plots on axes of your own or on new ones, and summaries as HTML, both made as in the reports."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.errors import OptionError, check_choice, check_type
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.campaign_reduction import CampaignReduction
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.figures.style import COLOURS, WIDTH, house_style
from winchcascade.report.publish import table_html

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

Plot = Callable[[Any], object]
"""What draws on one Axes, or on an array of them."""

Share = Literal["col", False]
"""Whether the rows of a figure have an axis in common."""


def plot_reduction(reduction: Reduction, what: str, ax: Axes | None = None) -> Axes | NDArray[np.object_]:
    """Plot powers of one cycle, histories of the log, powers over generator speed, or efficiencies of the cycles.

    Returns
    -------
    the Axes; of the histories an array of them, (n,), if none was given: with one given, the powers alone are drawn
    """
    from winchcascade.report.figures import histories
    from winchcascade.report.figures import reduction_figures as figures

    check_choice("plot", what, ("power", "history", "speed", "efficiency"), "plot of this result")
    powers = histories.powers_of(reduction)
    if what == "history":
        panels = histories.panels_of(reduction, powers)
        shown = panels if ax is None else panels[-1:]
        draw: Plot = lambda axes: histories.draw_histories(np.ravel(axes).tolist(), reduction, shown)  # noqa: E731
        return _drawn(draw, ax, rows=len(shown), height=2.9 if len(shown) == 1 else 1.2, sharex="col")
    efficient = bool(figures.known_ratios(reduction) and reduction.complete)
    plots: dict[str, tuple[Callable[[Any], object], bool, str]] = {
        "power": (
            lambda one: figures.draw_one_cycle(one, reduction, powers),
            bool(powers and reduction.cycles),
            "a cycle and a power",
        ),
        "speed": (
            lambda one: figures.draw_over_speed(one, reduction, powers),
            bool(reduction.bins),
            "the speed of the generator in a complete cycle",
        ),
        "efficiency": (
            lambda one: _efficiencies(one, reduction),
            efficient,
            "an efficiency of a complete cycle",
        ),
    }
    draw, given, needed = plots[what]
    _require(what, "" if given else needed)
    return _drawn(draw, ax)


def _efficiencies(ax: Axes, reduction: Reduction) -> None:
    """Draw the efficiencies of the complete cycles."""
    from matplotlib.ticker import MaxNLocator

    from winchcascade.report.figures import reduction_figures as figures

    figures.draw_trend(ax, reduction, figures.known_ratios(reduction), "1")
    ax.set(xlabel="Cycle", ylabel="Efficiency (1)")
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))


def plot_campaign(campaign: CampaignReduction, what: str, ax: Axes | None = None) -> Axes | NDArray[np.object_]:
    """Plot mean powers or efficiencies of the runs over their loads, or the power at the DC link over generator speed."""
    from winchcascade.reduction.campaign_record import runs_by_load
    from winchcascade.report.figures import campaign_figures as figures

    check_choice("plot", what, ("power", "efficiency", "speed"), "plot of this result")
    runs = [run for run in runs_by_load(campaign.summary.reduced) if not run.open_circuit] or campaign.summary.reduced
    _require(what, "" if runs else "a run that could be reduced")
    if what == "speed":
        bins = {name: found for name, found in campaign.bins.items() if found}
        _require(what, "" if bins else "the speed of the generator in a run")
        return _drawn(lambda one: figures.draw_power_over_speed(one, runs, bins), ax)
    return _drawn(lambda one: figures.draw_over_load(one, runs, what), ax)


def plot_diagnosis(found: DiagnosisResult, what: str, ax: Axes | None = None) -> Axes | NDArray[np.object_]:
    """Plot the map of the gap (without a model by phase alone), or, of a model, what each cause costs of an efficiency.

    Returns
    -------
    the Axes; of the costs an array with one for each load, (n,), if none was given: with one given, the load with the largest
    difference alone is drawn
    """
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.load_costs import waterfall_costs
    from winchcascade.report import cause_costs
    from winchcascade.report.diagnosis_figures import draw_gap_map

    check_choice("plot", what, ("map", "waterfall"), "plot of this result")
    if what == "map":
        _require(what, "" if found.places else "a place with a gap that can be weighed")
        rows = len({(place.channel, place.phase) for place in found.places})
        return _drawn(lambda one: draw_gap_map(one, found), ax, height=0.6 + 0.235 * rows)
    if not isinstance(found, ModelDiagnosis):
        raise OptionError(
            f"plot({what!r}): this diagnosis has no model, which could split an efficiency by its causes; expected 'map', or a "
            "rig file with all numbers of the rig."
        )
    costs = waterfall_costs(found)
    _require(what, "" if costs else "a split of an efficiency at a load")
    if ax is not None:
        costs = [max(costs, key=lambda one: abs(one.measured - one.as_given))]
    height = 0.6 + cause_costs.BAR * (len(costs[0].parts) + 2)
    draw: Plot = lambda axes: cause_costs.draw_waterfalls(np.ravel(axes).tolist(), found, costs)  # noqa: E731
    return _drawn(draw, ax, rows=len(costs), height=height, sharey="col")


def plot_comparison(found: Comparison, what: str, ax: Axes | None = None) -> Axes | NDArray[np.object_]:
    """Plot the differences of the efficiencies with their 95 % intervals, run by run.

    Returns
    -------
    the Axes, an array with one for each efficiency, (n,), if none was given: with one given, that of the whole cascade, or else
    the first, alone is drawn
    """
    from winchcascade.report.results.comparison import by_metric, draw_differences, rows_of

    check_choice("plot", what, ("efficiency",), "plot of this result")
    metrics = list(by_metric(rows_of(found, "eta", whole=False)))
    _require(what, "" if metrics else "an efficiency that both sides have")
    if ax is not None:
        metrics = [found.overall if found.overall in metrics else metrics[0]]
    draw: Plot = lambda axes: draw_differences(np.ravel(axes).tolist(), found, metrics)  # noqa: E731
    return _drawn(draw, ax, rows=len(metrics), height=1.5, sharex="col")


def _require(what: str, lacking: str) -> None:
    if lacking:
        raise OptionError(f"plot({what!r}): the result has nothing to draw; expected {lacking}.")


def _drawn(
    draw: Plot, ax: Axes | None, *, rows: int = 1, height: float = 2.9, sharex: Share = False, sharey: Share = False
) -> Axes | NDArray[np.object_]:
    """Draw on the given Axes, or on new ones of a figure of pyplot, which notebooks show.

    Parameters
    ----------
    height : of each row [in]
    sharex, sharey : axes that the rows have in common
    """
    from matplotlib.axes import Axes

    with house_style():
        if ax is None:
            import matplotlib.pyplot as plt

            _, axes = plt.subplots(
                rows, 1, figsize=(WIDTH, height * rows), squeeze=False, layout="constrained",
                facecolor=COLOURS["paper"], sharex=sharex, sharey=sharey,
            )  # fmt: skip
            found = axes[:, 0]
        else:
            check_type("plot, ax", ax, Axes, "matplotlib")
            found = np.array([ax], dtype=object)
        draw(found[0] if rows == 1 else found)
        title = found[0].get_title(loc="left")
        if rows == 1 and title.startswith("("):  # the letter of a panel among others
            found[0].set_title(title.partition(") ")[2], loc="left", pad=3)
    return found[0] if rows == 1 else found


def summary_html(result: Reduction | DiagnosisResult | CampaignReduction | Comparison) -> str:
    """The heading and the main table of a result as HTML without scripts; every text is escaped."""
    from winchcascade.report.render.page import table_html as stated_html

    if isinstance(result, DiagnosisResult):
        from winchcascade.report.results.diagnosis import main_table

        return stated_html(f"Diagnosis of {result.title}: {result.verdict.replace('_', ' ')}", main_table(result))
    if isinstance(result, Comparison):
        from winchcascade.report.results.comparison import differences_table, rows_of

        heading = f"{result.b.name} minus {result.a.name}: {len(result.runs)} runs"
        return stated_html(heading, differences_table("efficiencies", rows_of(result, "eta")))
    if isinstance(result, Reduction):
        from winchcascade.reduction.montecarlo import uncertainty
        from winchcascade.report.results.reduction_tables import cycles_table

        return stated_html(repr(result), cycles_table(result, uncertainty(result)))
    from winchcascade.reduction.campaign_record import runs_by_load
    from winchcascade.report.campaign import logs_efficiencies_table

    return table_html(repr(result), logs_efficiencies_table(runs_by_load(result.summary.reduced)))
