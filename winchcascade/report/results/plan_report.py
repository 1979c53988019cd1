"""What a plan states: the runs in the order in which they help, what is expected after each, and
from random runs.
"""

from __future__ import annotations

import math
from typing import Any

from winchcascade.core.version import __version__
from winchcascade.design.run_plan import RunPlan
from winchcascade.diagnosis.explain.planned_run import BACK, PlannedRun
from winchcascade.report.content import Column, Note, Report, section, table
from winchcascade.report.results.common import provenance
from winchcascade.report.results.effects import call_all
from winchcascade.report.wording import load_words


def plan_record(found: RunPlan) -> dict[str, Any]:
    """The plan as JSON: loads in ohm (`inf` for an open circuit), speeds in m/s."""
    about = {"pair": list(found.pair)} if found.pair is not None else {"metric": found.metric}
    return {
        "schema": "winchcascade/plan/1",
        "version": __version__,
        "title": found.title,
        "rig": found.rig,
        "runs": [
            {
                "load_ohm": "inf" if math.isinf(run.load) else run.load,
                "speed_mps": run.speed,
                "cycles": run.cycles,
            }
            | {"place": run.place}
            for run in found.runs
        ],
        "expected": [
            {**about, "runs": number, found.measure: value}
            for number, value in enumerate(found.expected, 1)
        ],
        "without": {found.measure: found.before},
        "wanted": {found.measure: found.wanted},
        "reached": found.reached,
        "known_together": [list(pair) for pair in found.together],
        "against_random": {found.measure: found.random, "share_that_reaches": found.random_share},
    }


def plan_report(found: RunPlan, *, command: str = "") -> Report:
    """Report of a plan."""
    what = call_all(found.pair, between=" from ") if found.pair is not None else f"{found.metric}"
    unit = "sigma" if found.measure == "z" else ""
    aim = f"separates {what}" if found.pair is not None else f"determines {what}"
    last = found.expected[-1] if found.expected else found.before
    reached = "is reached" if found.reached else "is not reached"
    return Report(
        kind="Plan of runs",
        title=f"{found.title}: what {aim}",
        subtitle=f"rig {found.rig}",
        points=[
            Note(f"{found.wanted:.3g} {unit}".rstrip() + f" is wanted and {reached}: {last:.3g}.", "Aim",
                 "plain" if found.reached else "warn"),
            Note(f"{found.before:.3g} without a further run.", "Now"),
            Note(
                f"As many runs at random give {found.random:.3g}; "
                f"{100.0 * found.random_share:.0f} % of them reach the aim.",
                "Random",
            ) if found.runs else None,
            *(Note(f"No run separates {call_all(pair, between=' from ')}: logs show their combination "
                   f"alone.", "Together", "warn") for pair in found.together),
        ],
        sections=[
            section("runs", "Runs", table("runs", _caption(found), _columns(found), list(enumerate(found.runs)))),
            provenance([("Length of a payout (m)", found.length)], command),
        ],
    )  # fmt: skip


def _caption(found: RunPlan) -> str:
    """What a run is, and what its place means."""
    return (
        f"Each run is one payout of {found.length:.1f} m and its haul-in at {BACK:g} of the "
        f"speed. Place: first, with "
        "a cold machine; last, after all other runs; any, light loads before heavy ones."
    )


def _columns(found: RunPlan) -> list[Column[tuple[int, PlannedRun]]]:
    head = "separation" if found.measure == "z" else f"u of {found.metric}"
    return [
        Column("run", lambda row: row[0] + 1, decimals=0),
        Column("load", lambda row: load_words(row[1].load, "ohm")),
        Column("speed", lambda row: row[1].speed, "m/s", 3),
        Column("place", lambda row: row[1].place),
        Column(head, lambda row: found.expected[row[0]]),
    ]
