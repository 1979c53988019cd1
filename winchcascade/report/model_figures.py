"""Figures of a log against its simulation, for one log and for all loads: log solid, simulation markers (Figs 11 to 17).

Also the loss budget as stacked bars: where the energy of the line goes, load by load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.compared_curves import HAUL_IN, ComparedCurve
from winchcascade.diagnosis.damper_curves import FACTORS, DamperCurves
from winchcascade.diagnosis.loss_budget import GROUPS, LossBudget
from winchcascade.diagnosis.model_account import Regression, Sweep
from winchcascade.report.digits import significant
from winchcascade.report.figures.style import (
    COLOURS,
    LINE,
    LOAD_COLOURS,
    MARK_SIZE,
    MARKS,
    WIDTH,
    Dashes,
    Entry,
    LineStyle,
    Margins,
    axis_label,
    dots,
    figure_width,
    label_panel,
    legend_above,
    line_entry,
    lines_within,
    load_style,
    panel_figure,
    patch_entry,
    readable,
    samples_entry,
    shade_over_speed,
    text_width,
)

SPEED = "Generator speed (rpm)"


class Shown(NamedTuple):
    """How a quantity is shown: its title, its unit, what a caption states of its panel, the label of what it is drawn over, and
    a symbol for a bare axis.
    """

    title: str
    unit: str
    what: str
    over: str = SPEED
    symbol: str = ""


SHOWN = {
    "pressure_kgcm2": Shown(
        "Gas pressure, gauge", "kg/cm²", "gas pressure over displacement (haul-ins dashed)", "Line displacement (m)"
    ),
    "force_n": Shown(
        "Line tension", "N", "line tension over line velocity (haul-ins left of zero)", "Line velocity (m/s)"
    ),
    "power_gen_w": Shown("Power at the DC link", "W", "power at the DC link over generator speed"),
    "torque_nm": Shown("Torque of the PTO shaft", "N·m", "torque of the PTO shaft over generator speed"),
    "vdc_v": Shown("Voltage of the DC link", "V", "voltage of the DC link over generator speed"),
    "idc_a": Shown("Current of the DC link", "A", "current of the DC link over generator speed"),
    "resistance_ohm": Shown("Apparent resistance", "Ω", "apparent resistance Vdc / Idc over generator speed"),
    "loss_w": Shown(
        "Electrical-side loss",
        "W",
        "electrical-side loss P_mech − P_gen (Eq. 11 of Hsu et al. 2026) without stored energy over generator speed",
    ),
    "eta_gen": Shown(
        "Electrical-stage efficiency",
        "1",
        "efficiency of the electrical stage, mean P_gen over mean P_mech of each bin (Eq. 6) without stored energy over "
        "generator speed",
        symbol=r"$\eta_\mathrm{gen}$",
    ),
}
"""Curves by their name in written files, in the order of the paper's Figs 13 to 17."""

NOTHING = 5e-4
"""A share of the energy of the line below this is not named. [1]"""

MAX_MARKS = 330
"""Markers in a row of panels, about at most: of several logs with many bins each has its turn."""


MAX_DRAWN = 2000
"""Samples of a curve over time, about at most."""

_LETTERS = "abcdefgh"
_BACK: Dashes = (0, (2.5, 1.2))
"""Dashes of what is drawn of the haul-ins."""


class Drawn(NamedTuple):
    """One log in a figure: its name, its curves, colours of log and simulation, and the simulation's marker."""

    name: str
    curves: Mapping[str, ComparedCurve]
    log: str = "ink"
    simulated: str = "mech"
    mark: str = "o"


Clouds = dict[str, tuple["Signal", "Signal"]]
"""Samples of a log that are drawn behind its curve, x and y, by the curve's name."""


def styled_by_load(names: Sequence[str], curves: Sequence[Mapping[str, ComparedCurve]]) -> list[Drawn]:
    """Give each of several loads a colour and a marker of its own; logs of one load share its name and look alike."""
    found = {name: load_style(k) for k, name in enumerate(dict.fromkeys(names))}
    return [Drawn(name, c, found[name][0], *found[name]) for name, c in zip(names, curves, strict=True)]


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
    names : of `SHOWN`
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
    gaps = {"wspace": {1: 0.2, 2: 0.24, 3: 0.36}[columns], "hspace": 0.5}
    figure, grid = panel_figure(height, rows, columns, margins=Margins(right=0.972, head=head), gaps=gaps)
    shaded = False
    for ax, name, letter in zip(grid, given, _LETTERS if len(given) > 1 else ("",), strict=False):
        _panel(ax, letter, name, drawn, (clouds or {}).get(name), MAX_MARKS // columns)
        if "rpm" in SHOWN[name].over:
            ax.set_xlim(left=0.0)
            shaded |= shade_over_speed(ax, rated)
        if gear is not None:
            slower = (lambda rpm, gear=gear: np.asarray(rpm) / gear, lambda rpm, gear=gear: np.asarray(rpm) * gear)
            ax.secondary_xaxis("top", functions=slower).set_xlabel("Drum speed (rpm)")
    for ax in grid[len(given) :]:
        ax.set_visible(False)
    _legend(figure, drawn, word=word, shaded=shaded, sampled=bool(clouds))
    return figure


def _panel(
    ax: Axes, letter: str, name: str, drawn: Sequence[Drawn], cloud: tuple[Signal, Signal] | None, maximum: int
) -> None:
    """Draw one quantity of all logs with a maximum number of markers."""
    shown, keys = SHOWN[name], (name, HAUL_IN) if name == "pressure_kgcm2" else (name,)
    curves = [(d, key, d.curves[key]) for d in drawn for key in keys if key in d.curves]
    short, unit = readable(shown.unit, *(np.array((*c.log, *c.simulated)) for _, _, c in curves))
    if cloud is not None:
        dots(ax, cloud[0], cloud[1] * short, COLOURS["soft"])
    step = max(1, -(-sum(len(c.x) for _, _, c in curves) // maximum))
    for k, (d, key, c) in enumerate(curves):
        ax.plot(c.x, np.array(c.log) * short, color=COLOURS[d.log], lw=1.2, ls=_BACK if key == HAUL_IN else "-")
        ax.plot(
            c.x, np.array(c.simulated) * short, ls="none", mec=COLOURS[d.simulated], markevery=(k % step, step),
            **_mark(d.mark),
        )  # fmt: skip
    if letter:
        label_panel(ax, letter, shown.title)
    ax.set(xlabel=shown.over, ylabel=f"{shown.symbol} ({unit})" if shown.symbol else axis_label(shown.title, unit))
    if name == "resistance_ohm":
        ax.set_ylim(0.0, 1.12 * max(max(c.log + c.simulated) for _, _, c in curves))
    elif name == "eta_gen":
        low, high = ax.get_ylim()
        ax.set_ylim(max(low, 0.0), max(high, 0.9))


# ---------------------------------------------------------------------------------------------------------- the legends
def _legend(figure: Figure, drawn: Sequence[Drawn], *, word: str, shaded: bool, sampled: bool) -> None:
    """Add the legend of lines, markers and shades above the panels; of several logs name each."""
    one = drawn[0] if len(drawn) == 1 else Drawn("", {}, simulated="ink")
    legend_above(
        figure,
        [
            *([samples_entry(f"{word}, samples", "soft")] if sampled else []),
            line_entry(f"{word}, means" if sampled else word, one.log, lw=1.2),
            line_entry("simulated, means" if sampled else "simulated", one.simulated, ls="none", **_mark(one.mark)),
            *([patch_entry("over rated speed", "over")] if shaded else []),
        ],
    )
    if len(drawn) > 1:
        legend_above(figure, _loads(drawn), line=1)


def _loads(drawn: Sequence[Drawn]) -> list[Entry]:
    """One entry for each load, however many logs it has."""
    first = {d.name: d for d in reversed(drawn)}
    return [line_entry(d.name, d.log, lw=1.2, **_mark(d.mark)) for d in reversed(first.values())]


def _mark(mark: str) -> LineStyle:
    """Style of a marker of the simulation."""
    return {"marker": mark, "ms": MARK_SIZE, "mew": 0.7, "mfc": COLOURS["paper"]}


# --------------------------------------------------------------------------------------------------- an open circuit
def damper_sweep(sweep: Sweep, *, word: str, rated: float | None) -> Figure:
    """Draw the line tension in open circuit over generator speed, logged and simulated with several dampers (Fig. 11)."""
    figure, (ax,) = panel_figure(2.9, margins=Margins(right=0.972, head=0.29))
    entries: list[Entry] = [(ax.plot(sweep.rpm, sweep.log, color=COLOURS["ink"], lw=1.4)[0], word)]
    for k, (factor, force) in enumerate(zip(sweep.factors, sweep.simulated, strict=True)):
        (drawn,) = ax.plot(
            sweep.rpm, force, color=COLOURS[LOAD_COLOURS[k % len(LOAD_COLOURS)]], lw=0.5, **_mark(MARKS[k % len(MARKS)])
        )
        entries.append((drawn, {0.0: "no damper", 1.0: "as in the rig file"}.get(factor, f"{factor:g} ×")))
    ax.set(xlim=(0.0, None), xlabel=SPEED, ylabel="Line tension (N)")
    if shade_over_speed(ax, rated):
        entries.append(patch_entry("over rated speed", "over"))
    legend_above(figure, entries)
    return figure


def damper_histories(curves: DamperCurves, *, word: str) -> Figure:
    """Draw line velocity and tension of an open circuit over time, logged and simulated with several dampers (Fig. 11)."""
    labels = [
        "no damper"
        if damper == 0.0
        else f"{significant(damper)} N·m·s/rad, calibrated"
        if factor == 1.0
        else f"{factor:g} ×"
        for factor, damper in zip(FACTORS, curves.dampers, strict=True)
    ]
    rows = slice(None, None, -(-curves.run.samples // MAX_DRAWN))
    t = curves.run.t[rows] - curves.onset
    figure, (top, bottom) = panel_figure(
        4.2, 2, margins=Margins(right=0.972, head=0.46), gaps={"hspace": 0.2}, share="x"
    )
    label_panel(top, "a", "Line velocity", unit="m/s")
    label_panel(bottom, "b", "Line tension", x="Time from the onset (s)", unit="N")
    top.plot(t, curves.run.channels["velocity"][rows], color=COLOURS["ink"], lw=1.4)
    entries: list[Entry] = [(bottom.plot(t, curves.run.channels["force"][rows], color=COLOURS["ink"], lw=1.4)[0], word)]
    for k, (label, force) in enumerate(zip(labels, curves.forces, strict=True)):
        (drawn,) = bottom.plot(
            t, force[rows], color=COLOURS[LOAD_COLOURS[k]], lw=0.5, markevery=(k * t.size // 200, max(t.size // 40, 1)),
            **_mark(MARKS[k]),
        )  # fmt: skip
        entries.append((drawn, label))
    legend_above(figure, entries)
    return figure


def back_emf_figure(fit: Regression, *, word: str) -> Figure:
    """Draw the DC voltage and the back-EMF of an open circuit over generator speed, with the line through zero (Fig. 12)."""
    figure, (left, right) = panel_figure(2.6, 1, 2, margins=Margins(right=0.972, head=0.468), gaps={"wspace": 0.24})
    ends = np.array([0.0, 1.05 * max(fit.rpm)])
    rig: LineStyle = {"ls": (0, (5, 2)), "lw": 0.9}
    known = np.isfinite(fit.reference)
    if known:
        right.fill_between(ends, 0.9 * fit.reference * ends, 1.1 * fit.reference * ends, color=COLOURS["payout"], lw=0)
        right.plot(ends, fit.reference * ends, color=COLOURS["soft"], **rig)
    right.plot(ends, fit.slope * ends, color=COLOURS["mech"], lw=0.9)
    for ax, letter, title, volt in (
        (left, "a", "Voltage of the DC link", fit.v_dc),
        (right, "b", "Back-EMF, line to line, rms", fit.v_ll),
    ):
        dots(ax, np.array(fit.rpm), np.array(volt), COLOURS["ink"])
        ax.set(xlim=ends, ylim=(0.0, None))
        label_panel(ax, letter, title, x=SPEED, unit="V")
    right.text(
        0.04, 0.95, f"{fit.slope:.5f} V/rpm\n95 %: {fit.low:.5f} to {fit.high:.5f}\nR² = {fit.r2:.4f}",
        transform=right.transAxes, va="top", linespacing=1.4,
    )  # fmt: skip
    legend_above(
        figure,
        [
            samples_entry(f"{word}, samples used", "ink"),
            line_entry("line through zero", "mech", lw=0.9),
            *([line_entry("rig file", "soft", **rig), patch_entry("rig file ± 10 %", "payout")] if known else []),
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
"""Space between the left edge, a label and its bar. [in]"""

_POINTS = {"gen": ("D", "DC link"), "mech": ("s", "shaft")}


def budget_bars(names: Sequence[str], budgets: Sequence[LossBudget], *, word: str) -> Figure:
    """Draw the simulated loss budget of each log in percent of the line's energy, and under it shares that the log gives.

    Parameters
    ----------
    names : what stands left of each bar, of one line or two
    """
    present = [g for g in GROUPS if any(abs(b.shares[g]) >= NOTHING for b in budgets)]
    entries = [
        *(
            patch_entry(GROUPS[name].name, _LOOK[name][0], hatch=_LOOK[name][1], ec=COLOURS["paper"], lw=0.5)
            for name in present
        ),
        line_entry("shaft, simulated", lw=1.1),
        *(
            line_entry(f"{what}, {word}", marker=mark, **_POINT)
            for stage, (mark, what) in _POINTS.items()
            if any(stage in b.log for b in budgets)
        ),
    ]
    head, foot = 0.16 + 0.17 * -(-len(entries) // 7), 0.42
    widest = max(text_width(line) for name in names for line in name.split("\n"))
    height, left = head + foot + _PITCH * (len(names) + 0.1), max(0.125, (widest + _BESIDE) / WIDTH)
    figure, (ax,) = panel_figure(height, margins=Margins(left, 0.905, head, foot))
    rows = [float(k) for k in reversed(range(len(names)))]
    for row, budget in zip(rows, budgets, strict=True):
        _bar(ax, row, budget, present)
    lowest = min(0.0, *(100.0 * share for b in budgets for share in b.shares.values()))
    ax.set(
        yticks=rows, yticklabels=names, ylim=(-0.62, len(names) - 0.52), xlim=(lowest, 100.0),
        xlabel="Share of the line's energy in the window (%)",
    )  # fmt: skip
    ax.grid(axis="y", visible=False)
    handles, texts = zip(*entries, strict=True)
    figure.legend(
        handles, texts, loc="upper left", ncols=7, bbox_to_anchor=(0.01, 1.0), borderaxespad=0.1, handlelength=1.5,
        columnspacing=1.0,
    )  # fmt: skip
    return figure


def _bar(ax: Axes, row: float, budget: LossBudget, present: Sequence[str]) -> None:
    """Stack the shares of one log from the DC link to the line; what is given back lies left of zero.

    A stroke across the bar marks what reaches the simulated torque sensor, points below it shaft and DC link of the log.
    """
    drum, right, left = 100.0 * budget.drum / budget.line, 0.0, 0.0
    for name in present:
        (colour, hatch), begin, whole = _LOOK[name], right, 100.0 * budget.shares[name]
        for share in (whole - drum, drum) if name == "inertia" else (whole,):  # the torque sensor lies between the two
            at = right if share >= 0 else left + share
            ax.barh(row, abs(share), left=at, height=_BAR, fc=COLOURS[colour], hatch=hatch, ec=COLOURS["paper"], lw=0.5)
            right, left = (right + share, left) if share >= 0 else (right, left + share)
        share = right - begin
        if (
            share >= LABELLED * WIDTH / figure_width() and name != "inertia"
        ):  # the stroke of the torque sensor goes through it
            ax.text(
                begin + share / 2, row, f"{share:.0f}" if share >= 10 else f"{share:.1f}", ha="center", va="center", fontsize=7,
                bbox={"boxstyle": "round,pad=0.12", "fc": COLOURS["paper"], "lw": 0},
            )  # fmt: skip
    ax.text(
        1.012, row, f"{significant(budget.line, 4)} J", transform=ax.get_yaxis_transform(), ha="left", va="center", fontsize=7.5
    )  # fmt: skip
    ax.plot([100.0 * budget.mech] * 2, [row - 0.5, row + 0.33], color=COLOURS["ink"], lw=1.1, zorder=4)
    for stage, (mark, _) in _POINTS.items():
        if stage in budget.log and budget.log.get("line", 0.0) > 0:
            share = 100.0 * budget.log[stage] / budget.log["line"]
            ax.plot(share, row + _LANE, marker=mark, zorder=5, clip_on=False, **_POINT)


_POINT: LineStyle = {"color": COLOURS["ink"], "ls": "none", "ms": 4.2, "mew": 0.9, "mfc": COLOURS["paper"]}
"""Style of a point of the log."""
