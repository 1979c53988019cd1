"""Words on a log: its origin, load, window, cycles, and the sources of its uncertainty."""

from __future__ import annotations

import math
from collections import Counter
from operator import itemgetter
from typing import TYPE_CHECKING

from winchcascade.core.accuracy import ACQUISITION, ErrorSource
from winchcascade.core.campaign_file import KINDS, Origin, joint_origin
from winchcascade.core.plain_text import first_of
from winchcascade.reduction.efficiency import NET_METRICS
from winchcascade.reduction.error_model import R_DRUM, SAMPLING
from winchcascade.reduction.timing import TIMING
from winchcascade.reduction.uncertainty import Budget, shares
from winchcascade.report.content import Measured, shown
from winchcascade.report.glossary import CHANNELS, SENSORS, metric

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.core.rig_file import WindowRule
    from winchcascade.core.run import Run
    from winchcascade.reduction.reduction_result import CycleResult, MeasuredLoad, Reduction

_SOURCES = (
    {name: term.label for name, term in CHANNELS.items()}
    | SENSORS
    | {R_DRUM: "drum radius", SAMPLING: "sampling"}
)
"""What a source of uncertainty is called."""

_SPANS = {"steps": "step", "rows": "row", "ranges": "range", "whole": "record"}
"""What a cycle is called whose whole span counts, by the source of the cycles."""


def at_most(texts: Sequence[str], limit: int, rest: str) -> list[str]:
    """Texts up to a limit, and one in place of those beyond it: `rest` with their number.

    >>> at_most(["a", "b", "c"], 2, "{} more"), at_most(["a"], 2, "{} more")
    (['a', 'b', '1 more'], ['a'])
    """
    beyond = len(texts) - limit
    return [*texts[:limit], *([rest.format(beyond)] if beyond > 0 else [])]


def origin_words(origins: Sequence[Origin]) -> str:
    """State of one or several logs whether they are measured, and where they come from.

    >>> origin_words([Origin(False, "Rebuilt from Table 2"), Origin()])
    '1 not measured, 1 not stated. Rebuilt from Table 2.'
    """
    counts = Counter(origin.measured for origin in origins)
    kinds = [
        KINDS[kind] if len(counts) == 1 else f"{counts[kind]} {KINDS[kind]}"
        for kind in KINDS
        if kind in counts
    ]
    sentence = joint_origin(origins).sentence
    text = ", ".join(kinds) if kinds else KINDS[None]
    return f"{text}. {sentence}." if sentence else text


def banner(origins: Sequence[Origin]) -> str:
    """Warning for every page of a report on logs that are not measured; empty if there is none.

    >>> banner([Origin(False, "Rebuilt from Table 2")]), banner([Origin(True), Origin(False)])
    ('Not measured.', '1 of 2 logs are not measured.')
    """
    made = sum(origin.measured is False for origin in origins)
    if not made:
        return ""
    return (
        "Not measured."
        if made == len(origins)
        else f"{made} of {len(origins)} logs are not measured."
    )


def load_words(
    load: float | None, unit: str = "Ω", *, before: str = "", unknown: str = "no load"
) -> str:
    """Load of a log.

    Parameters
    ----------
    before : what is written before a resistance
    unknown : what is written where there is no load, or none is known

    Examples
    --------
    >>> load_words(9.0), load_words(math.inf), load_words(9.0, "ohm", before="load ")
    ('9 Ω', 'open circuit', 'load 9 ohm')
    """
    return (
        unknown
        if load is None
        else "open circuit"
        if math.isinf(load)
        else f"{before}{load:g} {unit}"
    )


def load_text(load: float | None) -> str:
    """Load of a log under a head with its unit.

    >>> load_text(9.0), load_text(math.inf), load_text(None)
    ('9', 'open circuit', '-')
    """
    return load_words(load, "", unknown="-").rstrip()


def measured_load_words(measured: MeasuredLoad | None, unit: str = "Ω") -> str:
    """Vdc / Idc as it stands beside the stated load; empty where it was not measured."""
    return "" if measured is None else f"Vdc / Idc {measured.ohm:.4g} {unit}"


def window_words(window: WindowRule) -> str:
    """Rule of an integration window."""
    return window if isinstance(window, str) else f"{window:g} s from the onset"


def span_word(reduction: Reduction) -> str:
    """What the part of a cycle is called that its window lies in: a payout, or the span that a rig
    file gives.

    >>> from winchcascade.reduction.reduce import reduce
    >>> from winchcascade.ingest.read import read_run
    >>> span_word(reduce(read_run("fixtures/campaign/r36ohm.csv")))
    'payout'
    """
    return _SPANS.get(reduction.rig.phases.source, "payout")


def mean_text(name: str, mean: float | None, u: float | None) -> str:
    """Mean of a metric as every page states it: with the digits of its own standard uncertainty,
    else with those of its kind.

    >>> mean_text("energy_line", 7114.9, 61.8), mean_text("eta_pto", 0.69661, None)
    ('7115', '0.697')
    """
    return shown(Measured(mean, u), metric(name).decimals)


# ----------------------------------------------------------------------------------------- cycles
def clock_zero(run: Run) -> float:
    """What a drawn time axis begins from: 0, or the log's first stamp where that is large, as
    the seconds of an epoch. [s]
    """
    first, last = float(run.t[0]), float(run.t[-1])
    return 0.0 if abs(first) < 10.0 * max(last - first, 1.0) else first


def label(cycle: CycleResult) -> str:
    """Number of a cycle, in brackets if it is incomplete."""
    return f"{cycle.cycle}" if cycle.complete else f"({cycle.cycle})"


NAMED_CYCLES = 6
"""Numbers of cycles that a sentence lists."""


def net_reasons(cycles: Sequence[CycleResult]) -> list[str]:
    """Which cycles have no net energies, and why: one sentence for each reason, that of the most
    cycles first.
    """
    by_reason: dict[str, list[int]] = {}
    for cycle in (cycle for cycle in cycles if cycle.net.reason is not None):
        by_reason.setdefault(cycle.net.reason or "", []).append(cycle.cycle)
    ranked = sorted(by_reason.items(), key=lambda item: -len(item[1]))
    return [f"{_named_cycles(found, len(cycles))}: {reason}" for reason, found in ranked]


def _named_cycles(numbers: Sequence[int], of: int) -> str:
    """Some of `of` cycles, by their numbers."""
    named = f"cycle{'s' * (len(numbers) > 1)} {first_of([*map(str, numbers)], NAMED_CYCLES)}"
    return "all cycles" if 1 < len(numbers) == of else named


# ------------------------------------------------------------------------- sources of uncertainty
def source_name(source: ErrorSource | None) -> str:
    """Name a source of uncertainty: the sensor and what of it errs."""
    if source is None:
        return "bridged gaps"
    part = "" if source.channel in (R_DRUM, SAMPLING, TIMING) else f", {source.part}"
    return _sensor(source) + part + (" (acquisition)" if source.origin == ACQUISITION else "")


def _sensor(source: ErrorSource) -> str:
    return _SOURCES.get(source.channel, source.channel)


def decisive(known: Budget) -> list[tuple[str, float, str]]:
    """Which sensor decides the uncertainty of each efficiency: the metric, the share of its
    variance, and the sensor.
    """
    rows = [
        ("bridged gaps" if row.source is None else _sensor(row.source), row.of)
        for row in known.rows
    ]
    found = []
    for name in filter(_is_ratio, known.mean):
        parts: dict[str, float] = {}
        for sensor, of in (*rows, ("repeatability", known.repeatability)):
            parts[sensor] = parts.get(sensor, 0.0) + (shares(of, known.mean)[name] or 0.0)
        largest = max(parts, key=parts.__getitem__)
        found += [(name, parts[largest], largest)] if parts[largest] else []
    return found


WORTH_CALIBRATING = 0.5
"""Share of the variance of an efficiency from which the limits of one sensor are worth a
calibration: without them its standard uncertainty falls below 0.7 of what it was. [1]"""


def calibration(known: Budget) -> str:
    """What a calibration in place of the sensor would bring whose limits decide an efficiency
    most; empty if none does.
    """
    found = []
    for source, of in ((row.source, row.of) for row in known.rows):
        if (
            source is None
            or source.channel in (R_DRUM, SAMPLING)
            or source.basis == "calibration_in_place"
        ):
            continue
        parts = shares(of, known.mean).items()
        found += [(share or 0.0, name, source) for name, share in parts if _is_ratio(name)]
    share, name, source = max(found, key=itemgetter(0), default=(0.0, "", None))
    u = known.mean[name] if source is not None else None
    if source is None or u is None or share < WORTH_CALIBRATING:
        return ""
    entry = f"u_{source.part} under [sensors.{source.channel}] of the rig file"
    return (
        f"u({name}) is {u:.2g} by the limits of the {_sensor(source)}; with its {source.part} "
        f"calibrated in place ({entry}) "
        f"it would be {u * math.sqrt(1.0 - share):.2g}."
    )


def _is_ratio(name: str) -> bool:
    """Whether a metric is an efficiency of windows."""
    return name.startswith("eta") and name != "eta_net"


def not_known(known: Budget) -> list[str]:
    """What the rig file leaves unknown of the uncertainty."""
    repeatability, exact = known.repeatability, ", ".join(known.exact)
    stated = [
        name for name, value in known.mean.items() if value is not None and name not in NET_METRICS
    ]
    return [
        text
        for text, wanted in (
            (
                f"unknown for lack of an accuracy of {', '.join(known.unknown)} "
                f"(accuracy_full_scale under [sensors] of the "
                "rig file)",
                known.unknown,
            ),
            (
                f"not determined for {', '.join(known.undetermined)}: the errors of the sensors "
                f"could take away all that it "
                "is made of",
                known.undetermined,
            ),
            (
                "repeatability not known, as one cycle does not show it",
                stated and all(repeatability[name] is None for name in stated),
            ),
            (f"{exact} taken as exact", stated and exact),
        )
        if wanted
    ]
