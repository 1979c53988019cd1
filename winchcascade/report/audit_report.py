"""The report of an audit: every finding with its row, of a table by load, with the physics of a rig, or of operating points."""

from __future__ import annotations

from winchcascade.core.published_table import PublishedTable
from winchcascade.report import audit_text as words
from winchcascade.report import sheet as content
from winchcascade.report.audit_text import law_sentences, point_summary, unread_sentences
from winchcascade.report.digits import NumberText, number, upper
from winchcascade.report.sheet import TableColumn
from winchcascade.report.wording import SYMBOL, load_words, page_text
from winchcascade.tables.attainable import AttainableRanges, SuspectResult
from winchcascade.tables.attainable_row import AttainableRow, Cell
from winchcascade.tables.audit import Audit, Contradiction, RecoveredWindow
from winchcascade.tables.claims import ClaimVerdict
from winchcascade.tables.point_audit import BrokenLaw, ColumnFault, PointAudit
from winchcascade.tables.point_table import PointTable

VERDICTS = {"confirmed": "confirmed", "contradicted": "contradicted", "not_checkable": "cannot be verified"}
"""Verdicts on a claim in words."""


def audit_report(audit: Audit, *, command: str = "") -> content.Report:
    """Make the rows of the report of an audit of a table by load."""
    physics = audit.physics
    return _report(
        audit.table,
        (
            content.Point(
                "Outcome",
                f"{upper(words.audit_summary(audit))}.",
                _tone(audit.consistent),
            ),
            *(
                []
                if physics is None
                else [
                    content.Point(
                        "Physics", f"{upper(page_text(words.attainable_summary(physics)))}.", _tone(physics.ok)
                    )
                ]
            ),
            *map(_point, (*words.bound_sentences(audit), *words.use_sentences(audit.uses))),
        ),
        (
            content.section(
                "contradictions",
                "Cells that contradict each other",
                _CONTRADICTIONS.of(audit.contradictions) or content.Note("None."),
            ),
            content.section(
                "claims",
                "Claims of the text",
                _CLAIMS.of(sorted(audit.claims, key=lambda claim: claim.verdict != "contradicted")),
            ),
            content.section(
                "windows",
                "Windows recovered from energy over power",
                _WINDOWS.of(audit.windows),
                *map(_note, words.shared_windows(audit)),
            ),
            *(() if physics is None else _physics(physics)),
        ),
        command,
    )


def point_audit_report(audit: PointAudit, *, command: str = "") -> content.Report:
    """Make the rows of the report of an audit of a table of operating points."""
    return _report(
        audit.table,
        (
            content.Point("Outcome", f"{upper(point_summary(audit))}.", _tone(audit.ok)),
            content.Point("Compared", f"{audit.laws} cells in {len(audit.table.rows)} rows."),
            *map(_point, (*law_sentences(audit), *words.use_sentences(audit.uses), *unread_sentences(audit))),
        ),
        (
            content.section("columns", "Faults of whole columns", _faults(audit) or content.Note("None.")),
            content.section(
                "contradictions", "Cells that contradict others of their row", _broken(audit) or content.Note("None.")
            ),
        ),
        command,
    )


def _report(
    table: PublishedTable | PointTable,
    points: tuple[content.Point, ...],
    sections: tuple[content.Section, ...],
    command: str,
) -> content.Report:
    return content.Report(
        kind="Audit of a published table",
        title=table.title or table.name,
        subtitle=" · ".join(part for part in (table.name, table.source) if part),
        tiles=(),
        points=points,
        sections=content.filled(*sections, content.provenance_section(words.table_rows(table), command)),
    )


def _tone(ok: bool) -> content.Tone:
    return "good" if ok else "warn"


def _note(text: str, about: str = "") -> content.Note:
    return content.Note(f"{upper(page_text(text))}.", about)


def _point(sentence: str) -> content.Point:
    """A sentence of the terminal that names before a colon what it is about."""
    about, _, text = page_text(sentence).partition(": ")
    return content.Point(upper(about), f"{upper(text or about)}.")


# ------------------------------------------------------------------------------------------------------ a table by load
_CONTRADICTIONS = content.ItemTable[Contradiction](
    "contradictions",
    "Cells that cannot all be true, whatever the rounding and the scatter of the cycles.",
    [
        TableColumn("Row", text=True, of=lambda c: "total" if c.load is None else load_words(c.load)),
        TableColumn("Line no.", of=lambda c: None if c.line is None else NumberText(str(c.line), c.line)),
        TableColumn("Cell", text=True, of=lambda c: SYMBOL.get(c.metric, c.metric)),
        TableColumn("Published", of=lambda c: _short(c.printed)),
        TableColumn("Allowed", of=lambda c: _span(c.allowed.low, c.allowed.high)),
        TableColumn("Beyond by", of=lambda c: _short(c.missed_by)),
        TableColumn("Unit", text=True, of=lambda c: "" if c.unit == "1" else c.unit),
        TableColumn("What contradicts what", text=True, of=lambda c: page_text(c.sentence)),
        TableColumn("Remedy", text=True, of=lambda c: page_text(words.remedy(c)) if c.kind == "row" else ""),
    ],
)

_CLAIMS = content.ItemTable[ClaimVerdict](
    "claims",
    "Claims of the text about the table, contradicted ones first.",
    [
        TableColumn("Where", text=True, of=lambda c: page_text(c.claim.where)),
        TableColumn("Claim", text=True, of=lambda c: page_text(c.claim.says)),
        TableColumn("Verdict", text=True, of=lambda c: VERDICTS[c.verdict]),
        TableColumn("What the rows give", text=True, of=lambda c: page_text(c.sentence)),
    ],
)

_WINDOWS = content.ItemTable[RecoveredWindow](
    "windows",
    "Windows that the energies and powers of each row allow; none where the stages contradict each other.",
    [
        TableColumn("Row", text=True, of=lambda w: load_words(w.load)),
        TableColumn("Window", "s", 4, of=lambda w: None if w.span is None else 0.5 * (w.span.low + w.span.high)),
        TableColumn("From", "s", 4, of=lambda w: None if w.span is None else w.span.low),
        TableColumn("To", "s", 4, of=lambda w: None if w.span is None else w.span.high),
    ],
)


def _short(value: float) -> NumberText:
    return NumberText(number(value, 4) if abs(value) < 10.0 else f"{value:.6g}", value)


def _span(low: float, high: float) -> NumberText:
    return NumberText(f"{_short(low)} to {_short(high)}", low, high)


# ------------------------------------------------------------------------------------------------------ physics of a rig
def _physics(ranges: AttainableRanges) -> tuple[content.Section, ...]:
    """What the rig can attain row by row, and which effects could explain what lies beyond."""
    metrics = list(dict.fromkeys(cell.metric for row in ranges.rows for cell in row.cells))
    verdicts = [text for metric in metrics for part in words.verdict_sentences(ranges, metric) for text in part]
    sets = [words.values_text(ranges, values) for values in ranges.explanation.sets]
    return (
        content.section(
            "physics", "What the rig can attain",
            _note(words.basis(ranges)),
            *(content.Note(page_text(text), "Note") for text in ranges.notes),
            content.ItemTable[AttainableRow](
        "attainable",
        "Published efficiencies beside what the rig can attain.",
        [
            TableColumn("Row", text=True, of=lambda r: load_words(r.load)),
            TableColumn("Line speed", "m/s", of=lambda r: _fixed_span(r.speeds.low, r.speeds.high, 2)),
            *(column for metric in metrics for column in _range_columns(metric)),
        ],
    ).of(ranges.rows),
            *(content.Note(f"{load_words(item.load)}: {page_text(item.reason)}", "Not judged") for item in ranges.not_judged),
            *map(_note, verdicts),
        ),
        content.section(
            "effects", "Effects that could explain it",
            None if ranges.ok else _effects(ranges),
            *(_note(text, "All within the attainable range") for text in sets),
        ),
    )  # fmt: skip


def _range_columns(metric: str) -> list[TableColumn[AttainableRow]]:
    """What is stated of an efficiency of a row; nothing where the row does not have it."""

    def cell(row: AttainableRow) -> Cell | None:
        return next((c for c in row.cells if c.metric == metric), None)

    return [
        TableColumn(SYMBOL[metric], of=lambda r: None if (c := cell(r)) is None else number(c.printed, 3)),
        TableColumn("Attainable", of=lambda r: None if (c := cell(r)) is None else _fixed_span(c.low, c.high, 3)),
        TableColumn("Beyond", "points", of=lambda r: None if (c := cell(r)) is None else number(100.0 * c.gap, 1)),
        TableColumn(
            "Verdict",
            text=True,
            of=lambda r: (
                ""
                if (c := cell(r)) is None
                else ("outside" if c.outside else "inside" if c.gap == 0.0 else "within rounding")
            ),
        ),
    ]


def _fixed_span(low: float, high: float, decimals: int) -> NumberText:
    return NumberText(f"{number(low, decimals)} to {number(high, decimals)}", low, high)


def _effects(ranges: AttainableRanges) -> content.Table | None:
    return content.ItemTable[SuspectResult](
        "effects",
        "Effects alone: the values that the rows need, and the share that a plausible value takes away.",
        [
            TableColumn("Effect", text=True, of=lambda s: s.effect),
            TableColumn("Stage", text=True, of=lambda s: s.stage),
            *(column for metric in words.wanted(ranges) for column in _effect_columns(ranges, metric)),
        ],
        note="Needs: from the row that needs least to the one that needs most; * in some rows no value does.",
    ).of(ranges.explanation.suspects)


def _effect_columns(ranges: AttainableRanges, metric: str) -> list[TableColumn[SuspectResult]]:
    """What value of an effect brings an efficiency within the attainable range, and how much a plausible value contributes."""

    def needs(suspect: SuspectResult) -> str:
        text = words.needed_words(ranges, suspect.ability(metric))
        return "–" if text == "-" else page_text(text)

    return [
        TableColumn(f"{SYMBOL[metric]} needs", text=True, of=needs),
        TableColumn("Closes", "%", of=lambda s: number(100.0 * s.ability(metric).closed, 0)),
    ]


# --------------------------------------------------------------------------------------------------- operating points
def _faults(audit: PointAudit) -> content.Table | None:
    return content.ItemTable[ColumnFault](
        "column-faults",
        "Faults of whole columns.",
        [
            TableColumn("Columns", text=True, of=lambda f: ", ".join(audit.table.columns[c].head for c in f.columns)),
            TableColumn("Fault", text=True, of=lambda f: f.kind.replace("_", " ")),
            TableColumn("Contradictions before", of=lambda f: f.broken_before),
            TableColumn("after", of=lambda f: f.broken_after),
            TableColumn("What was found", text=True, of=lambda f: f.sentence),
        ],
    ).of(audit.faults)


def _broken(audit: PointAudit) -> content.Table | None:
    table = audit.table

    def key(item: BrokenLaw) -> str:
        cells = table.rows[item.row]
        return ", ".join(f"{name} {cells[name].text}" for name in table.key if name in cells)

    return content.ItemTable[BrokenLaw](
        "contradictions",
        "Cells that the others of their row contradict.",
        [
            TableColumn("Row", text=True, of=lambda b: str(b.row + 1)),
            TableColumn("Key", text=True, of=key),
            TableColumn("Column", text=True, of=lambda b: table.columns[b.column].head),
            TableColumn("Published", of=lambda b: _short(b.printed)),
            TableColumn("Allowed", of=lambda b: _span(b.allowed.low, b.allowed.high)),
            TableColumn("Unit", text=True, of=lambda b: table.columns[b.column].unit),
            TableColumn("What contradicts what", text=True, of=lambda b: b.sentence),
        ],
    ).of(audit.broken)
