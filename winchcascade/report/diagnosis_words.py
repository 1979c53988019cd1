"""What a diagnosis found, in sentences that the terminal, the reports and the JSON share."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from winchcascade.core.campaign_file import Origin, joint_origin
from winchcascade.diagnosis.causes import BACK, HOLD, RAMP
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    Arises,
    DiagnosisResult,
    Experiment,
    GapClosure,
    NamedCause,
    Place,
    Spot,
    StagePlace,
    Where,
)
from winchcascade.diagnosis.gap_map import STANDS_OUT, arises
from winchcascade.diagnosis.line.line_causes import STEP, SWING
from winchcascade.diagnosis.line.line_closure import BURST
from winchcascade.diagnosis.line.line_data import POWER, CyclePart, beside
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.line.line_selection import DRAWS
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.report.diagnosis_names import (
    apart_words,
    display_of,
    load_words,
    nuisance_words,
    number_words,
    phase_words,
    probability_words,
    share_words,
)
from winchcascade.report.digits import number, significant
from winchcascade.rig.effects.effect import Display

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts as headings."""

NAMES = {
    "pressure": "pressure", "force": "line tension", "torque": "torque", "vdc": "Vdc", "idc": "Idc", POWER: "winch power",
}  # fmt: skip
UNITS = {"pressure": "Pa", "force": "N", "torque": "N m", "vdc": "V", "idc": "A"}
SENSORS = {
    "pressure": "pressure sensor", "force": "force cell", "torque": "torque sensor", "vdc": "sensor of Vdc",
    "idc": "sensor of Idc",
}  # fmt: skip

FAR_ENOUGH = 3.0
"""An experiment distinguishes two effects if they are expected to differ by at least so many standard deviations."""

SURE = 0.95
"""A cause of a smaller probability is listed with its probability."""

EXPLAINED = 0.9
"""Below this share, a gap of a winch without a model counts as explained only if the residual is noise."""

LINE_NUMBERS = {
    "drum_inertia": Display("inertia, as a mass on the line", 1.0, "kg", signed=False),
    "line_friction": Display("constant friction", 1.0, "N", signed=False),
    "line_drag": Display("drag over speed", 1.0, "N·s/m", signed=False),
    "force_gain": Display("gain of the force cell", 100.0, "%"),
    "force_zero": Display("zero of the force cell", 1.0, "N"),
}
"""Display of the number of each suspect without a model, in units of the line."""

LINE_MEANINGS = {
    "drum_inertia": "What turns with the line (drum, gear, machine, tether on the drum) takes power to speed up and gives it "
    "back.",
    "line_friction": "A constant friction between line and shaft, against the motion.",
    "line_drag": "A drag between line and shaft in proportion to the speed.",
    "force_gain": "The force cell reads too much or too little, by the same share everywhere.",
    "force_zero": "The force cell reads too much or too little, by the same force everywhere.",
}
"""What each suspect is on a winch of which only line and shaft are known."""


class Phrases(NamedTuple):
    """What the sentences of the two kinds of diagnosis do not share.

    `suspect` is what may be a cause, `none` the absence of all, `item` what is held out, `gap` what the causes close, `closes`
    that on held-out data, `alike` what an alternative does. `verdicts` are sentences, by the verdict or by the residual.
    """

    suspect: str
    none: str
    item: str
    gap: str
    closes: str
    alike: str
    verdicts: dict[str, str]


MODEL = Phrases(
    suspect="effect",
    none="no effect of the catalogue",
    item="log",
    gap="explainable gap",
    closes="gap on held-out logs",
    alike="explain the data",
    verdicts={
        "no_gap": "Nothing in these logs is significant against noise and the tolerances of the rig: no cause is named.",
        "no_cause": "The logs differ from the model by more than noise and tolerances, but no effect of the catalogue explains "
        "it: the cause lies outside the catalogue.",
        "explained": "{closes}; the residual is not significant.",
        "partly_explained": "{closes}, but the residual exceeds noise: something else acts too.",
        "unexplained": "The best set of the catalogue closes only {share} of the gap on held-out logs and leaves a structured "
        "residual: take the names below as a hint at most.",
    },
)
LINE = Phrases(
    suspect="suspect",
    none="no suspect",
    item="cycle",
    gap="squared error",
    closes="squared error between winch power and line power on held-out cycles",
    alike="predict",
    verdicts={
        "no_gap": "The power of the winch is that of its line, line tension times speed, but for noise: no cause predicts "
        "held-out cycles any better.",
        "no_cause": "The power of the winch differs from that of its line by more than noise, but no suspect explains it: "
        "neither inertia nor losses in units of the line nor the force cell.",
        "noise": "{closes}; the residual is no more than noise.",
        "quiet": "{closes}; the residual has no structure.",
        "structure": "{closes}, but the residual has a structure: something else acts too, and part of it may be in these "
        "numbers.",
        "more": "{closes}; the residual exceeds noise.",
    },
)


def phrases_of(found: DiagnosisResult) -> Phrases:
    """Phrases of the kind of a diagnosis."""
    return LINE if isinstance(found, LineDiagnosis) else MODEL


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


class CauseNumber(NamedTuple):
    """A number of a cause as the tables show it: what it is, its value with its unit, its 95 % interval with and without it.

    The texts about the cause itself are empty for all but its first number.
    """

    effect: str
    stage: str
    what: str
    value: str
    interval: str
    beside: str
    probability: str
    alternatives: str


def numbers_of(found: DiagnosisResult, cause: NamedCause, *, again: bool = False) -> list[CauseNumber]:
    """Every number of a cause.

    Parameters
    ----------
    again : the numbers of a winch without a model as the withheld cycles alone give them
    """
    numbers = []
    about = (cause.effect, cause.stage, probability_words(cause.probability), alternatives_words(cause, ", ") or "none")
    for name, value in cause.parameters.items():
        if isinstance(found, LineDiagnosis):
            how, value = LINE_NUMBERS[cause.effect], found.again[cause.effect] if again else value
            text, interval = number_words(how, value, 3)
            interval = interval if value.high > value.low else "at the end of what is plausible"
        else:
            how = display_of(cause.effect, name, value.unit)
            text, interval = number_words(how, value)
        numbers.append(
            CauseNumber(*about[:2], how.what, text, interval, interval.removesuffix(how.unit).rstrip(), *about[2:])
        )
        about = ("",) * 4
    return numbers


def cause_words(found: DiagnosisResult, cause: NamedCause, *, again: bool = False) -> str:
    """Every number of a cause, with its interval; `again` as for `numbers_of`."""
    return "; ".join(
        f"{n.what} {n.value} ({'' if again else '95 %: '}{n.interval})" for n in numbers_of(found, cause, again=again)
    )


def meaning_words(found: DiagnosisResult, effect: str) -> str:
    """What a suspect is."""
    return LINE_MEANINGS[effect] if isinstance(found, LineDiagnosis) else found.suspects[effect].summary


def alternatives_words(cause: NamedCause, conjunction: str) -> str:
    """Names of the alternatives to a cause."""
    return conjunction.join(rival.effect for rival in cause.rivals)


def spot_words(spot: Spot, names: Mapping[str, str] = NAMES) -> str:
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
    return spot_words(about) if isinstance(about, Spot) else nuisance_words(about, files)


def differs_text(spot: Spot | None) -> str:
    """Where a cause and its alternative differ most, as the JSON has it.

    >>> differs_text(Spot("idc", "payout", 4.5, z=458.52)), differs_text(Spot("power_mech", "hold", bias=12.3))
    ('idc during payout at 4.5 ohm, where they differ by 458.5 sigma', 'power_mech during hold, by 12 W rms')
    """
    if spot is None or spot.load is None:
        return differs_words(spot, {})
    return f"{spot_words(spot, {})} at {load_words(spot.load, 'ohm')}, where they differ by {spot.z:.1f} sigma"


def differs_words(spot: Spot | None, names: Mapping[str, str] = NAMES) -> str:
    """Where a cause and its alternative differ most.

    >>> differs_words(Spot("idc", "payout", 4.5, z=458.52))
    'Idc during payout at 4.5 Ω, by more than 100 standard deviations'
    """
    if spot is None:
        return "nothing that these logs measure"
    if spot.load is None:
        return f"{spot_words(spot, names)}, by {spot.bias:.0f} W rms"
    return f"{spot_words(spot, names)} at {load_words(spot.load)}, by {apart_words(spot.z)} standard deviations"


# ----------------------------------------------------------------------------------------------------------- the verdict
def verdict_words(found: DiagnosisResult) -> str:
    """One honest sentence about the verdict."""
    phrases, closure = phrases_of(found), found.closure
    if closure is None:
        return phrases.verdicts["no_gap" if found.verdict == "no_gap" else "no_cause"]
    count, more = len(found.causes), len(found.unnamed)
    named = "The named cause closes" if count == 1 else f"The {count} named causes close"
    if more:
        named = f"A fit of {count + more} effects, of which the leading {count} are named, closes"
    state: str = found.verdict
    if isinstance(found, LineDiagnosis):
        alarms = found.remainder is not None and found.remainder.alarms
        explained = "noise" if closure.share < EXPLAINED else "quiet"
        state = explained if state == "explained" else "structure" if alarms else "more"
    share = share_words(closure.share).replace(">", "more than")
    return phrases.verdicts[state].format(closes=f"{named} {share} of the {phrases.closes}", share=share)


# ------------------------------------------------------------------------------------------------------------- the place
def where_sentence(where: Where, word: str = "measured") -> str:
    """Where a gap lies: in which direction, at what currents and speeds, by how much; as the JSON has it.

    Parameters
    ----------
    word : what the power of a winch without a model is called
    """
    worst = where.worst
    if worst.channel == POWER:
        return (
            f"{where.stage}: in {phase_words(worst.phase)} the {word} power of the winch lies {abs(worst.bias) / 1e3:.2g} kW "
            f"{'above' if worst.bias > 0.0 else 'below'} line tension times speed on average (z = {worst.z:+.0f}), "
            f"{worst.rms / 1e3:.2g} kW rms; that phase holds {100.0 * worst.share:.0f} % of the squared gap."
        )
    region = ""
    if worst.phase == "payout" and math.isfinite(where.rpm[0]):
        region = f" between {where.rpm[0]:.0f} and {where.rpm[1]:.0f} rpm"
        if where.i_dc[1] > 0.5:
            region += f" and {max(where.i_dc[0], 0.0):.1f} to {where.i_dc[1]:.1f} A DC"
    place = "a sensor" if where.stage == "sensor" else f"the {where.stage} stage"
    return f"The gap lies in {place}: {_deviates(worst, where.size, region)}by up to {size_text(worst.channel, where.size)}."


def arises_sentence(own: Arises | None) -> str:
    """In which stage a gap arises when each stage has its logged inputs, as the JSON has it."""
    if own is None:
        return ""
    inputs = "With logged inputs to each stage,"
    if own.worst is None:
        return f"{inputs} no stage deviates by more than {STANDS_OUT:g} standard uncertainties."
    stages = " and ".join([", ".join(own.off[:-1]), own.off[-1]] if len(own.off) > 1 else own.off)
    if own.sensor is not None:
        return (
            f"{inputs} the {stages} stages deviate as they would with a gain error of about {100.0 * own.gain:+.1g} % in the "
            f"{SENSORS[own.sensor]} alone."
        )
    which = (
        f"the {stages} stages deviate, the {own.off[0]} most"
        if len(own.off) > 1
        else f"only the {stages} stage deviates"
    )
    size = size_text(own.worst.channel, own.worst.bias)
    return f"{inputs} {which}: {_deviates(own.worst, own.worst.bias)}by {size} in the mean."


def _deviates(worst: Place | StagePlace, bias: float, region: str = "") -> str:
    """In which direction a channel deviates, by the sign of measured minus simulated, and at which load it does so most."""
    load = "" if worst.load is None else " in open circuit" if math.isinf(worst.load) else f" at {worst.load:g} ohm"
    return (
        f"{NAMES[worst.channel]} is {'over' if bias < 0.0 else 'under'}-predicted during {phase_words(worst.phase)}{region}, "
        f"most clearly{load}, "
    )


def size_text(channel: str, size: float) -> str:
    """The magnitude of a difference with its unit, from SI units.

    >>> size_text("pressure", -98066.5), size_text("vdc", 12.345)
    ('1 kg/cm2', '12.3 V')
    """
    factor, unit = (1.0 / 98066.5, "kg/cm2") if channel == "pressure" else (1.0, UNITS[channel])
    return f"{abs(size) * factor:.3g} {unit}"


def where_words(found: DiagnosisResult) -> str:
    """Where the gap lies end to end; where no mean is significant, the strongest sign instead."""
    if found.where is None:
        return ""
    if isinstance(found, LineDiagnosis):
        return upper(where_sentence(found.where, word_of(found)).replace("= -", "= −"))
    alarms = found.remainder.alarms if found.remainder is not None else ()
    if not alarms or any(abs(place.z) > STANDS_OUT for place in found.places):
        return _signs(where_sentence(found.where))
    return f"No mean over a phase deviates beyond noise and tolerances. {alarm_words(alarms[0], files_of(found))}."


def arises_words(found: DiagnosisResult) -> str:
    """In which stage the gap arises when each stage has its logged inputs."""
    return "" if found.where is None else _signs(arises_sentence(found.where.arises))


def says_more(found: ModelDiagnosis) -> bool:
    """Whether the stages by themselves show anything beyond the stage that is reported already."""
    if found.where is None:
        return False
    own = arises(found.stages)
    return found.verdict != "explained" or own.stage != found.where.stage or len(own.off) > 1


def _signs(text: str) -> str:
    return text.replace("cm2", "cm²").replace(" ohm", " Ω").replace(" -", " −")


def checked_words(found: ModelDiagnosis) -> str:
    """What was checked where no gap was found."""
    out, alone = (sum(abs(place.z) > STANDS_OUT for place in places) for places in (found.places, found.stages))
    deviate = "none deviates" if not out else f"{out} deviate"
    more = ", but no effect explains that better than tolerances do" if out else ""
    staged = f" Stage by stage {alone} of {len(found.stages)} do." if alone else ""
    return (
        f"{len(found.places)} means by channel, phase and load: {deviate} by more than {STANDS_OUT:g} standard "
        f"uncertainties{more}.{staged} {len(found.suspects)} effects: none explains more than chance would."
    )


# ---------------------------------------------------------------------------------------------------- how sure, how far
def sure_words(found: DiagnosisResult) -> str:
    """How sure the causes are, and what no effect of the catalogue is and looks like one of them."""
    phrases, count, others = phrases_of(found), len(found.causes), len(found.sets) - 1
    if not count:
        fitted = f"; {others or 'no'} other set{'' if others == 1 else 's'} of effects came near enough to be fitted"
        likely = f"Probability of {phrases.none}: {probability_words(found.sets.get((), 0.0))}"
        return f"{likely}." if isinstance(found, LineDiagnosis) else f"{likely}{fitted}."
    sure = [cause.probability for cause in found.causes if cause.probability >= SURE]
    parts = [
        f"{c.effect} has a probability of {probability_words(c.probability)}".replace("of <", "below")
        for c in found.causes
        if c.probability < SURE
    ]
    if sure:
        which = "all others have" if parts else "The cause has" if count == 1 else "Each cause has"
        parts.append(f"{which} a probability {'above 0.99' if min(sure) > 0.995 else f'of at least {min(sure):.2f}'}")
    alike = [
        f"{alternatives_words(cause, ' and ')} would {phrases.alike} "
        f"{'at least' if any(r.probability > cause.probability for r in cause.rivals) else 'about'} as well as {cause.effect}"
        for cause in found.causes
        if cause.rivals
    ]
    parts += alike or [f"no other {phrases.suspect} would {phrases.alike} as well"]
    text = "; ".join(parts)
    if isinstance(found, LineDiagnosis):
        return f"{text}. A probability is a share of {DRAWS} resampled sets of cycles."
    effects = (found.suspects[cause.effect] for cause in found.causes)
    unlisted = [f"{effect.unlisted} would look like {effect.name}" for effect in effects if effect.unlisted]
    return f"{text}. Not in the catalogue: {'; '.join(unlisted)}." if unlisted else f"{text}."


def closure_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """How much of the gap is closed, between which bounds it lies, and how that is known."""
    if found.closure is None:
        return ""
    share = share_words(found.closure.share).replace(">", "More than")
    text = f"{share} of the {phrases_of(found).gap} is closed (95 %: {interval_words(found.closure)}), {judged_words(found)}."
    if not isinstance(found, LineDiagnosis) or found.closure is None:
        return text
    beyond = share_words(found.closure.beyond_noise).replace(">", "more than")
    return f"{text} Of what exceeds the white noise of the power it is {beyond}."


def interval_words(closure: GapClosure) -> str:
    """Interval of the share that is closed."""
    low, high = share_words(closure.low), share_words(closure.high)
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def judged_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """On what the causes are judged, and whether it took part in the choice."""
    items, each, held_out = f"{phrases_of(found).item}s", "each log with a load", []
    if isinstance(found, LineDiagnosis):
        each = f"each of {found.moments.folds} {'stretches' if cycles_of(found) < found.moments.folds else 'cycles'}"
        held_out = [part_words(part) for part in found.lines.parts if part.withheld]
    else:
        held_out = [load_words(found.data.logs[k].run.load) for k in sorted(found.data.withheld)]
    if held_out:
        return f"judged on {items} that took part in neither choice nor fit ({', '.join(held_out)})"
    if found.closure is None:
        return f"all {items} took part"
    return f"judged on {each} by a fit without it; the causes were chosen on all {items}"


def cycles_of(found: LineDiagnosis) -> int:
    """Number of the cycles of all parts."""
    return sum(len(set(part.cycle.tolist())) for part in found.lines.parts)


def part_words(part: CyclePart) -> str:
    """The cycles of a part and its log."""
    first, last = int(part.cycle.min()), int(part.cycle.max())
    return f"{f'cycle {first}' if first == last else f'cycles {first} to {last}'} of {part.run.name}"


# ------------------------------------------------------------------------------------------------------- what to test next
def profile_words(plan: Experiment) -> str:
    """The motion of a planned run.

    >>> from winchcascade.diagnosis.diagnosis_result import Experiment
    >>> profile_words(Experiment("force_steps", 1.0, ("a", "b"), 3.0, force=2000.0))
    'reel-out at a constant 1.0 m/s, the line tension in steps from 1.0 kN to 3.0 kN, 10 s each'
    """
    v, force = plan.speed, f"{plan.force / 1e3:.1f} kN"
    return {
        "cycle": f"one cycle: {RAMP:g} s ramp to {v:.2f} m/s, {plan.length:.1f} m of payout, {HOLD:g} s hold, haul-in at "
        f"{BACK * v:.2f} m/s",
        "speed_steps": f"reel-out at a constant line tension of {force}, in steps to a quarter, half, three quarters and all "
        f"of {v:.1f} m/s, {STEP:g} s each",
        "force_steps": f"reel-out at a constant {v:.1f} m/s, the line tension in steps from {0.5 * plan.force / 1e3:.1f} kN to "
        f"{1.5 * plan.force / 1e3:.1f} kN, {STEP:g} s each",
        "out_and_back": f"reel-out and haul-in by turns at {v:.1f} m/s and a constant line tension of {force}, {STEP:g} s each",
        "swing": f"reel-out at a constant line tension of {force}, the speed swinging between {0.5 * v:.1f} and {v:.1f} m/s "
        f"every {SWING:g} s, for {4.0 * STEP:g} s",
    }[plan.motion]


def experiment_words(found: DiagnosisResult) -> str:
    """What to test next, and what it would bring."""
    plan = found.experiment
    if plan is None:
        return ""
    one, other = plan.separates
    apart = f"{apart_words(plan.expected_z)} standard deviations"
    run = profile_words(plan) if plan.load is None else f"{load_words(plan.load)}, {profile_words(plan)}"
    alternative = any(rival.effect == other for cause in found.causes for rival in cause.rivals)
    if plan.expected_z < FAR_ENOUGH and (plan.load is None or alternative):
        return (
            f"None of the runs that were considered distinguishes {one} from {other}: they would differ by {apart} at most "
            f"({run}). Measure one of the two directly."
        )
    if alternative:
        return f"{upper(run)}. There {one} and {other} differ by {apart}, which distinguishes them."
    none = "No alternative explanation remains"
    if plan.expected_z < FAR_ENOUGH:
        return (
            f"{none}: these logs rule out {other}, the next suspect. A further run would add at most {apart} ({run})."
        )
    run = f"{run}. They differ there by {apart}"
    return f"{none}. The sharpest further test compares {one} with the next suspect, {other}: {run}."


# -------------------------------------------------------------------------------------------------------------- the residual
def alarm_words(alarm: Alarm, files: Sequence[str]) -> str:
    """A sign of something unexplained, without a full stop.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    where, size, limit = about_words(alarm.about, files), f"{alarm.size:.1f}", f"(limit {alarm.limit:g})"
    of_power = isinstance(alarm.about, Spot) and alarm.about.channel == POWER
    blocks = "means of 0.44 s are" if of_power else "the root mean square of the residual is"
    return {
        "structure": f"{upper(where)}: {blocks} {size} times the noise {limit}",
        "scatter": f"{upper(where)}: the scatter is {size} times what noise explains {limit}",
        "ripple": f"{upper(where)}: the means scatter about a smooth course {size} times as much as noise explains {limit}",
        "nuisance": f"{upper(where)} had to move by {size} of its standard uncertainties {limit}",
        "slow": f"{number(100.0 * alarm.size, 0)} % of the squared residual lasts longer than a second (limit "
        f"{number(100.0 * alarm.limit, 0)} %)",
    }[alarm.kind]


def alarm_meaning(alarm: Alarm) -> str:
    """What a sign of something unexplained may mean."""
    return {
        "structure": "the model's shape is wrong there",
        "scatter": "something faster than a block of 0.4 s moves, a ripple or a vibration",
        "ripple": "something comes and goes within seconds, as with every turn of a drum that is out of round",
    }.get(alarm.kind, "either its tolerance is wrong or it takes the place of another effect")


def remainder_words(found: DiagnosisResult) -> str:
    """What the causes leave."""
    left = found.remainder
    if left is None:
        return "There is no residual beyond noise."
    if isinstance(found, LineDiagnosis):
        return _line_remainder(found)
    share = 1.0 if found.closure is None else max(1.0 - found.closure.share, 0.0)
    part = "Less than 1 %" if share < 0.01 else f"{number(100.0 * share, 0)} %"
    closed = "" if found.closure is None else f"{part} of the gap stays open"
    if not left.alarms:
        return f"{closed}; it has no significant structure." if closed else "It has no structure."
    several = len(left.alarms) > 1
    signs = f"{f'{len(left.alarms)} signs' if several else 'one sign'} of something unexplained"
    strongest = f"{alarm_words(left.alarms[0], files_of(found))}; {alarm_meaning(left.alarms[0])}."
    return f"{f'{closed}, with {signs}' if closed else upper(signs)}.{' The strongest:' if several else ''} {strongest}"


def _line_remainder(found: LineDiagnosis) -> str:
    left = found.remainder
    if left is None:
        return ""
    signs = "".join(f" {alarm_words(alarm, ())}." for alarm in left.alarms)
    if found.closure is None or not isinstance(left.worst, Spot):
        return signs.strip()
    slow = f", and {number(100.0 * left.slow, 0)} % lasts longer than a second"
    return (
        f"{share_words(left.share)} of the squared error stays open: {number(100.0 * left.in_worst, 0)} % of it in "
        f"{phase_words(left.worst.phase or '')}, {number(100.0 * left.bursts, 0)} % in {100.0 * BURST:.0f} % of the samples"
        f"{'' if any(alarm.kind == 'slow' for alarm in left.alarms) else slow}.{signs}"
    )


# --------------------------------------------------------------------------------------------- of a winch without a model
def again_words(found: LineDiagnosis) -> str:
    """Whether the withheld cycles alone give the same numbers."""
    if not found.again:
        return ""
    pairs = {cause.effect: (found.again[cause.effect], *cause.parameters.values()) for cause in found.causes}
    apart = [effect for effect, (alone, fitted) in pairs.items() if alone.low > fitted.high or alone.high < fitted.low]
    numbers = "; ".join(cause_words(found, cause, again=True) for cause in found.causes)
    steady = (
        f"The intervals of {' and '.join(apart)} do not overlap: the number changes in the course of the logs."
        if apart
        else "The intervals overlap: the numbers are steady."
    )
    return f"Fitted to the withheld cycles alone: {numbers}. {steady}"


def flipped_words(found: LineDiagnosis) -> str:
    """Channels that were logged with the opposite sign, which ingest corrected."""
    flipped = {
        f"{run.name}: {finding.message}; {finding.action}": None
        for run in found.runs
        for finding in run.findings
        if finding.kind == "sign_flipped"
    }
    return "; ".join(flipped) + "." if flipped else ""


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
    tried = " and ".join(f"{span:g} s" for span in lines.spans)
    why = f" (of {tried}, the one with which the fit best predicts held-out cycles)" if len(lines.spans) > 1 else ""
    return f"slope of a local quadratic over {samples_of(found)} samples, {lines.span:g} s{why}"


def samples_of(found: LineDiagnosis) -> int:
    """Samples over which the slope of the velocity is taken."""
    return 2 * beside(found.lines.parts[0].run, found.lines.span) + 1


def set_words(names: Sequence[str]) -> str:
    """A set of suspects."""
    return " + ".join(names) if names else "none: line tension times speed"
