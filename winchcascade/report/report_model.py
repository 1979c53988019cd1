"""The content of a report: sections of tables and figures, made once, which HTML and PDF only lay out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import msgspec

from winchcascade.core.version import __version__
from winchcascade.report.table_model import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Tone = Literal["plain", "good", "warn"]


class Picture(msgspec.Struct, frozen=True, tag="picture"):
    """A figure as SVG text with named colours in it (`figures.COLOURS`); `alt` describes in words what it shows.

    `marks` is the JSON of its axes and series, with which a page zooms, reads and switches them.
    """

    id: str
    caption: str
    alt: str
    svg: str
    interactive: bool = False
    marks: str = ""


class Note(msgspec.Struct, frozen=True, tag="note"):
    """A paragraph, and what it is about where that is set before it."""

    text: str
    about: str = ""


def picture(figure: Figure | None, name: str, caption: str, alt: str, *, interactive: bool = False) -> Picture | None:
    """A figure as a block of a report; None for none. In a format that takes figures it is taken, and the block is empty."""
    from winchcascade.report.interaction import mark
    from winchcascade.report.style import present_format
    from winchcascade.report.svg_drawing import svg_text

    if figure is None:
        return None
    take = present_format().take
    if take is not None:
        take(name, figure)
        return Picture(name, caption, alt, "", interactive)
    marks = mark(figure)
    return Picture(name, caption, alt, svg_text(figure, name), interactive, marks)


Block = Table | Picture | Note


class Section(msgspec.Struct, frozen=True):
    """A heading and what stands under it."""

    id: str
    heading: str
    blocks: tuple[Block, ...]


def section(name: str, heading: str, *blocks: Block | None) -> Section:
    """A section of the blocks that there are."""
    return Section(name, heading, tuple(b for b in blocks if b is not None))


class Tile(msgspec.Struct, frozen=True):
    """One number of the summary: its name, value, 95 % interval, and what it is."""

    symbol: str
    name: str
    value: str
    interval: str


class Point(msgspec.Struct, frozen=True):
    """One sentence of the summary: about what, the sentence, and whether it is a warning."""

    about: str
    text: str
    tone: Tone = "plain"


SUBSCRIPTS = (
    "line", "mech", "gen, cycle", "gen", "trans", "pto", "max", "min", "mean", "plateau", "hold", "payout", "returned", "net",
)  # fmt: skip
"""Subscripts of the symbols of every report."""


class Link(msgspec.Struct, frozen=True):
    """A page beside a report: what it is, and its address from there."""

    text: str
    address: str


class Report(msgspec.Struct, frozen=True):
    """A whole report, in order.

    `traces` is the JSON that the page's time histories read values from. `banner` is a warning on every page. `subscripts` are
    what may stand low behind a letter and an underscore in a text. `links` lead to the pages that belong to it. `lead` is a
    figure that stands beside the tiles.
    """

    kind: str
    title: str
    subtitle: str
    tiles: tuple[Tile, ...]
    points: tuple[Point, ...]
    sections: tuple[Section, ...]
    traces: str = ""
    banner: str = ""
    subscripts: tuple[str, ...] = SUBSCRIPTS
    links: tuple[Link, ...] = ()
    lead: Picture | None = None
    generator: str = f"winchcascade/{__version__}"
