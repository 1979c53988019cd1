"""Sentences about the result of a diagnosis."""

from __future__ import annotations

from typing import NamedTuple

from winchcascade.core.campaign_file import Origin, joint_origin
from winchcascade.diagnosis.causes import BACK, HOLD, RAMP
from winchcascade.diagnosis.closure import by_cycles
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    DiagnosisResult,
    Experiment,
    GapClosure,
    Spot,
)
from winchcascade.diagnosis.entries import effect_name
from winchcascade.diagnosis.gap_map import STANDS_OUT, arises
from winchcascade.diagnosis.line.line_causes import STEP, SWING
from winchcascade.diagnosis.line.line_diagnose import BURST, LineDiagnosis, LineRemainder
from winchcascade.diagnosis.nuisances import calibrated_numbers
from winchcascade.report.cause_words import (
    PLURAL,
    alternatives_words,
    cycles_of,
    part_words,
)
from winchcascade.report.digits import number, upper
from winchcascade.report.gap_words import (
    about_words,
    apart_words,
    arises_sentence,
    has_own_simulation,
    phase_words,
    probability_words,
    share_words,
    where_sentence,
)
from winchcascade.report.wording import load_words

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts as headings."""

FAR_ENOUGH = 3.0
"""Minimum expected difference, in standard deviations, at which an experiment distinguishes two effects."""

SURE = 0.95
"""A cause of a smaller probability is listed with its probability."""

LEAST = 0.005
"""A smaller share of a gap rounds to 0 % and is called none. [1]"""

EXPLAINED = 0.9
"""Below this share, a gap of a winch without a model counts as explained only if the residual is noise."""


class Phrases(NamedTuple):
    """What the sentences of the two kinds of diagnosis do not share.

    `suspect` is what may be a cause, `none` the absence of all, `item` what is held out, `gap` what the causes close, `closes`
    of that as a verdict says it, `alike` what an alternative does. `verdicts` are sentences, by the verdict or by the residual.
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
    closes="gap",
    alike="explain the data",
    verdicts={
        "no_gap": "Nothing in these logs is significant against noise and the tolerances of the rig: no cause is named.",
        "no_cause": "The logs differ from the model by more than noise and tolerances, but no effect of the catalogue explains "
        "it: the cause lies outside the catalogue.",
        "explained": "{closes}; the residual is not significant.",
        "partly_explained": "{closes}, but the residual exceeds noise: something else acts too.",
        "tried": "No cause is named: {tried} ({set}) closes {share} of the gap {judged} "
        "and leaves a structured residual.",
    },
)
OWN = MODEL._replace(
    gap="explainable gap between your simulation and the logs",
    closes="gap between your simulation and the logs",
    verdicts={
        **MODEL.verdicts,
        "no_gap": "Nothing in these logs is significant against noise and the tolerances of the rig's model: no cause is "
        "named. Your simulation differs from the logs by no more than these and its model form.",
    },
)
"""Phrases where the logs are compared with a simulation of the owner."""

LINE = Phrases(
    suspect="suspect",
    none="no suspect",
    item="cycle",
    gap="squared error",
    closes="squared error between winch power and line power",
    alike="predict",
    verdicts={
        "no_gap": "The power of the winch is that of its line, line tension times speed, but for noise: no cause predicts "
        "held-out cycles any better.",
        "no_cause": "The power of the winch differs from that of its line by more than noise, but no suspect explains it: "
        "neither inertia nor losses in units of the line nor the force cell.",
        "tried": "No cause is named: {tried} ({set}) closes {share} of the squared error {judged}.",
        "noise": "{closes}; the residual is no more than noise.",
        "quiet": "{closes}; the residual has no structure.",
        "structure": "{closes}, but the residual has a structure: something else acts too, and part of it may be in these "
        "numbers.",
        "energies": "{closes}, but the energies of {places} are not explained.",
        "more": "{closes}; the residual exceeds noise.",
    },
)


def phrases_of(found: DiagnosisResult) -> Phrases:
    """Phrases of the kind of a diagnosis."""
    if isinstance(found, LineDiagnosis):
        return LINE
    return OWN if has_own_simulation(found) else MODEL


# ------------------------------------------------------------------------------------------------- what things are called
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


def _shared_words(found: DiagnosisResult) -> str:
    """Effects that logs and own simulation have alike, so that they cause no gap; empty without any."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    return "" if own is None else " and ".join(f"{found.suspects[name].label} ({name})" for name in own.shared)


def not_needed_words(found: DiagnosisResult) -> str:
    """Names of the effects that are not needed beside the causes; an entry of several runs is listed once."""
    chosen = {effect_name(name) for name in found.chosen}
    others = dict.fromkeys(effect_name(name) for name in found.suspects if effect_name(name) not in chosen)
    return ", ".join(others) if found.causes else ""


def start_words(found: ModelDiagnosis) -> str:
    """Calibrated numbers in whose place a diagnosis starts from those before; empty without any."""
    logs: dict[str, list[str]] = {}
    for (_, name), stated in calibrated_numbers(found.rig).items():
        if stated.calibrated is not None and stated.calibrated.prior is not None:
            logs.setdefault(stated.calibrated.log, []).append(name)
    return " ".join(
        f"The diagnosis starts from {', '.join(names)} before the calibration from {log}."
        for log, names in logs.items()
    )


# ----------------------------------------------------------------------------------------------------------- the verdict
def verdict_words(found: DiagnosisResult) -> str:
    """One honest sentence about the verdict."""
    phrases, closure = phrases_of(found), found.closure
    if shared := _shared_words(found):
        return f"Your simulation differs from the logs by no more than noise: both have {shared}. No cause is named."
    if closure is None:
        if found.minor and found.verdict == "no_gap":
            return "What these logs show beyond noise and tolerances is too small to matter: no cause is named."
        return phrases.verdicts["no_gap" if found.verdict == "no_gap" else "no_cause"]
    count, more = len(found.causes), len(found.unnamed)
    if not count:
        sets = len(found.sets) - 1
        tried = (
            f"{sets} sets of effects were fitted, and the best of them"
            if sets > 1
            else "one set of effects was fitted, and it"
        )
        if isinstance(found, LineDiagnosis):
            tried = f"all sets of {', '.join(found.lines.names)} were fitted, and the best of them"
        share = f"only {share_words(closure.share)}" if closure.share > LEAST else "none"
        return phrases.verdicts["tried"].format(
            tried=tried, set=" + ".join(found.chosen), share=share, judged=closed_on(found)
        )
    named = "The named cause closes" if count == 1 else f"The {count} named causes close"
    if has_own_simulation(found):
        named = f"The rig's model with the named cause{'s' if count > 1 else ''} closes"
    if more:
        named = f"A fit of {count + more} effects, of which the leading {count} are named, closes"
    share = share_words(max(closure.share, 0.0)).replace(">", "more than")
    closes, state, places = f"{named} {share} of the {phrases.closes} {closed_on(found)}", str(found.verdict), ""
    if isinstance(found, LineDiagnosis):
        alarms, places = found.remainder is not None and found.remainder.alarms, energy_places(found)
        explained = "noise" if closure.share < EXPLAINED else "quiet"
        state = "energies" if places else explained if state == "explained" else "structure" if alarms else "more"
    return phrases.verdicts[state].format(closes=closes, places=places)


# ------------------------------------------------------------------------------------------------------------- the place
def where_words(found: DiagnosisResult) -> str:
    """Where the gap lies end to end; where no mean is significant, the strongest sign instead."""
    if found.where is None:
        return ""
    if isinstance(found, LineDiagnosis):
        return upper(where_sentence(found.where, word_of(found)))
    alarms = found.remainder.alarms if found.remainder is not None else ()
    if not alarms or any(abs(place.z) > STANDS_OUT for place in found.places):
        explained = found.verdict == "explained"
        return where_sentence(found.where, own_simulation=has_own_simulation(found), explained=explained)
    where = about_words(alarms[0].about, files_of(found))
    return f"No mean over a phase deviates beyond noise and tolerances; what shows is {alarms[0].kind}, {where}."


def arises_words(found: DiagnosisResult) -> str:
    """In which stage the gap arises when each stage has its logged inputs."""
    return "" if found.where is None else arises_sentence(found.where.arises)


def says_more(found: ModelDiagnosis) -> bool:
    """Whether the stages by themselves show anything beyond the stage that is reported already."""
    if found.where is None:
        return False
    own = arises(found.stages)
    return found.verdict != "explained" or own.stage != found.where.stage or len(own.off) > 1


def not_visible_words(found: ModelDiagnosis) -> str:
    """Effects that logs without some channels cannot show at any plausible size; nothing where no channel is missing."""
    names = dict.fromkeys(effect_name(name) for name in found.not_visible)
    if not found.missing_channels or not names:
        return ""
    return f"without {', '.join(found.missing_channels)} these logs cannot show {', '.join(names)}"


def checked_words(found: ModelDiagnosis) -> str:
    """What was checked where no gap was found."""
    out, alone = (sum(abs(place.z) > STANDS_OUT for place in places) for places in (found.places, found.stages))
    deviate = "none deviates" if not out else f"{out} deviate"
    more = ", but no effect explains that better than tolerances do" if out else ""
    if out and has_own_simulation(found):
        more = " from your simulation"
    staged = f" Stage by stage {alone} of {len(found.stages)} do." if alone else ""
    likeliest = max(found.sets, key=lambda names: found.sets[names], default=())
    little = "none explains more than chance would"
    if likeliest:
        likely = probability_words(found.sets[likeliest])
        little = (
            f"the most probable, {' + '.join(likeliest)}, has a probability of {likely}, too low to be named as a cause"
        )
    chance = f" {len(found.suspects)} effects: {little}."
    return (
        f"{len(found.places)} means by channel, phase and load: {deviate} by more than {STANDS_OUT:g} standard "
        f"uncertainties{more}.{staged}{'' if _shared_words(found) else chance}"
    )


# ---------------------------------------------------------------------------------------------------- how sure, how far
def sure_words(found: DiagnosisResult) -> str:
    """How sure the causes are, and what no effect of the catalogue is and looks like one of them."""
    phrases, count, others = phrases_of(found), len(found.causes), len(found.sets) - 1
    if shared := _shared_words(found):
        return f"By the rig's model, the numbers of {shared} agree within their intervals in the logs and in your simulation."
    if not count and found.verdict == "unexplained":
        return ""
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
        f"{'at least' if any(one.probability > cause.probability for one in cause.look_alikes) else 'about'} as well as "
        f"{cause.effect}"
        for cause in found.causes
        if cause.look_alikes
    ]
    parts += alike or [f"no other {phrases.suspect} would {phrases.alike} as well"]
    text = f"{'; '.join(parts)}. A probability is the posterior within the catalogue."
    if isinstance(found, LineDiagnosis):
        return text
    effects = (found.suspects[cause.effect] for cause in found.causes)
    unlisted = [f"{effect.unlisted} would look like {effect.name}" for effect in effects if effect.unlisted]
    return f"{text} Not in the catalogue: {'; '.join(unlisted)}." if unlisted else text


def closure_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """How much of the gap is closed, between which bounds it lies, and how that is known."""
    if found.closure is None:
        return ""
    if found.closure.share < LEAST:
        return f"None of the {phrases_of(found).gap} is closed, {judged_words(found)}."
    share = share_words(found.closure.share).replace(">", "More than")
    text = f"{share} of the {phrases_of(found).gap} is closed (95 %: {interval_words(found.closure)}), {judged_words(found)}."
    if not isinstance(found, LineDiagnosis) or found.closure is None:
        return text
    beyond = share_words(found.closure.beyond_noise).replace(">", "more than")
    return f"{text} Of what exceeds the white noise of the power it is {beyond}."


def closure_kind(found: DiagnosisResult) -> str:
    """Whether the data on which the causes are judged took part in their choice: `held_out` if not."""
    if isinstance(found, LineDiagnosis):
        return "held_out" if any(part.withheld for part in found.lines.parts) else "leave_one_out"
    return "held_out" if isinstance(found, ModelDiagnosis) and found.data.withheld else "leave_one_load_out"


def closed_on(found: DiagnosisResult) -> str:
    """On what a gap is closed, behind a verb."""
    item = phrases_of(found).item
    return {
        "held_out": f"on held-out {item}s",
        "leave_one_out": f"by leave-one-{item}-out",
        "leave_one_load_out": "by leave-one-load-out",
    }[closure_kind(found)]


def interval_words(closure: GapClosure) -> str:
    """Interval of the share that is closed."""
    low, high = share_words(max(closure.low, 0.0)), share_words(closure.high)
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def judged_words(found: ModelDiagnosis | LineDiagnosis) -> str:
    """On what the causes are judged, and whether it took part in the choice."""
    items, each, held_out = f"{phrases_of(found).item}s", "each log with a load", []
    if isinstance(found, LineDiagnosis):
        each = f"each of {found.moments.folds} {'stretches' if cycles_of(found) < found.moments.folds else 'cycles'}"
        held_out = [part_words(part) for part in found.lines.parts if part.withheld]
    else:
        held_out = [load_words(found.data.logs[k].run.load) for k in sorted(found.data.withheld)]
        if found.closure is not None and by_cycles(found.data, found.closure.withheld):
            each = "the cycles of the only load, a part of them at a time,"
    if held_out:
        return f"judged on {items} that took part in neither choice nor fit ({', '.join(held_out)})"
    if found.closure is None:
        return f"all {items} took part"
    return f"judged on {each} by a fit without it; the causes were chosen on all {items}"


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
    if plan.repeats:
        run = f"after all other runs the load of {plan.repeats} again, {run}"
    rivals = [(cause.effect, rival.effect) for cause in found.causes for rival in cause.look_alikes]
    alternative = other in (rival for _, rival in rivals)
    if plan.expected_z < FAR_ENOUGH and (plan.load is None or alternative):
        return (
            f"None of the runs that were considered distinguishes {one} from {other}: they would differ by {apart} at most "
            f"({run}). Measure one of the two directly."
        )
    if alternative:
        return f"{upper(run)}. There {one} and {other} differ by {apart}, which distinguishes them."
    none = "No alternative explanation remains"
    if rivals:
        pairs = " and ".join(f"{cause} from {rival}" for cause, rival in rivals)
        none = f"These logs do not distinguish {pairs}; only a direct measurement does"
    if plan.expected_z < FAR_ENOUGH:
        return (
            f"{none}. These logs rule out {other}, the next suspect: a further run would add at most {apart} ({run})."
        )
    run = f"{run}. They differ there by {apart}"
    return f"{none}. The sharpest further test compares {one} with the next suspect, {other}: {run}."


# -------------------------------------------------------------------------------------------------------------- the residual
def remainder_words(found: DiagnosisResult) -> str:
    """What the causes leave."""
    left = found.remainder
    if left is None:
        return "There is no residual beyond noise."
    if isinstance(found, LineDiagnosis) and isinstance(left, LineRemainder):
        return _line_remainder(found, left)
    share = 1.0 if found.closure is None else max(1.0 - found.closure.share, 0.0)
    part = "Less than 1 % of the" if share < 0.01 else f"{number(100.0 * share, 0)} % of the" if share < 1.0 else "The"
    closed = "" if found.closure is None else f"{part} gap stays open"
    if not left.alarms:
        return f"{closed}; it has no significant structure." if closed else "It has no structure."
    signs = f"{len(left.alarms)} sign{'s' * (len(left.alarms) > 1)} of something unexplained"
    return f"{closed}, with {signs}." if closed else f"{signs}."


def _line_remainder(found: LineDiagnosis, left: LineRemainder) -> str:
    if found.closure is None or not isinstance(left.worst, Spot):
        return ""
    slow = f", and {number(100.0 * left.slow, 0)} % lasts longer than a second"
    return (
        f"{share_words(left.share)} of the squared error stays open: {number(100.0 * left.in_worst, 0)} % of it in "
        f"{phase_words(left.worst.phase or '')}, {number(100.0 * left.bursts, 0)} % in {100.0 * BURST:.0f} % of the samples"
        f"{'' if any(alarm.kind == 'slow' for alarm in left.alarms) else slow}."
    )


# --------------------------------------------------------------------------------------------- of a winch without a model
def energy_places(found: LineDiagnosis) -> str:
    """Phases whose energies are not explained; empty without any."""
    alarms = () if found.remainder is None else found.remainder.alarms
    phases = [alarm.about.phase for alarm in alarms if alarm.kind == "energy" and isinstance(alarm.about, Spot)]
    return " and ".join(PLURAL[phase] for phase in phases if phase is not None)
