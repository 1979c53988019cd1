"""Sentences and names of a diagnosis of a winch without a model: suspects, cycles, slope of the velocity."""

from __future__ import annotations

from collections.abc import Sequence

from winchcascade.diagnosis.line.line_data import CyclePart, beside
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report.digits import significant
from winchcascade.rig.effects.effect import Display

LINE_NUMBERS = {
    "drum_inertia": Display("inertia, as a mass on the line", 1.0, "kg", signed=False),
    "line_friction": Display("constant friction", 1.0, "N", signed=False),
    "line_drag": Display("drag over speed", 1.0, "N·s/m", signed=False),
    "force_gain": Display("gain of the force cell", 100.0, "%"),
    "force_zero": Display("zero of the force cell", 1.0, "N"),
}
"""Display of the number of each suspect without a model, in units of the line."""

LINE_MEANINGS = {
    "drum_inertia": "What turns with the line (drum, gear, machine, tether on the drum) takes power to speed up and gives it "
    "back.",
    "line_friction": "A constant friction between line and shaft, against the motion.",
    "line_drag": "A drag between line and shaft in proportion to the speed.",
    "force_gain": "The force cell reads too much or too little, by the same share everywhere.",
    "force_zero": "The force cell reads too much or too little, by the same force everywhere.",
}
"""What each suspect is on a winch of which only line and shaft are known."""


def cycles_of(found: LineDiagnosis) -> int:
    """Number of the cycles of all parts."""
    return sum(len(set(part.cycle.tolist())) for part in found.lines.parts)


def part_words(part: CyclePart) -> str:
    """The cycles of a part and its log."""
    first, last = int(part.cycle.min()), int(part.cycle.max())
    return f"{f'cycle {first}' if first == last else f'cycles {first} to {last}'} of {part.run.name}"


def flipped_words(found: LineDiagnosis) -> str:
    """Channels that were logged with the opposite sign, which ingest corrected."""
    flipped = {
        f"{run.name}: {finding.message}; {finding.action}": None
        for run in found.runs
        for finding in run.findings
        if finding.kind == "sign_flipped"
    }
    return "; ".join(flipped) + "." if flipped else ""


def small_words(found: LineDiagnosis) -> str:
    """What the suspects that are not named would close together."""
    rest = [name for name in found.lines.names if name not in found.chosen]
    if not found.causes or not rest:
        return ""
    more = 100.0 * (found.choice.error(found.chosen) - found.choice.error(found.choice.best))
    size = "less than 0.1 %" if more < 0.1 else f"{significant(more, 1)} %"
    return f"{', '.join(rest)}: {'it' if len(rest) == 1 else 'together they'} would close {size} more"


def slope_words(found: LineDiagnosis) -> str:
    """Over how many samples the acceleration was taken, and why."""
    lines = found.lines
    tried = " and ".join(f"{span:g} s" for span in lines.spans)
    why = f" (of {tried}, the one with which the fit best predicts held-out cycles)" if len(lines.spans) > 1 else ""
    return f"slope of a local quadratic over {samples_of(found)} samples, {lines.span:g} s{why}"


def samples_of(found: LineDiagnosis) -> int:
    """Samples over which the slope of the velocity is taken."""
    return 2 * beside(found.lines.parts[0].run, found.lines.span) + 1


def set_words(names: Sequence[str]) -> str:
    """A set of suspects."""
    return " + ".join(names) if names else "none: line tension times speed"
