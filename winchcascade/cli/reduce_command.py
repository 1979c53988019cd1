"""`winchcascade reduce`: one log to its cycles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from msgspec.structs import replace

from winchcascade.batch.log_settings import settings_of
from winchcascade.cli.options import (
    NO_REPORT,
    ForceOption,
    JsonOption,
    LoadOption,
    LossMapOption,
    ParquetOption,
    RepairsOption,
    RigOption,
    SheetOption,
    WindowOption,
    check_load,
    report_options,
)
from winchcascade.cli.outputs import Printed, Results, check_outputs, deliver, given_command, write_reports
from winchcascade.core.errors import OptionError
from winchcascade.report.report_files import ReportFiles

if TYPE_CHECKING:
    from winchcascade.reduction.loss_map import LossMap
    from winchcascade.reduction.montecarlo import Uncertainty
    from winchcascade.reduction.reduction_result import Reduction


@report_options("html", "pdf", "figures", "tables")
def reduce_command(
    log: Annotated[
        Path,
        typer.Argument(metavar="LOG", help="The log: CSV, .lvm, TDMS, MATLAB, Parquet or Excel.", show_default=False),
    ],
    rig: RigOption = None,
    load_ohm: LoadOption = None,
    window: WindowOption = None,
    sheet: SheetOption = None,
    repairs: RepairsOption = "on",
    json: JsonOption = None,
    parquet: ParquetOption = None,
    report: ReportFiles = NO_REPORT,
    loss_map: LossMapOption = None,
    force: ForceOption = False,
) -> None:
    """Reduce one log to its cycles with their energies and efficiencies, and list the faults of the log.

    If a campaign.toml in the folder of the log lists it, that file gives what the options leave open.
    """
    from winchcascade.ingest.read import read_by
    from winchcascade.reduction.montecarlo import uncertainty
    from winchcascade.reduction.reduce import reduce, require_payouts, window_rule

    _reject_folder(log)
    check_load(load_ohm)
    if window is not None:
        window_rule(window)
    results: Results = {"--json": json, **report.by_option, "--parquet": parquet, "--loss-map": loss_map}
    check_outputs(results, [log, log.parent / "campaign.toml", rig], force=force)
    if loss_map is not None:
        from winchcascade.report.loss_map_file import check_ending

        check_ending(loss_map)
    settings = settings_of(log, rig=rig, load_ohm=load_ohm, window=window, sheet=sheet)
    reduction = reduce(read_by(log, replace(settings, repairs=repairs)))
    require_payouts(reduction)
    mapped = None if loss_map is None else _write_loss_map(reduction, loss_map, force=force)
    if parquet is not None:
        from winchcascade.report.frames import write_parquet

        write_parquet(reduction, parquet, force=force)
    found = uncertainty(reduction)
    if report.wanted:
        from winchcascade.report.results.drawn_reduction import drawn_report

        make = partial(drawn_report, reduction, found, mapped, command=given_command())
        write_reports(make, report, Path(reduction.run.name).stem, force=force)
    files = [path for path in results.values() if path]
    deliver(
        json, lambda: _record(reduction, found), Printed(lambda: _text(reduction, found, mapped, files)), force=force
    )


def _record(reduction: Reduction, found: Uncertainty) -> bytes:
    from winchcascade.report.records import reduction_json

    return reduction_json(reduction, found)


def _text(reduction: Reduction, found: Uncertainty, mapped: LossMap | None, files: Sequence[Path | str]) -> str:
    from winchcascade.report.render.terminal import terminal_text
    from winchcascade.report.results.reduction import reduction_report

    more = {}
    if mapped is not None:
        from winchcascade.report.results.loss_surface import loss_map_section

        more["loss-map"] = loss_map_section(mapped)
    return terminal_text(reduction_report(reduction, found, more=more), files)


def _reject_folder(log: Path) -> None:
    if log.is_dir():
        import shlex

        raise OptionError(
            f"{log}: is not a file but a folder; expected one log. To reduce all logs of a folder, run `winchcascade batch "
            f"{shlex.quote(str(log))} --out results`."
        )


def _write_loss_map(reduction: Reduction, path: Path, *, force: bool) -> LossMap:
    """Make the loss map of a log and write it."""
    from winchcascade.reduction.loss_map import make_loss_map
    from winchcascade.reduction.loss_points import loss_points
    from winchcascade.report.loss_map_file import write_loss_map

    found = make_loss_map(loss_points(reduction), reduction.rig)
    write_loss_map(found, path, reduction.run.name, force=force)
    return found
