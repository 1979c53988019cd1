import errno
import os
import zipfile
from pathlib import Path

import pytest

from winchcascade.core.errors import OutputError
from winchcascade.core.files import is_marked, write_set, write_whole


def write_new(part: Path) -> None:
    part.write_text("new")


def test_a_file_of_somebody_else_is_replaced_by_force_alone(tmp_path: Path) -> None:
    path = tmp_path / "thesis.json"
    path.write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        write_whole(path, write_new)
    assert path.read_text() == "mine"
    write_whole(path, write_new, force=True)
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
    write_whole(path, write_new)
    assert path.read_text() == "new"


@pytest.mark.parametrize(
    ("name", "says"), [("", "is a folder"), ("no/such/file.json", "does not exist")]
)
def test_a_place_that_cannot_be_written_is_reported(tmp_path: Path, name: str, says: str) -> None:
    with pytest.raises(OutputError, match=says):
        write_whole(tmp_path / name, lambda part: part.touch())


MARK = "winchcascade/0.1.0"
MENTIONS = {
    "notes.md": f"The tables were made by {MARK}; schema winchcascade/reduction/1.\n",
    "plot.py": '# reads "schema": "winchcascade/reduction/1"\nimport json\n',
    "notes.json": f'{{"notes": "made by {MARK}", "of": {{"schema": "winchcascade/reduction/1"}}}}',
    "list.json": f'[{{"schema": "winchcascade/reduction/1"}}, "{MARK}"]',
    "other.json": f'{{"schema": "other/1", "made_by": "{MARK}"}}',
    "page.html": f'<!doctype html>\n<html lang="en">\n<body>made by <meta name="generator" '
    f'content="{MARK}"></body>',
    "table.csv": "Time (s),Force (N)\n0.0,1.0\n# Generator speed (rpm),Stator current (A "
    "rms),Air-gap torque (N.m)\n",
    "script.csv": "# Time (s),Cycle,Predicted mechanical power (W)\n",
    "rig.toml": f'name = "mine"\n# Calibrated by {MARK} from a.csv: k_e.\n',
    "junit.xml": f'<?xml version="1.0" encoding="utf-8"?>\n<!-- <property name="generator" '
    f'value="{MARK}"/> -->\n<testsuites/>',
    "thesis.pdf": f"%PDF-1.7\n(made by {MARK}) /Author (A. N. Other)\n%%EOF\n",
    "data.parquet": f"PAR1 {MARK} PAR1",
}
"""Files of a user that mention the mark of this tool at other places than this tool writes it."""


def test_a_file_that_mentions_the_mark_is_not_this_tools_own(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "book.xlsx", "w") as archive:
        archive.writestr("notes", MARK)
        archive.comment = f"about {MARK}".encode()
    for name, text in MENTIONS.items():
        (tmp_path / name).write_text(text)
    assert [path.name for path in sorted(tmp_path.iterdir()) if is_marked(path)] == []


def test_a_set_of_files_that_finds_no_room_leaves_all_as_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [tmp_path / name for name in ("a.html", "a.json")]
    for path in paths:
        path.write_text("before")
    outdated = tmp_path / "a.pdf"
    outdated.write_text("before")
    usual = Path.write_bytes

    def full(path: Path, data: bytes) -> int:
        if data == b"second":
            raise OSError(errno.ENOSPC, "No space left on device")
        return usual(path, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(
        OutputError,
        match=r"a\.json: cannot be written \(No space left on device\); free some space",
    ):
        write_set({paths[0]: b"first", paths[1]: b"second"}, without=[outdated])
    assert [path.read_text() for path in (*paths, outdated)] == ["before"] * 3
    assert sorted(os.listdir(tmp_path)) == ["a.html", "a.json", "a.pdf"]


def test_a_set_of_files_replaces_a_link_and_not_what_it_leads_to(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "a.json").symlink_to(tmp_path / "mine.txt")
    write_set({tmp_path / "a.json": b"new"})
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "a.json").read_text() == "new"
