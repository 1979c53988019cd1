"""A comparison in the terminal: differences run by run, what limits them, and the outcome of a limit."""

from __future__ import annotations

from collections.abc import Sequence

from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import ComparedSide, Comparison
from winchcascade.comparison.gate import Gate
from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.report.comparison_words import (
    MATCHED,
    DifferenceRow,
    difference_columns,
    difference_rows,
    drop_words,
    freedom_cell,
    gate_words,
    headline_metrics,
    method_words,
    note_words,
    of_windows,
    other_metrics,
    run_words,
    sensors_words,
    significance,
    unit_cell,
    zero_cell,
)
from winchcascade.report.screen import PIPED, toned
from winchcascade.report.table_model import Limit, TableColumn
from winchcascade.report.text_table import headed, listing, wrapped

LISTED_ROWS = Limit(60, "more, all in --json")
"""Differences that a table of the terminal lists."""

_LESS = ("freedom", "A, B", "unit")
"""Columns that are left out first: degrees of freedom, then the means."""

_COLUMNS: tuple[TableColumn[DifferenceRow], ...] = (
    TableColumn("metric", of=lambda row: row.of.metric),
    TableColumn("run", of=lambda row: one_line(row.runs.label)),
    TableColumn("unit", of=lambda row: unit_cell(row.of)),
    *difference_columns("B - A"),
    TableColumn("freedom", of=lambda row: freedom_cell(row.of)),
    TableColumn("excludes 0", of=lambda row: zero_cell(row.of)),
)


def comparison_text(found: Comparison, gate: Gate | None = None) -> str:
    """Differences of efficiencies, energies and powers with their intervals, notes, and what has no partner."""
    lines = [
        *(line for side in (found.a, found.b) for line in _side(found, side)),
        *wrapped(f"runs: {len(found.runs)} matched {MATCHED[found.matched_by]}"),
        *wrapped(f"sensors: {sensors_words(found)}"),
        *wrapped(f"intervals: 95 %, {method_words()}"),
    ]
    for name, alone in (("A", found.alone_a), ("B", found.alone_b)):
        lines += wrapped(f"alone in {name}: {_names(alone)}") if alone else []
    for metrics in (headline_metrics(found), of_windows(found)):
        lines += ["", *_table(found, metrics)] if metrics else []
    more = len(of_windows(found)) < len(other_metrics(found))
    lines += ["energies of whole cycles: in --json and --html"] if more else []
    lines += [""] + [line for m in headline_metrics(found) for line in wrapped(_plain(significance(found, m), m))]
    for note in found.notes:
        mark = "! note" if note.is_warning else "note"
        text = wrapped(f"{mark}: {note_words(note, len(found.runs))}.")
        lines += headed(text, mark, "warning") if note.is_warning else text
    if gate is not None:
        lines += ["", *_failed(gate)]
        lines += [
            toned(line, "good" if gate.ok else "contradiction") for line in wrapped(f"--max-drop {gate_words(gate)}")
        ]
    return "\n".join(lines) + "\n"


def failed_text(gate: Gate) -> str:
    """The drops that are larger than the limit, one sentence each."""
    return "".join(f"{line}\n" for line in _failed(gate, piped=None))


def _failed(gate: Gate, piped: int | None = PIPED) -> list[str]:
    return [line for drop in gate.failed for line in wrapped(drop_words(drop, gate), piped=piped)]


def _plain(text: str, metric: str) -> str:
    """A sentence with the name of the metric that the table has in place of its symbol."""
    return metric + text[text.index(":") :] if ":" in text else text


def _side(found: Comparison, side: ComparedSide) -> list[str]:
    """Name of a side, its logs, and whether they are measured."""
    logs = f"{len(side.runs)} log{'s' * (len(side.runs) != 1)}"
    data = one_line(origin_words([run.origin for run in side.runs]))
    text = wrapped(f"{'A' if side is found.a else 'B'}: {one_line(side.name)} ({logs}; {data})")
    return headed(text, "not measured", "warning")


def _names(runs: Sequence[ComparedRun]) -> str:
    return run_words([run.name for run in runs])


def _table(found: Comparison, metrics: Sequence[str]) -> list[str]:
    rows = difference_rows(found, metrics)
    columns = _COLUMNS if any(unit_cell(row.of) for row in rows) else [c for c in _COLUMNS if c.name != "unit"]
    return listing(columns, rows, LISTED_ROWS, omit=_LESS)
