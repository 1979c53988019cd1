"""Read workbooks and MATLAB files in a process of its own: a damaged one can make its reader
crash, or take all memory.
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
from typing import Any

import pyarrow as pa

from winchcascade.core.errors import LogError
from winchcascade.ingest.limits import (
    MB,
    MEMORY_SETTING,
    SECONDS_SETTING,
    limits_of,
    require_numbers,
)
from winchcascade.ingest.source import LogSource, source_of

_START = (
    "import json, sys; sys.path[:] = json.loads(sys.argv[1]); "
    "from winchcascade.ingest.isolated import main; main(**json.loads(sys.argv[2]))"
)
_REJECTED, _STARVED = 76, 77
"""Exit codes of a process that rejects the file by a sentence, and of one that has met the limit
of memory.
"""

_OUT_OF_MEMORY = ("memory allocation of", "bad_alloc", "MemoryError")
"""What compiled readers write as their last words when memory runs out."""


def read_isolated(reader: str, path: Path, **options: str | bool | None) -> LogSource:
    """Read a file in a process of its own.

    Parameters
    ----------
    reader : `module:function` that reads a path into a table of Arrow
    options : further arguments of that function

    Raises
    ------
    LogError : the file cannot be used, or the reader met a limit or crashed
    """
    memory, seconds = limits_of(path)
    order = {
        "reader": reader,
        "path": str(path),
        "options": options,
        "memory": memory,
        "seconds": seconds,
    }
    try:
        done = subprocess.run(
            # Without the interpreter's own settings, which a log has no business with; the path of
            # modules is sent.
            [sys.executable, "-I", "-c", _START, json.dumps(sys.path), json.dumps(order)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=seconds,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "RUST_BACKTRACE": "0"},
        )
    except subprocess.TimeoutExpired:
        raise LogError(
            _beyond(path, f"was not read within {seconds:g} s", SECONDS_SETTING)
        ) from None
    words, code = done.stderr.decode("utf-8", "replace"), done.returncode
    if code == _REJECTED:
        raise LogError(done.stdout.decode())
    if code in (_STARVED, -getattr(signal, "SIGKILL", 0)) or (
        code and any(word in words for word in _OUT_OF_MEMORY)
    ):
        raise LogError(
            _beyond(path, f"takes more than {memory / MB:.0f} MB of memory to read", MEMORY_SETTING)
        )
    if code:
        why = (
            signal.Signals(-code).name
            if code < 0
            else (words.strip().splitlines() or [f"exit code {code}"])[-1]
        )
        raise LogError(
            f"{path.name}: the reader crashed ({why}); a damaged file is the usual cause; copy "
            f"the file again, or export the "
            "log as CSV."
        )
    return source_of(pa.ipc.open_stream(done.stdout).read_all())


def _beyond(path: Path, what: str, setting: str) -> str:
    """Report a limit that was met, and the variable that raises it."""
    return (
        f"{path.name}: {what}; less was expected of a file of {path.stat().st_size} bytes; delete "
        f"what is not the log, export "
        f"it as CSV, or allow more with the environment variable {setting}."
    )


def main(*, reader: str, path: str, options: dict[str, Any], memory: int, seconds: float) -> None:
    """Read one file and send its table, or the sentence that rejects it: the process that reads."""
    if sys.platform != "win32":
        import resource

        limits = {
            resource.RLIMIT_CORE: 0,
            resource.RLIMIT_CPU: math.ceil(seconds),
            resource.RLIMIT_DATA: memory,
        }
        for which, limit in limits.items():
            with suppress(ValueError, OSError):  # a system that cannot limit this
                resource.setrlimit(which, (limit, resource.getrlimit(which)[1]))
    try:
        table: pa.Table = resolve_name(reader)(Path(path), **options)
        require_numbers(Path(path), table.num_rows, table.num_columns)
        with pa.ipc.new_stream(sys.stdout.buffer, table.schema) as stream:
            stream.write_table(table)
    except LogError as fault:
        sys.stdout.buffer.write(str(fault).encode("utf-8", "replace"))
        sys.exit(_REJECTED)
    except MemoryError:
        sys.exit(_STARVED)
