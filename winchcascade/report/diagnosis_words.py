"""What a diagnosis found, in sentences that the terminal and the reports share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import Origin, joint_origin
from winchcascade.diagnosis.gap_location import STANDS_OUT, arises
from winchcascade.report.diagnosis_names import apart_words, load_words, nuisance_words, probability_words, share_words
from winchcascade.report.digits import number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from winchcascade.diagnosis.causes import Cause
    from winchcascade.diagnosis.diagnose import Diagnosis
    from winchcascade.diagnosis.remainder import Alarm

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts as headings."""

FAR_ENOUGH = 3.0
"""An experiment tells two effects apart if they are expected to differ by so many standard deviations."""


SURE = 0.95
"""A cause of a smaller probability is said to be less than sure."""


def word_of(found: Diagnosis) -> str:
    """What the logs are called: `measured` where that is stated of all of them, else `log`."""
    return joint_origin(origins_of(found)).word


def origins_of(found: Diagnosis) -> list[Origin]:
    """Where the data of each log come from."""
    return [log.run.origin for log in found.data.logs]


# ----------------------------------------------------------------------------------------------------------- sentences
def verdict_words(found: Diagnosis) -> str:
    """One honest sentence about the verdict."""
    if found.verdict == "no_gap":
        return "Nothing in these logs stands out of noise and of what is not known of the rig: no cause is named."
    if not found.causes:
        return (
            "The logs differ from the model by more than noise and tolerances, but no effect of the catalogue "
            "explains it: the cause lies outside the catalogue."
        )
    share = "" if found.closure is None else share_words(found.closure.share).replace(">", "more than")
    count = len(found.causes)
    named = "The named cause closes" if count == 1 else f"The {count} named causes close"
    if unnamed(found):
        named = f"A fit of {count + len(unnamed(found))} effects, of which the leading {count} are named, closes"
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


def unnamed(found: Diagnosis) -> list[str]:
    """Effects of the fit that are not named as causes."""
    named = {cause.effect for cause in found.causes}
    return [name for name in found.found.best.names if name not in named]


def where_words(found: Diagnosis) -> str:
    """Where the gap lies end to end; where no mean stands out, the strongest sign instead."""
    if found.where is None:
        return ""
    if (
        any(abs(place.z) > STANDS_OUT for place in found.places)
        or found.remainder is None
        or not found.remainder.alarms
    ):
        return _signs(found.where.sentence)
    worst = alarm_words(found.remainder.alarms[0], files_of(found))
    return f"No mean over a phase is off by more than noise and tolerances allow. {worst}."


def arises_words(found: Diagnosis) -> str:
    """In which stage the gap arises when each is given its own measured inputs."""
    return "" if found.where is None else _signs(found.where.arises)


def says_more(found: Diagnosis) -> bool:
    """Whether the stages by themselves say anything beyond the stage that is told already."""
    if found.where is None:
        return False
    own = arises(found.stages)
    return found.verdict != "explained" or own.stage != found.where.stage or len(own.off) > 1


def _signs(text: str) -> str:
    return text.replace("cm2", "cm²").replace(" ohm", " Ω").replace(" -", " −")


def files_of(found: Diagnosis) -> list[str]:
    """Names of the logs, in their order."""
    return [log.run.name for log in found.data.logs]


def checked_words(found: Diagnosis) -> str:
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


def sure_words(found: Diagnosis) -> str:
    """How sure the causes are, and what no effect of the catalogue is and looks like one of them."""
    alike = [found.suspects[cause.effect] for cause in found.causes]
    text = "; ".join(f"{effect.unlisted} would look like {effect.name}" for effect in alike if effect.unlisted)
    return f"{_sure_words(found)} Not in the catalogue: {text}." if text else _sure_words(found)


def _sure_words(found: Diagnosis) -> str:
    if not found.causes:
        others = len(found.sets) - 1
        tried = f"{others} set{'s' if others > 1 else ''} of effects came near enough to be fitted" if others else ""
        none = "no effect at all" if found.verdict == "no_gap" else "none of the catalogue's effects"
        text = f"Probability of {none}: {probability_words(found.sets.get((), 0.0))}"
        return f"{text}; {tried}." if tried else f"{text}; no set of effects came near enough to be fitted."
    weak = [cause for cause in found.causes if cause.probability < SURE]
    rivalled = [cause for cause in found.causes if cause.rivals]
    if not weak and not rivalled:
        least = min(c.probability for c in found.causes)
        size = "above 0.99" if least > 0.995 else f"of {least:.2f} at least"
        return (
            f"{_each(len(found.causes))} a probability {size}, and no other effect of the catalogue explains the same data as "
            "well."
        )
    parts = [
        f"{c.effect} has a probability of {probability_words(c.probability)}".replace("of <", "below").replace(
            "of >", "above"
        )
        for c in weak
    ]
    parts += [_rival_words(cause) for cause in rivalled]
    text = "; ".join(parts)
    if len(weak) < len(found.causes):
        text += (
            "; all others are above 0.95" if weak else f"; {_each(len(found.causes)).lower()} a probability above 0.95"
        )
    return f"{text}."


def _rival_words(cause: Cause) -> str:
    """Which effects would do in place of a cause."""
    names = " and ".join(rival.effect for rival in cause.rivals)
    better = any(rival.probability > cause.probability for rival in cause.rivals)
    return f"{names} would explain the data {'at least' if better else 'about'} as well as {cause.effect}"


def _each(count: int) -> str:
    return "The cause has" if count == 1 else "Each cause has"


def closure_words(found: Diagnosis) -> str:
    """How much of the gap is closed, how that is known, and between which bounds it lies."""
    closure = found.closure
    if closure is None:
        return ""
    share = share_words(closure.share).replace(">", "More than")
    return f"{share} of the explainable gap is closed (95 %: {interval_words(found)}), {withheld_words(found)}."


def interval_words(found: Diagnosis) -> str:
    """Interval of the share that is closed."""
    if found.closure is None:
        return ""
    low, high = share_words(found.closure.low), share_words(found.closure.high)
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def withheld_words(found: Diagnosis) -> str:
    """Which logs took no part, and in what."""
    data = found.data
    if data.withheld:
        names = [load_words(data.logs[k].run.load) for k in sorted(data.withheld)]
        return f"judged on logs that took part in neither choice nor fit ({', '.join(names)})"
    if found.closure is None:
        return "all logs took part"
    return "judged on each log with a load by a fit without it; the causes were chosen on all logs"


def experiment_words(found: Diagnosis) -> str:
    """What to test next, and what it would bring."""
    plan = found.experiment
    if plan is None:
        return ""
    one, other = plan.separates
    run = f"{load_words(plan.load)}, {plan.profile}"
    apart = apart_words(plan.expected_z)
    told_apart = all(rival.effect != other for cause in found.causes for rival in cause.rivals)
    if plan.expected_z < FAR_ENOUGH and told_apart:
        return (
            f"No rival is left to be told apart: these logs rule out {other}, which comes next. A further run would add little "
            f"to them: at most {apart} standard deviations more ({run})."
        )
    if plan.expected_z < FAR_ENOUGH:
        return (
            f"None of the runs that were considered tells {one} from {other}: they would differ by {apart} standard "
            f"deviations at most ({run}). Measure one of the two directly."
        )
    if not told_apart:
        return f"{_upper(run)}. There {one} and {other} differ by {apart} standard deviations, so it tells which it is."
    return (
        f"No rival is left to be told apart. The sharpest further test of {one} is a run against the next suspect, "
        f"{other}: {run}. There the two differ by {apart} standard deviations."
    )


def alarm_words(alarm: Alarm, files: Sequence[str]) -> str:
    """A sign of something unexplained, without a full stop.

    Parameters
    ----------
    files : names of the logs, in their order
    """
    size, limit = f"{alarm.size:.1f}", f"{alarm.limit:g}"
    where = _upper(nuisance_words(alarm.where, files))
    if alarm.kind == "structure":
        return f"{where}: the root mean square of what is left is {size} times the noise (limit {limit})"
    if alarm.kind == "scatter":
        return f"{where}: the scatter is {size} times what noise explains (limit {limit})"
    if alarm.kind == "ripple":
        return (
            f"{where}: the means scatter about a smooth course {size} times as much as noise explains (limit {limit})"
        )
    return f"{where} had to move by {size} of its standard uncertainties (limit {limit})"


def alarm_meaning(alarm: Alarm) -> str:
    """What a sign of something unexplained may mean."""
    return {
        "structure": "the model's shape is wrong there",
        "scatter": "something faster than a block of 0.4 s moves, a ripple or a vibration",
        "ripple": "something comes and goes within seconds, as with every turn of a drum that is out of round",
    }.get(alarm.kind, "either its tolerance is wrong or it stands in for something else")


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def remainder_words(found: Diagnosis) -> str:
    """What the causes leave, in one sentence."""
    if found.remainder is None:
        return "Nothing is left beyond noise."
    left = found.remainder
    open_share = 1.0 if found.closure is None else max(1.0 - found.closure.share, 0.0)
    part = "Less than 1 %" if open_share < 0.01 else f"{number(100.0 * open_share, 0)} %"
    closed = "" if found.closure is None else f"{part} of the gap stays open"
    if not left.alarms:
        return f"{closed}; it has no structure that stands out of noise." if closed else "It has no structure."
    signs = "one sign" if len(left.alarms) == 1 else f"{len(left.alarms)} signs"
    begin = (
        f"{closed}, with {signs} of something unexplained" if closed else f"{_upper(signs)} of something unexplained"
    )
    which = "" if len(left.alarms) == 1 else " The strongest:"
    return f"{begin}.{which} {alarm_words(left.alarms[0], files_of(found))}; {alarm_meaning(left.alarms[0])}."
