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


Marks = dict[str, object]
"""Description of a part of a figure, as the page reads it."""


def mark(figure: Figure) -> str:
    """Give every artist of a figure an id, and describe panels and series as JSON; nothing for a figure without axes."""
    axes = [ax for ax in figure.axes if ax.axison and ax.get_visible()]
    if not axes:
        return ""
    panels = tuple(_panel(figure, axes, k) for k in range(len(axes)))
    return msgspec.json.encode({"panels": panels, "series": _series(figure, axes)}).decode()


# ------------------------------------------------------------------------------------------------------------ the panels
def _panel(figure: Figure, axes: Sequence[Axes], k: int) -> Marks:
    """One panel: its box [pt from the upper left corner], its axes, and its artists by the axes that move them.

    `moved` are ids of artists in data coordinates on both axes, `along_x` and `along_y` those on one axis alone.
    """
    ax, (wide, high) = axes[k], figure.get_size_inches() * _POINT
    box = ax.get_position()
    ids: dict[tuple[bool, ...], list[str]] = {}
    for n, artist in enumerate(_artists(ax)):
        if artist.get_gid() is None:
            artist.set_gid(f"item-{k}-{n}")
        along = tuple(artist.get_transform().contains_branch_seperately(ax.transData))
        ids.setdefault(along, []).append(str(artist.get_gid()))
    given = {
        "moved": ids.get((True, True)),
        "along_x": ids.get((True, False)),
        "along_y": ids.get((False, True)),
        "second": _second(ax, k),
    }
    return {
        "box": [_short(x) for x in (box.x0 * wide, (1.0 - box.y1) * high, box.width * wide, box.height * high)],
        "title": _plain(ax.get_title(loc="left")),
        "x": _axis(ax.xaxis, ax.get_xlim(), ax.get_shared_x_axes().get_siblings(ax), axes, f"xaxis-{k}"),
        "y": _axis(ax.yaxis, ax.get_ylim(), ax.get_shared_y_axes().get_siblings(ax), axes, f"yaxis-{k}"),
        **{name: value for name, value in given.items() if value},
    }


def _artists(ax: Axes) -> Iterator[Artist]:
    """What is drawn in a panel, without its axes, its titles and its legend."""
    yield from (*ax.lines, *ax.patches, *ax.collections, *ax.texts)


def _axis(axis: Axis, limits: tuple[float, float], siblings: Sequence[Axes], axes: Sequence[Axes], name: str) -> Marks:
    """One axis: its limits as drawn, its id, its label, and the number of the first panel that shares it.

    `log` states a logarithmic scale, `texts` are its ticks where they are words or chosen values.
    """
    if axis.get_gid() is None:
        axis.set_gid(name)
    texts: tuple[tuple[float, str], ...] = ()
    if isinstance(axis.get_major_locator(), FixedLocator):
        values = [float(v) for v in axis.get_majorticklocs()]
        written = axis.get_major_formatter().format_ticks(values)
        texts = tuple((v, _plain(text)) for v, text in zip(values, written, strict=True) if text)
    return {
        "low": _short(limits[0]),
        "high": _short(limits[1]),
        "id": str(axis.get_gid()),
        "label": _plain(axis.get_label_text()),
        "shared": min(axes.index(ax) for ax in siblings if ax in axes),
        **({"log": True} if axis.get_scale() == "log" else {}),
        **({"texts": texts} if texts else {}),
    }


def _second(ax: Axes, k: int) -> Marks | None:
    """Second axis above a panel, whose scale is proportional to the first: its id and its limits as drawn."""
    for child in ax.child_axes:
        child.xaxis.set_gid(f"second-{k}")
        ends = child._functions[0](np.array(ax.get_xlim()))  # type: ignore[attr-defined]  # its limits are set when it is drawn
        return {"id": f"second-{k}", "low": _short(float(ends[0])), "high": _short(float(ends[1]))}
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
        return _Look(False, to_hex(colour), marker, str(dashes))
    if isinstance(artist, Patch):
        return _Look(True, to_hex(artist.get_facecolor()), "", artist.get_hatch() or "")
    if isinstance(artist, Collection):
        lines = isinstance(artist, LineCollection)
        colours = artist.get_edgecolor() if lines else artist.get_facecolor()
        first = np.atleast_2d(np.asarray(colours, dtype=float))[:1]
        return _Look(not lines, to_hex(first[0]), "", "" if lines else artist.get_hatch() or "") if first.size else None
    return None


def _series(figure: Figure, axes: Sequence[Axes]) -> list[Marks]:
    """Entries of all legends: their text, ids of their entries, ids of what they name; those of one text are one series.

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
    return [{"name": name, "keys": list(keys), "ids": list(ids)} for name, (keys, ids) in found.items()]


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
