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
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePath
from typing import Literal

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import field_of
from winchcascade.core.errors import OptionError, WinchcascadeError
from winchcascade.core.plain_text import first_of
from winchcascade.core.quantity import unit_suffix
from winchcascade.core.viewed import Viewed
from winchcascade.reduction.efficiency import METRICS, RATIOS
from winchcascade.reduction.run_record import CycleRecord, Numbers, RunRecord
from winchcascade.tables.published_table import (
    DIMENSIONS,
    RESULTS_AT,
    Printed,
    PublishedTable,
    TableError,
    TableRow,
)
from winchcascade.tables.table_file import check_unit

COVERAGE = 2.0
"""Standard uncertainties of the measured mean that a cell allows: about 95 % (JCGM 100:2008,
6.3.3).
"""

MAX_NAMED = 8
"""Results without a row that a note names."""

ROW_MIN = 3
"""Energies and powers of a row of which the median shows what they have in common: a single
wrong one does not move it.
"""

_OF_A_MOTION = ("energy", "power")
"""Kinds of metrics that the motion of a cycle changes alike."""

_DUST = 1e-12
"""Share of the printed value that the arithmetic itself may miss."""

_SAME_LOAD = 1e-9
"""Two loads that differ by less than this share are the same number of ohms. [1]"""

_OPERATING_POINTS = ("steps", "rows", "whole", "ranges")
"""Sources of cycles that are operating points; all others repeat one motion."""

Counted = Literal["none", "budget", "budget_and_limits"]
"""What a tolerance counts of the sensors: nothing, the budget of the log, or with it the limits
of the makers.
"""

Outcome = Literal["ok", "miss", "not_measured", "no_run"]


class CheckError(WinchcascadeError):
    """Results that cannot be held against the table."""


class Measured(msgspec.Struct, frozen=True):
    """What a log, or a cycle of it, gives in SI units: `values` of metrics and of what it is at,
    None for what it cannot give.

    `deviation` is the largest one of a cycle from the mean [%], `uncertainty` the standard
    uncertainty that the sensors leave of the mean, without the scatter of the cycles; `limits` is
    what the limits of the sensors that are calibrated in place would leave of it, empty where
    results do not state it; `u` is the standard uncertainty with the scatter. `findings` are the
    sentences on what is wrong with the log.
    """

    name: str
    log: str
    values: Numbers
    deviation: Numbers = {}
    uncertainty: Numbers = {}
    limits: Numbers = {}
    u: Numbers = {}
    findings: tuple[str, ...] = ()
    origin: Origin = Origin()


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
    compared = _compared(table, results, notes)
    found = _assigned(results, table, notes)
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


# ------------------------------------------------------------------------------------ the results
def measured(record: RunRecord, where: str, table: PublishedTable) -> list[Measured]:
    """Take from the record of a reduction what a table is compared with.

    Each complete cycle that is an operating point, where more than the log and its load is a key.
    Else the log as a whole: the mean of its cycles where they repeat one motion and in a table by
    load, else sums, of unknown uncertainty.

    Parameters
    ----------
    where : the file, named where the record does not name its log
    """
    log, cycles = record.log, [cycle for cycle in record.cycles if cycle.complete]
    load = math.inf if log.load_ohm is None and log.open_circuit else log.load_ohm
    repeats = record.cycles_from not in _OPERATING_POINTS
    whole = Measured(
        name=log.path or where,
        log=where,
        values=_metrics(record.mean)
        | _at(cycles)
        | {"load": load, "cycle": 1.0 if len(cycles) == 1 else None},
        deviation=_metrics(record.max_deviation_percent),
        uncertainty=_metrics(record.uncertainty.sensors),
        limits=_metrics(record.uncertainty.sensors_by_limits),
        u=_metrics(record.standard_uncertainty),
        findings=tuple(f"{finding.kind}: {finding.message}" for finding in record.quality),
        origin=origin_from(record.data),
    )
    if table.by_load:
        return [whole]
    if not repeats and not {table.columns[name].measured for name in table.keys} <= {
        "file",
        "load",
    }:
        return [
            replace(
                whole,
                name=f"{whole.name} cycle {cycle.cycle}",
                values=_metrics(cycle.numbers)
                | _at([cycle])
                | {"load": load, "cycle": float(cycle.cycle)},
                deviation={},
                uncertainty=_metrics(cycle.standard_uncertainty),
                limits=_metrics(cycle.sensors_by_limits),
                u=_metrics(cycle.standard_uncertainty),
            )
            for cycle in cycles
        ]
    if repeats or len(cycles) < 2:
        return [whole] if cycles else []
    return [
        replace(
            whole,
            values=whole.values | _metrics(record.total),
            deviation={},
            uncertainty={},
            limits={},
            u={},
        )
    ]


def _metrics(numbers: Numbers) -> Numbers:
    """Metrics by their names from numbers of a record, where they have their unit at the end."""
    kinds = {field: field.partition("_")[0] for field in numbers}
    units = {kind: field_of(f"{kind}_").removeprefix(f"{kind}_") for kind in DIMENSIONS}
    return {
        field.removesuffix(units[kind]): numbers[field]
        for field, kind in kinds.items()
        if kind in units
    }


def _at(cycles: Sequence[CycleRecord]) -> Numbers:
    """Speed and torque of the shaft, plateau speed and travel of the payouts: means over the
    cycles, by their lengths.
    """
    rows = []
    for cycle in cycles:
        payout, point = cycle.phase_summary.payout, cycle.phase_summary.point or None
        plateau, rpm = payout.plateau, point and point.rpm_shaft
        torque = point.torque if point is not None else plateau and plateau.torque
        rows.append(
            (rpm, torque, plateau and plateau.speed, payout.travel, cycle.window["duration_s"])
        )
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)  # None is NaN
    means = (
        table[:, :4].T @ table[:, 4] / table[:, 4].sum()
        if table[:, 4].sum() > 0.0
        else np.full(4, math.nan)
    )
    values = (means * (math.pi / 30.0, 1.0, 1.0, 1.0)).tolist()
    return {
        n: x if math.isfinite(x) else None
        for n, x in zip(("speed", "torque", "velocity", "travel"), values, strict=True)
    }


# ---------------------------------------------------------------------------- rows of the results
def _compared(table: PublishedTable, results: Sequence[Measured], notes: list[str]) -> list[str]:
    """Columns that results have something of; a note is added on those of which they have
    nothing.
    """
    others = [name for name in table.columns if name not in table.keys]
    given = {
        m
        for result in results
        for m, value in result.values.items()
        if value is not None or m not in RESULTS_AT
    }
    compared = [
        n for n in others if table.columns[n].measured in given or (table.by_load and n in METRICS)
    ]
    if results and not compared:
        metrics = sorted(given - set(RESULTS_AT))
        raise TableError(
            f"{table.path}: no column is a quantity of the results, which have "
            f"{', '.join(metrics) or 'no cycle'}; give a "
            f'column such a name, or add measured = "{(metrics or ["power_gen"])[0]}" to its '
            f"entry."
        )
    left = [name for name in others if name not in compared]
    notes += (
        [f"columns {', '.join(left)}: the results have no quantity of these names; not compared."]
        if left
        else []
    )
    return compared


def _assigned(
    results: Sequence[Measured], table: PublishedTable, notes: list[str]
) -> dict[int, list[Measured]]:
    """Results by the row that each belongs to, the nearest one; a note is added on results that
    belong to none.
    """
    found: dict[int, list[Measured]] = {}
    without = []
    for result, nearest in zip(results, _nearest_rows(results, table), strict=True):
        if nearest is None:
            without.append(f"{result.name} ({_place(result, table)})")
        else:
            found.setdefault(nearest, []).append(result)
    if not found:
        raise CheckError(
            f"no result belongs to a row of {table.name}: "
            f"{'; '.join(without[:3]) or 'no log has a complete cycle'}. Its "
            f"rows are {first_of([row.name for row in table.rows], MAX_NAMED)}; correct the key "
            f"or its units (a key may be "
            f"{', '.join(RESULTS_AT)} or a metric), or state the load of the log (load_ohm in "
            f"campaign.toml, or --load-ohm)."
        )
    notes += [f"without a row, left out: {first_of(without, MAX_NAMED)}."] if without else []
    return found


def _nearest_rows(results: Sequence[Measured], table: PublishedTable) -> Iterator[int | None]:
    """Number of the row that each result belongs to, the nearest one; None for another operating
    point.

    A number may differ by the rounding of the cell and a share of the largest number of its column,
    the number of a cycle by the rounding alone, the load of a table by load not at all; a name of a
    log has to be that of the log.
    """
    keys = []
    for name in table.keys:
        cells, column = [row.cells.get(name) for row in table.rows], table.columns[name]
        value, near = (
            np.array(
                [math.nan if c is None else getattr(c, part) * column.factor for c in cells],
                dtype=np.float64,
            )
            for part in ("value", "rounding")
        )
        if table.by_load:
            near = _SAME_LOAD * np.abs(value)
        elif column.measured != "cycle":
            near = near + table.key_share * max(
                (abs(x) for x in value.tolist() if math.isfinite(x)), default=0.0
            )
        texts = ["" if c is None else c.text.casefold() for c in cells]
        keys.append(
            (
                column.measured,
                value,
                near,
                [text.lstrip("0") if text.isdecimal() else text for text in texts],
            )
        )
    for result in results:
        square = np.zeros(len(table.rows))
        for quantity, printed, near, texts in keys:
            found, names = result.values.get(quantity), log_names(result.log)
            here = math.nan if found is None else found
            with np.errstate(invalid="ignore"):
                share = np.abs(here - printed) / near
            if quantity == "load":
                share = np.where(np.isclose(here, printed, rtol=_SAME_LOAD, atol=0.0), 0.0, share)
            if quantity == "file":
                share = np.array([0.0 if text in names else math.inf for text in texts])
            square = np.where(share <= 1.0, square + share**2, math.inf)
        nearest = int(np.argmin(square)) if square.size else 0
        yield nearest if square.size and math.isfinite(square[nearest]) else None


def log_names(log: str) -> list[str]:
    """What a cell may name a log by: its file with or without the ending, or the last number of its
    name.

    >>> log_names("logs/run_07.csv")
    ['run_07.csv', 'run_07', '7']
    """
    name = PurePath(log).name.casefold()
    stem = name.partition(".")[0]
    return [name, stem, *(digits.lstrip("0") for digits in re.findall(r"\d+", stem)[-1:])]


def _place(result: Measured, table: PublishedTable) -> str:
    """What a result has in the columns of the key, in their units."""
    texts = []
    for name in table.keys:
        column = table.columns[name]
        value = result.values.get(column.measured)
        text = (
            "unknown" if value is None else f"{value / column.factor:.4g}{unit_suffix(column.unit)}"
        )
        texts.append(f"{name} {result.log if column.measured == 'file' else text}")
    return ", ".join(texts)


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
