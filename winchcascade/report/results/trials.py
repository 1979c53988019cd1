"""What a trial of the diagnosis states: counts of right and wrong names, what each effect was
taken for, wrong cases.
"""

from __future__ import annotations

from winchcascade.blind.cases import ORIGIN
from winchcascade.blind.injected import INJECTED, OUTSIDERS
from winchcascade.blind.judge import NOTHING, CaseScore
from winchcascade.blind.score import FURTHER, OUTCOMES, Count, Score
from winchcascade.blind.trial import SEALED, TrialProgress
from winchcascade.core.campaign_file import Origin
from winchcascade.report.content import Column, Note, Report, Span, section, table
from winchcascade.report.results.common import data_note

COUNTS: tuple[Column[tuple[str, Count]], ...] = (
    Column("counted", lambda row: row[0]),
    Column("cases", lambda row: f"{row[1].part} of {row[1].of}"),
    Column("share", lambda row: 100.0 * row[1].part / row[1].of, "%", 1),
    Column("95 % interval", lambda row: Span(*(100.0 * end for end in row[1].interval_95)), "%", 0),
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
        "injected",
        lambda case: (
            " + ".join(f"{name} x {s:g}" for name, s in case.hidden.items()) or case.hidden_name
        ),
    ),
    Column("outcome", lambda case: case.outcome.replace("_", " ")),
    Column("diagnosis (!: certain)", lambda case: case.text),
    Column("honest answer", lambda case: case.answer or "-"),
)


def trial_report(score: Score) -> Report:
    """Report of a scored trial."""
    wrong = [case for case in score.diagnosed if not case.went_well]
    to_read = [case for case in score.diagnosed if case.outcome == "unjudged"]
    judged = len(score.diagnosed) - len(to_read)
    words = {name: words for name, (words, _, _) in OUTCOMES.items()} | FURTHER
    totals = [(words[name], counted) for name, counted in score.totals.items() if counted.of]
    known = [name for name in (NOTHING, *INJECTED, *OUTSIDERS) if name in score.taken_for]
    taken = [
        (name, score.taken_for[name])
        for name in (*known, *sorted(score.taken_for.keys() - set(known)))
    ]
    sealed = score.sealed_sha256 is not None
    return Report(
        kind="Trial of the diagnosis",
        title=f"{len(score.cases)} cases with " + (f"sealed answers, seed {score.seed}" if sealed else "a truth each"),
        points=[
            data_note([Origin(False, ORIGIN)]) if sealed else None,
            Note(f"SHA-256 {score.sealed_sha256}", "Answers") if sealed else None,
        ],
        sections=[
            section("totals", "Outcome", table("totals", "What came of the cases.", COUNTS, totals)),
            section(
                "strengths", "Single effects named, by strength",
                table("strengths", "Strength of full.", COUNTS, [(f"{count.strength:g}", count) for count in score.strengths]),
            ),
            section("taken", "What each was taken for", table("taken", "Cases by what they hide.", TAKEN, taken)),
            section("cases", "Cases that went wrong, or whose honest answer is in words alone",
                    table("cases", "Cases to read.", CASES, wrong + to_read)),
        ],
        verdict=Note(f"{judged - len(wrong)} of {judged} diagnoses are correct."
                     + (f" {len(to_read)} are to be judged by a reader." if to_read else ""),
                     tone="plain" if wrong else "good"),
    )  # fmt: skip


def _otherwise(row: tuple[str, dict[str, int]]) -> str:
    """What it was taken for instead, most cases first."""
    others = sorted(
        ((name, n) for name, n in row[1].items() if name != row[0]), key=lambda one: -one[1]
    )
    return ", ".join(f"{name} ({n})" for name, n in others) or "-"


def progress_report(done: TrialProgress, verb: str) -> Report:
    """Report of a call that dealt or diagnosed cases, as the verb states; nothing of the answers
    but their digest.
    """
    altered = (
        f"as the content did not match the digest of the earlier call: {', '.join(done.altered)}"
    )
    return Report(
        kind="Trial",
        title=f"{done.made} cases {verb}, {done.kept} were there already",
        points=[
            Note(f"{SEALED}, SHA-256 {done.sha256}", "Answers") if done.sha256 else None,
            Note(altered, "Made again") if done.altered else None,
            *(Note(f"{name}: {fault}", "Failed", "warn") for name, fault in done.faults.items()),
        ],
    )
