"""A diagnosis as a page for the terminal: where, which, how sure, how far, what next."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import DiagnosisResult
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_words as words
from winchcascade.report.cause_costs import cost_lines, cost_title, no_energy_words
from winchcascade.report.cause_words import (
    CauseNumber,
    check_words,
    flipped_words,
    minor_words,
    numbers_of,
    slope_words,
    small_words,
    trend_words,
)
from winchcascade.report.digits import significant
from winchcascade.report.gap_words import (
    NAMES,
    alarm_words,
    differs_words,
    own_simulation_words,
    probability_words,
    share_words,
)
from winchcascade.report.model_account import COMPARED
from winchcascade.report.screen import Tone, length, line_width, table_width, toned
from winchcascade.report.text_table import aligned_lines, file_lines, headed, table_lines

INDENT = 11
"""Columns of the margin that holds the names."""

TONES: dict[str, Tone] = {
    "no_gap": "good",
    "explained": "good",
    "partly_explained": "warning",
    "unexplained": "contradiction",
}
"""Colours of the verdicts."""

MOST_ALARMS = 4
"""Signs of something unexplained that are listed; all are in the JSON."""

NARROWEST = 6
"""Columns of a number of the power of a winch without a model, at least."""


def entry(name: str, text: str) -> list[str]:
    """A name and its text, wrapped beside it; nothing for an empty text."""
    lines = [
        line
        for part in plain(text).split("\n")
        if part
        for line in textwrap.wrap(one_line(part), line_width() - INDENT, break_on_hyphens=False)
    ]
    return _beside(name, lines)


def _beside(name: str, lines: Sequence[str]) -> list[str]:
    """Lines beside a margin that holds their name."""
    return [f"{'' if k else name:<{INDENT}}{line}" for k, line in enumerate(lines)]


def plain(text: str) -> str:
    """A text with signs that every terminal shows."""
    return text.replace("−", "-").replace("–", "-").replace("Ω", "ohm").replace("N·s/m", "N s/m")


def diagnosis_text(found: ModelDiagnosis | LineDiagnosis, files: Sequence[Path | str] = ()) -> str:
    """What a project manager must know of a diagnosis.

    Parameters
    ----------
    files : what was written, and what was not
    """
    note = arises = means = steady = ""
    if isinstance(found, LineDiagnosis):
        note, steady, means = flipped_words(found), words.again_words(found), "the samples of those cycles"
        rest = entry("not needed", small_words(found))
        rest += entry("slope", slope_words(found) if "drum_inertia" in found.chosen else "")
    else:
        arises, means = words.arises_words(found) if words.says_more(found) else "", "block means on those logs"
        steady = trend_words(found)
        rest = entry("checked", words.checked_words(found) if found.verdict == "no_gap" else "")
        rest += entry("not needed", words.not_needed_words(found))
    return (
        plain(
            "\n".join(
                [
                    *_verdict(found),
                    "",
                    *entry("verdict", words.verdict_words(found)),
                    *headed(entry("data", origin_words(words.origins_of(found))), "not measured", "warning"),
                    *entry("note", note),
                    *(
                        line
                        for k, text in enumerate(own_simulation_words(found))
                        for line in entry("" if k else "yours", text)
                    ),
                    *entry("where", words.where_words(found)),
                    *entry("", arises),
                    *_causes(found),
                    *([] if isinstance(found, LineDiagnosis) else _costs(found)),
                    *entry("how sure", words.sure_words(found)),
                    *entry("minor", minor_words(found)),
                    *_how_far(found, means),
                    *entry("steady", steady),
                    *entry("what next", words.experiment_words(found)),
                    *_residual(found),
                    *rest,
                ]
            )
        )
        + "\n"
        + file_lines("files", files, INDENT)
    )


def _verdict(found: DiagnosisResult) -> list[str]:
    """Title and verdict."""
    verdict = words.VERDICTS[found.verdict].lower()
    whole = textwrap.wrap(f"{one_line(found.title)}: {verdict}", line_width(10**6), break_on_hyphens=False)
    return [*whole[:-1], toned(verdict, TONES[found.verdict]).join(whole[-1].rsplit(verdict, 1))]


def diagnosis_lines(record: Mapping[str, Any], files: Sequence[Path]) -> str:
    """Verdict, causes and files of a diagnosis in few lines.

    Parameters
    ----------
    record : the diagnosis as JSON, schema `winchcascade/diagnosis/1`
    """
    names = ", ".join(f"{cause['label']} ({cause['effect']})" for cause in record["causes"])
    text = f"{words.VERDICTS[record['verdict']].lower()}{f': {names}' if names else ''}"
    if record["closure"] is not None:
        share = share_words(record["closure"]["share_closed"]).replace(">", "more than")
        text += f"; {share} of the gap closed on held-out logs"
    return plain("\n".join(entry("diagnosis:", text))) + "\n" + file_lines("", files, INDENT)


def _causes(found: DiagnosisResult) -> list[str]:
    """A table of the causes, one below the other where it would be too wide, then their alternatives."""
    if not found.causes:
        return []
    numbers = [n for cause in found.causes for n in numbers_of(found, cause)]
    wide = _fitting([("cause", "effect", *_HEAD), *((n.label, n.effect, *_values(n)) for n in numbers)])
    stacked = [
        ("effect", *_HEAD),
        *(
            row
            for n in numbers
            for row in [(n.label, *_values(n)), *([(f"  {n.effect}", *[""] * len(_HEAD))] if n.effect else [])]
        ),
    ]
    lines = (
        wide
        or _fitting(stacked)
        or (["which", *table_lines(stacked, left=range(1 + len(_HEAD)), omit=_LESS)] if table_width() else [])
    )
    for n in () if lines else numbers:
        head = f"{n.label} ({n.effect}, {n.stage}, probability {n.probability}): " if n.effect else ""
        lines += entry("" if lines else "which", f"{head}{n.what} {n.value} (95 %: {n.beside})")
    for cause in found.causes:
        lines += entry("", check_words(found, cause))
        for rival in cause.rivals:
            likely, differs = probability_words(rival.probability), differs_words(rival.differs)
            lines += entry(
                "", f"or {rival.effect} for {cause.effect} (probability {likely}); the two differ most in {differs}."
            )
    return [*lines, *entry("", f"not named, though fitted: {', '.join(found.unnamed)}" if found.unnamed else "")]


def _costs(found: ModelDiagnosis) -> list[str]:
    """The leading efficiency by load, and which causes cost no energy."""
    table = cost_lines(found, line_width())
    if not table:
        return []
    lines = entry("costs", cost_title(found))
    margin = " " * INDENT if max(map(len, table)) <= line_width() - INDENT else ""
    return [*lines, *(margin + plain(line) for line in table), *entry("", no_energy_words(found))]


_HEAD = ("what changes", "found", "95 %", "prob.")
"""Columns of the table of causes beside their names."""

_LESS = ("what changes", "prob.")
"""Those of them that are left out first."""


def _values(n: CauseNumber) -> tuple[str, ...]:
    """Entries of a number of a cause below `_HEAD`."""
    return n.what, n.value, n.beside, n.probability


def _fitting(rows: Sequence[Sequence[str]]) -> list[str]:
    """A table beside the margin, or below its name where it is wider; no line where it is too wide for that too."""
    limit, lines = line_width(), aligned_lines(rows, left=range(len(rows[0])))
    widest = max(map(length, lines))
    return _beside("which", lines) if widest <= limit - INDENT else ["which", *lines] if widest <= limit else []


def _how_far(found: ModelDiagnosis | LineDiagnosis, means: str) -> list[str]:
    """The share that is closed, and root mean squares by channel.

    Parameters
    ----------
    means : of what they are the root mean squares
    """
    if found.closure is None:
        return []
    rows = [("channel", "before", "after", "noise", "")]
    for name, x in found.closure.channels.items():
        unit, factor = COMPARED.get(name, ("kW", 1e-3))
        before, after, noise = (
            significant(v * factor, 2).rjust(0 if name in COMPARED else NARROWEST) for v in (x.before, x.after, x.noise)
        )
        rows.append((NAMES[name], before, after, noise, unit))
    return [
        *entry("how far", words.closure_words(found)),
        *table_lines(rows, left=(0, 4), indent=" " * INDENT),
        *entry("", f"(root mean squares of {means})"),
    ]


def _residual(found: DiagnosisResult) -> list[str]:
    """What the causes leave, and the signs of something unexplained."""
    if found.remainder is None:
        return []
    lines = entry("residual", words.remainder_words(found))
    if isinstance(found, LineDiagnosis):
        return lines
    for alarm in found.remainder.alarms[1:MOST_ALARMS]:
        lines += entry("", f"{alarm_words(alarm, words.files_of(found))}.")
    more = len(found.remainder.alarms) - MOST_ALARMS
    return lines + (entry("", f"... {more} more, all in --json") if more > 0 else [])
