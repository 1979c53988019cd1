"""A check against a published table: as text, JUnit XML, GitHub annotations and record for JSON, and its report."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.campaign_file import banner, joint_origin, origin_record, origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.core.published_table import PublishedTable
from winchcascade.core.version import __version__
from winchcascade.report import sheet as content
from winchcascade.report.audit_text import load_record, table_record, table_rows, title_lines
from winchcascade.report.digits import MINUS, NumberText, upper
from winchcascade.report.screen import toned
from winchcascade.report.sheet import TableColumn
from winchcascade.report.text_table import at_most, data_lines, headed, indented, joined, table_lines, wrapped
from winchcascade.report.wording import SYMBOL, load_words, page_text
from winchcascade.tables.check import CellCheck, Check, RowKey
from winchcascade.tables.point_table import PointTable

CHECK_SCHEMA = "winchcascade/check/1"
MAX_FINDINGS = 5
"""Findings of a log that are printed beside its cells; of more the number."""

_PARTS = {"rounding": "= rounding", "deviation": "+ deviation", "uncertainty": "+ 2 u", "means": "+ means"}
"""Parts of a tolerance, and how they are headed; `means` in tables of operating points that allow it."""

_LESS = (", ".join(_PARTS.values()), "allowed")
"""Columns of the table of cells that are left out first: all parts of the tolerance, then the tolerance."""


def check_text(check: Check) -> str:
    """Every cell with printed and found value, difference, tolerance and its parts."""
    lines = [*title_lines(check.table), *wrapped(f"tolerance: {recipe(check)}"), *data_lines(check.origins), ""]
    for row, log in dict.fromkeys((cell.row, cell.log) for cell in check.cells):
        cells = [cell for cell in check.cells if (cell.row, cell.log) == (row, log)]
        lines += wrapped(f"{row.text}: {'no run' if log is None else log}")
        if log is not None:
            head = ("metric", "printed", "found", "differs", "allowed", *(_PARTS[part] for part in _parts(check)), "")
            lines += table_lines(
                [head, *(_toned(_cell_row(check, cell), cell.ok) for cell in cells)],
                left=(0, len(head) - 1), close=(6, 7, 8)[: max(len(_parts(check)) - 1, 0)], indent="  ", omit=_LESS,
            )  # fmt: skip
        lines += [*(line for text in _findings(check, row) for line in headed(indented(text), "!", "warning")), ""]
    lines += [line for note in check.notes for line in headed(wrapped(f"note: {note}"), "note", "warning")]
    return joined([*lines, toned(check_summary(check), "good" if check.ok else "contradiction")])


def missed_text(check: Check) -> str:
    """The cells that do not agree, one sentence each."""
    return "".join(f"{line}\n" for cell in check.misses for line in wrapped(miss_sentence(cell), piped=None))


def _toned(row: Sequence[str], ok: bool) -> list[str]:
    """A row whose last cell, the outcome, is in colour."""
    return [*row[:-1], toned(row[-1], "good" if ok else "contradiction")]


def _findings(check: Check, row: RowKey) -> list[str]:
    """What is wrong with the log of a row: nothing, or the number of its findings and the first of them."""
    found = [[f"! {one_line(text)}"] for text in check.findings.get(row, ())]
    return (
        [f"findings in this log: {len(found)}", *at_most(found, MAX_FINDINGS, "more, all in --json")] if found else []
    )


def junit_xml(check: Check) -> str:
    """The check as JUnit XML: a test case for every cell, a failure for every one that misses.

    The findings of a log are the output of each of its cells.
    """
    from xml.etree import ElementTree

    counts = {"tests": str(len(check.cells)), "failures": str(len(check.misses)), "errors": "0", "skipped": "0"}
    root = ElementTree.Element("testsuites", {"name": "winchcascade check", **counts})
    suite = ElementTree.SubElement(root, "testsuite", {"name": one_line(check.table.name), **counts, "time": "0"})
    properties = ElementTree.SubElement(suite, "properties")
    data = one_line(origin_words(check.origins))
    for name, value in (("generator", f"winchcascade/{__version__}"), ("data", data)):
        ElementTree.SubElement(properties, "property", {"name": name, "value": value})
    for cell in check.cells:
        place = f"{one_line(check.table.name)}.{cell.row.text.replace(' ', '_').replace('.', 'p')}"
        case = ElementTree.SubElement(suite, "testcase", {"classname": place, "name": cell.metric, "time": "0"})
        if not cell.ok:
            failure = ElementTree.SubElement(case, "failure", {"message": miss_sentence(cell), "type": cell.outcome})
            failure.text = " ".join(text for text in _cell_row(check, cell) if text)
        if found := _findings(check, cell.row):
            ElementTree.SubElement(case, "system-out").text = "\n".join(found)
    if check.notes:
        ElementTree.SubElement(suite, "system-out").text = "\n".join(one_line(note) for note in check.notes)
    ElementTree.indent(root)
    markup = _NOT_XML.sub("?", ElementTree.tostring(root, encoding="unicode"))
    return f'<?xml version="1.0" encoding="utf-8"?>\n{markup}\n'


_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold, not even escaped."""


def github_annotations(check: Check, table_path: str | Path) -> str:
    """One workflow command a line: an error at the cell in the table file for every miss, a warning at its row for each log
    with findings, a notice for every note.
    """
    found = [("error", cell.line, f"{cell.row.text} {cell.metric}", miss_sentence(cell)) for cell in check.misses]
    found += [("warning", row.line, f"{row.text} findings", "\n".join(_findings(check, row))) for row in check.findings]
    file = f"file={_property(str(table_path))}"
    lines = [
        *(
            f"::{kind} {file}{'' if line is None else f',line={line}'},title={_property(title)}::{_message(text)}"
            for kind, line, title, text in found
        ),
        *(f"::notice::{_message(one_line(note))}" for note in check.notes),
    ]
    return joined(lines)


def check_record(check: Check) -> dict[str, Any]:
    """The check as nested records, schema `winchcascade/check/1`; values of a cell are in the cell's `unit`."""
    return {
        "schema": CHECK_SCHEMA,
        "version": __version__,
        "table": table_record(check.table),
        "data": origin_record(joint_origin(check.origins)),
        "factors": msgspec.structs.asdict(check.factors),
        "ok": check.ok,
        "misses": len(check.misses),
        "cells": [
            {
                **_row_record(cell.row),
                "metric": cell.metric,
                "unit": cell.column.unit,
                "decimals": cell.column.decimals,
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
                    **({} if cell.row.number is None else {"means": cell.means}),
                },
                "missed_by": cell.missed_by,
                "line": cell.line,
            }
            for cell in check.cells
        ],
        "findings": [{**_row_record(row), "findings": list(found)} for row, found in check.findings.items()],
        "notes": check.notes,
    }


def _row_record(row: RowKey) -> dict[str, Any]:
    """A row as records have it: by its load, or by its number and its key cells as printed."""
    return {"row": row.number, "key": dict(row.cells)} if row.load is None else load_record(row.load)


def miss_sentence(cell: CellCheck) -> str:
    """Say of a cell that does not agree where it stands, what is printed, what was found and by how much it misses."""
    place = f"{cell.row.text}, {cell.metric}: {_printed(cell)} is printed"
    if cell.outcome == "no_run":
        return f"{place}, and no run of this {'load' if cell.load is not None else 'row'} was given."
    if cell.measured is None or cell.difference is None or cell.missed_by is None:
        return f"{place}, and {one_line(cell.log or 'the log')} has no measured value."
    return (
        f"{place}, {one_line(cell.log or 'the log')} gives {_fine(cell.measured, cell)}; the difference "
        f"{_fine(cell.difference, cell, sign=True)} is beyond {_fine(cell.tolerance, cell)} by {_by(cell.missed_by, cell)}."
    )


def recipe(check: Check) -> str:
    """What a cell allows, part by part."""
    factors, table = check.factors, check.table
    capped = " (at most the table's)" if isinstance(table, PublishedTable) and table.deviations else ""
    parts = (
        (factors.rounding, "half a unit of the last decimal"),
        (factors.deviation, f"largest deviation of the cycles{capped}"),
        (factors.uncertainty, "2 standard uncertainties u of the mean by the sensors"),
    )
    texts = [part if factor == 1 else f"{factor:g} x {part}" for factor, part in parts if factor]
    means = factors.means * table.tolerance if isinstance(table, PointTable) else 0.0
    return " + ".join(texts + ([f"{100.0 * means:g} % that means may differ by"] if means else [])) or "none"


def _parts(check: Check) -> list[str]:
    """Parts of the tolerances of a check that a factor does not leave out."""
    allowed = [part for part in _PARTS if getattr(check.factors, part)]
    return [part for part in allowed if part != "means" or any(cell.means for cell in check.cells)]


def _cell_row(check: Check, cell: CellCheck) -> tuple[str, ...]:
    """One line of the table of cells; without a measured value there is none to compare."""
    parts = _parts(check)
    if cell.measured is None or cell.difference is None or cell.missed_by is None:
        return (cell.metric, _printed(cell), "none", "", "", *[""] * len(parts), "MISS")
    return (
        cell.metric,
        _printed(cell),
        _fine(cell.measured, cell),
        _fine(cell.difference, cell, sign=True),
        _fine(cell.tolerance, cell),
        *(f"{_PARTS[part][0]} {_fine(getattr(cell, part), cell, more=2)}" for part in parts),
        "ok" if cell.ok else f"MISS by {_by(cell.missed_by, cell)}",
    )


def _printed(cell: CellCheck) -> str:
    return cell.column.text(cell.printed)


def _fine(value: float, cell: CellCheck, *, more: int = 1, sign: bool = False) -> str:
    """A number with more decimals than are printed."""
    return f"{value:{'+' if sign else ''}.{max(cell.column.decimals + more, 0)}f}"


def _by(missed: float, cell: CellCheck) -> str:
    """How far a cell misses, never as 0: a small miss with its first digit."""
    text = _fine(missed, cell)
    return text if float(text) > 0 else f"{missed:.1g}"


def check_summary(check: Check) -> str:
    """How many cells agree, and why others do not."""
    found, all_cells = Counter(cell.outcome for cell in check.misses), len(check.cells)
    words = ("differs" if found["miss"] == 1 else "differ", "not measured", "without a run")
    counts = zip((found["miss"], found["not_measured"], found["no_run"]), words, strict=True)
    named = ", ".join(f"{n} {what}" for n, what in counts if n)
    missed = f"{all_cells - len(check.misses)} of {all_cells} cells agree; {named}"
    return f"all {all_cells} cells agree" if check.ok else missed


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")


VERDICTS = {"ok": "agrees", "miss": "differs", "not_measured": "not measured", "no_run": "no run"}
"""Outcomes of a cell in words."""


def check_report(check: Check, *, command: str = "") -> content.Report:
    """Make the rows of the report of a check."""
    table, factors = check.table, check.factors
    counts = Counter(cell.outcome for cell in check.cells)
    whole = f"of {len(check.cells)} cells"
    without = f"{counts['no_run']} without a run" if counts["no_run"] else whole
    rows = [(_row_words(row), text) for row, found in check.findings.items() for text in found]
    return content.Report(
        kind="Check against a published table",
        title=table.title or table.name,
        subtitle=" · ".join(part for part in (table.name, table.source) if part),
        tiles=(
            content.Tile("Cells that agree", "", str(counts["ok"]), whole),
            content.Tile("Cells that differ", "", str(counts["miss"]), whole),
            content.Tile("Cells not measured", "", str(counts["not_measured"]), without),
        ),
        points=(
            content.Point("Outcome", f"{upper(check_summary(check))}.", "good" if check.ok else "warn"),
            content.data_point(check.origins),
            content.Point("Tolerance", f"{upper(recipe(check))}."),
            *(
                [content.Point("Logs", f"{len(rows)} findings in {len(check.findings)} logs; see Findings.", "warn")]
                if rows
                else []
            ),
            *(content.Point("Note", text, "warn") for text in check.notes),
        ),
        sections=(
            content.section(
                "differences",
                "Cells that do not agree",
                *(content.Note(page_text(miss_sentence(cell), one_line(cell.log or ""))) for cell in check.misses),
                None if check.misses else content.Note("All cells agree."),
            ),
            content.section("cells", "Every cell", _cells(check)),
            content.section(
                "findings",
                "Findings",
                content.pairs_table("findings", "Findings in the logs.", rows, ("Row", "What was found in its log"))
                if rows
                else content.Note("No fault was found in the logs."),
            ),
            content.provenance_section(
                [
                    *table_rows(table),
                    ("Logs", ", ".join(dict.fromkeys(cell.log for cell in check.cells if cell.log))),
                    (
                        "Factors",
                        f"rounding {factors.rounding:g}, deviation {factors.deviation:g}, uncertainty "
                        f"{factors.uncertainty:g}",
                    ),
                ],
                command,
            ),
        ),
        banner=banner(check.origins),
    )


def _cells(check: Check) -> content.Table:
    """Every cell: published, found, difference, tolerance with its parts, verdict."""
    return content.ItemTable[CellCheck](
        "cells",
        "Published and found values of every cell." if check.cells else "No cell was compared.",
        [
            TableColumn("Row", text=True, of=lambda c: _row_words(c.row)),
            TableColumn("Quantity", text=True, of=lambda c: SYMBOL.get(c.metric, c.metric)),
            TableColumn("Unit", text=True, of=lambda c: "" if c.column.unit == "1" else c.column.unit),
            TableColumn("Published", of=lambda c: _text(c, c.printed, 0)),
            TableColumn("Found", of=partial(_value, "measured")),
            TableColumn("Difference", of=partial(_value, "difference")),
            TableColumn("Allowed", of=partial(_value, "tolerance")),
            TableColumn("Verdict", text=True, of=lambda c: VERDICTS[c.outcome]),
            *([TableColumn("Beyond by", of=partial(_value, "missed_by"))] if check.misses else []),
            *(
                TableColumn("2 u" if part == "uncertainty" else upper(part), of=partial(_value, part))
                for part in _parts(check)
            ),
            TableColumn("Log", text=True, of=lambda c: "" if c.log is None else one_line(Path(c.log).name)),
        ],
        note="A cell agrees if the difference is not larger than what is allowed: the sum of rounding, deviation and 2 u, "
        "with u the standard uncertainty."
        if check.cells
        else "",
    ).always(check.cells)


def _row_words(row: RowKey) -> str:
    """The row of a published table: its load, or its key."""
    return row.text if row.load is None else load_words(row.load)


def _value(name: str, cell: CellCheck) -> NumberText | None:
    """A number of a cell with one decimal more than is published; None without a measured value."""
    value: float | None = getattr(cell, name)
    sign = "+" if name == "difference" else ""
    return None if value is None or cell.measured is None else _text(cell, value, 1, sign=sign)


def _text(cell: CellCheck, value: float, more: int, *, sign: str = "") -> NumberText:
    """A number with a given number of decimals more than are published; a small one that would be 0 with its first digit."""
    text = f"{value:{sign}.{max(cell.column.decimals + more, 0)}f}"
    if value and float(text) == 0.0:
        text = f"{value:{sign}.1g}"
    return NumberText(text.replace("-", MINUS), value)
