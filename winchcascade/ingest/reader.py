"""The process that reads one file for another process: requests come in on standard input, answers go out on standard output.

A request is a line of JSON. An answer is a line of JSON, followed by the bytes of a column where it announces them.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.ingest.limits import MB, MEMORY_SETTING, end_after, limit_this_process

if TYPE_CHECKING:
    from winchcascade.core.run import Signal
    from winchcascade.ingest.source import LogSource, LogTable

_OPENERS = {
    "excel": ("winchcascade.ingest.formats.excel", "open_excel"),
    "mat": ("winchcascade.ingest.formats.mat", "open_mat"),
    "parquet": ("winchcascade.ingest.formats.parquet", "open_parquet"),
    "tdms": ("winchcascade.ingest.formats.tdms", "open_tdms"),
}

_TOGETHER = {"tdms"}
"""Readers that bring the wanted columns onto one clock; the others read each column for itself, which takes less memory."""

_TEXT = 64
"""What a text takes beyond its characters. [bytes]"""


class ReadOrder(msgspec.Struct, frozen=True):
    """The first request: the file, its reader, and the limits of this process, as `limits.Limits` has them."""

    reader: str
    path: str
    table: str | None
    memory: int
    seconds: float
    numbers: int
    parent: int


def main() -> None:
    """Serve one file until the requests end."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # no word of a library gets among the answers
    requests = sys.stdin.buffer
    opening = requests.readline()
    if opening:
        order = msgspec.convert(json.loads(opening), ReadOrder)
        limit_this_process(order.memory, order.parent)
        try:
            _serve(order, requests, answers)
        except MemoryError:
            _say(answers, {"starved": True})
        except LogError as fault:
            _say(answers, {"fault": str(fault)})
        answers.flush()


def _serve(order: ReadOrder, requests: BinaryIO, answers: BinaryIO) -> None:
    end_after(order.seconds)
    path = Path(order.path)
    module, opener = _OPENERS[order.reader]
    source: LogSource = getattr(import_module(module), opener)(path, table=order.table)
    _say(
        answers,
        {
            "headers": [[header.name, header.unit] for header in source.headers],
            "time_step": source.time_step,
            "time_start": source.time_start,
            "properties": dict(source.properties),
            "table": source.table,
        },
    )
    for line in requests:
        end_after(order.seconds)
        wanted, time = (asked := json.loads(line))["wanted"], asked["time"]
        whole = source.load(wanted, time) if order.reader in _TOGETHER else None
        for head, column in _columns(source, wanted, time, whole, _Budget(path.name, order.numbers)):
            _say(answers, head)
            if column is not None:
                answers.write(column.data)
        answers.flush()


def _columns(
    source: LogSource, wanted: Sequence[int], time: int | None, whole: LogTable | None, budget: _Budget
) -> Iterator[tuple[Mapping[str, object], Signal | None]]:
    """Yield the wanted columns one by one, of the whole table or as each is read, and the time column."""
    for k, i in enumerate(wanted):
        column = np.ascontiguousarray((whole or source.load([i], None)).values[i], dtype=np.float64)
        budget.spend(column.nbytes, left=len(wanted) - k - 1 + (time is not None))
        yield {"rows": len(column)}, column
    table = whole or source.load([], time)
    described = {"stamped": table.stamped, "findings": [msgspec.structs.asdict(finding) for finding in table.findings]}
    if isinstance(table.stamps, np.ndarray):
        stamps = np.ascontiguousarray(table.stamps, dtype=np.float64)
        budget.spend(stamps.nbytes)
        yield {"rows": len(stamps), **described}, stamps
    elif table.stamps is not None:
        budget.spend(sum(map(len, table.stamps)) + _TEXT * len(table.stamps))
        yield {"texts": list(table.stamps), **described}, None
    else:
        yield described, None


class _Budget:
    """What the columns may take together."""

    def __init__(self, where: str, most: int) -> None:
        self._where, self._most, self._spent = where, most, 0

    def spend(self, taken: int, *, left: int = 0) -> None:
        """Count a column; LogError where it and those to come, each of its size, exceed the limit."""
        self._spent += taken
        if self._spent + left * taken > self._most:
            raise LogError(
                f"{self._where}: its columns take {(self._spent + left * taken) / MB:.0f} MB as numbers; at most "
                f"{self._most / MB:.0f} MB were expected of a file of this size; cut the log into shorter files or allow "
                f"more with the environment variable {MEMORY_SETTING}."
            )


def _say(answers: BinaryIO, what: Mapping[str, object]) -> None:
    content = json.dumps(what, default=lambda number: number.item())  # numpy's own numbers
    answers.write(content.encode("ascii") + b"\n")
    answers.flush()
