"""Time histories of a log, as a figure and as the JSON of the interactive ones of a page, from the same panels."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np
from matplotlib.figure import Figure

from winchcascade.core.channels import Channel
from winchcascade.core.quantity import KGF, find_unit, si_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.report.figures.style import (
    COLOURS,
    Entry,
    label_panel,
    legend_above,
    line_entry,
    look_of,
    panel_figure,
    patch_entry,
    readable,
)
from winchcascade.report.glossary import metric, tex, typeset
from winchcascade.report.wording import clock_zero, span_word

if TYPE_CHECKING:
    from matplotlib.axes import Axes

POINTS = 6000
"""Instants of a history at most; of longer logs each bin keeps its least and its largest value."""

SHADED_CYCLES = 60
"""With more cycles than this, shaded phases would be narrower than a pixel or two."""

REPAIRED = "repaired"
"""What a stretch is called whose samples were replaced."""

REPAIRED_HEIGHT = 0.07
"""Height of the mark of a repaired stretch at the lower edge of a panel, over that of the panel."""

NEAR = 1.0 / 2000.0
"""Repaired stretches that are nearer to each other than this share of the log are drawn as one."""

PANELS = (
    ("displacement", "Line displacement", "m", 1.0),
    ("velocity", "Line velocity", "m/s", 1.0),
    ("pressure", "Accumulator pressure, gauge", "kg/cm²", 1.0 / (KGF * 1e4)),
    ("force", "Line tension", "N", 1.0),
    ("torque", "Torque of the PTO shaft", "N·m", 1.0),
    ("vdc", "Voltage of the DC link", "V", 1.0),
    ("idc", "Current of the DC link", "A", 1.0),
    ("speed", "Speed of the shaft", "rpm", 30.0 / math.pi),
    ("flow", "Flow", "L/min", 6e4),
    ("power_ac", "AC power", "W", 1.0),
)
"""Channels that have a panel of their own: name, title, unit, and what turns SI units into it."""


class Curve(NamedTuple):
    """A curve of a panel: its stage, empty for a channel, its values, (n,), and the channels that it is computed from."""

    stage: str
    values: Signal
    channels: tuple[str, ...]


class Panel(NamedTuple):
    """A panel of the histories: what it shows, its unit, and its curves in that unit."""

    title: str
    unit: str
    curves: list[Curve]


def powers_of(reduction: Reduction) -> dict[str, Signal]:
    """Power stream of every stage that the log gives, (n,) [W]."""
    channels, r_drum = reduction.run.channels, reduction.rig.r_drum
    found = {stage.name: stage.watts(channels, r_drum) for stage in reduction.rig.cascade.stages}
    return {stage: watts for stage, watts in found.items() if watts is not None}


def power_sources(reduction: Reduction, stages: Iterable[str]) -> tuple[str, ...]:
    """Channels that the powers of some stages are computed from."""
    channels, r_drum = reduction.run.channels, reduction.rig.r_drum
    wanted = set(stages)
    found = [s.power(channels, r_drum) for s in reduction.rig.cascade.stages if s.name in wanted]
    return tuple(dict.fromkeys(name for product in found if product is not None for name in product.channels))


def channels_drawn(run: Run, rig: Rig) -> list[tuple[str, str, str, float]]:
    """Channels of a log as in `PANELS`, those of the rig's own last."""
    own = ((name, name, *_unit_drawn(channel)) for name, channel in rig.channels.items())
    return [row for row in (*PANELS, *own) if row[0] in run.channels]


def _unit_drawn(channel: Channel) -> tuple[str, float]:
    """Unit of a channel of the rig's own, and what turns SI units into it: that of SI for one with a zero of its own."""
    found = find_unit(channel.unit)
    return (si_unit(channel.dimension), 1.0) if found is None or found.offset else (channel.unit, 1.0 / found.factor)


def power_panel(reduction: Reduction, powers: Mapping[str, Signal]) -> Panel:
    """The powers of the stages."""
    return Panel("Power", "W", [Curve(s, watts, power_sources(reduction, [s])) for s, watts in powers.items()])


def panels_of(reduction: Reduction, powers: Mapping[str, Signal]) -> list[Panel]:
    """Panels of the histories: a channel each, and the powers last."""
    run = reduction.run
    panels = [
        Panel(title, unit, [Curve("", run.channels[name] * factor, (name,))])
        for name, title, unit, factor in channels_drawn(run, reduction.rig)
    ]
    return [*panels, *([power_panel(reduction, powers)] if powers else [])]


def thinned(t: Signal, curves: Sequence[Signal], points: int = POINTS) -> tuple[Signal, list[Signal]]:
    """Instants and curves of a log with the peaks of each, two instants for each bin of samples.

    >>> t, (x,) = thinned(np.arange(1e5), [np.r_[np.zeros(99_999), 1.0]])
    >>> t.size <= POINTS, float(x.max())
    (True, 1.0)
    """
    bins = points // 2
    if t.size <= points:
        return t, list(curves)
    edges = np.linspace(0, t.size, bins + 1).astype(int)[:-1]
    ends = np.r_[edges[1:], t.size] - 1
    times = np.column_stack([t[edges], t[ends]]).ravel()
    return times, [
        np.column_stack([np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)]).ravel() for x in curves
    ]


# ------------------------------------------------------------------------------------------------------- phases and repairs
def repaired_spans(run: Run, channels: Sequence[str]) -> list[tuple[float, float]]:
    """Stretches in which any of the channels was bridged, those that touch or nearly touch as one. [s]"""
    near, spans = NEAR * float(run.t[-1] - run.t[0]), list[tuple[float, float]]()
    for begin, end in all_gaps(run, channels).tolist():
        if spans and begin <= spans[-1][1] + near:
            spans[-1] = (spans[-1][0], max(spans[-1][1], end))
        else:
            spans.append((begin, end))
    return spans


def phase_spans(cycles: Sequence[CycleResult]) -> dict[str, list[tuple[float, float]]]:
    """Begin and end of every payout and hold, by the colour of the shade. [s]"""
    return {
        "payout": [(c.phases.onset, c.phases.payout_end) for c in cycles],
        "hold": [c.phases.hold for c in cycles if c.phases.hold is not None],
    }


def shade_phases(ax: Axes, cycles: Sequence[CycleResult], zero: float) -> None:
    """Shade payouts and holds, and bound the windows by dashed lines, dotted ones of incomplete cycles."""
    across, limits = ax.get_xaxis_transform(), ax.get_xlim()
    for name, spans in phase_spans(cycles).items():
        bars = [(begin - zero, end - begin) for begin, end in spans]
        ax.broken_barh(bars, (0.0, 1.0), transform=across, fc=COLOURS[name], lw=0, zorder=0.1)
    for complete, dash in ((True, "--"), (False, ":")):
        edges = [e - zero for c in cycles if c.complete is complete for e in (c.window.onset, c.window.cutoff)]
        ax.vlines(edges, 0.0, 1.0, transform=across, colors=COLOURS["soft"], ls=dash, lw=0.7)
    ax.set_xlim(limits)


def mark_repaired(ax: Axes, spans: Sequence[tuple[float, float]], zero: float) -> None:
    """Mark stretches at the lower edge of a panel; a mark is never narrower than its outline."""
    bars, limits = [(begin - zero, end - begin) for begin, end in spans], ax.get_xlim()
    colour, across = COLOURS["repaired"], ax.get_xaxis_transform()
    ax.broken_barh(bars, (0.0, REPAIRED_HEIGHT), transform=across, fc=colour, ec=colour, lw=0.8, zorder=1.5)
    ax.set_xlim(limits)


def phase_entries(reduction: Reduction) -> list[Entry]:
    """Entries of a legend that name the shades and the dashed lines."""
    word = span_word(reduction)
    entries = [patch_entry(word, "payout"), *([patch_entry("hold", "hold")] if word == "payout" else [])]
    complete = all(c.complete for c in reduction.cycles)
    lines = {"integration window": "--"} | ({} if complete else {"of an incomplete cycle": ":"})
    return entries + [line_entry(name, "soft", ls=dash, lw=0.8) for name, dash in lines.items()]


def time_label(run: Run) -> str:
    """Label of a drawn time axis."""
    zero = clock_zero(run)
    return "Time (s)" if zero == 0.0 else f"Time since {zero:.2f} s on the log's clock (s)"


def end_of(cycle: CycleResult) -> float:
    """End of the last phase of a cycle that the log holds. [s]"""
    phases = cycle.phases
    return (phases.haul_in or phases.hold or (0.0, phases.payout_end))[1]


# -------------------------------------------------------------------------------------------------------------- the figure
def time_histories(reduction: Reduction) -> Figure:
    """Draw every channel and the powers over the whole log, phases shaded, windows marked (the paper's Fig. 5)."""
    panels, run = panels_of(reduction, powers_of(reduction)), reduction.run
    figure, axes = panel_figure(0.6 + 0.95 * len(panels), len(panels), share="x")
    draw_histories(axes, reduction, panels)
    repaired = [patch_entry(REPAIRED, "repaired")] if repaired_spans(run, tuple(run.channels)) else []
    stages = [line_entry(curve.stage, **_looks(curve.stage)) for curve in panels[-1].curves if curve.stage]
    named = [(handle, tex(f"power_{stage}")) for handle, stage in stages]
    legend_above(figure, [*named, *(phase_entries(reduction) if _shaded(reduction) else []), *repaired])
    figure.align_ylabels(axes)
    return figure


def draw_histories(axes: Sequence[Axes], reduction: Reduction, panels: Sequence[Panel]) -> None:
    """Draw each of some panels on axes that share the time."""
    run, zero = reduction.run, clock_zero(reduction.run)
    for ax, letter, (title, unit, curves) in zip(axes, ascii_lowercase, panels, strict=False):
        short, shown = readable(unit, *(curve.values for curve in curves))
        for curve in curves:
            t, (x,) = thinned(run.t - zero, [curve.values * short])
            ax.plot(t, x, **_looks(curve.stage))
        label_panel(ax, letter, title, unit=shown)
        ax.set_xlim(run.t[0] - zero, run.t[-1] - zero)
        if _shaded(reduction):
            shade_phases(ax, reduction.cycles, zero)
        mark_repaired(ax, repaired_spans(run, [name for curve in curves for name in curve.channels]), zero)
    axes[-1].set_xlabel(time_label(run))


def _shaded(reduction: Reduction) -> bool:
    return 0 < len(reduction.cycles) <= SHADED_CYCLES


def _looks(stage: str) -> dict[str, Any]:
    """Colour and dashes of the power of a stage, or of a channel without one."""
    look = look_of(stage)
    return {"color": COLOURS[look.colour], "ls": look.dashes} if stage else {"color": COLOURS["ink"]}


# ---------------------------------------------------------------------------------------------------------------- the JSON
def histories_json(reduction: Reduction) -> str:
    """The histories as `page.js` reads them: channels, powers, phases, ends of windows, repaired stretches."""
    run, zero = reduction.run, clock_zero(reduction.run)
    panels = panels_of(reduction, powers_of(reduction))
    t, curves = thinned(run.t - zero, [np.asarray(curve.values) for panel in panels for curve in panel.curves])
    shown = iter(curves)
    rows = [
        {
            "label": panel.unit,
            "series": [
                {
                    "label": typeset(metric(f"power_{curve.stage}").symbol) if curve.stage else panel.title,
                    "colour": look_of(curve.stage).colour if curve.stage else "ink",
                    "values": plain(next(shown)),
                }
                for curve in panel.curves
            ],
        }
        for panel in panels
    ]
    cycles = reduction.cycles if _shaded(reduction) else ()
    spans = [(begin, end, colour) for colour, found in phase_spans(cycles).items() for begin, end in found]
    spans += [(edge, edge, "soft") for c in cycles for edge in (c.window.onset, c.window.cutoff)]
    spans += [(begin, end, "repaired") for begin, end in repaired_spans(run, tuple(run.channels))]
    marked = [{"from": begin - zero, "to": end - zero, "colour": colour} for begin, end, colour in spans]
    return msgspec.json.encode({"t": plain(t), "rows": rows, "spans": marked}).decode()


def plain(x: Signal) -> list[float | None]:
    """Numbers with six digits, none where the log has none."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in x.tolist()]
