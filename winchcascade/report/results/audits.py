"""What an audit of a published table states: contradictions, faults of columns, claims, windows,
what a rig can attain.
"""

from __future__ import annotations

from winchcascade.core.quantity import load_text
from winchcascade.report.content import (
    Column,
    Measured,
    Note,
    Report,
    Span,
    Tile,
    section,
    table,
)
from winchcascade.report.results.attainable_sections import (
    attainable_summary,
    deviation_words,
    physics_sections,
)
from winchcascade.report.results.common import PRINTED, provenance, table_rows
from winchcascade.report.wording import at_most
from winchcascade.tables.audit import Audit, Contradiction, RecoveredWindow, percent
from winchcascade.tables.claims import ClaimVerdict
from winchcascade.tables.column_laws import ColumnFault, LawUse

VERDICTS = {
    "contradicted": "contradicted",
    "not_checkable": "cannot be verified",
    "confirmed": "confirmed",
}
"""Verdicts on a claim in words, those that need a reader first."""

MAX_MISSING = 2
"""Missing columns of a law that a sentence names; of more none."""

MAX_UNREAD = 12
"""Cells without a number that a sentence names; of more the first ones."""

CONTRADICTED: tuple[Column[Contradiction], ...] = (
    Column("row", lambda c: c.row.name, brief=False),
    Column("cell", lambda c: c.metric, brief=False),
    Column("printed", lambda c: Measured(c.printed.value, PRINTED * c.printed.rounding), brief=False),
    Column(
        "allowed", lambda c: Span(c.allowed.low, c.allowed.high, 0.1 * PRINTED * c.printed.rounding),
        brief=False,
    ),
    Column("unit", lambda c: "" if c.printed.unit == "1" else c.printed.unit, brief=False),
    Column("what contradicts what", lambda c: _contradiction_words(c)),
    Column("line", lambda c: c.printed.line, brief=False),
)  # fmt: skip

FAULTS: tuple[Column[ColumnFault], ...] = (
    Column("fault", lambda f: f.kind, brief=False),
    Column("columns", lambda f: ", ".join(f.columns), brief=False),
    Column("what was found", lambda f: f.sentence),
)

CLAIMS: tuple[Column[ClaimVerdict], ...] = (
    Column("verdict", lambda c: VERDICTS[c.verdict]),
    Column("what the rows give", lambda c: f"{c.sentence} [{c.claim.where}]"),
    Column("claim", lambda c: c.claim.says, brief=False),
)

WINDOWS: tuple[Column[RecoveredWindow], ...] = (
    Column("row", lambda w: load_text(w.load)),
    Column("window", lambda w: None if w.span is None else Span(w.span.low, w.span.high), "s", 4),
)


def audit_report(audit: Audit, *, command: str = "") -> Report:
    """Report of an audit, with the physics of a rig where requested."""
    verdict = Note(audit_summary(audit), "Outcome", "good" if audit.ok else "warn", brief=False)
    claims, physics, count = audit.claims, audit.physics, len(audit.contradictions)
    judged = 0 if physics is None else sum(len(row.cells) for row in physics.rows)
    open_claims = [
        claim for verdict in list(VERDICTS)[:2] for claim in claims if claim.verdict == verdict
    ]
    confirmed = [claim for claim in claims if claim.verdict == "confirmed"]
    none = Note("None.") if audit.evaluated and not count else None
    return Report(
        kind="Audit of a published table",
        title=f"{audit.table.name}: {audit.table.title}",
        subtitle=audit.table.source,
        tiles=[
            Tile("Contradictions", "between cells", f"{count}", f"in {len(audit.table.rows)} rows"),
            Tile("Columns", "with another unit, exchanged heads or rows", f"{len(audit.faults)}"),
            *([Tile("Claims", "contradicted", f"{len(audit.contradicted)}", f"of {len(claims)}")] if claims else []),
            *([] if physics is None else
              [Tile("Efficiencies", "that the rig cannot attain", f"{len(physics.outside)}", f"of {judged}")]),
        ],
        points=[verdict, *_points(audit)],
        sections=[
            section("columns", "Faults of whole columns", table("column-faults", "Faults of "
                                                                                 "columns.", FAULTS, audit.faults)),
            section(
                "contradictions", "Cells that contradict each other",
                table("contradictions", "Cells that cannot all be true, whatever the rounding.", CONTRADICTED,
                      audit.contradictions),
                none,
            ),
            section(
                "claims", "Claims of the text",
                table("claims", "Claims that the rows do not confirm.", CLAIMS, open_claims),
                Note(f"{len(confirmed)} of {len(claims)} claims are confirmed.") if claims else None,
            ),
            *([] if physics is None else physics_sections(physics)),
            section(
                "windows", "Windows recovered from energy over power",
                *(
                    Note(f"{', '.join(map(load_text, one.loads))} can share one of "
                         f"{one.shortest:g} s.", "Window")
                    for one in audit.shared if len(one.loads) > 1
                ),
                table("windows", "Windows that energies and powers allow; none where stages "
                                 "contradict.", WINDOWS,
                      audit.windows),
                folded=True,
            ),
            section(
                "confirmed", "Confirmed claims",
                table("confirmed", "Claims that the rows confirm.", CLAIMS, confirmed, brief=False), folded=True,
            ),
            provenance(table_rows(audit.table), command),
        ],
        verdict=verdict,
    )  # fmt: skip


def _points(audit: Audit) -> list[Note]:
    """What follows, what the rig can attain, what was assumed, compared and not evaluated."""
    audited, physics, known = audit.table, audit.physics, audit.known
    laws = ", ".join(f"{name} = {c.law.text}" for name, c in audited.columns.items() if c.law)
    texts = {
        "Laws": laws,
        "At most 1": ", ".join(name for name, c in audited.columns.items() if c.at_most == 1.0),
        "Tolerance": f"means may differ by {100.0 * audited.tolerance:g} %"
        if audited.tolerance
        else "",
        "Compared": f"{audit.compared} cells in {len(audited.rows)} rows"
        if not audited.by_load
        else "",
        "No numbers": "; ".join(at_most(audited.unread, MAX_UNREAD, "{} more")),
        "Derived": ", ".join(
            f"{use.law} (cells are empty)" for use in audit.uses if use.status == "derived"
        ),
        "Not evaluated": ", ".join(
            _lost(use) for use in audit.uses if use.status == "not_evaluated"
        ),
    }
    notes = [Note(f"{text}.", about) for about, text in texts.items() if text]
    if not audited.by_load:
        return notes
    advice = Note("`--physics` compares the table with the model of a rig.", "Next", brief=False)
    found = []
    if physics is not None:
        metrics = dict.fromkeys(cell.metric for row in physics.rows for cell in row.cells)
        found = [Note(deviation_words(physics, metric), "Physics") for metric in metrics]
        advice = Note(
            "" if physics.ok else "Logs decide between the effects: `winchcascade diagnose`.",
            "Next",
        )
    bounds = (
        f"Means over {known.basis}: an efficiency can differ from the ratio of mean energies by "
        f"{percent(known.ratio)}, "
        f"eta_pto from eta_trans eta_gen by {percent(known.product)}."
    )
    assumed = (
        f"{', '.join(known.assumed)}, as the table does not state them." if known.assumed else ""
    )
    return [advice, *found, Note(bounds, "Bounds"), Note(assumed, "Assumed"), *notes]


def _lost(use: LawUse) -> str:
    """A law that no row could be compared with, and which columns it lacks."""
    return (
        f"{use.law} (no {' and no '.join(use.missing)})"
        if 0 < len(use.missing) <= MAX_MISSING
        else use.law
    )


def _contradiction_words(item: Contradiction) -> str:
    """A contradiction with what would mend its row."""
    changes = ", or ".join(f"{repair.metric} {repair.text}" for repair in item.repairs)
    return (
        f"{item.sentence} A change of one cell makes the row consistent: {changes}."
        if changes
        else item.sentence
    )


def failed_audit(audit: Audit) -> Report:
    """What contradicts itself or the rig alone."""
    texts = [fault.sentence for fault in audit.faults] + [
        item.sentence for item in audit.contradictions
    ]
    texts += [f"Claim contradicted: {claim.sentence}" for claim in audit.contradicted]
    if audit.physics is not None:
        metrics = dict.fromkeys(cell.metric for _, cell in audit.physics.outside)
        texts += [deviation_words(audit.physics, metric) for metric in metrics]
    return Report("Audit", audit_summary(audit), points=[Note(text) for text in texts])


def audit_summary(audit: Audit) -> str:
    """How many contradictions there are."""
    counts = [
        (len(audit.faults), "column fault"),
        (len(audit.contradictions), "contradiction"),
        (len(audit.contradicted), "contradicted claim"),
    ]
    found = [f"{count} {what}{'s' * (count > 1)}" for count, what in counts if count]
    text = f"Found: {', '.join(found)}" if found else "Nothing contradicts itself"
    if not audit.evaluated:
        text = "Nothing was evaluated: the table has no cells that a law or a claim connects"
    return f"{text}." if audit.physics is None else f"{text}; {attainable_summary(audit.physics)}."
