"""Whether data are measured is what the campaign states or the mark of `simulate`, and every
output carries it.
"""

import json
from pathlib import Path

import pytest

from winchcascade.batch.log_settings import settings_of
from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import load_results
from winchcascade.batch.run_batch import run_batch
from winchcascade.blind.cases import ORIGIN, campaign_toml
from winchcascade.core.campaign_file import (
    SIMULATED,
    Origin,
    joint_origin,
    load_campaign,
    origin_from,
)
from winchcascade.core.errors import CampaignError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import SIMULATED_HEADERS
from winchcascade.ingest.read import read_run
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.run_record import reduction_record
from winchcascade.reduction.uncertainty import uncertainty
from winchcascade.report.render.page import page_text
from winchcascade.report.results.checks import check_record, check_report
from winchcascade.report.results.reduction import reduction_report
from winchcascade.report.wording import banner, origin_words
from winchcascade.rig.baseline import baseline
from winchcascade.rig.simulate import simulate, write_log
from winchcascade.tables.check import check
from winchcascade.tables.measured import measured
from winchcascade.tables.table_file import load_table

LOG = "r4p5ohm.csv"


def campaign(folder: Path, common: str, run: str = "", log: str = LOG) -> Path:
    """A campaign of one log, with entries of the campaign and of the run."""
    path = folder / "campaign.toml"
    path.write_text(f'{common}\n[[run]]\nfile = "{log}"\nload_ohm = 4.5\n{run}\n', encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("common", "run", "expected"),
    [
        ("", "", Origin()),
        ("measured = true", "", Origin(True)),
        ('measured = true\norigin = "Tank test"', "", Origin(True, "Tank test")),
        ('measured = true\norigin = "Tank test"', 'origin = "Day 2"', Origin(True, "Day 2")),
        ('measured = true\norigin = "Tank test"', "measured = false", Origin(False)),
        ("measured = true", 'measured = false\norigin = "Rebuilt"', Origin(False, "Rebuilt")),
        ('title = "Simulated, rebuilt, not measured"', "", Origin()),
    ],
)
def test_a_run_states_its_origin_or_takes_over_that_of_its_campaign(
    tmp_path: Path, common: str, run: str, expected: Origin
) -> None:
    assert load_campaign(campaign(tmp_path, common, run)).runs[0].origin == expected


@pytest.mark.parametrize("entry", ['measured = "yes"', "measured = 1", "origin = true"])
@pytest.mark.parametrize("of_run", [True, False])
def test_a_statement_of_another_kind_is_one_sentence(
    tmp_path: Path, entry: str, of_run: bool
) -> None:
    path = campaign(tmp_path, "" if of_run else entry, entry if of_run else "")
    with pytest.raises(CampaignError, match=entry.split()[0]):
        load_campaign(path)


def test_the_shipped_campaign_and_the_cases_of_a_trial_state_that_they_are_not_measured(
    fixtures: Path, tmp_path: Path
) -> None:
    for run in load_campaign(fixtures / "campaign").runs:
        assert run.origin.measured is False
        assert run.origin.sentence.startswith("Rebuilt from Table 2")
    (tmp_path / "campaign.toml").write_text(campaign_toml("case-0001"), encoding="utf-8")
    assert {run.origin for run in load_campaign(tmp_path).runs} == {Origin(False, ORIGIN)}


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log that `simulate` wrote."""
    fixtures = Path(__file__).parents[1] / "fixtures" / "campaign"
    folder = tmp_path_factory.mktemp("simulated")
    run = read_run(fixtures / LOG, load=4.5)
    write_log(simulate(run, baseline(built_in())), folder / LOG)
    return folder


def test_a_simulated_log_carries_its_mark_and_contradicts_a_campaign_that_calls_it_measured(
    simulated: Path,
) -> None:
    assert read_run(simulated / LOG).origin == SIMULATED
    assert read_run(simulated / LOG).findings == ()
    agreed = read_run(simulated / LOG, origin=Origin(False, "For a test"))
    assert agreed.origin == Origin(False, f"{SIMULATED.sentence}; For a test")
    assert agreed.findings == ()
    contradicted = read_run(simulated / LOG, origin=Origin(True, "Tank test"))
    assert contradicted.origin == SIMULATED
    assert [f.kind for f in contradicted.findings] == ["origin_conflict"]
    assert "measured = true" in contradicted.findings[0].message


@pytest.mark.parametrize("column", SIMULATED_HEADERS)
def test_one_of_the_columns_of_simulate_marks_no_log_and_its_clock_is_checked(
    tmp_path: Path, column: str
) -> None:
    head, *rows = (
        (Path(__file__).parents[1] / "fixtures" / "campaign" / LOG).read_text().splitlines()
    )
    late = [
        f"{0.04 * k:.2f},{row.split(',', 1)[1]},3000.0"
        for k, row in enumerate(rows[:300] + rows[330:])
    ]
    (tmp_path / LOG).write_text("\n".join([f"{head},{column}", *late]) + "\n")
    run = read_run(tmp_path / LOG)
    assert run.origin == Origin()
    read = {f.kind for f in run.findings} - {"clock_mismatch"}
    assert read == (set() if column.startswith("Generator speed") else {"unknown_column"})


@pytest.mark.slow
def test_a_log_takes_its_origin_from_the_campaign_beside_it_into_record_and_page(
    fixtures: Path,
) -> None:
    log = fixtures / "campaign" / LOG
    settings = settings_of(log, rig=None, load_ohm=None, window=None)
    reduction = reduce(read_run(log, load=4.5, origin=settings.origin), window=settings.window)
    found = uncertainty(reduction)
    data = reduction_record(reduction, found).data
    assert data["measured"] is False
    assert str(data["origin"]).startswith("Rebuilt from Table 2")
    report = reduction_report(reduction, found)
    assert report.banner == "Not measured."
    page = page_text(report)
    assert f'class="banner" aria-label="Origin of the data">{report.banner}</aside>' in page
    assert page.index('class="banner"') < page.index("<header>")


def test_a_batch_and_a_check_state_the_origin_of_each_log(simulated: Path, tmp_path: Path) -> None:
    path = campaign(simulated, "measured = true")
    batch = run_batch(make_plan([str(path)]), tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "campaign.json").read_bytes())
    assert summary["data"] == {"measured": False, "origin": SIMULATED.sentence}
    (run,) = summary["runs"]
    assert run["data"] == summary["data"]
    assert any("origin_conflict" in str(kind) for kind in run["findings"])
    assert summary["windows"] == {"rules": {"auto": 1}, "mixed": False}
    again = run_batch(make_plan([str(campaign(simulated, "measured = false"))]), tmp_path / "out")
    assert batch.kept == again.kept == 0  # another statement makes another result
    table = load_table("hsu2026-table2")
    ((name, record),) = load_results(tmp_path / "out").records
    compared = check(measured(record, name, table), table, whole_campaign=False)
    report = check_report(compared)
    assert any(SIMULATED.sentence in note.text for note in report.notes if note.about == "Data")
    assert report.banner
    assert check_record(compared)["data"] == summary["data"]


def test_origins_of_several_logs_are_counted() -> None:
    tank, made, unknown = Origin(True, "Tank test."), Origin(False, "Rebuilt"), Origin()
    assert (
        origin_words([tank, made, unknown])
        == "1 measured, 1 not measured, 1 not stated. Tank test; Rebuilt."
    )
    assert joint_origin([tank, made]) == Origin(None, "Tank test; Rebuilt")
    assert banner([tank, made]) == "1 of 2 logs are not measured."
    assert banner([tank, unknown]) == ""
    assert banner([Origin(False)]) == "Not measured."
    assert origin_words([]) == origin_words([unknown]) == "not stated"


def test_a_result_of_an_earlier_version_states_nothing() -> None:
    assert origin_from({}) == Origin()
    assert origin_from({"measured": "yes", "origin": 3}) == Origin()
