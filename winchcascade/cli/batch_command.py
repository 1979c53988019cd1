"""`winchcascade batch` and `demo`: whole campaigns."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from msgspec.structs import replace

from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JobsOption,
    LossMapOption,
    RigOption,
    SchedulerOption,
    WindowOption,
    report_choices,
    report_options,
    valued_option,
)
from winchcascade.cli.outputs import check_outputs, given_command, show, write_reports
from winchcascade.core.errors import OptionError
from winchcascade.core.jobs import Workers, one_thread_each, processes, run_behind
from winchcascade.core.store import present
from winchcascade.report.report_files import ReportFiles

if TYPE_CHECKING:
    from winchcascade.batch.run_batch import Batch
    from winchcascade.report.content import Report

MAX_ALTERED = 5
"""Altered files that are named."""

TargetsArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="TARGET...",
        help="The logs: a campaign.toml, a folder, a pattern, or single logs.",
        show_default=False,
    ),
]
OutOption = Annotated[
    Path,
    valued_option(
        "--out", "FOLDER", "Write the results into this folder. A second call keeps the results that are still valid."
    ),
]
ReportsOption = Annotated[
    str,
    valued_option(
        "--reports",
        "none|html|all",
        "Write reports of each log and of the campaign: none, html (pages), or all (pages and PDF).",
        report_choices,
    ),
]


@report_options("figures", "tables")
def batch_command(
    targets: TargetsArgument,
    out: OutOption,
    jobs: JobsOption = None,
    scheduler: SchedulerOption = None,
    reports: ReportsOption = "html",
    excel: Annotated[bool, typer.Option("--excel", help="Also write the tables as an Excel workbook.")] = False,
    rig: RigOption = None,
    window: WindowOption = None,
    loss_map: LossMapOption = None,
    report: ReportFiles = NO_REPORT,
    force: ForceOption = False,
) -> None:
    """Reduce a whole campaign: every log, the tables of all logs, and a report.

    A second call reduces only logs of which the content, the options or the version changed. The exit code is 1 if a log
    failed.
    """
    from winchcascade.batch.plan import make_plan
    from winchcascade.batch.run_batch import REPORTS, Products, run_batch
    from winchcascade.reduction.reduce import window_rule
    from winchcascade.report.screen import Progress

    if reports not in REPORTS:
        raise OptionError(f"--reports {reports}: expected none, html or all.")
    check_outputs({"--loss-map": loss_map} | report.by_option, targets, force=force)
    plan = make_plan(targets, rig=rig, window=None if window is None else window_rule(window))
    if loss_map is not None:
        from winchcascade.batch.campaign_loss_map import check_one_map

        check_one_map(plan, loss_map)
    products, workers = Products(REPORTS[reports], excel, given_command()), Workers(jobs or processes(), scheduler)
    with Progress(plan.title) as watch:
        batch = run_batch(plan, out, products, workers=workers, force=force, watch=watch)

    def make() -> Report:
        from winchcascade.report.results.drawn_campaign import written_campaign

        return written_campaign(batch.summary, out, command=products.command)

    write_reports(make, report, "campaign", of=f"campaign {plan.title}", force=force)
    _show(batch, [path for path in report.by_option.values() if path is not None])
    if loss_map is not None:
        from winchcascade.batch.campaign_loss_map import write_campaign_loss_map

        show(write_campaign_loss_map(plan, batch, products, loss_map, workers=workers, force=force))
    raise typer.Exit(1 if batch.faults else 0)


def _show(batch: Batch, files: Sequence[Path]) -> None:
    """Print what the logs of a campaign give, and what was written."""
    from winchcascade.report.content import Note
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.campaign import campaign_report, fault_notes

    notes = [Note(f"{batch.kept} logs are kept from an earlier call.", "Kept")] if batch.kept else []
    if batch.altered:
        more = f" and {len(batch.altered) - MAX_ALTERED} more" if len(batch.altered) > MAX_ALTERED else ""
        text = f"made again, as its digest did not match: {', '.join(batch.altered[:MAX_ALTERED])}{more}"
        notes.append(Note(text, "Altered", "warn"))
    stated = campaign_report(batch.summary)
    text = terminal_text(
        replace(stated, points=[*stated.points, *notes]), list(dict.fromkeys([*_files_in(batch.folder), *files]))
    )
    failures = "".join(f"failed: {note.text}\n" for note in fault_notes(batch.summary.failed))
    show(text, failures=failures, flush=True)


def _files_in(folder: Path) -> list[Path]:
    """What the folder of a batch holds for a reader."""
    names = ("index.html", "campaign.html", "campaign.pdf", "campaign.xlsx", "campaign.json", "dataset", "runs")
    return [folder / name for name in names if (folder / name).exists()]


def demo_command(
    out: Annotated[Path, valued_option("--out", "FOLDER", "Write campaign and results into this folder.")] = Path(
        "winchcascade-demo"
    ),
    jobs: JobsOption = None,
    force: ForceOption = False,
) -> None:
    """Reduce and diagnose the packaged campaign, simulated crane trials at seven loads, and write all reports."""
    one_thread_each()
    from winchcascade.batch.demo import DIAGNOSIS_FILES, copy_campaign, diagnosis_of, diagnosis_output, write_diagnosis
    from winchcascade.batch.plan import make_plan
    from winchcascade.batch.run_batch import REPORTS, Products, run_batch
    from winchcascade.report.results.diagnosis_lines import diagnosis_lines
    from winchcascade.report.screen import Progress, status_line

    campaign, results, count = copy_campaign(out / "campaign", force=force), out / "results", jobs or processes()
    plan = make_plan([str(campaign)])
    products = Products(REPORTS["all"], workbook=True, command=given_command())
    diagnosis = partial(diagnosis_of, campaign, products.command, count)
    kept = not force and present(results, diagnosis_output(campaign)).kept
    with run_behind(diagnosis, processes=1 if kept else count) as diagnosed:  # beside the batch, which takes less time
        with Progress(plan.title) as watch:
            batch = run_batch(plan, results, products, workers=Workers(max(count - 1, 1)), force=force, watch=watch)
        _show(batch, [])
        with status_line(f"diagnosing {plan.title}") as on_progress:
            if not kept:
                write_diagnosis(results, diagnosed(), force=force, on_progress=on_progress)
    found = msgspec.json.decode((results / "diagnosis.json").read_bytes(), type=dict[str, object])
    show(diagnosis_lines(found, [results / name for name in DIAGNOSIS_FILES]))
    raise typer.Exit(1 if batch.faults else 0)
