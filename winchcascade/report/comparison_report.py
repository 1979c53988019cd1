"""The report of a comparison: differences with their figure, what they are made of, and what limits them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.comparison.comparability import rule_text
from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import Comparison, MatchedRuns
from winchcascade.comparison.gate import Drop, Gate
from winchcascade.core.campaign_file import banner, origin_words
from winchcascade.core.cascade import PAPER
from winchcascade.report import sheet as content
from winchcascade.report.comparison_text import (
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
    value_cell,
    zero_cell,
)
from winchcascade.report.digits import number, places, uncertain, upper
from winchcascade.report.sheet import TableColumn
from winchcascade.report.style import (
    COLOURS,
    Look,
    Margins,
    cut_apart,
    evenly,
    house_style,
    is_narrow,
    label_panel,
    look_of,
    panel_figure,
    text_width,
)
from winchcascade.report.wording import SYMBOL, load_words, subscripts_of, tex, unit_of

LISTED_ROWS = content.Limit(400, "more, in the JSON")
"""Rows that a table of the report lists."""

_RUN: TableColumn[DifferenceRow] = TableColumn("Run", text=True, of=lambda row: run_label(row.runs))
_METRIC: TableColumn[DifferenceRow] = TableColumn("Metric", text=True, of=lambda row: SYMBOL[row.of.metric])
_UNIT: TableColumn[DifferenceRow] = TableColumn("Unit", text=True, of=lambda row: unit_of(row.of.metric) or "1")


@house_style()
def make_comparison_report(found: Comparison, gate: Gate | None = None, *, command: str = "") -> content.Report:
    """Make the rows and the figure of the report of a comparison."""
    etas, others = headline_metrics(found), other_metrics(found)
    runs = [*found.a.runs, *found.b.runs]
    figure = content.picture(
        difference_figure(found, drawn_metrics(found)), "differences",
        "Differences B − A of the efficiencies with 95 % intervals. A marker is full where the interval excludes zero."
        + (f" {MAX_DRAWN} runs, evenly chosen." if len(drawn(found)) < len(found.runs) else ""),
        "Points with intervals about a line at zero, one panel for each efficiency; the values are in the table.",
    )  # fmt: skip
    sections = content.filled(
        content.section(
            "efficiencies", "Efficiencies", figure,
            differences_table("efficiencies", found, etas), None if gate is None else gate_table(gate),
        ),
        content.section(
            "energies", "Energies and powers", differences_table("energies", found, of_windows(found)),
            differences_table("cycles", found, [m for m in others if m not in of_windows(found)]),
        ),
        content.section(
            "method", "How the intervals come about", *map(content.Note, (f"95 % intervals are {method_words()}", *_METHOD)),
            content.Note(f"Sensors are {sensors_words(found)}."), _PARTS.of(difference_rows(found, etas or others)),
        ),
        content.section(
            "runs", "Runs and notes", runs_table(found),
            *(content.Note(f"{upper(note_words(note, len(found.runs)))}.") for note in found.notes),
        ),
        content.provenance_section(
            [
                (f"{side} {what}", text)
                for side, of in (("A", found.a), ("B", found.b))
                for what, text in (("is", of.name), ("data", origin_words([run.origin for run in of.runs])))
            ],
            command,
        ),
    )  # fmt: skip
    return content.Report(
        kind="Comparison",
        title=f"{_short(found.b.name, found.a.name)} compared with {_short(found.a.name, found.b.name)}",
        subtitle=f"B − A of {len(found.runs)} run{'s' * (len(found.runs) > 1)}, matched {MATCHED[found.matched_by]}",
        tiles=_tiles(found),
        points=tuple(_points(found, gate, etas)),
        sections=sections,
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


def differences_table(name: str, found: Comparison, metrics: Sequence[str]) -> content.Table | None:
    """Means of both sides and their differences with intervals, run by run; None without a metric."""
    rows = difference_rows(found, metrics)
    return content.ItemTable[DifferenceRow](
        f"{name}-differences",
        f"Means of A and B, and their differences with 95 % intervals (Student's t): {_CAPTIONS[name]}.",
        [
            _METRIC,
            _RUN,
            *([_UNIT] if any(unit_of(row.of.metric) for row in rows) else []),
            *difference_columns("B − A"),
            TableColumn("B/A − 1", "%", of=lambda row: relative_cell(row.of)),
            TableColumn("Excludes 0", text=True, of=lambda row: zero_cell(row.of)),
        ],
        limit=LISTED_ROWS,
    ).of(rows)


def _scatter_interval(row: DifferenceRow) -> str:
    ends, u = row.of.interval_repeatability, digits_of(row.of)
    return "–" if ends is None or not u else f"{number(ends[0], places(u))} to {number(ends[1], places(u))}"


_PARTS = content.ItemTable[DifferenceRow](
    "parts",
    "Standard uncertainties of the differences and their effective degrees of freedom.",
    [
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
    ],
    limit=LISTED_ROWS,
)


def runs_table(found: Comparison) -> content.Table | None:
    """Logs of both sides with what decides whether they can be compared."""
    logs = [
        (run_label(runs), side, run)
        for runs in found.runs
        for side in "AB"
        for run in (runs.a if side == "A" else runs.b)
    ]
    logs += [("alone", side, run) for side, alone in (("A", found.alone_a), ("B", found.alone_b)) for run in alone]
    return content.ItemTable[tuple[str, str, ComparedRun]](
        "runs",
        "Logs of both sides; the plateau is the mean of the payouts.",
        [
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
        ],
        limit=LISTED_ROWS,
    ).of(logs)


def gate_table(gate: Gate) -> content.Table | None:
    """Drop of each run against the limit."""
    return content.ItemTable[Drop](
        "gate",
        f"Drops of {SYMBOL[gate.metric]} against the limit of {gate.limit:g}; the estimate decides.",
        [
            TableColumn("Run", text=True, of=lambda drop: load_words(drop.load, unknown=drop.label)),
            TableColumn("Drop", decimals=4, of=lambda drop: drop.value),
            TableColumn("Outcome", text=True, of=lambda drop: "failed" if drop.fails else "passed"),
            TableColumn(
                "95 % interval of the drop",
                of=lambda drop: (
                    "–" if (ends := drop.interval) is None else f"{number(ends[0], 4)} to {number(ends[1], 4)}"
                ),
            ),
            TableColumn("Against the limit", text=True, of=lambda drop: upper(interval_verdict(drop))),
        ],
        limit=LISTED_ROWS,
    ).of(gate.drops)


def _short(name: str, other: str) -> str:
    """Name of a side in the title: that of its file or folder alone, if the other side has another one."""
    last = Path(name).name
    return last if last and last != Path(other).name else name


def _tiles(found: Comparison) -> tuple[content.Tile, ...]:
    """The largest drop and the largest gain of the efficiency of the whole cascade."""
    rows = [] if found.overall is None else difference_rows(found, [found.overall])
    if not rows or found.overall is None:
        return ()
    low, high = min(rows, key=lambda row: row.of.value), max(rows, key=lambda row: row.of.value)
    chosen = {low.runs.label: low, high.runs.label: high}
    return tuple(
        content.Tile(
            f"{SYMBOL[found.overall]}",
            f"B − A at {run_label(row.runs)}",
            value_cell(row.of),
            f"95 %: {interval_cell(row.of)}",
        )
        for row in chosen.values()
    )


def _points(found: Comparison, gate: Gate | None, etas: Sequence[str]) -> list[content.Point]:
    both = (("A", found.alone_a), ("B", found.alone_b))
    alone = [f"{side}: {run_words([run.name for run in runs])}" for side, runs in both if runs]
    limit = "" if gate is None else gate_words(gate, SYMBOL[gate.metric])
    return [
        content.data_point([run.origin for run in (*found.a.runs, *found.b.runs)]),
        *([] if gate is None else [content.Point("Limit", f"{upper(limit)}.", "good" if gate.ok else "warn")]),
        *(content.Point("Difference", f"{significance(found, m, run_label)}.") for m in etas),
        content.Point("Sensors", f"{upper(sensors_words(found))}."),
        *([content.Point("Unmatched", f"{'; '.join(alone)}.", "warn")] if alone else []),
        *(
            content.Point(upper(note.kind.replace("_", " ")), f"{upper(note_words(note, len(found.runs)))}.", "warn")
            for note in found.notes
            if note.is_warning
        ),
    ]


PANEL = 1.02
"""Height of a panel: three of them fit below the summary of a page of A4. [in]"""

_HEAD, _GAP = 0.3, 0.34
"""Margin above the first panel, and space between two panels. [in]"""

MAX_DRAWN = 16
"""Runs in a panel at most; of more, an even selection."""

UPRIGHT, UPRIGHT_NARROW = 9, 4
"""Runs whose names stand under a panel as they are, in a figure of a page and in a narrow one; those of more are turned."""

_SHORT = 14


def difference_figure(found: Comparison, metrics: Sequence[str]) -> Figure | None:
    """Draw the differences of some efficiencies, each in a panel of its own, as their intervals differ in width."""
    if not metrics:
        return None
    runs = drawn(found)
    foot = 0.2 + max(map(text_width, _names(runs))) if _turned(len(runs)) else 0.5
    height = _HEAD + foot + PANEL * len(metrics) + _GAP * (len(metrics) - 1)
    margins = Margins(left=0.115, head=_HEAD, foot=foot)
    figure, axes = panel_figure(height, len(metrics), 1, margins=margins, gaps={"hspace": _GAP / PANEL}, share="x")
    draw_differences(axes, found, metrics)
    return figure


def _turned(runs: int) -> bool:
    """Whether names stand under a panel at an angle."""
    return runs > (UPRIGHT_NARROW if is_narrow() else UPRIGHT)


def drawn(found: Comparison) -> list[MatchedRuns]:
    """The runs that are drawn, from the heaviest load to the open circuit."""
    return evenly([*reversed(found.runs)], MAX_DRAWN)


def _names(runs: Sequence[MatchedRuns]) -> list[str]:
    """What runs are called under a panel: their loads, or their names, cut."""
    cut = cut_apart([run.label for run in runs], _SHORT)
    return [load_words(run.load, unknown=name) for run, name in zip(runs, cut, strict=True)]


def draw_differences(axes: Sequence[Axes], found: Comparison, metrics: Sequence[str]) -> None:
    """Draw one efficiency on each of some Axes; a marker is full where the interval excludes zero."""
    runs = drawn(found)
    for k, (ax, metric) in enumerate(zip(axes, metrics, strict=True)):
        look = _look(metric)
        ax.axhline(0.0, color=COLOURS["ink"], lw=0.8, zorder=1)
        for x, one in enumerate(r.of(metric) for r in runs):
            if one is None:
                continue
            low, high = one.interval or (math.nan, math.nan)
            full = COLOURS[look.colour] if one.excludes_zero else COLOURS["paper"]
            bars = None if one.interval is None else [[one.value - low], [high - one.value]]
            ax.errorbar(
                [x], [one.value], yerr=bars, color=COLOURS[look.colour], marker=look.mark, ms=5, mfc=full, mew=1.0,
                capsize=3, lw=1.1,
            )  # fmt: skip
        ax.set_xlim(-0.6, len(runs) - 0.4)
        ax.grid(axis="x", visible=False)
        ax.locator_params(axis="y", nbins=5)
        label_panel(ax, "abcdefghij"[k % 10], f"{tex(metric)} of B less that of A", y="B − A (1)")
    turn: Any = {"rotation": 90} if _turned(len(runs)) else {}
    axes[-1].set_xticks(range(len(runs)), _names(runs), **turn)
    axes[-1].set_xlabel("" if turn else "Load" if all(r.load is not None for r in runs) else "Run")


def _look(metric: str) -> Look:
    """Look of an efficiency: that of the stage that it leads to, of the whole cascade that of the line."""
    if metric in PAPER.ratios:
        return look_of({"eta_trans": "mech", "eta_gen": "gen", "eta_pto": "line"}[metric])
    return look_of(SYMBOL[metric].rpartition("→")[2])
