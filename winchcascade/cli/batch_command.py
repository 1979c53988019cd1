"""`winchcascade batch` and `demo`: whole campaigns."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

import msgspec
import typer
from msgspec.structs import replace

from winchcascade.cli.options import INPUT, OUTPUTS, check_load, option, with_options
from winchcascade.cli.outputs import NO_OUTPUTS, Outputs, given_command, present, show
from winchcascade.cli.progress import Progress, status_line
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import Workers, processes, use_threads
from winchcascade.core.plain_text import first_of
from winchcascade.core.store import (
    CAMPAIGN_FILES,
    CAMPAIGN_PAGE,
    CAMPAIGN_RECORD,
    DIAGNOSIS_RECORD,
    INDEX,
    state_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.batch.plan import Plan
    from winchcascade.batch.run_batch import Batch, Products
    from winchcascade.report.content import Report

MAX_ALTERED = 5
"""Altered files that are named."""


@with_options(
    "figures",
    "tables",
    "loss_map",
    load_ohm=option(
        "--load-ohm",
        "OHM",
        "Set the load of the logs that no campaign lists, in ohms; inf is an open circuit.",
        INPUT,
    ),
)
def batch_command(
    targets: list[str],
    out: Path,
    rig: str | None = None,
    load_ohm: float | None = None,
    window: str | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    reports: str = "html",
    excel: bool = False,
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Reduce a whole campaign: every log, the tables of all logs, and a report.

    A second call reduces only logs of which the content, the options or the version changed. The
    exit code is 1 if a log failed.
    """
    from winchcascade.batch.plan import lacks_campaign, make_plan
    from winchcascade.batch.run_batch import REPORTS, Products, run_batch
    from winchcascade.reduction.reduce import window_rule

    if reports not in REPORTS:
        raise OptionError(f"--reports {reports}: expected none, html or all.")
    check_load(load_ohm)
    outputs.check(targets)
    rule = None if window is None else window_rule(window)
    plan = make_plan(targets, rig=rig, window=rule, load_ohm=load_ohm)
    if outputs["loss_map"] is not None:
        from winchcascade.batch.campaign_loss_map import check_one_map

        check_one_map(plan, outputs["loss_map"])
    products, workers = (
        Products(REPORTS[reports], excel, given_command()),
        Workers(jobs or processes(), scheduler),
    )
    with Progress(plan.title, keeps=out) as watch:
        batch = run_batch(plan, out, products, workers=workers, force=outputs.force, watch=watch)
    no_campaign = [] if load_ohm else list(filter(lacks_campaign, targets))
    _present(batch, outputs.without("loss_map"), drafted_by=no_campaign)
    if outputs["loss_map"] is not None:
        _present_loss_map(plan, batch, products, outputs["loss_map"], force=outputs.force)
    raise typer.Exit(1 if batch.faults else 0)


def _present_loss_map(
    plan: Plan, batch: Batch, products: Products, path: Path, *, force: bool
) -> None:
    """Write the loss map of a campaign with its reports into the folder of the batch, and print
    it.
    """
    from winchcascade.batch.campaign_loss_map import campaign_loss_map
    from winchcascade.batch.results_pages import write_index
    from winchcascade.report.results.campaign_index import links_to
    from winchcascade.report.results.loss_map import campaign_loss_map_report, write_loss_map

    found = campaign_loss_map(plan, batch.results)
    write_loss_map(found, path, plan.title, force=force)
    origins = [item.settings.origin for item in plan.work if item.name in batch.results]
    pages = {ending: batch.folder / f"loss_map.{ending}" for ending in products.reports}
    make = partial(
        campaign_loss_map_report,
        found,
        plan.title,
        origins,
        links_to([CAMPAIGN_PAGE, INDEX]),
        command=products.command,
    )
    show("\n")
    present(make, Outputs({"loss_map": path} | pages, force), name="loss map")
    if pages:
        write_index(batch.folder)


def _present(
    batch: Batch, outputs: Outputs = NO_OUTPUTS, *, drafted_by: Sequence[str] = ()
) -> None:
    """Write the report of a campaign where it is wanted, and print what its logs give and what was
    written.

    Parameters
    ----------
    drafted_by : the folders that have no campaign file
    """
    from winchcascade.report.content import Note, Report
    from winchcascade.report.results.campaign import fault_notes, written_campaign

    named = first_of(batch.altered, MAX_ALTERED)
    notes = [
        Note(
            f"{batch.kept} of {len(batch.results)} logs reduced by an earlier call."
            if batch.kept
            else "",
            "Kept",
        ),
        Note(
            f"made again, as its digest did not match: {named}" if named else "", "Altered", "warn"
        ),
    ]
    notes += [
        Note(
            f"{folder} has no campaign.toml with the loads; `winchcascade init {quote(folder)}` "
            f"drafts one.",
            "Campaign",
            "warn",
        )
        for folder in drafted_by
    ]
    faults = fault_notes(batch.summary.failed)

    def make() -> Report:
        report = written_campaign(batch.summary, batch.folder, command=given_command())
        return replace(report, points=[*report.points, *notes])

    present(
        make,
        outputs,
        name="campaign",
        failed=(lambda: Report("Campaign", batch.summary.title, points=faults)) if faults else None,
        notes=_files_in(batch.folder),
    )


def _files_in(folder: Path) -> list[Path]:
    """What the folder of a batch holds for a reader."""
    names = (INDEX, *CAMPAIGN_FILES[1:], CAMPAIGN_RECORD, "dataset", "runs")
    return [folder / name for name in names if (folder / name).exists()]


@with_options(
    out=option(
        "--out",
        "FOLDER",
        "Write campaign and results into this folder; winchcascade-demo by default.",
        OUTPUTS,
    )
)
def demo_command(
    out: Path = Path("winchcascade-demo"), jobs: int | None = None, force: bool = False
) -> None:
    """Reduce and diagnose the packaged campaign, simulated crane trials at seven loads, and
    write all reports.
    """
    use_threads(jobs)
    from winchcascade.batch.demo import (
        copy_campaign,
        diagnosis_of,
        diagnosis_output,
        write_diagnosis,
    )
    from winchcascade.batch.plan import make_plan
    from winchcascade.batch.run_batch import REPORTS, Products, run_batch
    from winchcascade.report.content import Report
    from winchcascade.report.results.diagnosis_words import diagnosis_note

    campaign, results = copy_campaign(out / "campaign", force=force), out / "results"
    plan = make_plan([str(campaign)])
    products = Products(REPORTS["all"], workbook=True, command=given_command())
    diagnosis = diagnosis_output(campaign)
    kept = not force and state_of(results, diagnosis).kept
    workers = Workers(jobs or processes())
    with Progress(plan.title, keeps=out) as watch:
        batch = run_batch(plan, results, products, workers=workers, force=force, watch=watch)
    _present(batch)
    if not kept:
        with status_line(f"diagnosing {plan.title}") as on_progress:
            found_files = diagnosis_of(campaign, products.command)
            write_diagnosis(results, found_files, force=force, on_progress=on_progress)
    found = msgspec.json.decode((results / DIAGNOSIS_RECORD).read_bytes(), type=dict[str, object])
    stated = Report("Diagnosis", "Diagnosis", points=[diagnosis_note(found)])
    present(
        lambda: stated,
        NO_OUTPUTS,
        notes=[results / name for name in (*diagnosis.files, diagnosis.record)],
    )
    raise typer.Exit(1 if batch.faults else 0)
