"""The pictures of the documents are those of the present results: the data behind them are
compared, never pixels.

`python docs/pictures.py` draws them again.
"""

import importlib
import json
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest
from pages import DOCS, ROOT, read, run, steps, with_fixtures

MAX_SIZE = 1_500_000
"""Size of all pictures together. [bytes]"""


def drawer() -> ModuleType:
    sys.path.insert(0, str(DOCS))
    try:
        return importlib.import_module("pictures")
    finally:
        sys.path.remove(str(DOCS))


PICTURES = drawer()
STORED = json.loads(read(PICTURES.SOURCES))
THERE = {path.name for path in PICTURES.PICTURES.iterdir()} - {"sources.json"}


def picture(name: str) -> object:
    return pytest.param(name, marks=[] if name in PICTURES.DRAWN else [pytest.mark.slow])


@pytest.mark.parametrize("name", [picture(name) for name in sorted(THERE)])
def test_a_picture_shows_the_present_data(name: str) -> None:
    assert json.loads(json.dumps(PICTURES.data_of(name))) == STORED[name], (
        f"python docs/pictures.py {name}"
    )
    if name in PICTURES.DRAWN:
        drawn = PICTURES.picture_of(name, STORED[name])
        assert read(PICTURES.PICTURES / name) == drawn, f"python docs/pictures.py {name}"


def test_every_picture_is_shown_on_a_page_and_all_are_small() -> None:
    pages = [*DOCS.glob("*.md"), ROOT / "README.md"]
    pictures = re.compile(r"!\[[^\]]+\]\((?:docs/)?pictures/([\w.]+)\)")
    assert {name for page in pages for name in pictures.findall(read(page))} == THERE
    assert THERE == set(PICTURES.NAMES) == set(STORED)
    assert sum(path.stat().st_size for path in PICTURES.PICTURES.iterdir()) <= MAX_SIZE


def test_the_gallery_has_the_command_of_each_picture_that_one_command_writes() -> None:
    given = {
        line
        for step in steps(DOCS / "gallery.md")
        if step.kind in ("sh", "bash")
        for line in step.text.splitlines()
    }
    assert {re.sub(r" --json \S+", "", one.command) for one in PICTURES.WRITTEN.values()} == given


def test_the_tutorial_shows_what_it_writes() -> None:
    tutorial = read(PICTURES.TUTORIAL)
    assert all(f"](pictures/{name})" in tutorial for name in PICTURES.FOLLOWED)


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


def test_the_readme_begins_with_a_result_and_shows_the_cascade() -> None:
    readme = read(ROOT / "README.md")
    assert readme.index("](docs/pictures/diagnosis.png)") < readme.index("make demo")
    assert "](docs/pictures/cascade.svg)" in readme
