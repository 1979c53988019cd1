"""Workbooks (.xlsx, .xls, .xlsb, .ods): the sheet that holds a table, its names, its units and its cells."""

from __future__ import annotations

import datetime as dt
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from python_calamine import CalamineError, CalamineWorkbook, PasswordError

from winchcascade.errors import LogError
from winchcascade.ingest.source import Header, Source, Table
from winchcascade.quantity import find_unit

if TYPE_CHECKING:
    from winchcascade.run import Signal

Cell = int | float | str | bool | dt.time | dt.date | dt.datetime | dt.timedelta
Row = Sequence[Cell]

BYTES_UNPACKED = 500 * 2**20
"""Most that a zipped workbook may hold once unpacked."""

CELLS = 50_000_000
"""Most cells between the first and the last of a sheet: the reader lays them out densely, 32 bytes each."""

ROWS_SEARCHED = 200
ROWS_LOOKED_AT = 20
"""Rows at the top in which the names may stand, and rows below them that tell numbers from prose."""

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_CELL_NAME = re.compile(rb'<(?:\w+:)?c [^>]*?\br="([A-Z]{1,3})(\d{1,7})"')


@dataclass(frozen=True, slots=True)
class _Layout:
    """Where the table of a sheet lies: its names, their units, its first row, how many names stand over data."""

    columns: tuple[int, ...]
    headers: tuple[Header, ...]
    first: int
    share: int


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
        name, layout, rows = _best_sheet(path, content)
    return Source(
        headers=layout.headers,
        load=partial(_load, layout, rows),
        form=f"Excel workbook, sheet {name!r}",
    )


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn whatever the parser trips over into one sentence."""
    try:
        yield
    except (LogError, KeyboardInterrupt, SystemExit):
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


def _refuse_bomb(path: Path, content: bytes) -> None:
    """Unpack every part once, a piece at a time: sizes, checksums and the corner of the sheets.

    Raises
    ------
    LogError
        the parts are larger than `BYTES_UNPACKED`, or a stray cell stretches a sheet over `CELLS` cells
    """
    with zipfile.ZipFile(io.BytesIO(content)) as parts:
        size = sum(part.file_size for part in parts.infolist())
        if size > BYTES_UNPACKED:
            raise LogError(
                f"{path.name}: the workbook unpacks to {size / 2**20:.0f} MB; at most {BYTES_UNPACKED / 2**20:.0f} MB "
                "are read; export the sheet as CSV."
            )
        for part in parts.infolist():
            with parts.open(part) as stream:
                rows, columns = _corner(iter(partial(stream.read, 2**20), b""))
            if rows * columns > CELLS:
                raise LogError(
                    f"{path.name}: a sheet reaches to row {rows} and column {columns}; at most {CELLS} cells are read; "
                    "delete the stray cells outside the table or export the sheet as CSV."
                )


def _corner(pieces: Iterable[bytes]) -> tuple[int, int]:
    """Find the last row and the last column that the XML of a sheet names; (0, 0) for another part."""
    rows = columns = 0
    tail = b""
    for piece in pieces:
        seen = set(_CELL_NAME.findall(tail + piece))
        rows = max(rows, *(int(row) for _, row in seen), 0)
        columns = max(columns, *(_column_number(letters) for letters in {letters for letters, _ in seen}), 0)
        tail = piece[-200:]  # a cell's name may be cut between two pieces
    return rows, columns


def _column_number(letters: bytes) -> int:
    """Count the columns up to one that is named by letters, A being 1."""
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number


def _workbook(path: Path, content: bytes) -> CalamineWorkbook:
    try:
        return CalamineWorkbook.from_filelike(io.BytesIO(content))
    except CalamineError:
        return CalamineWorkbook.from_path(path)  # by its name alone is one with a password told from a damaged one


def _best_sheet(path: Path, content: bytes) -> tuple[str, _Layout, list[Row]]:
    """Pick the sheet whose table has the most named columns over numbers, the longer one of two alike."""
    best: tuple[str, _Layout, list[Row]] | None = None
    rank = (0, 0)
    with _workbook(path, content) as book:
        for name in book.sheet_names:
            sheet = book.get_sheet_by_name(name)
            layout = _find_table(list(islice(sheet.iter_rows(), ROWS_SEARCHED + ROWS_LOOKED_AT)))
            if layout is not None and (layout.share, sheet.height) > rank:
                rank = (layout.share, sheet.height)
                best = name, layout, _without_empty_end(list(sheet.iter_rows()), layout)
    if best is None:
        raise LogError(
            f"{path.name}: no sheet has a row of names over columns of numbers; one such table was expected; "
            "write the channels' names into the row above their first values."
        )
    return best


def _find_table(rows: Sequence[Row]) -> _Layout | None:
    """Find the row of names by its content: right above data, with the most names that stand over numbers or stamps."""
    best: _Layout | None = None
    for k in range(min(len(rows), ROWS_SEARCHED)):
        units = k + 1 < len(rows) and _is_units(rows[k + 1])
        first = next((n for n in range(k + 1 + units, len(rows)) if any(cell != "" for cell in rows[n])), len(rows))
        columns = tuple(j for j, cell in enumerate(rows[k]) if _is_name(cell))
        share = sum(_holds_data(rows[first : first + ROWS_LOOKED_AT], j) for j in columns)
        if share > (best.share if best else 0) and any(_is_datum(cell) for cell in rows[first]):
            headers = tuple(Header(str(rows[k][j]).strip(), _unit(rows[k + 1][j]) if units else None) for j in columns)
            best = _Layout(columns, headers, first, share)
    return best


def _is_name(cell: Cell) -> bool:
    return isinstance(cell, str) and bool(cell.strip()) and _NUMBER.fullmatch(cell.strip()) is None


def _is_units(row: Row) -> bool:
    """Tell a row of units: nothing but texts, at least half of them known units."""
    filled = [cell for cell in row if cell != ""]
    texts = [cell for cell in filled if isinstance(cell, str)]
    known = sum(find_unit(_unit(text) or "") is not None for text in texts)
    return bool(filled) and len(texts) == len(filled) and 2 * known >= len(filled)


def _unit(cell: Cell) -> str | None:
    """Strip the brackets around a unit; None for an empty cell."""
    text = str(cell).strip()
    inner = re.fullmatch(r"\[(.*)\]|\((.*)\)", text)
    return (inner[1] or inner[2] or "" if inner else text).strip() or None


def _holds_data(rows: Sequence[Row], j: int) -> bool:
    """Tell a column of numbers or stamps: at least half of what is filled below the name, and something is."""
    filled = [row[j] for row in rows if row[j] != ""]
    return 0 < len(filled) <= 2 * sum(_is_datum(cell) for cell in filled)


def _is_datum(cell: Cell) -> bool:
    """Tell a number or a stamp, also one written as text such as 2026-03-01 10:00:00,040."""
    if not isinstance(cell, str):
        return True
    return cell.strip() != "" and (not _is_name(cell) or re.search(r"\d[:/.\-]\d", cell) is not None)


def _without_empty_end(rows: list[Row], layout: _Layout) -> list[Row]:
    """Drop the rows below the table that have nothing in any named column."""
    end = len(rows)
    while end > layout.first and all(rows[end - 1][j] == "" for j in layout.columns):
        end -= 1
    return rows[:end]


def _load(layout: _Layout, rows: Sequence[Row], wanted: Sequence[int], time: int | None) -> Table:
    """Hand over the wanted columns as numbers and the time column as what it holds."""
    data = rows[layout.first :]
    values = {i: _numbers([row[layout.columns[i]] for row in data]) for i in wanted}
    if time is None:
        return Table(values)
    cells = [row[layout.columns[time]] for row in data]
    if any(isinstance(cell, dt.date | dt.time | dt.timedelta) for cell in cells):
        seconds = np.array([_seconds(cell) for cell in cells])
        known = seconds[np.isfinite(seconds)]
        return Table(values, stamps=seconds - known[0], stamped=True)
    if any(_is_name(cell) for cell in cells):
        return Table(values, stamps=[str(cell) for cell in cells])
    return Table(values, stamps=_numbers(cells))


def _numbers(cells: Sequence[Cell]) -> Signal:
    return np.array([_number(cell) for cell in cells], dtype=np.float64)


def _number(cell: Cell) -> float:
    """Read a cell as a number, decimal comma included; NaN for anything else."""
    if isinstance(cell, int | float):
        return float(cell)
    if not isinstance(cell, str):
        return float("nan")
    text = cell.strip()
    if "," in text and "." in text:
        text = text.replace(min(",.", key=text.find), "")  # the sign that comes first parts thousands
    return float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else float("nan")


def _seconds(cell: Cell) -> float:
    """Read a cell as seconds on the calendar of spreadsheets; NaN for one that is no time. [s]"""
    if isinstance(cell, dt.timedelta):
        return cell.total_seconds()
    if isinstance(cell, dt.time):
        return (dt.datetime.combine(dt.date.min, cell) - dt.datetime.min).total_seconds()
    if not isinstance(cell, dt.date):
        return float("nan")
    moment = cell if isinstance(cell, dt.datetime) else dt.datetime.combine(cell, dt.time())
    # Day 60 of that calendar is a 29 February 1900 that never was: a duration of more than a day lies before it.
    zero = dt.datetime(1899, 12, 31) if moment < dt.datetime(1900, 3, 1) else dt.datetime(1899, 12, 30)
    return (moment - zero).total_seconds()
