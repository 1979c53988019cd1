"""The README shows what the commands print: each block is run, and its output must be the one shown.

`python tests/test_readme.py` writes the present output into the blocks.
"""

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
BLOCK = re.compile(r"```console\n\$ (winchcascade [^\n]*)\n(.*?)```", re.DOTALL)

SHELL = re.compile(r"```sh\n(.*?)```", re.DOTALL)


def output(command: str) -> str:
    """What a command of the README prints, refusals included, run where the README stands."""
    arguments = command.split()[1:]
    environment = os.environ | {"PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, "-m", "winchcascade", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=ROOT, env=environment, encoding="utf-8", check=False,
    )  # fmt: skip
    return done.stdout


BLOCKS = BLOCK.findall(README.read_text(encoding="utf-8"))


@pytest.mark.parametrize(("command", "shown"), BLOCKS, ids=[command for command, _ in BLOCKS])
def test_a_command_of_the_readme_prints_what_is_shown(command: str, shown: str) -> None:
    assert output(command) == shown


def test_a_command_of_the_readme_that_writes_files_works_as_typed(tmp_path: Path) -> None:
    lines = re.findall(
        r"^winchcascade [^\n]*$", "\n".join(SHELL.findall(README.read_text(encoding="utf-8"))), re.MULTILINE
    )
    shutil.copytree(ROOT / "fixtures", tmp_path / "fixtures")
    for line in lines:
        words = shlex.split(line, comments=True)[1:]
        subprocess.run([sys.executable, "-m", "winchcascade", *words], cwd=tmp_path, check=True, capture_output=True)
        written = [word for word in words if word.endswith((".html", ".pdf", ".json"))]
        assert written
        assert all((tmp_path / name).stat().st_size > 1000 for name in written)


def test_the_readme_shows_every_command() -> None:
    shown = {command.split()[1] for command, _ in BLOCKS}
    listed = subprocess.run(
        [sys.executable, "-m", "winchcascade", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert set(re.findall(r"^[│ ]+([a-z]+) {2,}", listed, re.MULTILINE)) == shown


def test_the_python_of_the_readme_gives_what_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    result = doctest.testfile(str(README), module_relative=False)
    assert result.attempted > 0
    assert result.failed == 0


def test_the_rig_file_of_the_readme_can_be_read() -> None:
    from winchcascade.rigtoml import parse_rig

    (text,) = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert parse_rig(text, "README").columns["force"].name == "LC-17"


if __name__ == "__main__":
    text = BLOCK.sub(lambda m: f"```console\n$ {m[1]}\n{output(m[1])}```", README.read_text(encoding="utf-8"))
    README.write_text(text, encoding="utf-8")
