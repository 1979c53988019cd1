"""The JSON of an audit: of a table by load with the physics of a rig, or of a table of operating points."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from winchcascade.core.published_table import PublishedTable, Span
from winchcascade.core.version import __version__
from winchcascade.tables.attainable import Ability, AttainableRanges
from winchcascade.tables.audit import Audit
from winchcascade.tables.effect_search import Values
from winchcascade.tables.point_audit import PointAudit
from winchcascade.tables.point_table import PointTable


def audit_record(audit: Audit | PointAudit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/audit/1`, of operating points `winchcascade/point-audit/1`."""
    if isinstance(audit, Audit):
        return _head("audit", audit, evaluated=audit.evaluated) | _by_load(audit)
    return _head("point-audit", audit, evaluated=audit.laws > 0) | _by_point(audit)


def _head(kind: str, audit: Audit | PointAudit, *, evaluated: bool) -> dict[str, Any]:
    return {
        "schema": f"winchcascade/{kind}/1",
        "version": __version__,
        "table": table_record(audit.table),
        "ok": audit.ok,
        "evaluated": evaluated,
        "laws": [fields(use, rows="rows_evaluated") for use in audit.uses],
    }


def table_record(table: PublishedTable | PointTable) -> dict[str, str]:
    """Which table it is."""
    return picked(table, "name", "title", "source", "path")


def load_record(load: float) -> dict[str, float | bool]:
    """A load; JSON has null ohms for an open circuit."""
    return {"load_ohm": load, "open_circuit": math.isinf(load)}


def picked(item: object, *names: str) -> dict[str, Any]:
    """Some fields of a result by their names."""
    return {name: getattr(item, name) for name in names}


def fields(item: msgspec.Struct, *left_out: str, **names: str) -> dict[str, Any]:
    """Fields of a result in order, some left out, some with another name; loads as JSON has them, intervals as pairs."""
    record: dict[str, Any] = {}
    for field in item.__struct_fields__:
        value = getattr(item, field)
        if field == "load":
            record |= {} if value is None else load_record(value)
        elif field not in left_out:
            record[names.get(field, field)] = msgspec.structs.astuple(value) if isinstance(value, Span) else value
    return record


def _by_load(audit: Audit) -> dict[str, Any]:
    known = audit.known
    return {
        "bounds": {
            "cycles": known.cycles,
            "deviation_energy": known.energy,
            "deviation_eta": known.eta,
            "ratio": known.bounds.ratio,
            "product": known.bounds.product,
            "assumed": known.assumed,
        },
        "contradictions": [
            fields(item) | {"repairs": [fields(repair, "text") for repair in item.repairs]}
            for item in audit.contradictions
        ],
        "claims": [
            {
                "verdict": one.verdict,
                **picked(one.claim, "says", "where"),
                "sentence": one.sentence,
                "line": one.claim.line,
            }
            for one in audit.claims
        ],
        "windows": [fields(one, span="window_s") for one in audit.windows],
        "shared_windows": [
            fields(one, span="window_s", shortest="shortest_s") | {"loads": [*map(load_record, one.loads)]}
            for one in audit.shared
        ],
        **({} if audit.physics is None else {"physics": attainable_record(audit.physics)}),
    }


def attainable_record(ranges: AttainableRanges) -> dict[str, Any]:
    """What the rig can attain: the entry `physics`."""
    found = ranges.explanation
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
                        **picked(cell, "printed", "derived", "allowed"),
                        "reach": (cell.low, cell.high),
                        "nominal": cell.nominal,
                        "standard_uncertainty": cell.u,
                        "off": cell.gap,
                        "outside": cell.outside,
                    }
                    for cell in row.cells
                },
            }
            for row in ranges.rows
        ],
        "not_judged": [fields(item) for item in ranges.not_judged],
        "effects": [
            {
                **picked(suspect, "effect", "stage"),
                "fields": {
                    field.name: {**picked(field, "unit", "absent"), "plausible": (field.low, field.high)}
                    for field in suspect.fields
                },
                "can": {one.metric: _ability(ranges, one) for one in suspect.abilities},
                "best": suspect.best and _values(suspect.best),
            }
            for suspect in found.suspects
        ],
        "sets": [_values(values) for values in found.sets],
        "closest": found.closest and _values(found.closest),
    }


def _ability(ranges: AttainableRanges, one: Ability) -> dict[str, Any]:
    pairs = zip(ranges.rows, one.needed, strict=True) if one.needed else ()
    needed = [{**load_record(row.load), "value": value} for row, value in pairs]
    return {**picked(one, "verdict", "closed"), "needed": needed or None}


def _values(values: Values) -> dict[str, Any]:
    return picked(values, "fields", "reported", "left_rms", "out_of_reach", "enough", "plausible", "at_bound")


def _by_point(audit: PointAudit) -> dict[str, Any]:
    table = audit.table
    return {
        "rows": len(table.rows),
        "cells_compared": audit.laws,
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
                "row": item.row + 1,
                "key": {name: cell.value for name, cell in table.rows[item.row].items() if name in table.key},
                **picked(item, "column", "printed"),
                "unit": table.columns[item.column].unit,
                "allowed": (item.allowed.low, item.allowed.high),
                "sentence": item.sentence,
            }
            for item in audit.broken
        ],
    }
