"""Sentences about single causes: their numbers, wrong entries, numbers run by run; and those of a winch without a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from winchcascade.core.quantity import Unit, find_unit
from winchcascade.diagnosis.causes import COVERED
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause, Reported, Trend
from winchcascade.diagnosis.line.line_data import CyclePart, beside
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.line.line_stability import cycle_names
from winchcascade.diagnosis.stability import MIN_RUNS
from winchcascade.report.digits import significant, upper
from winchcascade.report.gap_words import NAMES, display_of, number_words, phase_words
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.effect import Display, WrongEntry

LINE_NUMBERS = {
    "drum_inertia": Display("inertia, as a mass on the line", 1.0, "kg", signed=False),
    "line_friction": Display("constant friction", 1.0, "N", signed=False),
    "line_drag": Display("drag over speed", 1.0, "N·s/m", signed=False),
    "load_proportional_loss": Display("loss over tension", 100.0, "%", signed=False),
    "force_gain": Display("gain of the force cell", 100.0, "%"),
    "force_zero": Display("zero of the force cell", 1.0, "N"),
}
"""Display of the number of each suspect without a model, in units of the line."""


def cycles_of(found: LineDiagnosis) -> int:
    """Number of the cycles of all parts."""
    return sum(len(set(part.cycle.tolist())) for part in found.lines.parts)


def part_words(part: CyclePart) -> str:
    """The cycles of a part and its log."""
    first, last = int(part.cycle.min()), int(part.cycle.max())
    return f"{f'cycle {first}' if first == last else f'cycles {first} to {last}'} of {part.run.name}"


def small_words(found: LineDiagnosis) -> str:
    """What the suspects that are not named would close together."""
    rest = [name for name in found.lines.names if name not in found.chosen]
    if not found.causes or not rest:
        return ""
    more = 100.0 * max(found.choice.error(found.chosen) - found.choice.error(found.lines.names), 0.0)
    size = "less than 0.1 %" if more < 0.1 else f"{significant(more, 1)} %"
    return f"{', '.join(rest)}: {'it' if len(rest) == 1 else 'together they'} would close {size} more"


def slope_words(found: LineDiagnosis) -> str:
    """Over how many samples the acceleration was taken, and why."""
    lines = found.lines
    tried = " and ".join(f"{span:g} s" for span in lines.spans)
    why = f" (of {tried}, the one with which the fit best predicts held-out cycles)" if len(lines.spans) > 1 else ""
    return f"slope of a local quadratic over {samples_of(found)} samples, {lines.span:g} s{why}"


def samples_of(found: LineDiagnosis) -> int:
    """Samples over which the slope of the velocity is taken."""
    return 2 * beside(found.lines.parts[0].run, found.lines.span) + 1


PLURAL = {"payout": "payouts", "hold": "holds", "haul_in": "haul-ins"}
"""Phases of several cycles."""


class PhaseEnergy(NamedTuple):
    """Energy of all judged cycles in a phase [J], and by which share predictions deviate from it, and in the worst cycle."""

    phases: str
    measured: float
    before: float
    after: float
    worst: float


def energy_rows(found: LineDiagnosis) -> list[PhaseEnergy]:
    """Energies of payouts and haul-ins."""
    rows = []
    for phase in ("payout", "haul_in"):
        own = [one for one in found.energies if one.phase == phase and one.measured]
        measured = sum(one.measured for one in own)
        if measured:
            before, after = (sum(getattr(e, name) for e in own) / measured - 1.0 for name in ("before", "after"))
            worst = max((e.after / e.measured - 1.0 for e in own), key=abs)
            rows.append(PhaseEnergy(PLURAL[phase], measured, before, after, worst))
    return rows


def fitted_words(found: LineDiagnosis) -> str:
    """Effects that were fitted but are not named, with their numbers."""
    texts = []
    for one in found.fitted_effects:
        if not one.named:
            value = next(iter(one.parameters.values()))
            text, interval = number_words(LINE_NUMBERS[one.effect], value, 3)
            where = "" if one.chosen else ", not needed beside the others but not ruled out"
            texts.append(f"{one.effect} {text} (95 %: {interval}{where})")
    return "; ".join(texts)


def again_words(found: LineDiagnosis) -> str:
    """Whether the withheld cycles alone give the same numbers; empty without any."""
    if not found.causes or not found.again:
        return ""
    pairs = {cause.effect: (found.again[cause.effect], *cause.parameters.values()) for cause in found.causes}
    apart = [effect for effect, (alone, fitted) in pairs.items() if alone.low > fitted.high or alone.high < fitted.low]
    shown = ((LINE_NUMBERS[effect], alone) for effect, (alone, _) in pairs.items())
    numbers = "; ".join("{} {} ({})".format(how.what, *number_words(how, alone, 3)) for how, alone in shown)
    steady = f"Those of {' and '.join(apart)} do not overlap" if apart else "They overlap"
    return f"Fitted to the withheld cycles alone: {numbers}. {steady} with the intervals of the fit."


def set_words(names: Sequence[str]) -> str:
    """A set of suspects."""
    return " + ".join(names) if names else "none: line tension times speed"


def minor_words(found: DiagnosisResult) -> str:
    """Effects that are significant but too small to matter, each with its number and what it changes most."""
    texts: list[str] = []
    hints: list[str] = []
    for one in found.minor:
        (name, value), effect, largest = next(iter(one.parameters.items())), found.suspects[one.effect], one.largest
        text, _ = number_words(display_of(one.effect, name, value.unit), value)
        what, size = largest.name, f"{abs(largest.change):.2g}"
        if largest.phase is not None:
            what = f"the mean of {NAMES[largest.name]} in {phase_words(largest.phase)}"
            size = f"{100.0 * abs(largest.change):.2g} %"
        several = texts if math.isnan(one.hint) else hints
        several.append(f"{effect.label} ({one.effect}), {text}, changes {what} by {size} at most")
    small = f"Significant but too small to matter: {'; '.join(texts)}." if texts else ""
    hinted = f"A hint, with less evidence than a cause needs: {'; '.join(hints)}." if hints else ""
    return f"{small} {hinted}".strip()


def range_words(value: Reported) -> str:
    """Where a number lies at the end of its range or beyond what is plausible."""
    ends = {"high": "one-sided, at its upper end", "low": "one-sided, at its lower end"}
    return ends.get(value.at_limit or "", "beyond what is plausible" if value.beyond_range else "")


def alternatives_words(cause: NamedCause, conjunction: str) -> str:
    """Names of the alternatives to a cause."""
    return conjunction.join(one.effect for one in cause.look_alikes)


CHECK = "Check this entry before other causes."
MAY_IMITATE = "The residual exceeds noise: the entry may only imitate an effect that the catalogue lacks."


def entry_sentence(cause: NamedCause, entry: WrongEntry, *, explained: bool = True) -> str:
    """What is stated and what the logs fit, in the unit of the rig file; loads in ohm.

    Unless the gap is `explained`, the entry is not claimed to be wrong.

    >>> from winchcascade.diagnosis.diagnosis_result import NamedCause, Reported
    >>> from winchcascade.rig.effects.effect import WrongEntry
    >>> radius = NamedCause("drum_radius", "entry", 0.99, {"r_drum": Reported(0.1378, 0.137, 0.138, "m")}, (), 1.0)
    >>> entry_sentence(radius, WrongEntry("winch.r_drum", stated=0.13, unit="m"))
    'The rig file states r_drum = 0.130 m; the logs fit 0.138 m. Check this entry before other causes.'
    """
    found, advice = next(iter(cause.parameters.values())), CHECK if explained else MAY_IMITATE
    if entry.log >= 0:
        return f"The campaign states {entry.stated:#.3g} ohm for {entry.source}; the log fits {found.value:#.3g} ohm. {advice}"
    if not entry.number:
        check = "Check the scale of the logged velocity and displacement before other causes."
        return (
            f"The logged line motion is {found.value:#.4g} times the motion that the other channels fit. "
            f"{check if explained else MAY_IMITATE}"
        )
    ratio = found.value / entry.stated if entry.as_number else found.value
    scale = find_unit(entry.unit) or Unit("number", 1.0)
    stated, name = entry.stated / scale.factor, entry.number.rpartition(".")[2]
    unit = "" if entry.unit in ("", "1") else f" {entry.unit}"
    times = "" if entry.as_number else f", {ratio:#.3g} times as much"
    return (
        f"The rig file states {name} = {stated:#.3g}{unit}; the logs fit {stated * ratio:#.3g}{unit}{times}. {advice}"
    )


def check_words(found: DiagnosisResult, cause: NamedCause) -> str:
    """Sentence about a cause that is a wrong entry; empty for any other."""
    entry = found.suspects[cause.effect].entry
    return "" if entry is None else entry_sentence(cause, entry, explained=found.verdict == "explained")


def items_of(found: DiagnosisResult) -> list[str]:
    """Names of what the number of a cause is estimated from one by one: the runs or, without a model, their cycles."""
    return [*cycle_names(found.lines.parts)] if isinstance(found, LineDiagnosis) else [run.name for run in found.runs]


ALONG = {"order": "the order of the runs", "load": "their loads"}
"""What a number may change along, as a sentence calls it."""

SILENT = {False: "the run hardly depends on this cause", True: "withheld"}
"""Why a run gives no number, by whether it is withheld."""


def shown_as(found: DiagnosisResult, cause: NamedCause) -> Display:
    """How the number of a cause is shown that is estimated run by run, the first one that is reported."""
    name, value = next(iter(cause.parameters.items()))
    if isinstance(found, LineDiagnosis):
        return LINE_NUMBERS[cause.effect]
    return display_of(cause.effect, name, value.unit)


def runs_with_number(cause: NamedCause) -> list[int]:
    """Numbers of the runs that give a number of a cause."""
    runs = () if cause.stability is None else cause.stability.runs
    return [one.run for one in runs if math.isfinite(one.value)]


def trend_sentences(found: DiagnosisResult) -> list[str]:
    """What differs between the runs beyond its intervals, of every cause; none where the runs agree."""
    each = [(cause, () if cause.stability is None else cause.stability.trends) for cause in found.causes]
    return [trend_sentence(found, cause, trend) for cause, trends in each for trend in trends]


def stability_words(found: DiagnosisResult) -> str:
    """Whether the runs agree on the number of each cause; nothing where too few give one."""
    item = "cycle" if isinstance(found, LineDiagnosis) else "run"
    unsteady = [cause.effect for cause in found.causes if cause.stability is not None and cause.stability.trends]
    if unsteady:
        numbers = "the numbers differ" if len(unsteady) > 1 else "the number differs"
        return f"{', '.join(unsteady)}: {numbers} between the {item}s by more than intervals allow."
    compared = [cause.effect for cause in found.causes if len(runs_with_number(cause)) >= MIN_RUNS]
    which = "every cause" if len(compared) == len(found.causes) else ", ".join(compared)
    return (
        f"Estimated from every {item} alone, the number of {which} is the same within its intervals."
        if compared
        else ""
    )


def trend_sentence(found: DiagnosisResult, cause: NamedCause, trend: Trend) -> str:
    """What differs between the numbers of a cause from single runs."""
    how = shown_as(found, cause)
    name = f"{found.suspects[cause.effect].label} ({cause.effect}): {how.what}"
    if trend.along == "scatter":
        size = f"{significant(trend.change * how.factor, 2)} {how.unit}".rstrip()
        item = "cycle" if isinstance(found, LineDiagnosis) else "run"
        return f"{name} differs from {item} to {item} by up to {size}, more than its intervals allow."
    half = COVERED * trend.u
    change = Reported(trend.change, trend.change - half, trend.change + half, "")
    value, interval = number_words(how, change)
    sign = "+" if trend.change > 0.0 and not how.signed else ""
    instead = "" if trend.instead is None else f" {upper(ALONG[trend.instead])} would explain it as well."
    return (
        f"{name} changes by {sign}{value} (95 %: {interval}) {_ends(found, cause, trend)}, more than its intervals "
        f"allow.{instead}"
    )


def _ends(found: DiagnosisResult, cause: NamedCause, trend: Trend) -> str:
    """From where to where a number changes."""
    numbers = runs_with_number(cause)
    if trend.along == "order":
        names = items_of(found)
        what = "cycles" if isinstance(found, LineDiagnosis) else "runs"
        return f"from {names[numbers[0]]} to {names[numbers[-1]]}, in the order of the {what}"
    own = [found.runs[k] for k in numbers]
    by_load = sorted(own, key=lambda run: -math.inf if run.load is None else -run.load)
    return f"from {load_words(by_load[0].load)} to {load_words(by_load[-1].load)}"
