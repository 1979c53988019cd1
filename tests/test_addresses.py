"""Addresses: a log is read from where it lies, and known by its content."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from winchcascade.core.addresses import expand, fingerprint, is_remote, local_copy
from winchcascade.core.errors import LogError
from winchcascade.ingest.read import read_run


@pytest.fixture
def log(fixtures: Path) -> Path:
    return fixtures / "campaign" / "r36ohm.csv"


@pytest.fixture
def memory() -> Iterator[fsspec.AbstractFileSystem]:
    """An object store in this process, empty before and after."""
    store = fsspec.filesystem("memory")
    yield store
    store.rm("/", recursive=True)


@pytest.mark.parametrize("address", ["s3://bucket/log.csv", "gs://b/l", "memory://a", "file:///tmp/log.csv"])
def test_an_address_names_its_protocol(address: str) -> None:
    assert is_remote(address)


@pytest.mark.parametrize(
    "path", ["log.csv", "/tmp/log.csv", "C:\\logs\\log.csv", "c:/log.csv", "a:b.csv", "~/x//y.csv"]
)
def test_a_path_is_no_address(path: str) -> None:
    assert not is_remote(path)


def test_a_path_is_its_own_copy(log: Path) -> None:
    with local_copy(str(log)) as path:
        assert path == log


@pytest.mark.parametrize("folder", ["plain", "mes essais", "測試"])
def test_an_address_of_this_machine_is_read_where_it_lies(log: Path, tmp_path: Path, folder: str) -> None:
    (tmp_path / folder).mkdir()
    place = shutil.copy(log, tmp_path / folder / "run é.csv")
    with local_copy(f"file://{place}") as path:
        assert path == Path(place)
        assert path.read_bytes() == log.read_bytes()
    assert path.exists()


def test_a_store_that_fsspec_alone_knows_is_read(log: Path, memory: fsspec.AbstractFileSystem) -> None:
    memory.pipe("/trial/r36ohm.csv", log.read_bytes())
    assert fingerprint("memory://trial/r36ohm.csv") == fingerprint(str(log))
    with local_copy("memory://trial/r36ohm.csv") as path:
        assert read_run(path).samples == read_run(log).samples


def test_a_remote_folder_and_a_pattern_are_their_files(memory: fsspec.AbstractFileSystem) -> None:
    for name in ("b.csv", "a.csv", "notes.md", "deep/c.csv"):
        memory.pipe(f"/trial/{name}", b"x")
    assert expand("memory://trial") == ["memory:///trial/a.csv", "memory:///trial/b.csv", "memory:///trial/notes.md"]
    assert expand("memory://trial/*.csv") == ["memory:///trial/a.csv", "memory:///trial/b.csv"]
    assert "memory:///trial/deep/c.csv" in expand("memory://trial/**/*.csv")


@pytest.mark.parametrize("name", ["a b é.csv", "log#1.csv", "x%20y.csv", "100 %.csv", "測試.csv"])
def test_every_file_that_a_folder_lists_can_be_opened(log: Path, tmp_path: Path, name: str) -> None:
    shutil.copy(log, tmp_path / name)
    (address,) = expand(f"file://{tmp_path}")
    with local_copy(address) as path:
        assert path.name == name
        assert path.read_bytes() == log.read_bytes()


@pytest.mark.parametrize("address", ["memory://nothing/log.csv", "nosuchstore://bucket/log.csv"])
def test_an_address_that_cannot_be_opened_is_one_sentence(address: str) -> None:
    with pytest.raises(LogError) as fault, local_copy(address):
        pass
    text = str(fault.value)
    assert text.startswith(f"{address}: cannot be opened (")
    assert text.endswith("check the address and the rights of the machine that reads it.")
    assert "\n" not in text
    assert fingerprint(address) == ""


def test_an_unknown_store_has_no_files_and_says_so() -> None:
    with pytest.raises(LogError, match="nosuchstore://bucket: cannot be opened"):
        expand("nosuchstore://bucket")


def test_without_fsspec_an_address_is_one_sentence() -> None:
    """In a process where `import fsspec` fails, as after an installation without extras."""
    script = "import sys; sys.modules['fsspec'] = None; from winchcascade.cli.entry import main; main()"
    command = [sys.executable, "-c", script, "batch", "nosuchstore://bucket/log.csv", "--out", "never"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


def test_a_fingerprint_changes_with_the_content_alone(log: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copy(log, tmp_path / "copy.csv"))
    before = fingerprint(str(log))
    os.utime(copy, (0.0, 0.0))
    assert fingerprint(str(copy)) == fingerprint(f"file://{copy}") == before
    assert before == read_run(log).sha256
    copy.write_bytes(log.read_bytes() + b"\n")
    assert fingerprint(str(copy)) != before


def test_what_is_not_there_has_no_fingerprint(tmp_path: Path) -> None:
    assert fingerprint(str(tmp_path / "nothing.csv")) == fingerprint(str(tmp_path)) == ""
