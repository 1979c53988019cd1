"""The report of a campaign: its logs compared with each other, made once for the page and the PDF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import msgspec
import numpy as np
from msgspec import UNSET
from msgspec.structs import replace

from winchcascade.core.campaign_file import KINDS, banner, joint_origin, origin_words
from winchcascade.core.cascade import field_of
from winchcascade.report import campaign_figures as figures
from winchcascade.report.campaign_record import (
    CampaignRecord,
    FailedLog,
    LogSummary,
    cascade_of,
    mixed_windows,
    run_load_text,
    runs_by_load,
    window_text,
)
from winchcascade.report.digits import interval_text, percent, stated, with_uncertainty
from winchcascade.report.glossary import symbols_section
from winchcascade.report.model_account import Account
from winchcascade.report.model_section import Named, campaign_section
from winchcascade.report.records import FindingRecord, read_results
from winchcascade.report.report_model import (
    Limit,
    Note,
    Picture,
    Point,
    Report,
    Section,
    Table,
    TableColumn,
    Tile,
    data_point,
    make_table,
    picture,
    provenance_section,
    row_limit,
    rows_of,
    section,
)
from winchcascade.report.style import house_style
from winchcascade.report.wave_section import CampaignWaves, campaign_waves, campaign_waves_section
from winchcascade.report.wording import SYMBOL, decimals_of, metrics_note, unit_of

SEED = 20260
"""Seed of the draws from which the probability follows that a load is the best."""

DRAWS = 20_000

LISTED = 800
"""Characters of a list of files that is given in full."""

MOST_RUNS = 150
"""Logs that a table lists; of more the first and the last half of that."""


def make_campaign_report(
    campaign: CampaignRecord, out: Path, *, results: Path | None = None, command: str = ""
) -> Report:
    """Make the rows and figures of the report of a campaign from its record, its dataset in a folder, and its results.

    Parameters
    ----------
    results : folder by which the record names the results of single logs, if it is another one
    """
    runs, folder = runs_by_load(campaign.reduced), results or out
    waves = None
    if campaign.waves is not UNSET:
        waves = campaign_waves(read_results({run.name: folder / run.result for run in campaign.reduced}))
    with house_style():
        model = _model(runs, folder)
    return campaign_report(campaign, _bins(out, runs), model, command=command, waves=waves)


def campaign_report(
    campaign: CampaignRecord,
    bins: figures.Bins,
    model: Sequence[Section] = (),
    *,
    command: str = "",
    linked: bool = True,
    waves: CampaignWaves | None = None,
) -> Report:
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
    with house_style():
        sections = (
            section(
                "results", "Energies and efficiencies",
                _over_load(loaded),
                energies_table(runs, linked=linked) if runs else None,
                logs_efficiencies_table(runs) if runs else None,
                logs_net_table(runs),
            ),
            *([] if waves is None else [campaign_waves_section(waves)]),
            section(
                "speed", "Over generator speed",
                picture(
                    figures.runs_over_speed(runs, bins), "speed",
                    "Means of the payouts of each run in bins of generator speed; markers distinguish the loads."
                    + (" Logs of one load look alike." if figures.look_alike(runs) else "")
                    + (f" {figures.DRAWN_RUNS} runs, evenly chosen." if len(runs) > figures.DRAWN_RUNS else ""),
                    "Curves of binned torque and power over generator speed, one for each run.",
                ),
            ),
            *model,
            section("repeatability", "Repeatability", logs_repeatability_table(runs)),
            section(
                "findings", "Logs and findings", logs_table(runs, linked=linked) if runs else Note("No log could be used."),
                between_table(campaign.between),
                faults_table(failed),
            ),
            *((symbols_section(cascade_of(runs)),) if runs else ()),
            _provenance(campaign, runs, command),
        )  # fmt: skip
    return Report(
        kind="Campaign",
        title=campaign.title,
        subtitle=f"rig {', '.join(rigs)}" if rigs else "",
        tiles=_tiles(loaded),
        points=tuple(_points(runs, failed, loaded)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner([run.origin for run in runs]),
    )


_NOT_JOINED = (
    "Lines join only logs of one window rule and of one kind of data; hollow markers are of another than the first. "
)


def _over_load(loaded: Sequence[LogSummary]) -> Picture | None:
    """Powers and efficiencies over the load, and what the figure shows."""
    return picture(
        figures.over_load(loaded),
        "loads",
        f"Mean powers and efficiencies over {figures.over_what(loaded)}; bars are 95 % intervals. "
        + ("Lines join the means of the logs of each load. " if figures.repeated(loaded) else "")
        + (_NOT_JOINED if len(figures.comparable(loaded)) > 1 else "")
        + "Where η_pto is highest, most of the line's energy reaches the DC link.",
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


def _model(runs: Sequence[LogSummary], out: Path) -> list[Section]:
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
    return [] if made is None else [made]


class Best(NamedTuple):
    """The log of the highest eta_pto, the probability that its load is the best, the best log of the next load, and how many
    logs the best load has.
    """

    run: LogSummary
    likely: float
    following: LogSummary
    logs: int


def best_load(runs: Sequence[LogSummary]) -> Best | None:
    """The load of the log of the highest efficiency of the whole cascade, and the next load; None where no two can be compared.

    Each mean is drawn from a normal distribution with its standard uncertainty, the logs independent of each other: as
    logs with the same sensors share their errors, the true probability is rather higher. A load is the best where any of
    its logs is.
    """
    eta = cascade_of(runs).overall
    given = [run for run in runs if run.standard_uncertainty.get(eta) and run.mean.get(eta) is not None]
    given = [run for run in given if run.load_ohm is not None and not run.open_circuit]
    loads = np.array([run.load_ohm for run in given], dtype=float)
    if np.unique(loads).size < 2:
        return None
    mean = np.array([run.mean[eta] for run in given])
    u = np.array([run.standard_uncertainty[eta] for run in given])
    drawn = mean + u * np.random.default_rng(SEED).standard_normal((DRAWS, len(given)))
    share = np.bincount(np.argmax(drawn, axis=1), minlength=len(given)) / DRAWS
    order = np.argsort(-mean, kind="stable")
    same = loads == loads[order[0]]
    following = next(k for k in order.tolist() if not same[k])
    return Best(given[order[0]], float(share[same].sum()), given[following], int(same.sum()))


def _name(run: LogSummary) -> str:
    return run.name if run.load is None else f"{run_load_text(run)} Ω"


def _mean(metric: str, run: LogSummary) -> str:
    """Mean of a metric with the digits that its standard uncertainty allows."""
    return stated(run.mean.get(field_of(metric)), run.standard_uncertainty.get(field_of(metric)), decimals_of(metric))


def _interval(metric: str, run: LogSummary) -> str:
    ends, u = run.interval_95.get(field_of(metric)), run.standard_uncertainty.get(field_of(metric))
    return "–" if ends is None or not u else interval_text(*ends, u)


def _tiles(runs: Sequence[LogSummary]) -> tuple[Tile, ...]:
    """The best load with its efficiency, and the largest power."""
    tiles, cascade = [], cascade_of(runs)
    eta, delivered = cascade.overall, f"power_{cascade.names[-1]}"
    best = best_load(runs)
    if best is not None:
        sure = f"best with a probability of {percent(best.likely) if best.likely < 0.995 else '>99'} %"
        there = "there" if best.logs == 1 else f"there, highest of {best.logs} logs"
        tiles.append(Tile("Best load", "", _name(best.run), sure))
        tiles.append(Tile(SYMBOL[eta], there, _mean(eta, best.run), f"95 %: {_interval(eta, best.run)}"))
    powered = [
        (power, run)
        for run in runs
        if (power := run.mean.get(field_of(delivered))) is not None and not run.open_circuit
    ]
    if powered:
        _, run = max(powered, key=lambda pair: pair[0])
        unknown = run.interval_95.get(field_of(delivered)) is None
        text = "uncertainty unknown" if unknown else f"95 %: {_interval(delivered, run)} W"
        tiles.append(Tile(SYMBOL[delivered], f"largest, at {_name(run)}", f"{_mean(delivered, run)} W", text))
    return tuple(tiles)


def _points(runs: Sequence[LogSummary], failed: Sequence[FailedLog], loaded: Sequence[LogSummary]) -> list[Point]:
    points, eta = [data_point([run.origin for run in runs])] if runs else [], cascade_of(runs).overall
    mixed = mixed_windows(runs)
    points += [Point("Windows", mixed, "warn")] if mixed else []
    total, whole = sum(run.cycles for run in runs), sum(run.complete for run in runs)
    points.append(
        Point(
            "Logs",
            f"{len(runs)} of {len(runs) + len(failed)} reduced, {whole} of {total} cycles complete.",
            "warn" if failed or whole < total else "plain",
        )
    )
    best = best_load(loaded)
    if best is not None:
        first, second = (f"{_name(run)} with {{}}{_mean(eta, run)}" for run in (best.run, best.following))
        sure = "" if best.likely > 0.95 else " The uncertainties do not distinguish them."
        points.append(Point("Best load", f"{first.format(f'{SYMBOL[eta]} = ')}, then {second.format('')}.{sure}"))
    found = [run for run in runs if run.findings]
    if found:
        kinds = sorted({kind.replace("_", " ") for run in found for kind in run.findings})
        points.append(Point("Findings", f"In {len(found)} of {len(runs)} logs: {', '.join(kinds)}.", "warn"))
    elif runs:
        points.append(Point("Findings", "No fault found in any log.", "good"))
    worst = [(most, run) for run in loaded if (most := run.max_deviation_percent.get(eta)) is not None]
    if worst:
        most, run = max(worst, key=lambda pair: pair[0])
        points.append(
            Point("Repeatability", f"{SYMBOL[eta]} deviates from its mean by {most:.2f} % at most, at {_name(run)}.")
        )
    return points


def _provenance(campaign: CampaignRecord, runs: Sequence[LogSummary], command: str) -> Section:
    finite = sorted({run.load for run in runs if run.load is not None and math.isfinite(run.load)})
    results = ", ".join(run.result for run in runs)
    if len(results) > LISTED:
        results = f"runs/NAME.json of the NAME of each of the {len(runs)} logs in campaign.json"
    return provenance_section(
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
_LOAD: TableColumn[LogSummary] = TableColumn("Load", "Ω", of=run_load_text)
_WINDOW: TableColumn[LogSummary] = TableColumn("Window", "s", of=window_text)
_CYCLES: TableColumn[LogSummary] = TableColumn("Cycles", of=lambda run: run.complete)


def _table(
    name: str, caption: str, columns: Sequence[TableColumn[LogSummary]], runs: Sequence[LogSummary], note: str = ""
) -> Table:
    """A row for each log, of many for the first and the last ones."""
    rows = rows_of(columns, runs, Limit(MOST_RUNS, "more, in the dataset"))
    return make_table(name, caption, columns, rows, note=note)


def _linked(table: Table, runs: Sequence[LogSummary]) -> Table:
    """A table whose rows lead to the reports of the logs, unless it lists a part of them alone."""
    links = tuple(f"runs/{quote(run.name)}.html" for run in runs)
    return replace(table, links=() if len(runs) > MOST_RUNS else links)


def _given(runs: Sequence[LogSummary], metrics: Iterable[str]) -> list[str]:
    """Metrics of which any log has a mean."""
    return [m for m in metrics if any(run.mean.get(field_of(m)) is not None for run in runs)]


def _with_uncertainty(metric: str, run: LogSummary) -> str:
    value, u = run.mean.get(field_of(metric)), run.standard_uncertainty.get(field_of(metric))
    return with_uncertainty(value, u, decimals_of(metric))


def _metric_columns(metrics: Iterable[str]) -> list[TableColumn[LogSummary]]:
    """Means of metrics with their standard uncertainties."""
    return [TableColumn(SYMBOL[m], unit_of(m), of=partial(_with_uncertainty, m)) for m in metrics]


def energies_table(runs: Sequence[LogSummary], *, linked: bool = True) -> Table:
    """Mean energies and powers of every log with their standard uncertainties (the layout of Table 2)."""
    cascade = cascade_of(runs)
    given = _given(runs, [f"{kind}_{stage}" for stage in cascade.names for kind in ("energy", "power")])
    table = _table(
        "energies",
        "Mean energies over the integration window and mean powers in it, ± standard uncertainty.",
        [_LOG, _LOAD, _WINDOW, _CYCLES, *_metric_columns(given)],
        runs,
        metrics_note(cascade, given).strip(),
    )
    return _linked(table, runs) if linked else table


INTERVALS = (
    "Intervals: coverage 95 %, equal tails; the scatter of the N cycles of a log by Student's t with N − 1 degrees of freedom, "
    "errors of the sensors by their own distributions."
)
"""What the intervals of the means of logs are."""


def logs_efficiencies_table(runs: Sequence[LogSummary]) -> Table:
    """Mean efficiencies of every log with their standard uncertainties and 95 % intervals."""
    cascade = cascade_of(runs)
    given = _given(runs, cascade.ratios)
    columns = [_LOG, _LOAD, _WINDOW]
    for m, column in zip(given, _metric_columns(given), strict=True):
        columns += [column, TableColumn("95 % interval", of=partial(_interval, m))]
    return _table(
        "efficiencies",
        "Efficiencies: means of the cycles' ratios, ± standard uncertainty, and 95 % intervals.",
        columns,
        runs,
        f"{metrics_note(cascade, given)}Errors of the sensors are common to all runs with the same sensors, so differences "
        f"between loads are better known than each value. {INTERVALS}",
    )


def logs_net_table(runs: Sequence[LogSummary]) -> Table | None:
    """Net energies of whole cycles of every log, means with their standard uncertainties; None where no log has any."""
    given = _given(runs, cascade_of(runs).net_metrics)
    return (
        _table(
            "net",
            "Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
            "next onset, ± standard uncertainty.",
            [_LOG, _LOAD, *_metric_columns(given)],
            runs,
            f"These energies do not depend on the integration window. {_NET_RATIO if 'eta_net' in given else ''}"
            "The report of each log states why it has none; in open circuit they are not evaluated.",
        )
        if given
        else None
    )


_NET_RATIO = "η_net = E_gen, cycle / E_net. "


def logs_repeatability_table(runs: Sequence[LogSummary]) -> Table | None:
    """Largest deviation of any cycle from the mean, for every log; None where no log has two cycles."""
    several = [run for run in runs if run.complete > 1]
    metrics = cascade_of(runs).metrics
    given = [m for m in metrics if any(_deviation(field_of(m), run) is not None for run in several)]
    return (
        _table(
            "repeatability",
            "Repeatability: largest deviation of any cycle from the mean of its run, in percent of the mean.",
            [
                _LOG,
                _LOAD,
                _CYCLES,
                *(TableColumn(SYMBOL[m], "%", 2, of=partial(_deviation, field_of(m))) for m in given),
            ],
            several,
        )
        if given
        else None
    )


def _deviation(field: str, run: LogSummary) -> float | None:
    return run.max_deviation_percent.get(field)


def logs_table(runs: Sequence[LogSummary], *, linked: bool = True) -> Table:
    """Every log: its cycles, and what was found wrong with it."""
    table = _table(
        "logs",
        "Logs: complete cycles, share of the samples that findings took out, number and kinds of findings.",
        [
            _LOG,
            _LOAD,
            _WINDOW,
            TableColumn("Data", text=True, of=lambda run: KINDS[run.origin.measured]),
            TableColumn("Complete cycles", of=lambda run: f"{run.complete} of {run.cycles}"),
            TableColumn("Data lost", "%", of=lambda run: percent(run.removed_share, 2)),
            TableColumn("Findings", text=True, of=_findings),
        ],
        runs,
    )
    return _linked(table, runs) if linked else table


def _findings(run: LogSummary) -> str:
    kinds = ", ".join(kind.replace("_", " ") for kind in run.findings)
    return f"{run.finding_count}: {kinds}" if kinds else "none"


def between_table(found: Sequence[tuple[str, FindingRecord]]) -> Table | None:
    """Findings that a log has beside the others; None if there is none."""
    columns: list[TableColumn[tuple[str, FindingRecord]]] = [
        TableColumn("Log", text=True, of=lambda one: one[0]),
        TableColumn("Finding", text=True, of=lambda one: f"{one[1].kind.replace('_', ' ')}: {one[1].message}"),
        TableColumn("What to do", text=True, of=lambda one: one[1].action),
    ]
    return (
        make_table(
            "between",
            "Logs that lie apart from the others. The data are kept; the operator decides.",
            columns,
            rows_of(columns, found[: row_limit(MOST_RUNS)]),
        )
        if found
        else None
    )


def faults_table(failed: Sequence[FailedLog]) -> Table | None:
    """Logs that could not be used, each with its sentence; None if there is none."""
    columns: list[TableColumn[FailedLog]] = [
        TableColumn("Log", text=True, of=lambda run: run.name),
        TableColumn("Why", text=True, of=lambda run: run.fault),
    ]
    rows = rows_of(columns, failed[: row_limit(MOST_RUNS)])
    return make_table("faults", "Logs that could not be used.", columns, rows) if failed else None
