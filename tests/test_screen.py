"""What commands print in a terminal: its width, its colours, --quiet and the list of files, by a
terminal of the system.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from calls import call
from daily import daily
from undrawn import undrawn

if sys.platform == "win32":
    pytest.skip("terminals of this kind are those of other systems", allow_module_level=True)

import fcntl
import pty
import struct
import termios

COLOUR = re.compile(r"\x1b\[[\d;]*m")
TABLE = "hsu2026-table2"
LOG = "fixtures/campaign/r36ohm.csv"

COMMANDS = {
    "reduce": ("reduce", LOG),
    "reduce with findings": ("reduce", "fixtures/damaged_logs/dropouts.csv", "--load-ohm", "36"),
    "batch": ("batch", "fixtures/damaged_logs", "--out", "out", "--reports", "none", "--jobs", "1"),
    "check": (
        "check",
        "fixtures/campaign",
        "--against",
        TABLE,
        "--tolerance",
        "deviation=0",
        "--jobs",
        "1",
    ),
    "compare": ("compare", LOG, "fixtures/campaign", "--max-drop", "0", "--jobs", "1"),
    "audit": ("audit", TABLE),
    "simulate": ("simulate", LOG, "--out", "s.csv"),
    "effects": ("effects",),
    "help": ("reduce", "--help"),
    "commands": ("--help",),
    "error": ("reduce", "fixtures"),
}
"""Commands whose output fits into a terminal."""


def shown(*words: str, columns: int, **environment: str) -> str:
    """What a command shows in a terminal of some columns, on both streams."""
    ours, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack("HHHH", 40, columns, 0, 0))
    present = {
        name: text for name, text in os.environ.items() if name not in ("COLUMNS", "NO_COLOR")
    }
    process = subprocess.Popen(
        [sys.executable, "-m", "winchcascade", *words],
        stdin=its, stdout=its, stderr=its, env=present | {"TERM": "xterm-256color"} | environment,
    )  # fmt: skip
    os.close(its)
    parts = []
    while True:
        try:
            part = os.read(ours, 65536)
        except OSError:  # the other side is closed
            break
        if not part:
            break
        parts.append(part)
    process.wait()
    os.close(ours)
    return b"".join(parts).decode().replace("\r\n", "\n")


@pytest.fixture
def place(tmp_path: Path, fixtures: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "fixtures").symlink_to(fixtures)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    return tmp_path


@pytest.mark.parametrize("name", daily(["reduce", "check", "error", "help"], ["reduce", "help"]))
def test_a_terminal_of_sixty_columns_is_never_exceeded(place: Path, name: str) -> None:
    text = COLOUR.sub("", shown(*COMMANDS[name], columns=60))
    assert max(map(len, text.splitlines())) <= 60


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("width", daily((60, 80, 120), (60,)))
def test_lines_follow_the_width_that_is_stated(place: Path, name: str, width: int) -> None:
    done = _with_columns(width, *COMMANDS[name])
    assert max(len(line) for line in done.splitlines()) <= width


def _with_columns(width: int, *words: str) -> str:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", str(width))
        patch.setenv("NO_COLOR", "1")
        called = call(*words, terminal=words[:2] == COMMANDS["error"])
    return called.out + called.err


def test_a_terminal_shows_colours_and_the_same_text_without_them(place: Path) -> None:
    words = COMMANDS["reduce with findings"]
    coloured = shown(*words, columns=100)
    plain = shown(*words, columns=100, NO_COLOR="1")
    assert COLOUR.search(coloured)
    assert not COLOUR.search(plain)
    assert [line.rstrip() for line in COLOUR.sub("", coloured).splitlines()] == plain.splitlines()
    assert set(COLOUR.findall(coloured)) <= {
        "\x1b[1m",
        "\x1b[2m",
        "\x1b[32m",
        "\x1b[33m",
        "\x1b[0m",
    }


def test_a_name_from_a_file_cannot_colour_the_terminal(place: Path) -> None:
    log = place / "\ufdd2evil\x1b[31m.csv"
    log.write_bytes(Path(LOG).read_bytes())
    text = shown("reduce", str(log), "--load-ohm", "36", columns=100)
    assert "\x1b[31m" not in text


QUIET = {
    "reduce": (COMMANDS["reduce"], 0, ""),
    "batch": (COMMANDS["batch"], 1, "header_only.csv"),
    "check": (COMMANDS["check"], None, ""),
    "compare": (COMMANDS["compare"], 0, ""),
    "audit": (COMMANDS["audit"], 1, "36 ohm"),
    "simulate": (COMMANDS["simulate"], 0, ""),
    "effects": (("effects",), 0, ""),
    "rig": (("rig",), 0, ""),
    "calibrate": (("calibrate", "fixtures/campaign/open_circuit.csv"), 0, ""),
}


@pytest.mark.parametrize("name", daily(QUIET, ("reduce", "audit", "rig")))
def test_quiet_prints_only_what_fails_with_the_same_exit_code(place: Path, name: str) -> None:
    words, code, part = QUIET[name]
    loud, quiet = call(*words), call(*words, "--quiet")
    assert loud.code == quiet.code
    assert code is None or quiet.code == code
    assert part in quiet.out
    assert bool(quiet.out) == bool(quiet.code)
    assert quiet.err == ""
    assert len(quiet.out) < len(loud.out)


def test_quiet_keeps_json_on_standard_output_and_the_error_of_a_wrong_input(place: Path) -> None:
    assert (
        json.loads(call("reduce", LOG, "--json", "-", "--quiet").out)["schema"]
        == "winchcascade/reduction/1"
    )
    wrong = call("reduce", "nowhere.csv", "--quiet")
    assert (wrong.code, wrong.out) == (2, "")
    assert wrong.err.startswith("winchcascade: nowhere.csv")


@pytest.mark.parametrize(
    "words",
    [
        ("reduce", LOG, "--json", "r.json", "--html", "r.html", "--parquet", "tables"),
        (
            "check",
            "fixtures/campaign",
            "--against",
            TABLE,
            "--json",
            "r.json",
            "--junit",
            "r.xml",
            "--jobs",
            "1",
        ),
        ("audit", TABLE, "--json", "r.json"),
        ("simulate", LOG, "--out", "r.csv"),
        (
            "calibrate",
            "fixtures/campaign/open_circuit.csv",
            "--json",
            "r.json",
            "--write",
            "rig.toml",
        ),
        ("batch", "fixtures/campaign", "--out", "out", "--reports", "none", "--jobs", "1"),
    ],
    ids=lambda words: words[0],
)
def test_a_command_lists_the_files_that_it_wrote(place: Path, words: tuple[str, ...]) -> None:
    with undrawn():
        out = call(*words).out
    wanted = [
        word for word in words if word.startswith("r.") or word in ("tables", "rig.toml")
    ] or ["out/campaign.json"]
    assert all(re.search(rf"(?m)(^|\s){re.escape(name)}( |$)", out) for name in wanted)
    assert all((place / name).exists() for name in wanted)


def test_every_option_has_a_sentence_for_its_help(place: Path) -> None:
    from winchcascade.cli.app import command_line

    whole = command_line(None)
    commands = [("", whole)]
    while commands:
        name, command = commands.pop()
        commands += [
            (f"{name} {below}".strip(), one)
            for below, one in getattr(command, "commands", {}).items()
        ]
        for parameter in command.params:
            text = getattr(parameter, "help", None)
            assert text, f"{name}: {parameter.name}"
            assert text[0].isupper(), f"{name}: {text}"
            assert text.endswith("."), f"{name}: {text}"
        printed = call(*name.split(), "--help").out
        assert "..." not in re.sub(r"(TARGET|s3://|\[ARGS\]|,)\.\.\.", "", printed)
        if not hasattr(command, "commands"):
            assert "--quiet" in printed
    assert "[ohm, or inf]" in " ".join(call("diagnose", "--help").out.split())
