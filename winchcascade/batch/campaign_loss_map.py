"""The loss map of a whole campaign: the operating points of all its logs together."""

from __future__ import annotations

from collections.abc import Container
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.files import check_ending
from winchcascade.diagnosis.stages.stage_map import LossMap, make_loss_map
from winchcascade.ingest.read import read_by
from winchcascade.report.results.loss_map import ENDINGS

if TYPE_CHECKING:
    from winchcascade.batch.plan import Plan


def check_one_map(plan: Plan, path: Path) -> None:
    """Reject, before any work, a campaign that has no loss map.

    Raises
    ------
    OptionError : an ending of the file that names no format, or logs of different rigs
    """
    check_ending(path, ENDINGS, "--loss-map")
    rigs = [item.settings.rig for item in plan.work]
    if any(rig != rigs[0] for rig in rigs):
        raise OptionError(
            f"--loss-map {path}: the logs are of different rigs; make one map for each of them."
        )


def campaign_loss_map(plan: Plan, names: Container[str]) -> LossMap:
    """Make the loss map of a campaign.

    Parameters
    ----------
    names : of the logs that could be reduced

    Raises
    ------
    LogError : no log has an operating point
    """
    work = [item for item in plan.work if item.name in names]
    if not work:
        raise LogError(f"{plan.title}: no log was reduced, so there is no loss map.")
    runs = [read_by(Path(item.path), item.settings) for item in work]
    return make_loss_map(runs, work[0].settings.rig)
