"""The README and the page of commands show what is printed: each block is run, and its output must be the one shown.

`python tests/test_readme.py` writes the present output into the blocks.
"""

import doctest
import re
import shlex
import shutil
from collections.abc import Iterable
from pathlib import Path

import pytest
from calls import call

ROOT = Path(__file__).parent.parent
LONGEST = 1200
"""A command that has not ended after this never will. [s]"""

PAGES = {"README": ROOT / "README.md", "commands": ROOT / "docs" / "commands.md"}
BLOCK = re.compile(r"```(console|sh)\n(?:\$ )?(winchcascade [^\n]*)\n(.*?)```", re.DOTALL)
"""A block of one command: what a `console` prints is shown, what an `sh` prints is not."""


def blocks_of(path: Path) -> list[tuple[str, str, str]]:
    return BLOCK.findall(path.read_text(encoding="utf-8"))


def blocks(page: str) -> list[tuple[str, str, str]]:
    return blocks_of(PAGES[page])


LONG = re.compile(r"winchcascade (diagnose|blind deal) |--reports all")
"""Commands that take more than ten seconds of a processor: they are run with the slow tests."""

WITHOUT_REPORTS = {"winchcascade batch fixtures/campaign --out results": " --reports none"}
"""Options for a call whose results a later command needs, but not its reports, which a long command writes."""

DEMO = ROOT / "tests" / "reference" / "outputs" / "demo" / "demo.txt"
"""What `demo` prints, which a slow test compares with what is stored."""


def output(command: str, place: Path) -> str:
    """What a command prints, rejections included, called in a folder that holds the fixtures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.delenv("COLUMNS", raising=False)
        called = call(*shlex.split(command + WITHOUT_REPORTS.get(command, ""))[1:], patience=LONGEST)
    return called.err + called.out


def follow(commands: Iterable[str], place: Path) -> dict[str, str]:
    """Follow a page in a folder that holds the fixtures, command after command; what each printed."""
    return {command: output(command, place) for command in commands}


def commands(page: str, *, long: bool) -> list[str]:
    """Commands of a page but `demo`: those that take long, or the others."""
    given = [command for _, command, _ in blocks(page) if not command.startswith("winchcascade demo")]
    return [command for command in given if bool(LONG.search(command)) == long]


def named_files(printed: Iterable[str]) -> list[str]:
    """Files that commands write by their options."""
    words = [word for line in printed for word in shlex.split(line) if word.endswith((".html", ".pdf"))]
    return words + [file for line in printed for file in re.findall(r"--(?:json|write|out) ([\w.-]+)", line)]


@pytest.fixture(scope="module", params=PAGES)
def page(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def place(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("a reader")
    shutil.copytree(ROOT / "fixtures", folder / "fixtures")
    return folder


@pytest.fixture(scope="module")
def printed(page: str, place: Path) -> dict[str, str]:
    return follow(commands(page, long=False), place)


@pytest.fixture(scope="module")
def printed_long(page: str, place: Path) -> dict[str, str]:
    return follow(commands(page, long=True), place)


def is_shown(page: str, printed: dict[str, str]) -> None:
    """What commands printed is what the page shows of them."""
    shown = {command: text for kind, command, text in blocks(page) if kind == "console" and command in printed}
    assert shown
    assert {command: printed[command] for command in shown} == shown


def are_written(place: Path, printed: dict[str, str]) -> None:
    """The files that commands name are there."""
    named = named_files(printed)
    assert named
    for name in named:
        assert (place / name).is_dir() or (place / name).stat().st_size > 1000


def test_every_command_prints_what_is_shown(page: str, place: Path, printed: dict[str, str]) -> None:
    is_shown(page, printed)
    are_written(place, printed)


@pytest.mark.slow
def test_every_long_command_prints_what_is_shown(page: str, place: Path, printed_long: dict[str, str]) -> None:
    is_shown(page, printed_long)
    are_written(place, printed_long)


def test_the_demo_prints_what_is_shown() -> None:
    ((_, command, shown),) = (block for block in blocks("commands") if block[1].startswith("winchcascade demo"))
    assert command == "winchcascade demo --out trial"
    stored = DEMO.read_text(encoding="utf-8")
    assert stored == f"$ winchcascade demo --out demo --jobs 1\n{shown.replace('trial/', 'demo/')}"


def test_the_pages_show_every_command() -> None:
    own_page = ROOT / "docs" / "compare.md"
    shown = {command.split()[1] for path in (*PAGES.values(), own_page) for _, command, _ in blocks_of(path)}
    listed = output("winchcascade --help", ROOT)
    assert set(re.findall(r"^[│ ]+([a-z]+) {2,}", listed, re.MULTILINE)) == shown


def test_the_python_of_a_page_gives_what_is_shown(
    page: str, place: Path, printed: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    result = doctest.testfile(str(PAGES[page]), module_relative=False)
    assert result.attempted > 0
    assert result.failed == 0


def test_the_rig_file_of_the_readme_states_the_drum_radius() -> None:
    from winchcascade.core.rig_toml import parse_rig

    text = PAGES["README"].read_text(encoding="utf-8")
    (rig,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    assert parse_rig(rig, "README.md").r_drum == 0.25
    own = text.split("## Your own log and rig\n")[1]
    assert "drum radius" in own[:100]


def test_the_readme_lists_every_command_and_names_three_readers() -> None:
    text = PAGES["README"].read_text(encoding="utf-8")
    table = text.split("## All commands\n")[1].split("\n## ")[0]
    listed = set(re.findall(r"^  ([a-z]+) {2,}", output("winchcascade --help", ROOT), re.MULTILINE))
    assert listed
    assert all(re.search(rf"`{name}[ `]", table) for name in listed)
    assert all(reader in text for reader in ("test engineer", "designer of a PTO", "reviewer of a paper"))


def test_the_rig_file_of_the_page_of_commands_can_be_read() -> None:
    from winchcascade.core.rig_toml import parse_rig

    (text,) = re.findall(r"```toml\n(.*?)```", PAGES["commands"].read_text(encoding="utf-8"), re.DOTALL)
    assert parse_rig(text, "commands.md").columns["force"].name == "LC-17"


if __name__ == "__main__":
    import tempfile

    for name, path in PAGES.items():
        with tempfile.TemporaryDirectory() as folder:
            shutil.copytree(ROOT / "fixtures", Path(folder, "fixtures"))
            found = follow([command for _, command, _ in blocks(name)], Path(folder))
        text = path.read_text(encoding="utf-8")
        for kind, command, shown in blocks(name):
            if kind == "console":
                text = text.replace(f"$ {command}\n{shown}", f"$ {command}\n{found[command]}")
        path.write_text(text, encoding="utf-8")
