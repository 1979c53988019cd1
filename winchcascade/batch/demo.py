"""The packaged campaign, to try the tool on: simulated logs, rebuilt from a published table, never measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable, write_content
from winchcascade.core.store import Digest, altered, digest_in, digest_of, inside, locked, with_digest
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
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise OutputError(f"{folder}: the folder cannot be made ({fault.strerror}); choose another.") from None
    for source in sorted(packaged_campaign().iterdir()):
        copy, content = folder / source.name, source.read_bytes()
        if copy.is_file() and copy.read_bytes() == content:
            continue
        if copy.exists() and not force:
            raise OutputError(f"{copy}: exists with another content; give --out a new folder or add --force.")
        write_content(copy, content, force=True)
    return folder / "campaign.toml"


KINDS = ("html", "pdf", "json")
"""Files of a diagnosis."""


def diagnose_copy(
    campaign: Path,
    folder: Path,
    suspects: Suspects,
    *,
    command: str = "",
    force: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[dict[str, Any], list[Path]]:
    """Diagnose the copied campaign into a folder that is there; give the JSON's content and the files: page, PDF, JSON.

    What an earlier call of the same version made of the same logs is kept, unless `force` says otherwise.

    Raises
    ------
    OutputError : a file of that name is not this tool's own, and `force` does not allow to replace it
    """
    files = [inside(folder, f"diagnosis.{kind}") for kind in KINDS]
    with locked(folder, lambda place: tell(f"waiting for another call that works in {place}")):
        kept = None if force else _kept(files, campaign)
        if kept is not None:
            return kept, files
        from winchcascade.batch.campaign_diagnosis import diagnose_file
        from winchcascade.report.diagnosis import write_diagnosis_reports
        from winchcascade.report.diagnosis_record import as_json

        for path in files:
            check_replaceable(path, force=force)
        found = diagnose_file(campaign, suspects, tell=tell)
        tell("writing reports")
        write_diagnosis_reports(found, html=files[0], pdf=files[1], command=command, force=force)
        record = as_json(found) | {"version": __version__}
        digests = {path.name: digest_of(path.read_bytes()) for path in files[:2]}
        write_content(files[2], with_digest(record, "store", {"files": digests}, indent=1), force=force)
        return record, files


def _kept(files: list[Path], campaign: Path) -> dict[str, Any] | None:
    """What an earlier call found, if its files are as it made them and its version and its logs were the same."""
    try:
        content = files[2].read_bytes()
        record: dict[str, Any] = msgspec.json.decode(content, type=dict[str, Any])
        logs = {log["file"]: log["sha256"] for log in record["logs"]}
        whole = digest_in(content) is Digest.RIGHT and not altered(files[2].parent, record["store"]["files"])
        same = whole and not altered(campaign.parent, logs)
    except (OSError, msgspec.DecodeError, UnicodeDecodeError, RecursionError, KeyError, TypeError):
        return None
    return record if same and record.get("version") == __version__ else None
