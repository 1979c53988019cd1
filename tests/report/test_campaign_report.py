"""The report of a campaign: numbers of its record in one set of digits, links to its logs, and
what could not be used.
"""

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
import pytest
from page_reader import PageReader
from summaries import run

from winchcascade.batch.plan import make_plan
from winchcascade.batch.run_batch import run_batch
from winchcascade.core.cascade import field_of
from winchcascade.reduction.campaign_record import (
    LOAD_DRAWS,
    Best,
    CampaignRecord,
    FailedLog,
    LogSummary,
    campaign_from,
    rank_loads,
    runs_by_load,
)
from winchcascade.report.content import Measured, Report, Table
from winchcascade.report.figures.style import house_style
from winchcascade.report.render.page import page_text
from winchcascade.report.results.campaign import campaign_report, over_load, written_campaign
from winchcascade.report.results.campaign_index import results_index

FIXTURES = Path(__file__).parents[2] / "fixtures"

CHANCE = 4.0
"""Standard deviations by which a share of random draws may differ from its probability."""


def best_load(runs: list[LogSummary]) -> Best | None:
    """The best load of runs of one motion."""
    return rank_loads(runs).best


def failed(name: str, fault: str) -> FailedLog:
    return FailedLog(name, name, fault)


def summary(*runs: LogSummary | FailedLog) -> CampaignRecord:
    return CampaignRecord("Made up", "", runs)


class Made(NamedTuple):
    summary: dict[str, Any]
    report: Report
    page: str


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The report of two loads, an open circuit and a log that fails."""
    folder = tmp_path_factory.mktemp("trial")
    names = {
        "r9ohm.csv": 9.0,
        "r36ohm.csv": 36.0,
        "open_circuit.csv": math.inf,
        "header_only.csv": 1.0,
    }
    for name in names:
        (source,) = FIXTURES.glob(f"*/{name}")
        shutil.copy(source, folder)
    runs = "".join(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n' for name, load in names.items())
    (folder / "campaign.toml").write_text(f'title = "Trial <b>A & B"\n{runs}')
    out = folder / "out"
    run_batch(make_plan([str(folder)]), out)
    record = json.loads((out / "campaign.json").read_bytes())
    report = written_campaign(campaign_from(record), out, command="winchcascade batch trial")
    return Made(record, report, page_text(report))


def table(report: Report, name: str) -> Table[Any]:
    (found,) = (block for block in report.blocks if isinstance(block, Table) and block.id == name)
    return found


# ---------------------------------------------------------------------------------- the best load
@pytest.mark.parametrize("apart", [0.0, 0.5, 1.0, 3.0])
def test_the_probability_of_the_best_of_two_is_that_of_the_normal_distribution(
    apart: float,
) -> None:
    """P(a > b) = Phi((a - b) / sqrt(u_a^2 + u_b^2)), here with u = 0.006 and 0.008, so 0.01 in
    all.
    """
    found = best_load([run("b", 9.0, 0.70, 0.008), run("a", 36.0, 0.70 + 0.01 * apart, 0.006)])
    assert found is not None
    expected = 0.5 * math.erfc(-apart / math.sqrt(2.0))
    assert found[1] == pytest.approx(
        expected, abs=CHANCE * math.sqrt(expected * (1.0 - expected) / LOAD_DRAWS) + 1e-9
    )
    if apart > 0:
        assert (found[0].name, found[2].name) == ("a", "b")


def test_logs_of_one_load_stand_for_it_together() -> None:
    """Of three equals two are of one load, which is the best with a probability of 2/3; the next
    is the other load.
    """
    found = best_load(
        [
            run("a", 18.0, 0.7 + 1e-6, 0.01),
            run("b", 18.0, 0.7, 0.01),
            run("c", 9.0, 0.7 - 1e-6, 0.01),
        ]
    )
    assert found is not None
    assert found.likely == pytest.approx(
        2.0 / 3.0, abs=CHANCE * math.sqrt(2.0 / 9.0 / LOAD_DRAWS) + 1e-3
    )
    assert (found.run.name, found.following.name, found.logs) == ("a", "c", 2)
    assert best_load([run("a", 18.0, 0.7, 0.01), run("b", 18.0, 0.6, 0.01)]) is None


def test_there_is_no_best_load_of_one_or_of_those_that_are_not_known() -> None:
    assert best_load([run("a", 9.0, 0.7, 0.01)]) is None
    assert best_load([run("a", 9.0, 0.7, 0.01), run("b", 36.0), run("c", 18.0, 0.8, None)]) is None
    open_circuit = run("b", None, 0.9, 0.01, open_circuit=True)
    assert best_load([run("a", 9.0, 0.7, 0.01), open_circuit]) is None


# ------------------------------------------------------------------------------------- the tables
def test_runs_are_in_falling_order_of_their_loads() -> None:
    runs = [run("u"), run("a", 9.0), run("o", open_circuit=True), run("b", 45.0), run("c", 4.5)]
    assert [one.name for one in runs_by_load(runs)] == ["o", "b", "a", "c", "u"]


def test_the_budget_has_the_form_of_the_published_table(made: Made) -> None:
    found = table(made.report, "budget")
    heads = [column.name for column in found.columns]
    assert heads[:3] == ["log", "load", "plateau"]
    assert [head for head in heads if head[0] in "Ee"] == [
        "E_line",
        "E_mech",
        "E_gen",
        "eta_trans",
        "eta_gen",
        "eta_pto",
    ]
    records = {one["name"]: one for one in made.summary["runs"] if one["fault"] is None}
    assert [item.name for item in found.items] == ["open_circuit.csv", "r36ohm.csv", "r9ohm.csv"]
    for row, item in zip(found.cells, found.items, strict=True):
        cells = dict(zip(heads, row, strict=True))
        assert cells["plateau"] == records[item.name]["plateau_speed_mps"]
        for metric, head in (
            ("energy_line", "E_line"),
            ("power_gen", "P_gen"),
            ("eta_trans", "eta_trans"),
        ):
            cell = cells[head]
            assert isinstance(cell, Measured)
            assert cell.value == records[item.name]["mean"][field_of(metric)]
            assert cell.u == records[item.name]["standard_uncertainty"][field_of(metric)]
    assert dict(zip(heads, found.cells[0], strict=True))["eta_pto"] is None  # of an open circuit


def test_an_open_circuit_leaves_the_digits_of_the_others_as_they_are() -> None:
    mean: dict[str, Any] = {"energy_line_j": 7115.3, "energy_gen_j": 4956.2}
    u: dict[str, Any] = {"energy_line_j": 116.0, "energy_gen_j": 88.0}
    loaded = run("a", 36.0, mean=mean, standard_uncertainty=u)
    empty = run(
        "o", open_circuit=True, mean={"energy_line_j": 1180.2, "energy_gen_j": -0.0004},
        standard_uncertainty={"energy_line_j": 25.0, "energy_gen_j": 0.012},
    )  # fmt: skip
    texts = table(campaign_report(summary(loaded, empty)), "budget").texts
    alone = table(campaign_report(summary(loaded)), "budget").texts
    assert texts[1] == alone[0]
    assert "0.000" in texts[0]


# ------------------------------------------------------------------------ logs that are of no use
def test_a_log_that_failed_is_named_with_its_sentence(made: Made) -> None:
    (note,) = (note for note in made.report.notes if note.about == "Failed")
    assert note.text.startswith("header_only.csv: column names but no rows")
    assert "header_only.csv.html" not in made.page
    ((name, why),) = table(made.report, "faults").cells
    assert name == "header_only.csv"
    assert "column names but no rows" in str(why)


@pytest.mark.parametrize("channels", [3, 5], ids=["motion alone", "motion and force"])
def test_a_campaign_of_logs_without_efficiencies_has_a_report(
    tmp_path: Path, channels: int
) -> None:
    lines = (FIXTURES / "campaign" / "r9ohm.csv").read_text().splitlines()
    (tmp_path / "log.csv").write_text(
        "\n".join(",".join(line.split(",")[:channels]) for line in lines) + "\n"
    )
    found = run_batch(make_plan([str(tmp_path / "log.csv")]), tmp_path / "out")
    assert found.faults == {}
    report = written_campaign(found.summary, tmp_path / "out")
    assert table(report, "logs").cells[0][0] == "log.csv"
    assert not re.search(
        r"\bnan\b",
        re.sub(r"<svg.*?</svg>|<style.*?</style>", "", page_text(report), flags=re.DOTALL),
    )


# --------------------------------------------------------------------------------------- the page
def test_the_page_links_to_the_report_of_each_log(made: Made) -> None:
    links = PageReader(made.page).links
    assert {unquote(link) for link in links} == {
        f"runs/{r['name']}.html" for r in made.summary["runs"] if r["fault"] is None
    }


def test_the_index_leads_to_every_file_and_states_the_verdict_of_a_diagnosis(made: Made) -> None:
    diagnosis = {
        "verdict": "explained",
        "causes": [{"label": "gain", "effect": "torque_gain"}],
        "closure": None,
    }
    files = ["campaign.html", "campaign.json", "diagnosis.json"]
    report = results_index(campaign_from(made.summary), files, ["html", "pdf", "json"], diagnosis)
    links = {unquote(link) for link in PageReader(page_text(report)).links}
    names = [r["name"] for r in made.summary["runs"] if r["fault"] is None]
    assert links == {
        *files,
        *(f"runs/{name}.{ending}" for name in names for ending in ("html", "pdf", "json")),
    }
    assert any("torque_gain" in note.text for note in report.notes if note.about == "Diagnosis")


def test_texts_of_a_campaign_are_no_markup(made: Made) -> None:
    assert "Trial &lt;b&gt;A &amp; B" in made.page
    hostile = '<script>alert(1)</script>" #?%.csv'
    record = summary(run(hostile, None, 0.7, 0.01), failed(hostile, hostile))
    page = page_text(campaign_report(record, linked=True))
    assert "<script>alert" not in page
    (link,) = PageReader(page).links
    assert unquote(link) == f"runs/{hostile}.html"
    assert not any(sign in link for sign in '"#? <')


# ------------------------------------------------------------------------------------- the figure
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
        tuple(np.asarray(line.get_xdata()).tolist())
        for line in figure.axes[1].lines
        if line.get_linestyle() != "None"
    }
    assert {(4.0, 18.0), (9.0, 27.0), (36.0, 45.0)} == {x for x in joined if len(x) > 1}
