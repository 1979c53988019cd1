"""`winchcascade init`: drafts of campaign.toml and rig.toml from a folder of logs."""

from __future__ import annotations

from os.path import lexists
from pathlib import Path
from shlex import quote

from winchcascade.cli.options import OUTPUTS, argument, option, with_options
from winchcascade.cli.outputs import show
from winchcascade.core.plain_text import one_line


@with_options(
    folder=argument("FOLDER", "The folder that holds the logs."),
    write=option(
        "--write",
        "",
        "Write the drafts into the folder; a file that is there stays as it is.",
        OUTPUTS,
    ),
)
def init_command(folder: Path, rig: str | None = None, write: bool = False) -> None:
    """Draft campaign.toml and rig.toml from the logs of a folder.

    Loads come from properties, columns, file names and currents, the order from the clocks. What is
    not certain stands as a comment with its reason, as do all numbers of the rig that a diagnosis
    needs. A rig.toml in the folder is used as it is.
    """
    from winchcascade.batch.draft_folder import draft_folder, write_drafts

    drafts = draft_folder(folder, rig)
    written = write_drafts(drafts, folder) if write else []
    for name, text in drafts.texts.items():
        kept = "draft; the file that is there is kept" if lexists(folder / name) else "draft"
        state = "written" if folder / name in written else kept
        show(f"# ---- {folder / name} ({state})\n{text}\n")
    for name, reason in drafts.skipped.items():
        show(f"# no log: {reason if one_line(name) in reason else f'{name}: {reason}'}\n")
    if not write:
        show(f"# `winchcascade init {quote(str(folder))} --write` writes the drafts.\n")
