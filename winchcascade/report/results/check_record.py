"""A check as JSON, as JUnit XML for a test server, and as annotations for GitHub."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import msgspec

from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.plain_text import one_line
from winchcascade.core.version import GENERATOR, __version__
from winchcascade.report.results.audit_record import load_record, picked, table_record
from winchcascade.report.results.checks import allowance, miss_sentence
from winchcascade.report.wording import origin_words
from winchcascade.tables.check import Check
from winchcascade.tables.published_table import TableRow

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
    more = (
        [f"... {len(found) - MAX_FINDINGS} more, all in --json"]
        if len(found) > MAX_FINDINGS
        else []
    )
    lines = [
        f"findings in this log: {len(found)}",
        *(f"! {one_line(text)}" for text in found[:MAX_FINDINGS]),
        *more,
    ]
    return "\n".join(lines) if found else ""


def _message(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _message(text).replace(":", "%3A").replace(",", "%2C")
