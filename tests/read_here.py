"""Readers of binary formats in the process of the test: a process of its own takes most of the time of a small file."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from winchcascade.ingest.formats.excel import open_excel
from winchcascade.ingest.formats.mat import open_mat
from winchcascade.ingest.formats.parquet import open_parquet
from winchcascade.ingest.formats.tdms import open_tdms
from winchcascade.ingest.source import LogSource, LogTable, without_notes

OPENERS: dict[str, Callable[..., LogSource]] = {
    "tdms": open_tdms, "mat": open_mat, "parquet": open_parquet, "excel": open_excel,
}  # fmt: skip


@contextmanager
def readers_here() -> Iterator[None]:
    """Within this context no file is read in a process of its own; `test_isolated.py` and others test that it is."""
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr("winchcascade.ingest.isolated.open_isolated", _open_here)
        yield


def _open_here(reader: str, path: Path, *, table: str | None = None, numbered: bool = False) -> LogSource:
    source = OPENERS[reader](path, table=table, **({"numbered": True} if numbered and reader == "excel" else {}))

    def load(wanted: Sequence[int], time: int | None) -> LogTable:
        loaded = source.load(wanted, time)
        return without_notes(loaded) if reader == "excel" and time is not None else loaded

    return msgspec.structs.replace(source, load=load)
