"""Figures of a winch without a model: its power over time, over what is predicted, by set of causes and by cycle."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.line.line_data import CyclePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report.cause_words import set_words
from winchcascade.report.diagnosis_figures import DASHES, FILLED, HOLLOW
from winchcascade.report.digits import upper
from winchcascade.report.figures.style import (
    COLOURS,
    Margins,
    broken,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    wide_figure,
)

GIVEN, CAUSED = "line tension times speed", "with the causes"

MARKS = 2500
"""Samples that are drawn over each other, at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""Cycles that are drawn over time."""

KILO = 1e-3

LABEL = 32
"""Names of a set of causes in a line. [characters]"""


def line_power(part: CyclePart) -> Signal:
    """Line tension times speed at the samples that count, (n,) [W]."""
    return part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]


def power_history(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the power of two cycles over time, with the residual below, and the largest gap of them enlarged."""
    part = found.lines.judged[0]
    t, given = part.run.t[part.here], line_power(part)
    measured = given + part.gap
    caused = None if found.closure is None else measured - found.closure.after[0]
    cycles = np.unique(part.cycle)
    middle = cycles[max(cycles.size // 2 - 1, 0) :][:SHOWN]
    own = t[np.isin(part.cycle, middle)]
    shown = (t >= own[0]) & (t <= own[-1])
    about = t[shown][np.argmax(np.abs(part.gap[shown]))]
    near = (t >= about - 0.5 * NEAR) & (t <= about + 0.5 * NEAR)
    figure = wide_figure(4.5, Margins(left=0.085, head=0.5))
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0), wspace=0.17, hspace=0.12)
    title = f"{'Two cycles' if middle.size > 1 else 'One cycle'} of {part.run.name}"
    for column, (here, text) in enumerate(((shown, title), (near, "Where they differ most"))):
        above = figure.add_subplot(grid[0, column])
        below = figure.add_subplot(grid[1, column], sharex=above)
        for power, colour, style in ((given, "mech", {"lw": 0.9, "ls": DASHES}), (caused, "gen", {"lw": 1.3})):
            if power is not None:
                above.plot(t[here] - own[0], power[here] * KILO, color=COLOURS[colour], **style)
                below.plot(t[here] - own[0], (measured - power)[here] * KILO, color=COLOURS[colour], **style)
        above.plot(t[here] - own[0], measured[here] * KILO, color=COLOURS["ink"], lw=0.7)
        above.margins(x=0.01)
        above.tick_params(labelbottom=False)
        below.axhline(0.0, color=COLOURS["soft"], lw=0.6)
        below.set_xlabel("Time (s)")
        label_panel(above, "ab"[column], text)
    figure.axes[0].set_ylabel("Winch power (kW)")
    figure.axes[1].set_ylabel("Residual (kW)")
    with_causes = [line_entry(CAUSED, "gen", lw=1.3)] if caused is not None else []
    legend_above(figure, [line_entry(word, "ink", lw=0.9), line_entry(GIVEN, "mech", lw=1.0, ls=DASHES), *with_causes])
    return figure


def power_scatter(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, by the line alone and with the causes, at samples spread over the judged cycles."""
    if found.closure is None:
        return None
    given = np.concatenate([line_power(part) for part in found.closure.parts])
    measured = given + np.concatenate([part.gap for part in found.closure.parts])
    caused = measured - np.concatenate(found.closure.after)
    every = slice(None, None, max(measured.size // MARKS, 1))
    figure, axes = panel_figure(3.1, 1, 2, margins=Margins(left=0.085, head=0.28), gaps={"wspace": 0.08}, share="xy")
    ends = [float(np.quantile(measured, q)) * KILO for q in (0.0005, 0.9995)]
    sides = ((given, "mech", upper(GIVEN)), (caused, "gen", upper(CAUSED)))
    for ax, letter, (predicted, colour, title) in zip(axes, "ab", sides, strict=True):
        ax.plot(ends, ends, color=COLOURS["soft"], lw=0.7)
        ax.plot(predicted[every] * KILO, measured[every] * KILO, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5)
        ax.set(xlim=ends, ylim=ends, xlabel="Predicted winch power (kW)")
        label_panel(ax, letter, title)
    axes[0].set_ylabel(f"{upper(word)} winch power (kW)")
    return figure


def closed_bars(found: LineDiagnosis) -> Figure | None:
    """Draw the squared error of sets of causes on held-out cycles, over that without any."""
    sets, every = (
        list(dict.fromkeys([(), *((cause.effect,) for cause in found.causes), found.chosen, found.lines.names])),
        found.lines.names,
    )
    figure, (ax,) = panel_figure(0.5 + 0.34 * len(sets), margins=Margins(left=0.3, head=0.06, foot=0.4))
    for row, names in enumerate(sets):
        left = 100.0 * found.choice.error(names)
        ax.barh(row, left, height=0.6, color=COLOURS["gen" if names == found.chosen else "loss"], lw=0)
        ax.text(left + 1.0, row, f"{left:.1f} %", va="center", fontsize=7.5)
    ax.set(
        yticks=range(len(sets)), ylim=(len(sets) - 0.45, -0.55), xlim=(0.0, 112.0),
        yticklabels=[
            f"all {len(names)} suspects" if names == every and len(names) > 2
            else broken(set_words(names), LABEL) if names else "no cause"
            for names in sets
        ],
        xlabel="Squared error on held-out cycles (%)",
    )  # fmt: skip
    ax.grid(False, axis="y")
    return figure


def power_by_cycle(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the root mean square of the error in every judged cycle, by the line alone and with the causes."""
    if found.closure is None:
        return None
    parts = found.closure.parts
    errors = [
        (part.gap[part.cycle == cycle], after[part.cycle == cycle])
        for part, after in zip(parts, found.closure.after, strict=True)
        for cycle in np.unique(part.cycle)
    ]
    if len(errors) < 2:
        return None
    before, left = np.array([[KILO * np.sqrt(np.mean(x**2)) for x in pair] for pair in errors]).T
    x = np.arange(len(errors)) + (int(parts[0].cycle.min()) if len(parts) == 1 else 1)
    figure, (ax,) = panel_figure(1.9, margins=Margins(left=0.085, head=0.26))
    ax.vlines(x, left, before, color=COLOURS["loss"], lw=2.0)
    ax.plot(x, before, ls="none", ms=4.0, mew=1.0, **HOLLOW)
    ax.plot(x, left, ls="none", ms=4.0, **FILLED)
    ax.set(
        ylim=(0.0, None), xlabel="Cycle" if len(parts) == 1 else "Cycle, one after the other", ylabel="RMS error (kW)",
    )  # fmt: skip
    ax.grid(False, axis="x")
    given = line_entry(f"{word} − {GIVEN}", "mech", ls="none", ms=4.0, **HOLLOW)
    legend_above(figure, [given, line_entry(f"{word} − predicted {CAUSED}", ls="none", ms=4.0, **FILLED)])
    return figure
