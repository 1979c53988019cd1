"""`winchcascade reduce`: one log to its cycles."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from winchcascade.cli.options import (
    ForceOption,
    HtmlOption,
    JsonOption,
    LoadOption,
    PdfOption,
    RigOption,
    SheetOption,
    WindowOption,
)
from winchcascade.cli.outputs import check_outputs, given_command, show
from winchcascade.cli.settings import check_load, read_with, settings_of

if TYPE_CHECKING:
    from winchcascade.reduction.reduction_result import Reduction


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
    run = read_with(log, settings)
    reduction = reduce(run, rig=settings.rig, window=settings.window, cycles=settings.cycles)
    require_payouts(reduction)
    if parquet is not None:
        from winchcascade.report.rows import write_parquet

        write_parquet(reduction, parquet, force=force)
    if json is not None or html is not None or pdf is not None:
        _write_with_uncertainty(reduction, json=json, html=html, pdf=pdf, force=force)
    if json != "-":
        show(reduction_text(reduction))


def _write_with_uncertainty(
    reduction: Reduction, *, json: str | None, html: Path | None, pdf: Path | None, force: bool
) -> None:
    """Write the results that tell how sure the numbers are; JSON goes to standard output if it is called -."""
    from winchcascade.reduction.montecarlo import uncertainty

    found = uncertainty(reduction)
    if html is not None or pdf is not None:
        from winchcascade.report.document import write_reports

        write_reports(reduction, found, html=html, pdf=pdf, command=given_command(), force=force)
    if json is None:
        return
    from winchcascade.report.records import reduction_json, write_json

    if json == "-":
        from winchcascade.core.plain_text import json_without_commands

        sys.stdout.buffer.write(json_without_commands(reduction_json(reduction, found)))
    else:
        write_json(reduction, found, Path(json), force=force)
