"""A diagnosis in few lines, from its record; without what draws figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from winchcascade.report.content import Note, Report
from winchcascade.report.diagnosis_words import VERDICTS
from winchcascade.report.gap_words import share_words
from winchcascade.report.render.terminal import terminal_text


class _CauseName(msgspec.Struct, frozen=True):
    label: str
    effect: str


class _ShareClosed(msgspec.Struct, frozen=True):
    share_closed: float


class _Outcome(msgspec.Struct, frozen=True):
    """What the few lines on a diagnosis tell of its record."""

    verdict: str
    causes: tuple[_CauseName, ...]
    closure: _ShareClosed | None


def diagnosis_note(record: Mapping[str, object]) -> Note:
    """Verdict and causes of a diagnosis.

    Parameters
    ----------
    record : the diagnosis as JSON, schema `winchcascade/diagnosis/1`
    """
    found = msgspec.convert(record, _Outcome)
    names = ", ".join(f"{cause.label} ({cause.effect})" for cause in found.causes)
    closed = "" if found.closure is None else f"{share_words(found.closure.share_closed)} of the gap closed"
    text = "; ".join(part for part in (VERDICTS[found.verdict], names, closed) if part)
    return Note(text, "Diagnosis", "good" if found.verdict in ("no_gap", "explained") else "warn")


def diagnosis_lines(record: Mapping[str, object], files: Sequence[Path]) -> str:
    """Verdict, causes and files of a diagnosis in few lines; the record is that of `diagnosis_note`."""
    return terminal_text(Report("Diagnosis", "Diagnosis", points=[diagnosis_note(record)]), files)
