"""A campaign of a rig with a model, from its file to its diagnosis, and the predictions of the logs that were withheld."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.campaign import load_campaign
from winchcascade.diagnose.campaign import Diagnosis, diagnose, withheld_numbers
from winchcascade.diagnose.record import as_json
from winchcascade.errors import CampaignError
from winchcascade.ingest.read import read_run
from winchcascade.rig.simulate import simulate
from winchcascade.rig.write import write_log
from winchcascade.rigtoml import DEFAULT_RIG, load_rig

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from winchcascade.campaign import Campaign
    from winchcascade.rigfile import Rig


def diagnose_file(
    path: Path,
    suspects: Mapping[str, type],
    *,
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose a campaign.toml, or the one in a folder, on its own rig; faults as `diagnose_listed`."""
    campaign = load_campaign(path)
    return diagnose_listed(campaign, load_rig(campaign.rig or DEFAULT_RIG), suspects, seed=seed, tell=tell)


def diagnose_listed(
    campaign: Campaign,
    rig: Rig,
    suspects: Mapping[str, type],
    *,
    loads: Sequence[float] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> Diagnosis:
    """Diagnose the logs that a campaign lists.

    Parameters
    ----------
    rig : for which a model can be made
    loads : of the runs to withhold; by default those that the campaign marks [ohm]

    Raises
    ------
    WinchcascadeError : something of the input cannot be used; the message says what
    """
    runs = []
    for number, entry in enumerate(campaign.runs, 1):
        tell(f"reading {entry.file.name} ({number} of {len(campaign.runs)})")
        run = read_run(entry.file, rig=rig, load=entry.load, origin=entry.origin, table=entry.sheet)
        if run.load is None:
            raise CampaignError(
                f"{campaign.path}: run {number} ({entry.file.name}) has no load; a diagnosis simulates it, so give load_ohm."
            )
        runs.append(run)
    return diagnose(
        runs,
        rig,
        suspects,
        title=campaign.name,
        cycles=[entry.cycles for entry in campaign.runs],
        withheld=withheld_numbers(loads, runs, [entry.withheld for entry in campaign.runs]),
        seed=seed,
        tell=tell,
    )


def diagnose_campaign(
    campaign_toml: Path, *, suspects: Mapping[str, type], seed: int, predictions: Path | None
) -> dict[str, Any]:
    """Diagnose a campaign for a trial: JSON as a dict, predictions into a folder if one is given."""
    found = diagnose_file(campaign_toml, suspects, seed=seed)
    if predictions is not None:
        write_predictions(found, predictions)
    return as_json(found)


def write_predictions(found: Diagnosis, folder: Path, *, force: bool = False) -> list[Path]:
    """Write what is predicted of every withheld log, as simulated logs: `before`, the rig as given, and `after`, by the fit
    without that log; zeros of its sensors are in neither.

    Raises
    ------
    OutputError : a file cannot be written, or is not this tool's own and `force` does not allow to replace it
    """
    data = found.data
    logs = found.closure.predictions if found.closure is not None else ()
    written = []
    for side in ("before", "after"):
        (folder / side).mkdir(parents=True, exist_ok=True)
    for one in logs:
        run = data.logs[one.log].run
        nu = np.where([n.kind == "zero" for n in data.nuisances], 0.0, one.fit.nu)
        after = data.models(nu, one.fit.effects(found.suspects))[one.log]
        for side, model in (("before", data.nominal), ("after", after)):
            path = folder / side / f"{_stem(run.name)}.csv"
            write_log(simulate(run, model), path, force=force)
            written.append(path)
    return written


def _stem(name: str) -> str:
    return name.rpartition(".")[0] or name
