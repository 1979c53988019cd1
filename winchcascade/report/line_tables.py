"""Tables of the report of a winch without a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from winchcascade.report import diagnosis_page as page
from winchcascade.report import line_words as words
from winchcascade.report.diagnosis_map import signed
from winchcascade.report.diagnosis_names import phase_words, probability_words, share_words, without_unit
from winchcascade.report.digits import number, significant
from winchcascade.report.report_model import Table

if TYPE_CHECKING:
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis

MOST_SETS = 12
"""Sets of suspects that are listed; all are in the JSON."""

KILO = 1e-3


def causes_table(found: LineDiagnosis) -> Table | None:
    """Every cause with its number, its interval, and the same number from the withheld cycles alone."""
    rows = []
    for cause in found.causes:
        (own,) = cause.parameters.values()
        how = words.PARAMETERS[cause.effect]
        value, interval = words.value_words(cause.effect, own)
        again = "–"
        if cause.effect in found.again:
            other, within = words.value_words(cause.effect, found.again[cause.effect])
            again = f"{other} ({without_unit(within, how)})"
        rivals = ", ".join(rival.effect for rival in cause.rivals) or "none"
        sure = probability_words(cause.probability)
        rows.append((cause.effect, how.what, value, without_unit(interval, how), again, sure, rivals))
    if not rows:
        return None
    return Table(
        id="causes",
        caption="Effects that are needed, the one that closes most first.",
        head=("Effect", "What changes", "Found", "Interval", "Withheld cycles alone", "Probability", "Rivals"),
        units=("", "", "in the fit", "95 %", "value (95 %)", "", ""),
        rows=tuple(rows),
        text_columns=(0, 1, 6),
        note="Numbers are in units of the line: no drum radius is needed. Intervals allow for the correlation of samples "
        "within a cycle and, where the inertia is fitted, for the width of the slope that gives the acceleration.",
    )


def meanings_table(found: LineDiagnosis) -> Table:
    """What each suspect is, and what it closes alone and is worth beside the others."""
    choice = found.choice
    rows = []
    for name in found.lines.names:
        chosen = choice.chosen
        other = tuple(n for n in found.lines.names if (n in chosen) != (n == name))
        worth = (
            choice.error(other) - choice.error(chosen) if name in chosen else choice.error(chosen) - choice.error(other)
        )
        rows.append(
            (name, words.MEANINGS[name], share_words(1.0 - choice.error((name,))), f"{number(100.0 * worth, 1)} %")
        )
    return Table(
        id="suspects",
        caption="What each suspect closes alone, and beside the causes.",
        head=("Suspect", "What it is", "Closes alone", "Beside the causes"),
        units=("", "", "of the squared error", "with it, or lost without it"),
        rows=tuple(rows),
        text_columns=(0, 1),
        note="Shares of the squared error on cycles that the fit did not know. A share below zero predicts worse than nothing.",
    )


def places_table(found: LineDiagnosis) -> Table:
    """The gap phase by phase."""
    rows = tuple(
        (
            phase_words(row.phase), f"{row.blocks}", *(significant(x * KILO, 3) for x in (row.bias, row.rms, row.noise)),
            significant(row.u_repeat * KILO, 2), signed(row.z), f"{number(100.0 * row.share, 1)} %",
        )
        for row in found.rows
    )  # fmt: skip
    return Table(
        id="places",
        caption=f"Where the gap lies: {words.word_of(found)} power of the winch minus line force times speed, phase by phase.",
        head=("Phase", "Blocks", "Bias", "RMS", "Noise", "Cycles", "z", "Share"),
        units=("", "of 0.44 s", "kW", "kW", "of a block, kW", "repeat to, kW", "bias / u", "of the squares"),
        rows=rows,
        note="Noise is that of neighbouring blocks, from their second differences. z is the bias over its standard "
        "uncertainty, of noise and of how the cycles repeat.",
    )


def closure_table(found: LineDiagnosis) -> Table | None:
    """Root mean squares before and after on the judged cycles."""
    if found.judged is None:
        return None
    power = found.judged.power
    cells = (significant(x * KILO, 3) for x in (power.before, power.after, power.noise))
    return Table(
        id="closure",
        caption=f"Error of the power, {words.judged_words(found)}: root mean squares of samples.",
        head=("Channel", "Before", "After", "Noise", "Closed", "Interval"),
        units=("", "force times speed, kW", "with the causes, kW", "white, kW", "of the squares", "95 %"),
        rows=(("winch power", *cells, share_words(found.judged.closed), words.interval_words(found)),),
        note=f"Closed: 1 − Σ after² ÷ Σ before². Of what exceeds the noise it is {share_words(found.judged.beyond_noise)}. The "
        "interval resamples the cycles.",
    )


def sets_table(found: LineDiagnosis) -> Table:
    """The sets of suspects that predict best, and the single ones."""
    choice = found.choice
    ranked = sorted(choice.errors, key=choice.error)
    shown = ranked[:MOST_SETS] + [names for names in ranked[MOST_SETS:] if len(names) < 2]
    rows = tuple(
        (
            words.set_words(names), f"{len(names)}", f"{number(100.0 * choice.error(names), 2)} %",
            "yes" if choice.as_good(names) else "no", probability_words(choice.probability[names]),
            "yes" if names == choice.chosen else "",
        )
        for names in shown
    )  # fmt: skip
    return Table(
        id="sets",
        caption=f"Sets of suspects by the squared error that they leave of cycles they did not know: {len(shown)} of "
        f"{len(ranked)}.",
        head=("Set", "Suspects", "Error left", "As good", "Probability", "Chosen"),
        units=("", "", "of the gap", "as the best", "", ""),
        rows=rows,
        text_columns=(0, 3, 5),
        note=f"As good: within {number(100.0 * choice.tolerance / max(choice.gap, 1e-300), 2)} % of the least, the larger of "
        "one standard error over cycles and one per cent of the gap. The smallest of these is chosen.",
    )


def rivals_table(found: LineDiagnosis) -> Table | None:
    """Suspects that would do in place of a cause."""
    return page.rivals_table(
        found.causes,
        "Rivals: suspects that predict about as well in place of a cause, and where the two differ most.",
        str,
    )


def logs_table(found: LineDiagnosis) -> Table:
    """Every part of the campaign: its log, cycles and part in the diagnosis."""
    rows = []
    for part in found.lines.parts:
        role = "withheld" if part.withheld else "in the fit"
        if found.judged is not None and found.judged.left_out_in_turn:
            role = "each cycle left out once"
        cycles = f"{int(part.cycle.min())} to {int(part.cycle.max())}"
        rows.append((part.run.name, cycles, role, f"{part.here.size}", part.run.sha256 or "–"))
    return Table(
        id="logs", caption="Logs of the campaign.", head=("Log", "Cycles", "Part", "Samples", "SHA-256"),
        units=("", "", "", "that count", ""), rows=tuple(rows), text_columns=(0, 2, 4),
    )  # fmt: skip
