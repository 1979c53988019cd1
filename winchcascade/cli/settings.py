"""Rig, load and window of a log."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from winchcascade.core.campaign_file import CampaignRun, Origin, campaign_beside
from winchcascade.core.errors import CampaignError, OptionError
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import DEFAULT_RIG
from winchcascade.core.run import Run
from winchcascade.rig.open_rig import load_rig


class Settings(NamedTuple):
    """How a log is read and reduced: by the options, else by the campaign beside it, else by the file or the rig.

    `load` [ohm] is None where only the log may contain it, `load_source` is where it comes from, `window` is a rule or a
    length [s], `cycles` are the first and the last that count, `about` is the title of the campaign, `origin` describes
    where the data come from, and `sheet` names the table to read, None where the file has one only.
    """

    rig: Rig
    load: float | None
    load_source: str
    window: str | float | None
    cycles: tuple[int, int] | None
    about: str
    origin: Origin
    sheet: str | None


def settings_of(
    log: Path, *, rig: str | None, load_ohm: float | None, window: str | None, sheet: str | None = None
) -> Settings:
    """Settle what the options of a command leave open.

    Raises
    ------
    CampaignError : the campaign.toml in the log's folder cannot be used, and the options leave something open
    RigError : the rig file cannot be used
    """
    try:
        campaign, run = campaign_beside(log, sheet) or (None, CampaignRun(log))
    except CampaignError:
        if None in (rig, load_ohm, window):
            raise
        campaign, run = None, CampaignRun(log)
    if rig is None and campaign is not None:
        rig = campaign.rig
    return Settings(
        rig=load_rig(rig or DEFAULT_RIG),
        load=run.load if load_ohm is None else load_ohm,
        load_source="--load-ohm" if load_ohm is not None or campaign is None else campaign.path.name,
        window=run.window if window is None else window,
        cycles=run.cycles,
        about="" if campaign is None else campaign.title,
        origin=run.origin,
        sheet=run.sheet if sheet is None else sheet,
    )


def read_with(log: Path, settings: Settings) -> Run:
    """Read a log by its settings. Raises LogError as `read_run`."""
    from winchcascade.ingest.read import read_run

    return read_run(
        log,
        rig=settings.rig,
        load=settings.load,
        load_source=settings.load_source,
        about=settings.about,
        origin=settings.origin,
        table=settings.sheet,
    )


def check_load(load_ohm: float | None) -> None:
    """Reject a load that is no resistance; OptionError describes what is expected."""
    if load_ohm is not None and not load_ohm > 0:
        raise OptionError(f"--load-ohm {load_ohm:g}: expected a number of ohms above 0, or inf for an open circuit.")
