"""Run a batch: reduce what has changed, then write results, tables and reports of the campaign
into a folder.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

import msgspec
from msgspec.structs import replace

from winchcascade.batch.dataset import TABLES, write_dataset, write_workbook
from winchcascade.batch.plan import Plan, Work, result_key
from winchcascade.batch.reductions import (
    ENTRY,
    Made,
    campaign_record,
    reduce_log,
    with_findings_between,
)
from winchcascade.batch.results_pages import write_index
from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, put_in_place, scratch_folder, write_set
from winchcascade.core.jobs import Nobody, Watch, Workers
from winchcascade.core.store import (
    CAMPAIGN_FILES,
    CAMPAIGN_PAGE,
    CAMPAIGN_RECORD,
    CAMPAIGN_WORKBOOK,
    INDEX,
    LOG_FILES,
    Output,
    Present,
    digest_of,
    fingerprint,
    inside,
    locked,
    make_folder,
    make_one,
    state_of,
    with_digest,
)
from winchcascade.core.version import __version__
from winchcascade.reduction.campaign_record import CampaignRecord, campaign_json, read_campaign
from winchcascade.reduction.run_record import read_results

REPORTS = {"none": (), "html": ("html",), "all": ("html", "pdf")}
"""Reports that are written, by the choice of `--reports`."""


DATASET = tuple(f"dataset/{table}.parquet" for table in TABLES)
"""Files of the dataset, by their names in the folder of a batch."""


class Products(msgspec.Struct, frozen=True):
    """What is made of a campaign besides its dataset: "html" or "pdf" reports, a workbook;
    `command` is what was typed.
    """

    reports: tuple[str, ...] = ()
    workbook: bool = False
    command: str = ""


class Batch(msgspec.Struct, frozen=True):
    """What a batch came to: results by log in the order of the plan, faults by log, and how many
    were done already.

    `altered` are the files of an earlier call that did not match their digest and were made again.
    """

    folder: Path
    results: dict[str, Path]
    faults: dict[str, str]
    kept: int
    altered: tuple[str, ...] = ()
    summary: CampaignRecord = CampaignRecord("", "", ())


def run_batch(
    plan: Plan,
    out: Path,
    products: Products | None = None,
    *,
    workers: Workers | None = None,
    force: bool = False,
    watch: Watch | None = None,
) -> Batch:
    """Reduce every log of a plan into a folder, and put the campaign together.

    Each result is written as soon as it is made, the reports of a log before its JSON, so a call
    that is cut short at any point loses nothing that was finished. Of two calls on one folder the
    second waits.

    Parameters
    ----------
    products : what is made of every log and of the campaign besides the dataset; nothing by default
    workers : processes of this machine, one by default, or a Dask scheduler
    force : use a folder that holds something else too
    watch : called with how many logs are done already and how many are to be done, then with each
        as it is done

    Raises
    ------
    OutputError : the folder cannot be made or locked, holds something else, or holds a link
    OptionError : the scheduler cannot be reached, or no further process can be started
    """
    products, workers, watch = products or Products(), workers or Workers(), watch or Nobody()
    make_folder(out, ours=(out / "runs").is_dir(), what="a batch", force=force)
    with locked(out, watch.waiting):
        runs = inside(out, "runs")
        make_one(runs)
        there = {
            work.name: state_of(runs, result_of(work, products.reports))
            for work in plan.work
            if os.path.lexists(runs / f"{work.name}.json")  # else no log need be digested for it
        }
        todo = {work.name: work for work in plan.work if not there.get(work.name, Present()).kept}
        _check_own(out, todo, force=force)
        watch.begin(len(plan.work) - len(todo), len(todo))
        faults: dict[str, str] = {}
        work_on = partial(reduce_log, reports=products.reports, command=products.command)
        for name, outcome in workers.run(work_on, todo, watch):
            if outcome.value is not None:
                _write_result(runs, name, outcome.value)
                continue
            faults[name] = outcome.fault or ""
            # One that cannot be read now may count again.
            if outcome.rejected and fingerprint(todo[name].path):
                for ending in LOG_FILES:
                    (runs / f"{name}.{ending}").unlink(missing_ok=True)
        batch = Batch(
            folder=out,
            results={
                work.name: runs / f"{work.name}.json"
                for work in plan.work
                if work.name not in faults
            },
            faults={work.name: faults[work.name] for work in plan.work if work.name in faults},
            kept=len(plan.work) - len(todo),
            altered=tuple(f"runs/{name}" for found in there.values() for name in found.altered),
        )
        return _put_together(plan, batch, products)


def result_of(work: Work, reports: Sequence[str]) -> Output:
    """The record of a log and its reports, as they would be made now."""
    key = result_key(work, work.fingerprint)
    return Output(f"{work.name}.json", ENTRY, key, tuple(reports), f"{work.name}.")


def _check_own(out: Path, todo: Iterable[str], *, force: bool) -> None:
    """Reject, before any work, links, and files that this tool did not write."""
    there = {name.casefold() for name in os.listdir(out / "runs")}
    results = [
        name
        for log in todo
        for ending in LOG_FILES
        if (name := f"{log}.{ending}").casefold() in there
    ]
    for path in [
        inside(out, name)
        for name in (INDEX, *CAMPAIGN_FILES, *DATASET, *(f"runs/{name}" for name in results))
    ]:
        if path.exists():
            check_replaceable(path, force=force)


def _write_result(runs: Path, name: str, made: Made) -> None:
    """Write the files of one log, all whole before the first is replaced, and remove reports of
    another result.
    """
    files = made.reports | {"json": made.record}
    outdated = [runs / f"{name}.{ending}" for ending in LOG_FILES if ending not in files]
    write_set(
        {runs / f"{name}.{ending}": content for ending, content in files.items()}, without=outdated
    )


def _put_together(plan: Plan, batch: Batch, products: Products) -> Batch:
    """Write the files of the whole campaign: dataset, workbook, reports and last the record;
    nothing if nothing has changed.
    """
    out, reports = batch.folder, products.reports
    results = {f"runs/{path.name}": fingerprint(path) for path in batch.results.values()}
    logs = [(work.name, work.key, batch.faults.get(work.name)) for work in plan.work]
    key = digest_of(repr((plan.title, __version__, logs, sorted(results.items()))).encode())
    wanted = (
        *DATASET,
        *(f"campaign.{ending}" for ending in reports),
        *([CAMPAIGN_WORKBOOK] if products.workbook else []),
    )
    there = state_of(out, Output(CAMPAIGN_RECORD, "store", key, wanted))
    batch = replace(batch, altered=(*batch.altered, *there.altered))
    try:
        if there.kept:
            batch = replace(batch, summary=read_campaign(out / CAMPAIGN_RECORD))
        else:
            batch = replace(
                batch, summary=campaign_record(plan, read_results(batch.results), batch.faults, key)
            )
            others = {
                name: there.files[name]
                for name in CAMPAIGN_FILES
                if name in there.files and name not in wanted
            }
            _write_campaign(plan, batch, products, wanted, results | others)
        if (out / CAMPAIGN_PAGE).is_file() and not (there.kept and (out / INDEX).is_file()):
            write_index(out)
    except (OSError, OutputError) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise OutputError(
            f"{out}: the tables and reports of the campaign cannot be written ({why}); free some "
            f"space. "
            "The results of the logs are kept."
        ) from None
    return batch


def _write_campaign(
    plan: Plan, batch: Batch, products: Products, wanted: Sequence[str], digests: dict[str, str]
) -> None:
    """Make the files of a campaign in a scratch folder and put them in place together: a full disk
    leaves the earlier ones.

    Parameters
    ----------
    wanted : files to be made besides the record
    digests : of the files that stay
    """
    out, campaign = batch.folder, batch.summary
    (out / "dataset").mkdir(exist_ok=True)
    with scratch_folder(out) as made:
        records = with_findings_between(read_results(batch.results), campaign.between)
        write_dataset(
            records, made / "dataset", cascades=[work.settings.rig.cascade for work in plan.work]
        )
        if products.workbook:
            write_workbook(made / "dataset", made / CAMPAIGN_WORKBOOK)
        if products.reports:
            _write_reports(campaign, made, out, products)
        digests = digests | {name: fingerprint(made / name) for name in wanted}
        made_by = {"key": campaign.state, "files": digests}
        (made / CAMPAIGN_RECORD).write_bytes(with_digest(campaign_json(campaign), "store", made_by))
        outdated = [name for name in CAMPAIGN_FILES[1:] if name not in digests]
        outdated += [] if CAMPAIGN_PAGE in digests else [INDEX]
        put_in_place(
            {made / name: out / name for name in (*wanted, CAMPAIGN_RECORD)},
            without=[out / name for name in outdated],
        )


def _write_reports(campaign: CampaignRecord, made: Path, out: Path, products: Products) -> None:
    """Write the reports of the campaign into a scratch folder."""
    from winchcascade.report.render.report_files import publish
    from winchcascade.report.results.campaign import written_campaign
    from winchcascade.report.results.campaign_index import links_to

    report = written_campaign(campaign, out, command=products.command)
    paths = {ending: made / f"campaign.{ending}" for ending in products.reports}
    publish(
        replace(report, links=links_to([INDEX])),
        html=paths.get("html"),
        pdf=paths.get("pdf"),
        force=True,
    )
