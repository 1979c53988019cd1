"""Comparison of measured results with a published table of operating points, whose rows have any key.

A row is found by its key columns: speed, torque, load, number of the cycle, name or number of the log, or any metric. Cycles
that are operating points of a dynamometer are compared one by one, logs that repeat one motion by the mean of their cycles.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath

from msgspec.structs import replace

from winchcascade.core.cascade import field_of
from winchcascade.core.plain_text import first_of
from winchcascade.core.published_table import PrintedColumn, TableError, same_load
from winchcascade.core.quantity import si_unit
from winchcascade.reduction.run_record import CycleRecord, Numbers, RunRecord
from winchcascade.tables.check import (
    CellCheck,
    Check,
    CheckError,
    Factors,
    Measured,
    RowKey,
    by_sensors,
    measured_from_record,
)
from winchcascade.tables.point_table import AT, PointCell, PointColumn, PointTable

_DIMENSION = {"energy": "energy", "power": "power", "eta": "number"}
"""Dimensions of metrics, by the first word of their names."""

_OPERATING_POINTS = ("steps", "rows", "whole", "ranges")
"""Sources of cycles that are operating points; all others repeat one motion."""


def check_points(
    records: Sequence[tuple[str, RunRecord]],
    table: PointTable,
    factors: Factors | None = None,
    *,
    whole_campaign: bool = True,
) -> Check:
    """Hold the results of logs against every row of a table of operating points.

    Parameters
    ----------
    records : names of the logs, and the records of their reductions
    whole_campaign : a row of the table without a result is a miss; else it is left out with a note

    Raises
    ------
    CheckError : no result belongs to a row, or none has what a key column names
    TableError : the table has no key, or a unit does not fit what is measured
    """
    if not table.key:
        raise TableError(
            f'{table.path}: has no key, so that no result can be assigned to a row; expected one such as key = "speed", or '
            f'key = ["torque", "speed"].'
        )
    factors = factors or Factors()
    _check_units(table)
    by_cycle = not {table.columns[name].measured for name in table.key} <= {"file", "load"}
    results = [result for name, record in records for result in _results(record, name, by_cycle=by_cycle)]
    compared, notes = _compared(table, results)
    found = _assigned(results, table, notes)
    cells: list[CellCheck] = []
    findings: dict[RowKey, tuple[str, ...]] = {}
    for k in range(len(table.rows)):
        key = _row_key(table, k)
        if k not in found and not whole_campaign:
            notes.append(f"{key.text}: no result belongs to this row; it is left out.")
            continue
        of_row: list[Measured | None] = [*found.get(k, ())] or [None]
        for result in of_row:
            cells += [_cell(table, k, name, result, factors) for name in compared if name in table.rows[k]]
            if result is not None and result.findings:
                findings[key] = tuple(dict.fromkeys((*findings.get(key, ()), *result.findings)))
    if not cells:
        raise CheckError(
            f"{table.name}: no row has a cell that can be compared; the columns {', '.join(compared)} are empty."
        )
    used = [result for k in sorted(found) for result in found[k]]
    notes += _not_stated(used, [table.columns[name].measured for name in compared], factors)
    return Check(table, factors, tuple(cells), tuple(notes), findings, tuple(r.origin for r in used))


# ------------------------------------------------------------------------------------------------------------ the results
def _results(record: RunRecord, where: str, *, by_cycle: bool) -> list[Measured]:
    """Each complete cycle of a log whose cycles are operating points; else the log as a whole."""
    of_log = replace(measured_from_record(record, where), log=where)
    repeats = record.cycles_from not in _OPERATING_POINTS
    cycles = [cycle for cycle in record.cycles if cycle.complete]
    if not cycles:
        return []
    if by_cycle and not repeats:
        return [_of_cycle(of_log, cycle) for cycle in cycles]
    return [_of_log(of_log, record, cycles, mean=repeats or len(cycles) == 1)]


def _of_cycle(log: Measured, cycle: CycleRecord) -> Measured:
    return replace(
        log,
        name=f"{log.name} cycle {cycle.cycle}",
        mean=_metrics(cycle.numbers),
        deviation={},
        uncertainty=_metrics(cycle.standard_uncertainty),
        limits=_metrics(cycle.sensors_by_limits),
        at={**_at([cycle]), "cycle": float(cycle.cycle), "load": log.load},
    )


def _of_log(log: Measured, record: RunRecord, cycles: Sequence[CycleRecord], *, mean: bool) -> Measured:
    """The mean of the cycles of a log that repeat; of others sums and the ratios of these, of unknown uncertainty."""
    at = {**_at(cycles), "load": log.load, "cycle": 1.0 if len(cycles) == 1 else None}
    if not mean:
        return replace(log, mean=_metrics(record.total), deviation={}, uncertainty={}, limits={}, at=at)
    return replace(
        log,
        mean=_metrics(record.mean),
        deviation=_metrics(record.max_deviation_percent),
        uncertainty=_metrics(record.uncertainty.sensors),
        limits=_metrics(record.uncertainty.sensors_by_limits),
        at=at,
    )


def _metrics(numbers: Numbers) -> Numbers:
    """Metrics by their names from numbers of a record, where they have their unit at the end."""
    found: Numbers = {}
    for field, value in numbers.items():
        kind = field.partition("_")[0]
        if kind in _DIMENSION:
            unit = field_of(f"{kind}_").removeprefix(f"{kind}_")
            found[field.removesuffix(unit)] = value
    return found


def _at(cycles: Sequence[CycleRecord]) -> Numbers:
    """Speed and torque of the shaft, plateau speed and travel of the payouts: means over the cycles, by their lengths."""
    lengths = [cycle.window["duration_s"] for cycle in cycles]
    columns: dict[str, list[float | None]] = {"speed": [], "torque": [], "velocity": [], "travel": []}
    for summary in (cycle.phase_summary for cycle in cycles):
        plateau, point = summary.payout.plateau, summary.point or None
        rpm = None if point is None else point.rpm_shaft
        columns["speed"].append(None if rpm is None else rpm * math.pi / 30.0)
        columns["torque"].append(point.torque if point is not None else None if plateau is None else plateau.torque)
        columns["velocity"].append(None if plateau is None else plateau.speed)
        columns["travel"].append(summary.payout.travel)
    whole = sum(lengths)
    return {
        name: None
        if None in column or not whole > 0.0
        else sum(x * s for x, s in zip(column, lengths, strict=True) if x is not None) / whole
        for name, column in columns.items()
    }


def _value(result: Measured, measured: str) -> float | None:
    """What a result gives under a name of a table: what it is at, or a metric."""
    return result.at.get(measured) if measured in AT else result.mean.get(measured)


# --------------------------------------------------------------------------------------------------------------- the table
def _check_units(table: PointTable) -> None:
    """Require of each column that is a measured quantity a unit of it."""
    for name, column in table.columns.items():
        wanted = AT.get(column.measured) or _DIMENSION.get(column.measured.partition("_")[0])
        if wanted is not None and column.dimension != wanted:
            like = "J" if wanted == "energy" else si_unit(wanted)
            raise TableError(
                f"{table.path}: [columns] {name}: the unit {column.unit!r} is none of {column.measured}; expected one such as "
                f"{like}."
            )


def _compared(table: PointTable, results: Sequence[Measured]) -> tuple[list[str], list[str]]:
    """Columns that results have something of, and a note on those of which they have nothing."""
    others = [name for name in table.columns if name not in table.key]
    given = {m for result in results for m in result.mean}
    given |= {m for result in results for m, value in result.at.items() if value is not None}
    compared = [name for name in others if table.columns[name].measured in given]
    if not compared:
        metrics = sorted({m for result in results for m, value in result.mean.items() if value is not None})
        raise TableError(
            f"{table.path}: no column is a quantity of the results, which have {', '.join(metrics) or 'no cycle'}; give a "
            f'column such a name, or add measured = "{(metrics or ["power_gen"])[0]}" to its entry.'
        )
    left = [name for name in others if name not in compared]
    note = f"columns {', '.join(left)}: the results have no quantity of these names; not compared."
    return compared, [note] if left else []


def _row_key(table: PointTable, k: int) -> RowKey:
    cells = tuple((name, table.rows[k][name].text.strip()) for name in table.key if name in table.rows[k])
    return RowKey(table.row_name(k), number=k + 1, cells=cells)


def _assigned(results: Sequence[Measured], table: PointTable, notes: list[str]) -> dict[int, list[Measured]]:
    """Results by the row that each belongs to, the nearest one; notes are added on results that belong to none."""
    for name in table.key:
        measured = table.columns[name].measured
        if measured != "file" and all(_value(result, measured) is None for result in results):
            raise CheckError(
                f"{table.name}: the key {name} is none of the results: they have no {measured}. Take another key column, or "
                f'state measured = "..." for it; known are {", ".join(AT)} and the metrics.'
            )
    found: dict[int, list[Measured]] = {}
    without = []
    for result in results:
        apart = {k: far for k in range(len(table.rows)) if (far := _distance(result, table, k)) is not None}
        if apart:
            found.setdefault(min(apart, key=apart.__getitem__), []).append(result)
        else:
            without.append(f"{result.name} ({_place(result, table)})")
    if not found:
        raise CheckError(
            f"no result belongs to a row of {table.name}: {'; '.join(without[:3]) or 'no log has a complete cycle'}. Its "
            f"first row is {table.row_name(0)}; correct the key, its units or key_percent."
        )
    _check_numbers(found, table)
    notes += [f"without a row, left out: {first_of(without, MAX_NAMED)}."] if without else []
    return found


MAX_NAMED = 8
"""Results without a row that a note names."""


def _place(result: Measured, table: PointTable) -> str:
    """What a result has in the columns of the key, in their units."""
    texts = []
    for name in table.key:
        column = table.columns[name]
        value = None if column.measured == "file" else _value(result, column.measured)
        text = (
            result.log if column.measured == "file" else "unknown" if value is None else f"{value / column.factor:.4g}"
        )
        texts.append(f"{name} {text}{'' if value is None or column.unit == '1' else f' {column.unit}'}")
    return ", ".join(texts)


def _distance(result: Measured, table: PointTable, k: int) -> float | None:
    """Distance of a result from a row in shares of what its key may differ by; None for another operating point."""
    far = 0.0
    for name in table.key:
        cell, column = table.rows[k].get(name), table.columns[name]
        if cell is None:
            return None
        if column.measured == "file":
            if not _names_log(cell.text, result.log):
                return None
            continue
        value = _value(result, column.measured)
        share = _away(
            value, cell, column, 0.0 if column.measured == "cycle" else table.key_share * _largest(table, name)
        )
        if share is None:
            return None
        far = math.hypot(far, share)
    return far


def _away(value: float | None, cell: PointCell, column: PointColumn, near: float) -> float | None:
    """Difference of a key in shares of what it may be; None if it is more, or unknown.

    Parameters
    ----------
    near : what it may differ by, beside the rounding [unit of the column]
    """
    if value is None:
        return None
    if column.measured == "load" and same_load(value, cell.value * column.factor):
        return 0.0
    apart, allowed = abs(value / column.factor - cell.value), cell.rounding + near
    return apart / allowed if apart <= allowed and math.isfinite(apart) else None


def _largest(table: PointTable, name: str) -> float:
    return max(
        (abs(row[name].value) for row in table.rows if name in row and math.isfinite(row[name].value)), default=0.0
    )


def _names_log(text: str, log: str) -> bool:
    """Whether a cell names a log: its file with or without the ending, or, as a number, the last number of the name.

    >>> _names_log("run_07.csv", "logs/run_07.csv"), _names_log("run_07", "run_07.csv"), _names_log("7", "run_07.csv")
    (True, True, True)
    """
    name = PurePath(log).name.casefold()
    stem = name.partition(".")[0]
    digits = re.findall(r"\d+", stem)
    return text.casefold() in (name, stem) or (text.isdecimal() and bool(digits) and int(text) == int(digits[-1]))


def _check_numbers(found: Mapping[int, Sequence[Measured]], table: PointTable) -> None:
    """Require that a row that names a log belongs to a single one."""
    if all(table.columns[name].measured != "file" for name in table.key):
        return
    for k, results in found.items():
        logs = sorted({result.log for result in results})
        if len(logs) > 1:
            raise CheckError(
                f"{table.row_name(k)}: belongs to {' and '.join(logs[:3])}; expected one log, so write its file name there."
            )


# --------------------------------------------------------------------------------------------------------------- the cells
def _cell(table: PointTable, k: int, name: str, result: Measured | None, factors: Factors) -> CellCheck:
    column, cell = table.columns[name], table.rows[k][name]
    decimals = 0 if cell.rounding <= 0.0 else round(-math.log10(2.0 * cell.rounding))
    printed = PrintedColumn(column.unit, decimals, column.factor)
    bare = CellCheck(_row_key(table, k), name, printed, cell.value, None if result is None else result.name)
    value = None if result is None else _value(result, column.measured)
    if result is None or value is None:
        return bare
    deviation = result.deviation.get(column.measured) or 0.0
    return replace(
        bare,
        measured=value / column.factor,
        rounding=factors.rounding * cell.rounding,
        deviation=factors.deviation * deviation / 100.0 * abs(value) / column.factor,
        **by_sensors(result, column.measured, factors.uncertainty / column.factor),
        means=factors.means * table.tolerance * abs(cell.value),
    )


def _not_stated(results: Sequence[Measured], compared: Sequence[str], factors: Factors) -> list[str]:
    """Parts of the tolerances that count as 0 because the results do not give them."""
    notes = []
    for part, what in (("deviation", "largest deviation"), ("uncertainty", "standard uncertainty")):
        unknown = {
            metric: sum(_value(r, metric) is not None and getattr(r, part).get(metric) is None for r in results)
            for metric in dict.fromkeys(compared if getattr(factors, part) else ())
        }
        named = [f"{metric} ({count} of {len(results)} results)" for metric, count in unknown.items() if count]
        if part == "deviation" and named:
            notes.append("a single operating point has no deviation between cycles; it counts as 0.")
        elif named:
            notes.append(f"the {what} is not known of {', '.join(named)}; it counts as 0.")
    return notes
