"""The page of a results folder: efficiency by load, verdicts and findings, with links to every
page and file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from winchcascade.core.store import INDEX
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    LogSummary,
    cascade_of,
    runs_by_load,
)
from winchcascade.report.content import Column, Link, Report, Table, section, table
from winchcascade.report.results.campaign import fault_notes, findings_note, tiles, verdict_note
from winchcascade.report.results.campaign_tables import (
    CYCLES,
    FINDINGS,
    LOAD,
    SPEED,
    file_column,
    given,
    log_column,
    mean_column,
)
from winchcascade.report.results.common import data_note
from winchcascade.report.results.diagnosis_words import diagnosis_note
from winchcascade.report.wording import banner

MEANINGS = {
    "campaign.html": "Report of the campaign: all logs together",
    "campaign.pdf": "The same on paper",
    "diagnosis.html": "Diagnosis: which effects separate the rig from its simulation",
    "diagnosis.pdf": "The same on paper",
    "loss_map.html": "Loss map of the campaign: losses over speed and torque",
    "loss_map.pdf": "The same on paper",
    "campaign.xlsx": "Workbook: the tables of all logs",
    "dataset/runs.parquet": "Dataset: a row for each log",
    "dataset/cycles.parquet": "Dataset: a row for each cycle",
    "dataset/bins.parquet": "Dataset: a row for each bin of generator speed",
    "dataset/findings.parquet": "Dataset: a row for each finding",
    "dataset/runs_all.parquet": "Dataset: a row for each log with every metric, interval and "
    "deviation",
    "campaign.json": "Record of the campaign, for programs",
    "diagnosis.json": "Record of the diagnosis, for programs",
}
"""What the files of a results folder are, in the order of the list."""

_PAGES = {
    "campaign.html": "Campaign",
    "diagnosis.html": "Diagnosis",
    "loss_map.html": "Loss map",
    INDEX: "All results",
}

FILES: tuple[Column[str], ...] = (
    Column("file", lambda name: name, link=lambda name: name),
    Column("what it holds", lambda name: MEANINGS[name]),
)
"""A file of the whole campaign."""


def links_to(names: Sequence[str], *, above: bool = False) -> list[Link]:
    """Links to those pages of a results folder that are among some files.

    Parameters
    ----------
    above : the folder is the one above that of the report
    """
    return [
        Link(text, f"../{name}" if above else name)
        for name, text in _PAGES.items()
        if name in names
    ]


def results_index(
    campaign: CampaignRecord,
    files: Sequence[str],
    endings: Sequence[str],
    diagnosis: Mapping[str, object] | None = None,
) -> Report:
    """Page that shows what a results folder holds.

    Parameters
    ----------
    files : of the whole campaign, by their names in the folder
    endings : of the files of each log
    diagnosis : record of a diagnosis that stands there
    """
    runs = runs_by_load(campaign.reduced)
    failed = f", {len(campaign.failed)} not reduced" if campaign.failed else ""
    listed = [name for name in MEANINGS if name in files]
    return Report(
        kind="Results",
        title=campaign.title,
        subtitle=f"{len(runs)} logs{failed}",
        tiles=tiles(runs),
        points=[
            verdict_note(runs),
            None if diagnosis is None else diagnosis_note(diagnosis),
            data_note([run.origin for run in runs]) if runs else None,
            findings_note(runs),
            *fault_notes(campaign.failed),
        ],
        sections=[
            section("logs", "Logs", _logs(runs, endings)),
            section(
                "files",
                "Files of the campaign",
                table("files", "Files of all logs together.", FILES, listed),
            ),
        ],
        banner=banner([run.origin for run in runs]),
        links=links_to([name for name in files if name != INDEX]),
    )


def _logs(runs: Sequence[LogSummary], endings: Sequence[str]) -> Table[LogSummary]:
    """Efficiencies and findings by load, and the files of each log."""
    ratios = given(runs, cascade_of(runs).ratios)
    columns = [
        log_column(endings[0]),
        LOAD,
        SPEED,
        *map(mean_column, ratios),
        CYCLES,
        FINDINGS,
        *map(file_column, endings),
    ]
    return Table(
        "logs",
        "Efficiencies by load; files: runs/LOG with the ending of each kind.",
        columns,
        runs,
        limit=len(runs),
    )
