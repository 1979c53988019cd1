"""Tables of one reduction, with the digits that the uncertainty allows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Literal

from msgspec.structs import asdict

from winchcascade.core.cascade import PAPER
from winchcascade.core.channels import Channel
from winchcascade.core.quantity import Unit, find_unit, si_unit
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Finding
from winchcascade.reduction.bins import STORES, Bin
from winchcascade.reduction.efficiency import NET_METRICS, Metrics
from winchcascade.reduction.montecarlo import Interval, Uncertainty
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.uncertainty import R_DRUM, BudgetRow, shares
from winchcascade.report import sheet as content
from winchcascade.report.digits import (
    MINUS,
    interval_text,
    number,
    of_many,
    percent,
    significant,
    stated,
    uncertain,
)
from winchcascade.report.sheet import TableColumn
from winchcascade.report.time_histories import clock_zero
from winchcascade.report.wording import (
    SYMBOL,
    decimals_of,
    label,
    metrics_note,
    net_reasons,
    not_known,
    of_phase,
    source_name,
    span_word,
    unit_of,
)

LISTED_CYCLES = content.Limit(60)
"""Cycles that a table lists; of more the first and the last half of that."""

MAX_FINDINGS = 40

MAX_REASONS = 3
"""Reasons for missing net energies that a note lists; the JSON holds that of each cycle."""

TOGETHER = 3
"""Stages whose energies, powers and efficiencies stand in one table; of more the powers have their own."""

MAX_BINS = 80
"""Bins that a table lists; of more an even selection."""


def mean_text(reduction: Reduction, found: Uncertainty, metric: str) -> str:
    """Mean of a metric, with the digits that its uncertainty allows: of the repeatability where no accuracy is known."""
    value = reduction.mean[metric]
    u = found.standard[metric] or found.budget.repeatability[metric]
    return stated(value, u, decimals_of(metric)) if u else _four(value, metric)


def _four(value: float | None, metric: str) -> str:
    """A value of unknown uncertainty: four digits before the point are enough."""
    if value is None or not math.isfinite(value) or abs(value) < 1e4:
        return stated(value, None, decimals_of(metric))
    return number(value, 3 - math.floor(math.log10(abs(value))))


def whole_text(reduction: Reduction, metric: str) -> str:
    """A metric of all complete cycles together."""
    return _four(reduction.total[metric], metric)


def _metric_columns(reduction: Reduction, found: Uncertainty, given: Sequence[str]) -> list[TableColumn[CycleResult]]:
    """Columns of metrics with the digits that the uncertainty of each cycle allows."""
    of = {c.cycle: u for c, u in zip(reduction.cycles, found.budget.cycles, strict=True)}

    def text(metric: str, c: CycleResult) -> str:
        value, u = c.metrics[metric], of[c.cycle][metric]
        return of_many(value, u, decimals_of(metric)) if u else _four(value, metric)

    return [TableColumn(SYMBOL[m], unit_of(m), of=partial(text, m)) for m in given]


def _given(reduction: Reduction, metrics: Sequence[str]) -> list[str]:
    """Metrics that any cycle has."""
    return [m for m in metrics if any(c.metrics[m] is not None for c in reduction.cycles)]


def cycles_table(reduction: Reduction, found: Uncertainty) -> content.Table:
    """Energies, mean powers and efficiencies of every cycle, their mean, its uncertainty and the largest deviation."""
    cascade = reduction.rig.cascade
    apart = len(cascade.stages) > TOGETHER
    given = _given(reduction, [m for m in cascade.metrics if not (apart and m.startswith("power"))])
    n = len(reduction.complete)
    more = "; the mean's uncertainty adds the repeatability" if n > 1 else ""
    incomplete = "" if n == len(reduction.cycles) else " A cycle in brackets is incomplete and not in the mean."
    return content.ItemTable[CycleResult](
        "cycles",
        f"Cycles: energies E over the integration window,{'' if apart else ' mean powers P in it,'} efficiencies η."
        + incomplete,
        [
            _CYCLE,
            TableColumn("Window", "s", 2, of=lambda c: c.window.cutoff - c.window.onset),
            *_metric_columns(reduction, found, given),
        ],
        metrics_note(cascade, given)
        + (f"Digits of a cycle are those that the sensors' errors allow{more}." if found.method else ""),
        LISTED_CYCLES,
    ).always(reduction.cycles, _means(reduction, found, given, n))


def powers_table(reduction: Reduction, found: Uncertainty) -> content.Table | None:
    """Mean powers of every cycle where a cascade has too many stages for one table; None where it has not."""
    cascade = reduction.rig.cascade
    given = _given(reduction, [m for m in cascade.metrics if m.startswith("power")])
    if len(cascade.stages) <= TOGETHER or not given:
        return None
    below = [(row[0], *row[2:]) for row in _means(reduction, found, given, len(reduction.complete))]
    columns = [_CYCLE, *_metric_columns(reduction, found, given)]
    table = content.ItemTable("mean-powers", "Mean powers P in the integration window.", columns, limit=LISTED_CYCLES)
    return table.always(reduction.cycles, below)


def net_table(reduction: Reduction, found: Uncertainty) -> content.Table | None:
    """Energies of every whole cycle, from onset to next onset, and their means; None where no cycle has any."""
    given = _given(reduction, reduction.rig.cascade.net_metrics)
    if not given:
        return None
    reasons = net_reasons(reduction.cycles)
    missing = f"Without net energies: {'; '.join(reasons[:MAX_REASONS])}. " if reasons else ""
    ratio = "; η_net = E_gen, cycle / E_net" if "eta_net" in given else ""
    return content.ItemTable[CycleResult](
        "net",
        "Whole cycles: line energy of the payout, line energy returned in haul-in, and net line energy from onset to "
        "next onset.",
        [
            _CYCLE,
            TableColumn("Onset to onset", "s", 2, of=lambda c: c.net.end - c.net.begin),
            *_metric_columns(reduction, found, given),
        ],
        f"{missing}These energies do not depend on the integration window{ratio}. The zero of the force cell cancels in "
        "E_net, its gain does not.",
        LISTED_CYCLES,
    ).always(
        reduction.cycles,
        _means(reduction, found, given, sum(c.metrics.energy_net is not None for c in reduction.complete)),
    )


def _means(reduction: Reduction, found: Uncertainty, given: Sequence[str], n: int) -> list[tuple[str, ...]]:
    """Rows below those of the cycles: the mean over n cycles, its uncertainty and the largest deviation."""
    repeats = reduction.rig.phases.repeats
    stated_u = repeats and any(m in found.method for m in given)
    rows: tuple[tuple[str, bool, Callable[[str], str]], ...] = (
        (f"mean of {n}", n > 0 and repeats, partial(mean_text, reduction, found)),
        ("standard uncertainty", stated_u, lambda m: uncertain(found.standard[m])),
        ("95 % interval, from", stated_u, lambda m: end_text(found, m, "low")),
        ("to", stated_u, lambda m: end_text(found, m, "high")),
        ("largest deviation (%)", n > 1 and repeats, lambda m: number(reduction.max_deviation_percent[m], 2)),
    )
    return [(name, "", *map(text, given)) for name, wanted, text in rows if wanted and given]


def end_text(found: Uncertainty, metric: str, end: Literal["low", "high"]) -> str:
    """One end of a 95 % interval, with the digits of the standard uncertainty."""
    interval, u = found.interval_95.get(metric), found.standard[metric]
    return "–" if interval is None or not u else stated(asdict(interval)[end], u, 0)


_CYCLE: TableColumn[CycleResult] = TableColumn("Cycle", text=True, of=label)


def payouts_table(reduction: Reduction) -> content.Table:
    """Payout of every cycle: instants, travel, and time means over its plateau."""
    zero = clock_zero(reduction.run)
    onset: TableColumn[CycleResult] = TableColumn("Onset", "s", 2, of=lambda c: c.phases.onset - zero)
    word = span_word(reduction)
    if word != "payout":
        length = _phase_column("Length", "s", 2, "payout", "duration")
        caption, note = f"{word.capitalize()}s, with time means.", f"Onset: when the {word} begins{_since(zero)}. "
        note += "n: speed of the shaft; τ: torque of the shaft, as logged."
        return _phases_table("payouts", caption, [_CYCLE, onset, length, *_PAYOUT[1:]], reduction, note)
    return _phases_table(
        "payouts",
        "Payouts, with time means over the plateau.",
        [_CYCLE, onset, *_PAYOUT],
        reduction,
        f"Onset: when the payout begins{_since(zero)}. v: line velocity; F: line tension; τ: torque of the PTO shaft. "
        "Plateau: the stretch of steady speed.",
    )


def _since(zero: float) -> str:
    """What times count from, where it is not the zero of the log's clock."""
    return f", counted from {zero:.2f} s on the log's clock" if zero else ""


def holds_table(reduction: Reduction) -> content.Table:
    """Hold and haul-in of every cycle."""
    return _phases_table(
        "holds",
        "Holds and haul-ins: time means; the energy of a haul-in is returned to the line and negative.",
        [_CYCLE, *_HOLD_AND_HAUL_IN],
        reduction,
        "F: line tension; τ: torque of the PTO shaft; p: accumulator pressure, gauge; v: line speed of the haul-in.",
    )


def _phase_column(name: str, unit: str, digits: int, phase: str, field: str) -> TableColumn[CycleResult]:
    """Column of one number of the summary of a phase."""
    return TableColumn(name, unit, digits, of=partial(of_phase, phase, field))


_PAYOUT = (
    _phase_column("Payout", "s", 2, "payout", "duration"),
    _phase_column("Travel", "m", 2, "payout", "travel"),
    _phase_column("v_max", "m/s", 2, "payout", "speed_max"),
    _phase_column("n", "rpm", 1, "point", "rpm_shaft"),
    _phase_column("τ", "N·m", 3, "point", "torque"),
    _phase_column("v_plateau", "m/s", 3, "plateau", "speed"),
    _phase_column("F", "N", 0, "plateau", "force"),
    _phase_column("τ", "N·m", 1, "plateau", "torque"),
    *(_phase_column(SYMBOL[f"power_{s}"], "W", 0, "plateau", f"power_{s}") for s in PAPER.names),
)
_HOLD_AND_HAUL_IN = (
    _phase_column("Hold", "s", 2, "hold", "duration"),
    _phase_column("F_hold", "N", 0, "hold", "force"),
    _phase_column("τ_hold", "N·m", 1, "hold", "torque"),
    _phase_column("p_hold", "kg/cm²", 2, "hold", "pressure"),
    _phase_column("Haul-in", "s", 2, "haul_in", "duration"),
    _phase_column("v_max", "m/s", 2, "haul_in", "speed_max"),
    _phase_column("F_mean", "N", 0, "haul_in", "force"),
    _phase_column("F_min", "N", 0, "haul_in", "force_min"),
    _phase_column("E_line", "J", 0, "haul_in", "energy_line"),
)


def _phases_table(
    name: str, caption: str, columns: Sequence[TableColumn[CycleResult]], reduction: Reduction, note: str
) -> content.Table:
    """A row for each cycle, without the columns that hold nothing."""
    rows = content.rows_of(columns, reduction.cycles, LISTED_CYCLES)
    used = [k for k in range(len(columns)) if k == 0 or any(row[k] not in (None, "") for row in rows)]
    return content.make_table(
        name, caption, [columns[k] for k in used], [[row[k] for k in used] for row in rows], note=note
    )


def bins_table(reduction: Reduction) -> content.Table | None:
    """Mean powers in bins of generator speed; None where that speed is unknown."""
    stages = [s for s in reduction.rig.cascade.names if any(b.power.get(s) is not None for b in reduction.bins)]
    stores = [store for store in STORES if any(b.stored.get(store) is not None for b in reduction.bins)]
    shown = reduction.bins[
        :: max(1, -(-len(reduction.bins) // (content.row_limit(MAX_BINS) or len(reduction.bins) or 1)))
    ]
    return content.ItemTable[Bin](
        "bins",
        f"Mean powers of the {span_word(reduction)}s in bins of generator speed, with the standard error of their samples.",
        [
            TableColumn(
                "Generator speed", "rpm", text=True, of=lambda b: f"{number(b.rpm_low, 0)} to {number(b.rpm_high, 0)}"
            ),
            TableColumn("Samples", of=lambda b: b.count),
            *(column for stage in stages for column in _power_columns(stage)),
            *(TableColumn[Bin](f"into {store}", "W", of=partial(_stored, store)) for store in stores),
        ],
        note=(
            "" if len(shown) == len(reduction.bins) else f"{len(shown)} of {len(reduction.bins)} bins, evenly chosen. "
        )
        + "The standard error takes samples as independent, which smooth motion makes too small. "
        + _storage_words(stores),
    ).of(shown if stages else ())


def _stored(store: str, of: Bin) -> str:
    return number(of.stored.get(store), 0)


def _storage_words(stores: Sequence[str]) -> str:
    """What a difference of two powers in a bin contains beside losses, and whether the table gives it."""
    needed = {"rotor": "inertia_rotor", "capacitor": "c_dc"}
    missing = " or ".join(what for store, what in needed.items() if store not in stores)
    if not missing:
        return "Into rotor, spring of the shaft, capacitor: stored while the speed changes; P_mech − P_gen less these is lost."
    return (
        f"Without {missing} in the rig file, or its channel in the log, a difference of powers contains what is stored while "
        "the speed changes, and is no loss."
    )


def _power_columns(stage: str) -> list[TableColumn[Bin]]:
    """Mean power of a stage in a bin, and its standard error."""
    return [
        TableColumn(
            SYMBOL[f"power_{stage}"], "W", of=lambda b: stated(b.power.get(stage), b.standard_error.get(stage), 0)
        ),
        TableColumn("±", "W", of=lambda b: uncertain(b.standard_error.get(stage))),
    ]


def findings_table(reduction: Reduction) -> content.Table | None:
    """What was found wrong with the log and what was done; None for a clean log."""
    if not reduction.quality:
        return None
    quality, samples, zero = reduction.quality, reduction.run.samples, clock_zero(reduction.run)
    columns: list[TableColumn[Finding]] = [
        TableColumn("Finding", text=True, of=lambda f: f.kind.replace("_", " ")),
        TableColumn("Channel", text=True, of=lambda f: f.channel or ""),
        TableColumn("From", "s", 2, of=lambda f: None if f.start is None else f.start - zero),
        TableColumn("To", "s", 2, of=lambda f: None if f.end is None else f.end - zero),
        TableColumn("Data lost", "%", of=lambda f: percent(f.lost_share(samples), 2)),
        TableColumn("What was found", text=True, of=lambda f: f.message),
        TableColumn("What was done", text=True, of=lambda f: f.action),
    ]
    rest = len(quality[content.row_limit(MAX_FINDINGS) or len(quality) :])
    more = [(f"… {rest} more", *[""] * 6)] if rest else []
    return content.make_table(
        "findings",
        "Findings: what is wrong with the log, and what was done about it.",
        columns,
        [*content.rows_of(columns, quality[: content.row_limit(MAX_FINDINGS)]), *more],
        note=f"Times are{_since(zero).lstrip(',')}." if zero else "",
    )


_METRIC: tuple[TableColumn[str], ...] = (
    TableColumn("Metric", text=True, of=SYMBOL.__getitem__),
    TableColumn(content.ROW_UNIT, text=True, of=unit_of),
)


def repeatability_table(reduction: Reduction, found: Uncertainty) -> content.Table | None:
    """Scatter of the complete cycles: largest deviation, which cycle has it, and s/sqrt(N); None for fewer than two."""
    mean, scatter = reduction.mean, found.budget.repeatability
    values = {m: {c.cycle: x for c in reduction.complete if (x := c.metrics[m]) is not None} for m in mean}
    return content.ItemTable[str](
        "repeatability",
        f"Repeatability of {len(reduction.complete)} complete cycles.",
        [
            *_METRIC,
            TableColumn("Mean", of=partial(mean_text, reduction, found)),
            TableColumn("Minimum", of=lambda m: stated(min(values[m].values()), scatter[m], decimals_of(m))),
            TableColumn("Maximum", of=lambda m: stated(max(values[m].values()), scatter[m], decimals_of(m))),
            TableColumn("Largest deviation", "%", 2, of=reduction.max_deviation_percent.get),
            TableColumn("in cycle", text=True, of=lambda m: _farthest(values[m], mean.value(m))),
            TableColumn("s", of=lambda m: uncertain(scatter.value(m) * math.sqrt(len(values[m])))),
            TableColumn("s/√N", of=lambda m: uncertain(scatter[m])),
        ],
        note="The largest deviation of a cycle from the mean, in percent of the mean. s: standard deviation of a cycle; "
        "s/√N: of the mean of the N cycles; of net energies, of those that are whole.",
    ).of([m for m in mean if scatter[m] is not None and len(values[m]) > 1])


def _farthest(values: Mapping[int, float], mean: float) -> str:
    """Cycles whose value deviates most from the mean: two cycles deviate alike."""
    deviation = {k: abs(value - mean) for k, value in values.items()}
    maximum = max(deviation.values()) * (1.0 - 1e-9)
    return ", ".join(str(k) for k, deviates in deviation.items() if deviates >= maximum)


def uncertainty_table(reduction: Reduction, found: Uncertainty) -> content.Table | None:
    """Uncertainty of each mean: of the sensors, of the repeatability, together, and the 95 % interval; None without any."""
    mean, u, known, alone = reduction.mean, found.standard, found.budget, found.interval_95_sensors
    sensors, scatter, freedom = known.sensors, known.repeatability, known.freedom
    return content.ItemTable[str](
        "uncertainty",
        "Standard uncertainty u of the means and 95 % intervals.",
        [
            *_METRIC,
            TableColumn("Mean", of=lambda m: stated(mean[m], u[m], decimals_of(m))),
            TableColumn("u, sensors", of=lambda m: uncertain(sensors[m])),
            TableColumn("u, cycles", of=lambda m: uncertain(scatter[m])),
            TableColumn("u", of=lambda m: uncertain(u[m])),
            TableColumn("ν", of=lambda m: _freedom_text(freedom[m])),
            TableColumn("95 % interval", of=lambda m: _span(found.interval_95.get(m), u[m])),
            TableColumn("these cycles alone", of=lambda m: _span(alone.get(m), sensors[m])),
        ],
        note=_how_stated(reduction, found),
    ).of([m for m in mean if mean[m] is not None and found.method])


def _freedom_text(freedom: float | None) -> str:
    """Effective degrees of freedom, infinite from where they make no difference."""
    return "∞" if freedom is not None and freedom > 1000 else number(freedom, 0 if (freedom or 0.0) >= 10 else 1)


def _span(ends: Interval | None, u: float | None) -> str:
    return interval_text(ends.low, ends.high, u) if ends is not None and u else "–"


def unknown_words(found: Uncertainty) -> str:
    """Why no uncertainty is stated; nothing where one is."""
    if found.method:
        return ""
    known = "Only the repeatability is known" if found.budget.repeatability else "No uncertainty is known"
    return f"{known}; {'; '.join(not_known(found.budget)) or 'no metric is known'}."


def interval_type(reduction: Reduction) -> str:
    """What a 95 % interval of a mean is: its coverage, its distributions and their degrees of freedom."""
    n = len(reduction.complete)
    scatter = f"the scatter of the {n} cycles by Student's t with {n - 1} degree{'s' * (n > 2)} of freedom"
    sensors = "errors of the sensors by their own distributions"
    return f"Intervals: coverage 95 %, equal tails; {f'{scatter}, {sensors}' if n > 1 else sensors}."


def _how_stated(reduction: Reduction, found: Uncertainty) -> str:
    """Where the stated uncertainties come from."""
    by_draws = ", ".join(SYMBOL[m] for m, way in found.method.items() if way == "monte_carlo")
    which = f"of {by_draws} the Monte Carlo's u is stated, as the errors do not act linearly"
    return (
        f"{interval_type(reduction)} Monte Carlo of {found.draws} draws, seed {found.seed}: "
        f"{which if by_draws else 'the Monte Carlo confirms the budget of every metric'}. ν: effective degrees of freedom of u "
        "(Welch and Satterthwaite). "
        "'These cycles alone' leaves the repeatability out: it is what the sensors leave open of the very cycles of this log."
    )


def budgeted(mean: Metrics) -> list[str]:
    """Metrics whose budget is shown: efficiencies, then energies of the window."""
    etas = [m for m in mean if m.startswith("eta")]
    return [*etas, *(m for m in mean if m.startswith("energy") and m not in NET_METRICS)]


def budget_table(found: Uncertainty, rig: Rig) -> content.Table | None:
    """Which error contributes which share of the variance of each mean; None where no accuracy is known."""
    known, channels = found.budget, rig.known_channels
    metrics = [m for m in budgeted(known.mean) if known.mean[m]]
    rows = [(_about(r, channels), shares(r.of, known.mean)) for r in known.rows]
    scatter = shares(known.repeatability, known.mean)
    cells = [(*about, *(percent(share[m] or None) for m in metrics)) for about, share in rows]
    cells.append(("repeatability", "", "normal", "", "", "cycles", *(percent(scatter[m]) for m in metrics)))
    columns: list[TableColumn[str]] = [
        *(TableColumn(name, text=True) for name in ("Source", "Limit", "Distribution", "u", "Known by", "From")),
        *(TableColumn(SYMBOL[m], "%") for m in metrics),
    ]
    return content.formatted_table(
        "budget",
        "Uncertainty budget: share of the variance of each mean, in percent.",
        columns,
        cells if metrics else (),
        "Errors of a sensor are the same over the whole log, so they do not average out over its cycles. Zero and gain are "
        "those of a calibration in place where the rig file states it (u_zero, u_gain), else those of the accuracy. "
        "A limit in shares of the full scale is a zero error. "
        f"u: standard uncertainty of the error.{_from(rig.source)}",
    )


def _from(source: str) -> str:
    """What the words of a rig file about its sources refer to."""
    return f" From: the rig file's words; its source is {source}." if source else ""


def _about(row: BudgetRow, channels: Mapping[str, Channel]) -> tuple[str, str, str, str, str, str]:
    source = row.source
    if source is None:
        return source_name(None), "", "rectangular", "", "", "data beside the gaps"
    factor, unit = 100.0, "%"
    if source.part != "gain" and source.channel != R_DRUM:
        factor, unit = 1.0, si_unit(channels[source.channel].dimension).replace(".", "·")
    limit = "" if source.limit is None else f"{significant(source.limit * factor)} {unit}"
    u, basis = f"{significant(source.u * factor)} {unit}", source.basis.replace("_", " ")
    return source_name(source), limit, source.shape, u, basis, source.origin or "–"


def sensors_table(reduction: Reduction) -> content.Table | None:
    """Sensors of the channels of the log, as the rig file states them."""
    return content.ItemTable[tuple[str, Sensor]](
        "sensors",
        "Sensors, as the rig file states them; accuracies are limits, used where no calibration in place is stated.",
        [
            TableColumn("Channel", text=True, of=lambda item: item[0]),
            TableColumn("Instrument", text=True, of=lambda item: item[1].instrument or "–"),
            TableColumn("Range", text=True, of=lambda item: _range(item[1])),
            TableColumn("Accuracy", text=True, of=lambda item: _accuracy(item[1])),
            TableColumn("From", text=True, of=lambda item: item[1].source or "–"),
        ],
        note=_from(reduction.rig.source).strip(),
    ).of([(name, sensor) for name, sensor in reduction.rig.sensors.items() if name in reduction.run.channels])


def _in_unit(value: float, sensor: Sensor, *, zero: bool = False) -> str:
    """A number of a sensor, in the unit that the rig file gives it; `zero`: one that counts from the zero of the unit."""
    unit = find_unit(sensor.unit) or Unit("number", 1.0)
    return _given_number((value - (unit.offset if zero else 0.0)) / unit.factor)


def _given_number(value: float) -> str:
    return f"{value:.6g}".replace("-", MINUS)


def _range(sensor: Sensor) -> str:
    if sensor.high is None:
        return "–"
    low, high = (_in_unit(end, sensor, zero=True) for end in (sensor.low or 0.0, sensor.high))
    return f"{low} to {high} {sensor.unit}"


def _accuracy(sensor: Sensor) -> str:
    own = "" if sensor.accuracy is None else f"{_in_unit(sensor.accuracy, sensor)} {sensor.unit}"
    stated = _sum_text(sensor.accuracy_full_scale, sensor.accuracy_reading, own, sensor.coverage)
    acquired = _sum_text(sensor.daq_full_scale, sensor.daq_reading, "", sensor.daq_coverage)
    zero = "" if sensor.u_zero is None else f"zero {_in_unit(sensor.u_zero, sensor)} {sensor.unit}"
    gain = "" if sensor.u_gain is None else f"gain {_given_number(100.0 * sensor.u_gain)} %"
    in_place = ", ".join(filter(None, (zero, gain)))
    return (
        (stated or "not stated")
        + (f"; acquisition {acquired}" if acquired else "")
        + (f"; calibrated in place, u: {in_place}" if in_place else "")
    )


def _sum_text(full_scale: float | None, reading: float | None, absolute: str, coverage: float | None) -> str:
    """A stated accuracy as the sum of its parts, "" without any; with its coverage factor if it is an expanded uncertainty."""
    parts = [
        "" if full_scale is None else f"{_given_number(100.0 * full_scale)} % of full scale",
        "" if reading is None else f"{_given_number(100.0 * reading)} % of the reading",
        absolute,
    ]
    text = " and ".join(part for part in parts if part)
    return text if coverage is None or not text else f"{text} (expanded, k = {coverage:g})"
