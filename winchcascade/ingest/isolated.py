"""Read formats whose readers a damaged file can mislead in a separate process, with limits of memory and time.

A request is a line of JSON on the standard input of that process. An answer is a line of JSON on its standard output,
followed by the bytes of a column where the line announces them.
"""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from time import monotonic
from typing import IO, NamedTuple, TypeVar

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.run import Finding, Signal
from winchcascade.core.scratch import scratch_folder
from winchcascade.ingest.dialects import Header
from winchcascade.ingest.limits import (
    MB,
    MEMORY_SETTING,
    SECONDS_SETTING,
    Limits,
    close_job,
    job_for,
    limit_this_process,
    limits_for,
    resident,
)
from winchcascade.ingest.source import LogSource, LogTable

A = TypeVar("A")


class _Format(NamedTuple):
    """A format: its name, what to do with a file of it that cannot be read, and the function that opens one.

    `together`: the reader needs all wanted columns at once. The others read each column by itself, which takes less memory.
    `unpacks`: the reader unpacks the log into a scratch folder. `nameless`: a log may lack names if its columns are numbered.
    """

    name: str
    remedy: str
    opener: str
    together: bool = False
    unpacks: bool = False
    nameless: bool = False


_FORMATS = {
    "archive": _Format(
        "archive",
        "unpack the log",
        "winchcascade.ingest.formats.archive:open_archive",
        together=True,  # as some formats need that may be inside
        unpacks=True,
        nameless=True,
    ),
    "excel": _Format(
        "workbook",
        "delete stray cells outside the table, save it again or export the sheet as CSV",
        "winchcascade.ingest.formats.excel:open_excel",
        together=True,  # to leave out the rows that are notes
        nameless=True,
    ),
    "mat": _Format("MATLAB file", "save the channels alone", "winchcascade.ingest.formats.mat:open_mat"),
    "parquet": _Format(
        "Parquet file", "export it again in shorter files", "winchcascade.ingest.formats.parquet:open_parquet"
    ),
    "tdms": _Format(
        "TDMS file",
        "copy it again or export it as CSV",
        "winchcascade.ingest.formats.tdms:open_tdms",
        together=True,  # to bring them onto one clock
    ),
}

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.stdin.buffer.readline()); "
    "from winchcascade.ingest.isolated import main; main()"
)

_PACE = 0.01
"""Interval at which memory and time are checked; a process fills some 30 MB meanwhile. [s]"""

_OWN_SHARE = 0.05
"""Share of the limit of time that is kept for the start of both processes and for the message."""

_LAST_MOMENTS = 5.0
"""A process that has closed its output but not ended after this never will. [s]"""

_AFTER = 5.0
"""Time after its limit at which the process ends itself, if its parent has ended without ending it. [s]"""

_LONGEST_LETTER = 6
"""Bytes of a letter in JSON."""

_TEXT = 64
"""What a text takes beyond its characters. [bytes]"""

_LAST_WORDS = 1 << 14
_OUT_OF_MEMORY = ("memory allocation of", "bad_alloc", "MemoryError")
"""What compiled readers and Python write as their last words when memory runs out."""


class _Order(msgspec.Struct, frozen=True):
    """The first request: the file, its reader, the limits of the process, the number of its parent, and a scratch folder."""

    reader: str
    path: str
    table: str | None
    numbered: bool
    limits: Limits
    parent: int
    scratch: str | None = None


class _Opened(msgspec.Struct, frozen=True):
    """Description of the opened file."""

    headers: tuple[Header, ...]
    time_step: float | None
    time_start: float
    properties: dict[str, str | float]
    table: str | None = None


class _Column(msgspec.Struct, frozen=True):
    """What precedes a column: the number of its rows where its bytes follow, or its texts, and what else is known of it."""

    rows: int | None = None
    texts: list[str] | None = None
    stamped: bool = False
    findings: tuple[Finding, ...] = ()
    began: float | None = None


def main() -> None:
    """Serve one file until the requests end: the process that reads."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # no word of a library gets among the answers
    opening = sys.stdin.buffer.readline()
    if opening:
        order = msgspec.convert(json.loads(opening), _Order)
        limit_this_process(order.limits.memory, order.parent, unpacks=order.scratch is not None)
        try:
            for head, column in _answers(order):
                _send(answers, head)
                if column is not None:
                    answers.write(column.data)
                    answers.flush()
        except MemoryError:
            _send(answers, {"starved": True})
        except LogError as fault:
            _send(answers, {"fault": str(fault)})


def _send(stream: IO[bytes], *lines: object) -> None:
    """Send lines of JSON, of structs and numpy's own numbers too."""
    for line in lines:
        text = json.dumps(
            line, default=lambda x: msgspec.structs.asdict(x) if isinstance(x, msgspec.Struct) else x.item()
        )
        stream.write(text.encode("ascii") + b"\n")
    stream.flush()


def _answers(order: _Order) -> Iterator[tuple[_Opened | _Column, Signal | None]]:
    """Open the file and describe it, then answer each request by the wanted columns one by one and the time column."""
    _end_after(order.limits.seconds)
    form = _FORMATS[order.reader]
    opener = opener_of(order.reader, numbered=order.numbered)
    if order.scratch is not None:
        opener = partial(opener, scratch=Path(order.scratch))
    source: LogSource = opener(Path(order.path), table=order.table)
    opened = _Opened(tuple(source.headers), source.time_step, source.time_start, dict(source.properties), source.table)
    yield opened, None
    for line in sys.stdin.buffer:
        _end_after(order.limits.seconds)
        wanted, time = json.loads(line)
        whole = source.load(wanted, time) if form.together else None
        taken = 0
        for k, i in enumerate([*wanted, None]):
            table = whole or (source.load([], time) if i is None else source.load([i], None))
            data = table.stamps if i is None else table.values[i]
            column = np.ascontiguousarray(data, dtype=np.float64) if isinstance(data, np.ndarray) else None
            texts = None if column is not None or data is None else [*map(str, data)]
            size = column.nbytes if column is not None else sum(len(text) + _TEXT for text in texts or ())
            taken += size
            # The columns to come have the same size.
            expected = taken + size * max(0, len(wanted) - k - (time is None))
            if expected > order.limits.numbers:
                raise LogError(
                    f"{Path(order.path).name}: its columns take {expected / MB:.0f} MB as numbers; at most "
                    f"{order.limits.numbers / MB:.0f} MB were expected of a file of this size; cut the log into shorter "
                    f"files or allow more with the environment variable {MEMORY_SETTING}."
                )
            yield (
                _Column(None if column is None else len(column), texts, table.stamped, table.findings, table.began),
                column,
            )


def _end_after(seconds: float) -> None:
    """End this process after a time, even within compiled code; a later call counts anew. Standard output leads nowhere."""
    faulthandler.dump_traceback_later(seconds + _AFTER, exit=True, file=1)


def open_isolated(reader: str, path: Path, *, table: str | None = None, numbered: bool = False) -> LogSource:
    """Open a file by a reader that runs in a process of its own.

    Parameters
    ----------
    table : name or number of the sheet or variable to read, where the file holds several
    numbered : the rig file numbers the columns, so that formats of cells need no names

    Raises
    ------
    LogError : the file cannot be used, or the reader met a limit or crashed, here or while columns are loaded
    """
    child = _Child(reader, path)
    try:
        opened = child.open(table, numbered=numbered)
    except BaseException:
        child.close()
        raise
    return LogSource(load=child.load, close=child.close, **msgspec.structs.asdict(opened))


class _Child:
    """The process that reads one file, and the watch over it."""

    def __init__(self, reader: str, path: Path) -> None:
        self._reader, self._path, self._size = reader, path, path.stat().st_size
        self._limits = limits_for(self._size)
        self._seconds = 0.0
        # On Windows the interpreter of a virtual environment would only start another process.
        python = str(getattr(sys, "_base_executable", sys.executable)) if os.name == "nt" else sys.executable
        # Without the interpreter's own settings, which a log has no business with; the path of modules is sent.
        self._process = subprocess.Popen(
            [python, "-I", "-c", _START],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "RUST_BACKTRACE": "0"},
        )
        job = job_for(int(getattr(self._process, "_handle", 0)), self._limits.memory)
        scratch = ExitStack()
        self._scratch = str(scratch.enter_context(scratch_folder())) if _FORMATS[reader].unpacks else None
        self.close: Callable[[], object] = weakref.finalize(self, _end, self._process, job, scratch)

    def open(self, table: str | None, *, numbered: bool) -> _Opened:
        """Open the file and describe it."""
        order = _Order(self._reader, str(self._path), table, numbered, self._limits, os.getpid(), self._scratch)
        return self._ask([sys.path, order], lambda answers: self._head(answers, _Opened))

    def load(self, wanted: Sequence[int], time: int | None) -> LogTable:
        """Load columns."""

        def receive(answers: IO[bytes]) -> LogTable:
            values = {i: np.asarray(self._column(answers)[1], dtype=np.float64) for i in wanted}
            head, stamps = self._column(answers)
            return LogTable(values, stamps=stamps, stamped=head.stamped, findings=head.findings, began=head.began)

        return self._ask([([*wanted], time)], receive)

    def _head(self, answers: IO[bytes], kind: type[A]) -> A:
        """Read the line of an answer; what the reader rejects is raised."""
        line = answers.readline(_LONGEST_LETTER * self._limits.numbers)
        if not line:
            raise EOFError
        head = json.loads(line)
        if "fault" in head:
            raise LogError(str(head["fault"]))
        if "starved" in head:
            raise MemoryError
        return msgspec.convert(head, kind)

    def _column(self, answers: IO[bytes]) -> tuple[_Column, Signal | list[str] | None]:
        head = self._head(answers, _Column)
        if head.rows is None:
            return head, head.texts
        if not 0 <= 8 * head.rows <= self._limits.numbers:
            raise EOFError(f"{head.rows} rows are announced")
        column = np.empty(head.rows)
        # A process that ends halfway leaves less than it announced.
        if head.rows and answers.readinto(column.data) < column.nbytes:  # type: ignore[attr-defined]
            raise EOFError
        return head, column

    def _ask(self, requests: Sequence[object], receive: Callable[[IO[bytes]], A]) -> A:
        """Send requests and wait for the answer, as long as the process keeps to its limits."""
        begun = monotonic() - self._seconds
        with ThreadPoolExecutor(1) as pool:
            answer = pool.submit(self._exchange, requests, receive)
            try:
                while not wait([answer], _PACE).done:
                    if resident(self._process.pid) > self._limits.memory:
                        raise self._too_large()
                    if monotonic() - begun > (1.0 - _OWN_SHARE) * self._limits.seconds:
                        raise self._beyond(f"was not read within {self._limits.seconds:g} s", SECONDS_SETTING)
            except BaseException:  # an interrupt, too: the thread ends with the process
                self.close()
                raise
        self._seconds = monotonic() - begun
        try:
            return answer.result()
        except MemoryError:
            raise self._too_large() from None
        except (OSError, EOFError, ValueError, TypeError, RecursionError, msgspec.ValidationError) as fault:
            raise self._crashed() from fault

    def _exchange(self, requests: Sequence[object], receive: Callable[[IO[bytes]], A]) -> A:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        _send(self._process.stdin, *requests)
        return receive(self._process.stdout)

    def _too_large(self) -> LogError:
        return self._beyond(f"takes more than {self._limits.memory / MB:.0f} MB of memory to read", MEMORY_SETTING)

    def _beyond(self, what: str, setting: str) -> LogError:
        """Report a limit that was met, and the variable that raises it."""
        form = _FORMATS[self._reader]
        return LogError(
            f"{self._path.name}: {what}; less was expected of a {form.name} of {self._size} bytes; {form.remedy}, or allow "
            f"more with the environment variable {setting}."
        )

    def _crashed(self) -> LogError:
        """Report why there is no answer: the process has ended, or what it sends is none."""
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
        form = _FORMATS[self._reader]
        return LogError(
            f"{self._path.name}: the reader of this {form.name} crashed ({why}); a damaged file is the usual cause; copy the "
            f"file again, or {form.remedy}."
        )


def opener_of(reader: str, *, numbered: bool) -> Callable[..., LogSource]:
    """Function that opens files of a format, by the numbers of their columns where that is possible and wanted."""
    form = _FORMATS[reader]
    opener: Callable[..., LogSource] = resolve_name(form.opener)
    return partial(opener, numbered=True) if numbered and form.nameless else opener


def _end(process: subprocess.Popen[bytes], job: int | None, scratch: ExitStack) -> None:
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout, process.stderr):
        if stream is not None:
            with suppress(OSError):  # a request that was not taken
                stream.close()
    close_job(job)
    scratch.close()
