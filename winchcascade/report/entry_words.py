"""Sentences about wrong entries of the rig file and of the campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.quantity import Unit, find_unit

if TYPE_CHECKING:
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult, NamedCause
    from winchcascade.rig.effects.effect import WrongEntry

CHECK = "Check this entry before other causes."


def entry_sentence(cause: NamedCause, entry: WrongEntry) -> str:
    """What is stated and what the logs fit, in the unit of the rig file; loads in ohm.

    >>> from winchcascade.diagnosis.diagnosis_result import NamedCause, Reported
    >>> from winchcascade.rig.effects.effect import WrongEntry
    >>> radius = NamedCause("drum_radius", "entry", 0.99, {"r_drum": Reported(0.1378, 0.137, 0.138, "m")}, (), 1.0)
    >>> entry_sentence(radius, WrongEntry("winch.r_drum", stated=0.13, unit="m"))
    'The rig file states r_drum = 0.130 m; the logs fit 0.138 m. Check this entry before other causes.'
    """
    found = next(iter(cause.parameters.values()))
    if entry.log >= 0:
        return f"The campaign states {entry.stated:#.3g} ohm for {entry.source}; the log fits {found.value:#.3g} ohm. {CHECK}"
    if not entry.number:
        return (
            f"The logged line motion is {found.value:#.4g} times the motion that the other channels fit. Check the scale of "
            "the logged velocity and displacement before other causes."
        )
    ratio = found.value / entry.stated if entry.as_number else found.value
    scale = find_unit(entry.unit) or Unit("number", 1.0)
    stated, name = entry.stated / scale.factor, entry.number.rpartition(".")[2]
    unit = "" if entry.unit in ("", "1") else f" {entry.unit}"
    times = "" if entry.as_number else f", {ratio:#.3g} times as much"
    return f"The rig file states {name} = {stated:#.3g}{unit}; the logs fit {stated * ratio:#.3g}{unit}{times}. {CHECK}"


def check_words(found: DiagnosisResult, cause: NamedCause) -> str:
    """Sentence about a cause that is a wrong entry; empty for any other."""
    entry = found.suspects[cause.effect].entry
    return "" if entry is None else entry_sentence(cause, entry)
