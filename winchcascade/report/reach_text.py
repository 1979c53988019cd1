"""What a rig can reach of a published table: as text for the terminal and as a record for JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from winchcascade.core.published_table import load_text, unit_suffix
from winchcascade.report.table_text import load_record
from winchcascade.report.text_table import wrapped
from winchcascade.tables.plausible_payouts import RAMPS, STARTED

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from winchcascade.tables.attainable import Ability, FieldRange, Mover, Reach
    from winchcascade.tables.attainable_row import Cell, RowReach
    from winchcascade.tables.effect_search import Values

_WORTH, _NOTHING = 0.2, 0.005
"""An effect that takes away less than this share of what is out of reach is not shown in detail, or said to do nothing. [1]"""

_SIZES = {1: "one effect", 2: "pairs", 3: "sets of three"}


def reach_text(reach: Reach) -> str:
    """What can be reached row by row, how far the table lies outside, and which effects could be why; 100 columns at most."""
    lines = ["", *wrapped(_basis(reach)), *_notes(reach)]
    metrics = list(dict.fromkeys(cell.metric for row in reach.rows for cell in row.cells))
    if reach.rows:
        lines += ["", *_columns([_head(metrics), *(_row(row, metrics) for row in reach.rows)])]
        lines += wrapped(
            "off: percentage points beyond the nearer end; in brackets where rounding and repeatability "
            f"({_allowed(reach)} points) bridge it",
            indent="  ",
        )
    for metric in metrics:
        lines += _verdict(reach, metric)
    if not reach.ok:
        lines += [*_neither(reach), *_details(reach), *_sets(reach)]
    return "\n".join([*lines, "", _summary(reach)]) + "\n"


def reach_record(reach: Reach) -> dict[str, Any]:
    """The same as nested records: the entry `physics` of an audit's JSON."""
    found = reach.explanation
    return {
        "rig": reach.rig.name,
        "ok": reach.ok,
        "deviation_eta": reach.scatter,
        "notes": list(reach.notes),
        "rows": [_row_record(row) for row in reach.rows],
        "not_judged": [{**load_record(item.load), "reason": item.reason} for item in reach.not_judged],
        "effects": [_mover_record(reach, mover) for mover in found.movers],
        "sets": [_values_record(values) for values in found.sets],
        "closest": None if found.closest is None else _values_record(found.closest),
    }


def _basis(reach: Reach) -> str:
    shortest, longest = 100 * min(RAMPS), 100 * max(RAMPS)
    return (
        f"physics: what rig {reach.rig.name} can reach on payouts that speed up for {shortest:.0f} to {longest:.0f} % of the "
        f"window, evenly or smoothly, from 0 or {STARTED:g} m of line, at the speeds that the printed powers imply; its "
        "numbers and sensors within one standard uncertainty"
    )


def _notes(reach: Reach) -> list[str]:
    lines = [line for note in reach.notes for line in wrapped(f"note: {note}")]
    return lines + [
        line for item in reach.not_judged for line in wrapped(f"not judged: {load_text(item.load)}: {item.reason}")
    ]


def _allowed(reach: Reach) -> str:
    return _range([100.0 * cell.allowed for row in reach.rows for cell in row.cells], ".1f")


def _head(metrics: Sequence[str]) -> list[str]:
    return ["ohm", "m/s", *(text for metric in metrics for text in (f" {metric}", "reach", "off"))]


def _row(row: RowReach, metrics: Sequence[str]) -> list[str]:
    cells = {cell.metric: cell for cell in row.cells}
    load = "open" if math.isinf(row.load) else f"{row.load:.6g}"
    texts = [load, _range((row.speeds.low, row.speeds.high), ".2f", "-")]
    for metric in metrics:
        cell = cells.get(metric)
        texts += ["-", "", ""] if cell is None else [_printed(cell), f"{cell.low:.3f}-{cell.high:.3f}", _off(cell)]
    return texts


def _printed(cell: Cell) -> str:
    return f"{'~' if cell.derived else ''}{cell.printed:.3f}"


def _off(cell: Cell) -> str:
    text = f"{100.0 * cell.gap:+.1f}"
    if float(text) == 0.0:
        return "0"
    return text if cell.outside else f"({text})"


def _verdict(reach: Reach, metric: str) -> list[str]:
    """How far the table is off in one efficiency, and which effects could do that alone."""
    judged = [cell for row in reach.rows for cell in row.cells if cell.metric == metric]
    outside = [cell for cell in judged if cell.outside]
    if not outside:
        return ["", f"{metric}: all {len(judged)} rows within reach"]
    lines = [""]
    for side, cells in (("above", [c for c in outside if c.gap > 0]), ("below", [c for c in outside if c.gap < 0])):
        if cells:
            beyond = _range([100.0 * abs(cell.gap) for cell in cells], ".1f")
            middle = _range([100.0 * abs(cell.printed - cell.nominal) for cell in cells], ".1f")
            lines += wrapped(
                f"{metric}: {len(cells)} of {len(judged)} rows {side} what the rig can reach, by {beyond} points "
                f"({middle} from the middle payout)"
            )
    return lines + (_causes(reach, metric) if metric in _wanted(reach) else [])


def _causes(reach: Reach, metric: str) -> list[str]:
    """Effects that bring all rows of one efficiency within reach alone."""
    lines = []
    for verdict, words in (
        ("explains", "one cause would do, at a plausible value"),
        ("beyond_plausible", "one would do at a value beyond what is plausible"),
    ):
        names = [mover.effect for mover in reach.explanation.movers if mover.ability(metric).verdict == verdict]
        if names or verdict == "explains":
            lines += wrapped(f"{words}: {', '.join(names) or 'none'}", indent="  ")
    return lines


def _wanted(reach: Reach) -> list[str]:
    """Efficiencies whose causes are told: the two stages where they are out of reach, else their product."""
    outside = {cell.metric for _, cell in reach.outside}
    stages: list[str] = [metric for metric in ("eta_trans", "eta_gen") if metric in outside]
    return stages or sorted(outside)


def _neither(reach: Reach) -> list[str]:
    """Effects that cannot bring any of the efficiencies within reach, and how much of it they take away."""
    metrics = _wanted(reach)
    parts = []
    for mover in reach.explanation.movers:
        found = [mover.ability(metric) for metric in metrics]
        if all(ability.verdict == "no" for ability in found):
            parts.append((max(one.closed for one in found), mover.effect, [f"{one.closed:.0%}" for one in found]))
    parts.sort(key=lambda part: (-part[0], part[1]))
    some = [f"{name} {', '.join(shares)}" for most, name, shares in parts if most >= _NOTHING]
    nothing = [name for most, name, _ in parts if most < _NOTHING]
    of = " and of ".join(metrics)
    lines = [""]
    if some:
        lines += wrapped(
            f"{'explain neither' if len(metrics) > 1 else 'do not explain it'} alone; at a plausible value they take away so "
            f"much of what is out of reach of {of}: {'; '.join(some)}"
        )
    return lines + (wrapped(f"take away nothing: {', '.join(nothing)}") if nothing else [])


def _details(reach: Reach) -> list[str]:
    """Effects that help: what is plausible, what the rows need, and the share that a plausible value takes away."""
    metrics = _wanted(reach)
    rows = [["effect", "plausible", *(text for metric in metrics for text in (f"{metric} needs", "closes"))]]
    for mover in reach.explanation.movers:
        found = [mover.ability(metric) for metric in metrics]
        if max(one.closed for one in found) >= _WORTH:
            first = mover.fields[0]
            many = len(mover.fields) > 1
            plausible = (
                f"{len(mover.fields)} fields" if many else f"{first.low:g}..{first.high:g}{unit_suffix(first.unit)}"
            )
            needs = [text for one in found for text in (_needs(reach, one), f"{one.closed:.0%}")]
            rows.append([mover.effect, plausible, *needs])
    if len(rows) == 1:
        return []
    lines = ["", *_columns(rows)]
    return lines + wrapped(
        "needs: from the row that needs least to the one that needs most; * in some rows no value does", "  "
    )


def _needs(reach: Reach, ability: Ability) -> str:
    """The values that the rows need."""
    outside = {row.load for row, cell in reach.outside if cell.metric == ability.metric}
    needed = [value for row, value in zip(reach.rows, ability.needed, strict=False) if row.load in outside]
    values = sorted((value for value in needed if value is not None), key=abs)
    if not values:
        return "-"
    texts = [f"{value:.2g}" if abs(value) < 100.0 else f"{value:.0f}" for value in (values[0], values[-1])]
    return "..".join(dict.fromkeys(texts)) + ("*" if None in needed else "")


def _sets(reach: Reach) -> list[str]:
    found = reach.explanation
    if found.sets:
        lines = ["", f"all within reach at plausible values, the smallest sets ({_SIZES[found.size]}), best fit first:"]
        for values in found.sets:
            lines += wrapped(_values_text(reach, values), indent="  ")
        return lines
    lines = (
        ["", f"no set of up to {found.size} effects brings all within reach at plausible values"] if found.size else []
    )
    if found.closest is not None:
        out = 100.0 * found.closest.excess
        lines += wrapped(
            f"closest: {_values_text(reach, found.closest)}; {out:.1f} points out of reach in all", indent="  "
        )
    return lines


def _values_text(reach: Reach, values: Values) -> str:
    units = {(mover.effect, field.name): field for mover in reach.explanation.movers for field in mover.fields}
    parts = []
    for effect, fields in values.fields.items():
        told = [_field_text(units[effect, name], value) for name, value in fields.items()]
        parts.append(f"{effect} {', '.join(told)}")
    left = ", ".join(f"{metric} {100.0 * value:.1f}" for metric, value in values.left.items())
    return f"{' with '.join(parts)}; left, rms: {left} points"


def _field_text(field: FieldRange, value: float) -> str:
    stops = [f" (at its bound {bound:g})" for bound in (field.low, field.high) if value == bound != field.absent]
    return f"{field.name} {value:.3g}{unit_suffix(field.unit)}{''.join(stops)}"


def _summary(reach: Reach) -> str:
    judged = sum(len(row.cells) for row in reach.rows)
    if not judged:
        return "physics: no row could be judged"
    if reach.ok:
        return f"physics: all {judged} efficiencies can be reached"
    return f"physics: {len(reach.outside)} of {judged} efficiencies cannot be reached"


def _range(values: Iterable[float], digits: str, to: str = " to ") -> str:
    """Smallest and largest of some values, or the one that they all are."""
    texts = [format(value, digits) for value in sorted(values)]
    return texts[0] if texts[0] == texts[-1] else f"{texts[0]}{to}{texts[-1]}"


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns under each other, the first to the left and the others to the right."""
    width = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = []
    for row in rows:
        texts = [row[0].ljust(width[0]), *(text.rjust(width[k]) for k, text in enumerate(row) if k)]
        lines.append("  " + " ".join(texts).rstrip())
    return lines


def _row_record(row: RowReach) -> dict[str, Any]:
    return {
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


def _mover_record(reach: Reach, mover: Mover) -> dict[str, Any]:
    return {
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
                    {**load_record(row.load), "value": value} for row, value in zip(reach.rows, one.needed, strict=True)
                ]
                if one.needed
                else None,
            }
            for one in mover.abilities
        },
        "best": None if mover.best is None else _values_record(mover.best),
    }


def _values_record(values: Values) -> dict[str, Any]:
    return {
        "fields": {effect: dict(fields) for effect, fields in values.fields.items()},
        "reported": {effect: dict(told) for effect, told in values.reported.items()},
        "left_rms": dict(values.left),
        "out_of_reach": values.excess if math.isfinite(values.excess) else None,
        "enough": values.enough,
        "plausible": values.plausible,
        "at_bound": list(values.at_bound),
    }
