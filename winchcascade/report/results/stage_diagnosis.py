"""What the diagnosis of stages without a model states: causes, energies by stage, sets that were
tried; its figures.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

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
    origins_of,
    phase_words,
    probability_words,
    shown_as,
    word_of,
)
from winchcascade.report.figures.diagnosis_figures import DASHES
from winchcascade.report.figures.style import (
    COLOURS,
    label_panel,
    legend_above,
    line_entry,
    panel_figure,
    wide_figure,
)
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
    numbers,
    residual,
    step_tile,
    verdict_tile,
)
from winchcascade.report.results.diagnosis_sentences import experiment_words
from winchcascade.report.results.effects import call_all
from winchcascade.report.wording import banner

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
            section("next", "Next run", Note(experiment_words(found))),
            residual(found),
            _where(found, word),
            _how_far(found, word),
            numbers(found),
            _tried(found),
            made_from(found, rows, command),
        ],
        banner=banner(origins_of(found)),
    )


def _others_table(found: StageDiagnosis) -> Table[EffectNumber]:
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


def _energies_table(found: StageDiagnosis) -> Table[PhaseEnergy]:
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
    factor, k = prefix(max((abs(row.measured) for row in rows), default=0.0))
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
    factor, k = prefix(max(place.rms for place in found.places))
    return section(
        "where", "Where the gap lies",
        Picture(
            "history",
            f"Power that comes out, from the cycle with the largest deviation of its energy on: "
            f"{word} and predicted; below, the residual.",
            "Lines over time; root mean squares are in the table.",
            partial(power_history, found, word),
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

    factor, k = prefix(max((abs(one.measured) for one in energies), default=0.0))

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
            partial(power_scatter, found, word),
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
        Note(words.not_needed_words(found), brief=False),
        table(
            "sets", "Sets of suspects by their probability.",
            [
                Column("set", lambda names: call_all(names, found.suspects, " + ") or "none: no loss", named=True),
                Column("probability", lambda names: probability_words(found.sets[names])),
                Column("choice", lambda names: "chosen" if names == found.chosen else ""),
            ],
            sorted(found.sets, key=lambda names: -found.sets[names])[:LISTED_SETS],
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


GIVEN, CAUSED = "without losses", "with the causes"

MARKS = 2500
"""Blocks that are drawn over each other, at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""Cycles that are drawn over time."""


def prefix(size: float) -> tuple[float, str]:
    """Factor and prefix of the unit in which powers or energies of some size are shown.

    >>> prefix(2000.0), prefix(5.0)
    ((0.001, 'k'), (1.0, ''))
    """
    return (1e-3, "k") if size >= 1e3 else (1.0, "")


def worst_cycle(found: StageDiagnosis) -> StageEnergy | None:
    """Energy of the cycle, stage and phase from which the prediction deviates by the largest
    share; None without any.
    """
    known = [one for one in found.energies if one.phase != "hold" and one.measured]
    return max(known, key=lambda one: abs(one.after / one.measured - 1.0), default=None)


def power_history(found: StageDiagnosis, word: str) -> Figure:
    """Draw the power of the worst cycle and the next one over time, with the residual below, and
    the largest gap of them enlarged.
    """
    judged, worst, path = found.data.judged, worst_cycle(found), _widest(found)
    part = judged.part[0]
    if worst is not None:
        part = worst.run
        path = [one.out.name for one in found.data.paths].index(worst.stage)
    own_rows = (judged.part == part) & (judged.path == path)
    rows = judged.some(own_rows)
    t, cycles = rows.t, np.unique(rows.own_cycle)
    measured, given = rows.given + rows.gap, rows.given
    caused = None if found.closure is None else measured - found.closure.after[own_rows]
    first = 0 if worst is None else int(np.searchsorted(cycles, worst.cycle or 0))
    middle = cycles[min(first, max(cycles.size - SHOWN, 0)) :][:SHOWN]
    own = t[np.isin(rows.own_cycle, middle)]
    shown = (t >= own[0]) & (t <= own[-1])
    about = t[shown][np.argmax(np.abs(rows.gap[shown]))]
    near = (t >= about - 0.5 * NEAR) & (t <= about + 0.5 * NEAR)
    figure = wide_figure(4.3)
    axes = figure.subplots(2, 2, sharex="col", width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0))
    factor, k = prefix(float(np.max(np.abs(measured))))
    numbers = " and ".join(map(str, middle.tolist()))
    title = f"Cycle{'s' * (middle.size > 1)} {numbers} of {found.data.parts[part].run.name}"
    for column, (here, text) in enumerate(((shown, title), (near, "Where they differ most"))):
        above, below = axes[:, column]
        for power, colour, style in (
            (given, "mech", {"lw": 0.9, "ls": DASHES}),
            (caused, "gen", {"lw": 1.3}),
        ):
            if power is not None:
                above.plot(t[here] - own[0], power[here] * factor, color=COLOURS[colour], **style)
                below.plot(
                    t[here] - own[0],
                    (measured - power)[here] * factor,
                    color=COLOURS[colour],
                    **style,
                )
        above.plot(t[here] - own[0], measured[here] * factor, color=COLOURS["ink"], lw=0.7)
        above.margins(x=0.01)
        below.axhline(0.0, color=COLOURS["soft"], lw=0.6)
        below.set_xlabel("Time (s)")
        label_panel(above, "ab"[column], text)
    axes[0, 0].set_ylabel(f"Power ({k}W)")
    axes[1, 0].set_ylabel(f"Residual ({k}W)")
    with_causes = [line_entry(CAUSED, "gen", lw=1.3)] if caused is not None else []
    legend_above(
        figure,
        [line_entry(word, lw=0.9), line_entry(GIVEN, "mech", lw=1.0, ls=DASHES), *with_causes],
    )
    return figure


def power_scatter(found: StageDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, by the line alone and with the causes, at blocks spread
    over the judged cycles.
    """
    if found.closure is None:
        return None
    here = found.closure.rows.path == _widest(found)
    rows, after = found.closure.rows.some(here), found.closure.after[here]
    factor, k = prefix(float(np.max(np.abs(rows.given))))
    powers = np.array([rows.given + rows.gap, rows.given, rows.given + rows.gap - after])
    measured, *sides = powers[:, :: max(after.size // MARKS, 1)] * factor
    ends = [float(np.min(powers) * factor), float(np.max(powers) * factor)]
    figure, axes = panel_figure(3.1, 1, 2, share="xy")
    for ax, letter, predicted, colour, title in zip(
        axes, "ab", sides, ("mech", "gen"), (GIVEN, CAUSED), strict=True
    ):
        ax.plot(ends, ends, color=COLOURS["soft"], lw=0.7)
        ax.plot(predicted, measured, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5)
        ax.set(xlim=ends, ylim=ends)
        label_panel(ax, letter, upper(title), x=f"Predicted power ({k}W)")
    axes[0].set_ylabel(f"{upper(word)} power ({k}W)")
    return figure


def _widest(found: StageDiagnosis) -> int:
    """Number of the path that loses most."""
    rows = found.data.judged
    return int(np.argmax(np.bincount(rows.path, rows.gap**2)))
