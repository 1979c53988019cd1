"""Time histories of a log: channels thinned so that no peak is lost, and marks of phases, windows and repairs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from winchcascade.core.channels import Channel
from winchcascade.core.quantity import KGF, find_unit, si_unit
from winchcascade.core.rig_file import Rig
from winchcascade.core.run import Run, Signal
from winchcascade.reduction.gap_error import all_gaps
from winchcascade.reduction.reduction_result import CycleResult, Reduction
from winchcascade.report.style import COLOURS, Entry, is_narrow, line_entry, patch_entry
from winchcascade.report.svg_drawing import text_size
from winchcascade.report.wording import clock_zero, span_word

if TYPE_CHECKING:
    from matplotlib.axes import Axes


REPAIRED = "repaired"
"""What a stretch is called whose samples were replaced."""

STRIP = 0.13
"""Height of the names of the phases above the first panel. [in]"""

REPAIRED_HEIGHT = 0.07
"""Height of the mark of a repaired stretch at the lower edge of a panel, over that of the panel."""

_APART = 1.0 / 2000.0
"""Repaired stretches that are nearer to each other than this share of the log are drawn as one."""


def repaired_spans(run: Run, channels: Sequence[str]) -> list[tuple[float, float]]:
    """Stretches in which any of the channels was bridged, those that touch or nearly touch as one. [s]"""
    near, spans = _APART * float(run.t[-1] - run.t[0]), list[tuple[float, float]]()
    for begin, end in all_gaps(run, channels).tolist():
        if spans and begin <= spans[-1][1] + near:
            spans[-1] = (spans[-1][0], max(spans[-1][1], end))
        else:
            spans.append((begin, end))
    return spans


def power_sources(reduction: Reduction, stages: Iterable[str]) -> tuple[str, ...]:
    """Channels that the powers of some stages are computed from."""
    channels, r_drum = reduction.run.channels, reduction.rig.r_drum
    wanted = set(stages)
    found = [s.power(channels, r_drum) for s in reduction.rig.cascade.stages if s.name in wanted]
    return tuple(dict.fromkeys(name for product in found if product is not None for name in product.channels))


def mark_repaired(ax: Axes, spans: Sequence[tuple[float, float]], gid: str, zero: float = 0.0) -> None:
    """Mark stretches at the lower edge of a panel; a mark is never narrower than its outline."""
    if not spans:
        return
    corners = [
        [(a, 0.0), (b, 0.0), (b, REPAIRED_HEIGHT), (a, REPAIRED_HEIGHT), (a, 0.0)] for a, b in np.array(spans) - zero
    ]
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY] * len(spans)
    colour, low_high = COLOURS["repaired"], ax.get_xlim()
    ax.add_patch(
        PathPatch(
            Outline(np.concatenate(corners), codes), fc=colour, ec=colour, lw=0.8, transform=ax.get_xaxis_transform(),
            gid=gid, zorder=1.5,
        )
    )  # fmt: skip
    ax.set_xlim(low_high)


def shade_phases(ax: Axes, panel: int, cycles: Sequence[CycleResult], zero: float, top: float = 1.0) -> None:
    """Shade payouts and holds, and bound the windows by dashed lines, which end at a share of the height of the panel."""
    for c in cycles:
        for phase, span in (("payout", (c.phases.onset, c.phases.payout_end)), ("hold", c.phases.hold)):
            if span is not None:
                begin, end = span[0] - zero, span[1] - zero
                ax.axvspan(begin, end, color=COLOURS[phase], lw=0, gid=f"span-{c.cycle}-{phase}-{panel}")
        style = "--" if c.complete else ":"
        for name, edge in (("onset", c.window.onset), ("cutoff", c.window.cutoff)):
            ax.axvline(
                edge - zero, ymax=top, color=COLOURS["soft"], ls=style, lw=0.7, gid=f"edge-{c.cycle}-{name}-{panel}"
            )


def phase_spans(reduction: Reduction) -> list[tuple[str, int, float, float]]:
    """Name of every phase, the number of its cycle, its begin and its end. [s]"""
    named = [
        (c, name, span)
        for c in reduction.cycles
        for name, span in (
            (span_word(reduction), (c.phases.onset, c.phases.payout_end)),
            ("hold", c.phases.hold),
            ("haul-in", c.phases.haul_in),
        )
    ]
    return [(name, c.cycle, *span) for c, name, span in named if span is not None]


def name_phases(ax: Axes, reduction: Reduction, zero: float) -> bool:
    """Write the names of the phases above a panel where they have room, payouts with the number of their cycle.

    Returns
    -------
    True if any has room
    """
    named = False
    for name, cycle, begin, end in () if is_narrow() else phase_spans(reduction):
        texts = (name,) if name in ("hold", "haul-in") else (f"{name} {cycle}", f"{cycle}")
        text = next((t for t in texts if _fits(ax, t, end - begin)), "")
        if text:
            named = True
            ax.text(
                0.5 * (begin + end) - zero, 1.015, text, transform=ax.get_xaxis_transform(), ha="center", va="bottom",
                fontsize=_SIZE, color=COLOURS["soft"],
            )  # fmt: skip
    return named


_SIZE = 6.5
"""Size of the names of phases. [pt]"""


def raise_head(ax: Axes) -> None:
    """Move title and legend of a panel above the names of its phases."""
    ax.set_title(ax.get_title(loc="left"), loc="left", pad=3 + 72.0 * STRIP)
    legend, figure = ax.get_legend(), ax.get_figure(root=True)
    if legend is not None and figure is not None:
        above = ax.transAxes + ScaledTranslation(0.0, STRIP, figure.dpi_scale_trans)
        legend.set_bbox_to_anchor((1.0, 1.0), transform=above)


def phase_entries(reduction: Reduction) -> list[Entry]:
    """Entries of a legend that name the shades and the dashed lines."""
    word = span_word(reduction)
    entries = [patch_entry(word, "payout"), *([patch_entry("hold", "hold")] if word == "payout" else [])]
    complete = all(c.complete for c in reduction.cycles)
    lines = {"integration window": "--"} | ({} if complete else {"of an incomplete cycle": ":"})
    return entries + [line_entry(name, "soft", ls=dash, lw=0.8) for name, dash in lines.items()]


def key_above(ax: Axes, entries: Sequence[Entry]) -> None:
    """Set a legend above a panel, beside its title."""
    if not entries:
        return
    handles, names = zip(*entries, strict=True)
    ax.legend(
        handles, names, loc="lower right", ncols=len(entries), bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1,
        columnspacing=1.2,
    )  # fmt: skip


def room_for_names(ax: Axes) -> float:
    """Make a panel higher by two lines of names at its upper edge; gives their height over that of the panel."""
    low, high = ax.get_ylim()
    inches = ax.get_position().height * ax.get_figure(root=True).get_figheight()  # type: ignore[union-attr]  # it is drawn on one
    share = 2.0 * _ROW / inches
    ax.set_ylim(low, low + (high - low) / (1.0 - share))
    return share


def name_within(ax: Axes, reduction: Reduction, cycle: CycleResult, zero: float, share: float) -> None:
    """Name phases and window of one cycle in two lines at the upper edge of a panel, which are a share of its height."""
    style: Any = {"transform": ax.get_xaxis_transform(), "ha": "center", "fontsize": _SIZE, "color": COLOURS["soft"]}
    for name, number, begin, end in phase_spans(reduction):
        if number == cycle.cycle and _fits(ax, name, end - begin):
            ax.text(0.5 * (begin + end) - zero, 1.0 - 0.5 * share, name, va="bottom", **style)
    begin, end = cycle.window.onset - zero, cycle.window.cutoff - zero
    if _fits(ax, "window", end - begin):
        ax.text(0.5 * (begin + end), 1.0 - share, "window", va="bottom", **style)
    else:
        ax.text(end, 1.0 - share, " window", va="bottom", **(style | {"ha": "left"}))


_ROW = 0.12
"""Height of a line of names within a panel. [in]"""


def _fits(ax: Axes, text: str, duration: float) -> bool:
    """Whether a text is narrower than a duration [s] of a panel over time."""
    low, high = ax.get_xlim()
    inches = ax.get_position().width * ax.get_figure(root=True).get_figwidth()  # type: ignore[union-attr]  # it is drawn on one
    return text_size(text, _SIZE).width / 72.0 < duration / (high - low) * inches


PANELS = (
    ("displacement", "Line displacement", "m", 1.0),
    ("velocity", "Line velocity", "m/s", 1.0),
    ("pressure", "Accumulator pressure, gauge", "kg/cm²", 1.0 / (KGF * 1e4)),
    ("force", "Line tension", "N", 1.0),
    ("torque", "Torque of the PTO shaft", "N·m", 1.0),
    ("vdc", "Voltage of the DC link", "V", 1.0),
    ("idc", "Current of the DC link", "A", 1.0),
)
"""Channels that have a panel of their own: name, title, unit, and what turns SI units into it."""

MORE_PANELS = (
    ("speed", "Speed of the shaft", "rpm", 30.0 / math.pi),
    ("flow", "Flow", "L/min", 6e4),
    ("power_ac", "AC power", "W", 1.0),
)
"""The same of channels that cranes seldom log."""


def panels_of(run: Run, rig: Rig) -> list[tuple[str, str, str, float]]:
    """Panels of the channels of a log, those of the rig's own last."""
    own = ((name, name, *_unit_drawn(channel)) for name, channel in rig.channels.items())
    return [panel for panel in (*PANELS, *MORE_PANELS, *own) if panel[0] in run.channels]


def _unit_drawn(channel: Channel) -> tuple[str, float]:
    """Unit of a channel of the rig's own, and what turns SI units into it: that of SI for one with a zero of its own."""
    found = find_unit(channel.unit)
    return (si_unit(channel.dimension), 1.0) if found is None or found.offset else (channel.unit, 1.0 / found.factor)


def envelope(x: Signal, maximum: int) -> NDArray[np.intp]:
    """Rows of a trace that draw it: all of them, or the least and the largest of each of equal stretches.

    Parameters
    ----------
    x : (n,) the trace
    maximum : rows to keep at most, about

    Examples
    --------
    >>> envelope(np.array([0.0, 9.0, 1.0, 2.0, -5.0, 3.0, 2.0, 2.0]), 4).tolist()
    [0, 1, 4, 5, 7]
    """
    n = x.size
    if n <= maximum:
        return np.arange(n)
    width = -(-2 * n // maximum)
    whole = n // width * width
    blocks = x[:whole].reshape(-1, width)
    start = np.arange(0, whole, width)
    rows = np.column_stack((start + blocks.argmin(axis=1), start + blocks.argmax(axis=1))).ravel()
    if whole < n:
        rest = x[whole:]
        rows = np.append(rows, (whole + rest.argmin(), whole + rest.argmax()))
    kept: NDArray[np.intp] = np.unique_values(np.append(rows, (0, n - 1)))
    return np.sort(kept)


def time_label(run: Run) -> str:
    """Label of a drawn time axis."""
    zero = clock_zero(run)
    return "Time (s)" if zero == 0.0 else f"Time since {zero:.2f} s on the log's clock (s)"


def end_of(cycle: CycleResult) -> float:
    """End of the last phase of a cycle that the log holds. [s]"""
    phases = cycle.phases
    return (phases.haul_in or phases.hold or (0.0, phases.payout_end))[1]
