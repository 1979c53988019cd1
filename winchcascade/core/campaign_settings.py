"""Settings by which one log is read and reduced, as the campaign that lists the log gives them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import msgspec
from msgspec.structs import replace

from winchcascade.core.campaign_file import (
    Campaign,
    CampaignRun,
    Cycles,
    Origin,
    campaign_beside,
    is_same_file,
)
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import first_named, read_columns, read_rig
from winchcascade.core.run import Finding, Repairs


class LogSettings(msgspec.Struct, frozen=True):
    """How a log is read and reduced: by the options, else by the campaign that lists it, else by
    the file or the rig.

    `load` [ohm] is None where only the log may contain it, `load_source` is where it comes from,
    `window` is a rule or a length [s], `cycles` are the first and the last that count, `about` is
    the title of the campaign, `origin` describes where the data come from, and `sheet` names the
    table to read, None where the file has one only. `parts` is the finding on a log of which a
    campaign lists other cycles elsewhere. `repairs` is "off" for a log that is to be kept as it was
    logged. `beside` are the logs of other loggers of the same test.
    """

    rig: Rig
    load: float | None = None
    load_source: str = "unknown"
    window: str | float | None = None
    cycles: Cycles | None = None
    about: str = ""
    origin: Origin = Origin()
    sheet: str | None = None
    parts: Finding | None = None
    repairs: Repairs = "on"
    beside: tuple[Path, ...] = ()


def listed_settings(campaign: Campaign, run: CampaignRun, rig: Rig) -> LogSettings:
    """Settings of a log as a campaign lists it; its ranges of time and columns precede those of the
    rig.

    RigError if its columns are none.
    """
    if run.ranges:
        rig = replace(rig, phases=replace(rig.phases, source="ranges", ranges=run.ranges))
    if run.columns:
        where = f"{campaign.path}: {run.file.name}"
        rig = replace(
            rig, columns=read_columns(run.columns, rig.known_channels, where, rig.columns)
        )
    return LogSettings(
        rig=rig,
        load=run.load,
        load_source=campaign.path.name if run.load is not None else "unknown",
        window=run.window,
        cycles=run.cycles,
        about=campaign.title,
        origin=run.origin,
        sheet=run.sheet,
        beside=run.beside,
    )


def settings_beside(
    log: Path,
    rig: Rig | None,
    sheet: str | None = None,
    read: Callable[[str | Path], Rig] = read_rig,
) -> LogSettings:
    """Settings of a log by the campaign.toml in its folder, if that lists it; those of the rig
    alone without one.

    A given rig counts before that of the campaign, which `read` reads. Raises CampaignError as
    `campaign_beside`, and RigError.
    """
    beside = campaign_beside(log, sheet)
    if beside is None:
        return LogSettings(first_named() if rig is None else rig)
    campaign, run = beside
    settings = listed_settings(
        campaign, run, first_named(campaign.rig, read=read) if rig is None else rig
    )
    if not is_same_file(run.file, log):
        others = [file for file in run.beside if not is_same_file(file, log)]
        settings = replace(settings, beside=(run.file, *others), sheet=None)
    times = sum(
        one.sheet == run.sheet and is_same_file(one.file, run.file) for one in campaign.runs
    )
    if times == 1:
        return settings
    message = (
        f"{campaign.path.name} lists this log {times} times, with other cycles, load or window each"
    )
    action = f"the first entry is reduced; `winchcascade batch {campaign.path}` reduces each"
    return replace(settings, parts=Finding("listed_in_parts", message, action, count=times - 1))
