"""The score of a trial: each diagnosis beside the truth, and counts, coverage and confusions
over all cases.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec
from scipy.stats import binomtest

from winchcascade.blind.judge import CaseScore, Diagnosis, judge
from winchcascade.blind.trial import DIAGNOSES, TRIAL, case_names, open_seal
from winchcascade.blind.truth import TRUTH_FILE, decoded, read_truth
from winchcascade.core.errors import OptionError
from winchcascade.core.store import digest_in, inside
from winchcascade.core.version import __version__

SCORE_SCHEMA = "winchcascade/score/1"

HIDDEN = ("single", "pair", "several")
"""Kinds of cases that hide effects of the catalogue."""


class Count(msgspec.Struct, frozen=True, omit_defaults=True):
    """Number of cases of a number, with the 95 % interval of the share (Wilson 1927), and of
    cases of one strength that.
    """

    part: int
    of: int
    interval_95: tuple[float, float]
    strength: float | None = None


def count(flags: Sequence[bool], strength: float | None = None) -> Count:
    """Count what is so; without any case the share may be 0 to 1.

    >>> [round(end, 3) for end in count([True] * 9 + [False]).interval_95]
    [0.596, 0.982]
    """
    if not flags:
        return Count(0, 0, (0.0, 1.0), strength)
    ends = binomtest(sum(flags), len(flags)).proportion_ci(method="wilson")
    return Count(sum(flags), len(flags), (float(ends.low), float(ends.high)), strength)


OUTCOMES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "named": ("effects named (cause or declared alternative, nothing beyond)", "named", HIDDEN),
    "named_singles": ("- single effects", "named", ("single",)),
    "named_pairs": ("- pairs", "named", ("pair",)),
    "misnamed": ("misnamed", "misnamed", HIDDEN),
    "silent": ("silent: no gap seen", "silent", HIDDEN),
    "abstained": ("abstained: gap unexplained", "abstained", HIDDEN),
    "false_alarms": ("false alarms with nothing injected", "false_alarm", ("none",)),
    "outsiders_recognised": ("unmodelled causes recognised", "recognised", ("outsider",)),
    "outsiders_silent": ("unmodelled causes not found", "silent", ("outsider",)),
    "outsiders_mistaken": ("unmodelled causes taken for effects", "mistaken", ("outsider",)),
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
    """A whole trial, scored, as its JSON; without a seal, its answers are those of a truth.json for
    each case.

    Parameters
    ----------
    totals : counts by the names of `OUTCOMES` and `FURTHER`
    strengths : single effects that were named, by strength
    taken_for : by what was injected, how often the diagnosis named what: one effect or several, no
        gap, or no cause
    """

    cases: tuple[CaseScore, ...]
    totals: dict[str, Count]
    strengths: tuple[Count, ...]
    taken_for: dict[str, dict[str, int]]
    sealed_sha256: str | None = None
    seed: int | None = None
    version: str = __version__
    schema: str = SCORE_SCHEMA

    @property
    def diagnosed(self) -> tuple[CaseScore, ...]:
        """Cases with a diagnosis."""
        return tuple(case for case in self.cases if case.outcome != "missing")


def score_of(
    cases: tuple[CaseScore, ...], sealed_sha256: str | None = None, seed: int | None = None
) -> Score:
    """Count judged cases; those without a diagnosis count as missing alone."""
    diagnosed = [case for case in cases if case.outcome != "missing"]
    judged = [case for case in diagnosed if case.honest is not None]
    totals = {
        name: count([case.outcome == outcome for case in diagnosed if case.kind in kinds])
        for name, (_, outcome, kinds) in OUTCOMES.items()
    } | {
        "strict": count([case.strict for case in diagnosed if case.kind in HIDDEN]),
        "honest": count([bool(case.honest) for case in judged]),
        "certain_and_false": count([bool(case.false) for case in judged]),
        "covered": count([p.covered for case in cases for p in case.parameters]),
        "missing": count([case.outcome == "missing" for case in cases]),
    }
    named: dict[float, list[bool]] = {}
    taken: dict[str, Counter[str]] = {}
    for case in diagnosed:
        taken.setdefault(case.hidden_name, Counter())[case.taken_as] += 1
        for strength in case.hidden.values() if case.kind == "single" else ():
            named.setdefault(strength, []).append(case.outcome == "named")
    strengths = tuple(count(flags, strength) for strength, flags in sorted(named.items()))
    return Score(
        cases,
        totals,
        strengths,
        {name: dict(row) for name, row in taken.items()},
        sealed_sha256,
        seed,
    )


def score(folder: Path, diagnoses: Path | None = None) -> Score:
    """Score a trial: open the seal, or read the truth.json of each case, and judge every diagnosis.

    Parameters
    ----------
    diagnoses : folder of the diagnoses, by default the one in that of the trial

    Raises
    ------
    OptionError : the folder is no trial, the answers were changed, nothing was diagnosed, or a
        diagnosis cannot be read
    """
    about: tuple[str | None, int | None] = (None, None)
    if (folder / TRIAL).exists():
        trial, sealed = open_seal(folder)
        truths = {answer.case: (answer.truth, answer.outsider) for answer in sealed.answers}
        about = (trial.sealed_sha256, sealed.seed)
    else:
        truths = {
            name: (read_truth(folder / name / TRUTH_FILE), None) for name in case_names(folder)
        }
    place = inside(folder, DIAGNOSES) if diagnoses is None else diagnoses
    cases = tuple(
        judge(name, truth, read_diagnosis(inside(place, f"{name}.json")), outsider)
        for name, (truth, outsider) in truths.items()
    )
    if all(case.outcome == "missing" for case in cases):
        raise OptionError(f"{folder}: no case is diagnosed; run blind diagnose {folder} first.")
    return score_of(cases, *about)


def read_diagnosis(path: Path) -> Diagnosis | None:
    """Read the diagnosis of a case, None where there is none; OptionError if it cannot be read,
    or was altered since.
    """
    if not path.exists():
        return None
    found = decoded(path, Diagnosis, "a diagnosis; diagnose the case again")
    if digest_in(path.read_bytes()) == "altered":
        raise OptionError(
            f"{path}: was altered after it was made: its content does not match the digest. Run "
            f"blind diagnose again."
        )
    return found
