"""The demo: the packaged campaign is copied, never over somebody's files, and runs."""

from pathlib import Path

import pytest
from test_cli import one_sentence

from winchcascade.batch.demo import copy_campaign, packaged_campaign
from winchcascade.batch.plan import make_plan
from winchcascade.core.errors import OutputError


def test_the_copy_is_the_packaged_campaign(tmp_path: Path, fixtures: Path) -> None:
    campaign = copy_campaign(tmp_path / "demo" / "campaign")
    assert campaign == tmp_path / "demo" / "campaign" / "campaign.toml"
    copied = {path.name: path.read_bytes() for path in campaign.parent.iterdir()}
    assert copied == {path.name: path.read_bytes() for path in (fixtures / "campaign").iterdir()}
    assert packaged_campaign().is_dir()
    assert len(make_plan([str(campaign)]).work) == 7


def test_a_second_copy_writes_nothing(tmp_path: Path) -> None:
    before, after = (
        {path.name: path.stat().st_mtime_ns for path in copy_campaign(tmp_path).parent.iterdir()}
        for _ in range(2)
    )
    assert before == after


def test_a_file_with_other_content_is_kept_unless_forced(tmp_path: Path) -> None:
    (tmp_path / "r9ohm.csv").write_text("mine")
    with pytest.raises(
        OutputError,
        match=r"r9ohm\.csv: exists with another content; give --out a new folder or add --fo",
    ):
        copy_campaign(tmp_path)
    assert (tmp_path / "r9ohm.csv").read_text() == "mine"
    copy_campaign(tmp_path, force=True)
    assert (tmp_path / "r9ohm.csv").read_bytes() == (packaged_campaign() / "r9ohm.csv").read_bytes()


def test_the_command_rejects_a_folder_with_other_content(tmp_path: Path) -> None:
    (tmp_path / "campaign").mkdir()
    (tmp_path / "campaign" / "campaign.toml").write_text("mine")
    assert "exists with another content" in one_sentence("demo", "--out", tmp_path)
    assert (tmp_path / "campaign" / "campaign.toml").read_text() == "mine"
    assert not (tmp_path / "results").exists()


def test_the_command_rejects_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "the folder cannot be made" in one_sentence("demo", "--out", tmp_path / "file")
