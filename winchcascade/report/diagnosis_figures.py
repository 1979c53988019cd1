"""Figures of a diagnosis: maps of the gap, before and after the named causes over time, speed and current (Figs 18a to 18d)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, NullFormatter

from winchcascade.diagnosis.block_means import BLOCK, PHASES
from winchcascade.diagnosis.gap_location import STANDS_OUT
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
from winchcascade.report.diagnosis_words import NAMES, set_words, upper
from winchcascade.report.digits import MINUS
from winchcascade.report.model_account import COMPARED
from winchcascade.report.model_figures import Entry, legend_above, shade_over_speed
from winchcascade.report.style import COLOURS, LOAD_COLOURS, WIDTH, label_panel
from winchcascade.rig.stages import STAGES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import Names
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.line.line_data import CyclePart
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.reduction.bins import Mask
    from winchcascade.report.diagnosis_data import Series, SpeedCurve

FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST = 0.75
"""Opacity of the full colour, under which its number can still be read."""

MARK = 5.0

BEFORE, AFTER = "rig as given", "with the fitted effects"
"""What the two sides are called in every legend."""


def gap_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard uncertainty."""
    cells = {(p.channel, p.phase, p.log): p.z for p in found.places}
    return _matrix(found, {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in CHANNELS for p in PHASES}, cells, left=0.19)


def stage_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each stage's output, from its own inputs, by phase (rows) and load (columns), as `gap_map`."""
    cells = {(p.stage, p.phase, p.log): p.z for p in found.stages}
    ends = {p.stage: p.channel for p in found.stages}
    rows = {(s, p): f"{s}: {NAMES[ends[s]]}, {phase_words(p)}" for s in STAGES if s in ends for p in PHASES}
    return _matrix(found, rows, cells, left=0.275)


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


def _load_labels(found: ModelDiagnosis, logs: list[int]) -> list[str]:
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


def closure_bars(found: ModelDiagnosis) -> Figure | None:
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


def entries(*, noise_line: bool = False) -> list[Entry]:
    """What before and after look like in every figure of a diagnosis."""
    found = [
        (Line2D([], [], ls="none", marker="o", ms=MARK, mfc=COLOURS["paper"], mec=COLOURS["mech"]), BEFORE),
        (Line2D([], [], ls="none", marker="s", ms=MARK, color=COLOURS["gen"]), AFTER),
    ]
    if noise_line:
        found.append((Line2D([], [], color=COLOURS["ink"], lw=0.8, ls="--"), "noise"))
    return found


def worst_first(found: ModelDiagnosis) -> list[Place]:
    """Places of the map, those that stand out most first."""
    return sorted(found.places, key=lambda p: -abs(p.z) if np.isfinite(p.z) else 0.0)


# ---------------------------------------------------------------------------------------- over time
LONGEST = 150.0
"""So much of a log is drawn over time at most. [s]"""

SMALL = 2.4
"""Size of markers where there are many."""

HALF = 0.5 * BLOCK
"""Half a block. [s]"""

SURE = 2.0
"""Half width of the band of noise, in standard deviations."""


def history(found: ModelDiagnosis, both: Sides, log: int, word: str) -> Figure | None:
    """Draw what every channel of one log is off by, block by block, before and after, with the band of its noise."""
    own = [c for c in seen_channels(found) if found.data.logs[log].noise.seen[:, CHANNELS.index(c)].any()]
    if not own:
        return None
    height = 0.75 + 0.9 * len(own)
    figure = Figure((WIDTH, height))
    axes = figure.subplots(len(own), 1, sharex=True, squeeze=False)[:, 0]
    figure.subplots_adjust(left=0.14, right=0.985, top=1 - 0.33 / height, bottom=0.4 / height, hspace=0.16)
    for ax, channel in zip(axes, own, strict=True):
        one = series(found, both, log, channel)
        shown = one.t <= one.t[0] + LONGEST
        unit, factor = COMPARED[channel]
        _phases(ax, one, shown)
        _over_time(ax, one, shown, factor)
        ax.set_ylabel(f"{NAMES[channel]}\n({unit})", rotation=0, ha="left", va="center")
        ax.yaxis.set_label_coords(-0.163, 0.5)
    axes[-1].set_xlabel("Time (s)")
    legend_above(figure, _history_entries(after=both.after is not None))
    figure.text(0.985, 1 - 0.1 / height, f"{word} − simulated", ha="right", va="center", fontsize=7.5)
    return figure


def _phases(ax: Axes, one: Series, shown: Mask) -> None:
    """Shade the payouts."""
    for a, b in stretches((one.phase == OUT) & shown):
        ax.axvspan(one.t[a] - HALF, one.t[b - 1] + HALF, color=COLOURS["payout"], lw=0, zorder=0.1)


def _over_time(ax: Axes, one: Series, shown: Mask, factor: float) -> None:
    t = one.t[shown]
    band = SURE * one.noise[shown] * factor
    ax.fill_between(t, -band, band, color=COLOURS["loss"], alpha=0.6, lw=0, zorder=0.5, step="mid")
    ax.plot(t, ((one.logged - one.before) * factor)[shown], color=COLOURS["mech"], lw=1.0)
    if one.after is not None:
        ax.plot(t, ((one.logged - one.after) * factor)[shown], color=COLOURS["gen"], lw=1.0)
    ax.margins(x=0.005)
    ax.ticklabel_format(axis="y", useOffset=False)


def _history_entries(*, after: bool) -> list[Entry]:
    found: list[Entry] = [(Line2D([], [], color=COLOURS["mech"], lw=1.2), BEFORE)]
    if after:
        found.append((Line2D([], [], color=COLOURS["gen"], lw=1.2), AFTER))
    found.append((Rectangle((0, 0), 1, 1, fc=COLOURS["loss"], alpha=0.6, lw=0), "noise, 95 %"))
    found.append((Rectangle((0, 0), 1, 1, fc=COLOURS["payout"], lw=0), "payout"))
    return found


# ------------------------------------------------------------------------------------------------------ Figs 18a, c, d
class Panel(NamedTuple):
    """One quantity over generator speed: its title, its unit, and the channel or the two whose product it is."""

    title: str
    unit: str
    channel: str
    times: str = ""


PANELS = (
    Panel("Current of the DC link", "A", "idc"),
    Panel("Torque behind the clutch", "N·m", "torque"),
    Panel("Power at the DC link", "W", "vdc", "idc"),
)


def over_speed_figure(found: ModelDiagnosis, both: Sides, word: str) -> Figure | None:
    """Draw current, torque and power over generator speed at three loads (Figs 18a, 18c, 18d)."""
    seen, logs = seen_channels(found), representative(found)
    panels = [p for p in PANELS if p.channel in seen and (not p.times or p.times in seen)]
    if not panels or not logs or found.rig.rpm_per_velocity is None:
        return None
    height = 3.1
    figure = Figure((WIDTH, height))
    axes = figure.subplots(1, len(panels), squeeze=False, gridspec_kw={"wspace": 0.33})[0]
    figure.subplots_adjust(left=0.075, right=0.985, top=1 - 0.66 / height, bottom=0.42 / height)
    colours = [LOAD_COLOURS[k] for k in (1, 3, 5)]
    shaded = False
    for n, (ax, panel) in enumerate(zip(axes, panels, strict=True)):
        for colour, k in zip(colours, logs, strict=False):
            other = series(found, both, k, panel.times) if panel.times else None
            _three(ax, over_speed(series(found, both, k, panel.channel), other), COLOURS[colour])
        ax.set_xlim(left=0.0)
        ax.set_ylim(bottom=0.0)
        rated = found.rig.generator.speed_rated
        shaded |= shade_over_speed(ax, None if rated is None else rated.value * 30.0 / math.pi)
        ax.set_xlabel("Generator speed (rpm)")
        ax.set_ylabel(panel.unit)
        label_panel(ax, "abc"[n], panel.title)
    _speed_legend(figure, word, after=both.after is not None, shaded=shaded)
    loads: list[Entry] = [
        (Line2D([], [], color=COLOURS[c], lw=1.2), load_words(found.runs[k].load))
        for c, k in zip(colours, logs, strict=False)
    ]
    legend_above(figure, loads, line=1)
    return figure


def _three(ax: Axes, curve: SpeedCurve, colour: str) -> None:
    """Draw the log as a line, the rig as given as open circles and with the causes as filled squares."""
    ax.plot(curve.rpm, curve.logged, color=colour, lw=1.2)
    ax.plot(curve.rpm, curve.before, ls="none", marker="o", ms=3.4, mew=0.8, mfc="none", mec=colour)
    if curve.after is not None:
        ax.plot(curve.rpm, curve.after, ls="none", marker="s", ms=SMALL, mew=0, color=colour)


def _speed_legend(figure: Figure, word: str, *, after: bool, shaded: bool) -> None:
    ink = COLOURS["ink"]
    kinds: list[Entry] = [
        (Line2D([], [], color=ink, lw=1.2), word),
        (Line2D([], [], ls="none", marker="o", ms=3.4, mfc="none", mec=ink, mew=0.8), BEFORE),
    ]
    if after:
        kinds.append((Line2D([], [], ls="none", marker="s", ms=SMALL, color=ink), AFTER))
    if shaded:
        kinds.append((Rectangle((0, 0), 1, 1, fc=COLOURS["over"], ec=COLOURS["soft"], lw=0.4), "over rated speed"))
    legend_above(figure, kinds)


# ------------------------------------------------------------------------------------------------------------- Fig 18b
class Against(NamedTuple):
    """What the error of which channel is drawn over: a channel, or the generator's speed."""

    channel: str
    over: str
    label: str


def error_panels(found: ModelDiagnosis) -> list[Against]:
    """Errors that are drawn: of the current over the current, and of the channel in which the gap lies over its best ruler."""
    seen = seen_channels(found)
    panels = [Against("idc", "idc", "Idc (A)")] if "idc" in seen and loaded(found) else []
    channel = found.where.worst.channel if found.where is not None else ""
    if channel in seen and channel != "idc":
        panels.append(
            Against(channel, "", "Generator speed (rpm)")
            if channel in ("torque", "vdc")
            else Against(channel, channel, f"{upper(NAMES[channel])} ({COMPARED[channel][0]})")
        )
    return panels


def error_figure(found: ModelDiagnosis, both: Sides, word: str) -> Figure | None:
    """Draw errors over the current, or over what they depend on, before and after, with the band of noise (Fig. 18b)."""
    panels = error_panels(found)
    if not panels:
        return None
    height = 2.5
    figure = Figure((WIDTH, height))
    axes = figure.subplots(1, len(panels), squeeze=False, gridspec_kw={"wspace": 0.26})[0]
    figure.subplots_adjust(left=0.09, right=0.972, top=1 - 0.5 / height, bottom=0.42 / height)
    rated = rated_dc_current(found) if panels[0].channel == "idc" else None
    for n, (ax, panel) in enumerate(zip(axes, panels, strict=True)):
        _errors(ax, found, both, panel)
        if panel.over == "idc" and rated is not None and rated < ax.get_xlim()[1]:
            ax.axvline(rated, color=COLOURS["soft"], lw=0.8, ls="--")
        _title(ax, "ab"[n] if len(panels) > 1 else "", f"{upper(word)} − simulated, {NAMES[panel.channel]}")
        ax.set_xlabel(panel.label)
        ax.set_ylabel(COMPARED[panel.channel][0])
    legend: list[Entry] = [*entries()[: 2 if both.after is not None else 1]]
    legend.append((Rectangle((0, 0), 1, 1, fc=COLOURS["loss"], alpha=0.6, lw=0), "noise, 95 % in the middle"))
    if rated is not None:
        legend.append((Line2D([], [], color=COLOURS["soft"], lw=0.8, ls="--"), "rated stator current"))
    legend_above(figure, legend)
    return figure


def _title(ax: Axes, letter: str, text: str) -> None:
    """Write a title with a letter where there are several panels."""
    if letter:
        label_panel(ax, letter, text)
    else:
        ax.set_title(text, loc="left", pad=3)


def _errors(ax: Axes, found: ModelDiagnosis, both: Sides, panel: Against) -> None:
    """Draw the blocks in which the line moves, of all logs."""
    factor = COMPARED[panel.channel][1]
    before, after, x, noise = [], [], [], []
    for k in loaded(found) if panel.channel == "idc" else by_load(found):
        one = series(found, both, k, panel.channel)
        here = _moving(one, panel) & np.isfinite(one.logged)
        ruler = one.rpm if not panel.over else one.logged * COMPARED[panel.over][1]
        x.append(ruler[here])
        before.append(((one.logged - one.before) * factor)[here])
        noise.append((one.noise * factor)[here])
        after.append(
            np.full(int(here.sum()), np.nan) if one.after is None else ((one.logged - one.after) * factor)[here]
        )
    at, old, new, sd = (_joined(parts) for parts in (x, before, after, noise))
    if not at.size:
        return
    half = SURE * float(np.median(sd))
    ax.axhspan(-half, half, color=COLOURS["loss"], alpha=0.6, lw=0, zorder=0.5)
    ax.plot(at, old, ls="none", marker="o", ms=SMALL, mew=0.5, mfc="none", mec=COLOURS["mech"], alpha=0.8)
    if np.isfinite(new).any():
        ax.plot(at, new, ls="none", marker="s", ms=1.9, mew=0, color=COLOURS["gen"], alpha=0.8)


def _moving(one: Series, panel: Against) -> Mask:
    """Blocks of the payouts; of force and pressure those of the haul-ins too."""
    out: Mask = one.phase == OUT
    return out | (one.phase == HAUL_IN) if panel.channel in ("force", "pressure") else out


def _joined(parts: list[Signal]) -> Signal:
    return np.concatenate(parts) if parts else np.zeros(0)


# --------------------------------------------------------------------- of a winch without a model
GIVEN, CAUSED = "force times speed", "with the causes"

MARKS = 2500
"""So many samples are drawn over each other at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""So many cycles are drawn over time."""

KILO = 1e-3


class PowerCourse(NamedTuple):
    """The power of a stretch of one part over time, (k,) each: stamps [s], measured, as given and with the causes [W]."""

    t: Signal
    measured: Signal
    given: Signal
    caused: Signal | None


def course_of(part: CyclePart, after: Signal | None) -> PowerCourse:
    """The power of a whole part."""
    given = part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]
    measured = given + part.gap
    return PowerCourse(part.run.t[part.here], measured, given, None if after is None else measured - after)


def _cut(course: PowerCourse, begin: float, end: float) -> PowerCourse:
    inside = (course.t >= begin) & (course.t <= end)
    return PowerCourse(*(x if x is None else x[inside] for x in course))  # type: ignore[arg-type]  # the stamps are always there


def power_history(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the power of two cycles over time, with what is left below, and the largest haul-in of them enlarged."""
    part = found.lines.judged[0]
    course = course_of(part, None if found.closure is None else found.closure.after[0])
    cycles = np.unique(part.cycle)
    middle = cycles[max(cycles.size // 2 - 1, 0) :][:SHOWN]
    own = np.isin(part.cycle, middle)
    shown = _cut(course, float(course.t[own][0]), float(course.t[own][-1]))
    start = float(shown.t[0])
    about = float(shown.t[int(np.argmax(np.abs(shown.measured - shown.given)))])
    near = _cut(course, about - 0.5 * NEAR, about + 0.5 * NEAR)
    height = 4.5
    figure = Figure((WIDTH, height))
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0), wspace=0.17, hspace=0.12)
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.5 / height, bottom=0.42 / height)
    for column, (some, title) in enumerate(((shown, "Two cycles"), (near, "Where they differ most"))):
        upper = figure.add_subplot(grid[0, column])
        lower = figure.add_subplot(grid[1, column], sharex=upper)
        _powers(upper, some, start)
        _rests(lower, some, start)
        upper.tick_params(labelbottom=False)
        title = title if middle.size > 1 or column else "One cycle"
        label_panel(upper, "ab"[column], f"{title} of {part.run.name}" if not column else title)
        lower.set_xlabel("Time (s)")
        if not column:
            upper.set_ylabel("Winch power (kW)")
            lower.set_ylabel(f"{word} − predicted (kW)")
    legend_above(figure, _power_entries(word, caused=course.caused is not None))
    return figure


def _powers(ax: Axes, one: PowerCourse, start: float) -> None:
    ax.plot(one.t - start, one.given * KILO, color=COLOURS["mech"], lw=0.9, ls=(0, (4, 1.2)), zorder=3)
    if one.caused is not None:
        ax.plot(one.t - start, one.caused * KILO, color=COLOURS["gen"], lw=1.3)
    ax.plot(one.t - start, one.measured * KILO, color=COLOURS["ink"], lw=0.7)
    ax.margins(x=0.01)


def _rests(ax: Axes, one: PowerCourse, start: float) -> None:
    ax.plot(one.t - start, (one.measured - one.given) * KILO, color=COLOURS["mech"], lw=0.9, ls=(0, (4, 1.2)))
    if one.caused is not None:
        ax.plot(one.t - start, (one.measured - one.caused) * KILO, color=COLOURS["gen"], lw=1.0)
    ax.axhline(0.0, color=COLOURS["soft"], lw=0.6)


def _power_entries(word: str, *, caused: bool) -> list[Entry]:
    found: list[Entry] = [
        (Line2D([], [], color=COLOURS["ink"], lw=0.9), word),
        (Line2D([], [], color=COLOURS["mech"], lw=1.0, ls=(0, (4, 1.2))), GIVEN),
    ]
    return [*found, (Line2D([], [], color=COLOURS["gen"], lw=1.3), CAUSED)] if caused else found


def power_scatter(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, as given and with the causes, at samples spread over the judged cycles."""
    if found.closure is None:
        return None
    courses = [course_of(part, after) for part, after in zip(found.closure.parts, found.closure.after, strict=True)]
    measured, given = (np.concatenate([getattr(c, name) for c in courses]) for name in ("measured", "given"))
    caused = measured - np.concatenate(found.closure.after)
    every = max(measured.size // MARKS, 1)
    height = 3.1
    figure = Figure((WIDTH, height))
    axes = figure.subplots(1, 2, sharex=True, sharey=True, gridspec_kw={"wspace": 0.08})
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.28 / height, bottom=0.42 / height)
    low, high = (float(np.quantile(measured, q)) * KILO for q in (0.0005, 0.9995))
    sides = ((given, "mech", upper(GIVEN)), (caused, "gen", upper(CAUSED)))
    for ax, letter, (predicted, colour, title) in zip(axes, "ab", sides, strict=True):
        ax.plot([low, high], [low, high], color=COLOURS["soft"], lw=0.7)
        ax.plot(
            predicted[::every] * KILO, measured[::every] * KILO, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5
        )
        ax.set_xlim(low, high)
        ax.set_ylim(low, high)
        ax.set_xlabel("Predicted winch power (kW)")
        label_panel(ax, letter, title)
    axes[0].set_ylabel(f"{upper(word)} winch power (kW)")
    return figure


def sets_of(found: LineDiagnosis) -> list[Names]:
    """Sets that tell what each cause takes: none, each cause alone, the chosen ones, and all suspects."""
    chosen = found.chosen
    alone: list[Names] = [(cause.effect,) for cause in found.causes]
    return list(dict.fromkeys([(), *alone, chosen, found.lines.names]))


def closed_bars(found: LineDiagnosis) -> Figure | None:
    """Draw the squared error that sets of causes leave of cycles they did not know, over that without any."""
    sets = sets_of(found)
    height = 0.45 + 0.3 * len(sets)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.3, right=0.985, top=1 - 0.06 / height, bottom=0.4 / height)
    for row, names in enumerate(sets):
        left = 100.0 * found.choice.error(names)
        ax.barh(row, left, height=0.6, color=COLOURS["gen" if names == found.chosen else "loss"], lw=0)
        ax.text(left + 1.0, row, f"{left:.1f} %", va="center", fontsize=7.5)
    ax.set_yticks(range(len(sets)), [_label(found, names) for names in sets])
    ax.set_ylim(len(sets) - 0.45, -0.55)
    ax.set_xlim(0.0, 112.0)
    ax.grid(False, axis="y")
    ax.set_xlabel("Squared error left on cycles that the fit did not know (%)")
    return figure


def _label(found: LineDiagnosis, names: Names) -> str:
    if names == found.lines.names and len(names) > 2:
        return f"all {len(names)} suspects"
    return "no cause" if not names else set_words(names)


def power_by_cycle(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the root mean square of what is left in every judged cycle, as given and with the causes."""
    if found.closure is None:
        return None
    rows: list[tuple[int, float, float]] = []
    for part, after in zip(found.closure.parts, found.closure.after, strict=True):
        for cycle in np.unique(part.cycle):
            own = part.cycle == cycle
            rows.append(
                (len(rows) + 1, float(np.sqrt(np.mean(part.gap[own] ** 2))), float(np.sqrt(np.mean(after[own] ** 2))))
            )
    if len(rows) < 2:
        return None
    one = len({part.run.name for part in found.closure.parts}) == len(found.closure.parts) == 1
    first = int(found.closure.parts[0].cycle.min()) if one else 1
    number, before, left = (np.array(column) for column in zip(*rows, strict=True))
    height = 1.9
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.26 / height, bottom=0.42 / height)
    x = number + first - 1
    ax.vlines(x, left * KILO, before * KILO, color=COLOURS["loss"], lw=2.0)
    ax.plot(x, before * KILO, "o", ms=4.0, mfc=COLOURS["paper"], mec=COLOURS["mech"], mew=1.0)
    ax.plot(x, left * KILO, "s", ms=4.0, color=COLOURS["gen"])
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("Cycle" if one else "Cycle, one after the other")
    ax.set_ylabel("RMS error (kW)")
    ax.grid(False, axis="x")
    entries: list[Entry] = [
        (Line2D([], [], ls="none", marker="o", ms=4.0, mfc=COLOURS["paper"], mec=COLOURS["mech"]), f"{word} − {GIVEN}"),
        (Line2D([], [], ls="none", marker="s", ms=4.0, color=COLOURS["gen"]), f"{word} − predicted {CAUSED}"),
    ]
    legend_above(figure, entries)
    return figure
