"""Parquet: headers from the schema, and only the wanted columns, a batch of rows at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from winchcascade.ingest.limits import require_numbers
from winchcascade.ingest.source import (
    LogSource,
    LogTable,
    damage_reported,
    headers_of,
    is_text,
    log_table,
)

BATCH_ROWS = 1 << 17
"""Rows that are decoded at a time. [1]"""


def open_parquet(path: Path) -> LogSource:
    """Open the columns of a Parquet file.

    Raises
    ------
    LogError the file is damaged or is no Parquet, or claims more numbers than it can hold, here or
        while the columns are read
    """
    with _opened(path) as file:
        schema = file.schema_arrow
    stated = {
        str(k, "utf-8", "replace"): str(v, "utf-8", "replace")
        for k, v in (schema.metadata or {}).items()
    }
    properties = {
        key: text for key, text in stated.items() if key not in ("pandas", "ARROW:schema")
    }
    return LogSource(headers_of(schema), partial(_load, path), properties=properties)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open the file for as long as its columns are read."""
    with damage_reported(path, "Parquet file", "copy or export it again"):
        # Texts as dictionaries: one long text in every row is one text, else a file of a kilobyte
        # fills the memory.
        texts = [field.name for field in pq.read_schema(path) if is_text(field.type)]
        # Not buffered before: a whole group of rows would be in memory beside the columns.
        with pq.ParquetFile(path, read_dictionary=texts, pre_buffer=False) as file:
            yield file


def _load(path: Path, wanted: Sequence[int], time: int | None) -> LogTable:
    """Read the wanted columns; a list or struct of values is read as nulls, as its values may be
    many.
    """
    used = [*wanted, *([] if time is None else [time])]
    with _opened(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
        require_numbers(path, rows, len(used))
        names = schema.names
        flat = {k: names[k] for k in used if not pa.types.is_nested(schema.types[k])}

        def pieces() -> Iterator[dict[int, pa.Array]]:
            read = 0
            for batch in file.iter_batches(
                BATCH_ROWS, columns=sorted(set(flat.values())), use_threads=False
            ):
                found = batch.schema.names
                # A name may stand twice, and `a` also brings in a column named `a.b`.
                twins = {
                    name: [j for j, other in enumerate(found) if other == name]
                    for name in flat.values()
                }
                columns = {
                    k: batch.column(twins[name][names[:k].count(name)]) for k, name in flat.items()
                }
                yield {k: pa.nulls(batch.num_rows) for k in used} | columns
                read += batch.num_rows
            if read != rows:
                raise ValueError(f"{read} rows where {rows} were claimed")

        return log_table(pieces(), wanted, time)
