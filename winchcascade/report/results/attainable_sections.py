"""What a rig can attain of a published table, and which effects could explain the rest."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from string import ascii_lowercase
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from winchcascade.core.quantity import load_text, unit_suffix
from winchcascade.report.content import (
    Column,
    Note,
    Picture,
    Section,
    Span,
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
from winchcascade.report.results.effects import call_all, called
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.effect import Parameter
from winchcascade.tables.attainable import Ability, AttainableRanges, SuspectResult, Values
from winchcascade.tables.payouts import RAMPS, STARTED, AttainableRow, Cell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CLOSED_MIN = 0.005
"""An effect that removes less than this share of the excess over the attainable range does
nothing. [1]
"""

PRINTED_LOOK = Look("mech", "-", "o")
"""Look of a printed efficiency."""


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


def physics_sections(ranges: AttainableRanges) -> list[Section]:
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
