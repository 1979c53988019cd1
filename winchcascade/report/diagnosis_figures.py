"""Figures of a diagnosis over time, speed and current: before and after the named causes (Figs 18a to 18d)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.diagnosis.block_means import BLOCK
from winchcascade.diagnosis.gap_location import NAMES
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
from winchcascade.report.diagnosis_map import AFTER, BEFORE, entries
from winchcascade.report.diagnosis_names import load_words
from winchcascade.report.model_account import COMPARED
from winchcascade.report.model_figures import legend_above, shade_over_speed
from winchcascade.report.style import COLOURS, LOAD_COLOURS, WIDTH, label_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.diagnose import Diagnosis
    from winchcascade.report.diagnosis_data import Curve, Series

LONGEST = 150.0
"""So much of a log is drawn over time at most. [s]"""

SMALL = 2.4
"""Size of markers where there are many."""

HALF = 0.5 * BLOCK
"""Half a block. [s]"""

SURE = 2.0
"""Half width of the band of noise, in standard deviations."""


def history(found: Diagnosis, both: Sides, log: int, word: str) -> Figure | None:
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


def _phases(ax: Axes, one: Series, shown: Any) -> None:
    """Shade the payouts."""
    for a, b in stretches((one.phase == OUT) & shown):
        ax.axvspan(one.t[a] - HALF, one.t[b - 1] + HALF, color=COLOURS["payout"], lw=0, zorder=0.1)


def _over_time(ax: Axes, one: Series, shown: Any, factor: float) -> None:
    t = one.t[shown]
    band = SURE * one.noise[shown] * factor
    ax.fill_between(t, -band, band, color=COLOURS["loss"], alpha=0.6, lw=0, zorder=0.5, step="mid")
    ax.plot(t, ((one.logged - one.before) * factor)[shown], color=COLOURS["mech"], lw=1.0)
    if one.after is not None:
        ax.plot(t, ((one.logged - one.after) * factor)[shown], color=COLOURS["gen"], lw=1.0)
    ax.margins(x=0.005)
    ax.ticklabel_format(axis="y", useOffset=False)


def _history_entries(*, after: bool) -> list[tuple[Any, str]]:
    found: list[tuple[Any, str]] = [(Line2D([], [], color=COLOURS["mech"], lw=1.2), BEFORE)]
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


def over_speed_figure(found: Diagnosis, both: Sides, word: str) -> Figure | None:
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
    _speed_legend(figure, found, logs, colours, word, after=both.after is not None, shaded=shaded)
    return figure


def _three(ax: Axes, curve: Curve, colour: str) -> None:
    """Draw the log as a line, the rig as given as open circles and with the causes as filled squares."""
    ax.plot(curve.rpm, curve.logged, color=colour, lw=1.2)
    ax.plot(curve.rpm, curve.before, ls="none", marker="o", ms=3.4, mew=0.8, mfc="none", mec=colour)
    if curve.after is not None:
        ax.plot(curve.rpm, curve.after, ls="none", marker="s", ms=SMALL, mew=0, color=colour)


def _speed_legend(
    figure: Figure, found: Diagnosis, logs: list[int], colours: list[str], word: str, *, after: bool, shaded: bool
) -> None:
    ink = COLOURS["ink"]
    kinds: list[tuple[Any, str]] = [
        (Line2D([], [], color=ink, lw=1.2), word),
        (Line2D([], [], ls="none", marker="o", ms=3.4, mfc="none", mec=ink, mew=0.8), BEFORE),
    ]
    if after:
        kinds.append((Line2D([], [], ls="none", marker="s", ms=SMALL, color=ink), AFTER))
    if shaded:
        kinds.append((Rectangle((0, 0), 1, 1, fc=COLOURS["over"], ec=COLOURS["soft"], lw=0.4), "over rated speed"))
    legend_above(figure, kinds)
    loads = [
        (Line2D([], [], color=COLOURS[c], lw=1.2), load_words(found.data.logs[k].run.load))
        for c, k in zip(colours, logs, strict=False)
    ]
    legend_above(figure, loads, line=1)


# ------------------------------------------------------------------------------------------------------------- Fig 18b
class Against(NamedTuple):
    """What the error of which channel is drawn over: a channel, or the generator's speed."""

    channel: str
    over: str
    label: str


def error_panels(found: Diagnosis) -> list[Against]:
    """Errors that are drawn: of the current over the current, and of the channel in which the gap lies over its best ruler."""
    seen = seen_channels(found)
    panels = [Against("idc", "idc", "Idc (A)")] if "idc" in seen and loaded(found) else []
    channel = found.where.channel if found.where is not None else ""
    if channel in seen and channel != "idc":
        panels.append(
            Against(channel, "", "Generator speed (rpm)")
            if channel in ("torque", "vdc")
            else Against(channel, channel, f"{NAMES[channel][0].upper()}{NAMES[channel][1:]} ({COMPARED[channel][0]})")
        )
    return panels


def error_figure(found: Diagnosis, both: Sides, word: str) -> Figure | None:
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
        _title(
            ax, "ab"[n] if len(panels) > 1 else "", f"{word[0].upper()}{word[1:]} − simulated, {NAMES[panel.channel]}"
        )
        ax.set_xlabel(panel.label)
        ax.set_ylabel(COMPARED[panel.channel][0])
    legend: list[tuple[Any, str]] = [*entries()[: 2 if both.after is not None else 1]]
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


def _errors(ax: Axes, found: Diagnosis, both: Sides, panel: Against) -> None:
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


def _moving(one: Series, panel: Against) -> Any:
    """Blocks of the payouts; of force and pressure those of the haul-ins too."""
    out = one.phase == OUT
    return out | (one.phase == HAUL_IN) if panel.channel in ("force", "pressure") else out


def _joined(parts: list[Signal]) -> Signal:
    return np.concatenate(parts) if parts else np.zeros(0)
