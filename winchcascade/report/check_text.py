"""A check against a published table, and an audit of one: as text, JUnit XML, GitHub annotations and records for JSON."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from winchcascade import __version__
from winchcascade.published.rows import percent
from winchcascade.table import Table, load_text, unit_suffix

if TYPE_CHECKING:
    from winchcascade.published.audit import Audit
    from winchcascade.published.check import CellCheck, Check
    from winchcascade.published.rows import Contradiction, Repair
    from winchcascade.table import Span

CHECK_SCHEMA = "winchcascade/check/1"
AUDIT_SCHEMA = "winchcascade/audit/1"
_WIDTH = 100
_HEAD = ("metric", "printed", "found", "differs", "allowed", "= rounding", "+ deviation", "+ 2 u", "")
_VERDICTS = {"contradicted": "CONTRADICTED", "not_checkable": "not to be told"}


def check_text(check: Check) -> str:
    """Every cell with printed and found value, difference, tolerance and its parts; 100 columns at most."""
    lines = [*_title(check.table), *wrapped(f"tolerance: {_recipe(check)}"), ""]
    for load in dict.fromkeys(cell.load for cell in check.cells):
        cells = [cell for cell in check.cells if cell.load == load]
        log = next((cell.log for cell in cells if cell.log is not None), None)
        lines += wrapped(f"{load_text(load)}: {'no run' if log is None else log}")
        if log is not None:
            lines += [f"  {line}" for line in _aligned([_HEAD, *(_cell_row(cell) for cell in cells)])]
        lines.append("")
    for note in check.notes:
        lines += wrapped(f"note: {note}")
    return "\n".join([*lines, _summary(check)]) + "\n"


def audit_text(audit: Audit) -> str:
    """What a table says against itself, the verdicts on its claims and the windows it does not print; 100 columns at most."""
    known = audit.known
    lines = [*_title(audit.table)]
    lines += wrapped(
        f"bounds: means over {known.basis}: an efficiency can differ from the ratio of mean energies by "
        f"{percent(known.bounds.ratio)}, eta_pto from eta_trans eta_gen by {percent(known.bounds.product)}"
    )
    lines += wrapped(f"assumed, as the table does not say: {', '.join(known.assumed)}") if known.assumed else []
    lines += ["", f"cells that contradict each other: {len(audit.contradictions) or 'none'}"]
    for item in audit.contradictions:
        lines += _item(item.sentence)
        lines += wrapped(_remedy(item), indent="    ") if item.kind == "row" else []
    if audit.claims:
        lines += ["", f"claims of the text: {len(audit.claims)}, contradicted: {len(audit.contradicted) or 'none'}"]
    for verdict in ("contradicted", "not_checkable"):
        for claim in audit.claims:
            if claim.verdict == verdict:
                lines += _item(f"{_VERDICTS[verdict]}: {claim.sentence} [{claim.claim.where}]")
    confirmed = sum(claim.verdict == "confirmed" for claim in audit.claims)
    lines += _item(f"confirmed: {confirmed}, each in the JSON") if confirmed else []
    return "\n".join([*lines, *_windows(audit), "", _audit_summary(audit)]) + "\n"


def junit_xml(check: Check) -> str:
    """The check as JUnit XML: a test case for every cell, a failure for every one that misses."""
    from xml.etree import ElementTree

    counts = {"tests": str(len(check.cells)), "failures": str(len(check.misses)), "errors": "0", "skipped": "0"}
    root = ElementTree.Element("testsuites", {"name": "winchcascade check", **counts})
    suite = ElementTree.SubElement(root, "testsuite", {"name": _plain(check.table.name), **counts, "time": "0"})
    properties = ElementTree.SubElement(suite, "properties")
    ElementTree.SubElement(properties, "property", {"name": "generator", "value": f"winchcascade/{__version__}"})
    for cell in check.cells:
        place = f"{_plain(check.table.name)}.{load_text(cell.load).replace(' ', '_').replace('.', 'p')}"
        case = ElementTree.SubElement(suite, "testcase", {"classname": place, "name": cell.metric, "time": "0"})
        if not cell.ok:
            failure = ElementTree.SubElement(case, "failure", {"message": miss_sentence(cell), "type": cell.outcome})
            failure.text = " ".join(text for text in _cell_row(cell) if text)
    if check.notes:
        ElementTree.SubElement(suite, "system-out").text = "\n".join(_plain(note) for note in check.notes)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def github_annotations(check: Check, table_path: str | Path) -> str:
    """One workflow command a line: an error at the cell in the table file for every miss, a notice for every note."""
    lines = []
    for cell in check.misses:
        place = f"file={_property(str(table_path))}" + (f",line={cell.line}" if cell.line is not None else "")
        title = _property(f"{load_text(cell.load)} {cell.metric}")
        lines.append(f"::error {place},title={title}::{_message(miss_sentence(cell))}")
    lines += [f"::notice::{_message(_plain(note))}" for note in check.notes]
    return "".join(f"{line}\n" for line in lines)


def check_record(check: Check) -> dict[str, Any]:
    """The check as nested records, schema `winchcascade/check/1`; values of a cell are in the cell's `unit`."""
    return {
        "schema": CHECK_SCHEMA,
        "version": __version__,
        "table": _table_record(check.table),
        "factors": {name: getattr(check.factors, name) for name in check.factors.__struct_fields__},
        "ok": check.ok,
        "misses": len(check.misses),
        "cells": [
            {
                **load_record(cell.load),
                "metric": cell.metric,
                "unit": cell.unit,
                "decimals": cell.decimals,
                "outcome": cell.outcome,
                "log": cell.log,
                "printed": cell.printed,
                "measured": cell.measured,
                "difference": cell.difference,
                "tolerance": {
                    "total": cell.tolerance,
                    "rounding": cell.rounding,
                    "deviation": cell.deviation,
                    "uncertainty": cell.uncertainty,
                },
                "missed_by": cell.missed_by,
                "line": cell.line,
            }
            for cell in check.cells
        ],
        "notes": list(check.notes),
    }


def audit_record(audit: Audit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/audit/1`; an open end of an interval is None."""
    known = audit.known
    return {
        "schema": AUDIT_SCHEMA,
        "version": __version__,
        "table": _table_record(audit.table),
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


def miss_sentence(cell: CellCheck) -> str:
    """Say of a cell that does not agree where it stands, what is printed, what was found and by how much it misses."""
    place = f"{load_text(cell.load)}, {cell.metric}: {_printed(cell)} is printed"
    if cell.outcome == "no_run":
        return f"{place}, and no run of this load was given."
    if cell.measured is None or cell.difference is None or cell.missed_by is None:
        return f"{place}, and {_plain(cell.log or 'the log')} has no measured value."
    return (
        f"{place}, {_plain(cell.log or 'the log')} gives {_fine(cell.measured, cell)}; the difference "
        f"{_fine(cell.difference, cell, sign=True)} is beyond {_fine(cell.tolerance, cell)} by {_by(cell.missed_by, cell)}."
    )


def _title(table: Table) -> list[str]:
    return wrapped(f"{table.name}: {table.title}") + wrapped(f"source: {table.source}")


def _recipe(check: Check) -> str:
    parts = (
        "half a unit of the last decimal",
        "largest deviation of the cycles",
        "2 standard uncertainties u of the mean",
    )
    names = check.factors.__struct_fields__
    factors = {name: getattr(check.factors, name) for name in names}
    return " + ".join(
        part if factors[name] == 1 else f"{factors[name]:g} x {part}" for name, part in zip(names, parts, strict=True)
    )


def _cell_row(cell: CellCheck) -> tuple[str, ...]:
    """One line of the table of cells; without a measured value there is none to compare."""
    if cell.measured is None or cell.difference is None or cell.missed_by is None:
        return (cell.metric, _printed(cell), "none", "", "", "", "", "", "MISS")
    return (
        cell.metric,
        _printed(cell),
        _fine(cell.measured, cell),
        _fine(cell.difference, cell, sign=True),
        _fine(cell.tolerance, cell),
        f"= {_fine(cell.rounding, cell, more=2)}",
        f"+ {_fine(cell.deviation, cell, more=2)}",
        f"+ {_fine(cell.uncertainty, cell, more=2)}",
        "ok" if cell.ok else f"MISS by {_by(cell.missed_by, cell)}",
    )


def _printed(cell: CellCheck) -> str:
    return f"{cell.printed:.{max(cell.decimals, 0)}f}{unit_suffix(cell.unit)}"


def _fine(value: float, cell: CellCheck, *, more: int = 1, sign: bool = False) -> str:
    """A number with more decimals than are printed."""
    return f"{value:{'+' if sign else ''}.{max(cell.decimals + more, 0)}f}"


def _by(missed: float, cell: CellCheck) -> str:
    """How far a cell misses, never as 0: a small miss with its first digit."""
    text = _fine(missed, cell)
    return text if float(text) > 0 else f"{missed:.1g}"


def _summary(check: Check) -> str:
    agreed, all_of = len(check.cells) - len(check.misses), len(check.cells)
    if check.ok:
        return f"all {all_of} cells agree"
    unmeasured = sum(cell.outcome == "not_measured" for cell in check.cells)
    without = sum(cell.outcome == "no_run" for cell in check.cells)
    off = len(check.misses) - unmeasured - without
    parts = [
        f"{n} {what}"
        for n, what in (
            (off, "differs" if off == 1 else "differ"),
            (unmeasured, "not measured"),
            (without, "without a run"),
        )
        if n
    ]
    return f"{agreed} of {all_of} cells agree; {', '.join(parts)}"


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
            lines += _item(f"{loads} can share one window: {span}, such as {shared.shortest:g} s")
    lines += _item(f"no fewer than {len(audit.shared)} windows fit all rows") if len(audit.shared) > 1 else []
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
        "missed_by": _finite(item.missed_by),
        "sentence": item.sentence,
        "repairs": [{"metric": r.metric, "low": r.low, "high": _finite(r.high)} for r in item.repairs],
        "line": item.line,
    }


def _table_record(table: Table) -> dict[str, Any]:
    return {"name": table.name, "title": table.title, "source": table.source, "path": table.path}


def load_record(load: float) -> dict[str, Any]:
    """A load as records have it: null ohms for an open circuit."""
    return {"load_ohm": _finite(load), "open_circuit": math.isinf(load)}


def _span_record(span: Span | None) -> list[float | None] | None:
    return None if span is None else [_finite(span.low), _finite(span.high)]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def wrapped(text: str, indent: str = "") -> list[str]:
    """A sentence in lines of 100 columns at most."""
    whole = _plain(text).replace(" %", "\N{NO-BREAK SPACE}%")  # a number and its percent sign stay on one line
    lines = textwrap.wrap(whole, _WIDTH, initial_indent=indent, subsequent_indent=f"{indent}  ", break_on_hyphens=False)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _item(text: str) -> list[str]:
    return wrapped(text, indent="  ")


def _aligned(rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Columns under each other: the first and the last to the left, numbers to the right."""
    rows = list(rows)
    last = len(rows[0]) - 1
    width = [max(len(row[k]) for row in rows) for k in range(last + 1)]

    def line(row: tuple[str, ...]) -> str:
        numbers = [text.rjust(width[k]) for k, text in enumerate(row) if 0 < k < last]
        return "  ".join([row[0].ljust(width[0]), *numbers[:4], " ".join(numbers[4:]), row[last]]).rstrip()

    return [line(row) for row in rows]


def _plain(text: str) -> str:
    """Text from a file without the control characters that a terminal would obey and XML does not know."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")
