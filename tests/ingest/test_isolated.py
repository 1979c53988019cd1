"""Files that are read in a process of their own: what comes through, and what becomes of it at a limit, a crash or an end."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bombs
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from daily import daily
from seeds import seeds

from winchcascade.core.errors import LogError, OptionError
from winchcascade.ingest.limits import MEMORY_SETTING, SECONDS_SETTING, limits_for
from winchcascade.ingest.open_log import open_log
from winchcascade.ingest.read import read_run

POSIX = pytest.mark.skipif(os.name == "nt", reason="signals as POSIX has them")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="/proc as Linux has it")

MEMORY, SECONDS = 400, 20
"""Limits for these tests. [MB, s]"""

OVERSHOOT = 200
"""What a process may take between two looks at its memory on a busy machine. [MB]"""

LATE = 40.0
"""A busy machine may be so late. [s]"""

QUICK = ("xlsx, a cell in the last corner", "mat, a claimed length", "zip, a line")
"""Bombs of every day, that are made and rejected in a second; slow tests do the others."""


def rejected(path: Path, **environment: str) -> tuple[str, float, float]:
    """What another process says of a file, and what it took: seconds, and the largest memory of it and its reader. [MB]"""
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
    command = [sys.executable, "-c", code, str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | environment)
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
    said, seconds, held = rejected(path, **{MEMORY_SETTING: str(MEMORY), SECONDS_SETTING: str(SECONDS)})
    assert said.startswith("bomb.dat: ")
    assert seconds < SECONDS + LATE
    assert held < MEMORY + OVERSHOOT


def test_a_limit_is_reported_with_the_variable_that_raises_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.xlsx"
    path.write_bytes(bombs.BOMBS["xlsx, a cell in the last row"]())
    monkeypatch.setenv(MEMORY_SETTING, "300")
    with pytest.raises(LogError) as caught:
        read_run(path)
    assert str(caught.value).startswith(
        "a.xlsx: takes more than 300 MB of memory to read; less was expected of a workbook"
    )
    assert "damaged" not in str(caught.value)
    assert MEMORY_SETTING in str(caught.value)
    monkeypatch.setenv(SECONDS_SETTING, "0.05")
    with pytest.raises(LogError, match=rf"a.xlsx: was not read within 0.05 s; .* {SECONDS_SETTING}\."):
        read_run(path)


@pytest.mark.parametrize("setting", [MEMORY_SETTING, SECONDS_SETTING])
@pytest.mark.parametrize("value", ["much", "0", "-1", "nan", "inf"])
def test_a_setting_that_is_no_positive_number_is_one_sentence(
    setting: str, value: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(setting, value)
    with pytest.raises(OptionError, match=f"^{setting}={value}: expected a number above 0"):
        limits_for(1)


def test_the_limits_grow_with_the_file() -> None:
    small, large = limits_for(1000), limits_for(10**9)
    assert (small.memory, small.seconds) == (2 * 10**9, 60.0)
    assert (large.memory, large.seconds, large.numbers) == (20 * 10**9, 4000.0, 10**10)


def parquet(path: Path) -> Path:
    path.write_bytes(seeds("parquet")[0])
    return path


def process_of(source: Any) -> "subprocess.Popen[bytes]":
    process: subprocess.Popen[bytes] = source.load.__self__._process
    return process


def test_numbers_texts_and_properties_come_through_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    values = [1.5, -np.inf, np.nan, 5e-324]
    table = pa.table({"t": ["10:00", None, "測\n", "x"], "v": values})
    pq.write_table(table.replace_schema_metadata({"load_ohm": "inf", "who": 'a "b"'}), path)
    source = open_log(path)
    try:
        loaded = source.load([1], 0)
        assert loaded.stamps == ["10:00", "", "測\n", "x"]
        np.testing.assert_array_equal(loaded.values[1], values)
        assert loaded.values[1].flags.writeable
        assert source.properties == {"load_ohm": np.inf, "who": 'a "b"'}
        assert source.load([], None).stamps is None
    finally:
        source.close()
    assert process_of(source).returncode is not None


@POSIX
@pytest.mark.parametrize("number", [signal.SIGABRT, signal.SIGSEGV])
def test_a_crash_of_the_reader_has_a_message_of_its_own(number: signal.Signals, tmp_path: Path) -> None:
    source = open_log(parquet(tmp_path / "a.parquet"))
    os.kill(process_of(source).pid, number)
    with pytest.raises(LogError) as caught:
        source.load([1], 0)
    assert str(caught.value).startswith(f"a.parquet: the reader of this Parquet file crashed ({number.name}); ")


@POSIX
def test_a_reader_that_the_system_killed_ran_out_of_memory(tmp_path: Path) -> None:
    source = open_log(parquet(tmp_path / "a.parquet"))
    os.kill(process_of(source).pid, signal.SIGKILL)
    with pytest.raises(LogError, match="takes more than 2000 MB of memory to read"):
        source.load([1], 0)


def gone(pid: int) -> bool:
    """Wait for a process of any parent to end."""
    end = time.monotonic() + LATE
    while time.monotonic() < end:
        if not Path(f"/proc/{pid}").exists() or " Z " in Path(f"/proc/{pid}/stat").read_text():
            return True
        time.sleep(0.05)
    return False


@LINUX
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_reader_ends_with_its_parent(number: signal.Signals, tmp_path: Path) -> None:
    code = (
        "import sys, time\n"
        "from winchcascade.ingest.open_log import open_log\n"
        "from pathlib import Path\n"
        "source = open_log(Path(sys.argv[1]))\n"
        "print(source.load.__self__._process.pid, flush=True)\n"
        "time.sleep(100)\n"
    )
    command = [sys.executable, "-c", code, str(parquet(tmp_path / "a.parquet"))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        parent.send_signal(number)
    assert gone(pid)


def _raise(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.slow
@LINUX
def test_an_interrupt_ends_the_reader_at_work(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(bombs.BOMBS["mat73, cells"]())
    others = _children()
    before = signal.signal(signal.SIGALRM, _raise)
    signal.setitimer(signal.ITIMER_REAL, 2.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            read_run(path)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert _children() <= others


def _children() -> set[str]:
    return set(Path(f"/proc/self/task/{os.getpid()}/children").read_text().split())


def _in_a_daemon(path: Path, answers: Any) -> None:
    answers.put(read_run(path).samples)


def test_a_daemon_process_may_read_a_file(tmp_path: Path) -> None:
    """Workers of batches and of Dask are such processes."""
    context = multiprocessing.get_context("spawn")
    answers = context.Queue()
    worker = context.Process(target=_in_a_daemon, args=(parquet(tmp_path / "a.parquet"), answers), daemon=True)
    worker.start()
    assert answers.get(timeout=2 * LATE) == 900
    worker.join()
