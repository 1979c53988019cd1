"""Run a batch: reduce each log once, keep earlier results, and write the tables and reports of the campaign."""

from __future__ import annotations

import os
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
from msgspec import UNSET, UnsetType
from msgspec.structs import asdict, replace

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.dataset import TABLES, write_dataset, write_workbook
from winchcascade.batch.plan import Plan, Work
from winchcascade.batch.results_pages import KeptCampaign, diagnosis_beside
from winchcascade.core.addresses import fingerprint, local_copy
from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, put_in_place, write_set
from winchcascade.core.jobs import Nobody, Watch, Workers
from winchcascade.core.plain_text import one_line
from winchcascade.core.scratch import clear, scratch_folder
from winchcascade.core.store import (
    State,
    altered,
    check_links,
    digest_of,
    inside,
    locked,
    make_folder,
    make_one,
    marked,
    with_digest,
)
from winchcascade.core.version import __version__
from winchcascade.ingest.read import read_by
from winchcascade.reduction.campaign_json import campaign_json
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    FailedLog,
    LogSummary,
    campaign_from,
    log_summary,
)
from winchcascade.reduction.efficiency_between_runs import LogEfficiency
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.reduction.run_record import CampaignWavesRecord, RunRecord
from winchcascade.report.records import read_results, reduction_record

ENDINGS = ("html", "pdf", "json")
"""Files of one log; a JSON means that the others are there."""

REPORTS = {"none": (), "html": ("html",), "all": ("html", "pdf")}
"""Reports that are written, by the choice of `--reports`."""

CAMPAIGN_FILES = ("campaign.json", "campaign.html", "campaign.pdf", "campaign.xlsx", "index.html")
"""Files of a whole campaign, beside its dataset."""

DATASET = tuple(f"dataset/{table}.parquet" for table in TABLES)
"""Files of the dataset, by their names in the folder of a batch."""

_DRAWING = threading.Lock()
"""matplotlib's settings are global, and a worker of a cluster may have several threads."""


class Order(msgspec.Struct, frozen=True):
    """One log, the reports that are wanted of it, and the folder to write to; without one the results come back.

    `beside` are files of the results folder, besides those of the campaign, that the reports lead to.
    """

    work: Work
    reports: tuple[str, ...] = ()
    folder: str | None = None
    command: str = ""
    beside: tuple[str, ...] = ()


class Brief(msgspec.Struct, frozen=True):
    """What a campaign needs of the result of one log: digest of its JSON, its summary and efficiencies, and whether it has
    waves."""

    digest: str
    summary: LogSummary
    efficiency: LogEfficiency | None
    waves: bool


class Made(msgspec.Struct, frozen=True):
    """Files made of one log, by their ending, empty where they are written already, and what the campaign needs of them."""

    name: str
    files: dict[str, bytes]
    brief: Brief


def reduce_log(order: Order) -> Made:
    """Reduce one log and make its files: reports first, the JSON last, so that a JSON means that all files are there."""
    work, settings = order.work, order.work.settings
    with local_copy(work.address) as path:
        run = replace(read_by(path, settings), path=one_line(work.address))
    reduction = reduce(run)
    require_payouts(reduction)
    found = uncertainty(reduction)
    whole = reduction_record(reduction, found)
    record = {k: part for k, part in asdict(whole).items() if part is not UNSET}
    files: dict[str, bytes] = {}
    if order.reports:
        from winchcascade.report.model_section import modelled
        from winchcascade.report.render.page import page_text
        from winchcascade.report.render.pdf import pdf_bytes
        from winchcascade.report.results.drawn_reduction import drawn_report
        from winchcascade.report.results_index import INDEX, stated_links

        model = modelled(reduction)
        record["model"] = model.account  # the report of the campaign draws it
        with _DRAWING:
            report = drawn_report(reduction, found, model=model, command=order.command)
            report = replace(report, links=stated_links(["campaign.html", *order.beside, INDEX], above=True))
            files |= {"html": page_text(report).encode()} if "html" in order.reports else {}
            files |= {"pdf": pdf_bytes(report)} if "pdf" in order.reports else {}
    digests = {ending: digest_of(content) for ending, content in files.items()}
    made_by = {"key": work.key, "reports": list(order.reports), "files": digests}
    made_by |= {"beside": list(order.beside)} if order.beside else {}
    files["json"] = with_digest(record, "batch", made_by)
    made = Made(work.name, files, _brief(work, whole, digest_of(files["json"])))
    if order.folder is None:
        return made
    write_made(made, Path(order.folder))
    return replace(made, files={})


def _brief(work: Work, record: RunRecord, digest: str) -> Brief:
    summary = log_summary(work.name, one_line(work.address), record)
    return Brief(digest, summary, log_efficiency(work.name, record), record.waves is not UNSET)


def write_made(made: Made, folder: Path) -> None:
    """Write the files of one log, all whole before the first is replaced, and remove reports of another result."""
    if made.files:
        outdated = [folder / f"{made.name}.{ending}" for ending in ENDINGS if ending not in made.files]
        write_set({folder / f"{made.name}.{e}": content for e, content in made.files.items()}, without=outdated)


class Products(msgspec.Struct, frozen=True):
    """What is made of a campaign besides its dataset: "html" or "pdf" reports, a workbook; `command` is what was typed.

    `beside` are files that the caller will write into the same folder, to which the pages lead too.
    """

    reports: tuple[str, ...] = ()
    workbook: bool = False
    command: str = ""
    beside: tuple[str, ...] = ()


class Batch(msgspec.Struct, frozen=True):
    """What a batch came to: results by log in the order of the plan, faults by log, and how many were done already.

    `altered` are the files of an earlier call that did not match their digest and were made again.
    """

    folder: Path
    results: dict[str, Path]
    faults: dict[str, str]
    kept: int
    altered: tuple[str, ...] = ()
    summary: CampaignRecord = CampaignRecord("", "", ())


class _KeptLog(msgspec.Struct):
    sha256: str


class _KeptBatch(msgspec.Struct):
    key: str
    reports: list[str]
    files: dict[str, str] = {}
    beside: list[str] = []


class _Kept(msgspec.Struct):
    """How an earlier call made the result of a log."""

    log: _KeptLog
    batch: _KeptBatch


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

    Each result is written as soon as it is made, the reports of a log before its JSON, so a call that is cut short at any
    point loses nothing that was finished. Of two calls on one folder the second waits.

    Parameters
    ----------
    products : what is made of every log and of the campaign besides the dataset; nothing by default
    workers : processes of this machine, one by default, or a Dask scheduler
    force : use a folder that holds something else too
    watch : called with how many logs are done already and how many are to be done, then with each as it is done

    Raises
    ------
    OutputError : the folder cannot be made or locked, holds something else, or holds a link
    OptionError : the scheduler cannot be reached, or no further process can be started
    """
    products, workers, watch = products or Products(), workers or Workers(), watch or Nobody()
    make_folder(out, ours=(out / "runs").is_dir(), what="a batch", force=force)
    with locked(out, watch.waiting):
        check_links(out, ["runs", "dataset", *CAMPAIGN_FILES, *DATASET])
        runs = out / "runs"
        make_one(runs, "another")
        for place in (out, runs, out / "dataset"):  # what calls left that were killed
            clear(place)
        products = replace(products, beside=products.beside or diagnosis_beside(out))
        states = {work.name: state_of(work, runs, products.reports, products.beside) for work in plan.work}
        todo = [work for work in plan.work if states[work.name] != "kept"]
        _check_own(out, todo, force=force)
        watch.begin(len(plan.work) - len(todo), len(todo))
        faults: dict[str, str] = {}
        briefs: dict[str, Brief] = {}
        folder = None if workers.scheduler is not None else str(runs)
        orders = {work.name: Order(work, products.reports, folder, products.command, products.beside) for work in todo}
        for name, outcome in workers.run(reduce_log, orders, watch):
            if outcome.value is not None:
                write_made(outcome.value, runs)
                briefs[name] = outcome.value.brief
                continue
            faults[name] = outcome.fault or ""
            if outcome.rejected and not _is_of(orders[name].work, runs):
                for ending in ENDINGS:
                    (runs / f"{name}.{ending}").unlink(missing_ok=True)
        batch = Batch(
            folder=out,
            results={work.name: runs / f"{work.name}.json" for work in plan.work if work.name not in faults},
            faults={work.name: faults[work.name] for work in plan.work if work.name in faults},
            kept=len(plan.work) - len(todo),
            altered=tuple(f"runs/{name}.json" for name, state in states.items() if state == "altered"),
        )
        return _put_together(plan, batch, products, briefs)


def _check_own(out: Path, todo: Sequence[Work], *, force: bool) -> None:
    """Reject, before any work, links, and files that this tool did not write."""
    there = {name.casefold() for name in os.listdir(out / "runs")}
    results = [name for work in todo for ending in ENDINGS if (name := f"{work.name}.{ending}").casefold() in there]
    for path in [inside(out, name) for name in (*CAMPAIGN_FILES, *DATASET, *(f"runs/{name}" for name in results))]:
        if path.exists():
            check_replaceable(path, force=force)


def state_of(work: Work, runs: Path, reports: Sequence[str], beside: Sequence[str] = ()) -> State:
    """Whether an earlier call made all of a log's files from the same content with the same options."""
    kept = marked(inside(runs, f"{work.name}.json"), _Kept)
    if not isinstance(kept, _Kept):
        return kept
    if kept.batch.key != work.key or not set(reports) <= set(kept.batch.reports):
        return "other"
    if reports and list(beside) != kept.batch.beside:
        return "other"
    if not all((runs / f"{work.name}.{ending}").is_file() for ending in reports):
        return "other"
    if altered(runs, {f"{work.name}.{ending}": kept.batch.files.get(ending, "") for ending in reports}):
        return "altered"
    return "kept" if kept.log.sha256 == fingerprint(work.address) else "other"


def _is_of(work: Work, runs: Path) -> bool:
    """Whether the result that is there is of the log as it is now, or the log cannot be read; then it may count again."""
    now = fingerprint(work.address)
    kept = marked(runs / f"{work.name}.json", _Kept)
    return not now or (isinstance(kept, _Kept) and kept.log.sha256 == now)


def _put_together(plan: Plan, batch: Batch, products: Products, briefs: Mapping[str, Brief]) -> Batch:
    """Write the files of the whole campaign: dataset, workbook, report and last the summary; nothing if nothing has changed.

    All are made in a scratch folder and put in place together, so that a disk that is full leaves the earlier ones.

    Parameters
    ----------
    briefs : of the logs that this call has reduced
    """
    out, reports = batch.folder, products.reports
    digests = {
        f"runs/{path.name}": briefs[name].digest if name in briefs else digest_of(path.read_bytes())
        for name, path in batch.results.items()
    }
    state = _state(plan, batch, digests, products.beside)
    wanted = [*DATASET, *(f"campaign.{e}" for e in reports), *(["campaign.xlsx"] if products.workbook else [])]
    wanted += ["index.html"] if "html" in reports else []
    kept = marked(out / "campaign.json", KeptCampaign)
    changed = ["campaign.json"] if kept == "altered" else []
    stay: dict[str, str] = {}
    if isinstance(kept, KeptCampaign) and kept.state == state:
        known = kept.store.files
        lost = altered(out, known)
        changed = [name for name in lost if (out / name).exists()]
        if not lost and set(wanted) <= set(known):
            record = msgspec.json.decode((out / "campaign.json").read_bytes(), type=dict[str, object])
            return replace(batch, summary=campaign_from(record))
        stay = {name: known[name] for name in CAMPAIGN_FILES if name in known and name not in [*lost, *wanted]}
    campaign = campaign_record(plan, batch, state, briefs)
    try:
        (out / "dataset").mkdir(exist_ok=True)
        with scratch_folder(out) as made:
            cascades = [work.settings.rig.cascade for work in plan.work]
            write_dataset(batch.results.values(), made / "dataset", between=campaign.between, cascades=cascades)
            if products.workbook:
                write_workbook(made / "dataset", made / "campaign.xlsx")
            if reports:
                _write_pages(campaign, made, out, products, wanted)
            digests |= stay | {name: digest_of((made / name).read_bytes()) for name in wanted}
            content = with_digest(campaign_json(campaign), "store", {"files": digests})
            (made / "campaign.json").write_bytes(content)
            outdated = [out / name for name in CAMPAIGN_FILES[1:] if name not in digests]
            put_in_place({made / name: out / name for name in [*wanted, "campaign.json"]}, without=outdated)
    except (OSError, OutputError) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise OutputError(
            f"{out}: the tables and reports of the campaign cannot be written ({why}); free some space. "
            "The results of the logs are kept."
        ) from None
    return replace(batch, altered=(*batch.altered, *changed), summary=campaign)


def _write_pages(campaign: CampaignRecord, made: Path, out: Path, products: Products, wanted: Sequence[str]) -> None:
    """Write the reports of the campaign, and the page that lists what the folder holds, into a scratch folder."""
    from winchcascade.report.campaign import make_campaign_report
    from winchcascade.report.publish import publish
    from winchcascade.report.results_index import INDEX, links_to, results_index

    reports, files = products.reports, [*wanted, "campaign.json", *products.beside]
    report = make_campaign_report(campaign, made, results=out, command=products.command)
    report = replace(report, links=links_to([name for name in files if name != "campaign.html"]))
    html, pdf = (made / f"campaign.{e}" if e in reports else None for e in ("html", "pdf"))
    publish(report, html=html, pdf=pdf, force=True)
    if html is not None:
        publish(results_index(campaign, files, [*reports, "json"]), html=made / INDEX, force=True)


def _state(plan: Plan, batch: Batch, digests: Mapping[str, str], beside: Sequence[str]) -> str:
    """Digest of everything that the files of the whole campaign depend on."""
    logs = [(w.name, w.key, batch.faults.get(w.name)) for w in plan.work]
    return digest_of(repr((plan.title, __version__, logs, sorted(digests.items()), beside)).encode())


def campaign_record(plan: Plan, batch: Batch, state: str, briefs: Mapping[str, Brief]) -> CampaignRecord:
    """Put the results of a batch into the record of its campaign, with findings of single logs beside the others.

    Parameters
    ----------
    briefs : of the logs that this call has reduced; the other results are read
    """
    logs: dict[str, LogSummary] = {}
    with_waves = False
    efficiencies = []
    for work in plan.work:
        if work.name in batch.results:
            brief = briefs.get(work.name)
            if brief is None:
                content = batch.results[work.name].read_bytes()
                brief = _brief(work, msgspec.json.decode(content, type=RunRecord), digest_of(content))
            logs[work.name] = brief.summary
            efficiencies.append(brief.efficiency)
            with_waves = with_waves or brief.waves
    between = tuple(findings_between(efficiencies))
    for name, finding in between:
        run = logs[name]
        kinds = tuple(sorted({*run.findings, finding.kind}))
        logs[name] = replace(run, findings=kinds, finding_count=run.finding_count + 1)
    runs = tuple(
        logs.get(work.name) or FailedLog(work.name, one_line(work.address), one_line(batch.faults[work.name]))
        for work in plan.work
    )
    waves = _waves(batch.results) if with_waves else UNSET
    return CampaignRecord(one_line(plan.title), state, runs, between, waves)


def _waves(results: Mapping[str, Path]) -> CampaignWavesRecord | UnsetType:
    """The waves of all logs together."""
    from winchcascade.reduction.wave_record import campaign_waves, campaign_waves_record

    found = campaign_waves(read_results(results))
    return UNSET if found is None else campaign_waves_record(found)
