"""A published table as data, read from a TOML file: columns with unit and printed decimals, rows by load, claims of the text.

Cells stay as printed, in the unit of their column. A printed number stands for every value that rounds to it; `Span`
is that interval, in SI units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from itertools import combinations
from os.path import isfile  # unlike that of Path no error for a name that no file can have
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Load
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.quantity import find_unit
from winchcascade.core.toml_file import Table, check_keys, convert, read_toml, toml_values

DIMENSIONS = {
    "energy_line": "energy", "energy_mech": "energy", "energy_gen": "energy",
    "power_line": "power", "power_mech": "power", "power_gen": "power",
    "eta_trans": "number", "eta_gen": "number", "eta_pto": "number",
}  # fmt: skip
"""What each of the nine metrics measures."""

ENERGY_UNITS = {"J": 1.0, "kJ": 1e3, "MJ": 1e6, "Wh": 3600.0, "kWh": 3.6e6}
"""Units of an energy by their factor to joules; log files have none, so the common table of units does not hold them."""

Deviation = Literal["deviation_energy", "deviation_eta"]
DEVIATIONS: tuple[Deviation, ...] = ("deviation_energy", "deviation_eta")

Text = Annotated[str, Meta(pattern=r"\S")]
Printed = Annotated[float, Meta(ge=0.0, le=1e15)]
_Decimals = Annotated[int, Meta(ge=-9, le=12)]


class TableError(WinchcascadeError):
    """A file with a published table that cannot be used."""


class Span(msgspec.Struct, frozen=True):
    """An interval of values, both ends included."""

    low: float
    high: float

    def meets(self, other: Span) -> bool:
        """Whether the two have a value in common."""
        return self.low <= other.high and other.low <= self.high

    def over(self, other: Span) -> Span:
        """Quotients of a value of this interval and one of another, both of values that are not negative."""
        return Span(self.low / other.high, self.high / max(other.low, 1e-300))


class PrintedColumn(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Unit of a column, the decimals printed, -1 for values rounded to tens, and the factor of the unit to SI."""

    unit: str
    decimals: _Decimals
    factor: float = 1.0

    @property
    def rounding(self) -> float:
        """Half a unit of the last printed decimal, in the unit of the column.

        >>> PrintedColumn("J", 0).rounding, PrintedColumn("1", 3).rounding
        (0.5, 0.0005)
        """
        return 0.5 * 10.0**-self.decimals

    def span(self, printed: float) -> Span:
        """Every value that rounds to what is printed, in SI units.

        >>> PrintedColumn("kW", 1, 1000.0).span(1.5)
        Span(low=1450.0, high=1550.0)
        """
        return Span((printed - self.rounding) * self.factor, (printed + self.rounding) * self.factor)

    def text(self, printed: float) -> str:
        """A value with the printed decimals and the unit.

        >>> PrintedColumn("J", 0).text(5937.0), PrintedColumn("1", 3).text(0.76)
        ('5937 J', '0.760')
        """
        return f"{printed:.{max(self.decimals, 0)}f}{unit_suffix(self.unit)}"


class TableRow(msgspec.Struct, frozen=True):
    """Cells of one load [ohm, inf for an open circuit] as printed; `lines` holds the line of each in the file.

    The line of the row itself has the key "".
    """

    load: float
    cells: Mapping[str, float]
    lines: Mapping[str, int] = msgspec.field(default_factory=dict)


STATEMENTS = {
    "part": ("of", "value", "load"), "value": ("metrics", "load"), "at_most": ("metrics",), "at_least": ("metrics",),
    "loads": ("metrics",), "first": ("metrics", "last"),
}  # fmt: skip
"""What a claim may state, by a field that it then has, and the other fields that it needs; a share has a value, too."""


class Claim(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    rename={
        "metrics": "metric",
        "load": "load_ohm",
        "loads": "largest_at_ohm",
        "first": "rises_from_ohm",
        "last": "to_ohm",
    },
):
    """A claim of the text: its words, the place in the source, its line in the file of the table, and what it states.

    `value` is that of a metric at a load, or the share in percent of the energy or power of the stage `of` that arrives at the
    stage `part`. `at_most` and `at_least` bound a metric at one load, or at all where that is NaN, or the deviation of the
    cycles. At `loads` metrics are largest; from `first` to `last` they rise from row to row. `column` has unit and decimals of
    the number.
    """

    says: Text
    where: Text
    metrics: tuple[str, ...] = ()
    load: Load = math.nan
    value: Printed | None = None
    at_most: Printed | None = None
    at_least: Printed | None = None
    part: str = ""
    of: str = ""
    loads: tuple[Load, ...] = ()
    first: Load = math.nan
    last: Load = math.nan
    column: PrintedColumn = PrintedColumn("1", 0)
    line: int | None = None

    def __post_init__(self) -> None:
        """Reject a claim that states nothing, lacks something or names what is no metric: ValueError."""
        missing = [name for name in STATEMENTS[self.kind] if not self._has(name)]
        if missing:
            raise ValueError(f"expected {' and '.join(missing)} beside {self.kind}.")
        for name in self.metrics or (self.part, self.of):
            if name not in DIMENSIONS and not (name in DEVIATIONS and self.kind.startswith("at_")):
                raise ValueError(f"{name!r} is no metric here; expected one of {', '.join(DIMENSIONS)}.")
        if self.part and (
            DIMENSIONS[self.part] != DIMENSIONS[self.of]
            or [*DIMENSIONS].index(self.part) <= [*DIMENSIONS].index(self.of)
        ):
            raise ValueError(f"part is {self.part} and of is {self.of}; expected energies or powers, part behind of.")
        if self.first == self.last:
            raise ValueError(f"rises_from_ohm and to_ohm are both {load_text(self.first)}; expected two loads.")

    def _has(self, name: str) -> bool:
        """Whether a field is stated."""
        value = getattr(self, name)
        return value not in (None, "", ()) and value == value

    @property
    def kind(self) -> str:
        """What it states, as in `STATEMENTS`; ValueError for nothing."""
        kinds = [kind for kind in STATEMENTS if self._has(kind)]
        if len(kinds) != 1 and kinds != ["part", "value"]:
            raise ValueError(f"it states {' and '.join(kinds) or 'nothing'}; expected one of {', '.join(STATEMENTS)}.")
        return kinds[0]

    @property
    def number(self) -> float:
        """The number that it gives, in the unit of its column; 0 without one."""
        return self.value or self.at_most or self.at_least or 0.0


class PublishedTable(msgspec.Struct, frozen=True):
    """A published table.

    `cycles` is the number of cycles that the means are over. `deviations` holds the largest deviation of any cycle from
    the mean where the source prints one [%], of energies and powers and of efficiencies. `total` has the sums of the
    energies.
    """

    name: str
    title: str
    source: str
    columns: Mapping[str, PrintedColumn]
    rows: tuple[TableRow, ...]
    cycles: int | None = None
    deviations: Mapping[Deviation, tuple[float, PrintedColumn]] = msgspec.field(default_factory=dict)
    total: TableRow | None = None
    claims: tuple[Claim, ...] = ()
    path: str = ""

    def row(self, load: float) -> TableRow | None:
        """The row of a load; None if there is none. 18 finds 18.0."""
        return next((row for row in self.rows if same_load(row.load, load)), None)

    def span(self, metric: str, printed: float) -> Span:
        """Every value of a metric that rounds to what is printed, in SI units."""
        return self.columns[metric].span(printed)

    def spans(self, row: TableRow) -> dict[str, Span]:
        """The cells of a row as intervals, in SI units."""
        return {metric: self.span(metric, printed) for metric, printed in row.cells.items()}

    def cell(self, row: TableRow, metric: str) -> str:
        """A cell as a text, with its unit."""
        return self.columns[metric].text(row.cells[metric])


def same_load(one: float, other: float) -> bool:
    """Whether two loads are the same number of ohms."""
    return math.isclose(one, other, rel_tol=1e-9)


def load_text(load: float) -> str:
    """A load as people write it."""
    return "open circuit" if math.isinf(load) else f"{load:.12g} ohm"


def unit_suffix(unit: str) -> str:
    """A unit as it follows a number; nothing for a pure number."""
    return "" if unit in ("1", "-") else f" {unit}"


BUILT_IN = ("hsu2026-table2",)
"""Names of built-in tables."""

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
