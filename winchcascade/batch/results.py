"""Results to compare with a table: a reduction, the folder of a batch, or a campaign that is
reduced for it.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import msgspec

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.plan import Plan, make_plan
from winchcascade.batch.reductions import reduce_campaign, with_findings_between
from winchcascade.core.campaign_file import CAMPAIGN_FILE
from winchcascade.core.errors import LogError, OptionError, OutputError
from winchcascade.core.jobs import Workers
from winchcascade.core.store import CAMPAIGN_RECORD, Kept, State, altered, digest_in, inside
from winchcascade.reduction.campaign_record import CAMPAIGN_SCHEMA
from winchcascade.reduction.run_record import RunRecord, run_record
from winchcascade.tables.check import Check, Factors, check
from winchcascade.tables.measured import measured
from winchcascade.tables.published_table import PublishedTable
from winchcascade.tables.table_file import load_table

_EXPECTED = "expected a campaign, the folder of a batch or a reduction's JSON."


class Results(msgspec.Struct, frozen=True):
    """Records of reductions, each with the name of its log; `whole`: a campaign, not a single log,
    `verified` whether each result of a batch has a digest and matches it.
    """

    records: tuple[tuple[str, RunRecord], ...]
    whole: bool
    verified: bool = True


class _Run(msgspec.Struct):
    name: str
    fault: str | None = None
    result: str = ""


class _Stored(msgspec.Struct):
    """What is needed of the JSON of a reduction, or of the record of a batch, which has `runs`."""

    schema: str | None = None
    batch: dict[str, object] = {}
    runs: list[_Run] | None = None
    store: Kept = Kept()


def input_files(target: Path) -> list[str]:
    """Files that the results of a target are read from or made of, as `load_results` and `compare`
    open it.

    Raises
    ------
    OptionError, CampaignError, RigError : a campaign that cannot be planned
    """
    folder = target if target.is_dir() else target.parent
    files = [target, folder / CAMPAIGN_FILE]
    if not _is_campaign(target):
        return [str(path) for path in (*files, folder / CAMPAIGN_RECORD, *folder.glob("runs/*"))]
    work = make_plan([str(target)]).work
    return [*map(str, files), *(one.path for one in work), *(one.settings.rig.path for one in work)]


def _is_campaign(target: Path) -> bool:
    """Whether a target is a campaign to reduce: its file, or a folder without the results of a
    batch.
    """
    if target.is_dir():
        return not (target / CAMPAIGN_RECORD).is_file() or (target / CAMPAIGN_FILE).is_file()
    return target.suffix == ".toml"


def load_results(target: Path, *, jobs: int = 1) -> Results:
    """Load results, or make them of a campaign.

    Raises
    ------
    OptionError : the target is none of these, or not readable
    LogError : a log of the campaign cannot be used, or failed in the batch
    OutputError : a result was altered after it was made, or lies outside of the folder of its batch
    """
    if _is_campaign(target):
        return campaign_results(make_plan([str(target)]), jobs)
    path = target / CAMPAIGN_RECORD if target.is_dir() else target
    content, stored, digest = _read(path)
    if stored.schema == CAMPAIGN_SCHEMA and stored.runs is not None:
        return _of_batch(path.parent, stored.runs, stored.store.files if digest == "kept" else None)
    if path.name == CAMPAIGN_RECORD:
        raise OptionError(
            f"{path}: is no summary of a batch; expected the schema {CAMPAIGN_SCHEMA}. Run the "
            f"batch again."
        )
    record = run_record(content, target.name)
    return Results(
        ((target.name, record),), whole=False, verified=not stored.batch or digest == "kept"
    )


def _read(path: Path) -> tuple[bytes, _Stored, State]:
    """Content of a JSON file, what is needed of it, and whether it is as it was written."""
    if path.exists() and not path.is_file():
        raise OptionError(f"{path}: is no file; {_EXPECTED}")
    try:
        content = path.read_bytes()
        stored = msgspec.json.decode(content, type=_Stored)
    except OSError as fault:
        raise OptionError(f"{path}: cannot be read ({fault.strerror}); {_EXPECTED}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(f"{path}: is no JSON of a reduction ({fault}); {_EXPECTED}") from None
    digest = digest_in(content)
    if digest == "altered":
        raise _altered(path)
    return content, stored, digest


def _altered(path: Path) -> OutputError:
    return OutputError(
        f"{path}: was altered after the batch: its content does not match the digest. Run the "
        f"batch again, which makes this "
        "result anew."
    )


def _of_batch(folder: Path, runs: list[_Run], digests: Mapping[str, str] | None) -> Results:
    """Results of a batch; `digests` of its files are None where it has none, as of version
    0.1.0.
    """
    for run in runs:
        if run.fault is not None:
            raise LogError(
                f"{folder}: {run.name} failed in this batch: {run.fault} Mend the log or leave it "
                f"out."
            )
    records = {
        run.name: run_record(_read(inside(folder, run.result))[0], run.result) for run in runs
    }
    for name in (
        ()
        if digests is None
        else altered(folder, {run.result: digests.get(run.result, "") for run in runs})
    ):
        raise _altered(folder / name)
    between = findings_between([log_efficiency(name, record) for name, record in records.items()])
    together = tuple(with_findings_between(records.items(), between))
    return Results(together, whole=True, verified=digests is not None)


def campaign_results(plan: Plan, jobs: int) -> Results:
    """Reduce the logs of a plan. Raises LogError for one that cannot be used."""
    found = reduce_campaign(plan, Workers(jobs))
    for fault in found.faults.values():
        raise LogError(fault)
    return Results(tuple(found.records.items()), whole=True)


def check_results(
    results: Results, table: PublishedTable | str | Path, factors: Factors | None = None
) -> Check:
    """Compare results with a published table, its file, or a built-in table; raises as
    `tables.check.check`.
    """
    table = load_table(table)
    found = [one for name, record in results.records for one in measured(record, name, table)]
    return check(found, table, factors, whole_campaign=results.whole)
