"""What irregular waves state: energies of the record and efficiencies of all waves; of a log or
of a campaign.
"""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.core.cascade import BUILT_IN, Cascade, Stage
from winchcascade.reduction.wave_bootstrap import BOOTSTRAP, RatioOfSums
from winchcascade.reduction.wave_energies import CampaignWaves, LogWaves, WaveEnergies
from winchcascade.report.content import (
    Block,
    Cell,
    Column,
    Measured,
    Note,
    Picture,
    Section,
    Span,
    Tile,
    section,
    shown,
    table,
)
from winchcascade.report.figures.reduction_figures import stage_of
from winchcascade.report.figures.style import COLOURS, evenly, label_panel, look_of, panel_figure
from winchcascade.report.glossary import short, tex
from winchcascade.report.results.common import ratio_words
from winchcascade.report.wording import load_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN_WAVES = 1500
"""Waves that are drawn at most; of more, an even selection."""

ROUNDING = 1e-9
"""An uncertainty below this share of its value is none. [1]"""


def wave_section(found: WaveEnergies) -> Section:
    """Waves of one log."""
    return section("waves", "Waves", _wave_picture(found), *_wave_blocks(found))


def wave_tiles(found: WaveEnergies) -> list[Tile]:
    """Efficiencies of all waves together, and mean powers of the record where there are fewer
    than three.
    """
    etas = [
        Tile(
            name,
            ratio_words(name, found.pairs[name]),
            shown(eta.value, 3),
            f"95 %: {shown(interval_of(eta), 3)}"
            if eta.interval
            else "too few waves for an interval",
        )
        for name, eta in found.efficiency.items()
        if eta.value is not None
    ]
    powers = [
        Tile(
            f"power_{stage}",
            "mean of the record",
            f"{shown(watt)} W",
            f"{found.record_duration:.0f} s",
        )
        for stage, watt in found.record_power.items()
    ]
    return [*etas, *powers][:3]


def campaign_waves_section(found: CampaignWaves) -> Section:
    """Waves of all logs together over their payout, and each log beside the others."""
    columns: list[Column[LogWaves]] = [
        Column("log", lambda log: log.name),
        Column("load", lambda log: load_words(log.load, "ohm", unknown="-")),
        Column("waves", lambda log: sum(log.waves.counts), decimals=0),
        Column("record", lambda log: log.waves.record_duration, "s", 1),
        *(Column(short(f"power_{s}"), partial(_mean_power, s), "W") for s in found.together.record_energy),
        *(Column(name, partial(_efficiency, name), decimals=3) for name in found.together.efficiency),
    ]  # fmt: skip
    return section(
        "waves", "Waves",
        _wave_picture(found.together),
        *_wave_blocks(found.together),
        table("wave-logs", "Mean powers of each record, and ratios of sums of its waves.", columns, found.logs, brief=False),
        *(Note(text, "Left out") for text in found.left_out),
    )  # fmt: skip


def _mean_power(stage: str, log: LogWaves) -> float | None:
    return log.waves.record_power.get(stage)


def _efficiency(name: str, log: LogWaves) -> float | None:
    return log.waves.efficiency[name].value if name in log.waves.efficiency else None


Row = tuple[str, RatioOfSums | None]
"""A stage with its mean power, or an efficiency of all waves together."""

UNCERTAINTY: tuple[Column[Row], ...] = (
    Column("95 %", lambda row: interval_of(row[1])),
    Column("u of waves", lambda row: _u(row[1], sensors=False), brief=False),
    Column("u of sensors", lambda row: _u(row[1], sensors=True), brief=False),
)

EFFICIENCIES: tuple[Column[Row], ...] = (
    Column("efficiency", lambda row: row[0]),
    Column("ratio of sums", lambda row: row[1].value if row[1] else None, decimals=3),
    *UNCERTAINTY,
    Column("block", lambda row: row[1].block if row[1] else None, "waves", 0),
)


def _wave_blocks(found: WaveEnergies) -> list[Block | None]:
    """Record and efficiencies of waves, of one log or of several, and what their intervals
    contain.
    """
    logs = f" of {len(found.counts)} logs" if len(found.counts) > 1 else ""
    unknown = sorted({channel for channels in found.unknown.values() for channel in channels})
    draws, seed = BOOTSTRAP.values()
    without = (
        f", without sensors where the unknown accuracy of {', '.join(unknown)} is needed"
        if unknown
        else ""
    )
    powers: list[Column[Row]] = [
        Column("stage", lambda row: row[0]),
        Column("mean power", lambda row: found.record_power.get(row[0]), "W"),
        *UNCERTAINTY,
        Column("energy of the record", lambda row: found.record_energy[row[0]], "J", 0, brief=False),
        Column("of its waves", lambda row: float(x.sum()) if (x := found.energy.get(row[0])) is not None else None, "J", 0,
               brief=False),
    ]  # fmt: skip
    return [
        Note(f"{sum(found.counts)} complete waves{logs}; {found.record_duration:.1f} s of record.", "Waves"),
        table("wave-record", "The whole record, and its complete waves.", powers,
              [(stage, found.power.get(stage)) for stage in found.record_energy]),
        table("wave-efficiencies", "Efficiencies of all waves together.", EFFICIENCIES, found.efficiency.items()),
        Note(f"95 %, by waves in blocks ({draws} draws, seed {seed}) and sensors{without}.", "Intervals"),
    ]  # fmt: skip


def interval_of(of: RatioOfSums | None) -> Span | None:
    """A 95 % interval, with the digits of its uncertainty by waves and sensors."""
    if of is None or of.interval is None:
        return None
    return Span(*of.interval, math.hypot(of.u_waves or 0.0, of.u_sensors or 0.0))


def _u(of: RatioOfSums | None, *, sensors: bool) -> Cell:
    """The part of the standard uncertainty by waves or by sensors; zero for what rounding of
    numbers alone makes.
    """
    u = None if of is None else of.u_sensors if sensors else of.u_waves
    return (
        0.0
        if of is not None and u is not None and u < ROUNDING * abs(of.value or 1.0)
        else Measured(u, u)
    )


# ------------------------------------------------------------------------------------- the figure
def _wave_picture(found: WaveEnergies) -> Picture:
    """Energies and efficiencies of the waves as a block."""
    etas = ", and its efficiency; lines: ratios of sums" if found.efficiency else ""
    return Picture(
        "wave-energies",
        f"Energy of each wave over its payout{etas}.",
        "Dots of energies and efficiencies over payout, and lines of the ratios of sums in the "
        "table.",
        partial(_wave_figure, found),
    )


def _wave_figure(found: WaveEnergies) -> Figure | None:
    """Energies and efficiencies of the waves over their payout; None without waves."""
    if not found.each or not np.isfinite(found.payout).all():
        return None
    stages = tuple(BUILT_IN.get(name) or Stage(name, ()) for name in found.record_energy)
    cascade = Cascade(stages, configured=True)
    figure, (left, *others) = panel_figure(2.9, 1, 1 + bool(found.efficiency))
    rows = np.array(evenly(range(len(found.each)), DRAWN_WAVES))
    payout, x_label = found.payout[rows], f"Payout ({found.payout_unit})"
    for stage, joule in found.energy.items():
        look = look_of(stage)
        left.plot(
            payout,
            joule[rows],
            look.mark,
            ms=2.6,
            color=COLOURS[look.colour],
            label=tex(f"energy_{stage}"),
        )
    label_panel(left, "a", "Energy of each wave", x=x_label, y="Energy (J)")
    for right in others:
        for name, together in found.efficiency.items():
            into, out = found.pairs[name]
            look = look_of(stage_of(cascade, name))
            x, y = found.energy[into][rows], found.energy[out][rows]
            eta = np.divide(y, x, out=np.full(x.size, np.nan), where=x > 0.0)
            eta[(eta < 0.0) | (eta > 1.0)] = np.nan
            right.plot(payout, eta, look.mark, ms=2.6, color=COLOURS[look.colour], alpha=0.5)
            if together.value is not None:
                right.axhline(
                    together.value,
                    color=COLOURS[look.colour],
                    lw=1.6,
                    ls=look.dashes,
                    label=tex(name),
                )
        label_panel(right, "b", "Efficiency of each wave", x=x_label, y="Efficiency (1)")
    for axes in (left, *others):
        axes.legend(loc="best")
    return figure
