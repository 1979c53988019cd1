"""The command diagnose as a user meets it, on two logs with a known cause."""

import json
import shutil
from pathlib import Path
from typing import NamedTuple

import pytest
from diagnosed import PLANTED, write_campaign
from scipy.io import loadmat
from test_cli import one_sentence, winchcascade
from undrawn import undrawn

from winchcascade import load_rig, read_run

FEW = [word for name in ("copper_heating", "line_drag") for word in ("--suspect", name)]
"""Few suspects, with which a diagnosis takes a fraction of its time."""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_campaign(tmp_path_factory.mktemp("two loads"), PLANTED["copper"])


@pytest.fixture(scope="module")
def results(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All that the command writes, with one load withheld."""
    out = tmp_path_factory.mktemp("out")
    with undrawn():
        done = winchcascade(
            "diagnose", campaign, "--withhold", "18", "--json", out / "d.json", "--html", out / "d.html",
            "--pdf", out / "d.pdf", "--predictions", out / "predicted", "--jobs", "1", "--seed", "3", *FEW,
        )  # fmt: skip
    assert done.returncode == 0
    (out / "printed.txt").write_text(done.stdout, encoding="utf-8")
    assert done.stderr == ""
    return out


class Corrected(NamedTuple):
    """The corrected rig file, the exported model in both formats, and what the commands printed:
    a text, and JSON alone.
    """

    rig: Path
    model: Path
    matlab: Path
    text: str
    json: str


@pytest.fixture(scope="module")
def corrected(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Corrected:
    """The same diagnosis twice: with a text and with JSON on standard output."""
    out = tmp_path_factory.mktemp("corrected")
    rig, model, matlab = out / "corrected.toml", out / "model.json", out / "model.mat"
    text = winchcascade("diagnose", campaign, "--write", rig, "--export", model, *FEW)
    alone = winchcascade(
        "diagnose", campaign / "campaign.toml", "--export", matlab, "--json", "-", *FEW
    )
    assert (text.returncode, alone.returncode) == (0, 0)
    return Corrected(rig, model, matlab, text.stdout, alone.stdout)


def test_the_command_writes_json_page_pdf_and_predictions(results: Path) -> None:
    record = json.loads((results / "d.json").read_bytes())
    assert record["schema"] == "winchcascade/diagnosis/1"
    assert record["seed"] == 3
    assert record["closure"]["withheld"] == [18.0]
    assert "copper_heating" in [cause["effect"] for cause in record["causes"]]
    assert (results / "d.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert (results / "d.pdf").read_bytes().startswith(b"%PDF")
    for side in ("before", "after"):
        assert [path.name for path in (results / "predicted" / side).iterdir()] == ["r18ohm.csv"]


def test_the_text_shows_what_was_withheld_and_where_the_files_are(results: Path) -> None:
    text = (results / "printed.txt").read_text(encoding="utf-8")
    assert "held-out logs (18 ohm)" in " ".join(text.split())
    for name in ("d.json", "d.html", "d.pdf", "predicted"):
        assert str(results / name) in text


@pytest.mark.slow
def test_json_on_standard_output_stands_alone(corrected: Corrected) -> None:
    assert json.loads(corrected.json)["closure"]["withheld"] == [18.0, 4.5]


@pytest.mark.slow
def test_the_corrected_rig_leaves_no_gap_and_is_accepted_by_other_commands(
    campaign: Path, corrected: Corrected, tmp_path: Path
) -> None:
    assert str(corrected.rig) in corrected.text
    change = load_rig(corrected.rig).effects["copper_heating"].fields["r_s_change"]
    assert change.low is not None
    assert change.high is not None
    assert change.low <= 0.4 <= change.high
    again = winchcascade(
        "diagnose", campaign, "--rig", corrected.rig, "--write", tmp_path / "again.toml", *FEW
    )
    assert "no gap" in again.stdout
    assert "no corrected rig file, as no named cause belongs in it" in again.stdout
    assert not (tmp_path / "again.toml").exists()
    as_given, simulated = tmp_path / "as_given.csv", tmp_path / "simulated.csv"
    log = campaign / "r4p5ohm.csv"
    assert winchcascade("simulate", log, "--load-ohm", "4.5", "--out", as_given).returncode == 0
    assert (
        winchcascade(
            "simulate", log, "--load-ohm", "4.5", "--rig", corrected.rig, "--out", simulated
        ).returncode
        == 0
    )
    logged, given, found = (
        read_run(path, load=4.5).channels["vdc"] for path in (log, as_given, simulated)
    )
    assert abs(found - logged).mean() < 0.1 * abs(given - logged).mean()
    page = tmp_path / "r4p5ohm.html"
    assert (
        winchcascade(
            "reduce", log, "--load-ohm", "4.5", "--rig", corrected.rig, "--html", page
        ).returncode
        == 0
    )
    assert "copper_heating" in page.read_text(
        encoding="utf-8"
    )  # the model that the log is compared with includes it


@pytest.mark.slow
def test_the_corrected_model_is_exported_for_python_and_matlab(corrected: Corrected) -> None:
    record, model = (
        json.loads(corrected.model.read_bytes()),
        loadmat(corrected.matlab, simplify_cells=True)["model"],
    )
    assert record["schema"] == model["schema"] == "winchcascade/model/1"
    resistance = record["generator"]["r_s"]
    assert resistance["value"] == pytest.approx(1.4 * resistance["as_given"], rel=0.03)
    assert "copper_heating (diagnosis of a campaign of two loads)" in resistance["source"]
    assert model["generator"]["r_s"]["value"] == resistance["value"]
    assert record["generator"]["k_e"]["value"] == pytest.approx(0.062 * 30.0 / 3.141592653589793)
    assert record["back_emf"]["share"] == [1.0] * 81
    assert model["back_emf"]["stator_current_a"].tolist() == record["back_emf"]["stator_current_a"]
    assert record["winch"]["friction"] == {
        "value": 0.0,
        "unit": "N.m",
        "as_given": 0.0,
        "source": "absent",
    }
    assert record["sensors"]["electrical_lag"] == 0.0


def test_an_export_of_another_format_is_rejected_before_any_work(
    campaign: Path, tmp_path: Path
) -> None:
    said = one_sentence("diagnose", campaign, "--export", tmp_path / "model.slx")
    assert all(part in said for part in ("--export", "model.slx", ".json", ".mat"))


def test_a_rig_file_that_the_tool_did_not_write_is_not_replaced(
    campaign: Path, tmp_path: Path
) -> None:
    own = tmp_path / "own.toml"
    own.write_text('name = "own"\n', encoding="utf-8")
    assert "--force" in one_sentence("diagnose", campaign, "--write", own)


def test_an_unknown_load_is_rejected_with_those_there_are(campaign: Path) -> None:
    said = one_sentence("diagnose", campaign, "--withhold", "17")
    assert all(part in said for part in ("--withhold 17", "18", "4.5"))


def test_every_load_withheld_is_rejected(campaign: Path) -> None:
    said = one_sentence("diagnose", campaign, "--withhold", "18", "--withhold", "4.50")
    assert "withheld" in said


def test_a_folder_without_a_campaign_is_rejected(tmp_path: Path) -> None:
    assert "campaign.toml" in one_sentence("diagnose", tmp_path)


def test_a_run_without_a_load_is_rejected(fixtures: Path, tmp_path: Path) -> None:
    log = fixtures / "campaign" / "r18ohm.csv"
    (tmp_path / "campaign.toml").write_text(f'[[run]]\nfile = "{log}"\n', encoding="utf-8")
    assert "has no load" in one_sentence("diagnose", tmp_path)


def test_a_file_of_somebody_else_is_rejected_before_the_work(
    campaign: Path, tmp_path: Path
) -> None:
    theirs = tmp_path / "theirs.html"
    theirs.write_text("<p>ours</p>")
    assert str(theirs) in one_sentence("diagnose", campaign, "--html", theirs)
    assert theirs.read_text() == "<p>ours</p>"


def test_a_prediction_never_replaces_a_log_of_somebody_else(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "after").mkdir()
    (tmp_path / "after" / "r18ohm.csv").write_text("t,v\n0,0\n")
    theirs = str(tmp_path / "after" / "r18ohm.csv")
    assert theirs in one_sentence("diagnose", campaign, "--predictions", tmp_path)
    assert Path(theirs).read_text() == "t,v\n0,0\n"


def test_predictions_of_two_logs_of_one_name_are_rejected(campaign: Path, tmp_path: Path) -> None:
    lines = ['rig = "hsu2026"']
    for day in ("mon", "tue"):
        (tmp_path / day).mkdir()
        shutil.copy(campaign / "r18ohm.csv", tmp_path / day / "run.csv")
        lines.append(f'[[run]]\nfile = "{day}/run.csv"\nload_ohm = 18')
    (tmp_path / "campaign.toml").write_text("\n".join(lines))
    assert "run.csv" in one_sentence("diagnose", tmp_path, "--predictions", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_predictions_into_a_file_are_rejected(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    file = tmp_path / "file"
    assert str(file) in one_sentence("diagnose", campaign, "--predictions", file)


def test_an_input_is_never_replaced(campaign: Path) -> None:
    before = (campaign / "campaign.toml").read_bytes()
    message = one_sentence("diagnose", campaign, "--json", campaign / "campaign.toml", "--force")
    assert str(campaign / "campaign.toml") in message
    assert (campaign / "campaign.toml").read_bytes() == before


@pytest.mark.slow
def test_an_effect_that_alone_is_suspected_is_the_only_one_that_is_named(
    campaign: Path, corrected: Corrected, tmp_path: Path
) -> None:
    earlier = tmp_path / "model.mat"
    shutil.copy(corrected.matlab, earlier)
    call = "diagnose", campaign, "--suspect", "ke_rolloff", "--json", "-", "--export", earlier
    refused = winchcascade(*call)
    assert refused.returncode == 2
    assert json.loads(refused.stdout)["verdict"] == "unexplained"  # the diagnosis itself is stated
    assert f"--export {earlier}" in refused.stderr
    assert earlier.read_bytes() == corrected.matlab.read_bytes()
    unit = tmp_path / "rig.fmu"
    assert winchcascade(*call[:-1], unit).returncode == 2
    assert not unit.exists()
    done = winchcascade(*call, "--force")
    assert done.returncode == 0, done.stderr
    assert (
        earlier.read_bytes() != corrected.matlab.read_bytes()
    )  # replaced, as the tool had written it
    record = json.loads(done.stdout)
    assert record["verdict"] == "unexplained"
    assert {cause["effect"] for cause in record["causes"]} <= {"ke_rolloff"}
    assert "effect 'rolloff' is not in the catalogue" in one_sentence(
        "diagnose", campaign, "--suspect", "rolloff"
    )
