"""Tables with a row for each log of a campaign, from one list of columns, and the texts of means
as these tables show them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from urllib.parse import quote

from winchcascade.core.campaign_file import KINDS
from winchcascade.core.cascade import field_of
from winchcascade.reduction.campaign_record import LogSummary, cascade_of
from winchcascade.report.content import Cell, Column, Measured, Span, Table, table
from winchcascade.report.glossary import metric, short
from winchcascade.report.wording import load_text, mean_text

LogColumn = Column[LogSummary]
LogTable = Table[LogSummary]


# ------------------------------------------------------------------------------------ the columns
def log_column(ending: str = "") -> LogColumn:
    """Name of a log; with an `ending` it leads to that file of the log."""
    return Column("log", lambda run: run.name, link=file_column(ending).link if ending else None)


def file_column(ending: str) -> LogColumn:
    """A link to one of the files of a log, in the folder `runs` beside the page."""
    return Column(
        ending.upper(), lambda _: ending, link=lambda run: f"runs/{quote(run.name)}.{ending}"
    )


LOAD: LogColumn = Column(
    "load", lambda run: "open" if run.open_circuit else load_text(run.load), "ohm"
)
SPEED: LogColumn = Column("plateau", lambda run: run.plateau_speed_mps, "m/s", 3)
WINDOW: LogColumn = Column(
    "window", lambda run: run.window if isinstance(run.window, str) else f"{run.window:g}", "s"
)
CYCLES: LogColumn = Column("cycles", lambda run: _share(run.complete, run.cycles))
DATA: LogColumn = Column("data", lambda run: KINDS[run.origin.measured])
LOST: LogColumn = Column("data lost", lambda run: 100.0 * run.removed_share, "%", 2)
FINDINGS: LogColumn = Column("findings", lambda run: _kinds(run))


def _share(part: int, whole: int) -> str:
    return f"{part}" if part == whole else f"{part} of {whole}"


def _kinds(run: LogSummary) -> str:
    kinds = ", ".join(kind.replace("_", " ") for kind in run.findings)
    return f"{run.finding_count}: {kinds}" if kinds else "none"


def mean_column(name: str, *, brief: bool = True) -> LogColumn:
    """Mean of a metric with the digits that its uncertainty allows."""
    field, term = field_of(name), metric(name)

    def cell(run: LogSummary) -> Cell:
        mean = run.mean.get(field)
        return None if mean is None else Measured(mean, run.standard_uncertainty.get(field))

    return Column(short(name), cell, term.unit, term.decimals, brief)


def uncertainty_column(name: str) -> LogColumn:
    """Standard uncertainty of the mean of a metric."""
    field = field_of(name)

    def cell(run: LogSummary) -> Cell:
        u = run.standard_uncertainty.get(field)
        return None if u is None else Measured(u, u)

    return Column(f"u({short(name)})", cell, metric(name).unit)


def interval_column(name: str) -> LogColumn:
    """Interval of 95 % of the mean of a metric."""
    term = metric(name)
    return Column(
        f"95 % of {short(name)}", lambda run: interval(run, name), term.unit, term.decimals
    )


def interval(run: LogSummary, name: str) -> Span | None:
    """Interval of 95 % of the mean of a metric of a log; None where its uncertainty is unknown."""
    ends, u = run.interval_95.get(field_of(name)), run.standard_uncertainty.get(field_of(name))
    return None if ends is None or not u else Span(*ends, u)


def deviation_column(name: str, head: str = "") -> LogColumn:
    """Largest deviation of any cycle from the mean of a metric, where there are several cycles.

    Parameters
    ----------
    head : of the column, if the name of the metric alone would not tell
    """
    field = field_of(name)

    def cell(run: LogSummary) -> Cell:
        return run.max_deviation_percent.get(field) if run.complete > 1 else None

    return Column(head or short(name), cell, "%", 2, brief=False)


def given(runs: Sequence[LogSummary], names: Iterable[str]) -> list[str]:
    """Metrics of which any log has a mean."""
    return [name for name in names if any(run.mean.get(field_of(name)) is not None for run in runs)]


def mean_of(run: LogSummary, name: str) -> str:
    """Mean of a metric of a log, as a sentence states it."""
    field = field_of(name)
    return mean_text(name, run.mean.get(field), run.standard_uncertainty.get(field))


# ------------------------------------------------------------------------------------- the tables
def _table(
    name: str,
    caption: str,
    columns: Sequence[LogColumn],
    runs: Sequence[LogSummary],
    *,
    note: str = "",
) -> LogTable:
    """A table of logs under their names, loads and plateau speeds; empty where no further column
    holds anything.
    """
    head = [log_column(), LOAD, SPEED]
    return table(name, caption, [*head, *columns], runs if columns else (), note=note, brief=False)


def budget_table(runs: Sequence[LogSummary], *, linked: bool) -> LogTable:
    """Energies, mean powers and efficiencies by load, in the form of Table 2 of the paper, and how
    well cycles repeat.

    Parameters
    ----------
    linked : the pages of the logs stand beside that of the campaign
    """
    cascade = cascade_of(runs)
    stages, last = cascade.names, cascade.names[-1]
    known = given(runs, [f"{kind}_{stage}" for stage in stages for kind in ("energy", "power")])
    ratios = given(runs, cascade.ratios)
    overall = [cascade.overall] if cascade.overall in ratios else (ratios or known)[:1]
    columns = [
        *(mean_column(m, brief=m in (f"energy_{stages[0]}", f"energy_{last}")) for m in known),
        *map(mean_column, ratios),
        *(deviation_column(name, f"dev({short(name)})") for name in overall),
    ]
    note = (
        "dev: maximum deviation of a cycle from the mean. Digits: as the standard uncertainty "
        "allows."
        if columns
        else ""
    )
    caption = (
        "Energy budget of the integration window and cascade efficiencies, means of the cycles."
    )
    return table(
        "budget",
        caption,
        [log_column("html" if linked else ""), LOAD, SPEED, *columns],
        runs,
        note=note,
    )


def uncertainty_table(runs: Sequence[LogSummary]) -> LogTable:
    """Standard uncertainties of the means, of the efficiencies their intervals."""
    cascade = cascade_of(runs)
    stages = given(
        runs, [f"{kind}_{stage}" for stage in cascade.names for kind in ("energy", "power")]
    )
    columns = [*map(uncertainty_column, stages), *map(interval_column, given(runs, cascade.ratios))]
    note = (
        "Coverage 95 %; scatter of the cycles by Student's t, errors of the sensors by their own "
        "distributions. Logs with the "
        "same sensors share these errors, so that differences between loads are better known than "
        "each value."
    )
    return _table(
        "uncertainties",
        "Standard uncertainties u and intervals of the means.",
        columns,
        runs,
        note=note,
    )


def net_table(runs: Sequence[LogSummary]) -> LogTable:
    """Energies of whole cycles; empty where no log has any."""
    names = given(runs, cascade_of(runs).net_metrics)
    return _table(
        "net",
        "Whole cycles, from onset to next onset: independent of the window.",
        [*map(mean_column, names)],
        runs,
    )


def repeatability_table(runs: Sequence[LogSummary]) -> LogTable:
    """Largest deviation of any cycle from the mean; empty where no log has two cycles."""
    several = [run for run in runs if run.complete > 1]
    known = {
        field
        for run in several
        for field, value in run.max_deviation_percent.items()
        if value is not None
    }
    metrics = [name for name in cascade_of(runs).metrics if field_of(name) in known]
    caption = "Largest deviation of any cycle from the mean of its log."
    return _table(
        "repeatability",
        caption,
        [CYCLES, *map(deviation_column, metrics)] if metrics else [],
        several,
    )


def logs_table(runs: Sequence[LogSummary]) -> LogTable:
    """Every log: its window and cycles, its data, and what was found wrong with it."""
    return _table(
        "logs",
        "Logs: complete cycles, and what checks found.",
        [WINDOW, CYCLES, DATA, LOST, FINDINGS],
        runs,
    )
