"""A campaign as data: each log with its means or why it has none, what sets the logs apart, and the
best load.

A best load is claimed only where the line moved alike at all loads.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType
from msgspec.structs import asdict

from winchcascade.core.campaign_file import Origin, joint_origin, origin_from, origin_record
from winchcascade.core.cascade import BUILT_IN, PAPER, Cascade, Stage
from winchcascade.core.version import __version__
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.run_record import FindingRecord, Interval95, Numbers, RunRecord
from winchcascade.reduction.wave_energies import CampaignWavesRecord

CAMPAIGN_SCHEMA = "winchcascade/campaign/1"

SPEED_ALIKE = 0.05
"""Largest share by which plateau speeds of loads that are compared may differ: efficiencies
depend on the speed, too. [1]
"""

LOAD_SEED = 20260
"""Seed of the draws from which the probability follows that a load is the best."""

LOAD_DRAWS = 20_000
"""Number of draws: the probability is known within a standard error of 0.0035, 0.5 over the root
of this, or better.
"""


class LogSummary(msgspec.Struct, frozen=True):
    """One log of a campaign: where its result is, and its means; `findings` are kinds,
    `finding_count` counts them all.

    `plateau_speed_mps` is the mean over its complete cycles, null where a cycle has no plateau
    [m/s].
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
    """A campaign: its logs in their order, and findings of single logs beside the others, each with
    the name of its log.

    `state` is a digest of all that the files of the campaign depend on; `waves` are those of all
    logs together.
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
    """Summarise the result of one log, of which the path is given too."""
    means = (
        "data",
        "window",
        "mean",
        "standard_uncertainty",
        "interval_95",
        "max_deviation_percent",
    )
    return LogSummary(
        name=name,
        log=log,
        fault=None,
        result=f"runs/{name}.json",
        **{
            entry: getattr(record.log, entry)
            for entry in ("table", "load_ohm", "open_circuit", "simulated")
        },
        **{entry: getattr(record, entry) for entry in means},
        plateau_speed_mps=record.plateau_speed,
        rig=record.rig_name,
        cycles=len(record.cycles),
        complete=sum(c.complete for c in record.cycles),
        findings=tuple(sorted({finding.kind for finding in record.quality})),
        finding_count=len(record.quality),
        removed_share=sum(finding.removed_share for finding in record.quality),
        stages=UNSET if record.stages is UNSET else record.stages.order,
    )


def configured_cascade(stages: Iterable[str]) -> Cascade:
    """The cascade of stages that rig files state by name; that of the paper without any."""
    found = tuple(BUILT_IN.get(name) or Stage(name, ()) for name in dict.fromkeys(stages))
    return Cascade(found, configured=True) if found else PAPER


def cascade_of(runs: Iterable[LogSummary]) -> Cascade:
    """Cascade of a campaign: that of the paper where no rig file states its stages, else all
    stages of its logs.
    """
    return configured_cascade(name for run in runs for name in run.stages or ())


def campaign_from(record: Mapping[str, Any]) -> CampaignRecord:
    """Read the record of a campaign that this version wrote."""
    kinds = {True: LogSummary, False: FailedLog}
    runs = tuple(msgspec.convert(run, kinds[run["fault"] is None]) for run in record["runs"])
    between = tuple(
        (one["run"], msgspec.convert(one, FindingRecord)) for one in record["between_logs"]
    )
    waves = msgspec.convert(record["waves"], CampaignWavesRecord) if "waves" in record else UNSET
    return CampaignRecord(record["title"], record["state"], runs, between, waves)


def read_campaign(path: Path) -> CampaignRecord:
    """Read the record of a campaign that this version wrote, from its file;
    msgspec.ValidationError for another one.
    """
    return campaign_from(msgspec.json.decode(path.read_bytes(), type=dict[str, object]))


def campaign_json(campaign: CampaignRecord) -> dict[str, object]:
    """The record of a campaign with what compares its logs: kinds of windows, and the best load
    or why none is claimed.
    """
    runs = campaign.reduced
    rules = {rule: len(found) for rule, found in window_rules(runs).items()}
    ranking, eta, best = rank_loads(runs), cascade_of(runs).overall, None
    if ranking.best is not None:
        run, likely = ranking.best.run, ranking.best.likely
        best = {
            "load_ohm": run.load_ohm,
            "run": run.name,
            "metric": eta,
            "value": run.mean[eta],
            "probability": likely,
        }
    return {
        "schema": CAMPAIGN_SCHEMA,
        "version": __version__,
        "title": campaign.title,
        "data": origin_record(joint_origin([run.origin for run in runs])),
        "windows": {"rules": rules, "mixed": len(rules) > 1},
        "best_load": best,
        "best_load_reason": ranking.reason.replace("ohm", "Ω") or None,
        "plateau_speeds_mps": ranking.speeds,
        "state": campaign.state,
        "runs": campaign.runs,
        **({} if campaign.waves is UNSET else {"waves": campaign.waves}),
        "between_logs": [{"run": name, **asdict(finding)} for name, finding in campaign.between],
    }


class CampaignReduction(Viewed, frozen=True):
    """Reductions of the runs of a campaign, as the library gives them.

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
        return f"CampaignReduction({self.summary.title!r}, {len(self.records)} of {len(self.summary.runs)} runs reduced)"

    @property
    def faults(self) -> dict[str, str]:
        """Why runs could not be reduced, by their names."""
        return {run.name: run.fault for run in self.summary.failed}

    @property
    def bins(self) -> dict[str, list[dict[str, float]]]:
        """Means of the runs in bins of generator speed that are known, by name and unit."""
        return {
            name: [
                {k: x for k, x in item.items() if isinstance(x, float | int)}
                for item in record.bins
            ]
            for name, record in self.records.items()
        }


def runs_by_load(runs: Sequence[LogSummary]) -> list[LogSummary]:
    """Logs in falling order of their loads, as the paper lists them; open circuit first, unknown
    ones last.
    """
    return sorted(runs, key=lambda run: -(-1.0 if run.load is None else run.load))


def rule_of(run: LogSummary) -> str:
    """Kind of the rule of the integration window of a log."""
    return run.window if isinstance(run.window, str) else "fixed length"


def window_rules(runs: Sequence[LogSummary]) -> dict[str, list[LogSummary]]:
    """Logs by the rule of their windows: auto, payout, or a fixed length."""
    return {
        rule: [run for run in runs if rule_of(run) == rule]
        for rule in dict.fromkeys(map(rule_of, runs))
    }


class Best(NamedTuple):
    """The log of the highest eta_pto, the probability that its load is the best, the best log of
    the next load, and how many logs the best load has.
    """

    run: LogSummary
    likely: float
    following: LogSummary
    logs: int


class LoadRanking(NamedTuple):
    """The best load, or why none is claimed: "" where there is one; and the smallest and largest
    plateau speed. [m/s]
    """

    best: Best | None
    reason: str
    speeds: tuple[float, float] | None


def unlike_motion(runs: Sequence[LogSummary]) -> str:
    """The plateau speeds of the slowest and the fastest log with a load and what follows, if they
    differ by more than `SPEED_ALIKE`; else "".
    """
    known = [
        (run.plateau_speed_mps, run.load_ohm)
        for run in runs
        if run.load_ohm and not run.open_circuit
    ]
    ends = sorted((speed, load) for speed, load in known if speed is not None)
    if not ends or ends[-1][0] <= (1.0 + SPEED_ALIKE) * ends[0][0]:
        return ""
    speeds = " to ".join(f"{speed:.2f} m/s at {load:g} ohm" for speed, load in (ends[0], ends[-1]))
    return (
        f"plateau speeds differ, {speeds}; loads can be ranked only if these agree within "
        f"{100 * SPEED_ALIKE:g} %"
    )


def rank_loads(runs: Sequence[LogSummary]) -> LoadRanking:
    """The best load of some logs, if their plateau speeds are within `SPEED_ALIKE`; an open circuit
    is not compared.

    Each mean efficiency of the whole cascade is drawn from a normal distribution with its standard
    uncertainty, the logs independent of each other: as logs with the same sensors share their
    errors, the true probability is rather higher. A load is the best where any of its logs is.
    """
    eta = cascade_of(runs).overall
    given = [
        run for run in runs if run.standard_uncertainty.get(eta) and run.mean.get(eta) is not None
    ]
    given = [run for run in given if run.load_ohm is not None and not run.open_circuit]
    speeds = [run.plateau_speed_mps for run in given]
    known = [speed for speed in speeds if speed is not None]
    ends = (min(known), max(known)) if known else None
    loads = np.array([run.load_ohm for run in given], dtype=float)
    reason = unlike_motion(given)
    if None in speeds:
        lacking = given[speeds.index(None)].load_ohm
        reason = f"plateau speed unknown at {lacking:g} ohm; loads can be ranked only at one speed"
    if len(set(loads.tolist())) < 2:
        reason = "no two loads have an efficiency with its uncertainty"
    if reason:
        return LoadRanking(None, reason, ends)
    mean = np.array([run.mean[eta] for run in given])
    u = np.array([run.standard_uncertainty[eta] for run in given])
    drawn = mean + u * np.random.default_rng(LOAD_SEED).standard_normal((LOAD_DRAWS, len(given)))
    share = np.bincount(np.argmax(drawn, axis=1), minlength=len(given)) / LOAD_DRAWS
    order = np.argsort(-mean, kind="stable").tolist()
    same = loads == loads[order[0]]
    following = given[next(k for k in order if not same[k])]
    return LoadRanking(
        Best(given[order[0]], float(share[same].sum()), following, int(same.sum())), "", ends
    )
