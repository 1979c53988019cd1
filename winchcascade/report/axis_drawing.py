"""Grid, ticks and labels of an axis in a few strokes: matplotlib makes, measures and draws five artists for each tick.

A page has about fifty axes, whose ticks took two thirds of the time of its figures. What is seen is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.cbook import is_math_text
from matplotlib.path import Path as Outline
from matplotlib.ticker import NullLocator
from matplotlib.transforms import IdentityTransform, blended_transform_factory

from winchcascade.report.text_runs import ASCENT, DESCENT, Size, text_size

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.backend_bases import GraphicsContextBase, RendererBase
    from matplotlib.figure import Figure
    from matplotlib.typing import ColorType

    from winchcascade.core.run import Signal

NEAR = 0.01
"""A tick this far beyond the end of an axis is drawn still: rounding may put it there. [pt]"""


def quicken(figure: Figure) -> None:
    """Have the plain axes of a figure drawn in a few strokes; the labels of panels in one column stand in one line.

    The figure has 72 dots an inch, and its limits do not change afterwards.
    """
    drawn = [
        drawing for ax in figure.axes for axis in (ax.xaxis, ax.yaxis) if (drawing := _drawing_of(axis)) is not None
    ]
    for drawing in drawn:
        drawing.place_label([other for other in drawn if _in_one_line(drawing.axis, other.axis)])
    for drawing in drawn:
        drawing.axis.axes.add_artist(drawing)
        drawing.axis.set_visible(False)


def _drawing_of(axis: Axis) -> AxisDrawing | None:
    """The drawing of an axis that is seen and has ticks and level labels of one line to the left or below; None for others."""
    ax = axis.axes
    if not (axis.get_visible() and ax.get_visible() and ax.axison and ax.get_aspect() == "auto"):
        return None
    (tick,) = axis.get_major_ticks(1)
    beyond = (
        tick.tick2line.get_visible() or tick.label2.get_visible() or axis.get_label_position() not in ("left", "bottom")
    )
    if beyond or tick.label1.get_rotation() or not isinstance(axis.get_minor_locator(), NullLocator):
        return None
    places = np.asarray(axis.get_majorticklocs(), dtype=np.float64)
    formatter = axis.get_major_formatter()
    texts = formatter.format_ticks(places.tolist())
    if formatter.get_offset() or any("\n" in text for text in texts):
        return None
    return AxisDrawing(axis, places, texts)


def _in_one_line(axis: Axis, other: Axis) -> bool:
    """Whether the labels of two axes stand in one line: vertical axes of panels above each other that share the other axis."""
    one, two = axis.axes, other.axes
    stacked = axis is axis.axes.yaxis and other is other.axes.yaxis and one.get_shared_x_axes().joined(one, two)
    return axis is other or (stacked and bool(one.bbox.x0 == two.bbox.x0))


class _Label(NamedTuple):
    """A label of a tick: its text, whether it holds mathematics, its size, and where its base line begins. [pt]"""

    text: str
    is_math: bool
    size: Size
    x: float
    y: float


class AxisDrawing(Artist):
    """Draws the ticks at some places of an axis, in the style of its first tick, with its label."""

    def __init__(self, axis: Axis, places: Signal, texts: Sequence[str]) -> None:
        super().__init__()
        self.axis = axis
        self.set_gid(axis.get_gid())
        self.set_zorder(axis.get_zorder())
        ax, (self._style,) = axis.axes, axis.get_major_ticks(1)
        self._k = 0 if axis is ax.xaxis else 1
        points = np.column_stack((places, np.full_like(places, ax.get_ylim()[0])))
        if self._k == 1:
            points = np.column_stack((np.full_like(places, ax.get_xlim()[0]), places))
        at, box = ax.transData.transform(points)[:, self._k], ax.bbox
        low, high = (box.intervalx, box.intervaly)[self._k]
        inside = (at >= low - NEAR) & (at <= high + NEAR)
        self._at = at[inside]
        seen = self._style.label1.get_visible()
        self.labels = [
            self._placed(text, place)
            for text, place, shown in zip(texts, at, inside, strict=True)
            if seen and shown and text
        ]

    def _placed(self, text: str, place: float) -> _Label:
        """Set a label to its tick: centred below it, or to its left with the base line half an ascent lower."""
        tick, box = self._style, self.axis.axes.bbox
        is_math, font = is_math_text(text), self._font
        text = text if is_math else text.replace(r"\$", "$")
        away = tick.get_pad() + tick.get_tick_padding()  # type: ignore[func-returns-value, operator]  # it returns points
        size = text_size(text, font)
        if self._k == 1:
            return _Label(text, is_math, size, box.x0 - away - size.width, place - 0.5 * ASCENT * font)
        base = box.y0 - away - max(ASCENT * font, size.height - size.descent)
        return _Label(text, is_math, size, place - 0.5 * size.width, base)

    @property
    def outer(self) -> float:
        """How far ticks and their labels extend to the left or below. [pt]"""
        box, length = self.axis.axes.bbox, self._length
        if self._k == 1:
            return min(label.x for label in self.labels) if self.labels else box.x0 - length
        return (
            min(label.y - max(label.size.descent, DESCENT * self._font) for label in self.labels)
            if self.labels
            else box.y0 - length
        )

    @property
    def _font(self) -> float:
        """Size of the labels of the ticks. [pt]"""
        return self._style.label1.get_fontproperties().get_size_in_points()

    @property
    def _length(self) -> float:
        """Length of the ticks outside the panel. [pt]"""
        return self._style.get_tick_padding() if self._style.tick1line.get_visible() else 0.0

    def place_label(self, group: Sequence[AxisDrawing]) -> None:
        """Set the label of the axis outside the ticks of a group of axes."""
        axis = self.axis
        away = min(drawing.outer for drawing in group) - axis.labelpad
        own, along = IdentityTransform(), axis.label.get_position()[self._k]
        if self._k == 1:
            axis.set_label_coords(away, along, transform=blended_transform_factory(own, axis.axes.transAxes))
        else:
            axis.set_label_coords(along, away, transform=blended_transform_factory(axis.axes.transAxes, own))

    def draw(self, renderer: RendererBase) -> None:
        """Draw grid, ticks and labels in a group of their own, and the label of the axis beside it."""
        box, tick = self.axis.axes.bbox, self._style
        low, high = (box.intervaly, box.intervalx)[self._k]
        renderer.open_group("axis", gid=self.get_gid())
        renderer.open_group("ticks")
        if tick.gridline.get_visible() and self._at.size:
            line = tick.gridline
            gc = _pen(renderer, line.get_color(), line.get_linewidth(), line.get_alpha() or 1.0)
            gc.set_clip_rectangle(box)
            self._stroke(renderer, gc, low, high)
        if self._length and self._at.size:
            gc = _pen(renderer, tick.tick1line.get_markeredgecolor(), tick.tick1line.get_markeredgewidth())
            self._stroke(renderer, gc, low - self._length, low)
        pen, font = _pen(renderer, tick.label1.get_color(), 0.0), tick.label1.get_fontproperties()
        height = renderer.get_canvas_width_height()[1] if renderer.flipy() else 0.0
        for label in self.labels:
            y = height - label.y if renderer.flipy() else label.y
            renderer.draw_text(pen, label.x, y, label.text, font, 0.0, ismath=label.is_math)
        renderer.close_group("ticks")
        self.axis.label.draw(renderer)
        renderer.close_group("axis")

    def _stroke(self, renderer: RendererBase, gc: GraphicsContextBase, begin: float, end: float) -> None:
        """Draw one line across the axis at each tick, all as one path."""
        n = self._at.size
        ends = np.empty((2 * n, 2))
        ends[:, self._k] = np.repeat(self._at, 2)
        ends[:, 1 - self._k] = np.tile((begin, end), n)
        codes = np.tile((Outline.MOVETO, Outline.LINETO), n)
        renderer.draw_path(gc, Outline(ends, codes), IdentityTransform())
        gc.restore()


def _pen(renderer: RendererBase, colour: ColorType, width: float, alpha: float = 1.0) -> GraphicsContextBase:
    """A line of a colour and width [pt]."""
    gc = renderer.new_gc()
    gc.set_alpha(alpha)
    gc.set_foreground(colour)
    gc.set_linewidth(width)
    return gc
