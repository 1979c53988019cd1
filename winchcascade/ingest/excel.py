"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, its names, its units and its cells."""

from __future__ import annotations

import datetime as dt
import io
import os
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from winchcascade.errors import LogError
from winchcascade.ingest.excel97 import Locked, compound, corners, is_compound, workbook_stream
from winchcascade.ingest.extent import Corner, binary_corner, named_corner, repeated_corner, texts_claimed
from winchcascade.ingest.sheet import (
    ROWS_LOOKED_AT,
    ROWS_SEARCHED,
    Cell,
    Layout,
    Row,
    find_table,
    is_name,
    number,
    seconds,
    without_empty_end,
)
from winchcascade.ingest.source import Source, Table

if TYPE_CHECKING:
    from winchcascade.run import Signal

BYTES_UNPACKED = 500 * 2**20
"""Most that a zipped workbook may hold once unpacked."""

CELLS = 25_000_000
"""Most cells between the first and the last of a sheet: the reader lays them out densely, 32 bytes each."""


def open_excel(path: Path) -> Source:
    """Open the sheet with the most named columns over numbers.

    Raises
    ------
    LogError
        the workbook is damaged, locked, too large once unpacked, or no sheet holds a table
    """
    with _told(path):
        content = path.read_bytes()
        if zipfile.is_zipfile(io.BytesIO(content)):
            _refuse_bomb(path, content)
        elif is_compound(content):
            content = _sound_old(path, content)
        with _quiet():
            layout, rows = _best_sheet(path, content)
    return Source(
        headers=layout.headers,
        load=partial(_load, rows),
    )


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn whatever the parser trips over into one sentence."""
    try:
        yield
    except (LogError, KeyboardInterrupt, SystemExit):
        raise
    except (PasswordError, Locked) as fault:
        raise LogError(
            f"{path.name}: the workbook is locked with a password; one that opens without was expected; "
            "save it without the password or export the sheet as CSV."
        ) from fault
    except BaseException as fault:  # a panic of the Rust reader is no Exception
        raise LogError(
            f"{path.name}: the workbook is damaged or breaks off ({type(fault).__name__}); a whole .xlsx, .xls, .xlsb "
            "or .ods was expected; open it in a spreadsheet program and save it again, or export the sheet as CSV."
        ) from fault


_TERMINAL = Lock()
"""Held while the standard error output of the whole process is put aside: a second thread would put its own back for good."""


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep from the terminal what the Rust reader writes there, past Python, when it panics: `_told` says it in a sentence."""
    with _TERMINAL, _put_aside():
        yield


@contextmanager
def _put_aside() -> Iterator[None]:
    try:
        terminal = os.dup(2)
    except OSError:  # closed by the caller
        yield
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(terminal, 2)
        os.close(terminal)
        os.close(nowhere)


def _refuse_bomb(path: Path, content: bytes) -> None:
    """Unpack every part once, a piece at a time: sizes, checksums and the corner of the sheets.

    Raises
    ------
    LogError
        the parts are larger than `BYTES_UNPACKED`, a cell lies where no sheet has one, or a stray one stretches a sheet over
        `CELLS` cells
    """
    with zipfile.ZipFile(io.BytesIO(content)) as parts:
        size = sum(part.file_size for part in parts.infolist())
        if size > BYTES_UNPACKED:
            raise LogError(
                f"{path.name}: the workbook unpacks to {size / 2**20:.0f} MB; at most {BYTES_UNPACKED / 2**20:.0f} MB "
                "are read; export the sheet as CSV."
            )
        for part in parts.infolist():
            if part.filename.lower().startswith("xl/sharedstrings"):
                with parts.open(part) as stream:
                    _refuse_lie(path, stream.read(2**16), part.file_size)
            reach = _reach_of(part.filename)
            with parts.open(part) as stream:
                corner = reach(iter(partial(stream.read, 2**20), b""))
                _refuse_reach(path, corner, corner.cells)


def _sound_old(path: Path, content: bytes) -> bytes:
    """Put the stream of a workbook of Excel 97 into a sound file, after a look where its sheets end: the reader lays all of
    them out at once, and the wanted one twice.

    Raises
    ------
    LogError
        a cell lies where no sheet has one, or stray ones stretch the sheets over half of `CELLS`
    Locked
        the workbook is locked with a password
    OSError
        the file is damaged
    """
    stream = workbook_stream(content)
    ends = corners(stream)
    largest = max(ends, key=lambda corner: corner.cells, default=Corner(0, 0))
    _refuse_reach(path, largest, sum(corner.cells for corner in ends), most=CELLS // 2)
    return compound(stream)


def _refuse_reach(path: Path, corner: Corner, cells: int, *, most: int = CELLS) -> None:
    """Refuse a sheet that ends where none can, and more cells than there is room for (LogError)."""
    if not corner.possible or cells > most:
        raise LogError(
            f"{path.name}: a sheet reaches to row {corner.rows:.7g} and column {corner.columns:.7g}; at most {most} cells "
            "are read; delete the stray cells outside the table or export the sheet as CSV."
        )


def _refuse_lie(path: Path, beginning: bytes, size: int) -> None:
    """Refuse shared texts that claim to be more than their bytes: room would be made for all of them (LogError)."""
    claimed = texts_claimed(beginning)
    if claimed > size:
        raise LogError(
            f"{path.name}: the workbook is damaged: it claims {claimed} texts in {size} bytes; a whole .xlsx or .xlsb "
            "was expected; open it in a spreadsheet program and save it again, or export the sheet as CSV."
        )


def _reach_of(part: str) -> Callable[[Iterable[bytes]], Corner]:
    """How to find the last cell of a part by its name."""
    if part.startswith("xl/worksheets/") and part.endswith(".bin"):
        return binary_corner
    return repeated_corner if part == "content.xml" else named_corner


def _workbook(path: Path, content: bytes) -> CalamineWorkbook:
    try:
        return CalamineWorkbook.from_filelike(io.BytesIO(content))
    except CalamineError:
        if is_compound(content):
            raise
        return CalamineWorkbook.from_path(path)  # by its name alone is one with a password told from a damaged one


def _best_sheet(path: Path, content: bytes) -> tuple[Layout, list[Row]]:
    """Pick the sheet whose table has the most named columns over numbers, the longer one of two alike; and the cells of those
    columns below the names."""
    best: tuple[Layout, list[Row]] | None = None
    rank = (0, 0)
    with _workbook(path, content) as book:
        for name in book.sheet_names:
            sheet = book.get_sheet_by_name(name)
            layout = find_table(list(islice(sheet.iter_rows(), ROWS_SEARCHED + ROWS_LOOKED_AT)))
            if layout is not None and (layout.share, sheet.height) > rank:
                rank = (layout.share, sheet.height)
                named = ([row[j] for j in layout.columns] for row in islice(sheet.iter_rows(), layout.first, None))
                best = layout, without_empty_end(list(named), layout.headers)
    if best is None:
        raise LogError(
            f"{path.name}: no sheet has a row of names over columns of numbers; one such table was expected; "
            "write the channels' names into the row above their first values."
        )
    return best


def _load(rows: Sequence[Row], wanted: Sequence[int], time: int | None) -> Table:
    """Hand over the wanted columns as numbers and the time column as what it holds."""
    values = {i: _numbers([row[i] for row in rows]) for i in wanted}
    if time is None:
        return Table(values)
    cells = [row[time] for row in rows]
    if any(isinstance(cell, dt.date | dt.time | dt.timedelta) for cell in cells):
        t = np.array([seconds(cell) for cell in cells])
        return Table(values, stamps=t - t[np.isfinite(t)][0], stamped=True)
    if any(is_name(cell) for cell in cells):
        return Table(values, stamps=[str(cell) for cell in cells])
    return Table(values, stamps=_numbers(cells))


def _numbers(cells: Sequence[Cell]) -> Signal:
    if {*map(type, cells)} <= {float, int}:
        return np.array(cells, dtype=np.float64)
    return np.array([number(cell) for cell in cells], dtype=np.float64)
