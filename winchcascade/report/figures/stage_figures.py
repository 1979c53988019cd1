"""Figures of stages without a model: the power that comes out over time, and over what is
predicted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnosis_result import StageEnergy
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.figures.diagnosis_figures import DASHES
from winchcascade.report.figures.style import (
    COLOURS,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    wide_figure,
)
from winchcascade.report.glossary import upper

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GIVEN, CAUSED = "without losses", "with the causes"

MARKS = 2500
"""Blocks that are drawn over each other, at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""Cycles that are drawn over time."""


def prefix(size: float) -> tuple[float, str]:
    """Factor and prefix of the unit in which powers or energies of some size are shown.

    >>> prefix(2000.0), prefix(5.0)
    ((0.001, 'k'), (1.0, ''))
    """
    return (1e-3, "k") if size >= 1e3 else (1.0, "")


def worst_cycle(found: StageDiagnosis) -> StageEnergy | None:
    """Energy of the cycle, stage and phase from which the prediction deviates by the largest
    share; None without any.
    """
    known = [one for one in found.energies if one.phase != "hold" and one.measured]
    return max(known, key=lambda one: abs(one.after / one.measured - 1.0), default=None)


def power_history(found: StageDiagnosis, word: str) -> Figure:
    """Draw the power of the worst cycle and the next one over time, with the residual below, and
    the largest gap of them enlarged.
    """
    judged, worst, path = found.data.judged, worst_cycle(found), _widest(found)
    part = judged.part[0]
    if worst is not None:
        part = worst.run
        path = [one.out.name for one in found.data.paths].index(worst.stage)
    own_rows = (judged.part == part) & (judged.path == path)
    rows = judged.some(own_rows)
    t, cycles = rows.t, np.unique(rows.own_cycle)
    measured, given = rows.given + rows.gap, rows.given
    caused = None if found.closure is None else measured - found.closure.after[own_rows]
    first = 0 if worst is None else int(np.searchsorted(cycles, worst.cycle or 0))
    middle = cycles[min(first, max(cycles.size - SHOWN, 0)) :][:SHOWN]
    own = t[np.isin(rows.own_cycle, middle)]
    shown = (t >= own[0]) & (t <= own[-1])
    about = t[shown][np.argmax(np.abs(rows.gap[shown]))]
    near = (t >= about - 0.5 * NEAR) & (t <= about + 0.5 * NEAR)
    figure = wide_figure(4.3)
    axes = figure.subplots(2, 2, sharex="col", width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0))
    factor, k = prefix(float(np.max(np.abs(measured))))
    numbers = " and ".join(map(str, middle.tolist()))
    title = f"Cycle{'s' * (middle.size > 1)} {numbers} of {found.data.parts[part].run.name}"
    for column, (here, text) in enumerate(((shown, title), (near, "Where they differ most"))):
        above, below = axes[:, column]
        for power, colour, style in (
            (given, "mech", {"lw": 0.9, "ls": DASHES}),
            (caused, "gen", {"lw": 1.3}),
        ):
            if power is not None:
                above.plot(t[here] - own[0], power[here] * factor, color=COLOURS[colour], **style)
                below.plot(
                    t[here] - own[0],
                    (measured - power)[here] * factor,
                    color=COLOURS[colour],
                    **style,
                )
        above.plot(t[here] - own[0], measured[here] * factor, color=COLOURS["ink"], lw=0.7)
        above.margins(x=0.01)
        below.axhline(0.0, color=COLOURS["soft"], lw=0.6)
        below.set_xlabel("Time (s)")
        label_panel(above, "ab"[column], text)
    axes[0, 0].set_ylabel(f"Power ({k}W)")
    axes[1, 0].set_ylabel(f"Residual ({k}W)")
    with_causes = [line_entry(CAUSED, "gen", lw=1.3)] if caused is not None else []
    legend_above(
        figure,
        [line_entry(word, lw=0.9), line_entry(GIVEN, "mech", lw=1.0, ls=DASHES), *with_causes],
    )
    return figure


def power_scatter(found: StageDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, by the line alone and with the causes, at blocks spread
    over the judged cycles.
    """
    if found.closure is None:
        return None
    here = found.closure.rows.path == _widest(found)
    rows, after = found.closure.rows.some(here), found.closure.after[here]
    factor, k = prefix(float(np.max(np.abs(rows.given))))
    powers = np.array([rows.given + rows.gap, rows.given, rows.given + rows.gap - after])
    measured, *sides = powers[:, :: max(after.size // MARKS, 1)] * factor
    ends = [float(np.min(powers) * factor), float(np.max(powers) * factor)]
    figure, axes = panel_figure(3.1, 1, 2, share="xy")
    for ax, letter, predicted, colour, title in zip(
        axes, "ab", sides, ("mech", "gen"), (GIVEN, CAUSED), strict=True
    ):
        ax.plot(ends, ends, color=COLOURS["soft"], lw=0.7)
        ax.plot(predicted, measured, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5)
        ax.set(xlim=ends, ylim=ends)
        label_panel(ax, letter, upper(title), x=f"Predicted power ({k}W)")
    axes[0].set_ylabel(f"{upper(word)} power ({k}W)")
    return figure


def _widest(found: StageDiagnosis) -> int:
    """Number of the path that loses most."""
    rows = found.data.judged
    return int(np.argmax(np.bincount(rows.path, rows.gap**2)))
