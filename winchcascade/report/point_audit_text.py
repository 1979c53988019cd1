"""An audit of a table of operating points, as text and as a record for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from winchcascade.core.version import __version__
from winchcascade.report.audit_text import table_record, title_lines
from winchcascade.report.screen import toned
from winchcascade.report.text_table import indented, wrapped

if TYPE_CHECKING:
    from winchcascade.tables.point_audit import PointAudit

POINT_AUDIT_SCHEMA = "winchcascade/point-audit/1"

_MOST_SHOWN = 12
"""Broken laws that the text shows; the JSON has all."""


def point_audit_text(audit: PointAudit) -> str:
    """What a table of operating points contradicts in itself."""
    table, broken = audit.table, audit.broken
    lines = title_lines(table)
    lines += [line for text in law_sentences(audit) for line in wrapped(text)]
    lines += ["", f"{len(table.rows)} rows, {audit.laws} cells compared"]
    lines += [line for text in unread_sentences(audit) for line in wrapped(text)]
    for fault in audit.faults:
        lines += indented(fault.sentence)
    for item in broken[:_MOST_SHOWN]:
        lines += indented(item.sentence)
    lines += indented(f"and {len(broken) - _MOST_SHOWN} more") if len(broken) > _MOST_SHOWN else []
    return "\n".join([*lines, "", toned(point_summary(audit), "good" if audit.ok else "contradiction")]) + "\n"


def law_sentences(audit: PointAudit) -> list[str]:
    """By which laws the cells of a row are compared."""
    table = audit.table
    laws = [f"{name} = {column.law.text}" for name, column in table.columns.items() if column.law]
    bounds = [name for name, column in table.columns.items() if column.at_most == 1.0]
    sentences = [f"laws: {', '.join(laws)}"] if laws else []
    sentences += [f"at most 1: {', '.join(bounds)}"] if bounds else []
    return sentences + ([f"means may differ by {100.0 * table.tolerance:g} %"] if table.tolerance else [])


def unread_sentences(audit: PointAudit) -> list[str]:
    """Which cells hold a text where a number was expected."""
    unread = audit.table.unread
    if not unread:
        return []
    more = f"; and {len(unread) - _MOST_SHOWN} more" if len(unread) > _MOST_SHOWN else ""
    return [f"not numbers, and not compared: {'; '.join(unread[:_MOST_SHOWN])}{more}"]


def point_summary(audit: PointAudit) -> str:
    """How many faults there are."""
    faults, broken = len(audit.faults), len(audit.broken)
    found = [f"{faults} column fault{'s'[: faults != 1]}"] if faults else []
    one = "1 cell that contradicts others"
    found += [one if broken == 1 else f"{broken} cells that contradict others"] if broken or not found else []
    return "nothing contradicts itself" if audit.ok else f"found: {', '.join(found)}"


def broken_laws_text(audit: PointAudit) -> str:
    """Column faults and contradictions alone."""
    found = [*(fault.sentence for fault in audit.faults), *(item.sentence for item in audit.broken)]
    return "".join(f"{line}\n" for sentence in found for line in indented(sentence))


def point_audit_record(audit: PointAudit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/point-audit/1`; JSON has null for an open end."""
    table = audit.table
    return {
        "schema": POINT_AUDIT_SCHEMA,
        "version": __version__,
        "table": table_record(table),
        "ok": audit.ok,
        "rows": len(table.rows),
        "cells_compared": audit.laws,
        "cells_not_numbers": [*table.unread],
        "column_faults": [
            {
                "kind": fault.kind,
                "columns": [*fault.columns],
                "heads": [table.columns[name].head for name in fault.columns],
                "broken_before": fault.broken_before,
                "broken_after": fault.broken_after,
                "sentence": fault.sentence,
            }
            for fault in audit.faults
        ],
        "contradictions": [
            {
                "row": item.row + 1,
                "key": {name: cell.value for name, cell in table.rows[item.row].items() if name in table.key},
                "column": item.column,
                "printed": item.printed,
                "unit": table.columns[item.column].unit,
                "allowed": (item.allowed.low, item.allowed.high),
                "sentence": item.sentence,
            }
            for item in audit.broken
        ],
    }
