"""The loss map of a whole campaign: the operating points of all its logs together."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.ingest.read import read_by
from winchcascade.reduction.loss_map import LossMap, make_loss_map
from winchcascade.reduction.loss_points import LossPoints, joined, loss_points, stages_of_loss
from winchcascade.reduction.reduce import reduce
from winchcascade.report.loss_map_file import check_ending

if TYPE_CHECKING:
    from winchcascade.batch.plan import Plan, Work


def points_of(work: Work) -> LossPoints:
    """Operating points of one log, which is read and reduced anew. Raises as `loss_points`."""
    found = loss_points(reduce(read_by(Path(work.path), work.settings)))
    return msgspec.structs.replace(found, logs=(work.name,))


def check_one_map(plan: Plan, path: Path) -> None:
    """Reject, before any work, a campaign that has no loss map.

    Raises
    ------
    OptionError : an ending of the file that names no format, or logs of different rigs
    RigError : the cascade has no stages without storage between them
    """
    check_ending(path)
    rigs = [item.settings.rig for item in plan.work]
    if any(rig != rigs[0] for rig in rigs):
        raise OptionError(f"--loss-map {path}: the logs are of different rigs; make one map for each of them.")
    stages_of_loss(rigs[0].cascade)


def campaign_loss_map(plan: Plan, names: Container[str], workers: Workers) -> tuple[LossMap, list[str]]:
    """Make the loss map of a campaign; and why logs are left out, as those without an operating point are.

    Parameters
    ----------
    names : of the logs that could be reduced

    Raises
    ------
    LogError : no log has an operating point
    """
    parts: dict[str, LossPoints] = {}
    faults: dict[str, str] = {}
    work = {item.name: item for item in plan.work if item.name in names}
    for name, outcome in workers.run(points_of, work, Nobody()):
        if outcome.value is None:
            faults[name] = outcome.fault or ""
        else:
            parts[name] = outcome.value
    if not parts:
        raise LogError(next(iter(faults.values()), f"{plan.title}: no log was reduced, so there is no loss map."))
    found = make_loss_map(joined([parts[name] for name in work if name in parts]))
    return found, [faults[name] for name in work if name in faults]
