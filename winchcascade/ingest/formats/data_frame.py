"""A pandas DataFrame as the source of a log: its columns, and its index where that is a clock."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from winchcascade.core.errors import LogError
from winchcascade.ingest.headers import Header, recognise
from winchcascade.ingest.source import LogSource, arrow_table, reject_sheet, source_of

if TYPE_CHECKING:
    import pandas as pd


def open_frame(
    frame: pd.DataFrame,
    *,
    where: str,
    units: Mapping[str, str] | None = None,
    table: str | None = None,
) -> LogSource:
    """Open the columns of a frame, and its index where that holds dates, durations or fractions of
    numbers.

    A column of a MultiIndex of two levels is a name with its unit. `frame.attrs` are the properties
    of the log, such as `load_ohm`. The frame is never changed.

    Parameters
    ----------
    where : name of the frame in messages
    units : units of columns by their names; "" as the name of an index without one

    Raises
    ------
    LogError : this is no frame, or a unit is of a column that it does not have
    """
    import pandas as pd

    units = units or {}
    if table is not None:
        reject_sheet(table, where)
    if not isinstance(frame, pd.DataFrame):
        raise LogError(
            f"{where}: is a {type(frame).__name__}; expected the path of a log or a pandas "
            f"DataFrame with one column for each "
            "channel. Make a DataFrame of it, as by its to_pandas() or pandas.DataFrame(...)."
        )
    headers = [_header(name, units) for name in frame.columns]
    columns = [_column(frame.iloc[:, k]) for k in range(len(headers))]
    clock = _clock_name(frame.index, units)
    if clock is not None and not any(recognise(header) == "time" for header in headers):
        headers.insert(0, Header(clock, units.get(clock)))
        columns.insert(0, _column(frame.index.to_series()))
    missing = [name for name in units if name not in {header.name for header in headers}]
    if missing:
        known = ", ".join(repr(header.name) for header in headers)
        raise LogError(
            f"{where}: units has {', '.join(map(repr, missing))}, but the frame has no such "
            f"column; expected some of {known}."
        )
    stated = {
        str(key): value if isinstance(value, str) else float(value)
        for key, value in frame.attrs.items()
        if isinstance(value, str | int | float)
    }
    return source_of(arrow_table(headers, columns, properties=stated))


def frame_digest(frame: pd.DataFrame) -> str:
    """SHA-256 of the names and values of a frame in hexadecimal, by which diagnoses recognise
    one log in two runs.
    """
    import pandas as pd

    digest = hashlib.sha256(repr([str(name) for name in frame.columns]).encode())
    has_objects = any(kind.kind == "O" for kind in frame.dtypes)  # some of which have no digest
    digest.update(
        pd.util.hash_pandas_object(frame.astype(str) if has_objects else frame).to_numpy().tobytes()
    )
    return digest.hexdigest()


def _header(name: Hashable, units: Mapping[str, str]) -> Header:
    """Name and unit of a column; the unit that the call states counts first."""
    if isinstance(name, tuple):
        texts = [str(part).strip() for part in name]
        unit = texts[1].strip("[]()") if len(texts) == 2 else ""
        whole = texts[0] if len(texts) == 2 else " ".join(texts)
        return Header(whole, units.get(whole) or unit or None)
    return Header(str(name), units.get(str(name)))


def _clock_name(index: pd.Index[Any], units: Mapping[str, str]) -> str | None:
    """Name of the clock that an index is, empty for one without a name that logs use; None where
    it only counts rows.
    """
    name = "" if index.name is None else str(index.name)
    if name and (name in units or recognise(Header(name)) == "time"):
        return name
    return "" if index.dtype.kind in "mMf" or index.dtype.name.startswith("datetime64") else None


def _column(column: pd.Series[Any]) -> pa.ChunkedArray:
    """A column as Arrow has it; objects of several kinds are texts."""
    try:
        found = pa.array(column, from_pandas=True)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError):
        lost = column.isna().to_list()
        found = pa.array(
            [None if gone else str(value) for value, gone in zip(column, lost, strict=True)],
            pa.string(),
        )
    return found if isinstance(found, pa.ChunkedArray) else pa.chunked_array([found])
