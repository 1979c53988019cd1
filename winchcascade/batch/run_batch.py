"""What is done to one log of a batch, wherever it is done."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.dataset import TABLES, write_dataset, write_workbook
from winchcascade.batch.plan import Work
from winchcascade.core.addresses import fingerprint, local_copy
from winchcascade.core.campaign_file import joint_origin, origin_from, origin_record
from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, put_in_place, readable, write_set
from winchcascade.core.jobs import (
    Nobody,
    Watch,
    Workers,
)
from winchcascade.core.scratch import clear, scratch_folder
from winchcascade.core.store import (
    Digest,
    State,
    altered,
    check_links,
    digest_in,
    digest_of,
    inside,
    locked,
    make_folder,
    make_one,
    marked,
    with_digest,
)
from winchcascade.core.version import __version__
from winchcascade.ingest.read import read_run
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.report.campaign_tables import window_rules
from winchcascade.report.records import FindingRecord, RunRecord, reduction_record

if TYPE_CHECKING:
    from winchcascade.batch.plan import Plan
    from winchcascade.reduction.efficiency_between_runs import LogEfficiency


ENDINGS = ("html", "pdf", "json")
"""Files of one log; the JSON tells that the others are there."""

_DRAWING = threading.Lock()
"""matplotlib's settings are global, and a worker of a cluster may have several threads."""


class Order(msgspec.Struct, frozen=True):
    """One log, the reports that are wanted of it, and the folder to write to; without one the results come back."""

    work: Work
    reports: tuple[str, ...] = ()
    folder: str | None = None
    command: str = ""


class Made(msgspec.Struct, frozen=True):
    """Files made of one log, by their ending; empty where they are written already."""

    name: str
    files: dict[str, bytes]


def reduce_log(order: Order) -> Made:
    """Reduce one log and make its files: reports first, the JSON last, so that a JSON tells that all is there."""
    work = order.work
    with local_copy(work.address) as path:
        run = read_run(
            path,
            rig=work.rig,
            load=work.load,
            load_source=work.load_source,
            about=work.about,
            origin=work.origin,
            table=work.sheet,
        )
    run = msgspec.structs.replace(run, path=readable(work.address))
    reduction = reduce(run, rig=work.rig, window=work.window, cycles=work.cycles)
    require_payouts(reduction)
    found = uncertainty(reduction)
    files: dict[str, bytes] = {}
    account: dict[str, Any] = {}
    if order.reports:
        from winchcascade.report.document import make_report
        from winchcascade.report.model_section import modelled

        model = modelled(reduction)
        account = {"model": model.account}  # the campaign's report draws it
        with _DRAWING:
            report = make_report(reduction, found, model=model, command=order.command)
        if "html" in order.reports:
            from winchcascade.report.html import html_text

            files["html"] = html_text(report).encode()
        if "pdf" in order.reports:
            from winchcascade.report.pdf import pdf_bytes

            files["pdf"] = pdf_bytes(report)
    record = msgspec.structs.asdict(reduction_record(reduction, found))
    digests = {ending: digest_of(content) for ending, content in files.items()}
    made_by = {"key": work.key, "reports": list(order.reports), "files": digests}
    files["json"] = with_digest(record | account, "batch", made_by)
    made = Made(work.name, files)
    if order.folder is None:
        return made
    write_made(made, Path(order.folder))
    return Made(work.name, {})


def write_made(made: Made, folder: Path) -> None:
    """Write the files of one log, all whole before the first is replaced, and remove reports of another result."""
    if made.files:
        outdated = [folder / f"{made.name}.{ending}" for ending in ENDINGS if ending not in made.files]
        write_set({folder / f"{made.name}.{e}": content for e, content in made.files.items()}, without=outdated)


SCHEMA = "winchcascade/campaign/1"
REPORTS = {"none": (), "html": ("html",), "all": ("html", "pdf")}
"""Reports that are written, by the word that asks for them."""

CAMPAIGN_FILES = ("campaign.json", "campaign.html", "campaign.pdf", "campaign.xlsx")
"""Files of a whole campaign, beside its dataset."""

DATASET = tuple(f"dataset/{table}.parquet" for table in TABLES)
"""Files of the dataset, by their names in the folder of a batch."""


class Batch(msgspec.Struct, frozen=True):
    """What a batch came to: results by log in the order of the plan, faults by log, and how many were done already.

    `altered` are the files of an earlier call that did not match their digest and were made again, `summary` is the record of
    the campaign, schema `winchcascade/campaign/1`.
    """

    folder: Path
    results: dict[str, Path]
    faults: dict[str, str]
    kept: int
    altered: tuple[str, ...] = ()
    summary: dict[str, Any] = msgspec.field(default_factory=dict)


class _KeptLog(msgspec.Struct):
    sha256: str


class _KeptBatch(msgspec.Struct):
    key: str
    reports: list[str]
    files: dict[str, str] = {}


class _Kept(msgspec.Struct):
    """What a result of an earlier call says of how it was made."""

    log: _KeptLog
    batch: _KeptBatch


_KEPT = msgspec.json.Decoder(_Kept)


def run_batch(
    plan: Plan,
    out: Path,
    *,
    reports: Sequence[str] = (),
    jobs: int = 1,
    scheduler: str | None = None,
    workbook: bool = False,
    command: str = "",
    force: bool = False,
    watch: Watch | None = None,
) -> Batch:
    """Reduce every log of a plan into a folder, and put the campaign together.

    Each result is written as soon as it is made, the reports of a log before its JSON, so a call that is cut short at any
    point loses nothing that was finished. Of two calls on one folder the second waits.

    Parameters
    ----------
    reports : "html", "pdf" or both, of every log and of the campaign
    jobs : processes of this machine
    scheduler : address of a Dask scheduler that does the work instead
    force : use a folder that holds something else too
    watch : told how many logs are done already and how many are to be done, then each as it is done

    Raises
    ------
    OutputError : the folder cannot be made or locked, holds something else, or holds a link
    OptionError : the scheduler cannot be reached
    """
    watch = watch or Nobody()
    make_folder(out, ours=(out / "runs").is_dir(), what="a batch", force=force)
    with locked(out, watch.waiting):
        runs = _clean_folder(out)
        states = {work.name: state_of(work, runs, reports) for work in plan.work}
        todo = [work for work in plan.work if states[work.name] != "kept"]
        _check_own(out, todo, force=force)
        watch.begin(len(plan.work) - len(todo), len(todo))
        faults: dict[str, str] = {}
        folder = None if scheduler is not None else str(runs)
        orders = {work.name: Order(work, tuple(reports), folder, command) for work in todo}
        for name, outcome in Workers(jobs, scheduler).run(reduce_log, orders, watch):
            if outcome.value is None:
                faults[name] = outcome.fault or ""
                if outcome.rejected and not _is_of(orders[name].work, runs):
                    _forget(name, runs)
            else:
                write_made(outcome.value, runs)
        batch = Batch(
            folder=out,
            results={work.name: runs / f"{work.name}.json" for work in plan.work if work.name not in faults},
            faults={work.name: faults[work.name] for work in plan.work if work.name in faults},
            kept=len(plan.work) - len(todo),
            altered=tuple(f"runs/{name}.json" for name, state in states.items() if state == "altered"),
        )
        return _put_together(plan, batch, reports, workbook=workbook, command=command)


def _clean_folder(out: Path) -> Path:
    """Make the folder of the results of single logs, and remove what killed calls left."""
    check_links(out, ["runs", "dataset", *CAMPAIGN_FILES, *DATASET])
    runs = out / "runs"
    make_one(runs, "another")
    for place in (out, runs, out / "dataset"):
        clear(place)
    return runs


def _check_own(out: Path, todo: Sequence[Work], *, force: bool) -> None:
    """Refuse, before any work, to replace links, and files that this tool did not write."""
    names = [*CAMPAIGN_FILES, *DATASET, *(f"runs/{work.name}.{ending}" for work in todo for ending in ENDINGS)]
    for path in [inside(out, name) for name in names]:
        if path.exists():
            check_replaceable(path, force=force)


def state_of(work: Work, runs: Path, reports: Sequence[str]) -> State:
    """Whether an earlier call made all of a log's files from the same content with the same options."""
    kept = marked(inside(runs, f"{work.name}.json"), _Kept)
    if not isinstance(kept, _Kept):
        return kept
    if kept.batch.key != work.key or not set(reports) <= set(kept.batch.reports):
        return "other"
    if not all((runs / f"{work.name}.{ending}").is_file() for ending in reports):
        return "other"
    if altered(runs, {f"{work.name}.{ending}": kept.batch.files.get(ending, "") for ending in reports}):
        return "altered"
    return "kept" if kept.log.sha256 == fingerprint(work.address) else "other"


def _is_of(work: Work, runs: Path) -> bool:
    """Whether the result that is there is of the log as it is now, or the log is out of reach; then it may count again."""
    now = fingerprint(work.address)
    try:
        return not now or _KEPT.decode((runs / f"{work.name}.json").read_bytes()).log.sha256 == now
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False


def _forget(name: str, runs: Path) -> None:
    """Remove what an earlier call made of a log that is now another one, which cannot be used."""
    for ending in ENDINGS:
        (runs / f"{name}.{ending}").unlink(missing_ok=True)


def _put_together(plan: Plan, batch: Batch, reports: Sequence[str], *, workbook: bool, command: str) -> Batch:
    """Write what is of all logs: dataset, workbook, report and last the summary; nothing if nothing has changed.

    All are made in a scratch folder and put in place together, so that a disk that is full leaves the earlier ones.
    """
    out = batch.folder
    digests = {f"runs/{path.name}": digest_of(path.read_bytes()) for path in batch.results.values()}
    state = _state(plan, batch, digests)
    wanted = [*DATASET, *(f"campaign.{ending}" for ending in reports), *(["campaign.xlsx"] if workbook else [])]
    said, changed = _said(out)
    stay: dict[str, str] = {}
    if said.get("state") == state:
        known = said["store"]["files"]
        lost = altered(out, known)
        changed = [name for name in lost if (out / name).exists()]
        if not lost and set(wanted) <= set(known):
            return msgspec.structs.replace(batch, summary=said)
        stay = {name: known[name] for name in CAMPAIGN_FILES if name in known and name not in [*lost, *wanted]}
    batch = msgspec.structs.replace(batch, altered=(*batch.altered, *changed))
    try:
        (out / "dataset").mkdir(exist_ok=True)
        with scratch_folder(out) as made:
            summary, between = summary_record(plan, batch, state)
            write_dataset(batch.results.values(), made / "dataset", between=between)
            if workbook:
                write_workbook(made / "dataset", made / "campaign.xlsx")
            if reports:
                from winchcascade.report.campaign import write_campaign_reports

                write_campaign_reports(summary, made, reports, results=out, command=command)
            digests |= stay | {name: digest_of((made / name).read_bytes()) for name in wanted}
            (made / "campaign.json").write_bytes(with_digest(summary, "store", {"files": digests}))
            outdated = [out / name for name in CAMPAIGN_FILES[1:] if name not in digests]
            put_in_place({made / name: out / name for name in [*wanted, "campaign.json"]}, without=outdated)
    except (OSError, OutputError) as fault:
        why = getattr(fault, "strerror", None) or fault
        raise OutputError(
            f"{out}: the tables and reports of the campaign cannot be written ({why}); free some space. "
            "The results of the logs are kept."
        ) from None
    return msgspec.structs.replace(batch, summary=_said(out)[0])


def _state(plan: Plan, batch: Batch, digests: Mapping[str, str]) -> str:
    """Digest of everything that the files of the whole campaign depend on."""
    logs = [(w.name, w.key, batch.faults.get(w.name)) for w in plan.work]
    return digest_of(repr((plan.title, __version__, logs, sorted(digests.items()))).encode())


def _said(out: Path) -> tuple[dict[str, Any], list[str]]:
    """Record of the campaign as an earlier call left it, empty if it left none, and its name if it was altered since."""
    try:
        content = (out / "campaign.json").read_bytes()
    except OSError:
        return {}, []
    digest = digest_in(content)
    if digest is Digest.RIGHT:
        return msgspec.json.decode(content, type=dict[str, Any]), []
    return {}, ["campaign.json"] if digest is Digest.WRONG else []


def summary_record(plan: Plan, batch: Batch, state: str) -> tuple[dict[str, Any], list[tuple[str, FindingRecord]]]:
    """A campaign in one record: each log with its means, or the sentence that says why it has none; and the findings that
    single logs have beside the others, each with the name of its log.
    """
    runs: list[dict[str, Any]] = []
    efficiencies: list[LogEfficiency | None] = []
    for work in plan.work:
        if work.name in batch.faults:
            runs.append({"name": work.name, "log": readable(work.address), "fault": readable(batch.faults[work.name])})
            continue
        record = msgspec.json.decode(batch.results[work.name].read_bytes(), type=RunRecord)
        efficiencies.append(log_efficiency(work.name, record))
        runs.append(
            {
                "name": work.name,
                "log": readable(work.address),
                "fault": None,
                "result": f"runs/{work.name}.json",
                "table": record.log.table,
                "load_ohm": record.log.load_ohm,
                "open_circuit": record.log.open_circuit,
                "simulated": record.log.simulated,
                "data": record.data,
                "window": record.window,
                "rig": record.rig,
                "cycles": len(record.cycles),
                "complete": sum(c.complete for c in record.cycles),
                "findings": sorted({finding.kind for finding in record.quality}),
                "finding_count": len(record.quality),
                "removed_share": sum(finding.removed_share for finding in record.quality),
                "mean": msgspec.to_builtins(record.mean),
                "standard_uncertainty": msgspec.to_builtins(record.standard_uncertainty),
                "interval_95": record.interval_95,
                "max_deviation_percent": msgspec.to_builtins(record.max_deviation_percent),
            }
        )
    between = findings_between(efficiencies)
    by_name = {run["name"]: run for run in runs}
    for name, finding in between:
        by_name[name]["findings"] = sorted({*by_name[name]["findings"], finding.kind})
        by_name[name]["finding_count"] += 1
    reduced = [run for run in runs if run["fault"] is None]
    rules = {rule: len(found) for rule, found in window_rules(reduced).items()}
    summary = {
        "schema": SCHEMA,
        "version": __version__,
        "title": readable(plan.title),
        "data": origin_record(joint_origin([origin_from(run) for run in reduced])),
        "windows": {"rules": rules, "mixed": len(rules) > 1},
        "state": state,
        "runs": runs,
        "between_logs": [{"run": name, **msgspec.structs.asdict(finding)} for name, finding in between],
    }
    return summary, between
