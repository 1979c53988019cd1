"""Diagnose a winch without a model: which losses and inertia between line and shaft explain its mechanical power."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, Where
from winchcascade.diagnosis.line.line_causes import again_alone, causes_of
from winchcascade.diagnosis.line.line_closure import LineClosure, LineRemainder, judge, left_in
from winchcascade.diagnosis.line.line_data import Lines, lines_of
from winchcascade.diagnosis.line.line_gap import map_of, worst
from winchcascade.diagnosis.line.line_next_run import plan
from winchcascade.diagnosis.line.line_selection import Choice, Moments, choose, moments_of, with_best_span
from winchcascade.diagnosis.rules import HALF, MOSTLY, NAMED, check_withheld

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run
    from winchcascade.diagnosis.diagnosis_result import Reported, Verdict
    from winchcascade.diagnosis.suspects import Suspects

NOISY = 1.25
"""What is left is not significant if its root mean square is below this many times the white noise in it."""


class LineDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis of a winch without a model.

    `places` map the gap phase by phase; `again` are the numbers of the causes as the withheld cycles alone give them.
    """

    lines: Lines
    moments: Moments
    choice: Choice
    closure: LineClosure | None
    remainder: LineRemainder | None
    again: dict[str, Reported]


def diagnose_line(
    runs: Sequence[Run],
    rig: Rig,
    suspects: Suspects,
    *,
    title: str = "",
    cycles: Sequence[tuple[int, int] | None] | None = None,
    withheld: Sequence[int] = (),
    seed: int = 0,
    tell: Callable[[str], None] = lambda _: None,
) -> LineDiagnosis:
    """Diagnose logs of line force, speed and mechanical power, of a rig for which no model can be made.

    Parameters
    ----------
    suspects : effects by name that may be named; those that act between line and shaft count
    cycles : of each run, the first and last cycle that count, None for all
    withheld : numbers of runs that take part in neither choice nor fit; without any, causes are chosen on all cycles and each
        is left out of the fit once
    seed : of the resampling of cycles
    tell : is told what is being done

    Raises
    ------
    CampaignError, LogError, OptionError : something cannot be used; the message says what
    """
    check_withheld(runs, cycles, withheld, title)
    tell("taking the samples that count")
    lines = with_best_span(lines_of(runs, rig, suspects, cycles or [None] * len(runs), withheld))
    tell("leaving each cycle out in turn")
    moments = moments_of(lines.fitted)
    choice = choose(lines, moments, seed)
    judged = judge(lines, moments, choice.chosen, seed) if choice.chosen else None
    tell("looking for rivals")
    causes = causes_of(lines, moments, choice, suspects)
    left = left_of(lines, judged)
    verdict = verdict_of(judged, left)
    causes = causes if verdict == "explained" else causes[:NAMED]
    places = map_of(lines.parts)
    where = Where(causes[0].stage if causes else "transmission", worst(places))
    return LineDiagnosis(
        title=title,
        rig=rig,
        seed=seed,
        runs=tuple(part.run for part in lines.parts),
        suspects={name: suspects[name] for name in lines.names},
        verdict=verdict,
        where=None if verdict == "no_gap" else where,
        chosen=choice.chosen,
        causes=causes,
        closure=judged,
        remainder=None if verdict == "no_gap" else left,
        experiment=plan(lines, moments, choice, [cause.effect for cause in causes]),
        sets=dict(choice.probability),
        lines=lines,
        moments=moments,
        choice=choice,
        places=places,
        again=again_alone(lines, choice.chosen),
    )


def left_of(lines: Lines, judged: LineClosure | None) -> LineRemainder:
    """What the causes leave on the parts that they are judged on, or without a cause the whole gap."""
    if judged is None:
        return left_in(lines.parts, [part.gap for part in lines.parts], 1.0)
    return left_in(judged.parts, judged.after, max(1.0 - judged.share, 0.0))


def verdict_of(judged: LineClosure | None, left: LineRemainder) -> Verdict:
    """Verdict: explained when at least `MOSTLY` is closed and no structure is left, or what is left is no more than noise."""
    if judged is None:
        return "unexplained" if left.alarms else "no_gap"
    quiet = judged.power.after < NOISY * judged.power.noise
    if not left.alarms and (quiet or judged.share >= MOSTLY):
        return "explained"
    return "partly_explained" if judged.share >= HALF or not left.alarms else "unexplained"
