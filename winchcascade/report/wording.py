"""What a reduction's uncertainty means, in sentences that the terminal and the reports share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.reduction.efficiency import METRICS
from winchcascade.reduction.uncertainty import R_DRUM, SAMPLING, shares

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.accuracy import ErrorSource
    from winchcascade.reduction.reduction_result import CycleResult
    from winchcascade.reduction.uncertainty import Budget

SENSORS = {
    "force": "force cell",
    "torque": "torque sensor",
    "velocity": "velocity",
    "power_mech": "shaft power",
    "vdc": "Vdc",
    "idc": "Idc",
    R_DRUM: "drum radius",
    SAMPLING: "sampling",
}
"""What a source of uncertainty is called in a sentence."""


def source_name(source: ErrorSource | None) -> str:
    """Name a source of uncertainty: the sensor and what of it errs."""
    if source is None:
        return "bridged gaps"
    name = SENSORS.get(source.channel, source.channel)
    return name if source.channel in (R_DRUM, SAMPLING) else f"{name}, {source.part}"


def by_sensor(known: Budget, metric: str) -> dict[str, float]:
    """Share of the variance of a metric's mean by sensor, zero and gain together, and by repeatability. [1]"""
    found: dict[str, float] = {}
    for row in known.rows:
        name = "bridged gaps" if row.source is None else SENSORS.get(row.source.channel, row.source.channel)
        share = getattr(shares(row.of, known.mean), metric)
        if share:
            found[name] = found.get(name, 0.0) + share
    share = getattr(shares(known.repeatability, known.mean), metric)
    return found | ({"repeatability": share} if share else {})


def decisive(known: Budget) -> list[str]:
    """Which sensor decides the uncertainty of each efficiency."""
    sentences = []
    for metric in METRICS[6:]:
        parts = by_sensor(known, metric)
        if parts:
            name, share = max(parts.items(), key=lambda part: part[1])
            sentences.append(f"{metric} {share:.0%} {name}")
    return [f"most of the variance: {', '.join(sentences)}"] if sentences else []


def label(cycle: CycleResult) -> str:
    """Number of a cycle, in brackets if it is incomplete."""
    return f"{cycle.cycle}" if cycle.complete else f"({cycle.cycle})"


LISTED_CYCLES = 6
"""Numbers of cycles that a sentence lists."""


def net_reasons(cycles: Sequence[CycleResult]) -> list[str]:
    """Which cycles have no net energies, and why: one sentence for each reason, that of the most cycles first."""
    by_reason: dict[str, list[int]] = {}
    for cycle in cycles:
        if cycle.net.reason is not None:
            by_reason.setdefault(cycle.net.reason, []).append(cycle.cycle)
    sentences = []
    for reason, found in sorted(by_reason.items(), key=lambda item: -len(item[1])):
        listed = ", ".join(map(str, found[:LISTED_CYCLES]))
        more = f" and {len(found) - LISTED_CYCLES} more" if len(found) > LISTED_CYCLES else ""
        named = f"cycle{'s' * (len(found) > 1)} {listed}{more}"
        sentences.append(f"{'all cycles' if 1 < len(found) == len(cycles) else named}: {reason}")
    return sentences


def not_known(known: Budget) -> list[str]:
    """What the rig file leaves unknown of the uncertainty."""
    sentences = []
    if known.unknown:
        names = ", ".join(known.unknown)
        sentences.append(
            f"unknown for lack of an accuracy of {names} (accuracy_full_scale under [sensors] of the rig file)"
        )
    if known.undetermined:
        names = ", ".join(known.undetermined)
        sentences.append(
            f"not determined for {names}: the errors of the sensors could take away all that it is made of"
        )
    stated = [metric for metric in METRICS if getattr(known.mean, metric) is not None]
    if stated and all(getattr(known.repeatability, metric) is None for metric in stated):
        sentences.append("repeatability not known, as one cycle does not show it")
    if stated and known.exact:
        sentences.append(f"{', '.join(known.exact)} taken as exact")
    return sentences
