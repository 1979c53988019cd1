"""Workbooks and MATLAB files read in a process of its own: what comes through, and what becomes of
it at a limit or a crash.

The limits themselves are tried on files of `tests/hardening/bombs.py` there.
"""

import multiprocessing
import os
from pathlib import Path
from typing import Any

import bombs
import numpy as np
import pyarrow as pa
import pytest
from seeds import seeds

from winchcascade.core.errors import LogError, OptionError
from winchcascade.ingest.headers import Header
from winchcascade.ingest.isolated import read_isolated
from winchcascade.ingest.limits import MEMORY_SETTING, SECONDS_SETTING, limits_of
from winchcascade.ingest.read import read_run
from winchcascade.ingest.source import arrow_table

POSIX = pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")


@POSIX
@pytest.mark.parametrize(("setting", "value"), [(MEMORY_SETTING, "300"), (SECONDS_SETTING, "0.05")])
def test_a_limit_is_reported_with_the_variable_that_raises_it(
    setting: str, value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.xlsx"
    path.write_bytes(bombs.BOMBS["xlsx, a cell in the last row"]())
    monkeypatch.setenv(setting, value)
    with pytest.raises(LogError, match=rf"^a.xlsx: .*{value} .*{setting}\.$"):
        read_run(path)


@pytest.mark.parametrize("setting", [MEMORY_SETTING, SECONDS_SETTING])
@pytest.mark.parametrize("value", ["much", "0", "nan", "inf"])
def test_a_setting_that_is_no_positive_number_is_one_sentence(
    setting: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(setting, value)
    with pytest.raises(OptionError, match=f"^{setting}={value}: expected a number above 0"):
        limits_of(Path(__file__))


def as_they_are(path: Path, **_: object) -> pa.Table:
    columns = [pa.array(["10:00", "", "測\n", "x"]), pa.array([1.5, -np.inf, 2.0, 5e-324])]
    properties = {"load_ohm": np.inf, "who": 'a "b"'}
    return arrow_table([Header("t"), Header("v", "m/s")], columns, properties=properties)


def crash(path: Path, **options: Any) -> pa.Table:
    os.kill(os.getpid(), int(options["signal"]))
    raise AssertionError


def test_numbers_texts_and_properties_come_through_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "a").touch()
    source = read_isolated(f"{__name__}:as_they_are", tmp_path / "a")
    loaded = source.load([1], 0)
    assert loaded.stamps == ["10:00", "", "測\n", "x"]
    np.testing.assert_array_equal(loaded.values[1], [1.5, -np.inf, 2.0, 5e-324])
    assert source.headers == (Header("t"), Header("v", "m/s"))
    assert source.properties == {"load_ohm": np.inf, "who": 'a "b"'}


@POSIX
@pytest.mark.parametrize(
    ("number", "words"),
    [
        ("6", r"crashed \(SIGABRT\)"),
        ("11", r"crashed \(SIGSEGV\)"),
        ("9", "takes more than 2000 MB"),
    ],
)
def test_a_crash_of_the_reader_is_one_sentence(number: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.mat").touch()
    with pytest.raises(LogError, match=f"^a.mat: .*{words}"):
        read_isolated(f"{__name__}:crash", tmp_path / "a.mat", signal=number)


def _in_a_daemon(path: Path, answers: Any) -> None:
    answers.put(read_run(path).samples)


def test_a_daemon_process_may_read_a_file(tmp_path: Path) -> None:
    """Workers of batches and of Dask are such processes."""
    path = tmp_path / "a.xlsx"
    path.write_bytes(seeds("excel")[0])
    context = multiprocessing.get_context("spawn")
    answers = context.Queue()
    worker = context.Process(target=_in_a_daemon, args=(path, answers), daemon=True)
    worker.start()
    assert answers.get(timeout=80.0) > 100
    worker.join()
