"""Tables of what a reduction does not know: scatter of the cycles, uncertainty of the means, its budget, the sensors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winchcascade.core.quantity import find_unit, si_unit
from winchcascade.core.run import CHANNELS
from winchcascade.reduction.efficiency import ALL_METRICS, METRICS
from winchcascade.reduction.uncertainty import R_DRUM, shares
from winchcascade.report.digits import MINUS, number, percent, places, significant, stated, uncertain
from winchcascade.report.report_model import Table
from winchcascade.report.tables import DECIMALS, SYMBOL, UNIT, end_text, mean_text
from winchcascade.report.wording import not_known, source_name

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Sensor
    from winchcascade.reduction.montecarlo import Uncertainty
    from winchcascade.reduction.reduction_result import Reduction
    from winchcascade.reduction.uncertainty import Contribution


def repeatability_table(reduction: Reduction, found: Uncertainty) -> Table | None:
    """Scatter of the complete cycles: largest deviation, which cycle has it, and s/sqrt(N); None for fewer than two."""
    complete = reduction.complete
    if len(complete) < 2:
        return None
    rows = []
    for m in ALL_METRICS:
        mean = getattr(reduction.mean, m)
        counted = [c for c in complete if getattr(c.metrics, m) is not None]
        if mean is None or len(counted) < 2:
            continue
        values = [getattr(c.metrics, m) for c in counted]
        far = max(counted, key=lambda c: abs(getattr(c.metrics, m) - mean))
        u = getattr(found.budget.repeatability, m)
        rows.append((
            SYMBOL[m], UNIT[m], mean_text(reduction, found, m),
            stated(min(values), u, DECIMALS[m]), stated(max(values), u, DECIMALS[m]),
            number(getattr(reduction.max_deviation_percent, m), 2), f"{far.cycle}", uncertain(u * math.sqrt(len(values))),
            uncertain(u),
        ))  # fmt: skip
    if not rows:
        return None
    return Table(
        id="repeatability",
        caption=f"Repeatability of {len(complete)} complete cycles.",
        head=("Metric", "Unit", "Mean", "Least", "Largest", "Largest deviation", "in cycle", "s", "s/√N"),
        units=("", "", "", "", "", "%", "", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1),
        note="The largest deviation of a cycle from the mean, in percent of the mean. s: standard deviation of a cycle; "
        "s/√N: of the mean of the N cycles; of net energies, of those that are whole.",
    )


def uncertainty_table(reduction: Reduction, found: Uncertainty) -> Table | None:
    """Uncertainty of each mean: of the sensors, of the repeatability, together, and the 95 % interval; None without any."""
    known = found.budget
    if not found.method:
        return None
    rows = []
    for m in ALL_METRICS:
        mean, u = getattr(reduction.mean, m), getattr(found.standard, m)
        if mean is None:
            continue
        freedom = getattr(known.freedom, m)
        alone = found.interval_95_sensors.get(m)
        rows.append((
            SYMBOL[m], UNIT[m], stated(mean, u, DECIMALS[m]), uncertain(getattr(known.sensors, m)),
            uncertain(getattr(known.repeatability, m)), uncertain(u),
            "–" if freedom is None else "∞" if freedom > 1000 else number(freedom, 0 if freedom >= 10 else 1),
            f"{end_text(found, m, 'low')} to {end_text(found, m, 'high')}" if u else "–",
            "–" if alone is None else _span(alone.low, alone.high, getattr(known.sensors, m)),
        ))  # fmt: skip
    if not rows:
        return None
    return Table(
        id="uncertainty",
        caption="Standard uncertainty u of the means and 95 % intervals.",
        head=("Metric", "Unit", "Mean", "u, sensors", "u, cycles", "u", "ν", "95 % interval", "these cycles alone"),
        units=("", "", "", "", "", "", "", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1),
        note=_how_stated(found),
    )


def unknown_words(found: Uncertainty) -> str:
    """Why no uncertainty is stated; nothing where one is."""
    if found.method:
        return ""
    return f"Only the repeatability is known; {'; '.join(not_known(found.budget)) or 'no metric is known'}."


def _how_stated(found: Uncertainty) -> str:
    """Where the stated uncertainties come from."""
    by_draws = [SYMBOL[m] for m in ALL_METRICS if found.method.get(m) == "monte_carlo"]
    which = "the Monte Carlo confirms the budget of every metric"
    if by_draws:
        which = f"of {', '.join(by_draws)} the Monte Carlo's u is stated, as the errors do not act linearly"
    return (
        f"Monte Carlo of {found.draws} draws, seed {found.seed}: {which}. ν: effective degrees of freedom. 'These cycles "
        "alone' leaves the repeatability out: it is what the sensors leave open of the very cycles of this log."
    )


def _span(low: float, high: float, u: float | None) -> str:
    return f"{number(low, places(u))} to {number(high, places(u))}" if u else "–"


def budget_table(found: Uncertainty, source: str = "") -> Table | None:
    """Which error contributes which share of the variance of each mean; None where no accuracy is known.

    Parameters
    ----------
    source : what the rig file says of where its numbers come from
    """
    known = found.budget
    metrics = [m for m in (*METRICS[6:], "eta_net", *METRICS[:3]) if getattr(known.mean, m)]
    if not metrics:
        return None
    rows = [(*_about(r), *(percent(getattr(shares(r.of, known.mean), m) or None) for m in metrics)) for r in known.rows]
    scatter = shares(known.repeatability, known.mean)
    rows.append(("repeatability", "", "normal", "", "cycles", *(percent(getattr(scatter, m)) for m in metrics)))
    return Table(
        id="budget",
        caption="Uncertainty budget: share of the variance of each mean, in percent.",
        head=("Source", "Limit", "Distribution", "u", "From", *(SYMBOL[m] for m in metrics)),
        units=("", "", "", "", "", *("%" for _ in metrics)),
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3, 4),
        note="Errors of a sensor are the same over the whole log, so they do not average out over its cycles. A limit in "
        "shares of the full scale is half zero and half gain error. u: standard uncertainty of the error."
        + _from(source),
    )


def _from(source: str) -> str:
    """What the words of a rig file about its sources refer to."""
    return f" From: the rig file's words; its source is {source}." if source else ""


def _about(row: Contribution) -> tuple[str, str, str, str, str]:
    source = row.source
    if source is None:
        return source_name(None), "", "rectangular", "", "data beside the gaps"
    if source.part == "gain" or source.channel == R_DRUM:
        factor, unit = 100.0, "%"
    else:
        factor, unit = 1.0, si_unit(CHANNELS[source.channel].dimension).replace(".", "·")
    limit = "" if source.limit is None else f"{significant(source.limit * factor)} {unit}"
    return source_name(source), limit, source.shape, f"{significant(source.u * factor)} {unit}", source.origin or "–"


def sensors_table(reduction: Reduction) -> Table | None:
    """Sensors of the channels of the log, as the rig file states them."""
    rows = []
    for name, sensor in reduction.rig.sensors.items():
        if name not in reduction.run.channels:
            continue
        known = find_unit(sensor.unit)
        factor = 1.0 if known is None else known.factor
        ends = (
            "–"
            if sensor.high is None
            else f"{_given(sensor.low or 0.0, factor)} to {_given(sensor.high, factor)} {sensor.unit}"
        )
        rows.append((name, sensor.instrument or "–", ends, _accuracy(sensor, factor), sensor.source or "–"))
    if not rows:
        return None
    return Table(
        id="sensors",
        caption="Sensors, as the rig file states them; accuracies are limits.",
        head=("Channel", "Instrument", "Range", "Accuracy", "From"),
        units=("", "", "", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3, 4),
        note=_from(reduction.rig.source).strip(),
    )


def _given(value: float, factor: float = 1.0) -> str:
    """A number of a rig file, in the file's own unit."""
    return f"{value / factor:.6g}".replace("-", MINUS)


def _accuracy(sensor: Sensor, factor: float) -> str:
    parts = []
    if sensor.accuracy_full_scale is not None:
        parts.append(f"{_given(100.0 * sensor.accuracy_full_scale)} % of full scale")
    if sensor.accuracy_reading is not None:
        parts.append(f"{_given(100.0 * sensor.accuracy_reading)} % of the reading")
    if sensor.accuracy is not None:
        parts.append(f"{_given(sensor.accuracy, factor)} {sensor.unit}")
    return " and ".join(parts) or "not stated"
