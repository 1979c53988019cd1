"""`winchcascade compare`: two campaigns, batches, reductions or logs, run by run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from winchcascade.cli.options import with_options
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present

if TYPE_CHECKING:
    from winchcascade.comparison.gate import Gate
    from winchcascade.report.content import Report


@with_options("json", *REPORT)
def compare_command(
    a: Path,
    b: Path,
    same_sensors: bool = False,
    max_drop: float | None = None,
    jobs: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Compare two sets of results, run by run: differences B - A with 95 % intervals.

    Runs are matched by load, without a load by file name. Errors of sensors count as independent.
    """
    from winchcascade.batch.compare_results import compare
    from winchcascade.batch.results import input_files
    from winchcascade.comparison.gate import check_limit, drop_gate
    from winchcascade.core.jobs import processes
    from winchcascade.report.results.comparison import comparison_record, comparison_report

    if max_drop is not None:
        check_limit(max_drop)
    outputs.check([*input_files(a), *input_files(b)])
    found = compare(a, b, same_sensors=same_sensors, jobs=jobs or processes())
    gate = None if max_drop is None else drop_gate(found, max_drop)
    present(
        lambda: comparison_report(found, gate, command=given_command()),
        outputs,
        record=lambda: comparison_record(found, gate),
        name="comparison",
        failed=None if gate is None or gate.ok else lambda: _failed(gate),
    )
    raise typer.Exit(0 if gate is None or gate.ok else 1)


def _failed(gate: Gate) -> Report:
    """The drops that are larger than the limit alone."""
    from msgspec.structs import replace

    from winchcascade.report.content import Report, section
    from winchcascade.report.results.comparison import drops_table, gate_words

    drops = section("limit", "Limit of a drop", drops_table(replace(gate, drops=gate.failed)))
    return Report("Comparison", gate_words(gate), sections=[drops])
