"""The plan of a batch: which logs, with which rig, load, window and cycles, each under a name of
its own.
"""

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from winchcascade.batch.plan import Work, make_plan
from winchcascade.core.campaign_settings import LogSettings
from winchcascade.core.errors import CampaignError, OptionError, RigError, WinchcascadeError

MAX_BYTES = 200
"""Of a log's name: file systems take 255, and ending and scratch suffix need some."""

CAMPAIGN = """
title = "Two loads"
rig = "rig.toml"
[[run]]
file = "a.csv"
load_ohm = 36.0
window_s = 5.48
cycles = [1, 2]
[[run]]
file = "b.csv"
load_ohm = inf
"""


def filled(folder: Path, *names: str) -> Path:
    """A folder with files of these names; a plan looks into none of them."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("Time (s)\n")
    return folder


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    folder = filled(tmp_path / "trial", "a.csv", "b.csv")
    (folder / "campaign.toml").write_text(CAMPAIGN)
    (folder / "rig.toml").write_text('based_on = "hsu2026"\nname = "ours"\n')
    return folder


def names(*targets: str | Path) -> list[str]:
    return [work.name for work in make_plan([str(target) for target in targets]).work]


def test_a_log_has_one_key_in_every_process(campaign: Path) -> None:
    code = (
        "import sys; from winchcascade.batch.plan import make_plan; "
        "sys.stdout.write(make_plan(sys.argv[1:]).work[0].key)"
    )
    keys = {
        subprocess.run(
            [sys.executable, "-c", code, str(campaign)],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(keys) == 1


def settings_of(work: Work) -> tuple[object, ...]:
    return (
        work.name,
        work.settings.rig.name,
        work.settings.load,
        work.settings.window,
        work.settings.cycles,
    )


@pytest.mark.parametrize("target", ["", "campaign.toml"], ids=["folder", "file"])
def test_a_campaign_gives_rig_load_window_and_cycles(campaign: Path, target: str) -> None:
    plan = make_plan([str(campaign / target)])
    assert plan.title == "Two loads"
    assert [settings_of(work) for work in plan.work] == [
        ("a.csv", "ours", 36.0, 5.48, (1, 2)),
        ("b.csv", "ours", math.inf, None, None),
    ]
    assert {(work.settings.load_source, work.settings.about) for work in plan.work} == {
        ("campaign.toml", "Two loads")
    }


def test_a_log_is_as_the_campaign_beside_it_says(campaign: Path) -> None:
    filled(campaign, "c.csv")
    plan = make_plan([str(campaign / name) for name in ("b.csv", "a.csv", "c.csv")])
    assert [settings_of(work) for work in plan.work] == [
        ("b.csv", "ours", math.inf, None, None),
        ("a.csv", "ours", 36.0, 5.48, (1, 2)),
        ("c.csv", "hsu2026", None, None, None),
    ]
    assert plan.work[2].settings.load_source == "unknown"
    assert plan.title == "b.csv and 2 more"


def test_logs_of_a_pattern_are_as_the_campaign_beside_them_says(campaign: Path) -> None:
    (work, _) = make_plan([str(campaign / "*.csv")]).work
    assert settings_of(work) == ("a.csv", "ours", 36.0, 5.48, (1, 2))


def test_options_win_over_the_campaign(campaign: Path) -> None:
    for target in (campaign, campaign / "a.csv"):
        work, *_ = make_plan([str(target)], rig="kitepower", window="payout").work
        assert settings_of(work) == ("a.csv", "kitepower", 36.0, "payout", (1, 2))


def test_a_folder_without_a_campaign_is_its_logs(tmp_path: Path) -> None:
    filled(
        tmp_path / "trial",
        "b.csv",
        "a.TDMS",
        "notes.md",
        "rig.toml",
        ".hidden.csv",
        "deep/c.csv",
        "no ending",
    )
    plan = make_plan([str(tmp_path / "trial")])
    assert [settings_of(work) for work in plan.work] == [
        ("a.TDMS", "hsu2026", None, None, None),
        ("b.csv", "hsu2026", None, None, None),
    ]
    assert plan.title == "trial"


def test_a_pattern_is_its_logs_in_order(tmp_path: Path) -> None:
    filled(tmp_path, "x/b.csv", "x/a.csv", "x/notes.md", "y/deep/c.csv")
    assert names(tmp_path / "x" / "*") == ["a.csv", "b.csv"]
    assert names(tmp_path / "**" / "*.csv") == ["a.csv", "b.csv", "c.csv"]
    assert names(tmp_path / "?" / "[a]*.csv") == ["a.csv"]


def test_a_file_whose_name_looks_like_a_pattern_is_that_file(tmp_path: Path) -> None:
    filled(tmp_path, "run[1].csv", "run1.csv")
    assert names(tmp_path / "run[1].csv") == ["run[1].csv"]


def test_a_log_may_end_as_it_likes_if_it_is_named_itself(tmp_path: Path) -> None:
    filled(tmp_path, "trial.001")
    assert names(tmp_path / "trial.001") == ["trial.001"]


def test_several_targets_are_one_campaign(campaign: Path, tmp_path: Path) -> None:
    filled(tmp_path / "more", "c.csv", "d.csv")
    plan = make_plan([str(campaign), str(tmp_path / "more"), str(tmp_path / "more" / "*.csv")])
    assert len(plan.work) == 4
    assert plan.title == "Two loads and 2 more"


def test_a_log_that_is_listed_with_two_windows_has_two_names(tmp_path: Path) -> None:
    filled(tmp_path, "a.csv")
    (tmp_path / "campaign.toml").write_text(
        "".join(f'[[run]]\nfile = "a.csv"\nwindow_s = {w}\n' for w in (5.0, 6.0))
    )
    first, second = make_plan([str(tmp_path)]).work
    assert first.name != second.name
    assert all(re.fullmatch(r"a\.csv-[0-9a-f]{8}", name) for name in (first.name, second.name))
    assert (first.settings.window, second.settings.window) == (5.0, 6.0)


def listed(folder: Path, *entries: str, rig: str = "") -> list[str]:
    """Names of the logs of a campaign with these entries."""
    text = "".join(f"[[run]]\n{entry}\n" for entry in entries)
    (folder / "campaign.toml").write_text(f"{rig}\n{text}")
    return names(folder)


def test_a_log_that_is_listed_with_other_cycles_is_named_by_them(tmp_path: Path) -> None:
    filled(tmp_path, "a.csv", "b.csv")
    entries = (
        'file = "a.csv"\ncycles = [1, 2]',
        'file = "./a.csv"\ncycles = [3, 3]',
        'file = "a.csv"',
        'file = "b.csv"',
    )
    assert listed(tmp_path, *entries) == ["a.csv-cycles-1-2", "a.csv-cycles-3-3", "a.csv", "b.csv"]
    assert listed(tmp_path, *entries[:1], *entries[3:]) == ["a.csv", "b.csv"]


@pytest.mark.parametrize("also", ["cycles = [3, 3]", "load_ohm = 9.0", "window_s = 6.0"])
def test_names_stay_while_the_rig_file_changes(tmp_path: Path, also: str) -> None:
    filled(tmp_path / "x", "a.csv")
    filled(tmp_path, "a.csv")
    entries = ('file = "a.csv"', f'file = "a.csv"\n{also}', 'file = "x/a.csv"')
    found = []
    for name in ("ours", "ours now"):
        (tmp_path / "rig.toml").write_text(f'based_on = "hsu2026"\nname = "{name}"\n')
        found.append(listed(tmp_path, *entries, rig='rig = "rig.toml"'))
    assert found[0] == found[1]
    assert len(set(found[0])) == 3


def test_logs_of_one_name_are_distinguished_by_their_place_alone(tmp_path: Path) -> None:
    filled(tmp_path, "x/a.csv", "y/a.csv")
    plain = listed(tmp_path, 'file = "x/a.csv"', 'file = "y/a.csv"')
    assert all(re.fullmatch(r"a\.csv-[0-9a-f]{8}", name) for name in plain)
    assert (
        listed(tmp_path, 'file = "x/a.csv"\nload_ohm = 9.0', 'file = "y/a.csv"\ncycles = [1, 2]')
        == plain
    )
    cycles = listed(
        tmp_path, *(f'file = "x/a.csv"\ncycles = [{k}, {k}]' for k in (1, 2)), 'file = "y/a.csv"'
    )
    assert cycles == [f"{plain[0]}-cycles-1-1", f"{plain[0]}-cycles-2-2", plain[1]]


def test_a_file_that_is_named_as_another_log_with_its_cycles_is_distinguished_from_it(
    tmp_path: Path,
) -> None:
    filled(tmp_path, "a.csv", "a.csv-cycles-1-2")
    entries = ('file = "a.csv"', 'file = "a.csv"\ncycles = [1, 2]', 'file = "a.csv-cycles-1-2"')
    assert len(set(listed(tmp_path, *entries))) == 3


def test_cycles_of_many_digits_leave_a_name_short(tmp_path: Path) -> None:
    filled(tmp_path, "a.csv")
    found = listed(tmp_path, 'file = "a.csv"', 'file = "a.csv"\ncycles = [1, 9000000000000000000]')
    assert re.fullmatch(r"a\.csv-cycles-[0-9a-f]{8}", found[1])


def test_the_same_log_twice_is_one(tmp_path: Path) -> None:
    filled(tmp_path, "a.csv")
    assert len(names(tmp_path / "a.csv", tmp_path / "a.csv")) == 1


def test_the_same_name_in_different_folders_is_distinguished_also_by_case(tmp_path: Path) -> None:
    filled(tmp_path, "x/a.csv", "y/a.csv", "z/A.csv")
    found = names(*(tmp_path / folder for folder in "xyz"))
    assert len({name.casefold() for name in found}) == 3


def test_a_name_does_not_depend_on_the_order_of_the_targets(tmp_path: Path) -> None:
    filled(tmp_path, "x/a.csv", "y/a.csv")
    assert set(names(tmp_path / "x", tmp_path / "y")) == set(names(tmp_path / "y", tmp_path / "x"))


IN_A_NAME = st.characters(codec="utf-8", exclude_characters="\0")
"""Characters of names of files: plans get no other, as no file can have it."""


@example(["測" * 120])
@example(["x" * 119 + ".csv", "x" * 200])
@given(st.lists(st.text(IN_A_NAME, min_size=1, max_size=300), min_size=1, max_size=6, unique=True))
def test_any_names_are_distinguished_and_safe_for_every_file_system(files: list[str]) -> None:
    from winchcascade.batch.plan import _named
    from winchcascade.core.rig_toml import built_in

    found = [
        work.name
        for work in _named(
            [Work(name, f"folder/{name}", LogSettings(built_in())) for name in files]
        )
    ]
    assert len({name.casefold() for name in found}) == len(files)
    for name in found:
        assert re.search(r'[<>:"/\\|?*\x00-\x1f]', name) is None
        assert name[:1] not in ("", ".", " ")  # the end may be: an ending follows
        assert len(name.encode("utf-8", "surrogatepass")) <= MAX_BYTES


def test_a_key_changes_with_every_option_and_with_the_rig(campaign: Path) -> None:
    def key(text: str = CAMPAIGN, rig: str | None = None, window: float | None = None) -> str:
        (campaign / "campaign.toml").write_text(text)
        return make_plan([str(campaign)], rig=rig, window=window).work[0].key

    keys = [
        key(),
        key(CAMPAIGN.replace("36.0", "37.0")),
        key(CAMPAIGN.replace("5.48", "5.49")),
        key(CAMPAIGN.replace("[1, 2]", "[1, 3]")),
        key(CAMPAIGN.replace("Two loads", "Two")),
        key(rig="kitepower"),
        key(window=7.0),
    ]
    (campaign / "rig.toml").write_text('based_on = "hsu2026"\nname = "ours too"\n')
    keys.append(key())
    assert len(set(keys)) == len(keys)
    assert key() == keys[-1]
    assert len(keys[0]) == 64


@pytest.mark.parametrize("target", ["nothing.csv", "no/such/folder", "*.csv", "**/*.tdms"])
def test_a_target_that_names_nothing_is_reported(tmp_path: Path, target: str) -> None:
    with pytest.raises(
        OptionError, match=r"no such file, folder or pattern; expected a campaign\.toml, a folder"
    ):
        make_plan([str(tmp_path / target)])


@pytest.mark.parametrize("target", ["", "*"])
def test_a_folder_without_logs_is_reported(tmp_path: Path, target: str) -> None:
    filled(tmp_path, "notes.md")
    with pytest.raises(
        OptionError,
        match=r"no log found; expected files that end in asc, csv, .*, or a campaign.toml",
    ):
        make_plan([str(tmp_path / target)])


@pytest.mark.parametrize("target", ["s3://bucket/log.csv", "file:///data/log.csv"])
def test_an_address_is_reported(target: str) -> None:
    with pytest.raises(OptionError, match=f"^{target}: "):
        make_plan([target])


def test_no_target_is_reported() -> None:
    with pytest.raises(CampaignError, match=r"no target; expected a campaign\.toml"):
        make_plan([])


def test_a_broken_campaign_is_reported_wherever_it_is_met(tmp_path: Path) -> None:
    filled(tmp_path, "a.csv")
    (tmp_path / "campaign.toml").write_text("[[run]\n")
    for target in (tmp_path, tmp_path / "campaign.toml", tmp_path / "a.csv"):
        with pytest.raises(CampaignError, match="not a valid TOML file"):
            make_plan([str(target)])


def test_a_toml_file_that_is_no_campaign_is_reported(campaign: Path) -> None:
    with pytest.raises(CampaignError, match="based_on"):
        make_plan([str(campaign / "rig.toml")])


@pytest.mark.parametrize("target", ["", "a.csv"], ids=["campaign", "log"])
def test_a_rig_that_is_not_there_is_reported(campaign: Path, target: str) -> None:
    with pytest.raises(RigError, match="no such file and no built-in rig"):
        make_plan([str(campaign / target)], rig="mine")
    (campaign / "rig.toml").unlink()
    with pytest.raises(RigError, match=r"rig\.toml"):
        make_plan([str(campaign / target)])


def test_every_rejection_of_a_plan_is_one_line(campaign: Path) -> None:
    for targets, rig in (([str(campaign / "none")], None), ([str(campaign)], "mine"), ([], None)):
        with pytest.raises(WinchcascadeError) as fault:
            make_plan(targets, rig=rig)
        assert "\n" not in str(fault.value)


def test_a_log_that_a_campaign_lists_and_that_is_not_there_stays_in_the_plan(
    campaign: Path,
) -> None:
    (campaign / "a.csv").unlink()
    assert names(campaign) == [
        "a.csv",
        "b.csv",
    ]  # it fails when its turn comes; the others are reduced


def test_a_link_to_a_log_is_as_the_campaign_says(campaign: Path, tmp_path: Path) -> None:
    shutil.copytree(campaign, tmp_path / "copy")
    (campaign / "link.csv").symlink_to(campaign / "a.csv")
    (work,) = make_plan([str(campaign / "link.csv")]).work
    assert (work.settings.load, work.settings.cycles) == (36.0, (1, 2))
