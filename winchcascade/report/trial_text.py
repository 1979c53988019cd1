"""A scored trial in words: its counts, what each case hides and what it was taken for; as text for the terminal."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, NamedTuple

from winchcascade.blind.cases import ORIGIN
from winchcascade.blind.injected import OUTSIDERS, PARTS
from winchcascade.blind.score import NOTHING, Count, Score, hidden_name
from winchcascade.blind.sealed_answers import SEALED
from winchcascade.core.campaign_file import Origin, origin_words
from winchcascade.report.campaign_text import altered_lines
from winchcascade.report.text_table import table_lines

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from winchcascade.blind.score import CaseScore
    from winchcascade.blind.trial import TrialProgress

HIDDEN = ("single", "pair")
"""Kinds of cases that hide effects of the catalogue."""


def totals(score: Score) -> list[tuple[str, Count]]:
    """Counts of a trial with their names, in the order of the report."""
    return [
        ("effects named (cause or declared rival, nothing beyond)", score.count("named", *HIDDEN)),
        ("  single effects", score.count("named", "single")),
        ("  pairs", score.count("named", "pair")),
        ("named exactly, no rival needed", score.strict),
        ("misnamed", score.count("misnamed", *HIDDEN)),
        ("silent: no gap seen", score.count("silent", *HIDDEN)),
        ("abstained: left unexplained", score.count("abstained", *HIDDEN)),
        ("false alarms with nothing hidden", score.count("false_alarm", "none")),
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
    """What was said of a case: its verdict, and the causes with their rivals."""
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


class Closing(NamedTuple):
    """Shares closed in the named cases, how far the claims of all cases are from them, and predictions that are of no use."""

    shares: tuple[float, ...]
    apart: tuple[float, ...]
    faults: int


def closing(score: Score) -> Closing:
    """How much was closed, as computed again from the predictions."""
    named = [c.closure.share for c in score.of_kind(*HIDDEN) if c.outcome == "named"]
    both = [(c.closure.share, c.share_claimed) for c in score.cases]
    return Closing(
        tuple(share for share in named if share is not None),
        tuple(abs(found - said) for found, said in both if found is not None and said is not None),
        sum(c.closure.fault is not None for c in score.cases),
    )


def closure_words(score: Score) -> str:
    """How much was closed where a cause was named, and how far the claims are from it; for the terminal."""
    shares, apart, faults = closing(score)
    words = []
    if shares:
        words.append(
            f"{share_text(median(shares))} in the middle of {len(shares)} named cases, above {share_text(WIDELY)} in "
            f"{sum(share > WIDELY for share in shares)} of them, {share_text(min(shares))} at least"
        )
    if apart:
        words.append(f"{share_text(median(apart))} from the claim in the middle, {share_text(max(apart))} at most")
    if faults:
        words.append(f"{faults} without usable predictions")
    return "; ".join(words) or "nothing to compute it from"


def closure_sentence(score: Score) -> str:
    """The same as sentences of a report."""
    shares, apart, faults = closing(score)
    text = ""
    if shares:
        wide = sum(share > WIDELY for share in shares)
        text += (
            f"Where the effect was named, {share_text(median(shares))} of the gap is closed on withheld logs (median of "
            f"{len(shares)} cases; {share_text(min(shares))} at least; above {100 * WIDELY:g} % in {wide}). "
        )
    if apart:
        text += (
            f"What the diagnosis claims is off by {100 * median(apart):.1f} percentage points (median), by "
            f"{100 * max(apart):.1f} at most. "
        )
    if faults:
        text += f"{faults} cases have no usable predictions. "
    return text.rstrip() or "No prediction is there to compute it from."


def share_text(value: float) -> str:
    """A share in percent with one decimal."""
    return f"{100.0 * value:.1f} %"


def count_cells(count: Count) -> tuple[str, str, str]:
    """A count, its share, and the 95 % interval of the share (Wilson)."""
    low, high = count.interval
    share = share_text(count.part / count.of) if count.of else ""
    return f"{count.part} of {count.of}", share, f"95 %: {100 * low:.0f} to {100 * high:.0f} %"


def hidden_order(score: Score) -> list[str]:
    """What is hidden somewhere in a trial, in the order of the catalogue, then pairs, then outsiders."""
    found = score.taken_for
    single = [name for name in (NOTHING, *PARTS, *OUTSIDERS) if name in found]
    return single + sorted(name for name in found if name not in single)


def taken_rows(score: Score) -> list[tuple[str, str, str, str]]:
    """By what was hidden: how many cases, how many were named, and what the others were taken for."""
    found = score.taken_for
    rows = []
    for hidden in hidden_order(score):
        row = found[hidden]
        others = [f"{name} ({n})" for name, n in sorted(row.items(), key=lambda x: -x[1]) if name != hidden]
        rows.append((hidden, str(sum(row.values())), str(row.get(hidden, 0)), ", ".join(others) or "-"))
    return rows


# -------------------------------------------------------------------------------------------------------- the terminal
def trial_text(score: Score, place: Path) -> str:
    """The counts of a trial, by strength too, and each case that was not named; 100 columns at most."""
    lines = [
        f"trial {place}: {len(score.cases)} cases, seed {score.seed}",
        f"answers: SHA-256 {score.sealed_sha256}",
        f"data: {origin_words([Origin(False, ORIGIN)])}",
        "",
    ]
    lines += _aligned([(name, *count_cells(count)) for name, count in totals(score) if count.of])
    lines += ["", "single effects named, by strength:"]
    lines += _aligned([(f"  {strength:g}", *count_cells(count)) for strength, count in score.strengths.items()])
    lines += ["", f"closure, computed again from the predictions: {closure_words(score)}"]
    lines += ["", "what each was taken for:"]
    rows = [("  hidden", "cases", "named", "otherwise taken for (cases)")]
    lines += _aligned([*rows, *((f"  {hidden}", *cells) for hidden, *cells in taken_rows(score))])
    wrong = [case for case in score.cases if not case.went_well and case.outcome != "missing"]
    if wrong:
        lines += ["", "cases that were not named, told wrongly or raised without a cause:"]
        lines += _aligned([(f"  {c.case}", hidden_words(c), c.outcome.replace("_", " "), said_words(c)) for c in wrong])
    else:
        lines += ["", "every case that was diagnosed was told rightly"]
    return "\n".join(lines) + "\n"


def dealt_text(done: TrialProgress, place: Path) -> str:
    """What a call of deal came to."""
    lines = [
        f"{place}: {done.made} cases dealt, {done.kept} were there already",
        f"answers sealed in {SEALED}: SHA-256 {done.sha256}",
    ]
    return "\n".join(lines + _faults(done)) + "\n"


def diagnosed_text(done: TrialProgress, place: Path) -> str:
    """What a call of diagnose came to; nothing of the answers."""
    lines = [f"{place}: {done.made} cases diagnosed, {done.kept} were already", *altered_lines(done.altered)]
    return "\n".join(lines + _faults(done)) + "\n"


def _faults(done: TrialProgress) -> list[str]:
    return [f"failed: {name}: {fault}" for name, fault in done.faults.items()]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    return table_lines(rows, left=range(len(rows[0]))) if rows else ["  none"]
