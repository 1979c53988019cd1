"""The packaged campaign, to try the tool on: simulated logs, rebuilt from a published table, never measured."""

from __future__ import annotations

from pathlib import Path

from winchcascade.errors import OutputError
from winchcascade.files import write_content

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
