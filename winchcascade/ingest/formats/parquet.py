"""Parquet: headers from the schema, and only the wanted columns, one row group at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from winchcascade.ingest.source import LogSource, LogTable, damage_reported, first_text, reject_sheet

UNIT_KEYS = ("unit", "units")
NOT_PROPERTIES = ("pandas", "ARROW:schema")

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def open_parquet(path: Path, *, table: str | None = None) -> LogSource:
    """Open the columns of a Parquet file.

    Raises
    ------
    LogError
        the file is damaged or is no Parquet, here or while the columns are read
    """
    reject_sheet(table, path.name)
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
    """Read the wanted columns into numbers and the time column into what it holds."""
    with _opened(path) as file:
        values = {i: _column(file, i) for i in wanted}
        if time is None:
            return LogTable(values)
        kind = file.schema_arrow[time].type
        kind = kind.value_type if pa.types.is_dictionary(kind) else kind
        if pa.types.is_temporal(kind):
            stamps, began = seconds_of(_pieces(file, time), kind)
            return LogTable(values, stamps=stamps, stamped=True, began=began)
        return LogTable(values, stamps=texts_of(_pieces(file, time)) if is_text(kind) else _column(file, time))


def _pieces(file: Any, i: int) -> Iterator[Any]:
    """Yield one column row group by row group, of dictionaries those of texts alone."""
    names = file.schema_arrow.names
    for k in range(file.num_row_groups):
        table = file.read_row_group(k, columns=[names[i]])
        # A name may stand twice, and `a` also brings in a column named `a.b`.
        alike = [table.column(j) for j, name in enumerate(table.column_names) if name == names[i]]
        column = alike[names[:i].count(names[i])]
        whole = pa.types.is_dictionary(column.type) and not is_text(column.type.value_type)
        yield column.cast(column.type.value_type) if whole else column


def _column(file: Any, i: int) -> Signal:
    """Read one column as numbers; NaN for nulls and for what is none."""
    values = np.empty(file.metadata.num_rows)
    end = 0
    for piece in _pieces(file, i):
        values[end : end + len(piece)] = numbers_of(piece)
        end += len(piece)
    if end != len(values):
        raise ValueError(f"{end} rows where {len(values)} were claimed")
    return values


def numbers_of(piece: Any) -> Any:
    """Convert a piece of a column, an Arrow array of one or more chunks, to numbers."""
    kind = piece.type
    if pa.types.is_dictionary(kind):
        parts = [np.array([_number(word) for word in words])[rows] for words, rows in map(_words, piece.chunks)]
        return np.concatenate([np.empty(0), *parts])
    if is_text(kind):
        return np.array([_number(text or "") for text in piece.to_pylist()], dtype=np.float64)
    if pa.types.is_decimal(kind):
        piece = piece.cast(pa.string())  # the direct way to a float deviates in the last digit
    elif pa.types.is_boolean(kind):
        piece = piece.cast(pa.uint8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return np.full(len(piece), np.nan)
    return pc.fill_null(pc.cast(piece, pa.float64(), safe=False), np.nan).to_numpy()


def _words(chunk: Any) -> tuple[list[str], Any]:
    """Take the texts of a dictionary, an empty one last, and which of them stands in each row: the last for a null."""
    words = [text or "" for text in chunk.dictionary.to_pylist()]
    return [*words, ""], pc.fill_null(chunk.indices.cast(pa.int64()), len(words)).to_numpy(zero_copy_only=False)


def is_text(kind: Any) -> bool:
    """Whether a column holds texts."""
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind))


def _number(text: str) -> float:
    """Read a text as a number, NaN for any other."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def texts_of(pieces: Iterable[Any]) -> list[str]:
    """Texts of a column in pieces; empty for nulls."""
    chunks = (_words(chunk.dictionary_encode()) for piece in pieces for chunk in piece.chunks)
    return [words[k] for words, rows in chunks for k in rows.tolist()]


def seconds_of(pieces: Iterable[Any], kind: Any) -> tuple[Signal, float | None]:
    """Read dates and times as seconds since the first one, NaN for nulls, and when that was, None without a date. [s]"""
    unit = "ms" if pa.types.is_date(kind) else kind.unit
    form = pa.timestamp("ms") if pa.types.is_date(kind) else pa.int32() if pa.types.is_time32(kind) else kind
    chunks = [chunk for piece in pieces for chunk in piece.cast(form).cast(pa.int64()).chunks]
    column = pa.chunked_array(chunks, pa.int64())
    known, ticks = column.is_valid().to_numpy(), pc.fill_null(column, 0).to_numpy()
    first = ticks[known][0] if known.any() else 0
    # Whole ticks are subtracted before they become floats: nanoseconds since 1970 have more digits than a float.
    dated = pa.types.is_date(kind) or pa.types.is_timestamp(kind)
    return np.where(known, (ticks - first) / _TICKS[unit], np.nan), float(first / _TICKS[unit]) if dated else None
