"""What a check against a published table states: every cell with what was found and allowed, those
that agree folded away; as JSON, JUnit XML and annotations for GitHub too.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.plain_text import one_line
from winchcascade.core.version import GENERATOR, __version__
from winchcascade.report.content import (
    Column,
    Measured,
    Note,
    Report,
    Tile,
    known,
    places,
    section,
    shown,
    table,
)
from winchcascade.report.glossary import short, upper
from winchcascade.report.results.audit_record import load_record, picked, table_record
from winchcascade.report.results.common import PRINTED, data_note, provenance, table_rows
from winchcascade.report.wording import at_most, banner, origin_words
from winchcascade.tables.check import CellCheck, Check
from winchcascade.tables.published_table import TableRow

OUTCOMES = {"miss": "differs", "not_measured": "not measured", "no_run": "no run"}
"""Outcomes of a cell that does not agree, in words."""

PARTS = {"rounding": "rounding", "deviation": "deviation", "uncertainty": "2 u", "means": "means"}
"""Parts of what is allowed, and how they are headed."""


def check_report(check: Check, *, command: str = "") -> Report:
    """Report of a check."""
    counts, whole = Counter(cell.outcome for cell in check.cells), f"of {len(check.cells)} cells"
    lost = counts["not_measured"] + counts["no_run"]
    findings = [(row, text) for row, found in check.findings for text in found]
    verdict = Note(check_summary(check), "Outcome", "good" if check.ok else "warn", brief=False)
    advice = (
        ""
        if not counts["miss"]
        else "`winchcascade audit` shows whether the table contradicts itself."
    )
    columns, agreeing = _columns(check), [cell for cell in check.cells if cell.ok]
    means = "2 u: twice the standard uncertainty of the mean by the sensors."
    if advice and findings:
        advice = "Correct the logs with findings first."
    return Report(
        kind="Check against a published table",
        title=f"{check.table.name}: {check.table.title}",
        subtitle=check.table.source,
        tiles=[
            Tile("Agree", "cells within what is allowed", f"{counts['ok']}", whole),
            Tile("Differ", "cells beyond what is allowed", f"{counts['miss']}", whole),
            Tile("Without a value", "cells not measured, or without a run", f"{lost}", whole),
        ],
        points=[
            verdict,
            Note(advice, "Next"),
            data_note(check.origins),
            Note(f"{upper(recipe(check))}.", "Allowed"),
            *(Note(text, "Note", "warn") for text in check.notes),
        ],
        sections=[
            section("findings", "Findings in the logs", table("findings", "What is wrong with the "
                                                                          "logs.", FINDINGS, findings)),
            section(
                "cells", "Cells that do not agree",
                table("cells", "Printed and found values that do not agree.", columns, check.misses, note=means),
                None if check.cells else Note("No cell was compared."),
            ),
            section(
                "agreeing", "Cells that agree",
                table("agreeing", "Printed and found values that agree.", columns, agreeing, note=means, brief=False),
                folded=True,
            ),
            provenance(
                [*table_rows(check.table), ("Logs", ", ".join(dict.fromkeys(cell.log for cell in check.cells if cell.log)))],
                command,
            ),
        ],
        verdict=verdict,
        banner=banner(check.origins),
    )  # fmt: skip


FINDINGS: tuple[Column[tuple[TableRow, str]], ...] = (
    Column("row", lambda found: found[0].name),
    Column("what was found in its log", lambda found: one_line(found[1])),
)


def failed_check(check: Check) -> Report:
    """The cells that do not agree alone."""
    return Report(
        "Check", check_summary(check), points=[Note(miss_sentence(cell)) for cell in check.misses]
    )


def miss_sentence(cell: CellCheck) -> str:
    """Say of a cell that does not agree where it stands, what is printed, what was found and by
    how much it differs.
    """
    place = f"{cell.row.name}, {cell.metric}: {cell.cell.words} is printed"
    log = one_line(cell.log or "the log")
    if cell.outcome == "no_run":
        return f"{place}, and no run of this row was given."
    if cell.measured is None:
        return f"{place}, and {log} has no measured value."
    difference = shown(_finer(cell, cell.difference), signed=True)
    return (
        f"{place}, {log} gives {shown(_found(cell))}; the difference {difference} "
        f"is beyond "
        f"{shown(_finer(cell, cell.tolerance))} by {shown(beyond(cell))}."
    )


def check_summary(check: Check) -> str:
    """How many cells agree, and why others do not."""
    count, found = len(check.cells), Counter[str](cell.outcome for cell in check.misses)
    words = {
        "miss": "differ" + "s" * (found["miss"] == 1),
        "not_measured": "not measured",
        "no_run": "without a run",
    }
    named = ", ".join(
        f"{found[outcome]} {word}" for outcome, word in words.items() if found[outcome]
    )
    return (
        f"All {count} cells agree."
        if check.ok
        else f"{count - len(check.misses)} of {count} cells agree; {named}."
    )


def _columns(check: Check) -> list[Column[CellCheck]]:
    """Columns of a cell: printed, found, difference, what is allowed with its parts, outcome."""
    several = len({(cell.row.number, cell.log) for cell in check.cells}) > len(
        {cell.row.number for cell in check.cells}
    )
    return [
        Column("row", lambda cell: cell.row.name),
        Column("cell", lambda cell: short(cell.metric)),
        Column("unit", lambda cell: "" if cell.cell.unit == "1" else cell.cell.unit),
        Column(
            "printed",
            lambda cell: Measured(cell.cell.value, PRINTED * cell.cell.rounding),
        ),
        Column("found", _found),
        Column("differs", lambda cell: _finer(cell, cell.difference), signed=True),
        Column("allowed", partial(_allowed, "tolerance")),
        Column("beyond", beyond),
        Column("outcome", lambda cell: OUTCOMES.get(cell.outcome)),
        *(Column(PARTS[part], partial(_allowed, part), brief=False) for part in _parts(check)),
        Column(
            "log", lambda cell: one_line(Path(cell.log).name) if cell.log else "", brief=several
        ),
    ]


def allowance(check: Check, cell: CellCheck) -> str:
    """What a cell allows in numbers, part by part."""
    decimals = max(cell.cell.decimals + 2, 0)
    return " + ".join(f"{PARTS[part]} {getattr(cell, part):.{decimals}f}" for part in _parts(check))


def _parts(check: Check) -> list[str]:
    """Parts of what is allowed that a factor does not leave out."""
    allowed = [part for part in PARTS if getattr(check.factors, part)]
    return [part for part in allowed if part != "means" or any(cell.means for cell in check.cells)]


def _finer(cell: CellCheck, value: float | None) -> Measured:
    """A value with one decimal more than is printed."""
    return Measured(value, 0.1 * PRINTED * cell.cell.rounding)


def _found(cell: CellCheck) -> Measured:
    """The measured value with the digits of its own uncertainty; where that is unknown, one
    decimal more than is printed.
    """
    return Measured(cell.measured, cell.u) if known(cell.u) else _finer(cell, cell.measured)


def _allowed(part: str, cell: CellCheck) -> Measured | None:
    """What is allowed, or a part of it; nothing where no value was found."""
    return None if cell.measured is None else _finer(cell, getattr(cell, part))


def beyond(cell: CellCheck) -> Measured | None:
    """How far a cell that differs is beyond what is allowed, never as 0: a small number with its
    first two digits.
    """
    missed = cell.missed_by
    if missed is None or cell.ok:
        return None
    u = 0.1 * PRINTED * cell.cell.rounding
    return Measured(missed, u if round(missed, places(u)) else missed)


def recipe(check: Check) -> str:
    """What a cell allows, part by part."""
    factors, checked = check.factors, check.table
    capped = " (at most that of the table)" if checked.deviations else ""
    named = (
        (factors.rounding, "half a unit of the last decimal"),
        (factors.deviation, f"maximum deviation of the cycles{capped}"),
        (factors.uncertainty, "2 standard uncertainties of the mean by the sensors"),
    )
    texts = [part if factor == 1 else f"{factor:g} x {part}" for factor, part in named if factor]
    means = factors.means * checked.tolerance
    return (
        " + ".join(texts + ([f"{100.0 * means:g} % that means may differ by"] if means else []))
        or "nothing"
    )


MAX_FINDINGS = 5
"""Findings of a log that are stated for each cell; of more the number."""

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 cannot hold, not even escaped."""


def check_record(check: Check) -> dict[str, Any]:
    """The check as nested records, schema `winchcascade/check/1`; values of a cell are in its
    `unit`.
    """
    return {
        "schema": "winchcascade/check/1",
        "version": __version__,
        "table": table_record(check.table),
        "data": origin_record(joint_origin(check.origins)),
        "factors": msgspec.to_builtins(check.factors),
        "ok": check.ok,
        "misses": len(check.misses),
        "cells": [
            {
                **_row(cell.row, check),
                "metric": cell.metric,
                **picked(cell.cell, "unit", "decimals", "line"),
                "printed": cell.cell.value,
                **picked(cell, "outcome", "log", "measured", "difference", "missed_by"),
                "tolerance": {
                    "total": cell.tolerance,
                    **picked(cell, "rounding", "deviation", "uncertainty", "limits", "basis"),
                    **({} if check.table.by_load else {"means": cell.means}),
                },
            }
            for cell in check.cells
        ],
        "findings": [
            {**_row(row, check), "findings": list(found)} for row, found in check.findings
        ],
        "notes": check.notes,
    }


def _row(row: TableRow, check: Check) -> dict[str, Any]:
    """A row by its load, or by its number and its key cells as printed."""
    if row.load is not None:
        return load_record(row.load)
    return {
        "row": row.number,
        "key": {name: row.cells[name].text for name in check.table.keys if name in row.cells},
    }


def junit_xml(check: Check) -> str:
    """The check as JUnit XML: a test case for every cell, a failure for every one that does not
    agree.

    The findings of a log are the output of each of its cells.
    """
    from xml.etree import ElementTree

    name = one_line(check.table.name)
    counts = {
        "tests": str(len(check.cells)),
        "failures": str(len(check.misses)),
        "errors": "0",
        "skipped": "0",
    }
    root = ElementTree.Element("testsuites", {"name": "winchcascade check", **counts})
    suite = ElementTree.SubElement(root, "testsuite", {"name": name, **counts, "time": "0"})
    properties = ElementTree.SubElement(suite, "properties")
    for key, value in (("generator", GENERATOR), ("data", one_line(origin_words(check.origins)))):
        ElementTree.SubElement(properties, "property", {"name": key, "value": value})
    for cell in check.cells:
        place = f"{name}.{cell.row.name.replace(' ', '_').replace('.', 'p')}"
        case = ElementTree.SubElement(
            suite, "testcase", {"classname": place, "name": cell.metric, "time": "0"}
        )
        if not cell.ok:
            failure = ElementTree.SubElement(
                case, "failure", {"message": miss_sentence(cell), "type": cell.outcome}
            )
            failure.text = None if cell.measured is None else f"allowed: {allowance(check, cell)}"
        if found := _findings(check, cell.row):
            ElementTree.SubElement(case, "system-out").text = found
    if check.notes:
        ElementTree.SubElement(suite, "system-out").text = "\n".join(map(one_line, check.notes))
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{NOT_XML.sub("?", ElementTree.tostring(root, encoding="unicode"))}\n'


def github_annotations(check: Check, table_path: str | Path) -> str:
    """One workflow command a line: an error at the cell in the table file for every miss, a warning
    at its row for each log with findings, a notice for every note.
    """
    found = [
        ("error", cell.cell.line, f"{cell.row.name} {cell.metric}", miss_sentence(cell))
        for cell in check.misses
    ]
    found += [
        ("warning", row.line, f"{row.name} findings", _findings(check, row))
        for row, _ in check.findings
    ]
    file = f"file={_property(str(table_path))}"
    lines = [
        f"::{kind} {file}{'' if line is None else f',line={line}'},title={_property(title)}::{_message(text)}"
        for kind, line, title, text in found
    ]
    return "".join(
        f"{line}\n"
        for line in (*lines, *(f"::notice::{_message(one_line(note))}" for note in check.notes))
    )


def _findings(check: Check, row: TableRow) -> str:
    """What is wrong with the log of a row in lines: how many findings there are, and the first
    of them.
    """
    found = next((found for of, found in check.findings if of.number == row.number), ())
    texts = [f"! {one_line(text)}" for text in found]
    listed = at_most(texts, MAX_FINDINGS, "... {} more, all in --json")
    return "\n".join([f"findings in this log: {len(found)}", *listed]) if found else ""


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")
