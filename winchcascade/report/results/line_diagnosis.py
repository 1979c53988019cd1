"""What the diagnosis of a winch without a model states: causes in units of the line, energies, sets that were tried."""

from __future__ import annotations

from winchcascade.core.campaign_file import banner
from winchcascade.diagnosis.diagnosis_result import CycleEnergy, Place
from winchcascade.diagnosis.line.line_data import CyclePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_words as words
from winchcascade.report import line_figures as figures
from winchcascade.report.cause_words import (
    PhaseEnergy,
    again_words,
    cycles_of,
    energy_rows,
    fitted_words,
    minor_words,
    set_words,
    slope_words,
    small_words,
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
    picture,
    section,
    table,
)
from winchcascade.report.digits import upper
from winchcascade.report.figures.style import house_style
from winchcascade.report.finding_words import finding_words
from winchcascade.report.gap_words import phase_words, probability_words, share_words
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

KILO = figures.KILO


@house_style()
def line_report(found: LineDiagnosis, *, command: str = "") -> Report:
    """Report of a winch of which line tension, speed and shaft power are known."""
    word = words.word_of(found)
    return Report(
        kind="Diagnosis of a campaign",
        title=f"{found.title}: {words.VERDICTS[found.verdict].lower()}",
        subtitle=f"{cycles_of(found)} cycles · rig {found.rig.name}: line tension, speed and winch power, no model",
        tiles=_tiles(found),
        points=_points(found),
        sections=[
            section("causes", "Causes", causes_table(found), note_of(fitted_words(found), "Fitted too")),
            section("energies", "Energies by phase", energies_table(found)),
            section("next", "What next", note_of(words.experiment_words(found))),
            *([residual(found)] if found.remainder else []),
            _where(found, word),
            _how_far(found, word),
            numbers(found),
            _tried(found),
            provenance(
                [
                    ("Campaign", found.title),
                    *((part.run.name, _part(part)) for part in found.lines.parts),
                    ("Judged", words.judged_words(found)),
                    ("Rig", f"{found.rig.name} ({found.rig.path})" if found.rig.path else found.rig.name),
                    ("SHA-256 of the rig file", file_digest(found.rig.path)),
                    ("Acceleration", slope_words(found)),
                    ("Seed of the resampled cycles", str(found.seed)),
                ],
                command,
            ),
        ],
        banner=banner(words.origins_of(found)),
    )  # fmt: skip


def _part(part: CyclePart) -> str:
    return f"cycles {part.cycle.min()} to {part.cycle.max()}, {part.run.sha256 or 'no file'}"


def _tiles(found: LineDiagnosis) -> list[Tile]:
    count = len(found.causes)
    named = f"{count} cause{'s' * (count > 1)} named" if count else "no cause named"
    shown = [Tile("Verdict", "", words.VERDICTS[found.verdict], named)]
    if found.closure is not None and count:
        interval = f"95 %: {words.interval_words(found.closure)}"
        shown.append(Tile("Squared error closed", words.closed_on(found), share_words(found.closure.share), interval))
    return shown


def _points(found: LineDiagnosis) -> list[Note]:
    small, drifting = small_words(found), any(c.stability and c.stability.trends for c in found.causes)
    return [
        data_note(words.origins_of(found)),
        Note(words.verdict_words(found), "Verdict", "good" if found.verdict in ("no_gap", "explained") else "warn"),
        *(Note(text, "Finding", "warn") for text in finding_words(found)),
        Note(words.where_words(found), "Where"),
        Note(words.sure_words(found), "How sure"),
        Note(minor_words(found), "Minor"),
        Note(words.closure_words(found), "How far"),
        Note(stability_words(found), "Steady", "warn" if drifting else "plain"),
        Note(again_words(found), "Again"),
        Note(f"{small}." if small else "", "Not needed"),
    ]


def causes_table(found: LineDiagnosis) -> Table[CauseRow] | None:
    """Every number of the causes, in units of the line, with its look-alikes."""
    return table(
        "causes", "Effects that are needed, in units of the line.",
        [
            *cause_columns(found),
            Column("look-alikes", look_alikes, brief=False),
        ],
        cause_rows(found, {}),
    )  # fmt: skip


def energies_table(found: LineDiagnosis) -> Table[PhaseEnergy] | None:
    """Energies of the judged cycles by phase: measured, and how far predictions deviate."""
    return table(
        "energies", "Energy of the winch, and by how much predictions deviate from it.",
        [
            Column[PhaseEnergy]("phases", lambda row: row.phases),
            Column("energy", lambda row: row.measured * KILO, "kJ", 0),
            Column("before", lambda row: 100.0 * row.before, "%", 1, signed=True),
            Column("after", lambda row: 100.0 * row.after, "%", 1, signed=True),
            Column("worst cycle", lambda row: 100.0 * row.worst, "%", 1, signed=True),
        ],
        energy_rows(found),
    )  # fmt: skip


def _bias(place: Place) -> Cell:
    return Measured(place.bias * KILO, abs(place.bias / place.z) * KILO if place.z else None)


def _where(found: LineDiagnosis, word: str) -> Section:
    return section(
        "where", "Where the gap lies",
        picture(
            figures.power_history(found, word), "history", f"Power of the winch: {word} and predicted; below, the residual.",
            "Lines over time; root mean squares are in the table.",
        ),
        table(
            "places", f"{upper(word)} power of the winch minus line tension times speed, phase by phase.",
            [
                Column("phase", lambda place: phase_words(place.phase)),
                Column("bias", _bias, "kW"),
                Column("rms", lambda place: place.rms * KILO, "kW", 2),
                Column("z", lambda place: place.z, "", 1, signed=True),
                Column("share of the squares", lambda place: 100.0 * place.share, "%", 1),
            ],
            found.places,
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


def _how_far(found: LineDiagnosis, word: str) -> Section:
    energies = [one for one in found.energies if one.phase != "hold"] if found.closure is not None else []
    return section(
        "how-far", "How far the gap closes",
        picture(
            figures.power_scatter(found, word), "scatter",
            f"{upper(word)} over predicted power at samples of the judged cycles.",
            "Clouds of marks about a diagonal, wide before and narrow after.",
        ),
        picture(
            figures.power_by_cycle(found, word), "cycles", "Error of the power in every judged cycle.",
            "Pairs of marks for each cycle, before and after.",
        ),
        table(
            "cycle-energies", "Energy of the winch by cycle and phase, with the uncertainty of the prediction.",
            [
                Column[CycleEnergy]("run", lambda one: one.run),
                Column("cycle", lambda one: one.cycle),
                Column("phase", lambda one: phase_words(one.phase)),
                Column("measured", lambda one: Measured(one.measured * KILO, one.u * KILO), "kJ"),
                Column("before", lambda one: Measured(one.before * KILO, one.u * KILO), "kJ"),
                Column("after", lambda one: Measured(one.after * KILO, one.u * KILO), "kJ"),
                Column("u", lambda one: Measured(one.u * KILO, one.u * KILO), "kJ"),
            ],
            energies,
            brief=False,
        ),
        folded=True,
    )  # fmt: skip


LISTED = 12
"""Sets of suspects that are listed; all are in the JSON."""


def _tried(found: LineDiagnosis) -> Section:
    choice, chosen = found.choice, found.choice.evidence[found.chosen]
    ranked = sorted(choice.errors, key=lambda names: -choice.evidence[names])
    return section(
        "tried", "What was tried",
        picture(
            figures.closed_bars(found), "closed", "Squared error of sets of causes on held-out cycles (green: chosen).",
            "Bars of the squared error; the values are in the table of sets.",
        ),
        table(
            "sets", "Sets of suspects by their evidence.",
            [
                Column("set", set_words),
                Column("error", lambda names: 100.0 * choice.error(names), "% of the gap", 2),
                Column("evidence", lambda names: choice.evidence[names] - chosen, "nats", 1, signed=True),
                Column("probability", lambda names: probability_words(choice.probability[names])),
                Column("choice", lambda names: "chosen" if names == found.chosen else ""),
            ],
            ranked[:LISTED],
            brief=False,
        ),
        folded=True,
    )  # fmt: skip
