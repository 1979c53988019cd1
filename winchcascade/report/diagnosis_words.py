"""What a diagnosis found, in sentences that the terminal, the reports and the JSON share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import joint_origin
from winchcascade.diagnosis.diagnosis_result import Spot
from winchcascade.diagnosis.gap_location import STANDS_OUT, arises
from winchcascade.diagnosis.line.line_closure import BURST
from winchcascade.diagnosis.line.line_data import POWER, beside
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.line.line_next_run import STEP, SWING
from winchcascade.diagnosis.line.line_selection import DRAWS
from winchcascade.diagnosis.next_run import BACK, HOLD, RAMP
from winchcascade.report.diagnosis_names import (
    apart_words,
    display_of,
    load_words,
    nuisance_words,
    number_words,
    phase_words,
    probability_words,
    quantity_words,
    share_words,
    without_unit,
)
from winchcascade.report.digits import number, significant
from winchcascade.rig.effects.effect import Display

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from winchcascade.core.campaign_file import Origin
    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import (
        Alarm,
        Arises,
        DiagnosisResult,
        Experiment,
        NamedCause,
        Reported,
        Where,
    )
    from winchcascade.diagnosis.line.line_data import CyclePart
    from winchcascade.diagnosis.nuisances import Nuisance

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts as headings."""

NAMES = {"pressure": "pressure", "force": "line force", "torque": "torque", "vdc": "Vdc", "idc": "Idc"}
UNITS = {"pressure": "Pa", "force": "N", "torque": "N m", "vdc": "V", "idc": "A"}
SYMBOLS = {"vdc": "Vdc", "idc": "Idc"}
SENSORS = {
    "pressure": "pressure sensor", "force": "force cell", "torque": "torque sensor", "vdc": "sensor of Vdc",
    "idc": "sensor of Idc",
}  # fmt: skip

FAR_ENOUGH = 3.0
"""An experiment tells two effects apart if they are expected to differ by so many standard deviations."""

SURE = 0.95
"""A cause of a smaller probability is said to be less than sure."""

EXPLAINED = 0.9
"""Below this share a gap of a winch without a model counts as explained only if what is left is noise."""

LINE_NUMBERS = {
    "drum_inertia": Display("inertia, as a mass on the line", 1.0, "kg", signed=False),
    "line_friction": Display("constant friction", 1.0, "N", signed=False),
    "line_drag": Display("drag over speed", 1.0, "N·s/m", signed=False),
    "force_gain": Display("gain of the force cell", 100.0, "%"),
    "force_zero": Display("zero of the force cell", 1.0, "N"),
}
"""How the number of each suspect is told without a model, in units of the line."""

LINE_MEANINGS = {
    "drum_inertia": "What turns with the line (drum, gear, machine, tether on the drum) takes power to speed up and gives it "
    "back.",
    "line_friction": "A constant friction between line and shaft, against the motion.",
    "line_drag": "A drag between line and shaft in proportion to the speed.",
    "force_gain": "The force cell reads too much or too little, by the same share everywhere.",
    "force_zero": "The force cell reads too much or too little, by the same force everywhere.",
}
"""What each suspect is on a winch of which only line and shaft are known."""


# ------------------------------------------------------------------------------------------------- what things are called
def upper(text: str) -> str:
    """A text that begins with a capital letter."""
    return text[:1].upper() + text[1:]


def origins_of(found: DiagnosisResult) -> list[Origin]:
    """Where the data of each log come from."""
    return [run.origin for run in found.runs]


def word_of(found: DiagnosisResult) -> str:
    """What the logs are called: `measured` where that is stated of all of them, else `log` or, of a power, `logged`."""
    word = joint_origin(origins_of(found)).word
    return "logged" if isinstance(found, LineDiagnosis) and word == "log" else word


def files_of(found: DiagnosisResult) -> list[str]:
    """Names of the logs, in their order."""
    return [run.name for run in found.runs]


def number_told(found: DiagnosisResult, effect: str, name: str, value: Reported) -> tuple[str, str, str]:
    """What a reported number is, its value with its unit, and its 95 % interval."""
    if not isinstance(found, LineDiagnosis):
        return (display_of(effect, name, value.unit).what, *quantity_words(effect, name, value))
    how = LINE_NUMBERS[effect]
    text, interval = number_words(how, value, 3)
    return how.what, text, interval if value.high > value.low else "at the end of what is plausible"


def number_row(found: DiagnosisResult, effect: str, name: str, value: Reported) -> tuple[str, str, str]:
    """As `number_told`, the interval without the unit, for a table."""
    what, text, interval = number_told(found, effect, name, value)
    how = LINE_NUMBERS[effect] if isinstance(found, LineDiagnosis) else display_of(effect, name, value.unit)
    return what, text, without_unit(interval, how)


def cause_words(found: DiagnosisResult, cause: NamedCause) -> str:
    """Every number of a cause, with its interval."""
    parts = [number_told(found, cause.effect, name, value) for name, value in cause.parameters.items()]
    return "; ".join(f"{what} {text} (95 %: {interval})" for what, text, interval in parts)


def meaning_words(found: DiagnosisResult, effect: str) -> str:
    """What a suspect is."""
    return LINE_MEANINGS[effect] if isinstance(found, LineDiagnosis) else found.suspects[effect].summary


def spot_words(spot: Spot, names: Mapping[str, str] = SYMBOLS) -> str:
    """A spot of the gap: channel and phase.

    >>> spot_words(Spot("idc", "haul_in")), spot_words(Spot("idc", "payout", within_blocks=True), {})
    ('Idc during haul-in', 'idc within blocks of payout')
    """
    channel = names.get(spot.channel, spot.channel)
    if spot.phase is None:
        return channel
    return f"{channel} {'within blocks of' if spot.within_blocks else 'during'} {phase_words(spot.phase)}"


def about_text(about: Spot | Nuisance) -> str:
    """What a sign of something unexplained is about, as the JSON names it."""
    return spot_words(about, {}) if isinstance(about, Spot) else str(about)


def about_words(about: Spot | Nuisance, files: Sequence[str]) -> str:
    """What a sign of something unexplained is about.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    if isinstance(about, Spot):
        return spot_words(about, {**SYMBOLS, POWER: "winch power"})
    return nuisance_words(about, files)


def differs_text(spot: Spot | None) -> str:
    """In what a cause and its alternative differ most, as the JSON says it.

    >>> differs_text(Spot("idc", "payout", 4.5, z=458.52)), differs_text(Spot("power_mech", "hold", bias=12.3))
    ('idc during payout at 4.5 ohm, where they differ by 458.5 sigma', 'power_mech during hold, by 12 W rms')
    """
    if spot is None or spot.load is None:
        return differs_words(spot)
    return f"{spot_words(spot, {})} at {load_words(spot.load, 'ohm')}, where they differ by {spot.z:.1f} sigma"


def differs_words(spot: Spot | None) -> str:
    """In what a cause and its alternative differ most.

    >>> differs_words(Spot("idc", "payout", 4.5, z=458.52))
    'Idc during payout at 4.5 Ω, by more than 100 standard deviations'
    """
    if spot is None:
        return "nothing that these logs measure"
    if spot.load is None:
        return f"{spot_words(spot)}, by {spot.bias:.0f} W rms"
    return f"{spot_words(spot)} at {load_words(spot.load)}, by {apart_words(spot.z)} standard deviations"


# ----------------------------------------------------------------------------------------------------------- the verdict
def verdict_words(found: DiagnosisResult) -> str:
    """One honest sentence about the verdict."""
    line = isinstance(found, LineDiagnosis)
    if found.verdict == "no_gap":
        return (
            "The power of the winch is that of its line, force times speed, but for noise: no cause predicts cycles that it "
            "does not know any better."
            if line
            else "Nothing in these logs stands out of noise and of what is not known of the rig: no cause is named."
        )
    if found.closure is None:
        return (
            "The power of the winch differs from that of its line by more than noise, but no suspect explains it: neither "
            "inertia nor losses in line units nor the force cell."
            if line
            else "The logs differ from the model by more than noise and tolerances, but no effect of the catalogue explains "
            "it: the cause lies outside the catalogue."
        )
    count, more = len(found.causes), len(found.unnamed)
    named = "The named cause closes" if count == 1 else f"The {count} named causes close"
    if more:
        named = f"A fit of {count + more} effects, of which the leading {count} are named, closes"
    share = share_words(found.closure.share).replace(">", "more than")
    if isinstance(found, LineDiagnosis):
        return _line_verdict(found, f"{named} {share}", noise=found.closure.share < EXPLAINED)
    if found.verdict == "explained":
        return f"{named} {share} of the gap on logs that did not take part in the fit; what is left is not significant."
    if found.verdict == "partly_explained":
        return (
            f"{named} {share} of the gap on logs that did not take part in the fit, but what is left is more than "
            "noise: something else acts too."
        )
    return (
        f"The best that the catalogue offers closes only {share} of the gap on logs that did not take part in the "
        "fit and leaves a structure: take the names below as a hint at most."
    )


def _line_verdict(found: LineDiagnosis, closes: str, *, noise: bool) -> str:
    text = f"{closes} of the squared error between winch power and line power on cycles that the fit did not know"
    if found.verdict == "explained":
        return f"{text}; what is left {'is no more than noise' if noise else 'keeps no structure'}."
    if found.remainder is not None and found.remainder.alarms:
        return f"{text}, but what is left keeps a structure: something else acts too, and part of it may sit in these numbers."
    return f"{text}; what is left is more than noise."


# ------------------------------------------------------------------------------------------------------------- the place
def where_sentence(where: Where, word: str = "measured") -> str:
    """Where a gap lies: in which direction, at what currents and speeds, by how much; as the JSON says it.

    Parameters
    ----------
    word : what the power of a winch without a model is called
    """
    worst = where.worst
    if worst.channel == POWER:
        return (
            f"{where.stage}: in {phase_words(worst.phase)} the {word} power of the winch lies {abs(worst.bias) / 1e3:.2g} kW "
            f"{'above' if worst.bias > 0.0 else 'below'} line force times speed on average (z = {worst.z:+.0f}), "
            f"{worst.rms / 1e3:.2g} kW rms; that phase holds {100.0 * worst.share:.0f} % of the squared gap."
        )
    region = ""
    if worst.phase == "payout" and math.isfinite(where.rpm[0]):
        region = f" between {where.rpm[0]:.0f} and {where.rpm[1]:.0f} rpm"
        if where.i_dc[1] > 0.5:
            region += f" and {max(where.i_dc[0], 0.0):.1f} to {where.i_dc[1]:.1f} A DC"
    place = "a sensor" if where.stage == "sensor" else f"the {where.stage} stage"
    return (
        f"The gap lies in {place}: {_off(worst.channel, where.size)} during {phase_words(worst.phase)}{region}, most "
        f"clearly{_at_load(worst.load)}, by up to {size_text(worst.channel, where.size)}."
    )


def arises_sentence(own: Arises | None) -> str:
    """In which stage a gap arises when each is given its own logged inputs, as the JSON says it."""
    if own is None:
        return ""
    if own.worst is None:
        return f"Given its own logged inputs, no stage alone is off by more than {STANDS_OUT:g} standard uncertainties."
    stages = " and ".join([", ".join(own.off[:-1]), own.off[-1]] if len(own.off) > 1 else own.off)
    if own.sensor is not None:
        return (
            f"Given their own logged inputs, the {stages} stages are off as a gain error of about {100.0 * own.gain:+.1g} % in "
            f"the {SENSORS[own.sensor]} alone would have them."
        )
    one = len(own.off) == 1
    which = f"the {stages} stage alone is off" if one else f"the {stages} stages are off, the {own.off[0]} most"
    return (
        f"Given {'its' if one else 'their'} own logged inputs, {which}: {_off(own.worst.channel, own.worst.bias)} during "
        f"{phase_words(own.worst.phase)}, most clearly{_at_load(own.worst.load)}, by "
        f"{size_text(own.worst.channel, own.worst.bias)} in the mean."
    )


def _off(channel: str, bias: float) -> str:
    """In which direction a channel is off, by the sign of measured minus simulated."""
    return f"{NAMES[channel]} is {'over' if bias < 0.0 else 'under'}-predicted"


def size_text(channel: str, size: float) -> str:
    """The magnitude of a difference with its unit, from SI units.

    >>> size_text("pressure", -98066.5), size_text("vdc", 12.345)
    ('1 kg/cm2', '12.3 V')
    """
    factor, unit = (1.0 / 98066.5, "kg/cm2") if channel == "pressure" else (1.0, UNITS[channel])
    return f"{abs(size) * factor:.3g} {unit}"


def _at_load(load: float | None) -> str:
    return "" if load is None else " in open circuit" if math.isinf(load) else f" at {load:g} ohm"


def where_words(found: DiagnosisResult) -> str:
    """Where the gap lies end to end; where no mean stands out, the strongest sign instead."""
    if found.where is None:
        return ""
    if isinstance(found, LineDiagnosis):
        return upper(where_sentence(found.where, word_of(found)).replace("= -", "= −"))
    alarms = found.remainder.alarms if found.remainder is not None else ()
    if not alarms or any(abs(place.z) > STANDS_OUT for place in found.places):
        return _signs(where_sentence(found.where))
    return f"No mean over a phase is off by more than noise and tolerances allow. {alarm_words(alarms[0], files_of(found))}."


def arises_words(found: ModelDiagnosis) -> str:
    """In which stage the gap arises when each is given its own measured inputs."""
    return "" if found.where is None else _signs(arises_sentence(found.where.arises))


def says_more(found: ModelDiagnosis) -> bool:
    """Whether the stages by themselves say anything beyond the stage that is told already."""
    if found.where is None:
        return False
    own = arises(found.stages)
    return found.verdict != "explained" or own.stage != found.where.stage or len(own.off) > 1


def _signs(text: str) -> str:
    return text.replace("cm2", "cm²").replace(" ohm", " Ω").replace(" -", " −")


def checked_words(found: ModelDiagnosis) -> str:
    """What was checked where no gap was found."""
    out = sum(abs(place.z) > STANDS_OUT for place in found.places)
    off = "none is" if not out else f"{out} are"
    more = ", but no effect explains that better than tolerances do" if out else ""
    alone = sum(abs(place.z) > STANDS_OUT for place in found.stages)
    staged = f" Stage by stage {alone} of {len(found.stages)} are." if alone else ""
    return (
        f"{len(found.places)} means by channel, phase and load: {off} off by more than {STANDS_OUT:g} standard "
        f"uncertainties{more}.{staged} {len(found.suspects)} effects: none explains more than chance would."
    )


# ---------------------------------------------------------------------------------------------------- how sure, how far
def sure_words(found: DiagnosisResult) -> str:
    """How sure the causes are, and what no effect of the catalogue is and looks like one of them."""
    if isinstance(found, LineDiagnosis):
        return _sure_by_resampling(found)
    effects = [found.suspects[cause.effect] for cause in found.causes]
    alike = [f"{effect.unlisted} would look like {effect.name}" for effect in effects if effect.unlisted]
    text = _sure_by_evidence(found)
    return f"{text} Not in the catalogue: {'; '.join(alike)}." if alike else text


def _sure_by_evidence(found: DiagnosisResult) -> str:
    if not found.causes:
        others = len(found.sets) - 1
        tried = f"{others} set{'s' if others > 1 else ''} of effects came near enough to be fitted" if others else ""
        none = "no effect at all" if found.verdict == "no_gap" else "none of the catalogue's effects"
        text = f"Probability of {none}: {probability_words(found.sets.get((), 0.0))}"
        return f"{text}; {tried}." if tried else f"{text}; no set of effects came near enough to be fitted."
    each = "The cause has" if len(found.causes) == 1 else "Each cause has"
    weak = [cause for cause in found.causes if cause.probability < SURE]
    rivalled = [cause for cause in found.causes if cause.rivals]
    if not weak and not rivalled:
        least = min(c.probability for c in found.causes)
        size = "above 0.99" if least > 0.995 else f"of {least:.2f} at least"
        return f"{each} a probability {size}, and no other effect of the catalogue explains the same data as well."
    parts = [
        f"{c.effect} has a probability of {probability_words(c.probability)}".replace("of <", "below").replace(
            "of >", "above"
        )
        for c in weak
    ]
    for cause in rivalled:
        names = " and ".join(rival.effect for rival in cause.rivals)
        better = any(rival.probability > cause.probability for rival in cause.rivals)
        parts.append(f"{names} would explain the data {'at least' if better else 'about'} as well as {cause.effect}")
    text = "; ".join(parts)
    if len(weak) < len(found.causes):
        text += "; all others are above 0.95" if weak else f"; {each.lower()} a probability above 0.95"
    return f"{text}."


def _sure_by_resampling(found: DiagnosisResult) -> str:
    if not found.causes:
        return f"Probability of no cause: {probability_words(found.sets[()])}."
    weak = [cause for cause in found.causes if cause.probability < SURE]
    parts = [f"{c.effect} was chosen in {number(100.0 * c.probability, 0)} % of them" for c in weak]
    if not weak:
        each = "The cause was" if len(found.causes) == 1 else "Each cause was"
        least = min(cause.probability for cause in found.causes)
        parts.append(
            f"{each} chosen in {'more than 99' if least > 0.995 else number(100.0 * least, 0)} % of {DRAWS} resampled sets of "
            "cycles"
        )
    elif len(weak) < len(found.causes):
        parts.append("the others in more than 95 %")
    rivals = [
        f"{' and '.join(rival.effect for rival in cause.rivals)} would predict about as well as {cause.effect}"
        for cause in found.causes
        if cause.rivals
    ]
    begin = f"Of {DRAWS} resampled sets of cycles: " if weak else ""
    return f"{begin}{'; '.join([*parts, *(rivals or ['no other suspect predicts as well in place of one'])])}."


def closure_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """How much of the gap is closed, between which bounds it lies, and how that is known."""
    closure = found.closure
    if closure is None:
        return ""
    share, line = share_words(closure.share).replace(">", "More than"), isinstance(found, LineDiagnosis)
    gap = "squared error" if line else "explainable gap"
    text = f"{share} of the {gap} is closed (95 %: {interval_words(found)}), {judged_words(found)}."
    if not isinstance(found, LineDiagnosis) or found.closure is None:
        return text
    beyond = share_words(found.closure.beyond_noise).replace(">", "more than")
    return f"{text} Of what exceeds the white noise of the power it is {beyond}."


def interval_words(found: DiagnosisResult) -> str:
    """Interval of the share that is closed."""
    if found.closure is None:
        return ""
    low, high = share_words(found.closure.low), share_words(found.closure.high)
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def judged_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """On what the causes are judged, and whether it took part in the choice."""
    if isinstance(found, LineDiagnosis):
        return _judged_cycles(found)
    data = found.data
    if data.withheld:
        names = [load_words(data.logs[k].run.load) for k in sorted(data.withheld)]
        return f"judged on logs that took part in neither choice nor fit ({', '.join(names)})"
    if found.closure is None:
        return "all logs took part"
    return "judged on each log with a load by a fit without it; the causes were chosen on all logs"


def _judged_cycles(found: LineDiagnosis) -> str:
    if found.closure is None:
        return "all cycles took part"
    if found.closure.left_out_in_turn:
        folds = found.moments.folds
        few = len({(k, c) for k, part in enumerate(found.lines.parts) for c in part.cycle.tolist()}) < folds
        what = f"each of {folds} {'stretches' if few else 'cycles'}"
        return f"judged on {what} by a fit without it; the causes were chosen on all"
    parts = " and ".join(part_words(part) for part in found.closure.parts)
    return f"judged on {parts}, which took part in neither choice nor fit"


def part_words(part: CyclePart) -> str:
    """The cycles of a part and its log."""
    first, last = int(part.cycle.min()), int(part.cycle.max())
    cycles = f"cycle {first}" if first == last else f"cycles {first} to {last}"
    return f"{cycles} of {part.run.name}"


# ------------------------------------------------------------------------------------------------------- what to test next
def profile_words(plan: Experiment) -> str:
    """The motion of a planned run.

    >>> from winchcascade.diagnosis.diagnosis_result import Experiment
    >>> profile_words(Experiment("force_steps", 1.0, ("a", "b"), 3.0, force=2000.0))
    'reel-out at a constant 1.0 m/s, the line force in steps from 1.0 kN to 3.0 kN, 10 s each'
    """
    v, force = plan.speed, f"{plan.force / 1e3:.1f} kN"
    return {
        "cycle": f"one cycle: {RAMP:g} s ramp to {v:.2f} m/s, {plan.length:.1f} m of payout, {HOLD:g} s hold, haul-in at "
        f"{BACK * v:.2f} m/s",
        "speed_steps": f"reel-out at a constant line force of {force}, in steps to a quarter, half, three quarters and all of "
        f"{v:.1f} m/s, {STEP:g} s each",
        "force_steps": f"reel-out at a constant {v:.1f} m/s, the line force in steps from {0.5 * plan.force / 1e3:.1f} kN to "
        f"{1.5 * plan.force / 1e3:.1f} kN, {STEP:g} s each",
        "out_and_back": f"reel-out and haul-in by turns at {v:.1f} m/s and a constant line force of {force}, {STEP:g} s each",
        "swing": f"reel-out at a constant line force of {force}, the speed swinging between {0.5 * v:.1f} and {v:.1f} m/s "
        f"every {SWING:g} s, for {4.0 * STEP:g} s",
    }[plan.motion]


def experiment_words(found: DiagnosisResult) -> str:
    """What to test next, and what it would bring."""
    plan = found.experiment
    if plan is None:
        return ""
    one, other = plan.separates
    line, apart = isinstance(found, LineDiagnosis), apart_words(plan.expected_z)
    run = profile_words(plan) if line else f"{load_words(plan.load)}, {profile_words(plan)}"
    rival = any(rival.effect == other for cause in found.causes for rival in cause.rivals)
    if plan.expected_z < FAR_ENOUGH and (line or rival):
        return (
            f"None of the {'motions' if line else 'runs'} that were considered tells {one} from {other}: they would differ by "
            f"{apart} standard deviations at most ({run}). Measure one of the two directly."
        )
    if rival:
        return f"{upper(run)}. There {one} and {other} differ by {apart} standard deviations, so it tells which it is."
    if line:
        return (
            f"No rival is left to be told apart. The sharpest further test is of {one} against the suspect that comes nearest, "
            f"{other}. {upper(run)}: there the two differ by {apart} standard deviations."
        )
    if plan.expected_z < FAR_ENOUGH:
        return (
            f"No rival is left to be told apart: these logs rule out {other}, which comes next. A further run would add little "
            f"to them: at most {apart} standard deviations more ({run})."
        )
    return (
        f"No rival is left to be told apart. The sharpest further test of {one} is a run against the next suspect, "
        f"{other}: {run}. There the two differ by {apart} standard deviations."
    )


# ---------------------------------------------------------------------------------------------------------- what is left
def alarm_words(alarm: Alarm, files: Sequence[str]) -> str:
    """A sign of something unexplained, without a full stop.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    return upper(_alarm(alarm, files))


def _alarm(alarm: Alarm, files: Sequence[str]) -> str:
    where, size, limit = about_words(alarm.about, files), f"{alarm.size:.1f}", f"{alarm.limit:g}"
    if alarm.kind == "structure" and isinstance(alarm.about, Spot) and alarm.about.channel == POWER:
        return f"{where}: means of 0.44 s are {size} times their noise (limit {limit})"
    return {
        "structure": f"{where}: the root mean square of what is left is {size} times the noise (limit {limit})",
        "scatter": f"{where}: the scatter is {size} times what noise explains (limit {limit})",
        "ripple": f"{where}: the means scatter about a smooth course {size} times as much as noise explains (limit {limit})",
        "nuisance": f"{where} had to move by {size} of its standard uncertainties (limit {limit})",
        "slow": f"{number(100.0 * alarm.size, 0)} % of what is left lasts longer than a second (limit "
        f"{number(100.0 * alarm.limit, 0)} %)",
    }[alarm.kind]


def alarm_meaning(alarm: Alarm) -> str:
    """What a sign of something unexplained may mean."""
    return {
        "structure": "the model's shape is wrong there",
        "scatter": "something faster than a block of 0.4 s moves, a ripple or a vibration",
        "ripple": "something comes and goes within seconds, as with every turn of a drum that is out of round",
    }.get(alarm.kind, "either its tolerance is wrong or it stands in for something else")


def remainder_words(found: DiagnosisResult) -> str:
    """What the causes leave."""
    if isinstance(found, LineDiagnosis):
        return _line_remainder(found)
    if found.remainder is None:
        return "Nothing is left beyond noise."
    left = found.remainder
    open_share = 1.0 if found.closure is None else max(1.0 - found.closure.share, 0.0)
    part = "Less than 1 %" if open_share < 0.01 else f"{number(100.0 * open_share, 0)} %"
    closed = "" if found.closure is None else f"{part} of the gap stays open"
    if not left.alarms:
        return f"{closed}; it has no structure that stands out of noise." if closed else "It has no structure."
    signs = "one sign" if len(left.alarms) == 1 else f"{len(left.alarms)} signs"
    begin = f"{closed}, with {signs} of something unexplained" if closed else f"{upper(signs)} of something unexplained"
    which = "" if len(left.alarms) == 1 else " The strongest:"
    return f"{begin}.{which} {alarm_words(left.alarms[0], files_of(found))}; {alarm_meaning(left.alarms[0])}."


def _line_remainder(found: LineDiagnosis) -> str:
    left = found.remainder
    if left is None:
        return ""
    signs = upper("; ".join(_alarm(alarm, ()) for alarm in left.alarms))
    signs = f"{signs}." if signs else ""
    if found.closure is None or not isinstance(left.worst, Spot):
        return signs
    shape = (
        f"{share_words(left.share)} of the squared error stays open: {number(100.0 * left.in_worst, 0)} % of it in "
        f"{phase_words(left.worst.phase or '')}, {number(100.0 * left.bursts, 0)} % in {100.0 * BURST:.0f} % of the samples"
    )
    if any(alarm.kind == "slow" for alarm in left.alarms):
        return f"{shape}. {signs}"
    return f"{shape}, and {number(100.0 * left.slow, 0)} % lasts longer than a second. {signs}".rstrip()


# --------------------------------------------------------------------------------------------- of a winch without a model
def again_words(found: LineDiagnosis) -> str:
    """Whether the withheld cycles alone give the same numbers."""
    if not found.again:
        return ""
    apart, parts = [], []
    for cause in found.causes:
        other, ((name, own),) = found.again[cause.effect], cause.parameters.items()
        what, value, interval = number_told(found, cause.effect, name, other)
        parts.append(f"{what} {value} ({interval})")
        if other.low > own.high or other.high < own.low:
            apart.append(cause.effect)
    text = f"Fitted to the withheld cycles alone: {'; '.join(parts)}."
    if apart:
        return f"{text} The intervals of {' and '.join(apart)} do not meet: it changes in the course of the logs."
    return f"{text} The intervals meet: the numbers are steady."


def flipped_words(found: LineDiagnosis) -> str:
    """Which channels were logged with the other sign, which ingest turned."""
    said = [
        f"{run.name}: {finding.message}; {finding.action}"
        for run in found.runs
        for finding in run.findings
        if finding.kind == "sign_flipped"
    ]
    return "; ".join(dict.fromkeys(said)) + "." if said else ""


def small_words(found: LineDiagnosis) -> str:
    """What the suspects that are not named would close together."""
    rest = [name for name in found.lines.names if name not in found.chosen]
    if not found.causes or not rest:
        return ""
    more = 100.0 * (found.choice.error(found.chosen) - found.choice.error(found.choice.best))
    size = "less than 0.1 %" if more < 0.1 else f"{significant(more, 1)} %"
    return f"{', '.join(rest)}: {'it' if len(rest) == 1 else 'together they'} would close {size} more"


def slope_words(found: LineDiagnosis) -> str:
    """Over how many samples the acceleration was taken, and why."""
    lines = found.lines
    count = 2 * beside(lines.parts[0].run, lines.span) + 1
    tried = " and ".join(f"{span:g} s" for span in lines.spans)
    why = f"of {tried}, the one with which the fit best predicts cycles it did not know" if len(lines.spans) > 1 else ""
    return f"slope of a local quadratic over {count} samples, {lines.span:g} s{f' ({why})' if why else ''}"


def set_words(names: Sequence[str]) -> str:
    """A set of suspects."""
    return " + ".join(names) if names else "none: line force times speed"
