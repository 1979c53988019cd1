"""The score of a trial: each diagnosis beside the truth, and counts, coverage and confusions over all cases."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec

from winchcascade.blind.judge import CaseScore, Diagnosis, judge
from winchcascade.blind.trial import DIAGNOSES, TRIAL, case_names, decoded, open_seal
from winchcascade.blind.truth import TRUTH_FILE, read_truth
from winchcascade.core.errors import OptionError
from winchcascade.core.store import digest_in, inside
from winchcascade.core.version import __version__

SCORE_SCHEMA = "winchcascade/score/1"

HIDDEN = ("single", "pair", "several")
"""Kinds of cases that hide effects of the catalogue."""


def taken_as(case: CaseScore) -> str:
    """What the diagnosis named: the injected effects where they were named, else what it reports instead."""
    if case.outcome == "named":
        return case.hidden_name
    if case.verdict == "no_gap":
        return "no gap"
    return "unexplained" if case.verdict == "unexplained" or not case.causes else " + ".join(case.causes)


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


def count(flags: Sequence[bool]) -> Count:
    """Count what is so."""
    return Count(sum(flags), len(flags))


OUTCOMES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "named": ("effects named (cause or declared alternative, nothing beyond)", "named", HIDDEN),
    "named_singles": ("- single effects", "named", ("single",)),
    "named_pairs": ("- pairs", "named", ("pair",)),
    "misnamed": ("misnamed", "misnamed", HIDDEN),
    "silent": ("silent: no gap seen", "silent", HIDDEN),
    "abstained": ("abstained: gap unexplained", "abstained", HIDDEN),
    "false_alarms": ("false alarms with nothing injected", "false_alarm", ("none",)),
    "outsiders_recognised": ("outsiders recognised", "recognised", ("outsider",)),
    "outsiders_silent": ("outsiders not seen", "silent", ("outsider",)),
    "outsiders_mistaken": ("outsiders taken for effects", "mistaken", ("outsider",)),
}
"""What is counted, by its name in JSON: words, outcome and kinds of cases."""

FURTHER = {
    "strict": "named exactly, without an alternative",
    "honest": "honest: nothing false with certainty, and a verdict that the truth allows",
    "certain_and_false": "with a cause that is certain and false",
    "covered": "true parameters within their 95 % intervals",
    "missing": "without a diagnosis",
}
"""Further counts by their names in JSON, in words."""


class Score(msgspec.Struct, frozen=True):
    """A whole trial, scored; without a seal, its answers are those of a truth.json for each case."""

    cases: tuple[CaseScore, ...]
    sealed_sha256: str | None = None
    seed: int | None = None

    @property
    def diagnosed(self) -> tuple[CaseScore, ...]:
        """Cases with a diagnosis."""
        return tuple(case for case in self.cases if case.outcome != "missing")

    @property
    def totals(self) -> dict[str, Count]:
        """Counts by their names in JSON."""
        judged = [case for case in self.diagnosed if case.honest is not None]
        found = {
            name: count([case.outcome == outcome for case in self.diagnosed if case.kind in kinds])
            for name, (_, outcome, kinds) in OUTCOMES.items()
        }
        return found | {
            "strict": count([case.strict for case in self.diagnosed if case.kind in HIDDEN]),
            "honest": count([bool(case.honest) for case in judged]),
            "certain_and_false": count([bool(case.false) for case in judged]),
            "covered": count([p.covered for case in self.cases for p in case.parameters]),
            "missing": count([case.outcome == "missing" for case in self.cases]),
        }

    @property
    def strengths(self) -> dict[float, Count]:
        """Single effects that were named, by strength."""
        named: dict[float, list[bool]] = {}
        for case in self.diagnosed:
            for strength in case.hidden.values() if case.kind == "single" else ():
                named.setdefault(strength, []).append(case.outcome == "named")
        return {strength: count(named[strength]) for strength in sorted(named)}

    @property
    def taken_for(self) -> dict[str, dict[str, int]]:
        """By what was injected, how often the diagnosis named what: one effect or several, no gap, or no cause."""
        found: dict[str, Counter[str]] = {}
        for case in self.diagnosed:
            found.setdefault(case.hidden_name, Counter())[taken_as(case)] += 1
        return {name: dict(row) for name, row in found.items()}


def score(folder: Path, diagnoses: Path | None = None) -> Score:
    """Score a trial: open the seal, or read the truth.json of each case, and judge every diagnosis.

    Parameters
    ----------
    diagnoses : folder of the diagnoses, by default the one in that of the trial

    Raises
    ------
    OptionError : the folder is no trial, the answers were changed, nothing was diagnosed, or a diagnosis cannot be read
    """
    about: tuple[str | None, int | None] = (None, None)
    if (folder / TRIAL).exists():
        trial, sealed = open_seal(folder)
        truths = {answer.case: (answer.truth, answer.outsider) for answer in sealed.answers}
        about = (trial.sealed_sha256, sealed.seed)
    else:
        truths = {name: (read_truth(folder / name / TRUTH_FILE), None) for name in case_names(folder)}
    place = inside(folder, DIAGNOSES) if diagnoses is None else diagnoses
    cases = tuple(
        judge(name, truth, read_diagnosis(inside(place, f"{name}.json")), outsider)
        for name, (truth, outsider) in truths.items()
    )
    if all(case.outcome == "missing" for case in cases):
        raise OptionError(f"{folder}: no case is diagnosed; run blind diagnose {folder} first.")
    return Score(cases, *about)


def read_diagnosis(path: Path) -> Diagnosis | None:
    """Read the diagnosis of a case, None where there is none; OptionError if it cannot be read, or was altered since."""
    if not path.exists():
        return None
    found = decoded(path, Diagnosis, "a diagnosis; diagnose the case again")
    if digest_in(path.read_bytes()) == "altered":
        raise OptionError(
            f"{path}: was altered after it was made: its content does not match the digest. Run blind diagnose again."
        )
    return found


def score_record(found: Score) -> dict[str, object]:
    """A score as nested records, schema `winchcascade/score/1`."""

    def record(counted: Count) -> dict[str, object]:
        return {"part": counted.part, "of": counted.of, "interval_95": list(counted.interval)}

    return {
        "schema": SCORE_SCHEMA,
        "version": __version__,
        "sealed_sha256": found.sealed_sha256,
        "seed": found.seed,
        "totals": {name: record(counted) for name, counted in found.totals.items()},
        "strengths": [{"strength": s, **record(counted)} for s, counted in found.strengths.items()],
        "taken_for": found.taken_for,
        "cases": [msgspec.to_builtins(case) for case in found.cases],
    }
