"""What the scored cases of a trial say together: counts, coverage, and what was taken for what."""

from __future__ import annotations

import math
from typing import Literal

import msgspec

from winchcascade.blind.closure import Closure

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
        """Whether the interval holds the truth."""
        return self.low is not None and self.high is not None and self.low <= self.truth <= self.high


class CaseScore(msgspec.Struct, frozen=True):
    """One case: what was hidden, what was said, and what came of it."""

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
    closure: Closure = Closure()

    @property
    def went_well(self) -> bool:
        """Whether the case was told as well as can be."""
        return self.outcome in ("named", "quiet", "recognised")


class Count(msgspec.Struct, frozen=True):
    """So many of so many, with the 95 % interval of the share (Wilson 1927)."""

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
        cases = self.of_kind(*kinds)
        return Count(sum(c.outcome == outcome for c in cases), len(cases))

    @property
    def strict(self) -> Count:
        """Hidden effects named exactly, no rival needed."""
        cases = self.of_kind("single", "pair")
        return Count(sum(c.strict for c in cases), len(cases))

    @property
    def coverage(self) -> Count:
        """True parameters within the interval of the cause that names them."""
        found = [p for c in self.cases for p in c.parameters]
        return Count(sum(p.covered for p in found), len(found))

    @property
    def missing(self) -> Count:
        """Cases without a diagnosis."""
        return Count(sum(c.outcome == "missing" for c in self.cases), len(self.cases))

    @property
    def strengths(self) -> dict[float, Count]:
        """Single effects that were named, by strength."""
        singles = self.of_kind("single")
        found = sorted({strength for c in singles for strength in c.hidden.values()})
        picked = {s: [c for c in singles if s in c.hidden.values()] for s in found}
        return {s: Count(sum(c.outcome == "named" for c in cases), len(cases)) for s, cases in picked.items()}

    @property
    def taken_for(self) -> dict[str, dict[str, int]]:
        """By what was hidden, how often it was taken for what: an effect or several, no gap, or nothing known."""
        found: dict[str, dict[str, int]] = {}
        for case in self.of_kind("single", "pair", "none", "outsider"):
            row = found.setdefault(hidden_name(case), {})
            row[taken_as(case)] = row.get(taken_as(case), 0) + 1
        return found


NO_GAP, UNEXPLAINED, NOTHING = "no gap", "unexplained", "nothing hidden"
"""What a case may be taken for, or hide, beside effects."""


def hidden_name(case: CaseScore) -> str:
    """What a case hides, in words."""
    return case.outsider or " + ".join(case.hidden) or NOTHING


def taken_as(case: CaseScore) -> str:
    """What a case was taken for: its hidden effects where they were named, else what was said instead."""
    if case.outcome == "named":
        return hidden_name(case)
    if case.verdict == "no_gap":
        return NO_GAP
    if case.verdict == "unexplained" or not case.causes:
        return UNEXPLAINED
    return " + ".join(case.causes)
