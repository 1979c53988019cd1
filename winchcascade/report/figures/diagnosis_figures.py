"""Figures of a diagnosis: maps of the gap, one cycle over time, errors over speed; what the causes
cost, their numbers run by run, and the roll-off (Fig. 18).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.diagnosis_result import (
    Contribution,
    ContributionPart,
    DiagnosisResult,
    NamedCause,
)
from winchcascade.diagnosis.explain.figure_data import (
    SimulatedCycle,
    by_load,
    profile_of,
    worst_costs,
)
from winchcascade.diagnosis.explain.gap_map import STANDS_OUT
from winchcascade.diagnosis.fit.block_means import HAUL_IN, PAYOUT, PHASES
from winchcascade.diagnosis.fit.predict import CHANNELS
from winchcascade.diagnosis.stages.diagnose_stages import StageDiagnosis
from winchcascade.report.content import number_text
from winchcascade.report.diagnosis_names import (
    NAMES,
    baseline_words,
    phase_words,
    runs_with_number,
    shown_as,
    signed,
)
from winchcascade.report.figures.histories import (
    Curve,
    History,
    Mark,
    Panel,
    repaired_spans,
    thinned,
)
from winchcascade.report.figures.style import (
    COLOURS,
    NARROW,
    Dashes,
    Entry,
    LineStyle,
    broken,
    legend_above,
    line_entry,
    panel_figure,
    patch_entry,
)
from winchcascade.report.glossary import CHANNELS as TERMS
from winchcascade.report.glossary import tex, typeset, upper
from winchcascade.report.wording import load_words
from winchcascade.rig.parts import ROLLOFF_KNOTS
from winchcascade.rig.stages import STAGES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


AFTER = "with the fitted effects"
"""Name of the simulation with the causes in every legend."""

HOLLOW: LineStyle = {
    "ls": "none",
    "marker": "o",
    "ms": 3.2,
    "mew": 0.7,
    "mfc": "none",
    "color": COLOURS["mech"],
}
FILLED: LineStyle = {"ls": "none", "marker": "s", "ms": 3.0, "mew": 0.0, "color": COLOURS["gen"]}

MARKED = {"before": HOLLOW, "after": FILLED}
"""Marks of values before and after."""


def coloured(mark: LineStyle, colour: str) -> LineStyle:
    """The same mark in another colour."""
    found = mark.copy()
    found["color"] = COLOURS[colour]
    return found


DASHES: Dashes = (0, (4, 1.2))
"""Dashes of a line before the causes."""

BAND = 1.96
"""Half width of a band of 95 %, in standard deviations."""


def quantity_label(channel: str) -> str:
    """Name and unit of a channel for an axis."""
    return f"{upper(NAMES[channel])} ({typeset(TERMS[channel].unit)})"


# -------------------------------------------------------------------------------- maps of the gap
FULL = 20.0
"""Standard uncertainties at which a cell of the map has its full colour."""

STRONGEST, WEAKEST = 0.75, 0.18
"""Opacity of the full colour, under which its number can still be read, and of a cell that is
just significant.
"""

Cells = Mapping[tuple[str, str, int], float]
"""Numbers of standard uncertainties by channel or stage, phase and log."""


def gap_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each channel and phase (rows) at each load (columns) over its standard
    uncertainty.
    """
    names = {(c, p): f"{NAMES[c]}, {phase_words(p)}" for c in CHANNELS for p in PHASES}
    return _map(found, names, {(p.channel, p.phase, p.log): p.z for p in found.places})


def stage_map(found: ModelDiagnosis) -> Figure | None:
    """Draw the bias of each stage's output, from its own inputs, by phase (rows) and load
    (columns), as `gap_map`.
    """
    ends = {p.stage: p.channel for p in found.stages}
    names = {
        (s, p): f"{s}: {NAMES[ends[s]]}, {phase_words(p)}"
        for s in STAGES
        if s in ends
        for p in PHASES
    }
    return _map(found, names, {(p.stage, p.phase, p.log): p.z for p in found.stages})


def _map(
    found: ModelDiagnosis, names: Mapping[tuple[str, str], str], cells: Cells
) -> Figure | None:
    rows = {key[:2] for key in cells}
    if not rows:
        return None
    figure, (ax,) = panel_figure(0.3 + 0.235 * len(rows))
    _draw_map(ax, _by_load(found), names, cells)
    return figure


def _by_load(found: ModelDiagnosis) -> dict[int, str]:
    """Numbers of the logs in order of their loads, with the load, and which of its logs one is."""
    logs = by_load(found)
    loads = [load_words(found.data.logs[k].run.load) for k in logs]
    return {
        log: f"{load} ({loads[:k].count(load) + 1})" if loads.count(load) > 1 else load
        for k, (log, load) in enumerate(zip(logs, loads, strict=True))
    }


def _draw_map(
    ax: Axes, columns: Mapping[int, str], names: Mapping[tuple[str, str], str], cells: Cells
) -> None:
    """Draw the numbers as a matrix of colours, a column for each log; a row without a cell is
    left out.
    """
    rows = [row for row in names if any(key[:2] == row for key in cells)]
    for i, (kind, phase) in enumerate(rows):
        for j, log in enumerate(columns):
            if (kind, phase, log) in cells:
                _cell(ax, i, j, cells[kind, phase, log])
        if i and kind != rows[i - 1][0]:
            ax.axhline(i - 0.5, color=COLOURS["soft"], lw=0.6)
    ax.set_xticks(range(len(columns)), list(columns.values()))
    ax.set_yticks(range(len(rows)), [names[row] for row in rows])
    ax.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(rows) - 0.5, -0.5))
    ax.xaxis.tick_top()
    ax.tick_params(length=0)
    ax.grid(False)
    ax.spines[:].set_visible(False)


def _cell(ax: Axes, i: int, j: int, z: float) -> None:
    """Colour one cell by its sign and its size, and write its number."""
    beyond = abs(z) > STANDS_OUT
    colour = "hold" if not beyond else "above" if z > 0.0 else "below"
    alpha = max(STRONGEST * min(abs(z) / FULL, 1.0), WEAKEST) if beyond else 1.0
    ax.fill(
        [j - 0.48, j + 0.48, j + 0.48, j - 0.48], [i - 0.46, i - 0.46, i + 0.46, i + 0.46],
        color=COLOURS[colour], alpha=alpha, lw=0,
    )  # fmt: skip
    weight = "bold" if beyond else "normal"
    ax.text(
        j,
        i,
        signed(z),
        ha="center",
        va="center",
        fontsize=7.0,
        fontweight=weight,
        color=COLOURS["ink"],
    )


# -------------------------------------------------------------------------------------- over time
def cycle_history(found: ModelDiagnosis, item: SimulatedCycle, word: str) -> History:
    """The channels of one cycle as logged, by the model of the rig file, and with the fitted
    effects, later ones above.

    Parameters
    ----------
    word : what the logs are called
    """
    run = found.data.logs[item.log].run
    here, count = [name for name in CHANNELS if name in run.channels], len(item.sides)
    full = [
        side[:, CHANNELS.index(name)] * TERMS[name].factor for name in here for side in item.sides
    ]
    t, curves = thinned(item.t, full)
    looks = ((word, "ink", "-"), (baseline_words(found), "mech", DASHES), (AFTER, "gen", "-"))
    ends = [
        np.clip(span, t[0], t[-1]).tolist() for span in repaired_spans(run, CHANNELS, item.onset)
    ]
    repaired = [(begin, end) for begin, end in ends if begin < end]
    panels = []
    for k, name in enumerate(here):
        drawn = zip(looks, curves[k * count : (k + 1) * count], strict=False)
        lines = [Curve(label, curve, colour, dashes) for (label, colour, dashes), curve in drawn]
        panels.append(Panel(upper(NAMES[name]), typeset(TERMS[name].unit), lines, repaired))
    return History(
        t,
        "Time since the onset of the payout (s)",
        panels,
        [Mark("payout", "payout", [(0.0, item.payout_end)])],
    )


def _side_entries(found: ModelDiagnosis, colour: str = "") -> list[Entry]:
    """Entries of a legend for the simulation before and, where there are causes, after."""
    names = [baseline_words(found), *([AFTER] if found.causes else [])]
    marks = [coloured(mark, colour) if colour else mark for mark in MARKED.values()]
    return [line_entry(name, **mark) for name, mark in zip(names, marks, strict=False)]


# ---------------------------------------------------------------------------------------- Fig 18b
OVER_SPEED = ("torque", "vdc")
"""Channels whose errors are drawn over generator speed; others over themselves."""


def error_figure(found: ModelDiagnosis, table: pd.DataFrame, word: str) -> Figure | None:
    """Draw errors before and after with the band of noise: of current and channel of the gap
    (Fig. 18b).
    """
    own = found.where.worst.channel if found.where is not None else ""
    panels = [channel for channel in dict.fromkeys(("idc", own)) if channel in {*table.channel}]
    if not panels:
        return None
    figure, axes = panel_figure(2.6, 1, len(panels))
    for letter, ax, channel in zip("ab", axes, panels, strict=False):
        phases = (PAYOUT, HAUL_IN) if channel in ("force", "pressure") else (PAYOUT,)
        blocks, factor = (
            table[(table.channel == channel) & table.phase.isin(phases)],
            TERMS[channel].factor,
        )
        half = BAND * float(blocks.noise.median()) * factor
        ax.axhspan(-half, half, color=COLOURS["loss"], alpha=0.6, lw=0, zorder=0.5)
        at = blocks.rpm if channel in OVER_SPEED else blocks.logged * factor
        for side, mark in MARKED.items():
            ax.plot(at, (blocks.logged - blocks[side]) * factor, alpha=0.8, **mark)
        title = f"{upper(word)} − simulated, {NAMES[channel]}"
        ax.set_title(f"({letter}) {title}" if len(panels) > 1 else title)
        over = "Generator speed (rpm)" if channel in OVER_SPEED else quantity_label(channel)
        ax.set(xlabel=over, ylabel=f"Difference ({typeset(TERMS[channel].unit)})")
    legend_above(
        figure,
        [*_side_entries(found), patch_entry("noise, 95 % in the middle", "loss", alpha=0.6, lw=0)],
    )
    return figure


# ---------------------------------------------------------------------------------- the waterfall
BAR = 0.155
"""Height of a bar with its margin. [in]"""

COLOUR_OF = {"sensor": "extra", "entry": "load4"}
"""Colour of a part that costs no energy, by its kind."""


def part_name(found: ModelDiagnosis, part: ContributionPart) -> str:
    """Plain name of a part."""
    return part.kind.replace("_", " ") if part.effect is None else found.suspects[part.effect].label


def waterfall_figure(found: ModelDiagnosis, word: str) -> Figure | None:
    """Draw an efficiency from the model of the rig file to that of the runs, cause by cause, at the
    load of the largest gap.

    Parameters
    ----------
    word : what the logs are called
    """
    largest = worst_costs(found)
    if largest is None:
        return None
    figure, (ax,) = panel_figure(BAR * (len(largest.parts) + 2) + 0.6)
    figure.set_figwidth(NARROW)
    _waterfall(ax, largest)
    ax.set_title(load_words(largest.load))
    ax.set_xlabel(f"{tex(largest.metric)} (%)")
    names = [baseline_words(found), *(part_name(found, part) for part in largest.parts), word]
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.45, -0.55)
    return figure


def _extent(costs: Contribution) -> tuple[float, float]:
    """Smallest and largest efficiency that a waterfall passes, with the ends of its intervals.
    [%]
    """
    levels = [*accumulate((part.value for part in costs.parts), initial=costs.as_given)]
    ends = [
        level + end
        for level, part in zip(levels, costs.parts, strict=False)
        for end in (part.low, part.high)
    ]
    return min(costs.measured, *levels, *ends), max(costs.measured, *levels, *ends)


def _waterfall(ax: Axes, costs: Contribution) -> None:
    """Draw the waterfall of one load, from above, on an axis that is wider than its levels."""
    from matplotlib.ticker import MaxNLocator

    low, high = _extent(costs)
    middle, half = 0.5 * (low + high), max(0.85 * (high - low), 0.5)
    left, level, end = middle - half, costs.as_given, len(costs.parts) + 1
    for place, value in ((0, costs.as_given), (end, costs.measured)):
        ax.barh(place, value - left, left=left, height=0.66, color=COLOURS["line"], lw=0)
        ax.text(value, place, f" {number_text(value, 1)}", va="center", fontsize=6.8)
    for place, part in enumerate(costs.parts, 1):
        ax.plot([level, level], [place - 1.33, place + 0.33], color=COLOURS["soft"], lw=0.5)
        colour = COLOUR_OF.get(part.kind, "loss")
        if part.kind == "physical":
            colour = "below" if part.value < 0.0 else "above"
        ax.barh(place, part.value, left=level, height=0.66, color=COLOURS[colour], lw=0)
        ax.plot([level + part.low, level + part.high], [place, place], color=COLOURS["ink"], lw=0.8)
        right = level + max(part.value, 0.0, part.high)
        ax.text(
            right,
            place,
            f" {typeset(number_text(part.value, 1, signed=True))}",
            va="center",
            fontsize=6.8,
        )
        level += part.value
    ax.plot([level, level], [end - 1.33, end + 0.33], color=COLOURS["soft"], lw=0.5)
    ax.set_xlim(left, middle + 1.25 * half)
    ax.xaxis.set_major_locator(MaxNLocator(4, integer=True))
    ax.tick_params(axis="y", length=0)
    ax.grid(False, axis="y")


# ----------------------------------------------------------------------------------- the roll-off
def profile_figure(found: ModelDiagnosis) -> Figure | None:
    """Draw the roll-off of the back-EMF constant over the stator current with its band (Fig.
    18e).
    """
    profile = profile_of(found)
    if profile is None:
        return None
    current, left, low, high = profile
    figure, (ax,) = panel_figure(2.6)
    ax.fill_between(current, low, high, color=COLOURS["gen"], alpha=0.3, lw=0)
    ax.plot(current, left, color=COLOURS["gen"], lw=1.4)
    knots = np.array(ROLLOFF_KNOTS) * found.data.nominal.generator.i_rated
    knots = knots[knots <= current[-1]]
    ax.plot(knots, np.interp(knots, current, left), "s", ms=3.5, color=COLOURS["gen"])
    ax.axhline(1.0, color=COLOURS["ink"], lw=0.9, ls="--")
    entries = [
        line_entry("found, with knots", "gen", marker="s", ms=3.5, lw=1.4),
        patch_entry("95 % band", "gen", alpha=0.3, lw=0),
        line_entry("rig file", lw=0.9, ls="--"),
    ]
    rated = found.rig.generator.i_rated
    if rated is not None and rated.value <= current[-1]:
        ax.axvline(rated.value, color=COLOURS["soft"], lw=0.9, ls=":")
        entries.append(line_entry(f"rated, {rated.value:g} A", "soft", lw=0.9, ls=":"))
    ax.set(xlim=(0.0, current[-1] * 1.01), xlabel="Stator current (A rms)")
    ax.set_ylabel(r"$k_\mathrm{e}$ over its nominal value (1)")
    legend_above(figure, entries)
    return figure


# ------------------------------------------------------------------------------------- run by run
NAMED_RUNS = 8
"""Maximum number of runs of which each is named by its load."""

WIDE = 4.0
"""An interval that is longer than the median one by more than this factor leaves its panel, with an
arrow there."""

TITLE = 46
"""Characters of a line of a panel's title."""

UNSTEADY = {"order": "drifts", "load": "changes with the load", "scatter": "scatters"}
"""What the title of a panel states of a number that is not steady."""


def stability_figure(found: DiagnosisResult) -> Figure | None:
    """Draw the number of each cause in every run, one panel per cause, with the joint number and
    its interval.
    """
    causes = [cause for cause in found.causes if runs_with_number(cause)]
    if not causes:
        return None
    rows = -(-len(causes) // 2)
    figure, panels = panel_figure(0.4 + 1.7 * rows, rows, 2)
    for ax, cause in zip(panels, causes, strict=False):
        _run_by_run(ax, found, cause)
    for ax in panels[len(causes) :]:
        ax.set_axis_off()
    item = "cycle" if isinstance(found, StageDiagnosis) else "run"
    entries = [
        line_entry(f"one {item}, 95 %", "ink", marker="o", ms=3.5, lw=1.1),
        line_entry("joint fit", "gen", lw=1.2),
        patch_entry("its interval, 95 %", "gen", alpha=0.25, lw=0),
    ]
    legend_above(figure, entries)
    return figure


def _run_by_run(ax: Axes, found: DiagnosisResult, cause: NamedCause) -> None:
    """Draw the numbers of one cause over the runs."""
    how, joint, stability = (
        shown_as(found, cause),
        next(iter(cause.parameters.values())),
        cause.stability,
    )
    if stability is None:
        return
    table = np.array([(one.value, one.low, one.high) for one in stability.runs]) * how.factor
    at, (value, low, high) = np.arange(1, len(table) + 1), table.T
    band = (
        np.array([joint.low, joint.high] if joint.determined else [joint.value, joint.value])
        * how.factor
    )
    ax.axhspan(*band, color=COLOURS["gen"], alpha=0.25, lw=0)
    ax.axhline(joint.value * how.factor, color=COLOURS["gen"], lw=1.2)
    usual = high - low <= WIDE * np.nanmedian(high - low)
    ends = np.array([*low[usual], *high[usual], *band])
    pad = 0.08 * float(np.ptp(ends))
    bottom, top = float(ends.min() - pad), float(ends.max() + pad)
    ax.set(xlim=(0.5, len(table) + 0.5), ylim=(bottom, top))
    ax.vlines(at, np.maximum(low, bottom), np.minimum(high, top), color=COLOURS["ink"], lw=1.1)
    inside = (value >= bottom) & (value <= top)
    dots: LineStyle = {"ls": "none", "ms": 3.5, "color": COLOURS["ink"]}
    ax.plot(at[inside], value[inside], marker="o", **dots)
    for beyond, edge, arrow in ((high > top, top, "^"), (low < bottom, bottom, "v")):
        if beyond.any():
            ax.plot(at[beyond], np.full(np.count_nonzero(beyond), edge), marker=arrow, **dots)
    if isinstance(found, StageDiagnosis):
        ax.set_xlabel("Cycle, one after the other")
    elif len(table) <= NAMED_RUNS:
        loads = [load_words(run.load).replace("open circuit", "open") for run in found.runs]
        ax.set_xticks(at, loads, fontsize=6.5)
    else:
        ax.set_xlabel("Run, in the order of the campaign")
    marks = ", ".join(UNSTEADY[trend.along] for trend in stability.trends)
    title = f"{found.suspects[cause.effect].label}{f': {marks}' if marks else ''}"
    what = f"{how.what} ({how.unit})" if how.unit else how.what
    ax.set_title(
        f"{broken(title, TITLE)}\n{what}", fontsize=7.2, color=COLOURS["mech" if marks else "ink"]
    )
    ax.grid(False, axis="x")
