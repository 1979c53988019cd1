"""The report of a campaign: the numbers of its record, for the page and the PDF alike, and what could not be used."""

import json
import math
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import msgspec
import numpy as np
import pypdf
import pytest
from page_scripts import check_scripts, markup_of
from winchcascade.report.campaign import MAX_RUNS, make_campaign_report

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import run_batch
from winchcascade.reduction.best_load import DRAWS, Best, rank_loads
from winchcascade.reduction.campaign_record import (
    CampaignRecord,
    FailedLog,
    LogSummary,
    campaign_from,
    campaign_text,
    run_load_text,
    runs_by_load,
)
from winchcascade.reduction.efficiency import FIELDS, METRICS
from winchcascade.report.figures.campaign_figures import over_load
from winchcascade.report.figures.style import house_style
from winchcascade.report.publish import html_text, publish
from winchcascade.report.sheet import Report, Table

FIXTURES = Path(__file__).parents[2] / "fixtures"

CHANCE = 4.0
"""Standard deviations by which a share of random draws may differ from its probability."""


def run(
    name: str, load: float | None = None, eta: float | None = None, u: float | None = None, **more: Any
) -> LogSummary:
    """A log of a summary that knows its efficiency, and a power that is the same for all."""
    nothing: dict[str, Any] = dict.fromkeys(FIELDS.values())
    power = {"power_gen_w": 500.0}
    interval = None if eta is None or u is None else [eta - 2 * u, eta + 2 * u]
    record: dict[str, Any] = {
        "name": name, "log": name, "fault": None, "result": f"runs/{name}.json", "load_ohm": load, "open_circuit": False,
        "plateau_speed_mps": 0.86,
        "table": None, "simulated": None, "rig": "ours", "cycles": 3, "complete": 3, "findings": [], "finding_count": 0,
        "removed_share": 0.0,
        "mean": nothing | power | {"eta_pto": eta}, "standard_uncertainty": nothing | {"eta_pto": u},
        "interval_95": nothing | {"eta_pto": interval}, "max_deviation_percent": nothing, "window": "auto",
        "data": {"measured": None, "origin": None},
    }  # fmt: skip
    return msgspec.convert(record | more, LogSummary)


def best_load(runs: list[LogSummary]) -> Best | None:
    """The best load of runs of one motion."""
    return rank_loads(runs).best


def failed(name: str, fault: str) -> FailedLog:
    return FailedLog(name, name, fault)


def summary(*runs: LogSummary | FailedLog) -> CampaignRecord:
    return CampaignRecord("Made up", "", runs)


class Made(NamedTuple):
    out: Path
    summary: dict[str, Any]
    report: Report
    page: str


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The report of two loads, an open circuit and a log that fails."""
    folder = tmp_path_factory.mktemp("trial")
    names = {"r9ohm.csv": 9.0, "r36ohm.csv": 36.0, "open_circuit.csv": math.inf, "header_only.csv": 1.0}
    for name in names:
        (source,) = FIXTURES.glob(f"*/{name}")
        shutil.copy(source, folder)
    runs = "".join(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n' for name, load in names.items())
    (folder / "campaign.toml").write_text(f'title = "Trial <b>A & B"\n{runs}')
    out = folder / "out"
    run_batch(make_plan([str(folder)]), out)
    record = json.loads((out / "campaign.json").read_bytes())
    report = make_campaign_report(campaign_from(record), out, command="winchcascade batch trial")
    publish(report, html=out / "campaign.html", pdf=out / "campaign.pdf", force=True)
    return Made(out, record, report, (out / "campaign.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a batch whose dataset has no row."""
    out = tmp_path_factory.mktemp("bare") / "out"
    run_batch(make_plan([str(FIXTURES / "damaged_logs" / "header_only.csv")]), out)
    return out


def table(report: Report, name: str) -> Table:
    (found,) = (b for s in report.sections for b in s.blocks if isinstance(b, Table) and b.id == name)
    return found


def squeezed(text: str) -> str:
    """Text without what a line break, a low-set letter, or a break within a long word may change."""
    return re.sub(r"[\s_\u200b]", "", text)


@pytest.mark.parametrize("apart", [0.0, 0.5, 1.0, 3.0])
def test_the_probability_of_the_best_of_two_is_that_of_the_normal_distribution(apart: float) -> None:
    """P(a > b) = Phi((a - b) / sqrt(u_a^2 + u_b^2)), here with u = 0.006 and 0.008, so 0.01 in all."""
    found = best_load([run("b", 9.0, 0.70, 0.008), run("a", 36.0, 0.70 + 0.01 * apart, 0.006)])
    assert found is not None
    expected = 0.5 * math.erfc(-apart / math.sqrt(2.0))
    assert found[1] == pytest.approx(expected, abs=CHANCE * math.sqrt(expected * (1.0 - expected) / DRAWS) + 1e-9)
    if apart > 0:
        assert (found[0].name, found[2].name) == ("a", "b")


def test_the_best_of_equals_is_one_of_them_by_chance() -> None:
    found = best_load([run(f"{k}", 9.0 + k, 0.7, 0.01) for k in range(5)])
    assert found is not None
    assert found[1] == pytest.approx(0.2, abs=CHANCE * math.sqrt(0.2 * 0.8 / DRAWS))


def test_logs_of_one_load_stand_for_it_together() -> None:
    """Of three equals two are of one load, which is the best with a probability of 2/3; the next is the other load."""
    found = best_load([run("a", 18.0, 0.7 + 1e-6, 0.01), run("b", 18.0, 0.7, 0.01), run("c", 9.0, 0.7 - 1e-6, 0.01)])
    assert found is not None
    assert found.likely == pytest.approx(2.0 / 3.0, abs=CHANCE * math.sqrt(2.0 / 9.0 / DRAWS) + 1e-3)
    assert (found.run.name, found.following.name, found.logs) == ("a", "c", 2)
    assert best_load([run("a", 18.0, 0.7, 0.01), run("b", 18.0, 0.6, 0.01)]) is None


def test_a_load_is_not_compared_with_itself(bare: Path) -> None:
    runs = [run("a", 18.0, 0.729, 0.004), run("b", 18.0, 0.727, 0.004), run("c", 27.0, 0.690, 0.004)]
    report = make_campaign_report(summary(*runs), bare)
    (point,) = (p.text for p in report.points if p.about == "Best load")
    assert point == "18 Ω with η_pto = 0.7290, then 27 Ω with 0.6900."
    assert report.tiles[0].interval == "best with a probability of >99 %"
    assert report.tiles[1].name == "there, highest of 2 logs"


def results(report: Report) -> str:
    """What the provenance says of the files of the results."""
    return next((row[1] for row in table(report, "provenance").rows if row[0] == "Results"), "")


def test_the_provenance_names_the_results_that_count(bare: Path) -> None:
    few = make_campaign_report(summary(run("a.csv", 9.0), run("b.csv-cycles-1-2", 18.0), failed("c.csv", "why.")), bare)
    text = results(few)
    assert text == "runs/b.csv-cycles-1-2.json, runs/a.csv.json; other files in runs are of other calls"
    many = make_campaign_report(summary(*(run(f"a long name of a log, {k}.csv", 9.0) for k in range(40))), bare)
    text = results(many)
    assert text.startswith("runs/NAME.json of the NAME of each of the 40 logs in campaign.json; ")
    nothing = make_campaign_report(summary(failed("c.csv", "why.")), bare)
    assert results(nothing) == ""


def test_there_is_no_best_load_of_one_or_of_those_that_are_not_known() -> None:
    assert best_load([run("a", 9.0, 0.7, 0.01)]) is None
    assert best_load([run("a", 9.0, 0.7, 0.01), run("b", 36.0), run("c", 18.0, 0.8, None)]) is None
    open_circuit = run("b", None, 0.9, 0.01, open_circuit=True)
    assert best_load([run("a", 9.0, 0.7, 0.01), open_circuit]) is None


def test_the_best_load_and_its_probability_are_said(bare: Path) -> None:
    sure = make_campaign_report(summary(run("a", 9.0, 0.60, 0.004), run("b", 36.0, 0.72, 0.004)), bare)
    assert [(t.symbol, t.value) for t in sure.tiles[:2]] == [("Best load", "36 Ω"), ("η_pto", "0.7200")]
    assert sure.tiles[0].interval == "best with a probability of >99 %"
    close = make_campaign_report(summary(run("a", 9.0, 0.719, 0.004), run("b", 36.0, 0.720, 0.004)), bare)
    texts = [[p.text for p in report.points if p.about == "Best load"] for report in (sure, close)]
    assert texts[0] == ["36 Ω with η_pto = 0.7200, then 9 Ω with 0.6000."]
    assert texts[1] == ["36 Ω with η_pto = 0.7200, then 9 Ω with 0.7190. The uncertainties do not distinguish them."]


def test_runs_are_in_falling_order_of_their_loads() -> None:
    runs = [run("u"), run("a", 9.0), run("o", open_circuit=True), run("b", 45.0), run("c", 4.5)]
    assert [run_load_text(r) for r in runs_by_load(runs)] == ["open circuit", "45", "9", "4.5", "–"]


def test_every_log_is_in_the_tables_with_its_mean(made: Made) -> None:
    for name, metrics in (("energies", METRICS[:6]), ("efficiencies", METRICS[6:])):
        rows = table(made.report, name).rows
        assert [row[0] for row in rows] == ["open_circuit.csv", "r36ohm.csv", "r9ohm.csv"]
        for row in rows:
            (record,) = (r for r in made.summary["runs"] if r["name"] == row[0])
            stated = [cell.split(" ± ") for cell in row[2:] if " ± " in cell]
            known = [m for m in metrics if record["mean"][FIELDS[m]] is not None]
            assert len(stated) == len(known)
            given = sorted(record["mean"][FIELDS[m]] for m in known)
            for value, (text, u) in zip(given, sorted(stated, key=lambda pair: float(pair[0])), strict=True):
                assert float(text) == pytest.approx(value, abs=float(u))
    assert "–" in table(made.report, "efficiencies").rows[0]  # of an open circuit


def test_the_largest_deviations_are_those_of_the_record(made: Made) -> None:
    rows = {row[0]: row for row in table(made.report, "repeatability").rows}
    for record in made.summary["runs"]:
        if record["fault"] is None:
            known = [v for m in METRICS if (v := record["max_deviation_percent"][FIELDS[m]]) is not None]
            cells = [cell for cell in rows[record["name"]][4:] if cell != "–"]
            assert [float(cell) for cell in cells] == [pytest.approx(v, abs=0.0051) for v in known]


def test_a_log_that_failed_is_listed_with_its_sentence(made: Made) -> None:
    ((name, why),) = table(made.report, "faults").rows
    assert name == "header_only.csv"
    assert "column names but no rows" in why
    assert "header_only.csv.html" not in made.page
    (point,) = (p for p in made.report.points if p.about == "Logs")
    assert (point.text, point.tone) == ("3 of 4 reduced, 9 of 9 cycles complete.", "warn")


def test_ids_of_the_page_are_unique_and_its_links_resolve(made: Made) -> None:
    markup = markup_of(made.page)
    ids = Counter(re.findall(r'\sid="([^"]*)"', markup))
    assert [name for name, n in ids.items() if n > 1] == []
    named = re.findall(r'(?:href="#|xlink:href="#|url\(#)([^")]*)', markup)
    for list_of_ids in re.findall(r'aria-(?:labelledby|describedby)="([^"]*)"', markup):
        assert list_of_ids
        named += list_of_ids.split()
    assert named
    assert set(named) <= set(ids)


def test_the_page_links_to_the_report_of_each_log(made: Made) -> None:
    links = re.findall(r'href="(?!#|data:)([^"]*)"', made.page)
    assert {unquote(link) for link in links} == {
        f"runs/{r['name']}.html" for r in made.summary["runs"] if r["fault"] is None
    }


def test_a_name_that_is_an_address_links_to_its_own_report_alone(bare: Path) -> None:
    page = html_text(make_campaign_report(summary(run('javascript:alert(1)" #?%.csv', 9.0, 0.7, 0.01)), bare))
    links = set(re.findall(r'href="(?!#|data:)([^"]*)"', page))
    assert {unquote(link) for link in links} == {'runs/javascript:alert(1)" #?%.csv.html'}
    assert not any(c in link for link in links for c in '"#? ')


def test_texts_of_a_campaign_are_no_markup(made: Made, bare: Path) -> None:
    assert "Trial &lt;b&gt;A &amp; B" in made.page
    assert "<b>A" not in made.page
    hostile = "<script>alert(1)</script>.csv"
    page = html_text(make_campaign_report(summary(run(hostile, None, 0.7, 0.01), failed(hostile, hostile)), bare))
    assert hostile not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;.csv" in page
    check_scripts(page)


def test_the_pdf_states_the_numbers_of_the_page(made: Made) -> None:
    read = pypdf.PdfReader(made.out / "campaign.pdf")
    text = squeezed("".join(page.extract_text() for page in read.pages))
    for block in (b for s in made.report.sections for b in s.blocks if isinstance(b, Table)):
        assert squeezed(block.caption) in text
        for row in block.rows:
            if block.id != "provenance":  # which holds the time of making
                assert all(squeezed(cell) in text for cell in row), (block.id, row)
                if block.id == "symbols":  # set with low indices
                    letter, _, low = row[0].partition("_")
                    assert f'<th scope="row">{letter}{f"<sub>{low}</sub>" if low else ""}</th>' in made.page
                    row = row[1:]
                assert all(cell.replace("&", "&amp;") in made.page for cell in row if "<" not in cell)
    for tile in made.report.tiles:
        assert squeezed(tile.value + tile.interval) in text
        assert tile.value in made.page


def test_a_campaign_without_loads_has_a_report(tmp_path: Path) -> None:
    for k, name in enumerate(("r9ohm.csv", "r36ohm.csv")):
        shutil.copy(FIXTURES / "campaign" / name, tmp_path / f"log {k}.csv")
    found = run_batch(make_plan([str(tmp_path)]), tmp_path / "out")
    report = make_campaign_report(found.summary, tmp_path / "out")
    assert [row[:2] for row in table(report, "energies").rows] == [("log 0.csv", "–"), ("log 1.csv", "–")]
    page = html_text(report)
    assert 'id="figure-loads"' in page
    assert all(t.symbol != "Best load" for t in report.tiles)  # without loads there is no best one
    assert not re.search(r"\bnan\b", re.sub(r"<svg.*?</svg>|<style.*?</style>", "", page, flags=re.DOTALL))


@pytest.mark.parametrize("channels", [3, 5], ids=["motion alone", "motion and force"])
def test_a_campaign_of_logs_without_efficiencies_has_a_report(tmp_path: Path, channels: int) -> None:
    lines = (FIXTURES / "campaign" / "r9ohm.csv").read_text().splitlines()
    (tmp_path / "log.csv").write_text("\n".join(",".join(line.split(",")[:channels]) for line in lines) + "\n")
    found = run_batch(make_plan([str(tmp_path / "log.csv")]), tmp_path / "out")
    assert found.faults == {}
    report = make_campaign_report(found.summary, tmp_path / "out")
    assert table(report, "logs").rows[0][0] == "log.csv"


def test_nothing_good_is_said_of_logs_that_all_failed(bare: Path) -> None:
    report = make_campaign_report(summary(failed("a.csv", "a.csv: nothing.")), bare)
    assert not any(point.tone == "good" for point in report.points)


def test_a_campaign_without_any_result_has_a_report(bare: Path) -> None:
    report = make_campaign_report(summary(failed("a.csv", "a.csv: nothing.")), bare)
    assert [section.id for section in report.sections] == ["findings", "provenance"]
    assert "No log could be used." in html_text(report)


def test_a_campaign_of_one_log_has_a_report_without_a_best_load(bare: Path) -> None:
    report = make_campaign_report(summary(run("a.csv", 9.0, 0.7, 0.01)), bare)
    assert not any("Best load" in tile.symbol for tile in report.tiles)


def test_of_very_many_logs_a_table_lists_the_first_and_the_last(bare: Path) -> None:
    runs = [run(f"{k}.csv", 1.0 + k, 0.7, 0.01) for k in range(2 * MAX_RUNS)]
    report = make_campaign_report(summary(*runs), bare)
    rows = table(report, "efficiencies").rows
    assert len(rows) == MAX_RUNS + 1
    assert (rows[0][0], rows[-1][0]) == (f"{2 * MAX_RUNS - 1}.csv", "0.csv")
    assert rows[MAX_RUNS // 2][0] == f"… {MAX_RUNS} more, in the dataset"


def test_tables_show_each_window_and_mixed_rules_are_reported(bare: Path) -> None:
    runs = [run("a", 9.0, 0.7, 0.01, window=5.48), run("b", 18.0, 0.7, 0.01, window=5.96), run("c", 36.0, 0.6, 0.01)]
    report = make_campaign_report(summary(*runs), bare)
    for name in ("energies", "efficiencies", "logs"):
        found = table(report, name)
        column = found.head.index("Window")
        assert [row[column] for row in found.rows] == ["auto", "5.96", "5.48"]
    words = "2 rules: fixed length in 2 (b, …), auto in 1 (c)."
    assert {p.about: p for p in report.points}["Windows"].text.startswith(words)
    assert words in campaign_text(summary(*runs), bare, kept=0).replace("\n  ", " ")
    alike = make_campaign_report(summary(*runs[:2]), bare)
    assert "Windows" not in {p.about for p in alike.points}


def test_a_line_joins_points_of_one_rule_and_one_kind_of_data() -> None:
    measured = {"measured": True, "origin": None}
    runs = [
        run("a", 4.0, 0.5, 0.01, window=5.48),
        run("b", 9.0, 0.6, 0.01),
        run("c", 18.0, 0.7, 0.01, window=5.96),
        run("d", 27.0, 0.7, 0.01),
        run("e", 36.0, 0.6, 0.01, data=measured),
        run("f", 45.0, 0.6, 0.01, data=measured),
    ]
    with house_style():
        figure = over_load(runs)
    assert figure is not None
    joined = {
        tuple(np.asarray(line.get_xdata()).tolist()) for line in figure.axes[1].lines if line.get_linestyle() != "None"
    }
    assert {(4.0, 18.0), (9.0, 27.0), (36.0, 45.0)} == {x for x in joined if len(x) > 1}


def test_simulated_logs_and_findings_are_said(bare: Path) -> None:
    runs = [
        run(
            "a",
            9.0,
            0.7,
            0.01,
            data={"measured": False, "origin": "A dream"},
            findings=["stuck", "slack_line"],
            removed_share=0.02,
        ),
        run("b", 36.0),
    ]
    report = make_campaign_report(summary(*runs), bare)
    points = {p.about: p for p in report.points}
    assert points["Data"].text == "1 not measured, 1 not stated. A dream."
    assert report.banner == "1 of 2 logs are not measured."
    assert points["Findings"].text == "In 1 of 2 logs: slack line, stuck."


def test_the_terminal_says_what_failed_and_where_the_files_are(made: Made) -> None:
    text = campaign_text(campaign_from(made.summary), made.out, kept=1)
    assert text.startswith("Trial <b>A & B: 3 of 4 logs reduced, 1 of them by an earlier call\n")
    assert "failed: header_only.csv: column names but no rows" in text
    assert [line.split()[0] for line in text.splitlines() if ".csv " in line and "failed" not in line] == [
        "open_circuit.csv", "r36ohm.csv", "r9ohm.csv",
    ]  # fmt: skip
    assert str(made.out / "campaign.pdf") in text
    assert "campaign.xlsx" not in text


def test_the_terminal_marks_the_rows_of_logs_with_findings(tmp_path: Path) -> None:
    clean, hurt = run("clean.csv", 9.0), run("hurt.csv", 18.0, findings=["spike", "stuck"], finding_count=14)
    text = campaign_text(summary(clean, hurt), tmp_path, kept=0)
    ends = {line.split()[0]: line.split()[-2:] for line in text.splitlines() if ".csv" in line}
    assert ends["hurt.csv"] == ["!", "14"]
    assert ends["clean.csv"][-1] == "-"
    assert "! findings in 1 of 2 logs, listed in each log's report and JSON: spike, stuck\n" in text
    assert "findings" not in campaign_text(summary(clean), tmp_path, kept=0)


def test_the_terminal_obeys_no_control_character_of_a_log(tmp_path: Path) -> None:
    text = campaign_text(summary(run("a\x1b[31m.csv", 9.0), failed("b\x1b[2J", "c\x07\nd")), tmp_path, kept=0)
    assert not any(ord(c) < 32 and c != "\n" for c in text)


def test_the_terminal_lists_a_part_of_very_many(tmp_path: Path) -> None:
    runs = [run(f"{k}.csv", 1.0 + k) for k in range(100)] + [failed(f"f{k}", "why.") for k in range(30)]
    lines = campaign_text(summary(*runs), tmp_path, kept=0).splitlines()
    assert "... 80 more, in the dataset ..." in lines
    assert any(line.startswith("... 20 more failed, all in ") for line in lines)
    assert len(lines) < 50
