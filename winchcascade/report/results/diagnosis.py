"""What a diagnosis with a model states: verdict, causes and their costs, what to do next, and
the evidence behind them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    DiagnosisResult,
    ModelForm,
    Place,
    Shrunk,
)
from winchcascade.diagnosis.explain.contributions import EFFICIENCIES, leading_metric
from winchcascade.diagnosis.explain.figure_data import (
    block_table,
    largest_gap,
    load_costs,
    worst_costs,
)
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
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
    Tile,
    number_text,
    section,
    table,
)
from winchcascade.report.diagnosis_names import (
    NAMES,
    alarm_place,
    at_words,
    baseline_words,
    display_of,
    files_of,
    number_words,
    origins_of,
    phase_words,
    signed,
    word_of,
)
from winchcascade.report.figures import diagnosis_figures as figures
from winchcascade.report.figures.diagnosis_figures import part_name, waterfall_figure
from winchcascade.report.figures.histories import history_figure, history_json
from winchcascade.report.glossary import CHANNELS, upper
from winchcascade.report.results import diagnosis_words as words
from winchcascade.report.results.diagnosis_parts import (
    bias_cell,
    candidates_table,
    causes_table,
    considered,
    first_points,
    made_from,
    numbers,
    residual,
    step_tile,
    verdict_tile,
)
from winchcascade.report.results.diagnosis_sentences import experiment_words
from winchcascade.report.results.effects import call_all, called
from winchcascade.report.results.laws_beside_model import stage_laws_section
from winchcascade.report.results.stage_diagnosis import stage_report
from winchcascade.report.results.validation_report import validation_section
from winchcascade.report.wording import banner, load_words

if TYPE_CHECKING:
    import pandas as pd


def diagnosis_report(found: DiagnosisResult, *, command: str = "") -> Report:
    """Report of a diagnosis, with a model or without."""
    if isinstance(found, StageDiagnosis):
        return stage_report(found, command=command)
    assert isinstance(found, ModelDiagnosis)  # there are no others
    return _model_report(found, command=command)


def _model_report(found: ModelDiagnosis, *, command: str) -> Report:
    blocks, word = cache(partial(block_table, found)), word_of(found)
    leading = leading_metric(found.contributions)
    return Report(
        kind="Diagnosis of a campaign",
        title=f"{found.title}: {words.VERDICTS[found.verdict].lower()}",
        subtitle=f"{len(found.runs)} logs · rig {found.rig.name} · {len(found.suspects)} effects "
                 f"tried",
        tiles=_tiles(found),
        lead=None if leading is None else Picture(
            "waterfall",
            f"{leading} from {baseline_words(found)} to {word}, part by part; black: 95 %.",
            "Bars from one level to the next; the values are in the table of what each cause "
            "costs.",
            partial(waterfall_figure, found, word),
        ),
        points=_points(found),
        sections=[
            section("causes", "Causes", causes_table(found), candidates_table(found)),
            stage_laws_section(found),
            _own_simulation(found),
            section("next", "Next run", Note(experiment_words(found))),
            section(
                "costs", "What each cause costs" if found.causes else "Efficiencies",
                _cost_table(found, leading, brief=not found.causes),
            ),
            residual(found),
            _other_costs(found),
            _where(found, word),
            _how_far(found, blocks, word),
            Section(
                "time-histories", "Time histories", lambda: [_cycle(found, blocks(), word)], folded=True
            ),
            validation_section(found),
            numbers(found),
            considered(found),
            _provenance(found, command),
        ],
        banner=banner(origins_of(found)),
    )  # fmt: skip


# ------------------------------------------------------------------------------- the first screen
def _tiles(found: ModelDiagnosis) -> list[Tile]:
    """Verdict, largest cost and next step; without causes the first sign, or the place that
    deviates most.
    """
    shown = [verdict_tile(found), *_cost_tile(found)]
    alarms = () if found.remainder is None else found.remainder.alarms
    worst = max(
        (one for one in found.places if math.isfinite(one.z)),
        key=lambda one: abs(one.z),
        default=None,
    )
    if not found.causes and alarms:
        place, size = (
            alarm_place(alarms[0], files_of(found)),
            f"{alarms[0].size:.3g}, limit {alarms[0].limit:g}",
        )
        if alarms[0].kind == "nuisance":
            shown.append(
                Tile(
                    "Next step",
                    "the fit moves it most",
                    f"Check the {place}",
                    f"standard uncertainties: {size}",
                )
            )
        else:
            shown.append(Tile("First sign", alarms[0].kind, place, size))
    elif not found.causes and worst is not None:
        where = (
            f"{NAMES[worst.channel]}, {phase_words(worst.phase)}, {load_words(worst.load, 'ohm')}"
        )
        limit = f"standard uncertainties; significant from {STANDS_OUT:g}"
        shown.append(Tile("Largest deviation", where, signed(worst.z), limit))
    return [*shown, *step_tile(found)]


def _cost_tile(found: ModelDiagnosis) -> list[Tile]:
    """The named cause that changes the efficiency of the figure beside it most, with the number
    that stands there.
    """
    costs, named = worst_costs(found), {cause.effect for cause in found.causes}
    parts = [] if costs is None else [part for part in costs.parts if part.effect in named]
    if costs is None or not parts:
        return []
    largest = max(parts, key=lambda part: abs(part.value))
    is_cost = largest.kind == "physical" and largest.value < 0.0
    place = f"of {costs.metric}, {load_words(costs.load, 'ohm')}"
    change = f"{number_text(largest.value, 1, signed=True)} points"
    name = "Largest cost" if is_cost else "Largest change"
    return [Tile(name, place, part_name(found, largest), change)]


def _points(found: ModelDiagnosis) -> list[Note | None]:
    """What a reader must know first."""
    listed = {one.effect for one in found.candidates}
    hidden = call_all([name for name in found.unnamed if name not in listed], found.suspects)
    return [
        *first_points(found),
        Note(
            f"The fit used {hidden} too: it may only imitate what acts." if hidden else "",
            "Not named",
            "warn",
        ),
        Note(words.start_words(found), "Start"),
        Note(words.not_visible_words(found), "Not shown"),
    ]


def _own_simulation(found: ModelDiagnosis) -> Section:
    """What the own simulation has in another form than the rig's model, the largest difference
    first.
    """
    own, causes = found.own_simulation, {cause.effect for cause in found.causes}
    forms = () if own is None else own.forms
    agrees = "Your simulation agrees with the model of the rig file within its uncertainties."

    def contained(form: ModelForm) -> str:
        numbers = {} if own is None or form.likely is None else own.numbers.get(form.likely, {})
        shown = [
            (display_of(form.likely or "", name, value.unit), value)
            for name, value in numbers.items()
        ]
        return "; ".join(f"{how.what} {number_words(how, value)[0]}" for how, value in shown)

    return section(
        "own-simulation", "Your simulation",
        Note(agrees if own is not None and not forms else ""),
        table(
            "model-form", "Your simulation minus the model of the rig file, where they differ "
                          "most.",
            [
                Column("likely", lambda form: called(form.likely or "unknown", found.suspects), named=True),
                Column("stage", lambda form: form.stage),
                Column("place", lambda form: f"{NAMES[form.channel]}, "
                                             f"{phase_words(form.phase)}{at_words(form.load)}"),
                Column("difference", lambda form: bias_cell(form, CHANNELS[form.channel].factor, signed=True)),
                Column("unit", lambda form: CHANNELS[form.channel].unit),
                Column("it contains", contained),
                Column("also", lambda form: "a cause" if form.likely in causes else ""),
            ],
            forms,
        ),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------ costs
class CostRow(NamedTuple):
    """One row of the split of an efficiency: a level or a part at each load. [%, points]"""

    name: str
    unit: str
    values: Sequence[Cell]


def _other_costs(found: ModelDiagnosis) -> Section:
    leading = leading_metric(found.contributions)
    others = [metric for metric in EFFICIENCIES if metric != leading]
    tables = (_cost_table(found, metric, brief=False) for metric in others)
    return section("other-costs", "Other efficiencies", *tables, folded=True)


def _cost_table(found: ModelDiagnosis, metric: str | None, *, brief: bool) -> Table[CostRow] | None:
    """Levels and parts of an efficiency (rows) by load (columns), the causes that cost most
    first.
    """
    costs = load_costs(found, metric)
    if not costs:
        return None
    order = {cause.effect: k for k, cause in enumerate(found.causes)}
    parts = sorted(
        enumerate(costs[0].parts), key=lambda one: order.get(one[1].effect or "", len(order))
    )

    def at(k: int) -> Column[CostRow]:
        return Column(load_words(costs[k].load, "ohm"), lambda row: row.values[k], decimals=1)

    rows = [
        CostRow(baseline_words(found), "%", [one.as_given for one in costs]),
        *(
            CostRow(
                part_name(found, part),
                "points",
                [one.parts[k].value for one in costs],
            )
            for k, part in parts
        ),
        CostRow(word_of(found), "%", [one.measured for one in costs]),
    ]
    columns: list[Column[CostRow]] = [
        Column("part", lambda row: row.name),
        Column("unit", lambda row: row.unit),
    ]
    columns += [at(k) for k in range(len(costs))]
    caption = f"{metric} by load, and what each part changes of it."
    return Table(f"costs-{costs[0].metric.replace('_', '-')}", caption, columns, rows, brief=brief)


# ----------------------------------------------------------------------------------- the evidence
def _where(found: ModelDiagnosis, word: str) -> Section:
    minus = f"{upper(word)} minus {baseline_words(found)}"
    return section(
        "where", "Where the gap lies",
        Picture(
            "map",
            f"{minus}, as a mean over each phase of each log, in standard uncertainties; coloured "
            f"beyond {STANDS_OUT:g}.",
            "Matrix of numbers by channel and phase (rows) and load (columns); the largest are in "
            "the table.",
            partial(figures.gap_map, found),
        ),
        _places(found.places),
        Picture(
            "stage-map",
            f"Stage by stage: {word} minus what each stage makes of its own inputs from the log, "
            f"in standard uncertainties.",
            "Matrix of numbers by stage and phase (rows) and load (columns).",
            partial(figures.stage_map, found),
        ),
        folded=True,
    )  # fmt: skip


LISTED_PLACES = 12
"""Places of a map that are listed."""


def _places(places: Sequence[Place]) -> Table[Place]:
    """The places with the largest gap."""
    ranked = sorted(places, key=lambda place: -abs(place.z) if math.isfinite(place.z) else 0.0)
    return table(
        "places", "The places with the largest gap, the zero of the log's sensor taken off.",
        [
            Column("channel", lambda place: NAMES[place.channel]),
            Column("phase", lambda place: phase_words(place.phase)),
            Column("load", lambda place: load_words(place.load, "ohm")),
            Column("bias", lambda place: bias_cell(place, CHANNELS[place.channel].factor)),
            Column("unit", lambda place: CHANNELS[place.channel].unit),
            Column("z", lambda place: place.z, "", 1, signed=True),
        ],
        ranked[:LISTED_PLACES],
        brief=False,
    )  # fmt: skip


def _misfit(of: str) -> Column[tuple[str, Shrunk]]:
    """Column of a root mean square of a channel, in the unit in which the channel is shown, two
    digits.
    """

    def cell(row: tuple[str, Shrunk]) -> Cell:
        size = getattr(row[1], of) * CHANNELS[row[0]].factor
        return Measured(size, size)

    return Column(of, cell)


def _how_far(found: ModelDiagnosis, blocks: Callable[[], pd.DataFrame], word: str) -> Section:
    shrunk = () if found.closure is None else found.closure.channels.items()
    return section(
        "how-far", "How far the gap closes",
        table(
            "closure", f"Misfit of means over blocks {words.judged_words(found)}: root mean "
                       f"squares.",
            [
                Column("channel", lambda row: NAMES[row[0]]),
                *map(_misfit, ("before", "after", "noise")),
                Column("unit", lambda row: CHANNELS[row[0]].unit),
                Column("result", lambda row: "worse" if row[1].worse else ""),
            ],
            shrunk,
            brief=False,
        ),
        Picture(
            "errors",
            "Errors in the payouts of all logs; a mark is a block (the paper's Fig. 18b).",
            "Clouds of marks before and after about zero.",
            lambda: figures.error_figure(found, blocks(), word),
        ),
        folded=True,
    )  # fmt: skip


def _cycle(found: ModelDiagnosis, blocks: pd.DataFrame, word: str) -> Picture | None:
    """The cycle with the largest gap over time; None where no run has a payout."""
    item = largest_gap(found, blocks)
    if item is None:
        return None
    run, history = found.data.logs[item.log].run, figures.cycle_history(found, item, word)
    return Picture(
        "histories",
        f"Cycle {item.cycle} of {run.name} ({load_words(run.load, 'ohm')}), which deviates most at "
        f"the first place of the table of places, over the time since its onset; the zeros of the "
        f"sensors are taken off the {word}. Shaded: payout.",
        "Line plots of every channel over time; the values are in the log.",
        partial(history_figure, history),
        partial(history_json, history),
    )  # fmt: skip


def _provenance(found: ModelDiagnosis, command: str) -> Section:
    rows: list[tuple[str, Cell]] = [
        *(
            (run.name, f"{load_words(run.load, 'ohm')}, {run.sha256 or 'no file'}")
            for run in found.runs
        ),
        (
            "Fits",
            f"{len(found.sets)} sets of effects; {len(found.data.nuisances)} nuisances beside each",
        ),
    ]
    return made_from(found, rows, command)
