"""Results in Python: tables as frames, plots on your own Axes or new ones, summaries for notebooks, and report files.

What a result has is registered for its class: `tables_of`, `plots_of`, `summary_of` and `report_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial, singledispatch
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn

import numpy as np

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.arguments import FLAG, PATH, check_arguments
from winchcascade.core.errors import OptionError, check_choice, check_type
from winchcascade.core.extras import require
from winchcascade.core.run import Run
from winchcascade.core.viewed import LateModule, Units
from winchcascade.diagnosis.calibrate import Calibration
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.reduction.campaign_record import CampaignReduction, runs_by_load
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report import frames
from winchcascade.rig.simulate import Simulation
from winchcascade.tables.audit import Audit
from winchcascade.tables.check import Check

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib import axes

    from winchcascade.report import content
else:
    pd, axes = LateModule("pandas"), LateModule("matplotlib.axes")

Tables = Mapping[str, Callable[[], "pd.DataFrame"]]
"""What makes the tables of a result, by their names; the first is the main one."""


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


Plots = Mapping[str, Plot]
"""The plots of a result, by their names; the first is the main one."""


def frame(result: object, table: str = "", units: Units = "si") -> pd.DataFrame:
    """One table of a result as a frame, with the names and units of the written files; the first one if none is named.

    Raises
    ------
    OptionError : the result has no such table
    """
    if units not in ("si", "display"):
        raise OptionError(f"to_pandas(units={units!r}): no such units; expected 'si' or 'display'.")
    tables = tables_of(result, units)
    table = table if table != "" else next(iter(tables))
    check_choice("to_pandas", table, list(tables), "table")
    return tables[table]()


def plot(result: object, what: str = "", ax: axes.Axes | None = None) -> Any:
    """Draw one plot of a result, the first one if none is named; gives the Axes, of a plot with several an array of them, (n,).

    Parameters
    ----------
    ax : what is drawn on, and the most telling part of a plot with several Axes alone; new ones of pyplot if not given

    Raises
    ------
    OptionError : the result has no such plot, or nothing to draw
    """
    plots = plots_of(result)
    what = what if what != "" else next(iter(plots))
    check_choice("plot", what, list(plots), "plot of this result")
    made = plots[what]
    if made.lacks:
        raise OptionError(f"plot({what!r}): the result has nothing to draw; expected {made.lacks}.")
    return _drawn(made, ax)


def summary_html(result: object) -> str:
    """The heading and the main table of a result as HTML without scripts; every text is escaped."""
    from winchcascade.report.render.page import table_html

    return table_html(*summary_of(result))


def write_report(result: object, path: str | Path, *, force: bool = False) -> Path:
    """Write the report of a result of any command as a page (.html) or a PDF (.pdf).

    Parameters
    ----------
    force : replace a file that this tool did not write

    Raises
    ------
    OptionError : another ending, or a result that has no report
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    from winchcascade.report.render.publish import publish

    check_arguments("write_report", ("path", path, PATH), ("force", force, FLAG))
    path = Path(path)
    ending = path.suffix.casefold()
    if ending not in (".html", ".pdf"):
        raise OptionError(f"{path}: no ending of a report; expected a name that ends in .html or .pdf.")
    if ending == ".pdf":
        require("typst", str(path))
    report = report_of(result)
    publish(report, html=path if ending == ".html" else None, pdf=path if ending == ".pdf" else None, force=force)
    return path


def _refuse(call: str, result: object) -> NoReturn:
    """Report that a result of another kind is needed: OptionError."""
    what = {"write_report": "report", "summary_html": "summary"}.get(call, call)
    raise OptionError(
        f"{call}: {type(result).__name__} has no {what}; expected the result of reduce, compare, calibrate, simulate, audit, "
        "or of open_campaign(...).reduce(), .diagnose() or .check()."
    )


# ------------------------------------------------------------------------------------------------------------------- tables
@singledispatch
def tables_of(result: object, units: Units) -> Tables:  # noqa: ARG001
    """Tables of a result as frames."""
    _refuse("frame", result)


@tables_of.register(Run)
def _(result: Run, units: Units) -> Tables:
    return {"channels": partial(frames.run_frame, result, units)}


@tables_of.register(Reduction)
def _(result: Reduction, units: Units) -> Tables:
    made = {name: partial(frames.reduction_frame, result, name, units) for name in ("cycles", "bins", "findings")}
    return {**made, "channels": partial(frames.samples_frame, result, units)}


@tables_of.register(CampaignReduction)
def _(result: CampaignReduction, units: Units) -> Tables:
    names = ("runs", "cycles", "bins", "findings")
    return {name: partial(frames.campaign_frame, result, name, units) for name in names}


@tables_of.register(DiagnosisResult)
def _(result: DiagnosisResult, units: Units) -> Tables:
    names = ("causes", "contributions", "map", "stability")
    return {name: partial(frames.diagnosis_frame, result, name, units) for name in names}


@tables_of.register(Comparison)
def _(result: Comparison, units: Units) -> Tables:
    return {"differences": partial(frames.comparison_frame, result, units)}


# -------------------------------------------------------------------------------------------------------------------- plots
@singledispatch
def plots_of(result: object) -> Plots:
    """Plots of a result; one with several Axes draws its most telling part on a single one."""
    _refuse("plot", result)


def _single(draw: Callable[..., object], *drawn: object, lacks: str = "", height: float = 2.9) -> Plot:
    """A plot on one Axes by a function of these and of what is `drawn`."""
    return Plot(lambda axes: draw(axes[0], *drawn), lacks, height=height)


@plots_of.register(Reduction)
def _(result: Reduction) -> Plots:
    """Powers of one cycle, histories of the log, powers over generator speed, efficiencies of the cycles."""
    from winchcascade.report.figures import histories
    from winchcascade.report.figures import reduction_figures as figures

    powers, ratios = histories.powers_of(result), figures.known_ratios(result)
    history = histories.log_history(result)
    rows = len(history.panels)
    lacks = {
        "power": "" if powers and result.cycles else "a cycle and a power",
        "speed": "" if result.bins else "the speed of the generator in a complete cycle",
        "efficiency": "" if ratios and result.complete else "an efficiency of a complete cycle",
    }
    return {
        "power": _single(figures.draw_one_cycle, result, powers, lacks=lacks["power"]),
        "history": Plot(lambda axes: histories.draw_history(axes, history), "", rows, 2.9 if rows == 1 else 1.2, "x"),
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
    """Mean powers or efficiencies of the runs over their loads, power at the DC link over generator speed."""
    from winchcascade.report.figures import campaign_figures as figures

    reduced = result.summary.reduced
    runs = [run for run in runs_by_load(reduced) if not run.open_circuit] or reduced
    bins = {name: found for name, found in result.bins.items() if found}
    lacks = "" if runs else "a run that could be reduced"
    made = {what: _single(figures.draw_over_load, runs, what, lacks=lacks) for what in ("power", "efficiency")}
    without = lacks or ("" if bins else "the speed of the generator in a run")
    return {**made, "speed": _single(figures.draw_power_over_speed, runs, bins, lacks=without)}


@plots_of.register(DiagnosisResult)
def _(result: DiagnosisResult) -> Plots:
    """The map of the gap (without a model by phase alone), or, of a model, what each cause costs of an efficiency, by load."""
    from winchcascade.report.figures.diagnosis_figures import draw_gap_map

    height = 0.6 + 0.235 * len({(place.channel, place.phase) for place in result.places})
    lacks = "" if result.places else "a place with a gap that can be weighed"
    return {"map": _single(draw_gap_map, result, lacks=lacks, height=height), "waterfall": _waterfalls(result)}


def _waterfalls(found: DiagnosisResult) -> Plot:
    """What each cause costs, by load, on one Axes of the largest difference alone."""
    from winchcascade.diagnosis.figure_data import load_costs, worst_costs
    from winchcascade.report.diagnosis_names import word_of
    from winchcascade.report.figures.cause_figures import BAR, draw_waterfalls

    if not isinstance(found, ModelDiagnosis):
        return Plot(list, "a model that splits an efficiency by its causes, of a rig file with all numbers of the rig")
    largest = worst_costs(found)
    if largest is None:
        return Plot(list, "a split of an efficiency at a load")
    costs = load_costs(found, largest.metric)

    def draw(axes: list[axes.Axes]) -> None:
        draw_waterfalls(axes, found, [largest] if len(axes) == 1 else costs, word_of(found))

    return Plot(draw, "", len(costs), 0.6 + BAR * (len(costs[0].parts) + 2), "y")


@plots_of.register(Comparison)
def _(result: Comparison) -> Plots:
    """Differences of the efficiencies with their 95 % intervals, run by run; on one Axes that of the whole cascade."""
    from winchcascade.report.figures.comparison_figures import draw_differences
    from winchcascade.report.results.comparison import by_metric, rows_of

    metrics = list(by_metric(rows_of(result, "eta", whole=False)))
    whole = [name for name in metrics if name == result.overall] or metrics[:1]
    lacks = "" if metrics else "an efficiency that both sides have"

    def draw(axes: list[axes.Axes]) -> None:
        draw_differences(axes, result, whole if len(axes) == 1 else metrics)

    return {"efficiency": Plot(draw, lacks, len(metrics), 1.5, "x")}


def _drawn(made: Plot, ax: axes.Axes | None) -> Any:
    """Draw on the given Axes, or on new ones of a figure of pyplot, which notebooks show."""
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


# ---------------------------------------------------------------------------------------------------------------- summaries
@singledispatch
def summary_of(result: object) -> tuple[str, content.Table[Any] | None]:
    """Heading and main table of a result."""
    _refuse("summary_html", result)


@summary_of.register(Reduction)
def _(result: Reduction) -> tuple[str, content.Table[Any] | None]:
    from winchcascade.report.results.reduction_tables import cycles_table

    return repr(result), cycles_table(result, uncertainty(result))


@summary_of.register(CampaignReduction)
def _(result: CampaignReduction) -> tuple[str, content.Table[Any] | None]:
    from winchcascade.report.results.campaign_tables import budget_table

    return repr(result), budget_table(runs_by_load(result.summary.reduced), linked=False)


@summary_of.register(DiagnosisResult)
def _(result: DiagnosisResult) -> tuple[str, content.Table[Any] | None]:
    from winchcascade.report.results.diagnosis_parts import causes_table

    return f"Diagnosis of {result.title}: {result.verdict.replace('_', ' ')}", causes_table(result)


@summary_of.register(Comparison)
def _(result: Comparison) -> tuple[str, content.Table[Any] | None]:
    from winchcascade.report.results.comparison import differences_table, rows_of

    heading = f"{result.b.name} minus {result.a.name}: {len(result.runs)} runs"
    return heading, differences_table("efficiencies", rows_of(result, "eta"))


# ------------------------------------------------------------------------------------------------------------------ reports
@singledispatch
def report_of(result: object, *, command: str = "") -> content.Report:  # noqa: ARG001
    """Make the report of a result.

    Parameters
    ----------
    command : as it was given, to be given again
    """
    _refuse("write_report", result)


def _late(name: str) -> Callable[..., content.Report]:
    """A function of `results`, which is imported with all that it draws by when it is called."""

    def called(result: object, *, command: str = "") -> content.Report:
        report: content.Report = resolve_name(f"winchcascade.report.results.{name}")(result, command=command)
        return report

    return called


for _kind, _name in {
    Audit: "audits:audit_report",
    Calibration: "calibration:drawn_calibration",
    CampaignReduction: "drawn_campaign:reduced_campaign",
    Check: "checks:check_report",
    Comparison: "comparison:comparison_report",
    DiagnosisResult: "diagnosis:diagnosis_report",
    Reduction: "drawn_reduction:drawn_report",
    Simulation: "simulation:simulation_report",
}.items():
    report_of.register(_kind, _late(_name))
