"""Figures of the gap of a diagnosis: maps by channel and phase, one cycle over time, channels
and errors over speed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.explain.figure_data import SimulatedCycle, by_load
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT, PHASES
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.report.diagnosis_names import (
    NAMES,
    baseline_words,
    phase_words,
    signed,
)
from winchcascade.report.figures.histories import (
    Curve,
    History,
    Mark,
    Panel,
    repaired_spans,
    thinned,
)
from winchcascade.report.figures.style import (
    COLOURS,
    Dashes,
    Entry,
    LineStyle,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.glossary import CHANNELS as TERMS
from winchcascade.report.glossary import typeset, upper
from winchcascade.report.wording import load_words
from winchcascade.rig.stages import STAGES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AFTER = "with the fitted effects"
"""Name of the simulation with the causes in every legend."""

HOLLOW: LineStyle = {
    "ls": "none",
    "marker": "o",
    "ms": 3.2,
    "mew": 0.7,
    "mfc": "none",
    "color": COLOURS["mech"],
}
FILLED: LineStyle = {"ls": "none", "marker": "s", "ms": 3.0, "mew": 0.0, "color": COLOURS["gen"]}

MARKED = {"before": HOLLOW, "after": FILLED}
"""Marks of values before and after."""


def coloured(mark: LineStyle, colour: str) -> LineStyle:
    """The same mark in another colour."""
    found = mark.copy()
    found["color"] = COLOURS[colour]
    return found


DASHES: Dashes = (0, (4, 1.2))
"""Dashes of a line before the causes."""

BAND = 1.96
"""Half width of a band of 95 %, in standard deviations."""


def quantity_label(channel: str) -> str:
    """Name and unit of a channel for an axis."""
    return f"{upper(NAMES[channel])} ({typeset(TERMS[channel].unit)})"


# -------------------------------------------------------------------------------- maps of the gap
FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST, WEAKEST = 0.75, 0.18
"""Opacity of the full colour, under which its number can still be read, and of a cell that is
just significant.
"""

Cells = Mapping[tuple[str, str, int], float]
"""Numbers of standard uncertainties by channel or stage, phase and log."""


def gap_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard
    uncertainty.
    """
    names = {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in CHANNELS for p in PHASES}
    return _map(found, names, {(p.channel, p.phase, p.log): p.z for p in found.places})


def stage_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each stage's output, from its own inputs, by phase (rows) and load
    (columns), as `gap_map`.
    """
    ends = {p.stage: p.channel for p in found.stages}
    names = {
        (s, p): f"{s}: {NAMES[ends[s]]}, {phase_words(p)}"
        for s in STAGES
        if s in ends
        for p in PHASES
    }
    return _map(found, names, {(p.stage, p.phase, p.log): p.z for p in found.stages})


def _map(
    found: ModelDiagnosis, names: Mapping[tuple[str, str], str], cells: Cells
) -> Figure | None:
    rows = {key[:2] for key in cells}
    if not rows:
        return None
    figure, (ax,) = panel_figure(0.3 + 0.235 * len(rows))
    _draw_map(ax, _by_load(found), names, cells)
    return figure


def _by_load(found: ModelDiagnosis) -> dict[int, str]:
    """Numbers of the logs in order of their loads, with the load, and which of its logs one is."""
    logs = by_load(found)
    loads = [load_words(found.data.logs[k].run.load) for k in logs]
    return {
        log: f"{load} ({loads[:k].count(load) + 1})" if loads.count(load) > 1 else load
        for k, (log, load) in enumerate(zip(logs, loads, strict=True))
    }


def _draw_map(
    ax: Axes, columns: Mapping[int, str], names: Mapping[tuple[str, str], str], cells: Cells
) -> None:
    """Draw the numbers as a matrix of colours, a column for each log; a row without a cell is
    left out.
    """
    rows = [row for row in names if any(key[:2] == row for key in cells)]
    for i, (kind, phase) in enumerate(rows):
        for j, log in enumerate(columns):
            if (kind, phase, log) in cells:
                _cell(ax, i, j, cells[kind, phase, log])
        if i and kind != rows[i - 1][0]:
            ax.axhline(i - 0.5, color=COLOURS["soft"], lw=0.6)
    ax.set_xticks(range(len(columns)), list(columns.values()))
    ax.set_yticks(range(len(rows)), [names[row] for row in rows])
    ax.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.grid(False)
    ax.spines[:].set_visible(False)


def _cell(ax: Axes, i: int, j: int, z: float) -> None:
    """Colour one cell by its sign and its size, and write its number."""
    beyond = abs(z) > STANDS_OUT
    colour = "hold" if not beyond else "above" if z > 0.0 else "below"
    alpha = max(STRONGEST * min(abs(z) / FULL, 1.0), WEAKEST) if beyond else 1.0
    ax.fill(
        [j - 0.48, j + 0.48, j + 0.48, j - 0.48], [i - 0.46, i - 0.46, i + 0.46, i + 0.46],
        color=COLOURS[colour], alpha=alpha, lw=0,
    )  # fmt: skip
    weight = "bold" if beyond else "normal"
    ax.text(
        j,
        i,
        signed(z),
        ha="center",
        va="center",
        fontsize=7.0,
        fontweight=weight,
        color=COLOURS["ink"],
    )


# -------------------------------------------------------------------------------------- over time
def cycle_history(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> History:
    """The channels of one cycle as logged, by the model of the rig file, and with the fitted
    effects, later ones above.

    Parameters
    ----------
    word : what the logs are called
    """
    run = found.data.logs[item.log].run
    here, count = [name for name in CHANNELS if name in run.channels], len(item.sides)
    full = [
        side[:, CHANNELS.index(name)] * TERMS[name].factor for name in here for side in item.sides
    ]
    t, curves = thinned(item.t, full)
    looks = ((word, "ink", "-"), (baseline_words(found), "mech", DASHES), (AFTER, "gen", "-"))
    ends = [
        np.clip(span, t[0], t[-1]).tolist() for span in repaired_spans(run, CHANNELS, item.onset)
    ]
    repaired = [(begin, end) for begin, end in ends if begin < end]
    panels = []
    for k, name in enumerate(here):
        drawn = zip(looks, curves[k * count : (k + 1) * count], strict=False)
        lines = [Curve(label, curve, colour, dashes) for (label, colour, dashes), curve in drawn]
        panels.append(Panel(upper(NAMES[name]), typeset(TERMS[name].unit), lines, repaired))
    return History(
        t,
        "Time since the onset of the payout (s)",
        panels,
        [Mark("payout", "payout", [(0.0, item.payout_end)])],
    )


def _side_entries(found: ModelDiagnosis, colour: str = "") -> list[Entry]:
    """Entries of a legend for the simulation before and, where there are causes, after."""
    names = [baseline_words(found), *([AFTER] if found.causes else [])]
    marks = [coloured(mark, colour) if colour else mark for mark in MARKED.values()]
    return [line_entry(name, **mark) for name, mark in zip(names, marks, strict=False)]


# ---------------------------------------------------------------------------------------- Fig 18b
OVER_SPEED = ("torque", "vdc")
"""Channels whose errors are drawn over generator speed; others over themselves."""


def error_figure(found: ModelDiagnosis, table: pd.DataFrame, word: str) -> Figure | None:
    """Draw errors before and after with the band of noise: of current and channel of the gap
    (Fig. 18b).
    """
    own = found.where.worst.channel if found.where is not None else ""
    panels = [channel for channel in dict.fromkeys(("idc", own)) if channel in {*table.channel}]
    if not panels:
        return None
    figure, axes = panel_figure(2.6, 1, len(panels))
    for letter, ax, channel in zip("ab", axes, panels, strict=False):
        phases = (PAYOUT, HAUL_IN) if channel in ("force", "pressure") else (PAYOUT,)
        blocks, factor = (
            table[(table.channel == channel) & table.phase.isin(phases)],
            TERMS[channel].factor,
        )
        half = BAND * float(blocks.noise.median()) * factor
        ax.axhspan(-half, half, color=COLOURS["loss"], alpha=0.6, lw=0, zorder=0.5)
        at = blocks.rpm if channel in OVER_SPEED else blocks.logged * factor
        for side, mark in MARKED.items():
            ax.plot(at, (blocks.logged - blocks[side]) * factor, alpha=0.8, **mark)
        title = f"{upper(word)} − simulated, {NAMES[channel]}"
        ax.set_title(f"({letter}) {title}" if len(panels) > 1 else title)
        over = "Generator speed (rpm)" if channel in OVER_SPEED else quantity_label(channel)
        ax.set(xlabel=over, ylabel=f"Difference ({typeset(TERMS[channel].unit)})")
    legend_above(
        figure,
        [*_side_entries(found), patch_entry("noise, 95 % in the middle", "loss", alpha=0.6, lw=0)],
    )
    return figure
