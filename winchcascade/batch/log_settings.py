"""Settings by which one log is read and reduced, from the options of a command and the campaign
that lists the log.
"""

from __future__ import annotations

from pathlib import Path

from msgspec.structs import replace

from winchcascade.core.campaign_settings import LogSettings, settings_beside
from winchcascade.core.errors import CampaignError


def settings_of(
    log: Path,
    *,
    rig: str | None,
    load_ohm: float | None,
    window: str | None,
    sheet: str | None = None,
) -> LogSettings:
    """Settle what the options of a command leave open by the campaign.toml in the folder of the
    log.

    Raises
    ------
    CampaignError : the campaign.toml cannot be used, and the options leave something open
    RigError : the rig file cannot be used
    """
    from winchcascade.rig.baseline import load_rig  # it imports numpy, for which a help would wait

    named = None if rig is None else load_rig(rig)
    try:
        settings = settings_beside(log, named, sheet, load_rig)
    except CampaignError:
        if named is None or None in (load_ohm, window):
            raise
        settings = LogSettings(named)
    if load_ohm is not None:
        settings = replace(settings, load=load_ohm, load_source="--load-ohm")
    if window is not None:
        settings = replace(settings, window=window)
    return settings if sheet is None else replace(settings, sheet=sheet)
