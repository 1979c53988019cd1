"""Formats whose readers a damaged file can mislead are read in a process of their own, with limits of memory and time."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import IO, Any, NamedTuple, TypeVar

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding
from winchcascade.ingest.limits import (
    MB,
    MEMORY_SETTING,
    SECONDS_SETTING,
    Limits,
    close_job,
    job_for,
    limits_for,
    resident,
)
from winchcascade.ingest.reader import ReadOrder
from winchcascade.ingest.source import Header, LogSource, LogTable, without_notes

A = TypeVar("A")


class _Format(NamedTuple):
    """How a format is called, and what to do with a file of it that cannot be read."""

    name: str
    remedy: str


_FORMATS = {
    "excel": _Format("workbook", "delete stray cells outside the table, save it again or export the sheet as CSV"),
    "mat": _Format("MATLAB file", "save the channels alone"),
    "parquet": _Format("Parquet file", "export it again in shorter files"),
    "tdms": _Format("TDMS file", "copy it again or export it as CSV"),
}

_START = "import json, sys; sys.path[:] = json.loads(sys.stdin.buffer.readline()); "
_START += "from winchcascade.ingest.reader import main; main()"

_PACE = 0.01
"""Memory and time are looked at so often; a process fills some 30 MB meanwhile. [s]"""

_OWN_SHARE = 0.05
"""Share of the limit of time that is kept for the start of both processes and for the message."""

_LAST_MOMENTS = 5.0
"""A process that has closed its output but not ended after this never will. [s]"""

_LONGEST_LETTER = 6
"""Bytes of a letter in JSON."""

_LAST_WORDS = 1 << 14
_OUT_OF_MEMORY = ("memory allocation of", "bad_alloc", "MemoryError")
"""What compiled readers and Python write as their last words when memory runs out."""


def open_isolated(reader: str, path: Path, *, table: str | None = None) -> LogSource:
    """Open a file by a reader that runs in a process of its own.

    Parameters
    ----------
    table : name or number of the sheet or variable to read, where the file holds several

    Raises
    ------
    LogError : the file cannot be used, or the reader met a limit or crashed, here or while columns are loaded
    """
    child = _Child(reader, path)
    try:
        opened = child.open(table)
        return LogSource(
            headers=tuple(Header(name, unit) for name, unit in opened.headers),
            load=child.load,
            time_step=opened.time_step,
            time_start=opened.time_start,
            properties=opened.properties,
            close=child.close,
            table=opened.table,
        )
    except BaseException:
        child.close()
        raise


class _Opened(msgspec.Struct, frozen=True):
    """Description of the opened file, as the process sends it."""

    headers: list[tuple[str, str | None]]
    time_step: float | None
    time_start: float
    properties: dict[str, str | float]
    table: str | None = None


class _Column(msgspec.Struct, frozen=True):
    """What precedes a column: the number of its rows where its bytes follow, or its texts."""

    rows: int | None = None
    texts: list[str] | None = None
    stamped: bool = False
    findings: tuple[Finding, ...] = ()


class _Child:
    """The process that reads one file, and the watch over it."""

    def __init__(self, reader: str, path: Path) -> None:
        self._path, self._size, self._reader = path, path.stat().st_size, reader
        self._limits: Limits = limits_for(self._size)
        self._seconds = 0.0
        self._format = _FORMATS[reader]
        # Without the interpreter's own settings, which a log has no business with; the path of modules is sent.
        self._process = subprocess.Popen(
            [_interpreter(), "-I", "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "RUST_BACKTRACE": "0"},
        )
        job = job_for(int(getattr(self._process, "_handle", 0)), self._limits.memory)
        self.close: Callable[[], object] = weakref.finalize(self, _end, self._process, job)

    def open(self, table: str | None) -> _Opened:
        """Open the file and describe it."""
        limits = self._limits
        order = ReadOrder(
            self._reader, str(self._path), table, limits.memory, limits.seconds, limits.numbers, parent=os.getpid()
        )
        return self._ask([sys.path, msgspec.structs.asdict(order)], lambda answers: self._head(answers, _Opened))

    def load(self, wanted: Sequence[int], time: int | None) -> LogTable:
        """Load columns."""

        def receive(answers: IO[bytes]) -> LogTable:
            values = {i: self._column(answers, self._head(answers, _Column).rows or 0) for i in wanted}
            head = self._head(answers, _Column)
            stamps = head.texts if head.rows is None else self._column(answers, head.rows)
            return LogTable(values, stamps=stamps, stamped=head.stamped, findings=head.findings)

        table = self._ask([{"wanted": [*wanted], "time": time}], receive)
        return without_notes(table) if self._reader == "excel" and time is not None else table

    def _head(self, answers: IO[bytes], kind: type[A]) -> A:
        """Read the line of an answer; what the reader refuses is raised."""
        line = answers.readline(_LONGEST_LETTER * self._limits.numbers)
        if not line:
            raise EOFError
        head = json.loads(line)
        if "fault" in head:
            raise LogError(str(head["fault"]))
        if "starved" in head:
            raise _Starved
        return msgspec.convert(head, kind)

    def _column(self, answers: IO[bytes], rows: int) -> Any:
        if not 0 <= 8 * rows <= self._limits.numbers:
            raise EOFError(f"{rows} rows are announced")
        column = np.empty(rows)
        # A process that ends halfway leaves less than it announced.
        if rows and answers.readinto(column.data) < column.nbytes:  # type: ignore[attr-defined]
            raise EOFError
        return column

    def _ask(self, request: Sequence[object], receive: Callable[[IO[bytes]], A]) -> A:
        """Send a request and wait for the answer, as long as the process keeps to its limits."""
        begun = monotonic() - self._seconds
        with ThreadPoolExecutor(1) as pool:
            answer = pool.submit(self._exchange, request, receive)
            try:
                while not wait([answer], _PACE).done:
                    self._check_limits(monotonic() - begun)
            except BaseException:  # an interrupt, too: the thread ends with the process
                self.close()
                raise
        self._seconds = monotonic() - begun
        try:
            return answer.result()
        except _Starved:
            raise self._too_large() from None
        except (OSError, EOFError, ValueError, TypeError, RecursionError, msgspec.ValidationError) as fault:
            raise self._crashed() from fault

    def _exchange(self, request: Sequence[object], receive: Callable[[IO[bytes]], A]) -> A:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.writelines(json.dumps(part).encode("ascii") + b"\n" for part in request)
        self._process.stdin.flush()
        return receive(self._process.stdout)

    def _check_limits(self, seconds: float) -> None:
        if resident(self._process.pid) > self._limits.memory:
            raise self._too_large()
        if seconds > (1.0 - _OWN_SHARE) * self._limits.seconds:
            raise LogError(
                f"{self._path.name}: was not read within {self._limits.seconds:g} s; less was expected of a "
                f"{self._format.name} of {self._size} bytes; {self._format.remedy}, or allow more with the environment "
                f"variable {SECONDS_SETTING}."
            )

    def _too_large(self) -> LogError:
        return LogError(
            f"{self._path.name}: takes more than {self._limits.memory / MB:.0f} MB of memory to read; less was expected of "
            f"a {self._format.name} of {self._size} bytes; {self._format.remedy}, or allow more with the environment "
            f"variable {MEMORY_SETTING}."
        )

    def _crashed(self) -> LogError:
        """Say why there is no answer: the process has ended, or what it sends is none."""
        assert self._process.stderr is not None
        try:
            code = self._process.wait(_LAST_MOMENTS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait() and 1
        words = os.read(self._process.stderr.fileno(), _LAST_WORDS).decode("utf-8", "replace")
        self.close()
        if any(word in words for word in _OUT_OF_MEMORY) or code == -getattr(signal, "SIGKILL", 0):
            return self._too_large()
        why = signal.Signals(-code).name if code < 0 else (words.strip().splitlines() or [f"exit code {code}"])[-1]
        return LogError(
            f"{self._path.name}: the reader of this {self._format.name} crashed ({why}); a damaged file is the usual cause; "
            f"copy the file again, or {self._format.remedy}."
        )


class _Starved(Exception):
    """The process has reported that its memory is used up."""


def _interpreter() -> str:
    """Path of this interpreter; on Windows that of a virtual environment would only start another process."""
    return str(getattr(sys, "_base_executable", sys.executable)) if os.name == "nt" else sys.executable


def _end(process: subprocess.Popen[bytes], job: int | None) -> None:
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            with suppress(OSError):  # a request that was not taken
                stream.close()
    close_job(job)
