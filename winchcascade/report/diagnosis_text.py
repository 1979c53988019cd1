"""A diagnosis as a page for the terminal: where, which, how sure, how far, what next."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.diagnosis.gap_location import NAMES
from winchcascade.report.diagnosis_lines import INDENT, WIDTH, entry, file_lines, plain
from winchcascade.report.diagnosis_names import (
    display_of,
    probability_words,
    quantity_words,
    share_words,
    told_apart_words,
    without_unit,
)
from winchcascade.report.diagnosis_words import (
    VERDICTS,
    alarm_words,
    arises_words,
    checked_words,
    closure_words,
    experiment_words,
    files_of,
    origins_of,
    remainder_words,
    says_more,
    sure_words,
    unnamed,
    verdict_words,
    where_words,
)
from winchcascade.report.digits import significant
from winchcascade.report.model_account import COMPARED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from winchcascade.diagnosis.causes import Cause
    from winchcascade.diagnosis.diagnose import Diagnosis

MOST_ALARMS = 4
"""Signs of something unexplained that are told; all are in the JSON."""


def diagnosis_text(found: Diagnosis, files: Sequence[Path | str] = ()) -> str:
    """What a project manager must know of a diagnosis; 100 columns at most.

    Parameters
    ----------
    files : what was written, and what was not
    """
    lines = [f"{one_line(found.title)}: {VERDICTS[found.verdict].lower()}", ""]
    lines += entry("verdict", verdict_words(found))
    lines += entry("data", origin_words(origins_of(found)))
    lines += entry("where", where_words(found))
    lines += entry("", arises_words(found) if says_more(found) else "")
    lines += _causes(found)
    lines += entry("how sure", sure_words(found))
    lines += _how_far(found)
    lines += entry("what next", experiment_words(found))
    lines += _left(found)
    if found.verdict == "no_gap":
        lines += entry("checked", checked_words(found))
    lines += _considered(found)
    return plain("\n".join(lines)) + "\n" + file_lines("files", files)


def diagnosis_lines(record: Mapping[str, Any], files: Sequence[Path]) -> str:
    """Verdict, causes and files of a diagnosis in few lines.

    Parameters
    ----------
    record : the diagnosis as JSON, schema `winchcascade/diagnosis/1`
    """
    names = ", ".join(cause["effect"] for cause in record["causes"])
    text = f"{VERDICTS[record['verdict']].lower()}{f': {names}' if names else ''}"
    if record["closure"] is not None:
        share = share_words(record["closure"]["share_closed"]).replace(">", "more than")
        text += f"; {share} of the gap closed on logs that were left out"
    return plain("\n".join(entry("diagnosis:", text))) + "\n" + file_lines("", files)


def _causes(found: Diagnosis) -> list[str]:
    """A table of the causes, each followed by its rivals."""
    if not found.causes:
        return []
    rows: list[tuple[str, ...]] = [("effect", "stage", "what changes", "found", "95 %", "prob.")]
    for cause in found.causes:
        rows += _cause_rows(cause)
    width = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, width, strict=True)).rstrip() for row in rows]
    widest = max(len(line) for line in lines)
    if widest <= WIDTH - INDENT:
        lines = [f"{'which' if k == 0 else '':<{INDENT}}{line}" for k, line in enumerate(lines)]
    else:
        lines = ["which", *lines] if widest <= WIDTH else _narrow(found)
    for cause in found.causes:
        for rival in cause.rivals:
            likely = f"probability {probability_words(rival.probability)}"
            where = told_apart_words(rival.told_apart_by)
            lines += entry("", f"or {rival.effect} for {cause.effect} ({likely}); the two differ most in {where}.")
    rest = unnamed(found)
    return [*lines, *entry("", f"not named, though fitted: {', '.join(rest)}")] if rest else lines


def _cause_rows(cause: Cause) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for k, (name, value) in enumerate(cause.parameters.items()):
        text, interval = quantity_words(cause.effect, name, value)
        how = display_of(cause.effect, name, value.unit)
        first = (cause.effect, cause.stage) if k == 0 else ("", "")
        last = probability_words(cause.probability) if k == 0 else ""
        rows.append((*first, display_of(cause.effect, name).what, text, without_unit(interval, how), last))
    return rows


def _narrow(found: Diagnosis) -> list[str]:
    """The causes one under the other, where a table would be too wide."""
    lines = []
    for k, cause in enumerate(found.causes):
        for row in _cause_rows(cause):
            head = f"{row[0]} ({row[1]}, probability {row[5]}): " if row[0] else ""
            lines += entry("which" if k == 0 and row[0] else "", f"{head}{row[2]} {row[3]} (95 %: {row[4]})")
    return lines


def _how_far(found: Diagnosis) -> list[str]:
    """The share that is closed, and root mean squares by channel."""
    if found.closure is None:
        return []
    lines = entry("how far", closure_words(found))
    rows = [("channel", "before", "after", "noise", "")]
    for name, x in found.closure.channels.items():
        unit, factor = COMPARED[name]
        values = [significant(v * factor, 2) for v in (x.before, x.after, x.noise)]
        rows.append((NAMES[name], values[0], values[1], values[2], unit))
    width = [max(len(row[k]) for row in rows) for k in range(5)]
    for row in rows:
        cells = (row[0].ljust(width[0]), *(row[k].rjust(width[k]) for k in (1, 2, 3)), row[4])
        lines.append(f"{'':<{INDENT}}{'  '.join(cells)}".rstrip())
    return [*lines, *entry("", "(root mean squares of 0.44 s means on those logs)")]


def _left(found: Diagnosis) -> list[str]:
    """What is left, and the signs of something unexplained."""
    if found.remainder is None:
        return []
    lines = entry("left", remainder_words(found))
    for alarm in found.remainder.alarms[1:MOST_ALARMS]:
        lines += entry("", f"{alarm_words(alarm, files_of(found))}.")
    more = len(found.remainder.alarms) - MOST_ALARMS
    return lines + (entry("", f"... {more} more, all in --json") if more > 0 else [])


def _considered(found: Diagnosis) -> list[str]:
    """Suspects that are not needed; all of them where none is."""
    if not found.causes:
        return []
    fitted = {cause.effect for cause in found.causes} | set(unnamed(found))
    rest = [name for name in found.suspects if name not in fitted]
    return entry("not needed", ", ".join(rest))
