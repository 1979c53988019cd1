"""Comparison of measured results with a published table, cell by cell and two-sided.

A cell allows ``|measured - printed| <= rounding + deviation + uncertainty``: half a unit of its last printed decimal, the
largest deviation of the measured cycles from their mean, and twice the standard uncertainty that the sensors leave of the
mean. Of sensors that are calibrated in place, a reader of the table knows only the limits of the makers: for the side of the
table these count too, in squares. The scatter of the cycles counts once, in the deviation. Where the table prints the largest
deviation of its cycles, the measured one counts up to that: a damaged log must not widen its own tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.errors import OptionError, WinchcascadeError
from winchcascade.core.published_table import PrintedColumn, PublishedTable, TableRow, load_text, same_load
from winchcascade.reduction.efficiency import FIELDS, METRICS
from winchcascade.reduction.run_record import RunRecord
from winchcascade.tables.point_table import PointTable

COVERAGE = 2.0
"""Standard uncertainties of the measured mean that a cell allows: about 95 % (JCGM 100:2008, 6.3.3)."""

_DUST = 1e-12
"""Share of the printed value that the arithmetic itself may miss."""

Counted = Literal["none", "budget", "budget_and_limits"]
"""What a tolerance counts of the sensors: nothing, the budget of the log, or with it the limits of the makers."""

Outcome = Literal["ok", "miss", "not_measured", "no_run"]


class CheckError(WinchcascadeError):
    """Results that cannot be held against the table."""


class Measured(msgspec.Struct, frozen=True):
    """What a log, or a cycle of it, gives in SI units by metric, None for what it cannot give.

    `at` and `log` are of a check of operating points: what the result is at besides its metrics, and the file. `load` is
    in ohms, inf for an open circuit, None where it is not known; `deviation` is the largest one of a cycle from the mean
    [%], `uncertainty` the standard uncertainty that the sensors leave of the mean, without the scatter of the cycles;
    `limits` is what the limits of the sensors that are calibrated in place would leave of it, empty where results do not
    state it. `findings` are the sentences on what is wrong with the log.
    """

    name: str
    load: float | None
    mean: Mapping[str, float | None]
    deviation: Mapping[str, float | None]
    uncertainty: Mapping[str, float | None]
    limits: Mapping[str, float | None] = msgspec.field(default_factory=dict)
    findings: tuple[str, ...] = ()
    origin: Origin = Origin()
    at: Mapping[str, float | None] = msgspec.field(default_factory=dict)
    log: str = ""


class Factors(msgspec.Struct, frozen=True):
    """What each part of a tolerance is multiplied by: above 1 widens, below 1 narrows, 0 leaves it out. [1]

    `means` is on what a table of operating points allows a mean of products to differ from the product of means.
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
                    f"tolerance factor {name} is {value:g}; expected a finite number that is not negative."
                )


SAME_LOGS = Factors(deviation=0.0, uncertainty=0.0, means=0.0)
"""Of a table that was made from these very logs: repetition and sensors are the same on both sides, so that only rounding is
allowed."""


class RowKey(msgspec.Struct, frozen=True):
    """What names a row in messages and files: its load [ohm], or its number from 1 on and its key cells as printed.

    `line` is that of the row in the table's file.
    """

    text: str
    load: float | None = None
    number: int | None = None
    cells: tuple[tuple[str, str], ...] = ()
    line: int | None = None


class CellCheck(msgspec.Struct, frozen=True):
    """One cell of the table beside its measured value, all in the unit of its column.

    `log` names the run, None where there is none; `line` is that of the cell in the table's file. `means` is what the table
    allows a mean of products to differ from the product of means. `limits` is the part of `uncertainty`, in squares, that
    the limits of the sensors make.
    """

    row: RowKey
    metric: str
    column: PrintedColumn
    printed: float
    log: str | None = None
    measured: float | None = None
    rounding: float = 0.0
    deviation: float = 0.0
    uncertainty: float = 0.0
    limits: float = 0.0
    means: float = 0.0
    line: int | None = None

    @property
    def load(self) -> float | None:
        """Load of the row, None in a table of operating points. [ohm]"""
        return self.row.load

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
        return None if self.measured is None else self.measured - self.printed

    @property
    def missed_by(self) -> float | None:
        """How far the difference lies beyond the tolerance; 0 within it, None without a measured value."""
        return None if self.difference is None else max(0.0, abs(self.difference) - self.tolerance)

    @property
    def outcome(self) -> Outcome:
        """Whether the measured value agrees with the printed one, or why there is none."""
        if self.missed_by is None:
            return "no_run" if self.log is None else "not_measured"
        return "ok" if self.missed_by <= _DUST * abs(self.printed) else "miss"

    @property
    def ok(self) -> bool:
        """Whether the measured value agrees with the printed one."""
        return self.outcome == "ok"


class Check(msgspec.Struct, frozen=True):
    """All cells of a table against measured results.

    `notes` describes in sentences what was left out, capped or not known; `findings` holds, by row, those of its log;
    `origins` where the data of each log come from.
    """

    table: PublishedTable | PointTable
    factors: Factors
    cells: tuple[CellCheck, ...]
    notes: tuple[str, ...]
    findings: Mapping[RowKey, tuple[str, ...]] = msgspec.field(default_factory=dict)
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


def measured_from_record(record: RunRecord, where: str) -> Measured:
    """Take from the record of a reduction what a table is compared with.

    Parameters
    ----------
    where : the file, named where the record does not name its log
    """
    log = record.log

    def metrics(part: Mapping[str, float | None]) -> dict[str, float | None]:
        return {metric: part.get(FIELDS[metric]) for metric in METRICS}

    return Measured(
        name=log.path or where,
        load=math.inf if log.load_ohm is None and log.open_circuit else log.load_ohm,
        mean=metrics(record.mean),
        deviation=metrics(record.max_deviation_percent),
        uncertainty=metrics(record.uncertainty.sensors),
        limits=metrics(record.uncertainty.sensors_by_limits),
        findings=tuple(f"{finding.kind}: {finding.message}" for finding in record.quality),
        origin=origin_from(record.data),
    )


def check(
    results: Sequence[Measured], table: PublishedTable, factors: Factors | None = None, *, whole_campaign: bool = True
) -> Check:
    """Hold measured results against every cell of a published table.

    Parameters
    ----------
    results : one for each log, no two of the same load
    factors : on the parts of every tolerance, 1 if not given
    whole_campaign : a row of the table without a run is a miss; else it is left out with a note

    Raises
    ------
    CheckError : a log's load is not known, has no row in the table, or is that of another log
    """
    factors = factors or Factors()
    cells: list[CellCheck] = []
    runs, notes = _by_row(results, table)
    for k, row in enumerate(table.rows):
        run = runs.get(k)
        if run is None and not whole_campaign:
            notes.append(f"{load_text(row.load)}: no run of this load was given; its row is left out.")
            continue
        cells += [_cell(table, row, metric, run, factors) for metric in row.cells]
        notes += [] if run is None else _not_known(run, row, factors) + _capped(table, run, row)
    found = {_row_key(table.rows[k]): run.findings for k, run in sorted(runs.items()) if run.findings}
    return Check(table, factors, tuple(cells), tuple(notes), found, tuple(runs[k].origin for k in sorted(runs)))


def _by_row(results: Sequence[Measured], table: PublishedTable) -> tuple[dict[int, Measured], list[str]]:
    """The result that belongs to each row, and what was left out."""
    runs: dict[int, Measured] = {}
    notes = []
    known = ", ".join(load_text(row.load) for row in table.rows)
    for result in results:
        if (load := result.load) is None:
            raise CheckError(
                f"{result.name}: its load is not known; expected load_ohm in a campaign.toml, or a reduction made "
                "with --load-ohm."
            )
        row = next((k for k, row in enumerate(table.rows) if same_load(row.load, load)), None)
        if row is None and math.isinf(load):
            notes.append(f"{result.name}: open circuit; the table has no row for it, so it is left out.")
        elif row is None:
            raise CheckError(
                f"{result.name}: {load_text(load)} has no row in {table.name}; expected one of {known}, so correct the load "
                "or take another table."
            )
        elif runs.setdefault(row, result) is not result:
            raise CheckError(
                f"{result.name}: {load_text(load)} is the load of {runs[row].name} too; expected one log for each row, so "
                "leave one out."
            )
    if not runs:
        raise CheckError(f"no log has a row in {table.name}; expected at least one log at one of {known}.")
    return runs, notes


def _row_key(row: TableRow) -> RowKey:
    return RowKey(load_text(row.load), load=row.load, line=row.lines.get(""))


def _cell(table: PublishedTable, row: TableRow, metric: str, run: Measured | None, factors: Factors) -> CellCheck:
    column, log = table.columns[metric], None if run is None else run.name
    bare = CellCheck(_row_key(row), metric, column, row.cells[metric], log, line=row.lines.get(metric))
    mean = None if run is None else run.mean.get(metric)
    if run is None or mean is None:
        return bare
    claimed, deviation = _claimed(table, metric), run.deviation.get(metric) or 0.0
    share = 1.0 if claimed is None or deviation <= claimed[0] else claimed[0] / deviation  # up to what the table prints
    return msgspec.structs.replace(
        bare,
        measured=mean / column.factor,
        rounding=factors.rounding * column.rounding,
        deviation=factors.deviation * share * deviation / 100.0 * abs(mean) / column.factor,
        **by_sensors(run, metric, factors.uncertainty / column.factor),
    )


def by_sensors(run: Measured, metric: str, factor: float) -> dict[str, float]:
    """The part of a tolerance that the sensors make, of both sides, and the part of this by their limits, times a factor."""
    own, limits = (factor * COVERAGE * (part.get(metric) or 0.0) for part in (run.uncertainty, run.limits))
    return {"uncertainty": math.hypot(own, limits), "limits": limits}


def _claimed(table: PublishedTable, metric: str) -> tuple[float, str] | None:
    """Largest deviation of a cycle that the table prints for a metric [%], rounding included, and as it is printed."""
    printed = table.deviations.get("deviation_eta" if metric.startswith("eta") else "deviation_energy")
    return None if printed is None else (100.0 * printed[1].span(printed[0]).high, printed[1].text(printed[0]))


def _capped(table: PublishedTable, run: Measured, row: TableRow) -> list[str]:
    """Metrics whose cycles deviate by more than the table prints, in one sentence for each printed deviation."""
    beyond: dict[str, list[str]] = {}
    for metric in row.cells:
        claimed, deviation = _claimed(table, metric), run.deviation.get(metric)
        if claimed and deviation and deviation > claimed[0] and run.mean.get(metric) is not None:
            beyond.setdefault(claimed[1], []).append(f"{metric} {deviation:.3g} %")
    return [
        f"{run.name}: its cycles deviate by more than the {said} of the table ({', '.join(metrics)}); the deviation counts "
        f"as {said}. Look for a damaged cycle."
        for said, metrics in beyond.items()
    ]


def _not_known(run: Measured, row: TableRow, factors: Factors) -> list[str]:
    """Parts of a tolerance that count as 0 because the log does not give them."""
    taken = [m for m in row.cells if run.mean.get(m) is not None]
    notes = []
    for factor, part, why in (
        (factors.deviation, run.deviation, "the largest deviation is not known, as of a single cycle"),
        (factors.uncertainty, run.uncertainty, "the standard uncertainty is not known"),
    ):
        unknown = [m for m in taken if factor and part.get(m) is None]
        if unknown:
            which = "" if len(unknown) == len(taken) else f" of {', '.join(unknown)}"
            notes.append(f"{run.name}: {why}{which}; it counts as 0.")
    return notes
