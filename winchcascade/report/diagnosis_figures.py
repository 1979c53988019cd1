"""Figures of a diagnosis: maps of the gap, before and after the named causes over time, speed and current (Figs 18a to 18d)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

from winchcascade.diagnosis.block_means import BLOCK, PHASES
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Names, Place
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.diagnosis_data import (
    HAUL_IN,
    OUT,
    Sides,
    by_load,
    loaded,
    over_speed,
    rated_dc_current,
    representative,
    seen_channels,
    series,
    stretches,
)
from winchcascade.report.diagnosis_names import load_words, phase_words
from winchcascade.report.digits import MINUS
from winchcascade.report.gap_words import NAMES, baseline_words, upper
from winchcascade.report.line_words import set_words
from winchcascade.report.model_account import COMPARED
from winchcascade.report.model_figures import Entry, legend_above, line_entry, patch_entry, shade_over_speed
from winchcascade.report.style import COLOURS, LOAD_COLOURS, Room, label_panel, panel_figure, wide_figure
from winchcascade.rig.stages import STAGES

FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST = 0.75
"""Opacity of the full colour, under which its number can still be read."""

MARK = 5.0

AFTER = "with the fitted effects"
"""Names of the two sides in every legend."""

HOLLOW: dict[str, Any] = {"marker": "o", "mfc": COLOURS["paper"], "mec": COLOURS["mech"]}
FILLED: dict[str, Any] = {"marker": "s", "color": COLOURS["gen"]}
"""Marks of values before and after."""

NOISE: dict[str, Any] = {"color": COLOURS["loss"], "alpha": 0.6, "lw": 0}
"""Band of noise."""

DASHES: Any = (0, (4, 1.2))


def gap_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard uncertainty."""
    rows = {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in CHANNELS for p in PHASES}
    return _matrix(found, rows, {(p.channel, p.phase, p.log): p.z for p in found.places}, left=0.19)


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
    logs = by_load(found)
    if not rows:
        return None
    figure, (ax,) = panel_figure(0.3 + 0.235 * len(rows), room=Room(left=left, head=0.24, foot=0.04))
    for i, (kind, phase) in enumerate(rows):
        for j, log in enumerate(logs):
            if (kind, phase, log) in cells:
                _cell(ax, i, j, cells[kind, phase, log])
    for i in (k for k in range(1, len(rows)) if rows[k][0] != rows[k - 1][0]):
        ax.axhline(i - 0.5, color=COLOURS["soft"], lw=0.6)
    loads = [load_words(found.data.logs[k].run.load) for k in logs]
    ax.set(
        xticks=range(len(logs)), yticks=range(len(rows)), yticklabels=[names[row] for row in rows],
        xticklabels=[f"{x} ({loads[:k].count(x) + 1})" if loads.count(x) > 1 else x for k, x in enumerate(loads)],
        xlim=(-0.5, len(logs) - 0.5), ylim=(len(rows) - 0.5, -0.5),
    )  # fmt: skip
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.grid(False)
    ax.spines[:].set_visible(False)
    return figure


def _cell(ax: Axes, i: int, j: int, z: float) -> None:
    """Colour one cell by its sign and its size, and write its number."""
    beyond = abs(z) > STANDS_OUT
    ax.fill(
        [j - 0.48, j + 0.48, j + 0.48, j - 0.48], [i - 0.46, i - 0.46, i + 0.46, i + 0.46],
        color=COLOURS["hold" if not beyond else "gen" if z > 0.0 else "mech"], lw=0,
        alpha=max(STRONGEST * min(abs(z) / FULL, 1.0), 0.18) if beyond else 1.0,
    )  # fmt: skip
    ax.text(
        j, i, signed(z), ha="center", va="center", fontsize=7.0, color=COLOURS["ink" if beyond else "soft"],
        fontweight="bold" if beyond else "normal",
    )  # fmt: skip


def signed(z: float) -> str:
    """A number of standard uncertainties, with one decimal below ten and no more than three digits.

    >>> signed(3.14), signed(-41.7), signed(1.0e4), signed(-0.04)
    ('+3.1', '−42', '> 999', '0.0')
    """
    if abs(z) > 999.0:
        return "> 999" if z > 0 else f"< {MINUS}999"
    return ("0.0" if abs(z) < 0.05 else f"{z:+.1f}" if abs(z) < 9.95 else f"{z:+.0f}").replace("-", MINUS)


def closure_bars(found: ModelDiagnosis) -> Figure | None:
    """Draw, channel by channel, how many times its noise the misfit is before and after, on held-out logs."""
    if found.closure is None:
        return None
    shown = {name: x for name, x in found.closure.channels.items() if x.noise > 0.0}
    figure, (ax,) = panel_figure(0.8 + 0.235 * len(shown), room=Room(left=0.12))
    for row, x in enumerate(shown.values()):
        before, after = x.before / x.noise, x.after / x.noise
        ax.plot([after, before], [row, row], color=COLOURS["loss"], lw=2.2, solid_capstyle="round", zorder=1)
        ax.plot([before], [row], ls="none", ms=MARK, mew=1.1, **HOLLOW)
        ax.plot([after], [row], ls="none", ms=MARK, **FILLED)
    ax.axvline(1.0, color=COLOURS["ink"], lw=1.0, ls="--", zorder=0.9)
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    low, high = ax.get_xlim()
    ax.set(
        xlim=(min(low, 0.7), max(high, 3.0)), xlabel="Root mean square of block means over their noise (1)",
        yticks=range(len(shown)), yticklabels=[NAMES[name] for name in shown], ylim=(len(shown) - 0.5, -0.5),
    )  # fmt: skip
    ax.grid(False, axis="y")
    legend_above(figure, [*_before_and_after(found, after=True), line_entry("noise", "ink", lw=0.8, ls="--")])
    return figure


def _before_and_after(found: ModelDiagnosis, *, after: bool) -> list[Entry]:
    """Entries of a legend for marks before and, if there are any, after."""
    entries = [
        line_entry(baseline_words(found), "mech", ls="none", ms=MARK, **HOLLOW),
        line_entry(AFTER, ls="none", ms=MARK, **FILLED),
    ]
    return entries if after else entries[:1]


def worst_first(found: ModelDiagnosis) -> list[Place]:
    """Places of the map, those with the largest gap first."""
    return sorted(found.places, key=lambda p: -abs(p.z) if np.isfinite(p.z) else 0.0)


# ---------------------------------------------------------------------------------------- over time
LONGEST = 150.0
"""Length of a log that is drawn over time, at most. [s]"""

SMALL = 2.4
"""Size of markers where there are many."""

BAND = 2.0
"""Half width of the band of noise, in standard deviations."""


def history(found: ModelDiagnosis, both: Sides, log: int, word: str) -> Figure | None:
    """Draw logged minus simulated of every channel of one log, block by block, before and after, with the band of its noise."""
    own = [c for c in seen_channels(found) if found.data.logs[log].noise.seen[:, CHANNELS.index(c)].any()]
    if not own:
        return None
    height = 0.75 + 0.9 * len(own)
    room = Room(left=0.14, head=0.33, foot=0.4)
    figure, axes = panel_figure(height, len(own), room=room, gaps={"hspace": 0.16}, share="x")
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
        ax.set_ylabel(f"{NAMES[channel]}\n({unit})", rotation=0, ha="left", va="center")
        ax.yaxis.set_label_coords(-0.163, 0.5)
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
    figure, axes = panel_figure(3.1, 1, len(panels), room=Room(left=0.075, head=0.66), gaps={"wspace": 0.33})
    colours = dict(zip(logs, (LOAD_COLOURS[k] for k in (1, 3, 5)), strict=False))
    rated, shaded = found.rig.generator.speed_rated, False
    marks: tuple[dict[str, Any], ...] = (
        {"ls": "none", "marker": "o", "ms": 3.4, "mew": 0.8, "mfc": "none"},
        {"ls": "none", "marker": "s", "ms": SMALL, "mew": 0},
    )
    for n, (ax, (title, unit, channels)) in enumerate(zip(axes, panels, strict=True)):
        for k, colour in colours.items():
            rpm, logged, *simulated = over_speed(*(series(found, both, k, channel) for channel in channels))
            ax.plot(rpm, logged, color=COLOURS[colour], lw=1.2)
            for values, mark in zip(simulated, marks, strict=False):
                ax.plot(rpm, values, color=COLOURS[colour], **mark)
        ax.set(xlim=(0.0, None), ylim=(0.0, None))
        shaded |= shade_over_speed(ax, None if rated is None else rated.value * 30.0 / math.pi)
        label_panel(ax, "abc"[n], title, x="Generator speed (rpm)", y=unit)
    kinds = [
        line_entry(word, lw=1.2),
        *(
            line_entry(name, **mark)
            for name, mark in zip(
                (baseline_words(found), AFTER)[: 2 if both.after is not None else 1], marks, strict=False
            )
        ),
        *([patch_entry("over rated speed", "over")] if shaded else []),
    ]
    legend_above(figure, kinds)
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
    figure, axes = panel_figure(2.5, 1, len(panels), room=Room(right=0.972, head=0.5), gaps={"wspace": 0.26})
    rated = rated_dc_current(found) if panels[0] == "idc" else None
    for n, (ax, channel) in enumerate(zip(axes, panels, strict=True)):
        _errors(ax, found, both, channel)
        if channel == "idc" and rated is not None and rated < ax.get_xlim()[1]:
            ax.axvline(rated, color=COLOURS["soft"], lw=0.8, ls="--")
        title, unit = f"{upper(word)} − simulated, {NAMES[channel]}", COMPARED[channel][0]
        ax.set_title(f"({'ab'[n]}) {title}" if len(panels) > 1 else title, loc="left", pad=3)
        own = f"{upper(NAMES[channel])} ({unit})"
        ax.set(xlabel="Generator speed (rpm)" if channel in OVER_SPEED else own, ylabel=unit)
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


# --------------------------------------------------------------------- of a winch without a model
GIVEN, CAUSED = "line tension times speed", "with the causes"

MARKS = 2500
"""Samples that are drawn over each other, at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""Cycles that are drawn over time."""

KILO = 1e-3


def power_history(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the power of two cycles over time, with the residual below, and the largest gap of them enlarged."""
    part = found.lines.judged[0]
    t, given = part.run.t[part.here], part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]
    measured = given + part.gap
    caused = None if found.closure is None else measured - found.closure.after[0]
    cycles = np.unique(part.cycle)
    middle = cycles[max(cycles.size // 2 - 1, 0) :][:SHOWN]
    own = t[np.isin(part.cycle, middle)]
    shown = (t >= own[0]) & (t <= own[-1])
    about = t[shown][np.argmax(np.abs(part.gap[shown]))]
    near = (t >= about - 0.5 * NEAR) & (t <= about + 0.5 * NEAR)
    figure = wide_figure(4.5, Room(left=0.085, head=0.5))
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
    figure.axes[1].set_ylabel(f"{word} − predicted (kW)")
    with_causes = [line_entry(CAUSED, "gen", lw=1.3)] if caused is not None else []
    legend_above(figure, [line_entry(word, "ink", lw=0.9), line_entry(GIVEN, "mech", lw=1.0, ls=DASHES), *with_causes])
    return figure


def power_scatter(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, by the line alone and with the causes, at samples spread over the judged cycles."""
    if found.closure is None:
        return None
    given = np.concatenate(
        [
            part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]
            for part in found.closure.parts
        ]
    )
    measured = given + np.concatenate([part.gap for part in found.closure.parts])
    caused = measured - np.concatenate(found.closure.after)
    every = slice(None, None, max(measured.size // MARKS, 1))
    figure, axes = panel_figure(3.1, 1, 2, room=Room(left=0.085, head=0.28), gaps={"wspace": 0.08}, share="xy")
    ends = [float(np.quantile(measured, q)) * KILO for q in (0.0005, 0.9995)]
    sides = ((given, "mech", upper(GIVEN)), (caused, "gen", upper(CAUSED)))
    for ax, letter, (predicted, colour, title) in zip(axes, "ab", sides, strict=True):
        ax.plot(ends, ends, color=COLOURS["soft"], lw=0.7)
        ax.plot(predicted[every] * KILO, measured[every] * KILO, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5)
        ax.set(xlim=ends, ylim=ends, xlabel="Predicted winch power (kW)")
        label_panel(ax, letter, title)
    axes[0].set_ylabel(f"{upper(word)} winch power (kW)")
    return figure


def sets_of(found: LineDiagnosis) -> list[Names]:
    """Sets that show what each cause closes: none, each cause alone, the chosen ones, and all suspects."""
    return list(dict.fromkeys([(), *((cause.effect,) for cause in found.causes), found.chosen, found.lines.names]))


def closed_bars(found: LineDiagnosis) -> Figure | None:
    """Draw the squared error of sets of causes on held-out cycles, over that without any."""
    sets, every = sets_of(found), found.lines.names
    figure, (ax,) = panel_figure(0.45 + 0.3 * len(sets), room=Room(left=0.3, head=0.06, foot=0.4))
    for row, names in enumerate(sets):
        left = 100.0 * found.choice.error(names)
        ax.barh(row, left, height=0.6, color=COLOURS["gen" if names == found.chosen else "loss"], lw=0)
        ax.text(left + 1.0, row, f"{left:.1f} %", va="center", fontsize=7.5)
    ax.set(
        yticks=range(len(sets)), ylim=(len(sets) - 0.45, -0.55), xlim=(0.0, 112.0),
        yticklabels=[
            f"all {len(names)} suspects" if names == every and len(names) > 2 else set_words(names) if names else "no cause"
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
    figure, (ax,) = panel_figure(1.9, room=Room(left=0.085, head=0.26))
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
