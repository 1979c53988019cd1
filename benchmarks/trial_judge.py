"""Judge a diagnosis by what an honest answer may be. Needs only the standard library.

python benchmarks/trial_judge.py CAMPAIGNS DIAGNOSES [FAMILY ...]

CAMPAIGNS/<family>/<case>/truth.json states the truth, DIAGNOSES/<family>_<case>.json is the diagnosis of this campaign.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from itertools import permutations
from pathlib import Path
from typing import Any, NamedTuple

Record = dict[str, Any]
"""Nested records of a JSON file."""

CERTAIN = 0.95
"""Posterior probability from which a cause without alternatives is named with certainty. [1]"""

MAX_RIVALS = 2
"""Maximum number of rivals of a cause that count as declared alternatives; look-alikes all do."""


class Judgement(NamedTuple):
    """Judgement of one case: effects that are named with certainty and wrongly, whether the answer is honest, and whether
    the truth is named; None where the truth is beyond the catalogue.
    """

    false: tuple[str, ...]
    honest: bool
    named: bool | None


def alternatives(cause: Record) -> tuple[str, ...]:
    """Declared alternatives of a cause: its look-alikes and its most probable rivals."""
    rivals, alike = cause.get("rivals") or [], cause.get("look_alikes") or []
    return tuple(dict.fromkeys(other["effect"] for other in (*alike, *rivals[:MAX_RIVALS])))


def is_certain(cause: Record, verdict: str) -> bool:
    """Whether a cause is named with certainty; where look-alikes are not written, rivals are taken for them."""
    alike = cause["look_alikes"] if cause.get("look_alikes") is not None else cause.get("rivals")
    return verdict != "unexplained" and float(cause.get("probability", 1.0)) >= CERTAIN and not alike


def names_groups(causes: Sequence[Record], groups: Sequence[Sequence[str]], *, alone: bool) -> bool:
    """Whether for each group of effects another cause has all of them among its name and alternatives."""
    if len(causes) < len(groups) or (alone and len(causes) > len(groups)):
        return False
    declared = [{cause["effect"], *alternatives(cause)} for cause in causes]
    return any(
        all(set(group) <= names for group, names in zip(groups, chosen, strict=True))
        for chosen in permutations(declared, len(groups))
    )


def judge(truth: Record, found: Record, other: Record | None = None) -> Judgement:
    """Judge a diagnosis.

    Parameters
    ----------
    truth : `may_be_certain` are effects whose certain naming is not false; `named` are groups of effects, each of which one
        cause must declare; `alone` allows no further cause but those of `may_be_certain`; `no_gap_is_false`; `excused_by` are
        verdicts that are honest whatever is named
    other : diagnosis whose causes must be the same, where the truth names one by `same_as`
    """
    verdict, causes = found["verdict"], found.get("causes") or []
    false = tuple(
        cause["effect"]
        for cause in causes
        if is_certain(cause, verdict) and cause["effect"] not in truth["may_be_certain"]
    )
    if verdict in truth.get("excused_by", ()):
        false = ()
    same = other is None or sorted(c["effect"] for c in other.get("causes") or []) == sorted(
        c["effect"] for c in causes
    )
    honest = not false and same and not (verdict == "no_gap" and truth.get("no_gap_is_false", False))
    groups = truth.get("named") or []
    if not groups:
        return Judgement(false, honest, None)
    wanted = {effect for group in groups for effect in group}
    beside = [c for c in causes if c["effect"] in truth["may_be_certain"] and c["effect"] not in wanted]
    counted = [c for c in causes if c not in beside or wanted & set(alternatives(c))]
    return Judgement(
        false, honest, verdict != "no_gap" and names_groups(counted, groups, alone=truth.get("alone", False))
    )


def answer_words(found: Record) -> str:
    """What a diagnosis reports, in one line."""
    causes = []
    for cause in found.get("causes") or []:
        others = alternatives(cause)
        sure = "!" if is_certain(cause, found["verdict"]) else ""
        causes.append(f"{cause['effect']}{sure}{' or ' + '/'.join(others) if others else ''}")
    return f"{found['verdict']}: {'; '.join(causes) or 'no cause'}"


def _read(path: Path) -> Record | None:
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else None


def family_lines(campaigns: Path, diagnoses: Path, family: str) -> Iterator[str]:
    """Counts of a family, by kind too where it has several, and a line for each miss; `!` marks a certain cause."""
    rows: list[tuple[str, Record, Record, Judgement]] = []
    for path in sorted(campaigns.glob(f"{family}/*/truth.json")):
        truth, found = _read(path), _read(diagnoses / f"{family}_{path.parent.name}.json")
        if truth is None or found is None or "may_be_certain" not in truth:
            continue
        other = _read(diagnoses / f"{family}_{truth['same_as']}.json") if "same_as" in truth else None
        rows.append((path.parent.name, truth, found, judge(truth, found, other)))
    kinds = sorted({truth["kind"] for _, truth, _, _ in rows})
    for kind in [None, *kinds] if len(kinds) > 1 else [None]:
        judged = [judgement for _, truth, _, judgement in rows if kind in (None, truth["kind"])]
        if not judged:
            continue
        named = [j.named for j in judged if j.named is not None]
        yield (
            f"{f'  {kind}' if kind else family:<34} {len(judged):>3} diagnosed  honest {sum(j.honest for j in judged):>3}"
            f"  certain and false {sum(bool(j.false) for j in judged):>3}  named {sum(named):>3} of {len(named)}"
        )
    for case, truth, found, judgement in rows:
        if not judgement.honest or judgement.named is False:
            miss = "FALSE" if judgement.false else "not honest" if not judgement.honest else "not named"
            yield f"    {case:<12} {miss:<10} {truth['what']:<44} -> {answer_words(found)}"


def main() -> None:
    """Print the judgement of every family that has diagnoses."""
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    campaigns, diagnoses = Path(sys.argv[1]), Path(sys.argv[2])
    for family in sys.argv[3:] or sorted({path.parts[-3] for path in campaigns.glob("*/*/truth.json")}):
        print("\n".join(family_lines(campaigns, diagnoses, family)))


if __name__ == "__main__":
    main()
