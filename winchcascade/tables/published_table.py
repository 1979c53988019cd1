"""A published table as data: columns with unit and law, rows found by their key cells, claims of
the text.

Cells stay as printed, in the unit of their column. A printed number stands for every value that
rounds to it; `Span` is that interval, in SI units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated

import msgspec
from msgspec import Meta

from winchcascade.core.campaign_file import Load
from winchcascade.core.errors import WinchcascadeError
from winchcascade.core.formula import Formula
from winchcascade.core.quantity import Unit, find_unit, same_load, unit_suffix
from winchcascade.reduction.efficiency import METRICS, RATIOS

DIMENSIONS = {"energy": "energy", "power": "power", "eta": "number"}
"""Dimensions of metrics, by the first word of their names."""

RESULTS_AT = {
    "file": "text", "cycle": "number", "load": "resistance",
    "speed": "rotation", "torque": "torque", "velocity": "velocity", "travel": "length",
}  # fmt: skip
"""What a result is at, beside its metrics: its log, its cycle, its load, speed and torque of its
shaft, plateau speed and travel of its payouts; each with its dimension."""

DEVIATIONS = ("deviation_energy", "deviation_eta")
"""Largest deviations of a cycle from the mean that a source may print: of energies and powers,
and of efficiencies.
"""


STATEMENTS = {
    "part": ("of", "value", "load_ohm"), "value": ("metric", "load_ohm"), "at_most": ("metric",), "at_least": ("metric",),
    "largest_at_ohm": ("metric",), "rises_from_ohm": ("metric", "to_ohm"),
}  # fmt: skip
"""What a claim may state, by the entry that it then has, and the other entries that it needs."""

SHARES = {
    tuple(name.replace("energy", kind) for name in pair): eta
    for kind in ("energy", "power") for eta, pair in RATIOS.items()
}  # fmt: skip
"""Efficiency that is the share of an energy or a power that arrives at a later stage."""

TABLE_UNITS = {
    "J": (1.0, "energy"), "kJ": (1e3, "energy"), "MJ": (1e6, "energy"), "Wh": (3600.0, "energy"), "kWh": (3.6e6, "energy"),
    "kg/m": (1.0, "mass per length"), "kg/m2": (1.0, "mass per area"), "kg/m3": (1.0, "density"),
    "W/m": (1.0, "power per width"), "kW/m": (1e3, "power per width"), "MW/m": (1e6, "power per "
                                                                                     "width"),
    "W/m2": (1.0, "power per area"), "kW/m2": (1e3, "power per area"),
}  # fmt: skip
"""Units that tables have and logs have not, with factor to SI and dimension: a log weighs in
kilograms, so that its kg/m is a stiffness."""

Text = Annotated[str, Meta(pattern=r"\S")]
Positive = Annotated[float, Meta(ge=0.0, le=1e15)]
Decimals = Annotated[int, Meta(ge=-9, le=12)]


class TableError(WinchcascadeError):
    """A file with a published table that cannot be used."""


def find_table_unit(unit: str) -> Unit | None:
    """A unit of a table: one of its own, else one that logs have; None for one that is unknown.

    >>> find_table_unit("kg/m³")
    Unit(dimension='density', factor=1.0, offset=0.0)
    """
    plain = unit.translate(_RAISED).replace("^", "").replace(" ", "")
    if plain in TABLE_UNITS:
        factor, dimension = TABLE_UNITS[plain]
        return Unit(dimension, factor)
    return find_unit(unit)


_RAISED = str.maketrans("²³", "23")


def unit_of(unit: str) -> tuple[float, str]:
    """Factor of a unit to SI, and its dimension; ValueError for one that is unknown."""
    found = find_table_unit(unit)
    if found is None:
        raise ValueError(f"the unit {unit!r} is unknown; expected one such as W, J, N.m, rpm or 1.")
    return found.factor, found.dimension


class Span(msgspec.Struct, frozen=True):
    """An interval of values, both ends included."""

    low: float
    high: float

    def meets(self, other: Span) -> bool:
        """Whether the two have a value in common."""
        return self.low <= other.high and other.low <= self.high

    def over(self, other: Span) -> Span:
        """Quotients of a value of this interval and one of another, both of values that are not
        negative.
        """
        return Span(self.low / other.high, self.high / max(other.low, 1e-300))


class Printed(msgspec.Struct, frozen=True):
    """A number as printed: in its unit with the factor to SI, with its decimals, -1 for one rounded
    to tens.

    `text` is as the source writes it, `line` its line in the file. The name of a log has NaN and a
    text, an open circuit inf.
    """

    value: float
    decimals: int
    unit: str = "1"
    factor: float = 1.0
    text: str = ""
    line: int | None = None

    @property
    def rounding(self) -> float:
        """Half a unit of the last printed decimal, in the unit printed.

        >>> Printed(5937.0, 0).rounding, Printed(0.76, 3).rounding
        (0.5, 0.0005)
        """
        return 0.5 * 10.0**-self.decimals if math.isfinite(self.value) else 0.0

    @property
    def span(self) -> Span:
        """Every value that rounds to what is printed, in SI units.

        >>> Printed(1.5, 1, "kW", 1000.0).span
        Span(low=1450.0, high=1550.0)
        """
        return Span(
            (self.value - self.rounding) * self.factor, (self.value + self.rounding) * self.factor
        )

    @property
    def words(self) -> str:
        """The number with its decimals and its unit.

        >>> Printed(5937.0, 0, "J").words, Printed(0.76, 3).words
        ('5937 J', '0.760')
        """
        return (self.text.strip() or self.fixed(self.value)) + unit_suffix(self.unit)

    def fixed(self, value: float, more: int = 0) -> str:
        """A value of this unit with the decimals printed, and some more."""
        return f"{value:.{max(self.decimals + more, 0)}f}"

    def range(self, span: Span) -> str:
        """An interval in SI units, in the unit printed with one decimal more."""
        low, high = (self.fixed(end / self.factor, 1) for end in (span.low, span.high))
        unit = unit_suffix(self.unit)
        if math.isinf(span.high):
            return f"{low}{unit} or more"
        return (
            f"at most {high}{unit}"
            if span.low <= 0
            else f"{low if low == high else f'{low} to {high}'}{unit}"
        )


class PrintedColumn(msgspec.Struct, frozen=True):
    """One column: its head in a CSV, its unit with the factor to SI, how it is rounded, and what it
    is of others.

    `measured` is the name of what is measured of it: a metric of the results, or an entry of
    `RESULTS_AT`. No value of it exceeds `at_most`.
    """

    head: str
    unit: str
    factor: float = 1.0
    dimension: str = "number"
    measured: str = ""
    decimals: int | None = None
    digits: int | None = None
    law: Formula | None = None
    at_most: float = math.inf


class TableRow(msgspec.Struct, frozen=True):
    """Cells of a row by column; its number from 1 on, its name in messages, and its line in the
    file.

    `load` is that of a row of a table by load [ohm], inf for an open circuit.
    """

    number: int
    name: str
    cells: Mapping[str, Printed]
    load: float | None = None
    line: int | None = None

    @property
    def spans(self) -> dict[str, Span]:
        """Its metrics of the paper as intervals, in SI units."""
        return {metric: self.cells[metric].span for metric in METRICS if metric in self.cells}


class Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A claim of the text as a table file states it: its words, the place in the source, what it
    states, and its line.

    It states the `value` of a metric at a load, or of the share of the energy or power `of` that
    arrives at `part`; a bound `at_most` or `at_least` on a metric at one load, or at all without
    one, or on the deviation of the cycles; that metrics are `largest_at_ohm` some loads, or that
    they rise from row to row, `rises_from_ohm` one load `to_ohm` another.
    """

    says: Text
    where: Text
    metric: str | tuple[str, ...] = ()
    load_ohm: Load | None = None
    value: Positive | None = None
    at_most: Positive | None = None
    at_least: Positive | None = None
    part: str | None = None
    of: str | None = None
    largest_at_ohm: Load | tuple[Load, ...] | None = None
    rises_from_ohm: Load | None = None
    to_ohm: Load | None = None
    unit: Text = "1"
    decimals: Decimals = 0
    line: int | None = None

    def __post_init__(self) -> None:
        """Reject a claim that states nothing, lacks something or names what is no metric:
        ValueError.
        """
        if missing := [name for name in STATEMENTS[self.kind] if getattr(self, name) in (None, ())]:
            raise ValueError(f"expected {' and '.join(missing)} beside {self.kind}.")
        known = (*METRICS, *(DEVIATIONS if self.kind.startswith("at_") else ()))
        if unknown := [name for name in self.metrics if name not in known]:
            raise ValueError(
                f"{unknown[0]!r} is no metric here; expected one of {', '.join(known)}."
            )
        if self.kind == "part" and self.metrics not in SHARES:
            raise ValueError(
                f"part is {self.part} and of is {self.of}; expected two energies or powers, part "
                f"behind of."
            )
        if len(set(self.loads)) < len(self.loads):
            raise ValueError(
                f"{self.kind} names a load twice; expected different ones, such as rises_from_ohm "
                f"and to_ohm."
            )
        wanted = (
            "number"
            if self.kind == "part"
            else DIMENSIONS.get(self.metrics[0].partition("_")[0], "number")
        )
        if self.number.value and unit_of(self.unit)[1] != wanted:
            raise ValueError(f"the unit {self.unit!r} is none of a {wanted}.")

    @property
    def kind(self) -> str:
        """What it states, as in `STATEMENTS`; ValueError for nothing."""
        kinds = [kind for kind in STATEMENTS if getattr(self, kind) is not None]
        if len(kinds) != 1 and kinds != ["part", "value"]:
            raise ValueError(
                f"it states {' and '.join(kinds) or 'nothing'}; expected one of "
                f"{', '.join(STATEMENTS)}."
            )
        return kinds[0]

    @property
    def metrics(self) -> tuple[str, ...]:
        """Metrics that it is about: those of a share are the part and what it is of."""
        named = (self.part, self.of) if self.kind == "part" else self.metric
        return (named,) if isinstance(named, str) else tuple(name or "" for name in named)

    @property
    def loads(self) -> tuple[float, ...]:
        """Loads that it is about, none for all. [ohm]"""
        stated = (self.load_ohm, self.largest_at_ohm, self.rises_from_ohm, self.to_ohm)
        return tuple(
            x
            for load in stated
            if load is not None
            for x in (load if isinstance(load, tuple) else (load,))
        )

    @property
    def number(self) -> Printed:
        """The number that it states; 0 without one."""
        return Printed(
            self.value or self.at_most or self.at_least or 0.0,
            self.decimals,
            self.unit,
            unit_of(self.unit)[0],
        )


class PublishedTable(msgspec.Struct, frozen=True):
    """A published table, whose rows are found by the columns `keys`.

    Rows `by_load` are means over `cycles` of one motion: the laws of the cascade hold between them.
    `deviations` are the maximum deviations of a cycle that the source prints [%]. Means of products
    may differ from products of means by the share `tolerance`, a measured key from a printed one by
    the share `key_share` of the largest printed one. `unread` names cells that hold a text where a
    number was expected. `path` and `csv` are the files of the table, empty for none.
    """

    name: str
    title: str
    source: str
    columns: Mapping[str, PrintedColumn]
    rows: tuple[TableRow, ...]
    keys: tuple[str, ...] = ()
    by_load: bool = False
    cycles: int | None = None
    deviations: Mapping[str, Printed] = msgspec.field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    tolerance: float = 0.0
    key_share: float = 0.02
    path: str = ""
    csv: str = ""
    unread: tuple[str, ...] = ()

    def row(self, load: float) -> TableRow | None:
        """The row of a load; None if there is none. 18 finds 18.0."""
        return next(
            (row for row in self.rows if row.load is not None and same_load(row.load, load)), None
        )
