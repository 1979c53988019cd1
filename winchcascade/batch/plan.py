"""Plan of a batch: the logs of its targets, each with rig, load, window and cycles."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Sequence
from pathlib import Path

import msgspec
from msgspec.structs import replace

from winchcascade.core.campaign_file import CAMPAIGN_FILE, Campaign, load_campaign
from winchcascade.core.campaign_settings import LogSettings, listed_settings
from winchcascade.core.errors import CampaignError, OptionError
from winchcascade.core.plain_text import first_of, one_line
from winchcascade.core.rig_toml import first_named
from winchcascade.core.store import CAMPAIGN_RECORD, digest_of, fingerprint, joint_digest
from winchcascade.core.version import __version__
from winchcascade.ingest.source import LOG_ENDINGS
from winchcascade.rig.baseline import load_rig

RESULTS = 2
"""Form of a log's result: a result of another form is made anew, as the tables of the campaign
need all of its fields.
"""

_RESERVED = frozenset(
    ["CON", "PRN", "AUX", "NUL", *(f"{port}{k}" for port in ("COM", "LPT") for k in range(1, 10))]
)
"""Names that Windows keeps for devices."""

_NAME = 180
"""Bytes of a name: its marks, an ending and a scratch suffix also fit into the 255 that file
systems take.
"""

_LONG_CYCLES = 12
"""Characters of first and last cycle that stand in a name as they are."""

_LONG_SHEET = 40
"""Characters of the name of a sheet that stand in a name."""


class Work(msgspec.Struct, frozen=True):
    """One log to be reduced. `name` is its own among all; `key` changes with everything that its
    result depends on but the log's content.
    """

    name: str
    path: str
    settings: LogSettings
    key: str = ""

    @property
    def fingerprint(self) -> str:
        """Digest of the content of its files now."""
        files: tuple[str | Path, ...] = (self.path, *self.settings.beside)
        return joint_digest([fingerprint(file) for file in files])


class Plan(msgspec.Struct, frozen=True):
    """All logs of one call, as one campaign."""

    title: str
    work: tuple[Work, ...]


def make_plan(
    targets: Sequence[str],
    *,
    rig: str | None = None,
    window: str | float | None = None,
    load_ohm: float | None = None,
) -> Plan:
    """Find the logs of targets: a campaign.toml, a folder, a pattern, or logs.

    Parameters
    ----------
    rig, window : in place of those of a campaign file
    load_ohm : of every log that no campaign file gives a load, in place of what the log states of
        itself [ohm]

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
    if load_ohm is not None:
        given = {"load": load_ohm, "load_source": "--load-ohm"}
        found = [
            work
            if work.settings.load is not None
            else replace(work, settings=replace(work.settings, **given))
            for work in found
        ]
    return Plan(_title(titles), tuple(_named(found)))


def _of_target(target: str, rig: str | None, window: str | float | None) -> tuple[str, list[Work]]:
    if not target:
        raise OptionError("an empty target; expected a campaign.toml, a folder of logs or logs.")
    if re.match(r"[A-Za-z][A-Za-z0-9+.-]+://", target):
        raise OptionError(
            f"{target}: is an address; expected a path. Mount the store, or copy its logs to a "
            f"disk."
        )
    path, of_logs = Path(target), lacks_campaign(target)
    if path.is_file() and path.suffix != ".toml":
        return path.name, _of_logs([target], rig, window)
    if (path.is_dir() or path.suffix == ".toml") and not of_logs:
        campaign = load_campaign(path)
        return campaign.title or path.resolve().name, _of_campaign(campaign, rig, window)
    pattern = os.path.join(glob.escape(str(path)), "*") if of_logs else target
    files = [file for file in sorted(glob.glob(pattern, recursive=True)) if os.path.isfile(file)]
    if not files and not of_logs:
        raise OptionError(
            f"{target}: no such file, folder or pattern; expected a campaign.toml, a folder of "
            f"logs or logs."
        )
    logs = [file for file in files if is_log(file) and not is_result(file)]
    if not logs:
        raise OptionError(
            f"{target}: no log found; expected files that end in "
            f"{', '.join(sorted(LOG_ENDINGS))}, or a {CAMPAIGN_FILE}."
        )
    return path.resolve().name if of_logs else target, _of_logs(logs, rig, window)


def lacks_campaign(target: str) -> bool:
    """Whether a target is a folder without a campaign file."""
    return os.path.isdir(target) and not os.path.isfile(os.path.join(target, CAMPAIGN_FILE))


def is_log(file: str) -> bool:
    """Whether the name of a file ends as a log does, compressed by gzip or not."""
    return file.lower().removesuffix(".gz").rsplit(".", 1)[-1] in LOG_ENDINGS


def is_result(file: str) -> bool:
    """Whether a file lies in the folder of a batch: results are no logs."""
    folder = Path(file).parent
    return folder.name in ("dataset", "runs") and (folder.parent / CAMPAIGN_RECORD).is_file()


def _of_campaign(campaign: Campaign, rig: str | None, window: str | float | None) -> list[Work]:
    known = first_named(rig, campaign.rig, read=load_rig)
    listed = []
    for run in campaign.runs:
        settings = listed_settings(campaign, run, known)
        if window is not None:
            settings = replace(settings, window=window)
        listed.append(Work(run.file.name, str(run.file), settings))
    return listed


def _of_logs(logs: Sequence[str], rig: str | None, window: str | float | None) -> list[Work]:
    """Logs that were named one by one: each with the settings of the campaign file of its
    folder, where that lists it.
    """
    found: list[Work] = []
    listed: dict[Path, dict[Path, list[Work]]] = {}
    usual = first_named(rig, read=load_rig)
    for log in logs:
        folder = Path(log).parent
        if folder not in listed:
            listed[folder] = _listed(folder / CAMPAIGN_FILE, rig, window)
        entries = listed[folder].get(Path(log).resolve(), [])
        alone = Work(Path(log).name, log, LogSettings(usual, window=window))
        found += [replace(entry, path=log) for entry in entries] or [alone]
    return found


def _listed(path: Path, rig: str | None, window: str | float | None) -> dict[Path, list[Work]]:
    """Logs that a campaign file lists, by their resolved paths; none if there is no such file."""
    found: dict[Path, list[Work]] = {}
    for work in _of_campaign(load_campaign(path), rig, window) if path.is_file() else ():
        found.setdefault(Path(work.path).resolve(), []).append(work)
    return found


def _title(titles: Sequence[str]) -> str:
    unique = list(dict.fromkeys(titles))
    if not unique:
        raise CampaignError("no target; expected a campaign.toml, a folder of logs or logs.")
    return first_of(unique, 1)


def _named(work: Sequence[Work]) -> list[Work]:
    """Give each log a name of its own that any file system takes, and the key of its options.

    A name contains no more than distinguishes it, the steadiest part first, so that it stays as it
    is while rig or options change: the file's name, the place of the file, the sheet, the cycles,
    the load and window, then anything.
    """
    once: dict[
        str, tuple[Work, str]
    ] = {}  # of the same log with the same options the first one counts
    for item in work:
        place = os.path.realpath(item.path)  # however it is spelled
        once.setdefault(
            place + _key(replace(item, path="")), (replace(item, key=_key(item)), place)
        )
    work, places = [item for item, _ in once.values()], [place for _, place in once.values()]
    names, settings = [_safe(item.name) for item in work], [item.settings for item in work]
    for marks in (
        [_digest(place) for place in places],
        [
            "" if one.sheet is None else f"sheet-{_safe(one.sheet)[:_LONG_SHEET]}"
            for one in settings
        ],
        ["" if one.cycles is None else f"cycles-{_cycles_mark(*one.cycles)}" for one in settings],
        [_digest(repr((one.load, one.window))) for one in settings],
        [item.key[:8] for item in work],
    ):
        names = _made_unique(names, marks)
    return [replace(item, name=name) for item, name in zip(work, names, strict=True)]


def _made_unique(names: Sequence[str], marks: Sequence[str]) -> list[str]:
    """Add marks to the names that several have whose marks differ; an empty mark adds nothing.

    >>> _made_unique(["a.csv", "A.csv", "b.csv"], ["cycles-1-2", "", "cycles-1-2"])
    ['a.csv-cycles-1-2', 'A.csv', 'b.csv']
    """
    found: dict[str, set[str]] = {}
    for name, mark in zip(names, marks, strict=True):
        found.setdefault(name.casefold(), set()).add(mark)
    return [
        f"{name}-{mark}" if mark and len(found[name.casefold()]) > 1 else name
        for name, mark in zip(names, marks, strict=True)
    ]


def _cycles_mark(first: int, last: int) -> str:
    text = f"{first}-{last}"
    return text if len(text) <= _LONG_CYCLES else _digest(text)


def _digest(text: str) -> str:
    return digest_of(text.encode("utf-8", "replace"))[:8]


def _safe(name: str) -> str:
    """A file name without characters that some file systems reject."""
    name = (
        re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", one_line(name))
        .strip(". ")
        .encode()[:_NAME]
        .decode("utf-8", "ignore")
    )
    return f"_{name}" if name.split(".")[0].upper() in _RESERVED else name or "log"


def _key(work: Work) -> str:
    """Digest of everything that a result depends on besides the log's content: the options, the
    rig, this program.
    """
    options = msgspec.structs.asdict(replace(work.settings, parts=None))
    rig = options.pop("rig")
    stated = repr((RESULTS, __version__, work.path, options))
    # A rig holds a set, whose order differs from process to process.
    encoded = msgspec.json.encode(rig, order="deterministic")
    return digest_of(stated.encode("utf-8", "replace") + encoded)


def result_key(work: Work, digest: str) -> str:
    """Key of the result of a log with this digest of its content."""
    return digest_of(f"{work.key} {digest}".encode())
