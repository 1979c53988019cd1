"""`winchcascade reduce`: one log to its cycles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from winchcascade.batch.log_settings import read_with, settings_of
from winchcascade.cli.options import (
    ForceOption,
    HtmlOption,
    JsonOption,
    LoadOption,
    PdfOption,
    RigOption,
    SheetOption,
    WindowOption,
    check_load,
)
from winchcascade.cli.outputs import check_outputs, deliver, given_command


def reduce_command(
    log: Annotated[
        Path, typer.Argument(metavar="LOG", help="CSV, .lvm, TDMS, MATLAB, Parquet or Excel.", show_default=False)
    ],
    rig: RigOption = None,
    load_ohm: LoadOption = None,
    window: WindowOption = None,
    sheet: SheetOption = None,
    json: JsonOption = None,
    parquet: Annotated[
        Path | None, typer.Option("--parquet", metavar="FOLDER", help="Write cycles, bins and findings as Parquet.")
    ] = None,
    html: HtmlOption = None,
    pdf: PdfOption = None,
    force: ForceOption = False,
) -> None:
    """Reduce one log: its cycles, their energies and efficiencies, and what is wrong with it.

    What the options leave open is taken from a campaign.toml in the log's folder, if it lists the log.
    """
    from winchcascade.reduction.reduce import reduce, require_payouts, window_rule
    from winchcascade.report.terminal import reduction_text

    check_load(load_ohm)
    if window is not None:
        window_rule(window)
    results = {"--json": json, "--html": html, "--pdf": pdf, "--parquet": parquet}
    check_outputs(results, [log, log.parent / "campaign.toml", rig], force=force)
    settings = settings_of(log, rig=rig, load_ohm=load_ohm, window=window, sheet=sheet)
    reduction = reduce(read_with(log, settings), rig=settings.rig, window=settings.window, cycles=settings.cycles)
    require_payouts(reduction)
    if parquet is not None:
        from winchcascade.report.rows import write_parquet

        write_parquet(reduction, parquet, force=force)
    found = None
    if json is not None or html is not None or pdf is not None:
        from winchcascade.reduction.montecarlo import uncertainty

        found = uncertainty(reduction)
    if found is not None and (html is not None or pdf is not None):
        from winchcascade.report.document import write_reports

        write_reports(reduction, found, html=html, pdf=pdf, command=given_command(), force=force)

    def content() -> bytes:
        from winchcascade.report.records import reduction_json

        return reduction_json(reduction, found)

    deliver(json, content, lambda: reduction_text(reduction), force=force)
