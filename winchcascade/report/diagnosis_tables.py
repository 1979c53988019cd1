"""Tables of the report of a diagnosis, and the sections that it has with and without a model of the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence

from winchcascade.core.quantity import find_unit
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.closure import PULLED, ROUGH, block_rms
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Place, StagePlace
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report import diagnosis_words as words
from winchcascade.report import sheet as content
from winchcascade.report.cause_words import meaning_words, named, numbers_of
from winchcascade.report.diagnosis_causes import threshold_words
from winchcascade.report.diagnosis_figures import worst_first
from winchcascade.report.digits import number, significant, uncertain
from winchcascade.report.gap_words import (
    NAMES,
    about_words,
    alarm_meaning,
    baseline_words,
    differs_words,
    display_of,
    nuisance_words,
    phase_words,
    probability_words,
    share_words,
    signed,
)
from winchcascade.report.model_account import COMPARED
from winchcascade.report.sheet import TableColumn, number_column, text_column
from winchcascade.report.wording import load_words

MAX_PLACES, MAX_NUISANCES = 12, 10
"""Rows of the places with the largest gap, and of the nuisances that the fit moves most."""

SIGNS = {
    "structure": "residual over the noise",
    "scatter": "scatter over the noise",
    "ripple": "from mean to mean, over the noise",
    "nuisance": "moved, in uncertainties",
    "drift": "digits of the chance",
    "range": "beyond what is plausible",
    "cancelling": "each alone over both together",
    "worse": "worse than without, over the noise",
    "energy": "residual over its uncertainty",
    "residual": "residual of the efficiency",
}
"""Kinds of alarms, and the unit of their size."""

MIN_PULL = 1.0
"""Nuisances within this many of their standard uncertainties are not listed."""


# ------------------------------------------------------------------------------------------------------------ the causes
def causes_table(found: ModelDiagnosis | LineDiagnosis) -> content.Table | None:
    """Every cause with its numbers, probability and alternatives; without a model with the numbers of the withheld cycles."""
    numbers = [n for cause in found.causes for n in numbers_of(found, cause)]
    has_rivals = any(cause.look_alikes for cause in found.causes)
    if isinstance(found, LineDiagnosis):
        again = [
            f"{n.value} ({n.beside})" if found.again else "–"
            for cause in found.causes
            for n in numbers_of(found, cause, again=bool(found.again))
        ]
        return content.formatted_table(
            "causes",
            "Effects that are needed, the one that closes most first.",
            (
                text_column("Effect"), text_column("What changes"), number_column("Found", "in the fit"),
                number_column("Interval", "95 %"),
                number_column("Withheld cycles alone", "value (95 %)"), number_column("Probability"),
                text_column("Alternatives"),
            ),
            [
                (n.named, n.what, n.value, n.beside, text, n.probability, n.alternatives)
                for n, text in zip(numbers, again, strict=True)
            ],
            "Numbers are in units of the line: no drum radius is needed. Intervals allow for the correlation of samples "
            "within a cycle and, where the inertia is fitted, for the width of the slope that gives the acceleration.",
        )  # fmt: skip
    return content.formatted_table(
        "causes",
        "Effects that are needed, most important first.",
        (
            text_column("Effect"), text_column("Stage"), text_column("What changes"), number_column("Found"),
            number_column("Interval", "95 %"), number_column("Probability"), text_column("What the rig file leaves out"),
        ),
        [
            (n.named, n.stage, n.what, n.value, n.beside, n.probability, meaning_words(found, n.effect) if n.effect else "")
            for n in numbers
        ],
        "Numbers with a sign are changes from the rig file's value, or errors; intervals (normal, coverage 95 %) include the "
        "tolerance of that value."
        + (" The table of alternatives lists what would explain the same data about as well." if has_rivals else ""),
    )  # fmt: skip


# --------------------------------------------------------------------------------------------------------------- the map
def places_table(found: ModelDiagnosis) -> content.Table | None:
    """The places of the map with the largest gap, with their yardsticks."""
    ranked = worst_first(found)
    significant_ones = [p for p in ranked if abs(p.z) > STANDS_OUT]
    return content.formatted_table(
        "places",
        f"Where the gap is largest: {len(significant_ones) or 'none'} of {len(ranked)} places deviate by more than "
        f"{STANDS_OUT:g} standard uncertainties.",
        (text_column("Channel"), *_yardsticks("zero")),
        [_place_row(p) for p in significant_ones[: content.row_limit(MAX_PLACES)] or ranked[:3]],
        "Bias: logged minus simulated, the zero of the log's sensor taken off. The three columns beside it are standard "
        "uncertainties of the bias; u is their root of squares.",
    )


def _yardsticks(zeros: str) -> tuple[TableColumn[object], ...]:
    """Columns of a place of a map, but for the first.

    Parameters
    ----------
    zeros : what the noise holds beside noise
    """
    return (
        text_column("Phase"), text_column("Load"), text_column("Unit"), number_column("Bias"),
        number_column("Noise", f"and {zeros}"), number_column("Cycles", "repeat to"),
        number_column("Tolerance", "of the rig"), number_column("z", "bias / u"),
    )  # fmt: skip


def _place_row(p: Place | StagePlace) -> tuple[str, ...]:
    unit, factor = COMPARED[p.channel]
    return (
        NAMES[p.channel], phase_words(p.phase), load_words(p.load), unit, significant(p.bias * factor, 3),
        *(significant(x * factor, 2) for x in (p.u_noise, p.u_repeat, p.u_tolerance)), signed(p.z),
    )  # fmt: skip


def stages_table(found: ModelDiagnosis) -> content.Table | None:
    """The stages that deviate most from their own inputs: of each phase the worst load."""
    worst = {(p.stage, p.phase): p for p in sorted(found.stages, key=lambda p: abs(p.z))}
    ranked = sorted(worst.values(), key=lambda p: -abs(p.z))
    out = sum(abs(p.z) > STANDS_OUT for p in found.stages)
    rows = []
    for p in [p for p in ranked if abs(p.z) > STANDS_OUT] or ranked[:3]:
        channel, phase, load, unit, *numbers = _place_row(p)
        inputs = ", ".join(NAMES[name] for name in p.inputs if name != "velocity") or "velocity"
        rows.append((f"{p.stage}: {channel} ({unit})", inputs, phase, load, *numbers))
    phase_column, load_column, _, *others = _yardsticks("zeros")
    return content.formatted_table(
        "stages",
        f"Stages with their logged inputs: {out or 'none'} of {len(found.stages)} places deviate by more than {STANDS_OUT:g} "
        "standard uncertainties; of each stage and phase the load with the largest z.",
        (text_column("Stage: output"), text_column("From"), phase_column, load_column, *others),
        rows,
        "Bias: logged minus what the stage makes of its inputs; no zero is taken off, so the noise includes those of "
        "output and inputs. Every stage but the load follows the line's velocity too. The generator's resistance and "
        "inductance count in gearbox and generator alike.",
    )


# ----------------------------------------------------------------------------------------------- closure and the residual
def closure_table(found: ModelDiagnosis) -> content.Table | None:
    """Root mean squares before and after on the withheld logs, beside the noise."""
    if found.closure is None:
        return None
    rows = [
        (
            NAMES[name] + ", worse" * x.worse,
            COMPARED[name][0],
            *(significant(v * COMPARED[name][1], 2) for v in (x.before, x.after, x.noise)),
            *(significant(v / x.noise, 2) if x.noise else "–" for v in (x.before, x.after)),
        )
        for name, x in found.closure.channels.items()
    ]
    loads = ", ".join(load_words(found.data.logs[k].run.load) for k in found.closure.withheld)
    return content.formatted_table(
        "closure",
        f"Misfit {words.closed_on(found)} ({loads}): root mean squares of means over blocks.",
        (
            text_column("Channel"), text_column("Unit"), number_column("Before", baseline_words(found)),
            number_column("After", "fitted effects"),
            number_column("Noise", "of a block"), number_column("Before", "over noise"),
            number_column("After", "over noise"),
        ),
        rows,
        f"Share of the explainable gap that is closed: {share_words(max(found.closure.share, 0.0))}, 95 %: "
        f"{words.interval_words(found.closure)}; it counts what exceeds the noise, in squares, over channels and logs.",
    )  # fmt: skip


def alarms_table(found: ModelDiagnosis) -> content.Table | None:
    """Every sign of something unexplained."""
    return content.formatted_table(
        "alarms",
        "Signs of something that the named causes do not explain, worst first.",
        (
            text_column("Where"),
            text_column("Sign"),
            text_column("May mean"),
            number_column("Size"),
            number_column("Limit"),
        ),
        [
            (
                about_words(a.about, words.files_of(found)),
                SIGNS[a.kind],
                alarm_meaning(a),
                significant(a.size, 2),
                f"{a.limit:g}",
            )
            for a in (() if found.remainder is None else found.remainder.alarms)
        ],
    )


def roughness_table(found: ModelDiagnosis) -> content.Table | None:
    """Root mean squares of whitened blocks by channel and phase, without any cause and with those named."""
    null, best = (block_rms(found.data, fit.z) for fit in (found.found.null, found.found.best))
    several = bool(found.found.best.names)
    return content.formatted_table(
        "roughness",
        "The residual in every channel and phase, in units of its noise: root mean square over all logs of the fit.",
        (
            text_column("Channel"),
            text_column("Phase"), *([number_column("Tolerances alone", "fitted")] if several else []),
            number_column("With the effects", "fitted") if several else number_column("Residual", "tolerances fitted"),
        ),
        [
            (NAMES[c], phase_words(p), *([number(null.get((c, p)), 2)] if several else []), number(best[c, p], 2))
            for c in CHANNELS
            for p in PHASES
            if (c, p) in best
        ],
        f"1 is noise alone; beyond {ROUGH:g} the residual has a structure. Single blocks count as 8 at most.",
    )  # fmt: skip


def nuisances_table(found: ModelDiagnosis) -> content.Table | None:
    """The nuisances that the fit moves most, in their standard uncertainties."""
    files = words.files_of(found)
    pulls = sorted(zip(found.data.nuisances, found.found.best.nu.tolist(), strict=True), key=lambda pair: -abs(pair[1]))
    return content.formatted_table(
        "nuisances",
        f"What the fit moved within its tolerance: {len(found.data.nuisances)} numbers, the most moved ones.",
        (
            text_column("Number"), number_column("Moved by"), number_column("Standard uncertainty", "as known"),
            text_column("Unit"),
            number_column("In uncertainties"),
        ),
        [_nuisance_row(n, x, files) for n, x in pulls[: content.row_limit(MAX_NUISANCES)] if abs(x) > MIN_PULL],
        "Numbers of the rig file, loads, gains and zeros of the sensors are known to a tolerance only, and no model is exact; "
        "every fit lets them move within it, at a price. A discrepancy of the model is a share of the channel's plateau in the "
        f"log. A number that moves beyond {PULLED:g} of its uncertainties is a sign of something else.",
    )  # fmt: skip


_SHARES = ("gain", "load", "discrepancy")
"""Kinds of nuisances that are shares."""


def _nuisance_row(n: Nuisance, x: float, files: Sequence[str]) -> tuple[str, ...]:
    factor, unit = (100.0, "%") if n.kind in _SHARES else (1e3, "ms") if n.kind == "timing" else (1.0, n.unit)
    if n.kind == "zero":
        unit, factor = COMPARED[n.name]
    elif n.kind == "rig":
        known = find_unit(n.unit)
        factor = 1.0 if known is None else 1.0 / known.factor
    shown = "" if unit == "1" else unit.replace(".", "·").replace("m2", "m²").replace("m3", "m³")
    return (nuisance_words(n, files), significant(x * n.sd * factor, 2), uncertain(n.sd * factor), shown, signed(x))


# ---------------------------------------------------------------------------------------------------------- the suspects
def suspects_table(found: ModelDiagnosis) -> content.Table | None:
    """Suspects that were considered and are not needed, with what they would change."""
    scale, linear, best = found.found.scale, found.found.linear, found.found.best.names
    here, named = linear.evidence(best, scale), {cause.effect for cause in found.causes}
    gained = {
        name: linear.evidence((*best, name), scale) - here if name not in best else 0.0
        for name in found.suspects
        if named and name not in named
    }
    return content.formatted_table(
        "suspects",
        "Effects that were considered and are not needed beside the causes, the nearest first.",
        (
            text_column("Effect"), text_column("Stage"), text_column("What it would be"),
            number_column("Odds for it", "beside the causes"),
        ),
        [
            (
                name, found.suspects[name].stage, meaning_words(found, name),
                "in the fit" if name in best else _odds_words(gained[name]),
            )
            for name in sorted(gained, key=lambda name: -gained[name])
        ],
        "Odds of the named causes with the effect against those without, estimated from the slopes of the fit; below "
        "1 : 1 the effect explains less than one more free number would by chance.",
    )  # fmt: skip


def _odds_words(gained: float) -> str:
    """Odds from a difference of evidence.

    >>> _odds_words(-0.7), _odds_words(-9.3), _odds_words(1.1), _odds_words(-40.0)
    ('1 : 2', '1 : 11 000', '3 : 1', '< 1 : 1 000 000')
    """
    if gained < -math.log(1e6):
        return "< 1 : 1 000 000"
    text = f"{float(f'{math.exp(min(abs(gained), 25.0)):.1e}'):,.0f}".replace(",", " ")
    return f"{text} : 1" if gained > 0.0 else f"1 : {text}"


def thresholds_table(found: ModelDiagnosis) -> content.Table | None:
    """How large each effect would have to be to be named in these logs."""
    return content.formatted_table(
        "thresholds",
        "How large each effect, acting alone, would have to be to be named in these logs.",
        (text_column("Effect"), text_column("Stage"), text_column("Number"), number_column("Named from")),
        [
            (
                one.effect, found.suspects[one.effect].stage, how.what, threshold_words(one, how),
            )
            for one in found.thresholds
            for how in (display_of(one.effect, found.suspects[one.effect].parameter, one.unit),)
        ],
        "Of effects as large as this, nine in ten would be named. Estimated from the slopes of the fit by the rule that "
        "chooses causes; where an effect may have either sign one is listed, the other is about alike.",
    )  # fmt: skip


def diagnosed_logs_table(found: ModelDiagnosis) -> content.Table | None:
    """Every log: its load, its part in the diagnosis, and its hash."""
    once = () if found.closure is None else found.closure.withheld
    return content.formatted_table(
        "logs",
        "Logs of the campaign.",
        (
            text_column("Log"),
            text_column("Load"),
            text_column("Part", "in the fits"),
            number_column("Cycles"),
            text_column("SHA-256"),
        ),
        [
            (
                log.run.name,
                load_words(log.run.load),
                "withheld" if k in found.data.withheld else "left out once" if k in once else "in every fit",
                f"{log.course.blocks.cycle.max(initial=0)}",
                log.run.sha256 or "–",
            )
            for k, log in enumerate(found.data.logs)
        ],
    )


def where_section(found: ModelDiagnosis | LineDiagnosis, *blocks: content.Block | None) -> content.Section:
    """Where the gap lies."""
    return content.section(
        "where", "Where a gap was looked for" if found.verdict == "no_gap" else "Where the gap lies", *blocks
    )


def which_section(found: ModelDiagnosis | LineDiagnosis, *blocks: content.Block | None) -> content.Section:
    """Causes, what was compared to find them, and alternative explanations."""
    heading = "Which causes, and how sure" if found.causes else "What was tried"
    return content.section(
        "which",
        heading,
        causes_table(found),
        *blocks,
        content.formatted_table(
            "rivals",
            f"Alternatives: {words.phrases_of(found).suspect}s that would {words.phrases_of(found).alike} about as well in "
            "place of a cause, and where the two predictions differ most.",
            (
                text_column("Effect"),
                text_column("Alternative"),
                number_column("Probability", "of the alternative"),
                text_column("What it is"),
                text_column("They differ most in"),
            ),
            [
                (
                    named(found, cause.effect),
                    named(found, rival.effect),
                    probability_words(rival.probability),
                    meaning_words(found, rival.effect),
                    differs_words(rival.differs),
                )
                for cause in found.causes
                for rival in cause.look_alikes
            ],
        ),
    )
