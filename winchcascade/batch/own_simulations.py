"""The owner's own simulations that a campaign lists, or a folder holds, read as the logs are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.errors import CampaignError, OptionError
from winchcascade.ingest.read import read_run

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from winchcascade.core.campaign_file import Campaign
    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run


def with_simulations(campaign: Campaign, folder: Path) -> Campaign:
    """A campaign whose own simulations are the files of a folder with the names of its logs.

    Raises
    ------
    OptionError : the folder does not exist, or lacks the file of a log
    """
    if not folder.is_dir():
        raise OptionError(f"--simulated {folder}: no such folder; expected a folder with one simulation for each log.")
    missing = [entry.file.name for entry in campaign.runs if not (folder / entry.file.name).is_file()]
    if missing:
        raise OptionError(
            f"--simulated {folder}: no file {', '.join(dict.fromkeys(missing))}; expected one simulation for each log of "
            f'{campaign.path}, with the name of the log. To use other names, give simulated = "FILE" beside file there.'
        )
    runs = tuple(msgspec.structs.replace(entry, simulated=folder / entry.file.name) for entry in campaign.runs)
    return msgspec.structs.replace(campaign, runs=runs)


def read_simulations(
    campaign: Campaign, rig: Rig, logs: Sequence[Run], on_progress: Callable[[str], None]
) -> list[Run] | None:
    """Read the own simulation of each run, None where the campaign lists none.

    Raises
    ------
    CampaignError : some runs have a simulation and others have none, or a file does not exist
    LogError : a simulation cannot be read
    """
    if all(entry.simulated is None for entry in campaign.runs):
        return None
    runs = []
    for number, (entry, log) in enumerate(zip(campaign.runs, logs, strict=True), 1):
        place = f"{campaign.path}: run {number} ({entry.file.name})"
        if entry.simulated is None:
            raise CampaignError(
                f'{place} has no simulation, but others have one; expected simulated = "FILE" in every run. '
                "Add it, or remove the others."
            )
        if not entry.simulated.is_file():
            raise CampaignError(
                f"{place}: no file {entry.simulated}; expected the simulation of this run, so check its path."
            )
        on_progress(f"reading {entry.simulated.name} of your simulation ({number} of {len(campaign.runs)})")
        table = entry.sheet if entry.simulated.suffix == entry.file.suffix else None
        runs.append(read_run(entry.simulated, rig=rig, load=log.load, table=table, simulated=True))
    return runs
