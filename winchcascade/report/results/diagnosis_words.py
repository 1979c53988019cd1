"""Sentences of a diagnosis, each stated once: verdict, place, certainty, what to do, the
residual.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from winchcascade.core.quantity import Quantity
from winchcascade.core.run import Finding, Run
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    DiagnosisResult,
    NamedCause,
    Spot,
)
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.fit.entries import effect_name
from winchcascade.diagnosis.fit.nuisances import calibrated_numbers
from winchcascade.diagnosis.fit.undetermined import GEAR
from winchcascade.diagnosis.judge.closure import by_cycles
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.diagnosis.verdict_limits import MIN_RUNS
from winchcascade.report.content import Note
from winchcascade.report.diagnosis_names import (
    about_words,
    display_of,
    files_of,
    has_own_simulation,
    number_words,
    phase_words,
    probability_words,
    runs_with_number,
    share_words,
)
from winchcascade.report.glossary import SENSORS, upper
from winchcascade.report.results.diagnosis_sentences import (
    FAR_ENOUGH,
    closure_kind,
    place_sentence,
    stated_text,
    trend_sentence,
)
from winchcascade.report.results.effects import call_all, called
from winchcascade.report.wording import load_words
from winchcascade.rig.parts import path_in_rig

VERDICTS = {
    "no_gap": "No gap",
    "explained": "Explained",
    "partly_explained": "Partly explained",
    "unexplained": "Unexplained",
}
"""Verdicts as headings."""

NONE_CLOSED = 0.005
"""A smaller share of a gap rounds to 0 % and is called none. [1]"""


# ------------------------------------------------------------------------------------ the verdict
def judged_words(found: DiagnosisResult) -> str:
    """On what the gap is closed: on held-out data, or by leaving parts out of the fit in turn."""
    if isinstance(found, StageDiagnosis):
        folds, held_out = len(set(found.fit.noise.fold.tolist())), "cycles"
        parts = [part for part in found.data.parts if part.withheld]
        held = [f"{part.cycles[0]} to {part.cycles[1]} of {part.run.name}" for part in parts]
        whole = len(found.data.cycle_names) >= folds
        each = "by leave-one-cycle-out" if whole else f"by leaving out one of {folds} stretches"
    else:
        assert isinstance(found, ModelDiagnosis)  # there are no others
        held = [load_words(found.data.logs[k].run.load, "ohm") for k in sorted(found.data.withheld)]
        cycles = found.closure is not None and by_cycles(found.data, found.closure.withheld)
        held_out, each = "logs", "by leaving out some cycles" if cycles else "by leave-one-load-out"
    return f"on held-out {held_out} ({', '.join(held)})" if held else each


def chosen_words(found: DiagnosisResult) -> str:
    """Whether the data on which the causes are judged took part in their choice."""
    return "data that are not held out" if closure_kind(found) == "held_out" else "all logs"


def interval_words(low: float, high: float) -> str:
    """Interval of a share.

    >>> interval_words(0.912, 0.961), interval_words(0.999, 1.0)
    ('91 to 96 %', '> 99 %')
    """
    ends = share_words(max(low, 0.0)), share_words(high)
    return ends[0] if ends[0] == ends[1] else f"{ends[0].removesuffix(' %')} to {ends[1]}"


def verdict_words(found: DiagnosisResult) -> str:
    """The verdict in one honest sentence: causes, the share of the gap that they close and on
    what, and the residual.
    """
    closure, count, line = found.closure, len(found.causes), isinstance(found, StageDiagnosis)
    gap = "gap between your simulation and the logs" if has_own_simulation(found) else "gap"
    if shared := _shared_words(found):
        return f"Your simulation differs from the logs by no more than noise: both have {shared}. No cause is named."
    if closure is None:
        if found.verdict != "no_gap":
            return (
                f"The {gap} is larger than noise and the uncertainties of the rig, but no effect "
                f"of the catalogue explains it: "
                "its cause lies outside the catalogue."
            )
        undecided = [one.effect for one in found.minor if math.isfinite(one.hint)]
        if undecided:
            return (
                f"No {gap} is significant against noise and the uncertainties of the rig, but "
                f"{call_all(undecided, found.suspects, ' or ')} is "
                "undecided: these logs neither show nor exclude it."
            )
        if found.minor:
            return "What these logs show beyond noise and uncertainties is too small to matter: no cause is named."
        return f"No {gap} is significant against noise and the uncertainties of the rig: no cause is named."
    share = share_words(max(closure.share, 0.0)).replace(">", "more than")
    listed = call_all([one.effect for one in found.candidates], found.suspects, " + ")
    if listed and not count and found.verdict == "partly_explained":
        return (
            f"No cause is named: a fit of {listed} closes {share} of the {gap} "
            f"{judged_words(found)}, but something else acts "
            f"too, which these may only imitate; {_residual_words(found)}."
        )
    if not count:
        best = call_all(found.chosen, found.suspects, " + ")
        share = f"only {share}" if closure.share > NONE_CLOSED else "none"
        tried = (
            f"the best of {len(found.sets) - 1} sets of effects"
            if len(found.sets) > 2
            else "the only set of effects"
        )
        return f"No cause is named: {tried} ({best}) closes {share} of the {gap} {judged_words(found)}."
    more = len(found.unnamed)
    named = "One cause closes" if count == 1 else f"{count} causes close"
    if more:
        named = f"A fit of {count + more} effects, of which the leading {count} are named, closes"
    if line:
        gap = "squared difference of the powers"
    interval = interval_words(closure.low, closure.high)
    return f"{named} {share} of the {gap} (95 %: {interval}) {judged_words(found)}; {_residual_words(found)}."


def _shared_words(found: DiagnosisResult) -> str:
    """Effects that logs and own simulation have alike, so that they cause no gap; empty without
    any.
    """
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    return "" if own is None else call_all(own.shared, found.suspects, " and ")


def _residual_words(found: DiagnosisResult) -> str:
    """What the causes leave, as the end of the verdict."""
    if found.verdict == "explained":
        return "the residual is not significant"
    alarms = () if found.remainder is None else found.remainder.alarms
    phases = dict.fromkeys(
        alarm.about.phase
        for alarm in alarms
        if alarm.kind == "energy" and isinstance(alarm.about, Spot)
    )
    if phases:
        return f"the energies of {' and '.join(phase_words(phase or '') for phase in phases)} are not explained"
    return "but the residual exceeds noise: something else acts too"


# -------------------------------------------------------------------------------------- the place
def where_words(found: DiagnosisResult) -> str:
    """The stages of the causes, those that cost most first; without causes the place, or the
    strongest sign, of the gap.
    """
    if found.causes:
        names = {"entry": "entry of rig file or campaign"}
        stages = [
            names.get(stage, stage)
            for stage in dict.fromkeys(cause.stage for cause in found.causes)
        ]
        others = f", then {', '.join(stages[1:])}" if len(stages) > 1 else ""
        return f"{upper(stages[0])}{others}."
    if found.where is None:
        return ""
    alarms = found.remainder.alarms if found.remainder is not None else ()
    if (
        isinstance(found, StageDiagnosis)
        or not alarms
        or any(abs(place.z) > STANDS_OUT for place in found.places)
    ):
        return place_sentence(found)
    where = about_words(alarms[0].about, files_of(found))
    return f"No mean over a phase deviates beyond noise and uncertainties; what shows is {alarms[0].kind}, {where}."


# ------------------------------------------------------------------------------------- what to do
class Action(NamedTuple):
    """What to do about a cause, and a number that is stated for it."""

    what: str
    stated: str = ""

    def __str__(self) -> str:
        """Both as one text."""
        return f"{self.what} ({self.stated})" if self.stated else self.what


def action_of(found: DiagnosisResult, cause: NamedCause) -> Action:
    """What to do about a cause: check an entry, separate it from its look-alikes, recalibrate a
    sensor, confirm it by what would show another cause beyond the catalogue, or correct it.
    """
    effect = found.suspects[cause.effect]
    path = effect.path
    section, _, number = path_in_rig(path).partition(".")
    if effect.entry is not None:
        entry = effect.entry
        scale = (
            f"check the load of {entry.source}"
            if entry.log >= 0
            else "check the scale of the logged motion"
        )
        name = effect.number.rpartition(".")[2]
        return Action(f"check the entry {name}" if name else scale, stated_text(effect))
    if cause.look_alikes:
        plan = found.experiment
        planned = (
            plan is not None and cause.effect in plan.separates and plan.expected_z >= FAR_ENOUGH
        )
        if (
            planned
            and plan is not None
            and {one.effect for one in cause.look_alikes} & set(plan.separates)
        ):
            return Action("make the next run")
        stated = isinstance(getattr(getattr(found.rig, section, None), number, None), Quantity)
        return Action(f"measure {number} directly" if stated else "measure it directly")
    if found.verdict != "explained":
        return Action("find first what else acts")
    if cause.stage == "sensor":
        known = SENSORS.get(path.rpartition(".")[2])
        return Action(f"recalibrate {known}" if known else f"check the {effect.display.what}")
    if isinstance(found, StageDiagnosis):
        return Action(
            "enter it under [laws]"
            if cause.stage != "transmission"
            else "correct the line power for it"
        )
    own = found.judgement.classes.get(cause.effect)
    if own is not None and own.broken_by:
        return Action(f"confirm it by {own.broken_by.partition(';')[0]}", "`--write` enters it")
    return Action("correct it in the rig file", "`--write` enters it")


# ----------------------------------------------------------------------- what else a reader needs
def certainty_words(found: DiagnosisResult) -> str:
    """Which causes have look-alikes, in the catalogue and beyond it; without causes how probable
    it is that none acts.
    """
    if found.causes:
        rivals = {
            cause.effect: [rival.effect for rival in cause.look_alikes] for cause in found.causes
        }
        pairs = [
            f"{called(cause, found.suspects)} from {call_all(names, found.suspects, ' or ')}"
            for cause, names in rivals.items()
            if names
        ]
        apart = [f"these logs do not distinguish {', nor '.join(pairs)}"] if pairs else []
        apart += _implausible_words(found)
        for cause, own in found.judgement.classes.items():
            apart += (
                [f"{' or '.join(own.beyond)} would look like {called(cause, found.suspects)}"]
                if own.beyond
                else []
            )
        return upper(f"{'; '.join(apart)}.") if apart else ""
    if found.verdict == "unexplained" or _shared_words(found):
        return ""
    likely = probability_words(found.sets.get((), 0.0))
    best = max(
        (names for names in found.sets if names), key=lambda names: found.sets[names], default=()
    )
    other = (
        f"; of {call_all(best, found.suspects, ' + ')}, the most probable set, {probability_words(found.sets[best])}"
        if best
        else ""
    )
    return f"Probability that no effect of the catalogue acts: {likely}{other}."


def _implausible_words(found: DiagnosisResult) -> list[str]:
    """Look-alikes whose number would lie beyond what is plausible, with this number."""
    said = {}
    for rival in (rival for cause in found.causes for rival in cause.look_alikes):
        if rival.number is not None and rival.number.beyond_range:
            how = display_of(rival.effect, found.suspects[rival.effect].parameter)
            value, _ = number_words(how, rival.number)
            name = called(rival.effect, found.suspects)
            said[rival.effect] = f"{name} would have to be {value}, beyond what is plausible"
    return list(said.values())


def distinguished_words(found: DiagnosisResult) -> str:
    """What distinguishes each cause from its look-alikes, in the catalogue and beyond it."""
    return " ".join(
        f"{called(name, found.suspects)}: {own.broken_by}."
        for name, own in found.judgement.classes.items()
    )


def not_needed_words(found: DiagnosisResult) -> str:
    """Labels of the effects that are not needed beside the causes; an entry of several runs is
    listed once.
    """
    chosen = {effect_name(name) for name in found.chosen}
    others = dict.fromkeys(
        effect.label for name, effect in found.suspects.items() if effect_name(name) not in chosen
    )
    return f"Not needed: {', '.join(others)}." if found.causes else ""


def undetermined_words(found: ModelDiagnosis) -> str:
    """What the logs know of the numbers of the rig only together."""
    sentences = []
    for one in found.undetermined:
        leading, others = (
            " and ".join(
                path_in_rig(path).split(".")[1]
                for path in one.powers
                if (path in one.leading) == leads
            )
            for leads in (True, False)
        )
        known = f"{'the product of ' if one.product else ''}{leading}"
        beside = f", beside {others}," if others else ""
        reason = " because the speed of the rotor is not logged" if GEAR in one.powers else ""
        sentences.append(f"These logs determine {known}{beside} only together{reason}.")
    return " ".join(sentences)


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


def not_visible_words(found: ModelDiagnosis) -> str:
    """Effects that logs without some channels cannot show at any plausible size; nothing where
    no channel is missing.
    """
    names = dict.fromkeys(effect_name(name) for name in found.not_visible)
    if not found.missing_channels or not names:
        return ""
    return f"Without {', '.join(found.missing_channels)} these logs cannot show {call_all(names)}."


def finding_words(found: DiagnosisResult) -> list[str]:
    """A sentence on each kind of finding of each channel, with its first file; columns that were
    not read are left out.

    >>> from types import SimpleNamespace as Of
    >>> log = Of(name="a.csv", findings=[Finding("stuck", "idc holds one value", "", "idc")])
    >>> finding_words(Of(runs=[log, Of(name="b.csv", findings=[])]))
    ['1 of 2 logs, stuck: idc holds one value (a.csv).']
    """
    sentences = []
    for all_runs, word in ((found.runs, "log"), (simulations_of(found), "simulation")):
        runs = {run.name: run for run in all_runs}
        alike: dict[tuple[str, str | None], dict[str, Finding]] = {}
        for run in runs.values():
            for finding in run.findings:
                if finding.kind != "unknown_column":
                    alike.setdefault((finding.kind, finding.channel), {}).setdefault(
                        run.name, finding
                    )
        for (kind, _), files in alike.items():
            file, first = next(iter(files.items()))
            count = f"{len(files)} of {len(runs)} {word}{'s' * (len(runs) > 1)}"
            action = f"; {first.action}" if first.action else ""
            sentences.append(f"{count}, {kind}: {first.message} ({file}){action}.")
    return sentences


def simulations_of(found: DiagnosisResult) -> tuple[Run, ...]:
    """The own simulations that logs were compared with; none without them."""
    own = found.own_simulation if isinstance(found, ModelDiagnosis) else None
    return () if own is None else own.runs


# ------------------------------------------------------------------------------------- run by run
def stability_words(found: DiagnosisResult) -> str:
    """Whether the runs agree on the number of each cause; nothing where too few give one, or
    where they differ.
    """
    item = "cycle" if isinstance(found, StageDiagnosis) else "run"
    steady = [
        called(cause.effect, found.suspects)
        for cause in found.causes
        if len(runs_with_number(cause)) >= MIN_RUNS
        and not (cause.stability and cause.stability.trends)
    ]
    which = "every cause" if len(steady) == len(found.causes) else ", ".join(steady)
    return (
        f"In every {item} the number of {which} is the same within its intervals." if steady else ""
    )


def trend_sentences(found: DiagnosisResult) -> list[str]:
    """What differs between the runs beyond its intervals, of every cause; none where the runs
    agree.
    """
    each = [
        (cause, () if cause.stability is None else cause.stability.trends) for cause in found.causes
    ]
    return [trend_sentence(found, cause, trend) for cause, trends in each for trend in trends]


# ----------------------------------------------------------------------------------- the residual
SIGNS = {
    "structure": "root mean square of block means over their noise: the shape of the model is "
    "wrong there",
    "scatter": "scatter within blocks over what noise explains: something moves faster than a "
    "block",
    "ripple": "scatter of block means about a smooth course over what noise explains: something "
    "comes and goes within seconds",
    "nuisance": "how far the fit moved it, in standard uncertainties: its entry is wrong, or it "
    "takes the place of an effect",
    "drift": "how improbable it is by chance that the number differs so much between runs, as a "
    "power of ten",
    "range": "the number lies at an end of its range or beyond what is plausible",
    "improbable": "posterior probability that another cause acts in its place",
    "cancelling": "the smaller of the two over what both do together: the data need neither of "
    "them",
    "worse": "misfit that the causes add to held-out predictions, over the noise",
    "energy": "energy that the fit leaves, in standard uncertainties",
    "residual": "efficiency that the causes leave",
}
"""What the size of each kind of alarm is, and what it may mean."""


def kind_words(alarms: Sequence[Alarm]) -> dict[str, str]:
    """What the sizes of some alarms are and what they may mean, by their kinds."""
    shares = {
        alarm.kind for alarm in alarms if isinstance(alarm.about, Spot) and alarm.about.run is None
    } & {"energy"}
    own = dict.fromkeys(shares, "deviation of the predicted energy from the logged one, as a share")
    return {alarm.kind: f"{(SIGNS | own)[alarm.kind]}." for alarm in alarms}


# ----------------------------------------------------------------------------------- in few lines
def diagnosis_note(record: Mapping[str, Any]) -> Note:
    """Verdict and causes of a diagnosis, from its JSON."""
    names = ", ".join(f"{cause['label']} ({cause['effect']})" for cause in record["causes"])
    closure, verdict = record["closure"], record["verdict"]
    closed = "" if closure is None else f"{share_words(closure['share_closed'])} of the gap closed"
    text = "; ".join(part for part in (VERDICTS[verdict], names, closed) if part)
    return Note(text, "Diagnosis", "good" if verdict in ("no_gap", "explained") else "warn")
