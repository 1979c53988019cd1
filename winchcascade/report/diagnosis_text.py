"""A diagnosis as a page for the terminal: where, which, how sure, how far, what next."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.diagnosis.line.line_data import POWER
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_words as words
from winchcascade.report.diagnosis_names import probability_words, share_words
from winchcascade.report.digits import significant
from winchcascade.report.model_account import COMPARED

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from winchcascade.diagnosis.diagnose import ModelDiagnosis
    from winchcascade.diagnosis.diagnosis_result import DiagnosisResult

WIDTH, INDENT = 100, 11
"""Columns of a line, and of the margin that holds the names."""

MOST_ALARMS = 4
"""Signs of something unexplained that are told; all are in the JSON."""

NARROWEST = 6
"""Columns of a number of the power of a winch without a model, at least."""


def entry(name: str, text: str) -> list[str]:
    """A name and its text, wrapped beside it; nothing for an empty text."""
    lines = [
        line
        for part in plain(text).split("\n")
        if part
        for line in textwrap.wrap(one_line(part), WIDTH - INDENT, break_on_hyphens=False)
    ]
    return [f"{name if k == 0 else '':<{INDENT}}{line}" for k, line in enumerate(lines)]


def file_lines(name: str, files: Sequence[Path | str]) -> str:
    """What was written, one a line; a path is never broken."""
    return "".join(f"{name if k == 0 else '':<{INDENT}}{one_line(str(path))}\n" for k, path in enumerate(files))


def plain(text: str) -> str:
    """A text with signs that every terminal shows."""
    return text.replace("−", "-").replace("–", "-").replace("Ω", "ohm").replace("N·s/m", "N s/m")


def diagnosis_text(found: ModelDiagnosis | LineDiagnosis, files: Sequence[Path | str] = ()) -> str:
    """What a project manager must know of a diagnosis; 100 columns at most.

    Parameters
    ----------
    files : what was written, and what was not
    """
    line = isinstance(found, LineDiagnosis)
    lines = [f"{one_line(found.title)}: {words.VERDICTS[found.verdict].lower()}", ""]
    lines += entry("verdict", words.verdict_words(found))
    lines += entry("data", origin_words(words.origins_of(found)))
    lines += entry("note", words.flipped_words(found) if isinstance(found, LineDiagnosis) else "")
    lines += entry("where", words.where_words(found))
    if not isinstance(found, LineDiagnosis) and words.says_more(found):
        lines += entry("", words.arises_words(found))
    lines += _causes(found, stage=not line)
    lines += entry("how sure", words.sure_words(found))
    lines += _how_far(found, "the samples of those cycles" if line else "0.44 s means on those logs")
    lines += entry("steady", words.again_words(found) if isinstance(found, LineDiagnosis) else "")
    lines += entry("what next", words.experiment_words(found))
    lines += _left(found)
    if isinstance(found, LineDiagnosis):
        lines += entry("not needed", words.small_words(found))
        lines += entry("slope", words.slope_words(found) if "drum_inertia" in found.chosen else "")
    else:
        lines += entry("checked", words.checked_words(found) if found.verdict == "no_gap" else "")
        rest = [name for name in found.suspects if name not in found.chosen]
        lines += entry("not needed", ", ".join(rest) if found.causes else "")
    return plain("\n".join(lines)) + "\n" + file_lines("files", files)


def diagnosis_lines(record: Mapping[str, Any], files: Sequence[Path]) -> str:
    """Verdict, causes and files of a diagnosis in few lines.

    Parameters
    ----------
    record : the diagnosis as JSON, schema `winchcascade/diagnosis/1`
    """
    names = ", ".join(cause["effect"] for cause in record["causes"])
    text = f"{words.VERDICTS[record['verdict']].lower()}{f': {names}' if names else ''}"
    if record["closure"] is not None:
        share = share_words(record["closure"]["share_closed"]).replace(">", "more than")
        text += f"; {share} of the gap closed on logs that were left out"
    return plain("\n".join(entry("diagnosis:", text))) + "\n" + file_lines("", files)


def _causes(found: DiagnosisResult, *, stage: bool) -> list[str]:
    """A table of the causes, each followed by its rivals."""
    if not found.causes:
        return []
    rows = _cause_rows(found)
    head = ("effect", "stage", "what changes", "found", "95 %", "prob.")
    columns = [k for k in range(len(head)) if stage or head[k] != "stage"]
    width = {k: max(len(row[k]) for row in (head, *rows)) for k in columns}
    lines = ["  ".join(row[k].ljust(width[k]) for k in columns).rstrip() for row in (head, *rows)]
    widest = max(len(line) for line in lines)
    if widest <= WIDTH - INDENT:
        lines = [f"{'which' if k == 0 else '':<{INDENT}}{line}" for k, line in enumerate(lines)]
    else:
        lines = ["which", *lines] if widest <= WIDTH else _narrow(rows)
    for cause in found.causes:
        for rival in cause.rivals:
            likely = f"probability {probability_words(rival.probability)}"
            where = words.differs_words(rival.differs)
            lines += entry("", f"or {rival.effect} for {cause.effect} ({likely}); the two differ most in {where}.")
    return [*lines, *entry("", f"not named, though fitted: {', '.join(found.unnamed)}" if found.unnamed else "")]


def _cause_rows(found: DiagnosisResult) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for cause in found.causes:
        for k, (name, value) in enumerate(cause.parameters.items()):
            first = (cause.effect, cause.stage) if k == 0 else ("", "")
            last = probability_words(cause.probability) if k == 0 else ""
            rows.append((*first, *words.number_row(found, cause.effect, name, value), last))
    return rows


def _narrow(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """The causes one under the other, where a table would be too wide."""
    lines = []
    for k, row in enumerate(rows):
        head = f"{row[0]} ({row[1]}, probability {row[5]}): " if row[0] else ""
        lines += entry("which" if k == 0 else "", f"{head}{row[2]} {row[3]} (95 %: {row[4]})")
    return lines


def _how_far(found: ModelDiagnosis | LineDiagnosis, means: str) -> list[str]:
    """The share that is closed, and root mean squares by channel.

    Parameters
    ----------
    means : of what they are the root mean squares
    """
    if found.closure is None:
        return []
    lines = entry("how far", words.closure_words(found))
    rows = [("channel", "before", "after", "noise", "")]
    for name, x in found.closure.channels.items():
        unit, factor = COMPARED.get(name, ("kW", 1e-3))
        before, after, noise = (significant(v * factor, 2) for v in (x.before, x.after, x.noise))
        rows.append((words.NAMES.get(name, name), before, after, noise, unit))
    least = NARROWEST if POWER in found.closure.channels else 0
    width = [max(least, *(len(row[k]) for row in rows)) for k in range(4)]
    for row in rows:
        cells = (row[0].ljust(width[0]), *(row[k].rjust(width[k]) for k in (1, 2, 3)), row[4])
        lines.append(f"{'':<{INDENT}}{'  '.join(cells)}".rstrip())
    return [*lines, *entry("", f"(root mean squares of {means})")]


def _left(found: ModelDiagnosis | LineDiagnosis) -> list[str]:
    """What is left, and the signs of something unexplained."""
    if found.remainder is None:
        return []
    lines = entry("left", words.remainder_words(found))
    if isinstance(found, LineDiagnosis):
        return lines
    for alarm in found.remainder.alarms[1:MOST_ALARMS]:
        lines += entry("", f"{words.alarm_words(alarm, words.files_of(found))}.")
    more = len(found.remainder.alarms) - MOST_ALARMS
    return lines + (entry("", f"... {more} more, all in --json") if more > 0 else [])
