"""The page that lists what a folder of results holds: made anew whenever a batch or a diagnosis
writes there.
"""

from __future__ import annotations

from pathlib import Path

import msgspec

from winchcascade.core.files import is_marked
from winchcascade.core.store import (
    CAMPAIGN_RECORD,
    DIAGNOSIS_RECORD,
    INDEX,
    LOG_FILES,
    Kept,
    inside,
    kept,
)
from winchcascade.reduction.campaign_record import read_campaign


def write_index(folder: Path) -> Path | None:
    """Write the page of a folder of results from what is there; None where the folder holds no
    record of this version.

    Raises
    ------
    OutputError : a page is there that this tool did not write, or a link
    """
    from winchcascade.report.render.report_files import publish
    from winchcascade.report.results.campaign_index import MEANINGS, results_index

    record = inside(folder, CAMPAIGN_RECORD)
    if not isinstance(kept(record, "store"), Kept):
        return None
    try:
        campaign = read_campaign(record)
    except msgspec.ValidationError:  # of another version
        return None
    files = [
        name for name in MEANINGS if (path := inside(folder, name)).is_file() and is_marked(path)
    ]
    runs = folder / "runs"
    endings = [
        e
        for e in LOG_FILES
        if all((runs / f"{run.name}.{e}").is_file() for run in campaign.reduced)
    ]
    diagnosis = None
    if DIAGNOSIS_RECORD in files:
        diagnosis = msgspec.json.decode(
            (folder / DIAGNOSIS_RECORD).read_bytes(), type=dict[str, object]
        )
    publish(results_index(campaign, files, endings, diagnosis), html=folder / INDEX)
    return folder / INDEX
