"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, its names, its units and its cells."""

from __future__ import annotations

import datetime as dt
import re
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import msgspec
import numpy as np
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from winchcascade.core.errors import LogError
from winchcascade.core.quantity import find_unit
from winchcascade.core.run import Signal
from winchcascade.ingest.cells import looks_like_a_stamp
from winchcascade.ingest.dialects import Header, recognise
from winchcascade.ingest.source import MIN_ROWS, LogSource, LogTable, choose, damage_reported, moves, without_notes

Cell = int | float | str | bool | dt.time | dt.date | dt.datetime | dt.timedelta
Row = Sequence[Cell]

ROWS_SEARCHED = 200
ROWS_LOOKED_AT = 20
"""Rows at the top in which the names may stand, and rows below them that distinguish numbers from prose."""

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")

_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}(?:(?:,\d{3})+|(?:\.\d{3})+)")


class SheetLayout(msgspec.Struct, frozen=True):
    """Where the table of a sheet lies: its names, their units, its first row, how many names stand over data.

    A column of data without a name to the left of the first name, the index of a data frame, comes last.
    """

    columns: tuple[int, ...]
    headers: tuple[Header, ...]
    first: int
    share: int


def find_table(rows: Sequence[Row]) -> SheetLayout | None:
    """Find the row of names by its content: right above data, with the most names that stand over numbers or stamps."""
    best: SheetLayout | None = None
    for k in range(min(len(rows), ROWS_SEARCHED)):
        units = k + 1 < len(rows) and _is_units(rows[k + 1])
        first = next((n for n in range(k + 1 + units, len(rows)) if any(cell != "" for cell in rows[n])), len(rows))
        columns = tuple(j for j, cell in enumerate(rows[k]) if is_name(cell))
        share = sum(_holds_data(rows[first : first + ROWS_LOOKED_AT], j) for j in columns)
        if share > (best.share if best else 0) and any(_is_datum(cell) for cell in rows[first]):
            index = columns[0] - 1  # the index of a data frame has data and no name
            if index >= 0 and rows[k][index] == "" and _holds_data(rows[first : first + ROWS_LOOKED_AT], index):
                columns += (index,)
            headers = (Header(str(rows[k][j]).strip(), _unit(rows[k + 1][j]) if units else None) for j in columns)
            best = SheetLayout(columns, tuple(headers), first, share)
    return best


def number_columns(layout: SheetLayout | None, rows: Sequence[Row]) -> SheetLayout | None:
    """Lay out a table whose columns a rig file numbers: all columns from the first of the sheet on, with or without names.

    Parameters
    ----------
    layout : table that names were found for; None where the sheet has none
    """
    named = layout is not None and layout.share >= 2
    first = layout.first if layout is not None and named else _first_data(rows)
    if first is None:
        return layout
    below = rows[first : first + ROWS_LOOKED_AT]
    data = [j for j in range(len(rows[first])) if _holds_data(below, j)]
    headers = {j: Header(f"column {j + 1}") for j in data}
    above = rows[first - 1] if first else ()
    if _only_units(above) and (layout is None or all(header.unit is None for header in layout.headers)):
        headers = {j: Header(header.name, _unit(above[j])) for j, header in headers.items()}
    elif layout is not None and named:
        headers |= dict(zip(layout.columns, layout.headers, strict=True))
    columns = tuple(range(len(rows[first])))
    return SheetLayout(columns, tuple(headers.get(j, Header("")) for j in columns), first, len(data))


def _only_units(row: Row) -> bool:
    """Whether a row above numbers holds units and no names; single letters such as t, F and V may be both and are names."""
    texts = [text for cell in row if (text := _unit(cell)) is not None]
    channels = sum(recognise(Header(text)) is not None for text in texts)
    return channels < len(texts) == sum(find_unit(text) is not None for text in texts)


def _first_data(rows: Sequence[Row]) -> int | None:
    """First of two rows in a row with several numbers or stamps in the same columns; None without such rows."""
    filled = [{j for j, cell in enumerate(row) if cell != "" and _is_datum(cell)} for row in rows]
    return next((k for k, (a, b) in enumerate(pairwise(filled)) if len(a & b) >= 2), None)


def is_name(cell: Cell) -> bool:
    """Whether a cell is a text that is no number."""
    return isinstance(cell, str) and bool(cell.strip()) and _NUMBER.fullmatch(cell.strip()) is None


def _is_units(row: Row) -> bool:
    """Whether a row holds units: nothing but texts, at least half of them known units."""
    filled = [cell for cell in row if cell != ""]
    texts = [cell for cell in filled if isinstance(cell, str)]
    known = [text for text in texts if find_unit(_unit(text) or "") is not None]
    return 0 < len(filled) == len(texts) <= 2 * len(known)


def _unit(cell: Cell) -> str | None:
    """Strip the brackets around a unit; None for an empty cell."""
    text = str(cell).strip()
    inner = re.fullmatch(r"\[(.*)\]|\((.*)\)", text)
    return (inner[1] or inner[2] or "" if inner else text).strip() or None


def _holds_data(rows: Sequence[Row], j: int) -> bool:
    """Whether a column holds numbers or stamps: at least half of what is filled below the name, and something is."""
    filled = [row[j] for row in rows if row[j] != ""]
    return 0 < len(filled) <= 2 * sum(_is_datum(cell) for cell in filled)


def _is_datum(cell: Cell) -> bool:
    """Whether a cell is a number or a stamp, also one written as text such as 2026-03-01 10:00:00,040."""
    return not isinstance(cell, str) or (
        cell.strip() != "" and (not is_name(cell) or re.search(r"\d[:/.\-]\d", cell) is not None)
    )


def cell_number(cell: Cell) -> float:
    """Read a cell as a number, decimal comma included; NaN for anything else."""
    if isinstance(cell, int | float):
        return float(cell)
    text = cell.strip() if isinstance(cell, str) else ""
    if "," in text and "." in text:
        text = text.replace(min(",.", key=text.find), "")  # the sign that comes first parts thousands
    return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else float("nan")


def cell_numbers(cells: Sequence[Cell]) -> Signal:
    """Read a column as numbers, NaN where there is none; whether 1,234 is a decimal or a group of thousands is decided over it.

    Cells of one reading alone decide: of two numbers, the one that continues them is meant. Without any it is a decimal.

    >>> cell_numbers(["987", "998.5", "1,004"]).tolist(), cell_numbers(["0,987", "0,998", "1,004"]).tolist()
    ([987.0, 998.5, 1004.0], [0.987, 0.998, 1.004])
    """
    if {*map(type, cells)} <= {float, int}:
        return np.array(cells, dtype=np.float64)
    read = np.array([cell_number(cell) for cell in cells], dtype=np.float64)
    texts = (cell.strip() if isinstance(cell, str) else "" for cell in cells)
    grouped = np.array([float(re.sub("[.,]", "", text)) if _GROUPS.fullmatch(text) else np.nan for text in texts])
    two = np.isfinite(grouped) & np.isfinite(read)
    certain = np.flatnonzero(np.isfinite(read) & ~two)
    if two.any() and certain.size:
        rows = np.flatnonzero(two)
        after = np.searchsorted(certain, rows)
        around = np.column_stack((np.maximum(after - 1, 0), np.minimum(after, certain.size - 1)))
        apart = np.min(np.abs(rows[:, None] - certain[around]), axis=1)
        near = rows[apart == apart.min()]  # farther ones may have gone anywhere since
        expected = np.interp(near, certain, read[certain])
        nearer = np.abs(grouped[near] - expected) < np.abs(read[near] - expected)
        if 2 * np.count_nonzero(nearer) > near.size:
            read[rows] = grouped[rows]
    return np.where(np.isfinite(read), read, grouped)


_EPOCH = (dt.datetime(1970, 1, 1) - dt.datetime(1899, 12, 30)).total_seconds()
"""Beginning of 1970 on the calendar of spreadsheets. [s]"""


def cell_seconds(cell: Cell) -> float:
    """Read a cell as seconds on the calendar of spreadsheets; NaN for one that is no time. [s]"""
    if isinstance(cell, dt.time):
        cell = dt.datetime.combine(dt.date.min, cell) - dt.datetime.min
    elif isinstance(cell, dt.date):
        moment = cell if isinstance(cell, dt.datetime) else dt.datetime.combine(cell, dt.time())
        # Day 60 of that calendar is a 29 February 1900 that never was: a duration of more than a day lies before it.
        cell = moment - dt.datetime(1899, 12, 31 if moment < dt.datetime(1900, 3, 1) else 30)
    return cell.total_seconds() if isinstance(cell, dt.timedelta) else float("nan")


_LOCKED = "EncryptedPackage".encode("utf-16-le")
"""Name of the stream that holds a workbook with a password."""


def open_excel(path: Path, *, table: str | None = None, numbered: bool = False) -> LogSource:
    """Open the sheet that holds a log, hidden ones included.

    Parameters
    ----------
    table : name or number of the sheet; without it exactly one may hold what could be a log
    numbered : the rig file numbers the columns as the sheet does, so that they need no names

    Raises
    ------
    LogError
        the workbook is damaged or locked, no sheet holds a table, or several do and none is named
    """
    with damage_reported(
        path,
        ".xlsx, .xls, .xlsb or .ods",
        "open it in a spreadsheet program and save it again, or export the sheet as CSV",
        called="workbook",
    ):
        if zipfile.is_zipfile(path):
            _check_parts(path)
        sheet = _sheet(path, table, numbered=numbered)
    return LogSource(headers=sheet.layout.headers, load=partial(_load, sheet.rows), table=sheet.name)


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
            with parts.open("content.xml") as cells:
                expat.ParserCreate().ParseFile(cells)


def _workbook(path: Path) -> CalamineWorkbook:
    """Open a workbook by its content: its name may end in anything."""
    try:
        with path.open("rb") as file, suppress(CalamineError):
            return CalamineWorkbook.from_filelike(file)
        if _LOCKED not in path.read_bytes():
            return CalamineWorkbook.from_path(path)  # an .xls with a password is recognised by its name alone
    except PasswordError:
        pass
    raise LogError(
        f"{path.name}: the workbook is locked with a password; one that opens without was expected; "
        "save it without the password or export the sheet as CSV."
    )


class _Sheet(NamedTuple):
    """A sheet with a table: the cells of its named columns below the names."""

    name: str
    layout: SheetLayout
    rows: list[Row]

    @property
    def rank(self) -> int:
        """3 for a table with motion and time, 2 for one with motion, 1 for one as long as a log, 0 for a list."""
        if len(self.rows) < MIN_ROWS or self.layout.share < 2:
            return 0
        clocked = any(recognise(header) == "time" or not header.name for header in self.layout.headers)
        return 1 + moves(self.layout.headers) * (1 + clocked)


def _sheet(path: Path, table: str | None, *, numbered: bool) -> _Sheet:
    """Read the sheet that is named or else the only one that could be a log.

    Where sheets have a motion and a clock, those that lack either are notes, parameters or results.
    """
    with _workbook(path) as book:
        wanted = None if table is None else choose(book.sheet_names, table, path.name, "sheet")
        read = (_read_sheet(book, name, numbered=numbered) for name in book.sheet_names if wanted in (None, name))
        sheets = [sheet for sheet in read if sheet is not None]
    if not sheets:
        which = "no sheet has" if wanted is None else f"the sheet {wanted!r} does not have"
        raise LogError(
            f"{path.name}: {which} a row of names over columns of numbers; one such table was expected; "
            "write the channels' names into the row above their first values, or number the columns in a rig file: [columns] "
            'velocity = { number = 3, unit = "m/s" }.'
        )
    rank = max(sheet.rank for sheet in sheets)
    if rank == 0:  # no log among them: the largest table shows best what is missing
        return max(sheets, key=lambda sheet: (sheet.layout.share, len(sheet.rows)))
    could_be = {sheet.name: sheet for sheet in sheets if sheet.rank == rank}
    return could_be[choose(list(could_be), wanted, path.name, "sheet")]


def _read_sheet(book: CalamineWorkbook, name: str, *, numbered: bool) -> _Sheet | None:
    """Find the table of a sheet and take its cells; None for a sheet without one."""
    sheet = book.get_sheet_by_name(name)
    top: list[Row] = list(islice(sheet.iter_rows(), ROWS_SEARCHED + ROWS_LOOKED_AT))
    # The cells of a sheet begin at its first used column; numbers count from column A on.
    left = [""] * sheet.start[1] if numbered and sheet.start is not None else []
    if numbered:
        top = [[*left, *row] for row in top]
    layout = number_columns(find_table(top), top) if numbered else find_table(top)
    if layout is None:
        return None
    below = islice(sheet.iter_rows(), layout.first, None)
    rows: list[Row] = [
        [cells[j] for j in layout.columns] for row in below for cells in ([*left, *row] if left else row,)
    ]
    named = [j for j, header in enumerate(layout.headers) if header.name]
    while rows and all(rows[-1][j] == "" for j in named):
        rows.pop()
    return _Sheet(name, layout, rows)


def _load(rows: Sequence[Row], wanted: Sequence[int], time: int | None) -> LogTable:
    """Hand over the wanted columns as numbers and the time column as what it holds."""
    values = {i: cell_numbers([row[i] for row in rows]) for i in wanted}
    if time is None:
        return LogTable(values)
    cells = [row[time] for row in rows]
    if any(isinstance(cell, dt.date | dt.time | dt.timedelta) for cell in cells):
        t = np.array(list(map(cell_seconds, cells)))
        first = float(t[np.isfinite(t)][0])
        began = first - _EPOCH if first > _EPOCH else None
        return without_notes(LogTable(values, stamps=t - first, stamped=True, began=began))
    texts = [str(cell) for cell in cells]
    names = [text for text, cell in zip(texts, cells, strict=True) if is_name(cell)]  # stamps, or notes among numbers
    filled = sum(text.strip() != "" for text in texts)
    stamped = any(map(looks_like_a_stamp, names)) or 0 < len(names) == filled
    return without_notes(LogTable(values, stamps=texts if stamped else cell_numbers(cells)))
