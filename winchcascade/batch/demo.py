"""The packaged campaign, to try the tool on: simulated logs, rebuilt from a published table, never measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, write_content
from winchcascade.core.store import KeptFiles, altered, digest_of, inside, locked, make_one, marked, with_digest
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from winchcascade.diagnosis.suspects import Suspects

_PACKAGE = Path(__file__).parent.parent


def packaged_campaign() -> Path:
    """Folder of the packaged campaign: inside the package once installed, beside it in a checkout."""
    inside = _PACKAGE / "demo"
    return inside if inside.is_dir() else _PACKAGE.parent / "fixtures" / "campaign"


def copy_campaign(folder: Path, *, force: bool = False) -> Path:
    """Copy the packaged campaign into a folder, and give its campaign.toml.

    Raises
    ------
    OutputError : a file of that name with another content is there, and `force` does not allow to replace it
    """
    make_one(folder, "another")
    for source in sorted(packaged_campaign().iterdir()):
        copy, content = folder / source.name, source.read_bytes()
        if copy.is_file() and copy.read_bytes() == content:
            continue
        if copy.exists() and not force:
            raise OutputError(f"{copy}: exists with another content; give --out a new folder or add --force.")
        write_content(copy, content, force=True)
    return folder / "campaign.toml"


KINDS = ("html", "pdf", "json")
"""Endings of the files of a diagnosis."""

DIAGNOSIS_FILES = tuple(f"diagnosis.{kind}" for kind in KINDS)
"""Files of a diagnosis, by their names in the results folder."""


class _KeptLog(msgspec.Struct):
    file: str
    sha256: str


class _KeptDiagnosis(msgspec.Struct):
    """How an earlier call made a diagnosis."""

    logs: list[_KeptLog]
    store: KeptFiles
    version: str = ""


def diagnose_copy(
    campaign: Path,
    folder: Path,
    suspects: Suspects,
    *,
    command: str = "",
    force: bool = False,
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[Path]]:
    """Diagnose the copied campaign into a folder that is there; give the JSON's content and the files: page, PDF, JSON.

    What an earlier call of the same version made of the same logs is kept, unless `force` says otherwise.

    Raises
    ------
    OutputError : a file of that name is not this tool's own, and `force` does not allow to replace it
    """
    files = [inside(folder, f"diagnosis.{kind}") for kind in KINDS]
    with locked(folder, lambda place: on_progress(f"waiting for another call that works in {place}")):
        kept = marked(files[2], _KeptDiagnosis)
        if not force and isinstance(kept, _KeptDiagnosis) and _is_current(kept, folder, campaign.parent):
            return msgspec.json.decode(files[2].read_bytes(), type=dict[str, Any]), files
        from winchcascade.batch.campaign_diagnosis import diagnose_listed
        from winchcascade.core.campaign_file import load_campaign
        from winchcascade.report.diagnosis import make_diagnosis_report
        from winchcascade.report.diagnosis_record import as_json
        from winchcascade.report.publish import publish
        from winchcascade.report.results_index import INDEX, links_to

        for path in files:
            check_replaceable(path, force=force)
        found = diagnose_listed(load_campaign(campaign), suspects, on_progress=on_progress)
        on_progress("writing reports")
        report = make_diagnosis_report(found, command=command)
        report = msgspec.structs.replace(report, links=links_to(["campaign.html", INDEX]))
        publish(report, html=files[0], pdf=files[1], force=force)
        record = as_json(found) | {"version": __version__}
        digests = {path.name: digest_of(path.read_bytes()) for path in files[:2]}
        write_content(files[2], with_digest(record, "store", {"files": digests}, indent=1), force=force)
        return record, files


def _is_current(kept: _KeptDiagnosis, folder: Path, logs: Path) -> bool:
    """Whether the files of an earlier call are as it made them, and its version and its logs were the same."""
    read = {log.file: log.sha256 for log in kept.logs}
    return kept.version == __version__ and not altered(folder, kept.store.files) and not altered(logs, read)
