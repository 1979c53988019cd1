"""The command line as a user meets it: called in this process, and in one of its own where that
is what is tested.
"""

import json
import os
import platform
import shlex
import shutil
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from calls import call

from winchcascade import __version__
from winchcascade.cli.app import MATTERING
from winchcascade.cli.entry import main
from winchcascade.core.rig_toml import built_in_text

LONGEST = 600
"""A command that has not ended after this never will. [s]"""


def winchcascade(
    *arguments: str | Path, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Call the command line in this process, which saves the time that a process takes to start."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        if cwd is not None:
            patch.chdir(cwd)
        called = call(*arguments, patience=LONGEST)
    return subprocess.CompletedProcess([*map(str, arguments)], called.code, called.out, called.err)


def started(
    *arguments: str | Path, cwd: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Start the command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "winchcascade", *map(str, arguments)],
        capture_output=True, text=True, encoding="utf-8", cwd=cwd, env=os.environ | environment, check=False,
    )  # fmt: skip


def rejection(*arguments: str | Path, cwd: Path | None = None) -> str:
    """The one sentence of a rejection: exit code 2, nothing on stdout, no traceback."""
    done = winchcascade(*arguments, cwd=cwd)
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    assert "Traceback" not in done.stderr
    return done.stderr


def one_sentence(*arguments: str | Path, cwd: Path | None = None) -> str:
    text = rejection(*arguments, cwd=cwd)
    assert text.startswith("winchcascade: ")
    assert text.count("\n") == 1
    return text


@pytest.fixture
def log(fixtures: Path, tmp_path: Path) -> Path:
    """A log on its own, without the campaign beside it, in a folder with a blank and other
    letters in its name.
    """
    folder = tmp_path / "mes essais 測試"
    folder.mkdir()
    return Path(shutil.copy(fixtures / "campaign" / "r36ohm.csv", folder / "run 1 é.csv"))


@pytest.mark.parametrize("command", [[], ["reduce"], ["rig"]], ids=["all", "reduce", "rig"])
def test_every_command_has_help(command: list[str]) -> None:
    done = winchcascade(*command, "--help")
    assert done.returncode == 0
    assert "Usage" in done.stdout


def test_the_version_names_what_matters() -> None:
    first, *packages = winchcascade("--version").stdout.splitlines()
    assert (
        first == f"winchcascade {__version__} (Python {platform.python_version()}, "
        f"{platform.platform()})"
    )
    assert packages == [f"{name} {version(name)}" for name in MATTERING]


@pytest.mark.parametrize(
    "by", ["KeyboardInterrupt", "RuntimeError('made') from KeyboardInterrupt()"]
)
@pytest.mark.parametrize("at", ["typer", "winchcascade.cli.reduce_command", "numpy"])
def test_an_interrupt_of_an_import_is_one_sentence(at: str, by: str) -> None:
    code = (
        "import sys\n"
        "class Interrupts:\n"
        "    def find_spec(name, *_):\n"
        f"        if name == {at!r}: raise {by}\n"
        "sys.meta_path.insert(0, Interrupts)\n"
        "from winchcascade.cli.entry import main\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "reduce", "x.csv"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "winchcascade: interrupted; no file was left half-written.\n"


def test_a_log_in_place_of_a_table_is_referred_to_the_command_that_reads_it(log: Path) -> None:
    done = winchcascade("audit", str(log))
    assert done.returncode == 2
    assert str(log) in done.stderr
    assert "winchcascade reduce" in done.stderr


def test_a_log_with_blanks_and_other_letters_in_its_name_reduces(log: Path) -> None:
    done = winchcascade("reduce", log)
    assert done.returncode == 0
    assert "run 1 é.csv" in done.stdout
    assert "mean of 3" in done.stdout


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "cp950"])
def test_a_terminal_of_few_letters_does_not_stop_a_reduction(log: Path, encoding: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "winchcascade", "reduce", str(log)],
        capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding}, check=False,
    )  # fmt: skip
    assert done.returncode == 0
    assert b"mean of 3" in done.stdout


def test_json_on_stdout_is_json_alone(log: Path) -> None:
    done = winchcascade("reduce", log, "--json", "-", "--load-ohm", "36")
    record = json.loads(done.stdout)
    assert record["log"]["load_ohm"] == 36.0
    assert done.stderr == ""


def test_json_and_parquet_are_written_where_asked(log: Path, tmp_path: Path) -> None:
    done = winchcascade(
        "reduce", log, "--json", tmp_path / "out.json", "--parquet", tmp_path / "tables"
    )
    assert done.returncode == 0
    assert json.loads((tmp_path / "out.json").read_text())["schema"] == "winchcascade/reduction/1"
    assert sorted(p.name.split(".")[-2] for p in (tmp_path / "tables").iterdir()) == [
        "bins",
        "cycles",
        "findings",
    ]
    assert (
        winchcascade("reduce", log, "--json", tmp_path / "out.json").returncode == 0
    )  # its own file is replaced


def test_the_load_is_never_inferred(log: Path) -> None:
    record = json.loads(winchcascade("reduce", log, "--json", "-").stdout)
    assert record["log"]["load_ohm"] is None
    assert record["log"]["open_circuit"] is False


def test_what_options_leave_open_comes_from_the_campaign_beside_the_log(fixtures: Path) -> None:
    record = json.loads(
        winchcascade("reduce", fixtures / "campaign" / "r18ohm.csv", "--json", "-").stdout
    )
    assert record["log"]["load_ohm"] == 18.0
    assert record["log"]["load_source"] == "campaign.toml"
    assert record["window"] == 5.96


def test_options_win_over_the_campaign(fixtures: Path) -> None:
    arguments = ("--json", "-", "--load-ohm", "20", "--window", "auto")
    record = json.loads(
        winchcascade("reduce", fixtures / "campaign" / "r18ohm.csv", *arguments).stdout
    )
    assert (record["log"]["load_ohm"], record["window"]) == (20.0, "auto")


def test_an_option_more_leaves_the_cycles_of_the_campaign_as_they_are(log: Path) -> None:
    entry = f'[[run]]\nfile = "{log.name}"\nload_ohm = 36\nwindow_s = 5.48\ncycles = [1, 2]\n'
    (log.parent / "campaign.toml").write_text(entry, encoding="utf-8")
    options = ("--rig", "hsu2026", "--load-ohm", "36")
    for more in ((), ("--window", "5.48")):
        record = json.loads(winchcascade("reduce", log, *options, *more, "--json", "-").stdout)
        assert [cycle["cycle"] for cycle in record["cycles"]] == [1, 2]


def test_an_infinite_load_is_an_open_circuit(log: Path) -> None:
    record = json.loads(winchcascade("reduce", log, "--json", "-", "--load-ohm", "inf").stdout)
    assert record["log"]["open_circuit"] is True
    assert record["mean"]["eta_gen"] is None


def test_a_log_that_is_not_there_is_reported(tmp_path: Path) -> None:
    assert "no such file" in one_sentence("reduce", tmp_path / "nothing.csv")


def test_a_folder_is_no_log(tmp_path: Path) -> None:
    sentence = one_sentence("reduce", tmp_path)
    assert "is not a file" in sentence
    assert f"`winchcascade batch {tmp_path} --out results`" in sentence


def test_an_empty_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "empty.csv").touch()
    assert "the file is empty" in one_sentence("reduce", tmp_path / "empty.csv")


def test_a_log_without_a_payout_is_reported(tmp_path: Path) -> None:
    rows = "\n".join(f"{0.04 * k:.2f},0.0,0.0,200.0" for k in range(500))
    (tmp_path / "rest.csv").write_text(
        "Time (s),Displacement (m),Velocity (m/s),Force (N)\n" + rows + "\n"
    )
    assert "no payout found" in one_sentence("reduce", tmp_path / "rest.csv", "--json", "-")


def test_a_broken_campaign_beside_the_log_is_reported(log: Path) -> None:
    (log.parent / "campaign.toml").write_text("[[run]\n")
    assert "To read run 1 é.csv without it, give --rig" in one_sentence("reduce", log)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--window", "soon"), "expected auto, payout or a length in seconds"),
        (("--load-ohm", "-3"), "expected a number of ohms above 0"),
        (("--load-ohm", "nan"), "expected a number of ohms above 0"),
        (("--rig", "nothing.toml"), "no such file and no built-in rig"),
        (("--json", "no/such/folder/out.json"), "does not exist"),
    ],
)
def test_an_option_that_cannot_be_used_is_reported(
    log: Path, arguments: tuple[str, ...], says: str
) -> None:
    assert says in one_sentence("reduce", log, *arguments)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("reduce", "x.csv", "--load-ohm", "ten"), "--load-ohm"),
        (("reduce",), "LOG"),
        (("reduce", "x.csv", "--colour"), "--colour"),
        (("redcue", "x.csv"), "redcue"),
    ],
)
def test_a_wrong_use_is_one_sentence(arguments: tuple[str, ...], says: str) -> None:
    assert says in one_sentence(*arguments)


def test_without_a_command_there_is_help() -> None:
    assert "Usage" in (done := winchcascade()).stdout + done.stderr


@pytest.mark.parametrize("seconds", ["20", "50"])
def test_a_window_longer_than_the_payouts_is_rejected(log: Path, seconds: str) -> None:
    done = winchcascade("reduce", log, "--window", seconds)
    assert done.returncode == 2
    assert f"3 of 3 payouts end before their window of {seconds} s does" in done.stderr
    assert "a window of at most 13.4" in done.stderr


def test_a_foreign_file_is_kept_unless_forced(log: Path, tmp_path: Path) -> None:
    mine = tmp_path / "thesis.json"
    mine.write_text("mine")
    assert "was not written by winchcascade" in one_sentence("reduce", log, "--json", mine)
    assert mine.read_text() == "mine"
    assert winchcascade("reduce", log, "--json", mine, "--force").returncode == 0


def test_a_text_that_only_names_the_program_is_a_foreign_file(log: Path, tmp_path: Path) -> None:
    notes = tmp_path / "notes.md"
    notes.write_text("the figures come from winchcascade/report, see there")
    assert "was not written by winchcascade" in one_sentence("reduce", log, "--json", notes)


def test_a_log_is_never_replaced_by_its_result(log: Path) -> None:
    before = log.read_bytes()
    assert "is an input of this command" in one_sentence("reduce", log, "--json", log, "--force")
    assert log.read_bytes() == before


def test_a_rig_file_is_never_replaced_by_a_result(log: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('based_on = "hsu2026"\n')
    assert "is an input of this command" in one_sentence(
        "reduce", log, "--rig", rig, "--json", rig, "--force"
    )


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_standard_output_is_reported(log: Path) -> None:
    command = [sys.executable, "-m", "winchcascade", "reduce", str(log), "--json", "-"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert "standard output: cannot be used" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_device_or_a_pipe_is_not_replaced(log: Path, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert "is a device or a pipe" in one_sentence("reduce", log, "--json", pipe, "--force")
    assert pipe.is_fifo()


def test_a_link_to_a_result_stays_a_link(log: Path, tmp_path: Path) -> None:
    (tmp_path / "link.json").symlink_to(tmp_path / "target.json")
    assert winchcascade("reduce", log, "--json", tmp_path / "link.json").returncode == 0
    assert (tmp_path / "link.json").is_symlink()
    assert "schema" in (tmp_path / "target.json").read_text()


def test_a_name_that_is_too_long_is_reported() -> None:
    assert "too long" in one_sentence("reduce", "x" * 300)


def test_a_rejected_log_leaves_no_file_behind(tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("name,colour\nanchor,red\n")
    one_sentence(
        "reduce",
        tmp_path / "bad.csv",
        "--json",
        tmp_path / "out.json",
        "--parquet",
        tmp_path / "tables",
    )
    assert [p.name for p in tmp_path.iterdir()] == ["bad.csv"]


@pytest.mark.parametrize("name", ["hsu2026", "kitepower"])
def test_rig_prints_a_built_in_rig_file(name: str) -> None:
    assert winchcascade("rig", name).stdout == built_in_text(name)


def test_a_mistyped_command_is_answered_with_the_nearest_name() -> None:
    assert one_sentence("redce").endswith(
        "Did you mean 'reduce'? --help lists what a command takes.\n"
    )


def test_a_rig_that_is_not_built_in_is_reported() -> None:
    assert "no such built-in rig" in one_sentence("rig", "mine")


def test_a_reader_that_stops_early_sees_no_traceback(log: Path) -> None:
    command = f'"{sys.executable}" -m winchcascade reduce "{log}" --json - | head -c 10'
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("wrapped", [True, False])
def test_what_trips_over_an_interrupt_is_an_interrupt(
    wrapped: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def trip(**_: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as fault:
            if wrapped:
                raise RuntimeError("made of one") from fault
            raise RuntimeError("release unlocked lock")  # noqa: B904

    monkeypatch.setattr("winchcascade.cli.app.command_line", lambda _: trip)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert capsys.readouterr().err.startswith("winchcascade: interrupted; ")


@pytest.mark.parametrize("others", [["b.csv"], ["b.csv", "c d.csv"]])
def test_several_logs_of_one_reduction_lead_to_a_batch_of_them(others: list[str]) -> None:
    assert f"winchcascade batch {shlex.join(['a.csv', *others])}" in one_sentence(
        "reduce", "a.csv", *others
    )


def test_the_help_lists_options_in_their_groups() -> None:
    lines = winchcascade("diagnose", "--help", COLUMNS="80").stdout.splitlines()
    groups = [
        line.rstrip(":")
        for line in lines
        if line and line[0] != " " and not line.startswith("Usage")
    ]
    assert groups == ["Arguments", "Input", "Evaluation", "Outputs", "Other"]
    assert max(map(len, lines)) <= 80


def test_options_are_read_before_long_work_and_nothing_is_written_through_a_link(
    tmp_path: Path, fixtures: Path
) -> None:
    for wrong in (
        "--loads nan",
        "--loads inf",
        "--speeds -1",
        "--current-limit nan",
        "--motion /dev/zero",
    ):
        assert call("design", fixtures / "campaign", *wrong.split(), patience=5).code == 2, wrong
    assert (
        call(
            *"plan hsu2026 --loads 9 --speeds 1 --length 1e9 --uncertainty eta_pto=0.01".split()
        ).code
        == 2
    )
    shutil.copyfile(fixtures / "campaign" / "r36ohm.csv", tmp_path / "r36ohm.csv")
    (tmp_path / "rig.toml").symlink_to(tmp_path / "elsewhere.toml")
    assert call("init", tmp_path, "--write").code == 0
    assert not (tmp_path / "elsewhere.toml").exists()
    (tmp_path / "campaign.toml").write_text(
        '[[run]]\nfile = "r36ohm.csv"\nload_ohm = 4,5\n', encoding="utf-8"
    )
    assert "4.5" in call("reduce", tmp_path / "r36ohm.csv").err
