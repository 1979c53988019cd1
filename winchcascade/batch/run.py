"""One batch: what is done already is kept, the rest is done, and the campaign is put together."""

from __future__ import annotations

import hashlib
import shutil
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade import __version__
from winchcascade.addresses import fingerprint
from winchcascade.batch.dataset import TABLES, write_dataset, write_workbook
from winchcascade.batch.work import ENDINGS, Order, reduce_log, write_made
from winchcascade.errors import OutputError
from winchcascade.files import check_replaceable, readable, write_content
from winchcascade.tasks import Nobody, Outcome, Watch, run_here, run_there

if TYPE_CHECKING:
    from winchcascade.batch.plan import Plan, Work
    from winchcascade.batch.work import Made

SCHEMA = "winchcascade/campaign/1"
REPORTS = {"none": (), "html": ("html",), "all": ("html", "pdf")}
"""Reports that are written, by the word that asks for them."""

CAMPAIGN_FILES = ("campaign.json", "campaign.html", "campaign.pdf", "campaign.xlsx")
"""Files of a whole campaign, beside its dataset."""

_STALE = 3600.0
"""A scratch file older than this is left of a call that was killed. [s]"""


class Batch(msgspec.Struct, frozen=True):
    """What a batch came to: results by log in the order of the plan, faults by log, and how many were done already.

    `summary` is the record of the campaign, schema `winchcascade/campaign/1`.
    """

    folder: Path
    results: dict[str, Path]
    faults: dict[str, str]
    kept: int
    summary: dict[str, Any] = msgspec.field(default_factory=dict)


class _KeptLog(msgspec.Struct):
    sha256: str


class _KeptBatch(msgspec.Struct):
    key: str
    reports: list[str]


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
    point loses nothing that was finished. Two calls on one folder write the same files, whole.

    Parameters
    ----------
    reports : "html", "pdf" or both, of every log and of the campaign
    jobs : processes of this machine
    scheduler : address of a Dask scheduler that does the work instead
    force : use a folder that holds something else too
    watch : told how many logs are done already and how many are to be done, then each as it is done

    Raises
    ------
    OutputError : the folder cannot be made or holds something else
    OptionError : the scheduler cannot be reached
    """
    runs = _folder(out, force=force)
    todo = [work for work in plan.work if not is_kept(work, runs, reports)]
    if not force:
        _check_foreign(out, runs, todo)
    watch = watch or Nobody()
    watch.begin(len(plan.work) - len(todo), len(todo))
    faults: dict[str, str] = {}
    folder = None if scheduler is not None else str(runs)
    orders = [Order(work, tuple(reports), folder, command) for work in todo]
    for outcome in _outcomes(orders, jobs, scheduler):
        name = todo[outcome.place].name
        if outcome.value is None:
            faults[name] = outcome.fault or ""
            if fingerprint(todo[outcome.place].address):  # else the log is out of reach, and its result may count again
                _forget(name, runs)
        else:
            write_made(outcome.value, runs)
        watch.done(name, outcome.fault)
    results = {work.name: runs / f"{work.name}.json" for work in plan.work if work.name not in faults}
    batch = Batch(
        out, results, {w.name: faults[w.name] for w in plan.work if w.name in faults}, len(plan.work) - len(todo)
    )
    summary = _put_together(plan, batch, reports, workbook=workbook, command=command)
    return msgspec.structs.replace(batch, summary=summary)


def _outcomes(orders: list[Order], jobs: int, scheduler: str | None) -> Iterator[Outcome[Made]]:
    if scheduler is not None:
        return run_there(reduce_log, orders, scheduler=scheduler)
    return run_here(reduce_log, orders, workers=jobs)


def _folder(out: Path, *, force: bool) -> Path:
    """Make the folder of the results, and clear what killed calls left there."""
    runs = out / "runs"
    if not force and out.is_dir() and not runs.is_dir() and any(out.iterdir()):
        raise OutputError(f"{out}: is not empty and no folder of a batch; give --out a new folder or add --force.")
    try:
        runs.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{out}: the folder cannot be made ({fault.strerror}); choose another.") from None
    for part in (*out.glob(".*.part"), *runs.glob(".*.part"), *out.glob("dataset/.*.part")):
        _clear(part)
    return runs


def _check_foreign(out: Path, runs: Path, todo: Sequence[Work]) -> None:
    """Refuse to replace files that this tool did not write, before any work."""
    made = [out / name for name in CAMPAIGN_FILES] + [out / "dataset" / f"{table}.parquet" for table in TABLES]
    made += [runs / f"{work.name}.{ending}" for work in todo for ending in ENDINGS]
    for path in made:
        if path.exists():
            check_replaceable(path, force=False)


def _clear(part: Path) -> None:
    """Remove a scratch file or folder that nobody can be writing any more."""
    try:
        if time.time() - part.stat().st_mtime > _STALE:
            shutil.rmtree(part) if part.is_dir() else part.unlink()
    except FileNotFoundError:  # another call was faster
        return


def is_kept(work: Work, runs: Path, reports: Sequence[str]) -> bool:
    """Whether an earlier call made all of a log's files from the same content with the same options."""
    try:
        kept = _KEPT.decode((runs / f"{work.name}.json").read_bytes())
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    if kept.batch.key != work.key or not set(reports) <= set(kept.batch.reports):
        return False
    if not all((runs / f"{work.name}.{ending}").is_file() for ending in reports):
        return False
    return kept.log.sha256 == fingerprint(work.address)


def _forget(name: str, runs: Path) -> None:
    """Remove what an earlier call made of a log that now fails."""
    for ending in ENDINGS:
        (runs / f"{name}.{ending}").unlink(missing_ok=True)


def _put_together(plan: Plan, batch: Batch, reports: Sequence[str], *, workbook: bool, command: str) -> dict[str, Any]:
    """Write what is of all logs: dataset, summary, workbook and report; nothing if nothing has changed."""
    out = batch.folder
    state = _state(plan, batch)
    made = [out / "campaign.json", *(out / "dataset" / f"{table}.parquet" for table in TABLES)]
    made += [out / f"campaign.{ending}" for ending in reports] + ([out / "campaign.xlsx"] if workbook else [])
    if all(path.is_file() for path in made):
        said = _said(out / "campaign.json")
        if said.get("state") == state:
            return said
    for name in CAMPAIGN_FILES:  # what is not made anew would be of another state
        (out / name).unlink(missing_ok=True)
    write_dataset(batch.results.values(), out / "dataset")
    if workbook:
        write_workbook(out / "dataset", out / "campaign.xlsx")
    summary = summary_record(plan, batch, state)
    if reports:
        from winchcascade.report.campaign import write_campaign_reports

        write_campaign_reports(summary, out, reports, command=command)
    write_content(out / "campaign.json", msgspec.json.encode(summary) + b"\n", force=True)
    return summary


def _state(plan: Plan, batch: Batch) -> str:
    """Digest of everything that the files of the whole campaign depend on."""
    said = repr((plan.title, __version__, [(w.name, w.key, batch.faults.get(w.name)) for w in plan.work])).encode()
    digest = hashlib.sha256(said)
    for path in batch.results.values():
        digest.update(_KEPT.decode(path.read_bytes()).log.sha256.encode())
    return digest.hexdigest()


def _said(path: Path) -> dict[str, Any]:
    """Record of the campaign as an earlier call left it, empty if it left none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=dict[str, Any])
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return {}


_COPIED = ("mean", "standard_uncertainty", "interval_95", "max_deviation_percent")


def summary_record(plan: Plan, batch: Batch, state: str) -> dict[str, Any]:
    """A campaign in one record: each log with its means, or the sentence that says why it has none."""
    runs: list[dict[str, Any]] = []
    for work in plan.work:
        if work.name in batch.faults:
            runs.append({"name": work.name, "log": readable(work.address), "fault": readable(batch.faults[work.name])})
            continue
        record = msgspec.json.decode(batch.results[work.name].read_bytes())
        runs.append(
            {
                "name": work.name,
                "log": readable(work.address),
                "fault": None,
                "result": f"runs/{work.name}.json",
                "load_ohm": record["log"]["load_ohm"],
                "open_circuit": record["log"]["open_circuit"],
                "simulated": record["log"]["simulated"],
                "rig": record["rig"],
                "cycles": len(record["cycles"]),
                "complete": sum(c["complete"] for c in record["cycles"]),
                "findings": sorted({finding["kind"] for finding in record["quality"]}),
                "finding_count": len(record["quality"]),
                "removed_share": sum(finding["removed_share"] for finding in record["quality"]),
                **{name: record[name] for name in _COPIED},
            }
        )
    return {"schema": SCHEMA, "version": __version__, "title": readable(plan.title), "state": state, "runs": runs}
