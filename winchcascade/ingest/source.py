"""What a reader of one file format hands over: the headers first, then only the columns that are wanted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.core.errors import LogError
from winchcascade.ingest.cells import is_stamp

if TYPE_CHECKING:
    from winchcascade.core.run import Finding, Signal


class Header(msgspec.Struct, frozen=True):
    """One column as the file names it; the unit is None where the file keeps none apart from the name."""

    name: str
    unit: str | None = None


class LogTable(msgspec.Struct, frozen=True):
    """The wanted columns of a file, all of one length n.

    Parameters
    ----------
    values : (n,) each, by index of the header, in the file's own unit; NaN where a cell is not a number
    stamps : (n,) numbers in the unit of the time column, or the n texts of stamps, or None without a time column
    stamped : the stamps were dates and times and are now seconds since the first one
    """

    values: Mapping[int, Signal]
    stamps: Signal | Sequence[str] | None = None
    stamped: bool = False
    findings: tuple[Finding, ...] = ()


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
            blank[k] = not is_stamp(stamps[k])
    if not blank.any():
        return table
    rows = np.flatnonzero(~blank)
    values = {k: column[rows] for k, column in table.values.items()}
    if stamps is not None:
        stamps = stamps[rows] if isinstance(stamps, np.ndarray) else [stamps[k] for k in rows.tolist()]
    return msgspec.structs.replace(table, values=values, stamps=stamps)


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


class LogSource(msgspec.Struct, frozen=True):
    """An opened log: its headers, and a way to load the wanted columns.

    Parameters
    ----------
    headers : every column of the file in its order
    load : called once with the indices of the wanted channels and the index of the time column (or None)
    time_step : sampling interval that the file states itself (a waveform); None where stamps or nothing say it [s]
    time_start : stamp of the first sample of such a waveform [s]
    properties : what the file says about itself, such as `load_ohm`
    table : name of the sheet, variable or group that is read, where a file may hold several
    close : gives back what the source holds; no column can be loaded afterwards
    """

    headers: Sequence[Header]
    load: Callable[[Sequence[int], int | None], LogTable]
    time_step: float | None = None
    time_start: float = 0.0
    properties: Mapping[str, str | float] = msgspec.field(default_factory=dict)
    close: Callable[[], object] = lambda: None
    table: str | None = None
