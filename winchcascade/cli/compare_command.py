"""`winchcascade compare`: two campaigns, batches, reductions or logs, run by run."""

from __future__ import annotations

from functools import cache, partial
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
    from winchcascade.comparison.gate import Gate
    from winchcascade.report.content import Report

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
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.comparison_record import comparison_record

    if max_drop is not None:
        check_limit(max_drop)
    outputs: Results = {"--json": json, **report.by_option}
    check_outputs(outputs, [*input_files(a), *input_files(b)], force=force)
    found = compare(a, b, same_sensors=same_sensors, jobs=jobs or processes())
    gate = None if max_drop is None else drop_gate(found, max_drop)

    @cache
    def stated() -> Report:
        from winchcascade.report.results.comparison import comparison_report

        return comparison_report(found, gate, command=given_command())

    write_reports(stated, report, "comparison", force=force)
    files = list(dict.fromkeys(path for path in outputs.values() if path))
    failures = partial(_failed, gate) if gate and not gate.ok else str
    printed = Printed(lambda: terminal_text(stated(), files), failures=failures)
    deliver(json, lambda: json_bytes(comparison_record(found, gate)), printed, force=force)
    raise typer.Exit(0 if gate is None or gate.ok else 1)


def _failed(gate: Gate) -> str:
    """The drops that are larger than the limit alone."""
    from msgspec.structs import replace

    from winchcascade.report.content import Report, section
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.comparison import drops_table, gate_words

    drops = section("limit", "Limit of a drop", drops_table(replace(gate, drops=gate.failed)))
    return terminal_text(Report("Comparison", gate_words(gate), sections=[drops]))
