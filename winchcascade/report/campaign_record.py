"""A campaign: its record, each log with its means or why it has none, its text for the terminal, and its reductions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import msgspec
from msgspec import UNSET, UnsetType

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Stage, field_of
from winchcascade.core.plain_text import one_line
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.run_record import CampaignWavesRecord, FindingRecord, Interval95, Numbers, RunRecord
from winchcascade.report.content import Note, Report
from winchcascade.report.digits import stated, uncertain
from winchcascade.report.screen import toned
from winchcascade.report.sheet import Limit, TableColumn
from winchcascade.report.text_table import at_most, data_lines, headed, joined, listing, metric_steps, wrapped
from winchcascade.report.wave_record import waves_from_record
from winchcascade.report.wording import load_words

LISTED_RUNS = Limit(20, "more, in the dataset")
"""Logs that are listed; of more the first and the last half of that."""

MAX_FAULTS = 10

MAX_ALTERED = 5
"""Altered files that are named."""


class LogSummary(msgspec.Struct, frozen=True):
    """One log of a campaign: where its result is, and its means; `findings` are kinds, `finding_count` counts them all.

    `plateau_speed_mps` is the mean over its complete cycles, null where a cycle has no plateau [m/s].
    """

    name: str
    log: str
    fault: None
    result: str
    table: str | None
    load_ohm: float | None
    open_circuit: bool
    plateau_speed_mps: float | None
    simulated: bool | None
    data: dict[str, bool | str | None]
    window: str | float
    rig: str
    cycles: int
    complete: int
    findings: tuple[str, ...]
    finding_count: int
    removed_share: float
    mean: Numbers
    standard_uncertainty: Numbers
    interval_95: dict[str, Interval95 | None]
    max_deviation_percent: Numbers
    stages: tuple[str, ...] | UnsetType = UNSET

    @property
    def load(self) -> float | None:
        """Its load, inf for an open circuit, None for none or an unknown one. [ohm]"""
        return math.inf if self.open_circuit else self.load_ohm

    @property
    def origin(self) -> Origin:
        """Where its data come from."""
        return origin_from(self.data)


class FailedLog(msgspec.Struct, frozen=True):
    """One log of a campaign that could not be reduced, and why."""

    name: str
    log: str
    fault: str


class CampaignRecord(msgspec.Struct, frozen=True):
    """A campaign: its logs in their order, and findings of single logs beside the others, each with the name of its log.

    `state` is a digest of all that the files of the campaign depend on; `waves` are those of all logs together.
    """

    title: str
    state: str
    runs: tuple[LogSummary | FailedLog, ...]
    between: tuple[tuple[str, FindingRecord], ...] = ()
    waves: CampaignWavesRecord | UnsetType = UNSET

    @property
    def reduced(self) -> list[LogSummary]:
        """Logs with means."""
        return [run for run in self.runs if isinstance(run, LogSummary)]

    @property
    def failed(self) -> list[FailedLog]:
        """Logs without."""
        return [run for run in self.runs if isinstance(run, FailedLog)]


def log_summary(name: str, log: str, record: RunRecord) -> LogSummary:
    """Summarise the result of one log.

    Parameters
    ----------
    log : path or address of the log
    """
    of = record if record.stages is UNSET else record.stages
    return LogSummary(
        name=name,
        log=log,
        fault=None,
        result=f"runs/{name}.json",
        table=record.log.table,
        load_ohm=record.log.load_ohm,
        open_circuit=record.log.open_circuit,
        plateau_speed_mps=record.plateau_speed,
        simulated=record.log.simulated,
        data=record.data,
        window=record.window,
        rig=record.rig_name,
        cycles=len(record.cycles),
        complete=sum(c.complete for c in record.cycles),
        findings=tuple(sorted({finding.kind for finding in record.quality})),
        finding_count=len(record.quality),
        removed_share=sum(finding.removed_share for finding in record.quality),
        mean=record.mean | of.mean,
        standard_uncertainty=record.standard_uncertainty | of.standard_uncertainty,
        interval_95=record.interval_95 | of.interval_95,
        max_deviation_percent=record.max_deviation_percent | of.max_deviation_percent,
        stages=UNSET if record.stages is UNSET else record.stages.order,
    )


def cascade_of(runs: Iterable[LogSummary]) -> Cascade:
    """Cascade of a campaign: that of the paper where no rig file states its stages, else all stages of its logs."""
    orders = [run.stages for run in runs if run.stages is not UNSET]
    names = dict.fromkeys(name for order in orders for name in order)
    return Cascade(tuple(BUILT_IN.get(name) or Stage(name, ()) for name in names), configured=True) if names else PAPER


class _FindingOf(FindingRecord, frozen=True, kw_only=True):
    """A finding of one log beside the others."""

    run: str


class _Written(msgspec.Struct, frozen=True):
    """The record as it is written."""

    title: str
    state: str
    runs: tuple[dict[str, object], ...]
    between_logs: tuple[_FindingOf, ...]
    waves: CampaignWavesRecord | UnsetType = UNSET


def campaign_from(record: Mapping[str, object]) -> CampaignRecord:
    """Read the record of a campaign that this version wrote."""
    read = msgspec.convert(record, _Written)
    runs = tuple(
        msgspec.convert(run, LogSummary) if run["fault"] is None else msgspec.convert(run, FailedLog)
        for run in read.runs
    )
    between = tuple((one.run, msgspec.convert(one, FindingRecord, from_attributes=True)) for one in read.between_logs)
    return CampaignRecord(read.title, read.state, runs, between, read.waves)


def run_load_text(run: LogSummary) -> str:
    """Load of a log as a text."""
    return load_words(run.load, "", unknown="–").rstrip()


def runs_by_load(runs: Sequence[LogSummary]) -> list[LogSummary]:
    """Logs in falling order of their loads, as the paper lists them; open circuit first, unknown ones last."""
    return sorted(runs, key=lambda run: -(-1.0 if run.load is None else run.load))


def window_text(run: LogSummary) -> str:
    """Rule of the integration window of a log: a word, or the fixed length in seconds."""
    return run.window if isinstance(run.window, str) else f"{run.window:g}"


def rule_of(run: LogSummary) -> str:
    """Kind of the rule of the integration window of a log."""
    return run.window if isinstance(run.window, str) else "fixed length"


def window_rules(runs: Sequence[LogSummary]) -> dict[str, list[LogSummary]]:
    """Logs by the rule of their windows: auto, payout, or a fixed length."""
    return {rule: [run for run in runs if rule_of(run) == rule] for rule in dict.fromkeys(map(rule_of, runs))}


def has_speeds(runs: Sequence[LogSummary]) -> bool:
    """Whether the plateau speed of any log is known."""
    return any(run.plateau_speed_mps is not None for run in runs)


SPEED_ALIKE = 0.05
"""Largest share by which plateau speeds of loads that are compared may differ: efficiencies depend on the speed, too. [1]"""


def unlike_motion(runs: Sequence[LogSummary]) -> tuple[LogSummary, LogSummary] | None:
    """The slowest and the fastest log with a load, if their plateau speeds differ by more than `SPEED_ALIKE`."""
    known = [(run.plateau_speed_mps, k) for k, run in enumerate(runs) if run.load_ohm and not run.open_circuit]
    ends = sorted((speed, k) for speed, k in known if speed is not None)
    if not ends or ends[-1][0] <= (1.0 + SPEED_ALIKE) * ends[0][0]:
        return None
    return runs[ends[0][1]], runs[ends[-1][1]]


def motion_words(slow: LogSummary, fast: LogSummary, ohm: str) -> str:
    """Plateau speeds of the slowest and the fastest of some logs, with the unit of their loads, and what follows from them."""
    ends = (f"{run.plateau_speed_mps:.2f} m/s at {run_load_text(run)} {ohm}" for run in (slow, fast))
    return (
        f"plateau speeds differ, {' to '.join(ends)}; loads are compared at one motion, within {100 * SPEED_ALIKE:g} %"
    )


def mixed_windows(runs: Sequence[LogSummary]) -> str:
    """Report that logs have windows of several rules; empty if they have one."""
    rules = sorted(window_rules(runs).items(), key=lambda item: -len(item[1]))
    named = ", ".join(
        f"{rule} in {len(found)} ({one_line(found[0].name)}{', …' * (len(found) > 1)})" for rule, found in rules
    )
    text = f"{len(rules)} rules: {named}. Energies, powers and efficiencies of different rules cannot be compared."
    return text if len(rules) > 1 else ""


# -------------------------------------------------------------------------------------------------------- the terminal
def campaign_text(campaign: CampaignRecord, out: Path, *, kept: int, altered: Sequence[str] = ()) -> str:
    """Means of every log of a campaign, what failed, and where the results are.

    Parameters
    ----------
    kept : logs that an earlier call had done already
    altered : files of an earlier call that did not match their digest
    """
    runs = runs_by_load(campaign.reduced)
    mixed, unlike = mixed_windows(runs), unlike_motion(runs)
    earlier = f", {kept} of them by an earlier call" if kept else ""
    lines = [
        *wrapped(f"{campaign.title}: {len(runs)} of {len(campaign.runs)} logs reduced{earlier}", piped=None),
        *(data_lines([run.origin for run in runs]) if runs else []),
        "",
        *([*_table(runs), *_marked(runs), *_between(campaign), ""] if runs else []),
        *([*headed(wrapped(f"note: windows of {mixed}"), "note", "warning"), ""] if mixed else []),
        *([*headed(wrapped(f"note: {motion_words(*unlike, 'ohm')}."), "note", "warning"), ""] if unlike else []),
    ]
    if campaign.waves is not UNSET:
        from winchcascade.report.render.terminal import terminal_text
        from winchcascade.report.results.waves import wave_section

        waves = wave_section(waves_from_record(campaign.waves))
        left_out = [Note(text, "Left out") for text in campaign.waves.left_out]
        lines += [
            *terminal_text(Report("Waves", "Waves of all logs", points=left_out, sections=[waves])).splitlines(),
            "",
        ]
    lines += [*altered_lines(altered), *_fault_lines(campaign, out)]
    named = [
        ("index", out / "index.html"),
        ("report", out / "campaign.html"), ("", out / "campaign.pdf"), ("workbook", out / "campaign.xlsx"),
        ("record", out / "campaign.json"), ("tables", out / "dataset"), ("each log", out / "runs"),
    ]  # fmt: skip
    lines += [f"{name + ':' if name else '':<10}{path}" for name, path in named if path.exists()]
    return joined(lines)


def fault_text(campaign: CampaignRecord, out: Path) -> str:
    """Logs that could not be reduced, and why."""
    return joined(_fault_lines(campaign, out))


def _fault_lines(campaign: CampaignRecord, out: Path) -> list[str]:
    return at_most(
        [headed(wrapped(f"failed: {named_fault(run)}", piped=None), "failed", "contradiction") for run in campaign.failed],
        MAX_FAULTS, f"more failed, all in {out / 'campaign.json'}",
    )  # fmt: skip


def altered_lines(altered: Sequence[str]) -> list[str]:
    """One line that names files which were changed after they were made, and so were made again; none if there are none."""
    more = f" and {len(altered) - MAX_ALTERED} more" if len(altered) > MAX_ALTERED else ""
    names = ", ".join(map(one_line, altered[:MAX_ALTERED]))
    return (
        wrapped(f"made again, as the content did not match the digest of the earlier call: {names}{more}", piped=None)
        if altered
        else []
    )


def named_fault(run: FailedLog) -> str:
    """Name and fault of a log, the name once."""
    name, fault = one_line(run.name), one_line(run.fault)
    return fault if name in fault.split(": ")[0] else f"{name}: {fault}"


def _table(runs: Sequence[LogSummary]) -> list[str]:
    cascade = cascade_of(runs)
    metrics = [
        TableColumn(m.replace("energy", "E"), "J" if m.startswith("energy") else "", of=partial(_mean, m))
        for m in (*cascade.energies, *cascade.ratios)
    ]
    columns = [
        *_LOG[:2],
        *([_SPEED] if has_speeds(runs) else []),
        *_LOG[2:],
        *metrics,
        TableColumn("±", of=partial(_uncertainty, cascade)),
        *_FINDINGS,
    ]
    return listing(
        columns if any(run.findings for run in runs) else columns[:-1],
        runs,
        LISTED_RUNS,
        omit=["window", "cycles", *metric_steps(cascade.energies, cascade.ratios), f"E_{cascade.names[-1]}", "±"],
    )


def _name(run: LogSummary) -> str:
    name = one_line(run.name)
    return name if len(name) <= 24 else f"{name[:12]}…{name[-11:]}"


def _mean(metric: str, run: LogSummary) -> str:
    return stated(run.mean.get(field_of(metric)), None, 3 if metric.startswith("eta") else 0).replace("–", "-")


def _uncertainty(cascade: Cascade, run: LogSummary) -> str:
    """Standard uncertainty of the first efficiency that has a mean: of the whole cascade, else of a stage."""
    u, mean = run.standard_uncertainty, run.mean
    names = (cascade.overall, *cascade.neighbours)
    given = next((u[name] for name in names if mean.get(name) is not None), None)
    return uncertain(given).replace("–", "-")


_LOG: tuple[TableColumn[LogSummary], ...] = (
    TableColumn("log", of=_name),
    TableColumn("load", "ohm", of=lambda run: run_load_text(run).replace("–", "-")),
    TableColumn("window", "s", of=window_text),
    TableColumn(
        "cycles", of=lambda run: f"{run.complete}" + ("" if run.complete == run.cycles else f" of {run.cycles}")
    ),
)
_SPEED: TableColumn[LogSummary] = TableColumn(
    "plateau", "m/s", of=lambda run: stated(run.plateau_speed_mps, None, 3).replace("–", "-")
)
_FINDINGS: tuple[TableColumn[LogSummary], ...] = (
    TableColumn("findings", of=lambda run: toned(f"! {run.finding_count}", "warning") if run.findings else "-"),
)


def _marked(runs: Sequence[LogSummary]) -> list[str]:
    """The sentence on the rows that are marked: how many, and with which kinds of findings."""
    found = [run for run in runs if run.findings]
    kinds = ", ".join(sorted({kind for run in found for kind in run.findings}))
    return (
        headed(
            wrapped(f"! findings in {len(found)} of {len(runs)} logs, listed in each log's report and JSON: {kinds}"),
            "!",
            "warning",
        )
        if found
        else []
    )


def _between(campaign: CampaignRecord) -> list[str]:
    """Findings of single logs beside the others."""
    texts = (one_line(f"{name}: {found.kind}: {found.message}; {found.action}") for name, found in campaign.between)
    return at_most([wrapped(text, "  ") for text in texts], MAX_FAULTS, "more, in the dataset", indent="  ")


class CampaignReduction(Viewed, frozen=True):
    """Reductions of the runs of a campaign.

    Parameters
    ----------
    summary : means of every run or why it has none, and findings of single runs beside the others
    records : the JSON of each run as a record, by its name
    cascades : of the rigs of the runs
    """

    summary: CampaignRecord
    records: Mapping[str, RunRecord]
    cascades: tuple[Cascade, ...] = ()

    def __repr__(self) -> str:
        """One line instead of every number."""
        return (
            f"CampaignReduction({self.summary.title!r}, {len(self.records)} of {len(self.summary.runs)} runs reduced)"
        )

    @property
    def faults(self) -> dict[str, str]:
        """Why runs could not be reduced, by their names."""
        return {run.name: run.fault for run in self.summary.failed}

    @property
    def bins(self) -> dict[str, list[dict[str, float]]]:
        """Means of the runs in bins of generator speed that are known, by name and unit."""
        return {
            name: [
                {k: x for k, x in msgspec.structs.asdict(item).items() if isinstance(x, float | int)}
                for item in record.bins
            ]
            for name, record in self.records.items()
        }
