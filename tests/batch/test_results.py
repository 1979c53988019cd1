"""Results to compare: a reduction, a batch, or a campaign that is reduced for it; whatever else
it is, one sentence.
"""

import json
import re
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
from test_cli import winchcascade

from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import Results, load_results
from winchcascade.batch.run_batch import Products, run_batch
from winchcascade.core.errors import LogError, OptionError, OutputError, WinchcascadeError
from winchcascade.core.store import digest_in, digest_of, with_digest
from winchcascade.reduction.run_record import run_record

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
    return {name: record.mean for name, record in results.records}


def test_a_campaign_its_folder_and_its_batch_give_the_same_results(
    campaign: Path, out: Path
) -> None:
    found = [
        load_results(path)
        for path in (campaign, campaign / "campaign.toml", out, out / "campaign.json")
    ]
    assert all(results.whole for results in found)
    assert list(means(found[0])) == list(LOADS)
    assert all(means(results) == means(found[0]) for results in found)


def test_processes_change_neither_results_nor_their_order(campaign: Path) -> None:
    assert load_results(campaign, jobs=2) == load_results(campaign)


def test_a_reduction_is_a_single_log(out: Path) -> None:
    path = out / "runs" / "r9ohm.csv.json"
    results = load_results(path)
    assert not results.whole
    assert results.records == (("r9ohm.csv.json", run_record(path.read_bytes(), "r9ohm.csv.json")),)


@pytest.mark.parametrize("of", ["campaign", "batch"])
def test_a_log_that_failed_is_reported(campaign: Path, tmp_path: Path, of: str) -> None:
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
def test_a_file_that_is_no_result_is_reported(tmp_path: Path, content: str) -> None:
    path = tmp_path / "result.json"
    path.write_text(content, encoding="latin-1")
    with pytest.raises(
        OptionError,
        match=r"is no JSON of a reduction .* expected a campaign, the folder of a batch or",
    ):
        load_results(path)


def test_a_result_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        load_results(tmp_path / "nothing.json")
    with pytest.raises(OptionError, match="no log found"):
        load_results(tmp_path)


def test_a_summary_of_another_program_is_reported(tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text('{"schema": "other/1"}')
    with pytest.raises(
        OptionError, match="is no summary of a batch; expected the schema winchcascade/campaign/1"
    ):
        load_results(tmp_path)


@pytest.mark.parametrize(
    "runs", ["", ', "runs": 3', ', "runs": [{}]', ', "runs": [{"fault": null, "name": "a"}]']
)
def test_a_damaged_summary_is_one_sentence(tmp_path: Path, runs: str) -> None:
    (tmp_path / "campaign.json").write_text('{"schema": "winchcascade/campaign/1"' + runs + "}")
    with pytest.raises(WinchcascadeError):
        load_results(tmp_path)


def test_a_batch_that_lost_a_result_is_reported(out: Path, tmp_path: Path) -> None:
    shutil.copytree(out, tmp_path / "out")
    (tmp_path / "out" / "runs" / "r9ohm.csv.json").unlink()
    with pytest.raises(OptionError, match=r"r9ohm\.csv\.json: cannot be read"):
        load_results(tmp_path / "out")


# ---------------------------------------------------------------------------------------- digests
def alter(path: Path) -> None:
    """Change one digit of a mean, as a hand or a damaged disk may do."""
    content = path.read_bytes()
    place = content.index(b'"eta_pto":', content.index(b'"mean":')) + len(b'"eta_pto":0.')
    path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])


@pytest.mark.parametrize("name", ["runs/r9ohm.csv.json", "campaign.json"])
def test_an_altered_result_is_rejected_and_made_again(
    campaign: Path, out: Path, tmp_path: Path, name: str
) -> None:
    results = shutil.copytree(out, tmp_path / "out")
    alter(results / name)
    with pytest.raises(
        OutputError, match="was altered after the batch: its content does not match the digest"
    ):
        load_results(results)
    again = run_batch(make_plan([str(campaign)]), results)
    assert again.altered == (name,)
    assert again.kept == 2 - name.startswith("runs")
    assert (results / name).read_bytes() == (out / name).read_bytes()
    assert load_results(results) == load_results(out)
    assert run_batch(make_plan([str(campaign)]), results).altered == ()


def test_a_result_whose_own_digest_was_altered_too_is_rejected(out: Path, tmp_path: Path) -> None:
    results = shutil.copytree(out, tmp_path / "out")
    path = results / "runs" / "r9ohm.csv.json"
    record = json.loads(path.read_bytes())
    record["mean"]["eta_pto"] = 0.9
    path.write_bytes(
        with_digest(
            record, "batch", {key: record["batch"][key] for key in ("key", "reports", "files")}
        )
    )
    assert load_results(path).records[0][1].mean["eta_pto"] == 0.9
    with pytest.raises(OutputError, match=r"r9ohm\.csv\.json: was altered after the batch"):
        load_results(results)


@pytest.mark.parametrize("name", ["dataset/runs.parquet", "campaign.xlsx"])
def test_an_altered_table_of_the_campaign_is_made_again(
    campaign: Path, tmp_path: Path, name: str
) -> None:
    plan, results = make_plan([str(campaign)]), tmp_path / "out"
    run_batch(plan, results, Products(workbook=True))
    (results / name).write_bytes((results / name).read_bytes()[:-1] + b"?")
    damaged = (results / name).read_bytes()
    with suppress(OutputError):  # a file without its mark may be the user's
        assert run_batch(plan, results, Products(workbook=True)).altered == (name,)
        assert (results / name).read_bytes() != damaged


def test_the_command_reports_what_was_altered(campaign: Path, out: Path, tmp_path: Path) -> None:
    results = shutil.copytree(out, tmp_path / "out")
    alter(results / "runs" / "r9ohm.csv.json")
    done = winchcascade("batch", campaign, "--out", results, "--reports", "none")
    assert re.search("^altered .*runs/r9ohm.csv.json", done.stdout, re.MULTILINE)
    assert re.search("^kept +1 of 2 logs", done.stdout, re.MULTILINE)


def without_digests(results: Path) -> None:
    """Make the results of a batch those of version 0.1.0."""
    summary = json.loads((results / "campaign.json").read_bytes())
    del summary["store"]
    (results / "campaign.json").write_text(json.dumps(summary))
    for path in (results / "runs").glob("*.json"):
        record = json.loads(path.read_bytes())
        del record["batch"]["sha256"], record["batch"]["files"]
        path.write_text(json.dumps(record))


def test_results_of_version_0_1_0_are_opened_and_made_again(
    campaign: Path, out: Path, tmp_path: Path
) -> None:
    results = shutil.copytree(out, tmp_path / "out")
    without_digests(results)
    found = load_results(results)
    assert means(found) == means(load_results(out))
    assert not found.verified
    assert load_results(out).verified
    again = run_batch(make_plan([str(campaign)]), results)
    assert (again.kept, again.altered) == (0, ())
    assert load_results(results).verified


def test_a_result_without_a_digest_in_a_folder_with_digests_is_rejected(
    out: Path, tmp_path: Path
) -> None:
    results, other = (shutil.copytree(out, tmp_path / name) for name in ("out", "other"))
    without_digests(other)
    shutil.copy(other / "runs" / "r9ohm.csv.json", results / "runs")
    with pytest.raises(OutputError, match=r"r9ohm\.csv\.json: was altered"):
        load_results(results)


@pytest.mark.parametrize("name", ["/etc/passwd", "../r9ohm.csv.json", "runs/../../x.json"])
def test_a_summary_that_names_a_result_elsewhere_is_rejected(tmp_path: Path, name: str) -> None:
    record = {
        "schema": "winchcascade/campaign/1",
        "runs": [{"name": "a", "fault": None, "result": name}],
    }
    (tmp_path / "campaign.json").write_text(json.dumps(record))
    with pytest.raises(OutputError, match="leads out of this folder"):
        load_results(tmp_path)


def test_a_digest_of_the_bytes_with_zeros_in_its_place_is_one_of_an_earlier_version() -> None:
    blank = b'{"mean": 1.0, "batch": {"key": "a", "sha256": "' + b"0" * 64 + b'"}}\n'
    content = blank.replace(b"0" * 64, digest_of(blank).encode())
    assert digest_in(content) == "kept"
    assert digest_in(content.replace(b"1.0", b"1.1")) == "altered"
