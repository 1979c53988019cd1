"""A pandas DataFrame as the source of a log: its columns, and its index where that is a clock."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from msgspec.structs import replace

from winchcascade.core.errors import LogError
from winchcascade.ingest.dialects import Header, recognise
from winchcascade.ingest.formats.parquet import table_of
from winchcascade.ingest.source import LogSource, LogTable, reject_sheet

if TYPE_CHECKING:
    import pandas as pd


def open_frame(
    frame: pd.DataFrame, *, where: str, units: Mapping[str, str] | None = None, table: str | None = None
) -> LogSource:
    """Open the columns of a frame, and its index where that holds dates, durations or fractions of numbers.

    A column of a MultiIndex of two levels is a name with its unit. `frame.attrs` are the properties of the log, such as
    `load_ohm`. The frame is never changed.

    Parameters
    ----------
    where : name of the frame in messages
    units : units of columns by their names; "" as the name of an index without one

    Raises
    ------
    LogError : this is no frame, or a unit is of a column that it does not have
    """
    if table is not None:
        reject_sheet(table, where)
    columns = _columns(_checked(frame, where), dict(units or {}), where)
    return LogSource(
        headers=[header for header, _ in columns],
        load=partial(_load, [values for _, values in columns]),
        properties={
            str(key): value if isinstance(value, str) else float(value)
            for key, value in frame.attrs.items()
            if isinstance(value, str | int | float)
        },
    )


def frame_digest(frame: pd.DataFrame) -> str:
    """SHA-256 of the names and values of a frame in hexadecimal, by which diagnoses recognise one log in two runs."""
    import pandas as pd

    digest = hashlib.sha256(repr([str(name) for name in frame.columns]).encode())
    digest.update(pd.util.hash_pandas_object(frame.astype(str) if _has_objects(frame) else frame).to_numpy().tobytes())
    return digest.hexdigest()


def _has_objects(frame: pd.DataFrame) -> bool:
    """Whether a frame has columns of Python objects, some of which have no digest."""
    return any(kind.kind == "O" for kind in frame.dtypes)


def _checked(frame: object, where: str) -> pd.DataFrame:
    """The frame, if it is one: LogError else."""
    import pandas as pd

    if isinstance(frame, pd.DataFrame):
        return frame
    raise LogError(
        f"{where}: is a {type(frame).__name__}; expected the path of a log or a pandas DataFrame with one column for each "
        "channel. Make a DataFrame of it, as by its to_pandas() or pandas.DataFrame(...)."
    )


def _columns(frame: pd.DataFrame, units: dict[str, str], where: str) -> list[tuple[Header, Any]]:
    """Header and values of the index, where it is a clock, and of every column."""
    columns = [(_header(name, units), frame.iloc[:, k]) for k, name in enumerate(frame.columns)]
    clock = _clock_name(frame.index, units)
    if clock is not None and not any(recognise(header) == "time" for header, _ in columns):
        columns.insert(0, (Header(clock, units.get(clock)), frame.index.to_series()))
    missing = [name for name in units if name not in {header.name for header, _ in columns}]
    if missing:
        known = ", ".join(repr(header.name) for header, _ in columns)
        raise LogError(
            f"{where}: units has {', '.join(map(repr, missing))}, but the frame has no such column; expected some of {known}."
        )
    return columns


def _header(name: Hashable, units: Mapping[str, str]) -> Header:
    """Name and unit of a column; the unit that the call states counts first."""
    if isinstance(name, tuple):
        texts = [str(part).strip() for part in name]
        unit = texts[1].strip("[]()") if len(texts) == 2 else ""
        whole = texts[0] if len(texts) == 2 else " ".join(texts)
        return Header(whole, units.get(whole) or unit or None)
    return Header(str(name), units.get(str(name)))


def _clock_name(index: pd.Index[Any], units: Mapping[str, str]) -> str | None:
    """Name of the clock that an index is, empty for one without a name that logs use; None where it only counts rows."""
    name = "" if index.name is None else str(index.name)
    if name and (name in units or recognise(Header(name)) == "time"):
        return name
    return "" if index.dtype.kind in "mMf" or index.dtype.name.startswith("datetime64") else None


def _load(columns: Sequence[Any], wanted: Sequence[int], time: int | None) -> LogTable:
    """Copy the wanted columns into numbers, and the time column into what it holds."""
    loaded = table_of({k: _pieces(columns[k]) for k in wanted}, None if time is None else _pieces(columns[time]))
    return replace(loaded, values={k: np.array(x) for k, x in loaded.values.items()})


def _pieces(column: Any) -> pa.ChunkedArray:
    """A column as Arrow has it; objects of several kinds are texts."""
    try:
        found = pa.array(column, from_pandas=True)
    except (pa.ArrowInvalid, pa.ArrowTypeError, pa.ArrowNotImplementedError):
        lost = column.isna().to_list()
        found = pa.array([None if gone else str(value) for value, gone in zip(column, lost, strict=True)], pa.string())
    return found if isinstance(found, pa.ChunkedArray) else pa.chunked_array([found])
