"""Tables of the report of a diagnosis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winchcascade.core.quantity import find_unit
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_location import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.remainder import PULLED, ROUGH, block_rms
from winchcascade.report import diagnosis_words as words
from winchcascade.report.diagnosis_figures import signed, worst_first
from winchcascade.report.diagnosis_names import (
    display_of,
    load_words,
    nuisance_words,
    phase_words,
    probability_words,
    share_words,
)
from winchcascade.report.diagnosis_odds import threshold_words, thresholds
from winchcascade.report.digits import number, significant, uncertain
from winchcascade.report.model_account import COMPARED
from winchcascade.report.report_model import Table

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.gap_map import Place
    from winchcascade.diagnosis.nuisances import Nuisance
    from winchcascade.diagnosis.stagewise import StagePlace

MOST_PLACES, MOST_NUISANCES = 12, 10
"""Rows of the places that stand out most, and of the nuisances that are pulled most."""

SIGNS = {
    "structure": "left, over the noise",
    "scatter": "scatter, over the noise",
    "ripple": "from mean to mean, over the noise",
    "nuisance": "moved, in uncertainties",
}
"""Kinds of alarms, and what their size counts."""

LEAST_PULL = 1.0
"""Nuisances within this many of their standard uncertainties are not listed."""


def causes_table(found: ModelDiagnosis | LineDiagnosis) -> Table | None:
    """Every cause with its numbers, probability and rivals; without a model with the numbers of the withheld cycles alone."""
    line, rows = isinstance(found, LineDiagnosis), []
    for cause in found.causes:
        for k, (name, value) in enumerate(cause.parameters.items()):
            again = (_again(found, cause.effect, name),) if isinstance(found, LineDiagnosis) else ()
            rivals = ", ".join(r.effect for r in cause.rivals) or "none"
            first = ("", "") if k else (cause.effect, cause.stage)
            last = ("", "") if k else (probability_words(cause.probability), rivals)
            rows.append(
                (*first[: 1 if line else 2], *words.number_row(found, cause.effect, name, value), *again, *last)
            )
    if not rows:
        return None
    if line:
        return Table(
            id="causes",
            caption="Effects that are needed, the one that closes most first.",
            head=("Effect", "What changes", "Found", "Interval", "Withheld cycles alone", "Probability", "Rivals"),
            units=("", "", "in the fit", "95 %", "value (95 %)", "", ""),
            rows=tuple(rows),
            text_columns=(0, 1, 6),
            note="Numbers are in units of the line: no drum radius is needed. Intervals allow for the correlation of samples "
            "within a cycle and, where the inertia is fitted, for the width of the slope that gives the acceleration.",
        )
    return Table(
        id="causes",
        caption="Effects that are needed, most important first.",
        head=("Effect", "Stage", "What changes", "Found", "Interval", "Probability", "Rivals"),
        units=("", "", "", "", "95 %", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1, 2, 6),
        note="Numbers with a sign are changes from the rig file's value, or errors; intervals include the "
        "tolerance of that value. Rivals would explain the same data about as well in place of the effect.",
    )


def _again(found: LineDiagnosis, effect: str, name: str) -> str:
    """A number as the withheld cycles alone give it, with its interval."""
    if effect not in found.again:
        return "–"
    _, value, interval = words.number_row(found, effect, name, found.again[effect])
    return f"{value} ({interval})"


def meanings_table(found: ModelDiagnosis) -> Table | None:
    """What the named effects and their rivals are."""
    names = dict.fromkeys([c.effect for c in found.causes] + [r.effect for c in found.causes for r in c.rivals])
    if not names:
        return None
    rows = tuple((name, found.suspects[name].stage, words.meaning_words(found, name)) for name in names)
    return Table(
        id="meanings", caption="What these effects are.", head=("Effect", "Stage", "What the rig file leaves out"),
        units=("", "", ""), rows=rows, text_columns=(0, 1, 2),
    )  # fmt: skip


def rivals_table(found: ModelDiagnosis | LineDiagnosis) -> Table | None:
    """What would tell each cause from its rivals in the logs at hand."""
    rows = tuple(
        (cause.effect, rival.effect, probability_words(rival.probability), words.differs_words(rival.differs))
        for cause in found.causes
        for rival in cause.rivals
    )
    if not rows:
        return None
    return Table(
        id="rivals",
        caption="Rivals: suspects that predict about as well in place of a cause, and where the two differ most."
        if isinstance(found, LineDiagnosis)
        else "Rivals: effects that explain the same data about as well, and where the two explanations differ most.",
        head=("Effect", "Rival", "Probability", "They differ most in"),
        units=("", "", "of the rival", ""),
        rows=rows,
        text_columns=(0, 1, 3),
    )


def places_table(found: ModelDiagnosis) -> Table | None:
    """The places of the map that stand out most, with their yardsticks."""
    ranked = worst_first(found)
    rows = [_place_row(p) for p in [p for p in ranked if abs(p.z) > STANDS_OUT][:MOST_PLACES] or ranked[:3]]
    if not rows:
        return None
    out = sum(abs(p.z) > STANDS_OUT for p in ranked)
    return Table(
        id="places",
        caption=f"Where the gap is largest: {out or 'none'} of {len(ranked)} places stand out by more than {STANDS_OUT:g} "
        "standard uncertainties.",
        head=("Channel", "Phase", "Load", "Unit", "Bias", "Noise", "Cycles", "Tolerance", "z"),
        units=("", "", "", "", "", "and zero", "repeat to", "of the rig", "bias / u"),
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3),
        note="Bias: logged minus simulated, the zero of the log's sensor taken off. The three columns beside it "
        "are standard uncertainties of the bias; u is their root of squares.",
    )


def _place_row(p: Place | StagePlace) -> tuple[str, ...]:
    unit, factor = COMPARED[p.channel]
    u = [x * factor for x in (p.u_noise, p.u_repeat, p.u_tolerance)]
    return (
        words.NAMES[p.channel], phase_words(p.phase), load_words(p.load), unit, significant(p.bias * factor, 3),
        *(significant(x, 2) for x in u), signed(p.z),
    )  # fmt: skip


def stages_table(found: ModelDiagnosis) -> Table | None:
    """The stages that are off most when each is given its own inputs: of each phase the worst load."""
    worst: dict[tuple[str, str], StagePlace] = {}
    for p in sorted(found.stages, key=lambda p: abs(p.z)):
        worst[p.stage, p.phase] = p
    ranked = sorted(worst.values(), key=lambda p: -abs(p.z))
    rows = [_stage_row(p) for p in [p for p in ranked if abs(p.z) > STANDS_OUT] or ranked[:3]]
    if not rows:
        return None
    out = sum(abs(p.z) > STANDS_OUT for p in found.stages)
    return Table(
        id="stages",
        caption=f"Stages given their own inputs: {out or 'none'} of {len(found.stages)} places are off by more than "
        f"{STANDS_OUT:g} standard uncertainties; of each stage and phase the load with the largest z.",
        head=("Stage: output", "From", "Phase", "Load", "Bias", "Noise", "Cycles", "Tolerance", "z"),
        units=("", "", "", "", "", "and zeros", "repeat to", "of the rig", "bias / u"),
        rows=tuple(rows),
        text_columns=(0, 1, 2, 3),
        note="Bias: logged minus what the stage makes of its inputs; no zero is taken off, so the noise includes those of "
        "output and inputs. Every stage but the load follows the line's velocity too. The generator's resistance and "
        "inductance count in gearbox and generator alike.",
    )


def _stage_row(p: StagePlace) -> tuple[str, ...]:
    channel, phase, load, unit, *numbers = _place_row(p)
    inputs = ", ".join(words.NAMES[name] for name in p.inputs if name != "velocity") or "velocity"
    return (f"{p.stage}: {channel} ({unit})", inputs, phase, load, *numbers)


def closure_table(found: ModelDiagnosis) -> Table | None:
    """Root mean squares before and after on the withheld logs, beside the noise."""
    closure = found.closure
    if closure is None:
        return None
    rows = []
    for name, x in closure.channels.items():
        unit, factor = COMPARED[name]
        values = [v * factor for v in (x.before, x.after, x.noise)]
        ratios = [significant(v / x.noise, 2) if x.noise else "–" for v in (x.before, x.after)]
        rows.append((words.NAMES[name], unit, *(significant(v, 2) for v in values), *ratios))
    loads = ", ".join(load_words(found.data.logs[k].run.load) for k in closure.withheld)
    return Table(
        id="closure",
        caption=f"Misfit on logs that did not take part in the fit ({loads}): root mean squares of means over "
        "blocks of 0.44 s.",
        head=("Channel", "Unit", "Before", "After", "Noise", "Before", "After"),
        units=("", "", "rig as given", "fitted effects", "of a block", "over noise", "over noise"),
        rows=tuple(rows),
        text_columns=(0, 1),
        note=f"Share of the explainable gap that is closed: {share_words(closure.share)}, 95 %: "
        f"{words.interval_words(found)}; it counts what exceeds the noise, in squares, over channels and logs.",
    )


def alarms_table(found: ModelDiagnosis) -> Table | None:
    """Every sign of something unexplained."""
    if found.remainder is None or not found.remainder.alarms:
        return None
    files = words.files_of(found)
    rows = tuple(
        (
            words.about_words(a.about, files),
            SIGNS[a.kind],
            words.alarm_meaning(a),
            significant(a.size, 2),
            f"{a.limit:g}",
        )
        for a in found.remainder.alarms
    )
    return Table(
        id="alarms", caption="Signs of something that the named causes do not explain, worst first.",
        head=("Where", "Sign", "May mean", "Size", "Limit"), units=("",) * 5, rows=rows, text_columns=(0, 1, 2),
    )  # fmt: skip


def roughness_table(found: ModelDiagnosis) -> Table | None:
    """Root mean squares of whitened blocks by channel and phase, without any cause and with those named."""
    null, best = (block_rms(found.data, fit.z) for fit in (found.found.null, found.found.best))
    several = bool(found.found.best.names)
    rows = [
        (words.NAMES[c], phase_words(p), *([number(null.get((c, p)), 2)] if several else []), number(best[c, p], 2))
        for c in CHANNELS
        for p in PHASES
        if (c, p) in best
    ]
    if not rows:
        return None
    return Table(
        id="roughness",
        caption="What is left in every channel and phase, in units of its noise: root mean square over all logs of "
        "the fit.",
        head=("Channel", "Phase", "Tolerances alone", "With the effects") if several else ("Channel", "Phase", "Left"),
        units=("", "", "fitted", "fitted") if several else ("", "", "tolerances fitted"),
        rows=tuple(rows),
        text_columns=(0, 1),
        note=f"1 is noise alone; beyond {ROUGH:g} a structure is left. Single blocks count as 8 at most.",
    )


def nuisances_table(found: ModelDiagnosis) -> Table | None:
    """The nuisances that the fit moves most, in their standard uncertainties."""
    files = words.files_of(found)
    pulls = sorted(zip(found.data.nuisances, found.found.best.nu.tolist(), strict=True), key=lambda pair: -abs(pair[1]))
    rows = [_nuisance_row(n, x, files) for n, x in pulls[:MOST_NUISANCES] if abs(x) > LEAST_PULL]
    if not rows:
        return None
    return Table(
        id="nuisances",
        caption=f"What the fit moved within its tolerance: {len(found.data.nuisances)} numbers, the most moved ones.",
        head=("Number", "Moved by", "Standard uncertainty", "Unit", "In uncertainties"),
        units=("", "", "as known", "", ""),
        rows=tuple(rows),
        text_columns=(0, 3),
        note="Numbers of the rig file, loads, gains and zeros of the sensors are known to a tolerance only; every fit "
        f"lets them move within it, at a price. Beyond {PULLED:g} of its uncertainties a number is taken for a sign of "
        "something else.",
    )


def _nuisance_row(n: Nuisance, x: float, files: list[str]) -> tuple[str, ...]:
    factor, unit = (100.0, "%") if n.kind in ("gain", "load") else (1e3, "ms") if n.kind == "timing" else (1.0, n.unit)
    if n.kind == "zero":
        unit, factor = COMPARED[n.name]
    elif n.kind == "rig":
        known = find_unit(n.unit)
        factor = 1.0 if known is None else 1.0 / known.factor
    return (
        nuisance_words(n, files), significant(x * n.sd * factor, 2), uncertain(n.sd * factor), _unit(unit), signed(x),
    )  # fmt: skip


def _unit(unit: str) -> str:
    """A unit as a report writes it."""
    return "" if unit == "1" else unit.replace(".", "·").replace("m2", "m²").replace("m3", "m³")


def suspects_table(found: ModelDiagnosis) -> Table | None:
    """Suspects that were considered and are not needed, with what they would change."""
    if not found.causes:
        return None
    scale, linear = found.found.scale, found.found.linear
    best = found.found.best.names
    here = linear.evidence(best, scale)
    named = {cause.effect for cause in found.causes}
    rows = []
    for name, kind in found.suspects.items():
        if name in named:
            continue
        gained = linear.evidence((*best, name), scale) - here if name not in best else 0.0
        rows.append(
            (
                gained,
                (
                    name,
                    kind.stage,
                    words.meaning_words(found, name),
                    _odds_words(gained) if name not in best else "in the fit",
                ),
            )
        )
    rows.sort(key=lambda row: -row[0])
    return Table(
        id="suspects",
        caption="Effects that were considered and are not needed beside the causes, the nearest first.",
        head=("Effect", "Stage", "What it would be", "Odds for it"),
        units=("", "", "", "beside the causes"),
        rows=tuple(row for _, row in rows),
        text_columns=(0, 1, 2),
        note="Odds of the named causes with the effect against those without, estimated from the slopes of the fit; below "
        "1 : 1 the effect explains less than one more free number would by chance.",
    )


def _odds_words(gained: float) -> str:
    """Odds from a difference of evidence.

    >>> _odds_words(-0.7), _odds_words(-9.3), _odds_words(1.1), _odds_words(-40.0)
    ('1 : 2', '1 : 11 000', '3 : 1', '< 1 : 1 000 000')
    """
    if gained < -math.log(1e6):
        return "< 1 : 1 000 000"
    size = math.exp(min(abs(gained), 25.0))
    text = f"{float(f'{size:.1e}'):,.0f}".replace(",", " ")
    return f"{text} : 1" if gained > 0.0 else f"1 : {text}"


def thresholds_table(found: ModelDiagnosis) -> Table | None:
    """How large each effect would have to be to be seen in these logs."""
    if found.causes:
        return None
    rows = []
    for one in thresholds(found):
        how = display_of(one.effect, one.name, one.unit)
        rows.append((one.effect, found.suspects[one.effect].stage, how.what, threshold_words(one)))
    return Table(
        id="thresholds",
        caption="How large each effect, acting alone, would have to be to be named in these logs.",
        head=("Effect", "Stage", "Number", "Named from"),
        units=("", "", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1, 2),
        note="Of effects as large as this half would be named, half be lost in the noise. Estimated from the slopes of the fit "
        "by the rule that chooses causes; where an effect may have either sign one is listed, the other is about alike.",
    )


def logs_table(found: ModelDiagnosis) -> Table:
    """Every log: its load, its part in the diagnosis, and its hash."""
    closure = set() if found.closure is None else set(found.closure.withheld)
    rows = []
    for k, log in enumerate(found.data.logs):
        part = "withheld" if k in found.data.withheld else "left out once" if k in closure else "in every fit"
        cycles = int(log.course.blocks.cycle.max(initial=0))
        rows.append((log.run.name, load_words(log.run.load), part, f"{cycles}", log.run.sha256 or "–"))
    return Table(
        id="logs", caption="Logs of the campaign.", head=("Log", "Load", "Part", "Cycles", "SHA-256"),
        units=("", "", "in the fits", "", ""), rows=tuple(rows), text_columns=(0, 1, 2, 4),
    )  # fmt: skip


# --------------------------------------------------------------------- of a winch without a model
MOST_SETS = 12
"""Sets of suspects that are listed; all are in the JSON."""

KILO = 1e-3


def line_suspects_table(found: LineDiagnosis) -> Table:
    """What each suspect is, and what it closes alone and is worth beside the others."""
    choice = found.choice
    rows = []
    for name in found.lines.names:
        other = tuple(n for n in found.lines.names if (n in found.chosen) != (n == name))
        worth = (
            choice.error(other) - choice.error(found.chosen)
            if name in found.chosen
            else choice.error(found.chosen) - choice.error(other)
        )
        rows.append(
            (name, words.LINE_MEANINGS[name], share_words(1.0 - choice.error((name,))), f"{number(100.0 * worth, 1)} %")
        )
    return Table(
        id="suspects",
        caption="What each suspect closes alone, and beside the causes.",
        head=("Suspect", "What it is", "Closes alone", "Beside the causes"),
        units=("", "", "of the squared error", "with it, or lost without it"),
        rows=tuple(rows),
        text_columns=(0, 1),
        note="Shares of the squared error on cycles that the fit did not know. A share below zero predicts worse than nothing.",
    )


def line_places_table(found: LineDiagnosis) -> Table:
    """The gap phase by phase."""
    rows = tuple(
        (
            phase_words(row.phase), f"{row.blocks}", *(significant(x * KILO, 3) for x in (row.bias, row.rms, row.noise)),
            significant(row.u_repeat * KILO, 2), signed(row.z), f"{number(100.0 * row.share, 1)} %",
        )
        for row in found.places
    )  # fmt: skip
    return Table(
        id="places",
        caption=f"Where the gap lies: {words.word_of(found)} power of the winch minus line force times speed, phase by phase.",
        head=("Phase", "Blocks", "Bias", "RMS", "Noise", "Cycles", "z", "Share"),
        units=("", "of 0.44 s", "kW", "kW", "of a block, kW", "repeat to, kW", "bias / u", "of the squares"),
        rows=rows,
        note="Noise is that of neighbouring blocks, from their second differences. z is the bias over its standard "
        "uncertainty, of noise and of how the cycles repeat.",
    )


def line_closure_table(found: LineDiagnosis) -> Table | None:
    """Root mean squares before and after on the judged cycles."""
    if found.closure is None:
        return None
    power = found.closure.power
    cells = (significant(x * KILO, 3) for x in (power.before, power.after, power.noise))
    return Table(
        id="closure",
        caption=f"Error of the power, {words.judged_words(found)}: root mean squares of samples.",
        head=("Channel", "Before", "After", "Noise", "Closed", "Interval"),
        units=("", "force times speed, kW", "with the causes, kW", "white, kW", "of the squares", "95 %"),
        rows=(("winch power", *cells, share_words(found.closure.share), words.interval_words(found)),),
        note="Closed: 1 − Σ after² ÷ Σ before². Of what exceeds the noise it is "
        f"{share_words(found.closure.beyond_noise)}. The interval resamples the cycles.",
    )


def sets_table(found: LineDiagnosis) -> Table:
    """The sets of suspects that predict best, and the single ones."""
    choice = found.choice
    ranked = sorted(choice.errors, key=choice.error)
    shown = ranked[:MOST_SETS] + [names for names in ranked[MOST_SETS:] if len(names) < 2]
    rows = tuple(
        (
            words.set_words(names), f"{len(names)}", f"{number(100.0 * choice.error(names), 2)} %",
            "yes" if choice.as_good(names) else "no", probability_words(choice.probability[names]),
            "yes" if names == found.chosen else "",
        )
        for names in shown
    )  # fmt: skip
    return Table(
        id="sets",
        caption=f"Sets of suspects by the squared error that they leave of cycles they did not know: {len(shown)} of "
        f"{len(ranked)}.",
        head=("Set", "Suspects", "Error left", "As good", "Probability", "Chosen"),
        units=("", "", "of the gap", "as the best", "", ""),
        rows=rows,
        text_columns=(0, 3, 5),
        note=f"As good: within {number(100.0 * choice.tolerance / max(choice.gap, 1e-300), 2)} % of the least, the larger of "
        "one standard error over cycles and one per cent of the gap. The smallest of these is chosen.",
    )


def line_logs_table(found: LineDiagnosis) -> Table:
    """Every part of the campaign: its log, cycles and part in the diagnosis."""
    rows = []
    for part in found.lines.parts:
        role = "withheld" if part.withheld else "in the fit"
        if found.closure is not None and found.closure.left_out_in_turn:
            role = "each cycle left out once"
        cycles = f"{int(part.cycle.min())} to {int(part.cycle.max())}"
        rows.append((part.run.name, cycles, role, f"{part.here.size}", part.run.sha256 or "–"))
    return Table(
        id="logs", caption="Logs of the campaign.", head=("Log", "Cycles", "Part", "Samples", "SHA-256"),
        units=("", "", "", "that count", ""), rows=tuple(rows), text_columns=(0, 2, 4),
    )  # fmt: skip
