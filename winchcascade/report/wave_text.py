"""Energies of irregular waves in words and tables, for terminal, JSON and reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from winchcascade.core.cascade import field_of
from winchcascade.reduction.run_record import BootstrapRecord, Numbers, RatioRecord, WavesRecord
from winchcascade.reduction.wave_bootstrap import DRAWS, MIN_WAVES, SEED, RatioOfSums
from winchcascade.reduction.wave_energies import WaveClass, WaveEnergies
from winchcascade.report.digits import NumberText, interval_text, significant
from winchcascade.report.sheet import Cell, ItemTable, Limit, Table, TableColumn
from winchcascade.report.text_table import indented, listing, metric_steps, paragraphs, plain_cell, wrapped
from winchcascade.report.wording import SYMBOL

MAX_CLASSES = 40
"""Rows of classes that a table lists; of more the first and the last half of that."""


def wave_lines(found: WaveEnergies) -> list[str]:
    """Energies of the waves in the terminal: the record, efficiencies of all waves together, and the classes."""
    unit = found.payout_unit
    logs = f" of {len(found.counts)} logs" if len(found.counts) > 1 else ""
    lines = wrapped(f"waves: {sum(found.counts)}{logs}; record{'s' * bool(logs)} of {found.record_duration:.1f} s")
    for stage, watt in found.record_power.items():
        power = found.power.get(stage, RatioOfSums(watt))
        interval = _interval(power, lambda low, high, u: f"{interval_text(low, high, u)} W", _unknown(found, (stage,)))
        lines += indented(f"P_{stage} {significant(watt, 4)} W, mean of the record{interval}")
    lines += paragraphs((f"{name} {_ratio(found, name, eta)}" for name, eta in found.efficiency.items()), "  ")
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
        *listing(
            columns,
            found.classes,
            Limit(MAX_CLASSES, "classes more, all in --json"),
            used=True,
            omit=metric_steps([f"E_{stage}" for stage in found.energy], found.efficiency),
        ),
    ]


def _ratio(found: WaveEnergies, name: str, eta: RatioOfSums) -> str:
    value = f"{plain_cell(eta.value, 3)} of all waves together"
    if eta.value is None:
        return f"{value}: the ratio is below 0"
    return value + _interval(eta, lambda low, high, _: f"{low:.3f} to {high:.3f}", _unknown(found, found.pairs[name]))


def _interval(of: RatioOfSums, text: Callable[[float, float, float], str], unknown: Sequence[str]) -> str:
    """The interval of a ratio or a mean in words, by a text of its ends and its uncertainty, and what it contains."""
    if of.interval is None or of.block is None:
        return f" (no interval: fewer than {MIN_WAVES} waves)"
    sensors = f"without sensors, as the accuracy of {', '.join(unknown)} is unknown" if unknown else "and sensors"
    return f", 95 %: {text(*of.interval, _both(of))} (waves in blocks of {of.block}, {sensors})"


def _unknown(found: WaveEnergies, stages: Iterable[str]) -> list[str]:
    """Channels of some stages without a stated accuracy."""
    return sorted({channel for stage in stages for channel in found.unknown.get(stage, ())})


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g} to {ends[1]:g}"


def _energy(stage: str) -> Callable[[WaveClass], Cell]:
    """Cell of the energies of a class."""
    return lambda c: None if (joule := c.energy.get(stage)) is None else significant(joule, 4)


def _efficiency(name: str) -> Callable[[WaveClass], Cell]:
    """Cell of the efficiencies of a class."""
    return lambda c: c.efficiency.get(name)


def classes_table(found: WaveEnergies) -> Table | None:
    """Energies and efficiencies by classes of payout and period."""
    return ItemTable[WaveClass](
        "wave-classes",
        "Waves by payout, the travel of the positive half, and period: energies of all waves of a class, ratios of these sums.",
        [
            TableColumn("Payout", found.payout_unit, text=True, of=lambda c: _range(c.payout)),
            TableColumn("Period", "s", text=True, of=lambda c: _range(c.period)),
            TableColumn("Waves", of=lambda c: c.count),
            *(TableColumn(SYMBOL[f"energy_{stage}"], "J", of=_energy(stage)) for stage in found.energy),
            *(TableColumn(SYMBOL[name], "", 3, of=_efficiency(name)) for name in found.efficiency),
        ],
        limit=Limit(MAX_CLASSES, "classes"),
    ).of(found.classes)


def record_table(found: WaveEnergies) -> Table | None:
    """Energy and mean power of each stage over the record, and over its waves."""
    return ItemTable[str](
        "wave-record",
        f"The whole record of {found.record_duration:.1f} s, and its {found.cycle.size} complete waves."
        if len(found.counts) == 1
        else f"The records of {len(found.counts)} logs, {found.record_duration:.1f} s, and their {found.cycle.size} waves.",
        [
            TableColumn("Stage", text=True, of=str),
            TableColumn("Energy of the record", "J", of=lambda s: significant(found.record_energy[s], 5)),
            TableColumn("Mean power of the record", "W", of=lambda s: significant(found.record_power.get(s), 4)),
            TableColumn("95 %", "W", text=True, of=lambda s: power_interval(found, s)),
            TableColumn(
                "u of waves", "W", of=lambda s: _two_digits(found.power[s].u_waves if s in found.power else None)
            ),
            TableColumn(
                "u of sensors", "W", of=lambda s: _two_digits(found.power[s].u_sensors if s in found.power else None)
            ),
            TableColumn(
                "Energy of the waves",
                "J",
                of=lambda s: significant(float(found.energy[s].sum()), 5) if s in found.energy else None,
            ),
        ],
        note=f"95 % intervals of the mean powers, with standard uncertainties u, by the waves and the sensors.{_not_in(found)}",
    ).of(list(found.record_energy))


def power_interval(found: WaveEnergies, stage: str) -> NumberText | None:
    """The 95 % interval of a mean power of the record, None without one. [W]"""
    power = found.power.get(stage)
    if power is None or power.interval is None:
        return None
    return interval_text(*power.interval, _both(power))


def _both(of: RatioOfSums) -> float:
    """Standard uncertainty by the waves and the sensors together."""
    return math.hypot(of.u_waves or 0.0, of.u_sensors or 0.0)


def _two_digits(u: float | None) -> NumberText | None:
    return None if u is None else significant(u, 2)


def wave_efficiencies_table(found: WaveEnergies) -> Table | None:
    """Efficiencies of all waves together with their intervals."""
    return ItemTable[tuple[str, RatioOfSums]](
        "wave-efficiencies",
        "Efficiencies of all waves together, with standard uncertainties u.",
        [
            TableColumn("Efficiency", text=True, of=lambda e: SYMBOL[e[0]]),
            TableColumn("Ratio of sums", "", 3, of=lambda e: e[1].value),
            TableColumn("95 %, from", "", 3, of=lambda e: None if e[1].interval is None else e[1].interval[0]),
            TableColumn("to", "", 3, of=lambda e: None if e[1].interval is None else e[1].interval[1]),
            TableColumn("u of waves", "", 4, of=lambda e: e[1].u_waves),
            TableColumn("u of sensors", "", 4, of=lambda e: e[1].u_sensors),
            TableColumn("Block", "waves", 0, of=lambda e: e[1].block),
        ],
        note=f"How waves differ is resampled by a circular block bootstrap with {DRAWS} draws and seed {SEED}, as waves that "
        "follow each other are not independent; the length of the blocks follows from the autocorrelation. The errors of the "
        f"sensors are drawn from their budget and added.{_not_in(found)}",
    ).of(list(found.efficiency.items()))


def _not_in(found: WaveEnergies) -> str:
    """Which sensors the intervals do not contain."""
    unknown = sorted({channel for channels in found.unknown.values() for channel in channels})
    return f" The accuracy of {', '.join(unknown)} is unknown: intervals that need it contain the waves alone." * bool(
        unknown
    )


def wave_record(found: WaveEnergies) -> WavesRecord:
    """The block `waves` of the JSON: each wave, the record, efficiencies with intervals, and classes."""
    payout = f"payout_{found.payout_unit}"
    return WavesRecord(
        record={
            "duration_s": found.record_duration,
            **{field_of(f"energy_{stage}"): joule for stage, joule in found.record_energy.items()},
            **{field_of(f"power_{stage}"): watt for stage, watt in found.record_power.items()},
        },
        mean_power={stage: _record_of(power) for stage, power in found.power.items()},
        efficiency={name: _record_of(eta, found.pairs[name]) for name, eta in found.efficiency.items()},
        bootstrap=BootstrapRecord(DRAWS, SEED),
        waves=found.cycle.size,
        waves_of_logs=found.counts,
        payout_unit=found.payout_unit,
        stages=tuple(found.energy),
        sensors=found.errors,
        without_accuracy=dict(found.unknown),
        each=tuple(
            {
                "cycle": int(found.cycle[k]),
                payout: float(found.payout[k]),
                "period_s": float(found.period[k]),
                **{field_of(f"energy_{stage}"): float(x[k]) for stage, x in found.energy.items()},
            }
            for k in range(found.cycle.size)
        ),
        classes=tuple(
            {
                payout: c.payout,
                "period_s": c.period,
                "count": c.count,
                **{field_of(f"energy_{stage}"): joule for stage, joule in c.energy.items()},
                **c.efficiency,
            }
            for c in found.classes
        ),
    )


def _record_of(of: RatioOfSums, between: tuple[str, str] | UnsetType = UNSET) -> RatioRecord:
    return RatioRecord(
        value=of.value,
        interval_95=of.interval,
        block_waves=of.block,
        standard_uncertainty_waves=of.u_waves,
        standard_uncertainty_sensors=of.u_sensors,
        between=between,
    )


def _ratio_from(of: RatioRecord) -> RatioOfSums:
    return RatioOfSums(
        of.value, of.interval_95, of.block_waves, of.standard_uncertainty_waves, of.standard_uncertainty_sensors
    )


def waves_from_record(of: WavesRecord) -> WaveEnergies:
    """The energies of waves of a written record; of some waves alone where it holds these alone."""
    payout, energy = f"payout_{of.payout_unit}", {stage: field_of(f"energy_{stage}") for stage in of.stages}
    return WaveEnergies(
        cycle=np.array([wave["cycle"] for wave in of.each], dtype=np.intp),
        payout=np.array([wave[payout] for wave in of.each], dtype=np.float64),
        payout_unit=of.payout_unit,
        period=np.array([wave["period_s"] for wave in of.each], dtype=np.float64),
        energy={stage: np.array([wave[key] for wave in of.each], dtype=np.float64) for stage, key in energy.items()},
        counts=of.waves_of_logs,
        pairs={name: eta.between for name, eta in of.efficiency.items() if eta.between is not UNSET},
        record_duration=of.record["duration_s"],
        record_energy={
            key[len("energy_") : -len("_j")]: x for key, x in of.record.items() if key.startswith("energy_")
        },
        efficiency={name: _ratio_from(eta) for name, eta in of.efficiency.items()},
        power={stage: _ratio_from(power) for stage, power in of.mean_power.items()},
        classes=tuple(
            WaveClass(
                payout=msgspec.convert(one[payout], tuple[float, float]),
                period=msgspec.convert(one["period_s"], tuple[float, float]),
                count=msgspec.convert(one["count"], int),
                energy=msgspec.convert({stage: one[key] for stage, key in energy.items()}, Numbers),
                efficiency=msgspec.convert({name: one.get(name) for name in of.efficiency}, Numbers),
            )
            for one in of.classes
        ),
        errors=of.sensors,
        unknown=of.without_accuracy,
    )
