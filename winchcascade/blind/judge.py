"""Judge a diagnosis by the truth of its campaign: whether it is honest, and whether it names
what was injected.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import Literal

import msgspec

from winchcascade.blind.truth import UNJUDGED, Truth, Verdict

Outcome = Literal[
    "named", "misnamed", "silent", "abstained", "quiet", "false_alarm", "recognised", "mistaken", "missing", "unjudged"
]  # fmt: skip

CERTAIN = 0.95
"""Posterior probability from which a cause without alternatives is named with certainty. [1]"""

MAX_RIVALS = 2
"""Maximum number of rivals of a cause that count as declared alternatives; look-alikes all do."""

MAX_NAMES = 2
"""Maximum number of causes with which an outsider counts as recognised; it never does if it is
explained.
"""


class Number(msgspec.Struct, frozen=True):
    """A number of a cause as it was diagnosed; `at_limit` marks a one-sided interval, whose open
    end may be missing.
    """

    value: float
    low: float | None = None
    high: float | None = None
    at_limit: str | None = None
    beyond_range: bool = False


class Alternative(msgspec.Struct, frozen=True):
    """An effect that may explain as much."""

    effect: str


class Cause(msgspec.Struct, frozen=True):
    """A cause that a diagnosis names, of a wrong load with its run; `look_alikes` is None where
    they are not written.
    """

    effect: str
    probability: float = 1.0
    run: str | None = None
    look_alikes: tuple[Alternative, ...] | None = None
    rivals: tuple[Alternative, ...] = ()
    parameters: dict[str, Number] = {}

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Declared alternatives: look-alikes and the most probable rivals."""
        others = (*(self.look_alikes or ()), *self.rivals[:MAX_RIVALS])
        return tuple(dict.fromkeys(other.effect for other in others))

    def is_certain(self, verdict: Verdict) -> bool:
        """Whether it is named with certainty; where look-alikes are not written, rivals are
        taken for them.
        """
        alike = self.rivals if self.look_alikes is None else self.look_alikes
        return verdict != "unexplained" and self.probability >= CERTAIN and not alike


class Claimed(msgspec.Struct, frozen=True):
    """Share of the gap that a diagnosis claims to have closed."""

    share_closed: float | None = None


class Diagnosis(msgspec.Struct, frozen=True):
    """The part of the JSON of a diagnosis that trials read."""

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    closure: Claimed | None = None

    @property
    def claims(self) -> bool:
        """Whether it explains the gap by its causes, at least in part."""
        return self.verdict in ("explained", "partly_explained") and bool(self.causes)


class ParameterScore(msgspec.Struct, frozen=True):
    """A true parameter beside the diagnosed one, see `Number`; no value where the diagnosis does
    not report it.
    """

    effect: str
    parameter: str
    truth: float
    value: float | None = None
    low: float | None = None
    high: float | None = None
    at_limit: str | None = None
    beyond_range: bool = False

    @property
    def two_sided(self) -> bool:
        """Whether both ends of the interval are free."""
        return self.at_limit is None and not self.beyond_range

    @property
    def covered(self) -> bool:
        """Whether the interval contains the truth; an end that is missing is open."""
        above = self.low is None or self.low <= self.truth
        return self.value is not None and above and (self.high is None or self.truth <= self.high)


NOTHING = "nothing injected"
"""Name of a case in which nothing is injected."""


class CaseScore(msgspec.Struct, frozen=True):
    """One case: what was injected, what the diagnosis reports, and the judgement of it.

    Parameters
    ----------
    hidden : strength of each injected effect [1]
    what, answer : what is injected, and the honest answer, in words
    honest : nothing is claimed with certainty that is not so, and the verdict is one that the truth
        allows; None where the truth is stated in words alone
    named : the truth is named; None where it is beyond the catalogue
    strict : the causes are the injected effects, without alternatives
    certain, false : effects that are named with certainty, and those of them that are not true
    rivals : declared alternatives of each cause
    """

    case: str
    kind: str
    hidden: dict[str, float]
    outsider: str | None = None
    what: str = ""
    answer: str = ""
    outcome: Outcome = "missing"
    honest: bool | None = None
    named: bool | None = None
    strict: bool = False
    verdict: Verdict | None = None
    causes: tuple[str, ...] = ()
    certain: tuple[str, ...] = ()
    false: tuple[str, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()
    parameters: tuple[ParameterScore, ...] = ()
    share_claimed: float | None = None

    @property
    def went_well(self) -> bool:
        """Whether the outcome is the best that this kind of case can have, and the answer is
        honest.
        """
        return (
            self.outcome in ("named", "quiet", "recognised", "unjudged")
            and self.honest is not False
        )

    @property
    def hidden_name(self) -> str:
        """Name of what is injected."""
        return (
            self.outsider
            or " + ".join(self.hidden)
            or (NOTHING if self.kind == "none" else self.what)
        )

    @property
    def taken_as(self) -> str:
        """What the diagnosis named: the injected effects where they were named, else what it
        reports instead.
        """
        if self.outcome == "named":
            return self.hidden_name
        if self.verdict == "no_gap":
            return "no gap"
        return (
            "unexplained"
            if self.verdict == "unexplained" or not self.causes
            else " + ".join(self.causes)
        )

    @property
    def text(self) -> str:
        """Verdict and causes in one line; `!` marks a cause that is certain."""
        pairs = zip(self.causes, self.rivals, strict=True)
        causes = [
            f"{cause}{'!' * (cause in self.certain)}"
            + (f" (or {', '.join(others)})" if others else "")
            for cause, others in pairs
        ]
        return ": ".join(
            filter(None, [(self.verdict or "not diagnosed").replace("_", " "), " + ".join(causes)])
        )


def judge(
    name: str, truth: Truth, found: Diagnosis | None, outsider: str | None = None
) -> CaseScore:
    """Judge the diagnosis of a case, None where there is none."""
    case = CaseScore(name, truth.kind, truth.effects, outsider, truth.what, truth.honest)
    if found is None:
        return case
    certain = tuple(cause.effect for cause in found.causes if cause.is_certain(found.verdict))
    case = msgspec.structs.replace(
        case,
        outcome="unjudged",
        verdict=found.verdict,
        causes=tuple(cause.effect for cause in found.causes),
        certain=certain,
        rivals=tuple(cause.alternatives for cause in found.causes),
        parameters=tuple(_parameters(truth, found)),
        share_claimed=None if found.closure is None else found.closure.share_closed,
    )
    if truth.kind == UNJUDGED:
        return case
    excused = found.verdict in truth.excused_by
    false = (
        () if excused else tuple(effect for effect in certain if effect not in truth.may_be_certain)
    )
    named = found.claims and _names(found.causes, truth) if truth.named else None
    return msgspec.structs.replace(
        case,
        outcome=_outcome(truth, found, named=named),
        honest=not false and (not truth.verdicts or found.verdict in truth.verdicts),
        named=named,
        strict=found.claims and sorted(case.causes) == sorted(truth.effects),
        false=false,
    )


def _parameters(truth: Truth, found: Diagnosis) -> Iterator[ParameterScore]:
    """True parameters of the injected effects that are named as causes, beside the diagnosed
    ones.
    """
    for cause in found.causes if found.claims else ():
        for name, value in truth.parameters.get(cause.effect, {}).items():
            number = (
                msgspec.structs.asdict(cause.parameters[name]) if name in cause.parameters else {}
            )
            yield ParameterScore(cause.effect, name, value, **number)


def _names(causes: Sequence[Cause], truth: Truth) -> bool:
    """Whether for each group of effects another cause has all of them among its name and
    alternatives.

    Causes that are true as well, and are not part of an answer, do not count.
    """
    wanted = {effect for group in truth.named for effect in group}
    counted = [
        cause
        for cause in causes
        if cause.effect not in truth.may_be_certain or wanted & {cause.effect, *cause.alternatives}
    ]
    if len(counted) < len(truth.named) or (truth.alone and len(counted) > len(truth.named)):
        return False
    return any(
        all(
            set(group) <= {cause.effect, *cause.alternatives} and truth.run in (None, cause.run)
            for group, cause in zip(truth.named, chosen, strict=True)
        )
        for chosen in permutations(counted, len(truth.named))
    )


def _outcome(truth: Truth, found: Diagnosis, *, named: bool | None) -> Outcome:
    """Outcome of a case.

    Nothing injected: quiet or a false alarm. Beyond the catalogue: recognised if the gap is
    unexplained, or partly explained by few causes; silent, or mistaken. Else named; silent if no
    gap was found, abstained if it is unexplained, else misnamed.
    """
    if truth.verdicts == ("no_gap",):
        return "quiet" if found.verdict == "no_gap" else "false_alarm"
    if found.verdict == "no_gap":
        return "silent"
    if named is None:
        few = found.verdict == "partly_explained" and len(found.causes) <= MAX_NAMES
        return "recognised" if found.verdict == "unexplained" or few else "mistaken"
    if not found.claims:
        return "abstained"
    return "named" if named else "misnamed"
