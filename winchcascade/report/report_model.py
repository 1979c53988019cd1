"""What a report is made of: rows and figures, made once, that HTML and PDF only lay out."""

from __future__ import annotations

from typing import Literal

import msgspec

Tone = Literal["plain", "good", "warn"]

LONG = 32
"""A column with a longer text than this is one of sentences. [characters]"""


class Table(msgspec.Struct, frozen=True, tag="table"):
    """Rows of texts under a head of names and units; `summary` rows at the end stand apart.

    `text_columns` are set to the left, all others are numbers. `note` follows the table. `links` are addresses that the
    first cell of each row leads to, none or one for every row.
    """

    id: str
    caption: str
    head: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text_columns: tuple[int, ...] = (0,)
    summary: int = 0
    note: str = ""
    links: tuple[str, ...] = ()

    def is_long(self, column: int) -> bool:
        """Whether a column holds sentences, which may be broken into lines."""
        return any(len(row[column]) > LONG for row in self.rows)


class Picture(msgspec.Struct, frozen=True, tag="picture"):
    """A figure as SVG text with named colours in it (`figures.COLOURS`); `alt` says in words what it shows."""

    id: str
    caption: str
    alt: str
    svg: str
    interactive: bool = False


class Note(msgspec.Struct, frozen=True, tag="note"):
    """A paragraph, and what it is about where that is set before it."""

    text: str
    about: str = ""


Block = Table | Picture | Note


class Section(msgspec.Struct, frozen=True):
    """A heading and what stands under it."""

    id: str
    heading: str
    blocks: tuple[Block, ...]


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


class Report(msgspec.Struct, frozen=True):
    """A whole report, in order.

    `traces` is the JSON that the page's time histories read values from. `banner` is a warning on every page.
    """

    kind: str
    title: str
    subtitle: str
    generator: str
    tiles: tuple[Tile, ...]
    points: tuple[Point, ...]
    sections: tuple[Section, ...]
    traces: str = ""
    banner: str = ""
