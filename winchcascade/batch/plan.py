"""From targets to the work: which logs, with which rig, load, window and cycles."""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.addresses import expand, is_remote, local_path
from winchcascade.core.campaign_file import CAMPAIGN_FILE, Origin, load_campaign
from winchcascade.core.errors import CampaignError, OptionError
from winchcascade.core.files import readable
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import DEFAULT_RIG, load_rig
from winchcascade.core.version import __version__

if TYPE_CHECKING:
    from winchcascade.core.campaign_file import Campaign, CampaignRun

LOGS = frozenset("csv tsv txt dat asc log lvm tdms mat parquet pq xlsx xls xlsm xlsb ods".split())
"""Endings of files that are taken for logs in a folder."""

CYCLES = tuple[int, int]

RESULTS = 2
"""Form of a log's result: a result of another form is made anew, as the tables of the campaign need all of its fields."""

_RESERVED = frozenset(["CON", "PRN", "AUX", "NUL", *(f"{port}{k}" for port in ("COM", "LPT") for k in range(1, 10))])
"""Names that Windows keeps for devices."""

_NAME = 180
"""Bytes of a name, with room for its marks, an ending and a scratch suffix within the 255 that file systems take."""

_LONG_CYCLES = 12
"""Characters of first and last cycle that stand in a name as they are."""


_LONG_SHEET = 40
"""Characters of the name of a sheet that stand in a name."""


class Work(msgspec.Struct, frozen=True):
    """One log to be reduced. `name` is its own among all; `key` changes with everything that its result depends on but
    the log's content.
    """

    name: str
    address: str
    rig: Rig
    load: float | None = None
    load_source: str = "unknown"
    window: float | str | None = None
    cycles: CYCLES | None = None
    about: str = ""
    origin: Origin = Origin()
    key: str = ""
    sheet: str | None = None


class Plan(msgspec.Struct, frozen=True):
    """All logs of one call, as one campaign."""

    title: str
    work: tuple[Work, ...]


def make_plan(targets: Sequence[str], *, rig: str | None = None, window: str | float | None = None) -> Plan:
    """Find the logs of targets: a campaign.toml, a folder, a pattern, logs, or addresses of an object store.

    Parameters
    ----------
    rig, window : instead of what a campaign file says

    Raises
    ------
    CampaignError, OptionError : a target that is none, or that holds no log
    """
    titles: list[str] = []
    found: list[Work] = []
    for target in targets:
        title, work = _of_target(target, rig, window)
        titles.append(title)
        found += work
    return Plan(_title(titles), tuple(_named(found)))


def _of_target(target: str, rig: str | None, window: str | float | None) -> tuple[str, list[Work]]:
    target = local_path(target)
    if not target:
        raise OptionError("an empty target; expected a campaign.toml, a folder of logs or logs.")
    if is_remote(target):
        return target, _of_logs(_logs_only(expand(target), target), rig, window)
    path = Path(target)
    if path.is_dir() and not (path / CAMPAIGN_FILE).is_file():
        return path.resolve().name, _of_logs(_in_folder(path), rig, window)
    if path.is_dir() or path.suffix == ".toml":
        campaign = load_campaign(path)
        return campaign.title or path.resolve().name, _of_campaign(campaign, rig, window)
    if path.is_file():
        return path.name, _of_logs([target], rig, window)
    matches = sorted(glob.glob(target, recursive=True))
    files = [match for match in matches if Path(match).is_file()]
    if not files:
        raise OptionError(
            f"{target}: no such file, folder or pattern; expected a campaign.toml, a folder of logs or logs."
        )
    return target, _of_logs(_logs_only(files, target), rig, window)


def _in_folder(folder: Path) -> list[str]:
    files = sorted(str(path) for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    return _logs_only(files, str(folder))


def _logs_only(files: Sequence[str], target: str) -> list[str]:
    logs = [file for file in files if file.rsplit(".", 1)[-1].lower() in LOGS and not _is_result(file)]
    if not logs:
        raise OptionError(
            f"{target}: no log found; expected files that end in {', '.join(sorted(LOGS))}, or a {CAMPAIGN_FILE}."
        )
    return logs


def _is_result(file: str) -> bool:
    """Whether a file lies in the folder of a batch: results are no logs."""
    folder = Path(file).parent
    return folder.name in ("dataset", "runs") and (folder.parent / "campaign.json").is_file()


def _of_campaign(campaign: Campaign, rig: str | None, window: str | float | None) -> list[Work]:
    known = load_rig(rig or campaign.rig or DEFAULT_RIG)
    return [_of_run(campaign, run, known, window) for run in campaign.runs]


def _of_run(campaign: Campaign, run: CampaignRun, rig: Rig, window: str | float | None) -> Work:
    return Work(
        name=run.file.name,
        address=str(run.file),
        rig=rig,
        load=run.load,
        load_source=campaign.path.name if run.load is not None else "unknown",
        window=window if window is not None else run.window,
        cycles=run.cycles,
        about=campaign.title,
        origin=run.origin,
        sheet=run.sheet,
    )


def _of_logs(logs: Sequence[str], rig: str | None, window: str | float | None) -> list[Work]:
    """Logs that were named one by one: each as its own campaign file says, where one lists it."""
    found: list[Work] = []
    listed: dict[Path, tuple[Campaign, Rig, dict[Path, list[CampaignRun]]] | None] = {}
    usual = load_rig(rig or DEFAULT_RIG)
    for log in logs:
        entry = None
        if not is_remote(log):
            folder = Path(log).parent
            if folder not in listed:
                listed[folder] = _listed(folder, rig)
            entry = listed[folder]
        runs = [] if entry is None else entry[2].get(Path(log).resolve(), [])
        if entry is not None and runs:
            counted = runs if any(run.sheet is not None for run in runs) else runs[-1:]
            found += [msgspec.structs.replace(_of_run(entry[0], run, entry[1], window), address=log) for run in counted]
        else:
            found.append(Work(name=log.rsplit("/", 1)[-1], address=log, rig=usual, window=window))
    return found


def _listed(folder: Path, rig: str | None) -> tuple[Campaign, Rig, dict[Path, list[CampaignRun]]] | None:
    path = folder / CAMPAIGN_FILE
    if not path.is_file():
        return None
    campaign = load_campaign(path)
    runs: dict[Path, list[CampaignRun]] = {}
    for run in campaign.runs:
        runs.setdefault(run.file.resolve(), []).append(run)
    return campaign, load_rig(rig or campaign.rig or DEFAULT_RIG), runs


def _title(titles: Sequence[str]) -> str:
    unique = list(dict.fromkeys(titles))
    if not unique:
        raise CampaignError("no target; expected a campaign.toml, a folder of logs or logs.")
    return unique[0] if len(unique) == 1 else f"{unique[0]} and {len(unique) - 1} more"


def _named(work: Sequence[Work]) -> list[Work]:
    """Give each log a name of its own that any file system takes, and the key of its options.

    A name has no more in it than tells it apart, the steadiest first, so that it stays as it is while rig or options
    change: the file's name, the place of the file, the sheet, the cycles, the load and window, then anything.
    """
    once = {
        _same(item): item for item in reversed(work)
    }  # the same log with the same options is one, the first of them
    work = [msgspec.structs.replace(item, key=_key(item)) for item in reversed(once.values())]
    names = [_safe(item.name) for item in work]
    for mark in (_place_mark, _sheet_mark, _cycles_mark, _options_mark, _key_mark):
        names = _told_apart(names, [mark(item) for item in work])
    return [msgspec.structs.replace(item, name=name) for item, name in zip(work, names, strict=True)]


def _told_apart(names: Sequence[str], marks: Sequence[str]) -> list[str]:
    """Add marks to the names that several have whose marks differ; an empty mark adds nothing.

    >>> _told_apart(["a.csv", "A.csv", "b.csv"], ["cycles-1-2", "", "cycles-1-2"])
    ['a.csv-cycles-1-2', 'A.csv', 'b.csv']
    """
    found: dict[str, set[str]] = {}
    for name, mark in zip(names, marks, strict=True):
        found.setdefault(name.casefold(), set()).add(mark)
    return [
        f"{name}-{mark}" if mark and len(found[name.casefold()]) > 1 else name
        for name, mark in zip(names, marks, strict=True)
    ]


def _place_mark(work: Work) -> str:
    return _digest(_place(work))


def _sheet_mark(work: Work) -> str:
    """The sheet that is read, as a word; nothing where none is named."""
    return "" if work.sheet is None else f"sheet-{_safe(work.sheet)[:_LONG_SHEET]}"


def _cycles_mark(work: Work) -> str:
    """The cycles that count, as a word; nothing for all of them."""
    if work.cycles is None:
        return ""
    first, last = work.cycles
    text = f"{first}-{last}"
    return f"cycles-{text if len(text) <= _LONG_CYCLES else _digest(text)}"


def _options_mark(work: Work) -> str:
    return _digest(repr((work.load, work.window)))


def _key_mark(work: Work) -> str:
    return work.key[:8]


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "replace")).hexdigest()[:8]


def _same(work: Work) -> str:
    """What two entries share that are one log with the same options, however its path is spelled."""
    return _place(work) + _key(msgspec.structs.replace(work, address=""))


def _place(work: Work) -> str:
    """Where a log lies, however its path is spelled."""
    try:
        return work.address if is_remote(work.address) else os.path.realpath(work.address)
    except ValueError:  # no path of this system
        return work.address


def _safe(name: str) -> str:
    """A file name without what some file system refuses."""
    name = re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", readable(name)).strip(". ").encode()[:_NAME].decode("utf-8", "ignore")
    return f"_{name}" if name.split(".")[0].upper() in _RESERVED else name or "log"


def _key(work: Work) -> str:
    """Digest of everything that a result depends on besides the log's content: the options, the rig, this program."""
    said = (RESULTS, work.address, work.load, work.load_source, work.window, work.cycles, work.about, work.origin)
    sheet = () if work.sheet is None else (work.sheet,)
    content = repr((*said, *sheet)).encode("utf-8", "replace") + msgspec.json.encode(work.rig) + __version__.encode()
    return hashlib.sha256(content).hexdigest()
