"""The page of a results folder: what it holds and where, with links to each page and file."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import quote

from msgspec.structs import replace

from winchcascade.core.campaign_file import banner
from winchcascade.reduction.campaign_record import CampaignRecord, LogSummary
from winchcascade.report import sheet as content
from winchcascade.report.campaign_record import named_fault
from winchcascade.report.content import Link
from winchcascade.report.digits import number
from winchcascade.report.sheet import number_column, text_column
from winchcascade.report.wording import load_text

INDEX = "index.html"
"""Name of the page in a results folder."""

MEANINGS = {
    "campaign.html": "Report of the campaign: all logs together",
    "campaign.pdf": "The same on paper",
    "diagnosis.html": "Diagnosis: which effects separate the rig from its simulation",
    "diagnosis.pdf": "The same on paper",
    "campaign.xlsx": "Workbook: the tables of all logs",
    "dataset/runs.parquet": "Dataset: a row for each log",
    "dataset/cycles.parquet": "Dataset: a row for each cycle",
    "dataset/bins.parquet": "Dataset: a row for each bin of generator speed",
    "dataset/findings.parquet": "Dataset: a row for each finding",
    "campaign.json": "Record of the campaign, for programs",
    "diagnosis.json": "Record of the diagnosis, for programs",
}
"""What the files of a results folder are, in the order of the list."""

_PAGES = {"campaign.html": "Campaign", "diagnosis.html": "Diagnosis", INDEX: "All results"}


def links_to(names: Sequence[str], *, above: bool = False) -> tuple[content.Link, ...]:
    """Links to those pages of a results folder that are among some files.

    Parameters
    ----------
    above : the folder is the one above that of the report
    """
    return tuple(content.Link(text, f"../{name}" if above else name) for name, text in _PAGES.items() if name in names)


def stated_links(names: Sequence[str], *, above: bool = False) -> list[Link]:
    """Links to those pages of a results folder that are among some files; arguments as of `links_to`."""
    return [Link(one.text, one.address) for one in links_to(names, above=above)]


def results_index(campaign: CampaignRecord, files: Sequence[str], endings: Sequence[str]) -> content.Report:
    """Make the page that lists the files of a results folder.

    Parameters
    ----------
    files : of the whole campaign, by their names in the folder
    endings : of the files of each log
    """
    listed = [name for name in MEANINGS if name in files]
    origins = [run.origin for run in campaign.reduced]
    return content.Report(
        kind="Results",
        title=campaign.title,
        subtitle=f"{len(campaign.reduced)} logs" + (f", {len(campaign.failed)} not reduced" * bool(campaign.failed)),
        tiles=(),
        points=(
            *([content.data_point(origins)] if origins else []),
            *(content.Point("Not reduced", named_fault(log), "warn") for log in campaign.failed),
        ),
        sections=tuple(s for s in (_files(listed), _logs(campaign.reduced, endings)) if s.blocks),
        banner=banner(origins),
        links=links_to([name for name in files if name != INDEX]),
    )


def _files(names: Sequence[str]) -> content.Section:
    rows = [(name, MEANINGS[name]) for name in names]
    table = content.formatted_table(
        "files",
        "Reports, workbook, dataset and records of all logs together.",
        (text_column("File"), text_column("What it holds")),
        rows,
    )
    return content.section("files", "Files of the campaign", _linked(table, names))


def _logs(runs: Sequence[LogSummary], endings: Sequence[str]) -> content.Section:
    kinds = ", ".join(ending.upper() for ending in endings)
    rows = [
        (run.name, load_text(run.load), number(run.plateau_speed_mps, 3), f"{run.complete} of {run.cycles}", kinds)
        for run in runs
    ]
    columns = (
        text_column("Log"),
        number_column("Load", "Ω"),
        number_column("Plateau", "m/s"),
        number_column("Complete cycles"),
        text_column("Files"),
    )
    caption = "Report of each log, and its files: runs/LOG with the ending of each kind."
    addresses = [f"runs/{quote(run.name)}.{endings[0]}" for run in runs]
    return content.section("logs", "Logs", _linked(content.formatted_table("logs", caption, columns, rows), addresses))


def _linked(table: content.Table | None, addresses: Sequence[str]) -> content.Table | None:
    return None if table is None else replace(table, links=tuple(addresses))
