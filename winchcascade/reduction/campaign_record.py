"""A campaign as data: each log with its means or why it has none, the order of the logs, and what sets them apart."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Stage
from winchcascade.reduction.run_record import FindingRecord, Interval95, Numbers, RunRecord
from winchcascade.reduction.wave_energies import CampaignWavesRecord


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
    log : path of the log
    """
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
        mean=record.numbers("mean"),
        standard_uncertainty=record.numbers("standard_uncertainty"),
        interval_95=record.intervals,
        max_deviation_percent=record.numbers("max_deviation_percent"),
        stages=UNSET if record.stages is UNSET else record.stages.order,
    )


def cascade_of(runs: Iterable[LogSummary]) -> Cascade:
    """Cascade of a campaign: that of the paper where no rig file states its stages, else all stages of its logs."""
    orders = [run.stages for run in runs if run.stages is not UNSET]
    names = dict.fromkeys(name for order in orders for name in order)
    return Cascade(tuple(BUILT_IN.get(name) or Stage(name, ()) for name in names), configured=True) if names else PAPER


def campaign_from(record: Mapping[str, Any]) -> CampaignRecord:
    """Read the record of a campaign that this version wrote."""
    runs = tuple(
        msgspec.convert(run, LogSummary) if run["fault"] is None else msgspec.convert(run, FailedLog)
        for run in record["runs"]
    )
    between = tuple((one["run"], msgspec.convert(one, FindingRecord)) for one in record["between_logs"])
    waves = msgspec.convert(record["waves"], CampaignWavesRecord) if "waves" in record else UNSET
    return CampaignRecord(record["title"], record["state"], runs, between, waves)


def read_campaign(path: Path) -> CampaignRecord:
    """Read the record of a campaign that this version wrote, from its file; msgspec.ValidationError for another one."""
    return campaign_from(msgspec.json.decode(path.read_bytes(), type=dict[str, object]))


def runs_by_load(runs: Sequence[LogSummary]) -> list[LogSummary]:
    """Logs in falling order of their loads, as the paper lists them; open circuit first, unknown ones last."""
    return sorted(runs, key=lambda run: -(-1.0 if run.load is None else run.load))


def rule_of(run: LogSummary) -> str:
    """Kind of the rule of the integration window of a log."""
    return run.window if isinstance(run.window, str) else "fixed length"


def window_rules(runs: Sequence[LogSummary]) -> dict[str, list[LogSummary]]:
    """Logs by the rule of their windows: auto, payout, or a fixed length."""
    return {rule: [run for run in runs if rule_of(run) == rule] for rule in dict.fromkeys(map(rule_of, runs))}


SPEED_ALIKE = 0.05
"""Largest share by which plateau speeds of loads that are compared may differ: efficiencies depend on the speed, too. [1]"""


def unlike_motion(runs: Sequence[LogSummary]) -> tuple[LogSummary, LogSummary] | None:
    """The slowest and the fastest log with a load, if their plateau speeds differ by more than `SPEED_ALIKE`."""
    known = [(run.plateau_speed_mps, k) for k, run in enumerate(runs) if run.load_ohm and not run.open_circuit]
    ends = sorted((speed, k) for speed, k in known if speed is not None)
    if not ends or ends[-1][0] <= (1.0 + SPEED_ALIKE) * ends[0][0]:
        return None
    return runs[ends[0][1]], runs[ends[-1][1]]
