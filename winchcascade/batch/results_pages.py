"""The page of a results folder after a diagnosis was written there: it lists the diagnosis without another batch."""

from __future__ import annotations

from pathlib import Path

import msgspec

from winchcascade.batch.demo import DIAGNOSIS_FILES
from winchcascade.core.files import is_marked, put_in_place
from winchcascade.core.scratch import scratch_folder
from winchcascade.core.store import KeptFiles, altered, digest_of, inside, locked, marked, with_digest
from winchcascade.core.version import __version__


class KeptCampaign(msgspec.Struct):
    """How an earlier call made the files of a campaign; version 0.1.0 wrote no digests."""

    state: str = ""
    store: KeptFiles = KeptFiles()
    version: str = ""


def diagnosis_beside(folder: Path) -> tuple[str, ...]:
    """Files of a diagnosis that a results folder holds."""
    return tuple(name for name in DIAGNOSIS_FILES if (folder / name).is_file() and is_marked(inside(folder, name)))


def list_diagnosis(folder: Path) -> Path | None:
    """Make the page of a results folder anew, with the files of a diagnosis that are there now; give the page.

    The record of the campaign gets the digest of the new page. Nothing is changed, and None is given, where the folder is not
    of a batch of this version with pages, or where record or page were changed since.

    Raises
    ------
    OutputError : the folder cannot be locked
    """
    from winchcascade.reduction.campaign_record import campaign_from
    from winchcascade.report.publish import publish
    from winchcascade.report.results_index import INDEX, results_index

    record_file = folder / "campaign.json"
    if not record_file.is_file() or not (folder / INDEX).is_file():
        return None
    with locked(folder, lambda _: None):
        kept = marked(inside(folder, record_file.name), KeptCampaign)
        if not isinstance(kept, KeptCampaign) or kept.version != __version__:
            return None
        digests = kept.store.files
        if INDEX not in digests or altered(folder, {INDEX: digests[INDEX]}):
            return None
        record = msgspec.json.decode(record_file.read_bytes(), type=dict[str, object])
        endings = [ending for ending in ("html", "pdf") if f"campaign.{ending}" in digests]
        files = [*digests, record_file.name, *diagnosis_beside(folder)]
        page = results_index(campaign_from(record), files, [*endings, "json"])
        with scratch_folder(folder) as made:
            publish(page, html=made / INDEX, force=True)
            now = digests | {INDEX: digest_of((made / INDEX).read_bytes())}
            del record["store"]
            (made / record_file.name).write_bytes(with_digest(record, "store", {"files": now}))
            put_in_place({made / name: folder / name for name in (INDEX, record_file.name)})
    return folder / INDEX
