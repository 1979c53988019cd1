"""Results to compare: a reduction, a batch, or a campaign that is reduced for it; whatever else it is, one sentence."""

import json
import shutil
from pathlib import Path

import pytest

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import Results, load_results
from winchcascade.batch.run import run_batch
from winchcascade.errors import LogError, OptionError, WinchcascadeError

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOADS = {"r9ohm.csv": 9.0, "r36ohm.csv": 36.0}


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("trial")
    for name in LOADS:
        shutil.copy(FIXTURES / "campaign" / name, folder)
    runs = "".join(f'[[run]]\nfile = "{name}"\nload_ohm = {load}\n' for name, load in LOADS.items())
    (folder / "campaign.toml").write_text(runs)
    return folder


@pytest.fixture(scope="module")
def out(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "out"
    run_batch(make_plan([str(campaign)]), folder)
    return folder


def means(results: Results) -> dict[str, object]:
    return {name: record["mean"] for name, record in results.records}


def test_a_campaign_its_folder_and_its_batch_give_the_same_results(campaign: Path, out: Path) -> None:
    found = [load_results(path) for path in (campaign, campaign / "campaign.toml", out, out / "campaign.json")]
    assert all(results.whole for results in found)
    assert list(means(found[0])) == list(LOADS)
    assert all(means(results) == means(found[0]) for results in found)


def test_processes_change_neither_results_nor_their_order(campaign: Path) -> None:
    assert load_results(campaign, jobs=2) == load_results(campaign)


def test_a_reduction_is_a_single_log(out: Path) -> None:
    path = out / "runs" / "r9ohm.csv.json"
    results = load_results(path)
    assert not results.whole
    assert results.records == (("r9ohm.csv.json", json.loads(path.read_bytes())),)


@pytest.mark.parametrize("of", ["campaign", "batch"])
def test_a_log_that_failed_is_told(campaign: Path, tmp_path: Path, of: str) -> None:
    shutil.copytree(campaign, tmp_path / "trial")
    shutil.copy(FIXTURES / "damaged_logs" / "header_only.csv", tmp_path / "trial" / "r36ohm.csv")
    target = tmp_path / "trial"
    if of == "batch":
        target = tmp_path / "out"
        run_batch(make_plan([str(tmp_path / "trial")]), target)
    with pytest.raises(LogError, match=r"r36ohm\.csv: column names but no rows") as fault:
        load_results(target)
    assert ("Mend the log or leave it out." in str(fault.value)) == (of == "batch")


@pytest.mark.parametrize("content", ["", "{", "[1, 2]", "name,colour\n", "\xff"])
def test_a_file_that_is_no_result_is_told(tmp_path: Path, content: str) -> None:
    path = tmp_path / "result.json"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(
        OptionError, match=r"is no JSON of a reduction .* expected a campaign, the folder of a batch or"
    ):
        load_results(path)


def test_a_result_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        load_results(tmp_path / "nothing.json")
    with pytest.raises(OptionError, match="no log found"):
        load_results(tmp_path)


def test_a_summary_of_another_program_is_told(tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text('{"schema": "other/1"}')
    with pytest.raises(OptionError, match="is no summary of a batch; expected the schema winchcascade/campaign/1"):
        load_results(tmp_path)


@pytest.mark.parametrize("runs", ["", ', "runs": 3', ', "runs": [{}]', ', "runs": [{"fault": null, "name": "a"}]'])
def test_a_damaged_summary_is_one_sentence(tmp_path: Path, runs: str) -> None:
    (tmp_path / "campaign.json").write_text('{"schema": "winchcascade/campaign/1"' + runs + "}")
    with pytest.raises(WinchcascadeError):
        load_results(tmp_path)


def test_a_batch_that_lost_a_result_is_told(out: Path, tmp_path: Path) -> None:
    shutil.copytree(out, tmp_path / "out")
    (tmp_path / "out" / "runs" / "r9ohm.csv.json").unlink()
    with pytest.raises(OptionError, match=r"r9ohm\.csv\.json: cannot be read"):
        load_results(tmp_path / "out")
