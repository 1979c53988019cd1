"""Where texts and marks of a figure stand: no text may lie over another or leave the figure, no
mark its axes.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from matplotlib.transforms import Bbox

EDGE = 1.0
"""What two texts may share, and what one may stick out of a figure. [px]"""


def texts_of(figure: Figure) -> Iterator[Text]:
    """Every text of a figure that is drawn."""
    figure.draw_without_rendering()
    yield from figure.texts
    for legend in figure.legends:
        yield from legend.get_texts()
    for ax in figure.axes:
        for one in (ax, *ax.child_axes):
            if one.get_visible():
                yield from _of_axes(one)


def _of_axes(ax: Any) -> Iterator[Text]:
    yield from (ax.title, ax._left_title, *ax.texts)
    legend = ax.get_legend()
    yield from [] if legend is None else legend.get_texts()
    for axis in (ax.xaxis, ax.yaxis) if ax.axison else ():
        low, high = sorted(axis.get_view_interval())
        shown = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        yield from (
            label for tick in shown for label in (tick.label1, tick.label2) if label.get_visible()
        )
        yield axis.label


def misplaced(figure: Figure) -> list[str]:
    """Texts that lie over another one or leave the figure."""
    boxes = [
        (text.get_text(), text.get_window_extent())
        for text in texts_of(figure)
        if text.get_text().strip()
    ]
    whole = figure.bbox.padded(EDGE)
    outside = [name for name, box in boxes if not _within(box, whole)]
    return outside + [
        f"{a} on {b}" for (a, one), (b, two) in combinations(boxes, 2) if _overlap(one, two)
    ]


def _within(box: Bbox, whole: Bbox) -> bool:
    return bool(
        whole.x0 <= box.x0 and box.x1 <= whole.x1 and whole.y0 <= box.y0 and box.y1 <= whole.y1
    )


def _overlap(one: Bbox, two: Bbox) -> bool:
    across = min(one.x1, two.x1) - max(one.x0, two.x0)
    return bool(across > EDGE and min(one.y1, two.y1) - max(one.y0, two.y0) > EDGE)


# ------------------------------------------------------------------------------------------ marks
BEYOND = 1e-6
"""What a mark may lie beyond an axis, over its length. [1]"""


def outlying(figure: Figure) -> list[str]:
    """Lines, marks and bars of data of which a part lies outside its axes."""
    return [
        f"{ax.get_title(loc='left') or ax.get_ylabel()}: {kind}"
        for ax in figure.axes
        if ax.get_visible() and ax.axison
        for kind, points in _marks(ax)
        if not _inside(ax, points)
    ]


def _marks(ax: Any) -> Iterator[tuple[str, Any]]:
    """Kinds of what is drawn by data in both directions, with their points, (n, 2)."""
    for line in ax.lines:
        if line.get_transform() == ax.transData:
            yield "line", line.get_xydata()
    for several in ax.collections:
        if isinstance(several, LineCollection) and several.get_transform() == ax.transData:
            for segment in several.get_segments():
                yield "segment", segment
    for patch in ax.patches:
        if isinstance(patch, Rectangle) and patch.get_data_transform() == ax.transData:
            yield "bar", patch.get_bbox().get_points()


def _inside(ax: Any, points: Any) -> bool:
    known = np.asarray(points, dtype=float)
    known = known[np.isfinite(known).all(axis=1)]
    limits = np.sort(np.array([ax.get_xlim(), ax.get_ylim()]), axis=1)
    room = BEYOND * np.diff(limits, axis=1)[:, 0]
    return bool(((known >= limits[:, 0] - room) & (known <= limits[:, 1] + room)).all())
