"""What the command line does, the library does in one call, with the same numbers."""

import math
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest
from calls import call
from diagnosed import PLANTED, write_campaign
from rigs import calibrated_rig

from winchcascade import (
    audit,
    calibrate,
    open_campaign,
    read_run,
    reduce,
    simulate,
    write_report,
)
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.rig_toml import built_in
from winchcascade.rig.baseline import baseline
from winchcascade.tables.audit import Audit


@pytest.fixture(name="campaign")
def _campaign(fixtures: Path, tmp_path: Path) -> Path:
    """Two logs of the shipped campaign."""
    folder = tmp_path / "campaign"
    folder.mkdir()
    lines = ['title = "two loads"']
    for load in ("9", "36"):
        shutil.copy(fixtures / "campaign" / f"r{load}ohm.csv", folder)
        lines += ["[[run]]", f'file = "r{load}ohm.csv"', f"load_ohm = {load}", "window_s = 5.48"]
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def test_simulate_takes_the_rig_that_reduce_takes() -> None:
    run = read_run("fixtures/campaign/r36ohm.csv", load=36.0)
    plain, given = simulate(run), simulate(run, baseline(built_in()))
    assert plain.run.channels["idc"].tolist() == given.run.channels["idc"].tolist()


def test_calibrate_takes_the_rig_and_the_payouts_that_reduce_takes() -> None:
    run = read_run("fixtures/campaign/open_circuit.csv", load=math.inf)
    plain, given = calibrate(run), calibrate(run, calibrated_rig())
    assert [(n.name, n.value) for n in plain.numbers] == [(n.name, n.value) for n in given.numbers]
    assert [onset for onset, _ in plain.payouts] == [
        cycle.phases.onset for cycle in reduce(run).complete
    ]
    with pytest.raises(LogError, match="none of 0 payouts is complete"):
        calibrate(read_run(_at_rest(), load=math.inf))


def _at_rest() -> pd.DataFrame:
    """A log in which nothing moves."""
    return pd.DataFrame(
        {
            "Time (s)": np.arange(200) / 10.0,
            "Velocity (m/s)": 0.0,
            "Force (N)": 200.0,
            "Vdc (V)": 0.0,
        }
    )


def test_a_file_a_frame_and_a_run_of_one_log_are_reduced_to_the_same_numbers(
    tmp_path: Path,
) -> None:
    log, rig = Path("fixtures/campaign/r36ohm.csv"), built_in()
    run = reduce(read_run(log, load=36.0, rig=rig), window=5.48)
    for given in (log, str(log), pd.read_csv(log)):
        found = reduce(given, load=36.0, rig=rig, window=5.48)
        assert found.mean == run.mean
        assert (found.run.load, found.rig, found.quality) == (36.0, run.rig, run.quality)
    assert reduce(log).mean == run.mean  # its campaign states load and window
    shutil.copy(log, tmp_path)
    assert reduce(tmp_path / log.name).run.load is None


def test_results_are_shown_in_one_line() -> None:
    run = read_run("fixtures/campaign/open_circuit.csv", load=math.inf)
    assert repr(calibrate(run)).startswith("Calibration('hsu2026_rebuilt', k_e = 0.0620")
    assert repr(simulate(run)) == f"Simulation({run!r})"
    assert (
        repr(audit("hsu2026-table2"))
        == "Audit('hsu2026-table2', contradictions: 1, contradicted claims: 2)"
    )
    check = open_campaign("fixtures/campaign").check("hsu2026-table2")
    assert repr(check) == "Check('hsu2026-table2', 54 of 54 cells agree)"


def test_a_campaign_is_reduced_to_the_results_of_the_batch(campaign: Path, tmp_path: Path) -> None:
    found = open_campaign(campaign).reduce()
    out = tmp_path / "out"
    assert call("batch", campaign, "--out", out, "--reports", "none").code == 0
    summary: dict[str, Any] = msgspec.json.decode((out / "campaign.json").read_bytes())
    assert [run.name for run in found.summary.reduced] == [run["name"] for run in summary["runs"]]
    for run, stored in zip(found.summary.reduced, summary["runs"], strict=True):
        assert run.mean == stored["mean"]
        assert run.interval_95 == {k: v and tuple(v) for k, v in stored["interval_95"].items()}
    frame = found.to_pandas("runs")
    assert frame["load_ohm"].tolist() == [9.0, 36.0]
    assert frame["eta_pto"].tolist() == [run["mean"]["eta_pto"] for run in summary["runs"]]
    assert len(found.to_pandas("cycles")) == sum(run["cycles"] for run in summary["runs"])
    direct = reduce(read_run(campaign / "r9ohm.csv", load=9.0), window=5.48)
    assert frame["eta_pto"][0] == direct.mean.eta_pto


def test_a_log_that_cannot_be_used_is_a_fault_of_the_campaign(campaign: Path) -> None:
    (campaign / "r9ohm.csv").write_text("", encoding="utf-8")
    found = open_campaign(campaign).reduce()
    why = "r9ohm.csv: the file is empty; expected a log with column names and rows of numbers."
    assert list(found.faults.values()) == [why]
    assert len(found.records) == 1


def test_a_campaign_is_checked_against_a_table_as_by_the_command(
    fixtures: Path, campaign: Path
) -> None:
    whole = open_campaign(fixtures / "campaign").check("hsu2026-table2")
    done = call("check", fixtures / "campaign", "--against", "hsu2026-table2")
    assert whole.ok == (done.code == 0)
    part = open_campaign(campaign).check("hsu2026-table2")
    assert not part.ok  # a row of the table without a run is a miss


def test_a_table_is_audited_by_its_name() -> None:
    found = audit("hsu2026-table2")
    assert isinstance(found, Audit)
    assert [(item.row.load, item.cells) for item in found.contradictions] == [
        (27.0, ("energy_line", "energy_gen", "eta_pto"))
    ]


@pytest.mark.slow
def test_reports_are_written_by_the_ending_of_their_names(campaign: Path, tmp_path: Path) -> None:
    reduction = reduce(read_run(campaign / "r36ohm.csv", load=36.0))
    page = write_report(reduction, tmp_path / "x.html").read_text(encoding="utf-8")
    assert "<h1>r36ohm.csv" in page
    assert write_report(reduction, str(tmp_path / "x.PDF")).read_bytes().startswith(b"%PDF")
    opened = open_campaign(campaign)
    (written,) = opened.report(tmp_path / "campaign.html")
    whole = written.read_text(encoding="utf-8")
    assert "<h1>two loads</h1>" in whole
    assert 'href="runs/' not in whole
    files = opened.report(tmp_path / "results")
    assert files[0] == tmp_path / "results" / "campaign.html"
    assert all(file.is_file() for file in files)
    with pytest.raises(OptionError, match=r"x\.docx: .*\.html or \.pdf"):
        write_report(reduction, tmp_path / "x.docx")
    with pytest.raises(OptionError, match=r"Run has no report.*: Audit, .*, Simulation"):
        write_report(reduction.run, tmp_path / "x.html")


def test_a_campaign_is_diagnosed_as_by_the_command(tmp_path: Path) -> None:
    folder = write_campaign(tmp_path, PLANTED["copper"])
    found = open_campaign(folder).diagnose(suspects=["copper_heating"])
    assert [cause.effect for cause in found.causes] == ["copper_heating"]
    (folder / "campaign.toml").unlink()
    with pytest.raises(CampaignError, match="winchcascade init"):
        open_campaign(folder).diagnose()
