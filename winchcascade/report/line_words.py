"""What the diagnosis of a winch without a model found, in sentences that the terminal and the reports share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import Origin, joint_origin
from winchcascade.diagnosis.line.line_closure import BURST
from winchcascade.diagnosis.line.line_data import beside
from winchcascade.diagnosis.line.line_gap import sentence
from winchcascade.diagnosis.line.line_selection import DRAWS
from winchcascade.report.diagnosis_names import (
    apart_words,
    number_words,
    phase_words,
    probability_words,
    share_words,
)
from winchcascade.report.diagnosis_words import FAR_ENOUGH, SURE
from winchcascade.report.digits import number, significant
from winchcascade.rig.effects.effect import Display

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.causes import Cause, Reported
    from winchcascade.diagnosis.line.line_data import Part
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.diagnosis.remainder import Alarm

PARAMETERS = {
    "drum_inertia": Display("inertia, as a mass on the line", 1.0, "kg", signed=False),
    "line_friction": Display("constant friction", 1.0, "N", signed=False),
    "line_drag": Display("drag over speed", 1.0, "N·s/m", signed=False),
    "force_gain": Display("gain of the force cell", 100.0, "%"),
    "force_zero": Display("zero of the force cell", 1.0, "N"),
}
"""How the number of each suspect is told, in units of the line."""

MEANINGS = {
    "drum_inertia": "What turns with the line (drum, gear, machine, tether on the drum) takes power to speed up and gives it "
    "back.",
    "line_friction": "A constant friction between line and shaft, against the motion.",
    "line_drag": "A drag between line and shaft in proportion to the speed.",
    "force_gain": "The force cell reads too much or too little, by the same share everywhere.",
    "force_zero": "The force cell reads too much or too little, by the same force everywhere.",
}
"""What each suspect is on a winch of which only line and shaft are known."""


def word_of(found: LineDiagnosis) -> str:
    """What the logs are called: `measured` where that is stated of all of them, else `logged`."""
    return "measured" if joint_origin(origins_of(found)).measured else "logged"


def origins_of(found: LineDiagnosis) -> list[Origin]:
    """Where the data of each part come from."""
    return [part.run.origin for part in found.lines.parts]


def value_words(effect: str, found: Reported) -> tuple[str, str]:
    """A number with its unit, and its 95 % interval, with as many digits as the interval allows."""
    value, interval = number_words(PARAMETERS[effect], found, 3)
    return value, interval if found.high > found.low else "at the end of what is plausible"


def cause_words(cause: Cause) -> str:
    """A cause: what it is, and its number with its interval."""
    (found,) = cause.parameters.values()
    value, interval = value_words(cause.effect, found)
    return f"{PARAMETERS[cause.effect].what} {value} (95 %: {interval})"


def part_words(part: Part) -> str:
    """The cycles of a part and its log."""
    first, last = int(part.cycle.min()), int(part.cycle.max())
    cycles = f"cycle {first}" if first == last else f"cycles {first} to {last}"
    return f"{cycles} of {part.run.name}"


def judged_words(found: LineDiagnosis) -> str:
    """On what the causes are judged."""
    if found.judged is None:
        return "all cycles took part"
    if found.judged.left_out_in_turn:
        few = (
            len({(k, c) for k, part in enumerate(found.lines.parts) for c in part.cycle.tolist()}) < found.moments.folds
        )
        what = f"each of {found.moments.folds} stretches" if few else f"each of {found.moments.folds} cycles"
        return f"judged on {what} by a fit without it; the causes were chosen on all"
    parts = " and ".join(part_words(part) for part in found.judged.parts)
    return f"judged on {parts}, which took part in neither choice nor fit"


# ----------------------------------------------------------------------------------------------------------- sentences
def verdict_words(found: LineDiagnosis) -> str:
    """One honest sentence about the verdict."""
    if found.verdict == "no_gap":
        return (
            "The power of the winch is that of its line, force times speed, but for noise: no cause predicts cycles that it "
            "does not know any better."
        )
    if found.judged is None:
        return (
            "The power of the winch differs from that of its line by more than noise, but no suspect explains it: neither "
            "inertia nor losses in line units nor the force cell."
        )
    count = len(found.causes)
    named = "The named cause closes" if count == 1 else f"The {count} named causes close"
    if unnamed(found):
        named = f"A fit of {count + len(unnamed(found))} effects, of which the leading {count} are named, closes"
    share = share_words(found.judged.closed).replace(">", "more than")
    text = (
        f"{named} {share} of the squared error between winch power and line power on cycles that the fit did not know"
    )
    if found.verdict == "explained":
        quiet = found.judged.closed < EXPLAINED
        return f"{text}; what is left {'is no more than noise' if quiet else 'keeps no structure'}."
    if found.left.alarms:
        return f"{text}, but what is left keeps a structure: something else acts too, and part of it may sit in these numbers."
    return f"{text}; what is left is more than noise."


EXPLAINED = 0.9
"""Below this share a gap counts as explained only if what is left is noise."""


def unnamed(found: LineDiagnosis) -> list[str]:
    """Effects of the fit that are not named as causes."""
    named = {cause.effect for cause in found.causes}
    return [name for name in found.choice.chosen if name not in named]


def where_words(found: LineDiagnosis) -> str:
    """Where the gap lies."""
    if found.verdict == "no_gap":
        return ""
    text = sentence(found.stage, found.rows).replace("= -", "= −").replace("measured", word_of(found))
    return text[:1].upper() + text[1:]


def sure_words(found: LineDiagnosis) -> str:
    """How sure the causes are."""
    if not found.causes:
        return f"Probability of no cause: {probability_words(found.choice.probability[()])}."
    parts = []
    weak = [cause for cause in found.causes if cause.probability < SURE]
    parts += [f"{c.effect} was chosen in {number(100.0 * c.probability, 0)} % of them" for c in weak]
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


def closure_words(found: LineDiagnosis) -> str:
    """How much is closed, between which bounds, and how that is known."""
    if found.judged is None:
        return ""
    share = share_words(found.judged.closed).replace(">", "More than")
    beyond = share_words(found.judged.beyond_noise).replace(">", "more than")
    return (
        f"{share} of the squared error is closed (95 %: {interval_words(found)}), {judged_words(found)}. Of what exceeds the "
        f"white noise of the power it is {beyond}."
    )


def interval_words(found: LineDiagnosis) -> str:
    """Interval of the share that is closed."""
    if found.judged is None:
        return ""
    low, high = (share_words(x) for x in (found.judged.low, found.judged.high))
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def again_words(found: LineDiagnosis) -> str:
    """Whether the withheld cycles alone give the same numbers."""
    if not found.again:
        return ""
    apart, parts = [], []
    for cause in found.causes:
        other, (own,) = found.again[cause.effect], cause.parameters.values()
        value, interval = value_words(cause.effect, other)
        parts.append(f"{PARAMETERS[cause.effect].what} {value} ({interval})")
        if other.low > own.high or other.high < own.low:
            apart.append(cause.effect)
    text = f"Fitted to the withheld cycles alone: {'; '.join(parts)}."
    if apart:
        return f"{text} The intervals of {' and '.join(apart)} do not meet: it changes in the course of the logs."
    return f"{text} The intervals meet: the numbers are steady."


def experiment_words(found: LineDiagnosis) -> str:
    """What to test next, and what it would bring."""
    plan = found.experiment
    if plan is None:
        return ""
    one, other = plan.separates
    apart, motion = apart_words(plan.expected_z), plan.profile[:1].upper() + plan.profile[1:]
    if plan.expected_z < FAR_ENOUGH:
        return (
            f"None of the motions that were considered tells {one} from {other}: they would differ by {apart} standard "
            f"deviations at most ({plan.profile}). Measure one of the two directly."
        )
    if any(rival.effect == other for cause in found.causes for rival in cause.rivals):
        return f"{motion}. There {one} and {other} differ by {apart} standard deviations, so it tells which it is."
    return (
        f"No rival is left to be told apart. The sharpest further test is of {one} against the suspect that comes nearest, "
        f"{other}. {motion}: there the two differ by {apart} standard deviations."
    )


def remainder_words(found: LineDiagnosis) -> str:
    """What the causes leave."""
    left = found.left
    signs = "; ".join(alarm_words(alarm) for alarm in left.alarms)
    signs = f"{signs[:1].upper()}{signs[1:]}." if signs else ""
    if found.judged is None:
        return signs
    share = share_words(max(1.0 - found.judged.closed, 0.0))
    shape = (
        f"{share} of the squared error stays open: {number(100.0 * left.phases[left.phase], 0)} % of it in "
        f"{phase_words(left.phase)}, {number(100.0 * left.bursts, 0)} % in {100.0 * BURST:.0f} % of the samples"
    )
    if any(alarm.kind == "slow" for alarm in left.alarms):
        return f"{shape}. {signs}"
    return f"{shape}, and {number(100.0 * left.slow, 0)} % lasts longer than a second. {signs}".rstrip()


def alarm_words(alarm: Alarm) -> str:
    """A sign of structure, without a full stop."""
    where = alarm.where.replace("power_mech", "winch power")
    if alarm.kind == "slow":
        size, limit = (number(100.0 * x, 0) for x in (alarm.size, alarm.limit))
        return f"{size} % of what is left lasts longer than a second (limit {limit} %)"
    return f"{where}: means of 0.44 s are {alarm.size:.1f} times their noise (limit {alarm.limit:g})"


def flipped_words(found: LineDiagnosis) -> str:
    """Which channels were logged with the other sign and turned at the door."""
    said = [
        f"{part.run.name}: {finding.message}; {finding.action}"
        for part in found.lines.parts
        for finding in part.run.findings
        if finding.kind == "sign_flipped"
    ]
    return "; ".join(f"{text}" for text in dict.fromkeys(said)) + "." if said else ""


def small_words(found: LineDiagnosis) -> str:
    """What the suspects that are not named would close together."""
    rest = [name for name in found.lines.names if name not in found.choice.chosen]
    if not found.causes or not rest:
        return ""
    more = 100.0 * (found.choice.error(found.choice.chosen) - found.choice.error(found.choice.best))
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
