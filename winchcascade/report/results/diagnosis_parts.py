"""Parts of the report of a diagnosis that one with a model and one without have in common:
causes, residual, numbers; and what else was considered.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

from winchcascade.core.store import fingerprint
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Alarm,
    DiagnosisResult,
    ModelForm,
    NamedCause,
    Place,
    Reported,
    SingleEffect,
)
from winchcascade.diagnosis.explain.figure_data import cost_of, mean_costs
from winchcascade.diagnosis.explain.thresholds import Threshold
from winchcascade.diagnosis.fit.nuisances import Nuisance
from winchcascade.report.content import (
    Cell,
    Column,
    Measured,
    Note,
    Picture,
    Section,
    Table,
    Tile,
    number_text,
    section,
    table,
)
from winchcascade.report.diagnosis_names import (
    NAMES,
    alarm_place,
    display_of,
    files_of,
    nuisance_words,
    number_cells,
    origins_of,
    phase_words,
    probability_words,
    range_words,
    share_words,
    shown_as,
)
from winchcascade.report.figures.diagnosis_figures import profile_figure, stability_figure
from winchcascade.report.glossary import upper
from winchcascade.report.results import diagnosis_words as words
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.results.effects import call_all, called
from winchcascade.rig.effects.effect import Display, Effect, Parameter


# ------------------------------------------------------------------------------------- the causes
class CauseRow(NamedTuple):
    """One number of a cause and how it is shown; what concerns the cause itself stands in its
    `first` row alone.
    """

    cause: NamedCause
    how: Display
    value: Reported
    first: bool


def _rows(found: DiagnosisResult, several: Sequence[NamedCause]) -> list[CauseRow]:
    """Numbers of some causes or candidates."""
    return [
        CauseRow(one, shown_as(found, one, name), value, first=k == 0)
        for one in several
        for k, (name, value) in enumerate(one.parameters.items())
    ]


def candidates_table(found: DiagnosisResult) -> Table[CauseRow]:
    """A line for each candidate: number, interval, closure without it, and look-alikes; it has
    no cost and no action.
    """
    return table(
        "candidates", "Candidates: the fit uses them, but each may imitate something that the "
                      "catalogue lacks.",
        [
            Column("effect", partial(_effect, found), named=True),
            *number_columns(),
            Column("without", _closed_without),
            Column("look-alikes", partial(_alike, found), named=True),
        ],
        _rows(found, found.candidates),
        note="Candidates are neither entered nor priced. Without: share of the gap that is closed "
             "without the candidate.",
    )  # fmt: skip


def _closed_without(row: CauseRow) -> str:
    return (
        share_words(row.cause.ablation) if row.first and math.isfinite(row.cause.ablation) else ""
    )


def _effect(found: DiagnosisResult, row: CauseRow) -> str:
    return called(row.cause.effect, found.suspects) if row.first else ""


def _alike(found: DiagnosisResult, row: CauseRow) -> str:
    alike = [one.effect for one in row.cause.look_alikes] if row.first else []
    return call_all(alike, found.suspects)


def causes_table(found: DiagnosisResult) -> Table[CauseRow]:
    """A line for each cause: number, interval, probability, cost, closure without it,
    look-alikes, and what to do.
    """
    costs, model = mean_costs(found), isinstance(found, ModelDiagnosis)
    place = "" if costs is None else f"Cost: change of {costs.metric}, mean over the loads. "
    without = "Without: share of the gap that is closed without the cause. " if model else ""
    free = (
        "Sensors and entries cost no energy: they change what is read or stated." if model else ""
    )
    return table(
        "causes", "Effects that are needed; 95 % intervals include the uncertainty of the rig "
                  "file.",
        [
            Column("effect", partial(_effect, found), named=True),
            Column("what changes", lambda row: row.how.what, brief=False),
            *number_columns(),
            Column("range", lambda row: range_words(row.value)),
            Column("prob.", lambda row: probability_words(row.cause.probability) if row.first else ""),
            Column("cost", lambda row: cost_of(costs, row.cause) if row.first else None, "points", 1, signed=True),
            Column("without", _closed_without),
            Column("look-alikes", partial(_alike, found), named=True),
            Column("what to do", lambda row: str(words.action_of(found, row.cause)) if row.first else ""),
        ],
        _rows(found, found.causes),
        note=f"{place}{without}Probability: posterior within the catalogue. {free}".rstrip(),
    )  # fmt: skip


def bias_cell(place: Place | ModelForm, factor: float, *, signed: bool = False) -> Measured:
    """Mean difference at a place, with the digits that its standard uncertainty, its size over z,
    allows.

    Parameters
    ----------
    factor : from SI units to the unit in which it is shown
    """
    u = abs(place.bias / place.z) * factor if place.z else None
    return Measured(place.bias * factor, u, signed=signed)


class EffectNumber(NamedTuple):
    """A number of an effect beside those of the causes, how it is shown, and what it is."""

    effect: str
    how: Display
    value: Reported
    role: str


def number_columns() -> list[Column[Any]]:
    """Number and interval of an effect in the unit in which it is shown."""
    return [
        Column("found", lambda row: number_cells(row.how, row.value)[0]),
        Column("unit", lambda row: row.how.unit),
        Column("95 %", lambda row: number_cells(row.how, row.value)[1]),
    ]


# ------------------------------------------------------------------------------- the first screen
def verdict_tile(found: DiagnosisResult) -> Tile:
    """The verdict and how many causes are named."""
    count = len(found.causes)
    named = f"{count} cause{'s' * (count > 1)} named" if count else "no cause named"
    listed = len(found.candidates)
    named += f", {listed} candidate{'s' * (listed > 1)}" if listed else ""
    return Tile("Verdict", "", words.VERDICTS[found.verdict], named)


def step_tile(found: DiagnosisResult) -> list[Tile]:
    """What to do about the first cause; none without one."""
    for cause in found.causes[:1]:
        action, alike = (
            words.action_of(found, cause),
            call_all([one.effect for one in cause.look_alikes], found.suspects),
        )
        beside = f"look-alike: {alike}" if alike else action.stated
        return [
            Tile(
                "Next step",
                called(cause.effect, found.suspects),
                upper(action.what.replace("`", "")),
                beside,
            )
        ]
    return []


def first_points(found: DiagnosisResult) -> list[Note | None]:
    """The verdict, the place, every finding and trend, and where the data come from."""
    good = found.verdict in ("no_gap", "explained")
    return [
        Note(words.verdict_words(found), "Verdict", "good" if good else "warn"),
        Note(words.where_words(found), "Where"),
        *(Note(text, "Finding", "warn") for text in words.finding_words(found)),
        *(Note(text, "Trend", "warn") for text in words.trend_sentences(found)),
        Note(words.certainty_words(found), "Certainty"),
        Note(words.distinguished_words(found), "Distinguished by", brief=False),
        data_note(origins_of(found)),
    ]


# ----------------------------------------------------------------------------------- the evidence
def residual(found: DiagnosisResult) -> Section:
    """Every sign of something that the causes leave, and what its kind means."""
    files, alarms = files_of(found), () if found.remainder is None else found.remainder.alarms

    def number(size: float, u: float) -> Cell:
        return Measured(size, u) if u else None

    return section(
        "residual", "Residual",
        table(
            "alarms", "Signs of something that the named causes do not explain.",
            [
                Column[Alarm]("where", lambda alarm: alarm_place(alarm, files), named=True),
                Column("kind", lambda alarm: alarm.kind),
                Column("size", lambda alarm: number(alarm.size, 0.1 * alarm.size if alarm.limit else 0.0)),
                Column("limit", lambda alarm: number(alarm.limit, alarm.limit)),
            ],
            alarms,
        ),
        *(Note(upper(text), upper(kind), brief=False) for kind, text in words.kind_words(alarms).items()),
    )  # fmt: skip


def numbers(found: DiagnosisResult) -> Section:
    """Numbers of the causes beside what is known of them, jointly and run by run."""
    model, item = (found, "run") if isinstance(found, ModelDiagnosis) else (None, "cycle")
    return section(
        "numbers", "Numbers of the causes",
        Note(words.stability_words(found), brief=False),
        None if model is None else Picture(
            "rolloff",
            "Back-EMF constant over the stator current (the paper's Fig. 18e).",
            "A falling curve with a band; its value at 10 A is in the table of causes.",
            partial(profile_figure, model),
        ),
        Picture(
            "stability",
            f"Number of each cause in every {item}, 95 %; band: the joint number.",
            f"Points with error bars for every {item}, and a band; the values are in the JSON.",
            partial(stability_figure, found),
        ),
        folded=True,
    )  # fmt: skip


def minor_table(found: DiagnosisResult) -> Table[EffectNumber]:
    """Effects that are significant but too small to matter, and undecided ones, with number and
    what each changes most.
    """
    rows = []
    for one in found.minor:
        (name, value), largest = next(iter(one.parameters.items())), one.largest
        changed = (
            largest.name
            if largest.phase is None
            else f"{NAMES[largest.name]}, {phase_words(largest.phase)}"
        )
        kind = "too small to matter" if math.isnan(one.hint) else "undecided"
        role = (
            f"{kind}: changes {changed} by {number_text(100.0 * largest.change, 2, signed=True)} %"
        )
        rows.append(EffectNumber(one.effect, display_of(one.effect, name, value.unit), value, role))
    caption = "Effects that are significant but too small to matter, and undecided ones: too little evidence for a cause."
    return effects_table("minor", caption, rows, found.suspects)


def effects_table(
    name: str, caption: str, rows: Sequence[EffectNumber], suspects: Mapping[str, Effect]
) -> Table[EffectNumber]:
    """Numbers of some effects beside those of the causes."""
    columns: list[Column[EffectNumber]] = [
        Column("effect", lambda row: called(row.effect, suspects), named=True),
        *number_columns(),
        Column("what it is", lambda row: row.role),
    ]
    return table(name, caption, columns, rows)


LISTED_NUISANCES = 12
"""Nuisances that are listed, those that the fit moved most."""

RANGE_COLUMNS: list[Column[tuple[str, Parameter]]] = [
    Column("effect", lambda row: called(row[0]), named=True),
    Column("field", lambda row: row[1].name),
    Column("plausible", lambda row: f"{row[1].low:.3g} to {row[1].high:.3g}"),
    Column("unit", lambda row: row[1].unit),
    Column("share", lambda row: "{:.3g} to {:.3g}".format(*row[1].share or (0.0, 0.0))),
    Column("of", lambda row: row[1].scale.replace("_", " ")),
]
"""Plausible range of a field of a suspect."""


def considered(found: ModelDiagnosis) -> Section:
    """Effects that are not causes, numbers that the logs do not know, and what the fit moved."""
    files = files_of(found)
    pulls = sorted(
        zip(found.data.nuisances, found.found.best.nu.tolist(), strict=True),
        key=lambda pair: -abs(pair[1]),
    )
    moved: list[tuple[Nuisance, float]] = [pair for pair in pulls if abs(pair[1]) > 1.0]
    return section(
        "considered", "What else was considered",
        Note(words.not_needed_words(found), brief=False),
        Note(words.undetermined_words(found), brief=False),
        minor_table(found),
        table(
            "singles",
            "Best single effects: evidence relative to the best set, and share of the gap closed "
            "on held-out logs.",
            [
                Column[SingleEffect]("effect", lambda one: called(one.effect, found.suspects), named=True),
                Column("evidence", lambda one: one.evidence, "nats", 1, signed=True),
                Column("closes alone", lambda one: share_words(one.closure) if math.isfinite(one.closure) else ""),
            ],
            found.singles,
            brief=False,
        ),
        table(
            "ranges",
            "Plausible ranges of effects with a size of their own: in units, and as a share of a "
            "scale of the campaign.",
            RANGE_COLUMNS,
            [(name, field) for name, effect in found.suspects.items() for field in effect.fields if field.share],
            brief=False,
        ),
        table(
            "thresholds",
            "From which size each effect alone would have been named in nine of ten such "
            "campaigns; -: no plausible size.",
            [
                Column[Threshold]("effect", lambda one: called(one.effect, found.suspects), named=True),
                Column("stage", lambda one: found.suspects[one.effect].stage),
                Column("what it is", lambda one: found.suspects[one.effect].summary),
                Column("named from", lambda one: _named_from(one, _display(found, one))),
                Column("unit", lambda one: _display(found, one).unit),
            ],
            found.thresholds,
            brief=False,
        ),
        table(
            "nuisances", "What the fit moved most within its tolerance, in standard uncertainties.",
            [
                Column("number", lambda pair: nuisance_words(pair[0], files)),
                Column("moved", lambda pair: pair[1], "", 1, signed=True),
            ],
            moved[:LISTED_NUISANCES],
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


def _named_from(one: Threshold, how: Display) -> Cell:
    """Number from which an effect would have been named, as exact as two digits of its change."""
    return (
        None
        if one.value is None
        else Measured(one.value * how.factor, abs(one.value - one.absent) * how.factor)
    )


def _display(found: ModelDiagnosis, one: Threshold) -> Display:
    """How the number of a threshold is shown."""
    return display_of(one.effect, found.suspects[one.effect].parameter, one.unit)


def made_from(found: DiagnosisResult, rows: Sequence[tuple[str, Cell]], command: str) -> Section:
    """Where every number comes from: campaign, logs and what they are judged on, rig, seed."""
    rig = found.rig
    common: list[tuple[str, Cell]] = [
        ("Campaign", found.title),
        *rows,
        ("Judged", words.judged_words(found)),
        ("Causes chosen on", words.chosen_words(found)),
        ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
        ("Source of the rig's numbers", rig.source),
        ("SHA-256 of the rig file", fingerprint(rig.path)),
        ("Seed of the resampled cycles", str(found.seed)),
    ]
    return provenance(common, command)
