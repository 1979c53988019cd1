"""What every file format provides: headers, and a table of the wanted columns; and the choice of
one table among several.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import msgspec
import numpy as np
import pyarrow as pa

from winchcascade.core.errors import LogError
from winchcascade.core.plain_text import first_of
from winchcascade.core.run import Finding, Mask, Signal
from winchcascade.ingest.headers import Header, recognise
from winchcascade.ingest.stamps import looks_like_a_stamp

MIN_ROWS = 10
"""A table with fewer rows than this is a list of parameters or results: it shows no motion."""

LOG_ENDINGS = frozenset(
    "csv tsv txt dat asc log lvm tdms mat nc parquet pq xlsx xls xlsm xlsb ods".split()
)
"""Endings of files that are taken for logs among others; the reader is chosen by their content."""

MAX_NAMED = 12
"""Names that a message lists."""

_ABOUT = b"winchcascade"
"""Key of what the metadata of a table of Arrow state about the file."""

GROWTH = 1.1
"""Factor by which the memory of a column grows: more would be reserved in vain at the end. [1]"""

_TICKS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


class LogTable(msgspec.Struct, frozen=True):
    """The wanted columns of a file, all of one length n.

    Parameters
    ----------
    values : (n,) each, by index of the header, in the file's own unit; NaN where a cell is not a
        number
    stamps : (n,) numbers in the unit of the time column, or the n texts of stamps, or None without
        a time column
    stamped : the stamps were dates and times and are now seconds since the first one
    began : when that was, since 1970, of a local time as if it were UTC; None where the stamps have
        no date [s]
    texts : the n texts of each column that holds no number
    """

    values: Mapping[int, Signal]
    stamps: Signal | Sequence[str] | None = None
    stamped: bool = False
    findings: tuple[Finding, ...] = ()
    began: float | None = None
    texts: Mapping[int, Sequence[str]] = msgspec.field(default_factory=dict)


class LogSource(msgspec.Struct, frozen=True):
    """An opened log: its headers, and a way to load the wanted columns.

    Parameters
    ----------
    headers : every column of the file in its order
    load : called with the indices of the wanted columns, and that of the time column (or None)
    time_step : sampling interval that the file states itself (a waveform); None where stamps or
        nothing give it [s]
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


def arrow_table(headers: Sequence[Header], columns: Sequence[pa.Array], **about: Any) -> pa.Table:
    """Make a table of Arrow that states the units of its columns and, for `source_of`, what else is
    known of the log.

    Parameters
    ----------
    about : `time_step`, `time_start`, `properties` and `table` as of a `LogSource`; `not_read`
        describes what was left out
    """
    fields = [
        pa.field(header.name, column.type, metadata={"unit": header.unit or ""})
        for header, column in zip(headers, columns, strict=True)
    ]
    return pa.table(list(columns), schema=pa.schema(fields, metadata={_ABOUT: json.dumps(about)}))


def source_of(table: pa.Table) -> LogSource:
    """Make a source of a whole table."""
    about = json.loads((table.schema.metadata or {}).get(_ABOUT, b"{}"))
    not_read = about.pop("not_read", None)
    findings = (Finding("unknown_column", not_read, "not read"),) if not_read else ()

    def load(wanted: Sequence[int], time: int | None) -> LogTable:
        used = [*wanted, *([] if time is None else [time])]
        pieces = ({k: batch.column(k) for k in used} for batch in table.to_batches())
        return log_table(pieces, wanted, time, findings)

    return LogSource(headers_of(table.schema), load, **about)


def headers_of(schema: pa.Schema) -> tuple[Header, ...]:
    """Names of the columns of Arrow, with the units that their metadata state."""
    metadata = [
        {
            str(k, "utf-8", "replace"): str(v, "utf-8", "replace")
            for k, v in (f.metadata or {}).items()
        }
        for f in schema
    ]
    units = [first_text(texts, ("unit", "units")) for texts in metadata]
    return tuple(map(Header, schema.names, units))


def log_table(
    pieces: Iterable[Mapping[int, pa.Array]],
    wanted: Sequence[int],
    time: int | None,
    findings: tuple[Finding, ...] = (),
) -> LogTable:
    """Put columns together that come piece by piece, each turned into numbers at once: a long log
    fits in memory only so.

    Rows that hold neither a stamp nor a number are left out beside a clock: notes, and names
    repeated where logs were joined.
    """
    used = dict.fromkeys([*wanted, *([] if time is None else [time])])
    values: dict[int, Signal] = {k: np.empty(0) for k in used}
    rows = 0
    others: dict[int, list[pa.Array]] = {k: [] for k in used}
    for piece in pieces:
        start = rows
        for k, column in values.items():
            if is_text(piece[k].type) or pa.types.is_temporal(piece[k].type):
                others[k].append(piece[k])
                continue
            rows = start + len(piece[k])
            if rows > column.size:  # it grows in place where the system can do that
                column.resize(max(rows, int(GROWTH * column.size)), refcheck=False)
            column[start:rows] = _numbers(piece[k])
    for column in values.values():
        column.resize(rows, refcheck=False)
    texts: dict[int, list[str]] = {}
    began = None
    for k, kept in others.items():
        if kept and is_text(kept[0].type):
            stamps = looks_like_a_stamp(
                next(filter(None, kept[0].slice(0, MIN_ROWS).to_pylist()), "")
            )
            if not stamps:
                values[k] = np.concatenate(
                    [np.array([*map(_number, words)])[at] for words, at in map(_words, kept)]
                )
            if stamps or not np.isfinite(values[k]).any():
                texts[k] = [text for chunk in kept for text in _texts(chunk)]
                values[k] = np.full(len(texts[k]), np.nan)
        elif kept:
            seconds, first = _seconds_of(pa.chunked_array(kept))
            values[k], began = (
                (seconds, first) if k == time else (np.full(seconds.size, np.nan), began)
            )
    stamped = time is not None and bool(others[time]) and pa.types.is_temporal(others[time][0].type)
    blank = _blank_rows(values, texts.get(time)) if time is not None else np.zeros(0, dtype=bool)
    if blank.any():
        values = {k: x[~blank] for k, x in values.items()}
        texts = {
            k: [text for text, left in zip(x, blank.tolist(), strict=True) if not left]
            for k, x in texts.items()
        }
    clock = None if time is None else texts.get(time, values[time])
    return LogTable({k: values[k] for k in wanted}, clock, stamped, findings, began, texts)


def _blank_rows(values: Mapping[int, Signal], stamps: Sequence[str] | None) -> Mask:
    """Rows in which no column has a number, and which have no stamp."""
    columns = iter(values.values())
    blank: Mask = np.isnan(next(columns, np.empty(0)))
    for column in columns:
        if not blank.any():
            break
        blank &= np.isnan(column)
    if stamps is not None:
        for k in np.flatnonzero(blank).tolist():
            blank[k] = not looks_like_a_stamp(stamps[k])
    return blank


def is_text(kind: Any) -> bool:
    """Whether a type of Arrow is that of texts."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return bool(
        pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind)
    )


def _numbers(column: pa.Array) -> Signal:
    """Convert a piece of a column to numbers; NaN for nulls and for what is none."""
    kind = column.type
    if pa.types.is_float64(
        kind
    ):  # without the import of pandas, which each of the other ways takes
        return np.asarray(
            np.from_dlpack(column.fill_null(np.nan) if column.null_count else column),
            dtype=np.float64,
        )
    if pa.types.is_dictionary(kind):
        column = column.dictionary_decode()
    elif pa.types.is_decimal(kind):
        column = column.cast(pa.string())  # the direct way to a float deviates in the last digit
    elif pa.types.is_boolean(kind):
        column = column.cast(pa.uint8())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return np.full(len(column), np.nan)
    numbers: Signal = column.cast(pa.float64(), safe=False).fill_null(np.nan).to_numpy()
    return numbers


def _words(chunk: pa.Array) -> tuple[list[str], Any]:
    """Take the different texts of a chunk, an empty one last, and which of them stands in each
    row: the last for a null.
    """
    encoded = chunk if pa.types.is_dictionary(chunk.type) else chunk.dictionary_encode()
    words = [text or "" for text in encoded.dictionary.to_pylist()]
    return [*words, ""], encoded.indices.cast(pa.int64()).fill_null(len(words)).to_numpy(
        zero_copy_only=False
    )


def _texts(chunk: pa.Array) -> list[str]:
    """Texts of a chunk, empty for nulls; equal ones of a dictionary are one object, as a long
    one would fill the memory.
    """
    if not pa.types.is_dictionary(chunk.type):
        return [text or "" for text in chunk.to_pylist()]
    words, rows = _words(chunk)
    return [words[row] for row in rows.tolist()]


def _number(text: str) -> float:
    """Read a text as a number, NaN for any other."""
    try:
        return float(text)
    except ValueError:
        return float("nan")


def _seconds_of(column: pa.ChunkedArray) -> tuple[Signal, float | None]:
    """Read dates and times as seconds since the first one, NaN for nulls, and when that was,
    None without a date. [s]
    """
    kind = column.type
    is_date = pa.types.is_date(kind)
    unit = "ms" if is_date else kind.unit
    whole = column.cast(
        pa.timestamp("ms") if is_date else pa.int32() if pa.types.is_time32(kind) else kind
    ).cast(pa.int64())
    known, ticks = column.is_valid().to_numpy(), whole.fill_null(0).to_numpy()
    first = ticks[known][0] if known.any() else 0
    # Whole ticks are subtracted before they become floats: nanoseconds since 1970 have more digits
    # than a float.
    dated = is_date or pa.types.is_timestamp(kind)
    return np.where(known, (ticks - first) / _TICKS[unit], np.nan), float(
        first / _TICKS[unit]
    ) if dated else None


@contextmanager
def damage_reported(path: Path, form: str, remedy: str) -> Iterator[None]:
    """Turn whatever a parser raises on a damaged file of some form, such as `TDMS file`, into
    one LogError.
    """
    try:
        yield
    except (LogError, MemoryError, KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except (
        BaseException
    ) as fault:  # damage raises exceptions of nearly every kind; a panic of Rust is no Exception
        raise LogError(
            f"{path.name}: is damaged or breaks off ({type(fault).__name__}); a whole {form} was "
            f"expected; {remedy}."
        ) from fault


def first_text(texts: Mapping[str, object], keys: Iterable[str]) -> str | None:
    """First text that is not empty under some keys, such as those of a unit."""
    return next((text for key in keys if (text := str(texts.get(key, "")).strip())), None)


def moves(headers: Iterable[Header]) -> bool:
    """Whether columns hold the motion of a line or a shaft, as those of a log do."""
    return any(recognise(header) in ("velocity", "displacement", "speed") for header in headers)


def choose(candidates: Sequence[str], wanted: str | None, where: str, kind: str) -> str:
    """Choose the table that is read: the one that is wanted, by name or by its number from 1 on,
    else the only candidate.

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
            f"{where}: {len(candidates)} {kind}s could be the log: {listed}; expected one; name "
            f"it with "
            '--sheet NAME, or with sheet = "NAME" in campaign.toml.'
        )
    if wanted is None or wanted in candidates:
        return candidates[0] if wanted is None else wanted
    alike = [name for name in candidates if name.casefold() == wanted.casefold()]
    if (
        not alike
        and wanted.isascii()
        and wanted.isdigit()
        and 1 <= int(wanted[:9]) <= len(candidates)
    ):
        alike = [candidates[int(wanted[:9]) - 1]]
    if alike:
        return alike[0]
    raise LogError(
        f"{where}: has no {kind} {wanted!r}; expected one of {listed}, or a number from 1 to "
        f"{len(candidates)}; "
        "correct --sheet, or sheet in campaign.toml."
    )


def reject_sheet(wanted: str, where: str) -> NoReturn:
    """Reject the choice of a table in a file that holds one alone: LogError."""
    raise LogError(
        f"{where}: is one table, and --sheet {wanted} names another; expected a workbook, a "
        f"MATLAB file or TDMS; leave "
        "--sheet out, or sheet in campaign.toml."
    )
