"""What became of an injected fault, as one letter, and the table of all faults."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from fault_logs import Finding, Result, result, truth
from injected import FAULTS, Trial, trial

BAR = 0.003
"""Largest share by which a mean energy or efficiency may differ without a finding."""

AROUND = 2.0
"""A finding this near to the damage points to its time. [s]"""

DETECTED, REPORTED, ASTRAY, HARMLESS, SILENT = "D", "d", "a", ".", "S"
"""Letters of a trial: pointed to and the numbers right, pointed to with numbers that moved, another
finding only, no finding and no number moved, no finding though a number moved."""


def moved(true: Result, found: Result) -> list[str]:
    """List the means that differ by more than the bar, and a number of complete cycles or a load
    that differs.
    """
    changes = (
        [] if true.cycles == found.cycles else [f"{found.cycles} for {true.cycles} complete cycles"]
    )
    for metric, old in true.mean.items():
        new = found.mean.get(metric)
        if old and (new is None or abs(new / old - 1.0) > BAR):
            changes.append(
                f"{metric} {'missing' if new is None else f'{100 * (new / old - 1.0):+.2f} %'}"
            )
    if true.load is not None and (
        found.load is None or not np.isclose(found.load, true.load, rtol=0.01)
    ):
        changes.append(f"load {found.load}")
    return changes


def new_findings(true: Result, found: Result) -> list[Finding]:
    """Findings that the undamaged log does not have."""
    known = {(f.kind, f.channel) for f in true.findings}
    return [f for f in found.findings if (f.kind, f.channel) not in known]


def points_to(finding: Finding, trial: Trial) -> bool:
    """Whether a finding names a channel or a time that is damaged."""
    words = f"{finding.channel or ''} {finding.message}".casefold()
    if finding.channel is None or any(name in words for name in trial.touched):
        return finding.kind != "unknown_column"
    if finding.start is None or finding.end is None:
        return False
    return any(
        finding.start - AROUND <= end and start <= finding.end + AROUND
        for start, end in trial.spans
    )


def judged(made: Trial) -> tuple[str, str]:
    """The letter of a trial, and in words what it moved and what was found."""
    true, found = truth(made.true), result(made.damaged)
    if true.rejected:
        raise ValueError(
            f"the undamaged log {made.true.name} at {made.true.rate:g} Hz was rejected: "
            f"{true.rejected}"
        )
    if found.rejected:
        return DETECTED, f"rejected: {found.rejected}"
    changes, findings = moved(true, found), new_findings(true, found)
    said = ", ".join(f"{f.kind} of {f.channel}" if f.channel else f.kind for f in findings)
    words = f"{', '.join(changes) or 'nothing moved'}; {said or 'no finding'}"
    if any(points_to(f, made) for f in findings):
        return REPORTED if changes else DETECTED, words
    if findings:
        return ASTRAY, words
    return SILENT if changes or made.always else HARMLESS, words


def letters(name: str, numbers: Iterable[int]) -> str:
    """The letters of some trials of a fault."""
    return "".join(judged(trial(name, k))[0] for k in numbers)


HEAD = f"{'fault':34}{'n':>5}{'found':>7}{'any':>6}{'wrong':>7}{'silent':>8}"


def counts(letters: str) -> tuple[int, int, int, int, int]:
    """Trials, pointed to, with any finding, wrong in a number whatever was found, silent."""
    found = sum(letter in (DETECTED, REPORTED) for letter in letters)
    wrong = sum(letter in (REPORTED, SILENT) for letter in letters)
    silent = letters.count(SILENT)
    return len(letters), found, found + letters.count(ASTRAY), wrong, silent


def table(found: Mapping[str, str], before: Mapping[str, str]) -> str:
    """Count by fault, beside the figures of before where these differ."""
    lines = [HEAD]
    for name, row in [*found.items(), ("all", "".join(found.values()))]:
        old = "".join(before.get(n, "") for n in found) if name == "all" else before.get(name, "")
        n, detected, any_, wrong, silent = counts(row)
        line = f"{name:34}{n:5}{detected:7}{any_:6}{wrong:7}{silent:8}"
        if old and len(old) == len(row) and counts(old) != counts(row):
            line += "   was {1:7}{2:6}{3:7}{4:8}".format(*counts(old))
        lines.append(line)
    return "\n".join(lines)


def names(part: str) -> list[str]:
    """Faults whose name contains a part."""
    return [name for name in FAULTS if part in name]
