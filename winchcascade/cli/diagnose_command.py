"""`winchcascade diagnose`: why logs and model differ."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from winchcascade.cli.options import EVALUATION, option, with_options
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present
from winchcascade.cli.progress import status_line
from winchcascade.core.campaign_file import Campaign, load_campaign
from winchcascade.core.errors import OptionError
from winchcascade.core.files import check_ending, is_marked
from winchcascade.core.jobs import use_threads
from winchcascade.core.store import CAMPAIGN_PAGE, DIAGNOSIS_FILES, INDEX, locked, make_one

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
    from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
    from winchcascade.report.content import Report


@with_options(
    "json",
    *REPORT,
    "write",
    "export",
    "predictions",
    "validation",
    seed=option(
        "--seed",
        "N",
        "Set the seed by which cycles are resampled; 0 by default.",
        EVALUATION,
        minimum=0,
    ),
    stages=option(
        "--stages",
        "",
        "Also fit laws of losses to what each stage gives beyond its model.",
        EVALUATION,
    ),
)
def diagnose_command(
    campaign: Path,
    rig: str | None = None,
    simulated: Path | None = None,
    withhold: list[float] | None = None,
    suspect: list[str] | None = None,
    seed: int = 0,
    stages: bool = False,
    threads: int | None = None,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Find which unmodelled effects separate the logs from the model of the rig.

    The result states where they differ, which effects explain it, how certain that is, what share
    of the gap they close, and which run to make next.

    The numbers of the rig file enter as they are, or as before their calibration. Without
    --withhold and without withheld runs, each load is held out once. Stages of a rig without a
    model are diagnosed from the powers at both ends; their cycles are held out in turn.
    """
    use_threads(threads)
    from winchcascade.batch.campaign_diagnosis import diagnose_listed
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.handover.model_export import check_export
    from winchcascade.diagnosis.stages.beside_model import beside_model
    from winchcascade.report.render.report_files import ENDINGS
    from winchcascade.report.results.diagnosis_record import as_json as diagnosis_record
    from winchcascade.rig.effects.catalogue import suspected

    suspects, listed = suspected(suspect or ()), _listed(campaign, simulated)
    logs = [run.file for run in listed.runs]
    simulations = [run.simulated for run in listed.runs if run.simulated is not None]
    check_export(outputs["export"])
    check_ending(outputs["validation"], ENDINGS, "--validation")
    predicted = _prediction_files(outputs["predictions"], logs)
    outputs.without("predictions").check(
        [listed.path, *logs, *simulations, rig or listed.rig], predicted
    )
    with status_line(f"diagnosing {listed.name}") as on_progress:
        found = diagnose_listed(
            listed, suspects, rig=rig, loads=withhold or (), seed=seed, on_progress=on_progress
        )
        if stages and isinstance(found, ModelDiagnosis):
            found = beside_model(found, on_progress)
        refused = _refused(found, outputs)
        outputs = outputs.without(*refused)
        lacking = _write_files(found, outputs)
    outputs = outputs.without(*lacking)
    _write_validation(found, outputs)
    present(
        lambda: _linked_report(found, outputs["html"]),
        outputs,
        record=lambda: diagnosis_record(found),
        name="diagnosis",
        notes=list(lacking.values()),
    )
    _list_in_results(outputs)
    for reason in refused.values():  # the diagnosis itself is stated and written first
        raise reason


def _refused(found: DiagnosisResult, outputs: Outputs) -> dict[str, OptionError]:
    """A corrected rig or model of an unexplained gap, unless that is forced, each with the
    reason why it is not written.
    """
    reasons = {}
    for name in ("write", "export"):
        if outputs[name] is not None:
            try:
                found.judgement.check(f"--{name} {outputs[name]}", force=outputs.force)
            except OptionError as reason:
                reasons[name] = reason
    return reasons


def _listed(campaign: Path, simulated: Path | None) -> Campaign:
    """The runs of a campaign, with the owner's simulations where their folder is given."""
    from winchcascade.batch.campaign_diagnosis import with_simulations

    listed = load_campaign(campaign)
    return listed if simulated is None else with_simulations(listed, simulated)


def _write_files(found: ModelDiagnosis | StageDiagnosis, outputs: Outputs) -> dict[str, str]:
    """Write predictions, corrected rig and exported model as far as they are wanted; what there
    is none of, with the reason.
    """
    from winchcascade.batch.campaign_diagnosis import write_corrected_rig, write_predictions
    from winchcascade.diagnosis.handover.model_export import write_export

    predictions, write, export = outputs["predictions"], outputs["write"], outputs["export"]
    lacking = {}
    if predictions is not None and not write_predictions(found, predictions, force=outputs.force):
        lacking["predictions"] = "no predictions, as no effect was fitted"
    if write is not None and not write_corrected_rig(found, write, force=outputs.force):
        lacking["write"] = "no corrected rig file, as no named cause belongs in it"
    if export is not None:
        write_export(found, export, force=outputs.force)
    return lacking


def _write_validation(found: DiagnosisResult, outputs: Outputs) -> None:
    """Write the validation as a page or a PDF of its own where it is wanted.

    Raises
    ------
    OptionError : a rig without a model
    """
    path = outputs["validation"]
    if path is None:
        return
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.report.render.report_files import publish
    from winchcascade.report.results.validation_report import validation_report

    if not isinstance(found, ModelDiagnosis):
        raise OptionError(
            f"--validation {path}: no model can be made of rig {found.rig.name}; leave "
            f"--validation out."
        )
    report = validation_report(found, command=given_command())
    publish(report, **{path.suffix.casefold()[1:]: path}, force=outputs.force)


def _linked_report(found: DiagnosisResult, html: Path | None) -> Report:
    """The report, with links to the pages of a batch beside it."""
    from winchcascade.report.results.campaign_index import links_to
    from winchcascade.report.results.diagnosis import diagnosis_report

    folder = Path() if html is None else html.parent
    pages = [
        name
        for name in (CAMPAIGN_PAGE, INDEX)
        if (folder / name).is_file() and is_marked(folder / name)
    ]
    return replace(diagnosis_report(found, command=given_command()), links=links_to(pages))


def _list_in_results(outputs: Outputs) -> None:
    """List a diagnosis on the pages of the folders of results into which it was written."""
    from winchcascade.batch.results_pages import write_index

    for folder in {path.parent for path in outputs.files if path.name in DIAGNOSIS_FILES}:
        page = folder / INDEX
        if page.is_file() and is_marked(page):
            with locked(folder, lambda _: None):
                write_index(folder)


def _prediction_files(folder: Path | None, logs: Sequence[Path]) -> dict[str, Path]:
    """Make a folder of predictions, and list the files that may be written there."""
    if folder is None:
        return {}
    by_name = {log.stem.casefold(): log for log in reversed(logs)}
    for log in logs:
        first = by_name[log.stem.casefold()]
        if log.resolve() != first.resolve():
            raise OptionError(
                f"--predictions {folder}: {first} and {log} would be predicted in one file; give "
                f"the logs names of their own."
            )
    for side in ("before", "after"):
        make_one(folder / side)
    return {
        f"predictions {side}/{log.stem}": folder / side / f"{log.stem}.csv"
        for side in ("before", "after")
        for log in logs
    }
