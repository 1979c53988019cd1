"""The README and the page of commands show what is printed: each block is run, and its output must be the one shown.

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
PAGES = {"README": ROOT / "README.md", "commands": ROOT / "docs" / "commands.md"}
BLOCK = re.compile(r"```(console|sh)\n(?:\$ )?(winchcascade [^\n]*)\n(.*?)```", re.DOTALL)
"""A block of one command: what a `console` prints is shown, what an `sh` prints is not."""


def blocks(page: str) -> list[tuple[str, str, str]]:
    return BLOCK.findall(PAGES[page].read_text(encoding="utf-8"))


def output(command: str, place: Path) -> str:
    """What a command prints, refusals included, run in a folder that holds the fixtures."""
    environment = os.environ | {"PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, "-m", "winchcascade", *shlex.split(command)[1:]],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=place, env=environment, encoding="utf-8", check=False,
    )  # fmt: skip
    return done.stdout


def follow(page: str, place: Path) -> dict[str, str]:
    """Follow a page in an empty folder, command after command; what each printed."""
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    return {command: output(command, place) for _, command, _ in blocks(page)}


@pytest.fixture(scope="module", params=PAGES)
def page(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def place(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("a reader")


@pytest.fixture(scope="module")
def printed(page: str, place: Path) -> dict[str, str]:
    return follow(page, place)


def test_every_command_prints_what_is_shown(page: str, printed: dict[str, str]) -> None:
    shown = {command: text for kind, command, text in blocks(page) if kind == "console"}
    assert len(shown) >= 3
    assert {command: printed[command] for command in shown} == shown


def test_a_command_writes_the_files_that_it_names(page: str, place: Path, printed: dict[str, str]) -> None:
    named = [word for line in printed for word in shlex.split(line) if word.endswith((".html", ".pdf"))]
    named += [file for line in printed for file in re.findall(r"--(?:json|write|out) ([\w.]+)", line)]
    assert len(named) >= 3
    for name in named:
        assert (place / name).is_dir() or (place / name).stat().st_size > 1000


def test_the_pages_show_every_command() -> None:
    shown = {command.split()[1] for page in PAGES for _, command, _ in blocks(page)}
    listed = subprocess.run(
        [sys.executable, "-m", "winchcascade", "--help"], capture_output=True, text=True, check=True
    ).stdout
    assert set(re.findall(r"^[│ ]+([a-z]+) {2,}", listed, re.MULTILINE)) == shown


def test_the_python_of_a_page_gives_what_is_shown(
    page: str, place: Path, printed: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    result = doctest.testfile(str(PAGES[page]), module_relative=False)
    assert result.attempted > 0
    assert result.failed == 0


def test_the_rig_file_of_the_page_of_commands_can_be_read() -> None:
    from winchcascade.core.rig_toml import parse_rig

    (text,) = re.findall(r"```toml\n(.*?)```", PAGES["commands"].read_text(encoding="utf-8"), re.DOTALL)
    assert parse_rig(text, "commands.md").columns["force"].name == "LC-17"


if __name__ == "__main__":
    import tempfile

    for name, path in PAGES.items():
        with tempfile.TemporaryDirectory() as folder:
            found = follow(name, Path(folder))
        text = path.read_text(encoding="utf-8")
        for kind, command, shown in blocks(name):
            if kind == "console":
                text = text.replace(f"$ {command}\n{shown}", f"$ {command}\n{found[command]}")
        path.write_text(text, encoding="utf-8")
