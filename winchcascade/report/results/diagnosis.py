"""What a diagnosis states: verdict, causes with numbers and costs, what to do next, and the evidence behind them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from winchcascade.core.campaign_file import banner
from winchcascade.diagnosis.block_series import Sides, most_telling, sides
from winchcascade.diagnosis.contributions import EFFICIENCIES, leading_metric
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    ContributionPart,
    DiagnosisResult,
    NamedCause,
    Place,
    Shrunk,
    StagePlace,
)
from winchcascade.diagnosis.gap_map import STANDS_OUT
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.load_costs import load_costs
from winchcascade.diagnosis.nuisances import Nuisance
from winchcascade.diagnosis.thresholds import Threshold
from winchcascade.report import diagnosis_figures as figures
from winchcascade.report import diagnosis_words as words
from winchcascade.report.cause_costs import given_head, no_energy_words, part_name, waterfall_figure
from winchcascade.report.cause_words import (
    check_words,
    minor_words,
    stability_words,
)
from winchcascade.report.content import (
    Cell,
    Column,
    Measured,
    Note,
    Report,
    Section,
    Table,
    Tile,
    Tone,
    picture,
    section,
    table,
)
from winchcascade.report.cycle_histories import cycle_picture
from winchcascade.report.digits import upper
from winchcascade.report.figures.style import house_style
from winchcascade.report.finding_words import finding_words
from winchcascade.report.gap_words import (
    NAMES,
    SENSORS,
    alarm_place,
    baseline_words,
    display_of,
    nuisance_words,
    own_simulation_words,
    phase_words,
    share_words,
)
from winchcascade.report.glossary import CHANNELS
from winchcascade.report.results import line_diagnosis
from winchcascade.report.results.common import data_note, provenance
from winchcascade.report.results.diagnosis_parts import (
    CauseRow,
    cause_columns,
    cause_rows,
    look_alikes,
    note_of,
    numbers,
    residual,
)
from winchcascade.report.sheet import file_digest
from winchcascade.report.wording import load_words
from winchcascade.rig.effects.effect import Display


def diagnosis_report(found: DiagnosisResult, *, command: str = "") -> Report:
    """Report of a diagnosis, with a model or without."""
    if isinstance(found, LineDiagnosis):
        return line_diagnosis.line_report(found, command=command)
    assert isinstance(found, ModelDiagnosis)  # there are no others
    return _model_report(found, command=command)


@house_style()
def _model_report(found: ModelDiagnosis, *, command: str) -> Report:
    both, word = sides(found), words.word_of(found)
    return Report(
        kind="Diagnosis of a campaign",
        title=f"{found.title}: {words.VERDICTS[found.verdict].lower()}",
        subtitle=f"{len(found.runs)} logs · rig {found.rig.name} · {len(found.suspects)} effects tried",
        tiles=tiles(found),
        lead=picture(
            waterfall_figure(found), "waterfall",
            f"{leading_metric(found.contributions) or ''} from {given_head(found)} to {word}, part by part; black: 95 %.",
            "Bars from one level to the next; the values are in the table of what each cause costs.",
        ),
        points=points(found),
        sections=[
            section("causes", "Causes", causes_table(found), *(Note(text) for text in actions(found))),
            section(
                "costs", "What each cause costs" if found.causes else "Efficiencies",
                cost_table(found, leading_metric(found.contributions)),
            ),
            section("next", "What next", note_of(words.experiment_words(found))),
            residual(found),
            _other_costs(found),
            _where(found, word),
            _how_far(found, both, word),
            section("time-histories", "Time histories", cycle_picture(found, word), folded=True),
            numbers(found),
            _speed(found, both, word),
            _considered(found),
            _provenance(found, command),
        ],
        banner=banner(words.origins_of(found)),
    )  # fmt: skip


# ------------------------------------------------------------------------------------------------------ the first screen
def tiles(found: ModelDiagnosis) -> list[Tile]:
    """Verdict, largest cost, and the share that is closed."""
    count = len(found.causes)
    named = f"{count} cause{'s' * (count > 1)} named" if count else "no cause named"
    shown = [Tile("Verdict", "", words.VERDICTS[found.verdict], named)]
    costs = worst_costs(found)
    physical = (
        [part for part in costs.parts if part.kind == "physical" and part.value < 0.0] if costs is not None else []
    )
    if costs is not None and physical:
        largest = min(physical, key=lambda part: part.value)
        place = f"of {costs.metric} at {load_words(costs.load, 'ohm')}"
        shown.append(Tile("Largest cost", place, part_name(found, largest), f"{largest.value:+.1f} points"))
    if found.closure is not None and count:
        interval = f"95 %: {words.interval_words(found.closure)}"
        shown.append(Tile("Gap closed", words.closed_on(found), share_words(found.closure.share), interval))
    if not count:
        shown += _largest(found)
    return shown


def _largest(found: ModelDiagnosis) -> list[Tile]:
    """The first sign of something unexplained; without any, the place that deviates most, where there is one."""
    alarms = () if found.remainder is None else found.remainder.alarms
    if alarms:
        place = alarm_place(alarms[0], words.files_of(found))
        return [Tile("First sign", alarms[0].kind, place, f"{alarms[0].size:.3g}, limit {alarms[0].limit:g}")]
    worst = max((one for one in found.places if math.isfinite(one.z)), key=lambda one: abs(one.z), default=None)
    if worst is None:
        return []
    where = f"{NAMES[worst.channel]}, {phase_words(worst.phase)}, {load_words(worst.load, 'ohm')}"
    limit = f"standard uncertainties; significant from {STANDS_OUT:g}"
    return [Tile("Largest deviation", where, f"{worst.z:+.1f}", limit)]


def worst_costs(found: ModelDiagnosis) -> Contribution | None:
    """The split of the leading efficiency at the load at which model and run differ most [%, points]; None without one."""
    costs = load_costs(found, leading_metric(found.contributions))
    return max(costs, key=lambda one: abs(one.measured - one.as_given), default=None)


def points(found: ModelDiagnosis) -> list[Note]:
    """What a reader must know first."""
    tone: Tone = "good" if found.verdict in ("no_gap", "explained") else "warn"
    clean = found.verdict == "no_gap"
    arises = f" {words.arises_words(found)}" if words.says_more(found) else ""
    drifting = any(cause.stability and cause.stability.trends for cause in found.causes)
    hidden = ", ".join(found.unnamed)
    return [
        data_note(words.origins_of(found)),
        Note(words.verdict_words(found), "Verdict", tone),
        *(Note(text, "Finding", "warn") for text in finding_words(found)),
        Note(words.start_words(found), "Start"),
        *(Note(text, "Yours") for text in own_simulation_words(found)),
        Note(f"{words.where_words(found)}{arises}".strip(), "Where"),
        Note(words.sure_words(found), "How sure"),
        Note(minor_words(found), "Minor"),
        Note(words.closure_words(found), "How far"),
        Note(stability_words(found), "Steady", "warn" if drifting else "plain", brief=drifting),
        Note(words.checked_words(found) if clean else "", "Checked"),
        Note(words.not_visible_words(found), "Not shown"),
        Note(f"The fit used {hidden} too: it may only imitate what acts." if hidden else "", "Not named", "warn"),
    ]


# ------------------------------------------------------------------------------------------------------------ the causes
def causes_table(found: ModelDiagnosis) -> Table[CauseRow] | None:
    """Every cause in one line: number, interval, cost, share that is closed without it, look-alikes, and what to do."""
    worst = worst_costs(found)
    costs = {part.effect: part.value for part in worst.parts if part.effect} if worst is not None else {}
    known: dict[str, float] = {name: value for name, value in costs.items() if name is not None}
    place = "" if worst is None else f"{worst.metric} at {load_words(worst.load, 'ohm')}"
    return table(
        "causes", "Effects that are needed, those that cost most first; intervals include the tolerance of the rig file.",
        [
            *cause_columns(found),
            Column("cost", lambda row: known.get(row.cause.effect) if row.first else None, "points", 2, signed=True),
            Column(
                "without", lambda row: 100.0 * row.cause.ablation if row.first and math.isfinite(row.cause.ablation) else None,
                "%", 1, brief=False,
            ),
            Column("look-alikes", look_alikes, brief=False),
        ],
        cause_rows(found, known),
        note=f"Cost: change of {place}. Without: share of the gap that is closed without it. {no_energy_words(found)}".rstrip(),
    )  # fmt: skip


def actions(found: ModelDiagnosis) -> list[str]:
    """What to do about the causes, those of which the same is to be done together."""
    alike: dict[str, list[str]] = {}
    for cause in found.causes:
        alike.setdefault(action_words(found, cause), []).append(cause.effect)
    return [f"{', '.join(names)}: {what}" for what, names in alike.items()]


def action_words(found: ModelDiagnosis, cause: NamedCause) -> str:
    """What to do about a cause: check an entry, recalibrate a sensor, separate it from its look-alikes, or enter it."""
    if cause.stage == "entry":
        return check_words(found, cause)
    alike = ", ".join(one.effect for one in cause.look_alikes)
    if alike:
        return f"these logs cannot tell it from {alike}; measure one of them or do the next run."
    if found.verdict != "explained":
        return "something else acts too; find that before this number is used."
    if cause.stage == "sensor":
        sensor = next((SENSORS[name] for name in SENSORS if cause.effect.startswith(name[:5])), "sensor")
        return f"recalibrate the {sensor}; `--write` keeps the error apart from the rig."
    return "enter in a corrected rig file with `--write FILE`."


# ----------------------------------------------------------------------------------------------------------------- costs
class CostRow(NamedTuple):
    """One row of the split of an efficiency: a level or a part at each load. [%, points]"""

    name: str
    unit: str
    values: Sequence[Cell]


def _other_costs(found: ModelDiagnosis) -> Section:
    leading = leading_metric(found.contributions)
    others = [metric for metric in EFFICIENCIES if metric != leading]
    tables = (cost_table(found, metric, brief=False) for metric in others)
    return section("other-costs", "Other efficiencies", *tables, folded=True)


def cost_table(found: ModelDiagnosis, metric: str | None, *, brief: bool = True) -> Table[CostRow] | None:
    """Levels and parts of an efficiency (rows) by load (columns)."""
    costs = load_costs(found, metric)
    if not costs:
        return None

    def name(part: ContributionPart) -> str:
        return part.kind.replace("_", " ") if part.effect is None else part.effect

    def value(part: ContributionPart) -> Cell:
        return Measured(part.value, (part.high - part.low) / 3.92)

    def at(k: int) -> Column[CostRow]:
        return Column(load_words(costs[k].load, "ohm"), lambda row: row.values[k], decimals=2)

    rows = [
        CostRow(given_head(found), "%", [one.as_given for one in costs]),
        *(
            CostRow(name(part), "points", [value(one.parts[k]) for one in costs])
            for k, part in enumerate(costs[0].parts)
        ),
        CostRow(words.word_of(found), "%", [one.measured for one in costs]),
    ]
    columns: list[Column[CostRow]] = [Column("part", lambda row: row.name), Column("unit", lambda row: row.unit)]
    columns += [at(k) for k in range(len(costs))]
    caption = f"{metric} by load, and what each part changes of it."
    return Table(f"costs-{costs[0].metric.replace('_', '-')}", caption, columns, rows, brief=brief)


# ---------------------------------------------------------------------------------------------------------- the residual
# ---------------------------------------------------------------------------------------------------------- the evidence
def _where(found: ModelDiagnosis, word: str) -> Section:
    minus = f"{upper(word)} minus {baseline_words(found)}"
    return section(
        "where", "Where the gap lies",
        picture(
            figures.gap_map(found), "map",
            f"{minus}, as a mean over each phase of each log, in standard uncertainties; coloured beyond {STANDS_OUT:g}.",
            "Matrix of numbers by channel and phase (rows) and load (columns); the largest are in the table.",
        ),
        _places("places", "The places with the largest gap, the zero of the log's sensor taken off.", found.places),
        picture(
            figures.stage_map(found), "stage-map",
            f"Stage by stage: {word} minus what each stage makes of its own inputs from the log, in standard uncertainties.",
            "Matrix of numbers by stage and phase (rows) and load (columns); the largest are in the table.",
        ),
        _places("stages", "The stages that deviate most, with their inputs from the log.", found.stages),
        folded=True,
    )  # fmt: skip


LISTED = 12
"""Places of a map that are listed."""


def _places(name: str, caption: str, places: Sequence[Place | StagePlace]) -> Table[Place | StagePlace] | None:
    def bias(place: Place | StagePlace) -> Cell:
        factor = CHANNELS[place.channel].factor
        return Measured(place.bias * factor, abs(place.bias / place.z) * factor if place.z else None)

    ranked = sorted(places, key=lambda place: -abs(place.z) if math.isfinite(place.z) else 0.0)
    stage: Column[Place | StagePlace] = Column(
        "stage", lambda place: place.stage if isinstance(place, StagePlace) else ""
    )
    return table(
        name, caption,
        [
            *([stage] if name == "stages" else []),
            Column("channel", lambda place: NAMES[place.channel]),
            Column("phase", lambda place: phase_words(place.phase)),
            Column("load", lambda place: load_words(place.load, "ohm")),
            Column("bias", bias, own_digits=True),
            Column("unit", lambda place: CHANNELS[place.channel].unit),
            Column("z", lambda place: place.z, "", 1, signed=True),
        ],
        ranked[:LISTED],
        brief=False,
    )  # fmt: skip


def _misfit(of: str) -> Column[tuple[str, Shrunk]]:
    """Column of a root mean square of a channel, in the unit in which the channel is shown, two digits."""

    def cell(row: tuple[str, Shrunk]) -> Cell:
        size = getattr(row[1], of) * CHANNELS[row[0]].factor
        return Measured(size, size)

    return Column(of, cell, own_digits=True)


def _how_far(found: ModelDiagnosis, both: Sides, word: str) -> Section:
    log = most_telling(found)
    run = found.data.logs[log].run
    shrunk = () if found.closure is None else found.closure.channels.items()
    return section(
        "how-far", "How far the gap closes",
        table(
            "closure", f"Misfit of means over blocks {words.closed_on(found)}: root mean squares.",
            [
                Column("channel", lambda row: NAMES[row[0]]),
                *map(_misfit, ("before", "after", "noise")),
                Column("unit", lambda row: CHANNELS[row[0]].unit),
                Column("result", lambda row: "worse" if row[1].worse else ""),
            ],
            shrunk,
        ),
        picture(
            figures.error_figure(found, both, word), "errors",
            "Errors in the payouts of all logs; a mark is a block (the paper's Fig. 18b).",
            "Clouds of marks before and after about zero.",
        ),
        picture(
            figures.history(found, both, log, word), "history",
            f"{run.name} ({load_words(run.load, 'ohm')}): {word} minus simulated, block by block.",
            "Lines over time for every channel.",
        ),
        folded=True,
    )  # fmt: skip


def _speed(found: ModelDiagnosis, both: Sides, word: str) -> Section:
    return section(
        "speed", "Current, torque and power over speed",
        picture(
            figures.over_speed_figure(found, both, word), "speed",
            "Payouts at a light, a middle and a heavy load (the paper's Figs 18a, 18c, 18d); means in bins of 250 rpm.",
            "Lines of the logs and marks of the simulations over generator speed.",
        ),
        folded=True,
    )  # fmt: skip


def _considered(found: ModelDiagnosis) -> Section:
    files = words.files_of(found)
    pulls = sorted(zip(found.data.nuisances, found.found.best.nu.tolist(), strict=True), key=lambda pair: -abs(pair[1]))
    moved: list[tuple[Nuisance, float]] = [pair for pair in pulls if abs(pair[1]) > 1.0]
    return section(
        "considered", "What else was considered",
        note_of(f"Not needed: {words.not_needed_words(found)}." if found.causes else ""),
        table(
            "thresholds",
            "From which size each effect alone would have been named in nine of ten such campaigns; -: no plausible size.",
            [
                Column[Threshold]("effect", lambda one: one.effect),
                Column("stage", lambda one: found.suspects[one.effect].stage),
                Column("what it is", lambda one: found.suspects[one.effect].summary),
                Column("named from", lambda one: _named_from(one, _display(found, one)), own_digits=True),
                Column("unit", lambda one: _display(found, one).unit.replace("·", ".")),
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
            moved[:LISTED],
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


def _named_from(one: Threshold, how: Display) -> Cell:
    """Number from which an effect would have been named, as exact as two digits of its change."""
    return None if one.value is None else Measured(one.value * how.factor, abs(one.value - one.absent) * how.factor)


def _display(found: ModelDiagnosis, one: Threshold) -> Display:
    """How the number of a threshold is shown."""
    return display_of(one.effect, found.suspects[one.effect].parameter, one.unit)


def _provenance(found: ModelDiagnosis, command: str) -> Section:
    rig, sets = found.rig, len(found.sets)
    rows: list[tuple[str, Cell]] = [
        ("Campaign", found.title),
        *((run.name, f"{load_words(run.load, 'ohm')}, {run.sha256 or 'no file'}") for run in found.runs),
        ("Withheld", words.judged_words(found)),
        ("Rig", f"{rig.name} ({rig.path})" if rig.path else rig.name),
        ("Source of the rig's numbers", rig.source),
        ("SHA-256 of the rig file", file_digest(rig.path)),
        ("Fits", f"{sets} sets of effects; {len(found.data.nuisances)} tolerances beside each"),
        ("Seed of the resampled cycles", str(found.seed)),
    ]
    return provenance(rows, command)


def main_table(found: DiagnosisResult) -> Table[CauseRow] | None:
    """The table of the causes of a diagnosis of either kind."""
    if isinstance(found, LineDiagnosis):
        return line_diagnosis.causes_table(found)
    return causes_table(found) if isinstance(found, ModelDiagnosis) else None
