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


def output(command: str, place: Path) -> str:
    """What a command of the README prints, refusals included, run in a folder that holds the fixtures."""
    arguments = shlex.split(command)[1:]
    environment = os.environ | {"PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, "-m", "winchcascade", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=place, env=environment, encoding="utf-8", check=False,
    )  # fmt: skip
    return done.stdout


BLOCKS = BLOCK.findall(README.read_text(encoding="utf-8"))


def follow(place: Path) -> dict[str, str]:
    """Follow the README in an empty folder, command after command; what each printed."""
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    return {command: output(command, place) for command, _ in BLOCKS}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("a reader")


@pytest.fixture(scope="module")
def printed(place: Path) -> dict[str, str]:
    return follow(place)


@pytest.mark.parametrize(("command", "shown"), BLOCKS, ids=[command for command, _ in BLOCKS])
def test_a_command_of_the_readme_prints_what_is_shown(printed: dict[str, str], command: str, shown: str) -> None:
    assert printed[command] == shown


def test_a_command_of_the_readme_that_writes_files_works_as_typed(place: Path, printed: dict[str, str]) -> None:
    lines = re.findall(
        r"^winchcascade [^\n]*$", "\n".join(SHELL.findall(README.read_text(encoding="utf-8"))), re.MULTILINE
    )
    for line in lines:
        words = shlex.split(line, comments=True)[1:]
        subprocess.run([sys.executable, "-m", "winchcascade", *words], cwd=place, check=True, capture_output=True)
        written = [word for word in words if word.endswith((".html", ".pdf", ".json", ".xml"))]
        assert written
        assert all((place / name).stat().st_size > 1000 for name in written)


def test_the_readme_shows_every_command() -> None:
    shown = {command.split()[1] for command, _ in BLOCKS}
    listed = subprocess.run(
        [sys.executable, "-m", "winchcascade", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert set(re.findall(r"^[│ ]+([a-z]+) {2,}", listed, re.MULTILINE)) == shown


def test_the_python_of_the_readme_gives_what_is_shown(
    place: Path, printed: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    result = doctest.testfile(str(README), module_relative=False)
    assert result.attempted > 0
    assert result.failed == 0


def test_the_rig_file_of_the_readme_can_be_read() -> None:
    from winchcascade.rigtoml import parse_rig

    (text,) = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert parse_rig(text, "README").columns["force"].name == "LC-17"


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        outputs = follow(Path(folder))
    text = BLOCK.sub(lambda m: f"```console\n$ {m[1]}\n{outputs[m[1]]}```", README.read_text(encoding="utf-8"))
    README.write_text(text, encoding="utf-8")
