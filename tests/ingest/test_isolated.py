"""Workbooks and MATLAB files read in a process of its own: what comes through, and what becomes of it at a limit or a crash."""

import multiprocessing
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import bombs
import numpy as np
import pytest
from daily import daily
from seeds import seeds

from winchcascade.core.errors import LogError, OptionError
from winchcascade.ingest.dialects import Header
from winchcascade.ingest.isolated import read_isolated
from winchcascade.ingest.limits import MEMORY_SETTING, SECONDS_SETTING, limits_for
from winchcascade.ingest.read import read_run
from winchcascade.ingest.source import Column, Columns

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="limits as Linux has them")
POSIX = pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")

MEMORY, SECONDS = 2000.0, 60.0
"""What a file of less than a megabyte may take. [MB, s]"""

QUICK = ("xlsx, a cell in the last corner", "mat, a claimed length", "zip, a line", "parquet, zeros")
"""Bombs of every day, that are made and rejected in a second; slow tests do the others."""


def rejected(path: Path) -> tuple[str, float, float]:
    """What another process reports of a file, and what it took: seconds, and the largest memory of it and its reader. [MB]"""
    code = (
        "import resource, sys, time\n"
        "from winchcascade.ingest.read import read_run\n"
        "from winchcascade.core.errors import LogError\n"
        "begun = time.monotonic()\n"
        "try:\n    said = repr(read_run(sys.argv[1]))\nexcept LogError as fault:\n    said = str(fault)\n"
        "own = next(line for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "held = max(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, int(own.split()[1]))\n"
        "print(said)\nprint(time.monotonic() - begun, held / 1e3)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    said, figures = done.stdout.splitlines()
    seconds, held = map(float, figures.split())
    return said, seconds, held


@LINUX
@pytest.mark.parametrize("name", daily(bombs.BOMBS, QUICK))
def test_a_small_file_that_claims_or_unpacks_to_much_ends_within_the_limits(name: str, tmp_path: Path) -> None:
    path = tmp_path / "bomb.dat"
    path.write_bytes(bombs.BOMBS[name]())
    assert path.stat().st_size < 10**6
    said, seconds, held = rejected(path)
    assert said.startswith("bomb.dat: ")
    assert seconds < SECONDS
    assert held < MEMORY


@LINUX
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
@pytest.mark.parametrize("value", ["much", "0", "-1", "nan", "inf"])
def test_a_setting_that_is_no_positive_number_is_one_sentence(
    setting: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(setting, value)
    with pytest.raises(OptionError, match=f"^{setting}={value}: expected a number above 0"):
        limits_for(Path(__file__))


def as_they_are(path: Path, **_: object) -> Columns:
    numbers = np.array([1.5, -np.inf, 2.0, 5e-324])
    return Columns(
        (Header("t"), Header("v", "m/s")),
        [Column(texts=["10:00", "", "測\n", "x"]), Column(numbers.tobytes())],
        properties={"load_ohm": np.inf, "who": 'a "b"'},
    )


def crash(path: Path, **options: Any) -> Columns:
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
    [("6", r"crashed \(SIGABRT\)"), ("11", r"crashed \(SIGSEGV\)"), ("9", "takes more than 2000 MB")],
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
