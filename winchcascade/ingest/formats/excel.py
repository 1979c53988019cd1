"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, and its cells; the layout
is found as that of a text.
"""

from __future__ import annotations

import datetime as dt
import re
import zipfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, TypeAlias
from xml.parsers import expat

import numpy as np
import pyarrow as pa
from python_calamine import CalamineError, CalamineSheet, CalamineWorkbook, PasswordError

from winchcascade.core.errors import LogError
from winchcascade.ingest.cells import decimal_sign, looks_like_a_number, number
from winchcascade.ingest.headers import Header, nameless, recognise
from winchcascade.ingest.layout import (
    HEADING_ROWS,
    find_data,
    headers_above,
    properties_of,
    waveform,
)
from winchcascade.ingest.limits import require_numbers, require_unpacked
from winchcascade.ingest.source import MIN_ROWS, arrow_table, choose, damage_reported, moves
from winchcascade.ingest.stamps import looks_like_a_stamp

Cell: TypeAlias = int | float | str | bool | dt.time | dt.date | dt.datetime | dt.timedelta

_LOCKED = "EncryptedPackage".encode("utf-16-le")
"""Name of the stream that holds a workbook with a password."""

_GROUPS = re.compile(r"[+-]?[1-9]\d{0,2}(?:,\d{3})+")
"""Digits in groups of three, set apart by commas."""

_DAY_ZERO = dt.datetime(1899, 12, 30)
"""Day 0 of the calendar of spreadsheets, after the 29 February 1900 that it counts and that
never was.
"""


class _Sheet(NamedTuple):
    """A sheet with a table: its columns in their order, what stands above it, and the cells
    below the names.
    """

    name: str
    headers: list[Header]
    properties: dict[str, str]
    rows: list[list[Cell]]

    @property
    def rank(self) -> int:
        """3 for a table with motion and time, 2 for one with motion, 1 for one as long as a log,
        0 for a list.
        """
        if len(self.rows) < MIN_ROWS or sum(bool(header.name) for header in self.headers) < 2:
            return 0
        clocked = any(recognise(header) == "time" or not header.name for header in self.headers)
        return 1 + moves(self.headers) * (1 + clocked)


def read_excel(path: Path, *, table: str | None = None, numbered: bool = False) -> pa.Table:
    """Read the sheet that is named, or else the only one that could be a log, hidden ones included.

    Where sheets have a motion and a clock, those that lack either are notes, parameters or results.

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
        path, "workbook", "save it again in a spreadsheet program, or export the sheet as CSV"
    ):
        if zipfile.is_zipfile(path):
            _check_parts(path)
        with _workbook(path) as book:
            wanted = None if table is None else choose(book.sheet_names, table, path.name, "sheet")
            names = [name for name in book.sheet_names if wanted in (None, name)]
            found = (
                _table(book.get_sheet_by_name(name), path, numbered=numbered) for name in names
            )
            sheets = [sheet for sheet in found if sheet is not None]
    if not sheets:
        which = "no sheet has" if wanted is None else f"the sheet {wanted!r} does not have"
        raise LogError(
            f"{path.name}: {which} a row of names over columns of numbers; one such table was "
            f"expected; "
            "write the channels' names into the row above their first values, or number the "
            "columns in a rig file: [columns] "
            'velocity = { number = 3, unit = "m/s" }.'
        )
    rank = max(sheet.rank for sheet in sheets)
    could_be = {sheet.name: sheet for sheet in sheets if sheet.rank == rank}
    if rank == 0:  # no log among them: the largest table shows best what is missing
        sheet = max(sheets, key=lambda sheet: (len(sheet.headers), len(sheet.rows)))
    else:
        sheet = could_be[choose(list(could_be), wanted, path.name, "sheet")]
    step, start = waveform(sheet.properties)
    columns = [_column([row[k] for row in sheet.rows]) for k in range(len(sheet.headers))]
    return arrow_table(
        sheet.headers,
        columns,
        time_step=step,
        time_start=start,
        properties=sheet.properties,
        table=sheet.name,
    )


def _check_parts(path: Path) -> None:
    """Check the parts of a zipped workbook: the reader skips the checksum of a part that it does
    not read to its end.

    Raises
    ------
    LogError : the parts unpack to too much
    BadZipFile : a part differs from its checksum
    ExpatError : the cells of LibreOffice are not well-formed; the reader would wait for the end of
        their table for ever
    """
    with zipfile.ZipFile(path) as parts:
        require_unpacked(path, sum(part.file_size for part in parts.infolist()))
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
            return CalamineWorkbook.from_path(
                path
            )  # an .xls with a password is recognised by its name alone
    except PasswordError:
        pass
    raise LogError(
        f"{path.name}: the workbook is locked with a password; one that opens without was "
        f"expected; "
        "save it without the password or export the sheet as CSV."
    )


def _table(sheet: CalamineSheet, path: Path, *, numbered: bool) -> _Sheet | None:
    """The table of a sheet, if it has one."""
    require_numbers(path, sheet.total_height, sheet.total_width)
    rows: list[list[Cell]] = sheet.to_python(skip_empty_area=False)
    found = find_data(lambda k: [*map(_text, rows[k])], len(rows))
    if found is None:
        return None
    first, columns = found
    head = [[*map(_text, row)] for row in rows[:first]]
    try:
        headers = headers_above(head[-HEADING_ROWS:], columns, path.name, numbered=numbered)
    except LogError:  # rows of numbers without names
        return None
    below = rows[first:]
    named = [k for k, header in enumerate(headers) if not nameless(header)] or range(len(headers))
    while below and all(below[-1][k] == "" for k in named):
        below.pop()
    return _Sheet(
        sheet.name, headers, properties_of(["\t".join(filter(None, row)) for row in head]), below
    )


def _text(cell: Cell) -> str:
    """Write a cell as a log of texts has it."""
    if isinstance(cell, dt.timedelta):
        cell = cell.total_seconds()
    if isinstance(cell, float) and cell.is_integer():
        return f"{cell:.0f}"
    return str(int(cell)) if isinstance(cell, bool) else str(cell).strip()


def _column(cells: Sequence[Cell]) -> pa.Array:
    """A column as numbers, as dates or durations, or as texts where it holds no number."""
    if any(isinstance(cell, dt.date | dt.time | dt.timedelta) for cell in cells):
        since = [*map(_since_day_zero, cells)]
        dated = max(one for one in since if one is not None) > dt.datetime(1970, 1, 1) - _DAY_ZERO
        return pa.array([_DAY_ZERO + s if s is not None else s for s in since] if dated else since)
    texts = [_text(cell) for cell in cells if isinstance(cell, str)]
    words = [text for text in texts if text and not looks_like_a_number(text)]
    if any(map(looks_like_a_stamp, words)) or 0 < len(words) == len(cells) - texts.count(""):
        return pa.array([*map(_text, cells)])
    # Digits in groups of three after a comma are thousands if other numbers of the column have
    # neither comma nor point.
    commas = [text for text in texts if "," in text and "." not in text]
    whole = any(text.strip("+-").isdecimal() for text in texts)
    decimal = "." if whole and all(map(_GROUPS.fullmatch, commas)) else decimal_sign([texts])
    return pa.array(
        np.array(
            [number(cell, decimal) if isinstance(cell, str) else float(cell) for cell in cells]  # type: ignore[arg-type]
        )
    )


def _since_day_zero(cell: Cell) -> dt.timedelta | None:
    """Read a cell as a time since day 0 of the calendar of spreadsheets; None for one that is no
    time.
    """
    if isinstance(cell, dt.time):
        return dt.datetime.combine(dt.date.min, cell) - dt.datetime.min
    if isinstance(cell, dt.date):
        moment = cell if isinstance(cell, dt.datetime) else dt.datetime.combine(cell, dt.time())
        # Before March 1900 that calendar is a day ahead: a duration of more than a day lies there.
        return moment - _DAY_ZERO - dt.timedelta(days=moment < dt.datetime(1900, 3, 1))
    return cell if isinstance(cell, dt.timedelta) else None
