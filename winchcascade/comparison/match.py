"""Match the logs of two sides: by load, those without a load by their file names."""

from __future__ import annotations

from collections.abc import Sequence

from winchcascade.comparison.compared_run import ComparedRun, CompareError
from winchcascade.comparison.comparison_result import ComparedSide, MatchedBy, MatchedRuns
from winchcascade.core.published_table import load_text, same_load

LISTED = 8
"""Loads or names that a sentence lists."""

Key = float | str
"""Load of a log, or its file name where it has none."""


def match_runs(a: ComparedSide, b: ComparedSide) -> tuple[tuple[MatchedRuns, ...], MatchedBy]:
    """Match the logs of both sides, the repeats of one load together; in falling order of loads, names last.

    Two single logs without a load and with different names belong together: they were named as the two to be compared.

    Raises
    ------
    CompareError : no log of a side has the load or the name of one of the other side
    """
    only = [*a.runs, *b.runs]
    if len(a.runs) == len(b.runs) == 1 and all(run.load is None for run in only):
        names = dict.fromkeys(run.file for run in only)
        return (MatchedRuns(" and ".join(names), None, a.runs, b.runs),), "only_log"
    found = []
    for key in _keys(a.runs):
        ours, theirs = (tuple(run for run in side.runs if _is(run, key)) for side in (a, b))
        if theirs:
            load = key if isinstance(key, float) else None
            found.append(MatchedRuns(load_text(key) if isinstance(key, float) else key, load, ours, theirs))
    if not found:
        raise CompareError(_nothing(a, b))
    by_load = [runs.load is not None for runs in found]
    return tuple(found), "load" if all(by_load) else "load_and_file" if any(by_load) else "file"


def _keys(runs: Sequence[ComparedRun]) -> list[Key]:
    """Loads in falling order, each once, then the names of logs without a load."""
    loads: list[float] = []
    for load in sorted((run.load for run in runs if run.load is not None), reverse=True):
        if not loads or not same_load(loads[-1], load):
            loads.append(load)
    return [*loads, *{run.file.casefold(): run.file for run in runs if run.load is None}.values()]


def _is(run: ComparedRun, key: Key) -> bool:
    """Whether a log has a load, or has none and has a name."""
    if isinstance(key, float):
        return run.load is not None and same_load(run.load, key)
    return run.load is None and run.file.casefold() == key.casefold()


def _nothing(a: ComparedSide, b: ComparedSide) -> str:
    """The sentence on two sides without a load or a name in common."""
    lacking = [run for run in (*a.runs, *b.runs) if run.load is None]
    what = (
        "A log without a load is matched by its file name; state loads by load_ohm in campaign.toml or --load-ohm of reduce."
        if lacking
        else "Compare logs of the same load."
    )
    return (
        f"no run of {a.name} matches a run of {b.name}: A has {_listed(a.runs)}, B has {_listed(b.runs)}; expected a load in "
        f"common. {what}"
    )


def _listed(runs: Sequence[ComparedRun]) -> str:
    texts = [load_text(key) if isinstance(key, float) else f"{key} (no load)" for key in _keys(runs)]
    more = f" and {len(texts) - LISTED} more" if len(texts) > LISTED else ""
    return (", ".join(texts[:LISTED]) + more) or "no run"
