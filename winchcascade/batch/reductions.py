"""Reduce the logs of a plan: each to its record and reports, all to the record of the campaign;
nothing is written.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.plan import Plan, Work, result_key
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.core.plain_text import one_line
from winchcascade.core.store import CAMPAIGN_PAGE, INDEX, digest_of, with_digest
from winchcascade.ingest.read import read_by
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    CampaignReduction,
    FailedLog,
    log_summary,
)
from winchcascade.reduction.reduce import reduce, require_payouts
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import (
    FindingRecord,
    RunRecord,
    reduction_entries,
    run_record,
)
from winchcascade.reduction.uncertainty import Uncertainty, uncertainty
from winchcascade.reduction.wave_energies import LogWaves, campaign_waves

if TYPE_CHECKING:
    from winchcascade.report.content import Report

ENTRY = "batch"
"""Entry of the record of a log that states how it was made."""

_DRAWING = threading.Lock()
"""matplotlib's settings are global, and a worker of a cluster may have several threads."""


class Made(msgspec.Struct, frozen=True):
    """What is made of one log: its record as JSON, and its reports by their endings."""

    record: bytes
    reports: dict[str, bytes]


def reduce_log(work: Work, *, reports: Sequence[str] = (), command: str = "") -> Made:
    """Reduce one log, and make its record and reports.

    Parameters
    ----------
    reports : endings, "html" or "pdf"
    command : what was typed, for the reports

    Raises
    ------
    LogError : the log cannot be used
    """
    run = replace(read_by(Path(work.path), work.settings), path=one_line(work.path))
    reduction = reduce(run)
    require_payouts(reduction)
    found = uncertainty(reduction)
    record = reduction_entries(reduction, found)
    files: dict[str, bytes] = {}
    if reports:
        with _DRAWING:
            files, record["model"] = _reports(reduction, found, reports, command)
    digests = {ending: digest_of(content) for ending, content in files.items()}
    made_by = {
        "key": result_key(work, reduction.run.sha256),
        "reports": list(reports),
        "files": digests,
    }
    return Made(with_digest(record, ENTRY, made_by), files)


def _reports(
    reduction: Reduction, found: Uncertainty, endings: Sequence[str], command: str
) -> tuple[dict[str, bytes], object]:
    """Reports of a log, and the account of its model, which the report of the campaign draws."""
    from winchcascade.diagnosis.explain.model_comparison import modelled
    from winchcascade.report.results.campaign_index import links_to
    from winchcascade.report.results.reduction import reduction_report

    model = modelled(reduction)
    report = reduction_report(reduction, found, model=model, command=command)
    links = links_to([CAMPAIGN_PAGE, INDEX], above=True)
    return rendered(replace(report, links=links), endings), model


def rendered(report: Report, endings: Sequence[str]) -> dict[str, bytes]:
    """Content of the files of a report, by their endings."""
    from winchcascade.report.render.page import page_text
    from winchcascade.report.render.pdf import pdf_bytes

    files = {"html": page_text(report).encode()} if "html" in endings else {}
    return files | ({"pdf": pdf_bytes(report)} if "pdf" in endings else {})


def reduce_campaign(plan: Plan, workers: Workers) -> CampaignReduction:
    """Reduce all logs of a plan; a log that cannot be used has its fault in the result.

    Raises
    ------
    OptionError : no further process can be started
    """
    found: dict[str, RunRecord] = {}
    faults: dict[str, str] = {}
    for name, outcome in workers.run(reduce_log, {work.name: work for work in plan.work}, Nobody()):
        if outcome.value is None:
            faults[name] = outcome.fault or ""
        else:
            found[name] = run_record(outcome.value.record, name)
    found = {work.name: found[work.name] for work in plan.work if work.name in found}
    summary = campaign_record(plan, found.items(), faults)
    cascades = tuple(work.settings.rig.cascade for work in plan.work)
    records = dict(with_findings_between(found.items(), summary.between))
    return CampaignReduction(summary, records, cascades)


def campaign_record(
    plan: Plan, results: Iterable[tuple[str, RunRecord]], faults: Mapping[str, str], state: str = ""
) -> CampaignRecord:
    """Put the results of a plan into the record of its campaign, with findings of single logs
    beside the others.

    Parameters
    ----------
    results : records with the names of their logs; they are not kept, but for those with waves
    faults : of the other logs
    state : digest of all that the record depends on
    """
    logs, efficiencies, waves = {}, [], []
    paths = {work.name: one_line(work.path) for work in plan.work}
    for name, record in results:
        logs[name] = log_summary(name, paths[name], record)
        efficiencies.append(log_efficiency(name, record))
        if record.waves is not UNSET:
            waves.append(LogWaves(name, record.log.load, record.waves))
    between = tuple(findings_between(efficiencies))
    for name, finding in between:
        run = logs[name]
        kinds = tuple(sorted({*run.findings, finding.kind}))
        logs[name] = replace(run, findings=kinds, finding_count=run.finding_count + 1)
    runs = tuple(
        logs.get(name) or FailedLog(name, path, one_line(faults.get(name, "not reduced")))
        for name, path in paths.items()
    )
    together = campaign_waves(waves)
    return CampaignRecord(
        one_line(plan.title), state, runs, between, UNSET if together is None else together.record
    )


def with_findings_between(
    records: Iterable[tuple[str, RunRecord]], between: Iterable[tuple[str, FindingRecord]]
) -> Iterator[tuple[str, RunRecord]]:
    """Names and records of the logs of a campaign, each with the findings that its log has
    beside the others.
    """
    more: dict[str, tuple[FindingRecord, ...]] = {}
    for name, finding in between:
        more[name] = (*more.get(name, ()), finding)
    for name, record in records:
        yield name, replace(record, quality=(*record.quality, *more.get(name, ())))
