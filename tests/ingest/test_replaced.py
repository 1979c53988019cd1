"""A log that is replaced, rewritten or removed while it is read: the digest is of the bytes that were parsed."""

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from winchcascade.core.errors import LogError
from winchcascade.ingest import read
from winchcascade.ingest.read import read_run

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"
SAMPLES = {"r36ohm.csv": 2767, "r9ohm.csv": 3411}


def rename(log: Path) -> None:
    shutil.copy(CAMPAIGN / "r9ohm.csv", log.with_suffix(".new"))
    os.replace(log.with_suffix(".new"), log)


def rewrite(log: Path) -> None:
    log.write_bytes((CAMPAIGN / "r9ohm.csv").read_bytes())


def rewrite_with_old_dates(log: Path) -> None:
    before = log.stat()
    rewrite(log)
    os.utime(log, ns=(before.st_atime_ns, before.st_mtime_ns))


def change_after(monkeypatch: pytest.MonkeyPatch, log: Path, change: Callable[[Path], None], times: int) -> None:
    """Change a log each time that it has been parsed, so many times."""
    usual, left = read._loaded, [times]

    def loaded(*given: object) -> object:
        found = usual(*given)  # type: ignore[arg-type]
        if left[0]:
            left[0] -= 1
            change(log)
        return found

    monkeypatch.setattr(read, "_loaded", loaded)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path / "log.csv"))
    os.utime(path, ns=(10**18, 10**18))
    return path


@pytest.mark.parametrize("change", [rename, rewrite, rewrite_with_old_dates])
def test_a_log_that_is_replaced_while_it_is_read_is_read_again(
    log: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None]
) -> None:
    change_after(monkeypatch, log, change, 1)
    run = read_run(log)
    assert run.samples == SAMPLES["r9ohm.csv"]
    assert run.sha256 == hashlib.sha256((CAMPAIGN / "r9ohm.csv").read_bytes()).hexdigest()


def test_a_log_that_changes_each_time_is_rejected(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def append(log: Path) -> None:
        with log.open("a") as file:
            file.write("999.0,0.0,0.0,20.0,200.0,0.0,0.0,0.0\n")

    change_after(monkeypatch, log, append, 9)
    with pytest.raises(LogError, match="changed each of 3 times while it was read; expected a file that is complete"):
        read_run(log)


def test_a_log_that_nobody_changes_is_parsed_once(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parsed: list[Path] = []
    change_after(monkeypatch, log, parsed.append, 9)
    assert read_run(log).samples == SAMPLES["r36ohm.csv"]
    assert len(parsed) == 1
