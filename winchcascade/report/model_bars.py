"""The loss budget as stacked bars: where the line's energy goes, load by load."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.report.digits import significant
from winchcascade.report.model_budget import GROUPS, NOTHING
from winchcascade.report.style import COLOURS, WIDTH, text_width

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from matplotlib.axes import Axes

    from winchcascade.report.model_budget import Budget
    from winchcascade.report.model_figures import Entry

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


def budget_bars(names: Sequence[str], budgets: Sequence[Budget], *, word: str) -> Figure:
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


def _bar(ax: Axes, row: float, budget: Budget, present: Sequence[str]) -> None:
    """Stack the shares of one log from the DC link to the line; what is given back lies left of zero."""
    right = left = 0.0
    for name in present:
        colour, hatch = _LOOK[name]
        begin = right
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


def _parts(budget: Budget, name: str) -> Iterator[float]:
    """Share of a group; of the inertia that of the rotor and that of the drum, so that the torque sensor lies between. [%]"""
    share, drum = 100.0 * budget.shares[name], 100.0 * budget.drum / budget.line
    yield from (share - drum, drum) if name == "inertia" else (share,)


def _shares(ax: Axes, row: float, budget: Budget) -> None:
    """Mark what reaches the torque sensor: of the simulation a stroke across the bar; shaft and DC link of the log below it."""
    ax.plot([100.0 * budget.mech] * 2, [row - 0.5, row + 0.33], color=COLOURS["ink"], lw=1.1, zorder=4)
    whole = budget.log.get("line", 0.0)
    for stage, (mark, _) in _POINTS.items():
        if stage in budget.log and whole > 0:
            ax.plot(100.0 * budget.log[stage] / whole, row + _LANE, **_point(mark))


def _point(mark: str) -> dict[str, Any]:
    return {
        "ls": "none", "marker": mark, "ms": 4.2, "mew": 0.9, "mfc": COLOURS["paper"], "mec": COLOURS["ink"], "zorder": 5,
        "clip_on": False,
    }  # fmt: skip


def _entries(present: Sequence[str], budgets: Sequence[Budget], word: str) -> list[Entry]:
    """What the legend names: the parts, then stroke and points."""
    entries: list[Entry] = []
    for name in present:
        colour, hatch = _LOOK[name]
        box = Rectangle((0, 0), 1, 1, fc=COLOURS[colour], hatch=hatch, ec=COLOURS["paper"], lw=0.5)
        entries.append((box, GROUPS[name].name))
    entries.append((Line2D([], [], color=COLOURS["ink"], lw=1.1), "shaft, simulated"))
    given = [stage for stage in _POINTS if any(stage in b.log for b in budgets)]
    marks = {stage: Line2D([], [], **_point(_POINTS[stage][0])) for stage in given}
    return entries + [(marks[stage], f"{_POINTS[stage][1]}, {word}") for stage in given]
