"""Simulations that a campaign lists or a folder holds, and what is reported of those that cannot
be used.
"""

import shutil
from pathlib import Path

import pytest

from winchcascade.batch.campaign_diagnosis import read_simulations, with_simulations
from winchcascade.core.campaign_file import load_campaign
from winchcascade.core.errors import CampaignError, LogError, OptionError
from winchcascade.core.rig_toml import built_in
from winchcascade.core.run import Run
from winchcascade.ingest.read import read_run


@pytest.fixture
def folder(tmp_path: Path, fixtures: Path) -> Path:
    """Two logs, and a simulation of the first."""
    (tmp_path / "simulated").mkdir()
    for name in ("r36ohm.csv", "r9ohm.csv"):
        shutil.copy(fixtures / "campaign" / name, tmp_path / name)
    shutil.copy(tmp_path / "r36ohm.csv", tmp_path / "simulated" / "r36ohm.csv")
    return tmp_path


def campaign(folder: Path, *simulated: str) -> Path:
    rows = [
        f'[[run]]\nfile = "{name}"\n{line}load_ohm = {load}\n'
        for name, load, line in zip(
            ("r36ohm.csv", "r9ohm.csv"), (36.0, 9.0), simulated, strict=True
        )
    ]
    (folder / "campaign.toml").write_text("".join(rows))
    return folder


def logs(folder: Path) -> list[Run]:
    return [read_run(folder / "r36ohm.csv", load=36.0), read_run(folder / "r9ohm.csv", load=9.0)]


def read(folder: Path) -> list[Run] | None:
    return read_simulations(load_campaign(folder), built_in(), logs(folder), lambda _: None)


def test_a_campaign_without_simulations_has_none(folder: Path) -> None:
    assert read(campaign(folder, "", "")) is None


def test_each_simulation_is_read_with_the_load_of_its_log(folder: Path) -> None:
    shutil.copy(folder / "r9ohm.csv", folder / "simulated" / "other.csv")
    listed = campaign(
        folder, 'simulated = "simulated/r36ohm.csv"\n', 'simulated = "simulated/other.csv"\n'
    )
    found = read(listed)
    assert found is not None
    assert [(run.name, run.load) for run in found] == [("r36ohm.csv", 36.0), ("other.csv", 9.0)]


def test_a_run_without_a_simulation_among_others_is_named(folder: Path) -> None:
    listed = campaign(folder, 'simulated = "simulated/r36ohm.csv"\n', "")
    with pytest.raises(
        CampaignError,
        match=r"run 2 \(r9ohm.csv\) has no simulation, but others have one; expected simulated",
    ):
        read(listed)


def test_a_simulation_that_does_not_exist_is_named(folder: Path) -> None:
    listed = campaign(
        folder, 'simulated = "simulated/r36ohm.csv"\n', 'simulated = "simulated/r9ohm.csv"\n'
    )
    with pytest.raises(
        CampaignError,
        match=r"run 2 \(r9ohm.csv\): no file .*simulated/r9ohm.csv; expected the simulation of",
    ):
        read(listed)


def test_a_simulation_that_is_no_log_is_rejected_by_the_reader(folder: Path) -> None:
    (folder / "simulated" / "r9ohm.csv").write_text("nothing\n")
    listed = campaign(
        folder, 'simulated = "simulated/r36ohm.csv"\n', 'simulated = "simulated/r9ohm.csv"\n'
    )
    with pytest.raises(LogError, match="r9ohm"):
        read(listed)


def test_a_folder_holds_files_with_the_names_of_the_logs(folder: Path) -> None:
    shutil.copy(folder / "r9ohm.csv", folder / "simulated")
    listed = with_simulations(load_campaign(campaign(folder, "", "")), folder / "simulated")
    assert [run.simulated for run in listed.runs] == [
        folder / "simulated" / name for name in ("r36ohm.csv", "r9ohm.csv")
    ]


def test_a_folder_that_lacks_a_file_or_does_not_exist_is_rejected(folder: Path) -> None:
    listed = load_campaign(campaign(folder, "", ""))
    with pytest.raises(
        OptionError,
        match=r"no file r9ohm.csv; expected one simulation for each .* with the name of the log",
    ):
        with_simulations(listed, folder / "simulated")
    with pytest.raises(
        OptionError, match=r"no such folder; expected a folder with one simulation for each log"
    ):
        with_simulations(listed, folder / "nowhere")
