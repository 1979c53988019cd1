"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, its names, its units and its cells."""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from winchcascade.errors import LogError
from winchcascade.ingest.cells import is_stamp
from winchcascade.ingest.choice import FEWEST_ROWS, choose, moves
from winchcascade.ingest.dialects import recognise
from winchcascade.ingest.sheet import (
    ROWS_LOOKED_AT,
    ROWS_SEARCHED,
    Cell,
    Layout,
    Row,
    find_table,
    is_name,
    numbers,
    seconds,
    without_empty_end,
)
from winchcascade.ingest.source import Source, Table

_LOCKED = "EncryptedPackage".encode("utf-16-le")
"""Name of the stream that holds a workbook with a password."""

_PIECE = 1 << 20


def open_excel(path: Path, *, table: str | None = None) -> Source:
    """Open the sheet that holds a log, hidden ones included.

    Parameters
    ----------
    table : name or number of the sheet; without it exactly one may hold what could be a log

    Raises
    ------
    LogError
        the workbook is damaged or locked, no sheet holds a table, or several do and none is named
    """
    with _told(path):
        if zipfile.is_zipfile(path):
            _check_parts(path)
        sheet = _sheet(path, table)
    return Source(headers=sheet.layout.headers, load=partial(_load, sheet.rows), table=sheet.name)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn whatever the parser trips over into one sentence."""
    try:
        yield
    except (LogError, MemoryError, KeyboardInterrupt, SystemExit):
        raise
    except PasswordError as fault:
        raise LogError(
            f"{path.name}: the workbook is locked with a password; one that opens without was expected; "
            "save it without the password or export the sheet as CSV."
        ) from fault
    except BaseException as fault:  # a panic of the Rust reader is no Exception
        raise LogError(
            f"{path.name}: the workbook is damaged or breaks off ({type(fault).__name__}); a whole .xlsx, .xls, .xlsb "
            "or .ods was expected; open it in a spreadsheet program and save it again, or export the sheet as CSV."
        ) from fault


def _check_parts(path: Path) -> None:
    """Check the parts of a zipped workbook: the reader skips the checksum of a part that it does not read to its end.

    Raises
    ------
    BadZipFile : a part differs from its checksum
    ExpatError : the cells of LibreOffice are not well-formed; the reader would wait for the end of their table for ever
    """
    with zipfile.ZipFile(path) as parts:
        damaged = parts.testzip()
        if damaged is not None:
            raise zipfile.BadZipFile(damaged)
        if "content.xml" in parts.namelist():
            parser = expat.ParserCreate()
            with parts.open("content.xml") as cells:
                for piece in iter(partial(cells.read, _PIECE), b""):
                    parser.Parse(piece)
            parser.Parse(b"", True)


def _workbook(path: Path) -> CalamineWorkbook:
    """Open a workbook by its content: its name may end in anything."""
    with path.open("rb") as file:
        try:
            return CalamineWorkbook.from_filelike(file)
        except CalamineError as fault:
            file.seek(0)
            if _LOCKED in file.read():
                raise PasswordError from fault
    return CalamineWorkbook.from_path(path)  # an .xls with a password is recognised by its name alone


class _Sheet(NamedTuple):
    """A sheet with a table: the cells of its named columns below the names."""

    name: str
    layout: Layout
    rows: list[Row]

    @property
    def rank(self) -> int:
        """3 for a table with motion and time, 2 for one with motion, 1 for one as long as a log, 0 for a list."""
        if len(self.rows) < FEWEST_ROWS or self.layout.share < 2:
            return 0
        headers = self.layout.headers
        clocked = any(recognise(header) == "time" or not header.name for header in headers)
        return 1 + moves(headers) + (moves(headers) and clocked)


def _sheet(path: Path, table: str | None) -> _Sheet:
    """Read the sheet that is named or else the only one that could be a log.

    Where sheets have a motion and a clock, those that lack either are notes, parameters or results.
    """
    with _workbook(path) as book:
        names = list(book.sheet_names)
        wanted = None if table is None else choose(names, table, path.name, "sheet")
        sheets = [found for name in names if wanted in (None, name) and (found := _read_sheet(book, name)) is not None]
    if not sheets:
        which = "no sheet has" if wanted is None else f"the sheet {wanted!r} does not have"
        raise LogError(
            f"{path.name}: {which} a row of names over columns of numbers; one such table was expected; "
            "write the channels' names into the row above their first values."
        )
    rank = max(sheet.rank for sheet in sheets)
    if rank == 0:  # no log among them: the largest table says best what is missing
        return max(sheets, key=lambda sheet: (sheet.layout.share, len(sheet.rows)))
    could_be = {sheet.name: sheet for sheet in sheets if sheet.rank == rank}
    return could_be[choose(list(could_be), wanted, path.name, "sheet")]


def _read_sheet(book: CalamineWorkbook, name: str) -> _Sheet | None:
    """Find the table of a sheet and take its cells; None for a sheet without one."""
    sheet = book.get_sheet_by_name(name)
    layout = find_table(list(islice(sheet.iter_rows(), ROWS_SEARCHED + ROWS_LOOKED_AT)))
    if layout is None:
        return None
    named = ([row[j] for j in layout.columns] for row in islice(sheet.iter_rows(), layout.first, None))
    return _Sheet(name, layout, without_empty_end(list(named), layout.headers))


def _load(rows: Sequence[Row], wanted: Sequence[int], time: int | None) -> Table:
    """Hand over the wanted columns as numbers and the time column as what it holds."""
    values = {i: numbers([row[i] for row in rows]) for i in wanted}
    if time is None:
        return Table(values)
    cells = [row[time] for row in rows]
    if any(isinstance(cell, dt.date | dt.time | dt.timedelta) for cell in cells):
        t = np.array([seconds(cell) for cell in cells])
        return Table(values, stamps=t - t[np.isfinite(t)][0], stamped=True)
    if _stamped(cells):
        return Table(values, stamps=[str(cell) for cell in cells])
    return Table(values, stamps=numbers(cells))


def _stamped(cells: Sequence[Cell]) -> bool:
    """Whether a column without dates holds stamps as texts, notes among its numbers left out."""
    names = [cell for cell in cells if is_name(cell)]
    return bool(names) and (any(is_stamp(str(cell)) for cell in names) or len(names) == len(cells))
