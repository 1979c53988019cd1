"""The report of a winch without a model: a page for whoever decides, then the evidence."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import banner
from winchcascade.core.version import __version__
from winchcascade.diagnosis.line.line_closure import SLOW
from winchcascade.diagnosis.line.line_selection import DRAWS, FOLDS, MATERIAL
from winchcascade.diagnosis.remainder import ROUGH
from winchcascade.report import line_figures as figures
from winchcascade.report import line_tables as tables
from winchcascade.report import line_words as words
from winchcascade.report.diagnosis_page import (
    Closed,
    cause_points,
    cause_sentence,
    method_section,
    next_section,
    verdict_tiles,
)
from winchcascade.report.publish import publish
from winchcascade.report.report_model import Point, Report, Section, Tile, Tone
from winchcascade.report.report_parts import data_point, file_digest, made_on, picture, provenance_table, section
from winchcascade.report.style import house_style

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis


def write_line_reports(
    found: LineDiagnosis, *, html: Path | None, pdf: Path | None, command: str = "", force: bool = False
) -> None:
    """Write the report as a self-contained page, as a PDF, or both. Raises as `write_content`."""
    publish(make_line_report(found, command=command), html=html, pdf=pdf, force=force)


def make_line_report(found: LineDiagnosis, *, command: str = "") -> Report:
    """Make the rows and figures of the report."""
    cycles = sum(len(set(part.cycle.tolist())) for part in found.lines.parts)
    with house_style():
        sections = (
            _where(found),
            _which(found),
            _how_far(found),
            _next(found),
            _method(found),
            _provenance(found, command),
        )
    return Report(
        kind="Diagnosis of a campaign",
        title=found.title,
        subtitle=f"{cycles} cycles · rig {found.rig.name}: line force, speed and winch power, no model · "
        f"{len(found.lines.names)} suspects",
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(found),
        points=tuple(_points(found)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner(words.origins_of(found)),
    )


# ---------------------------------------------------------------------------------------------- the page for a decision
def _tiles(found: LineDiagnosis) -> tuple[Tile, ...]:
    """Verdict, leading cause, and share that is closed."""
    judged = found.judged
    closed = None if judged is None else Closed(judged.closed, words.interval_words(found), "cycles")
    lead = words.cause_words(found.causes[0]) if found.causes else ""
    return tuple(verdict_tiles(found.verdict, found.causes, lead, closed))


def _tone(found: LineDiagnosis) -> Tone:
    return "good" if found.verdict in ("no_gap", "explained") else "warn"


def _points(found: LineDiagnosis) -> list[Point]:
    """What a reader must know after ten seconds, in sentences."""
    hidden = words.unnamed(found)
    entries = [
        data_point(words.origins_of(found)),
        Point("Sign turned", words.flipped_words(found), "warn"),
        Point("Verdict", words.verdict_words(found), _tone(found)),
        Point("Where", words.where_words(found)),
        *cause_points([cause_sentence(c, words.MEANINGS[c.effect], words.cause_words(c)) for c in found.causes]),
        Point("How sure", words.sure_words(found)),
        Point("How far", words.closure_words(found)),
        Point("How steady", words.again_words(found)),
        Point("What next", words.experiment_words(found)),
        Point("What is left", words.remainder_words(found), "warn" if found.left.alarms else "plain"),
        Point("Not needed", f"{words.small_words(found)}." if words.small_words(found) else ""),
        Point("Not named", f"The best fit used {', '.join(hidden)} too; while a structure is left they may only imitate it."
              if hidden and found.causes else "", "warn"),
    ]  # fmt: skip
    return [point for point in entries if point.text]


# ---------------------------------------------------------------------------------------------------------- the evidence
def _where(found: LineDiagnosis) -> Section:
    word = words.word_of(found)
    causes = " and with the causes" if found.judged is not None else ""
    role = ""
    if found.judged is not None:
        role = (
            " These cycles took no part in the fit." if found.lines.judged[0].withheld else " Each by a fit without it."
        )
    return section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies",
        picture(
            figures.history(found, word), "history",
            f"Power of the winch: {word}, line force times speed{causes}; below, what is left of it.{role}",
            "Lines over time; root mean squares are in the table.",
        ),
        tables.places_table(found),
    )  # fmt: skip


def _which(found: LineDiagnosis) -> Section:
    return section(
        "which", "Which causes, and how sure" if found.causes else "What was tried",
        tables.causes_table(found),
        picture(
            figures.closed_bars(found), "closed",
            "What is left of the squared error with each cause alone and together (green: chosen), on cycles that the fit did "
            "not know.",
            "Bars of the squared error that is left; the values are in the table of sets.",
        ),
        tables.meanings_table(found),
        tables.sets_table(found),
        tables.rivals_table(found),
    )  # fmt: skip


def _how_far(found: LineDiagnosis) -> Section:
    word = words.word_of(found)
    return section(
        "how-far", "How far the gap closes",
        tables.closure_table(found),
        picture(
            figures.scatter(found, word), "scatter",
            f"{word[:1].upper() + word[1:]} over predicted power, samples spread over the judged cycles; on the line both "
            "agree.",
            "Clouds of marks about a diagonal, wide before and narrow after.",
        ),
        picture(
            figures.by_cycle(found, word), "cycles", "Error of the power in every judged cycle.",
            "Pairs of marks for each cycle, before and after.",
        ),
    )  # fmt: skip


def _next(found: LineDiagnosis) -> Section:
    plan = found.experiment
    if plan is None:
        return Section("next", "What to test next", ())
    return next_section(
        (("Motion", plan.profile),), plan.separates, plan.expected_z, "The motion that would tell most.",
        "Tried were reel-out in steps of speed, reel-out in steps of force, out and back at one speed, and a swinging speed. "
        "The difference is what is left of it once the other explanation's own numbers have adapted as far as these logs "
        "allow; of motions that tell about as much, the one with the least effort is named.",
    )  # fmt: skip


def _method(found: LineDiagnosis) -> Section:
    texts = (
        "Balance. The power of the shaft follows from the line by P = v (F − m dv/dt − F₀ sgn v − b v), with the line's speed "
        "v and force F, positive in reel-out: m is what turns with the line, as a mass on it, F₀ a constant friction and b a "
        "drag over speed. A gain or a zero of the force cell changes F. The power is linear in all of them, and none is known "
        "beforehand: no drum radius, inertia or loss of the rig file enters.",
        f"Acceleration. It is the {words.slope_words(found)}; at most 0.4 s, as more would blur what the winch does. Withheld "
        "cycles have no say in it.",
        "Choice. Each of the sets of suspects is fitted by least squares within its bounds (m, F₀, b not negative; the force "
        "cell within the catalogue) without each cycle in turn, and predicts that cycle. Of the sets whose error is within one "
        f"standard error over cycles of the least (Breiman et al. 1984), or within {100.0 * MATERIAL:g} % of the gap, the "
        f"smallest is chosen; a cause that closes less than {100.0 * MATERIAL:g} % is left out. With fewer than {FOLDS} cycles "
        "each is cut into pieces.",
        f"Probability. The cycles are resampled {DRAWS} times, with the errors that each set made of them, and the same rule "
        "chooses: the probability of a set is how often it is chosen, that of a cause how often a set with it is. It tells how "
        "far the choice hangs on which cycles were logged, not whether the list of suspects is complete.",
        "Intervals. 95 %, from the scatter of each cycle's scores, so correlation within a cycle is allowed for (Liang and "
        "Zeger 1986), with Student's t. What the width of the slope blurs is told by another width and added.",
        "Closure. 1 − Σ after² ÷ Σ before² over the samples of cycles that the fit did not know; its interval resamples them.",
        f"Structure. What is left keeps a structure if more than {100.0 * SLOW:.0f} % of its squares last longer than a "
        f"second, or if means over 0.44 s are more than {ROUGH:g} times their noise by second differences in a phase, and "
        "either makes more than 1 % of the squared gap.",
        "Limits. A loss that grows with the line force alone looks like a gain of the force cell. Inertia that changes with "
        "the tether on the drum, and losses that change with temperature, are told as a mean; the numbers of the withheld "
        "cycles alone show how far they move. What is faster than the samples is seen as noise.",
    )
    return method_section(texts)


def _provenance(found: LineDiagnosis, command: str) -> Section:
    import numpy

    rig = found.rig
    table = provenance_table(
        [
            ("Campaign", found.title),
            ("Judged", words.judged_words(found)),
            ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
            ("Source of the logs and the rig", rig.source),
            ("SHA-256 of the rig file", file_digest(rig.path)),
            ("Suspects", ", ".join(found.lines.names)),
            ("Fits", f"{len(found.choice.errors)} sets of suspects, {found.moments.folds} times each"),
            ("Seed of the resampled cycles", str(found.seed)),
            ("Made by", f"winchcascade {__version__}, Python {platform.python_version()}, numpy {numpy.__version__}"),
            ("Command", command),
            ("Made on", made_on()),
        ]
    )
    return section("provenance", "Provenance", tables.logs_table(found), table)
