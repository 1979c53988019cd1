"""Tables of the report of a diagnosis of a winch without a model."""

from __future__ import annotations

from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.report import diagnosis_words as words
from winchcascade.report.diagnosis_figures import KILO, signed
from winchcascade.report.diagnosis_names import phase_words, probability_words, share_words
from winchcascade.report.digits import number, significant
from winchcascade.report.line_words import LINE_MEANINGS, set_words
from winchcascade.report.report_model import (
    Table,
    formatted_table,
    number_column,
    text_column,
)

MOST_SETS = 12
"""Sets of suspects that are listed; all are in the JSON."""


def line_suspects_table(found: LineDiagnosis) -> Table | None:
    """What each suspect is, and what it closes alone and is worth beside the others."""
    choice, rows = found.choice, []
    for name in found.lines.names:
        other = tuple(n for n in found.lines.names if (n in found.chosen) != (n == name))
        worth = (100.0 if name in found.chosen else -100.0) * (choice.error(other) - choice.error(found.chosen))
        rows.append((name, LINE_MEANINGS[name], share_words(1.0 - choice.error((name,))), f"{number(worth, 1)} %"))
    return formatted_table(
        "suspects",
        "What each suspect closes alone, and beside the causes.",
        (
            text_column("Suspect"), text_column("What it is"), number_column("Closes alone", "of the squared error"),
            number_column("Beside the causes", "with it, or lost without it"),
        ),
        rows,
        "Shares of the squared error on held-out cycles. A share below zero predicts worse than nothing.",
    )  # fmt: skip


def line_places_table(found: LineDiagnosis) -> Table | None:
    """The gap phase by phase."""
    return formatted_table(
        "places",
        f"Where the gap lies: {words.word_of(found)} power of the winch minus line tension times speed, phase by phase.",
        (
            text_column("Phase"), number_column("Blocks", "of 0.44 s"), number_column("Bias", "kW"),
            number_column("RMS", "kW"),
            number_column("Noise", "of a block, kW"), number_column("Cycles", "repeat to, kW"),
            number_column("z", "bias / u"),
            number_column("Share", "of the squares"),
        ),
        [
            (
                phase_words(row.phase), f"{row.blocks}",
                *(significant(x * KILO, 3) for x in (row.bias, row.rms, row.noise)),
                significant(row.u_repeat * KILO, 2), signed(row.z), f"{number(100.0 * row.share, 1)} %",
            )
            for row in found.places
        ],
        "Noise is that of neighbouring blocks, from their second differences. z is the bias over its standard "
        "uncertainty, of noise and of how the cycles repeat.",
    )  # fmt: skip


def line_closure_table(found: LineDiagnosis) -> Table | None:
    """Root mean squares before and after on the judged cycles."""
    if found.closure is None:
        return None
    power = found.closure.power
    return formatted_table(
        "closure",
        f"Error of the power, {words.judged_words(found)}: root mean squares of samples.",
        (
            text_column("Channel"), number_column("Before", "line tension times speed, kW"),
            number_column("After", "with the causes, kW"),
            number_column("Noise", "white, kW"), number_column("Closed", "of the squares"),
            number_column("Interval", "95 %"),
        ),
        [
            (
                "winch power", *(significant(x * KILO, 3) for x in (power.before, power.after, power.noise)),
                share_words(found.closure.share), words.interval_words(found.closure),
            )
        ],
        "Closed: 1 − Σ after² ÷ Σ before². Of what exceeds the noise it is "
        f"{share_words(found.closure.beyond_noise)}. The interval resamples the cycles.",
    )  # fmt: skip


def sets_table(found: LineDiagnosis) -> Table | None:
    """The sets of suspects that predict best, and the single ones."""
    choice = found.choice
    ranked = sorted(choice.errors, key=choice.error)
    shown = ranked[:MOST_SETS] + [names for names in ranked[MOST_SETS:] if len(names) < 2]
    return formatted_table(
        "sets",
        f"Sets of suspects by the squared error that remains on held-out cycles: {len(shown)} of {len(ranked)}.",
        (
            text_column("Set"), number_column("Suspects"), number_column("Error", "of the gap"),
            text_column("As good", "as the best"),
            number_column("Probability"), text_column("Chosen"),
        ),
        [
            (
                set_words(names), f"{len(names)}", f"{number(100.0 * choice.error(names), 2)} %",
                "yes" if choice.as_good(names) else "no", probability_words(choice.probability[names]),
                "yes" if names == found.chosen else "",
            )
            for names in shown
        ],
        f"As good: within {number(100.0 * choice.tolerance / max(choice.gap, 1e-300), 2)} % of the minimum, the larger of "
        "one standard error over cycles and one per cent of the gap. The smallest of these is chosen.",
    )  # fmt: skip


def line_logs_table(found: LineDiagnosis) -> Table | None:
    """Every part of the campaign: its log, cycles and part in the diagnosis."""
    in_turn = found.closure is not None and found.closure.left_out_in_turn
    return formatted_table(
        "logs",
        "Logs of the campaign.",
        (
            text_column("Log"), number_column("Cycles"), text_column("Part"), number_column("Samples", "that count"),
            text_column("SHA-256"),
        ),
        [
            (
                part.run.name, f"{int(part.cycle.min())} to {int(part.cycle.max())}",
                "each cycle left out once" if in_turn else "withheld" if part.withheld else "in the fit",
                f"{part.here.size}", part.run.sha256 or "–",
            )
            for part in found.lines.parts
        ],
    )  # fmt: skip
