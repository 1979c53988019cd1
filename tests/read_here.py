"""Workbooks and MATLAB files read in the process of the test: a process of its own takes most of
the time of a small file.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from pkgutil import resolve_name

import pytest

from winchcascade.ingest.formats.excel import read_excel
from winchcascade.ingest.formats.mat import read_mat
from winchcascade.ingest.source import LogSource, source_of


def open_excel(path: Path, *, table: str | None = None, numbered: bool = False) -> LogSource:
    """A workbook as a source."""
    return source_of(read_excel(path, table=table, numbered=numbered))


def open_mat(path: Path, *, table: str | None = None) -> LogSource:
    """A MATLAB file as a source."""
    return source_of(read_mat(path, table=table))


@contextmanager
def readers_here() -> Iterator[None]:
    """Within this context no file is read in a process of its own; `test_isolated.py` and others
    test that it is.
    """
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr("winchcascade.ingest.isolated.read_isolated", _read_here)
        yield


def _read_here(reader: str, path: Path, **options: str | bool | None) -> LogSource:
    return source_of(resolve_name(reader)(path, **options))
