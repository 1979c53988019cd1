"""What page and PDF share: the files of a figure, the same each time that it is drawn, and the folder
of the templates.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

from winchcascade.core.version import GENERATOR
from winchcascade.report.figures.style import house_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ABOUT: dict[str, dict[str, str | None]] = {
    "svg": {"Date": None, "Creator": GENERATOR},
    "pdf": {"CreationDate": None, "Creator": GENERATOR},
    "png": {"Software": GENERATOR},
}


_DRAWN: WeakKeyDictionary[Figure, dict[str, bytes]] = WeakKeyDictionary()
"""Files of the figures of a report, by their endings: its page, its PDF and its folder of
figures share them.
"""


def drawn(figure: Figure | None, ending: str = "svg") -> bytes:
    """The figure of a picture, which does not change afterwards, as SVG, PDF or PNG."""
    assert figure is not None  # renderers leave out pictures of nothing
    files = _DRAWN.setdefault(figure, {})
    if ending not in files:
        files[ending] = _draw(figure, ending)
    return files[ending]


@house_style()
def _draw(figure: Figure, ending: str) -> bytes:
    """Draw a figure; its layout is made once, as a second one would differ by rounding."""
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine(None)
    out = io.BytesIO()
    figure.savefig(out, format=ending, dpi=300, metadata=_ABOUT[ending])
    return out.getvalue()


_PACKAGE = Path(__file__).parents[2]


def template_folder() -> Path:
    """Folder of the report's templates."""
    inside = _PACKAGE / "templates"
    return inside if inside.is_dir() else _PACKAGE.parent / "templates"
