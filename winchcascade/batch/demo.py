"""The packaged campaign, to try the tool on: simulated logs, rebuilt from a published table, never measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, write_content
from winchcascade.core.jobs import set_threads
from winchcascade.core.store import KeptFiles, altered, digest_of, inside, locked, make_one, marked, with_digest
from winchcascade.core.version import __version__

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


RECORD = "json"
"""Ending of the record of a diagnosis, which states how the files were made and is written last."""

KINDS = ("html", "pdf", RECORD)
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


def has_diagnosis(folder: Path, campaign: Path) -> bool:
    """Whether a folder holds the diagnosis that a call of this version made of the same logs, with its files unchanged."""
    kept = marked(inside(folder, f"diagnosis.{RECORD}"), _KeptDiagnosis)
    if not isinstance(kept, _KeptDiagnosis) or kept.version != __version__ or altered(folder, kept.store.files):
        return False
    return not altered(campaign.parent, {log.file: log.sha256 for log in kept.logs})


def diagnosis_of(campaign: Path, command: str, threads: int) -> dict[str, bytes]:
    """Diagnose a campaign with all effects: the files of `KINDS`, by their endings.

    Parameters
    ----------
    command : what was typed, for the report
    """
    from winchcascade.batch.campaign_diagnosis import diagnose_listed
    from winchcascade.core.campaign_file import load_campaign
    from winchcascade.report.render.page import page_text
    from winchcascade.report.render.pdf import pdf_bytes
    from winchcascade.report.results.campaign_index import INDEX, links_to
    from winchcascade.report.results.diagnosis import diagnosis_report
    from winchcascade.report.results.diagnosis_record import as_json
    from winchcascade.rig.effects.catalogue import EFFECTS

    set_threads(threads)
    found = diagnose_listed(load_campaign(campaign), EFFECTS)
    report = diagnosis_report(found, command=command)
    report = msgspec.structs.replace(report, links=links_to(["campaign.html", INDEX]))
    files = {"html": page_text(report).encode(), "pdf": pdf_bytes(report)}
    digests = {f"diagnosis.{kind}": digest_of(content) for kind, content in files.items()}
    record = as_json(found) | {"version": __version__}
    return files | {RECORD: with_digest(record, "store", {"files": digests}, indent=1)}


def keep_diagnosis(
    campaign: Path,
    folder: Path,
    diagnosed: Callable[[], dict[str, bytes]],
    *,
    force: bool = False,
    on_progress: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, object], list[Path]]:
    """Write the diagnosis of the copied campaign into a folder that is there; give the JSON's content and the files.

    What an earlier call of the same version made of the same logs is kept, unless `force` is set.

    Parameters
    ----------
    diagnosed : gives what `diagnosis_of` makes

    Raises
    ------
    OutputError : a file of that name is not this tool's own, and `force` does not allow to replace it
    """
    files = {kind: inside(folder, f"diagnosis.{kind}") for kind in KINDS}
    with locked(folder, lambda place: on_progress(f"waiting for another call that works in {place}")):
        if force or not has_diagnosis(folder, campaign):
            for path in files.values():
                check_replaceable(path, force=force)
            for kind, content in diagnosed().items():
                write_content(files[kind], content, force=force)
        return msgspec.json.decode(files[RECORD].read_bytes(), type=dict[str, object]), list(files.values())
