"""`winchcascade check` and `audit`: published tables, against results and against themselves."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from winchcascade.cli.options import ForceOption, JobsOption, JsonOption, RigOption, named_number, table_names
from winchcascade.cli.outputs import check_outputs, deliver, show, show_commands
from winchcascade.core.errors import OptionError
from winchcascade.core.files import json_bytes


def check_command(
    results: Annotated[
        Path,
        typer.Argument(
            metavar="RESULTS|CAMPAIGN",
            help="The results: a campaign, the folder of a batch, or the JSON of a reduction.",
            show_default=False,
        ),
    ],
    against: Annotated[
        str,
        typer.Option(
            "--against",
            metavar="TABLE",
            help="The published table: a table file, or the built-in hsu2026-table2.",
            show_default=False,
            autocompletion=table_names,
        ),
    ],
    tolerance: Annotated[
        list[str] | None,
        typer.Option(
            "--tolerance",
            metavar="PART=FACTOR",
            help="Multiply a part of the tolerance, which is rounding, deviation or uncertainty, by a factor.",
        ),
    ] = None,
    junit: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="Write the result as JUnit XML for a test server.")
    ] = None,
    github: Annotated[bool, typer.Option("--github", help="Also print annotations for GitHub.")] = False,
    json: JsonOption = None,
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Compare results with a published table, cell by cell. The exit code is 1 if a cell does not agree.

    A cell agrees if the difference is within the sum of rounding, largest deviation of the cycles and two standard
    uncertainties.
    """
    from winchcascade.batch.results import check_results, load_results, open_table
    from winchcascade.core.files import write_content
    from winchcascade.core.jobs import processes
    from winchcascade.report.check_text import check_record, check_text, github_annotations, junit_xml, missed_text
    from winchcascade.tables.check import Factors

    around = results if results.is_dir() else results.parent
    inputs: list[str | Path] = [results, against, *around.glob("*"), *around.glob("runs/*")]
    outputs = {"--junit": junit, "--json": json}
    check_outputs(outputs, inputs, force=force)
    factors, table = Factors(**_factors(tolerance or [])), open_table(against)
    found = load_results(results, jobs=jobs or processes())
    if not found.verified:
        show(
            f"{results}: has no digests, as version 0.1.0 wrote results, so that it cannot be verified; run the batch again.\n",
            file=sys.stderr,
        )
    outcome = check_results(found, table, factors)
    if junit is not None:
        write_content(junit, junit_xml(outcome), force=force)
    deliver(
        json,
        lambda: json_bytes(check_record(outcome)),
        lambda: check_text(outcome),
        force=force,
        results=outputs,
        failures=lambda: missed_text(outcome),
    )
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


def audit_command(
    table: Annotated[
        str,
        typer.Argument(
            metavar="TABLE",
            help="The published table: a table file, or the built-in hsu2026-table2.",
            show_default=False,
            autocompletion=table_names,
        ),
    ],
    physics: Annotated[
        bool, typer.Option("--physics", help="Also compare the table with the model of a rig; this takes some seconds.")
    ] = False,
    rig: RigOption = None,
    json: JsonOption = None,
    force: ForceOption = False,
) -> None:
    """Check a published table and its text for contradictions, without any log. The exit code is 1 if there is one.

    With --physics, the result lists the efficiencies that the model of the rig can reach, and the effects that could explain a
    difference.
    """
    from winchcascade.report.audit_text import audit_record, audit_text, contradictions_text
    from winchcascade.tables.audit import audit
    from winchcascade.tables.point_table import is_point_table

    if rig is not None and not physics:
        raise OptionError(f"--rig {rig}: is of use with --physics alone; add that, or leave the rig out.")
    outputs = {"--json": json}
    check_outputs(outputs, [table, rig], force=force)
    if Path(table).is_file() and is_point_table(Path(table)):
        _audit_points(Path(table), physics=physics, json=json, force=force)
    outcome = audit(table)
    record, text, ok, failures = audit_record(outcome), audit_text(outcome), outcome.ok, contradictions_text(outcome)
    if physics:
        from winchcascade.core.rig_toml import DEFAULT_RIG
        from winchcascade.reduction.reduce import first_metrics
        from winchcascade.report.audit_text import attainable_record, attainable_text, unreachable_text
        from winchcascade.report.progress import Progress
        from winchcascade.rig.effects.catalogue import OF_THE_RIG
        from winchcascade.rig.open_rig import load_rig
        from winchcascade.tables.attainable import attainable_ranges

        of = load_rig(rig or DEFAULT_RIG)
        with Progress(f"physics of {outcome.table.name}") as watch:
            found = attainable_ranges(
                outcome.table, of, OF_THE_RIG, lambda run, window: first_metrics(run, of, window),
                scatter=outcome.known.eta, watch=watch,
            )  # fmt: skip
        record, text, ok, failures = (
            record | {"physics": attainable_record(found)},
            text + attainable_text(found),
            ok and found.ok,
            failures + unreachable_text(found),
        )
    deliver(json, lambda: json_bytes(record), lambda: text, force=force, results=outputs, failures=lambda: failures)
    raise typer.Exit(0 if ok else 1)


def _audit_points(table: Path, *, physics: bool, json: str | None, force: bool) -> NoReturn:
    """Audit a table of operating points and end the command."""
    from winchcascade.report.point_audit_text import broken_laws_text, point_audit_record, point_audit_text
    from winchcascade.tables.point_audit import audit_points
    from winchcascade.tables.point_table import load_points

    if physics:
        raise OptionError(
            f"--physics: {table} is a table of operating points; expected one of loads; leave --physics out."
        )
    found = audit_points(load_points(table))
    deliver(
        json,
        lambda: json_bytes(point_audit_record(found)),
        lambda: point_audit_text(found),
        force=force,
        results={"--json": json},
        failures=lambda: broken_laws_text(found),
    )
    raise typer.Exit(0 if found.ok else 1)
