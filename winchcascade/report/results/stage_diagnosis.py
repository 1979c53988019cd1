"""What the diagnosis of stages without a model states: causes, energies by stage, sets that were
tried.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

from winchcascade.diagnosis.diagnosis_result import Place, StageEnergy
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.content import (
    Cell,
    Column,
    Measured,
    Note,
    Picture,
    Report,
    Section,
    Table,
    section,
    table,
)
from winchcascade.report.diagnosis_names import (
    call_all,
    origins_of,
    phase_words,
    probability_words,
    shown_as,
    word_of,
)
from winchcascade.report.figures import stage_figures as figures
from winchcascade.report.glossary import upper
from winchcascade.report.results import diagnosis_words as words
from winchcascade.report.results.diagnosis_parts import (
    EffectNumber,
    bias_cell,
    candidates_table,
    causes_table,
    effects_table,
    first_points,
    made_from,
    minor_table,
    note_of,
    numbers,
    residual,
    step_tile,
    verdict_tile,
)
from winchcascade.report.wording import banner

LISTED_SETS = 12
"""Sets of suspects that are listed; all are in the JSON."""


def stage_report(found: StageDiagnosis, *, command: str = "") -> Report:
    """Report of a cascade of which the powers of neighbouring stages are known."""
    word, data = word_of(found), found.data
    rows: list[tuple[str, Cell]] = [
        (p.run.name, f"cycles {p.cycles[0]} to {p.cycles[1]}, {p.run.sha256 or 'no file'}")
        for p in data.parts
    ]
    stages = " to ".join([data.paths[0].into.name, *(path.out.name for path in data.paths)])
    return Report(
        kind="Diagnosis of a campaign",
        title=f"{found.title}: {words.VERDICTS[found.verdict].lower()}",
        subtitle=f"{len(data.cycle_names)} cycles · rig {found.rig.name}: {stages}, no model",
        tiles=[verdict_tile(found), *step_tile(found)],
        points=first_points(found),
        sections=[
            section(
                "causes",
                "Causes",
                causes_table(found),
                candidates_table(found),
                _others_table(found),
                minor_table(found),
            ),
            section("energies", "Energies by phase", _energies_table(found)),
            section("next", "Next run", note_of(words.experiment_words(found))),
            residual(found),
            _where(found, word),
            _how_far(found, word),
            numbers(found),
            _tried(found),
            made_from(found, rows, command),
        ],
        banner=banner(origins_of(found)),
    )


def _others_table(found: StageDiagnosis) -> Table[EffectNumber] | None:
    """Numbers of the effects that were fitted and are not named."""
    named = {cause.effect for cause in (*found.causes, *found.candidates)}
    rows = [
        EffectNumber(
            one.effect,
            shown_as(found, one),
            next(iter(one.parameters.values())),
            "in the fit, not named",
        )
        for one in found.fitted
        if one.effect not in named
    ]
    return effects_table("others", "Numbers beside those of the causes.", rows, found.suspects)


# --------------------------------------------------------------------------------------- energies
class PhaseEnergy(NamedTuple):
    """Energy of all judged cycles at a stage in a phase [J], and by which share predictions
    deviate, also in the worst cycle.
    """

    stage: str
    phase: str
    measured: float
    before: float
    after: float
    worst: float


def _energies_table(found: StageDiagnosis) -> Table[PhaseEnergy] | None:
    """Energies of the judged cycles by stage and phase: measured, and how far predictions
    deviate.
    """
    rows = []
    for stage, phase in dict.fromkeys(
        (one.stage, one.phase) for one in found.energies if one.phase != "hold"
    ):
        own = [
            one
            for one in found.energies
            if (one.stage, one.phase) == (stage, phase) and one.measured
        ]
        if measured := sum(one.measured for one in own):
            before, after = (
                sum(getattr(one, of) for one in own) / measured - 1.0 for of in ("before", "after")
            )
            worst = max((one.after / one.measured - 1.0 for one in own), key=abs)
            rows.append(PhaseEnergy(stage, phase, measured, before, after, worst))
    factor, k = figures.prefix(max((abs(row.measured) for row in rows), default=0.0))
    return table(
        "energies", "Energy at the stages, and by how much predictions deviate from it.",
        [
            Column[PhaseEnergy]("stage", lambda row: row.stage),
            Column("phase", lambda row: phase_words(row.phase)),
            Column("energy", lambda row: row.measured * factor, f"{k}J", 0),
            Column("before", lambda row: 100.0 * row.before, "%", 1, signed=True),
            Column("after", lambda row: 100.0 * row.after, "%", 1, signed=True),
            Column("worst cycle", lambda row: 100.0 * row.worst, "%", 1, signed=True),
        ],
        rows,
    )  # fmt: skip


# ----------------------------------------------------------------------------------- the evidence
def _where(found: StageDiagnosis, word: str) -> Section:
    factor, k = figures.prefix(max(place.rms for place in found.places))
    return section(
        "where", "Where the gap lies",
        Picture(
            "history",
            f"Power that comes out, from the cycle with the largest deviation of its energy on: "
            f"{word} and predicted; below, the residual.",
            "Lines over time; root mean squares are in the table.",
            partial(figures.power_history, found, word),
        ),
        table(
            "places", f"{upper(word)} power that comes out minus that which goes in, stage by "
                      f"stage.",
            [
                Column[Place]("stage", lambda place: place.stage),
                Column("phase", lambda place: phase_words(place.phase)),
                Column("bias", lambda place: bias_cell(place, factor), f"{k}W"),
                Column("rms", lambda place: place.rms * factor, f"{k}W", 2),
                Column("z", lambda place: place.z, "", 1, signed=True),
                Column("share of the squares", lambda place: 100.0 * place.share, "%", 1),
            ],
            found.places,
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


def _how_far(found: StageDiagnosis, word: str) -> Section:
    energies = (
        [one for one in found.energies if one.phase != "hold"] if found.closure is not None else []
    )

    factor, k = figures.prefix(max((abs(one.measured) for one in energies), default=0.0))

    def energy(name: str) -> Column[StageEnergy]:
        return Column(
            name, lambda one: Measured(getattr(one, name) * factor, one.u * factor), f"{k}J"
        )

    return section(
        "how-far", "How far the gap closes",
        Picture(
            "scatter",
            f"{upper(word)} over predicted power at samples of the judged cycles.",
            "Clouds of marks about a diagonal, wide before and narrow after.",
            partial(figures.power_scatter, found, word),
        ),
        table(
            "cycle-energies", "Energy by stage, cycle and phase, with the uncertainty of the "
                              "prediction.",
            [
                Column[StageEnergy]("run", lambda one: found.runs[one.run].name),
                Column("stage", lambda one: one.stage),
                Column("cycle", lambda one: one.cycle),
                Column("phase", lambda one: phase_words(one.phase)),
                *map(energy, ("measured", "before", "after", "u")),
            ],
            energies,
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


def _tried(found: StageDiagnosis) -> Section:
    return section(
        "tried", "What was tried",
        Note(words.not_needed_words(found), brief=False) if found.causes else None,
        table(
            "sets", "Sets of suspects by their probability.",
            [
                Column("set", lambda names: call_all(names, found.suspects, " + ") or "none: no loss"),
                Column("probability", lambda names: probability_words(found.sets[names])),
                Column("choice", lambda names: "chosen" if names == found.chosen else ""),
            ],
            sorted(found.sets, key=lambda names: -found.sets[names])[:LISTED_SETS],
            brief=False,
        ),
        folded=True,
    )  # fmt: skip
