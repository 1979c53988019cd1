"""Figures of a diagnosis: maps of the gap, before and after the named causes over time, speed and current (Figs 18a to 18d)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.diagnosis.block_means import BLOCK, PHASES
from winchcascade.diagnosis.block_series import (
    HAUL_IN,
    OUT,
    Sides,
    means_over_speed,
    representative,
    seen_channels,
    series,
    stretches,
)
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_data import POWER
from winchcascade.diagnosis.model_account import COMPARED
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.stator_current import by_load, loaded, rated_dc_current
from winchcascade.report.digits import upper
from winchcascade.report.figures.style import (
    COLOURS,
    LOAD_COLOURS,
    Dashes,
    Entry,
    LineStyle,
    Margins,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
    shade_over_speed,
)
from winchcascade.report.gap_words import NAMES, baseline_words, phase_words, signed
from winchcascade.report.wording import load_words
from winchcascade.rig.stages import STAGES

FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST = 0.75
"""Opacity of the full colour, under which its number can still be read."""

MARK = 5.0

AFTER = "with the fitted effects"
"""Names of the two sides in every legend."""

HOLLOW: LineStyle = {"marker": "o", "mfc": COLOURS["paper"], "mec": COLOURS["mech"]}
FILLED: LineStyle = {"marker": "s", "color": COLOURS["gen"]}
"""Marks of values before and after."""

NOISE: LineStyle = {"color": COLOURS["loss"], "alpha": 0.6, "lw": 0}
"""Band of noise."""

DASHES: Dashes = (0, (4, 1.2))


def gap_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard uncertainty."""
    return _matrix(found, *_gaps(found), left=0.19)


def draw_gap_map(ax: Axes, found: DiagnosisResult) -> None:
    """Draw the map of `gap_map` on given axes; without a model, the gap of all logs together by phase."""
    names, cells = _gaps(found)
    columns = _by_load(found) if isinstance(found, ModelDiagnosis) else {-1: "all logs"}
    _draw_matrix(ax, columns, [row for row in names if any(key[:2] == row for key in cells)], names, cells)


def _gaps(found: DiagnosisResult) -> tuple[dict[tuple[str, str], str], dict[tuple[str, str, int], float]]:
    """Names of the rows of the map of the gap, by channel and phase, and its cells, by channel, phase and log."""
    channels = CHANNELS if isinstance(found, ModelDiagnosis) else (POWER,)
    rows = {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in channels for p in PHASES}
    return rows, {(p.channel, p.phase, p.log): p.z for p in found.places}


def stage_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each stage's output, from its own inputs, by phase (rows) and load (columns), as `gap_map`."""
    ends = {p.stage: p.channel for p in found.stages}
    rows = {(s, p): f"{s}: {NAMES[ends[s]]}, {phase_words(p)}" for s in STAGES if s in ends for p in PHASES}
    return _matrix(found, rows, {(p.stage, p.phase, p.log): p.z for p in found.stages}, left=0.275)


def _matrix(
    found: ModelDiagnosis,
    names: Mapping[tuple[str, str], str],
    cells: Mapping[tuple[str, str, int], float],
    *,
    left: float,
) -> Figure | None:
    """Draw numbers of standard uncertainties as a matrix of colours, a line between the rows of one kind and the next.

    Parameters
    ----------
    names : of the rows, by kind and phase; a row without a cell is left out
    cells : by kind, phase and log
    left : share of the width for the names
    """
    rows = [row for row in names if any(key[:2] == row for key in cells)]
    if not rows:
        return None
    figure, (ax,) = panel_figure(0.3 + 0.235 * len(rows), margins=Margins(left=left, head=0.24, foot=0.04))
    _draw_matrix(ax, _by_load(found), rows, names, cells)
    return figure


def _by_load(found: ModelDiagnosis) -> dict[int, str]:
    """Numbers of the logs in order of their loads, with the load, and which of its logs one is."""
    logs = by_load(found)
    loads = [load_words(found.data.logs[k].run.load) for k in logs]
    return {
        log: f"{load} ({loads[:k].count(load) + 1})" if loads.count(load) > 1 else load
        for k, (log, load) in enumerate(zip(logs, loads, strict=True))
    }


def _draw_matrix(
    ax: Axes,
    columns: Mapping[int, str],
    rows: Sequence[tuple[str, str]],
    names: Mapping[tuple[str, str], str],
    cells: Mapping[tuple[str, str, int], float],
) -> None:
    """Draw the rows of a matrix on given axes, a column with its name for each log."""
    for i, (kind, phase) in enumerate(rows):
        for j, log in enumerate(columns):
            if (kind, phase, log) in cells:
                _cell(ax, i, j, cells[kind, phase, log])
    for i in (k for k in range(1, len(rows)) if rows[k][0] != rows[k - 1][0]):
        ax.axhline(i - 0.5, color=COLOURS["soft"], lw=0.6)
    ax.set(
        xticks=range(len(columns)), yticks=range(len(rows)), yticklabels=[names[row] for row in rows],
        xticklabels=list(columns.values()), xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5),
    )  # fmt: skip
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.grid(False)
    ax.spines[:].set_visible(False)


def _cell(ax: Axes, i: int, j: int, z: float) -> None:
    """Colour one cell by its sign and its size, and write its number."""
    beyond = abs(z) > STANDS_OUT
    ax.fill(
        [j - 0.48, j + 0.48, j + 0.48, j - 0.48], [i - 0.46, i - 0.46, i + 0.46, i + 0.46],
        color=COLOURS["hold" if not beyond else "above" if z > 0.0 else "below"], lw=0,
        alpha=max(STRONGEST * min(abs(z) / FULL, 1.0), 0.18) if beyond else 1.0,
    )  # fmt: skip
    ax.text(
        j, i, signed(z), ha="center", va="center", fontsize=7.0, color=COLOURS["ink" if beyond else "soft"],
        fontweight="bold" if beyond else "normal",
    )  # fmt: skip


def _before_and_after(found: ModelDiagnosis, *, after: bool) -> list[Entry]:
    """Entries of a legend for marks before and, if there are any, after."""
    entries = [
        line_entry(baseline_words(found), "mech", ls="none", ms=MARK, **HOLLOW),
        line_entry(AFTER, ls="none", ms=MARK, **FILLED),
    ]
    return entries if after else entries[:1]


# ---------------------------------------------------------------------------------------- over time
LONGEST = 150.0
"""Length of a log that is drawn over time, at most. [s]"""

SMALL = 2.4
"""Size of markers where there are many."""

BAND = 2.0
"""Half width of the band of noise, in standard deviations."""

EDGE = 0.007
"""Distance of level labels from the left edge of the figure, as a share of its width."""


def history(found: ModelDiagnosis, both: Sides, log: int, word: str) -> Figure | None:
    """Draw logged minus simulated of every channel of one log, block by block, before and after, with the band of its noise."""
    own = [c for c in seen_channels(found) if found.data.logs[log].noise.seen[:, CHANNELS.index(c)].any()]
    if not own:
        return None
    height = 0.75 + 0.9 * len(own)
    margins = Margins(left=0.17, head=0.33, foot=0.4)
    figure, axes = panel_figure(height, len(own), margins=margins, gaps={"hspace": 0.16}, share="x")
    left, right = margins.edges
    for ax, channel in zip(axes, own, strict=True):
        one = series(found, both, log, channel)
        shown = one.t <= one.t[0] + LONGEST
        unit, factor = COMPARED[channel]
        for a, b in stretches((one.phase == OUT) & shown):
            ax.axvspan(one.t[a] - 0.5 * BLOCK, one.t[b - 1] + 0.5 * BLOCK, color=COLOURS["payout"], lw=0, zorder=0.1)
        band = BAND * one.noise[shown] * factor
        ax.fill_between(one.t[shown], -band, band, zorder=0.5, step="mid", **NOISE)
        for error, colour in zip(one.errors, ("mech", "gen"), strict=False):
            ax.plot(one.t[shown], (error * factor)[shown], color=COLOURS[colour], lw=1.0)
        ax.margins(x=0.005)
        ax.ticklabel_format(axis="y", useOffset=False)
        ax.set_ylabel(f"{upper(NAMES[channel])}\n({unit})", rotation=0, ha="left", va="center")
        ax.yaxis.set_label_coords((EDGE - left) / (right - left), 0.5)
    axes[-1].set_xlabel("Time (s)")
    entries = [line_entry(baseline_words(found), "mech", lw=1.2), line_entry(AFTER, "gen", lw=1.2)][: len(one.errors)]
    entries += [patch_entry("noise, 95 %", "loss", alpha=0.6, lw=0), patch_entry("payout", "payout", lw=0)]
    legend_above(figure, entries)
    figure.text(0.985, 1 - 0.1 / height, f"{word} − simulated", ha="right", va="center", fontsize=7.5)
    return figure


# ------------------------------------------------------------------------------------------------------ Figs 18a, c, d
PANELS = (
    ("Current of the DC link", "A", ("idc",)),
    ("Torque of the PTO shaft", "N·m", ("torque",)),
    ("Power at the DC link", "W", ("vdc", "idc")),
)
"""Quantities over generator speed: title, unit, and the channel or the two whose product it is."""


def over_speed_figure(found: ModelDiagnosis, both: Sides, word: str) -> Figure | None:
    """Draw current, torque and power over generator speed at three loads (Figs 18a, 18c, 18d).

    The log is a line, the model of the rig file open circles, and the model with the causes filled squares.
    """
    logs = representative(found)
    panels = [panel for panel in PANELS if {*panel[2]} <= {*seen_channels(found)}]
    if not panels or not logs or found.rig.rpm_per_velocity is None:
        return None
    figure, axes = panel_figure(3.1, 1, len(panels), margins=Margins(left=0.075, head=0.66), gaps={"wspace": 0.33})
    colours = dict(zip(logs, (LOAD_COLOURS[k] for k in (1, 3, 5)), strict=False))
    rated, shaded = found.rig.generator.speed_rated, False
    marks: tuple[LineStyle, ...] = (
        {"ls": "none", "marker": "o", "ms": 3.4, "mew": 0.8, "mfc": "none"},
        {"ls": "none", "marker": "s", "ms": SMALL, "mew": 0},
    )
    for n, (ax, (title, unit, channels)) in enumerate(zip(axes, panels, strict=True)):
        for k, colour in colours.items():
            rpm, logged, *simulated = means_over_speed([series(found, both, k, channel) for channel in channels])
            ax.plot(rpm, logged, color=COLOURS[colour], lw=1.2)
            for values, mark in zip(simulated, marks, strict=False):
                ax.plot(rpm, values, color=COLOURS[colour], **mark)
        ax.set(xlim=(0.0, None), ylim=(0.0, None))
        shaded |= shade_over_speed(ax, None if rated is None else rated.value * 30.0 / math.pi)
        label_panel(ax, "abc"[n], title, x="Generator speed (rpm)", unit=unit)
    legend_above(
        figure,
        [
            line_entry(word, lw=1.2),
            *(
                line_entry(name, **mark)
                for name, mark in zip(
                    (baseline_words(found), AFTER)[: 2 if both.after is not None else 1], marks, strict=False
                )
            ),
            *([patch_entry("over rated speed", "over")] if shaded else []),
        ],
    )
    legend_above(figure, [line_entry(load_words(found.runs[k].load), c, lw=1.2) for k, c in colours.items()], line=1)
    return figure


# ------------------------------------------------------------------------------------------------------------- Fig 18b
def error_panels(found: ModelDiagnosis) -> list[str]:
    """Channels whose errors are drawn: the current over the current, and that of the gap over what it depends on."""
    current = "idc" if loaded(found) else ""
    own = found.where.worst.channel if found.where is not None and found.where.worst.channel != "idc" else ""
    return [channel for channel in (current, own) if channel in seen_channels(found)]


OVER_SPEED = ("torque", "vdc")
"""Channels whose errors are drawn over generator speed; others over themselves."""


def error_figure(found: ModelDiagnosis, both: Sides, word: str) -> Figure | None:
    """Draw errors over the current, or over what they depend on, before and after, with the band of noise (Fig. 18b)."""
    panels = error_panels(found)
    if not panels:
        return None
    figure, axes = panel_figure(2.5, 1, len(panels), margins=Margins(right=0.972, head=0.5), gaps={"wspace": 0.26})
    rated = rated_dc_current(found) if panels[0] == "idc" else None
    for n, (ax, channel) in enumerate(zip(axes, panels, strict=True)):
        _errors(ax, found, both, channel)
        if channel == "idc" and rated is not None and rated < ax.get_xlim()[1]:
            ax.axvline(rated, color=COLOURS["soft"], lw=0.8, ls="--")
        title, unit = f"{upper(word)} − simulated, {NAMES[channel]}", COMPARED[channel][0]
        ax.set_title(f"({'ab'[n]}) {title}" if len(panels) > 1 else title, loc="left", pad=3)
        own = f"{upper(NAMES[channel])} ({unit})"
        ax.set(xlabel="Generator speed (rpm)" if channel in OVER_SPEED else own, ylabel=f"Difference ({unit})")
    noise = patch_entry("noise, 95 % in the middle", "loss", alpha=0.6, lw=0)
    current = [line_entry("rated stator current", "soft", lw=0.8, ls="--")] if rated is not None else []
    legend_above(figure, [*_before_and_after(found, after=both.after is not None), noise, *current])
    return figure


def _errors(ax: Axes, found: ModelDiagnosis, both: Sides, channel: str) -> None:
    """Draw the blocks of the payouts of all logs; of force and pressure those of the haul-ins too."""
    factor, columns = COMPARED[channel][1], []
    phases = (OUT, HAUL_IN) if channel in ("force", "pressure") else (OUT,)
    for k in loaded(found) if channel == "idc" else by_load(found):
        one = series(found, both, k, channel)
        ruler = one.rpm if channel in OVER_SPEED else one.logged * factor
        column = np.array([ruler, one.noise * factor, *(error * factor for error in one.errors)])
        columns.append(column[:, np.isin(one.phase, phases) & np.isfinite(one.logged)])
    at, noise, before, *after = np.concatenate(columns, axis=1)
    if not at.size:
        return
    half = BAND * float(np.median(noise))
    ax.axhspan(-half, half, zorder=0.5, **NOISE)
    ax.plot(at, before, ls="none", marker="o", ms=SMALL, mew=0.5, mfc="none", mec=COLOURS["mech"], alpha=0.8)
    for values in after:
        ax.plot(at, values, ls="none", marker="s", ms=1.9, mew=0, color=COLOURS["gen"], alpha=0.8)
