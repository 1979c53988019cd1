"""`winchcascade compare`: two campaigns, batches, reductions or logs, run by run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JobsOption,
    JsonOption,
    report_options,
    valued_option,
)
from winchcascade.cli.outputs import Printed, Results, check_outputs, deliver, given_command, write_reports
from winchcascade.core.files import json_bytes
from winchcascade.report.report_files import ReportFiles

if TYPE_CHECKING:
    from winchcascade.report.sheet import Report

SameSensorsOption = Annotated[
    bool,
    typer.Option("--same-sensors", help="Share the gains of the sensors between A and B, so that their errors cancel."),
]
MaxDropOption = Annotated[
    float | None,
    valued_option("--max-drop", "X", "Exit with code 1 if eta_pto of a run drops by more than X, such as 0.01."),
]


@report_options("html", "pdf", "figures", "tables")
def compare_command(
    a: Annotated[
        Path,
        typer.Argument(
            metavar="A",
            help="The first side: a campaign, the folder of a batch, the JSON of a reduction, or a log.",
            show_default=False,
        ),
    ],
    b: Annotated[Path, typer.Argument(metavar="B", help="The second side, of the same kinds.", show_default=False)],
    same_sensors: SameSensorsOption = False,
    max_drop: MaxDropOption = None,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Compare two sets of results, run by run: differences B - A with 95 % intervals.

    Runs are matched by load, without a load by file name. Errors of sensors count as independent.
    """
    from winchcascade.batch.compare_results import compare
    from winchcascade.batch.results import input_files
    from winchcascade.comparison.gate import check_limit, drop_gate
    from winchcascade.core.jobs import processes
    from winchcascade.report.comparison_text import comparison_record, comparison_text, failed_text

    if max_drop is not None:
        check_limit(max_drop)
    outputs: Results = {"--json": json, **report.by_option}
    check_outputs(outputs, [*input_files(a), *input_files(b)], force=force)
    found = compare(a, b, same_sensors=same_sensors, jobs=jobs or processes())
    gate = None if max_drop is None else drop_gate(found, max_drop)

    def make() -> Report:
        from winchcascade.report.comparison_report import make_comparison_report

        return make_comparison_report(found, gate, command=given_command())

    write_reports(make, report, "comparison", of=f"{a} and {b}", force=force)
    deliver(
        json,
        lambda: json_bytes(comparison_record(found, gate)),
        Printed(
            lambda: comparison_text(found, gate),
            outputs,
            failures=lambda: "" if gate is None else failed_text(gate),
        ),
        force=force,
    )
    raise typer.Exit(0 if gate is None or gate.ok else 1)
