"""A log that lies apart from the others of its campaign, wherever a campaign is shown."""

import csv
import json
import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace
from pyarrow import parquet

from winchcascade.batch.campaign_findings import findings_between, log_efficiency
from winchcascade.batch.plan import make_plan
from winchcascade.batch.results import load_results
from winchcascade.batch.run_batch import run_batch
from winchcascade.core.campaign_file import CampaignRun, load_campaign
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run
from winchcascade.reduction.campaign_record import campaign_from
from winchcascade.reduction.efficiency_between_runs import LogEfficiency
from winchcascade.reduction.reduce import reduce
from winchcascade.reduction.run_record import reduction_record
from winchcascade.report.render.page import page_text
from winchcascade.report.render.terminal import terminal_text
from winchcascade.report.results.campaign import campaign_report

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
HURT = "r27ohm.csv"


def test_the_shipped_campaign_has_no_log_apart(tmp_path: Path) -> None:
    run_batch(make_plan([str(CAMPAIGN)]), tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "campaign.json").read_bytes())
    assert summary["between_logs"] == []
    assert [run["findings"] for run in summary["runs"]] == [[]] * 7


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The batch of the shipped campaign, Vdc of one log 8 % too high."""
    folder = tmp_path_factory.mktemp("trial")
    shutil.copytree(CAMPAIGN, folder, dirs_exist_ok=True)
    with (folder / HURT).open(newline="") as file:
        head, *rows = csv.reader(file)
    column = next(k for k, name in enumerate(head) if "Vdc" in name)
    for row in rows:
        row[column] = f"{1.08 * float(row[column]):.4f}" if row[column] else ""
    with (folder / HURT).open("w", newline="") as file:
        csv.writer(file).writerows([head, *rows])
    run_batch(make_plan([str(folder)]), folder / "out")
    return folder / "out"


def test_it_is_marked_in_the_summary_on_the_terminal_and_on_the_page(out: Path) -> None:
    summary = json.loads((out / "campaign.json").read_bytes())
    (found,) = summary["between_logs"]
    assert (found["run"], found["kind"], found["channel"]) == (HURT, "efficiency_change", None)
    assert found["message"].startswith("eta_gen is 0.842, and the other logs predict 0.77")
    assert {run["name"]: "efficiency_change" in run["findings"] for run in summary["runs"]} == {
        run["name"]: run["name"] == HURT for run in summary["runs"]
    }
    report = campaign_report(campaign_from(summary))
    text = " ".join(terminal_text(report).split())
    assert "eta_gen is 0.842" in text
    assert HURT in text
    assert "0.842, and the other logs predict" in page_text(report)


def test_the_dataset_and_a_check_hold_it_too(out: Path) -> None:
    rows = parquet.read_table(out / "dataset" / "findings.parquet").to_pylist()
    assert [row["run"] for row in rows if row["kind"] == "efficiency_change"] == [HURT]
    runs = parquet.read_table(out / "dataset" / "runs.parquet").to_pylist()
    summary = json.loads((out / "campaign.json").read_bytes())
    assert {row["run"]: row["findings"] for row in runs} == {
        run["name"]: run["finding_count"] for run in summary["runs"]
    }
    own = json.loads((out / "runs" / f"{HURT}.json").read_bytes())["quality"]
    for target in (out, out.parent):  # the folder of the batch, and the campaign reduced again
        for name, record in load_results(target).records:
            kinds = [finding.kind for finding in record.quality]
            assert kinds.count("efficiency_change") == (name == HURT)
            assert name != HURT or len(kinds) == len(own) + 1


Logs = dict[str, tuple[CampaignRun, Run]]


@pytest.fixture(scope="module")
def logs() -> Logs:
    """The loaded logs of the shipped campaign."""
    runs = [entry for entry in load_campaign(CAMPAIGN).runs if entry.file.stem != "open_circuit"]
    return {entry.file.name: (entry, read_run(entry.file, load=entry.load)) for entry in runs}


def _efficiency(name: str, entry: CampaignRun, run: Run) -> LogEfficiency | None:
    return log_efficiency(name, reduction_record(reduce(run, window=entry.window)))


@pytest.mark.parametrize(
    ("hurt", "channel", "gain"),
    [
        ("r18ohm.csv", "force", 1.1),
        ("r18ohm.csv", "torque", 0.9),
        ("r9ohm.csv", "force", 1.05),
        ("r9ohm.csv", "torque", 0.9),
        ("r9ohm.csv", "torque", 0.95),
        ("r4p5ohm.csv", "force", 1.1),
        ("r4p5ohm.csv", "torque", 0.9),
        ("r4p5ohm.csv", "torque", 1.3),
    ],
)
def test_the_wrong_log_is_marked_and_not_the_one_beside_it(
    logs: Logs, hurt: str, channel: str, gain: float
) -> None:
    """A wrong log at the end of the loads spoils the prediction of the log beside it."""
    entry, run = logs[hurt]
    wrong = replace(run, channels={**run.channels, channel: gain * run.channels[channel]})
    given = {name: _efficiency(name, *of) for name, of in (logs | {hurt: (entry, wrong)}).items()}
    assert {name for name, _ in findings_between(given.values())} == {hurt}
