"""The page: well-formed, complete in itself, small enough for a log of hours, and safe whatever a log calls itself."""

import json
import re
import shutil
import subprocess
import sys
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from winchcascade.core.errors import OutputError
from winchcascade.core.files import check_replaceable
from winchcascade.ingest.read import read_run
from winchcascade.reduction.montecarlo import Uncertainty, uncertainty
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.reduction_result import Reduction
from winchcascade.report.content import Note, Picture, Report, Table, section
from winchcascade.report.figures.style import COLOURS
from winchcascade.report.glossary import typeset
from winchcascade.report.publish import publish
from winchcascade.report.render.page import page_text
from winchcascade.report.results.drawn_reduction import drawn_report
from winchcascade.rig.open_rig import load_rig

ROOT = Path(__file__).parents[2]
CLEAN = ROOT / "fixtures" / "campaign" / "r36ohm.csv"

MAX_BYTES = 2_000_000
"""A page that can still be sent by mail."""

WORDS = (
    "<b>bold</b> <script>alert(1)</script> & &amp; \"double\" 'single' {{ 7*7 }} {% raw %} {# no #} #let x = 1 $x^2$ "
    "*star* _low_ @ref `code` \\n \\u003c </style> --> ]]> ${1} https://example.org/ 測試 שלום <img src=x onerror=alert(1)>"
)
"""What a page, a template or a typesetter might take for something else than text."""

VOID = {"meta", "link", "br", "img", "input", "hr", "col", "wbr"}
NOTE = [section("note", "Note", Note("Nothing."))]
NAMESPACES = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


class Made(NamedTuple):
    reduction: Reduction
    report: Report
    page: str


class Page(HTMLParser):
    """What a page consists of: its elements and texts; faults of its structure are gathered."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.faults: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if len({name for name, _ in attrs}) < len(attrs):
            self.faults.append(f"an attribute twice in {tag} {attrs}")
        self.elements.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.faults.append(f"</{tag}> closes something else, line {self.getpos()[0]}")

    def handle_data(self, data: str) -> None:
        self.texts.append((self.open[-1] if self.open else "", data))

    @property
    def shown(self) -> str:
        """Every text that a reader sees."""
        return "".join(text for tag, text in self.texts if tag not in ("script", "style"))

    def values(self, attribute: str) -> list[str]:
        return [attributes[attribute] for _, attributes in self.elements if attribute in attributes]


def made(reduction: Reduction, found: Uncertainty, command: str = "") -> Made:
    report = drawn_report(reduction, found, command=command)
    return Made(reduction, report, page_text(report))


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """A log and a rig file whose every text is one that might be taken for something else."""
    folder = tmp_path_factory.mktemp("hostile")
    log, rig_file = folder / f"log {WORDS.replace('/', '')[:90]}.csv", folder / 'rig <i> & "x".toml'
    head, *rows = CLEAN.read_text().splitlines()
    column = '"column ' + WORDS.replace('"', '""') + '"'
    log.write_text("\n".join([f"{head},{column}", *(f"{row},1.5" for row in rows)]) + "\n")
    texts = {
        key: json.dumps(f"{key} {WORDS}", ensure_ascii=False) for key in "name title source note instr from".split()
    }
    rig_file.write_text(
        'based_on = "hsu2026"\n' + "".join(f"{key} = {texts[key]}\n" for key in ("name", "title", "source", "note"))
        + f'[sensors.force]\nunit = "N"\nhigh = 20000.0\naccuracy_full_scale = 0.002\ninstrument = {texts["instr"]}\n'
        f"source = {texts['from']}\n"
    )  # fmt: skip
    rig = load_rig(rig_file)
    run = read_run(log, rig=rig, load=36.0, load_source=f"given {WORDS}", about=f"about {WORDS}")
    reduction = reduce(run, rig=rig)
    return made(reduction, uncertainty(reduction), command=f"command {WORDS}")


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Three hours of 250 cycles at 25 Hz."""
    log = tmp_path_factory.mktemp("long") / "long.csv"
    script = ROOT / "benchmarks" / "make_long_log.py"
    subprocess.run([sys.executable, script, log, "--rows", "268000"], check=True, capture_output=True)
    reduction = reduce(read_run(log))
    return made(reduction, uncertainty(reduction))


@pytest.fixture(params=["hostile", "long"])
def page(request: pytest.FixtureRequest) -> Made:
    chosen: Made = request.getfixturevalue(request.param)
    return chosen


def test_a_page_is_well_formed(page: Made) -> None:
    parsed = Page(page.page)
    assert page.page.startswith("<!doctype html>")
    assert parsed.faults == []
    assert parsed.open == []


def test_no_id_stands_twice_in_a_page(page: Made) -> None:
    times = Counter(Page(page.page).values("id"))
    assert {name: n for name, n in times.items() if n > 1} == {}


def test_every_reference_in_a_page_leads_to_something_in_it(page: Made) -> None:
    parsed = Page(page.page)
    ids = set(parsed.values("id"))
    links = [href for name in ("href", "xlink:href") for href in parsed.values(name) if href != "data:,"]
    named = [word for name in ("aria-labelledby", "for") for value in parsed.values(name) for word in value.split()]
    painted = [
        target for _, attributes in parsed.elements for value in attributes.values()
        for target in re.findall(r"url\(([^)]*)\)", value)
    ]  # fmt: skip
    assert links
    assert painted
    assert {link[0] for link in (*links, *painted)} == {"#"}
    assert {link[1:] for link in (*links, *painted)} | set(named) <= ids


def test_a_page_asks_for_nothing_else(page: Made) -> None:
    parsed = Page(page.page)
    assert parsed.values("src") == parsed.values("srcset") == parsed.values("onerror") == []
    tags = Counter(tag for tag, _ in parsed.elements)
    assert not set(tags) & {"img", "iframe", "object", "embed", "base", "audio", "video", "form"}
    assert tags["link"] == 1  # an icon of nothing, so that no browser asks for one
    scripts = [attributes for tag, attributes in parsed.elements if tag == "script"]
    assert not any(a for a in scripts if a.get("type") != "application/json")
    addresses = [v for _, attributes in parsed.elements for v in attributes.values() if re.match(r"\s*\w+://", v)]
    assert set(addresses) <= NAMESPACES
    for tag, text in parsed.texts:
        if tag == "style":
            assert not re.search(r"@import|url\(|https?:", text)
        elif tag == "script" and not text.startswith("{"):
            code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)  # without the licence of what it holds
            assert set(re.findall(r'https?://[^"]*', code)) <= NAMESPACES
            assert not re.search(r"\b(fetch|XMLHttpRequest|import|eval|sendBeacon|WebSocket|innerHTML)\b\s*[(.=]", text)


def test_figures_and_tables_are_numbered_in_order(page: Made) -> None:
    blocks = [block for section in page.report.sections for block in section.blocks]
    for word, kind in (("Figure", Picture), ("Table", Table)):
        numbers = [int(number) for number in re.findall(rf"<b>{word} (\d+)\.</b>", page.page)]
        assert numbers == list(range(1, 1 + sum(isinstance(block, kind) for block in blocks)))


def test_every_cell_of_every_table_is_in_the_page(page: Made) -> None:
    cells = Counter(
        squeezed(typeset(cell))
        for table in (block.used() for block in page.report.blocks if isinstance(block, Table))
        for row in [*table.shortened(table.texts[: len(table.items)]), *table.texts[len(table.items) :]]
        for cell in row
        if cell
    )
    shown = re.findall(r"<t[hd][ >].*?</t[hd]>", page.page, re.DOTALL)
    texts = Counter(squeezed("".join(text for _, text in Page(cell).texts)) for cell in shown)
    assert not {cell: n for cell, n in cells.items() if texts[cell] < n}


def squeezed(text: str) -> str:
    """Text without blanks, and without the sign before what stands low."""
    return re.sub(r"[\s_]", "", text)


def test_every_colour_of_a_drawing_follows_the_theme(page: Made) -> None:
    drawings = re.findall(r"<svg.*?</svg>", page.page, re.DOTALL)
    assert len(drawings) >= 5
    used: set[str] = set()
    for drawing in drawings:
        assert not [name for name, colour in COLOURS.items() if colour.lower() in drawing.lower()]
        assert not re.search(r"(fill|stroke|stop-color)(: ?|=\")(#|rgb|black|white)", drawing)
        used |= set(re.findall(r"var\(--(\w+)\)", drawing))
    light, dark = re.findall(r":root \{(.*?)\}", page.page, re.DOTALL)[:2]
    assert used
    for theme in (light, dark):
        assert used <= set(re.findall(r"--(\w+):", theme))


def test_texts_of_a_log_and_its_rig_are_shown_as_they_are(hostile: Made) -> None:
    shown = " ".join(Page(hostile.page).shown.split())
    for place in ("name", "title", "source", "note", "instr", "from", "about", "command", "given"):
        assert " ".join(typeset(f"{place} {WORDS}").split()) in shown, place
    assert hostile.reduction.run.name in shown
    assert "column <b>bold</b>" in " ".join(f.message for f in hostile.reduction.quality)
    for finding in hostile.reduction.quality:
        assert " ".join(typeset(finding.message).split()) in shown
    tags = {tag for tag, _ in Page(hostile.page).elements}
    assert "i" not in tags
    assert {text.strip() for tag, text in Page(hostile.page).texts if tag == "b"} == {
        f"{word} {k}." for word in ("Figure", "Table") for k in range(1, 1 + hostile.page.count(f"<b>{word} "))
    }


def test_the_histories_of_a_page_are_json_that_no_text_can_end(page: Made) -> None:
    def data(text: str) -> str:
        (found,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
        return str(found)

    (drawn,) = (b for b in page.report.blocks if isinstance(b, Picture) and b.histories)
    assert json.loads(data(page.page)) == json.loads(drawn.histories)
    ending = {"label": "</script><script>alert(1)</script><!--"}
    evil = section("evil", "Evil", msgspec.structs.replace(drawn, histories=json.dumps(ending)))
    text = page_text(msgspec.structs.replace(page.report, sections=[evil]))
    assert "<" not in data(text)
    assert json.loads(data(text)) == ending


CONTROL = "bell \x07 escape \x1b next line \x85 end"
"""A file name or a rig file may hold these; a page must not."""


def test_a_page_has_no_character_that_html_forbids(hostile: Made) -> None:
    report = msgspec.structs.replace(hostile.report, title=CONTROL, sections=NOTE, points=(), tiles=())
    assert not re.search(r"[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f]", page_text(report))


def test_a_log_of_hours_has_a_page_that_can_be_sent_by_mail(long: Made) -> None:
    assert len(long.reduction.cycles) >= 249
    assert len(long.page.encode()) < MAX_BYTES


def test_the_histories_of_a_log_of_hours_keep_the_largest_force(long: Made) -> None:
    (drawn,) = (b for b in long.report.blocks if isinstance(b, Picture) and b.histories)
    (force,) = (c for row in json.loads(drawn.histories)["rows"] for c in row["series"] if c["label"] == "Line tension")
    assert max(force["values"]) == float(f"{long.reduction.run.channels['force'].max():.6g}")


def test_a_page_of_this_tool_is_replaced_and_no_other(hostile: Made, tmp_path: Path) -> None:
    path = tmp_path / "my report.html"
    publish(hostile.report, html=path)
    first = path.read_bytes()
    publish(hostile.report, html=path)
    assert path.read_bytes() == first
    shutil.copy(path, tmp_path / "copy.html")
    check_replaceable(tmp_path / "copy.html", force=False)
    path.write_text("<!doctype html><title>mine</title>")
    with pytest.raises(OutputError, match="was not written by winchcascade"):
        publish(hostile.report, html=path)
    assert path.read_text() == "<!doctype html><title>mine</title>"
