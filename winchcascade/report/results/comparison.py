"""What a comparison states: differences of both sides with intervals, their parts, what limits
them; their figure and their JSON.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
from msgspec.structs import replace

from winchcascade.comparison.comparability import rule_text
from winchcascade.comparison.compared_run import ComparedRun
from winchcascade.comparison.comparison_result import (
    ComparedSide,
    Comparison,
    ComparisonNote,
    MatchedRuns,
)
from winchcascade.comparison.differences import Difference
from winchcascade.comparison.gate import Drop, Gate
from winchcascade.core.campaign_file import joint_origin, origin_record
from winchcascade.core.cascade import field_of
from winchcascade.core.plain_text import first_of
from winchcascade.core.version import __version__
from winchcascade.report import content
from winchcascade.report.content import Column, Measured, Note, Span, Tile, section, shown
from winchcascade.report.figures.style import (
    COLOURS,
    cut_apart,
    draw_intervals,
    evenly,
    label_panel,
    look_of,
    panel_figure,
)
from winchcascade.report.glossary import metric, short, tex, typeset, upper
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.wording import banner, load_words

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NAMED_RUNS = 6
"""Runs that a sentence names."""


class Row(NamedTuple):
    """A difference, and the runs that it is of."""

    runs: MatchedRuns
    of: Difference

    @property
    def u(self) -> float | None:
        """Standard uncertainty that decides the digits."""
        return self.of.uncertainty or self.of.repeatability

    @property
    def interval(self) -> Span | None:
        """The 95 % interval, with so many digits that an end beyond zero is not rounded to zero."""
        if self.of.interval is None:
            return None
        u, nearest = self.u, min(map(abs, self.of.interval))
        while u and self.of.excludes_zero and not round(nearest, content.places(u)):
            u /= 10.0
        return Span(*self.of.interval, u)


def comparison_report(
    found: Comparison, gate: Gate | None = None, *, command: str = ""
) -> content.Report:
    """Report of a comparison; `gate` holds its drops against a limit."""
    etas, drawn = rows_of(found, "eta"), [*by_metric(rows_of(found, "eta", whole=False))]
    limit = (
        None
        if gate is None
        else Note(gate_words(gate), "Limit", "good" if gate.ok else "warn", brief=False)
    )
    return content.Report(
        kind="Comparison",
        title=f"{_name(found.b.name, found.a.name)} compared with "
              f"{_name(found.a.name, found.b.name)}",
        subtitle=f"B - A of {_count(found.runs, 'run')}, matched by "
                 f"{found.matched_by.replace('_', ' ')}",
        tiles=_tiles(found, etas),
        points=[limit, *_points(found, etas)],
        sections=[
            section(
                "efficiencies", "Efficiencies",
                content.Picture(
                    "differences",
                    f"B - A with 95 % intervals, {MAX_DRAWN} runs at most; full markers: the "
                    f"interval excludes zero.",
                    "Points with intervals about zero, one panel for each efficiency; the values "
                    "are in the table.",
                    partial(difference_figure, found, drawn),
                ) if drawn else None,
                differences_table("efficiencies", etas),
            ),
            section(
                "energies", "Energies",
                differences_table("energies", rows_of(found, "energy", whole=False)),
                differences_table("whole-cycles", rows_of(found, "energy", whole=True), brief=False),
                folded=bool(etas),
            ),
            section("limit", "Limit of a drop", None if gate is None else drops_table(gate)),
            section("logs", "Logs", _logs(found), folded=True),
            provenance([], command),
        ],
        verdict=limit,
        banner=banner([run.origin for run in (*found.a.runs, *found.b.runs)]),
    )  # fmt: skip


def rows_of(found: Comparison, *kinds: str, whole: bool | None = None) -> list[Row]:
    """Differences of some kinds of metrics, each over all runs: of whole cycles, of the windows,
    or of both (None).
    """
    cycles = {name for run in found.a.runs for name in run.cascade.net_metrics}
    metrics = [
        name for name in found.metrics if name.startswith(kinds) and whole in (None, name in cycles)
    ]
    return [
        Row(runs, one)
        for name in metrics
        for runs in found.runs
        if (one := runs.of(name)) is not None
    ]


def by_metric(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Rows by their metrics, as `rows_of` orders them."""
    return {name: list(found) for name, found in groupby(rows, key=lambda row: row.of.metric)}


DIFFERENCE: tuple[Column[Row], ...] = (
    Column("metric", lambda row: short(row.of.metric)),
    Column("run", lambda row: row.runs.label),
    Column("unit", lambda row: metric(row.of.metric).unit),
    Column("A", lambda row: Measured(row.of.a, row.u)),
    Column("B", lambda row: Measured(row.of.b, row.u)),
    Column("B - A", lambda row: Measured(row.of.value, row.u), signed=True),
    Column("95 % interval", lambda row: row.interval),
    Column(
        "B/A - 1",
        lambda row: row.of.relative and 100.0 * row.of.relative,
        "%",
        1,
        brief=False,
        signed=True,
    ),
    Column("excludes 0", lambda row: {True: "yes", False: "no", None: None}[row.of.excludes_zero]),
    Column(
        "u, cycles",
        lambda row: Measured(row.of.repeatability, row.of.repeatability),
        brief=False,
    ),
    Column(
        "u, sensors",
        lambda row: Measured(row.of.sensors, row.of.sensors),
        brief=False,
    ),
    Column("ν", lambda row: row.of.freedom, decimals=1, brief=False),
)
"""Means of both sides, their difference with its interval, and the parts of its uncertainty."""


def differences_table(name: str, rows: Sequence[Row], *, brief: bool = True) -> content.Table[Row]:
    """Means of both sides and their differences with intervals."""
    caption = f"{name.replace('-', ' ').capitalize()} of A and B, and their differences; u: standard uncertainty."
    return content.table(f"{name}-differences", caption, DIFFERENCE, rows, brief=brief)


def _logs(found: Comparison) -> content.Table[tuple[str, ComparedRun]]:
    """What decides whether logs can be compared."""
    columns: list[Column[tuple[str, ComparedRun]]] = [
        Column("side", lambda row: row[0]),
        Column("log", lambda row: row[1].name),
        Column("load", lambda row: load_words(row[1].load, "ohm", unknown="-")),
        Column("rig", lambda row: row[1].rig),
        Column("window", lambda row: rule_text(row[1])),
        Column("mean window", lambda row: row[1].window_length, "s", 2),
        Column("plateau", lambda row: row[1].speed, "m/s", 3),
        Column("findings", lambda row: row[1].findings),
    ]
    logs = [(name, run) for name, side in (("A", found.a), ("B", found.b)) for run in side.runs]
    return content.table(
        "logs", "Logs of both sides; plateau: mean of the payouts.", columns, logs, brief=False
    )


def drops_table(gate: Gate) -> content.Table[Drop]:
    """Drop of each run against the limit."""
    both = dict.fromkeys(("beyond_uncertain", "within_uncertain"), "contains the limit")
    columns: list[Column[Drop]] = [
        Column("run", lambda drop: drop.label),
        Column("drop", lambda drop: drop.value, decimals=4),
        Column("95 % interval", lambda drop: drop.interval and Span(*drop.interval), decimals=4),
        Column("outcome", lambda drop: "failed" if drop.fails else "passed"),
        Column("interval", lambda drop: drop.interval and both.get(drop.verdict, drop.verdict)),
    ]
    return content.table(
        "limit", f"Drops A - B of {gate.metric}, at most {gate.limit:g}.", columns, gate.drops
    )


def _name(name: str, other: str) -> str:
    """Name of a side in the title: that of its file or folder alone, if the other side has
    another one.
    """
    last = Path(name).name
    return last if last and last != Path(other).name else name


def _tiles(found: Comparison, etas: Sequence[Row]) -> list[Tile]:
    """The largest difference of each efficiency, that of the whole cascade first; four at most."""
    largest = [max(rows, key=lambda row: abs(row.of.value)) for rows in by_metric(etas).values()]
    return [
        Tile(
            row.of.metric,
            f"largest B - A, at {row.runs.label}",
            shown(Measured(row.of.value, row.u), signed=True),
            f"95 %: {shown(row.interval)}",
        )
        for row in sorted(largest, key=lambda row: row.of.metric != found.overall)[:4]
    ]


def _points(found: Comparison, etas: Sequence[Row]) -> list[Note]:
    """Both sides, what was found, and what limits it."""
    notes = [
        (f"{upper(_note_words(note, len(found.runs)))}.", note.is_warning) for note in found.notes
    ]
    alone = (("A", found.alone_a), ("B", found.alone_b))
    sensors = (
        "Independent; if the same sensors measured A and B, --same-sensors shares their gains."
    )
    if found.same_sensors:
        sensors = f"The same: A and B share the gains of {', '.join(found.shared) or 'no sensor'}, not the zeros."
    return [
        _side("A", found.a),
        _side("B", found.b),
        Note(_significance(etas), "Findings"),
        *(Note(text, "Warning", "warn") if warns else Note(text, "Note") for text, warns in notes),
        Note(sensors, "Sensors"),
        *(
            Note(
                f"{name}: {first_of([run.name for run in runs], NAMED_RUNS)}.", "Unmatched", "warn"
            )
            for name, runs in alone
            if runs
        ),
    ]


def _side(name: str, side: ComparedSide) -> Note:
    """Name of a side, its logs, and whether they are measured."""
    data = data_note([run.origin for run in side.runs])
    return replace(data, text=f"{name}: {side.name}, {_count(side.runs, 'log')}. {data.text}")


def _significance(etas: Sequence[Row]) -> str:
    """Of how many runs the interval of each efficiency excludes zero; empty without an interval."""
    judged = by_metric(row for row in etas if row.of.interval is not None).items()
    parts = [
        f"{name} in {sum(row.of.excludes_zero is True for row in rows)} of {len(rows)}"
        for name, rows in judged
    ]
    return f"Runs whose interval excludes zero: {', '.join(parts)}." if parts else ""


def _note_words(note: ComparisonNote, of: int) -> str:
    """A note with the runs that it concerns, where these are not all runs."""
    if note.details:
        pairs = zip(note.runs, note.details, strict=True)
        return f"{note.message} ({first_of([f'{run}: {detail}' for run, detail in pairs], NAMED_RUNS, '; ')})"
    return (
        note.message
        if len(note.runs) in (0, of)
        else f"{first_of(note.runs, NAMED_RUNS)}: {note.message}"
    )


def _count(items: Sequence[object], what: str) -> str:
    return f"{len(items)} {what}{'s' * (len(items) != 1)}"


def gate_words(gate: Gate) -> str:
    """The outcome of the gate in one sentence."""
    outcome = (
        f"{'passed' if gate.ok else 'failed'}: {gate.metric} drops by more than {gate.limit:g}"
    )
    without = (
        f"; {first_of(gate.without, NAMED_RUNS)} without {gate.metric}" if gate.without else ""
    )
    return f"{outcome} in {len(gate.failed) or 'none'} of {_count(gate.drops, 'run')}{without}."


MAX_DRAWN = 16
"""Runs in a panel at most, of more an even selection; names are turned where there are more than
half as many.
"""


def difference_figure(found: Comparison, metrics: Sequence[str]) -> Figure:
    """Draw the differences of some efficiencies from the heaviest load on, each in a panel of its
    own, as their intervals differ in width; full markers: the interval excludes zero.
    """
    figure, axes = panel_figure(0.5 + 1.1 * len(metrics), len(metrics), share="x")
    runs = evenly([*reversed(found.runs)], MAX_DRAWN)
    for k, (ax, name) in enumerate(zip(axes, metrics, strict=True)):
        place = name.rpartition("_")[2]
        look = look_of({"trans": "mech", "pto": "line"}.get(place, place))
        ax.axhline(0.0, color=COLOURS["ink"], lw=0.8, zorder=1)
        known = [(x, one) for x, run in enumerate(runs) if (one := run.of(name)) is not None]
        ends = [(one.value, *(one.interval or (math.nan, math.nan))) for _, one in known]
        excludes = [one.excludes_zero is True for _, one in known]
        draw_intervals(ax, [x for x, _ in known], ends, look._replace(dashes="-"), excludes)
        ax.set_xlim(-0.6, len(runs) - 0.4)
        ax.grid(axis="x", visible=False)
        ax.locator_params(axis="y", nbins=5)
        label_panel(ax, "abcdefghij"[k % 10], f"{tex(name)} of B less that of A", y="B - A (1)")
    names = [typeset(name) for name in cut_apart([run.label for run in runs], 14)]
    axes[-1].set_xticks(
        range(len(runs)), names, rotation=90 if len(runs) > MAX_DRAWN // 2 else 0, parse_math=False
    )
    return figure


def comparison_record(found: Comparison, gate: Gate | None = None) -> dict[str, Any]:
    """The comparison as it is written: inf is null there; differences are B - A, null where a
    side has no such mean.
    """
    return {
        "schema": "winchcascade/comparison/1",
        "version": __version__,
        "a": _side_record(found.a),
        "b": _side_record(found.b),
        "sensors": "same" if found.same_sensors else "independent",
        "shared_gains": found.shared,
        "matched_by": found.matched_by,
        "runs": [
            {
                "label": runs.label,
                "load_ohm": runs.load,
                "open_circuit": runs.load == math.inf,
                "a": _logs_record(runs.a),
                "b": _logs_record(runs.b),
                "differences": {field_of(m): (one := runs.of(m)) and difference_record(one) for m in found.metrics},
            }
            for runs in found.runs
        ],
        "unmatched": {"a": _logs_record(found.alone_a), "b": _logs_record(found.alone_b)},
        "notes": msgspec.to_builtins(found.notes),
        "gate": None if gate is None else {
            "metric": gate.metric,
            "max_drop": gate.limit,
            "ok": gate.ok,
            "drops": msgspec.to_builtins(gate.drops),
            "without": gate.without,
        },
    }  # fmt: skip


def difference_record(one: Difference) -> dict[str, Any]:
    """One difference; degrees of freedom are null where they are infinite."""
    row: dict[str, Any] = msgspec.to_builtins(one)
    del row["metric"]
    return row | {"degrees_of_freedom": None if one.freedom == math.inf else one.freedom}


def _side_record(side: ComparedSide) -> dict[str, Any]:
    data = origin_record(joint_origin([run.origin for run in side.runs]))
    return {"name": side.name, "logs": len(side.runs), "data": data}


def _logs_record(runs: Sequence[ComparedRun]) -> list[dict[str, Any]]:
    """What runs are called, and what decides whether they can be compared."""
    return [
        {
            "name": run.name,
            "load_ohm": run.load,
            "sha256": run.digest,
            "rig": run.rig,
            "measured": run.origin.measured,
            "simulated": run.simulated or None,
            "window": run.window,
            "window_s": run.window_length,
            "speed_mps": run.speed,
            "complete": run.complete,
            "findings": run.findings,
        }
        for run in runs
    ]
