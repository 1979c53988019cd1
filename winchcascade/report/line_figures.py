"""Figures of the diagnosis of a winch without a model: its power in time, what each cause closes, and how it repeats."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from winchcascade.report.line_words import set_words
from winchcascade.report.model_figures import legend_above
from winchcascade.report.style import COLOURS, WIDTH, label_panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.run import Signal
    from winchcascade.diagnosis.line.line_data import Part
    from winchcascade.diagnosis.line.line_diagnose import LineDiagnosis
    from winchcascade.diagnosis.line.line_selection import Names

GIVEN, CAUSED = "force times speed", "with the causes"

MARKS = 2500
"""So many samples are drawn over each other at most."""

NEAR = 12.0
"""Length of the enlarged stretch about the largest gap. [s]"""

SHOWN = 2
"""So many cycles are drawn over time."""

KILO = 1e-3


class Course(NamedTuple):
    """The power of a stretch of one part over time, (k,) each: stamps [s], measured, as given and with the causes [W]."""

    t: Signal
    measured: Signal
    given: Signal
    caused: Signal | None


def course_of(part: Part, after: Signal | None) -> Course:
    """The power of a whole part."""
    given = part.run.channels["force"][part.here] * part.run.channels["velocity"][part.here]
    measured = given + part.gap
    return Course(part.run.t[part.here], measured, given, None if after is None else measured - after)


def _cut(course: Course, begin: float, end: float) -> Course:
    inside = (course.t >= begin) & (course.t <= end)
    return Course(*(x if x is None else x[inside] for x in course))  # type: ignore[arg-type]  # the stamps are always there


def history(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the power of two cycles over time, with what is left below, and the largest haul-in of them enlarged."""
    part = found.lines.judged[0]
    course = course_of(part, None if found.judged is None else found.judged.after[0])
    cycles = np.unique(part.cycle)
    middle = cycles[max(cycles.size // 2 - 1, 0) :][:SHOWN]
    own = np.isin(part.cycle, middle)
    shown = _cut(course, float(course.t[own][0]), float(course.t[own][-1]))
    start = float(shown.t[0])
    about = float(shown.t[int(np.argmax(np.abs(shown.measured - shown.given)))])
    near = _cut(course, about - 0.5 * NEAR, about + 0.5 * NEAR)
    height = 4.5
    figure = Figure((WIDTH, height))
    grid = figure.add_gridspec(2, 2, width_ratios=(2.1, 1.0), height_ratios=(1.7, 1.0), wspace=0.17, hspace=0.12)
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.5 / height, bottom=0.42 / height)
    for column, (some, title) in enumerate(((shown, "Two cycles"), (near, "Where they differ most"))):
        upper = figure.add_subplot(grid[0, column])
        lower = figure.add_subplot(grid[1, column], sharex=upper)
        _powers(upper, some, start)
        _rests(lower, some, start)
        upper.tick_params(labelbottom=False)
        title = title if middle.size > 1 or column else "One cycle"
        label_panel(upper, "ab"[column], f"{title} of {part.run.name}" if not column else title)
        lower.set_xlabel("Time (s)")
        if not column:
            upper.set_ylabel("Winch power (kW)")
            lower.set_ylabel(f"{word} − predicted (kW)")
    legend_above(figure, _entries(word, caused=course.caused is not None))
    return figure


def _powers(ax: Axes, one: Course, start: float) -> None:
    ax.plot(one.t - start, one.given * KILO, color=COLOURS["mech"], lw=0.9, ls=(0, (4, 1.2)), zorder=3)
    if one.caused is not None:
        ax.plot(one.t - start, one.caused * KILO, color=COLOURS["gen"], lw=1.3)
    ax.plot(one.t - start, one.measured * KILO, color=COLOURS["ink"], lw=0.7)
    ax.margins(x=0.01)


def _rests(ax: Axes, one: Course, start: float) -> None:
    ax.plot(one.t - start, (one.measured - one.given) * KILO, color=COLOURS["mech"], lw=0.9, ls=(0, (4, 1.2)))
    if one.caused is not None:
        ax.plot(one.t - start, (one.measured - one.caused) * KILO, color=COLOURS["gen"], lw=1.0)
    ax.axhline(0.0, color=COLOURS["soft"], lw=0.6)


def _entries(word: str, *, caused: bool) -> list[tuple[Any, str]]:
    found: list[tuple[Any, str]] = [
        (Line2D([], [], color=COLOURS["ink"], lw=0.9), word),
        (Line2D([], [], color=COLOURS["mech"], lw=1.0, ls=(0, (4, 1.2))), GIVEN),
    ]
    return [*found, (Line2D([], [], color=COLOURS["gen"], lw=1.3), CAUSED)] if caused else found


def scatter(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw measured over predicted power, as given and with the causes, at samples spread over the judged cycles."""
    if found.judged is None:
        return None
    courses = [course_of(part, after) for part, after in zip(found.judged.parts, found.judged.after, strict=True)]
    measured, given = (np.concatenate([getattr(c, name) for c in courses]) for name in ("measured", "given"))
    caused = measured - np.concatenate(found.judged.after)
    every = max(measured.size // MARKS, 1)
    height = 3.1
    figure = Figure((WIDTH, height))
    axes = figure.subplots(1, 2, sharex=True, sharey=True, gridspec_kw={"wspace": 0.08})
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.28 / height, bottom=0.42 / height)
    low, high = (float(np.quantile(measured, q)) * KILO for q in (0.0005, 0.9995))
    sides = ((given, "mech", GIVEN[:1].upper() + GIVEN[1:]), (caused, "gen", CAUSED[:1].upper() + CAUSED[1:]))
    for ax, letter, (predicted, colour, title) in zip(axes, "ab", sides, strict=True):
        ax.plot([low, high], [low, high], color=COLOURS["soft"], lw=0.7)
        ax.plot(
            predicted[::every] * KILO, measured[::every] * KILO, ".", ms=2.0, mew=0, color=COLOURS[colour], alpha=0.5
        )
        ax.set_xlim(low, high)
        ax.set_ylim(low, high)
        ax.set_xlabel("Predicted winch power (kW)")
        label_panel(ax, letter, title)
    axes[0].set_ylabel(f"{word[:1].upper() + word[1:]} winch power (kW)")
    return figure


def sets_of(found: LineDiagnosis) -> list[Names]:
    """Sets that tell what each cause takes: none, each cause alone, the chosen ones, and all suspects."""
    chosen = found.choice.chosen
    alone: list[Names] = [(cause.effect,) for cause in found.causes]
    return list(dict.fromkeys([(), *alone, chosen, found.lines.names]))


def closed_bars(found: LineDiagnosis) -> Figure | None:
    """Draw the squared error that sets of causes leave of cycles they did not know, over that without any."""
    sets = sets_of(found)
    height = 0.45 + 0.3 * len(sets)
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.3, right=0.985, top=1 - 0.06 / height, bottom=0.4 / height)
    for row, names in enumerate(sets):
        left = 100.0 * found.choice.error(names)
        ax.barh(row, left, height=0.6, color=COLOURS["gen" if names == found.choice.chosen else "loss"], lw=0)
        ax.text(left + 1.0, row, f"{left:.1f} %", va="center", fontsize=7.5)
    ax.set_yticks(range(len(sets)), [_label(found, names) for names in sets])
    ax.set_ylim(len(sets) - 0.45, -0.55)
    ax.set_xlim(0.0, 112.0)
    ax.grid(False, axis="y")
    ax.set_xlabel("Squared error left on cycles that the fit did not know (%)")
    return figure


def _label(found: LineDiagnosis, names: Names) -> str:
    if names == found.lines.names and len(names) > 2:
        return f"all {len(names)} suspects"
    return "no cause" if not names else set_words(names)


def by_cycle(found: LineDiagnosis, word: str) -> Figure | None:
    """Draw the root mean square of what is left in every judged cycle, as given and with the causes."""
    if found.judged is None:
        return None
    rows: list[tuple[int, float, float]] = []
    for part, after in zip(found.judged.parts, found.judged.after, strict=True):
        for cycle in np.unique(part.cycle):
            own = part.cycle == cycle
            rows.append(
                (len(rows) + 1, float(np.sqrt(np.mean(part.gap[own] ** 2))), float(np.sqrt(np.mean(after[own] ** 2))))
            )
    if len(rows) < 2:
        return None
    one = len({part.run.name for part in found.judged.parts}) == len(found.judged.parts) == 1
    first = int(found.judged.parts[0].cycle.min()) if one else 1
    number, before, left = (np.array(column) for column in zip(*rows, strict=True))
    height = 1.9
    figure = Figure((WIDTH, height))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.085, right=0.985, top=1 - 0.26 / height, bottom=0.42 / height)
    x = number + first - 1
    ax.vlines(x, left * KILO, before * KILO, color=COLOURS["loss"], lw=2.0)
    ax.plot(x, before * KILO, "o", ms=4.0, mfc=COLOURS["paper"], mec=COLOURS["mech"], mew=1.0)
    ax.plot(x, left * KILO, "s", ms=4.0, color=COLOURS["gen"])
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("Cycle" if one else "Cycle, one after the other")
    ax.set_ylabel("RMS error (kW)")
    ax.grid(False, axis="x")
    entries: list[tuple[Any, str]] = [
        (Line2D([], [], ls="none", marker="o", ms=4.0, mfc=COLOURS["paper"], mec=COLOURS["mech"]), f"{word} − {GIVEN}"),
        (Line2D([], [], ls="none", marker="s", ms=4.0, color=COLOURS["gen"]), f"{word} − predicted {CAUSED}"),
    ]
    legend_above(figure, entries)
    return figure
