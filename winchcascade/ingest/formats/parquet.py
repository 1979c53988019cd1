"""Parquet: headers from the schema, and only the wanted columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from winchcascade.core.run import Signal
from winchcascade.ingest.dialects import Header
from winchcascade.ingest.limits import require_numbers
from winchcascade.ingest.source import LogSource, LogTable, damage_reported, first_text

UNIT_KEYS = ("unit", "units")
NOT_PROPERTIES = ("pandas", "ARROW:schema")

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def open_parquet(path: Path) -> LogSource:
    """Open the columns of a Parquet file.

    Raises
    ------
    LogError
        the file is damaged or is no Parquet, or claims more numbers than it can hold, here or while the columns are read
    """
    with _opened(path) as file:
        schema = file.schema_arrow
        units = [_texts_of(field.metadata) for field in schema]
        properties = _texts_of(schema.metadata)
    return LogSource(
        headers=tuple(
            Header(name, first_text(texts, UNIT_KEYS)) for name, texts in zip(schema.names, units, strict=True)
        ),
        load=partial(_load, path),
        properties={
            key: text if np.isnan(number := _number(text)) else number
            for key, text in properties.items()
            if key not in NOT_PROPERTIES
        },
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file for as long as its columns are read."""
    with damage_reported(path, "Parquet file", "copy or export it again"):
        # Texts as dictionaries: one long text in every row is one text, else a file of a kilobyte fills the memory.
        texts = [field.name for field in pq.read_schema(path) if is_text(field.type)]
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            yield file


def _texts_of(metadata: Mapping[bytes, bytes] | None) -> dict[str, str]:
    """Read what the schema states about the file or a column."""
    return {k.decode("utf-8", "replace"): v.decode("utf-8", "replace") for k, v in (metadata or {}).items()}


def _load(path: Path, wanted: Sequence[int], time: int | None) -> LogTable:
    """Read the wanted columns into numbers and the time column into what it holds.

    A list or struct of values is read as nulls: its values may be many.
    """
    used = [*wanted, *([] if time is None else [time])]
    with _opened(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
        require_numbers(path, rows, len(used))
        names, kinds, wanted_at = schema.names, schema.types, set(used)
        flat = {k: name for k, name in enumerate(names) if k in wanted_at and not pa.types.is_nested(kinds[k])}
        table = file.read(columns=sorted(set(flat.values())))
        # A name may stand twice, and `a` also brings in a column named `a.b`.
        places: dict[str, list[int]] = {}
        for j, name in enumerate(table.column_names):
            places.setdefault(name, []).append(j)
        columns = dict.fromkeys(used, pa.chunked_array([pa.nulls(rows)]))
        columns |= {k: table.column(places[name][names[:k].count(name)]) for k, name in flat.items()}
        if any(len(column) != rows for column in columns.values()):
            raise ValueError(f"{table.num_rows} rows where {rows} were claimed")
        return table_of({k: columns[k] for k in wanted}, None if time is None else columns[time])


def table_of(columns: Mapping[int, pa.ChunkedArray], clock: pa.ChunkedArray | None) -> LogTable:
    """Columns of Arrow as numbers, and the clock as seconds since the first date or time, as numbers or as texts."""
    values = {k: numbers_of(column) for k, column in columns.items()}
    if clock is None:
        return LogTable(values)
    if pa.types.is_temporal(clock.type):
        stamps, began = _seconds_of(clock)
        return LogTable(values, stamps, stamped=True, began=began)
    numbers = numbers_of(clock)
    if _holds_texts(clock.type) and not np.isfinite(numbers).any():
        return LogTable(values, [words[k] for words, rows in map(_words, clock.chunks) for k in rows.tolist()])
    return LogTable(values, numbers)


def is_text(kind: Any) -> bool:
    """Whether a type of Arrow is that of texts."""
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind))


def _holds_texts(kind: Any) -> bool:
    return is_text(kind.value_type if pa.types.is_dictionary(kind) else kind)


def numbers_of(column: pa.ChunkedArray) -> Signal:
    """Convert a column to numbers; NaN for nulls and for what is none."""
    kind = column.type
    if _holds_texts(kind):
        parts = [np.array([*map(_number, words)])[rows] for words, rows in map(_words, column.chunks)]
        return np.concatenate([np.empty(0), *parts])
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.string())  # the direct way to a float deviates in the last digit
    elif pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return np.full(len(column), np.nan)
    numbers: Signal = pc.fill_null(pc.cast(column, pa.float64(), safe=False), np.nan).to_numpy()
    return numbers


def _words(chunk: pa.Array) -> tuple[list[str], Any]:
    """Take the different texts of a chunk, an empty one last, and which of them stands in each row: the last for a null."""
    encoded = chunk if pa.types.is_dictionary(chunk.type) else chunk.dictionary_encode()
    words = [text or "" for text in encoded.dictionary.to_pylist()]
    return [*words, ""], pc.fill_null(encoded.indices.cast(pa.int64()), len(words)).to_numpy(zero_copy_only=False)


def _number(text: str) -> float:
    """Read a text as a number, NaN for any other."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _seconds_of(column: pa.ChunkedArray) -> tuple[Signal, float | None]:
    """Read dates and times as seconds since the first one, NaN for nulls, and when that was, None without a date. [s]"""
    kind = column.type
    is_date = pa.types.is_date(kind)
    unit = "ms" if is_date else kind.unit
    ticks_of = column.cast(pa.timestamp("ms") if is_date else pa.int32() if pa.types.is_time32(kind) else kind)
    column = ticks_of.cast(pa.int64())
    known, ticks = column.is_valid().to_numpy(), pc.fill_null(column, 0).to_numpy()
    first = ticks[known][0] if known.any() else 0
    # Whole ticks are subtracted before they become floats: nanoseconds since 1970 have more digits than a float.
    dated = is_date or pa.types.is_timestamp(kind)
    return np.where(known, (ticks - first) / _TICKS[unit], np.nan), float(first / _TICKS[unit]) if dated else None
