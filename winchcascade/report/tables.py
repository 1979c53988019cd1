"""Tables of one reduction, with the digits that the uncertainty allows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from msgspec.structs import asdict, replace

from winchcascade.core.quantity import KGF, find_unit, si_unit
from winchcascade.core.run import CHANNELS
from winchcascade.reduction.efficiency import ALL_METRICS, METRICS, NET_METRICS, RATIOS
from winchcascade.reduction.energies import STAGES
from winchcascade.reduction.uncertainty import R_DRUM, shares
from winchcascade.report.digits import MINUS, number, of_many, percent, places, significant, stated, uncertain
from winchcascade.report.report_model import Cell, Table, TableColumn, make_table, rows_of
from winchcascade.report.traces import clock_zero
from winchcascade.report.wording import label, net_reasons, not_known, source_name

if TYPE_CHECKING:
    from winchcascade.core.rig_file import Sensor
    from winchcascade.core.run import Finding
    from winchcascade.reduction.montecarlo import Uncertainty
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.reduction.uncertainty import Contribution


MOST_CYCLES = 60
"""Cycles that a table lists; of more the first and the last half of that."""

MOST_FINDINGS = 40

MOST_REASONS = 3
"""Reasons for missing net energies that a note lists; the JSON holds that of each cycle."""

MOST_BINS = 80
"""Bins that a table lists; of more an even selection."""

SYMBOL = {
    "energy_line": "E_line", "energy_mech": "E_mech", "energy_gen": "E_gen", "power_line": "P_line", "power_mech": "P_mech",
    "power_gen": "P_gen", "eta_trans": "η_trans", "eta_gen": "η_gen", "eta_pto": "η_pto", "energy_payout": "E_payout",
    "energy_returned": "E_returned", "energy_net": "E_net", "energy_gen_cycle": "E_gen, cycle", "eta_net": "η_net",
}  # fmt: skip
"""Symbols of the metrics; what follows the underscore is set low."""

UNIT = {m: "J" if m.startswith("energy") else "W" if m.startswith("power") else "" for m in ALL_METRICS}
DECIMALS = {m: 3 if m.startswith("eta") else 0 for m in ALL_METRICS}
_KGCM2 = KGF * 1e4


_STAGE = {"line": "the line (force times speed)", "mech": "the shaft", "gen": "the DC link (Vdc times Idc)"}
"""What the stages are, by the end of a symbol."""


def known_u(found: Uncertainty, metric: str) -> float | None:
    """Standard uncertainty of a mean; where no sensor's accuracy is known, what the repeatability alone makes of it."""
    u: float | None = getattr(found.standard, metric) or getattr(found.budget.repeatability, metric)
    return u


def mean_text(reduction: Reduction, found: Uncertainty, metric: str) -> str:
    """Mean of a metric, with the digits that its uncertainty allows."""
    u = known_u(found, metric)
    value = getattr(reduction.mean, metric)
    return stated(value, u, DECIMALS[metric]) if u else _four(value, metric)


def _four(value: float | None, metric: str) -> str:
    """A value of unknown uncertainty: four digits before the point tell enough."""
    if value is None or not math.isfinite(value) or abs(value) < 1e4:
        return stated(value, None, DECIMALS[metric])
    return number(value, 3 - math.floor(math.log10(abs(value))))


def cycles_table(reduction: Reduction, found: Uncertainty) -> Table:
    """Energies, mean powers and efficiencies of every cycle, their mean, its uncertainty and the largest deviation."""
    given = [m for m in METRICS if any(getattr(c.metrics, m) is not None for c in reduction.cycles)]
    n = len(reduction.complete)
    more = "; the mean's uncertainty adds the repeatability" if n > 1 else ""
    incomplete = "" if n == len(reduction.cycles) else " A cycle in brackets is incomplete and not in the mean."
    columns = [
        TableColumn("Window", "s", 2, of=lambda c: c.window.cutoff - c.window.onset),
        *_metric_columns(reduction, found, given),
    ]
    columns.insert(0, TableColumn("Cycle", text=True, of=label))
    return make_table(
        "cycles",
        "Cycles: energies E over the integration window, mean powers P in it, efficiencies η." + incomplete,
        columns,
        _cycle_rows(columns, reduction.cycles),
        below=_means(reduction, found, given, n),
        note=metrics_note(given)
        + (f"Digits of a cycle are those that the sensors' errors allow{more}." if found.method else ""),
    )


def net_table(reduction: Reduction, found: Uncertainty) -> Table | None:
    """Energies of every whole cycle, from onset to next onset, and their means; None where no cycle has any."""
    given = [m for m in NET_METRICS if any(getattr(c.metrics, m) is not None for c in reduction.cycles)]
    if not given:
        return None
    n = sum(c.metrics.energy_net is not None for c in reduction.complete)
    reasons = net_reasons(reduction.cycles)
    missing = f"Without net energies: {'; '.join(reasons[:MOST_REASONS])}. " if reasons else ""
    ratio = "; η_net = E_gen, cycle / E_net" if "eta_net" in given else ""
    columns = [
        TableColumn("Cycle", text=True, of=label),
        TableColumn("Onset to onset", "s", 2, of=lambda c: c.net.end - c.net.begin),
        *_metric_columns(reduction, found, given),
    ]
    return make_table(
        "net",
        "Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
        "next onset.",
        columns,
        _cycle_rows(columns, reduction.cycles),
        below=_means(reduction, found, given, n),
        note=f"{missing}These energies do not depend on the integration window{ratio}. The zero of the force cell cancels in "
        "E_net, its gain does not.",
    )


def _metric_columns(reduction: Reduction, found: Uncertainty, given: Sequence[str]) -> list[TableColumn[CycleResult]]:
    """Columns of metrics with the digits that the uncertainty of each cycle allows."""
    of = {c.cycle: u for c, u in zip(reduction.cycles, found.budget.cycles, strict=True)}

    def text(metric: str, c: CycleResult) -> str:
        value, u = getattr(c.metrics, metric), getattr(of[c.cycle], metric)
        return of_many(value, u, DECIMALS[metric]) if u else _four(value, metric)

    return [TableColumn(SYMBOL[m], UNIT[m], of=partial(text, m)) for m in given]


def _means(reduction: Reduction, found: Uncertainty, given: Sequence[str], n: int) -> list[tuple[str, ...]]:
    """Rows below those of the cycles: the mean over n cycles, its uncertainty and the largest deviation."""
    below: list[tuple[str, ...]] = []
    if n and given:
        below.append((f"mean of {n}", "", *(mean_text(reduction, found, m) for m in given)))
    if any(m in found.method for m in given):
        below.append(("standard uncertainty", "", *(uncertain(getattr(found.standard, m)) for m in given)))
        below.append(("95 % interval, from", "", *(end_text(found, m, "low") for m in given)))
        below.append(("to", "", *(end_text(found, m, "high") for m in given)))
    if n > 1 and given:
        deviation = reduction.max_deviation_percent
        below.append(("largest deviation (%)", "", *(number(getattr(deviation, m), 2) for m in given)))
    return below


def metrics_note(given: Sequence[str]) -> str:
    """What the symbols of some metrics mean."""
    stages = [f"{s}, {what}" for s, what in _STAGE.items() if f"energy_{s}" in given or f"power_{s}" in given]
    ratios = [f"{SYMBOL[m]} = {SYMBOL[up]} / {SYMBOL[low]}" for m, (up, low) in RATIOS.items() if m in given]
    told = f"Subscripts: {'; '.join(stages)}" if stages else ""
    return "".join(f"{text}. " for text in (told, ", ".join(ratios)) if text)


def end_text(found: Uncertainty, metric: str, end: str) -> str:
    """One end of a 95 % interval, with the digits of the standard uncertainty."""
    interval, u = found.interval_95.get(metric), getattr(found.standard, metric)
    return "–" if interval is None or not u else number(getattr(interval, end), places(u))


def _cycle_rows(columns: Sequence[TableColumn[CycleResult]], cycles: Sequence[CycleResult]) -> list[tuple[Cell, ...]]:
    """Rows of the cycles, of many the first and the last ones."""
    return rows_of(columns, cycles, most=MOST_CYCLES)


def _plateau(name: str, cycle: CycleResult) -> float | None:
    flat = cycle.summary.payout.plateau
    return None if flat is None else asdict(flat)[name]


def payouts_table(reduction: Reduction) -> Table:
    """Payout of every cycle: instants, travel, and time means over its plateau."""
    zero = clock_zero(reduction.run)
    columns: list[TableColumn[CycleResult]] = [
        TableColumn("Cycle", text=True, of=label),
        TableColumn("Onset", "s", 2, of=lambda c: c.phases.onset - zero),
        TableColumn("Payout", "s", 2, of=lambda c: c.summary.payout.duration),
        TableColumn("Travel", "m", 2, of=lambda c: c.summary.payout.travel),
        TableColumn("v_max", "m/s", 2, of=lambda c: c.summary.payout.speed_max),
        TableColumn("v_plateau", "m/s", 3, of=partial(_plateau, "speed")),
        TableColumn("F", "N", of=partial(_plateau, "force")),
        TableColumn("τ", "N·m", 1, of=partial(_plateau, "torque")),
        *(TableColumn(SYMBOL[f"power_{s}"], "W", of=partial(_plateau, f"power_{s}")) for s in STAGES),
    ]
    note = (
        f"Onset: when the payout begins{_since(zero)}. v: line velocity; F: line force; τ: torque behind the clutch. "
        "Plateau: the stretch of steady speed."
    )
    caption = "Payouts, with time means over the plateau."
    return _without_empty(make_table("payouts", caption, columns, _cycle_rows(columns, reduction.cycles), note=note))


def _since(zero: float) -> str:
    """What times count from, where it is not the zero of the log's clock."""
    return f", counted from {zero:.2f} s on the log's clock" if zero else ""


def _hold(name: str, cycle: CycleResult) -> float | None:
    hold = cycle.summary.hold
    return None if hold is None else asdict(hold)[name]


def _pressure(cycle: CycleResult) -> float | None:
    pressure = _hold("pressure", cycle)
    return None if pressure is None else pressure / _KGCM2


def _haul_in(name: str, cycle: CycleResult) -> float | None:
    haul_in = cycle.summary.haul_in
    return None if haul_in is None else asdict(haul_in)[name]


_HOLD_COLUMNS: tuple[TableColumn[CycleResult], ...] = (
    TableColumn("Cycle", text=True, of=label),
    TableColumn("Hold", "s", 2, of=partial(_hold, "duration")),
    TableColumn("F_hold", "N", of=partial(_hold, "force")),
    TableColumn("τ_hold", "N·m", 1, of=partial(_hold, "torque")),
    TableColumn("p_hold", "kg/cm²", 2, of=_pressure),
    TableColumn("Haul-in", "s", 2, of=partial(_haul_in, "duration")),
    TableColumn("v_max", "m/s", 2, of=partial(_haul_in, "speed_max")),
    TableColumn("F_mean", "N", of=partial(_haul_in, "force")),
    TableColumn("F_min", "N", of=partial(_haul_in, "force_min")),
    TableColumn("E_line", "J", of=partial(_haul_in, "energy_line")),
)


def holds_table(reduction: Reduction) -> Table:
    """Hold and haul-in of every cycle."""
    return _without_empty(
        make_table(
            "holds",
            "Holds and haul-ins: time means; the energy of a haul-in is returned to the line and negative.",
            _HOLD_COLUMNS,
            _cycle_rows(_HOLD_COLUMNS, reduction.cycles),
            note="F: line force; τ: torque behind the clutch; p: accumulator pressure, gauge; v: line speed of the haul-in.",
        )
    )


def bins_table(reduction: Reduction) -> Table | None:
    """Mean powers in bins of generator speed; None where that speed is unknown."""
    stages = [s for s in STAGES if any(b.power.get(s) is not None for b in reduction.bins)]
    if not reduction.bins or not stages:
        return None
    rows = []
    step = -(-len(reduction.bins) // MOST_BINS)
    for b in reduction.bins[::step]:
        powers: list[str] = []
        for s in stages:
            error = b.standard_error.get(s)
            powers += [stated(b.power.get(s), error, 0), uncertain(error)]
        rows.append((f"{number(b.rpm_low, 0)} to {number(b.rpm_high, 0)}", f"{b.count}", *powers))
    return Table(
        id="bins",
        caption="Mean powers of the payouts in bins of generator speed, with the standard error of their samples.",
        head=("Generator speed", "Samples", *(h for s in stages for h in (SYMBOL[f"power_{s}"], "±"))),
        units=("rpm", "", *("W" for _ in stages for _ in range(2))),
        rows=tuple(rows),
        note=("" if len(rows) == len(reduction.bins) else f"{len(rows)} of {len(reduction.bins)} bins, evenly chosen. ")
        + "The standard error takes samples as independent, which smooth motion makes too small.",
    )


def findings_table(reduction: Reduction) -> Table | None:
    """What was found wrong with the log and what was done; None for a clean log."""
    quality, samples = reduction.quality, reduction.run.samples
    if not quality:
        return None
    zero = clock_zero(reduction.run)
    columns: list[TableColumn[Finding]] = [
        TableColumn("Finding", text=True, of=lambda f: f.kind.replace("_", " ")),
        TableColumn("Channel", text=True, of=lambda f: f.channel or ""),
        TableColumn("From", "s", 2, of=lambda f: None if f.start is None else f.start - zero),
        TableColumn("To", "s", 2, of=lambda f: None if f.end is None else f.end - zero),
        TableColumn("Data lost", "%", of=lambda f: percent(f.removed / samples if samples else 0.0, 2)),
        TableColumn("What was found", text=True, of=lambda f: f.message),
        TableColumn("What was done", text=True, of=lambda f: f.action),
    ]
    rows = rows_of(columns, quality[:MOST_FINDINGS])
    if len(quality) > MOST_FINDINGS:
        rows.append((f"… {len(quality) - MOST_FINDINGS} more", *[""] * 6))
    note = f"Times are{_since(zero).lstrip(',')}." if zero else ""
    caption = "Findings: what is wrong with the log, and what was done about it."
    return make_table("findings", caption, columns, rows, note=note)


def _without_empty(table: Table) -> Table:
    """A table without the columns that hold nothing but dashes."""
    used = [k for k in range(len(table.head)) if k == 0 or any(row[k] not in ("", "–") for row in table.rows)]
    return replace(
        table,
        head=tuple(table.head[k] for k in used),
        units=tuple(table.units[k] for k in used),
        rows=tuple(tuple(row[k] for k in used) for row in table.rows),
        text_columns=tuple(n for n, k in enumerate(used) if k in table.text_columns),
    )


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
