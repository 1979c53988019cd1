"""Time histories of single cycles of a diagnosed campaign (Figs 11 and 12): their data, their figure, and what a page shows."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import msgspec
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from winchcascade.core.run import Signal
from winchcascade.diagnosis.diagnose import ModelDiagnosis
from winchcascade.diagnosis.predict import CHANNELS
from winchcascade.report.diagnosis_figures import AFTER, DASHES, HAUL_IN, OUT, by_load, most_telling, seen_channels
from winchcascade.report.digits import significant
from winchcascade.report.gap_words import NAMES, baseline_words
from winchcascade.report.style import (
    COLOURS,
    LineStyle,
    Margins,
    evenly,
    label_upright,
    legend_above,
    line_entry,
    patch_entry,
    wide_figure,
)
from winchcascade.report.time_histories import PANELS, REPAIRED, REPAIRED_HEIGHT, mark_repaired, repaired_spans
from winchcascade.report.wording import load_words

MAX_CYCLES = 24
"""Maximum number of cycles of all runs that a page holds."""

SHOWN_HZ = 25.0
"""Histories that are sampled faster are averaged down to about this rate. [Hz]"""

MAX_POINTS = 1500
"""Maximum number of instants of a cycle."""

LEAD, TAIL = 1.0, 0.5
"""Time that is shown before the onset of a cycle and after its haul-in. [s]"""

LEVELS = 65535
"""Values are stored as whole numbers from 0 to this over the range of their channel."""

AXES = {name: (title, unit, factor) for name, title, unit, factor in PANELS if name in CHANNELS}
"""Title, unit, and what turns SI units into it, of every channel that is compared."""


class CycleHistory(NamedTuple):
    """One cycle of one run: its numbers, instants since the onset (n,) [s], and the end of its payout [s].

    `logged`, `given` and, where there are fitted effects, `caused` (n, 5) are columns of `CHANNELS` in SI units, NaN where the
    run has no such channel. `zeros` (5,) are taken off the logged values. `haul_in` is its begin and end, if it was compared
    [s]. `repaired` are the stretches of each channel in which samples were replaced, since the onset [s].
    """

    log: int
    cycle: int
    t: Signal
    payout_end: float
    logged: Signal
    given: Signal
    caused: Signal | None
    zeros: Signal
    haul_in: tuple[float, float] | None = None
    repaired: Mapping[str, list[tuple[float, float]]] = MappingProxyType({})

    @property
    def phases(self) -> dict[str, tuple[float, float]]:
        """Begin and end of the phases that are compared, since the onset. [s]"""
        return {"payout": (0.0, self.payout_end)} | ({} if self.haul_in is None else {"haul-in": self.haul_in})

    @property
    def sides(self) -> list[Signal]:
        """Logged, by the baseline and, where there are any, with the fitted effects."""
        return [self.logged, self.given, *([] if self.caused is None else [self.caused])]


def cycle_histories(found: ModelDiagnosis) -> tuple[list[CycleHistory], int]:
    """Histories of the cycles that a page holds, in the order of the runs, and the number of the one that is shown first.

    That is, of the run with the most significant gap, the cycle with the largest one.
    """
    gaps = cycle_gaps(found)
    chosen = chosen_cycles(found, gaps)
    if not chosen:
        return [], 0
    items = [item for log in dict.fromkeys(log for log, _ in chosen) for item in _of_a_run(found, log, chosen)]
    shown = most_telling(found)
    return items, max(range(len(items)), key=lambda k: (items[k].log == shown, gaps[items[k].log, items[k].cycle]))


def cycle_gaps(found: ModelDiagnosis) -> dict[tuple[int, int], float]:
    """Mean square of the gap of the baseline over its noise, by run and cycle with a payout."""
    data, gaps = found.data, {}
    z = np.where(data.seen, (data.measured - found.predicted) / np.where(data.noise > 0.0, data.noise, 1.0), 0.0) ** 2
    for k, (log, rows) in enumerate(zip(data.logs, data.rows, strict=True)):
        blocks = log.course.blocks
        for cycle in np.unique(blocks.cycle[blocks.phase == OUT]).tolist():
            own = rows.start + np.flatnonzero(blocks.cycle == cycle)
            gaps[k, cycle] = float(z[own].sum() / max(np.count_nonzero(data.seen[own]), 1))
    return gaps


def chosen_cycles(found: ModelDiagnosis, gaps: dict[tuple[int, int], float]) -> list[tuple[int, int]]:
    """All cycles by run and number, or as many as a page holds: evenly over loads and time, those with the largest gap too."""
    if len(gaps) <= MAX_CYCLES:
        return sorted(gaps)
    each = {k: sorted(cycle for log, cycle in gaps if log == k) for k in by_load(found)}
    logs = evenly([k for k, cycles in each.items() if cycles], MAX_CYCLES)
    share, shown = max(MAX_CYCLES // len(logs), 1), most_telling(found)
    worst = max(gaps, key=lambda pair: (pair[0] == shown, gaps[pair]))
    chosen = {(k, cycle) for k in logs for cycle in evenly(each[k], share)}
    return sorted({*chosen, worst})


def baseline_of(found: ModelDiagnosis, log: int) -> Signal:
    """What the baseline predicts at the samples of a run, (n, 5): the own simulation, or the model of the rig file."""
    data = found.data
    if found.own_simulation is not None:
        run = found.own_simulation.runs[log]
        nothing = np.full(run.t.size, math.nan)
        return np.column_stack([run.channels.get(name, nothing) for name in CHANNELS])
    return _at_samples(found, log, np.zeros(len(data.nuisances)), fitted=False)


def _at_samples(found: ModelDiagnosis, log: int, nu: Signal, *, fitted: bool) -> Signal:
    data, one = found.data, found.data.logs[log]
    effects = found.found.best.effects(found.suspects) if fitted else []
    grid = one.course.on_grid(data.models(nu, effects)[log], skew=data.skew(nu))
    return one.course.at_stamps(grid)


def _of_a_run(found: ModelDiagnosis, log: int, chosen: Sequence[tuple[int, int]]) -> list[CycleHistory]:
    """Histories of the chosen cycles of one run."""
    one, nu = found.data.logs[log], found.found.best.nu
    run, blocks, zeros = one.run, one.course.blocks, found.data.zeros(nu)[log]
    nothing = np.full(run.t.size, math.nan)
    logged = np.column_stack([run.channels.get(name, nothing) for name in CHANNELS]) - zeros
    given = baseline_of(found, log)
    sides = [logged, given, *([_at_samples(found, log, nu, fitted=True)] if found.causes else [])]
    items = []
    for cycle in (cycle for k, cycle in chosen if k == log):
        moving, out, back = (
            np.flatnonzero((blocks.cycle == cycle) & np.isin(blocks.phase, phases))
            for phases in ((OUT, HAUL_IN), (OUT,), (HAUL_IN,))
        )
        onset = float(run.t[blocks.start[out[0]]])
        span = onset - LEAD, float(run.t[blocks.stop[moving[-1]] - 1]) + TAIL
        rows = slice(*np.searchsorted(run.t, span).tolist())
        step = max(round(run.fs / SHOWN_HZ), -(-(rows.stop - rows.start) // MAX_POINTS), 1)
        t, *shown = (_averaged(x[rows], step) for x in (run.t - onset, *sides))
        end = float(run.t[blocks.stop[out[-1]] - 1]) - onset
        repaired = {name: _since(repaired_spans(run, [name]), onset, span) for name in CHANNELS}
        caused = shown[2] if found.causes else None
        haul_in = None
        if back.size:
            haul_in = (float(run.t[blocks.start[back[0]]]) - onset, float(run.t[blocks.stop[back[-1]] - 1]) - onset)
        items.append(CycleHistory(log, cycle, t, end, shown[0], shown[1], caused, zeros, haul_in, repaired))
    return items


def _since(spans: list[tuple[float, float]], onset: float, shown: tuple[float, float]) -> list[tuple[float, float]]:
    """Parts of stretches that are shown, since an onset. [s]"""
    return [(max(a, shown[0]) - onset, min(b, shown[1]) - onset) for a, b in spans if a < shown[1] and b > shown[0]]


def _averaged(x: Signal, step: int) -> Signal:
    """Means of `step` samples each, (n // step, ...) from (n, ...)."""
    whole = x.shape[0] // step * step
    return np.asarray(x[:whole].reshape(-1, step, *x.shape[1:]).mean(axis=1))


def zeros_words(found: ModelDiagnosis, item: CycleHistory) -> str:
    """Which zeros of the sensors of a run are taken off its logged values."""
    texts = [
        f"{NAMES[name]} {significant(float(zero) * AXES[name][2], 2)} {AXES[name][1]}"
        for name, zero in zip(CHANNELS, item.zeros, strict=True)
        if zero and name in found.data.logs[item.log].run.channels
    ]
    return (
        f"Zeros of the sensors, by the joint fit, are taken off the logged values: {', '.join(texts)}." if texts else ""
    )


def item_words(found: ModelDiagnosis, item: CycleHistory) -> str:
    """A cycle of a run as a reader chooses it."""
    run = found.data.logs[item.log].run
    return f"{run.name} ({load_words(run.load)}), cycle {item.cycle}"


def histories_json(found: ModelDiagnosis, items: Sequence[CycleHistory], first: int, logged: str) -> str:
    """The histories as JSON for the page, values as base64 of whole numbers over the range of their channel.

    Parameters
    ----------
    first : number of the one that the page shows first
    logged : what the values of the log are called
    """
    sets, names = [], seen_channels(found)
    for item in items:
        order = " | ".join((logged, baseline_words(found), AFTER)[: len(item.sides)])
        curves = (np.array([x[:, CHANNELS.index(name)] for x in item.sides]) * AXES[name][2] for name in names)
        sets.append(
            {
                "name": item_words(found, item),
                "note": f"Values under the cursor: {order}. {zeros_words(found, item)}",
                "payout": [0.0, round(item.payout_end, 3)],
                "spans": [[name, round(a, 3), round(b, 3)] for name, (a, b) in item.phases.items()],
                "repaired": [[[round(t, 3) for t in span] for span in item.repaired.get(name, ())] for name in names],
                "times": _packed(item.t[None]),
                "traces": [None if np.isnan(columns).any() else _packed(columns) for columns in curves],
            }
        )
    t = items[first].t
    page = {
        "span": [float(t[0]), float(t[-1])],
        "label": TIME,
        "cycles": [],
        "panels": [{"name": AXES[name][0], "unit": AXES[name][1]} for name in names],
        "first": first,
        "repaired_height": REPAIRED_HEIGHT,
        "sets": sets,
    }
    return msgspec.json.encode(page).decode()


TIME = "Time since the onset of the payout (s)"


def _packed(columns: Signal) -> dict[str, object]:
    """Curves (c, n) as whole numbers of two bytes, low byte first, over their common range."""
    low, high = float(columns.min()), float(columns.max())
    share = (columns - low) / max(high - low, 1e-300)
    whole = np.round(np.clip(share, 0.0, 1.0) * LEVELS).astype("<u2")
    return {
        "low": float(f"{low:.7g}"),
        "high": float(f"{high:.7g}"),
        "values": [base64.b64encode(row.tobytes()).decode() for row in whole],
    }


ABOVE, BELOW, APART, TITLE = 0.86, 0.4, 0.07, 0.3
"""Heights of the panel of a channel and of its residual, between the two, and of the title of the channel. [in]"""

HEAD, FOOT = 0.25, 0.42
"""Margins above and below the panels. [in]"""

LINES: tuple[LineStyle, ...] = (
    {"color": COLOURS["ink"], "lw": 0.8},
    {"color": COLOURS["mech"], "lw": 1.0, "ls": DASHES},
    {"color": COLOURS["gen"], "lw": 1.2},
)
"""Styles of what is logged, given, and with the fitted effects."""


def histories_figure(found: ModelDiagnosis, item: CycleHistory, word: str) -> Figure:
    """Draw one cycle; what a page exchanges has a name with the number of its panel: `trace-0-1`, `span-0`, `xaxis-0`."""
    any_repaired = any(log.run.gaps for log in found.data.logs)
    channels = seen_channels(found)
    height = HEAD + FOOT + (TITLE + ABOVE + APART + BELOW) * len(channels)
    figure, top, (left, right) = wide_figure(height), height - HEAD, Margins(left=0.125).edges
    for n, name in enumerate(channels):
        title, unit, factor = AXES[name]
        k = CHANNELS.index(name)
        top -= TITLE + ABOVE
        first = figure.axes[0] if figure.axes else None
        above = figure.add_axes((left, top / height, right - left, ABOVE / height), sharex=first)
        top -= APART + BELOW
        below = figure.add_axes((left, top / height, right - left, BELOW / height), sharex=above)
        curves = [x[:, k] * factor for x in item.sides]
        _panel(above, 2 * n, item, list(zip(curves, LINES, range(3), strict=False)))
        if any_repaired:
            mark_repaired(above, item.repaired.get(name, ()) or [_NOWHERE], f"repaired-{2 * n}")
        residuals = [curves[0] - simulated for simulated in curves[1:]]
        _panel(below, 2 * n + 1, item, list(zip(residuals, LINES[1:], (1, 2), strict=False)))
        below.axhline(0.0, color=COLOURS["soft"], lw=0.5, gid=f"zero-{2 * n + 1}")
        above.set_title(f"({'abcde'[n]}) {title}", loc="left", pad=3)
        label_upright(above, title, unit)
        below.set_ylabel(f"Residual\n({unit})", fontsize=6.5)
        above.tick_params(labelbottom=False)
        if n < len(channels) - 1:
            below.tick_params(labelbottom=False)
        else:
            below.set_xlabel(TIME)
    simulated = [line_entry(baseline_words(found), "mech", lw=1.0, ls=DASHES), line_entry(AFTER, "gen", lw=1.2)]
    legend_above(
        figure,
        [
            line_entry(word, "ink", lw=0.8),
            *simulated[: len(item.sides) - 1],
            patch_entry("payout", "payout", lw=0),
            *([patch_entry(REPAIRED, "repaired", lw=0)] if any_repaired else []),
        ],
    )
    for ax in figure.axes:
        ax.yaxis.set_label_coords(-0.7 * left / (right - left), 0.5)
    return figure


_NOWHERE = (-1e3, -1e3)
"""A stretch that lies outside of every panel: a page exchanges the mark of a cycle without repaired stretches too. [s]"""


def _panel(ax: Axes, number: int, item: CycleHistory, lines: list[tuple[Signal, LineStyle, int]]) -> None:
    """Draw curves over time, the first one on top, with the payout shaded."""
    ax.axvspan(0.0, item.payout_end, color=COLOURS["payout"], lw=0, zorder=0.1, gid=f"span-{number}")
    for values, style, line in lines:
        ax.plot(item.t, values, gid=f"trace-{number}-{line}", zorder=3.0 - 0.1 * line, **style)
    ax.set_xlim(item.t[0], item.t[-1])
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.tick_params(axis="y", labelsize=6.5)
    ax.xaxis.set_gid(f"xaxis-{number}")
    ax.yaxis.set_gid(f"yaxis-{number}")
