"""What the reader of a file format provides: the headers first, then only the wanted columns; and the choice of one table.

Where several tables of a file could be the log, the operator names one: none is chosen silently.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.core.plain_text import first_of
from winchcascade.core.run import Finding, Signal
from winchcascade.ingest.cells import looks_like_a_stamp
from winchcascade.ingest.dialects import Header, recognise

MIN_ROWS = 10
"""A table with fewer rows than this is a list of parameters or results: it shows no motion."""

LOG_ENDINGS = frozenset("csv tsv txt dat asc log lvm tdms mat parquet pq xlsx xls xlsm xlsb ods".split())
"""Endings of files that are taken for logs among others; the reader is chosen by their content."""

MAX_NAMED = 12
"""Names that a message lists."""


class LogTable(msgspec.Struct, frozen=True):
    """The wanted columns of a file, all of one length n.

    Parameters
    ----------
    values : (n,) each, by index of the header, in the file's own unit; NaN where a cell is not a number
    stamps : (n,) numbers in the unit of the time column, or the n texts of stamps, or None without a time column
    stamped : the stamps were dates and times and are now seconds since the first one
    began : when that was, since 1970, of a local time as if it were UTC; None where the stamps have no date [s]
    """

    values: Mapping[int, Signal]
    stamps: Signal | Sequence[str] | None = None
    stamped: bool = False
    findings: tuple[Finding, ...] = ()
    began: float | None = None


class LogSource(msgspec.Struct, frozen=True):
    """An opened log: its headers, and a way to load the wanted columns.

    Parameters
    ----------
    headers : every column of the file in its order
    load : called with the indices of the wanted channels, and the index of the time column or of one of texts (or None)
    time_step : sampling interval that the file states itself (a waveform); None where stamps or nothing give it [s]
    time_start : stamp of the first sample of such a waveform [s]
    properties : what the file states about itself, such as `load_ohm`
    table : name of the sheet, variable or group that is read, where a file may hold several
    close : releases what the source holds; no column can be loaded afterwards
    """

    headers: Sequence[Header]
    load: Callable[[Sequence[int], int | None], LogTable]
    time_step: float | None = None
    time_start: float = 0.0
    properties: Mapping[str, str | float] = msgspec.field(default_factory=dict)
    close: Callable[[], object] = lambda: None
    table: str | None = None


class Column(msgspec.Struct, frozen=True):
    """A column as a file holds it.

    Parameters
    ----------
    numbers : (n,) float64, as bytes; None for a column of texts
    texts : the n texts of a column that holds hardly a number
    stamped, began : as of a `LogTable`, of a column of dates and times
    """

    numbers: bytes | None = None
    texts: list[str] = msgspec.field(default_factory=list)
    stamped: bool = False
    began: float | None = None

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.texts) if self.numbers is None else len(self.numbers) // 8

    @property
    def values(self) -> Signal:
        """The column as numbers, NaN for texts."""
        return np.full(self.size, np.nan) if self.numbers is None else np.frombuffer(self.numbers)


class Columns(msgspec.Struct, frozen=True):
    """A whole table, read at once, with what the file states about it; as `LogSource` has it."""

    headers: tuple[Header, ...]
    columns: list[Column]
    time_step: float | None = None
    time_start: float = 0.0
    properties: dict[str, str | float] = msgspec.field(default_factory=dict)
    table: str | None = None
    findings: tuple[Finding, ...] = ()


def source_of(whole: Columns) -> LogSource:
    """Make a source of a table that was read at once; rows that are notes beside a clock are left out."""

    def load(wanted: Sequence[int], time: int | None) -> LogTable:
        values = {k: whole.columns[k].values for k in wanted}
        if time is None:
            return LogTable(values, findings=whole.findings)
        clock = whole.columns[time]
        stamps = clock.texts if clock.numbers is None else clock.values
        return without_notes(LogTable(values, stamps, clock.stamped, whole.findings, clock.began))

    return LogSource(whole.headers, load, whole.time_step, whole.time_start, whole.properties, table=whole.table)


def without_notes(table: LogTable) -> LogTable:
    """Leave out rows that hold neither a stamp nor a number: notes, lines of delimiters, and names repeated where logs were
    joined.
    """
    stamps = table.stamps
    columns = [*table.values.values(), *([stamps] if isinstance(stamps, np.ndarray) else [])]
    if not columns:
        return table
    blank = np.ones(len(columns[0]), dtype=bool)
    for column in columns:
        if blank.any():
            blank &= np.isnan(column)
    if stamps is not None and not isinstance(stamps, np.ndarray):
        for k in np.flatnonzero(blank).tolist():
            blank[k] = not looks_like_a_stamp(stamps[k])
    if not blank.any():
        return table
    rows = np.flatnonzero(~blank)
    if stamps is not None:
        stamps = stamps[rows] if isinstance(stamps, np.ndarray) else [stamps[k] for k in rows.tolist()]
    return msgspec.structs.replace(table, values={k: x[rows] for k, x in table.values.items()}, stamps=stamps)


@contextmanager
def damage_reported(path: Path, form: str, remedy: str, *, called: str = "file") -> Iterator[None]:
    """Turn whatever a parser raises on a damaged file into one LogError.

    Parameters
    ----------
    form : what was expected, such as `TDMS file`
    remedy : what to do with such a file
    called : what the message calls the file
    """
    try:
        yield
    except (LogError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as fault:  # damage raises exceptions of nearly every kind; a panic of Rust is no Exception
        raise LogError(
            f"{path.name}: the {called} is damaged or breaks off ({type(fault).__name__}); a whole {form} was expected; "
            f"{remedy}."
        ) from fault


def first_text(texts: Mapping[str, object], keys: Iterable[str]) -> str | None:
    """First text that is not empty under some keys, such as those of a unit."""
    return next((text for key in keys if (text := str(texts.get(key, "")).strip())), None)


def moves(headers: Iterable[Header]) -> bool:
    """Whether columns hold the motion of a line or a shaft, as those of a log do."""
    return any(recognise(header) in ("velocity", "displacement", "speed") for header in headers)


def choose(candidates: Sequence[str], wanted: str | None, where: str, kind: str) -> str:
    """Choose the table that is read: the one that is wanted, by name or by its number from 1 on, else the only candidate.

    Parameters
    ----------
    candidates : tables that could be the log, one at least
    kind : what the format calls a table

    Raises
    ------
    LogError : there is no such table, or there are several candidates and none is wanted
    """
    listed = first_of([*map(repr, candidates)], MAX_NAMED)
    if wanted is None and len(candidates) > 1:
        raise LogError(
            f"{where}: {len(candidates)} {kind}s could be the log: {listed}; expected one; name it with "
            '--sheet NAME, or with sheet = "NAME" in campaign.toml.'
        )
    if wanted is None or wanted in candidates:
        return candidates[0] if wanted is None else wanted
    alike = [name for name in candidates if name.casefold() == wanted.casefold()]
    if not alike and wanted.isascii() and wanted.isdigit() and 1 <= int(wanted[:9]) <= len(candidates):
        alike = [candidates[int(wanted[:9]) - 1]]
    if alike:
        return alike[0]
    raise LogError(
        f"{where}: has no {kind} {wanted!r}; expected one of {listed}, or a number from 1 to {len(candidates)}; "
        "correct --sheet, or sheet in campaign.toml."
    )


def reject_sheet(wanted: str, where: str) -> NoReturn:
    """Reject the choice of a table in a file that holds one alone: LogError."""
    raise LogError(
        f"{where}: is one table, and --sheet {wanted} names another; expected a workbook, a MATLAB file or TDMS; leave "
        "--sheet out, or sheet in campaign.toml."
    )
