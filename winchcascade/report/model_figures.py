"""Figures of a log against its simulation, for one log and for all loads: log solid, simulation markers (Figs 11 to 17)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from winchcascade.report.figures import dots, readable
from winchcascade.report.model_curves import HAUL_IN, SHOWN
from winchcascade.report.style import COLOURS, LOAD_COLOURS, WIDTH, columns_within, label_panel, lines_within

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.report.model_curves import Curve

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
    curves: Mapping[str, Curve]
    log: str = "ink"
    simulated: str = "mech"
    mark: Any = "o"


Clouds = dict[str, tuple["Signal", "Signal"]]
"""Samples of a log that are drawn behind its curve, x and y, by the curve's name."""

Entry = tuple[Any, str]
"""What a legend shows, and its text."""


def by_load(names: Sequence[str], curves: Sequence[Mapping[str, Curve]]) -> list[Drawn]:
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
    columns: int,
    clouds: Clouds | None = None,
    gear: float | None = None,
) -> Figure | None:
    """Draw curves of log and simulation, one panel for each name that any log has; None if no log has any.

    Parameters
    ----------
    names : of `model_curves.SHOWN`
    word : what the logs are called
    rated : speed of the generator above which a panel over speed is shaded [rpm]
    columns : panels beside each other, of more than three
    gear : adds an axis above with the speed of the drum, which is slower by this
    """
    given = given_names(drawn, names)
    drawn = [d for d in drawn if any(name in d.curves for name in given)]
    if not given:
        return None
    columns = len(given) if len(given) <= 3 else columns
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
    for k, name in enumerate(given):
        letter = _LETTERS[k] if len(given) > 1 else ""
        shaded |= _panel(grid[k], letter, name, drawn, rated, (clouds or {}).get(name), MOST_MARKS // columns)
        if gear is not None:
            _add_drum_speed(grid[k], gear)
    for ax in grid[len(given) :]:
        ax.set_visible(False)
    _legend(figure, drawn, word=word, shaded=shaded, sampled=bool(clouds))
    return figure


def _panel(
    ax: Axes,
    letter: str,
    name: str,
    drawn: Sequence[Drawn],
    rated: float | None,
    cloud: tuple[Signal, Signal] | None,
    most: int,
) -> bool:
    """Draw one quantity of all logs with so many markers at most; tells whether a stretch over the rated speed is shaded."""
    shown = SHOWN[name]
    curves = [(d, key, d.curves[key]) for d in drawn for key in _beside(name) if key in d.curves]
    short, unit = readable(shown.unit, *(np.array((*c.log, *c.simulated)) for _, _, c in curves))
    if cloud is not None:
        dots(ax, cloud[0], cloud[1] * short, COLOURS["soft"])
    step = max(1, -(-sum(len(c.x) for _, _, c in curves) // most))
    for k, (d, key, c) in enumerate(curves):
        pair(ax, d, c, short=short, every=(k % step, step), dashes=_BACK if key == HAUL_IN else "-")
    if letter:
        label_panel(ax, letter, shown.title)
    ax.set_xlabel(shown.over)
    ax.set_ylabel(f"{shown.symbol} ({unit})" if shown.symbol else unit if letter else f"{shown.title} ({unit})")
    if name == "resistance_ohm":
        ax.set_ylim(0.0, 1.12 * max(max(c.log + c.simulated) for _, _, c in curves))
    elif name == "eta_gen":
        low, high = ax.get_ylim()
        ax.set_ylim(max(low, 0.0), min(max(high, 0.9), 1.0))
    if "rpm" not in shown.over:
        return False
    ax.set_xlim(left=0.0)
    return shade_over_speed(ax, rated)


def _beside(name: str) -> tuple[str, ...]:
    """Curves that share the panel of a quantity."""
    return (name, HAUL_IN) if name == "pressure_kgcm2" else (name,)


def pair(
    ax: Axes, drawn: Drawn, curve: Curve, *, short: float = 1.0, every: tuple[int, int] = (0, 1), dashes: Any = "-"
) -> None:
    """Draw one curve of the log as a line, and that of the simulation as markers.

    Parameters
    ----------
    short : factor that keeps the numbers of the axis short
    every : first bin with a marker, and bins from one to the next
    """
    ax.plot(curve.x, np.array(curve.log) * short, color=COLOURS[drawn.log], lw=1.2, ls=dashes)
    ax.plot(
        curve.x, np.array(curve.simulated) * short, ls="none", marker=drawn.mark, ms=MARK_SIZE, mew=0.7,
        mfc=COLOURS["paper"], mec=COLOURS[drawn.simulated], markevery=every,
    )  # fmt: skip


def shade_over_speed(ax: Axes, rated: float | None) -> bool:
    """Shade what lies over the rated speed of the generator, if the axis reaches so far; tells whether it does."""
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
    """Say above the panels what lines, markers and shades are; of several logs name each."""
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
