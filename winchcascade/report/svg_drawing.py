"""Figures as SVG text: texts as runs of glyphs that are laid out once in a process, axes in a few strokes."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.cbook import is_math_text
from matplotlib.colors import to_hex
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.path import Path as Outline
from matplotlib.textpath import text_to_path
from matplotlib.ticker import NullLocator
from matplotlib.transforms import IdentityTransform, blended_transform_factory

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from matplotlib.axis import Axis
    from matplotlib.backend_bases import GraphicsContextBase, RendererBase
    from matplotlib.figure import Figure
    from matplotlib.text import Text
    from matplotlib.typing import ColorType

    from winchcascade.core.run import Signal


FONT = "DejaVu Sans"
"""Font of the figures, which matplotlib brings along."""

ASCENT, DESCENT = 0.76, 0.24
"""Height and depth of a line of `FONT` about its base line, in sizes of the font."""

EM = float(text_to_path.FONT_SCALE)
"""Size of the font at which glyphs are given."""

LOWERED, SMALLER, AFTER = -0.15 * EM, 0.7, 0.035 * EM
"""Base line and size of a subscript, and room behind it, as matplotlib sets it."""


class Glyph(NamedTuple):
    """One glyph of a run: its name, its place and its size; a run is set at the size `EM`."""

    name: str
    x: float
    y: float
    size: float


class TextRun(NamedTuple):
    """A text of one line: its width, its height, the part of it below the base line, its glyphs, and bars as outlines."""

    width: float
    height: float
    descent: float
    glyphs: tuple[Glyph, ...]
    bars: tuple[str, ...] = ()


class Size(NamedTuple):
    """Size of a text: its width, its whole height, and the part of it below the base line. [pt]"""

    width: float
    height: float
    descent: float


def text_size(text: str, size: float) -> Size:
    """Size of a text of one line in the font of the figures, at a size of the font. [pt]"""
    run = _run(text, (FONT,), "normal", "normal", is_math_text(text))
    return Size(*(size / EM * x for x in run[:3]))


def text_run(text: str, font: FontProperties, *, is_math: bool) -> TextRun:
    """Lay out a text of one line; with `is_math` it holds mathematics between dollars."""
    return _run(text, tuple(font.get_family()), font.get_style(), font.get_weight(), is_math)


_OUTLINES: dict[str, str] = {}
"""Outline of every glyph of the runs so far, by its name."""


def outline_of(name: str) -> str:
    """Outline of a glyph of a run, as the data of an SVG path in steps of a hundredth of its size."""
    return _OUTLINES[name]


@lru_cache(maxsize=4096)
def _run(text: str, family: tuple[str, ...], style: str, weight: str | int, is_math: bool) -> TextRun:
    font = FontProperties(family=list(family), style=style, weight=weight, size=EM)  # type: ignore[arg-type]  # typed as literals
    with warnings.catch_warnings():  # a letter that the font lacks is drawn as a box
        warnings.simplefilter("ignore")
        if is_math:
            return _with_symbols(text, font) or _mathematics(text, font)
        width, height, descent = text_to_path.get_text_width_height_descent(text, font, False)
        face = get_font(findfont(font))
        face.set_size(EM, text_to_path.DPI)
        glyphs, outlines, _ = text_to_path.get_glyphs_with_font(face, text, return_new_glyphs_only=True)
    return TextRun(float(width), float(height), float(descent), _kept(glyphs, outlines))


def _mathematics(text: str, font: FontProperties) -> TextRun:
    """Lay out mathematics of any kind, which takes some milliseconds."""
    width, height, descent = text_to_path.get_text_width_height_descent(text, font, True)
    glyphs, outlines, bars = text_to_path.get_glyphs_mathtext(font, text)
    drawn = tuple(_outline(np.asarray(points, dtype=np.float64), codes) for points, codes in bars)
    return TextRun(float(width), float(height), float(descent), _kept(glyphs, outlines), drawn)


def _with_symbols(text: str, font: FontProperties) -> TextRun | None:
    """Lay out a text whose mathematics are letters with an upright subscript alone; None for any other."""
    plain, *symbols = _SYMBOL.split(text)
    parts = [(plain, "normal", 1.0, 0.0)]
    for letter, subscript, after in zip(symbols[::3], symbols[1::3], symbols[2::3], strict=True):
        parts += [
            (_GREEK.get(letter, letter), "italic", 1.0, 0.0),
            (subscript, "normal", SMALLER, LOWERED),
            (after, "normal", 1.0, 0.0),
        ]
    if any(_SPECIAL.search(part[0]) for part in parts):
        return None
    x = ascent = descent = 0.0
    glyphs: list[Glyph] = []
    for words, style, size, y in parts:
        run = _run(words, tuple(font.get_family()), style, font.get_weight(), False)
        glyphs += (Glyph(glyph.name, x + size * glyph.x, y, size) for glyph in run.glyphs)
        x += size * run.width + (AFTER if size != 1.0 else 0.0)
        ascent, descent = max(ascent, size * (run.height - run.descent) + y), max(descent, size * run.descent - y)
    return TextRun(x, ascent + descent, descent, tuple(glyphs))


_SYMBOL = re.compile(r"\$(\\[a-z]+|[A-Za-z])_\\mathrm\{([A-Za-z0-9]+)\}\$")
_GREEK = {r"\eta": "η", r"\tau": "τ"}
_SPECIAL = re.compile(r"[$\\]")


def _kept(glyphs: Iterable[Sequence[Any]], outlines: Mapping[str, tuple[Any, Any]]) -> tuple[Glyph, ...]:
    """The glyphs of a run; outlines that are new are kept."""
    for name, (points, codes) in outlines.items():
        if name not in _OUTLINES:
            _OUTLINES[name] = _outline(np.asarray(points, dtype=np.float64), codes)
    return tuple(Glyph(name, float(x), float(y), float(size)) for name, x, y, size in glyphs)


_LETTER = {1: "M", 2: "L", 3: "Q", 4: "C", 79: "z"}
"""Letters of an SVG path by matplotlib's codes of a path."""


def _outline(points: Signal, codes: Iterable[int]) -> str:
    """Points and codes of a path as data of an SVG path; y rises, as in a font."""
    words, before = [], 0
    for (x, y), code in zip(points.tolist(), map(int, codes), strict=True):
        if code != before or code == 1:
            words.append(_LETTER[code])
        if code != 79:
            words.append(f"{x:.2f} {y:.2f}")
        before = code
    return " ".join(words)


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


POINTS = 72
"""Points in an inch: SVG is drawn in points."""


def svg_text(figure: Figure, name: str) -> str:
    """A figure as one SVG element whose ids begin with its name, so that several may stand in one page."""
    figure.set_dpi(POINTS)
    quicken(figure)
    out = io.StringIO()
    width, height = figure.get_size_inches() * POINTS
    renderer = _Renderer(width, height, out)
    figure.draw(renderer)
    renderer.finalize()  # type: ignore[no-untyped-call]
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    for begin in (' id="', 'href="#', "url(#"):
        text = text.replace(begin, f"{begin}{name}-")
    text = _PATH.sub(_shorter, text)
    return re.sub(r"\s*\n\s*", "\n", text).strip()


_PATH = re.compile(r' d="[^"]*"')
_NOT_SEEN = re.compile(r"(?<=\.\d\d)\d+")


def _shorter(outline: re.Match[str]) -> str:
    """An outline with hundredths of a point, which no screen shows, and without line breaks."""
    return " " + " ".join(_NOT_SEEN.sub("", outline[0]).split())


class _Renderer(RendererSVG):
    """Draws SVG with texts as glyphs, each defined at its first use."""

    def __init__(self, width: float, height: float, out: io.StringIO) -> None:
        unwanted = dict.fromkeys(("Date", "Creator", "Format", "Type"))
        super().__init__(width, height, out, image_dpi=POINTS, metadata=unwanted)  # type: ignore[no-untyped-call]
        self._out = out
        self._defined: set[str] = set()

    def get_text_width_height_descent(
        self, s: str, prop: FontProperties, ismath: bool | Literal["TeX"]
    ) -> tuple[float, float, float]:
        """Size of a text of one line. [pt]"""
        scale, run = prop.get_size_in_points() / EM, text_run(s, prop, is_math=bool(ismath))
        return scale * run.width, scale * run.height, scale * run.descent

    def draw_text(
        self, gc: GraphicsContextBase, x: float, y: float, s: str, prop: FontProperties, angle: float,
        ismath: bool | Literal["TeX"] = False, mtext: Text | None = None,  # noqa: ARG002  # matplotlib names it
    ) -> None:  # fmt: skip
        """Draw a text from a point of its base line on, turned by an angle."""
        run, scale = text_run(s, prop, is_math=bool(ismath)), prop.get_size_in_points() / EM
        self.writer.comment(s)  # type: ignore[no-untyped-call]  # it also ends the tag before
        new = [name for name in dict.fromkeys(glyph.name for glyph in run.glyphs) if name not in self._defined]
        self._defined.update(new)
        if new:
            self._out.write(
                "".join(["<defs>", *(f'<path id="{name}" d="{outline_of(name)}"/>' for name in new), "</defs>\n"])
            )
        alpha = gc.get_rgb()[3]
        style = f"fill: {to_hex(gc.get_rgb())}" + ("" if alpha == 1.0 else f"; opacity: {alpha:g}")
        turned = f" rotate({-angle:g})" if angle else ""
        place = f"translate({x:.2f} {y:.2f}){turned} scale({scale:g} {-scale:g})"
        glyphs = "".join(map(_use, run.glyphs)) + "".join(f'<path d="{bar}"/>' for bar in run.bars)
        self._out.write(f'<g style="{style}" transform="{place}">\n{glyphs}</g>\n')


def _use(glyph: Glyph) -> str:
    """A glyph at its place in a run."""
    place = [f"translate({glyph.x:.1f} {glyph.y:.1f})"] if glyph.x or glyph.y else []
    place += [] if glyph.size == 1.0 else [f"scale({glyph.size:g})"]
    transform = ' transform="' + " ".join(place) + '"' if place else ""
    return f'<use xlink:href="#{glyph.name}"{transform}/>\n'
