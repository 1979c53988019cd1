"""`winchcascade diagnose`: why logs and model differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from winchcascade.cli.options import (
    NO_REPORT,
    CampaignArgument,
    ForceOption,
    JsonOption,
    RigOption,
    ThreadsOption,
    effect_names,
    report_options,
    valued_option,
)
from winchcascade.cli.outputs import Printed, check_outputs, deliver, given_command, write_reports
from winchcascade.core.campaign_file import Campaign, load_campaign
from winchcascade.core.errors import OptionError
from winchcascade.core.files import is_marked, json_bytes
from winchcascade.core.jobs import one_thread_each, processes, set_threads
from winchcascade.core.store import locked, make_one
from winchcascade.report.report_files import ReportFiles

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.report.content import Report

WithholdOption = Annotated[
    list[float] | None,
    valued_option(
        "--withhold", "LOAD", "Hold the logs of this load [ohm, or inf] out of choice and fit; repeat it for several."
    ),
]
SimulatedOption = Annotated[
    Path | None,
    valued_option(
        "--simulated", "FOLDER", "Compare the logs with your own simulation: files of the same names in this folder."
    ),
]
SuspectOption = Annotated[
    list[str] | None,
    valued_option(
        "--suspect",
        "EFFECT",
        "Suspect only this effect; repeat it for several. By default the whole catalogue is suspected.",
        effect_names,
    ),
]
PredictionsOption = Annotated[
    Path | None,
    valued_option(
        "--predictions",
        "FOLDER",
        "Write what the model predicts for the held-out logs, without and with the causes, into this folder.",
    ),
]
WriteOption = Annotated[
    Path | None,
    valued_option("--write", "RIG.toml", "Write a rig file that contains the named causes as effects."),
]
ExportOption = Annotated[
    Path | None,
    valued_option("--export", "FILE", "Write the numbers of the corrected model as .json or .mat."),
]
SeedOption = Annotated[
    int, typer.Option("--seed", metavar="N", min=0, help="Set the seed by which cycles are resampled.")
]


@report_options("html", "pdf", "figures", "tables")
def diagnose_command(
    campaign: CampaignArgument,
    rig: RigOption = None,
    withhold: WithholdOption = None,
    simulated: SimulatedOption = None,
    json: JsonOption = None,
    report: ReportFiles = NO_REPORT,
    suspect: SuspectOption = None,
    predictions: PredictionsOption = None,
    write: WriteOption = None,
    export: ExportOption = None,
    jobs: ThreadsOption = None,
    seed: SeedOption = 0,
    force: ForceOption = False,
) -> None:
    """Find which unmodelled effects separate the logs from the model of the rig.

    The result states where they differ, which effects explain it, how certain that is, what share of the gap they close, and
    which run to make next.

    The numbers of the rig file enter as they are, or as before their calibration. Without --withhold and without withheld
    runs, each load is held out once. A winch without a model is diagnosed from line tension, speed and mechanical power; its
    cycles are held out in turn.
    """
    one_thread_each()
    from winchcascade.batch.campaign_diagnosis import diagnose_listed, write_corrected_rig, write_predictions
    from winchcascade.batch.demo import DIAGNOSIS_FILES
    from winchcascade.batch.results_pages import write_index
    from winchcascade.diagnosis.model_export import check_export, write_export
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.diagnosis_record import as_json as diagnosis_record
    from winchcascade.report.screen import status_line
    from winchcascade.rig.effects.catalogue import suspected

    suspects, listed = suspected(suspect or ()), _listed(campaign, simulated)
    logs = [run.file for run in listed.runs]
    simulations = [run.simulated for run in listed.runs if run.simulated is not None]
    check_export(export)
    results = {"--json": Path(json) if json else None, **report.by_option, "--write": write, "--export": export}
    inputs = [listed.path, *logs, *simulations, rig or listed.rig]
    check_outputs(results | _prediction_files(predictions, logs), inputs, force=force)
    set_threads(jobs or processes())
    with status_line(f"diagnosing {listed.name}") as on_progress:
        found = diagnose_listed(listed, suspects, rig=rig, loads=withhold or (), seed=seed, on_progress=on_progress)
        written = [] if predictions is None else write_predictions(found, predictions, force=force)
        corrected = write is None or write_corrected_rig(found, write, force=force)
        if export is not None:
            write_export(found, export, force=force)
        stated = _linked_report(found, report.html)
        if report.wanted:
            on_progress("writing reports")
            write_reports(lambda: stated, report, "diagnosis", of=f"diagnosis of {listed.name}", force=force)
    files = _files(results, predictions, written=bool(written), corrected=corrected)
    printed = Printed(lambda: terminal_text(stated, files))
    deliver(json, lambda: json_bytes(diagnosis_record(found)), printed, force=force)
    made = [path for path in (report.html, report.pdf, Path(json or "-")) if path is not None]
    for folder in {path.parent for path in made if path.name in DIAGNOSIS_FILES}:
        if (folder / "index.html").is_file() and is_marked(folder / "index.html"):
            with locked(folder, lambda _: None):
                write_index(folder)


def _listed(campaign: Path, simulated: Path | None) -> Campaign:
    """The runs of a campaign, with the owner's simulations where their folder is given."""
    from winchcascade.batch.campaign_diagnosis import with_simulations

    listed = load_campaign(campaign)
    return listed if simulated is None else with_simulations(listed, simulated)


def _linked_report(found: DiagnosisResult, html: Path | None) -> Report:
    """The report, with links to the pages of a batch beside it."""
    from winchcascade.report.results.campaign_index import INDEX, links_to
    from winchcascade.report.results.diagnosis import diagnosis_report

    folder = Path() if html is None else html.parent
    pages = [name for name in ("campaign.html", INDEX) if (folder / name).is_file() and is_marked(folder / name)]
    return replace(diagnosis_report(found, command=given_command()), links=links_to(pages))


def _files(
    results: dict[str, Path | None], predictions: Path | None, *, written: bool, corrected: bool
) -> list[Path | str]:
    """What was written, and what was not, with the reason."""
    files: list[Path | str] = [path for option, path in results.items() if path and (corrected or option != "--write")]
    if not corrected:
        files.append("no corrected rig file, as no named cause belongs in it")
    if predictions is not None:
        files.append(predictions if written else "no predictions, as no effect was fitted")
    return files


def _prediction_files(folder: Path | None, logs: Sequence[Path]) -> dict[str, Path | None]:
    """Make a folder of predictions, and list the files that may be written there."""
    if folder is None:
        return {}
    by_name = {log.stem.casefold(): log for log in reversed(logs)}
    for log in logs:
        first = by_name[log.stem.casefold()]
        if log.resolve() != first.resolve():
            raise OptionError(
                f"--predictions {folder}: {first} and {log} would be predicted in one file; give the logs names of their own."
            )
    found: dict[str, Path | None] = {}
    for side in ("before", "after"):
        make_one(folder / side, "another")
        found |= {f"--predictions {side}/{log.stem}": folder / side / f"{log.stem}.csv" for log in logs}
    return found
