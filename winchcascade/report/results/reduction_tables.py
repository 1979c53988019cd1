"""Tables of the reduction of a log: cycles, phases, bins of generator speed, uncertainty, sensors and findings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from msgspec.structs import replace

from winchcascade.core.quantity import Unit, find_unit, si_unit
from winchcascade.core.rig_file import Rig, Sensor
from winchcascade.core.run import Finding
from winchcascade.reduction.bins import STORES, Bin
from winchcascade.reduction.efficiency import Metrics
from winchcascade.reduction.montecarlo import Uncertainty
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.uncertainty import R_DRUM, BudgetRow, budgeted, shares
from winchcascade.report.content import Cell, Column, Measured, Span, Table, number_text, shown, table
from winchcascade.report.glossary import metric, short
from winchcascade.report.wording import clock_zero, label, of_phase, source_name, span_word

LISTED_CYCLES = 14
"""Cycles that a table lists, with which a page has room on four screens; of more the first and the last half of that."""

LISTED_BINS = 80
"""Bins of generator speed that a table lists, in the same way."""


class CycleRow(NamedTuple):
    """A cycle, and the standard uncertainties of its metrics by the sensors."""

    of: CycleResult
    u: Metrics


CYCLE: Column[CycleRow] = Column("cycle", lambda row: label(row.of))


def decimals_of(reduction: Reduction, names: Sequence[str]) -> int:
    """Decimals of metrics of one kind whose uncertainty is unknown: three digits of the largest of all cycles, of large ones
    four.
    """
    if names[0].startswith("eta"):
        return 3
    values = [c.metrics[name] for c in reduction.cycles for name in names]
    largest = max((abs(x) for x in values if x is not None and math.isfinite(x)), default=0.0)
    digits = math.floor(math.log10(largest)) if largest > 0.0 else 2
    return min(3 - digits, 0) if digits >= 2 else min(2 - digits, 9)


def mean_cell(reduction: Reduction, found: Uncertainty, name: str) -> Measured:
    """Mean of a metric, with its uncertainty, or of the repeatability alone where no accuracy is known."""
    return Measured(reduction.mean[name], found.standard[name] or found.budget.repeatability[name])


def _rows(reduction: Reduction, found: Uncertainty) -> list[CycleRow]:
    return [CycleRow(c, u) for c, u in zip(reduction.cycles, found.budget.cycles, strict=True)]


def _metric_columns(reduction: Reduction, names: Sequence[str]) -> list[Column[CycleRow]]:
    """Columns of those metrics that any cycle has, with the digits that their uncertainty allows."""
    given = [name for name in names if any(c.metrics[name] is not None for c in reduction.cycles)]

    def column(name: str) -> Column[CycleRow]:
        alike = [other for other in given if other.partition("_")[0] == name.partition("_")[0]]
        decimals = decimals_of(reduction, alike)
        return Column(short(name), lambda row: Measured(row.of.metrics[name], row.u[name]), metric(name).unit, decimals)

    return [column(name) for name in given]


def _summary(
    reduction: Reduction, found: Uncertainty, columns: Sequence[Column[CycleRow]], names: Sequence[str]
) -> list[list[Cell]]:
    """Rows below those of the cycles: mean, maximum deviation and standard uncertainty, or all cycles together."""
    repeats, of = reduction.rig.phases.repeats, {short(name): name for name in names}
    counts = [
        sum(c.metrics[name] is not None for c in reduction.complete) for name in names if name not in ("eta_net",)
    ]
    n = max(counts, default=0)
    deviation, standard, total = reduction.max_deviation_percent, found.standard, reduction.total
    apart = n > 1 and (not repeats or reduction.window in ("payout", "whole"))  # windows that differ in length
    rows: tuple[tuple[str, bool, Callable[[str], Cell]], ...] = (
        (f"mean of {n}", n > 0 and repeats, partial(mean_cell, reduction, found)),
        ("max. deviation, %", n > 1 and repeats, lambda m: None if (x := deviation[m]) is None else number_text(x, 2)),
        ("std. uncertainty", n > 0 and repeats, lambda m: Measured(standard[m], standard[m])),
        ("all together", apart, lambda m: Measured(total[m])),
    )
    cells = [
        [name, *(cell(of[column.name]) if column.name in of else "" for column in columns[1:])]
        for name, wanted, cell in rows
        if wanted
    ]
    return [row for row in cells if any(shown(cell) not in ("", "-") for cell in row[1:])]


def _cycles(
    name: str, caption: str, reduction: Reduction, found: Uncertainty, names: Sequence[str], *more: Column[CycleRow]
) -> Table[CycleRow]:
    """A table with a row for each cycle, some columns, metrics, and the rows that summarise them."""
    columns = [CYCLE, *more, *_metric_columns(reduction, names)]
    below = _summary(reduction, found, columns, names)
    return Table(name, caption, columns, _rows(reduction, found), below, limit=LISTED_CYCLES)


def cycles_table(reduction: Reduction, found: Uncertainty) -> Table[CycleRow]:
    """Energies and efficiencies of every cycle over its window, and their means."""
    cascade = reduction.rig.cascade
    some = "" if len(reduction.complete) == len(reduction.cycles) else "; in brackets: incomplete, not in the mean"
    where = [f"{s.name}: {s.where}" for s in cascade.stages if s.where and cascade.configured]
    made = _cycles(
        "cycles", f"Cycles: energies over the integration window, and efficiencies{some}.", reduction, found,
        (*cascade.energies, *cascade.ratios),
        Column("window", lambda row: row.of.window.cutoff - row.of.window.onset, "s", 2),
    )  # fmt: skip
    return replace(made, note=f"Stages: {'; '.join(where)}." if where else "")


def net_table(reduction: Reduction, found: Uncertainty) -> Table[CycleRow] | None:
    """Energies of every whole cycle, from onset to next onset; None where no cycle has any."""
    names = reduction.rig.cascade.net_metrics
    if all(c.metrics[name] is None for c in reduction.cycles for name in names):
        return None
    return _cycles(
        "net", "Whole cycles: line energy of the payout, returned in haul-in, and net from onset to next onset.",
        reduction, found, names,
        Column("onset to onset", lambda row: row.of.net.end - row.of.net.begin, "s", 2, brief=False),
    )  # fmt: skip


def directions_table(reduction: Reduction) -> Table[tuple[str, tuple[float, float]]] | None:
    """Stages whose power changes its direction: what flows with the cascade and against it."""
    cascade = reduction.rig.cascade
    decimals = decimals_of(reduction, cascade.energies)
    columns: list[Column[tuple[str, tuple[float, float]]]] = [
        Column("stage", lambda row: row[0]),
        Column("with the cascade", lambda row: row[1][0], "J", decimals),
        Column("against it", lambda row: row[1][1], "J", decimals),
    ]
    both = [row for row in reduction.both_ways.items() if min(row[1][0], -row[1][1]) >= 0.5 * 10.0**-decimals]
    return table("directions", "Energies in both directions, all complete cycles together.", columns, both)


def _phase(name: str, phase: str, field: str, unit: str, decimals: int, factor: float = 1.0) -> Column[CycleRow]:
    """Column of one number of the summary of a phase."""

    def cell(row: CycleRow) -> float | None:
        value = of_phase(phase, field, row.of)
        return None if value is None else factor * value

    return Column(name, cell, unit, decimals)


PHASES = (
    _phase("hold", "hold", "duration", "s", 2),
    _phase("haul-in", "haul_in", "duration", "s", 2),
    _phase("travel", "payout", "travel", "m", 2),
    _phase("speed", "point", "rpm_shaft", "rpm", 1),
    _phase("torque", "point", "torque", "N.m", 3),
    _phase("plateau", "plateau", "speed", "m/s", 3),
)
"""Phases of a cycle, after its payout: durations, travel, operating point, and speed of the plateau."""

MEANS = (
    _phase("v_max", "payout", "speed_max", "m/s", 2),
    _phase("F", "plateau", "force", "N", 0),
    _phase("τ", "plateau", "torque", "N.m", 1),
    *(_phase(f"P_{s} plateau", "plateau", f"power_{s}", "W", 0) for s in ("line", "mech", "gen")),
    _phase("F_hold", "hold", "force", "N", 0),
    _phase("τ_hold", "hold", "torque", "N.m", 1),
    _phase("p_hold", "hold", "pressure", "kg/cm2", 2),
    _phase("v haul-in", "haul_in", "speed_max", "m/s", 2),
    _phase("F_mean", "haul_in", "force", "N", 0),
    _phase("F_min", "haul_in", "force_min", "N", 0),
    _phase("E_line haul-in", "haul_in", "energy_line", "J", 0),
)
"""Time means over plateau and hold, then numbers of the haul-in."""


def phases_table(reduction: Reduction, found: Uncertainty) -> Table[CycleRow]:
    """Instants and durations of the phases of every cycle, and its mean powers in the window."""
    zero, word = clock_zero(reduction.run), span_word(reduction)
    since = f"; onset since {zero:.2f} s on the log's clock" if zero else ""
    made = _cycles(
        "phases", f"Phases, and mean powers in the integration window{since}.", reduction, found,
        [name for name in reduction.rig.cascade.metrics if name.startswith("power")],
        Column("onset", lambda row: row.of.phases.onset - zero, "s", 2),
        _phase("payout" if word == "payout" else "length", "payout", "duration", "s", 2), *PHASES,
    )  # fmt: skip
    return replace(made, below=made.below[:1])


def phase_means_table(reduction: Reduction, found: Uncertainty) -> Table[CycleRow]:
    """Time means of the phases of every cycle."""
    columns = [CYCLE, *MEANS]
    caption = (
        "Time means over plateau, hold (τ_hold, F_hold, p_hold) and haul-in, whose energy is returned to the line."
    )
    return Table("phase-means", caption, columns, _rows(reduction, found), brief=False, limit=LISTED_CYCLES)


def bins_table(reduction: Reduction) -> Table[Bin] | None:
    """Mean powers in bins of generator speed, and what is stored while the speed changes; None where it is unknown."""
    stages = [s for s in reduction.rig.cascade.names if any(b.power.get(s) is not None for b in reduction.bins)]
    stores = [store for store in STORES if any(b.stored.get(store) is not None for b in reduction.bins)]
    columns: list[Column[Bin]] = [
        Column("generator speed", lambda b: Span(b.rpm_low, b.rpm_high), "rpm", 0),
        Column("samples", lambda b: b.count, decimals=0),
        *(Column(short(f"power_{stage}"), partial(_binned, stage), "W", 0) for stage in stages),
        *(Column(f"into {store}", partial(_stored, store), "W", 0) for store in stores),
    ]
    missing = " and ".join(
        what for store, what in (("rotor", "inertia_rotor"), ("capacitor", "c_dc")) if store not in stores
    )
    stored = "P_mech - P_gen less what goes into rotor, spring and capacitor is lost."
    if missing:
        stored = f"Without {missing} in the rig file, or its channel in the log, differences contain stored energy."
    caption = f"Mean powers of the {span_word(reduction)}s by generator speed +- standard error of independent samples."
    return (
        Table("bins", caption, columns, reduction.bins, note=stored, brief=False, limit=LISTED_BINS) if stages else None
    )


def _binned(stage: str, of: Bin) -> Measured:
    return Measured(of.power.get(stage), of.standard_error.get(stage), both=True)


def _stored(store: str, of: Bin) -> float | None:
    return of.stored.get(store)


# --------------------------------------------------------------------------------------------------------- uncertainty
def uncertainty_table(reduction: Reduction, found: Uncertainty) -> Table[str] | None:
    """Scatter of the complete cycles, uncertainty and 95 % interval of each mean; None where neither is known."""
    known, mean = found.budget, reduction.mean
    values = {m: {c.cycle: x for c in reduction.complete if (x := c.metrics[m]) is not None} for m in mean}
    given = [m for m, of in values.items() if mean[m] is not None and (len(of) > 1 or m in found.method)]

    def scattered(m: str, value: float) -> Measured:
        return Measured(value, known.repeatability[m])

    def ends(m: str, *, alone: bool) -> Span | None:
        interval = (found.interval_95_sensors if alone else found.interval_95).get(m)
        u = known.sensors[m] if alone else found.standard[m]
        return None if interval is None or not u else Span(interval.low, interval.high, u)

    columns: list[Column[str]] = [
        Column("metric", short),
        Column("unit", lambda m: metric(m).unit),
        Column("mean", lambda m: mean_cell(reduction, found, m), own_digits=True),
        Column("95 % interval", lambda m: ends(m, alone=False), own_digits=True),
        Column("u", lambda m: Measured(found.standard[m], found.standard[m]), own_digits=True),
        Column("u, sensors", lambda m: Measured(known.sensors[m], known.sensors[m]), own_digits=True),
        Column("u, cycles", lambda m: scattered(m, known.repeatability[m] or math.nan), own_digits=True),
        Column("ν", lambda m: math.inf if (known.freedom[m] or 0.0) > 1000.0 else known.freedom[m], decimals=1),
        Column("these cycles alone", lambda m: ends(m, alone=True), own_digits=True),
        Column("minimum", lambda m: scattered(m, min(values[m].values())), own_digits=True),
        Column("maximum", lambda m: scattered(m, max(values[m].values())), own_digits=True),
        Column("farthest cycle", lambda m: _farthest(values[m], mean.value(m)) if len(values[m]) > 1 else None),
    ]
    drawn = ", ".join(m for m, way in found.method.items() if way == "monte_carlo")
    note = (
        "Scatter of the cycles by Student's t, errors of the sensors by their own distributions; "
        f"Monte Carlo of {found.draws} draws, seed {found.seed}"
        f"{f', whose u is stated of {drawn}' if drawn else ', which confirms the budget'}. ν: effective degrees of freedom. "
        "These cycles alone: without their scatter."
    ) if found.method else ""  # fmt: skip
    caption = f"Means of {len(reduction.complete)} complete cycles, their standard uncertainty u and their scatter."
    return table("uncertainty", caption, columns, given, note=note, brief=False)


def _farthest(values: dict[int, float], mean: float) -> str:
    """Cycles whose value deviates most from the mean: two cycles deviate alike."""
    deviation = {k: abs(value - mean) for k, value in values.items()}
    maximum = max(deviation.values()) * (1.0 - 1e-9)
    return ", ".join(str(k) for k, deviates in deviation.items() if deviates >= maximum)


Share = BudgetRow | None
"""A row of the budget; None for the repeatability."""


def budget_table(reduction: Reduction, found: Uncertainty) -> Table[Share] | None:
    """Which error contributes which share of the variance of each mean; None where no accuracy is known."""
    known, rig = found.budget, reduction.rig
    metrics = [m for m in budgeted(known.mean) if known.mean[m]]

    def share(m: str, row: Share) -> float | None:
        part = shares(known.repeatability if row is None else row.of, known.mean)[m]
        return 100.0 * part if part else None

    def text(attribute: str, row: Share, otherwise: str) -> str:
        found = None if row is None or row.source is None else getattr(row.source, attribute)
        return otherwise if found is None else str(found).replace("_", " ")

    columns: list[Column[Share]] = [
        Column("source", lambda row: "repeatability" if row is None else source_name(row.source)),
        Column("limit", lambda row: _error(row, rig, "limit")),
        Column("distribution", lambda row: text("shape", row, "normal" if row is None else "rectangular")),
        Column("u", lambda row: _error(row, rig, "u")),
        Column("known by", lambda row: text("basis", row, "")),
        Column("from", lambda row: text("origin", row, "cycles" if row is None else "data beside the gaps")),
        *(Column(short(m), partial(share, m), "%", 0) for m in metrics),
    ]
    caption = "Uncertainty budget: share of the variance of each mean."
    note = "Errors of a sensor are the same over the whole log: they do not average out over its cycles."
    source = f" Source of the rig file: {rig.source}." if rig.source else ""
    return table("budget", caption, columns, [*known.rows, None] if metrics else (), note=note + source, brief=False)


def _error(row: Share, rig: Rig, attribute: str) -> str | None:
    """A limit or a standard uncertainty of an error source, in percent or the unit of its channel."""
    source = None if row is None else row.source
    value = None if source is None else getattr(source, attribute)
    if source is None or value is None:
        return None
    if source.part == "gain" or source.channel == R_DRUM:
        return f"{shown(100.0 * value)} %"
    return f"{shown(value)} {si_unit(rig.known_channels[source.channel].dimension)}"


def sensors_table(reduction: Reduction) -> Table[tuple[str, Sensor]] | None:
    """Sensors of the channels of the log, as the rig file states them."""
    columns: list[Column[tuple[str, Sensor]]] = [
        Column("channel", lambda item: item[0]),
        Column("instrument", lambda item: item[1].instrument),
        Column("range", lambda item: _range(item[1])),
        Column("accuracy", lambda item: _accuracy(item[1])),
        Column("calibrated in place, u", lambda item: _in_place(item[1])),
        Column("from", lambda item: item[1].source),
    ]
    given = [(name, sensor) for name, sensor in reduction.rig.sensors.items() if name in reduction.run.channels]
    caption = (
        "Sensors, as the rig file states them; accuracies are limits, used where no calibration in place is stated."
    )
    return table("sensors", caption, columns, given, brief=False)


def _in_unit(value: float, sensor: Sensor, *, zero: bool = False) -> str:
    """A number of a sensor, in the unit that the rig file gives it; `zero`: one that counts from the zero of the unit."""
    unit = find_unit(sensor.unit) or Unit("number", 1.0)
    return f"{(value - (unit.offset if zero else 0.0)) / unit.factor:.6g}"


def _range(sensor: Sensor) -> str | None:
    if sensor.high is None:
        return None
    low, high = (_in_unit(end, sensor, zero=True) for end in (sensor.low or 0.0, sensor.high))
    return f"{low} to {high} {sensor.unit}"


def _accuracy(sensor: Sensor) -> str:
    """A stated accuracy and that of the acquisition, each as the sum of its parts; k: an expanded uncertainty."""
    own = None if sensor.accuracy is None else f"{_in_unit(sensor.accuracy, sensor)} {sensor.unit}"
    texts = []
    for head, scale, reading, absolute, coverage in (
        ("", sensor.accuracy_full_scale, sensor.accuracy_reading, own, sensor.coverage),
        ("acquisition ", sensor.daq_full_scale, sensor.daq_reading, None, sensor.daq_coverage),
    ):
        parts = [
            f"{100.0 * x:.6g} % of {of}" for x, of in ((scale, "full scale"), (reading, "the reading")) if x is not None
        ]
        parts += [] if absolute is None else [absolute]
        k = "" if coverage is None else f" (expanded, k = {coverage:g})"
        texts += [f"{head}{' and '.join(parts)}{k}"] if parts else []
    return "; ".join(texts) or "not stated"


def _in_place(sensor: Sensor) -> str:
    zero = "" if sensor.u_zero is None else f"zero {_in_unit(sensor.u_zero, sensor)} {sensor.unit}"
    gain = "" if sensor.u_gain is None else f"gain {100.0 * sensor.u_gain:.6g} %"
    return ", ".join(filter(None, (zero, gain)))


def findings_table(reduction: Reduction) -> Table[Finding] | None:
    """What was found wrong with the log and what was done; None for a clean log."""
    samples, zero = reduction.run.samples, clock_zero(reduction.run)
    columns: list[Column[Finding]] = [
        Column("finding", lambda f: f.kind),
        Column("channel", lambda f: f.channel, brief=False),
        Column("when", lambda f: None if f.start is None else Span(f.start - zero, (f.end or f.start) - zero), "s", 2),
        Column("data lost", lambda f: 100.0 * share if (share := f.lost_share(samples)) else None, "%", 2, brief=False),
        Column("what was found", lambda f: f.message),
        Column("what was done", lambda f: f.action),
    ]
    since = f" Times count from {zero:.2f} s on the log's clock." if zero else ""
    return table("findings", "What is wrong with the log, and what was done.", columns, reduction.quality, note=since)
