"""What a reader of one file format hands over: the headers first, then only the columns that are wanted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from winchcascade.ingest.cells import is_stamp

if TYPE_CHECKING:
    from winchcascade.core.run import Finding, Signal


class Header(msgspec.Struct, frozen=True):
    """One column as the file names it; the unit is None where the file keeps none apart from the name."""

    name: str
    unit: str | None = None


class Table(msgspec.Struct, frozen=True):
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


def _nothing() -> None:
    """Close a source that holds nothing open."""


def without_notes(table: Table) -> Table:
    """Leave out rows that hold neither a stamp nor a number: notes, and names repeated where logs were joined."""
    if table.stamps is None or not table.values:
        return table
    if isinstance(table.stamps, np.ndarray):
        blank = np.isnan(table.stamps)
    else:
        blank = np.array([not is_stamp(text) for text in table.stamps], dtype=bool)
    for column in table.values.values():
        if blank.any():
            blank &= np.isnan(column)
    if not blank.any():
        return table
    rows = np.flatnonzero(~blank)
    stamps = table.stamps[rows] if isinstance(table.stamps, np.ndarray) else [table.stamps[k] for k in rows.tolist()]
    values = {k: column[rows] for k, column in table.values.items()}
    return msgspec.structs.replace(table, values=values, stamps=stamps)


class Source(msgspec.Struct, frozen=True):
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
    load: Callable[[Sequence[int], int | None], Table]
    time_step: float | None = None
    time_start: float = 0.0
    properties: Mapping[str, str | float] = msgspec.field(default_factory=dict)
    close: Callable[[], object] = _nothing
    table: str | None = None
