"""`winchcascade blind`: trials of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from winchcascade.cli.help import CommandList, GroupedCommand
from winchcascade.cli.options import OUTPUTS, option, with_options
from winchcascade.cli.outputs import NO_OUTPUTS, Outputs, present
from winchcascade.core.jobs import Workers, one_thread_each, processes

if TYPE_CHECKING:
    from typing import NoReturn

    from winchcascade.blind.trial import TrialProgress

blind_command = typer.Typer(
    cls=CommandList,
    help="Test the diagnosis on campaigns of an independent twin of the rig, whose answers are sealed.",
    no_args_is_help=True,
)


@blind_command.command("deal", cls=GroupedCommand)
@with_options(out=option("--out", "DIR", "Write the trial into this folder. A second call completes it.", OUTPUTS))
def blind_deal_command(
    cases: int, seed: int, out: Path, jobs: int | None = None, scheduler: str | None = None, force: bool = False
) -> None:
    """Generate campaigns with injected effects, and seal the answers. The exit code is 1 if a case failed."""
    from winchcascade.blind.trial import deal
    from winchcascade.report.screen import Progress

    with Progress(f"dealing {cases} cases") as watch:
        done = deal(out, cases, seed, workers=Workers(jobs or processes(), scheduler), force=force, watch=watch)
    _end(done, "dealt", [out])


@blind_command.command("diagnose", cls=GroupedCommand)
@with_options()
def blind_diagnose_command(
    trial: Path, jobs: int | None = None, scheduler: str | None = None, force: bool = False
) -> None:
    """Diagnose every case of a trial from its logs alone.

    A second call keeps what is done. The exit code is 1 if a case failed.
    """
    one_thread_each()
    from winchcascade.batch.campaign_diagnosis import diagnose_campaign
    from winchcascade.blind.trial import DiagnosisMethod, diagnose
    from winchcascade.report.screen import Progress
    from winchcascade.rig.effects.catalogue import EFFECTS

    method, workers = DiagnosisMethod(diagnose_campaign, EFFECTS), Workers(jobs or processes(), scheduler)
    with Progress(f"diagnosing {trial.name}") as watch:
        done = diagnose(trial, method, workers=workers, force=force, watch=watch)
    _end(done, "diagnosed", [trial / "diagnoses", trial / "predictions"])


def _end(done: TrialProgress, what: str, folders: Sequence[Path]) -> NoReturn:
    """Print how far a trial is, and end."""
    from winchcascade.report.results.trials import progress_report

    report = progress_report(done, what)
    present(lambda: report, NO_OUTPUTS, failed=(lambda: report) if done.faults else None, notes=folders)
    raise typer.Exit(1 if done.faults else 0)


@blind_command.command("score", cls=GroupedCommand)
@with_options("json")
def blind_score_command(trial: Path, outputs: Outputs = NO_OUTPUTS) -> None:
    """Open the answers of a trial, and count correct and wrong diagnoses. Changed answers are rejected."""
    from winchcascade.blind.score import score, score_record
    from winchcascade.report.results.trials import trial_report

    outputs.check([*trial.glob("*.json"), *trial.glob("diagnoses/*.json")])
    found = score(trial)
    present(lambda: trial_report(found), outputs, record=lambda: score_record(found))
