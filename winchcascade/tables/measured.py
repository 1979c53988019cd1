"""What a log, or a cycle of it, gives to hold against a row of a published table."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from msgspec.structs import replace

from winchcascade.core.campaign_file import Origin, origin_from
from winchcascade.core.cascade import field_of
from winchcascade.reduction.run_record import CycleRecord, Numbers, RunRecord
from winchcascade.tables.published_table import DIMENSIONS, PublishedTable

_OPERATING_POINTS = ("steps", "rows", "whole", "ranges")
"""Sources of cycles that are operating points; all others repeat one motion."""


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
