"""Energies of irregular waves in words and tables, for terminal, JSON and reports."""

from __future__ import annotations

from typing import Any

from winchcascade.core.cascade import field_of
from winchcascade.reduction.wave_energies import DRAWS, SEED, RatioOfSums, WaveClass, WaveEnergies
from winchcascade.report.digits import significant
from winchcascade.report.report_model import Table, TableColumn, items_table
from winchcascade.report.text_table import listing, plain_cell
from winchcascade.report.wording import SYMBOL

MOST_CLASSES = 40
"""Rows of classes that a table lists; of more the first and the last half of that."""


def wave_lines(found: WaveEnergies) -> list[str]:
    """Energies of the waves in the terminal: the record, efficiencies of all waves together, and the classes."""
    unit = found.payout_unit
    powers = ", ".join(f"P_{stage} {significant(watt, 4)} W" for stage, watt in found.record_power.items())
    lines = [f"waves: {found.cycle.size}; record of {found.record_duration:.1f} s with mean {powers}"]
    lines += [f"  {name} {_ratio(eta)}" for name, eta in found.efficiency.items()]
    columns: list[TableColumn[WaveClass]] = [
        TableColumn("payout", unit, text=True, of=lambda c: _range(c.payout)),
        TableColumn("period", "s", text=True, of=lambda c: _range(c.period)),
        TableColumn("waves", of=lambda c: c.count),
        *(TableColumn(f"E_{stage}", "J", of=_energy(stage)) for stage in found.energy),
        *(TableColumn(name, "", 3, of=_efficiency(name)) for name in found.efficiency),
    ]
    return [
        *lines,
        "",
        *listing(columns, found.classes, most=MOST_CLASSES, more="classes more, all in --json", used=True),
    ]


def _ratio(eta: RatioOfSums) -> str:
    if eta.interval is None or eta.block is None:
        return f"{plain_cell(eta.value, 3)} of all waves together (no interval: too few waves)"
    low, high = eta.interval
    blocks = f"blocks of {eta.block} wave{'s' * (eta.block > 1)}"
    return f"{plain_cell(eta.value, 3)} of all waves together, 95 %: {low:.3f} to {high:.3f} ({blocks})"


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g} to {ends[1]:g}"


def _energy(stage: str) -> Any:
    """Cell of the energies of a class."""
    return lambda c: None if (joule := c.energy.get(stage)) is None else significant(joule, 4)


def _efficiency(name: str) -> Any:
    """Cell of the efficiencies of a class."""
    return lambda c: c.efficiency.get(name)


def classes_table(found: WaveEnergies) -> Table | None:
    """Energies and efficiencies by classes of payout and period."""
    columns: list[TableColumn[WaveClass]] = [
        TableColumn("Payout", found.payout_unit, text=True, of=lambda c: _range(c.payout)),
        TableColumn("Period", "s", text=True, of=lambda c: _range(c.period)),
        TableColumn("Waves", of=lambda c: c.count),
        *(TableColumn(SYMBOL[f"energy_{stage}"], "J", of=_energy(stage)) for stage in found.energy),
        *(TableColumn(SYMBOL[name], "", 3, of=_efficiency(name)) for name in found.efficiency),
    ]
    return items_table(
        "wave-classes",
        "Waves by payout, the travel of the positive half, and period: energies of all waves of a class, ratios of these sums.",
        columns,
        found.classes,
        most=MOST_CLASSES,
        more="classes",
    )


def record_table(found: WaveEnergies) -> Table | None:
    """Energy and mean power of each stage over the record, and over its waves."""
    columns: list[TableColumn[str]] = [
        TableColumn("Stage", text=True, of=str),
        TableColumn("Energy of the record", "J", of=lambda s: significant(found.record_energy[s], 5)),
        TableColumn("Mean power of the record", "W", of=lambda s: significant(found.record_power[s], 4)),
        TableColumn(
            "Energy of the waves", "J",
            of=lambda s: significant(float(found.energy[s].sum()), 5) if s in found.energy else None,
        ),
    ]  # fmt: skip
    return items_table(
        "wave-record",
        f"The whole record of {found.record_duration:.1f} s, and its {found.cycle.size} complete waves.",
        columns,
        list(found.record_energy),
    )


def efficiencies_table(found: WaveEnergies) -> Table | None:
    """Efficiencies of all waves together with their intervals."""
    columns: list[TableColumn[tuple[str, RatioOfSums]]] = [
        TableColumn("Efficiency", text=True, of=lambda e: SYMBOL[e[0]]),
        TableColumn("Ratio of sums", "", 3, of=lambda e: e[1].value),
        TableColumn("95 %, from", "", 3, of=lambda e: None if e[1].interval is None else e[1].interval[0]),
        TableColumn("to", "", 3, of=lambda e: None if e[1].interval is None else e[1].interval[1]),
        TableColumn("Block", "waves", 0, of=lambda e: e[1].block),
    ]
    return items_table(
        "wave-efficiencies",
        "Efficiencies of all waves together.",
        columns,
        list(found.efficiency.items()),
        note=f"Intervals are those of a circular block bootstrap with {DRAWS} draws and seed {SEED}, as waves that follow each "
        "other are not independent; the length of the blocks follows from the autocorrelation. They contain how waves differ, "
        "not the errors of the sensors.",
    )


def wave_record(found: WaveEnergies) -> dict[str, Any]:
    """The block `waves` of the JSON: each wave, the record, efficiencies with intervals, and classes."""
    payout = f"payout_{found.payout_unit}"
    return {
        "record": {
            "duration_s": found.record_duration,
            **{field_of(f"energy_{stage}"): joule for stage, joule in found.record_energy.items()},
            **{field_of(f"power_{stage}"): watt for stage, watt in found.record_power.items()},
        },
        "efficiency": {
            name: {"value": eta.value, "interval_95": eta.interval, "block_waves": eta.block}
            for name, eta in found.efficiency.items()
        },
        "bootstrap": {"draws": DRAWS, "seed": SEED},
        "each": [
            {
                "cycle": int(found.cycle[k]),
                payout: float(found.payout[k]),
                "period_s": float(found.period[k]),
                **{field_of(f"energy_{stage}"): float(x[k]) for stage, x in found.energy.items()},
            }
            for k in range(found.cycle.size)
        ],
        "classes": [
            {
                payout: c.payout,
                "period_s": c.period,
                "count": c.count,
                **{field_of(f"energy_{stage}"): joule for stage, joule in c.energy.items()},
                **c.efficiency,
            }
            for c in found.classes
        ],
    }
