"""The report of a diagnosis: a page for whoever decides, then the evidence; made once for the page and the PDF."""

from __future__ import annotations

import platform
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import banner
from winchcascade.core.version import __version__
from winchcascade.diagnosis.gap_location import NAMES, STANDS_OUT
from winchcascade.report import diagnosis_tables as tables
from winchcascade.report.diagnosis_data import Sides, most_telling, sides
from winchcascade.report.diagnosis_figures import error_figure, error_panels, history, over_speed_figure
from winchcascade.report.diagnosis_laws import numbers_figure, profile_figure
from winchcascade.report.diagnosis_map import closure_bars, gap_map, stage_map, worst_first
from winchcascade.report.diagnosis_method import METHOD
from winchcascade.report.diagnosis_names import display_of, load_words, nuisance_words, parameter_words, phase_words
from winchcascade.report.diagnosis_odds import odds_figure, threshold_words, thresholds
from winchcascade.report.diagnosis_page import (
    Closed,
    cause_points,
    cause_sentence,
    method_section,
    next_section,
    verdict_tiles,
)
from winchcascade.report.diagnosis_words import (
    arises_words,
    checked_words,
    closure_words,
    experiment_words,
    files_of,
    interval_words,
    origins_of,
    remainder_words,
    sure_words,
    unnamed,
    verdict_words,
    where_words,
    withheld_words,
    word_of,
)
from winchcascade.report.digits import significant
from winchcascade.report.publish import publish
from winchcascade.report.report_model import Note, Point, Report, Section, Table, Tile
from winchcascade.report.report_parts import data_point, file_digest, made_on, picture, provenance_table, section
from winchcascade.report.style import house_style

if TYPE_CHECKING:
    from pathlib import Path

    from winchcascade.diagnosis.diagnose import Diagnosis


def write_diagnosis_reports(
    found: Diagnosis, *, html: Path | None, pdf: Path | None, command: str = "", force: bool = False
) -> None:
    """Write the report of a diagnosis as a self-contained page, as a PDF, or both. Raises as `write_content`."""
    publish(make_diagnosis_report(found, command=command), html=html, pdf=pdf, force=force)


def make_diagnosis_report(found: Diagnosis, *, command: str = "") -> Report:
    """Make the rows and figures of the report of a diagnosis."""
    both = sides(found)
    with house_style():
        sections = (
            _where(found),
            _which(found),
            _how_far(found, both),
            _over_speed(found, both),
            _next(found),
            _remainder(found),
            _considered(found),
            method_section(METHOD),
            Section("provenance", "Provenance", (tables.logs_table(found), _provenance(found, command))),
        )
    return Report(
        kind="Diagnosis of a campaign",
        title=found.title,
        subtitle=f"{len(found.data.logs)} logs · rig {found.rig.name} as given · {len(found.suspects)} suspects",
        generator=f"winchcascade/{__version__}",
        tiles=_tiles(found),
        points=tuple(_points(found)),
        sections=tuple(s for s in sections if s.blocks),
        banner=banner(origins_of(found)),
    )


# ---------------------------------------------------------------------------------------------- the page for a decision
def _tiles(found: Diagnosis) -> tuple[Tile, ...]:
    """Verdict, leading cause, and share that is closed; without a cause how far the logs are off."""
    closed = None if found.closure is None else Closed(found.closure.share, interval_words(found), "logs")
    if found.causes:
        return tuple(verdict_tiles(found.verdict, found.causes, parameter_words(found.causes[0]), closed))
    return (*verdict_tiles(found.verdict, (), "", closed), *_extremes(found))


def _extremes(found: Diagnosis) -> list[Tile]:
    """The mean that is farthest off, and the strongest sign of something unexplained or how many effects were tried."""
    tiles = []
    ranked = worst_first(found)
    if ranked:
        worst = ranked[0]
        where = f"{NAMES[worst.channel]}, {phase_words(worst.phase)}, {load_words(worst.load)}"
        size = f"{abs(worst.z):.1f}"
        tiles.append(Tile("Largest gap", f"limit {STANDS_OUT:g}", size, f"standard uncertainties: {where}"))
    if found.remainder is not None and found.remainder.alarms:
        alarm = found.remainder.alarms[0]
        where = nuisance_words(alarm.where, files_of(found))
        size, kind = significant(alarm.size, 2), tables.SIGNS[alarm.kind]
        tiles.append(Tile("Strongest sign", f"limit {alarm.limit:g}", size, f"{kind}: {where}"))
    else:
        tiles.append(Tile("Effects tried", "", f"{len(found.suspects)}", "none is named"))
    return tiles


def _points(found: Diagnosis) -> list[Point]:
    """What a reader must know after ten seconds, in sentences."""
    points = [data_point(origins_of(found))]
    good = found.verdict in ("no_gap", "explained")
    points.append(Point("Verdict", verdict_words(found), "good" if good else "warn"))
    if found.where is not None:
        points.append(Point("Where", f"{where_words(found)} {arises_words(found)}".rstrip()))
    points += cause_points(
        [cause_sentence(c, found.suspects[c.effect].summary, parameter_words(c)) for c in found.causes]
    )
    points.append(Point("How sure", sure_words(found)))
    if found.closure is not None:
        points.append(Point("How far", closure_words(found)))
    if found.experiment is not None:
        points.append(Point("What next", experiment_words(found)))
    if found.remainder is not None:
        points.append(Point("What is left", remainder_words(found), "warn" if found.remainder.alarms else "plain"))
    if found.verdict == "no_gap":
        points.append(Point("What was checked", checked_words(found)))
        seen = _seen_words(found)
        points += [Point("What would show", seen)] if seen else []
    points += _cut_short(found)
    return points


EXAMPLES = ("copper_heating", "gear_mesh_loss", "line_friction", "precharge")
"""One effect of each stage, which tells how small a gap would have been seen."""


def _seen_words(found: Diagnosis) -> str:
    """How small some effects might have been and still be named."""
    known = [one for one in thresholds(found) if one.effect in EXAMPLES and one.value is not None]
    parts = [f"{display_of(one.effect, one.name).what} {threshold_words(one)}" for one in known]
    return (
        f"Alone it would have been named from: {', '.join(parts)}. All effects are in the table of thresholds."
        if parts
        else ""
    )


def _cut_short(found: Diagnosis) -> list[Point]:
    """A warning where the fit needed more effects than are named."""
    hidden = unnamed(found)
    if not hidden or not found.causes:
        return []
    return [
        Point(
            "Not named",
            f"The best fit used {', '.join(hidden)} too. While something stays unexplained such further effects may "
            "only imitate it, so they are not named.",
            "warn",
        )
    ]


# ---------------------------------------------------------------------------------------------------------- the evidence
def _where(found: Diagnosis) -> Section:
    word = word_of(found)
    return section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies",
        picture(
            gap_map(found), "map",
            f"Map of the gap: {word} minus simulated by the rig as given, as a mean over each phase of each log, in "
            f"standard uncertainties (z). Bold and coloured: beyond {STANDS_OUT:g}; green: the log lies above the "
            "simulation, red: below.",
            "Matrix of numbers by channel and phase (rows) and load (columns); the largest are in the table.",
        ),
        Note(YARDSTICKS),
        tables.places_table(found),
        Note(STAGE_BY_STAGE),
        picture(
            stage_map(found), "stages",
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


def _which(found: Diagnosis) -> Section:
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


def _odds_caption(found: Diagnosis) -> str:
    both = "Probability of each effect (green: named), and odds" if found.causes else "Odds"
    return (
        f"{both} of the likeliest of {len(found.sets)} sets of effects that were fitted, against the best one: a bar that is "
        "as long as the first would be as likely, one of no length is ruled out."
    )


def _how_far(found: Diagnosis, both: Sides) -> Section:
    log = most_telling(found)
    run, word = found.data.logs[log].run, word_of(found)
    fresh = found.closure is not None and log in found.closure.withheld
    after = ", and with the fitted effects by a fit that did not know this log" if fresh else ""
    panels = error_panels(found)
    names = " and of ".join(NAMES[p.channel] for p in panels)
    limit = (
        " Dashed: where the stator carries its rated current, as the model has it."
        if found.rig.generator.i_rated
        else ""
    )
    return section(
        "how-far", "How far the gap closes" if found.causes else "The gap in time and over current",
        picture(
            closure_bars(found), "closure-bars",
            "Misfit before and after, in units of the noise, on logs that took no part in the fit.",
            "Pairs of points for each channel; the values are in the table.",
        ),
        tables.closure_table(found),
        picture(
            error_figure(found, both, word), "errors",
            f"Error of {names} in the payouts of all logs; one mark is a block of 0.44 s (the paper's Fig. "
            f"18b).{limit}",
            "Clouds of marks before and after about zero.",
        ),
        picture(
            history(found, both, log, word), "history",
            f"{run.name} ({load_words(run.load)}): {word} minus simulated, block by block, by the rig as "
            f"given{after}. The zeros of the log's sensors are taken off alike.",
            "Lines over time for every channel; the mean squares are in the table.",
        ),
    )  # fmt: skip


def _over_speed(found: Diagnosis, both: Sides) -> Section:
    after = ", and with the fitted effects" if found.causes else ""
    return section(
        "speed", "Current, torque and power over speed",
        picture(
            over_speed_figure(found, both, word_of(found)), "speed",
            f"Payouts at a light, a middle and a heavy load: {word_of(found)}, simulated by the rig as given{after} "
            "(the paper's Figs 18a, 18c and 18d). Means of blocks in bins of 250 rpm.",
            "Lines of the logs and marks of the simulations over generator speed.",
        ),
    )  # fmt: skip


def _next(found: Diagnosis) -> Section:
    plan = found.experiment
    if plan is None:
        return Section("next", "What to test next", ())
    return next_section(
        (("Load", load_words(plan.load)), ("Motion", plan.profile)), plan.separates, plan.expected_z,
        "The run that would tell most.",
        "Tried were the smallest, the middle and the largest load of the campaign at three speeds. The difference is what is "
        "left of it after every tolerance, every zero and the rival's own numbers have adapted as far as they can.",
    )  # fmt: skip


def _remainder(found: Diagnosis) -> Section:
    words = [] if found.remainder is None else [Note(remainder_words(found))]
    return section(
        "remainder",
        "What is left",
        *words,
        tables.alarms_table(found),
        tables.roughness_table(found),
        tables.nuisances_table(found),
    )


def _considered(found: Diagnosis) -> Section:
    return section(
        "considered", "What else was considered", tables.suspects_table(found), tables.thresholds_table(found)
    )


def _provenance(found: Diagnosis, command: str) -> Table:
    import numpy

    rig, fits = found.rig, len(found.sets)
    return provenance_table(
        [
            ("Campaign", found.title),
            ("Withheld", withheld_words(found)),
            ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
            ("Source of the rig's numbers", rig.source),
            ("SHA-256 of the rig file", file_digest(rig.path)),
            ("Suspects", ", ".join(found.suspects)),
            (
                "Fits",
                f"{fits} set{'s' if fits > 1 else ''} of effects; {len(found.data.nuisances)} tolerances beside each",
            ),
            ("Seed of the resampled cycles", str(found.seed)),
            ("Made by", f"winchcascade {__version__}, Python {platform.python_version()}, numpy {numpy.__version__}"),
            ("Command", command),
            ("Made on", made_on()),
        ]
    )
