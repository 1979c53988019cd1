"""The diagnosis of a winch without a model as a page for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.core.campaign_file import origin_words
from winchcascade.core.plain_text import one_line
from winchcascade.report import line_words as words
from winchcascade.report.diagnosis_lines import INDENT, entry, file_lines, plain
from winchcascade.report.diagnosis_names import probability_words
from winchcascade.report.diagnosis_words import VERDICTS
from winchcascade.report.digits import significant

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis


def line_text(found: LineDiagnosis, files: Sequence[Path | str] = ()) -> str:
    """What a project manager must know of the diagnosis of a winch without a model; 100 columns at most.

    Parameters
    ----------
    files : what was written, and what was not
    """
    lines = [f"{one_line(found.title)}: {VERDICTS[found.verdict].lower()}", ""]
    lines += entry("verdict", words.verdict_words(found))
    lines += entry("data", origin_words(words.origins_of(found)))
    lines += entry("note", words.flipped_words(found))
    lines += entry("where", words.where_words(found))
    lines += _causes(found)
    lines += entry("how sure", words.sure_words(found))
    lines += _how_far(found)
    lines += entry("steady", words.again_words(found))
    lines += entry("what next", words.experiment_words(found))
    lines += entry("left", words.remainder_words(found))
    lines += entry("not needed", words.small_words(found))
    lines += entry("slope", words.slope_words(found) if "drum_inertia" in found.choice.chosen else "")
    return plain("\n".join(lines)) + "\n" + file_lines("files", files)


def _causes(found: LineDiagnosis) -> list[str]:
    """A table of the causes, each followed by its rivals."""
    if not found.causes:
        return []
    rows: list[tuple[str, ...]] = [("effect", "what changes", "found", "95 %", "prob.")]
    for cause in found.causes:
        (number,) = cause.parameters.values()
        value, interval = words.value_words(cause.effect, number)
        how = words.PARAMETERS[cause.effect]
        interval = interval.removesuffix(how.unit).rstrip()
        rows.append((cause.effect, how.what, plain(value), interval, probability_words(cause.probability)))
    width = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        f"{'which' if k == 0 else '':<{INDENT}}"
        + "  ".join(cell.ljust(w) for cell, w in zip(row, width, strict=True)).rstrip()
        for k, row in enumerate(rows)
    ]
    for cause in found.causes:
        for rival in cause.rivals:
            likely = probability_words(rival.probability)
            lines += entry(
                "",
                f"or {rival.effect} for {cause.effect} (probability {likely}); the two differ most in {rival.told_apart_by}.",
            )
    rest = words.unnamed(found)
    return [*lines, *entry("", f"not named, though fitted: {', '.join(rest)}")] if rest else lines


def _how_far(found: LineDiagnosis) -> list[str]:
    """The share that is closed, and root mean squares of the power."""
    if found.judged is None:
        return []
    power = found.judged.power
    rows = [("channel", "before", "after", "noise", ""), ("power_mech", *(significant(x / 1e3, 2) for x in
            (power.before, power.after, power.noise)), "kW")]  # fmt: skip
    lines = entry("how far", words.closure_words(found))
    for row in rows:
        cells = (row[0].ljust(10), *(cell.rjust(6) for cell in row[1:4]), row[4])
        lines.append(f"{'':<{INDENT}}{'  '.join(cells)}".rstrip())
    return [*lines, *entry("", "(root mean squares of the samples of those cycles)")]
