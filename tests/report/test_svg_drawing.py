"""Figures of pages: what is drawn in few strokes is where matplotlib draws it."""

import io
import re

import numpy as np
import pytest
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from winchcascade.report.figures.style import Margins, house_style, label_panel, panel_figure
from winchcascade.report.svg_drawing import EM, FONT, POINTS, AxisDrawing, quicken, svg_text, text_run, text_size
from winchcascade.report.wording import SYMBOL, tex

SEEN = 0.3
"""What an eye does not see in print. [pt]"""

SYMBOLS = sorted({tex(name) for name in SYMBOL})


def example(y: tuple[float, float] = (-3.0, 1234.0), *, names: tuple[str, ...] = ()) -> Figure:
    """Two panels with ticks, grid and labels; with names the ticks of the upper one have them."""
    figure, axes = panel_figure(3.0, 2, share="x", margins=Margins(left=0.2))
    for ax, letter in zip(axes, "ab", strict=True):
        ax.plot([0.0, 7.3], y)
        label_panel(ax, letter, "Panel", x="Time (s)", y="Power (W)")
    if names:
        axes[0].set_yticks(np.linspace(*y, len(names)), names)
    return figure


@pytest.mark.parametrize("names", [(), ("a", tex("eta_trans"), "long name")], ids=["numbers", "names"])
def test_labels_of_ticks_and_axes_are_where_matplotlib_sets_them(names: tuple[str, ...]) -> None:
    with house_style():
        usual, quick = example(names=names), example(names=names)
        for figure in (usual, quick):
            figure.set_dpi(POINTS)
        renderer = RendererSVG(600, 300, io.StringIO())  # type: ignore[no-untyped-call]
        usual.align_ylabels(usual.axes)
        usual.draw(renderer)
        quicken(quick)
        for ax, other in zip(usual.axes, quick.axes, strict=True):
            drawings = [artist for artist in other.get_children() if isinstance(artist, AxisDrawing)]
            for axis, drawing in zip((ax.xaxis, ax.yaxis), drawings, strict=True):
                low, high = axis.get_view_interval()
                shown = [tick.label1 for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
                shown = [text for text in shown if text.get_visible() and text.get_text()]
                assert [label.text for label in drawing.labels] == [text.get_text() for text in shown]
                places = [text.get_window_extent(renderer).x0 for text in shown]
                assert [label.x for label in drawing.labels] == pytest.approx(places, abs=SEEN)
            for axis, quicker in ((ax.xaxis, other.xaxis), (ax.yaxis, other.yaxis)):
                found = [one.label.get_window_extent(renderer).extents for one in (axis, quicker)]
                assert found[0] == pytest.approx(found[1], abs=SEEN)


@pytest.mark.parametrize("text", [*SYMBOLS, f"Power {SYMBOLS[0]} of a run", f"{SYMBOLS[0]} = 12 J, {SYMBOLS[-1]}"])
def test_symbols_are_set_as_matplotlib_sets_them(text: str) -> None:
    with house_style():
        font = FontProperties(family=FONT, size=EM)
        run, (glyphs, _, _) = text_run(text, font, is_math=True), text_to_path.get_glyphs_mathtext(font, text)
        width, height, descent = text_to_path.get_text_width_height_descent(text, font, True)
    assert [glyph.name for glyph in run.glyphs] == [name for name, *_ in glyphs]
    hundredths = 100.0 * SEEN / 8.0
    assert [glyph.x for glyph in run.glyphs] == pytest.approx([x for _, x, _, _ in glyphs], abs=hundredths)
    assert [glyph.y for glyph in run.glyphs] == pytest.approx([y for _, _, y, _ in glyphs], abs=hundredths)
    assert run[:3] == pytest.approx((width, height, descent), abs=2.0 * hundredths)


def test_every_glyph_is_defined_once_and_used_by_its_id() -> None:
    with house_style():
        text = svg_text(example(), "one")
    ids, used = re.findall(r' id="([^"]*)"', text), set(re.findall(r'(?:href="#|url\(#)([^")]*)', text))
    assert len(ids) == len(set(ids))
    assert used <= set(ids)
    assert all(name.startswith("one-") for name in ids)


def test_a_figure_is_drawn_alike_again_and_again() -> None:
    with house_style():
        figure = example()
        texts = {svg_text(figure, "one"), svg_text(figure, "one"), svg_text(example(), "one")}
    assert len(texts) == 1


def test_the_size_of_a_text_grows_with_its_font() -> None:
    with house_style():
        small, large = text_size("Power", 7.0), text_size("Power", 14.0)
    assert large == pytest.approx([2.0 * x for x in small])


def test_a_letter_that_the_font_lacks_is_drawn_without_a_warning() -> None:
    with house_style():
        figure = example(names=("a", "記録", "c"))
        assert "<svg" in svg_text(figure, "one")
