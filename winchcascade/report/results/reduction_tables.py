"""Tables of the reduction of a log: cycles, phases, bins of generator speed, uncertainty and
findings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from operator import attrgetter

from msgspec.structs import replace

from winchcascade.core.quantity import si_unit
from winchcascade.core.run import Finding, Run
from winchcascade.reduction.bins import STORES, Bin
from winchcascade.reduction.efficiency import NET_METRICS
from winchcascade.reduction.error_model import R_DRUM
from winchcascade.reduction.phase_summary import BothWays
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.uncertainty import BudgetRow, Uncertainty, shares
from winchcascade.report.content import (
    Cell,
    Column,
    Measured,
    Span,
    Table,
    known,
    number_text,
    places,
    shown,
    table,
)
from winchcascade.report.glossary import metric, short
from winchcascade.report.wording import clock_zero, label, source_name, span_word

LISTED_CYCLES = 14
"""Cycles that a table lists, with which a page has room on four screens; of more the first and
the last half of that.
"""

SHOWN_SHARE = 5e-4
"""An energy against the cascade below this share of that with it is rounding of the sensors. [1]"""

LISTED_BINS = 80
"""Bins of generator speed that a table lists, in the same way."""

CYCLE: Column[CycleResult] = Column("cycle", label)


# ----------------------------------------------------------------------------------------- cycles
def mean_decimals(found: Uncertainty, name: str) -> int | None:
    """Decimals of the mean of a metric, and so of its cycles: those of its standard uncertainty,
    else those of its kind.
    """
    u = found.standard[name]
    return places(u) if known(u) else metric(name).decimals


def _cycles(
    name: str,
    caption: str,
    reduction: Reduction,
    found: Uncertainty,
    names: Sequence[str],
    *more: Column[CycleResult],
) -> Table[CycleResult]:
    """A table with a row for each cycle, some columns, the metrics that any cycle has, and the
    rows that summarise them.
    """
    of = {short(m): m for m in names if any(c.metrics[m] is not None for c in reduction.cycles)}
    columns = [
        CYCLE,
        *more,
        *(
            Column(
                head,
                partial(_metric, m),
                metric(m).unit,
                mean_decimals(found, m),
                brief=not m.startswith("power"),
            )
            for head, m in of.items()
        ),
    ]
    n = max(
        (sum(c.metrics[m] is not None for c in reduction.complete) for m in of.values()), default=0
    )
    repeats, deviation = reduction.rig.phases.repeats, reduction.max_deviation_percent
    apart = n > 1 and (
        not repeats or reduction.window in ("payout", "whole")
    )  # windows that differ in length
    rows: list[list[Cell]] = [
        [head, *("" if (m := of.get(column.name)) is None else cell[m] for column in columns[1:])]
        for head, wanted, cell in (
            (f"mean of {n}", n > 0 and repeats, reduction.mean),
            (
                "max. deviation, %",
                n > 1 and repeats,
                {m: number_text(deviation[m], 2) for m in of.values()},
            ),
            (
                "std. uncertainty",
                n > 0 and repeats,
                {m: Measured(found.standard[m], found.standard[m]) for m in of.values()},
            ),
            ("all together", apart, reduction.total),
        )
        if wanted
    ]
    below = [row for row in rows if any(shown(cell) not in ("", "-") for cell in row[1:])]
    return Table(name, caption, columns, reduction.cycles, below, limit=LISTED_CYCLES)


def _metric(name: str, cycle: CycleResult) -> float | None:
    return cycle.metrics[name]


def cycles_table(reduction: Reduction, found: Uncertainty) -> Table[CycleResult]:
    """Energies, efficiencies and mean powers of every cycle over its window, and their means."""
    cascade = reduction.rig.cascade
    some = (
        ""
        if len(reduction.complete) == len(reduction.cycles)
        else "; in brackets: incomplete, not in the mean"
    )
    where = [f"{s.name}: {s.where}" for s in cascade.stages if s.where and cascade.configured]
    made = _cycles(
        "cycles", f"Cycles over the integration window{some}.", reduction, found,
        (*cascade.energies, *cascade.ratios, *(name for name in cascade.metrics if name.startswith("power"))),
        Column("window", lambda c: c.window.cutoff - c.window.onset, "s", 2),
    )  # fmt: skip
    return replace(made, note=f"Stages: {'; '.join(where)}." if where else "")


def net_table(reduction: Reduction, found: Uncertainty) -> Table[CycleResult] | None:
    """Energies of every whole cycle, from onset to next onset; None where no cycle has any."""
    names = reduction.rig.cascade.net_metrics
    if all(c.metrics[name] is None for c in reduction.cycles for name in names):
        return None
    return _cycles(
        "net", "Whole cycles: line energy of the payout, returned in haul-in, and net from onset "
               "to next onset.",
        reduction, found, names,
        Column("onset to onset", lambda c: c.net.end - c.net.begin, "s", 2, brief=False),
    )  # fmt: skip


def directions_table(reduction: Reduction) -> Table[tuple[str, BothWays]]:
    """Stages whose power changes its direction: what flows with the cascade and against it."""
    columns: list[Column[tuple[str, BothWays]]] = [
        Column("stage", lambda row: row[0]),
        Column("with the cascade", lambda row: row[1].positive, "J"),
        Column("against it", lambda row: row[1].negative, "J"),
    ]
    both = [
        row
        for row in reduction.both_ways.items()
        if min(row[1].positive, -row[1].negative)
        >= SHOWN_SHARE * max(row[1].positive, -row[1].negative)
    ]
    return table(
        "directions", "Energies in both directions, all complete cycles together.", columns, both
    )


# ----------------------------------------------------------------------------------------- phases
def _phase(name: str, place: str, field: str, unit: str, decimals: int) -> Column[CycleResult]:
    """Column of a number of a phase, by the `place` of the phase in the summary of a cycle; None
    where the log lacks it.
    """
    summary_of = attrgetter(f"summary.{place}")
    return Column(name, lambda cycle: getattr(summary_of(cycle), field, None), unit, decimals)


PHASE_COLUMNS = (
    _phase("hold", "hold", "duration", "s", 2),
    _phase("haul-in", "haul_in", "duration", "s", 2),
    _phase("travel", "payout", "travel", "m", 2),
    _phase("speed", "point", "rpm_shaft", "rpm", 1),
    _phase("torque", "point", "torque", "N.m", 3),
    _phase("plateau", "payout.plateau", "speed", "m/s", 3),
)
"""Phases of a cycle, after its payout: durations, travel, operating point, and speed of the
plateau.
"""


def phases_table(reduction: Reduction) -> Table[CycleResult]:
    """Instants and durations of the phases of every cycle; the JSON has their means too."""
    zero, word = clock_zero(reduction.run), span_word(reduction)
    since = f"; onset since {zero:.2f} s on the log's clock" if zero else ""
    spans = [
        CYCLE,
        Column("onset", lambda c: c.phases.onset - zero, "s", 2),
        _phase("payout" if word == "payout" else "length", "payout", "duration", "s", 2),
        *PHASE_COLUMNS,
    ]
    return Table("phases", f"Phases{since}.", spans, reduction.cycles, limit=LISTED_CYCLES)


def bins_table(reduction: Reduction) -> Table[Bin]:
    """Mean powers in bins of generator speed, and what is stored while the speed changes; empty
    where no stage has any.
    """
    stages = [
        s
        for s in reduction.rig.cascade.names
        if any(b.mean.get(s) is not None for b in reduction.bins)
    ]
    stores = [
        store for store in STORES if any(b.mean.get(store) is not None for b in reduction.bins)
    ]
    columns: list[Column[Bin]] = [
        Column("generator speed", lambda b: Span(b.rpm_low, b.rpm_high), "rpm", 0),
        Column("samples", lambda b: b.count, decimals=0),
        *(Column(short(f"power_{stage}"), partial(_binned, stage), "W", 0) for stage in stages),
        *(Column(f"into {store}", partial(_stored, store), "W", 0) for store in stores),
    ]
    given = {"inertia_rotor": "rotor" in stores, "c_dc": "capacitor" in stores}
    missing = " and ".join(name for name, known in given.items() if not known)
    stored = "P_mech - P_gen less what goes into rotor, spring and capacitor is lost."
    if missing:
        stored = f"Without {missing} in the rig file, or its channel in the log, differences contain stored energy."
    caption = f"Mean powers of the {span_word(reduction)}s by generator speed +- standard error of independent samples."
    bins = reduction.bins if stages else ()
    return Table("bins", caption, columns, bins, note=stored, brief=False, limit=LISTED_BINS)


def _binned(stage: str, of: Bin) -> Measured:
    return Measured(of.mean.get(stage), of.standard_error.get(stage), both=True)


def _stored(store: str, of: Bin) -> float | None:
    return of.mean.get(store)


# ------------------------------------------------------------------------------------ uncertainty
def uncertainty_table(reduction: Reduction, found: Uncertainty) -> Table[str]:
    """What the uncertainty of each mean is made of, and its 95 % intervals; empty where neither
    is known.
    """
    known, mean = found.budget, reduction.mean
    given = [m for m in mean if mean[m] is not None and (known.repeatability[m] or m in known.mean)]

    def ends(m: str, *, alone: bool) -> Span | None:
        interval = (found.interval_95_sensors if alone else found.interval_95).get(m)
        u = known.sensors[m] if alone else found.standard[m]
        return None if interval is None or not u else Span(interval.low, interval.high, u)

    columns: list[Column[str]] = [
        Column("metric", short),
        Column("unit", lambda m: metric(m).unit),
        Column("95 % interval", lambda m: ends(m, alone=False)),
        Column("u, sensors", lambda m: Measured(known.sensors[m], known.sensors[m])),
        Column(
            "u, cycles",
            lambda m: Measured(known.repeatability[m], known.repeatability[m]),
        ),
        Column(
            "ν",
            lambda m: math.inf if (known.freedom[m] or 0.0) > 1000.0 else known.freedom[m],
            decimals=1,
        ),
        Column("these cycles alone", lambda m: ends(m, alone=True)),
    ]
    note = (
        "ν: effective degrees of freedom. These cycles alone: without their scatter."
        if known.mean
        else ""
    )
    caption = f"Standard uncertainty u of the means of {len(reduction.complete)} complete cycles."
    return table("uncertainty", caption, columns, given, note=note, brief=False)


Share = BudgetRow | None
"""A row of the budget; None for the repeatability."""


def budget_table(reduction: Reduction, found: Uncertainty) -> Table[Share]:
    """Which error contributes which share of the variance of each mean; empty where no accuracy
    is known.
    """
    known, rig = found.budget, reduction.rig
    metrics = [m for m in known.mean if m.startswith("eta")]
    metrics += [m for m in known.mean if m.startswith("energy") and m not in NET_METRICS]
    metrics = [m for m in metrics if known.mean[m]]

    def share(m: str, row: Share) -> float | None:
        part = shares(known.repeatability if row is None else row.of, known.mean)[m]
        return 100.0 * part if part else None

    def stated(attribute: str, row: Share) -> str:
        value = None if row is None or row.source is None else getattr(row.source, attribute)
        return "" if value is None else str(value)

    def size(attribute: str, row: Share) -> str | None:
        source = None if row is None else row.source
        value = None if source is None else getattr(source, attribute)
        if source is None or value is None:
            return None
        if source.part == "gain" or source.channel == R_DRUM:
            return f"{shown(100.0 * value)} %"
        unit = (
            "s" if source.part == "lag" else si_unit(rig.known_channels[source.channel].dimension)
        )
        return f"{shown(value)} {unit}"

    columns: list[Column[Share]] = [
        Column("source", lambda row: "repeatability" if row is None else source_name(row.source)),
        Column("limit", partial(size, "limit")),
        Column("distribution", lambda row: stated("shape", row).replace("_", " ")),
        Column("u", partial(size, "u")),
        Column("known by", lambda row: stated("basis", row).replace("_", " ")),
        Column("from", partial(stated, "origin")),
        *(Column(short(m), partial(share, m), "%", 0) for m in metrics),
    ]
    caption = "Uncertainty budget: share of the variance of each mean; errors of a sensor do not average out over cycles."
    source = f"Source of the rig file: {rig.source}." if rig.source else ""
    return table(
        "budget", caption, columns, [*known.rows, None] if metrics else (), note=source, brief=False
    )


# --------------------------------------------------------------------------------------- findings
def findings_table(run: Run, findings: Sequence[Finding]) -> Table[Finding]:
    """What was found wrong with a log and what was done; empty for a clean log."""
    samples, zero = run.samples, clock_zero(run)
    columns: list[Column[Finding]] = [
        Column("finding", lambda f: f.kind),
        Column("channel", lambda f: f.channel, brief=False),
        Column(
            "when",
            lambda f: None if f.start is None else Span(f.start - zero, (f.end or f.start) - zero),
            "s",
            2,
        ),
        Column(
            "data lost",
            lambda f: 100.0 * share if (share := f.lost_share(samples)) else None,
            "%",
            2,
            brief=False,
        ),
        Column("what was found", lambda f: f.message),
        Column("what was done", lambda f: f.action),
    ]
    since = f"Times count from {zero:.2f} s on the log's clock." if zero else ""
    return table(
        "findings", "What is wrong with the log, and what was done.", columns, findings, note=since
    )
