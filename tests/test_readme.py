"""The three ways to begin that the README names, each with data of a rig that is not the
paper's.
"""

import json
import re
import shutil
from pathlib import Path

import pytest
from calls import call
from made_tables import table_text
from pages import ROOT, read, steps

README = ROOT / "README.md"
LOGS = {"lauf1_leerlauf.csv": "inf", "lauf2_40ohm.csv": "40", "lauf3_15ohm.csv": "15"}
LONGEST = 600
"""A command that has not ended after this never will. [s]"""


def begin_with(reader: str) -> list[str]:
    """Arguments of the command that the README gives a reader to begin with."""
    (command,) = re.findall(
        rf"^\| {reader}[^|]*\| `winchcascade ([^`]+)` \|", read(README), re.MULTILINE
    )
    return str(command).split()


def filled(arguments: list[str], **places: Path) -> list[str]:
    """Arguments with folders and files in place of their names."""
    return [str(places.get(word, word)) for word in arguments]


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """Three logs of another rig with the rig file of the README, drafted campaign and all."""
    folder = tmp_path / "testday"
    folder.mkdir()
    for log in LOGS:
        shutil.copy(ROOT / "fixtures" / "other_rig" / log, folder)
    (rig,) = [step.text for step in steps(README) if step.file == "rig.toml"]
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    return folder


def test_a_test_engineer_gets_the_draft_of_a_campaign(campaign: Path) -> None:
    printed = call(*filled(begin_with("a test engineer"), FOLDER=campaign))
    assert printed.code == 0
    assert re.findall(r"^load_ohm = (\S+)", printed.out, re.MULTILINE) == list(LOGS.values())


@pytest.mark.slow
def test_a_designer_gets_the_gap_of_a_simulation_with_the_rig_file_of_the_readme(
    campaign: Path,
) -> None:
    assert call("init", campaign, "--write").code == 0
    simulated = campaign.parent / "simulated"
    simulated.mkdir()
    rig = campaign / "rig.toml"
    for log, load in LOGS.items():
        made = call(
            "simulate", campaign / log, "--rig", rig, "--load-ohm", load, "--out", simulated / log
        )
        assert made.code == 0, made.err
    arguments = filled(begin_with("a designer"), CAMPAIGN=campaign, FOLDER=simulated)
    done = call(*arguments, "--json", "-", patience=LONGEST)
    assert done.code == 0, done.err
    record = json.loads(done.out)
    assert len(record["simulations"]) == len(LOGS)
    assert record["verdict"] != "no_gap"  # gear and machine are those of the paper


def test_a_reviewer_finds_a_wrong_cell(tmp_path: Path) -> None:
    row = {"load_ohm": 40.0, "energy_line": 1428.0, "energy_mech": 1258.0, "energy_gen": 1022.0}
    row |= {"eta_trans": 0.881, "eta_gen": 0.812, "eta_pto": 0.761}
    table = tmp_path / "table.toml"
    table.write_text(table_text([row]), encoding="utf-8")
    done = call(*filled(begin_with("a reviewer"), TABLE=table), "--json", "-")
    assert done.code == 1
    assert "0.761" in done.out
