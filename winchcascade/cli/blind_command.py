"""`winchcascade blind`: trials of the diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from winchcascade.cli.app import CommandList
from winchcascade.cli.options import ForceOption, JobsOption, JsonOption, SchedulerOption, valued_option
from winchcascade.cli.outputs import Printed, check_outputs, deliver, show
from winchcascade.core.files import json_bytes
from winchcascade.core.jobs import Workers, one_thread_each, processes

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
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.trials import fault_lines, progress_report
    from winchcascade.report.screen import Progress

    with Progress(f"dealing {cases} cases") as watch:
        done = deal(out, cases, seed, workers=Workers(jobs or processes(), scheduler), force=force, watch=watch)
    show(terminal_text(progress_report(done, "dealt"), [out]), failures=fault_lines(done))
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
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.trials import fault_lines, progress_report
    from winchcascade.report.screen import Progress
    from winchcascade.rig.effects.catalogue import EFFECTS

    method, workers = DiagnosisMethod(diagnose_campaign, EFFECTS), Workers(jobs or processes(), scheduler)
    with Progress(f"diagnosing {trial.name}") as watch:
        done = diagnose(trial, method, workers=workers, force=force, watch=watch)
    files = [trial / "diagnoses", trial / "predictions"]
    show(terminal_text(progress_report(done, "diagnosed"), files), failures=fault_lines(done))
    raise typer.Exit(1 if done.faults else 0)


@blind_command.command("score")
def blind_score_command(trial: TrialArgument, json: JsonOption = None, force: ForceOption = False) -> None:
    """Open the answers of a trial, and count correct and wrong diagnoses. Changed answers are rejected."""
    from winchcascade.blind.score import score, score_record
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.trials import trial_report

    check_outputs({"--json": json}, [*trial.glob("*.json"), *trial.glob("diagnoses/*.json")], force=force)
    found = score(trial)
    printed = Printed(lambda: terminal_text(trial_report(found), [json] if json else []))
    deliver(json, lambda: json_bytes(score_record(found)), printed, force=force)
