"""What of a table's rows and totals contradicts itself, told in sentences with the numbers that decide it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

import msgspec

from winchcascade.core.published_table import Column, Row, Span, Table, load_text, unit_suffix
from winchcascade.reduction.efficiency import RATIOS
from winchcascade.tables.feasible import STAGES, allowed, contradictions, repairs
from winchcascade.tables.ratio_of_means import Repeatability


class Repair(msgspec.Struct, frozen=True):
    """A cell whose change alone makes its row consistent: the printed values that do, in the unit of the column."""

    metric: str
    low: float
    high: float
    text: str


class Contradiction(msgspec.Struct, frozen=True):
    """A smallest set of cells that cannot all be true, whatever the rounding and the scatter of the cycles.

    `printed` is the cell `metric`, `allowed` what the others of the set allow of it and `missed_by` the gap between, all in
    the unit printed. `load` is None for the row of sums and for a whole column.
    """

    kind: Literal["row", "column", "total"]
    load: float | None
    cells: tuple[str, ...]
    metric: str
    printed: float
    unit: str
    allowed: Span
    missed_by: float
    sentence: str
    repairs: tuple[Repair, ...] = ()
    line: int | None = None


def row_contradictions(table: Table, known: Repeatability) -> tuple[Contradiction, ...]:
    """Contradictions inside the rows; a column that is off by the same power of ten in every row counts once."""
    found = _of_rows(table, known)
    for metric, column in table.columns.items():
        inside = [item for item in found if item.metric == metric]
        rows = {row.load for row in table.rows if metric in row.cells}
        powers = {_power_of_ten(item, column) for item in inside if item.repairs}
        if len(rows) > 1 and {item.load for item in inside} == rows and len(powers) == 1 and (power := powers.pop()):
            scaled = msgspec.structs.replace(column, factor=column.factor * 10.0**power)
            mended = msgspec.structs.replace(table, columns={**table.columns, metric: scaled})
            return (_of_column(table, inside, power), *_of_rows(mended, known))
    return tuple(found)


def _of_rows(table: Table, known: Repeatability) -> list[Contradiction]:
    return [item for row in table.rows for item in _of_row(table, row, known)]


def total_contradictions(table: Table) -> tuple[Contradiction, ...]:
    """Sums of energies that the rows, each within its rounding, cannot give."""
    if table.total is None:
        return ()
    found = []
    for metric, printed in table.total.cells.items():
        column = table.columns[metric]
        cells = [row.cells[metric] for row in table.rows if metric in row.cells]
        slack = len(cells) * column.rounding
        whole = len(cells) == len(table.rows)  # rows without the cell can only add to the sum
        span = Span(sum(cells) - slack, sum(cells) + slack if whole else math.inf)
        missed = _gap(span, Span(printed - column.rounding, printed + column.rounding))
        if missed > 1e-9 * printed:
            sentence = (
                f"total of {metric}: {column.text(printed)} is printed, but the {len(cells)} rows add up to "
                f"{_range(span, column)}; missed by {_fine(missed, column)}."
            )
            line = table.total.lines.get(metric)
            found.append(
                Contradiction("total", None, (metric,), metric, printed, column.unit, span, missed, sentence, (), line)
            )
    return tuple(found)  # fmt: skip


def _of_row(table: Table, row: Row, known: Repeatability) -> list[Contradiction]:
    spans = table.spans(row)
    sets = list(contradictions(spans, known.bounds))
    mended = _repairs(table, row, repairs(spans, known.bounds)) if len(sets) == 1 else ()
    return [_told(table, row, names, mended, known) for names in sets]


def _told(
    table: Table, row: Row, names: tuple[str, ...], mended: Sequence[Repair], known: Repeatability
) -> Contradiction:
    """Put one contradiction in a sentence, seen from the cell that needs the smallest change."""
    metric = min(mended, key=lambda repair: _steps(repair, row, table)).metric if mended else names[-1]
    column, printed = table.columns[metric], row.cells[metric]
    others = [name for name in names if name != metric]
    spans = table.spans(row)
    span = allowed({name: spans[name] for name in others}, known.bounds, metric) or Span(0.0, math.inf)
    span = Span(span.low / column.factor, span.high / column.factor)
    missed = _gap(span, Span(printed - column.rounding, printed + column.rounding))
    by = " and ".join(f"{name} {table.cell(row, name)}" for name in others)
    sentence = (
        f"{load_text(row.load)}, {metric}: {column.text(printed)} is printed, but {by or 'conservation of energy'} "
        f"allow{'s' if len(others) < 2 else ''} {_range(span, column)}, missed by {_fine(missed, column)} after rounding: "
        f"{_reason(table, row, names, known)}."
    )
    return Contradiction(
        "row",
        row.load,
        names,
        metric,
        printed,
        column.unit,
        span,
        missed,
        sentence,
        tuple(mended),
        row.lines.get(metric),
    )


def _reason(table: Table, row: Row, names: tuple[str, ...], known: Repeatability) -> str:
    """Why these cells cannot all be true, by the law that connects them."""
    cells, spans = set(names), table.spans(row)
    for eta, (out, into) in RATIOS.items():
        for kind in ("energy", "power"):
            part, of = out.replace("energy", kind), into.replace("energy", kind)
            if cells == {part, of, eta}:
                return _ratio_reason(part, of, eta, spans, known)
            if cells == {part, of}:
                return f"{part} cannot exceed {of}"
    if cells == {"eta_trans", "eta_gen", "eta_pto"}:
        share = _apart(spans["eta_pto"], Span(*(_ends(spans, "eta_trans", "eta_gen"))))
        return (
            f"eta_pto and eta_trans eta_gen differ by at least {percent(share)}, and over {known.basis} they can "
            f"differ by {percent(known.bounds.product)}"
        )
    for one, other in (("line", "mech"), ("line", "gen"), ("mech", "gen")):
        if cells == {f"energy_{one}", f"power_{one}", f"energy_{other}", f"power_{other}"}:
            first, second = (stage_window(spans, stage) for stage in (one, other))
            return (
                f"energy over power gives a window of {_seconds(first)} for {one} and of {_seconds(second)} for {other}, "
                "and all stages share one"
            )
    if len(cells) == 1:
        return "no stage gives out more than it takes in"
    return "E = P t with one window, the efficiencies and what the scatter of the cycles allows leave no common values"


def _ratio_reason(part: str, of: str, eta: str, spans: Mapping[str, Span], known: Repeatability) -> str:
    quotient = Span(spans[part].low / spans[of].high, spans[part].high / max(spans[of].low, 1e-300))
    middle = (spans[part].low + spans[part].high) / (spans[of].low + spans[of].high)
    return (
        f"{part} / {of} is {middle:.4f}, which differs from {eta} by at least {percent(_apart(quotient, spans[eta]))}, "
        f"and over {known.basis} the two can differ by {percent(known.bounds.ratio)}"
    )


def _ends(spans: Mapping[str, Span], one: str, other: str) -> tuple[float, float]:
    return spans[one].low * spans[other].low, spans[one].high * spans[other].high


def _apart(quotient: Span, reference: Span) -> float:
    """Smallest share by which a value of the one differs from a value of the other. [1]"""
    return max(quotient.low / reference.high - 1.0, 1.0 - quotient.high / max(reference.low, 1e-300), 0.0)


def stage_window(spans: Mapping[str, Span], stage: str) -> Span | None:
    """Window that a stage's energy and power leave (E = P t), None without both; an end that is open is inf. [s]"""
    energy, power = spans.get(f"energy_{stage}"), spans.get(f"power_{stage}")
    if energy is None or power is None:
        return None
    longest = math.inf if power.low <= 0 else energy.high / power.low
    return Span(max(energy.low, 0.0) / power.high, longest)


def window(spans: Mapping[str, Span]) -> Span | None:
    """Window that the energies and powers of all stages of a row leave together; None if none does. [s]"""
    found = [span for stage in STAGES if (span := stage_window(spans, stage)) is not None]
    if not found:
        return None
    low, high = max(span.low for span in found), min(span.high for span in found)
    return Span(low, high) if low <= high * (1.0 + 1e-9) and math.isfinite(high) else None


def _repairs(table: Table, row: Row, spans: Mapping[str, Span]) -> tuple[Repair, ...]:
    """Turn the values that mend a row into those that would be printed for them."""
    found = []
    for metric, span in spans.items():
        column = table.columns[metric]
        step = 2.0 * column.rounding
        low = math.ceil((span.low / column.factor - column.rounding) / step - 1e-9) * step
        high = span.high
        if math.isfinite(high):
            high = math.floor((high / column.factor + column.rounding) / step + 1e-9) * step
        ends = [f"{end:.{max(column.decimals, 0)}f}" for end in (max(low, 0.0), high)]
        text = (
            ends[0] if ends[0] == ends[1] else f"at least {ends[0]}" if math.isinf(high) else f"{ends[0]} to {ends[1]}"
        )
        found.append(Repair(metric, max(low, 0.0), high, text + unit_suffix(column.unit)))
    return tuple(sorted(found, key=lambda repair: _steps(repair, row, table)))


def _steps(repair: Repair, row: Row, table: Table) -> float:
    """Units of the last printed decimal by which a cell has to change."""
    printed = row.cells[repair.metric]
    return max(repair.low - printed, printed - repair.high) / table.columns[repair.metric].rounding


def _power_of_ten(item: Contradiction, column: Column) -> int | None:
    """Power of ten that mends the cell, as a wrong unit or a lost decimal point would need."""
    for repair in item.repairs:
        for power in (-6, -3, -2, -1, 1, 2, 3, 6):
            scaled = item.printed * 10.0**power
            slack = column.rounding * 10.0**power + column.rounding
            if repair.metric == item.metric and repair.low - slack <= scaled <= repair.high + slack:
                return power
    return None


def _of_column(table: Table, items: Sequence[Contradiction], power: int) -> Contradiction:
    first = items[0]
    sentence = (
        f"column {first.metric}: every one of its {len(items)} rows is consistent if the numbers are taken times "
        f"{10.0**power:g}; the unit of the column, printed as {table.columns[first.metric].unit}, is wrong."
    )
    return msgspec.structs.replace(
        first, kind="column", load=None, cells=(first.metric,), sentence=sentence, repairs=(), line=None
    )


def percent(share: float) -> str:
    """A share in percent, with two decimals.

    >>> percent(0.00314)
    '0.31 %'
    """
    return f"{100.0 * share:.2f} %"


def _gap(one: Span, other: Span) -> float:
    return max(one.low - other.high, other.low - one.high, 0.0)


def _fine(value: float, column: Column) -> str:
    """A gap with two digits, in the unit of the column."""
    decimals = max(0, 1 - math.floor(math.log10(value))) if value > 0 else 0
    return f"{value:.{decimals}f}{unit_suffix(column.unit)}"


def _range(span: Span, column: Column) -> str:
    """An interval with one decimal more than is printed."""
    decimals = max(column.decimals + 1, 0)
    low = f"{span.low:.{decimals}f}"
    if math.isinf(span.high):
        return f"{low}{unit_suffix(column.unit)} or more"
    if span.low <= 0:
        return f"at most {span.high:.{decimals}f}{unit_suffix(column.unit)}"
    return f"{low} to {span.high:.{decimals}f}{unit_suffix(column.unit)}"


def _seconds(span: Span | None) -> str:
    return "unknown length" if span is None else f"{span.low:.4g} to {span.high:.4g} s"
