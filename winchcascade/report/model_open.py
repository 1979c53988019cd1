"""Figures of an open circuit: the damper of the fast shaft (Fig. 11) and the back-EMF constant (Fig. 12)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from winchcascade.report.figures import dots
from winchcascade.report.model_figures import (
    MARK_SIZE,
    MARKS,
    legend_above,
    patch_entry,
    samples_entry,
    shade_over_speed,
)
from winchcascade.report.style import COLOURS, LOAD_COLOURS, WIDTH, label_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.report.model_account import Regression, Sweep

_DASHED: Any = (0, (5, 2))


def damper_sweep(sweep: Sweep, *, word: str, rated: float | None) -> Figure:
    """Draw the line force in open circuit over generator speed, logged and simulated with several dampers (Fig. 11)."""
    figure = Figure((WIDTH, 2.9))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.09, right=0.972, top=0.9, bottom=0.145)
    entries: list[Any] = [(ax.plot(sweep.rpm, sweep.log, color=COLOURS["ink"], lw=1.4)[0], word)]
    for k, (factor, force) in enumerate(zip(sweep.factors, sweep.simulated, strict=True)):
        (drawn,) = ax.plot(
            sweep.rpm, force, color=COLOURS[LOAD_COLOURS[k % len(LOAD_COLOURS)]], lw=0.5, marker=MARKS[k % len(MARKS)],
            ms=MARK_SIZE, mew=0.7, mfc=COLOURS["paper"],
        )  # fmt: skip
        entries.append(
            (drawn, "no damper" if factor == 0 else "as in the rig file" if factor == 1 else f"{factor:g} ×")
        )
    ax.set_xlim(left=0.0)
    if shade_over_speed(ax, rated):
        entries.append(patch_entry("over rated speed", "over"))
    ax.set_xlabel("Generator speed (rpm)")
    ax.set_ylabel("Line force (N)")
    legend_above(figure, entries)
    return figure


def back_emf(
    rpm: Signal, v_dc: Signal, v_ll: Signal, *, slope: float, low: float, high: float, r2: float, reference: float, word: str
) -> Figure:  # fmt: skip
    """Draw an open circuit's DC voltage and back-EMF over generator speed, with the line through zero (Fig. 12).

    Parameters
    ----------
    rpm, v_dc, v_ll : (n,) generator speed [rpm], DC voltage, back-EMF line to line, rms [V]
    slope, low, high : of the line, with its 95 % interval [V/rpm]
    reference : back-EMF constant to compare with [V/rpm]
    """
    figure = Figure((WIDTH, 2.6))
    left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.24})
    figure.subplots_adjust(left=0.09, right=0.972, top=0.82, bottom=0.165)
    ends = np.array([0.0, 1.05 * float(np.max(rpm))])
    right.fill_between(ends, 0.9 * reference * ends, 1.1 * reference * ends, color=COLOURS["payout"], lw=0)
    right.plot(ends, reference * ends, color=COLOURS["soft"], ls=_DASHED, lw=0.9)
    right.plot(ends, slope * ends, color=COLOURS["mech"], lw=0.9)
    for ax, letter, title, y in (
        (left, "a", "Voltage of the DC link", v_dc),
        (right, "b", "Back-EMF, line to line, rms", v_ll),
    ):
        _dotted(ax, rpm, y, float(ends[1]))
        label_panel(ax, letter, title)
    right.text(
        0.04, 0.95, f"{slope:.5f} V/rpm\n95 %: {low:.5f} to {high:.5f}\nR² = {r2:.4f}", transform=right.transAxes, va="top",
        linespacing=1.4,
    )  # fmt: skip
    legend_above(
        figure,
        [
            samples_entry(f"{word}, samples used", "ink"),
            (Line2D([], [], color=COLOURS["mech"], lw=0.9), "line through zero"),
            (Line2D([], [], color=COLOURS["soft"], ls=_DASHED, lw=0.9), "rig file"),
            patch_entry("rig file ± 10 %", "payout"),
        ],
    )
    return figure


def back_emf_figure(fit: Regression, *, word: str) -> Figure:
    """Draw the regression that is kept of an open circuit."""
    return back_emf(
        np.array(fit.rpm), np.array(fit.v_dc), np.array(fit.v_ll), slope=fit.slope, low=fit.low, high=fit.high, r2=fit.r2,
        reference=fit.reference, word=word,
    )  # fmt: skip


def _dotted(ax: Axes, rpm: Signal, volt: Signal, end: float) -> None:
    dots(ax, rpm, volt, COLOURS["ink"])
    ax.set_xlim(0.0, end)
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("Generator speed (rpm)")
    ax.set_ylabel("V")
