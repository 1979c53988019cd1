"""The report of a scored trial: its tables, and figures of confusions between effects and of errors of the numbers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from winchcascade.blind.cases import ORIGIN
from winchcascade.blind.score import (
    NO_GAP,
    NOTHING,
    UNEXPLAINED,
    CaseScore,
    Count,
    ParameterScore,
    Score,
    hidden_name,
    taken_as,
)
from winchcascade.core.campaign_file import Origin, banner
from winchcascade.report import sheet as content
from winchcascade.report.digits import MINUS, number, places, significant
from winchcascade.report.gap_words import display_of
from winchcascade.report.sheet import TableColumn, number_column, text_column
from winchcascade.report.style import COLOURS, Margins, house_style, legend_above, panel_figure
from winchcascade.report.trial_text import (
    HIDDEN,
    closure_sentence,
    count_cells,
    hidden_order,
    hidden_words,
    said_words,
    share_text,
    taken_rows,
    totals,
)


@house_style()
def make_trial_report(score: Score, *, command: str = "") -> content.Report:
    """Make the rows and figures of the report of a trial."""
    return content.Report(
        kind="Trial of the diagnosis",
        title=f"{len(score.cases)} cases with withheld answers",
        subtitle="Campaigns of an independent twin of the rig",
        tiles=_tiles(score),
        points=_points(score),
        sections=content.filled(
            content.section(
                "totals", "Outcome",
                _TOTALS.always([row for row in totals(score) if row[1].of]),
                _STRENGTHS.of([(f"{strength:g}", count) for strength, count in score.strengths.items()]),
            ),
            content.section(
                "taken", "What each effect is taken for",
                content.picture(
                    taken_figure(score), "taken",
                    "How many cases of each injected effect (rows) were taken for what (columns): on the diagonal it was "
                    "named, in a frame it is wrong. Several: more than one effect was named. Pairs are in the table.",
                    "Matrix of counts; the same numbers are in the table below.",
                ),
                _TAKEN.always(taken_rows(score)),
            ),
            content.section(
                "parameters", "Numbers of the named effects",
                content.picture(
                    coverage_figure(score), "coverage",
                    "What was found of each named effect less the truth, over the size of the true change, with 95 % "
                    "intervals: of twenty intervals nineteen should hold the truth, which lies at zero.",
                    "Points with bars about zero; the numbers are in the table below.",
                ),
                content.formatted_table(
                    "parameters", "Numbers of the effects that were named, beside the truth.", _PARAMETERS,
                    [(case.case, *_parameter(p)) for case in score.cases for p in case.parameters],
                ),
            ),
            content.section(
                "closure", "Share of the gap that was closed",
                _CLOSURES.of([c for c in score.cases if c.share_claimed is not None or c.closure.share is not None])
                or content.Note("No diagnosis claims to have closed anything."),
            ),
            content.section("cases", "Cases", _CASES.always(score.cases)),
            content.provenance_section(
                [("SHA-256 of the sealed answers", score.sealed_sha256), ("Seed", str(score.seed))], command
            ),
        ),
        banner=banner([Origin(False, ORIGIN)]),
    )  # fmt: skip


def _tiles(score: Score) -> tuple[content.Tile, ...]:
    shown = (
        ("named", "injected effects", score.count("named", *HIDDEN)),
        ("recognised", "causes outside the catalogue", score.count("recognised", "outsider")),
        ("covered", "true numbers in 95 % intervals", score.coverage),
    )
    return tuple(
        content.Tile(symbol, name, f"{count.part} of {count.of}", count_cells(count)[2])
        for symbol, name, count in shown
        if count.of
    )


def _points(score: Score) -> tuple[content.Point, ...]:
    wrong, alarms, missing = score.count("misnamed", *HIDDEN), score.count("false_alarm", "none"), score.missing
    silent, abstained = score.count("silent", *HIDDEN), score.count("abstained", *HIDDEN)
    return (
        content.Point(
            "Wrong names",
            f"{wrong.part} of {wrong.of} cases with an injected effect were given another name.",
            "warn" if wrong.part else "good",
        ),
        content.Point("Not named", f"{silent.part} were taken for no gap, {abstained.part} were left unexplained."),
        content.Point(
            "False alarms",
            f"{alarms.part} of {alarms.of} cases that hide nothing were said to have a gap.",
            "warn" if alarms.part else "good",
        ),
        content.Point("Gap closed", closure_sentence(score)),
        *(
            [content.Point("Missing", f"{missing.part} of {missing.of} cases have no diagnosis.", "warn")]
            if missing.part
            else []
        ),
    )


# ---------------------------------------------------------------------------------------------------------- the tables
def _count_columns(name: str, unit: str, cases: str) -> list[TableColumn[tuple[str, Count]]]:
    """What is counted, and the count with its share and the 95 % interval of that."""
    return [
        TableColumn(name, unit, text=True, of=lambda row: row[0].strip()),
        TableColumn(cases, of=lambda row: count_cells(row[1])[0]),
        TableColumn("Share", of=lambda row: count_cells(row[1])[1]),
        TableColumn("95 % interval", "Wilson", of=lambda row: count_cells(row[1])[2].removeprefix("95 %: ")),
    ]


_TOTALS = content.ItemTable(
    "totals",
    "What came of the cases.",
    _count_columns("Outcome", "", "Cases"),
    note="Misnamed: another effect was named; silent: no gap was seen; abstained: a gap was seen and left unexplained. "
    "Outsiders hide something that is not in the catalogue: they are recognised if their gap is not called explained.",
)

_STRENGTHS = content.ItemTable(
    "strengths",
    "Single effects named, by the strength of the effect.",
    _count_columns("Strength", "of full", "Named"),
    note="Full strength is the size at which an effect was chosen to stand clearly out of what is not known of the rig.",
)

_TAKEN = content.ItemTable[tuple[str, ...]](
    "taken",
    "What was injected, how often, how often it was named, and what it was taken for otherwise.",
    [
        TableColumn("Injected", text=True, of=lambda row: row[0]),
        TableColumn("Cases", of=lambda row: row[1]),
        TableColumn("Named", of=lambda row: row[2]),
        TableColumn("Otherwise taken for", "(cases)", text=True, of=lambda row: "–" if row[3] == "-" else row[3]),
    ],
    note=f"“{NO_GAP}” is right where nothing is injected, “{UNEXPLAINED}” where the cause is outside the catalogue.",
)

_PARAMETERS = (
    text_column("Case"), text_column("Effect"), text_column("What changes"), number_column("Truth"), number_column("Found"),
    number_column("95 % interval"), text_column("Holds the truth"),
)  # fmt: skip


def _parameter(p: ParameterScore) -> tuple[str, ...]:
    """Cells of a number: as a diagnosis reports it, with the digits that its interval allows."""
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


_CASE: tuple[TableColumn[CaseScore], ...] = (
    TableColumn("Case", text=True, of=lambda case: case.case),
    TableColumn("Injected", text=True, of=lambda case: hidden_words(case).replace(" x ", " × ")),
)

_CLOSURES = content.ItemTable[CaseScore](
    "closure",
    "Share of the explainable gap that was closed on withheld logs: as claimed, and from the predicted logs.",
    [
        *_CASE,
        TableColumn("Claimed", of=lambda case: _share(case.share_claimed)),
        TableColumn("Computed again", of=lambda case: case.closure.fault or _share(case.closure.share)),
    ],
    note="Computed from means over blocks of 0.4 s while the line moves, the zeros of the sensors sought alike before and "
    "after; the noise is that of the blocks themselves.",
)


def _share(value: float | None) -> str:
    return "–" if value is None else share_text(value)


_CASES = content.ItemTable[CaseScore](
    "cases",
    "Every case: what was injected, the outcome, and the diagnosis.",
    [
        *_CASE,
        TableColumn("Outcome", text=True, of=lambda case: case.outcome.replace("_", " ")),
        TableColumn("Diagnosis", text=True, of=said_words),
    ],
)


# --------------------------------------------------------------------------------------------------------- the figures
SEVERAL = "several"
"""Column of the cases that were taken for more than one effect."""


def taken_figure(score: Score) -> Figure | None:
    """Draw a matrix of counts: what was injected over what it was taken for; pairs are left to the table."""
    cases = score.of_kind("single", "none", "outsider")
    if not cases:
        return None
    hidden = {hidden_name(case) for case in cases}
    rows = [name for name in hidden_order(score) if name in hidden]
    columns = _columns(rows, {_column(case) for case in cases})
    counts, wrong = np.zeros((2, len(rows), len(columns)), dtype=int)
    for case in cases:
        place = rows.index(hidden_name(case)), columns.index(_column(case))
        counts[place] += 1
        wrong[place] += not case.went_well
    figure, (ax,) = panel_figure(1.5 + 0.145 * len(rows), margins=Margins(left=0.2, head=1.35, foot=0.1))
    for i, j in zip(*np.nonzero(counts), strict=True):
        colour = COLOURS["mech" if wrong[i, j] else "gen"]
        ax.scatter(j, i, s=52, marker="s", color=colour, alpha=0.35, linewidths=0)
        if wrong[i, j]:
            ax.scatter(j, i, s=52, marker="s", facecolors="none", edgecolors=colour, linewidths=1.0)
        ax.text(j, i, str(counts[i, j]), ha="center", va="center", fontsize=6.5, color=COLOURS["ink"])
    ax.set_xticks(range(len(columns)), columns, rotation=90, fontsize=6.5)
    ax.set_yticks(range(len(rows)), rows, fontsize=6.5)
    ax.xaxis.tick_top()
    ax.set(xlim=(-0.6, len(columns) - 0.4), ylim=(len(rows) - 0.4, -0.6))
    return figure


def _columns(rows: Sequence[str], taken: set[str]) -> list[str]:
    """Columns in the order of the rows, so that what is named stands on the diagonal."""
    named = [name for name in (NO_GAP if row == NOTHING else row for row in rows) if name in taken]
    last = [name for name in (SEVERAL, UNEXPLAINED) if name in taken]
    return [*named, *sorted(taken - set(named) - set(last)), *last]


def _column(case: CaseScore) -> str:
    taken = taken_as(case)
    return SEVERAL if " + " in taken else taken


def coverage_figure(score: Score) -> Figure | None:
    """Draw each diagnosed parameter with its interval, less the truth, over the size of the true change."""
    found = []
    for p in sorted((p for case in score.cases for p in case.parameters), key=lambda p: p.effect):
        if p.value is not None and p.low is not None and p.high is not None:
            size = abs(p.truth - (1.0 if p.parameter in ("n", "k_e_ratio_at_10_a") else 0.0))
            found.append((p.effect, p.covered, [(v - p.truth) / size for v in (p.value, p.low, p.high)]))
    if not found:
        return None
    figure, (ax,) = panel_figure(2.6, margins=Margins(head=0.234, foot=0.936))
    for k, (_, covered, (value, low, high)) in enumerate(found):
        colour = COLOURS["gen" if covered else "mech"]
        ax.plot([k, k], [low, high], color=colour, linewidth=1.1)
        ax.plot([k], [value], marker="o" if covered else "x", markersize=2.6, color=colour)
    ax.axhline(0.0, color=COLOURS["soft"], linewidth=0.6)
    kinds = (("gen", "o", "interval holds the truth"), ("mech", "x", "does not"))
    legend_above(
        figure, [(Line2D([], [], color=COLOURS[c], lw=1.1, marker=m, markersize=3.5), text) for c, m, text in kinds]
    )
    names = [row[0] for row in found]
    firsts = [k for k, name in enumerate(names) if k == 0 or names[k - 1] != name]
    ax.set_xticks(firsts, [names[k] for k in firsts], rotation=90, fontsize=6.0)
    ax.set_ylabel(f"(found {MINUS} true) / size (1)")
    return figure
