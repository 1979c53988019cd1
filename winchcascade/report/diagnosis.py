"""The report of a diagnosis: a page for whoever decides, then the evidence; made once for the page and the PDF."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import banner
from winchcascade.core.version import __version__
from winchcascade.diagnosis.gap_location import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_figures as figures
from winchcascade.report import diagnosis_tables as tables
from winchcascade.report import diagnosis_words as words
from winchcascade.report.diagnosis_data import Sides, most_telling, sides
from winchcascade.report.diagnosis_laws import numbers_figure, profile_figure
from winchcascade.report.diagnosis_method import METHOD, line_method
from winchcascade.report.diagnosis_names import (
    apart_words,
    display_of,
    load_words,
    phase_words,
    probability_words,
    share_words,
)
from winchcascade.report.diagnosis_odds import odds_figure, threshold_words, thresholds
from winchcascade.report.digits import significant
from winchcascade.report.publish import publish
from winchcascade.report.report_model import Note, Point, Report, Section, Table, Tile
from winchcascade.report.report_parts import data_point, file_digest, made_on, picture, provenance_table, section
from winchcascade.report.style import house_style

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult


def write_diagnosis_reports(
    found: ModelDiagnosis | LineDiagnosis,
    *,
    html: Path | None,
    pdf: Path | None,
    command: str = "",
    force: bool = False,
) -> None:
    """Write the report of a diagnosis as a self-contained page, as a PDF, or both. Raises as `write_content`."""
    publish(make_diagnosis_report(found, command=command), html=html, pdf=pdf, force=force)


def make_diagnosis_report(found: ModelDiagnosis | LineDiagnosis, *, command: str = "") -> Report:
    """Make the rows and figures of the report of a diagnosis."""
    with house_style():
        sections = _line_sections(found, command) if isinstance(found, LineDiagnosis) else _sections(found, command)
    size, rig = f"{len(found.runs)} logs", f"{found.rig.name} as given"
    if isinstance(found, LineDiagnosis):
        size = f"{sum(len(set(part.cycle.tolist())) for part in found.lines.parts)} cycles"
        rig = f"{found.rig.name}: line force, speed and winch power, no model"
    return Report(
        kind="Diagnosis of a campaign",
        title=found.title,
        subtitle=f"{size} · rig {rig} · {len(found.suspects)} suspects",
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(found),
        points=tuple(_line_points(found) if isinstance(found, LineDiagnosis) else _points(found)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner(words.origins_of(found)),
    )


def _sections(found: ModelDiagnosis, command: str) -> tuple[Section, ...]:
    both = sides(found)
    return (
        _where(found),
        _which(found),
        _how_far(found, both),
        _over_speed(found, both),
        _next(
            found,
            "The run that would tell most.",
            "Tried were the smallest, the middle and the largest load of the campaign at three speeds. The difference is what "
            "is left of it after every tolerance, every zero and the rival's own numbers have adapted as far as they can.",
        ),
        _remainder(found),
        section("considered", "What else was considered", tables.suspects_table(found), tables.thresholds_table(found)),
        _method(METHOD),
        section("provenance", "Provenance", tables.logs_table(found), _provenance(found, command)),
    )


def _line_sections(found: LineDiagnosis, command: str) -> tuple[Section, ...]:
    return (
        _line_where(found),
        _line_which(found),
        _line_how_far(found),
        _next(
            found,
            "The motion that would tell most.",
            "Tried were reel-out in steps of speed, reel-out in steps of force, out and back at one speed, and a swinging "
            "speed. The difference is what is left of it once the other explanation's own numbers have adapted as far as these "
            "logs allow; of motions that tell about as much, the one with the least effort is named.",
        ),
        _method(line_method(found)),
        section("provenance", "Provenance", tables.line_logs_table(found), _provenance(found, command)),
    )


# ---------------------------------------------------------------------------------------------- the page for a decision
def _tiles(found: ModelDiagnosis | LineDiagnosis) -> tuple[Tile, ...]:
    """Verdict, leading cause, and share that is closed; without a cause, with a model, how far the logs are off."""
    line, count = isinstance(found, LineDiagnosis), len(found.causes)
    none = "nothing stands out" if found.verdict == "no_gap" else "no cause named"
    named = f"{count} cause{'s' if count > 1 else ''} named" if count else none
    tiles = [Tile("Verdict", "", words.VERDICTS[found.verdict], named)]
    if found.causes:
        lead = found.causes[0]
        sure = f"probability {probability_words(lead.probability)}"
        tiles.append(Tile("Leading cause", sure, lead.effect, words.cause_words(found, lead)))
    if found.closure is not None:
        share, interval = share_words(found.closure.share), f"95 %: {words.interval_words(found)}"
        tiles.append(Tile("Gap closed", f"on unseen {'cycles' if line else 'logs'}", share, interval))
    if not found.causes and not isinstance(found, LineDiagnosis):
        tiles += _extremes(found)
    return tuple(tiles)


def _extremes(found: ModelDiagnosis) -> list[Tile]:
    """The mean that is farthest off, and the strongest sign of something unexplained or how many effects were tried."""
    tiles = []
    ranked = figures.worst_first(found)
    if ranked:
        worst = ranked[0]
        where = f"{words.NAMES[worst.channel]}, {phase_words(worst.phase)}, {load_words(worst.load)}"
        size = f"{abs(worst.z):.1f}"
        tiles.append(Tile("Largest gap", f"limit {STANDS_OUT:g}", size, f"standard uncertainties: {where}"))
    if found.remainder is not None and found.remainder.alarms:
        alarm = found.remainder.alarms[0]
        where = words.about_words(alarm.about, words.files_of(found))
        size, kind = significant(alarm.size, 2), tables.SIGNS[alarm.kind]
        tiles.append(Tile("Strongest sign", f"limit {alarm.limit:g}", size, f"{kind}: {where}"))
    else:
        tiles.append(Tile("Effects tried", "", f"{len(found.suspects)}", "none is named"))
    return tiles


def _points(found: ModelDiagnosis) -> list[Point]:
    """What a reader must know after ten seconds, in sentences."""
    alarms = found.remainder is not None and found.remainder.alarms
    hidden, clean = found.unnamed, found.verdict == "no_gap"
    where = f"{words.where_words(found)} {words.arises_words(found)}".strip()
    return _stated(
        *_first_points(found, where),
        Point("How far", words.closure_words(found)),
        Point("What next", words.experiment_words(found)),
        Point("What is left", words.remainder_words(found) if found.remainder else "", "warn" if alarms else "plain"),
        Point("What was checked", words.checked_words(found) if clean else ""),
        Point("What would show", _seen_words(found) if clean else ""),
        Point(
            "Not named",
            f"The best fit used {', '.join(hidden)} too. While something stays unexplained such further effects may "
            "only imitate it, so they are not named."
            if hidden and found.causes
            else "",
            "warn",
        ),
    )


def _line_points(found: LineDiagnosis) -> list[Point]:
    """As `_points`, for a winch without a model."""
    alarms = found.remainder is not None and found.remainder.alarms
    hidden, small = found.unnamed, words.small_words(found)
    data, *others = _first_points(found, words.where_words(found))
    return _stated(
        data,
        Point("Sign turned", words.flipped_words(found), "warn"),
        *others,
        Point("How far", words.closure_words(found)),
        Point("How steady", words.again_words(found)),
        Point("What next", words.experiment_words(found)),
        Point("What is left", words.remainder_words(found), "warn" if alarms else "plain"),
        Point("Not needed", f"{small}." if small else ""),
        Point(
            "Not named",
            f"The best fit used {', '.join(hidden)} too; while a structure is left they may only imitate it."
            if hidden and found.causes
            else "",
            "warn",
        ),
    )


def _stated(*points: Point) -> list[Point]:
    """Points that have a text."""
    return [point for point in points if point.text]


def _first_points(found: ModelDiagnosis | LineDiagnosis, where: str) -> list[Point]:
    """Data, verdict, where, every cause, and how sure they are."""
    good = found.verdict in ("no_gap", "explained")
    many = len(found.causes) > 1
    causes = []
    for k, cause in enumerate(found.causes, start=1):
        what, numbers = words.meaning_words(found, cause.effect), words.cause_words(found, cause)
        text = f"{cause.effect}: {what[:1].lower()}{what[1:].rstrip('.')}. Found: {numbers}."
        rivals = " or ".join(rival.effect for rival in cause.rivals)
        causes.append(Point(f"Cause {k}" if many else "Cause", f"{text} Or in its place {rivals}." if rivals else text))
    return [
        data_point(words.origins_of(found)),
        Point("Verdict", words.verdict_words(found), "good" if good else "warn"),
        Point("Where", where),
        *causes,
        Point("How sure", words.sure_words(found)),
    ]


EXAMPLES = ("copper_heating", "gear_mesh_loss", "line_friction", "precharge")
"""One effect of each stage, which tells how small a gap would have been seen."""


def _seen_words(found: ModelDiagnosis) -> str:
    """How small some effects might have been and still be named."""
    known = [one for one in thresholds(found) if one.effect in EXAMPLES and one.value is not None]
    parts = [f"{display_of(one.effect, one.name).what} {threshold_words(one)}" for one in known]
    return (
        f"Alone it would have been named from: {', '.join(parts)}. All effects are in the table of thresholds."
        if parts
        else ""
    )


# ---------------------------------------------------------------------------------------------------------- the evidence
def _where(found: ModelDiagnosis) -> Section:
    word = words.word_of(found)
    return section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies",
        picture(
            figures.gap_map(found), "map",
            f"Map of the gap: {word} minus simulated by the rig as given, as a mean over each phase of each log, in "
            f"standard uncertainties (z). Bold and coloured: beyond {STANDS_OUT:g}; green: the log lies above the "
            "simulation, red: below.",
            "Matrix of numbers by channel and phase (rows) and load (columns); the largest are in the table.",
        ),
        Note(YARDSTICKS),
        tables.places_table(found),
        Note(STAGE_BY_STAGE),
        picture(
            figures.stage_map(found), "stages",
            f"Stage by stage: {word} minus what each stage makes of its own inputs from the log, by the rig as given, in "
            "standard uncertainties; numbers and colours as in the map.",
            "Matrix of numbers by stage and phase (rows) and load (columns); the largest are in the table.",
        ),
        tables.stages_table(found),
    )  # fmt: skip


STAGE_BY_STAGE = (
    "The map reads end to end: the line's motion alone drives the model, so what is wrong in one stage shows in those behind "
    "it, and upstream through torque and force. Stage by stage each is given its own inputs from the log instead: read it to "
    "see where the gap arises. A sensor that is off shows in every stage that it feeds or ends."
)

YARDSTICKS = (
    "A difference counts only against what could make it by chance. Three yardsticks make up its standard uncertainty: "
    "the noise of the sensors and the zero of each log's sensor; how the cycles of a log repeat; and how well the "
    "numbers of the rig file, the loads and the gains of the sensors are known, carried through the simulation. Force "
    "and torque are compared only while the line moves: at rest friction just bounds them."
)


def _which(found: ModelDiagnosis) -> Section:
    return section(
        "which", "Which causes, and how sure" if found.causes else "What was tried",
        tables.causes_table(found),
        tables.meanings_table(found),
        picture(
            numbers_figure(found), "numbers",
            "What was found of each cause, beside the value that the rig file gives, how well that is known, and "
            "what is plausible.",
            "Points with bars on one axis for each number; the values are in the table of causes.",
        ),
        picture(
            profile_figure(found), "rolloff",
            "Back-EMF constant over the stator current, as far as the logs reach (the paper's Fig. 18e). The shape "
            "is free: it may fall between any two knots and never rise; the band is narrow where a knot lies at "
            "its bound.",
            "A falling curve with a band; its value at 10 A is in the table of causes.",
        ),
        picture(
            odds_figure(found), "odds", _odds_caption(found),
            "Bars of probabilities; those of the causes are in the table.",
        ),
        tables.rivals_table(found),
    )  # fmt: skip


def _odds_caption(found: ModelDiagnosis) -> str:
    both = "Probability of each effect (green: named), and odds" if found.causes else "Odds"
    return (
        f"{both} of the likeliest of {len(found.sets)} sets of effects that were fitted, against the best one: a bar that is "
        "as long as the first would be as likely, one of no length is ruled out."
    )


def _how_far(found: ModelDiagnosis, both: Sides) -> Section:
    log = most_telling(found)
    run, word = found.data.logs[log].run, words.word_of(found)
    fresh = found.closure is not None and log in found.closure.withheld
    after = ", and with the fitted effects by a fit that did not know this log" if fresh else ""
    panels = figures.error_panels(found)
    names = " and of ".join(words.NAMES[p.channel] for p in panels)
    limit = (
        " Dashed: where the stator carries its rated current, as the model has it."
        if found.rig.generator.i_rated
        else ""
    )
    return section(
        "how-far", "How far the gap closes" if found.causes else "The gap in time and over current",
        picture(
            figures.closure_bars(found), "closure-bars",
            "Misfit before and after, in units of the noise, on logs that took no part in the fit.",
            "Pairs of points for each channel; the values are in the table.",
        ),
        tables.closure_table(found),
        picture(
            figures.error_figure(found, both, word), "errors",
            f"Error of {names} in the payouts of all logs; one mark is a block of 0.44 s (the paper's Fig. "
            f"18b).{limit}",
            "Clouds of marks before and after about zero.",
        ),
        picture(
            figures.history(found, both, log, word), "history",
            f"{run.name} ({load_words(run.load)}): {word} minus simulated, block by block, by the rig as "
            f"given{after}. The zeros of the log's sensors are taken off alike.",
            "Lines over time for every channel; the mean squares are in the table.",
        ),
    )  # fmt: skip


def _over_speed(found: ModelDiagnosis, both: Sides) -> Section:
    after = ", and with the fitted effects" if found.causes else ""
    return section(
        "speed", "Current, torque and power over speed",
        picture(
            figures.over_speed_figure(found, both, words.word_of(found)), "speed",
            f"Payouts at a light, a middle and a heavy load: {words.word_of(found)}, simulated by the rig as given{after} "
            "(the paper's Figs 18a, 18c and 18d). Means of blocks in bins of 250 rpm.",
            "Lines of the logs and marks of the simulations over generator speed.",
        ),
    )  # fmt: skip


def _next(found: DiagnosisResult, caption: str, how: str) -> Section:
    """What to test next.

    Parameters
    ----------
    how : what was tried, and how the difference was reckoned
    """
    plan = found.experiment
    if plan is None:
        return Section("next", "What to test next", ())
    one, other = plan.separates
    rows = (
        *([] if plan.load is None else [("Load", load_words(plan.load))]),
        ("Motion", words.profile_words(plan)),
        ("Tells apart", f"{one} from {other}"),
        ("They would differ by", f"{apart_words(plan.expected_z)} standard deviations"),
    )
    return Section(
        "next",
        "What to test next",
        (Table("experiment", caption, ("Item", "Value"), ("", ""), rows, (0, 1)), Note(how)),
    )


def _method(texts: Sequence[str]) -> Section:
    """The method in short; what stands before the first full stop of a paragraph is what it is about."""
    parts = (text.partition(". ") for text in texts)
    return section("method", "Method and its limits", *(Note(rest, about) for about, _, rest in parts))


def _remainder(found: ModelDiagnosis) -> Section:
    left = [] if found.remainder is None else [Note(words.remainder_words(found))]
    return section(
        "remainder",
        "What is left",
        *left,
        tables.alarms_table(found),
        tables.roughness_table(found),
        tables.nuisances_table(found),
    )


def _provenance(found: ModelDiagnosis | LineDiagnosis, command: str) -> Table:
    import numpy

    rig, sets = found.rig, len(found.sets)
    if isinstance(found, LineDiagnosis):
        judged, source = "Judged", "Source of the logs and the rig"
        fits = f"{sets} sets of suspects, {found.moments.folds} times each"
    else:
        judged, source = "Withheld", "Source of the rig's numbers"
        fits = f"{sets} set{'s' if sets > 1 else ''} of effects; {len(found.data.nuisances)} tolerances beside each"
    return provenance_table(
        [
            ("Campaign", found.title),
            (judged, words.judged_words(found)),
            ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
            (source, rig.source),
            ("SHA-256 of the rig file", file_digest(rig.path)),
            ("Suspects", ", ".join(found.suspects)),
            ("Fits", fits),
            ("Seed of the resampled cycles", str(found.seed)),
            ("Made by", f"winchcascade {__version__}, Python {platform.python_version()}, numpy {numpy.__version__}"),
            ("Command", command),
            ("Made on", made_on()),
        ]
    )


# --------------------------------------------------------------------------------------------- of a winch without a model
def _line_where(found: LineDiagnosis) -> Section:
    word = words.word_of(found)
    causes = " and with the causes" if found.closure is not None else ""
    role = ""
    if found.closure is not None:
        role = (
            " These cycles took no part in the fit." if found.lines.judged[0].withheld else " Each by a fit without it."
        )
    return section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies",
        picture(
            figures.power_history(found, word), "history",
            f"Power of the winch: {word}, line force times speed{causes}; below, what is left of it.{role}",
            "Lines over time; root mean squares are in the table.",
        ),
        tables.line_places_table(found),
    )  # fmt: skip


def _line_which(found: LineDiagnosis) -> Section:
    return section(
        "which", "Which causes, and how sure" if found.causes else "What was tried",
        tables.causes_table(found),
        picture(
            figures.closed_bars(found), "closed",
            "What is left of the squared error with each cause alone and together (green: chosen), on cycles that the fit did "
            "not know.",
            "Bars of the squared error that is left; the values are in the table of sets.",
        ),
        tables.line_suspects_table(found),
        tables.sets_table(found),
        tables.rivals_table(found),
    )  # fmt: skip


def _line_how_far(found: LineDiagnosis) -> Section:
    word = words.word_of(found)
    return section(
        "how-far", "How far the gap closes",
        tables.line_closure_table(found),
        picture(
            figures.power_scatter(found, word), "scatter",
            f"{words.upper(word)} over predicted power, samples spread over the judged cycles; on the line both "
            "agree.",
            "Clouds of marks about a diagonal, wide before and narrow after.",
        ),
        picture(
            figures.power_by_cycle(found, word), "cycles", "Error of the power in every judged cycle.",
            "Pairs of marks for each cycle, before and after.",
        ),
    )  # fmt: skip
