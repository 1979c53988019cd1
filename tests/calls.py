"""The command line called in this process: as a user meets it, without the second that a process
takes to start.

A call takes the machine to have one processor: unless `--jobs` is given, it starts no processes for
its work either.
"""

import io
import os
import re
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from winchcascade.cli.entry import main
from winchcascade.core.process_end import ENDING

PATIENCE = 60
"""A command on a small file that has not ended after this never will. [s]"""


class Called(NamedTuple):
    """Exit code of a command and what it printed."""

    code: int
    out: str
    err: str


class Terminal(io.TextIOWrapper):
    """A stream that is a terminal."""

    def isatty(self) -> bool:
        return True


def call(
    *arguments: str | Path,
    encoding: str = "utf-8",
    patience: int = PATIENCE,
    terminal: bool = False,
) -> Called:
    """Call the command line with streams of an encoding; a command that never ends is a fault of
    the test.
    """
    kind = Terminal if terminal else io.TextIOWrapper
    streams = [kind(io.BytesIO(), encoding=encoding) for _ in range(2)]
    kept = sys.argv, sys.stdout, sys.stderr
    handlers = {number: signal.getsignal(number) for number in ENDING}
    sys.argv = ["winchcascade", *map(str, arguments)]
    sys.stdout, sys.stderr = streams
    try:
        with (
            _patience(patience),
            mock.patch.object(os, "sched_getaffinity", create=True, return_value={0}),
        ):
            main()
        code = 0
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 0
    finally:
        sys.argv, sys.stdout, sys.stderr = kept
        for number, handler in handlers.items():  # a command ends its whole process by them
            signal.signal(number, handler)
    out, err = map(_content, streams)
    return Called(code, out, without_progress(err))


def without_progress(text: str) -> str:
    """A text without the lines that a command prints each ten seconds, of which a slow machine
    has more.
    """
    return re.sub(r"(?m)^\[\d+ s\] .*\n", "", text)


def _content(stream: io.TextIOWrapper) -> str:
    stream.flush()
    content = stream.buffer
    assert isinstance(content, io.BytesIO)
    return content.getvalue().decode(stream.encoding)


@contextmanager
def _patience(seconds: int) -> Iterator[None]:
    if os.name == "nt":
        yield
        return
    old = signal.signal(signal.SIGALRM, _never)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, old)


def _never(_number: int, _frame: object) -> None:
    raise AssertionError("a command did not end in time")


def error_sentence(arguments: Sequence[str | Path]) -> str:
    """The one sentence of a command that rejects its arguments or files."""
    called = call(*arguments)
    assert called.code == 2, called
    assert called.out == ""
    assert called.err.startswith("winchcascade: ")
    assert called.err.count("\n") == 1
    assert called.err.rstrip("\n").isprintable()
    return called.err
