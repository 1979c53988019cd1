import os
import subprocess
import sys
from pathlib import Path

import pytest

from winchcascade.errors import OutputError
from winchcascade.files import end_between_files, write_whole


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


def test_a_process_that_is_told_to_end_while_it_writes_ends_with_the_file_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("winchcascade.files._end_wanted", False)  # and after the test as before

    def told(part: Path) -> None:
        part.write_text("half")
        end_between_files()
        end_between_files()
        part.write_text("whole")

    with pytest.raises(SystemExit):
        write_whole(tmp_path / "a.json", told)
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "whole"


def test_a_process_that_writes_nothing_ends_at_once_even_within_a_weak_references_callback() -> None:
    script = (
        "import weakref; from winchcascade.files import end_between_files\n"
        "class Thing: pass\n"
        "thing = Thing(); seen = weakref.ref(thing, lambda _: end_between_files()); del thing; print('still here')"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (1, "", "")
