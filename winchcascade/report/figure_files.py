"""A figure for a journal as SVG, PDF and PNG: white paper, text that stays text, fonts embedded, from 7 to 9 pt."""

from __future__ import annotations

import base64
import html
import io
import re
import warnings
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager
from matplotlib.text import Text

from winchcascade.core.version import __version__
from winchcascade.report.provenance import made_at
from winchcascade.report.publish import fonts_for, lacking_letters
from winchcascade.report.text_runs import FONT

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
