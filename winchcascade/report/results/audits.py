"""What an audit of a published table states: contradictions, faults of columns, claims, windows,
what a rig can attain.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from string import ascii_lowercase
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.quantity import load_text, unit_suffix
from winchcascade.report.content import (
    Column,
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Span,
    Tile,
    section,
    table,
)
from winchcascade.report.figures.style import (
    COLOURS,
    Look,
    draw_intervals,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.glossary import tex, upper
from winchcascade.report.results.common import PRINTED, provenance, table_rows
from winchcascade.report.results.effects import call_all, called
from winchcascade.report.wording import at_most, load_words
from winchcascade.rig.effects.effect import Parameter
from winchcascade.tables.attainable import Ability, AttainableRanges, SuspectResult, Values
from winchcascade.tables.audit import Audit, Contradiction, RecoveredWindow, percent
from winchcascade.tables.claims import ClaimVerdict
from winchcascade.tables.column_laws import ColumnFault, LawUse
from winchcascade.tables.payouts import RAMPS, STARTED, AttainableRow, Cell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

CLOSED_MIN = 0.005
"""An effect that removes less than this share of the excess over the attainable range does
nothing. [1]
"""

PRINTED_LOOK = Look("mech", "-", "o")
"""Look of a printed efficiency."""

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
            *([] if physics is None else _physics(physics)),
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


# ------------------------------------------------------------------------------- physics of a rig
class Judged(NamedTuple):
    """An efficiency beside its attainable range, and its row."""

    row: AttainableRow
    cell: Cell


JUDGED: tuple[Column[Judged], ...] = (
    Column("efficiency", lambda j: j.cell.metric),
    Column("row", lambda j: load_text(j.row.load)),
    Column(
        "line speed", lambda j: Span(j.row.speeds.low, j.row.speeds.high), "m/s", 2, brief=False
    ),
    Column("printed", lambda j: j.cell.printed, decimals=3),
    Column("made", lambda j: "of other cells" if j.cell.derived else ""),
    Column("attainable", lambda j: Span(j.cell.low, j.cell.high), decimals=3),
    Column("beyond", lambda j: 100.0 * j.cell.gap, "points", 1, signed=True),
    Column(
        "verdict",
        lambda j: "outside" if j.cell.outside else "within rounding" if j.cell.gap else "inside",
    ),
)


def attainable_summary(ranges: AttainableRanges) -> str:
    """How many efficiencies the rig cannot attain."""
    judged, outside = sum(len(row.cells) for row in ranges.rows), len(ranges.outside)
    if judged and outside:
        return f"{outside} of {judged} efficiencies cannot be reached"
    return f"all {judged} efficiencies can be reached" if judged else "no row could be judged"


def deviation_words(ranges: AttainableRanges, metric: str) -> str:
    """How far the table deviates from what the rig can attain in one efficiency."""
    judged = [cell for row in ranges.rows for cell in row.cells if cell.metric == metric]
    gaps = sorted((100.0 * cell.gap for cell in judged if cell.outside), key=abs)
    found = [
        f"{len(one)} of {len(judged)} rows {side} what the rig can attain, by "
        f"{_ends([f'{abs(gap):.1f}' for gap in one])} points"
        for side, one in (
            ("above", [gap for gap in gaps if gap > 0]),
            ("below", [gap for gap in gaps if gap < 0]),
        )
        if one
    ]
    return f"{metric}: {'; '.join(found) or f'all {len(judged)} rows can be reached'}."


def _ends(texts: list[str]) -> str:
    """The first and the last of some texts, or the one that they all are."""
    return " to ".join(dict.fromkeys((texts[0], texts[-1])))


def _physics(ranges: AttainableRanges) -> list[Section]:
    """What the rig can attain row by row, and which effects and sets of effects could explain
    what lies beyond.
    """
    metrics = dict.fromkeys(cell.metric for row in ranges.rows for cell in row.cells)
    judged = [
        Judged(row, cell)
        for name in metrics
        for row in ranges.rows
        for cell in row.cells
        if cell.metric == name
    ]
    basis = (
        f"Rig {ranges.rig.name} on payouts that speed up for {100 * min(RAMPS):.0f} to "
        f"{100 * max(RAMPS):.0f} % of the window, "
        f"from 0 or {STARTED:g} m of line, at the speeds of the printed powers; its numbers and "
        f"sensors within one standard "
        "uncertainty."
    )
    return [
        section(
            "physics", "What the rig can attain",
            Note(basis),
            *(Note(f"{upper(text)}.", "Note") for text in ranges.notes),
            *(Note(f"{load_text(item.load)}: {item.reason}.", "Not judged") for item in ranges.not_judged),
            Picture(
                "attainable-range",
                "Printed efficiencies, with what rounding and scatter allow, over the range that the "
                "rig can attain, row by row; full markers: outside.",
                "Points over bars, one panel for each efficiency; the values are in the table.",
                partial(attainable_figure, ranges),
            ),
            table("attainable", "Published efficiencies and what the rig can attain.", JUDGED, judged),
        ),
        *([] if ranges.ok else [_sets(ranges), _effects(ranges)]),
    ]  # fmt: skip


def attainable_figure(ranges: AttainableRanges) -> Figure | None:
    """Draw printed efficiencies, with what rounding and scatter allow, over what the rig can attain
    in each row; None where no row was judged.
    """
    metrics = list(dict.fromkeys(cell.metric for row in ranges.rows for cell in row.cells))
    if not metrics:
        return None
    figure, axes = panel_figure(0.5 + 1.3 * len(metrics), len(metrics), share="x")
    places = {row.load: x for x, row in enumerate(ranges.rows)}
    for ax, letter, metric in zip(axes, ascii_lowercase, metrics, strict=False):
        judged = {
            places[row.load]: cell for row in ranges.rows for cell in row.cells if cell.metric == metric
        }  # fmt: skip
        cells = judged.values()
        low, high = np.array([(cell.low, cell.high) for cell in cells]).T
        ax.bar(list(judged), high - low, 0.6, low, color=COLOURS["gen"], alpha=0.3)
        ends = [(c.printed, c.printed - c.allowed, c.printed + c.allowed) for c in cells]
        draw_intervals(ax, list(judged), ends, PRINTED_LOOK, [cell.outside for cell in cells])
        label_panel(ax, letter, tex(metric), y="Efficiency (1)")
        ax.grid(axis="x", visible=False)
    axes[-1].set_xticks(list(places.values()), [load_words(load) for load in places])
    band = patch_entry("attainable", "gen", alpha=0.3, lw=0)
    printed = line_entry("printed", PRINTED_LOOK.colour, marker=PRINTED_LOOK.mark, ms=4)
    legend_above(figure, [band, printed])
    return figure


class Suspected(NamedTuple):
    """An effect, what it does to an efficiency alone, and the values that the rows need."""

    effect: SuspectResult
    alone: Ability
    needs: str | None


ALONE = {"explains": "explains", "beyond_plausible": "implausible", "no": ""}
"""Whether one value of an effect brings all rows within the attainable range, in words."""

SUSPECTED: tuple[Column[Suspected], ...] = (
    Column("effect", lambda s: called(s.effect.effect), named=True),
    Column("stage", lambda s: s.effect.stage, brief=False),
    Column("efficiency", lambda s: s.alone.metric),
    Column("plausible", lambda s: _plausible(*s.effect.fields), brief=False),
    Column("needs", lambda s: s.needs),
    Column("closes", lambda s: 100.0 * s.alone.closed, "%", 0),
    Column("alone", lambda s: ALONE[s.alone.verdict]),
)


def _plausible(first: Parameter, *more: Parameter) -> str:
    return (
        f"{1 + len(more)} fields"
        if more
        else f"{first.low:.3g} to {first.high:.3g}{unit_suffix(first.unit)}"
    )


def _effects(ranges: AttainableRanges) -> Section:
    """Effects one by one on each efficiency outside the range (the stages, else their product),
    those that help most first.
    """
    outside = {cell.metric for _, cell in ranges.outside}
    wanted = sorted(outside & {"eta_trans", "eta_gen"}, reverse=True) or sorted(outside)
    found = [
        Suspected(suspect, alone, _needed(ranges, alone))
        for metric in wanted
        for suspect in ranges.suspects
        if (alone := suspect.ability(metric)).closed >= CLOSED_MIN
    ]
    found.sort(
        key=lambda s: (wanted.index(s.alone.metric), s.alone.verdict != "explains", -s.alone.closed)
    )
    helping = {one.effect.effect for one in found}
    nothing = call_all(one.effect for one in ranges.suspects if one.effect not in helping)
    legend = (
        "from the row that needs least to the one that needs most, * in some rows no value does; "
        "closes: share of the excess "
        "that a plausible value removes; alone: whether one value, plausible or not, brings all "
        "rows within the range."
    )
    return section(
        "effects", "Effects that could explain it",
        table("effects", "Effects alone on each efficiency.", SUSPECTED, found),
        Note(legend, "Needs"),
        Note(nothing and f"{nothing}.", "No effect"),
        folded=True,
    )  # fmt: skip


def _needed(ranges: AttainableRanges, ability: Ability) -> str | None:
    """The values that the rows need; None where no value does."""
    outside = {row.load for row, cell in ranges.outside if cell.metric == ability.metric}
    values = [
        value
        for row, value in zip(ranges.rows, ability.needed, strict=False)
        if row.load in outside
    ]
    known = sorted((value for value in values if value is not None), key=abs)
    texts = [f"{value:.2g}" if abs(value) < 100.0 else f"{value:.0f}" for value in known]
    return _ends(texts) + "*" * (None in values) if texts else None


def _sets(ranges: AttainableRanges) -> Section:
    """The smallest sets that bring the table within the attainable range, or the one that comes
    closest.
    """
    listed = ranges.sets or ((ranges.closest,) if ranges.closest else ())
    fields = {(s.effect, f.name): f for s in ranges.suspects for f in s.fields}
    columns: list[Column[Values]] = [
        Column("effects and values", lambda values: " with ".join(_valued(values, fields))),
        Column("outside in all", lambda values: 100.0 * values.out_of_reach or None, "points", 1),
        *(_left(metric) for metric in dict.fromkeys(m for one in listed for m in one.left_rms)),
    ]
    none = "No set of few effects brings all within the range at plausible values; this one is closest."
    return section(
        "sets", "Smallest sets of effects within the attainable range",
        None if ranges.sets or not listed else Note(none),
        table("sets", "Sets of effects, best fit first, and the rms that they leave.", columns, listed),
    )  # fmt: skip


def _left(metric: str) -> Column[Values]:
    return Column(f"{metric} left", lambda values: 100.0 * values.left_rms[metric], "points rms", 1)


def _valued(values: Values, fields: dict[tuple[str, str], Parameter]) -> Iterable[str]:
    """Effects of a set with their values."""
    for effect, given in values.fields.items():
        texts = []
        for name, value in given.items():
            field = fields[effect, name]
            stops = [
                f" (at its bound {end:g})"
                for end in (field.low, field.high)
                if value == end != field.absent
            ]
            texts.append(f"{name} {value:.3g}{unit_suffix(field.unit)}{''.join(stops)}")
        yield f"{effect} {', '.join(texts)}"
