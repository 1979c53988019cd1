"""A scored trial as text for the terminal: its counts, and for each case the injected and the diagnosed effects."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import median

from winchcascade.blind.cases import ORIGIN, SEALED
from winchcascade.blind.injected import INJECTED, OUTSIDERS
from winchcascade.blind.score import NOTHING, CaseScore, Count, Score, hidden_name
from winchcascade.blind.trial import TrialProgress
from winchcascade.core.campaign_file import Origin
from winchcascade.report.campaign_record import altered_lines
from winchcascade.report.screen import toned
from winchcascade.report.text_table import data_lines, file_lines, headed, indented, joined, table_lines, wrapped

HIDDEN = ("single", "pair")
"""Kinds of cases that hide effects of the catalogue."""


def totals(score: Score) -> list[tuple[str, Count]]:
    """Counts of a trial with their names, in the order of the report."""
    return [
        ("effects named (cause or declared alternative, nothing beyond)", score.count("named", *HIDDEN)),
        ("  single effects", score.count("named", "single")),
        ("  pairs", score.count("named", "pair")),
        ("named exactly, without an alternative", score.strict),
        ("misnamed", score.count("misnamed", *HIDDEN)),
        ("silent: no gap seen", score.count("silent", *HIDDEN)),
        ("abstained: left unexplained", score.count("abstained", *HIDDEN)),
        ("false alarms with nothing injected", score.count("false_alarm", "none")),
        ("outsiders recognised", score.count("recognised", "outsider")),
        ("outsiders not seen", score.count("silent", "outsider")),
        ("outsiders taken for effects", score.count("mistaken", "outsider")),
        ("true parameters within their 95 % intervals", score.coverage),
        ("without a diagnosis", score.missing),
    ]


def hidden_words(case: CaseScore) -> str:
    """What a case hides and how strongly."""
    return " + ".join(f"{name} x {strength:g}" for name, strength in case.hidden.items()) or hidden_name(case)


def said_words(case: CaseScore) -> str:
    """Verdict of a case, and its causes with their alternatives."""
    if case.verdict is None:
        return "not diagnosed"
    causes = [
        f"{cause} (or {', '.join(rivals)})" if rivals else cause
        for cause, rivals in zip(case.causes, case.rivals, strict=True)
    ]
    verdict = case.verdict.replace("_", " ")
    return f"{verdict}: {' + '.join(causes)}" if causes else verdict


WIDELY = 0.85
"""Share of a gap beyond which it counts as closed for the most part."""


def closure_sentence(score: Score) -> str:
    """How much was closed where the effect was named, computed again from the predictions, and how far the claims deviate."""
    named = [case.closure.share for case in score.of_kind(*HIDDEN) if case.outcome == "named"]
    shares = [share for share in named if share is not None]
    both = [(case.closure.share, case.share_claimed) for case in score.cases]
    apart = [100.0 * abs(found - said) for found, said in both if found is not None and said is not None]
    faults = sum(case.closure.fault is not None for case in score.cases)
    wide = sum(share > WIDELY for share in shares)
    sentences = (
        f"Where the effect was named, {share_text(median(shares))} of the gap is closed on withheld logs (median of "
        f"{len(shares)} cases; {share_text(min(shares))} at least; above {100 * WIDELY:g} % in {wide})."
        if shares
        else "",
        f"The claims deviate by {median(apart):.1f} percentage points (median), by {max(apart):.1f} at most."
        if apart
        else "",
        f"{faults} cases have no usable predictions." if faults else "",
    )
    return " ".join(filter(None, sentences)) or "There is no prediction to compute it from."


def share_text(value: float) -> str:
    """A share in percent with one decimal."""
    return f"{100.0 * value:.1f} %"


def count_cells(count: Count) -> tuple[str, str, str]:
    """A count, its share, and the 95 % interval of the share (Wilson)."""
    low, high = count.interval
    share = share_text(count.part / count.of) if count.of else ""
    return f"{count.part} of {count.of}", share, f"95 %: {100 * low:.0f} to {100 * high:.0f} %"


def hidden_order(score: Score) -> list[str]:
    """What is injected somewhere in a trial, in the order of the catalogue, then pairs, then outsiders."""
    found = score.taken_for
    single = [name for name in (NOTHING, *INJECTED, *OUTSIDERS) if name in found]
    return single + sorted(name for name in found if name not in single)


def taken_rows(score: Score) -> list[tuple[str, str, str, str]]:
    """By what was injected: how many cases, how many were named, and what the others were taken for."""
    return [
        (
            hidden,
            str(sum(row.values())),
            str(row.get(hidden, 0)),
            ", ".join(f"{name} ({n})" for name, n in sorted(row.items(), key=lambda x: -x[1]) if name != hidden) or "-",
        )
        for hidden, row in ((hidden, score.taken_for[hidden]) for hidden in hidden_order(score))
    ]


# -------------------------------------------------------------------------------------------------------- the terminal
def trial_text(score: Score, place: Path) -> str:
    """The counts of a trial, by strength too, and each case that was not named."""
    wrong = [case for case in score.cases if not case.went_well and case.outcome != "missing"]
    cases = [(f"  {c.case}", hidden_words(c), c.outcome.replace("_", " "), said_words(c)) for c in wrong]
    head = ("  injected", "cases", "named", "otherwise taken for (cases)")
    return joined(
        [
            *wrapped(f"trial {place}: {len(score.cases)} cases, seed {score.seed}", piped=None),
            *wrapped(f"answers: SHA-256 {score.sealed_sha256}", piped=None),
            *data_lines([Origin(False, ORIGIN)], None),
            "",
            *_aligned([(name, *count_cells(count)) for name, count in totals(score) if count.of], _COUNTS, _LESS),
            "",
            "single effects named, by strength:",
            *_aligned(
                [(f"  {strength:g}", *count_cells(count)) for strength, count in score.strengths.items()],
                _COUNTS,
                _LESS,
            ),
            "",
            "closure, computed again from the predictions:",
            *indented(closure_sentence(score)),
            "",
            "what each was taken for:",
            *_aligned([head, *((f"  {hidden}", *cells) for hidden, *cells in taken_rows(score))]),
            "",
            *(wrapped("cases that were not named, misnamed or reported without a cause:") if wrong else []),
            *(_aligned(cases, ("case", "injected", "outcome", "diagnosis"), ("injected",)) if wrong else []),
            *([] if wrong else [toned(_ALL_WELL, "good")]),
        ]
    )


_COUNTS, _LESS = ("counted", "cases", "share", "95 %"), ("95 %", "share")
"""Columns of counts, and those that are left out first."""

_ALL_WELL = "every diagnosis that was made is correct"


def dealt_text(done: TrialProgress, place: Path) -> str:
    """What a call of deal came to."""
    lines = [
        *wrapped(f"{place}: {done.made} cases dealt, {done.kept} were there already", piped=None),
        *wrapped(f"answers sealed in {SEALED}: SHA-256 {done.sha256}", piped=None),
    ]
    return joined(lines + _faults(done))


def diagnosed_text(done: TrialProgress, place: Path) -> str:
    """What a call of diagnose came to; nothing of the answers."""
    lines = wrapped(f"{place}: {done.made} cases diagnosed, {done.kept} were already", piped=None)
    lines += [*altered_lines(done.altered), *_faults(done)]
    return joined(lines) + file_lines("files:", [place / "diagnoses", place / "predictions"])


def faults_text(done: TrialProgress) -> str:
    """Cases that failed, and why."""
    return joined(_faults(done))


def _faults(done: TrialProgress) -> list[str]:
    found = (wrapped(f"failed: {name}: {fault}", piped=None) for name, fault in done.faults.items())
    return [line for lines in found for line in headed(lines, "failed", "contradiction")]


def _aligned(rows: Sequence[Sequence[str]], heads: Sequence[str] = (), omit: Sequence[str] = ()) -> list[str]:
    return table_lines(rows, left=range(len(rows[0])), heads=heads, omit=omit) if rows else ["  none"]
