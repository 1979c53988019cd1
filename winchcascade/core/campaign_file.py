"""campaign.toml: the runs of all loads as data, and where the data of each log come from."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from datetime import datetime  # msgspec evaluates the types of a struct
from functools import lru_cache
from itertools import product
from os.path import (
    isfile,
    realpath,
)  # unlike that of Path, isfile gives no error for a name that no file can have
from pathlib import Path
from shlex import quote
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.errors import CampaignError
from winchcascade.core.toml_file import Table, convert, read_toml, toml_values

Ranges = tuple[tuple[float, float], ...]
"""Begin and end of cycles that are given by time. [s]"""


def check_ranges(ranges: Ranges) -> None:
    """Reject a range that ends before it begins: ValueError."""
    if not all(begin < end for begin, end in ranges):
        raise ValueError(f"ranges_s is {ranges}; expected that each range begins before it ends.")


KINDS = {True: "measured", False: "not measured", None: "not stated"}
"""Words for whether data are measured."""


class Origin(msgspec.Struct, frozen=True):
    """Whether data are measured, None where it is not stated, and one sentence on where they
    come from.
    """

    measured: bool | None = None
    sentence: str = ""

    @property
    def word(self) -> str:
        """What the data are called beside a simulation: `measured` where that is stated, else
        `log`.
        """
        return "measured" if self.measured else "log"


SIMULATED = Origin(False, "Made by winchcascade simulate")
"""Of a log that carries the mark of `simulate`, whatever its campaign states."""


def origin_record(origin: Origin) -> dict[str, bool | str | None]:
    """The origin of data as written files hold it."""
    return {"measured": origin.measured, "origin": origin.sentence or None}


def origin_from(data: Mapping[str, object]) -> Origin:
    """Read the origin of data from the `data` of a written result; one of an earlier version
    states nothing.
    """
    measured, sentence = data.get("measured"), data.get("origin")
    return Origin(
        measured if isinstance(measured, bool) else None,
        sentence if isinstance(sentence, str) else "",
    )


def joint_origin(origins: Sequence[Origin]) -> Origin:
    """The origin of several logs together: what all of them state alike, and every sentence once.

    >>> joint_origin([Origin(True, "Tank test"), Origin(True, "Tank test")])
    Origin(measured=True, sentence='Tank test')
    """
    measured = {origin.measured for origin in origins}
    sentences = dict.fromkeys(origin.sentence.rstrip(". ") for origin in origins if origin.sentence)
    return Origin(measured.pop() if len(measured) == 1 else None, "; ".join(sentences))


CAMPAIGN_FILE = "campaign.toml"

Cycles = tuple[int, int]
"""First and last cycle that count, both included."""

Load = Annotated[float, Meta(gt=0.0)]
"""Resistance of a load, inf for an open circuit. [ohm]"""


class CampaignRun(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    rename={
        "load": "load_ohm",
        "window": "window_s",
        "ranges": "ranges_s",
        "temperature": "temperature_c",
        "sentence": "origin",
    },
):
    """One log of a campaign: its file, load [ohm], fixed window [s], the cycles that count, whether
    it is withheld, and where its data come from.

    `sheet` is the name or number of the table within a workbook, a MATLAB file or TDMS. `simulated`
    is the file of the owner's own simulation of the run, None where there is none.

    `ranges` are begin and end of each cycle on the clock of the log, instead of detected ones [s].
    `load` is None for a rig without one and inf for an open circuit; `window` None where the rule
    of the rig applies. `started` is when the run began: all runs of a campaign have an offset from
    UTC or none has. `temperature` is that of the winding or the housing during the run, as the file
    states it [degC]. `columns` is a table as [columns] of a rig file, for this log alone. `beside` are
    the logs of other loggers of the same test, which a file lists after the first.
    """

    file: Path
    load: Load | None = None
    window: Annotated[float, Meta(gt=0.0, lt=1e9)] | None = None
    cycles: Cycles | None = None
    withheld: bool = False
    ranges: Ranges = ()
    measured: bool | None = None
    sentence: str = ""
    sheet: Annotated[str, Meta(pattern=r"\S")] | None = None
    simulated: Path | None = None
    started: datetime | None = None
    temperature: Annotated[float, Meta(ge=-60.0, le=400.0)] | None = None
    columns: Table = msgspec.field(default_factory=dict)
    beside: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        """Reject cycles and ranges of time that end before they begin: ValueError."""
        check_ranges(self.ranges)
        if self.cycles is not None and not 1 <= self.cycles[0] <= self.cycles[1]:
            raise ValueError(
                f"cycles is {list(self.cycles)}; expected first and last from 1 on, such as [1, "
                f"20]."
            )

    @property
    def origin(self) -> Origin:
        """Where the data come from."""
        return Origin(self.measured, " ".join(self.sentence.split()))


class Campaign(msgspec.Struct, frozen=True):
    """A set of runs on one rig; `rig` is a built-in name, the path of a rig file, or None for
    the paper's rig.
    """

    path: Path
    title: str
    rig: str | None
    runs: tuple[CampaignRun, ...]

    @property
    def name(self) -> str:
        """Its title, or the name of its folder where it has none."""
        return self.title or self.path.resolve().parent.name


class _CampaignFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A campaign file as written."""

    run: Annotated[list[Table], Meta(min_length=1)]
    title: str = ""
    rig: str | None = None
    measured: bool | None = None
    origin: str = ""


def load_campaign(path: Path) -> Campaign:
    """Read a campaign.toml, or the one in a folder; CampaignError names what is wrong and where."""
    if path.is_dir():
        path = path / CAMPAIGN_FILE
        if not path.exists():
            raise CampaignError(
                f"{path.parent}: holds no {CAMPAIGN_FILE}; expected one that lists the logs, each "
                f"with its load. "
                f"`winchcascade init {quote(str(path.parent))}` drafts it."
            )
    if path.exists() and not (path.is_file() and path.suffix.casefold() == ".toml"):
        raise CampaignError(
            f"{path}: is no campaign; expected a {CAMPAIGN_FILE} that lists the logs, or a folder "
            f"with one."
        )
    file, listed = _parsed(read_toml(path, CampaignError), path)
    with_offset = {
        run.started.tzinfo is not None: k
        for k, run in enumerate(listed, 1)
        if run.started is not None
    }
    if len(with_offset) > 1:
        raise CampaignError(
            f"{path}: started of run {with_offset[True]} has an offset from UTC, and that of run "
            f"{with_offset[False]} has "
            "none; expected one in every run, or in none. Add it, such as +02:00, or leave it out."
        )
    if withheld := [k for k, run in enumerate(listed) if run.withheld]:
        logs = [f"{realpath(run.file)}\0{run.sheet or ''}" for run in listed]
        check_held_out(
            [run.file.name for run in listed],
            logs,
            [run.cycles for run in listed],
            withheld,
            str(path),
        )
    rig = file.rig
    return Campaign(
        path,
        file.title,
        str(path.parent / rig) if rig and isfile(path.parent / rig) else rig,
        listed,
    )


@lru_cache(maxsize=8)
def _parsed(text: str, path: Path) -> tuple[_CampaignFile, tuple[CampaignRun, ...]]:
    """A campaign file and its runs from its text, which each log of a folder finds beside it."""
    file: _CampaignFile = convert(
        toml_values(text, str(path), CampaignError), _CampaignFile, f"{path}:", CampaignError
    )
    return file, tuple(
        _run(run, f"{path}: run {k}:", path, file) for k, run in enumerate(file.run, 1)
    )


def _run(raw: Table, place: str, path: Path, campaign: _CampaignFile) -> CampaignRun:
    """One [[run]] table, with what the campaign states of the data.

    The sentence of the campaign is about data of its kind: an entry of the other kind does not take
    it over.
    """
    stated = {"measured": campaign.measured, **raw}
    if stated["measured"] == campaign.measured:
        stated = {"origin": campaign.origin, **stated}
    if isinstance(files := raw.get("file"), list) and files:
        stated["file"], *others = files
        stated["beside"] = [_beside(path, name) for name in others]
    elif "beside" in raw:
        raise CampaignError(f"{place} beside is no key; expected file = [FILE, FILE].")
    for key in ("file", "simulated"):
        if key in stated:
            stated[key] = _beside(path, stated[key])
    if isinstance(raw.get("sheet"), int):
        stated["sheet"] = str(raw["sheet"])
    run: CampaignRun = convert(stated, CampaignRun, place, CampaignError)
    return run


def _beside(path: Path, name: object) -> object:
    """The path of a file that a campaign file names; what is no name stays, to be rejected."""
    return path.parent / name if isinstance(name, str) and name and "\0" not in name else name


def check_held_out(
    names: Sequence[str],
    logs: Sequence[str],
    cycles: Sequence[Cycles | None],
    withheld: Collection[int],
    place: str,
) -> None:
    """Reject a log that is withheld and listed again with cycles that are not: the fit would use
    what it is judged on.

    Parameters
    ----------
    logs : of each run what identifies its log, a path or the digest of its content; empty where it
        is unknown
    cycles : of each run the first and the last that count, None for all
    withheld : numbers of the runs that are withheld, from 0
    """
    for held, kept in product(withheld, range(len(logs))):
        (a, b), (c, d) = cycles[held] or (1, math.inf), cycles[kept] or (1, math.inf)
        if logs[held] and logs[held] == logs[kept] and kept not in withheld and a <= d and c <= b:
            k, n = sorted((held, kept))
            raise CampaignError(
                f"{place}: runs {k + 1} ({names[k]}) and {n + 1} ({names[n]}) are the same log, "
                f"and run {held + 1} is "
                f"withheld; a withheld log takes part in no fit. Remove run {kept + 1}, or give "
                f"each its own cycles."
            )


def is_same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file; only those of the same name are followed."""
    return one.name == other.name and realpath(one) == realpath(other)


def campaign_beside(log: Path, sheet: str | None = None) -> tuple[Campaign, CampaignRun] | None:
    """The campaign in the folder of a log and its entry there, None if there is none or it does not
    list the log.

    CampaignError if it cannot be read, or lists several sheets of the log and none is given.
    """
    path = log.parent / CAMPAIGN_FILE
    if not path.is_file():
        return None
    try:
        campaign = load_campaign(path)
    except CampaignError as fault:
        raise CampaignError(
            f"{fault} To read {log.name} without it, give --rig, --load-ohm and --window, or "
            f"campaign=False in Python."
        ) from None
    listed = [
        run
        for run in campaign.runs
        if any(is_same_file(file, log) for file in (run.file, *run.beside))
    ]
    if sheet is not None:
        listed = [
            run for run in listed if run.sheet is None or run.sheet.casefold() == sheet.casefold()
        ]
    sheets = list(dict.fromkeys(run.sheet for run in listed if run.sheet is not None))
    if sheet is None and len(sheets) > 1:
        raise CampaignError(
            f"{path}: lists {len(sheets)} sheets of {log.name}: {', '.join(map(repr, sheets))}; "
            f"expected one to reduce. Name "
            "it with --sheet NAME, table= in Python, or reduce all by `winchcascade batch`."
        )
    return (campaign, listed[0]) if listed else None
