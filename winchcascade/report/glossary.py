"""Symbols of a report: the cascade as a drawing, and a table of what each symbol means."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

from winchcascade.core.cascade import Cascade, efficiency_name
from winchcascade.report.report_model import ItemTable, Section, picture, section
from winchcascade.report.report_model import TableColumn as Column
from winchcascade.report.wording import SYMBOL, tex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Symbol(NamedTuple):
    """A symbol, what it means, and its unit, "1" for a ratio."""

    text: str
    meaning: str
    unit: str


PLACES = {"line": "line", "mech": "shaft", "gen": "DC link", "hyd": "hydraulic circuit", "ac": "AC terminals"}
"""What the place of a stage is called in a drawing; one of a rig file has its own name."""

_MOTION = (
    Symbol("v", "Line velocity, positive in payout", "m/s"),
    Symbol("F", "Line tension", "N"),
    Symbol("τ", "Torque of the PTO shaft", "N·m"),
    Symbol("p", "Accumulator pressure, gauge", "kg/cm²"),
    Symbol("n", "Speed of the shaft", "rpm"),
)
_WHOLE_CYCLE = (
    Symbol("E_payout", "Line energy of the payout", "J"),
    Symbol("E_returned", "Line energy given back in haul-in, positive", "J"),
    Symbol("E_net", "Line energy from onset to next onset: that of the payout less that given back", "J"),
    Symbol("E_gen, cycle", "Energy at the DC link from onset to next onset", "J"),
    Symbol("η_net", "Efficiency of whole cycles: energy at the DC link over net line energy", "1"),
)
_UNCERTAINTY = (
    Symbol("u", "Standard uncertainty of a mean", "as the mean"),
    Symbol("s", "Standard deviation of a cycle, from the scatter of the cycles", "as the mean"),
    Symbol("N", "Number of complete cycles", "1"),
    Symbol("ν", "Effective degrees of freedom of u", "1"),
)
_DIAGNOSIS = (
    Symbol("z", "Difference over its standard uncertainty", "1"),
    Symbol("Vdc, Idc", "Voltage and current of the DC link", "V, A"),
)


def symbols_section(cascade: Cascade, *, cycles: bool = True, diagnosed: bool = False) -> Section:
    """The section of the symbols: the drawing of the cascade and the table.

    Parameters
    ----------
    cycles : the report states means of cycles with their uncertainties
    diagnosed : the report compares a log with a model
    """
    rows = cascade_symbols(cascade)
    rows += _WHOLE_CYCLE if cycles and cascade.has_net else ()
    rows += (*_MOTION, *(_UNCERTAINTY if cycles else ()), *(_DIAGNOSIS if diagnosed else ()))
    ways = " → ".join(PLACES.get(name, name) for name in cascade.names)
    return section(
        "symbols", "Symbols",
        picture(
            cascade_figure(cascade), "cascade",
            f"The cascade: power flows from {ways}. E is an energy, P a power, η the share of the energy that comes out.",
            f"Boxes of the stages from left to right: {ways}; the arrows between them carry the efficiencies.",
        ),
        ItemTable[Symbol]("symbols", "Symbols of this report.", [
        Column("Symbol", text=True, of=lambda row: row.text),
        Column("Meaning", text=True, of=lambda row: row.meaning),
        Column("Unit", text=True, of=lambda row: row.unit),
    ]).of(rows),
    )  # fmt: skip


def cascade_symbols(cascade: Cascade) -> list[Symbol]:
    """Energies, powers and efficiencies of the stages of a cascade."""
    where = {stage.name: stage.where or f"stage {stage.name}" for stage in cascade.stages}
    found = [Symbol(SYMBOL[f"energy_{s}"], f"Energy of {where[s]}, over the integration window", "J") for s in where]
    found += [Symbol(SYMBOL[f"power_{s}"], f"Power of {where[s]}; as a mean, over the window", "W") for s in where]
    place = {f"energy_{name}": text.partition(" (")[0] for name, text in where.items()}
    return found + [
        Symbol(SYMBOL[eta], f"Efficiency: energy of {place[out]} over that of {place[into]}", "1")
        for eta, (out, into) in cascade.ratios.items()
    ]


# ----------------------------------------------------------------------------------------------------------- the drawing
BOX, HEIGHT = 0.62, 0.42
"""Width of a box over the distance of two stages, and height of a box."""

LARGEST = 8.5
"""Largest size of a text; one that has no room is smaller. [pt]"""


def cascade_figure(cascade: Cascade) -> Figure:
    """Draw the stages of a cascade as boxes with their powers, and the efficiencies between them."""
    from winchcascade.report.style import wide_figure

    names = cascade.names
    figure = wide_figure(1.75 if len(names) > 2 else 1.3)
    ax = figure.add_axes((0.01, 0.0, 0.98, 1.0))
    ax.set_axis_off()
    ax.set_xlim(-0.5 * BOX - 0.03, len(names) - 1 + 0.5 * BOX + 0.03)
    for k, name in enumerate(names):
        _box(ax, k, name)
    for k, (a, b) in enumerate(pairwise(names)):
        _arrow(ax, (k + 0.5 * BOX, k + 1 - 0.5 * BOX), 0.5 * HEIGHT, tex(efficiency_name(a, b)))
    if len(names) > 2:
        _arrow(ax, (0.0, len(names) - 1.0), -0.27, tex(cascade.overall), turned=True)
    ax.set_ylim(-0.42 if len(names) > 2 else -0.05, 0.78)
    return figure


def _box(ax: Axes, at: int, name: str) -> None:
    """A stage: its place within a box, its energy and its power above."""
    from matplotlib.patches import Rectangle

    from winchcascade.report.style import COLOURS, broken, look_of

    ax.add_patch(
        Rectangle((at - 0.5 * BOX, 0.0), BOX, HEIGHT, fc=COLOURS["paper"], ec=COLOURS[look_of(name).colour], lw=1.6)
    )
    words = broken(PLACES.get(name, name), 12)
    longest = max(words.split("\n"), key=len)
    ax.text(at, 0.5 * HEIGHT, words, ha="center", va="center", fontsize=_size(ax, longest, 0.94 * BOX))
    above = f"{tex(f'energy_{name}')}, {tex(f'power_{name}')}"
    ax.text(at, HEIGHT + 0.07, above, ha="center", va="bottom", fontsize=_size(ax, above, 0.96))


def _arrow(ax: Axes, ends: tuple[float, float], y: float, text: str, *, turned: bool = False) -> None:
    """An arrow from one stage to another with the efficiency above it; `turned` leaves and enters the boxes from below."""
    from winchcascade.report.style import COLOURS

    style = {"arrowstyle": "-|>", "color": COLOURS["soft"], "lw": 1.0, "shrinkA": 0.0, "shrinkB": 0.0}
    if turned:
        ax.plot([ends[0], ends[0], ends[1]], [0.0, y, y], color=COLOURS["soft"], lw=1.0)
        ax.annotate("", xy=(ends[1], 0.0), xytext=(ends[1], y), arrowprops=style)
    else:
        ax.annotate("", xy=(ends[1], y), xytext=(ends[0], y), arrowprops=style)
    size = _size(ax, text, 0.94 * (ends[1] - ends[0]))
    ax.text(0.5 * sum(ends), y + 0.04, text, ha="center", va="bottom", fontsize=size)


def _size(ax: Axes, text: str, room: float) -> float:
    """Size at which a text has room between two places of a drawing. [pt]"""
    from winchcascade.report.style import figure_width
    from winchcascade.report.svg_drawing import text_size

    low, high = ax.get_xlim()
    inches = room / (high - low) * 0.98 * figure_width()
    return min(LARGEST, LARGEST * inches * 72.0 / text_size(text, LARGEST).width)
