"""Figures as SVG text: drawn by matplotlib's own renderer, with texts from runs that are laid out once in a process."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Literal

from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.colors import to_hex

from winchcascade.report.axis_drawing import quicken
from winchcascade.report.text_runs import EM, Glyph, outline_of, text_run

if TYPE_CHECKING:
    from matplotlib.backend_bases import GraphicsContextBase
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties
    from matplotlib.text import Text

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
