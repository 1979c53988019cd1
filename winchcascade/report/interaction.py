"""What a page needs to zoom a figure, to read its values and to switch its series: ids of its axes, artists and legends."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from matplotlib.collections import Collection, LineCollection
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator

from winchcascade.report.style import COLOURS

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

_NEUTRAL = (to_hex(COLOURS["ink"]), to_hex(COLOURS["soft"]))
"""Colours of legend entries that name a kind of line or marker, whatever its colour."""

_POINT = 72.0
"""Points in an inch."""


class AxisMarks(msgspec.Struct, frozen=True, omit_defaults=True):
    """One axis: its limits as drawn, its id, its label, and the number of the first panel that shares it.

    `texts` are its ticks where they are words or chosen values.
    """

    low: float
    high: float
    id: str
    label: str
    shared: int
    log: bool = False
    texts: tuple[tuple[float, str], ...] = ()


class SecondMarks(msgspec.Struct, frozen=True):
    """A second horizontal axis of a panel: its id and its limits as drawn."""

    id: str
    low: float
    high: float


class PanelMarks(msgspec.Struct, frozen=True, omit_defaults=True):
    """One panel: its box [pt from the upper left corner], its axes, and its artists by the axes that move them.

    `moved` are ids of artists in data coordinates on both axes, `along_x` and `along_y` those on one axis alone.
    """

    box: tuple[float, float, float, float]
    title: str
    x: AxisMarks
    y: AxisMarks
    moved: tuple[str, ...] = ()
    along_x: tuple[str, ...] = ()
    along_y: tuple[str, ...] = ()
    second: SecondMarks | None = None


class SeriesMarks(msgspec.Struct, frozen=True):
    """One entry of the legends: its text, ids of its entries in them, and ids of what it names."""

    name: str
    keys: tuple[str, ...]
    ids: tuple[str, ...]


class FigureMarks(msgspec.Struct, frozen=True):
    """Panels and series of a figure."""

    panels: tuple[PanelMarks, ...]
    series: tuple[SeriesMarks, ...]


def mark(figure: Figure) -> str:
    """Give every artist of a figure an id, and describe panels and series as JSON; nothing for a figure without axes."""
    axes = [ax for ax in figure.axes if ax.axison and ax.get_visible()]
    if not axes:
        return ""
    panels = tuple(_panel(figure, axes, k) for k in range(len(axes)))
    return msgspec.json.encode(FigureMarks(panels, tuple(_series(figure, axes)))).decode()


# ------------------------------------------------------------------------------------------------------------ the panels
def _panel(figure: Figure, axes: Sequence[Axes], k: int) -> PanelMarks:
    ax, (wide, high) = axes[k], figure.get_size_inches() * _POINT
    box = ax.get_position()
    ids: dict[tuple[bool, ...], list[str]] = {}
    for n, artist in enumerate(_artists(ax)):
        if artist.get_gid() is None:
            artist.set_gid(f"item-{k}-{n}")
        along = tuple(artist.get_transform().contains_branch_seperately(ax.transData))
        ids.setdefault(along, []).append(str(artist.get_gid()))
    return PanelMarks(
        box=(
            _short(box.x0 * wide), _short((1.0 - box.y1) * high), _short(box.width * wide), _short(box.height * high)
        ),
        title=_plain(ax.get_title(loc="left")),
        x=_axis(ax.xaxis, ax.get_xlim(), ax.get_shared_x_axes().get_siblings(ax), axes, f"xaxis-{k}"),
        y=_axis(ax.yaxis, ax.get_ylim(), ax.get_shared_y_axes().get_siblings(ax), axes, f"yaxis-{k}"),
        moved=tuple(ids.get((True, True), ())),
        along_x=tuple(ids.get((True, False), ())),
        along_y=tuple(ids.get((False, True), ())),
        second=_second(ax, k),
    )  # fmt: skip


def _artists(ax: Axes) -> Iterator[Artist]:
    """What is drawn in a panel, without its axes, its titles and its legend."""
    yield from (*ax.lines, *ax.patches, *ax.collections, *ax.texts)


def _axis(
    axis: Axis, limits: tuple[float, float], siblings: Sequence[Axes], axes: Sequence[Axes], name: str
) -> AxisMarks:
    if axis.get_gid() is None:
        axis.set_gid(name)
    texts: tuple[tuple[float, str], ...] = ()
    if isinstance(axis.get_major_locator(), FixedLocator):
        values = [float(v) for v in axis.get_majorticklocs()]
        written = axis.get_major_formatter().format_ticks(values)
        texts = tuple((v, _plain(text)) for v, text in zip(values, written, strict=True) if text)
    shared = min(axes.index(ax) for ax in siblings if ax in axes)
    return AxisMarks(
        _short(limits[0]), _short(limits[1]), str(axis.get_gid()), _plain(axis.get_label_text()), shared,
        axis.get_scale() == "log", texts,
    )  # fmt: skip


def _second(ax: Axes, k: int) -> SecondMarks | None:
    """Second axis above a panel, whose scale is proportional to the first."""
    for child in ax.child_axes:
        child.xaxis.set_gid(f"second-{k}")
        ends = child._functions[0](np.array(ax.get_xlim()))  # type: ignore[attr-defined]  # its limits are set when it is drawn
        return SecondMarks(f"second-{k}", _short(float(ends[0])), _short(float(ends[1])))
    return None


def _short(value: float) -> float:
    return float(f"{value:.7g}")


_TEX = re.compile(r"\\mathrm\{([^}]*)\}|\\(eta|to)(?![a-zA-Z]) ?|[${}]")


def _plain(text: str) -> str:
    """Text of a label without its typesetting, symbols as in the texts of a report.

    >>> _plain(r"$\\eta_\\mathrm{trans}$ (1)"), _plain("(a) Power")
    ('η_trans (1)', '(a) Power')
    """
    words = {"eta": "η", "to": "→"}
    return _TEX.sub(lambda found: found[1] or words.get(found[2] or "", ""), text.replace("\n", " "))


# ------------------------------------------------------------------------------------------------------------ the series
class _Look(NamedTuple):
    """Look of an artist or an entry of a legend: a line or an area, its colour, marker, dashes or hatching."""

    area: bool
    colour: str
    marker: str
    dashes: str


def _look(artist: Artist) -> _Look | None:
    """Look of an artist; None for what no legend names."""
    if isinstance(artist, Line2D):
        marker = str(artist.get_marker())
        marker = "" if marker in ("None", "", " ") else marker
        alone = artist.get_linestyle() in ("None", "", " ")
        colour = artist.get_markeredgecolor() if alone else artist.get_color()
        dashes: Any = "" if alone else getattr(artist, "_unscaled_dash_pattern", ("", None))
        return _Look(False, _hex(colour), marker, str(dashes))
    if isinstance(artist, Patch):
        return _Look(True, _hex(artist.get_facecolor()), "", artist.get_hatch() or "")
    if isinstance(artist, Collection):
        lines = isinstance(artist, LineCollection)
        colours = artist.get_edgecolor() if lines else artist.get_facecolor()
        first = np.atleast_2d(np.asarray(colours, dtype=float))[:1]
        return _Look(not lines, _hex(first[0]), "", "" if lines else artist.get_hatch() or "") if first.size else None
    return None


def _hex(colour: Any) -> str:
    return to_hex(colour).lower()


def _series(figure: Figure, axes: Sequence[Axes]) -> list[SeriesMarks]:
    """Entries of all legends with what they name; entries of one text are one series.

    The legend of a panel names what is in that panel first, then what the legends of the other panels leave unnamed.
    """
    everywhere = range(len(axes))
    own = [(k, legend) for k, ax in enumerate(axes) if (legend := ax.get_legend()) is not None]
    turns = [(legend, [k], True) for k, legend in own] + [(legend, everywhere, True) for _, legend in own]
    turns += [(legend, everywhere, False) for legend in figure.legends]
    looks = {str(artist.get_gid()): _look(artist) for ax in axes for artist in _artists(ax)}
    legends = [*(legend for _, legend in own), *figure.legends]
    entries = {id(legend): _entries(legend, str(n)) for n, legend in enumerate(legends)}
    found: dict[str, tuple[dict[str, None], dict[str, None]]] = {}
    claimed: set[str] = set()
    for legend, places, is_own in turns:
        for gid in (str(artist.get_gid()) for k in places for artist in _artists(axes[k])):
            entry = (
                None if is_own and gid in claimed else _named_by(looks[gid], entries[id(legend)], looks, strict=is_own)
            )
            if entry is not None:
                claimed |= {gid} if is_own else set()
                keys, ids = found.setdefault(entry.name, ({}, {}))
                keys |= dict.fromkeys(entry.keys)
                ids[gid] = None
    return [SeriesMarks(name, tuple(keys), tuple(ids)) for name, (keys, ids) in found.items()]


class _LegendEntry(NamedTuple):
    """An entry of a legend: its text, the ids of its parts, and its look."""

    name: str
    keys: tuple[str, ...]
    look: _Look


def _entries(legend: Legend, name: str) -> list[_LegendEntry]:
    found = []
    for n, (handle, text) in enumerate(zip(legend.legend_handles, legend.get_texts(), strict=True)):
        look = None if handle is None else _look(handle)
        if handle is not None and look is not None:
            keys = (f"key-{name}-{n}", f"name-{name}-{n}")
            handle.set_gid(keys[0])
            text.set_gid(keys[1])
            found.append(_LegendEntry(_plain(text.get_text()), keys, look))
    return found


def _named_by(
    look: _Look | None, entries: Sequence[_LegendEntry], looks: Mapping[str, _Look | None], *, strict: bool
) -> _LegendEntry | None:
    """Entry that names an artist: the one of its colour that is most like it.

    Parameters
    ----------
    looks : those of all artists
    strict : no artist of another colour is named; else a grey entry names lines or marks of every colour, if none is grey
    """
    if look is None:
        return None
    same = [entry for entry in entries if entry.look.area == look.area and entry.look.colour == look.colour]
    if not same and not strict and not look.area:
        drawn = {other.colour for other in looks.values() if other is not None and not other.area}
        kinds = [e for e in entries if not e.look.area and e.look.colour in _NEUTRAL and e.look.colour not in drawn]
        same = [entry for entry in kinds if bool(entry.look.marker) == bool(look.marker)]
    if not same:
        return None
    return max(
        same,
        key=lambda entry: (
            bool(entry.look.marker) == bool(look.marker), entry.look.marker == look.marker, entry.look.dashes == look.dashes,
        ),
    )  # fmt: skip
