"""Parts of the report of a diagnosis that one with a model and one without have in common."""

from __future__ import annotations

from typing import NamedTuple

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import Alarm, DiagnosisResult, NamedCause, Reported
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_words as words
from winchcascade.report.cause_words import LINE_NUMBERS, range_words, trend_sentences
from winchcascade.report.content import Column, Measured, Note, Section, Span, picture, section, table
from winchcascade.report.figures.cause_figures import numbers_figure, profile_figure, stability_figure
from winchcascade.report.gap_words import alarm_place, display_of, kind_words, probability_words


class CauseRow(NamedTuple):
    """One number of a cause; what concerns the cause itself stands in its first row alone."""

    cause: NamedCause
    name: str
    value: Reported
    first: bool


def note_of(text: str, about: str = "") -> Note | None:
    """A sentence as a block; None for none."""
    return Note(text, about) if text else None


def cause_rows(found: DiagnosisResult, costs: dict[str, float]) -> list[CauseRow]:
    """Every number of the causes; those that cost most come first, wrong entries before them."""
    ranked = sorted(found.causes, key=lambda cause: (cause.stage != "entry", -abs(costs.get(cause.effect, 0.0))))
    return [
        CauseRow(cause, name, value, first=k == 0)
        for cause in ranked
        for k, (name, value) in enumerate(cause.parameters.items())
    ]


def cause_columns(found: DiagnosisResult) -> list[Column[CauseRow]]:
    """What stands of a number of a cause: what changes, its value and its interval in the unit in which it is shown."""

    def how(row: CauseRow) -> tuple[str, float, str]:
        if isinstance(found, LineDiagnosis):
            shown = LINE_NUMBERS[row.cause.effect]
        else:
            shown = display_of(row.cause.effect, row.name, row.value.unit)
        return shown.what, shown.factor, shown.unit

    def u(row: CauseRow) -> float:
        return (row.value.high - row.value.low) / 3.92 * how(row)[1]

    return [
        Column("effect", lambda row: row.cause.effect if row.first else ""),
        Column("what changes", lambda row: how(row)[0], brief=False),
        Column("found", lambda row: Measured(row.value.value * how(row)[1], u(row)), own_digits=True),
        Column("unit", lambda row: how(row)[2].replace("·", ".")),
        Column(
            "95 %", lambda row: Span(row.value.low * how(row)[1], row.value.high * how(row)[1], u(row)), own_digits=True
        ),
        Column("range", lambda row: range_words(row.value)),
        Column("prob.", lambda row: probability_words(row.cause.probability) if row.first else ""),
    ]


def look_alikes(row: CauseRow) -> str:
    """What would explain the same as well as a cause."""
    return ", ".join(one.effect for one in row.cause.look_alikes) if row.first else ""


def residual(found: DiagnosisResult) -> Section:
    """What the causes leave, every sign of something unexplained, and what its kind means."""
    files, alarms = words.files_of(found), () if found.remainder is None else found.remainder.alarms
    return section(
        "residual", "Residual",
        note_of(words.remainder_words(found)),
        table(
            "alarms", "Signs of something that the named causes do not explain.",
            [
                Column[Alarm]("where", lambda alarm: alarm_place(alarm, files)),
                Column("kind", lambda alarm: alarm.kind),
                Column("size", lambda alarm: Measured(alarm.size, 0.1 * alarm.size) if alarm.limit else None, own_digits=True),
                Column("limit", lambda alarm: Measured(alarm.limit, alarm.limit) if alarm.limit else None, own_digits=True),
            ],
            alarms,
        ),
        *(Note(text, kind) for kind, text in kind_words(alarms).items()),
    )  # fmt: skip


def numbers(found: DiagnosisResult) -> Section:
    """Numbers of the causes beside what is known of them, jointly and run by run, and what differs between runs."""
    model, item = (found, "run") if isinstance(found, ModelDiagnosis) else (None, "cycle")
    return section(
        "numbers", "Numbers of the causes",
        *(Note(text, "Trend", "warn") for text in trend_sentences(found)),
        picture(
            numbers_figure(model) if model else None, "numbers",
            "Each number beside the rig file's value, its tolerance, and what is plausible.",
            "Points with bars on one axis for each number; the values are in the table of causes.",
        ),
        picture(
            profile_figure(model) if model else None, "rolloff",
            "Back-EMF constant over the stator current (the paper's Fig. 18e).",
            "A falling curve with a band; its value at 10 A is in the table of causes.",
        ),
        picture(
            stability_figure(found), "stability",
            f"Number of each cause from every {item} alone, 95 %; band: the joint number.",
            f"Points with error bars for every {item}, and a band; the values are in the JSON.",
        ),
        folded=True,
    )  # fmt: skip
