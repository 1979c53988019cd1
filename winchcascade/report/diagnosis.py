"""The report of a diagnosis: a summary page, then the evidence; made once for the page and the PDF."""

from __future__ import annotations

from collections.abc import Sequence

from winchcascade.core.campaign_file import banner
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_figures as figures
from winchcascade.report import diagnosis_tables as tables
from winchcascade.report import diagnosis_words as words
from winchcascade.report import sheet as content
from winchcascade.report.cause_costs import cost_section, cost_words, lead_picture
from winchcascade.report.cause_words import (
    alternatives_words,
    cause_words,
    check_words,
    cycles_of,
    flipped_words,
    meaning_words,
    minor_words,
    named,
    small_words,
    stability_words,
)
from winchcascade.report.cycle_histories import (
    CycleHistory,
    cycle_histories,
    histories_figure,
    histories_json,
    item_words,
    zeros_words,
)
from winchcascade.report.diagnosis_causes import (
    numbers_figure,
    odds_figure,
    profile_figure,
    stability_figure,
    threshold_words,
)
from winchcascade.report.diagnosis_figures import Sides, most_telling, sides
from winchcascade.report.diagnosis_tables import where_section, which_section
from winchcascade.report.diagnosis_words import METHOD, STAGE_BY_STAGE, YARDSTICKS, line_method
from winchcascade.report.digits import significant
from winchcascade.report.finding_words import finding_words
from winchcascade.report.gap_words import (
    NAMES,
    about_words,
    apart_words,
    baseline_words,
    display_of,
    own_simulation_words,
    phase_words,
    probability_words,
    share_words,
    simulated_words,
)
from winchcascade.report.line_report import line_how_far, line_logs_table, line_where, line_which
from winchcascade.report.style import house_style
from winchcascade.report.wording import load_words, symbols_section


def make_diagnosis_report(found: ModelDiagnosis | LineDiagnosis, *, command: str = "") -> content.Report:
    """Make the rows and figures of the report of a diagnosis."""
    size, rig = f"{len(found.runs)} logs", f"{found.rig.name}, model of its rig file"
    traces, lead = "", None
    with house_style():
        if isinstance(found, LineDiagnosis):
            sections: tuple[content.Section, ...] = (
                line_where(found),
                line_which(found),
                line_how_far(found),
                _next(
                    found,
                    "The sharpest next motion.",
                    "Reel-out in steps of speed, reel-out in steps of line tension, out and back at one speed, and a swinging "
                    "speed were tried. The difference is what remains of it once the numbers of the other explanation have "
                    "adapted as far as these logs allow; of motions with about the same difference, the one with the minimum "
                    "effort is named.",
                ),
                _method(line_method(found)),
                symbols_section(found.rig.cascade, cycles=False, diagnosed=True),
            )
            size = f"{cycles_of(found)} cycles"
            rig = f"{found.rig.name}: line tension, speed and winch power, no model"
        else:
            lead = lead_picture(found)
            items, first = cycle_histories(found)
            sections = _sections(found, items[first : first + 1])
            traces = histories_json(found, items, first, _logged_word(found)) if items else ""
    return content.Report(
        kind="Diagnosis of a campaign",
        title=found.title,
        subtitle=f"{size} · rig {rig} · {len(found.suspects)} suspects",
        tiles=_tiles(found),
        points=_points(found),
        sections=tuple(s for s in (*sections, _provenance(found, command)) if s.blocks),
        traces=traces,
        lead=lead,
        banner=banner(words.origins_of(found)),
    )


def _sections(found: ModelDiagnosis, shown: Sequence[CycleHistory]) -> tuple[content.Section, ...]:
    both = sides(found)
    word, after = words.word_of(found), ", and with the fitted effects" if found.causes else ""
    return (
        _where(found),
        _which(found),
        cost_section(found),
        _how_far(found, both),
        *(_histories(found, item) for item in shown),
        content.section(
            "speed", "Current, torque and power over speed",
            content.picture(
                figures.over_speed_figure(found, both, word), "speed",
                f"Payouts at a light, a middle and a heavy load: {word}, {simulated_words(found)}{after} "
                "(the paper's Figs 18a, 18c and 18d). Means of blocks in bins of 250 rpm.",
                "Lines of the logs and marks of the simulations over generator speed.",
            ),
        ),
        _next(
            found,
            "The sharpest next run.",
            "The minimum, the middle and the maximum load of the campaign were tried at three speeds. The difference is what "
            "remains of it after every tolerance, every zero and the numbers of the alternative have adapted as far as they "
            "can.",
        ),
        content.section(
            "remainder", "Residual",
            content.Note(words.remainder_words(found)) if found.remainder else None,
            tables.alarms_table(found),
            tables.roughness_table(found),
            tables.nuisances_table(found),
        ),
        content.section("considered", "What else was considered", tables.suspects_table(found), tables.thresholds_table(found)),
        _method(METHOD),
        symbols_section(found.rig.cascade, cycles=False, diagnosed=True),
    )  # fmt: skip


# ---------------------------------------------------------------------------------------------- the page for a decision
def _tiles(found: ModelDiagnosis | LineDiagnosis) -> tuple[content.Tile, ...]:
    """Verdict, leading cause, and share that is closed; without a cause, with a model, the size of the gap."""
    count, closure = len(found.causes), found.closure
    none = "no significant gap" if found.verdict == "no_gap" else "no cause named"
    named = f"{count} cause{'s' if count > 1 else ''} named" if count else none
    return (
        content.Tile("Verdict", "", words.VERDICTS[found.verdict], named),
        *(
            content.Tile(
                "Leading cause",
                f"probability {probability_words(lead.probability)}",
                found.suspects[lead.effect].label,
                f"{lead.effect}: {cause_words(found, lead)}",
            )
            for lead in found.causes[:1]
        ),
        *(
            []
            if closure is None or not count
            else [
                content.Tile(
                    "Gap closed",
                    words.closed_on(found),
                    share_words(closure.share),
                    f"95 %: {words.interval_words(closure)}",
                )
            ]
        ),
        *([] if found.causes or isinstance(found, LineDiagnosis) else _extremes(found)),
    )


def _extremes(found: ModelDiagnosis) -> list[content.Tile]:
    """The most significant mean, and the strongest sign of something unexplained or how many effects were tried."""
    tiles = [
        content.Tile(
            "Largest gap", f"limit {STANDS_OUT:g}", f"{abs(worst.z):.1f}",
            f"standard uncertainties: {NAMES[worst.channel]}, {phase_words(worst.phase)}, {load_words(worst.load)}",
        )
        for worst in figures.worst_first(found)[:1]
    ]  # fmt: skip
    if found.remainder is None or not found.remainder.alarms:
        return [*tiles, content.Tile("Effects tried", "", f"{len(found.suspects)}", "none is named")]
    alarm = found.remainder.alarms[0]
    return [
        *tiles,
        content.Tile(
            "Strongest sign",
            f"limit {alarm.limit:g}",
            significant(alarm.size, 2),
            f"{tables.SIGNS[alarm.kind]}: {about_words(alarm.about, words.files_of(found))}",
        ),
    ]


def _points(found: ModelDiagnosis | LineDiagnosis) -> tuple[content.Point, ...]:
    """What a reader must know after ten seconds, in sentences."""
    if isinstance(found, LineDiagnosis):
        small = small_words(found)
        sign, steady = [content.Point("Sign corrected", flipped_words(found), "warn")], words.again_words(found)
        others = [content.Point("Not needed", f"{small}." if small else "")]
    else:
        clean, sign, steady = found.verdict == "no_gap", [], stability_words(found)
        others = [
            content.Point("What was checked", words.checked_words(found) if clean else ""),
            content.Point("What would show", _seen_words(found) if clean else ""),
        ]
    hidden, residual = found.unnamed if found.causes else (), found.remainder
    return tuple(
        point
        for point in (
            content.data_point(words.origins_of(found)),
            *sign,
            content.Point(
                "Verdict", words.verdict_words(found), "good" if found.verdict in ("no_gap", "explained") else "warn"
            ),
            *(content.Point("Finding", text, "warn") for text in finding_words(found)),
            *(content.Point("Your simulation", text) for text in own_simulation_words(found)),
            content.Point("Where", f"{words.where_words(found)} {words.arises_words(found)}".strip()),
            *_cause_points(found),
            content.Point("What it costs", "" if isinstance(found, LineDiagnosis) else cost_words(found)),
            content.Point("How sure", words.sure_words(found)),
            content.Point("Minor", minor_words(found)),
            content.Point("How far", words.closure_words(found)),
            content.Point(
                "How steady",
                steady,
                "warn" if any(c.stability and c.stability.trends for c in found.causes) else "plain",
            ),
            content.Point("What next", words.experiment_words(found)),
            content.Point(
                "Residual",
                words.remainder_words(found) if residual else "",
                "warn" if residual and residual.alarms else "plain",
            ),
            *others,
            content.Point(
                "Not named",
                f"The best fit used {', '.join(hidden)} too. While the residual is significant they may only imitate its "
                "cause, so they are not named."
                if hidden
                else "",
                "warn",
            ),
        )
        if point.text
    )


def _cause_points(found: DiagnosisResult) -> list[content.Point]:
    """What each cause is, and its numbers; of several causes with a model the names alone, as a table has their numbers."""
    if len(found.causes) > 1 and isinstance(found, ModelDiagnosis):
        names = ", ".join(named(found, cause.effect) for cause in found.causes)
        checks = " ".join(text for cause in found.causes if (text := check_words(found, cause)))
        return [content.Point("Causes", f"{names}; the table of causes has their numbers. {checks}".rstrip())]
    return [
        content.Point(f"Cause {k}" if len(found.causes) > 1 else "Cause", _cause_text(found, cause))
        for k, cause in enumerate(found.causes, start=1)
    ]


def _cause_text(found: DiagnosisResult, cause: NamedCause) -> str:
    """What a cause is, its numbers and its alternatives."""
    what, others = meaning_words(found, cause.effect), alternatives_words(cause, " or ")
    name, numbers = named(found, cause.effect), cause_words(found, cause)
    text = f"{name}: {what[:1].lower()}{what[1:].rstrip('.')}. Found: {numbers}. {check_words(found, cause)}".rstrip()
    return f"{text} Or in its place {others}." if others else text


EXAMPLES = ("copper_heating", "gear_mesh_loss", "line_friction", "precharge")
"""One effect of each stage, which shows how small a gap would have been named."""


def _seen_words(found: ModelDiagnosis) -> str:
    """How small some effects might have been and still be named."""
    parts = ", ".join(
        f"{how.what} {threshold_words(one, how)}"
        for one in found.thresholds
        for how in (display_of(one.effect, found.suspects[one.effect].parameter, one.unit),)
        if one.effect in EXAMPLES and one.value is not None
    )
    return f"Alone it would have been named from: {parts}. All effects are in the table of thresholds." if parts else ""


# ---------------------------------------------------------------------------------------------------------- the evidence
def _where(found: ModelDiagnosis) -> content.Section:
    word = words.word_of(found)
    return where_section(
        found,
        content.picture(
            figures.gap_map(found), "map",
            f"Map of the gap: {word} minus {simulated_words(found)}, as a mean over each phase of each log, in "
            f"standard uncertainties (z). Bold and coloured: beyond {STANDS_OUT:g}; blue: the log lies above the "
            "simulation, orange: below.",
            "Matrix of numbers by channel and phase (rows) and load (columns); the largest are in the table.",
        ),
        content.Note(YARDSTICKS),
        tables.places_table(found),
        content.Note(STAGE_BY_STAGE),
        content.picture(
            figures.stage_map(found), "stages",
            f"Stage by stage: {word} minus what each stage makes of its own inputs from the log, by the model of the rig file, "
            "in standard uncertainties; numbers and colours as in the map.",
            "Matrix of numbers by stage and phase (rows) and load (columns); the largest are in the table.",
        ),
        tables.stages_table(found),
    )  # fmt: skip


def _which(found: ModelDiagnosis) -> content.Section:
    return which_section(
        found,
        content.picture(
            numbers_figure(found), "numbers",
            "What was found of each cause, beside the value that the rig file gives, how well that is known, and "
            "what is plausible.",
            "Points with bars on one axis for each number; the values are in the table of causes.",
        ),
        content.picture(
            profile_figure(found), "rolloff",
            "Back-EMF constant over the stator current, as far as the logs reach (the paper's Fig. 18e). The shape "
            "is free: it may fall between any two knots and never rise; the band is narrow where a knot lies at "
            "its bound.",
            "A falling curve with a band; its value at 10 A is in the table of causes.",
        ),
        content.picture(
            stability_figure(found), "stability",
            "Number of each cause from every run alone, with its 95 % interval; all else is as the joint fit has it. Band: the "
            "joint number with its interval. Runs that hardly depend on a cause have no mark; a much longer interval leaves "
            "its panel. The title marks a number that changes more than the intervals allow.",
            "Points with error bars for every run, and a band; the values are in the JSON.",
        ),
        content.picture(
            odds_figure(found), "odds",
            f"{'Probability of each effect (green: named), and odds' if found.causes else 'Odds'} of the likeliest of "
            f"{len(found.sets)} sets of effects that were fitted, against the best one: a bar that is as long as the first "
            "would be as likely, one of no length is ruled out.",
            "Bars of probabilities; those of the causes are in the table.",
        ),
    )  # fmt: skip


def _logged_word(found: ModelDiagnosis) -> str:
    return "measured" if words.word_of(found) == "measured" else "logged"


def _histories(found: ModelDiagnosis, item: CycleHistory) -> content.Section:
    logged = _logged_word(found)
    effects = " and with the fitted effects and tolerances" if item.caused is not None else ""
    return content.section(
        "histories", "Time histories",
        content.picture(
            histories_figure(found, item, logged), "histories",
            f"{item_words(found, item)}, where the gap is largest: {logged}, and simulated over time: {baseline_words(found)}"
            f"{effects} (the paper's Figs 11 and 12). Below each channel its residual, {logged} minus "
            f"simulated. {zeros_words(found, item)} In the page, other runs and cycles can be chosen.",
            "Lines over time for every channel, with the residual below.",
            interactive=True,
        ),
    )  # fmt: skip


def _how_far(found: ModelDiagnosis, both: Sides) -> content.Section:
    log = most_telling(found)
    run, word = found.data.logs[log].run, words.word_of(found)
    fresh = found.closure is not None and log in found.closure.withheld
    after = ", and with the fitted effects by a fit without this log" if fresh else ""
    names = " and of ".join(NAMES[channel] for channel in figures.error_panels(found))
    limit = (
        " Dashed: where the stator carries its rated current, as the model has it."
        if found.rig.generator.i_rated
        else ""
    )
    return content.section(
        "how-far", "How far the gap closes" if found.causes else "The gap in time and over current",
        content.picture(
            figures.closure_bars(found), "closure-bars",
            f"Misfit before and after, in units of the noise, {words.closed_on(found)}.",
            "Pairs of points for each channel; the values are in the table.",
        ),
        tables.closure_table(found),
        content.picture(
            figures.error_figure(found, both, word), "errors",
            f"Error of {names} in the payouts of all logs; one mark is a block (the paper's Fig. "
            f"18b).{limit}",
            "Clouds of marks before and after about zero.",
        ),
        content.picture(
            figures.history(found, both, log, word), "history",
            f"{run.name} ({load_words(run.load)}): {word} minus {simulated_words(found, 'block by block')}"
            f"{after}. The zeros of the log's sensors are taken off alike.",
            "Lines over time for every channel; the mean squares are in the table.",
        ),
    )  # fmt: skip


def _next(found: DiagnosisResult, caption: str, how: str) -> content.Section:
    """What to test next.

    Parameters
    ----------
    how : what was tried, and how the difference was computed
    """
    plan = found.experiment
    if plan is None:
        return content.section("next", "What to test next")
    rows = (
        *([] if plan.load is None else [("Load", load_words(plan.load))]),
        ("Motion", words.profile_words(plan)),
        ("Distinguishes", " from ".join(plan.separates)),
        ("They would differ by", f"{apart_words(plan.expected_z)} standard deviations"),
    )
    return content.section(
        "next", "What to test next", content.pairs_table("experiment", caption, rows), content.Note(how)
    )


def _method(texts: Sequence[str]) -> content.Section:
    """The method in short; what stands before the first full stop of a paragraph is what it is about."""
    return content.section(
        "method", "Method and its limits", *(content.Note(*reversed(text.split(". ", 1))) for text in texts)
    )


def _provenance(found: ModelDiagnosis | LineDiagnosis, command: str) -> content.Section:
    rig, sets = found.rig, len(found.sets)
    if isinstance(found, LineDiagnosis):
        logs, judged, source, start = line_logs_table(found), "Judged", "Source of the logs and the rig", ""
        fits = f"{sets} sets of suspects, {found.moments.folds} times each"
    else:
        logs, judged, source = tables.diagnosed_logs_table(found), "Withheld", "Source of the rig's numbers"
        start = words.start_words(found)
        tolerances = sum(n.kind != "discrepancy" for n in found.data.nuisances)
        fits = f"{sets} set{'s' if sets > 1 else ''} of effects; {tolerances} tolerances beside each"
    rows = [
        ("Campaign", found.title),
        (judged, words.judged_words(found)),
        ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
        (source, rig.source),
        ("SHA-256 of the rig file", content.file_digest(rig.path)),
        *([("Start of the fit", start)] if start else []),
        ("Suspects", ", ".join(found.suspects)),
        ("Fits", fits),
        ("Seed of the resampled cycles", str(found.seed)),
    ]
    return content.provenance_section(rows, command, logs)
