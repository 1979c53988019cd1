"""The page: safe whatever a log calls itself, small enough for a log of hours, in the colours of
its theme.
"""

import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import msgspec
import pytest
from page_reader import PageReader

from winchcascade.core.errors import OutputError
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.content import Note, Picture, Report, section
from winchcascade.report.figures.style import COLOURS
from winchcascade.report.glossary import typeset
from winchcascade.report.render.page import page_text
from winchcascade.report.render.report_files import publish
from winchcascade.report.results.reduction import reduction_report
from winchcascade.rig.baseline import load_rig

ROOT = Path(__file__).parents[2]
CLEAN = ROOT / "fixtures" / "campaign" / "r36ohm.csv"

MAX_BYTES = 2_000_000
"""A page that can still be sent by mail."""

WORDS = (
    "<b>bold</b> <script>alert(1)</script> & &amp; \"double\" 'single' {{ 7*7 }} {% raw %} {# no "
    "#} #let x = 1 $x^2$ "
    "*star* _low_ @ref `code` \\n \\u003c </style> --> ]]> ${1} https://example.org/ 測試 שלום <img "
    "src=x onerror=alert(1)>"
)
"""What a page, a template or a typesetter might take for something else than text."""

CONTROL = "bell \x07 escape \x1b next line \x85 end"
"""A file name or a rig file may hold these; a page must not."""


def drawn(log: Path) -> Report:
    reduction = reduce(read_run(log))
    return reduction_report(reduction, uncertainty(reduction))


def histories(report: Report) -> Picture:
    (found,) = (block for block in report.blocks if isinstance(block, Picture) and block.histories)
    return found


@pytest.fixture(scope="module")
def clean() -> Report:
    return drawn(CLEAN)


def test_texts_of_a_log_and_its_rig_are_shown_as_they_are(tmp_path: Path) -> None:
    log, rig_file = (
        tmp_path / f"log {WORDS.replace('/', '')[:90]}.csv",
        tmp_path / 'rig <i> & "x".toml',
    )
    head, *rows = CLEAN.read_text().splitlines()
    column = '"column ' + WORDS.replace('"', '""') + '"'
    log.write_text("\n".join([f"{head},{column}", *(f"{row},1.5" for row in rows)]) + "\n")
    names = ("name", "title", "source", "note", "from")
    texts = {name: json.dumps(f"{name} {WORDS}", ensure_ascii=False) for name in names}
    rig_file.write_text(
        'based_on = "hsu2026"\n' + "".join(f"{name} = {texts[name]}\n" for name in names[:4])
        + f'[sensors.force]\nunit = "N"\nhigh = 20000.0\naccuracy_full_scale = 0.002\n'
        f"source = {texts['from']}\n"
    )  # fmt: skip
    rig = load_rig(rig_file)
    reduction = reduce(
        read_run(log, rig=rig, load=36.0, load_source=f"given {WORDS}", about=f"about {WORDS}"),
        rig=rig,
    )
    page = PageReader(
        page_text(reduction_report(reduction, uncertainty(reduction), command=f"command {WORDS}"))
    )
    shown = " ".join(page.shown.split())
    assert page.faults == page.requests() == []
    for name in (*names, "about", "command", "given"):
        assert " ".join(typeset(f"{name} {WORDS}").split()) in shown, name
    for finding in reduction.quality:
        assert " ".join(typeset(finding.message).split()) in shown
    assert "column <b>bold</b>" in shown
    assert not {"i", "img"} & {tag for tag, _ in page.elements}


def test_every_colour_of_a_drawing_follows_the_theme(clean: Report) -> None:
    page = page_text(clean)
    drawings = "".join(re.findall(r"<svg.*?</svg>", page, re.DOTALL))
    assert not [name for name, colour in COLOURS.items() if colour.lower() in drawings.lower()]
    assert not re.search(r"(fill|stroke|stop-color)(: ?|=\")(#|rgb|black|white)", drawings)
    used = set(re.findall(r"var\(--(\w+)\)", drawings))
    assert used
    for theme in re.findall(r":root \{(.*?)\}", page, re.DOTALL)[:2]:
        assert used <= set(re.findall(r"--(\w+):", theme))


def test_the_histories_of_a_page_are_json_that_no_text_can_end(clean: Report) -> None:
    ending = {"label": "</script><script>alert(1)</script><!--"}
    evil = section(
        "evil",
        "Evil",
        msgspec.structs.replace(histories(clean), histories=lambda: json.dumps(ending)),
    )
    text = page_text(msgspec.structs.replace(clean, sections=[evil]))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert "<" not in data
    assert json.loads(data) == ending


def test_a_page_has_no_character_that_html_forbids(clean: Report) -> None:
    report = msgspec.structs.replace(
        clean, title=CONTROL, sections=[section("note", "Note", Note(CONTROL))]
    )
    assert not re.search(r"[\x00-\x08\x0b\x0e-\x1f\x7f-\x9f]", page_text(report))


def shown_json(report: Report) -> str:
    make = histories(report).histories
    assert make is not None
    return make()


@pytest.mark.slow
def test_a_log_of_hours_has_a_page_that_can_be_sent_by_mail_with_its_largest_force(
    tmp_path: Path,
) -> None:
    log = tmp_path / "long.csv"
    script = ROOT / "benchmarks" / "make_logs.py"
    subprocess.run(
        [sys.executable, script, log, "--rows", "268000"], check=True, capture_output=True
    )
    report, force = drawn(log), read_run(log).channels["force"]
    page = page_text(report)
    ids = Counter(PageReader(page).values("id"))
    assert len(page.encode()) < MAX_BYTES
    assert {name: n for name, n in ids.items() if n > 1} == {}
    rows = json.loads(shown_json(report))["rows"]
    (shown,) = (c for row in rows for c in row["series"] if c["label"] == "Line tension")
    assert max(shown["values"]) == float(f"{force.max():.6g}")


def test_a_page_and_a_pdf_of_this_tool_are_replaced_and_no_others(
    clean: Report, tmp_path: Path
) -> None:
    small = msgspec.structs.replace(
        clean, sections=[section("note", "Note", Note("Nothing."))], lead=None
    )
    files = {"html": tmp_path / "my report.html", "pdf": tmp_path / "my report.pdf"}
    for title in ("One", "測試"):
        publish(msgspec.structs.replace(small, title=title), html=files["html"], pdf=files["pdf"])
    for ending, path in files.items():
        path.write_bytes(
            b"<!doctype html><title>mine</title>"
            if ending == "html"
            else b"%PDF-1.7\n% mine\n%%EOF\n"
        )
        before = path.read_bytes()
        with pytest.raises(OutputError, match="was not written by winchcascade"):
            publish(
                small,
                html=path if ending == "html" else None,
                pdf=path if ending == "pdf" else None,
            )
        assert path.read_bytes() == before
