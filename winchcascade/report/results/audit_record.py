"""The JSON of an audit: of a table by load with the physics of a rig, or of a table of operating points."""

from __future__ import annotations

import math
from typing import Any

from winchcascade.core.published_table import PublishedTable, Span
from winchcascade.core.version import __version__
from winchcascade.tables.attainable import Ability, AttainableRanges, SuspectResult
from winchcascade.tables.attainable_row import AttainableRow, Cell
from winchcascade.tables.audit import Audit, Contradiction
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
        "laws": [
            {"law": use.law, "status": use.status, "rows_evaluated": use.rows, "missing": use.missing}
            for use in audit.uses
        ],
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


def _ends(span: Span | None) -> tuple[float, float] | None:
    return None if span is None else (span.low, span.high)


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
        "contradictions": [_contradiction(item) for item in audit.contradictions],
        "claims": [
            {
                "verdict": one.verdict,
                **picked(one.claim, "says", "where"),
                "sentence": one.sentence,
                "line": one.claim.line,
            }
            for one in audit.claims
        ],
        "windows": [{**load_record(one.load), "window_s": _ends(one.span)} for one in audit.windows],
        "shared_windows": [
            {"loads": [*map(load_record, one.loads)], "window_s": _ends(one.span), "shortest_s": one.shortest}
            for one in audit.shared
        ],
        **({} if audit.physics is None else {"physics": attainable_record(audit.physics)}),
    }


def _contradiction(item: Contradiction) -> dict[str, Any]:
    return {
        "kind": item.kind,
        **({} if item.load is None else load_record(item.load)),
        **picked(item, "cells", "metric", "printed", "unit"),
        "allowed": _ends(item.allowed),
        **picked(item, "missed_by", "sentence"),
        "repairs": [picked(repair, "metric", "low", "high") for repair in item.repairs],
        "line": item.line,
    }


def attainable_record(ranges: AttainableRanges) -> dict[str, Any]:
    """What the rig can attain: the entry `physics`."""
    found = ranges.explanation
    return {
        "rig": ranges.rig.name,
        "ok": ranges.ok,
        "deviation_eta": ranges.scatter,
        "notes": ranges.notes,
        "rows": [_row(row) for row in ranges.rows],
        "not_judged": [{**load_record(item.load), "reason": item.reason} for item in ranges.not_judged],
        "effects": [_suspect(ranges, suspect) for suspect in found.suspects],
        "sets": [_values(values) for values in found.sets],
        "closest": found.closest and _values(found.closest),
    }


def _row(row: AttainableRow) -> dict[str, Any]:
    cells = {cell.metric: _cell(cell) for cell in row.cells}
    return {**load_record(row.load), "window_s": row.window, "speed_mps": _ends(row.speeds), "efficiencies": cells}


def _cell(cell: Cell) -> dict[str, Any]:
    return {
        **picked(cell, "printed", "derived", "allowed"),
        "reach": (cell.low, cell.high),
        "nominal": cell.nominal,
        "standard_uncertainty": cell.u,
        "off": cell.gap,
        "outside": cell.outside,
    }


def _suspect(ranges: AttainableRanges, suspect: SuspectResult) -> dict[str, Any]:
    return {
        **picked(suspect, "effect", "stage"),
        "fields": {
            field.name: {**picked(field, "unit", "absent"), "plausible": (field.low, field.high)}
            for field in suspect.fields
        },
        "can": {one.metric: _ability(ranges, one) for one in suspect.abilities},
        "best": suspect.best and _values(suspect.best),
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
                "allowed": _ends(item.allowed),
                "sentence": item.sentence,
            }
            for item in audit.broken
        ],
    }
