import math
import re
from pathlib import Path

import pytest
from loops import rejections

from winchcascade.core.campaign_file import campaign_beside, load_campaign
from winchcascade.core.errors import CampaignError


def test_the_shipped_campaign_has_an_open_circuit_and_six_loads(fixtures: Path) -> None:
    campaign = load_campaign(fixtures / "campaign")
    assert [run.load for run in campaign.runs] == [math.inf, 45.0, 36.0, 27.0, 18.0, 9.0, 4.5]
    assert [run.window for run in campaign.runs] == [None, 5.48, 5.48, 5.96, 5.96, 5.96, 5.96]
    assert all(run.file.is_file() for run in campaign.runs)


def test_a_log_finds_the_campaign_that_lists_it(fixtures: Path) -> None:
    found = campaign_beside(fixtures / "campaign" / "r9ohm.csv")
    assert found is not None
    assert found[1].load == 9.0


def test_a_simulation_beside_a_log_is_found_relative_to_the_campaign(tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_text(
        '[[run]]\nfile = "a.csv"\nsimulated = "own/a.mat"\n[[run]]\nfile = "b.csv"\n'
    )
    assert [run.simulated for run in load_campaign(tmp_path).runs] == [
        tmp_path / "own" / "a.mat",
        None,
    ]


def test_a_log_that_no_campaign_lists_stands_alone(tmp_path: Path) -> None:
    (tmp_path / "campaign.toml").write_text('[[run]]\nfile = "other.csv"\n')
    assert campaign_beside(tmp_path / "log.csv") is None


WRONG = """
[[run] @ TOML
title = "x" @ run missing
colour = 1; RUN @ colour
[[run]];load_ohm = 3.0 @ run 1: file missing
[[run]];file = "a\\u0000.csv" @ run 1: file a
RUN load = 3.0 @ run 1: load load_ohm
RUN load_ohm = -3.0 @ run 1: load_ohm -3.0
RUN window_s = inf @ run 1: window_s inf
RUN RUN cycles = [3, 1] @ run 2: cycles [3,
RUN withheld = "no" @ run 1: withheld 'no' true false
RUN started = 3 @ run 1: started 3 date
RUN ranges_s = [[3, 2]] @ run 1: ranges_s
"""


def test_a_wrong_entry_is_one_sentence_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(text: str, where: str) -> object:
        Path(where).write_text(text)
        return load_campaign(Path(where))

    monkeypatch.chdir(tmp_path)
    cases = WRONG.replace("RUN", "[[run]];file = 'a';")
    assert rejections(read, CampaignError, cases) == []


def test_a_folder_without_a_campaign_is_reported_with_the_command_that_drafts_one(
    tmp_path: Path,
) -> None:
    with pytest.raises(CampaignError, match=f"winchcascade init {re.escape(str(tmp_path))}"):
        load_campaign(tmp_path)
    with pytest.raises(CampaignError, match="cannot be read"):
        load_campaign(tmp_path / "campaign.toml")


def test_a_log_in_place_of_a_campaign_is_reported(fixtures: Path) -> None:
    with pytest.raises(
        CampaignError,
        match=r"r36ohm\.csv: is no campaign; expected a campaign\.toml that lists the logs",
    ):
        load_campaign(fixtures / "campaign" / "r36ohm.csv")


TWICE = [
    ("a.csv", "", "./sub/../a.csv", "withheld = true", True),
    ("a.csv", "withheld = true", "link.csv", "", True),
    ("a.csv", "cycles = [1, 5]", "a.csv", "cycles = [5, 9]\nwithheld = true", True),
    ("a.csv", "cycles = [1, 5]", "a.csv", "cycles = [6, 9]\nwithheld = true", False),
    ("a.csv", "withheld = true", "a.csv", "withheld = true", False),
    ("a.csv", "load_ohm = 9", "a.csv", "load_ohm = 18", False),
    ("a.csv", "", "b.csv", "withheld = true", False),
]


@pytest.mark.parametrize(("first", "one", "second", "other", "rejected"), TWICE)
def test_a_withheld_log_must_not_be_listed_again(
    tmp_path: Path, first: str, one: str, second: str, other: str, rejected: bool
) -> None:
    (tmp_path / "sub").mkdir()
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("x")
    (tmp_path / "link.csv").symlink_to("a.csv")
    path = tmp_path / "campaign.toml"
    path.write_text(f'[[run]]\nfile = "{first}"\n{one}\n[[run]]\nfile = "{second}"\n{other}\n')
    if not rejected:
        assert len(load_campaign(path).runs) == 2
        return
    with pytest.raises(CampaignError) as fault:
        load_campaign(path)
    held = 1 if "withheld" in one else 2
    assert (
        f"runs 1 ({first}) and 2 ({Path(second).name}) are the same log, and run {held} is withheld"
        in str(fault.value)
    )
    assert f"Remove run {3 - held}" in str(fault.value)
