"""A scored trial as text for the terminal, and as a report with its tables and figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from winchcascade import __version__
from winchcascade.blind.envelope import SEALED
from winchcascade.blind.hidden import OUTSIDERS, PARTS
from winchcascade.blind.tally import NO_GAP, NOTHING, UNEXPLAINED, Count, Score, hidden_name
from winchcascade.order import median
from winchcascade.report.layout import Note, Point, Report, Table, Tile
from winchcascade.report.publish import publish

if TYPE_CHECKING:
    from winchcascade.blind.tally import CaseScore
    from winchcascade.blind.trial import Progress

_HIDDEN = ("single", "pair")


def trial_text(score: Score, place: Path) -> str:
    """The counts of a trial, by strength too, and each case that was not named; 100 columns at most."""
    lines = [
        f"trial {place}: {len(score.cases)} cases, seed {score.seed}",
        f"answers: SHA-256 {score.sealed_sha256}",
        "",
    ]
    lines += _aligned([(name, *_count_cells(count)) for name, count in totals(score) if count.of])
    lines += ["", "single effects named, by strength:"]
    lines += _aligned([(f"  {strength:g}", *_count_cells(count)) for strength, count in score.strengths.items()])
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
    lines = [f"{place}: {made} cases diagnosed, {done.kept} were already"]
    return "\n".join(lines + _faults(done)) + "\n"


def _faults(done: Progress) -> list[str]:
    return [f"failed: {name}: {fault}" for name, fault in done.faults.items()]


def totals(score: Score) -> list[tuple[str, Count]]:
    """Counts of a trial with their names, in the order in which they are told."""
    return [
        ("effects named (cause or declared rival, nothing beyond)", score.count("named", *_HIDDEN)),
        ("  single effects", score.count("named", "single")),
        ("  pairs", score.count("named", "pair")),
        ("named exactly, no rival needed", score.strict),
        ("misnamed", score.count("misnamed", *_HIDDEN)),
        ("silent: no gap seen", score.count("silent", *_HIDDEN)),
        ("abstained: left unexplained", score.count("abstained", *_HIDDEN)),
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


def closure_words(score: Score) -> str:
    """How much was closed where a cause was named, and how far the claims are from it."""
    named = [c for c in score.of_kind(*_HIDDEN) if c.outcome == "named" and c.closure.share is not None]
    shares = [c.closure.share for c in named if c.closure.share is not None]
    faults = sum(c.closure.fault is not None for c in score.cases)
    words = []
    if shares:
        words.append(
            f"{_share(_median(shares))} in the middle of {len(shares)} named cases, above {_share(WIDELY)} in "
            f"{sum(share > WIDELY for share in shares)} of them, {_share(min(shares))} at least"
        )
    both = [(c.closure.share, c.share_claimed) for c in score.cases]
    apart = [abs(found - said) for found, said in both if found is not None and said is not None]
    if apart:
        words.append(f"{_share(_median(apart))} from the claim in the middle, {_share(max(apart))} at most")
    if faults:
        words.append(f"{faults} without usable predictions")
    return "; ".join(words) or "nothing to compute it from"


def _median(values: Sequence[float]) -> float:
    import numpy as np

    return median(np.array(values))


def _share(value: float) -> str:
    return f"{100.0 * value:.1f} %"


def _count_cells(count: Count) -> tuple[str, ...]:
    low, high = count.interval
    share = _share(count.part / count.of) if count.of else ""
    return f"{count.part} of {count.of}", share, f"95 %: {100 * low:.0f} to {100 * high:.0f} %"


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
    from winchcascade.report.document import picture, section
    from winchcascade.report.style import house_style
    from winchcascade.report.trial_figures import coverage_figure, taken_figure

    with house_style():
        sections = (
            section("totals", "Outcome", _totals_table(score), _strength_table(score)),
            section(
                "taken", "What each effect is taken for",
                picture(
                    taken_figure(score), "taken",
                    "Cases by what was hidden (rows) and what they were taken for (columns); on the diagonal what was named.",
                    "Matrix of counts; the same numbers are in the table below.",
                ),
                _taken_table(score),
            ),
            section(
                "parameters", "Parameters of the named effects",
                picture(
                    coverage_figure(score), "coverage",
                    "Diagnosed parameters and their 95 % intervals, less the truth, over the size of the true change.",
                    "Points with bars about zero; the numbers are in the table below.",
                ),
                _parameter_table(score),
            ),
            section("closure", "Share of the gap that was closed", _closure_table(score)),
            section("cases", "Cases", _case_table(score)),
            section("provenance", "Provenance", _provenance(score, command)),
        )  # fmt: skip
    return Report(
        kind="Trial of the diagnosis",
        title=f"{len(score.cases)} cases with withheld answers",
        subtitle="Campaigns of an independent twin of the rig; nothing in them was measured.",
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(score),
        points=_points(score),
        sections=tuple(s for s in sections if s.blocks),
    )


def _tiles(score: Score) -> tuple[Tile, ...]:
    shown = (
        ("named", "hidden effects", score.count("named", *_HIDDEN)),
        ("recognised", "causes outside the catalogue", score.count("recognised", "outsider")),
        ("covered", "true parameters in their intervals", score.coverage),
    )
    return tuple(
        Tile(symbol, name, f"{count.part} of {count.of}", _count_cells(count)[2])
        for symbol, name, count in shown
        if count.of
    )


def _points(score: Score) -> tuple[Point, ...]:
    wrong, alarms = score.count("misnamed", *_HIDDEN), score.count("false_alarm", "none")
    silent, abstained = score.count("silent", *_HIDDEN), score.count("abstained", *_HIDDEN)
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
        Point("Closure", f"Computed again from the predictions: {closure_words(score)}."),
    ]
    if score.missing.part:
        points.append(Point("Missing", f"{score.missing.part} of {score.missing.of} cases have no diagnosis.", "warn"))
    return tuple(points)


def _totals_table(score: Score) -> Table:
    rows = [(name.strip(), *_count_cells(count)) for name, count in totals(score) if count.of]
    return Table(
        id="totals",
        caption="What came of the cases.",
        head=("Outcome", "Cases", "Share", "Interval"),
        units=("", "", "", "Wilson"),
        rows=tuple(rows),
    )


def _strength_table(score: Score) -> Table | None:
    rows = tuple((f"{strength:g}", *_count_cells(count)) for strength, count in score.strengths.items())
    if not rows:
        return None
    return Table(
        id="strengths",
        caption="Single effects named, by the strength of the effect.",
        head=("Strength", "Named", "Share", "Interval"),
        units=("of full", "", "", "Wilson"),
        rows=rows,
        note="Full strength is the size at which an effect was chosen to stand clearly out of what is not known of the rig.",
    )


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


def _taken_table(score: Score) -> Table:
    return Table(
        id="taken",
        caption="What was hidden, how often, how often it was named, and what it was taken for otherwise.",
        head=("Hidden", "Cases", "Named", "Otherwise taken for"),
        units=("", "", "", "(cases)"),
        rows=tuple((*cells, "–" if others == "-" else others) for *cells, others in taken_rows(score)),
        text_columns=(0, 3),
        note=f"“{NO_GAP}” is right where nothing is hidden, “{UNEXPLAINED}” where the cause is outside the catalogue.",
    )


def _parameter_table(score: Score) -> Table | None:
    rows = []
    for case in score.cases:
        for p in case.parameters:
            said = ("–", "–") if p.value is None else (f"{p.value:.4g}", f"{p.low:.4g} to {p.high:.4g}")
            rows.append((case.case, p.effect, p.parameter, f"{p.truth:.4g}", *said, "yes" if p.covered else "no"))
    if not rows:
        return None
    return Table(
        id="parameters",
        caption="Parameters of the effects that were named, beside the truth, in the units of the catalogue.",
        head=("Case", "Effect", "Parameter", "Truth", "Diagnosed", "95 % interval", "Holds it"),
        units=("",) * 7,
        rows=tuple(rows),
        text_columns=(0, 1, 2, 6),
    )


def _closure_table(score: Score) -> Table | Note:
    rows = []
    for case in score.cases:
        if case.share_claimed is None and case.closure.share is None:
            continue
        claimed = "–" if case.share_claimed is None else _share(case.share_claimed)
        found = case.closure.fault or ("–" if case.closure.share is None else _share(case.closure.share))
        rows.append((case.case, hidden_words(case), claimed, found))
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


def _case_table(score: Score) -> Table:
    rows = [(c.case, hidden_words(c), c.outcome.replace("_", " "), said_words(c)) for c in score.cases]
    return Table(
        id="cases",
        caption="Every case: what was hidden, what came of it, and what was said.",
        head=("Case", "Hidden", "Outcome", "Said"),
        units=("",) * 4,
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3),
    )


def _provenance(score: Score, command: str) -> Table:
    from winchcascade.report.document import made_on, provenance_table

    return provenance_table(
        [
            ("SHA-256 of the sealed answers", score.sealed_sha256),
            ("Seed", str(score.seed)),
            ("Made by", f"winchcascade {__version__}"),
            ("Command", command),
            ("Made on", made_on()),
        ]
    )
