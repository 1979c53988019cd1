"""Results in Python: tables as frames, pictures of their reports, summaries for notebooks, and
report files.

What a result has is registered for its class: `tables_of` and `report_of`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial, singledispatch
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from winchcascade.comparison.comparison_result import Comparison
from winchcascade.core.arguments import FLAG, PATH, check_arguments
from winchcascade.core.errors import OptionError, check_choice, reject_result
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
    from winchcascade.report.render.report_files import publish

    check_arguments("write_report", ("path", path, PATH), ("force", force, FLAG))
    path = Path(path)
    ending = path.suffix.casefold()
    if ending not in (".html", ".pdf"):
        raise OptionError(
            f"{path}: no ending of a report; expected a name that ends in .html or .pdf."
        )
    report = report_of(result)
    publish(
        report,
        html=path if ending == ".html" else None,
        pdf=path if ending == ".pdf" else None,
        force=force,
    )
    return path


# ----------------------------------------------------------------------------------------- tables
@singledispatch
def tables_of(result: object) -> Tables:
    """Tables of a result as frames."""
    reject_result("frame", "table", result, tables_of.registry)


@tables_of.register(Run)
def _(result: Run) -> Tables:
    channels = given_rig("to_pandas", None, result.rig).known_channels
    return {
        "channels": partial(frames.run_frame, result, channels),
        "findings": partial(frames.run_findings_frame, result),
    }


@tables_of.register(Reduction)
def _(result: Reduction) -> Tables:
    made = {
        name: partial(frames.reduction_frame, result, name)
        for name in ("cycles", "bins", "findings")
    }
    return {**made, "channels": partial(frames.samples_frame, result)}


@tables_of.register(CampaignReduction)
def _(result: CampaignReduction) -> Tables:
    names = ("runs", "cycles", "bins", "findings", "runs_all")
    return {name: partial(frames.campaign_frame, result, name) for name in names}


@tables_of.register(DiagnosisResult)
def _(result: DiagnosisResult) -> Tables:
    names = ("causes", "contributions", "map", "stability")
    return {name: partial(frames.diagnosis_frame, result, name) for name in names}


@tables_of.register(Comparison)
def _(result: Comparison) -> Tables:
    return {"differences": partial(frames.comparison_frame, result)}


@tables_of.register(Simulation)
def _(result: Simulation) -> Tables:
    return {"channels": partial(frames.simulation_frame, result)}


@tables_of.register(Calibration)
def _(result: Calibration) -> Tables:
    from winchcascade.report.results.calibration import calibration_record

    return _of_record(calibration_record(result), "numbers", "strained")


@tables_of.register(Check)
def _(result: Check) -> Tables:
    from winchcascade.report.results.checks import check_record

    return _of_record(check_record(result), "cells", "findings")


@tables_of.register(Audit)
def _(result: Audit) -> Tables:
    from winchcascade.report.results.audit_record import audit_record

    return _of_record(
        audit_record(result), "contradictions", "claims", "windows", "column_faults", "laws"
    )


@tables_of.register(SeaStudy)
def _(result: SeaStudy) -> Tables:
    from winchcascade.report.results.sea_report import sea_record

    return _of_record(sea_record(result), "rows")


def _of_record(record: Mapping[str, object], *names: str) -> Tables:
    """Lists of a JSON as tables, those that it has."""
    return {name: partial(frames.record_frame, record[name]) for name in names if name in record}


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


# ---------------------------------------------------------------------------------------- reports
@singledispatch
def report_of(result: object, *, command: str = "") -> content.Report:  # noqa: ARG001
    """Make the report of a result.

    Parameters
    ----------
    command : as it was given, to be given again
    """
    reject_result("write_report", "report", result, report_of.registry)


def _late(name: str) -> Callable[..., content.Report]:
    """A function of `results`, which is imported with all that it draws by when it is called."""

    def called(result: object, *, command: str = "") -> content.Report:
        report: content.Report = resolve_name(f"winchcascade.report.results.{name}")(
            result, command=command
        )
        return report

    return called


for _kind, _name in {
    Audit: "audits:audit_report",
    Calibration: "calibration:calibration_report",
    CampaignReduction: "campaign:reduced_campaign",
    Check: "checks:check_report",
    Comparison: "comparison:comparison_report",
    DiagnosisResult: "diagnosis:diagnosis_report",
    Reduction: "reduction:reduction_report",
    SeaStudy: "sea_report:sea_report",
    Simulation: "simulation:simulation_report",
}.items():
    report_of.register(_kind, _late(_name))
