"""The results of a campaign as one Parquet dataset and, optionally, as an Excel workbook."""

from __future__ import annotations

import zipfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.cascade import Cascade
from winchcascade.core.version import __version__
from winchcascade.report.records import FindingRecord, RunRecord
from winchcascade.report.report_model import made_at
from winchcascade.report.rows import Row, table_rows, table_schema

TABLES = ("runs", "cycles", "bins", "findings")
SCHEMA = "winchcascade/dataset/1"

_ROWS = 1000
"""Rows that are held before they are written: memory does not grow with the number of logs."""

_SHEET_ROWS = 1_048_575
"""Rows of data that a sheet of Excel takes."""


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
    import pyarrow as pa
    from pyarrow import parquet

    folder.mkdir(parents=True, exist_ok=True)
    about = {"schema": SCHEMA, "version": __version__}
    schemas = {table: table_schema(table, about, cascades) for table in TABLES}

    def flush(writer: Any, table: str, rows: list[Row]) -> None:
        writer.write_table(pa.Table.from_pylist(rows, schema=schemas[table]))
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


def write_workbook(folder: Path, path: Path) -> None:
    """Write the tables of a dataset as sheets of an Excel workbook, row by row."""
    import xlsxwriter

    with xlsxwriter.Workbook(
        str(path),
        {"constant_memory": True, "nan_inf_to_errors": True, "strings_to_formulas": False, "strings_to_urls": False},
    ) as book:
        book.set_properties({"comments": f"winchcascade/{__version__}", "created": made_at()})
        bold = book.add_format({"bold": True})
        for table in TABLES:
            sheet = book.add_worksheet(table)
            sheet.freeze_panes(1, 1)
            for k, row in enumerate(_table_rows(folder / f"{table}.parquet")):
                if k > _SHEET_ROWS:
                    break
                sheet.write_row(k, 0, row, bold if k == 0 else None)
    _mark(path)


def _mark(path: Path) -> None:
    """Write this tool's mark where it can be read without unpacking the workbook."""
    with zipfile.ZipFile(path, "a") as archive:
        archive.comment = f"winchcascade/{__version__}".encode()


def _table_rows(path: Path) -> Iterator[list[Any]]:
    """Names of the columns, then the rows of a table; what is unknown is an empty cell, an open circuit the text inf."""
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        yield list(file.schema_arrow.names)
        for batch in file.iter_batches(_ROWS):
            for row in batch.to_pylist():
                yield ["inf" if value == float("inf") else value for value in row.values()]
