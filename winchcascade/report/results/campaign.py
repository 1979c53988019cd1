"""What a campaign states: efficiencies by load with their figure (Fig. 7), the best load, how well
cycles repeat, and what was found in its logs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import UNSET

from winchcascade.core.campaign_file import joint_origin
from winchcascade.core.cascade import field_of
from winchcascade.core.plain_text import first_of, one_line
from winchcascade.core.run import Signal
from winchcascade.reduction.campaign_record import (
    Best,
    CampaignRecord,
    CampaignReduction,
    FailedLog,
    LogSummary,
    cascade_of,
    rank_loads,
    rule_of,
    runs_by_load,
    unlike_motion,
    window_rules,
)
from winchcascade.reduction.run_record import FindingRecord, RunRecord, read_results
from winchcascade.reduction.wave_energies import CampaignWaves, LogWaves, campaign_waves
from winchcascade.report.content import (
    Blocks,
    Column,
    Note,
    Picture,
    Report,
    Section,
    Tile,
    section,
    shown,
    table,
)
from winchcascade.report.figures.reduction_figures import stage_of
from winchcascade.report.figures.style import (
    COLOURS,
    label_panel,
    look_of,
    panel_figure,
    readable,
)
from winchcascade.report.glossary import metric, tex
from winchcascade.report.results.campaign_tables import (
    budget_table,
    given,
    interval,
    logs_table,
    mean_of,
    net_table,
    repeatability_table,
    uncertainty_table,
)
from winchcascade.report.results.common import data_note, model_section, provenance
from winchcascade.report.results.waves import campaign_waves_section, wave_tiles
from winchcascade.report.wording import at_most, banner, load_words, origin_words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MAX_RESULTS_TEXT = 800
"""A list of result files up to this length is given in full. [characters]"""

MAX_FAULTS = 10
"""Logs that could not be used which the first screen names; a table holds all."""

MORE = "{} more, all in campaign.json"
"""What stands in place of those beyond it."""

NAMED_LOGS = 3
"""Logs with findings that a sentence names."""


def written_campaign(campaign: CampaignRecord, folder: Path, *, command: str = "") -> Report:
    """Report of a campaign whose results are in a folder, beside the simulations of its logs."""
    runs, waves = runs_by_load(campaign.reduced), None
    if campaign.waves is not UNSET:
        paths = {run.name: folder / run.result for run in campaign.reduced}
        waves = _waves(read_results(paths))

    def simulated() -> Blocks:
        from winchcascade.report.results.model_section import campaign_parts

        return campaign_parts(runs, folder)

    model = model_section(joint_origin([run.origin for run in runs]).word, simulated)
    return campaign_report(campaign, model=model, waves=waves, linked=True, command=command)


def reduced_campaign(result: CampaignReduction, *, command: str = "") -> Report:
    """Report of the reductions of a campaign, without the simulations of its logs."""
    return campaign_report(result.summary, waves=_waves(result.records.items()), command=command)


def campaign_report(
    campaign: CampaignRecord,
    *,
    model: Section | None = None,
    waves: CampaignWaves | None = None,
    linked: bool = False,
    command: str = "",
) -> Report:
    """Report of a campaign.

    Parameters
    ----------
    model : the logs beside their simulations
    waves : of the logs whose cycles are waves; those of the record, of all logs together alone, if
        not given
    linked : whether the pages of the single logs stand beside that of the campaign
    """
    runs = runs_by_load(campaign.reduced)
    rigs, verdict, loads = (
        sorted({run.rig for run in runs}),
        verdict_note(runs),
        _loads_picture(runs),
    )
    if waves is None and campaign.waves is not UNSET:
        waves = CampaignWaves(campaign.waves, (), campaign.waves.left_out)
    return Report(
        kind="Campaign",
        title=campaign.title,
        subtitle=f"rig {', '.join(rigs)}" if rigs else "",
        tiles=tiles(runs) if waves is None else wave_tiles(waves.together),
        lead=loads if waves is None else None,
        points=[verdict, *points(campaign, runs), *_between(campaign), *fault_notes(campaign.failed)],
        sections=[
            *([] if waves is None else [campaign_waves_section(waves)]),
            section(
                "results", "Energies and efficiencies",
                None if waves is None else loads,
                budget_table(runs, linked=linked),
                folded=waves is not None,
            ),
            section("whole-cycles", "Whole cycles", net_table(runs), folded=True),
            section(
                "uncertainty", "Uncertainty and repeatability",
                uncertainty_table(runs), repeatability_table(runs), folded=True,
            ),
            *([] if model is None else [model]),
            section(
                "findings", "Logs and findings",
                logs_table(runs),
                table("between", "Logs that lie apart; their data are kept.", BETWEEN, campaign.between, brief=False),
                table("faults", "Logs that could not be used.", FAULTS, campaign.failed, brief=False),
                folded=True,
            ),
            _provenance(campaign, runs, command),
        ],
        banner=banner([run.origin for run in runs]),
    )  # fmt: skip


def _loads_picture(runs: Sequence[LogSummary]) -> Picture:
    """Powers and efficiencies over the load."""
    drawn = loaded(runs)
    caption = f"Mean powers and efficiencies over {over_what(drawn)}; bars are 95 % intervals."
    if len(comparable(drawn)) > 1:
        caption += " Lines join only logs of one window rule and of one kind of data; hollow markers are of another."
    caption += " The points are not of one motion." if unlike_motion(drawn) else ""
    words = "Points of powers and efficiencies over the load; the values are in the table."
    return Picture("loads", caption, words, partial(over_load, drawn))


def _waves(records: Iterable[tuple[str, RunRecord]]) -> CampaignWaves | None:
    """The waves of the logs of a campaign together, by the records of its logs."""
    return campaign_waves(LogWaves(name, of.log.load, of.waves) for name, of in records if of.waves)


BETWEEN: tuple[Column[tuple[str, FindingRecord]], ...] = (
    Column("log", lambda one: one[0]),
    Column("finding", lambda one: f"{one[1].kind.replace('_', ' ')}: {one[1].message}"),
    Column("what to do", lambda one: one[1].action),
)
"""A finding that a log has beside the others."""

FAULTS: tuple[Column[FailedLog], ...] = (
    Column("log", lambda run: run.name),
    Column("why", lambda run: run.fault),
)
"""A log that could not be used."""


# ------------------------------------------------------------------------------- the first screen
def loaded(runs: Sequence[LogSummary]) -> Sequence[LogSummary]:
    """The logs with a load; all where none has one."""
    return [run for run in runs if not run.open_circuit] or runs


def called(run: LogSummary) -> str:
    """What a log is called in a sentence: its load, or its name where that is unknown."""
    return load_words(run.load, "ohm", unknown=run.name)


def tiles(runs: Sequence[LogSummary]) -> list[Tile]:
    """The best load with its efficiency, and the largest power."""
    if not runs:
        return []
    cascade, best, found = cascade_of(runs), rank_loads(loaded(runs)).best, []
    eta, power = cascade.overall, f"power_{cascade.names[-1]}"
    if best is not None:
        there = "there" if best.logs == 1 else f"there, highest of {best.logs} logs"
        ends = f"95 %: {shown(interval(best.run, eta))}"
        found += [
            Tile("Best load", "", called(best.run), f"with a probability of {_likely(best)} %"),
            Tile(eta, there, mean_of(best.run, eta), ends),
        ]
    return [
        *found,
        *(_largest(runs, name) for name in given(_closed(runs), [eta, power][bool(found) :])),
    ]


def _closed(runs: Sequence[LogSummary]) -> list[LogSummary]:
    return [run for run in runs if not run.open_circuit]


def _largest(runs: Sequence[LogSummary], name: str) -> Tile:
    """The largest mean of a metric of any log with a load."""
    known = [run for run in _closed(runs) if run.mean.get(field_of(name)) is not None]
    run, unit = max(known, key=lambda run: run.mean[field_of(name)] or 0.0), metric(name).unit
    span = interval(run, name)
    speed = "" if run.plateau_speed_mps is None else f" and {run.plateau_speed_mps:.2f} m/s"
    beside = "uncertainty unknown" if span is None else f"95 %: {shown(span)} {unit}".rstrip()
    return Tile(
        name,
        f"largest, at {called(run)}{speed}",
        f"{mean_of(run, name)} {unit}".rstrip(),
        beside,
    )


def _likely(best: Best) -> str:
    return shown(100.0 * best.likely, 0) if best.likely < 0.995 else ">99"


def verdict_note(runs: Sequence[LogSummary]) -> Note | None:
    """The best load and the next one, or why none is claimed; None without two loads."""
    ranking, eta = rank_loads(loaded(runs)), cascade_of(runs).overall
    if ranking.best is None:
        several = len({run.load_ohm for run in loaded(runs) if run.load_ohm is not None}) > 1
        return (
            Note(f"No best load is claimed: {ranking.reason}.", "Verdict", "warn")
            if several
            else None
        )
    best = ranking.best
    values = [
        f"{called(run)} with {eta} = {mean_of(run, eta)}" for run in (best.run, best.following)
    ]
    if best.likely > 0.95:
        return Note(f"Best load: {values[0]}, then {values[1]}.", "Verdict", "good")
    return Note(
        f"Best load: {values[0]}; the uncertainties do not distinguish it from {values[1]}.",
        "Verdict",
    )


def points(campaign: CampaignRecord, runs: Sequence[LogSummary]) -> list[Note | None]:
    """What a reader must know first of the logs together."""
    total, whole = sum(run.cycles for run in runs), sum(run.complete for run in runs)
    counted = (
        f"{len(runs)} of {len(campaign.runs)} logs reduced, {whole} of {total} cycles complete."
    )
    motion, reason = unlike_motion(loaded(runs)), rank_loads(loaded(runs)).reason
    return [
        data_note([run.origin for run in runs]) if runs else None,
        Note(counted, "Logs", "warn" if campaign.failed or whole < total else "plain"),
        Note(_mixed_windows(runs), "Windows", "warn"),
        Note(f"{motion}.", "Motion", "warn") if motion and motion != reason else None,
        findings_note(runs),
    ]


def findings_note(runs: Sequence[LogSummary]) -> Note | None:
    """In which logs something was found, and what."""
    found = [run for run in runs if run.findings]
    if not found:
        return Note("None in any log.", "Findings", "good") if runs else None
    kinds = ", ".join(sorted({kind.replace("_", " ") for run in found for kind in run.findings}))
    names = first_of([one_line(run.name) for run in found], NAMED_LOGS)
    return Note(f"In {len(found)} of {len(runs)} logs: {kinds} ({names}).", "Findings", "warn")


def _mixed_windows(runs: Sequence[LogSummary]) -> str:
    """That logs have windows of several rules; empty if they have one."""
    rules = sorted(window_rules(runs).items(), key=lambda item: -len(item[1]))
    named = ", ".join(
        f"{rule} in {len(found)} ({one_line(found[0].name)}{', ...' * (len(found) > 1)})"
        for rule, found in rules
    )
    text = f"{len(rules)} rules: {named}. Energies, powers and efficiencies of different rules cannot be compared."
    return text if len(rules) > 1 else ""


def _between(campaign: CampaignRecord) -> list[Note]:
    """Findings of single logs beside the others."""
    texts = [
        f"{name}: {found.kind.replace('_', ' ')}: {found.message}; {found.action}"
        for name, found in campaign.between
    ]
    return [Note(one_line(text), "Apart", "warn") for text in at_most(texts, MAX_FAULTS, MORE)]


def fault_notes(failed: Sequence[FailedLog]) -> list[Note]:
    """Logs that could not be reduced, and why."""
    faults = at_most([named_fault(run) for run in failed], MAX_FAULTS, MORE)
    return [Note(text, "Failed", "warn") for text in faults]


def named_fault(run: FailedLog) -> str:
    """Name and fault of a log, the name once."""
    name, fault = one_line(run.name), one_line(run.fault)
    return fault if name in fault.split(": ")[0] else f"{name}: {fault}"


def _provenance(campaign: CampaignRecord, runs: Sequence[LogSummary], command: str) -> Section:
    """Where every number comes from."""
    finite = sorted({run.load for run in runs if run.load is not None and math.isfinite(run.load)})
    results = ", ".join(run.result for run in runs)
    if len(results) > MAX_RESULTS_TEXT:
        results = f"runs/NAME.json of the NAME of each of the {len(runs)} logs in campaign.json"
    rows = [
        ("Campaign", campaign.title),
        ("Data", origin_words([run.origin for run in runs])),
        (
            "Logs",
            f"{len(campaign.runs)}; hash, rig and window of each are in its own report and its "
            f"result",
        ),
        ("Results", f"{results}; other files in runs are of other calls" if runs else ""),
        ("Loads", ", ".join(f"{load:g}" for load in finite[:20]) + (" ohm" if finite else "")),
    ]
    return provenance(rows, command)


DRAWN_RUNS = 12
"""Runs that share one panel at most; of more, an even selection."""


CHARACTER = 0.026
"""Width of a character of a number under a load, as a share of the axis."""


def over_load(runs: Sequence[LogSummary]) -> Figure | None:
    """Draw mean powers and efficiencies over the load, with 95 % intervals; over the runs' order
    where loads are unknown.
    """
    if not runs:
        return None
    figure, (left, right) = panel_figure(2.9, 1, 2)
    cascade = cascade_of(runs)
    unit = _points(left, runs, [f"power_{name}" for name in cascade.names], "W")
    label_panel(left, "a", "Mean power in the window", y=f"Power ({unit})")
    _points(right, runs, [*cascade.ratios], "1")
    label_panel(right, "b", "Efficiency", y="Efficiency (1)")
    return figure


def over_what(runs: Sequence[LogSummary]) -> str:
    """What the points of `over_load` are drawn over."""
    return "the load" if _places(runs) is not None else "the logs, in the order of the tables"


def repeated(runs: Sequence[LogSummary]) -> bool:
    """Whether the points of `over_load` are drawn over loads of which some have several logs."""
    at = _places(runs)
    return at is not None and len(set(at)) < len(at)


def comparable(runs: Sequence[LogSummary]) -> list[list[int]]:
    """Places of the runs that may be joined by a line: those of one window rule and of one kind
    of data.
    """
    kinds = [(rule_of(run), run.origin.measured) for run in runs]
    return [[k for k, other in enumerate(kinds) if other == kind] for kind in dict.fromkeys(kinds)]


def _places(runs: Sequence[LogSummary]) -> list[float] | None:
    """Loads of the runs where all have one that can be drawn, None else. [ohm]"""
    known = [run.load for run in runs if run.load is not None and math.isfinite(run.load)]
    return known if len(known) == len(runs) and len(set(known)) > 1 else None


def _points(ax: Axes, runs: Sequence[LogSummary], names: Sequence[str], unit: str) -> str:
    """Draw the means of some metrics with their intervals; gives the unit of the axis."""
    at = _places(runs)
    x = np.arange(1.0, len(runs) + 1) if at is None else np.array(at)
    order = np.argsort(x, kind="stable")
    means = {m: np.array([run.mean.get(field_of(m)) for run in runs], dtype=float) for m in names}
    columns, cascade = {m: y for m, y in means.items() if np.isfinite(y).any()}, cascade_of(runs)
    short, unit = readable(unit, *(y[np.isfinite(y)] for y in columns.values()))
    for m, y in columns.items():
        ends = [run.interval_95.get(field_of(m)) or (math.nan, math.nan) for run in runs]
        low, high = np.array(ends, dtype=float).T
        bars = np.nan_to_num(np.vstack((y - low, high - y)))[:, order].clip(0.0) * short
        look = look_of(stage_of(cascade, m))
        line: Any = {"color": COLOURS[look.colour], "lw": 0.9, "ls": look.dashes}
        mark: Any = {"marker": look.mark, "ms": 4, "label": tex(m)}
        for n, members in enumerate(comparable(runs)):
            here = np.isin(order, members)
            own_x, own_y = x[order[here]], y[order[here]] * short
            hollow: Any = {"mfc": COLOURS["paper"], "label": "_"} if n else {"label": "_"}
            ax.errorbar(
                own_x,
                own_y,
                yerr=bars[:, here],
                capsize=2,
                **line | {"ls": "none"},
                **mark | hollow,
            )
            if not unlike_motion(runs):
                ax.plot(*(_means(own_x, own_y) if repeated(runs) else (own_x, own_y)), **line)
        joined = {"ls": "none"} if unlike_motion(runs) else {}
        ax.plot([], [], **line | joined, **mark)  # for the legend: the points on their line
    if at is not None:
        _label_loads(ax, sorted(set(at)))
    elif len(runs) <= DRAWN_RUNS:
        ax.set_xticks(x, [f"{k:g}" for k in x])
    ax.set_xlabel("Load resistance (Ω)" if at is not None else "Log, in the order of the table")
    if columns:
        ax.legend(loc="best")
    return unit


def _means(x: Signal, y: Signal) -> tuple[list[float], list[float]]:
    """Each load once, and the mean of what its logs give; without the loads of which none gives
    anything.
    """
    given = np.isfinite(y)
    loads = np.unique(x[given]).tolist()
    return loads, [float(np.mean(y[given & (x == load)])) for load in loads]


def _label_loads(ax: Axes, loads: Sequence[float]) -> None:
    """Set the loads on a logarithmic axis, with a tick and its number where there is space."""
    from matplotlib.ticker import FixedLocator, NullLocator

    ax.set_xscale("log")
    a_character = CHARACTER * math.log(loads[-1] / loads[0])
    named = [loads[0]]
    for load in loads[1:]:
        characters = 1.0 + 0.5 * (len(f"{named[-1]:g}") + len(f"{load:g}"))
        if math.log(load / named[-1]) > characters * a_character:
            named.append(load)
    ax.xaxis.set_major_locator(FixedLocator(named))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticklabels([f"{load:g}" for load in named])
