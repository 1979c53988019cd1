"""Results in Python: tables as frames, pictures of their reports, summaries for notebooks, and
report files.

`VIEWS` lists what each kind of result has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any, NamedTuple

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.arguments import FLAG, PATH, check_arguments
from winchcascade.core.errors import OptionError, check_choice, reject_result
from winchcascade.core.files import check_ending
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run
from winchcascade.core.viewed import LateModule
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.diagnosis.handover.calibrate import Calibration
from winchcascade.reduction.campaign_record import CampaignReduction
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report import frames
from winchcascade.report.content import PROVENANCE, Picture, Table
from winchcascade.report.figures.histories import channels_drawn, history_figure, run_history
from winchcascade.report.results.reduction_tables import findings_table
from winchcascade.rig.simulate import Simulation
from winchcascade.sea.sea_study import SeaStudy
from winchcascade.tables.audit import Audit
from winchcascade.tables.check import Check

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from winchcascade.report import content
else:
    pd = LateModule("pandas")

Tables = Mapping[str, Callable[[], "pd.DataFrame"]]
"""What makes the tables of a result, by their names; the first is the main one."""


def frame(result: object, table: str = "") -> pd.DataFrame:
    """One table of a result as a frame, with the names and units of the written files; the first
    one if none is named.

    Raises
    ------
    OptionError : the result has no such table
    """
    tables = tables_of(result)
    table = table if table != "" else next(iter(tables))
    check_choice("to_pandas", table, list(tables), "table")
    return tables[table]()


def plot(result: object, what: str = "") -> Picture:
    """A picture of the report of a result, by its name; the first one that shows something if none
    is named. A notebook shows it, and its `figure` is that of Matplotlib.

    A run has its channels: `history` all of them, those of `GROUPS`, and each by its name.

    Raises
    ------
    OptionError : the result has no such picture, or nothing to draw in it
    """
    names = []
    for one in _pictures_of(result):
        names.append(one.id)
        if what == one.id and one.is_empty:
            raise OptionError(f"plot({what!r}): the result has nothing to draw there.")
        if what == one.id or (what == "" and not one.is_empty):
            return one
    if not names:
        raise OptionError(f"plot: {type(result).__name__} has no pictures.")
    check_choice("plot", what, names, "picture of this result")
    raise OptionError("plot: the result has nothing to draw.")


def _pictures_of(result: object) -> Iterator[Picture]:
    """Pictures of a result, made one after the other."""
    if isinstance(result, Simulation | Run):
        yield from _channels_of(result.run if isinstance(result, Simulation) else result)
        return
    report = report_of(result)
    yield from [] if report.lead is None else [report.lead]
    for one in report.sections:
        yield from (block for block in one.blocks if isinstance(block, Picture))


GROUPS = {
    "motion": ("displacement", "velocity", "speed"),
    "mechanical": ("force", "torque", "power_mech"),
    "hydraulic": ("pressure", "flow"),
    "electrical": ("vdc", "idc", "power_ac"),
}
"""Channels of a run that are drawn together."""


def _channels_of(run: Run) -> Iterator[Picture]:
    """Histories of all channels of a run, of those of a group, and of each channel."""
    known = [name for name, *_ in channels_drawn(run, given_rig("plot", None, run.rig))]
    groups = {group: [name for name in names if name in known] for group, names in GROUPS.items()}
    for what, names in {"history": known, **groups, **{name: [name] for name in known}}.items():
        if names:
            caption = f"Channels of {run.name} over time."
            yield Picture(what, caption, "Lines over time.", partial(_history, run, names))


def _history(run: Run, names: Sequence[str]) -> Figure:
    return history_figure(run_history(run, names))


def summary_html(result: object) -> str:
    """The heading and the main table of a result as HTML without scripts; every text is escaped."""
    from winchcascade.report.render.page import table_html

    return table_html(*_summary(result))


def write_report(result: object, path: str | Path, *, force: bool = False) -> Path:
    """Write the report of a result of any command as a page (.html) or a PDF (.pdf).

    Parameters
    ----------
    force : replace a file that this tool did not write

    Raises
    ------
    OptionError : another ending, or a result that has no report
    OutputError : the file cannot be written, or is not this tool's own and `force` does not allow
        to replace it
    """
    from winchcascade.report.render.report_files import ENDINGS, publish

    check_arguments("write_report", ("path", path, PATH), ("force", force, FLAG))
    path = Path(path)
    check_ending(path, ENDINGS)
    publish(report_of(result), **{path.suffix.casefold()[1:]: path}, force=force)
    return path


# -------------------------------------------------------------------------------------- summaries
def _summary(result: object) -> tuple[str, content.Table[Any] | None]:
    """A result in one line, and the first table of its report that states neither findings nor
    where the data come from; of a run its findings.
    """
    if isinstance(result, Simulation):
        return repr(result), None
    if isinstance(result, Run):
        return repr(result), findings_table(result, result.findings)
    report = report_of(result)
    parts = (one for one in report.sections if one.id not in ("findings", PROVENANCE))
    tables = (block for one in parts for block in one.blocks if isinstance(block, Table))
    return f"{report.kind}: {report.title}", next(tables, None)


# ----------------------------------------------------------------------------- kinds of results
class View(NamedTuple):
    """What a kind of result shows.

    Parameters
    ----------
    report : function of `results` that makes its report, "" for none
    tables : gives what makes its tables
    """

    report: str
    tables: Callable[[Any], Tables]


def _named(frame: Callable[[Any, str], pd.DataFrame], *names: str) -> Callable[[Any], Tables]:
    """Tables that one function makes by their names."""
    return lambda result: {name: partial(frame, result, name) for name in names}


def _listed(record: str, *names: str) -> Callable[[Any], Tables]:
    """Lists of the JSON of a result as tables, those that it has; `record` is the function of
    `results` that makes the JSON.
    """

    def tables(result: object) -> Tables:
        found = _of_results(record)(result)
        return {name: partial(frames.record_frame, found[name]) for name in names if name in found}

    return tables


def _of_results(name: str) -> Callable[..., Any]:
    """A function of `results`, which is imported with all that it draws by when it is called."""
    found: Callable[..., Any] = resolve_name(f"winchcascade.report.results.{name}")
    return found


VIEWS: Mapping[type, View] = {
    Audit: View(
        "audits:audit_report",
        _listed("audit_record:audit_record", "contradictions", "claims", "windows", "column_faults", "laws"),
    ),
    Calibration: View(
        "calibration:calibration_report",
        _listed("calibration:calibration_record", "numbers", "strained"),
    ),
    CampaignReduction: View(
        "campaign:reduced_campaign",
        _named(frames.campaign_frame, "runs", "cycles", "bins", "findings", "runs_all"),
    ),
    Check: View(
        "checks:check_report", _listed("checks:check_record", "cells", "findings")
    ),
    Comparison: View(
        "comparison:comparison_report",
        lambda result: {"differences": partial(frames.comparison_frame, result)},
    ),
    DiagnosisResult: View(
        "diagnosis:diagnosis_report",
        _named(frames.diagnosis_frame, "causes", "contributions", "map", "stability"),
    ),
    Reduction: View(
        "reduction:reduction_report",
        _named(frames.reduction_frame, "cycles", "bins", "findings", "channels"),
    ),
    Run: View("", _named(frames.log_frame, "channels", "findings")),
    SeaStudy: View("sea_report:sea_report", _listed("sea_report:sea_record", "rows")),
    Simulation: View(
        "simulation:simulation_report",
        lambda result: {"channels": partial(frames.simulation_frame, result)},
    ),
}  # fmt: skip
"""What each kind of result shows; kinds of these kinds show the same."""


def tables_of(result: object) -> Tables:
    """Tables of a result as frames."""
    return _view_of(result, "frame", "table", VIEWS).tables(result)


def report_of(result: object, *, command: str = "") -> content.Report:
    """Make the report of a result.

    Parameters
    ----------
    command : as it was given, to be given again
    """
    reported = {kind: view for kind, view in VIEWS.items() if view.report}
    view = _view_of(result, "write_report", "report", reported)
    report: content.Report = _of_results(view.report)(result, command=command)
    return report


def _view_of(result: object, call: str, what: str, views: Mapping[type, View]) -> View:
    """What the kind of a result shows; OptionError of a call where it has no such thing."""
    view = next((view for kind, view in views.items() if isinstance(result, kind)), None)
    if view is None:
        reject_result(call, what, result, views)
    return view
