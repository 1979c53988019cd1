"""`winchcascade blind`: trials of the diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from winchcascade.cli.app import CommandList
from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JobsOption,
    JsonOption,
    SchedulerOption,
    report_options,
    valued_option,
)
from winchcascade.cli.outputs import Printed, Results, check_outputs, deliver, report_maker_of, show, write_reports
from winchcascade.core.files import json_bytes
from winchcascade.core.jobs import Workers, one_thread_each, processes
from winchcascade.report.report_files import ReportFiles

blind_command = typer.Typer(
    cls=CommandList,
    help="Test the diagnosis on campaigns of an independent twin of the rig, whose answers are sealed.",
    no_args_is_help=True,
)

TrialArgument = Annotated[
    Path, typer.Argument(metavar="DIR", help="The folder of a trial that `blind deal` has made.", show_default=False)
]


@blind_command.command("deal")
def blind_deal_command(
    cases: Annotated[
        int, typer.Option("--cases", metavar="N", min=1, help="Generate this number of campaigns.", show_default=False)
    ],
    seed: Annotated[
        int,
        typer.Option(
            "--seed",
            metavar="S",
            min=0,
            help="Set the seed; the same seed generates the same campaigns.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path, valued_option("--out", "DIR", "Write the trial into this folder. A second call completes it.")
    ],
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    force: ForceOption = False,
) -> None:
    """Generate campaigns with injected effects, and seal the answers. The exit code is 1 if a case failed."""
    from winchcascade.blind.trial import deal
    from winchcascade.report.screen import Progress
    from winchcascade.report.trial_text import dealt_text, faults_text

    with Progress(f"dealing {cases} cases") as watch:
        done = deal(out, cases, seed, workers=Workers(jobs or processes(), scheduler), force=force, watch=watch)
    show(dealt_text(done, out), failures=faults_text(done))
    raise typer.Exit(1 if done.faults else 0)


@blind_command.command("diagnose")
def blind_diagnose_command(
    trial: TrialArgument, jobs: JobsOption = None, scheduler: SchedulerOption = None, force: ForceOption = False
) -> None:
    """Diagnose every case of a trial from its logs alone.

    A second call keeps what is done. The exit code is 1 if a case failed.
    """
    one_thread_each()
    from winchcascade.batch.campaign_diagnosis import diagnose_campaign
    from winchcascade.blind.trial import DiagnosisMethod, diagnose
    from winchcascade.report.screen import Progress
    from winchcascade.report.trial_text import diagnosed_text, faults_text
    from winchcascade.rig.effects.catalogue import EFFECTS

    method, workers = DiagnosisMethod(diagnose_campaign, EFFECTS), Workers(jobs or processes(), scheduler)
    with Progress(f"diagnosing {trial.name}") as watch:
        done = diagnose(trial, method, workers=workers, force=force, watch=watch)
    show(diagnosed_text(done, trial), failures=faults_text(done))
    raise typer.Exit(1 if done.faults else 0)


@blind_command.command("score")
@report_options("html", "pdf")
def blind_score_command(
    trial: TrialArgument,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    force: ForceOption = False,
) -> None:
    """Open the answers of a trial, and count correct and wrong diagnoses. Changed answers are rejected."""
    from winchcascade.blind.score import score, score_record
    from winchcascade.report.trial_text import trial_text

    inputs = [*trial.glob("*.json"), *trial.glob("diagnoses/*.json")]
    outputs: Results = {"--json": json, **report.by_option}
    check_outputs(outputs, inputs, force=force)
    found = score(trial)
    write_reports(report_maker_of(found), report, "trial", force=force)
    deliver(
        json, lambda: json_bytes(score_record(found)), Printed(lambda: trial_text(found, trial), outputs), force=force
    )
