"""Read workbooks and MATLAB files in a process of its own: a damaged one can make its reader crash, or use all memory or hours.

The process reads the whole table and sends it at once.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from pkgutil import resolve_name

import msgspec

from winchcascade.core.errors import LogError
from winchcascade.ingest.limits import MB, MEMORY_SETTING, SECONDS_SETTING, Limits, limits_for, require_numbers
from winchcascade.ingest.source import Columns, LogSource, source_of

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from winchcascade.ingest.isolated import main; main(sys.argv[2])"
)
_STARVED = 77
"""Exit code of a process that has met the limit of memory."""

_OUT_OF_MEMORY = ("memory allocation of", "bad_alloc", "MemoryError")
"""What compiled readers write as their last words when memory runs out."""


class _Order(msgspec.Struct, frozen=True):
    """The file, the function that reads it with its options, and the limits."""

    reader: str
    path: str
    options: dict[str, str | bool | None]
    limits: Limits


def read_isolated(reader: str, path: Path, **options: str | bool | None) -> LogSource:
    """Read a file in a process of its own.

    Parameters
    ----------
    reader : `module:function` that reads the columns of a path
    options : further arguments of that function

    Raises
    ------
    LogError : the file cannot be used, or the reader met a limit or crashed
    """
    limits = limits_for(path)
    order = msgspec.json.encode(_Order(reader, str(path), options, limits)).decode()
    try:
        done = subprocess.run(
            # Without the interpreter's own settings, which a log has no business with; the path of modules is sent.
            [sys.executable, "-I", "-c", _START, json.dumps(sys.path), order],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=limits.seconds,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "RUST_BACKTRACE": "0"},
        )
    except subprocess.TimeoutExpired:
        raise LogError(_beyond(path, f"was not read within {limits.seconds:g} s", SECONDS_SETTING)) from None
    words, code = done.stderr.decode("utf-8", "replace"), done.returncode
    if code in (_STARVED, -getattr(signal, "SIGKILL", 0)) or (code and any(word in words for word in _OUT_OF_MEMORY)):
        raise LogError(_beyond(path, f"takes more than {limits.memory / MB:.0f} MB of memory to read", MEMORY_SETTING))
    if code:
        why = signal.Signals(-code).name if code < 0 else (words.strip().splitlines() or [f"exit code {code}"])[-1]
        raise LogError(
            f"{path.name}: the reader crashed ({why}); a damaged file is the usual cause; copy the file again, or export the "
            "log as CSV."
        )
    sent = msgspec.msgpack.decode(done.stdout, type=Columns | str)
    if isinstance(sent, str):
        raise LogError(sent)
    return source_of(sent)


def _beyond(path: Path, what: str, setting: str) -> str:
    """Report a limit that was met, and the variable that raises it."""
    return (
        f"{path.name}: {what}; less was expected of a file of {path.stat().st_size} bytes; delete what is not the log, export "
        f"it as CSV, or allow more with the environment variable {setting}."
    )


def main(words: str) -> None:
    """Read one file and send its columns, or the sentence that rejects it: the process that reads."""
    order = msgspec.json.decode(words, type=_Order)
    if sys.platform != "win32":
        import resource

        caps = {
            resource.RLIMIT_CORE: 0,
            resource.RLIMIT_CPU: math.ceil(order.limits.seconds),
        }  # also without its parent
        for which, cap in (caps | {resource.RLIMIT_DATA: order.limits.memory}).items():
            with suppress(ValueError, OSError):  # a system that cannot limit this
                resource.setrlimit(which, (cap, resource.getrlimit(which)[1]))
    try:
        path = Path(order.path)
        whole: Columns = resolve_name(order.reader)(path, **order.options)
        require_numbers(path, max((column.size for column in whole.columns), default=0), len(whole.columns))
        sent: Columns | str = whole
    except LogError as fault:
        sent = str(fault)
    except MemoryError:
        sys.exit(_STARVED)
    sys.stdout.buffer.write(msgspec.msgpack.encode(sent))
