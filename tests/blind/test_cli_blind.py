"""The commands blind deal, diagnose and score as a user meets them."""

import json
from pathlib import Path

import pytest
from small_trials import answer, cases_by, cause, say, sealed_trial, shipped
from test_cli import one_sentence, winchcascade

from winchcascade.blind.cases import SEALED


@pytest.fixture
def trial(tmp_path: Path) -> Path:
    folder = sealed_trial(
        tmp_path / "trial", answer("case-0001", "single", {"ke_shift": 1.0}), answer("case-0002", "none")
    )
    say(folder, "case-0001", "explained", cause("ke_shift"))
    say(folder, "case-0002", "no_gap")
    return folder


def test_deal_says_what_was_dealt_and_with_which_seal(tmp_path: Path) -> None:
    out = tmp_path / "trial"
    with cases_by(shipped):
        done = winchcascade("blind", "deal", "--cases", "1", "--seed", "5", "--out", out, "--jobs", "1")
    assert done.returncode == 0, done.stderr
    sha256 = json.loads((out / "trial.json").read_text())["sealed_sha256"]
    assert done.stdout.startswith("1 cases dealt, 0 were there already\n")
    assert f"SHA-256 {sha256}" in done.stdout
    again = winchcascade("blind", "deal", "--cases", "1", "--seed", "5", "--out", out)
    assert again.stdout.startswith("0 cases dealt, 1 were there already\n")
    assert "holds another trial" in one_sentence("blind", "deal", "--cases", "1", "--seed", "6", "--out", out)


def test_score_prints_the_counts_and_writes_what_is_asked_for(trial: Path, tmp_path: Path) -> None:
    done = winchcascade("blind", "score", trial, "--json", tmp_path / "a.json")
    assert done.returncode == 0, done.stderr
    assert "1 of 1" in done.stdout
    assert "2 of 2 diagnoses are correct" in done.stdout
    assert json.loads((tmp_path / "a.json").read_text())["totals"]["named"]["part"] == 1


def test_json_on_stdout_is_alone(trial: Path) -> None:
    assert json.loads(winchcascade("blind", "score", trial, "--json", "-").stdout)["schema"] == "winchcascade/score/1"


def test_changed_answers_are_rejected(trial: Path) -> None:
    (trial / SEALED).write_text((trial / SEALED).read_text().replace("ke_shift", "diode_drop"))
    assert "answers were changed" in one_sentence("blind", "score", trial)


def test_a_folder_that_is_no_trial_is_rejected(tmp_path: Path) -> None:
    assert "expected the folder of a trial" in one_sentence("blind", "score", tmp_path)


def test_answers_are_never_replaced_by_a_result(trial: Path) -> None:
    assert "is an input of this command" in one_sentence("blind", "score", trial, "--json", trial / SEALED, "--force")


def test_a_scheduler_that_is_no_address_is_rejected(tmp_path: Path) -> None:
    said = one_sentence("blind", "deal", "--cases", "1", "--seed", "1", "--out", tmp_path / "t", "--scheduler", "here")
    assert "is no address" in said
