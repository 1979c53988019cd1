"""The PDF: every text as it is, whole numbers, filled pages, and letters of any script."""

import io
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pypdf
import pytest

from winchcascade import __version__
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.content import PAIRS, Cell, Column, Note, Report, Span, Table, section
from winchcascade.report.glossary import typeset
from winchcascade.report.render.pdf import pdf_bytes
from winchcascade.report.results.reduction import reduction_report

CLEAN = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"

MARKUP = (
    "#let x = 1 #panic() $x^2$ *star* _low_ @ref `code` \\ \\n <label> // note /* no */ ~ -- --- "
    "... = head [body] {code} "
    "\"double\" 'single' & 100 % {{ 7*7 }}"
)
"""What Typst might take for something else than text."""

MAX_PAGES = 10
"""Of a log of three cycles; a page more would be one that is all but empty."""


class Made(NamedTuple):
    pages: tuple[str, ...]
    metadata: dict[str, object]

    @property
    def text(self) -> str:
        return "\n".join(self.pages)


def made(report: Report) -> Made:
    read = pypdf.PdfReader(io.BytesIO(pdf_bytes(report)))
    return Made(tuple(page.extract_text() for page in read.pages), dict(read.metadata or {}))


def squeezed(text: str) -> str:
    """Text without what a line break, a low-set letter, or a break within a long word may
    change.
    """
    return re.sub(r"[\s_\u200b]", "", typeset(text))


def of_a_note(title: str, subtitle: str = "", *notes: Note) -> Report:
    """A report that is quick to typeset."""
    return Report(
        "Kind", title, subtitle, sections=[section("note", "Note", *(notes or (Note("Nothing."),)))]
    )


def test_a_log_fills_its_pages_which_are_numbered_and_named() -> None:
    reduction = reduce(read_run(CLEAN, load=36.0, campaign=False), window=5.48)
    report = reduction_report(
        reduction, uncertainty(reduction), command="winchcascade reduce r36ohm.csv"
    )
    pages, metadata = made(report)
    assert str(metadata["/Title"]).startswith("r36ohm.csv")
    assert metadata["/Author"] == f"winchcascade/{__version__}"
    assert 3 <= len(pages) <= MAX_PAGES
    for k, text in enumerate(pages, start=1):
        assert text.rstrip().endswith(f"{k} / {len(pages)}")
        assert text.startswith("r36ohm.csv") == (k > 1)
        assert len(text.strip().splitlines()) > 2
    first = squeezed(pages[0])
    for tile in report.tiles:
        assert (
            squeezed(tile.name)
            + squeezed(tile.about)
            + squeezed(tile.value)
            + squeezed(tile.beside)
            in first
        )
    assert all(squeezed(point.about) + squeezed(point.text) in first for point in report.notes)
    assert "η_trans" not in "".join(pages)
    assert "ηtrans" in "".join(pages)


def test_texts_appear_as_they_are() -> None:
    text = squeezed(
        made(of_a_note(f"title {MARKUP}", f"subtitle {MARKUP}", Note(f"note {MARKUP}"))).text
    )
    assert [
        word for word in ("title", "subtitle", "note") if squeezed(f"{word} {MARKUP}") not in text
    ] == []


def test_a_name_or_command_that_looks_like_a_symbol_keeps_its_underscore() -> None:
    table = Table(
        "provenance", "Where from.", PAIRS, [("Command", "winchcascade reduce P_gen.csv")]
    )
    report = of_a_note("E_line.csv MyE_line log_E_line_2.csv")
    text = made(msgspec.structs.replace(report, sections=[section("from", "From", table)])).text
    assert "E_line.csv MyE_line log_E_line_2.csv" in text
    assert "reduce P_gen.csv" in text


@pytest.mark.parametrize(
    "word", ["測試", "\U0001f300", "\u0378"], ids=["cjk", "symbol", "no letter"]
)
def test_a_letter_without_a_font_is_shown_by_its_code(word: str) -> None:
    text = made(of_a_note(f"log {word}.csv", f"rig {word}")).text
    coded = "".join(f"⟨U+{ord(c):04X}⟩" for c in word)
    assert all(before + word in text or before + coded in text for before in ("log ", "rig "))


def test_letters_of_the_fonts_at_hand_are_shown_as_they_are() -> None:
    words = ["Σύνθεση", "Проба", "naïve Ångström", "½ ≤ ∞ → ⟨x⟩", "H₂O m³"]
    text = made(of_a_note("log", "", *map(Note, words))).text
    assert [word for word in words if word not in text] == []


@pytest.mark.parametrize("mark", ["\u202e", "\u2067"], ids=["override", "isolate"])
def test_a_mark_of_writing_direction_turns_no_other_text_around(mark: str) -> None:
    filler = [Note(f"{k} " + "word " * 120) for k in range(12)]
    _, second, *_ = made(of_a_note(f"log {mark}abc.csv", "", *filler)).pages
    assert f"winchcascade/{__version__}" in second.splitlines()[0]


def test_control_characters_are_shown_by_their_codes_and_a_text_longer_than_a_page_is_cut() -> None:
    text = made(of_a_note("log", "rig \x07\x1b\x85 end", Note("x" * 3000))).text
    assert "rig ⟨U+0007⟩⟨U+001B⟩⟨U+0085⟩ end" in text
    assert "(2000charactersmore)" in squeezed(text)


SENTENCE = "The effective volume of the gas differs from that of the accumulator, by as much as the pressure of a payout shows"


def _table(name: str, rows: int, *texts: str) -> Table[Any]:
    """A table of names, numbers, and texts at the end."""
    row = (
        "Rotor friction (rotor_friction)",
        "transmission",
        0.2186,
        Span(-0.01635, -0.01269),
        "> 0.99",
        *texts,
    )
    head = (
        "Effect",
        "Stage",
        "Found",
        "Interval",
        "Probability",
        *(f"Text {k}" for k in range(len(texts))),
    )
    columns = [Column[Any](title, partial(_item, k), decimals=5) for k, title in enumerate(head)]
    return Table(name, "Caption.", columns, [row] * rows)


def _item(k: int, row: Sequence[Cell]) -> Cell:
    return row[k]


def _of_tables(*found: Table[Any]) -> Report:
    return Report("Kind", "Title", sections=[section("s", "Heading", *found)])


@pytest.mark.parametrize("texts", [1, 2])
def test_a_long_text_beside_many_columns_has_lines_of_several_words_and_numbers_stay_whole(
    texts: int,
) -> None:
    done = made(_of_tables(_table("t", 4, *[SENTENCE] * texts)))
    lines = done.text.splitlines()
    assert len(done.pages) == 1
    assert done.text.count("−0.01635 to −0.01269") == 4
    assert sum("The effective" in line for line in lines) == 4 * texts
    assert not [line for line in lines if line.strip() in SENTENCE.split()[:-1]]
