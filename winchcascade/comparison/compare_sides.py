"""Compare the reduced logs of two sides: match their runs, subtract their means, and note what
limits the comparison.
"""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from winchcascade.comparison.comparability import comparison_notes
from winchcascade.comparison.compared_run import ComparedRun, CompareError
from winchcascade.comparison.comparison_result import (
    ComparedSide,
    Comparison,
    MatchedBy,
    MatchedRuns,
)
from winchcascade.comparison.differences import difference, shared_gains
from winchcascade.core.plain_text import first_of
from winchcascade.core.quantity import load_text, same_load

LISTED = 8
"""Loads or names that a sentence lists."""


def compare_sides(a: ComparedSide, b: ComparedSide, *, same_sensors: bool = False) -> Comparison:
    """Compare two sides: differences B - A of all metrics that both have, run by run, with 95 %
    intervals.

    Parameters
    ----------
    same_sensors : the same sensors, and the same drum, measured both sides: the errors of their
        gains are common and cancel as far as they change both means alike. Without it all sensors
        of A are independent of those of B.

    Raises
    ------
    CompareError : no runs match, or the matched runs have no metric in common
    """
    matched, by = match_runs(a, b)
    of_a, of_b = ([run for runs in matched for run in getattr(runs, side)] for side in "ab")
    sharable, unlike = shared_gains(of_a, of_b)
    shared = sharable if same_sensors else frozenset()
    metrics = _common_metrics(a, b)
    with_differences = tuple(
        replace(
            runs,
            differences=tuple(
                d for m in metrics if (d := difference(m, runs.a, runs.b, shared=shared))
            ),
        )
        for runs in matched
    )
    if not any(runs.differences for runs in with_differences):
        raise CompareError(
            f"{a.name} and {b.name} have matching runs without a metric in common; expected an "
            "energy that both sides have. Check the stages of the rig files and the findings of "
            "the logs."
        )
    ours, theirs = ({id(run) for run in side} for side in (of_a, of_b))
    return Comparison(
        a=a,
        b=b,
        same_sensors=same_sensors,
        shared=tuple(sorted(shared)),
        matched_by=by,
        metrics=metrics,
        overall=_overall(a, b),
        runs=with_differences,
        alone_a=tuple(run for run in a.runs if id(run) not in ours),
        alone_b=tuple(run for run in b.runs if id(run) not in theirs),
        notes=comparison_notes(a, b, with_differences, same_sensors=same_sensors, unlike=unlike),
    )


def _common_metrics(a: ComparedSide, b: ComparedSide) -> tuple[str, ...]:
    """Metrics that a log of each side may have, in the order of the cascade of A."""
    theirs = {metric for run in b.runs for metric in run.cascade.all_metrics}
    return tuple(dict.fromkeys(m for run in a.runs for m in run.cascade.all_metrics if m in theirs))


def _overall(a: ComparedSide, b: ComparedSide) -> str | None:
    """Efficiency of the whole cascade, where all logs have the same one."""
    names = {
        run.cascade.overall if len(run.cascade.stages) > 1 else None for run in (*a.runs, *b.runs)
    }
    return names.pop() if len(names) == 1 else None


def match_runs(a: ComparedSide, b: ComparedSide) -> tuple[tuple[MatchedRuns, ...], MatchedBy]:
    """Match the logs of both sides, the repeats of one load together; in falling order of loads,
    names last.

    Two single logs without a load and with different names belong together: they were named as the
    two to be compared.

    Raises
    ------
    CompareError : no log of a side has the load or the name of one of the other side
    """
    if len(a.runs) == len(b.runs) == 1 and a.runs[0].load is None and b.runs[0].load is None:
        names = dict.fromkeys(run.file for run in (*a.runs, *b.runs))
        return (MatchedRuns(" and ".join(names), None, a.runs, b.runs),), "only_log"
    found = []
    for load, name in _keys(a.runs):
        ours, theirs = (tuple(run for run in side.runs if _is(run, load, name)) for side in (a, b))
        if theirs:
            found.append(MatchedRuns(name if load is None else load_text(load), load, ours, theirs))
    if not found:
        sides = " and ".join(f"{side.name} has {_listed(side.runs)}" for side in (a, b))
        raise CompareError(
            f"no runs match: {sides}; expected a load in common. A log without a load is matched "
            "by its file name; state loads by load_ohm in campaign.toml or --load-ohm of reduce."
        )
    by_load = [runs.load is not None for runs in found]
    return tuple(found), "load" if all(by_load) else "load_and_file" if any(by_load) else "file"


def _keys(runs: Sequence[ComparedRun]) -> list[tuple[float | None, str]]:
    """Loads in falling order, each once, then the names of logs without a load."""
    loads: list[float] = []
    for load in sorted((run.load for run in runs if run.load is not None), reverse=True):
        if not loads or not same_load(loads[-1], load):
            loads.append(load)
    names = {run.file.casefold(): run.file for run in runs if run.load is None}
    return [*((load, "") for load in loads), *((None, name) for name in names.values())]


def _is(run: ComparedRun, load: float | None, name: str) -> bool:
    """Whether a log has a load, or has none and has a name."""
    if load is None or run.load is None:
        return load is run.load and run.file.casefold() == name.casefold()
    return same_load(run.load, load)


def _listed(runs: Sequence[ComparedRun]) -> str:
    texts = [f"{name} (no load)" if load is None else load_text(load) for load, name in _keys(runs)]
    return first_of(texts, LISTED) or "no run"
