"""Laws of every report: it is well laid out everywhere, escapes what it names, and states each
number once.
"""

from __future__ import annotations

import io
import re
from collections import Counter, defaultdict
from decimal import Decimal
from typing import TYPE_CHECKING

import pandas as pd
import pypdf
import pytest
from every_report import KINDS, KITE, SLOW, Made, made
from layout import misplaced, outlying
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from page_reader import PageReader
from stated import tables
from stated import texts as stated_texts

from winchcascade.report.content import PROVENANCE, Picture, Report, Table
from winchcascade.report.figures.style import house_style
from winchcascade.report.glossary import typeset
from winchcascade.report.render.pdf import pdf_bytes
from winchcascade.report.render.report_files import write_tables
from winchcascade.report.render.terminal import PIPE, Screen, terminal_text, use_screen

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

ODD = 'a <b>log<i> & "q" {{ 7*7 }} #x $y$ *z* '
"""How the names of logs begin."""

TITLE = (
    '<b>bold</b> <script>alert(1)</script> & &amp; "double" {{ 7*7 }} {% raw %} {# no #} #let x = '
    "1 $x^2$ *star* "
    "_low_ @ref `code` </style> --> ]]> ${1} https://example.org/ 測試 <img src=x onerror=alert(1)>"
)
"""What a page, a template or a typesetter might take for something else than the title of a
campaign.
"""

WIDTHS = (60, 80, 100)
"""Columns of terminals."""

LOAD = re.compile(r"[\d.]+ Ω|open circuit")
"""A load as a legend names it."""

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], list[Made]]:
    """The pages of a kind, made once."""
    known: dict[str, list[Made]] = {}

    def give(kind: str) -> list[Made]:
        if kind == "line" and not KITE.is_dir():
            pytest.skip("needs ../shared/data, which only the project's own machines have")
        if kind not in known:
            known[kind] = made(kind, tmp_path_factory.mktemp("kind"), odd=ODD, title=TITLE)
        return known[kind]

    return give


@pytest.fixture(
    params=[pytest.param(kind, marks=pytest.mark.slow) if kind in SLOW else kind for kind in KINDS]
)
def pages(request: pytest.FixtureRequest, written: Callable[[str], list[Made]]) -> list[Made]:
    """The pages of one kind after the other."""
    return written(request.param)


def pictures(report: Report) -> list[Picture]:
    return report.illustrated().pictures


def figure_of(picture: Picture) -> Figure:
    assert picture.figure is not None
    return picture.figure


def texts(report: Report) -> Iterator[str]:
    """Every text that a report states, also those of its figures."""
    yield from stated_texts(report)
    for picture in pictures(report):
        yield from (
            text.get_text() for text in figure_of(picture).findobj(Text) if isinstance(text, Text)
        )


# --------------------------------------------------------------------------------------- the page
def test_a_page_is_well_formed_and_asks_for_nothing(pages: list[Made]) -> None:
    for report, page in pages:
        read = PageReader(page)
        assert page.startswith("<!doctype html>")
        assert read.faults == [], report.kind
        assert {name: n for name, n in Counter(read.values("id")).items() if n > 1} == {}, (
            report.kind
        )
        assert read.dangling() == set(), report.kind
        assert read.requests() == [], report.kind


def test_a_name_from_a_file_is_a_text_wherever_it_stands(pages: list[Made]) -> None:
    for report, page in pages:
        read = PageReader(page)
        assert not {"i", "img"} & {tag for tag, _ in read.elements}
        marked = {text.strip() for tag, text in read.texts if tag == "b"}
        assert not {"log", "bold"} & marked, report.kind
        assert read.foreign_scripts() == [], report.kind
        assert " 49 " not in read.shown
        assert not re.search(r"[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f]", page)


def squeezed(text: str) -> str:
    """A text without what a line break, a low-set letter, or a break within a long word may
    change.
    """
    return re.sub(r"[\s_\u200b]", "", typeset(text))


def test_every_cell_of_every_table_is_in_the_page(pages: list[Made]) -> None:
    for report, page in pages:
        found = re.findall(r"<t[hd][ >].*?</t[hd]>", page, re.DOTALL)
        shown = Counter(
            squeezed("".join(text for _, text in PageReader(cell).texts)) for cell in found
        )
        for table in tables(report):
            count, rows = len(table.items), table.texts
            wanted = Counter(
                squeezed(cell)
                for row in [*table.shortened(rows[:count]), *rows[count:]]
                for cell in row
                if cell
            )
            assert not {cell: n for cell, n in wanted.items() if shown[cell] < n}, (
                report.kind,
                table.id,
            )


# -------------------------------------------------------------------- terminal, PDF and the files
def test_no_line_is_longer_than_the_terminal(pages: list[Made]) -> None:
    for report, _ in pages:
        for width in WIDTHS:
            use_screen(Screen(width))
            try:
                text = terminal_text(report)
            finally:
                use_screen(PIPE)
            assert [line for line in text.splitlines() if len(line) > width] == [], report.kind
            assert "\x1b" not in text


@pytest.mark.slow
def test_a_pdf_states_every_cell_and_every_caption(pages: list[Made]) -> None:
    for report, _ in pages:
        content = pypdf.PdfReader(io.BytesIO(pdf_bytes(report)))
        read = [page.extract_text() for page in content.pages]
        whole = squeezed("".join(read))
        for table in tables(report):
            rows = [
                *table.shortened(table.texts[: len(table.items)]),
                *table.texts[len(table.items) :],
            ]
            absent = [
                cell
                for row in rows
                for cell in row
                if not set(squeezed(cell)) & set("測") and squeezed(cell) not in whole
            ]
            assert absent == [], (report.kind, table.id)
        assert [one.caption for one in pictures(report) if squeezed(one.caption) not in whole] == []
        assert min(len(text.strip().splitlines()) for text in read) > 2


def test_files_hold_the_numbers_in_full(pages: list[Made], tmp_path: Path) -> None:
    for k, (report, _) in enumerate(pages):
        write_tables(report, tmp_path / f"{k}", "name")
        for table in (one for one in tables(report) if one.id != PROVENANCE):
            again = pd.read_csv(tmp_path / f"{k}" / f"name_{table.id}.csv")
            frame = table.frame()
            assert len(again.columns) == len(frame.columns)
            for (_, mine), (_, theirs) in zip(frame.items(), again.items(), strict=True):
                if pd.api.types.is_float_dtype(mine):
                    assert theirs.to_numpy(float) == pytest.approx(
                        mine.to_numpy(float), nan_ok=True
                    )


# ------------------------------------------------------------------------------------ the content
def test_no_text_holds_a_minus_zero_or_a_value_of_the_language(pages: list[Made]) -> None:
    wrong = re.compile(
        r"(?<![\w.)])[-\u2212]0(\.0+)?(?![\w.])|\bnan\b|\bNone\b(?! of| "
        r"in|\.)|\bNaN\b|[\[(]'|Measured\(|Span\("
    )
    for report, _ in pages:
        assert [text for text in texts(report) if wrong.search(text)] == [], report.kind


def test_every_block_has_a_name_of_its_own_a_caption_and_words_for_its_drawing(
    pages: list[Made],
) -> None:
    for report, _ in pages:
        blocks: list[Table[object] | Picture] = [*tables(report), *pictures(report)]
        assert max(Counter(block.id for block in blocks).values(), default=1) == 1, report.kind
        assert len({one.id for one in report.sections}) == len(report.sections)
        assert [block.id for block in blocks if not block.caption.endswith((".", ":", "?"))] == []
        assert [one.id for one in pictures(report) if len(one.alt) < 10] == []


def test_no_text_of_a_figure_lies_over_another(pages: list[Made]) -> None:
    for report, _ in pages:
        for one in pictures(report):
            with house_style():
                assert misplaced(figure_of(one)) == [], (report.kind, one.id)


def test_every_mark_of_a_figure_lies_inside_its_axes(pages: list[Made]) -> None:
    for report, _ in pages:
        for one in pictures(report):
            assert outlying(figure_of(one)) == [], (report.kind, one.id)


def test_a_load_has_one_colour_on_all_figures_of_a_page(pages: list[Made]) -> None:
    for report, _ in pages:
        colours: dict[str, set[str]] = defaultdict(set)
        for one in pictures(report):
            for legend in figure_of(one).legends:
                for line, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
                    if isinstance(line, Line2D) and LOAD.fullmatch(text.get_text()):
                        colours[text.get_text()].add(to_hex(line.get_color()))
        assert [load for load, several in colours.items() if len(several) > 1] == []
        assert len(set(map(str, colours.values()))) == len(colours)


def test_no_quantity_has_two_numbers_on_a_page(pages: list[Made]) -> None:
    for report, _ in pages:
        for quantity, shown in stated(report).items():
            first, *others = shown
            assert [other for other in others if not agree(first, other)] == [], (
                report.kind,
                quantity,
                dict(shown),
            )


def agree(one: str, other: str) -> bool:
    """Whether two texts hold the same numbers, to the decimals of the one that has fewer."""
    pairs = [[Decimal(number) for number in NUMBER.findall(text)] for text in (one, other)]
    if len(pairs[0]) != len(pairs[1]):
        return False
    ends = [
        max(int(a.as_tuple().exponent), int(b.as_tuple().exponent))
        for a, b in zip(*pairs, strict=True)
    ]
    return all(round(a, -end) == round(b, -end) for a, b, end in zip(*pairs, ends, strict=True))


def stated(report: Report) -> dict[tuple[str, ...], dict[str, list[str]]]:
    """What a report states of each quantity, texts with the tables that hold them.

    A quantity is its row, its column and its unit, and the metric in the name of the table: the
    mean of `eta_pto` in a table of means is that in the last row of a table of cycles. Rows of one
    table with the same label are several things.
    """
    found: dict[tuple[str, ...], dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for table in tables(report):
        labels = [_label(row, table) for row in table.texts]
        metric = re.findall(r"(?:eta|energy|power)-\w+", table.id)
        for label, row in zip(labels, table.texts, strict=True):
            for k, column in enumerate(table.columns):
                if labels.count(label) == 1 and k not in label[1] and re.search(r"\d", row[k]):
                    key = (*sorted((label[0], column.name)), column.unit, *metric)
                    found[key][row[k]].append(table.id)
    for tile in report.tiles:
        for key in list(found):
            if {tile.name, "mean"} == set(key[:2]):
                found[key][tile.value].append("tile")
    return found


def _label(row: list[str], table: Table[object]) -> tuple[str, tuple[int, ...]]:
    """What a row is about: the texts before its first number, a count of cycles apart; and their
    columns.
    """
    k = 1
    while k < len(row) and table.left[k]:
        k += 1
    text = " / ".join(row[:k])
    return re.sub(r"^mean of \d+$", "mean", text), tuple(range(k))
