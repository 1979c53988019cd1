"""A published table of operating points: rows keyed by any of their columns, read from a TOML file and a CSV beside it.

The digits of each cell give its rounding, unless the file states decimals or significant digits for the column.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.arguments import PATH, check_arguments
from winchcascade.core.published_table import (
    ENERGY_UNITS,
    PublishedTable,
    Span,
    TableError,
    Text,
    load_table,
    unit_suffix,
)
from winchcascade.core.quantity import find_unit, read_as
from winchcascade.core.toml_file import Table, check_keys, convert, read_toml, toml_values
from winchcascade.ingest.cells import decimal_sign, looks_like_a_number, number, split_row
from winchcascade.ingest.formats.text import find_encoding

_LAW = re.compile(r"\s*(\w+)((?:\s*[*/]\s*\w+)*)\s*")
_FACTOR = re.compile(r"([*/])\s*(\w+)")

_POWER, _TORQUE_AND_SPEED = ("power_mech", "power_shaft"), "torque * speed"
"""Columns of shaft power, and what they are in a table that has both torque and speed (P = T omega)."""


AT = {
    "file": "text", "cycle": "number", "load": "resistance",
    "speed": "rotation", "torque": "torque", "velocity": "velocity", "travel": "length",
}  # fmt: skip
"""What a result is at, beside its metrics: its log, its cycle, its load, speed and torque of its shaft, plateau speed and
travel of its payouts; each with its dimension."""


_NO_NUMBER = re.compile(r"\W*|#?n\W?a\W?|nan|k\W?a\W?|null|none")
"""What is written into a cell without a number."""

_SHAFT = {"speed": "rotation", "torque": "torque"}
"""Columns of the shaft, whose product is a power, with their dimension."""


class Law(msgspec.Struct, frozen=True):
    """What a column is of others: the product of some, divided by others."""

    text: str
    times: tuple[str, ...]
    over: tuple[str, ...]


class PointColumn(msgspec.Struct, frozen=True):
    """One column: its head in the CSV, its unit with the factor to SI, how it is rounded, and what it is of others.

    `measured` is the name of what is measured of it: a metric of the results, or an entry of `AT`.
    """

    head: str
    unit: str
    factor: float
    dimension: str = "number"
    measured: str = ""
    decimals: int | None = None
    digits: int | None = None
    law: Law | None = None
    at_most: float = math.inf


class PointCell(msgspec.Struct, frozen=True):
    """A number as printed, in the unit of its column, and half a unit of its last printed digit."""

    value: float
    rounding: float
    text: str

    def span(self, factor: float) -> Span:
        """Every value that rounds to what is printed, in SI units."""
        return Span((self.value - self.rounding) * factor, (self.value + self.rounding) * factor)


class PointTable(msgspec.Struct, frozen=True):
    """A table of operating points; `tolerance` is the share by which means of products may differ from products of means.

    `key_share` is what a measured key may differ by from a printed one, as a share of the largest printed one. `unread` names
    cells that hold a text where a number was expected. `path` and `csv` are the files of the table, empty for none.
    """

    name: str
    title: str
    source: str
    key: tuple[str, ...]
    columns: Mapping[str, PointColumn]
    rows: tuple[Mapping[str, PointCell], ...]
    tolerance: float = 0.0
    key_share: float = 0.02
    path: str = ""
    csv: str = ""
    unread: tuple[str, ...] = ()

    def row_name(self, k: int) -> str:
        """How a row is called: its key columns, or its number from 1 on."""
        row = self.rows[k]
        named = [f"{name} {row[name].text}{unit_suffix(self.columns[name].unit)}" for name in self.key if name in row]
        return ", ".join(named) or f"row {k + 1}"


_Percent = Annotated[float, Meta(ge=0.0, le=20.0, description="percent from 0 to 20")]
_Decimals = Annotated[int, Meta(ge=-9, le=12, description="how many are printed, such as 3")] | None
_Digits = Annotated[int, Meta(ge=1, le=17, description="how many significant digits are printed, such as 4")] | None


class _PointFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of operating points as its file has it."""

    title: Text
    source: Text
    columns: Annotated[dict[str, Table], Meta(min_length=1)]
    csv: Text | None = None
    key: str | tuple[str, ...] = ()
    point: list[Table] | None = None
    tolerance_percent: _Percent = 0.0
    key_percent: _Percent = 2.0


class _StatedColumn(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"law": "is"}):
    """A column as the file states it."""

    name: Text | None = None
    unit: Text = "1"
    decimals: _Decimals = None
    digits: _Digits = None
    law: str | None = None
    measured: Text | None = None


def is_point_table(path: Path) -> bool:
    """Whether a file is a table of operating points: it names a CSV, a key or points, which tables by load do not have."""
    raw = toml_values(read_toml(path, TableError), str(path), TableError)
    return not {"csv", "key", "point"}.isdisjoint(raw)


def open_table(table: PublishedTable | PointTable | str | Path) -> PublishedTable | PointTable:
    """Read a table file, by load or of operating points, or a built-in table; a table that was read already stays as it is.

    Raises
    ------
    OptionError : this is no table and no path
    TableError : the file cannot be used
    """
    if isinstance(table, PublishedTable | PointTable):
        return table
    check_arguments("table of a paper", ("table", table, PATH))
    return load_points(Path(table)) if isfile(table) and is_point_table(Path(table)) else load_table(table)


def load_points(path: Path) -> PointTable:
    """Read a table of operating points; TableError names what is wrong."""
    where = str(path)
    file: _PointFile = convert(
        toml_values(read_toml(path, TableError), where, TableError), _PointFile, f"{where}:", TableError
    )
    columns = _columns(file.columns, where)
    keys = (file.key,) if isinstance(file.key, str) else file.key
    for name in keys:
        if name not in columns:
            raise TableError(f"{where}: key names {name!r}, which is no column; expected one of {', '.join(columns)}.")
    if (file.csv is None) == (file.point is None):
        raise TableError(f'{where}: expected either csv = "FILE" or [[point]] tables with the rows, and not both.')
    unread: tuple[str, ...] = ()
    csv = None if file.csv is None else path.parent / file.csv
    if csv is not None:
        rows, unread = _csv_rows(csv, columns, where)
    else:
        rows = _point_rows(file.point or (), columns, where)
    return PointTable(
        name=path.stem,
        title=file.title,
        source=file.source,
        key=keys,
        columns=columns,
        rows=rows,
        tolerance=file.tolerance_percent / 100.0,
        key_share=file.key_percent / 100.0,
        path=where,
        csv=str(csv or ""),
        unread=unread,
    )


def _columns(raw: Mapping[str, Table], where: str) -> dict[str, PointColumn]:
    columns = {}
    for name, table in raw.items():
        place = f"{where}: [columns] {name}"
        given: _StatedColumn = convert(table, _StatedColumn, place, TableError)
        unit, measured = given.unit, given.measured or ("load" if name == "load_ohm" else name)
        found = find_unit(unit)
        if AT.get(measured) == "rotation":
            found = read_as(found, "rotation") or found
        factor = ENERGY_UNITS.get(unit) or (found.factor if found else None)
        if found is not None and name in _SHAFT and found.dimension != _SHAFT[name]:
            raise TableError(
                f"{place}: the unit {unit!r} measures {found.dimension}; expected a unit of {_SHAFT[name]}, such as "
                f"{'rpm' if name == 'speed' else 'N.m'}. Give another quantity another name."
            )
        if factor is None:
            raise TableError(f"{place}: the unit {unit!r} is unknown; expected one such as W, kW, N.m, rpm or 1.")
        usual = _TORQUE_AND_SPEED if name in _POWER and {"torque", "speed"} <= set(raw) else None
        law = usual if given.law is None else given.law
        in_table = "energy" if unit in ENERGY_UNITS else found.dimension if found else ""
        columns[name] = PointColumn(
            head=given.name or name,
            unit=unit,
            factor=factor,
            dimension="text" if measured == "file" and unit not in ENERGY_UNITS else in_table,
            measured=measured,
            decimals=given.decimals,
            digits=given.digits,
            law=None if law is None else _law(law, raw, place),
            at_most=1.0 if name.startswith(("eta", "power_factor")) else math.inf,
        )
    return columns


def _law(text: str, columns: Mapping[str, object], place: str) -> Law:
    found = _LAW.fullmatch(text)
    if found is None:
        raise TableError(
            f'{place}: is = {text!r}; expected products and quotients of columns, such as "torque * speed".'
        )
    factors = [("*", found[1]), *_FACTOR.findall(found[2])]
    for _, name in factors:
        if name not in columns:
            raise TableError(f"{place}: is names {name!r}, which is no column; expected one of {', '.join(columns)}.")
    times, over = (tuple(name for sign, name in factors if sign == one) for one in "*/")
    return Law(text, times, over)


def _csv_rows(
    file: Path, columns: Mapping[str, PointColumn], where: str
) -> tuple[tuple[Mapping[str, PointCell], ...], tuple[str, ...]]:
    """Rows of a CSV whose first line holds the heads, and the cells that hold a text instead of a number."""
    try:
        content = file.read_bytes()
    except OSError as fault:
        raise TableError(f"{file}: cannot be read ({fault.strerror}); correct csv in {where}.") from None
    lines = [line for line in content.decode(find_encoding(content), "replace").splitlines() if line.strip()]
    head = lines[0].lstrip("\ufeff") if lines else ""
    delimiter = max(";\t,", key=head.count)
    if len(lines) < 2:
        raise TableError(
            f"{file}: {'no row below its heads' if lines else 'is empty'}; expected heads and rows of numbers."
        )
    names = split_row(head, delimiter)
    derived = {name for name, column in columns.items() if column.law and column.head == name and name not in names}
    for column in (column for name, column in columns.items() if name not in derived):
        if names.count(column.head) != 1:
            raise TableError(
                f"{file}: {names.count(column.head) or 'no'} columns are named {column.head!r}; expected one; the file has "
                f"{', '.join(names)}. Correct [columns] in {where}."
            )
    cells = [split_row(line, delimiter) for line in lines[1:]]
    decimal = "." if delimiter == "," else decimal_sign(cells)
    places = {name: names.index(column.head) for name, column in columns.items() if name not in derived}
    rows = [
        {
            name: cell
            for name, k in places.items()
            if k < len(row) and (cell := _cell(row[k], decimal, columns[name])) is not None
        }
        for row in cells
    ]
    unread = tuple(
        f"row {k} {name} {row[place].strip()!r}"
        for k, (row, read) in enumerate(zip(cells, rows, strict=True), 1)
        for name, place in places.items()
        if name not in read and place < len(row) and _NO_NUMBER.fullmatch(row[place].strip().casefold()) is None
    )
    return tuple(row for row in rows if row), unread


def _point_rows(
    points: Sequence[Mapping[str, object]], columns: Mapping[str, PointColumn], where: str
) -> tuple[Mapping[str, PointCell], ...]:
    rows = []
    for k, point in enumerate(points, 1):
        check_keys(point, columns, f"{where}: point {k}", TableError)
        row = {name: _cell(str(value), ".", columns[name]) for name, value in point.items()}
        for name, cell in row.items():
            if cell is None:
                raise TableError(f"{where}: point {k}: {name} is {point[name]!r}; expected a number.")
        rows.append({name: cell for name, cell in row.items() if cell is not None})
    return tuple(rows)


def _cell(text: str, decimal: str, column: PointColumn) -> PointCell | None:
    """A printed number with its rounding; None for a cell without a number, a text in a column of files."""
    if column.dimension == "text":
        return PointCell(math.nan, 0.0, text.strip()) if text.strip() else None
    if text.strip().casefold() == "inf" and column.dimension == "resistance":
        return PointCell(math.inf, 0.0, text.strip())
    if not looks_like_a_number(text):
        return None
    value = number(text, decimal)
    if not math.isfinite(value):
        return None
    return PointCell(
        value, 0.5 * 10.0 ** -_printed_decimals(value, text.replace(",", ".") if decimal == "," else text, column), text
    )


def _printed_decimals(value: float, text: str, column: PointColumn) -> int:
    """Decimals of a number: as the column states, by its significant digits, else those of its text."""
    if column.decimals is not None:
        return column.decimals
    if column.digits is not None:
        return column.digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    mantissa, _, power = text.strip().lower().replace("d", "e").partition("e")
    return len(mantissa.partition(".")[2]) - int(power or 0)
