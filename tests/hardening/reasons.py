"""Why a corruption shows in no finding: computed from its size, from the damaged log, and from the limits of the checks."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from base_logs import Log, Signal
from scipy.stats import t as student

from winchcascade.batch.campaign_findings import log_efficiency
from winchcascade.core.accuracy import CERTAIN, part_uncertainty
from winchcascade.reduction.checks.lag import OF_THE_MACHINE, OF_THE_ROTOR, SAME_TIME
from winchcascade.reduction.checks.zeros import KNOWN
from winchcascade.reduction.efficiency_between_runs import _distance, _rows
from winchcascade.reduction.efficiency_changes import ALPHA, CycleComparison, compare_cycles
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.run_record import RunRecord


class Reason(NamedTuple):
    """Why one log, or one campaign, cannot show a corruption, and the figures that it follows from."""

    why: str
    figures: str


Reasoning = Callable[[Reduction], Reason | None]
"""Gives the reason from the reduction of the damaged log, None where there is none: there a check should have seen it."""

COMPARED = (
    ("displacement", "velocity", SAME_TIME),
    ("vdc", "idc", SAME_TIME),
    ("torque", "force", SAME_TIME),
    ("torque", "vdc idc", OF_THE_ROTOR),
    ("velocity", "vdc", OF_THE_MACHINE),
)
"""Channels whose times are compared, and the lag from which it is reported. [s]

The velocity is in the power of the shaft too, but moves it by about half of its own lag only, and is left out there."""

METRICS = ("eta_trans", "eta_gen")
"""Efficiencies that are compared between logs."""

LAST = (1.3, 0.3)
"""A hold is read from so long before its end until so long before it: the rotor has run down by then. [s]"""


def lag_reason(late: Sequence[str], lag: float) -> Reasoning:
    """Some channels are late: is that less than every limit for channels of which some are late and some are not?"""

    def reason(found: Reduction) -> Reason | None:
        sampling = 1.0 / found.run.fs
        limits = []
        for one, other, limit in COMPARED:
            pair = {*one.split(), *other.split()}
            if 0 < len(pair & set(late)) < len(pair):
                limits.append((max(limit, sampling), f"{one.replace(' ', ' x ')} and {other.replace(' ', ' x ')}"))
        if not limits or abs(lag) >= min(limits)[0]:
            return None
        limit, pair_words = min(limits)
        return Reason("a lag below the limit of the check", f"{abs(lag):.3f} s; {limit:.2g} s between {pair_words}")

    return reason


def zero_reason(log: Log, name: str, damaged: Signal) -> Reasoning:
    """A zero is off: does the damaged channel read less than five standard uncertainties of its zero in every hold?"""

    def reason(found: Reduction) -> Reason | None:
        limit = CERTAIN * part_uncertainty(found.rig.sensors.get(name), "zero")
        read = []
        for cycle in found.cycles:
            if cycle.phases.hold is not None:
                end = cycle.phases.hold[1]
                rows = (log.t >= end - LAST[0]) & (log.t < end - LAST[1])
                read += [abs(float(np.median(damaged[rows])))] if rows.any() else []
        if not read or max(read) >= limit:
            return None
        return Reason(
            "at rest the zero is inside five standard uncertainties",
            f"{max(read):.3g} at most in the holds; {limit:.3g}",
        )

    return reason


def force_reason(log: Log, damaged: Signal, band: tuple[float, float]) -> Reasoning:
    """The zero of the force is off: does friction explain the force before the first payout, `band` times frictionless?"""

    def reason(found: Reduction) -> Reason | None:
        rest = slice(0, round(3.0 * log.rate))
        pressure = 98066.5 * float(np.median(log.columns["pressure"][rest]))
        frictionless = pressure * 7850e-6 * 0.010 / (2 * np.pi * 0.13)
        margin = CERTAIN * float(
            np.hypot(part_uncertainty(found.rig.sensors.get("force"), "zero"), KNOWN * frictionless)
        )
        low, high = band[0] * frictionless - margin, band[1] * frictionless + margin
        read = float(np.median(damaged[rest]))
        if not low < read < high:
            return None
        return Reason("friction explains the force at rest", f"{read:.0f} N; {low:.0f} to {high:.0f} N is possible")

    return reason


def gain_reason(found: Reduction) -> Reason | None:
    """A gain changes within a log: is every change of an efficiency less than speed and repeatability allow?"""
    compared = compare_cycles(found.cycles, found.rig, found.bridged, found.run)
    if not compared or any(c.chance <= ALPHA for c in compared):
        return None
    rarest = min(compared, key=lambda c: c.chance)
    return Reason(
        "the change of the efficiency is inside what speed and repeatability allow",
        f"{rarest.metric} {abs(rarest.change):.1%} over {len(rarest.cycles)} cycles; {rarest.explained:.1%} by speed, gaps "
        f"and zeros and {_by_chance(rarest, len(compared)):.1%} by chance",
    )


def _by_chance(compared: CycleComparison, metrics: int) -> float:
    """Change that chance alone exceeds with the probability `ALPHA`, all comparisons of a log together. [1]"""
    n = len(compared.cycles)
    comparisons = (2 * n - 3 + (n > 2)) * metrics
    return float(student.isf(0.5 * ALPHA / comparisons, compared.freedom)) * compared.scatter


def campaign_reason(name: str, results: Path) -> Reason | None:
    """A gain of one log of a campaign is off: is its distance from the others less than speed and chance allow?"""
    records = {
        path.stem: msgspec.json.decode(path.read_bytes(), type=RunRecord)
        for path in sorted((results / "runs").glob("*.json"))
    }
    logs = [log for stem, r in records.items() if (log := log_efficiency(stem, r)) is not None]
    logs = [log for log in logs if log.load is not None and np.isfinite(log.load)]
    found: list[tuple[float, str]] = []
    for metric in METRICS:
        rows, left = _rows(metric, logs), list(range(len(logs)))
        k = [log.name for log in logs].index(f"{name}.csv")
        if rows is None:
            return None
        distance = _distance(rows, left, (k,))
        off, speed = (float(x[0] / (rows.y[k] * rows.sd[k]) ** 2) for x in (distance.off, distance.allowed))
        chance = distance.chance * len(logs) * len(METRICS)
        words = f"{metric} {abs(off):.3f} from what the other logs predict; {speed:.3f} by speed, and the rest with a "
        found.append((chance, words + f"probability of {min(chance, 1.0):.2g} by chance ({ALPHA:g} is reported)"))
    if min(found)[0] <= ALPHA:
        return None
    return Reason("the distance from the other logs is inside what speed and repeatability allow", min(found)[1])


def by_reason(found: Sequence[tuple[int, Reason | None]]) -> str:
    """Count silent corruptions by class and reason."""
    count = Counter((kind, reason.why if reason else "no reason known") for kind, reason in found)
    return "\n".join(f"{kind:5}{n:6}  {why}" for (kind, why), n in sorted(count.items()))
