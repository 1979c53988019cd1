"""`winchcascade reduce`: one log to its cycles."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from msgspec.structs import replace

from winchcascade.batch.log_settings import settings_of
from winchcascade.cli.options import LOG, check_load, with_options
from winchcascade.cli.outputs import NO_OUTPUTS, REPORT, Outputs, given_command, present
from winchcascade.core.errors import OptionError
from winchcascade.core.files import check_ending
from winchcascade.core.run import Repairs

if TYPE_CHECKING:
    from winchcascade.diagnosis.stages.stage_map import LossMap
    from winchcascade.reduction.reduction_result import Reduction


@with_options("json", *REPORT, "parquet", "loss_map", logs=LOG)
def reduce_command(
    logs: list[Path],
    rig: str | None = None,
    load_ohm: float | None = None,
    sheet: str | None = None,
    window: str | None = None,
    repairs: Repairs = "on",
    outputs: Outputs = NO_OUTPUTS,
) -> None:
    """Reduce one log to its cycles with their energies and efficiencies, and list the faults of the
    log.

    If a campaign.toml in the folder of the log lists it, that file gives what the options leave
    open.
    """
    from winchcascade.ingest.read import read_by
    from winchcascade.reduction.reduce import reduce, require_payouts, window_rule
    from winchcascade.reduction.run_record import reduction_json
    from winchcascade.reduction.uncertainty import uncertainty
    from winchcascade.report.results.reduction import reduction_report

    log = _one_log(logs)
    check_load(load_ohm)
    if window is not None:
        window_rule(window)
    outputs.check([log, log.parent / "campaign.toml", rig])
    if outputs["loss_map"] is not None:
        from winchcascade.report.results.loss_map import ENDINGS

        check_ending(outputs["loss_map"], ENDINGS, "--loss-map")
    settings = settings_of(log, rig=rig, load_ohm=load_ohm, window=window, sheet=sheet)
    reduction = reduce(read_by(log, replace(settings, repairs=repairs)))
    require_payouts(reduction)
    mapped = (
        None
        if outputs["loss_map"] is None
        else _write_loss_map(reduction, outputs["loss_map"], force=outputs.force)
    )
    if outputs["parquet"] is not None:
        from winchcascade.report.frames import write_parquet

        write_parquet(reduction, outputs["parquet"], force=outputs.force)
    found = uncertainty(reduction)
    present(
        lambda: reduction_report(reduction, found, mapped, command=given_command()),
        outputs,
        record=lambda: reduction_json(reduction, found),
        name=Path(reduction.run.name).stem,
    )


def _one_log(logs: Sequence[Path]) -> Path:
    """The log that is given; several, and a folder of logs, are a batch: OptionError."""
    if len(logs) == 1 and not logs[0].is_dir():
        return logs[0]
    what = f"{len(logs)} logs" if len(logs) > 1 else f"{logs[0]}: is not a file but a folder"
    batch = shlex.join(["winchcascade", "batch", *map(str, logs), "--out", "results"])
    raise OptionError(f"{what}; expected one log. To reduce several logs, run `{batch}`.")


def _write_loss_map(reduction: Reduction, path: Path, *, force: bool) -> LossMap:
    """Make the loss map of a log and write it."""
    from winchcascade.diagnosis.stages.stage_map import make_loss_map
    from winchcascade.report.results.loss_map import write_loss_map

    found = make_loss_map([reduction.run], reduction.rig)
    write_loss_map(found, path, reduction.run.name, force=force)
    return found
