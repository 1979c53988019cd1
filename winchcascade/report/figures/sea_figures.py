"""Figures of a rig in waves: mean power over the seas, losses of the stages, loads compared,
peaks beside their limits.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.report.figures.style import (
    COLOURS,
    from_zero,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
)
from winchcascade.rig.ledger import LEDGER
from winchcascade.sea.in_sea import PEAKS, QUANTITIES
from winchcascade.sea.sea_study import InSea, SeaStudy

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from winchcascade.diagnosis.handover.posterior import Band

COMPARED = ("best_over_fixed", "schedule_over_fixed", "schedule_over_best")
"""Comparisons of loads, in the order in which they are drawn."""

GAINS = ("above", "below", "extra")
"""Colours of the comparisons."""

SMALL = 0.005
"""Share of the net power of the line up to which a loss is in the table alone. [1]"""

LOSSES = ("mech", "load4", "load1", "extra", "load6", "load3", "line", "soft", "load2", "load5")
"""Colours of the losses."""

DELIVERED = 0.6
"""Opacity of what is delivered, which is no loss. [1]"""

HEADROOM = 0.15
"""Share of an axis above the largest value, so that a point is drawn whole. [1]"""

MAX_LABELS = 12
"""Number of seas up to which each is named below its axis."""


def power_figure(found: SeaStudy) -> Figure:
    """Mean power at the DC link: as a matrix over wave height and period where the seas make
    one, else sea by sea.
    """
    rows = [row for row in found.rows if not row.reason]
    heights, periods = ({getattr(row, name) for row in rows} for name in ("hs", "tp"))
    if min(len(heights), len(periods)) > 1:
        return _matrix(rows)
    figure, (axes,) = panel_figure(2.4)
    x = np.arange(len(rows))
    _bars(axes, x, [row.values["p_gen_w"] for row in rows], [not row.covered() for row in rows])
    axes.set(ylabel="Mean power at the DC link (W)")
    from_zero(axes)
    _name_seas(axes, rows)
    return figure


def _matrix(rows: Sequence[InSea]) -> Figure:
    """Mean power over period and height, hatched where the logs do not cover it."""
    heights, periods = (sorted({getattr(row, name) for row in rows}) for name in ("hs", "tp"))
    power = np.full((len(heights), len(periods)), math.nan)
    figure, (axes,) = panel_figure(1.1 + 0.36 * len(heights))
    size = 7.0 if len(periods) <= MAX_LABELS else 5.0
    for row in rows:
        power[heights.index(row.hs), periods.index(row.tp)] = row.values["p_gen_w"].value
    top = float(np.nanmax(power))
    axes.imshow(power, origin="lower", aspect="auto", cmap="GnBu", vmin=0.0, vmax=1.3 * top)
    axes.grid(visible=False)
    for row in rows:
        place = periods.index(row.tp), heights.index(row.hs)
        text = f"{row.values['p_gen_w'].value:.3g}"
        style = "normal" if row.covered() else "italic"
        axes.text(
            *place, text, ha="center", va="center", fontsize=size, style=style, color=COLOURS["ink"]
        )
    axes.set_xticks(range(len(periods)), [f"{tp:g}" for tp in periods])
    axes.set_yticks(range(len(heights)), [f"{hs:g}" for hs in heights])
    axes.set(xlabel="Peak period (s)", ylabel="Significant wave height (m)")
    return figure


def _bars(
    axes: Axes, x: np.ndarray, bands: Sequence[Band], hollow: Sequence[bool], colour: str = "gen"
) -> None:
    """Values with their intervals, hollow where the logs do not cover them."""
    values = np.array([band.value for band in bands])
    low, high = (np.array([getattr(band, end) for band in bands]) for end in ("low", "high"))
    axes.vlines(x, low, high, color=COLOURS[colour], lw=1.2)
    for at, value, open_one in zip(x, values, hollow, strict=True):
        face = COLOURS["paper" if open_one else colour]
        axes.plot(at, value, "o", mec=COLOURS[colour], mfc=face, ms=4)


def _name_seas(axes: Axes, rows: Sequence[InSea]) -> None:
    """Write height and period of each sea below an axis of seas, of some where there are many."""
    stride = math.ceil(len(rows) / MAX_LABELS)
    axes.set_xticks(
        range(0, len(rows), stride), [f"{row.hs:g} m\n{row.tp:g} s" for row in rows[::stride]]
    )


def losses_figure(found: SeaStudy) -> Figure:
    """Where the net power of the line goes in each sea: delivered, and lost in each part, as
    shares of it.
    """
    rows = [row for row in found.rows if not row.reason]
    figure, (axes,) = panel_figure(2.6)
    shares = {"gen": [row.values["p_gen_w"].value / row.values["p_line_w"].value for row in rows]}
    shares |= {
        name: [row.lost[name] / row.values["p_line_w"].value for row in rows]
        for name in rows[0].lost
    }
    drawn = {name: np.array(own) for name, own in shares.items() if max(own) > SMALL}
    base, entries = np.zeros(len(rows)), []
    for k, (name, own) in enumerate(drawn.items()):
        colour = ("gen", *LOSSES)[k % (1 + len(LOSSES))]
        axes.bar(
            range(len(rows)),
            100.0 * own,
            0.8,
            bottom=base,
            color=COLOURS[colour],
            alpha=1.0 if k else DELIVERED,
        )
        base = base + 100.0 * own
        words = LEDGER[name].group if k else "delivered"
        entries.append(line_entry(words, colour, lw=4, alpha=1.0 if k else DELIVERED))
    axes.set(ylabel="Share of net line power (%)")
    _name_seas(axes, rows)
    legend_above(figure, entries)
    return figure


def gains_figure(found: SeaStudy) -> Figure | None:
    """Gain of power of one way to choose the load over another, sea by sea; None without any."""
    rows = [row for row in found.rows if row.gain]
    named = [name for name in COMPARED if any(name in row.gain for row in rows)]
    if not named:
        return None
    figure, (axes,) = panel_figure(2.4)
    entries = []
    for k, name in enumerate(named):
        colour = GAINS[k]
        having = [at for at, row in enumerate(rows) if name in row.gain]
        percent = [_times(rows[at].gain[name], 100.0) for at in having]
        x = np.array(having) + 0.2 * (k - 0.5 * (len(named) - 1))
        _bars(axes, x, percent, [not rows[at].covered(name) for at in having], colour)
        entries.append(line_entry(name.replace("_", " "), colour, marker="o", ms=4))
    axes.axhline(0.0, color=COLOURS["soft"], lw=0.8)
    axes.set(ylabel="Gain of mean power (%)")
    _name_seas(axes, rows)
    legend_above(figure, entries)
    return figure


def _times(band: Band, factor: float) -> Band:
    return type(band)(factor * band.value, factor * band.low, factor * band.high)


def peaks_figure(found: SeaStudy) -> Figure:
    """Largest tension, speed and current of each sea with the limits that are set, at the scale
    of the seas.
    """
    rows = [row for row in found.rows if not row.reason]
    figure, panels = panel_figure(3.6, 2, 2)
    drawn = {name: limit for name, limit in found.limits.items() if found.seas.froude == 1.0}
    for axes, letter, (name, quantity) in zip(panels, "abcd", PEAKS.items(), strict=True):
        _bars(
            axes,
            np.arange(len(rows)),
            [row.values[quantity] for row in rows],
            [not row.covered() for row in rows],
        )
        if name in drawn:
            axes.axhline(drawn[name], color=COLOURS["repaired"], lw=1.0)
        axes.set_ymargin(HEADROOM)
        label_panel(axes, letter, PEAK_TITLES[quantity], unit=QUANTITIES[quantity])
        from_zero(axes)
        _name_seas(axes, rows)
    if drawn:
        legend_above(figure, [line_entry("limit", "repaired")])
    return figure


PEAK_TITLES = {
    "force_n": "Largest line tension", "rpm": "Largest generator speed", "i_s_a": "Largest stator "
                                                                                  "current, rms",
    "i_dc_rms_a": "DC current, rms over the sea",
}  # fmt: skip
"""Titles of the panels of `PEAKS`."""
