"""Sections, tables and figures of the report of a winch without a model."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.causes import AS_GOOD
from winchcascade.diagnosis.evidence import CLEARLY
from winchcascade.diagnosis.line.line_data import CyclePart
from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
from winchcascade.diagnosis.line.line_energies import SMALL_ENERGY
from winchcascade.report import diagnosis_words as words
from winchcascade.report import sheet as content
from winchcascade.report.cause_words import LINE_MEANINGS, set_words
from winchcascade.report.diagnosis_figures import DASHES, FILLED, HOLLOW
from winchcascade.report.diagnosis_tables import where_section, which_section
from winchcascade.report.digits import number, significant, upper
from winchcascade.report.gap_words import (
    phase_words,
    probability_words,
    share_words,
    signed,
)
from winchcascade.report.sheet import number_column, text_column
from winchcascade.report.style import COLOURS, Margins, label_panel, legend_above, line_entry, panel_figure, wide_figure


def line_where(found: LineDiagnosis) -> content.Section:
    """Where the gap lies: the power over time, and its residual phase by phase."""
    word, causes, role = words.word_of(found), "", ""
    if found.closure is not None:
        causes = " and with the causes"
        role = (
            " Each by a fit without it." if found.closure.left_out_in_turn else " These cycles took no part in the fit."
        )
    return where_section(
        found,
        content.picture(
            power_history(found, word), "history",
            f"Power of the winch: {word}, line tension times speed{causes}; below, the residual.{role}",
            "Lines over time; root mean squares are in the table.",
        ),
        line_places_table(found),
    )  # fmt: skip


def line_which(found: LineDiagnosis) -> content.Section:
    """Causes, suspects and sets of them."""
    return which_section(
        found,
        content.picture(
            closed_bars(found), "closed",
            "Squared error with each cause alone and together (green: chosen), on held-out cycles.",
            "Bars of the squared error; the values are in the table of sets.",
        ),
        line_suspects_table(found),
        sets_table(found),
    )  # fmt: skip


def line_how_far(found: LineDiagnosis) -> content.Section:
    """How far the causes close the gap on the judged cycles."""
    word = words.word_of(found)
    return content.section(
        "how-far", "How far the gap closes",
        line_closure_table(found),
        energies_table(found),
        content.picture(
            power_scatter(found, word), "scatter",
            f"{upper(word)} over predicted power, samples spread over the judged cycles; on the line both "
            "agree.",
            "Clouds of marks about a diagonal, wide before and narrow after.",
        ),
        content.picture(
            power_by_cycle(found, word), "cycles", "Error of the power in every judged cycle.",
            "Pairs of marks for each cycle, before and after.",
        ),
    )  # fmt: skip


# ---------------------------------------------------------------------------------------------------------- the tables
MAX_SETS = 12
"""Sets of suspects that are listed; all are in the JSON."""


def line_suspects_table(found: LineDiagnosis) -> content.Table | None:
    """What each suspect is, and what it closes alone and is worth beside the others."""
    choice = found.choice

    def worth(name: str) -> float:
        """Error that one more or one less suspect beside the causes makes. [%]"""
        other = tuple(n for n in found.lines.names if (n in found.chosen) != (n == name))
        return (100.0 if name in found.chosen else -100.0) * (choice.error(other) - choice.error(found.chosen))

    return content.formatted_table(
        "suspects",
        "What each suspect closes alone, and beside the causes.",
        (
            text_column("Suspect"), text_column("What it is"), number_column("Closes alone", "of the squared error"),
            number_column("Beside the causes", "with it, or lost without it"),
        ),
        [
            (name, LINE_MEANINGS[name], share_words(1.0 - choice.error((name,))), f"{number(worth(name), 1)} %")
            for name in found.lines.names
        ],
        "Shares of the squared error on held-out cycles. A share below zero predicts worse than nothing.",
    )  # fmt: skip


def line_places_table(found: LineDiagnosis) -> content.Table | None:
    """The gap phase by phase."""
    return content.formatted_table(
        "places",
        f"Where the gap lies: {words.word_of(found)} power of the winch minus line tension times speed, phase by phase.",
        (
            text_column("Phase"), number_column("Blocks"), number_column("Bias", "kW"),
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


def line_closure_table(found: LineDiagnosis) -> content.Table | None:
    """Root mean squares before and after on the judged cycles."""
    if found.closure is None:
        return None
    power = found.closure.power
    return content.formatted_table(
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


def energies_table(found: LineDiagnosis) -> content.Table | None:
    """Energies of every judged cycle by phase: measured, predicted before and after."""
    return content.formatted_table(
        "energies",
        f"Energy of the winch by cycle and phase, {words.judged_words(found)}.",
        (
            text_column("Run"), number_column("Cycle"), text_column("Phase"), number_column("Measured", "kJ"),
            number_column("Before", "kJ"), number_column("After", "kJ"), number_column("u", "kJ"),
        ),
        [
            (
                one.run, f"{one.cycle}", phase_words(one.phase),
                *(significant(x * KILO, 4) for x in (one.measured, one.before, one.after)), significant(one.u * KILO, 2),
            )
            for one in found.energies
        ],
        "Before: line tension times speed. u: one standard uncertainty of the prediction, of noise, scatter of the cycles and "
        f"coefficients. A difference below {100.0 * SMALL_ENERGY:g} % has no effect on the verdict.",
    )  # fmt: skip


def sets_table(found: LineDiagnosis) -> content.Table | None:
    """The sets of suspects that predict best, and the single ones."""
    choice = found.choice
    ranked = sorted(choice.errors, key=lambda names: -choice.evidence[names])
    shown = ranked[:MAX_SETS] + [names for names in ranked[MAX_SETS:] if len(names) < 2]
    return content.formatted_table(
        "sets",
        f"Sets of suspects by their evidence, with the squared error on held-out cycles: {len(shown)} of {len(ranked)}.",
        (
            text_column("Set"), number_column("Suspects"), number_column("Error", "of the gap"),
            text_column("As good", "as the best"),
            number_column("Evidence", "against the chosen set"), number_column("Probability"), text_column("Chosen"),
        ),
        [
            (
                set_words(names), f"{len(names)}", f"{number(100.0 * choice.error(names), 2)} %",
                "yes" if choice.as_good(names) else "no",
                signed(choice.evidence[names] - choice.evidence[found.chosen]),
                probability_words(choice.probability[names]),
                "yes" if names == found.chosen else "",
            )
            for names in shown
        ],
        f"As good: the evidence is not lower by more than {AS_GOOD:g}. The smallest set that no larger one beats by "
        f"{CLEARLY:g} for each further suspect is chosen.",
    )  # fmt: skip


def line_logs_table(found: LineDiagnosis) -> content.Table | None:
    """Every part of the campaign: its log, cycles and part in the diagnosis."""
    in_turn = found.closure is not None and found.closure.left_out_in_turn
    return content.formatted_table(
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


# --------------------------------------------------------------------------------------------------------- the figures
GIVEN, CAUSED = "line tension times speed", "with the causes"

MARKS = 2500
"""Samples that are drawn over each other, at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""Cycles that are drawn over time."""

KILO = 1e-3


def line_power(part: CyclePart) -> Signal:
    """Line tension times speed at the samples that count, (n,) [W]."""
    return part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]


def power_history(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the power of two cycles over time, with the residual below, and the largest gap of them enlarged."""
    part = found.lines.judged[0]
    t, given = part.run.t[part.here], line_power(part)
    measured = given + part.gap
    caused = None if found.closure is None else measured - found.closure.after[0]
    cycles = np.unique(part.cycle)
    middle = cycles[max(cycles.size // 2 - 1, 0) :][:SHOWN]
    own = t[np.isin(part.cycle, middle)]
    shown = (t >= own[0]) & (t <= own[-1])
    about = t[shown][np.argmax(np.abs(part.gap[shown]))]
    near = (t >= about - 0.5 * NEAR) & (t <= about + 0.5 * NEAR)
    figure = wide_figure(4.5, Margins(left=0.085, head=0.5))
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0), wspace=0.17, hspace=0.12)
    title = f"{'Two cycles' if middle.size > 1 else 'One cycle'} of {part.run.name}"
    for column, (here, text) in enumerate(((shown, title), (near, "Where they differ most"))):
        above = figure.add_subplot(grid[0, column])
        below = figure.add_subplot(grid[1, column], sharex=above)
        for power, colour, style in ((given, "mech", {"lw": 0.9, "ls": DASHES}), (caused, "gen", {"lw": 1.3})):
            if power is not None:
                above.plot(t[here] - own[0], power[here] * KILO, color=COLOURS[colour], **style)
                below.plot(t[here] - own[0], (measured - power)[here] * KILO, color=COLOURS[colour], **style)
        above.plot(t[here] - own[0], measured[here] * KILO, color=COLOURS["ink"], lw=0.7)
        above.margins(x=0.01)
        above.tick_params(labelbottom=False)
        below.axhline(0.0, color=COLOURS["soft"], lw=0.6)
        below.set_xlabel("Time (s)")
        label_panel(above, "ab"[column], text)
    figure.axes[0].set_ylabel("Winch power (kW)")
    figure.axes[1].set_ylabel(f"{word} − predicted (kW)")
    with_causes = [line_entry(CAUSED, "gen", lw=1.3)] if caused is not None else []
    legend_above(figure, [line_entry(word, "ink", lw=0.9), line_entry(GIVEN, "mech", lw=1.0, ls=DASHES), *with_causes])
    return figure


def power_scatter(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, by the line alone and with the causes, at samples spread over the judged cycles."""
    if found.closure is None:
        return None
    given = np.concatenate([line_power(part) for part in found.closure.parts])
    measured = given + np.concatenate([part.gap for part in found.closure.parts])
    caused = measured - np.concatenate(found.closure.after)
    every = slice(None, None, max(measured.size // MARKS, 1))
    figure, axes = panel_figure(3.1, 1, 2, margins=Margins(left=0.085, head=0.28), gaps={"wspace": 0.08}, share="xy")
    ends = [float(np.quantile(measured, q)) * KILO for q in (0.0005, 0.9995)]
    sides = ((given, "mech", upper(GIVEN)), (caused, "gen", upper(CAUSED)))
    for ax, letter, (predicted, colour, title) in zip(axes, "ab", sides, strict=True):
        ax.plot(ends, ends, color=COLOURS["soft"], lw=0.7)
        ax.plot(predicted[every] * KILO, measured[every] * KILO, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5)
        ax.set(xlim=ends, ylim=ends, xlabel="Predicted winch power (kW)")
        label_panel(ax, letter, title)
    axes[0].set_ylabel(f"{upper(word)} winch power (kW)")
    return figure


def closed_bars(found: LineDiagnosis) -> Figure | None:
    """Draw the squared error of sets of causes on held-out cycles, over that without any."""
    sets, every = (
        list(dict.fromkeys([(), *((cause.effect,) for cause in found.causes), found.chosen, found.lines.names])),
        found.lines.names,
    )
    figure, (ax,) = panel_figure(0.45 + 0.3 * len(sets), margins=Margins(left=0.3, head=0.06, foot=0.4))
    for row, names in enumerate(sets):
        left = 100.0 * found.choice.error(names)
        ax.barh(row, left, height=0.6, color=COLOURS["gen" if names == found.chosen else "loss"], lw=0)
        ax.text(left + 1.0, row, f"{left:.1f} %", va="center", fontsize=7.5)
    ax.set(
        yticks=range(len(sets)), ylim=(len(sets) - 0.45, -0.55), xlim=(0.0, 112.0),
        yticklabels=[
            f"all {len(names)} suspects" if names == every and len(names) > 2 else set_words(names) if names else "no cause"
            for names in sets
        ],
        xlabel="Squared error on held-out cycles (%)",
    )  # fmt: skip
    ax.grid(False, axis="y")
    return figure


def power_by_cycle(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the root mean square of the error in every judged cycle, by the line alone and with the causes."""
    if found.closure is None:
        return None
    parts = found.closure.parts
    errors = [
        (part.gap[part.cycle == cycle], after[part.cycle == cycle])
        for part, after in zip(parts, found.closure.after, strict=True)
        for cycle in np.unique(part.cycle)
    ]
    if len(errors) < 2:
        return None
    before, left = np.array([[KILO * np.sqrt(np.mean(x**2)) for x in pair] for pair in errors]).T
    x = np.arange(len(errors)) + (int(parts[0].cycle.min()) if len(parts) == 1 else 1)
    figure, (ax,) = panel_figure(1.9, margins=Margins(left=0.085, head=0.26))
    ax.vlines(x, left, before, color=COLOURS["loss"], lw=2.0)
    ax.plot(x, before, ls="none", ms=4.0, mew=1.0, **HOLLOW)
    ax.plot(x, left, ls="none", ms=4.0, **FILLED)
    ax.set(
        ylim=(0.0, None), xlabel="Cycle" if len(parts) == 1 else "Cycle, one after the other", ylabel="RMS error (kW)",
    )  # fmt: skip
    ax.grid(False, axis="x")
    given = line_entry(f"{word} − {GIVEN}", "mech", ls="none", ms=4.0, **HOLLOW)
    legend_above(figure, [given, line_entry(f"{word} − predicted {CAUSED}", ls="none", ms=4.0, **FILLED)])
    return figure
