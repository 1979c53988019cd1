"""A figure for a journal: its layout at the width of a column, and its files, with text that stays text and fonts embedded."""

from __future__ import annotations

import base64
import html
import io
import re
import warnings
from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from winchcascade.core.version import __version__
from winchcascade.report.publish import fonts_for, lacking_letters
from winchcascade.report.sheet import made_at
from winchcascade.report.style import broken, columns_within, is_narrow
from winchcascade.report.svg_drawing import FONT

SMALLEST, LARGEST = 7.0, 9.0
"""Sizes between which every text is set. [pt]"""

_EDGE = 0.03
"""Free space at the edges of a figure and between its legends. [in]"""

_ROUNDS = 3
"""Passes of the layout: a title that is broken moves what stands below it."""

_APART = 0.05
"""Free space between two panels, over their height."""

_NAMES = 0.4
"""Share of the width that the names of rows may take before they are broken into lines."""


def lay_out(figure: Figure) -> None:
    """Fit a figure that was drawn for the present width to it; its panels keep their heights, and its own height follows.

    A figure that places its panels itself keeps its layout, apart from the sizes of its texts.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontsize(min(max(float(text.get_fontsize()), SMALLEST), LARGEST))
    _close_gaps(figure)
    if not is_narrow() or any(ax.get_subplotspec() is None for ax in figure.axes):
        return
    wanted = sum(_height(figure, ax) for ax in figure.axes)
    legends = [_in_columns(figure, legend) for legend in [*figure.legends, *_too_wide(figure)]]
    for grid in {ax.get_gridspec() for ax in figure.axes}:
        assert grid is not None
        grid.hspace = _APART
    for _ in range(_ROUNDS):
        height = float(figure.get_figheight())
        head = _stack(figure, legends)
        figure.set_layout_engine("constrained", rect=(0.0, 0.0, 1.0, 1.0 - head / height), h_pad=_EDGE, w_pad=_EDGE)
        figure.draw_without_rendering()
        for ax in figure.axes:
            _fit_panel(figure, ax)
        figure.set_figheight(height + wanted - sum(_height(figure, ax) for ax in figure.axes))
    _stack(figure, legends)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")


def _height(figure: Figure, ax: Axes) -> float:
    """Height of a panel. [in]"""
    return float(ax.get_position().height * figure.get_figheight())


def _extent(figure: Figure, item: Text | Legend) -> Bbox:
    """What a text or a legend covers. [in]"""
    return item.get_window_extent().transformed(figure.dpi_scale_trans.inverted())


def _close_gaps(figure: Figure) -> None:
    """Take away panels that hold nothing, and the rows that only they have."""
    for ax in [ax for ax in figure.axes if not ax.get_visible() or not ax.axison]:
        spec = ax.get_subplotspec()
        if spec is None:
            continue
        ax.remove()
        grid = spec.get_gridspec()
        used = {row for other in figure.axes if (own := other.get_subplotspec()) for row in own.rowspan}
        grid.set_height_ratios([1.0 if row in used else 1e-6 for row in range(grid.nrows)])


def _too_wide(figure: Figure) -> list[Legend]:
    """Legends above a panel that are wider than it."""
    found = [(ax, legend) for ax in figure.axes if (legend := ax.get_legend()) is not None]
    widths = [(legend, float(ax.get_position().width * figure.get_figwidth())) for ax, legend in found]
    return [legend for legend, width in widths if _extent(figure, legend).width > width]


def _in_columns(figure: Figure, legend: Legend) -> Legend:
    """The same legend with as many columns as the width has room for."""
    texts = [text.get_text() for text in legend.get_texts()]
    handles = [handle for handle in legend.legend_handles if handle is not None]
    legend.remove()
    return figure.legend(
        handles, texts, loc="upper left", ncols=columns_within(texts), columnspacing=1.1, handlelength=2.0, borderaxespad=0.1
    )  # fmt: skip


def _stack(figure: Figure, legends: Sequence[Legend]) -> float:
    """Set the legends one below the other at the top, texts of the figure beside the last; gives the height of all [in]."""
    height, top = float(figure.get_figheight()), 0.0
    for legend in legends:
        legend.set_bbox_to_anchor((0.01, 1.0 - top / height), transform=figure.transFigure)
        top += _extent(figure, legend).height + _EDGE
    for text in figure.texts:
        text.set_position((0.985, 1.0 - (top + 0.5 * _extent(figure, text).height) / height))
        top += _extent(figure, text).height + _EDGE
    return top


def _fit_panel(figure: Figure, ax: Axes) -> None:
    """Break texts of a panel that are wider than there is room, and part its title from its legend, and its ticks."""
    room = float(figure.get_figwidth()) - 2.0 * _EDGE
    left = float(ax.get_position().x0) * room
    title = ax.get_title(loc="left")
    size = float(ax.title.get_fontsize())
    lines = _broken(figure, title, size, room - left)
    ax.set_title(lines, loc="left", pad=3.0 + _legend_beside(figure, ax, lines), fontsize=size)
    ax.set_xlabel(_broken(figure, ax.get_xlabel(), float(ax.xaxis.label.get_fontsize()), room - left))
    _break_names(figure, ax, room)
    extents = [_extent(figure, label) for label in ax.get_xticklabels() if label.get_text() and label.get_visible()]
    if any(a.x1 > b.x0 for a, b in pairwise(extents)):
        ax.tick_params(axis="x", rotation=90)


def _broken(figure: Figure, text: str, size: float, width: float) -> str:
    """A text in lines of some width [in]; one with mathematics stays as it is."""
    if not text or "$" in text:
        return text
    probe = figure.text(0.0, 0.0, text, fontsize=size)
    wide = _extent(figure, probe).width
    probe.remove()
    whole = " ".join(text.split())
    return text if wide <= width else broken(whole, max(int(len(whole) * width / wide), 8))


def _legend_beside(figure: Figure, ax: Axes, title: str) -> float:
    """Height of a legend above a panel that its title would touch, 0 where they stand apart. [pt]"""
    legend = ax.get_legend()
    if legend is None or not title:
        return 0.0
    covered, panel = _extent(figure, legend), ax.get_position()
    above = covered.y0 >= (panel.y1 * float(figure.get_figheight())) - 0.05
    own = _extent(figure, next(t for t in ax.findobj(Text) if isinstance(t, Text) and t.get_text() == title))
    return 72.0 * covered.height if above and own.x1 + _EDGE > covered.x0 else 0.0


def _break_names(figure: Figure, ax: Axes, room: float) -> None:
    """Break names of rows that would take too much of the width."""
    labels = ax.get_yticklabels()
    if any(_extent(figure, label).width > _NAMES * room for label in labels):
        size = float(labels[0].get_fontsize())
        names = [_broken(figure, label.get_text(), size, _NAMES * room) for label in labels]
        ax.set_yticks(ax.get_yticks(), names, fontsize=size)


ENDINGS = ("svg", "pdf", "png")
"""Files of a figure."""

DPI = 600
"""Dots per inch of a bitmap: what journals expect of drawings with lines and letters."""

_GENERATOR = f"winchcascade/{__version__}"

_FACES = {"normal": "DejaVuSans.ttf", "italic": "DejaVuSans-Oblique.ttf", "bold": "DejaVuSans-Bold.ttf"}
"""Files of the fonts that figures are set in."""


_USUAL = "".join(map(chr, range(0x20, 0x7F))) + "\u2212–…·²³°±×ηταρωµΩΔ"
"""Characters that are embedded with those of a figure, so that most figures share one subset of a font."""


def figure_files(figure: Figure) -> dict[str, bytes]:
    """The files of a figure by their ending, drawn with the settings of the moment."""
    figure.set_facecolor("white")
    _use_other_fonts(figure)
    with matplotlib.rc_context({"svg.fonttype": "none"}), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a letter that the font lacks, which is drawn as a box
        return {
            "svg": _svg(figure),
            "pdf": _saved(figure, "pdf", {"Creator": _GENERATOR, "CreationDate": made_at()}),
            "png": _saved(figure, "png", {"Software": _GENERATOR}),
        }


def _use_other_fonts(figure: Figure) -> None:
    """Set texts with letters that the font of figures lacks in fonts of this system that hold them, if there are any."""
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text)]
    lacking = lacking_letters("".join(text.get_text() for text in texts))
    names = []
    for file, _ in fonts_for(lacking) if lacking else []:
        fontManager.addfont(file)
        names.append(FontProperties(fname=file).get_name())
    for text in texts if names else ():
        if lacking & set(text.get_text()):
            text.set_fontfamily([FONT, *names])


def _saved(figure: Figure, kind: str, about: dict[str, object]) -> bytes:
    out = io.BytesIO()
    figure.savefig(out, format=kind, dpi=DPI, metadata=about)
    return out.getvalue()


def _svg(figure: Figure) -> bytes:
    """A figure as SVG whose texts can be searched and edited, with the glyphs of its fonts embedded."""
    text = _saved(figure, "svg", {"Date": None, "Creator": _GENERATOR}).decode()
    used = {c for part in re.findall(r">([^<>]+)</t", text) for c in html.unescape(part)}
    faces = [_face(name, "".join(sorted(used | set(_USUAL)))) for name in _faces_in(text)]
    return text.replace('<style type="text/css">', f'<style type="text/css">{"".join(faces)}', 1).encode()


def _faces_in(svg: str) -> Iterable[str]:
    """Which of the fonts a figure uses."""
    styles = " ".join(re.findall(r'<(?:text|tspan)[^>]*style="([^"]*)"', svg))
    looks = {"italic": r"italic|oblique|Oblique", "bold": r"bold|\b700\b"}
    return ["normal", *(name for name, look in looks.items() if re.search(look, styles))]


@lru_cache(maxsize=64)
def _face(name: str, characters: str) -> str:
    """A rule of CSS that holds the glyphs of some characters of a font."""
    from fontTools.subset import Options, Subsetter, load_font

    options = Options(notdef_outline=True, layout_features=[])
    options.drop_tables = [*options.drop_tables, "FFTM", "GPOS", "GSUB", "GDEF"]
    out = io.BytesIO()
    with load_font(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / _FACES[name], options) as font:
        subset = Subsetter(options)
        subset.populate(text=characters)
        subset.subset(font)
        font.flavor = "woff"
        font.save(out)
    look = {"italic": "font-style:italic;", "bold": "font-weight:bold;"}.get(name, "")
    data = base64.b64encode(out.getvalue()).decode()
    return f"@font-face{{font-family:'DejaVu Sans';{look}src:url(data:font/woff;base64,{data}) format('woff')}}"
