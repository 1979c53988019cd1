"""The action that checks logs in a repository: its inputs, and what it does with them."""

import os
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from calls import call
from pages import DOCS, ROOT, read, steps, with_fixtures

PAGE = DOCS / "ci.md"
ACTION = (ROOT / "action.yml").read_text(encoding="utf-8")
CHECK = {"CAMPAIGN": "fixtures/campaign", "TABLE": "hsu2026-table2"}
LOGS = {"LOGS": "fixtures/campaign/r9*.csv\nfixtures/damaged_logs/dropouts.csv\n"}


def test_the_inputs_are_those_of_the_action() -> None:
    inputs = re.findall(
        r"^  (\w+):\n    description: [^\n]*\n    default: (\S*)$", ACTION, re.MULTILINE
    )
    page = read(PAGE)
    rows = re.findall(r"^\| `(\w+)` \| (?:`([^`]*)` )?\| ", page, re.MULTILINE)
    assert rows == [(name, default.strip('"')) for name, default in inputs]
    used = {
        key
        for step in steps(PAGE)
        if step.kind == "yaml"
        for key in re.findall(r"^ {10}(\w+):", step.text, re.M)
    }
    assert used - {"submodules"} <= {name for name, _ in inputs}


def act(place: Path, **inputs: str) -> subprocess.CompletedProcess[str]:
    """Run the action's last step as GitHub runs it."""
    script = textwrap.dedent(ACTION[ACTION.rindex("run: |\n") + len("run: |\n") :])
    given = (
        dict.fromkeys(("CAMPAIGN", "TABLE", "LOGS", "ARGUMENTS"), "")
        | {"RESULTS": "found here"}
        | inputs
    )
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        capture_output=True, cwd=place, encoding="utf-8", env=os.environ | {"PATH": path} | given, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("inputs", "code", "written"),
    [
        pytest.param(CHECK, 0, ["check.xml"], id="check", marks=pytest.mark.slow),
        pytest.param(
            CHECK | {"ARGUMENTS": "--tolerance deviation=0 --tolerance uncertainty=0"},
            1,
            ["check.xml"],
            id="a miss",
        ),
        pytest.param(LOGS, 0, ["batch/campaign.json"], id="logs", marks=pytest.mark.slow),
        pytest.param(
            LOGS | {"ARGUMENTS": "--window 5.48"},
            0,
            ["batch/campaign.json"],
            id="logs with a window",
            marks=pytest.mark.slow,
        ),
        pytest.param(CHECK | LOGS, 0, ["check.xml", "batch/campaign.json"], id="both"),
        pytest.param(
            CHECK | LOGS | {"ARGUMENTS": "--window 5.48"},
            2,
            [],
            id="both with a window",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            {"LOGS": "fixtures/damaged_logs/*.csv"},
            1,
            ["batch/campaign.json"],
            id="a failed log",
            marks=pytest.mark.slow,
        ),
        pytest.param({"CAMPAIGN": "fixtures/campaign"}, 2, [], id="no table"),
        pytest.param({}, 2, [], id="nothing"),
    ],
)
def test_the_action_does_what_the_page_says(
    tmp_path: Path, inputs: dict[str, str], code: int, written: list[str]
) -> None:
    done = act(with_fixtures(tmp_path), **inputs)
    assert done.returncode == code, done.stderr
    assert all((tmp_path / "found here" / name).is_file() for name in written)
    assert ("::error" in done.stdout) == (code != 0 and "LOGS" not in inputs)


def test_the_exit_codes_are_those_of_the_help() -> None:
    for command in (["check"], ["audit"], ["batch"], ["blind", "deal"], ["blind", "diagnose"]):
        assert "The exit code is 1 if" in " ".join(call(*command, "--help").out.split()), command
