"""Findings on a log that compare it with the others of its campaign, from the records of their
reductions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from winchcascade.core.cascade import PAPER
from winchcascade.core.run import Finding
from winchcascade.reduction.efficiency import FIELDS, RATIOS
from winchcascade.reduction.efficiency_between_runs import Apart, LogEfficiency, logs_apart
from winchcascade.reduction.efficiency_changes import LOOK_AT
from winchcascade.reduction.lags_between_runs import LagBetween, lags_between
from winchcascade.reduction.phase_summary import PayoutSummary
from winchcascade.reduction.run_record import CycleRecord, FindingRecord, RunRecord, finding_record


def log_efficiency(name: str, record: RunRecord) -> LogEfficiency | None:
    """Take the efficiencies of a log, their speed and power from the record of its reduction; None
    without a complete cycle.

    Errors of gains and lags are common to a campaign and do not count in the uncertainty.
    """
    payouts = [cycle.phase_summary.payout for cycle in record.cycles if cycle.complete]
    if not payouts:
        return None
    speeds = [_speed(payout) for payout in payouts]
    log, parts = record.log, record.uncertainty
    own = [row.contribution for row in parts.budget if row.part not in ("gain", "lag")] + [
        parts.repeatability
    ]
    return LogEfficiency(
        name=name,
        kind=(record.rig_name, record.window == "payout", bool(log.simulated)),
        load=math.inf if log.open_circuit else log.load_ohm,
        speed=sum(speeds) / len(speeds),
        power=record.mean.get(FIELDS["power_mech"]),
        eta={metric: record.mean.get(metric) for metric in RATIOS},
        uncertainty={
            metric: math.hypot(*(part.get(metric) or 0.0 for part in own)) for metric in RATIOS
        },
        cycles=frozenset()
        if record.window == "whole"
        else frozenset(_energies(cycle) for cycle in record.cycles if cycle.complete),
        relations=record.relations,
    )


def _energies(cycle: CycleRecord) -> str:
    """Energies of a cycle to six digits."""
    joules = (cycle.numbers.get(FIELDS[f"energy_{stage}"]) for stage in PAPER.names)
    return " ".join(f"{joule:.6g}" for joule in joules if joule)


def _speed(payout: PayoutSummary) -> float:
    """Speed of a payout on its plateau, or else on the whole; 0 where it is unknown. [m/s]"""
    if payout.plateau is not None:
        return payout.plateau.speed or 0.0
    return payout.travel / payout.duration if payout.travel and payout.duration else 0.0


def findings_between(logs: Iterable[LogEfficiency | None]) -> list[tuple[str, FindingRecord]]:
    """Names and findings of the logs whose efficiency or lags lie far from the others, and of those
    that hold cycles of others.

    A lag that all share is reported with the first of them.
    """
    known = [log for log in logs if log is not None]
    lags = lags_between({log.name: log.relations for log in known})
    return [
        *((apart.name, _finding(apart)) for apart in logs_apart(known)),
        *map(_lag, lags),
        *_copies(known),
    ]


def _lag(found: LagBetween) -> tuple[str, FindingRecord]:
    """Report a lag of one log beside the others, or one that all of them share."""
    r, shared = found.relation, len(found.names) > 1
    low, high = (abs(found.lag) + side * 2.0 * found.u for side in (-1.0, 1.0))
    side = "behind" if found.lag > 0.0 else "ahead of"
    where = f"in all {found.all} logs" if shared else f"beside the other {found.all - 1} logs"
    message = f"lag of {r.y}: {abs(found.lag):.3f} s {side} {r.x} {where} (95 % interval {low:.3f} to {high:.3f} s)"
    action = "kept as logged; check filters and clocks of their loggers"
    return found.names[0], finding_record(Finding("channel_lag", message, action, r.y), samples=1)


def _copies(logs: Sequence[LogEfficiency]) -> Iterator[tuple[str, FindingRecord]]:
    """Report each log that shares cycles with an earlier one: noise makes two cycles differ in
    their energies.
    """
    first: dict[str, str] = {}
    for log in logs:
        shared = {cycle: first[cycle] for cycle in log.cycles if cycle in first}
        if shared:
            other = min(shared.values())
            message = f"{len(shared)} of {len(log.cycles)} complete cycles are those of {other}, which count twice"
            found = Finding(
                "repeated_log", message, "kept as listed; take one of the two out of the campaign"
            )
            yield log.name, finding_record(found, samples=1)
        first |= dict.fromkeys(log.cycles - first.keys(), log.name)


def _finding(apart: Apart) -> FindingRecord:
    message = (
        f"{apart.metric} is {apart.value:.3f}, and the other logs predict {apart.expected:.3f}"
    )
    if apart.allowed >= 0.0005:
        message += f"; its speed explains {apart.allowed:.3f} at most"
    if apart.or_else:
        message += f"; the fault may also lie in {', '.join(apart.or_else[:3])}"
    action = f"kept as logged; look at {LOOK_AT[apart.metric]}, and at the stated load"
    return finding_record(Finding("efficiency_change", message, action), samples=1)
