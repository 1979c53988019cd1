"""The worked example: its commands print what it shows, and every number of its text is one that a command printed.

`python tests/test_worked_example.py` writes the present output into it.
"""

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

import pytest
from pages import CONSOLE, ROOT
from test_readme import blocks, output

PAGE = ROOT / "docs" / "worked_example.md"
BLOCKS = CONSOLE.findall(PAGE.read_text(encoding="utf-8"))

OUTSIDE = {"5.1", "5.16", "7", "11", "5", "8", "2", "9"}
"""Numbers that the text brings along: of the paper, and of the roll-off that it tries."""


DIAGNOSE, PHYSICS = "winchcascade diagnose fixtures/campaign", "winchcascade audit hsu2026-table2 --physics"
"""Long commands that other slow tests call: their output is compared with what those hold it against."""


def follow(place: Path, commands: Iterable[str]) -> dict[str, str]:
    """Follow the page in a folder that holds the fixtures; what each command printed."""
    shutil.copytree(ROOT / "fixtures", place / "fixtures")
    return {command: output(command, place) for command in commands}


@pytest.mark.slow
def test_the_commands_print_what_is_shown(tmp_path: Path) -> None:
    assert len(BLOCKS) == 8
    shown = {command: text for command, text in BLOCKS if command not in (DIAGNOSE, PHYSICS)}
    assert len(shown) == 6
    assert follow(tmp_path / "a reader", shown) == shown


def test_the_whole_diagnosis_is_that_of_the_page_of_commands_without_its_files() -> None:
    ((_, _, shown),) = (block for block in blocks("commands") if block[1].startswith(f"{DIAGNOSE} --html "))
    text, _, files = shown.partition("\nfiles ")
    assert files
    assert dict(BLOCKS)[DIAGNOSE] == f"{text}\n"


def test_the_audit_with_physics_is_the_stored_one() -> None:
    stored = (ROOT / "tests" / "reference" / "outputs" / "physics" / "physics.txt").read_text(encoding="utf-8")
    shown = re.sub(r"\nfiles:? +physics.json\n", "\n", stored, count=1)
    assert shown == f"$ {PHYSICS} --json physics.json\n{dict(BLOCKS)[PHYSICS]}"


def test_every_number_of_the_text_was_printed() -> None:
    page = PAGE.read_text(encoding="utf-8")
    printed = "\n".join(shown for _, shown in BLOCKS)
    text = re.sub(r"```.*?```|\]\([^)]*\)|^#.*?$|`[^`]*`", " ", page, flags=re.DOTALL | re.MULTILINE)
    numbers = re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?![\w])", text.replace("2026", ""))
    assert len(numbers) > 10
    for number in numbers:
        assert number in OUTSIDE or re.search(rf"(?<![\d.]){re.escape(number)}(?!\d)", printed), number


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        outputs = follow(Path(folder) / "reader", dict(BLOCKS))
    text = CONSOLE.sub(lambda m: f"```console\n$ {m[1]}\n{outputs[m[1]]}```", PAGE.read_text(encoding="utf-8"))
    PAGE.write_text(text, encoding="utf-8")
