"""The pictures of the README are those of the present results: the data behind them are compared, never pixels.

`python docs/pictures.py` draws them again.
"""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType

import pytest

DOCS = Path(__file__).parent.parent / "docs"
MAX_SIZE = 600_000
"""Size of all pictures together. [bytes]"""

SLOW = {"waterfall.svg"}
"""Pictures of a diagnosis."""


def drawer() -> ModuleType:
    about = importlib.util.spec_from_file_location("pictures", DOCS / "pictures.py")
    assert about is not None
    assert about.loader is not None
    module = importlib.util.module_from_spec(about)
    about.loader.exec_module(module)
    return module


PICTURES = drawer()
STORED = json.loads(PICTURES.SOURCES.read_text(encoding="utf-8"))


def is_current(name: str) -> None:
    source, drawing = PICTURES.DRAWN[name]
    assert json.loads(json.dumps(source())) == STORED[name], f"python docs/pictures.py {name}"
    if name in ("cascade.svg", "terminal.svg"):
        assert (PICTURES.PICTURES / name).read_text(encoding="utf-8") == drawing(STORED[name]), (
            f"python docs/pictures.py {name}"
        )


@pytest.mark.parametrize("name", sorted(set(PICTURES.DRAWN) - SLOW))
def test_a_picture_shows_the_present_data(name: str) -> None:
    is_current(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SLOW))
def test_a_picture_of_a_diagnosis_shows_the_present_data(name: str) -> None:
    is_current(name)


def test_the_readme_shows_every_picture_and_they_are_small() -> None:
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"!\[[^\]]+\]\(docs/pictures/([\w.]+)\)", text))
    there = {path.name for path in PICTURES.PICTURES.iterdir()} - {"sources.json"}
    assert shown == there == set(PICTURES.DRAWN) == set(STORED)
    assert sum(path.stat().st_size for path in PICTURES.PICTURES.iterdir()) <= MAX_SIZE


def test_drawings_need_no_other_file() -> None:
    for path in PICTURES.PICTURES.glob("*.svg"):
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")
        assert "http" not in text
        assert text.startswith("<svg ")
