"""The results of a campaign as one Parquet dataset."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.batch.workbook import TABLES
from winchcascade.core.cascade import Cascade
from winchcascade.core.version import __version__
from winchcascade.report.frames import Row, arrow_table, table_rows, table_schema
from winchcascade.report.records import FindingRecord, RunRecord

SCHEMA = "winchcascade/dataset/1"

_ROWS = 1000
"""Rows that are held before they are written: memory does not grow with the number of logs."""


def write_dataset(
    results: Iterable[Path],
    folder: Path,
    *,
    between: Sequence[tuple[str, FindingRecord]] = (),
    cascades: Collection[Cascade] = (),
) -> None:
    """Write the tables of all results, JSON files of one log each, into a folder, which is made.

    Parameters
    ----------
    between : findings that one log has beside the others, each with the name of its log
    cascades : those of the rigs of the logs
    """
    from pyarrow import parquet

    folder.mkdir(parents=True, exist_ok=True)
    about = {"schema": SCHEMA, "version": __version__}
    schemas = {table: table_schema(table, about, cascades) for table in TABLES}

    def flush(writer: Any, table: str, rows: list[Row]) -> None:
        writer.write_table(arrow_table(rows, schemas[table]))
        rows.clear()

    with ExitStack() as stack:
        writers = {
            table: stack.enter_context(parquet.ParquetWriter(folder / f"{table}.parquet", schemas[table]))
            for table in TABLES
        }
        held: dict[str, list[Row]] = {table: [] for table in TABLES}
        for result in results:
            record = msgspec.json.decode(result.read_bytes(), type=RunRecord)
            more = tuple(finding for name, finding in between if name == result.stem)
            record = msgspec.structs.replace(record, quality=record.quality + more)
            for table, rows in table_rows(result.stem, record).items():
                held[table] += rows
                if len(held[table]) >= _ROWS:
                    flush(writers[table], table, held[table])
        for table in TABLES:
            flush(writers[table], table, held[table])
