"""The report of a check: published values beside those of the logs, a row for each cell with its verdict."""

from __future__ import annotations

from collections import Counter
from functools import partial
from pathlib import Path

from winchcascade.core.campaign_file import banner
from winchcascade.core.plain_text import one_line
from winchcascade.core.table_toml import table_place
from winchcascade.report.check_text import check_summary, miss_sentence, recipe
from winchcascade.report.digits import MINUS, NumberText, upper
from winchcascade.report.provenance import data_point, file_digest, provenance_table
from winchcascade.report.report_model import Note, Point, Report, Tile, section
from winchcascade.report.table_model import Table, TableColumn, items_table, make_table, text_column
from winchcascade.report.typesetting import page_text
from winchcascade.report.wording import SYMBOL, load_words
from winchcascade.tables.check import CellCheck, Check, Outcome, RowKey

VERDICTS = {"ok": "agrees", "miss": "differs", "not_measured": "not measured", "no_run": "no run"}
"""Outcomes of a cell in words."""


def check_report(check: Check, *, command: str = "") -> Report:
    """Make the rows of the report of a check."""
    table = check.table
    sections = (
        section("differences", "Cells that do not agree", *_misses(check)),
        section("cells", "Every cell", _cells(check)),
        section("findings", "Findings", _findings(check)),
        section("provenance", "Provenance", _provenance(check, command)),
    )
    return Report(
        kind="Check against a published table",
        title=table.title or table.name,
        subtitle=" · ".join(part for part in (table.name, table.source) if part),
        tiles=_tiles(check),
        points=_points(check),
        sections=sections,
        banner=banner(check.origins),
    )


def _tiles(check: Check) -> tuple[Tile, ...]:
    counts = Counter(cell.outcome for cell in check.cells)
    names: tuple[tuple[Outcome, str], ...] = (
        ("ok", "cells that agree"),
        ("miss", "cells that differ"),
        ("not_measured", "cells not measured"),
    )
    whole = f"of {len(check.cells)} cells"
    without = f"{counts['no_run']} without a run" if counts["no_run"] else whole
    return tuple(
        Tile(upper(name), "", str(counts[key]), without if key == "not_measured" else whole) for key, name in names
    )


def _points(check: Check) -> tuple[Point, ...]:
    found = sum(len(findings) for findings in check.findings.values())
    return (
        Point("Outcome", f"{upper(check_summary(check))}.", "good" if check.ok else "warn"),
        data_point(check.origins),
        Point("Tolerance", f"{upper(recipe(check))}."),
        *([Point("Logs", f"{found} findings in {len(check.findings)} logs; see Findings.", "warn")] if found else []),
        *(Point("Note", text, "warn") for text in check.notes),
    )


def _misses(check: Check) -> tuple[Note, ...]:
    notes = [Note(page_text(miss_sentence(cell), one_line(cell.log or ""))) for cell in check.misses]
    return tuple(notes) or (Note("All cells agree."),)


def _cells(check: Check) -> Table:
    """Every cell: published, found, difference, tolerance with its parts, verdict."""
    parts = ["rounding", "deviation", "uncertainty", *(["means"] if any(c.means for c in check.cells) else [])]
    heads = {"uncertainty": "2 u"}
    columns: list[TableColumn[CellCheck]] = [
        TableColumn("Row", text=True, of=lambda c: _row_words(c.row)),
        TableColumn("Quantity", text=True, of=lambda c: SYMBOL.get(c.metric, c.metric)),
        TableColumn("Unit", text=True, of=lambda c: "" if c.column.unit == "1" else c.column.unit),
        TableColumn("Published", of=lambda c: _text(c, c.printed, 0)),
        TableColumn("Found", of=partial(_value, "measured", 1)),
        TableColumn("Difference", of=partial(_value, "difference", 1)),
        TableColumn("Allowed", of=partial(_value, "tolerance", 1)),
        TableColumn("Verdict", text=True, of=lambda c: VERDICTS[c.outcome]),
        *(TableColumn(head, of=partial(_value, "missed_by", 1)) for head in ("Beyond by",) if check.misses),
        *(TableColumn(upper(heads.get(part, part)), of=partial(_value, part, 1)) for part in parts),
        TableColumn("Log", text=True, of=lambda c: "" if c.log is None else one_line(Path(c.log).name)),
    ]
    found = items_table(
        "cells", "Published and found values of every cell.", columns, check.cells,
        note="A cell agrees if the difference is not larger than what is allowed: the sum of rounding, deviation and 2 u, "
        "with u the standard uncertainty.",
    )  # fmt: skip
    return found or make_table("cells", "No cell was compared.", columns, [])


def _row_words(row: RowKey) -> str:
    """The row of a published table: its load, or its key."""
    return row.text if row.load is None else load_words(row.load)


def _value(name: str, more: int, cell: CellCheck) -> NumberText | None:
    """A number of a cell with more decimals than are published; None without a measured value."""
    value: float | None = getattr(cell, name)
    if value is None or cell.measured is None:
        return None
    return _text(cell, value, more, sign="+" if name == "difference" else "")


def _text(cell: CellCheck, value: float, more: int, *, sign: str = "") -> NumberText:
    """A number with so many decimals more than are published; a small one that would be 0 with its first digit."""
    text = f"{value:{sign}.{max(cell.column.decimals + more, 0)}f}"
    if value and float(text) == 0.0:
        text = f"{value:{sign}.1g}"
    return NumberText(text.replace("-", MINUS), value)


def _findings(check: Check) -> Table | Note:
    rows: list[tuple[RowKey, str]] = [(row, text) for row, found in check.findings.items() for text in found]
    if not rows:
        return Note("No fault was found in the logs.")
    columns = (text_column("Row"), text_column("What was found in its log"))
    return make_table("findings", "Findings in the logs.", columns, [(_row_words(row), text) for row, text in rows])


def _provenance(check: Check, command: str) -> Table:
    table, factors = check.table, check.factors
    rows = [
        ("Published table", table_place(table.path) or table.name),
        ("SHA-256 of the table", file_digest(table.path)),
        ("Source", table.source),
        ("Logs", ", ".join(dict.fromkeys(cell.log for cell in check.cells if cell.log))),
        (
            "Factors",
            f"rounding {factors.rounding:g}, deviation {factors.deviation:g}, uncertainty {factors.uncertainty:g}",
        ),
    ]
    return provenance_table(rows, command)
