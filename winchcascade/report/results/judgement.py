"""What a diagnosis knows of its rig, as every result states it that uses the corrected numbers:
record, sentence, warning.
"""

from __future__ import annotations

from typing import Any

import msgspec

from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.report.content import Note
from winchcascade.report.diagnosis_names import call_all


def judgement_record(judgement: Judgement) -> dict[str, Any]:
    """Verdict, causes, candidates, and the class of look-alikes of each of these that has one."""
    return {
        "verdict": judgement.verdict,
        "causes": list(judgement.causes),
        "candidates": list(judgement.candidates),
        "classes": {name: msgspec.structs.asdict(own) for name, own in judgement.classes.items()},
    }


def judgement_note(judgement: Judgement) -> Note:
    """The verdict with causes and candidates."""
    names = {"causes": judgement.causes, "candidates": judgement.candidates}
    listed = "; ".join(f"{kind}: {call_all(several)}" for kind, several in names.items() if several)
    known = judgement.verdict in ("explained", "no_gap")
    sentence = f"{_words(judgement)}{listed and f'; {listed}'}."
    return Note(sentence, "Diagnosis", "plain" if known else "warn", brief=not known)


def judgement_banner(judgement: Judgement) -> str:
    """Warning for every page of what uses the rig of an unexplained gap; empty otherwise."""
    return f"{_words(judgement)}." if judgement.verdict == "unexplained" else ""


def _words(judgement: Judgement) -> str:
    """The verdict as the beginning of a sentence.

    >>> _words(Judgement("partly_explained"))
    'The gap of the diagnosis is partly explained'
    """
    if judgement.verdict == "no_gap":
        return "The diagnosis finds no gap"
    return f"The gap of the diagnosis is {judgement.verdict.replace('_', ' ')}"
