"""`winchcascade check` and `audit`: published tables, against results and against themselves."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import typer

from winchcascade.cli.options import named_number, with_options
from winchcascade.cli.outputs import (
    NO_OUTPUTS,
    STDOUT,
    Outputs,
    given_command,
    present,
    show,
    show_commands,
)
from winchcascade.cli.progress import Progress
from winchcascade.core.errors import OptionError


@with_options("json", "html", "pdf", "tables", "junit")
def check_command(
    results: Path,
    against: str,
    same_logs: bool = False,
    tolerance: list[str] | None = None,
    jobs: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
    github: bool = False,
) -> None:
    """Compare results with a published table, cell by cell. The exit code is 1 if a cell does not
    agree.

    A cell agrees if the difference is within the sum of rounding, maximum deviation of the cycles
    and two standard uncertainties of the sensors. With --same-logs, rounding alone is allowed.
    """
    from winchcascade.batch.results import check_results, input_files, load_results
    from winchcascade.core.jobs import processes
    from winchcascade.report.results.checks import (
        check_record,
        check_report,
        failed_check,
        github_annotations,
        junit_xml,
    )
    from winchcascade.tables.check import SAME_LOGS, Factors
    from winchcascade.tables.table_file import load_table

    if same_logs and tolerance:
        raise OptionError(
            f"--tolerance {tolerance[0]}: changes a tolerance, and with --same-logs rounding "
            f"alone is allowed; expected one of "
            "the two options."
        )
    factors, table = (
        SAME_LOGS if same_logs else Factors(**_factors(tolerance or [])),
        load_table(against),
    )
    outputs.check([against, table.csv or None, *input_files(results)])
    found = load_results(results, jobs=jobs or processes())
    if not found.verified:
        show(
            f"{results}: has no digests, as version 0.1.0 wrote results, so that it cannot be "
            f"verified; run the batch again.\n",
            file=sys.stderr,
        )
    outcome = check_results(found, table, factors)
    present(
        lambda: check_report(outcome, command=given_command()),
        outputs,
        record=lambda: check_record(outcome),
        texts={"junit": lambda: junit_xml(outcome)},
        name=f"{table.name}_check",
        failed=None if outcome.ok else lambda: failed_check(outcome),
    )
    if github:
        stream = sys.stderr if outputs["json"] == STDOUT else sys.stdout
        show_commands(github_annotations(outcome, table.path), file=stream)
    raise typer.Exit(0 if outcome.ok else 1)


def _factors(options: Sequence[str]) -> dict[str, float]:
    """Read PART=FACTOR options."""
    factors: dict[str, float] = {}
    for option in options:
        name, value = named_number(option)
        if name not in ("rounding", "deviation", "uncertainty") or not 0 <= value < 1e6:
            raise OptionError(
                f"--tolerance {option}: expected rounding, deviation or uncertainty and a factor, "
                f"such as uncertainty=1.5."
            )
        factors[name] = value
    return factors


@with_options("json", "html", "pdf", "tables")
def audit_command(
    table: str, rig: str | None = None, physics: bool = False, outputs: Outputs = NO_OUTPUTS
) -> None:
    """Check a published table and its text for contradictions, without any log. The exit code is 1
    if there is one.

    With --physics, the result lists the efficiencies that the model of the rig can attain, and the
    effects that could explain a difference.
    """
    from winchcascade.report.results.audit_record import audit_record
    from winchcascade.report.results.audits import audit_report, failed_audit
    from winchcascade.tables.audit import audit
    from winchcascade.tables.table_file import load_table

    if rig is not None and not physics:
        raise OptionError(
            f"--rig {rig}: is of use with --physics alone; add that, or leave the rig out."
        )
    outputs.check([table, rig])
    opened = load_table(table)
    if physics and opened.by_load:
        with Progress(f"physics of {opened.name}") as watch:
            found = audit(opened, physics=True, rig=rig, watch=watch)
    else:
        found = audit(opened, physics=physics)
    present(
        lambda: audit_report(found, command=given_command()),
        outputs,
        record=lambda: audit_record(found),
        name=f"{opened.name}_audit",
        failed=None if found.ok else lambda: failed_audit(found),
    )
    raise typer.Exit(0 if found.ok else 1)
