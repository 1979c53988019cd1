"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, its names, its units and its cells."""

from __future__ import annotations

import datetime as dt
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from itertools import islice
from pathlib import Path
from xml.parsers import expat

import numpy as np
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from winchcascade.errors import LogError
from winchcascade.ingest.cells import is_stamp
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


def open_excel(path: Path) -> Source:
    """Open the sheet with the most named columns over numbers.

    Raises
    ------
    LogError
        the workbook is damaged or locked, or no sheet holds a table
    """
    with _told(path):
        if zipfile.is_zipfile(path):
            _check_parts(path)
        layout, rows = _best_sheet(path)
    return Source(
        headers=layout.headers,
        load=partial(_load, rows),
    )


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


def _best_sheet(path: Path) -> tuple[Layout, list[Row]]:
    """Pick the sheet whose table has the most named columns over numbers, the longer one of two alike; and the cells of those
    columns below the names."""
    best: tuple[Layout, list[Row]] | None = None
    rank = (0, 0)
    with _workbook(path) as book:
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
