"""`winchcascade blind`: trials of the diagnosis."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from winchcascade.cli.options import OUTPUTS, GroupedCommand, option, with_options
from winchcascade.cli.outputs import NO_OUTPUTS, Outputs, present
from winchcascade.cli.progress import Progress
from winchcascade.core.jobs import Workers, one_thread_each, processes

if TYPE_CHECKING:
    from typing import NoReturn

    from winchcascade.blind.trial import TrialProgress

SUMMARY_OF_TRIALS = (
    "Test the diagnosis on campaigns of an independent twin of the rig, whose answers are sealed."
)

blind_command = typer.Typer(
    help=SUMMARY_OF_TRIALS, short_help=SUMMARY_OF_TRIALS, no_args_is_help=True
)


_DIAGNOSES = option(
    "--diagnoses",
    "DIR",
    "Keep the diagnoses here, not in the folder diagnoses of the trial.",
    OUTPUTS,
)


@blind_command.command("deal", cls=GroupedCommand)
@with_options(
    out=option(
        "--out", "DIR", "Write the trial into this folder. A second call completes it.", OUTPUTS
    )
)
def blind_deal_command(
    cases: int,
    seed: int,
    out: Path,
    jobs: int | None = None,
    scheduler: str | None = None,
    force: bool = False,
) -> None:
    """Generate campaigns with injected effects, and seal the answers. The exit code is 1 if a
    case failed.
    """
    from winchcascade.blind.trial import deal

    with Progress(f"dealing {cases} cases", keeps=out) as watch:
        done = deal(
            out,
            cases,
            seed,
            workers=Workers(jobs or processes(), scheduler),
            force=force,
            watch=watch,
        )
    _end(done, "dealt", [out])


@blind_command.command("diagnose", cls=GroupedCommand)
@with_options(diagnoses=_DIAGNOSES)
def blind_diagnose_command(
    trial: Path,
    diagnoses: Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    force: bool = False,
) -> None:
    """Diagnose every case of a trial from its logs alone.

    A second call keeps what is done. The exit code is 1 if a case failed.
    """
    done = _diagnosed(trial, diagnoses, Workers(jobs or processes(), scheduler), force=force)
    _end(done, "diagnosed", [diagnoses or trial / "diagnoses"])


def _diagnosed(
    trial: Path,
    diagnoses: Path | None,
    workers: Workers,
    *,
    only: Collection[str] | None = None,
    force: bool = False,
) -> TrialProgress:
    """Diagnose the cases of a trial, or some of them, and show the progress."""
    one_thread_each()
    from winchcascade.batch.campaign_diagnosis import diagnose_campaign
    from winchcascade.blind.trial import diagnose

    with Progress(f"diagnosing {trial.name}", keeps=diagnoses or trial / "diagnoses") as watch:
        return diagnose(
            trial,
            diagnose_campaign,
            diagnoses=diagnoses,
            only=only,
            workers=workers,
            force=force,
            watch=watch,
        )


def _end(done: TrialProgress, what: str, folders: Sequence[Path]) -> NoReturn:
    """Print how far a trial is, and end."""
    from winchcascade.report.results.trials import progress_report

    report = progress_report(done, what)
    present(
        lambda: report, NO_OUTPUTS, failed=(lambda: report) if done.faults else None, notes=folders
    )
    raise typer.Exit(1 if done.faults else 0)


@blind_command.command("score", cls=GroupedCommand)
@with_options("json", diagnoses=_DIAGNOSES)
def blind_score_command(
    trial: Path,
    diagnoses: Path | None = None,
    jobs: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Open the answers of a trial, and count correct and wrong diagnoses. Changed answers are
    rejected.

    A folder of your own campaigns is judged as well, if each has a truth.json beside its
    campaign.toml; those without a diagnosis are diagnosed first.
    """
    from winchcascade.blind.score import score
    from winchcascade.blind.trial import DIAGNOSES, SEALED, TRIAL, case_names
    from winchcascade.blind.truth import TRUTH_FILE
    from winchcascade.report.results.trials import trial_report

    place = diagnoses or trial / DIAGNOSES
    outputs.check(
        [trial / TRIAL, trial / SEALED, *trial.glob(f"*/{TRUTH_FILE}"), *place.glob("*.json")]
    )
    if not (trial / TRIAL).exists():
        missing = [name for name in case_names(trial) if not (place / f"{name}.json").exists()]
        faults = (
            _diagnosed(trial, diagnoses, Workers(jobs or processes()), only=missing).faults
            if missing
            else {}
        )
        for name, fault in faults.items():
            typer.echo(f"{name}: {fault}", err=True)
    found = score(trial, diagnoses)
    present(lambda: trial_report(found), outputs, record=lambda: found)
