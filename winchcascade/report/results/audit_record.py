"""The JSON of an audit: of a table by load with the physics of a rig, or of a table of operating
points.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from winchcascade.core.version import __version__
from winchcascade.tables.attainable import Ability, AttainableRanges, Values
from winchcascade.tables.audit import Audit, Contradiction
from winchcascade.tables.published_table import PublishedTable, Span


def audit_record(audit: Audit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/audit/1`, of operating points
    `winchcascade/point-audit/1`.
    """
    by_load = audit.table.by_load
    return {
        "schema": f"winchcascade/{'audit' if by_load else 'point-audit'}/1",
        "version": __version__,
        "table": table_record(audit.table),
        "ok": audit.ok,
        "evaluated": audit.evaluated,
        "laws": [_fields(use, rows="rows_evaluated") for use in audit.uses],
        **(_by_load(audit) if by_load else _by_point(audit)),
    }


def table_record(table: PublishedTable) -> dict[str, str]:
    """Which table it is."""
    return picked(table, "name", "title", "source", "path")


def load_record(load: float | None) -> dict[str, Any]:
    """A load; JSON has null ohms for an open circuit."""
    return {} if load is None else {"load_ohm": load, "open_circuit": math.isinf(load)}


def picked(item: object, *names: str) -> dict[str, Any]:
    """Some fields of a result by their names."""
    return {name: getattr(item, name) for name in names}


def _fields(item: msgspec.Struct, **names: str) -> dict[str, Any]:
    """Fields of a result in order, some with another name; loads as JSON has them, intervals as
    pairs.
    """
    record: dict[str, Any] = {}
    for name in item.__struct_fields__:
        value = getattr(item, name)
        found = msgspec.structs.astuple(value) if isinstance(value, Span) else value
        record |= load_record(value) if name == "load" else {names.get(name, name): found}
    return record


def _by_load(audit: Audit) -> dict[str, Any]:
    known = audit.known
    return {
        "bounds": {
            "cycles": known.cycles,
            "deviation_energy": known.energy,
            "deviation_eta": known.eta,
            **picked(known, "ratio", "product", "assumed"),
        },
        "contradictions": [
            *(_contradiction("column", _example(audit, fault.columns)) | {"cells": fault.columns, "line": None,
              "sentence": fault.sentence, "repairs": []} for fault in audit.faults if fault.kind != "rows"),
            *({"kind": "rows", "rows": fault.columns, "sentence": fault.sentence}
              for fault in audit.faults if fault.kind == "rows"),
            *(_contradiction("row", item) | load_record(item.row.load) for item in audit.contradictions),
        ],
        "claims": [
            {"verdict": one.verdict, **picked(one.claim, "says", "where"), "sentence": one.sentence, "line": one.claim.line}
            for one in audit.claims
        ],
        "windows": [_fields(one, span="window_s") for one in audit.windows],
        "shared_windows": [
            _fields(one, span="window_s", shortest="shortest_s") | {"loads": [*map(load_record, one.loads)]}
            for one in audit.shared
        ],
        **({} if audit.physics is None else {"physics": _physics(audit.physics)}),
    }  # fmt: skip


def _example(audit: Audit, columns: tuple[str, ...]) -> Contradiction:
    """The first contradiction of a column that a fault explains."""
    return next((item for item in audit.explained if item.metric in columns), audit.explained[0])


def _contradiction(kind: str, item: Contradiction) -> dict[str, Any]:
    return {
        "kind": kind,
        **picked(item, "cells", "metric"),
        "printed": item.printed.value,
        "unit": item.printed.unit,
        "allowed": (item.allowed.low, item.allowed.high),
        **picked(item, "missed_by", "sentence"),
        "repairs": [picked(repair, "metric", "low", "high") for repair in item.repairs],
        "line": item.printed.line,
    }


def _by_point(audit: Audit) -> dict[str, Any]:
    table = audit.table
    return {
        "rows": len(table.rows),
        "cells_compared": audit.compared,
        "cells_not_numbers": table.unread,
        "column_faults": [
            {
                **picked(fault, "kind", "columns"),
                "heads": [table.columns[name].head for name in fault.columns],
                **picked(fault, "broken_before", "broken_after", "sentence"),
            }
            for fault in audit.faults
        ],
        "contradictions": [
            {
                "row": item.row.number,
                "key": {
                    name: item.row.cells[name].value
                    for name in table.keys
                    if name in item.row.cells
                },
                "column": item.metric,
                "printed": item.printed.value,
                "unit": item.printed.unit,
                "allowed": (item.allowed.low, item.allowed.high),
                "sentence": item.sentence,
            }
            for item in audit.contradictions
        ],
    }


def _physics(ranges: AttainableRanges) -> dict[str, Any]:
    """What the rig can attain."""
    return {
        "rig": ranges.rig.name,
        "ok": ranges.ok,
        "deviation_eta": ranges.scatter,
        "notes": ranges.notes,
        "rows": [
            {
                **load_record(row.load),
                "window_s": row.window,
                "speed_mps": (row.speeds.low, row.speeds.high),
                "efficiencies": {
                    cell.metric: {
                        **picked(cell, "printed", "derived", "allowed", "nominal", "outside"),
                        "reach": (cell.low, cell.high),
                        "standard_uncertainty": cell.u,
                        "off": cell.gap,
                    }
                    for cell in row.cells
                },
            }
            for row in ranges.rows
        ],
        "not_judged": [_fields(item) for item in ranges.not_judged],
        "effects": [
            {
                **picked(suspect, "effect", "stage"),
                "fields": {
                    field.name: {
                        **picked(field, "unit", "absent"),
                        "plausible": (field.low, field.high),
                    }
                    for field in suspect.fields
                },
                "can": {one.metric: _ability(ranges, one) for one in suspect.abilities},
                "best": suspect.best and _values(suspect.best),
            }
            for suspect in ranges.suspects
        ],
        "sets": [_values(values) for values in ranges.sets],
        "closest": ranges.closest and _values(ranges.closest),
    }


def _ability(ranges: AttainableRanges, one: Ability) -> dict[str, Any]:
    pairs = zip(ranges.rows, one.needed, strict=True) if one.needed else ()
    needed = [{**load_record(row.load), "value": value} for row, value in pairs]
    return {**picked(one, "verdict", "closed"), "needed": needed or None}


def _values(values: Values) -> dict[str, Any]:
    return picked(
        values, "fields", "reported", "left_rms", "out_of_reach", "enough", "plausible", "at_bound"
    )
