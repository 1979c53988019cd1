import os
from pathlib import Path

import pytest

from winchcascade.errors import OutputError
from winchcascade.files import write_whole


def write_new(part: Path) -> None:
    part.write_text("new")


def test_a_file_of_somebody_else_is_not_replaced(tmp_path: Path) -> None:
    path = tmp_path / "thesis.json"
    path.write_text("mine")
    with pytest.raises(OutputError, match="was not written by winchcascade; choose another name or add --force"):
        write_whole(path, write_new)
    assert path.read_text() == "mine"


def test_force_replaces_any_file(tmp_path: Path) -> None:
    path = tmp_path / "thesis.json"
    path.write_text("mine")
    write_whole(path, write_new, force=True)
    assert path.read_text() == "new"


def test_ones_own_file_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "reduction.json"
    path.write_text('{"schema": "winchcascade/reduction/1"}')
    write_whole(path, write_new)
    assert path.read_text() == "new"


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "reduction.json"
    path.write_text('{"schema": "winchcascade/reduction/1"}')

    def half(part: Path) -> None:
        part.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="No space left on device"):
        write_whole(path, half)
    assert "reduction/1" in path.read_text()
    assert os.listdir(tmp_path) == ["reduction.json"]


@pytest.mark.parametrize(("name", "says"), [("", "is a folder"), ("no/such/file.json", "does not exist")])
def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(OutputError, match=says):
        write_whole(tmp_path / name, lambda part: part.touch())
