"""Read a published table from a TOML file: rows by load, or operating points with any key in the
file or a CSV beside it.

The digits of each cell give its rounding, unless the file states decimals or significant digits for
the column.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.arguments import PATH, check_arguments
from winchcascade.core.formula import read_formula
from winchcascade.core.quantity import find_unit, is_load, load_text, read_as, same_load, si_unit
from winchcascade.core.toml_file import Table, check_keys, convert, read_toml, shown, toml_values
from winchcascade.ingest.cells import decimal_sign, looks_like_a_number, number, split_row
from winchcascade.ingest.formats.text import find_encoding
from winchcascade.reduction.efficiency import METRICS
from winchcascade.tables.published_table import (
    DEVIATIONS,
    DIMENSIONS,
    RESULTS_AT,
    Claim,
    Decimals,
    Printed,
    PrintedColumn,
    PublishedTable,
    TableError,
    TableRow,
    Text,
    find_table_unit,
    unit_of,
)

BUILT_IN = ("hsu2026-table2",)
"""Names of built-in tables."""

_FOLDER = Path(__file__).parent.parent / "published"

PRESETS = {
    "power_mech": "torque * speed", "power_shaft": "torque * speed",
    "capture_width": "power / wave_power", "capture_width_ratio": "capture_width / width",
    "cp": "power / (0.5 density area flow_speed^3)", "tsr": "speed * radius / flow_speed",
}  # fmt: skip
"""Laws of columns of these names in a table that has all that they name: P = T omega; power of a
wave-energy converter over that of the waves for each metre of crest (IEC TS 62600-100), and over
its width; power coefficient and tip-speed ratio of a rotor (IEC TS 62600-200)."""

_LOAD = "load_ohm"

_NO_NUMBER = re.compile(r"\W*|#?n\W?a\W?|nan|k\W?a\W?|null|none")
"""What is written into a cell without a number."""

_Percent = Annotated[float, Meta(ge=0.0, le=100.0)]
_Share = Annotated[float, Meta(ge=0.0, le=20.0, description="percent from 0 to 20")]


class _TableFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table file as written: `row` for rows by load, `point` or `csv` for operating points."""

    title: Text
    source: Text
    columns: Annotated[dict[str, Table], Meta(min_length=1)]
    row: list[Table] | None = None
    point: list[Table] | None = None
    csv: Text | None = None
    key: str | tuple[str, ...] = ()
    tolerance_percent: _Share = 0.0
    key_percent: _Share = 2.0
    cycles: Annotated[int, Meta(ge=1, lt=10**9)] | None = None
    deviation_energy_percent: _Percent | None = None
    deviation_eta_percent: _Percent | None = None
    claim: list[Table] = []


class _Column(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"law": "is"}):
    """A column as written."""

    name: Text | None = None
    unit: Text = "1"
    decimals: Decimals | None = None
    digits: Annotated[int, Meta(ge=1, le=17)] | None = None
    law: str | None = None
    measured: Text | None = None


def load_table(table: PublishedTable | str | Path) -> PublishedTable:
    """Read a table file, or the built-in table of that name where no such file exists; a table that
    was read stays as it is.

    Raises
    ------
    OptionError : this is no table and no path
    TableError : the file cannot be used

    >>> load_table("hsu2026-table2").row(18).cells["eta_pto"].value
    0.73
    """
    if isinstance(table, PublishedTable):
        return table
    check_arguments("table of a paper", ("table", table, PATH))
    path = Path(table)
    if not isfile(path):
        if str(table) not in BUILT_IN:
            raise TableError(
                f"table {str(table)!r}: no such file and no built-in table of that name; give a "
                f"table file or "
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


def parse_table(text: str, where: str, *, name: str = "table") -> PublishedTable:
    """Turn the text of a table file into a table; `where` names the file in the one sentence of
    a TableError.
    """
    raw = toml_values(text, where, TableError)
    file: _TableFile = convert(raw, _TableFile, f"{where}:", TableError)
    if [file.row, file.point, file.csv].count(None) != 2:
        raise TableError(
            f'{where}: expected one of [[row]] tables by load, [[point]] tables, and csv = "FILE".'
        )
    by_load = file.row is not None
    columns = _columns(file.columns, where, by_load=by_load)
    keys = (file.key,) if isinstance(file.key, str) else file.key or ((_LOAD,) if by_load else ())
    check_keys(keys, (_LOAD,) if by_load else columns, f"{where}: key", TableError)
    csv, unread = "" if file.csv is None else str(Path(where).parent / file.csv), tuple[str, ...]()
    if csv:
        rows, unread = _csv_rows(Path(csv), columns, keys, where)
    else:
        rows = _toml_rows(text, file.row or file.point or (), columns, keys, where, by_load)
    if not rows:
        raise TableError(f"{where}: it has no row; expected at least one.")
    return PublishedTable(
        name=name,
        title=file.title,
        source=file.source,
        columns=columns,
        rows=rows,
        keys=keys,
        by_load=by_load,
        cycles=file.cycles,
        deviations={
            d: _deviation(raw[f"{d}_percent"]) for d in DEVIATIONS if f"{d}_percent" in raw
        },
        claims=_claims(text, file.claim, where),
        tolerance=file.tolerance_percent / 100.0,
        key_share=file.key_percent / 100.0,
        path=where,
        csv=csv,
        unread=unread,
    )


def _lines(text: str, key: str, tables: int) -> list[dict[str, int]]:
    """Lines of the entries of each of several tables of a name, of its header by the key "";
    empty without [[headers]].
    """
    lines: list[dict[str, int]] = []
    inside = False
    for count, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            inside = re.match(rf"\s*\[\[\s*{key}\s*\]\]", line) is not None
            lines += [{"": count}] if inside else []
        elif inside and (named := re.match(r"\s*(\w+)\s*=", line)):
            lines[-1].setdefault(named[1], count)
    return lines if len(lines) == tables else [{} for _ in range(tables)]


def _claims(text: str, tables: Sequence[Table], where: str) -> tuple[Claim, ...]:
    """Claims of the text, each with its line."""
    claims = list[Claim]()
    for k, (raw, lines) in enumerate(
        zip(tables, _lines(text, "claim", len(tables)), strict=True), 1
    ):
        claim: Claim = convert(
            {**raw, "line": lines.get("")}, Claim, f"{where}: claim {k}", TableError
        )
        _check_rounded(claim.number.value, claim.decimals, f"{where}: claim {k} {claim.kind}")
        claims.append(claim)
    return tuple(claims)


def _deviation(printed: object) -> Printed:
    """A deviation as printed: the digits written in the file show how it was rounded."""
    return Printed(float(str(printed)), len(str(printed).partition(".")[2]), "%", 0.01)


# ---------------------------------------------------------------------------------------- columns
def _columns(raw: Mapping[str, Table], where: str, *, by_load: bool) -> dict[str, PrintedColumn]:
    columns = (
        {}
        if _LOAD in raw or not by_load
        else {_LOAD: PrintedColumn(_LOAD, "ohm", 1.0, "resistance", "load")}
    )
    for name, table in raw.items():
        place = f"{where}: [columns] {name}"
        given: _Column = convert(table, _Column, place, TableError)
        if by_load and given.law is None and given.measured is None:
            check_keys([name], (_LOAD, *METRICS), f"{where}: [columns]", TableError)
        if by_load and name != _LOAD and given.decimals is None and given.digits is None:
            raise TableError(f"{place} decimals is missing; add how many are printed.")
        measured = given.measured or ("load" if name == _LOAD else name)
        try:
            factor, dimension = unit_of(given.unit)
        except ValueError as fault:
            raise TableError(f"{place}: {fault}") from None
        if RESULTS_AT.get(measured) == "rotation" and (
            rotation := read_as(find_unit(given.unit), "rotation")
        ):
            factor, dimension = rotation.factor, rotation.dimension
        law = _preset(name, raw) if given.law is None else given.law
        columns[name] = PrintedColumn(
            head=given.name or name,
            unit=given.unit,
            factor=factor,
            dimension="text" if measured == "file" and dimension == "number" else dimension,
            measured=measured,
            decimals=given.decimals,
            digits=given.digits,
            law=None
            if law is None
            else read_formula(law, raw, f"{place}: is = {law!r}", TableError, find_table_unit),
            at_most=1.0 if not by_load and name.startswith(("eta", "power_factor")) else math.inf,
        )
        if by_load or name in ("speed", "torque"):
            check_unit(columns[name], place)
        if by_load and name == _LOAD and factor != 1.0:
            raise TableError(
                f"{place}: the unit is {given.unit!r}; expected ohm, as in the rows. It is a "
                f"resistance."
            )
    return columns


def _preset(name: str, columns: Collection[str]) -> str | None:
    """Law of a column by its name, None in a table that lacks what it is made of."""
    law = PRESETS.get(name.casefold())
    names = set() if law is None else set(re.findall(r"[^\W\d]\w*", law))
    return law if names <= set(columns) else None


def _dimension(measured: str) -> str | None:
    """Dimension of what is measured; None for what results do not have."""
    return RESULTS_AT.get(measured) or DIMENSIONS.get(measured.partition("_")[0])


def check_unit(column: PrintedColumn, place: str) -> None:
    """Require of a column that is a measured quantity a unit of it."""
    wanted = _dimension(column.measured)
    if wanted is not None and column.dimension != wanted:
        like = "J" if wanted == "energy" else si_unit(wanted)
        raise TableError(
            f"{place}: the unit {column.unit!r} is none of {column.measured}; expected one of "
            f"{wanted}, such as {like}."
        )


# ------------------------------------------------------------------------------------------- rows
def _row(
    k: int,
    cells: Mapping[str, Printed],
    keys: Sequence[str],
    *,
    by_load: bool = False,
    line: int | None = None,
) -> TableRow:
    """A row with its name: its load, its key cells, or its number."""
    if by_load:
        load = cells[_LOAD].value
        return TableRow(k, load_text(load), cells, load, line)
    named = [f"{name} {cells[name].words}" for name in keys if name in cells]
    return TableRow(k, ", ".join(named) or f"row {k}", cells, None, line)


def _toml_rows(
    text: str,
    tables: Sequence[Table],
    columns: Mapping[str, PrintedColumn],
    keys: Sequence[str],
    where: str,
    by_load: bool,
) -> tuple[TableRow, ...]:
    """Rows of a file, those by load with `load_ohm`."""
    kind, rows = "row" if by_load else "point", list[TableRow]()
    for k, (raw, lines) in enumerate(zip(tables, _lines(text, kind, len(tables)), strict=True), 1):
        place = f"{where}: {kind} {k}"
        check_keys(raw, columns, f"{place} has no unit under [columns]:", TableError)
        cells = {
            name: _toml_cell(
                value,
                columns[name],
                f"{place} {name}",
                lines.get(name),
                strict=by_load and name != _LOAD,
            )
            for name, value in raw.items()
        }
        if by_load and (_LOAD not in cells or len(cells) < 2 or not is_load(cells[_LOAD].value)):
            raise TableError(
                f"{place}: expected load_ohm, a resistance above 0 or inf, with its cells."
            )
        rows.append(_row(k, cells, keys, by_load=by_load, line=lines.get("")))
    for one, other in combinations(rows if by_load else (), 2):
        if same_load(one.load or 0.0, other.load or 0.0):
            raise TableError(f"{where}: {one.name} has two rows; expected one.")
    return tuple(rows)


def _toml_cell(
    value: object, column: PrintedColumn, place: str, line: int | None, *, strict: bool
) -> Printed:
    """A cell of a TOML file: a number, or one in quotes to keep its last zeros.

    Parameters
    ----------
    strict : reject a negative number, one that is not finite, and one with more decimals than are
        said to be printed
    """
    text = str(value)
    readable = isinstance(value, str | float | int) and not isinstance(value, bool)
    cell = _cell(text, ".", column, line) if readable and "," not in text else None
    if cell is None or (strict and not 0.0 <= cell.value <= 1e15):
        raise TableError(
            f"{place} is {shown(value)}; expected a number{' from 0 on' if strict else ''}."
        )
    if not strict or column.decimals is None:
        return cell
    _check_rounded(cell.value, column.decimals, place)
    return msgspec.structs.replace(cell, text=cell.fixed(cell.value))


def _check_rounded(value: float, decimals: int, place: str) -> None:
    """Reject a number with more decimals than are said to be printed."""
    if abs(value - round(value, decimals)) > 1e-9 * max(10.0**-decimals, value * 1e-3):
        raise TableError(
            f"{place} is {value:.15g}, but {decimals} decimals are said to be printed; correct "
            f"the cell or the decimals."
        )


def _cell(
    text: str, decimal: str, column: PrintedColumn, line: int | None = None
) -> Printed | None:
    """A printed number with its rounding; None for a cell without a number, a text in a column
    of files.
    """
    if column.dimension == "text":
        return Printed(math.nan, 0, text=text.strip(), line=line) if text.strip() else None
    if text.strip().casefold() == "inf" and column.dimension == "resistance":
        return Printed(math.inf, 0, column.unit, column.factor, text.strip(), line)
    value = number(text, decimal) if looks_like_a_number(text) else math.nan
    if not math.isfinite(value):
        return None
    decimals = column.decimals
    if decimals is None and column.digits is not None:
        decimals = column.digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
    if decimals is None:
        plain = text.replace(",", ".") if decimal == "," else text
        mantissa, _, power = plain.strip().lower().replace("d", "e").partition("e")
        decimals = len(mantissa.partition(".")[2]) - int(power or 0)
    return Printed(value, decimals, column.unit, column.factor, text, line)


def _csv_rows(
    file: Path, columns: Mapping[str, PrintedColumn], keys: Sequence[str], where: str
) -> tuple[tuple[TableRow, ...], tuple[str, ...]]:
    """Rows of a CSV whose first line holds the heads, and the cells that hold a text instead of
    a number.
    """
    try:
        content = file.read_bytes()
    except OSError as fault:
        raise TableError(
            f"{file}: cannot be read ({fault.strerror}); correct csv in {where}."
        ) from None
    lines = [
        line
        for line in content.decode(find_encoding(content), "replace").splitlines()
        if line.strip()
    ]
    head = lines[0].lstrip("\ufeff") if lines else ""
    if len(lines) < 2:
        what = "no row below its heads" if lines else "is empty"
        raise TableError(f"{file}: {what}; expected heads and rows of numbers.")
    delimiter = max(";\t,", key=head.count)
    heads = split_row(head, delimiter)
    columns = {
        n: c for n, c in columns.items() if c.law is None or c.head != n or n in heads
    }  # else its law gives it
    for column in columns.values():
        if heads.count(column.head) != 1:
            raise TableError(
                f"{file}: {heads.count(column.head) or 'no'} columns are named {column.head!r}; "
                f"expected one; the file has "
                f"{', '.join(heads)}. Correct [columns] in {where}."
            )
    texts = [split_row(line, delimiter) for line in lines[1:]]
    decimal = "." if delimiter == "," else decimal_sign(texts)
    rows, unread = list[TableRow](), list[str]()
    for k, row in enumerate(texts, 1):
        given = {
            name: row[place]
            for name, c in columns.items()
            if (place := heads.index(c.head)) < len(row)
        }
        read = {name: _cell(text, decimal, columns[name]) for name, text in given.items()}
        cells = {name: cell for name, cell in read.items() if cell is not None}
        lost = (
            name
            for name in given
            if name not in cells and not _NO_NUMBER.fullmatch(given[name].strip().casefold())
        )
        unread += [f"row {k} {name} {given[name].strip()!r}" for name in lost]
        rows += [_row(len(rows) + 1, cells, keys)] if cells else []
    return tuple(rows), tuple(unread)
