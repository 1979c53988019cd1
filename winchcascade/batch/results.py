"""Results to compare with a table: a reduction, the folder of a batch, or a campaign that is reduced for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.plan import Plan, make_plan
from winchcascade.batch.run_batch import Order, reduce_log
from winchcascade.core.campaign_file import CAMPAIGN_FILE
from winchcascade.core.errors import LogError, OptionError, OutputError
from winchcascade.core.jobs import run_here
from winchcascade.core.published_table import PublishedTable
from winchcascade.core.store import KeptFiles, State, altered, digest_in, inside
from winchcascade.report.campaign_record import CAMPAIGN_SCHEMA
from winchcascade.report.records import RunRecord
from winchcascade.tables.check import Check, Factors, check, measured_from_record
from winchcascade.tables.point_check import check_points
from winchcascade.tables.point_table import PointTable, open_table

_EXPECTED = "expected a campaign, the folder of a batch or a reduction's JSON."


class Results(msgspec.Struct, frozen=True):
    """Reductions as JSON records, each with the name of its log; `whole`: a campaign, not a single log, `verified` whether
    each result of a batch has a digest and matches it.
    """

    records: tuple[tuple[str, dict[str, Any]], ...]
    whole: bool
    verified: bool = True


class _Run(msgspec.Struct):
    name: str
    fault: str | None = None
    result: str = ""


class _Summary(msgspec.Struct):
    """What is needed of the record of a batch; version 0.1.0 wrote none with digests."""

    runs: list[_Run]
    store: KeptFiles = KeptFiles()


def load_results(target: Path, *, jobs: int = 1) -> Results:
    """Load results, or make them of a campaign.

    Raises
    ------
    OptionError : the target is none of these, or not readable
    LogError : a log of the campaign cannot be used, or failed in the batch
    OutputError : a result was altered after it was made, or lies outside of the folder of its batch
    """
    if target.is_dir() and (target / "campaign.json").is_file() and not (target / CAMPAIGN_FILE).is_file():
        return _of_batch(target)
    if target.is_dir() or target.suffix == ".toml":
        return campaign_results(make_plan([str(target)]), jobs)
    record, digest = _json(target)
    if record.get("schema") == CAMPAIGN_SCHEMA:
        return _of_batch(target.parent)
    return Results(((target.name, record),), whole=False, verified="batch" not in record or digest == "kept")


def _json(path: Path) -> tuple[dict[str, Any], State]:
    if path.exists() and not path.is_file():
        raise OptionError(f"{path}: is no file; {_EXPECTED}")
    try:
        content = path.read_bytes()
        record = msgspec.json.decode(content, type=dict[str, Any])
    except OSError as fault:
        raise OptionError(f"{path}: cannot be read ({fault.strerror}); {_EXPECTED}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as fault:
        raise OptionError(f"{path}: is no JSON of a reduction ({fault}); {_EXPECTED}") from None
    digest = digest_in(content)
    if digest == "altered":
        raise _altered(path)
    return record, digest


def _altered(path: Path) -> OutputError:
    return OutputError(
        f"{path}: was altered after the batch: its content does not match the digest. Run the batch again, which makes this "
        "result anew."
    )


def _of_batch(folder: Path) -> Results:
    path = folder / "campaign.json"
    record, digest = _json(path)
    if record.get("schema") != CAMPAIGN_SCHEMA:
        raise OptionError(f"{path}: is no summary of a batch; expected the schema {CAMPAIGN_SCHEMA}.")
    try:
        summary = msgspec.convert(record, _Summary)
    except msgspec.ValidationError as fault:
        raise OptionError(f"{path}: is no summary of a batch ({fault}); run the batch again.") from None
    for run in summary.runs:
        if run.fault is not None:
            raise LogError(f"{folder}: {run.name} failed in this batch: {run.fault} Mend the log or leave it out.")
    records = {run.name: _json(inside(folder, run.result))[0] for run in summary.runs}
    if digest == "kept":
        for name in altered(folder, {run.result: summary.store.files.get(run.result, "") for run in summary.runs}):
            raise _altered(folder / name)
    return Results(_together(records), whole=True, verified=digest == "kept")


def campaign_results(plan: Plan, jobs: int) -> Results:
    """Reduce the logs of a plan. Raises LogError for one that cannot be used."""
    found: dict[int, dict[str, Any]] = {}
    for outcome in run_here(reduce_log, [Order(work) for work in plan.work], workers=jobs):
        if outcome.value is None:
            raise LogError(f"{outcome.fault}")
        found[outcome.place] = msgspec.json.decode(outcome.value.files["json"])
    return Results(_together({plan.work[k].name: found[k] for k in sorted(found)}), whole=True)


def check_results(
    results: Results, table: PublishedTable | PointTable | str | Path, factors: Factors | None = None
) -> Check:
    """Compare results with a published table: a table by load or of operating points, its file, or a built-in table.

    Raises as `tables.check.check` and `tables.point_check.check_points`.
    """
    table = open_table(table) if isinstance(table, str | Path) else table
    if isinstance(table, PointTable):
        return check_points(results.records, table, factors, whole_campaign=results.whole)
    measured = [measured_from_record(record, name) for name, record in results.records]
    return check(measured, table, factors, whole_campaign=results.whole)


def _together(records: dict[str, dict[str, Any]]) -> tuple[tuple[str, dict[str, Any]], ...]:
    """The records of a campaign, each with the findings that its log has beside the others."""
    try:
        logs = [log_efficiency(name, msgspec.convert(record, RunRecord)) for name, record in records.items()]
        between = findings_between(logs)
    except (msgspec.ValidationError, ValueError, ZeroDivisionError):  # no reductions of this tool, as `check` reports
        between = []
    for name, finding in between:
        records[name]["quality"].append(msgspec.structs.asdict(finding))
    return tuple(records.items())
