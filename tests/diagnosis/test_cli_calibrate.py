"""The command calibrate as a user meets it."""

import json
import shutil
from pathlib import Path

import pytest
from test_cli import one_sentence, winchcascade

from winchcascade import load_rig
from winchcascade.diagnosis.fit.nuisances import calibrated_numbers


@pytest.fixture
def log(fixtures: Path) -> Path:
    return fixtures / "campaign" / "open_circuit.csv"


def test_a_rig_file_is_written_and_can_be_used(log: Path, tmp_path: Path) -> None:
    rig = tmp_path / "ours.toml"
    done = winchcascade("calibrate", log, "--write", rig)
    assert done.returncode == 0, done.stderr
    assert f"files      {rig}" in done.stdout.splitlines()
    assert winchcascade("reduce", log, "--rig", rig).returncode == 0
    assert (
        winchcascade("simulate", log, "--rig", rig, "--out", tmp_path / "again.csv").returncode == 0
    )
    assert (
        winchcascade("calibrate", log, "--write", rig).returncode == 0
    )  # its own file is replaced
    assert {name for _, name in calibrated_numbers(load_rig(rig))} == {"k_e", "mu_screw", "b_rotor"}


def test_a_rig_file_of_ones_own_is_not_replaced(log: Path, tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('based_on = "hsu2026"\nname = "mine"\n')
    assert "was not written by winchcascade" in one_sentence("calibrate", log, "--write", mine)
    assert "is an input" in one_sentence(
        "calibrate", log, "--rig", mine, "--write", mine, "--force"
    )
    assert winchcascade("calibrate", log, "--write", mine, "--force").returncode == 0


def test_the_json_holds_what_the_table_shows_and_outputs_need_names_of_their_own(
    log: Path, tmp_path: Path
) -> None:
    done = winchcascade("calibrate", log, "--json", "-")
    record = json.loads(done.stdout)
    assert record["schema"] == "winchcascade/calibration/1"
    assert record["log"]["samples"] == 2683
    assert [n["name"] for n in record["numbers"]] == ["k_e", "mu_screw", "eta_mesh", "b_rotor"]
    assert record["regression"]["samples"] > 500
    assert done.stderr == ""
    out = tmp_path / "out"
    assert "both name" in one_sentence("calibrate", log, "--json", out, "--write", out)
    assert "expected the name of a file" in one_sentence("calibrate", log, "--write", "-")


def test_the_load_is_not_guessed_and_a_whole_payout_needed(log: Path, tmp_path: Path) -> None:
    alone, short = Path(shutil.copy(log, tmp_path / "alone.csv")), tmp_path / "short.csv"
    assert "its load is unknown" in one_sentence("calibrate", alone)
    assert winchcascade("calibrate", alone, "--load-ohm", "inf").returncode == 0
    assert "a log with a load of 36 ohm" in one_sentence("calibrate", log.parent / "r36ohm.csv")
    short.write_text("\n".join(log.read_text().splitlines()[:200]) + "\n")
    assert "none of 1 payouts is complete" in one_sentence("calibrate", short, "--load-ohm", "inf")


def test_a_simulation_of_a_rig_gives_its_numbers_back(log: Path, tmp_path: Path) -> None:
    made = tmp_path / "made.csv"
    drag = ("--with", "rotor_viscous.b_extra=1e-4")
    assert winchcascade("simulate", log, *drag, "--out", made).returncode == 0
    record = json.loads(winchcascade("calibrate", made, "--load-ohm", "inf", "--json", "-").stdout)
    found = {n["name"]: n["value"] for n in record["numbers"]}
    assert found["b_rotor"] == pytest.approx(8.5e-4, rel=2e-3)
    assert found["k_e"] == pytest.approx(0.0620, rel=1e-3)
    assert found["mu_screw"] == pytest.approx(0.04, rel=2e-3)
