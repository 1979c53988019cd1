"""An audit of a published table: as text and as records for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from winchcascade.core.published_table import load_text
from winchcascade.core.version import __version__
from winchcascade.report.table_text import finite, load_record, table_record, title_lines
from winchcascade.report.text_table import indented, wrapped
from winchcascade.tables.row_audit import percent

if TYPE_CHECKING:
    from winchcascade.core.published_table import Span
    from winchcascade.tables.audit import Audit
    from winchcascade.tables.row_audit import Contradiction, Repair

AUDIT_SCHEMA = "winchcascade/audit/1"
_VERDICTS = {"contradicted": "CONTRADICTED", "not_checkable": "not to be told"}


def audit_text(audit: Audit) -> str:
    """What a table says against itself, the verdicts on its claims and the windows it does not print; 100 columns at most."""
    known = audit.known
    lines = [*title_lines(audit.table)]
    lines += wrapped(
        f"bounds: means over {known.basis}: an efficiency can differ from the ratio of mean energies by "
        f"{percent(known.bounds.ratio)}, eta_pto from eta_trans eta_gen by {percent(known.bounds.product)}"
    )
    lines += wrapped(f"assumed, as the table does not say: {', '.join(known.assumed)}") if known.assumed else []
    lines += ["", f"cells that contradict each other: {len(audit.contradictions) or 'none'}"]
    for item in audit.contradictions:
        lines += indented(item.sentence)
        lines += wrapped(_remedy(item), indent="    ") if item.kind == "row" else []
    if audit.claims:
        lines += ["", f"claims of the text: {len(audit.claims)}, contradicted: {len(audit.contradicted) or 'none'}"]
    for verdict in ("contradicted", "not_checkable"):
        for claim in audit.claims:
            if claim.verdict == verdict:
                lines += indented(f"{_VERDICTS[verdict]}: {claim.sentence} [{claim.claim.where}]")
    confirmed = sum(claim.verdict == "confirmed" for claim in audit.claims)
    lines += indented(f"confirmed: {confirmed}, each in the JSON") if confirmed else []
    return "\n".join([*lines, *_windows(audit), "", _audit_summary(audit)]) + "\n"


def audit_record(audit: Audit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/audit/1`; an open end of an interval is None."""
    known = audit.known
    return {
        "schema": AUDIT_SCHEMA,
        "version": __version__,
        "table": table_record(audit.table),
        "ok": audit.ok,
        "bounds": {
            "cycles": known.cycles,
            "deviation_energy": known.energy,
            "deviation_eta": known.eta,
            "ratio": known.bounds.ratio,
            "product": known.bounds.product,
            "assumed": list(known.assumed),
        },
        "contradictions": [_contradiction_record(item) for item in audit.contradictions],
        "claims": [
            {
                "verdict": claim.verdict,
                "says": claim.claim.says,
                "where": claim.claim.where,
                "sentence": claim.sentence,
                "line": claim.claim.line,
            }
            for claim in audit.claims
        ],
        "windows": [{**load_record(w.load), "window_s": _span_record(w.span)} for w in audit.windows],
        "shared_windows": [
            {
                "loads": [load_record(load) for load in shared.loads],
                "window_s": _span_record(shared.span),
                "shortest_s": shared.shortest,
            }
            for shared in audit.shared
        ],
    }


def _remedy(item: Contradiction) -> str:
    """Which single cell would mend a row."""
    if not item.repairs:
        return "No change of a single cell makes this row consistent."
    first, *rest = item.repairs
    if not rest:
        return f"Only one cell's change makes the row consistent: {_changed(first)}."
    return (
        f"A change of one cell makes the row consistent: {', or '.join(_changed(repair) for repair in item.repairs)}."
    )


def _changed(repair: Repair) -> str:
    return f"{repair.metric} {repair.text}"


def _windows(audit: Audit) -> list[str]:
    if not audit.windows:
        return []
    lines = ["", "windows recovered from energy over power:"]
    for w in audit.windows:
        if w.span is None:
            lines.append(f"  {load_text(w.load)}: none; the stages contradict each other or leave it open")
        else:
            middle, half = 0.5 * (w.span.low + w.span.high), 0.5 * (w.span.high - w.span.low)
            lines.append(
                f"  {load_text(w.load)}: {w.span.low:.4f} to {w.span.high:.4f} s ({middle:.4f} s +- {percent(half / middle)})"
            )
    for shared in audit.shared:
        loads = ", ".join(load_text(load) for load in shared.loads)
        if len(shared.loads) > 1:
            span = f"{shared.span.low:.4f} to {shared.span.high:.4f} s"
            lines += indented(f"{loads} can share one window: {span}, such as {shared.shortest:g} s")
    lines += indented(f"no fewer than {len(audit.shared)} windows fit all rows") if len(audit.shared) > 1 else []
    return lines


def _audit_summary(audit: Audit) -> str:
    if audit.ok:
        return "nothing contradicts itself"
    cells, claims = len(audit.contradictions), len(audit.contradicted)
    return f"found: {cells} contradiction{'s'[: cells != 1]} between cells, {claims} contradicted claim{'s'[: claims != 1]}"


def _contradiction_record(item: Contradiction) -> dict[str, Any]:
    return {
        "kind": item.kind,
        **({} if item.load is None else load_record(item.load)),
        "cells": list(item.cells),
        "metric": item.metric,
        "printed": item.printed,
        "unit": item.unit,
        "allowed": _span_record(item.allowed),
        "missed_by": finite(item.missed_by),
        "sentence": item.sentence,
        "repairs": [{"metric": r.metric, "low": r.low, "high": finite(r.high)} for r in item.repairs],
        "line": item.line,
    }


def _span_record(span: Span | None) -> list[float | None] | None:
    return None if span is None else [finite(span.low), finite(span.high)]
