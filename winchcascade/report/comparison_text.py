"""A comparison: cells and sentences that terminal and report share, its text, and its record for JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec

from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import ComparedSide, Comparison, ComparisonNote, MatchedRuns
from winchcascade.comparison.differences import Difference
from winchcascade.comparison.gate import Drop, Gate
from winchcascade.core.campaign_file import joint_origin, origin_record, origin_words
from winchcascade.core.cascade import field_of
from winchcascade.core.plain_text import one_line
from winchcascade.core.version import __version__
from winchcascade.report.digits import NumberText, interval_text, number, places, stated, with_sign
from winchcascade.report.screen import PIPED, toned
from winchcascade.report.sheet import Limit, TableColumn
from winchcascade.report.text_table import headed, joined, listing, paragraphs, wrapped
from winchcascade.report.wording import SYMBOL, decimals_of, load_words, unit_of

LISTED = 6
"""Runs that a sentence names."""


class DifferenceRow(msgspec.Struct, frozen=True):
    """One row of a table: a difference, and the runs that it is of."""

    runs: MatchedRuns
    of: Difference


def difference_rows(found: Comparison, metrics: Sequence[str]) -> list[DifferenceRow]:
    """Rows of some metrics, each over all runs."""
    return [DifferenceRow(runs, one) for m in metrics for runs in found.runs if (one := runs.of(m)) is not None]


def digits_of(one: Difference) -> float | None:
    """Standard uncertainty that decides the digits of a difference; None where none is known."""
    return one.uncertainty or one.repeatability or None


def mean_cell(one: Difference, side: str) -> NumberText:
    """Mean of a side, with the digits of the difference."""
    return stated(one.a if side == "a" else one.b, digits_of(one), decimals_of(one.metric))


def value_cell(one: Difference) -> NumberText:
    """B - A with its sign."""
    return with_sign(stated(one.value, digits_of(one), decimals_of(one.metric)))


def difference_columns(name: str) -> list[TableColumn[DifferenceRow]]:
    """Columns of the means of both sides, and of their difference, under some name, with its interval."""
    return [
        TableColumn("A", of=lambda row: mean_cell(row.of, "a")),
        TableColumn("B", of=lambda row: mean_cell(row.of, "b")),
        TableColumn(name, of=lambda row: value_cell(row.of)),
        TableColumn("95 % interval", of=lambda row: interval_cell(row.of)),
    ]


def interval_cell(one: Difference) -> NumberText:
    """The 95 % interval; a dash without one."""
    u = digits_of(one)
    if one.interval is None:
        return number(None, 0)
    if not u:
        return number(one.value, decimals_of(one.metric))
    nearest = min(map(abs, one.interval))
    while one.excludes_zero and round(nearest, places(u)) == 0.0:  # an end that only rounding would make zero
        u /= 10.0
    return interval_text(*one.interval, u)


def zero_cell(one: Difference) -> str:
    """Whether the interval excludes zero."""
    return {True: "yes", False: "no", None: "–"}[one.excludes_zero]


def freedom_cell(one: Difference) -> str:
    """Effective degrees of freedom, rounded down as tables of Student's distribution are used."""
    freedom = one.freedom
    return "–" if freedom is None else "∞" if freedom > 1e4 else f"{math.floor(freedom + 1e-9)}"


def relative_cell(one: Difference) -> NumberText:
    """B - A in percent of A, with the digits of the difference."""
    share, u = one.relative, digits_of(one)
    if share is None:
        return number(None, 0)
    return with_sign(stated(100.0 * share, 100.0 * u / abs(one.a) if u else None, 2))


def run_label(runs: MatchedRuns) -> str:
    """Load of matched runs on a page, or their name where they have none."""
    return load_words(runs.load, unknown=runs.label)


def run_words(runs: Sequence[str]) -> str:
    """Names of some runs, of many the first.

    >>> run_words(("36 ohm", "18 ohm"))
    '36 ohm, 18 ohm'
    """
    more = f" and {len(runs) - LISTED} more" if len(runs) > LISTED else ""
    return ", ".join(map(one_line, runs[:LISTED])) + more


def note_words(note: ComparisonNote, of: int) -> str:
    """A note with the runs that it concerns, where these are not all runs."""
    if note.details:
        found = [f"{run}: {detail}" for run, detail in zip(note.runs, note.details, strict=True)]
        more = f"; {len(found) - LISTED} more" if len(found) > LISTED else ""
        return f"{note.message} ({one_line('; '.join(found[:LISTED]))}{more})"
    runs = "" if len(note.runs) in (0, of) and of > 1 else f"{run_words(note.runs)}: " if note.runs else ""
    return f"{runs}{note.message}"


def sensors_words(found: Comparison) -> str:
    """How the errors of the sensors of both sides count."""
    if not found.same_sensors:
        return "independent: errors of the sensors of A and B are unrelated (--same-sensors shares their gains)"
    if not found.shared:
        return "the same, but no gain has a stated accuracy that both sides share"
    return f"the same: A and B share the gains of {', '.join(found.shared)}; zeros are of each log alone"


MATCHED = {
    "load": "by load",
    "file": "by file name, as the logs have no load",
    "load_and_file": "by load, and by file name where there is no load",
    "only_log": "as the only log of each side, as they have no load",
}
"""How runs were matched, in words."""


def method_words() -> str:
    """How the intervals come about."""
    return (
        "t times the combined standard uncertainty of B - A (GUM, JCGM 100:2008, G.4). The scatter of the "
        "cycles (type A) counts with its degrees of freedom, errors of sensors (type B) with infinitely many; the effective "
        "degrees of freedom follow by Welch and Satterthwaite."
    )


def significance(found: Comparison, metric: str, label: Callable[[MatchedRuns], str] = lambda runs: runs.label) -> str:
    """Of how many runs the interval of a metric excludes zero; empty where none has the metric.

    Parameters
    ----------
    label : what runs are called
    """
    rows = difference_rows(found, [metric])
    stated_ = [row for row in rows if row.of.excludes_zero is not None]
    if not rows:
        return ""
    if not stated_:
        return f"{SYMBOL[metric]}: no interval is known"
    beyond = [row for row in stated_ if row.of.excludes_zero]
    named = f" ({run_words([label(row.runs) for row in beyond])})" if 0 < len(beyond) < len(stated_) else ""
    runs = f"{len(stated_)} run{'s' * (len(stated_) > 1)}"
    return f"{SYMBOL[metric]}: the interval excludes zero in {len(beyond)} of {runs}{named}"


def headline_metrics(found: Comparison) -> list[str]:
    """Efficiencies that both sides have in a matched run, neighbours first."""
    return [m for m in found.metrics if m.startswith("eta_") and any(runs.of(m) for runs in found.runs)]


def drawn_metrics(found: Comparison) -> list[str]:
    """Efficiencies of the windows, which the figure shows."""
    return [m for m in headline_metrics(found) if not any(m in run.cascade.net_metrics for run in found.a.runs)]


def other_metrics(found: Comparison) -> list[str]:
    """Energies and powers that both sides have in a matched run."""
    return [m for m in found.metrics if not m.startswith("eta_") and any(runs.of(m) for runs in found.runs)]


def of_windows(found: Comparison) -> list[str]:
    """Energies and powers of the integration windows among them."""
    whole = {metric for run in found.a.runs for metric in run.cascade.net_metrics}
    return [m for m in other_metrics(found) if m not in whole]


# ------------------------------------------------------------------------------------------------------------ the gate
_COMPATIBLE = {
    "beyond": "all of its interval {} lies beyond the limit",
    "beyond_uncertain": "its interval {} is compatible with a drop within the limit",
    "within": "all of its interval {} lies within the limit",
    "within_uncertain": "its interval {} is compatible with a drop beyond the limit",
    "no_interval_beyond": "its interval is unknown",
    "no_interval_within": "its interval is unknown",
}


def drop_words(drop: Drop, gate: Gate, metric: str = "") -> str:
    """One drop against the limit, and what its interval allows.

    Parameters
    ----------
    metric : what the efficiency is called, in place of its name in the JSON
    """
    interval = "" if drop.interval is None else f"{_fine(drop.interval[0])} to {_fine(drop.interval[1])}"
    verdict = "more than" if drop.fails else "not more than"
    compatible = _COMPATIBLE[drop.verdict].format(interval)
    drops = f"{metric or gate.metric} drops by {_fine(drop.value)}, {verdict} {gate.limit:g}"
    return f"{one_line(drop.label)}: {drops}; {compatible}"


def interval_verdict(drop: Drop) -> str:
    """What the interval of a drop allows, without its numbers.

    >>> interval_verdict(Drop("36 ohm", 36.0, 0.02, (0.01, 0.03), "within"))
    'all of its interval lies within the limit'
    """
    return " ".join(_COMPATIBLE[drop.verdict].format("").split())


def _fine(value: float) -> str:
    return f"{value + 0.0:.4f}"


def gate_words(gate: Gate, metric: str = "") -> str:
    """The outcome of the gate in one sentence; `metric` as `drop_words` has it."""
    name = metric or gate.metric
    runs = f"{len(gate.drops)} run{'s' * (len(gate.drops) != 1)}"
    without = f"; {run_words(gate.without)} without {name}" if gate.without else ""
    outcome, drops = ("passed", "none") if gate.ok else ("failed", f"{len(gate.failed)}")
    return f"{outcome}: {name} drops by more than {gate.limit:g} in {drops} of {runs}{without}"


LISTED_ROWS = Limit(60, "more, all in --json")
"""Differences that a table of the terminal lists."""

_LESS = ("freedom", "A, B", "unit")
"""Columns that are left out first: degrees of freedom, then the means."""

_COLUMNS: tuple[TableColumn[DifferenceRow], ...] = (
    TableColumn("metric", of=lambda row: row.of.metric),
    TableColumn("run", of=lambda row: one_line(row.runs.label)),
    TableColumn("unit", of=lambda row: unit_of(row.of.metric)),
    *difference_columns("B - A"),
    TableColumn("freedom", of=lambda row: freedom_cell(row.of)),
    TableColumn("excludes 0", of=lambda row: zero_cell(row.of)),
)


def comparison_text(found: Comparison, gate: Gate | None = None) -> str:
    """Differences of efficiencies, energies and powers with their intervals, notes, and what has no partner."""
    lines = [
        *(line for side in (found.a, found.b) for line in _side_lines(found, side)),
        *wrapped(f"runs: {len(found.runs)} matched {MATCHED[found.matched_by]}"),
        *wrapped(f"sensors: {sensors_words(found)}"),
        *wrapped(f"intervals: 95 %, {method_words()}"),
    ]
    lines += paragraphs(
        f"alone in {name}: {run_words([run.name for run in alone])}"
        for name, alone in (("A", found.alone_a), ("B", found.alone_b))
        if alone
    )
    for metrics in (headline_metrics(found), of_windows(found)):
        lines += ["", *_table(found, metrics)] if metrics else []
    more = len(of_windows(found)) < len(other_metrics(found))
    lines += ["energies of whole cycles: in --json and --html"] if more else []
    lines += ["", *paragraphs(_plain(significance(found, m), m) for m in headline_metrics(found))]
    for note in found.notes:
        mark = "! note" if note.is_warning else "note"
        text = wrapped(f"{mark}: {note_words(note, len(found.runs))}.")
        lines += headed(text, mark, "warning") if note.is_warning else text
    if gate is not None:
        outcome = wrapped(f"--max-drop {gate_words(gate)}")
        lines += ["", *_failed(gate), *(toned(line, "good" if gate.ok else "contradiction") for line in outcome)]
    return joined(lines)


def failed_text(gate: Gate) -> str:
    """The drops that are larger than the limit, one sentence each."""
    return joined(_failed(gate, piped=None))


def _failed(gate: Gate, piped: int | None = PIPED) -> list[str]:
    return [line for drop in gate.failed for line in wrapped(drop_words(drop, gate), piped=piped)]


def _plain(text: str, metric: str) -> str:
    """A sentence with the name of the metric that the table has in place of its symbol."""
    return metric + text[text.index(":") :] if ":" in text else text


def _side_lines(found: Comparison, side: ComparedSide) -> list[str]:
    """Name of a side, its logs, and whether they are measured."""
    logs = f"{len(side.runs)} log{'s' * (len(side.runs) != 1)}"
    data = one_line(origin_words([run.origin for run in side.runs]))
    text = wrapped(f"{'A' if side is found.a else 'B'}: {one_line(side.name)} ({logs}; {data})")
    return headed(text, "not measured", "warning")


def _table(found: Comparison, metrics: Sequence[str]) -> list[str]:
    rows = difference_rows(found, metrics)
    columns = _COLUMNS if any(unit_of(row.of.metric) for row in rows) else [c for c in _COLUMNS if c.name != "unit"]
    return listing(columns, rows, LISTED_ROWS, omit=_LESS)


COMPARISON_SCHEMA = "winchcascade/comparison/1"


def comparison_record(found: Comparison, gate: Gate | None = None) -> dict[str, Any]:
    """The comparison as it is written; differences are B - A in the unit of the name, null where a side has no such mean."""
    return {
        "schema": COMPARISON_SCHEMA,
        "version": __version__,
        "a": _side_record(found.a),
        "b": _side_record(found.b),
        "sensors": "same" if found.same_sensors else "independent",
        "shared_gains": list(found.shared),
        "matched_by": found.matched_by,
        "runs": [
            {
                "label": runs.label,
                "load_ohm": _ohms(runs.load),
                "open_circuit": runs.load is not None and math.isinf(runs.load),
                "a": [_log(run) for run in runs.a],
                "b": [_log(run) for run in runs.b],
                "differences": {
                    field_of(m): None if (one := runs.of(m)) is None else difference_record(one) for m in found.metrics
                },
            }
            for runs in found.runs
        ],
        "unmatched": {"a": [_log(run) for run in found.alone_a], "b": [_log(run) for run in found.alone_b]},
        "notes": [
            {"kind": note.kind, "message": note.message, "runs": list(note.runs), "details": list(note.details)}
            for note in found.notes
        ],
        "gate": None if gate is None else {
            "metric": gate.metric,
            "max_drop": gate.limit,
            "ok": gate.ok,
            "drops": [
                {"label": drop.label, "load_ohm": _ohms(drop.load), "drop": drop.value, "interval_95": drop.interval,
                 "verdict": drop.verdict}
                for drop in gate.drops
            ],
            "without": list(gate.without),
        },
    }  # fmt: skip


def difference_record(one: Difference) -> dict[str, Any]:
    """One difference; degrees of freedom are null where they are infinite."""
    freedom = one.freedom
    return {
        "a": one.a,
        "b": one.b,
        "difference": one.value,
        "relative": one.relative,
        "standard_uncertainty": one.uncertainty,
        "degrees_of_freedom": None if freedom is None or math.isinf(freedom) else freedom,
        "interval_95": one.interval,
        "excludes_zero": one.excludes_zero,
        "repeatability": one.repeatability,
        "sensors": one.sensors,
        "interval_95_repeatability": one.interval_repeatability,
        "cycles": [one.cycles_a, one.cycles_b],
    }


def difference_rows_of(found: Comparison) -> list[Mapping[str, Any]]:
    """A row for each difference, for frames."""
    return [
        {
            "run": runs.label,
            "load_ohm": runs.load,
            "metric": field_of(one.metric),
            **difference_record(one),
            **dict(zip(("low_95", "high_95"), one.interval or (None, None), strict=True)),
        }
        for runs in found.runs
        for one in runs.differences
    ]


def _side_record(side: ComparedSide) -> dict[str, Any]:
    return {
        "name": side.name,
        "logs": len(side.runs),
        "data": origin_record(joint_origin([run.origin for run in side.runs])),
    }


def _log(run: ComparedRun) -> dict[str, Any]:
    """What a run is called, and what decides whether it can be compared."""
    return {
        "name": run.name,
        "load_ohm": _ohms(run.load),
        "sha256": run.digest,
        "rig": run.rig,
        "measured": run.origin.measured,
        "simulated": True if run.simulated else None,
        "window": run.window,
        "window_s": run.window_length,
        "speed_mps": run.speed,
        "complete": run.complete,
        "findings": run.findings,
    }


def _ohms(load: float | None) -> float | None:
    return None if load is None or math.isinf(load) else load
