"""The results of a campaign as one Parquet dataset, and as an Excel workbook with a chart."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack
from itertools import islice
from pathlib import Path
from typing import Any

from winchcascade.core.cascade import Cascade
from winchcascade.core.plain_text import cell_text
from winchcascade.core.version import GENERATOR, __version__, made_at
from winchcascade.reduction.run_record import RunRecord
from winchcascade.report.frames import RUN_ENDS, Row, table_rows, table_schema

TABLES = ("runs", "cycles", "bins", "findings", "runs_all")
"""Tables of a dataset, in the order of their sheets."""

_ROWS = 1000
"""Rows that are read, or held before they are written, at a time: memory does not grow with the
number of logs.
"""

_SHEET_ROWS = 1_048_574
"""Rows of data that a sheet of Excel takes below names and units."""

_UNITS = {
    "ohm": "ohm", "j": "J", "w": "W", "s": "s", "m": "m", "mps": "m/s", "n": "N", "nm": "N m", "kgcm2": "kg/cm2", "hz": "Hz",
    "percent": "%",
}  # fmt: skip
"""Unit by the last word of the name of a column."""

_FORMATS = {"J": "0.0", "W": "0.0", "s": "0.000", "m": "0.000", "m/s": "0.0000", "N": "0.0", "N m": "0.00", "rpm": "0.0",
            "kg/cm2": "0.000", "1": "0.0000", "%": "0.00", "Hz": "General", "ohm": "General", "": "General"}  # fmt: skip
"""How numbers of a unit are shown; the cells hold them in full."""

_ENDS = (*(end for end in RUN_ENDS if end and not end.endswith("percent")), "_standard_error")

_WIDTHS = (9, 44)
"""Limits of the width of a column. [characters]"""

SCHEMA = "winchcascade/dataset/1"


def unit_of_column(name: str) -> str:
    """Unit of a column of a dataset by its name.

    >>> unit_of_column("energy_line_j_low_95"), unit_of_column("eta_pto"), unit_of_column("rpm_low"), unit_of_column("run")
    ('J', '1', 'rpm', '')
    """
    base = next((name.removesuffix(end) for end in _ENDS if name.endswith(end)), name)
    if base.startswith(("eta_", "removed_share")) and not base.endswith("_percent"):
        return "1"
    if base.startswith("rpm_"):
        return "rpm"
    return _UNITS.get(base.rpartition("_")[2], "") if "_" in base else ""


def write_workbook(folder: Path, path: Path) -> None:
    """Write the tables of a dataset as sheets of an Excel workbook, row by row; the runs by
    load, with a chart.
    """
    import xlsxwriter

    with xlsxwriter.Workbook(
        str(path),
        {
            "constant_memory": True,
            "nan_inf_to_errors": True,
            "strings_to_formulas": False,
            "strings_to_urls": False,
        },
    ) as book:
        book.set_properties({"comments": GENERATOR, "created": made_at()})
        _runs(book, *_read(folder / "runs.parquet"))
        for table in TABLES[1:]:
            _sheet(book, table, *_read(folder / f"{table}.parquet"))
    with zipfile.ZipFile(
        path, "a"
    ) as archive:  # the mark can be read without unpacking the workbook
        archive.comment = GENERATOR.encode()


def _read(path: Path) -> tuple[list[str], Iterator[Row]]:
    """Names of the columns of a table, and its rows."""
    from pyarrow import parquet

    def rows() -> Iterator[Row]:
        with parquet.ParquetFile(path) as file:
            for batch in file.iter_batches(_ROWS):
                yield from batch.to_pylist()

    return list(parquet.read_schema(path).names), rows()


def _sheet(book: Any, title: str, names: Sequence[str], rows: Iterable[Row]) -> Any:
    """Write one sheet: names, units, rows; the heads and the first column stay in sight."""
    sheet = book.add_worksheet(title)
    sheet.freeze_panes(2, 1)
    units = [unit_of_column(name) for name in names]
    formats = {
        unit: book.add_format({"num_format": _FORMATS[unit]}) for unit in dict.fromkeys(units)
    }
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        wide = name in ("run", "log", "rig", "origin", "message", "action")
        sheet.set_column(
            k,
            k,
            _WIDTHS[1] if wide else max(_WIDTHS[0], min(len(name) + 1, _WIDTHS[1])),
            formats[unit],
        )
    sheet.write_row(0, 0, names, book.add_format({"bold": True}))
    sheet.write_row(1, 0, units, book.add_format({"italic": True, "bottom": 1}))
    for i, row in enumerate(islice(rows, _SHEET_ROWS)):
        for k, (name, unit) in enumerate(zip(names, units, strict=True)):
            value = row.get(name)
            if value is not None:  # what is unknown is an empty cell, an open circuit the text inf
                shown = (
                    cell_text(value)
                    if isinstance(value, str)
                    else "inf"
                    if value == math.inf
                    else value
                )
                sheet.write(2 + i, k, shown, formats[unit])
    return sheet


def _runs(book: Any, names: Sequence[str], rows: Iterable[Row]) -> None:
    """Write the sheet of every log, by load, those without a known one last; and the chart of
    the efficiencies it has.
    """
    found = sorted(
        rows, key=lambda row: row["load_ohm"] if isinstance(row["load_ohm"], float) else math.inf
    )
    sheet = _sheet(book, "runs", names, found)
    etas = [
        k for k, name in enumerate(names)
        if name.startswith("eta_") and not name.endswith((*_ENDS, "_percent")) and any(row[name] is not None for row in found)
    ]  # fmt: skip
    loaded = sum(
        isinstance(row["load_ohm"], float) and math.isfinite(row["load_ohm"]) for row in found
    )
    if etas:
        _chart(book, sheet, etas, load=names.index("load_ohm"), loaded=loaded, rows=len(found))


def _chart(
    book: Any, sheet: Any, columns: Sequence[int], *, load: int, loaded: int, rows: int
) -> None:
    """Draw the efficiencies over the load, or over the logs where fewer than two have a load.

    Parameters
    ----------
    columns, load : numbers of the columns of the efficiencies and of the load
    loaded, rows : number of the rows that have a load, which are the first, and of all
    """
    over_load = loaded > 1
    first, last, along = 2, 1 + (loaded if over_load else rows), load if over_load else 0
    chart = book.add_chart(
        {"type": "scatter", "subtype": "straight_with_markers"} if over_load else {"type": "column"}
    )
    for column in columns:
        values, categories = (["runs", first, k, last, k] for k in (column, along))
        chart.add_series({"name": ["runs", 0, column], "categories": categories, "values": values})
    chart.set_title({"name": f"Efficiency over {'load' if over_load else 'logs'}"})
    chart.set_x_axis({"name": "Load resistance (ohm)"} if over_load else {"name": "Log"})
    chart.set_y_axis({"name": "Efficiency (1)", "num_format": "0.00"})
    chart.set_size({"width": 720, "height": 400})
    sheet.insert_chart(rows + 3, 1, chart)


def write_dataset(
    records: Iterable[tuple[str, RunRecord]], folder: Path, *, cascades: Collection[Cascade] = ()
) -> None:
    """Write the tables of all results, one after the other with the names of their logs, into a
    folder, which is made.

    Parameters
    ----------
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
            table: stack.enter_context(
                parquet.ParquetWriter(folder / f"{table}.parquet", schemas[table])
            )
            for table in TABLES
        }
        held: dict[str, list[Row]] = {table: [] for table in TABLES}
        for name, record in records:
            for table, rows in table_rows(name, record).items():
                held[table] += rows
                if len(held[table]) >= _ROWS:
                    flush(writers[table], table, held[table])
        for table in TABLES:
            flush(writers[table], table, held[table])
