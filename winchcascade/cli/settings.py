"""Rig, load and window of a log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from winchcascade.core.campaign_file import Origin
from winchcascade.core.errors import CampaignError, OptionError

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run


class Settings(NamedTuple):
    """How a log is read and reduced: what the options say, else the campaign beside it, else the file's or the rig's own.

    `load` [ohm] is None where only the log may know it, `load_source` tells where it comes from, `window` is a rule or a
    length [s], `cycles` are the first and the last that count, `about` is the campaign's title, `origin` says where the
    data come from, and `sheet` names the table to read, None where the file holds but one.
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
    from winchcascade.core.campaign_file import campaign_beside
    from winchcascade.core.rig_toml import DEFAULT_RIG, load_rig

    rule: str | float | None = window
    source, about, cycles, origin = "--load-ohm", "", None, Origin()
    try:
        listed = campaign_beside(log, sheet)
    except CampaignError:
        if None in (rig, load_ohm, window):
            raise
        listed = None
    if listed is not None:
        campaign, run = listed
        about, cycles, origin = campaign.title, run.cycles, run.origin
        rig = rig if rig is not None else campaign.rig
        rule = rule if rule is not None else run.window
        sheet = sheet if sheet is not None else run.sheet
        if load_ohm is None:
            load_ohm, source = run.load, campaign.path.name
    return Settings(load_rig(rig or DEFAULT_RIG), load_ohm, source, rule, cycles, about, origin, sheet)


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
    """Refuse a load that is no resistance; OptionError tells what is expected."""
    if load_ohm is not None and not load_ohm > 0:
        raise OptionError(f"--load-ohm {load_ohm:g}: expected a number of ohms above 0, or inf for an open circuit.")
