"""What irregular waves state: energies of the record, efficiencies of all waves, classes; of a log or of a campaign."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.cascade import BUILT_IN, Cascade, Stage
from winchcascade.reduction.wave_bootstrap import DRAWS, SEED, RatioOfSums
from winchcascade.reduction.wave_energies import WaveClass, WaveEnergies, classes_of_payout
from winchcascade.reduction.wave_record import CampaignWaves, LogWaves
from winchcascade.report.content import (
    Block,
    Column,
    Measured,
    Note,
    Picture,
    Section,
    Span,
    Table,
    picture,
    section,
    table,
)
from winchcascade.report.glossary import short
from winchcascade.report.wording import load_words, tex

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN_WAVES = 1500
"""Waves that are drawn at most; of more, an even selection."""

ROUNDING = 1e-9
"""An uncertainty below this share of its value is none. [1]"""

LISTED_CLASSES = 40
"""Rows of classes that a table lists; of more the first and the last half of that."""


def wave_section(found: WaveEnergies, drawn: Picture | None = None) -> Section:
    """Waves of one log; `drawn` is the figure of `wave_picture`."""
    return section("waves", "Waves", drawn, *_wave_tables(found))


def _wave_tables(found: WaveEnergies) -> list[Block | None]:
    """Record, efficiencies and classes of waves, of one log or of several, and what their intervals contain."""
    logs = f" of {len(found.counts)} logs" if len(found.counts) > 1 else ""
    named = f"{sum(found.counts)} complete waves{logs}; {found.record_duration:.1f} s of record."
    return [
        Note(named, "Waves"),
        _record_table(found),
        table("wave-efficiencies", "Efficiencies of all waves together.", EFFICIENCIES, found.efficiency.items()),
        Note(_intervals(found), "Intervals"),
        _classes_table(found),
    ]  # fmt: skip


def _intervals(found: WaveEnergies) -> str:
    """What the intervals contain, and which sensors they leave out."""
    unknown = sorted({channel for channels in found.unknown.values() for channel in channels})
    without = (
        f"; without sensors where the accuracy of {', '.join(unknown)} is needed, which is unknown" if unknown else ""
    )
    return f"95 %, by waves in blocks ({DRAWS} draws, seed {SEED}) and sensors{without}."


def _interval(of: RatioOfSums | None) -> Span | None:
    """A 95 % interval, with the digits of its uncertainty by waves and sensors."""
    if of is None or of.interval is None:
        return None
    return Span(*of.interval, math.hypot(of.u_waves or 0.0, of.u_sensors or 0.0))


def _u(of: RatioOfSums | None, *, sensors: bool) -> Measured | float | None:
    """The part of the standard uncertainty by waves or by sensors; zero for what rounding of numbers alone makes."""
    u = None if of is None else of.u_sensors if sensors else of.u_waves
    return 0.0 if of is not None and u is not None and u < ROUNDING * abs(of.value or 1.0) else Measured(u, u)


EFFICIENCIES: tuple[Column[tuple[str, RatioOfSums]], ...] = (
    Column("efficiency", lambda row: row[0]),
    Column("ratio of sums", lambda row: row[1].value, decimals=3),
    Column("95 %", lambda row: _interval(row[1]), decimals=3, own_digits=True),
    Column("u of waves", lambda row: _u(row[1], sensors=False), brief=False, own_digits=True),
    Column("u of sensors", lambda row: _u(row[1], sensors=True), brief=False, own_digits=True),
    Column("block", lambda row: row[1].block, "waves", 0),
)
"""An efficiency of all waves together."""


def _record_table(found: WaveEnergies) -> Table[str] | None:
    """Energy and mean power of each stage over the record, and over its waves."""
    power = found.power.get
    columns: list[Column[str]] = [
        Column("stage", lambda s: s),
        Column("mean power", lambda s: found.record_power.get(s), "W", own_digits=True),
        Column("95 %", lambda s: _interval(power(s)), "W", own_digits=True),
        Column("u of waves", lambda s: _u(power(s), sensors=False), "W", brief=False, own_digits=True),
        Column("u of sensors", lambda s: _u(power(s), sensors=True), "W", brief=False, own_digits=True),
        Column("energy of the record", lambda s: found.record_energy[s], "J", 0, brief=False),
        Column("of its waves", lambda s: float(found.energy[s].sum()) if s in found.energy else None, "J", 0, brief=False),
    ]  # fmt: skip
    return table("wave-record", "The whole record, and its complete waves.", columns, found.record_energy)


def _classes_table(found: WaveEnergies) -> Table[WaveClass] | None:
    """Energies and efficiencies by classes of payout and period."""
    columns: list[Column[WaveClass]] = [
        Column("payout", lambda c: _range(c.payout), found.payout_unit),
        Column("period", lambda c: _range(c.period), "s"),
        Column("waves", lambda c: c.count, decimals=0),
        *(Column(short(f"energy_{s}"), partial(_energy, s), "J", own_digits=True) for s in found.energy),
        *(Column(name, partial(_efficiency, name), decimals=3) for name in found.efficiency),
    ]
    caption = "Waves by payout, the travel of the positive half, and period: sums of each class and their ratios."
    return Table("wave-classes", caption, columns, found.classes, limit=LISTED_CLASSES) if found.classes else None


def _energy(stage: str, of: WaveClass) -> float | None:
    return of.energy.get(stage)


def _efficiency(name: str, of: WaveClass) -> float | None:
    return of.efficiency.get(name)


def _power(stage: str, log: LogWaves) -> float | None:
    return log.waves.record_power.get(stage)


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g} to {ends[1]:g}"


# -------------------------------------------------------------------------------------------------------- of a campaign
def campaign_waves_section(found: CampaignWaves, *, drawn: bool = True) -> Section:
    """Waves of all logs together over their payout, by class, and each log beside the others.

    Parameters
    ----------
    drawn : with the figure, which needs the style of figures
    """
    stages = tuple(BUILT_IN.get(name) or Stage(name, ()) for name in found.together.record_energy)
    figure = wave_picture(found.together, Cascade(stages, configured=True)) if drawn else None
    left_out = [Note(text, "Left out") for text in found.left_out]
    return section("waves", "Waves", figure, *_wave_tables(found.together), _logs_table(found), *left_out)


def _logs_table(found: CampaignWaves) -> Table[LogWaves] | None:
    waves = found.together
    columns: list[Column[LogWaves]] = [
        Column("log", lambda log: log.name),
        Column("load", lambda log: load_words(log.load, "ohm", unknown="-")),
        Column("waves", lambda log: sum(log.waves.counts), decimals=0),
        Column("record", lambda log: log.waves.record_duration, "s", 1),
        *(
            Column(short(f"power_{s}"), partial(_power, s), "W", own_digits=True)
            for s in waves.record_energy
        ),
        *(column for name in waves.efficiency for column in _efficiency_columns(name)),
    ]  # fmt: skip
    caption = "Mean powers of the record of each log, and ratios of the sums of its waves."
    return table("wave-logs", caption, columns, found.logs, brief=False)


def _efficiency_columns(name: str) -> Sequence[Column[LogWaves]]:
    """An efficiency of all waves of a log, and its interval."""

    def eta(of: Mapping[str, RatioOfSums]) -> float | None:
        return of[name].value if name in of else None

    return (
        Column(name, lambda log: eta(log.waves.efficiency), decimals=3),
        Column(f"95 % of {name}", lambda log: _interval(log.waves.efficiency.get(name)), decimals=3),
    )


# ----------------------------------------------------------------------------------------------------------- the figure
def wave_picture(found: WaveEnergies, cascade: Cascade) -> Picture | None:
    """Energies and efficiencies of the waves as a block. Called within the style of figures."""
    return picture(
        _wave_figure(found, cascade), "wave-energies",
        "Energy of each wave over its payout"
        + (", and its efficiency; lines: ratios of sums by class." if found.efficiency else "."),
        "Dots of energies and efficiencies over payout; sums by class are in the table.",
    )  # fmt: skip


def _wave_figure(found: WaveEnergies, cascade: Cascade) -> Figure | None:
    """Energies and efficiencies of the waves over their payout; None without waves."""
    from winchcascade.report.figures.reduction_figures import stage_of
    from winchcascade.report.figures.style import COLOURS, label_panel, look_of, panel_figure

    if not found.cycle.size or not np.isfinite(found.payout).all():
        return None
    figure, (left, *others) = panel_figure(2.9, 1, 1 + bool(found.efficiency))
    rows = np.unique(np.linspace(0, found.cycle.size - 1, min(found.cycle.size, DRAWN_WAVES)).astype(np.intp))
    for stage, joule in found.energy.items():
        look = look_of(stage)
        left.plot(
            found.payout[rows], joule[rows], look.mark, ms=2.6, color=COLOURS[look.colour], label=tex(f"energy_{stage}")
        )
    for name in found.efficiency:
        into, out = cascade.between(name)
        look = look_of(stage_of(cascade, name))
        x, y = found.energy[into][rows], found.energy[out][rows]
        eta = np.divide(y, x, out=np.full(x.size, np.nan), where=x > 0.0)
        eta[(eta < 0.0) | (eta > 1.0)] = np.nan
        colour = COLOURS[look.colour]
        others[0].plot(found.payout[rows], eta, look.mark, ms=2.6, color=colour, alpha=0.5)
        steps = [(*of.payout, of.efficiency[name]) for of in classes_of_payout(found)]
        ends = np.array([(low, high, np.nan) for low, high, _ in steps]).ravel()
        levels = np.array([3 * [np.nan if value is None else value] for *_, value in steps], dtype=float).ravel()
        others[0].plot(ends, levels, color=colour, lw=1.6, ls=look.dashes, label=tex(name))
    payout = f"Payout ({found.payout_unit})"
    label_panel(left, "a", "Energy of each wave", x=payout, y="Energy (J)")
    for right in others:
        label_panel(right, "b", "Efficiency of each wave", x=payout, y="Efficiency (1)")
    for axes in (left, *others):
        axes.legend(loc="best")
    return figure
