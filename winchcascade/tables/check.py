"""Comparison of measured results with a published table, cell by cell and two-sided.

A row is found by its key columns: load, speed, torque, number of the cycle, name or number of the
log, or any metric. Cycles that are operating points of a dynamometer are compared one by one, logs
that repeat one motion by the mean of their cycles.

A cell allows ``|measured - printed| <= rounding + deviation + uncertainty + means``: half a unit of
its last printed decimal, the maximum deviation of the measured cycles from their mean, twice the
standard uncertainty that the sensors leave of the mean, and what the table allows a mean of
products to differ from the product of means. Of sensors that are calibrated in place, a reader of
the table knows only the limits of the makers: for the side of the table these count too, in
squares. The scatter of the cycles counts once, in the deviation. Where the table prints the largest
deviation of its cycles, the measured one counts up to that: a damaged log must not widen its own
tolerance.

Cycles differ by their motion, which moves all energies and powers of a row alike, and their
efficiencies deviate less. So the deviation of an energy is what the row as a whole differs by, and
that of the efficiencies.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import Origin
from winchcascade.core.errors import OptionError
from winchcascade.core.plain_text import first_of
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.measured import Measured
from winchcascade.tables.published_table import (
    Printed,
    PublishedTable,
    TableError,
    TableRow,
)
from winchcascade.tables.rows_of_results import MAX_NAMED, CheckError, by_rows, compared_columns
from winchcascade.tables.table_file import check_unit

COVERAGE = 2.0
"""Standard uncertainties of the measured mean that a cell allows: about 95 % (JCGM 100:2008,
6.3.3).
"""

ROW_MIN = 3
"""Energies and powers of a row of which the median shows what they have in common: a single
wrong one does not move it.
"""

_OF_A_MOTION = ("energy", "power")
"""Kinds of metrics that the motion of a cycle changes alike."""

_DUST = 1e-12
"""Share of the printed value that the arithmetic itself may miss."""

Counted = Literal["none", "budget", "budget_and_limits"]
"""What a tolerance counts of the sensors: nothing, the budget of the log, or with it the limits
of the makers.
"""

Outcome = Literal["ok", "miss", "not_measured", "no_run"]


class Factors(msgspec.Struct, frozen=True):
    """What each part of a tolerance is multiplied by: above 1 widens, below 1 narrows, 0 leaves
    it out. [1]
    """

    rounding: float = 1.0
    deviation: float = 1.0
    uncertainty: float = 1.0
    means: float = 1.0

    def __post_init__(self) -> None:
        """Reject a factor that is no number from 0 up."""
        for name in self.__struct_fields__:
            if not 0 <= (value := getattr(self, name)) < math.inf:
                raise OptionError(
                    f"tolerance factor {name} is {value:g}; expected a finite number that is not "
                    f"negative."
                )


SAME_LOGS = Factors(deviation=0.0, uncertainty=0.0, means=0.0)
"""Of a table that was made from these very logs: repetition and sensors are the same on both sides,
so that only rounding is allowed."""


class CellCheck(msgspec.Struct, frozen=True):
    """One cell of the table beside its measured value, all in the unit of its column.

    `log` names the run, None where there is none. `limits` is the part of `uncertainty`, in
    squares, that the limits of the sensors make. `u` is the standard uncertainty of the measured
    value, which decides its digits, None where it is not known.
    """

    row: TableRow
    metric: str
    cell: Printed
    log: str | None = None
    measured: float | None = None
    rounding: float = 0.0
    deviation: float = 0.0
    uncertainty: float = 0.0
    limits: float = 0.0
    means: float = 0.0
    u: float | None = None

    @property
    def tolerance(self) -> float:
        """What the measured value may differ by."""
        return self.rounding + self.deviation + self.uncertainty + self.means

    @property
    def basis(self) -> Counted:
        """What the tolerance counts of the sensors."""
        return "budget_and_limits" if self.limits else "budget" if self.uncertainty else "none"

    @property
    def difference(self) -> float | None:
        """Measured less printed."""
        return None if self.measured is None else self.measured - self.cell.value

    @property
    def missed_by(self) -> float | None:
        """How far the difference lies beyond the tolerance; 0 within it, None without a measured
        value.
        """
        return None if self.difference is None else max(0.0, abs(self.difference) - self.tolerance)

    @property
    def outcome(self) -> Outcome:
        """Whether the measured value agrees with the printed one, or why there is none."""
        if self.missed_by is None:
            return "no_run" if self.log is None else "not_measured"
        return "ok" if self.missed_by <= _DUST * abs(self.cell.value) else "miss"

    @property
    def ok(self) -> bool:
        """Whether the measured value agrees with the printed one."""
        return self.outcome == "ok"


class Check(Viewed, frozen=True):
    """All cells of a table against measured results.

    `notes` describes in sentences what was left out, capped or not known; `findings` holds, by row,
    those of its logs; `origins` where the data of each log come from.
    """

    table: PublishedTable
    factors: Factors
    cells: tuple[CellCheck, ...]
    notes: tuple[str, ...]
    findings: tuple[tuple[TableRow, tuple[str, ...]], ...] = ()
    origins: tuple[Origin, ...] = ()

    def __repr__(self) -> str:
        """One line instead of every number."""
        return f"Check({self.table.name!r}, {len(self.cells) - len(self.misses)} of {len(self.cells)} cells agree)"

    @property
    def misses(self) -> tuple[CellCheck, ...]:
        """The cells that do not agree, were not measured or have no run."""
        return tuple(cell for cell in self.cells if not cell.ok)

    @property
    def ok(self) -> bool:
        """Whether every cell agrees."""
        return not self.misses


def check(
    results: Sequence[Measured],
    table: PublishedTable,
    factors: Factors | None = None,
    *,
    whole_campaign: bool = True,
) -> Check:
    """Hold measured results against every row of a published table.

    Parameters
    ----------
    results : of logs or their cycles, as `measured` takes them from the records of reductions
    factors : on the parts of every tolerance, 1 if not given
    whole_campaign : a row of the table without a result is a miss; else it is left out with a note

    Raises
    ------
    CheckError : no result belongs to a row, or no row has a cell that can be compared
    TableError : the table has no key, or a unit does not fit what is measured
    """
    if not table.keys:
        raise TableError(
            f"{table.path}: has no key, so that no result can be assigned to a row; expected one "
            f'such as key = "speed", or '
            f'key = ["torque", "speed"].'
        )
    factors, notes = factors or Factors(), list[str]()
    for name, column in table.columns.items():
        check_unit(column, f"{table.path}: [columns] {name}")
    compared = compared_columns(table, results, notes)
    found = by_rows(results, table, notes)
    cells: list[CellCheck] = []
    findings, empty = [], list[str]()
    for k, row in enumerate(table.rows):
        of_row = tuple(found.get(k, ()))
        if not of_row and not whole_campaign:
            empty.append(row.name)
            continue
        names = [name for name in compared if name in row.cells]
        for result in of_row or (None,):
            cells += _as_a_row(
                [_cell(table, row, name, result, factors) for name in names], table, result, factors
            )
        if messages := tuple(dict.fromkeys(text for result in of_row for text in result.findings)):
            findings.append((row, messages))
    notes += (
        [f"no result belongs to {first_of(empty, MAX_NAMED, '; ')}; left out."] if empty else []
    )
    if not cells:
        raise CheckError(
            f"{table.name}: no row has a cell that can be compared; the columns "
            f"{', '.join(compared)} are empty."
        )
    used = [result for k in sorted(found) for result in found[k]]
    notes += _counted_otherwise(table, used, compared, factors)
    notes += _whole_payouts(table, found, cells)
    return Check(
        table, factors, tuple(cells), tuple(notes), tuple(findings), tuple(r.origin for r in used)
    )


def _whole_payouts(
    table: PublishedTable, found: Mapping[int, Sequence[Measured]], cells: Sequence[CellCheck]
) -> list[str]:
    """A note where the line energies that the table prints are those of whole payouts, and not
    of the windows.
    """
    column = next((name for name, c in table.columns.items() if c.measured == "energy_line"), None)
    rows = {table.rows[k].number: results for k, results in found.items()}
    of = [
        (c, result)
        for c in cells
        if c.metric == column
        for result in rows.get(c.row.number, ())
        if result.name == c.log
    ]
    missed = [c.outcome == "miss" for c, _ in of]
    fits = [
        payout is not None and abs(payout / c.cell.factor - c.cell.value) <= c.tolerance
        for c, payout in ((c, result.values.get("energy_payout")) for c, result in of)
    ]
    if not of or 2 * sum(missed) <= len(of) or 2 * sum(fits) <= len(of):
        return []
    return [
        f"{column}: {sum(fits)} of {len(of)} cells fit the energy of the whole payout, "
        f"{len(of) - sum(missed)} that of the "
        "window; reduce the logs with --window payout."
    ]


# -------------------------------------------------------------------------------------- the cells
def _cell(
    table: PublishedTable, row: TableRow, name: str, result: Measured | None, factors: Factors
) -> CellCheck:
    cell, metric = row.cells[name], table.columns[name].measured
    bare = CellCheck(row, name, cell, None if result is None else result.name)
    value = None if result is None else result.values.get(metric)
    if result is None or value is None:
        return bare
    claimed, deviation = _claimed(table, metric), result.deviation.get(metric) or 0.0
    deviation = deviation if claimed is None else min(deviation, 100.0 * claimed.span.high)
    own, limits = (
        COVERAGE * (part.get(metric) or 0.0) / cell.factor
        for part in (result.uncertainty, result.limits)
    )
    return replace(
        bare,
        measured=value / cell.factor,
        rounding=factors.rounding * cell.rounding,
        deviation=factors.deviation * deviation / 100.0 * abs(value) / cell.factor,
        uncertainty=factors.uncertainty * math.hypot(own, limits),
        limits=factors.uncertainty * limits,
        means=factors.means * table.tolerance * abs(cell.value),
        u=None if (u := result.u.get(metric)) is None else u / cell.factor,
    )


def _as_a_row(
    cells: Sequence[CellCheck], table: PublishedTable, result: Measured | None, factors: Factors
) -> list[CellCheck]:
    """Cells of a row, with the deviation of energies and powers as what they have in common, and
    what efficiencies deviate.

    What they have in common is the median of their differences, up to the deviation of each.
    """
    metrics = [table.columns[cell.metric].measured for cell in cells]
    alone = [
        x for m, x in (result.deviation if result else {}).items() if m in RATIOS and x is not None
    ]
    shares = {
        k: x / c.cell.value
        for k, c in enumerate(cells)
        if c.deviation
        and c.cell.value
        and metrics[k].startswith(_OF_A_MOTION)
        and (x := c.difference) is not None
    }
    if len(shares) < ROW_MIN or not alone:
        return [*cells]
    common, found = float(np.median([*shares.values()])), [*cells]
    for k, share in shares.items():
        cell = cells[k]
        own = factors.deviation * max(alone) / 100.0 * abs(cell.cell.value)
        shift = abs(common * cell.cell.value) if share * common > 0.0 else 0.0
        found[k] = replace(cell, deviation=min(cell.deviation, shift + own))
    return found


def _claimed(table: PublishedTable, metric: str) -> Printed | None:
    """Largest deviation of a cycle that the table prints for a metric. [%]"""
    return table.deviations.get("deviation_eta" if metric.startswith("eta") else "deviation_energy")


def _counted_otherwise(
    table: PublishedTable, results: Sequence[Measured], compared: Sequence[str], factors: Factors
) -> list[str]:
    """Parts of tolerances that do not count as measured: capped by the table, or unknown and 0."""
    beyond: dict[str, list[str]] = {}
    unknown: dict[str, dict[str, list[str]]] = {"maximum deviation": {}, "standard uncertainty": {}}
    for result, name in itertools.product(results, compared):
        metric = table.columns[name].measured
        if result.values.get(metric) is None:
            continue
        claimed, deviation = _claimed(table, metric), result.deviation.get(metric)
        if claimed is not None and (deviation or 0.0) > 100.0 * claimed.span.high:
            beyond.setdefault(result.name, []).append(
                f"{name} {deviation:.3g} %, the table {claimed.words}"
            )
        if factors.deviation and deviation is None:
            unknown["maximum deviation"].setdefault(result.name, []).append(name)
        if factors.uncertainty and result.uncertainty.get(metric) is None:
            unknown["standard uncertainty"].setdefault(result.name, []).append(name)
    notes = [
        f"{name}: its cycles deviate by more than the table prints ({'; '.join(metrics)}), whose "
        f"deviation counts. Look for a "
        "damaged cycle."
        for name, metrics in beyond.items()
    ]
    for part, names in ((part, names) for part, names in unknown.items() if names):
        metrics = ", ".join(dict.fromkeys(name for some in names.values() for name in some))
        notes.append(
            f"{first_of(list(names), MAX_NAMED)}: the {part} is not known of {metrics}; it counts "
            f"as 0."
        )
    return notes
