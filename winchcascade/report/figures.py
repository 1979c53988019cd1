"""Figures of one reduction: a result in, a Figure out; units on every axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path as Outline

from winchcascade.reduction.bins import engaged
from winchcascade.reduction.efficiency import ALL_METRICS, RATIOS
from winchcascade.reduction.energies import STAGES, power
from winchcascade.report.digits import significant
from winchcascade.report.style import COLOURS, STAGE_STYLE, WIDTH, label_panel
from winchcascade.report.traces import PANELS, clock_zero, envelope, time_label
from winchcascade.report.wording import by_sensor

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from winchcascade.core.rig_file import Rig
    from winchcascade.core.run import Run, Signal
    from winchcascade.reduction.reduction_result import CycleResult, Reduction
    from winchcascade.reduction.uncertainty import Budget


DRAWN = 3000
"""Points of a trace that are drawn at most: two for each pixel of a wide screen."""

SHADED_CYCLES = 60
"""With more cycles than this, shaded phases would be narrower than a pixel or two."""

DOTS = 1200
"""Samples of each power that are drawn over the generator's speed at most; of more, an even selection."""

TEX = {"line": r"$P_\mathrm{line}$", "mech": r"$P_\mathrm{mech}$", "gen": r"$P_\mathrm{gen}$"}
_ENERGY_TEX = {"line": r"$E_\mathrm{line}$", "mech": r"$E_\mathrm{mech}$", "gen": r"$E_\mathrm{gen}$"}
_CYCLE_TEX = {
    "energy_payout": r"$E_\mathrm{payout}$",
    "energy_net": r"$E_\mathrm{net}$",
    "energy_gen_cycle": r"$E_\mathrm{gen}$",
}
_STAGE_WORDS = {"line": "line", "mech": "shaft", "gen": "DC link"}
ETA_TEX = {
    "eta_trans": r"$\eta_\mathrm{trans}$",
    "eta_gen": r"$\eta_\mathrm{gen}$",
    "eta_pto": r"$\eta_\mathrm{pto}$",
    "eta_net": r"$\eta_\mathrm{net}$",
    "energy_line": _ENERGY_TEX["line"],
    "energy_mech": _ENERGY_TEX["mech"],
    "energy_gen": _ENERGY_TEX["gen"],
}


def readable(unit: str, *signals: Signal) -> tuple[float, str]:
    """Factor and unit that keep the numbers of an axis short: thousands from 10 000 on."""
    peak = max((float(np.max(np.abs(x))) for x in signals if x.size), default=0.0)
    return (1e-3, f"k{unit}") if unit in ("N", "W", "J") and peak >= 1e4 else (1.0, unit)


def powers_of(reduction: Reduction) -> dict[str, Signal]:
    """Power stream of every stage that the log gives, (n,) [W]."""
    found = {stage: power(reduction.run.channels, stage, reduction.rig.r_drum) for stage in STAGES}
    return {stage: x for stage, x in found.items() if x is not None}


def time_histories(reduction: Reduction, powers: dict[str, Signal]) -> Figure:
    """Draw every channel and the powers over the whole log, phases shaded, windows marked (the paper's Fig. 5)."""
    run, zero = reduction.run, clock_zero(reduction.run)
    panels = [panel for panel in PANELS if panel[0] in run.channels]
    rows = len(panels) + bool(powers)
    height = 0.75 + 0.98 * rows
    figure = Figure((WIDTH, height))
    axes: list[Axes] = list(figure.subplots(rows, 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.42})[:, 0])
    figure.subplots_adjust(left=0.095, right=0.985, top=1 - 0.3 / height, bottom=0.42 / height)
    for k, (ax, (name, title, unit, factor)) in enumerate(zip(axes, panels, strict=False)):
        x = run.channels[name]
        rows_drawn = envelope(x, DRAWN)
        short, unit = readable(unit, x)
        ax.plot(run.t[rows_drawn] - zero, x[rows_drawn] * factor * short, color=COLOURS["ink"], gid=f"trace-{name}")
        label_panel(ax, "abcdefgh"[k], title)
        ax.set_ylabel(unit)
    if powers:
        ax = axes[-1]
        short, unit = readable("W", *powers.values())
        for stage, x in powers.items():
            rows_drawn = envelope(x, DRAWN)
            ax.plot(
                run.t[rows_drawn] - zero, x[rows_drawn] * short, color=COLOURS[stage], ls=STAGE_STYLE[stage], label=TEX[stage],
                gid=f"trace-power_{stage}",
            )  # fmt: skip
        label_panel(ax, "abcdefgh"[rows - 1], "Power")
        ax.set_ylabel(unit)
        ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
    axes[-1].set_xlabel(time_label(run))
    axes[-1].set_xlim(run.t[0] - zero, run.t[-1] - zero)
    for k, ax in enumerate(axes):
        ax.xaxis.set_gid(f"xaxis-{k}")
        _shade_phases(ax, k, reduction.cycles, zero)
    _phase_key(axes[0], reduction.cycles)
    figure.align_ylabels(axes)
    return figure


def _shade_phases(ax: Axes, panel: int, cycles: Sequence[CycleResult], zero: float) -> None:
    """Shade payouts and holds, and bound the windows by dashed lines."""
    if len(cycles) > SHADED_CYCLES:
        return
    for c in cycles:
        spans = [("payout", (c.phases.onset, c.phases.payout_end)), ("hold", c.phases.hold)]
        for phase, span in spans:
            if span is not None:
                ax.axvspan(
                    span[0] - zero, span[1] - zero, color=COLOURS[phase], lw=0, gid=f"span-{c.cycle}-{phase}-{panel}"
                )
        style: Any = "--" if c.complete else ":"
        for end, edge in (("onset", c.window.onset), ("cutoff", c.window.cutoff)):
            ax.axvline(edge - zero, color=COLOURS["soft"], ls=style, lw=0.7, gid=f"edge-{c.cycle}-{end}-{panel}")


def _phase_key(ax: Axes, cycles: Sequence[CycleResult]) -> None:
    """Say above the panels what the shades and the dashed lines are."""
    if len(cycles) > SHADED_CYCLES:
        return
    entries = [
        Rectangle((0, 0), 1, 1, fc=COLOURS["payout"], ec=COLOURS["soft"], lw=0.4),
        Rectangle((0, 0), 1, 1, fc=COLOURS["hold"], ec=COLOURS["soft"], lw=0.4),
        ax.plot([], [], ls="--", lw=0.8, color=COLOURS["soft"])[0],
    ]
    names = ["payout", "hold", "integration window"]
    if any(not c.complete for c in cycles):
        entries.append(ax.plot([], [], ls=":", lw=0.8, color=COLOURS["soft"])[0])
        names.append("of an incomplete cycle")
    ax.legend(
        entries,
        names,
        loc="lower right",
        ncols=len(names),
        bbox_to_anchor=(1.0, 1.0),
        borderaxespad=0.1,
        columnspacing=1.2,
    )


def power_streams(reduction: Reduction, powers: dict[str, Signal]) -> Figure | None:
    """Draw the powers of one cycle over time and of all payouts over generator speed, with binned means (Fig. 6)."""
    if not powers or not reduction.cycles:
        return None
    with_bins = bool(reduction.bins)
    figure = Figure((WIDTH, 2.75))
    axes = figure.subplots(1, 1 + with_bins, squeeze=False, gridspec_kw={"wspace": 0.27})[0]
    figure.subplots_adjust(left=0.095, right=0.985, top=0.9, bottom=0.16)
    _one_cycle(axes[0], reduction, powers)
    if with_bins:
        _over_speed(axes[1], reduction, powers)
    return figure


def _one_cycle(ax: Axes, reduction: Reduction, powers: dict[str, Signal]) -> None:
    run, cycle, zero = reduction.run, representative(reduction), clock_zero(reduction.run)
    end = cycle.phases.haul_in[1] if cycle.phases.haul_in is not None else float(run.t[-1])
    part = slice(*np.searchsorted(run.t, (cycle.phases.onset - 1.0, end + 0.5)).tolist())
    short, unit = readable("W", *(x[part] for x in powers.values()))
    for stage, x in powers.items():
        rows = envelope(x[part], DRAWN)
        ax.plot(
            run.t[part][rows] - zero,
            x[part][rows] * short,
            color=COLOURS[stage],
            ls=STAGE_STYLE[stage],
            label=TEX[stage],
        )
    for edge in (cycle.window.onset, cycle.window.cutoff):
        ax.axvline(edge - zero, color=COLOURS["soft"], ls="--", lw=0.8)
    label_panel(ax, "a", f"Cycle {cycle.cycle}")
    ax.set_xlabel(time_label(run))
    ax.set_ylabel(f"Power ({unit})")
    ax.legend(
        loc="lower right", ncols=3, bbox_to_anchor=(1.01, 1.0), borderaxespad=0.1, columnspacing=0.8, handlelength=1.9
    )


def _over_speed(ax: Axes, reduction: Reduction, powers: dict[str, Signal]) -> None:
    run, rig, bins = reduction.run, reduction.rig, reduction.bins
    counted = reduction.complete
    flat = [c.summary.payout.plateau for c in counted]
    rows = np.flatnonzero(engaged(run, [c.phases for c in counted], flat, rig))
    rows = rows[:: max(1, -(-rows.size // DOTS))]
    factor = rig.rpm_per_velocity or 0.0
    rated = rig.generator.speed_rated
    highest = bins[-1].rpm_high
    if rated is not None and rated.value * 30.0 / np.pi < highest:
        ax.axvspan(rated.value * 30.0 / np.pi, highest, color=COLOURS["over"], lw=0)
        ax.text(
            highest, 0.01, "over rated speed ", transform=ax.get_xaxis_transform(), ha="right", va="bottom", fontsize=7,
            color=COLOURS["soft"],
        )  # fmt: skip
    short, unit = readable("W", *(x[rows] for x in powers.values()))
    for stage, x in powers.items():
        dots(ax, run.channels["velocity"][rows] * factor, x[rows] * short, COLOURS[stage])
        means = [(0.5 * (b.rpm_low + b.rpm_high), y * short) for b in bins if (y := b.power.get(stage)) is not None]
        ax.plot(
            *np.array(means).reshape(-1, 2).T, color=COLOURS[stage], ls=STAGE_STYLE[stage], lw=1.3, label=TEX[stage]
        )
    ax.set_xlim(min(0.0, bins[0].rpm_low), highest)
    label_panel(ax, "b", f"Payouts; lines: means in bins of {rig.thresholds.rpm_bin:g} rpm")
    ax.set_xlabel("Generator speed (rpm)")
    ax.set_ylabel(f"Power ({unit})")
    ax.legend(loc="upper left")


def dots(ax: Axes, x: Signal, y: Signal, colour: str) -> None:
    """Draw points as one path of very short strokes: a marker each would make the file ten times as large."""
    gap, short = np.full(x.size, np.nan), 1e-3 * float(np.ptp(x, axis=None)) if x.size else 0.0
    across, up = np.column_stack((x, x + short, gap)).ravel(), np.column_stack((y, y, gap)).ravel()
    ax.plot(across, up, color=colour, lw=1.7, alpha=0.45, solid_capstyle="round")


def representative(reduction: Reduction) -> CycleResult:
    """The first complete cycle, as the paper shows it; the first of all where none is complete."""
    return (*reduction.complete, *reduction.cycles)[0]


class _Flow(NamedTuple):
    """One bar of an energy flow: its energy [J] and colour, texts above it, and what leaves and what goes on behind it."""

    joule: float
    colour: str
    name: str
    where: str
    leaves: str = ""
    goes_on: str = ""


def energy_flow(reduction: Reduction, texts: Mapping[str, str] | None = None) -> Figure | None:
    """Draw where the line's mean energy goes: in the window from stage to stage, and over the whole cycle.

    Heights are energies; what is lost, stored or returned branches off.

    Parameters
    ----------
    texts : means as they are stated, by metric; with four digits if not given
    """
    mean = reduction.mean
    told = {m: (texts or {}).get(m) or significant(x, 4) for m in ALL_METRICS if (x := getattr(mean, m)) is not None}
    rows = [
        (title, flow)
        for title, flow in (
            ("Integration window", _window_flow(reduction, told)),
            ("Whole cycle, from onset to next onset", _cycle_flow(reduction, told)),
        )
        if len(flow) > 1 and flow[-1].joule > 0 and all(b.joule <= a.joule for a, b in pairwise(flow))
    ]
    if not rows:
        return None
    height = 2.3
    figure = Figure((WIDTH, height * len(rows)))
    for k, (title, flow) in enumerate(rows):
        ax = figure.add_axes((0.0, 1.0 - (k + 1) / len(rows), 1.0, 1.0 / len(rows)))
        ax.set_axis_off()
        _draw_flow(ax, flow)
        ax.text(0.008, 0.985, f"{'ab'[k]}", transform=ax.transAxes, ha="left", va="top", fontsize=9, fontweight="bold")
        ax.text(0.03, 0.985, title, transform=ax.transAxes, ha="left", va="top", fontsize=8.5)
    return figure


def _window_flow(reduction: Reduction, told: Mapping[str, str]) -> list[_Flow]:
    """The energies of the window stage by stage, and what does not reach the next stage: lost, or stored until later."""
    mean = reduction.mean
    known = [s for s in STAGES if f"energy_{s}" in told]
    flow = []
    for stage, following in zip(known, [*known[1:], ""], strict=False):
        joule = float(getattr(mean, f"energy_{stage}"))
        leaves = goes_on = ""
        if following:
            rest = joule - float(getattr(mean, f"energy_{following}"))
            whole = float(getattr(mean, f"energy_{known[0]}"))
            leaves = (
                f"{_where_stored(reduction.rig, stage, following)}: {_of_whole(rest, whole, _ENERGY_TEX[known[0]])}"
            )
            eta = next((n for n, r in RATIOS.items() if r == (f"energy_{following}", f"energy_{stage}")), "")
            value = getattr(mean, eta, None)
            goes_on = "" if value is None else f"{ETA_TEX[eta]} = {value:.3f}"
        text = f"{_ENERGY_TEX[stage]} = {told[f'energy_{stage}']} J"
        flow.append(_Flow(joule, stage, text, _STAGE_WORDS[stage], leaves, goes_on))
    return flow


def _where_stored(rig: Rig, stage: str, following: str) -> str:
    """Name what leaves between two stages of a window: energy that is stored there is returned or delivered later."""
    if stage == "line" and following == "mech" and rig.restoring.volume_gas is not None:
        return "lost or stored in the gas"
    return "lost or stored in the rotor" if stage == "mech" else "lost or stored"


def _cycle_flow(reduction: Reduction, told: Mapping[str, str]) -> list[_Flow]:
    """The line's energy of a whole cycle: taken in the payout, less what is returned in haul-in, less losses."""
    mean = reduction.mean
    if mean.energy_payout is None or mean.energy_net is None:
        return []
    whole, taken = mean.energy_payout, _CYCLE_TEX["energy_payout"]
    back = "" if mean.energy_returned is None else _of_whole(mean.energy_returned, whole, taken)
    flow = [
        _Flow(whole, "line", f"{taken} = {told['energy_payout']} J", "line, payout", f"returned in haul-in: {back}")
    ]
    lost = eta = ""
    if mean.energy_gen_cycle is not None:
        lost = f"lost: {_of_whole(mean.energy_net - mean.energy_gen_cycle, whole, taken)}"
        eta = "" if mean.eta_net is None else f"{ETA_TEX['eta_net']} = {mean.eta_net:.3f}"
    name = f"{_CYCLE_TEX['energy_net']} = {told['energy_net']} J"
    flow.append(_Flow(mean.energy_net, "line", name, "line, net", lost, eta))
    if mean.energy_gen_cycle is not None:
        name = f"{_CYCLE_TEX['energy_gen_cycle']} = {told['energy_gen_cycle']} J"
        flow.append(_Flow(mean.energy_gen_cycle, "gen", name, "DC link, whole cycle"))
    return flow


def _of_whole(joule: float, whole: float, name: str) -> str:
    return f"{significant(joule)} J, {100 * joule / whole:.1f} % of {name}"


def _draw_flow(ax: Axes, flow: Sequence[_Flow]) -> None:
    """Draw bars of energy from left to right, with bands between them and what leaves turning down."""
    top, bar = 1.0, 0.35
    heights = [item.joule / flow[0].joule for item in flow]
    at = np.linspace(0.0, 10.0, len(flow))
    for k, (x, h, item) in enumerate(zip(at, heights, flow, strict=True)):
        ax.add_patch(Rectangle((x, top - h), bar, h, fc=COLOURS[item.colour], lw=0))
        ax.text(
            x + bar / 2, top + 0.05, f"{item.name}\n{item.where}",
            ha="left" if k == 0 else "right" if k == len(flow) - 1 else "center", va="bottom", fontsize=8.5,
        )  # fmt: skip
        if k + 1 == len(flow):
            continue
        _flow(ax, x + bar, at[k + 1], top, h, heights[k + 1], item.colour)
        middle = (x + bar + at[k + 1]) / 2
        ax.text(middle, top - heights[k + 1] / 2, item.goes_on, ha="center", va="center", fontsize=9.5)
        turn = x + bar + _TURN * (at[k + 1] - x - bar) + (h - heights[k + 1]) / 2
        ax.text(turn, _DROP - 0.04, item.leaves, ha="center", va="top", fontsize=8)
    ax.set_xlim(-0.9, 11.2)
    ax.set_ylim(-0.62, 1.62)


_TURN, _DROP = 0.38, -0.3
"""Where a loss turns down between two bars, as a share of the way, and how far it goes."""


def _flow(ax: Axes, x0: float, x1: float, top: float, before: float, after: float, stage: str) -> None:
    """The band that goes on to the next bar, and the one that leaves."""
    ax.add_patch(Rectangle((x0, top - after), x1 - x0, after, fc=COLOURS[stage], alpha=0.28, lw=0))
    low, high, turn = top - before, top - after, x0 + _TURN * (x1 - x0)
    width = high - low
    points = [
        (x0, high), (turn, high), (turn + width, high), (turn + width, high - width), (turn + width, _DROP),
        (turn, _DROP), (turn, low), (x0, low), (x0, high),
    ]  # fmt: skip
    line, curve = Outline.LINETO, Outline.CURVE3
    codes = [Outline.MOVETO, line, curve, curve, line, line, line, line, Outline.CLOSEPOLY]
    ax.add_patch(PathPatch(Outline(points, codes), fc=COLOURS["loss"], lw=0))


def uncertainty_bars(known: Budget) -> Figure | None:
    """Draw which sensor makes which share of the variance of each mean."""
    metrics = [m for m in ETA_TEX if getattr(known.mean, m)]
    parts = {m: by_sensor(known, m) for m in metrics}
    names = sorted({n for p in parts.values() for n in p}, key=lambda n: (n == "repeatability", n))
    if not names:
        return None
    height = 0.62 + 0.27 * len(metrics)
    figure = Figure((WIDTH, height + 0.25))
    ax = figure.subplots()
    figure.subplots_adjust(left=0.08, right=0.985, top=1 - 0.3 / height, bottom=0.42 / height)
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
    ax.set_yticks(rows, [ETA_TEX[m] for m in metrics])
    ax.set_xlim(0, 100)
    ax.set_xlabel("Share of the variance of the mean (%)")
    ax.grid(axis="y", visible=False)
    ax.legend(loc="lower right", ncols=len(names), bbox_to_anchor=(1.0, 1.0), handlelength=1.4, columnspacing=1.2)
    return figure


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


TREND_FROM = 6
"""With fewer cycles than this the table shows a drift as well."""

OVERLAID = 40
"""Cycles that are laid over each other at most; of more, an even selection."""

OVERLAID_POINTS = 6000
"""Points of all overlaid cycles together in one panel, about."""


def overlaid(reduction: Reduction, powers: dict[str, Signal], best: int | None, worst: int | None) -> Figure | None:
    """Lay the cycles over each other on a clock that starts at each onset; best and worst stand out.

    Parameters
    ----------
    best, worst : numbers of the cycles of the highest and the lowest efficiency, None where they cannot be told
    """
    run, cycles = reduction.run, reduction.cycles
    names = [n for n in ("velocity", "force", "torque", "pressure") if n in run.channels][:3]
    panels = [p for p in PANELS if p[0] in names]
    columns: list[tuple[str, str, Signal]] = [(t, u, run.channels[n] * f) for n, t, u, f in panels]
    last = [s for s in ("gen", "mech", "line") if s in powers][:1]
    columns += [(f"Power {TEX[s]}", "W", powers[s]) for s in last]
    if not cycles or not columns:
        return None
    rows = -(-len(columns) // 2)
    height = 0.5 + 1.55 * rows
    figure = Figure((WIDTH, height))
    grid = figure.subplots(rows, 2, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.36, "wspace": 0.24})
    figure.subplots_adjust(left=0.095, right=0.985, top=1 - 0.42 / height, bottom=0.42 / height)
    axes: list[Axes] = list(grid.ravel())
    for ax in axes[len(columns) :]:
        ax.set_visible(False)
    chosen = _selection(cycles, best, worst)
    longest = max(_end_of(c, run) - c.phases.onset for c in chosen)
    for k, (ax, (title, unit, x)) in enumerate(zip(axes, columns, strict=False)):
        short, unit = readable(unit, x)
        for c in chosen:
            _one_overlaid(ax, run, x * short, c, best, worst, most=max(150, OVERLAID_POINTS // len(chosen)))
        for c in chosen[:1]:
            ax.axvline(c.window.cutoff - c.window.onset, color=COLOURS["soft"], ls="--", lw=0.8)
        label_panel(ax, "abcdefgh"[k], title)
        ax.set_ylabel(unit)
        ax.set_xlim(-1.0, longest)
        if k + 2 >= len(columns):
            ax.set_xlabel("Time since onset (s)")
            ax.tick_params(labelbottom=True)
    handles, labels = axes[0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if len(named) > 1:
        figure.legend(named.values(), named.keys(), loc="upper right", ncols=len(named), bbox_to_anchor=(0.99, 1.0))
    return figure


def trend(reduction: Reduction) -> Figure | None:
    """Draw efficiencies and energies over the number of the cycle, so that a drift is seen; None for few cycles."""
    complete = reduction.complete
    etas = [m for m in RATIOS if getattr(reduction.mean, m) is not None]
    energies = [m for m in ETA_TEX if m.startswith("energy") and getattr(reduction.mean, m) is not None]
    groups = [(title, names) for title, names in (("Efficiencies", etas), ("Energies", energies)) if names]
    if len(complete) < TREND_FROM or not groups:
        return None
    height = 0.55 + 1.5 * len(groups)
    figure = Figure((WIDTH, height))
    axes: list[Axes] = list(
        figure.subplots(len(groups), 1, sharex=True, squeeze=False, gridspec_kw={"hspace": 0.3})[:, 0]
    )
    figure.subplots_adjust(left=0.095, right=0.985, top=1 - 0.25 / height, bottom=0.42 / height)
    number = np.array([c.cycle for c in complete], dtype=float)
    for k, (ax, (title, names)) in enumerate(zip(axes, groups, strict=True)):
        columns = {name: np.array([getattr(c.metrics, name) for c in complete], dtype=float) for name in names}
        short, unit = readable("J" if title == "Energies" else "1", *columns.values())
        ax.set_ylabel(unit)
        for name, joule in columns.items():
            values = joule * short
            rows = envelope(values, DRAWN // 2)
            stage = _TREND_STAGE[name]
            ax.plot(number[rows], values[rows], color=COLOURS[stage], lw=0.5, alpha=0.5)
            mark: Any = {"line": "o", "mech": "s", "gen": "^"}[stage]
            few = len(rows) <= 200
            ax.plot(
                number[rows] if few else [], values[rows] if few else [], ls="none", marker=mark, ms=2.2, mew=0,
                color=COLOURS[stage], label=ETA_TEX[name],
            )  # fmt: skip
            if not few:
                dots(ax, number[rows], values[rows], COLOURS[stage])
        label_panel(ax, "ab"[k], title)
        ax.legend(loc="lower right", ncols=3, bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0, markerscale=1.8)
    axes[-1].set_xlabel("Cycle")
    return figure


_TREND_STAGE = {
    "eta_trans": "mech", "eta_gen": "gen", "eta_pto": "line", "energy_line": "line", "energy_mech": "mech", "energy_gen": "gen",
}  # fmt: skip


def _selection(cycles: Sequence[CycleResult], best: int | None, worst: int | None) -> list[CycleResult]:
    """Cycles to be drawn, best and worst last so that they lie on top."""
    even = np.linspace(0, len(cycles) - 1, min(len(cycles), OVERLAID)).round().astype(int)
    rest = [cycles[k] for k in even.tolist() if cycles[k].cycle not in (best, worst)]
    return rest + [c for number in (worst, best) for c in cycles if c.cycle == number]


def _end_of(cycle: CycleResult, run: Run) -> float:
    phases = cycle.phases
    end = phases.haul_in[1] if phases.haul_in is not None else phases.hold[1] if phases.hold else phases.payout_end
    return min(end, float(run.t[-1]))


def _one_overlaid(
    ax: Axes, run: Run, x: Signal, c: CycleResult, best: int | None, worst: int | None, *, most: int
) -> None:
    part = slice(*np.searchsorted(run.t, (c.phases.onset - 1.0, _end_of(c, run))).tolist())
    rows = envelope(x[part], most)
    t = run.t[part][rows] - c.phases.onset
    style: dict[str, Any] = {"color": COLOURS["soft"], "lw": 0.7, "label": "other cycles" if best else "complete"}
    if c.cycle == best:
        style = {"color": COLOURS["line"], "lw": 1.1, "label": f"best, cycle {best}"}
    elif c.cycle == worst:
        style = {"color": COLOURS["mech"], "lw": 1.1, "ls": (0, (4, 1.2)), "label": f"worst, cycle {worst}"}
    elif not c.complete:
        style = {"color": COLOURS["soft"], "lw": 0.7, "ls": ":", "label": "incomplete"}
    ax.plot(t, x[part][rows], **style)
