"""Diagnose a winch without a model: which losses and inertia between line and shaft explain its mechanical power."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.jobs import linear_algebra_on_one_thread
from winchcascade.diagnosis.diagnosis_result import (
    HALF,
    MOSTLY,
    NAMED,
    DiagnosisResult,
    Entries,
    Reported,
    Verdict,
    Where,
)
from winchcascade.diagnosis.line.line_causes import again_alone, line_causes, plan
from winchcascade.diagnosis.line.line_closure import LineClosure, LineRemainder, judge, left_in, map_of
from winchcascade.diagnosis.line.line_data import Lines, lines_of
from winchcascade.diagnosis.line.line_selection import Choice, Moments, choose, moments_of, with_best_span

if TYPE_CHECKING:
    from collections.abc import Callable

    from winchcascade.core.rig_file import Rig
    from winchcascade.diagnosis.suspects import Suspects

NOISY = 1.25
"""Root mean square of the residual, in its white noise, below which it is not significant."""


class LineDiagnosis(DiagnosisResult, frozen=True, kw_only=True):
    """A diagnosis of a winch without a model.

    `places` map the gap phase by phase; `again` are the numbers of the causes as the withheld cycles alone give them.
    """

    lines: Lines
    moments: Moments
    choice: Choice
    closure: LineClosure | None = None
    remainder: LineRemainder | None = None
    again: dict[str, Reported]


@linear_algebra_on_one_thread()
def diagnose_line(
    entries: Entries,
    rig: Rig,
    suspects: Suspects,
    *,
    seed: int = 0,
    on_progress: Callable[[str], None] = lambda _: None,
) -> LineDiagnosis:
    """Diagnose logs of line tension, speed and mechanical power, of a rig for which no model can be made.

    Parameters
    ----------
    entries : runs; if none is withheld, causes are chosen on all cycles and each is left out of the fit once
    suspects : effects by name that may be named; those that act between line and shaft count
    seed : of the resampling of cycles
    on_progress : called with a sentence on each step

    Raises
    ------
    CampaignError, LogError, OptionError : something cannot be used; the message names it
    """
    entries.check_withheld()
    on_progress("taking the samples that count")
    lines = with_best_span(lines_of(entries, rig, suspects))
    on_progress("leaving each cycle out in turn")
    moments = moments_of(lines.fitted)
    choice = choose(lines, moments, seed)
    closure = judge(lines, moments, choice.chosen, seed) if choice.chosen else None
    on_progress("looking for alternative explanations")
    causes = line_causes(lines, moments, choice, suspects)
    if closure is None:
        remainder = left_in(lines.parts, [part.gap for part in lines.parts], 1.0)
    else:
        remainder = left_in(closure.parts, closure.after, max(1.0 - closure.share, 0.0))
    verdict = _verdict(closure, remainder)
    causes = causes if verdict == "explained" else causes[:NAMED]
    places, no_gap = map_of(lines.parts), verdict == "no_gap"
    most = max(places, key=lambda place: place.share)
    return LineDiagnosis(
        title=entries.title,
        rig=rig,
        seed=seed,
        runs=tuple(part.run for part in lines.parts),
        suspects={name: suspects[name] for name in lines.names},
        verdict=verdict,
        where=None if no_gap else Where(causes[0].stage if causes else "transmission", most),
        chosen=choice.chosen,
        causes=causes,
        closure=closure,
        remainder=None if no_gap else remainder,
        experiment=plan(lines, moments, choice, [cause.effect for cause in causes]),
        sets=dict(choice.probability),
        lines=lines,
        moments=moments,
        choice=choice,
        places=places,
        again=again_alone(lines, choice.chosen),
    )


def _verdict(closure: LineClosure | None, remainder: LineRemainder) -> Verdict:
    """Explained when at least `MOSTLY` is closed and no structure remains, or when the residual is no more than noise."""
    if closure is None:
        return "unexplained" if remainder.alarms else "no_gap"
    quiet = closure.power.after < NOISY * closure.power.noise
    if not remainder.alarms and (quiet or closure.share >= MOSTLY):
        return "explained"
    return "partly_explained" if closure.share >= HALF or not remainder.alarms else "unexplained"
