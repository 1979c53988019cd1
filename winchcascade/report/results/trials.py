"""What a trial of the diagnosis states: counts of right and wrong names, what each effect was taken for, wrong cases."""

from __future__ import annotations

from statistics import median

from winchcascade.blind.cases import ORIGIN, SEALED
from winchcascade.blind.injected import INJECTED, OUTSIDERS
from winchcascade.blind.score import NOTHING, CaseScore, Count, Score, hidden_name
from winchcascade.blind.trial import TrialProgress
from winchcascade.core.campaign_file import Origin
from winchcascade.report.content import Column, Note, Report, Span, section, table
from winchcascade.report.results.common import data_note

HIDDEN = ("single", "pair")
"""Kinds of cases that hide effects of the catalogue."""

OUTCOMES = (
    ("effects named (cause or declared alternative, nothing beyond)", "named", HIDDEN),
    ("- single effects", "named", ("single",)),
    ("- pairs", "named", ("pair",)),
    ("misnamed", "misnamed", HIDDEN),
    ("silent: no gap seen", "silent", HIDDEN),
    ("abstained: gap unexplained", "abstained", HIDDEN),
    ("false alarms with nothing injected", "false_alarm", ("none",)),
    ("outsiders recognised", "recognised", ("outsider",)),
    ("outsiders not seen", "silent", ("outsider",)),
    ("outsiders taken for effects", "mistaken", ("outsider",)),
)
"""What is counted: words, outcome and kinds of cases."""

COUNTS: tuple[Column[tuple[str, Count]], ...] = (
    Column("counted", lambda row: row[0]),
    Column("cases", lambda row: f"{row[1].part} of {row[1].of}"),
    Column("share", lambda row: 100.0 * row[1].part / row[1].of, "%", 1),
    Column("95 % interval", lambda row: Span(*(100.0 * end for end in row[1].interval)), "%", 0),
)

TAKEN: tuple[Column[tuple[str, dict[str, int]]], ...] = (
    Column("injected", lambda row: row[0]),
    Column("cases", lambda row: sum(row[1].values())),
    Column("named", lambda row: row[1].get(row[0], 0)),
    Column("otherwise taken for (cases)", lambda row: _otherwise(row)),
)

CASES: tuple[Column[CaseScore], ...] = (
    Column("case", lambda case: case.case),
    Column(
        "injected", lambda case: " + ".join(f"{name} x {s:g}" for name, s in case.hidden.items()) or hidden_name(case)
    ),
    Column("outcome", lambda case: case.outcome.replace("_", " ")),
    Column("diagnosis", lambda case: _said(case)),
)


def trial_report(score: Score) -> Report:
    """Report of a scored trial."""
    wrong = [case for case in score.cases if not case.went_well and case.outcome != "missing"]
    made = len(score.cases) - score.missing.part
    known = [name for name in (NOTHING, *INJECTED, *OUTSIDERS) if name in score.taken_for]
    taken = [(name, score.taken_for[name]) for name in (*known, *sorted(score.taken_for.keys() - set(known)))]
    return Report(
        kind="Trial of the diagnosis",
        title=f"{len(score.cases)} cases with sealed answers, seed {score.seed}",
        points=[data_note([Origin(False, ORIGIN)]), Note(f"SHA-256 {score.sealed_sha256}", "Answers")],
        sections=[
            section("totals", "Outcome", table("totals", "What came of the cases.", COUNTS, _totals(score))),
            section(
                "strengths", "Single effects named, by strength",
                table("strengths", "Strength of full.", COUNTS, [(f"{s:g}", count) for s, count in score.strengths.items()]),
            ),
            section("closure", "Closure, computed again from the predictions", Note(_closure(score))),
            section("taken", "What each was taken for", table("taken", "Cases by what they hide.", TAKEN, taken)),
            section("cases", "Cases that were not named, misnamed or reported without a cause",
                    table("cases", "Cases that went wrong.", CASES, wrong)),
        ],
        verdict=Note(f"{made - len(wrong)} of {made} diagnoses are correct.", tone="plain" if wrong else "good"),
    )  # fmt: skip


def _totals(score: Score) -> list[tuple[str, Count]]:
    """Counts of the kinds of cases that the trial has, with their names."""
    counted = [(words, score.count(outcome, *kinds)) for words, outcome, kinds in OUTCOMES]
    counted[3:3] = [("named exactly, without an alternative", score.strict)]
    counted += [("true parameters within their 95 % intervals", score.coverage), ("without a diagnosis", score.missing)]
    return [row for row in counted if row[1].of]


def _said(case: CaseScore) -> str:
    """Verdict of a case, and its causes with their alternatives."""
    pairs = zip(case.causes, case.rivals, strict=True)
    causes = [f"{cause} (or {', '.join(rivals)})" if rivals else cause for cause, rivals in pairs]
    return ": ".join(filter(None, [(case.verdict or "not diagnosed").replace("_", " "), " + ".join(causes)]))


def _otherwise(row: tuple[str, dict[str, int]]) -> str:
    """What it was taken for instead, most cases first."""
    others = sorted(((name, n) for name, n in row[1].items() if name != row[0]), key=lambda one: -one[1])
    return ", ".join(f"{name} ({n})" for name, n in others) or "-"


def _closure(score: Score) -> str:
    """How much was closed where the effect was named, and how far the claims deviate."""
    shares = [100.0 * c.closure.share for c in score.cases if c.outcome == "named" and c.closure.share is not None]
    both = [(case.closure.share, case.share_claimed) for case in score.cases]
    apart = [100.0 * abs(found - said) for found, said in both if found is not None and said is not None]
    faults = sum(case.closure.fault is not None for case in score.cases)
    sentences = []
    if shares:
        least = f"median of {len(shares)} cases; {min(shares):.1f} % at least"
        sentences.append(
            f"Where the effect was named, {median(shares):.1f} % of the gap is closed on withheld logs ({least})."
        )
    if apart:
        sentences.append(
            f"The claims deviate by {median(apart):.1f} percentage points (median), {max(apart):.1f} at most."
        )
    if faults:
        sentences.append(f"{faults} cases have no usable predictions.")
    return " ".join(sentences) or "There is no prediction to compute it from."


def progress_report(done: TrialProgress, verb: str) -> Report:
    """Report of a call that dealt or diagnosed cases, as the verb states; nothing of the answers but their digest."""
    altered = f"as the content did not match the digest of the earlier call: {', '.join(done.altered)}"
    return Report(
        kind="Trial",
        title=f"{done.made} cases {verb}, {done.kept} were there already",
        points=[
            Note(f"{SEALED}, SHA-256 {done.sha256}", "Answers"),
            Note(altered, "Made again") if done.altered else None,
            *(Note(f"{name}: {fault}", "Failed", "warn") for name, fault in done.faults.items()),
        ],
    )
