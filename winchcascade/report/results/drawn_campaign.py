"""The report of a campaign with its figures and the simulations of its logs, for page, PDF and
files.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
from msgspec import UNSET

from winchcascade.core.campaign_file import joint_origin
from winchcascade.diagnosis.explain.model_comparison import Account
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    CampaignReduction,
    LogSummary,
    runs_by_load,
    unlike_motion,
)
from winchcascade.reduction.run_record import RunRecord, read_results
from winchcascade.reduction.wave_energies import CampaignWaves, LogWaves, campaign_waves
from winchcascade.report.content import Picture, Report, Section, picture
from winchcascade.report.figures import campaign_figures as figures
from winchcascade.report.figures.style import house_style
from winchcascade.report.results.campaign import campaign_report, loaded
from winchcascade.report.results.model_section import Named, campaign_section


@house_style()
def written_campaign(
    campaign: CampaignRecord, out: Path, *, results: Path | None = None, command: str = ""
) -> Report:
    """Report of a campaign from its record, its dataset in a folder, and its results.

    Parameters
    ----------
    results : folder by which the record names the results of single logs, if it is another one
    """
    runs, folder = runs_by_load(campaign.reduced), results or out
    paths = (
        {run.name: folder / run.result for run in campaign.reduced}
        if campaign.waves is not UNSET
        else {}
    )
    waves = _waves(read_results(paths))
    drawn, model = _pictures(runs, _bins(out, runs)), _model(runs, folder)
    return campaign_report(
        campaign, drawn=drawn, model=model, waves=waves, linked=True, command=command
    )


@house_style()
def reduced_campaign(result: CampaignReduction, *, command: str = "") -> Report:
    """Report of the reductions of a campaign, without the simulations of its logs."""
    drawn = _pictures(runs_by_load(result.summary.reduced), result.bins)
    return campaign_report(
        result.summary, drawn=drawn, waves=_waves(result.records.items()), command=command
    )


def _waves(records: Iterable[tuple[str, RunRecord]]) -> CampaignWaves | None:
    """The waves of the logs of a campaign together, by the records of its logs."""
    return campaign_waves(LogWaves(name, of.log.load, of.waves) for name, of in records if of.waves)


def _pictures(runs: Sequence[LogSummary], bins: figures.Bins) -> dict[str, Picture | None]:
    """Figures of a campaign by their names."""
    joined = " Lines join only logs of one window rule and of one kind of data; hollow markers are of another."
    caption = f"Mean powers and efficiencies over {figures.over_what(loaded(runs))}; bars are 95 % intervals."
    caption += joined if len(figures.comparable(loaded(runs))) > 1 else ""
    caption += " The points are not of one motion." if unlike_motion(loaded(runs)) else ""
    alike = " Logs of one load look alike." if figures.look_alike(runs) else ""
    some = f" {figures.DRAWN_RUNS} logs, evenly chosen." if len(runs) > figures.DRAWN_RUNS else ""
    return {
        "loads": picture(
            figures.over_load(loaded(runs)), "loads", caption,
            "Points of powers and efficiencies over the load; the values are in the table.",
        ),
        "speed": picture(
            figures.runs_over_speed(runs, bins), "speed",
            f"Means of the payouts of each log in bins of generator speed.{alike}{some}",
            "Curves of binned torque and power over generator speed, one for each log.",
        ),
    }  # fmt: skip


def _bins(out: Path, runs: Sequence[LogSummary]) -> figures.Bins:
    """Bins of the runs that are drawn, from the dataset."""
    from pyarrow import parquet

    names = {run.name for run in figures.drawn_runs(runs)}
    found: dict[str, list[dict[str, float]]] = {}
    columns = ["run", "rpm_low", "rpm_high", "torque_nm", "power_mech_w", "power_gen_w"]
    with parquet.ParquetFile(out / "dataset" / "bins.parquet") as file:
        for batch in file.iter_batches(columns=columns):
            for row in batch.to_pylist():
                if (name := row.pop("run")) in names:
                    found.setdefault(name, []).append(
                        {k: value for k, value in row.items() if value is not None}
                    )
    return found


class _Kept(msgspec.Struct):
    """What a log's result keeps of its simulation; nothing where it was made without a report."""

    model: Account | None = None


def _model(runs: Sequence[LogSummary], out: Path) -> Section | None:
    """The logs beside their simulations, those that are drawn."""
    shown = figures.drawn_runs(runs)
    found = []
    for run, load in zip(shown, figures.load_names(shown), strict=True):
        try:
            account = msgspec.json.decode((out / run.result).read_bytes(), type=_Kept).model
        except (OSError, msgspec.DecodeError):  # a result of another making
            account = None
        found += [] if account is None else [Named(run.name, load, account)]
    return campaign_section(found, joint_origin([run.origin for run in runs]).word)
