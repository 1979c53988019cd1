"""Draft campaign.toml and rig.toml of a folder of logs, and write those that are not there."""

from __future__ import annotations

import re
from os.path import isfile, lexists, relpath  # lexists: a link that leads nowhere is there, too
from pathlib import Path

import msgspec

from winchcascade.batch.draft_campaign import campaign_text
from winchcascade.batch.draft_rig import fitting_rig, rig_text
from winchcascade.batch.plan import is_log, is_result
from winchcascade.core.campaign_file import CAMPAIGN_FILE
from winchcascade.core.errors import LogError, OptionError, OutputError
from winchcascade.core.files import is_marked, write_content
from winchcascade.core.plain_text import first_of
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import built_in
from winchcascade.ingest.log_facts import LogFacts, log_facts
from winchcascade.rig.baseline import load_rig

RIG_FILE = "rig.toml"

BEFORE = Rig(name="draft")
"""Rig by which logs are read before they have a rig file."""

NAMED_MAX = 12
"""Files that a sentence names."""


class Drafts(msgspec.Struct, frozen=True):
    """Drafted texts by the names of their files, and the reason of each file that is no log."""

    texts: dict[str, str]
    skipped: dict[str, str]


def draft_folder(folder: Path, rig: str | None = None) -> Drafts:
    """Draft the files of a folder; a rig file that is there is used in place of a draft.

    Parameters
    ----------
    rig : rig file or built-in rig to be used in place of a draft

    Raises
    ------
    OptionError : there is no such folder, or no log in it
    RigError : the rig file cannot be used
    """
    if not folder.is_dir():
        what = "is a file" if folder.exists() else "no such folder"
        raise OptionError(f"{folder}: {what}; expected the folder that holds the logs of a rig.")
    own = folder / RIG_FILE
    used = rig or (str(own) if own.is_file() else None)
    logs, skipped = _logs(folder, BEFORE if used is None else load_rig(used))
    if not logs:
        reasons = first_of([*skipped.values()], 3, " ")
        raise OptionError(
            f"{folder}: no log found; expected CSV, TDMS, MATLAB, NetCDF, Parquet or Excel. {reasons}".rstrip()
        )
    base = "" if used is not None else fitting_rig(logs[0], {}, loads=False)[0]
    if base and built_in(base).columns:
        logs, _ = _logs(folder, built_in(base))
    title = folder.resolve().name or "campaign"
    named = RIG_FILE if rig is None else relpath(rig, folder) if isfile(rig) else rig
    texts = {CAMPAIGN_FILE: campaign_text(logs, title, named)}
    if used is None:
        texts[RIG_FILE] = rig_text(logs, title)
    return Drafts(texts, skipped)


def _logs(folder: Path, rig: Rig) -> tuple[list[LogFacts], dict[str, str]]:
    """Logs of a folder, and why each other file is none."""
    logs, skipped = [], {}
    for path in sorted(
        path for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")
    ):
        if path.suffix.casefold() == ".toml":
            continue
        try:
            if not re.fullmatch(r"[^\ud800-\udfff]+", path.name):
                raise LogError(
                    f"{path.name}: its name is no UTF-8, so that no campaign can list it; rename "
                    f"it."
                )
            if is_result(str(path)):
                raise LogError(f"{path.name}: is a result of a batch.")
            found = log_facts(path, rig)
            if is_marked(path) and not found.simulated:
                raise LogError(f"{path.name}: was written by winchcascade, and is no log.")
            if found.fault and not is_log(path.name) and not any(c.channel for c in found.columns):
                raise LogError(f"{path.name}: has no column of a log.")
            logs.append(found)
        except (LogError, OSError) as fault:
            skipped[path.name] = str(fault)
    return logs, skipped


def write_drafts(drafts: Drafts, folder: Path) -> list[Path]:
    """Write the drafts, never over a file: OutputError where there is none to write, or where
    the folder cannot be written.
    """
    new = {folder / name: text for name, text in drafts.texts.items() if not lexists(folder / name)}
    if not new:
        there = first_of(
            [name for name in (CAMPAIGN_FILE, RIG_FILE) if lexists(folder / name)], NAMED_MAX
        )
        raise OutputError(
            f"{folder}: holds {there}, which init never replaces; rename it to draft another."
        )
    for path, text in new.items():
        write_content(path, text)
    return [*new]
