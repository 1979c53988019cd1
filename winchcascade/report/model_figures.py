"""Figures of a log against its simulation, for one log and for all loads: log solid, simulation markers (Figs 11 to 17).

Also the loss budget as stacked bars: where the energy of the line goes, load by load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.report.digits import significant
from winchcascade.report.figures import dots, readable
from winchcascade.report.model_account import GROUPS, HAUL_IN, NOTHING, SHOWN, SPEED
from winchcascade.report.style import (
    COLOURS,
    LOAD_COLOURS,
    WIDTH,
    columns_within,
    label_panel,
    lines_within,
    text_width,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.report.model_account import ComparedCurve, LossBudget, Regression, Sweep

MARKS: tuple[Any, ...] = ("o", "s", "^", "D", "v", "P", "X")
"""Markers of the logs in the order of their loads."""

MOST_MARKS = 330
"""Markers in a row of panels, about at most: of several logs with many bins each has its turn."""

MARK_SIZE = 3.0

LINE = 0.17
"""Height of a line of a legend. [in]"""

_LETTERS = "abcdefgh"
_BACK: Any = (0, (2.5, 1.2))
"""Dashes of what is drawn of the haul-ins."""


class Drawn(NamedTuple):
    """One log in a figure: its name, its curves, colours of log and simulation, and the simulation's marker."""

    name: str
    curves: Mapping[str, ComparedCurve]
    log: str = "ink"
    simulated: str = "mech"
    mark: Any = "o"


Clouds = dict[str, tuple["Signal", "Signal"]]
"""Samples of a log that are drawn behind its curve, x and y, by the curve's name."""

Entry = tuple[Any, str]
"""What a legend shows, and its text."""


def by_load(names: Sequence[str], curves: Sequence[Mapping[str, ComparedCurve]]) -> list[Drawn]:
    """Give each of several loads a colour and a marker of its own; logs of one load share its name and look alike."""
    found = {name: load_style(k) for k, name in enumerate(dict.fromkeys(names))}
    return [Drawn(name, c, found[name][0], *found[name]) for name, c in zip(names, curves, strict=True)]


def load_style(k: int) -> tuple[str, Any]:
    """Colour and marker of the load at place k; where colours come again, the markers are others."""
    return LOAD_COLOURS[k % len(LOAD_COLOURS)], MARKS[(k + k // len(LOAD_COLOURS)) % len(MARKS)]


def given_names(drawn: Sequence[Drawn], names: Sequence[str]) -> list[str]:
    """Those of some names of which any log has a curve, in their order."""
    return [name for name in names if any(name in d.curves for d in drawn)]


def panels(
    drawn: Sequence[Drawn],
    names: Sequence[str],
    *,
    word: str,
    rated: float | None,
    clouds: Clouds | None = None,
    gear: float | None = None,
) -> Figure | None:
    """Draw curves of log and simulation, one panel for each name that any log has; None if no log has any.

    Parameters
    ----------
    names : of `model_account.SHOWN`
    word : what the logs are called
    rated : speed of the generator above which a panel over speed is shaded [rpm]
    gear : adds an axis above with the speed of the drum, which is slower by this
    """
    given = given_names(drawn, names)
    drawn = [d for d in drawn if any(name in d.curves for name in given)]
    if not given:
        return None
    columns = len(given) if len(given) <= 3 else 2
    rows = -(-len(given) // columns)
    named = 0 if len(drawn) == 1 else lines_within([name for _, name in _loads(drawn)])
    head = 0.24 + (0.01 + LINE * named if named else 0.0) + (0.32 if gear is not None else 0.22)
    height = head + rows * 2.15 - 0.1 + (0.6 if columns == 1 else 0.0)
    figure = Figure((WIDTH, height))
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    figure.subplots_adjust(
        left=0.09, right=0.972, top=1 - head / height, bottom=0.42 / height,
        wspace={1: 0.2, 2: 0.24, 3: 0.36}[columns], hspace=0.5,
    )  # fmt: skip
    shaded = False
    for ax, name, letter in zip(grid, given, _LETTERS if len(given) > 1 else ("",), strict=False):
        _panel(ax, letter, name, drawn, (clouds or {}).get(name), MOST_MARKS // columns)
        if "rpm" in SHOWN[name].over:
            ax.set_xlim(left=0.0)
            shaded |= shade_over_speed(ax, rated)
        if gear is not None:
            _add_drum_speed(ax, gear)
    for ax in grid[len(given) :]:
        ax.set_visible(False)
    _legend(figure, drawn, word=word, shaded=shaded, sampled=bool(clouds))
    return figure


def _panel(
    ax: Axes, letter: str, name: str, drawn: Sequence[Drawn], cloud: tuple[Signal, Signal] | None, most: int
) -> None:
    """Draw one quantity of all logs with so many markers at most."""
    shown = SHOWN[name]
    beside = (name, HAUL_IN) if name == "pressure_kgcm2" else (name,)
    curves = [(d, key, d.curves[key]) for d in drawn for key in beside if key in d.curves]
    short, unit = readable(shown.unit, *(np.array((*c.log, *c.simulated)) for _, _, c in curves))
    if cloud is not None:
        dots(ax, cloud[0], cloud[1] * short, COLOURS["soft"])
    step = max(1, -(-sum(len(c.x) for _, _, c in curves) // most))
    for k, (d, key, c) in enumerate(curves):
        ax.plot(c.x, np.array(c.log) * short, color=COLOURS[d.log], lw=1.2, ls=_BACK if key == HAUL_IN else "-")
        ax.plot(
            c.x, np.array(c.simulated) * short, ls="none", marker=d.mark, ms=MARK_SIZE, mew=0.7, mfc=COLOURS["paper"],
            mec=COLOURS[d.simulated], markevery=(k % step, step),
        )  # fmt: skip
    if letter:
        label_panel(ax, letter, shown.title)
    ax.set_xlabel(shown.over)
    ax.set_ylabel(f"{shown.symbol} ({unit})" if shown.symbol else unit if letter else f"{shown.title} ({unit})")
    if name == "resistance_ohm":
        ax.set_ylim(0.0, 1.12 * max(max(c.log + c.simulated) for _, _, c in curves))
    elif name == "eta_gen":
        low, high = ax.get_ylim()
        ax.set_ylim(max(low, 0.0), min(max(high, 0.9), 1.0))


def shade_over_speed(ax: Axes, rated: float | None) -> bool:
    """Shade what lies over the rated speed of the generator, if the axis extends that far; True if it does."""
    low, high = ax.get_xlim()
    if rated is None or rated >= high:
        return False
    ax.axvspan(max(rated, low), high, color=COLOURS["over"], lw=0, zorder=0.1)
    ax.set_xlim(low, high)
    return True


def _add_drum_speed(ax: Axes, gear: float) -> None:
    """Add an axis above a panel with the speed of the drum, which turns slower than the generator by the gear."""
    above = ax.secondary_xaxis(
        "top", functions=(lambda rpm: np.asarray(rpm) / gear, lambda rpm: np.asarray(rpm) * gear)
    )
    above.set_xlabel("Drum speed (rpm)")


# ---------------------------------------------------------------------------------------------------------- the legends
def _legend(figure: Figure, drawn: Sequence[Drawn], *, word: str, shaded: bool, sampled: bool) -> None:
    """Add the legend of lines, markers and shades above the panels; of several logs name each."""
    one = len(drawn) == 1
    line, mark, shape = (drawn[0].log, drawn[0].simulated, drawn[0].mark) if one else ("ink", "ink", "o")
    entries = [samples_entry(f"{word}, samples", "soft")] if sampled else []
    entries.append((Line2D([], [], color=COLOURS[line], lw=1.2), f"{word}, means" if sampled else word))
    entries.append((_key(mark, shape, ls="none"), "simulated, means" if sampled else "simulated"))
    if shaded:
        entries.append(patch_entry("over rated speed", "over"))
    legend_above(figure, entries)
    if not one:
        legend_above(figure, _loads(drawn), line=1)


def _loads(drawn: Sequence[Drawn]) -> list[Entry]:
    """One entry for each load, however many logs it has."""
    first = {d.name: d for d in reversed(drawn)}
    return [(_key(d.log, d.mark, lw=1.2), d.name) for d in reversed(first.values())]


def _key(colour: str, mark: Any, **style: Any) -> Line2D:
    """A marker as the panels show it, on its line if a style says so."""
    return Line2D(
        [], [], color=COLOURS[colour], marker=mark, ms=MARK_SIZE, mew=0.7, mfc=COLOURS["paper"], mec=COLOURS[colour],
        **style,
    )  # fmt: skip


def samples_entry(text: str, colour: str) -> Entry:
    """Entry of a legend for dots."""
    return Line2D([], [], ls="none", marker=".", ms=4, mew=0, color=COLOURS[colour], alpha=0.6), text


def patch_entry(text: str, colour: str) -> Entry:
    """Entry of a legend for a shade."""
    return Rectangle((0, 0), 1, 1, fc=COLOURS[colour], ec=COLOURS["soft"], lw=0.4), text


def legend_above(figure: Figure, entries: Sequence[Entry], *, line: int = 0) -> None:
    """Set a legend in one of the lines above the panels, as many entries in a line as there is room for."""
    handles, texts = zip(*entries, strict=True)
    figure.legend(
        handles, texts, loc="upper left", ncols=columns_within(texts), columnspacing=1.1, handlelength=2.0,
        bbox_to_anchor=(0.01, 1.0 - LINE * line / float(figure.get_figheight())), borderaxespad=0.1,
    )  # fmt: skip


# --------------------------------------------------------------------------------------------------- an open circuit
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
    ax.set_xlabel(SPEED)
    ax.set_ylabel("Line force (N)")
    legend_above(figure, entries)
    return figure


def back_emf_figure(fit: Regression, *, word: str) -> Figure:
    """Draw the DC voltage and the back-EMF of an open circuit over generator speed, with the line through zero (Fig. 12)."""
    figure = Figure((WIDTH, 2.6))
    left, right = figure.subplots(1, 2, gridspec_kw={"wspace": 0.24})
    figure.subplots_adjust(left=0.09, right=0.972, top=0.82, bottom=0.165)
    rpm, end = np.array(fit.rpm), 1.05 * max(fit.rpm)
    ends = np.array([0.0, end])
    right.fill_between(ends, 0.9 * fit.reference * ends, 1.1 * fit.reference * ends, color=COLOURS["payout"], lw=0)
    right.plot(ends, fit.reference * ends, color=COLOURS["soft"], ls=_DASHED, lw=0.9)
    right.plot(ends, fit.slope * ends, color=COLOURS["mech"], lw=0.9)
    for ax, letter, title, volt in (
        (left, "a", "Voltage of the DC link", fit.v_dc),
        (right, "b", "Back-EMF, line to line, rms", fit.v_ll),
    ):
        dots(ax, rpm, np.array(volt), COLOURS["ink"])
        ax.set_xlim(0.0, end)
        ax.set_ylim(bottom=0.0)
        ax.set_xlabel(SPEED)
        ax.set_ylabel("V")
        label_panel(ax, letter, title)
    right.text(
        0.04, 0.95, f"{fit.slope:.5f} V/rpm\n95 %: {fit.low:.5f} to {fit.high:.5f}\nR² = {fit.r2:.4f}",
        transform=right.transAxes, va="top", linespacing=1.4,
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


# ----------------------------------------------------------------------------------------------------- the loss budget
_LOOK = {
    "dc": ("gen", ""),
    "diodes": ("load6", "xx"),
    "copper": ("load5", ""),
    "damper": ("load4", ""),
    "windage": ("load4", "//"),
    "friction": ("load4", "\\\\"),
    "mesh": ("extra", ""),
    "clutch": ("extra", "//"),
    "shaft": ("extra", "xx"),
    "capacitor": ("gen", "//"),
    "inertia": ("loss", ""),
    "line": ("soft", "//"),
    "seal": ("soft", "\\\\"),
    "screw": ("soft", ""),
    "stored": ("load1", ""),
}
"""Colour and hatching of each group."""

LABELLED = 4.0
"""Narrower parts of a bar have no number in them. [%]"""

_BAR, _LANE, _PITCH = 0.52, -0.4, 0.42
"""Height of a bar, and the lane below it where the points of the log are, over the pitch of the bars; the pitch [in]."""

_BESIDE = 0.16
"""Room between the left edge, a label and its bar. [in]"""

_POINTS = {"gen": ("D", "DC link"), "mech": ("s", "shaft")}


def budget_bars(names: Sequence[str], budgets: Sequence[LossBudget], *, word: str) -> Figure:
    """Draw the simulated loss budget of each log in percent of the line's energy, and under it shares that the log gives.

    Parameters
    ----------
    names : what stands left of each bar, of one line or two
    """
    present = [g for g in GROUPS if any(abs(b.shares[g]) >= NOTHING for b in budgets)]
    entries = _entries(present, budgets, word)
    head, foot = 0.16 + 0.17 * -(-len(entries) // 7), 0.42
    height = head + foot + _PITCH * (len(names) + 0.1)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    widest = max(text_width(line) for name in names for line in name.split("\n"))
    figure.subplots_adjust(
        left=max(0.125, (widest + _BESIDE) / WIDTH), right=0.905, top=1 - head / height, bottom=foot / height
    )
    rows = [float(k) for k in reversed(range(len(names)))]
    for row, budget in zip(rows, budgets, strict=True):
        _bar(ax, row, budget, present)
        _shares(ax, row, budget)
    ax.set_yticks(rows, names)
    ax.set_ylim(-0.62, len(names) - 0.52)
    ax.set_xlim(min(0.0, *(100.0 * share for b in budgets for share in b.shares.values())), 100.0)
    ax.set_xlabel("Share of the line's energy in the window (%)")
    ax.grid(axis="y", visible=False)
    handles, texts = zip(*entries, strict=True)
    figure.legend(
        handles, texts, loc="upper left", ncols=7, bbox_to_anchor=(0.01, 1.0), borderaxespad=0.1, handlelength=1.5,
        columnspacing=1.0,
    )  # fmt: skip
    return figure


def _bar(ax: Axes, row: float, budget: LossBudget, present: Sequence[str]) -> None:
    """Stack the shares of one log from the DC link to the line; what is given back lies left of zero."""
    right = left = 0.0
    for name in present:
        (colour, hatch), begin = _LOOK[name], right
        for share in _parts(budget, name):
            at = right if share >= 0 else left + share
            ax.barh(row, abs(share), left=at, height=_BAR, fc=COLOURS[colour], hatch=hatch, ec=COLOURS["paper"], lw=0.5)
            right, left = (right + share, left) if share >= 0 else (right, left + share)
        share = right - begin
        if share >= LABELLED and name != "inertia":  # the stroke of the torque sensor goes through it
            ax.text(
                begin + share / 2, row, f"{share:.0f}" if share >= 10 else f"{share:.1f}", ha="center", va="center", fontsize=7,
                bbox={"boxstyle": "round,pad=0.12", "fc": COLOURS["paper"], "lw": 0},
            )  # fmt: skip
    ax.text(
        1.012, row, f"{significant(budget.line, 4)} J", transform=ax.get_yaxis_transform(), ha="left", va="center", fontsize=7.5
    )  # fmt: skip


def _parts(budget: LossBudget, name: str) -> Iterator[float]:
    """Share of a group; of the inertia that of the rotor and that of the drum, so that the torque sensor lies between. [%]"""
    share, drum = 100.0 * budget.shares[name], 100.0 * budget.drum / budget.line
    yield from (share - drum, drum) if name == "inertia" else (share,)


def _shares(ax: Axes, row: float, budget: LossBudget) -> None:
    """Mark what reaches the torque sensor: of the simulation a stroke across the bar; shaft and DC link of the log below it."""
    ax.plot([100.0 * budget.mech] * 2, [row - 0.5, row + 0.33], color=COLOURS["ink"], lw=1.1, zorder=4)
    whole = budget.log.get("line", 0.0)
    for stage, (mark, _) in _POINTS.items():
        if stage in budget.log and whole > 0:
            ax.plot(100.0 * budget.log[stage] / whole, row + _LANE, **_point(mark))


def _point(mark: str) -> dict[str, Any]:
    """Style of a point of the log."""
    return {
        "ls": "none", "marker": mark, "ms": 4.2, "mew": 0.9, "mfc": COLOURS["paper"], "mec": COLOURS["ink"], "zorder": 5,
        "clip_on": False,
    }  # fmt: skip


def _entries(present: Sequence[str], budgets: Sequence[LossBudget], word: str) -> list[Entry]:
    """What the legend names: the parts, then stroke and points."""
    entries: list[Entry] = [
        (Rectangle((0, 0), 1, 1, fc=COLOURS[colour], hatch=hatch, ec=COLOURS["paper"], lw=0.5), GROUPS[name].name)
        for name, (colour, hatch) in ((name, _LOOK[name]) for name in present)
    ]
    entries.append((Line2D([], [], color=COLOURS["ink"], lw=1.1), "shaft, simulated"))
    given = [stage for stage in _POINTS if any(stage in b.log for b in budgets)]
    marks = {stage: Line2D([], [], **_point(_POINTS[stage][0])) for stage in given}
    return entries + [(marks[stage], f"{_POINTS[stage][1]}, {word}") for stage in given]
