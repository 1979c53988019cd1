"""Published tables as TOML: reading one file, and what is wrong with it in one sentence."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from winchcascade.core.published_table import (
    DEVIATIONS,
    DIMENSIONS,
    ENERGY_UNITS,
    BoundClaim,
    Claim,
    Column,
    LargestClaim,
    RisesClaim,
    Row,
    ShareClaim,
    Table,
    TableError,
    ValueClaim,
    load_text,
    same_load,
)
from winchcascade.core.quantity import find_unit, is_load
from winchcascade.core.toml_text import Expected, check_keys, entries, entry, read_toml, toml_values

BUILT_IN = ("hsu2026-table2",)
_FOLDER = Path(__file__).parent.parent / "published"


def load_table(table: str | Path) -> Table:
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
    text = read_toml(path, "table", TableError)
    return parse_table(text, str(path), name=path.stem)


def parse_table(text: str, where: str, *, name: str = "table") -> Table:
    """Turn the text of a table file into a Table; `where` names the file in the one sentence of a TableError."""
    raw = toml_values(text, where, TableError)
    _known(raw, {"title", "source", "cycles", "columns", "row", "claim", *(f"{d}_percent" for d in DEVIATIONS)}, where)
    columns = _columns(raw.get("columns"), where)
    rows, total = _rows(_tables(raw, "row", where), columns, where, _lines(text, "row"))
    marks, caption = _lines(text, "claim"), entries(raw, _Caption, where, TableError)
    return Table(
        name=name,
        title=caption.title,
        source=caption.source,
        columns=columns,
        rows=rows,
        cycles=caption.cycles,
        deviations={d: _deviation(raw, f"{d}_percent", where) for d in DEVIATIONS if f"{d}_percent" in raw},
        total=total,
        claims=tuple(
            _claim(claim, f"{where}: claim {k}", _line(marks, k)) for k, claim in enumerate(_tables(raw, "claim", where), 1)
        ),
        path=where,
    )  # fmt: skip


def _known(raw: Mapping[str, Any], known: set[str], place: str) -> None:
    check_keys(raw, known, f"{place}: ", f"no entry here; expected {', '.join(sorted(known))}", TableError)


class _Caption(msgspec.Struct, frozen=True):
    """What a table is, and the number of cycles that its means are over."""

    title: Annotated[str, Expected('a text, such as title = "..."', str.strip)]
    source: Annotated[str, Expected('a text, such as source = "..."', str.strip)]
    cycles: Annotated[
        int | None,
        Expected("the number of cycles that the means are over, such as 3", lambda n: 1 <= n < 10**9),
    ] = None


class _Quotation(msgspec.Struct, frozen=True):
    """What a text claims, and the place in it."""

    says: Annotated[str, Expected('a text, such as says = "..."', str.strip)]
    where: Annotated[str, Expected('a text, such as where = "..."', str.strip)]


_Load = Annotated[float, Expected("ohms above 0, or inf for an open circuit", is_load)]
_Decimals = Annotated[
    int, Expected("how many are printed, such as 3, or -1 for values rounded to tens", lambda n: -9 <= n <= 12)
]


def _number(raw: Mapping[str, Any], key: str, place: str) -> float:
    value = raw.get(key)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TableError(f"{place}: {key} is {value!r}; expected a number without quotes, unit or thousands sign.")
    if not math.isfinite(value) or value < 0:
        raise TableError(f"{place}: {key} is {value}; expected a finite number that is not negative.")
    if value > 1e15:
        raise TableError(f"{place}: {key} is {value:g}; expected less than 1e15, so check the unit of the column.")
    return float(value)


def _ohms(raw: Mapping[str, Any], key: str, place: str) -> float:
    ohm: float = entry(raw.get(key), key, _Load, place, TableError)
    return ohm


def _tables(raw: Mapping[str, Any], key: str, where: str) -> list[dict[str, Any]]:
    kind = Annotated[list[dict[str, Any]], Expected(f"[[{key}]] tables")]
    tables: list[dict[str, Any]] = entry(raw.get(key, []), key, kind, where, TableError)
    return tables


def _deviation(raw: Mapping[str, Any], key: str, where: str) -> tuple[float, Column]:
    """A deviation as printed: the digits written in the file say how it was rounded."""
    value = _number(raw, key, where)
    if value > 100:
        raise TableError(f"{where}: {key} is {value:g}; expected percent of the mean, at most 100.")
    _, _, digits = repr(raw[key]).partition(".")
    return value, Column("%", len(digits) if digits.isdigit() else 0, 0.01)


def _unit(raw: object, dimension: str, place: str) -> tuple[str, float]:
    factor = None
    if isinstance(raw, str):
        unit = find_unit(raw)
        known = unit is not None and unit.dimension == dimension
        factor = ENERGY_UNITS.get(raw) if dimension == "energy" else unit.factor if unit and known else None
    if factor is None or not isinstance(raw, str):
        like = {"energy": "J or kJ", "power": "W or kW", "number": "1 or %", "resistance": "ohm"}[dimension]
        raise TableError(f"{place}: the unit {raw!r} is none of {dimension}; expected one such as {like}.")
    return raw, factor


def _column(raw: Mapping[str, Any], dimension: str, place: str) -> Column:
    """Unit and decimals of the numbers of a column, or of the number of a claim."""
    unit, factor = _unit(raw.get("unit"), dimension, place)
    return Column(unit, entry(raw.get("decimals"), "decimals", _Decimals, place, TableError), factor)


def _columns(raw: object, where: str) -> dict[str, Column]:
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
    raw: list[dict[str, Any]], columns: Mapping[str, Column], where: str, lines: list[dict[str, int]]
) -> tuple[tuple[Row, ...], Row | None]:
    rows: list[Row] = []
    total = None
    for number, cells in enumerate(raw, 1):
        place = f"{where}: row {number}"
        _known(cells, {"load_ohm", "total", *DIMENSIONS}, place)
        marks = lines[number - 1] if len(lines) == len(raw) else {}
        if cells.get("total", False) is not False:
            if total is not None:
                raise TableError(f"{place}: a second row has total = true; expected one row of sums.")
            total = _total(cells, columns, place, marks)
            continue
        load = _ohms(cells, "load_ohm", place)
        if any(same_load(row.load, load) for row in rows):
            raise TableError(f"{place}: {load_text(load)} has a row already; expected one row for each load.")
        rows.append(Row(load, _cells(cells, columns, place), marks))
    if not rows:
        raise TableError(f"{where}: no rows; expected a [[row]] table with load_ohm and its cells for each load.")
    return tuple(rows), total


def _total(row: dict[str, Any], columns: Mapping[str, Column], place: str, marks: dict[str, int]) -> Row:
    odd = [key for key in row if key != "total" and DIMENSIONS.get(key) != "energy"]
    if row["total"] is not True or odd:
        found = f"total = {row['total']!r}" if row["total"] is not True else odd[0]
        raise TableError(f"{place}: {found} in a row of sums; expected total = true and energies alone.")
    return Row(math.nan, _cells(row, columns, place), marks)


def _cells(row: dict[str, Any], columns: Mapping[str, Column], place: str) -> dict[str, float]:
    cells = {}
    for metric in DIMENSIONS:
        if metric not in row:
            continue
        if metric not in columns:
            raise TableError(f"{place}: {metric} has no entry under [columns]; add its unit and decimals there.")
        cells[metric] = _rounded(_number(row, metric, place), columns[metric].decimals, metric, place)
    if not cells:
        raise TableError(f"{place}: no cells; expected some of {', '.join(DIMENSIONS)}.")
    return cells


def _rounded(value: float, decimals: int, key: str, place: str) -> float:
    if abs(value - round(value, decimals)) > 1e-9 * max(10.0**-decimals, value * 1e-3):
        raise TableError(
            f"{place}: {key} is {value:.15g}, but {decimals} decimals are said to be printed; expected a value "
            f"rounded to {10.0**-decimals:g}, so correct the cell or the decimals."
        )
    return value


def _claim(raw: dict[str, Any], place: str, line: int | None) -> Claim:
    """Read a claim by the one key that tells its kind."""
    for key, read in _CLAIMS.items():
        if key in raw:
            return read(raw, place, line)
    raise TableError(f"{place}: nothing claimed; expected one of {', '.join(_CLAIMS)}.")


def _words(raw: dict[str, Any], known: set[str], place: str) -> tuple[str, str]:
    _known(raw, {"says", "where", *known}, place)
    quoted = entries(raw, _Quotation, place, TableError)
    return quoted.says, quoted.where


def _metric(raw: dict[str, Any], key: str, place: str, known: tuple[str, ...] = tuple(DIMENSIONS)) -> str:
    value = raw.get(key)
    if not isinstance(value, str) or value not in known:
        raise TableError(f"{place}: {key} is {value!r}; expected one of {', '.join(known)}.")
    return value


def _metrics(raw: dict[str, Any], place: str) -> tuple[str, ...]:
    value = raw.get("metric")
    names = value if isinstance(value, list) and value else [value]
    return tuple(_metric({"metric": name}, "metric", place) for name in names)


def _claimed(raw: dict[str, Any], key: str, dimension: str, place: str) -> tuple[float, Column]:
    column = _column(raw, dimension, place)
    return _rounded(_number(raw, key, place), column.decimals, key, place), column


def _value_claim(raw: dict[str, Any], place: str, line: int | None) -> ValueClaim:
    says, where = _words(raw, {"metric", "load_ohm", "value", "unit", "decimals"}, place)
    metric = _metric(raw, "metric", place)
    value, column = _claimed(raw, "value", DIMENSIONS[metric], place)
    return ValueClaim(says, where, metric, _ohms(raw, "load_ohm", place), value, column, line)


_STAGES = tuple(DIMENSIONS)[:6]


def _share_claim(raw: dict[str, Any], place: str, line: int | None) -> ShareClaim:
    says, where = _words(raw, {"part", "of", "load_ohm", "value", "unit", "decimals"}, place)
    part, of = _metric(raw, "part", place, _STAGES), _metric(raw, "of", place, _STAGES)
    kind, _, later = part.partition("_")
    order = ("line", "mech", "gen")
    if not of.startswith(kind) or order.index(later) <= order.index(of.partition("_")[2]):
        raise TableError(f"{place}: part is {part} and of is {of}; expected energies or powers, part behind of.")
    value, column = _claimed(raw, "value", "number", place)
    return ShareClaim(says, where, part, of, _ohms(raw, "load_ohm", place), value, column, line)


def _bound_claim(raw: dict[str, Any], place: str, line: int | None) -> BoundClaim:
    says, where = _words(raw, {"metric", "load_ohm", "at_most", "at_least", "unit", "decimals"}, place)
    if "at_most" in raw and "at_least" in raw:
        raise TableError(f"{place}: at_most and at_least together; expected one of them in a claim.")
    side: Literal["at_most", "at_least"] = "at_most" if "at_most" in raw else "at_least"
    metric = _metric(raw, "metric", place, (*DIMENSIONS, *DEVIATIONS))
    load = _ohms(raw, "load_ohm", place) if "load_ohm" in raw else None
    value, column = _claimed(raw, side, DIMENSIONS.get(metric, "number"), place)
    return BoundClaim(says, where, metric, side, load, value, column, line)


def _largest_claim(raw: dict[str, Any], place: str, line: int | None) -> LargestClaim:
    says, where = _words(raw, {"metric", "largest_at_ohm"}, place)
    value = raw["largest_at_ohm"]
    loads = value if isinstance(value, list) and value else [value]
    largest = tuple(_ohms({"largest_at_ohm": load}, "largest_at_ohm", place) for load in loads)
    return LargestClaim(says, where, _metrics(raw, place), largest, line)


def _rises_claim(raw: dict[str, Any], place: str, line: int | None) -> RisesClaim:
    says, where = _words(raw, {"metric", "rises_from_ohm", "to_ohm"}, place)
    first, last = _ohms(raw, "rises_from_ohm", place), _ohms(raw, "to_ohm", place)
    if same_load(first, last):
        raise TableError(f"{place}: rises_from_ohm and to_ohm are both {load_text(first)}; expected two loads.")
    return RisesClaim(says, where, _metrics(raw, place), first, last, line)


_CLAIMS: dict[str, Callable[[dict[str, Any], str, int | None], Claim]] = {
    "part": _share_claim,
    "value": _value_claim,
    "at_most": _bound_claim,
    "at_least": _bound_claim,
    "largest_at_ohm": _largest_claim,
    "rises_from_ohm": _rises_claim,
}
"""By the key that tells it, how a kind of claim is read; a share has a value too, so it comes first."""


def _lines(text: str, header: str) -> list[dict[str, int]]:
    """Lines of the entries of each [[header]] table, counted from 1; the header itself has the key ""."""
    found: list[dict[str, int]] = []
    inside = False
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            inside = re.match(rf"\s*\[\[\s*{header}\s*\]\]", line) is not None
            if inside:
                found.append({"": number})
        elif inside and (entry := re.match(r"\s*(\w+)\s*=", line)):
            found[-1].setdefault(entry[1], number)
    return found


def _line(marks: list[dict[str, int]], number: int) -> int | None:
    return marks[number - 1][""] if number <= len(marks) else None
