"""A log that is replaced, rewritten or removed while it is read: the digest is of the bytes that
were parsed.
"""

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from winchcascade.core.errors import LogError
from winchcascade.ingest import read
from winchcascade.ingest.read import READS_MAX, read_run

CAMPAIGN = Path(__file__).parents[2] / "fixtures" / "campaign"


def rename(log: Path) -> None:
    shutil.copy(CAMPAIGN / "r9ohm.csv", log.with_suffix(".new"))
    os.replace(log.with_suffix(".new"), log)


def rewrite_with_old_dates(log: Path) -> None:
    before = log.stat()
    log.write_bytes((CAMPAIGN / "r9ohm.csv").read_bytes())
    os.utime(log, ns=(before.st_atime_ns, before.st_mtime_ns))


def append(log: Path) -> None:
    with log.open("a") as file:
        file.write("999.0,0.0,0.0,20.0,200.0,0.0,0.0,0.0\n")


def change_after(
    monkeypatch: pytest.MonkeyPatch, log: Path, change: Callable[[Path], None], times: int
) -> list[int]:
    """Change a log each time that it has been parsed, so many times; the times that are left."""
    usual, left = read._loaded, [times]

    def loaded(*given: object) -> object:
        found = usual(*given)  # type: ignore[arg-type]
        if left[0]:
            left[0] -= 1
            change(log)
        return found

    monkeypatch.setattr(read, "_loaded", loaded)
    return left


@pytest.mark.parametrize("change", [rename, rewrite_with_old_dates])
def test_a_log_that_is_replaced_while_it_is_read_is_read_again(
    change: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path / "log.csv"))
    change_after(monkeypatch, log, change, 1)
    run = read_run(log)
    assert run.samples == 3411
    assert run.sha256 == hashlib.sha256((CAMPAIGN / "r9ohm.csv").read_bytes()).hexdigest()


def test_a_log_that_changes_each_time_is_rejected_and_one_that_does_not_is_parsed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = Path(shutil.copy(CAMPAIGN / "r36ohm.csv", tmp_path / "log.csv"))
    left = change_after(monkeypatch, log, lambda _: None, 9)
    assert read_run(log).samples == 2767
    assert left == [8]
    change_after(monkeypatch, log, append, 9)
    with pytest.raises(LogError, match=f"changed each of {READS_MAX} times while it was read"):
        read_run(log)
