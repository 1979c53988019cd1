"""Read published tables from TOML files; a wrong entry becomes a fault of one sentence with its place."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec

from winchcascade.core.published_table import (
    DEVIATIONS,
    DIMENSIONS,
    ENERGY_UNITS,
    BoundClaim,
    Claim,
    LargestClaim,
    PrintedColumn,
    PublishedTable,
    RisesClaim,
    ShareClaim,
    Statement,
    TableError,
    TableRow,
    ValueClaim,
    load_text,
    same_load,
)
from winchcascade.core.quantity import find_unit, is_load
from winchcascade.core.toml_text import Expected, check_keys, entries, entry, read_toml, toml_values

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
    return parse_table(read_toml(path, "a table that can be read", TableError), str(path), name=path.stem)


def table_place(path: str) -> str:
    """Name the file of a table in a report: a built-in table by its name.

    >>> table_place(load_table("hsu2026-table2").path), table_place("mine/table.toml")
    ('built-in table hsu2026-table2', 'mine/table.toml')
    """
    return f"built-in table {Path(path).stem}" if Path(path).parent == _FOLDER else path


def parse_table(text: str, where: str, *, name: str = "table") -> PublishedTable:
    """Turn the text of a table file into a PublishedTable; `where` names the file in the one sentence of a TableError."""
    raw = toml_values(text, where, TableError)
    _known(raw, {"title", "source", "cycles", "columns", "row", "claim", *(f"{d}_percent" for d in DEVIATIONS)}, where)
    columns = _columns(raw.get("columns"), where)
    rows, total = _rows(_listed_tables(raw, "row", where, text), columns, where)
    caption = entries(raw, _Caption, where, TableError)
    return PublishedTable(
        name=name,
        title=caption.title,
        source=caption.source,
        columns=columns,
        rows=rows,
        cycles=caption.cycles,
        deviations={d: _deviation(raw, f"{d}_percent", where) for d in DEVIATIONS if f"{d}_percent" in raw},
        total=total,
        claims=tuple(_claim(listed) for listed in _listed_tables(raw, "claim", where, text)),
        path=where,
    )  # fmt: skip


def _known(raw: Mapping[str, object], known: set[str], place: str) -> None:
    check_keys(raw, known, f"{place}: ", f"no entry here; expected {', '.join(sorted(known))}", TableError)


def _get(raw: Mapping[str, object], key: str, kind: Any, place: str) -> Any:
    return entry(raw.get(key), key, kind, place, TableError)


class _Caption(msgspec.Struct, frozen=True):
    """Title and source of a table, and the number of cycles that its means are over."""

    title: Annotated[str, Expected('a text, such as title = "..."', str.strip)]
    source: Annotated[str, Expected('a text, such as source = "..."', str.strip)]
    cycles: Annotated[
        int | None,
        Expected("the number of cycles that the means are over, such as 3", lambda n: 1 <= n < 10**9),
    ] = None


class _Quotation(msgspec.Struct, frozen=True):
    """The words of a claim, and the place in the source."""

    says: Annotated[str, Expected('a text, such as says = "..."', str.strip)]
    where: Annotated[str, Expected('a text, such as where = "..."', str.strip)]


_Load = Annotated[float, Expected("ohms above 0, or inf for an open circuit", is_load)]
_Decimals = Annotated[
    int, Expected("how many are printed, such as 3, or -1 for values rounded to tens", lambda n: -9 <= n <= 12)
]
_Number = Annotated[
    float,
    Expected("a number without quotes, unit or thousands sign"),
    Expected("a finite number that is not negative", lambda x: math.isfinite(x) and x >= 0),
    Expected("less than 1e15, so check the unit of the column", lambda x: x <= 1e15),
]
_Percent = Annotated[_Number, Expected("percent of the mean, at most 100", lambda x: x <= 100)]


def _one_of(names: tuple[str, ...]) -> Any:
    """Type of an entry that is one of some names."""
    return Annotated[str, Expected(f"one of {', '.join(names)}", names.__contains__)]


_Metric, _Bounded = _one_of(tuple(DIMENSIONS)), _one_of((*DIMENSIONS, *DEVIATIONS))
_Stage = _one_of(tuple(DIMENSIONS)[:6])


class _Listed(NamedTuple):
    """One of several tables of a name: its entries, its place for a message, and the lines of its entries in the file.

    The line of its header has the key "".
    """

    raw: dict[str, object]
    place: str
    lines: dict[str, int]


def _listed_tables(raw: Mapping[str, object], key: str, where: str, text: str) -> list[_Listed]:
    """Tables of one name; without lines where the text writes them in another way than under [[headers]]."""
    kind = Annotated[list[dict[str, object]], Expected(f"[[{key}]] tables")]
    tables: list[dict[str, object]] = entry(raw.get(key, []), key, kind, where, TableError)
    lines: list[dict[str, int]] = []
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            inside = re.match(rf"\s*\[\[\s*{key}\s*\]\]", line) is not None
            lines += [{"": number}] if inside else []
        elif inside and (named := re.match(r"\s*(\w+)\s*=", line)):
            lines[-1].setdefault(named[1], number)
    if len(lines) != len(tables):
        lines = [{} for _ in tables]
    return [_Listed(table, f"{where}: {key} {k + 1}", lines[k]) for k, table in enumerate(tables)]


def _deviation(raw: Mapping[str, object], key: str, where: str) -> tuple[float, PrintedColumn]:
    """A deviation as printed: the digits written in the file show how it was rounded."""
    _, _, digits = repr(raw[key]).partition(".")
    return _get(raw, key, _Percent, where), PrintedColumn("%", len(digits) if digits.isdigit() else 0, 0.01)


_LIKE = {"energy": "J or kJ", "power": "W or kW", "number": "1 or %", "resistance": "ohm"}
"""Usual units of each dimension, for a message."""


def _column(raw: Mapping[str, object], dimension: str, place: str) -> PrintedColumn:
    """Unit and decimals of the numbers of a column, or of the number of a claim."""
    name = raw.get("unit")
    unit = find_unit(name) if isinstance(name, str) and dimension != "energy" else None
    factor = ENERGY_UNITS.get(str(name)) if dimension == "energy" else unit.factor if unit else None
    if factor is None or (unit is not None and unit.dimension != dimension):
        raise TableError(f"{place}: the unit {name!r} is none of {dimension}; expected one such as {_LIKE[dimension]}.")
    return PrintedColumn(str(name), _get(raw, "decimals", _Decimals, place), factor)


def _columns(raw: object, where: str) -> dict[str, PrintedColumn]:
    if not isinstance(raw, dict) or not raw:
        raise TableError(
            f'{where}: no columns; expected [columns] with an entry such as power_line = {{ unit = "W", decimals = 0 }}.'
        )
    _known(raw, {"load_ohm", *DIMENSIONS}, f"{where}: [columns]")
    columns = {}
    for name, cell in raw.items():
        place = f"{where}: [columns] {name}"
        if not isinstance(cell, dict):
            raise TableError(f'{place} is {cell!r}; expected {{ unit = "...", decimals = ... }}.')
        _known(cell, {"unit", "decimals"}, place)
        columns[name] = _column(cell, DIMENSIONS.get(name, "resistance"), place)
        if name == "load_ohm" and columns[name].factor != 1.0:
            raise TableError(f"{place}: the unit is {columns[name].unit!r}; expected ohm, as the name says.")
    return columns


def _rows(
    listed: list[_Listed], columns: Mapping[str, PrintedColumn], where: str
) -> tuple[tuple[TableRow, ...], TableRow | None]:
    rows: list[TableRow] = []
    total = None
    for raw, place, lines in listed:
        _known(raw, {"load_ohm", "total", *DIMENSIONS}, place)
        if raw.get("total", False) is not False:
            if total is not None:
                raise TableError(f"{place}: a second row has total = true; expected one row of sums.")
            odd = [] if raw["total"] is True else [f"total = {raw['total']!r}"]
            odd += [key for key in raw if key != "total" and DIMENSIONS.get(key) != "energy"]
            if odd:
                raise TableError(f"{place}: {odd[0]} in a row of sums; expected total = true and energies alone.")
            total = TableRow(math.nan, _cells(raw, columns, place), lines)
            continue
        load = _get(raw, "load_ohm", _Load, place)
        if any(same_load(row.load, load) for row in rows):
            raise TableError(f"{place}: {load_text(load)} has a row already; expected one row for each load.")
        rows.append(TableRow(load, _cells(raw, columns, place), lines))
    if not rows:
        raise TableError(f"{where}: no rows; expected a [[row]] table with load_ohm and its cells for each load.")
    return tuple(rows), total


def _cells(row: dict[str, object], columns: Mapping[str, PrintedColumn], place: str) -> dict[str, float]:
    cells = {}
    for metric in (metric for metric in DIMENSIONS if metric in row):
        if metric not in columns:
            raise TableError(f"{place}: {metric} has no entry under [columns]; add its unit and decimals there.")
        cells[metric] = _rounded(row, metric, columns[metric].decimals, place)
    if not cells:
        raise TableError(f"{place}: no cells; expected some of {', '.join(DIMENSIONS)}.")
    return cells


def _rounded(raw: Mapping[str, object], key: str, decimals: int, place: str) -> float:
    """Read a number that is printed with a given number of decimals."""
    value: float = _get(raw, key, _Number, place)
    if abs(value - round(value, decimals)) > 1e-9 * max(10.0**-decimals, value * 1e-3):
        raise TableError(
            f"{place}: {key} is {value:.15g}, but {decimals} decimals are said to be printed; expected a value "
            f"rounded to {10.0**-decimals:g}, so correct the cell or the decimals."
        )
    return value


def _claim(listed: _Listed) -> Claim:
    """Read a claim by the first key of `_CLAIMS` that it has."""
    raw, place, lines = listed
    kind = next((key for key in _CLAIMS if key in raw), None)
    if kind is None:
        raise TableError(f"{place}: nothing claimed; expected one of {', '.join(_CLAIMS)}.")
    known, read = _CLAIMS[kind]
    _known(raw, {"says", "where", *known}, place)
    quoted = entries(raw, _Quotation, place, TableError)
    return Claim(quoted.says, quoted.where, read(raw, place), lines.get(""))


def _each(raw: dict[str, object], key: str, kind: Any, place: str) -> tuple[Any, ...]:
    """Values of an entry that is a list or a single value."""
    value = raw.get(key)
    values = value if isinstance(value, list) and value else [value]
    return tuple(entry(one, key, kind, place, TableError) for one in values)


def _claimed(raw: dict[str, object], key: str, dimension: str, place: str) -> tuple[float, PrintedColumn]:
    column = _column(raw, dimension, place)
    return _rounded(raw, key, column.decimals, place), column


def _value(raw: dict[str, object], place: str) -> ValueClaim:
    metric = _get(raw, "metric", _Metric, place)
    value, column = _claimed(raw, "value", DIMENSIONS[metric], place)
    return ValueClaim(metric, _get(raw, "load_ohm", _Load, place), value, column)


def _share(raw: dict[str, object], place: str) -> ShareClaim:
    part, of = _get(raw, "part", _Stage, place), _get(raw, "of", _Stage, place)
    order = tuple(DIMENSIONS)
    if part.partition("_")[0] != of.partition("_")[0] or order.index(part) <= order.index(of):
        raise TableError(f"{place}: part is {part} and of is {of}; expected energies or powers, part behind of.")
    return ShareClaim(part, of, _get(raw, "load_ohm", _Load, place), *_claimed(raw, "value", "number", place))


def _bound(raw: dict[str, object], place: str) -> BoundClaim:
    if "at_most" in raw and "at_least" in raw:
        raise TableError(f"{place}: at_most and at_least together; expected one of them in a claim.")
    side: Literal["at_most", "at_least"] = "at_most" if "at_most" in raw else "at_least"
    metric = _get(raw, "metric", _Bounded, place)
    load = _get(raw, "load_ohm", _Load, place) if "load_ohm" in raw else None
    return BoundClaim(metric, side, load, *_claimed(raw, side, DIMENSIONS.get(metric, "number"), place))


def _largest(raw: dict[str, object], place: str) -> LargestClaim:
    return LargestClaim(_each(raw, "metric", _Metric, place), _each(raw, "largest_at_ohm", _Load, place))


def _rises(raw: dict[str, object], place: str) -> RisesClaim:
    first, last = _get(raw, "rises_from_ohm", _Load, place), _get(raw, "to_ohm", _Load, place)
    if same_load(first, last):
        raise TableError(f"{place}: rises_from_ohm and to_ohm are both {load_text(first)}; expected two loads.")
    return RisesClaim(_each(raw, "metric", _Metric, place), first, last)


_NUMBER = ("load_ohm", "unit", "decimals")
_CLAIMS: dict[str, tuple[tuple[str, ...], Callable[[dict[str, object], str], Statement]]] = {
    "part": (("part", "of", "value", *_NUMBER), _share),
    "value": (("metric", "value", *_NUMBER), _value),
    "at_most": (("metric", "at_most", "at_least", *_NUMBER), _bound),
    "at_least": (("metric", "at_most", "at_least", *_NUMBER), _bound),
    "largest_at_ohm": (("metric", "largest_at_ohm"), _largest),
    "rises_from_ohm": (("metric", "rises_from_ohm", "to_ohm"), _rises),
}
"""Kinds of claims by a key that each has: their keys, and how they are read. A share has a value too, so it comes first."""
