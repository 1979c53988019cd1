"""The report of a campaign: what its logs say together, made once for the page and the PDF."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.campaign_file import Origin, banner, joint_origin, origin_from, origin_words
from winchcascade.core.version import __version__
from winchcascade.report import campaign_figures as figures
from winchcascade.report import campaign_tables as tables
from winchcascade.report.digits import percent, stated
from winchcascade.report.model_account import Account
from winchcascade.report.model_section import Named, campaign_section
from winchcascade.report.publish import publish
from winchcascade.report.report_model import Note, Point, Report, Section, Table, Tile
from winchcascade.report.report_parts import data_point, made_on, picture, provenance_table, section
from winchcascade.report.style import house_style

SEED = 20260
"""Seed of the draws that tell how likely each load is the best."""

DRAWS = 20_000

LISTED = 800
"""Characters of a list of files that is given in full."""


def write_campaign_reports(
    summary: Mapping[str, Any], out: Path, reports: Sequence[str], *, results: Path | None = None, command: str = ""
) -> None:
    """Write the report of a campaign into the folder that holds its dataset.

    Parameters
    ----------
    summary : the campaign's record, schema `winchcascade/campaign/1`
    reports : "html", "pdf" or both
    results : folder by which the record names the results of single logs, if it is another one
    """
    html, pdf = (out / f"campaign.{ending}" if ending in reports else None for ending in ("html", "pdf"))
    publish(make_campaign_report(summary, out, results=results, command=command), html=html, pdf=pdf, force=True)


def make_campaign_report(
    summary: Mapping[str, Any], out: Path, *, results: Path | None = None, command: str = ""
) -> Report:
    """Make the rows and figures of the report of a campaign from its record, its dataset in a folder, and its results."""
    runs = tables.by_load([run for run in summary["runs"] if run["fault"] is None])
    failed = [run for run in summary["runs"] if run["fault"] is not None]
    loaded = [run for run in runs if not run["open_circuit"]] or runs
    with house_style():
        sections = (
            section(
                "results", "Energies and efficiencies",
                picture(
                    figures.over_load(loaded), "loads",
                    f"Mean powers and efficiencies over {figures.over_what(loaded)}; bars are 95 % intervals. "
                    + ("Lines join the means of the logs of each load. " if figures.repeated(loaded) else "")
                    + _not_joined(loaded)
                    + "Where η_pto is highest, most of the line's energy reaches the DC link.",
                    "Points of powers and efficiencies over the load; the values are in the tables.",
                ),
                tables.energies_table(runs) if runs else None,
                tables.efficiencies_table(runs) if runs else None,
                tables.net_table(runs),
            ),
            section(
                "speed", "Over generator speed",
                picture(
                    figures.over_speed(runs, _bins(out, runs)), "speed",
                    "Means of the payouts of each run in bins of generator speed; markers tell the loads apart."
                    + (" Logs of one load look alike." if figures.look_alike(runs) else "")
                    + (f" {figures.DRAWN_RUNS} runs, evenly chosen." if len(runs) > figures.DRAWN_RUNS else ""),
                    "Curves of binned torque and power over generator speed, one for each run.",
                ),
            ),
            *_model(runs, results or out),
            section("repeatability", "Repeatability", tables.repeatability_table(runs) if runs else None),
            section(
                "findings", "Logs and findings", tables.logs_table(runs) if runs else Note("No log could be used."),
                tables.between_table(summary.get("between_logs", ())),
                tables.faults_table(failed),
            ),
            section("provenance", "Provenance", _provenance(summary, runs, command)),
        )  # fmt: skip
    return Report(
        kind="Campaign",
        title=summary["title"],
        subtitle=_subtitle(runs),
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(loaded),
        points=tuple(_points(runs, failed, loaded)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner(_origins(runs)),
    )


def _not_joined(runs: Sequence[tables.Run]) -> str:
    if len(tables.comparable(runs)) < 2:
        return ""
    return "Lines join only logs of one window rule and of one kind of data; hollow markers are of another than the first. "


def _origins(runs: Sequence[tables.Run]) -> list[Origin]:
    return [origin_from(run) for run in runs]


def _subtitle(runs: Sequence[tables.Run]) -> str:
    rigs = sorted({run["rig"] for run in runs})
    return f"rig {', '.join(rigs)}" if rigs else ""


def _bins(out: Path, runs: Sequence[tables.Run]) -> dict[str, list[dict[str, Any]]]:
    """Bins of the runs that are drawn, from the dataset."""
    from pyarrow import parquet

    names = {run["name"] for run in figures.drawn_runs(runs)}
    found: dict[str, list[dict[str, Any]]] = {}
    columns = ["run", "rpm_low", "rpm_high", "torque_nm", "power_mech_w", "power_gen_w"]
    with parquet.ParquetFile(out / "dataset" / "bins.parquet") as file:
        for batch in file.iter_batches(columns=columns):
            for row in batch.to_pylist():
                if row["run"] in names:
                    found.setdefault(row["run"], []).append(row)
    return found


class _Kept(msgspec.Struct):
    """What a log's result keeps of its simulation; nothing where it was made without a report."""

    model: Account | None = None


def _model(runs: Sequence[tables.Run], out: Path) -> list[Section]:
    """The logs beside their simulations: those that are drawn, and the first open circuit in any case."""
    opened = [run for run in runs if run["open_circuit"]][:1]
    drawn = figures.drawn_runs(runs)
    shown = [run for run in opened if run not in drawn] + drawn
    accounts = [(run, _kept(out / run["result"])) for run in shown]
    loads = figures.load_names(shown)
    found = [Named(run["name"], load, a) for (run, a), load in zip(accounts, loads, strict=True) if a is not None]
    made = campaign_section(found, joint_origin(_origins(runs)).word)
    return [] if made is None else [made]


def _kept(result: Path) -> Account | None:
    """What a log's result keeps of its simulation; None for a result of another making."""
    try:
        return msgspec.json.decode(result.read_bytes(), type=_Kept).model
    except (OSError, msgspec.DecodeError):
        return None


class Best(NamedTuple):
    """The run of the highest eta_pto, how likely its load is the best, the best run of the next load, and how many logs
    the best load has.
    """

    run: tables.Run
    likely: float
    following: tables.Run
    logs: int


def best_load(runs: Sequence[tables.Run]) -> Best | None:
    """The load of the run of the highest eta_pto, and the load that is next; None where none can be told.

    Each mean is drawn from a normal distribution with its standard uncertainty, the runs independent of each other: as
    runs with the same sensors share their errors, the true probability is rather higher. A load is the best where any of
    its runs is.
    """
    given = [run for run in runs if run["mean"]["eta_pto"] is not None and not run["open_circuit"]]
    given = [run for run in given if run["standard_uncertainty"]["eta_pto"] and run["load_ohm"] is not None]
    loads = np.array([run["load_ohm"] for run in given], dtype=float)
    if np.unique(loads).size < 2:
        return None
    mean = np.array([run["mean"]["eta_pto"] for run in given])
    u = np.array([run["standard_uncertainty"]["eta_pto"] for run in given])
    drawn = mean + u * np.random.default_rng(SEED).standard_normal((DRAWS, len(given)))
    share = np.bincount(np.argmax(drawn, axis=1), minlength=len(given)) / DRAWS
    order = np.argsort(-mean, kind="stable")
    same = loads == loads[order[0]]
    following = next(k for k in order.tolist() if not same[k])
    return Best(given[order[0]], float(share[same].sum()), given[following], int(same.sum()))


def _name(run: tables.Run) -> str:
    return run["name"] if tables.load_of(run) is None else f"{tables.load_text(run)} Ω"


def _tiles(runs: Sequence[tables.Run]) -> tuple[Tile, ...]:
    """The best load with its efficiency, and the largest power."""
    tiles = []
    best = best_load(runs)
    if best is not None:
        run, likely = best.run, best.likely
        u, (low, high) = run["standard_uncertainty"]["eta_pto"], run["interval_95"]["eta_pto"]
        tiles.append(
            Tile(
                "Best load",
                "",
                _name(run),
                f"best with a probability of {percent(likely) if likely < 0.995 else '>99'} %",
            )
        )
        tiles.append(
            Tile(
                "η_pto", "there" if best.logs == 1 else f"there, highest of {best.logs} logs",
                stated(run["mean"]["eta_pto"], u, 3), f"95 %: {stated(low, u, 3)} to {stated(high, u, 3)}",
            )
        )  # fmt: skip
    powered = [run for run in runs if run["mean"]["power_gen_w"] is not None and not run["open_circuit"]]
    if powered:
        run = max(powered, key=lambda r: float(r["mean"]["power_gen_w"]))
        u = run["standard_uncertainty"]["power_gen_w"]
        ends = run["interval_95"]["power_gen_w"]
        text = "uncertainty unknown" if ends is None else f"95 %: {stated(ends[0], u, 0)} to {stated(ends[1], u, 0)} W"
        value = stated(run["mean"]["power_gen_w"], u, 0)
        tiles.append(Tile("P_gen", f"largest, at {_name(run)}", f"{value} W", text))
    return tuple(tiles)


def _points(runs: Sequence[tables.Run], failed: Sequence[tables.Run], loaded: Sequence[tables.Run]) -> list[Point]:
    points = []
    if runs:
        points.append(data_point(_origins(runs)))
    mixed = tables.mixed_windows(runs)
    if mixed:
        points.append(Point("Windows", mixed, "warn"))
    total, whole = sum(run["cycles"] for run in runs), sum(run["complete"] for run in runs)
    text = f"{len(runs)} of {len(runs) + len(failed)} reduced, {whole} of {total} cycles complete."
    points.append(Point("Logs", text, "warn" if failed or whole < total else "plain"))
    best = best_load(loaded)
    if best is not None:
        run, following = best.run, best.following
        sure = "" if best.likely > 0.95 else " The uncertainties do not tell them apart."
        values = [stated(r["mean"]["eta_pto"], r["standard_uncertainty"]["eta_pto"], 3) for r in (run, following)]
        points.append(
            Point(
                "Best load", f"{_name(run)} with η_pto = {values[0]}, then {_name(following)} with {values[1]}.{sure}"
            )
        )
    found = [run for run in runs if run["findings"]]
    if found:
        kinds = sorted({kind.replace("_", " ") for run in found for kind in run["findings"]})
        points.append(Point("Findings", f"In {len(found)} of {len(runs)} logs: {', '.join(kinds)}.", "warn"))
    elif runs:
        points.append(Point("Findings", "No fault found in any log.", "good"))
    worst = [
        (run["max_deviation_percent"]["eta_pto"], run)
        for run in loaded
        if run["max_deviation_percent"]["eta_pto"] is not None
    ]
    if worst:
        most, run = max(worst, key=lambda pair: float(pair[0]))
        points.append(Point("Repeatability", f"η_pto deviates from its mean by {most:.2f} % at most, at {_name(run)}."))
    return points


def _provenance(summary: Mapping[str, Any], runs: Sequence[tables.Run], command: str) -> Table:
    loads = [tables.load_of(run) for run in runs]
    finite = sorted({load for load in loads if load is not None and math.isfinite(load)})
    rows = [
        ("Campaign", summary["title"]),
        ("Data", origin_words(_origins(runs))),
        ("Logs", f"{len(summary['runs'])}; hash, rig and window of each are in its own report and its result"),
        ("Results", _results(runs)),
        ("Loads", ", ".join(f"{load:g}" for load in finite[:20]) + (" Ω" if finite else "")),
        ("Made by", f"winchcascade {__version__}"),
        ("Command", command),
        ("Made on", made_on()),
    ]
    return provenance_table(rows)


def _results(runs: Sequence[tables.Run]) -> str:
    """The files that count: an earlier call may have left those of other logs beside them."""
    if not runs:
        return ""
    listed = ", ".join(run["result"] for run in runs)
    if len(listed) > LISTED:
        listed = f"runs/NAME.json of the NAME of each of the {len(runs)} logs in campaign.json"
    return f"{listed}; other files in runs are of other calls"
