"""Settings by which one log is read and reduced, from the options of a command and the campaign that lists the log."""

from __future__ import annotations

from pathlib import Path

import msgspec
from msgspec.structs import replace

from winchcascade.core.campaign_file import Campaign, CampaignRun, Cycles, Origin, campaign_beside
from winchcascade.core.errors import CampaignError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import DEFAULT_RIG
from winchcascade.core.run import Finding, Run
from winchcascade.rig.open_rig import load_rig


class LogSettings(msgspec.Struct, frozen=True):
    """How a log is read and reduced: by the options, else by the campaign that lists it, else by the file or the rig.

    `load` [ohm] is None where only the log may contain it, `load_source` is where it comes from, `window` is a rule or a
    length [s], `cycles` are the first and the last that count, `about` is the title of the campaign, `origin` describes
    where the data come from, and `sheet` names the table to read, None where the file has one only. `parts` is the finding on
    a log of which a campaign lists other cycles elsewhere.
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


def listed_settings(campaign: Campaign, run: CampaignRun, rig: Rig) -> LogSettings:
    """Settings of a log as a campaign lists it; its ranges of time count before [phases] of the rig."""
    if run.ranges:
        rig = replace(rig, phases=replace(rig.phases, source="ranges", ranges=run.ranges))
    return LogSettings(
        rig=rig,
        load=run.load,
        load_source=campaign.path.name if run.load is not None else "unknown",
        window=run.window,
        cycles=run.cycles,
        about=campaign.title,
        origin=run.origin,
        sheet=run.sheet,
    )


def settings_of(
    log: Path, *, rig: str | None, load_ohm: float | None, window: str | None, sheet: str | None = None
) -> LogSettings:
    """Settle what the options of a command leave open by the campaign.toml in the folder of the log.

    Raises
    ------
    CampaignError : the campaign.toml cannot be used, and the options leave something open
    RigError : the rig file cannot be used
    """
    try:
        beside = campaign_beside(log, sheet)
    except CampaignError:
        if None in (rig, load_ohm, window):
            raise
        beside = None
    if beside is None:
        settings = LogSettings(load_rig(rig or DEFAULT_RIG))
    else:
        settings = listed_settings(*beside, load_rig(rig or beside[0].rig or DEFAULT_RIG))
        settings = replace(settings, parts=_listed_in_parts(*beside))
    if load_ohm is not None:
        settings = replace(settings, load=load_ohm, load_source="--load-ohm")
    if window is not None:
        settings = replace(settings, window=window)
    return settings if sheet is None else replace(settings, sheet=sheet)


def _listed_in_parts(campaign: Campaign, entry: CampaignRun) -> Finding | None:
    """What a campaign lists of a log besides an entry, None for nothing."""
    others = [run for run in campaign.runs if run is not entry and run.sheet == entry.sheet]
    others = [run for run in others if run.file.resolve() == entry.file.resolve()]
    if not others:
        return None
    message = (
        f"{campaign.path.name} lists this log {len(others) + 1} times: {_part(entry)} here, and elsewhere "
        f"{' and '.join(map(_part, others))}"
    )
    action = f"the first entry is reduced; `winchcascade batch {campaign.path}` reduces each"
    return Finding("listed_in_parts", message, action, count=len(others))


def _part(run: CampaignRun) -> str:
    """The cycles of an entry, with its load and its window where they are stated."""
    cycles = "all cycles" if run.cycles is None else f"cycles {run.cycles[0]} to {run.cycles[1]}"
    cycles = ", ".join(f"{begin:g} to {end:g} s" for begin, end in run.ranges) or cycles
    load = "" if run.load is None else f"load {run.load:g} ohm"
    window = "" if run.window is None else f"window {run.window:g} s"
    stated = ", ".join(text for text in (load, window) if text)
    return f"{cycles} ({stated})" if stated else cycles


def read_with(path: Path, settings: LogSettings) -> Run:
    """Read a log by its settings. Raises LogError as `read_run`."""
    from winchcascade.ingest.read import read_run

    run = read_run(
        path,
        rig=settings.rig,
        load=settings.load,
        load_source=settings.load_source,
        about=settings.about,
        origin=settings.origin,
        table=settings.sheet,
    )
    return run if settings.parts is None else replace(run, findings=(*run.findings, settings.parts))
