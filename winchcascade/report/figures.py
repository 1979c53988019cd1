"""Figures of one reduction: a result in, a Figure out; units on every axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from string import ascii_lowercase
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline

from winchcascade.core.cascade import Cascade
from winchcascade.core.run import Signal
from winchcascade.reduction.bins import engaged, generator_speed
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.reduction.uncertainty import Budget, budgeted
from winchcascade.report.digits import significant
from winchcascade.report.style import (
    COLOURS,
    LineStyle,
    Margins,
    broken,
    dots,
    evenly,
    is_narrow,
    label_panel,
    look_of,
    panel_figure,
    patch_entry,
    readable,
    wide_figure,
)
from winchcascade.report.time_histories import (
    REPAIRED,
    STRIP,
    end_of,
    envelope,
    key_above,
    mark_repaired,
    name_phases,
    name_within,
    panels_of,
    phase_entries,
    power_sources,
    raise_head,
    repaired_spans,
    room_for_names,
    shade_phases,
    time_label,
)
from winchcascade.report.wording import PLACES, by_sensor, clock_zero, span_word, tex

DRAWN = 3000
"""Points of a trace that are drawn at most: two for each pixel of a wide screen."""

SHADED_CYCLES = 60
"""With more cycles than this, shaded phases would be narrower than a pixel or two."""

DOTS = 1200
"""Samples of each power that are drawn over the generator's speed at most; of more, an even selection."""

TREND_FROM = 6
"""With fewer cycles than this the table shows a drift as well."""

OVERLAID = 40
"""Cycles that are laid over each other at most; of more, an even selection."""

OVERLAID_POINTS = 6000
"""Points of all overlaid cycles together in one panel, about."""

_BAR_STYLE = {
    "force cell": ("line", ""),
    "torque sensor": ("mech", "//"),
    "shaft power": ("mech", "//"),
    "Vdc": ("gen", ""),
    "Idc": ("gen", "\\\\"),
    "repeatability": ("loss", ""),
    "bridged gaps": ("soft", ".."),
}
"""Colour and hatching of each part of the variance."""

_TURN, _DROP = 0.38, -0.3
"""Where a loss turns down between two bars, as a share of the way, and how far it goes."""

_LINE_OF_WORDS = 18
"""Characters in a line of what leaves an energy flow in a narrow figure."""

_MARGINS = Margins(left=0.11)
"""Margins of the figures over time."""


def powers_of(reduction: Reduction) -> dict[str, Signal]:
    """Power stream of every stage that the log gives, (n,) [W]."""
    channels, r_drum = reduction.run.channels, reduction.rig.r_drum
    found = {stage.name: stage.watts(channels, r_drum) for stage in reduction.rig.cascade.stages}
    return {stage: watts for stage, watts in found.items() if watts is not None}


def _trace(ax: Axes, t: Signal, x: Signal, *, maximum: int = DRAWN, **style: Any) -> None:
    """Draw a signal over time by as many points as show its peaks."""
    rows = envelope(x, maximum)
    ax.plot(t[rows], x[rows], **style)


def _stage_style(stage: str) -> LineStyle:
    """Colour and dashes of the power of a stage, and its symbol for the legend."""
    look = look_of(stage)
    return {"color": COLOURS[look.colour], "ls": look.dashes, "label": tex(f"power_{stage}")}


def time_histories(reduction: Reduction, powers: dict[str, Signal]) -> Figure:
    """Draw every channel and the powers over the whole log, phases shaded, windows marked (the paper's Fig. 5)."""
    rows = history_rows(reduction, powers)
    margins = _MARGINS._replace(head=_MARGINS.head + STRIP)
    figure, axes = panel_figure(0.75 + STRIP + 0.98 * rows, rows, margins=margins, gaps={"hspace": 0.42}, share="x")
    draw_histories(axes, reduction, powers)
    figure.align_ylabels(axes)
    return figure


def history_rows(reduction: Reduction, powers: Mapping[str, Signal]) -> int:
    """Number of panels of the histories: a channel each, and one for the powers."""
    return len(panels_of(reduction.run, reduction.rig)) + bool(powers)


def draw_histories(axes: Sequence[Axes], reduction: Reduction, powers: Mapping[str, Signal]) -> None:
    """Draw the histories on as many panels as there are, the powers on the last; with a single panel the powers alone."""
    run, zero = reduction.run, clock_zero(reduction.run)
    t, rows = run.t - zero, len(axes)
    panels = panels_of(run, reduction.rig)[: rows - bool(powers)]
    for k, (ax, (name, title, unit, factor)) in enumerate(zip(axes, panels, strict=False)):
        x = run.channels[name]
        short, unit = readable(unit, x)
        _trace(ax, t, x * (factor * short), color=COLOURS["ink"], gid=f"trace-{name}")
        label_panel(ax, ascii_lowercase[k], title, unit=unit)
    if powers:
        short, unit = readable("W", *powers.values())
        for stage, x in powers.items():
            _trace(axes[-1], t, x * short, gid=f"trace-power_{stage}", **_stage_style(stage))
        label_panel(axes[-1], ascii_lowercase[rows - 1], "Power", unit=unit)
        axes[-1].legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
    axes[-1].set(xlabel=time_label(run), xlim=(t[0], t[-1]))
    shaded = len(reduction.cycles) <= SHADED_CYCLES
    sources = [(name,) for name, *_ in panels] + [power_sources(reduction, powers)] * bool(powers)
    repaired = [repaired_spans(run, source) for source in sources]
    for k, ax in enumerate(axes):
        ax.xaxis.set_gid(f"xaxis-{k}")
        if shaded:
            shade_phases(ax, k, reduction.cycles, zero)
        mark_repaired(ax, repaired[k], f"repaired-{k}", zero)
    if rows > 1:
        marked = [patch_entry(REPAIRED, "repaired")] if any(repaired) else []
        key_above(axes[0], [*(phase_entries(reduction) if shaded else []), *marked])
        if shaded and name_phases(axes[0], reduction, zero):
            raise_head(axes[0])


def power_streams(reduction: Reduction, powers: dict[str, Signal]) -> Figure | None:
    """Draw the powers of one cycle over time and of all payouts over generator speed, with binned means (Fig. 6)."""
    if not powers or not reduction.cycles:
        return None
    with_bins = bool(reduction.bins)
    margins = _MARGINS._replace(head=0.275, foot=0.44)
    figure, axes = panel_figure(2.75, 1, 1 + with_bins, margins=margins, gaps={"wspace": 0.27})
    one_cycle(axes[0], reduction, powers)
    if with_bins:
        over_speed(axes[1], reduction, powers)
    return figure


def one_cycle(ax: Axes, reduction: Reduction, powers: dict[str, Signal]) -> None:
    """Draw the powers of the representative cycle over time, its window bounded by dashed lines."""
    run, cycle, zero = reduction.run, representative(reduction), clock_zero(reduction.run)
    end = cycle.phases.haul_in[1] if cycle.phases.haul_in is not None else float(run.t[-1])
    part = slice(*np.searchsorted(run.t, (cycle.phases.onset - 1.0, end + 0.5)).tolist())
    short, unit = readable("W", *(x[part] for x in powers.values()))
    for stage, x in powers.items():
        _trace(ax, run.t[part] - zero, x[part] * short, **_stage_style(stage))
    label_panel(ax, "a", f"Cycle {cycle.cycle}", x=time_label(run), y=f"Power ({unit})")
    share = room_for_names(ax)
    shade_phases(ax, 0, [cycle], zero, top=1.0 - 0.5 * share)
    mark_repaired(ax, repaired_spans(run, power_sources(reduction, powers)), "repaired", zero)
    name_within(ax, reduction, cycle, zero, share)
    ax.legend(
        loc="lower right", ncols=3, bbox_to_anchor=(1.01, 1.0), borderaxespad=0.1, columnspacing=0.8, handlelength=1.9
    )


def over_speed(ax: Axes, reduction: Reduction, powers: dict[str, Signal]) -> None:
    """Draw the powers of the payouts over generator speed, with their means in bins."""
    run, rig, bins, counted = reduction.run, reduction.rig, reduction.bins, reduction.complete
    rows = np.flatnonzero(engaged(run, [c.phases for c in counted], [c.summary.payout.plateau for c in counted], rig))
    rows = rows[:: max(1, -(-rows.size // DOTS))]
    signal, rpm = generator_speed(run, rig) or (run.t, 0.0)
    speed = signal[rows] * rpm
    rated, highest = rig.generator.speed_rated, bins[-1].rpm_high
    if rated is not None and rated.value * 30.0 / np.pi < highest:
        ax.axvspan(rated.value * 30.0 / np.pi, highest, color=COLOURS["over"], lw=0)
        ax.text(
            highest, 0.01, "over rated speed ", transform=ax.get_xaxis_transform(), ha="right", va="bottom", fontsize=7,
            color=COLOURS["soft"],
        )  # fmt: skip
    short, unit = readable("W", *(x[rows] for x in powers.values()))
    for stage, x in powers.items():
        dots(ax, speed, x[rows] * short, COLOURS[look_of(stage).colour])
        means = [(0.5 * (b.rpm_low + b.rpm_high), y * short) for b in bins if (y := b.power.get(stage)) is not None]
        ax.plot(*np.array(means).reshape(-1, 2).T, lw=1.3, **_stage_style(stage))
    ax.set_xlim(min(0.0, bins[0].rpm_low), highest)
    label_panel(
        ax,
        "b",
        f"{span_word(reduction).capitalize()}s; lines: means in bins of {rig.thresholds.rpm_bin:g} rpm",
        x="Generator speed (rpm)",
        y=f"Power ({unit})",
    )
    ax.legend(loc="upper left")


def representative(reduction: Reduction) -> CycleResult:
    """The first complete cycle, as the paper shows it; the first of all where none is complete."""
    return (*reduction.complete, *reduction.cycles)[0]


class _Step(NamedTuple):
    """One bar of an energy flow: its metric and its stage, where it is, and what leaves before the next bar.

    `leaving` is the metric of what leaves, where that is not the difference from the next bar.
    """

    metric: str
    stage: str
    where: str
    leaves: str = ""
    leaving: str = ""


class _Flow(NamedTuple):
    """One bar of an energy flow: its energy [J] and colour, text above it, and what leaves and what goes on behind it."""

    joule: float
    colour: str
    name: str
    leaves: str = ""
    goes_on: str = ""


def window_flow(reduction: Reduction, texts: Mapping[str, str] | None = None) -> Figure | None:
    """Draw where the line's mean energy goes in the window, from stage to stage; None where it is no cascade.

    Heights are energies; what is lost or stored branches off.

    Parameters
    ----------
    texts : means as they are stated, by metric; with four digits if not given
    """
    stored = {"mech": " in the rotor", "line": " in the gas" if reduction.rig.restoring.volume_gas is not None else ""}
    given = [stage for stage in reduction.rig.cascade.names if reduction.mean[f"energy_{stage}"] is not None]
    stored["line"] *= given[1:2] == ["mech"]
    steps = [
        _Step(f"energy_{s}", look_of(s).colour, PLACES.get(s, s), f"lost or stored{stored.get(s, '')}") for s in given
    ]
    return _flow_figure(_flow_of(reduction, steps, texts or {}))


def cycle_flow(reduction: Reduction, texts: Mapping[str, str] | None = None) -> Figure | None:
    """Draw where the line's mean energy goes from onset to next onset, as `window_flow` does."""
    steps = [
        _Step("energy_payout", "line", "line, payout", "returned in haul-in", "energy_returned"),
        _Step("energy_net", "line", "line, net", "lost"),
        _Step("energy_gen_cycle", "gen", "DC link, whole cycle"),
    ]
    return _flow_figure(_flow_of(reduction, steps, texts or {}))


def _flow_figure(flow: Sequence[_Flow]) -> Figure | None:
    """A flow from left to right, None for one that does not fall all the way."""
    if len(flow) < 2 or flow[-1].joule <= 0 or any(b.joule > a.joule for a, b in pairwise(flow)):
        return None
    lines = max(item.leaves.count("\n") for item in flow)
    figure = wide_figure(1.75 + 0.12 * max(lines - 1, 0))
    ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    _draw_flow(ax, flow, lowest=-0.62 - 0.12 * max(lines - 1, 0))
    return figure


def _flow_of(reduction: Reduction, steps: Sequence[_Step], texts: Mapping[str, str]) -> list[_Flow]:
    """Bars of the steps up to the first that has no mean energy; a loss is a share of the first bar."""
    apart = "\n" if len(steps) > 3 or is_narrow() else " "
    ratios = reduction.rig.cascade.all_ratios
    mean = reduction.mean if reduction.rig.phases.repeats else reduction.total
    flow: list[_Flow] = []
    for step, following in zip(steps, (*steps[1:], None), strict=False):
        joule = mean[step.metric]
        if joule is None:
            break
        after = None if following is None else mean[following.metric]
        leaves = goes_on = ""
        if following is not None and after is not None:
            whole = flow[0].joule if flow else joule
            lost = mean.get(step.leaving) or joule - after
            words = broken(step.leaves, _LINE_OF_WORDS) if is_narrow() else step.leaves
            leaves = f"{words}:{apart}{significant(lost)} J, {100 * lost / whole:.1f} % of {tex(steps[0].metric)}"
            eta = next((n for n, pair in ratios.items() if pair == (following.metric, step.metric)), "")
            goes_on = "" if (value := mean.get(eta)) is None else f"{tex(eta)} = {value:.3f}"
        flow.append(
            _Flow(
                joule,
                step.stage,
                f"{tex(step.metric)} = {texts.get(step.metric) or significant(joule, 4)} J\n{step.where}",
                leaves,
                goes_on,
            )
        )
    return flow


def _draw_flow(ax: Axes, flow: Sequence[_Flow], lowest: float) -> None:
    """Draw bars of energy from left to right, with bands between them and what leaves turning down.

    Parameters
    ----------
    lowest : lower end of the panel, over the height of the first bar
    """
    top, bar, size = 1.0, 0.35, 7.5 if is_narrow() else 8.5
    heights = [item.joule / flow[0].joule for item in flow]
    at = np.linspace(0.0, 10.0, len(flow))
    for k, (x, h, item) in enumerate(zip(at, heights, flow, strict=True)):
        ax.add_patch(Rectangle((x, top - h), bar, h, fc=COLOURS[item.colour], lw=0))
        side = "left" if k == 0 else "right" if k == len(flow) - 1 else "center"
        ax.text(x + bar / 2, top + 0.05, item.name, ha=side, va="bottom", fontsize=size)
        if k + 1 == len(flow):
            continue
        begin, end, after = x + bar, at[k + 1], heights[k + 1]
        ax.add_patch(Rectangle((begin, top - after), end - begin, after, fc=COLOURS[item.colour], alpha=0.28, lw=0))
        ax.add_patch(_leaving(begin, begin + _TURN * (end - begin), top - h, top - after))
        ax.text((begin + end) / 2, top - after / 2, item.goes_on, ha="center", va="center", fontsize=9)
        turn = begin + _TURN * (end - begin) + (h - after) / 2
        ax.text(turn, _DROP - 0.04, item.leaves, ha="center", va="top", fontsize=size - 0.5)
    ax.set(xlim=(-0.9, 11.2), ylim=(lowest, 1.42))


def _leaving(begin: float, turn: float, low: float, high: float) -> PathPatch:
    """The band of what leaves: from a bar to where it turns down."""
    width = high - low
    points = [
        (begin, high), (turn, high), (turn + width, high), (turn + width, high - width), (turn + width, _DROP),
        (turn, _DROP), (turn, low), (begin, low), (begin, high),
    ]  # fmt: skip
    line, curve = Outline.LINETO, Outline.CURVE3
    codes = [Outline.MOVETO, line, curve, curve, line, line, line, line, Outline.CLOSEPOLY]
    return PathPatch(Outline(points, codes), fc=COLOURS["loss"], lw=0)


def uncertainty_bars(known: Budget) -> Figure | None:
    """Draw which sensor makes which share of the variance of each mean."""
    metrics = [m for m in budgeted(known.mean) if known.mean[m]]
    parts = {m: by_sensor(known, m) for m in metrics}
    names = sorted({n for p in parts.values() for n in p}, key=lambda n: (n == "repeatability", n))
    if not names:
        return None
    figure, (ax,) = panel_figure(0.87 + 0.27 * len(metrics), margins=Margins(left=0.08, head=0.38, foot=0.55))
    left = np.zeros(len(metrics))
    rows = np.arange(len(metrics))[::-1]
    for name in names:
        share = np.array([100.0 * parts[m].get(name, 0.0) for m in metrics])
        colour, hatch = _BAR_STYLE.get(name, ("extra", "xx"))
        ax.barh(
            rows, share, left=left, height=0.66, fc=COLOURS[colour], hatch=hatch, ec=COLOURS["paper"], lw=0.6,
            label=name,
        )  # fmt: skip
        for row, begin, width in zip(rows, left, share, strict=True):
            if width >= 9.0:
                ax.text(
                    begin + width / 2, row, f"{width:.0f} %", ha="center", va="center", fontsize=7.5,
                    bbox={"boxstyle": "round,pad=0.15", "fc": COLOURS["paper"], "lw": 0},
                )  # fmt: skip
        left += share
    ax.set_yticks(rows, [tex(m) for m in metrics])
    ax.set(xlim=(0, 100), xlabel="Share of the variance of the mean (%)")
    ax.grid(axis="y", visible=False)
    ax.legend(loc="lower right", ncols=len(names), bbox_to_anchor=(1.0, 1.0), handlelength=1.4, columnspacing=1.2)
    return figure


def overlaid(reduction: Reduction, powers: dict[str, Signal], best: int | None, worst: int | None) -> Figure | None:
    """Lay the cycles over each other on a clock that starts at each onset; best and worst are drawn on top.

    Parameters
    ----------
    best, worst : numbers of the cycles of the highest and the lowest efficiency, None where they are unknown
    """
    run, cycles = reduction.run, reduction.cycles
    names = [n for n in ("velocity", "force", "torque", "pressure") if n in run.channels][:3]
    columns = [
        (title, unit, run.channels[n] * factor)
        for n, title, unit, factor in panels_of(run, reduction.rig)
        if n in names
    ]
    columns += [(f"Power {tex(f'power_{s}')}", "W", powers[s]) for s in ("gen", "mech", "line") if s in powers][:1]
    if not cycles or not columns:
        return None
    rows, margins = -(-len(columns) // 2), _MARGINS._replace(head=0.42)
    gaps = {"hspace": 0.36, "wspace": 0.24}
    figure, axes = panel_figure(0.5 + 1.55 * rows, rows, 2, margins=margins, gaps=gaps, share="x")
    chosen = [c for c in evenly(cycles, OVERLAID) if c.cycle not in (best, worst)]
    chosen += [c for number in (worst, best) for c in cycles if c.cycle == number]
    parts = [(c, slice(*np.searchsorted(run.t, (c.phases.onset - 1.0, end_of(c))).tolist())) for c in chosen]
    longest = max(min(end_of(c), float(run.t[-1])) - c.phases.onset for c in chosen)
    for k, (ax, (title, unit, x)) in enumerate(zip(axes, columns, strict=False)):
        short, unit = readable(unit, x)
        for c, part in parts:
            style, maximum = _overlaid_style(c, best, worst), max(150, OVERLAID_POINTS // len(chosen))
            _trace(ax, run.t[part] - c.phases.onset, x[part] * short, maximum=maximum, **style)
        ax.axvline(chosen[0].window.cutoff - chosen[0].window.onset, color=COLOURS["soft"], ls="--", lw=0.8)
        label_panel(ax, ascii_lowercase[k], title, unit=unit, x="Time since onset (s)" if k + 2 >= len(columns) else "")
        ax.set_xlim(-1.0, longest)
        ax.tick_params(labelbottom=k + 2 >= len(columns))
    for ax in axes[len(columns) :]:
        ax.set_visible(False)
    handles, labels = axes[0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if len(named) > 1:
        figure.legend(named.values(), named.keys(), loc="upper right", ncols=len(named), bbox_to_anchor=(0.99, 1.0))
    return figure


def _overlaid_style(c: CycleResult, best: int | None, worst: int | None) -> LineStyle:
    if c.cycle == best:
        return {"color": COLOURS["line"], "lw": 1.1, "label": f"best, cycle {best}"}
    if c.cycle == worst:
        return {"color": COLOURS["mech"], "lw": 1.1, "ls": (0, (4, 1.2)), "label": f"worst, cycle {worst}"}
    label = ("other cycles" if best else "complete") if c.complete else "incomplete"
    return {"color": COLOURS["soft"], "lw": 0.7, "ls": "-" if c.complete else ":", "label": label}


def stage_of(cascade: Cascade, metric: str) -> str:
    """Stage whose colour a metric has: that of an energy or a power, the first one for the whole cascade, else the one that
    delivers.
    """
    if metric == cascade.overall and len(cascade.stages) > 2:
        return cascade.names[0]
    return cascade.between(metric)[1] if metric in cascade.ratios else metric.partition("_")[2]


def trend(reduction: Reduction) -> Figure | None:
    """Draw efficiencies and energies over the number of the cycle, so that a drift is seen; None for few cycles."""
    complete = reduction.complete
    if len(complete) < TREND_FROM:
        return None
    energies = [m for m in reduction.rig.cascade.energies if reduction.mean[m] is not None]
    etas = known_ratios(reduction)
    groups = [row for row in (("Efficiency", "1", etas), ("Energy", "J", energies)) if row[2]]
    if not groups:
        return None
    margins = _MARGINS._replace(head=0.25)
    figure, axes = panel_figure(0.55 + 1.5 * len(groups), len(groups), margins=margins, gaps={"hspace": 0.3}, share="x")
    for k, (ax, (title, unit, names)) in enumerate(zip(axes, groups, strict=True)):
        unit = trend_panel(ax, reduction, names, unit)
        label_panel(ax, "ab"[k], title, unit=unit)
    axes[-1].set_xlabel("Cycle")
    return figure


def known_ratios(reduction: Reduction) -> list[str]:
    """Efficiencies that the log gives."""
    return [m for m in reduction.rig.cascade.ratios if reduction.mean[m] is not None]


def trend_panel(ax: Axes, reduction: Reduction, names: Sequence[str], unit: str) -> str:
    """Draw metrics of one unit over the number of the complete cycle; gives the unit of the axis."""
    complete, cascade = reduction.complete, reduction.rig.cascade
    number = np.array([c.cycle for c in complete], dtype=float)
    columns = {name: np.array([c.metrics[name] for c in complete], dtype=float) for name in names}
    short, unit = readable(unit, *columns.values())
    for name, values in columns.items():
        rows = envelope(values, DRAWN // 2)
        x, y, few = number[rows], values[rows] * short, len(rows) <= 200
        look = look_of(stage_of(cascade, name))
        colour = COLOURS[look.colour]
        ax.plot(x, y, color=colour, lw=0.5, alpha=0.5)
        mark: LineStyle = {"ls": "none", "marker": look.mark, "ms": 2.2, "mew": 0, "color": colour}
        ax.plot(x if few else [], y if few else [], label=tex(name), **mark)
        if not few:
            dots(ax, x, y, colour)
    ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0, markerscale=1.8)
    return unit
