"""Tables of the report of a diagnosis."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winchcascade.core.quantity import find_unit
from winchcascade.diagnosis.block_means import PHASES
from winchcascade.diagnosis.gap_location import NAMES, STANDS_OUT
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.diagnosis.remainder import PULLED, ROUGH, block_rms
from winchcascade.report import diagnosis_page as page
from winchcascade.report.diagnosis_map import signed, worst_first
from winchcascade.report.diagnosis_names import (
    display_of,
    load_words,
    nuisance_words,
    phase_words,
    probability_words,
    quantity_words,
    share_words,
    told_apart_words,
    without_unit,
)
from winchcascade.report.diagnosis_odds import threshold_words, thresholds
from winchcascade.report.diagnosis_words import alarm_meaning, files_of, interval_words
from winchcascade.report.digits import number, significant, uncertain
from winchcascade.report.model_account import COMPARED
from winchcascade.report.report_model import Table

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnose import Diagnosis
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


def causes_table(found: Diagnosis) -> Table | None:
    """Every cause with its numbers, probability and rivals."""
    rows = []
    for cause in found.causes:
        for k, (name, value) in enumerate(cause.parameters.items()):
            how = display_of(cause.effect, name, value.unit)
            text, interval = quantity_words(cause.effect, name, value)
            rivals = ", ".join(r.effect for r in cause.rivals) or "none"
            first = (cause.effect, cause.stage) if k == 0 else ("", "")
            last = (probability_words(cause.probability), rivals) if k == 0 else ("", "")
            rows.append((*first, how.what, text, without_unit(interval, how), *last))
    if not rows:
        return None
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


def meanings_table(found: Diagnosis) -> Table | None:
    """What the named effects and their rivals are."""
    names = dict.fromkeys([c.effect for c in found.causes] + [r.effect for c in found.causes for r in c.rivals])
    if not names:
        return None
    rows = tuple((name, found.suspects[name].stage, found.suspects[name].summary) for name in names)
    return Table(
        id="meanings", caption="What these effects are.", head=("Effect", "Stage", "What the rig file leaves out"),
        units=("", "", ""), rows=rows, text_columns=(0, 1, 2),
    )  # fmt: skip


def rivals_table(found: Diagnosis) -> Table | None:
    """What would tell each cause from its rivals in the logs at hand."""
    return page.rivals_table(
        found.causes,
        "Rivals: effects that explain the same data about as well, and where the two explanations differ most.",
        told_apart_words,
    )


def places_table(found: Diagnosis) -> Table | None:
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
        NAMES[p.channel], phase_words(p.phase), load_words(p.load), unit, significant(p.bias * factor, 3),
        *(significant(x, 2) for x in u), signed(p.z),
    )  # fmt: skip


def stages_table(found: Diagnosis) -> Table | None:
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
    inputs = ", ".join(NAMES[name] for name in p.inputs if name != "velocity") or "velocity"
    return (f"{p.stage}: {channel} ({unit})", inputs, phase, load, *numbers)


def closure_table(found: Diagnosis) -> Table | None:
    """Root mean squares before and after on the withheld logs, beside the noise."""
    closure = found.closure
    if closure is None:
        return None
    rows = []
    for name, x in closure.channels.items():
        unit, factor = COMPARED[name]
        values = [v * factor for v in (x.before, x.after, x.noise)]
        ratios = [significant(v / x.noise, 2) if x.noise else "–" for v in (x.before, x.after)]
        rows.append((NAMES[name], unit, *(significant(v, 2) for v in values), *ratios))
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
        f"{interval_words(found)}; it counts what exceeds the noise, in squares, over channels and logs.",
    )


def alarms_table(found: Diagnosis) -> Table | None:
    """Every sign of something unexplained."""
    if found.remainder is None or not found.remainder.alarms:
        return None
    files = files_of(found)
    rows = tuple(
        (nuisance_words(a.where, files), SIGNS[a.kind], alarm_meaning(a), significant(a.size, 2), f"{a.limit:g}")
        for a in found.remainder.alarms
    )
    return Table(
        id="alarms", caption="Signs of something that the named causes do not explain, worst first.",
        head=("Where", "Sign", "May mean", "Size", "Limit"), units=("",) * 5, rows=rows, text_columns=(0, 1, 2),
    )  # fmt: skip


def roughness_table(found: Diagnosis) -> Table | None:
    """Root mean squares of whitened blocks by channel and phase, without any cause and with those named."""
    null, best = (block_rms(found.data, fit.z) for fit in (found.found.null, found.found.best))
    several = bool(found.found.best.names)
    rows = [
        (NAMES[c], phase_words(p), *([number(null.get((c, p)), 2)] if several else []), number(best[c, p], 2))
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


def nuisances_table(found: Diagnosis) -> Table | None:
    """The nuisances that the fit moves most, in their standard uncertainties."""
    files = files_of(found)
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
        nuisance_words(str(n), files), significant(x * n.sd * factor, 2), uncertain(n.sd * factor), _unit(unit), signed(x),
    )  # fmt: skip


def _unit(unit: str) -> str:
    """A unit as a report writes it."""
    return "" if unit == "1" else unit.replace(".", "·").replace("m2", "m²").replace("m3", "m³")


def suspects_table(found: Diagnosis) -> Table | None:
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
            (gained, (name, kind.stage, kind.summary, _odds_words(gained) if name not in best else "in the fit"))
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


def thresholds_table(found: Diagnosis) -> Table | None:
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


def logs_table(found: Diagnosis) -> Table:
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
