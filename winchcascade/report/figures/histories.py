"""Time histories: what is drawn over time, as a figure and as the JSON of the interactive ones
of a page.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any, NamedTuple

import msgspec
import numpy as np

from winchcascade.core.channels import Channel
from winchcascade.core.quantity import KGCM2, find_unit, si_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import given_rig
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.report.figures.style import (
    COLOURS,
    Dashes,
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
    from matplotlib.figure import Figure

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
    ("pressure", "Accumulator pressure, gauge", "kg/cm²", 1.0 / KGCM2),
    ("force", "Line tension", "N", 1.0),
    ("torque", "Torque of the PTO shaft", "N·m", 1.0),
    ("power_mech", "Power of the shaft", "W", 1.0),
    ("vdc", "Voltage of the DC link", "V", 1.0),
    ("idc", "Current of the DC link", "A", 1.0),
    ("speed", "Speed of the shaft", "rpm", 30.0 / math.pi),
    ("flow", "Flow", "L/min", 6e4),
    ("power_ac", "AC power", "W", 1.0),
)
"""Channels that have a panel of their own: name, title, unit, and what turns SI units into it."""


Span = tuple[float, float]
"""Begin and end. [s]"""


class Curve(NamedTuple):
    """A curve over time: its name, as in a page and, where that differs, in a figure, its
    values, (n,), and its look.
    """

    name: str
    values: Signal
    colour: str = "ink"
    dashes: Dashes = "-"
    symbol: str = ""


class Panel(NamedTuple):
    """A quantity over time: its title and unit, its curves in that unit, and the stretches in
    which they were repaired.
    """

    title: str
    unit: str
    curves: Sequence[Curve]
    repaired: Sequence[Span] = ()


class Mark(NamedTuple):
    """Stretches that every panel shades, or, with dashes, instants at which it has a line: what
    they are, and their colour.
    """

    name: str
    colour: str
    spans: Sequence[Span]
    dashes: str = ""


class History(NamedTuple):
    """Panels one below the other, their instants, (n,) [s], the label of these, and what all
    panels mark.
    """

    t: Signal
    label: str
    panels: Sequence[Panel]
    marks: Sequence[Mark]


# -------------------------------------------------------------------------------- figure and page
def history_figure(history: History) -> Figure:
    """Draw the panels of a history, with one legend above them."""
    panels = history.panels
    figure, axes = panel_figure(0.6 + 0.95 * len(panels), len(panels), share="x")
    draw_history(axes, history)
    several = [curve for panel in panels if len(panel.curves) > 1 for curve in panel.curves]
    named = {
        c.symbol or c.name: line_entry(c.symbol or c.name, c.colour, ls=c.dashes) for c in several
    }
    repaired = (
        [patch_entry(REPAIRED, "repaired")] if any(panel.repaired for panel in panels) else []
    )
    entries = [*named.values(), *mark_entries(history.marks), *repaired]
    if entries:
        legend_above(figure, entries)
    figure.align_ylabels(axes)
    return figure


def draw_history(axes: Sequence[Axes], history: History) -> None:
    """Draw as many panels as there are axes, which share the time: the last ones."""
    for ax, letter, panel in zip(axes, ascii_lowercase, history.panels[-len(axes) :], strict=False):
        short, unit = readable(panel.unit, *(curve.values for curve in panel.curves))
        for curve in panel.curves:
            style: Any = {
                "color": COLOURS[curve.colour],
                "ls": curve.dashes,
                "label": curve.symbol or curve.name,
            }
            ax.plot(history.t, curve.values * short, **style)
        label_panel(ax, letter, panel.title, unit=unit)
        ax.set_xlim(history.t[0], history.t[-1])
        draw_marks(ax, history.marks)
        mark_repaired(ax, panel.repaired)
    axes[-1].set_xlabel(history.label)


def draw_marks(ax: Axes, marks: Sequence[Mark]) -> None:
    """Shade stretches over the height of a panel, and draw lines at instants."""
    across, limits = ax.get_xaxis_transform(), ax.get_xlim()
    for mark in marks:
        if mark.dashes:
            at = [begin for begin, _ in mark.spans]
            ax.vlines(
                at, 0.0, 1.0, transform=across, colors=COLOURS[mark.colour], ls=mark.dashes, lw=0.7
            )
        else:
            bars = [(begin, end - begin) for begin, end in mark.spans]
            ax.broken_barh(
                bars, (0.0, 1.0), transform=across, fc=COLOURS[mark.colour], lw=0, zorder=0.1
            )
    ax.set_xlim(limits)


def mark_repaired(ax: Axes, spans: Sequence[Span]) -> None:
    """Mark stretches at the lower edge of a panel; a mark is never narrower than its outline."""
    bars, limits = [(begin, end - begin) for begin, end in spans], ax.get_xlim()
    colour, across = COLOURS["repaired"], ax.get_xaxis_transform()
    ax.broken_barh(
        bars, (0.0, REPAIRED_HEIGHT), transform=across, fc=colour, ec=colour, lw=0.8, zorder=1.5
    )
    ax.set_xlim(limits)


def mark_entries(marks: Sequence[Mark]) -> list[Entry]:
    """Entries of a legend that name the shades and lines."""
    return [
        line_entry(mark.name, mark.colour, ls=mark.dashes, lw=0.8)
        if mark.dashes
        else patch_entry(mark.name, mark.colour)
        for mark in marks
    ]


def history_json(history: History) -> str:
    """A history as `page.js` reads it: the first curve of a panel is named with the quantity."""
    rows = [
        {
            "label": panel.unit,
            "series": [
                {
                    "label": ", ".join(filter(None, (panel.title if k == 0 else "", curve.name))),
                    "colour": curve.colour,
                    "values": _listed(curve.values),
                    **({} if curve.dashes == "-" else {"dash": [6, 3]}),
                }
                for k, curve in enumerate(panel.curves)
            ],
            "repaired": [_placed(*span, "repaired") for span in panel.repaired],
        }
        for panel in history.panels
    ]
    spans = [_placed(*span, mark.colour) for mark in history.marks for span in mark.spans]
    return msgspec.json.encode({"t": _listed(history.t), "rows": rows, "spans": spans}).decode()


def _placed(begin: float, end: float, colour: str) -> dict[str, float | str]:
    return {"from": begin, "to": end, "colour": colour}


def _listed(x: Signal) -> msgspec.Raw:
    """JSON of numbers with six digits, null where the log has none."""
    known = np.where(np.isfinite(x), x, np.nan)
    texts = ",".join(["%.6g"] * x.size) % tuple(known.tolist())
    return msgspec.Raw(f"[{texts.replace('nan', 'null')}]".encode())


def thinned(
    t: Signal, curves: Sequence[Signal], points: int = POINTS
) -> tuple[Signal, list[Signal]]:
    """Instants and curves of a log with the peaks of each, two instants for each bin of samples.

    The larger one stands first where a curve falls within the bin.

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
    found = []
    for x in curves:
        peaks = np.column_stack([np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)])
        falls = x[edges] > x[ends]
        peaks[falls] = peaks[falls, ::-1]
        found.append(peaks.ravel())
    return times, found


# --------------------------------------------------------------------------------------- of a log
def log_history(reduction: Reduction) -> History:
    """Every channel and the powers over the whole log, with phases and windows (the paper's Fig.
    5).
    """
    run, zero, powers = reduction.run, clock_zero(reduction.run), powers_of(reduction)
    others = run.channels.keys() - {"power_mech"}  # a power of a stage
    panels = _channel_panels(run, reduction.rig, others)
    t, watts = thinned(run.t - zero, [*powers.values()])
    if powers:
        drawn = [power_curve(stage, curve) for stage, curve in zip(powers, watts, strict=True)]
        repaired = repaired_spans(run, power_sources(reduction, powers), zero)
        panels.append(Panel("Power", "W", drawn, repaired))
    shaded = reduction.cycles if len(reduction.cycles) <= SHADED_CYCLES else ()
    return History(t, time_label(run), panels, phase_marks(reduction, shaded, zero))


def run_history(run: Run, names: Collection[str]) -> History:
    """Some channels of a log over its whole length, a panel for each."""
    t, _ = thinned(run.t - clock_zero(run), [])
    panels = _channel_panels(run, given_rig("plot", None, run.rig), names)
    return History(t, time_label(run), panels, ())


def _channel_panels(run: Run, rig: Rig, names: Collection[str]) -> list[Panel]:
    """A panel for each channel of a log with one of some names, at the instants of a history."""
    panels = []
    for name, title, unit, factor in channels_drawn(run, rig):
        if name in names:
            _, (curve,) = thinned(run.t, [run.channels[name] * factor])
            repaired = repaired_spans(run, (name,), clock_zero(run))
            panels.append(Panel(title, unit, [Curve("", curve)], repaired))
    return panels


def power_curve(stage: str, watts: Signal) -> Curve:
    """The power of a stage in its look."""
    look = look_of(stage)
    return Curve(
        typeset(metric(f"power_{stage}").symbol),
        watts,
        look.colour,
        look.dashes,
        tex(f"power_{stage}"),
    )


def phase_marks(reduction: Reduction, cycles: Sequence[CycleResult], zero: float) -> list[Mark]:
    """Payouts, holds and the ends of the windows of some cycles, dotted lines of incomplete
    ones.
    """
    marks = [
        Mark(
            span_word(reduction), "payout", [(c.phases.onset, c.phases.payout_end) for c in cycles]
        ),
        Mark("hold", "hold", [c.phases.hold for c in cycles if c.phases.hold is not None]),
    ]
    for complete, name, dash in (
        (True, "integration window", "--"),
        (False, "of an incomplete cycle", ":"),
    ):
        edges = [
            e for c in cycles if c.complete is complete for e in (c.window.onset, c.window.cutoff)
        ]
        marks.append(Mark(name, "soft", [(edge, edge) for edge in edges], dash))
    return [
        mark._replace(spans=[(begin - zero, end - zero) for begin, end in mark.spans])
        for mark in marks
        if mark.spans
    ]


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
    return tuple(
        dict.fromkeys(name for product in found if product is not None for name in product.channels)
    )


def channels_drawn(run: Run, rig: Rig) -> list[tuple[str, str, str, float]]:
    """Channels of a log as in `PANELS`, those of the rig's own last."""
    own = ((name, name, *_unit_drawn(channel)) for name, channel in rig.channels.items())
    return [row for row in (*PANELS, *own) if row[0] in run.channels]


def _unit_drawn(channel: Channel) -> tuple[str, float]:
    """Unit of a channel of the rig's own, and what turns SI units into it: that of SI for one
    with a zero of its own.
    """
    found = find_unit(channel.unit)
    return (
        (si_unit(channel.dimension), 1.0)
        if found is None or found.offset
        else (channel.unit, 1.0 / found.factor)
    )


def repaired_spans(run: Run, channels: Sequence[str], zero: float) -> list[Span]:
    """Stretches since an instant in which any of the channels was bridged, those that nearly
    touch as one. [s]
    """
    near, spans = NEAR * float(run.t[-1] - run.t[0]), list[Span]()
    for begin, end in (all_gaps(run, channels) - zero).tolist():
        if spans and begin <= spans[-1][1] + near:
            spans[-1] = (spans[-1][0], max(spans[-1][1], end))
        else:
            spans.append((begin, end))
    return spans


def time_label(run: Run) -> str:
    """Label of a drawn time axis."""
    zero = clock_zero(run)
    return "Time (s)" if zero == 0.0 else f"Time since {zero:.2f} s on the log's clock (s)"


def end_of(cycle: CycleResult) -> float:
    """End of the last phase of a cycle that the log holds. [s]"""
    phases = cycle.phases
    return (phases.haul_in or phases.hold or (0.0, phases.payout_end))[1]
