"""The score of a trial: each diagnosis beside the sealed answer, and counts, coverage and confusions over all cases."""

import math
from collections.abc import Sequence
from itertools import permutations
from pathlib import Path
from typing import Literal

import msgspec

from winchcascade.blind.cases import Answer, decoded, open_seal
from winchcascade.blind.recomputed_closure import RecomputedClosure, closure_of
from winchcascade.blind.trial import DIAGNOSES, PREDICTIONS
from winchcascade.core.errors import OptionError
from winchcascade.core.store import digest_in, inside
from winchcascade.core.version import __version__

Verdict = Literal["no_gap", "explained", "partly_explained", "unexplained"]
Outcome = Literal[
    "named", "misnamed", "silent", "abstained", "quiet", "false_alarm", "recognised", "mistaken", "missing"
]  # fmt: skip


class ParameterScore(msgspec.Struct, frozen=True):
    """A true parameter beside the diagnosed one; no value where the diagnosis does not report it."""

    effect: str
    parameter: str
    truth: float
    value: float | None = None
    low: float | None = None
    high: float | None = None

    @property
    def covered(self) -> bool:
        """Whether the interval contains the truth."""
        return self.low is not None and self.high is not None and self.low <= self.truth <= self.high


class CaseScore(msgspec.Struct, frozen=True):
    """One case: what was injected, what the diagnosis reports, and the outcome."""

    case: str
    kind: str
    hidden: dict[str, float]
    outsider: str | None
    outcome: Outcome
    strict: bool = False
    verdict: Verdict | None = None
    causes: tuple[str, ...] = ()
    rivals: tuple[tuple[str, ...], ...] = ()
    parameters: tuple[ParameterScore, ...] = ()
    share_claimed: float | None = None
    closure: RecomputedClosure = RecomputedClosure()

    @property
    def went_well(self) -> bool:
        """Whether the outcome is the best that this kind of case can have."""
        return self.outcome in ("named", "quiet", "recognised")


class Count(msgspec.Struct, frozen=True):
    """Number of cases of a number, with the 95 % interval of the share (Wilson 1927)."""

    part: int
    of: int

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval, 0 to 1 without any case.

        >>> [round(end, 3) for end in Count(9, 10).interval]
        [0.596, 0.982]
        """
        if self.of == 0:
            return 0.0, 1.0
        z, share, n = 1.959964, self.part / self.of, self.of
        middle = (share + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
        return max(0.0, middle - half), min(1.0, middle + half)


def _count(flags: Sequence[bool]) -> Count:
    return Count(sum(flags), len(flags))


class Score(msgspec.Struct, frozen=True):
    """A whole trial, scored."""

    sealed_sha256: str
    seed: int
    cases: tuple[CaseScore, ...]

    def of_kind(self, *kinds: str) -> tuple[CaseScore, ...]:
        """Diagnosed cases of some kinds."""
        return tuple(c for c in self.cases if c.kind in kinds and c.outcome != "missing")

    def count(self, outcome: str, *kinds: str) -> Count:
        """Diagnosed cases of some kinds with one outcome."""
        return _count([c.outcome == outcome for c in self.of_kind(*kinds)])

    @property
    def strict(self) -> Count:
        """Cases whose injected effects are named exactly, without alternatives."""
        return _count([c.strict for c in self.of_kind("single", "pair")])

    @property
    def coverage(self) -> Count:
        """True parameters within the interval of the cause that names them."""
        return _count([p.covered for c in self.cases for p in c.parameters])

    @property
    def missing(self) -> Count:
        """Cases without a diagnosis."""
        return _count([c.outcome == "missing" for c in self.cases])

    @property
    def strengths(self) -> dict[float, Count]:
        """Single effects that were named, by strength."""
        singles = self.of_kind("single")
        found = sorted({strength for c in singles for strength in c.hidden.values()})
        return {s: _count([c.outcome == "named" for c in singles if s in c.hidden.values()]) for s in found}

    @property
    def taken_for(self) -> dict[str, dict[str, int]]:
        """By what was injected, how often the diagnosis named what: one effect or several, no gap, or no cause."""
        found: dict[str, dict[str, int]] = {}
        for case in self.of_kind("single", "pair", "none", "outsider"):
            row = found.setdefault(hidden_name(case), {})
            row[taken_as(case)] = row.get(taken_as(case), 0) + 1
        return found


NO_GAP, UNEXPLAINED, NOTHING = "no gap", "unexplained", "nothing injected"
"""What a diagnosis may report, or a case contain, beside effects."""


def hidden_name(case: CaseScore) -> str:
    """Name of what is injected in a case."""
    return case.outsider or " + ".join(case.hidden) or NOTHING


def taken_as(case: CaseScore) -> str:
    """What the diagnosis named: the injected effects where they were named, else what it reports instead."""
    if case.outcome == "named":
        return hidden_name(case)
    if case.verdict == "no_gap":
        return NO_GAP
    if case.verdict == "unexplained" or not case.causes:
        return UNEXPLAINED
    return " + ".join(case.causes)


SCORE_SCHEMA = "winchcascade/score/1"


class Value(msgspec.Struct, frozen=True):
    """A parameter as it was diagnosed, with its 95 % interval."""

    value: float
    low: float
    high: float


class DiagnosedAlternative(msgspec.Struct, frozen=True):
    """An alternative explanation."""

    effect: str


MAX_ALTERNATIVES = 2
"""Maximum number of alternatives of a cause that count."""


class Cause(msgspec.Struct, frozen=True):
    """An effect that a diagnosis names."""

    effect: str
    parameters: dict[str, Value] = msgspec.field(default_factory=dict)
    rivals: tuple[DiagnosedAlternative, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The effect and the alternatives that count."""
        return (self.effect, *(alternative.effect for alternative in self.rivals[:MAX_ALTERNATIVES]))


class Claimed(msgspec.Struct, frozen=True):
    """Share of the gap that a diagnosis claims to have closed."""

    share_closed: float | None = None


class Diagnosis(msgspec.Struct, frozen=True):
    """The part of a diagnosis that a score reads."""

    verdict: Verdict
    causes: tuple[Cause, ...] = ()
    closure: Claimed | None = None


def score(folder: Path) -> Score:
    """Score a trial: open the seal, and compare every diagnosis with its answer.

    Raises
    ------
    OptionError : the folder is no trial, the answers were changed, nothing was diagnosed, or a diagnosis cannot be read
    """
    trial, sealed = open_seal(folder)
    cases = tuple(_score_case(folder, answer) for answer in sealed.answers)
    if all(case.outcome == "missing" for case in cases):
        raise OptionError(f"{folder}: no case is diagnosed; run blind diagnose {folder} first.")
    return Score(trial.sealed_sha256, sealed.seed, cases)


def read_diagnosis(path: Path) -> Diagnosis | None:
    """Read the diagnosis of a case, None where there is none.

    Raises
    ------
    OptionError : it cannot be read, or was altered after it was made
    """
    if not path.exists():
        return None
    content = path.read_bytes()
    found = decoded(path, content, Diagnosis, "is no diagnosis", "diagnose the case again")
    if digest_in(content) == "altered":
        raise OptionError(
            f"{path}: was altered after it was made: its content does not match the digest. Run blind diagnose again."
        )
    return found


def _score_case(folder: Path, answer: Answer) -> CaseScore:
    found = read_diagnosis(inside(folder, f"{DIAGNOSES}/{answer.case}.json"))
    if found is None:
        return CaseScore(answer.case, answer.kind, answer.effects, answer.outsider, "missing")
    closure = RecomputedClosure()
    if found.closure is not None:
        closure = closure_of(inside(folder, answer.case), inside(folder, f"{PREDICTIONS}/{answer.case}"))
    return CaseScore(
        case=answer.case,
        kind=answer.kind,
        hidden=answer.effects,
        outsider=answer.outsider,
        outcome=outcome_of(answer, found),
        strict=_claims(found) and sorted(c.effect for c in found.causes) == sorted(answer.effects),
        verdict=found.verdict,
        causes=tuple(c.effect for c in found.causes),
        rivals=tuple(c.names[1:] for c in found.causes),
        parameters=_parameters(answer, found),
        share_claimed=None if found.closure is None else found.closure.share_closed,
        closure=closure,
    )


def _claims(found: Diagnosis) -> bool:
    """Whether a diagnosis explains the gap by its causes, at least in part."""
    return found.verdict in ("explained", "partly_explained") and bool(found.causes)


MAX_NAMES = 2
"""Maximum number of causes with which an outsider counts as recognised; it never does if it is explained."""


def outcome_of(answer: Answer, found: Diagnosis) -> Outcome:
    """Outcome of a case.

    With effects injected: named if each is a cause or an alternative of one, each of another, and there is no further cause;
    silent if no gap was found, abstained if it is unexplained, else misnamed. With nothing injected: quiet or a false alarm.
    With an outsider: recognised if the gap is unexplained, or partly explained by few causes; silent, or mistaken.
    """
    if answer.kind == "none":
        return "quiet" if found.verdict == "no_gap" else "false_alarm"
    if found.verdict == "no_gap":
        return "silent"
    if answer.kind == "outsider":
        partly = found.verdict == "partly_explained" and len(found.causes) <= MAX_NAMES
        return "recognised" if found.verdict == "unexplained" or partly else "mistaken"
    if not _claims(found):
        return "abstained"
    return "named" if _matches(tuple(answer.effects), found.causes) else "misnamed"


def _matches(hidden: Sequence[str], causes: Sequence[Cause]) -> bool:
    return len(hidden) == len(causes) and any(
        all(effect in cause.names for effect, cause in zip(order, causes, strict=True))
        for order in permutations(hidden)
    )


def _parameters(answer: Answer, found: Diagnosis) -> tuple[ParameterScore, ...]:
    """True parameters of the injected effects that are named as causes, beside the diagnosed ones."""
    return tuple(
        ParameterScore(cause.effect, name, truth, *_ends(cause.parameters.get(name)))
        for cause in (found.causes if _claims(found) else ())
        for name, truth in answer.parameters.get(cause.effect, {}).items()
    )


def _ends(found: Value | None) -> tuple[float | None, float | None, float | None]:
    return (None, None, None) if found is None else (found.value, found.low, found.high)


def score_record(found: Score) -> dict[str, object]:
    """A score as nested records, schema `winchcascade/score/1`."""
    hidden = ("single", "pair")
    counts = {
        "named": found.count("named", *hidden),
        "named_singles": found.count("named", "single"),
        "named_pairs": found.count("named", "pair"),
        "strict": found.strict,
        "misnamed": found.count("misnamed", *hidden),
        "silent": found.count("silent", *hidden),
        "abstained": found.count("abstained", *hidden),
        "false_alarms": found.count("false_alarm", "none"),
        "outsiders_recognised": found.count("recognised", "outsider"),
        "outsiders_silent": found.count("silent", "outsider"),
        "outsiders_mistaken": found.count("mistaken", "outsider"),
        "covered": found.coverage,
        "missing": found.missing,
    }
    return {
        "schema": SCORE_SCHEMA,
        "version": __version__,
        "sealed_sha256": found.sealed_sha256,
        "seed": found.seed,
        "totals": {name: _count_record(count) for name, count in counts.items()},
        "strengths": [{"strength": s, **_count_record(count)} for s, count in found.strengths.items()],
        "taken_for": found.taken_for,
        "cases": [msgspec.to_builtins(case) for case in found.cases],
    }


def _count_record(count: Count) -> dict[str, object]:
    return {"part": count.part, "of": count.of, "interval_95": list(count.interval)}
