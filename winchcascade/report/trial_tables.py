"""Tables of the report of a scored trial."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.blind.score import NO_GAP, UNEXPLAINED, Count
from winchcascade.report.diagnosis_names import display_of
from winchcascade.report.digits import number, places, significant
from winchcascade.report.report_model import Note, Table
from winchcascade.report.trial_words import count_cells, hidden_words, said_words, share_text, taken_rows, totals

if TYPE_CHECKING:
    from winchcascade.blind.score import CaseScore, ParameterScore, Score


def totals_table(score: Score) -> Table:
    """What came of all cases."""
    rows = [(name.strip(), *_cells(count)) for name, count in totals(score) if count.of]
    return Table(
        id="totals",
        caption="What came of the cases.",
        head=("Outcome", "Cases", "Share", "95 % interval"),
        units=("", "", "", "Wilson"),
        rows=tuple(rows),
        note="Misnamed: another effect was named; silent: no gap was seen; abstained: a gap was seen and left unexplained. "
        "Outsiders hide something that is not in the catalogue: they are recognised if their gap is not called explained.",
    )


def strengths_table(score: Score) -> Table | None:
    """Single effects that were named, by strength; None without any."""
    rows = tuple((f"{strength:g}", *_cells(count)) for strength, count in score.strengths.items())
    if not rows:
        return None
    return Table(
        id="strengths",
        caption="Single effects named, by the strength of the effect.",
        head=("Strength", "Named", "Share", "95 % interval"),
        units=("of full", "", "", "Wilson"),
        rows=rows,
        note="Full strength is the size at which an effect was chosen to stand clearly out of what is not known of the rig.",
    )


def taken_table(score: Score) -> Table:
    """What each hidden effect was taken for."""
    return Table(
        id="taken",
        caption="What was hidden, how often, how often it was named, and what it was taken for otherwise.",
        head=("Hidden", "Cases", "Named", "Otherwise taken for"),
        units=("", "", "", "(cases)"),
        rows=tuple((*cells, "–" if others == "-" else others) for *cells, others in taken_rows(score)),
        text_columns=(0, 3),
        note=f"“{NO_GAP}” is right where nothing is hidden, “{UNEXPLAINED}” where the cause is outside the catalogue.",
    )


def parameters_table(score: Score) -> Table | None:
    """Numbers of the named effects beside the truth; None without any."""
    rows = [(case.case, *_parameter(p)) for case in score.cases for p in case.parameters]
    if not rows:
        return None
    return Table(
        id="parameters",
        caption="Numbers of the effects that were named, beside the truth.",
        head=("Case", "Effect", "What changes", "Truth", "Found", "95 % interval", "Holds the truth"),
        units=("",) * 7,
        rows=tuple(rows),
        text_columns=(0, 1, 2, 6),
    )


def _parameter(p: ParameterScore) -> tuple[str, ...]:
    """Cells of a number: as a diagnosis tells it, with the digits that its interval allows."""
    how = display_of(p.effect, p.parameter)
    what = f"{how.what}, {how.unit}" if how.unit else how.what
    if p.value is None or p.low is None or p.high is None:
        return (p.effect, what, significant(p.truth * how.factor), "–", "–", "no")
    u = (p.high - p.low) / 3.92 * how.factor
    truth, value, low, high = (
        number(x * how.factor, places(u)) if u > 0.0 else significant(x * how.factor)
        for x in (p.truth, p.value, p.low, p.high)
    )
    return (p.effect, what, truth, value, f"{low} to {high}", "yes" if p.covered else "no")


def _cells(count: Count) -> tuple[str, str, str]:
    """Cells of a count under a head that says that the interval is one of 95 %."""
    part, share, interval = count_cells(count)
    return part, share, interval.removeprefix("95 %: ")


def _hidden(case: CaseScore) -> str:
    return hidden_words(case).replace(" x ", " × ")


def closure_table(score: Score) -> Table | Note:
    """How much each diagnosis closed, as claimed and as computed again."""
    rows = []
    for case in score.cases:
        if case.share_claimed is None and case.closure.share is None:
            continue
        claimed = "–" if case.share_claimed is None else share_text(case.share_claimed)
        found = case.closure.fault or ("–" if case.closure.share is None else share_text(case.closure.share))
        rows.append((case.case, _hidden(case), claimed, found))
    if not rows:
        return Note("No diagnosis claims to have closed anything.")
    return Table(
        id="closure",
        caption="Share of the explainable gap that was closed on withheld logs: as claimed, and from the predicted logs.",
        head=("Case", "Hidden", "Claimed", "Computed again"),
        units=("",) * 4,
        rows=tuple(rows),
        text_columns=(0, 1),
        note="Computed from means over blocks of 0.4 s while the line moves, the zeros of the sensors sought alike before and "
        "after; the noise is that of the blocks themselves.",
    )


def cases_table(score: Score) -> Table:
    """Every case."""
    rows = [(c.case, _hidden(c), c.outcome.replace("_", " "), said_words(c)) for c in score.cases]
    return Table(
        id="cases",
        caption="Every case: what was hidden, what came of it, and what was said.",
        head=("Case", "Hidden", "Outcome", "Said"),
        units=("",) * 4,
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3),
    )
