"""Figures of a diagnosis that count in standard uncertainties: the map of the gap, and how far each channel is closed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter

from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_location import NAMES, STANDS_OUT
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.diagnosis_data import by_load
from winchcascade.report.diagnosis_names import load_words, phase_words
from winchcascade.report.digits import MINUS
from winchcascade.report.model_figures import legend_above
from winchcascade.report.style import COLOURS, WIDTH
from winchcascade.rig.stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

    from winchcascade.diagnosis.diagnose import Diagnosis
    from winchcascade.diagnosis.gap_map import Place

FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST = 0.75
"""Opacity of the full colour, under which its number can still be read."""

MARK = 5.0

BEFORE, AFTER = "rig as given", "with the fitted effects"
"""What the two sides are called in every legend."""


def gap_map(found: Diagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard uncertainty."""
    cells = {(p.channel, p.phase, p.log): p.z for p in found.places}
    return _matrix(found, {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in CHANNELS for p in PHASES}, cells, left=0.19)


def stage_map(found: Diagnosis) -> Figure | None:
    """Draw the bias of each stage's output, from its own inputs, by phase (rows) and load (columns), as `gap_map`."""
    cells = {(p.stage, p.phase, p.log): p.z for p in found.stages}
    ends = {p.stage: p.channel for p in found.stages}
    rows = {(s, p): f"{s}: {NAMES[ends[s]]}, {phase_words(p)}" for s in STAGES if s in ends for p in PHASES}
    return _matrix(found, rows, cells, left=0.275)


def _matrix(
    found: Diagnosis, names: Mapping[tuple[str, str], str], cells: Mapping[tuple[str, str, int], float], *, left: float
) -> Figure | None:
    """Draw numbers of standard uncertainties as a matrix of colours, a line between the rows of one kind and the next.

    Parameters
    ----------
    names : of the rows, by kind and phase; a row without a cell is left out
    cells : by kind, phase and log
    left : share of the width for the names
    """
    rows = [row for row in names if any(key[:2] == row for key in cells)]
    logs = by_load(found)
    if not rows:
        return None
    height = 0.3 + 0.235 * len(rows)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=left, right=0.985, top=1 - 0.24 / height, bottom=0.04 / height)
    for i, (kind, phase) in enumerate(rows):
        for j, log in enumerate(logs):
            if (kind, phase, log) in cells:
                _cell(ax, i, j, cells[kind, phase, log])
    ax.set_xticks(range(len(logs)), _load_labels(found, logs))
    ax.set_yticks(range(len(rows)), [names[row] for row in rows])
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.grid(False)
    for k in range(1, len(rows)):
        if rows[k][0] != rows[k - 1][0]:
            ax.axhline(k - 0.5, color=COLOURS["soft"], lw=0.6)
    ax.set_xlim(-0.5, len(logs) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    for side in ax.spines.values():
        side.set_visible(False)
    return figure


def _load_labels(found: Diagnosis, logs: list[int]) -> list[str]:
    """Loads of the logs, with a number where several have the same."""
    texts = [load_words(found.data.logs[k].run.load) for k in logs]
    return [f"{text} ({texts[:k].count(text) + 1})" if texts.count(text) > 1 else text for k, text in enumerate(texts)]


def _cell(ax: Axes, i: int, j: int, z: float) -> None:
    """Colour one cell by its sign and its size, and write its number."""
    stands_out = abs(z) > STANDS_OUT
    strength = STRONGEST * min(abs(z) / FULL, 1.0) if stands_out else 0.0
    colour = COLOURS["gen" if z > 0.0 else "mech"]
    ax.fill(
        [j - 0.48, j + 0.48, j + 0.48, j - 0.48], [i - 0.46, i - 0.46, i + 0.46, i + 0.46],
        color=colour if stands_out else COLOURS["hold"], alpha=max(strength, 0.18) if stands_out else 1.0, lw=0,
    )  # fmt: skip
    ax.text(
        j, i, signed(z), ha="center", va="center", fontsize=7.0, color=COLOURS["ink" if stands_out else "soft"],
        fontweight="bold" if stands_out else "normal",
    )  # fmt: skip


def signed(z: float) -> str:
    """A number of standard uncertainties, with one decimal below ten and no more than three digits.

    >>> signed(3.14), signed(-41.7), signed(1.0e4), signed(-0.04)
    ('+3.1', '−42', '> 999', '0.0')
    """
    if abs(z) > 999.0:
        return "> 999" if z > 0 else f"< {MINUS}999"
    if abs(z) < 0.05:
        return "0.0"
    text = f"{z:+.1f}" if abs(z) < 9.95 else f"{z:+.0f}"
    return text.replace("-", MINUS)


def closure_bars(found: Diagnosis) -> Figure | None:
    """Draw, channel by channel, how many times its noise the misfit is before and after; on logs that took no part."""
    if found.closure is None:
        return None
    shown = {name: x for name, x in found.closure.channels.items() if x.noise > 0.0}
    height = 0.8 + 0.235 * len(shown)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.12, right=0.985, top=1 - 0.3 / height, bottom=0.42 / height)
    for row, x in enumerate(shown.values()):
        before, after = x.before / x.noise, x.after / x.noise
        ax.plot([after, before], [row, row], color=COLOURS["loss"], lw=2.2, solid_capstyle="round", zorder=1)
        ax.plot([before], [row], "o", ms=MARK, mfc=COLOURS["paper"], mec=COLOURS["mech"], mew=1.1)
        ax.plot([after], [row], "s", ms=MARK, color=COLOURS["gen"])
    ax.axvline(1.0, color=COLOURS["ink"], lw=1.0, ls="--", zorder=0.9)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    low, high = ax.get_xlim()
    ax.set_xlim(min(low, 0.7), max(high, 3.0))
    ax.set_yticks(range(len(shown)), [NAMES[name] for name in shown])
    ax.set_ylim(len(shown) - 0.5, -0.5)
    ax.grid(False, axis="y")
    ax.set_xlabel("Root mean square of block means over their noise (1)")
    legend_above(figure, entries(noise_line=True))
    return figure


def entries(*, noise_line: bool = False) -> list[tuple[Line2D, str]]:
    """What before and after look like in every figure of a diagnosis."""
    found = [
        (Line2D([], [], ls="none", marker="o", ms=MARK, mfc=COLOURS["paper"], mec=COLOURS["mech"]), BEFORE),
        (Line2D([], [], ls="none", marker="s", ms=MARK, color=COLOURS["gen"]), AFTER),
    ]
    if noise_line:
        found.append((Line2D([], [], color=COLOURS["ink"], lw=0.8, ls="--"), "noise"))
    return found


def worst_first(found: Diagnosis) -> list[Place]:
    """Places of the map, those that stand out most first."""
    return sorted(found.places, key=lambda p: -abs(p.z) if np.isfinite(p.z) else 0.0)
