"""What makes the numbers of two sides unlike: windows, motions, kinds of data, stages, and what
is unknown of uncertainties.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from winchcascade.comparison.compared_run import ComparedRun, mean_of_known
from winchcascade.comparison.comparison_result import (
    ComparedSide,
    ComparisonNote,
    MatchedRuns,
    NoteKind,
)
from winchcascade.core.campaign_file import KINDS
from winchcascade.reduction.error_model import R_DRUM

LENGTH_SAME = 0.01
"""Relative difference of mean window lengths that is not reported: a rule such as `auto` follows
the motion. [1]
"""

SPEED_SAME = 0.02
"""Relative difference of mean plateau speeds that is not reported: a crane repeats its speed
within 1 %. [1]
"""

NoteText = Callable[[MatchedRuns], str | tuple[str, str]]
"""What is to be noted of matched runs, with what is found in these very runs; empty for nothing."""


def comparison_notes(
    a: ComparedSide,
    b: ComparedSide,
    matched: Sequence[MatchedRuns],
    *,
    same_sensors: bool,
    unlike: Sequence[str],
) -> tuple[ComparisonNote, ...]:
    """Notes on a comparison, those that question a difference first.

    Parameters
    ----------
    matched : runs with their differences
    unlike : sensors whose gains the rig files of both sides state differently
    """
    whole = MatchedRuns("", None, a.runs, b.runs)
    stages = _STAGES(whole)
    notes = [ComparisonNote("stages", stages)] if stages else []
    for kind, note_text in (*NOTES, *([_NOT_SPLIT] if same_sensors else [])):
        notes += _grouped(kind, note_text, matched)
    if same_sensors and unlike:
        text = (
            f"the rig files state different gains of {', '.join(unlike)}, so that they count as "
            "independent"
        )
        notes.append(ComparisonNote("shared_gains", text))
    return tuple(notes)


def _grouped(
    kind: NoteKind, note_text: NoteText, matched: Sequence[MatchedRuns]
) -> list[ComparisonNote]:
    """One note for each text, with all runs that it concerns."""
    found: dict[str, list[tuple[str, str]]] = {}
    for runs in matched:
        note = note_text(runs)
        text, detail = (note, "") if isinstance(note, str) else note
        if text:
            found.setdefault(text, []).append((runs.label, detail))
    return [
        ComparisonNote(
            kind, text, tuple(label for label, _ in of), tuple(detail for _, detail in of if detail)
        )
        for text, of in found.items()
    ]


# ------------------------------------------------------------------------ what differs in A and B
def _unlike(of: Callable[[ComparedRun], str], sentence: str) -> Callable[[MatchedRuns], str]:
    """A note on a text of the logs that differs between A and B; the sentence has a place {} for
    either.
    """

    def note_text(runs: MatchedRuns) -> str:
        ours, theirs = (" and ".join(dict.fromkeys(map(of, side))) for side in (runs.a, runs.b))
        return sentence.format(ours, theirs) if ours != theirs else ""

    return note_text


def _apart(
    of: Callable[[ComparedRun], float | None], same: float, unit: str, sentence: str
) -> NoteText:
    """A note on a quantity whose means over the logs of either side differ by more than a share
    `same`.
    """

    def note_text(runs: MatchedRuns) -> str | tuple[str, str]:
        ours, theirs = (mean_of_known([of(run) for run in side]) for side in (runs.a, runs.b))
        if not ours or not theirs or abs(theirs / ours - 1.0) <= same:
            return ""
        return sentence, f"{ours:.3g} {unit} in A, {theirs:.3g} {unit} in B"

    return note_text


def rule_text(run: ComparedRun) -> str:
    """Rule of the windows of a log, or their fixed length."""
    return run.window if isinstance(run.window, str) else f"{run.window:g} s"


def _lengths(runs: MatchedRuns) -> str | tuple[str, str]:
    """Windows of one rule whose lengths differ, as the motions do."""
    if len({run.window for run in (*runs.a, *runs.b)}) > 1 or not isinstance(runs.a[0].window, str):
        return ""
    sentence = (
        f"windows of the rule {runs.a[0].window} follow the motion and differ in length; energies "
        "grow with the window"
    )
    return _apart(lambda run: run.window_length, LENGTH_SAME, "s", sentence)(runs)


def _formulas(runs: MatchedRuns) -> str:
    """Energies that are made of unlike channels."""
    found = []
    for energy in runs.a[0].cascade.energies:
        ours, theirs = (
            _made_of(side, other, energy) for side, other in ((runs.a, runs.b), (runs.b, runs.a))
        )
        if ours and theirs and ours != theirs:
            sides = (" and ".join(sorted(names)) for names in (ours, theirs))
            found.append(f"{energy} is made of {' in A, of '.join(sides)} in B")
    return f"{'; '.join(found)}; a difference may be one of the sensors" if found else ""


def _made_of(
    side: Sequence[ComparedRun], other: Sequence[ComparedRun], energy: str
) -> frozenset[str]:
    """What the energy of a side is made of: the formula of its rig file, or channels whose
    accuracies both sides know.
    """
    stage, both = energy.removeprefix("energy_"), (*side, *other)
    if all(run.formulas.get(stage) for run in both):
        return frozenset(str(run.formulas[stage]) for run in side)
    unknown = frozenset({R_DRUM}).union(*(run.unknown for run in both))
    return frozenset().union(*(run.measures.get(energy, frozenset()) for run in side)) - unknown


# ----------------------------------------------------------------------- what limits a comparison
def _same_log(runs: MatchedRuns) -> str:
    common = {run.digest for run in runs.a} & {run.digest for run in runs.b} - {""}
    return "A and B have a log in common; its two reductions share all errors" if common else ""


def _data(runs: MatchedRuns) -> str:
    """Kinds of data that differ, and simulated logs."""
    found = _KINDS(runs)
    if any(run.simulated for run in (*runs.a, *runs.b)):
        model = (
            "a simulated log has no errors of sensors; the errors of its model are in no interval"
        )
        return f"{found}; {model}" if found else model
    return found


def _without_cycles(runs: MatchedRuns) -> str:
    names = [run.name for run in (*runs.a, *runs.b) if not run.complete]
    return f"no complete cycle in {' and '.join(names)}, so that it has no means" if names else ""


def _pooled(runs: MatchedRuns) -> str:
    many = len(runs.a) > 1 or len(runs.b) > 1
    return (
        f"cycles count together: {len(runs.a)} logs of A are pooled, and {len(runs.b)} of B"
        if many
        else ""
    )


def _repeatability(runs: MatchedRuns) -> str:
    """Sides of which the scatter of the cycles is unknown."""
    lacking = [
        name
        for name, side in (("A", runs.a), ("B", runs.b))
        if len(side) == 1 and not side[0].repeats
    ]
    if not lacking or not runs.differences:
        return ""
    return (
        f"the interval does not contain the repeatability of {' and '.join(lacking)}, which needs "
        "cycles that repeat"
    )


def _waves(runs: MatchedRuns) -> str:
    waves = any(run.cycles_from == "waves" for run in (*runs.a, *runs.b))
    return (
        "waves count as independent, although high ones follow each other; intervals may be too "
        "narrow"
        if waves
        else ""
    )


def _accuracy(runs: MatchedRuns) -> str:
    """Differences without an interval."""
    without = [one.metric for one in runs.differences if one.interval is None]
    if not without:
        return ""
    channels = sorted(frozenset().union(*(run.unknown for run in (*runs.a, *runs.b))))
    which = "any metric" if len(without) == len(runs.differences) else ", ".join(without)
    why = f" of {', '.join(channels)} under [sensors] of the rig file" if channels else ""
    return (
        f"no interval of {which} for lack of an accuracy{why}; that of the repeatability alone is "
        "in JSON and report"
    )


def _not_split(runs: MatchedRuns) -> str:
    """Logs whose JSON does not split gains from zeros."""
    names = []
    for run in (*runs.a, *runs.b):
        wanted = [one.metric for one in runs.differences if run.sensors.get(one.metric)]
        if not run.simulated and any(metric not in run.split for metric in wanted):
            names.append(run.name)
    whose = " and ".join(names)
    return (
        f"the JSON of {whose} does not split gains from zeros, so that none are shared; reduce "
        f"again"
        if names
        else ""
    )


_STAGES = _unlike(
    lambda run: ", ".join(run.cascade.names),
    "the stages of A are {}, those of B {}; the metrics of both are compared",
)
_KINDS = _unlike(
    lambda run: "simulated" if run.simulated else KINDS[run.origin.measured],
    "the logs of A are {}, those of B {}",
)
_NOT_SPLIT: tuple[NoteKind, NoteText] = ("shared_gains", _not_split)
NOTES: tuple[tuple[NoteKind, NoteText], ...] = (
    ("stages", _formulas),
    ("windows", _unlike(
        lambda run: run.cycles_from,
        "the cycles of A come from {}, those of B from {} ([phases] of the rig file), and cannot "
        "be compared",
    )),
    ("windows", _unlike(rule_text, "the windows of A are {}, those of B {}; reduce both with one "
                                   "window")),
    ("windows", _lengths),
    ("motion", _apart(
        lambda run: run.speed, SPEED_SAME, "m/s",
        "the plateau speeds of the payouts differ; energies, powers and efficiencies depend on "
        "the speed",
    )),
    ("same_log", _same_log),
    ("data", _data),
    ("rigs", _unlike(lambda run: run.rig, "A was reduced with the rig {}, B with {}")),
    ("cycles", _without_cycles),
    ("pooled", _pooled),
    ("repeatability", _repeatability),
    ("repeatability", _waves),
    ("accuracy", _accuracy),
)  # fmt: skip
"""What is noted of matched runs, in this order."""
