"""The report of a comparison: differences, what they are made of, and what limits them, for the page and the PDF."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from winchcascade.comparison.comparability import rule_text
from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import Comparison
from winchcascade.comparison.gate import Drop, Gate
from winchcascade.core.campaign_file import banner, origin_words
from winchcascade.report.comparison_figures import MOST_DRAWN, difference_figure, drawn
from winchcascade.report.comparison_words import (
    MATCHED,
    DifferenceRow,
    difference_columns,
    difference_rows,
    digits_of,
    drawn_metrics,
    freedom_cell,
    gate_words,
    headline_metrics,
    interval_cell,
    interval_verdict,
    method_words,
    note_words,
    of_windows,
    other_metrics,
    relative_cell,
    run_label,
    run_words,
    sensors_words,
    significance,
    unit_cell,
    value_cell,
    zero_cell,
)
from winchcascade.report.digits import number, places, uncertain, upper
from winchcascade.report.provenance import data_point, provenance_table
from winchcascade.report.report_model import Note, Point, Report, Tile, picture, section
from winchcascade.report.style import house_style
from winchcascade.report.table_model import Limit, Table, TableColumn, items_table
from winchcascade.report.wording import SYMBOL, load_words, subscripts_of

LISTED_ROWS = Limit(400, "more, in the JSON")
"""Rows that a table of the report lists."""

_RUN: TableColumn[DifferenceRow] = TableColumn("Run", text=True, of=lambda row: run_label(row.runs))
_METRIC: TableColumn[DifferenceRow] = TableColumn("Metric", text=True, of=lambda row: SYMBOL[row.of.metric])
_UNIT: TableColumn[DifferenceRow] = TableColumn("Unit", text=True, of=lambda row: unit_cell(row.of) or "1")


def make_comparison_report(found: Comparison, gate: Gate | None = None, *, command: str = "") -> Report:
    """Make the rows and the figure of the report of a comparison."""
    etas, others = headline_metrics(found), other_metrics(found)
    runs = [*found.a.runs, *found.b.runs]
    with house_style():
        figure = picture(
            difference_figure(found, drawn_metrics(found)), "differences",
            "Differences B − A of the efficiencies with 95 % intervals. A marker is full where the interval excludes zero."
            + (f" {MOST_DRAWN} runs, evenly chosen." if len(drawn(found)) < len(found.runs) else ""),
            "Points with intervals about a line at zero, one panel for each efficiency; the values are in the table.",
        )  # fmt: skip
    sections = (
        section(
            "efficiencies", "Efficiencies", figure,
            differences_table("efficiencies", found, etas), None if gate is None else gate_table(gate),
        ),
        section(
            "energies", "Energies and powers", differences_table("energies", found, of_windows(found)),
            differences_table("cycles", found, [m for m in others if m not in of_windows(found)]),
        ),
        section(
            "method", "How the intervals come about", *map(Note, (f"95 % intervals are {method_words()}", *_METHOD)),
            Note(f"Sensors are {sensors_words(found)}."), parts_table(found, etas or others),
        ),
        section(
            "runs", "Runs and notes", runs_table(found),
            *(Note(f"{upper(note_words(note, len(found.runs)))}.") for note in found.notes),
        ),
        section("provenance", "Provenance", _provenance(found, command)),
    )  # fmt: skip
    return Report(
        kind="Comparison",
        title=f"{_short(found.b.name, found.a.name)} compared with {_short(found.a.name, found.b.name)}",
        subtitle=f"B − A of {len(found.runs)} run{'s' * (len(found.runs) > 1)}, matched {MATCHED[found.matched_by]}",
        tiles=_tiles(found),
        points=tuple(_points(found, gate, etas)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner([run.origin for run in runs]),
        subscripts=tuple(dict.fromkeys(s for run in runs for s in subscripts_of(run.cascade))),
    )


_METHOD = (
    "Each side has three parts of uncertainty. The scatter of its cycles is s/√N with N − 1 degrees of freedom; of repeats of "
    "one load it is that within the logs, and what their means scatter beyond it and beyond their zeros. Gains of sensors are "
    "the same in all logs of a side. Zeros, sampling and bridged gaps are of each log alone.",
    "Intervals have a coverage of 95 % and equal tails: Student's t with the effective degrees of freedom of each difference "
    "(Welch and Satterthwaite), which the table of standard uncertainties lists.",
    "The parts of both sides add in squares. A gain that both sides share changes both means alike; its two contributions are "
    "subtracted before they are squared.",
    "With few cycles, the scatter alone may give a wider interval than scatter and sensors together, because the errors of the "
    "sensors add degrees of freedom.",
)


_CAPTIONS = {
    "efficiencies": "efficiencies",
    "energies": "energies and mean powers of the integration windows",
    "cycles": "line energies of payout, haul-in and whole cycle, and delivered energy of the whole cycle",
}


def differences_table(name: str, found: Comparison, metrics: Sequence[str]) -> Table | None:
    """Means of both sides and their differences with intervals, run by run; None without a metric."""
    rows = difference_rows(found, metrics)
    columns: list[TableColumn[DifferenceRow]] = [
        _METRIC,
        _RUN,
        *([_UNIT] if any(unit_cell(row.of) for row in rows) else []),
        *difference_columns("B − A"),
        TableColumn("B/A − 1", "%", of=lambda row: relative_cell(row.of)),
        TableColumn("Excludes 0", text=True, of=lambda row: zero_cell(row.of)),
    ]
    caption = f"Means of A and B, and their differences with 95 % intervals (Student's t): {_CAPTIONS[name]}."
    return items_table(f"{name}-differences", caption, columns, rows, limit=LISTED_ROWS)


def parts_table(found: Comparison, metrics: Sequence[str]) -> Table | None:
    """What the standard uncertainty of each difference is made of."""
    columns: list[TableColumn[DifferenceRow]] = [
        _METRIC,
        _RUN,
        _UNIT,
        TableColumn("Cycles of A", of=lambda row: row.of.cycles_a),
        TableColumn("Cycles of B", of=lambda row: row.of.cycles_b),
        TableColumn("Scatter of cycles", of=lambda row: uncertain(row.of.repeatability)),
        TableColumn("Sensors", of=lambda row: uncertain(row.of.sensors)),
        TableColumn("Together", of=lambda row: uncertain(row.of.uncertainty)),
        TableColumn("Degrees of freedom", of=lambda row: freedom_cell(row.of)),
        TableColumn("Interval of the scatter alone", of=_scatter_interval),
    ]
    rows = difference_rows(found, metrics)
    caption = "Standard uncertainties of the differences and their effective degrees of freedom."
    return items_table("parts", caption, columns, rows, limit=LISTED_ROWS)


def _scatter_interval(row: DifferenceRow) -> str:
    ends, u = row.of.interval_repeatability, digits_of(row.of)
    return "–" if ends is None or not u else f"{number(ends[0], places(u))} to {number(ends[1], places(u))}"


def runs_table(found: Comparison) -> Table | None:
    """Logs of both sides with what decides whether they can be compared."""
    logs = [
        (run_label(runs), side, run)
        for runs in found.runs
        for side in "AB"
        for run in (runs.a if side == "A" else runs.b)
    ]
    logs += [("alone", side, run) for side, alone in (("A", found.alone_a), ("B", found.alone_b)) for run in alone]
    columns: list[TableColumn[tuple[str, str, ComparedRun]]] = [
        TableColumn("Run", text=True, of=lambda row: row[0]),
        TableColumn("Side", text=True, of=lambda row: row[1]),
        TableColumn("Log", text=True, of=lambda row: row[2].name),
        TableColumn("Load", text=True, of=lambda row: load_words(row[2].load, unknown="–")),
        TableColumn("Rig", text=True, of=lambda row: row[2].rig),
        TableColumn("Window", text=True, of=lambda row: rule_text(row[2])),
        TableColumn("Mean window", "s", 2, of=lambda row: row[2].window_length),
        TableColumn("Plateau", "m/s", 3, of=lambda row: row[2].speed),
        TableColumn("Cycles", of=lambda row: row[2].complete),
        TableColumn("Findings", of=lambda row: row[2].findings),
    ]
    caption = "Logs of both sides; the plateau is the mean of the payouts."
    return items_table("runs", caption, columns, logs, limit=LISTED_ROWS)


def gate_table(gate: Gate) -> Table | None:
    """Drop of each run against the limit."""
    columns: list[TableColumn[Drop]] = [
        TableColumn("Run", text=True, of=lambda drop: load_words(drop.load, unknown=drop.label)),
        TableColumn("Drop", decimals=4, of=lambda drop: drop.value),
        TableColumn("Outcome", text=True, of=lambda drop: "failed" if drop.fails else "passed"),
        TableColumn("95 % interval of the drop", of=_drop_interval),
        TableColumn("Against the limit", text=True, of=lambda drop: upper(interval_verdict(drop))),
    ]
    caption = f"Drops of {SYMBOL[gate.metric]} against the limit of {gate.limit:g}; the estimate decides."
    return items_table("gate", caption, columns, gate.drops, limit=LISTED_ROWS)


def _drop_interval(drop: Drop) -> str:
    return "–" if drop.interval is None else f"{number(drop.interval[0], 4)} to {number(drop.interval[1], 4)}"


def _short(name: str, other: str) -> str:
    """Name of a side in the title: that of its file or folder alone, if the other side has another one."""
    last = Path(name).name
    return last if last and last != Path(other).name else name


def _tiles(found: Comparison) -> tuple[Tile, ...]:
    """The largest drop and the largest gain of the efficiency of the whole cascade."""
    rows = [] if found.overall is None else difference_rows(found, [found.overall])
    if not rows or found.overall is None:
        return ()
    low, high = min(rows, key=lambda row: row.of.value), max(rows, key=lambda row: row.of.value)
    chosen = {low.runs.label: low, high.runs.label: high}
    return tuple(
        Tile(
            f"{SYMBOL[found.overall]}",
            f"B − A at {run_label(row.runs)}",
            value_cell(row.of),
            f"95 %: {interval_cell(row.of)}",
        )
        for row in chosen.values()
    )


def _points(found: Comparison, gate: Gate | None, etas: Sequence[str]) -> list[Point]:
    points = [data_point([run.origin for run in (*found.a.runs, *found.b.runs)])]
    if gate is not None:
        points.append(Point("Limit", f"{upper(gate_words(gate, SYMBOL[gate.metric]))}.", "good" if gate.ok else "warn"))
    points += [Point("Difference", f"{significance(found, m, run_label)}.") for m in etas]
    points.append(Point("Sensors", f"{upper(sensors_words(found))}."))
    both = (("A", found.alone_a), ("B", found.alone_b))
    alone = [f"{side}: {run_words([run.name for run in runs])}" for side, runs in both if runs]
    points += [Point("Unmatched", f"{'; '.join(alone)}.", "warn")] if alone else []
    points += [
        Point(upper(note.kind.replace("_", " ")), f"{upper(note_words(note, len(found.runs)))}.", "warn")
        for note in found.notes
        if note.is_warning
    ]
    return points


def _provenance(found: Comparison, command: str) -> Table:
    rows = [
        (f"{side} {what}", text)
        for side, of in (("A", found.a), ("B", found.b))
        for what, text in (("is", of.name), ("data", origin_words([run.origin for run in of.runs])))
    ]
    return provenance_table(rows, command)
