"""The report of a campaign: its logs compared with each other, made once for the page and the PDF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from urllib.parse import quote

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from winchcascade.core.campaign_file import KINDS, banner, joint_origin, origin_words
from winchcascade.core.cascade import field_of
from winchcascade.diagnosis.model_account import Account
from winchcascade.reduction.best_load import Best, LoadRanking, motion_words, rank_loads
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    FailedLog,
    LogSummary,
    cascade_of,
    runs_by_load,
    unlike_motion,
)
from winchcascade.reduction.run_record import FindingRecord
from winchcascade.reduction.wave_record import CampaignWaves, campaign_waves
from winchcascade.report import sheet as content
from winchcascade.report.campaign_record import has_speeds, mixed_windows, window_text
from winchcascade.report.digits import NumberText, interval_text, percent, stated, with_uncertainty
from winchcascade.report.figures import campaign_figures as figures
from winchcascade.report.figures.style import house_style
from winchcascade.report.model_section import Named, campaign_section
from winchcascade.report.records import read_results
from winchcascade.report.results.waves import campaign_waves_section
from winchcascade.report.sheet import TableColumn
from winchcascade.report.wording import SYMBOL, decimals_of, load_text, metrics_note, symbols_section, unit_of

LISTED = 800
"""Characters of a list of files that is given in full."""

MAX_RUNS = 150
"""Logs that a table lists; of more the first and the last half of that."""


@house_style()
def make_campaign_report(
    campaign: CampaignRecord, out: Path, *, results: Path | None = None, command: str = ""
) -> content.Report:
    """Make the rows and figures of the report of a campaign from its record, its dataset in a folder, and its results.

    Parameters
    ----------
    results : folder by which the record names the results of single logs, if it is another one
    """
    runs, folder = runs_by_load(campaign.reduced), results or out
    waves = None
    if campaign.waves is not UNSET:
        waves = campaign_waves(read_results({run.name: folder / run.result for run in campaign.reduced}))
    return campaign_report(campaign, _bins(out, runs), _model(runs, folder), command=command, waves=waves)


@house_style()
def campaign_report(
    campaign: CampaignRecord,
    bins: figures.Bins,
    model: Sequence[content.Section] = (),
    *,
    command: str = "",
    linked: bool = True,
    waves: CampaignWaves | None = None,
) -> content.Report:
    """Make the rows and figures of the report of a campaign.

    Parameters
    ----------
    bins : of generator speed, by the names of the runs
    model : sections on the logs beside their simulations
    linked : whether the reports of single logs stand beside that of the campaign
    waves : of the logs whose cycles are waves
    """
    runs, failed = runs_by_load(campaign.reduced), campaign.failed
    loaded = [run for run in runs if not run.open_circuit] or runs
    rigs = sorted({run.rig for run in runs})
    energies, logs = (_linked(table, runs) if linked else table for table in (energies_table(runs), logs_table(runs)))
    return content.Report(
        kind="Campaign",
        title=campaign.title,
        subtitle=f"rig {', '.join(rigs)}" if rigs else "",
        tiles=_tiles(loaded),
        points=tuple(_points(runs, failed, loaded)),
        sections=content.filled(
            content.section(
                "results", "Energies and efficiencies",
                _over_load(loaded), energies, logs_efficiencies_table(runs), logs_net_table(runs),
            ),
            *([] if waves is None else [content.of_stated(campaign_waves_section(waves))]),
            content.section(
                "speed", "Over generator speed",
                content.picture(
                    figures.runs_over_speed(runs, bins), "speed",
                    "Means of the payouts of each run in bins of generator speed; markers distinguish the loads."
                    + (" Logs of one load look alike." if figures.look_alike(runs) else "")
                    + (f" {figures.DRAWN_RUNS} runs, evenly chosen." if len(runs) > figures.DRAWN_RUNS else ""),
                    "Curves of binned torque and power over generator speed, one for each run.",
                ),
            ),
            *model,
            content.section("repeatability", "Repeatability", logs_repeatability_table(runs)),
            content.section(
                "findings", "Logs and findings", logs or content.Note("No log could be used."),
                _BETWEEN.of(campaign.between[: content.row_limit(MAX_RUNS)]), _FAULTS.of(failed[: content.row_limit(MAX_RUNS)]),
            ),
            *((symbols_section(cascade_of(runs)),) if runs else ()),
            _provenance(campaign, runs, command),
        ),
        banner=banner([run.origin for run in runs]),
    )  # fmt: skip


_NOT_JOINED = (
    "Lines join only logs of one window rule and of one kind of data; hollow markers are of another than the first. "
)


def _over_load(loaded: Sequence[LogSummary]) -> content.Picture | None:
    """Powers and efficiencies over the load, and what the figure shows."""
    unlike = unlike_motion(loaded)
    return content.picture(
        figures.over_load(loaded),
        "loads",
        f"Mean powers and efficiencies over {figures.over_what(loaded)}; bars are 95 % intervals. "
        + ("Lines join the means of the logs of each load. " if figures.repeated(loaded) else "")
        + (_NOT_JOINED if len(figures.comparable(loaded)) > 1 else "")
        + (
            "Where η_pto is highest, most of the line's energy reaches the DC link."
            if unlike is None
            else f"The points are not of one motion: {motion_words(*unlike)}."
        ),
        "Points of powers and efficiencies over the load; the values are in the tables.",
    )


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
                    found.setdefault(name, []).append({k: value for k, value in row.items() if value is not None})
    return found


class _Kept(msgspec.Struct):
    """What a log's result keeps of its simulation; nothing where it was made without a report."""

    model: Account | None = None


def _model(runs: Sequence[LogSummary], out: Path) -> list[content.Section]:
    """The logs beside their simulations: those that are drawn, and the first open circuit in any case."""
    drawn = figures.drawn_runs(runs)
    opened = [run for run in runs if run.open_circuit][:1]
    shown = [run for run in opened if run not in drawn] + drawn
    found = []
    for run, load in zip(shown, figures.load_names(shown), strict=True):
        try:
            account = msgspec.json.decode((out / run.result).read_bytes(), type=_Kept).model
        except (OSError, msgspec.DecodeError):  # a result of another making
            account = None
        found += [] if account is None else [Named(run.name, load, account)]
    made = campaign_section(found, joint_origin([run.origin for run in runs]).word)
    return [] if made is None else [content.of_stated(made)]


def _name(run: LogSummary) -> str:
    return run.name if run.load is None else f"{load_text(run.load)} Ω"


def _mean(metric: str, run: LogSummary) -> str:
    """Mean of a metric with the digits that its standard uncertainty allows."""
    return stated(run.mean.get(field_of(metric)), run.standard_uncertainty.get(field_of(metric)), decimals_of(metric))


def _interval(metric: str, run: LogSummary) -> str:
    ends, u = run.interval_95.get(field_of(metric)), run.standard_uncertainty.get(field_of(metric))
    return "–" if ends is None or not u else interval_text(*ends, u)


def _tiles(runs: Sequence[LogSummary]) -> tuple[content.Tile, ...]:
    """The best load with its efficiency, and the largest power."""
    tiles, cascade = [], cascade_of(runs)
    eta, delivered = cascade.overall, f"power_{cascade.names[-1]}"
    best = rank_loads(runs).best
    if best is not None:
        sure = f"best with a probability of {percent(best.likely) if best.likely < 0.995 else '>99'} %"
        there = "there" if best.logs == 1 else f"there, highest of {best.logs} logs"
        tiles += [
            content.Tile("Best load", "", _name(best.run), sure),
            content.Tile(SYMBOL[eta], there, _mean(eta, best.run), f"95 %: {_interval(eta, best.run)}"),
        ]
    powers = [run.mean.get(field_of(delivered)) for run in runs]
    powered = [pair for pair in zip(powers, runs, strict=True) if pair[0] is not None and not pair[1].open_circuit]
    for _, run in sorted(powered, key=lambda pair: -(pair[0] or 0.0))[:1]:
        unknown = run.interval_95.get(field_of(delivered)) is None
        text = "uncertainty unknown" if unknown else f"95 %: {_interval(delivered, run)} W"
        there = f"largest, at {_name(run)}{'' if run.plateau_speed_mps is None else f' and {run.plateau_speed_mps:.2f} m/s'}"
        tiles.append(content.Tile(SYMBOL[delivered], there, f"{_mean(delivered, run)} W", text))
    return tuple(tiles)


def _points(
    runs: Sequence[LogSummary], failed: Sequence[FailedLog], loaded: Sequence[LogSummary]
) -> list[content.Point]:
    eta, mixed, ranking = cascade_of(runs).overall, mixed_windows(runs), rank_loads(loaded)
    total, whole = sum(run.cycles for run in runs), sum(run.complete for run in runs)
    found = [run for run in runs if run.findings]
    kinds = ", ".join(sorted({kind.replace("_", " ") for run in found for kind in run.findings}))
    worst = [(maximum, run) for run in loaded if (maximum := run.max_deviation_percent.get(eta)) is not None]
    return [
        *([content.data_point([run.origin for run in runs])] if runs else []),
        *([content.Point("Windows", mixed, "warn")] if mixed else []),
        content.Point(
            "Logs",
            f"{len(runs)} of {len(runs) + len(failed)} reduced, {whole} of {total} cycles complete.",
            "warn" if failed or whole < total else "plain",
        ),
        *_best_point(ranking, loaded, eta),
        *([content.Point("Findings", f"In {len(found)} of {len(runs)} logs: {kinds}.", "warn")] if found else []),
        *([content.Point("Findings", "No fault found in any log.", "good")] if runs and not found else []),
        *(
            content.Point(
                "Repeatability", f"{SYMBOL[eta]} deviates from its mean by {maximum:.2f} % at most, at {_name(run)}."
            )
            for maximum, run in sorted(worst, key=lambda pair: -pair[0])[:1]
        ),
    ]


def _best_point(ranking: LoadRanking, loaded: Sequence[LogSummary], eta: str) -> list[content.Point]:
    """The best load, or why none is claimed; nothing without two loads."""
    if ranking.best is not None:
        return [content.Point("Best load", _best_words(ranking.best, eta))]
    loads = {run.load_ohm for run in loaded if run.load_ohm is not None}
    return [content.Point("Best load", f"None is claimed: {ranking.reason}.", "warn")] if len(loads) > 1 else []


def _best_words(best: Best, eta: str) -> str:
    """The best load and the next one, with their efficiencies."""
    sure = "" if best.likely > 0.95 else " The uncertainties do not distinguish them."
    first = f"{_name(best.run)} with {SYMBOL[eta]} = {_mean(eta, best.run)}"
    return f"{first}, then {_name(best.following)} with {_mean(eta, best.following)}.{sure}"


def _provenance(campaign: CampaignRecord, runs: Sequence[LogSummary], command: str) -> content.Section:
    finite = sorted({run.load for run in runs if run.load is not None and math.isfinite(run.load)})
    results = ", ".join(run.result for run in runs)
    if len(results) > LISTED:
        results = f"runs/NAME.json of the NAME of each of the {len(runs)} logs in campaign.json"
    return content.provenance_section(
        [
            ("Campaign", campaign.title),
            ("Data", origin_words([run.origin for run in runs])),
            ("Logs", f"{len(campaign.runs)}; hash, rig and window of each are in its own report and its result"),
            ("Results", f"{results}; other files in runs are of other calls" if runs else ""),
            ("Loads", ", ".join(f"{load:g}" for load in finite[:20]) + (" Ω" if finite else "")),
        ],
        command,
    )


# ---------------------------------------------------------------------------------------------------------- the tables
_LOG: TableColumn[LogSummary] = TableColumn("Log", text=True, of=lambda run: run.name)
_LOAD: TableColumn[LogSummary] = TableColumn("Load", "Ω", of=lambda run: load_text(run.load))
_SPEED: TableColumn[LogSummary] = TableColumn("Plateau", "m/s", 3, of=lambda run: run.plateau_speed_mps)
_WINDOW: TableColumn[LogSummary] = TableColumn("Window", "s", of=window_text)
_CYCLES: TableColumn[LogSummary] = TableColumn("Cycles", of=lambda run: run.complete)
_LISTED_RUNS = content.Limit(MAX_RUNS, "more, in the dataset")


def _of_log(runs: Sequence[LogSummary]) -> list[TableColumn[LogSummary]]:
    """Columns with which each table over loads begins: log, load and, where it is known, the speed of its plateau."""
    return [_LOG, _LOAD, *([_SPEED] if has_speeds(runs) else [])]


def _linked(table: content.Table | None, runs: Sequence[LogSummary]) -> content.Table | None:
    """A table whose rows lead to the reports of the logs, unless it lists a part of them alone."""
    links = tuple(f"runs/{quote(run.name)}.html" for run in runs)
    return None if table is None else replace(table, links=() if len(runs) > MAX_RUNS else links)


def _given(runs: Sequence[LogSummary], metrics: Iterable[str]) -> list[str]:
    """Metrics of which any log has a mean."""
    return [m for m in metrics if any(run.mean.get(field_of(m)) is not None for run in runs)]


def _metric_column(metric: str) -> TableColumn[LogSummary]:
    """Means of a metric with their standard uncertainties."""
    field, decimals = field_of(metric), decimals_of(metric)

    def text(run: LogSummary) -> NumberText:
        return with_uncertainty(run.mean.get(field), run.standard_uncertainty.get(field), decimals)

    return TableColumn(SYMBOL[metric], unit_of(metric), of=text)


def energies_table(runs: Sequence[LogSummary]) -> content.Table | None:
    """Mean energies and powers of every log with their standard uncertainties (the layout of Table 2)."""
    cascade = cascade_of(runs)
    given = _given(runs, [f"{kind}_{stage}" for stage in cascade.names for kind in ("energy", "power")])
    return content.ItemTable(
        "energies",
        "Mean energies over the integration window and mean powers in it, ± standard uncertainty.",
        [*_of_log(runs), _WINDOW, _CYCLES, *map(_metric_column, given)],
        metrics_note(cascade, given).strip(),
        _LISTED_RUNS,
    ).of(runs)


INTERVALS = (
    "Intervals: coverage 95 %, equal tails; the scatter of the N cycles of a log by Student's t with N − 1 degrees of freedom, "
    "errors of the sensors by their own distributions."
)
"""What the intervals of the means of logs are."""


def logs_efficiencies_table(runs: Sequence[LogSummary]) -> content.Table | None:
    """Mean efficiencies of every log with their standard uncertainties and 95 % intervals; None without logs."""
    cascade = cascade_of(runs)
    given = _given(runs, cascade.ratios)
    pairs = ((_metric_column(m), TableColumn("95 % interval", of=partial(_interval, m))) for m in given)
    return content.ItemTable[LogSummary](
        "efficiencies",
        "Efficiencies: means of the cycles' ratios, ± standard uncertainty, and 95 % intervals.",
        [*_of_log(runs), _WINDOW, *(column for pair in pairs for column in pair)],
        f"{metrics_note(cascade, given)}Errors of the sensors are common to all runs with the same sensors, so differences "
        f"between loads are better known than each value. {INTERVALS}",
        _LISTED_RUNS,
    ).of(runs)


def logs_net_table(runs: Sequence[LogSummary]) -> content.Table | None:
    """Net energies of whole cycles of every log, means with their standard uncertainties; None where no log has any."""
    given = _given(runs, cascade_of(runs).net_metrics)
    ratio = "η_net = E_gen, cycle / E_net. " if "eta_net" in given else ""
    return content.ItemTable(
        "net",
        "Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
        "next onset, ± standard uncertainty.",
        [*_of_log(runs), *map(_metric_column, given)],
        f"These energies do not depend on the integration window. {ratio}"
        "The report of each log states why it has none; in open circuit they are not evaluated.",
        _LISTED_RUNS,
    ).of(runs if given else ())


def logs_repeatability_table(runs: Sequence[LogSummary]) -> content.Table | None:
    """Largest deviation of any cycle from the mean, for every log; None where no log has two cycles."""
    several = [run for run in runs if run.complete > 1]
    metrics = cascade_of(runs).metrics
    given = [m for m in metrics if any(_deviation(field_of(m), run) is not None for run in several)]
    return content.ItemTable(
        "repeatability",
        "Repeatability: largest deviation of any cycle from the mean of its run, in percent of the mean.",
        [
            *_of_log(several),
            _CYCLES,
            *(TableColumn(SYMBOL[m], "%", 2, of=partial(_deviation, field_of(m))) for m in given),
        ],
        limit=_LISTED_RUNS,
    ).of(several if given else ())


def _deviation(field: str, run: LogSummary) -> float | None:
    return run.max_deviation_percent.get(field)


def _findings(run: LogSummary) -> str:
    kinds = ", ".join(kind.replace("_", " ") for kind in run.findings)
    return f"{run.finding_count}: {kinds}" if kinds else "none"


def logs_table(runs: Sequence[LogSummary]) -> content.Table | None:
    """Every log: its cycles, and what was found wrong with it; None without logs."""
    return content.ItemTable[LogSummary](
        "logs",
        "Logs: complete cycles, share of the samples that findings took out, number and kinds of findings.",
        [
            *_of_log(runs),
            _WINDOW,
            TableColumn("Data", text=True, of=lambda run: KINDS[run.origin.measured]),
            TableColumn("Complete cycles", of=lambda run: f"{run.complete} of {run.cycles}"),
            TableColumn("Data lost", "%", of=lambda run: percent(run.removed_share, 2)),
            TableColumn("Findings", text=True, of=_findings),
        ],
        limit=_LISTED_RUNS,
    ).of(runs)


_BETWEEN = content.ItemTable[tuple[str, FindingRecord]](
    "between",
    "Logs that lie apart from the others. The data are kept; the operator decides.",
    [
        TableColumn("Log", text=True, of=lambda one: one[0]),
        TableColumn("Finding", text=True, of=lambda one: f"{one[1].kind.replace('_', ' ')}: {one[1].message}"),
        TableColumn("What to do", text=True, of=lambda one: one[1].action),
    ],
)
"""Findings that a log has beside the others."""

_FAULTS = content.ItemTable[FailedLog](
    "faults",
    "Logs that could not be used.",
    [
        TableColumn("Log", text=True, of=lambda run: run.name),
        TableColumn("Why", text=True, of=lambda run: run.fault),
    ],
)
"""Logs that could not be used, each with its sentence."""
