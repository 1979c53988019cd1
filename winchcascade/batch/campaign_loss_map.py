"""The loss map of a whole campaign: the operating points of all its logs together."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from winchcascade.batch.results_pages import write_index
from winchcascade.core.errors import LogError, OptionError
from winchcascade.core.jobs import Nobody, Workers
from winchcascade.ingest.read import read_by
from winchcascade.reduction.loss_map import make_loss_map
from winchcascade.reduction.loss_points import LossPoints, joined, loss_points, stages_of_loss
from winchcascade.reduction.reduce import reduce
from winchcascade.report.loss_map_file import check_ending, write_loss_map

if TYPE_CHECKING:
    from winchcascade.batch.plan import Plan, Work
    from winchcascade.batch.run_batch import Batch, Products


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


def write_campaign_loss_map(
    plan: Plan, batch: Batch, products: Products, path: Path, *, workers: Workers, force: bool = False
) -> str:
    """Make the loss map of a campaign, write it and its reports, and describe it for the terminal.

    A log of the batch that has no operating point is named and left out.

    Parameters
    ----------
    products : states which reports are wanted; they are written into the folder of the batch
    path : of the map, `.csv`, `.mat` or `.json`

    Raises
    ------
    LogError : no log has an operating point
    """
    work = {item.name: item for item in plan.work if item.name in batch.results}
    parts: dict[str, LossPoints] = {}
    faults: dict[str, str] = {}
    for name, outcome in workers.run(points_of, work, Nobody()):
        if outcome.value is None:
            faults[name] = outcome.fault or ""
        else:
            parts[name] = outcome.value
    if not parts:
        raise LogError(next(iter(faults.values()), f"{plan.title}: no log was reduced, so there is no loss map."))
    found = make_loss_map(joined([parts[name] for name in work if name in parts]), plan.work[0].settings.rig)
    write_loss_map(found, path, plan.title, force=force)
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.loss_surface import campaign_loss_map_report, loss_map_pictures

    origins = [item.settings.origin for item in work.values()]
    left_out = [faults[name] for name in work if name in faults]
    stated = partial(campaign_loss_map_report, found, plan.title, origins, left_out=left_out, command=products.command)
    files = [path]
    if products.reports:
        from winchcascade.report.figures.style import house_style
        from winchcascade.report.render.publish import publish
        from winchcascade.report.results.campaign_index import INDEX, links_to

        pages = {ending: batch.folder / f"loss_map.{ending}" for ending in products.reports}
        with house_style():
            report = stated(loss_map_pictures(found), links_to(["campaign.html", INDEX]))
        publish(report, html=pages.get("html"), pdf=pages.get("pdf"))
        files += pages.values()
        write_index(batch.folder)
    return f"\n{terminal_text(stated(), files)}"
