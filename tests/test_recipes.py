"""The recipes of CONTRIBUTING.md are followed in a copy of the project, and print what the page shows.

`PYTHONPATH=tests python tests/test_recipes.py` writes the present output into the page.
"""

import os
import tempfile
from pathlib import Path

import pytest
from pages import follow, shown, write_outputs
from test_adding_an_effect import a_copy

PAGE = "../CONTRIBUTING.md"


@pytest.mark.slow
def test_the_recipes_work_as_they_are_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = a_copy(tmp_path / "checkout")
    monkeypatch.setenv("PYTHONPATH", str(place))
    assert follow(PAGE, place) == shown(PAGE)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        copy = a_copy(Path(folder) / "checkout")
        os.environ["PYTHONPATH"] = str(copy)
        write_outputs(PAGE, follow(PAGE, copy))
