"""An audit of a published table against itself and against a rig, or of operating points: as text and as records for JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from winchcascade.core.published_table import PublishedTable, Span, load_text, unit_suffix
from winchcascade.core.table_toml import table_place
from winchcascade.core.version import __version__
from winchcascade.report.screen import toned
from winchcascade.report.sheet import file_digest
from winchcascade.report.text_table import headed, indented, joined, paragraphs, table_lines, wrapped
from winchcascade.rig.effects.effect import Field
from winchcascade.tables.attainable import Ability, AttainableRanges
from winchcascade.tables.attainable_row import RAMPS, STARTED, AttainableRow
from winchcascade.tables.audit import Audit, Contradiction, percent
from winchcascade.tables.claims import ClaimVerdict
from winchcascade.tables.effect_search import Values
from winchcascade.tables.point_table import PointTable

if TYPE_CHECKING:
    from winchcascade.tables.point_audit import LawUse, PointAudit


AUDIT_SCHEMA = "winchcascade/audit/1"
_VERDICTS = {"contradicted": "CONTRADICTED", "not_checkable": "cannot be verified"}


def title_lines(table: PublishedTable | PointTable) -> list[str]:
    """Name, title and source of a table."""
    return wrapped(f"{table.name}: {table.title}") + wrapped(f"source: {table.source}")


def table_record(table: PublishedTable | PointTable) -> dict[str, str]:
    """Which table it is, as records have it."""
    return {"name": table.name, "title": table.title, "source": table.source, "path": table.path}


def table_rows(table: PublishedTable | PointTable) -> list[tuple[str, str]]:
    """Which table it is, as the provenance of a report has it."""
    return [
        ("Published table", table_place(table.path) or table.name),
        ("SHA-256 of the table", file_digest(table.path)),
        ("Source", table.source),
    ]


def load_record(load: float) -> dict[str, float | bool]:
    """A load as records have it: JSON has null ohms for an open circuit."""
    return {"load_ohm": load, "open_circuit": math.isinf(load)}


def audit_text(audit: Audit) -> str:
    """Contradictions of a table, the verdicts on its claims and the windows it does not print."""
    cells, claims = len(audit.contradictions), len(audit.contradicted)
    ranked = sorted(audit.claims, key=lambda claim: claim.verdict != "contradicted")
    confirmed = sum(claim.verdict == "confirmed" for claim in audit.claims)
    text = joined(
        [
            *title_lines(audit.table),
            *paragraphs([*bound_sentences(audit), *use_sentences(audit.uses)]),
            "",
            *wrapped(f"cells that contradict each other: {cells or 'none'}"),
            *(
                line
                for item in audit.contradictions
                for text, indent in ((item.sentence, "  "), (remedy(item) if item.kind == "row" else "", "    "))
                for line in wrapped(text, indent)
            ),
            *(
                ["", *wrapped(f"claims of the text: {len(audit.claims)}, contradicted: {claims or 'none'}")]
                if audit.claims
                else []
            ),
            *(
                line
                for claim in ranked
                if claim.verdict in _VERDICTS
                for line in headed(_claim_lines(claim), _VERDICTS["contradicted"], "contradiction")
            ),
            *(indented(f"confirmed: {confirmed}, each in the JSON") if confirmed else []),
            *(["", "windows recovered from energy over power:"] if audit.windows else []),
            *(paragraphs(window_sentences(audit), "  ") if audit.windows else []),
            "",
            _summary(audit_summary(audit), audit.consistent),
        ]
    )
    return text if audit.physics is None else text + attainable_text(audit.physics)


def audit_summary(audit: Audit) -> str:
    """How many contradictions there are."""
    cells, claims = len(audit.contradictions), len(audit.contradicted)
    found = f"found: {cells} contradiction{'s'[: cells != 1]} between cells, {claims} contradicted claim{'s'[: claims != 1]}"
    return found if cells or claims else "nothing contradicts itself" if audit.evaluated else NOTHING_EVALUATED


NOTHING_EVALUATED = "nothing was evaluated: the table has no cells that a law or a claim connects"
"""Summary of an audit that cannot state that a table is consistent."""


_MAX_MISSING = 2
"""Missing columns of a law that the text names; the JSON has all."""


def use_sentences(uses: Sequence[LawUse]) -> list[str]:
    """Which laws no row could be compared with, for lack of which columns, and which gave cells that the table lacks."""
    lost = [
        f"{use.law} (no {' and no '.join(use.missing)})" if 0 < len(use.missing) <= _MAX_MISSING else use.law
        for use in uses
        if use.status == "not_evaluated"
    ]
    derived = [use.law for use in uses if use.status == "derived"]
    heads = (("derived, as its cells are empty: ", derived), ("not evaluated: ", lost))
    return [f"{head}{', '.join(laws)}" for head, laws in heads if laws]


def use_records(uses: Sequence[LawUse]) -> list[dict[str, Any]]:
    """In how many rows each law was evaluated, as records have it."""
    return [
        {"law": use.law, "status": use.status, "rows_evaluated": use.rows, "missing": [*use.missing]} for use in uses
    ]


def bound_sentences(audit: Audit) -> list[str]:
    """How far efficiencies may differ from ratios of means, and what is assumed for that."""
    known = audit.known
    bounds = (
        f"bounds: means over {known.basis}: an efficiency can differ from the ratio of mean energies by "
        f"{percent(known.bounds.ratio)}, eta_pto from eta_trans eta_gen by {percent(known.bounds.product)}"
    )
    assumed = f"assumed, as the table does not say: {', '.join(known.assumed)}"
    return [bounds, assumed] if known.assumed else [bounds]


def _summary(text: str, ok: bool) -> str:
    return toned(text, "good" if ok else "contradiction")


def _claim_lines(claim: ClaimVerdict) -> list[str]:
    return indented(f"{_VERDICTS[claim.verdict]}: {claim.sentence} [{claim.claim.where}]")


def contradictions_text(audit: Audit) -> str:
    """What contradicts itself alone: cells, then claims."""
    lines = paragraphs((item.sentence for item in audit.contradictions), "  ")
    lines += [line for claim in audit.contradicted for line in _claim_lines(claim)]
    lines += [] if audit.evaluated else wrapped(NOTHING_EVALUATED)
    if audit.physics is not None:
        metrics = dict.fromkeys(cell.metric for _, cell in audit.physics.outside)
        lines += [line for metric in metrics for line in _verdict(audit.physics, metric)]
    return joined(lines)


def audit_record(audit: Audit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/audit/1`; JSON has null for the open end of an interval."""
    known = audit.known
    record = {
        "schema": AUDIT_SCHEMA,
        "version": __version__,
        "table": table_record(audit.table),
        "ok": audit.ok,
        "evaluated": audit.evaluated,
        "laws": use_records(audit.uses),
        "bounds": {
            "cycles": known.cycles,
            "deviation_energy": known.energy,
            "deviation_eta": known.eta,
            "ratio": known.bounds.ratio,
            "product": known.bounds.product,
            "assumed": known.assumed,
        },
        "contradictions": [
            {
                "kind": item.kind,
                **({} if item.load is None else load_record(item.load)),
                "cells": item.cells,
                "metric": item.metric,
                "printed": item.printed,
                "unit": item.unit,
                "allowed": _span_record(item.allowed),
                "missed_by": item.missed_by,
                "sentence": item.sentence,
                "repairs": [{"metric": r.metric, "low": r.low, "high": r.high} for r in item.repairs],
                "line": item.line,
            }
            for item in audit.contradictions
        ],
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
    return record if audit.physics is None else record | {"physics": attainable_record(audit.physics)}


def remedy(item: Contradiction) -> str:
    """Which single cell would mend a row."""
    changes = [f"{repair.metric} {repair.text}" for repair in item.repairs]
    if len(changes) == 1:
        return f"Only one cell's change makes the row consistent: {changes[0]}."
    if changes:
        return f"A change of one cell makes the row consistent: {', or '.join(changes)}."
    return "No change of a single cell makes this row consistent."


def window_sentences(audit: Audit) -> list[str]:
    """The windows that follow from energies and powers, row by row, and which rows can share one."""
    return [f"{load_text(w.load)}: {_window_words(w.span)}" for w in audit.windows] + shared_windows(audit)


def _window_words(span: Span | None) -> str:
    if span is None:
        return "none; the stages contradict each other or leave it open"
    middle, half = 0.5 * (span.low + span.high), 0.5 * (span.high - span.low)
    return f"{span.low:.4f} to {span.high:.4f} s ({middle:.4f} s +- {percent(half / middle)})"


def shared_windows(audit: Audit) -> list[str]:
    """Which rows can share one window."""
    found = [
        f"{', '.join(map(load_text, shared.loads))} can share one window: {shared.span.low:.4f} to {shared.span.high:.4f} s, "
        f"such as {shared.shortest:g} s"
        for shared in audit.shared
        if len(shared.loads) > 1
    ]
    return found + ([f"no fewer than {len(audit.shared)} windows fit all rows"] if len(audit.shared) > 1 else [])


def _span_record(span: Span | None) -> tuple[float, float] | None:
    return None if span is None else (span.low, span.high)


# ------------------------------------------------------------------------------------------- the table against a rig
_WORTH, _NOTHING = 0.2, 0.005
"""An effect that removes less than this share of the excess over the attainable range is not shown in detail, or is listed
as one that does nothing. [1]"""

_SIZES = {1: "one effect", 2: "pairs", 3: "sets of three"}


def attainable_text(ranges: AttainableRanges) -> str:
    """What can be reached row by row, how far the table lies outside, and which effects could be why."""
    cells = [cell for row in ranges.rows for cell in row.cells]
    metrics = list(dict.fromkeys(cell.metric for cell in cells))
    notes = [*(f"note: {note}" for note in ranges.notes)]
    notes += [f"not judged: {load_text(item.load)}: {item.reason}" for item in ranges.not_judged]
    lines = ["", *paragraphs([basis(ranges), *notes])]
    if ranges.rows:
        head = ["ohm", "m/s", *(text for metric in metrics for text in (f" {metric}", "range", "past"))]
        points = _range([100.0 * cell.allowed for cell in cells], ".1f")
        lines += ["", *_columns([head, *(_row(row, metrics) for row in ranges.rows)], ("m/s", "range", *metrics[:1]))]
        lines += indented(
            "past: percentage points beyond the nearer end of the range; in brackets where rounding and repeatability "
            f"({points} points) bridge it"
        )
    lines += [line for metric in metrics for line in ("", *_verdict(ranges, metric))]
    lines += [] if ranges.ok else [*_neither(ranges), *_details(ranges), *_sets(ranges)]
    return joined([*lines, "", _summary(f"physics: {attainable_summary(ranges)}", ranges.ok)])


def attainable_summary(ranges: AttainableRanges) -> str:
    """How many efficiencies the rig cannot reach."""
    judged, outside = sum(len(row.cells) for row in ranges.rows), len(ranges.outside)
    if judged and not ranges.ok:
        return f"{outside} of {judged} efficiencies cannot be reached"
    return f"all {judged} efficiencies can be reached" if judged else "no row could be judged"


def basis(ranges: AttainableRanges) -> str:
    """On which payouts and tolerances the attainable ranges are computed."""
    shortest, longest = 100 * min(RAMPS), 100 * max(RAMPS)
    return (
        f"physics: what rig {ranges.rig.name} can reach on payouts that speed up for {shortest:.0f} to {longest:.0f} % of the "
        f"window, evenly or smoothly, from 0 or {STARTED:g} m of line, at the speeds that the printed powers imply; its "
        "numbers and sensors within one standard uncertainty"
    )


def _columns(rows: Sequence[Sequence[str]], omit: Sequence[str]) -> list[str]:
    return table_lines(rows, close=range(len(rows[0])), indent="  ", omit=omit)


def _row(row: AttainableRow, metrics: Sequence[str]) -> list[str]:
    cells = {cell.metric: cell for cell in row.cells}
    load = "open" if math.isinf(row.load) else f"{row.load:.6g}"
    texts = [load, _range((row.speeds.low, row.speeds.high), ".2f", "-")]
    for metric in metrics:
        cell = cells.get(metric)
        if cell is None:
            texts += ["-", "", ""]
        else:
            text = f"{100.0 * cell.gap:+.1f}"
            texts += [
                f"{'~' * cell.derived}{cell.printed:.3f}",
                f"{cell.low:.3f}-{cell.high:.3f}",
                ("0" if float(text) == 0.0 else text if cell.outside else f"({text})"),
            ]
    return texts


def _verdict(ranges: AttainableRanges, metric: str) -> list[str]:
    """How far the table deviates in one efficiency, and which effects could do that alone."""
    sentences, causes = verdict_sentences(ranges, metric)
    return paragraphs(sentences) + paragraphs(causes, "  ")


def verdict_sentences(ranges: AttainableRanges, metric: str) -> tuple[list[str], list[str]]:
    """How far the table deviates in one efficiency, and which effects could do that alone, each in sentences."""
    judged = [cell for row in ranges.rows for cell in row.cells if cell.metric == metric]
    outside = [cell for cell in judged if cell.outside]
    if not outside:
        return [f"{metric}: all {len(judged)} rows within the attainable range"], []
    sentences = [
        f"{metric}: {len(cells)} of {len(judged)} rows {side} what the rig can reach, by "
        f"{_range([100.0 * abs(cell.gap) for cell in cells], '.1f')} points "
        f"({_range([100.0 * abs(cell.printed - cell.nominal) for cell in cells], '.1f')} from the middle payout)"
        for side, cells in (("above", [c for c in outside if c.gap > 0]), ("below", [c for c in outside if c.gap < 0]))
        if cells
    ]
    if metric not in wanted(ranges):
        return sentences, []
    able, beyond = (
        ", ".join(one.effect for one in ranges.explanation.suspects if one.ability(metric).verdict == verdict)
        for verdict in ("explains", "beyond_plausible")
    )
    causes = [f"one cause would do, at a plausible value: {able or 'none'}"]
    return sentences, causes + ([f"one would do at a value beyond what is plausible: {beyond}"] if beyond else [])


def wanted(ranges: AttainableRanges) -> list[str]:
    """Efficiencies whose causes are listed: the two stages where they are outside the attainable range, else their product."""
    outside = {cell.metric for _, cell in ranges.outside}
    stages: list[str] = [metric for metric in ("eta_trans", "eta_gen") if metric in outside]
    return stages or sorted(outside)


def _neither(ranges: AttainableRanges) -> list[str]:
    """Effects that cannot bring any of the efficiencies within the attainable range, and how much of it they take away."""
    metrics = wanted(ranges)
    found = [(mover.effect, [mover.ability(m) for m in metrics]) for mover in ranges.explanation.suspects]
    unable = {name: [one.closed for one in each] for name, each in found if all(one.verdict == "no" for one in each)}
    ranked = sorted(unable.items(), key=lambda item: (-max(item[1]), item[0]))
    some = "; ".join(f"{name} {', '.join(map('{:.0%}'.format, c))}" for name, c in ranked if max(c) >= _NOTHING)
    nothing = ", ".join(name for name, closed in ranked if max(closed) < _NOTHING)
    return [
        "",
        *(
            wrapped(
                f"{'explain neither' if len(metrics) > 1 else 'do not explain it'} alone; at a plausible value they take away "
                f"so much of what lies outside the attainable range of {' and of '.join(metrics)}: {some}"
            )
            if some
            else []
        ),
        *(wrapped(f"take away nothing: {nothing}") if nothing else []),
    ]


def _details(ranges: AttainableRanges) -> list[str]:
    """Effects that help: what is plausible, what the rows need, and the share that a plausible value takes away."""
    metrics = wanted(ranges)
    rows = [["effect", "plausible", *(text for metric in metrics for text in (f"{metric} needs", "closes"))]]
    for mover in ranges.explanation.suspects:
        found, first = [mover.ability(metric) for metric in metrics], mover.fields[0]
        if max(one.closed for one in found) >= _WORTH:
            span = f"{first.low:g}..{first.high:g}{unit_suffix(first.unit)}"
            needs = [text for one in found for text in (needed_words(ranges, one), f"{one.closed:.0%}")]
            rows.append([mover.effect, f"{len(mover.fields)} fields" if len(mover.fields) > 1 else span, *needs])
    note = indented("needs: from the row that needs least to the one that needs most; * in some rows no value does")
    return ["", *_columns(rows, ("plausible", "closes")), *note] if len(rows) > 1 else []


def needed_words(ranges: AttainableRanges, ability: Ability) -> str:
    """The values that the rows need."""
    outside = {row.load for row, cell in ranges.outside if cell.metric == ability.metric}
    needed = [value for row, value in zip(ranges.rows, ability.needed, strict=False) if row.load in outside]
    values = sorted((value for value in needed if value is not None), key=abs)
    if not values:
        return "-"
    texts = [f"{value:.2g}" if abs(value) < 100.0 else f"{value:.0f}" for value in (values[0], values[-1])]
    return "..".join(dict.fromkeys(texts)) + ("*" if None in needed else "")


def _sets(ranges: AttainableRanges) -> list[str]:
    found = ranges.explanation
    if found.sets:
        size = _SIZES[found.size]
        lines = [
            "",
            f"all within the attainable range at plausible values, the smallest sets ({size}), best fit first:",
        ]
        return lines + [line for values in found.sets for line in indented(values_text(ranges, values))]
    none = f"no set of up to {found.size} effects brings all within the attainable range at plausible values"
    lines = ["", none] if found.size else []
    if found.closest is not None:
        out = f"{100.0 * found.closest.out_of_reach:.1f} points outside the attainable range in all"
        lines += indented(f"closest: {values_text(ranges, found.closest)}; {out}")
    return lines


def values_text(ranges: AttainableRanges, values: Values) -> str:
    """Effects with their values, and what they leave."""
    fields = {(mover.effect, field.name): field for mover in ranges.explanation.suspects for field in mover.fields}
    parts = [
        f"{effect} {', '.join(_field_text(fields[effect, name], value) for name, value in given.items())}"
        for effect, given in values.fields.items()
    ]
    left = ", ".join(f"{metric} {100.0 * value:.1f}" for metric, value in values.left_rms.items())
    return f"{' with '.join(parts)}; left, rms: {left} points"


def _field_text(field: Field, value: float) -> str:
    stops = [f" (at its bound {bound:g})" for bound in (field.low, field.high) if value == bound != field.absent]
    return f"{field.name} {value:.3g}{unit_suffix(field.unit)}{''.join(stops)}"


def _range(values: Iterable[float], digits: str, to: str = " to ") -> str:
    """Smallest and largest of some values, or the one that they all are."""
    texts = [format(value, digits) for value in sorted(values)]
    return texts[0] if texts[0] == texts[-1] else f"{texts[0]}{to}{texts[-1]}"


def attainable_record(ranges: AttainableRanges) -> dict[str, Any]:
    """The same as nested records: the entry `physics` of an audit's JSON."""
    found = ranges.explanation
    return {
        "rig": ranges.rig.name,
        "ok": ranges.ok,
        "deviation_eta": ranges.scatter,
        "notes": ranges.notes,
        "rows": [
            {
                **load_record(row.load),
                "window_s": row.window,
                "speed_mps": [row.speeds.low, row.speeds.high],
                "efficiencies": {
                    cell.metric: {
                        "printed": cell.printed,
                        "derived": cell.derived,
                        "allowed": cell.allowed,
                        "reach": [cell.low, cell.high],
                        "nominal": cell.nominal,
                        "standard_uncertainty": cell.u,
                        "off": cell.gap,
                        "outside": cell.outside,
                    }
                    for cell in row.cells
                },
            }
            for row in ranges.rows
        ],
        "not_judged": [{**load_record(item.load), "reason": item.reason} for item in ranges.not_judged],
        "effects": [
            {
                "effect": mover.effect,
                "stage": mover.stage,
                "fields": {
                    field.name: {"unit": field.unit, "absent": field.absent, "plausible": [field.low, field.high]}
                    for field in mover.fields
                },
                "can": {
                    one.metric: {
                        "verdict": one.verdict,
                        "closed": one.closed,
                        "needed": [
                            {**load_record(row.load), "value": value}
                            for row, value in zip(ranges.rows, one.needed, strict=True)
                        ]
                        if one.needed
                        else None,
                    }
                    for one in mover.abilities
                },
                "best": None if mover.best is None else _values_record(mover.best),
            }
            for mover in found.suspects
        ],
        "sets": [_values_record(values) for values in found.sets],
        "closest": None if found.closest is None else _values_record(found.closest),
    }


def _values_record(values: Values) -> dict[str, Any]:
    names = ("fields", "reported", "left_rms", "out_of_reach", "enough", "plausible", "at_bound")
    return {name: getattr(values, name) for name in names}


POINT_AUDIT_SCHEMA = "winchcascade/point-audit/1"

_MAX_SHOWN = 12
"""Broken laws that the text shows; the JSON has all."""


def point_audit_text(audit: PointAudit) -> str:
    """What a table of operating points contradicts in itself."""
    table, broken = audit.table, audit.broken
    more = [f"and {len(broken) - _MAX_SHOWN} more"] if len(broken) > _MAX_SHOWN else []
    return joined(
        [
            *title_lines(table),
            *paragraphs([*law_sentences(audit), *use_sentences(audit.uses)]),
            "",
            f"{len(table.rows)} rows, {audit.laws} cells compared",
            *paragraphs(unread_sentences(audit)),
            *paragraphs([*_broken_sentences(audit, _MAX_SHOWN), *more], "  "),
            "",
            _summary(point_summary(audit), audit.ok),
        ]
    )


def law_sentences(audit: PointAudit) -> list[str]:
    """By which laws the cells of a row are compared."""
    table = audit.table
    laws = ", ".join(f"{name} = {column.law.text}" for name, column in table.columns.items() if column.law)
    bounds = ", ".join(name for name, column in table.columns.items() if column.at_most == 1.0)
    means = f"{100.0 * table.tolerance:g} %" if table.tolerance else ""
    heads = (("laws: ", laws), ("at most 1: ", bounds), ("means may differ by ", means))
    return [f"{head}{text}" for head, text in heads if text]


def unread_sentences(audit: PointAudit) -> list[str]:
    """Which cells hold a text where a number was expected."""
    unread = audit.table.unread
    more = f"; and {len(unread) - _MAX_SHOWN} more" if len(unread) > _MAX_SHOWN else ""
    return [f"not numbers, and not compared: {'; '.join(unread[:_MAX_SHOWN])}{more}"] if unread else []


def point_summary(audit: PointAudit) -> str:
    """How many faults there are."""
    faults, broken = len(audit.faults), len(audit.broken)
    found = [f"{faults} column fault{'s'[: faults != 1]}"] if faults else []
    one = "1 cell that contradicts others"
    found += [one if broken == 1 else f"{broken} cells that contradict others"] if broken or not found else []
    if not audit.laws:
        return NOTHING_EVALUATED
    return "nothing contradicts itself" if audit.ok else f"found: {', '.join(found)}"


def broken_laws_text(audit: PointAudit) -> str:
    """Column faults and contradictions alone, or that nothing was evaluated."""
    return joined(paragraphs(_broken_sentences(audit) if audit.laws else [NOTHING_EVALUATED], "  "))


def _broken_sentences(audit: PointAudit, maximum: int | None = None) -> list[str]:
    return [*(fault.sentence for fault in audit.faults), *(item.sentence for item in audit.broken[:maximum])]


def point_audit_record(audit: PointAudit) -> dict[str, Any]:
    """The audit as nested records, schema `winchcascade/point-audit/1`; JSON has null for an open end."""
    table = audit.table
    return {
        "schema": POINT_AUDIT_SCHEMA,
        "version": __version__,
        "table": table_record(table),
        "ok": audit.ok,
        "evaluated": audit.laws > 0,
        "laws": use_records(audit.uses),
        "rows": len(table.rows),
        "cells_compared": audit.laws,
        "cells_not_numbers": [*table.unread],
        "column_faults": [
            {
                "kind": fault.kind,
                "columns": [*fault.columns],
                "heads": [table.columns[name].head for name in fault.columns],
                "broken_before": fault.broken_before,
                "broken_after": fault.broken_after,
                "sentence": fault.sentence,
            }
            for fault in audit.faults
        ],
        "contradictions": [
            {
                "row": item.row + 1,
                "key": {name: cell.value for name, cell in table.rows[item.row].items() if name in table.key},
                "column": item.column,
                "printed": item.printed,
                "unit": table.columns[item.column].unit,
                "allowed": (item.allowed.low, item.allowed.high),
                "sentence": item.sentence,
            }
            for item in audit.broken
        ],
    }
