"""A published table as data: columns with unit and printed decimals, rows by load, and the claims of the text.

Cells stay as printed, in the unit of their column. A printed number stands for every value that rounds to it; `Span`
is that interval, in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Load
from winchcascade.core.errors import WinchcascadeError

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
        """Whether the two have a value in common.

        >>> Span(1.0, 2.0).meets(Span(2.0, 3.0)), Span(1.0, 2.0).meets(Span(2.1, 3.0))
        (True, False)
        """
        return self.low <= other.high and other.low <= self.high

    def over(self, other: Span) -> Span:
        """Quotients of a value of this interval and one of another, both of values that are not negative.

        >>> Span(1.0, 2.0).over(Span(4.0, 5.0))
        Span(low=0.2, high=0.5)
        """
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
    """Whether two loads are the same number of ohms.

    >>> same_load(18, 18.0), same_load(float("inf"), float("inf")), same_load(4.5, 4.6)
    (True, True, False)
    """
    return math.isclose(one, other, rel_tol=1e-9)


def load_text(load: float) -> str:
    """A load as people write it.

    >>> load_text(4.5), load_text(float("inf"))
    ('4.5 ohm', 'open circuit')
    """
    return "open circuit" if math.isinf(load) else f"{load:.12g} ohm"


def unit_suffix(unit: str) -> str:
    """A unit as it follows a number; nothing for a pure number.

    >>> unit_suffix("W"), unit_suffix("1")
    (' W', '')
    """
    return "" if unit in ("1", "-") else f" {unit}"
