"""Energies of irregular waves in a report: over payout, and by class."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.cascade import Cascade
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.reduction.wave_energies import WaveEnergies, classes_of_payout, wave_energies
from winchcascade.report.figures import stage_of
from winchcascade.report.report_model import Picture, Section, picture, section
from winchcascade.report.style import COLOURS, label_panel, look_of, panel_figure
from winchcascade.report.table_model import Table
from winchcascade.report.wave_text import classes_table, record_table, wave_efficiencies_table
from winchcascade.report.wording import tex

DOTS = 1500
"""Waves that are drawn at most; of more, an even selection."""


def wave_section(reduction: Reduction) -> Section:
    """Energies and efficiencies of waves over their payout, the whole record, and classes of payout and period."""
    return section("waves", "Waves", *wave_blocks(wave_energies(reduction), reduction.rig.cascade))


def wave_blocks(found: WaveEnergies, cascade: Cascade) -> tuple[Picture | Table | None, ...]:
    """Figure and tables of waves, of one log or of several."""
    return (
        picture(
            wave_figure(found, cascade), "wave-energies",
            "Energy and efficiency of each wave over its payout, the travel of its positive half. Lines are the ratios of sums "
            "of classes of payout. A single wave may take energy from the gas, or leave energy in it: its efficiency scatters."
            if found.efficiency else "Energy of each wave over its payout, the travel of its positive half.",
            "Dots of energies and efficiencies over payout; sums by class are in the table.",
        ),
        record_table(found),
        wave_efficiencies_table(found),
        classes_table(found),
    )  # fmt: skip


def wave_figure(found: WaveEnergies, cascade: Cascade) -> Figure | None:
    """Energies and efficiencies of the waves over their payout; None without waves."""
    if not found.cycle.size or not np.isfinite(found.payout).all():
        return None
    figure, (left, *others) = panel_figure(2.9, 1, 1 + bool(found.efficiency), gaps={"wspace": 0.25})
    rows = np.unique(np.linspace(0, found.cycle.size - 1, min(found.cycle.size, DOTS)).astype(np.intp))
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
