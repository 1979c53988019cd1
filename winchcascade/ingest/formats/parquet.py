"""The clock of a log that names none: the index of a data frame, which stands in the one column without a name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from winchcascade.ingest.dialects import letters_of
from winchcascade.ingest.source import Header, LogSource, LogTable, damage_reported
from winchcascade.ingest.table_choice import refuse_sheet

if TYPE_CHECKING:
    from winchcascade.core.run import Signal


_FEWEST = 3
"""Fewer stamps show no clock."""

_NO_NAME = re.compile(r"(?:index|indexlevel0|unnamed0|column\d+)?")
"""Letters of a column that has no name, or the one that a program gave it for want of a name."""


def nameless(header: Header) -> bool:
    """Whether nobody named a column.

    >>> from winchcascade.ingest.source import Header
    >>> [nameless(Header(name)) for name in ("", "Unnamed: 0", "__index_level_0__", "Force")]
    [True, True, True, False]
    """
    return _NO_NAME.fullmatch(letters_of(header.name)) is not None


def index_clock(source: LogSource, wanted: Sequence[int]) -> tuple[int, LogTable] | None:
    """Find the one column without a name that is a clock, and the wanted columns beside it; None for none or several."""
    columns = [k for k, header in enumerate(source.headers) if nameless(header) and k not in wanted]
    found = [(k, table) for k in columns if _is_clock(table := source.load(wanted, k))]
    return found[0] if len(found) == 1 else None


def _is_clock(table: LogTable) -> bool:
    """Whether a column holds stamps, or numbers that rise throughout; whole numbers are no clock, as they count rows."""
    stamps = table.stamps
    if stamps is None:
        return False
    if not isinstance(stamps, np.ndarray):
        from winchcascade.ingest.stamps import looks_like_a_stamp

        return 2 * sum(map(looks_like_a_stamp, stamps)) > len(stamps)
    good = stamps[np.isfinite(stamps)]
    if good.size < _FEWEST:
        return False
    if table.stamped:
        return bool(good[-1] > good[0])
    return bool(np.all(good[1:] > good[:-1]) and np.any(good != np.rint(good)))


UNIT_KEYS = (b"unit", b"units")
NOT_PROPERTIES = (b"pandas", b"ARROW:schema")

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


def open_parquet(path: Path, *, table: str | None = None) -> LogSource:
    """Open the columns of a Parquet file.

    Raises
    ------
    LogError
        the file is damaged or is no Parquet, here or while the columns are read
    """
    refuse_sheet(table, path.name)
    with _opened(path) as file:
        schema = file.schema_arrow
        headers = tuple(Header(field.name, _unit(field.metadata or {})) for field in schema)
        properties = _properties(schema.metadata or {})
    return LogSource(headers=headers, load=partial(_load, path), properties=properties)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file for as long as its columns are read."""
    with damage_reported(path, "Parquet file", "copy or export it again"):
        # Texts as dictionaries: one long text in every row is one text, else a file of a kilobyte fills the memory.
        texts = [field.name for field in pq.read_schema(path) if _is_text(field.type)]
        with pq.ParquetFile(path, read_dictionary=texts) as file:
            yield file


def _unit(metadata: dict[bytes, bytes]) -> str | None:
    """Find the unit among what the schema says about a column."""
    texts = (metadata[key].decode("utf-8", "replace").strip() for key in UNIT_KEYS if key in metadata)
    return next((text for text in texts if text), None)


def _properties(metadata: dict[bytes, bytes]) -> dict[str, str | float]:
    """Read what the schema says about the file, as numbers where they are."""
    texts = {
        k.decode("utf-8", "replace"): v.decode("utf-8", "replace")
        for k, v in metadata.items()
        if k not in NOT_PROPERTIES
    }
    return {key: text if np.isnan(number := _number(text)) else number for key, text in texts.items()}


def _load(path: Path, wanted: Sequence[int], time: int | None) -> LogTable:
    """Read the wanted columns into numbers and the time column into what it holds."""
    with _opened(path) as file:
        values = {i: _column(file, i) for i in wanted}
        if time is None:
            return LogTable(values)
        kind = file.schema_arrow[time].type
        kind = kind.value_type if pa.types.is_dictionary(kind) else kind
        if pa.types.is_temporal(kind):
            return LogTable(values, stamps=_seconds(file, time), stamped=True)
        if _is_text(kind):
            return LogTable(values, stamps=_texts(file, time))
        return LogTable(values, stamps=_column(file, time))


def _pieces(file: Any, i: int) -> Iterator[Any]:
    """Yield one column row group by row group, of dictionaries those of texts alone."""
    names = file.schema_arrow.names
    for k in range(file.num_row_groups):
        table = file.read_row_group(k, columns=[names[i]])
        # A name may stand twice, and `a` also brings in a column named `a.b`.
        column = [table.column(j) for j, name in enumerate(table.column_names) if name == names[i]][
            names[:i].count(names[i])
        ]
        whole = pa.types.is_dictionary(column.type) and not _is_text(column.type.value_type)
        yield column.cast(column.type.value_type) if whole else column


def _column(file: Any, i: int) -> Signal:
    """Read one column as numbers; NaN for nulls and for what is none."""
    values = np.empty(file.metadata.num_rows)
    end = 0
    for piece in _pieces(file, i):
        values[end : end + len(piece)] = _numbers(piece)
        end += len(piece)
    if end != len(values):
        raise ValueError(f"{end} rows where {len(values)} were claimed")
    return values


def _numbers(piece: Any) -> Signal:
    """Convert a piece of a column to numbers."""
    kind = piece.type
    if pa.types.is_dictionary(kind):
        parts = [np.array([_number(word) for word in words])[rows] for words, rows in map(_words, piece.chunks)]
        return np.concatenate([np.empty(0), *parts])
    if _is_text(kind):
        return np.array([_number(text or "") for text in piece.to_pylist()], dtype=np.float64)
    if pa.types.is_decimal(kind):
        piece = piece.cast(pa.string())  # the direct way to a float is off in the last digit
    elif pa.types.is_boolean(kind):
        piece = piece.cast(pa.uint8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return np.full(len(piece), np.nan)
    numbers: Signal = pc.fill_null(pc.cast(piece, pa.float64(), safe=False), np.nan).to_numpy()
    return numbers


def _words(chunk: Any) -> tuple[list[str], Any]:
    """Take the texts of a dictionary, an empty one last, and which of them stands in each row: the last for a null."""
    words = [text or "" for text in chunk.dictionary.to_pylist()]
    return [*words, ""], pc.fill_null(chunk.indices.cast(pa.int64()), len(words)).to_numpy(zero_copy_only=False)


def _is_text(kind: Any) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind))


def _number(text: str) -> float:
    """Read a text as a number, NaN for any other."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _texts(file: Any, i: int) -> list[str]:
    texts: list[str] = []
    for piece in _pieces(file, i):
        for chunk in piece.chunks:
            words, rows = _words(chunk.dictionary_encode())
            texts += [words[k] for k in rows.tolist()]
    return texts


def _seconds(file: Any, i: int) -> Signal:
    """Read dates and times as seconds since the first one, NaN for nulls. [s]"""
    pieces = [_ticks(piece) for piece in _pieces(file, i)]
    ticks = np.concatenate([ticks for ticks, _, _ in pieces]) if pieces else np.empty(0, dtype=np.int64)
    known = np.concatenate([valid for _, valid, _ in pieces]) if pieces else np.empty(0, dtype=np.bool_)
    if not known.any():
        return np.full(len(ticks), np.nan)
    # Whole ticks are subtracted before they become floats: nanoseconds since 1970 have more digits than a float.
    seconds: Signal = (ticks - ticks[known][0]) / pieces[0][2]
    seconds[~known] = np.nan
    return seconds


def _ticks(piece: Any) -> tuple[Any, Any, float]:
    """Take the whole ticks of dates and times, which of them are known, and their number in a second."""
    kind = piece.type
    if pa.types.is_date(kind):
        piece, kind = piece.cast(pa.timestamp("ms")), pa.timestamp("ms")
    valid = piece.is_valid().to_numpy()
    whole = piece.cast(pa.int32()) if pa.types.is_time32(kind) else piece
    return pc.fill_null(whole.cast(pa.int64()), 0).to_numpy(), valid, _TICKS[kind.unit]
