"""The PDF: the same numbers as the page, every text as it is, and a file that this tool knows as its own."""

import io
import json
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import pypdf
import pytest
from undrawn import undrawn

from winchcascade import __version__
from winchcascade.cli.app import command_line
from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable
from winchcascade.core.rig_toml import parse_rig
from winchcascade.ingest.read import read_run
from winchcascade.reduction.montecarlo import uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.report.content import PAIRS, Cell, Column, Note, Picture, Report, Span, Table, section
from winchcascade.report.glossary import typeset
from winchcascade.report.render.page import page_text
from winchcascade.report.render.pdf import pdf_bytes
from winchcascade.report.render.publish import publish
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.report.results.reduction import reduction_report

CLEAN = Path(__file__).parents[2] / "fixtures" / "campaign" / "r36ohm.csv"

MARKUP = (
    "#let x = 1 #panic() $x^2$ *star* _low_ @ref `code` \\ \\n <label> // note /* no */ ~ -- --- ... = head [body] {code} "
    "\"double\" 'single' & 100 % {{ 7*7 }}"
)
"""What Typst might take for something else than text."""

MAX_PAGES = 10
"""Of a log of three cycles; a page more would be one that is all but empty."""


class Made(NamedTuple):
    report: Report
    content: bytes
    pages: tuple[str, ...]
    metadata: Mapping[str, object]

    @property
    def text(self) -> str:
        return "\n".join(self.pages)


def made(report: Report) -> Made:
    content = pdf_bytes(report)
    read = pypdf.PdfReader(io.BytesIO(content))
    assert read.metadata is not None
    return Made(report, content, tuple(page.extract_text() for page in read.pages), dict(read.metadata))


@pytest.fixture(scope="module")
def clean() -> Made:
    reduction = reduce(read_run(CLEAN, load=36.0, campaign=False), window=5.48)
    return made(drawn_report(reduction, uncertainty(reduction), command="winchcascade reduce r36ohm.csv"))


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A report whose texts all hold what Typst might take for markup; its drawings are left out."""
    name = f"log {MARKUP.replace('/', '')[:100]}.csv"
    log = tmp_path_factory.mktemp("hostile") / name
    head, *rows = CLEAN.read_text().splitlines()
    log.write_text("\n".join([f'{head},"odd #x $y$ *z*"', *(f"{row},1.5" for row in rows)]) + "\n")
    texts = {key: json.dumps(f"{key} {MARKUP}") for key in ("name", "title", "source", "note", "from")}
    rig = parse_rig(
        'based_on = "hsu2026"\n' + "".join(f"{key} = {texts[key]}\n" for key in ("name", "title", "source", "note"))
        + f'[sensors.force]\nunit = "N"\nhigh = 20000.0\naccuracy_full_scale = 0.002\n'
        f"source = {texts['from']}\n",
        "rig #x.toml",
    )  # fmt: skip
    reduction = reduce(read_run(log, rig=rig, about=f"about {MARKUP}"), rig=rig)
    return made(reduction_report(reduction, uncertainty(reduction), command=f"command {MARKUP}"))


def squeezed(text: str) -> str:
    """Text without what a line break, a low-set letter, or a break within a long word may change."""
    return re.sub(r"[\s_\u200b]", "", typeset(text))


def tables(report: Report) -> list[Table[Any]]:
    return [block.used() for block in report.blocks if isinstance(block, Table)]


def small(report: Report, **changes: object) -> Report:
    """The report without its sections but for a note: quick to typeset."""
    return msgspec.structs.replace(
        report, **({"sections": [section("note", "Note", Note("Nothing."))], "tiles": (), "points": ()} | changes)
    )


def test_the_title_and_the_maker_are_in_the_metadata(clean: Made) -> None:
    assert str(clean.metadata["/Title"]).startswith("r36ohm.csv")
    assert clean.metadata["/Author"] == f"winchcascade/{__version__}"


def test_every_page_has_its_number_and_every_page_but_the_first_its_name(clean: Made) -> None:
    n = len(clean.pages)
    assert 3 <= n <= MAX_PAGES
    for k, text in enumerate(clean.pages, start=1):
        assert text.rstrip().endswith(f"{k} / {n}")
        assert text.startswith("r36ohm.csv") == (k > 1)


def test_no_page_is_empty(clean: Made) -> None:
    assert min(len(text.strip().splitlines()) for text in clean.pages) > 2


def test_headings_and_captions_are_numbered_and_in_order(clean: Made) -> None:
    whole, at = squeezed(clean.text), 0
    numbers = {"Figure": 0, "Table": 0}
    for one in clean.report.filled:
        assert squeezed(one.heading) in whole
        for block in one.blocks:
            if isinstance(block, Note):
                continue
            word = "Figure" if isinstance(block, Picture) else "Table"
            numbers[word] += 1
            place = whole.find(squeezed(f"{word} {numbers[word]}. {block.caption}"))
            assert place > at, block.caption
            at = place


def test_every_cell_of_every_table_is_there(clean: Made) -> None:
    whole = squeezed(clean.text)
    for table in tables(clean.report):
        assert not [cell for row in table.texts for cell in row if squeezed(cell) not in whole], table.id
        assert squeezed(table.note) in whole


def test_page_and_pdf_state_the_same_cycles(clean: Made) -> None:
    html = re.search(r'<table id="table-cycles".*?</table>', page_text(clean.report), re.DOTALL)
    assert html is not None
    rows = re.findall(r"<tr>(<th scope=\"row\">.*?)</tr>", html[0], re.DOTALL)
    assert len(rows) >= 3 + 3
    for row in rows:
        assert squeezed(re.sub(r"<[^>]*>", "", row)) in squeezed(clean.text)


def test_the_summary_is_on_the_first_page(clean: Made) -> None:
    first = squeezed(clean.pages[0])
    for tile in clean.report.tiles:
        assert squeezed(tile.name) + squeezed(tile.about) + squeezed(tile.value) + squeezed(tile.beside) in first
    for point in clean.report.notes:
        assert squeezed(point.about) + squeezed(point.text) in first


def test_symbols_are_set_with_low_indices(clean: Made) -> None:
    assert "η_trans" not in clean.text
    assert "E_line" not in clean.text
    assert "ηtrans" in clean.text


def test_texts_of_a_log_and_its_rig_appear_as_they_are(hostile: Made) -> None:
    whole = squeezed(hostile.text)
    for place in ("name", "title", "source", "note", "from", "about", "command"):
        assert squeezed(f"{place} {MARKUP}") in whole, place
    assert squeezed(hostile.report.title) in whole
    assert "odd#x$y$*z*" in whole


def test_words_that_look_like_symbols_within_other_words_stay_whole(clean: Made) -> None:
    report = small(clean.report, title="E_lines MyE_line log_E_line_2.csv")
    assert "E_lines MyE_line log_E_line_2.csv" in made(report).text


def test_a_name_or_command_that_looks_like_a_symbol_keeps_its_underscore(clean: Made) -> None:
    table = Table("provenance", "Where from.", PAIRS, [("Command", "winchcascade reduce P_gen.csv")])
    text = made(small(clean.report, title="E_line.csv", sections=[section("from", "From", table)])).text
    assert "E_line.csv" in text
    assert "reduce P_gen.csv" in text


@pytest.mark.parametrize(
    "word", ["測試", "風力", "\U0001f300", "\u0378"], ids=["cjk", "more cjk", "symbol", "no letter"]
)
def test_a_letter_without_a_font_is_shown_by_its_code(clean: Made, word: str) -> None:
    text = made(small(clean.report, title=f"log {word}.csv", subtitle=f"rig {word}")).text
    coded = "".join(f"⟨U+{ord(c):04X}⟩" for c in word)
    for before in ("log ", "rig "):
        assert before + word in text or before + coded in text


@pytest.mark.parametrize("word", ["Σύνθεση", "Проба", "naïve Ångström", "½ ≤ ∞ → ⟨x⟩", "H₂O m³"])
def test_letters_of_the_fonts_at_hand_are_shown_as_they_are(clean: Made, word: str) -> None:
    assert word in made(small(clean.report, title=f"log {word}.csv")).text


@pytest.mark.parametrize("mark", ["\u202e", "\u2067", "\u202b"], ids=["override", "isolate", "embedding"])
def test_a_mark_of_writing_direction_turns_no_other_text_around(clean: Made, mark: str) -> None:
    filler = [Note(f"{k} " + "word " * 120) for k in range(12)]
    report = small(clean.report, title=f"log {mark}abc.csv", sections=[section("note", "Note", *filler)])
    _, second, *_ = made(report).pages
    assert f"winchcascade/{__version__}" in second.splitlines()[0]


@pytest.mark.parametrize("mark", ["\x07", "\x1b", "\x85"], ids=["bell", "escape", "next line"])
def test_a_control_character_is_shown_by_its_code(clean: Made, mark: str) -> None:
    text = made(small(clean.report, title="log", subtitle=f"rig {mark} end")).text
    assert f"rig ⟨U+{ord(mark):04X}⟩ end" in text


def test_an_empty_and_a_very_long_text_are_typeset(clean: Made) -> None:
    long = "x" * 900
    report = small(clean.report, title="", subtitle=long)
    assert squeezed(long).replace("\u200b", "") in squeezed(made(report).text).replace("\u200b", "")


def test_a_text_longer_than_a_page_is_cut_and_says_so(clean: Made) -> None:
    report = small(clean.report, title="", subtitle="x" * 3000)
    assert "(2000charactersmore)" in squeezed(made(report).text).replace("\u200b", "")


def test_ones_own_reports_are_replaced_and_no_other(tmp_path: Path) -> None:
    html, pdf = tmp_path / "my report.html", tmp_path / "my report.pdf"
    arguments = ["reduce", str(CLEAN), "--html", str(html), "--pdf", str(pdf)]
    with undrawn():
        command_line("reduce")(arguments, standalone_mode=False)
    for path in (html, pdf):
        check_replaceable(path, force=False)
    pdf.write_bytes(b"%PDF-1.7\n% mine\n%%EOF\n")
    with pytest.raises(OutputError, match="was not written by winchcascade"):
        command_line("reduce")(arguments, standalone_mode=False)
    assert pdf.read_bytes() == b"%PDF-1.7\n% mine\n%%EOF\n"


def test_any_report_is_known_as_ones_own(clean: Made, hostile: Made, tmp_path: Path) -> None:
    for k, report in enumerate((clean.report, small(clean.report, title="測試", subtitle="x" * 200_000))):
        html, pdf = tmp_path / f"report {k}.html", tmp_path / f"report {k}.pdf"
        publish(report, html=html, pdf=pdf)
        publish(report, html=html, pdf=pdf)  # without force
    path = tmp_path / "hostile.pdf"
    path.write_bytes(hostile.content)
    check_replaceable(path, force=False)


SENTENCE = (
    "The effective volume of the gas differs from that of the accumulator, by as much as the pressure of a payout shows"
)


def _of_tables(*found: Table[Any]) -> Report:
    """A report of tables alone."""
    return Report("Kind", "Title", sections=[section("s", "Heading", *found)])


def _table(rows: int, *texts: str) -> Table[Any]:
    """A table of names, numbers, and texts at the end."""
    row = ("Rotor friction (rotor_friction)", "transmission", 0.2186, Span(-0.01635, -0.01269), "> 0.99", *texts)
    head = ("Effect", "Stage", "Found", "Interval", "Probability", *(f"Text {k}" for k in range(len(texts))))
    columns = [Column[Any](name, partial(getitem, k), decimals=5) for k, name in enumerate(head)]
    return Table("t", "Caption.", columns, [row] * rows)


def getitem(k: int, row: Sequence[Cell]) -> Cell:
    return row[k]


@pytest.mark.parametrize("texts", [1, 2])
def test_a_long_text_beside_many_columns_has_lines_of_several_words_and_numbers_stay_whole(texts: int) -> None:
    done = made(_of_tables(_table(4, *[SENTENCE] * texts)))
    lines = done.text.splitlines()
    assert len(done.pages) == 1
    assert done.text.count("−0.01635 to −0.01269") == 4
    assert sum("The effective" in line for line in lines) == 4 * texts
    assert not [line for line in lines if line.strip() in SENTENCE.split()[:-1]]


def test_a_tall_table_breaks_and_does_not_begin_with_a_single_row_at_the_foot_of_a_page() -> None:
    for above in range(20, 52, 4):
        first = msgspec.structs.replace(_table(above), id="first")
        done = made(_of_tables(first, _table(40)))
        shares = [page.split("Table 2")[-1].count("transmission") for page in done.pages if "Table 2" in page]
        assert shares[0] >= 4, above
