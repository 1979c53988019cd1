"""A scored trial as text for the terminal, and as a report with its tables and figures."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade.blind.cases import ORIGIN
from winchcascade.blind.sealed_answers import SEALED
from winchcascade.core.campaign_file import Origin, banner, origin_words
from winchcascade.core.version import __version__
from winchcascade.report.campaign_text import altered_lines
from winchcascade.report.publish import publish
from winchcascade.report.report_model import Point, Report, Table, Tile
from winchcascade.report.trial_words import (
    HIDDEN,
    closure_sentence,
    closure_words,
    count_cells,
    hidden_words,
    said_words,
    taken_rows,
    totals,
)

if TYPE_CHECKING:
    from winchcascade.blind.score import Score
    from winchcascade.blind.trial import Progress


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


def dealt_text(done: Progress, place: Path) -> str:
    """What a call of deal came to."""
    made = len(done.cases) - done.kept - len(done.faults)
    lines = [f"{place}: {made} cases dealt, {done.kept} were there already"]
    lines += [f"answers sealed in {SEALED}: SHA-256 {done.sha256}"]
    return "\n".join(lines + _faults(done)) + "\n"


def diagnosed_text(done: Progress, place: Path) -> str:
    """What a call of diagnose came to; nothing of the answers."""
    made = len(done.cases) - done.kept - len(done.faults)
    lines = [f"{place}: {made} cases diagnosed, {done.kept} were already", *altered_lines(done.altered)]
    return "\n".join(lines + _faults(done)) + "\n"


def _faults(done: Progress) -> list[str]:
    return [f"failed: {name}: {fault}" for name, fault in done.faults.items()]


def _aligned(rows: Iterable[tuple[str, ...]]) -> list[str]:
    rows = list(rows)
    if not rows:
        return ["  none"]
    width = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return ["  ".join(text.ljust(width[k]) for k, text in enumerate(row)).rstrip() for row in rows]


def write_trial_reports(
    score: Score, *, html: Path | None, pdf: Path | None, command: str = "", force: bool = False
) -> None:
    """Write the report of a scored trial as a self-contained page, as a PDF, or both. Raises as `write_content`."""
    publish(make_trial_report(score, command=command), html=html, pdf=pdf, force=force)


def make_trial_report(score: Score, *, command: str = "") -> Report:
    """Make the rows and figures of the report of a trial."""
    from winchcascade.report import trial_tables as tables
    from winchcascade.report.report_parts import picture, section
    from winchcascade.report.style import house_style
    from winchcascade.report.trial_figures import coverage_figure, taken_figure

    with house_style():
        sections = (
            section("totals", "Outcome", tables.totals_table(score), tables.strengths_table(score)),
            section(
                "taken", "What each effect is taken for",
                picture(
                    taken_figure(score), "taken",
                    "How many cases of what was hidden (rows) were taken for what (columns): on the diagonal it was named, in "
                    "a frame it is wrong. Several: more than one effect was named. Pairs are in the table.",
                    "Matrix of counts; the same numbers are in the table below.",
                ),
                tables.taken_table(score),
            ),
            section(
                "parameters", "Numbers of the named effects",
                picture(
                    coverage_figure(score), "coverage",
                    "What was found of each named effect less the truth, over the size of the true change, with 95 % "
                    "intervals: of twenty intervals nineteen should hold the truth, which lies at zero.",
                    "Points with bars about zero; the numbers are in the table below.",
                ),
                tables.parameters_table(score),
            ),
            section("closure", "Share of the gap that was closed", tables.closure_table(score)),
            section("cases", "Cases", tables.cases_table(score)),
            section("provenance", "Provenance", _provenance(score, command)),
        )  # fmt: skip
    return Report(
        kind="Trial of the diagnosis",
        title=f"{len(score.cases)} cases with withheld answers",
        subtitle="Campaigns of an independent twin of the rig",
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(score),
        points=_points(score),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner([Origin(False, ORIGIN)]),
    )


def _tiles(score: Score) -> tuple[Tile, ...]:
    shown = (
        ("named", "hidden effects", score.count("named", *HIDDEN)),
        ("recognised", "causes outside the catalogue", score.count("recognised", "outsider")),
        ("covered", "true numbers in 95 % intervals", score.coverage),
    )
    return tuple(
        Tile(symbol, name, f"{count.part} of {count.of}", count_cells(count)[2])
        for symbol, name, count in shown
        if count.of
    )


def _points(score: Score) -> tuple[Point, ...]:
    wrong, alarms = score.count("misnamed", *HIDDEN), score.count("false_alarm", "none")
    silent, abstained = score.count("silent", *HIDDEN), score.count("abstained", *HIDDEN)
    points = [
        Point(
            "Wrong names",
            f"{wrong.part} of {wrong.of} cases with a hidden effect were given another name.",
            "warn" if wrong.part else "good",
        ),
        Point("Not named", f"{silent.part} were taken for no gap, {abstained.part} were left unexplained."),
        Point(
            "False alarms",
            f"{alarms.part} of {alarms.of} cases that hide nothing were said to have a gap.",
            "warn" if alarms.part else "good",
        ),
        Point("Gap closed", closure_sentence(score)),
    ]
    if score.missing.part:
        points.append(Point("Missing", f"{score.missing.part} of {score.missing.of} cases have no diagnosis.", "warn"))
    return tuple(points)


def _provenance(score: Score, command: str) -> Table:
    from winchcascade.report.report_parts import made_on, provenance_table

    return provenance_table(
        [
            ("SHA-256 of the sealed answers", score.sealed_sha256),
            ("Seed", str(score.seed)),
            ("Made by", f"winchcascade {__version__}"),
            ("Command", command),
            ("Made on", made_on()),
        ]
    )
