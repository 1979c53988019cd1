"""The report of an audit: every finding with its row, of a table by load, with the physics of a rig, or of operating points."""

from __future__ import annotations

from functools import partial

from winchcascade.core.published_table import PublishedTable
from winchcascade.core.table_toml import table_place
from winchcascade.report import audit_text as words
from winchcascade.report.audit_text import law_sentences, point_summary, unread_sentences
from winchcascade.report.digits import NumberText, number, upper
from winchcascade.report.report_model import (
    Note,
    Point,
    Report,
    Section,
    Table,
    TableColumn,
    Tone,
    file_digest,
    items_table,
    provenance_table,
    section,
)
from winchcascade.report.wording import SYMBOL, load_words, page_text
from winchcascade.tables.attainable import AttainableRanges, SuspectResult
from winchcascade.tables.attainable_row import AttainableRow, Cell
from winchcascade.tables.audit import Audit, Contradiction, RecoveredWindow
from winchcascade.tables.claims import ClaimVerdict
from winchcascade.tables.point_audit import BrokenLaw, ColumnFault, PointAudit
from winchcascade.tables.point_table import PointTable

VERDICTS = {"confirmed": "confirmed", "contradicted": "contradicted", "not_checkable": "cannot be verified"}
"""Verdicts on a claim in words."""


def audit_report(audit: Audit, *, command: str = "") -> Report:
    """Make the rows of the report of an audit of a table by load."""
    shared = map(_note, words.shared_windows(audit))
    sections = (
        section("contradictions", "Cells that contradict each other", _contradictions(audit) or Note("None.")),
        section("claims", "Claims of the text", _claims(audit)),
        section("windows", "Windows recovered from energy over power", _windows(audit), *shared),
        *(() if audit.physics is None else _physics(audit.physics)),
        section("provenance", "Provenance", _provenance(audit.table, command)),
    )
    summary = words.audit_summary(audit)
    clean = not audit.contradictions and not audit.contradicted
    points = [
        Point("Outcome", f"{upper(summary)}.", "good" if clean else "warn"),
        *(_point(text) for text in words.bound_sentences(audit)),
    ]
    if audit.physics is not None:
        points.insert(
            1,
            Point("Physics", f"{upper(page_text(words.attainable_summary(audit.physics)))}.", _tone(audit.physics.ok)),
        )
    return _report(audit.table, tuple(points), sections)


def point_audit_report(audit: PointAudit, *, command: str = "") -> Report:
    """Make the rows of the report of an audit of a table of operating points."""
    sections = (
        section("columns", "Faults of whole columns", _faults(audit) or Note("None.")),
        section("contradictions", "Cells that contradict others of their row", _broken(audit) or Note("None.")),
        section("provenance", "Provenance", _provenance(audit.table, command)),
    )
    points = (
        Point("Outcome", f"{upper(point_summary(audit))}.", _tone(audit.ok)),
        Point("Compared", f"{audit.laws} cells in {len(audit.table.rows)} rows."),
        *(_point(text) for text in law_sentences(audit)),
        *(_point(text) for text in unread_sentences(audit)),
    )
    return _report(audit.table, points, sections)


def _report(table: PublishedTable | PointTable, points: tuple[Point, ...], sections: tuple[Section, ...]) -> Report:
    return Report(
        kind="Audit of a published table",
        title=table.title or table.name,
        subtitle=" · ".join(part for part in (table.name, table.source) if part),
        tiles=(),
        points=points,
        sections=tuple(s for s in sections if s.blocks),
    )


def _tone(ok: bool) -> Tone:
    return "good" if ok else "warn"


def _note(text: str, about: str = "") -> Note:
    return Note(f"{upper(page_text(text))}.", about)


def _point(sentence: str) -> Point:
    """A sentence of the terminal that names before a colon what it is about."""
    about, _, text = page_text(sentence).partition(": ")
    return Point(upper(about), f"{upper(text or about)}.")


# ------------------------------------------------------------------------------------------------------ a table by load
def _contradictions(audit: Audit) -> Table | None:
    columns: list[TableColumn[Contradiction]] = [
        TableColumn("Row", text=True, of=lambda c: "total" if c.load is None else load_words(c.load)),
        TableColumn("Line no.", of=lambda c: None if c.line is None else NumberText(str(c.line), c.line)),
        TableColumn("Cell", text=True, of=lambda c: SYMBOL.get(c.metric, c.metric)),
        TableColumn("Published", of=lambda c: _short(c.printed)),
        TableColumn("Allowed", of=lambda c: _span(c.allowed.low, c.allowed.high)),
        TableColumn("Beyond by", of=lambda c: _short(c.missed_by)),
        TableColumn("Unit", text=True, of=lambda c: "" if c.unit == "1" else c.unit),
        TableColumn("What contradicts what", text=True, of=lambda c: page_text(c.sentence)),
        TableColumn("Remedy", text=True, of=lambda c: page_text(words.remedy(c)) if c.kind == "row" else ""),
    ]
    caption = "Cells that cannot all be true, whatever the rounding and the scatter of the cycles."
    return items_table("contradictions", caption, columns, audit.contradictions)


def _claims(audit: Audit) -> Table | None:
    columns: list[TableColumn[ClaimVerdict]] = [
        TableColumn("Where", text=True, of=lambda c: page_text(c.claim.where)),
        TableColumn("Claim", text=True, of=lambda c: page_text(c.claim.says)),
        TableColumn("Verdict", text=True, of=lambda c: VERDICTS[c.verdict]),
        TableColumn("What the rows give", text=True, of=lambda c: page_text(c.sentence)),
    ]
    ranked = sorted(audit.claims, key=lambda claim: claim.verdict != "contradicted")
    return items_table("claims", "Claims of the text about the table, contradicted ones first.", columns, ranked)


def _windows(audit: Audit) -> Table | None:
    columns: list[TableColumn[RecoveredWindow]] = [
        TableColumn("Row", text=True, of=lambda w: load_words(w.load)),
        TableColumn("Window", "s", 4, of=lambda w: None if w.span is None else 0.5 * (w.span.low + w.span.high)),
        TableColumn("From", "s", 4, of=lambda w: None if w.span is None else w.span.low),
        TableColumn("To", "s", 4, of=lambda w: None if w.span is None else w.span.high),
    ]
    caption = "Windows that the energies and powers of each row allow; none where the stages contradict each other."
    return items_table("windows", caption, columns, audit.windows)


def _short(value: float) -> NumberText:
    return NumberText(number(value, 4) if abs(value) < 10.0 else f"{value:.6g}", value)


def _span(low: float, high: float) -> NumberText:
    return NumberText(f"{_short(low)} to {_short(high)}", low, high)


# ------------------------------------------------------------------------------------------------------ physics of a rig
def _physics(ranges: AttainableRanges) -> tuple[Section, ...]:
    """What the rig can attain row by row, and which effects could explain what lies beyond."""
    metrics = list(dict.fromkeys(cell.metric for row in ranges.rows for cell in row.cells))
    verdicts = [text for metric in metrics for part in words.verdict_sentences(ranges, metric) for text in part]
    sets = [words.values_text(ranges, values) for values in ranges.explanation.sets]
    return (
        section(
            "physics", "What the rig can attain",
            _note(words.basis(ranges)),
            *(Note(page_text(text), "Note") for text in ranges.notes),
            _ranges(ranges, metrics),
            *(Note(f"{load_words(item.load)}: {page_text(item.reason)}", "Not judged") for item in ranges.not_judged),
            *map(_note, verdicts),
        ),
        section(
            "effects", "Effects that could explain it",
            None if ranges.ok else _effects(ranges),
            *(_note(text, "All within reach") for text in sets),
        ),
    )  # fmt: skip


def _ranges(ranges: AttainableRanges, metrics: list[str]) -> Table | None:
    columns: list[TableColumn[AttainableRow]] = [
        TableColumn("Row", text=True, of=lambda r: load_words(r.load)),
        TableColumn("Line speed", "m/s", of=_speeds),
    ]
    for metric in metrics:
        columns += [
            TableColumn(SYMBOL[metric], "", of=partial(_of_cell, metric, "printed")),
            TableColumn("Attainable", "", of=partial(_of_cell, metric, "range")),
            TableColumn("Beyond", "points", of=partial(_of_cell, metric, "beyond")),
            TableColumn("Verdict", text=True, of=partial(_of_cell, metric, "verdict")),
        ]
    caption = "Published efficiencies beside what the rig can attain."
    return items_table("attainable", caption, columns, ranges.rows)


def _speeds(row: AttainableRow) -> NumberText:
    low, high = row.speeds.low, row.speeds.high
    return NumberText(f"{low:.2f} to {high:.2f}", low, high)


def _of_cell(metric: str, what: str, row: AttainableRow) -> str | None:
    """One entry about an efficiency of a row; None where the row does not have it."""
    cell: Cell | None = next((c for c in row.cells if c.metric == metric), None)
    if cell is None:
        return None if what != "verdict" else ""
    if what == "printed":
        return number(cell.printed, 3)
    if what == "range":
        return NumberText(f"{number(cell.low, 3)} to {number(cell.high, 3)}", cell.low, cell.high)
    if what == "beyond":
        return number(100.0 * cell.gap, 1)
    return "out of reach" if cell.outside else "within reach" if cell.gap == 0.0 else "within rounding"


def _effects(ranges: AttainableRanges) -> Table | None:
    columns: list[TableColumn[SuspectResult]] = [
        TableColumn("Effect", text=True, of=lambda s: s.effect),
        TableColumn("Stage", text=True, of=lambda s: s.stage),
    ]
    for metric in words.wanted(ranges):
        columns += [
            TableColumn(f"{SYMBOL[metric]} needs", text=True, of=partial(_needs, ranges, metric)),
            TableColumn("Closes", "%", of=partial(_closes, metric)),
        ]
    caption = "Effects alone: the values that the rows need, and the share that a plausible value takes away."
    note = "Needs: from the row that needs least to the one that needs most; * in some rows no value does."
    return items_table("effects", caption, columns, ranges.explanation.suspects, note=note)


def _needs(ranges: AttainableRanges, metric: str, suspect: SuspectResult) -> str:
    text = words.needed_words(ranges, suspect.ability(metric))
    return "–" if text == "-" else page_text(text)


def _closes(metric: str, suspect: SuspectResult) -> NumberText:
    return number(100.0 * suspect.ability(metric).closed, 0)


# --------------------------------------------------------------------------------------------------- operating points
def _faults(audit: PointAudit) -> Table | None:
    columns: list[TableColumn[ColumnFault]] = [
        TableColumn("Columns", text=True, of=lambda f: ", ".join(audit.table.columns[c].head for c in f.columns)),
        TableColumn("Fault", text=True, of=lambda f: f.kind.replace("_", " ")),
        TableColumn("Contradictions before", of=lambda f: f.broken_before),
        TableColumn("after", of=lambda f: f.broken_after),
        TableColumn("What was found", text=True, of=lambda f: f.sentence),
    ]
    return items_table("column-faults", "Faults of whole columns.", columns, audit.faults)


def _broken(audit: PointAudit) -> Table | None:
    table = audit.table

    def key(item: BrokenLaw) -> str:
        cells = table.rows[item.row]
        return ", ".join(f"{name} {cells[name].text}" for name in table.key if name in cells)

    columns: list[TableColumn[BrokenLaw]] = [
        TableColumn("Row", text=True, of=lambda b: str(b.row + 1)),
        TableColumn("Key", text=True, of=key),
        TableColumn("Column", text=True, of=lambda b: table.columns[b.column].head),
        TableColumn("Published", of=lambda b: _short(b.printed)),
        TableColumn("Allowed", of=lambda b: _span(b.allowed.low, b.allowed.high)),
        TableColumn("Unit", text=True, of=lambda b: table.columns[b.column].unit),
        TableColumn("What contradicts what", text=True, of=lambda b: b.sentence),
    ]
    return items_table("contradictions", "Cells that the others of their row contradict.", columns, audit.broken)


def _provenance(table: PublishedTable | PointTable, command: str) -> Table:
    rows = [
        ("Published table", table_place(table.path) or table.name),
        ("SHA-256 of the table", file_digest(table.path)),
        ("Source", table.source),
    ]
    return provenance_table(rows, command)
