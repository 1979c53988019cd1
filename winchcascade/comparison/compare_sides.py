"""Compare the reduced logs of two sides: match them, subtract their means, and note what limits the comparison."""

from __future__ import annotations

from msgspec.structs import replace

from winchcascade.comparison.comparability import comparison_notes
from winchcascade.comparison.compared_run import CompareError
from winchcascade.comparison.comparison_result import ComparedSide, Comparison
from winchcascade.comparison.differences import difference, shared_gains
from winchcascade.comparison.match import match_runs


def compare_sides(a: ComparedSide, b: ComparedSide, *, same_sensors: bool = False) -> Comparison:
    """Compare two sides: differences B - A of all metrics that both have, run by run, with 95 % intervals.

    Parameters
    ----------
    same_sensors : the same sensors, and the same drum, measured both sides: the errors of their gains are common and cancel
        as far as they change both means alike. Without it all sensors of A are independent of those of B.

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
        replace(runs, differences=tuple(d for m in metrics if (d := difference(m, runs.a, runs.b, shared=shared))))
        for runs in matched
    )
    if not any(runs.differences for runs in with_differences):
        raise CompareError(
            f"{a.name} and {b.name} have matching runs without a metric in common; expected an energy that both sides have. "
            "Check the stages of the rig files and the findings of the logs."
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
    names = {run.cascade.overall if len(run.cascade.stages) > 1 else None for run in (*a.runs, *b.runs)}
    return names.pop() if len(names) == 1 else None
