"""Read published tables from TOML files; a wrong entry becomes a fault of one sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import combinations
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Load
from winchcascade.core.published_table import (
    DEVIATIONS,
    DIMENSIONS,
    ENERGY_UNITS,
    Claim,
    Printed,
    PrintedColumn,
    PublishedTable,
    TableError,
    TableRow,
    Text,
    load_text,
    same_load,
)
from winchcascade.core.quantity import find_unit
from winchcascade.core.toml_file import Table, check_keys, convert, read_toml, toml_values

BUILT_IN = ("hsu2026-table2",)
_FOLDER = Path(__file__).parent.parent / "published"


def load_table(table: str | Path) -> PublishedTable:
    """Read a table file, or the built-in table of that name where no such file exists; TableError names what is wrong.

    >>> load_table("hsu2026-table2").row(18).cells["eta_pto"]
    0.73
    """
    path = Path(table)
    if not isfile(path):
        if str(table) not in BUILT_IN:
            raise TableError(
                f"table {str(table)!r}: no such file and no built-in table of that name; give a table file or "
                f"{' or '.join(BUILT_IN)}."
            )
        path = _FOLDER / f"{table}.toml"
    return parse_table(read_toml(path, TableError), str(path), name=path.stem)


def table_place(path: str) -> str:
    """Name the file of a table in a report: a built-in table by its name.

    >>> table_place(load_table("hsu2026-table2").path), table_place("mine/table.toml")
    ('built-in table hsu2026-table2', 'mine/table.toml')
    """
    return f"built-in table {Path(path).stem}" if Path(path).parent == _FOLDER else path


_Percent = Annotated[float, Meta(ge=0.0, le=100.0)]


class _TableFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table file as written."""

    title: Text
    source: Text
    columns: Annotated[dict[str, Table], Meta(min_length=1)]
    row: Annotated[list[Table], Meta(min_length=1)]
    cycles: Annotated[int, Meta(ge=1, lt=10**9)] | None = None
    claim: list[Table] = []
    deviation_energy_percent: _Percent | None = None
    deviation_eta_percent: _Percent | None = None


class _Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A row as written: the cells of a load, or the sums of the energies."""

    load_ohm: Load | None = None
    total: bool = False
    energy_line: Printed | None = None
    energy_mech: Printed | None = None
    energy_gen: Printed | None = None
    power_line: Printed | None = None
    power_mech: Printed | None = None
    power_gen: Printed | None = None
    eta_trans: Printed | None = None
    eta_gen: Printed | None = None
    eta_pto: Printed | None = None


def parse_table(text: str, where: str, *, name: str = "table") -> PublishedTable:
    """Turn the text of a table file into a PublishedTable; `where` names the file in the one sentence of a TableError."""
    raw = toml_values(text, where, TableError)
    file: _TableFile = convert(raw, _TableFile, f"{where}:", TableError)
    check_keys(file.columns, ("load_ohm", *DIMENSIONS), f"{where}: [columns]", TableError)
    columns = {
        column: _column(stated, DIMENSIONS.get(column, "resistance"), f"{where}: [columns] {column}")
        for column, stated in file.columns.items()
    }
    lines, of_claims = _lines_of(text, "row", len(file.row)), _lines_of(text, "claim", len(file.claim))
    rows = [_row(row, columns, f"{where}: row {k + 1}", lines[k]) for k, row in enumerate(file.row)]
    of_loads = [row for row in rows if not math.isnan(row.load)]
    for one, other in combinations(of_loads, 2):
        if same_load(one.load, other.load):
            raise TableError(f"{where}: {load_text(one.load)} has two rows; expected one.")
    if not of_loads or len(of_loads) < len(rows) - 1:
        raise TableError(
            f"{where}: expected one [[row]] with load_ohm and its cells for each load, and one of sums at most."
        )
    claims = [_claim(claim, f"{where}: claim {k + 1}", of_claims[k].get("")) for k, claim in enumerate(file.claim)]
    return PublishedTable(
        name=name,
        title=file.title,
        source=file.source,
        columns=columns,
        rows=tuple(of_loads),
        cycles=file.cycles,
        deviations={d: _deviation(raw[f"{d}_percent"]) for d in DEVIATIONS if f"{d}_percent" in raw},
        total=next((row for row in rows if math.isnan(row.load)), None),
        claims=tuple(claims),
        path=where,
    )


def _lines_of(text: str, key: str, tables: int) -> list[dict[str, int]]:
    """Lines of the entries of each of several tables of a name, of its header by the key ""; empty without [[headers]]."""
    lines: list[dict[str, int]] = []
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            inside = re.match(rf"\s*\[\[\s*{key}\s*\]\]", line) is not None
            lines += [{"": number}] if inside else []
        elif inside and (named := re.match(r"\s*(\w+)\s*=", line)):
            lines[-1].setdefault(named[1], number)
    return lines if len(lines) == tables else [{} for _ in range(tables)]


def _deviation(printed: object) -> tuple[float, PrintedColumn]:
    """A deviation as printed: the digits written in the file show how it was rounded."""
    _, _, digits = repr(printed).partition(".")
    return float(str(printed)), PrintedColumn("%", len(digits) if digits.isdigit() else 0, 0.01)


_NUMBER = ("unit", "decimals")
"""Entries of a printed number, of a column or of a claim."""


def _column(raw: Mapping[str, object], dimension: str, place: str) -> PrintedColumn:
    """Unit and decimals of the numbers of a column, or of the number of a claim."""
    check_keys(raw, _NUMBER, place, TableError)
    column: PrintedColumn = convert(raw, PrintedColumn, place, TableError)
    unit = find_unit(column.unit) if dimension != "energy" else None
    factor = ENERGY_UNITS.get(column.unit) if dimension == "energy" else unit.factor if unit else None
    other = (unit is not None and unit.dimension != dimension) or (dimension == "resistance" and factor != 1.0)
    if factor is None or other:
        raise TableError(f"{place}: the unit {column.unit!r} is none of {dimension.replace('number', 'a number')}.")
    return PrintedColumn(column.unit, column.decimals, factor)


def _row(raw: Table, columns: Mapping[str, PrintedColumn], place: str, lines: Mapping[str, int]) -> TableRow:
    """The cells of a load; a row of sums has NaN in place of the load."""
    row: _Row = convert(raw, _Row, place, TableError)
    cells = {metric: value for metric in DIMENSIONS if (value := getattr(row, metric)) is not None}
    check_keys(cells, columns, f"{place} has no unit and decimals under [columns]:", TableError)
    for metric, value in cells.items():
        _check_rounded(value, columns[metric], f"{place} {metric}")
    sums = {DIMENSIONS[metric] for metric in cells} == {"energy"} if row.total else True
    if not cells or not sums or row.total == (row.load_ohm is not None):
        raise TableError(f"{place}: expected load_ohm with its cells, or total = true with sums of energies alone.")
    return TableRow(math.nan if row.load_ohm is None else row.load_ohm, cells, lines)


def _check_rounded(value: float, column: PrintedColumn, place: str) -> None:
    """Reject a number with more decimals than are said to be printed."""
    decimals = column.decimals
    if abs(value - round(value, decimals)) > 1e-9 * max(10.0**-decimals, value * 1e-3):
        raise TableError(
            f"{place} is {value:.15g}, but {decimals} decimals are said to be printed; correct the cell or the decimals."
        )


def _claim(raw: Table, place: str, line: int | None) -> Claim:
    """Read a claim; a metric and a load may stand alone or in a list."""
    stated: Table = {name: value for name, value in raw.items() if name not in _NUMBER} | {"line": line}
    for name in ("metric", "largest_at_ohm"):
        if name in stated and not isinstance(stated[name], list):
            stated[name] = [stated[name]]
    if not {"value", "at_most", "at_least", *_NUMBER}.isdisjoint(raw):
        dimension = DIMENSIONS.get(str(raw.get("metric")), "number")
        stated["column"] = _column({name: raw[name] for name in _NUMBER if name in raw}, dimension, place)
    claim: Claim = convert(stated, Claim, place, TableError)
    _check_rounded(claim.number, claim.column, f"{place} {claim.kind}")
    return claim
