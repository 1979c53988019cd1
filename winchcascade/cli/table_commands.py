"""`winchcascade check` and `audit`: published tables, against results and against themselves."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JobsOption,
    JsonOption,
    RigOption,
    named_number,
    report_options,
    table_names,
    valued_option,
)
from winchcascade.cli.outputs import (
    Printed,
    Results,
    check_outputs,
    deliver,
    report_maker_of,
    show,
    show_commands,
    write_reports,
)
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes, write_content
from winchcascade.report.report_files import ReportFiles

ResultsArgument = Annotated[
    Path,
    typer.Argument(
        metavar="RESULTS|CAMPAIGN",
        help="The results: a campaign, the folder of a batch, or the JSON of a reduction.",
        show_default=False,
    ),
]
AgainstOption = Annotated[
    str,
    typer.Option(
        "--against",
        metavar="TABLE",
        help="The published table: a table file, or the built-in hsu2026-table2.",
        show_default=False,
        autocompletion=table_names,
    ),
]
ToleranceOption = Annotated[
    list[str] | None,
    valued_option(
        "--tolerance",
        "PART=FACTOR",
        "Multiply a part of the tolerance, which is rounding, deviation or uncertainty, by a factor.",
    ),
]
SameLogsOption = Annotated[
    bool, typer.Option("--same-logs", help="The table was made from these logs: allow rounding alone.")
]
JunitOption = Annotated[
    Path | None, valued_option("--junit", "FILE", "Write the result as JUnit XML for a test server.")
]


@report_options("html", "pdf", "tables")
def check_command(
    results: ResultsArgument,
    against: AgainstOption,
    same_logs: SameLogsOption = False,
    tolerance: ToleranceOption = None,
    junit: JunitOption = None,
    github: Annotated[bool, typer.Option("--github", help="Also print annotations for GitHub.")] = False,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Compare results with a published table, cell by cell. The exit code is 1 if a cell does not agree.

    A cell agrees if the difference is within the sum of rounding, largest deviation of the cycles and two standard
    uncertainties of the sensors. With --same-logs, rounding alone is allowed.
    """
    from winchcascade.batch.results import check_results, input_files, load_results
    from winchcascade.core.jobs import processes
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.check_record import check_record, github_annotations, junit_xml
    from winchcascade.report.results.checks import check_report, failed_check
    from winchcascade.tables.check import SAME_LOGS, Factors
    from winchcascade.tables.point_table import PointTable, open_table

    if same_logs and tolerance:
        raise OptionError(
            f"--tolerance {tolerance[0]}: changes a tolerance, and with --same-logs rounding alone is allowed; expected one of "
            "the two options."
        )
    factors, table = SAME_LOGS if same_logs else Factors(**_factors(tolerance or [])), open_table(against)
    outputs: Results = {"--junit": junit, "--json": json, **report.by_option}
    check_outputs(
        outputs, [against, table.csv if isinstance(table, PointTable) else None, *input_files(results)], force=force
    )
    found = load_results(results, jobs=jobs or processes())
    if not found.verified:
        show(
            f"{results}: has no digests, as version 0.1.0 wrote results, so that it cannot be verified; run the batch again.\n",
            file=sys.stderr,
        )
    outcome = check_results(found, table, factors)
    if junit is not None:
        write_content(junit, junit_xml(outcome), force=force)
    write_reports(report_maker_of(outcome), report, f"{table.name}_check", force=force)
    printed = Printed(
        lambda: terminal_text(check_report(outcome), [path for path in outputs.values() if path]),
        failures=lambda: "" if outcome.ok else terminal_text(failed_check(outcome)),
    )
    deliver(json, lambda: json_bytes(check_record(outcome)), printed, force=force)
    if github:
        show_commands(github_annotations(outcome, table.path), file=sys.stderr if json == "-" else sys.stdout)
    raise typer.Exit(0 if outcome.ok else 1)


def _factors(options: Sequence[str]) -> dict[str, float]:
    """Read PART=FACTOR options."""
    factors: dict[str, float] = {}
    for option in options:
        name, value = named_number(option)
        if name not in ("rounding", "deviation", "uncertainty") or not 0 <= value < 1e6:
            raise OptionError(
                f"--tolerance {option}: expected rounding, deviation or uncertainty and a factor, such as uncertainty=1.5."
            )
        factors[name] = value
    return factors


TableArgument = Annotated[
    str,
    typer.Argument(
        metavar="TABLE",
        help="The published table: a table file, or the built-in hsu2026-table2.",
        show_default=False,
        autocompletion=table_names,
    ),
]


@report_options("html", "pdf", "tables")
def audit_command(
    table: TableArgument,
    physics: Annotated[
        bool, typer.Option("--physics", help="Also compare the table with the model of a rig; this takes some seconds.")
    ] = False,
    rig: RigOption = None,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    force: ForceOption = False,
) -> None:
    """Check a published table and its text for contradictions, without any log. The exit code is 1 if there is one.

    With --physics, the result lists the efficiencies that the model of the rig can reach, and the effects that could explain a
    difference.
    """
    from winchcascade.core.published_table import PublishedTable
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.audit_record import audit_record
    from winchcascade.report.results.audits import audit_report, failed_audit
    from winchcascade.report.screen import Progress
    from winchcascade.tables.audit import audit
    from winchcascade.tables.point_table import open_table

    if rig is not None and not physics:
        raise OptionError(f"--rig {rig}: is of use with --physics alone; add that, or leave the rig out.")
    outputs: Results = {"--json": json, **report.by_option}
    check_outputs(outputs, [table, rig], force=force)
    opened = open_table(table)
    if physics and isinstance(opened, PublishedTable):
        with Progress(f"physics of {opened.name}") as watch:
            found = audit(opened, physics=True, rig=rig, watch=watch)
    else:
        found = audit(opened, physics=physics)
    write_reports(report_maker_of(found), report, f"{opened.name}_audit", force=force)
    printed = Printed(
        lambda: terminal_text(audit_report(found), [path for path in outputs.values() if path]),
        failures=lambda: "" if found.ok else terminal_text(failed_audit(found)),
    )
    deliver(json, lambda: json_bytes(audit_record(found)), printed, force=force)
    raise typer.Exit(0 if found.ok else 1)
