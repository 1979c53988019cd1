"""Figure of one cycle over time: every channel as logged and as simulated, with the residual below (Figs 11 and 12)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.cycle_histories import AXES, TIME, CycleHistory, panel_channels
from winchcascade.report.diagnosis_figures import AFTER, DASHES
from winchcascade.report.model_figures import legend_above, line_entry, patch_entry
from winchcascade.report.own_simulation_words import baseline_words
from winchcascade.report.style import COLOURS, wide_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis

ABOVE, BELOW, APART, TITLE = 0.86, 0.4, 0.07, 0.3
"""Heights of the panel of a channel and of its residual, between the two, and of the title of the channel. [in]"""

HEAD, FOOT = 0.25, 0.42
"""Room above and below the panels. [in]"""

LINES: tuple[dict[str, Any], ...] = (
    {"color": COLOURS["ink"], "lw": 0.8},
    {"color": COLOURS["mech"], "lw": 1.0, "ls": DASHES},
    {"color": COLOURS["gen"], "lw": 1.2},
)
"""Styles of what is logged, given, and with the fitted effects."""


def histories_figure(found: ModelDiagnosis, item: CycleHistory, word: str) -> Figure:
    """Draw one cycle; the parts that a page exchanges have names: `trace-PANEL-LINE`, `span-PANEL`, `xaxis-`, `yaxis-`."""
    channels = panel_channels(found)
    height = HEAD + FOOT + (TITLE + ABOVE + APART + BELOW) * len(channels)
    figure, top = wide_figure(height), height - HEAD
    for n, name in enumerate(channels):
        title, unit, factor = AXES[name]
        k = CHANNELS.index(name)
        top -= TITLE + ABOVE
        above = figure.add_axes((0.1, top / height, 0.885, ABOVE / height))
        top -= APART + BELOW
        below = figure.add_axes((0.1, top / height, 0.885, BELOW / height), sharex=above)
        curves = [x[:, k] * factor for x in item.sides]
        _panel(above, 2 * n, item, list(zip(curves, LINES, range(3), strict=False)))
        residuals = [curves[0] - simulated for simulated in curves[1:]]
        _panel(below, 2 * n + 1, item, list(zip(residuals, LINES[1:], (1, 2), strict=False)))
        below.axhline(0.0, color=COLOURS["soft"], lw=0.5, gid=f"zero-{2 * n + 1}")
        above.set_title(f"({'abcde'[n]}) {title}", loc="left", pad=3)
        above.set_ylabel(unit)
        below.set_ylabel(f"residual\n({unit})", fontsize=6.5)
        above.tick_params(labelbottom=False)
        if n < len(channels) - 1:
            below.tick_params(labelbottom=False)
        else:
            below.set_xlabel(TIME)
    simulated = [line_entry(baseline_words(found), "mech", lw=1.0, ls=DASHES), line_entry(AFTER, "gen", lw=1.2)]
    entries = [
        line_entry(word, "ink", lw=0.8),
        *simulated[: len(item.sides) - 1],
        patch_entry("payout", "payout", lw=0),
    ]
    legend_above(figure, entries)
    for ax in figure.axes:
        ax.yaxis.set_label_coords(-0.07, 0.5)
    return figure


def _panel(ax: Axes, number: int, item: CycleHistory, lines: list[tuple[Signal, dict[str, Any], int]]) -> None:
    """Draw curves over time, the first one on top, with the payout shaded."""
    ax.axvspan(0.0, item.payout_end, color=COLOURS["payout"], lw=0, zorder=0.1, gid=f"span-{number}")
    for values, style, line in lines:
        ax.plot(item.t, values, gid=f"trace-{number}-{line}", zorder=3.0 - 0.1 * line, **style)
    ax.set_xlim(item.t[0], item.t[-1])
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.tick_params(axis="y", labelsize=6.5)
    ax.xaxis.set_gid(f"xaxis-{number}")
    ax.yaxis.set_gid(f"yaxis-{number}")
