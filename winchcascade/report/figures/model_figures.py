"""Drawings of logs against their simulations: curves by panels, and bars of the loss budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.diagnosis.explain.model_comparison import (
    GROUPS,
    HAUL_IN,
    ComparedCurve,
    LossBudget,
)
from winchcascade.report.content import (
    number_text,
)
from winchcascade.report.figures.style import (
    COLOURS,
    MARK_SIZE,
    Dashes,
    Entry,
    LineStyle,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
    readable,
    shade_over_speed,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPEED = "Generator speed (rpm)"


class Shown(NamedTuple):
    """How a quantity is shown: its title, its unit, what a caption states of its panel, and the
    label of what it is over.
    """

    title: str
    unit: str
    what: str
    over: str = SPEED


SHOWN = {
    "pressure_kgcm2": Shown(
        "Gas pressure, gauge", "kg/cm²", "gas pressure over displacement (haul-ins dashed)", "Line displacement (m)"
    ),
    "force_n": Shown("Line tension", "N", "line tension over line velocity (haul-ins left of zero)", "Line velocity (m/s)"),
    "power_gen_w": Shown("Power at the DC link", "W", "power at the DC link over generator speed"),
    "torque_nm": Shown("Torque of the PTO shaft", "N·m", "torque of the PTO shaft over generator "
                                                         "speed"),
    "vdc_v": Shown("Voltage of the DC link", "V", "voltage of the DC link over generator speed"),
    "idc_a": Shown("Current of the DC link", "A", "current of the DC link over generator speed"),
    "loss_w": Shown(
        "Electrical-side loss", "W",
        "electrical-side loss P_mech - P_gen (Eq. 11 of Hsu et al. 2026) without stored energy "
        "over generator speed",
    ),
    "eta_gen": Shown(
        "Efficiency, electrical side", "1",
        "efficiency of the electrical stage, mean P_gen over mean P_mech of each bin (Eq. 6) "
        "without stored energy over "
        "generator speed",
    ),
}  # fmt: skip
"""Curves by their name in written files, in the order of the paper's Figs 13 to 17."""

MAX_MARKS = 330
"""Markers in a row of panels, about at most: of several logs with many bins each has its turn."""

MAX_DRAWN = 2000
"""Samples of a curve over time, about at most."""

BACK: Dashes = (0, (2.5, 1.2))
"""Dashes of what is drawn of the haul-ins."""


class Drawn(NamedTuple):
    """One log in a figure: what it is called, its curves, and the look of its load."""

    name: str
    curves: Mapping[str, ComparedCurve]
    colour: str
    mark: str


def given_names(drawn: Sequence[Drawn], names: Sequence[str]) -> list[str]:
    """Those of some names of which any log has a curve, in their order."""
    return [name for name in names if any(name in d.curves for d in drawn)]


def panels(
    drawn: Sequence[Drawn],
    names: Sequence[str],
    *,
    word: str,
    rated: float | None,
    gear: float | None = None,
) -> Figure | None:
    """Draw curves of log and simulation, one panel for each name that any log has; None if no log
    has any.

    Parameters
    ----------
    names : of `SHOWN`
    word : what the logs are called
    rated : speed of the generator above which a panel over speed is shaded [rpm]
    gear : adds an axis above the torque with the speed of the drum, which is slower by this
    """
    given = given_names(drawn, names)
    drawn = [d for d in drawn if any(name in d.curves for name in given)]
    if not given:
        return None
    columns = len(given) if len(given) <= 3 else 2
    rows = -(-len(given) // columns)
    figure, grid = panel_figure(0.5 + 2.2 * rows + (0.6 if columns == 1 else 0.0), rows, columns)
    shaded = False
    for ax, name, letter in zip(grid, given, "abcdefgh", strict=False):
        if gear is not None and name == "torque_nm":
            slower = (
                lambda rpm, gear=gear: np.asarray(rpm) / gear,
                lambda rpm, gear=gear: np.asarray(rpm) * gear,
            )
            ax.secondary_xaxis("top", functions=slower).set_xlabel("Drum speed (rpm)")
        _panel(ax, letter if len(given) > 1 else "", name, drawn, MAX_MARKS // columns)
        if SHOWN[name].over == SPEED:
            ax.set_xlim(left=0.0)
            shaded |= shade_over_speed(ax, rated)
    for ax in grid[len(given) :]:
        ax.set_visible(False)
    _legend(figure, drawn, word=word, shaded=shaded)
    return figure


def _panel(ax: Axes, letter: str, name: str, drawn: Sequence[Drawn], maximum: int) -> None:
    """Draw one quantity of all logs with a maximum number of markers."""
    shown, keys = SHOWN[name], (name, HAUL_IN) if name == "pressure_kgcm2" else (name,)
    curves = [(d, key, d.curves[key]) for d in drawn for key in keys if key in d.curves]
    short, unit = readable(shown.unit, *(np.array((*c.log, *c.simulated)) for _, _, c in curves))
    step = max(1, -(-sum(len(c.x) for _, _, c in curves) // maximum))
    for k, (d, key, c) in enumerate(curves):
        ax.plot(
            c.x,
            np.array(c.log) * short,
            color=COLOURS[d.colour],
            lw=1.2,
            ls=BACK if key == HAUL_IN else "-",
        )
        ax.plot(
            c.x, np.array(c.simulated) * short, ls="none", mec=COLOURS[d.colour], markevery=(k % step, step),
            **_mark(d.mark),
        )  # fmt: skip
    ax.set(xlabel=shown.over, ylabel=f"{shown.title} ({unit})")
    if letter:
        label_panel(ax, letter, shown.title, unit="Efficiency (1)" if unit == "1" else unit)


def _legend(figure: Figure, drawn: Sequence[Drawn], *, word: str, shaded: bool) -> None:
    """Add the legend of lines, markers and shades above the panels, and name each load once."""
    entries = [
        line_entry(word, lw=1.2),
        line_entry("simulated", ls="none", **_mark(drawn[0].mark)),
        *([patch_entry("over rated speed", "over")] if shaded else []),
    ]
    loads = {d.name: line_entry(d.name, d.colour, lw=1.2, **_mark(d.mark)) for d in drawn}
    legend_above(figure, [*entries, *loads.values()])


def _mark(mark: str) -> LineStyle:
    """Style of a marker of the simulation."""
    return {"marker": mark, "ms": MARK_SIZE, "mew": 0.7, "mfc": COLOURS["paper"]}


# -------------------------------------------------------------------------------- the loss budget
SEGMENTS = 7
"""Segments of a bar, at most; the smallest are added up."""

OTHER = "other"

SEGMENT_COLOURS = ("gen", "load5", "load4", "extra", "load1", "line", "soft")
"""Colours of the segments in the order of `GROUPS`; the others added up have one of their own."""

NUMBERED = 4.0
"""Narrower parts of a bar have no number in them. [%]"""

POINTS = {"gen": ("D", "DC link"), "mech": ("s", "shaft")}
"""Marker and name of the shares that reach a stage."""


def segments_of(budgets: Sequence[LossBudget]) -> dict[str, list[float]]:
    """Shares of the line's energy by the groups that are largest in all budgets, and of all
    others together. [%]
    """
    every = {name: [100.0 * budget.shares[name] for budget in budgets] for name in GROUPS}
    ranked = sorted(every, key=lambda name: -sum(map(abs, every[name])))
    own = {*ranked[: SEGMENTS - 1]}
    found = {name: shares for name, shares in every.items() if name in own}
    rest = [shares for name, shares in every.items() if name not in own]
    return {**found, OTHER: [sum(each) for each in zip(*rest, strict=True)]}


def budget_bars(names: Sequence[str], budgets: Sequence[LossBudget], *, word: str) -> Figure:
    """Draw the simulated loss budget of each log in percent of the line's energy, and under it what
    reaches shaft and DC link.

    Parameters
    ----------
    names : what stands left of each bar
    """
    figure, (ax,) = panel_figure(0.9 + 0.45 * len(names))
    segments, rows = segments_of(budgets), np.arange(len(names))[::-1]
    right, left = np.zeros(len(names)), np.zeros(len(names))
    entries: list[Entry] = []
    for (name, shares), colour in zip(segments.items(), SEGMENT_COLOURS, strict=False):
        share = np.array(shares)
        begin = np.where(share >= 0.0, right, left + share)
        fill = "loss" if name == OTHER else colour
        bars = ax.barh(
            rows, abs(share), left=begin, height=0.5, fc=COLOURS[fill], ec=COLOURS["paper"], lw=0.5
        )
        ax.bar_label(
            bars, [f"{part:.0f}" if part >= NUMBERED else "" for part in share], label_type="center", fontsize=7,
            bbox={"boxstyle": "round,pad=0.12", "fc": COLOURS["paper"], "lw": 0},
        )  # fmt: skip
        right, left = right + np.maximum(share, 0.0), left + np.minimum(share, 0.0)
        entries.append(patch_entry(name, fill))
    for stage, (mark, what) in POINTS.items():
        simulated = [
            100.0 * (b.mech / b.line if stage == "mech" else b.shares["DC link"]) for b in budgets
        ]
        logged = [
            100.0 * b.log[stage] / b.log["line"] if stage in b.log and b.log.get("line") else np.nan
            for b in budgets
        ]
        for shares, fill, whose in ((simulated, "ink", "simulated"), (logged, "paper", word)):
            if np.isfinite(shares).any():
                style: LineStyle = {
                    "ls": "none",
                    "marker": mark,
                    "ms": 4.0,
                    "mew": 0.9,
                    "mfc": COLOURS[fill],
                }
                ax.plot(shares, rows - 0.38, color=COLOURS["ink"], zorder=5, **style)
                entries.append(line_entry(f"{what}, {whose}", **style))
    labels = [
        f"{name}\n{number_text(budget.line)} J" for name, budget in zip(names, budgets, strict=True)
    ]
    ax.set_yticks(rows, labels)
    ax.set(ylim=(-0.62, len(names) - 0.52), xlim=(min(0.0, ax.get_xlim()[0]), None))
    ax.set_xlabel("Share of the line's energy in the window (%)")
    ax.grid(axis="y", visible=False)
    legend_above(figure, entries)
    return figure
