"""The pictures of the documents are those of the present results: the data behind them are
compared, never pixels.

`python docs/pictures.py` draws them again.
"""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import pytest
from pages import DOCS, ROOT, read, run, steps, with_fixtures

MAX_SIZE = 1_500_000
"""Size of all pictures together. [bytes]"""


def drawer() -> ModuleType:
    about = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    assert about is not None
    assert about.loader is not None
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    return module


PICTURES = drawer()
STORED = json.loads(read(PICTURES.SOURCES))
THERE = {path.name for path in PICTURES.PICTURES.iterdir()} - {"sources.json"}


def picture(name: str) -> object:
    return pytest.param(name, marks=[pytest.mark.slow] if name in PICTURES.WRITTEN else [])


@pytest.mark.parametrize("name", [picture(name) for name in sorted(THERE)])
def test_a_picture_shows_the_present_data(name: str) -> None:
    assert json.loads(json.dumps(PICTURES.data_of(name))) == STORED[name], (
        f"python docs/pictures.py {name}"
    )
    if name in PICTURES.DRAWN:
        drawn = PICTURES.picture_of(name, STORED[name])
        assert read(PICTURES.PICTURES / name) == drawn, f"python docs/pictures.py {name}"


def test_every_picture_is_shown_in_the_gallery_with_its_command_and_all_are_small() -> None:
    gallery = DOCS / "gallery.md"
    assert set(re.findall(r"!\[[^\]]+\]\(pictures/([\w.]+)\)", read(gallery))) == THERE - {
        "cascade.svg"
    }
    assert THERE == {*PICTURES.DRAWN, *PICTURES.WRITTEN} == set(STORED)
    shown = {
        line
        for step in steps(gallery)
        if step.kind in ("sh", "bash")
        for line in step.text.splitlines()
    }
    assert {re.sub(r" --json \S+", "", one.command) for one in PICTURES.WRITTEN.values()} == shown
    assert sum(path.stat().st_size for path in PICTURES.PICTURES.iterdir()) <= MAX_SIZE


def test_the_gallery_prints_what_it_shows(tmp_path: Path) -> None:
    """Its other commands are those that make the pictures."""
    place = with_fixtures(tmp_path)
    printed = [step for step in steps(DOCS / "gallery.md") if step.kind == "console"]
    assert [run(step.command, place).stdout for step in printed] == [step.shown for step in printed]


def test_drawings_need_no_other_file() -> None:
    for path in PICTURES.PICTURES.glob("*.svg"):
        text = re.sub(r"http://(www\.w3|purl|creativecommons)\.org/", "", read(path))
        assert "http" not in text
        assert text.startswith("<svg ")


def test_the_readme_shows_the_cascade() -> None:
    assert "](docs/pictures/cascade.svg)" in read(ROOT / "README.md")
