"""What a result states that uses the corrected rig of a diagnosis: what the diagnosis knows of it,
and numbers with their bands.
"""

from __future__ import annotations

import math
from typing import Any

import msgspec

from winchcascade.diagnosis.diagnosis_result import Judgement
from winchcascade.diagnosis.handover.posterior import Band
from winchcascade.diagnosis.judge.causes import COVERED
from winchcascade.report.content import Cell, Measured, Note, Span
from winchcascade.report.results.effects import call_all


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


# ------------------------------------------------------------------------- numbers with their bands
def finite(x: float) -> float | None:
    """A number as JSON has it: null where it is not finite."""
    return x if math.isfinite(x) else None


def band_record(band: Band) -> dict[str, float | None]:
    """A number and its 95 % interval as JSON has them."""
    return {name: finite(getattr(band, name)) for name in ("value", "low", "high")}


def band_cell(band: Band) -> Cell:
    """A number with its standard uncertainty, as far as its band is known."""
    if math.isnan(band.low):
        return band.value
    return Measured(band.value, 0.5 * (band.high - band.low) / COVERED, both=True)


def band_span(band: Band, factor: float = 1.0) -> Span | None:
    """The 95 % interval of a number times a factor; None where it is not known."""
    if math.isnan(band.low):
        return None
    u = 0.5 * factor * (band.high - band.low) / COVERED
    return Span(factor * band.low, factor * band.high, u)
