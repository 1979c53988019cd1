"""The commands batch, demo, check and audit as a user meets them: in a process of their own."""

import json
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import pytest
from test_cli import one_sentence, winchcascade

TABLE = """
title = "Our own table"
source = "nobody"
[columns]
load_ohm = {{ unit = "ohm", decimals = 1 }}
eta_trans = {{ unit = "1", decimals = 2 }}
eta_gen = {{ unit = "1", decimals = 2 }}
eta_pto = {{ unit = "1", decimals = 2 }}
[[row]]
load_ohm = 36.0
eta_trans = 0.90
eta_gen = 0.77
eta_pto = {eta}
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One load and an open circuit."""
    source = Path(__file__).parent.parent / "fixtures" / "campaign"
    folder = tmp_path_factory.mktemp("essai")
    for name in ("r36ohm.csv", "open_circuit.csv"):
        shutil.copy(source / name, folder)
    (folder / "campaign.toml").write_text(
        '[[run]]\nfile = "r36ohm.csv"\nload_ohm = 36.0\nwindow_s = 5.48\n[[run]]\nfile = '
        '"open_circuit.csv"\nload_ohm = inf\n'
    )
    return folder


@pytest.fixture(scope="module")
def out(campaign: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("results") / "out"
    assert winchcascade("batch", campaign, "--out", folder, "--reports", "none").returncode == 0
    return folder


@pytest.fixture
def table(tmp_path: Path) -> Path:
    path = tmp_path / "table.toml"
    path.write_text(TABLE.format(eta="0.70"))
    return path


@pytest.fixture
def wrong(tmp_path: Path) -> Path:
    """A table that contradicts the log, and itself: 0.90 x 0.77 is not 0.60."""
    path = tmp_path / "wrong.toml"
    path.write_text(TABLE.format(eta="0.60"))
    return path


# ------------------------------------------------------------------------------------------ batch
@pytest.mark.parametrize("command", ["batch", "demo", "check", "audit"])
def test_every_command_has_help(command: str) -> None:
    done = winchcascade(command, "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--reports", "some"), "--reports some: expected none, html or all."),
        (("--window", "soon"), "expected auto, payout or a length in seconds"),
        (("--rig", "nothing.toml"), "no such file and no built-in rig"),
        (("--jobs", "0"), "--jobs"),
        (("--jobs", "many"), "--jobs"),
    ],
)
def test_an_option_of_batch_that_cannot_be_used_is_reported(
    campaign: Path, tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    assert says in one_sentence("batch", campaign, "--out", tmp_path / "out", *arguments)
    assert not (tmp_path / "out").exists()


def test_a_batch_needs_a_target_and_a_folder(campaign: Path) -> None:
    assert "TARGET" in one_sentence("batch", "--out", "x")
    assert "--out" in one_sentence("batch", campaign)


@pytest.mark.parametrize("target", ["nothing.csv", "no/*.csv", "."])
def test_a_target_without_logs_is_reported_and_leaves_no_folder(
    tmp_path: Path, target: str
) -> None:
    (tmp_path / "notes.md").touch()
    text = one_sentence("batch", target, "--out", "out", cwd=tmp_path)
    assert "expected" in text
    assert not (tmp_path / "out").exists()


def test_a_batch_in_which_a_log_fails_has_exit_code_one(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("name,colour\nanchor,red\n")
    arguments = (
        campaign / "r36ohm.csv",
        tmp_path / "bad.csv",
        "--out",
        tmp_path / "out",
        "--reports",
        "none",
    )
    done = winchcascade("batch", *arguments)
    assert done.returncode == 1
    assert "1 of 2 logs reduced" in done.stdout
    assert "bad.csv: no table of numbers" in " ".join(done.stdout.split())
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("load", "stated"), [((), None), (("--load-ohm", "36"), 36.0)], ids=["unknown", "given"]
)
def test_logs_without_a_campaign_have_the_load_that_is_given(
    campaign: Path, tmp_path: Path, load: tuple[str, ...], stated: float | None
) -> None:
    logs, results = tmp_path / "logs", tmp_path / "results"
    logs.mkdir()
    shutil.copy(campaign / "r36ohm.csv", logs)
    printed = winchcascade("batch", logs, "--out", results, "--reports", "none", *load).stdout
    assert (
        json.loads((results / "runs" / "r36ohm.csv.json").read_text())["log"]["load_ohm"] == stated
    )
    assert (f"winchcascade init {logs}" in " ".join(printed.split())) == (not load)


def test_a_given_load_leaves_those_of_a_campaign(campaign: Path, tmp_path: Path) -> None:
    results = tmp_path / "results"
    winchcascade("batch", campaign, "--out", results, "--reports", "none", "--load-ohm", "9")
    assert json.loads((results / "runs" / "r36ohm.csv.json").read_text())["log"]["load_ohm"] == 36.0


def test_a_foreign_folder_is_reported_and_used_with_force(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").touch()
    arguments = ("batch", campaign, "--out", tmp_path, "--reports", "none")
    assert "is not empty and no folder of a batch" in one_sentence(*arguments)
    assert winchcascade(*arguments, "--force").returncode == 0


def test_the_rig_and_window_of_the_command_line_win(campaign: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('based_on = "hsu2026"\nname = "mine"\n')
    options = (
        "--rig",
        tmp_path / "mine.toml",
        "--window",
        "5",
        "--reports",
        "none",
        "--out",
        tmp_path / "out",
    )
    assert winchcascade("batch", campaign, *options).returncode == 0
    record = json.loads((tmp_path / "out" / "runs" / "r36ohm.csv.json").read_bytes())
    assert (record["rig"]["name"], record["window"], record["log"]["load_ohm"]) == (
        "mine",
        5.0,
        36.0,
    )


def test_the_workbook_is_written_where_asked_for(campaign: Path, out: Path, tmp_path: Path) -> None:
    shutil.copytree(out, tmp_path / "out")
    assert not (out / "campaign.xlsx").exists()
    done = winchcascade(
        "batch", campaign, "--out", tmp_path / "out", "--reports", "none", "--excel"
    )
    assert "2 of 2 logs reduced by an earlier call" in done.stdout
    assert f"{tmp_path / 'out' / 'campaign.xlsx'}" in done.stdout


# ------------------------------------------------------------------------------------------ check
@pytest.mark.parametrize(
    "form", ["campaign", "campaign.toml", "batch", "campaign.json", "reduction"]
)
def test_results_of_every_form_are_checked(
    campaign: Path, out: Path, table: Path, form: str
) -> None:
    target = {
        "campaign": campaign, "campaign.toml": campaign / "campaign.toml", "batch": out,
        "campaign.json": out / "campaign.json", "reduction": out / "runs" / "r36ohm.csv.json",
    }[form]  # fmt: skip
    done = winchcascade("check", target, "--against", table)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("All 3 cells agree.\n")


def test_a_difference_is_exit_code_one_everywhere(out: Path, wrong: Path, tmp_path: Path) -> None:
    junit, report = tmp_path / "junit.xml", tmp_path / "check.json"
    done = winchcascade(
        "check", out, "--against", wrong, "--junit", junit, "--json", report, "--github"
    )
    assert done.returncode == 1
    root = ElementTree.parse(junit).getroot()
    assert root.tag == "testsuites"
    assert (root.get("tests"), root.get("failures")) == ("3", "1")
    (failure,) = root.iter("failure")
    assert "eta_pto" in (failure.get("message") or "")
    record = json.loads(report.read_text())
    assert (record["schema"], record["ok"], record["misses"]) == ("winchcascade/check/1", False, 1)
    (annotation,) = re.findall(r"^::error file=.*$", done.stdout, re.MULTILINE)
    assert "wrong.toml,line=13," in annotation


def test_json_of_a_check_on_stdout_is_json_alone(out: Path, wrong: Path) -> None:
    done = winchcascade("check", out, "--against", wrong, "--json", "-", "--github")
    assert done.returncode == 1
    assert json.loads(done.stdout)["ok"] is False
    assert done.stderr.startswith("::error ")


def test_a_tolerance_widens_and_narrows(out: Path, table: Path, wrong: Path) -> None:
    wide = ("--tolerance", "uncertainty=30", "--tolerance", "rounding=1.5")
    assert winchcascade("check", out, "--against", wrong, *wide).returncode == 0
    none = [f"--tolerance={part}=0" for part in ("rounding", "deviation", "uncertainty")]
    done = winchcascade("check", out, "--against", table, *none)
    assert done.returncode == 1
    assert "0 of 3 cells agree" in done.stdout
    assert "30 x 2 standard" in " ".join(
        winchcascade("check", out, "--against", wrong, *wide).stdout.split()
    )


@pytest.mark.parametrize(
    "option", ["rounding", "rounding=", "rounding=x", "rounding=-1", "rounding=nan", "load=1", "=1"]
)
def test_a_tolerance_that_cannot_be_used_is_reported(out: Path, table: Path, option: str) -> None:
    text = one_sentence("check", out, "--against", table, "--tolerance", option)
    assert (
        f"--tolerance {option}: expected rounding, deviation or uncertainty and a factor, such as unc"
        in text
    )


def test_an_infinite_tolerance_is_rejected(out: Path, table: Path) -> None:
    assert "--tolerance" in one_sentence(
        "check", out, "--against", table, "--tolerance", "uncertainty=inf"
    )


def test_a_table_that_is_not_there_is_reported(out: Path) -> None:
    assert "nothing" in one_sentence("check", out, "--against", "nothing")
    assert "nothing" in one_sentence("audit", "nothing")
    assert "--against" in one_sentence("check", out)


def test_results_that_are_none_are_reported(table: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "cannot be read" in one_sentence("check", tmp_path / "nothing.json", "--against", table)
    assert "no log found" in one_sentence("check", tmp_path / "empty", "--against", table)
    assert "is no JSON of a reduction" in one_sentence(
        "check", Path(shutil.copy(table, tmp_path / "t")), "--against", table
    )


def test_a_load_without_a_row_is_reported(out: Path, table: Path) -> None:
    table.write_text(table.read_text().replace("load_ohm = 36.0", "load_ohm = 37.0"))
    assert "load_ohm 36 ohm" in one_sentence("check", out, "--against", table)


@pytest.mark.parametrize("option", ["--json", "--junit"])
def test_a_result_never_replaces_an_input_of_a_check(
    out: Path, table: Path, tmp_path: Path, option: str
) -> None:
    shutil.copytree(out, tmp_path / "out")
    reduction = tmp_path / "out" / "runs" / "r36ohm.csv.json"
    for target, place in ((table, tmp_path / "out"), (reduction, reduction)):
        before = target.read_bytes()
        arguments = ("check", place, "--against", table, option, target, "--force")
        assert "is an input of this command" in one_sentence(*arguments)
        assert target.read_bytes() == before


@pytest.mark.parametrize(
    "name", ["campaign.json", "runs/r36ohm.csv.json", "campaign.toml", "r36ohm.csv"]
)
def test_a_result_never_replaces_a_file_of_the_batch_or_campaign_it_is_made_from(
    campaign: Path, out: Path, table: Path, tmp_path: Path, name: str
) -> None:
    source, options = (out, ()) if name.endswith(".json") else (campaign, ("--force",))
    shutil.copytree(source, tmp_path / "copy")
    target = tmp_path / "copy" / name
    winchcascade("check", tmp_path / "copy", "--against", table, "--json", target, *options)
    assert target.read_bytes() == (source / name).read_bytes()


def test_two_results_of_one_name_are_rejected(out: Path, table: Path, tmp_path: Path) -> None:
    same = ("--json", tmp_path / "x", "--junit", tmp_path / "x")
    assert "--json and --junit both name" in one_sentence("check", out, "--against", table, *same)
    assert not (tmp_path / "x").exists()


def test_ones_own_results_are_replaced_and_no_other(out: Path, table: Path, tmp_path: Path) -> None:
    arguments = (
        "check",
        out,
        "--against",
        table,
        "--junit",
        tmp_path / "j.xml",
        "--json",
        tmp_path / "c.json",
    )
    for _ in range(2):
        assert winchcascade(*arguments).returncode == 0
    (tmp_path / "j.xml").write_text("<mine/>")
    assert "was not written by winchcascade" in one_sentence(*arguments)
    assert winchcascade(*arguments, "--force").returncode == 0


# ------------------------------------------------------------------------------------------ audit
def test_a_consistent_table_is_exit_code_zero(table: Path) -> None:
    done = winchcascade("audit", table)
    assert done.returncode == 0
    assert done.stdout.endswith("Nothing contradicts itself.\n")


def test_a_table_against_itself_is_exit_code_one(wrong: Path) -> None:
    done = winchcascade("audit", wrong, "--json", "-")
    assert done.returncode == 1
    record = json.loads(done.stdout)
    assert (record["schema"], record["ok"]) == ("winchcascade/audit/1", False)
    assert done.stderr == ""
    assert winchcascade("audit", wrong).returncode == 1


def test_a_table_that_cannot_be_read_is_exit_code_two(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("[[row]\n")
    assert "bad.toml" in one_sentence("audit", tmp_path / "bad.toml")


def test_a_result_never_replaces_the_table(table: Path) -> None:
    before = table.read_bytes()
    assert "is an input of this command" in one_sentence("audit", table, "--json", table, "--force")
    assert table.read_bytes() == before


def test_an_audit_is_written_where_asked_for(table: Path, tmp_path: Path) -> None:
    for _ in range(2):
        done = winchcascade("audit", table, "--json", tmp_path / "audit.json")
        assert done.returncode == 0
        assert done.stdout.endswith("Nothing contradicts itself.\n")
    assert json.loads((tmp_path / "audit.json").read_text())["ok"] is True
