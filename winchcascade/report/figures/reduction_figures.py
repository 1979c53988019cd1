"""Figures of one reduction: a result in, a Figure out; units on every axis."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

import numpy as np

from winchcascade.core.cascade import Cascade
from winchcascade.core.run import Index, Signal
from winchcascade.reduction.bins import Bin, engaged, generator_speed
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.report.content import number_text
from winchcascade.report.figures.histories import (
    channels_drawn,
    draw_marks,
    end_of,
    mark_entries,
    mark_repaired,
    phase_marks,
    power_sources,
    repaired_spans,
    thinned,
    time_label,
)
from winchcascade.report.figures.style import (
    COLOURS,
    LineStyle,
    dots,
    evenly,
    label_panel,
    legend_above,
    line_entry,
    look_of,
    panel_figure,
    patch_entry,
    readable,
    shade_over_speed,
    wide_figure,
)
from winchcascade.report.glossary import STAGE_PLACES, tex
from winchcascade.report.wording import clock_zero, span_word

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DOTS = 1200
"""Samples of each power that are drawn over the generator's speed at most; of more, an even
selection.
"""

TREND_FROM = 6
"""With fewer cycles than this the table shows a drift as well."""

OVERLAID = 40
"""Cycles that are laid over each other at most; of more, an even selection."""

MARKED = 200
"""Cycles that have a marker each at most."""

OVERLAID_POINTS = 6000
"""Points of all overlaid cycles together in one panel, about."""


_WIDE = 0.35
"""Width of a bar of an energy flow, of which the bars are spread over 10."""

_TURN, _DROP = 0.38, -0.3
"""Where a loss turns down between two bars, as a share of the way, and how far it goes, over the
height of the first.
"""


def _stage_style(stage: str) -> LineStyle:
    """Colour and dashes of the power of a stage, and its symbol for the legend."""
    look = look_of(stage)
    return {"color": COLOURS[look.colour], "ls": look.dashes, "label": tex(f"power_{stage}")}


# ---------------------------------------------------------------------------- over time and speed
def power_streams(reduction: Reduction, powers: Mapping[str, Signal]) -> Figure | None:
    """Draw the powers of one cycle over time, and those of all payouts over speed (Fig. 6)."""
    if not powers or not reduction.cycles:
        return None
    figure, axes = panel_figure(2.75, 1, 1 + bool(reduction.bins))
    _one_cycle(axes[0], reduction, powers)
    entries = [
        line_entry(tex(f"power_{s}"), look_of(s).colour, ls=look_of(s).dashes) for s in powers
    ]
    entries += mark_entries(phase_marks(reduction, [representative(reduction)], 0.0))
    if reduction.bins:
        shaded = _over_speed(axes[1], reduction, powers)
        entries += [patch_entry("over rated speed", "over")] if shaded else []
    legend_above(figure, entries)
    return figure


def _one_cycle(ax: Axes, reduction: Reduction, powers: Mapping[str, Signal]) -> None:
    """Draw the powers of the representative cycle over time, its window bounded by dashed lines."""
    run, cycle, zero = reduction.run, representative(reduction), clock_zero(reduction.run)
    end = cycle.phases.haul_in[1] if cycle.phases.haul_in is not None else float(run.t[-1])
    part = slice(*np.searchsorted(run.t, (cycle.phases.onset - 1.0, end + 0.5)).tolist())
    short, unit = readable("W", *(x[part] for x in powers.values()))
    for stage, x in powers.items():
        t, (drawn,) = thinned(run.t[part] - zero, [x[part] * short])
        ax.plot(t, drawn, **_stage_style(stage))
    label_panel(ax, "a", f"Cycle {cycle.cycle}", x=time_label(run), y=f"Power ({unit})")
    ax.margins(x=0.0)
    draw_marks(ax, phase_marks(reduction, [cycle], zero))
    mark_repaired(ax, repaired_spans(run, power_sources(reduction, powers), zero))


def _over_speed(ax: Axes, reduction: Reduction, powers: Mapping[str, Signal]) -> bool:
    """Draw the powers of the payouts over generator speed, with their means in bins; whether
    speeds above rated are shaded.
    """
    rows, rpm = _driven(reduction)
    short, unit = readable("W", *(x[rows] for x in powers.values()))
    for stage, x in powers.items():
        dots(ax, rpm[rows], x[rows] * short, COLOURS[look_of(stage).colour])
        _means(ax, reduction.bins, stage, short, **_stage_style(stage))
    label_panel(
        ax,
        "b",
        f"{span_word(reduction).capitalize()}s, means",
        x="Generator speed (rpm)",
        y=f"Power ({unit})",
    )
    return _speeds(ax, reduction)


def _driven(reduction: Reduction) -> tuple[Index, Signal]:
    """Rows of the payouts of complete cycles in which the generator is driven, thinned, and its
    speed, (n,) [rpm].
    """
    run, rig, counted = reduction.run, reduction.rig, reduction.complete
    rows = np.flatnonzero(
        engaged(run, [c.phases for c in counted], [c.summary.payout.plateau for c in counted], rig)
    )
    signal, rpm = generator_speed(run, rig) or (run.t, 0.0)
    return rows[:: max(1, -(-rows.size // DOTS))], signal * rpm


def _means(ax: Axes, bins: Sequence[Bin], name: str, factor: float, **style: Any) -> None:
    """Draw the means of a quantity in bins of generator speed."""
    means = [
        (0.5 * (b.rpm_low + b.rpm_high), y * factor)
        for b in bins
        if (y := b.mean.get(name)) is not None
    ]
    ax.plot(*np.array(means).reshape(-1, 2).T, lw=1.3, **style)


def _speeds(ax: Axes, reduction: Reduction) -> bool:
    """Limit an axis to the speeds of the bins; whether those above the rated one are shaded."""
    ax.set_xlim(min(0.0, reduction.bins[0].rpm_low), reduction.bins[-1].rpm_high)
    rated = reduction.rig.generator.speed_rated
    return shade_over_speed(ax, None if rated is None else rated.value * 30.0 / np.pi)


def representative(reduction: Reduction) -> CycleResult:
    """The first complete cycle, as the paper shows it; the first of all where none is complete."""
    return (*reduction.complete, *reduction.cycles)[0]


# ----------------------------------------------------------------------------------- energy flows
def window_flow(reduction: Reduction, texts: Mapping[str, str] | None = None) -> Figure | None:
    """Draw where the line's mean energy goes in the window, from stage to stage; None for one that
    does not fall all the way.

    Heights are energies; what is lost or stored branches off.

    Parameters
    ----------
    texts : means as they are stated, by metric; with four digits if not given
    """
    from matplotlib.patches import Rectangle

    mean, said, cascade = (
        reduction.mean if reduction.rig.phases.repeats else reduction.total,
        texts or {},
        reduction.rig.cascade,
    )
    known = {
        stage: joule for stage in cascade.names if (joule := mean[f"energy_{stage}"]) is not None
    }
    stages, energies = list(known), list(known.values())
    if (
        len(known) < 2
        or energies[-1] <= 0
        or any(after > before for before, after in pairwise(energies))
    ):
        return None
    in_gas = reduction.rig.restoring.volume_gas is not None and stages[1] == "mech"
    stored = {"mech": " in the rotor", "line": " in the gas" * in_gas}
    figure = wide_figure(1.9)
    ax = figure.add_subplot()
    ax.set_axis_off()
    places = np.linspace(0.0, 10.0, len(known)).tolist()
    for k, (stage, joule) in enumerate(known.items()):
        colour = COLOURS[look_of(stage).colour]
        ax.add_patch(
            Rectangle(
                (places[k], 1.0 - joule / energies[0]), _WIDE, joule / energies[0], fc=colour, lw=0
            )
        )
        energy = f"{tex(f'energy_{stage}')} = {said.get(f'energy_{stage}') or number_text(joule)} J"
        side = "left" if k == 0 else "right" if k == len(known) - 1 else "center"
        at = places[k] + {"left": 0.0, "center": 0.5, "right": 1.0}[side] * _WIDE
        ax.text(
            at,
            1.05,
            f"{energy}\n{STAGE_PLACES.get(stage, stage)}",
            ha=side,
            va="bottom",
            fontsize=8.0,
        )
    ratios = {pair: name for name, pair in cascade.all_ratios.items()}
    for k, (stage, following) in enumerate(pairwise(stages)):
        eta = ratios.get((f"energy_{following}", f"energy_{stage}"), "")
        goes_on = (
            ""
            if mean.get(eta) is None
            else f"{tex(eta)} = {said.get(eta) or number_text(mean[eta], 3)}"
        )
        lost, height = energies[k] - energies[k + 1], energies[k + 1] / energies[0]
        decimals = 2 - math.floor(math.log10(abs(lost) or 1.0))
        share = f"{number_text(lost, decimals)} J, {100 * lost / energies[0]:.1f} % of {tex(f'energy_{stages[0]}')}"
        ends = places[k] + _WIDE, places[k + 1]
        _branch(ax, look_of(stage).colour, ends, (energies[k] / energies[0], height))
        ax.text(0.5 * sum(ends), 1.0 - 0.5 * height, goes_on, ha="center", va="center", fontsize=9)
        leaves = f"lost or stored{stored.get(stage, '')}:\n{share}"
        ax.text(0.5 * sum(ends), _DROP - 0.04, leaves, ha="center", va="top", fontsize=7.5)
    ax.set(xlim=(0.0, 10.0 + _WIDE), ylim=(_DROP - 0.4, 1.45))
    return figure


def _branch(ax: Axes, colour: str, ends: tuple[float, float], heights: tuple[float, float]) -> None:
    """Draw what goes on from one bar to the next as a band, and what leaves as another that
    turns down.
    """
    from matplotlib.patches import PathPatch, Rectangle
    from matplotlib.path import Path as Outline

    begin, end = ends
    ax.add_patch(
        Rectangle(
            (begin, 1.0 - heights[1]), end - begin, heights[1], fc=COLOURS[colour], alpha=0.28, lw=0
        )
    )
    low, high = 1.0 - heights[0], 1.0 - heights[1]
    turn, width = begin + _TURN * (end - begin), high - low
    points = [
        (begin, high), (turn, high), (turn + width, high), (turn + width, high - width), (turn + width, _DROP),
        (turn, _DROP), (turn, low), (begin, low), (begin, high),
    ]  # fmt: skip
    line, curve = Outline.LINETO, Outline.CURVE3
    codes = [Outline.MOVETO, line, curve, curve, line, line, line, line, Outline.CLOSEPOLY]
    ax.add_patch(PathPatch(Outline(points, codes), fc=COLOURS["loss"], lw=0))


# --------------------------------------------------------------------------------- cycle by cycle


def overlaid(
    reduction: Reduction, powers: Mapping[str, Signal], best: int | None, worst: int | None
) -> Figure | None:
    """Lay the cycles over each other on a clock that starts at each onset; best and worst are drawn
    on top.

    Parameters
    ----------
    best, worst : numbers of the cycles of the highest and the lowest efficiency, None where they
        are unknown
    """
    run, cycles = reduction.run, reduction.cycles
    wanted = [
        row
        for row in channels_drawn(run, reduction.rig)
        if row[0] in ("velocity", "force", "torque", "pressure")
    ]
    columns = [
        (title, unit, run.channels[name] * factor) for name, title, unit, factor in wanted[:3]
    ]
    columns += [
        (f"Power {tex(f'power_{s}')}", "W", powers[s])
        for s in ("gen", "mech", "line")
        if s in powers
    ][:1]
    if not cycles or not columns:
        return None
    figure, axes = panel_figure(
        0.45 + 1.55 * -(-len(columns) // 2), -(-len(columns) // 2), 2, share="x"
    )
    chosen = [c for c in evenly(cycles, OVERLAID) if c.cycle not in (best, worst)]
    chosen += [c for number in (worst, best) for c in cycles if c.cycle == number]
    entries = {}
    for k, (ax, (title, unit, x)) in enumerate(zip(axes, columns, strict=False)):
        short, unit = readable(unit, x)
        for c in chosen:
            part = slice(*np.searchsorted(run.t, (c.phases.onset - 1.0, end_of(c))).tolist())
            t, (drawn,) = thinned(
                run.t[part] - c.phases.onset,
                [x[part] * short],
                max(150, OVERLAID_POINTS // len(chosen)),
            )
            label, style = _overlaid_style(c, best, worst)
            entries[label] = ax.plot(t, drawn, **style)[0]
        ax.axvline(
            chosen[0].window.cutoff - chosen[0].window.onset, color=COLOURS["soft"], ls="--", lw=0.8
        )
        label_panel(
            ax,
            ascii_lowercase[k],
            title,
            unit=unit,
            x="Time since onset (s)" if k + 2 >= len(columns) else "",
        )
        ax.set_xlim(-1.0, max(min(end_of(c), float(run.t[-1])) - c.phases.onset for c in chosen))
        ax.tick_params(labelbottom=k + 2 >= len(columns))
    for ax in axes[len(columns) :]:
        ax.set_visible(False)
    if len(entries) > 1:
        legend_above(figure, [(line, label) for label, line in entries.items()])
    return figure


def _overlaid_style(c: CycleResult, best: int | None, worst: int | None) -> tuple[str, LineStyle]:
    """What the legend calls a cycle, and its line."""
    if c.cycle == best:
        return f"best, cycle {best}", {"color": COLOURS["line"], "lw": 1.1}
    if c.cycle == worst:
        return f"worst, cycle {worst}", {"color": COLOURS["mech"], "lw": 1.1, "ls": (0, (4, 1.2))}
    label = ("other cycles" if best else "complete") if c.complete else "incomplete"
    return label, {"color": COLOURS["soft"], "lw": 0.7, "ls": "-" if c.complete else ":"}


def stage_of(cascade: Cascade, metric: str) -> str:
    """Stage whose colour a metric has: that of an energy or a power, the first one for the whole
    cascade, else the one that delivers.
    """
    if metric == cascade.overall and len(cascade.stages) > 2:
        return cascade.names[0]
    return cascade.pairs[metric][1] if metric in cascade.ratios else metric.partition("_")[2]


def trend(reduction: Reduction) -> Figure | None:
    """Draw efficiencies and energies over the number of the cycle, so that a drift is seen; None
    for few cycles.
    """
    if len(reduction.complete) < TREND_FROM:
        return None
    cascade, mean = reduction.rig.cascade, reduction.mean
    groups = [
        (title, unit, known)
        for title, unit, names in (
            ("Efficiency", "1", cascade.ratios),
            ("Energy", "J", cascade.energies),
        )
        if (known := [name for name in names if mean[name] is not None])
    ]
    if not groups:
        return None
    figure, axes = panel_figure(0.4 + 1.6 * len(groups), len(groups), share="x")
    for ax, letter, (title, unit, names) in zip(axes, "ab", groups, strict=False):
        label_panel(ax, letter, title, unit=_trend(ax, reduction, names, unit))
    axes[-1].set_xlabel("Cycle")
    return figure


def _trend(ax: Axes, reduction: Reduction, names: Sequence[str], unit: str) -> str:
    """Draw metrics of one unit over the number of the complete cycle; gives the unit of the
    axis.
    """
    complete, cascade = reduction.complete, reduction.rig.cascade
    number = np.array([c.cycle for c in complete], dtype=float)
    columns = {name: np.array([c.metrics[name] for c in complete], dtype=float) for name in names}
    short, unit = readable(unit, *columns.values())
    for name, values in columns.items():
        look = look_of(stage_of(cascade, name))
        x, (y,) = thinned(number, [values * short])
        mark = look.mark if x.size <= MARKED else ""
        ax.plot(
            x, y, color=COLOURS[look.colour], lw=0.5, marker=mark, ms=2.2, mew=0, label=tex(name)
        )
    ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 1.0), markerscale=1.8)
    return unit
